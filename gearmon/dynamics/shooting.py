"""Periodic motions by shooting: many pairs at once, or one over a long period.

Between S equal steps of the period the mean spring answers exactly. With D_n the dynamic stiffness
and theta = 2 pi n/S, the product T/D_n, T = e^{i theta} - (m+ + m-) + m+ m- e^{-i theta} with
m+- = e^{h s+-} the multipliers of a step, is smooth: its poles cancel. Replaced by the three terms
B = b+ e^{i theta} + b + b- e^{-i theta} that agree with it at the mean and at the natural
frequency,

    u = u0 - (1/D) phi u    becomes    (T + B phi) u = T u0,

a recursion from sample to sample that is marched once round for the period map and closed to a
periodic motion. It errs by a thousandth or so; what it leaves, u - u0 + (1/D) phi u, is known
exactly from two Fourier transforms and answered by the same march, until the error bound meets the
tolerance. So resonance, however sharp, costs no more rounds.

Arrays have samples or lines on the first axis and sets on the last.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy

from gearmon.dynamics.compliance import PairCompliance
from gearmon.dynamics.error_bound import Pattern
from gearmon.dynamics.fourier import UNIT_ROUNDOFF, Complex, Real, samples
from gearmon.dynamics.hill import stiffness_at

#: Samples a period of the natural frequency at least: with them one round meets 1e-6, with 7 it
#: takes two.
FINENESS = 8.5
MOST_ROUNDS = 8
#: Share of the sets for which another round of all of them is not worth while.
FEW = 0.1
#: A free motion is followed until its exponent leaves e^-40 of it; where by then it has not fallen
#: to the second number, because phi feeds it, through the whole period.
LASTING, DIED_OUT = 40.0, 1e-16
#: A round that leaves more than this share of the bound before is the last.
STALLED = 0.5


class Shot(NamedTuple):
    """Steady vibrations under a unit of static deflection.

    Attributes
    ----------
    lines : complex ndarray, shape (N+1, B)
    relative : float ndarray, shape (B,)
        Guaranteed relative L2 error of the acceleration of the lines handed out.
    """

    lines: Complex
    relative: Real


@lru_cache(maxsize=256)
def odd_length(least: int) -> int:
    """Return the smallest odd 3^a 5^b 7^c 11^d >= `least`: every line but the mean has a twin."""
    length = least | 1
    while scipy.fft.next_fast_len(length) != length:
        length += 2
    return length


class Shooting:
    """Pairs side by side.

    Parameters
    ----------
    pairs : PairCompliance
        R = w0/w and damping ratio > 0 of every set, shape (B,), and their forces.
    scale, gain : float ndarray, shape (B,)
        Factor of phi, and bound of the inverse operators, see `error_bound`.
    pattern : Pattern
        phi, J harmonics.
    highest : int
        Lines that matter.
    """

    def __init__(
        self, pairs: PairCompliance, scale: Real, gain: Real, pattern: Pattern, highest: int
    ) -> None:
        count, ratio, zeta, forces = len(pattern.harmonics), pairs.ratio, pairs.zeta, pairs.forces
        least = max(2 * (highest + count) + 1, math.ceil(FINENESS * float(ratio.max())))
        self.length = odd_length(least)
        self.band, self.gain, self.zeta = count, gain, zeta
        self.swing = scale * pattern.highest
        x = np.arange(self.length // 2 + 1, dtype=float)[:, None] * (1 / ratio)
        self.squares, stiffness = x * x, stiffness_at(x, zeta)
        self.weights = _squares(stiffness)
        self.compliance = stiffness.conj()
        self.compliance /= self.weights
        #: answers to the forces alone, of the lines that they drive
        self.forced = self.compliance[: len(forces)] * forces[:, None]
        values, step = samples(pattern.half, self.length), 2 * math.pi * ratio / self.length
        self.phi = values[:, None] * scale
        self.stencil = _stencil(step, zeta)
        self._prepare(values, scale)
        start = np.zeros((2, 2, len(step)))
        start[0, 1] = start[1, 0] = 1.0
        # what the slower exponent leaves of them, if phi does not feed them
        slow = np.minimum(zeta, 0.5 / zeta)
        lasting = math.ceil(min(LASTING / float((slow * step).min()), self.length))
        #: motions from unit starts, as long as they last, shape (2, up to S+1, B)
        self.free = self._march(start, lasting)
        if lasting < self.length and not np.abs(self.free[:, -2:]).max() < DIED_OUT:
            self.free = self._march(start, self.length)

    def _prepare(self, values: Real, scale: Real) -> None:
        """Coefficients of u_{i+1} = c_1 u_i + c_0 u_{i-1} + ..."""
        twice, product, after, middle, before = self.stencil
        around = np.concatenate([values[-1:], values, values[:1]])[:, None]
        share = around[2:] * (after * scale)
        share += 1
        self.share = np.divide(1, share, out=share)
        self.recursion = np.empty((self.length, 2, len(twice)))
        last, now = self.recursion[:, 0], self.recursion[:, 1]
        np.multiply(around[:-2], -before * scale, out=last)
        last -= product
        last *= self.share
        np.multiply(around[1:-1], -middle * scale, out=now)
        now += twice
        now *= self.share
        if len(twice) == 1:
            # of the march as a triangular matrix, transposed: products of its rows take LAPACK
            # two thirds of the time of sums of its columns
            self._bands = np.zeros((self.length + 1, 3))
            self._bands[1:, 1:2], self._bands[2:, :1] = -now, -last[1:]

    def _march(self, start: Real, steps: int, driven: Real | None = None) -> Real:
        """March from the samples at -1 and 0: samples 0..steps, shape (..., steps+1, B)."""
        if start.shape[-1] == 1:
            return self._march_one(start, steps, driven)
        found = np.empty((*start.shape[:-2], steps + 2, start.shape[-1]))
        found[..., :2, :], moved = start, np.empty_like(start)
        for i, coefficients in enumerate(self.recursion[:steps]):
            new = found[..., i + 2, :]
            np.multiply(coefficients, found[..., i : i + 2, :], out=moved)
            np.add(moved[..., 0, :], moved[..., 1, :], out=new)
            if driven is not None:
                new += driven[i]
        return found[..., 1:, :]

    def _march_one(self, start: Real, steps: int, driven: Real | None) -> Real:
        """Do the same for one set, by LAPACK's band of a triangular matrix."""
        last, now = start[..., 0].reshape(-1, 2).T
        right = np.zeros((len(now), steps + 1))
        right[:, 0], right[:, 1] = now, self.recursion[0, 0, 0] * last
        if driven is not None:
            right[:, 1:] += driven[:, 0]
        bands = self._bands[: steps + 1].T
        solve = scipy.linalg.lapack.dtbtrs
        found = solve(bands, right.T, uplo="U", trans="T", diag="U", overwrite_b=1)[0].T
        return np.asarray(found).reshape(*start.shape[:-2], steps + 1, 1)

    def answer(self, still: Real) -> Real:
        """Return samples of the periodic u of u = u0 - (1/D) phi u; u0 are overwritten."""
        twice, product = self.stencil[:2]
        driven = still * -twice
        driven[:-1] += still[1:]
        driven[-1] += still[0]
        still *= product
        driven[1:] += still[:-1]
        driven[0] += still[-1]
        driven *= self.share
        moved = self._march(np.zeros((2, still.shape[1])), self.length, driven)
        # the motion begins so that it ends as it began
        (a, b), (c, d) = self.free[:, -1], self.free[:, -2]
        e, f = moved[-1], moved[-2]
        determinant = (1 - a) * (1 - d) - b * c
        now, last = ((1 - d) * e + b * f) / determinant, (c * e + (1 - a) * f) / determinant
        found, lasting = moved[:-1], self.free.shape[1] - 1
        spare = driven[:lasting]
        found[:lasting] += np.multiply(self.free[0, :-1], now, out=spare)
        found[:lasting] += np.multiply(self.free[1, :-1], last, out=spare)
        return found

    def solve(self, tolerance: float, shown: int | None = None) -> Shot:
        """Answer what is left until the bound meets the tolerance or no longer falls."""
        still = self._samples(self.forced) if len(self.forced) > 1 else self.forced.real
        motion = self.answer(np.broadcast_to(still, self.phi.shape).copy())
        motion += self.answer(still - motion - self._samples(self._coupled(motion)))
        bound = np.array(math.inf)
        for _ in range(MOST_ROUNDS):
            lines = self._lines(motion)
            left = self._coupled(motion)
            left += lines
            np.negative(left, out=left)
            left[: len(self.forced)] += self.forced
            before, bound = bound, self._bound(lines, left, shown)
            missed = bound > tolerance
            if missed.mean() <= FEW or not (bound <= STALLED * before)[missed].any():
                break
            motion += self.answer(self._samples(left))
        return Shot(lines, bound)

    def _coupled(self, motion: Real) -> Complex:
        """Lines of (1/D) phi u."""
        lines = self._lines(self.phi * motion)
        lines *= self.compliance
        return lines

    def _samples(self, lines: Complex) -> Real:
        return np.fft.irfft(lines, self.length, axis=0, norm="forward")

    def _lines(self, motion: Real) -> Complex:
        return np.asarray(np.fft.rfft(motion, axis=0, norm="forward"))

    def _bound(self, lines: Complex, left: Complex, shown: int | None) -> Real:
        """Relative errors of the acceleration.

        Of the residual r = D (u0 - u) - phi u those lines where |D_n| > max|phi| are answered
        explicitly, by e = r/D, and only the others and phi e go through the gain.
        """
        sizes, asked = _squares(lines), _squares(left)
        stiff = np.where(self.weights > self.swing**2, asked, 0.0)
        asked -= stiff
        fourth, inner = self.squares**2, _norm(asked * self.weights)
        spread, direct = _norm(stiff), _norm(stiff * fourth)
        # what the product by phi folds back, and what it would add above the last line
        edge = len(lines) - 1 - self.band
        outer = 2 * self.swing * _norm(sizes[edge + 1 :])
        quiet = np.sqrt(self.weights[edge])
        direct += outer * np.maximum(1.16, self.squares[edge] / quiet)
        spread += outer / quiet
        whole, depth = _norm(sizes), 8 + 2 * math.log2(self.length)
        size = moved = _norm(sizes * fourth)
        # of products by phi, and of the forces of spring, mass and damper
        rounding = (2 + depth * self.swing) * whole + 8 * moved
        rounding = UNIT_ROUNDOFF * (rounding + 8 * self.zeta * np.sqrt(moved * whole))
        if shown is not None:
            size = _norm((sizes * fourth)[: shown + 1])
        error = direct + self.gain * (inner + self.swing * spread + rounding)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(error < size, error / (size - error), np.inf)


def _norm(squares: Real) -> Real:
    """Rms over the period, or up to 41 % more for the mean, shape (B,)."""
    return np.asarray(np.sqrt(2 * np.add.reduce(squares)))


def _stencil(step: Real, zeta: Real) -> Real:
    """m+ + m-, m+ m-, and b+, b, b- of steps of some length, shape (5, B)."""
    # both exponents without a difference that cancels, however large the damping
    fast = zeta + np.sqrt(zeta**2 - 1 + 0j)
    less, more = np.expm1(-step / fast), np.expm1(-step * fast)
    twice, product = 2 + (less + more).real, np.exp(-2 * zeta * step)
    turn = np.exp(1j * step)
    resonant = (turn - twice + product / turn) / (2j * zeta)
    mean = (less * more).real
    both = (mean - resonant.real) / (1 - turn.real)
    apart = resonant.imag / turn.imag
    return np.array([twice, product, (both + apart) / 2, mean - both, (both - apart) / 2])


def _squares(numbers: Complex) -> Real:
    """Squares of moduli."""
    found = numbers.real**2
    found += numbers.imag**2
    return np.asarray(found)
