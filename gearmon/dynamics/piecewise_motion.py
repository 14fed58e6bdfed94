"""Exact periodic motion on a piecewise constant stiffness, for one system or many at once.

Arrays here have the pieces on their first axis and the systems (any shape, also none) behind it:
h [1/s], s = k/m [1/s2], tau [s] and g = F/m [m/s2] of each piece, z [m] and v [m/s] at its start.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearmon.dynamics import piecewise_lines, step_maps
from gearmon.dynamics.fourier import Complex, Real


@dataclass(frozen=True, kw_only=True, eq=False)
class PiecewiseMotion:
    """Periodic motion of systems whose stiffness and force are constant within each piece.

    Attributes
    ----------
    h, s, tau, g : float ndarray, shape (P, ...)
        As in the module's text.
    start : float
        Time [s] at which the first piece begins.
    z, v : float ndarray, shape (P, ...)
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
        """Period [s], shape (...,)."""
        return np.asarray(self.tau.sum(axis=0))

    @cached_property
    def stable(self) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        """Whether free vibrations die out, shape (...,)."""
        return step_maps.is_stable(self.whole, 2 * (self.h * self.tau).sum(axis=0))

    def lines(self, highest: int) -> Complex:
        """Exact displacement harmonics 0..highest [m], shape (..., highest+1)."""
        shape = self.z.shape
        rows = (self.h, self.s, self.tau, self.g, self.z, self.v)
        if len(shape) == 1:
            one = piecewise_lines.Motion(
                *(x if x.shape == shape else np.broadcast_to(x, shape) for x in rows)
            )
            return piecewise_lines.of_one(one, self.start, highest)
        flat = (shape[0], math.prod(shape[1:]))
        many = piecewise_lines.Motion(*(_flattened(x, shape, flat) for x in rows))
        found = piecewise_lines.of_many(many, self.start, highest)
        return found.reshape(*shape[1:], highest + 1)

    def values(self, phase: Real) -> tuple[Real, Real, Real, Real]:
        """Displacement, velocity, acceleration and mesh force per mass at phases of the period.

        Parameters
        ----------
        phase : float ndarray, shape (M,)
            Time since the first piece began, over the period, in [0, 1).

        Returns
        -------
        four float ndarrays, shape (..., M)
            [m], [m/s], [m/s2], [m/s2]; at a jump the values after it.
        """
        shape = (*self.period.shape, len(phase))
        moment = np.broadcast_to(phase * self.period[..., None], shape)
        ends = np.cumsum(np.broadcast_to(self.tau, self.z.shape), axis=0)[:-1]
        begins = np.concatenate([np.zeros((1, *ends.shape[1:])), ends])
        index = (moment >= ends[..., None]).sum(axis=0) if ends.ndim > 1 else None
        if index is None:
            index = np.searchsorted(ends, moment, side="right")

        def pick(x: Real) -> Real:
            whole = np.broadcast_to(x, self.z.shape)[..., None]
            return np.asarray(np.take_along_axis(whole, index[None], axis=0)[0])

        h, s, g = pick(self.h), pick(self.s), pick(self.g)
        maps = step_maps.step(h, s, moment - pick(begins), g)
        z, v = maps.move(pick(self.z), pick(self.v))
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


def _flattened(x: Real, shape: tuple[int, ...], flat: tuple[int, int]) -> Real:
    """Return x with one axis of systems; what all systems share stays unrepeated in memory."""
    whole = np.broadcast_to(x, shape)
    if not any(whole.strides[1:]):
        return np.broadcast_to(np.moveaxis(whole, 0, -1)[(0,) * (len(shape) - 1)][:, None], flat)
    return whole.reshape(flat)
