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

The states follow from the exact motion on a constant stiffness, step by step:

    z'' + 2 h z' + s z = g,    state x = (z, z')

Within a step h, s and g are constant, so x(t) = x(0) + N(t) x(0) + g (P, Q) with

    Q(t) = response of the velocity-free mass to a unit impulse,   P(t) = integral of Q,
    N = [ -s P   Q ;  -s Q   -s P - 2 h Q ]  (the step matrix less the identity).

Everything follows from P and Q, which are positive sums of well-conditioned terms in every case
(swinging, critical, creeping; s of either sign). N rather than I + N is kept, because I - (I+N)
would cancel for periods that are short against the vibration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
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
#: Below this length in radians P is summed as a power series, above it is not cancelling.
SHORT = 0.5
SERIES_TERMS = 16


class Maps(NamedTuple):
    """Affine maps x -> x + N x + b of states (z, z'), one per entry of the arrays."""

    n11: Real
    n12: Real
    n21: Real
    n22: Real
    b1: Real
    b2: Real

    def move(self, z: Real, v: Real) -> tuple[Real, Real]:
        """Return the moved states."""
        return (
            z + (self.n11 * z + self.n12 * v + self.b1),
            v + (self.n21 * z + self.n22 * v + self.b2),
        )

    def determinant(self) -> Real:
        """det(-N) = 1 - trace + determinant of the step matrix."""
        return self.n11 * self.n22 - self.n12 * self.n21

    def fixed_point(self) -> tuple[Real, Real]:
        """State that the map leaves where it is; infinite or NaN if there is none or no single."""
        with np.errstate(divide="ignore", invalid="ignore"):
            det = self.determinant()
            z = (self.n12 * self.b2 - self.n22 * self.b1) / det
            v = (self.n21 * self.b1 - self.n11 * self.b2) / det
        return z, v


def step(h: Real, s: Real, tau: Real, g: Real) -> Maps:
    """Motion over the time tau under h, s and g, element by element.

    Parameters
    ----------
    h : float ndarray
        Half of damping over mass [1/s], >= 0.
    s : float ndarray
        Stiffness over mass [1/s2], any sign.
    tau : float ndarray
        Time [s], >= 0.
    g : float ndarray
        Force over mass [m/s2].
    """
    p, q = forced_and_free(h, s, tau)
    n11 = -s * p
    return Maps(n11, q, -s * q, n11 - 2 * h * q, g * p, g * q)


def forced_and_free(h: Real, s: Real, tau: Real) -> tuple[Real, Real]:
    """P(tau) [s2] and Q(tau) [s]; arguments as in `step`, broadcast."""
    square = s - h**2
    if square.size and square.min() > 0 and (s * tau**2).min() > SHORT**2:
        return _swinging(h, s, square, tau)
    h, s, tau, square = (
        np.asarray(x, dtype=np.float64) for x in np.broadcast_arrays(h, s, tau, square)
    )
    p, q = np.empty(tau.shape), np.empty(tau.shape)
    swings = square > 0
    p[swings], q[swings] = _swinging(*(x[swings] for x in (h, s, square, tau)))
    creeps = ~swings
    p[creeps], q[creeps] = _creeping(*(x[creeps] for x in (h, s, square, tau)))
    short = np.maximum(h, np.sqrt(np.abs(s))) * tau < SHORT
    p[short] = _series(h[short], s[short], tau[short])
    return p, q


def _swinging(h: Real, s: Real, square: Real, tau: Real) -> tuple[Real, Real]:
    d = np.sqrt(square)
    angle, fade = d * tau, np.exp(-h * tau)
    q = fade * np.sin(angle) / d
    return (1 - (fade * np.cos(angle) + h * q)) / s, q


def _creeping(h: Real, s: Real, square: Real, tau: Real) -> tuple[Real, Real]:
    g = np.sqrt(-square)
    fast = h + g
    slow = np.divide(s, fast, out=np.zeros_like(s), where=fast > 0)
    first, last = unit_integral(-slow * tau), unit_integral(-fast * tau)
    q = tau * np.exp(-slow * tau) * unit_integral(-2 * g * tau)
    apart = g * tau > 0.25
    p = np.empty_like(q)
    p[apart] = (tau * (first - last))[apart] / (2 * g[apart])
    # the exponents nearly agree: then s tau^2 is not small, or the series takes over
    near = ~apart
    rest = np.exp(-fast * tau) + fast * q
    p[near] = np.divide(1 - rest, s, out=np.zeros_like(s), where=s != 0)[near]
    return p, q


