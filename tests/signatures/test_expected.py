import math
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from reference.hill_reference import harmonic_balance
from reference.simulated_machines import planetary

from gearmon.dynamics import HillProblem
from gearmon.errors import ArgumentError
from gearmon.gears.mechanics import stage_mechanics
from gearmon.machine import Machine, OperatingPoint, ParallelStage, PlanetaryStage
from gearmon.signatures.expected import baseline
from gearmon.signatures.expected.baseline import expected_signature
from gearmon.signatures.expected.contact_motion import fourier_sums
from gearmon.signatures.signature import COLUMNS

POINT = OperatingPoint(speed_rpm=1460.0, torque_nm=98.12)
PAIR = ParallelStage(pinion_teeth=26, gear_teeth=53, module_mm=2.0, face_width_mm=20.0)
SMALL = ParallelStage(
    pinion_teeth=9,
    gear_teeth=14,
    contact_ratio=1.4,
    mesh_stiffness_n_per_m=2e8,
    equivalent_mass_kg=0.9,
    damping_ratio=0.1,
    force_n=3000.0,
)
HEADER = (
    "mesh_frequency_hz",
    "mean_stiffness_n_per_m",
    "stiffness_variation",
    "contact_ratio",
    "natural_frequency_hz",
    "damping_ratio",
    "method",
    "order_used",
    "error_bound",
)


def machine(*stages, points=(POINT,)):
    return Machine(name="box", operating=points, stages=stages or (PAIR,))


def stepped_response(mechanics, points_per_mesh, lines):
    """Displacement lines with the stiffness constant over each of many short steps."""
    k = mechanics.stiffness
    count = k.period_mesh * points_per_mesh
    stiffness = k.at((np.arange(count) + 0.5) / points_per_mesh)
    step = mechanics.period_s / count
    m, force = mechanics.equivalent_mass_kg, mechanics.force_n
    h = mechanics.damping_ns_per_m / (2 * m)
    rate = np.sqrt(stiffness / m - h**2)
    fade, even, odd = np.exp(-h * step), np.cos(rate * step), np.sin(rate * step) / rate
    a, b = fade * (even + h * odd), fade * odd
    c, d = -fade * odd * stiffness / m, fade * (even - h * odd)
    still = force / stiffness
    # (z - still, v) moves by [[a, b], [c, d]]; two starts and the force give the periodic motion
    paths = []
    for z, v, push in ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)):
        path = []
        for ai, bi, ci, di, si in zip(*(x.tolist() for x in (a, b, c, d, still)), strict=True):
            path.append(z)
            y = z - push * si
            z, v = push * si + ai * y + bi * v, ci * y + di * v
        paths.append((np.array(path), np.array([z, v])))
    (forced, end), (first, one), (second, two) = paths
    start = np.linalg.solve(np.eye(2) - np.array([one, two]).T, end)
    return np.fft.rfft(forced + start[0] * first + start[1] * second)[: lines + 1] / count


def test_columns_and_header():
    found = expected_signature(machine())
    assert tuple(found.columns) == COLUMNS
    for key in HEADER:
        assert found.header[key] == found.header["stages"][0][key]
    assert found.origin == "expected"
    assert found.header["error_bound"] <= 1e-6
    assert found.header["mesh_frequency_hz"] == pytest.approx(632.6667, abs=1e-4)
    assert found.header["contact_ratio"] == pytest.approx(1.692757, abs=1e-6)
    assert (found["sideband"] == 0).all()
    assert set(found["sideband_of"]) == {""}
    np.testing.assert_allclose(found["order"], 26 * found["mesh_harmonic"])
    np.testing.assert_allclose(found["frequency_hz"], found["order"] * 1460 / 60)
    # by default up to twice the natural frequency
    assert found["frequency_hz"].max() <= 2 * found.header["natural_frequency_hz"]
    assert found["frequency_hz"].max() > 2 * found.header["natural_frequency_hz"] - 633


