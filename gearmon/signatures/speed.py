"""The speed of a recording's machine, and how clearly its meshes stand out at it.

Combs of the machine's lines, the scan about its nominal speeds, the angle track that comes of it
with the evidence of every mesh, and the speed that is reported.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.errors import ArgumentError
from gearmon.gears.kinematics import Kinematics
from gearmon.machine import Machine
from gearmon.result import Result
from gearmon.signals.angle import AngleTrack
from gearmon.signals.orders.lines import OrderSums
from gearmon.signals.threads import at_once
from gearmon.signals.tracking.comb import (
    Comb,
    SpeedScan,
    clearest,
    find_path,
    scan_speed,
)
from gearmon.signals.tracking.mesh_detection import (
    MeshComb,
    MeshEvidence,
    combined_comb,
    mesh_evidence,
)
from gearmon.signals.tracking.phases import scan_angle
from gearmon.signatures.measured.line_plan import MESH_HARMONICS, group_orders, mesh_harmonics

SPEED_TOLERANCE = 0.03
#: How far it is looked for when it is not found so near to nominal.
SPEED_REACH = 0.25
# Blocks of the first scan [turns]: they tell the sidebands of shaft 1 from the mesh lines. High
# harmonics of a slow mesh are smeared in long blocks by a speed that drifts; short ones still tell
# them from sidebands of shaft 1.
_SCAN_TURNS, _SLOW_MESH_TURNS = 30.0, 8.0
# The same where nominal speeds are told apart, by lines that a speed that wanders must not smear.
_COMPARED_TURNS = 12.0
# Scan about a followed speed, for judging whether a mesh is there [turns, reach]; and the reach
# about the speed that a tachometer tells: elsewhere than where its pulses want them lines are no
# mesh's (over an eighth of a second, pulses a sample off at 4 kHz put the speed off by 0.3 %).
_JUDGED_TURNS = 20.0
_JUDGED_REACH = 0.012
TACHO_REACH = 0.004
# A speed that wanders more, or is told by more samples, has no one place in a spectrum.
_PEAK_TOLERANCE, _PEAK_SAMPLES = 1e-3, 1 << 19
# Harmonics of each mesh whose phases are followed, unless it is so slow that more are looked at.
_HARMONICS = 6


@dataclass(frozen=True, kw_only=True)
class Speed(Result):
    """Rotation frequency of shaft 1 in a recording.

    Parameters
    ----------
    nominal_hz : float
        From the machine file [Hz].
    estimated_hz : float
        Mean over the recording [Hz].
    peak_hz : float
        Speed at which the comb of lines peaks in one spectrum of the whole recording [Hz]: where
        the lines are seen if the speed drifts a little. Within 0.1 % of the mean.
    uncertainty_hz : float
        Standard deviation of that mean [Hz].
    lowest_hz, highest_hz : float
        Range of the speed within the recording [Hz].
    method : {"comb", "tacho"}
        How it was found.
    """

    nominal_hz: float
    estimated_hz: float
    peak_hz: float
    uncertainty_hz: float
    lowest_hz: float
    highest_hz: float
    method: str


def mesh_combs(train: Kinematics, shaft1_hz: float) -> tuple[MeshComb, ...]:
    """Return the meshes of a drive train as plain orders, one comb a stage; `shaft1_hz` nominal."""
    return tuple(
        MeshComb(
            order=mesh.order,
            groups=tuple(
                tuple(float(order) for order in group_orders(mesh, k))
                for k in range(1, mesh_harmonics(mesh.order * shaft1_hz) + 1)
            ),
            # what sets sidebands apart: both shafts, or the carrier of a planetary set
            spacings=(abs(float(mesh.carrier)),)
            if mesh.carrier
            else tuple(wheel.relative_order for wheel in mesh.wheels),
        )
        for mesh in train.meshes
    )


def machine_comb(train: Kinematics, shaft1_hz: float) -> Comb:
    """Return the lines of a drive train that its speed is known by: meshes, sidebands, shafts."""
    return combined_comb(mesh_combs(train, shaft1_hz), [shaft.order for shaft in train.shafts])


@dataclass(frozen=True, kw_only=True, eq=False)
class GearVibration:
    """Vibration of a gearbox, and the lines that its speed and angle are known by.

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

    @cached_property
    def comb(self) -> Comb:
        """Lines that the speed is known by: meshes, sidebands, shafts."""
        return machine_comb(self.train, self.nominal_hz)

    @property
    def meshes(self) -> tuple[MeshComb, ...]:
        """Its meshes, one comb a stage."""
        return mesh_combs(self.train, self.nominal_hz)

    def scan(
        self,
        block_s: float,
        tolerance: float = SPEED_TOLERANCE,
        about_hz: float | None = None,
    ) -> SpeedScan:
        """Scan for the comb about the nominal speed, or another one, as `scan_speed` does."""
        about = about_hz or self.nominal_hz
        return scan_speed(self.samples, self.rate, self.comb, about, tolerance, block_s)

    def blocks_of(self, turns: float) -> float:
        """Length of blocks of so many turns [s]; of a short recording all is one."""
        duration, block_s = self.samples.shape[-1] / self.rate, turns / self.nominal_hz
        return block_s if duration >= 4 * block_s else duration

    def first_scan(self) -> SpeedScan:
        """Scan about the nominal speed in blocks that tell meshes from sidebands of shaft 1."""
        looked_at = max(len(comb.groups) for comb in self.meshes)
        turns = _SLOW_MESH_TURNS if looked_at > MESH_HARMONICS else _SCAN_TURNS
        return self.scan(self.blocks_of(turns))

    def path(self) -> SpeedScan:
        """Follow the comb in short blocks far about the nominal speed."""
        return find_path(self.samples, self.rate, self.comb, self.nominal_hz, SPEED_REACH)

    def orders(self, speed_hz: float) -> FloatArray:
        """Mesh harmonics whose phases are followed while the speed is at most `speed_hz`."""
        found = {
            order
            for comb in self.meshes
            for k, group in enumerate(comb.groups, start=1)
            for order in group
            if k <= _HARMONICS or len(comb.groups) > MESH_HARMONICS
        }
        return np.array(sorted(order for order in found if order < 0.45 * self.rate / speed_hz))

    def sums(self, fastest_hz: float | None = None) -> OrderSums | None:
        """Lines of the meshes up to a speed; None if all lie beyond the band.

        If no speed is given, that is the fastest one about nominal.
        """
        orders = self.orders(fastest_hz or self.nominal_hz * (1 + SPEED_TOLERANCE))
        return OrderSums(self.samples, self.rate, orders) if len(orders) else None

    def evidence(
        self, scan: SpeedScan, centre_hz: float, tolerance: float
    ) -> tuple[MeshEvidence, ...]:
        """Tell how clearly each mesh stands out in a scan.

        Parameters
        ----------
        scan : SpeedScan
        centre_hz : float
            Speed about which it looked [Hz].
        tolerance : float
            How far, as a fraction.
        """
        orders = [shaft.order for shaft in self.train.shafts]

        def judged() -> tuple[MeshEvidence, ...]:
            return mesh_evidence(scan, self.meshes, orders, centre_hz, tolerance)

        # the path through all blocks, which is wanted next, is found meanwhile
        return at_once(judged, lambda: scan.best_score, scan.scores.size)[0]

    def judged(self, track: AngleTrack, reach: float = _JUDGED_REACH) -> Tracking:
        """Judge the meshes on a scan about a track.

        Parameters
        ----------
        track : AngleTrack
            Angle of shaft 1.
        reach : float
            How far about its speed to look, as a fraction.
        """
        block = min(_JUDGED_TURNS, 0.25 * float(track.turns[-1] - track.turns[0]))
        scan, _ = scan_angle(self.samples, self.rate, track, self.comb, reach, block)
        evidence = self.evidence(scan, 1.0, reach)
        return Tracking(track=track, nominal_hz=self.nominal_hz, scan=scan, evidence=evidence)

    def line_peak(self, track: AngleTrack) -> float:
        """Find the speed at which lines stand in one spectrum of the whole recording.

        Parameters
        ----------
        track : AngleTrack
            Angle of shaft 1.

        Returns
        -------
        float
            The speed [Hz], within 0.1 % of the mean; the mean itself if a tachometer tells it, and
            if it wanders by more than 0.1 % (standard deviation over half seconds) or there are
            more than half a million samples: then the lines have no one place in such a spectrum.
        """
        mean, count = track.mean_hz, self.samples.shape[-1]
        if track.method == "tacho" or wander(track) > _PEAK_TOLERANCE or count > _PEAK_SAMPLES:
            return mean
        return self.scan(count / self.rate, _PEAK_TOLERANCE, about_hz=mean).track().mean_hz


