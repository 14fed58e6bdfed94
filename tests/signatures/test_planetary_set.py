"""What the housing hears of a planetary set: against simulation, steps in time, and symmetry."""

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

import gearmon
from gearmon.gears.assembly import drive_train
from gearmon.gears.kinematics import kinematics
from gearmon.signatures.expected.mesh import MeshPlace
from gearmon.signatures.measured.line_plan import line_plan
from gearmon.signatures.tracking import mesh_combs
from gearmon.simulation.train import build_train
from gearmon.simulation.vibration import random_path

FOLDER = Path(__file__).resolve().parents[2] / "signatures"
RATE_HZ, DURATION_S = 4000.0, 5.0
STILL = dict.fromkeys(("slip", "speed_drift", "load_drift", "torque_ripple", "unbalance"), 0.0)


def planetary(sun, planet, ring, planets=3):
    stage = {"kind": "planetary", "planets": planets, "module_mm": 4.0, "face_width_mm": 50.0}
    teeth = {"sun_teeth": sun, "planet_teeth": planet, "ring_teeth": ring}
    point = {"speed_rpm": 600.0, "torque_nm": 850.0}
    more = {"bore_diameter_planet_mm": 62.0}
    return gearmon.load_machine(operating=point, stage=stage | teeth | more)


def recorded(machine, hertz, fault=(), stage=1):
    """Peak forces [N] on the housing: a recording of perfect gears over the path to the sensor."""
    recording = gearmon.simulate(
        machine,
        faults=fault,
        duration_s=DURATION_S,
        sampling_rate_hz=RATE_HZ,
        channels=1,
        snr_db=None,
        accuracy_grade=None,
        seed=1,
        **STILL,
    )
    samples = np.asarray(recording.samples)[0]
    mass = build_train(machine, accuracy_grade=None).gear_mass_kg
    path = random_path(1, 1, len(machine.stages), mass)
    window, time = np.hanning(len(samples)), np.arange(len(samples)) / RATE_HZ
    turned = np.array([np.exp(-2j * np.pi * one * time) for one in hertz])
    lines = 2 * turned @ (window * samples) / window.sum()
    return np.abs(lines / path.accelerance(hertz, 0, stage - 1))


def expected(machine, fault=(), **kw):
    found = gearmon.expected_signature(machine, fault, **kw)
    return found, found["acceleration_ms2"] * found.header["stages"][0]["equivalent_mass_kg"]


IN_PHASE, SEQUENTIAL = (18, 27, 72), (19, 26, 71)


@pytest.mark.parametrize(
    ("teeth", "gear", "fault"),
    [
        (IN_PHASE, "", ()),
        (SEQUENTIAL, "", ()),
        (SEQUENTIAL, "sun", ("crack:1:sun:5:20%",)),
        (IN_PHASE, "planet", ("breakage:1:planet:2:20%",)),
        (IN_PHASE, "ring", ("crack:1:ring:7:20%",)),
    ],
)
def test_against_a_simulated_recording(teeth, gear, fault):
    machine = planetary(*teeth)
    found, force = expected(machine, fault, max_hz=950.0)
    assert not found.header["contact_lost"]
    names, hertz = found["sideband_of"], found["frequency_hz"]
    strong = np.isin(names, ["", "carrier"])
    # in phase the sensor hears the planets' forces cancel but for their mesh harmonics
    strong &= force > 0.02 * force.max()
    if fault:
        strong |= (names == gear) & (force > 0.1 * force[names == gear].max()) & (hertz > 20)
    apart = 20 * np.log10(recorded(machine, hertz[strong], fault) / force[strong])
    assert np.abs(apart).max() < 3
    if fault:
        # what a tooth adds is mostly load that it sheds, whatever yields around
        own = apart[(names[strong] == gear) & (hertz[strong] < 500)]
        assert len(own) > 5
        assert np.abs(own).max() < 0.3
    else:
        assert found["mesh_harmonic"].tolist() == [1, 2, 3, 4, 5, 6]
        # McFadden and Smith 1985: what equal planets leave
        assert ((found["mesh_harmonic"] * teeth[2] + found["sideband"]) % 3 == 0).all()


