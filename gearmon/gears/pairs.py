"""The pairs of gears in a stage of a machine: what is known of each, and its ISO 6336 stiffness.

A parallel stage has one pair. A planetary stage has two kinds of pair, each once per planet:
sun and planet, planet and ring. Stages carry engineering units; from here on all is SI, but for the
stiffness by ISO 6336-1 Method B, told in units of the standard.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial

from gearmon.errors import ArgumentError, check_positive, check_word
from gearmon.gears.geometry import GearTeeth, PairGeometry, pair_geometry
from gearmon.machine import ParallelStage, PlanetaryStage

#: What warnings begin with.
METHOD = "ISO 6336-1 Method B"
#: Correction of the theoretical stiffness for solid disc gears.
CORRECTION_MEASURED = 0.8
#: Young's modulus of the steel for which the polynomial was made [Pa].
MODULUS_STEEL_PA = 206e9
#: Specific load below which the stiffness falls [N/mm].
LOW_LOAD_N_PER_MM = 100.0
#: Range of b_s/b, and least s_R/m_n, that the blank factor knows.
WEB_RATIOS = (0.2, 1.2)
LEAST_RIM = 1.0
#: 1 N/(mm um) in N/m2: stiffness per face width.
N_PER_MM_UM = 1e9
Stage = ParallelStage | PlanetaryStage


def blank_factor(web_ratio: float, rim_factor: float) -> tuple[float, list[str]]:
    """Return C_R of a gear that is no solid disc, and what lies outside its range, in words.

    Parameters
    ----------
    web_ratio : float
        b_s/b, web over face width; used within 0.2 to 1.2.
    rim_factor : float
        s_R/m_n, rim thickness in modules; used from 1 on.

    Notes
    -----
    ``C_R = 1 + ln(b_s/b)/(5 exp(s_R/(5 m_n)))``.
    """
    check_positive("web_ratio", web_ratio)
    check_positive("rim_factor", rim_factor)
    (low, high), notes = WEB_RATIOS, []
    if not low <= web_ratio <= high:
        told = f"web ratio b_s/b = {web_ratio:.4g} is outside {low} ... {high}"
        notes.append(f"{told}: the nearer end is used")
    if rim_factor < LEAST_RIM:
        notes.append(f"rim s_R/m_n = {rim_factor:.4g} is below 1: 1 is used")
    web, rim = min(max(web_ratio, low), high), max(rim_factor, LEAST_RIM)
    return 1 + math.log(web) / (5 * math.exp(rim / 5)), notes


@dataclass(frozen=True, kw_only=True)
class MethodB:
    """Result of ISO 6336-1 Method B; stiffnesses in N/(mm um) as in the standard.

    Parameters
    ----------
    theoretical : float
        c'_th, of one pair, from the polynomial [N/(mm um)].
    blank, rack : float
        Factors C_R, C_B; C_M is 0.8.
    load : float
        Factor of the low-load branch; 1 from 100 N/mm on.
    single : float
        c': greatest stiffness of one pair [N/(mm um)].
    mesh_alpha : float
        c_gamma_alpha: mean stiffness of the mesh [N/(mm um)].
    mesh_beta : float
        c_gamma_beta = 0.85 c_gamma_alpha [N/(mm um)].
    virtual_teeth : (float, float)
        z_n of the gear with fewer teeth and of its mate (infinite for a ring).
    warnings : tuple of str
        Limits of validity that are left.
    """

    theoretical: float
    blank: float
    rack: float
    load: float
    single: float
    mesh_alpha: float
    mesh_beta: float
    virtual_teeth: tuple[float, float]
    warnings: tuple[str, ...] = ()

    def mean_n_per_m(self, face_width_m: float) -> float:
        """Return the mean mesh stiffness c_gamma_alpha b [N/m]."""
        return self.mesh_alpha * N_PER_MM_UM * face_width_m

    def single_n_per_m(self, face_width_m: float) -> float:
        """Return the greatest stiffness of one pair c' b [N/m]."""
        return self.single * N_PER_MM_UM * face_width_m


