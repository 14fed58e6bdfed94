"""The four forms against published values, slow versions and their own definitions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.mesh_curves import fft_coefficients, parabolic_mesh
from scipy.special import sici

from gearmon.errors import ArgumentError
from gearmon.gears.geometry import contact_zones
from gearmon.gears.pulses import PulseTrain
from gearmon.gears.stiffness import (
    FORMS,
    FourierSum,
    Parabolic,
    Rectangular,
    zone_means,
)

RATIOS = st.floats(1.0, 3.2)


def mesh(form, ratio, overlap=0.0):
    """Mesh stiffness in units of the greatest of one pair."""
    chosen = FORMS[form] if isinstance(form, str) else form
    return PulseTrain.healthy(chosen.pulse(ratio), overlap)


def relative(form, ratio, orders):
    train = mesh(form, ratio)
    return train.coefficients(orders) / train.coefficients([0])[0]


# --- parabola ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("ratio", "mean", "two", "one", "least", "most", "entry"),
    [
        (1.4120, 1.200200, 1.523046, 0.973988, 0.921964, 1.548588, 1.471964),
        (1.5500, 1.317500, 1.587617, 0.987357, 0.962071, 1.625390, 1.512071),
        (1.692757, 1.438843, 1.635665, 0.995058, 0.985175, 1.685911, 1.535175),
    ],
)
def test_parabola(ratio, mean, two, one, least, most, entry):
    curve = mesh("parabolic", ratio)
    assert curve.coefficients([0])[0].real == pytest.approx(mean, abs=5e-7)
    assert zone_means(ratio) == pytest.approx((two, one), abs=1e-6)
    middle = 0.5 * (ratio - 1)
    ends = curve.at([0.0, ratio - 1, middle])
    assert ends == pytest.approx([entry, least, most], abs=1e-6)
    values = curve.at(np.arange(4096) / 4096)
    assert values.min() >= least - 1e-6
    assert values.max() <= most + 1e-6


def test_parabola_coefficients():
    c = np.abs(relative("parabolic", 1.412, np.arange(1, 6)))
    np.testing.assert_allclose(
        c, [0.1373112, 0.0505471, 0.0287304, 0.0342730, 0.0033705], atol=5e-8
    )
    # the source of the second curvature rounds its constants to three digits
    gu = np.abs(relative("parabolic-gu", 1.412, [1, 2, 3]))
    np.testing.assert_allclose(gu, [0.14928, 0.05171, 0.03208], atol=1.5e-4)


@given(RATIOS, st.floats(0, 2.2), st.floats(0, 0.9))
def test_coefficients_are_the_published_closed_form(ratio, overlap, q):
    """Psi(pi n eps_a) sinc(n eps_b) cos[pi n (2 t/T - eps_a - eps_b)]."""
    n = np.arange(1, 60)
    x = np.pi * n * ratio
    psi = (1 - q) * np.sin(x) / x - 2 * q * (np.cos(x) / x**2 - np.sin(x) / x**3)
    expected = psi / (1 - q / 3) * np.sinc(n * overlap)
    expected = expected * np.exp(-1j * np.pi * n * (ratio + overlap))
    train = mesh(Parabolic(curvature=q), ratio, overlap)
    found = train.coefficients(n) / train.coefficients([0])[0]
    np.testing.assert_allclose(found, expected, atol=1e-13)


@given(RATIOS, st.floats(0, 1))
def test_parabola_is_the_sum_over_the_pairs(ratio, phase):
    assert mesh("parabolic", ratio).at([phase])[0] == pytest.approx(
        parabolic_mesh(phase % 1, ratio), abs=1e-12
    )


# --- closed form against FFT ---------------------------------------------------------------------


@given(st.sampled_from(sorted(FORMS)), st.integers(64, 200), st.integers(0, 100))
def test_closed_form_is_the_fft_of_the_curve(name, sixtyfourths, lag):
    """On a grid that holds the ends of all zones, the FFT at Gauss points is exact."""
    train = mesh(name, sixtyfourths / 64, lag / 64)
    count = 40
    slow = fft_coefficients(train.at, 1.0, count, 128, nodes=16)
    mean = slow[0].real
    np.testing.assert_allclose(
        train.coefficients(np.arange(count + 1)) / mean, slow / mean, atol=1e-12
    )


# --- wave, rectangle, Fourier sum ----------------------------------------------------------------


@given(st.floats(1.05, 2.95).filter(lambda r: 0.05 < r % 1 < 0.95))
def test_wave_shares_end_and_middle_values_with_the_parabola(ratio):
    part = ratio % 1
    at = np.array([0.0, 0.5 * part, part, 0.5 * (1 + part)])
    wave, parabola = mesh("wave", ratio).at(at), mesh("parabolic", ratio).at(at)
    np.testing.assert_allclose(wave, parabola, atol=1e-9)


def test_wave_is_a_half_sine_in_each_zone():
    ratio = 1.412
    ends = mesh("parabolic", ratio).at([0.0, 0.206, 0.412, 0.706])
    x = np.linspace(0.0, 0.411, 20)
    arch = ends[0] + (ends[1] - ends[0]) * np.sin(np.pi * x / 0.412)
    np.testing.assert_allclose(mesh("wave", ratio).at(x), arch, atol=1e-12)
    x = np.linspace(0.413, 0.999, 20)
    arch = ends[2] + (ends[3] - ends[2]) * np.sin(np.pi * (x - 0.412) / 0.588)
    np.testing.assert_allclose(mesh("wave", ratio).at(x), arch, atol=1e-12)


@given(st.floats(1.01, 2.99).filter(lambda r: 0.01 < r % 1 < 0.99))
def test_rectangle_has_the_zone_means_and_the_mean_of_the_parabola(ratio):
    part = ratio % 1
    curve = mesh("rectangular", ratio)
    high, low = zone_means(ratio)
    assert curve.at([0.0, 0.9 * part, 1.01 * part, 0.999]) == pytest.approx([high, high, low, low])
    parabola = mesh("parabolic", ratio).coefficients([0])[0].real
    assert curve.coefficients([0])[0].real == pytest.approx(parabola)


def test_rectangle_coefficients():
    """f_n = sin(n pi D)/(n pi (1 - D)) for f = +1 on the duty D, zero mean."""
    duty, n = 0.412, np.arange(1, 20)
    c = relative("rectangular", 1 + duty, n)
    high = mesh("rectangular", 1 + duty).at([0.1])[0]
    eps = high / mesh("rectangular", 1 + duty).coefficients([0])[0].real - 1
    expected = eps * np.sin(n * np.pi * duty) / (n * np.pi * (1 - duty))
    np.testing.assert_allclose(c, expected * np.exp(-1j * np.pi * n * duty), atol=1e-13)


def test_half_duty_rectangle_has_odd_terms_only():
    c = relative("rectangular-half", 1.412, np.arange(1, 21))
    assert np.abs(c[1::2]).max() < 1e-15
    # eps = (K_d - K_s)/(K_d + K_s) of the paper's data
    high, low = zone_means(1.412)
    eps = (high - low) / (high + low)
    assert eps == pytest.approx(0.2199, abs=5e-5)
    j = np.arange(10)
    expected = eps * (2 / np.pi) * (-1.0) ** j / (2 * j + 1)
    # their origin is the middle of the high part, a quarter period after ours
    shifted = c[0::2] * np.exp(0.5j * np.pi * (2 * j + 1))
    np.testing.assert_allclose(shifted, expected, atol=1e-14)


@pytest.mark.parametrize("terms", [1, 3, 8, 30])
def test_fourier_sum_keeps_its_terms_and_no_others(terms):
    n = np.arange(1, 2 * terms + 8)
    found = relative(FourierSum(terms=terms), 1.412, n)
    full = relative("rectangular-half", 1.412, n)
    np.testing.assert_allclose(found, np.where(n < 2 * terms, full, 0), atol=1e-13)
    true = relative(FourierSum(terms=terms, duty="true"), 1.412, n)
    full = relative("rectangular", 1.412, n)
    np.testing.assert_allclose(true, np.where(n <= terms, full, 0), atol=1e-13)


def test_overshoot_of_the_fourier_sum():
    """Peak (2/pi) Si(pi) = 1.178980 of a square wave of +-1, at any large number of terms."""
    train = mesh(FourierSum(terms=300), 1.5)
    mean, (high, low) = train.coefficients([0])[0].real, zone_means(1.5)
    peak = train.at(np.linspace(0, 0.02, 20001)).max()
    unit = (peak - mean) / (0.5 * (high - low))
    assert 2 / math.pi * sici(math.pi)[0] == pytest.approx(1.178980, abs=1e-6)
    assert unit == pytest.approx(1.178980, abs=2e-4)


@given(st.sampled_from(sorted(FORMS)), RATIOS)
def test_every_form_is_symmetric_in_time(name, ratio):
    """A pair enters as it leaves: c_n times exp(i pi n length) is real."""
    pulse = FORMS[name].pulse(ratio)
    n = np.arange(1, 12)
    turned = pulse.transform(n) * np.exp(1j * np.pi * n * pulse.length)
    np.testing.assert_allclose(turned.imag, 0, atol=1e-12)


@pytest.mark.parametrize("name", sorted(FORMS))
def test_contact_ratio_of_whole_number(name):
    """With exactly two pairs throughout no zone of another number is left."""
    curve = mesh(name, 2.0).at(np.linspace(0, 1, 11))
    assert np.isfinite(curve).all()
    assert curve.min() > 1.2


def test_names():
    assert {name: form.name for name, form in FORMS.items() if name != "parabolic-gu"} == {
        name: name for name in FORMS if name != "parabolic-gu"
    }


def test_zones_of_a_short_helical_contact():
    assert [own.tolist() for own in contact_zones(0.8)] == [[0.0, 0.8], [1]]


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: Parabolic(curvature=1.0), r"curvature = 1.0 must lie in \[0, 1\)"),
        (lambda: Parabolic(normalisation="peak"), 'normalisation = "peak" must be one of'),
        (lambda: Rectangular(duty="quarter"), 'duty = "quarter" must be one of "true", "half"'),
        (lambda: FourierSum(terms=0), r"terms = 0 must lie in \[1, 400\]"),
        (lambda: FourierSum(terms=2.5), "terms = 2.5 must be a whole number"),
    ],
)
def test_refusals(make, match):
    with pytest.raises(ArgumentError, match=match):
        make()
