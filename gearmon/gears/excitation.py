"""Errors of gears, and profile that damage has taken: what they move, and what they modulate.

An error moves the flanks along the line of action by missing material, pair by pair. Pairs share
the load as their stiffness, so the mesh sees the mean of their errors, weighted by stiffness, the
displacement excitation ``e = sum_i k_i e_i / sum_i k_i``:
``m z'' + c (z - e)' + k(t) (z - e) = F``. What moves all pairs alike (eccentricity, wobble) needs
no sharing.

Eccentricity, slow cumulative pitch error and misalignment also change the contact of all teeth of a
gear once per turn. The mesh stiffness is that of the contact as it is at each instant,
K(phase; theta): quasi-static, exact for the teeth in that contact. Its coefficients at mesh order m
and gear order s are those of a Fourier series in theta,

    c_{m,s} = <exp(-2 pi i m b(theta)) P_m(l(theta)) f(theta) exp(-i s theta)>

with P_m the transform of the pulse of one pair whose contact ratio is l smaller, b its delay and f
the part of the face that carries. With l = 0 and f = 1 that is ``P_m i^s J_s(2 pi m |b|)`` up to
the phase: the phase modulation of McFadden, whose index grows with the mesh harmonic. The errors of
single flanks are shared by the stiffness without it.

Let a gear stand off by d along the line of action (d_t, away from its mate) and along the normal of
its flank (d_n, from the first gear to the second). The line of action, a tangent of both base
circles, then turns by d_n/L and its length between the tangent points, L = a sin(alpha_w), changes,
so that a pair enters later by b and leaves earlier by a, in mesh periods,

    a = (+-r_b1 d_n/L + s d_t)/p_b,    b = (r_b2 d_n/L + (1 - s) d_t)/p_b

(lower sign: internal), to the first order in d/L. Their sum is what the contact ratio loses, that
is its derivative with respect to the centre distance; half their difference is the shift of the
contact, the phase modulation of the stiffness. s is the share of d_t by which the first gear runs
ahead of even rotation, the rest being the second gear's lag. Two gears free to turn do so below
their resonance in inverse proportion to their masses at the line of action, here those of discs of
equal width.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import chebyshev
from numpy.polynomial.legendre import legint, legvander
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.errors import ArgumentError
from gearmon.gears.damage import acting_faults
from gearmon.gears.faults import WHOLE_KINDS, Fault, GearError
from gearmon.gears.pairs import MeshPair
from gearmon.gears.pulses import (
    LEAST_OVERLAP,
    LEAST_PIECE,
    POINTS,
    Pulse,
    PulseTerm,
    PulseTrain,
    distinct,
    panel_nodes,
)
from gearmon.gears.tooth_damage import tooth_damage
from gearmon.gears.tooth_pairs import ToothPair, teeth_of

if TYPE_CHECKING:
    from gearmon.gears.stiffness import MeshStiffness

#: Rounds of putting a corner where the contact is when it is reached; each gains two digits.
ROUNDS = 8
#: Chebyshev points of the loss of contact tried one after the other, until pulses have converged.
NODES = (3, 5, 9, 17)
CONVERGED = 1e-10
#: Phases evaluated together; bounds the memory.
PHASES_PER_BLOCK = 16_384
#: Gauss points on either side of where the neighbours of a missing tooth change over.
GAP_POINTS = 32
#: Most contacts of faulty teeth, each computed by itself, in a true period.
MOST_CONTACTS = 5_000


@dataclass(frozen=True)
class ContactOffset:
    """How the errors of one gear move the contact, as it turns.

    Parameters
    ----------
    gear : str
    teeth : int
    leaving, entering : complex
        a and b are their real parts after multiplication by ``exp(2 pi i phase/teeth)``
        [mesh periods].
    lead_m : complex
        Lead deviation across the face, likewise [m].
    """

    gear: str
    teeth: int
    leaving: complex = 0j
    entering: complex = 0j
    lead_m: complex = 0j


def contact_offsets(pair: MeshPair, errors: Sequence[GearError]) -> tuple[ContactOffset, ...]:
    """Return how errors move the contact, one entry for each gear that has such errors.

    Parameters
    ----------
    pair : MeshPair
        With a module.
    errors : sequence of GearError
        Of whole gears.
    """
    found = []
    for index, member in enumerate(pair.members):
        own = [_moved(error, pair, index) for error in errors if error.gear == member.name]
        moved = np.sum(own, axis=0).tolist() if own else []
        if any(moved):
            found.append(ContactOffset(member.name, pair.teeth[index], *moved))
    return tuple(found)


def state_of(
    offsets: Sequence[ContactOffset], phase: FloatArray, free_gap_m: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a and b [mesh periods] with gears turned, and the part of the face that carries.

    Parameters
    ----------
    offsets : sequence of ContactOffset
    phase : ndarray
        [mesh periods].
    free_gap_m : float
        Lead deviation that the load just closes.
    """
    moved = [(own.leaving, own.entering, own.lead_m) for own in offsets]
    turns = np.multiply.outer(phase, [2j * np.pi / own.teeth for own in offsets])
    leaving, entering, lead = np.moveaxis((np.exp(turns) @ np.array(moved)).real, -1, 0)
    return leaving, entering, carrying_share(np.abs(lead), free_gap_m)