def method_b(
    one: GearTeeth,
    other: GearTeeth,
    *,
    contact_ratio: float,
    pressure_angle_rad: float = math.radians(20),
    helix_angle_rad: float = 0.0,
    web: tuple[float, float] | None = None,
    load_n_per_mm: float | None = None,
) -> MethodB:
    """Return tooth-pair and mesh stiffness by ISO 6336-1 Method B.

    Parameters
    ----------
    one, other : GearTeeth
        In any order: the standard's index 1 is the gear with fewer teeth.
    contact_ratio : float
        Transverse contact ratio eps_alpha.
    pressure_angle_rad : float
        Normal pressure angle of the basic rack [rad].
    helix_angle_rad : float
        Helix angle at the reference circle [rad].
    web : (float, float), optional
        b_s/b and s_R/m_n, see `blank_factor`, of the more flexible gear: the factor of the standard
        is meant for mates that are equal or stiffer. Both are taken as solid when not given.
    load_n_per_mm : float, optional
        Tangential load per face width F_t K_A/b [N/mm]; without it the branch for at least
        100 N/mm is taken.

    Returns
    -------
    MethodB

    Raises
    ------
    ArgumentError
        If data are impossible, or two rings are paired.

    Notes
    -----
    ``1/c'_th = 0.04723 + 0.15551/z_n1 + 0.25791/z_n2 - 0.00635 x1 - 0.11654 x1/z_n1 - 0.00193 x2
    - 0.24188 x2/z_n2 + 0.00529 x1^2 + 0.00182 x2^2`` with 1/z_n2 = 0 for a ring;
    ``c' = c'_th C_M C_R C_B cos(beta) E/E_steel``, ``c_gamma_alpha = c'(0.75 eps_alpha + 0.25)``,
    and c' times (load/100)^0.25 below 100 N/mm. For spur gears with eps_alpha < 1.2 the true
    value may be up to 10 % lower; nothing is taken off.

    References
    ----------
    ISO 6336-1:2006, clause 9.

    Examples
    --------
    >>> from gearmon.gears.geometry import GearTeeth
    >>> b = method_b(GearTeeth(teeth=26), GearTeeth(teeth=53), contact_ratio=1.412)
    >>> round(b.single, 5), round(b.mesh_alpha, 4)
    (13.43036, 17.5803)
    """
    if one.internal and other.internal:
        raise ArgumentError("internal gears do not mesh with each other: one must be external")
    # of equal teeth: the standard's range has x1 >= x2
    first, second = sorted(
        (one, other), key=lambda own: (own.internal, own.teeth, -own.profile_shift)
    )
    check_positive("contact_ratio", contact_ratio)
    base = math.asin(math.sin(helix_angle_rad) * math.cos(pressure_angle_rad))
    share = math.cos(base) ** 2 * math.cos(helix_angle_rad)
    virtual = first.teeth / share, math.inf if second.internal else second.teeth / share
    theoretical = _theoretical(first, second, virtual)
    angle = 1 - 0.02 * (20 - math.degrees(pressure_angle_rad))
    rack = 0.5 * sum((1 + 0.5 * (1.2 - gear.root_factor)) * angle for gear in (first, second))
    blank, beyond = (1.0, []) if web is None else blank_factor(*web)
    load = 1.0
    if load_n_per_mm is not None:
        low = check_positive("load_n_per_mm", load_n_per_mm, "N/mm") / LOW_LOAD_N_PER_MM
        load = math.sqrt(math.sqrt(min(1.0, low)))
    moduli = first.elastic_modulus_pa, second.elastic_modulus_pa
    check_positive("elastic_modulus_pa", min(moduli), "Pa")
    modulus = 2 * math.prod(moduli) / sum(moduli) / MODULUS_STEEL_PA
    single = theoretical * CORRECTION_MEASURED * blank * rack * math.cos(helix_angle_rad) * modulus
    single *= load
    mesh = single * (0.75 * contact_ratio + 0.25)
    limits = [*_limits(first, second, contact_ratio, helix_angle_rad, load_n_per_mm), *beyond]
    return MethodB(
        theoretical=theoretical,
        blank=blank,
        rack=rack,
        load=load,
        single=single,
        mesh_alpha=mesh,
        mesh_beta=0.85 * mesh,
        virtual_teeth=virtual,
        warnings=tuple(f"{METHOD}: {note}" for note in limits),
    )


