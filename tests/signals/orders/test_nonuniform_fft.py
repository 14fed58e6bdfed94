"""Spreading samples onto steps of angle: the sum over the samples that it stands for."""

from __future__ import annotations

import numpy as np
import pytest
from reference.synthetic_signals import track_of, wandering_turns, white

from gearmon.signals.angle import AngleTrack
from gearmon.signals.orders import resampling
from gearmon.signals.orders.resampling import AngleGrid, InAngle, Kernel

RATE = 2000.0


def spread_of(samples, track, per_turn, kernel, first_turn, count):
    grid = AngleGrid(per_turn=per_turn, first_turn=first_turn, count=count)
    return InAngle(samples, RATE, track, grid, kernel).steps(0, count)


@pytest.mark.parametrize(("width", "bound"), [(4, 3e-3), (6, 6e-5), (8, 1e-6)])
@pytest.mark.parametrize("oversampling", [1.3, 2.0, 3.0])
def test_transform_of_the_kernel_is_its_fourier_integral(width, bound, oversampling):
    kernel = Kernel.of(width, oversampling)
    u = np.linspace(-width / 2, width / 2, 20_001)
    x = np.linspace(0.0, 0.5, 7)
    waves = np.cos(2 * np.pi * np.outer(x, u))
    integral = np.trapezoid(kernel.at(u) * waves, u, axis=1)
    np.testing.assert_allclose(kernel.transform(x), integral, rtol=1e-6, atol=1e-7 * width)
    assert not kernel.at(np.linspace(1.001 * width / 2, 0.7 * width, 50)).any()
    assert kernel.at(np.array([width / 2]))[0] < 30 * bound


@pytest.mark.parametrize("width", [4, 6, 8])
def test_every_step_is_the_weighted_sum_of_its_neighbours(width):
    # slowly changing speed: angles of samples near a step, one by one
    def turns(time):
        return wandering_turns(time, 20.0, 0.02, 3)

    track = track_of(turns, 4.0, 60)
    samples = white((2, 8000), seed=1)
    kernel = Kernel.of(width, 1.5)
    per_turn, first, count = 130.0, 20.0, 3000
    found = spread_of(samples, track, per_turn, kernel, first, count)
    angle = track.turns_at(np.arange(8000) / RATE)
    density = per_turn * np.gradient(angle)
    for step in range(0, count, 37):
        distance = step - per_turn * (angle - first)
        near = np.abs(distance) <= 0.5 * width
        slow = samples[:, near] @ (kernel.at(distance[near]) * density[near])
        np.testing.assert_allclose(found[:, step], slow, atol=1.5e-5)


def test_dense_knots_and_sparse_ones_give_the_same_steps():
    def turns(time):
        return wandering_turns(time, 20.0, 0.01, 5)

    samples = white((1, 8000), seed=2)
    kernel = Kernel.of(8, 1.5)
    dense, sparse = track_of(turns, 4.0, 2000), track_of(turns, 4.0, 50)
    one, other = (spread_of(samples, track, 100.0, kernel, 20.0, 4000) for track in (dense, sparse))
    assert np.abs(one - other).max() < 0.05 * np.abs(one).max()


@pytest.mark.parametrize("width", [4, 6, 8])
@pytest.mark.parametrize("steps", [0.45, 0.7, 1.05, 1.3])
def test_the_table_gives_the_kernel_at_every_number_of_steps_a_sample(width, steps):
    track = track_of(lambda time: 20.0 * time, 2.0, 5)
    samples = np.sign(white((1, 4000), seed=6))
    kernel, taps = Kernel.of(width, 1.5), int(np.ceil(width / steps))
    found = spread_of(samples, track, 100.0 * steps, kernel, 10.0, 500)[0]
    place = 1000.0 + np.arange(500) / steps  # of each step [samples]
    nearest = np.rint(place - 0.5 * (taps - 1)).astype(int)[:, None] + np.arange(taps)
    weights = kernel.at(steps * (nearest - place[:, None])) * steps
    slow = np.sum(samples[0, nearest] * weights, axis=1)
    # a sample at the very end of the reach may count or not
    end = 2.0 * float(kernel.at(np.array([0.5 * width]))[0])
    assert np.median(np.abs(found - slow)) < 3e-7
    assert np.abs(found - slow).max() < 3e-7 + end


@pytest.mark.parametrize("knots", [6, 40, 900, 6000])
def test_steps_stand_where_the_track_has_them(knots, monkeypatch):
    rng = np.random.default_rng(7)
    # knots at random, steps beyond both ends
    time = np.sort(rng.uniform(0.5, 3.5, knots))
    track = AngleTrack(
        time_s=time,
        turns=wandering_turns(time, 20.0, 0.05, 8),
        method="tacho",
        uncertainty_turns=0.0,
    )
    per_turn = 90.0
    grid = AngleGrid(per_turn=per_turn, first_turn=0.0, count=7001)
    spreading = InAngle(white((1, 8000), seed=1), RATE, track, grid, Kernel.of(8, 1.5))
    for first, count in ((0, 7001), (2997, 5), (1953, 16)):
        time_s, slope = track.time_and_slope_at((first + np.arange(count)) / per_turn)
        monkeypatch.setattr(InAngle, "_piece", lambda *own: own[1][None])
        found = spreading.steps(first, count)[0]
        np.testing.assert_allclose(found, RATE * time_s, rtol=0, atol=1e-8)
        monkeypatch.setattr(InAngle, "_piece", lambda *own: own[2][None])
        found = spreading.steps(first, count)[0]
        np.testing.assert_allclose(found, per_turn / (RATE * slope), rtol=1e-8)


def test_stretches_do_not_depend_on_where_they_begin(monkeypatch):
    track = AngleTrack(
        time_s=np.linspace(0.0, 4.0, 9),
        turns=20 * np.linspace(0.0, 4.0, 9) + 0.3 * np.linspace(0.0, 4.0, 9) ** 2,
        method="comb",
        uncertainty_turns=0.0,
    )
    samples, kernel = white((2, 8001), seed=4), Kernel.of(8, 1.5)
    whole = spread_of(samples, track, 120.0, kernel, 0.0, 9600)
    monkeypatch.setattr(resampling, "_PIECE", 700)
    parts = spread_of(samples, track, 120.0, kernel, 0.0, 9600)
    np.testing.assert_allclose(parts, whole, atol=5e-6)


def test_a_constant_is_spread_evenly_to_the_ends():
    track = AngleTrack(
        time_s=np.array([0.0, 1.0]),
        turns=np.array([0.0, 20.0]),
        method="constant",
        uncertainty_turns=0.0,
    )
    kernel = Kernel.of(8, 2.0)
    found = spread_of(np.full((1, 2001), 9.81), track, 110.0, kernel, 0.0, 2200)
    level = 9.81 * kernel.transform(np.zeros(1))[0]
    np.testing.assert_allclose(found, level, rtol=1e-6)