def meant_speed(
    samples: FloatArray, rate: float, train: Kinematics, machine: Machine
) -> GearVibration:
    """Tell which nominal speed of the machine is meant: that whose own lines are clearest.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        Vibration.
    rate : float
        Sampling rate [Hz].
    train : Kinematics
        Orders of the machine.
    machine : Machine
        Its operating points.

    Returns
    -------
    GearVibration
        The vibration, with the nominal speed that is meant.

    Raises
    ------
    ArgumentError
        If the machine has no operating point.
    """
    signals = [
        GearVibration(samples=samples, rate=rate, train=train, nominal_hz=speed)
        for speed in sorted({point.shaft1_hz for point in machine.operating})
    ]
    if not signals:
        raise ArgumentError("machine has no operating point: add [operating] speed_rpm = ...")
    if len(signals) == 1:
        return signals[0]
    scans = [(own.scan(own.blocks_of(_COMPARED_TURNS)), own.comb) for own in signals]
    return signals[clearest(scans)]


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
    lost : bool
        Whether the lines do not stand still in the angle, all along.
    coherent : float
        Share of the power of the mesh lines that stands still in an angle told without a
        tachometer; 0 where it was not asked.
    """

    track: AngleTrack
    nominal_hz: float
    scan: SpeedScan
    evidence: tuple[MeshEvidence, ...]
    notes: tuple[str, ...] = ()
    held_s: tuple[float, float] | None = None
    lost: bool = False
    coherent: float = 0.0

    @property
    def plan_hz(self) -> float:
        """Speed for which orders are planned [Hz]: nominal, unless they would leave the band."""
        highest = float(self.track.speed_hz.max())
        return self.nominal_hz if highest < 1.06 * self.nominal_hz else highest

    def speed(self, peak_hz: float, duration_s: float) -> Speed:
        """Sum it up as a speed with its uncertainty.

        Parameters
        ----------
        peak_hz : float
            Speed at which lines peak [Hz].
        duration_s : float
            Length of the recording [s].
        """
        track = self.track
        # both ends of the track are uncertain
        uncertainty = float(np.sqrt(2) * track.uncertainty_turns) / duration_s
        if not np.isfinite(uncertainty):
            relative = self.scan.resolution_hz / self.scan.nominal_hz
            uncertainty = 0.5 * relative * track.mean_hz
        return Speed(
            nominal_hz=self.nominal_hz,
            estimated_hz=track.mean_hz,
            peak_hz=peak_hz,
            uncertainty_hz=uncertainty,
            lowest_hz=float(track.speed_hz.min()),
            highest_hz=float(track.speed_hz.max()),
            method=track.method,
        )

    @property
    def detected(self) -> int:
        """Meshes that stand out."""
        return sum(seen.stands_out for seen in self.evidence)

    @property
    def clarity(self) -> tuple[int, int]:
        """How many meshes stand out, and how many of their harmonics are clear."""
        return self.detected, sum(seen.clear for seen in self.evidence if seen.stands_out)


def wander(track: AngleTrack) -> float:
    """Relative standard deviation of the speed over half seconds.

    Parameters
    ----------
    track : AngleTrack

    Returns
    -------
    float
        0 for tracks too short to tell.
    """
    halves = np.arange(track.time_s[0], track.time_s[-1], 0.5)
    if len(halves) < 3:
        return 0.0
    turns = np.diff(track.turns_at(halves))
    return float(np.std(turns) / np.mean(turns))
