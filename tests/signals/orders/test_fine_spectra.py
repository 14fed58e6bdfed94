"""Fine spectra against angle and time: closed forms, and the laws of their noise."""

from __future__ import annotations

import numpy as np
import pytest
from reference.synthetic_signals import lines_on, track_of, wandering_turns, white

from gearmon.errors import ArgumentError
from gearmon.signals.orders import InAngle, clear_peaks, fine_order_spectrum, fine_spectrum
from gearmon.signals.orders import spectra as module
from gearmon.signals.orders.lines import OrderBlocks
from gearmon.signals.orders.spectra import FineSpectrum, fine_envelope_spectrum

RATE, DURATION, SPEED = 4000.0, 6.0, 20.0
TIME = np.arange(round(RATE * DURATION)) / RATE


def angle(time_s, wander=0.01):
    return wandering_turns(time_s, SPEED, wander, seed=1)


TRACK = track_of(angle, DURATION, 200)


def highest(spectrum, place):
    near = 0.6 * spectrum.step
    return spectrum.highest_near(np.array([place - near]), np.array([place + near]))[:, 0]


@pytest.mark.parametrize("order", [0.37, 3.3, 17.123, 61.2])
def test_line_reads_its_squared_amplitude_against_angle(order):
    spectrum = fine_order_spectrum(InAngle.of(lines_on(angle(TIME), order, 0.7), RATE, TRACK))
    # half a bin of twice padded Hann costs at most 0.14 dB, twice that with its curvature
    assert highest(spectrum, order)[0] == pytest.approx(0.49, rel=0.08)


@pytest.mark.parametrize("order", [3.3, 17.123, 61.2, 88.8])
def test_steps_of_order_lines_serve_the_spectrum_as_well(order):
    samples = lines_on(angle(TIME), order, 0.7) + white((1, len(TIME)), 0.1, seed=5)
    orders = np.array([order, order + 1.0])
    few, held = (
        OrderBlocks(samples, RATE, TRACK, orders, 20.0, 1e-4, held=held) for held in (False, True)
    )
    shared = fine_order_spectrum(held.signals)
    assert highest(shared, order)[0] == pytest.approx(0.49, rel=0.08)
    alone = fine_order_spectrum(InAngle.of(samples, RATE, TRACK))
    assert np.median(shared.floor) == pytest.approx(np.median(alone.floor), rel=0.03)
    np.testing.assert_allclose(held.lines().amplitude, few.lines().amplitude, atol=1e-3)
    np.testing.assert_allclose(held.noise(), few.noise(), rtol=0.3)


@pytest.mark.parametrize("hertz", [50.0, 333.3, 1500.0])
@pytest.mark.parametrize("offset", [0.0, 100.0])
def test_line_reads_its_squared_amplitude_against_time(hertz, offset):
    spectrum = fine_spectrum(0.7 * np.cos(2 * np.pi * hertz * TIME)[None] + offset, RATE)
    assert highest(spectrum, hertz)[0] == pytest.approx(0.49, rel=0.08)


def test_line_is_sharper_on_its_own_grid():
    samples = lines_on(angle(TIME), 12.3, 1.0) + np.cos(2 * np.pi * 333.0 * TIME)
    by_angle = fine_order_spectrum(InAngle.of(samples, RATE, TRACK))
    by_time = fine_spectrum(samples, RATE)
    smear = np.array([0.97, 1.03])
    turning = highest(by_angle, 12.3)[0]
    assert turning > 3 * by_time.highest_near(*(12.3 * SPEED * smear[:, None]))[0, 0]
    standing = highest(by_time, 333.0)[0]
    assert standing > 3 * by_angle.highest_near(*(333.0 / SPEED * smear[:, None]))[0, 0]


