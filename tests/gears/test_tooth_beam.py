"""Energy compliance of sound teeth against published tables, a slow version and laws."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.tooth_cases import PAPER, STRAIGHT, TIAN, teeth
from reference.tooth_reference import tooth_compliance

from gearmon.errors import ArgumentError
from gearmon.gears.geometry import GearTeeth, pair_geometry
from gearmon.gears.tooth import Foundation, ToothBeam, sainsot
from gearmon.gears.tooth_pairs import (
    PotentialEnergy,
    hertz_compliance,
    tooth_pair,
    weber_banaschek_compliance,
)


def stiffness(pair, *fractions):
    phase = np.array(fractions) * pair.contact_ratio
    return pair.compliances(pair.roll(phase)).stiffness


def classical(pair, phase):
    """Sum of the pairs in contact, each by itself."""
    phases = [p for p in np.arange(-3, 4) + phase if -1e-12 <= p <= pair.contact_ratio + 1e-12]
    return sum(float(pair.compliances(pair.roll(p)).stiffness) for p in phases)


# --- published and regression tables ------------------------------------------------------------


def test_ross_pair():
    """Two 62-tooth gears of a test of ROSS: angles, and the sum of two pairs, u to the contact."""
    pair = teeth(62, 62, 2, 20, (17.5, 17.5))
    bodies = [Foundation(tooth=tooth, arm="contact") for tooth in pair.teeth]
    tooth, foundation = pair.first, bodies[0]
    assert tooth.base_half_angle == pytest.approx(0.04023980849, rel=1e-9)
    assert foundation.root_angle_rad == pytest.approx(0.04565847873, rel=1e-9)
    assert pair.contact_ratio == pytest.approx(1.78977987, rel=1e-8)
    hertz = float(hertz_compliance(0.02, (206e9, 206e9), 0.3))
    assert 1 / hertz == pytest.approx(3.5558686079e9, rel=1e-10)
    low, high = 0.2577380345, 0.4267223377
    step = (high - low) / 1.78977987

    def total(angles):
        found = hertz
        for angle, beam, body in zip(angles, pair.sound, bodies, strict=True):
            t = np.array([math.tan(angle) - tooth.base_half_angle])
            found += sum(part[0] for part in beam.compliances(t)) + body.compliance(t)[0]
        return 1 / found

    both = total((low, high)) + total((low + step, high - step))
    assert both == pytest.approx(396_622_921.36, rel=2e-7)
    assert teeth(62, 62, 2, 20, (17.5, 17.5)).path_m[0] == pytest.approx(
        62e-3 * math.cos(math.radians(20)) * math.tan(0.2667669672), rel=1e-9
    )


def test_ross_pair_with_the_arm_to_the_axis():
    pair = teeth(62, 62, 2, 20, (17.5, 17.5))
    low, high = 0.2577380345, 0.4267223377
    step = (high - low) / 1.78977987

    def total(angles):
        found = float(hertz_compliance(0.02, (206e9, 206e9), 0.3))
        for angle, beam, body in zip(angles, pair.sound, pair.foundations, strict=True):
            t = np.array([math.tan(angle) - pair.first.base_half_angle])
            found += sum(part[0] for part in beam.compliances(t)) + body.compliance(t)[0]
        return 1 / found

    both = total((low, high)) + total((low + step, high - step))
    assert both == pytest.approx(4.18234e8, rel=1e-5)


@pytest.mark.parametrize(
    ("fraction", "expected", "pair"),
    [
        (
            0.0,
            (
                5.56594e10,
                4.10466e9,
                2.24227e12,
                1.19089e9,
                9.57355e8,
                1.03192e9,
                1.57999e10,
                5.65558e8,
            ),
            1.912760e8,
        ),
        (
            0.5,
            (
                8.46731e9,
                2.09697e9,
                7.91434e10,
                9.89128e8,
                9.76595e9,
                2.14211e9,
                5.93806e10,
                9.02479e8,
            ),
            2.782449e8,
        ),
        (
            1.0,
            (
                8.72152e8,
                1.04986e9,
                1.18233e10,
                6.00334e8,
                2.85132e11,
                5.48003e9,
                3.31402e11,
                1.14915e9,
            ),
            1.926836e8,
        ),
    ],
)
def test_parts_of_the_paper_pair(fraction, expected, pair):
    parts = PAPER.compliances(PAPER.roll(fraction * PAPER.contact_ratio))
    found = [
        1 / float(getattr(parts, cause)[gear])
        for gear in (0, 1)
        for cause in ("bending", "shear", "axial", "foundation")
    ]
    np.testing.assert_allclose(found, expected, rtol=1e-5)
    assert float(parts.stiffness) == pytest.approx(pair, rel=1e-6)
    assert sum(float(share) for share in parts.shares.values()) == pytest.approx(1)


def test_paper_pair_angles_and_path():
    assert PAPER.first.base_half_angle == pytest.approx(0.0753196, abs=5e-8)
    assert PAPER.second.base_half_angle == pytest.approx(0.0445421, abs=5e-8)
    assert PAPER.foundations[0].root_angle_rad == pytest.approx(0.1088779, abs=5e-8)
    assert PAPER.foundations[1].root_angle_rad == pytest.approx(0.0534118, abs=5e-8)
    np.testing.assert_allclose(PAPER.path_m, (3.683127e-3, 13.677609e-3), rtol=1e-6)


@pytest.mark.parametrize(
    ("pair", "rows", "mesh"),
    [
        (
            PAPER,
            (1.912760e8, 2.782449e8, 1.926836e8),
            (4.676756e8, 4.910480e8, 4.663185e8, 2.736349e8, 2.782449e8),
        ),
        (STRAIGHT, (1.891774e8, 2.747941e8, 1.878435e8), (None, 4.836081e8, None, None, None)),
        (
            teeth(62, 42, 2, 20, (17.5, 15)),
            (1.800558e8, 2.512701e8, 1.798457e8),
            (None, 4.526453e8, None, None, None),
        ),
        (
            TIAN,
            (2.87141e8, 5.04406e8, 2.75701e8),
            (7.80009e8, 8.16117e8, 7.65250e8, 4.89549e8, 5.04406e8),
        ),
        (
            teeth(19, 48, 3.175, 16, (10, 10), 206.8e9, root="straight"),
            (None, None, None),
            (None, 2.40218e8, None, None, 1.30606e8),
        ),
    ],
)
def test_tables(pair, rows, mesh):
    """Pair at 0, 1/2 and 1; mesh at 0, mid double, end of double, start of single, mid single."""
    eps = pair.contact_ratio
    for fraction, expected in zip((0, 0.5, 1), rows, strict=True):
        if expected is not None:
            assert float(stiffness(pair, fraction)[0]) == pytest.approx(expected, rel=1e-5)
    part = eps - 1
    ends = pair.compliances(pair.roll(np.array([part, eps, part / 2, part / 2 + 1, 0.0, 1.0])))
    k = ends.stiffness
    found = (k[4] + k[5], k[2] + k[3], k[0] + k[1], k[0], classical(pair, eps / 2))
    for value, expected in zip(found, mesh, strict=True):
        if expected is not None:
            assert value == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize(("foundation", "expected"), [(False, 6.94551e8), (True, 1.99267e8)])
def test_mean_of_the_classical_mesh(foundation, expected):
    """The mean over a mesh period is the integral of one pair over its contact.

    The tabulated means are of 1,000 samples, which count the double zone 6e-4 periods short.
    """
    pair = teeth(19, 48, 3.175, 16, (10, 10), 206.8e9, root="straight", has_foundation=foundation)
    phase = (np.arange(20_000) + 0.5) / 20_000 * pair.contact_ratio
    mean = pair.compliances(pair.roll(phase)).stiffness.mean() * pair.contact_ratio
    assert mean == pytest.approx(expected, rel=5e-4)
    sampled = [classical(pair, p) for p in np.linspace(0, 1 - 1e-9, 1000)]
    assert np.mean(sampled) == pytest.approx(expected, rel=1e-4)
    assert pair.contact_ratio == pytest.approx(1.645626, rel=1e-6)


@pytest.mark.parametrize(
    ("ratio", "angle", "expected"),
    [
        (3.0, 0.05, (6.927112, 1.190046, 4.324115, 0.437799)),
        (2.0, 0.10, (6.888231, 1.139793, 2.726756, 0.496256)),
        (5.0, 0.03, (6.948750, 1.369630, 8.220030, 0.305404)),
    ],
)
def test_sainsot_polynomials(ratio, angle, expected):
    np.testing.assert_allclose(sainsot(ratio, angle), expected, atol=6e-7)


@pytest.mark.parametrize(
    ("numbers", "expected"),
    [
        ((26, 53, 2, 20), 13.43),
        ((19, 48, 3.175, 16), 12.83),
        ((50, 50, 3, 20), 14.05),
        ((24, 95, 2, 20), 13.82),
    ],
)
def test_single_pair_lies_near_the_standard(numbers, expected):
    """ISO c' [N/(mm um)], r_bore/R = 0.4; errors of the beam partly cancel: 12 %."""
    z1, z2, m, b = numbers
    pair = teeth(z1, z2, m, b, (0.2 * m * z1, 0.2 * m * z2))
    assert float(stiffness(pair, 0.5)[0]) / b * 1e-6 == pytest.approx(expected, rel=0.12)


