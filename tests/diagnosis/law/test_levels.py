"""The law of levels: what cancels, what is learned, what is left out."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from reference.small_gearbox import machine, recording

from gearmon.diagnosis.analysis import learn
from gearmon.diagnosis.evidence import PathChange, path_change
from gearmon.diagnosis.law.gear_lines import FULL_LOAD, LENGTH
from gearmon.diagnosis.law.machine import HealthyMachine, level_deviation
from gearmon.signatures.measured.line_plan import Family
from gearmon.signatures.measured.measurement import measure_signature
from gearmon.signatures.measured.reference import Levels, Profile

HERE, SOME = np.zeros(2), np.zeros((1, 2))


def held(new, known, states=None, state=HERE, told=None):
    healthy = [levels(one) for one in np.asarray(known, dtype=float)]
    where = np.zeros((len(known), 2)) if states is None else np.asarray(states, dtype=float)
    return level_deviation(levels(new, told=told), healthy, where, state)


def levels(level, error=0.0, told=None):
    heard = np.ones(level.shape, dtype=bool) if told is None else told
    return Levels(level, np.full(level.shape, error), heard)


def test_a_gain_of_a_channel_leaves_nothing():
    known = np.random.default_rng(1).normal(size=(1, 2, 20))
    found = held(known[0] + np.array([[6.0], [-3.0]]), known)
    assert np.abs(found.rest_db).max() < 1e-12
    assert found.gain_db == pytest.approx([6.0, -3.0])
    assert found.mean_square() < 1e-20


def test_sensors_may_have_another_gain_in_every_recording():
    """Neither what is left nor how much of it is healthy hangs on them."""
    rng = np.random.default_rng(7)
    known, new = 2.0 * rng.normal(size=(4, 2, 30)), rng.normal(size=(2, 30))
    states = rng.normal(size=(4, 2))
    plain = held(new, known, states)
    gains = 10.0 * rng.normal(size=(5, 2, 1))
    found = held(new + gains[0], known + gains[1:], states)
    np.testing.assert_allclose(found.rest_db, plain.rest_db, atol=1e-10)
    np.testing.assert_allclose(found.sigma_db, plain.sigma_db, atol=1e-10)
    assert found.mean_square() == pytest.approx(plain.mean_square())


def test_noise_of_the_assumed_size_is_of_mean_square_one():
    rng = np.random.default_rng(2)
    # 0.1 Np, the prior of families of lines, in each of two recordings
    known = 0.1 * 8.686 * rng.normal(size=(2, 1, 1, 4000))
    assert held(known[0][0], known[1]).mean_square() == pytest.approx(1.0, rel=0.1)


def test_a_change_with_load_is_explained_where_it_was_learned():
    rng = np.random.default_rng(3)
    slope = 4.0 * rng.normal(size=(1, 40))
    states = [[-0.5, 0.0], [0.5, 0.0]]
    known = np.array([-0.5 * slope, 0.5 * slope])
    between = held(0.1 * slope, known, states, np.array([0.1, 0.0]))
    assert np.abs(between.rest_db).max() < 0.15 * np.abs(0.1 * slope).max() + 0.3
    hurt = 0.1 * slope.copy()
    hurt[0, :10] += 10.0
    found = held(hurt, known, states, np.array([0.1, 0.0]))
    assert found.mean_square() > 4 * between.mean_square() + 1


def test_references_that_depart_from_one_another_widen_the_law():
    rng = np.random.default_rng(4)
    known = rng.normal(size=(4, 1, 60))
    wild = held(known[0, 0:1] * 0 + 3.0 * rng.normal(size=(1, 60)), 5.0 * known)
    calm = held(known[0, 0:1] * 0 + 3.0 * rng.normal(size=(1, 60)), 0.1 * known)
    assert wild.sigma_db.mean() > 3 * calm.sigma_db.mean()


def test_a_level_that_noise_raised_tells_nothing_and_one_that_fell_does():
    known = np.zeros((1, 1, 9))
    new = np.zeros((1, 9))
    new[0, 0], new[0, 1] = 20.0, -20.0
    told = np.array([[False, False, *7 * [True]]])
    found = held(new, known, told=told)
    assert np.isnan(found.rest_db[0, 0])
    assert found.rest_db[0, 1] == pytest.approx(-20.0)


def test_noise_of_a_short_recording_does_not_pass_for_a_gain():
    # twelve of twenty levels are noise, which has risen by 2 dB with the shorter average
    known, new = np.zeros((1, 1, 20)), np.zeros((1, 20))
    new[0, 8:] = 2.0
    told = np.arange(20)[None] < 8
    found = held(new, known, told=told)
    assert found.gain_db == pytest.approx([0.0])
    assert found.mean_square() == 0.0
    # where none stands above its noise, noise has to tell it
    assert held(new, known, told=np.arange(20)[None] < 0).gain_db == pytest.approx([2.0])


@pytest.mark.parametrize("few", [1, 3, 4])
def test_of_few_levels_above_the_noise_the_gain_is_the_lower_one(few):
    known, told = np.zeros((1, 1, 20)), np.arange(20)[None] < few
    # noise rose by 20 dB: what still stands above it has not fallen
    drowned = np.where(told, 0.0, 20.0)
    assert held(drowned, known, told=told).gain_db == pytest.approx([0.0])
    assert held(drowned, known, told=told).mean_square() == 0.0
    # the few rose by 20 dB, as with damage: the sensor hears the noise as before
    loud = np.where(told, 20.0, 0.0)
    assert held(loud, known, told=told).gain_db == pytest.approx([0.0])
    assert held(loud, known, told=told).mean_square() > 1.0


def families(harmonics=8):
    return [
        Family(kind=kind, stage=1, gear=gear, harmonic=k, spacing=1.0, shaft=1, lines=(k,))
        for k in range(1, harmonics + 1)
        for kind, gear in (("mesh", ""), ("sidebands", "pinion"), ("sidebands", "gear"))
    ]


def test_bands_that_move_as_one_are_told_from_sidebands_of_one_gear():
    rng, known = np.random.default_rng(5), np.zeros((1, 2, 24))
    moved = np.repeat(6.0 * rng.normal(size=(2, 8)), 3, axis=1)
    path = path_change(held(moved, known), families())
    assert path.likely
    assert path.common > 0.9
    gear = np.zeros((2, 24))
    gear[:, 1::3] = 8.0
    assert not path_change(held(gear, known), families()).likely
    unrelated = np.tile(6.0 * rng.normal(size=(1, 24)), (2, 1))
    assert not path_change(held(unrelated, known), families()).likely


@pytest.mark.parametrize("seed", range(4))
def test_what_is_common_to_bands_is_their_share_of_an_analysis_of_variance(seed):
    """One band after another: the square of its mean, less what its scatter alone lets expect."""
    rng, size = np.random.default_rng([7, seed]), 3.0 + 2.0 * seed
    # bands of one, two and more families that can be compared
    told = rng.uniform(size=(2, 24)) < 0.7
    moved = size * np.repeat(rng.normal(size=(2, 8)), 3, axis=1) + 4.0 * rng.normal(size=(2, 24))
    standardised = np.where(told, moved, np.nan)
    between, within, loudest, bands = 0.0, 0.0, 0.0, 0
    for channel in standardised:
        for band in channel.reshape(8, 3):
            own = band[np.isfinite(band)]
            if len(own) > 1:
                between += max(len(own) * own.mean() ** 2 - own.var(ddof=1), 0.0)
                within += len(own) * own.var(ddof=1)
                loudest += len(own) * own.mean() ** 2
                bands += 1
    path = path_change(SimpleNamespace(standardised=standardised), families())
    assert path.common == pytest.approx(between / (between + within))
    assert path.bands == bands
    assert path.together == pytest.approx(loudest / bands)


def test_mesh_harmonics_that_change_otherwise_in_each_channel_are_another_path():
    """Also where noise hides the sidebands; what the gears do is heard in all channels."""
    rng, known = np.random.default_rng(6), np.zeros((1, 2, 24))
    mesh = 12.0 * (np.arange(24) % 3 == 0) * rng.normal(size=(1, 24))
    apart = path_change(held(np.vstack([mesh, 0.0 * mesh]), known), families())
    alike = path_change(held(np.vstack([mesh, mesh]), known), families())
    assert apart.likely
    assert apart.apart > 0.3
    assert not alike.likely
    assert alike.apart == 0.0


def test_the_standard_deviation_is_that_of_a_difference_from_a_mean():
    own, known = (levels(np.zeros((1, 9)), error) for error in (0.5, 0.6))
    found = level_deviation(own, [known, known], np.zeros((2, 2)), HERE)
    # scatter of 0.1 Np in the recording and in the mean of two references
    own = (20 / np.log(10) * 0.1) ** 2 * (1 + 1 / 2)
    assert found.sigma_db**2 == pytest.approx(own + 0.5**2 + 0.6**2 / 2)


@pytest.mark.parametrize("share", [0.2, 0.5, 1.0, 2.0])
def test_of_lightly_loaded_teeth_a_change_of_load_lets_expect_more(share):
    healthy = learn([recording(load=1.0)], machine())
    new = Profile.of(measure_signature(recording(load=0.7, seed=5), machine()))
    law = HealthyMachine(healthy, machine())

    def held_at(load):
        own = HealthyMachine(healthy, machine())
        own.gears = tuple(replace(one, load=load) for one in law.gears)
        own.lightest = load
        return own.deviation(new)

    full, light = held_at(np.inf), held_at(FULL_LOAD * share)
    assert full.gap == light.gap > 0.2
    # from one reference: 2 (1 - exp(-x^2/2)) of the variance of the slope, x in lengths
    load, speed, swing = law.gauge.state(new) - law.states[0]
    lengths = np.array([load, load / min(share, 1.0)]) ** 2 + speed**2 + swing**2
    near, far = 2 * (0.6 * LENGTH * 20 / np.log(10)) ** 2 * (1 - np.exp(-lengths / 2 / LENGTH**2))
    more = light.levels.sigma_db**2 - full.levels.sigma_db**2
    np.testing.assert_allclose(more, far - near, rtol=1e-6, atol=1e-9)
    for one, other in zip(full.gears, light.gears, strict=True):
        for a, b in zip(one.bands, other.bands, strict=True):
            wider = b.deviation / a.deviation
            assert np.all(wider > 1.0) if share < 1.0 else wider == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("common", "apart", "likely"),
    [(0.55, 0.0, True), (0.3, 0.06, True), (0.0, 0.2, True), (0.4, 0.0, False), (0.0, 0.1, False)],
)
def test_bands_and_channels_speak_for_another_path_together(common, apart, likely):
    path = PathChange(common=common, apart=apart, together=9.0, bands=16)
    assert path.likely == likely
    assert not path._replace(bands=3).likely
    # a single channel tells less, and has to do
    assert path._replace(apart=None).likely == (common > 0.25)
