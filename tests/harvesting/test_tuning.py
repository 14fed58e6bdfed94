"""The best tuning against brute force, limits that are kept, sets, and refusals."""

from __future__ import annotations

import numpy as np
import pytest

from gearmon.errors import ArgumentError
from gearmon.harvesting.answer import OperatingShare, answer, mean_power_w
from gearmon.harvesting.cantilever import PiezoCantilever
from gearmon.harvesting.inertial import InertialHarvester
from gearmon.harvesting.materials import BEAM_MATERIALS, PIEZO_MATERIALS
from gearmon.harvesting.tuning import (
    evaluate,
    power_against_tuning,
    tune_harvester,
    tune_set,
)
from gearmon.harvesting.vibration import vibration_of_lines, vibration_of_samples


def lines(seed, scale=1.0, speed=1.0, wander=0.0):
    """Five mesh harmonics with four sidebands to either side."""
    rng = np.random.default_rng(seed)
    frequency = np.concatenate([speed * (400 * k + 21.0 * np.arange(-4, 5)) for k in range(1, 6)])
    amplitude = scale * rng.lognormal(-1, 1, frequency.size)
    return vibration_of_lines(frequency, acceleration_ms2=amplitude, wander=wander)


def duty(seed, wander=0.0):
    return [
        OperatingShare(vibration=lines(seed, wander=wander), share=0.7),
        OperatingShare(vibration=lines(seed, 0.5, 0.6, wander), share=0.3),
    ]


def inertial(**changes):
    return InertialHarvester(
        **({"mass_kg": 5e-3, "natural_frequency_hz": 100.0, "highest_hz": 3000.0} | changes)
    )


def bimorph(**changes):
    values = {
        "wiring": "series",
        "piezo": PIEZO_MATERIALS["PZT-5A"],
        "passive": BEAM_MATERIALS["brass"],
        "length_m": 0.015,
        "width_m": 0.01,
        "passive_thickness_m": 0.2e-3,
        "piezo_thickness_m": 0.2e-3,
    }
    return PiezoCantilever(**(values | changes))


def brute_force(harvester, points, frequencies, loads):
    return max(
        mean_power_w(harvester.retuned(float(f)).with_load(float(load)), points)
        for f in frequencies
        for load in loads
    )


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("wander", [0.0, 0.004])
def test_inertial_tuning_equals_brute_force(seed, wander):
    points = duty(seed, wander)
    found = tune_harvester(inertial(), points)
    # half the width of a resonance apart, then finely around the best of those
    rough = np.geomspace(100, 2500, 320)
    loads = np.geomspace(2e-3, 0.1, 6)
    powers = [brute_force(inertial(), points, [f], [0.01]) for f in rough]
    middle = rough[int(np.argmax(powers))]
    near = middle * np.linspace(0.975, 1.025, 100)
    best = brute_force(inertial(), points, near, loads)
    assert found.power_w >= best * (1 - 0.005)


def test_cantilever_tuning_equals_brute_force():
    points = duty(1)
    found = tune_harvester(bimorph(), points)
    low, high = bimorph().frequency_range_hz
    rough = np.geomspace(low * 1.001, high * 0.999, 250)
    best, where = 0.0, 0.0
    for f in rough:
        tuned = bimorph().retuned(float(f))
        for load in np.geomspace(*tuned.load_range, 13)[3:-3]:
            power = mean_power_w(tuned.with_load(float(load)), points)
            if power > best:
                best, where = power, f
    near = [
        mean_power_w(bimorph().retuned(float(f)).with_load(float(load)), points)
        for f in where * np.linspace(0.98, 1.02, 40)
        for load in np.geomspace(1e3, 1e7, 30)
    ]
    assert found.power_w >= max(best, *near) * (1 - 0.005)


def test_single_line_takes_the_matched_resonance():
    v = vibration_of_lines([312.0], acceleration_ms2=[0.8])
    found = tune_harvester(inertial(), [OperatingShare(vibration=v)])
    assert found.power_w == pytest.approx(
        inertial().retuned(312.0).power_bound_w() * 0.64, rel=2e-3
    )
    assert found.harvester.natural_frequency_hz == pytest.approx(312.0, rel=2e-3)


