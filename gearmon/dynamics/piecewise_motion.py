"""Exact periodic motion on a piecewise constant stiffness, and its Fourier coefficients.

Arrays have the pieces on their first axis: h [1/s], s = k/m [1/s2], tau [s] and g = F/m [m/s2] of
each piece, z [m] and v [m/s] at its start.

Integrating z'' + 2 h z' + s z = g by parts over a piece, with W = n w, e = e^{-iWt} and [.] the
difference of its ends, gives for the integrals Z of z e and A of z'' e

    D Z = i g [e]/W - [v e] - (i W + 2 h)[z e],     D A = s [v e] - i W [a e],
    D = s - W^2 + 2 i h W.

Z is used below the mean natural frequency and A above it, where z_n = -A/(W^2 T) keeps its digits
although it falls as n^-3. Where D cancels in a piece, because it swings at the line itself with
little damping, its free vibration is integrated by its exponents instead.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np
import numpy.typing as npt

from gearmon.dynamics import step_maps
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


class _Pieces(NamedTuple):
    """What a periodic motion is made of, shape (P,)."""

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


def by_exponents(one: _Pieces, angular: Real, fast: Flags | bool) -> Complex:
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


def of_one(motion: _Pieces, start: float, highest: int) -> Complex:
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
            pieces = by_exponents(_Pieces(*(x[part] for x in motion)), w[line], fast)
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

    def __init__(self, motion: _Pieces, kind: Integers, levels: int) -> None:
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


@dataclass(frozen=True, kw_only=True, eq=False)
class PiecewiseMotion:
    """Periodic motion of systems whose stiffness and force are constant within each piece.

    Attributes
    ----------
    h, s, tau, g : float ndarray, shape (P,)
        As in the module's text.
    start : float
        Time [s] at which the first piece begins.
    z, v : float ndarray, shape (P,)
        Displacement and velocity at the start of each piece; not finite without periodic motion.
    whole : Maps
        Map of a period.
    """

    h: Real
    s: Real
    tau: Real
    g: Real
    start: float
    z: Real
    v: Real
    whole: step_maps.Maps

    @classmethod
    def solve(cls, h: Real, s: Real, tau: Real, g: Real, start: float = 0.0) -> PiecewiseMotion:
        """Find the periodic motion; the arrays broadcast."""
        z, v, whole = step_maps.periodic_states(step_maps.step(h, s, tau, g))
        return cls(h=h, s=s, tau=tau, g=g, start=start, z=z, v=v, whole=whole)

    @cached_property
    def period(self) -> Real:
        """Period [s]."""
        return np.asarray(self.tau.sum(axis=0))

    @cached_property
    def stable(self) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        """Whether free vibrations die out."""
        return step_maps.is_stable(self.whole, 2 * (self.h * self.tau).sum(axis=0))

    def lines(self, highest: int) -> Complex:
        """Exact displacement harmonics 0..highest [m], shape (highest+1,)."""
        rows = (self.h, self.s, self.tau, self.g, self.z, self.v)
        return of_one(_Pieces(*np.broadcast_arrays(*rows)), self.start, highest)

    def values(self, phase: Real) -> tuple[Real, Real, Real, Real]:
        """Displacement, velocity, acceleration and mesh force per mass at phases of the period.

        Parameters
        ----------
        phase : float ndarray, shape (M,)
            Time since the first piece began, over the period, in [0, 1).

        Returns
        -------
        four float ndarrays, shape (M,)
            [m], [m/s], [m/s2], [m/s2]; at a jump the values after it.
        """
        moment = phase * self.period
        begins = np.cumsum(self.tau) - self.tau
        index = np.searchsorted(begins[1:], moment, side="right")
        s, g = self.s[index], self.g[index]
        h = np.broadcast_to(self.h, self.z.shape)[index]
        maps = step_maps.step(h, s, moment - begins[index], g)
        z, v = maps.move(self.z[index], self.v[index])
        push = s * z + 2 * h * v
        return z, v, g - push, push

    def least_push(self, sign: Real | float = 1.0) -> Real:
        """Smallest mesh force per mass over the period [m/s2], times `sign`, shape (...,).

        Within a piece the mesh force is g - z'', and z'' a free vibration: it is least at an end
        or where z''' vanishes for the first or second time; later swings are smaller.
        """
        times = self.turning_times()
        h, s, g = self.h, self.s, self.g
        least = np.full(self.z.shape, np.inf)
        for moment in (np.zeros_like(self.z), *times, np.broadcast_to(self.tau, self.z.shape)):
            inside = np.clip(np.nan_to_num(moment, nan=0.0), 0.0, self.tau)
            z, v = step_maps.step(h, s, inside, g).move(self.z, self.v)
            least = np.minimum(least, sign * (s * z + 2 * h * v))
        return np.asarray(least.min(axis=0))

    def turning_times(self) -> tuple[Real, Real]:
        """First two times since its start at which z''' vanishes in each piece; NaN if none [s]."""
        a = self.g - 2 * self.h * self.v - self.s * self.z
        jerk = -2 * self.h * a - self.s * self.v
        rate = -self.h * jerk - self.s * a
        square = np.asarray(self.s - self.h**2 + 0 * self.z)
        root = np.sqrt(np.abs(square))
        with np.errstate(divide="ignore", invalid="ignore"):
            angle = np.mod(np.arctan2(-jerk * root, rate), math.pi)
            creep = np.arctanh(-jerk * root / rate)
            straight = -jerk / rate
            first = np.where(square > 0, angle / root, np.where(square < 0, creep / root, straight))
            second = np.where(square > 0, (angle + math.pi) / root, np.nan)
        one, two = (np.where((x > 0) & (x < self.tau), x, np.nan) for x in (first, second))
        return one, two
