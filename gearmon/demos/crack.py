"""A crack on a pinion tooth: found, as the README promises, and followed as another one grows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from gearmon.demos import Demo, Steps, conveyor, conveyor_recording, learned, told
from gearmon.diagnosis.analysis import analyse
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
from gearmon.machine.reading import example_machine
from gearmon.report import analysis_text, write_report
from gearmon.report.history_plots import history_figure
from gearmon.report.history_text import history_lines, moment_text
from gearmon.signals.recording import read_recording
from gearmon.simulation import simulate, write_simulation
from gearmon.terminal import Progress

FAULT = "crack:1:pinion:7:30%"
# Healthy recordings at three loads, then a healthy and a cracked one at a load in between.
PLAN = {
    "healthy-60": (0.6, ""),
    "healthy-80": (0.8, ""),
    "healthy-100": (1.0, ""),
    "new-healthy": (0.9, ""),
    "new-cracked": (0.9, FAULT),
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
    machine, steps = load_machine(folder / "machine.toml"), Steps(progress, len(PLAN) + 1)
    recordings = []
    for number, (name, (load, fault)) in enumerate(steps.through(PLAN.items())):
        faults, path = [fault] if fault else [], folder / f"{name}.csv"
        kept: dict[str, Any] = {"channels": 2, "tacho_shaft": 1, "machine_seed": 1}
        made = simulate(machine, faults, 6.0, 10_240.0, recording_seed=number, load=load, **kept)
        write_simulation(made, path)
        # read back: the demo sees what a user's files would hold
        recordings.append(read_recording(path))
    reference = learned(machine, recordings[:3], folder)
    analyses = [analyse(recording, machine, reference) for recording in recordings[3:]]
    report = folder / "report.html"
    write_report(analyses, recordings[3:], reference, machine, report)
    return Demo(
        story=tuple(line for found in analyses for line in (analysis_text(found), "")),
        files={"folder": folder, "report": report},
        facts={"recordings": [analysis.to_dict() for analysis in analyses]},
    )


RECORDINGS, SOUND = 20, 6
#: Loss of the pair's stiffness in the last recording, and how it gets there: slowly, then faster.
LAST_LOSS, POWER = 0.35, 1.5
TOOTH = 7
#: What the user of the demo sets.
LIMIT = 0.3
HEALTHY_LOADS = (0.6, 0.75, 0.9, 1.05)
START, STEP = datetime(2026, 1, 5, 8, tzinfo=UTC), timedelta(days=7)


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
    machine, steps = conveyor(folder), Steps(progress, len(HEALTHY_LOADS) + RECORDINGS)
    healthy = [
        conveyor_recording(machine, f"healthy-{load:.2f}", 100 + number, load=load)
        for number, load in enumerate(steps.through(HEALTHY_LOADS))
    ]
    reference = learned(machine, healthy, folder)
    losses = [true_loss(number) for number in range(RECORDINGS)]
    loads = np.random.default_rng(7).uniform(0.7, 1.0, RECORDINGS).tolist()
    history = History(machine=machine.name)
    for number, (load, loss) in enumerate(steps.through(zip(loads, losses, strict=True))):
        crack: dict[str, Any] = {"kind": "crack", "stage": 1, "gear": "pinion", "tooth": TOOTH}
        faults, name = [Fault(**crack, size=loss)] if loss else [], f"week-{number + 1:02d}"
        recording = conveyor_recording(machine, name, number, faults, load=load)
        analysis = analyse(recording, machine, reference)
        history = history.with_entry(entry_of(analysis, START + number * STEP))
    store = folder / "history.db"
    append(store, history.entries, replace=True)  # a second run of the demo is the same history
    found = history_trends(read_history(store, machine.name), limit=LIMIT)
    flagged = _flagged(found)
    first = None if flagged is None else flagged + 1
    facts = {"true_loss": losses, "first_flagged": first, "history": found.to_dict()}
    figure = history_figure(found, losses)
    return told(folder, "growth", figure, _story(found, losses, flagged), facts)


def _flagged(found: HistoryTrends) -> int | None:
    """Return the number of the first recording, from 0, from which on all are flagged."""
    sound = [n for n, entry in enumerate(found.history.entries) if entry.verdict != "fault"]
    first = sound[-1] + 1 if sound else 0
    return first if first < len(found.history.entries) else None


def _story(found: HistoryTrends, losses: Sequence[float], flagged: int | None) -> Iterator[str]:
    """Tell the story."""
    entries = found.history.entries
    since = next(number for number, loss in enumerate(losses) if loss > 0)
    yield f"A crack on tooth {TOOTH} of the pinion, in {len(entries)} recordings a week apart."
    sound = moment_text(entries[since - 1].time_s, fine=False)
    yield (
        f"The truth: sound until {sound}, then a loss of pair stiffness that grows to "
        f"{losses[-1]:.0%}."
    )
    wrong = sum(bool(entry.findings) for entry in entries[:since])
    yield f"Flags in the {since} sound recordings: {wrong}."
    if flagged is None:
        yield "The last recording is not flagged: this crack was not found."
    else:
        entry = entries[flagged]
        yield (
            f"Flagged in every recording since {moment_text(entry.time_s, fine=False)}, at a "
            f"true loss of {losses[flagged]:.1%}: {entry.findings[0]}."
        )
        yield f"The last recording's findings: {'; '.join(entries[-1].findings)}."
    # how the trend of the cracked tooth and the truth agree, if it is listed at all
    for trend in found.shown:
        if (trend.stage, trend.gear, trend.tooth) == (1, "pinion", TOOTH):
            _, low, high = trend.trend.at([entry.time_s for entry in entries])
            inside = sum(a <= loss <= b for a, loss, b in zip(low, losses, high, strict=True))
            yield (
                f"The truth lies within the 90 % interval of the trend in {inside} of "
                f"{len(entries)} recordings."
            )
    yield from ("", *history_lines(found))
