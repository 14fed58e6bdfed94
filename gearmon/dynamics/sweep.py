"""Steady vibrations of many Hill problems at once, as arrays, each with a guaranteed error bound.

An expansion is planned for one pattern of stiffness and evaluated for any number of masses,
dampings, stiffnesses, periods and strengths of the variation. For every set

1. the gain of the inverse operator is bounded (`sweep_stability`), which settles
   stability and says how small a residual must be;
2. sets with the same harmonics near their natural frequency are expanded together
   (`sweep_orders`, `sweep_groups`), and those whose orders do not converge are solved by batched
   harmonic balance (`sweep_balance`);
3. what still misses the tolerance goes through `steady_state` by itself, and so do sets whose
   pattern of stiffness few others share.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.fourier import Complex, Real
from gearmon.dynamics.hill import HillProblem, Response
from gearmon.dynamics.steady_state import steady_state
from gearmon.dynamics.sweep_bounds import Sets, swing_of
from gearmon.dynamics.sweep_groups import MSM, UNSOLVED, SharedPattern
from gearmon.dynamics.sweep_orders import INDICES
from gearmon.dynamics.sweep_stability import settle
from gearmon.errors import ArgumentError, check_range

METHODS = np.array(["msm", "msm resonant", "harmonic balance", "refused", "one by one"])
ONE_BY_ONE = 4
EVERY_HARMONIC = 1 << 30
# fewer sets of one pattern are solved faster by themselves
FEWEST_TOGETHER = 16


@dataclass(frozen=True, kw_only=True, eq=False)
class Sweep:
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
        "msm": orders alone. "msm resonant": with the harmonics near the natural frequency solved
        together. "harmonic balance". "one by one": `steady_state`. "refused".
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
    method: npt.NDArray[np.str_]
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
        if harmonics.ndim > 1:
            harmonics = harmonics[index]
        return HillProblem(
            float(self.mass_kg[index]),
            float(self.damping_ns_per_m[index]),
            float(self.stiffness_n_per_m[index]),
            self.scale[index] * harmonics,
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
        if self.method[index] == METHODS[UNSOLVED]:
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
        If a value is not finite or out of its range, or shapes do not broadcast.

    Notes
    -----
    Memory is that of the displacements, 16 (N+1) bytes a set, and some tens of megabytes.

    Examples
    --------
    >>> found = sweep([[0.2], [0.28]], [3e3, 9e3, 9e4], 8e8, [0.065], 1.6e-3, 4e3)
    >>> found.displacement.shape[:2], bool(found.met.all()), bool(found.stable.all())
    ((2, 3), True, True)
    """
    return ManySets(stiffness_harmonics, tolerance, harmonics).substitute(
        mass_kg, damping_ns_per_m, stiffness_n_per_m, period_s, force_n, scale
    )