def test_the_final_drive_of_the_catalogue_sounds_as_expected(monkeypatch):
    # the sensor hears the set alone: its motion also loads the other stage
    def of_the_set(*drawn):
        path = random_path(*drawn)
        return replace(path, stage_shapes=path.stage_shapes * [[0.0], [1.0]])

    monkeypatch.setattr("gearmon.simulation.vibration.random_path", of_the_set)
    machine = gearmon.load_machine(FOLDER / "planetary_final_drive.toml")
    found = gearmon.expected_signature(machine)
    kept = (found["stage"] == 2) & (found["mesh_harmonic"] <= 6)
    hertz = found["frequency_hz"][kept]
    force = found["acceleration_ms2"][kept] * found.header["stages"][1]["equivalent_mass_kg"]
    assert sorted(set(found["mesh_harmonic"][kept].tolist())) == [1, 2, 3, 4, 5, 6]
    # what equal planets suppress is not there: other turns of the carrier, less those of stage 1
    orders = kinematics(machine)
    carrier = float(orders.mesh(2).carrier)
    places = np.round(found["order"][kept] / carrier).astype(int)
    suppressed = np.setdiff1d(np.arange(places.min(), places.max()), places)
    apart = np.abs(suppressed - orders.mesh(1).order / carrier)
    others = suppressed[apart > 1.5] * carrier * machine.operating[0].shaft1_hz
    heard, silent = np.split(recorded(machine, np.append(hertz, others), stage=2), [len(hertz)])
    strong = force > 0.01 * force.max()
    assert np.abs(20 * np.log10(heard[strong] / force[strong])).max() < 1
    assert silent.max() < 0.01 * force.max()


@cache
def of_a_final_drive():
    """A machine, its planets on rigid pins, and a recording of it without noise."""
    machine = gearmon.load_machine(FOLDER / "planetary_final_drive.toml")
    machine = replace(machine, bearings=())
    return machine, gearmon.simulate(
        machine,
        machine_seed=3,
        recording_seed=201,
        load=0.85,
        channels=2,
        snr_db=None,
    )


@pytest.mark.parametrize("snr_db", [20.0, 60.0])
def test_a_final_drive_is_heard_where_its_housing_rings(snr_db):
    """Nearly all power stands about one mode at 2 to 3 kHz: at mesh harmonics 40 to 60.

    Where noise is low, pitch errors show lines as clear as the first of the mesh between these.
    """
    machine, recording = of_a_final_drive()
    samples = np.asarray(recording.samples)
    size = 10 ** (-snr_db / 20) * samples.std(axis=1, keepdims=True)
    noise = size * np.random.default_rng(201).normal(size=samples.shape)
    vibration = gearmon.read_recording(
        samples + noise, sampling_rate_hz=recording.sampling_rate_hz, unit="m/s2"
    )
    heard = gearmon.measure_signature(vibration, machine)
    assert heard.found
    assert heard.meshes[1].score > 5.0


def stepped(machine, fault, gear_teeth, highest, steps):
    """Lines of the forces of each planet, in steps of constant stiffness from drive train alone."""
    train, posed = drive_train(machine), MeshPlace(machine, 1).posed(fault)
    squares, shapes = train.modes
    shapes = shapes[:, squares > 0]
    meshes, mesh_hz = train.meshes(1), posed.mechanics.mesh_frequency_hz
    vectors = np.array([own.rows[0] for own in meshes]) @ shapes
    phase = (np.arange(gear_teeth * steps) + 0.5) / steps
    stiffness = np.array([own.stiffness.at(phase + own.lead) for own in posed.members])
    means = np.array([own.stiffness[0, 0] for own in meshes])
    n, h = len(shapes.T), 1 / (steps * mesh_hz)
    rest = np.diag(squares[squares > 0]) - vectors.T @ (means[:, None] * vectors)
    matrix = np.zeros((len(phase), 2 * n + 1, 2 * n + 1))
    matrix[:, :n, n:-1] = np.eye(n)
    matrix[:, n:-1, :n] = -rest - np.einsum("mt,ma,mb->tab", stiffness, vectors, vectors)
    matrix[:, n:-1, n:-1] = -shapes.T @ train.damping @ shapes
    load = np.zeros(len(train.mass))
    rigid = train.modes[1][:, 0]
    load[0], load[1] = 850.0, -850.0 * rigid[0] / rigid[1]
    matrix[:, n:-1, -1] = shapes.T @ load
    maps = expm(matrix * h)
    total = np.eye(2 * n + 1)
    for own in maps:
        total = own @ total
    start = np.linalg.solve(np.eye(2 * n) - total[:-1, :-1], total[:-1, -1])
    states = [np.append(start, 1.0)]
    for own in maps:
        states.append(own @ states[-1])
    states = np.array(states)
    middle = 0.5 * (states[1:] + states[:-1])
    dampers = np.array([own.damping_ns_per_m for own in meshes])
    force = stiffness.T * (middle[:, :n] @ vectors.T) + dampers * (middle[:, n:-1] @ vectors.T)
    lines = np.fft.rfft(force, axis=0, norm="forward")[1 : highest + 1].T
    late = np.exp(-1j * np.pi * np.arange(1, highest + 1) / len(phase))
    return (lines * late).reshape(2, -1, highest).sum(axis=0)


