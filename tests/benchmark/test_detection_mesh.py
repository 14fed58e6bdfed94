"""The benchmark's own solution of a mesh agrees with the package's solvers, found another way."""

from __future__ import annotations

import numpy as np
import pytest

from gearmon.benchmark.detection_machines import MeshModel, PairShape
from gearmon.dynamics import HillProblem, steady_state

TEETH = 19


@pytest.fixture(scope="module")
def model():
    return MeshModel(
        shape=PairShape(length=1.62, overlap=0.0, droop=0.4, edge=0.2),
        stiffness_n_per_m=3e8,
        mass_kg=0.3,
        damping_ns_per_m=2 * 0.08 * np.sqrt(3e8 * 0.3),
        mesh_hz=900.0,
        highest_hz=9000.0,
    )


def lines_of(model, stiffness, force_n=1000.0):
    """Motion per force by the package's solver, from samples of the stiffness over a turn."""
    harmonics = np.fft.rfft(stiffness) / len(stiffness)
    mean = harmonics[0].real
    problem = HillProblem(
        model.mass_kg,
        model.damping_ns_per_m,
        mean,
        harmonics[1 : model.harmonics * TEETH] / mean,
        TEETH / model.mesh_hz,
        force_n,
    )
    return steady_state(problem, tolerance=1e-8).displacement / force_n


@pytest.mark.parametrize("loss", [0.0, 0.4])
def test_motion_is_that_of_the_general_solver(model, loss):
    turn = model.turn(TEETH)
    lost = np.zeros(TEETH)
    lost[6] = loss
    damage = model.wave(lost)
    expected = lines_of(model, model.wave(np.ones(TEETH)) - damage)
    found = turn.motion(loss=damage).per_force
    count = 6 * TEETH
    weight = np.arange(count) ** 2
    error = weight * (found[:count] - expected[:count])
    assert np.linalg.norm(error) < 2e-3 * np.linalg.norm(weight * expected[:count])


def test_mean_of_the_wave_is_the_mean_stiffness(model):
    wave = model.wave(np.ones(TEETH))
    assert wave.mean() == pytest.approx(model.stiffness_n_per_m, rel=1e-3)


def test_flanks_that_all_stand_out_alike_shift_the_motion(model):
    turn = model.turn(TEETH)
    damage = model.wave(np.eye(TEETH)[3] * 0.2)
    found = turn.motion(error=np.full(turn.size, 5e-6), loss=damage).of_errors
    assert found[0] == pytest.approx(5e-6, rel=1e-5)
    # the mesh harmonics beyond those that are solved for are left out of one side only
    assert np.abs(found[1:]).max() < 1e-4 * 5e-6


def test_motion_is_linear_in_the_errors(model):
    turn = model.turn(TEETH)
    rng = np.random.default_rng(3)
    waves = [model.wave(rng.normal(size=TEETH)) * 1e-15 for _ in range(2)]
    alone = [turn.motion(error=wave).of_errors for wave in waves]
    both = turn.motion(error=2 * waves[0] - waves[1]).of_errors
    np.testing.assert_allclose(both, 2 * alone[0] - alone[1], atol=1e-9 * np.abs(both).max())


@pytest.mark.parametrize("overlap", [0.0, 0.7])
def test_pair_carries_between_entry_and_exit_only(overlap):
    shape = PairShape(length=1.5, overlap=overlap, droop=0.3, edge=0.1)
    assert shape.at(np.array([-0.01, shape.reach + 0.01])).tolist() == [0.0, 0.0]
    middle = 0.5 * shape.reach
    assert shape.at(np.array([middle])) > 0.5
    ahead, behind = shape.at(middle + np.array([0.3, -0.3]))
    assert ahead == pytest.approx(behind)


def test_loss_of_one_tooth_acts_while_it_is_in_contact(model):
    lost = np.zeros(TEETH)
    lost[4] = 0.3
    phase = np.arange(TEETH * model.points) / model.points
    hurt = model.wave(lost) > 0
    assert phase[hurt].min() >= 4.0
    assert phase[hurt].max() <= 4 + model.shape.reach
