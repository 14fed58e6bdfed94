"""A crack on a pinion tooth: what the README promises, on data that it makes itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gearmon.diagnosis.analysis import analyse, learn
from gearmon.diagnosis.results import Analysis
from gearmon.files import write_atomically
from gearmon.gears.faults import parse_fault
from gearmon.machine import Machine, load_machine
from gearmon.machine.example import EXAMPLE
from gearmon.report.html import write_report
from gearmon.report.text import analysis_text
from gearmon.signals.recording import Recording, read_recording
from gearmon.signatures.measured.reference import write_reference
from gearmon.simulation import simulate, write_simulation
from gearmon.terminal import Progress

FAULT = "crack:1:pinion:7:30%"
# Healthy recordings at three loads, then a healthy and a cracked one at loads in between.
HEALTHY_LOADS = (0.6, 0.8, 1.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class CrackDemo:
    """What the demo did.

    Parameters
    ----------
    folder : Path
        Where its files are.
    analyses : tuple of Analysis
        A healthy recording and a damaged one.
    report : Path
        The report.
    """

    folder: Path
    analyses: tuple[Analysis, ...]
    report: Path

    def lines(self) -> list[str]:
        """Tell it on a terminal."""
        told = [text for analysis in self.analyses for text in (analysis_text(analysis), "")]
        return [
            *told,
            f"recordings, machine file and reference: {self.folder}",
            f"report: {self.report}",
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        return {
            "folder": str(self.folder),
            "report": str(self.report),
            "recordings": [analysis.to_dict() for analysis in self.analyses],
        }


def crack_demo(folder: Path, progress: Progress | None = None) -> CrackDemo:
    """Simulate a healthy and a cracked gearbox, learn, analyse both and write the report.

    Parameters
    ----------
    folder : Path
        Where to write; it exists.
    progress : callable, optional
        Called with the share done, 0 to 1.
    """
    machine_file = folder / "machine.toml"
    write_atomically(machine_file, EXAMPLE)
    machine = load_machine(machine_file)
    plan = [(f"healthy-{load:.0%}".replace("%", ""), load, "") for load in HEALTHY_LOADS]
    plan += [("new-healthy", 0.9, ""), ("new-cracked", 0.9, FAULT)]
    recordings = []
    for number, (label, load, fault) in enumerate(plan):
        recordings.append(_recorded(machine, folder / f"{label}.csv", load, fault, number))
        if progress is not None:
            progress((number + 1) / (len(plan) + 1))
    reference = learn(recordings[:3], machine)
    write_reference(reference, folder / "healthy.ref")
    analyses = [analyse(recording, machine, reference) for recording in recordings[3:]]
    report = folder / "report.html"
    write_report(analyses, recordings[3:], reference, machine, report)
    return CrackDemo(folder=folder, analyses=tuple(analyses), report=report)


def _recorded(machine: Machine, path: Path, load: float, fault: str, seed: int) -> Recording:
    """Simulate, write and read back: the demo sees what a user's files would hold."""
    faults: Sequence[Any] = [parse_fault(fault)] if fault else []
    recording = simulate(
        machine,
        faults,
        duration_s=6.0,
        sampling_rate_hz=10_240.0,
        machine_seed=1,
        recording_seed=seed,
        channels=2,
        load=load,
        tacho_shaft=1,
    )
    write_simulation(recording, path)
    return read_recording(path)
