"""Load and speed change all day, and nothing is wrong: what is called a fault, and what is not."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gearmon.demos import Demo, Steps, conveyor, conveyor_recording, learned, told
from gearmon.diagnosis.analysis import analyse
from gearmon.diagnosis.decision import LIMITS
from gearmon.diagnosis.results import Analysis
from gearmon.report.history_plots import day_figure
from gearmon.signals.recording import Recording
from gearmon.terminal import Progress

if TYPE_CHECKING:
    import pandas as pd

FloatArray = NDArray[np.float64]

#: Load and slip of the recordings that the reference is learned from, the day before.
LEARNED = ((0.5, -0.012), (0.65, 0.012), (0.8, -0.004), (0.95, 0.02), (1.1, 0.004))
HOURS = 16
START = datetime(2026, 5, 4, 6, tzinfo=UTC)
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

    machine, steps = conveyor(folder), Steps(progress, len(LEARNED) + HOURS)
    healthy = [
        conveyor_recording(machine, f"healthy-{load:.2f}", 200 + number, load=load, slip=slip)
        for number, (load, slip) in enumerate(steps.through(LEARNED))
    ]
    reference = learned(machine, healthy, folder)
    usual_db = np.mean([_level_db(recording) for recording in healthy], axis=0)
    analyses, hours = [], []
    wander: dict[str, Any] = {"speed_drift": 0.01, "load_drift": 0.06}
    for number, (load, slip) in enumerate(steps.through(zip(*_day(), strict=True))):
        name = f"{START + timedelta(hours=number):%H:%M}"
        recording = conveyor_recording(machine, name, number, load=load, slip=slip, **wander)
        analysis = analyse(recording, machine, reference)
        analyses.append(analysis)
        speed_hz = analysis.signature.speed.estimated_hz
        known = {"load": load, "speed_hz": speed_hz, "score": analysis.score}
        moved = zip(LEVELS, _level_db(recording) - usual_db, strict=True)
        hours.append(known | {"verdict": analysis.verdict} | dict(moved))
    day = pd.DataFrame(hours, index=START.hour + np.arange(HOURS, dtype=float))
    alarms = int(np.sum(day["verdict"] == "fault"))
    recordings = [analysis.to_dict() for analysis in analyses]
    facts = {"alarms": alarms, "load": day["load"].tolist(), "recordings": recordings}
    return told(folder, "day", day_figure(day, LEVEL_LIMIT_DB), _story(day, analyses), facts)


def _story(day: pd.DataFrame, analyses: Sequence[Analysis]) -> list[str]:
    """Tell the story."""
    count, verdicts, moved = len(day), day["verdict"].tolist(), day[[*LEVELS]]
    load, speed_hz, alarms = day["load"], day["speed_hz"], verdicts.count("fault")
    crossed = int((moved > LEVEL_LIMIT_DB).any(axis=1).sum())
    listed = ", ".join(f"{v} {verdicts.count(v)}" for v in dict.fromkeys(verdicts))
    return [
        f"A sound conveyor drive through a day: {count} recordings, load {load.min():.0%} to "
        f"{load.max():.0%} of nominal, speed {speed_hz.min():.2f} to {speed_hz.max():.2f} Hz.",
        f"The level of the vibration moves by {(moved.max() - moved.min()).max():.1f} dB; a limit "
        f"{LEVEL_LIMIT_DB:g} dB above the mean of the reference would have been crossed in "
        f"{crossed} of {count} recordings.",
        f"Verdicts: {listed}.",
        f"False alarms: {alarms}, where {LIMITS.rare:.0%} of {count} recordings, "
        f"{LIMITS.rare * count:.2f}, are to be expected by chance.",
        *(f"{a.recording}: {a.verdict} ({a.reason})" for a in analyses if a.verdict != "healthy"),
    ]


def _day() -> tuple[list[float], list[float]]:
    """Load and slip hour by hour: two shifts with a break, a drive that is set faster or slower."""
    hour = np.arange(HOURS)
    generator = np.random.default_rng(5)
    load = 0.8 + 0.27 * np.sin(2 * np.pi * hour / 8.0 - 1.0) + generator.normal(0.0, 0.03, HOURS)
    slip = 0.004 + 0.016 * np.sin(2 * np.pi * hour / 11.0) + generator.normal(0.0, 0.003, HOURS)
    return np.clip(load, 0.5, 1.1).tolist(), np.clip(slip, -0.02, 0.025).tolist()


def _level_db(recording: Recording) -> FloatArray:
    """Level of each vibration channel [dB re 1 unit, rms]."""
    samples = recording.vibration().samples
    return np.asarray(10 * np.log10(np.var(samples, axis=1)), dtype=np.float64)
