"""Load and speed change all day, and nothing is wrong: what is called a fault, and what is not."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearmon.demos import Demo, steps
from gearmon.demos.conveyor import conveyor, conveyor_recording
from gearmon.diagnosis.analysis import analyse, learn
from gearmon.diagnosis.decision import LIMITS
from gearmon.diagnosis.results import Analysis
from gearmon.files import write_atomically
from gearmon.report.demo_plots import DayView, day_figure
from gearmon.report.plots import save
from gearmon.signals.recording import Recording
from gearmon.signatures.measured.reference import write_reference
from gearmon.terminal import Progress

FloatArray = NDArray[np.float64]

#: Load and slip of the recordings that the reference is learned from, the day before.
LEARNED = ((0.5, -0.012), (0.65, 0.012), (0.8, -0.004), (0.95, 0.02), (1.1, 0.004))
HOURS = 16
START = datetime(2026, 5, 4, 6, tzinfo=UTC)
#: What a limit on the level would be set at, above the mean of the reference [dB].
LEVEL_LIMIT_DB = 3.0


def day_demo(folder: Path, progress: Progress | None = None) -> Demo:
    """Simulate a day of a sound machine, judge every hour and draw it.

    Parameters
    ----------
    folder : Path
        Where to write; it exists.
    progress : callable, optional
        Called with the share done, 0 to 1.
    """
    machine, follow = conveyor(folder), steps(progress, len(LEARNED) + HOURS)
    healthy = []
    for number, (load, slip) in enumerate(LEARNED):
        name = f"healthy-{load:.2f}"
        healthy.append(conveyor_recording(machine, name, 200 + number, load=load, slip=slip))
        follow()
    reference = learn(healthy, machine)
    write_reference(reference, folder / "healthy.ref")
    loads, slips = _day()
    analyses, levels = [], []
    wander: dict[str, Any] = {"speed_drift": 0.01, "load_drift": 0.06}
    for number, (load, slip) in enumerate(zip(loads.tolist(), slips.tolist(), strict=True)):
        name = f"{START + timedelta(hours=number):%H:%M}"
        recording = conveyor_recording(machine, name, number, load=load, slip=slip, **wander)
        analyses.append(analyse(recording, machine, reference))
        levels.append(_level_db(recording))
        follow()
    view = DayView(
        hour=START.hour + np.arange(HOURS, dtype=float),
        load=loads,
        speed_hz=np.array([a.signature.speed.estimated_hz for a in analyses]),
        level_db=np.array(levels).T,
        reference_level_db=np.mean([_level_db(r) for r in healthy], axis=0)[:, None],
        limit_db=LEVEL_LIMIT_DB,
        score=np.array([a.score for a in analyses]),
        verdict=tuple(a.verdict for a in analyses),
        channel_names=healthy[0].vibration().channel_names,
    )
    files = {"folder": folder, "picture": folder / "day.png", "story": folder / "day.txt"}
    alarms = view.verdict.count("fault")
    recordings = [analysis.to_dict() for analysis in analyses]
    facts = {"alarms": alarms, "load": loads.tolist(), "recordings": recordings}
    demo = Demo(story=tuple(_told(view, analyses, alarms)), files=files, facts=facts)
    save(day_figure(view), files["picture"])
    write_atomically(files["story"], "\n".join(demo.story) + "\n")
    return demo


def _told(view: DayView, analyses: Sequence[Analysis], alarms: int) -> list[str]:
    """Tell the story."""
    count, verdicts = len(analyses), view.verdict
    moved = view.level_db - view.reference_level_db
    crossed = int(np.sum((moved > LEVEL_LIMIT_DB).any(axis=0)))
    listed = ", ".join(f"{v} {verdicts.count(v)}" for v in dict.fromkeys(verdicts))
    return [
        f"A sound conveyor drive through a day: {count} recordings, load "
        f"{view.load.min():.0%} to {view.load.max():.0%} of nominal, speed "
        f"{view.speed_hz.min():.2f} to {view.speed_hz.max():.2f} Hz.",
        f"The level of the vibration moves by {np.ptp(moved, axis=1).max():.1f} dB; a limit "
        f"{LEVEL_LIMIT_DB:g} dB above the mean of the reference would have been crossed in "
        f"{crossed} of {count} recordings.",
        f"Verdicts: {listed}.",
        f"False alarms: {alarms}, where {LIMITS.rare:.0%} of {count} recordings, "
        f"{LIMITS.rare * count:.2f}, are to be expected by chance.",
        *(f"{a.recording}: {a.verdict} ({a.reason})" for a in analyses if a.verdict != "healthy"),
    ]


def _day() -> tuple[FloatArray, FloatArray]:
    """Load and slip hour by hour: two shifts with a break, a drive that is set faster or slower."""
    hour = np.arange(HOURS)
    generator = np.random.default_rng(5)
    load = 0.8 + 0.27 * np.sin(2 * np.pi * hour / 8.0 - 1.0) + generator.normal(0.0, 0.03, HOURS)
    slip = 0.004 + 0.016 * np.sin(2 * np.pi * hour / 11.0) + generator.normal(0.0, 0.003, HOURS)
    return np.clip(load, 0.5, 1.1), np.clip(slip, -0.02, 0.025)


def _level_db(recording: Recording) -> FloatArray:
    """Level of each vibration channel [dB re 1 unit, rms]."""
    samples = recording.vibration().samples
    return np.asarray(10 * np.log10(np.var(samples, axis=1)), dtype=np.float64)
