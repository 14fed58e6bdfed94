"""A crack on a pinion tooth: what the README promises, on data that it makes itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gearmon.demos import Demo, Steps
from gearmon.demos.conveyor import learned
from gearmon.diagnosis.analysis import analyse
from gearmon.files import write_atomically
from gearmon.machine import load_machine
from gearmon.machine.example import EXAMPLE
from gearmon.report import analysis_text, write_report
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
    write_atomically(folder / "machine.toml", EXAMPLE)
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
