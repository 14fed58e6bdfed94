"""One tooth as a beam: compliance in bending, shear and compression, for many contacts at once.

The energy integrals run along the middle line of the tooth from its root to the contact. Their
integrands do not depend on where the contact is, apart from the lever arm, which enters through
three moments: so running integrals serve all contacts.

References
----------
Yang & Lin, J. Vib. Acoust. 109 (1987) 189; Tian (2004); Ma et al., Mech. Mach. Theory 73 (2014) 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from gearmon.errors import ArgumentError
from gearmon.gears.involute_pair import PairGeometry
from gearmon.gears.panels import FloatArray, PanelCurves, panel_nodes
from gearmon.gears.rack import Rack
from gearmon.gears.ring_root import ring_root, roomy_roll
from gearmon.gears.tooth_damage import SOUND, ToothDamage, sections
from gearmon.gears.tooth_fillet import RootPart, fillet_root, straight_root

#: Which curve joins the involute and the root circle; see `Tooth`.
Root = Literal["fillet", "straight", "base"]
ROOTS: tuple[Root, ...] = ("fillet", "straight", "base")
#: Where the involute is split for its integrals: 1/h^3 is steep towards the tip.
SPLITS = (0.6, 0.87)
#: Shear factor of a rectangular section.
SHEAR_FACTOR = 1.2


@dataclass(frozen=True, kw_only=True)
class Tooth:
    """One tooth and the body that it stands on.

    A tooth is described from its root upwards, whether it points away from the gear's centre or,
    in a ring, towards it: heights and profile angles t grow from root to tip. Heights of a ring's
    tooth are therefore negative, distances from the centre with their sign turned.

    Parameters
    ----------
    name : str
    teeth : int
        Positive, for a ring too.
    profile_shift : float
    rack : Rack
    module_m : float
        Normal module [m]; the rack is in such modules.
    base_radius_m, reference_radius_m, root_radius_m, tip_radius_m : float
    form_roll_m : float
        Roll length [m] at which the involute begins above the fillet.
    bore_radius_m : float
        Radius on which the body is held: of a disc its bore, at least 0.1 root radii; of a ring
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
    teeth: int
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
        if self.root not in ROOTS:
            raise ArgumentError(f"root={self.root!r} must be one of {', '.join(ROOTS)}")
        if self.internal:
            self._check_ring()
        elif not 0.1 * self.root_radius_m <= self.bore_radius_m < self.root_radius_m:
            raise ArgumentError(
                f"bore radius {1e3 * self.bore_radius_m:g} mm of the {self.name} must be at least "
                f"a tenth of its root radius {1e3 * self.root_radius_m:.5g} mm and less than that: "
                f"the body of the gear yields between them; set bore_diameter_{self.name}_mm"
            )

    def _check_ring(self) -> None:
        thickness = self.bore_radius_m - self.root_radius_m
        if not 0 < thickness <= 2 * self.root_radius_m:
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
        if height_m <= self.height(low):
            return low
        if height_m >= self.height(high):
            return high
        t = 0.5 * (low + high)
        for _ in range(60):
            # the height is convex in t and its slope known: Newton, kept inside
            slope = float(self.roll(t)) * math.cos(t)
            step = (float(self.height(t)) - height_m) / slope
            t = min(max(t - step, low), high)
            if abs(step) < 1e-14:
                break
        return t

    @cached_property
    def root_part(self) -> RootPart | None:
        """The beam below the involute."""
        if self.internal:
            return self._ring_root()
        if self.root == "fillet":
            roll = self.form_roll_m / self.module_m
            return fillet_root(self.rack, self.teeth, self.profile_shift, roll, self.module_m)
        if self.root == "base" or self.root_radius_m >= self.base_radius_m:
            return None
        return straight_root(self.base_radius_m, self.root_radius_m, self.base_half_angle_rad)

    def _ring_root(self) -> RootPart | None:
        if self.root != "fillet":
            return None
        end = float(self.half_thickness(self.start)), float(self.height(self.start))
        return ring_root(end, float(self.slope(self.start)), self.root_radius_m)

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
    def _integrals(self) -> PanelCurves:
        """Running integrals of 1/A and of (1, y, y^2)/I along the involute."""
        tooth = self.tooth
        splits = tooth.start + (tooth.tip - tooth.start) * np.array(SPLITS)
        edges = _with_corners(tooth.start, tooth.tip, np.concatenate([splits, self.corners]))
        t = panel_nodes(edges)
        height, half = tooth.height(t), tooth.half_thickness(t)
        slope = tooth.roll(t) * np.cos(t)
        curves = self._integrands(height, half, slope, np.cos(t))
        return PanelCurves.through(edges, curves).integral(self._root())

    def _root(self) -> FloatArray:
        part = self.tooth.root_part
        if part is None:
            return np.zeros(4)
        edges = part.edges(self.damage.root_levels(self.tooth))
        height, half, slope = part.points(edges)
        curves = self._integrands(height, half, slope, None)
        return PanelCurves.through(edges, curves).totals

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
    elastic_modulus_pa: float = 206e9,
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
    elastic_modulus_pa, poisson_ratio : float
    root : {"fillet", "straight", "base"}

    Raises
    ------
    ArgumentError
        If the face width is missing, or the bore or rim does not fit.
    """
    gear = pair.gears[index]
    if pair.face_width_m is None:
        raise ArgumentError("face_width_m is missing: the stiffness of a tooth needs it")
    return Tooth(
        name=gear.name,
        teeth=gear.teeth,
        profile_shift=gear.profile_shift,
        rack=pair.rack(index),
        module_m=pair.normal_module_m,
        base_radius_m=pair.base_radii_m[index],
        reference_radius_m=pair.reference_radii_m[index],
        root_radius_m=pair.root_radii_m[index],
        tip_radius_m=pair.tip_radii_m[index],
        form_roll_m=_form_roll(pair, index),
        bore_radius_m=bore_radius_m,
        face_width_m=pair.face_width_m,
        elastic_modulus_pa=elastic_modulus_pa,
        poisson_ratio=poisson_ratio,
        root=root,
        internal=pair.sign(index) < 0,
    )


def _form_roll(pair: PairGeometry, index: int) -> float:
    """Return where the involute begins; of a ring not before a fillet has room in the space."""
    roll = pair.form_rolls_m[index]
    if pair.sign(index) > 0:
        return roll
    teeth, root = pair.gears[index].teeth, pair.root_radii_m[index]
    half = pair.rack(index).base_half_angle(-teeth, pair.gears[index].profile_shift)
    return roomy_roll(pair.base_radii_m[index], root, half, math.pi / teeth, roll)


def _with_corners(low: float, high: float, corners: FloatArray) -> FloatArray:
    inner = corners[(corners > low + 1e-12) & (corners < high - 1e-12)]
    edges = np.unique(np.concatenate([[low, high], inner]))
    return np.asarray(edges[np.concatenate([[True], np.diff(edges) > 1e-12])])