def test_amplitudes_are_peak_values_of_the_same_motion():
    found = expected_signature(machine(), ["crack:1:pinion:3:10%"])
    w = 2 * math.pi * found["frequency_hz"]
    np.testing.assert_allclose(found["velocity_ms"], w * found["displacement_m"], rtol=1e-12)
    np.testing.assert_allclose(
        found["acceleration_ms2"], w**2 * found["displacement_m"], rtol=1e-12
    )


def test_lines_against_a_matrix_of_thousands_of_harmonics():
    found = expected_signature(machine(), max_hz=8000.0)
    mechanics = stage_mechanics(machine(), 1)
    problem = HillProblem(
        mechanics.equivalent_mass_kg,
        mechanics.damping_ns_per_m,
        mechanics.stiffness.mean_n_per_m,
        mechanics.stiffness.harmonics(600),
        mechanics.period_s,
        mechanics.force_n,
    )
    z = harmonic_balance(problem, 300)[1:13]
    np.testing.assert_allclose(found["displacement_m"], 2 * np.abs(z), rtol=2e-5)
    np.testing.assert_allclose(np.exp(1j * found["phase_rad"]), z / np.abs(z), atol=2e-5)


@pytest.mark.parametrize("faults", [[], ["crack:1:pinion:3:20%"]])
def test_lines_against_exact_steps_in_time(faults):
    box = machine(SMALL)
    found = expected_signature(box, faults, 1e-7, max_hz=2200.0)
    mechanics = stage_mechanics(box, 1, faults=_parsed(faults))
    meshes = mechanics.stiffness.period_mesh
    lines = round(found["frequency_hz"].max() * mechanics.period_s)
    # pairs enter and leave between steps, so the error is of second order: extrapolated
    coarse, fine = (stepped_response(mechanics, n, lines) for n in (200, 400))
    exact = ((4 * fine - coarse) / 3)[1:]
    at = np.round(found["order"] / 9 * meshes).astype(int) - 1
    size = np.abs(exact).max()
    np.testing.assert_allclose(found["displacement_m"], 2 * np.abs(exact[at]), atol=5e-6 * size)


def _parsed(faults):
    from gearmon.gears.faults import parse_fault

    return [parse_fault(fault) for fault in faults]


@pytest.mark.parametrize(("gear", "teeth"), [("pinion", 26), ("gear", 53)])
def test_sidebands_of_a_damaged_tooth(gear, teeth):
    healthy = expected_signature(machine())
    found = expected_signature(machine(), [f"crack:1:{gear}:5:20%"])
    lines = found["mesh_harmonic"] * teeth + found["sideband"]
    np.testing.assert_array_equal(lines, np.arange(1, len(found) + 1))
    assert np.abs(found["sideband"]).max() <= teeth / 2
    assert set(found["sideband_of"][found["sideband"] != 0]) == {gear}
    shaft = 1.0 if gear == "pinion" else 26 / 53
    np.testing.assert_allclose(found["order"], lines * shaft, rtol=1e-12)
    mesh = found["sideband"] == 0
    change = found["acceleration_ms2"][mesh] / healthy["acceleration_ms2"]
    assert 0.5 < np.median(change) < 1.5
    near = (np.abs(found["sideband"]) == 1) & (found["mesh_harmonic"] == 13)
    assert (found["acceleration_ms2"][near] > 1.0).all()
    assert found.header["error_bound"] <= 1e-6


def test_a_vanishing_fault_changes_nothing():
    healthy = expected_signature(machine())
    found = expected_signature(machine(), ["crack:1:pinion:5:0.0001%"])
    mesh = found["sideband"] == 0
    np.testing.assert_allclose(
        found["acceleration_ms2"][mesh], healthy["acceleration_ms2"], rtol=1e-4
    )
    assert found["acceleration_ms2"][~mesh].max() < 1e-4 * healthy["acceleration_ms2"].max()


