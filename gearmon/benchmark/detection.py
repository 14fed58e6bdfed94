"""Detection of damaged teeth on random machines, beside textbook indicators.

Every machine, its errors, paths, noise and faults are drawn; recordings come from
`detection_recordings`, which shares nothing with the detector. The figures: areas under ROC curves
against loss of stiffness, false alarms against the stated probability, what was blamed, how well
the loss was estimated, and run times.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearmon.benchmark.detection_trials import RIVALS, TOOTH_WITHIN, Outcome, machine_trials
from gearmon.errors import ArgumentError, check_range
from gearmon.terminal import Progress

FloatArray = NDArray[np.float64]
Row = dict[str, Any]

RESAMPLES = 400


def roc_area(healthy: ArrayLike, faulty: ArrayLike) -> float:
    """Area under the ROC curve: the probability that a faulty score exceeds a healthy one.

    Parameters
    ----------
    healthy, faulty : array_like of float, shape (n,), (m,)
        At least one each; ties count half.

    Examples
    --------
    >>> roc_area([0.0, 1.0], [1.0, 2.0])
    0.875
    """
    from scipy.stats import rankdata

    low, high = np.asarray(healthy, dtype=float), np.asarray(faulty, dtype=float)
    if not len(low) or not len(high):
        raise ArgumentError("roc_area needs at least one healthy and one faulty score")
    ranks = rankdata(np.concatenate([low, high]))[len(low) :]
    return float((ranks.mean() - 0.5 * (len(high) + 1)) / len(low))


def roc_area_interval(
    healthy: Sequence[FloatArray], faulty: Sequence[FloatArray], seed: int = 0
) -> tuple[float, float, float]:
    """Area under the ROC curve with a 95 % interval by resampling of machines.

    Recordings of one machine resemble one another, so that whole machines are drawn.

    Parameters
    ----------
    healthy, faulty : sequence of ndarray
        Scores, machine by machine; of a machine there may be none.
    seed : int

    Returns
    -------
    (float, float, float)
        Area, lower and upper limit.
    """
    low, high = np.concatenate(healthy), np.concatenate(faulty)
    area, machines = roc_area(low, high), np.arange(len(healthy))
    rng = np.random.default_rng(seed)
    chosen = rng.integers(0, len(machines), (RESAMPLES, len(machines)))
    drawn = (chosen[:, :, None] == machines).sum(axis=1)
    # how often each score was drawn
    left = drawn[:, np.repeat(machines, [len(own) for own in healthy])]
    right = drawn[:, np.repeat(machines, [len(own) for own in faulty])]
    in_order = (high > low[:, None]) + 0.5 * (high == low[:, None])
    pairs = left.sum(axis=1) * right.sum(axis=1)
    areas = ((left @ in_order) * right).sum(axis=1)[pairs > 0] / pairs[pairs > 0]
    return area, *np.quantile(areas, (0.025, 0.975)).tolist()


def share_interval(hits: int, trials: int) -> tuple[float, float, float]:
    """Share with its 95 % interval by Wilson.

    Parameters
    ----------
    hits, trials : int
        trials >= 1.

    Examples
    --------
    >>> [round(x, 3) for x in share_interval(0, 10)]
    [0.0, 0.0, 0.278]
    """
    from scipy.stats import binomtest

    if trials < 1:
        raise ArgumentError(f"trials={trials} must be at least 1")
    interval = binomtest(hits, trials).proportion_ci(method="wilson")
    return hits / trials, float(interval.low), float(interval.high)


MACHINES, QUICK_MACHINES = 60, 2
#: Groups of machines of which a learning detector sees all but the one that it judges.
FOLDS = 5
#: False-alarm probabilities at which the healthy recordings are counted.
LEVELS = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3)
OURS = "gearmon"
STATED = 0.01


def run_detection(
    count: int = MACHINES,
    seed: int = 0,
    quick: bool = False,
    progress: Progress | None = None,
    first: int = 0,
) -> list[Row]:
    """Judge the detector and its rivals on random machines.

    Parameters
    ----------
    count : int, >= 1
        Machines.
    seed : int, >= 0
    quick : bool
        Two machines, few and short recordings: figures that show only that all works.
    progress : callable, optional
        Called with the share done, 0 to 1.
    first : int, >= 0
        Number of the first machine: long runs can be made in parts.

    Returns
    -------
    list of dict
        One row an analysis: machine, truth, findings, run times, rivals.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.
    """
    check_range("count", count, 1, 1_000_000)
    check_range("seed", seed, 0, 2**63 - 1)
    if quick:
        count = min(count, QUICK_MACHINES)
    outcomes: list[Outcome] = []
    for number in range(first, first + count):
        outcomes += machine_trials(number, seed, quick)
        if progress is not None:
            progress((number - first + 1) / count)
    return with_learning(outcomes, seed)


def with_learning(outcomes: Sequence[Outcome], seed: int = 0) -> list[Row]:
    """Add the scores of the learning detector, trained on healthy pairs of other machines.

    Parameters
    ----------
    outcomes : sequence of Outcome
    seed : int

    Returns
    -------
    list of dict
        The rows of the outcomes, in their order.
    """
    from gearmon.diagnosis.fault_types.classifier import novelty

    rows = [dict(outcome.row) for outcome in outcomes]
    usable = [i for i, outcome in enumerate(outcomes) if len(outcome.features)]
    for tacho in (True, False):
        own = [i for i in usable if rows[i]["tacho"] == tacho]
        for fold in range(FOLDS):
            judged = [i for i in own if rows[i]["machine"] % FOLDS == fold]
            others = [i for i in own if rows[i]["machine"] % FOLDS != fold]
            healthy = [i for i in others if rows[i]["condition"] == "healthy"]
            if len(healthy) < 2 or not judged:
                continue
            known, new = (
                np.array([outcomes[i].features for i in part]) for part in (healthy, judged)
            )
            scores = novelty(known, new, seed)
            for i, score in zip(judged, scores, strict=True):
                rows[i]["plain learning"] = float(score)
    return rows


def roc_rows(rows: Sequence[Row]) -> list[Row]:
    """Areas under ROC curves, healthy at the same operating point against one damaged tooth.

    Parameters
    ----------
    rows : sequence of dict
        From `run_detection`.

    Returns
    -------
    list of dict
        One for each detector, loss, and with and without tacho.
    """
    machines = sorted({row["machine"] for row in rows})
    found = []
    for tacho in (True, False):
        here = [row for row in rows if row["tacho"] == tacho]
        sound = [r for r in here if r["condition"] == "healthy" and r["variant"] == "same"]
        losses = sorted({row["size"] for row in here if row["condition"] == "tooth"})
        for loss in losses:
            hurt = [r for r in here if r["condition"] == "tooth" and r["size"] == loss]
            for name in (OURS, *RIVALS):
                low, high = (_by_machine(part, name, machines) for part in (sound, hurt))
                if not sum(map(len, low)) or not sum(map(len, high)):
                    continue
                area, count = roc_area_interval(low, high), sum(map(len, high))
                found.append(_figure("ROC area", name, f"loss {loss:.3g}", tacho, area, count))
    return found


def _by_machine(rows: Sequence[Row], name: str, machines: Sequence[int]) -> list[FloatArray]:
    key = "score" if name == OURS else name
    held: dict[int, list[float]] = {machine: [] for machine in machines}
    for row in rows:
        if row[key] is not None:
            held[row["machine"]].append(row[key])
        elif name == OURS:
            # a recording that is refused is no evidence of a fault
            held[row["machine"]].append(-np.inf)
    return [np.array(values, dtype=float) for values in held.values()]


def false_alarm_rows(rows: Sequence[Row], levels: Sequence[float] = LEVELS) -> list[Row]:
    """Share of healthy recordings whose stated probability is at most each level.

    Parameters
    ----------
    rows : sequence of dict
    levels : sequence of float
    """
    found = []
    for tacho in (True, False):
        sound = [
            row
            for row in rows
            if row["tacho"] == tacho and row["condition"] == "healthy" and row["probability"]
        ]
        for variant in ("", *dict.fromkeys(row["variant"] for row in sound)):
            own = [row for row in sound if not variant or row["variant"] == variant]
            for level in levels if not variant else (STATED,):
                if own:
                    hits = sum(row["probability"] <= level for row in own)
                    what = f"stated {level:g}" + (f", {variant}" if variant else "")
                    share = share_interval(hits, len(own))
                    found.append(_figure("false alarms", OURS, what, tacho, share, len(own)))
    return found


def finding_rows(rows: Sequence[Row]) -> list[Row]:
    """Shares of right gears and teeth, error and coverage of the loss, others called a tooth.

    Parameters
    ----------
    rows : sequence of dict
    """
    found = []
    for tacho in (True, False):
        here = [row for row in rows if row["tacho"] == tacho]
        for loss in sorted({row["size"] for row in here if row["condition"] == "tooth"}):
            own = [r for r in here if r["condition"] == "tooth" and r["size"] == loss]
            found += _of_loss(own, loss, tacho)
        others = [r for r in here if r["condition"] != "tooth"]
        for kind in dict.fromkeys(row["condition"] for row in others):
            own = [row for row in others if row["condition"] == kind]
            called = {
                "called a fault": sum(row["verdict"] == "fault" for row in own),
                "called a tooth": sum(bool(row["tooth_flag"]) for row in own),
            }
            for name, hits in called.items():
                share = share_interval(hits, len(own))
                found.append(_figure(name, OURS, kind, tacho, share, len(own)))
    return found


def _of_loss(rows: Sequence[Row], loss: float, tacho: bool) -> list[Row]:
    what = f"loss {loss:.3g}"
    counted = {
        "called a fault": [row["verdict"] == "fault" for row in rows],
        "gear right": [bool(row["gear_right"]) for row in rows if row["tooth_flag"]],
        "tooth right": [
            row["tooth_error"] is not None and row["tooth_error"] <= TOOTH_WITHIN
            for row in rows
            if row["tooth_flag"]
        ],
    }
    sized = [row for row in rows if row["gear_right"] and row["loss"] is not None]
    bounded = [row for row in sized if row["loss_low"] is not None]
    counted["interval covers"] = [r["loss_low"] <= loss <= r["loss_high"] for r in bounded]
    found = [
        _figure(name, OURS, what, tacho, share_interval(sum(hits), len(hits)), len(hits))
        for name, hits in counted.items()
        if hits
    ]
    if sized:
        relative = [row["loss"] / loss - 1 for row in sized]
        quartiles = np.quantile(relative, (0.5, 0.25, 0.75)).tolist()
        found.append(_figure("loss error, quartiles", OURS, what, tacho, quartiles, len(sized)))
    return found


def run_time_rows(rows: Sequence[Row]) -> list[Row]:
    """Median run times of an analysis with and without a reference, with quartiles [s]."""
    found = []
    for tacho in (True, False):
        own = [row for row in rows if row["tacho"] == tacho and row["run_time_s"]]
        if not own:
            continue
        alone = list({row["machine"]: row["alone_s"] for row in own}.values())
        timed = {"with reference": [row["run_time_s"] for row in own], "without": alone}
        for what, values in timed.items():
            quartiles = np.quantile(values, (0.5, 0.25, 0.75)).tolist()
            found.append(_figure("run time in s", OURS, what, tacho, quartiles, len(values)))
    return found


def _figure(
    figure: str, detector: str, what: str, tacho: bool, value: Sequence[float], count: int
) -> Row:
    of = {"figure": figure, "detector": detector, "of": what, "tacho": tacho}
    return of | dict(zip(("value", "low", "high"), value, strict=True)) | {"count": count}


def detection_summary(rows: Sequence[Row]) -> list[Row]:
    """All figures of merit, one a row, with intervals.

    Parameters
    ----------
    rows : sequence of dict
        From `run_detection`.

    Returns
    -------
    list of dict
        ``figure, detector, of, tacho, value, low, high, count``; 95 % intervals, by machines for
        ROC areas, by Wilson for shares; quartiles for errors of the loss and run times.
    """
    tables = (roc_rows, false_alarm_rows, finding_rows, run_time_rows)
    return [row for table in tables for row in table(rows)]
