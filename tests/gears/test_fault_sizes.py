"""Sizes of damage as they are written, and their conversion into losses of stiffness and back."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.tooth_cases import PAPER

from gearmon.errors import ArgumentError
from gearmon.gears.damage import measured_losses, size_for_loss, stiffness_loss
from gearmon.gears.faults import Fault, flank_level, flank_share, parse_fault
from gearmon.gears.pulses import lost_share
from gearmon.gears.tooth_damage import tooth_damage

#: Sizes of every kind, as written.
WRITTEN = [
    "crack:1:pinion:5:1.5mm",
    "crack:1:pinion:5:1.5mm,angle=70,far=0.5,width=12,from=2",
    "spall:1:gear:3:4x1.5x0.5mm",
    "spall:1:gear:3:4x1.5x0.5mm,at=-0.3,from=6",
    "pitting:1:gear:3:0.12flank",
    "pitting:1:gear:3:12%flank,radius=0.3,depth=0.1",
    "pitting:1:pinion:3:2level",
    "breakage:1:pinion:3:5mm,height=1.5,from=15",
    "missing:1:pinion:7",
    "wear:1:gear:all:0.05mm",
]


@pytest.mark.parametrize("text", WRITTEN)
def test_written_and_read_again(text):
    fault = parse_fault(text)
    assert str(fault) == text
    assert parse_fault(str(fault)) == fault
    assert not fault.is_loss


@given(
    st.floats(0, 9).map(lambda x: float(f"{x:g}")),
    st.integers(5, 90),
    st.integers(1, 30),
)
def test_cracks_survive_writing(size, angle, width):
    fault = Fault(
        kind="crack",
        stage=2,
        gear="gear",
        tooth=4,
        size=size,
        unit="mm",
        angle=float(angle),
        width=float(width),
    )
    assert parse_fault(str(fault)) == fault


def test_limit_line_of_a_crack_can_be_chosen():
    text = "crack:1:pinion:5:1.5mm,angle=70,limit=parabolic"
    assert str(parse_fault(text)) == text
    flat, parabolic = (
        stiffness_loss(parse_fault(f"crack:1:pinion:5:1.5mm,limit={name}"), PAPER, 0)
        for name in ("flat", "parabolic")
    )
    assert flat == stiffness_loss(parse_fault("crack:1:pinion:5:1.5mm"), PAPER, 0)
    assert flat.mean < parabolic.mean < 2 * flat.mean
    with pytest.raises(ArgumentError, match=r'limit = "parabola" .* did you mean "parabolic"\?'):
        parse_fault("crack:1:pinion:5:1.5mm,limit=parabola")


@pytest.mark.parametrize(
    ("share", "level"), [(0.0, None), (0.029, None), (0.03, 1), (0.1, 2), (0.3, 3), (0.6, 3)]
)
def test_levels_of_shares(share, level):
    assert flank_level(share) == level


@pytest.mark.parametrize("level", [1, 2, 3])
def test_a_level_and_its_loss_there_and_back(level):
    fault = parse_fault(f"pitting:1:pinion:3:{level}level")
    loss = stiffness_loss(fault, PAPER, 0).mean
    found = size_for_loss(fault, loss, PAPER, 0)
    assert found.unit == "flank"
    assert found.size == pytest.approx(flank_share(level, "level"), rel=1e-6)
    assert flank_level(found.size) == level


def test_units_of_dimensions_may_be_written():
    assert parse_fault("crack:1:pinion:5:1.5 mm, angle=70deg, width=8 mm") == parse_fault(
        "crack:1:pinion:5:1.5mm,angle=70,width=8"
    )


def test_levels_by_number_and_name():
    assert parse_fault("pitting:1:gear:3:severe") == parse_fault("pitting:1:gear:3:3level")
    shares = [flank_share(level, "level") for level in (1, 2, 3)]
    np.testing.assert_allclose(shares, (0.065, 0.2, 0.4))
    assert flank_share(12, "%flank") == pytest.approx(0.12)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("crack:1:pinion:5:1.5mm,angel=70", "dimension of a crack 'angel' .*; did you mean angle"),
        ("wear:1:pinion:all:0.1mm,angle=70", "dimension of a wear 'angle' is not one of none"),
        ("crack:1:pinion:5:1.5mm,angle=95", r"fault angle = 95.0 must lie in \[5, 90\] deg"),
        ("crack:1:pinion:5:1.5mm,angle=steep", "'angle=steep' of a crack is not a number"),
        ("crack:1:pinion:5:1x2x3mm", "must be one number"),
        ("crack:1:pinion:5:-1mm", r"size = -1.0 must lie in \[0, 20000\] mm"),
        ("crack:1:pinion:5:20%,angle=70", "is a loss of stiffness, which has no dimensions"),
        ("spall:1:pinion:5:4mm", "needs its width along the face, its length"),
        ("spall:1:pinion:5:4x0x1mm", r"length = 0.0 must lie in \(0, 20000\] mm"),
        ("pitting:1:pinion:5:60%flank", r"must lie in \[0, 50\] %flank"),
        ("pitting:1:pinion:5:5level", r"size = 5.0 must lie in \[1, 3\]: 1 is slight, 2"),
        ("pitting:1:pinion:5:2mm", "unit 'mm' is not known for pitting.* or its size in flank"),
        ("wear:1:pinion:2:0.1mm", "wear: TOOTH must be 'all'"),
        ("crack:1:pinion:5:2mm,width=-3", r"width = -3.0 must lie in \(0, 20000\] mm"),
        ("crack:1:pinion:5:2mm,from=-3", r"from = -3.0 must lie in \[0, 20000\] mm"),
    ],
)
def test_sizes_without_meaning_are_refused(text, match):
    with pytest.raises(ArgumentError, match=match):
        parse_fault(text)


def test_measured_sizes_have_no_loss_of_their_own():
    with pytest.raises(ArgumentError, match="the loss of stiffness follows from the teeth"):
        _ = parse_fault("crack:1:pinion:5:1.5mm").loss


# --- on a tooth ----------------------------------------------------------------------------------


def test_crack_on_a_tooth():
    damage = tooth_damage([parse_fault(WRITTEN[1])], PAPER.first)
    crack = damage.crack
    assert (crack.depth_m, crack.far_depth_m) == (1.5e-3, 0.5e-3)
    assert crack.angle_rad == pytest.approx(math.radians(70))
    assert (crack.start, crack.extent) == pytest.approx((0.1, 0.6))


@pytest.mark.parametrize("share", [0.01, 0.065, 0.2, 0.4, 0.5])
def test_pits_cover_the_share_asked_for(share):
    tooth = PAPER.second
    damage = tooth_damage([parse_fault(f"pitting:1:gear:3:{share}flank")], tooth)
    low, high = (float(tooth.height(t)) for t in (tooth.start, tooth.tip))
    height = np.linspace(low, high, 20_001)
    area = damage.missing_width_m(height).mean() * (high - low)
    assert area / ((high - low) * tooth.face_width_m) == pytest.approx(share, rel=1e-3)
    assert (damage.missing_width_m(height) < tooth.face_width_m).all()


@pytest.mark.parametrize(
    ("text", "index", "match"),
    [
        ("crack:1:pinion:5:1mm,width=15,from=8", 0, "reaches over the face width of 20 mm"),
        ("spall:1:pinion:5:15x1x0.2mm,from=8", 0, "reaches over the face width of 20 mm"),
        ("spall:1:pinion:5:5x1x0.2mm,at=9", 0, "at=9 mm lies outside the flank"),
        ("breakage:1:pinion:5:25mm", 0, "over the face width .* missing:1:pinion:5"),
        ("breakage:1:pinion:5:20mm", 0, "write missing:1:pinion:5"),
        ("pitting:1:pinion:5:0.45flank,radius=1.2", 0, "do not fit on 45%.* smaller radius"),
        ("crack:1:pinion:5:7mm", 0, "cuts the tooth of the pinion off"),
    ],
)
def test_sizes_that_do_not_fit_the_tooth_are_refused(text, index, match):
    with pytest.raises(ArgumentError, match=match):
        measured_losses([parse_fault(text)], PAPER, index)


def test_breakage_near_the_tip_acts_when_the_tip_is_in_contact():
    (first,) = measured_losses([parse_fault("breakage:1:pinion:3:5mm,height=1")], PAPER, 0)
    (second,) = measured_losses([parse_fault("breakage:1:gear:3:5mm,height=1")], PAPER, 1)
    assert 0 < first.pulse.edges[0] < first.pulse.edges[1] == PAPER.contact_ratio
    assert 0.0 == second.pulse.edges[0] < second.pulse.edges[1] < PAPER.contact_ratio
    assert (first.face_start, first.face_end) == (0.0, 0.25)


# --- conversion ----------------------------------------------------------------------------------


def test_loss_of_a_crack():
    """26/53, true fillet: the loss is that of the pair stiffness over the contact."""
    fault = parse_fault("crack:1:pinion:5:1.5mm")
    loss = stiffness_loss(fault, PAPER, 0)
    phase = (np.arange(4000) + 0.5) / 4000 * PAPER.contact_ratio
    losses = measured_losses([fault], PAPER, 0)
    stiffness = PAPER.compliances(PAPER.roll(phase)).stiffness
    lost = lost_share(losses, phase)
    assert loss.mean == pytest.approx((stiffness * lost).sum() / stiffness.sum(), rel=1e-5)
    assert loss.greatest == pytest.approx(lost.max(), rel=1e-2)
    assert loss.mean < loss.greatest < 1


def test_losses_need_no_conversion():
    loss = stiffness_loss(parse_fault("crack:1:pinion:5:20%"), PAPER, 0)
    assert (loss.mean, loss.greatest, loss.at_middle) == pytest.approx((0.2, 0.2, 0.2))


@given(
    st.sampled_from(
        [
            "crack:1:pinion:5:1mm",
            "spall:1:pinion:5:1x1x0.3mm",
            "pitting:1:pinion:5:0.1flank",
            "breakage:1:pinion:5:1mm",
            "crack:1:pinion:5:1mm,width=10",
        ]
    ),
    st.floats(0.002, 0.97),
)
def test_there_and_back(text, share):
    """Size -> loss -> size."""
    fault = parse_fault(text)
    most = {"crack": 3.0, "spall": 18.0, "pitting": 0.5, "breakage": 19.0}[fault.kind]
    fault = replace(fault, size=share * most)
    loss = stiffness_loss(fault, PAPER, 0).mean
    found = size_for_loss(fault, loss, PAPER, 0)
    assert stiffness_loss(found, PAPER, 0).mean == pytest.approx(loss, rel=1e-6, abs=1e-9)
    assert found.size == pytest.approx(fault.size, rel=2e-3)


def test_no_loss_is_size_zero():
    assert size_for_loss(parse_fault("crack:1:pinion:5:1mm"), 0.0, PAPER, 0).size == 0.0


@pytest.mark.parametrize(
    ("text", "loss", "match"),
    [
        ("spall:1:pinion:5:1x1x0.3mm", 0.9, r"a spall costs at most .* out of its reach"),
        ("crack:1:pinion:5:20%", 0.2, "has no size to be found"),
        ("crack:1:pinion:5:1mm", 1.5, r"loss = 1.5 must lie in \[0, 1\)"),
    ],
)
def test_losses_out_of_reach_are_refused(text, loss, match):
    fault = parse_fault(text)
    with pytest.raises(ArgumentError, match=match):
        size_for_loss(fault, loss, PAPER, 0)
