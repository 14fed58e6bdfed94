"""Where the teeth would lose contact: the least mesh force of the steady vibration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearmon.dynamics import steady_state
from gearmon.dynamics.fourier import fast_length, samples
from gearmon.errors import ArgumentError
from gearmon.gears.pulses import FloatArray
from gearmon.study.reference_case import REFERENCE, MeshParameters

#: Enough for a picture and a root to three digits.
TOLERANCE = 1e-5
LARGEST_STUDIED_MASS_KG = 3.0
MASSES_KG = np.geomspace(0.2, 200.0, 161)
MAP_MASSES_KG = np.geomspace(0.2, 100.0, 49)
MAP_DAMPINGS = np.geomspace(3e2, 9e4, 25)
VARIATIONS = np.linspace(0.02, 0.98, 49)
DAMPINGS = np.geomspace(30.0, 9e4, 61)


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactStudy:
    """Least mesh force over F for many parameters; contact is lost where it is <= 0.

    Attributes
    ----------
    masses_kg, of_mass : ndarray
        The other parameters at their reference.
    dampings, of_damping : ndarray
        At a mass of 3 kg.
    variations, of_variation : ndarray
        At a mass of 3 kg.
    map_masses_kg, map_dampings, of_both : ndarray
        `of_both` has shape (dampings, masses).
    first_mass_kg, first_damping, first_variation : float or None
        Least mass, largest damping (3 kg) and least variation (3 kg) without contact throughout.
    """

    masses_kg: FloatArray
    of_mass: FloatArray
    dampings: FloatArray
    of_damping: FloatArray
    variations: FloatArray
    of_variation: FloatArray
    map_masses_kg: FloatArray
    map_dampings: FloatArray
    of_both: FloatArray
    first_mass_kg: float | None
    first_damping: float | None
    first_variation: float | None


def least_force(parameters: MeshParameters) -> float:
    """Smallest mesh force of the steady vibration over F; -inf where there is no steady state."""
    response = steady_state(parameters.problem(), TOLERANCE)
    if response.stable is False:
        return -np.inf
    force = response.mesh_force
    return float(samples(force, fast_length(8 * len(force))).min()) / parameters.force_n


def study_contact(every: int = 1) -> ContactStudy:
    """Scan mass, damping and variation, and find where contact is lost first.

    Parameters
    ----------
    every : int, >= 1
        Takes every so many of the values to scan.
    """
    heavy = REFERENCE.with_value("mass_kg", LARGEST_STUDIED_MASS_KG)
    masses, dampings, variations = MASSES_KG[::every], DAMPINGS[::every], VARIATIONS[::every]
    map_masses, map_dampings = MAP_MASSES_KG[::every], MAP_DAMPINGS[::every]
    of_mass = _scan(REFERENCE, "mass_kg", masses)
    of_damping = _scan(heavy, "damping_ns_per_m", dampings)
    of_variation = _scan(heavy, "variation", variations)
    both = [
        _scan(REFERENCE.with_value("damping_ns_per_m", c), "mass_kg", map_masses)
        for c in map_dampings
    ]
    return ContactStudy(
        masses_kg=masses,
        of_mass=of_mass,
        dampings=dampings,
        of_damping=of_damping,
        variations=variations,
        of_variation=of_variation,
        map_masses_kg=map_masses,
        map_dampings=map_dampings,
        of_both=np.array(both),
        first_mass_kg=_first_loss(REFERENCE, "mass_kg", masses, of_mass),
        first_damping=_first_loss(heavy, "damping_ns_per_m", dampings[::-1], of_damping[::-1]),
        first_variation=_first_loss(heavy, "variation", variations, of_variation),
    )


def _scan(parameters: MeshParameters, name: str, values: FloatArray) -> FloatArray:
    return np.array([least_force(parameters.with_value(name, float(v))) for v in values])


def _first_loss(
    parameters: MeshParameters, name: str, values: FloatArray, found: FloatArray
) -> float | None:
    """Value at which the least force first reaches zero, between two of those scanned."""
    lost = np.flatnonzero(found <= 0)
    if not len(lost):
        return None
    first = int(lost[0])
    if first == 0:
        raise ArgumentError(f"{name}={values[0]}: contact is lost already where the scan begins")
    held, gone = float(values[first - 1]), float(values[first])
    while abs(gone - held) > 1e-4 * abs(gone):
        middle = 0.5 * (held + gone)
        if least_force(parameters.with_value(name, middle)) > 0:
            held = middle
        else:
            gone = middle
    return 0.5 * (held + gone)
