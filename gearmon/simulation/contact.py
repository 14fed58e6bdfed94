"""Which tooth pairs are in contact when, how stiff they are and how far off their flanks are.

A mesh advances by one mesh period per tooth. The pair that enters contact at count n stays for the
contact ratio; it is made of tooth n mod z1 of the first gear and tooth n mod z2 of the second
(counted from 0), and brings the stiffness, the damage and the pitch deviations of these two. Runout
of the gears moves the flanks to and fro once per turn: it shifts the instants of contact and
accelerates the mesh.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearmon.gears.pulses import LEAST_OVERLAP, PulseTrain
from gearmon.gears.stiffness import MeshStiffness
from gearmon.simulation.manufacture import GearErrors
from gearmon.simulation.motion import ShaftMotion, Wander
from gearmon.simulation.system import Course, divided_course

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

#: Points in a turn of the fastest gear at which load and runout are taken.
POINTS_PER_TURN = 128
# Three points fix the parabola of a spur pair, four the cubic that it is when spread over the face
# width of a helical one. They lie inside the interval, where it cannot matter to which side of an
# event its ends belong.
_SPUR_NODES = np.array([0.125, 0.5, 0.875])
_HELICAL_NODES = np.array([0.125, 0.375, 0.625, 0.875])
# Longer than any contact: a pulse train with this period is a single pulse.
_ONCE = 1_000_000


@dataclass(frozen=True, kw_only=True, eq=False)
class ToothMesh:
    """One mesh of two gears, tooth by tooth.

    Parameters
    ----------
    stage : int
        Number of the stage, counted from 1.
    name : str
        Such as "pinion-gear" or "sun-planet 2".
    order : float
        Mesh periods in a turn of shaft 1.
    offset : float
        Mesh phase at shaft angle 0 [mesh periods].
    teeth : (int, int)
    errors : (GearErrors, GearErrors)
        Of the first and of the second gear.
    base_pitch_m : float
        Transverse base pitch [m].
    stiffness : MeshStiffness
        With the damage that acts in this mesh.
    backlash_m : float
        Along the line of action [m].
    place_turns : float
        Of a planet, its angle on the carrier from the first planet [turns].
    floating : bool
        Whether a gear of the set gives way to runout, as the sun between its planets does: then
        runout shifts the instants of contact only.
    """

    stage: int
    name: str
    order: float
    offset: float
    teeth: tuple[int, int]
    errors: tuple[GearErrors, GearErrors]
    base_pitch_m: float
    stiffness: MeshStiffness
    backlash_m: float
    place_turns: float = 0.0
    floating: bool = False

    def phase(self, turns: FloatArray) -> FloatArray:
        """Mesh phase at angles of shaft 1, with the shift that runout makes [mesh periods]."""
        nominal = self.order * turns + self.offset
        return nominal - self.runout_m(nominal) / self.base_pitch_m

    def turns(self, phase: FloatArray) -> FloatArray:
        """Angles of shaft 1 at which the mesh phase, with runout, is `phase`."""
        nominal = phase
        # runout moves the phase by some thousandths: each round gains more than two digits
        for _ in range(8):
            nominal = phase + self.runout_m(nominal) / self.base_pitch_m
        return (nominal - self.offset) / self.order

    def runout_m(self, phase: FloatArray) -> FloatArray:
        """Once-per-turn part of the missing material of both gears [m]."""
        return self._runout(phase, 0)

    def runout_curvature_m(self, phase: FloatArray) -> FloatArray:
        """Second derivative of `runout_m` with respect to the mesh phase [m]."""
        return self._runout(phase, 2)

    def pitch_deviation_m(self, count: IntArray) -> FloatArray:
        """Missing material of the pair that enters contact at mesh phase `count` [m]."""
        first, second = (errors.pitch_m for errors in self.errors)
        return np.asarray(first[count % self.teeth[0]] + second[count % self.teeth[1]])

    def pair_stiffness(self, count: IntArray, passed: FloatArray) -> FloatArray:
        """Stiffness [N/m] of the pair `count` when `passed` mesh periods of its contact are over.

        `count` must broadcast against `passed`.
        """
        total = self._single.at(passed)
        for train in self.stiffness.pulses:
            for term in train.terms:
                hurt = (count - round(term.offset)) % train.period_mesh == 0
                if hurt.any():
                    where = np.broadcast_to(hurt, passed.shape)
                    lost = replace(train, terms=(replace(term, offset=0.0),), period_mesh=_ONCE)
                    total[where] += lost.at(passed[where])
        return total

    @property
    def most_pairs(self) -> int:
        """Largest number of pairs in contact at a time."""
        return math.ceil(self.stiffness.total_contact_ratio - 1e-9)

    @cached_property
    def events(self) -> FloatArray:
        """Phases in [0, 1) at which the stiffness of some pair is not smooth."""
        places = [0.0]
        eps = self.stiffness.overlap_ratio
        for train in self.stiffness.trains:
            for term in train.terms:
                edges = np.concatenate([term.pulse.starts, term.pulse.ends])
                places += [*(edges + term.face_start * eps), *(edges + term.face_end * eps)]
        return np.unique(np.round(np.mod(places, 1.0), 12) % 1.0)

    @cached_property
    def _single(self) -> PulseTrain:
        return replace(self.stiffness.healthy, period_mesh=_ONCE)

    def _runout(self, phase: FloatArray, derivative: int) -> FloatArray:
        total = np.zeros(phase.shape)
        for teeth, errors in zip(self.teeth, self.errors, strict=True):
            rate = 2 * math.pi / teeth
            factor = errors.eccentricity_m * (-(rate**2)) ** (derivative // 2)
            total += factor * np.cos(rate * phase + errors.eccentricity_phase_rad)
        return total


@dataclass(frozen=True, kw_only=True, eq=False)
class Ripple:
    """Torque that varies once per turn of a shaft, as couplings out of line make it.

    Parameters
    ----------
    order : float
        Turns of the shaft per turn of shaft 1.
    amplitude : float
        Relative to the mean torque.
    phase_rad : float
    """

    order: float
    amplitude: float
    phase_rad: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive:
    """Motion and load of the train over time.

    Parameters
    ----------
    motion : ShaftMotion
    load : Wander
        Departure of the load from its mean.
    ripples : tuple of Ripple
    static_forcing : ndarray, shape (elements,)
        Accelerations [m/s2] that the mean torques alone would give.
    """

    motion: ShaftMotion
    load: Wander
    ripples: tuple[Ripple, ...]
    static_forcing: FloatArray

    def load_factor(self, time_s: FloatArray, turns: FloatArray) -> FloatArray:
        """Load over its mean."""
        factor = 1.0 + self.load.value(time_s)
        for ripple in self.ripples:
            angle = 2 * math.pi * ripple.order * turns + ripple.phase_rad
            factor += ripple.amplitude * np.cos(angle)
        return factor


def contact_course(
    meshes: tuple[ToothMesh, ...],
    drive: Drive,
    span_s: tuple[float, float],
    longest_step_s: float,
) -> Course:
    """Return the course of all meshes of a train over a span of time.

    Parameters
    ----------
    meshes : tuple of ToothMesh
    drive : Drive
    span_s : (float, float)
        Beginning and end [s].
    longest_step_s : float
        Longest step of the integration [s].
    """
    times = _events(meshes, drive.motion, span_s)
    turns = drive.motion.turns(times)
    phases = np.stack([mesh.phase(turns) for mesh in meshes])
    pairs = max(mesh.most_pairs for mesh in meshes)
    spur = all(mesh.stiffness.overlap_ratio < LEAST_OVERLAP for mesh in meshes)
    nodes = _SPUR_NODES if spur else _HELICAL_NODES
    rows = [_pairs(mesh, phase, pairs, nodes) for mesh, phase in zip(meshes, phases, strict=True)]
    stiffness = np.stack([row[0] for row in rows], axis=2)
    deviation = np.stack([row[1] for row in rows], axis=1)
    forcing = _forcing(meshes, drive, times, turns, phases)
    return divided_course(times, stiffness, deviation, forcing, longest_step_s)


def _events(
    meshes: tuple[ToothMesh, ...], motion: ShaftMotion, span_s: tuple[float, float]
) -> FloatArray:
    """Return the instants between which everything is smooth."""
    turns = motion.turns(np.array(span_s))
    fastest = max(mesh.order / min(mesh.teeth) for mesh in meshes)
    # on a grid of their own, so that a longer recording begins like a shorter one
    spacing = 1 / (POINTS_PER_TURN * fastest * motion.mean_hz)
    grid = np.arange(math.ceil(span_s[0] / spacing), math.floor(span_s[1] / spacing) + 1)
    times = [np.array(span_s), spacing * grid]
    for mesh in meshes:
        first, last = mesh.phase(turns)
        counts = np.arange(math.floor(first), math.ceil(last) + 1)
        wanted = (counts[:, None] + mesh.events).ravel()
        times.append(motion.times_s(mesh.turns(wanted[(wanted > first) & (wanted < last)])))
    return np.asarray(np.clip(np.sort(np.concatenate(times)), *span_s))


def _pairs(
    mesh: ToothMesh, phase: FloatArray, pairs: int, nodes: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return stiffness powers (nodes, pairs, intervals) and deviations (pairs, intervals)."""
    to_powers = np.linalg.inv(nodes[:, None] ** np.arange(len(nodes)))
    before, after = phase[:-1], phase[1:]
    count = np.floor(0.5 * (before + after)).astype(np.int64)
    inside = before - count + (after - before) * nodes[:, None]
    stiffness = np.zeros((len(nodes), pairs, len(count)))
    deviation = np.zeros((pairs, len(count)))
    for earlier in range(mesh.most_pairs):
        values = mesh.pair_stiffness(count - earlier, inside + earlier)
        stiffness[:, earlier] = to_powers @ values
        deviation[earlier] = mesh.pitch_deviation_m(count - earlier)
    return stiffness, deviation


def _forcing(
    meshes: tuple[ToothMesh, ...],
    drive: Drive,
    times: FloatArray,
    turns: FloatArray,
    phases: FloatArray,
) -> FloatArray:
    factor = drive.load_factor(times, turns)
    forcing = drive.static_forcing[:, None] * factor
    speed = drive.motion.speed_hz(times)
    for row, mesh, phase in zip(forcing, meshes, phases, strict=False):
        if not mesh.floating:
            # q is counted from the flanks as runout has them: they accelerate under it
            row -= mesh.runout_curvature_m(phase) * (mesh.order * speed) ** 2
    return forcing
