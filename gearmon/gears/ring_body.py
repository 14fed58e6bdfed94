"""Yielding of a ring under its teeth: the ring is held all round its outside.

The tooth root loads an arc of the root circle as in the fillet foundation of external gears; the
deflection is the exact plane-stress one of a ring, so that thickness of the rim and coupling of
teeth any distance apart follow from it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearmon.gears.annulus import arc_compliance
from gearmon.gears.panels import FloatArray
from gearmon.gears.tooth import Tooth
from gearmon.gears.tooth_fillet import where_tangent

#: Tangent of the fillet against the middle of the tooth where the loaded arc ends: there it ends
#: in the fillet foundation of external gears with the standard rack.
ARC_TANGENT = math.radians(75)
#: Rim thickness in modules below which a ring is called thin (ISO 6336-3: rim factor above 1).
THIN_RIM = 3.5


@dataclass(frozen=True, kw_only=True)
class RingBody:
    """The body of a ring under its teeth.

    Parameters
    ----------
    tooth : Tooth
        Of a ring; its `bore_radius_m` is the radius round which the ring is held.

    Notes
    -----
    ``1/k_f = cos^2 a (R_mm u^2 + 2 R_mt u + R_tt + R_nn tan^2 a)/(E b)`` with the compliances R of
    `gears.annulus.arc_compliance` and u from the root circle to where the force meets the middle of
    the tooth. For discs the same solution gives the terms P and Q of Sainsot, Velex & Duverger
    within 7 %; their L, for the moment, is a fifth larger than the mean rotation over the arc.
    Against finite elements of one tooth on its ring, tooth and body together are 11 % too compliant
    under the tip, 20 % halfway and 30 % near the root, where little yields; external teeth 10 %.
    """

    tooth: Tooth

    @cached_property
    def root_angle_rad(self) -> float:
        """Half the angle of the loaded arc on the root circle."""
        part = self.tooth.root_part
        if part is None:
            start = self.tooth.start
            height, half = self.tooth.height(start), self.tooth.half_thickness(start)
        else:
            height, half = part.at(np.array(where_tangent(part.at, ARC_TANGENT)))
        return math.atan2(float(half), -float(height))

    @property
    def rim_modules(self) -> float:
        """Thickness of the rim in modules."""
        return (self.tooth.bore_radius_m - self.tooth.root_radius_m) / self.tooth.module_m

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is taken for granted of the body."""
        name = self.tooth.name
        found = [
            f"the {name} is taken as held all round its outer diameter of "
            f"{2e3 * self.tooth.bore_radius_m:.5g} mm: one that floats or stands on few bolts "
            f"yields more"
        ]
        if self.rim_modules < THIN_RIM - 1e-9:
            found.append(
                f"the rim of the {name} is {self.rim_modules:.3g} modules thick, below "
                f"{THIN_RIM:g}: how the ring is held matters much"
            )
        return tuple(found)

    def compliance(self, angle: FloatArray) -> FloatArray:
        """Return the compliance [m/N] for contacts at profile angles `angle`."""
        load = self._load(angle)
        return self._scaled(load, self._arc(0.0), load)

    def coupling(
        self, apart: int = 1, ahead: FloatArray | None = None, behind: FloatArray | None = None
    ) -> FloatArray | float:
        """Return how far a tooth gives way when another one is loaded [m/N].

        Parameters
        ----------
        apart : int, >= 1
            Distance of the two teeth [teeth].
        ahead, behind : ndarray, optional
            Profile angles of the contacts of the tooth that entered first and of the other; by
            default halfway up.
        """
        middle = np.array([0.5 * (self.tooth.start + self.tooth.tip)])
        first, second = (self._load(middle if a is None else a) for a in (ahead, behind))
        away = -2 * math.pi * apart / self.tooth.teeth
        found = np.maximum(self._scaled(first, self._arc(away), second), 0.0)
        return found if ahead is not None else float(found[0])

    def _arc(self, apart_rad: float) -> FloatArray:
        tooth = self.tooth
        ratio = tooth.bore_radius_m / tooth.root_radius_m
        return arc_compliance(ratio, self.root_angle_rad, tooth.poisson_ratio, apart_rad)

    def _load(self, angle: FloatArray) -> FloatArray:
        """Return moment, shear and push at the root per unit force, for unit root radius."""
        tooth = self.tooth
        cosine = np.cos(angle)
        arm = 1 - tooth.base_radius_m / (tooth.root_radius_m * cosine)
        return np.stack([arm * cosine, cosine, np.sin(tooth.slope(angle))])

    def _scaled(self, first: FloatArray, arc: FloatArray, second: FloatArray) -> FloatArray:
        stiff = self.tooth.elastic_modulus_pa * self.tooth.face_width_m
        return np.asarray(np.einsum("i...,ij,j...->...", first, arc, second) / stiff)
