"""What the housing hears of a planetary set: against the integrated motion, and by symmetry."""

import json

import numpy as np
import pytest

import gearmon
from gearmon.cli import main
from gearmon.errors import ArgumentError
from gearmon.gears.kinematics import kinematics
from gearmon.signatures.expected.planetary_set import housing_lines
from gearmon.simulation.train import build_train
from gearmon.simulation.vibration import random_path

RATE_HZ, DURATION_S = 4000.0, 5.0
STILL = dict.fromkeys(("slip", "speed_drift", "load_drift", "torque_ripple", "unbalance"), 0.0)


def planetary(sun, planet, ring, planets=3):
    stage = {"kind": "planetary", "planets": planets, "module_mm": 4.0, "face_width_mm": 50.0}
    teeth = {"sun_teeth": sun, "planet_teeth": planet, "ring_teeth": ring}
    point = {"speed_rpm": 600.0, "torque_nm": 850.0}
    more = {"bore_diameter_planet_mm": 62.0}
    return gearmon.load_machine(operating=point, stage=stage | teeth | more)


def recorded(machine):
    """Peak forces [N] on the housing by mesh harmonic and carrier sideband: a recording of perfect
    gears, divided by the path to the sensor."""
    recording = gearmon.simulate(
        machine,
        duration_s=DURATION_S,
        sampling_rate_hz=RATE_HZ,
        channels=1,
        snr_db=None,
        accuracy_grade=None,
        seed=1,
        **STILL,
    )
    samples = np.asarray(recording.samples)[0]
    path = random_path(1, 1, 1, build_train(machine, accuracy_grade=None).gear_mass_kg)
    mesh, window = kinematics(machine).mesh(1), np.hanning(len(samples))
    found = {}
    for k in range(1, 7):
        for s in (-1, 0, 1):
            hertz = 10.0 * (k * mesh.order + s * float(mesh.carrier))
            turned = np.exp(-2j * np.pi * hertz / RATE_HZ * np.arange(len(samples)))
            line = 2 * samples @ (window * turned) / window.sum()
            found[k, s] = abs(line / path.accelerance(np.array([hertz]), 0, 0)[0])
    return found


@pytest.mark.parametrize("teeth", [(18, 27, 72), (19, 26, 71)], ids=["in phase", "sequential"])
def test_against_a_simulated_recording(teeth):
    machine = planetary(*teeth)
    heard, expected = recorded(machine), housing_lines(machine, 1, harmonics=6)
    assert expected.error_bound < 1e-4
    assert not expected.contact_lost
    assert len(expected.rows) == len(heard)
    for row in expected.rows:
        level = heard[row["mesh_harmonic"], row["sideband"]]
        strongest = max(heard[row["mesh_harmonic"], s] for s in (-1, 0, 1))
        # McFadden and Smith 1985
        assert row["allowed"] == ((row["mesh_harmonic"] * teeth[2] + row["sideband"]) % 3 == 0)
        if row["allowed"]:
            assert abs(20 * np.log10(level / row["force_n"])) < 3
        else:
            assert row["force_n"] == 0
            assert level < 0.03 * strongest


def test_pairs_have_no_planets():
    pair = {"kind": "parallel", "pinion_teeth": 23, "gear_teeth": 57}
    machine = gearmon.load_machine(operating={"speed_rpm": 1500.0}, stage=pair)
    with pytest.raises(ArgumentError, match="stage=1 is not planetary"):
        housing_lines(machine, 1)


def test_baseline_tells_what_the_housing_hears(tmp_path, capsys):
    text = """
    [operating]
    speed_rpm = 1500.0
    torque_nm = 850.0
    [[stage]]
    kind = "planetary"
    sun_teeth = 19
    planet_teeth = 26
    ring_teeth = 71
    planets = 3
    module_mm = 4.0
    face_width_mm = 50.0
    """
    (tmp_path / "machine.toml").write_text(text)
    command = ["baseline", str(tmp_path / "machine.toml"), "--max-hz", "2000", "--json"]
    assert main(command) == 0
    (own,) = json.loads(capsys.readouterr().out)["housing"]
    heard = [(row["mesh_harmonic"], row["sideband"]) for row in own["rows"] if row["allowed"]]
    assert heard[:4] == [(1, 1), (2, -1), (3, 0), (4, 1)]