@pytest.mark.parametrize(
    ("numbers", "expected"),
    [((26, 53, 2, 20), 13.91), ((19, 48, 3.175, 16), 13.71), ((50, 50, 3, 20), 13.99)],
)
def test_single_pair_of_the_beam(numbers, expected):
    z1, z2, m, b = numbers
    pair = teeth(z1, z2, m, b, (0.2 * m * z1, 0.2 * m * z2))
    assert float(stiffness(pair, 0.5)[0]) / b * 1e-6 == pytest.approx(expected, abs=6e-3)


# --- contact -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("z1", "z2", "finite_elements", "both"),
    [
        (26, 53, 15.47, 13.24),
        (19, 48, 15.31, 13.00),
        (50, 50, 15.47, 13.42),
        (24, 95, 15.18, 13.06),
    ],
)
def test_load_dependent_contact_at_300_n_per_mm(z1, z2, finite_elements, both):
    """Finite elements with k_h and with this contact, module 2 mm: the difference is the contact.

    58 to 65 N/(mm um) against 177.8 of the constant form.
    """
    pair = teeth(z1, z2, 2, 20, (0.4 * z1, 0.4 * z2), contact="load-dependent")
    roll = pair.roll(0.5 * pair.contact_ratio)
    hertz = 1e-6 / float(pair.compliances(roll, force_n=300e3 * 0.02).hertz) / 20
    assert 58 < hertz < 65
    assert hertz == pytest.approx(1 / (1 / both - 1 / finite_elements + 1 / 177.793), rel=5e-3)