@pytest.mark.parametrize("pieces", [1, 3, 20])
def test_noise_has_its_mean_power(pieces):
    spectrum = fine_spectrum(white((1, 60_000), 2.0, seed=3), RATE, pieces)
    # a line of amplitude A has the power A^2/2; the Hann window lets 1.5 bins of noise in
    assert spectrum.pieces == min(pieces, 8)
    expected = 2 * 4.0 * 1.5 * 2 / (60_000 // pieces)
    assert spectrum.power[:, 10:-10].mean() == pytest.approx(expected, rel=0.03)


def test_of_many_pieces_some_are_heard():
    spectrum = fine_spectrum(white((1, 24_000), seed=3), RATE, 40)
    assert spectrum.pieces == 8
    assert spectrum.width == pytest.approx(RATE / 600)


@pytest.mark.parametrize("spectrum_of", [fine_order_spectrum, "time"])
def test_peaks_are_the_lines_and_not_their_side_lobes(spectrum_of):
    orders, sizes = [5.3, 9.07, 33.5], [1.0, 0.03, 0.1]
    noise = white((1, len(TIME)), 0.01, seed=5)
    if spectrum_of == "time":
        spectrum, scale = fine_spectrum(lines_on(SPEED * TIME, orders, sizes) + noise, RATE), SPEED
    else:
        samples = lines_on(angle(TIME), orders, sizes) + noise
        spectrum, scale = fine_order_spectrum(InAngle.of(samples, RATE, TRACK)), 1.0
    peaks = spectrum.step * clear_peaks(spectrum, 40.0) / scale
    np.testing.assert_allclose(peaks, orders, atol=spectrum.step / scale)


def test_channels_that_place_a_line_differently_give_one_peak():
    samples = np.vstack([lines_on(SPEED * TIME, o, 1.0) for o in (10.0, 10.005)])
    spectrum = fine_spectrum(samples + white(samples.shape, 0.01, seed=1), RATE)
    assert len(clear_peaks(spectrum, 40.0)) == 1


def test_noise_alone_has_few_peaks():
    spectrum = fine_spectrum(white((2, 60_000), seed=9), RATE)
    # 2^-27 of the bins, were they independent
    assert len(clear_peaks(spectrum, 27.0)) == 0


def test_envelope_shows_the_modulation_of_noise_at_any_gain():
    depth = 0.5
    shape = np.sqrt(1 + depth * np.cos(2 * np.pi * 3.7 * angle(TIME)))
    samples = white((1, len(TIME)), seed=2) * shape
    one = fine_envelope_spectrum(InAngle.of(samples, RATE, TRACK), 20.0)
    place = int(np.argmax(one.power[0])) * one.step
    assert place == pytest.approx(3.7, abs=one.step)
    assert highest(one, 3.7)[0] == pytest.approx(depth**2, rel=0.35)
    other = fine_envelope_spectrum(InAngle.of(1e-3 * samples, RATE, TRACK), 20.0)
    np.testing.assert_allclose(other.power, one.power, rtol=1e-6)


def test_strong_lines_do_not_rule_the_envelope():
    shape = 1 + 0.6 * np.cos(2 * np.pi * 3.7 * angle(TIME))
    beat = lines_on(angle(TIME), [30.0, 31.3], 20.0)
    samples = white((1, len(TIME)), seed=2) * shape + beat
    spectrum = fine_envelope_spectrum(InAngle.of(samples, RATE, TRACK), 20.0)
    assert highest(spectrum, 3.7)[0] > 10 * highest(spectrum, 1.3)[0]


def test_bad_arguments_are_refused():
    samples = white((1, 100), seed=1)
    with pytest.raises(ArgumentError, match="pieces=50"):
        fine_spectrum(samples, RATE, 50)
    with pytest.raises(ArgumentError, match="sampling_rate_hz"):
        fine_spectrum(samples, 0.0)
    with pytest.raises(ArgumentError, match="top_order"):
        fine_envelope_spectrum(InAngle.of(samples, RATE, TRACK), 0.0)


def test_no_more_than_eight_pieces_are_heard():
    samples = white((1, len(TIME)), seed=6)
    assert fine_spectrum(samples, RATE, 10).pieces == 8
    assert fine_order_spectrum(InAngle.of(samples, RATE, TRACK), 10).pieces == 8
    assert fine_envelope_spectrum(InAngle.of(samples, RATE, TRACK), 10.0, 10).pieces == 8
    heard = [fine_spectrum(part, RATE).power for part in np.split(samples, 2, axis=1)]
    np.testing.assert_allclose(fine_spectrum(samples, RATE, 2).power, np.mean(heard, axis=0))


@pytest.mark.parametrize("count", [1000, 1003])
def test_whitened_envelope_is_that_of_the_analytic_signal(count):
    samples = white((2, count), seed=7)
    length = module.fast_length(count)
    lines = np.fft.rfft(samples - samples.mean(axis=1, keepdims=True), length)
    lines[:, [0, -1]] = 0.0
    lines[:, 1:-1] /= np.abs(lines[:, 1:-1])
    analytic = np.fft.ifft(lines, length, norm="forward")
    found = module._whitened_envelope(samples)
    np.testing.assert_allclose(found, np.abs(analytic[:, : count // 2 * 2 : 2]) ** 2, rtol=1e-9)


@pytest.mark.parametrize("pieces", [1, 3])
def test_quality_peaks_at_the_lines(pieces):
    samples = lines_on(angle(TIME), [7.25, 13.0], [0.5, 0.5])
    samples = np.vstack([samples, 1e3 * samples]) + white((2, len(TIME)), seed=5) * [[1.0], [1e3]]
    found = fine_order_spectrum(InAngle.of(samples, RATE, TRACK), pieces)
    quality, bin_order = found.quality, found.step
    peaks = np.sort(np.argsort(quality)[-6:]) * bin_order
    near = np.minimum(np.abs(peaks - 7.25), np.abs(peaks - 13.0))
    assert quality[round(7.25 / bin_order)] > 4
    assert quality[round(13.0 / bin_order)] > 4
    assert near.max() <= 2.5 * bin_order
    assert np.median(quality) < 1.5
    # the scale of a channel does not matter
    other = fine_order_spectrum(InAngle.of(samples * [[5.0], [0.01]], RATE, TRACK), pieces).quality
    np.testing.assert_allclose(other, quality, rtol=1e-6)


@pytest.mark.parametrize("heights", [(50.0, 200.0), (200.0, 50.0)])
def test_of_a_peak_that_channels_place_differently_the_clearest_is_taken(heights):
    power = np.ones((2, 400))
    power[0, 100], power[1, 102] = heights
    power[:, 300] = 90.0
    spectrum = FineSpectrum(power=power, floor=np.ones_like(power), step=1.0, width=4.0, pieces=1)
    clearest = 100 if heights[0] > heights[1] else 102
    assert clear_peaks(spectrum, 10.0).tolist() == [clearest, 300]
    assert clear_peaks(spectrum, 1e3).tolist() == []


@pytest.mark.parametrize("power", [0, 1, 2])
def test_floor_follows_noise_that_rises_towards_zero(power):
    generator, count = np.random.default_rng(power), 1 << 16
    lines = generator.standard_normal((40, count // 2, 2)) @ [1.0, 1j]
    lines /= np.arange(1.0, count // 2 + 1) ** (power / 2)
    spectrum = fine_spectrum(np.fft.irfft(lines, count), 1000.0)
    # over many recordings the median of noise lies at the floor, from a dozen bins on
    above = np.median(spectrum.power / spectrum.floor, axis=0)
    averaged = above[16:4096].reshape(-1, 16).mean(axis=1)
    np.testing.assert_allclose(averaged, 1.0, atol=0.4)


@pytest.mark.parametrize("bins", [2, 4, 10])
@pytest.mark.parametrize("side", [-1, 1])
def test_a_weaker_line_shows_beside_a_strong_one_where_side_lobes_are_lower(bins, side):
    """By its distance in widths, of however many bins; a main lobe holds one line."""
    floor, strong = np.full((1, 400 * bins), 1e-9), 200 * bins
    shown_from_db = {1.6: np.inf, 2.5: -24.0, 3.6: -24.0, 4.6: -42.2, 15.6: -42.2, 16.6: -80.0}
    for widths, least_db in shown_from_db.items():
        for level_db in np.clip([least_db - 1.0, least_db + 1.0], -70.0, -0.1):
            power, weaker = floor.copy(), strong + side * round(widths * bins)
            power[0, strong], power[0, weaker] = 1.0, 10 ** (level_db / 10)
            spectrum = FineSpectrum(power=power, floor=floor, step=0.1, width=0.1 * bins, pieces=1)
            shown = sorted([strong, weaker] if level_db > least_db else [strong])
            assert clear_peaks(spectrum, 10.0).tolist() == shown
