"""Recordings made of known lines, analysed once for all tests of the reports."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from gearmon.diagnosis.analysis import analyse, learn
from gearmon.diagnosis.results import Analysis
from gearmon.machine import Machine, OperatingPoint, ParallelStage
from gearmon.signals.recording import Recording
from gearmon.signatures.measured.reference import Reference

RATE_HZ = 4096.0
SPEED_HZ = 19.9
TEETH = (23, 37)


@dataclass(frozen=True, kw_only=True)
class Case:
    """A machine with a reference, and an analysed recording."""

    machine: Machine
    reference: Reference | None
    recording: Recording
    analysis: Analysis


def gear_machine() -> Machine:
    stage = ParallelStage(
        pinion_teeth=TEETH[0], gear_teeth=TEETH[1], module_mm=3.0, face_width_mm=25.0
    )
    point = OperatingPoint(speed_rpm=1200.0, torque_nm=100.0)
    return Machine(name="bench <gearbox> & co", operating=(point,), stages=(stage,))


def made(seed: int, *, burst: float = 0.0, gears: bool = True, tacho: bool = False) -> Recording:
    """Two channels of mesh harmonics with sidebands of both shafts and noise, 8 s."""
    generator = np.random.default_rng(seed)
    turns = SPEED_HZ * np.arange(round(8 * RATE_HZ)) / RATE_HZ
    samples = 0.3 * generator.standard_normal((2, len(turns)))
    own = np.random.default_rng(99)
    for k in range(1, 5 if gears else 1):
        for order in (k * TEETH[0], *_sidebands(k)):
            size = (2.0 if order == k * TEETH[0] else 0.15) / k
            for channel in samples:
                phase, factor = own.uniform(0, 2 * np.pi), own.uniform(0.5, 1.5)
                channel += size * factor * np.cos(2 * np.pi * order * turns + phase)
    # one tooth of the pinion rings once a turn, at a quarter of it
    since = (turns - 0.25) % 1.0
    samples += burst * np.exp(-40 * since) * np.cos(2 * np.pi * 40 * since)
    names, kinds, units = ("front", "rear"), ("vibration",) * 2, ("m/s2", None)
    if tacho:
        samples = np.vstack([samples, np.where(turns % 1.0 < 0.05, 5.0, 0.0)])
        names, kinds, units = (*names, "key"), (*kinds, "tacho"), (*units, "V")
    return Recording(
        samples=samples,
        sampling_rate_hz=RATE_HZ,
        channel_names=names,
        channel_kinds=kinds,
        units=units,
        origin=f"made-{seed}.csv",
    )


def _sidebands(harmonic: int) -> list[float]:
    ratio = TEETH[0] / TEETH[1]
    return [harmonic * TEETH[0] + r * s for r in (-2, -1, 1, 2) for s in (1.0, ratio)]


def _case(recording: Recording, reference: Reference | None) -> Case:
    machine = gear_machine()
    return Case(
        machine=machine,
        reference=reference,
        recording=recording,
        analysis=analyse(recording, machine, reference),
    )


@pytest.fixture(scope="session")
def healthy_reference() -> Reference:
    return learn([made(seed, tacho=True) for seed in (1, 2, 3)], gear_machine())


@pytest.fixture(scope="session")
def faulty(healthy_reference: Reference) -> Case:
    """A burst at one tooth, with a tachometer."""
    return _case(made(7, burst=6.0, tacho=True), healthy_reference)


@pytest.fixture(scope="session")
def healthy(healthy_reference: Reference) -> Case:
    return _case(made(8, tacho=True), healthy_reference)


@pytest.fixture(scope="session")
def alone() -> Case:
    """Without a reference and without a tachometer."""
    return _case(made(9), None)


@pytest.fixture(scope="session")
def gearless() -> Case:
    """Noise only: there is no mesh to find."""
    return _case(made(10, gears=False), None)
