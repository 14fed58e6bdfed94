import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.dynamics.error_bound import Pattern
from gearmon.dynamics.fourier import (
    Modulation,
    fast_length,
    rms,
    samples,
    supremum,
    turning,
)


@pytest.mark.parametrize("lines", [np.arange(1.0, 200), np.arange(-7.5, 8), np.array([3.0]), []])
@pytest.mark.parametrize("angle", [0.3, [], [[0.0, 1.0, -2.0], [3.0, 6.2, 0.1]]])
def test_turning_is_the_exponential_of_every_line(lines, angle):
    lines, angle = np.asarray(lines, dtype=float), np.asarray(angle, dtype=float)
    expected = np.exp(1j * angle[..., None] * lines)
    found = turning(angle, lines)
    assert found.shape == expected.shape
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


@given(st.integers(1, 200_000))
def test_fast_length_is_the_smallest_smooth_number(least):
    length = fast_length(least)
    rest = length
    for prime in (2, 3, 5):
        while rest % prime == 0:
            rest //= prime
    assert rest == 1
    assert least <= length < max(2, 1.13 * least + 1)


def test_fast_length_matches_brute_force():
    smooth = sorted(2**a * 3**b * 5**c for a in range(13) for b in range(9) for c in range(7))
    for least in range(1, 2000):
        assert fast_length(least) == next(n for n in smooth if n >= least)


@pytest.mark.parametrize(
    ("inputs", "band", "outputs"), [(5, 3, 8), (3, 9, 2), (10, 40, 10), (0, 4, 4)]
)
def test_product_is_the_convolution(inputs, band, outputs):
    rng = np.random.default_rng(3)
    y = rng.normal(size=inputs + 1) + 1j * rng.normal(size=inputs + 1)
    y[0] = y[0].real
    c = rng.normal(size=band) + 1j * rng.normal(size=band)
    two_sided = np.convolve(
        np.concatenate([y[:0:-1].conj(), y]), np.concatenate([c[::-1].conj(), [0], c])
    )
    expected = np.zeros(outputs + 1, dtype=complex)
    found = two_sided[inputs + band :][: outputs + 1]
    expected[: len(found)] = found
    np.testing.assert_allclose(Modulation(c, inputs, outputs)(y), expected, atol=1e-12)


@given(st.integers(1, 40), st.integers(0, 2**32 - 1))
def test_parseval_and_supremum(degree, seed):
    rng = np.random.default_rng(seed)
    half = rng.normal(size=degree + 1) + 1j * rng.normal(size=degree + 1)
    half[0] = half[0].real
    fine = samples(half, 64 * degree + 64)
    assert rms(half) == pytest.approx(np.sqrt(np.mean(fine**2)), rel=1e-12)
    assert np.abs(fine).max() <= supremum(half) <= 1.09 * np.abs(fine).max()


def test_middle_and_swing():
    middle, swing = Pattern(np.array([0.5, 0.125], dtype=complex)).middle_and_swing
    # cos x + 0.25 cos 2x runs from -0.75 to 1.25
    assert middle == pytest.approx(0.25, abs=0.02)
    assert 1.0 - 0.02 <= swing <= 1.1
    rng = np.random.default_rng(3)
    for _ in range(20):
        c = rng.normal(size=9) + 1j * rng.normal(size=9)
        middle, swing = Pattern(c).middle_and_swing
        dense = np.fft.irfft(np.concatenate([[0], c]), 4096, norm="forward")
        assert np.abs(dense - middle).max() <= swing
