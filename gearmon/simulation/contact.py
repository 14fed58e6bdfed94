"""Which tooth pairs are in contact when, how stiff they are and how far off their flanks are.

A mesh advances by one mesh period per tooth. The pair that enters contact at count n stays for the
contact ratio; it is made of tooth n mod z1 of the first gear and tooth n mod z2 of the second
(counted from 0), and brings the stiffness, the damage and the pitch deviations of these two. Runout
of the gears moves the flanks to and fro once per turn: it shifts the instants of contact and
accelerates the mesh.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from gearmon.arrays import FloatArray, IntArray
from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.gears.faults import GearError
from gearmon.gears.mechanics import StageMechanics
from gearmon.gears.pulses import LEAST_OVERLAP
from gearmon.simulation.integrate import Course, divided_course

#: Share of the tolerance that a machine tool uses up.
TOLERANCE_USED = 0.7
# A single pitch deviation is the difference of two independent ones; among the teeth of a gear
# the largest of them is about three standard deviations of one tooth.
_LARGEST_OVER_DEVIATION = 3.0


#: Band of the wander [Hz].
WANDER_BAND_HZ = (0.05, 2.0)
#: Cosines in the sum.
WANDER_LINES = 16
# Newton's method doubles its digits: four steps for the usual wander, more for a wild one.
_NEWTON_STEPS, _TIME_ERROR_S = 60, 1e-11
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
    profile_m : float
        Missing at both ends of the contact of all teeth, with nothing missing in its middle [m].
    """

    pitch_m: FloatArray
    eccentricity_m: float
    eccentricity_phase_rad: float
    profile_m: float = 0.0

    def __post_init__(self) -> None:
        # deviations are read by tooth number for as long as the machine exists
        self.pitch_m.setflags(write=False)

    def with_error(self, error: GearError) -> GearErrors:
        """Return the errors with a further one.

        Raises
        ------
        ArgumentError
            If it is of a kind that is not simulated, or there is no such tooth.
        """
        place, size = np.arange(len(self.pitch_m)), error.size_m
        if error.kind == "eccentricity":
            own = cmath.rect(self.eccentricity_m, self.eccentricity_phase_rad)
            size, phase = cmath.polar(own + cmath.rect(size, error.phase_rad))
            return replace(self, eccentricity_m=size, eccentricity_phase_rad=phase)
        if error.kind == "cumulative":
            wave = np.cos(2 * math.pi * place / len(place) + error.phase_rad)
            return replace(self, pitch_m=self.pitch_m + size * wave)
        if error.kind == "pitch" and (error.tooth or 0) <= len(place):
            return replace(self, pitch_m=self.pitch_m + size * (place + 1 == error.tooth))
        if error.kind == "profile" and error.tooth is None:
            return replace(self, profile_m=self.profile_m + size)
        raise ArgumentError(
            f"error {error}: of a gear of {len(place)} teeth eccentricity, cumulative, pitch and, "
            "of all teeth alike, profile are simulated"
        )


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
    return 1e-6 * (0.001 * d + 0.4 * m + 5) * math.pow(2.0, 0.5 * (grade - 5))


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
    return 1e-6 * 0.9 * total * math.pow(2.0, 0.5 * (grade - 5))


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


@dataclass(frozen=True, kw_only=True, eq=False)
class Wander:
    """A slow random departure from a nominal value, relative to it.

    Parameters
    ----------
    amplitudes, frequencies_hz, phases_rad : ndarray, shape (lines,)
        Cosines whose sum it is.
    """

    amplitudes: FloatArray
    frequencies_hz: FloatArray
    phases_rad: FloatArray

    def value(self, time_s: ArrayLike) -> FloatArray:
        """Departure at the given times (any shape)."""
        return self._sum(time_s, np.cos, self.amplitudes)

    def integral(self, time_s: ArrayLike) -> FloatArray:
        """Integral of the departure from time 0 [s]."""
        weights = self.amplitudes / (2 * math.pi * self.frequencies_hz)
        return self._sum(time_s, np.sin, weights) - self._sum(0.0, np.sin, weights)

    def _sum(self, time_s: ArrayLike, wave: np.ufunc, weights: FloatArray) -> FloatArray:
        time, rates = np.asarray(time_s, dtype=np.float64), 2 * math.pi * self.frequencies_hz
        total = np.zeros(time.shape)
        for line in np.flatnonzero(weights):
            total += weights[line] * wave(rates[line] * time + self.phases_rad[line])
        return total


