"""Measured signatures of real recordings, where these lie beside the checkout."""

from __future__ import annotations

import csv

import pytest

from gearmon.machine import Machine, OperatingPoint, ParallelStage, PlanetaryStage
from gearmon.signals.recording import read_recording
from gearmon.signatures.measured.measurement import measure_signature


def one_pair(pinion, gear):
    stage = ParallelStage(pinion_teeth=pinion, gear_teeth=gear)
    return Machine(name="pair", operating=(OperatingPoint(speed_rpm=1800.0),), stages=(stage,))


GFD_RATE = 51200 / 12
GFD = Machine(
    name="two stages",
    operating=(OperatingPoint(speed_rpm=1800.0),),
    stages=(
        ParallelStage(pinion_teeth=32, gear_teeth=96),
        ParallelStage(pinion_teeth=32, gear_teeth=80),
    ),
)
SEU = Machine(
    name="planetary",
    operating=(OperatingPoint(speed_rpm=1800.0),),
    stages=(PlanetaryStage(sun_teeth=20, planet_teeth=40, ring_teeth=100, planets=4),),
)
GFD_FILES = [f"gfd/{state}30hz{load}.csv" for state in "hb" for load in (0, 20, 40, 60, 80)]
SEU_FILES = [f"seu/{state}_30_2_1.5s.csv" for state in ("Health", "Chipped", "Miss")]


def described(folder, name):
    with (folder / "metadata.csv").open(newline="") as table:
        return next(row for row in csv.DictReader(table) if row["file"] == name)


@pytest.mark.parametrize("name", GFD_FILES)
def test_speed_and_meshes_of_a_parallel_gearbox(recordings_folder, name):
    known = described(recordings_folder, name)
    recording = read_recording(recordings_folder / name, sampling_rate_hz=GFD_RATE)
    measured = measure_signature(recording, GFD)
    speed = float(known["shaft1_measured_hz"])
    assert measured.speed.estimated_hz == pytest.approx(speed, rel=1e-3)
    for mesh, frequency in zip(measured.meshes, known["mesh_hz"].split(";"), strict=True):
        assert mesh.found
        assert mesh.frequency_hz == pytest.approx(float(frequency), abs=0.3)


@pytest.mark.parametrize("name", SEU_FILES)
def test_mesh_of_a_planetary_gearbox(recordings_folder, name):
    recording = read_recording(recordings_folder / name, sampling_rate_hz=5120.0, channels=2)
    (mesh,) = measure_signature(recording, SEU).meshes
    assert mesh.found
    assert mesh.frequency_hz == pytest.approx(499.2, abs=0.3)


@pytest.mark.parametrize(
    ("name", "teeth"),
    [
        ("cwru/normal_0.csv", (32, 96)),
        ("cwru/normal_0.csv", (23, 61)),
        ("cwru/normal_0.csv", (17, 43)),
        ("cwru/IR007_0.csv", (17, 43)),
        ("cwru/IR007_0.csv", (26, 53)),
    ],
)
def test_rig_without_gears_has_no_mesh(recordings_folder, name, teeth):
    recording = read_recording(recordings_folder / name, sampling_rate_hz=12_000.0)
    measured = measure_signature(recording, one_pair(*teeth))
    assert not measured.found
