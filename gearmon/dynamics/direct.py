"""All lines of a small pair solved together: one band factorisation, certified by itself.

Lines -N..N are solved by LAPACK's band factors; the lines above N are answered by r_n/D_n, the core
once more by the factors, and so on: every sweep divides the residual by about |D_N|/max|phi|. All
is kept in units of the largest static deflection.

The bound needs no second factorisation. Where max|phi| max 1/|D| < 1 over all frequencies the
Neumann series gives the gain of the inverse operator and stability in one. Elsewhere both come
from the determinant that the factors hold, Hill's infinite determinant

    Q = det((D + phi) D^-1) = det(1 - M)/det(1 - M_0),

with M the map of the state over a period and M_0 that of constant stiffness. With
p = e^{-4 pi zeta R} the multipliers are the roots of rho^2 - (1 + p - q) rho + p = 0,
q = Q det(1 - M_0), so the system is stable if and only if 0 < q < 2 (1 + p). And with column norms
s_n^2 = |D_n|^2 + ms(phi), Hadamard's inequality and that of the means give

    ||(D + phi)^-1 r|| <= max(1/s_n) sqrt(e) prod_n (s_n/|D_n|) / |Q| ||r||.

What lies beyond the lines solved changes ln Q by at most what `beyond_lines` computes.
(Hill, Acta Math. 8, 1886; Magnus and Winkler, Hill's Equation, 1966.)
"""

from __future__ import annotations

import cmath
import math
from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np

from gearmon.dynamics.fourier import UNIT_ROUNDOFF, Complex, Real, cut, supremum, with_zero_mean
from gearmon.dynamics.hill import HillProblem, largest_responses, stiffness_at

MOST_LINES = 4000
NEAR_ONE = 0.9
FEW_HARMONICS = 14
SPARE = 1e-3
SPARE_WEAK = 1e-5


@lru_cache(maxsize=256)
def lines(first: int, last: int) -> Real:
    """Return first, ..., last as floats, read-only."""
    numbers = np.arange(first, last + 1, dtype=float)
    numbers.flags.writeable = False
    return numbers


def peak(zeta: float) -> float:
    """Largest 1/|D|, and largest x^2/|D|, over all real frequencies; zeta > 0."""
    inner = min(zeta, math.sqrt(0.5))
    return 1 / (2 * inner * math.sqrt(1 - inner * inner))


@cache
def _lapack() -> tuple[Any, Any]:
    """Band solver and the one that uses its factors; SciPy takes 0.2 s to import, once."""
    from scipy.linalg.lapack import zgbsv, zgbtrs

    return zgbsv, zgbtrs


