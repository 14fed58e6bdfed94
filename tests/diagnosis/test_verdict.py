"""What a deviation is called: one tooth only where one tooth explains it."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from reference.gear_departures import TEETH, beside_others, gear, machine, weights

from gearmon.diagnosis.alone import mesh_lost, own_teeth_flags, own_teeth_reason
from gearmon.diagnosis.evidence import (
    LIMITS,
    Evidence,
    PathChange,
    broadband_strength,
    comparable,
    false_alarm_probability,
)
from gearmon.diagnosis.fault_types import NAMES
from gearmon.diagnosis.fault_types.kinds import rule_probabilities
from gearmon.diagnosis.hypotheses.several_teeth import departure_spread
from gearmon.diagnosis.hypotheses.tooth_damage import GearEvidence, LossEstimate, ToothFinding
from gearmon.diagnosis.hypotheses.turns import runout_growth
from gearmon.diagnosis.law.machine import LevelDeviation, MachineDeviation
from gearmon.diagnosis.nongear import NonGearFinding
from gearmon.diagnosis.results import Analysis, Change, ToothProfile
from gearmon.diagnosis.verdict import (
    Flagging,
    decide,
    fault_sentence,
    level_changes,
    limits,
    not_found,
    reason,
    sentences,
    taken_for_granted,
)
from gearmon.machine import PlanetaryStage
from gearmon.signatures.measured.line_plan import Family


def levels(standardised=0.0, gain_db=0.0):
    rest = np.full((1, 8), standardised)
    return LevelDeviation(
        expected_db=rest - rest,
        rest_db=rest,
        sigma_db=np.ones_like(rest),
        gain_db=np.full(1, gain_db),
    )


def evidence(own=None, lines=0.0, noise=0.0, noise_gain_db=0.0, runout=(), **off):
    """Evidence of a departing gear, changed lines, changed noise or grown runout."""
    finding = None
    if own is not None:
        searched = GearEvidence(deviation=own.difference, search=own)
        finding = ToothFinding((searched,), machine())
        finding.evidence = 80.0
        vars(finding)["loss"] = LossEstimate(loss=0.2, low=0.15, high=0.25)
    deviation = MachineDeviation(
        gap=0.0,
        **({"heavy": 0.0, "speed_off": 0.0} | off),
        length=1.0,
        gears=(own.difference,) if own is not None else (),
        family_names=(),
        levels=levels(lines),
        broadband=levels(noise, noise_gain_db),
    )
    return Evidence(
        deviation=deviation,
        finding=finding,
        path=PathChange(common=0.0, apart=None, together=0.0, bands=16),
        runout=tuple(runout),
        nongear=(),
        references=3,
    )


def flags_of(found, known=None, changes=(), common=0.0, together=0.0):
    path = PathChange(common=common, apart=None, together=together, bands=16)
    found = replace(found, path=path)
    known = known or features()
    told = Flagging(evidence=found, changes=tuple(changes), features=known)
    return told.flags()


def told_of(verdict, found, deaf=""):
    """The reason of a verdict without flags, changes or gears."""
    bare = SimpleNamespace(verdict=verdict, flags=(), changes=(), profiles=())
    return reason(bare, found, deaf)


def change(level_db, kind="sidebands", gear_name="pinion", harmonic=1, scatter_db=0.5):
    return Change(
        channel="a1",
        family=f"{kind} of shaft 1 around mesh 1 harmonic {harmonic}",
        kind=kind,
        stage=1,
        harmonic=harmonic,
        gear=gear_name,
        shaft=1,
        level_db=level_db,
        reference_db=-20.0,
        scatter_db=scatter_db,
    )


def features(**changed):
    row = dict.fromkeys(NAMES, 0.0) | {"turns_known": 1.0, "teeth_involved": 4.0} | changed
    return {(1, "gear"): dict.fromkeys(NAMES, 0.0), (1, "pinion"): row}


PITTED = np.where(np.arange(TEETH) % 3 > 0, np.random.default_rng(1).uniform(0, 2, TEETH), 0.0)


def test_one_tooth_is_blamed_with_loss_and_size():
    own = gear(weights(4))
    (flag,) = flags_of(evidence(own), features(peak_db=15.0))
    assert (flag.kind, flag.stage, flag.gear) == ("tooth damage", 1, "pinion")
    assert flag.tooth == own.best + 1
    assert (flag.stiffness_loss, flag.stiffness_loss_low) == (0.2, 0.15)
    assert flag.false_alarm_probability < 0.01
    assert any("one tooth explains" in sentence for sentence in flag.evidence)
    assert any("crack depth" in sentence for sentence in flag.evidence)
    assert fault_sentence([flag]).startswith(f"Damage of tooth {flag.tooth} of the pinion")


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
    flag = flags_of(evidence(departure), features(**changed))[0]
    assert flag.kind == kind
    assert (flag.stage, flag.gear) == (1, "pinion")
    assert flag.tooth is flag.stiffness_loss is flag.stiffness_loss_high is None


def test_the_second_of_two_teeth_is_told():
    pair = weights(4)
    pair[11] = 0.7
    flag = flags_of(evidence(gear(pair)), features(peak_db=13))[0]
    assert flag.tooth is None
    (told,) = [sentence for sentence in flag.evidence if "second tooth" in sentence]
    assert told.startswith("a second tooth, 7 teeth after the one that departs most")


def half_explained(seed):
    """One tooth beside unrelated lines of nearly the same power."""
    own = gear(weights(3), seed=seed, height=10 * np.sqrt(0.55), noise=0.0)
    return beside_others(own, 10 * np.sqrt(0.45), 6, seed)


def test_runout_asks_for_more_before_a_tooth_is_blamed():
    """One tooth that explains half of a departure, with and without runout."""
    departure = next(
        own
        for own in (half_explained(i) for i in range(12))
        if 0.6 < departure_spread(own).one_tooth < 0.98
    )
    assert flags_of(evidence(departure), features(once_db=20))[0].kind == "eccentricity"
    sure = flags_of(evidence(gear(weights(3))), features(once_db=20))[0]
    assert sure.kind == "tooth damage"


@pytest.mark.parametrize(("order", "competes"), [(TEETH / 47, False), (0.5, True), (2.0, True)])
def test_a_loud_gear_that_is_hardly_believed_competes_with_those_of_its_own_lines(order, competes):
    """What stands out in one turn does in that of a gear that turns a whole number of times."""
    first, loud = gear(weights(4), height=3.0), copy(gear(weights(9), height=30.0))
    loud.difference = replace(loud.difference, gear="gear", order=order)
    sure, unsure = (GearEvidence(deviation=own.difference, search=own) for own in (first, loud))
    unsure.believed = 0.01 * sure.believed
    assert unsure.log_factor > sure.log_factor
    finding = ToothFinding((sure, unsure), machine())
    assert finding.evidence == sure.believed
    assert bool(finding.rivals) == competes
    assert competes or finding.best is sure


def test_an_unclear_kind_is_not_guessed():
    flag = flags_of(evidence(gear(PITTED)), features())[0]
    assert (flag.kind, flag.gear, flag.tooth) == ("changed residual", "pinion", None)


def test_runout_is_flagged_by_gear_and_kind():
    growth = runout_growth({(1, "pinion"): np.array([15.0, *5 * [0]])})
    (flag,) = flags_of(evidence(runout=growth))
    assert (flag.kind, flag.stage, flag.gear, flag.tooth) == ("eccentricity", 1, "pinion", None)
    small = runout_growth({(1, "pinion"): np.array([5.0, *5 * [0]])})
    assert flags_of(evidence(runout=small)) == ()
    # pits on many teeth move the first sidebands, and all others with them
    pitted = features(once_db=15.0, near_db=10.0, several_db=8.0, far_db=9.0)
    assert flags_of(evidence(runout=growth), pitted)[0].kind == "distributed pitting"


def around(**misfits):
    """Evidence of gears by their shaft, each of which leaves so much all around its turn."""

    def deviation(shaft, misfit):
        return SimpleNamespace(
            stage=shaft, gear="pinion", order=1.0 / shaft, meetings=1, misfit=misfit,
            beyond=lambda other: misfit / other.misfit,
        )  # fmt: skip

    gears = tuple(deviation(int(name[-1]), own) for name, own in misfits.items())
    found = evidence()
    return replace(found, deviation=replace(found.deviation, gears=gears))


def test_a_shaft_that_departs_all_around_is_held_against_the_nearest_of_the_others():
    assert around(shaft1=12.0, shaft2=1.0, shaft3=3.0).one_shaft == ((1, "pinion"), 4.0)
    assert around(shaft1=1.0, shaft2=9.0).one_shaft == ((2, "pinion"), 9.0)
    assert around(shaft1=12.0).one_shaft == ((1, "pinion"), 1.0)
    assert evidence().one_shaft[1] == 1.0
    # the fourth power, of which a twentieth of the false alarms is taken off
    told = around(shaft1=10.0, shaft2=1.0).strengths["one shaft"]
    assert told == pytest.approx(4.0 - LIMITS.rare_share)


@pytest.mark.parametrize(
    ("times", "verdict"), [(2.0, "healthy"), (5.0, "cannot tell"), (8.0, "fault")]
)
def test_many_teeth_of_one_gear_are_a_fault_where_other_shafts_are_as_ever(times, verdict):
    found = around(shaft1=times, shaft2=1.0)
    assert decide(found) == verdict
    flags = flags_of(found)
    assert [(flag.kind, flag.stage, flag.gear, flag.tooth) for flag in flags] == (
        [("changed residual", 1, "pinion", None)] if verdict == "fault" else []
    )
    if flags:
        assert "8 times as much as any gear of another shaft" in flags[0].evidence[0]
        pitted = features(far_db=9.0, several_db=8.0, near_db=8.0, once_db=8.0, twice_db=8.0)
        assert flags_of(found, pitted)[0].kind == "distributed pitting"
    # where the speed is another, or knocks are heard, levels of lines mean little
    off = replace(found, deviation=replace(found.deviation, speed_off=1.6))
    assert decide(off) != "fault"


def test_a_gear_is_flagged_once():
    """Its levels move with its runout; those of another gear are told besides."""
    growth = runout_growth({(1, "pinion"): np.array([15.0, *5 * [0]])})
    both = evidence(lines=3.0, runout=growth)
    (flag,) = flags_of(both, features(once_db=15.0, near_db=12.0), [change(-10.0)])
    assert (flag.kind, flag.gear) == ("eccentricity", "pinion")
    told = flags_of(both, None, [change(-10.0, gear_name="gear")])
    assert [own.gear for own in told] == ["pinion", "gear"]


def test_levels_are_named_by_their_kind_where_it_is_clear():
    (plain,) = flags_of(evidence(lines=3.0), None, [change(-10.0), change(-19.0, "mesh", "")])
    assert (plain.kind, plain.gear) == ("changed sidebands", "pinion")
    assert plain.evidence == (
        "a1: sidebands of shaft 1 around mesh 1 harmonic 1 rose 10.0 dB; healthy scatter 0.5 dB",
    )
    known = features(once_db=15.0, near_db=12.0)
    (named,) = flags_of(evidence(lines=3.0), known, [change(-10.0)])
    assert (named.kind, named.gear) == ("eccentricity", "pinion")
    assert flags_of(evidence(lines=0.5), known, [change(-10.0)]) == ()


def test_bands_that_move_as_one_are_a_changed_path_and_no_gear():
    (flag,) = flags_of(evidence(lines=3.0), features(once_db=15.0), [change(-10.0)], common=0.7)
    assert (flag.kind, flag.stage, flag.gear) == ("path changed", None, None)
    assert "sensor had been moved" in fault_sentence([flag])


@pytest.mark.parametrize(("departure", "blamed"), [(3, "path changed"), (None, "tooth damage")])
def test_another_path_is_blamed_before_what_is_less_loud_but_for_one_event(departure, blamed):
    # what a path does to a gear is no event at one tooth, however loud either is
    own = gear(weights(4)) if departure is None else half_explained(departure)
    found, changes = evidence(own), [change(10.0)]
    told = {
        together: flags_of(found, None, changes, 0.7, together)[0].kind for together in (0.0, 60.0)
    }
    assert told == {0.0: "tooth damage", 60.0: blamed}


def test_noise_that_rose_beyond_the_lines_is_no_gear():
    rose = evidence(lines=2.0, noise=3.0, noise_gain_db=6.0)
    (flag,) = flags_of(rose, features(once_db=15.0), [change(-10.0)])
    assert (flag.kind, flag.gear) == ("broadband rise", None)
    # lines and noise alike: a gain
    alike = replace(rose.deviation, levels=levels(2.0, 6.0))
    assert flags_of(replace(rose, deviation=alike), None, [change(-10.0)])[0].gear == "pinion"


def test_a_path_that_moves_whole_bands_is_named_before_the_noise_it_lets_through():
    rose = evidence(lines=2.0, noise=3.0, noise_gain_db=6.0)
    for together, kind in ((30.0, "path changed"), (1.0, "broadband rise")):
        (flag,) = flags_of(rose, None, [change(-10.0)], common=0.6, together=together)
        assert (flag.kind, flag.gear) == (kind, None)


@pytest.mark.parametrize(
    ("apart", "together", "verdict"),
    [(0.0, 30.0, "cannot tell"), (0.1, 8.0, "cannot tell"), (0.1, 30.0, "fault")],
)
def test_a_load_that_nobody_learned_hardly_makes_channels_differ(apart, together, verdict):
    """Levels of lightly loaded teeth mean little beside one reference."""
    path = PathChange(common=0.6, apart=apart, together=together, bands=16)
    light = SimpleNamespace(searched=(SimpleNamespace(load_unlearned=True),), evidence=0.0)
    found = replace(evidence(lines=4.0), finding=light, path=path)
    assert decide(found) == verdict
    assert found.strengths["levels"] == pytest.approx(LIMITS.levels_open)
    # at another speed lines move across the modes of each channel's path
    off = replace(found, deviation=replace(found.deviation, speed_off=1.6))
    assert decide(off) == "cannot tell"


def test_a_spectrum_that_changes_without_its_lines_blames_no_gear():
    """Mains fill whole bands of the spectrum, and the lines of the gears stay as they were."""
    hum = evidence(lines=0.4, noise=5.0)
    moved = [change(-18.0)]
    (flag,) = flags_of(hum, features(once_db=15.0), moved)
    assert (flag.kind, flag.stage, flag.gear) == ("broadband change", None, None)
    assert "no gear is to blame" in fault_sentence([flag])
    mains = NonGearFinding(
        kind="electrical",
        name="mains, multiples of 50 Hz",
        lines=(),
        change_db=30.0,
        orders=(),
        width=0.01,
        log10_probability=-6.0,
        evidence=(),
    )
    flags = flags_of(replace(hum, nongear=(mains,)), features(once_db=15.0), moved)
    assert [flag.kind for flag in flags] == ["electrical"]
    both = evidence(lines=3.0, noise=5.0)
    assert flags_of(both, features(once_db=15.0), moved)[0].gear == "pinion"


def test_noise_that_fell_anywhere_was_not_added():
    rose = evidence(lines=2.0, noise=3.0, noise_gain_db=6.0)
    rest = rose.deviation.broadband.rest_db.copy()
    rest[:, : rest.shape[1] // 4] = -9.0
    fell = replace(rose.deviation, broadband=rose.deviation.broadband._replace(rest_db=rest))
    flags = flags_of(replace(rose, deviation=fell), None, [change(-10.0)], common=0.7)
    assert [flag.kind for flag in flags] == ["path changed"]


@pytest.mark.parametrize(("off", "verdict"), [(0.5, "fault"), (1.6, "cannot tell")])
def test_levels_alone_call_no_fault_at_a_speed_that_nobody_learned(off, verdict):
    found = evidence(lines=4.0, speed_off=off)
    assert decide(found) == verdict
    assert bool(flags_of(found, None, [change(-10.0)], 0.7)) == (verdict == "fault")


def test_lines_of_no_gear_call_no_fault_in_a_lost_angle():
    """The smeared skirts of mesh lines stand beside the orders of the gears."""
    unknown = NonGearFinding(
        kind="unknown lines",
        name="unknown line at order 175",
        lines=(),
        change_db=20.0,
        orders=(),
        width=0.01,
        log10_probability=-6.0,
        evidence=(),
    )
    held = replace(evidence(), nongear=(unknown,))
    assert decide(held) == "fault"
    assert decide(replace(held, lost=True)) == "cannot tell"


@pytest.mark.parametrize("why", [{"lost": True}, {"knocks": 0.5}])
def test_levels_alone_call_no_fault_in_a_lost_angle_or_between_knocks(why):
    found = replace(evidence(lines=4.0), **why)
    assert decide(evidence(lines=4.0)) == "fault"
    assert decide(found) == "cannot tell"
    told = told_of(decide(found), found)
    assert ("Knocks drown the gears" in told) == ("knocks" in why)
    # nor is a clean bill of health given in an angle that was lost
    assert (decide(replace(evidence(), **why)) == "healthy") == ("knocks" in why)


def test_what_does_not_come_again_is_no_tooth():
    again = evidence(gear(weights(4)))
    once = replace(again, recurrence=2.0)
    assert decide(again) == "fault"
    assert decide(once) == "cannot tell"
    assert not flags_of(once)


def test_what_could_not_be_heard_leaves_the_answer_open_and_is_said():
    found, deaf = evidence(), "Damage of the gear might have gone unnoticed."
    assert decide(found) == "healthy"
    assert decide(found, deaf) == "cannot tell"
    told = told_of("cannot tell", found, deaf)
    assert told.startswith(
        f"Nothing speaks against the machine, but not all of it was heard. {deaf}"
    )
    assert decide(evidence(lines=4.0), deaf) == "fault"


@pytest.mark.parametrize(("heavy", "verdict"), [(0.6, "healthy"), (0.9, "cannot tell")])
def test_a_mesh_far_louder_than_any_learned_load_leaves_the_answer_open(heavy, verdict):
    found = evidence(heavy=heavy)
    decision = decide(found)
    assert decision == verdict
    told = told_of(decision, found)
    assert ("8 dB louder" in told) == (verdict == "cannot tell")


def test_a_healthy_verdict_says_how_much_wear_would_pass_for_load():
    found = evidence(heavy=-0.1)
    told = told_of(decide(found), found)
    assert f"below a loss of about {100 * (1 - np.exp(-0.85)):.0f} %" in told


def test_runout_is_not_blamed_for_a_bearing_or_a_moved_sensor():
    growth = runout_growth({(1, "pinion"): np.array([15.0, *5 * [0]])})
    bearing = evidence(lines=2.0, noise=3.0, noise_gain_db=6.0, runout=growth)
    assert [f.kind for f in flags_of(bearing, None, [change(-10.0)])] == ["broadband rise"]
    moved = evidence(lines=4.0, runout=growth)
    assert [f.kind for f in flags_of(moved, None, [change(-10.0)], 0.7)] == ["path changed"]
    unsure = replace(evidence(runout=growth), angle=0.3)
    assert flags_of(unsure) == ()


def test_the_spread_overrules_a_peak_of_the_energy():
    row = features(far_db=6.0, several_db=5.0, peak_db=16.0, peaks=1.0, teeth_involved=3.0)[
        1, "pinion"
    ]
    assert rule_probabilities(row)["tooth damage"] > 0.5
    assert rule_probabilities(row, departure_spread(gear(PITTED)))["tooth damage"] < 0.01
    flat = row | {"peak_db": 2.0}
    assert rule_probabilities(flat)["tooth damage"] < 0.1
    assert rule_probabilities(flat, departure_spread(gear(weights(3))))["tooth damage"] > 0.4


def profile(log10, stage=1, gear="pinion", tooth=7, order=None):
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
        against="other teeth",
    )


def test_of_its_own_teeth_nothing_striking_is_no_flag():
    assert own_teeth_flags([]) == ()
    assert own_teeth_flags([profile(-1.9)]) == ()
    # gears looked at are corrected for
    assert own_teeth_flags([profile(-2.1)])
    assert own_teeth_flags([profile(-2.1), *3 * [profile(0.0, stage=2)]]) == ()


def test_the_clearest_gear_is_flagged_and_names_the_others():
    found = [profile(-3), profile(-9, stage=2, gear="gear"), profile(-0.1, gear="gear")]
    (flag,) = own_teeth_flags(found)
    assert (flag.kind, flag.stage, flag.gear, flag.tooth) == ("tooth damage", 2, "gear", 7)
    assert flag.false_alarm_probability == pytest.approx(3e-9)
    assert "8.2 times the energy of its median tooth" in flag.evidence[0]
    assert "cannot be known whether it was always so" in flag.evidence[1]
    assert any("pinion of stage 1 shows it too" in line for line in flag.evidence)


def test_a_place_without_a_number_is_told_as_a_share_of_the_turn():
    (flag,) = own_teeth_flags([profile(-9, tooth=None)])
    assert flag.tooth is None
    assert "0.25 of a turn" in flag.evidence[0]
    assert not any("tachometer" in line for line in flag.evidence)


def test_gears_on_one_shaft_that_cannot_be_told_apart_are_both_named():
    one = profile(-30.0, stage=1, gear="gear", tooth=None, order=0.4)
    other = profile(-9.0, stage=2, gear="pinion", tooth=None, order=0.4)
    (flag,) = own_teeth_flags([one, other])
    assert (flag.stage, flag.gear, flag.tooth) == (None, None, None)
    assert "it may be either of them" in flag.evidence[-1]


def test_what_no_recording_tells_by_itself_is_said():
    told = own_teeth_reason([], "There is no healthy reference")
    for unknown in ("no healthy reference", "always so", "how much stiffness", "eccentricity"):
        assert unknown in told


def test_sentences_begin_with_the_most_striking():
    told = sentences(
        [change(-19.0), change(-30.0, harmonic=2), change(-14.0, harmonic=3, scatter_db=5.0)]
    )
    assert "harmonic 2 fell 10.0 dB" in told[0]
    assert "harmonic 1 rose 1.0 dB" in told[1]
    assert len(sentences([change(float(i)) for i in range(20)])) == 4
    assert sentences([]) == ()


@pytest.mark.parametrize(
    ("noise", "gain_db", "verdict", "told"),
    [
        (0.0, -30.0, "cannot tell", "30 dB quieter"),
        (0.0, -15.0, "no mesh found", "that this one does not"),
        (3.0, -15.0, "fault", "is gone"),
        (2.0, -15.0, "fault", "is gone"),
        (3.0, -21.0, "cannot tell", "stood still"),
        (0.0, 15.0, "no mesh found", "No gear mesh"),
        # what is left of a gear without a tooth is far louder in all bands alike
        (0.0, 25.0, "fault", "is gone"),
    ],
)
def test_a_mesh_that_is_gone_is_a_fault_but_where_all_is_quiet(noise, gain_db, verdict, told):
    alone = Analysis(
        recording="a",
        machine="m",
        verdict="no mesh found",
        reason="No gear mesh of this machine stands out.",
        score=0.0,
        false_alarm_probability=1.0,
        compared_with="nothing",
        signature=None,
        indicators={},
        warnings=(),
    )
    compared = evidence(noise=noise, noise_gain_db=gain_db)
    deviation = compared.deviation
    found = mesh_lost(alone, compared)
    assert found.verdict == verdict
    if verdict == "fault":
        strength = broadband_strength(deviation.broadband)
        strength = comparable(max(strength, LIMITS.fault) if gain_db > 20.0 else strength)
        chance = false_alarm_probability(strength, 3, deviation.gap)
        assert found.false_alarm_probability == found.flags[0].false_alarm_probability == chance
    assert told in found.reason
    assert [flag.kind for flag in found.flags] == ["mesh lost"] * (verdict == "fault")
    assert found.compared_with == ("nothing" if verdict == "no mesh found" else "reference")


def test_a_changed_level_is_what_was_expected_and_the_rest():
    rest = np.array([[1.0, np.nan, -2.0]])
    expected_db, sigma_db = np.array([[[-10.0, -20.0, -30.0]], [[0.5, 0.6, 0.7]]])
    told = levels()._replace(expected_db=expected_db, rest_db=rest, sigma_db=sigma_db)
    named = {"stage": 1, "gear": "gear", "spacing": 0.4, "shaft": 2, "lines": (0,)}
    families = [Family(kind="sidebands", harmonic=k, **named) for k in (1, 2, 3)]
    one, other = level_changes(told, ["a1"], families)
    assert (one.level_db, one.reference_db, one.change_db, one.scatter_db) == (
        -9.0,
        -10.0,
        1.0,
        0.5,
    )
    assert (other.level_db, other.reference_db, other.standardised) == (-32.0, -30.0, -2.0 / 0.7)
    assert (other.channel, other.family, other.harmonic) == ("a1", families[2].name, 3)


@pytest.mark.parametrize(
    ("speed_hz", "swing", "told"),
    [
        (25.0, 0.001, []),
        (30.1, 0.04, []),
        (27.0, 0.001, ["speed 27.00 Hz is more than"]),
        (25.0, 0.09, ["the speed swung by +-9 %"]),
    ],
)
def test_a_speed_is_new_that_no_healthy_recording_comes_near(speed_hz, swing, told):
    known = [SimpleNamespace(speed_hz=x, speed_fluctuation=y) for x, y in ((25, 0.0), (30, 0.04))]
    reference = SimpleNamespace(notes=(), profiles=known, channel_names=("a", "b"))
    speed = SimpleNamespace(estimated_hz=speed_hz)
    new = SimpleNamespace(channel_names=("a", "b"), speed=speed, speed_fluctuation=swing)
    found = [*limits(new, reference)]
    assert [note[: len(own)] for note, own in zip(found, told, strict=True)] == told
    new.channel_names = ("b", "c")
    left_out, missing = list(limits(new, reference))[:2]
    assert left_out == "channels not in the reference were left out: c"
    assert missing.startswith("channels of the reference not looked at: a;")


@pytest.mark.parametrize("fixed", ["ring", "carrier"])
def test_what_a_ring_that_stands_still_hides_far_from_the_sensor_is_said(fixed):
    stage = PlanetaryStage(
        sun_teeth=18, planet_teeth=27, ring_teeth=72, planets=3, fixed=fixed, driving="sun"
    )
    own = replace(machine(), stages=(machine().stages[0], stage))
    best = SimpleNamespace(search=None, load_unlearned=False)
    finding = SimpleNamespace(machine=own, best=best, searched=())
    told = [*taken_for_granted(replace(evidence(), finding=finding))]
    assert [note.split(":")[0] for note in told] == (
        ["the ring of stage 2 stands still"] if fixed == "ring" else []
    )


def test_two_teeth_are_several_whatever_the_sidebands_are_like():
    """Two cracks near each other move the first sidebands as runout does."""
    pair = weights(4)
    pair[6] = 1.0
    like_runout = features(once_db=20, twice_db=6)
    assert flags_of(evidence(gear(pair)), like_runout)[0].kind == "several teeth"
    smooth = flags_of(evidence(gear(None, smooth=0.4)), like_runout)[0]
    assert smooth.kind == "eccentricity"


def test_meshes_that_are_not_found_are_named_with_the_reason_and_no_others():
    known = [(1, True, ""), (2, False, "too faint"), (3, False, "too fast")]
    names = ("stage", "found", "reason")
    meshes = [SimpleNamespace(**dict(zip(names, own, strict=True))) for own in known]
    assert list(not_found(SimpleNamespace(meshes=meshes))) == [
        "mesh of stage 2 not found: too faint",
        "mesh of stage 3 not found: too fast",
    ]
