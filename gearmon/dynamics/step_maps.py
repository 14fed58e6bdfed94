"""Exact motion of one mass on a spring of constant stiffness, step by step.

    z'' + 2 h z' + s z = g,    state x = (z, z')

Within a step h, s and g are constant, so x(t) = x(0) + N(t) x(0) + g (P, Q) with

    Q(t) = response of the velocity-free mass to a unit impulse,   P(t) = integral of Q,
    N = [ -s P   Q ;  -s Q   -s P - 2 h Q ]  (the step matrix less the identity).

Everything follows from P and Q, which are positive sums of well-conditioned terms in every case
(swinging, critical, creeping; s of either sign). N rather than I + N is kept, because I - (I+N)
would cancel for periods that are short against the vibration.

All arrays have the pieces of a period on their first axis and any batch axes behind it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gearmon.dynamics.fourier import Real

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
    first, last = _unit_integral(-slow * tau), _unit_integral(-fast * tau)
    q = tau * np.exp(-slow * tau) * _unit_integral(-2 * g * tau)
    apart = g * tau > 0.25
    p = np.empty_like(q)
    p[apart] = (tau * (first - last))[apart] / (2 * g[apart])
    # the exponents nearly agree: then s tau^2 is not small, or the series takes over
    near = ~apart
    rest = np.exp(-fast * tau) + fast * q
    p[near] = np.divide(1 - rest, s, out=np.zeros_like(s), where=s != 0)[near]
    return p, q


def _unit_integral(x: Real) -> Real:
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


def unit_matrices(h: Real, s: Real, tau: Real) -> tuple[Real, Real]:
    """Step matrices with determinant one and size about one: e^{h tau} (I + N) = e^log matrix.

    Returns
    -------
    matrices : float ndarray, shape (2, 2, ...)
    logs : float ndarray, shape (...,)
    """
    h, s, tau = (np.asarray(x, dtype=np.float64) for x in np.broadcast_arrays(h, s, tau))
    square = s - h**2
    root = np.sqrt(np.abs(square)) * tau
    swings = square >= 0
    twice = np.where(swings, 0.0, -2 * root)
    even = np.where(swings, np.cos(root), (1 + np.exp(twice)) / 2)
    odd = tau * np.where(swings, np.sinc(root / math.pi), _unit_integral(twice))
    logs = np.where(swings, 0.0, root)
    return np.array([[even + h * odd, odd], [-s * odd, even - h * odd]]), logs


def scaled_product(matrices: Real, logs: Real) -> tuple[Real, Real]:
    """Product of e^log * matrix in order along the first axis behind the 2 x 2, by halving.

    Parameters
    ----------
    matrices : float ndarray, shape (2, 2, n, ...)
    logs : float ndarray, shape (n, ...)

    Returns
    -------
    matrix : float ndarray, shape (2, 2, ...)
        Of size about one.
    log : float ndarray, shape (...,)
    """
    while matrices.shape[2] > 1:
        even = matrices.shape[2] // 2 * 2
        a, b = matrices[:, :, 0:even:2], matrices[:, :, 1:even:2]
        pairs = np.array(
            [
                [b[0, 0] * a[0, 0] + b[0, 1] * a[1, 0], b[0, 0] * a[0, 1] + b[0, 1] * a[1, 1]],
                [b[1, 0] * a[0, 0] + b[1, 1] * a[1, 0], b[1, 0] * a[0, 1] + b[1, 1] * a[1, 1]],
            ]
        )
        size = np.abs(pairs).max(axis=(0, 1))
        matrices = np.concatenate([pairs / size, matrices[:, :, even:]], axis=2)
        logs = np.concatenate([logs[1:even:2] + logs[0:even:2] + np.log(size), logs[even:]])
    return matrices[:, :, 0], logs[0]
