"""Steady vibrations of many Hill problems at once, as arrays, each with a guaranteed error bound.

Sets that share a pattern of stiffness differ in D and in a factor of phi only. For every set

1. the gain of the inverse operator is bounded, which settles stability (`error_bound`);
2. sets whose orders surely converge fast are summed together, the others recombined together by
   least residual, all by the code of one problem (`mesh_equations`);
3. what still misses the tolerance goes through `steady_state` by itself, and so do sets whose
   pattern of stiffness few others share.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.compliance import PairCompliance
from gearmon.dynamics.error_bound import Gain, Pattern, best_gain, loop_at_lines
from gearmon.dynamics.fourier import Complex, Real
from gearmon.dynamics.hill import LARGEST, MOST_SWING, HillProblem, Response, broadcast_values
from gearmon.dynamics.mesh_equations import (
    MOST_ORDERS,
    SMALLEST,
    Approximation,
    MeshEquations,
    recombine,
    sum_orders,
    widen,
)
from gearmon.dynamics.steady_state import MOST_RATIO, UNDAMPED, growing_by, steady_state
from gearmon.errors import ArgumentError, check_range
from gearmon.result import Result

#: Fewer sets of one pattern are solved faster by themselves.
FEWEST_TOGETHER = 16
#: Sets whose arrays stay in the cache, and w0/w up to which they are solved together.
MOST_TOGETHER, MOST_RATIO_TOGETHER = 160, 100.0
#: Factor an order up to which orders are summed as they come.
SLOWEST_TOGETHER = 0.8
#: Shares of the tolerance that harmonics are guessed for: that of the first sets, which those
#: before correct for the next, and the least, since rounding asks for no more harmonics.
FIRST_SPARE, LEAST_SPARE = 1e-3, 1e-8
MSM, RECOMBINED, ONE_BY_ONE, REFUSED = "msm", "msm least residual", "one by one", "refused"
INDICES = npt.NDArray[np.int_]


@dataclass(frozen=True, kw_only=True, eq=False)
class Sweep(Result):
    """Steady vibrations over a grid of values; `...` is the shape that all values broadcast to.

    Attributes
    ----------
    mass_kg, damping_ns_per_m, stiffness_n_per_m, period_s, force_n, scale : float ndarray, (...)
        Values of each set, as in `HillProblem`; `scale` multiplies its stiffness variation.
    stiffness_harmonics : complex ndarray, shape (J,) or (..., J)
        c_1..c_J for scale 1.
    tolerance : float
        What was aimed at.
    displacement : complex ndarray, shape (..., N+1)
        z_0..z_N [m] as in `Response`, zero above what a set takes; nan where refused.
    error_bound : float ndarray, shape (...)
        Guaranteed relative L2 error of the acceleration; infinite where refused.
    stable : bool ndarray, shape (...)
        Whether free vibrations die out for certain.
    method : str ndarray, shape (...)
        "msm": orders as they come. "msm least residual": recombined. "one by one":
        `steady_state`. "refused".
    reason : object ndarray of str, shape (...)
        Empty where the tolerance is met, else one line that says why it is not.
    """

    mass_kg: Real
    damping_ns_per_m: Real
    stiffness_n_per_m: Real
    period_s: Real
    force_n: Real
    scale: Real
    stiffness_harmonics: Complex
    tolerance: float
    displacement: Complex
    error_bound: Real
    stable: npt.NDArray[np.bool_]
    method: npt.NDArray[np.object_]
    reason: npt.NDArray[np.object_]

    @property
    def met(self) -> npt.NDArray[np.bool_]:
        """Where the tolerance is met for certain, shape (...)."""
        return np.asarray(self.error_bound <= self.tolerance)

    @property
    def velocity(self) -> Complex:
        """Velocity i n w z_n [m/s], shape (..., N+1)."""
        return 1j * self._angular * self.displacement

    @property
    def acceleration(self) -> Complex:
        """Acceleration -(n w)^2 z_n [m/s2], shape (..., N+1)."""
        return -(self._angular**2) * self.displacement

    def problem(self, index: int | tuple[int, ...]) -> HillProblem:
        """Return one set by itself.

        Parameters
        ----------
        index : int or tuple of int
            Its place in the grid.
        """
        harmonics = self.stiffness_harmonics
        return HillProblem(
            float(self.mass_kg[index]),
            float(self.damping_ns_per_m[index]),
            float(self.stiffness_n_per_m[index]),
            self.scale[index] * (harmonics[index] if harmonics.ndim > 1 else harmonics),
            float(self.period_s[index]),
            float(self.force_n[index]),
        )

    def response(self, index: int | tuple[int, ...]) -> Response:
        """Vibration of one set, with mesh force, contact loss and the rest of `Response`.

        Parameters
        ----------
        index : int or tuple of int
            Its place in the grid.

        Raises
        ------
        ArgumentError
            If the set was refused.
        """
        if self.method[index] == REFUSED:
            raise ArgumentError(f"set {index} has no steady state here: {self.reason[index]}")
        bound = float(self.error_bound[index])
        return Response(
            problem=self.problem(index),
            displacement=self.displacement[index],
            error_bound=bound,
            method=str(self.method[index]),
            order=0,
            stable=bool(self.stable[index]),
            message=self.reason[index] or f"swept: error bound {bound:.2g}",
        )

    @property
    def _angular(self) -> Real:
        lines = np.arange(self.displacement.shape[-1])
        return np.asarray(2 * math.pi * lines / self.period_s[..., None])


def sweep(
    mass_kg: npt.ArrayLike,
    damping_ns_per_m: npt.ArrayLike,
    stiffness_n_per_m: npt.ArrayLike,
    stiffness_harmonics: npt.ArrayLike,
    period_s: npt.ArrayLike,
    force_n: npt.ArrayLike,
    scale: npt.ArrayLike = 1.0,
    tolerance: float = 1e-6,
    harmonics: int | None = None,
) -> Sweep:
    """Steady vibrations of many Hill problems at once.

    Parameters
    ----------
    mass_kg, damping_ns_per_m, stiffness_n_per_m, period_s, force_n : float array
        As in `HillProblem`, of any shapes that broadcast together.
    stiffness_harmonics : complex array, shape (J,) or (..., J)
        c_1..c_J, shared by all sets, or for each its own: leading axes broadcast with the values.
    scale : float array
        Factor >= 0 of the stiffness harmonics; broadcasts like the values.
    tolerance : float
        Relative L2 error of the acceleration to be met, 1e-13 to 1.
    harmonics : int, optional
        Highest response harmonic wanted, >= 1; tolerance and bounds then concern harmonics
        0..harmonics. By default all that the tolerance takes.

    Raises
    ------
    ArgumentError
        If a value is not finite or out of its range, or shapes do not broadcast. A set whose values
        are possible one by one, but not together, is refused alone, with its reason.

    Notes
    -----
    Memory is that of the displacements, 16 (N+1) bytes a set, and some tens of megabytes.

    Examples
    --------
    >>> found = sweep([[0.2], [0.28]], [3e3, 9e3, 9e4], 8e8, [0.065], 1.6e-3, 4e3)
    >>> found.displacement.shape[:2], bool(found.met.all()), bool(found.stable.all())
    ((2, 3), True, True)
    """
    check_range("tolerance", tolerance, 1e-13, 1.0)
    if harmonics is not None:
        check_range("harmonics", harmonics, 1, 10_000_000)
    pattern: Complex = np.array(stiffness_harmonics, dtype=complex)
    if pattern.ndim == 0:
        raise ArgumentError("stiffness_harmonics: a number, must be one row of coefficients")
    if not np.isfinite(pattern).all():
        where = ", ".join(str(int(i)) for i in np.argwhere(~np.isfinite(pattern))[0])
        raise ArgumentError(f"stiffness_harmonics: entry [{where}] must be finite")
    *lead, width = pattern.shape
    values = {
        "mass_kg": mass_kg,
        "damping_ns_per_m": damping_ns_per_m,
        "stiffness_n_per_m": stiffness_n_per_m,
        "period_s": period_s,
        "force_n": force_n,
        "scale": scale,
    }
    full = broadcast_values(values, tuple(lead))
    shape = full["scale"].shape
    work = _Work({name: v.ravel() for name, v in full.items()}, tolerance, harmonics)
    rows = pattern.reshape(math.prod(lead), width)
    which = np.broadcast_to(np.arange(len(rows)).reshape(lead), shape).ravel()
    ends = np.cumsum(np.bincount(which, minlength=len(rows)))[:-1]
    parts = np.split(np.argsort(which, kind="stable"), ends)
    for row, sets in zip(rows, parts, strict=True):
        work.solve(row, sets)
    displacement = work.displacement()
    return Sweep(
        **full,
        stiffness_harmonics=np.broadcast_to(pattern, (*shape, width)) if lead else pattern,
        tolerance=tolerance,
        displacement=displacement.reshape(*shape, displacement.shape[-1]),
        error_bound=work.bound.reshape(shape),
        stable=work.stable.reshape(shape),
        method=work.method.reshape(shape),
        reason=work.reason.reshape(shape),
    )


class _Work:
    """Results of the sets of one substitution, filled in pattern by pattern."""

    def __init__(self, values: dict[str, Real], tolerance: float, shown: int | None) -> None:
        self.values, self.tolerance, self.shown = values, tolerance, shown
        mass, stiffness = values["mass_kg"], values["stiffness_n_per_m"]
        self.ratio = np.sqrt(stiffness / mass) * values["period_s"] / (2 * math.pi)
        self.zeta = values["damping_ns_per_m"] / (2 * np.sqrt(stiffness * mass))
        count = len(mass)
        self.bound = np.full(count, np.inf)
        self.stable = np.zeros(count, dtype=bool)
        self.method = np.full(count, REFUSED, dtype=object)
        self.reason = np.full(count, "", dtype=object)
        self._parts: list[tuple[INDICES, Complex]] = []

    def displacement(self) -> Complex:
        """Deflections [m] of all sets, nan where there are none."""
        highest = max([self.shown or 0, *(half.shape[1] - 1 for _, half in self._parts)])
        whole: Complex = np.zeros((len(self.bound), highest + 1), dtype=complex)
        for sets, half in self._parts:
            whole[sets, : half.shape[1]] = half
            whole[sets, half.shape[1] :] = 0
        whole *= (self.values["force_n"] / self.values["stiffness_n_per_m"])[:, None]
        whole[self.method == REFUSED] = np.nan
        return whole

    def solve(self, harmonics: Complex, at: INDICES) -> None:
        """Solve the sets `at`, whose stiffness follows one pattern."""
        # what no pair can have is told one by one, each with its reason
        usual = (self.ratio[at] >= 1 / LARGEST) & (self.ratio[at] <= MOST_RATIO)
        usual &= self.zeta[at] <= LARGEST
        usual &= np.abs(self.values["scale"][at]) * np.abs(harmonics).sum() <= MOST_SWING
        left, odd = at[usual], at[~usual]
        if len(left) >= FEWEST_TOGETHER:
            left = self._together(Pattern(harmonics), left)
        for i in np.concatenate([left, odd]):
            try:
                self._alone(int(i), harmonics)
            except ArgumentError as error:
                self.reason[i] = str(error)

    def _together(self, pattern: Pattern, at: INDICES) -> INDICES:
        """Solve sets side by side; those that are left to be solved alone."""
        scale = self.values["scale"][at]
        gain = best_gain(self.ratio[at], self.zeta[at], scale, pattern)
        self.stable[at] = gain.stable
        for i in np.flatnonzero(~gain.stable):
            growth = float(gain.growth[i])
            grown = growing_by(math.exp(min(growth, 700.0)))
            self.reason[at[i]] = UNDAMPED if math.isinf(growth) else grown
        known = np.flatnonzero(gain.stable & np.isfinite(gain.acceleration))
        if not len(known):
            return at[gain.stable]
        ratio, zeta = self.ratio[at[known]], self.zeta[at[known]]
        loop = loop_at_lines(ratio, zeta, scale[known], pattern)[0]
        fast = loop < SLOWEST_TOGETHER
        spare = FIRST_SPARE
        for repeat in (False, True):
            for method, chosen in ((MSM, fast), (RECOMBINED, ~fast)):
                left = np.flatnonzero(chosen & ~(self.bound[at[known]] <= self.tolerance))
                # sets of like w0/w take like harmonics, those of like convergence like orders
                alike = np.argsort(np.argsort(ratio[left])) // (4 * MOST_TOGETHER)
                left = left[np.lexsort((loop[left], alike))]
                for first in range(0, len(left), MOST_TOGETHER):
                    part = known[left[first : first + MOST_TOGETHER]]
                    equations = self._equations(pattern, at, part, gain)
                    spare = self._expand(equations, at[part], method, repeat, spare)
        return at[gain.stable & ~(self.bound[at] <= self.tolerance)]

    def _equations(self, pattern: Pattern, at: INDICES, part: INDICES, gain: Gain) -> MeshEquations:
        """Put sets side by side, each under a unit of static deflection."""
        ratio, zeta, scale = (
            x[at[part], None] for x in (self.ratio, self.zeta, self.values["scale"])
        )
        own = Gain(acceleration=gain.acceleration[part], stable=gain.stable[part])
        pairs = PairCompliance(ratio, zeta, np.ones(1, dtype=complex))
        return MeshEquations(pairs, pattern, self.shown, scale, own)

    def _expand(
        self, equations: MeshEquations, sets: INDICES, method: str, repeat: bool, spare: float
    ) -> float:
        """Solve sets together and keep what is good; the share to spare for the next ones."""

        def improve(x: Complex) -> Approximation:
            if method == MSM:
                return sum_orders(equations, x, self.tolerance)
            return recombine(equations, x, self.tolerance, MOST_ORDERS)

        if equations.pairs.ratio.max() > MOST_RATIO_TOGETHER:
            return spare
        found = widen(equations, self.tolerance, improve, repeat, spare=spare)
        good = found.bound.relative <= self.tolerance
        half = found.motion[good]
        self._parts.append((sets[good], half if self.shown is None else half[:, : self.shown + 1]))
        self.bound[sets[good]], self.method[sets[good]] = found.bound.relative[good], method
        # almost all sets should spare a good part of the tolerance for lines above the highest
        above = found.bound.above / np.maximum(found.bound.size, SMALLEST)
        spare *= 0.3 * self.tolerance / max(SMALLEST, float(np.quantile(above, 0.98)))
        return min(1.0, max(LEAST_SPARE, spare))

    def _alone(self, i: int, harmonics: Complex) -> None:
        """One set by `steady_state`."""
        v = {name: float(value[i]) for name, value in self.values.items()}
        stiffness = v["stiffness_n_per_m"]
        problem = HillProblem(
            v["mass_kg"],
            v["damping_ns_per_m"],
            stiffness,
            v["scale"] * harmonics,
            v["period_s"],
            stiffness,
        )
        response = steady_state(problem, self.tolerance, harmonics=self.shown)
        self.stable[i] = response.stable is True
        if response.error_bound < math.inf:
            self.bound[i], self.method[i] = response.error_bound, ONE_BY_ONE
            self._parts.append((np.array([i]), np.array(response.displacement)[None]))
        if self.bound[i] > self.tolerance:
            self.reason[i] = response.message
