"""Involute geometry of a pair of cylindrical gears: circles, path of contact, contact ratios.

Formulas and signs follow ISO 21771: an internal gear has a negative number of teeth and negative
diameters in them, and a positive profile shift makes its teeth thicker too, which moves its tips
inwards. Results are positive radii. The basic rack, in normal modules, generates the fillet; its
tip is rounded so that the flank stays straight down to the standard clearance of 0.25 modules, or
fully where less room is left. Pairs that cannot run (undercut, interference, pointed tips, a
contact ratio below 1) are refused.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import chain
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import bisect, brentq

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.errors import ArgumentError, check_positive, check_range

#: Bottom clearance of ISO 53 racks; the rounding takes it up.
CLEARANCE = 0.25


Two = tuple[float, float]
__all__ = ["GearTeeth", "PairGeometry", "pair_geometry"]
#: Rim of a ring where none is given [modules]; thinner ones are called thin: from 3.5 on ISO 6336-3
#: sees no weakening (rim factor 1).
USUAL_RIM = 3.5
#: Profile shifts are given with three decimals; less than this is rounding, not jamming.
SHIFT_ROUNDING = 0.01
#: Most that the tip of a ring is taken to be relieved without being told, in modules.
LARGEST_RING_TRIM = 0.3
#: Tip thickness below which tips are called sharp, in modules.
SHARP_TIP = 0.2
#: Profile shift that undercut teeth may lack, in modules, if their mate stays clear of it: the
#: practical limit of 14 teeth where 18 are needed in theory.
TOLERATED_UNDERCUT = 0.2


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
    # tan x = value + x, and x < pi/2
    highest = math.atan(value + math.pi / 2)
    return float(brentq(lambda x: involute(x) - value, 0.0, highest, xtol=1e-300, maxiter=2000))


def contact_zones(contact_ratio: float) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return the zones that one pair passes from entry to exit.

    Parameters
    ----------
    contact_ratio : float, > 0

    Returns
    -------
    edges : ndarray, shape (zones + 1,)
        [mesh periods]
    pairs : ndarray of int, shape (zones,)
        Number of pairs that carry there.

    Examples
    --------
    >>> edges, pairs = contact_zones(1.5)
    >>> edges.tolist(), pairs.tolist()
    ([0.0, 0.5, 1.0, 1.5], [2, 1, 2])
    """
    few = math.floor(contact_ratio)
    part, entries = contact_ratio - few, np.arange(few + 1)
    if part < 1e-12:
        return entries.astype(np.float64), np.full(few, few)
    edges = np.stack([entries, np.append(entries[:-1] + part, contact_ratio)], axis=1).ravel()
    return edges, few + 1 - np.arange(2 * few + 1) % 2


@dataclass(frozen=True, kw_only=True)
class GearTeeth:
    """One gear: its teeth, in modules, and what is known of its body.

    Parameters
    ----------
    teeth : int, >= 5
        Number of teeth, positive for internal gears too.
    profile_shift : float
        Profile shift coefficient x.
    tip_factor : float
        Addendum of the gear h_a*, before any tip shortening.
    root_factor : float
        Dedendum of the basic rack h_fP*, in modules.
    name : str
        What messages call the gear; the ending of its keys in a machine file.
    internal : bool
        Whether it is a ring.
    elastic_modulus_pa : float
        Young's modulus [Pa].
    bore_m : float
        Bore diameter [m], 0 for a solid disc.
    tip_shortening : float or None
        k, in modules, where it is given. Else what keeps the tip clearance of unshifted gears,
        ``k = (a_w - a)/m_n - (x1 + x2)`` where that is negative, and 0 for internal pairs.
    web_m, rim_m : float or None
        Width of the web and thickness of the rim [m]; both None for a solid disc.
    """

    teeth: int
    profile_shift: float = 0.0
    tip_factor: float = 1.0
    root_factor: float = 1.25
    name: str = "gear"
    internal: bool = False
    elastic_modulus_pa: float = 206e9
    bore_m: float = 0.0
    tip_shortening: float | None = None
    web_m: float | None = None
    rim_m: float | None = None

    def __post_init__(self) -> None:
        if self.teeth != int(self.teeth) or self.teeth < 5:
            raise ArgumentError(f"{self.name}_teeth={self.teeth} must be a whole number >= 5")
        check_range(f"profile_shift_{self.name}", self.profile_shift, -2, 3)
        check_range(f"tip_factor_{self.name}", self.tip_factor, 0.1, 3)
        check_range(f"root_factor_{self.name}", self.root_factor, 0.2, 4)


