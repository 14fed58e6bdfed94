"""The beam between the involute of a tooth and its root circle: generated fillet, or straight."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from gearmon.gears.panels import FloatArray, gauss, panel_nodes
from gearmon.gears.rack import Rack

#: Tangent angle of the critical section of a fillet, ISO 6336-3 [rad].
CRITICAL_TANGENT = math.radians(30)
#: Maps parameters from 0 at the root circle to 1 at the involute to height and half thickness.
Curve = Callable[[FloatArray], tuple[FloatArray, FloatArray]]


@dataclass(frozen=True, kw_only=True, eq=False)
class RootPart:
    """A curve from the root circle (parameter 0) to the involute (parameter 1).

    Parameters
    ----------
    curve : callable
        Maps parameters to height and half thickness [m].
    is_straight : bool
        Whether the half thickness is the same everywhere.
    crack_parameter : float
        Parameter at which root cracks begin.
    """

    curve: Curve
    is_straight: bool = False
    crack_parameter: float = 0.0

    def at(self, parameter: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return height and half thickness [m]."""
        return self.curve(parameter)

    def points(self, edges: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return height, half thickness and slope of the height at the panel nodes of `edges`."""
        height, half = self.at(panel_nodes(edges))
        slope = 2 * (height @ _differentiation(height.shape[1]).T) / np.diff(edges)[:, None]
        return height, half, slope

    def edges(self, levels: FloatArray) -> FloatArray:
        """Return panel edges, with corners where the half thickness crosses `levels` [m]."""
        if not len(levels):
            return np.array([0.0, 1.0])
        edges = np.unique(np.concatenate([[0.0, 1.0], self._crossings(levels)]))
        return np.asarray(edges[np.concatenate([[True], np.diff(edges) > 1e-12])])

    @cached_property
    def crack_start(self) -> tuple[float, float]:
        """Height and half thickness [m] where a root crack begins."""
        height, half = self.at(np.array([self.crack_parameter]))
        return float(height[0]), float(half[0])

    def _crossings(self, levels: FloatArray) -> FloatArray:
        if self.is_straight:
            return np.zeros(0)
        return crossings(lambda p: self.at(p)[1], 0.0, 1.0, levels)


def straight_root(base_radius: float, root_radius: float, half_angle: float) -> RootPart:
    """Return a part of constant thickness from the root circle up to the base circle."""
    half = base_radius * math.sin(half_angle)
    low, high = math.sqrt(root_radius**2 - half**2), base_radius * math.cos(half_angle)

    def curve(parameter: FloatArray) -> tuple[FloatArray, FloatArray]:
        height = low + (high - low) * parameter
        return height, np.full_like(height, half)

    return RootPart(curve=curve, is_straight=True)


def fillet_root(
    rack: Rack, teeth: int, profile_shift: float, form_roll: float, module_m: float
) -> RootPart:
    """Return the fillet that a rack generates, up to where the involute begins.

    Parameters
    ----------
    rack : Rack
    teeth : int
    profile_shift : float
    form_roll : float
        Roll length at which the involute begins, in modules.
    module_m : float
        Normal module [m].
    """
    base = 0.5 * teeth / math.cos(rack.helix_angle_rad)
    base *= math.cos(rack.transverse_pressure_angle_rad)
    upper = rack.pressure_angle_rad
    if rack.least_shift(teeth) > profile_shift:
        upper = _undercut_end(rack, teeth, profile_shift, math.hypot(base, form_roll))

    def curve(parameter: FloatArray) -> tuple[FloatArray, FloatArray]:
        angles = math.pi / 2 + (upper - math.pi / 2) * parameter
        height, half = rack.fillet(teeth, profile_shift, angles)
        return module_m * height, module_m * half

    return RootPart(curve=curve, crack_parameter=where_tangent(curve, CRITICAL_TANGENT))


def crossings(
    curve: Callable[[FloatArray], FloatArray],
    low: float,
    high: float,
    levels: FloatArray,
    samples: int = 65,
) -> FloatArray:
    """Return where a smooth curve crosses any of `levels` between `low` and `high`."""
    grid = np.linspace(low, high, samples)
    above = curve(grid)[None, :] > levels[:, None]
    row, column = np.nonzero(above[:, 1:] != above[:, :-1])
    left, right, level = grid[column], grid[column + 1], levels[row]
    rising = above[row, column + 1]
    # a corner found to a millionth of the range spoils an integral by the square of that
    for _ in range(15 if len(row) else 0):
        middle = 0.5 * (left + right)
        upper = (curve(middle) > level) == rising
        left, right = np.where(upper, left, middle), np.where(upper, middle, right)
    return np.asarray(0.5 * (left + right))


def where_tangent(curve: Curve, angle_rad: float) -> float:
    """Return the parameter of a fillet at which its tangent makes an angle with the tooth's middle.

    Parameters
    ----------
    curve : callable
        See `RootPart`.
    angle_rad : float
    """
    grid = np.linspace(0, 1, 129)
    height, half = curve(grid)
    tangent = np.arctan2(-np.gradient(half, grid), np.gradient(height, grid))
    # at the root circle the tangent lies across; towards the involute it stands up
    steep = np.flatnonzero(tangent <= angle_rad)
    if not len(steep) or steep[0] == 0:
        return 0.0
    i = int(steep[0])
    share = (tangent[i - 1] - angle_rad) / (tangent[i - 1] - tangent[i])
    return float(grid[i - 1] + share * (grid[i] - grid[i - 1]))


def _undercut_end(rack: Rack, teeth: int, profile_shift: float, form_radius: float) -> float:
    """Return the angle of the rack-tip normal at which an undercut fillet cuts the involute."""
    low, high = rack.pressure_angle_rad, math.pi / 2
    grid = np.linspace(high, low, 513)
    radius = np.hypot(*rack.fillet(teeth, profile_shift, grid))
    first = int(np.argmax(radius >= form_radius))
    if first == 0:
        return low
    share = (form_radius - radius[first - 1]) / (radius[first] - radius[first - 1])
    return float(grid[first - 1] + share * (grid[first] - grid[first - 1]))


@lru_cache(maxsize=8)
def _differentiation(points: int) -> FloatArray:
    """Return the matrix from values at Gauss points to slopes there."""
    nodes, _, analysis = gauss(points)
    slopes = np.stack(
        [
            np.polynomial.legendre.legval(nodes, np.polynomial.legendre.legder(row))
            for row in np.eye(points)
        ],
        axis=1,
    )
    return np.asarray(slopes @ analysis)
