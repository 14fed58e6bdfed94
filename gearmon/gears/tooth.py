"""One tooth as a beam: compliance in bending, shear and compression, for many contacts at once.

The energy integrals run along the middle line of the tooth from its root to the contact. Their
integrands do not depend on where the contact is, apart from the lever arm, which enters through
three moments: so running integrals serve all contacts. Below the involute the beam is the fillet
that the rack generates, or straight; in a ring it is an arc that touches the involute and the root
circle: the tool that shapes a ring is a pinion whose data nobody gives, its fillet lies close to an
arc (ISO 6336-3 describes it by a radius too), and what matters most, where the involute ends and
how deep the root lies, is kept.

References
----------
Yang & Lin, J. Vib. Acoust. 109 (1987) 189; Tian (2004); Ma et al., Mech. Mach. Theory 73 (2014) 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np
from numpy.polynomial.legendre import legder, legval
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from gearmon.arrays import FloatArray
from gearmon.errors import ArgumentError
from gearmon.gears.geometry import PairGeometry, Rack
from gearmon.gears.pulses import Pulse, distinct, gauss, panel_nodes
from gearmon.gears.tooth_damage import SOUND, ToothDamage, crossings, sections

#: Tangent angle of the critical section of a fillet, ISO 6336-3 [rad].
CRITICAL_TANGENT = math.radians(30)
#: Maps parameters from 0 at the root circle to 1 at the involute to height and half thickness.
Curve = Callable[[FloatArray], tuple[FloatArray, FloatArray]]


#: Tangent angle of the critical section of a ring's fillet, ISO 6336-3 [rad].
RING_TANGENT = math.radians(60)
#: Which curve joins the involute and the root circle; see `Tooth`.
Root = Literal["fillet", "straight", "base"]
ROOTS: tuple[Root, ...] = ("fillet", "straight", "base")
#: Where the involute is split for its integrals: 1/h^3 is steep towards the tip.
SPLITS = (0.6, 0.87)
#: Shear factor of a rectangular section.
SHEAR_FACTOR = 1.2


@dataclass(frozen=True, kw_only=True, eq=False)
class RootPart:
    """A curve from the root circle (parameter 0) to the involute (parameter 1).

    Parameters
    ----------
    curve : callable
        Maps parameters to height and half thickness [m].
    crack_parameter : float
        Parameter at which root cracks begin.
    """

    at: Curve
    crack_parameter: float = 0.0

    def points(self, edges: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return height, half thickness and slope of the height at the panel nodes of `edges`."""
        height, half = self.at(panel_nodes(edges))
        slope = 2 * (height @ _differentiation(height.shape[1]).T) / np.diff(edges)[:, None]
        return height, half, slope

    def edges(self, levels: FloatArray) -> FloatArray:
        """Return panel edges, with corners where the half thickness crosses `levels` [m]."""
        found = crossings(lambda p: self.at(p)[1], 0.0, 1.0, levels)
        return distinct([0.0, 1.0, *found], 1e-12)

    @cached_property
    def crack_start(self) -> tuple[float, float]:
        """Height and half thickness [m] where a root crack begins."""
        height, half = self.at(np.array([self.crack_parameter]))
        return float(height[0]), float(half[0])


def straight_root(base_radius: float, root_radius: float, half_angle: float) -> RootPart:
    """Return a part of constant thickness from the root circle up to the base circle."""
    half = base_radius * math.sin(half_angle)
    low, high = math.sqrt(root_radius**2 - half**2), base_radius * math.cos(half_angle)

    def curve(parameter: FloatArray) -> tuple[FloatArray, FloatArray]:
        height = low + (high - low) * parameter
        return height, np.full_like(height, half)

    return RootPart(at=curve)


def fillet_root(rack: Rack, teeth: float, profile_shift: float, module_m: float) -> RootPart:
    """Return the fillet that a rack generates, up to where the involute begins.

    Parameters
    ----------
    rack : Rack
    teeth : int
    profile_shift : float
    module_m : float
        Normal module [m].
    """
    upper = rack.pressure_angle_rad
    if rack.least_shift(teeth) > profile_shift:
        upper = rack.undercut_end(teeth, profile_shift)

    def curve(parameter: FloatArray) -> tuple[FloatArray, FloatArray]:
        angles = math.pi / 2 + (upper - math.pi / 2) * parameter
        height, half = rack.fillet(teeth, profile_shift, angles)
        return module_m * height, module_m * half

    return RootPart(at=curve, crack_parameter=where_tangent(curve, CRITICAL_TANGENT))


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


