"""Spectra of recordings: peaks read right, lines of the machine named."""

from __future__ import annotations

import numpy as np
import pytest
from reference.simulated_machines import two_stages
from reference.small_gearbox import as_json, machine, recording
from reference.synthetic_signals import lines_on, white

from gearmon.errors import ArgumentError
from gearmon.gears.kinematics import kinematics
from gearmon.signals import spectra
from gearmon.signals.recording import Recording
from gearmon.signatures.measured.line_plan import machine_marks, mark_near
from gearmon.signatures.recording_spectrum import (
    _ENVELOPE_LEVELS,
    KINDS,
    highest_peaks,
    order_spectra,
    recording_spectrum,
)

RATE = 4096.0


def tones():
    time = np.arange(8192) / RATE
    samples = 3.0 * np.cos(2 * np.pi * 100.13 * time) + np.cos(2 * np.pi * 700.77 * time + 1)
    return Recording(samples=samples[None], sampling_rate_hz=RATE, units=("m/s2",))


def test_peaks_are_read_between_the_lines():
    first, second = recording_spectrum(tones(), most_peaks=2).peaks
    assert first["frequency_hz"] == pytest.approx(100.13, abs=1e-3)
    assert first["value"] == pytest.approx(3.0, abs=1e-3)
    assert second["value"] == pytest.approx(1.0, abs=1e-3)
    root = recording_spectrum(tones(), "rms", most_peaks=1).peaks[0]
    assert root["value"] == pytest.approx(3 / np.sqrt(2), abs=1e-3)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_gives_rows_and_json(kind):
    found = recording_spectrum(recording(), kind, most_peaks=3)
    rows = found.rows()
    assert rows
    assert as_json(found.to_dict())["kind"] == kind
    assert all(np.isfinite(v) for v in rows[0].values() if not isinstance(v, str))
    own = {"density": "(m/s2)^2/Hz", "energy": "(m/s2)^2", "cepstrum": "1", "kurtogram": "1"}
    assert set(found.units) == {own.get(kind, "m/s2")}
    if kind != "kurtogram":
        shown = "" if kind == "cepstrum" else f" [{found.units[0]}]"
        assert list(rows[0])[1:] == [f"{name}{shown}" for name in found.channel_names]


def test_lines_of_the_machine_are_named():
    found = recording_spectrum(recording(), machine=machine(), most_peaks=5)
    names = {mark.name for mark in found.marks}
    assert {"shaft 1 ×1", "shaft 2 ×1", "mesh 1 ×1"} <= names
    assert any("mesh 1" in peak["near"] for peak in found.peaks)


def test_a_band_cuts_the_axis():
    found = recording_spectrum(tones(), band=(600.0, 800.0), most_peaks=1)
    assert found.place[0] >= 600.0
    assert found.peaks[0]["value"] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"kind": "power"}, "kind='power'"),
        ({"band": (5.0, 3.0)}, "low must be below high"),
        ({"band": (5.0, 5000.0)}, "band high=5000"),
        ({"band": (5.0, 0.51 * RATE)}, "band high=2088"),
        ({"kind": "cepstrum", "band": (0.1, 1.01)}, "band high=1.01"),
        ({"band": (5.0, 5.01)}, "fewer than two lines"),
        ({"kind": "kurtogram", "band": (1.0, 2.0)}, "leave the band out"),
        ({"window_name": "none"}, "window='none'"),
    ],
)
def test_impossible_requests_are_refused(given, words):
    with pytest.raises(ArgumentError, match=words):
        recording_spectrum(tones(), **given)


def test_marks_that_coincide_carry_both_names():
    marks = machine_marks(machine(), 10.0, 1000.0)
    assert [mark.place for mark in marks] == sorted(mark.place for mark in marks)
    assert mark_near(marks, 230.4, 1.0) == "mesh 1 ×1"
    assert mark_near(marks, 235.0, 1.0) == ""


def test_highest_peaks_keep_their_distance():
    values = np.array([0, 5, 4, 4.5, 0, 3, 0.0])
    assert highest_peaks(values, 5, 1).tolist() == [1, 3, 5]
    assert highest_peaks(values, 5, 3).tolist() == [1, 5]


