"""Gear stages: what turns what, with which teeth, and the data that a baseline needs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from gearmon.machine import fields as rules
from gearmon.machine.fields import FieldError, Number, check_fields, held, limit, optional, within

TEETH = rules.Count(low=5, high=2000, why="the range of cylindrical gears", example="26")
SHIFT = Number(-3, 3, why="the profile shift coefficient is a multiple of the module")
TIP = Number(0.3, 2.0, why="the addendum is 1.0 modules in standard teeth")
ROOT = Number(0.5, 2.5, why="the dedendum of the basic rack is about 1.25 modules")
BORE = Number(0, 20_000, "mm", "leave it out for a solid disc", open_low=True)
MODULUS = Number(1e8, 1e12, "Pa", "steel has 206e9 Pa")
DIAMETER = Number(0, 50_000, "mm", "leave it out to have it computed", open_low=True)
WEB = Number(0, 5000, "mm", "leave it out for a solid disc", open_low=True)
RIM = Number(0, 5000, "mm", "from the root circle; leave it out if unknown", open_low=True)
MASS = Number(0, 1e6, "kg", "leave it out to have it computed", open_low=True)
INERTIA = Number(0, 1e9, "kg m2", "leave it out to have it computed", open_low=True)
PLACE = Number(0, 1e5, "mm", "from the beginning of the shaft")
STIFFNESS = Number(1e3, 1e13, "N/m", "leave it out where it hardly yields")
TORSION = Number(1, 1e13, "Nm/rad", "leave it out where it hardly yields")
ANGLE = Number(-360, 360, "deg", "0 where all axes lie in one plane")
PRESSURE = Number(10, 35, "deg", "of the basic rack, mostly 20")
HELIX = Number(-45, 45, "deg", "0 for spur", open_low=True, open_high=True)


@dataclass(frozen=True, kw_only=True)
class StageData:
    """Data that parallel and planetary stages have in common; all of it optional for analysis."""

    name: str = held(rules.Text(example='"first reduction"'), "")
    module_mm: float | None = optional(0.02, 200, "mm", "the normal module")
    pressure_angle_deg: float = held(PRESSURE, 20.0)
    helix_angle_deg: float = held(HELIX, 0.0)
    face_width_mm: float | None = optional(0.1, 5000, "mm", "the common face width")
    centre_distance_mm: float | None = optional(0.1, 20_000, "mm", "the working centre distance")
    poisson_ratio: float = within(0, 0.5, default=0.3, open_high=True, why="steel has 0.3")
    density_kgm3: float = within(500, 25_000, "kg/m3", default=7850.0, why="steel has 7850")
    damping_ratio: float | None = optional(0, 5, why="commonly 0.03 to 0.17", open_low=True)
    mesh_stiffness_n_per_m: float | None = optional(1e3, 1e13, "N/m", "the mean mesh stiffness")
    stiffness_variation: float | None = optional(
        0, 1, why="relative to the mean stiffness", open_high=True
    )
    equivalent_mass_kg: float | None = optional(0, 1e6, "kg", open_low=True)
    damping_ns_per_m: float | None = optional(0, 1e10, "Ns/m", open_low=True)
    contact_ratio: float | None = optional(0.5, 6, why="the transverse contact ratio")
    application_factor: float = within(
        1, 10, default=1.0, why="K_A of ISO 6336, 1 for uniform load"
    )
    tip_shortening: float | None = optional(
        -1, 0.5, why="k of ISO 21771 in modules, 0 for tips of full height"
    )
    force_n: float | None = optional(0, 1e10, "N", "static tooth force", open_low=True)

    def __post_init__(self) -> None:
        check_fields(self)
        if self.helix_angle_deg == 0:
            why = "below 1 no tooth pair of spur gears carries for a while"
            limit(self, "contact_ratio", 1, 6, "", why)

    @property
    def transverse_pressure_angle_rad(self) -> float:
        """Pressure angle in the transverse plane at the reference circle [rad]."""
        normal, helix = math.radians(self.pressure_angle_deg), math.radians(self.helix_angle_deg)
        return math.atan(math.tan(normal) / math.cos(helix))

    def _check_centre_distance(self, teeth: int) -> None:
        """Refuse a working centre distance at which the teeth of a pair cannot mesh."""
        if self.module_mm is None:
            return
        reference = self.module_mm * abs(teeth) / (2 * math.cos(math.radians(self.helix_angle_deg)))
        # base circles set the lower end; the working pressure angle hardly passes 40 degrees
        shortest = reference * math.cos(self.transverse_pressure_angle_rad)
        longest = max(shortest / math.cos(math.radians(40)), 1.02 * reference)
        why = f"for these teeth and this module (reference centre distance {reference:.5g} mm)"
        limit(self, "centre_distance_mm", shortest, longest, "mm", why)

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
        root: float | None = getattr(self, f"root_diameter_{member}_mm")
        if self.module_mm is not None:
            reference = teeth * self.module_mm / math.cos(math.radians(self.helix_angle_deg))
            why = f"for these teeth and this module (reference diameter {reference:.5g} mm)"
            for which, heights in (("tip", (-1, 4)), ("root", (-4, 1))):
                low, high = sorted(reference + 2 * sign * self.module_mm * own for own in heights)
                limit(self, f"{which}_diameter_{member}_mm", low, high, "mm", why)
            if root is None:
                shift = getattr(self, f"profile_shift_{member}")
                depth = getattr(self, f"root_factor_{member}") - shift
                root = reference - sign * 2 * self.module_mm * depth
        if root is not None:
            low, high = (root, DIAMETER.high) if sign > 0 else (0.0, root)
            why, ends = "beyond the root diameter", {"open_low": True, "open_high": True}
            limit(self, f"tip_diameter_{member}_mm", low, high, "mm", why, **ends)
        if sign > 0:
            self._check_body(member, math.inf if root is None else root)

    def _check_body(self, member: str, root: float) -> None:
        """Refuse a bore that reaches the tooth roots, and half a description of a web."""
        keys = ("bore_diameter", "web_width", "rim_thickness")
        bore, web, rim = (f"{key}_{member}_mm" for key in keys)
        limit(self, bore, 0, root, "mm", "less than the root diameter", open_high=True)
        for given, other in ((web, rim), (rim, web)):
            if getattr(self, given) is not None and getattr(self, other) is None:
                reason = f"says half of what a web is: give {other} too, or neither"
                raise FieldError(given, reason, getattr(self, given))
        room, why = 0.5 * (root - (getattr(self, bore) or 0.0)), "from the root circle to the bore"
        limit(self, rim, 0, room, "mm", why, open_high=True)


MEMBERS = ("sun", "ring", "carrier")
LARGEST_TOOTH_DEVIATION = 3


@dataclass(frozen=True, kw_only=True)
class ParallelStage(StageData):
    """A pair of external cylindrical gears on parallel shafts.

    Parameters
    ----------
    pinion_teeth, gear_teeth : int, 5 to 2000
        Teeth on the driving and on the driven shaft. The pinion of the machine file is the gear on
        the *driving* shaft; in a speed-increasing stage it has more teeth than the gear.
    name : str
        What the stage is called in tables.
    module_mm : float, optional
        Normal module [mm].
    pressure_angle_deg : float, 10 to 35
        Normal pressure angle of the basic rack [deg].
    helix_angle_deg : float, above -45 and below 45
        Helix angle at the reference circle [deg]; 0 for spur gears.
    face_width_mm : float, optional
        Common face width [mm].
    profile_shift_pinion, profile_shift_gear : float
        Profile shift coefficients x, in modules.
    centre_distance_mm : float, optional
        Working centre distance [mm]; without it the one that follows from the profile shifts.
    tip_factor_pinion, tip_factor_gear : float
        Addendum factors h_a*, in modules.
    root_factor_pinion, root_factor_gear : float
        Dedendum factors of the basic rack h_fP*, in modules.
    tip_diameter_pinion_mm, tip_diameter_gear_mm : float, optional
        Finished tip diameters [mm]; they go before `tip_shortening` and the tip factors.
    root_diameter_pinion_mm, root_diameter_gear_mm : float, optional
        Root diameters [mm]; they go before the root factors.
    tip_shortening : float, optional
        k of both gears, in modules, negative for tips cut back; without it, what keeps the tip
        clearance of unshifted gears (ISO 21771).
    bore_diameter_pinion_mm, bore_diameter_gear_mm : float, optional
        Bore, or diameter at which the body sits on its shaft [mm].
    web_width_pinion_mm, web_width_gear_mm, rim_thickness_pinion_mm, rim_thickness_gear_mm : \
