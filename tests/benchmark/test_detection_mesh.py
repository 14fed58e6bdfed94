"""The motion that the benchmark hides in its recordings obeys the equation of motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gearmon.benchmark.detection_machines import MeshModel

TEETH = 19


@pytest.fixture(scope="module")
def model():
    return MeshModel(
        length=1.62,
        overlap=0.0,
        droop=0.4,
        edge=0.2,
        stiffness_n_per_m=3e8,
        mass_kg=0.3,
        damping_ns_per_m=2 * 0.08 * np.sqrt(3e8 * 0.3),
        mesh_hz=900.0,
    )


@pytest.mark.parametrize("loss", [0.0, 0.4])
def test_motion_obeys_the_equation_of_motion(model, loss):
    """m z'' + c z' + k z = 1 over the turn; and = c e' + k e of errors."""
    lost = np.zeros(TEETH)
    lost[6] = loss
    damage = model.wave(lost)
    size = len(damage)
    error = 3e-6 * np.cos(2 * np.pi * np.arange(size) / size)
    stiffness = model.wave(np.ones(TEETH)) - damage
    rate = 2j * np.pi * np.arange(size // 2 + 1) * model.mesh_hz / TEETH

    def derivative(wave, power):
        return np.fft.irfft(np.fft.rfft(wave) * rate**power, size)

    per_force, of_errors = model.motion(TEETH, error, damage)
    pushes = np.ones(size), model.damping_ns_per_m * derivative(error, 1) + stiffness * error
    for lines, push in zip((per_force, of_errors), pushes, strict=True):
        z = np.fft.irfft(lines, size, norm="forward")
        inertia = model.mass_kg * derivative(z, 2)
        rest = inertia + model.damping_ns_per_m * derivative(z, 1) + stiffness * z - push
        # harmonics beyond those that are solved for are left out
        known = np.fft.rfft(rest)[: 6 * TEETH]
        size_of = np.linalg.norm(np.fft.rfft(inertia)[: 6 * TEETH])
        assert np.linalg.norm(known) < 2e-3 * size_of


def test_mean_of_the_wave_is_the_mean_stiffness(model):
    wave = model.wave(np.ones(TEETH))
    assert wave.mean() == pytest.approx(model.stiffness_n_per_m, rel=1e-3)


def test_flanks_that_all_stand_out_alike_shift_the_motion(model):
    damage = model.wave(np.eye(TEETH)[3] * 0.2)
    _, found = model.motion(TEETH, np.full(len(damage), 5e-6), damage)
    assert found[0] == pytest.approx(5e-6, rel=1e-5)
    # the mesh harmonics beyond those that are solved for are left out of one side only
    assert np.abs(found[1:]).max() < 1e-4 * 5e-6


def test_motion_is_linear_in_the_errors(model):
    rng = np.random.default_rng(3)
    waves = [model.wave(rng.normal(size=TEETH)) * 1e-15 for _ in range(2)]
    alone = [model.motion(TEETH, wave)[1] for wave in waves]
    both = model.motion(TEETH, 2 * waves[0] - waves[1])[1]
    np.testing.assert_allclose(both, 2 * alone[0] - alone[1], atol=1e-6 * np.abs(both).max())


@pytest.mark.parametrize("overlap", [0.0, 0.7])
def test_pair_carries_between_entry_and_exit_only(model, overlap):
    shape = replace(model, length=1.5, overlap=overlap, droop=0.3, edge=0.1)
    assert shape.pair(np.array([-0.01, shape.reach + 0.01])).tolist() == [0.0, 0.0]
    middle = 0.5 * shape.reach
    assert shape.pair(np.array([middle])) > 0.5
    ahead, behind = shape.pair(middle + np.array([0.3, -0.3]))
    assert ahead == pytest.approx(behind)


def test_loss_of_one_tooth_acts_while_it_is_in_contact(model):
    lost = np.zeros(TEETH)
    lost[4] = 0.3
    phase = np.arange(TEETH * model.points) / model.points
    hurt = model.wave(lost) > 0
    assert phase[hurt].min() >= 4.0
    assert phase[hurt].max() <= 4 + model.reach


@pytest.mark.parametrize("mesh_hz", np.linspace(100.0, 1800.0, 18))
def test_a_product_of_two_waves_has_the_harmonics_of_their_convolution(model, mesh_hz):
    own, rng = replace(model, mesh_hz=mesh_hz), np.random.default_rng(1)
    highest = own.harmonics
    half = rng.normal(size=(2, highest + 1)) + 1j * rng.normal(size=(2, highest + 1))
    half[:, 0] = half[:, 0].real
    one, other = np.fft.irfft(half, own.points, norm="forward")
    found = np.fft.rfft(one * other, norm="forward")[: highest + 1]
    both = np.concatenate([half[:, :0:-1].conj(), half], axis=1)
    np.testing.assert_allclose(found, np.convolve(*both)[2 * highest :][: highest + 1], atol=1e-9)