@dataclass(frozen=True, kw_only=True)
class RackTooth(GearTeeth):
    """A gear with its teeth as a basic rack generates them.

    Parameters
    ----------
    teeth : float
        Of the gear; those of `normal_section` are not whole.
    pressure_angle_rad : float
        Normal pressure angle [rad].
    helix_angle_rad : float
        Helix angle at the reference circle [rad].
    internal : bool
        Whether it is the tooth of a ring, whose tool is no rack.
    module_m : float
        Normal module [m].

    Examples
    --------
    >>> tooth = RackTooth(teeth=26, pressure_angle_rad=math.radians(20))
    >>> round(tooth.rounding, 5)
    0.37995
    """

    pressure_angle_rad: float
    helix_angle_rad: float = 0.0
    module_m: float = 1.0

    def __post_init__(self) -> None:
        """Take a gear that has been checked."""

    @property
    def sign(self) -> int:
        """Return -1 for a ring, else 1."""
        return -1 if self.internal else 1

    @property
    def rounding(self) -> float:
        """Radius of the rounded rack tip rho_fP*."""
        alpha = self.pressure_angle_rad
        wanted = CLEARANCE / (1 - math.sin(alpha))
        # full rounding: the centre of the arc sits on the middle line of the rack tooth
        full = (math.pi / 4 - self.root_factor * math.tan(alpha)) * math.cos(alpha)
        full /= 1 - math.sin(alpha)
        rounding = min(wanted, full)
        if rounding <= 0:
            most = math.pi / 4 / math.tan(alpha)
            raise ArgumentError(
                f"root_factor={self.root_factor} makes the rack pointed at a pressure angle of "
                f"{math.degrees(alpha):g} deg; it must be < {most:.4g}"
            )
        return rounding

    @property
    def straight_depth(self) -> float:
        """Depth below the datum line down to which the flank is straight."""
        return self.root_factor - self.rounding * (1 - math.sin(self.pressure_angle_rad))

    @property
    def transverse_pressure_angle_rad(self) -> float:
        """alpha_t = atan(tan alpha_n/cos beta)."""
        return math.atan(math.tan(self.pressure_angle_rad) / math.cos(self.helix_angle_rad))

    @cached_property
    def reference_radius_m(self) -> float:
        """Radius of the reference circle [m]."""
        return 0.5 * self.module_m * self.teeth / math.cos(self.helix_angle_rad)

    @cached_property
    def base_radius_m(self) -> float:
        """Radius of the base circle [m]."""
        return self.reference_radius_m * math.cos(self.transverse_pressure_angle_rad)

    @cached_property
    def root_radius_m(self) -> float:
        """Radius of the root circle [m]."""
        depth = self.module_m * (self.root_factor - self.profile_shift)
        return self.reference_radius_m - self.sign * depth

    @cached_property
    def tip_radius_m(self) -> float:
        """Radius of the tip circle [m], as far as the tips are known to be cut back."""
        height = self.tip_factor + self.profile_shift + (self.tip_shortening or 0.0)
        return self.reference_radius_m + self.sign * self.module_m * height

    @property
    def least_shift(self) -> float:
        """Profile shift below which so many teeth are undercut."""
        sine, radius = math.sin(self.transverse_pressure_angle_rad), self.reference_radius_m
        return self.straight_depth - radius / self.module_m * sine**2

    @property
    def least_teeth(self) -> int:
        """Number of teeth from which on there is no undercut with this profile shift."""
        sine = math.sin(self.transverse_pressure_angle_rad)
        depth = max(self.straight_depth - self.profile_shift, 0.0)
        return math.ceil(2 * depth * math.cos(self.helix_angle_rad) / sine**2 - 1e-9)

    @property
    def form_roll(self) -> float:
        """Roll length [m] at which the involute meets the fillet; above an undercut.

        The involute of a ring ends there; its tool is not a rack, so the circle that the straight
        part of the rack would reach is taken.
        """
        alpha, radius = self.transverse_pressure_angle_rad, self.reference_radius_m
        depth = self.module_m * (self.straight_depth - self.profile_shift)
        roll = radius * math.sin(alpha) - depth / math.sin(alpha)
        if roll >= 0 and not self.internal:
            return roll
        end = radius + depth if self.internal else abs(complex(self.fillet(self.undercut_end)))
        return self.roll_at(end)

    def roll_at(self, radius_m: float) -> float:
        """Return the roll length [m] of the involute on a circle; 0 inside the base circle."""
        return math.sqrt(max(radius_m**2 - self.base_radius_m**2, 0.0))

    def involute_at(self, radius_m: float) -> float:
        """Return the involute function of the pressure angle on a circle."""
        tangent = self.roll_at(radius_m) / self.base_radius_m
        return tangent - math.atan(tangent)

    def fillet(self, angles_rad: ArrayLike) -> ComplexArray:
        """Return points of the generated fillet of an external gear, in the transverse section.

        Parameters
        ----------
        angles_rad : array_like
            Angles of the rack-tip normal in the normal section, from alpha_n (where the involute
            begins) to pi/2 (root circle).

        Returns
        -------
        complex ndarray
            Distance from the middle line of the tooth + i distance from the gear's centre along it
            [m].

        Notes
        -----
        The point of the rack tip whose normal has angle g touches the gear when that normal passes
        through the pitch point: with depth a and distance b from the middle line of the tooth,
        ``phi = (a/tan g + b)/R`` has been rolled.
        """
        g, cosine = np.asarray(angles_rad, dtype=np.float64), math.cos(self.helix_angle_rad)
        alpha, rounding = self.pressure_angle_rad, self.rounding
        depth = self.root_factor - rounding - self.profile_shift + rounding * np.sin(g)
        depth, radius = self.module_m * depth, self.reference_radius_m
        middle = math.pi / 4 + self.straight_depth * math.tan(alpha) + rounding * math.cos(alpha)
        across = self.module_m * (middle - rounding * np.cos(g)) / cosine
        # the transverse section is wider by 1/cos(beta), so its normals are flatter or steeper
        slope = np.arctan2(np.sin(g), np.cos(g) * cosine)
        rolled = (depth / np.tan(slope) + across) / radius
        turned = 1j * radius - depth / np.sin(slope) * np.exp(1j * slope)
        return np.asarray(turned * np.exp(-1j * rolled), dtype=np.complex128)

    @cached_property
    def base_half_angle(self) -> float:
        """Half the angle that a tooth takes on the base circle [rad]; of a ring that of a space."""
        alpha, shift = self.transverse_pressure_angle_rad, 2 * self.profile_shift
        thickness = math.pi / 2 + shift * math.tan(self.pressure_angle_rad)
        return self.sign * thickness / self.teeth + involute(alpha)

    def thickness_m(self, radius_m: float) -> float:
        """Return the transverse tooth thickness on a circle outside the base circle [m].

        Parameters
        ----------
        radius_m : float
            At least the base radius.

        Raises
        ------
        ArgumentError
            If the circle lies inside the base circle, where there is no involute.
        """
        base = self.base_radius_m
        if radius_m < base * (1 - 1e-12):
            told = f"radius_m={radius_m} of the {self.name}"
            raise ArgumentError(f"{told} must be >= base radius {base}")
        angle = self.base_half_angle - self.involute_at(radius_m)
        return 2 * radius_m * self.sign * angle

    @property
    def undercut_end(self) -> float:
        """Angle [rad] of the rack-tip normal at which the fillet cuts the involute, or alpha_n."""

        def beyond(angle: float) -> float:
            point = complex(self.fillet(angle))
            radius, flank = abs(point), math.pi
            # inside the base circle there is no involute to be cut
            if radius > self.base_radius_m:
                flank = self.base_half_angle - self.involute_at(radius)
            return math.atan2(point.real, point.imag) - flank

        first = self.pressure_angle_rad
        return float(bisect(beyond, first, math.pi / 2, xtol=1e-15)) if beyond(first) > 0 else first