def random_wander(deviation: float, generator: np.random.Generator) -> Wander:
    """Draw a wander with the given standard deviation over a long time.

    Parameters
    ----------
    deviation : float, 0 to 0.1
        Standard deviation relative to the nominal value.
    generator : numpy.random.Generator

    Notes
    -----
    A random walk has a power density that falls as 1/f^2; lines at equal ratios of frequency then
    carry powers that fall as 1/f.
    """
    low, high = np.log(WANDER_BAND_HZ)
    place = (np.arange(WANDER_LINES) + generator.random(WANDER_LINES)) / WANDER_LINES
    frequencies = np.exp(low + (high - low) * place)
    amplitudes = 1 / np.sqrt(frequencies)
    amplitudes *= deviation * math.sqrt(2) / np.linalg.norm(amplitudes)
    phases = generator.uniform(0, 2 * math.pi, WANDER_LINES)
    return Wander(amplitudes=amplitudes, frequencies_hz=frequencies, phases_rad=phases)


@dataclass(frozen=True, kw_only=True, eq=False)
class ShaftMotion:
    """Motion of shaft 1.

    Parameters
    ----------
    mean_hz : float
        Speed about which it wanders [Hz].
    wander : Wander
        Departure of the speed, always above -1.
    start_turns : float
        Angle at time 0 [turns].
    """

    mean_hz: float
    wander: Wander
    start_turns: float = 0.0

    def __post_init__(self) -> None:
        check_positive("mean_hz", self.mean_hz, "Hz")

    def speed_hz(self, time_s: ArrayLike) -> FloatArray:
        """Speed at the given times [Hz]."""
        return self.mean_hz * (1.0 + self.wander.value(time_s))

    def turns(self, time_s: ArrayLike) -> FloatArray:
        """Angle at the given times [turns]."""
        time = np.asarray(time_s, dtype=np.float64)
        return self.start_turns + self.mean_hz * (time + self.wander.integral(time))

    def times_s(self, turns: ArrayLike) -> FloatArray:
        """Return the times at which the angle is `turns` [s]."""
        wanted = np.asarray(turns, dtype=np.float64)
        time = (wanted - self.start_turns) / self.mean_hz
        for _ in range(_NEWTON_STEPS):
            change = (self.turns(time) - wanted) / self.speed_hz(time)
            time = time - change
            if not np.any(np.abs(change) > _TIME_ERROR_S):
                break
        return time


