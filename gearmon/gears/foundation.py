"""Yielding of the gear body under a tooth, and what it does to the neighbouring tooth.

References
----------
Sainsot, Velex & Duverger, J. Mech. Des. 126 (2004) 142.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from gearmon.gears.panels import FloatArray
from gearmon.gears.tooth import Tooth

#: Coefficients A ... F of the polynomials L, M, P, Q.
SAINSOT = {
    "L": (-5.574e-5, -1.9986e-3, -2.3015e-4, 4.7702e-3, 0.0271, 6.8045),
    "M": (60.111e-5, 28.100e-3, -83.431e-4, -9.9256e-3, 0.1624, 0.9086),
    "P": (-50.952e-5, 185.50e-3, 0.0538e-4, 53.300e-3, 0.2895, 0.9236),
    "Q": (-6.2042e-5, 9.0889e-3, -4.0964e-4, 7.8297e-3, -0.1472, 0.6904),
}
#: Where the polynomials were fitted: R_f/r_bore and the half root angle [rad].
RADIUS_RATIOS = (1.4, 7.0)
ROOT_ANGLES = (0.01, 0.12)
#: Fit of the coupling to finite elements: E b C = torsion + slope ln(z) + bore r/R + constant.
COUPLING_SLOPE, COUPLING_BORE, COUPLING_CONSTANT = 0.69, -2.03, -0.43

#: From where the arm u of the force is measured to the root circle.
Arm = Literal["axis", "contact"]


def sainsot(radius_ratio: float, root_angle_rad: float) -> tuple[float, float, float, float]:
    """Return the polynomials L, M, P, Q.

    Parameters
    ----------
    radius_ratio : float
        Root radius over bore radius, fitted for 1.4 to 7.
    root_angle_rad : float
        Half the angle of the tooth root, fitted for 0.01 to 0.12.

    Examples
    --------
    >>> [round(x, 6) for x in sainsot(3.0, 0.05)]
    [6.927112, 1.190046, 4.324115, 0.437799]
    """
    h, theta = radius_ratio, root_angle_rad
    terms = (1 / theta**2, h * h, h / theta, 1 / theta, h, 1.0)
    lower, middle, upper, slope = (
        sum(c * term for c, term in zip(row, terms, strict=True)) for row in SAINSOT.values()
    )
    return lower, middle, upper, slope


@dataclass(frozen=True, kw_only=True)
class Foundation:
    """The body of a gear under its teeth.

    Parameters
    ----------
    tooth : Tooth
    arm : {"axis", "contact"}
        Whether u runs from the root circle to where the force meets the middle of the tooth
        (``R_b/cos a - R_f``, exact), or to the height of the contact, as some codes have it.
    """

    tooth: Tooth
    arm: Arm = "axis"

    @cached_property
    def root_angle_rad(self) -> float:
        """theta_f, half the angle of the tooth root on the root circle."""
        rack = self.tooth.rack
        alpha, rounding = rack.pressure_angle_rad, rack.rounding
        across = math.pi / 2 + 2 * math.tan(alpha) * (rack.straight_depth - rounding)
        return (across + 2 * rounding / math.cos(alpha)) / self.tooth.teeth

    @property
    def radius_ratio(self) -> float:
        """R_f over bore radius."""
        return self.tooth.root_radius_m / self.tooth.bore_radius_m

    @property
    def warnings(self) -> tuple[str, ...]:
        """What lies outside the range of the fit."""
        found = []
        name, (low, high) = self.tooth.name, RADIUS_RATIOS
        if not low <= self.radius_ratio <= high:
            found.append(
                f"the body of the {name} has R_f/r_bore = {self.radius_ratio:.3g}, outside the "
                f"range {low:g} to {high:g} of the fillet-foundation fit"
            )
        low, high = ROOT_ANGLES
        if not low <= self.root_angle_rad <= high:
            found.append(
                f"the teeth of the {name} have a half root angle of {self.root_angle_rad:.4f} rad, "
                f"outside the range {low:g} to {high:g} of the fillet-foundation fit"
            )
        return tuple(found)

    def compliance(self, angle: FloatArray) -> FloatArray:
        """Return the compliance [m/N] for contacts at profile angles `angle`.

        Notes
        -----
        ``1/k_f = cos^2 a/(E b) [L (u/S)^2 + M u/S + P (1 + Q tan^2 a)]``, ``S = 2 R_f theta_f``.
        """
        tooth = self.tooth
        lower, middle, upper, slope = sainsot(self.radius_ratio, self.root_angle_rad)
        cosine = np.cos(angle)
        point = tooth.base_radius_m / cosine if self.arm == "axis" else tooth.height(angle)
        u = (point - tooth.root_radius_m) / (2 * tooth.root_radius_m * self.root_angle_rad)
        square = cosine * cosine
        total = square * (lower * u * u + middle * u + upper) + upper * slope * (1 - square)
        return np.asarray(total / (tooth.elastic_modulus_pa * tooth.face_width_m))

    def coupling(self, apart: int = 1, *_contacts: FloatArray) -> float:
        """Return how far a tooth gives way when another one is loaded [m/N].

        Parameters
        ----------
        apart : int, >= 1
            Distance of the two teeth [teeth].
        *_contacts : ndarray
            Profile angles of the contacts, which the fit does not tell apart.

        Notes
        -----
        ``E b C = E R_b^2/(4 pi G) (1/r^2 - 1/R_f^2) + 0.69 ln(z/apart) - 2.03 r/R - 0.43``: the
        wind-up of the disc on its bore, and the dip of its rim, fitted to finite elements for
        neighbouring teeth (z = 19 to 100, r/R = 0.3 to 0.6). Teeth further apart follow the
        logarithm of the half plane, whose factor 2/pi is that of the fit.
        """
        tooth = self.tooth
        inner, root = tooth.bore_radius_m, tooth.root_radius_m
        stiff = tooth.elastic_modulus_pa / (4 * math.pi * tooth.shear_modulus_pa)
        torsion = stiff * tooth.base_radius_m**2 * (inner**-2 - root**-2)
        dip = COUPLING_SLOPE * math.log(tooth.teeth / apart) + COUPLING_CONSTANT
        dip += COUPLING_BORE * inner / tooth.reference_radius_m
        return max(0.0, torsion + dip) / (tooth.elastic_modulus_pa * tooth.face_width_m)
