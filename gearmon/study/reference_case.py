"""The published pair: its gear data, its model parameters and the ranges they are swept over.

The tables of the study print the gear data under shifted labels: the "centre distances" are
reference diameters, the "pitch diameters" base diameters, the "face width ratio" the contact
ratio and the "length of the contact line" the path of contact. `decoded` shows that they agree.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from gearmon.dynamics import HillProblem
from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.gears.pulses import ComplexArray

# Gear data as printed.
PINION_TEETH, GEAR_TEETH = 26, 53
MODULE_MM, PRESSURE_ANGLE_DEG = 2.0, 20.0
REFERENCE_DIAMETERS_MM = (52.0, 106.0)
BASE_DIAMETERS_MM = (48.864, 99.607)
CONTACT_RATIO = 1.412
PATH_OF_CONTACT_MM = 8.338
SPEED_RPM, TORQUE_NM = 1460.0, 98.12

#: Highest harmonic of the Fourier sum of the stiffness; with half duty only odd ones are present.
HIGHEST_STIFFNESS_HARMONIC = 41

# Swept values. Of the stiffness and of the mass only the ends and some values between are printed.
STIFFNESS_VALUES = (2e8, 3e8, 4e8, 5e8, 6e8, 8e8, 1e9, 1.2e9)
MASS_VALUES = (0.2, 0.28, 0.4, 0.6, 1.0, 1.5, 2.0, 2.5, 3.0)
DAMPING_VALUES = (3e3, 6e3, 9e3, 12e3, 15e3, 18e3, 30e3, 60e3, 90e3)


@dataclass(frozen=True, kw_only=True)
class MeshParameters:
    """Parameters of ``m z'' + c z' + k0 [1 + eps f(t)] z = F``, f a square wave of +-1.

    Parameters
    ----------
    mass_kg : float, > 0
        Equivalent mass on the line of action.
    damping_ns_per_m : float, > 0
        Mesh damping.
    stiffness_n_per_m : float, > 0
        Mean mesh stiffness k0.
    variation : float, in [0, 1)
        eps.
    period_s : float, > 0
        Mesh period.
    force_n : float, > 0
        Normal force.

    Raises
    ------
    ArgumentError
        If a value is out of its range.
    """

    mass_kg: float = 0.28
    damping_ns_per_m: float = 9e3
    stiffness_n_per_m: float = 8e8
    variation: float = 0.13
    period_s: float = 1.6e-3
    force_n: float = 4e3

    def __post_init__(self) -> None:
        check_positive("mass_kg", self.mass_kg, "kg")
        check_positive("damping_ns_per_m", self.damping_ns_per_m, "N s/m")
        check_positive("stiffness_n_per_m", self.stiffness_n_per_m, "N/m")
        check_range("variation", self.variation, 0.0, 1.0)
        check_positive("period_s", self.period_s, "s")
        check_positive("force_n", self.force_n, "N")

    @property
    def static_deflection_m(self) -> float:
        """F/k0 [m]."""
        return self.force_n / self.stiffness_n_per_m

    @property
    def decay_rate(self) -> float:
        """Decay rate h = c/(2 m) [1/s] of free vibrations."""
        return self.damping_ns_per_m / (2 * self.mass_kg)

    def problem(self, harmonics: ComplexArray | None = None) -> HillProblem:
        """Return Hill's equation, by default with the Fourier sum of the square wave.

        Parameters
        ----------
        harmonics : complex ndarray, shape (J,), optional
            c_1..c_J of the stiffness relative to its mean.
        """
        if harmonics is None:
            harmonics = self.variation * square_wave_harmonics()
        return HillProblem(
            self.mass_kg,
            self.damping_ns_per_m,
            self.stiffness_n_per_m,
            harmonics,
            self.period_s,
            self.force_n,
        )

    def with_value(self, name: str, value: float) -> MeshParameters:
        """Return the same with one parameter changed.

        Raises
        ------
        ArgumentError
            If there is no such parameter or the value is out of its range.
        """
        if name not in self.__dataclass_fields__:
            known = ", ".join(self.__dataclass_fields__)
            raise ArgumentError(f"parameter={name!r} must be one of {known}")
        return replace(self, **{name: value})


#: The published reference values.
REFERENCE = MeshParameters()


def square_wave_harmonics(highest: int = HIGHEST_STIFFNESS_HARMONIC) -> ComplexArray:
    """c_1..c_highest of the +-1 square wave that is high in the first half of the period.

    Parameters
    ----------
    highest : int, >= 1
        Only odd harmonics are present: c_n = -2i/(pi n).

    Examples
    --------
    >>> import numpy as np
    >>> np.round(np.abs(square_wave_harmonics(4)), 6).tolist()
    [0.63662, 0.0, 0.212207, 0.0]
    """
    orders = np.arange(1, highest + 1)
    return np.where(orders % 2 == 1, -2j / (math.pi * orders), 0.0)


@dataclass(frozen=True, kw_only=True)
class DecodedGears:
    """What the printed gear data are, from teeth, module and pressure angle alone.

    Attributes
    ----------
    reference_diameters_mm, base_diameters_mm : (float, float)
        z m, and z m cos(alpha).
    contact_ratio : float
        Printed path of contact over the base pitch.
    mesh_frequency_hz : float
        Of 26 teeth at the printed speed.
    force_n : float
        Printed torque over the base radius of the pinion.
    """

    reference_diameters_mm: tuple[float, float]
    base_diameters_mm: tuple[float, float]
    contact_ratio: float
    mesh_frequency_hz: float
    force_n: float


def decoded() -> DecodedGears:
    """Compute the printed gear data from teeth, module and pressure angle.

    Examples
    --------
    >>> found = decoded()
    >>> round(found.contact_ratio, 3), round(found.mesh_frequency_hz, 1), round(found.force_n)
    (1.412, 632.7, 4016)
    """
    cosine = math.cos(math.radians(PRESSURE_ANGLE_DEG))
    diameters = (PINION_TEETH * MODULE_MM, GEAR_TEETH * MODULE_MM)
    base = (diameters[0] * cosine, diameters[1] * cosine)
    return DecodedGears(
        reference_diameters_mm=diameters,
        base_diameters_mm=base,
        contact_ratio=PATH_OF_CONTACT_MM / (math.pi * MODULE_MM * cosine),
        mesh_frequency_hz=PINION_TEETH * SPEED_RPM / 60,
        force_n=TORQUE_NM / (base[0] / 2e3),
    )
