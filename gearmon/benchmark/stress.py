"""Stress test of `steady_state`: thousands of random systems against collocation in time.

The systems come up to nine tenths of the variation that makes them unstable. Drawn log-uniformly:
damping ratio 1e-3 to 3 and w0/w 0.1 to 50; uniformly: 1 to 64 stiffness harmonics with random
phases and sizes that fall with a random power of 0 to 2 of their number, and the share 0 to 0.9 of
the variation at which the system first turns unstable. A variation never exceeds twice the mean
stiffness: the spring may turn negative for part of the period.

Each answer is met (its bound and its true error are within the tolerance), refused (it says that it
misses the tolerance, or that the system is unstable), wrong silently, or its bound is broken: less
than the true error. Where the reference itself is known worse than a tenth of the tolerance, an
answer that claims to meet it is not judged.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from gearmon.arrays import ComplexArray
from gearmon.benchmark.equations import Reference, as_lines, pair, reference_and_doubt
from gearmon.benchmark.timing import Row, task_time
from gearmon.dynamics import HillProblem, Response, floquet, steady_state
from gearmon.errors import ArgumentError, check_range
from gearmon.terminal import Progress, followed

OUTCOMES = ("met", "refused", "wrong_silently", "bound_broken", "not_judged", "crashed")

RATIOS, ZETAS, MOST_HARMONICS, MOST_SHARE = (0.1, 50.0), (1e-3, 3.0), 64, 0.9
LARGEST_VARIATION = 2.0
#: The limit is wanted to half a percent.
TRACE_TOLERANCE = 1e-5
TOLERANCES = (1e-6, 1e-10)
QUICK = 40
#: An error is known to ten per cent where it is so many times what the reference may be wrong by.
KNOWN = 10


class System(NamedTuple):
    """One random system.

    Parameters
    ----------
    problem : HillProblem
    variation : float
        Largest absolute value of phi.
    limit : float
        Variation at which the system turns unstable, or 2.
    """

    problem: HillProblem
    variation: float
    limit: float


def draw_system(rng: np.random.Generator) -> System:
    """Draw one system.

    Parameters
    ----------
    rng : numpy.random.Generator
    """
    ratio, zeta = np.exp(rng.uniform(*np.log([RATIOS, ZETAS]).T)).tolist()
    count = int(rng.integers(1, MOST_HARMONICS + 1))
    shape = rng.normal(size=count) + 1j * rng.normal(size=count)
    shape /= np.arange(1, count + 1) ** rng.uniform(0.0, 2.0)
    values = np.fft.irfft(np.append(0j, shape), 16 * count, norm="forward")
    shape /= np.abs(values).max()
    limit = instability_limit(ratio, zeta, shape)
    variation = float(rng.uniform(0.0, MOST_SHARE)) * limit
    problem = pair(variation * shape, zeta=zeta, ratio=ratio)
    return System(problem=problem, variation=variation, limit=limit)


def instability_limit(ratio: float, zeta: float, shape: ComplexArray) -> float:
    """Smallest variation, to half a percent, that makes a free vibration grow; at most 2.

    Parameters
    ----------
    ratio, zeta : float
        w0/w and damping ratio.
    shape : complex ndarray, shape (J,)
        Stiffness harmonics of a variation of 1.

    Examples
    --------
    >>> import numpy as np                 # 2 w0 = w: unstable above 4 zeta, nearly
    >>> bool(abs(instability_limit(0.5, 0.05, np.array([0.5 + 0j])) / 0.2 - 1) < 0.03)
    True
    """
    low, high, points = 1e-3 * LARGEST_VARIATION, LARGEST_VARIATION, 28
    # it only draws systems; whether one is stable is judged by the reference
    while high > 1.005 * low:
        grid = np.geomspace(low, high, points)
        growing = floquet.growth_of(ratio, grid, zeta, shape, TRACE_TOLERANCE) > 0
        # with the largest variation it may be stable still
        first = int(np.argmax(np.append(growing[:-1], True)))
        low, high, points = grid[max(0, first - 1)], grid[first], 8
    return float(low)


def run_stress(
    count: int = 5000, seed: int = 0, quick: bool = False, progress: Progress | None = None
) -> list[Row]:
    """Judge `steady_state` on random systems.

    Parameters
    ----------
    count : int, >= 1
        Number of systems; drawn as told above.
    seed : int
    quick : bool
        40 systems at most.
    progress : callable, optional
        Called with the share done, 0 to 1.

    Returns
    -------
    list of dict
        One row a system and tolerance: the system, the outcome ("met", "refused", "wrong silently",
        "bound broken", "not judged", "crashed"), the reason of a refusal, true error and bound.

    Raises
    ------
    ArgumentError
        If `count` is out of its range.
    """
    check_range("count", count, 1, 10_000_000)
    if quick:
        count = min(count, QUICK)
    rng = np.random.default_rng(seed)
    return [
        {"system": number, **row}
        for number in followed(range(count), count, progress)
        for row in judged(draw_system(rng))
    ]


def judged(system: System) -> list[Row]:
    """Judge the answers for one system, to every tolerance.

    Parameters
    ----------
    system : System
    """
    p = system.problem
    reference, doubt = reference_and_doubt(p)
    facts: Row = {
        "ratio": p.frequency_ratio,
        "zeta": p.damping_ratio,
        "harmonics": len(p.stiffness_harmonics),
        "variation": system.variation,
        "share_of_limit": system.variation / system.limit,
        "log_multiplier": -reference.decay_rate * 2 * math.pi * p.frequency_ratio,
        "reference_uncertainty": doubt,
    }
    return [facts | _verdict(p, reference, tolerance, facts) for tolerance in TOLERANCES]


def _verdict(problem: HillProblem, reference: Reference, tolerance: float, facts: Row) -> Row:
    doubt = facts["reference_uncertainty"]
    row: Row = {"tolerance": tolerance, "outcome": "crashed", "reason": "", "method": ""}
    row |= dict.fromkeys(("order", "error", "error_bound", "bound_over_error", "run_time_s"))
    try:
        elapsed, response = task_time(partial(steady_state, problem, tolerance))
    except ArgumentError as refusal:
        return row | {"outcome": "refused", "reason": str(refusal)}
    except (ArithmeticError, ValueError, np.linalg.LinAlgError) as crash:
        return row | {"reason": f"{type(crash).__name__}: {crash}"}
    error, bound = reference.error(as_lines(response)), response.error_bound
    outcome, reason = _outcome(response, error, tolerance, doubt, facts["log_multiplier"])
    row |= {"outcome": outcome, "reason": reason, "error": error, "run_time_s": elapsed}
    row |= {"method": response.method, "order": response.order}
    if math.isfinite(bound):  # an endless bound is no number in JSON
        known = error > KNOWN * doubt
        row |= {"error_bound": bound, "bound_over_error": bound / error if known else None}
    return row


def _outcome(
    response: Response, error: float, tolerance: float, uncertainty: float, rate: float
) -> tuple[str, str]:
    if response.error_bound < error - 2 * uncertainty:
        return "bound broken", response.message
    if response.stable is False:
        # the judge's multiplier is good to some digits only
        return "refused", "unstable" if rate > -1e-6 else "called unstable, but is stable"
    if response.error_bound > tolerance:
        if math.isinf(response.error_bound):
            return "refused", "no bound"
        return "refused", "bound too wide" if error <= tolerance else "not accurate enough"
    if uncertainty > 0.1 * tolerance:
        return "not judged", "the reference is too uncertain"
    return ("met", "") if error <= tolerance else ("wrong silently", "")


def stress_summary(rows: Sequence[Row]) -> list[Row]:
    """One line a tolerance: outcomes, refusals, and how the bounds compare with the errors.

    Parameters
    ----------
    rows : sequence of dict
        From `run_stress`.
    """
    tolerances = dict.fromkeys(row["tolerance"] for row in rows)
    return [_summary(own, [row for row in rows if row["tolerance"] == own]) for own in tolerances]


def _summary(tolerance: float, rows: list[Row]) -> Row:
    outcomes = Counter(row["outcome"].replace(" ", "_") for row in rows)
    stable = [row for row in rows if row["log_multiplier"] < 0]
    refused = [row for row in stable if row["outcome"] == "refused"]
    reasons = Counter(row["reason"] for row in refused)
    ratios = [row["bound_over_error"] for row in rows if row["bound_over_error"]]
    least, median, most = np.quantile(ratios, (0, 0.5, 0.95)).tolist() if ratios else 3 * [None]
    errors_met = (row["error"] for row in rows if row["outcome"] == "met")
    run_times = [row["run_time_s"] for row in rows if row["run_time_s"]]
    return {
        "tolerance": tolerance,
        "systems": len(rows),
        **{name: outcomes[name] for name in OUTCOMES},
        "refused_of_stable_percent": 100 * len(refused) / max(1, len(stable)),
        "reasons": "; ".join(f"{reason}: {n}" for reason, n in reasons.most_common()),
        "least_bound_over_error": least,
        "median_bound_over_error": median,
        "p95_bound_over_error": most,
        "largest_error_met": max(errors_met, default=None),
        "worst_uncertainty": max(row["reference_uncertainty"] for row in rows),
        "median_run_time_s": float(np.median(run_times)) if run_times else None,
    }
