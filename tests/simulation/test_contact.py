"""Contact over time: pairs, damage, runout; and the steady state against harmonic balance."""

from __future__ import annotations

import math

import numpy as np
import pytest
from reference.dense_harmonic_balance import steady_displacement
from reference.simulated_machines import one_pair, planetary

from gearmon.gears.faults import parse_fault
from gearmon.gears.mechanics import stage_mechanics
from gearmon.simulation.contact import Drive, ShaftMotion, contact_course, random_wander
from gearmon.simulation.integrate import integrate
from gearmon.simulation.train import build_train
from gearmon.simulation.vibration import triangle_means

CELLS = 5 * 4096


def steady_drive(machine, start_turns=0.0, drift=0.0):
    return Drive(
        motion=ShaftMotion(
            mean_hz=machine.operating[0].shaft1_hz,
            wander=random_wander(drift, np.random.default_rng(1)),
            start_turns=start_turns,
        ),
        load=random_wander(0.0, np.random.default_rng(2)),
        ripples=(),
    )


def summed_stiffness(mesh, phase):
    count = np.floor(phase).astype(np.int64)
    return sum(mesh.pair_stiffness(count - p, phase - count + p) for p in range(mesh.most_pairs))


@pytest.mark.parametrize(
    "faults",
    [
        (),
        ("crack:1:pinion:3:20%",),
        ("spall:1:gear:5:30%", "crack:1:pinion:3:20%", "breakage:1:gear:1:0.4"),
        ("wear:1:pinion:all:5%",),
    ],
)
@pytest.mark.parametrize("helix", [0.0, 20.0])
def test_pairs_sum_to_the_stiffness_of_the_mesh(faults, helix):
    machine = one_pair(26, 53, helix_angle_deg=helix, contact_ratio=1.6, face_width_mm=20.0)
    faults = [parse_fault(text) for text in faults]
    mesh = build_train(machine, faults, accuracy_grade=None).meshes[0]
    phase = np.random.default_rng(0).uniform(0, 26 * 53, 4000)
    expected = stage_mechanics(machine, 1, faults=faults).stiffness.at(phase)
    assert summed_stiffness(mesh, phase) == pytest.approx(expected, rel=1e-9)


def test_course_holds_the_stiffness_of_every_pair():
    machine = one_pair(helix_angle_deg=20.0, contact_ratio=1.6, face_width_mm=20.0)
    train = build_train(machine, [parse_fault("spall:1:gear:5:30%")], seed=3)
    drive = steady_drive(machine, start_turns=5.3, drift=0.01)
    course = contact_course(train.meshes, drive, (0.0, 0.2), 1e-5)
    middle = 0.5 * (course.times_s[:-1] + course.times_s[1:])
    kept = np.diff(course.times_s) > 1e-9
    share = (course.start + 0.5 * course.width)[kept]
    powers = course.stiffness[:, :, 0, course.interval[kept]]
    total = sum(row * share**n for n, row in enumerate(powers)).sum(axis=0)
    phase = train.meshes[0].phase(drive.motion.turns(middle[kept]))
    expected = train.meshes[0].mechanics.stiffness.at(phase)
    # time runs evenly through an interval, the phase not quite
    assert np.abs(total - expected).max() < 1e-5 * expected.max()


def test_pieces_end_at_every_event():
    machine = one_pair()
    train = build_train(machine, seed=4)
    drive = steady_drive(machine, drift=0.01)
    course = contact_course(train.meshes, drive, (0.0, 0.1), 1e-5)
    phase = train.meshes[0].phase(drive.motion.turns(course.times_s))
    for event in (0.0, 0.4122):
        distance = np.abs((phase - event + 0.5) % 1 - 0.5)
        counted = np.count_nonzero(distance[1:-1] < 1e-8)
        assert counted == math.floor(phase[-1] - event) - math.floor(phase[0] - event)


