"""The forms side by side: same mean, exact lines, and what the table says."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.mesh_curves import fft_coefficients

from gearmon.errors import ArgumentError
from gearmon.gears.pulses import PulseTrain
from gearmon.gears.stiffness import FourierSum, Parabolic, Wave
from gearmon.gears.stiffness_report import FOUR_FORMS, compare_forms
from gearmon.machine import Machine, OperatingPoint, ParallelStage

STAGE = ParallelStage(
    pinion_teeth=26, gear_teeth=53, module_mm=2.0, face_width_mm=20.0, contact_ratio=1.412
)
NAMES = [name for names in FOUR_FORMS.values() for name in names]


POINT = OperatingPoint(speed_rpm=1460.0, torque_nm=98.12)


def box(stage=STAGE):
    return Machine(name="box", operating=(POINT,), stages=(stage,))


def test_all_forms_have_the_same_mean_and_their_own_lines():
    found = compare_forms(box(), harmonics=30)
    assert [curve.name for curve in found.curves] == NAMES
    means = {curve.name: curve.stiffness.healthy_mean_n_per_m for curve in found.curves}
    assert len({round(mean) for mean in means.values()}) == 1
    lines = {curve.name: 2 * np.abs(curve.lines) for curve in found.curves}
    np.testing.assert_allclose(
        lines["parabolic"][:3], [2 * 0.1373112, 2 * 0.0505471, 2 * 0.0287304], atol=2e-7
    )
    # at half duty the even lines vanish and the odd ones fall as 1/n
    odd = lines["rectangular-half"][::2]
    np.testing.assert_allclose(lines["rectangular-half"][1::2], 0, atol=1e-15)
    np.testing.assert_allclose(odd * np.arange(1, 31, 2), odd[0], rtol=1e-12)
    # a sum of 30 terms has the lines of its rectangle, as far as it goes
    np.testing.assert_allclose(lines["fourier-true"], lines["rectangular"], rtol=1e-9)


def test_tables():
    found = compare_forms(box(), points_per_mesh=50, harmonics=7)
    rows, lines = found.rows(), found.line_rows()
    assert len(rows) == 101
    assert len(lines) == 7
    assert lines[1]["frequency_hz"] == pytest.approx(2 * 632.6667, abs=1e-3)
    assert list(rows[0])[2:] == [f"{name.replace('-', '_')}_n_per_m" for name in NAMES]
    # the curve of the table is the sum of the lines of the spectrum and the mean
    wave = found.curves[1]
    mean = np.mean([row["wave_n_per_m"] for row in rows[:-1]])
    assert mean == pytest.approx(wave.stiffness.healthy_mean_n_per_m, rel=5e-3)
    json.dumps(found.to_dict())


def test_amplitudes_of_the_spectrum_are_those_of_the_curve():
    found = compare_forms(box(), points_per_mesh=400, harmonics=4)
    for curve in found.curves:
        one = curve.stiffness_n_per_m[:400]
        slow = 2 * np.abs(np.fft.rfft(one)[1:5]) / len(one)
        # a step may lie anywhere between two points
        np.testing.assert_allclose(curve.amplitudes_n_per_m, slow, atol=np.ptp(one) * 2 / 400)


def test_curve_is_the_sum_of_its_lines():
    found = compare_forms(box(), harmonics=60, points_per_mesh=64)
    (curve,) = [c for c in found.curves if c.name == "fourier"]
    n = np.arange(1, 61)
    turned = np.exp(2j * np.pi * found.phase[:, None] * n)
    total = curve.stiffness.healthy_mean_n_per_m * (1 + 2 * (turned @ curve.lines).real)
    np.testing.assert_allclose(total, curve.stiffness_n_per_m, rtol=1e-10)


@given(
    st.integers(70, 190).filter(lambda n: n % 64),
    st.integers(0, 130),
    st.floats(0.0, 0.9),
    st.integers(1, 25),
)
def test_lines_of_any_curvature_and_overlap_are_the_fft(sixtyfourths, lag, q, terms):
    """Closed forms against Gauss-FFT to 1e-12, of helical pairs too."""
    for form in (Parabolic(curvature=q), Wave(curvature=q), FourierSum(terms=terms, curvature=q)):
        train = PulseTrain.healthy(form.pulse(sixtyfourths / 64), lag / 64)
        slow = fft_coefficients(train.at, 1.0, 25, 128, nodes=16)
        found = train.coefficients(np.arange(26))
        np.testing.assert_allclose(found / slow[0].real, slow / slow[0].real, atol=1e-12)


def test_published_coefficients_of_the_rounded_form():
    """0.7 sin x/x - 0.888 (cos x/x^2 - sin x/x^3): the constants of q = 0.391, rounded."""
    x = math.pi * 1.412 * np.arange(1, 4)
    rounded = 0.7 * np.sin(x) / x - 0.888 * (np.cos(x) / x**2 - np.sin(x) / x**3)
    np.testing.assert_allclose(rounded, [-0.14928, 0.05171, 0.03208], atol=6e-6)
    found = compare_forms(box(), forms=[("parabolic", "parabolic-gu")], harmonics=3).curves[0]
    phase = np.exp(-1j * np.pi * np.arange(1, 4) * 1.412)
    exact = (found.lines / phase).real
    # what the rounding of both constants amounts to
    allowed = 0.0005 * np.abs(np.sin(x) / x) + 0.0112 * np.abs(np.cos(x) / x**2)
    allowed += 0.0112 * np.abs(np.sin(x) / x**3)
    assert (np.abs(exact - rounded) <= allowed).all()


def test_other_forms_and_helical_pairs():
    stage = replace(STAGE, contact_ratio=None, helix_angle_deg=12.0)
    forms = [("teeth", "potential-energy"), ("sum", FourierSum(terms=5))]
    found = compare_forms(box(stage), forms=forms)
    assert [curve.name for curve in found.curves] == ["potential-energy", "fourier"]
    assert found.to_dict()["overlap_ratio"] > 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"stage": 2}, "stage=2 must lie in"),
        ({"harmonics": 0}, "harmonics=0 must lie in"),
        ({"forms": []}, "at least one form"),
        ({"forms": [("a", "parabolc")]}, "did you mean parabolic"),
    ],
)
def test_refusals(arguments, words):
    with pytest.raises(ArgumentError, match=words):
        compare_forms(box(), **arguments)
