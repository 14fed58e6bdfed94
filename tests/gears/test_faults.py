"""Reading faults, and the share of stiffness that they take."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.errors import ArgumentError
from gearmon.gears.damage import loss_in_contact
from gearmon.gears.faults import KINDS, Fault, GearError, parse_fault
from gearmon.gears.pulses import Pulse, PulseTerm, overlap, union


def fault(kind="crack", tooth=1, size=0.2, **data):
    tooth = None if kind == "wear" else tooth
    return Fault(**{"stage": 1, "gear": "pinion", **data}, kind=kind, tooth=tooth, size=size)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("crack:1:pinion:5:20%", fault(tooth=5, size=20.0, unit="%")),
        ("crack:2:gear:17:0.2", fault(tooth=17, stage=2, gear="gear")),
        (" pitting : 1 : sun : 3 : 5e-2 ", fault("pitting", tooth=3, size=0.05, gear="sun")),
        ("wear:1:ring:all:3 %", fault("wear", size=3.0, gear="ring", unit="%")),
    ],
)
def test_reading(text, expected):
    assert parse_fault(text) == expected


def test_per_cent_and_fraction_are_the_same_loss():
    assert parse_fault("crack:1:pinion:5:20%").loss == parse_fault("crack:1:pinion:5:0.2").loss


@given(
    st.sampled_from(sorted(KINDS)),
    st.integers(1, 9),
    st.integers(1, 300),
    st.integers(0, 99),
    st.sampled_from(["", "%"]),
)
def test_written_and_read_again(kind, stage, tooth, size, unit):
    value = size if unit else size / 100
    written = fault(kind, tooth, value, stage=stage, gear="gear", unit=unit)
    assert parse_fault(str(written)) == written


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("crack:1:pinion:5", "has 4 parts and not 5: KIND:STAGE:GEAR:TOOTH:SIZE"),
        ("crck:1:pinion:5:20%", "fault kind 'crck' is not one of .*; did you mean crack?"),
        ("crack:1:pinon:5:20%", r'did you mean "pinion"\?'),
        ("crack:one:pinion:5:20%", "STAGE 'one' must be a whole number"),
        ("crack:0:pinion:5:20%", r"stage = 0 must lie in \[1, 1000\]"),
        ("crack:1:pinion:five:20%", "TOOTH 'five' must be a whole number or 'all'"),
        ("crack:1:pinion:0:20%", r"tooth = 0 must lie in \[1, "),
        ("crack:1:pinion:all:20%", "crack: TOOTH must be one tooth number"),
        ("wear:1:pinion:2:20%", "wear: TOOTH must be 'all'"),
        ("crack:1:pinion:5:deep", "SIZE 'deep' is not a number"),
        ("crack:1:pinion:5:1.5inch", "unit 'inch' is not known for crack; give the loss of stiff"),
        ("stiffness:1:pinion:5:1.5mm", "unit 'mm' is not known for stiffness"),
        ("crack:1:pinion:5:100%", r"size = 100.0 must lie in \[0, 100\) %"),
        ("crack:1:pinion:5:1.0", r"size = 1.0 must lie in \[0, 1\)"),
        ("crack:1:pinion:5:20", r"size = 20.0 must lie in \[0, 1\)"),
        ("crack:1:pinion:5:-0.1", r"size = -0.1 must lie"),
        ("crack:1:pinion:5:nan", "SIZE 'nan' is not a number"),
    ],
)
def test_refusals(text, match):
    with pytest.raises(ArgumentError, match=match):
        parse_fault(text)


@pytest.mark.parametrize("number", ["a", float("nan"), 1.5, 0])
@pytest.mark.parametrize("name", ["stage", "tooth"])
def test_a_place_that_is_no_whole_number_is_refused(name, number):
    place = {"stage": 1, "tooth": 2} | {name: number}
    refused = rf'{name} = "?{number}"? must (be a whole number|lie in \[1, )'
    with pytest.raises(ArgumentError, match=f"fault {refused}"):
        Fault(kind="crack", gear="pinion", size=0.1, unit="", **place)
    with pytest.raises(ArgumentError, match=f"error {refused}"):
        GearError(kind="pitch", gear="pinion", size_m=1e-5, **place)
    with pytest.raises(ArgumentError, match="stage = None must be"):
        Fault(kind="crack", stage=None, gear="pinion", tooth=1, size=0.1, unit="")


def test_a_size_that_is_no_number_is_refused():
    with pytest.raises(ArgumentError, match="must lie in"):
        fault(size=float("nan"))


# --- losses --------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", sorted(set(KINDS) - {"wear"}))
def test_size_zero_takes_nothing(kind):
    assert loss_in_contact(fault(kind, size=0.0), 1.6, 0.8) == ()


@pytest.mark.parametrize("kind", ["stiffness", "crack"])
def test_root_damage_acts_over_the_whole_contact(kind):
    (loss,) = loss_in_contact(fault(kind), 1.6, 0.5)
    assert (loss.weight, *loss.pulse.edges) == (0.2, 0.0, 1.6)
    assert (loss.face_start, loss.face_end) == (0.0, 1.0)


def test_breakage_takes_a_part_of_the_face_width_fully():
    (loss,) = loss_in_contact(fault("breakage", size=0.3), 1.6, 0.5)
    assert (loss.weight, loss.face_start, loss.face_end) == (1.0, 0.0, 0.3)


def test_pitting_acts_about_the_pitch_point_only():
    (pitting,), (spall,) = (loss_in_contact(fault(kind), 1.6, 0.7) for kind in ("pitting", "spall"))
    (low, high), (start, end) = pitting.pulse.edges, spall.pulse.edges
    assert low < start < 0.7 < end < high
    assert 0.5 * (low + high) == pytest.approx(0.7)


def test_a_pitch_point_at_the_edge_leaves_a_part_of_the_band():
    (edge,) = loss_in_contact(fault("pitting"), 1.6, 0.05)
    assert edge.pulse.edges[0] == 0.0
    assert loss_in_contact(fault("pitting"), 1.6, -2.0) == ()


PLACES = st.integers(0, 16)
LOSSES = st.builds(
    lambda w, a, b, c, d: PulseTerm(
        Pulse.constant(min(a, b) / 10, (max(a, b) + 1) / 10),
        w,
        face_start=min(c, d) / 16,
        face_end=max(c, d) / 16,
    ),
    st.floats(0.01, 0.99),
    *[PLACES] * 4,
)


def loss_at(losses, phase, face):
    return sum(
        p.weight * float(p.pulse.value(phase)) for p in losses if p.face_start <= face < p.face_end
    )


@given(st.lists(LOSSES, max_size=3), LOSSES, st.floats(0, 1.8), st.floats(0, 1))
def test_what_two_faults_leave_is_the_product_of_what_each_leaves(many, other, phase, face):
    total = ()
    left = 1.0
    for loss in [*many, other]:
        total = union(total, [loss])
        left *= 1 - loss_at([loss], phase, face)
    assert 1 - loss_at(total, phase, face) == pytest.approx(left, abs=1e-12)


@given(LOSSES, LOSSES, st.floats(0, 1.6), st.floats(0, 1))
def test_overlap_is_the_product(one, two, phase, face):
    product = loss_at([one], phase, face) * loss_at([two], phase, face)
    assert loss_at(overlap([one], [two]), phase, face) == pytest.approx(product, abs=1e-12)