def test_load_dependent_contact_stiffens_with_load():
    soft, hard = (
        weber_banaschek_compliance(
            np.array([force]),
            0.02,
            np.array([5e-3]),
            (np.array([2e-3]), np.array([2e-3])),
            (206e9, 206e9),
            0.3,
        )
        for force in (1e3, 1e4)
    )
    plane = (1 - 0.3**2) / (math.pi * 206e9)
    # ten times the load adds ln(10)/2 to the bracket
    assert soft - hard == pytest.approx(4 * plane / 0.02 * math.log(10) / 2)


@pytest.mark.parametrize(
    ("width", "modulus", "expected"), [(0.020, 206e9, 3.555869e9), (0.016, 206.8e9, 2.855742e9)]
)
def test_contact_stiffness(width, modulus, expected):
    """pi E b/(4 (1 - nu^2)); 177.8 N/(mm um) of steel."""
    found = 1 / float(hertz_compliance(width, (modulus, modulus), 0.3))
    assert found == pytest.approx(expected, rel=1e-6)
    assert 206e9 / modulus * found / width / 1e9 == pytest.approx(177.8, abs=0.05)


def test_unequal_moduli_add_their_compliances():
    mixed = hertz_compliance(0.01, (206e9, 100e9), 0.3)
    steel, other = (hertz_compliance(0.01, (E, E), 0.3) for E in (206e9, 100e9))
    assert mixed == pytest.approx(0.5 * (steel + other))


# --- against the slow version --------------------------------------------------------------------


@pytest.mark.parametrize("root", ["fillet", "straight", "base"])
@pytest.mark.parametrize("numbers", [(17, 60, 0.3), (26, 53, 0.0), (62, 42, 0.0), (120, 40, 0.2)])
def test_running_integrals_against_adaptive_quadrature(root, numbers):
    z1, z2, x = numbers
    tooth = teeth(z1, z2, 4, 36, (0.8 * z1, 0.8 * z2), x=(x, -x), root=root).first
    for share in (0.15, 0.6, 0.98):
        angle = tooth.start + share * (tooth.tip - tooth.start)
        fast = [float(part[0]) for part in ToothBeam(tooth).compliances(np.array([angle]))]
        np.testing.assert_allclose(fast, tooth_compliance(tooth, angle), rtol=3e-6)


def test_closed_form_of_the_straight_root():
    """Integrals from the root circle to the base circle in closed form."""
    tooth = STRAIGHT.first
    a1 = 0.2
    alpha2, ratio = tooth.base_half_angle, tooth.root_radius_m / tooth.base_radius_m
    alpha3 = math.asin(math.sin(alpha2) / ratio)
    c = math.cos(a1)
    bending = (1 - ratio * c * math.cos(alpha3)) ** 3 - (1 - c * math.cos(alpha2)) ** 3
    bending /= 2 * tooth.elastic_modulus_pa * tooth.face_width_m * c * math.sin(alpha2) ** 3
    length = math.cos(alpha2) - ratio * math.cos(alpha3)
    shear = 1.2 * 1.3 * c**2 * length / (206e9 * tooth.face_width_m * math.sin(alpha2))
    axial = math.sin(a1) ** 2 * length / (2 * 206e9 * tooth.face_width_m * math.sin(alpha2))
    without = ToothBeam(replace(tooth, root="base"))
    whole = ToothBeam(tooth).compliances(np.array([a1]))
    above = without.compliances(np.array([a1]))
    found = [float(a[0] - b[0]) for a, b in zip(whole, above, strict=True)]
    np.testing.assert_allclose(found, (bending, shear, axial), rtol=1e-9)