def first_gear_share(pair: MeshPair) -> float:
    """Return s, the share of a transmission error by which the first gear moves."""
    one, two = (float(teeth) ** 2 for teeth in pair.teeth)
    return 1.0 if pair.second.internal else two / (one + two)


def _moved(error: GearError, pair: MeshPair, index: int) -> tuple[complex, complex, complex]:
    """Return a, b [mesh periods] and the lead [m] of one error, as turning amplitudes."""
    size = error.size_m * cmath.exp(1j * error.phase_rad)
    if error.kind == "misalignment":
        return 0j, 0j, size
    geometry = pair.geometry
    share = first_gear_share(pair)
    along = size / geometry.base_pitch_m
    if error.kind == "cumulative":
        # a tooth that stands back meets its mate farther down the line of action
        own = -(1 - share) if index == 0 else share
        return own * along, -own * along, 0j
    external = not pair.second.internal
    # d_t = e cos x; the offset turns with its gear: those of external gears turn against each other
    normal = -1j * along if index == 1 and external else 1j * along
    one, two = (radius / geometry.line_m for radius in geometry.base_radii_m)
    leaving = (one if external else -one) * normal + share * along
    return leaving, two * normal + (1 - share) * along, 0j


def carrying_share(gap_m: FloatArray, free_gap_m: float) -> FloatArray:
    """Return the part of the face width that carries, in (0, 1].

    Parameters
    ----------
    gap_m : ndarray
        Lead deviation across the face, >= 0 [m].
    free_gap_m : float
        That which the load just closes: 2 F/k [m].

    Notes
    -----
    A face of even stiffness under a linear gap: ``f = min(1, sqrt(2 F/(k g)))``, as b_cal/b of
    ISO 6336-1 for K_Hbeta.
    """
    wide = gap_m > free_gap_m
    return np.sqrt(np.where(wide, free_gap_m / np.where(wide, gap_m, 1.0), 1.0))