def _theoretical(first: GearTeeth, second: GearTeeth, virtual: tuple[float, float]) -> float:
    x1, x2 = first.profile_shift, second.profile_shift
    r1, r2 = 1 / virtual[0], 1 / virtual[1]
    compliance = 0.04723 + 0.15551 * r1 + 0.25791 * r2 - 0.00635 * x1 - 0.11654 * x1 * r1
    compliance += -0.00193 * x2 - 0.24188 * x2 * r2 + 0.00529 * x1**2 + 0.00182 * x2**2
    if compliance <= 0:
        raise ArgumentError(
            f"profile shifts {x1:g} and {x2:g} lie far outside the range of the stiffness "
            f"polynomial, -0.5 <= x1 + x2 <= 2"
        )
    return 1 / compliance


def _limits(
    first: GearTeeth, second: GearTeeth, eps: float, beta: float, load: float | None
) -> Iterator[str]:
    x1, x2 = first.profile_shift, second.profile_shift
    if abs(math.degrees(beta)) > 30:
        yield f"helix angle {abs(math.degrees(beta)):.4g} deg is above 30 deg"
    if eps < 1.2:
        spur = "up to 10 % less stiff" if beta == 0 else "not covered"
        yield f"contact ratio {eps:.4g} is below 1.2: {spur}"
    if x1 < x2 and not second.internal:
        yield f"profile shift {x1:g} of the smaller gear is below {x2:g} of the larger"
    if not -0.5 <= x1 + x2 <= 2:
        yield f"sum of profile shifts {x1 + x2:g} is outside -0.5 ... 2"
    if load is not None and load < LOW_LOAD_N_PER_MM:
        yield f"load {load:.4g} N/mm is below 100 N/mm: low-load branch"
    if load is not None and load > 1600:
        yield f"load {load:.4g} N/mm is above 1600 N/mm"


