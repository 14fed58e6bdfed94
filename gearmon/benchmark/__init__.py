"""Run time, memory and error, measured side by side with named competitors."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from gearmon.errors import ArgumentError
from gearmon.terminal import Progress

CASES = ("analyse", "memory", "stiffness")


def run_case(case: str, progress: Progress | None = None) -> list[dict[str, Any]]:
    """Run one benchmark.

    Parameters
    ----------
    case : {"analyse", "memory", "stiffness"}
        Which one.
    progress : callable, optional
        Called with the share done, 0 to 1.

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

        return [asdict(timing) for timing in time_stiffness()]
    raise ArgumentError(f"benchmark case={case!r} must be one of {', '.join(CASES)}")
