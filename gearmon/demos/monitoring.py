"""Demos of monitoring: a crack found and one that grows, kinds of faults told apart, a whole day.

A machine is learned sound at several loads, then judged in recordings that differ from demo to
demo, see `_monitored`. All but the first are of one conveyor drive.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from itertools import islice, product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import gearmon
from gearmon import report
from gearmon.arrays import FloatArray
from gearmon.demos import Demo, given_file, recorded, told
from gearmon.diagnosis import history as histories
from gearmon.diagnosis.evidence import LIMITS
from gearmon.diagnosis.fault_types.kinds import analysis_features, judge_kind
from gearmon.files import write_atomically
from gearmon.machine.parts import example_machine
from gearmon.report.analysis_plots import day_figure, kind_figure
from gearmon.report.text import moment_text
from gearmon.report.wording import percent
from gearmon.terminal import Progress, followed, part_of

if TYPE_CHECKING:
    import pandas as pd

#: Length and rate of the drive's recordings: short, so that a demo takes less than a minute.
DURATION_S, RATE_HZ = 5.0, 10_240.0


#: A recording and what is concluded from it.
Judged = tuple[gearmon.Recording, gearmon.Analysis]


def _monitored(
    folder: Path,
    machine: gearmon.Machine,
    made: Callable[..., gearmon.Recording],
    learned: Sequence[dict[str, Any]],
    new: Sequence[dict[str, Any]],
    progress: Progress | None,
) -> tuple[list[gearmon.Recording], gearmon.Reference, list[Judged]]:
    """Record a machine, learn from the first recordings, and judge the others.

    Parameters
    ----------
    folder : Path
        Where the reference is kept.
    machine : Machine
    made : callable
        Makes a recording; takes the machine and what `learned` and `new` tell of it.
    learned, new : sequence of dict
    progress : callable or None
    """
    total = len(learned) + len(new)
    recordings = followed((made(machine, **own) for own in (*learned, *new)), total, progress)
    healthy = list(islice(recordings, len(learned)))
    reference = gearmon.learn(healthy, machine)
    gearmon.write_reference(reference, folder / "healthy.ref")
    return healthy, reference, [(o, gearmon.analyse(o, machine, reference)) for o in recordings]


def _conveyor(folder: Path) -> gearmon.Machine:
    """Write the file of the conveyor drive and load it."""
    return gearmon.load_machine(given_file("conveyor.toml", folder, "machine.toml"))


def _heard(machine: gearmon.Machine, name: str, **settings: Any) -> gearmon.Recording:
    """Simulate two accelerometers and a tachometer of the drive."""
    known: dict[str, Any] = {"machine_seed": 1, "channels": 2, "tacho_shaft": 1}
    known |= {"duration_s": DURATION_S, "sampling_rate_hz": RATE_HZ}
    made = gearmon.simulate(machine, **known | settings)
    return replace(gearmon.read_recording(made), origin=name)


def _plan(seed: int, **told: Sequence[Any]) -> list[dict[str, Any]]:
    """Return what tells of each recording: columns as rows, with seeds counted from the first."""
    rows = [dict(zip(told, own, strict=True)) for own in zip(*told.values(), strict=True)]
    return [row | {"recording_seed": seed + number} for number, row in enumerate(rows)]


FAULT = "crack:1:pinion:7:30%"
# Healthy recordings at three loads, then a healthy and a cracked one at a load in between.
PLAN: dict[str, Sequence[Any]] = {
    "name": ("healthy-60", "healthy-80", "healthy-100", "new-healthy", "new-cracked"),
    "load": (0.6, 0.8, 1.0, 0.9, 0.9),
    "faults": ([], [], [], [], [FAULT]),
}


def crack_demo(folder: Path, progress: Progress | None = None) -> Demo:
    """Simulate a healthy and a cracked gearbox, learn, analyse both and write the report.

    Parameters
    ----------
    folder : Path
        Where to write; it exists.
    progress : callable, optional
        Called with the share done, 0 to 1.
    """
    write_atomically(folder / "machine.toml", example_machine())
    machine = gearmon.load_machine(folder / "machine.toml")

    def made(machine: gearmon.Machine, name: str, **own: Any) -> gearmon.Recording:
        kept = {"machine_seed": 1, "channels": 2, "tacho_shaft": 1, "sampling_rate_hz": RATE_HZ}
        return recorded(folder / f"{name}.csv", machine, duration_s=6.0, **kept, **own)

    plan = _plan(0, **PLAN)
    _, reference, judged = _monitored(folder, machine, made, plan[:3], plan[3:], progress)
    new, analyses = zip(*judged, strict=True)
    written = gearmon.write_report(analyses, new, reference, machine, folder / "report.html")
    return Demo(
        story=tuple(line for found in analyses for line in (report.analysis_text(found), "")),
        files={"folder": folder, "report": written[0]},
        facts={"recordings": [analysis.to_dict() for analysis in analyses]},
    )


RECORDINGS, SOUND = 20, 6
#: Loss of the pair's stiffness in the last recording, and how it gets there: slowly, then faster.
LAST_LOSS, POWER = 0.35, 1.5
TOOTH = 7
#: What the user of the demo sets.
LIMIT = 0.3
GROWTH_LOADS = (0.6, 0.75, 0.9, 1.05)
START, WEEK = datetime(2026, 1, 5, 8, tzinfo=UTC), timedelta(days=7)


def true_loss(number: int) -> float:
    """Loss of the pair's stiffness in a recording of this number, from 0."""
    since = (number - SOUND + 1) / (RECORDINGS - SOUND)
    return float(LAST_LOSS * max(0.0, since) ** POWER)


