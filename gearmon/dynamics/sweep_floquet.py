"""Floquet forms of many sets that share one phi, their step matrices advanced side by side.

Theory and names are those of `floquet` and `error_bound`: steps over which phi is replaced by its
mean, the rest taken into v = z' + q z with an integral q that vanishes at both ends of a step. Cut
at the same angles for all sets, the step means of phi are common to all of them, and q scales with
the period. The columns of P(s) are the real and imaginary part of one free vibration where the two
multipliers have equal moduli, and else both free vibrations, each with its mean growth taken out.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from gearmon.dynamics.fourier import Complex, Real
from gearmon.dynamics.sweep_bounds import Swing

CHUNK = 128
MOST_STEPS = 1 << 14


def floquet_gain(
    ratio: Real, zeta: Real, scale: Real, swing: Swing, everywhere: bool = False
) -> tuple[Real, Real]:
    """Gains from the Floquet form of sets that share phi.

    Parameters
    ----------
    ratio, zeta, scale : float ndarray, shape (B,)
        R, damping ratio > 0, and the factor of phi.
    swing : Swing
        Of phi.
    everywhere : bool
        Let the gain hold at all real frequencies, not only at multiples of the mesh frequency.

    Returns
    -------
    gain : float ndarray, shape (B,)
        Infinite where the form proves nothing or free vibrations grow.
    growth : float ndarray, shape (B,)
        ln of the larger multiplier's modulus if it is above one for certain, else nan.
    """
    gain, growth = np.full(len(ratio), np.inf), np.full(len(ratio), np.nan)
    counts = _step_counts(ratio, zeta, scale, swing)
    waiting = np.arange(len(ratio))
    for _ in range(3):
        waiting = waiting[counts[waiting] <= MOST_STEPS]
        waiting = waiting[np.argsort(counts[waiting])]
        planned = counts[waiting]
        start = 0
        while start < len(waiting):
            alike = int(np.searchsorted(planned, 1.5 * planned[start], side="right"))
            end = min(start + CHUNK, alike)
            part, count = waiting[start:end], int(planned[end - 1])
            start = end
            found = _chunk(ratio[part], zeta[part], scale[part], swing, count, everywhere)
            gain[part], growth[part], loop = found
            # the loop falls with the square of the step
            factor = np.where(np.isfinite(loop), 1.2 * np.sqrt(np.maximum(loop, 1.0)), np.inf)
            counts[part] = np.ceil(count * np.maximum(1.5, factor))
        waiting = waiting[np.isinf(gain[waiting]) & np.isnan(growth[waiting])]
    return gain, growth


def _step_counts(ratio: Real, zeta: Real, scale: Real, swing: Swing) -> Real:
    """As the first count of `error_bound.floquet_gain`, less so: most sets need no more."""
    for_rest = np.sqrt(scale * swing.slope / ratio * (1 + zeta) / np.maximum(zeta, 1e-6))
    steps = 2 * math.pi * ratio * np.maximum(3 * (1 + zeta), for_rest)
    counts: Real = np.ceil(np.maximum(max(16, 2 * len(swing.harmonics) + 2), 0.6 * steps))
    return counts


def _chunk(
    ratio: Real, zeta: Real, scale: Real, swing: Swing, count: int, everywhere: bool
) -> tuple[Real, Real, Real]:
    """Gains, certain growths, and twice the Neumann loop of sets cut into `count` steps."""
    length, period = 2 * math.pi * ratio / count, 2 * math.pi * ratio
    # sets that grow too fast give nonsense here, and are left unsettled
    with np.errstate(all="ignore"):
        products = _running_products(ratio, zeta, scale, swing, count)
        half_trace = (products[-1, 0, 0] + products[-1, 1, 1]) / 2
        own_growth = np.arccosh(np.maximum(1.0, np.abs(half_trace)))
        turned = np.arccos(np.clip(half_trace, -1, 1))
        margin = zeta - own_growth / period
        rest = scale * swing.slope / ratio * length**2 / 8
        within = zeta + np.hypot(zeta + rest, scale * swing.highest / 2 + zeta * rest)
        state = _condition(products, half_trace, own_growth) * np.exp(2 * length * within)
        state /= margin if everywhere else np.hypot(margin, turned / period)
        loop = state * (2 * rest * (1 + 2 * zeta) + rest**2)
        force = np.hypot(1 + scale * swing.highest + 2 * zeta * rest, 2 * zeta)
        gain = 1 + force * state / (1 - loop)
        proven = (margin > 0) & (loop < 0.5) & np.isfinite(gain)
        # close to the boundary the steps are not exact enough to tell
        excess = own_growth - zeta * period
        growing = excess > 1e-2 * (1 + zeta * period)
    return np.where(proven, gain, np.inf), np.where(growing, excess, np.nan), 2 * loop


def _running_products(ratio: Real, zeta: Real, scale: Real, swing: Swing, count: int) -> Real:
    """Products of the step matrices up to each step, damping taken out, (count, 2, 2, B)."""
    length = 2 * math.pi * ratio / count
    mean, offset = _step_averages(swing.harmonics, count)
    mean, offset = scale * mean[:, None], scale * ratio * offset[:, None]
    diagonal, lower = zeta - offset, -(1 + mean) + 2 * zeta * offset
    square = (diagonal**2 + lower) * length**2
    root = np.sqrt(np.abs(square))
    even, odd = np.cos(root), np.sin(root) / np.maximum(root, 1e-150)
    slow = square >= 0
    if slow.any():
        even[slow] = np.cosh(root[slow])
        odd[slow] = np.sinh(np.maximum(root[slow], 1e-9)) / np.maximum(root[slow], 1e-9)
    odd *= length
    spread = odd * diagonal
    products = np.empty((count, 2, 2, len(ratio)))
    np.add(even, spread, out=products[:, 0, 0])
    np.subtract(even, spread, out=products[:, 1, 1])
    products[:, 0, 1] = odd
    np.multiply(odd, lower, out=products[:, 1, 0])
    first, second = np.empty((2, 2, 2, len(ratio)))
    for before, now in itertools.pairwise(products):
        np.multiply(now[:, 0, None], before[None, 0], out=first)
        np.multiply(now[:, 1, None], before[None, 1], out=second)
        np.add(first, second, out=now)
    return products


def _step_averages(harmonics: Complex, count: int) -> tuple[Real, Real]:
    """Means over each of `count` steps of phi, and of q over R; needs count > 2 J."""
    orders = np.arange(1, len(harmonics) + 1)
    step = 2 * math.pi / count
    half = orders * step / 2
    middle = harmonics * np.exp(1j * half)
    # integral of a e^{i j a} over a step about its middle; the series where it would cancel
    series = step * half * (1 / 6 - half**2 / 60 * (1 - half**2 / 28))
    closed = 2 * (np.sin(half) - half * np.cos(half)) / (orders**2 * step)
    spectra = np.zeros((2, count // 2 + 1), dtype=complex)
    spectra[0, 1 : len(harmonics) + 1] = middle * np.sinc(half / math.pi)
    spectra[1, 1 : len(harmonics) + 1] = -1j * middle * np.where(half < 0.05, series, closed)
    mean, offset = np.fft.irfft(spectra, count, norm="forward")
    return mean, offset


def _condition(products: Real, half_trace: Real, growth: Real) -> Real:
    """max|P| max|P^-1| over the steps, the area spanned by the two columns being constant."""
    last, swinging = products[-1], growth == 0
    apart = np.sqrt(np.abs(1 - half_trace**2))
    upper = np.abs(last[0, 1]) >= np.abs(last[1, 0])
    # eigenvectors (b, mu - a) or (mu - d, c) of [[a, b], [c, d]]
    middle = np.where(
        upper, [last[0, 1], half_trace - last[0, 0]], [half_trace - last[1, 1], last[1, 0]]
    )
    aside = np.where(upper, [np.zeros_like(apart), apart], [apart, np.zeros_like(apart)])
    aside = np.where(half_trace < 0, -aside, aside)
    first = np.where(swinging, middle, middle + aside)
    second = np.where(swinging, aside, middle - aside)
    area = np.abs(first[0] * second[1] - first[1] * second[0])
    shares = growth * (np.arange(1, len(products) + 1) / len(products))[:, None]
    sizes = []
    for vector, sign in ((first, -2.0), (second, 2.0)):
        moved = products[:, :, 0] * vector[0] + products[:, :, 1] * vector[1]
        square = moved[:, 0] ** 2 + moved[:, 1] ** 2
        if not swinging.all():
            square *= np.exp(sign * shares)
        sizes.append(square)
    balance = np.sqrt(sizes[1].mean(axis=0) / sizes[0].mean(axis=0))
    balance = np.where(swinging, 1.0, balance)
    largest = (sizes[0] * balance + sizes[1] / balance).max(axis=0)
    return np.asarray((largest + np.sqrt(np.maximum(0.0, largest**2 - 4 * area**2))) / (2 * area))