@dataclass(frozen=True, eq=False)
class ContactFamily:
    """Pulses of one pair over the loss of contact ratio.

    The pulse of a pair is a smooth function of what its contact ratio has lost, piece by piece,
    with edges that move. It is interpolated in Chebyshev points of that loss.

    Parameters
    ----------
    largest : float
        Loss of contact ratio reached to either side [mesh periods].
    edges : ndarray, shape (nodes, pieces + 1)
        Chebyshev coefficients of the edges of the pieces, from the entry of the pair.
    series : ndarray, shape (nodes, pieces, degree + 1)
        Chebyshev coefficients of the Legendre coefficients on each piece [N/m].
    overlap_ratio : float
    """

    largest: float
    edges: FloatArray
    series: FloatArray
    overlap_ratio: float

    @classmethod
    def of(
        cls, member: Callable[[float], Pulse], largest: float, overlap_ratio: float
    ) -> ContactFamily:
        """Return the family through the pulses that `member` gives for losses of contact ratio.

        One that keeps its length where they have not the same pieces: a zone of contact vanishes.
        """
        pieces = len(member(0.0).series)
        for count in NODES if largest else (1,):
            x = chebyshev.chebpts1(count)
            pulses = [member(float(largest * value)) for value in x]
            if any(len(pulse.series) != pieces for pulse in pulses):
                return cls.of(member, 0.0, overlap_ratio)
            width = max(pulse.series.shape[1] for pulse in pulses)
            wide = [(0, width - pulse.series.shape[1]) for pulse in pulses]
            padded = [np.pad(p.series, ((0, 0), w)) for p, w in zip(pulses, wide, strict=True)]
            analysis = np.linalg.inv(chebyshev.chebvander(x, count - 1))
            edges = analysis @ np.array([pulse.edges for pulse in pulses])
            series = np.tensordot(analysis, np.array(padded), 1)
            if np.abs(series[-1]).max() <= CONVERGED * np.abs(series[0]).max():
                break
        return cls(largest, edges, series, overlap_ratio)

    def pulse(self, lost: float) -> Pulse:
        """Return the pulse for one loss of contact ratio."""
        (terms,) = self._terms(np.array([lost]))
        return Pulse(terms @ self.edges, np.tensordot(terms, self.series, 1))

    def limits(self, lost: FloatArray) -> FloatArray:
        """Return the edges of the pieces for losses of contact ratio, shape (n, pieces + 1)."""
        return np.asarray(self._terms(lost) @ self.edges)

    def entry(self, leaving: FloatArray, entering: FloatArray) -> FloatArray:
        """Return when a pair enters [mesh periods]: the middle of its contact shifts by (b - a)/2.

        A contact whose length is nominal, as that of the half-duty forms, keeps it.
        """
        lengths = self.limits(leaving + entering)[:, -1]
        return np.asarray(0.5 * (entering - leaving + self.pulse(0.0).length - lengths))

    def at(self, phase: FloatArray, leaving: FloatArray, entering: FloatArray) -> FloatArray:
        """Return the mesh stiffness [N/m] at phases with a contact each, shape (n,)."""
        count = math.ceil(len(phase) / PHASES_PER_BLOCK) or 1
        blocks = zip(*(np.array_split(x, count) for x in (phase, leaving, entering)), strict=True)
        return np.concatenate([self._at(*block) for block in blocks])

    def _at(self, phase: FloatArray, leaving: FloatArray, entering: FloatArray) -> FloatArray:
        terms = self._terms(leaving + entering)
        edges = self.limits(leaving + entering)
        turned = np.mod(phase - self.entry(leaving, entering), 1.0)
        eps = self.overlap_ratio
        total = np.zeros(len(phase))
        for turn in range(math.ceil(float(edges[:, -1].max()) + eps)):
            x = turned + turn
            if eps < LEAST_OVERLAP:
                total += self._sum(terms, edges, x, running=False)
            else:
                early, late = (self._sum(terms, edges, y, running=True) for y in (x, x - eps))
                total += (early - late) / eps
        return total

    def _sum(
        self, terms: FloatArray, edges: FloatArray, x: FloatArray, *, running: bool
    ) -> FloatArray:
        """Values of pulses at one place each, or their integrals up to there."""
        total, series = np.zeros(len(x)), self._primitives if running else self.series
        for piece in range(series.shape[1]):
            low, high = edges[:, piece], edges[:, piece + 1]
            here = np.flatnonzero((x >= low) & (running | (x < high)))
            low, high = low[here], high[here]
            t = (2 * np.minimum(x[here], high) - low - high) / (high - low)
            powers = legvander(t, series.shape[2] - 1)
            found = np.einsum("pn,pn->p", terms[here] @ series[:, piece], powers)
            total[here] += 0.5 * (high - low) * found if running else found
        return total

    @cached_property
    def _primitives(self) -> FloatArray:
        """Series of the running integrals over -1 ... 1, shape (nodes, pieces, degree + 2)."""
        return np.asarray(legint(self.series, lbnd=-1, axis=2))

    def _terms(self, lost: FloatArray) -> FloatArray:
        share = lost / self.largest if self.largest else 0 * lost
        return np.asarray(chebyshev.chebvander(np.clip(share, -1.0, 1.0), len(self.edges) - 1))