class BandSystem:
    """The equations of one problem in the units of its largest static deflection.

    Call `factorise`, then `begin`, then `sweep` as often as the residual asks for.

    Parameters
    ----------
    problem : HillProblem
        With damping and at least one stiffness harmonic.
    """

    #: z without the mean deflection under the mean force, harmonics 0.. in units of `unit`
    swinging: Complex

    def __init__(self, problem: HillProblem) -> None:
        self.c = problem.stiffness_harmonics
        self.band = len(self.c)
        self.ratio = problem.frequency_ratio
        self.zeta = problem.damping_ratio
        self.sizes = np.abs(self.c)
        self.sum = float(np.add.reduce(self.sizes))
        self.forces = problem.force_harmonics_n
        force = abs(problem.force_n)
        if len(self.forces):
            force = max(force, float(np.abs(self.forces).max()))
        self.scale = force
        self.unit = force / problem.stiffness_n_per_m
        self.mean = problem.force_n / force if force else 0.0
        self.swing = 2 * self.sum
        #: max 1/|D| over all frequencies, and times max|phi|
        self.peak = peak(self.zeta)
        self.loop = self.swing * self.peak
        self.pressed = False

    def nearest(self, line: int) -> float:
        """|D_n|; above resonance, the least of all from there on."""
        x = line / self.ratio
        return math.hypot(1 - x * x, 2 * self.zeta * x)

    def enough_lines(self, tolerance: float) -> int:
        """Guess the lines to solve together; those above are cheap to add.

        A line above resonance is reached by jumps of about the mean bandwidth of phi, each of
        which costs sum|c|/|D_n|.
        """
        total, band, ratio = self.sum, self.band, self.ratio
        top = max(band, math.ceil(1.2 * ratio) + 1, len(self.forces), 2)
        if not total:
            return top
        jump = max(1, round(float(lines(1, band).dot(self.sizes)) / total))
        weak = self.loop >= NEAR_ONE
        wanted = (SPARE_WEAK if weak else SPARE) * tolerance
        reached, share, step = 1.2, 1.0, jump / ratio
        most = MOST_LINES / ratio
        while share > wanted and reached < most:
            reached += step
            each = total / (reached * reached - 1)
            share *= each if each < 0.8 else 0.8
        if weak:
            # the bound of what lies beyond wants edges clear of the resonance
            top = max(top, math.ceil(1.4 * ratio) + band)
        if band <= FEW_HARMONICS:
            # another jump takes less time than to answer the lines above
            reached += step
        return max(top, math.ceil(reached * ratio))

    def factorise(self, solved: int) -> bool:
        """Factorise the band matrix of lines -solved..solved; False if it is singular.

        The forces are answered on the way, the constant one standing on the mean stiffness.
        """
        band = self.band
        self.solved = solved
        x = lines(-solved, solved) * (1 / self.ratio)
        self.squares, self.diagonal = (x * x)[solved:], stiffness_at(x, self.zeta)
        self.stiffness = self.diagonal[solved:]
        matrix = np.empty((2 * solved + 1, 3 * band + 1), dtype=complex)
        kernel = self.kernel = np.zeros(2 * band + 1, dtype=complex)
        kernel[band + 1 :] = self.c
        np.conjugate(self.c[::-1], out=kernel[:band])
        # LAPACK fills the first J rows of its storage itself
        matrix[:, band:] = kernel
        matrix[:, 2 * band] = self.diagonal
        # forces on lines -solved..solved, less phi times the mean force
        forcing = np.zeros(2 * solved + 1, dtype=complex)
        np.multiply(kernel, -self.mean, out=forcing[solved - band : solved + band + 1])
        count = len(self.forces)
        if count:
            forcing[solved + 1 : solved + count + 1] += self.forces / self.scale
            forcing[solved - count : solved] += self.forces[::-1].conj() / self.scale
        #: right side of lines 0..solved
        self.forcing: Complex = forcing[solved:].copy()
        # LAPACK reads the rows of this array as the columns of its band storage
        self.factors, self.pivots, self.core, failed = _lapack()[0](
            band, band, matrix.T, forcing, overwrite_ab=1, overwrite_b=1
        )
        return bool(failed == 0)

    def begin(self) -> None:
        """Take the answer of the core, and what it makes of many lines above it."""
        solved, band = self.solved, self.band
        padded = self.core[solved - band :]
        if band > FEW_HARMONICS:
            # lines N+1..N+J, each answering the core alone
            self._stiffness(solved + band + 1)
            coupled = np.correlate(padded[-band:], self.kernel, "full")[-band:]
            coupled /= self.stiffness[solved + 1 :]
            padded = np.concatenate([padded, np.negative(coupled, out=coupled)])
        self._take(padded)

    def sweep(self) -> None:
        """Correct the core and the lines above it by what the residual asks for.

        The lines above are answered one by one, after what the core's correction does to them.
        """
        solved, band = self.solved, self.band
        residual = np.negative(self.excess)
        inner = residual[: solved + 1]
        whole = np.concatenate([inner[:0:-1].conj(), inner])
        core = _lapack()[1](self.factors, band, band, whole, self.pivots, overwrite_b=1)[0]
        reach = len(residual)
        self._stiffness(reach)
        padded = np.zeros(reach + band, dtype=complex)
        swinging = padded[band:]
        swinging[: solved + 1] = core[solved:]
        outer = swinging[solved + 1 :]
        outer += residual[solved + 1 :]
        outer[:band] -= np.correlate(core[2 * solved + 1 - band :], self.kernel, "full")[-band:]
        outer /= self.stiffness[solved + 1 :]
        swinging[: len(self.swinging)] += self.swinging
        self._take(padded)

    def _stiffness(self, count: int) -> None:
        """Provide D_n and (n/R)^2 of lines 0..count - 1."""
        x = lines(0, count - 1) * (1 / self.ratio)
        self.squares, self.stiffness = x * x, stiffness_at(x, self.zeta)

    def _take(self, padded: Complex) -> None:
        """Take lines -J..-1, to be set, and 0.., and compute what they leave of the equations.

        phi times the mean force needs no product and its rounding.
        """
        band = self.band
        swinging = padded[band:]
        # rounding of the unsymmetric factors must not feed on itself
        swinging.imag[0] = 0.0
        np.conjugate(swinging[band:0:-1], out=padded[:band])
        self.swinging = swinging
        # phi_{n-m} is the conjugate of phi_{m-n}: the product is a correlation
        excess = np.correlate(padded, self.kernel, "full")[2 * band :]
        excess[: len(swinging)] += self.stiffness * swinging
        excess[: len(self.forcing)] -= self.forcing
        self.excess = excess

    def vibration(self, shown: int | None) -> tuple[Complex, int]:
        """Displacement [m] as handed out, and its highest harmonic that was computed."""
        whole: Complex = self.swinging * self.unit
        whole[0] += self.unit * self.mean
        last = len(whole) - 1
        return cut(whole, shown), last if shown is None else min(shown, last)


