"""The share of a departure that one tooth explains, on departures whose content is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference.gear_departures import TEETH, complex_noise, gear, weights

from gearmon.diagnosis.kind_spread import SHARES, _Band, _event, _log_likelihood, departure_spread


@pytest.mark.parametrize("height", [2.0, 10.0, 300.0])
@pytest.mark.parametrize("tooth", [0, 17])
def test_one_tooth_explains_its_own_departure_at_any_height(height, tooth):
    spread = departure_spread(gear(weights(tooth), seed=tooth, height=height))
    assert spread.one_tooth > 0.99
    assert spread.explained > 0.8


@pytest.mark.parametrize("height", [2.0, 10.0, 300.0])
@pytest.mark.parametrize("seed", range(4))
def test_random_losses_of_all_teeth_are_not_one_tooth(height, seed):
    rng = np.random.default_rng([4, seed])
    weight = np.where(rng.random(TEETH) < 0.6, rng.uniform(0, 2, TEETH), 0.0)
    spread = departure_spread(gear(weight, seed=seed, height=height))
    assert spread.one_tooth < 0.05
    assert spread.explained < 0.5
    assert spread.teeth_involved > 0.4 * TEETH


@pytest.mark.parametrize("smooth", [0.3, 0.6, 0.9])
def test_sidebands_that_fall_off_are_not_one_tooth(smooth):
    spread = departure_spread(gear(None, seed=7, smooth=smooth))
    assert spread.one_tooth < 0.05


def test_three_teeth_are_neither_one_nor_all():
    several = departure_spread(gear(weights(2, 11, 22), seed=1))
    assert several.one_tooth < 0.5
    one = departure_spread(gear(weights(2), seed=1))
    everywhere = departure_spread(gear(np.random.default_rng(5).normal(size=TEETH), seed=1))
    assert one.teeth_involved < several.teeth_involved < everywhere.teeth_involved


def test_the_share_left_unexplained_comes_back():
    """Unrelated lines of a known share of the power beside the event of one tooth."""
    for share in (0.1, 0.5, 0.9):
        found = []
        for seed in range(6):
            event = gear(weights(5), seed=seed, height=100.0 * np.sqrt(1 - share), noise=0.0)
            rng = np.random.default_rng([6, seed])
            for band in event.difference.bands:
                band.rest[:] += 100.0 * np.sqrt(share) * complex_noise(rng, *band.rest.shape)
            found.append(1.0 - departure_spread(event).explained)
        assert np.median(found) == pytest.approx(share, abs=0.12)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, TEETH - 1))
def test_which_tooth_it_is_does_not_matter(tooth):
    plain = departure_spread(gear(weights(0), noise=0.0))
    moved = departure_spread(gear(weights(tooth), noise=0.0))
    assert moved.log_likelihood == pytest.approx(plain.log_likelihood, rel=1e-6, abs=1e-3)
    assert moved.by_tooth == pytest.approx(np.roll(plain.by_tooth, tooth), rel=1e-6, abs=1e-6)


def test_likelihood_is_that_of_the_covariance():
    """Against the Gaussian law with the matrix written out."""
    rng = np.random.default_rng(8)
    offset = np.arange(-9, 10) / TEETH
    band = _Band(
        rest=3.0 * complex_noise(rng, len(offset)),
        level=np.ones(len(offset)),
        offset=offset,
        place=np.exp(2j * np.pi * np.outer(np.arange(TEETH), offset)),
    )
    power, direction = _event(band, 1.6, 0.3)
    energy = np.abs((band.place * band.rest) @ direction.conj()) ** 2
    fast = _log_likelihood(band, power, energy)
    excess = max(float(np.mean(np.abs(band.rest) ** 2)) - 1.0, 0.05)
    event = (direction * power) @ direction.conj().T
    slow = np.zeros_like(fast)
    for row, share in enumerate(SHARES):
        for tooth in range(TEETH):
            turned = band.place[tooth] * band.rest
            each = []
            for factor in np.geomspace(1 / 16, 16, 13):
                matrix = np.eye(len(offset)) * (1 + factor * excess * share)
                matrix = matrix + factor * excess * (1 - share) * event
                logarithm = np.linalg.slogdet(matrix)[1]
                told = turned.conj() @ np.linalg.solve(matrix, turned)
                each.append(-float(told.real) - logarithm)
            slow[row, tooth] = np.logaddexp.reduce(each) - np.log(len(each))
    assert fast == pytest.approx(slow, rel=1e-6)


def test_events_have_a_trace_of_the_lines():
    band = _Band(
        rest=np.ones(21, dtype=complex),
        level=np.ones(21),
        offset=np.arange(-10, 11) / TEETH,
        place=np.ones((1, 21)),
    )
    for ringing in (0.05, 1.0, 3.0):
        power, direction = _event(band, 1.6, ringing)
        assert power.sum() == pytest.approx(21, rel=0.01)
        assert direction.conj().T @ direction == pytest.approx(np.eye(len(power)), abs=1e-6)
