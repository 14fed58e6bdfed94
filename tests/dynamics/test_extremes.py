import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.dynamics.fourier import Curve


def random_half(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 60))
    half = rng.normal(size=count + 1) + 1j * rng.normal(size=count + 1)
    half /= np.arange(1, count + 2) ** rng.uniform(0, 2)
    half[0] = 0
    return half


def test_closed_forms():
    # 1 + cos x + 0.25 cos 2x has its minimum 0.25 at pi
    assert Curve(np.array([1, 0.5, 0.125], dtype=complex)).lowest() == pytest.approx(0.25)
    assert Curve(np.array([3.0 + 0j])).lowest() == 3.0
    assert Curve(np.array([3.0 + 0j])).first_not_positive() is None
    assert Curve(np.array([-3.0 + 0j])).first_not_positive() == 0.0
    # cos x is positive up to pi/2
    angle = Curve(np.array([0, 0.5], dtype=complex)).first_not_positive()
    assert angle == pytest.approx(math.pi / 2, abs=1e-9)


def test_a_dip_between_all_samples_is_found():
    # Fejer's kernel of degree 40, turned over and placed off any grid: a dip of width 2 pi/41
    orders = np.arange(41)
    for place in np.linspace(0.3, 6.1, 7):
        half = -(1 - orders / 41) * np.exp(-1j * orders * place)
        half[0] = 40.99
        curve = Curve(half)
        assert curve.first_not_positive() is None or curve.lowest() <= 0
        deepest = 40.99 - 2 * (1 - orders[1:] / 41).sum()
        assert curve.lowest() == pytest.approx(deepest, abs=1e-8)
        half[0] -= deepest + 1e-7
        angle = Curve(half).first_not_positive()
        assert angle == pytest.approx(place, abs=1e-3)


@given(st.integers(0, 2**32 - 1))
def test_no_sample_lies_lower(seed):
    half = random_half(seed)
    lowest = Curve(half).lowest()
    dense = np.fft.irfft(half, 1 << 14, norm="forward")
    assert lowest <= dense.min() + 1e-9
    assert lowest >= dense.min() - Curve(half).bend * (2 * math.pi / (1 << 14)) ** 2 / 8


@given(st.integers(0, 2**32 - 1), st.floats(-0.5, 0.5))
def test_first_zero(seed, share):
    half = random_half(seed)
    half[0] = -(1 - share) * Curve(half).lowest()
    curve = Curve(half)
    angle = curve.first_not_positive()
    if share < -1e-9:
        assert angle is None
    if share > 1e-9:
        assert angle is not None
        assert abs(curve.at(np.array([angle]))[0]) < 1e-6 * curve.size or angle == 0
        dense = np.fft.irfft(half, 1 << 14, norm="forward")
        lost = np.flatnonzero(dense <= 0)
        if len(lost):
            assert angle <= 2 * math.pi * lost[0] / (1 << 14) + 1e-9
