"""Slow, obvious versions of the mesh stiffness: one position, one pair, one section at a time."""

from __future__ import annotations

import math

import numpy as np


def parabola(phase, contact_ratio, q=0.45):
    """Stiffness of one pair over its maximum, `phase` mesh periods after it entered contact."""
    if not 0 <= phase < contact_ratio:
        return 0.0
    return 1 - q * (2 * phase / contact_ratio - 1) ** 2


def parabolic_mesh(phase, contact_ratio, q=0.45):
    """Sum over all pairs, in units of the maximum of one."""
    return sum(parabola(phase + j, contact_ratio, q) for j in range(-1, math.ceil(contact_ratio)))


def helical_mesh(phase, contact_ratio, overlap, q=0.45, sections=4000):
    """Mean over sections of the face width that lag behind one another (midpoint rule)."""
    lag = overlap * (np.arange(sections) + 0.5) / sections
    return np.mean([parabolic_mesh((phase - s) % 1.0, contact_ratio, q) for s in lag])


def damaged_mesh(phase, contact_ratio, losses, teeth, q=0.45):
    """Spur mesh in which single teeth of both gears leave a share of their pair's stiffness.

    Parameters
    ----------
    losses : two dicts {tooth: function of contact phase -> loss}
    teeth : (z1, z2)
    """
    total = 0.0
    for entry in range(math.floor(phase) - math.ceil(contact_ratio), math.floor(phase) + 1):
        since = phase - entry
        share = parabola(since, contact_ratio, q)
        for of_gear, z in zip(losses, teeth, strict=True):
            loss = of_gear.get(entry % z + 1)
            share *= 1 if loss is None else 1 - loss(since)
        total += share
    return total


def fft_coefficients(curve, period, count, intervals, nodes=12):
    """Fourier coefficients c_0 ... c_count of a curve, by FFTs of its values at Gauss points.

    Exact to rounding error if the curve is smooth on each of the `intervals` equal parts of the
    period: the points of one kind in all intervals are one FFT.
    """
    x, w = np.polynomial.legendre.leggauss(nodes)
    x, w = 0.5 * (x + 1), 0.5 * w
    orders = np.arange(count + 1)
    total = np.zeros(count + 1, dtype=complex)
    for point, weight in zip(x, w, strict=True):
        values = curve((np.arange(intervals) + point) * period / intervals)
        spectrum = np.fft.fft(values) / intervals
        total += (
            weight * spectrum[orders % intervals] * np.exp(-2j * np.pi * orders * point / intervals)
        )
    return total
