"""Relations of involute gears: angles, base circle, overlap, zones of contact."""

from __future__ import annotations

import math

from gearmon.errors import ArgumentError


def involute(angle_rad: float) -> float:
    """Return the involute function tan(angle) - angle."""
    return math.tan(angle_rad) - angle_rad


def inverse_involute(value: float) -> float:
    """Return the angle [rad] in [0, pi/2) whose involute function is `value` >= 0.

    Examples
    --------
    >>> round(inverse_involute(involute(0.4)), 12)
    0.4
    """
    if not value >= 0:
        raise ArgumentError(f"value={value} of the involute function must be >= 0")
    # small angles: inv x = x^3/3; large ones: tan x = value + x; Newton falls on a convex function
    angle: float = min((3 * value) ** (1 / 3), math.atan(value + math.pi / 2))
    for _ in range(60):
        if angle == 0:
            break
        step = (involute(angle) - value) / math.tan(angle) ** 2
        angle -= step
        if abs(step) <= 1e-16 * angle:
            break
    return angle


def transverse_pressure_angle(pressure_angle_rad: float, helix_angle_rad: float) -> float:
    """Return alpha_t = atan(tan alpha_n/cos beta) [rad]."""
    return math.atan(math.tan(pressure_angle_rad) / math.cos(helix_angle_rad))


def base_helix_angle(helix_angle_rad: float, pressure_angle_rad: float) -> float:
    """Return beta_b = asin(sin beta cos alpha_n) [rad]."""
    return math.asin(math.sin(helix_angle_rad) * math.cos(pressure_angle_rad))


def base_radius(
    teeth: int, module_m: float, pressure_angle_rad: float, helix_angle_rad: float = 0.0
) -> float:
    """Return the base radius z m_t cos(alpha_t)/2 [m].

    Examples
    --------
    >>> round(2e3 * base_radius(26, 0.002, math.radians(20)), 5)
    48.86402
    """
    alpha_t = transverse_pressure_angle(pressure_angle_rad, helix_angle_rad)
    return 0.5 * teeth * module_m / math.cos(helix_angle_rad) * math.cos(alpha_t)


def overlap_ratio(helix_angle_rad: float, face_width_m: float | None, module_m: float) -> float:
    """Return eps_beta = b sin|beta|/(pi m_n).

    Raises
    ------
    ArgumentError
        If the gears are helical and the face width is not known.
    """
    if helix_angle_rad == 0:
        return 0.0
    if face_width_m is None:
        raise ArgumentError("face_width_m is missing: the overlap ratio of helical gears needs it")
    return face_width_m * math.sin(abs(helix_angle_rad)) / (math.pi * module_m)


def contact_zones(contact_ratio: float) -> list[tuple[float, float, int]]:
    """Zones that one pair passes from entry to exit.

    Parameters
    ----------
    contact_ratio : float, > 0

    Returns
    -------
    list of (start, end, pairs)
        Start and end [mesh periods] and the number of pairs that carry there.

    Examples
    --------
    >>> contact_zones(1.5)
    [(0.0, 0.5, 2), (0.5, 1.0, 1), (1.0, 1.5, 2)]
    """
    few = math.floor(contact_ratio)
    part = contact_ratio - few
    if part < 1e-12:
        return [(float(i), float(i + 1), few) for i in range(few)]
    zones = []
    for i in range(few):
        zones += [(float(i), i + part, few + 1), (i + part, float(i + 1), few)]
    return [*zones, (float(few), contact_ratio, few + 1)]
