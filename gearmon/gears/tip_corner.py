"""How far the tip corner of a tooth is from the mate's flank just outside the path of contact."""

from __future__ import annotations

import math

import numpy as np

from gearmon.gears.panels import FloatArray
from gearmon.gears.tooth_pairs import ToothPair


def tip_corner_gap(pair: ToothPair, beyond_m: FloatArray, *, leaving: bool) -> FloatArray:
    """Return the gap of a pair just outside its path of contact [m].

    Parameters
    ----------
    pair : ToothPair
        External, or a planet in its ring.
    beyond_m : ndarray, >= 0
        How far the rolling has gone beyond the end of the path, along the line of action [m].
    leaving : bool
        Whether the tip of the first gear is leaving; else that of the second is entering.

    Notes
    -----
    The tip corner of one gear is seen from the centre of the other; the angle from there to the
    flank at the same radius, times the base radius, is the distance along the line of action.
    """
    beyond = np.asarray(beyond_m, dtype=np.float64)
    rolls = pair.rolls(pair.path_m[1] + beyond if leaving else pair.path_m[0] - beyond)
    own, mate = (0, 1) if leaving else (1, 0)
    radius = pair.teeth[own].tip_radius_m
    x, y = _from_first_centre(pair, own, radius, _flank(pair, own, radius, rolls[own]))
    distance, corner = _seen_from(pair, mate, x, y)
    ahead = _flank(pair, mate, distance, rolls[mate]) - corner
    # the first gear pushes: its flank stays behind that of the second
    return np.asarray(pair.teeth[mate].base_radius_m * (ahead if leaving else -ahead))


def _working(pair: ToothPair) -> tuple[float, float]:
    """Return signed centre distance, negative for a ring, and working pressure angle."""
    base = pair.first.base_radius_m + pair.second.sign * pair.second.base_radius_m
    centres = math.copysign(math.hypot(pair.line_m, base), base)
    return centres, math.acos(base / centres)


def _flank(pair: ToothPair, index: int, radius: FloatArray | float, roll: FloatArray) -> FloatArray:
    """Return the angle of a flank at a radius, from the line of centres in the sense of motion."""
    tooth = pair.teeth[index]
    tangent = np.sqrt(np.maximum((radius / tooth.base_radius_m) ** 2 - 1, 0.0))
    rolled = roll / tooth.base_radius_m - _working(pair)[1]
    # an external second gear is rolled off while the first one is rolled on
    sign = -1 if index == 1 and not tooth.internal else 1
    return np.asarray(sign * (rolled - (tangent - np.arctan(tangent))))


def _from_first_centre(
    pair: ToothPair, index: int, radius: float, angle: FloatArray
) -> tuple[FloatArray, FloatArray]:
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    if index == 0:
        return x, y
    centres, sign = _working(pair)[0], pair.second.sign
    return centres - sign * x, y


def _seen_from(
    pair: ToothPair, index: int, x: FloatArray, y: FloatArray
) -> tuple[FloatArray, FloatArray]:
    own = x if index == 0 else pair.second.sign * (_working(pair)[0] - x)
    return np.hypot(own, y), np.arctan2(y, own)