# N J^2 up to which factors take less time than orders, of which few do where they converge fast
MOST_WORK_BESIDE_FEW_ORDERS = 4e5
MOST_WORK = 4e6
MOST_SWEEPS = 6
QUICK = 0.7
FARTHEST = 1 << 40
MOST_BEYOND = 0.5
MOST_GROWTH = 600.0
LEAST = 1e-300


class Solution(NamedTuple):
    """A steady vibration found directly.

    Attributes
    ----------
    displacement : complex ndarray, shape (N+1,)
        z_0..z_N [m].
    bound : float
        Guaranteed relative L2 error of the acceleration.
    stable : bool
        Whether free vibrations die out.
    solved : int
        Highest harmonic of the matrix; those above were added one by one.
    pressed : bool
        Whether the acceleration is so small that the teeth stay in contact for certain.
    """

    displacement: Complex
    bound: float
    stable: bool
    solved: int
    pressed: bool


def solve(problem: HillProblem, tolerance: float, shown: int | None = None) -> Solution | None:
    """Steady vibration of a small problem, or None where another way is called for.

    None is returned for problems too large to be cheap, without damping or coupling, too close to
    instability for the determinant to tell, and where the tolerance is not met.

    Parameters
    ----------
    problem : HillProblem
        The equation.
    tolerance : float
        Relative L2 error of the acceleration aimed at.
    shown : int, optional
        Harmonics 0..shown are handed out, others dropped; default all.
    """
    count = len(problem.stiffness_harmonics)
    # no fewer lines are solved than the stiffness has
    if not count or problem.damping_ns_per_m <= 0 or count**3 > MOST_WORK:
        return None
    system = BandSystem(problem)
    if not system.scale:
        return None
    solved = system.enough_lines(tolerance)
    work = MOST_WORK_BESIDE_FEW_ORDERS if system.loop < QUICK else MOST_WORK
    if solved > MOST_LINES or solved * system.band**2 > work or not system.factorise(solved):
        return None
    inverse = cheap(system)
    if inverse is None:
        return None
    system.begin()
    bound = math.inf
    # until the bound meets the tolerance or rounding keeps it from falling
    for sweep in range(MOST_SWEEPS + 1):
        if sweep:
            system.sweep()
        displacement, last = system.vibration(shown)
        before, bound = bound, relative_bound(system, inverse, last)
        if not inverse.stable or bound <= tolerance or bound > 0.5 * before < math.inf:
            break
    if inverse.stable and not bound <= tolerance:
        return None
    return Solution(displacement, bound, inverse.stable, system.solved, system.pressed)


class InverseBound(NamedTuple):
    """What is known of the inverse operator.

    Attributes
    ----------
    gain : float
        ||(L^{-1} r)''|| <= gain ||r||, accelerations over w0^2.
    edge_gain : float
        The same for residuals of the lines above `inside` only.
    inside : int
        See there.
    stable : bool
        Whether free vibrations die out.
    """

    gain: float
    edge_gain: float
    inside: int
    stable: bool


