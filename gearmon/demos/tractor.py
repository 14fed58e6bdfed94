"""Demos of a tractor: a harvester on its power take-off, and what its driver feels in a day."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import gearmon
from gearmon.arrays import FloatArray
from gearmon.demos import Demo, given_file, recorded
from gearmon.files import write_atomically
from gearmon.harvesting import load_harvester, survey_measured
from gearmon.report import exposure_lines, harvest_lines, save_all, write_exposure_report
from gearmon.terminal import Progress, followed

FAULT = "crack:1:pinion:5:30%"
AT_THREE_PLACES: dict[str, Any] = {"sampling_rate_hz": 12_800.0, "channels": 3, "machine_seed": 4}


def harvest_demo(folder: Path, progress: Progress | None = None) -> Demo:
    """Simulate a day at three places, sound and damaged, and place and tune a harvester.

    Parameters
    ----------
    folder : Path
        Where to write; it exists.
    progress : callable, optional
        Called with the share done, 0 to 1.
    """
    machine = gearmon.load_machine(given_file("tractor.toml", folder, "machine.toml"))
    harvester, budget = load_harvester(given_file("harvester.toml", folder, "harvester.toml"))
    sound, damaged, points = [], [], machine.operating
    for number in followed(range(len(points)), len(points) + 1, progress):
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


def _recorded(machine: gearmon.Machine, folder: Path, number: int, fault: str) -> gearmon.Recording:
    """Record an operating point at three places."""
    point = machine.operating[number]
    own: dict[str, Any] = {
        "faults": [fault] if fault else [],
        "recording_seed": 2 * number + bool(fault),
    }
    path = folder / f"{point.name.split(',')[0]}-{'damaged' if fault else 'sound'}.csv"
    return recorded(path, machine, duration_s=12.0, point=point, **AT_THREE_PLACES, **own)


RATE_HZ, DURATION_S, LEVER_S = 400.0, 240.0, 12.0
#: Wear of the pinion that is foretold.
WEAR = "wear:1:pinion:all:20%"
#: Where seat and cab ring upwards, forwards and sideways [Hz], with their share of the level.
_RESONANCES = {"x": (2.1, 0.5), "y": (1.6, 0.45), "z": (2.8, 1.0)}
#: Level of a job [m/s2] and bumps in its recording.
_JOBS = {"ploughing": (0.7, 0), "road": (0.5, 12), "loader": (0.45, 4)}


def exposure_demo(folder: Path, progress: Progress | None = None) -> Demo:
    """Make the recordings of a day, weigh and sum them up, and look for the gearbox in the hand.

    Parameters
    ----------
    folder : Path
        Where to write; it exists.
    progress : callable, optional
        Called with the share done, 0 to 1.
    """
    for number, job in enumerate(followed(_JOBS, len(_JOBS) + 2, progress)):
        path, (level, bumps) = folder / f"{job}.csv", _JOBS[job]
        frame = _ridden(level, bumps, np.random.default_rng(number)).to_frame()
        write_atomically(path, frame.to_csv(index=False, float_format="%.6g"))
    plan = given_file("exposure_day.toml", folder, "day.toml")
    machine = gearmon.load_machine(given_file("tractor.toml", folder, "machine.toml"))
    day = gearmon.exposure_day(plan)
    point, lever = machine.operating[0], folder / "lever.csv"
    recorded(lever, machine, duration_s=LEVER_S, point=point, **AT_THREE_PLACES)
    axes: dict[str, str | int] = {"x": "a1", "y": "a2", "z": "a3"}
    hand = gearmon.vibration_exposure(str(lever), "hand", axes)
    gears = gearmon.gear_share(lever, hand, machine, [WEAR])
    told, named = (day, hand, gears), ("-day", "-hand", "-gearbox")
    figures = {name: own.figures()[""] for name, own in zip(named, told, strict=True)}
    pictures = [str(path) for path in save_all(figures, folder / "exposure.png")]
    report = write_exposure_report(told, folder / "exposure.html")
    return Demo(
        story=tuple(line for own in told for line in (*exposure_lines(own), "")),
        files={"folder": folder, "report": report},
        facts={"pictures": pictures, "day": day.to_dict(), "gearbox": gears.to_dict()},
    )


def _ridden(level: float, bumps: int, generator: np.random.Generator) -> gearmon.Recording:
    """Return what a seat sensor records on rough ground, with bumps and an engine at 35 Hz."""
    count = round(RATE_HZ * DURATION_S)
    frequency = np.fft.rfftfreq(count, 1 / RATE_HZ)
    rows: list[FloatArray] = []
    for resonance, share in _RESONANCES.values():
        ratio = frequency / resonance
        ringing = 1j * ratio / (1 - ratio**2 + 0.5j * ratio)
        ground = np.fft.irfft(np.fft.rfft(generator.normal(size=count)) * ringing, count)
        shocks = np.zeros(count)
        for start in generator.integers(count - 60, size=bumps):
            shocks[start : start + 60] += 4 * level * np.hanning(60)
        engine = 0.1 * np.sin(2 * np.pi * 35.0 * np.arange(count) / RATE_HZ)
        rows.append(share * (level * ground / ground.std() + shocks + engine))
    return gearmon.Recording(
        samples=np.array(rows),
        sampling_rate_hz=RATE_HZ,
        channel_names=tuple(f"seat_{axis}" for axis in _RESONANCES),
        units=("m/s2",) * len(rows),
    )
