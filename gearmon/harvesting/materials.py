"""Piezoelectric and structural materials of cantilever harvesters.

Typical values of makers and textbooks; a real part differs by 5 to 10 %, so replace them by the
data sheet where there is one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

from gearmon.errors import ArgumentError, check_finite, check_positive, nearest_name


@dataclass(frozen=True, kw_only=True)
class PiezoMaterial:
    """A thin piezoelectric layer that is poled through its thickness and strained along the beam.

    Parameters
    ----------
    name : str
    youngs_modulus_pa : float, > 0
        At constant field, 1/s11E [Pa].
    density_kg_m3 : float, > 0
        [kg/m3].
    d31_m_per_v : float
        Strain along the beam per field through the thickness [m/V].
    permittivity_f_per_m : float, > 0
        eps33 at constant strain, eps33T - d31^2 Y for a beam [F/m].
    safe_stress_pa : float, > 0
        Peak stress along the beam that it bears for good [Pa].
    source : str
        Where the numbers come from.

    Raises
    ------
    ArgumentError
        If a number is not finite or out of its range.
    """

    name: str
    youngs_modulus_pa: float
    density_kg_m3: float
    d31_m_per_v: float
    permittivity_f_per_m: float
    safe_stress_pa: float
    source: str = ""

    def __post_init__(self) -> None:
        for name in ("youngs_modulus_pa", "density_kg_m3", "permittivity_f_per_m"):
            check_positive(name, getattr(self, name))
        check_finite("d31_m_per_v", self.d31_m_per_v, "m/V")
        check_positive("safe_stress_pa", self.safe_stress_pa, "Pa")

    @property
    def e31_c_per_m2(self) -> float:
        """Stress per field of a beam, d31 Y [C/m2]."""
        return self.d31_m_per_v * self.youngs_modulus_pa


@dataclass(frozen=True, kw_only=True)
class BeamMaterial:
    """What the passive part of a beam is made of.

    Parameters
    ----------
    name : str
    youngs_modulus_pa, density_kg_m3, safe_stress_pa : float, > 0
        [Pa], [kg/m3], [Pa] (peak stress that it bears for good).
    source : str

    Raises
    ------
    ArgumentError
        If a number is not finite and above 0.
    """

    name: str
    youngs_modulus_pa: float
    density_kg_m3: float
    safe_stress_pa: float
    source: str = ""

    def __post_init__(self) -> None:
        for name in ("youngs_modulus_pa", "density_kg_m3", "safe_stress_pa"):
            check_positive(name, getattr(self, name))


M = TypeVar("M")

_ERTURK = "Erturk and Inman, Piezoelectric Energy Harvesting, Wiley 2011, appendix E"
_STRENGTH = "dynamic tensile strength of bulk PZT, 27.6 MPa, makers' data sheets"

#: Piezoelectric layers by name.
PIEZO_MATERIALS = {
    material.name: material
    for material in (
        PiezoMaterial(
            name="PZT-5A",
            youngs_modulus_pa=61.0e9,
            density_kg_m3=7750.0,
            d31_m_per_v=-171e-12,
            permittivity_f_per_m=13.3e-9,
            safe_stress_pa=27.6e6,
            source=f"{_ERTURK}; {_STRENGTH}",
        ),
        PiezoMaterial(
            name="PZT-5H",
            youngs_modulus_pa=60.6e9,
            density_kg_m3=7500.0,
            d31_m_per_v=-274e-12,
            permittivity_f_per_m=25.55e-9,
            safe_stress_pa=27.6e6,
            source=f"{_ERTURK}; {_STRENGTH}",
        ),
        PiezoMaterial(
            name="PVDF",
            youngs_modulus_pa=3.0e9,
            density_kg_m3=1780.0,
            d31_m_per_v=23e-12,
            permittivity_f_per_m=1.1e-10,
            safe_stress_pa=25e6,
            source="film makers' data sheets (d31 23 pC/N, 12 eps0); half the yield strength",
        ),
        PiezoMaterial(
            name="AlN",
            youngs_modulus_pa=330e9,
            density_kg_m3=3260.0,
            d31_m_per_v=-1.9e-12,
            permittivity_f_per_m=9.3e-11,
            safe_stress_pa=300e6,
            source="sputtered films: e31 about -0.6 C/m2, 10.5 eps0; a third of the film strength",
        ),
    )
}

#: Passive layers and tip masses by name.
BEAM_MATERIALS = {
    material.name: material
    for material in (
        BeamMaterial(
            name="steel",
            youngs_modulus_pa=200e9,
            density_kg_m3=7850.0,
            safe_stress_pa=250e6,
            source="spring steel; half of a fatigue limit near 500 MPa",
        ),
        BeamMaterial(
            name="brass",
            youngs_modulus_pa=105e9,
            density_kg_m3=8500.0,
            safe_stress_pa=80e6,
            source="half-hard sheet, fatigue limit near 100 MPa",
        ),
        BeamMaterial(
            name="aluminium",
            youngs_modulus_pa=70e9,
            density_kg_m3=2700.0,
            safe_stress_pa=80e6,
            source="wrought alloys at 1e8 cycles",
        ),
    )
}


def piezo_material(name: str) -> PiezoMaterial:
    """Return a piezoelectric material by name, or refuse with the nearest name.

    Raises
    ------
    ArgumentError
        If the name is not in `PIEZO_MATERIALS`.
    """
    return _named(name, PIEZO_MATERIALS, "piezoelectric material")


def beam_material(name: str) -> BeamMaterial:
    """Return a passive material by name, or refuse with the nearest name.

    Raises
    ------
    ArgumentError
        If the name is not in `BEAM_MATERIALS`.
    """
    return _named(name, BEAM_MATERIALS, "beam material")


def _named(name: str, known: dict[str, M], what: str) -> M:
    if name in known:
        return known[name]
    near = nearest_name(name, known)
    meant = f"; did you mean {near}?" if near else ""
    raise ArgumentError(f"{what} {name!r} must be one of {', '.join(known)}{meant}")
