"""What a departure is called: one tooth only where one tooth explains it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gearmon.diagnosis.flagging import finding_flag, named_by_kind
from gearmon.diagnosis.kind_rules import rule_probabilities
from gearmon.diagnosis.kind_spread import departure_spread
from gearmon.diagnosis.tooth_evidence import ToothFinding
from gearmon.diagnosis.tooth_search import LossEstimate
from reference.gear_departures import TEETH, complex_noise, gear, machine, weights

from gearmon.diagnosis.fault_types import NAMES, FeatureVector
from gearmon.diagnosis.results import Flag


def finding(own):
    return ToothFinding(
        best=own,
        tooth=own.match.best + 1,
        counted_from="tacho",
        position=0.0,
        loss=LossEstimate(loss=0.2, low=0.15, high=0.25),
        log10_probability=-5.0,
        trust=1.0,
        rivals=(),
        searched=(own,),
    )


def features(**changed):
    row = dict.fromkeys(NAMES, 0.0) | {"turns_known": 1.0, "teeth_involved": 4.0} | changed
    return FeatureVector(
        gears=((1, "gear"), (1, "pinion")),
        values=np.array([np.zeros(len(NAMES)), [row[name] for name in NAMES]]),
    )


PITTED = np.where(np.arange(TEETH) % 3 > 0, np.random.default_rng(1).uniform(0, 2, TEETH), 0.0)


def test_one_tooth_is_blamed_with_loss_and_size():
    found = finding(gear(weights(4)))
    flag = finding_flag(found, (), features(peak_db=15.0), machine(), 0.6)
    assert (flag.kind, flag.stage, flag.gear) == ("tooth damage", 1, "pinion")
    assert flag.tooth == found.tooth
    assert (flag.stiffness_loss, flag.stiffness_loss_low) == (0.2, 0.15)
    assert flag.false_alarm_probability == pytest.approx(1e-5 / 0.6)
    assert any("one tooth explains" in sentence for sentence in flag.evidence)
    assert any("crack depth" in sentence for sentence in flag.evidence)


@pytest.mark.parametrize(
    ("kind", "departure", "changed"),
    [
        ("distributed pitting", gear(PITTED), {"far_db": 7, "once_db": 12, "twice_db": 9}),
        ("eccentricity", gear(None, smooth=0.4), {"once_db": 20, "twice_db": 6}),
        ("misalignment", gear(None, smooth=0.4), {"twice_db": 20, "once_db": 2}),
        ("several teeth", gear(weights(2, 11, 22), seed=1), {"far_db": 1, "peak_db": 13}),
    ],
)
def test_what_one_tooth_does_not_explain_is_named_otherwise(kind, departure, changed):
    flag = finding_flag(finding(departure), (), features(**changed), machine(), 0.6)
    assert flag.kind == kind
    assert (flag.stage, flag.gear) == (1, "pinion")
    assert flag.tooth is flag.stiffness_loss is flag.stiffness_loss_high is None
    assert flag.false_alarm_probability == pytest.approx(1e-5 / 0.6)
    assert any("not of many" in sentence for sentence in flag.evidence)


def test_the_second_of_two_teeth_is_told():
    pair = weights(4)
    pair[11] = 0.7
    flag = finding_flag(finding(gear(pair)), (), features(peak_db=13), machine(), 0.6)
    assert flag.tooth is None
    (told,) = [sentence for sentence in flag.evidence if "second tooth" in sentence]
    assert told.startswith("a second tooth, 7 teeth after the one that departs most")


def half_explained(seed):
    """One tooth beside unrelated lines of nearly the same power."""
    own = gear(weights(3), seed=seed, height=10 * np.sqrt(0.55), noise=0.0)
    rng = np.random.default_rng([6, seed])
    for band in own.difference.bands:
        band.rest[:] += 10 * np.sqrt(0.45) * complex_noise(rng, *band.rest.shape)
    return own


def test_runout_asks_for_more_before_a_tooth_is_blamed():
    """One tooth that explains half of a departure, with and without runout."""
    departure = next(
        own
        for own in (half_explained(i) for i in range(12))
        if 0.6 < departure_spread(own).one_tooth < 0.98
    )
    plain = finding_flag(finding(departure), (), features(peak_db=9), machine(), 0.6)
    smooth = finding_flag(finding(departure), (), features(once_db=20), machine(), 0.6)
    assert (plain.kind, smooth.kind) == ("tooth damage", "eccentricity")
    sure = finding_flag(finding(gear(weights(3))), (), features(once_db=20), machine(), 0.6)
    assert sure.kind == "tooth damage"


@pytest.mark.parametrize("known", [None, features()])
def test_an_unclear_kind_is_not_guessed(known):
    flag = finding_flag(finding(gear(PITTED)), (), known, machine(), 0.6)
    assert (flag.kind, flag.gear, flag.tooth) == ("changed residual", "pinion", None)


def changed(kind, stage, gear_name):
    return Flag(
        kind=kind,
        stage=stage,
        gear=gear_name,
        tooth=None,
        stiffness_loss=None,
        stiffness_loss_low=None,
        stiffness_loss_high=None,
        false_alarm_probability=1e-3,
        evidence=("a1: louder",),
    )


def test_levels_are_named_where_they_changed():
    flags = [changed("changed sidebands", 2, "gear"), changed("changed sidebands", 1, "pinion")]
    named = named_by_kind(flags, features(once_db=15.0, near_db=12.0))
    assert named[0] == flags[0]
    assert (named[1].kind, named[1].gear) == ("eccentricity", "pinion")
    assert named[1].evidence[-1] == "a1: louder"


def test_levels_of_another_stage_are_not_renamed():
    flags = (changed("changed sidebands", 2, "gear"),)
    assert named_by_kind(flags, features(once_db=15.0)) == flags


def test_what_is_named_stays_so():
    flags = (changed("wear", 1, None), changed("changed sidebands", 1, "pinion"))
    assert named_by_kind(flags, features(once_db=15.0)) == flags


def test_the_spread_overrules_a_peak_of_the_energy():
    row = features(far_db=6.0, several_db=5.0, peak_db=16.0, peaks=1.0, teeth_involved=3.0).named(1)
    assert rule_probabilities(row)["tooth damage"] > 0.5
    assert rule_probabilities(row, departure_spread(gear(PITTED)))["tooth damage"] < 0.01
    flat = row | {"peak_db": 2.0}
    assert rule_probabilities(flat)["tooth damage"] < 0.1
    assert rule_probabilities(flat, departure_spread(gear(weights(3))))["tooth damage"] > 0.4


def test_no_flags_no_names():
    assert named_by_kind((), features(once_db=15.0)) == ()
    flag = changed("changed mesh", 1, None)
    assert named_by_kind([flag], None) == (flag,)
    assert named_by_kind([replace(flag, stage=None)], features()) == (replace(flag, stage=None),)
