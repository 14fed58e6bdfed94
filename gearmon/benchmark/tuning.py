"""Settings with which a rival just meets a wanted error: tolerances, steps, harmonics."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from gearmon.benchmark import compiled, rivals
from gearmon.benchmark.collocation import Reference
from gearmon.benchmark.dynamics_cases import Case
from gearmon.benchmark.timing import task_time

#: Share of the wanted error that may be left of the free vibration.
SETTLED_SHARE = 0.3
#: A trial that takes longer is not followed by a finer one [s].
LONGEST_TRIAL_S = 1.5


@dataclass(frozen=True, kw_only=True, eq=False)
class ToleranceMap:
    """Errors of one solver over its tolerances, started on the periodic motion.

    Parameters
    ----------
    tolerances, errors, times_s : tuple of float
        From loose to tight; run times are those of one period.
    """

    tolerances: tuple[float, ...]
    errors: tuple[float, ...]
    times_s: tuple[float, ...]

    def tolerance(self, wanted: float) -> float:
        """Tolerance whose error is `wanted`, by interpolation of logarithms."""
        ordered = np.minimum.accumulate(self.errors)
        found = np.interp(-math.log(wanted), -np.log(ordered), np.log(self.tolerances))
        return math.exp(float(found))

    def time_s(self, wanted: float) -> float:
        """Run time of a period at that tolerance [s]; beyond the finest trial it is a guess."""
        place = -math.log(wanted)
        errors = -np.log(np.minimum.accumulate(self.errors))
        beyond = max(0.0, place - float(errors[-1]))
        return float(np.interp(place, errors, self.times_s)) * math.exp(beyond / 4)


def tolerance_map(
    oscillator: rivals.Oscillator, reference: Reference, solver: str, finest: float
) -> ToleranceMap:
    """Try tolerances from 1e-2 downwards until the error is below `finest` or a trial is long."""
    tolerances, errors, times = [], [], []
    for tolerance in 10.0 ** -np.arange(2, 13):
        elapsed, motion = task_time(
            partial(rivals.integrate, oscillator, solver, float(tolerance), reference.state)
        )
        tolerances.append(float(tolerance))
        errors.append(max(reference.error(motion), 1e-15))
        times.append(elapsed)
        if errors[-1] < finest or elapsed > LONGEST_TRIAL_S:
            break
    return ToleranceMap(tolerances=tuple(tolerances), errors=tuple(errors), times_s=tuple(times))


def tuned_tolerance(
    first: float, wanted: float, error_at: Callable[[float], float], trials: int = 5
) -> float:
    """Loosest of some tolerances whose error is within `wanted`.

    Parameters
    ----------
    first : float
        To begin with.
    wanted : float
        Relative error.
    error_at : callable
        Error at a tolerance.
    trials : int
        Runs allowed.
    """
    tolerance, best = first, 0.0
    for _ in range(trials):
        elapsed, error = task_time(partial(error_at, tolerance))
        if error <= wanted:
            best = max(best, tolerance)
            if error > 0.5 * wanted or elapsed > LONGEST_TRIAL_S:
                break
        tolerance *= (0.75 * wanted / max(error, 1e-3 * wanted)) ** 0.9
        tolerance = max(tolerance, 3e-14)
    return best or tolerance


def tuned_steps(
    case: Case, wanted: float, error_at: Callable[[int], float], trials: int = 5
) -> int:
    """Fewest steps a period with which a method of order four is within `wanted`."""
    steps, best = _divisible(24 * case.problem.frequency_ratio + 48), 0
    for _ in range(trials):
        error = error_at(steps)
        if error <= wanted:
            best = steps if not best else min(best, steps)
            if error > 0.8 * wanted:
                break
        growth = (error / (0.9 * wanted)) ** 0.25
        steps = _divisible(steps * min(30.0, max(0.2, growth)))
        if steps == best:
            break
    return best or _divisible(1.1 * steps)


def _divisible(steps: float) -> int:
    """Next multiple of four, so that the jumps of a rectangle fall between steps."""
    return 4 * math.ceil(steps / 4)


def fewest_harmonics(wanted: float, start: int, error_at: Callable[[int], float]) -> int:
    """Fewest harmonics with an error within `wanted`, by doubling and halving."""
    low, high = 1, max(2, start)
    while error_at(high) > wanted and high < 1_000_000:
        low, high = high, math.ceil(1.4 * high)
    while high - low > max(1, high // 50):
        middle = (low + high) // 2
        if error_at(middle) > wanted:
            low = middle
        else:
            high = middle
    return high


def compiled_error(
    case: Case, reference: Reference, settling: float | None
) -> Callable[[int], float]:
    """Error of compiled steps over their number; by shooting where nothing settles."""
    p = case.problem
    ratio, zeta = p.frequency_ratio, p.damping_ratio

    def error_at(steps: int) -> float:
        table = compiled.tables(case, steps)
        if settling is None:
            return reference.error(compiled.shoot(table, ratio, zeta))
        return reference.error(compiled.march(table, ratio, zeta, settling))

    return error_at
