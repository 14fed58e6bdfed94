"""Exact Fourier coefficients of a motion on a piecewise constant stiffness.

Integrating z'' + 2 h z' + s z = g by parts over a piece, with W = n w, e = e^{-iWt} and [.] the
difference of its ends, gives for the integrals Z of z e and A of z'' e

    D Z = i g [e]/W - [v e] - (i W + 2 h)[z e],     D A = s [v e] - i W [a e],
    D = s - W^2 + 2 i h W.

Z is used below the mean natural frequency and A above it, where z_n = -A/(W^2 T) keeps its digits
although it falls as n^-3. Where D cancels in a piece, because it swings at the line itself with
little damping, its free vibration is integrated by its exponents instead.

Arrays have the pieces on axis 0: h [1/s], s [1/s2], tau [s], g [m/s2] of each piece, z [m] and
v [m/s] at its start.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.fourier import Complex, Real

Integers = npt.NDArray[np.int_]
Flags = npt.NDArray[np.bool_]
Anything = TypeVar("Anything", bound=npt.NDArray[Any])

#: Elements of one block: a few such arrays stay in the cache.
BLOCK = 20_000
#: Share of s + W^2 below which D has lost digits to cancellation.
NEAR_RESONANCE = 0.03
#: Durations that agree so closely repeat.
SAME = 1e-13


class Motion(NamedTuple):
    """What a periodic motion is made of, shape (P,) or (P, systems)."""

    h: Real
    s: Real
    tau: Real
    g: Real
    z: Real
    v: Real

    def accelerations(self) -> tuple[Real, Real]:
        """Return z'' at the start and at the end of each piece [m/s2]."""
        z, v = after(self.z), after(self.v)
        return (
            self.g - 2 * self.h * self.v - self.s * self.z,
            self.g - 2 * self.h * v - self.s * z,
        )

    def mean(self) -> Real:
        """Mean displacement [m]: in each piece s Z = g tau - [v] - 2 h [z]."""
        moved = self.g * self.tau - (after(self.v) - self.v)
        moved = moved - 2 * self.h * (after(self.z) - self.z)
        return np.asarray((moved / self.s).sum(axis=0) / self.tau.sum(axis=0))


def after(x: Anything) -> Anything:
    """Return the values of the next piece; the last is followed by the first."""
    return cast(Anything, np.concatenate([x[1:], x[:1]]))


def before(x: Anything) -> Anything:
    """Return the values of the piece before."""
    return cast(Anything, np.concatenate([x[-1:], x[:-1]]))


def turned(turns: npt.NDArray[Any]) -> Complex:
    """e^{-2 pi i turns}."""
    return np.asarray(np.exp(-2j * math.pi * np.mod(turns, 1.0)))


def cancels(factor: Complex, s: Real, angular: Real) -> Flags:
    """Where D is too small to divide by."""
    return np.asarray(np.abs(factor) < NEAR_RESONANCE * (np.abs(s) + angular**2))


def by_exponents(one: Motion, angular: Real, fast: Flags | bool) -> Complex:
    """Integral of z e, or of z'' e where `fast`, of swinging pieces; time from each one's start."""
    rest = one.g / one.s
    exponent: Complex = -one.h + 1j * np.sqrt(one.s - one.h**2)
    size = 0.5 * ((one.z - rest) - 1j * (one.v + one.h * (one.z - rest)) / exponent.imag)
    weighted = size * np.where(fast, exponent**2, 1.0)
    swing = weighted * _integral(exponent - 1j * angular, one.tau)
    back = weighted.conj() * _integral(np.conj(exponent) - 1j * angular, one.tau)
    still = np.where(fast, 0.0, rest) * _integral(
        np.asarray(-1j * angular, dtype=np.complex128), one.tau
    )
    return np.asarray(swing + back + still)


def _integral(exponent: Complex, tau: Real) -> Complex:
    """Integral of e^{exponent t} over 0..tau."""
    x = np.asarray(exponent * tau)
    zero = x == 0
    safe = np.where(zero, 1.0, x)
    return np.asarray(tau * np.where(zero, 1.0, np.expm1(safe) / safe))


def of_one(motion: Motion, start: float, highest: int) -> Complex:
    """Displacement harmonics 0..highest [m] of one system, shape (highest+1,).

    The sums over the ends of the pieces are taken for each stiffness together. Where the pieces
    repeat in time, as teeth do, the repetitions are summed by one FFT.
    """
    period = float(motion.tau.sum())
    h = float(motion.h[0])
    levels, kind = np.unique(motion.s, return_inverse=True)
    sums = _EndSums(motion, kind, len(levels))
    ratio = math.sqrt(max(0.0, float(motion.s @ motion.tau) / period)) * period / (2 * math.pi)
    found = np.empty(highest + 1, dtype=complex)
    found[0] = motion.mean()
    for orders in blocks(highest, sums.width, ratio):
        fast = bool(orders[0] > ratio)
        w = np.asarray(2 * math.pi / period * orders, dtype=np.float64)
        factor = levels[:, None] - w**2 + 2j * h * w
        small = cancels(factor, levels[:, None], w)
        factor[small] = np.inf
        force, speed, place, push = sums(orders)
        if fast:
            top = levels[:, None] * speed - 1j * w * push
        else:
            top = 1j / w * force - speed - (1j * w + 2 * h) * place
        total = (top / factor).sum(axis=0)
        for level, line in zip(*np.nonzero(small), strict=True):
            part = kind == level
            pieces = by_exponents(Motion(*(x[part] for x in motion)), w[line], fast)
            total[line] += pieces @ turned(sums.begin[part] * orders[line])
        found[orders] = total / period * (-1 / w**2 if fast else 1.0)
    found[1:] *= turned(np.arange(1, highest + 1) * (start / period))
    return found


