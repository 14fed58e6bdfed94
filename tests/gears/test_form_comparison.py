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
from gearmon.gears.stiffness import FourierSum, Parabolic, Wave, mesh_stiffness
from gearmon.gears.stiffness_report import FOUR_FORMS as NAMES
from gearmon.gears.stiffness_report import compare_forms
from gearmon.machine import Machine, OperatingPoint, ParallelStage

STAGE = ParallelStage(
    pinion_teeth=26, gear_teeth=53, module_mm=2.0, face_width_mm=20.0, contact_ratio=1.412
)


POINT = OperatingPoint(speed_rpm=1460.0, torque_nm=98.12)


def box(stage=STAGE):
    return Machine(name="box", operating=(POINT,), stages=(stage,))


def test_all_forms_have_the_same_mean_and_their_own_lines():
    stiffness = {own.form.name: own for own in compare_forms(box()).forms}
    assert tuple(stiffness) == NAMES
    assert len({round(own.healthy_mean_n_per_m) for own in stiffness.values()}) == 1
    lines = {form: 2 * np.abs(own.harmonics(30)) for form, own in stiffness.items()}
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
    found = compare_forms(box())
    rows, lines = found.rows(), found.spectrum
    assert (len(rows), len(lines)) == (401, 20)
    assert (rows[-1]["stage"], rows[-1]["mesh_phase"]) == (1, 2.0)
    assert (lines[1]["stage"], lines[1]["mesh_harmonic"]) == (1, 2)
    assert lines[1]["frequency_hz"] == pytest.approx(2 * 632.6667, abs=1e-3)
    assert list(rows[0])[2:] == [f"{name.replace('-', '_')}_n_per_m" for name in NAMES]
    # the curve of the table is the sum of the lines of the spectrum and the mean
    wave = found.forms[1]
    mean = np.mean([row["wave_n_per_m"] for row in rows[:-1]])
    assert mean == pytest.approx(wave.healthy_mean_n_per_m, rel=5e-3)
    json.dumps(found.to_dict())


def test_amplitudes_of_the_spectrum_are_those_of_the_curve():
    found = compare_forms(box())
    for curve in found.forms:
        one = curve.at(np.arange(200) / 200)
        slow = 2 * np.abs(np.fft.rfft(one)[1:5]) / len(one)
        # a step may lie anywhere between two points
        fast = curve.mesh_amplitudes(20)
        np.testing.assert_allclose(fast[:4], slow, atol=np.ptp(one) * 2 / 200)
        column = f"{curve.form.name.replace('-', '_')}_n_per_m"
        np.testing.assert_array_equal([row[column] for row in found.spectrum], fast)


def test_curve_is_the_sum_of_its_lines():
    stiffness = mesh_stiffness(STAGE, (), "fourier")
    phase, n = np.arange(129) / 64, np.arange(1, 61)
    turned = np.exp(2j * np.pi * phase[:, None] * n)
    mean = stiffness.healthy_mean_n_per_m
    total = mean * (1 + 2 * (turned @ stiffness.harmonics(60)).real)
    np.testing.assert_allclose(total, stiffness.at(phase), rtol=1e-10)


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
    lines = mesh_stiffness(STAGE, (), "parabolic-gu").harmonics(3)
    phase = np.exp(-1j * np.pi * np.arange(1, 4) * 1.412)
    exact = (lines / phase).real
    # what the rounding of both constants amounts to
    allowed = 0.0005 * np.abs(np.sin(x) / x) + 0.0112 * np.abs(np.cos(x) / x**2)
    allowed += 0.0112 * np.abs(np.sin(x) / x**3)
    assert (np.abs(exact - rounded) <= allowed).all()


def test_helical_pairs():
    found = compare_forms(box(replace(STAGE, contact_ratio=None, helix_angle_deg=12.0)))
    told = found.forms[0]
    assert (found.contact_ratio, found.overlap_ratio) == (told.contact_ratio, told.overlap_ratio)
    assert found.to_dict()["overlap_ratio"] > 0


def test_no_load_is_needed():
    unloaded = replace(box(), operating=(OperatingPoint(speed_rpm=1460.0),))
    (first, *_), (own, *_) = compare_forms(unloaded).spectrum, compare_forms(box()).spectrum
    assert first["frequency_hz"] == own["frequency_hz"]


def test_refusals():
    with pytest.raises(ArgumentError, match="stage=2 must lie in"):
        compare_forms(box(), stage=2)
    with pytest.raises(ArgumentError, match="did you mean parabolic"):
        mesh_stiffness(STAGE, (), "parabolc")
