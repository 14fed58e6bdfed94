"""Material missing from the flanks of a gear, along the line of action."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError, check_finite
from gearmon.gears.fault_geometry import tooth_damage
from gearmon.gears.faults import Fault
from gearmon.gears.pairs import MeshPair
from gearmon.gears.panels import FloatArray
from gearmon.gears.potential_energy import teeth_of
from gearmon.gears.tooth_pairs import ToothPair

IntArray = NDArray[np.int64]

#: What each kind of error means, for help texts.
ERROR_KINDS: dict[str, str] = {
    "eccentricity": "the gear runs out: once per turn, SIZE is the offset of its centre",
    "pitch": "one tooth stands back by SIZE over its whole contact",
    "profile": "SIZE is missing at both ends of the contact, nothing in its middle",
    "misalignment": "the gear wobbles: SIZE is the lead deviation across the face, turning with it",
}


@dataclass(frozen=True, kw_only=True)
class GearError:
    """An error of manufacture or mounting of one gear.

    Parameters
    ----------
    kind : {"eccentricity", "pitch", "profile", "misalignment"}
        See `ERROR_KINDS`.
    stage : int, >= 1
    gear : str
    tooth : int or None
        Of pitch and profile errors; None for all teeth.
    size_m : float
        Missing material along the line of action [m]; negative for too much material.
    phase_rad : float
        Angle of the gear, from the entry of tooth 1, at which eccentricity or misalignment is
        largest, negated.

    Raises
    ------
    ArgumentError
        If a value has no meaning.
    """

    kind: str
    stage: int
    gear: str
    tooth: int | None
    size_m: float
    phase_rad: float = 0.0

    def __post_init__(self) -> None:
        check_finite("size_m", self.size_m, "m")
        if self.stage < 1:
            raise ArgumentError(f"error stage={self.stage} must be >= 1")
        if self.tooth is not None and self.tooth < 1:
            raise ArgumentError(f"error tooth={self.tooth} must be >= 1")
        if self.kind in ("eccentricity", "misalignment") and self.tooth is not None:
            raise ArgumentError(f"error {self.kind} is of the whole gear: TOOTH must be 'all'")
        if self.kind == "pitch" and self.tooth is None:
            raise ArgumentError("error pitch is of one tooth: TOOTH must be its number")

    def __str__(self) -> str:
        """Return the error in the form that `parse_error` reads."""
        tooth = "all" if self.tooth is None else self.tooth
        return f"{self.kind}:{self.stage}:{self.gear}:{tooth}:{1e6 * self.size_m:g}um"


@dataclass(frozen=True, kw_only=True, eq=False)
class PairError:
    """Material missing from the pairs of a mesh because of one gear.

    Parameters
    ----------
    teeth : int
        Teeth of the gear: the error repeats after as many mesh periods.
    curve : callable
        Maps angle of the gear [rad] and contact phase [mesh periods] to missing material [m].
    tooth : int or None
        The only tooth that it concerns; None for all.
    """

    teeth: int
    curve: Callable[[FloatArray, FloatArray], FloatArray]
    tooth: int | None = None

    def at(self, entry: IntArray, passed: FloatArray, phase: FloatArray) -> FloatArray:
        """Return the missing material [m] of pairs that entered at `entry`, `passed` ago.

        Parameters
        ----------
        entry : ndarray of int
        passed : ndarray
            Contact phase of a slice of the face [mesh periods].
        phase : ndarray
            Mesh phase, which tells the angle of the gear.
        """
        missing = self.curve(2 * math.pi * phase / self.teeth, passed)
        if self.tooth is None:
            return missing
        return np.where(entry % self.teeth == self.tooth - 1, missing, 0.0)


def error_of(error: GearError, pair: MeshPair, index: int) -> PairError:
    """Return what an error of a gear takes from the pairs of its mesh.

    Parameters
    ----------
    error : GearError
    pair : MeshPair
    index : {0, 1}
        Gear of the error.

    Raises
    ------
    ArgumentError
        If the gear has no such tooth.
    """
    teeth = pair.members[index].teeth.teeth
    if error.tooth is not None and error.tooth > teeth:
        raise ArgumentError(
            f"error {error}: tooth {error.tooth} does not exist, the {error.gear} of {pair.where} "
            f"has {teeth} teeth"
        )
    curve = _curve(error, pair.contact_ratio)
    return PairError(teeth=teeth, tooth=error.tooth, curve=curve)


def profile_lost_by(fault: Fault, pair: MeshPair, index: int) -> list[PairError]:
    """Return what damage takes from the profile: through spalls and missing teeth.

    A spall that leaves a part of the face width in contact moves nothing.
    """
    if fault.kind not in ("spall", "missing"):
        return []
    teeth = teeth_of(pair)
    number = pair.members[index].teeth.teeth
    if fault.kind == "missing":
        return [PairError(teeth=number, tooth=fault.tooth, curve=_bridge(teeth))]
    (hole,) = tooth_damage([fault], teeth.teeth[index]).holes
    if hole.width_m < teeth.first.face_width_m * (1 - 1e-9):
        return []
    tooth = teeth.teeth[index]
    ends = [
        teeth.phase_of(index, tooth.angle_at_height(height)) for height in (hole.low_m, hole.high_m)
    ]
    low, high, depth = min(ends), max(ends), hole.depth_m

    def curve(_: FloatArray, phase: FloatArray) -> FloatArray:
        return np.where((phase >= low) & (phase < high), depth, 0.0)

    return [PairError(teeth=number, tooth=fault.tooth, curve=curve)]


def tip_corner_gap(pair: ToothPair, beyond_m: FloatArray, *, leaving: bool) -> FloatArray:
    """Return the gap of a pair just outside its path of contact [m].

    Parameters
    ----------
    pair : ToothPair
    beyond_m : ndarray, >= 0
        How far the rolling has gone beyond the end of the path, along the line of action [m].
    leaving : bool
        Whether the tip of the first gear is leaving; else that of the second is entering.

    Notes
    -----
    The tip corner of one gear is seen from the centre of the other; the angle from there to the
    flank at the same radius, times the base radius, is the distance along the line of action.
    """
    own, mate = (pair.first, pair.second) if leaving else (pair.second, pair.first)
    centres = math.hypot(pair.line_m, own.base_radius_m + mate.base_radius_m)
    working = math.acos((own.base_radius_m + mate.base_radius_m) / centres)
    at_end = pair.path_m[1] if leaving else pair.line_m - pair.path_m[0]
    radius = math.hypot(own.base_radius_m, at_end)
    turned = math.atan2(at_end, own.base_radius_m) - working + beyond_m / own.base_radius_m
    x, y = centres - radius * np.cos(turned), radius * np.sin(turned)
    tangent = np.sqrt(np.maximum((x * x + y * y) / mate.base_radius_m**2 - 1, 0.0))
    rolled = (pair.line_m - at_end - beyond_m) / mate.base_radius_m
    flank = working - rolled + tangent - np.arctan(tangent)
    return np.asarray(mate.base_radius_m * (flank - np.arctan2(y, x)))


def _curve(error: GearError, length: float) -> Callable[[FloatArray, FloatArray], FloatArray]:
    size, start = error.size_m, error.phase_rad

    def eccentricity(angle: FloatArray, _: FloatArray) -> FloatArray:
        return np.asarray(size * np.cos(angle + start))

    def misalignment(angle: FloatArray, _: FloatArray) -> FloatArray:
        # whichever end of the face stands out carries: twice per turn
        return np.asarray(-0.5 * size * np.abs(np.cos(angle + start)))

    def pitch(_: FloatArray, phase: FloatArray) -> FloatArray:
        return np.full(phase.shape, size)

    def profile(_: FloatArray, phase: FloatArray) -> FloatArray:
        return np.asarray(size * (2 * phase / length - 1) ** 2)

    curves = {
        "eccentricity": eccentricity,
        "misalignment": misalignment,
        "pitch": pitch,
        "profile": profile,
    }
    if error.kind not in curves:
        raise ArgumentError(f"error kind {error.kind!r} is not one of {', '.join(curves)}")
    return curves[error.kind]


def _bridge(pair: ToothPair) -> Callable[[FloatArray, FloatArray], FloatArray]:
    """Return how far the neighbours of a missing tooth must approach to touch."""
    part = pair.contact_ratio - 1

    def curve(_: FloatArray, phase: FloatArray) -> FloatArray:
        alone = (phase > part) & (phase < 1) & (part < 1)
        before = np.clip(phase - part, 0.0, None) * pair.base_pitch_m
        after = np.clip(1 - phase, 0.0, None) * pair.base_pitch_m
        leaving = tip_corner_gap(pair, before, leaving=True)
        entering = tip_corner_gap(pair, after, leaving=False)
        return np.where(alone, np.minimum(leaving, entering), 0.0)

    return curve
