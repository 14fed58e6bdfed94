"""What parallel and planetary stages share: common data, and the rules of a gear's keys."""

from __future__ import annotations

import math
from dataclasses import dataclass

from gearmon.machine.fields import Count, FieldError, Number, Text, check_fields, held, within

TEETH = Count(low=5, high=2000, why="the range of cylindrical gears", example="26")
SHIFT = Number(low=-3, high=3, why="the profile shift coefficient is a multiple of the module")
TIP = Number(low=0.3, high=2.0, why="the addendum is 1.0 modules in standard teeth")
ROOT = Number(low=0.5, high=2.5, why="the dedendum of the basic rack is about 1.25 modules")
BORE = Number(low=0, high=20_000, unit="mm", open_low=True, why="leave it out for a solid disc")
MODULUS = Number(low=1e8, high=1e12, unit="Pa", why="steel has 206e9 Pa")
TIP_DIAMETER = Number(
    low=0, high=50_000, unit="mm", open_low=True, why="leave it out to have it computed"
)
ROOT_DIAMETER = Number(
    low=0, high=50_000, unit="mm", open_low=True, why="leave it out to have it computed"
)
WEB = Number(low=0, high=5000, unit="mm", open_low=True, why="leave it out for a solid disc")
RIM = Number(
    low=0, high=5000, unit="mm", open_low=True, why="from the root circle; leave it out if unknown"
)
MASS = Number(low=0, high=1e6, unit="kg", open_low=True, why="leave it out to have it computed")
INERTIA = Number(
    low=0, high=1e9, unit="kg m2", open_low=True, why="leave it out to have it computed"
)
PLACE = Number(low=0, high=1e5, unit="mm", why="from the beginning of the shaft")
STIFFNESS = Number(low=1e3, high=1e13, unit="N/m", why="leave it out where it hardly yields")
TORSION = Number(low=1, high=1e13, unit="Nm/rad", why="leave it out where it hardly yields")
ANGLE = Number(low=-360, high=360, unit="deg", why="0 where all axes lie in one plane")


