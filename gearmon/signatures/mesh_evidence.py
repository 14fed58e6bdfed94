"""Evidence of the meshes in a recording: their lines, and how clearly they stand out."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from gearmon.gears.kinematics import Kinematics, Mesh
from gearmon.signals.angle import AngleTrack
from gearmon.signals.orders.sums import OrderSums
from gearmon.signals.threads import at_once
from gearmon.signals.tracking.comb import SpeedScan, SpeedTrack, scan_speed
from gearmon.signals.tracking.mesh_detection import MeshEvidence, mesh_evidence
from gearmon.signatures.measured.line_plan import MESH_HARMONICS, group_orders, mesh_harmonics
from gearmon.signatures.speed import SPEED_TOLERANCE, machine_comb, mesh_combs

FloatArray = NDArray[np.float64]

# Scan about a followed speed, for judging whether a mesh is there [turns, reach]; and the reach
# about the speed that a tachometer tells: elsewhere than where its pulses want them lines are no
# mesh's (over an eighth of a second, pulses a sample off at 4 kHz put the speed off by 0.3 %).
_JUDGED_TURNS = 20.0
_JUDGED_REACH = 0.012
TACHO_REACH = 0.004
# Harmonics of each mesh whose phases are followed, unless it is so slow that more are looked at.
_HARMONICS = 6


@dataclass(frozen=True, kw_only=True)
class Tracking:
    """The angle of shaft 1, and what was found on the way.

    Parameters
    ----------
    track : AngleTrack
        Angle of shaft 1.
    nominal_hz : float
        The nominal speed that is meant [Hz].
    scan : SpeedScan
        Scan about the speed, from which the evidence comes.
    evidence : tuple of MeshEvidence
        How clearly each mesh stands out.
    notes : tuple of str
        What the reader should know.
    held_s : tuple of float, optional
        The part of the recording in which the angle is known [s]; all of it if None.
    """

    track: AngleTrack
    nominal_hz: float
    scan: SpeedScan
    evidence: tuple[MeshEvidence, ...]
    notes: tuple[str, ...] = ()
    held_s: tuple[float, float] | None = None

    @property
    def plan_hz(self) -> float:
        """Speed for which orders are planned [Hz]: nominal, unless they would leave the band."""
        highest = float(self.track.speed_hz.max())
        return self.nominal_hz if highest < 1.06 * self.nominal_hz else highest

    @property
    def detected(self) -> int:
        """Meshes that stand out."""
        return sum(seen.stands_out for seen in self.evidence)

    @property
    def convincing(self) -> bool:
        """Whether several harmonics of meshes that stand out are clear."""
        return sum(seen.clear for seen in self.evidence if seen.stands_out) >= 2


@dataclass(frozen=True, kw_only=True)
class GearVibration:
    """Vibration of a gearbox, and the orders that its angle is followed by.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        Vibration.
    rate : float
        Sampling rate [Hz].
    train : Kinematics
        Orders of the machine.
    nominal_hz : float
        Speed of shaft 1 that is meant [Hz].
    """

    samples: FloatArray
    rate: float
    train: Kinematics
    nominal_hz: float

    @property
    def last_s(self) -> float:
        """Time of the last sample [s]."""
        return float((self.samples.shape[-1] - 1) / self.rate)

    def orders(self, speed_hz: float) -> FloatArray:
        """Mesh harmonics whose phases are followed while the speed is at most `speed_hz`."""
        top = 0.45 * self.rate / speed_hz
        found = {
            float(order)
            for mesh in self.train.meshes
            for k in range(1, self._followed_harmonics(mesh) + 1)
            for order in _followed(mesh, k)
        }
        return np.array(sorted(order for order in found if order < top))

    def _followed_harmonics(self, mesh: Mesh) -> int:
        looked_at = mesh_harmonics(mesh.order * self.nominal_hz)
        return looked_at if looked_at > MESH_HARMONICS else _HARMONICS

    def sums(self, fastest_hz: float | None = None) -> OrderSums | None:
        """Lines of the meshes up to a speed; None if all lie beyond the band.

        If no speed is given, that is the fastest one about nominal.
        """
        if fastest_hz is None:
            fastest_hz = self.nominal_hz * (1 + SPEED_TOLERANCE)
        orders = self.orders(fastest_hz)
        return OrderSums(self.samples, self.rate, orders) if len(orders) else None


def _followed(mesh: Mesh, harmonic: int) -> tuple[Fraction, ...]:
    """Lines of one mesh harmonic whose phase is followed: those that the planets leave."""
    if mesh.carrier == 0:
        return (harmonic * mesh.exact,)
    return group_orders(mesh, harmonic)


def judge(signal: GearVibration, track: AngleTrack) -> Tracking:
    """Judge the meshes on a scan about a track whose speed changes or is far from nominal.

    Parameters
    ----------
    signal : GearVibration
        The recording.
    track : AngleTrack
        Angle of shaft 1.

    Returns
    -------
    Tracking
    """
    time_s = np.linspace(0.0, signal.last_s, 2 + int(8 * signal.last_s))
    middle = 0.5 * (time_s[1:] + time_s[:-1])
    speed = np.diff(track.turns_at(time_s)) / np.diff(time_s)
    around = SpeedTrack(time_s=middle, speed_hz=speed, resolution_hz=float("nan"))
    block_s = min(_JUDGED_TURNS / float(speed.mean()), 0.25 * signal.last_s)
    comb = machine_comb(signal.train, signal.nominal_hz)
    scan = scan_speed(
        signal.samples, signal.rate, comb, signal.nominal_hz, _JUDGED_REACH, block_s, around=around
    )
    centre_hz = float(np.mean(scan.middle_hz))
    return Tracking(
        track=track,
        nominal_hz=signal.nominal_hz,
        scan=scan,
        evidence=evidence_of(signal, scan, centre_hz, _JUDGED_REACH),
    )


def evidence_of(
    signal: GearVibration,
    scan: SpeedScan,
    centre_hz: float,
    tolerance: float,
    known: SpeedTrack | None = None,
) -> tuple[MeshEvidence, ...]:
    """Tell how clearly each mesh stands out in a scan.

    Parameters
    ----------
    signal : GearVibration
        The recording.
    scan : SpeedScan
        The scan.
    centre_hz : float
        Speed about which it looked [Hz].
    tolerance : float
        How far, as a fraction.
    known : SpeedTrack, optional
        The speed, if a tachometer tells it.

    Returns
    -------
    tuple of MeshEvidence
        One a mesh.
    """
    orders = [shaft.order for shaft in signal.train.shafts]

    def judged() -> tuple[MeshEvidence, ...]:
        combs = mesh_combs(signal.train, signal.nominal_hz)
        return mesh_evidence(scan, combs, orders, centre_hz, tolerance, known)

    # the path through all blocks, which is wanted next, is found meanwhile
    return at_once(judged, lambda: scan.best_score, scan.scores.size)[0]


def wander(track: AngleTrack) -> float:
    """Relative standard deviation of the speed over half seconds.

    Parameters
    ----------
    track : AngleTrack
        Angle of shaft 1.

    Returns
    -------
    float
        0 for a track of less than a second and a half.
    """
    halves = np.arange(track.time_s[0], track.time_s[-1], 0.5)
    if len(halves) < 3:
        return 0.0
    turns = np.diff(track.turns_at(halves))
    return float(np.std(turns) / np.mean(turns))


def speed_in_blocks(track: AngleTrack, scan: SpeedScan) -> SpeedTrack:
    """Mean speed of a track in each block of a scan.

    Parameters
    ----------
    track : AngleTrack
        Angle of shaft 1.
    scan : SpeedScan
        The scan.

    Returns
    -------
    SpeedTrack
    """
    half_s = float(scan.centre_s[0])  # the first block begins with the recording
    ends = track.turns_at(scan.centre_s + half_s), track.turns_at(scan.centre_s - half_s)
    return SpeedTrack(
        time_s=scan.centre_s,
        speed_hz=(ends[0] - ends[1]) / (2 * half_s),
        resolution_hz=scan.resolution_hz,
    )
