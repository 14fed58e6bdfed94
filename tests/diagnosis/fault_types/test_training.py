"""Classifiers trained on simulated signatures: what they learn, and whether they know how sure."""

from __future__ import annotations

from functools import cache
from itertools import islice

import numpy as np
import pytest
from reference.simulated_machines import one_pair, two_stages
from reference.small_gearbox import machine

from gearmon.diagnosis.fault_types import KINDS, NAMES, NONE, KindClassifier, training
from gearmon.diagnosis.fault_types.kinds import judge_kind, rule_probabilities
from gearmon.diagnosis.fault_types.training import (
    Example,
    MachineLines,
    examples,
    train_kinds,
    training_table,
)
from gearmon.diagnosis.hypotheses.turns import departure_energy
from gearmon.errors import ArgumentError
from gearmon.machine import Machine, OperatingPoint, ParallelStage
from gearmon.signatures.expected.baseline import expected_signature
from gearmon.signatures.measured.reference import WheelPattern

TRAINED_ON, ASKED = 480, 240
WHOLE_TURN = ("eccentricity", "misalignment", "looseness")


@cache
def lines():
    return MachineLines(machine())


@cache
def drawn(seed, count):
    random = np.random.default_rng(seed)
    return [Example(lines(), KINDS[i % len(KINDS)], random) for i in range(count)]


@cache
def trained():
    return KindClassifier(random_state=0).fit(*training_table(drawn(1, TRAINED_ON)))


def told(made):
    rows, kinds = training_table(made)
    return trained().predict_proba(rows), kinds


def accuracy(shares, kinds):
    return float(np.mean(trained().classes_[shares.argmax(axis=1)] == kinds))


def pair(**changes):
    """A machine that is not the one trained on."""
    stage = {"pinion_teeth": 29, "gear_teeth": 43, "module_mm": 3.0, "face_width_mm": 30.0}
    return Machine(
        name="another",
        operating=(OperatingPoint(speed_rpm=2100.0, torque_nm=200.0),),
        stages=(ParallelStage(**(stage | changes)),),
    )


def test_lines_of_a_tooth_are_those_of_the_expected_signature():
    gear = next(g for g in lines().gears if g.wheel.gear == "pinion")
    weight = np.zeros(23)
    weight[4] = 0.1
    ours = gear.by_tooth("crack", weight)
    signature = expected_signature(
        machine(), ["crack:1:pinion:5:10%"], tolerance=1e-6, max_hz=8.6 * 23 * 2960 / 60
    )
    number = 23 * signature["mesh_harmonic"] + signature["sideband"]
    value = signature["acceleration_ms2"] * np.exp(1j * signature["phase_rad"])
    known = dict(zip(number.tolist(), value.tolist(), strict=True))
    side = gear.distance != 0
    theirs = np.array([known[n] for n in gear.wheel.number[side].tolist()])
    # acceleration is counted along the displacement there, against it here
    assert np.linalg.norm(ours[side] + theirs) < 0.02 * np.linalg.norm(theirs)


def test_lines_of_several_teeth_add_to_first_order():
    gear = next(g for g in lines().gears if g.wheel.gear == "gear")
    one, two = np.zeros(57), np.zeros(57)
    one[3], two[40] = 0.1, 0.2
    both = gear.by_tooth("pitting", one + two)
    apart = gear.by_tooth("pitting", one) + gear.by_tooth("pitting", two)
    assert np.allclose(both, apart)


def test_unit_effects_have_the_rms_of_the_sound_mesh():
    sound = np.linalg.norm(lines().healthy)
    for gear in lines().gears:
        for kind in ("eccentricity", "misalignment", "profile"):
            assert np.linalg.norm(gear.added[kind]) == pytest.approx(sound, rel=1e-3)


@pytest.mark.parametrize("number", [1, 2])
def test_an_error_moves_the_teeth_or_changes_their_contact(number):
    """What only moves them has no lines but those one or two turns away from the mesh."""
    kind = ("eccentricity", "misalignment")[number - 1]
    for gear in lines().gears:
        moved = gear.multiple(number, 0.0, 0.0)
        assert set(np.abs(gear.distance[np.abs(moved) > 1e-9 * np.abs(moved).max()])) == {number}
        touched = gear.multiple(number, 1.0, 0.0)
        np.testing.assert_allclose(touched, gear.added[kind])
        both = gear.multiple(number, 0.25, 0.0)
        np.testing.assert_allclose(both, 0.25 * touched + 0.75 * moved, rtol=1e-12)
        # a quarter of a turn, four times over
        turned = gear.multiple(number, 1.0, np.pi / 2) / np.where(touched == 0, 1.0, touched)
        np.testing.assert_allclose(turned[touched != 0] ** 4, 1.0, rtol=1e-9)
        once = gear.distance[touched != 0] == 1
        np.testing.assert_allclose(turned[touched != 0][once], 1j, atol=1e-9)