def growth_demo(folder: Path, progress: Progress | None = None) -> Demo:
    """Simulate a growing crack, keep the history of its recordings and draw it.

    Parameters
    ----------
    folder : Path
        Where to write; it exists.
    progress : callable, optional
        Called with the share done, 0 to 1.
    """
    losses = [true_loss(number) for number in range(RECORDINGS)]
    loads = np.random.default_rng(7).uniform(0.7, 1.0, RECORDINGS).tolist()
    faults = [[f"crack:1:pinion:{TOOTH}:{loss!r}"] if loss else [] for loss in losses]
    names = [f"week-{number + 1:02d}" for number in range(RECORDINGS)]
    learned = _plan(100, name=[f"healthy-{own:.2f}" for own in GROWTH_LOADS], load=GROWTH_LOADS)
    machine, weeks = _conveyor(folder), _plan(0, name=names, load=loads, faults=faults)
    *_, judged = _monitored(folder, machine, _heard, learned, weeks, progress)
    moments, store = (START + number * WEEK for number in range(RECORDINGS)), folder / "history.db"
    entries = [histories.entry_of(own, at) for (_, own), at in zip(judged, moments, strict=True)]
    # a second run of the demo is the same history
    histories.append(store, entries, replace=True)
    found = histories.history_trends(histories.read_history(store, machine.name), limit=LIMIT)
    sound = [n for n, entry in enumerate(found.history.entries) if entry.verdict != "fault"]
    # from here on all are flagged
    flagged = sound[-1] + 1 if sound else 0
    first = flagged + 1 if flagged < RECORDINGS else None
    facts = {"true_loss": losses, "first_flagged": first, "history": found.to_dict()}
    # how many of the true losses lie within the interval of the cracked tooth's trend, if listed
    within = []
    for tooth in found.shown:
        if (tooth.stage, tooth.gear, tooth.tooth) == (1, "pinion", TOOTH):
            _, low, high = tooth.trend.at([entry.time_s for entry in found.history.entries])
            within.append(int(np.sum((low <= losses) & (losses <= high))))
    story = {"entries": found.history.entries, "sound": losses.index(next(filter(None, losses)))}
    story |= {"within": within, "history": report.history_lines(found), "moment": moment_text}
    story |= {"losses": losses, "flagged": flagged, "tooth": TOOTH}
    return told(folder, "growth", report.history_figure(found, losses), facts, **story)