def blocks(highest: int, width: int, split: float) -> list[Integers]:
    """Orders 1..highest in rows of at most `width`, none on both sides of `split`."""
    middle = min(highest, math.floor(split))
    rows: list[Integers] = []
    for first, last in ((1, middle), (middle + 1, highest)):
        rows += [np.arange(k, min(last + 1, k + width)) for k in range(first, last + 1, width)]
    return rows


class _EndSums:
    """Sums of x e over the ends of all pieces of one stiffness, for x = g, v, z and z''."""

    def __init__(self, motion: Motion, kind: Integers, levels: int) -> None:
        tau = motion.tau
        self.repeats = _repeats(tau)
        cycle = len(tau) // self.repeats
        here = np.arange(levels)[:, None] == kind
        there = np.arange(levels)[:, None] == before(kind)
        a, a_end = motion.accelerations()
        ends = (before(motion.g), motion.v, motion.z, before(a_end))
        starts = (motion.g, motion.v, motion.z, a)
        weights = np.array([there * x - here * y for x, y in zip(ends, starts, strict=True)])
        weights = weights.reshape(4, levels, self.repeats, cycle)
        # one cycle is its own transform
        self.spectra = np.fft.fft(weights, axis=2) if self.repeats > 1 else weights
        self.offsets = (np.cumsum(tau) - tau)[:cycle] / tau.sum()
        first = np.arange(self.repeats)[:, None] / self.repeats
        self.begin = (first + self.offsets).ravel()
        self.width = max(1, 5 * BLOCK // (cycle * (1 if self.repeats == 1 else 4 * levels)))

    def __call__(self, orders: Integers) -> Complex:
        """Return the sums, shape (4, levels, orders)."""
        phases = turned(self.offsets[:, None] * orders)
        if self.repeats == 1:
            return np.asarray(self.spectra[:, :, 0] @ phases)
        picked = self.spectra[:, :, orders % self.repeats]
        return np.asarray(np.einsum("xlnj,jn->xln", picked, phases))


def _repeats(tau: Real) -> int:
    """How often the durations repeat within the period."""
    count = len(tau)
    for cycle in range(1, count // 2 + 1):
        if count % cycle == 0:
            rows = tau.reshape(-1, cycle)
            if np.abs(rows - rows[0]).max() <= SAME * tau.max():
                return count // cycle
    return 1


def of_many(motion: Motion, start: float, highest: int) -> Complex:
    """Displacement harmonics 0..highest [m] of many systems, shape (systems, highest+1).

    One harmonic divides the two formulas for all of them, so that a system far from the others in
    frequency ratio loses digits by that factor.
    """
    systems = motion.z.shape[1]
    tau = motion.tau
    if tau.strides[1:] == (0,):
        tau = tau[:, :1]
    period = tau.sum(axis=0)
    begin = (np.cumsum(tau, axis=0) - tau) / period
    stiffness = np.maximum((motion.s * motion.tau).sum(axis=0), 1e-300)
    split = math.exp(float(np.log(stiffness * period).mean()) / 2) / (2 * math.pi)
    a, a_end = motion.accelerations()
    z_end, v_end = after(motion.z), after(motion.v)
    found = np.empty((highest + 1, systems), dtype=complex)
    found[0] = motion.mean()
    for order in range(1, highest + 1):
        w = 2 * math.pi / period * order
        phase: Complex = turned(begin * order)
        ahead = after(phase)
        factor: Complex = motion.s - w**2 + 2j * (motion.h * w)
        small = cancels(factor, motion.s, np.broadcast_to(w, factor.shape[1:]))
        top = np.empty(factor.shape, dtype=complex)
        fast = order > split
        if fast:
            _ends(top, motion.s * v_end, -w * a_end, ahead, motion.s * motion.v, -w * a, phase)
        else:
            _ends(
                top,
                -v_end - 2 * motion.h * z_end,
                motion.g / w - w * z_end,
                ahead,
                -motion.v - 2 * motion.h * motion.z,
                motion.g / w - w * motion.z,
                phase,
            )
        if small.any():
            factor[small] = 1.0
            part = Motion(*(np.broadcast_to(x, factor.shape)[small] for x in motion))
            angular = np.broadcast_to(w, factor.shape)[small]
            top[small] = (
                by_exponents(part, angular, fast) * np.broadcast_to(phase, top.shape)[small]
            )
        top /= factor
        found[order] = top.sum(axis=0) * ((-1 / w**2 if fast else 1.0) / period)
        found[order] *= turned(start / period * order)
    return found.T


def _ends(out: Complex, x1: Real, y1: Real, e1: Complex, x0: Real, y0: Real, e0: Complex) -> None:
    """(x1 + i y1) e1 - (x0 + i y0) e0 into `out`."""
    out.real = x1
    out.imag = y1
    out *= e1
    begin = np.empty_like(out)
    begin.real = x0
    begin.imag = y0
    begin *= e0
    out -= begin
