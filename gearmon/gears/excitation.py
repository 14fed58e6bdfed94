"""Errors that are not damage, and profile that damage has taken: displacement excitation e(t).

An error moves the flanks along the line of action by missing material, pair by pair. Pairs share
the load as their stiffness, so the mesh sees the mean of their errors, weighted by stiffness:
``m z'' + c (z - e)' + k(t) (z - e) = F``. What moves all pairs alike (eccentricity, wobble) needs
no sharing. What eccentricity, cumulative pitch error and misalignment do to the stiffness itself is
in `modulation`; the sharing of the errors of single flanks is that of the stiffness without it.

A pair that lacks material gives way to its neighbours: the mesh sees ``sum_i k_i e_i / sum_i k_i``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from gearmon.arrays import FloatArray
from gearmon.errors import ArgumentError
from gearmon.gears.faults import WHOLE_KINDS, Fault, GearError
from gearmon.gears.modulation import carrying_share
from gearmon.gears.pairs import MeshPair
from gearmon.gears.pulses import Pulse, PulseTerm, PulseTrain
from gearmon.gears.stiffness import MeshStiffness
from gearmon.gears.tooth_damage import tooth_damage
from gearmon.gears.tooth_pairs import ToothPair, teeth_of

#: Gauss points on either side of where the neighbours of a missing tooth change over.
GAP_POINTS = 32
#: Most contacts of faulty teeth, each computed by itself, in a true period.
MOST_CONTACTS = 5_000


def tip_corner_gap(pair: ToothPair, beyond_m: FloatArray, *, leaving: bool) -> FloatArray:
    """Return the gap of a pair just outside its path of contact [m].

    Parameters
    ----------
    pair : ToothPair
        External, or a planet in its ring.
    beyond_m : ndarray, >= 0
        How far the rolling has gone beyond the end of the path, along the line of action [m].
    leaving : bool
        Whether the tip of the first gear is leaving; else that of the second is entering.

    Notes
    -----
    The tip corner of one gear is seen from the centre of the other; the angle from there to the
    flank at the same radius, times the base radius, is the distance along the line of action.
    """
    beyond = np.asarray(beyond_m, dtype=np.float64)
    rolls = pair.rolls(pair.path_m[1] + beyond if leaving else pair.path_m[0] - beyond)
    centres, working = pair.centres_m
    own, mate = (0, 1) if leaving else (1, 0)

    def flank(index: int, radius: FloatArray | float) -> FloatArray:
        """Return the angle of a flank from the line of centres, in the sense of motion."""
        tooth = pair.teeth[index]
        tangent = np.sqrt(np.maximum((radius / tooth.base_radius_m) ** 2 - 1, 0.0))
        rolled = rolls[index] / tooth.base_radius_m - working
        # an external second gear is rolled off while the first one is rolled on
        sign = -1 if index == 1 and not tooth.internal else 1
        return np.asarray(sign * (rolled - (tangent - np.arctan(tangent))))

    radius = pair.teeth[own].tip_radius_m
    corner = radius * np.exp(1j * flank(own, radius))
    # from the centre of its gear to that of the mate; external gears face each other
    seen = corner + (centres if own == 1 else -centres) if centres < 0 else centres - corner.conj()
    ahead = flank(mate, np.abs(seen)) - np.angle(seen)
    # the first gear pushes: its flank stays behind that of the second
    return np.asarray(pair.teeth[mate].base_radius_m * (ahead if leaving else -ahead))


@dataclass(frozen=True, eq=False)
class TurningError:
    """Material missing alike from all pairs in contact, as a gear turns: a few lines of its turn.

    Parameters
    ----------
    gear : str
    teeth : int
        Teeth of the gear: the error repeats after as many mesh periods.
    kind : {"eccentricity", "cumulative", "misalignment", "wear"}
    size_m : float
    phase_rad : float
    free_gap_m : float
        Lead deviation that the load just closes; 0 for teeth without load. The face of a misaligned
        gear touches where it stands out, and is moved by ``g (f - 1)/2`` with g the lead deviation
        and f the part of the face that carries.
    """

    gear: str
    teeth: int
    kind: str
    size_m: float
    phase_rad: float = 0.0
    free_gap_m: float = 0.0

    @property
    def period_mesh(self) -> int:
        """True period [mesh periods]."""
        return 1 if self.kind == "wear" else self.teeth

    def at(self, phase: FloatArray) -> FloatArray:
        """Return the missing material [m] at mesh phases."""
        if self.kind == "wear":
            return np.full(phase.shape, self.size_m)
        turned = np.cos(2 * math.pi * phase / self.teeth + self.phase_rad)
        if self.kind != "misalignment":
            return np.asarray(self.size_m * turned)
        # whichever end of the face stands out carries: twice per turn
        gap = self.size_m * np.abs(turned)
        share = carrying_share(gap, self.free_gap_m)
        return np.asarray(0.5 * gap * (share - 1))


@dataclass(frozen=True, eq=False)
class FlankError:
    """Material missing from one tooth of a gear, or from all of them, along their contact.

    Parameters
    ----------
    gear : str
    teeth : int
        Teeth of the gear.
    tooth : int or None
        The only tooth that it concerns; None for all.
    gap : Pulse
        Missing material [m] over the contact of a pair.
    """

    gear: str
    teeth: int
    tooth: int | None
    gap: Pulse

    @property
    def period_mesh(self) -> int:
        """Mesh periods after which it repeats."""
        return 1 if self.tooth is None else self.teeth


def error_of(
    error: GearError, pair: MeshPair, index: int, free_gap_m: float = 0.0
) -> TurningError | FlankError:
    """Return what an error of a gear takes from the pairs of its mesh.

    Parameters
    ----------
    error : GearError
    pair : MeshPair
    index : {0, 1}
        Gear of the error.
    free_gap_m : float
        Lead deviation that the load just closes, see `TurningError`.

    Raises
    ------
    ArgumentError
        If the gear has no such tooth.
    """
    pair.check_tooth(f"error {error}", error.gear, error.tooth)
    teeth, size, length = pair.teeth[index], error.size_m, pair.contact_ratio
    if error.kind in WHOLE_KINDS:
        return TurningError(error.gear, teeth, error.kind, size, error.phase_rad, free_gap_m)
    power = 0 if error.kind == "pitch" else 2
    # a contact that is nominal, as that of the half-duty forms, may be longer
    edges = [0.0, math.ceil(length) + 1.0]
    gap = Pulse.of(edges, lambda phase: size * (2 * phase / length - 1) ** power, 3)
    return FlankError(error.gear, teeth, error.tooth, gap)


def profile_lost_by(fault: Fault, pair: MeshPair, index: int) -> list[TurningError | FlankError]:
    """Return what damage takes from the profile: wear, through spalls and missing teeth.

    A spall that leaves a part of the face width in contact moves nothing. Even wear moves all
    pairs alike, which shifts the mean and makes no line.
    """
    gear, number = fault.gear, pair.teeth[index]
    if fault.kind == "wear":
        return [TurningError(gear, number, "wear", 1e-3 * fault.size)] if fault.size else []
    if fault.kind not in ("spall", "missing"):
        return []
    teeth = teeth_of(pair)
    if fault.kind == "missing":
        gap = _bridge(teeth)
        return [FlankError(gear, number, fault.tooth, gap)] if gap else []
    tooth = teeth.teeth[index]
    (hole,) = tooth_damage([fault], tooth).holes
    low, high = sorted(teeth.phase_of(index, angle) for angle in hole.angles(tooth))
    if hole.width_m < tooth.face_width_m * (1 - 1e-9) or low == high:
        return []
    return [FlankError(gear, number, fault.tooth, Pulse.constant(low, high, hole.depth_m))]


@lru_cache(maxsize=64)
def _bridge(pair: ToothPair) -> Pulse | None:
    """Return how far the neighbours of a missing tooth must approach to touch."""
    part = pair.contact_ratio - 1
    if part >= 1:
        return None

    def apart(phase: FloatArray, leaving: bool) -> FloatArray:
        beyond = phase - part if leaving else 1 - phase
        return tip_corner_gap(pair, beyond * pair.base_pitch_m, leaving=leaving)

    def gap(phase: FloatArray) -> FloatArray:
        # a gap between the flanks of helical teeth is closed by more along the line of action
        return np.asarray(pair.oblique * np.minimum(apart(phase, True), apart(phase, False)))

    def difference(phase: float) -> float:
        return float(apart(np.array(phase), True) - apart(np.array(phase), False))

    edges = [max(part, 0.0), 1.0]
    if difference(edges[0]) * difference(1.0) < 0:
        # here the neighbour behind takes over from the one ahead
        edges.insert(1, brentq(difference, *edges, xtol=1e-14))
    return Pulse.of(edges, gap, GAP_POINTS)


@dataclass(frozen=True, kw_only=True, eq=False)
class Excitation:
    """Displacement excitation of a mesh.

    Parameters
    ----------
    stiffness : MeshStiffness
        Shares the errors among the pairs in contact.
    errors : tuple of TurningError or FlankError
    warnings : tuple of str
    """

    stiffness: MeshStiffness
    errors: tuple[TurningError | FlankError, ...]
    warnings: tuple[str, ...] = ()

    @property
    def period_mesh(self) -> int:
        """True period [mesh periods], of errors and stiffness together."""
        return math.lcm(self.stiffness.period_mesh, *(error.period_mesh for error in self.errors))

    def at(self, phase: ArrayLike) -> FloatArray:
        """Return e [m] at mesh phases, any shape; positive where material is missing."""
        x = np.asarray(phase, dtype=np.float64)
        turning = (error.at(x) for error in self.errors if isinstance(error, TurningError))
        total = sum(turning, np.zeros(x.shape))
        if self._forces:
            stiffness = replace(self.stiffness, modulations=()).at(x)
            # without any load nothing is transmitted either
            carried = np.where(stiffness > 0, stiffness, 1)
            total = total + sum(force.at(x) for force in self._forces) / carried
        return total

    @cached_property
    def _forces(self) -> list[PulseTrain]:
        """sum_i k_i e_i [N] of every flank error: the force that would close all its gaps."""
        found, healthy = [], self.stiffness.healthy
        periods = [train.period_mesh for train in self.stiffness.pulses]
        for error in self.errors:
            if isinstance(error, FlankError):
                period = math.lcm(error.period_mesh, *periods)
                terms = tuple(self._closing(error, period))
                found.append(replace(healthy, gear=error.gear, period_mesh=period, terms=terms))
        return found

    def _closing(self, error: FlankError, period: int) -> Iterator[PulseTerm]:
        """Give what makes up the stiffness of the pairs with an error, times the error."""
        entries = range((error.tooth or 1) - 1, period, error.period_mesh)
        if len(entries) > MOST_CONTACTS:
            raise ArgumentError(
                f"the errors repeat after {period} mesh periods only, in which their flanks meet "
                f"{len(entries)} times, more than {MOST_CONTACTS}; ask for errors and faults of "
                f"one gear at a time"
            )
        for train in self.stiffness.trains:
            for term in train.terms:
                # a term without pieces takes nothing
                if len(term.pulse.series):
                    gap = term.pulse * error.gap
                    for entry in entries:
                        if (entry - round(term.offset)) % train.period_mesh == 0:
                            yield replace(term, pulse=gap, offset=float(entry))


def displacement_excitation(
    pair: MeshPair,
    stiffness: MeshStiffness,
    errors: Iterable[GearError] = (),
    faults: Iterable[Fault] = (),
) -> Excitation:
    """Return the displacement excitation of a mesh by errors and by profile lost to damage.

    Parameters
    ----------
    pair : MeshPair
    stiffness : MeshStiffness
        Of this mesh, with its faults; under a known force misaligned faces close their gaps.
    errors : iterable of GearError
        Of this stage; those of gears of other meshes are left aside. An error of 0 moves nothing.
    faults : iterable of Fault
        Wear, missing teeth and spalls across the whole face move the flanks too.

    Returns
    -------
    Excitation

    Raises
    ------
    ArgumentError
        If a gear has no such tooth.
    """
    names = pair.names
    found: list[TurningError | FlankError] = []
    notes: list[str] = []
    for error in errors:
        if error.gear not in names:
            notes.append(f"error {error} does not act in the {pair.name} mesh")
            continue
        moved = error_of(error, pair, names.index(error.gear), stiffness.free_gap_m)
        if error.size_m:
            found.append(moved)
    for fault in faults:
        if fault.gear in names and not fault.is_loss:
            found += profile_lost_by(fault, pair, names.index(fault.gear))
    return Excitation(stiffness=stiffness, errors=tuple(found), warnings=tuple(notes))
