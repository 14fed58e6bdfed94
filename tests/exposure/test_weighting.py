"""Weightings against printed tables, and digital filters against the analogue responses."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import sosfilt, sosfreqz

from gearmon.errors import ArgumentError
from gearmon.exposure import WEIGHTINGS, frequency_weighting

NAMES = tuple(WEIGHTINGS)
# At exact third octaves 10^(n/10) Hz, to the figures given.
THIRD_OCTAVES = {
    "Wk": {0: 0.4825, 6: 0.9648, 8: 1.0544, 9: 1.0374, 12: 0.7743, 19: 0.1339},
    "Wd": {0: 1.011, 9: 0.255},
    "Wh": {9: 0.8731, 11: 0.9576, 12: 0.8958, 21: 0.127, 30: 0.0135},
}
# ISO 8041-1:2017, table 1: reference frequency and the factor there.
REFERENCE = {
    "Wc": (15.915, 0.5145),
    "Wd": (15.915, 0.1261),
    "We": (15.915, 0.06287),
    "Wf": (0.3979, 0.3888),
    "Wh": (79.58, 0.2020),
    "Wj": (15.915, 1.019),
    "Wk": (15.915, 0.7718),
    "Wm": (15.915, 0.3362),
}
# ISO 2631-1:1997, table 3, Wk from 1 Hz on, in thousandths.
WK = (482, 484, 494, 531, 631, 804, 967, 1039, 1054, 1036, 988, 902, 768, 636, 513, 405, 314, 246)


def slow_response(f1, f2, f, transition=(), step=()):
    """The formulas as they are printed, factor by factor."""
    s = 2j * np.pi * f
    w1, w2, q = 2 * np.pi * f1, 2 * np.pi * f2, 1 / np.sqrt(2)
    found = 1 / (1 + w1 / (q * s) + (w1 / s) ** 2) / (1 + s / (q * w2) + (s / w2) ** 2)
    if transition:
        w3, w4, q4 = 2 * np.pi * transition[0], 2 * np.pi * transition[1], transition[2]
        found *= (1 + s / w3) / (1 + s / (q4 * w4) + (s / w4) ** 2)
    if step:
        w5, q5, w6, q6 = 2 * np.pi * step[0], step[1], 2 * np.pi * step[2], step[3]
        found *= 1 + s / (q5 * w5) + (s / w5) ** 2
        found /= 1 + s / (q6 * w6) + (s / w6) ** 2
        found *= (w5 / w6) ** 2
    return found


@pytest.mark.parametrize("name", THIRD_OCTAVES)
def test_factors_at_third_octaves(name):
    for number, factor in THIRD_OCTAVES[name].items():
        found = abs(WEIGHTINGS[name].response(10 ** (number / 10)))
        assert found == pytest.approx(factor, abs=1e-3)


@pytest.mark.parametrize("name", NAMES)
def test_factors_at_the_reference_frequencies(name):
    frequency, factor = REFERENCE[name]
    assert abs(WEIGHTINGS[name].response(frequency)) == pytest.approx(factor, rel=1e-3)


def test_the_printed_table_of_the_seat():
    found = 1000 * np.abs(WEIGHTINGS["Wk"].response(10 ** (np.arange(len(WK)) / 10)))
    np.testing.assert_allclose(found, WK, rtol=0.012)


@pytest.mark.parametrize("name", NAMES)
def test_the_response_is_that_of_the_formulas(name):
    own, f = WEIGHTINGS[name], np.geomspace(0.01, 3000.0, 200)
    expected = slow_response(*own.limits_hz, f, own.transition, own.step)
    np.testing.assert_allclose(own.response(f), expected, rtol=1e-12)
    assert own.response(0.0) == 0.0


@pytest.mark.parametrize("name", NAMES)
def test_tolerances_change_a_third_octave_within_the_band_and_three_beyond_it(name):
    """ISO 8041-1, in exact third octaves of its edges."""
    own = WEIGHTINGS[name]
    thirds = 10 * np.log10([own.band_hz[0], *own.tolerances_hz, own.band_hz[1]])
    low, first, second, third, last, high = np.round(thirds, 6)
    assert (first - round(low), second - round(low)) == pytest.approx((-3, 1))
    assert (third - round(high), last - round(high)) == pytest.approx((-1, 3))


def tolerance(own, f):
    """By how much a filter may be too high and too low: table 5 of ISO 8041-1."""
    first, second, third, last = own.tolerances_hz
    inner, outer = (f >= second) & (f <= third), (f > first) & (f < last)
    return np.where(inner, 0.12, 0.26), np.where(inner, -0.11, np.where(outer, -0.21, -1.0))


def deviation(own, rate, f):
    """Relative error of gain, and of phase but for a delay [deg]."""
    _, found = sosfreqz(own.sections(rate), 2 * np.pi * f / rate)
    ratio = found / own.response(f)
    return np.abs(ratio) - 1, np.angle(ratio)


@pytest.mark.parametrize("name", NAMES)
@given(octaves=st.floats(0.0, 1.0))
def test_filters_are_within_the_tolerance_up_to_half_of_any_rate(name, octaves):
    own = WEIGHTINGS[name]
    low = max(200.0, own.least_rate_hz) if own.band_hz[1] >= 80 else 200.0
    rate = low * (50_000.0 / low) ** octaves
    f = np.concatenate([np.geomspace(own.limits_hz[0] / 4, 0.5 * rate, 800),
                        np.linspace(0.3 * rate, 0.5 * rate, 400)])  # fmt: skip
    error, _ = deviation(own, rate, np.sort(f))
    high, low_ = tolerance(own, np.sort(f))
    assert np.all(error < high)
    assert np.all(error > low_)
    poles = np.concatenate([np.roots(row[3:]) for row in own.sections(rate)])
    assert np.abs(poles).max() < 1


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    ("rate", "most", "degrees"),
    [(2.3, 0.035, 1.0), (5.0, 0.005, 0.5), (12.5, 1e-3, 0.1), (100.0, 3e-4, 0.05)],
)
def test_filters_follow_gain_and_phase(name, rate, most, degrees):
    own = WEIGHTINGS[name]
    rate *= own.band_hz[1] * 10**0.05
    low, high = own.band_hz
    f = np.geomspace(low, min(high, 0.5 * rate), 400)
    error, phase = deviation(own, rate, f)
    assert 0.95 * np.abs(error).max() < own.error(rate) < most
    assert np.abs(error).max() < most
    # what is a straight line through 0 is a delay: nothing that a person would feel
    phase = np.unwrap(phase)
    delay = (phase @ f) / (f @ f)
    assert np.degrees(np.abs(phase - delay * f)).max() < degrees


@pytest.mark.parametrize("name", NAMES)
def test_a_constant_is_nothing(name):
    own = WEIGHTINGS[name]
    rate = max(200.0, own.least_rate_hz)
    left = sosfilt(own.sections(rate), np.full(round(40 * rate / own.limits_hz[0]), 9.81))
    assert np.abs(left[-10:]).max() < 1e-6


def test_a_filter_is_the_own_of_who_asks_for_it():
    own = WEIGHTINGS["Wk"]
    first = own.sections(1000.0)
    kept = first.copy()
    first *= 0.0
    assert np.array_equal(own.sections(1000.0), kept)


def test_a_filter_at_a_rate_far_above_its_band_is_stable_and_right():
    own, rate, seconds = WEIGHTINGS["Wf"], 50_000.0, 120.0
    time = np.arange(round(rate * seconds)) / rate
    shaken = sosfilt(own.sections(rate), np.sin(2 * np.pi * 0.2 * time))
    last = shaken[-round(20 * rate) :]
    assert np.sqrt(2) * last.std() == pytest.approx(abs(own.response(0.2)), rel=2e-3)


@pytest.mark.parametrize(("name", "rate"), [("Wk", 178.0), ("Wh", 1000.0), ("Wf", 1.0)])
def test_a_rate_too_low_is_refused(name, rate):
    with pytest.raises(ArgumentError, match=rf"sampling rate {rate:g} Hz: {name} counts .* faster"):
        WEIGHTINGS[name].sections(rate)


def test_an_unknown_weighting_is_refused():
    with pytest.raises(ArgumentError, match="weighting='Wz' is not one of Wk, Wd"):
        frequency_weighting("Wz")
    assert frequency_weighting("Wh") is WEIGHTINGS["Wh"]