def test_load_moves_the_lines_of_the_mesh_and_not_those_of_errors(monkeypatch):
    """A sound machine under another load, at the same speed."""
    seen = []
    measured = training._Sensors.measured

    def watched(self, sound, *noise, **more):
        seen.append(sound)
        return measured(self, sound, *noise, **more)

    monkeypatch.setattr(training._Sensors, "measured", watched)
    log_uniform = training.log_uniform
    still = (0.01, 0.1)  # how far another speed moves levels
    monkeypatch.setattr(
        training,
        "log_uniform",
        lambda rng, *ends: 0.0 if ends == still else log_uniform(rng, *ends),
    )
    random = np.random.default_rng(4)
    loads = []
    for _ in range(6):
        seen.clear()
        Example(lines(), NONE, random)
        one, two = seen
        mesh = lines().healthy != 0
        assert not np.array_equal(one[~mesh], 0.0 * one[~mesh])
        np.testing.assert_allclose(two[~mesh], one[~mesh], rtol=1e-12)
        loads.append(np.mean(((two - one)[mesh] / lines().healthy[mesh] + 1.0).real))
        np.testing.assert_allclose(two - one, (loads[-1] - 1.0) * lines().healthy, atol=1e-9)
    assert all(0.7 <= own <= 1.4 for own in loads)
    assert np.ptp(loads) > 0.05


def test_the_size_of_wear_is_its_effect_over_the_sound_mesh():
    """Of teeth that are otherwise alike, the lines that are added, over those of the mesh."""
    sound = np.linalg.norm(lines().healthy)
    for seed, gear in enumerate(lines().gears):
        added = training._DRAWN["wear"](gear, 1e-9, np.random.default_rng(seed))
        assert added.size == pytest.approx(np.linalg.norm(added.displacement) / sound, rel=2e-3)


def test_the_same_seed_draws_the_same_examples():
    one, two = (list(islice(examples(machine(), 5), 8)) for _ in range(2))
    assert all(a.features == b.features and a.kind == b.kind for a, b in zip(one, two, strict=True))
    assert {example.kind for example in one} == set(KINDS)


def test_drawn_levels_scatter_by_the_errors_that_they_are_given():
    """Of lines far above the noise, which is all that two recordings do not share here."""
    random = np.random.default_rng(12)
    shape = (2, *lines().healthy.shape)
    sound = lines().healthy + 0.1 * np.abs(lines().healthy).max() * (
        random.normal(size=shape) * np.array([[[1.0]], [[1j]]])
    ).sum(axis=0)
    sensors = training._Sensors(lines(), sound, random)
    sensors.departure, sensors.gain = 0.0, np.ones(len(sensors.path))
    drawn_levels = [sensors.measured(sound)[:2] for _ in range(200)]
    level_db, error_db = np.array(drawn_levels).swapaxes(0, 1)
    clear = error_db.max(axis=0) < 0.5
    assert clear.sum() > 20
    ratio = np.std(level_db, axis=0)[clear] / error_db.mean(axis=0)[clear]
    assert np.sqrt(np.mean(ratio**2)) == pytest.approx(1.0, rel=0.05)


def test_the_departure_of_one_tooth_is_found_at_that_tooth():
    random = np.random.default_rng(0)
    gear = next(g for g in lines().gears if g.wheel.gear == "pinion")
    weight = np.zeros(23)
    weight[9] = 1.0

    def pattern(amplitude):
        return WheelPattern(
            stage=1,
            gear="pinion",
            teeth=23,
            order=1.0,
            number=gear.wheel.number,
            mesh=gear.wheel.mesh,
            amplitude=amplitude[None, :],
            variance=np.full((1, len(amplitude)), 1e-12),
        )

    sound = random.normal(size=len(gear.distance)) * np.exp(
        2j * np.pi * random.uniform(size=len(gear.distance))
    )
    crack = gear.by_tooth("crack", weight)
    hurt = sound + 3 * crack / np.abs(crack[gear.distance != 0]).max()
    energy = departure_energy(pattern(hurt), pattern(sound), 0)
    assert abs(int(np.argmax(energy)) - 9) <= 1
    assert np.median(energy) == pytest.approx(1.0)