@dataclass(frozen=True, kw_only=True)
class PairGeometry:
    """Geometry of a pair; index 0 is the first gear given, index 1 its mate.

    Lengths are in metres, angles in radians, radii positive. Made by `pair_geometry`, which finds
    the working pressure angle and by how much the tips are cut back.

    Parameters
    ----------
    gears : tuple of two RackTooth
        The second may be a ring.
    working_pressure_angle_rad : float
        alpha_wt at the working circle.
    face_width_m : float or None
    warnings : tuple of str
    """

    gears: tuple[RackTooth, RackTooth]
    working_pressure_angle_rad: float
    face_width_m: float | None = None
    warnings: tuple[str, ...] = ()

    @property
    def helix_angle_rad(self) -> float:
        """Magnitude of the helix angle at the reference circle [rad]."""
        return self.gears[0].helix_angle_rad

    @property
    def transverse_module_m(self) -> float:
        """Transverse module m_t [m]."""
        return self.gears[0].module_m / math.cos(self.helix_angle_rad)

    @cached_property
    def base_radii_m(self) -> Two:
        """Radii of the base circles [m]."""
        one, two = self.gears
        return one.base_radius_m, two.base_radius_m

    @cached_property
    def centre_distance_m(self) -> float:
        """Working centre distance a_w [m], positive."""
        one, two = self.base_radii_m
        return abs(one + self.gears[1].sign * two) / math.cos(self.working_pressure_angle_rad)

    @cached_property
    def tip_radii_m(self) -> Two:
        """Radii of the tip circles [m]."""
        one, two = self.gears
        return one.tip_radius_m, two.tip_radius_m

    @property
    def line_m(self) -> float:
        """Distance between the base tangent points along the line of action [m]."""
        return self.centre_distance_m * math.sin(self.working_pressure_angle_rad)

    @property
    def base_pitch_m(self) -> float:
        """Transverse base pitch p_bt [m]."""
        return 2 * math.pi * self.base_radii_m[0] / self.gears[0].teeth

    @cached_property
    def path_m(self) -> Two:
        """Roll lengths [m] at which contact begins, at the tip of the mate, and ends, at the own.

        Distances from the base tangent point of the first gear along the line of action; it drives.
        """
        one, two = (own.roll_at(own.tip_radius_m) for own in self.gears)
        return self.gears[1].sign * (self.line_m - two), one

    @property
    def path_length_m(self) -> float:
        """Length of the path of contact g_alpha [m]."""
        return self.path_m[1] - self.path_m[0]

    @property
    def transverse_contact_ratio(self) -> float:
        """Transverse contact ratio eps_alpha."""
        return self.path_length_m / self.base_pitch_m

    @property
    def overlap_ratio(self) -> float:
        """Overlap ratio eps_beta = b sin(beta)/(pi m_n); 0 for spur gears.

        Raises
        ------
        ArgumentError
            If the gears are helical and the face width is not known.
        """
        if self.helix_angle_rad and self.face_width_m is None:
            raise ArgumentError(
                "face_width_m is missing: the overlap ratio of helical gears needs it"
            )
        width = (self.face_width_m or 0.0) * math.sin(self.helix_angle_rad)
        return width / (math.pi * self.gears[0].module_m)

    @property
    def total_contact_ratio(self) -> float:
        """Total contact ratio eps_gamma = eps_alpha + eps_beta."""
        return self.transverse_contact_ratio + self.overlap_ratio

    @property
    def base_helix_angle_rad(self) -> float:
        """Helix angle on the base circle [rad]: asin(sin beta cos alpha_n)."""
        sine = math.sin(self.helix_angle_rad) * math.cos(self.gears[0].pressure_angle_rad)
        return math.asin(sine)

    @property
    def pitch_point_phase(self) -> float:
        """Mesh periods from the entry of a pair into contact to its contact at the pitch point."""
        pitch = self.base_radii_m[0] * math.tan(self.working_pressure_angle_rad)
        return (pitch - self.path_m[0]) / self.base_pitch_m