@dataclass(frozen=True, kw_only=True)
class MeshPair:
    """A pair of gears in mesh and the stage that it belongs to.

    Parameters
    ----------
    first, second : GearTeeth
        The first is taken to drive; a ring is always second.
    stage : ParallelStage or PlanetaryStage
    number : int or None
        Number of the stage for messages, counted from 1.
    path : str
        Machine file for messages.
    planets : int
        How many such pairs work side by side.
    inner : MeshPair or None
        The sun-planet pair of a planet-ring pair, which sets its centre distance and the tips of
        the planet.
    """

    first: GearTeeth
    second: GearTeeth
    stage: Stage
    number: int | None = None
    path: str = ""
    planets: int = 1
    inner: MeshPair | None = None

    @property
    def name(self) -> str:
        """Name of the mesh, such as "pinion-gear" or "planet-ring"."""
        return "-".join(self.names)

    @property
    def members(self) -> tuple[GearTeeth, GearTeeth]:
        """Both gears."""
        return self.first, self.second

    @property
    def names(self) -> tuple[str, str]:
        """Names of both gears."""
        return self.first.name, self.second.name

    @property
    def teeth(self) -> tuple[int, int]:
        """Numbers of teeth of both gears."""
        return self.first.teeth, self.second.teeth

    @property
    def is_main(self) -> bool:
        """Whether the overrides of the stage are meant for this pair (not for planet-ring)."""
        return not self.second.internal

    @property
    def where(self) -> str:
        """Name of the stage in messages."""
        stage = "[[stage]]" if self.number is None else f"[[stage]] {self.number}"
        return f"{self.path}: {stage}" if self.path else stage

    def member(self, name: str) -> GearTeeth:
        """Return the gear of this name.

        Raises
        ------
        ArgumentError
            If the pair has no such gear.
        """
        check_word(f"{self.where}: gear of this mesh ", name, self.names)
        return self.members[self.names.index(name)]

    def need(self, key: str, purpose: str, instead: str = "") -> float:
        """Return a value of the stage that must have been given.

        Parameters
        ----------
        key : str
            Of the stage.
        purpose, instead : str
            For the message: what needs the value, and the override that would do.

        Raises
        ------
        ArgumentError
            If it was not, with the key to add or the override that replaces it.
        """
        value = getattr(self.stage, key)
        if value is None:
            other = f", or {instead} in its place" if instead else ""
            raise ArgumentError(
                f"{self.where}: {key} is missing: the {purpose} needs it; add {key}{other}"
            )
        return float(value)

    def given(self, key: str) -> float | None:
        """Return an override of the stage if it is given and meant for this pair."""
        own = key if self.is_main else f"ring_{key}"
        value = getattr(self.stage, own, None)
        return None if value is None else float(value)

    @property
    def helix_angle_rad(self) -> float:
        """Magnitude of the helix angle [rad]."""
        return math.radians(abs(self.stage.helix_angle_deg))

    @property
    def pressure_angle_rad(self) -> float:
        """Normal pressure angle [rad]."""
        return math.radians(self.stage.pressure_angle_deg)

    @cached_property
    def contact_ratio(self) -> float:
        """Transverse contact ratio: the override, or that of the geometry."""
        known = self.given("contact_ratio")
        return self.geometry.transverse_contact_ratio if known is None else known

    @cached_property
    def overlap_ratio(self) -> float:
        """Overlap ratio eps_beta; 0 for spur gears."""
        if self.helix_angle_rad == 0:
            return 0.0
        self.need("module_mm", "overlap ratio")
        self.need("face_width_mm", "overlap ratio")
        return self.geometry.overlap_ratio

    @property
    def pitch_phase(self) -> float:
        """Mesh periods from entry to the pitch point; mid-contact where no geometry is known."""
        if self.given("contact_ratio") is not None:
            return 0.5 * self.contact_ratio
        return self.geometry.pitch_point_phase

    @property
    def base_radii_m(self) -> tuple[float, float]:
        """Base radii [m]."""
        self.need("module_mm", "base circle", "force_n and equivalent_mass_kg")
        return self.geometry.base_radii_m

    def method_b(self, force_n: float | None = None) -> MethodB:
        """Return the stiffness by ISO 6336-1 Method B.

        Parameters
        ----------
        force_n : float, optional
            Static force on the line of action [N]; below 100 N/mm the stiffness falls.
        """
        # b_s/b and s_R/m_n of gears that are no solid discs, of which the more flexible one counts
        webs = []
        for own in self.members:
            if own.web_m is not None and own.rim_m is not None:
                width = 1e-3 * self.need("face_width_mm", "web factor")
                module = 1e-3 * self.need("module_mm", "web factor")
                webs.append((own.web_m / width, own.rim_m / module))
        return method_b(
            *self.members,
            contact_ratio=self.contact_ratio,
            pressure_angle_rad=self.pressure_angle_rad,
            helix_angle_rad=self.helix_angle_rad,
            web=min(webs, key=lambda web: blank_factor(*web)[0], default=None),
            load_n_per_mm=self.specific_load(force_n),
        )

    def specific_load(self, force_n: float | None) -> float | None:
        """Return F_t K_A/b [N/mm] with F_t at the reference circle; None where it is not known.

        Parameters
        ----------
        force_n : float or None
            Static force on the line of action [N].
        """
        if force_n is None or self.stage.face_width_mm is None:
            return None
        tangential = force_n * math.cos(self.stage.transverse_pressure_angle_rad)
        return tangential * self.stage.application_factor / self.stage.face_width_mm

    @cached_property
    def geometry(self) -> PairGeometry:
        """Circles of the pair, which must be able to run where its contact ratio is not given.

        Raises
        ------
        ArgumentError
            If data are missing, or the pair cannot run.
        """
        instead = "contact_ratio" if self.is_main else ""
        module = 1e-3 * self.need("module_mm", "contact ratio", instead)
        first, distance = self.first, _length(self.stage, "centre_distance_mm")
        if self.inner is not None:
            # the planet is one body on one axis, which its mesh with the sun has placed
            inner = self.inner.geometry
            first = replace(first, tip_shortening=inner.gears[1].tip_shortening)
            distance = inner.centre_distance_m
        try:
            return pair_geometry(
                first,
                self.second,
                module_m=module,
                pressure_angle_rad=self.pressure_angle_rad,
                helix_angle_rad=self.helix_angle_rad,
                face_width_m=_length(self.stage, "face_width_mm"),
                centre_distance_m=distance,
                check=self.given("contact_ratio") is None,
            )
        except ArgumentError as error:
            raise ArgumentError(f"{self.where}: {error}") from None