KIND_LOADS = (0.7, 0.85, 1.0, 1.1)
NEW_LOADS = (0.78, 0.93, 1.04)
PITTED, PIT_LOSS = 14, (0.1, 0.5)
#: Examples that the classifier is trained on.
EXAMPLES = 1200


def _pits() -> list[str]:
    """Pits on most teeth of the pinion: each takes its share of the stiffness about the pitch."""
    generator = np.random.default_rng(3)
    teeth = generator.choice(23, PITTED, replace=False) + 1
    losses = generator.uniform(*PIT_LOSS, PITTED)
    return [f"pitting:1:pinion:{t}:{x:.6f}" for t, x in zip(teeth, losses, strict=True)]


#: Faults of the pinion by the name of what is wrong, and what that is.
STATES = {
    "sound": ([], "nothing is wrong"),
    "distributed pitting": (
        _pits(),
        f"pits on {PITTED} of 23 teeth that take {PIT_LOSS[0]:.0%} to {PIT_LOSS[1]:.0%} of the "
        "stiffness about the pitch point",
    ),
    "wear": (["profile:1:pinion:all:12um"], "all flanks worn by 12 µm at tip and root"),
    "eccentricity": (["eccentricity:1:pinion:all:40um"], "its centre is off by another 40 µm"),
}
#: What is drawn of each recording.
FEATURES = {
    "mesh_rms_db": "mesh\nharmonics",
    "once_db": "sidebands\n1 turn away",
    "twice_db": "2 turns",
    "several_db": "4 to 6\nturns",
    "far_db": "farther\naway",
    "peak_db": "highest place\nof the turn",
}


def kinds_demo(folder: Path, progress: Progress | None = None) -> Demo:
    """Record a machine sound, pitted, worn and running out, and tell these apart.

    Parameters
    ----------
    folder : Path
        Where to write; it exists.
    progress : callable, optional
        Called with the share done, 0 to 1.
    """
    trials = list(product(STATES, NEW_LOADS))
    loads, faults = [load for _, load in trials], [STATES[truth][0] for truth, _ in trials]
    new = _plan(0, name=[f"{load:.0%} load" for load in loads], load=loads, faults=faults)
    learned = _plan(100, name=[f"{load:.0%} load" for load in KIND_LOADS], load=KIND_LOADS)
    machine = _conveyor(folder)
    training, judging = part_of(progress, 0.0, 0.2), part_of(progress, 0.2, 0.8)
    classifier = gearmon.train_kinds(machine, count=EXAMPLES, progress=training)
    _, reference, found = _monitored(folder, machine, _heard, learned, new, judging)
    judged, rows = [], []
    for (truth, load), (_, analysis) in zip(trials, found, strict=True):
        features = analysis_features(analysis, reference)
        measured = features[1, "pinion"]
        # the kind is asked for only where a fault is called
        kind = judge_kind(features, classifier) if analysis.verdict == "fault" else None
        words = {"healthy": "sound", "fault": kind.kind if kind else ""}
        one: dict[str, Any] = {"truth": truth, "load": load}
        one["told"] = words.get(analysis.verdict, analysis.verdict)
        row = {"truth": truth, "load": percent(load, 0), "verdict": analysis.verdict}
        row |= {"told": one["told"], "of": (kind.gear or "") if kind else ""}
        rows.append(row | {"share": percent(kind.probability, 0) if kind else ""})
        one["features_db"] = {name: measured[name] for name in FEATURES}
        one |= {"kind": None if kind is None else kind.to_dict(), "analysis": analysis.to_dict()}
        judged.append(one)
    right = sum(one["told"] == one["truth"] for one in judged)
    facts = {"right": right, "recordings": judged}
    changes = dict(_changes(truth, judged) for truth in STATES)
    story = {"states": STATES, "loads": NEW_LOADS, "judged": judged, "right": right}
    return told(folder, "kinds", kind_figure(changes), facts, rows=rows, **story)