def test_measured_spectrum_is_tuned_like_its_lines():
    t = np.arange(60_000) / 4000.0
    samples = np.cos(2 * np.pi * 260.0 * t) + 0.4 * np.cos(2 * np.pi * 700.0 * t)
    samples += np.random.default_rng(2).normal(scale=0.05, size=len(t))
    heard = vibration_of_samples(samples, 4000.0)
    found = tune_harvester(inertial(), [OperatingShare(vibration=heard)])
    assert found.harvester.natural_frequency_hz == pytest.approx(260.0, rel=3e-3)
    bound = inertial().retuned(260.0).power_bound_w()
    assert found.power_w == pytest.approx(bound, rel=0.01)


@pytest.mark.parametrize("clearance_um", [30.0, 3.0])
def test_travel_limit_is_kept_and_used(clearance_um):
    points = [OperatingShare(vibration=vibration_of_lines([300.0], acceleration_ms2=[5.0]))]
    limited = inertial(clearance_m=clearance_um * 1e-6)
    found = tune_harvester(limited, points)
    assert found.within_limits
    assert found.travel_share > 0.97
    # P = m ze wn w^2 Z^2 with the travel Z at its limit and just enough damping
    w = 2 * np.pi * 300.0
    total = 5.0 / (2 * w**2 * limited.clearance_m)
    closed = limited.mass_kg * (total - 0.01) * w**3 * limited.clearance_m**2
    assert found.power_w >= 0.97 * closed


def test_stress_limit_is_kept():
    loud = [OperatingShare(vibration=vibration_of_lines([500.0], acceleration_ms2=[150.0]))]
    found = tune_harvester(bimorph(), loud)
    assert found.within_limits
    free = evaluate(found.harvester.retuned(500.0), loud)
    assert free.stress_share > 1  # on the line itself the beam would break


def test_impossible_limits_are_refused_with_the_nearest():
    loud = [OperatingShare(vibration=vibration_of_lines([500.0], acceleration_ms2=[500.0]))]
    with pytest.raises(ArgumentError, match=r"clearance .* the nearest, .* Hz, travels"):
        tune_harvester(inertial(clearance_m=1e-9), loud)
    with pytest.raises(ArgumentError, match=r"stress .* the nearest"):
        tune_harvester(bimorph(), [OperatingShare(vibration=lines(1, 3000.0))])
    with pytest.raises(ArgumentError, match="nothing vibrates between"):
        tune_harvester(inertial(highest_hz=12.0, natural_frequency_hz=10.0), loud)


def test_line_powers_add_to_the_power():
    points = duty(4, 0.003)
    found = tune_harvester(inertial(), points)
    for part in found.answers:
        assert part.line_power_w.sum() == pytest.approx(part.power_w, rel=1e-12)


def test_power_by_tuning_has_its_top_at_the_best():
    points = duty(5)
    found = tune_harvester(inertial(), points)
    best = found.harvester.natural_frequency_hz
    grid = np.array([best * 0.97, best, best * 1.03])
    power = power_against_tuning(found.harvester, points, grid)
    assert power.argmax() == 1
    assert power[1] == pytest.approx(found.power_w, rel=1e-3)


def test_copies_are_the_best_set_for_the_mean():
    points = duty(6)
    best = tune_harvester(inertial(), points)
    chosen = tune_set(inertial(), points, 3, "mean")
    assert sum(t.power_w for t in chosen) == pytest.approx(3 * best.power_w, rel=5e-3)


def test_worst_point_is_better_served_by_different_ones():
    points = duty(7)
    copies = [tune_harvester(inertial(), points)] * 2
    chosen = tune_set(inertial(), points, 2, "worst")

    def worst(group):
        return min(sum(t.answers[k].power_w for t in group) for k in range(2))

    assert worst(chosen) > 1.5 * worst(copies)


def test_bad_arguments_are_refused():
    with pytest.raises(ArgumentError, match="objective"):
        tune_set(inertial(), duty(1), 2, "median")
    with pytest.raises(ArgumentError, match="count"):
        tune_set(inertial(), duty(1), 4)
    with pytest.raises(ArgumentError, match="no operating point"):
        tune_harvester(inertial(), [])
    with pytest.raises(ArgumentError, match="sum to"):
        tune_harvester(inertial(), [*duty(1), *duty(1)])
    with pytest.raises(ArgumentError, match="share"):
        OperatingShare(vibration=lines(1), share=0.0)


def test_peak_of_one_line_is_its_amplitude():
    h = inertial(natural_frequency_hz=200.0)
    v = vibration_of_lines([180.0], acceleration_ms2=[2.0])
    assert answer(h, v).travel_m == pytest.approx(2.0 * h.gains(180.0).travel_m[0], rel=1e-12)