class ManySets:
    """One expansion to substitute any number of values in.

    What depends on the stiffness pattern alone (bounds of its swing, its products, the amplitude
    equations of each group of resonant harmonics) is worked out at the first use and kept, so that
    another mass, damping, stiffness, period or strength of variation costs a substitution.

    Parameters
    ----------
    stiffness_harmonics : complex array, shape (J,) or (..., J)
        As in `sweep`.
    tolerance, harmonics
        As in `sweep`.

    Examples
    --------
    >>> import numpy as np
    >>> pair = ManySets([0.065])
    >>> stiff = pair.substitute(0.28, 9e3, np.linspace(2e8, 1.2e9, 50), 1.6e-3, 4e3)
    >>> light = pair.substitute(np.linspace(0.2, 3.0, 50), 9e3, 8e8, 1.6e-3, 4e3)
    >>> bool(stiff.met.all() and light.met.all())
    True
    """

    def __init__(
        self,
        stiffness_harmonics: npt.ArrayLike,
        tolerance: float = 1e-6,
        harmonics: int | None = None,
    ) -> None:
        self.tolerance = check_range("tolerance", tolerance, 1e-13, 1.0)
        self.shown = EVERY_HARMONIC
        if harmonics is not None:
            self.shown = int(check_range("harmonics", harmonics, 1, 10_000_000))
        values = np.array(stiffness_harmonics, dtype=complex)
        if values.ndim == 0:
            raise ArgumentError("stiffness_harmonics: a number, must be one row of coefficients")
        if not np.isfinite(values).all():
            bad = np.argwhere(~np.isfinite(values))[0]
            where = ", ".join(str(int(i)) for i in bad)
            raise ArgumentError(f"stiffness_harmonics: entry [{where}] must be finite")
        self.stiffness_harmonics: Complex = values
        self._shared: SharedPattern | None = None

    def substitute(
        self,
        mass_kg: npt.ArrayLike,
        damping_ns_per_m: npt.ArrayLike,
        stiffness_n_per_m: npt.ArrayLike,
        period_s: npt.ArrayLike,
        force_n: npt.ArrayLike,
        scale: npt.ArrayLike = 1.0,
    ) -> Sweep:
        """Steady vibrations for new values; parameters, limits and errors as in `sweep`."""
        values = {
            "mass_kg": _checked("mass_kg", mass_kg, "kg", above=0),
            "damping_ns_per_m": _checked("damping_ns_per_m", damping_ns_per_m, "N s/m"),
            "stiffness_n_per_m": _checked("stiffness_n_per_m", stiffness_n_per_m, "N/m", above=0),
            "period_s": _checked("period_s", period_s, "s", above=0),
            "force_n": _checked("force_n", force_n, "N", least=-math.inf),
            "scale": _checked("scale", scale, ""),
        }
        shape = self._shape(values)
        full = {name: np.broadcast_to(value, shape) for name, value in values.items()}
        work = _Work({name: value.ravel() for name, value in full.items()}, self)
        for harmonics, sets in self._patterns(shape):
            if len(sets) < FEWEST_TOGETHER:
                for i in sets:
                    work.alone(int(i), harmonics)
            else:
                work.together(self._pattern(harmonics), sets)
        displacement = work.displacement()
        return Sweep(
            **full,
            stiffness_harmonics=self._spread(shape),
            tolerance=self.tolerance,
            displacement=displacement.reshape(*shape, displacement.shape[-1]),
            error_bound=work.bound.reshape(shape),
            stable=work.stable.reshape(shape),
            method=METHODS[work.method].reshape(shape),
            reason=work.reason.reshape(shape),
        )

    def _shape(self, values: dict[str, Real]) -> tuple[int, ...]:
        shapes = {name: value.shape for name, value in values.items()}
        shapes["stiffness_harmonics without its last axis"] = self.stiffness_harmonics.shape[:-1]
        try:
            return np.broadcast_shapes(*shapes.values())
        except ValueError:
            listed = ", ".join(f"{name} {shape}" for name, shape in shapes.items() if shape)
            raise ArgumentError(f"shapes do not broadcast together: {listed}") from None

    def _spread(self, shape: tuple[int, ...]) -> Complex:
        if self.stiffness_harmonics.ndim == 1:
            return self.stiffness_harmonics
        return np.broadcast_to(
            self.stiffness_harmonics, (*shape, self.stiffness_harmonics.shape[-1])
        )

    def _patterns(self, shape: tuple[int, ...]) -> Iterator[tuple[Complex, INDICES]]:
        """Yield patterns of stiffness and the sets that have them."""
        *lead, width = self.stiffness_harmonics.shape
        rows = self.stiffness_harmonics.reshape(math.prod(lead), width)
        which = np.broadcast_to(np.arange(len(rows)).reshape(lead), shape).ravel()
        order = np.argsort(which, kind="stable")
        ends = np.cumsum(np.bincount(which, minlength=len(rows)))
        yield from zip(rows, np.split(order, ends[:-1]), strict=True)

    def _pattern(self, harmonics: Complex) -> SharedPattern:
        """Return the expansion for some harmonics, kept if all sets share them."""
        if self.stiffness_harmonics.ndim > 1:
            return SharedPattern(swing_of(harmonics))
        if self._shared is None:
            self._shared = SharedPattern(swing_of(harmonics))
        return self._shared


