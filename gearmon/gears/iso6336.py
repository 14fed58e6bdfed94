"""Tooth and mesh stiffness, reduced mass and resonance speed by ISO 6336-1 Method B."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.gears.geometry import GearTeeth

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


@dataclass(frozen=True, kw_only=True)
class Body:
    """Web and rim of a gear that is no solid disc.

    Parameters
    ----------
    web_ratio : float
        b_s/b, web over face width; used within 0.2 to 1.2.
    rim_factor : float
        s_R/m_n, rim thickness in modules; used from 1 on.
    """

    web_ratio: float
    rim_factor: float

    def __post_init__(self) -> None:
        check_positive("web_ratio", self.web_ratio)
        check_positive("rim_factor", self.rim_factor)

    @property
    def factor(self) -> float:
        """C_R = 1 + ln(b_s/b)/(5 exp(s_R/(5 m_n)))."""
        web = min(max(self.web_ratio, WEB_RATIOS[0]), WEB_RATIOS[1])
        return 1 + math.log(web) / (5 * math.exp(max(self.rim_factor, LEAST_RIM) / 5))

    @property
    def limits(self) -> Iterator[str]:
        """What lies outside the range of C_R, in words."""
        low, high = WEB_RATIOS
        if not low <= self.web_ratio <= high:
            told = f"web ratio b_s/b = {self.web_ratio:.4g} is outside {low} ... {high}"
            yield f"{told}: the nearer end is used"
        if self.rim_factor < LEAST_RIM:
            yield f"rim s_R/m_n = {self.rim_factor:.4g} is below 1: 1 is used"


@dataclass(frozen=True, kw_only=True)
class Resonance:
    """Main resonance of a pair by ISO 6336-1 Method B.

    Parameters
    ----------
    gear : str
        Name of gear 1, the one with fewer teeth, whose speed is meant.
    reduced_mass_kg_per_m : float
        m_red, per face width.
    speed_rpm : float
        n_E1, the speed of gear 1 whose mesh frequency is the natural frequency.
    margin : float
        N_S: the main resonance range begins at this share of n_E1.
    """

    gear: str
    reduced_mass_kg_per_m: float
    speed_rpm: float
    margin: float


@dataclass(frozen=True, kw_only=True)
class MethodB:
    """Result of ISO 6336-1 Method B; stiffnesses in N/(mm um) as in the standard.

    Parameters
    ----------
    theoretical : float
        c'_th, of one pair, from the polynomial [N/(mm um)].
    correction, blank, rack : float
        Factors C_M, C_R, C_B.
    load : float
        Factor of the low-load branch; 1 from 100 N/mm on.
    single : float
        c': greatest stiffness of one pair [N/(mm um)].
    contact_ratio : float
        eps_alpha with which the next was made.
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
    correction: float
    blank: float
    rack: float
    load: float
    single: float
    contact_ratio: float
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
    web: Body | None = None,
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
    web : Body, optional
        Of the more flexible gear: the factor of the standard is meant for mates that are equal or
        stiffer. Both are taken as solid when not given.
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
    first, second = _ordered(one, other)
    check_positive("contact_ratio", contact_ratio)
    base = math.asin(math.sin(helix_angle_rad) * math.cos(pressure_angle_rad))
    share = math.cos(base) ** 2 * math.cos(helix_angle_rad)
    virtual = first.teeth / share, math.inf if second.internal else second.teeth / share
    theoretical = _theoretical(first, second, virtual)
    angle = 1 - 0.02 * (20 - math.degrees(pressure_angle_rad))
    rack = 0.5 * sum((1 + 0.5 * (1.2 - gear.root_factor)) * angle for gear in (first, second))
    blank = 1.0 if web is None else web.factor
    load = _load_factor(load_n_per_mm)
    moduli = first.elastic_modulus_pa, second.elastic_modulus_pa
    check_positive("elastic_modulus_pa", min(moduli), "Pa")
    modulus = 2 * math.prod(moduli) / sum(moduli) / MODULUS_STEEL_PA
    single = theoretical * CORRECTION_MEASURED * blank * rack * math.cos(helix_angle_rad) * modulus
    single *= load
    mesh = single * (0.75 * contact_ratio + 0.25)
    limits = [*_limits(first, second, contact_ratio, helix_angle_rad, load_n_per_mm)]
    limits += web.limits if web else ()
    return MethodB(
        theoretical=theoretical,
        correction=CORRECTION_MEASURED,
        blank=blank,
        rack=rack,
        load=load,
        single=single,
        contact_ratio=contact_ratio,
        mesh_alpha=mesh,
        mesh_beta=0.85 * mesh,
        virtual_teeth=virtual,
        warnings=tuple(f"{METHOD}: {note}" for note in limits),
    )


