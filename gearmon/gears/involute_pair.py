"""Values of a pair of involute gears: what each gear is, and the geometry of both together."""

from __future__ import annotations

import math
from dataclasses import dataclass

from gearmon.errors import ArgumentError, check_range
from gearmon.gears.involute import base_helix_angle, contact_zones, involute, overlap_ratio
from gearmon.gears.rack import Rack

Two = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class GearTeeth:
    """Teeth of one gear, in modules.

    Parameters
    ----------
    teeth : int, >= 5
        Number of teeth, positive for internal gears too.
    profile_shift : float
        Profile shift coefficient x.
    tip_factor : float
        Addendum of the gear h_a*, before any tip shortening.
    root_factor : float
        Dedendum of the basic rack h_fP*.
    name : str
        What messages call the gear; the ending of its keys in a machine file.
    """

    teeth: int
    profile_shift: float = 0.0
    tip_factor: float = 1.0
    root_factor: float = 1.25
    name: str = "gear"

    def __post_init__(self) -> None:
        if self.teeth != int(self.teeth) or self.teeth < 5:
            raise ArgumentError(f"{self.name}_teeth={self.teeth} must be a whole number >= 5")
        check_range(f"profile_shift_{self.name}", self.profile_shift, -2, 3)
        check_range(f"tip_factor_{self.name}", self.tip_factor, 0.1, 3)
        check_range(f"root_factor_{self.name}", self.root_factor, 0.2, 4)


@dataclass(frozen=True, kw_only=True)
class PairGeometry:
    """Geometry of a pair; index 0 is the first gear given, index 1 its mate.

    Lengths are in metres, angles in radians, radii positive. Made by `pair_geometry`.

    Parameters
    ----------
    gears : tuple of two GearTeeth
    internal : bool
        Whether the second gear is a ring with internal teeth.
    normal_module_m, transverse_module_m : float
    normal_pressure_angle_rad, transverse_pressure_angle_rad, working_pressure_angle_rad : float
        alpha_n, alpha_t at the reference circle; alpha_wt at the working circle.
    helix_angle_rad : float
        Magnitude of the helix angle at the reference circle.
    face_width_m : float or None
    centre_distance_m : float
        Working centre distance a_w, positive.
    tip_shortening : (float, float)
        k, in modules, <= 0 where tips are cut back to keep the tip clearance.
    reference_radii_m, base_radii_m, working_radii_m, tip_radii_m, root_radii_m : (float, float)
    form_rolls_m : (float, float)
        Roll length (distance from the base tangent point along the line of action) at which the
        involute begins above the fillet; for a ring, at which it ends.
    path_m : (float, float)
        Roll lengths on the first gear at which the path of contact begins (tip of the mate) and
        ends (own tip); the first gear is taken to drive.
    warnings : tuple of str
    """

    gears: tuple[GearTeeth, GearTeeth]
    internal: bool
    normal_module_m: float
    transverse_module_m: float
    normal_pressure_angle_rad: float
    transverse_pressure_angle_rad: float
    working_pressure_angle_rad: float
    helix_angle_rad: float
    face_width_m: float | None
    centre_distance_m: float
    tip_shortening: Two
    reference_radii_m: Two
    base_radii_m: Two
    working_radii_m: Two
    tip_radii_m: Two
    root_radii_m: Two
    form_rolls_m: Two
    path_m: Two
    warnings: tuple[str, ...] = ()

    @property
    def base_pitch_m(self) -> float:
        """Transverse base pitch p_bt [m]."""
        return math.pi * self.transverse_module_m * math.cos(self.transverse_pressure_angle_rad)

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
        """Overlap ratio eps_beta = b sin(beta)/(pi m_n); 0 for spur gears."""
        return overlap_ratio(self.helix_angle_rad, self.face_width_m, self.normal_module_m)

    @property
    def total_contact_ratio(self) -> float:
        """Total contact ratio eps_gamma = eps_alpha + eps_beta."""
        return self.transverse_contact_ratio + self.overlap_ratio

    @property
    def zones(self) -> list[tuple[float, float, int]]:
        """Zones that a pair passes from entry to exit: start, end [mesh periods], pairs carrying.

        Of helical gears the pairs that touch anywhere along the face width.
        """
        return contact_zones(self.total_contact_ratio)

    @property
    def base_helix_angle_rad(self) -> float:
        """Helix angle on the base circle [rad]."""
        return base_helix_angle(self.helix_angle_rad, self.normal_pressure_angle_rad)

    @property
    def pitch_point_phase(self) -> float:
        """Mesh periods from the entry of a pair into contact to its contact at the pitch point."""
        pitch = self.base_radii_m[0] * math.tan(self.working_pressure_angle_rad)
        return (pitch - self.path_m[0]) / self.base_pitch_m

    @property
    def tip_thicknesses_m(self) -> Two:
        """Tooth thickness along the tip circle, in the transverse section [m]."""
        return self.thickness_m(0, self.tip_radii_m[0]), self.thickness_m(1, self.tip_radii_m[1])

    def thickness_m(self, index: int, radius_m: float) -> float:
        """Return the transverse tooth thickness of a gear on a circle outside its base circle [m].

        Parameters
        ----------
        index : {0, 1}
        radius_m : float
            At least the base radius.

        Raises
        ------
        ArgumentError
            If the circle lies inside the base circle, where there is no involute.
        """
        base = self.base_radii_m[index]
        if radius_m < base * (1 - 1e-12):
            name = self.gears[index].name
            raise ArgumentError(f"radius_m={radius_m} of the {name} must be >= base radius {base}")
        gear, sign = self.gears[index], self.sign(index)
        shift = gear.profile_shift * math.tan(self.normal_pressure_angle_rad)
        half_angle = (math.pi / 2 + 2 * shift) / gear.teeth
        here = math.acos(min(1.0, base / radius_m))
        difference = involute(self.transverse_pressure_angle_rad) - involute(here)
        return 2 * radius_m * (half_angle + sign * difference)

    def sign(self, index: int) -> int:
        """Return -1 for the ring of an internal pair, else 1."""
        return -1 if self.internal and index == 1 else 1

    def rack(self, index: int) -> Rack:
        """Return the basic rack that generates a gear."""
        return Rack(
            dedendum=self.gears[index].root_factor,
            pressure_angle_rad=self.normal_pressure_angle_rad,
            helix_angle_rad=self.helix_angle_rad,
        )