@dataclass(frozen=True, kw_only=True, eq=False)
class ToothMesh:
    """One mesh of two gears, tooth by tooth.

    Parameters
    ----------
    mechanics : StageMechanics
        At the mean load, with the damage that acts in this mesh.
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
    backlash_m : float
        Along the line of action [m].
    place_turns : float
        Of a planet, its angle on the carrier from the first planet [turns].
    floating : bool
        Whether a gear of the set gives way to runout, as the sun between its planets does: then
        runout shifts the instants of contact only.
    """

    mechanics: StageMechanics
    name: str
    order: float
    offset: float
    teeth: tuple[int, int]
    errors: tuple[GearErrors, GearErrors]
    base_pitch_m: float
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

    def runout_m(self, phase: FloatArray, derivative: int = 0) -> FloatArray:
        """Once-per-turn part of the missing material of both gears [m].

        An even derivative of it with respect to the mesh phase, if wanted.
        """
        total = np.zeros(phase.shape)
        for teeth, errors in zip(self.teeth, self.errors, strict=True):
            rate = 2 * math.pi / teeth
            factor = errors.eccentricity_m * (-(rate**2)) ** (derivative // 2)
            total += factor * np.cos(rate * phase + errors.eccentricity_phase_rad)
        return total

    def pitch_deviation_m(self, count: IntArray) -> FloatArray:
        """Missing material of the pair that enters contact at mesh phase `count` [m]."""
        first, second = (errors.pitch_m for errors in self.errors)
        return np.asarray(first[count % self.teeth[0]] + second[count % self.teeth[1]])

    def pair_stiffness(self, count: IntArray, passed: FloatArray) -> FloatArray:
        """Stiffness [N/m] of the pair `count` when `passed` mesh periods of its contact are over.

        `count` must broadcast against `passed`.
        """
        stiffness = self.mechanics.stiffness
        total = replace(stiffness.healthy, period_mesh=_ONCE).at(passed)
        for train in stiffness.pulses:
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
        return math.ceil(self.mechanics.stiffness.total_contact_ratio - 1e-9)

    @cached_property
    def events(self) -> FloatArray:
        """Phases in [0, 1) at which the stiffness of some pair is not smooth."""
        stiffness = self.mechanics.stiffness
        terms = (term for train in stiffness.trains for term in train.terms)
        corners = [term.corners(stiffness.overlap_ratio) for term in terms]
        places = np.concatenate([np.zeros(1), *corners])
        return np.unique(np.round(np.mod(places, 1.0), 12) % 1.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive:
    """Motion and load of the train over time.

    Parameters
    ----------
    motion : ShaftMotion
    load : Wander
        Departure of the load from its mean.
    ripples : tuple of (float, float, float)
        Torque that varies once per turn of a shaft, as couplings out of line make it: turns of the
        shaft per turn of shaft 1, amplitude relative to the mean torque, and phase [rad].
    """

    motion: ShaftMotion
    load: Wander
    ripples: tuple[tuple[float, float, float], ...]

    def load_factor(self, time_s: FloatArray, turns: FloatArray) -> FloatArray:
        """Load over its mean."""
        factor = 1.0 + self.load.value(time_s)
        for order, amplitude, phase_rad in self.ripples:
            factor += amplitude * np.cos(2 * math.pi * order * turns + phase_rad)
        return factor


def contact_course(
    meshes: tuple[ToothMesh, ...], drive: Drive, span_s: tuple[float, float], longest_step_s: float
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
    speed = drive.motion.speed_hz(times)
    spur = all(mesh.mechanics.stiffness.overlap_ratio < LEAST_OVERLAP for mesh in meshes)
    nodes = _SPUR_NODES if spur else _HELICAL_NODES
    to_powers = np.linalg.inv(nodes[:, None] ** np.arange(len(nodes)))
    pairs, inputs = max(mesh.most_pairs for mesh in meshes), [drive.load_factor(times, turns)]
    stiffness = np.zeros((len(nodes), pairs, len(meshes), len(times) - 1))
    deviation = np.zeros(stiffness.shape[1:])
    for number, mesh in enumerate(meshes):
        phase = mesh.phase(turns)
        before, after = phase[:-1], phase[1:]
        count = np.floor(0.5 * (before + after)).astype(np.int64)
        inside = before - count + (after - before) * nodes[:, None]
        for earlier in range(mesh.most_pairs):
            values = mesh.pair_stiffness(count - earlier, inside + earlier)
            stiffness[:, earlier, number] = to_powers @ values
            deviation[earlier, number] = mesh.pitch_deviation_m(count - earlier)
        # deflections are counted from the flanks as runout has them: its acceleration is felt
        if not mesh.floating:
            inputs.append(mesh.runout_m(phase, 2) * (mesh.order * speed) ** 2)
    return divided_course(times, stiffness, deviation, np.stack(inputs), longest_step_s)


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
