"""Demos: whole jobs on data that they make themselves."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from gearmon.errors import ArgumentError
from gearmon.terminal import Progress, progress_bar

DEMOS = ("crack", "growth", "kinds", "day", "harvest", "study")


class Demo(Protocol):
    """What a demo did."""

    def lines(self) -> list[str]:
        """Tell it on a terminal."""

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""


def run_demo(name: str, folder: Path) -> Demo:
    """Run a demo in a folder of its own.

    Parameters
    ----------
    name : {"crack", "growth", "kinds", "day", "harvest", "study"}
        A cracked tooth found; a growing crack followed; pitting, wear and eccentricity told apart;
        a day of changing load and speed without a fault; a harvester placed and tuned; the source
        study redrawn and judged.
    folder : Path
        Where to write; made if it does not exist.

    Raises
    ------
    ArgumentError
        If there is no such demo or the folder cannot be made.
    """
    if name not in DEMOS:
        raise ArgumentError(f"demo={name!r} must be one of {', '.join(DEMOS)}")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ArgumentError(f"{folder}: cannot make this folder ({error.strerror})") from None
    with progress_bar("demo") as progress:
        return _of(name)(folder, progress)


def _of(name: str) -> Callable[[Path, Progress | None], Demo]:
    """Return the function of a demo; only what it needs is imported."""
    if name == "growth":
        from gearmon.demos.growth import growth_demo

        return growth_demo
    if name == "kinds":
        from gearmon.demos.kinds import kinds_demo

        return kinds_demo
    if name == "day":
        from gearmon.demos.day import day_demo

        return day_demo
    if name == "harvest":
        from gearmon.demos.harvest import harvest_demo

        return harvest_demo
    if name == "study":
        from gearmon.study.report import write_study

        return write_study
    from gearmon.demos.crack import crack_demo

    return crack_demo
