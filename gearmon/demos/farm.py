"""Demos of a farm: a harvester on a tractor, what its driver feels in a day, and a fleet.

The fleet is twelve machines of three kinds, sixty recordings each, of which four need somebody.
Every machine is simulated at two loads; its recordings are stretches of these with noise of their
own. A fault that grows is the sound machine and a growing share of its difference from the
damaged one: to first order in the loss of stiffness the difference is proportional to it. A moved
sensor hears the same through another resonance, and a dead one nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from datetime import datetime, timedelta
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

import gearmon
from gearmon.arrays import FloatArray
from gearmon.demos import Demo, given_file, recorded, story_of
from gearmon.diagnosis.history.store import read_latest
from gearmon.files import write_atomically
from gearmon.fleet.ledger import alarms
from gearmon.fleet.plan import Fleet, read_fleet
from gearmon.fleet.run import run_fleet
from gearmon.harvesting import load_harvester, survey_measured
from gearmon.report import exposure_lines, harvest_lines, save_all, write_exposure_report
from gearmon.terminal import Progress, followed
from gearmon.threads import cores

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
    told = {"faults": [fault] if fault else [], "recording_seed": 2 * number + bool(fault)}
    path = folder / f"{point.name.split(',')[0]}-{'damaged' if fault else 'sound'}.csv"
    return recorded(path, machine, duration_s=12.0, point=point, **AT_THREE_PLACES, **told)


RIDE_HZ, RIDE_S, LEVER_S = 400.0, 240.0, 12.0
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
    count = round(RIDE_HZ * RIDE_S)
    frequency = np.fft.rfftfreq(count, 1 / RIDE_HZ)
    rows: list[FloatArray] = []
    for resonance, share in _RESONANCES.values():
        ratio = frequency / resonance
        ringing = 1j * ratio / (1 - ratio**2 + 0.5j * ratio)
        ground = np.fft.irfft(np.fft.rfft(generator.normal(size=count)) * ringing, count)
        shocks = np.zeros(count)
        for start in generator.integers(count - 60, size=bumps):
            shocks[start : start + 60] += 4 * level * np.hanning(60)
        engine = 0.1 * np.sin(2 * np.pi * 35.0 * np.arange(count) / RIDE_HZ)
        rows.append(share * (level * ground / ground.std() + shocks + engine))
    return gearmon.Recording(
        samples=np.array(rows),
        sampling_rate_hz=RIDE_HZ,
        channel_names=tuple(f"seat_{axis}" for axis in _RESONANCES),
        units=("m/s2",) * len(rows),
    )


RECORDINGS, LEARNED, DURATION_S, RATE_HZ = 60, 4, 2.0, 5120.0
#: Length of what is simulated at each load, and the loads by operating class.
SIMULATED_S, LOADS = 8.0, {"grass": 0.8, "maize": 1.0}
NOISE_DB = -20.0
START = datetime(2026, 6, 1, 6)
#: Teeth of pinion and gear, and speed [rpm].
KINDS = {"baler": (23, 57, 1480.0), "mower": (19, 47, 1470.0), "mixer": (17, 52, 1450.0)}
#: What is wrong with which machine, a fault that grows or a sensor; and from which recording on.
WRONG = {
    "baler-2": ("crack:1:pinion:5:35%", 20),
    "mower-3": ("wear:1:gear:all:60%", 20),
    "mixer-1": ("dead sensor", 45),
    "mixer-4": ("moved sensor", 40),
}
#: Share of the whole difference at which a fault begins to grow.
_FIRST = 0.1
#: Samples of a machine sound, and damaged.
Heard = tuple[FloatArray, FloatArray]


def fleet_demo(folder: Path, progress: Progress | None = None) -> Demo:
    """Make the recordings of a fleet, analyse them, and say how its page is looked at.

    Parameters
    ----------
    folder : Path
        Where to write; it exists.
    progress : callable, optional
        Called with the share done, 0 to 1.
    """
    names = [f"{kind}-{number}" for kind in KINDS for number in range(1, 5)]
    (folder / "inbox").mkdir(exist_ok=True)
    with ProcessPoolExecutor(cores(), get_context("spawn")) as pool:
        list(pool.map(partial(_made, folder), names))
    listed = "".join(
        f'[[machine]]\nname = "{name}"\nfile = "{name}.toml"\nreference = "{name}.ref"\n'
        for name in names
    )
    path = given_file("fleet.toml", folder, "fleet.toml", rate=RATE_HZ, machines=listed)
    fleet = read_fleet(path)
    run = run_fleet(fleet, progress=progress)
    known = {"machines": len(names), "recordings": RECORDINGS, "rows": list(_rows(fleet))}
    story = story_of(folder, "fleet", path=path, **known)
    files = {"folder": folder, "fleet file": path, "store": fleet.store}
    facts = {"truth": {name: what for name, (what, _) in WRONG.items()}, "run": run.to_dict(fleet)}
    return Demo(story=story, files=files, facts=facts | {"latest": read_latest(fleet.store)})


def _rows(fleet: Fleet) -> Iterator[dict[str, str]]:
    """Put the truth beside what was found, a row a machine."""
    for own in read_latest(fleet.store):
        what, first = WRONG.get(own["machine"], ("", 0))
        stands = [a for a in alarms(fleet, own["machine"]) if not a["over"]]
        yield {
            "machine": own["machine"],
            "truth": what,
            "true since": f"{START + timedelta(days=first):%Y-%m-%d}" if what else "",
            "verdict": own["verdict"],
            "alarms": "; ".join(dict.fromkeys(a["finding"] for a in stands)),
            "alarm since": min((a["since"][:10] for a in stands), default=""),
        }


def _made(folder: Path, name: str) -> None:
    """Write machine file, reference and recordings of one machine."""
    kind, number = name.split("-")
    seed = 10 * list(KINDS).index(kind) + int(number)
    pinion, gear, speed = KINDS[kind]
    known = {"kind": kind, "pinion": pinion, "gear": gear, "speed": speed}
    machine = gearmon.load_machine(
        given_file("fleet_machine.toml", folder, f"{name}.toml", **known)
    )
    what, first = WRONG.get(name, ("", RECORDINGS))
    fault = what if ":" in what else ""
    heard = {label: _heard(machine, seed, fault, load) for label, load in LOADS.items()}
    generator, classes = np.random.default_rng(seed), list(LOADS)
    healthy = []
    for count in range(LEARNED):
        samples = _stretch(heard[classes[count % 2]], 0.0, generator)
        own = gearmon.read_recording(samples, RATE_HZ, sensors=machine.sensors)
        healthy.append(replace(own, origin=f"{name}, sound {count + 1}"))
    gearmon.write_reference(gearmon.learn(healthy, machine), folder / f"{name}.ref")
    for count in range(RECORDINGS):
        grown = _FIRST + (1 - _FIRST) * (count - first) / (RECORDINGS - 1 - first or 1)
        share = max(0.0, grown) if count >= first else 0.0
        samples = _stretch(heard[classes[count % 2]], share, generator)
        if count >= first and what == "dead sensor":
            samples[0] = 0.0
        if count >= first and what == "moved sensor":
            samples[0] = _elsewhere(samples[0])
        moment = START + timedelta(days=count, minutes=seed)
        file = folder / "inbox" / f"{name}_{moment:%Y-%m-%dT%H-%M-%S}_{classes[count % 2]}.npy"
        np.save(file, samples.astype(np.float32))


def _heard(machine: gearmon.Machine, seed: int, fault: str, load: float) -> Heard:
    """Simulate without noise a machine sound and, if it is to be, damaged, wandering alike."""
    kept: dict[str, Any] = {"machine_seed": seed, "recording_seed": seed, "load": load}
    kept |= {"channels": 2, "tacho_shaft": 1, "snr_db": None}
    sound, *damaged = (
        np.asarray(gearmon.simulate(machine, faults, SIMULATED_S, RATE_HZ, **kept).samples, float)
        for faults in ([[], [fault]] if fault else [[]])
    )
    return sound, damaged[0] if damaged else sound


def _stretch(heard: Heard, share: float, generator: np.random.Generator) -> FloatArray:
    """Take a stretch at random, with noise of its own; the tacho goes without."""
    sound, damaged = heard
    samples = round(DURATION_S * RATE_HZ)
    start = int(generator.integers(sound.shape[1] - samples))
    part = slice(start, start + samples)
    taken = sound[:, part].copy()
    taken[:-1] += share * (damaged - sound)[:-1, part]
    level = 10 ** (NOISE_DB / 20) * sound[:-1].std(axis=1, keepdims=True)
    taken[:-1] += level * generator.normal(size=taken[:-1].shape)
    return taken


def _elsewhere(samples: FloatArray) -> FloatArray:
    """Hear it from another place: half as loud, and through a resonance at 900 Hz."""
    ratio = np.fft.rfftfreq(len(samples), 1 / RATE_HZ) / 900.0
    path = 0.5 / (1 - ratio**2 + 0.1j * ratio)
    return np.fft.irfft(path * np.fft.rfft(samples), len(samples))
