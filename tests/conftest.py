"""What all tests share: one thread for linear algebra, a repeatable hypothesis, simulations."""

from __future__ import annotations

import os

# must stand before the first import of NumPy: its libraries read these once
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["OMP_NUM_THREADS"] = "1"

from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from reference.simulated_machines import planetary, two_stages

from gearmon.simulation import SimulatedRecording, simulate

settings.register_profile(
    "gearmon", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("gearmon")

# Real recordings are no part of the project; where they lie beside it they are tested as well.
_RECORDINGS = Path(__file__).resolve().parents[1] / ".." / "shared" / "recordings"


@pytest.fixture(scope="session")
def recordings_folder() -> Path:
    """Folder of real recordings; the test is skipped where there is none."""
    if not (_RECORDINGS / "metadata.csv").is_file():
        pytest.skip("no real recordings beside the checkout")
    return _RECORDINGS


@pytest.fixture(scope="session")
def two_stage_recording() -> SimulatedRecording:
    """Two healthy stages, 0.5 % wander, 20 dB noise; two accelerometers, a tacho on shaft 1."""
    return simulate(
        two_stages(), (), 8.0, 8000.0, seed=2, channels=2, speed_drift=0.005, tacho_shaft=1
    )


@pytest.fixture(scope="session")
def planetary_recording() -> SimulatedRecording:
    """A healthy planetary set with three planets that do not divide the ring's teeth."""
    return simulate(planetary(), (), 4.0, 8000.0, seed=3, channels=2)
