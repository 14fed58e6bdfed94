"""The shipped signatures are what the shipped machine files make."""

from pathlib import Path

import numpy as np
import pytest

from gearmon.gears.kinematics import kinematics
from gearmon.machine import load_machine
from gearmon.signatures.expected import expected_signature
from gearmon.signatures.signature import read_signature

FOLDER = Path(__file__).resolve().parents[1] / "signatures"
MACHINES = sorted(FOLDER.glob("*.toml"))


@pytest.mark.parametrize("path", MACHINES, ids=lambda path: path.stem)
def test_machine_files_load_and_mesh(path):
    machine = load_machine(path)
    assert all(mesh.order > 0 for mesh in kinematics(machine).meshes)


@pytest.mark.parametrize("path", MACHINES, ids=lambda path: path.stem)
def test_every_machine_has_an_expected_signature(path):
    signature = expected_signature(load_machine(path))
    assert len(signature) > 0
    assert np.isfinite(signature["acceleration_ms2"]).all()


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.csv")), ids=lambda path: path.stem)
def test_stored_signature_is_made_again(path):
    # stored output: tells that nothing moved, not that it is right
    stored = read_signature(path)
    made = expected_signature(load_machine(path.with_suffix(".toml")))
    assert made["order"] == pytest.approx(stored["order"])
    assert made["acceleration_ms2"] == pytest.approx(stored["acceleration_ms2"], rel=1e-6)
