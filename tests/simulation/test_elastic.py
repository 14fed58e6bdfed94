"""Machines with shafts in bearings: the simulation against other solvers of the same system."""

from __future__ import annotations

import numpy as np
import pytest

import gearmon
from gearmon.dynamics import HillSystem, steady_state
from gearmon.dynamics import integrate as by_dop853
from gearmon.gears.assembly import drive_train
from gearmon.simulation.contact import Drive, ShaftMotion, contact_course, random_wander
from gearmon.simulation.integrate import integrate
from gearmon.simulation.train import build_train
from gearmon.simulation.vibration import triangle_means

CELLS, RATE_HZ = 512, 20_000.0


def elastic(mesh_hz, **stage):
    """A pair on shafts that twist and bend, with motor and load."""
    pair = {"kind": "parallel", "pinion_teeth": 23, "gear_teeth": 57, "module_mm": 2.5}
    shafts = [
        {"shaft": 1, "length_mm": 150.0, "diameter_mm": 35.0},
        {"shaft": 2, "length_mm": 180.0, "diameter_mm": 50.0},
    ]
    bearings = [
        {"name": name, "shaft": shaft, "stiffness_n_per_m": stiffness, "damping_ns_per_m": 4e3}
        for name, shaft, stiffness in (("a", 1, 2e8), ("b", 1, 3e8), ("c", 2, 3e8), ("d", 2, 3e8))
    ]
    return gearmon.load_machine(
        operating={"speed_rpm": 60 * mesh_hz / 23, "torque_nm": 100.0},
        stage=pair | {"face_width_mm": 28.0, "position_pinion_mm": 50.0} | stage,
        shaft=shafts,
        bearing=bearings,
        disc=[
            {"name": "motor", "shaft": 1, "inertia_kgm2": 0.02},
            {"name": "load", "shaft": 2, "inertia_kgm2": 0.1},
        ],
    )


def integrated(train, mesh_hz, periods, start=None):
    """Motion over so many mesh periods, from rest if from nothing else, perfect gears."""
    still = random_wander(0.0, np.random.default_rng(0))
    drive = Drive(motion=ShaftMotion(mean_hz=mesh_hz / 23, wander=still), load=still, ripples=())
    step = 0.1 / train.system.natural_frequencies_hz(train.greatest_stiffness)[-1]
    course = contact_course(train.meshes, drive, (0.0, periods / mesh_hz), step)
    return integrate(train.system, course, run_in=0, start=start)


def marched(train, mesh_hz, periods, start=None):
    """Mean mesh forces [N] of cells over so many mesh periods."""
    result = integrated(train, mesh_hz, periods + 0.01, start)
    return triangle_means(result, 0.0, 1 / mesh_hz / CELLS, periods * CELLS)[0][0]


def settled(train, mesh_hz):
    """State to which a mesh period returns; while the teeth touch, it maps states linearly."""
    rest = np.append(train.system.at_rest, 0 * train.system.at_rest)
    size = np.repeat(1e-3 * np.abs(rest).max() * np.array([1, 2 * np.pi * mesh_hz]), len(rest) // 2)

    def after(start):
        return integrated(train, mesh_hz, 1, start.reshape(2, -1)).end_state.ravel()

    begun = after(rest)
    columns = [(after(rest + moved) - begun) / moved.sum() for moved in np.diag(size)]
    found = rest + np.linalg.solve(np.eye(len(rest)) - np.transpose(columns), begun - rest)
    # nowhere on the way did the teeth part
    np.testing.assert_allclose(after(found) / size, found / size, rtol=0, atol=1e-6)
    return found.reshape(2, -1)


def system_of(machine, train, mesh_hz, harmonics):
    """The whole machine, every mode of it, for other solvers."""
    full, mechanics = drive_train(machine), train.meshes[0].mechanics
    around = full.around(full.meshes(1), full.load({1: mechanics.force_n})[:, None])
    return HillSystem(
        np.eye(len(around.stiffness)),
        0.5 * (around.damping + around.damping.T),
        0.5 * (around.stiffness + around.stiffness.T),
        around.vectors,
        around.means,
        mechanics.stiffness.harmonics(harmonics)[None],
        1 / mesh_hz,
        around.inputs[:, 0],
        mesh_damping_ns_per_m=around.dampers,
    )


def test_against_harmonic_balance_of_all_modes():
    mesh_hz = 1418.0
    machine = elastic(mesh_hz)
    train = build_train(machine, accuracy_grade=None, carried_hz=RATE_HZ)
    lines = np.fft.rfft(marched(train, mesh_hz, 2, settled(train, mesh_hz))[-CELLS:]) / CELLS
    found = steady_state(system_of(machine, train, mesh_hz, 60), tolerance=1e-6)
    expected = found.mesh_force[:13, 0]
    assert not found.contact_lost.any()
    assert lines[0] == pytest.approx(expected[0], rel=1e-4)
    assert np.linalg.norm(lines[1:13] - expected[1:]) < 0.01 * np.linalg.norm(expected[1:])
    assert np.abs(20 * np.log10(np.abs(lines[1:7] / expected[1:7]))).max() < 0.1
    assert len(train.system.stiffness) < 0.4 * len(drive_train(machine).mass)


def test_lost_contact_against_dop853():
    # a speed at which the teeth part, their mesh hardly damped
    mesh_hz, periods, shown = 2640.0, 12, 4
    machine = elastic(mesh_hz, damping_ratio=0.01, stiffness_variation=0.55)
    train = build_train(machine, accuracy_grade=None, carried_hz=RATE_HZ)
    force = marched(train, mesh_hz, periods)
    system = system_of(machine, train, mesh_hz, 40)
    whole = system.stiffness + system.mesh_vectors.T @ (
        system.mesh_stiffness_n_per_m[:, None] * system.mesh_vectors
    )
    start = np.append(np.linalg.solve(whole, system.force_n), np.zeros(len(whole)))
    times = np.arange(periods * CELLS // shown) * shown / CELLS / mesh_hz
    backlash = train.meshes[0].backlash_m
    expected = by_dop853(system, times, start, backlash, relative_tolerance=1e-5)
    assert 0.02 < expected.apart.mean() < 0.5
    # instants beside the jumps of the stiffness differ by what its harmonics leave out
    window = np.hanning(len(times))
    own, other = (
        np.fft.rfft(window * row)[: 6 * periods]
        for row in (force[::shown], expected.mesh_force[:, 0])
    )
    assert np.linalg.norm(own - other) < 0.01 * np.linalg.norm(other[periods // 2 :])
