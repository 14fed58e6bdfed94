"""Gear stages: what turns what, with which teeth, and the data that a baseline needs."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

from gearmon.machine.fields import Choice, Count, FieldError, Number, Text, check_fields, obeys

MEMBERS = ("sun", "ring", "carrier")
LARGEST_TOOTH_DEVIATION = 3

_TEETH = Count(low=5, high=2000, why="the range of cylindrical gears", example="26")
_SHIFT = Number(low=-3, high=3, why="the profile shift coefficient is a multiple of the module")
_TIP = Number(low=0.3, high=2.0, why="the addendum is 1.0 modules in standard teeth")
_ROOT = Number(low=0.5, high=2.5, why="the dedendum of the basic rack is about 1.25 modules")
_BORE = Number(low=0, high=20_000, unit="mm", open_low=True, why="leave it out for a solid disc")
_MODULUS = Number(low=1e8, high=1e12, unit="Pa", why="steel has 206e9 Pa")


@dataclass(frozen=True, kw_only=True)
class _Stage:
    """Data that parallel and planetary stages have in common; all of it optional for analysis."""

    name: str = field(default="", metadata=obeys(Text(example='"first reduction"')))
    module_mm: float | None = field(
        default=None,
        metadata=obeys(Number(low=0.02, high=200, unit="mm", why="the normal module")),
    )
    pressure_angle_deg: float = field(
        default=20.0,
        metadata=obeys(Number(low=10, high=35, unit="deg", why="of the basic rack, mostly 20")),
    )
    helix_angle_deg: float = field(
        default=0.0,
        metadata=obeys(
            Number(low=-45, high=45, unit="deg", open_low=True, open_high=True, why="0 for spur")
        ),
    )
    face_width_mm: float | None = field(
        default=None,
        metadata=obeys(Number(low=0.1, high=5000, unit="mm", why="the common face width")),
    )
    centre_distance_mm: float | None = field(
        default=None,
        metadata=obeys(Number(low=0.1, high=20_000, unit="mm", why="the working centre distance")),
    )
    poisson_ratio: float = field(
        default=0.3, metadata=obeys(Number(low=0, high=0.5, open_high=True, why="steel has 0.3"))
    )
    density_kgm3: float = field(
        default=7850.0,
        metadata=obeys(Number(low=500, high=25_000, unit="kg/m3", why="steel has 7850")),
    )
    damping_ratio: float | None = field(
        default=None,
        metadata=obeys(Number(low=0, high=5, open_low=True, why="commonly 0.03 to 0.17")),
    )
    mesh_stiffness_n_per_m: float | None = field(
        default=None,
        metadata=obeys(Number(low=1e3, high=1e13, unit="N/m", why="the mean mesh stiffness")),
    )
    stiffness_variation: float | None = field(
        default=None,
        metadata=obeys(Number(low=0, high=1, open_high=True, why="relative to the mean stiffness")),
    )
    equivalent_mass_kg: float | None = field(
        default=None, metadata=obeys(Number(low=0, high=1e6, unit="kg", open_low=True))
    )
    damping_ns_per_m: float | None = field(
        default=None, metadata=obeys(Number(low=0, high=1e10, unit="Ns/m", open_low=True))
    )
    contact_ratio: float | None = field(
        default=None,
        metadata=obeys(Number(low=0.5, high=6, why="the transverse contact ratio")),
    )
    force_n: float | None = field(
        default=None,
        metadata=obeys(Number(low=0, high=1e10, unit="N", open_low=True, why="static tooth force")),
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

    def _check_bore(self, member: str, teeth: int, shift: float, root_factor: float) -> None:
        """Refuse a bore that reaches the tooth roots."""
        key = f"bore_diameter_{member}_mm"
        bore: float | None = getattr(self, key)
        if self.module_mm is None or bore is None:
            return
        reference = teeth / math.cos(math.radians(self.helix_angle_deg))
        root = self.module_mm * (reference - 2 * (root_factor - shift))
        if bore >= root:
            raise FieldError(key, f"must be less than the root diameter, {root:.5g} mm", bore)


@dataclass(frozen=True, kw_only=True)
class ParallelStage(_Stage):
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
    bore_diameter_pinion_mm, bore_diameter_gear_mm : float, optional
        Bore, or diameter at which the body sits on its shaft [mm].
    elastic_modulus_pinion_pa, elastic_modulus_gear_pa : float
        Young's moduli [Pa].
    poisson_ratio : float, 0 to below 0.5
        Poisson's ratio of both gears.
    density_kgm3 : float
        Density of both gears [kg/m3].
    damping_ratio : float, optional
        Damping ratio of the mesh, c / (2 sqrt(k m)).
    mesh_stiffness_n_per_m, stiffness_variation, equivalent_mass_kg, damping_ns_per_m, \
contact_ratio, force_n : float, optional
        Known values that replace what is otherwise computed: mean mesh stiffness [N/m], half the
        swing of the stiffness over its mean, equivalent mass on the line of action [kg], mesh
        damping [Ns/m] (goes before `damping_ratio`), transverse contact ratio, static force on
        the line of action [N].

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

    pinion_teeth: int = field(metadata=obeys(_TEETH))
    gear_teeth: int = field(metadata=obeys(_TEETH))
    profile_shift_pinion: float = field(default=0.0, metadata=obeys(_SHIFT))
    profile_shift_gear: float = field(default=0.0, metadata=obeys(_SHIFT))
    tip_factor_pinion: float = field(default=1.0, metadata=obeys(_TIP))
    tip_factor_gear: float = field(default=1.0, metadata=obeys(_TIP))
    root_factor_pinion: float = field(default=1.25, metadata=obeys(_ROOT))
    root_factor_gear: float = field(default=1.25, metadata=obeys(_ROOT))
    bore_diameter_pinion_mm: float | None = field(default=None, metadata=obeys(_BORE))
    bore_diameter_gear_mm: float | None = field(default=None, metadata=obeys(_BORE))
    elastic_modulus_pinion_pa: float = field(default=206e9, metadata=obeys(_MODULUS))
    elastic_modulus_gear_pa: float = field(default=206e9, metadata=obeys(_MODULUS))

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_centre_distance(self.pinion_teeth + self.gear_teeth)
        self._check_bore(
            "pinion", self.pinion_teeth, self.profile_shift_pinion, self.root_factor_pinion
        )
        self._check_bore("gear", self.gear_teeth, self.profile_shift_gear, self.root_factor_gear)


@dataclass(frozen=True, kw_only=True)
class PlanetaryStage(_Stage):
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
density_kgm3, damping_ratio
        As for `ParallelStage`.
    profile_shift_sun, profile_shift_planet, profile_shift_ring : float
        Profile shift coefficients x, in modules.
    centre_distance_mm : float, optional
        Working distance from the axis of the sun to the axis of a planet [mm].
    tip_factor_sun, tip_factor_planet, tip_factor_ring : float
        Addendum factors h_a*, in modules.
    root_factor_sun, root_factor_planet, root_factor_ring : float
        Dedendum factors of the basic rack h_fP*, in modules.
    bore_diameter_sun_mm, bore_diameter_planet_mm : float, optional
        Bores [mm].
    elastic_modulus_sun_pa, elastic_modulus_planet_pa, elastic_modulus_ring_pa : float
        Young's moduli [Pa].
    mesh_stiffness_n_per_m, stiffness_variation, equivalent_mass_kg, damping_ns_per_m, \
contact_ratio, force_n : float, optional
        Known values that replace what is otherwise computed, each for one sun-planet mesh.

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

    sun_teeth: int = field(metadata=obeys(_TEETH))
    planet_teeth: int = field(metadata=obeys(_TEETH))
    ring_teeth: int = field(metadata=obeys(_TEETH))
    planets: int = field(metadata=obeys(Count(low=1, high=30, example="3")))
    fixed: str = field(default="ring", metadata=obeys(Choice(options=MEMBERS)))
    driving: str = field(default="", metadata=obeys(Choice(options=MEMBERS)))
    profile_shift_sun: float = field(default=0.0, metadata=obeys(_SHIFT))
    profile_shift_planet: float = field(default=0.0, metadata=obeys(_SHIFT))
    profile_shift_ring: float = field(default=0.0, metadata=obeys(_SHIFT))
    tip_factor_sun: float = field(default=1.0, metadata=obeys(_TIP))
    tip_factor_planet: float = field(default=1.0, metadata=obeys(_TIP))
    tip_factor_ring: float = field(default=1.0, metadata=obeys(_TIP))
    root_factor_sun: float = field(default=1.25, metadata=obeys(_ROOT))
    root_factor_planet: float = field(default=1.25, metadata=obeys(_ROOT))
    root_factor_ring: float = field(default=1.25, metadata=obeys(_ROOT))
    bore_diameter_sun_mm: float | None = field(default=None, metadata=obeys(_BORE))
    bore_diameter_planet_mm: float | None = field(default=None, metadata=obeys(_BORE))
    elastic_modulus_sun_pa: float = field(default=206e9, metadata=obeys(_MODULUS))
    elastic_modulus_planet_pa: float = field(default=206e9, metadata=obeys(_MODULUS))
    elastic_modulus_ring_pa: float = field(default=206e9, metadata=obeys(_MODULUS))

    def __post_init__(self) -> None:
        super().__post_init__()
        self._settle_members()
        self._check_teeth()
        self._check_centre_distance(self.sun_teeth + self.planet_teeth)
        self._check_bore("sun", self.sun_teeth, self.profile_shift_sun, self.root_factor_sun)
        self._check_bore(
            "planet", self.planet_teeth, self.profile_shift_planet, self.root_factor_planet
        )

    @property
    def driven(self) -> str:
        """The member on the stage's output shaft."""
        return next(member for member in MEMBERS if member not in (self.fixed, self.driving))

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
        notes = []
        if self.tooth_deviation:
            notes.append(
                f"ring_teeth = {self.ring_teeth} is {abs(self.tooth_deviation)} "
                f"{'more' if self.tooth_deviation > 0 else 'less'} than sun + 2 planet: "
                "possible with profile shift only"
            )
        if not self.equally_spaced:
            notes.append(
                f"sun + ring = {self.sun_teeth + self.ring_teeth} teeth is not divisible by "
                f"{self.planets} planets: they cannot be equally spaced"
            )
        return tuple(notes)

    def _settle_members(self) -> None:
        if not self.driving:
            object.__setattr__(self, "driving", "carrier" if self.fixed == "sun" else "sun")
        if self.driving == self.fixed:
            reason = "is also the fixed member; name the member on the input shaft"
            raise FieldError("driving", reason, self.driving)

    def _check_teeth(self) -> None:
        if abs(self.tooth_deviation) > LARGEST_TOOTH_DEVIATION:
            matching = self.sun_teeth + 2 * self.planet_teeth
            reason = (
                f"must lie within {LARGEST_TOOTH_DEVIATION} teeth of sun + 2 planet = {matching} "
                "(stepped or double planets are not covered)"
            )
            raise FieldError("ring_teeth", reason, self.ring_teeth)
        # neighbours touch when the chord between their axes falls below their reference diameter
        chord = (self.sun_teeth + self.planet_teeth) * math.sin(math.pi / max(self.planets, 2))
        if chord < self.planet_teeth:
            reason = f"is more than fits: planets of {self.planet_teeth} teeth would overlap"
            raise FieldError("planets", reason, self.planets)
