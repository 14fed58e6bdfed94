"""A harvester for a tractor's power take-off: three places, a day's duty cycle."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gearmon.demos import Demo, Steps, given_file
from gearmon.harvesting import load_harvester, survey_measured
from gearmon.machine import Machine, load_machine
from gearmon.report import harvest_lines, save_all
from gearmon.signals.recording import Recording, read_recording
from gearmon.simulation import simulate, write_simulation
from gearmon.terminal import Progress

FAULT = "crack:1:pinion:5:30%"


def harvest_demo(folder: Path, progress: Progress | None = None) -> Demo:
    """Simulate a day at three places, sound and damaged, and place and tune a harvester.

    Parameters
    ----------
    folder : Path
        Where to write; it exists.
    progress : callable, optional
        Called with the share done, 0 to 1.
    """
    machine = load_machine(given_file("tractor.toml", folder, "machine.toml"))
    harvester, budget = load_harvester(given_file("harvester.toml", folder, "harvester.toml"))
    sound, damaged, points = [], [], machine.operating
    for number in Steps(progress, len(points) + 1).through(range(len(points))):
        sound.append(_recorded(machine, folder, number, ""))
        damaged.append(_recorded(machine, folder, number, FAULT))
    shares = [point.share for point in points]
    survey = survey_measured(machine, harvester, sound, budget, shares=shares, degraded=damaged)
    pictures = [str(path) for path in save_all(survey.figures(), folder / "harvest.png")]
    return Demo(
        story=(*harvest_lines(survey), *(f"picture: {picture}" for picture in pictures)),
        files={"folder": folder},
        facts={"pictures": pictures} | survey.to_dict(),
    )


def _recorded(machine: Machine, folder: Path, number: int, fault: str) -> Recording:
    """Simulate an operating point, write it and read it back as a user would."""
    point = machine.operating[number]
    seeds: dict[str, Any] = {"machine_seed": 4, "recording_seed": 2 * number + bool(fault)}
    faults, state = ([fault], "damaged") if fault else ([], "sound")
    path = folder / f"{point.name.split(',')[0]}-{state}.csv"
    made = simulate(machine, faults, 12.0, 12_800.0, point=point, channels=3, **seeds)
    write_simulation(made, path)
    return read_recording(path, sensors=machine.sensors)