def test_another_tooth_turns_the_phases():
    # tooth 4 enters three meshes after tooth 1: line n of the turn lags by 3 n / 26 of a cycle
    one = expected_signature(machine(), ["crack:1:pinion:1:10%"], max_hz=5000.0)
    four = expected_signature(machine(), ["crack:1:pinion:4:10%"], max_hz=5000.0)
    lag = np.exp(-2j * math.pi * 3 * one["order"] / 26)
    np.testing.assert_allclose(four["displacement_m"], one["displacement_m"], rtol=1e-5)
    turned = np.exp(1j * one["phase_rad"]) * lag
    np.testing.assert_allclose(np.exp(1j * four["phase_rad"]), turned, atol=1e-4)


def test_lines_of_no_gear_are_as_large_as_the_product_of_both_losses():
    shares = []
    for loss in ("0.1%", "0.2%"):
        both = [f"stiffness:1:{gear}:2:{loss}" for gear in ("pinion", "gear")]
        found = expected_signature(machine(SMALL), both, 1e-6, max_hz=2000.0)
        shares.append(found.header["cross_lines_share"])
    assert shares[1] / shares[0] == pytest.approx(4.0, rel=0.05)


def test_faults_on_both_gears():
    faults = ["crack:1:pinion:2:10%", "crack:1:gear:3:10%"]
    found = expected_signature(
        machine(SMALL), faults, 1e-4, max_hz=2000.0, method="msm least residual"
    )
    assert set(found["sideband_of"]) == {"", "pinion", "gear"}
    assert found.header["period_mesh"] == 9 * 14
    assert 0 < found.header["cross_lines_share"] < 0.3
    for gear, shaft in (("pinion", 1.0), ("gear", 9 / 14)):
        own = found["sideband_of"] == gear
        expected = 9 * found["mesh_harmonic"][own] + shaft * found["sideband"][own]
        np.testing.assert_allclose(found["order"][own], expected, rtol=1e-12)
    alone = expected_signature(machine(SMALL), faults[:1], 1e-4, max_hz=2000.0)
    both = found["acceleration_ms2"][found["sideband_of"] == "pinion"]
    single = alone["acceleration_ms2"][alone["sideband_of"] == "pinion"]
    assert len(both) == len(single)
    assert np.linalg.norm(both - single) < 0.3 * np.linalg.norm(single)


def test_no_line_above_the_frequency_asked_for():
    found = expected_signature(machine(), ["crack:1:gear:1:5%"], max_hz=1000.0)
    assert found["frequency_hz"].max() <= 1000.0
    assert found["frequency_hz"].max() > 1000.0 - 13
    whole = expected_signature(machine(), ["crack:1:gear:1:5%"])
    share = whole["frequency_hz"] <= 1000.0
    np.testing.assert_allclose(found["displacement_m"], whole["displacement_m"][share], rtol=1e-4)


@pytest.mark.parametrize("loose", [1e-2, 1e-4])
def test_error_bound_covers_the_stiffness_that_was_left_out(loose):
    fine = expected_signature(machine(), ["crack:1:pinion:5:20%"], 1e-7)
    coarse = expected_signature(machine(), ["crack:1:pinion:5:20%"], loose)
    lines = [s["acceleration_ms2"] * np.exp(1j * s["phase_rad"]) for s in (fine, coarse)]
    error = np.linalg.norm(lines[1] - lines[0]) / np.linalg.norm(lines[0])
    assert error <= coarse.header["error_bound"] <= loose


def test_stages_and_operating_points():
    points = (
        OperatingPoint(speed_rpm=1460.0, torque_nm=98.12, share=0.5),
        OperatingPoint(speed_rpm=730.0, torque_nm=50.0, share=0.5, name="half"),
    )
    box = machine(PAIR, SMALL, points=points)
    found = expected_signature(box, ["spall:2:gear:1:10%"], operating=1)
    assert [stage["stage"] for stage in found.header["stages"]] == [1, 2]
    assert found.header["operating"] == "half"
    assert found.header["mesh_frequency_hz"] == pytest.approx(632.6667 / 2, abs=1e-4)
    second = found["stage"] == 2
    assert set(found["sideband_of"][second]) == {"", "gear"}
    assert set(found["sideband_of"][~second]) == {""}
    shaft = 26 / 53
    mesh = second & (found["sideband"] == 0)
    np.testing.assert_allclose(found["order"][mesh], 9 * shaft * found["mesh_harmonic"][mesh])


