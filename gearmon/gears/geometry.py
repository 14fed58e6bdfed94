"""Involute geometry of a pair of cylindrical gears: circles, path of contact, contact ratios.

Formulas and signs follow ISO 21771: an internal gear has a negative number of teeth and negative
diameters in them, and a positive profile shift makes its teeth thicker too, which moves its tips
inwards. Results are positive radii.
"""

from __future__ import annotations

import math
from typing import Any

from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.gears.geometry_checks import check_pair, trim_ring
from gearmon.gears.involute import inverse_involute, involute, transverse_pressure_angle
from gearmon.gears.involute_pair import GearTeeth, PairGeometry, Two
from gearmon.gears.rack import Rack

__all__ = ["GearTeeth", "PairGeometry", "pair_geometry"]


def pair_geometry(
    first: GearTeeth,
    second: GearTeeth,
    *,
    module_m: float,
    pressure_angle_rad: float = math.radians(20),
    helix_angle_rad: float = 0.0,
    face_width_m: float | None = None,
    centre_distance_m: float | None = None,
    internal: bool = False,
    tip_shortening: float | Two | None = None,
    check: bool = True,
) -> PairGeometry:
    """Return the geometry of a pair of cylindrical involute gears.

    Parameters
    ----------
    first, second : GearTeeth
        The first is taken to drive; `second` is the ring of an internal pair.
    module_m : float
        Normal module [m].
    pressure_angle_rad : float
        Normal pressure angle of the basic rack [rad].
    helix_angle_rad : float
        Helix angle at the reference circle [rad]; its sign does not matter.
    face_width_m : float, optional
        Common face width [m]; only the overlap ratio needs it.
    centre_distance_m : float, optional
        Working centre distance [m]; by default the one without backlash.
    internal : bool
        Whether `second` has internal teeth.
    tip_shortening : float or (float, float), optional
        k, in modules, of both gears or of each. By default what keeps the tip clearance of
        unshifted gears, ``k = (a_w - a)/m_n - (x1 + x2)`` where that is negative, and 0 for
        internal pairs.
    check : bool
        Whether pairs that cannot run are refused: negative backlash, undercut that reaches the
        path of contact, interference, pointed tips, a contact ratio below 1.

    Returns
    -------
    PairGeometry

    Raises
    ------
    ArgumentError
        If the pair cannot run, with the number that offends and what would cure it.

    Notes
    -----
    ``inv alpha_wt = inv alpha_t + 2 (x1 + x2) tan alpha_n/(z1 + z2)``,
    ``a_w = m_t (z1 + z2) cos alpha_t/(2 cos alpha_wt)``, ``d_a = d + 2 m_n (h_a* + x + k)``,
    ``g_alpha = sqrt(r_a1^2 - r_b1^2) +- (sqrt(r_a2^2 - r_b2^2) - a_w sin alpha_wt)``, with the
    lower sign for internal pairs (ISO 21771).

    Examples
    --------
    >>> pair = pair_geometry(GearTeeth(teeth=62), GearTeeth(teeth=62), module_m=0.002)
    >>> round(pair.transverse_contact_ratio, 7)
    1.7897799
    """
    check_positive("module_m", module_m, "m")
    frame = _frame(first, second, module_m, pressure_angle_rad, abs(helix_angle_rad), internal)
    working, distance = _working(frame, first, second, centre_distance_m)
    excess = (distance - frame["reference_distance"]) / module_m
    excess -= first.profile_shift + second.profile_shift
    shortening = _shortening(tip_shortening, excess, internal)
    circles = _circles(frame, (first, second), shortening, working)
    pair = PairGeometry(
        gears=(first, second),
        internal=internal,
        normal_module_m=module_m,
        transverse_module_m=frame["transverse_module"],
        normal_pressure_angle_rad=pressure_angle_rad,
        transverse_pressure_angle_rad=frame["alpha_t"],
        working_pressure_angle_rad=working,
        helix_angle_rad=abs(helix_angle_rad),
        face_width_m=face_width_m,
        centre_distance_m=abs(distance),
        tip_shortening=shortening,
        **circles,
    )
    if not check:
        return pair
    return check_pair(trim_ring(pair))


