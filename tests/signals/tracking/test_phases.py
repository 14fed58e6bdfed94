"""Locking to phases: the recovered angle against the known one."""

from __future__ import annotations

import numpy as np
import pytest
from reference.simulated_machines import two_stages
from reference.synthetic_signals import (
    as_recording,
    constant_track,
    lines_on,
    track_of,
    wandering_turns,
    white,
)

from gearmon.gears.kinematics import kinematics
from gearmon.signals.orders import OrderSums
from gearmon.signals.orders.lines import SlidingLines
from gearmon.signals.tracking import (
    MeshComb,
    SpeedScan,
    SpeedTrack,
    coherent_share,
    integrate_speed,
    lock_track,
)
from gearmon.signals.tracking.mesh_detection import combined_comb
from gearmon.signals.tracking.phases import _unwound, roughness
from gearmon.signatures.measured.measurement import measure_signature

RATE, DURATION = 4000.0, 10.0
TIME = np.arange(int(DURATION * RATE)) / RATE
MESHES = np.array([23.0, 46.0, 69.0])


@pytest.mark.parametrize("order", [1, 2])
def test_roughness_is_the_integral_of_the_squared_derivative(order):
    """Of t and t^2 the difference quotients are the derivatives, wherever the places lie."""
    places = np.cumsum(np.random.default_rng(4).uniform(0.3, 2.0, 40))
    unit = np.mean(np.diff(places))
    values, band = (places / unit) ** order, roughness(places, order)
    found = sum(
        (1 if k == 0 else 2)
        * float(np.sum(own[: len(own) - k] * values[k:] * values[: len(own) - k]))
        for k, own in enumerate(band)
    )
    steps = np.diff(places) / unit
    over = steps.sum() if order == 1 else 0.5 * (steps[1:] + steps[:-1]).sum()
    assert found == pytest.approx(order**2 * over)


def mesh_signal(turns, noise=0.5, seed=0):
    orders = [m + r for m in MESHES for r in (-1, 0, 1)]
    levels = [share for _ in MESHES for share in (0.3, 1.0, 0.3)]
    phases = np.random.default_rng(seed).uniform(0, 6.28, len(orders))
    return lines_on(turns, orders, levels, phases) + white((1, len(turns)), noise, seed=seed)


def phase_error(track, turns, time=TIME):
    """Departure of a track from the known angle, without its offset [turns], sample by sample."""
    error = track.turns_at(time) - turns
    return error - error.mean()


def test_integrated_ramp_is_a_parabola():
    time = np.linspace(0.5, 9.5, 19)
    speed = SpeedTrack(time_s=time, speed_hz=20 + 0.3 * time)
    track = integrate_speed(speed, 10.0)
    at = np.linspace(1.0, 9.0, 100)
    gained = track.turns_at(at) - track.turns_at(np.array([1.0]))
    np.testing.assert_allclose(gained, 20 * (at - 1) + 0.15 * (at**2 - 1), atol=2e-3)
    np.testing.assert_allclose(track.time_s[[0, -1]], [0.0, 10.0])
    assert track.turns[0] == 0.0


@pytest.mark.parametrize("wander", [0.0, 0.001, 0.003])
@pytest.mark.parametrize("seed", range(3))
def test_refined_track_follows_the_phase(wander, seed):
    turns = wandering_turns(TIME, 25.0, wander, seed)
    samples = mesh_signal(turns, seed=seed)
    comb = combined_comb(
        [MeshComb(order=23.0, groups=tuple((m,) for m in MESHES), spacings=(1.0,))], [1.0]
    )
    first = integrate_speed(SpeedScan(samples, RATE, comb, 25.3).track(), TIME[-1])
    refined = lock_track(OrderSums(samples, RATE, MESHES), first)[0]
    inner = slice(int(0.4 * RATE), -int(0.4 * RATE))  # ten turns from the ends
    error = phase_error(refined, turns)
    assert error[inner].std() * 23 < 0.02
    assert error.std() * 23 < 0.05
    assert refined.method == "comb"


@pytest.mark.parametrize("error", [-1e-3, 5e-4])
def test_wrong_constant_speed_is_put_right(error):
    samples = mesh_signal(25.0 * TIME)
    refined = lock_track(
        OrderSums(samples, RATE, MESHES), constant_track(25.0 * (1 + error), TIME[-1])
    )[0]
    assert phase_error(refined, 25.0 * TIME).std() * 23 < 0.02
    mean = (refined.turns[-1] - refined.turns[0]) / TIME[-1]
    assert mean == pytest.approx(25.0, rel=2e-5)


def test_right_track_stays_right():
    turns = wandering_turns(TIME, 25.0, 0.003, 1)
    true = track_of(lambda t: wandering_turns(t, 25.0, 0.003, 1), TIME[-1], 300)
    refined = lock_track(OrderSums(mesh_signal(turns), RATE, MESHES), true)[0]
    assert phase_error(refined, turns).std() * 23 < 0.01


