"""A crack that grows on a pinion tooth over twenty recordings, followed until it is flagged."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from gearmon.demos.conveyor import MACHINE, conveyor_recording
from gearmon.diagnosis.analysis import analyse, learn
from gearmon.diagnosis.history import (
    History,
    HistoryTrends,
    append,
    entry_of,
    history_trends,
    read_history,
)
from gearmon.files import write_atomically
from gearmon.gears.faults import Fault
from gearmon.machine import load_machine
from gearmon.report.history_plots import history_figure
from gearmon.report.history_text import history_lines, moment_text
from gearmon.report.plots import save
from gearmon.signatures.measured.reference import write_reference
from gearmon.terminal import Progress

RECORDINGS, SOUND = 20, 6
#: Loss of the pair's stiffness in the last recording, and how it gets there: slowly, then faster.
LAST_LOSS, POWER = 0.35, 1.5
TOOTH = 7
#: What the user of the demo sets.
LIMIT = 0.3
HEALTHY_LOADS = (0.6, 0.75, 0.9, 1.05)
START, STEP = datetime(2026, 1, 5, 8, tzinfo=UTC), timedelta(days=7)


@dataclass(frozen=True, kw_only=True, eq=False)
class GrowthDemo:
    """What the demo did.

    Parameters
    ----------
    folder : Path
        Where its files are.
    found : HistoryTrends
        What the history shows.
    losses : tuple of float
        The truth: loss of the pair's stiffness in each recording.
    picture, story : Path
    """

    folder: Path
    found: HistoryTrends
    losses: tuple[float, ...]
    picture: Path
    story: Path

    @property
    def flagged(self) -> int | None:
        """Number of the first recording, from 0, from which on all are flagged."""
        entries = self.found.history.entries
        number = len(entries)
        while number and entries[number - 1].verdict == "fault":
            number -= 1
        return number if number < len(entries) else None

    def lines(self) -> list[str]:
        """Tell it on a terminal."""
        return [
            *self.told(),
            f"machine file, reference and history: {self.folder}",
            f"picture: {self.picture}",
            f"story: {self.story}",
        ]

    def told(self) -> list[str]:
        """Tell the story."""
        entries = self.found.history.entries
        first = next(number for number, loss in enumerate(self.losses) if loss > 0)
        told = [
            f"A crack on tooth {TOOTH} of the pinion, in {len(entries)} recordings a week apart.",
            f"The truth: sound until {moment_text(entries[first - 1].time_s, fine=False)}, then a "
            f"loss of pair stiffness that grows to {self.losses[-1]:.0%}.",
        ]
        early = [e for e, loss in zip(entries, self.losses, strict=True) if not loss]
        wrong = sum(bool(entry.findings) for entry in early)
        told.append(f"Flags in the {len(early)} sound recordings: {wrong}.")
        if self.flagged is None:
            told.append("The last recording is not flagged: this crack was not found.")
        else:
            entry = entries[self.flagged]
            told.append(
                f"Flagged in every recording since {moment_text(entry.time_s, fine=False)}, at a "
                f"true loss of {self.losses[self.flagged]:.1%}: {entry.findings[0]}."
            )
            last = entries[-1].findings
            told.append(f"The last recording's findings: {'; '.join(last)}.")
        return [*told, *self._held(), "", *history_lines(self.found)]

    def _held(self) -> list[str]:
        """Tell how the trend of the cracked tooth and the truth agree, if it is listed at all."""
        own = [t for t in self.found.shown if (t.stage, t.gear, t.tooth) == (1, "pinion", TOOTH)]
        if not own:
            return []
        entries = self.found.history.entries
        _, low, high = own[0].at([entry.time_s for entry in entries])
        inside = sum(a <= loss <= b for a, loss, b in zip(low, self.losses, high, strict=True))
        return [
            f"The truth lies within the 90 % interval of the trend in {inside} of {len(entries)} "
            "recordings."
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        return {
            "folder": str(self.folder),
            "picture": str(self.picture),
            "story": str(self.story),
            "true_loss": list(self.losses),
            "first_flagged": None if self.flagged is None else self.flagged + 1,
            "history": self.found.to_dict(),
        }


def true_loss(number: int) -> float:
    """Loss of the pair's stiffness in a recording of this number, from 0."""
    since = (number - SOUND + 1) / (RECORDINGS - SOUND)
    return float(LAST_LOSS * max(0.0, since) ** POWER)


def growth_demo(folder: Path, progress: Progress | None = None) -> GrowthDemo:
    """Simulate a growing crack, keep the history of its recordings and draw it.

    Parameters
    ----------
    folder : Path
        Where to write; it exists.
    progress : callable, optional
        Called with the share done, 0 to 1.
    """
    write_atomically(folder / "machine.toml", MACHINE)
    machine = load_machine(folder / "machine.toml")
    steps = len(HEALTHY_LOADS) + RECORDINGS
    healthy = []
    for number, load in enumerate(HEALTHY_LOADS):
        healthy.append(conveyor_recording(machine, f"healthy-{load:.2f}", 100 + number, load=load))
        _follow(progress, (number + 1) / steps)
    reference = learn(healthy, machine)
    write_reference(reference, folder / "healthy.ref")
    loads = np.random.default_rng(7).uniform(0.7, 1.0, RECORDINGS)
    history = History(machine=machine.name)
    for number, load in enumerate(loads):
        loss = true_loss(number)
        faults = (
            [Fault(kind="crack", stage=1, gear="pinion", tooth=TOOTH, size=loss)] if loss else []
        )
        name = f"week-{number + 1:02d}"
        recording = conveyor_recording(machine, name, number, faults, load=float(load))
        analysis = analyse(recording, machine, reference)
        history = history.with_entry(entry_of(analysis, START + number * STEP))
        _follow(progress, (len(HEALTHY_LOADS) + number + 1) / steps)
    store = folder / "history.db"
    append(store, history.entries, replace=True)  # a second run of the demo is the same history
    found = history_trends(read_history(store, machine.name), limit=LIMIT)
    picture, story = folder / "growth.png", folder / "growth.txt"
    losses = tuple(true_loss(number) for number in range(RECORDINGS))
    save(history_figure(found, losses), picture)
    demo = GrowthDemo(
        folder=folder,
        found=found,
        losses=losses,
        picture=picture,
        story=story,
    )
    write_atomically(story, "\n".join(demo.told()) + "\n")
    return demo


def _follow(progress: Progress | None, share: float) -> None:
    if progress is not None:
        progress(share)