class _Work:
    """Results of the sets of one substitution, filled in pattern by pattern."""

    def __init__(self, values: dict[str, Real], plan: ManySets) -> None:
        self.values, self.plan = values, plan
        mass, stiffness = values["mass_kg"], values["stiffness_n_per_m"]
        self.ratio = np.sqrt(stiffness / mass) * values["period_s"] / (2 * math.pi)
        self.zeta = values["damping_ns_per_m"] / (2 * np.sqrt(stiffness * mass))
        count = len(mass)
        self.bound = np.full(count, np.inf)
        self.stable = np.zeros(count, dtype=bool)
        self.method = np.full(count, UNSOLVED, dtype=np.int8)
        self.reason = np.full(count, "", dtype=object)
        self._parts: list[tuple[INDICES, Complex]] = []

    def displacement(self) -> Complex:
        """Deflections [m] of all sets, nan where there are none."""
        wanted = 0 if self.plan.shown == EVERY_HARMONIC else self.plan.shown
        highest = max([wanted, *(half.shape[1] - 1 for _, half in self._parts)])
        if len(self._parts) == 1 and self._parts[0][1].shape == (len(self.bound), highest + 1):
            whole = self._parts[0][1]
        else:
            whole = np.zeros((len(self.bound), highest + 1), dtype=complex)
            for sets, half in self._parts:
                whole[sets, : half.shape[1]] = half
                whole[sets, half.shape[1] :] = 0
        whole *= (self.values["force_n"] / self.values["stiffness_n_per_m"])[:, None]
        whole[self.method == UNSOLVED] = np.nan
        return whole

    def together(self, pattern: SharedPattern, at: INDICES) -> None:
        """Settle, solve and judge the sets `at`, whose stiffness follows the pattern."""
        plan, scale = self.plan, self.values["scale"][at]
        settled = settle(self.ratio[at], self.zeta[at], scale, pattern.swing)
        self.stable[at] = settled.stable
        for i in np.flatnonzero(~np.isnan(settled.growth)):
            self.reason[at[i]] = _why_unstable(float(settled.growth[i]))
        still = np.asarray(scale * pattern.swing.highest == 0) & settled.stable
        if still.any():
            self.bound[at[still]], self.method[at[still]] = 0.0, MSM
            self._parts.append((at[still], np.ones((np.count_nonzero(still), 1), dtype=complex)))
        known = np.flatnonzero(np.isfinite(settled.gain) & settled.stable & ~still)
        for i in np.flatnonzero(np.isinf(settled.gain) & np.isnan(settled.growth)):
            self.reason[at[i]] = "no error bound could be given: the inverse operator is unbounded"
        if not len(known):
            return
        chosen = at[known]
        sets = Sets(
            ratio=self.ratio[chosen],
            zeta=self.zeta[chosen],
            scale=scale[known],
            gain=settled.gain[known],
        )
        found = pattern.solve(sets, plan.tolerance, plan.shown)
        self._parts.append((chosen, found.spectra(plan.shown)))
        self.bound[chosen], self.method[chosen] = found.bound, found.method
        for i in chosen[found.bound > plan.tolerance]:
            self.alone(int(i), pattern.swing.harmonics)

    def alone(self, i: int, harmonics: Complex) -> None:
        """One set by `steady_state`."""
        values, plan = self.values, self.plan
        stiffness = float(values["stiffness_n_per_m"][i])
        problem = HillProblem(
            float(values["mass_kg"][i]),
            float(values["damping_ns_per_m"][i]),
            stiffness,
            values["scale"][i] * harmonics,
            float(values["period_s"][i]),
            stiffness,
        )
        shown = None if plan.shown == EVERY_HARMONIC else plan.shown
        response = steady_state(problem, plan.tolerance, harmonics=shown)
        self.stable[i] = response.stable is True
        if response.error_bound < self.bound[i]:
            self.bound[i], self.method[i] = response.error_bound, ONE_BY_ONE
            self._parts.append((np.array([i]), np.array(response.displacement)[None]))
        if self.bound[i] > plan.tolerance:
            self.reason[i] = response.message


def _why_unstable(growth: float) -> str:
    if math.isinf(growth):
        return "undamped: free vibrations never die out, so no steady state is reached"
    return (
        f"unstable: free vibrations grow by {math.exp(min(growth, 700.0)):.6g} a period (largest "
        "Floquet multiplier), so there is no steady state"
    )


def _checked(
    name: str, values: npt.ArrayLike, unit: str, above: float = -math.inf, least: float = 0.0
) -> Real:
    """Return values as floats, or raise with the first that is out of its range."""
    numbers = np.asarray(values, dtype=float)
    bad = ~np.isfinite(numbers) | (numbers <= above) | (numbers < least)
    if bad.any():
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        index = f"[{', '.join(map(str, where))}]" if where else ""
        shown = f"{name}{index}={numbers[where]}{f' {unit}' if unit else ''}"
        if not math.isfinite(numbers[where]):
            raise ArgumentError(f"{shown} must be a finite number")
        raise ArgumentError(f"{shown} must be {'> 0' if above == 0 else '>= 0'}")
    return numbers