def test_orders_of_any_shaft():
    first = order_spectra(recording(), machine(), most_peaks=3)
    second = order_spectra(recording(), machine(), 2, most_peaks=3)
    assert any("mesh 1" in peak["near"] for peak in first.peaks)
    mesh = {mark.name: mark.place for mark in second.marks}["mesh 1 ×1"]
    assert mesh == pytest.approx(57.0)
    assert second.place[-1] / first.place[-1] == pytest.approx(57 / 23, rel=0.01)
    # the map has shorter blocks: the mesh line, clear of others, reads the same in it
    assert first.map.resolution > first.resolution
    told = first.to_dict()
    assert told["resolution_orders"] == first.resolution
    assert told["map"]["resolution_orders"] == first.map.resolution
    ours, seen = first.map.order, np.sqrt(np.mean(first.map.amplitude**2, axis=0))
    for row in range(2):
        line = first.values[row, np.abs(first.place - 23) < 0.1].max()
        assert seen[row, np.abs(ours - 23) < 0.3].max() == pytest.approx(line, rel=0.2)
    assert first.map.speed_hz.mean() == pytest.approx(2960 / 60, rel=0.03)


@pytest.mark.parametrize("shaft", [1, 2])
def test_a_map_has_half_overlapped_blocks_for_two_dozen_rows_of_its_own_shaft(shaft):
    found = order_spectra(recording(), machine(), shaft, most_peaks=0)
    turned = np.ptp(found.signature.track.turns) * (1.0 if shaft == 1 else 23 / 57)
    # but for a length that is transformed quickly
    assert found.map.block_turns == pytest.approx(np.clip(turned / 12, 8.0, 40.0), rel=0.05)


@pytest.mark.parametrize(
    ("given", "words"), [({"shaft": 3}, "shaft"), ({"top": 1e6}, "highest order 1000000.0")]
)
def test_impossible_orders_are_refused(given, words):
    with pytest.raises(ArgumentError, match=words):
        order_spectra(recording(), machine(), **given)


@pytest.mark.parametrize("place", [0, 1])
def test_the_envelope_is_that_of_the_band_with_the_highest_kurtosis_of_all_channels(place):
    """Rare bursts at 500 Hz in one channel, frequent ones at 1700 Hz in the other."""
    rng = np.random.default_rng(5)
    samples = 0.01 * rng.standard_normal((2, 16384))
    burst = np.exp(-np.arange(200) / 25.0)
    for row, centre, times in ((place, 500.0, 12), (1 - place, 1700.0, 90)):
        for start in rng.integers(0, 16000, times):
            wave = burst * np.sin(2 * np.pi * centre * np.arange(200) / RATE)
            samples[row, start : start + 200] += wave
    both = Recording(samples=samples, sampling_rate_hz=RATE, units=("m/s2", "m/s2"))
    low, high, kurtosis = spectra.kurtogram(samples[place], RATE, _ENVELOPE_LEVELS).best
    other = spectra.kurtogram(samples[1 - place], RATE, _ENVELOPE_LEVELS).best
    assert kurtosis > 1.5 * other[2]
    assert high < other[1]
    (note,) = [own for own in recording_spectrum(both, "envelope").notes if "kurtogram" in own]
    assert f"kurtogram of {both.channel_names[place]} " in note
    assert note.startswith(f"band {low:.6g} to {high:.6g} Hz")


def test_what_repeats_stands_at_its_rate_in_the_envelope_and_at_its_period_in_the_cepstrum():
    """A tone swelling by half at 37.5 Hz, and knocks 80 samples apart."""
    time = np.arange(8192) / RATE
    swelling = 2.0 * (1 + 0.5 * np.cos(2 * np.pi * 37.5 * time)) * np.cos(2 * np.pi * 1000 * time)
    knocks = np.sin(0.9 * np.arange(40)) * np.exp(-np.arange(40) / 8)
    knocking = np.convolve(np.arange(8192) % 80 == 0, knocks)[:8192]
    both = Recording(samples=np.stack([swelling, knocking]), sampling_rate_hz=RATE)
    found = recording_spectrum(both, "envelope", band=(800.0, 1200.0), most_peaks=1).peaks[0]
    assert found["frequency_hz"] == pytest.approx(37.5, abs=0.01)
    assert found["value"] == pytest.approx(1.0, rel=1e-3)
    found = recording_spectrum(both, "cepstrum", most_peaks=1).peaks[1]
    assert found["quefrency_s"] == pytest.approx(80 / RATE, abs=0.1 / RATE)


