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

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.fourier import Complex, Real
from gearmon.dynamics.sweep_bounds import swing_of
from gearmon.dynamics.sweep_groups import SharedPattern
from gearmon.dynamics.sweep_orders import INDICES
from gearmon.dynamics.sweep_result import METHODS, Sweep
from gearmon.dynamics.sweep_work import EVERY_HARMONIC, SweepWork
from gearmon.errors import ArgumentError, check_range

__all__ = ["ManySets", "Sweep", "sweep"]


# fewer sets of one pattern are solved faster by themselves
FEWEST_TOGETHER = 16


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
        work = SweepWork(
            {name: value.ravel() for name, value in full.items()}, self.tolerance, self.shown
        )
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
