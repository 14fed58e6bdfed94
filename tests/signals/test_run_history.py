"""NA4 and NA4* over a run: Gaussian limit, growth, equality with sums written out."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference import slow_indicators

from gearmon.errors import ArgumentError
from gearmon.signals.indicators import kurtosis, na4


def run_of(records):
    return np.array([np.var(record, axis=-1) for record in records])


@given(st.integers(0, 1000), st.integers(1, 6), st.integers(1, 8))
def test_equals_the_sums_written_out(seed, count, baseline):
    rng = np.random.default_rng(seed)
    records = [rng.normal(size=(2, 40)) * rng.uniform(0.5, 3) + rng.normal() for _ in range(count)]
    history = run_of(records)
    for channel in range(2):
        run = [list(record[channel]) for record in records]
        assert na4(records[-1], history)[channel] == pytest.approx(
            slow_indicators.na4(run), rel=1e-10
        )
        assert na4(records[-1], history, baseline)[channel] == pytest.approx(
            slow_indicators.na4_frozen(run, baseline), rel=1e-10
        )


def test_first_record_is_the_kurtosis():
    record = np.random.default_rng(0).normal(size=(3, 500))
    history = run_of([record])
    np.testing.assert_allclose(na4(record, history), kurtosis(record), rtol=1e-12)
    np.testing.assert_allclose(na4(record, history, 5), kurtosis(record), rtol=1e-12)


def test_steady_gaussian_noise_stays_at_three():
    rng = np.random.default_rng(1)
    records = [rng.normal(size=(1, 200_000)) for _ in range(5)]
    # standard error of a fourth moment of n numbers: sqrt(96 / n)
    error = 4 * np.sqrt(96 / 200_000)
    assert na4(records[-1], run_of(records))[0] == pytest.approx(3.0, abs=error)


def test_damage_that_spreads_is_followed_further_than_by_kurtosis():
    rng = np.random.default_rng(2)
    records = [size * rng.normal(size=(1, 5000)) for size in (1.0, 1.0, 1.0, 2.0)]
    history = run_of(records)
    # noise twice as large: 3 * 16 over (7/4)^2, and over 1 where the baseline is frozen
    assert na4(records[-1], history)[0] == pytest.approx(3 * 16 / 1.75**2, rel=0.1)
    assert na4(records[-1], history, 3)[0] == pytest.approx(48, rel=0.1)
    assert kurtosis(records[-1])[0] == pytest.approx(3.0, rel=0.1)


@pytest.mark.parametrize("factor", [1000.0, 1e-3, 1e80, 1e-80])
def test_scale_of_the_whole_run_does_not_matter(factor):
    records = [np.random.default_rng(k).normal(size=(2, 64)) for k in range(3)]
    scaled = [factor * record for record in records]
    np.testing.assert_allclose(
        na4(scaled[-1], run_of(scaled)), na4(records[-1], run_of(records)), rtol=1e-12
    )


def test_silence_gives_zero():
    record = np.full((1, 16), 2.0)
    assert na4(record, run_of([record]))[0] == 0.0


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: na4(np.ones((1, 4)), np.empty((0, 1))), "one record or more"),
        (lambda: na4(np.ones((2, 4)), run_of([np.ones((1, 4))])), r"must be \(records, 2\)"),
        (lambda: na4(np.ones((1, 4)), run_of([np.ones((1, 4))]), 0), "baseline=0"),
    ],
)
def test_impossible_histories_are_refused(call, words):
    with pytest.raises(ArgumentError, match=words):
        call()