# the faults of a family all ask for the same pair, and share what it works out
@lru_cache(maxsize=64)
def mesh_pairs(stage: Stage, number: int | None = None, path: str = "") -> tuple[MeshPair, ...]:
    """Return the pairs of a stage: one, or sun-planet and planet-ring.

    Parameters
    ----------
    stage : ParallelStage or PlanetaryStage
    number : int, optional
        Number of the stage for messages, counted from 1.
    path : str
        Machine file for messages.

    Returns
    -------
    tuple of MeshPair
    """
    made = partial(MeshPair, stage=stage, number=number, path=path)
    if isinstance(stage, ParallelStage):
        return (made(first=_member(stage, "pinion"), second=_member(stage, "gear")),)
    sun, planet, ring = (_member(stage, name) for name in ("sun", "planet", "ring"))
    inner = made(first=sun, second=planet, planets=stage.planets)
    return inner, replace(inner, first=planet, second=ring, inner=inner)


def _member(stage: Stage, name: str) -> GearTeeth:
    shift, ring = getattr(stage, f"profile_shift_{name}"), name == "ring"
    addendum, dedendum = (getattr(stage, f"{part}_factor_{name}") for part in ("tip", "root"))
    # the tips of a ring are cut back only where it tells how far they reach
    shortening = None if ring else stage.tip_shortening
    tip, root = (_above_reference(stage, name, part) for part in ("tip", "root"))
    return GearTeeth(
        teeth=getattr(stage, f"{name}_teeth"),
        profile_shift=shift,
        tip_factor=addendum,
        root_factor=dedendum if root is None else shift - root,
        name=name,
        internal=ring,
        elastic_modulus_pa=getattr(stage, f"elastic_modulus_{name}_pa"),
        bore_m=_length(stage, f"bore_diameter_{name}_mm") or 0.0,
        tip_shortening=shortening if tip is None else tip - addendum - shift,
        web_m=_length(stage, f"web_width_{name}_mm"),
        rim_m=_length(stage, f"rim_thickness_{name}_mm"),
    )


def _length(stage: Stage, key: str) -> float | None:
    """Return a length of the stage in metres, None where it is not given or no key at all."""
    value = getattr(stage, key, None)
    return None if value is None else 1e-3 * float(value)


def _above_reference(stage: Stage, name: str, circle: str) -> float | None:
    """Return how far a circle lies from the reference circle towards the tips, if it is given.

    In modules; `circle` is "tip" or "root".
    """
    diameter = getattr(stage, f"{circle}_diameter_{name}_mm")
    if diameter is None or stage.module_mm is None:
        return None
    reference = getattr(stage, f"{name}_teeth") * stage.module_mm
    reference /= math.cos(math.radians(stage.helix_angle_deg))
    return float((diameter - reference) / (2 * stage.module_mm) * (-1 if name == "ring" else 1))
