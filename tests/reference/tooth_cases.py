"""Pairs of teeth that several tests share."""

from __future__ import annotations

from gearmon.gears.geometry import GearTeeth, pair_geometry
from gearmon.gears.tooth_pairs import PotentialEnergy, tooth_pair


def teeth(z1, z2, m, b, bores, E=206e9, x=(0.0, 0.0), **choices):
    """Pair of gears from millimetres."""
    geometry = pair_geometry(
        GearTeeth(teeth=z1, profile_shift=x[0], name="pinion", elastic_modulus_pa=E),
        GearTeeth(teeth=z2, profile_shift=x[1], name="gear", elastic_modulus_pa=E),
        module_m=1e-3 * m,
        face_width_m=1e-3 * b,
    )
    return tooth_pair(
        geometry,
        PotentialEnergy(**choices),
        bore_radii_m=(1e-3 * bores[0], 1e-3 * bores[1]),
    )


PAPER = teeth(26, 53, 2, 20, (10.4, 21.2))
STRAIGHT = teeth(26, 53, 2, 20, (10.4, 21.2), root="straight")
TIAN = teeth(19, 48, 3.175, 16, (10, 10), 206.8e9, root="straight", has_foundation=False)