def test_undercut_fillet_joins_the_involute():
    """A pinion of 12 teeth: the fillet cuts the involute, and both ends meet."""
    gears = GearTeeth(teeth=12), GearTeeth(teeth=60)
    geometry = pair_geometry(*gears, module_m=2e-3, face_width_m=0.02, check=False)
    tooth = tooth_pair(geometry, bore_radii_m=(4e-3, 24e-3)).first
    (end,) = tooth.root_part(np.ones(1))
    assert end.imag == pytest.approx(float(tooth.height(tooth.start)), abs=2e-6)
    assert end.real == pytest.approx(float(tooth.half_thickness(tooth.start)), abs=2e-6)


# --- laws ----------------------------------------------------------------------------------------


@st.composite
def numbers(draw):
    return draw(st.integers(18, 120)), draw(st.integers(18, 120)), draw(st.floats(0.28, 0.65))


@given(numbers(), st.floats(0.3, 4), st.floats(0.2, 5), st.floats(0.3, 3))
def test_scaling(pair, modulus, width, module):
    """Proportional to E and b; the same for similar gears of any module."""
    z1, z2, bore = pair
    plain = teeth(z1, z2, 2, 20, (bore * z1, bore * z2))
    scaled = teeth(
        z1,
        z2,
        2 * module,
        20 * width,
        (module * bore * z1, module * bore * z2),
        E=206e9 * modulus,
    )
    fractions = np.linspace(0.01, 0.99, 9)
    np.testing.assert_allclose(
        stiffness(scaled, *fractions), modulus * width * stiffness(plain, *fractions), rtol=1e-9
    )
    for one, two in zip(plain.foundations, scaled.foundations, strict=True):
        assert one.coupling() == pytest.approx(two.coupling() * modulus * width, rel=1e-9)


def test_the_dip_of_the_rim_falls_off_as_on_a_half_plane():
    """Flamant's displacement under a force F per width: (2/pi) F/E times the logarithm."""
    near, far = (teeth(40, 60, 2, 20, (24, 36)).foundations[0].coupling(n) for n in (1, 2))
    assert (near - far) * 206e9 * 20e-3 == pytest.approx(2 / np.pi * np.log(2), rel=0.1)


@given(numbers(), st.sampled_from(["fillet", "straight"]))
def test_mirrored_pair(pair, root):
    z1, z2, bore = pair
    there = teeth(z1, z2, 2, 20, (bore * z1, bore * z2), root=root)
    back = teeth(z2, z1, 2, 20, (bore * z2, bore * z1), root=root)
    fractions = np.linspace(0, 1, 11)
    np.testing.assert_allclose(
        stiffness(there, *fractions), stiffness(back, *(1 - fractions)), rtol=1e-9
    )


def test_larger_bore_holds_the_teeth_harder():
    soft, hard = teeth(40, 40, 2, 20, (10, 10)), teeth(40, 40, 2, 20, (20, 20))
    assert float(stiffness(hard, 0.5)[0]) > float(stiffness(soft, 0.5)[0])


# --- refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize("bore", [0.0, 24.0])
def test_bores_that_do_not_fit_are_refused(bore):
    with pytest.raises(ArgumentError, match=r"bore radius .* of the pinion must be > 0"):
        teeth(26, 53, 2, 20, (bore, 21))


def test_unknown_choices_are_refused():
    with pytest.raises(
        ArgumentError, match='root = "round" must be one of "fillet", "straight", "base"'
    ):
        PotentialEnergy(root="round")
    with pytest.raises(ArgumentError, match='contact = "hard" must be one of'):
        PotentialEnergy(contact="hard")


def test_range_of_the_foundation_fit_is_reported():
    assert PAPER.warnings == ()
    wide = Foundation(tooth=replace(PAPER.first, bore_radius_m=0.02))
    assert any("outside the range 1.4 to 7" in text for text in wide.warnings)
    few = teeth(19, 48, 3.175, 16, (10, 20))
    assert any("half root angle of 0.1490 rad" in text for text in few.warnings)