float, optional
        Width b_s of the web and thickness s_R of the rim under the tooth roots [mm], both or
        neither: a gear without them is a solid disc.
    elastic_modulus_pinion_pa, elastic_modulus_gear_pa : float
        Young's moduli [Pa].
    poisson_ratio : float, 0 to below 0.5
        Poisson's ratio of both gears.
    density_kgm3 : float
        Density of both gears [kg/m3].
    application_factor : float, 1 to 10
        K_A of ISO 6336: the greatest tooth load over the static one, which decides on the
        low-load branch of the stiffness.
    damping_ratio : float, optional
        Damping ratio of the mesh, c / (2 sqrt(k m)).
    mesh_stiffness_n_per_m, stiffness_variation, equivalent_mass_kg, damping_ns_per_m, \
contact_ratio, force_n : float, optional
        Known values that replace what is otherwise computed: mean mesh stiffness [N/m], half the
        swing of the stiffness over its mean, equivalent mass on the line of action [kg], mesh
        damping [Ns/m] (goes before `damping_ratio`), transverse contact ratio, static force on
        the line of action [N].
    mass_pinion_kg, mass_gear_kg, inertia_pinion_kgm2, inertia_gear_kgm2 : float, optional
        Mass [kg] and moment of inertia about the axis [kg m2] of each gear, in the place of those
        of a disc of the gear's size.
    position_pinion_mm, position_gear_mm : float, optional
        Where the gears sit on their shafts [mm], see `ShaftSection`.
    axis_angle_deg : float
        Direction from the axis of the pinion to that of the gear [deg], counted as shaft 1 turns.

    Raises
    ------
    FieldError
        If a value has the wrong type or cannot be.

    Examples
    --------
    >>> ParallelStage(pinion_teeth=26, gear_teeth=53, module_mm=2.0).gear_teeth
    53
    """

    kind: ClassVar[str] = "parallel"

    pinion_teeth: int = held(TEETH)
    gear_teeth: int = held(TEETH)
    profile_shift_pinion: float = held(SHIFT, 0.0)
    profile_shift_gear: float = held(SHIFT, 0.0)
    tip_factor_pinion: float = held(TIP, 1.0)
    tip_factor_gear: float = held(TIP, 1.0)
    root_factor_pinion: float = held(ROOT, 1.25)
    root_factor_gear: float = held(ROOT, 1.25)
    bore_diameter_pinion_mm: float | None = held(BORE, None)
    bore_diameter_gear_mm: float | None = held(BORE, None)
    tip_diameter_pinion_mm: float | None = held(DIAMETER, None)
    tip_diameter_gear_mm: float | None = held(DIAMETER, None)
    root_diameter_pinion_mm: float | None = held(DIAMETER, None)
    root_diameter_gear_mm: float | None = held(DIAMETER, None)
    web_width_pinion_mm: float | None = held(WEB, None)
    web_width_gear_mm: float | None = held(WEB, None)
    rim_thickness_pinion_mm: float | None = held(RIM, None)
    rim_thickness_gear_mm: float | None = held(RIM, None)
    elastic_modulus_pinion_pa: float = held(MODULUS, 206e9)
    elastic_modulus_gear_pa: float = held(MODULUS, 206e9)
    mass_pinion_kg: float | None = held(MASS, None)
    mass_gear_kg: float | None = held(MASS, None)
    inertia_pinion_kgm2: float | None = held(INERTIA, None)
    inertia_gear_kgm2: float | None = held(INERTIA, None)
    position_pinion_mm: float | None = held(PLACE, None)
    position_gear_mm: float | None = held(PLACE, None)
    axis_angle_deg: float = held(ANGLE, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_centre_distance(self.pinion_teeth + self.gear_teeth)
        self._check_gear("pinion", self.pinion_teeth)
        self._check_gear("gear", self.gear_teeth)

    @property
    def on_shafts(self) -> tuple[str, str]:
        """The members on the stage's input and output shafts."""
        return "pinion", "gear"