def test_planetary_stages_show_one_of_their_meshes():
    stage = PlanetaryStage(
        sun_teeth=20, planet_teeth=40, ring_teeth=100, planets=4, module_mm=2.0, face_width_mm=25.0
    )
    found = expected_signature(machine(stage), max_hz=5000.0)
    assert found.header["mesh"] == "sun-planet"
    np.testing.assert_allclose(found["order"], found["mesh_harmonic"] * 100 / 6, rtol=1e-12)


def test_gears_of_both_meshes_of_a_set_are_wrong_at_once():
    stage = PlanetaryStage(
        sun_teeth=20, planet_teeth=40, ring_teeth=100, planets=4, module_mm=2.0, face_width_mm=25.0
    )
    faults = ["wear:1:ring:all:5%", "pitch:1:sun:1:10um"]
    found = expected_signature(machine(stage), faults, 1e-2, max_hz=2000.0)
    assert set(found["sideband_of"]) <= {"", "sun", "carrier"}
    assert not any("does not act" in words for words in found.header["stages"][0]["warnings"])
    worn = expected_signature(machine(stage), faults[:1], 1e-2, max_hz=2000.0)
    sound = expected_signature(machine(stage), [], 1e-2, max_hz=2000.0)
    assert set(worn["sideband_of"]) == set(sound["sideband_of"]) == {""}
    assert not np.allclose(worn["acceleration_ms2"], sound["acceleration_ms2"], rtol=1e-3)


def test_lines_of_teeth_of_all_gears_of_a_set_that_stand_out_add_up():
    """What moves the flanks is a force on a linear system."""
    stage = PlanetaryStage(
        sun_teeth=18, planet_teeth=27, ring_teeth=72, planets=3, module_mm=4.0, face_width_mm=50.0
    )
    errors = [f"pitch:1:{gear}:2:5um" for gear in ("sun", "planet", "ring")]
    lines = []
    for given in ([], *([own] for own in errors), errors):
        found = expected_signature(machine(stage), given, max_hz=2000.0)
        # what is of several gears together would be "?"
        assert set(found["sideband_of"]) <= {"", "carrier", *(own.split(":")[2] for own in given)}
        moved = found["acceleration_ms2"] * np.exp(1j * found["phase_rad"])
        lines.append(pd.Series(moved, index=np.round(found["order"], 9)))
    none, *single, together = (own.reindex(lines[-1].index, fill_value=0.0) for own in lines)
    alone = sum(own - none for own in single)
    assert all(abs(own - none).max() > 0 for own in single)
    assert abs(together - none - alone).max() < 1e-4 * abs(alone).max()


def test_plain_expansion_to_second_order_reports_its_error():
    plain = expected_signature(machine(), method="msm", order=2)
    exact = expected_signature(machine())
    lines = [s["acceleration_ms2"] * np.exp(1j * s["phase_rad"]) for s in (plain, exact)]
    error = np.linalg.norm(lines[0] - lines[1]) / np.linalg.norm(lines[1])
    assert plain.header["order_used"] == 2
    assert plain.header["method"] == "msm"
    assert error <= plain.header["error_bound"] < 3 * error + 1e-3
    (told,) = (words for words in plain.header["warnings"] if "misses the tolerance" in words)
    assert told.startswith("error bound ")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"operating": 1}, "operating=1 must lie in"),
        ({"max_hz": 0.0}, "max_hz=0.0 Hz must be > 0"),
        ({"max_hz": 1e9}, r"max_hz=1e\+09 Hz must lie in|max_hz=1000000000.0 Hz must lie in"),
        ({"max_hz": 100.0}, "below the lowest mesh frequency"),
        ({"tolerance": 2.0}, "tolerance=2.0 must lie in"),
        ({"faults": ["crack:3:pinion:1:5%"]}, "stage 3 does not exist"),
        ({"faults": ["crack:1:pinion:27:5%"]}, "26|27"),
    ],
)
def test_bad_arguments_are_refused(arguments, words):
    with pytest.raises(ArgumentError, match=words):
        expected_signature(machine(), **arguments)