def unit_integral(x: Real) -> Real:
    """(e^x - 1)/x."""
    zero = x == 0
    safe = np.where(zero, 1.0, x)
    return np.where(zero, 1.0, np.expm1(safe) / safe)


def _series(h: Real, s: Real, tau: Real) -> Real:
    """Taylor series of P: P'' + 2 h P' + s P = 1 term by term."""
    a, b = 2 * h * tau, s * tau**2
    before, last = np.zeros_like(tau), tau**2 / 2
    total = last.copy()
    for n in range(3, SERIES_TERMS + 3):
        before, last = last, -(a * last / n + b * before / (n * (n - 1)))
        total += last
    return total


def composed(first: Maps, then: Maps) -> Maps:
    """Return the map that does `first` and `then` after it."""
    a, b = first, then
    return Maps(
        a.n11 + b.n11 + (b.n11 * a.n11 + b.n12 * a.n21),
        a.n12 + b.n12 + (b.n11 * a.n12 + b.n12 * a.n22),
        a.n21 + b.n21 + (b.n21 * a.n11 + b.n22 * a.n21),
        a.n22 + b.n22 + (b.n21 * a.n12 + b.n22 * a.n22),
        a.b1 + b.b1 + (b.n11 * a.b1 + b.n12 * a.b2),
        a.b2 + b.b2 + (b.n21 * a.b1 + b.n22 * a.b2),
    )


def running(maps: Maps) -> Maps:
    """Return maps from the start of the first piece to the end of each (axis 0), by doubling."""
    count, shift = len(maps.n11), 1
    while shift < count:
        moved = composed(
            Maps(*(x[:-shift] for x in maps)),
            Maps(*(x[shift:] for x in maps)),
        )
        maps = Maps(*(np.concatenate([x[:shift], y]) for x, y in zip(maps, moved, strict=True)))
        shift *= 2
    return maps


def last_of(maps: Maps) -> Maps:
    """Return the maps at the end of axis 0."""
    return Maps(*(x[-1] for x in maps))


def periodic_states(maps: Maps) -> tuple[Real, Real, Maps]:
    """States at the start of each piece that return after all of them, and the period's map.

    Returns
    -------
    z, v : float ndarray, shape of the maps
        Displacement [m] and velocity [m/s]; not finite where no periodic motion exists.
    whole : Maps
        Map of the whole period, without axis 0.
    """
    after = running(maps)
    whole = last_of(after)
    z0, v0 = whole.fixed_point()
    z, v = after.move(z0, v0)
    return (
        np.concatenate([z0[None], z[:-1]]),
        np.concatenate([v0[None], v[:-1]]),
        whole,
    )


def is_stable(whole: Maps, decay: Real) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Whether both multipliers of a period's map lie inside the unit circle (Jury's conditions).

    Parameters
    ----------
    whole : Maps
        Map of the period.
    decay : float ndarray
        2 h T: minus the logarithm of the product of the multipliers.
    """
    one = whole.determinant() > 0
    trace = 2 + whole.n11 + whole.n22
    return np.asarray(one & (1 + trace + np.exp(-decay) > 0) & (decay > 0))


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
    whole: Maps

    @classmethod
    def solve(cls, h: Real, s: Real, tau: Real, g: Real, start: float = 0.0) -> PiecewiseMotion:
        """Find the periodic motion; the arrays broadcast."""
        z, v, whole = periodic_states(step(h, s, tau, g))
        return cls(h=h, s=s, tau=tau, g=g, start=start, z=z, v=v, whole=whole)

    @cached_property
    def period(self) -> Real:
        """Period [s]."""
        return np.asarray(self.tau.sum(axis=0))

    @cached_property
    def stable(self) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        """Whether free vibrations die out."""
        return is_stable(self.whole, 2 * (self.h * self.tau).sum(axis=0))

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
        maps = step(h, s, moment - begins[index], g)
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
            z, v = step(h, s, inside, g).move(self.z, self.v)
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