def _frame(
    first: GearTeeth,
    second: GearTeeth,
    module_m: float,
    alpha_n: float,
    beta: float,
    internal: bool,
) -> dict[str, float]:
    """Return what follows from rack, helix and teeth alone; signed for internal pairs."""
    check_range("pressure_angle_rad", alpha_n, 0.1, 0.8, "rad")
    check_range("helix_angle_rad", beta, 0.0, 0.8, "rad")
    if internal and second.teeth <= first.teeth:
        raise ArgumentError(
            f"{second.name}_teeth={second.teeth} of an internal gear must be > "
            f"{first.name}_teeth={first.teeth}"
        )
    total = first.teeth + (-second.teeth if internal else second.teeth)
    transverse = module_m / math.cos(beta)
    return {
        "total": total,
        "module": module_m,
        "transverse_module": transverse,
        "alpha_n": alpha_n,
        "alpha_t": transverse_pressure_angle(alpha_n, beta),
        "beta": beta,
        "sign": -1.0 if internal else 1.0,
        "reference_distance": 0.5 * transverse * total,
    }


def _working(
    frame: dict[str, float], first: GearTeeth, second: GearTeeth, centre_distance_m: float | None
) -> Two:
    """Return working pressure angle and signed centre distance."""
    base = frame["reference_distance"] * math.cos(frame["alpha_t"])
    if centre_distance_m is not None:
        distance = check_positive("centre_distance_m", centre_distance_m, "m")
        if distance < abs(base) * (1 - 1e-12):
            raise ArgumentError(
                f"centre_distance_m={distance} m is less than the sum of the base radii, "
                f"{abs(base):.6g} m: the flanks cannot touch; give at least that"
            )
        return math.acos(min(1.0, abs(base) / distance)), math.copysign(distance, base)
    shifts = first.profile_shift + second.profile_shift
    inv = involute(frame["alpha_t"]) + 2 * shifts * math.tan(frame["alpha_n"]) / frame["total"]
    if inv < 0:
        least = -involute(frame["alpha_t"]) * frame["total"] / (2 * math.tan(frame["alpha_n"]))
        bound = "least" if frame["sign"] > 0 else "most"
        raise ArgumentError(
            f"profile_shift_{first.name} + profile_shift_{second.name} = {shifts:g} leaves no "
            f"working pressure angle; the sum must be at {bound} {least:.4g}"
        )
    angle = inverse_involute(inv)
    return angle, base / math.cos(angle)


def _shortening(given: float | Two | None, excess: float, internal: bool) -> Two:
    if isinstance(given, tuple):
        return given
    if given is None:
        # a centre distance above the tight one, or a ring, needs no cutting back
        given = 0.0 if internal else min(0.0, excess)
    return given, given


def _circles(
    frame: dict[str, float],
    gears: tuple[GearTeeth, GearTeeth],
    shortening: Two,
    working: float,
) -> dict[str, Any]:
    signs = (1.0, frame["sign"])
    module, cosine = frame["module"], math.cos(frame["alpha_t"])
    reference = [0.5 * frame["transverse_module"] * gear.teeth for gear in gears]
    base = [radius * cosine for radius in reference]
    heights = [
        (gear.tip_factor + gear.profile_shift + k, gear.root_factor - gear.profile_shift)
        for gear, k in zip(gears, shortening, strict=True)
    ]
    tip = [r + s * module * h for r, s, (h, _) in zip(reference, signs, heights, strict=True)]
    root = [r - s * module * h for r, s, (_, h) in zip(reference, signs, heights, strict=True)]
    forms = [
        Rack(
            dedendum=gear.root_factor,
            pressure_angle_rad=frame["alpha_n"],
            helix_angle_rad=frame["beta"],
        ).form_roll(gear.teeth, gear.profile_shift, internal=sign < 0)
        * module
        for gear, sign in zip(gears, signs, strict=True)
    ]
    length = (signs[1] * base[1] + base[0]) * math.tan(working)
    rolls = [math.sqrt(max(t * t - b * b, 0.0)) for t, b in zip(tip, base, strict=True)]
    return {
        "reference_radii_m": tuple(reference),
        "base_radii_m": tuple(base),
        "working_radii_m": tuple(radius / math.cos(working) for radius in base),
        "tip_radii_m": tuple(tip),
        "root_radii_m": tuple(root),
        "form_rolls_m": tuple(forms),
        "path_m": (length - signs[1] * rolls[1], rolls[0]),
    }