def test_the_peak_of_a_kurtogram_is_its_highest_row_and_holds_the_knocks():
    rng = np.random.default_rng(3)
    knock = np.exp(-np.arange(200) / 50.0) * np.sin(2 * np.pi * 700.0 * np.arange(200) / RATE)
    samples = 0.1 * rng.standard_normal(16384)
    for start in rng.integers(0, 16000, 12):
        samples[start : start + 200] += knock
    found = recording_spectrum(Recording(samples=samples[None], sampling_rate_hz=RATE), "kurtogram")
    (peak,) = found.peaks
    assert peak["low_hz"] < 700.0 < peak["high_hz"]
    highest = max(found.rows(), key=lambda row: row["kurtosis"])
    assert {name: highest[name] for name in peak} == peak


def test_orders_are_shown_to_a_tenth_above_the_eighth_harmonic_of_the_fastest_mesh():
    """Of a train of a slow mesh and a fast one, where the sampling rate allows."""
    train = two_stages()
    rate, order = 40_000.0, max(own.order for own in kinematics(train).meshes)
    turns = 25.0 * np.arange(80_000) / rate
    orders = [own.order * n for own in kinematics(train).meshes for n in (1, 2, 3)]
    samples = lines_on(turns, orders, 1.0) + white((1, len(turns)), 0.1, seed=1)
    found = order_spectra(Recording(samples=samples, sampling_rate_hz=rate), train)
    assert found.place[-1] == pytest.approx(1.1 * 8 * order, rel=1e-2)


@pytest.mark.parametrize("rise", [0.01, 0.04])
def test_a_line_is_smeared_by_half_the_range_of_the_speed_about_its_mark(rise):
    """All its power is there: of an even rise, through a Hann window w, as the integral of w^2."""
    rate, last_s = 4000.0, 4.0
    time_s = np.arange(round(rate * last_s)) / rate
    turns = 49.0 * time_s * (1 + 0.5 * rise * (time_s / last_s - 1))
    samples = lines_on(turns, [23.0, 46.0, 24.0], [1.0, 0.5, 0.1]) + white((1, len(turns)), 0.02)
    given = Recording(
        samples=np.vstack([samples, 5.0 * (turns % 1.0 < 0.3)]),
        sampling_rate_hz=rate,
        channel_names=("a1", "tacho"),
        channel_kinds=("vibration", "tacho"),
        units=("m/s2", "V"),
    )
    found = recording_spectrum(given, "energy", machine=machine(), most_peaks=1)
    assert found.wander == pytest.approx(0.5 * rise, rel=0.05)
    place = next(mark.place for mark in found.marks if mark.name == "mesh 1 ×1")
    away = np.abs(found.place - place) / place
    power, about = found.values[0], away < 3 * found.wander
    for share in (0.25, 0.5, 1.0):
        inside = power[away < share * found.wander].sum() / power[about].sum()
        swept = np.pi * share
        part = (3 * swept + 4 * np.sin(swept) + 0.5 * np.sin(2 * swept)) / (3 * np.pi)
        assert inside == pytest.approx(part, abs=0.03)


def test_lines_between_the_bins_are_read_at_their_orders_with_their_heights():
    """A parabola through logarithms is off by 0.016 bins and 4 % at most."""
    rate = 5000.0
    turns = 25.0 * np.arange(20_000) / rate
    foreign = 31.0 + 0.8193 * np.arange(1, 6)
    orders = [26.0, 52.0, 78.0, *foreign]
    samples = lines_on(turns, orders, [1.0] * 3 + [0.5] * 5) + white((1, len(turns)), 1e-3, seed=1)
    given = Recording(samples=samples, sampling_rate_hz=rate)
    found = order_spectra(given, two_stages(), most_peaks=8)
    step = found.place[1] - found.place[0]
    assert np.ptp(foreign / step % 1.0) > 0.5
    read = sorted((peak["order"], peak["amplitude"]) for peak in found.peaks)
    places, heights = np.array(read).T
    np.testing.assert_allclose(places, sorted(orders), atol=0.03 * step)
    np.testing.assert_allclose(heights, [1.0, *[0.5] * 5, 1.0, 1.0], rtol=0.045)