@pytest.mark.parametrize(
    ("fault", "teeth"), [("crack:1:sun:3:30%", 18), ("breakage:1:planet:2:30%", 27)]
)
def test_against_steps_in_time(fault, teeth):
    machine = planetary(18, 27, 72)
    highest = 3 * teeth
    coarse, fine = (stepped(machine, [fault], teeth, highest, n) for n in (200, 400))
    forces = (4 * fine - coarse) / 3
    found, force = expected(machine, [fault], max_hz=3.0001 * 144.0)
    assert found.header["stages"][0]["error_estimate"] < 1e-6
    psi = 2 * math.pi * np.arange(3) / 3
    sides = {s: (0.2 if s else 0.6) * np.exp(1j * s * psi) @ forces for s in (-1, 0, 1)}
    places = []
    for row in found.rows():
        whole = row["sideband_of"] in ("", "carrier")
        carrier = row["sideband"] if whole else int(row["carrier"])
        places.append((carrier, row["mesh_harmonic"] * teeth + (0 if whole else row["sideband"])))
    chosen = [i for i, (_, line) in enumerate(places) if 0 < line <= highest]
    slow = np.array([2 * abs(sides[places[i][0]][places[i][1] - 1]) for i in chosen])
    assert len(slow) > 50
    # the corners of the stiffness lie inside the steps
    assert np.linalg.norm(slow - force[chosen]) < 5e-3 * np.linalg.norm(slow)


def test_a_tooth_later_is_a_mesh_period_later():
    machine = planetary(19, 26, 71)
    response = gearmon.loss_response(machine, 1, "sun", max_order=40.0, loss=0.2)
    assert set(response.carrier) == {-1, 0, 1}
    mesh, carrier = (float(x) for x in (kinematics(machine).mesh(1).order, 19 / 90))
    np.testing.assert_allclose(
        response.order, response.number * mesh / 19 + response.carrier * carrier
    )
    fourth = response.acceleration * np.exp(-2j * np.pi * 3 * response.number / response.teeth)
    lines = response.mesh_acceleration + response.loss * fourth
    found, _ = expected(machine, ["crack:1:sun:4:20%"], max_hz=400.0)
    by_order = dict(zip(np.round(response.order, 6), 2 * np.abs(lines), strict=True))
    for order, level in zip(found["order"], found["acceleration_ms2"], strict=True):
        assert by_order[round(order, 6)] == pytest.approx(level, rel=1e-3, abs=1e-3)


def test_sets_that_the_file_says_too_little_of_are_one_mesh():
    stage = {"kind": "planetary", "sun_teeth": 18, "planet_teeth": 27, "ring_teeth": 72}
    known = {"planets": 3, "contact_ratio": 1.5, "mesh_stiffness_n_per_m": 8e8, "force_n": 4e3}
    machine = gearmon.load_machine(
        operating={"speed_rpm": 600.0}, stage=stage | known | {"equivalent_mass_kg": 0.3}
    )
    found = gearmon.expected_signature(machine, max_hz=500.0)
    assert any("mesh is taken by itself" in word for word in found.header["stages"][0]["warnings"])


