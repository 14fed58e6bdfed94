"""The stiffness form that is computed from the teeth themselves, by their elastic energy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from gearmon.errors import ArgumentError
from gearmon.gears.contact import CONTACTS, Contact
from gearmon.gears.involute_pair import PairGeometry
from gearmon.gears.pairs import Member, MeshPair
from gearmon.gears.tooth import ROOTS, Root
from gearmon.gears.tooth_pairs import ToothPair, tooth_pair

#: Name under which the form is chosen.
POTENTIAL_ENERGY = "potential-energy"
#: Radius on which a gear is held where no bore is given, over its reference radius. The beam
#: model then lies within 7 % of ISO 6336 for most pairs.
USUAL_BORE = 0.4
#: Thickness of the rim of a ring where none is given, in modules: the least for which ISO 6336-3
#: counts a ring as stiff.
USUAL_RIM = 3.5


@dataclass(frozen=True, kw_only=True)
class PotentialEnergy:
    """Energy of both teeth, of their contact and of the bodies that carry them.

    Parameters
    ----------
    root : {"fillet", "straight", "base"}
        See `gears.tooth.Tooth`.
    contact : {"constant", "load-dependent"}
        See `gears.tooth_pairs.ToothPair`.
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

    root: Root = "fillet"
    contact: Contact = "constant"
    has_foundation: bool = True
    is_coupled: bool = True

    def __post_init__(self) -> None:
        for name, choices in (("root", ROOTS), ("contact", CONTACTS)):
            if getattr(self, name) not in choices:
                raise ArgumentError(
                    f"{name}={getattr(self, name)!r} must be one of {', '.join(choices)}"
                )

    @property
    def name(self) -> str:
        """Name under which the form is chosen."""
        return POTENTIAL_ENERGY

    @property
    def normalisation(self) -> Literal["mean", "maximum"]:
        """The mean is that of the teeth, or the one imposed."""
        return "mean"


#: The form with its usual choices.
USUAL = PotentialEnergy()


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
    known = pair.given("contact_ratio")
    geometry = pair.geometry if known is None else pair.unchecked_geometry
    bores = [_held_radius(geometry, i, member, notes) for i, member in enumerate(pair.members)]
    try:
        return tooth_pair(
            geometry,
            bore_radii_m=(bores[0], bores[1]),
            moduli_pa=(pair.first.elastic_modulus_pa, pair.second.elastic_modulus_pa),
            poisson_ratio=pair.stage.poisson_ratio,
            root=form.root,
            contact=form.contact,
            has_foundation=form.has_foundation,
            contact_ratio=known,
            notes=tuple(notes) if form.has_foundation else (),
        )
    except ArgumentError as error:
        raise ArgumentError(f"{pair.where}: {error}") from None


def _held_radius(geometry: PairGeometry, index: int, member: Member, notes: list[str]) -> float:
    if member.internal:
        return geometry.root_radii_m[index] + _rim(geometry, member, notes)
    if member.web_m is not None:
        notes.append(
            f"web and rim of the {member.name} lower the ISO stiffness only: its body under the "
            f"teeth is taken as a solid disc"
        )
    if member.bore_m:
        return 0.5 * member.bore_m
    held = USUAL_BORE * geometry.reference_radii_m[index]
    notes.append(
        f"the {member.name} is taken as held on a diameter of {2e3 * held:.4g} mm, 0.4 times its "
        f"reference diameter; bore_diameter_{member.name}_mm would say where"
    )
    return held


def _rim(geometry: PairGeometry, member: Member, notes: list[str]) -> float:
    if member.rim_m is not None:
        return member.rim_m
    thickness = USUAL_RIM * geometry.normal_module_m
    notes.append(
        f"the rim of the {member.name} is taken as {1e3 * thickness:.4g} mm thick, {USUAL_RIM:g} "
        f"modules; rim_thickness_{member.name}_mm would say how thick"
    )
    return thickness