def test_kinds_of_new_examples_are_told():
    shares, kinds = told(drawn(2, ASKED))
    # sizes reach down to what nothing shows; chance is 1 in 8
    assert accuracy(shares, kinds) > 0.55
    sizes = np.array([example.size for example in drawn(2, ASKED)])
    large = np.zeros(len(kinds), dtype=bool)
    for kind in KINDS[:-1]:
        large |= (kinds == kind) & (sizes > np.median(sizes[kinds == kind]))
    assert accuracy(shares[large], kinds[large]) > 0.65


def test_errors_of_a_whole_gear_are_not_called_a_damaged_tooth():
    shares, kinds = told(drawn(2, ASKED))
    called = trained().classes_[shares.argmax(axis=1)]
    whole = np.isin(kinds, (*WHOLE_TURN, NONE))
    assert np.mean(called[whole] == "tooth damage") < 0.03


def test_probabilities_hold():
    shares, kinds = told(drawn(2, ASKED))
    sure = shares.max(axis=1)
    right = trained().classes_[shares.argmax(axis=1)] == kinds
    hot = kinds[:, None] == trained().classes_
    assert np.mean(np.sum((shares - hot) ** 2, axis=1)) < 0.6
    bins = np.minimum((5 * sure).astype(int), 4)
    gaps = [
        abs(right[bins == b].mean() - sure[bins == b].mean()) * np.mean(bins == b)
        for b in range(5)
        if (bins == b).any()
    ]
    assert sum(gaps) < 0.1


def test_another_machine_is_told_better_than_by_chance():
    random = np.random.default_rng(8)
    other = MachineLines(pair())
    made = [Example(other, KINDS[i % len(KINDS)], random) for i in range(120)]
    assert accuracy(*told(made)) > 0.4


def test_rules_alone_do_better_than_chance():
    rows, kinds = training_table(drawn(2, ASKED))
    called = []
    for row in rows:
        shares = rule_probabilities(dict(zip(NAMES, row.tolist(), strict=True)))
        assert sum(shares.values()) == pytest.approx(1.0)
        called.append(max(shares, key=shares.get))
    assert np.mean(np.array(called) == kinds) > 0.4


def row(**changed):
    return dict.fromkeys(NAMES, 0.0) | {"turns_known": 1.0, "teeth_involved": 4.0} | changed


@pytest.mark.parametrize(
    ("kind", "changed"),
    [
        ("tooth damage", {"peak_db": 18, "peaks": 1, "teeth_involved": 2, "far_db": 2}),
        ("several teeth", {"peak_db": 15, "second_db": 12, "peaks": 3, "teeth_involved": 3}),
        ("distributed pitting", {"far_db": 8, "near_db": 6, "several_db": 6, "twice_db": 4}),
        ("wear", {"mesh_rms_db": 8, "mesh_db": 6}),
        ("eccentricity", {"once_db": 12, "twice_db": 2, "near_db": 9}),
        ("misalignment", {"twice_db": 12, "near_db": 7, "mesh_rms_db": 2}),
        (
            "looseness",
            {"once_db": 8, "twice_db": 8, "thrice_db": 8, "several_db": 7, "shaft_near_db": 8},
        ),
        (NONE, {"peak_db": 3}),
    ],
)
def test_rules_know_the_textbook_cases(kind, changed):
    shares = rule_probabilities(row(**changed))
    assert max(shares, key=shares.get) == kind