def _changes(truth: str, judged: Sequence[dict[str, Any]]) -> tuple[str, pd.DataFrame]:
    """Return the title of a state and its changes, recordings by features."""
    own = {f"{one['load']:.0%} load": one for one in judged if one["truth"] == truth}
    said = ", ".join(dict.fromkeys(one["told"] for one in own.values()))
    import pandas as pd

    frame = pd.DataFrame({name: one["features_db"] for name, one in own.items()}).T
    return f"Truth: {truth}. Told: {said}.", frame.rename(columns=FEATURES)


#: Load and slip of the recordings that the reference is learned from, the day before.
DAY_LEARNED = ((0.5, -0.012), (0.65, 0.012), (0.8, -0.004), (0.95, 0.02), (1.1, 0.004))
HOURS = 16
MORNING = datetime(2026, 5, 4, 6, tzinfo=UTC)
#: What a limit on the level would be set at, above the mean of the reference [dB].
LEVEL_LIMIT_DB = 3.0
#: Levels of the two channels, less the mean of the reference [dB].
LEVELS = ("level of a1", "level of a2")


def day_demo(folder: Path, progress: Progress | None = None) -> Demo:
    """Simulate a day of a sound machine, judge every hour and draw it.

    Parameters
    ----------
    folder : Path
        Where to write; it exists.
    progress : callable, optional
        Called with the share done, 0 to 1.
    """
    import pandas as pd

    (loads, slips), (known, slipped) = _day(), zip(*DAY_LEARNED, strict=True)
    learned = _plan(200, name=[f"healthy-{load:.2f}" for load in known], load=known, slip=slipped)
    names = [f"{MORNING + timedelta(hours=number):%H:%M}" for number in range(HOURS)]
    wander = {"speed_drift": 0.01, "load_drift": 0.06}
    new = [own | wander for own in _plan(0, name=names, load=loads, slip=slips)]
    healthy, _, judged = _monitored(folder, _conveyor(folder), _heard, learned, new, progress)
    usual_db = np.mean([_level_db(recording) for recording in healthy], axis=0)
    hours = [
        (load, own.signature.speed.estimated_hz, own.score, own.verdict, *(_level_db(r) - usual_db))
        for load, (r, own) in zip(loads, judged, strict=True)
    ]
    columns = ["load", "speed_hz", "score", "verdict", *LEVELS]
    clock = MORNING.hour + np.arange(HOURS, dtype=float)
    day, analyses = pd.DataFrame(hours, clock, columns), [analysis for _, analysis in judged]
    alarms = int(np.sum(day["verdict"] == "fault"))
    recordings = [analysis.to_dict() for analysis in analyses]
    facts = {"alarms": alarms, "load": day["load"].tolist(), "recordings": recordings}
    story = {"day": day, "verdicts": day["verdict"].tolist(), "levels": list(LEVELS)}
    story |= {"analyses": analyses, "limit_db": LEVEL_LIMIT_DB, "rare": LIMITS.rare}
    return told(folder, "day", day_figure(day, LEVEL_LIMIT_DB), facts, **story)


def _day() -> tuple[list[float], list[float]]:
    """Load and slip hour by hour: two shifts with a break, a drive that is set faster or slower."""
    hour = np.arange(HOURS)
    generator = np.random.default_rng(5)
    load = 0.8 + 0.27 * np.sin(2 * np.pi * hour / 8.0 - 1.0) + generator.normal(0.0, 0.03, HOURS)
    slip = 0.004 + 0.016 * np.sin(2 * np.pi * hour / 11.0) + generator.normal(0.0, 0.003, HOURS)
    return np.clip(load, 0.5, 1.1).tolist(), np.clip(slip, -0.02, 0.025).tolist()


def _level_db(recording: gearmon.Recording) -> FloatArray:
    """Level of each vibration channel [dB re 1 unit, rms]."""
    samples = recording.vibration().samples
    return np.asarray(10 * np.log10(np.var(samples, axis=1)), dtype=np.float64)
