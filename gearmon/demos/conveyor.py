"""The one-stage conveyor drive that demos record, sound or with a weak tooth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from gearmon.demos import given_file
from gearmon.diagnosis.analysis import learn
from gearmon.gears.faults import Fault
from gearmon.machine import Machine, load_machine
from gearmon.signals.recording import Recording, read_recording
from gearmon.signatures.measured.reference import Reference, write_reference
from gearmon.simulation import simulate

#: Length and rate of a recording: short, so that a demo takes less than a minute.
DURATION_S, RATE_HZ = 5.0, 10_240.0


def conveyor(folder: Path) -> Machine:
    """Write the machine file of the drive into a folder and load it."""
    return load_machine(given_file("conveyor.toml", folder, "machine.toml"))


def conveyor_recording(
    machine: Machine, name: str, seed: int, faults: Sequence[Fault | str] = (), **settings: Any
) -> Recording:
    """Simulate two accelerometers and a tachometer of always the same conveyor drive.

    Parameters
    ----------
    machine : Machine
    name : str
        Of the recording.
    seed : int
        Of what differs from recording to recording.
    faults : sequence of Fault or str
    **settings
        Further ones of `simulate`: load, slip, speed_drift, load_drift.
    """
    settings = {"machine_seed": 1, "channels": 2, "tacho_shaft": 1} | settings
    made = simulate(machine, faults, DURATION_S, RATE_HZ, recording_seed=seed, **settings)
    return replace(read_recording(made), origin=name)


def learned(machine: Machine, healthy: Sequence[Recording], folder: Path) -> Reference:
    """Learn from healthy recordings, and keep the reference in the folder."""
    reference = learn(healthy, machine)
    write_reference(reference, folder / "healthy.ref")
    return reference
