"""Errors of manufacture: pitch deviations and eccentricity of real gears, by accuracy grade.

Every gear departs a little from its ideal shape, tooth by tooth and once per turn. These errors
make sidebands of a healthy gear, and they belong to the machine: they are the same in all of its
recordings.

References
----------
ISO 1328-1:2013, Cylindrical gears - ISO system of flank tolerance classification.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import check_range

FloatArray = NDArray[np.float64]

#: Share of the tolerance that a machine tool uses up.
TOLERANCE_USED = 0.7
# A single pitch deviation is the difference of two independent ones; among the teeth of a gear
# the largest of them is about three standard deviations of one tooth.
_LARGEST_OVER_DEVIATION = 3.0


@dataclass(frozen=True, kw_only=True, eq=False)
class GearErrors:
    """How one gear departs from its ideal shape, along the line of action.

    Parameters
    ----------
    pitch_m : ndarray, shape (teeth,)
        Missing material on each flank [m]; mean zero.
    eccentricity_m : float
        Amplitude of the once-per-turn part [m].
    eccentricity_phase_rad : float
        Angle of the gear, from the entry of tooth 1, at which that part is largest, negated.
    """

    pitch_m: FloatArray
    eccentricity_m: float
    eccentricity_phase_rad: float

    def __post_init__(self) -> None:
        # deviations are read by tooth number for as long as the machine exists
        self.pitch_m.setflags(write=False)


def single_pitch_tolerance_m(diameter_m: float, module_m: float, grade: float) -> float:
    """Return the single pitch tolerance f_pT of ISO 1328-1:2013 [m].

    Parameters
    ----------
    diameter_m, module_m : float
        Reference diameter and normal module [m].
    grade : float, 1 to 11
        Flank tolerance class A.

    Notes
    -----
    ``f_pT = (0.001 d + 0.4 m_n + 5) sqrt(2)^(A - 5)`` in micrometres, with d and m_n in mm; not
    rounded.

    Examples
    --------
    >>> round(1e6 * single_pitch_tolerance_m(0.1, 0.003, 5), 3)
    6.3
    """
    d, m = 1e3 * diameter_m, 1e3 * module_m
    return 1e-6 * (0.001 * d + 0.4 * m + 5) * _grade_factor(grade)


def runout_tolerance_m(diameter_m: float, module_m: float, grade: float) -> float:
    """Return the runout tolerance F_rT of ISO 1328-1:2013 [m], peak to peak.

    Parameters
    ----------
    diameter_m, module_m, grade
        See `single_pitch_tolerance_m`.

    Notes
    -----
    ``F_rT = 0.9 (0.002 d + 0.55 sqrt(d) + 0.7 m_n + 12) sqrt(2)^(A - 5)`` in micrometres.

    Examples
    --------
    >>> round(1e6 * runout_tolerance_m(0.1, 0.003, 5), 2)
    17.82
    """
    d, m = 1e3 * diameter_m, 1e3 * module_m
    total = 0.002 * d + 0.55 * math.sqrt(d) + 0.7 * m + 12
    return 1e-6 * 0.9 * total * _grade_factor(grade)


def random_errors(
    teeth: int, diameter_m: float, module_m: float, grade: float, generator: np.random.Generator
) -> GearErrors:
    """Draw the errors of a gear of the given accuracy grade.

    Parameters
    ----------
    teeth : int
    diameter_m, module_m : float
        Reference diameter and normal module [m].
    grade : float, 1 to 11
        Flank tolerance class of ISO 1328-1; 6 is a good ground gear.
    generator : numpy.random.Generator

    Returns
    -------
    GearErrors
    """
    check_range("accuracy_grade", grade, 1, 11)
    pitch = TOLERANCE_USED * single_pitch_tolerance_m(diameter_m, module_m, grade)
    runout = TOLERANCE_USED * runout_tolerance_m(diameter_m, module_m, grade)
    deviations = generator.normal(0.0, pitch / _LARGEST_OVER_DEVIATION, teeth)
    return GearErrors(
        pitch_m=deviations - deviations.mean(),
        # between a gear that happens to run true and one that uses up its share
        eccentricity_m=0.5 * runout * generator.uniform(0.4, 1.0),
        eccentricity_phase_rad=generator.uniform(0, 2 * math.pi),
    )


def ideal(teeth: int) -> GearErrors:
    """Return the errors of a perfect gear: none."""
    return GearErrors(pitch_m=np.zeros(teeth), eccentricity_m=0.0, eccentricity_phase_rad=0.0)


def _grade_factor(grade: float) -> float:
    return math.pow(2.0, 0.5 * (grade - 5))