def test_pair_brings_the_deviations_of_its_two_teeth():
    mesh = build_train(one_pair(), seed=1).meshes[0]
    first, second = (errors.pitch_m for errors in mesh.errors)
    found = mesh.pitch_deviation_m(np.array([0, 13, 14, -1]))
    expected = [first[0] + second[0], first[0] + second[13], first[1] + second[14]]
    assert found == pytest.approx([*expected, first[12] + second[16]])


def test_runout_shifts_the_phase_and_back():
    mesh = build_train(one_pair(), seed=1).meshes[0]
    turns = np.linspace(0, 40, 1001)
    phase = mesh.phase(turns)
    assert mesh.turns(phase) == pytest.approx(turns, abs=1e-12)
    nominal = mesh.order * turns
    assert phase - nominal == pytest.approx(-mesh.runout_m(nominal) / mesh.base_pitch_m)


def test_phases_of_every_planet_are_reached_at_their_turns():
    meshes = build_train(planetary(), seed=1).meshes
    assert len({round(mesh.offset % 1.0, 9) for mesh in meshes}) > 1
    phase = np.linspace(-50.0, 200.0, 501)
    for mesh in meshes:
        assert mesh.phase(mesh.turns(phase)) == pytest.approx(phase, abs=1e-9)


def test_runout_curvature_is_its_second_derivative():
    mesh = build_train(one_pair(), seed=1).meshes[0]
    phase, h = np.linspace(0, 200, 501), 1e-2
    second = mesh.runout_m(phase + h) - 2 * mesh.runout_m(phase) + mesh.runout_m(phase - h)
    assert mesh.runout_m(phase, 2) == pytest.approx(second / h**2, abs=1e-10)


def test_ripple_turns_with_its_shaft():
    drive = Drive(
        motion=ShaftMotion(mean_hz=10.0, wander=random_wander(0.0, np.random.default_rng(0))),
        load=random_wander(0.0, np.random.default_rng(0)),
        ripples=((0.5, 0.1, 0.0),),
    )
    times = np.array([0.0, 0.1, 0.2])
    assert drive.load_factor(times, drive.motion.turns(times)) == pytest.approx([1.1, 0.9, 1.1])


@pytest.mark.parametrize("fault", [None, "crack:1:pinion:4:15%", "spall:1:pinion:2:40%"])
def test_steady_state_agrees_with_harmonic_balance(fault):
    teeth, harmonics = 5, 600
    machine = one_pair(teeth, 7)
    faults = [] if fault is None else [parse_fault(fault)]
    train = build_train(machine, faults, accuracy_grade=None)
    mechanics, period = train.meshes[0].mechanics, teeth / 625.0
    # transients have died away after one turn and a half: exp(-7100 * 0.012)
    span = (-1.5 * period, 1.05 * period)
    course = contact_course(train.meshes, steady_drive(machine), span, 4e-6)
    result = integrate(train.system, course, run_in=0)
    # the mesh force is what accelerates the mass beyond the static force: integrate it twice
    cell = period / CELLS
    force = triangle_means(result, -cell, cell, CELLS + 1)[0][0, 1:] - mechanics.force_n
    n = np.arange(1, 12 * teeth + 1)
    lines = np.fft.rfft(force)[n] / CELLS / np.sinc(n / CELLS) ** 2
    found = lines / (mechanics.equivalent_mass_kg * (2 * np.pi * n / period) ** 2)
    stiffness = mechanics.stiffness
    relative = np.zeros(2 * harmonics, dtype=complex)
    step = teeth // stiffness.period_mesh
    relative[step - 1 :: step] = stiffness.harmonics(2 * harmonics // step)
    expected = steady_displacement(
        mechanics.equivalent_mass_kg,
        mechanics.damping_ns_per_m,
        stiffness.mean_n_per_m,
        relative,
        period,
        mechanics.force_n,
    )[n]
    assert np.linalg.norm(found - expected) < 1e-4 * np.linalg.norm(expected)
    if fault is None:
        assert np.abs(found[n % teeth != 0]).max() < 2e-5 * np.abs(found).max()
