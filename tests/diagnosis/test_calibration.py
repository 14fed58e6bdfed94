"""False-alarm probabilities: a table that is monotone, and holds for what it was made from."""

from __future__ import annotations

import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.diagnosis.evidence import (
    FAR,
    LIMITS,
    Evidence,
    comparable,
    false_alarm_probability,
    probability_of,
    situation,
)

CALIBRATION = runpy.run_path(str(Path(__file__).parents[2] / ".ci" / "calibration"))


def test_the_table_holds_for_the_law_it_was_made_from():
    rng = np.random.default_rng(6)
    table = CALIBRATION["table_of"]({"one, near": rng.normal(size=40_000).tolist()}, "a test")
    entry = table["situations"]["one, near"]
    new = rng.normal(size=20_000)
    told = np.array([probability_of(s, entry["strength"], entry["share"]) for s in new])
    for share in (0.5, 0.2, 0.1, 0.05, 0.02, 0.01):
        assert np.mean(told <= share) == pytest.approx(share, rel=0.15)


@given(st.floats(-3, 60), st.floats(0, 5), st.integers(1, 9), st.floats(0, 2))
def test_more_evidence_is_never_more_probable(strength, more, references, gap):
    low = false_alarm_probability(strength, references, gap)
    high = false_alarm_probability(strength + more, references, gap)
    assert 0 < high <= low <= 1


def test_a_fault_is_improbable_on_every_kind_of_healthy_machine():
    for references in (1, 3):
        for gap in (0.0, 1.0):
            assert false_alarm_probability(2.0, references, gap) < 0.02
            assert false_alarm_probability(-1.0, references, gap) > 0.5


def test_situations_tell_one_reference_from_several_and_near_from_far():
    names = {situation(n, gap) for n in (1, 2, 5) for gap in (0.0, 2 * FAR)}
    assert names == {"one, near", "one, far", "several, near", "several, far"}
    shares = CALIBRATION["SHARES"]
    assert list(shares) == sorted(shares, reverse=True)


def test_however_strong_the_evidence_a_probability_is_above_zero():
    assert 0.0 < false_alarm_probability(1e6, 3, 0.0) < 1e-290


@given(st.floats(-9, 60), st.floats(0, 5))
def test_strengths_made_comparable_keep_their_order_and_what_is_a_fault(strength, more):
    assert comparable(strength) <= comparable(strength + more)
    assert (comparable(strength) >= LIMITS.fault) == (strength >= LIMITS.fault)
    short = LIMITS.fault - min(strength, LIMITS.fault)
    assert LIMITS.fault - min(comparable(strength), LIMITS.fault) == pytest.approx(1.6 * short)


def test_what_levels_often_reach_ranks_below_what_one_tooth_hardly_ever_does():
    """Of healthy pairs one in fifty has levels of 0.91, none of 4,589 a tooth of 1."""
    usual, odd = (
        SimpleNamespace(strengths={"levels": levels, "path": 0.0, "tooth": tooth})
        for levels, tooth in ((0.91, -0.5), (0.1, 0.6))
    )
    ranked = [Evidence.comparable.fget(own) for own in (usual, odd)]
    assert ranked == pytest.approx([2 - 1.6 * (2 - 0.91), 0.6])
