"""Recordings through the filter of a harvester equal marching through its coupled equations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from reference.marching import marched_answer, marched_with_stops
from scipy.signal import lfilter

from gearmon.errors import ArgumentError
from gearmon.harvesting.harvester import CoilHarvester, InertialHarvester
from gearmon.harvesting.response import power_with_stops, respond
from gearmon.harvesting.tuning import built_in

RATE = 3200.0


def heard(seed, seconds, wander, memory_s, noise):
    """Two lines that wander together, in noise."""
    rng = np.random.default_rng(seed)
    count = int(seconds * RATE)
    kept = np.exp(-1 / (memory_s * RATE))
    drift = rng.normal(size=count) * np.sqrt(1 - kept**2)
    drift[0] = rng.normal()
    turn = np.cumsum(1 + wander * lfilter([1.0], [1.0, -kept], drift)) / RATE
    lines = np.cos(2 * np.pi * 310.0 * turn) + 0.5 * np.cos(2 * np.pi * 930.0 * turn + 1)
    samples = lines + noise * rng.normal(size=count)
    return samples - samples.mean()


HARVESTERS = {
    "beam": built_in()[0].retuned(300.0),
    "spring": InertialHarvester(mass_kg=5e-3, natural_frequency_hz=308.0),
    "coil": CoilHarvester(
        mass_kg=5e-3,
        natural_frequency_hz=308.0,
        turns=500.0,
        field_length_tm=5e-3,
        coil_ohm=50.0,
        coil_henry=0.02,
    ),
}


@pytest.mark.parametrize("kind", HARVESTERS)
@pytest.mark.parametrize(
    ("seconds", "wander", "memory_s", "noise"),
    [(3, 0.0, 1.0, 1e-3), (12, 0.005, 0.05, 1.0), (20, 0.02, 5.0, 0.1)],
)
def test_power_and_peaks_are_those_of_marching(kind, seconds, wander, memory_s, noise):
    samples = heard(3, seconds, wander, memory_s, noise)
    found = respond(HARVESTERS[kind], samples, RATE)
    power, peaks = marched_answer(HARVESTERS[kind], samples, RATE, times=12)
    assert found.power_w == pytest.approx(power, rel=0.01)
    np.testing.assert_allclose(found.peaks[: len(peaks)], peaks, rtol=0.05)


@pytest.mark.parametrize("kind", HARVESTERS)
def test_an_offset_of_a_sensor_is_no_vibration(kind):
    samples = heard(3, 4, 0.0, 1.0, 0.1)
    still, offset = (respond(HARVESTERS[kind], samples + own, RATE) for own in (0.0, 1e3))
    assert offset.power_w == pytest.approx(still.power_w, rel=1e-6)
    np.testing.assert_allclose(offset.peaks, still.peaks, rtol=1e-6)


def test_a_longer_recording_does_not_change_the_power():
    whole = heard(5, 120, 0.005, 0.3, 0.01)
    long = respond(HARVESTERS["beam"], whole, RATE)
    parts = [respond(HARVESTERS["beam"], part, RATE).power_w for part in np.split(whole, 40)]
    assert np.mean(parts) == pytest.approx(long.power_w, rel=0.03)


@pytest.mark.parametrize("kind", HARVESTERS)
@pytest.mark.parametrize(("room", "restitution"), [(0.4, 0.5), (0.7, 0.9)])
def test_power_with_stops_is_that_of_small_steps(kind, room, restitution):
    samples = 5 * heard(7, 1.0, 0.0, 1.0, 0.1)
    free = respond(HARVESTERS[kind], samples, RATE).peaks[1]
    limits = {"clearance_m": room * float(free), "restitution": restitution}
    tight = replace(HARVESTERS[kind], weight_ms2=9.81, **limits)
    found = power_with_stops(tight, samples, RATE)
    slow = marched_with_stops(tight, samples, RATE, restitution)
    assert found == pytest.approx(slow, rel=0.004)


def test_half_and_nearly_all_steps_stay_below_what_is_told():
    """Shaken ever more, far below its resonance, by a sine that grows evenly to its full size."""
    h = InertialHarvester(mass_kg=5e-3, natural_frequency_hz=1000.0, mechanical_damping_ratio=0.05)
    count = int(20 * RATE)
    ramp = np.arange(count) / count
    found = respond(h, ramp * np.cos(2 * np.pi * 50.0 * np.arange(count) / RATE), RATE)
    half, nearly_all = found.quantiles["travel_m"]
    assert nearly_all / half == pytest.approx(0.99 / 0.5, rel=0.01)
    assert 0.9 * found.travel_m < nearly_all < found.travel_m


def test_loads_of_a_coil_reach_a_hundredfold_beyond_the_best_at_resonance():
    """The matched load is what the coil has, and what the spring loses seen through it."""
    coil = CoilHarvester(
        mass_kg=5e-3, natural_frequency_hz=308.0, turns=500.0, field_length_tm=5e-3, coil_ohm=50.0
    )
    loads = np.geomspace(*coil.usual_loads, 4001)
    powers = [coil.with_load(own).gains(308.0).power_w[0] for own in loads]
    best = 50.0 + 2.5**2 / (2 * 5e-3 * 0.01 * 2 * np.pi * 308.0)
    assert loads[int(np.argmax(powers))] == pytest.approx(best, rel=0.01)
    assert coil.usual_loads == pytest.approx((0.5, 100 * best))


def test_stops_out_of_reach_change_nothing():
    samples = heard(8, 4, 0.0, 1.0, 0.1)
    h = HARVESTERS["spring"]
    assert power_with_stops(h, samples, RATE) == pytest.approx(
        respond(h, samples, RATE).power_w, rel=0.01
    )


def test_too_short_a_recording_says_how_long_it_should_be():
    with pytest.raises(ArgumentError, match="record at least"):
        respond(HARVESTERS["beam"], heard(1, 0.1, 0.0, 1.0, 0.1), RATE)