@lru_cache(maxsize=8)
def _differentiation(points: int) -> FloatArray:
    """Return the matrix from values at Gauss points to slopes there."""
    nodes, _, analysis = gauss(points)
    return np.asarray(legval(nodes, legder(np.eye(points))).T @ analysis)


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

    return RootPart(at=curve, crack_parameter=where_tangent(curve, RING_TANGENT))


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

    def beyond(roll: float) -> float:
        slope = roll / base_m - half_angle
        radius = arc_radius(math.hypot(base_m, roll), root_m, roll)
        # end of the involute: base tangent point plus roll along the tangent
        half = base_m * math.sin(slope) - roll * math.cos(slope)
        along = base_m * math.cos(slope) + roll * math.sin(slope)
        half, along = half + radius * math.cos(slope), along - radius * math.sin(slope)
        return math.atan2(half, along) - half_pitch

    low, high = roll_m, math.sqrt(root_m**2 - base_m**2)
    return float(brentq(beyond, low, high, xtol=1e-15)) if beyond(low) > 0 else low


@dataclass(frozen=True, kw_only=True)
class Tooth:
    """One tooth and the body that it stands on.

    A tooth is described from its root upwards, whether it points away from the gear's centre or,
    in a ring, towards it: heights and profile angles t grow from root to tip. Heights of a ring's
    tooth are therefore negative, distances from the centre with their sign turned.

    Parameters
    ----------
    name : str
    teeth : float
        Positive, for a ring too; of helical gears that of their normal section.
    profile_shift : float
    rack : Rack
    module_m : float
        Normal module [m]; the rack is in such modules.
    base_radius_m, reference_radius_m, root_radius_m, tip_radius_m : float
    form_roll_m : float
        Roll length [m] at which the involute begins above the fillet.
    bore_radius_m : float
        Radius on which the body is held: of a disc its bore; of a ring
        its outside, at most 3 root radii.
    face_width_m : float
    elastic_modulus_pa : float
    poisson_ratio : float
    root : {"fillet", "straight", "base"}
        The fillet that the rack generates (in a ring an arc that touches involute and root
        circle); a straight part of constant thickness from the base circle to the root circle (an
        involute cut by the root circle where that is larger, and in a ring); or nothing below the
        base circle (Yang & Lin 1987), an option for comparison only.
    internal : bool
        Whether the tooth belongs to a ring.
    """

    name: str
    teeth: float
    profile_shift: float
    rack: Rack
    module_m: float
    base_radius_m: float
    reference_radius_m: float
    root_radius_m: float
    tip_radius_m: float
    form_roll_m: float
    bore_radius_m: float
    face_width_m: float
    elastic_modulus_pa: float
    poisson_ratio: float = 0.3
    root: Root = "fillet"
    internal: bool = False

    def __post_init__(self) -> None:
        thickness = self.bore_radius_m - self.root_radius_m
        if not self.internal and not 0 < self.bore_radius_m < self.root_radius_m:
            raise ArgumentError(
                f"bore radius {1e3 * self.bore_radius_m:g} mm of the {self.name} must be > 0 and "
                f"less than its root radius {1e3 * self.root_radius_m:.5g} mm: the body of the "
                f"gear yields between them; set bore_diameter_{self.name}_mm"
            )
        if self.internal and not 0 < thickness <= 2 * self.root_radius_m:
            raise ArgumentError(
                f"rim thickness {1e3 * thickness:.5g} mm of the {self.name} must lie above 0 and "
                f"up to its root diameter, {2e3 * self.root_radius_m:.5g} mm; set "
                f"rim_thickness_{self.name}_mm"
            )

    @property
    def shear_modulus_pa(self) -> float:
        """G = E/(2 (1 + nu))."""
        return self.elastic_modulus_pa / (2 * (1 + self.poisson_ratio))

    @property
    def sign(self) -> int:
        """Return -1 for a ring, whose teeth point to its centre, else 1."""
        return -1 if self.internal else 1

    @cached_property
    def base_half_angle_rad(self) -> float:
        """Half the angle that the tooth takes on the base circle; of a ring that of its spaces."""
        return self.rack.base_half_angle(self.sign * self.teeth, self.profile_shift)

    @cached_property
    def start(self) -> float:
        """Profile angle t at which the involute part of the beam begins."""
        if self.root == "fillet":
            return float(self.angle(self.form_roll_m))
        return self.angle_at_radius(self.root_radius_m)

    @cached_property
    def tip(self) -> float:
        """Profile angle t at the tip."""
        return self.angle_at_radius(self.tip_radius_m)

    def angle(self, roll_m: ArrayLike) -> FloatArray:
        """Return the profile angle t [rad] of roll lengths [m]."""
        rolled = np.asarray(roll_m, dtype=np.float64) / self.base_radius_m
        return np.asarray(self.sign * (rolled - self.base_half_angle_rad))

    def roll(self, angle: ArrayLike) -> FloatArray:
        """Return the roll length [m] of profile angles t [rad]; the inverse of `angle`."""
        return np.asarray(self.base_radius_m * self._rolled(angle))

    def slope(self, angle: ArrayLike) -> FloatArray:
        """Return the angle [rad] by which the force on the flank points into the tooth's root.

        Counted from the normal to the middle of the tooth.
        """
        return np.asarray(self.sign * np.asarray(angle, dtype=np.float64))

    def angle_at_radius(self, radius_m: float) -> float:
        """Return the profile angle t [rad] on a circle outside the base circle."""
        rolled = math.sqrt(max((radius_m / self.base_radius_m) ** 2 - 1, 0.0))
        return self.sign * (rolled - self.base_half_angle_rad)

    def radius_below_tip(self, depth_m: float) -> float:
        """Return the radius [m] of a circle this far below the tip circle."""
        return self.tip_radius_m - self.sign * depth_m

    @property
    def root_height_m(self) -> float:
        """Height [m] of the root circle in the middle of the tooth."""
        return self.sign * self.root_radius_m

    def height(self, angle: ArrayLike) -> FloatArray:
        """Return heights [m] of the profile along the middle of the tooth, from the centre."""
        t = np.asarray(angle, dtype=np.float64)
        along = np.cos(t) + self._rolled(t) * np.sin(self.slope(t))
        return np.asarray(self.sign * self.base_radius_m * along)

    def half_thickness(self, angle: ArrayLike) -> FloatArray:
        """Return distances [m] of the profile from the middle of the tooth."""
        t = np.asarray(angle, dtype=np.float64)
        across = self._rolled(t) * np.cos(t) - np.sin(self.slope(t))
        return np.asarray(self.sign * self.base_radius_m * across)

    def _rolled(self, angle: ArrayLike) -> FloatArray:
        return np.asarray(self.slope(angle) + self.base_half_angle_rad)

    def angle_at_height(self, height_m: float) -> float:
        """Return the profile angle t of a height on the involute, clipped to its ends."""
        low, high = self.start, self.tip
        if not self.height(low) < height_m < self.height(high):
            return low if height_m <= self.height(low) else high
        return float(brentq(lambda t: float(self.height(t)) - height_m, low, high, xtol=1e-15))

    @cached_property
    def root_part(self) -> RootPart | None:
        """The beam below the involute."""
        if self.root == "fillet" and self.internal:
            end = float(self.half_thickness(self.start)), float(self.height(self.start))
            return ring_root(end, float(self.slope(self.start)), self.root_radius_m)
        if self.root == "fillet":
            return fillet_root(self.rack, self.teeth, self.profile_shift, self.module_m)
        if self.root == "base" or self.internal or self.root_radius_m >= self.base_radius_m:
            return None
        return straight_root(self.base_radius_m, self.root_radius_m, self.base_half_angle_rad)

    @cached_property
    def crack_start(self) -> tuple[float, float]:
        """Height and half thickness [m] where a root crack begins.

        On a fillet where its tangent makes 30 degrees with the middle of the tooth, in a ring 60,
        the section that ISO 6336-3 calls critical; else at the lower end of the beam.
        """
        if self.root_part is not None:
            return self.root_part.crack_start
        return float(self.height(self.start)), float(self.half_thickness(self.start))


