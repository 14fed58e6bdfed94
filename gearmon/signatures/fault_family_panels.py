"""Motion of one mass on a varying spring on panels of a mesh period, by Gauss collocation.

In mesh phase s = t/T the equation ``m z'' + c (z - e)' + k (z - e) = F`` reads, with
gamma = c T/m, kappa = k T^2/m and phi = F T^2/m,

    z' = u + gamma e,    u' = -gamma u - kappa z + phi + (kappa - gamma^2) e

in which e may jump. Between the corners of k and e the motion is smooth, and a polynomial through
16 Gauss points of each panel follows it to nearly all digits (Hairer, Norsett and Wanner, Solving
Ordinary Differential Equations I, section II.7).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from gearmon.gears.pulses import gauss, panel_nodes

FloatArray = npt.NDArray[np.float64]

#: Collocation points of a panel, and the largest turn [rad] of the fastest part over half of it:
#: together they integrate that part to about 1e-12.
POINTS, LARGEST_HALF_TURN = 16, 9.0


@lru_cache(maxsize=1)
def _integrals() -> FloatArray:
    """Return the matrix from values at the points to integrals from the start of [0, 1] to them."""
    x, _, analysis = gauss(POINTS)
    legendre = np.polynomial.legendre.legvander(x, POINTS)
    primitive = np.empty((POINTS, POINTS))
    primitive[:, 0] = x + 1
    for n in range(1, POINTS):
        # the integral of P_n from -1 is (P_{n+1} - P_{n-1})/(2n + 1)
        primitive[:, n] = (legendre[:, n + 1] - legendre[:, n - 1]) / (2 * n + 1)
    return np.asarray(0.5 * primitive @ analysis)


@dataclass(frozen=True, kw_only=True, eq=False)
class PhaseGrid:
    """Panels of a mesh period, or of a whole turn, and the collocation points on them.

    Parameters
    ----------
    edges : ndarray of float, shape (panels + 1,)
        From 0 to the period, increasing.
    """

    edges: FloatArray

    @classmethod
    def between(cls, corners: FloatArray, fastest: float, period: int = 1) -> PhaseGrid:
        """Return panels between corners, fine enough for `fastest` cycles a mesh period."""
        folded = np.unique(np.concatenate([np.mod(corners, period), [0.0, period]]))
        folded = folded[np.concatenate([[True], np.diff(folded) > 1e-11])]
        folded[-1] = period
        longest = LARGEST_HALF_TURN / (math.pi * max(fastest, 1.0))
        parts = [
            np.linspace(low, high, max(1, math.ceil((high - low) / longest)) + 1)[:-1]
            for low, high in pairwise(folded.tolist())
        ]
        return cls(edges=np.concatenate([*parts, [float(period)]]))

    def halved(self) -> PhaseGrid:
        """Return every panel cut in two."""
        middles = 0.5 * (self.edges[1:] + self.edges[:-1])
        return PhaseGrid(edges=np.sort(np.concatenate([self.edges, middles])))

    @cached_property
    def widths(self) -> FloatArray:
        """Lengths of the panels."""
        return np.diff(self.edges)

    @cached_property
    def phase(self) -> FloatArray:
        """Collocation points, shape (panels, points)."""
        return panel_nodes(self.edges, POINTS)

    @cached_property
    def weights(self) -> FloatArray:
        """Weights of integrals over the mesh period, shape (panels, points)."""
        return np.asarray(self.widths[:, None] * (0.5 * gauss(POINTS)[1]))


@dataclass(frozen=True, kw_only=True, eq=False)
class PanelMaps:
    """Motion on each panel as an affine function of the state (z, u) at its start.

    Parameters
    ----------
    z, u : ndarray of float, shape (..., panels, points, 3)
        At the collocation points, per unit of z and of u at the start, and by the forcing.
    step : ndarray of float, shape (..., panels, 2, 3)
        The state at the end.
    """

    z: FloatArray
    u: FloatArray
    step: FloatArray

    def states(self, start: FloatArray) -> FloatArray:
        """Return the states at the starts of all panels and at the end, shape (..., n + 1, 2)."""
        prefix, count = self._prefix, self.step.shape[-3]
        blocks = [start]
        for block in range(prefix.shape[-4] - 1):
            blocks.append(applied(prefix[..., block, -1, :, :], blocks[-1]))
        first = np.stack(np.broadcast_arrays(*blocks), axis=-2)
        ends = applied(prefix, first[..., None, :])
        ends = ends.reshape(*ends.shape[:-3], -1, 2)[..., :count, :]
        begin = np.broadcast_to(start, (*ends.shape[:-2], 2))
        return np.concatenate([begin[..., None, :], ends], axis=-2)

    def at(self, states: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return z and u at the collocation points, shape (..., panels, points)."""
        start = states[..., :-1, :]
        return applied(self.z, start), applied(self.u, start)

    def of_period(self, number: int) -> PanelMaps:
        """Return the maps of one of several mesh periods, the axis before that of the panels."""
        return PanelMaps(
            z=self.z[..., number, :, :, :],
            u=self.u[..., number, :, :, :],
            step=self.step[..., number, :, :, :],
        )

    @cached_property
    def whole(self) -> FloatArray:
        """Affine map of the state over all panels, shape (..., 2, 3)."""
        total = self._prefix[..., 0, -1, :, :]
        for block in range(1, self._prefix.shape[-4]):
            total = chained(self._prefix[..., block, -1, :, :], total)
        return np.asarray(total)

    @cached_property
    def _prefix(self) -> FloatArray:
        """Maps from the start of a block of panels to the ends of its panels.

        Shape (..., blocks, panels of a block, 2, 3). All blocks advance together, so that the
        panels of a turn take twice their square root of steps.
        """
        count = self.step.shape[-3]
        size = math.isqrt(count - 1) + 1
        blocks = -(-count // size)
        padded = np.zeros((*self.step.shape[:-3], blocks * size, 2, 3))
        padded[..., 0, 0] = padded[..., 1, 1] = 1.0
        padded[..., :count, :, :] = self.step
        steps = padded.reshape(*self.step.shape[:-3], blocks, size, 2, 3)
        found = [steps[..., 0, :, :]]
        for panel in range(1, size):
            found.append(chained(steps[..., panel, :, :], found[-1]))
        return np.stack(found, axis=-3)


def applied(maps: FloatArray, state: FloatArray) -> FloatArray:
    """Return what an affine map makes of a state."""
    return np.asarray((maps[..., :2] @ state[..., :, None])[..., 0] + maps[..., 2])


def chained(later: FloatArray, earlier: FloatArray) -> FloatArray:
    """Return the affine map that does one after the other."""
    total = later[..., :2] @ earlier
    total[..., 2] += later[..., 2]
    return np.asarray(total)


def panel_maps(
    grid: PhaseGrid, gamma: float, kappa: FloatArray, push: FloatArray, shift: FloatArray | None
) -> PanelMaps:
    """Return the motion on each panel.

    Parameters
    ----------
    grid : PhaseGrid
    gamma : float
        c T/m.
    kappa : ndarray, shape (..., panels, points)
        k T^2/m.
    push : ndarray, same shape
        What is added to u'.
    shift : ndarray, same shape, optional
        What is added to z'.
    """
    integrals, weights = _integrals(), 0.5 * gauss(POINTS)[1]
    points = integrals.sum(axis=1)
    h = grid.widths[:, None]
    eye = np.eye(POINTS)
    matrix = kappa[..., None] * (h[..., None] ** 2 * (integrals @ integrals))
    matrix += eye + gamma * h[..., None] * integrals
    moved = np.zeros(push.shape) if shift is None else h * (shift @ integrals.T)
    sides = np.stack([-kappa, -gamma - kappa * h * points, push - kappa * moved], axis=-1)
    slope = np.linalg.solve(matrix, sides)
    u = h[..., None] * (integrals @ slope)
    u[..., 1] += 1.0
    z = h[..., None] * (integrals @ u)
    z[..., 0] += 1.0
    z[..., 2] += moved
    step = np.empty((*kappa.shape[:-1], 2, 3))
    step[..., 0, :] = grid.widths[:, None] * np.einsum("i,...ij->...j", weights, u)
    step[..., 1, :] = grid.widths[:, None] * np.einsum("i,...ij->...j", weights, slope)
    if shift is not None:
        step[..., 0, 2] += grid.widths * (shift @ weights)
    step[..., 0, 0] += 1.0
    step[..., 1, 1] += 1.0
    return PanelMaps(z=z, u=u, step=step)
