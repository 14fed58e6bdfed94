"""Levels against healthy ones: closed forms, laws, and false alarms counted."""

from __future__ import annotations

import math

import numpy as np
import pytest
from gearmon.diagnosis.comparison import (
    GAIN_DB,
    PRIOR_SCATTER_DB,
    PRIOR_WORTH,
    compare_levels,
    healthy_scatter,
    judge_groups,
    judge_levels,
)
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import f as f_law

from gearmon.signatures.families import Family

CHANNELS, FAMILIES = 3, 40
QUIET = np.full((CHANNELS, FAMILIES), 0.1)


def machine(seed=0):
    """Levels of a machine: each family its own."""
    return np.random.default_rng(seed).normal(-20, 10, (CHANNELS, FAMILIES))


def healthy(count, seed=0, scatter=0.0, along=()):
    """Healthy recordings of one machine, along given directions, and their standard errors."""
    generator = np.random.default_rng(seed + 100)
    levels = np.repeat(machine(seed)[None], count, axis=0)
    for direction in along:
        levels = levels + np.linspace(-1, 1, count)[:, None, None] * direction
    levels = levels + scatter * generator.standard_normal(levels.shape)
    return levels, np.repeat(QUIET[None], count, axis=0)


def test_levels_of_the_reference_leave_nothing():
    levels, scatter = healthy(3)
    change = compare_levels(machine(), QUIET, levels, scatter)
    np.testing.assert_allclose(change.residual_db, 0.0, atol=1e-12)
    np.testing.assert_allclose(change.expected_db, machine(), atol=1e-12)
    assert judge_levels(change.standardised, change.worth, 20.0).log10_probability > -1e-9


def test_measured_is_expected_plus_residual():
    levels, scatter = healthy(4, scatter=1.5)
    level = machine(1)
    change = compare_levels(level, QUIET, levels, scatter)
    np.testing.assert_allclose(change.expected_db + change.residual_db, level, atol=1e-12)
    np.testing.assert_allclose(change.standardised, change.residual_db / change.sigma_db)


@pytest.mark.parametrize("count", [1, 2, 3, 5])
@pytest.mark.parametrize("gain_db", [6.0, -6.0])
def test_a_common_gain_of_a_channel_is_no_change(count, gain_db):
    levels, scatter = healthy(count)
    level = machine()
    level[1] += gain_db
    change = compare_levels(level, QUIET, levels, scatter)
    # the gain's prior keeps back sigma^2 / (families GAIN_DB^2) of it, more where lines are
    # weighted down for standing apart at first
    kept = 4 * float(np.mean(change.sigma_db)) ** 2 / (FAMILIES * GAIN_DB**2) * abs(gain_db)
    assert np.abs(change.residual_db).max() < kept
    assert np.abs(change.standardised).max() < 0.05


@pytest.mark.parametrize("planted", [10.0, -10.0])
def test_a_change_of_one_family_is_found_there_with_its_sign(planted):
    levels, scatter = healthy(3, scatter=0.5)
    level = healthy(1, scatter=0.5)[0][0]
    level[2, 17] += planted
    change = compare_levels(level, QUIET, levels, scatter)
    where = np.unravel_index(np.argmax(np.abs(change.standardised)), change.residual_db.shape)
    assert where == (2, 17)
    assert change.residual_db[where] == pytest.approx(planted, abs=2.0)


def test_a_load_that_the_references_span_is_absorbed():
    rise = np.random.default_rng(5).normal(0, 6, (CHANNELS, FAMILIES))
    levels, scatter = healthy(3, along=[rise])
    change = compare_levels(machine() + 0.5 * rise, QUIET, levels, scatter)
    assert np.abs(change.residual_db).max() < 0.05 * np.abs(0.5 * rise).max()


def test_a_load_far_beyond_the_references_is_not_explained_away():
    rise = np.random.default_rng(5).normal(0, 2, (CHANNELS, FAMILIES))
    levels, scatter = healthy(3, along=[rise], scatter=0.5)
    inside = compare_levels(machine() + 0.9 * rise, QUIET, levels, scatter)
    beyond = compare_levels(machine() + 20 * rise, QUIET, levels, scatter)
    assert np.abs(beyond.standardised).max() > 5 * np.abs(inside.standardised).max()


def test_a_fault_does_not_pull_the_fit_towards_itself():
    # a quarter of a channel's families rises by 15 dB: the others must stay where they are
    levels, scatter = healthy(3)
    level = machine()
    level[0, :10] += 15.0
    change = compare_levels(level, QUIET, levels, scatter)
    mean_shift = 15.0 * 10 / FAMILIES
    assert np.abs(change.residual_db[0, 10:]).max() < 0.4 * mean_shift
    assert change.residual_db[0, :10].min() > 15.0 - 0.4 * mean_shift
    np.testing.assert_allclose(change.residual_db[1:], 0.0, atol=1e-9)


@given(st.permutations(range(CHANNELS)), st.permutations(range(4)))
def test_order_of_channels_and_of_references_does_not_matter(channels, recordings):
    rows, order = list(channels), list(recordings)
    levels, scatter = healthy(4, scatter=1.0, along=[machine(3) / 10])
    level = machine() + machine(4) / 10
    one = compare_levels(level, QUIET, levels, scatter)
    two = compare_levels(level[rows], QUIET[rows], levels[order][:, rows], scatter[:, rows])
    np.testing.assert_allclose(two.residual_db, one.residual_db[rows], atol=1e-8)
    np.testing.assert_allclose(two.sigma_db, one.sigma_db[rows], rtol=1e-10)
    assert two.worth == one.worth


