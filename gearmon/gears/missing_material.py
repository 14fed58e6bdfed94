"""Material missing from the flanks of a gear, along the line of action."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gearmon.errors import ArgumentError, check_finite
from gearmon.gears.fault_geometry import tooth_damage
from gearmon.gears.faults import Fault
from gearmon.gears.pairs import MeshPair
from gearmon.gears.panels import ComplexArray, FloatArray
from gearmon.gears.potential_energy import teeth_of
from gearmon.gears.tip_corner import tip_corner_gap
from gearmon.gears.tooth_pairs import ToothPair

#: Lines of the turn of a misaligned gear under load; they fall with their square at least.
GAP_LINES = 2048
#: What each kind of error means, for help texts.
ERROR_KINDS: dict[str, str] = {
    "eccentricity": "the gear runs out: once per turn, SIZE is the offset of its centre",
    "pitch": "one tooth stands back by SIZE over its whole contact",
    "profile": "SIZE is missing at both ends of the contact, nothing in its middle",
    "misalignment": "the gear wobbles: SIZE is the lead deviation across the face, turning with it",
    "cumulative": "slow cumulative pitch error: once per turn, SIZE is half of its range F_p",
}

#: Errors of a whole gear.
WHOLE_KINDS = ("eccentricity", "misalignment", "cumulative")


@dataclass(frozen=True, kw_only=True)
class GearError:
    """An error of manufacture or mounting of one gear.

    Parameters
    ----------
    kind : {"eccentricity", "pitch", "profile", "misalignment", "cumulative"}
        See `ERROR_KINDS`.
    stage : int, >= 1
    gear : str
    tooth : int or None
        Of pitch and profile errors; None for all teeth.
    size_m : float
        Missing material along the line of action [m]; negative for too much material.
    phase_rad : float
        Angle of the gear, from the entry of tooth 1, at which eccentricity, misalignment or
        cumulative pitch error is largest, negated.

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
        if self.kind not in ERROR_KINDS:
            raise ArgumentError(f"error kind {self.kind!r} is not one of {', '.join(ERROR_KINDS)}")
        if self.stage < 1:
            raise ArgumentError(f"error stage={self.stage} must be >= 1")
        if self.tooth is not None and self.tooth < 1:
            raise ArgumentError(f"error tooth={self.tooth} must be >= 1")
        if self.kind in WHOLE_KINDS and self.tooth is not None:
            raise ArgumentError(f"error {self.kind} is of the whole gear: TOOTH must be 'all'")
        if self.kind == "pitch" and self.tooth is None:
            raise ArgumentError("error pitch is of one tooth: TOOTH must be its number")

    def __str__(self) -> str:
        """Return the error in the form that `parse_error` reads."""
        tooth = "all" if self.tooth is None else self.tooth
        return f"{self.kind}:{self.stage}:{self.gear}:{tooth}:{1e6 * self.size_m:g}um"