class Determinant(NamedTuple):
    """Hill's determinant of finitely many lines.

    Attributes
    ----------
    value : float
        Q of the lines solved.
    growth : float
        sqrt(e) prod_n (s_n/|D_n|) over all lines.
    constant : float
        ln of det(1 - M_0) e^{2 pi zeta R}/4.
    """

    value: float
    growth: float
    constant: float


def relative_bound(system: BandSystem, inverse: InverseBound, last: int) -> float:
    """Bound of the relative error, of harmonics 0..last."""
    accelerations: Complex = system.squares * system.swinging
    size = _size(accelerations)
    # F - m z'' is the mesh force, and the sum of N lines is at most sqrt(2 N) times their rms
    reach = math.sqrt(2 * len(accelerations)) * size
    system.pressed = reach < 0.999 * abs(system.mean) and not len(system.forces)
    swinging = _size(system.swinging)
    damped = 2 * system.zeta * math.sqrt(size * swinging)
    # products with phi, forces of mass and damper, and n/R and the damping ratio themselves
    rounding = (
        2 * system.sum * ((system.band + 3) * swinging + abs(system.mean))
        + swinging
        + 6 * size
        + 4 * damped
    )
    error = inverse.gain * UNIT_ROUNDOFF * rounding
    edge = inverse.inside + 1
    error += inverse.gain * _size(system.excess[:edge])
    if edge < len(system.excess):
        error += inverse.edge_gain * _size(system.excess[edge:])
    if last < len(accelerations) - 1:
        size = _size(accelerations[: last + 1])
    return error / (size - error) + 2 * UNIT_ROUNDOFF if error < size else math.inf


def cheap(system: BandSystem) -> InverseBound | None:
    """Gains from residual to acceleration, and stability; None if neither rule tells."""
    if system.loop < NEAR_ONE:
        gain = system.peak / (1 - system.loop)
        return InverseBound(gain, gain, FARTHEST, True)
    return _by_determinant(system)


def _by_determinant(system: BandSystem) -> InverseBound | None:
    distance = _distance(system)
    if distance is None:
        return None
    inside, nearest, decay = distance
    margin = nearest - system.swing
    power = 2 * float(np.vdot(system.sizes, system.sizes))
    known = determinant(system, power)
    if known is None:
        return None
    static, largest = largest_responses(system.ratio, system.zeta, power)
    norm_bound = known.growth / abs(known.value)
    edge = 1 / margin + decay * decay * static * norm_bound
    stable, beyond = _stability(system, known, power, edge)
    if stable is None:
        return None
    norm_bound *= math.exp(beyond)
    gain = largest * norm_bound
    # residuals of lines well above resonance reach it only through jumps of phi/D
    # beyond resonance x^2/|D| falls, or never exceeds 1.16 where damping is strong
    local = max(1.16, ((inside + 1) / system.ratio) ** 2 / nearest) * nearest / margin
    edge_gain = gain * decay + local * (1 + system.swing * static * norm_bound * decay)
    return InverseBound(gain, edge_gain, system.solved - system.band, stable)


def _distance(system: BandSystem) -> tuple[int, float, float] | None:
    """Line n above resonance, |D_n+1|, and what comes from the edge to lines 0..n at most.

    Lines within J of the edge are k jumps away from those up to n = N - kJ, and each jump costs
    max|phi|/|D_n+1|.
    """
    if system.swing > 0.1 * system.nearest(system.solved - system.band + 1):
        system.swing = supremum(with_zero_mean(system.c))
    swing, best = system.swing, None
    for jumps in range(1, 30):
        inside = system.solved - jumps * system.band
        if inside + 1 <= system.ratio:
            break
        nearest = system.nearest(inside + 1)
        if nearest <= swing:
            break
        decay = (swing / nearest) ** (jumps - 1) * swing / (nearest - swing)
        if best is not None and decay >= best[2]:
            break
        best = inside, nearest, decay
    return best


