"""Cracked, spalled and worn teeth against tables, a slow version and laws."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.tooth_cases import PAPER, STRAIGHT, TIAN, teeth
from reference.tooth_reference import tooth_compliance

from gearmon.errors import ArgumentError
from gearmon.gears.tooth import ToothBeam
from gearmon.gears.tooth_damage import SOUND, Hole, RootCrack, ToothDamage, crossings

WITH_BODY = teeth(19, 48, 3.175, 16, (10, 10), 206.8e9, root="straight")


def crack(depth, angle=70.0, **data):
    return ToothDamage(crack=RootCrack(depth_m=1e-3 * depth, angle_rad=math.radians(angle), **data))


def at(pair, phase, damage=SOUND):
    """Stiffness with damage on the first gear."""
    return pair.compliances(pair.roll(np.asarray(phase)), pair.beams(damage, SOUND)).stiffness


def mean_change(pair, damage):
    phase = (np.arange(4000) + 0.5) / 4000 * pair.contact_ratio
    return at(pair, phase, damage).mean() / at(pair, phase).mean() - 1


# --- tables --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("q", "limit", "single", "highest", "tip", "entering", "leaving", "change", "with_body"),
    [
        (0.0, 1.0, 5.0440e8, 4.9286e8, 2.7569e8, 8.1611e8, 8.1610e8, 0.0, 0.0),
        (0.5, 0.830, 4.7486e8, 4.5714e8, 2.4224e8, 8.0460e8, 7.7523e8, -0.0624, -0.0195),
        (1.0, 0.660, 4.3925e8, 4.1359e8, 2.0232e8, 7.9048e8, 7.2595e8, -0.1379, -0.0464),
        (1.5, 0.490, 3.9769e8, 3.6457e8, 1.6104e8, 7.7283e8, 6.7292e8, -0.2230, -0.0820),
        (2.0, 0.319, 3.4930e8, 3.1002e8, 1.2125e8, 7.5030e8, 6.1921e8, -0.3171, -0.1289),
        (2.5, 0.149, 2.9355e8, 2.5065e8, 8.5668e7, 7.2097e8, 5.6681e8, -0.4203, -0.1910),
        (3.0, -0.021, 2.3100e8, 1.8853e8, 5.5674e7, 6.8228e8, 5.1827e8, -0.5322, -0.2740),
    ],
)
def test_crack_table(q, limit, single, highest, tip, entering, leaving, change, with_body):
    """Gears of Tian, and Wu, Zuo & Parey: 70 degrees, flat limit line."""
    damage = crack(q)
    eps = TIAN.contact_ratio
    root = TIAN.first.crack_start.real
    assert root == pytest.approx(2.761310e-3, rel=1e-6)
    assert damage.crack.limits_m(TIAN.first)[1] / root == pytest.approx(limit, abs=6e-4)
    found = at(TIAN, [eps / 2, 1.0, eps], damage)
    np.testing.assert_allclose(found, [single, highest, tip], rtol=1.5e-4)
    middle = (eps - 1) / 2
    sound, hurt = (at(TIAN, [middle, middle + 1], d) for d in (SOUND, damage))
    assert hurt[0] + sound[1] == pytest.approx(entering, rel=1e-4)
    assert sound[0] + hurt[1] == pytest.approx(leaving, rel=1e-4)
    assert mean_change(TIAN, damage) == pytest.approx(change, abs=1e-4)
    assert mean_change(WITH_BODY, damage) == pytest.approx(with_body, abs=2.5e-4)


@pytest.mark.parametrize(
    ("q", "change", "single"),
    [
        (0.25, -0.0164, 2.7096e8),
        (0.5, -0.0385, 2.6575e8),
        (0.75, -0.0653, 2.5961e8),
        (1.0, -0.0971, 2.5230e8),
        (1.5, -0.1776, 2.3280e8),
    ],
)
def test_cracks_of_the_paper_pair(q, change, single):
    damage = crack(q, 60.0)
    assert mean_change(STRAIGHT, damage) == pytest.approx(change, abs=1.2e-4)
    assert at(STRAIGHT, STRAIGHT.contact_ratio / 2, damage) == pytest.approx(single, rel=1e-4)


@pytest.mark.parametrize(("share", "growth"), [(0.5, (5, 15, 30, 54)), (0.9, (8, 25, 57, 117))])
def test_flat_line_on_a_true_fillet(share, growth):
    """26 teeth, 60 degrees, crack from the 30-degree tangent: growth of the tooth compliance."""
    roll = PAPER.roll(share * PAPER.contact_ratio)

    def tooth(depth):
        parts = PAPER.compliances(roll, PAPER.beams(crack(depth, 60.0), SOUND))
        causes = (parts.bending, parts.shear, parts.axial, parts.foundation)
        return float(sum(cause[0] for cause in causes))

    found = [100 * (tooth(q) / tooth(0.0) - 1) for q in (0.5, 1.0, 1.5, 2.0)]
    np.testing.assert_allclose(found, growth, atol=1.1)


SPALLED = [
    teeth(19, 31, 3.175, 16, (10, 10), 206.8e9, root="straight", has_foundation=body)
    for body in (False, True)
]


@pytest.mark.parametrize(
    ("width", "without", "with_body"),
    [
        (0.0, 4.86333e8, 0.0),
        (2.0, 4.74452e8, -0.0088),
        (4.0, 4.59580e8, -0.0202),
        (8.0, 4.14508e8, -0.0578),
        (12.0, 3.20904e8, -0.1544),
    ],
)
def test_spall_table(width, without, with_body):
    """19/31: 1.5 mm long on the pitch circle, 0.5 mm deep; heights read as radii in the source."""
    rows = []
    for pair in SPALLED:
        tooth = pair.first
        radius = tooth.reference_radius_m
        hole = Hole(
            low_m=radius - 0.75e-3, high_m=radius + 0.75e-3, width_m=1e-3 * width, depth_m=5e-4
        )
        pitch = pair.phase_of(0, tooth.angle_at_radius(radius))
        rows.append([at(pair, pitch, damage) for damage in (SOUND, ToothDamage(holes=(hole,)))])
    assert rows[0][1] == pytest.approx(without, rel=1e-4)
    assert rows[1][0] == pytest.approx(1.72324e8, rel=1e-5)
    assert rows[1][1] / rows[1][0] - 1 == pytest.approx(with_body, abs=1e-4)


def test_spall_centred_on_the_height_of_the_pitch_point():
    """The same rows with heights along the middle of the tooth."""
    pair, tooth = SPALLED[0], SPALLED[0].first
    angle = tooth.angle_at_radius(tooth.reference_radius_m)
    middle = float(tooth.height(angle))
    for width, expected in ((2, 4.74452e8), (4, 4.59580e8), (8, 4.14508e8), (12, 3.20904e8)):
        hole = Hole(
            low_m=middle - 0.75e-3, high_m=middle + 0.75e-3, width_m=1e-3 * width, depth_m=5e-4
        )
        found = at(pair, pair.phase_of(0, angle), ToothDamage(holes=(hole,)))
        assert found == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("limit", ["flat", "parabolic"])
@pytest.mark.parametrize("far", [None, 0.0])
@pytest.mark.parametrize("pair", [PAPER, STRAIGHT], ids=["fillet", "straight"])
def test_a_crack_grows_from_nothing(pair, far, limit):
    """In the limit of no depth a crack takes nothing, and what it takes is linear in its depth."""
    depths = np.array([1e-6, 1e-3, 2e-3])
    data = {"far_depth_m": far, "limit": limit}
    lost = [-mean_change(pair, crack(depth, 60.0, **data)) for depth in depths]
    assert abs(lost[0]) < 1e-6
    assert 0 < lost[1] < 1e-3
    assert lost[2] == pytest.approx(2 * lost[1], rel=0.5)


# --- slow version --------------------------------------------------------------------------------

PITCH = float(PAPER.first.height(PAPER.first.angle_at_radius(26e-3)))
CASES = {
    "through crack": crack(1.2),
    "deep crack": crack(2.6, 60.0),
    "crack over a part of the face": crack(1.2, extent=0.4, start=0.1),
    "crack that runs out": crack(1.8, far_depth_m=0.0, extent=0.7),
    "crack of two depths": crack(1.0, far_depth_m=2e-3),
    "spall": ToothDamage(
        holes=(Hole(low_m=PITCH - 6e-4, high_m=PITCH + 2e-4, width_m=0.012, depth_m=4e-4),)
    ),
    "wear": ToothDamage(wear_m=1e-4),
    "all": ToothDamage(
        crack=RootCrack(depth_m=1e-3, angle_rad=1.2, far_depth_m=5e-4),
        holes=(Hole(low_m=PITCH - 6e-4, high_m=PITCH + 2e-4, width_m=0.006, depth_m=4e-4),),
        wear_m=5e-5,
    ),
}


@pytest.mark.parametrize("case", sorted(CASES))
@pytest.mark.parametrize("pair", [PAPER, STRAIGHT], ids=["fillet", "straight"])
def test_against_the_slow_version(case, pair):
    tooth, damage = pair.first, CASES[case]
    for share in (0.3, 0.95):
        angle = tooth.start + share * (tooth.tip - tooth.start)
        found = ToothBeam(tooth, damage).compliances(np.array([angle]))
        slow = tooth_compliance(tooth, angle, damage)
        np.testing.assert_allclose([float(part[0]) for part in found], slow, rtol=3e-4)


def test_round_pit_against_the_slow_version():
    tooth = PAPER.first
    pit = Hole(low_m=PITCH - 4e-4, high_m=PITCH + 4e-4, width_m=4e-3, depth_m=3e-4, round=True)
    damage = ToothDamage(holes=(pit,))
    found = ToothBeam(tooth, damage).compliances(np.array([tooth.tip]))
    slow = tooth_compliance(tooth, tooth.tip, damage)
    np.testing.assert_allclose([float(part[0]) for part in found], slow, rtol=1e-5)


# --- parabolic limit line ------------------------------------------------------------------------


def test_parabolic_line_runs_from_the_crack_to_the_corner_of_the_tip():
    tooth = PAPER.first
    damage = crack(1.0, 60.0, limit="parabolic").crack
    start, top = tooth.crack_start.imag, float(tooth.height(tooth.tip))
    tip, cut = float(tooth.half_thickness(tooth.tip)), damage.limits_m(tooth)[1]
    ends = damage.carrying(tooth, 1j * np.array([start - 1e-4, start, top]), 1e-3)
    np.testing.assert_allclose(ends, [cut, cut, tip], rtol=1e-12)
    # a parabola along the tooth: the square is linear in the height
    middle = damage.carrying(tooth, 1j * np.array([0.5 * (start + top)]), 1e-3)
    assert middle[0] ** 2 == pytest.approx(0.5 * (cut**2 + tip**2), rel=1e-12)


@pytest.mark.parametrize("depth", [0.8e-3, 1.5e-3, 2.4e-3])
def test_parabolic_line_against_sums_of_thin_slices(depth):
    """Involute and the straight root below it, from where the crack starts."""
    tooth = STRAIGHT.first
    angle = tooth.start + 0.8 * (tooth.tip - tooth.start)
    lines = {name: crack(1e3 * depth, 60.0, limit=name) for name in ("flat", "parabolic")}
    found = {
        name: ToothBeam(tooth, damage).compliances(np.array([angle]))
        for name, damage in lines.items()
    }
    edges = np.linspace(tooth.start, angle, 400_001)
    t = 0.5 * (edges[1:] + edges[:-1])
    low = np.linspace(tooth.crack_start.imag, float(tooth.height(tooth.start)), 100_001)
    y = np.concatenate([0.5 * (low[1:] + low[:-1]), tooth.height(t)])
    h = np.concatenate([np.full(100_000, tooth.crack_start.real), tooth.half_thickness(t)])
    dy = np.concatenate([np.diff(low), np.diff(tooth.height(edges))])
    arm = (tooth.height(angle) - y) * math.cos(angle) - tooth.half_thickness(angle) * math.sin(
        angle
    )
    root, top = tooth.crack_start, float(tooth.height(tooth.tip))
    cut, tip = (
        root.real - depth * math.sin(math.radians(60)),
        float(tooth.half_thickness(tooth.tip)),
    )
    share = (top - y) / (top - root.imag)
    parabola = np.sqrt(max(cut, 0.0) ** 2 * share + tip**2 * (1 - share))
    if cut < 0:
        parabola = cut + (tip - cut) * np.sqrt(1 - share)
    limits = {"flat": np.full(len(y), cut), "parabolic": parabola}
    slow = {}
    for name, limit in limits.items():
        inertia = tooth.face_width_m * (h + np.minimum(h, limit)) ** 3 / 12
        slow[name] = float(np.sum(arm**2 / (tooth.elastic_modulus_pa * inertia) * dy))
    difference = float(found["flat"][0][0] - found["parabolic"][0][0])
    # the root of the line is vertical at a crack past the middle
    assert difference == pytest.approx(
        slow["flat"] - slow["parabolic"], abs=(1e-3 if depth > 2e-3 else 1e-6) * slow["flat"]
    )


@pytest.mark.parametrize(
    ("data", "elements"),
    [
        ((26, 53, 2.0, 20, (10.4, 21.2), 206e9), (11, 31, 59, 96)),
        ((62, 42, 2.0, 20, (24.8, 15), 206e9), (8, 23, 43, 70)),
    ],
)
def test_parabolic_line_against_finite_elements_near_the_tip(data, elements):
    """Slits of 0.5, 1, 1.5, 2 mm at 60 degrees: growth of the compliance of the tooth in %."""
    pair = teeth(*data)
    roll = pair.roll(0.9 * pair.contact_ratio)

    def tooth(depth):
        damage = crack(depth, 60.0, limit="parabolic")
        parts = pair.compliances(roll, pair.beams(damage, SOUND))
        causes = (parts.bending, parts.shear, parts.axial, parts.foundation)
        return float(sum(cause[0] for cause in causes))

    found = [100 * (tooth(q) / tooth(0.0) - 1) for q in (0.5, 1.0, 1.5, 2.0)]
    np.testing.assert_allclose(found, elements, atol=2.6)


@given(
    st.sampled_from([PAPER, STRAIGHT, TIAN]),
    st.floats(0.05, 1.5),
    st.floats(1.01, 1.6),
    st.floats(45, 70),
    st.floats(0, 1),
)
def test_parabolic_line_softens_shallow_cracks_and_stiffens_deep_ones(
    pair, depth, more, angle, far
):
    """It ends at the corner of the tip: beside the flat line where that leaves more, and less."""
    phase = np.linspace(0, pair.contact_ratio, 23)
    data = {"far_depth_m": 1e-3 * depth * far, "limit": "parabolic"}
    shallow = at(pair, phase, crack(depth, angle, **data))
    deep = at(pair, phase, crack(depth * more, angle, **data))
    flat = at(pair, phase, crack(depth, angle, far_depth_m=data["far_depth_m"]))
    assert (shallow <= at(pair, phase) * (1 + 1e-9)).all()
    limits = crack(depth, angle, far_depth_m=data["far_depth_m"]).crack.limits_m(pair.first)
    tip = float(pair.first.half_thickness(pair.first.tip))
    if limits.max() <= tip:
        assert (flat <= shallow * (1 + 1e-9)).all()
    elif limits.min() >= tip:
        assert (shallow <= flat * (1 + 1e-9)).all()
    assert (deep <= shallow * (1 + 1e-9)).all()


def test_parabolic_crack_of_varying_depth_is_the_mean_over_its_face():
    """A crack that ends at almost the same depth is one of that depth."""
    phase = np.linspace(0, PAPER.contact_ratio, 11)
    one = at(PAPER, phase, crack(1.4, 60.0, limit="parabolic"))
    two = at(PAPER, phase, crack(1.4, 60.0, far_depth_m=1.4e-3 * (1 + 1e-6), limit="parabolic"))
    np.testing.assert_allclose(two, one, rtol=1e-5)


# --- laws ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "damage",
    [
        crack(0.0),
        crack(0.0, far_depth_m=0.0),
        ToothDamage(holes=(Hole(low_m=0.025, high_m=0.026, width_m=0.0, depth_m=1e-3),)),
        ToothDamage(wear_m=0.0),
    ],
)
def test_size_zero_is_no_damage(damage):
    assert damage.is_none
    phase = np.linspace(0, PAPER.contact_ratio, 21)
    np.testing.assert_array_equal(at(PAPER, phase, damage), at(PAPER, phase))


@given(
    st.sampled_from([PAPER, STRAIGHT, TIAN]),
    st.floats(0.0, 1.0),
    st.floats(0.0, 1.0),
    st.floats(45, 75),
    st.sampled_from([None, 0.3]),
)
def test_deeper_cracks_are_softer_everywhere(pair, one, two, angle, extent):
    more = {} if extent is None else {"extent": extent, "start": 0.2}
    less, deep = sorted((2.4 * one, 2.4 * two))
    phase = np.linspace(0, pair.contact_ratio, 31)
    small, large = (at(pair, phase, crack(q, angle, **more)) for q in (less, deep))
    assert (large <= small * (1 + 1e-9)).all()


def test_a_part_of_the_face_lies_between_nothing_and_all():
    phase = np.linspace(0, PAPER.contact_ratio, 31)
    none, part, whole = (
        at(PAPER, phase, damage)
        for damage in (SOUND, crack(1.5, extent=0.5), crack(1.5, extent=1.0))
    )
    assert (whole < part).all()
    assert (part < none).all()


def test_the_depth_of_a_crack_along_the_face():
    """q^2 is linear: q0 sqrt((W - z)/W), and sqrt((q2^2 - q0^2) z/b + q0^2) (Chen & Shao)."""
    running_out = RootCrack(depth_m=2e-3, far_depth_m=0.0, extent=0.5)
    np.testing.assert_allclose(
        running_out.at(np.array([0.0, 0.25, 0.375, 0.6])), [2e-3, 2e-3 * 0.5**0.5, 1e-3, 0.0]
    )
    through = RootCrack(depth_m=1e-3, far_depth_m=2e-3)
    assert through.at(np.array([0.5]))[0] == pytest.approx(math.sqrt(2.5) * 1e-3)


def test_deeper_wear_is_softer():
    phase = np.linspace(0, PAPER.contact_ratio, 11)
    levels = [at(PAPER, phase, ToothDamage(wear_m=w)) for w in (0.0, 2e-5, 1e-4, 3e-4)]
    assert all((b < a).all() for a, b in pairwise(levels))


@pytest.mark.parametrize("tooth", [*PAPER.teeth, teeth(18, 31, 4, 20, (20, 30)).first])
def test_a_root_crack_begins_at_the_critical_section(tooth):
    """Where the tangent of the fillet makes 30 degrees with the middle of the tooth, ISO 6336-3."""
    fillet = tooth.root_part(np.linspace(0, 1, 100_001))
    along = np.gradient(fillet)[np.abs(fillet - tooth.crack_start).argmin()]
    assert math.degrees(math.atan(abs(along.real / along.imag))) == pytest.approx(30, abs=0.05)


# --- refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("damage", "match"),
    [
        (crack(6.0), r"crack of 6 mm cuts the tooth of the pinion off: .* must lie in \[0, "),
        (ToothDamage(wear_m=2e-3), "wear of 2 mm consumes the tip of the pinion"),
        (
            ToothDamage(holes=(Hole(low_m=0.025, high_m=0.026, width_m=1e-3, depth_m=2e-3),)),
            "spall depth of 2 mm passes through the tooth",
        ),
    ],
)
def test_damage_that_leaves_nothing_is_refused(damage, match):
    with pytest.raises(ArgumentError, match=match):
        PAPER.beams(damage, SOUND)


def test_wear_leaves_a_tip():
    """What is worn square to the flank takes more than that across the tooth."""
    tooth = PAPER.first
    whole = 2 * float(tooth.half_thickness(tooth.tip)) * math.cos(tooth.tip)
    PAPER.beams(ToothDamage(wear_m=0.89 * whole), SOUND)
    with pytest.raises(ArgumentError, match="consumes the tip"):
        PAPER.beams(ToothDamage(wear_m=0.99 * whole), SOUND)


@pytest.mark.parametrize("rounding", [1e-16, 0.0, -1e-16])
def test_a_curve_is_crossed_where_rounding_alone_tells_its_sides_apart(rounding):
    """At a place of the grid, where single values are rounded otherwise than many."""

    def curve(t):
        return t + (rounding if np.ndim(t) == 0 else -rounding)

    found = crossings(curve, 0.0, 1.0, np.array([0.5, 0.7]))
    np.testing.assert_allclose(found, [0.5, 0.7], atol=2e-6)
