"""Two teeth in contact: every compliance of the pair along its path of contact.

Bending, shear and compression of both teeth, the yielding of their bodies, and the flattening of
the flanks at their contact: a constant, or a form that depends on the load. `PotentialEnergy` is
the stiffness form that is computed from them.

References
----------
Yang & Sun, J. Mech. Transm. Autom. Des. 107 (1985) 529; Weber & Banaschek (1953).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from gearmon.arrays import FloatArray
from gearmon.errors import ArgumentError
from gearmon.gears.geometry import USUAL_RIM, PairGeometry, RackTooth, normal_section, told_of
from gearmon.gears.pairs import MeshPair
from gearmon.gears.tooth import ROOTS, Foundation, RingBody, Tooth, ToothBeam
from gearmon.gears.tooth_damage import LARGEST_WIDTH, ToothDamage
from gearmon.machine.fields import Checked, Choice, held

Beams = tuple[ToothBeam, ToothBeam]
Body = Foundation | RingBody
#: Name under which the form is chosen.
POTENTIAL_ENERGY = "potential-energy"
#: Radius on which a gear is held where no bore is given, over its reference radius. The beam
#: model then lies within 7 % of ISO 6336 for most pairs.
USUAL_BORE = 0.4
#: Root radius over bore radius within which the yielding of a body is used, see `_held_radius`.
HELD_RATIOS = (1.4, 3.5)


def hertz_compliance(
    width_m: FloatArray | float, moduli_pa: tuple[float, float], poisson_ratio: float
) -> FloatArray:
    """Return the load-independent compliance of a line contact [m/N].

    Parameters
    ----------
    width_m : array_like
        Length of the line of contact [m].
    moduli_pa : (float, float)
        Young's moduli of both gears [Pa].
    poisson_ratio : float

    Notes
    -----
    ``k_h = pi E b/(4 (1 - nu^2))`` for equal moduli; compliances of both bodies add up.

    Examples
    --------
    >>> round(1e-9 / float(hertz_compliance(0.02, (206e9, 206e9), 0.3)), 6)
    3.555869
    """
    one, two = moduli_pa
    plane = 2 * (1 - poisson_ratio**2) * (1 / one + 1 / two) / math.pi
    return np.asarray(plane / np.asarray(width_m))


def weber_banaschek_compliance(
    force_n: FloatArray,
    width_m: FloatArray | float,
    curvature_radius_m: FloatArray,
    depths_m: tuple[FloatArray, FloatArray],
    moduli_pa: tuple[float, float],
    poisson_ratio: float,
) -> FloatArray:
    """Return the secant compliance delta/F of a line contact under load [m/N].

    Parameters
    ----------
    force_n : ndarray, > 0
        Force on the contact [N].
    width_m : array_like
        Length of the line of contact [m].
    curvature_radius_m : ndarray
        Equivalent radius of curvature ``rho_1 rho_2/(rho_1 + rho_2)`` [m].
    depths_m : (ndarray, ndarray)
        Distance from the contact to the middle of each tooth, along the force [m].
    moduli_pa : (float, float)
    poisson_ratio : float

    Notes
    -----
    ``a = sqrt(8 w rho (1 - nu^2)/(pi E))``,
    ``delta = 4 (1 - nu^2) w/(pi E) [ln(2 sqrt(h1 h2)/a) - nu/(2 (1 - nu))]``, w = F/b; of unequal
    moduli the harmonic mean.
    """
    # 4 (1 - nu^2)/(pi E b), so that a^2 = 2 F rho times it
    flat = hertz_compliance(width_m, moduli_pa, poisson_ratio)
    half_width = np.sqrt(2 * force_n * curvature_radius_m * flat)
    bracket = np.log(2 * np.sqrt(depths_m[0] * depths_m[1]) / half_width)
    bracket -= poisson_ratio / (2 * (1 - poisson_ratio))
    # crushing loads flatten a contact as wide as the tooth, beyond what the form describes
    return np.asarray(flat * np.maximum(bracket, 0.25))


@dataclass(frozen=True, kw_only=True)
class PotentialEnergy(Checked):
    """Energy of both teeth, of their contact and of the bodies that carry them.

    Parameters
    ----------
    root : {"fillet", "straight", "base"}
        See `gears.tooth.Tooth`.
    contact : {"constant", "load-dependent"}
        Load-independent Hertz stiffness (Yang & Sun), or Weber & Banaschek's form.
    has_foundation : bool
        Whether the bodies of the gears yield.
    is_coupled : bool
        Whether neighbouring teeth feel each other through the bodies. The classical sum of the
        pairs counts each body twice and exaggerates the step from one pair to two by 24 to 40 %.

    Notes
    -----
    With C_i the compliance of pair i and C_ij what pairs i and j share, the pairs carry
    ``k = C^-1 (1, 1, ...)`` per unit of deflection; the mesh stiffness is the sum of k.
    """

    root: str = held(Choice(options=ROOTS), "fillet")
    contact: str = held(Choice(options=("constant", "load-dependent")), "constant")
    has_foundation: bool = True
    is_coupled: bool = True

    #: Name under which the form is chosen.
    name: ClassVar[str] = POTENTIAL_ENERGY


#: The form with its usual choices.
USUAL = PotentialEnergy()


@dataclass(frozen=True, eq=False)
class PairCompliance:
    """Compliances of a pair of teeth [m/N], for any number of contacts.

    Parameters
    ----------
    bending, shear, axial, foundation : ndarray, shape (2, ...)
        Of both teeth.
    hertz : ndarray, shape (...)
        Of their contact.
    """

    bending: FloatArray
    shear: FloatArray
    axial: FloatArray
    foundation: FloatArray
    hertz: FloatArray

    @property
    def total(self) -> FloatArray:
        """Compliance of the pair by itself [m/N]."""
        teeth = self.bending + self.shear + self.axial + self.foundation
        return np.asarray(teeth.sum(axis=0) + self.hertz)

    @property
    def stiffness(self) -> FloatArray:
        """Stiffness of the pair by itself [N/m]."""
        return np.asarray(1 / self.total)

    @property
    def shares(self) -> dict[str, FloatArray]:
        """Share of each cause in the compliance of the pair; they add up to 1."""
        causes = ("bending", "shear", "axial", "foundation")
        parts = {name: getattr(self, name).sum(axis=0) for name in causes}
        return {name: part / self.total for name, part in (parts | {"contact": self.hertz}).items()}


@dataclass(frozen=True, kw_only=True, eq=False)
class ToothPair:
    """A pair of meshing teeth along its path of contact.

    The teeth of helical gears are those of their normal section (see `geometry.normal_section`),
    and so are radii, roll lengths and heights; compliances are along the transverse line of action,
    with the whole face in contact. There a force F presses the flanks with F/cos(beta_b) and what
    they give way counts 1/cos(beta_b) times, on a contact of length b/cos(beta_b): in all
    ``k_t = k_n b cos(beta_b)`` with k_n per length of contact, where ISO 6336-1 has cos(beta).

    Parameters
    ----------
    first, second : Tooth
        The first drives.
    line_m : float
        Distance between the base tangent points along the line of action [m]; those of a ring and
        its planet lie on one side of the pitch point.
    path_m : (float, float)
        Roll lengths on the first gear at which contact begins and ends [m].
    base_pitch_m : float
        Roll length of a mesh period [m].
    base_helix_angle_rad : float
    form : PotentialEnergy
    notes : tuple of str
        What was assumed of the bodies.
    """

    first: Tooth
    second: Tooth
    line_m: float
    path_m: tuple[float, float]
    base_pitch_m: float
    base_helix_angle_rad: float = 0.0
    form: PotentialEnergy = USUAL
    notes: tuple[str, ...] = field(default=())

    @property
    def oblique(self) -> float:
        """1/cos(beta_b): by how much helical teeth are more compliant, see above."""
        return 1 / math.cos(self.base_helix_angle_rad)

    @property
    def teeth(self) -> tuple[Tooth, Tooth]:
        """Both teeth."""
        return self.first, self.second

    @property
    def contact_ratio(self) -> float:
        """Transverse contact ratio of the path."""
        return (self.path_m[1] - self.path_m[0]) / self.base_pitch_m

    @property
    def centres_m(self) -> tuple[float, float]:
        """Signed centre distance [m], negative for a ring, and working pressure angle [rad]."""
        base = self.first.base_radius_m + self.second.sign * self.second.base_radius_m
        centres = math.copysign(math.hypot(self.line_m, base), base)
        return centres, math.acos(base / centres)

    @cached_property
    def foundations(self) -> tuple[Body, Body]:
        """The bodies of both gears."""
        one, two = self.teeth
        return Foundation(tooth=one), (RingBody if two.internal else Foundation)(tooth=two)

    @cached_property
    def sound(self) -> Beams:
        """Both teeth without damage."""
        return ToothBeam(self.first), ToothBeam(self.second)

    def parted(self, lost: float) -> ToothPair:
        """Return the same teeth at the centre distance at which so much contact ratio is lost."""
        step = lost * self.base_pitch_m
        line, path = self.line_m + self.second.sign * step, (self.path_m[0] + step, self.path_m[1])
        moved = replace(self, line_m=line, path_m=path)
        # the teeth themselves are the same
        moved.__dict__["sound"] = self.sound
        moved.__dict__["foundations"] = self.foundations
        return moved

    def beams(self, first: ToothDamage, second: ToothDamage) -> Beams:
        """Return both teeth with damage.

        Raises
        ------
        ArgumentError
            If the damage leaves nothing of a tooth.
        """
        found = []
        for tooth, damage, sound in zip(self.teeth, (first, second), self.sound, strict=True):
            damage.check(tooth)
            found.append(sound if damage.is_none else ToothBeam(tooth, damage))
        return found[0], found[1]

    def roll(self, phase: ArrayLike) -> FloatArray:
        """Return the roll length on the first gear [m] at contact phases [mesh periods]."""
        return np.asarray(self.path_m[0] + self.base_pitch_m * np.asarray(phase, dtype=np.float64))

    def rolls(self, roll_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the roll lengths on both gears [m] where that on the first is `roll_m`."""
        return roll_m, self.line_m - self.second.sign * roll_m

    def angles(self, phase: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the profile angles of both gears [rad] at contact phases [mesh periods]."""
        one, two = self.rolls(self.roll(phase))
        return self.first.angle(one), self.second.angle(two)

    def phase_of(self, index: int, angle: float) -> float:
        """Return the contact phase at which a profile angle of a gear is in contact."""
        roll = float(self.teeth[index].roll(angle))
        own = roll if index == 0 else self.second.sign * (self.line_m - roll)
        return (own - self.path_m[0]) / self.base_pitch_m

    def corners(self, beams: Beams) -> FloatArray:
        """Return the contact phases at which the compliance is not smooth, on the whole path."""
        angles = [(i, angle) for i, beam in enumerate(beams) for angle in beam.corners.tolist()]
        found = np.unique([self.phase_of(index, angle) for index, angle in angles])
        return np.asarray(found[(found > 0) & (found < self.contact_ratio)], dtype=np.float64)

    def compliances(
        self, roll_m: ArrayLike, beams: Beams | None = None, force_n: ArrayLike | None = None
    ) -> PairCompliance:
        """Return all compliances of the pair.

        Parameters
        ----------
        roll_m : array_like
            Roll lengths of the contacts on the first gear [m].
        beams : (ToothBeam, ToothBeam), optional
            Teeth with damage; by default sound ones.
        force_n : array_like, optional
            Force on this pair [N]; only the load-dependent contact needs it.
        """
        rolls = self.rolls(np.asarray(roll_m, dtype=np.float64))
        both = self.sound if beams is None else beams
        angles = [tooth.angle(own) for tooth, own in zip(self.teeth, rolls, strict=True)]
        parts, bodies, lost = [], [], np.zeros(rolls[0].shape)
        for beam, body, angle in zip(both, self.foundations, angles, strict=True):
            parts.append(beam.compliances(angle))
            bodies.append(body.compliance(angle))
            if beam.damage.holes:
                lost += beam.damage.missing_width_m(beam.tooth.height(angle))
        bending, shear, axial = self.oblique * np.swapaxes(parts, 0, 1)
        whole = self.first.face_width_m
        width = whole - np.minimum(lost, LARGEST_WIDTH * whole)
        foundation = self.oblique * self.form.has_foundation * np.array(bodies)
        moduli = (self.first.elastic_modulus_pa, self.second.elastic_modulus_pa)
        nu = self.first.poisson_ratio
        if self.form.contact == "constant" or force_n is None:
            hertz = hertz_compliance(width, moduli, nu)
        else:
            members = zip(self.teeth, angles, strict=True)
            one, two = (tooth.half_thickness(angle) / np.cos(angle) for tooth, angle in members)
            # the flank of a ring is hollow: its curvature counts against that of the mate
            radius = rolls[0] * rolls[1] / (rolls[1] + self.second.sign * rolls[0])
            force = np.asarray(force_n, dtype=np.float64)
            hertz = weber_banaschek_compliance(force, width, radius, (one, two), moduli, nu)
        return PairCompliance(bending, shear, axial, foundation, self.oblique * hertz)

    def coupling(
        self, apart: int, bodies: FloatArray, phases: tuple[FloatArray, FloatArray]
    ) -> FloatArray:
        """Return the compliance [m/N] that two pairs share through the bodies of the gears.

        Parameters
        ----------
        apart : int, >= 1
            Distance of the pairs [teeth].
        bodies : ndarray, shape (2, 2, *phase)
            Foundation compliances at the one and at the other contact, of both gears.
        phases : (ndarray, ndarray)
            Contact phases of the pair that entered first and of the other one [mesh periods].
        """
        ahead, behind = (self.angles(phase) for phase in phases)
        of_gears = zip(self.foundations, ahead, behind, strict=True)
        shared = [self.oblique * body.coupling(apart, one, two) for body, one, two in of_gears]
        # no more can be shared than each of them has
        least = zip(shared, bodies.min(axis=0), strict=True)
        return np.asarray(sum(np.minimum(own, most) for own, most in least))

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was assumed, and what lies outside a range of validity."""
        one, two = self.foundations
        every = (*self.notes, *one.warnings, *two.warnings)
        return every if self.form.has_foundation else ()


def tooth_pair(
    geometry: PairGeometry,
    form: PotentialEnergy = USUAL,
    *,
    bore_radii_m: tuple[float, float],
    poisson_ratio: float = 0.3,
    contact_ratio: float | None = None,
) -> ToothPair:
    """Return the meshing teeth of a pair of gears.

    Parameters
    ----------
    geometry : PairGeometry
        With its face width.
    form : PotentialEnergy
    bore_radii_m : (float, float)
        Radii on which the gears are held [m]; of a ring the outer one.
    poisson_ratio : float
    contact_ratio : float, optional
        A contact ratio known from elsewhere, at most that of the geometry: the middle of the path
        is kept.

    Raises
    ------
    ArgumentError
        If the face width is missing, a bore or rim does not fit, or the contact ratio exceeds that
        of the geometry.

    Examples
    --------
    >>> from gearmon.gears.geometry import USUAL_RIM, GearTeeth, pair_geometry
    >>> gears = GearTeeth(teeth=26), GearTeeth(teeth=53)
    >>> geometry = pair_geometry(*gears, module_m=0.002, face_width_m=0.02)
    >>> pair = tooth_pair(geometry, bore_radii_m=(0.0104, 0.0212))
    >>> middle = pair.roll(0.5 * pair.contact_ratio)
    >>> round(float(pair.compliances(middle).stiffness) / 1e8, 4)
    2.7824
    """
    most = geometry.transverse_contact_ratio
    ratio = most if contact_ratio is None else contact_ratio
    if ratio > most * (1 + 1e-9):
        raise ArgumentError(
            f"contact_ratio={ratio:g} exceeds {most:.5g}, which these teeth reach: their "
            f"stiffness beyond their tips has no meaning; leave contact_ratio out or lower it"
        )
    if geometry.face_width_m is None:
        raise ArgumentError("face_width_m is missing: the stiffness of a tooth needs it")
    section = normal_section(geometry) if geometry.helix_angle_rad else geometry
    # the middle part of the path of contact
    middle, half = 0.5 * sum(section.path_m), 0.5 * ratio / most * section.path_length_m
    path = middle - half, middle + half
    body: dict[str, Any] = {"face_width_m": geometry.face_width_m, "root": form.root}
    body["poisson_ratio"] = poisson_ratio
    teeth = []
    for real, gear, bore in zip(geometry.gears, section.gears, bore_radii_m, strict=True):
        # held as in the real gear: on as large a bore, by as thick a rim
        held = bore * gear.root_radius_m / real.root_radius_m
        if real.internal:
            held = gear.root_radius_m + bore - real.root_radius_m
        teeth.append(Tooth(**told_of(gear, RackTooth), **body, bore_radius_m=held))
    return ToothPair(
        first=teeth[0],
        second=teeth[1],
        line_m=section.line_m,
        path_m=path,
        base_pitch_m=(path[1] - path[0]) / ratio,
        base_helix_angle_rad=geometry.base_helix_angle_rad,
        form=form,
    )


@lru_cache(maxsize=64)
def teeth_of(pair: MeshPair, form: PotentialEnergy = USUAL) -> ToothPair:
    """Return the teeth of a mesh of a machine.

    Parameters
    ----------
    pair : MeshPair
        With module and face width.
    form : PotentialEnergy

    Returns
    -------
    ToothPair
        Its notes say which bores or rims were assumed, and what of a body is left out.

    Raises
    ------
    ArgumentError
        If data are missing or the gears cannot run.
    """
    pair.need("module_mm", "stiffness of its teeth")
    pair.need("face_width_mm", "stiffness of its teeth")
    notes: list[str] = []
    one, two = (_held_radius(member, notes) for member in pair.geometry.gears)
    try:
        made = tooth_pair(
            pair.geometry,
            form,
            bore_radii_m=(one, two),
            poisson_ratio=pair.stage.poisson_ratio,
            contact_ratio=pair.given("contact_ratio"),
        )
    except ArgumentError as error:
        raise ArgumentError(f"{pair.where}: {error}") from None
    return replace(made, notes=tuple(notes))


def _held_radius(member: RackTooth, notes: list[str]) -> float:
    if member.internal and member.rim_m is not None:
        return member.root_radius_m + member.rim_m
    if member.internal:
        thickness = USUAL_RIM * member.module_m
        notes.append(
            f"the rim of the {member.name} is taken as {1e3 * thickness:.4g} mm thick, "
            f"{USUAL_RIM:g} modules; rim_thickness_{member.name}_mm would say how thick"
        )
        return member.root_radius_m + thickness
    if member.web_m is not None:
        notes.append(
            f"web and rim of the {member.name} lower the ISO stiffness only: its body under the "
            f"teeth is taken as a solid disc"
        )
    if member.bore_m:
        # the fit of Sainsot, Velex & Duverger reaches from 1.4 to 7 times the bore, but towards 7
        # most of it is the wind-up of the disc on a rigid bore, the more the smaller that is: half
        # the stiffness of ISO 6336 at 6. The inertia of the disc lies outside of that spring, which
        # is thus no part of the mesh; finite elements of whole gears confirm the fit up to 3.5.
        given, root, (low, high) = 0.5 * member.bore_m, member.root_radius_m, HELD_RATIOS
        # a bore that meets the roots is refused with the tooth
        held = given if given >= root else min(max(given, root / high), root / low)
        if held != given:
            notes.append(
                f"the body of the {member.name} reaches to {root / given:.3g} times the radius of "
                f"its bore, and the yielding of such bodies is known from {low:g} to {high:g} "
                f"times: it is taken as held on a diameter of {2e3 * held:.4g} mm"
            )
        return held
    held = USUAL_BORE * member.reference_radius_m
    notes.append(
        f"the {member.name} is taken as held on a diameter of {2e3 * held:.4g} mm, 0.4 times its "
        f"reference diameter; bore_diameter_{member.name}_mm would say where"
    )
    return held