@dataclass(frozen=True, kw_only=True, eq=False)
class ModulationTrain:
    """What turning gears change of the mesh stiffness: a part with a period of its own.

    Parameters
    ----------
    family : ContactFamily
    offsets : tuple of ContactOffset
        One, or two for both gears.
    free_gap_m : float
        Lead deviation that the load just closes.
    """

    family: ContactFamily
    offsets: tuple[ContactOffset, ...]
    free_gap_m: float

    @property
    def period_mesh(self) -> int:
        """Period [mesh periods]: the teeth of the gear, or the hunting period."""
        return math.lcm(*(offset.teeth for offset in self.offsets))

    def at(self, phase: ArrayLike) -> FloatArray:
        """Return this part of the stiffness [N/m] at `phase` [mesh periods], any shape."""
        x = np.asarray(phase, dtype=np.float64)
        return self._turning(x) - self._still.at(x)

    def coefficients(self, orders: ArrayLike) -> ComplexArray:
        """Return the Fourier coefficients [N/m] at whole orders of its period.

        Parameters
        ----------
        orders : array_like of int, shape (n,)
            r: order r/period_mesh of the mesh frequency; 0 gives the mean.
        """
        r, period = np.atleast_1d(np.asarray(orders, dtype=np.int64)), self.period_mesh
        edges = np.append(np.mod(self.corners, period), [0.0, period])
        points = POINTS + self.family.series.shape[2]
        curve = Pulse.of(distinct(edges, LEAST_PIECE), self._turning, points)
        total, of_mesh = curve.transform(r / period) / period, r % period == 0
        total[of_mesh] -= self._still.coefficients(r[of_mesh] // period)
        return total

    @cached_property
    def _still(self) -> PulseTrain:
        """The mesh with no gear moving."""
        return PulseTrain.healthy(self.family.pulse(0.0), self.family.overlap_ratio)

    def _turning(self, phase: FloatArray) -> FloatArray:
        """Return the mesh stiffness [N/m] with the gears moving."""
        flat = phase.ravel()
        leaving, entering, share = state_of(self.offsets, flat, self.free_gap_m)
        found = share * self.family.at(flat, leaving, entering)
        return np.asarray(found.reshape(phase.shape))

    @cached_property
    def corners(self) -> FloatArray:
        """Phases of a period at which the stiffness with the gears moving is not smooth."""
        family, entries = self.family, np.arange(self.period_mesh)[:, None, None]
        edges = np.arange(family.edges.shape[1])
        face = np.array([0.0, family.overlap_ratio])[:, None]
        place = entries + face + family.limits(np.zeros(1))[:, edges]
        # put where the contact is when it is reached
        for _ in range(ROUNDS):
            flat = place.ravel()
            leaving, entering, _ = state_of(self.offsets, flat, self.free_gap_m)
            own = family.limits(leaving + entering).reshape(*place.shape, -1)
            entry = family.entry(leaving, entering).reshape(place.shape)
            place = entries + face + entry + own[..., edges, edges]
        kinks = [self._kinks(offset) for offset in self.offsets if offset.lead_m]
        return np.concatenate([place.ravel(), *kinks])

    def _kinks(self, offset: ContactOffset) -> FloatArray:
        """Return phases at which a wobbling gear changes the end of its face or lifts off."""
        size, angle = abs(offset.lead_m), cmath.phase(offset.lead_m)
        inner = math.acos(min(1.0, self.free_gap_m / size))
        ends = [inner, math.pi - inner, math.pi + inner, -inner, 0.5 * math.pi, 1.5 * math.pi]
        turns = np.arange(0, self.period_mesh, offset.teeth)
        return np.add.outer(turns, (np.array(ends) - angle) / (2 * math.pi) * offset.teeth).ravel()


def modulation_trains(
    pair: MeshPair, errors: Iterable[GearError], member: Callable[[float], Pulse], free_gap_m: float
) -> tuple[tuple[ModulationTrain, ...], list[str]]:
    """Return what errors of turning gears change of a mesh stiffness, and notes.

    Parameters
    ----------
    pair : MeshPair
    errors : iterable of GearError
        That act in this mesh.
    member : callable
        Gives the pulse [N/m] of a pair whose contact ratio is so much smaller.
    free_gap_m : float
        Lead deviation that the load just closes; 0 where that is not known.

    Notes
    -----
    Where a zone of contact would vanish (the contact ratio swings across a whole number) only the
    delay of the contact is taken, at its usual length.
    """
    moving, notes = [], []
    for error in errors:
        if error.kind not in WHOLE_KINDS or not error.size_m:
            continue
        missing = "the static tooth force is not known" if not free_gap_m else ""
        if error.kind != "misalignment":
            missing = "module_mm is missing" if pair.stage.module_mm is None else ""
        if missing:
            notes.append(f"error {error} moves the flanks only, not the stiffness: {missing}")
        else:
            moving.append(error)
    offsets = contact_offsets(pair, moving)
    if not offsets:
        return (), notes
    largest = sum(abs(offset.leaving + offset.entering) for offset in offsets)
    family = ContactFamily.of(member, largest, pair.overlap_ratio)
    if family.largest < largest:
        notes.append(
            f"the errors of {' and '.join(o.gear for o in offsets)} change the contact ratio "
            f"{pair.contact_ratio:.4g} by up to {largest:.2g}, across a whole number: only the "
            f"delay of the contact modulates the stiffness, not its length"
        )
    return (ModulationTrain(family=family, offsets=offsets, free_gap_m=free_gap_m),), notes


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
class FlankError:
    """Material missing from the flanks of a gear.

    Parameters
    ----------
    wrong : GearError or Fault
        What is wrong with the gear.
    period_mesh : int
        Mesh periods after which it repeats: the teeth of the gear, or 1.
    gap : Pulse or None
        Missing material [m] over the contact of a pair; None where all pairs miss it alike.
    """

    wrong: GearError | Fault
    period_mesh: int
    gap: Pulse | None = None

    def at(self, phase: FloatArray, free_gap_m: float) -> FloatArray:
        """Return what all pairs miss alike [m] at mesh phases.

        Parameters
        ----------
        phase : ndarray
        free_gap_m : float
            Lead deviation that the load just closes; 0 for teeth without load. The face of a
            misaligned gear touches where it stands out, and is moved by ``g (f - 1)/2`` with g the
            lead deviation and f the part of the face that carries.
        """
        if isinstance(self.wrong, Fault):
            # even wear, which shifts the mean and makes no line
            return np.full(phase.shape, 1e-3 * self.wrong.size)
        turned = np.cos(2 * math.pi * phase / self.period_mesh + self.wrong.phase_rad)
        if self.wrong.kind != "misalignment":
            return np.asarray(self.wrong.size_m * turned)
        # whichever end of the face stands out carries: twice per turn
        gap = self.wrong.size_m * np.abs(turned)
        return np.asarray(0.5 * gap * (carrying_share(gap, free_gap_m) - 1))


def _moved_by(wrong: GearError | Fault, pair: MeshPair) -> FlankError | None:
    """Return what an error, wear, a through spall or a missing tooth takes from the pairs."""
    index, gap = pair.names.index(wrong.gear), None
    if isinstance(wrong, Fault):
        if wrong.kind == "missing":
            gap = _bridge(teeth_of(pair))
        elif wrong.kind == "spall":
            teeth = teeth_of(pair)
            tooth = teeth.teeth[index]
            (hole,) = tooth_damage([wrong], tooth).holes
            low, high = sorted(teeth.phase_of(index, angle) for angle in hole.angles(tooth))
            # one that leaves a part of the face takes nothing
            if hole.width_m >= tooth.face_width_m * (1 - 1e-9) and low < high:
                gap = Pulse.constant(low, high, hole.depth_m)
        is_moving = gap is not None or (wrong.kind == "wear" and wrong.size > 0)
    else:
        size, length, is_moving = wrong.size_m, pair.contact_ratio, bool(wrong.size_m)
        if is_moving and wrong.kind not in WHOLE_KINDS:
            power = 0 if wrong.kind == "pitch" else 2
            # a contact that is nominal, as that of the half-duty forms, may be longer
            edges = [0.0, math.ceil(length) + 1.0]
            gap = Pulse.of(edges, lambda phase: size * (2 * phase / length - 1) ** power, 3)
    is_turning = wrong.tooth is not None or wrong.kind in WHOLE_KINDS
    period = pair.teeth[index] if is_turning else 1
    return FlankError(wrong, period, gap) if is_moving else None


@lru_cache(maxsize=64)
def _bridge(pair: ToothPair) -> Pulse | None:
    """Return how far the neighbours of a missing tooth must approach to touch."""
    part = pair.contact_ratio - 1
    if part >= 1:
        return None

    def apart(phase: FloatArray, leaving: bool) -> FloatArray:
        beyond = phase - part if leaving else 1 - phase
        return tip_corner_gap(pair, beyond * pair.base_pitch_m, leaving=leaving)

    def difference(phase: float) -> float:
        return float(apart(np.array(phase), True) - apart(np.array(phase), False))

    edges = [max(part, 0.0), 1.0]
    if difference(edges[0]) * difference(1.0) < 0:
        # here the neighbour behind takes over from the one ahead
        edges.insert(1, brentq(difference, *edges, xtol=1e-14))
    limits = np.array(edges)
    phase = panel_nodes(limits, GAP_POINTS)
    # a gap between the flanks of helical teeth is closed by more along the line of action
    return Pulse.through(limits, pair.oblique * np.minimum(apart(phase, True), apart(phase, False)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Excitation:
    """Displacement excitation of a mesh.

    Parameters
    ----------
    stiffness : MeshStiffness
        Shares the errors among the pairs in contact.
    errors : tuple of FlankError
    """

    stiffness: MeshStiffness
    errors: tuple[FlankError, ...]

    @property
    def period_mesh(self) -> int:
        """True period [mesh periods], of errors and stiffness together."""
        return math.lcm(self.stiffness.period_mesh, *(error.period_mesh for error in self.errors))

    def at(self, phase: ArrayLike) -> FloatArray:
        """Return e [m] at mesh phases, any shape; positive where material is missing."""
        x = np.asarray(phase, dtype=np.float64)
        whole = [error for error in self.errors if error.gap is None]
        total = sum((own.at(x, self.stiffness.free_gap_m) for own in whole), np.zeros(x.shape))
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
            if error.gap is not None:
                period, gear = math.lcm(error.period_mesh, *periods), error.wrong.gear
                terms = tuple(self._closing(error, error.gap, period))
                found.append(replace(healthy, gear=gear, period_mesh=period, terms=terms))
        return found

    def _closing(self, error: FlankError, gap: Pulse, period: int) -> Iterator[PulseTerm]:
        """Give what makes up the stiffness of the pairs with an error, times the error."""
        entries = range((error.wrong.tooth or 1) - 1, period, error.period_mesh)
        if len(entries) > MOST_CONTACTS:
            raise ArgumentError(
                f"the errors repeat after {period} mesh periods only, in which their flanks meet "
                f"{len(entries)} times, more than {MOST_CONTACTS}; ask for errors and faults of "
                f"one gear at a time"
            )
        for train in self.stiffness.trains:
            for term in train.terms:
                closed = term.pulse * gap
                if len(closed.series):
                    for entry in entries:
                        if (entry - round(term.offset)) % train.period_mesh == 0:
                            yield replace(term, pulse=closed, offset=float(entry))


def displacement_excitation(
    pair: MeshPair, stiffness: MeshStiffness, faults: Iterable[Fault | GearError] = ()
) -> Excitation:
    """Return the displacement excitation of a mesh by errors and by profile lost to damage.

    Parameters
    ----------
    pair : MeshPair
    stiffness : MeshStiffness
        Of this mesh, with its faults; under a known force misaligned faces close their gaps.
    faults : iterable of Fault or GearError
        Of this stage; those that act in other meshes only are left aside, and an error of 0 moves
        nothing. Wear, missing teeth and spalls across the whole face move the flanks too.

    Returns
    -------
    Excitation

    Raises
    ------
    ArgumentError
        If the stage has no such gear, or the gear no such tooth.
    """
    acting, _ = acting_faults(pair, faults)
    measured = [own for own in acting if isinstance(own, GearError) or not own.is_loss]
    moved = tuple(found for own in measured if (found := _moved_by(own, pair)))
    return Excitation(stiffness=stiffness, errors=moved)