@pytest.mark.parametrize(
    ("kind", "known", "slopes"),
    [
        # once_db counts for itself, for what lasts beyond it, and for what follows at two turns
        (
            "eccentricity",
            {"once_db": 12, "twice_db": 10, "several_db": 9, "far_db": 4, "peak_db": 8},
            {"once_db": 3.5, "twice_db": -1, "several_db": -1.5, "far_db": -4, "peak_db": -1},
        ),
        # nothing beyond the first sideband that a smooth change would not have
        (
            "eccentricity",
            {"once_db": 12, "twice_db": 8, "several_db": 5, "far_db": 1, "peak_db": 5},
            {"once_db": 1},
        ),
        # sidebands that fell say as little as those that did not change
        ("eccentricity", {"once_db": 4, "twice_db": -5, "several_db": -9}, {"once_db": 1}),
        (
            "misalignment",
            {"twice_db": 12, "once_db": 5, "thrice_db": 3},
            {"twice_db": 1, "once_db": -1},
        ),
        (
            "misalignment",
            {"twice_db": 12, "once_db": 2, "thrice_db": 5},
            {"twice_db": 1, "thrice_db": -1},
        ),
        # the nearest sidebands stand in for those two turns away, farther lines for the rest
        (
            "misalignment",
            {"turns_known": 0, "near_db": 12, "far_db": 1},
            {"near_db": 1, "far_db": -1},
        ),
        (
            "looseness",
            {"twice_db": 9, "thrice_db": 12, "several_db": 12, "far_db": 3, "shaft_near_db": 2},
            {"twice_db": 1, "far_db": -0.7, "shaft_near_db": 0.3},
        ),
        (
            "looseness",
            {"twice_db": 12, "thrice_db": 12, "several_db": 9, "far_db": -4, "shaft_near_db": -4},
            {"several_db": 1},
        ),
        ("wear", {"mesh_rms_db": 8, "once_db": 3, "peak_db": 8}, {"mesh_rms_db": 1, "once_db": -1}),
        (
            "distributed pitting",
            {"far_db": 4, "peak_db": 8},
            {"far_db": 3, "teeth_involved": 2},
        ),
        (
            "tooth damage",
            {"peak_db": 15, "peaks": 1},
            {"peak_db": 1, "teeth_involved": -4, "peaks": -5},
        ),
        ("several teeth", {"peak_db": 15, "peaks": 2}, {"peak_db": 1, "teeth_involved": -2}),
    ],
)
def test_a_kind_gains_or_loses_so_many_decibels_by_each_more_of_a_feature(kind, known, slopes):
    """By 2.5 dB a kind becomes e times as probable, beside that nothing is wrong."""
    # an event speaks against all that is smooth
    if kind in ("wear", "distributed pitting"):
        slopes = slopes | {"peak_db": -1}

    def speaks_db(**more):
        shares = rule_probabilities(row(**known | more))
        return 2.5 * np.log(shares[kind] / shares[NONE])

    plain = row(**known)
    found = {name: speaks_db(**{name: plain[name] + 1}) - speaks_db() for name in NAMES}
    del found["turns_known"]
    assert found == pytest.approx(dict.fromkeys(found, 0.0) | slopes, abs=1e-6)


def test_a_judgement_names_gear_and_reasons():
    # without single sidebands eccentricity and looseness look alike
    example = next(
        e
        for e in drawn(2, ASKED)
        if e.kind == "eccentricity"
        and e.size > 1
        and next(iter(e.features.values()))["turns_known"]
    )
    for classifier in (None, trained()):
        judged = judge_kind(example.features, classifier)
        assert judged.kind == "eccentricity"
        assert (judged.stage, judged.gear) == example.gears[0]
        assert judged.probability == max(judged.probabilities.values())
        assert "dB" in judged.evidence[0]
        assert judged.to_dict()["method"] == ("rules" if classifier is None else "classifier")
    asked = judge_kind(example.features, gear=(1, "gear"))
    assert asked.gear in ("gear", None)


def test_a_classifier_of_other_features_is_refused():
    other = KindClassifier().fit(
        np.arange(12.0)[:, None], np.repeat(["looseness", "wear", NONE], 4)
    )
    with pytest.raises(ArgumentError, match="trained on 1 features"):
        judge_kind(drawn(2, ASKED)[0].features, other)


def test_training_needs_data_and_examples():
    with pytest.raises(ArgumentError, match="count"):
        train_kinds(machine(), count=8)
    bare = Machine(
        name="bare",
        operating=(OperatingPoint(speed_rpm=1000.0),),
        stages=(ParallelStage(pinion_teeth=20, gear_teeth=40),),
    )
    with pytest.raises(ArgumentError, match="torque_nm"):
        train_kinds(bare)


@pytest.mark.parametrize("known", [one_pair(), two_stages()])
def test_examples_can_be_drawn_of_other_machine_files(known):
    made = list(islice(examples(known, 3), len(KINDS)))
    rows = [[*row.values()] for example in made for row in example.features.values()]
    assert np.isfinite(rows).all()
    assert {example.kind for example in made} == set(KINDS)


def test_training_goes_from_machine_file_to_classifier():
    seen = []
    classifier = train_kinds(machine(), seed=2, count=80, progress=seen.append)
    assert seen == [share / 80 for share in range(1, 81)]
    assert set(classifier.classes_) == set(KINDS)
    assert classifier.n_features_in_ == len(NAMES)