def test_an_offset_of_all_levels_does_not_matter():
    # another unit of acceleration, in all recordings alike
    levels, scatter = healthy(3, scatter=1.0)
    level = machine() + machine(4) / 10
    one = compare_levels(level, QUIET, levels, scatter)
    two = compare_levels(level + 60, QUIET, levels + 60, scatter)
    np.testing.assert_allclose(two.residual_db, one.residual_db, atol=1e-9)


def test_one_recording_rests_on_the_prior():
    levels, scatter = healthy(1)
    assert healthy_scatter(levels, scatter) == (PRIOR_SCATTER_DB, PRIOR_WORTH)


def test_scatter_between_recordings_is_learned():
    count = 30
    levels, scatter = healthy(count, scatter=1.0)
    between, worth = healthy_scatter(levels, scatter)
    assert worth == PRIOR_WORTH + count
    # the prior's share remains; a fit by the others leaves 1 + 1/(n-1) of the variance
    expected = math.sqrt((PRIOR_WORTH * PRIOR_SCATTER_DB**2 + count) / (PRIOR_WORTH + count))
    assert between == pytest.approx(expected, rel=0.1)


def test_more_scatter_makes_a_change_less_striking():
    level = machine()
    level[0, 0] += 8
    calm, wild = (
        compare_levels(level, QUIET, *healthy(6, scatter=scatter)) for scatter in (0.3, 4.0)
    )
    assert calm.sigma_db.mean() < wild.sigma_db.mean()
    assert calm.standardised[0, 0] > wild.standardised[0, 0]


@pytest.mark.parametrize("independent", [4.0, 16.0, 27.7])
@pytest.mark.parametrize("worth", [2.0, 5.0, 12.0])
@pytest.mark.parametrize("size", [0.3, 1.0, 1.7, 3.0])
def test_probability_is_that_of_the_f_law(size, worth, independent):
    test = judge_levels(np.full((2, 5), -size), worth, independent)
    assert test.rms == pytest.approx(size)
    expected = f_law.logsf(size**2, independent, worth * independent) / math.log(10)
    assert test.log10_probability == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_changes_are_cut_at_five_and_nothing_is_no_evidence():
    assert judge_levels(np.full(4, 100.0), 5.0, 4.0) == judge_levels(np.full(4, 5.0), 5.0, 4.0)
    assert judge_levels(np.zeros((2, 0)), 5.0, 4.0).log10_probability == 0.0
    assert np.isfinite(judge_levels(np.full(9, 5.0), 1e4, 1e4).log10_probability)


def test_false_alarms_on_gaussian_healthy_machines():
    # every machine, its references and its new recording are drawn anew
    generator = np.random.default_rng(11)
    trials, alarms = 600, 0
    for _ in range(trials):
        levels = generator.normal(0, 2, (4, 2, 24))
        error = np.full((4, 2, 24), 0.3)
        change = compare_levels(levels[0], error[0], levels[1:], error[1:])
        test = judge_levels(change.standardised, change.worth, 8 * math.sqrt(2))
        alarms += test.log10_probability < -2
    assert alarms < 0.02 * trials


def test_false_alarms_where_load_and_gain_wander():
    generator = np.random.default_rng(12)
    trials, alarms = 400, 0
    for _ in range(trials):
        rise = generator.normal(0, 3, (2, 24))
        load = generator.uniform(-1, 1, (5, 1, 1))
        load[1], load[2] = -1, 1  # the new load lies between those learned
        gain = generator.normal(0, 1, (5, 2, 1))
        levels = load * rise + gain + generator.normal(0, 1, (5, 2, 24))
        error = np.full((5, 2, 24), 0.3)
        change = compare_levels(levels[0], error[0], levels[1:], error[1:])
        test = judge_levels(change.standardised, change.worth, 8 * math.sqrt(2))
        alarms += test.log10_probability < -2
    assert alarms < 0.02 * trials


FAMILIES_NAMED = tuple(
    Family(
        kind=kind,
        stage=stage,
        gear=gear,
        harmonic=harmonic,
        spacing=0.0,
        shaft=None,
        lines=(0,),
    )
    for kind, stage, gear in (
        ("mesh", 1, ""),
        ("sidebands", 1, "pinion"),
        ("sidebands", 1, "gear"),
        ("residual", 1, "pinion"),
        ("mesh", 2, ""),
    )
    for harmonic in range(1, 9)
)


def groups_of(level):
    levels, scatter = healthy(3, scatter=0.5)
    return judge_groups(compare_levels(level, QUIET, levels, scatter), FAMILIES_NAMED)


def test_groups_are_judged_by_themselves_strongest_first():
    level = healthy(1, scatter=0.5)[0][0]
    level[:, 16:24] += 10.0  # the sidebands of the gear, at every harmonic
    tests = groups_of(level)
    assert len(tests) == 5
    assert (tests[0].kind, tests[0].stage, tests[0].gear) == ("sidebands", 1, "gear")
    assert tests[0].log10_probability < -2
    logs = [test.log10_probability for test in tests]
    assert logs == sorted(logs)
    assert logs[1] > -1


def test_probability_of_a_group_is_corrected_for_their_number():
    level = healthy(1, scatter=0.5)[0][0]
    level[0, 3] += 12.0
    levels, scatter = healthy(3, scatter=0.5)
    change = compare_levels(level, QUIET, levels, scatter)
    best = judge_groups(change, FAMILIES_NAMED)[0]
    alone = judge_levels(change.standardised[:, :8], change.worth, 8 * math.sqrt(CHANNELS))
    assert (best.kind, best.stage) == ("mesh", 1)
    assert best.rms == alone.rms
    assert best.log10_probability == pytest.approx(
        min(0.0, alone.log10_probability + math.log10(5))
    )


def test_no_group_of_a_healthy_machine_stands_out():
    assert groups_of(machine())[0].log10_probability == 0.0
