"""Every kind of damage on every gear: where it acts, how it grows, combines, and what it costs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gearmon.errors import ArgumentError
from gearmon.gears.damage import measured_losses, size_for_loss, stiffness_loss
from gearmon.gears.faults import parse_fault
from gearmon.gears.pairs import mesh_pairs
from gearmon.gears.pulses import PulseTrain
from gearmon.gears.stiffness import mesh_stiffness
from gearmon.gears.tooth_pairs import POTENTIAL_ENERGY, ToothPair, teeth_of
from gearmon.machine import ParallelStage, PlanetaryStage

PARALLEL = ParallelStage(pinion_teeth=26, gear_teeth=53, module_mm=2.0, face_width_mm=20.0)
HELICAL = replace(PARALLEL, helix_angle_deg=14.0, face_width_mm=30.0)
PLANETARY = PlanetaryStage(
    sun_teeth=20, planet_teeth=40, ring_teeth=100, planets=4, module_mm=2.0, face_width_mm=20.0
)
#: Mesh in which each gear is looked at.
MESHES = {
    "pinion": (PARALLEL, 0),
    "gear": (HELICAL, 0),
    "sun": (PLANETARY, 0),
    "planet": (PLANETARY, 0),
    "ring": (PLANETARY, 1),
}
#: A size of every kind, of one tooth.
SIZES = {
    "stiffness": ["20%", "0.2"],
    "crack": ["1mm", "1mm,angle=45,width=8,from=3", "0.5mm,far=1.2", "1mm,limit=parabolic", "15%"],
    "pitting": ["12%flank", "0.2flank,radius=0.3,depth=0.1", "2level", "severe", "10%"],
    "spall": ["5x1.2x0.3mm", "5x1.2x0.3mm,at=-0.3,from=6", "10%"],
    "breakage": ["6mm", "6mm,height=1", "5mm,from=10", "20%"],
    "missing": [""],
}
CASES = [
    (gear, f"{kind}:1:{gear}:4" + (f":{size}" if size else ""))
    for gear in MESHES
    for kind, sizes in SIZES.items()
    for size in sizes
]
FORMS = ["parabolic", POTENTIAL_ENERGY]


def mesh_of(gear, texts, form):
    stage, number = MESHES[gear]
    pair = mesh_pairs(stage, 1)[number]
    return pair, mesh_stiffness(pair, [parse_fault(text) for text in texts], form)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("gear", "text"), CASES)
def test_a_fault_acts_on_its_tooth_only(gear, text, form):
    """Bit by bit the same everywhere but in the contact of tooth 4; softer there, never stiffer."""
    pair, healthy = mesh_of(gear, [], form)
    _, hurt = mesh_of(gear, [text], form)
    teeth = pair.member(gear).teeth
    assert hurt.period_mesh == teeth
    x = (np.arange(40 * teeth) + 0.37) / 40
    length = max(healthy.healthy.terms[0].pulse.length, pair.contact_ratio) + pair.overlap_ratio
    outside = (x < 3) | (x > 3 + length)
    one, two = healthy.at(x), hurt.at(x)
    np.testing.assert_array_equal(two[outside], one[outside])
    assert (two[~outside] <= one[~outside] * (1 + 1e-9)).all()
    assert two.min() > 0
    assert two[~outside].min() < one[~outside].min() or (two < 0.999 * one).any()


@pytest.mark.parametrize(("gear", "text"), [case for case in CASES if "missing" not in case[1]])
def test_written_read_and_of_no_size(gear, text):
    fault = parse_fault(text)
    assert parse_fault(str(fault)) == fault
    if fault.unit == "level":
        return
    nothing = replace(fault, size=0.0, far=0.0 if fault.far else fault.far)
    for form in FORMS:
        _, healthy = mesh_of(gear, [], form)
        _, zero = mesh_of(gear, [str(nothing)], form)
        x = np.linspace(0, 9, 200)
        assert zero.period_mesh == 1
        np.testing.assert_array_equal(zero.at(x), healthy.at(x))


@given(
    st.sampled_from(sorted(MESHES)),
    st.sampled_from(["crack", "crack-parabolic", "pitting", "spall", "breakage", "wear"]),
    st.floats(0.01, 0.95),
    st.floats(0.01, 0.95),
)
@example("sun", "crack-parabolic", 0.5, 0.5)
def test_size_to_loss_and_back_on_every_gear(gear, kind, one, two):
    stage, number = MESHES[gear]
    pair = mesh_pairs(stage, 1)[number]
    teeth = teeth_of(pair)
    index = [member.name for member in pair.members].index(gear)
    texts = {
        "crack": "crack:1:{}:4:{}mm",
        "crack-parabolic": "crack:1:{}:4:{}mm,limit=parabolic",
        "pitting": "pitting:1:{}:4:{}flank",
        "spall": "spall:1:{}:4:{}x1x0.2mm",
        "breakage": "breakage:1:{}:4:{}mm",
        "wear": "wear:1:{}:all:{}mm",
    }
    most = {"pitting": 0.4, "spall": 19.0, "breakage": 19.0, "wear": 0.3}.get(kind, 2.0)
    less, more = sorted((one, two))
    small, large = (
        parse_fault(texts[kind].format(gear, f"{most * size:.9f}")) for size in (less, more)
    )
    losses = [stiffness_loss(fault, teeth, index) for fault in (small, large)]
    assert losses[0].mean <= losses[1].mean * (1 + 1e-9)
    assert losses[0].greatest <= losses[1].greatest * (1 + 1e-6)
    for fault, loss in zip((small, large), losses, strict=True):
        found = size_for_loss(fault, loss.mean, teeth, index)
        assert found.size == pytest.approx(fault.size, rel=5e-3, abs=1e-4 * most)
        assert stiffness_loss(found, teeth, index).mean == pytest.approx(loss.mean, rel=1e-6)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("gear", sorted(MESHES))
def test_faults_of_one_tooth_and_of_neighbours_combine(gear, form):
    """Together they cost no less than each, and hardly more than both by themselves."""
    crack, spall = f"crack:1:{gear}:4:1mm", f"spall:1:{gear}:4:5x1.2x0.3mm"
    next_one, own = f"crack:1:{gear}:5:1mm", "crack:1:{}:4:15%".format
    _, healthy = mesh_of(gear, [], form)
    x = np.linspace(2.503, 8.503, 700)
    sound = healthy.at(x)
    for pair_of in ((crack, spall), (crack, next_one), (crack, own(gear)), (spall, next_one)):
        lost = [sound - mesh_of(gear, texts, form)[1].at(x) for texts in ([a] for a in pair_of)]
        both = sound - mesh_of(gear, list(pair_of), form)[1].at(x)
        assert (both >= np.maximum(*lost) - 1e-9 * sound).all()
        assert (both <= 1.06 * (lost[0] + lost[1]) + 1e-9 * sound).all()


def test_true_periods():
    def period(*texts):
        return mesh_of("pinion", texts, "parabolic")[1].period_mesh

    assert period() == 1
    assert period("wear:1:gear:all:0.05mm") == 1
    assert period("crack:1:pinion:3:1mm", "spall:1:pinion:9:5x1x0.2mm") == 26
    assert period("crack:1:gear:3:1mm") == 53
    assert period("crack:1:pinion:3:1mm", "crack:1:gear:7:1mm") == math.lcm(26, 53)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("crack:1:pinion:4:9mm", r"its depth must lie in \[0, "),
        ("crack:1:pinion:4:1mm,angle=95", r"must lie in \[5, 90\] deg"),
        ("crack:1:pinion:4:1mm,width=15,from=8", "over the face width of 20 mm"),
        ("crack:1:ring:4:9mm", r"its depth must lie in \[0, "),
        ("spall:1:ring:4:25x1x0.2mm", "over the face width of 20 mm"),
        ("spall:1:gear:4:5x1x9mm", "it must be below"),
        ("pitting:1:planet:4:60%flank", r"must lie in \[0, 50\] %flank"),
        ("breakage:1:sun:4:21mm", "over the face width of 20 mm"),
        ("wear:1:pinion:all:5mm", "it must be below"),
        ("crack:1:pinion:4:100%", r"must lie in \[0, 100\) %"),
        ("crack:1:pinion:27:1mm", "the pinion of .* has 26 teeth"),
    ],
)
def test_sizes_out_of_range_are_refused_with_the_range(text, words):
    gear = text.split(":")[2]
    with pytest.raises(ArgumentError, match=words):
        mesh_of(gear, [text], POTENTIAL_ENERGY)


# --- what is not needed is not computed ----------------------------------------------------------


def contacts(monkeypatch, stage, texts):
    """Contact positions at which compliances of teeth were computed."""
    counted = []
    compliances = ToothPair.compliances

    def counting(self, roll_m, *rest, **named):
        counted.append(np.size(roll_m))
        return compliances(self, roll_m, *rest, **named)

    with monkeypatch.context() as patch:
        patch.setattr(ToothPair, "compliances", counting)
        pair = mesh_pairs(stage, 1)[0]
        mesh = mesh_stiffness(pair, [parse_fault(text) for text in texts], POTENTIAL_ENERGY)
        mesh.at(np.arange(200 * mesh.period_mesh) / 200)
    return sum(counted)


def test_one_damaged_tooth_costs_its_own_contacts(monkeypatch):
    crack = "crack:1:pinion:5:1mm"
    healthy = contacts(monkeypatch, PARALLEL, [])
    hurt = contacts(monkeypatch, PARALLEL, [crack])
    # a turn would cost 26 mesh periods
    assert hurt < 14 * healthy
    # twice as many teeth in the turn, the same contacts
    more = replace(PARALLEL, pinion_teeth=52, gear_teeth=53)
    assert contacts(monkeypatch, more, [crack]) <= 1.2 * hurt
    # teeth that are damaged alike are computed once for their stiffness
    alike = contacts(monkeypatch, PARALLEL, [crack, "crack:1:pinion:15:1mm"])
    assert alike - healthy <= 2.1 * (hurt - healthy)


def test_no_more_harmonics_than_asked_for(monkeypatch):
    _, mesh = mesh_of("pinion", ["crack:1:pinion:5:1mm"], "parabolic")
    assert mesh.mean_n_per_m > 0
    asked = []
    coefficients = PulseTrain.coefficients

    def counting(self, orders):
        asked.append((self.period_mesh, int(np.max(orders))))
        return coefficients(self, orders)

    monkeypatch.setattr(PulseTrain, "coefficients", counting)
    assert len(mesh.harmonics(130)) == 130
    assert asked == [(1, 5), (26, 130)]


# --- load that finds no flank --------------------------------------------------------------------


def mean_loss(gear, text):
    stage, number = MESHES[gear]
    pair = mesh_pairs(stage, 1)[number]
    index = [member.name for member in pair.members].index(gear)
    return stiffness_loss(parse_fault(text.format(gear)), teeth_of(pair), index).mean


@given(st.sampled_from(["pinion", "gear", "sun"]), st.floats(0.01, 19.0), st.floats(0.0, 0.9))
def test_a_spall_as_high_as_the_flank_costs_what_a_breakage_does(gear, width, start):
    """So shallow that it does not weaken the section, it costs the share of the face."""
    face = MESHES[gear][0].face_width_mm
    place = f",from={start * (face - width):.9f}"
    spall = mean_loss(gear, f"spall:1:{{}}:4:{width:.9f}x9x1e-6mm{place}")
    broken = mean_loss(gear, f"breakage:1:{{}}:4:{width:.9f}mm{place}")
    assert broken == pytest.approx(width / face, rel=1e-6)
    assert spall == pytest.approx(broken, rel=1e-4)


@pytest.mark.parametrize("gear", ["pinion", "gear", "planet", "ring"])
@pytest.mark.parametrize("place", ["", ",at=0.9"])
def test_the_loss_by_a_spall_is_continuous_in_its_size(gear, place):
    """Also where it reaches across the whole face, and as it grows from nothing."""
    face = MESHES[gear][0].face_width_mm
    widths = [1e-6, 1e-3 * face, 0.9799 * face, 0.9801 * face, 0.9999 * face, face]
    lost = [mean_loss(gear, f"spall:1:{{}}:4:{w:.9f}x1x0.2mm{place}") for w in widths]
    assert lost[0] < 1e-6
    assert (np.diff(lost) >= 0).all()
    assert lost[5] - lost[2] < 1e-3 * lost[5]
    lengths = [mean_loss(gear, f"spall:1:{{}}:4:5x{x}x0.2mm{place}") for x in (1e-6, 0.01, 0.011)]
    assert lengths[0] < 1e-5
    assert lengths[2] == pytest.approx(1.1 * lengths[1], rel=0.05)


@given(st.floats(1.0, 29.0), st.floats(0.0, 1.0))
def test_slices_of_a_helical_tooth_lose_by_a_spall_what_a_spall_through_the_face_costs(
    width, place
):
    """And slices beside it nothing."""
    face = HELICAL.face_width_mm
    start = place * (face - width)
    pair = teeth_of(mesh_pairs(HELICAL, 1)[0])
    phase = np.linspace(0.05, 0.95, 40) * pair.contact_ratio

    def lost(text, slice_mm):
        share = slice_mm / face
        return sum(
            term.weight * term.pulse.at(phase)
            for term in measured_losses([parse_fault(text)], pair, 0, is_helical=True)
            if term.face_start <= share <= term.face_end
        )

    own = f"spall:1:pinion:4:{width:.9f}x1.2x0.3mm,from={start:.9f}"
    through = lost(f"spall:1:pinion:4:{face}x1.2x0.3mm", 0.5 * face)
    assert through.max() > 0.1
    np.testing.assert_allclose(lost(own, start + 0.5 * width), through, rtol=1e-9, atol=1e-12)
    for beside in (0.5 * start, 0.5 * (start + width + face)):
        if abs(beside - start - 0.5 * width) > 0.5 * width + 1e-6:
            assert np.all(lost(own, beside) == 0)
