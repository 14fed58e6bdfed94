"""The root of a ring's tooth: an arc that touches the involute and the root circle.

The tool that shapes a ring is a pinion whose data nobody gives; its fillet lies close to an arc
(ISO 6336-3 describes it by a radius too), and what matters most, where the involute ends and how
deep the root lies, is kept.
"""

from __future__ import annotations

import math

import numpy as np

from gearmon.gears.panels import FloatArray
from gearmon.gears.tooth_fillet import RootPart, where_tangent

#: Tangent angle of the critical section of a ring's fillet, ISO 6336-3 [rad].
CRITICAL_TANGENT = math.radians(60)


def ring_root(end_m: tuple[float, float], slope_rad: float, root_radius_m: float) -> RootPart:
    """Return the fillet of a ring's tooth.

    Parameters
    ----------
    end_m : (float, float)
        Half thickness and height [m] of the tooth where its involute ends; heights of a ring are
        negative.
    slope_rad : float
        Angle of the flank against the middle of the tooth there.
    root_radius_m : float

    Notes
    -----
    With the end P of the involute and the normal n into the space, the arc about P + rho n touches
    the root circle if ``rho = (R_f^2 - |P|^2)/(2 (R_f + P n))``.
    """
    half, height = end_m
    normal = math.cos(slope_rad), math.sin(slope_rad)
    radius = arc_radius(math.hypot(*end_m), root_radius_m, -half * normal[0] - height * normal[1])
    centre = half + radius * normal[0], height + radius * normal[1]
    # the beam begins where the arc is deepest; beyond that it rises with the root circle
    low, high = math.pi, math.atan2(-normal[0], -normal[1]) % (2 * math.pi)

    def curve(parameter: FloatArray) -> tuple[FloatArray, FloatArray]:
        angle = low + (high - low) * parameter
        return centre[1] + radius * np.cos(angle), centre[0] + radius * np.sin(angle)

    return RootPart(curve=curve, crack_parameter=where_tangent(curve, CRITICAL_TANGENT))


def arc_radius(end_radius_m: float, root_radius_m: float, roll_m: float) -> float:
    """Return the radius [m] of the arc that touches the involute at a circle, and the root circle.

    Parameters
    ----------
    end_radius_m : float
        Radius at which the involute ends.
    root_radius_m : float
    roll_m : float
        Roll length there: the distance of the normal's foot, as it is tangent to the base circle.
    """
    return (root_radius_m**2 - end_radius_m**2) / (2 * (root_radius_m - roll_m))


def roomy_roll(
    base_m: float, root_m: float, half_angle: float, half_pitch: float, roll_m: float
) -> float:
    """Return the roll length from which the arc has room up to the middle of the tooth space.

    Parameters
    ----------
    base_m, root_m : float
        Base and root radius [m].
    half_angle : float
        Half the angle of the spaces on the base circle [rad].
    half_pitch : float
        Half the angle of a pitch [rad].
    roll_m : float
        Roll length that is wanted; the arc ends there if it has room.
    """

    def is_beyond(roll: float) -> bool:
        slope = roll / base_m - half_angle
        radius = arc_radius(math.hypot(base_m, roll), root_m, roll)
        # end of the involute: base tangent point plus roll along the tangent
        half = base_m * math.sin(slope) - roll * math.cos(slope)
        along = base_m * math.cos(slope) + roll * math.sin(slope)
        half, along = half + radius * math.cos(slope), along - radius * math.sin(slope)
        return math.atan2(half, along) > half_pitch

    low, high = roll_m, math.sqrt(root_m**2 - base_m**2)
    if not is_beyond(low):
        return low
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_beyond(middle) else (low, middle)
    return 0.5 * (low + high)
