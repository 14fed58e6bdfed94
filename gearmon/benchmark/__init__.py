"""Run time, memory and error, measured side by side with named competitors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from gearmon.errors import ArgumentError
from gearmon.terminal import Progress

CASES = (
    "analyse",
    "memory",
    "stiffness",
    "harvesting",
    "dynamics",
    "stress",
    "signals",
    "detection",
)
#: Cases that have pictures.
PICTURED = ("dynamics", "stress", "signals", "detection")


def run_case(
    case: str,
    progress: Progress | None = None,
    *,
    ross_python: str | None = None,
    quick: bool = False,
    seed: int = 0,
    count: int | None = None,
) -> list[dict[str, Any]]:
    """Run one benchmark.

    Parameters
    ----------
    case : str
        One of `CASES`.
    progress : callable, optional
        Called with the share done, 0 to 1.
    ross_python : str, optional
        Interpreter of an environment with ROSS, for the case "stiffness"; by default the
        environment variable GEARMON_ROSS_PYTHON.
    quick : bool
        Rough figures in seconds, for "harvesting", "dynamics", "stress", "signals" and
        "detection".
    seed : int
        Of what "dynamics", "stress" and "detection" draw.
    count : int, optional
        Number of random systems of "stress" (5,000 by default), of parameter sets of "dynamics"
        (10,000 by default), of machines of "detection" (60 by default).

    Returns
    -------
    list of dict
        Rows of figures, with machine and versions in each.

    Raises
    ------
    ArgumentError
        If there is no such case.
    """
    if case == "analyse":
        from gearmon.benchmark.whole_process import analysis_against_reading

        return analysis_against_reading(progress=progress)
    if case == "memory":
        from gearmon.benchmark.whole_process import memory_of_long_recording

        return memory_of_long_recording(progress=progress)
    if case == "stiffness":
        from gearmon.benchmark.stiffness import time_stiffness

        return [asdict(timing) for timing in time_stiffness(python=ross_python)]
    if case == "harvesting":
        from gearmon.benchmark.harvesting import time_harvesting

        return time_harvesting(progress, quick=quick)
    if case == "dynamics":
        from gearmon.benchmark.dynamics import run_dynamics

        return run_dynamics(
            quick=quick, seed=seed, sets=10_000 if count is None else count, progress=progress
        )
    if case == "stress":
        from gearmon.benchmark.stress import run_stress

        return run_stress(
            5000 if count is None else count, seed=seed, quick=quick, progress=progress
        )
    if case == "signals":
        from gearmon.benchmark.signals import run_signals

        return run_signals(progress, quick=quick)
    if case == "detection":
        from gearmon.benchmark.detection import MACHINES, run_detection

        return run_detection(
            MACHINES if count is None else count, seed=seed, quick=quick, progress=progress
        )
    raise ArgumentError(f"benchmark case={case!r} must be one of {', '.join(CASES)}")


def summary_rows(case: str, rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the few rows that a terminal shows of a benchmark.

    Parameters
    ----------
    case : str
        As given to `run_case`.
    rows : sequence of dict
        What it returned.
    """
    if case == "dynamics":
        from gearmon.benchmark.dynamics import headlines

        return headlines(rows)
    if case == "stress":
        from gearmon.benchmark.stress import stress_summary

        return stress_summary(rows)
    if case == "signals":
        shown = ("case", "method", "samples", "channels", "median_s", "times_own", "note")
        return [{name: row[name] for name in shown} for row in rows]
    if case == "detection":
        from gearmon.benchmark.detection import detection_summary

        return detection_summary(rows)
    return list(rows)


def save_figures(case: str, rows: Sequence[dict[str, Any]], path: str | Path) -> list[Path]:
    """Write the pictures of a benchmark.

    Parameters
    ----------
    case : str
        As given to `run_case`.
    rows : sequence of dict
        What it returned.
    path : str or Path
        Picture file; of several each gets its name before the suffix.

    Returns
    -------
    list of Path

    Raises
    ------
    ArgumentError
        If this benchmark has no pictures.
    """
    if case == "dynamics":
        from gearmon.report.benchmark_plots import save_dynamics_figures

        return save_dynamics_figures(rows, path)
    if case == "stress":
        from gearmon.report.stress_plots import save_stress_figure

        return save_stress_figure(rows, path)
    if case == "signals":
        from gearmon.report.signals_benchmark_plots import save_signals_figure

        return save_signals_figure(rows, path)
    if case == "detection":
        from gearmon.benchmark.detection import detection_summary
        from gearmon.report.detection_plots import save_detection_figures

        return save_detection_figures(rows, detection_summary(rows), path)
    raise ArgumentError(f"benchmark case={case!r} has no pictures; {', '.join(PICTURED)} have")