@dataclass(frozen=True, kw_only=True)
class StageData:
    """Data that parallel and planetary stages have in common; all of it optional for analysis."""

    name: str = held(Text(example='"first reduction"'), "")
    module_mm: float | None = within(0.02, 200, "mm", default=None, why="the normal module")
    pressure_angle_deg: float = within(
        10, 35, "deg", default=20.0, why="of the basic rack, mostly 20"
    )
    helix_angle_deg: float = within(
        -45, 45, "deg", default=0.0, open_low=True, open_high=True, why="0 for spur"
    )
    face_width_mm: float | None = within(0.1, 5000, "mm", default=None, why="the common face width")
    centre_distance_mm: float | None = within(
        0.1, 20_000, "mm", default=None, why="the working centre distance"
    )
    poisson_ratio: float = within(0, 0.5, default=0.3, open_high=True, why="steel has 0.3")
    density_kgm3: float = within(500, 25_000, "kg/m3", default=7850.0, why="steel has 7850")
    damping_ratio: float | None = within(
        0, 5, default=None, open_low=True, why="commonly 0.03 to 0.17"
    )
    mesh_stiffness_n_per_m: float | None = within(
        1e3, 1e13, "N/m", default=None, why="the mean mesh stiffness"
    )
    stiffness_variation: float | None = within(
        0, 1, default=None, open_high=True, why="relative to the mean stiffness"
    )
    equivalent_mass_kg: float | None = within(0, 1e6, "kg", default=None, open_low=True)
    damping_ns_per_m: float | None = within(0, 1e10, "Ns/m", default=None, open_low=True)
    contact_ratio: float | None = within(0.5, 6, default=None, why="the transverse contact ratio")
    application_factor: float = within(
        1, 10, default=1.0, why="K_A of ISO 6336, 1 for uniform load"
    )
    tip_shortening: float | None = within(
        -1, 0.5, default=None, why="k of ISO 21771 in modules, 0 for tips of full height"
    )
    force_n: float | None = within(
        0, 1e10, "N", default=None, open_low=True, why="static tooth force"
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if self.contact_ratio is not None and self.helix_angle_deg == 0 and self.contact_ratio < 1:
            reason = "must be at least 1 for spur gears: else no tooth pair carries for a while"
            raise FieldError("contact_ratio", reason, self.contact_ratio)

    @property
    def transverse_pressure_angle_rad(self) -> float:
        """Pressure angle in the transverse plane at the reference circle [rad]."""
        normal, helix = math.radians(self.pressure_angle_deg), math.radians(self.helix_angle_deg)
        return math.atan(math.tan(normal) / math.cos(helix))

    def _check_centre_distance(self, teeth: int) -> None:
        """Refuse a working centre distance at which the teeth of a pair cannot mesh."""
        if self.module_mm is None or self.centre_distance_mm is None:
            return
        reference = self.module_mm * abs(teeth) / (2 * math.cos(math.radians(self.helix_angle_deg)))
        # base circles set the lower end; the working pressure angle hardly passes 40 degrees
        shortest = reference * math.cos(self.transverse_pressure_angle_rad)
        longest = max(shortest / math.cos(math.radians(40)), 1.02 * reference)
        if not shortest <= self.centre_distance_mm <= longest:
            reason = (
                f"must lie in [{shortest:.4g}, {longest:.4g}] mm for these teeth and this module "
                f"(reference centre distance {reference:.5g} mm)"
            )
            raise FieldError("centre_distance_mm", reason, self.centre_distance_mm)

    def _check_gear(self, member: str, teeth: int, sign: int = 1) -> None:
        """Refuse diameters and bodies of a gear that cannot be.

        Parameters
        ----------
        member : str
            Ending of its keys.
        teeth : int
        sign : {1, -1}
            -1 for a ring.
        """
        tip, root = (getattr(self, f"{which}_diameter_{member}_mm") for which in ("tip", "root"))
        if self.module_mm is not None:
            reference = teeth * self.module_mm / math.cos(math.radians(self.helix_angle_deg))
            self._check_circle(f"tip_diameter_{member}_mm", tip, reference, sign, (-1.0, 4.0))
            self._check_circle(f"root_diameter_{member}_mm", root, reference, sign, (-4.0, 1.0))
            if root is None:
                shift = getattr(self, f"profile_shift_{member}")
                depth = getattr(self, f"root_factor_{member}") - shift
                root = reference - sign * 2 * self.module_mm * depth
        if tip is not None and root is not None and sign * (tip - root) <= 0:
            side = "more" if sign > 0 else "less"
            reason = f"must be {side} than the root diameter, {root:.5g} mm"
            raise FieldError(f"tip_diameter_{member}_mm", reason, tip)
        if sign > 0:
            self._check_body(member, root)

    def _check_circle(
        self,
        key: str,
        diameter: float | None,
        reference: float,
        sign: int,
        modules: tuple[float, float],
    ) -> None:
        if diameter is None or self.module_mm is None:
            return
        ends = sorted(reference + 2 * sign * self.module_mm * height for height in modules)
        if not ends[0] <= diameter <= ends[1]:
            reason = (
                f"must lie in [{ends[0]:.5g}, {ends[1]:.5g}] mm for these teeth and this module "
                f"(reference diameter {reference:.5g} mm)"
            )
            raise FieldError(key, reason, diameter)

    def _check_body(self, member: str, root: float | None) -> None:
        """Refuse a bore that reaches the tooth roots, and half a description of a web."""
        key = f"bore_diameter_{member}_mm"
        bore: float | None = getattr(self, key)
        if bore is not None and root is not None and bore >= root:
            raise FieldError(key, f"must be less than the root diameter, {root:.5g} mm", bore)
        web, rim = f"web_width_{member}_mm", f"rim_thickness_{member}_mm"
        thickness: float | None = getattr(self, rim)
        if (getattr(self, web) is None) != (thickness is None):
            given, other = (web, rim) if thickness is None else (rim, web)
            reason = f"says half of what a web is: give {other} too, or neither for a solid disc"
            raise FieldError(given, reason, getattr(self, given))
        if root is None or thickness is None:
            return
        room = 0.5 * (root - (bore or 0.0))
        if thickness >= room:
            reason = f"must be less than what lies between root circle and bore, {room:.5g} mm"
            raise FieldError(rim, reason, thickness)