def test_pairs_have_no_planets():
    pair = {"kind": "parallel", "pinion_teeth": 23, "gear_teeth": 57}
    pair |= {"module_mm": 2.0, "face_width_mm": 20.0}
    point = {"speed_rpm": 1500.0, "torque_nm": 50.0}
    posed = MeshPlace(gearmon.load_machine(operating=point, stage=pair), 1, mesh=1).posed()
    assert posed.train is None
    assert posed.note == ""


def test_damage_of_a_worn_gear_is_added_to_what_its_wear_does():
    machine = planetary(*IN_PHASE)
    worn, both = (
        expected(machine, ["wear:1:planet:all:10%", *crack], max_hz=950.0)
        for crack in ([], ["crack:1:planet:2:0.0001%"])
    )
    force = dict(zip(np.round(worn[0]["order"], 6), worn[1], strict=True))
    for order, own in zip(np.round(both[0]["order"], 6), both[1], strict=True):
        assert own == pytest.approx(force.get(order, 0.0), abs=1e-4 * worn[1].max())


def test_modes_that_its_meshes_do_not_feel_are_left_out(monkeypatch):
    # a slow set behind two small stages, whose own meshes swing up to 15 kHz
    first = {"kind": "parallel", "pinion_teeth": 24, "gear_teeth": 58, "module_mm": 1.5}
    second = {"kind": "parallel", "pinion_teeth": 32, "gear_teeth": 90, "module_mm": 1.0}
    last = {"kind": "planetary", "sun_teeth": 19, "planet_teeth": 13, "ring_teeth": 45}
    last |= {"planets": 4, "module_mm": 8.0, "fixed": "sun", "driving": "carrier"}
    last |= {"helix_angle_deg": 34.0}
    widths = (9.0, 11.0, 90.0)
    stages = [s | {"face_width_mm": w} for s, w in zip((first, second, last), widths, strict=True)]
    point = {"speed_rpm": 900.0, "torque_nm": 14.0}
    machine = gearmon.load_machine(operating=point, stage=stages)
    crack = ("crack:3:sun:4:20%",)

    def found():
        posed = MeshPlace(machine, 3).posed(crack)
        return posed.modes.fastest_hz, len(posed.modes.inputs), expected(machine, crack)[0]

    fastest, size, lines = found()
    monkeypatch.setattr("gearmon.gears.mechanics.UNFELT", 0.0)
    whole_fastest, whole_size, whole = found()
    assert fastest < 0.5 * whole_fastest
    assert size == whole_size - 2
    loud = [table["acceleration_ms2"] > 1e-9 for table in (lines, whole)]
    for name, most in (("frequency_hz", 1e-12), ("acceleration_ms2", 2e-8)):
        one, other = (t[name][own] for t, own in zip((lines, whole), loud, strict=True))
        assert len(one) == len(other) > 100
        assert np.abs(one - other).max() < most * np.abs(other).max()


@pytest.mark.parametrize(
    ("fixed", "driving", "turns"),
    # Willis: z_s/(z_s + z_r) of the sun, z_r/(z_s + z_r) of the ring
    [("ring", "sun", 20 / 120), ("sun", "ring", 100 / 120), ("ring", "carrier", 1.0)],
)
def test_sidebands_stand_one_carrier_turn_apart_whichever_way_the_carrier_turns(
    fixed, driving, turns
):
    """Tooth contacts on the ring run with the carrier or against it; spacings have no sign."""
    machine = planetary(20, 40, 100)
    stage = replace(machine.stages[0], fixed=fixed, driving=driving)
    train = kinematics(replace(machine, stages=(stage,)))
    (mesh,) = train.meshes
    (comb,) = mesh_combs(train, 30.0)
    assert (mesh.carrier > 0) == (fixed == "ring")
    assert comb.spacings == pytest.approx((turns,))
    plan = line_plan(train, 300.0, 0.01, 30.0)
    # a carrier turn below and above the multiples of every gear that turns
    assert max(len(own.beside) for own in plan.wheels) == 2
