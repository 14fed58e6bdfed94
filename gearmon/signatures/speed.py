"""The speed of a recording's machine: nominal, estimated, and the angle track behind it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError
from gearmon.gears.kinematics import Kinematics, Mesh
from gearmon.machine import Machine
from gearmon.result import Result
from gearmon.signals.angle import AngleTrack
from gearmon.signals.tracking.comb import Comb, SpeedScan, scan_speed
from gearmon.signals.tracking.mesh_detection import MeshComb, combined_comb
from gearmon.signatures.measured.line_plan import MESH_HARMONICS, group_orders, mesh_harmonics

FloatArray = NDArray[np.float64]

SPEED_TOLERANCE = 0.03
#: How far it is looked for when it is not found so near to nominal.
SPEED_REACH = 0.25
# Blocks of the first scan [turns]: they tell the sidebands of shaft 1 from the mesh lines. High
# harmonics of a slow mesh are smeared in long blocks by a speed that drifts; short ones still tell
# them from sidebands of shaft 1.
_SCAN_TURNS, _SLOW_MESH_TURNS = 30.0, 8.0
# The same where nominal speeds are told apart, by lines that a speed that wanders must not smear.
_COMPARED_TURNS = 12.0


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
            spacings=_comb_spacings(mesh),
        )
        for mesh in train.meshes
    )


def _comb_spacings(mesh: Mesh) -> tuple[float, ...]:
    """Rotations that set sidebands apart: both shafts, or the carrier of a planetary set."""
    if mesh.carrier == 0:
        return tuple(wheel.relative_order for wheel in mesh.wheels)
    return (abs(float(mesh.carrier)),)


def machine_comb(train: Kinematics, shaft1_hz: float) -> Comb:
    """Return the lines of a drive train that its speed is known by: meshes, sidebands, shafts."""
    return combined_comb(mesh_combs(train, shaft1_hz), [shaft.order for shaft in train.shafts])


def scan_nominal_speeds(
    samples: FloatArray,
    rate: float,
    train: Kinematics,
    machine: Machine,
) -> tuple[float, SpeedScan]:
    """Scan about every nominal speed of the machine; the one whose own lines are clearest is meant.

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
    nominal_hz : float
        The nominal speed [Hz].
    scan : SpeedScan
        The scan about it.

    Raises
    ------
    ArgumentError
        If the machine has no operating point.
    """
    duration = samples.shape[-1] / rate

    @cache
    def scanned(nominal: float, turns: float) -> tuple[SpeedScan, Comb]:
        comb = machine_comb(train, nominal)
        block_s = turns / nominal if duration >= 4 * turns / nominal else duration
        return scan_speed(samples, rate, comb, nominal, SPEED_TOLERANCE, block_s), comb

    def usual(nominal: float) -> SpeedScan:
        slow = any(mesh_harmonics(m.order * nominal) > MESH_HARMONICS for m in train.meshes)
        return scanned(nominal, _SLOW_MESH_TURNS if slow else _SCAN_TURNS)[0]

    def clearer(one: float, other: float) -> bool:
        if abs(one / other - 1) < 2 * SPEED_TOLERANCE:
            return False  # what one finds the other does
        mine, theirs = scanned(one, _COMPARED_TURNS), scanned(other, _COMPARED_TURNS)
        return mine[0].unshared(mine[1], *theirs) > theirs[0].unshared(theirs[1], *mine)

    nominal = sorted({point.shaft1_hz for point in machine.operating})
    if not nominal:
        raise ArgumentError("machine has no operating point: add [operating] speed_rpm = ...")
    if len(nominal) > 1:
        nominal.sort(key=lambda own: -usual(own).best_score)
    best = nominal[0]
    for other in nominal[1:]:
        if clearer(other, best):
            best = other
    return best, usual(best)


def speed_of(
    track: AngleTrack, nominal_hz: float, peak_hz: float, scan: SpeedScan, duration_s: float
) -> Speed:
    """Sum up a track as a speed with its uncertainty.

    Parameters
    ----------
    track : AngleTrack
        Angle of shaft 1.
    nominal_hz : float
        Nominal speed [Hz].
    peak_hz : float
        Speed at which lines peak [Hz].
    scan : SpeedScan
        Scan that the track began with.
    duration_s : float
        Length of the recording [s].

    Returns
    -------
    Speed
    """
    span = float(track.time_s[-1] - track.time_s[0])
    speeds = track.speed_hz
    if np.isfinite(track.uncertainty_turns):
        # both ends of the track are uncertain
        uncertainty = float(np.sqrt(2) * track.uncertainty_turns) / duration_s
    else:
        uncertainty = 0.5 * scan.resolution_hz
    return Speed(
        nominal_hz=nominal_hz,
        estimated_hz=float(track.turns[-1] - track.turns[0]) / span,
        peak_hz=peak_hz,
        uncertainty_hz=uncertainty,
        lowest_hz=float(speeds.min()),
        highest_hz=float(speeds.max()),
        method=track.method,
    )


_PEAK_TOLERANCE = 1e-3
_PEAK_SAMPLES = 1 << 19


def line_peak(
    samples: FloatArray, rate: float, train: Kinematics, track: AngleTrack, nominal_hz: float
) -> float:
    """Find the speed at which lines stand in one spectrum of the whole recording.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        Vibration.
    rate : float
        Sampling rate [Hz].
    train : Kinematics
        Orders of the machine.
    track : AngleTrack
        Angle of shaft 1.
    nominal_hz : float
        Nominal speed [Hz].

    Returns
    -------
    float
        The speed [Hz], within 0.1 % of the mean; the mean itself if a tachometer tells it, and if
        it wanders by more than 0.1 % (standard deviation over half seconds) or there are more than
        half a million samples: then the lines have no one place in such a spectrum.
    """
    mean = float((track.turns[-1] - track.turns[0]) / (track.time_s[-1] - track.time_s[0]))
    whole = samples.shape[-1] / rate
    halves = np.arange(0.0, whole, 0.5)
    wander = float(np.std(np.diff(track.turns_at(halves)))) / 0.5 if len(halves) > 2 else 0.0
    drifts = wander > _PEAK_TOLERANCE * mean
    if track.method == "tacho" or drifts or samples.shape[-1] > _PEAK_SAMPLES:
        return mean
    comb = machine_comb(train, nominal_hz)
    scan = scan_speed(samples, rate, comb, mean, _PEAK_TOLERANCE, whole)
    return scan.track().mean_hz
