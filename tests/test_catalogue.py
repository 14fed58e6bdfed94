"""The shipped signatures are what the shipped machine files make."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from gearmon.errors import ArgumentError
from gearmon.gears.kinematics import kinematics
from gearmon.machine import load_machine
from gearmon.signatures.expected.fault_family import FAMILY_KINDS
from gearmon.signatures.signature import read_signature

FOLDER = Path(__file__).resolve().parents[1] / "signatures"
SPEC = importlib.util.spec_from_file_location("make_tables", FOLDER / "make_tables.py")
MAKER = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(MAKER)
MACHINES = MAKER.machine_files(FOLDER)
EXACT = ("stage", "mesh_harmonic", "sideband", "sideband_of")


def values(signature):
    return signature["acceleration_ms2"] * np.exp(1j * signature["phase_rad"])


@pytest.mark.parametrize("path", MACHINES, ids=lambda path: path.stem)
def test_machine_files_load_and_mesh(path):
    machine = load_machine(path)
    assert all(mesh.order > 0 for mesh in kinematics(machine).meshes)


@pytest.mark.parametrize("path", MACHINES, ids=lambda path: path.stem)
def test_healthy_table_is_made_again(path):
    # stored output: tells that nothing moved, not that it is right
    stored = read_signature(path.with_suffix(".csv"))
    made = MAKER.healthy_table(load_machine(path))
    for name in EXACT:
        assert (made[name] == stored[name]).all()
    assert made["order"] == pytest.approx(stored["order"])
    # both meet the tolerance of 1e-6 of all lines of a stage together
    allowed = 3e-6 * np.linalg.norm(values(stored))
    assert np.linalg.norm(values(made) - values(stored)) < allowed


@pytest.mark.parametrize("path", MACHINES, ids=lambda path: path.stem)
def test_family_table_is_made_again(path):
    stored = read_signature(path.with_name(f"{path.stem}{MAKER.FAMILY_SUFFIX}.csv"))
    # whole planetary sets take a second a member: of them two kinds must do
    kinds = ("crack", "eccentricity") if "planetary" in path.stem else FAMILY_KINDS
    made = MAKER.family_table(load_machine(path), kinds)
    kept = np.isin(stored["kind"], [*kinds, "healthy"])
    stored = {name: column[kept] for name, column in stored.columns.items()}
    for name in (*EXACT, "kind", "gear", "size", "operating"):
        assert (made[name] == stored[name]).all()
    assert made["loss"] == pytest.approx(stored["loss"], rel=1e-4, abs=1e-9)
    # six digits are stored; weak lines are known as well as the strong ones of their family
    difference = abs(values(made) - values(stored))
    allowed = 1e-4 * abs(values(stored)) + 3e-6 * abs(values(stored)).max()
    assert (difference < allowed).all()
    assert stored["mesh_harmonic"].max() == MAKER.MESH_HARMONICS
    assert abs(stored["sideband"]).max() == MAKER.SIDEBANDS


def test_families_hold_every_kind_gear_and_operating_point():
    for path in MACHINES:
        machine = load_machine(path)
        stored = read_signature(path.with_name(f"{path.stem}{MAKER.FAMILY_SUFFIX}.csv"))
        places = set(
            zip(
                stored["kind"].tolist(),
                stored["stage"].tolist(),
                stored["gear"].tolist(),
                stored["operating"].tolist(),
                strict=True,
            )
        )
        damaged = {place for place in places if place[0] != "healthy"}
        gears = sum(len(mesh.wheels) for mesh in kinematics(machine).meshes)
        assert len(damaged) == len(FAMILY_KINDS) * gears * len(machine.operating)


def test_the_catalogue_stays_small():
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) < 2_000_000


def test_the_catalogue_is_written_beside_its_machine_files(tmp_path):
    source = FOLDER / "reference_pair.toml"
    (tmp_path / "mine.toml").write_text(source.read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "other.toml").write_text(source.read_text(encoding="utf-8"), encoding="utf-8")
    written = MAKER.write_catalogue(tmp_path, ["mine"])
    assert sorted(path.name for path in written) == ["mine-family.csv", "mine.csv"]
    stored = read_signature(FOLDER / "reference_pair-family.csv")
    assert read_signature(tmp_path / "mine-family.csv")["size"].tolist() == stored["size"].tolist()
    with pytest.raises(ArgumentError, match="holds no machine files"):
        MAKER.write_catalogue(tmp_path / "nowhere")


def test_rounding_keeps_six_digits():
    table = read_signature(FOLDER / "reference_pair.csv")
    short = MAKER.rounded(table)
    assert short["acceleration_ms2"] == pytest.approx(table["acceleration_ms2"], rel=5e-6)
    assert (MAKER.rounded(short)["phase_rad"] == short["phase_rad"]).all()
