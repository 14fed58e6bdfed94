"""Load and speed change all day, and nothing is wrong: what is called a fault, and what is not."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearmon.demos.conveyor import MACHINE, conveyor_recording
from gearmon.diagnosis.analysis import analyse, learn
from gearmon.diagnosis.decision import LIMITS
from gearmon.diagnosis.results import Analysis
from gearmon.files import write_atomically
from gearmon.machine import load_machine
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


@dataclass(frozen=True, kw_only=True, eq=False)
class DayDemo:
    """What the demo did.

    Parameters
    ----------
    folder : Path
        Where its files are.
    analyses : tuple of Analysis
        One an hour.
    view : DayView
        What is drawn.
    picture, story : Path
    """

    folder: Path
    analyses: tuple[Analysis, ...]
    view: DayView
    picture: Path
    story: Path

    @property
    def alarms(self) -> int:
        """Recordings that were called a fault; the machine is sound."""
        return sum(analysis.verdict == "fault" for analysis in self.analyses)

    def lines(self) -> list[str]:
        """Tell it on a terminal."""
        return [
            *self.told(),
            f"machine file and reference: {self.folder}",
            f"picture: {self.picture}",
            f"story: {self.story}",
        ]

    def told(self) -> list[str]:
        """Tell the story."""
        view, count = self.view, len(self.analyses)
        moved = view.level_db - view.reference_level_db
        crossed = int(np.sum((moved > LEVEL_LIMIT_DB).any(axis=0)))
        verdicts = [analysis.verdict for analysis in self.analyses]
        listed = ", ".join(f"{v} {verdicts.count(v)}" for v in dict.fromkeys(verdicts))
        told = [
            f"A sound conveyor drive through a day: {count} recordings, load "
            f"{view.load.min():.0%} to {view.load.max():.0%} of nominal, speed "
            f"{view.speed_hz.min():.2f} to {view.speed_hz.max():.2f} Hz.",
            f"The level of the vibration moves by {np.ptp(moved, axis=1).max():.1f} dB; a limit "
            f"{LEVEL_LIMIT_DB:g} dB above the mean of the reference would have been crossed in "
            f"{crossed} of {count} recordings.",
            f"Verdicts: {listed}.",
            f"False alarms: {self.alarms}, where {LIMITS.rare:.0%} of {count} recordings, "
            f"{LIMITS.rare * count:.2f}, are to be expected by chance.",
        ]
        told += [
            f"{analysis.recording}: {analysis.verdict} ({analysis.reason})"
            for analysis in self.analyses
            if analysis.verdict != "healthy"
        ]
        return told

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        return {
            "folder": str(self.folder),
            "picture": str(self.picture),
            "story": str(self.story),
            "alarms": self.alarms,
            "load": self.view.load.tolist(),
            "recordings": [analysis.to_dict() for analysis in self.analyses],
        }


def day_demo(folder: Path, progress: Progress | None = None) -> DayDemo:
    """Simulate a day of a sound machine, judge every hour and draw it.

    Parameters
    ----------
    folder : Path
        Where to write; it exists.
    progress : callable, optional
        Called with the share done, 0 to 1.
    """
    write_atomically(folder / "machine.toml", MACHINE)
    machine = load_machine(folder / "machine.toml")
    steps = len(LEARNED) + HOURS
    healthy = []
    for number, (load, slip) in enumerate(LEARNED):
        name = f"healthy-{load:.2f}"
        healthy.append(conveyor_recording(machine, name, 200 + number, load=load, slip=slip))
        _follow(progress, (number + 1) / steps)
    reference = learn(healthy, machine)
    write_reference(reference, folder / "healthy.ref")
    loads, slips = _day()
    analyses, levels = [], []
    for number, (load, slip) in enumerate(zip(loads, slips, strict=True)):
        when = START + timedelta(hours=number)
        recording = conveyor_recording(
            machine,
            f"{when:%H:%M}",
            number,
            load=float(load),
            slip=float(slip),
            speed_drift=0.01,
            load_drift=0.06,
        )
        analyses.append(analyse(recording, machine, reference))
        levels.append(_level_db(recording))
        _follow(progress, (len(LEARNED) + number + 1) / steps)
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
    picture, story = folder / "day.png", folder / "day.txt"
    save(day_figure(view), picture)
    demo = DayDemo(folder=folder, analyses=tuple(analyses), view=view, picture=picture, story=story)
    write_atomically(story, "\n".join(demo.told()) + "\n")
    return demo


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


def _follow(progress: Progress | None, share: float) -> None:
    if progress is not None:
        progress(share)
