"""The equations of the meshes, whatever the machine around them: orders, residual, error bound.

A mesh feels the rest of the machine only through its dynamic compliance G (`compliance`). The swing
x = -phi u of the mesh forces and the deflections u = u0 + G x of the meshes are the only unknowns,

    (1 + phi G) x = -phi u0,                                     lines 0..N of every mesh,

a number a line for a single pair.

Orders. Multiple scales gives x^(1) = -phi u0, x^(k+1) = -phi G x^(k); they are summed as they come,
or taken as a basis and recombined so that the residual is least (`LeastResidual`), or all lines are
solved together.

Bound. An approximation x of lines 0..N leaves the residual r_0..r_{N+J} of the full equation, all
of it known. Above a core of lines 0..n', beyond which |G| is far below 1/max|phi|, it is answered
explicitly, e = G r_n for n > n'; what then remains is r_0..r_n' less phi e, and

    ||error of acceleration|| <= ||e''|| + gain (||r_0..r_n'|| + max|phi| ||e|| + rounding)

with the gain of the inverse (`error_bound` for pairs, `inverse_norm` for machines); or, with the
rest answered once more above the core,

    ||e''|| + gain (||s_0..s_n'|| + max|phi|^2 max_{n>n'}|G| ||e|| + rounding)
           + max|phi| ||e|| max_{n>n'} |acceleration/x|.

So high harmonics, solved for or not, cost what they are worth and not the gain of a resonance they
have no part in.

Sources: Eisenstat, Elman and Schultz, SIAM J. Numer. Anal. 20 (1983) 345 (least residual); the
choice of the next direction is that of Jiranek and Rozloznik, J. Comput. Appl. Math. 214 (2008)
303.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from gearmon.dynamics.compliance import PairCompliance, SystemCompliance, inverse_norm
from gearmon.dynamics.error_bound import Gain, Pattern, best_gain
from gearmon.dynamics.floquet import SETTLED, system_multipliers
from gearmon.dynamics.fourier import UNIT_ROUNDOFF, Complex, Modulation, Real, cut
from gearmon.dynamics.hill import HillProblem
from gearmon.dynamics.system import HillSystem

MOST_ROUNDS, MOST_ORDERS = 12, 400
BYTES_FOR_BASIS = 400e6
#: A residual that falls by less makes a poor next direction: the last image is taken.
STALLED = 0.95
#: Sizes below are not divided by.
SMALLEST = 1e-200


@dataclass(frozen=True)
class Approximation:
    """An approximate steady vibration, and how good it is.

    Attributes
    ----------
    swing : complex ndarray, shape (..., N+1)
        x.
    deflection, motion : complex ndarray, shape (..., N+1)
        u, and the lines of all coordinates; of a pair the same.
    residual : complex ndarray, shape (..., N+J+1)
        Of the full equation.
    relative : float ndarray
        Guaranteed relative L2 error of the acceleration handed out; may be infinite.
    size, error : float ndarray
        Rms of the acceleration handed out, and bound of its rms error; of pairs over w0^2.
    orders : int
        Orders of the expansion that went into it.
    """

    swing: Complex
    deflection: Complex
    motion: Complex
    residual: Complex
    relative: Real
    size: Real
    error: Real
    orders: int

    @property
    def highest(self) -> int:
        """N."""
        return int(self.swing.shape[-1]) - 1


class MeshEquations:
    """Residuals and error bounds of approximations to one problem.

    Parameters
    ----------
    compliance : PairCompliance or SystemCompliance
    pattern : Pattern
        phi, of every mesh a row.
    shown : int, optional
        Harmonics 0..shown are handed out, others dropped; default all.
    """

    def __init__(
        self,
        compliance: PairCompliance | SystemCompliance,
        pattern: Pattern,
        shown: int | None = None,
    ) -> None:
        self.compliance, self.pattern, self.shown = compliance, pattern, shown
        self._products: dict[tuple[int, int], Modulation] = {}

    @cached_property
    def gain(self) -> Gain:
        """Bound of the inverse operator, and stability."""
        c = self.compliance
        if isinstance(c, SystemCompliance):
            stable = bool(np.abs(self.multipliers[:1]).max(initial=0.0) < 1 - SETTLED)
            # what never dies out has no steady state, and no bound worth an inverse
            known = self.gain_by_inverse if stable else np.array(math.inf)
            return Gain(acceleration=known, stable=np.array(stable))
        found = best_gain(c.ratio, c.zeta, np.ones(1), self.pattern)
        return Gain(acceleration=found.acceleration[0], stable=found.stable[0])

    @cached_property
    def gain_by_inverse(self) -> Real:
        """Bound of the inverse operator by the inverse of a matrix of the core."""
        most = self.compliance.most_from(0)[1]
        return np.array(most * inverse_norm(self.compliance, self.pattern))

    @cached_property
    def multipliers(self) -> Complex:
        """Floquet multipliers of a machine, the largest modulus first."""
        assert isinstance(self.compliance, SystemCompliance)
        return system_multipliers(self.compliance, self.pattern.harmonics)

    def modulate(self, half: Complex, outputs: int) -> Complex:
        """Harmonics 0..outputs of phi times a function."""
        key = half.shape[-1] - 1, outputs
        if key not in self._products:
            self._products[key] = Modulation(self.pattern.harmonics, *key)
        return self._products[key](half)

    def zeros(self, highest: int) -> Complex:
        """X = 0 of lines 0..highest."""
        return np.zeros((*self.compliance.rows, highest + 1), dtype=complex)

    @cached_property
    def core(self) -> int:
        """Harmonic above which |G| max|phi| <= 1/10 and |G| <= 1/10: each order gains a digit."""
        return self.compliance.quiet_above(0.1 / max(1.0, self.pattern.highest))

    def judge(self, x: Complex, orders: int = 0) -> Approximation:
        """Compute residual and bound of x, shape (..., N+1), that `orders` orders made."""
        c, count, size = self.pattern.harmonics, x.shape[-1], self.compliance.size
        u, motion = self.compliance.state(x)
        # phi times the large mean deflection is known without a transform and its rounding
        mean = u[..., :1].real.copy()
        u[..., :1] = 0
        highest = count - 1 + c.shape[-1]
        left = self.modulate(u, highest) if u.any() else self.zeros(highest)
        left[..., 1 : c.shape[-1] + 1] += mean * c
        left[..., :count] += x
        residual: Complex = np.negative(left, out=left)
        # rounding of x, of the forces and of a product by transforms
        depth = self.compliance.depth + math.log2(4 * count + 2 * c.shape[-1])
        rounding = size(x) + self.compliance.swinging_forces
        rounding = rounding + depth * self.pattern.highest * size(u)
        rounding = rounding + size(np.asarray(mean * self.pattern.size, dtype=complex))
        u[..., :1] = mean
        bound = self._bound(motion, residual, UNIT_ROUNDOFF * rounding)
        return Approximation(x, u, motion, residual, *bound, orders)

    def size(self, motion: Complex) -> Real:
        """Rms acceleration of the harmonics of a motion that are handed out."""
        highest = motion.shape[-1] - 1
        last = highest if self.shown is None else min(self.shown, highest)
        return self.compliance.size(self.compliance.weights(last) * motion[..., : last + 1])

    def _bound(self, motion: Complex, residual: Complex, rounding: Real) -> tuple[Real, Real, Real]:
        """Relative error, size, and error of the acceleration."""
        inner, above = self._shares(residual, min(self.core, motion.shape[-1] - 1))
        rounding, size = _times(self.gain.acceleration, rounding), self.size(motion)
        total = inner + above + rounding
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = np.where(total < size, total / (size - total), np.inf)
        return np.where(total == 0, 0.0, relative), size, total

    def _shares(self, residual: Complex, core: int) -> tuple[Real, Real]:
        """Bounds of the error that residuals of the core and above it cause."""
        compliance, gain = self.compliance, self.gain.acceleration
        extra = compliance.answer(residual, core + 1)
        pair = isinstance(compliance, PairCompliance)
        direct = self.size(extra if pair else compliance.motion(residual, core + 1))
        inner = _times(gain, compliance.size(residual[..., : core + 1]))
        swing = self.pattern.highest
        spread = swing * compliance.size(extra)
        coupled = _times(gain, spread)
        if coupled <= 0.1 * (inner + direct):
            return inner, direct + coupled
        # what the lines above do to the core is computed, and only their second answer is bounded
        back = self.modulate(extra, core)
        most, accelerated = compliance.most_from(core + 1)
        second = _times(gain, compliance.size(residual[..., : core + 1] - back))
        beyond = direct + spread * accelerated + _times(gain, spread * swing * most)
        better = second + beyond < inner + direct + coupled
        return (second, beyond) if better else (inner, direct + coupled)


def _times(gain: Real, size: Real) -> Real:
    """Product in which nothing times an unknown gain is nothing."""
    with np.errstate(invalid="ignore"):
        return np.where(size > 0, gain * size, 0.0)


def equations_of(problem: HillProblem | HillSystem, shown: int | None = None) -> MeshEquations:
    """Equations of the meshes of a pair or of a machine; harmonics above `shown` are dropped."""
    if isinstance(problem, HillSystem):
        return MeshEquations(SystemCompliance(problem), Pattern(problem.mesh_harmonics), shown)
    ratio, zeta = np.array([problem.frequency_ratio]), np.array([problem.damping_ratio])
    forces = problem.static_forcing(len(problem.force_harmonics_n))
    return MeshEquations(
        PairCompliance(ratio, zeta, forces), Pattern(problem.stiffness_harmonics), shown
    )


def least_residual(
    coupling: Callable[[Complex], Complex], right_side: Complex, target: float, most: int
) -> tuple[Complex, int]:
    """Recombine orders of (1 + K) x = right side for the least residual.

    Parameters
    ----------
    coupling : callable
        Half spectra x -> K x, real-linear, same shape.
    right_side : complex ndarray, shape (..., N+1)
        Half spectrum, or one of every mesh; not zero.
    target : float
        Rms residual at which it ends; it ends as well where rounding is left, or no more orders.
    most : int
        Largest number of orders.

    Returns
    -------
    (ndarray, int)
        x and how many orders made it.

    Notes
    -----
    The images of the directions are kept orthonormal (generalised conjugate residuals, GMRES in
    exact arithmetic).
    """
    # scaled so that the dot product of real views is the mean product over the period
    weights = np.where(np.arange(right_side.shape[-1]) > 0, math.sqrt(2.0), 1.0)

    def flat(half: Complex) -> Real:
        return np.asarray((weights * half).ravel().view(float))

    def spectrum(row: Real) -> Complex:
        return np.asarray(row.view(complex).reshape(right_side.shape) / weights)

    rest = flat(right_side)
    size = len(rest)
    total, residual, orders, stalled = np.zeros_like(rest), _length(rest), 0, False
    most = max(1, min(most, size - 1, int(BYTES_FOR_BASIS / (16 * size))))
    # a row an order: an orthonormal image (1 + K) p, and behind it the direction p
    basis = np.empty((min(most, 16), 2 * size))
    # what rounding leaves cannot be taken out by more directions, which only would grow
    target = max(target, 8 * UNIT_ROUNDOFF * residual)
    while residual > target and orders < most:
        direction = basis[orders - 1, :size] if stalled else rest
        row = np.concatenate([direction + flat(coupling(spectrum(direction))), direction])
        known, image = basis[:orders], row[:size]
        whole = _length(image)
        row -= (known[:, :size] @ image) @ known
        if _length(image) < 0.5 * whole:
            # where much cancelled, a second pass keeps the basis orthogonal to rounding
            row -= (known[:, :size] @ image) @ known
        length = _length(image)
        if length <= max(1e-14 * whole, SMALLEST):
            break
        if orders == len(basis):
            basis = np.concatenate([basis, np.empty((min(orders, most - orders), 2 * size))])
        row /= length
        basis[orders], orders = row, orders + 1
        share = float(image @ rest)
        total += share * row[size:]
        rest -= share * image
        before, residual = residual, _length(rest)
        stalled = residual > STALLED * before
    return spectrum(total), orders


def _length(row: Real) -> float:
    return float(np.linalg.norm(row))


def recombine(equations: MeshEquations, x: Complex, tolerance: float, most: int) -> Approximation:
    """Improve x by one least-residual combination of at most `most` orders.

    Parameters
    ----------
    equations : MeshEquations
    x : complex ndarray, shape (..., N+1)
        What is known so far, zeros to begin with.
    tolerance : float
        Relative error of the acceleration aimed at: the residual is reduced to 0.4 of what it
        allows.
    most : int
        Largest number of orders.

    Notes
    -----
    Only the core harmonics take part in the combination. Above them a plain order gains a digit,
    and one is taken before.
    """
    known = equations.judge(x)
    core, count = min(equations.core, known.highest), x.shape[-1]
    if most < 1:
        return known
    orders = 0
    if core < known.highest:
        above = known.residual[..., :count].copy()
        above[..., : core + 1] = 0
        known = equations.judge(known.swing + above)
        orders = 1
    right_side = known.residual[..., : core + 1]
    if orders >= most or not right_side.any():
        return replace(known, orders=orders)

    def coupling(swing: Complex) -> Complex:
        return equations.modulate(equations.compliance.answer(swing), core)

    # the rms residual of the core that leaves 0.4 of the tolerance
    motion, gain = known.motion.copy(), equations.gain.acceleration
    motion[..., : core + 1] += equations.compliance.motion(right_side)
    swing = np.maximum(known.size, equations.size(motion))
    target = 1e-3 * equations.compliance.size(right_side) if np.isinf(gain) else 0.4 * swing / gain
    inner, own = least_residual(coupling, right_side, float(target) * tolerance, most - orders)
    x = known.swing.copy()
    x[..., : core + 1] += inner
    return equations.judge(x, orders + own)


def plain_sum(
    equations: MeshEquations, x: Complex, tolerance: float, order: int | None
) -> Approximation:
    """Sum the orders as they come: `order` of them, or until they meet the tolerance or diverge.

    Only the number of lines is taken from x.
    """
    compliance, total = equations.compliance, np.zeros_like(x)
    term = equations.judge(total).residual[..., : x.shape[-1]]
    smallest, used = math.inf, 0
    while used < (MOST_ORDERS if order is None else order):
        total = total + term
        used += 1
        if order is None:
            size = equations.size(compliance.motion(term))
            whole = equations.size(compliance.state(total)[1])
            smallest = min(smallest, float(size))
            if size <= 0.1 * tolerance * whole and (
                size <= 1e-3 * tolerance * whole or equations.judge(total).relative <= tolerance
            ):
                break
            if size > 1e3 * smallest:
                break
        term = -equations.modulate(compliance.answer(term), x.shape[-1] - 1)
    return equations.judge(total, used)


def balance(equations: MeshEquations, x: Complex) -> Approximation:
    """Solve all lines of x together, refined once so that only rounding is left.

    Raises
    ------
    ArgumentError
        If the matrix would not fit in memory.
    """
    x = np.zeros_like(x)
    for _ in range(2):
        residual = equations.judge(x).residual[..., : x.shape[-1]]
        x = x + equations.compliance.together(equations.pattern, residual)
    return equations.judge(x)


def first_highest(equations: MeshEquations, tolerance: float) -> int:
    """Guess the number of harmonics that a tolerance takes.

    The significant stiffness harmonics all appear at first order. Above them and above resonance,
    a line is reached only by jumps of about the mean bandwidth of phi, each of which costs
    max|phi| |G|.
    """
    compliance, shown, swing = equations.compliance, equations.shown, equations.pattern.highest
    sizes = np.atleast_2d(np.abs(equations.pattern.harmonics)).sum(axis=0)
    given = max(2, len(compliance.forces) - 1, shown or 1)
    if not (swing and sizes.any()):
        return max(given, compliance.quiet_above(2.3))
    # shares, so that squares of tiny ones do not vanish
    sizes = sizes / sizes.max()
    # lines at which an order may gain less than half, and those that resonate
    top = max(given, compliance.quiet_above(min(2.3, 0.5 / swing)))
    orders = np.arange(1.0, len(sizes) + 1)
    if shown is not None:
        # a line that is not handed out matters by what it gives to the others
        hidden = np.minimum(1, (compliance.quiet_above(2.3) / orders) ** 2)
        sizes = np.where(orders > shown, sizes * hidden, sizes)
    above = np.sqrt(np.cumsum((sizes**2)[::-1]))[::-1]
    top = max(top, int((above > 0.1 * tolerance * above[0]).sum()))
    jump = max(1, round(float(orders @ sizes / sizes.sum())))
    share, gained = 1.0, 0.5
    for _ in range(400):
        if share < 3e-3 * tolerance:
            break
        top += jump
        gained = max(SMALLEST, min(0.8, swing * compliance.most_from(top)[0]))
        share *= gained
    # no more of the last jump than it takes
    return top - int(jump * math.log(3e-3 * tolerance / share) / -math.log(gained))


def widen(
    equations: MeshEquations,
    tolerance: float,
    improve: Callable[[Complex], Approximation],
    repeat: bool = True,
    counts_add: bool = True,
) -> Approximation:
    """Improve and add harmonics in turn, until the tolerance is met or neither helps.

    Parameters
    ----------
    equations : MeshEquations
    tolerance : float
    improve : callable
        x, zeros to begin with -> a better approximation.
    repeat, counts_add : bool
        Whether to try more than once, and whether orders of all rounds count.
    """
    found = improve(equations.zeros(first_highest(equations, tolerance)))
    orders = found.orders
    for _ in range(MOST_ROUNDS if repeat else 0):
        if found.relative <= tolerance:
            break
        highest = _larger(equations, found, tolerance)
        better = improve(cut(found.swing, highest))
        orders = better.orders + counts_add * orders
        old, found = found, replace(better, orders=orders)
        left, before = (equations.compliance.size(one.residual) for one in (found, old))
        if highest == old.highest and left > 0.5 * before:
            break
    return found


def _larger(equations: MeshEquations, found: Approximation, tolerance: float) -> int:
    """Find the harmonic beyond which the residual asks for too little to matter."""
    compliance, gain = equations.compliance, equations.gain.acceleration
    left, first = found.residual, found.highest + 1
    weights = compliance.weights(left.shape[-1] - 1) * (equations.shown is None)
    worth = weights * compliance.per_line(compliance.motion(left, first))
    if gain < math.inf:
        answer = compliance.answer(left, first)
        worth = worth + gain * equations.pattern.highest * compliance.per_line(answer)
    worth = worth / (tolerance * found.size)
    beyond = np.sqrt(2 * np.cumsum((worth**2)[::-1]))[::-1]
    if beyond[0] <= 0.4:
        return found.highest
    needed = int((beyond > 0.1).sum())
    return max(needed, found.highest + max(8, found.highest // 4))


def sharpened(equations: MeshEquations, found: Approximation) -> Approximation:
    """Bound a large error by the distance from a good solution and the error of that one."""
    if not equations.gain.stable:
        return found
    for _ in range(2):
        wanted = max(1e-12, 0.05 * min(float(found.relative), 0.1))
        improve = partial(recombine, equations, tolerance=wanted, most=MOST_ORDERS)
        better = widen(equations, wanted, improve)
        last = max(found.highest, better.highest)
        apart = cut(better.motion, last) - cut(found.motion, last)
        size, left = equations.size(better.motion), better.error
        if left < size:
            relative = (equations.size(apart) + left) / (size - left)
            relative = np.minimum(found.relative, relative)
            found = replace(found, relative=relative)
    return found
