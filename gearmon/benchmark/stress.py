"""Stress test of `steady_state`: thousands of random systems against refined harmonic balance.

Each answer is met (its bound and its true error are within the tolerance), refused (it says that it
misses the tolerance, or that the system is unstable), wrong silently, or its bound is broken: less
than the true error. Where the reference itself is known worse than a tenth of the tolerance, an
answer that claims to meet it is not judged.
"""

from __future__ import annotations

import math
import statistics
import time
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from gearmon.benchmark.equations import System, draw_system, growth
from gearmon.benchmark.references import (
    RefinedBalance,
    difference_to_shooting,
    refined_balance,
)
from gearmon.benchmark.timing import facts_of_run
from gearmon.dynamics import Response, steady_state
from gearmon.errors import ArgumentError, check_range
from gearmon.terminal import Progress

Row = dict[str, Any]

TOLERANCES = (1e-6, 1e-10)
#: Systems whose reference is compared with time integration.
SHOT = 24
QUICK = 40


def run_stress(
    count: int = 5000,
    seed: int = 0,
    quick: bool = False,
    tolerances: Sequence[float] = TOLERANCES,
    progress: Progress | None = None,
) -> list[Row]:
    """Judge `steady_state` on random systems.

    Parameters
    ----------
    count : int, >= 1
        Number of systems; see `gearmon.benchmark.equations` for how they are drawn.
    seed : int
    quick : bool
        40 systems at most.
    tolerances : sequence of float
        Asked for in turn.
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
    shot = set(range(0, count, max(1, count // (3 if quick else SHOT))))
    facts, rows = facts_of_run(), []
    for number in range(count):
        rows += [
            {"system": number, **row, **facts}
            for row in judged(draw_system(rng), tolerances, shooting=number in shot)
        ]
        if progress is not None:
            progress((number + 1) / count)
    return rows


def judged(system: System, tolerances: Sequence[float], shooting: bool = False) -> list[Row]:
    """Judge the answers for one system.

    Parameters
    ----------
    system : System
    tolerances : sequence of float
    shooting : bool
        Also compare the reference with time integration.
    """
    p = system.problem
    reference = refined_balance(p)
    rate = float(
        growth(p.frequency_ratio, p.damping_ratio, p.stiffness_harmonics, np.array([1.0]))[0]
    )
    facts: Row = {
        "ratio": p.frequency_ratio,
        "zeta": p.damping_ratio,
        "harmonics": len(p.stiffness_harmonics),
        "variation": system.variation,
        "share_of_limit": system.variation / system.limit,
        "log_multiplier": rate,
        "reference_uncertainty": reference.uncertainty,
        "difference_to_shooting": difference_to_shooting(p, reference) if shooting else None,
    }
    return [facts | _verdict(system, reference, tolerance, rate) for tolerance in tolerances]


def _verdict(system: System, reference: RefinedBalance, tolerance: float, rate: float) -> Row:
    unknown = ("order", "error", "error_bound", "bound_over_error", "run_time_s")
    row: Row = {"tolerance": tolerance, "outcome": "crashed", "reason": "", "method": ""}
    row |= dict.fromkeys(unknown)
    start = time.perf_counter()
    try:
        response = steady_state(system.problem, tolerance)
    except ArgumentError as refusal:
        return row | {"outcome": "refused", "reason": str(refusal)}
    except (ArithmeticError, ValueError, np.linalg.LinAlgError) as crash:
        return row | {"reason": f"{type(crash).__name__}: {crash}"}
    elapsed = time.perf_counter() - start
    error = reference.error(response.displacement, system.problem)
    bound = response.error_bound
    outcome, reason = _outcome(response, error, tolerance, reference.uncertainty, rate)
    row |= {"outcome": outcome, "reason": reason, "error": error, "run_time_s": elapsed}
    row |= {"method": response.method, "order": response.order}
    if math.isfinite(bound):  # an endless bound is no number in JSON
        row |= {"error_bound": bound, "bound_over_error": bound / error if error > 0 else None}
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
    return [
        _summary(tolerance, [row for row in rows if row["tolerance"] == tolerance])
        for tolerance in dict.fromkeys(row["tolerance"] for row in rows)
    ]


def _summary(tolerance: float, rows: list[Row]) -> Row:
    outcomes = Counter(row["outcome"] for row in rows)
    stable = [row for row in rows if row["log_multiplier"] < 0]
    refused = [row for row in stable if row["outcome"] == "refused"]
    reasons = Counter(row["reason"] for row in refused)
    ratios = sorted(row["bound_over_error"] for row in rows if row["bound_over_error"])
    shot = [row["difference_to_shooting"] for row in rows if row["difference_to_shooting"]]
    run_times = [row["run_time_s"] for row in rows if row["run_time_s"]]
    return {
        "tolerance": tolerance,
        "systems": len(rows),
        "met": outcomes["met"],
        "refused": outcomes["refused"],
        "wrong_silently": outcomes["wrong silently"],
        "bound_broken": outcomes["bound broken"],
        "not_judged": outcomes["not judged"],
        "crashed": outcomes["crashed"],
        "refused_of_stable_percent": 100 * len(refused) / max(1, len(stable)),
        "reasons": "; ".join(f"{reason}: {n}" for reason, n in reasons.most_common()),
        "least_bound_over_error": ratios[0] if ratios else None,
        "median_bound_over_error": statistics.median(ratios) if ratios else None,
        "p95_bound_over_error": float(np.quantile(ratios, 0.95)) if ratios else None,
        "largest_error_met": max(
            (row["error"] for row in rows if row["outcome"] == "met"), default=None
        ),
        "worst_uncertainty": max(row["reference_uncertainty"] for row in rows),
        "worst_difference_to_shooting": max(shot, default=None),
        "median_run_time_s": statistics.median(run_times) if run_times else None,
    }
