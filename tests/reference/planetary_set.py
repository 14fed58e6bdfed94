"""A planetary set written out as in Lin and Parker, J. Vib. Acoust. 121 (1999) 316.

In the frame of the carrier, gyroscopic terms left out: x, y, u = r theta of carrier, ring and sun,
then radial z, tangential e and u of every planet n at the angle psi_n.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from gearmon.dynamics import HillSystem
from gearmon.dynamics.fourier import Complex, Real


@dataclass(frozen=True, kw_only=True)
class Body:
    """A gear or carrier.

    Parameters
    ----------
    mass_kg : float
        > 0.
    inertia_kg : float
        I/r^2 > 0, r the base radius (of a carrier, that of the planet centres).
    bearing_n_per_m : float
        Stiffness of its bearing in x and y; of a planet, of its pin.
    torsion_n_per_m : float
        Stiffness against rotation, over r^2.
    """

    mass_kg: float
    inertia_kg: float
    bearing_n_per_m: float
    torsion_n_per_m: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanetarySet:
    """Numbers of a planetary set.

    Parameters
    ----------
    carrier, ring, sun, planet : Body
    planets : int
        Equally spaced, unless `angles_rad` is given.
    sun_mesh_n_per_m, ring_mesh_n_per_m : float
        Mean stiffness of each mesh.
    sun_pressure_angle_rad, ring_pressure_angle_rad : float
        Working pressure angles.
    angles_rad : float array, shape (planets,), optional
        psi_n.
    """

    carrier: Body
    ring: Body
    sun: Body
    planet: Body
    planets: int
    sun_mesh_n_per_m: float
    ring_mesh_n_per_m: float
    sun_pressure_angle_rad: float
    ring_pressure_angle_rad: float
    angles_rad: Real | None = field(default=None)

    @property
    def bodies(self) -> tuple[Body, ...]:
        """Carrier, ring, sun and every planet."""
        return self.carrier, self.ring, self.sun, *([self.planet] * self.planets)

    @property
    def angles(self) -> Real:
        """Places psi_n of the planets [rad]."""
        if self.angles_rad is not None:
            return np.asarray(self.angles_rad, dtype=np.float64)
        return 2 * math.pi * np.arange(self.planets) / self.planets

    @property
    def mass(self) -> Real:
        """Mass matrix [kg]."""
        return np.diag([m for b in self.bodies for m in (b.mass_kg, b.mass_kg, b.inertia_kg)])

    @property
    def stiffness(self) -> Real:
        """Stiffness of bearings and pins, without meshes [N/m]."""
        held = [
            (b.bearing_n_per_m, b.bearing_n_per_m, b.torsion_n_per_m)
            for b in (self.carrier, self.ring, self.sun)
        ]
        whole = np.diag(np.concatenate([np.ravel(held), np.zeros(3 * self.planets)]))
        pins = self._pins()
        return np.asarray(whole + self.planet.bearing_n_per_m * pins.T @ pins)

    @property
    def mesh_vectors(self) -> Real:
        """Sun meshes of all planets, then ring meshes, shape (2 planets, n)."""
        return np.array(
            [self._mesh(n, 2, -1, self.sun_pressure_angle_rad) for n in range(self.planets)]
            + [self._mesh(n, 1, 1, self.ring_pressure_angle_rad) for n in range(self.planets)]
        )

    def _mesh(self, planet: int, body: int, side: int, angle: float) -> Real:
        """Deflection of a mesh of the sun (side -1) or the ring (side 1)."""
        row = np.zeros(3 * len(self.bodies))
        direction = self.angles[planet] + side * angle
        row[3 * body : 3 * body + 3] = -math.sin(direction), math.cos(direction), 1.0
        first = 9 + 3 * planet
        row[first : first + 3] = side * math.sin(angle), -math.cos(angle), -side
        return row

    def _pins(self) -> Real:
        """Radial and tangential deflections of all planet pins."""
        rows = np.zeros((2 * self.planets, 3 * len(self.bodies)))
        for n, psi in enumerate(self.angles):
            radial, tangential = rows[2 * n], rows[2 * n + 1]
            radial[:3] = math.cos(psi), math.sin(psi), 0.0
            tangential[:3] = -math.sin(psi), math.cos(psi), 1.0
            radial[9 + 3 * n], tangential[10 + 3 * n] = -1.0, -1.0
        return rows

    def mesh_phases(self, sun_teeth: int, ring_teeth: int, ring_lead: float = 0.0) -> Real:
        """How far every mesh leads that of the sun with planet 0, in mesh periods.

        Parameters
        ----------
        sun_teeth, ring_teeth : int
        ring_lead : float
            By how much the ring mesh of a planet leads its sun mesh [mesh periods].
        """
        turns = self.angles / (2 * math.pi)
        return np.concatenate([sun_teeth * turns, ring_lead - ring_teeth * turns])

    def system(
        self,
        sun_harmonics: npt.ArrayLike,
        ring_harmonics: npt.ArrayLike,
        phases: npt.ArrayLike,
        period_s: float,
        force_n: npt.ArrayLike,
        damping: npt.ArrayLike,
    ) -> HillSystem:
        """Return the system with all its meshes.

        Parameters
        ----------
        sun_harmonics, ring_harmonics : complex array, shape (J,)
            c_1..c_J of one sun and one ring mesh, relative to the mean.
        phases : float array, shape (2 planets,)
            Lead of every mesh [mesh periods], as of `mesh_phases`.
        period_s : float
            Of the mesh.
        force_n : float array, shape (n,)
            Constant forces; torques over the base radius.
        damping : float array, shape (n, n)
            Damping matrix [N s/m].
        """
        sun, ring = (np.asarray(c, dtype=complex) for c in (sun_harmonics, ring_harmonics))
        orders = np.arange(1, len(sun) + 1)
        turned = np.exp(2j * math.pi * np.asarray(phases)[:, None] * orders)
        harmonics: Complex = turned * np.repeat([sun, ring], self.planets, axis=0)
        means = np.repeat([self.sun_mesh_n_per_m, self.ring_mesh_n_per_m], self.planets)
        return HillSystem(
            self.mass,
            np.asarray(damping, dtype=np.float64),
            self.stiffness,
            self.mesh_vectors,
            means,
            harmonics,
            period_s,
            np.asarray(force_n, dtype=np.float64),
        )