@dataclass(frozen=True, eq=False)
class ToothBeam:
    """Running energy integrals of a tooth, sound or damaged.

    Parameters
    ----------
    tooth : Tooth
    damage : ToothDamage
    """

    tooth: Tooth
    damage: ToothDamage = SOUND

    def compliances(self, angle: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return compliances in bending, shear and compression [m/N] for contacts at `angle`.

        Parameters
        ----------
        angle : ndarray, shape (n,)
            Profile angle t of the contact, in size also the angle between the force and the
            normal to the middle of the tooth [rad].

        Notes
        -----
        ``1/k_b = int [(y_c - y) cos t - h_c sin t]^2/(E I) dy``,
        ``1/k_s = int 1.2 cos^2 t/(G A) dy``, ``1/k_a = int sin^2 t/(E A) dy``.
        """
        tooth = self.tooth
        area, zeroth, first, second = self._integrals.at(angle)
        slope = tooth.sign * angle
        cosine, sine = np.cos(slope), np.sin(slope)
        rolled, radius = slope + tooth.base_half_angle_rad, tooth.sign * tooth.base_radius_m
        height = radius * (cosine + rolled * sine) - self._reference
        half = radius * (rolled * cosine - sine)
        lever = height * cosine - half * sine
        bending = (lever * zeroth - 2 * cosine * first) * lever + cosine * cosine * second
        shear = SHEAR_FACTOR / tooth.shear_modulus_pa * cosine * cosine * area
        axial = sine * sine * area / tooth.elastic_modulus_pa
        return bending / tooth.elastic_modulus_pa, shear, axial

    @cached_property
    def corners(self) -> FloatArray:
        """Profile angles at which the sections of the involute are not smooth."""
        return self.damage.corners(self.tooth)

    @cached_property
    def _reference(self) -> float:
        # moments about the foot of the involute: about the gear's centre they would cancel
        return float(self.tooth.height(self.tooth.start))

    @cached_property
    def _integrals(self) -> Pulse:
        """Running integrals of 1/A and of (1, y, y^2)/I along the involute."""
        tooth = self.tooth
        splits = tooth.start + (tooth.tip - tooth.start) * np.array(SPLITS)
        inner = [t for t in self.corners if tooth.start + 1e-12 < t < tooth.tip - 1e-12]
        edges = distinct([tooth.start, *splits, *inner, tooth.tip], 1e-12)
        t = panel_nodes(edges)
        height, half = tooth.height(t), tooth.half_thickness(t)
        slope = tooth.roll(t) * np.cos(t)
        curves = self._integrands(height, half, slope, np.cos(t))
        return Pulse.through(edges, curves).running(self._root())

    def _root(self) -> FloatArray:
        part = self.tooth.root_part
        if part is None:
            return np.zeros(4)
        edges = part.edges(self.damage.root_levels(self.tooth))
        curves = self._integrands(*part.points(edges), None)
        return Pulse.through(edges, curves).running().at(1.0)

    def _integrands(
        self, height: FloatArray, half: FloatArray, slope: FloatArray, cosine: FloatArray | None
    ) -> FloatArray:
        area, inertia = sections(self.tooth, self.damage, height, half, cosine)
        lever = height - self._reference
        weight = slope / inertia
        return np.stack([slope / area, weight, weight * lever, weight * lever * lever], axis=-1)


def tooth_of(
    pair: PairGeometry,
    index: int,
    *,
    bore_radius_m: float,
    poisson_ratio: float = 0.3,
    root: Root = "fillet",
) -> Tooth:
    """Return the tooth of one gear of a pair.

    Parameters
    ----------
    pair : PairGeometry
        With its face width.
    index : {0, 1}
    bore_radius_m : float
        Radius on which the gear is held [m]; of a ring the outer one.
    poisson_ratio : float
    root : {"fillet", "straight", "base"}

    Raises
    ------
    ArgumentError
        If the face width is missing, or the bore or rim does not fit.
    """
    gear = pair.gears[index]
    if pair.face_width_m is None:
        raise ArgumentError("face_width_m is missing: the stiffness of a tooth needs it")
    roll, base = pair.form_rolls_m[index], pair.base_radii_m[index]
    root_m = pair.root_radii_m[index]
    if pair.sign(index) < 0:
        # the involute of a ring does not end before a fillet has room in the space
        half = pair.rack(index).base_half_angle(-gear.teeth, gear.profile_shift)
        roll = roomy_roll(base, root_m, half, math.pi / gear.teeth, roll)
    return Tooth(
        name=gear.name,
        teeth=gear.teeth,
        profile_shift=gear.profile_shift,
        rack=pair.rack(index),
        module_m=pair.normal_module_m,
        base_radius_m=base,
        reference_radius_m=pair.reference_radii_m[index],
        root_radius_m=root_m,
        tip_radius_m=pair.tip_radii_m[index],
        form_roll_m=roll,
        bore_radius_m=bore_radius_m,
        face_width_m=pair.face_width_m,
        elastic_modulus_pa=gear.elastic_modulus_pa,
        poisson_ratio=poisson_ratio,
        root=root,
        internal=pair.sign(index) < 0,
    )