@pytest.mark.parametrize("seed", range(6))
def test_noise_does_not_move_a_track(seed):
    first = constant_track(25.0, TIME[-1])
    refined = lock_track(OrderSums(white((1, len(TIME)), seed=seed), RATE, MESHES), first)[0]
    assert np.abs(phase_error(refined, 25.0 * TIME)).max() * 23 < 0.25


@pytest.mark.parametrize("seed", range(3))
def test_faint_low_harmonics_do_not_lead_clear_high_ones_astray(seed):
    orders, levels = 6.0 * np.arange(1, 7), [0.02, 0.015, 0.02, 0.3, 0.3, 1.0]
    turns = wandering_turns(TIME, 25.0, 0.003, seed)
    true = track_of(lambda t: wandering_turns(t, 25.0, 0.003, seed), TIME[-1], 300)
    samples = lines_on(turns, orders, levels) + white((1, len(TIME)), 0.3, seed=seed)
    refined, share = lock_track(OrderSums(samples, RATE, orders), true)
    assert share > 0.95
    assert phase_error(refined, turns).std() * 6 < 0.01


def test_scale_does_not_matter():
    turns = wandering_turns(TIME, 25.0, 0.001, 2)
    samples = mesh_signal(turns)
    first = constant_track(25.0, TIME[-1])
    one = lock_track(OrderSums(samples, RATE, MESHES), first)[0]
    other = lock_track(OrderSums(1e4 * samples, RATE, MESHES), first)[0]
    np.testing.assert_allclose(other.turns_at(TIME[::50]), one.turns_at(TIME[::50]), atol=1e-6)


def test_uncertainty_is_of_the_size_of_the_error():
    turns = wandering_turns(TIME, 25.0, 0.001, 3)
    refined = lock_track(
        OrderSums(mesh_signal(turns), RATE, MESHES), constant_track(25.0, TIME[-1])
    )[0]
    steps = np.diff(phase_error(refined, turns)[:: round(RATE * 4 / 25)])
    assert 0.2 < refined.uncertainty_turns / steps.std() < 5.0


def test_lines_stand_still_in_the_true_track_only():
    turns = wandering_turns(TIME, 25.0, 0.005, 4)
    true = track_of(lambda t: wandering_turns(t, 25.0, 0.005, 4), TIME[-1], 300)
    samples = mesh_signal(turns)
    still = coherent_share(OrderSums(samples, RATE, MESHES), true)
    assert 0.95 < still <= 1.0
    assert coherent_share(OrderSums(samples, RATE, MESHES), constant_track(25.0, TIME[-1])) < 0.3


def test_nothing_heard_does_not_stand_still():
    samples = white((1, len(TIME)), seed=5)
    assert coherent_share(OrderSums(samples, RATE, MESHES), constant_track(25.0, TIME[-1])) == 0.0


def simulated_error(simulated, machine):
    """Phase error of the recovered angle, in periods of the highest mesh, and the signature."""
    measured = measure_signature(as_recording(simulated).select(["a1", "a2"]), machine)
    times = np.array(simulated.truth["speed"]["turn_times_s"])
    error = measured.track.turns_at(times) - np.arange(len(times))
    order = max(mesh.order for mesh in kinematics(machine).meshes)
    return (error - error.mean()).std() * order, measured


def check_simulated(simulated):
    error, measured = simulated_error(simulated, two_stages())
    assert error < 0.02
    true = simulated.truth["speed"]["mean_hz"]
    assert measured.speed.estimated_hz == pytest.approx(true, rel=1e-4)


def test_phase_of_a_simulated_machine_is_right_to_two_per_cent_of_a_mesh_period(
    two_stage_recording,
):
    check_simulated(two_stage_recording)


@pytest.mark.parametrize("most", [0.0, 0.004])
@pytest.mark.parametrize("wrong", [0, 1, 2])
def test_lines_without_noise_tell_the_angle_against_a_minority_that_tells_another(wrong, most):
    """Of five lines, in blocks a turn apart; lines of another machine advance otherwise."""
    rng, orders = np.random.default_rng(4), np.array([20.0, 21.0, 22.0, 23.0, 24.0])
    error = np.concatenate([[0.0], np.cumsum(rng.uniform(-most, most, 60))])
    turned = np.outer(error, orders)
    turned[:, :wrong] -= 0.3 * np.arange(61)[:, None]
    amplitude = np.array([1.0, 3.0, 0.1, 2.0, 1.0]) * np.exp(2j * np.pi * turned)
    lines = SlidingLines(angle=np.arange(61.0), orders=orders, amplitude=amplitude)
    np.testing.assert_allclose(_unwound(lines), error, atol=1e-9)