def reduced_mass_per_width(
    teeth: tuple[int, int],
    mean_diameters_m: tuple[float, float],
    base_diameter_m: float,
    bores_m: tuple[float, float] = (0.0, 0.0),
    densities_kgm3: tuple[float, float] = (7850.0, 7850.0),
) -> float:
    """Return m_red, the mass per face width [kg/m] of a pair reduced to the line of action.

    Parameters
    ----------
    teeth : (int, int)
        Fewer teeth first.
    mean_diameters_m : (float, float)
        d_m = (d_a + d_f)/2 [m].
    base_diameter_m : float
        d_b1, of gear 1 [m].
    bores_m : (float, float)
        Inner diameters d_i of rim or body [m].
    densities_kgm3 : (float, float)
        [kg/m3]

    Notes
    -----
    ``m_red = (pi/8)(d_m1/d_b1)^2 d_m1^2/[1/((1-q1^4) rho1) + 1/((1-q2^4) rho2 u^2)]``,
    q = d_i/d_m, u = z2/z1: the standard sets d_m2/d_m1 = u. 1 kg/mm = 1000 kg/m.
    """
    dm1, dm2 = mean_diameters_m
    ratio = teeth[1] / teeth[0]
    full = [1 - (bore / dm) ** 4 for bore, dm in zip(bores_m, (dm1, dm2), strict=True)]
    for bore, share in zip(bores_m, full, strict=True):
        if share <= 0:
            raise ArgumentError(f"bore of {bore} m must be less than the mean diameter")
    compliance = 1 / (full[0] * densities_kgm3[0]) + 1 / (full[1] * densities_kgm3[1] * ratio**2)
    return math.pi / 8 * (dm1 / base_diameter_m) ** 2 * dm1**2 / compliance


def resonance_speed_rpm(teeth: int, mesh_alpha: float, reduced_mass_kg_per_m: float) -> float:
    """Return n_E1, the speed of gear 1 [1/min] whose mesh frequency is the natural frequency.

    Parameters
    ----------
    teeth : int
        Of gear 1.
    mesh_alpha : float
        c_gamma_alpha [N/(mm um)].
    reduced_mass_kg_per_m : float
        m_red per face width [kg/m].

    Examples
    --------
    >>> round(resonance_speed_rpm(25, 17.21, 7.4))
    18421
    """
    check_positive("reduced_mass_kg_per_m", reduced_mass_kg_per_m, "kg/m")
    return 30 / (math.pi * teeth) * math.sqrt(mesh_alpha * N_PER_MM_UM / reduced_mass_kg_per_m)


def resonance_margin(load_n_per_mm: float) -> float:
    """Return N_S, the lower end of the main resonance range in units of the resonance speed.

    Examples
    --------
    >>> resonance_margin(25.0), resonance_margin(150.0)
    (0.675, 0.85)
    """
    check_range("load_n_per_mm", load_n_per_mm, 0, 1e9, "N/mm")
    if load_n_per_mm >= LOW_LOAD_N_PER_MM:
        return 0.85
    return 0.5 + 0.35 * math.sqrt(load_n_per_mm / LOW_LOAD_N_PER_MM)


def _ordered(one: GearTeeth, other: GearTeeth) -> tuple[GearTeeth, GearTeeth]:
    if one.internal and other.internal:
        raise ArgumentError("internal gears do not mesh with each other: one must be external")
    # equal teeth: the standard's range has x1 >= x2
    ranks = [
        (own.internal, own.teeth, -own.profile_shift, own.root_factor, own.elastic_modulus_pa)
        for own in (one, other)
    ]
    return (other, one) if ranks[1] < ranks[0] else (one, other)


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


def _load_factor(load_n_per_mm: float | None) -> float:
    if load_n_per_mm is None or load_n_per_mm >= LOW_LOAD_N_PER_MM:
        return 1.0
    check_positive("load_n_per_mm", load_n_per_mm, "N/mm")
    return math.sqrt(math.sqrt(load_n_per_mm / LOW_LOAD_N_PER_MM))


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
