"""Evidence in words: what is flagged, in which order, and what the sentences say."""

from __future__ import annotations

import numpy as np
import pytest
from gearmon.diagnosis.comparison import GroupTest, LevelTest
from gearmon.diagnosis.evidence import level_flags, sentences, summary, tooth_flags

from gearmon.diagnosis.results import Change, ToothProfile


def profile(log10, stage=1, gear="pinion", tooth=7, against="reference", order=None):
    return ToothProfile(
        stage=stage,
        gear=gear,
        teeth=23,
        # a shaft of its own unless told otherwise
        order=order or 1.0 / stage + 0.1 * len(gear),
        energy=np.ones(23),
        tooth=tooth,
        position=0.25,
        ratio=8.25,
        log10_probability=log10,
        against=against,
    )


def change(level_db, kind="sidebands", gear="pinion", harmonic=1, scatter_db=0.5, channel="a1"):
    return Change(
        channel=channel,
        family=f"{kind} of shaft 1 around mesh 1 harmonic {harmonic}",
        kind=kind,
        stage=1,
        harmonic=harmonic,
        gear=gear,
        shaft=1,
        level_db=level_db,
        reference_db=-20.0,
        scatter_db=scatter_db,
    )


def group(log10, kind="sidebands", gear="pinion"):
    return GroupTest(kind=kind, stage=1, gear=gear, rms=2.0, log10_probability=log10)


CALM = LevelTest(rms=1.0, log10_probability=-0.3)


def test_nothing_striking_is_no_flag():
    assert tooth_flags([], 0.01, 1) == ()
    assert tooth_flags([profile(-1.9)], 0.01, 1) == ()


def test_gears_looked_at_are_corrected_for():
    assert tooth_flags([profile(-2.1)], 0.01, 1)
    assert tooth_flags([profile(-2.1)], 0.01, 4) == ()
    (flag,) = tooth_flags([profile(-3.0)], 0.01, 4)
    assert flag.false_alarm_probability == pytest.approx(4e-3)


def test_the_clearest_gear_is_flagged_and_names_the_others():
    found = [profile(-3), profile(-9, stage=2, gear="gear"), profile(-0.1, gear="gear")]
    (flag,) = tooth_flags(found, 0.01, 3)
    assert (flag.kind, flag.stage, flag.gear, flag.tooth) == ("tooth damage", 2, "gear", 7)
    assert "8.2 times the energy of its median tooth" in flag.evidence[0]
    assert any("pinion of stage 1 shows it too" in line for line in flag.evidence)
    assert not any("gear of stage 1" in line for line in flag.evidence)


def test_a_place_without_a_number_is_told_as_a_share_of_the_turn():
    (flag,) = tooth_flags([profile(-9, tooth=None)], 0.01, 1)
    assert flag.tooth is None
    assert "0.25 of a turn" in flag.evidence[0]
    assert not any("tachometer" in line for line in flag.evidence)


def test_what_it_was_compared_with_is_told():
    (flag,) = tooth_flags([profile(-9)], 0.01, 1)
    assert "the healthy pattern" in flag.evidence[0]
    (flag,) = tooth_flags([profile(-9, against="other teeth")], 0.01, 1)
    assert "its other teeth" in flag.evidence[0]
    assert "cannot be known whether it was always so" in " ".join(flag.evidence)
    assert flag.stiffness_loss is None


def test_groups_that_stand_out_are_flagged():
    groups = [group(-5), group(-3, "mesh", ""), group(-1, "residual")]
    changes = [change(-13.2), change(-20.0, "mesh", ""), change(0.0, "residual")]
    flags = level_flags(changes, groups, CALM, 0.01)
    assert [(flag.kind, flag.gear) for flag in flags] == [
        ("changed sidebands", "pinion"),
        ("changed mesh", None),
    ]
    assert flags[0].false_alarm_probability == pytest.approx(1e-5)
    assert flags[0].evidence == (
        "a1: sidebands of shaft 1 around mesh 1 harmonic 1 rose 6.8 dB; learned scatter 0.5 dB",
    )


def test_calm_groups_are_not_flagged():
    assert level_flags([change(-20.0)], [group(-1)], CALM, 0.01) == ()


def test_all_levels_together_flag_the_strongest_group():
    together = LevelTest(rms=2.0, log10_probability=-4.0)
    (flag,) = level_flags([change(-18.0)], [group(-1), group(-0.5, "mesh", "")], together, 0.01)
    assert flag.kind == "changed sidebands"
    assert flag.false_alarm_probability == pytest.approx(1e-4)


def test_sentences_begin_with_the_most_striking():
    told = sentences(
        [change(-19.0), change(-30.0, harmonic=2), change(-14.0, harmonic=3, scatter_db=5.0)]
    )
    assert told[0] == (
        "a1: sidebands of shaft 1 around mesh 1 harmonic 2 fell 10.0 dB; learned scatter 0.5 dB"
    )
    assert "harmonic 1 rose 1.0 dB" in told[1]
    assert len(sentences([change(float(i)) for i in range(20)])) == 4
    assert sentences([]) == ()


@pytest.mark.parametrize("verdict", ["healthy", "fault", "cannot tell"])
def test_summary_is_short_and_has_figures(verdict):
    told = summary(
        verdict, [change(-10.0)], [profile(-1.0)], LevelTest(rms=1.3, log10_probability=-1)
    )
    assert "\n" not in told
    assert "1.3 times" in told
    assert ("Most of all, a1" in told) == (verdict != "healthy")
    assert "the pinion of stage 1" in told


def test_summary_without_a_reference_or_a_turn():
    told = summary("cannot tell", [], [], None)
    assert "no healthy reference" in told
    # and what can then not be known
    for unknown in ("always so", "how much stiffness", "wear", "eccentricity"):
        assert unknown in told
    assert "No gear's turn could be resolved" in told


def test_of_gears_on_one_shaft_the_one_with_changed_sidebands_is_blamed():
    wide = profile(-30.0, stage=1, gear="gear", tooth=None, order=0.4)
    narrow = profile(-9.0, stage=2, gear="pinion", tooth=None, order=0.4)
    groups = (
        GroupTest(kind="sidebands", stage=2, gear="pinion", rms=4.0, log10_probability=-7.0),
        GroupTest(kind="sidebands", stage=1, gear="gear", rms=1.0, log10_probability=-0.5),
    )
    (flag,) = tooth_flags([wide, narrow], 0.01, 2, groups)
    assert (flag.stage, flag.gear) == (2, "pinion")
    assert "on the same shaft" in " ".join(flag.evidence)


def test_gears_on_one_shaft_that_cannot_be_told_apart_are_both_named():
    one = profile(-30.0, stage=1, gear="gear", tooth=None, order=0.4)
    other = profile(-9.0, stage=2, gear="pinion", tooth=None, order=0.4)
    (flag,) = tooth_flags([one, other], 0.01, 2)
    assert (flag.stage, flag.gear, flag.tooth) == (None, None, None)
    assert "it may be either of them" in flag.evidence[-1]
