"""Where errors of a turning gear move the contact: earlier or later, shorter, along the face.

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
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from gearmon.gears.missing_material import GearError, carrying_share
from gearmon.gears.pairs import MeshPair
from gearmon.gears.panels import FloatArray

#: Errors that move the contact of all teeth of a gear as it turns.
MOVING_KINDS = ("eccentricity", "cumulative", "misalignment")


@dataclass(frozen=True, kw_only=True)
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

    @property
    def is_none(self) -> bool:
        """Whether nothing moves."""
        return not (self.leaving or self.entering or self.lead_m)

    def turned(self, amplitude: complex, angle: FloatArray) -> FloatArray:
        """Return the real part of an amplitude turned by an angle [rad]."""
        return np.asarray(amplitude.real * np.cos(angle) - amplitude.imag * np.sin(angle))


@dataclass(frozen=True, kw_only=True)
class OffsetState:
    """Where the contact lies at some instants: arrays of one shape.

    Parameters
    ----------
    leaving, entering : ndarray
        a and b [mesh periods].
    share : ndarray
        Part of the face width that carries.
    """

    leaving: FloatArray
    entering: FloatArray
    share: FloatArray

    @property
    def lost(self) -> FloatArray:
        """What the contact ratio loses."""
        return self.leaving + self.entering


def contact_offsets(pair: MeshPair, errors: Iterable[GearError]) -> tuple[ContactOffset, ...]:
    """Return how errors move the contact, one entry for each gear that has such errors.

    Parameters
    ----------
    pair : MeshPair
        With a module.
    errors : iterable of GearError
        Those of other gears, of single teeth and of size 0 are left aside.
    """
    found = []
    for index, member in enumerate(pair.members):
        own = [e for e in errors if e.gear == member.name and e.kind in MOVING_KINDS and e.size_m]
        parts = [_moved(error, pair, index) for error in own]
        offset = ContactOffset(
            gear=member.name,
            teeth=member.teeth.teeth,
            leaving=sum((part[0] for part in parts), 0j),
            entering=sum((part[1] for part in parts), 0j),
            lead_m=sum((part[2] for part in parts), 0j),
        )
        if not offset.is_none:
            found.append(offset)
    return tuple(found)


def state_of(
    offsets: Iterable[ContactOffset], angles: Iterable[FloatArray], free_gap_m: float
) -> OffsetState:
    """Return the contact with gears turned by angles [rad].

    Parameters
    ----------
    offsets : iterable of ContactOffset
    angles : iterable of ndarray
        Of each gear; shapes that broadcast.
    free_gap_m : float
        Lead deviation that the load just closes.
    """
    leaving, entering, lead = np.zeros(()), np.zeros(()), np.zeros(())
    for offset, angle in zip(offsets, angles, strict=True):
        leaving = leaving + offset.turned(offset.leaving, angle)
        entering = entering + offset.turned(offset.entering, angle)
        lead = lead + offset.turned(offset.lead_m, angle)
    share = carrying_share(np.abs(lead), free_gap_m)
    return OffsetState(leaving=leaving, entering=entering, share=share)


def first_gear_share(pair: MeshPair) -> float:
    """Return s, the share of a transmission error by which the first gear moves."""
    if pair.second.internal:
        return 1.0
    one, two = (float(member.teeth.teeth) ** 2 for member in pair.members)
    return two / (one + two)


def _moved(error: GearError, pair: MeshPair, index: int) -> tuple[complex, complex, complex]:
    """Return a, b [mesh periods] and the lead [m] of one error, as turning amplitudes."""
    size = error.size_m * cmath.exp(1j * error.phase_rad)
    if error.kind == "misalignment":
        return 0j, 0j, size
    geometry = pair.unchecked_geometry
    share = first_gear_share(pair)
    along = size / geometry.base_pitch_m
    if error.kind == "cumulative":
        # a tooth that stands back meets its mate farther down the line of action
        own = -(1 - share) if index == 0 else share
        return own * along, -own * along, 0j
    external = not pair.second.internal
    # d_t = e cos x; the offset turns with its gear: those of external gears turn against each other
    normal = -1j * along if index == 1 and external else 1j * along
    line = geometry.centre_distance_m * math.sin(geometry.working_pressure_angle_rad)
    one, two = (radius / line for radius in geometry.base_radii_m)
    leaving = (one if external else -one) * normal + share * along
    return leaving, two * normal + (1 - share) * along, 0j