@dataclass(frozen=True, kw_only=True)
class PlanetaryStage(StageData):
    """A simple planetary set: a sun, equal planets on a carrier and a ring with internal teeth.

    Parameters
    ----------
    sun_teeth, planet_teeth, ring_teeth : int, 5 to 2000
        Teeth. ring = sun + 2 planet holds for unshifted teeth; up to 3 teeth of deviation are
        accepted, for profile shift makes that much possible.
    planets : int, 1 to 30
        How many planets.
    fixed : {"ring", "sun", "carrier"}
        The member that stands still.
    driving : {"sun", "ring", "carrier"}, optional
        The member on the stage's input shaft: the sun, or the carrier if the sun is fixed.
    name, module_mm, pressure_angle_deg, helix_angle_deg, face_width_mm, poisson_ratio, \
    density_kgm3, damping_ratio, application_factor
        As for `ParallelStage`.
    profile_shift_sun, profile_shift_planet, profile_shift_ring : float
        Profile shift coefficients x, in modules.
    centre_distance_mm : float, optional
        Working distance from the axis of the sun to the axis of a planet [mm].
    tip_factor_sun, tip_factor_planet, tip_factor_ring : float
        Addendum factors h_a*, in modules.
    root_factor_sun, root_factor_planet, root_factor_ring : float
        Dedendum factors of the basic rack h_fP*, in modules.
    tip_diameter_sun_mm, tip_diameter_planet_mm, tip_diameter_ring_mm : float, optional
        Finished tip diameters [mm]; they go before `tip_shortening` and the tip factors.
    root_diameter_sun_mm, root_diameter_planet_mm, root_diameter_ring_mm : float, optional
        Root diameters [mm]; they go before the root factors.
    tip_shortening : float, optional
        k of sun and planet, in modules, as for `ParallelStage`; the ring has its tip factor.
    bore_diameter_sun_mm, bore_diameter_planet_mm : float, optional
        Bores [mm].
    web_width_sun_mm, web_width_planet_mm, rim_thickness_sun_mm, rim_thickness_planet_mm : \
    float, optional
        Width of the web and thickness of the rim [mm], both or neither.
    rim_thickness_ring_mm : float, optional
        Thickness of the ring outside its tooth roots [mm]; the ring is held round that circle.
    elastic_modulus_sun_pa, elastic_modulus_planet_pa, elastic_modulus_ring_pa : float
        Young's moduli [Pa].
    mesh_stiffness_n_per_m, stiffness_variation, equivalent_mass_kg, damping_ns_per_m, \
    contact_ratio, force_n : float, optional
        Known values that replace what is otherwise computed [N/m, -, kg, N s/m, -, N], each for
        one sun-planet mesh.
    ring_mesh_stiffness_n_per_m : float, optional
        Mean stiffness of one planet-ring mesh [N/m].
    mass_sun_kg, mass_planet_kg, mass_ring_kg, mass_carrier_kg, inertia_sun_kgm2, \
    inertia_planet_kgm2, inertia_ring_kgm2, inertia_carrier_kgm2 : float, optional
        Mass [kg] and moment of inertia about its own axis [kg m2] of each body (the carrier without
        planets), in the place of those of discs.
    position_sun_mm, position_ring_mm, position_carrier_mm : float, optional
        Where the members sit on their shafts [mm], see `ShaftSection`.
    fixed_support_n_per_m, fixed_torsion_nm_per_rad : float, optional
        How the fixed member is held against translation [N/m] and rotation [Nm/rad]; rigidly where
        not given.

    Raises
    ------
    FieldError
        If a value has the wrong type, or the teeth cannot form a planetary set.

    Examples
    --------
    >>> PlanetaryStage(sun_teeth=20, planet_teeth=40, ring_teeth=100, planets=4).driven
    'carrier'
    """

    kind: ClassVar[str] = "planetary"

    sun_teeth: int = held(TEETH)
    planet_teeth: int = held(TEETH)
    ring_teeth: int = held(TEETH)
    planets: int = held(rules.Count(low=1, high=30, example="3"))
    fixed: str = held(rules.Choice(options=MEMBERS), "ring")
    driving: str = held(rules.Choice(options=MEMBERS), "")
    profile_shift_sun: float = held(SHIFT, 0.0)
    profile_shift_planet: float = held(SHIFT, 0.0)
    profile_shift_ring: float = held(SHIFT, 0.0)
    tip_factor_sun: float = held(TIP, 1.0)
    tip_factor_planet: float = held(TIP, 1.0)
    tip_factor_ring: float = held(TIP, 1.0)
    root_factor_sun: float = held(ROOT, 1.25)
    root_factor_planet: float = held(ROOT, 1.25)
    root_factor_ring: float = held(ROOT, 1.25)
    bore_diameter_sun_mm: float | None = held(BORE, None)
    bore_diameter_planet_mm: float | None = held(BORE, None)
    tip_diameter_sun_mm: float | None = held(DIAMETER, None)
    tip_diameter_planet_mm: float | None = held(DIAMETER, None)
    tip_diameter_ring_mm: float | None = held(DIAMETER, None)
    root_diameter_sun_mm: float | None = held(DIAMETER, None)
    root_diameter_planet_mm: float | None = held(DIAMETER, None)
    root_diameter_ring_mm: float | None = held(DIAMETER, None)
    web_width_sun_mm: float | None = held(WEB, None)
    web_width_planet_mm: float | None = held(WEB, None)
    rim_thickness_sun_mm: float | None = held(RIM, None)
    rim_thickness_planet_mm: float | None = held(RIM, None)
    rim_thickness_ring_mm: float | None = held(RIM, None)
    elastic_modulus_sun_pa: float = held(MODULUS, 206e9)
    elastic_modulus_planet_pa: float = held(MODULUS, 206e9)
    elastic_modulus_ring_pa: float = held(MODULUS, 206e9)
    ring_mesh_stiffness_n_per_m: float | None = held(STIFFNESS, None)
    mass_sun_kg: float | None = held(MASS, None)
    mass_planet_kg: float | None = held(MASS, None)
    mass_ring_kg: float | None = held(MASS, None)
    mass_carrier_kg: float | None = held(MASS, None)
    inertia_sun_kgm2: float | None = held(INERTIA, None)
    inertia_planet_kgm2: float | None = held(INERTIA, None)
    inertia_ring_kgm2: float | None = held(INERTIA, None)
    inertia_carrier_kgm2: float | None = held(INERTIA, None)
    position_sun_mm: float | None = held(PLACE, None)
    position_ring_mm: float | None = held(PLACE, None)
    position_carrier_mm: float | None = held(PLACE, None)
    fixed_support_n_per_m: float | None = held(STIFFNESS, None)
    fixed_torsion_nm_per_rad: float | None = held(TORSION, None)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.driving:
            object.__setattr__(self, "driving", "carrier" if self.fixed == "sun" else "sun")
        if self.driving == self.fixed:
            reason = "is also the fixed member; name the member on the input shaft"
            raise FieldError("driving", reason, self.driving)
        place = f"position_{self.fixed}_mm"
        if getattr(self, place) is not None:
            reason = f"is for members on shafts: the {self.fixed} is fixed"
            raise FieldError(place, reason, getattr(self, place))
        teeth, off = self.sun_teeth + 2 * self.planet_teeth, LARGEST_TOOTH_DEVIATION
        why = f"sun + 2 planet = {teeth} or nearly so (stepped or double planets are not covered)"
        limit(self, "ring_teeth", teeth - off, teeth + off, "", why)
        # neighbours touch when the chord between their axes falls below their reference diameter
        chord = (self.sun_teeth + self.planet_teeth) * math.sin(math.pi / max(self.planets, 2))
        if chord < self.planet_teeth:
            reason = f"is more than fits: planets of {self.planet_teeth} teeth would overlap"
            raise FieldError("planets", reason, self.planets)
        self._check_centre_distance(self.sun_teeth + self.planet_teeth)
        self._check_gear("sun", self.sun_teeth)
        self._check_gear("planet", self.planet_teeth)
        self._check_gear("ring", self.ring_teeth, sign=-1)

    @property
    def driven(self) -> str:
        """The member on the stage's output shaft."""
        return next(member for member in MEMBERS if member not in (self.fixed, self.driving))

    @property
    def on_shafts(self) -> tuple[str, str]:
        """The members on the stage's input and output shafts."""
        return self.driving, self.driven

    @property
    def tooth_deviation(self) -> int:
        """Teeth by which the ring departs from sun + 2 planet."""
        return self.ring_teeth - self.sun_teeth - 2 * self.planet_teeth

    @property
    def equally_spaced(self) -> bool:
        """Whether the planets can sit at equal angles: sun + ring is divisible by their number."""
        return (self.sun_teeth + self.ring_teeth) % self.planets == 0

    @property
    def notes(self) -> tuple[str, ...]:
        """What is unusual about the teeth, in words."""
        notes, more = [], self.tooth_deviation
        if more:
            told = f"{abs(more)} {'more' if more > 0 else 'less'} than sun + 2 planet"
            notes.append(
                f"ring_teeth = {self.ring_teeth} is {told}: possible with profile shift only"
            )
        if not self.equally_spaced:
            notes.append(
                f"sun + ring = {self.sun_teeth + self.ring_teeth} teeth is not divisible by "
                f"{self.planets} planets: they cannot be equally spaced"
            )
        return tuple(notes)
