"""Demos: whole jobs on data that they make themselves.

>>> from gearmon.demos import DEMOS
>>> list(DEMOS)
['crack', 'growth', 'kinds', 'day', 'harvest', 'study']
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module, resources
from itertools import count
from pathlib import Path
from typing import Any, Protocol

from gearmon.errors import ArgumentError
from gearmon.terminal import Progress, progress_bar

#: Name of a demo -> its function, as "module:function".
DEMOS = {
    "crack": "gearmon.demos.crack:crack_demo",
    "growth": "gearmon.demos.growth:growth_demo",
    "kinds": "gearmon.demos.kinds:kinds_demo",
    "day": "gearmon.demos.day:day_demo",
    "harvest": "gearmon.demos.harvest:harvest_demo",
    "study": "gearmon.study.report:write_study",
}


class Told(Protocol):
    """What a demo did."""

    def lines(self) -> list[str]:
        """Tell it on a terminal."""

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""


@dataclass(frozen=True, kw_only=True)
class Demo:
    """A demo that was run.

    Parameters
    ----------
    story : tuple of str
        What happened, line by line.
    files : dict of str to Path
        What was written, by what it is; "folder" holds it all.
    facts : dict
        What was found, in built-in types.
    """

    story: tuple[str, ...]
    files: dict[str, Path]
    facts: dict[str, Any]

    def lines(self) -> list[str]:
        """Tell it on a terminal."""
        return [*self.story, *(f"{what}: {path}" for what, path in self.files.items())]

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        return {what: str(path) for what, path in self.files.items()} | self.facts


def run_demo(name: str, folder: Path) -> Told:
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
    module, _, function = DEMOS[name].partition(":")
    with progress_bar("demo") as progress:
        done: Told = getattr(import_module(module), function)(folder, progress)
        return done


def given_file(name: str, folder: Path, as_name: str) -> Path:
    """Copy a machine or harvester file of a demo to where a user would have it."""
    from gearmon.files import write_atomically

    text = resources.files("gearmon.demos").joinpath(name).read_text("utf-8")
    write_atomically(folder / as_name, text)
    return folder / as_name


def steps(progress: Progress | None, total: int) -> Callable[[], None]:
    """Return what is to be called after each of so many steps."""
    number = count(1)
    return lambda: progress(next(number) / total) if progress is not None else None
