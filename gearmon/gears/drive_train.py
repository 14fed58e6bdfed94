"""The machine as one elastic system: its matrices, its modes, and what is around its meshes.

    M q'' + C q' + [K + sum_j k_j v_j v_j^T] q,    d_j = v_j . q the deflection of mesh j

Coordinates are displacements [m] and rotations [rad]; `assembly` tells which, and puts the machine
together.

References
----------
R. H. MacNeal, A hybrid method of component mode synthesis, Comput. Struct. 1 (1971) 581.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.linalg import eigh

from gearmon.arrays import FloatArray
from gearmon.errors import ArgumentError

#: Share of the largest eigenvalue below which a mode is a rigid one: they are rounding, some 1e-14.
RIGID = 1e-11
#: Damping over stiffness of shafts, bearings and supports that tell no damper [s]; ball bearings
#: have 0.25e-5 to 2.5e-5 s (E. Kraemer, Dynamics of Rotors and Foundations, 1993).
ELASTIC_DAMPING_S = 1e-5
#: Share of the compliance of meshes up to which what is in fast modes only is left out.
NEGLIGIBLE = 1e-3
#: Share of a mode's strain energy in meshes up to which they do not feel it: even resonant, at a
#: damping ratio of 0.01, it answers their forces by 50 times this share of what they feel at rest.
UNFELT = 1e-9


@dataclass(frozen=True, eq=False)
class Spring:
    """An elastic part of a drive train, or some of it.

    Parameters
    ----------
    part : str
        What it belongs to; of a mesh "mesh 1 pinion-gear", "mesh 1 sun-planet" or the like.
    rows : ndarray, shape (k, n)
        Its deflections are rows @ q; of a mesh the one row is v.
    stiffness : ndarray, shape (k, k)
    damping_ns_per_m : float
        Of dampers beside it, one for each row.
    phase : float
        Of a mesh: by how much it leads the first of its kind [mesh periods].
    resolved_hz : float
        Up to which frequency it is fine enough, of a shaft with mass.
    """

    part: str
    rows: FloatArray
    stiffness: FloatArray
    damping_ns_per_m: float = 0.0
    phase: float = 0.0
    resolved_hz: float = math.inf


@dataclass(frozen=True, eq=False)
class Planets:
    """The planets of one set.

    Parameters
    ----------
    rows : ndarray, shape (planets, 3, n)
        Radial and tangential displacement [m] and rotation [rad] of each are rows @ q.
    inertia : ndarray, shape (3,)
        Mass twice [kg], and moment of inertia [kg m2].
    angles_rad : ndarray, shape (planets,)
        psi, where they sit, counted as the sun turns past the carrier.
    """

    rows: FloatArray
    inertia: FloatArray
    angles_rad: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Around:
    """What is around some meshes, in the m modes of unit mass of the whole machine that feel them.

    Parameters
    ----------
    shapes : ndarray, shape (n, m)
        Forces f on the machine act on the modes as shapes.T @ f.
    vectors : ndarray, shape (meshes, m)
        v_j.
    means, dampers : ndarray, shape (meshes,)
        Mean stiffness [N/m] and damping [Ns/m] of the meshes.
    stiffness, damping : ndarray, shape (m, m)
        K and C without these meshes [1/s2, 1/s].
    """

    shapes: FloatArray
    vectors: FloatArray
    means: FloatArray
    dampers: FloatArray
    stiffness: FloatArray
    damping: FloatArray

    @property
    def fastest_hz(self) -> float:
        """Highest of its natural frequencies with mean mesh stiffnesses [Hz]."""
        squares = np.diagonal(self.stiffness) + self.means @ self.vectors**2
        return math.sqrt(float(squares.max())) / (2 * math.pi)


def _residual(
    vectors: FloatArray, means: FloatArray, squares: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return squares and shapes of what modes do at rest under forces of meshes, in these modes."""
    forced = (vectors / squares).T * np.sqrt(means)
    share, parts = np.linalg.eigh(forced.T @ (squares[:, None] * forced))
    forced = forced @ parts[:, share > NEGLIGIBLE]
    found, mixed = eigh(forced.T @ (squares[:, None] * forced), forced.T @ forced)
    return np.asarray(found), np.asarray(forced @ mixed)


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveTrain:
    """Matrices of a machine.

    Parameters
    ----------
    coordinates : tuple of str, n of them
    turning : bool ndarray, shape (n,)
        Which are rotations of shafts and of members of planetary sets.
    mass : ndarray, shape (n, n)
    springs : tuple of Spring
        Shafts, bearings, pins, supports and meshes.
    planets : tuple of Planets
    shafts : tuple of int
        Coordinate of the rotation where torque comes to each shaft: of the last one its end.
    notes : tuple of str
        What is left out, and what was taken where the machine file says nothing.
    """

    coordinates: tuple[str, ...]
    turning: npt.NDArray[np.bool_]
    mass: FloatArray
    springs: tuple[Spring, ...]
    planets: tuple[Planets, ...]
    shafts: tuple[int, ...]
    notes: tuple[str, ...]

    def meshes(self, stage: int) -> list[Spring]:
        """Return the meshes of a stage, counted from 1."""
        return [own for own in self.springs if own.part.startswith(f"mesh {stage} ")]

    @cached_property
    def stiffness(self) -> FloatArray:
        """K with the means of all meshes, shape (n, n)."""
        springs = (own.rows.T @ own.stiffness @ own.rows for own in self.springs)
        return sum(springs, np.zeros_like(self.mass))

    @cached_property
    def damping(self) -> FloatArray:
        """C with that of all meshes, shape (n, n)."""
        whole = np.zeros_like(self.mass)
        for own in self.springs:
            told = own.damping_ns_per_m * np.eye(len(own.rows))
            if not own.damping_ns_per_m and not own.part.startswith("mesh"):
                told = ELASTIC_DAMPING_S * own.stiffness
            whole += own.rows.T @ told @ own.rows
        return whole

    @cached_property
    def modes(self) -> tuple[FloatArray, FloatArray]:
        """Squares of angular natural frequencies [1/s2], ascending, and shapes of unit mass.

        Rigid-body motions have 0. Coordinates without mass follow those that have it.
        """
        stiffness, heavy = self.stiffness, np.diag(self.mass) > 0
        carried = np.zeros((len(heavy), int(heavy.sum())))
        carried[heavy] = np.eye(carried.shape[1])
        light = np.linalg.pinv(stiffness[~heavy][:, ~heavy], hermitian=True)
        carried[~heavy] = -light @ stiffness[~heavy][:, heavy]
        squares, shapes = eigh(carried.T @ stiffness @ carried, carried.T @ self.mass @ carried)
        squares[squares < RIGID * squares[-1]] = 0.0
        return np.asarray(squares), np.asarray(carried @ shapes)

    @property
    def elastic(self) -> tuple[FloatArray, FloatArray]:
        """The modes without rigid-body motions."""
        squares, shapes = self.modes
        return squares[squares > 0], shapes[:, squares > 0]

    def load(self, forces_n: Mapping[int, float]) -> FloatArray:
        """Return the torques on shafts that load meshes statically, shape (n,).

        Parameters
        ----------
        forces_n : mapping of int to float
            Of stages, counted from 1, the static force of each of their meshes [N]. Torques come
            in at the beginning of the first shaft and go out at the end of the last one.

        Raises
        ------
        ArgumentError
            If shafts are held against rotation.
        """
        (squares, shapes), total = self.elastic, np.zeros(len(self.mass))
        if len(squares) == len(self.modes[0]):
            raise ArgumentError("the machine cannot turn: its shafts are held against rotation")
        turned = self.modes[1][:, 0]
        for stage, force in forces_n.items():
            one, two = self.shafts[stage - 1 : stage + 1]
            pair = np.zeros(len(total))
            pair[one], pair[two] = 1.0, -turned[one] / turned[two]
            mesh = self.meshes(stage)[0]
            carried = mesh.stiffness[0, 0] * (mesh.rows[0] @ shapes) @ ((pair @ shapes) / squares)
            total += force / carried * pair
        return total

    def around(self, meshes: Sequence[Spring], carried_hz: float = math.inf) -> Around:
        """Return the machine without some of its meshes, in its elastic modes.

        Parameters
        ----------
        meshes : sequence of Spring
        carried_hz : float
            Natural frequency up to which modes are kept as they are. Of those above, the motions
            are kept by which they follow forces of these meshes without inertia (residual modes,
            MacNeal 1971): the flexibility of the machine at the meshes stays whole, and nothing
            swings faster than it needs to.
        """
        squares, shapes = self.elastic
        rows = np.array([own.rows[0] for own in meshes])
        means = np.array([own.stiffness[0, 0] for own in meshes])
        felt = means @ (rows @ shapes) ** 2 > UNFELT * squares
        beside, soft = shapes[:, ~felt], squares[~felt]
        squares, shapes = squares[felt], shapes[:, felt]
        fast = squares > (2 * math.pi * carried_hz) ** 2
        if fast.any():
            own, more = _residual(rows @ shapes[:, fast], means, squares[fast])
            squares = np.append(squares[~fast], own)
            shapes = np.hstack([shapes[:, ~fast], shapes[:, fast] @ more])
        vectors = rows @ shapes
        dampers = np.array([own.damping_ns_per_m for own in meshes])
        # a steady load presses the meshes through modes that they hardly feel as well
        pressed = (rows @ beside / soft) @ beside.T
        held = np.linalg.pinv((vectors / squares) @ vectors.T, rcond=UNFELT)
        return Around(
            shapes=shapes + pressed.T @ held @ vectors,
            vectors=vectors,
            means=means,
            dampers=dampers,
            stiffness=np.diag(squares) - (vectors.T * means) @ vectors,
            damping=shapes.T @ self.damping @ shapes - (vectors.T * dampers) @ vectors,
        )