def test_nothing_heavy_is_imported():
    code = (
        "import sys, gearmon.signatures.expected.fault_family;"
        "heavy = ('pandas', 'matplotlib', 'pyarrow', 'rich');"
        "print([module for module in heavy if module in sys.modules])"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "[]"


def test_contact_is_lost_at_the_same_mesh_phase_whatever_the_period():
    # a fault of next to nothing makes a period of a turn of its gear out of one of the mesh
    light = replace(SMALL, damping_ratio=0.05)
    point = OperatingPoint(speed_rpm=60 * 0.9 * 2372.0 / 9, torque_nm=50.0)
    phases = []
    for faults in ([], ["crack:1:pinion:1:0.0001%"]):
        found = expected_signature(machine(light, points=(point,)), faults, 1e-4)
        (warning,) = (w for w in found.header["warnings"] if "lose contact" in w)
        phases.append(float(warning.split("mesh phase ")[1].split(":")[0]))
    assert phases[1] % 1.0 == pytest.approx(phases[0], abs=2e-3)


def test_an_unstable_mesh_is_told_as_such_and_not_as_inexact():
    wild = replace(PAIR, damping_ratio=0.01, stiffness_variation=0.6)
    point = OperatingPoint(speed_rpm=40_000.0, torque_nm=98.12)
    found = expected_signature(machine(wild, points=(point,)), max_hz=30e3)
    (warning,) = (own for own in found.header["warnings"] if "free vibrations grow" in own)
    assert warning.startswith("unstable")
    assert found.header["stable"] is False
    assert not any("misses the tolerance" in own for own in found.header["warnings"])


@pytest.mark.parametrize(("gear", "mesh"), [("ring", "planet-ring"), ("sun", "sun-planet")])
def test_an_error_of_a_set_acts_in_the_mesh_of_its_gear(gear, mesh):
    """An error all through the turn has its mesh taken by itself: of the ring that of the ring."""
    found = expected_signature(planetary(), [f"eccentricity:1:{gear}:all:20um"], max_hz=1500.0)
    assert found.header["stages"][0]["mesh"] == mesh
    assert gear in set(found["sideband_of"])
    assert not any("does not act" in own for own in found.header["stages"][0]["warnings"])


@pytest.mark.parametrize("highest", [1, 37, 400])
def test_lines_at_uneven_places_are_the_direct_sums(highest):
    rng = np.random.default_rng(1)
    turns, values = rng.uniform(size=(20, 16)), rng.normal(size=(3, 20, 16))
    waves = np.exp(-2j * np.pi * np.arange(1, highest + 1)[:, None, None] * turns)
    direct = np.einsum("cpi,rpi->cr", values, waves)
    found = fourier_sums(turns, values, highest)
    np.testing.assert_allclose(found, direct, atol=1e-12 * np.abs(values).sum())


def test_stiffness_and_deviations_of_a_planet_lead_alike(monkeypatch):
    """A pair brings both along: where they are the same curve they stay the same."""
    monkeypatch.setattr(baseline, "PeriodicMotion", lambda **parts: SimpleNamespace(**parts))
    curve = SimpleNamespace(at=lambda phase: np.cos(2 * np.pi * phase + 0.3))
    leads = np.random.default_rng(0).uniform(0, 1, 4)
    members = [SimpleNamespace(stiffness=curve, excitation=curve, lead=lead) for lead in leads]
    mechanics = SimpleNamespace(mesh_frequency_hz=50.0)
    posed = SimpleNamespace(members=members, mechanics=mechanics, modes=None)
    grid = SimpleNamespace(phase=np.random.default_rng(1).uniform(0, 1, (5, 6)))
    found = baseline.periodic_motion(posed, grid)
    assert found.period_s == 0.02
    np.testing.assert_array_equal(found.excitation, found.stiffness)
    assert np.ptp(found.stiffness, axis=1).max() > 0.1