@dataclass(frozen=True, kw_only=True, eq=False)
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
        share = carrying_share(np.abs(gap), self.free_gap_m)
        return np.asarray(0.5 * gap * (share - 1))

    def lines(self, count: int) -> ComplexArray:
        """Return the Fourier coefficients 0 ... count [m] over `period_mesh`.

        Notes
        -----
        ``|cos x| = 2/pi + (4/pi) sum_k (-1)^(k+1) cos(2 k x)/(4 k^2 - 1)``.
        """
        total = np.zeros(count + 1, dtype=np.complex128)
        if self.kind == "wear":
            total[0] = self.size_m
        elif self.kind != "misalignment":
            if count:
                total[1] = 0.5 * self.size_m * np.exp(1j * self.phase_rad)
        elif self.free_gap_m:
            total[:GAP_LINES] = self._loaded_lines()[: count + 1]
        else:
            k = np.arange(count // 2 + 1)
            signs = np.where(k % 2, 1.0, -1.0) / (4 * k**2 - 1)
            total[::2] = -self.size_m / math.pi * signs * np.exp(2j * k * self.phase_rad)
        return total

    def _loaded_lines(self) -> ComplexArray:
        phase = np.arange(4 * GAP_LINES) / (4 * GAP_LINES) * self.teeth
        lines = np.fft.rfft(self.at(phase), norm="forward")[:GAP_LINES]
        # what samples of so little make are rounding errors
        lines[np.abs(lines) < 1e-16 * abs(self.size_m)] = 0
        return np.asarray(lines)


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


@dataclass(frozen=True, kw_only=True, eq=False)
class FlankError:
    """Material missing from one tooth of a gear, or from all of them, along their contact.

    Parameters
    ----------
    gear : str
    teeth : int
        Teeth of the gear.
    tooth : int or None
        The only tooth that it concerns; None for all.
    curve : callable
        Maps contact phase [mesh periods] to missing material [m].
    corners : tuple of float
        Contact phases at which it is not smooth.
    """

    gear: str
    teeth: int
    tooth: int | None
    curve: Callable[[FloatArray], FloatArray]
    corners: tuple[float, ...] = ()

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
    teeth = pair.members[index].teeth.teeth
    if error.tooth is not None and error.tooth > teeth:
        raise ArgumentError(
            f"error {error}: tooth {error.tooth} does not exist, the {error.gear} of {pair.where} "
            f"has {teeth} teeth"
        )
    size, length = error.size_m, pair.contact_ratio
    if error.kind in WHOLE_KINDS:
        return TurningError(
            gear=error.gear,
            teeth=teeth,
            kind=error.kind,
            size_m=size,
            phase_rad=error.phase_rad,
            free_gap_m=free_gap_m,
        )

    def pitch(phase: FloatArray) -> FloatArray:
        return np.full(phase.shape, size)

    def profile(phase: FloatArray) -> FloatArray:
        return np.asarray(size * (2 * phase / length - 1) ** 2)

    curve = pitch if error.kind == "pitch" else profile
    return FlankError(gear=error.gear, teeth=teeth, tooth=error.tooth, curve=curve)


def profile_lost_by(fault: Fault, pair: MeshPair, index: int) -> list[TurningError | FlankError]:
    """Return what damage takes from the profile: wear, through spalls and missing teeth.

    A spall that leaves a part of the face width in contact moves nothing. Even wear moves all
    pairs alike, which shifts the mean and makes no line.
    """
    gear, number = fault.gear, pair.members[index].teeth.teeth
    if fault.kind == "wear":
        size = 1e-3 * fault.size
        return [TurningError(gear=gear, teeth=number, kind="wear", size_m=size)] if size else []
    if fault.kind not in ("spall", "missing"):
        return []
    teeth = teeth_of(pair)
    if fault.kind == "missing":
        curve, corners = _bridge(teeth), (teeth.contact_ratio - 1, 1.0)
        return [
            FlankError(gear=gear, teeth=number, tooth=fault.tooth, curve=curve, corners=corners)
        ]
    (hole,) = tooth_damage([fault], teeth.teeth[index]).holes
    if hole.width_m < teeth.first.face_width_m * (1 - 1e-9):
        return []
    tooth = teeth.teeth[index]
    ends = [
        teeth.phase_of(index, tooth.angle_at_height(height)) for height in (hole.low_m, hole.high_m)
    ]
    low, high, depth = min(ends), max(ends), hole.depth_m

    def spalled(phase: FloatArray) -> FloatArray:
        return np.where((phase >= low) & (phase < high), depth, 0.0)

    return [
        FlankError(gear=gear, teeth=number, tooth=fault.tooth, curve=spalled, corners=(low, high))
    ]


def _bridge(pair: ToothPair) -> Callable[[FloatArray], FloatArray]:
    """Return how far the neighbours of a missing tooth must approach to touch."""
    part = pair.contact_ratio - 1

    def curve(phase: FloatArray) -> FloatArray:
        alone = (phase > part) & (phase < 1) & (part < 1)
        before = np.clip(phase - part, 0.0, None) * pair.base_pitch_m
        after = np.clip(1 - phase, 0.0, None) * pair.base_pitch_m
        leaving = tip_corner_gap(pair, before, leaving=True)
        entering = tip_corner_gap(pair, after, leaving=False)
        return np.where(alone, np.minimum(leaving, entering), 0.0)

    return curve
