"""What the integration works on: the system, its course over time and the forces that result.

The deformations q of the elements of a drive train (meshes first, then shafts) obey

    q'' = g(t) - W s,        W = B M^-1 B'

where g is the acceleration that the external torques alone would give, W couples the elements
through the inertias between them and s are the element forces. A shaft is a spring and a damper.
A mesh carries the sum over its tooth pairs, each with its own stiffness k_p(t) and its own
deviation e_p (missing material, > 0), and cannot pull:

    s = max(0, sum_p k_p(t) max(0, q - e_p) + c q')     where some pair touches, else 0

When it has opened by more than its backlash, the opposite flanks push it back in the same way.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

#: Runge-Kutta steps in every piece of a course.
SUBSTEPS = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class GearedSystem:
    """Inertias, dampers and shafts of a drive train, seen from the deformations of its elements.

    Parameters
    ----------
    coupling : ndarray, shape (elements, elements)
        W = B M^-1 B' [1/kg for meshes], symmetric and positive semidefinite.
    damping : ndarray, shape (elements,)
        Damping of every element [N s/m].
    shaft_stiffness : ndarray, shape (elements - meshes,)
        Stiffness of the elements that are not meshes [N/m]; the meshes come first.
    backlash_m : ndarray, shape (meshes,), optional
        Way from contact to contact of the opposite flanks [m]; endless without it.
    back_stiffness : ndarray, shape (meshes,), optional
        Stiffness of the opposite flanks [N/m]; goes with `backlash_m`.
    """

    coupling: FloatArray
    damping: FloatArray
    shaft_stiffness: FloatArray
    backlash_m: FloatArray | None = None
    back_stiffness: FloatArray | None = None

    def __post_init__(self) -> None:
        size = len(self.damping)
        if self.coupling.shape != (size, size) or len(self.shaft_stiffness) > size:
            raise ArgumentError(f"coupling of shape {self.coupling.shape} must be square, {size=}")

    @property
    def elements(self) -> int:
        """Number of meshes and shafts."""
        return len(self.damping)

    @property
    def meshes(self) -> int:
        """Number of meshes."""
        return len(self.damping) - len(self.shaft_stiffness)

    def natural_frequencies_hz(self, mesh_stiffness: FloatArray) -> FloatArray:
        """Undamped natural frequencies with constant mesh stiffnesses [Hz], increasing.

        Elements that cannot deform independently of one another give zeros, which are left out.
        """
        root = np.sqrt(np.concatenate([mesh_stiffness, self.shaft_stiffness]))
        squares = np.linalg.eigvalsh(root[:, None] * self.coupling * root)
        return np.asarray(np.sqrt(squares[squares > 1e-9 * squares[-1]]) / (2 * math.pi))

    def decay_rate(self, mesh_stiffness: FloatArray) -> float:
        """Decay rate of the slowest transient with constant mesh stiffnesses [1/s]."""
        stiffness = np.concatenate([mesh_stiffness, self.shaft_stiffness])
        values, vectors = np.linalg.eigh(self.coupling)
        # only deformations in the range of W are possible; elsewhere nothing moves or decays
        kept = values > 1e-9 * values[-1]
        base = vectors[:, kept] * np.sqrt(values[kept])
        size = base.shape[1]
        matrix = np.zeros((2 * size, 2 * size))
        matrix[:size, size:] = np.eye(size)
        matrix[size:, :size] = -(base.T * stiffness) @ base
        matrix[size:, size:] = -(base.T * self.damping) @ base
        return float(-np.linalg.eigvals(matrix).real.max())

    def static_deformation(self, forcing: FloatArray, mesh_stiffness: FloatArray) -> FloatArray:
        """Deformations at rest under constant `forcing` [m], shape (elements,)."""
        stiffness = np.concatenate([mesh_stiffness, self.shaft_stiffness])
        values, vectors = np.linalg.eigh(self.coupling)
        kept = values > 1e-9 * values[-1]
        base = vectors[:, kept] * np.sqrt(values[kept])
        # q = base x and W = base base', so that base' k base x = base^+ g
        load = (vectors[:, kept] / np.sqrt(values[kept])).T @ forcing
        return np.asarray(base @ np.linalg.solve((base.T * stiffness) @ base, load))


@dataclass(frozen=True, kw_only=True, eq=False)
class Course:
    """Stiffnesses, deviations and forcing over time, in intervals within which they are smooth.

    Intervals end at events; each is cut into equal pieces that the integration takes one by one.

    Parameters
    ----------
    times_s : ndarray, shape (pieces + 1,)
        Edges of the pieces [s], not decreasing.
    interval : ndarray of int, shape (pieces,)
        Interval that a piece belongs to.
    start, width : ndarray, shape (pieces,)
        Beginning and length of the piece as shares of its interval.
    stiffness : ndarray, shape (powers, pairs, meshes, intervals)
        Polynomials of the pair stiffnesses [N/m] in the share of the interval that has passed;
        zero for pairs that are not in contact.
    deviation : ndarray, shape (pairs, meshes, intervals)
        Missing material of each pair in contact [m].
    forcing : ndarray, shape (elements, intervals + 1)
        g at the ends of the intervals [m/s2]; straight in between.
    """

    times_s: FloatArray
    interval: IntArray
    start: FloatArray
    width: FloatArray
    stiffness: FloatArray
    deviation: FloatArray
    forcing: FloatArray

    @property
    def pieces(self) -> int:
        """Number of pieces."""
        return len(self.interval)


def divided_course(
    times_s: FloatArray,
    stiffness: FloatArray,
    deviation: FloatArray,
    forcing: FloatArray,
    longest_step_s: float,
) -> Course:
    """Return a course whose intervals are cut so that no step is longer than `longest_step_s`.

    Parameters
    ----------
    times_s : ndarray, shape (intervals + 1,)
        Ends of the intervals [s].
    stiffness, deviation, forcing
        See `Course`.
    longest_step_s : float
        [s].
    """
    lengths = np.diff(times_s)
    parts = np.maximum(np.ceil(lengths / (SUBSTEPS * longest_step_s)), 1).astype(np.intp)
    interval = np.repeat(np.arange(len(lengths)), parts)
    part = np.arange(len(interval)) - np.repeat(np.cumsum(parts) - parts, parts)
    width = 1.0 / parts[interval]
    edges = times_s[interval] + lengths[interval] * part * width
    return Course(
        times_s=np.append(edges, times_s[-1]),
        interval=interval,
        start=part * width,
        width=width,
        stiffness=stiffness,
        deviation=deviation,
        forcing=forcing,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshForces:
    """Mesh forces over the Runge-Kutta steps of a course.

    Parameters
    ----------
    course : Course
        Each of its pieces holds `SUBSTEPS` equal steps.
    impulses_ns, starts_n, ends_n : ndarray of float32, shape (meshes, steps of a chunk, chunks)
        Integral of the force over each step [N s] and its limits at the ends of the step [N]. The
        last chunk goes on beyond the end of the course with steps that last no time.
    end_state : ndarray, shape (2, elements)
        Deformations [m] and their rates [m/s] at the end.
    joint_mismatch : float
        Largest disagreement of two chunks at their joint, relative to the static deformation.
    """

    course: Course
    impulses_ns: NDArray[np.float32]
    starts_n: NDArray[np.float32]
    ends_n: NDArray[np.float32]
    end_state: FloatArray
    joint_mismatch: float

    @property
    def steps_s(self) -> FloatArray:
        """Lengths of the steps [s], shape (steps of a chunk, chunks)."""
        steps, chunks = self.impulses_ns.shape[1:]
        lengths = np.zeros(steps * chunks // SUBSTEPS)
        lengths[: self.course.pieces] = np.diff(self.course.times_s) / SUBSTEPS
        return np.repeat(lengths.reshape(chunks, -1).T, SUBSTEPS, axis=0)

    def in_time(self, rows: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return one of the arrays in the order of time, shape (meshes, steps of the course)."""
        ordered = rows.transpose(0, 2, 1).reshape(len(rows), -1)
        return ordered[:, : self.course.pieces * SUBSTEPS]
