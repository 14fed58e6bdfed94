"""Demos: whole jobs on data that they make themselves; their stories are templates beside them.

>>> from gearmon.demos import DEMOS
>>> list(DEMOS)
['crack', 'growth', 'kinds', 'day', 'harvest', 'exposure', 'fleet', 'study']
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module, resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gearmon.errors import ArgumentError
from gearmon.files import made_folder, write_atomically
from gearmon.terminal import Progress

if TYPE_CHECKING:
    from gearmon.machine import Machine
    from gearmon.signals.recording import Recording
    from gearmon.study.report import StudyReport

#: Name of a demo -> its function, as "module:function".
DEMOS = {
    "crack": "gearmon.demos.monitoring:crack_demo",
    "growth": "gearmon.demos.monitoring:growth_demo",
    "kinds": "gearmon.demos.monitoring:kinds_demo",
    "day": "gearmon.demos.monitoring:day_demo",
    "harvest": "gearmon.demos.farm:harvest_demo",
    "exposure": "gearmon.demos.farm:exposure_demo",
    "fleet": "gearmon.demos.farm:fleet_demo",
    "study": "gearmon.study.report:write_study",
}


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


def run_demo(name: str, folder: Path, progress: Progress | None = None) -> Demo | StudyReport:
    """Run a demo in a folder of its own.

    Parameters
    ----------
    name : {"crack", "growth", "kinds", "day", "harvest", "exposure", "fleet", "study"}
        A cracked tooth found; a growing crack followed; pitting, wear and eccentricity told apart;
        a day of changing load and speed without a fault; a harvester placed and tuned; a driver's
        exposure to vibration; a fleet of twelve machines; the source study redrawn and judged.
    folder : Path
        Where to write; made if it does not exist.
    progress : callable, optional
        Called with the share done, 0 to 1.

    Raises
    ------
    ArgumentError
        If there is no such demo or the folder cannot be made.
    """
    if name not in DEMOS:
        raise ArgumentError(f"demo={name!r} must be one of {', '.join(DEMOS)}")
    made_folder(folder)
    module, _, function = DEMOS[name].partition(":")
    done: Demo | StudyReport = getattr(import_module(module), function)(folder, progress)
    return done


def given_file(name: str, folder: Path, as_name: str, **values: Any) -> Path:
    """Copy a file of a demo to where a user would have it, with the values that it asks for."""
    text = resources.files("gearmon.demos").joinpath(name).read_text("utf-8")
    write_atomically(folder / as_name, text.format(**values))
    return folder / as_name


def recorded(path: Path, machine: Machine, **settings: Any) -> Recording:
    """Simulate a recording, write it and read it back: a demo sees what a user's files would hold.

    Parameters
    ----------
    path : Path
        Of the file.
    machine : Machine
    **settings
        See `gearmon.simulate`.
    """
    from gearmon.signals.recording import read_recording
    from gearmon.simulation import simulate, write_simulation

    write_simulation(simulate(machine, **settings), path)
    return read_recording(path, sensors=machine.sensors)


def told(folder: Path, name: str, figure: Any, facts: dict[str, Any], **known: Any) -> Demo:
    """Write the picture and the story of a demo, by the template of its name, and return it."""
    from gearmon.report.plots import save

    picture, story = save(figure, folder / f"{name}.png"), story_of(folder, name, **known)
    files = {"folder": folder, "picture": picture, "story": folder / f"{name}.txt"}
    return Demo(story=story, files=files, facts=facts)


def story_of(folder: Path, name: str, **known: Any) -> tuple[str, ...]:
    """Write the story of a demo, by the template of its name, and return its lines."""
    from gearmon.report.wording import template

    story = template(f"{name}.txt", "gearmon.demos").render(known).rstrip()
    write_atomically(folder / f"{name}.txt", story + "\n")
    return tuple(story.splitlines())
