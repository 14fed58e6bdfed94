"""What a search would have noticed: laws of the limit, and the words for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gearmon.diagnosis.evidence import summary
from gearmon.diagnosis.matched import LOSSES, ToothMatch
from gearmon.diagnosis.noticeable import needed_factor, noticed_from
from gearmon.diagnosis.tooth_evidence import false_alarm_among, false_alarm_log10


def match(expected):
    teeth = 25
    return ToothMatch(
        stage=1,
        gear="pinion",
        teeth=teeth,
        order=1.0,
        log_likelihood=np.zeros((len(LOSSES), teeth)),
        log_place=np.zeros(teeth),
        expected=np.asarray(expected, dtype=float),
        lines=100,
        misfit=1.0,
    )


@pytest.mark.parametrize("limit", [-1.0, -2.0, -4.0])
def test_the_needed_factor_just_reaches_the_limit(limit):
    needed = needed_factor(false_alarm_log10, limit)
    assert false_alarm_log10(needed) == pytest.approx(limit, abs=1e-6)
    among = needed_factor(lambda x: false_alarm_among(x, (10.0, 3.0)), limit)
    assert false_alarm_among(among, (10.0, 3.0)) == pytest.approx(limit, abs=1e-6)
    assert among > needed


def test_a_limit_out_of_reach_needs_infinite_evidence():
    assert needed_factor(lambda _: -1.0, -2.0) == float("inf")
    assert noticed_from(match(1e3 * LOSSES), float("inf"), 2) is None


def test_ten_times_the_noise_power_hides_losses_larger_by_its_root():
    # far below certainty the mean evidence goes with the fourth power of the loss over the noise
    quiet = noticed_from(match(1e9 * LOSSES**4), 5.0, 2)
    noisy = noticed_from(match(1e7 * LOSSES**4), 5.0, 2)
    step = LOSSES[1] / LOSSES[0]
    assert noisy / quiet == pytest.approx(10**0.5, rel=step - 1)


def test_more_gears_and_more_evidence_needed_hide_more():
    own = match(1e4 * LOSSES**2)
    assert noticed_from(own, 5.0, 1) <= noticed_from(own, 5.0, 50)
    assert noticed_from(own, 5.0, 2) < noticed_from(own, 500.0, 2)
    assert noticed_from(match(np.zeros(len(LOSSES))), 5.0, 2) is None


def test_a_healthy_verdict_says_what_it_excludes(small_profile, small_level_test):
    seen = replace(small_profile, noticed_from=0.12)
    blind = replace(small_profile, gear="gear", noticed_from=None)
    told = summary("healthy", (), (seen,), small_level_test)
    assert "from a loss of 12 % of its pair's stiffness." in told
    told = summary("healthy", (), (seen, blind), small_level_test)
    assert "but hardly on the gear of stage 1." in told
    assert "not even a gross one" in summary("healthy", (), (blind,), small_level_test)
    assert "noticed" not in summary("fault", (), (seen,), small_level_test)
    alone = replace(small_profile, loss_by_tooth=None)
    assert "noticed" not in summary("healthy", (), (alone,), small_level_test)


@pytest.fixture
def small_profile():
    from gearmon.diagnosis.results import ToothProfile

    return ToothProfile(
        stage=1,
        gear="pinion",
        teeth=25,
        order=1.0,
        energy=np.ones(25),
        tooth=3,
        position=0.1,
        ratio=1.2,
        log10_probability=-0.1,
        against="reference",
        loss_by_tooth=np.zeros(25),
        loss_sigma_by_tooth=np.zeros(25),
    )


@pytest.fixture
def small_level_test():
    from gearmon.diagnosis.comparison import judge_levels

    return judge_levels(np.full((1, 4), 0.5), 2.0, 2.0)