def pair_geometry(
    first: GearTeeth,
    second: GearTeeth,
    *,
    module_m: float,
    pressure_angle_rad: float = math.radians(20),
    helix_angle_rad: float = 0.0,
    face_width_m: float | None = None,
    centre_distance_m: float | None = None,
    check: bool = True,
) -> PairGeometry:
    """Return the geometry of a pair of cylindrical involute gears.

    Parameters
    ----------
    first, second : GearTeeth
        The first is taken to drive; the second may be a ring.
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
    check_range("pressure_angle_rad", pressure_angle_rad, 0.1, 0.8, "rad")
    beta = check_range("helix_angle_rad", abs(helix_angle_rad), 0.0, 0.8, "rad")
    if second.internal and second.teeth <= first.teeth:
        raise ArgumentError(
            f"{second.name}_teeth={second.teeth} of an internal gear must be > "
            f"{first.name}_teeth={first.teeth}"
        )
    rack: dict[str, Any] = {"pressure_angle_rad": pressure_angle_rad, "helix_angle_rad": beta}
    rack["module_m"] = module_m
    one, two = (RackTooth(**told_of(own, GearTeeth), **rack) for own in (first, second))
    working = _working(one, two, centre_distance_m)
    pair = PairGeometry(gears=(one, two), working_pressure_angle_rad=working)
    room = (pair.centre_distance_m - one.reference_radius_m - two.reference_radius_m) / module_m
    # a centre distance above the tight one, or a ring, needs no cutting back
    usual = 0.0 if two.internal else min(0.0, room - one.profile_shift - two.profile_shift)
    one, two = (
        own if own.tip_shortening is not None else replace(own, tip_shortening=usual)
        for own in pair.gears
    )
    pair = replace(pair, gears=(one, two), face_width_m=face_width_m)
    return check_pair(trim_ring(pair)) if check else pair


def told_of(gear: GearTeeth, kind: type[GearTeeth]) -> dict[str, Any]:
    """Return what a gear tells as one of a kind, to make it one of another kind."""
    return {own.name: getattr(gear, own.name) for own in fields(kind)}


def _shift_for(first: RackTooth, second: RackTooth, working_rad: float) -> float:
    """Return the sum of profile shifts without backlash at a working pressure angle."""
    inv = involute(working_rad) - involute(first.transverse_pressure_angle_rad)
    total = first.teeth + second.sign * second.teeth
    return inv * total / (2 * math.tan(first.pressure_angle_rad))


def _working(first: RackTooth, second: RackTooth, centre_distance_m: float | None) -> float:
    """Return the working pressure angle."""
    if centre_distance_m is not None:
        distance = check_positive("centre_distance_m", centre_distance_m, "m")
        base = abs(first.base_radius_m + second.sign * second.base_radius_m)
        if distance < base * (1 - 1e-12):
            raise ArgumentError(
                f"centre_distance_m={distance} m is less than the sum of the base radii, "
                f"{base:.6g} m: the flanks cannot touch; give at least that"
            )
        return math.acos(min(1.0, base / distance))
    shifts, least = first.profile_shift + second.profile_shift, _shift_for(first, second, 0.0)
    part = 1 - shifts / least
    if part < 0:
        raise ArgumentError(
            f"profile_shift_{first.name} + profile_shift_{second.name} = {shifts:g} leaves no "
            f"working pressure angle; the sum must be at "
            f"{'most' if second.internal else 'least'} {least:.4g}"
        )
    return inverse_involute(part * involute(first.transverse_pressure_angle_rad))


def normal_section(pair: PairGeometry) -> PairGeometry:
    """Return the spur gears whose teeth are those of a helical pair, cut square to its flanks.

    Notes
    -----
    Teeth ``z_n = z/(cos^2 beta_b cos beta)``, as in ISO 6336-1, of the normal module, with the
    heights that the helical teeth have; ``sin alpha_wn = sin alpha_wt cos beta_b``. Their numbers
    are not whole. Roll lengths are radii of curvature, which are 1/cos(beta_b) of the transverse
    ones.
    """
    cosine = math.cos(pair.base_helix_angle_rad)
    share = cosine**2 * math.cos(pair.helix_angle_rad)
    one, two = (
        replace(own, teeth=cast(int, own.teeth / share), helix_angle_rad=0.0) for own in pair.gears
    )
    working = math.asin(math.sin(pair.working_pressure_angle_rad) * cosine)
    return replace(pair, gears=(one, two), working_pressure_angle_rad=working)


def check_pair(pair: PairGeometry) -> PairGeometry:
    """Return the pair with its warnings, or refuse it.

    Raises
    ------
    ArgumentError
        If the pair cannot run, with the number that offends and what would cure it.
    """
    warnings = [*pair.warnings, *_check_backlash(pair), *chain(*map(_check_tip, pair.gears))]
    # a helical pair whose face width is not known cannot be judged by its total
    if not (pair.helix_angle_rad > 0 and pair.face_width_m is None):
        ratio, (first, second) = pair.total_contact_ratio, pair.gears
        if ratio < 1 or pair.transverse_contact_ratio <= 0:
            raise ArgumentError(
                f"{'total ' if pair.helix_angle_rad else ''}contact ratio {ratio:.4f} is below 1: "
                f"no pair would carry for a while; reduce the centre distance "
                f"({1e3 * pair.centre_distance_m:.5g} mm) or the profile shifts, or raise "
                f"tip_factor_{first.name} or tip_factor_{second.name}"
            )
    for gear, mate in (pair.gears, pair.gears[::-1]):
        gap = pair.gears[1].sign * pair.centre_distance_m
        gap -= gear.sign * gear.tip_radius_m + mate.sign * mate.root_radius_m
        if gap <= 0:
            raise ArgumentError(
                f"the tips of the {gear.name} run {-1e3 * gap:.4g} mm into the roots of the "
                f"{mate.name}; reduce tip_factor_{gear.name} or raise root_factor_{mate.name} or "
                f"the centre distance"
            )
    warnings += _check_root(pair, 0)
    warnings += _check_ring(pair) if pair.gears[1].internal else _check_root(pair, 1)
    return replace(pair, warnings=tuple(warnings))


def trim_ring(pair: PairGeometry) -> PairGeometry:
    """Return an internal pair whose ring tips clear the involute of the mate, with a warning.

    Ring tips of full height reach below the involute of many planets; they are relieved in
    practice, and the path of contact then begins where the involute does.

    Raises
    ------
    ArgumentError
        If more than 0.3 modules would have to go.
    """
    if not pair.gears[1].internal:
        return pair
    planet, ring = pair.gears
    least = math.hypot(ring.base_radius_m, planet.form_roll + pair.line_m)
    trim = (least - ring.tip_radius_m) / ring.module_m
    if trim <= 1e-9:
        return pair
    # a diameter goes before the factor; both are rounded to the safe side
    cure = (
        f"tip_factor_{ring.name} <= {math.floor(1e3 * (ring.tip_factor - trim)) / 1e3:.3f} (or, "
        f"where it is given, tip_diameter_{ring.name}_mm >= {math.ceil(2e6 * least) / 1e3:.3f})"
    )
    if trim > LARGEST_RING_TRIM:
        raise ArgumentError(
            f"tip_factor_{ring.name}={ring.tip_factor:g}, tip circle {2e3 * ring.tip_radius_m:.5g} "
            f"mm: the tips of the {ring.name} reach {trim:.3g} modules below the involute of the "
            f"{planet.name} (interference); give {cure}"
        )
    note = (
        f"the tips of the {ring.name} are taken as relieved by {trim:.3f} modules, for they would "
        f"touch the fillet of the {planet.name}; {cure} would say so"
    )
    relieved = replace(ring, tip_shortening=(ring.tip_shortening or 0.0) - trim)
    return replace(pair, gears=(planet, relieved), warnings=(*pair.warnings, note))


def _check_backlash(pair: PairGeometry) -> Iterator[str]:
    first, second = pair.gears
    tight = _shift_for(first, second, pair.working_pressure_angle_rad)
    given = first.profile_shift + second.profile_shift
    distance = 1e3 * pair.centre_distance_m
    if given > tight + SHIFT_ROUNDING:
        raise ArgumentError(
            f"centre_distance_mm={distance:.5g} jams the teeth: profile_shift_{first.name} + "
            f"profile_shift_{second.name} = {given:g}, but this distance takes {tight:.4f} at most"
        )
    if given < tight - 0.2:
        yield (
            f"profile shifts sum to {given:g} where the centre distance {distance:.5g} mm has room "
            f"for {tight:.3f}: the pair has much backlash"
        )


def _check_tip(gear: RackTooth) -> Iterator[str]:
    if gear.tip_radius_m < gear.base_radius_m:
        raise ArgumentError(
            f"tip_factor_{gear.name}={gear.tip_factor:g} puts the tips of the {gear.name} at "
            f"{1e3 * gear.tip_radius_m:.5g} mm, inside its base circle of "
            f"{1e3 * gear.base_radius_m:.5g} mm, where there is no involute; "
            f"{'reduce' if gear.internal else 'raise'} tip_factor_{gear.name}"
        )
    thickness = gear.thickness_m(gear.tip_radius_m) * math.cos(gear.helix_angle_rad)
    modules = thickness / gear.module_m
    if modules <= 0:
        raise ArgumentError(
            f"the teeth of the {gear.name} are pointed: tip thickness {modules:.3f} modules with "
            f"profile_shift_{gear.name}={gear.profile_shift:g} and tip_factor_{gear.name}="
            f"{gear.tip_factor:g}; reduce either"
        )
    if modules < SHARP_TIP:
        yield f"the teeth of the {gear.name} are sharp: tip thickness {modules:.3f} modules"


def _check_root(pair: PairGeometry, index: int) -> Iterator[str]:
    """Contact must stay on the involute of an external gear."""
    gear, mate = pair.gears[index], pair.gears[1 - index]
    start = pair.path_m[0] if index == 0 else pair.line_m - pair.path_m[1]
    short = (gear.form_roll - start) / gear.module_m
    least, shift = gear.least_shift, gear.profile_shift
    undercut, touched = shift < least - 1e-9, short > 1e-6
    given = f"profile_shift_{gear.name}={shift:g}"
    cure = f"give at least {least:.4f}, or {gear.least_teeth} teeth"
    where = f"the tips of the {mate.name} reach {short:.3g} modules below the involute of the"
    if touched and undercut:
        raise ArgumentError(
            f"{where} {gear.name}, whose {gear.teeth} teeth are undercut at {given}; {cure}"
        )
    if touched:
        raise ArgumentError(
            f"{where} {gear.name} (interference); reduce tip_factor_{mate.name}="
            f"{mate.tip_factor:g} or raise root_factor_{gear.name}={gear.root_factor:g}"
        )
    if shift < least - TOLERATED_UNDERCUT:
        raise ArgumentError(
            f"the {gear.teeth} teeth of the {gear.name} are undercut at {given}, beyond the "
            f"practical limit of {least - TOLERATED_UNDERCUT:.4f}; {cure}"
        )
    if undercut:
        yield (
            f"the {gear.teeth} teeth of the {gear.name} are undercut below the path of contact: "
            f"{given} where {least:.4f} would avoid it"
        )


def _check_ring(pair: PairGeometry) -> Iterator[str]:
    planet, ring = pair.gears
    end = math.hypot(ring.base_radius_m, pair.path_m[1] + pair.line_m)
    if end > ring.root_radius_m:
        raise ArgumentError(
            f"the tips of the {planet.name} touch the {ring.name} beyond its root circle "
            f"({1e3 * end:.5g} > {1e3 * ring.root_radius_m:.5g} mm); reduce "
            f"tip_factor_{planet.name} or raise root_factor_{ring.name}"
        )
    room = _tip_passage(pair)
    if room < 0:
        raise ArgumentError(
            f"tips of {planet.name} and {ring.name} collide outside the mesh by "
            f"{-math.degrees(room):.3g} deg: ring_teeth - planet_teeth = "
            f"{ring.teeth - planet.teeth} is too small; "
            f"take more teeth in the ring or reduce the tip factors"
        )
    room = _radial_passage(pair)
    if room < 0:
        yield (
            f"the {planet.name} cannot be put into the {ring.name} radially, only along its axis: "
            f"tips would collide by {-math.degrees(room):.3g} deg"
        )


def _tip_passage(pair: PairGeometry) -> float:
    """Angle [rad] by which the tips of the inner gear miss those of the ring where they cross."""
    (inner, outer), a = pair.tip_radii_m, pair.centre_distance_m
    reach = (outer**2 - inner**2 - a**2) / (2 * a * inner)
    if reach >= 1:
        return math.inf
    at_inner = math.acos(reach)
    at_outer = math.acos((a**2 + outer**2 - inner**2) / (2 * a * outer))
    ahead, behind = _tip_angles(pair)
    return (at_inner + ahead) * pair.gears[0].teeth / pair.gears[1].teeth - behind - at_outer


def _tip_angles(pair: PairGeometry) -> Two:
    """Return the angles from the pitch points of the flanks to their tips, about the centres."""
    working = involute(pair.working_pressure_angle_rad)
    ahead, behind = (own.involute_at(own.tip_radius_m) - working for own in pair.gears)
    return ahead, behind


def _radial_passage(pair: PairGeometry) -> float:
    """Angle [rad] by which the tips of the inner gear pass those of the ring moving radially.

    Where a tip of the one passes a tip of the other at the same distance from the line of
    centres, at the angle at which that is tightest.
    """
    (ahead, behind), radii = _tip_angles(pair), pair.tip_radii_m[1] / pair.tip_radii_m[0]
    ratio = pair.gears[1].teeth / pair.gears[0].teeth
    # y of both tips is equal, and so is its rate as the gears roll: sin^2 of both angles follows
    if radii >= ratio:
        return math.inf
    square = (ratio**2 - radii**2) / (ratio**2 - 1)
    at_inner = math.asin(math.sqrt(min(1.0, square)))
    at_outer = math.asin(min(1.0, math.sin(at_inner) / radii))
    return at_inner + ahead - ratio * (at_outer + behind)
