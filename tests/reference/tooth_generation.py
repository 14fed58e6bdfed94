"""Slow, obvious gear geometry: points in the plane, and a rack that cuts step by step."""

from __future__ import annotations

import math

import numpy as np


def path_of_contact(base_radii, tip_radii, distance):
    """Ends of the path of contact of an external pair, from points on the line of action.

    Gear 1 sits at the origin, gear 2 at (distance, 0); both touch one inner tangent.
    """
    angle = math.acos(sum(base_radii) / distance)
    foot = np.array([base_radii[0] * math.cos(angle), base_radii[0] * math.sin(angle)])
    along = np.array([math.sin(angle), -math.cos(angle)])
    own = _beyond(foot, along, np.zeros(2), tip_radii[0], +1)
    mate = _beyond(foot, along, np.array([distance, 0.0]), tip_radii[1], -1)
    return mate, own


def ring_path_of_contact(base_radii, tip_radii, distance):
    """The same for a planet inside a ring; the ring sits at the origin.

    Both base circles touch the line of action on the same side.
    """
    centre = np.array([distance, 0.0])
    angle = math.acos((base_radii[1] - base_radii[0]) / distance)
    normal = np.array([math.cos(angle), math.sin(angle)])
    foot, ring_foot = centre + base_radii[0] * normal, base_radii[1] * normal
    along = (foot - ring_foot) / np.linalg.norm(foot - ring_foot)
    own = _beyond(foot, along, centre, tip_radii[0], +1)
    mate = _beyond(foot, along, np.zeros(2), tip_radii[1], +1)
    return mate, own


def _beyond(foot, along, centre, radius, side):
    """Distance along the line from `foot` to the circle; the later crossing for side +1."""
    offset = foot - centre
    b, c = float(offset @ along), float(offset @ offset) - radius**2
    return -b + side * math.sqrt(b * b - c)


def half_angle_after_cutting(radius, teeth, shift, rack, steps=20001):
    """Half the angle of the tooth at `radius` (modules) that a rolling rack leaves standing.

    The rack is stepped past the gear; at each step the point at an angle from the middle of the
    tooth is asked whether it lies inside the rack.
    """
    rolls = np.linspace(-1.2, 1.2, steps)
    low, high = 0.0, math.pi / teeth
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (
            (low, middle)
            if _is_cut(radius, middle, teeth, shift, rack, rolls)
            else (
                middle,
                high,
            )
        )
    return low


def _is_cut(radius, angle, teeth, shift, rack, rolls):
    pitch = teeth / 2
    across = radius * np.sin(angle - rolls) + pitch * rolls
    depth = pitch + shift - radius * np.cos(angle - rolls)
    alpha, rounding = rack.pressure_angle_rad, rack.rounding
    flank = math.pi / 4 + depth * math.tan(alpha)
    centre = rack.root_factor - rounding
    middle = math.pi / 4 + rack.straight_depth * math.tan(alpha) + rounding * math.cos(alpha)
    under = np.clip(rounding**2 - (depth - centre) ** 2, 0, None)
    edge = np.where(depth <= rack.straight_depth, flank, middle - np.sqrt(under))
    inside = (depth < rack.root_factor) & (across > edge) & (across < math.pi - edge)
    return bool(inside.any())
