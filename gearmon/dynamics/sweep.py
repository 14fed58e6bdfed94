"""Steady vibrations of many Hill problems at once, as arrays, each with a guaranteed error bound.

Sets that share a pattern of stiffness differ in D and in a factor of phi only. For every set

1. the gain of the inverse operator is bounded, which settles stability (`error_bound`);
2. all are shot for together, a few hundred at a time (`shooting`);
3. what misses the tolerance goes through `steady_state` by itself, and so do sets whose pattern of
   stiffness few others share.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.arrays import BoolArray, IntArray
from gearmon.dynamics.compliance import PairCompliance
from gearmon.dynamics.error_bound import Pattern, best_gain
from gearmon.dynamics.fourier import Complex, Real
from gearmon.dynamics.hill import (
    LARGEST,
    MOST_SWING,
    UNITS,
    HillProblem,
    Response,
    broadcast_values,
    check_entries,
)
from gearmon.dynamics.mesh_equations import MeshEquations, first_highest
from gearmon.dynamics.shooting import Shooting
from gearmon.dynamics.steady_state import (
    MOST_RATIO,
    UNDAMPED,
    check_arguments,
    growing_by,
    steady_state,
)
from gearmon.errors import ArgumentError
from gearmon.result import Result

#: Fewer sets of one pattern are solved faster by themselves.
FEWEST_TOGETHER = 16
#: Samples x sets whose arrays stay in the cache, and factor of the lines for sets that miss.
VALUES_TOGETHER, MORE_LINES = 100_000, 1.5
#: Sets that the steps of a march are worth, and by what their lines may differ beyond that number.
WORTH_A_MARCH, ALIKE = 250, 1.2
SHOT, ONE_BY_ONE, REFUSED = "shooting", "one by one", "refused"
#: Force of all sets: a unit of static deflection.
UNIT = np.ones(1, dtype=complex)


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
        "shooting": together. "one by one": `steady_state`. "refused".
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
    stable: BoolArray
    method: npt.NDArray[np.object_]
    reason: npt.NDArray[np.object_]

    @property
    def met(self) -> BoolArray:
        """Where the tolerance is met for certain, shape (...)."""
        return np.asarray(self.error_bound <= self.tolerance)

    @property
    def velocity(self) -> Complex:
        """Velocity i n w z_n [m/s], shape (..., N+1)."""
        return self._rate * self.displacement

    @property
    def acceleration(self) -> Complex:
        """Acceleration -(n w)^2 z_n [m/s2], shape (..., N+1)."""
        return self._rate * self.velocity

    def problem(self, index: int | tuple[int, ...]) -> HillProblem:
        """Return one set by itself.

        Parameters
        ----------
        index : int or tuple of int
            Its place in the grid.
        """
        own: Any = {name: float(getattr(self, name)[index]) for name in UNITS}
        c = self.stiffness_harmonics
        c = own.pop("scale") * (c[index] if c.ndim > 1 else c)
        return HillProblem(**own, stiffness_harmonics=c)

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
    def _rate(self) -> Complex:
        lines = np.arange(self.displacement.shape[-1])
        return np.asarray(2j * math.pi * lines / self.period_s[..., None])


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
    check_arguments(tolerance, harmonics)
    pattern: Complex = np.array(stiffness_harmonics, dtype=complex)
    if pattern.ndim == 0:
        raise ArgumentError("stiffness_harmonics: a number, must be one row of coefficients")
    check_entries("stiffness_harmonics", pattern)
    *lead, width = pattern.shape
    given = mass_kg, damping_ns_per_m, stiffness_n_per_m, period_s, force_n, scale
    full = broadcast_values(dict(zip(UNITS, given, strict=True)), tuple(lead))
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
        self._parts: list[tuple[IntArray, Complex]] = []

    def displacement(self) -> Complex:
        """Deflections [m] of all sets, nan where there are none."""
        highest = max([self.shown or 0, *(half.shape[1] - 1 for _, half in self._parts)])
        whole: Complex = np.zeros((len(self.bound), highest + 1), dtype=complex)
        for sets, half in self._parts:
            whole[sets, : half.shape[1]] = half
        whole *= (self.values["force_n"] / self.values["stiffness_n_per_m"])[:, None]
        whole[self.method == REFUSED] = np.nan
        return whole

    def solve(self, harmonics: Complex, at: IntArray) -> None:
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

    def _together(self, pattern: Pattern, at: IntArray) -> IntArray:
        """Solve sets side by side; those that are left to be solved alone."""
        scale = self.values["scale"][at]
        gain = best_gain(self.ratio[at], self.zeta[at], scale, pattern)
        self.stable[at] = gain.stable
        for i in np.flatnonzero(~gain.stable):
            grown = growing_by(math.exp(min(float(gain.growth[i]), 700.0)))
            self.reason[at[i]] = UNDAMPED if math.isinf(gain.growth[i]) else grown
        # what does not vibrate has no relative error
        sure = gain.stable & np.isfinite(gain.acceleration) & (scale > 0)
        left = np.flatnonzero(sure) if len(pattern.harmonics) else np.zeros(0, dtype=int)
        for more in (1.0, MORE_LINES):
            if len(left):
                self._shoot_all(pattern, at[left], gain.acceleration[left], more)
            left = left[~(self.bound[at[left]] <= self.tolerance)]
        return at[gain.stable & ~(self.bound[at] <= self.tolerance)]

    def _shoot_all(self, pattern: Pattern, sets: IntArray, gain: Real, more: float) -> None:
        """Solve sets in blocks whose arrays stay in the cache, with `more` lines than needed."""
        order = np.argsort(self.ratio[sets])
        sets, gain = sets[order], gain[order]
        ratio, zeta, scale = (x[sets] for x in (self.ratio, self.zeta, self.values["scale"]))
        # the lines that matter grow in proportion to w0/w
        ends, hardest = ratio[[0, -1], None], Pattern(scale.max() * pattern.harmonics)
        extremes = (PairCompliance(end, zeta.min(keepdims=True), UNIT) for end in ends)
        equations = (MeshEquations(pair, hardest, self.shown) for pair in extremes)
        needed = [more * first_highest(own, self.tolerance) for own in equations]
        highest = np.interp(ratio, ends[:, 0], needed)

        first = 0
        while first < len(sets):
            most = int(VALUES_TOGETHER / (2 * highest[first] + 2 * len(pattern.harmonics)))
            alike = int(np.searchsorted(highest, ALIKE * highest[first])) - first
            count = max(FEWEST_TOGETHER, min(most, max(alike, WORTH_A_MARCH)))
            part = slice(first, first + count)
            pairs = PairCompliance(ratio[part], zeta[part], UNIT)
            known = scale[part], gain[part], pattern, math.ceil(highest[part][-1])
            lines, bound = Shooting(pairs, *known).solve(self.tolerance, self.shown)
            good, own = bound <= self.tolerance, sets[part]
            last = None if self.shown is None else self.shown + 1
            self._parts.append((own[good], lines[:last].T[good]))
            self.bound[own[good]], self.method[own[good]] = bound[good], SHOT
            first = part.stop

    def _alone(self, i: int, harmonics: Complex) -> None:
        """One set by `steady_state`."""
        mass, damping, stiffness, period, _, scale = (float(self.values[name][i]) for name in UNITS)
        # under a unit of static deflection
        problem = HillProblem(mass, damping, stiffness, scale * harmonics, period, stiffness)
        response = steady_state(problem, self.tolerance, harmonics=self.shown)
        self.stable[i] = response.stable
        if response.error_bound < math.inf:
            self.bound[i], self.method[i] = response.error_bound, ONE_BY_ONE
            self._parts.append((np.array([i]), np.array(response.displacement)[None]))
        if self.bound[i] > self.tolerance:
            self.reason[i] = response.message