def determinant(system: BandSystem, power: float) -> Determinant | None:
    """Hill's determinant of the lines solved, or None where numbers run out.

    Parameters
    ----------
    system : BandSystem
        Factorised.
    power : float
        Mean square of phi.
    """
    constant = _resonance(system.ratio, system.zeta, 0.0)
    growth = _resonance(system.ratio, system.zeta, power) - constant
    # no leading minor exceeds the product of the columns: no partial product overflows
    if not growth < MOST_GROWTH:
        return None
    upper = system.factors[2 * system.band]
    value = float(np.multiply.reduce(upper / system.diagonal).real)
    if np.count_nonzero(system.pivots != lines(0, len(upper) - 1)) % 2:
        value = -value
    if not abs(value) > LEAST:
        return None
    # no factor is below one; rounding must not claim otherwise
    return Determinant(value, math.exp(0.5 + max(0.0, growth)), constant)


def _resonance(ratio: float, zeta: float, power: float) -> float:
    """ln|sin(pi R sqrt(r_1)) sin(pi R sqrt(r_2))|, r the zeros of |D|^2 + power as function of x^2.

    By Euler's product of the sine, the product of (|D_n|^2 + power)/|D_n|^2 over n >= 1, times
    sqrt(1 + power), is the ratio of this with and without power.
    """
    middle = 1 - 2 * zeta * zeta
    square = 4 * zeta * zeta * (zeta * zeta - 1) - power
    turns = math.pi * ratio
    if square < 0:
        # conjugates
        return 2 * _log_sine(turns * cmath.sqrt(complex(middle, math.sqrt(-square))))
    farther = middle - math.sqrt(square)
    roots = (farther, (1 + power) / farther)
    return sum(_log_sine(turns * cmath.sqrt(root)) for root in roots)


def _log_sine(z: complex) -> float:
    """ln|sin z|, where sin z itself would overflow too; Im z >= 0."""
    size = math.sin(z.real) ** 2 * math.exp(-2 * z.imag) + (0.5 * math.expm1(-2 * z.imag)) ** 2
    return z.imag + 0.5 * math.log(size) if size else -math.inf


def beyond_lines(system: BandSystem, edge: float, power: float) -> float:
    """Bound of |ln| of what the lines above N multiply Q by.

    With X = (phi_OO - phi_OC A^-1 phi_CO)/D_O over the outer lines, |ln det(1 + X)| <=
    |tr X| + |X|_F^2/(2 (1 - |X|_F)); of A^-1 only the lines within J of the edge enter, and
    `edge` bounds its norm there.
    """
    outer = 1 / system.nearest(system.solved + 1)
    sizes = system.sizes
    reaching = 2 * float(lines(1, system.band).dot(sizes * sizes))
    trace = edge * reaching * outer
    tail = tail_squares_above(system.ratio, system.solved)
    size = math.sqrt(power * tail) + edge * system.swing * math.sqrt(reaching) * outer
    return trace + size * size / (2 * (1 - size)) if size < 1 else math.inf


def _stability(
    system: BandSystem, known: Determinant, power: float, edge: float
) -> tuple[bool | None, float]:
    """Stability, None if the determinant does not tell, and what the lines above N change in ln Q.

    edge bounds the inverse of the matrix between lines within J of its edges.
    """
    beyond = beyond_lines(system, edge, power)
    if not beyond < MOST_BEYOND:
        return None, beyond
    period = 2 * math.pi * system.ratio
    allowed = 2 * (1 + math.exp(-2 * system.zeta * period))
    # 4 e^{-2 pi zeta R} sin sin = det(1 - M_0)
    log_q = math.log(4 * abs(known.value)) + known.constant - system.zeta * period
    if known.value < 0 or log_q > math.log(allowed) + beyond:
        return False, beyond
    return (True if log_q < math.log(allowed) - beyond else None), beyond


def _size(half: Complex) -> float:
    """Rms of the function whose half spectrum this is, or up to 41 % more for its mean."""
    return math.sqrt(2 * np.vdot(half, half).real)


def tail_squares_above(ratio: float, solved: int) -> float:
    """Bound of the sum of 1/|D_n|^2 over |n| > solved; solved > ratio."""
    x = solved / ratio
    if x > 10:
        # the first term of the series of what would cancel, and 5 % for the others
        return 0.7 * ratio / x**3
    return ratio * (x / (x * x - 1) - 0.5 * math.log((x + 1) / (x - 1)))
