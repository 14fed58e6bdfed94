"""The speed of a recording's machine: nominal, estimated, and the angle track behind it."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError
from gearmon.gears.kinematics import Kinematics, Mesh
from gearmon.machine import Machine
from gearmon.signals.angle import AngleTrack
from gearmon.signals.comb import Comb, SpeedScan, scan_speed
from gearmon.signals.phase import integrate_speed, refine_track, standing_share
from gearmon.signals.presence import MeshComb, combined_comb
from gearmon.signals.recording import Recording
from gearmon.signals.tacho import find_pulses, pulses_per_turn, track_from_pulses
from gearmon.signatures.families import MESH_HARMONICS, group_orders

FloatArray = NDArray[np.float64]

SPEED_TOLERANCE = 0.03
# Blocks of the first scan [turns]: they tell the sidebands of shaft 1 from the mesh lines.
_SCAN_TURNS = 30.0
# Shorter blocks, searched about the track so far, follow a speed that wanders (turns, tolerance).
_FINER_SCANS = ((10.0, 0.012), (6.0, 0.006))
# Share of the mesh lines' power that must stand still in angle for a track to be left alone.
_STANDING = 0.82
# Above this share nothing is left to gain from shorter blocks.
_STILL = 0.93


@dataclass(frozen=True, kw_only=True)
class Speed:
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

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        return {
            "nominal_hz": self.nominal_hz,
            "estimated_hz": self.estimated_hz,
            "peak_hz": self.peak_hz,
            "uncertainty_hz": self.uncertainty_hz,
            "lowest_hz": self.lowest_hz,
            "highest_hz": self.highest_hz,
            "method": self.method,
        }


def mesh_combs(train: Kinematics) -> tuple[MeshComb, ...]:
    """Return the meshes of a drive train as plain orders, one comb a stage."""
    return tuple(
        MeshComb(
            order=mesh.order,
            groups=tuple(
                tuple(float(order) for order in group_orders(mesh, k))
                for k in range(1, MESH_HARMONICS + 1)
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


def _comb(train: Kinematics) -> Comb:
    return combined_comb(mesh_combs(train), [shaft.order for shaft in train.shafts])


def scan_nominal_speeds(
    samples: FloatArray, rate: float, train: Kinematics, machine: Machine
) -> tuple[float, SpeedScan]:
    """Scan about every nominal speed of the machine; the one that collects the most is meant.

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
    comb = _comb(train)
    duration = samples.shape[-1] / rate
    best: tuple[float, float, SpeedScan] | None = None
    for nominal in sorted({point.shaft1_hz for point in machine.operating}):
        block_s = _SCAN_TURNS / nominal
        if duration < 4 * block_s:
            block_s = duration
        scan = scan_speed(samples, rate, comb, nominal, SPEED_TOLERANCE, block_s)
        if best is None or scan.best_score > best[0]:
            best = (scan.best_score, nominal, scan)
    if best is None:
        raise ArgumentError("machine has no operating point: add [operating] speed_rpm = ...")
    return best[1], best[2]


def find_track(
    recording: Recording, machine: Machine, train: Kinematics, nominal_hz: float, scan: SpeedScan
) -> tuple[AngleTrack, tuple[str, ...]]:
    """Find the angle of shaft 1: from a tachometer if there is one, else from comb and phases.

    Parameters
    ----------
    recording : Recording
        Vibration, and perhaps a tacho channel.
    machine : Machine
        Its sensors tell what the tachometer sits on.
    train : Kinematics
        Orders of the machine.
    nominal_hz : float
        Nominal speed [Hz].
    scan : SpeedScan
        Scan about it.

    Returns
    -------
    track : AngleTrack
        Angle of shaft 1.
    notes : tuple of str
        What the reader should know.
    """
    if "tacho" in recording.channel_kinds:
        return _tacho_track(recording, machine, train, nominal_hz)
    vibration = recording.vibration()
    samples, rate = vibration.samples, vibration.sampling_rate_hz
    top = 0.45 * rate * (1 - SPEED_TOLERANCE) / nominal_hz
    orders = np.array(
        sorted(
            {
                float(order)
                for mesh in train.meshes
                for k in range(1, 7)
                for order in _followed(mesh, k)
                if order < top
            }
        )
    )
    last_s = (samples.shape[-1] - 1) / rate
    speed = scan.track()
    if len(orders) == 0:
        note = "no mesh harmonic lies below the Nyquist frequency"
        return integrate_speed(speed, last_s), (note,)
    comb = _comb(train)
    # long blocks part the mesh lines from the sidebands of slow shafts; a calm speed allows them
    slowest = min(shaft.order for shaft in train.shafts)
    calm = float(np.clip(2.0 / slowest, 8.0, 20.0))
    first = integrate_speed(speed, last_s)
    best = _Heard.of(samples, rate, refine_track(samples, rate, first, orders, calm), orders)
    if best.share < _STILL:
        best = best.or_finer(samples, rate, best.track, orders)
    enough = _STANDING
    for turns, tolerance in _FINER_SCANS:
        block_s = turns / nominal_hz
        if best.share > enough or last_s < 8 * block_s:
            break
        enough = _STILL  # once the speed is known to wander, even its last second must be right
        finer = scan_speed(samples, rate, comb, nominal_hz, tolerance, block_s, around=speed)
        speed = finer.track()
        best = best.or_finer(samples, rate, integrate_speed(speed, last_s), orders)
    return best.track, ()


def _followed(mesh: Mesh, harmonic: int) -> tuple[Fraction, ...]:
    """Lines of one mesh harmonic whose phase is followed: those that the planets leave."""
    if mesh.carrier == 0:
        return (harmonic * mesh.exact,)
    return group_orders(mesh, harmonic)


@dataclass(frozen=True, kw_only=True)
class _Heard:
    """An angle track and how still the mesh lines stand in it."""

    track: AngleTrack
    share: float

    @classmethod
    def of(cls, samples: FloatArray, rate: float, track: AngleTrack, orders: FloatArray) -> _Heard:
        return cls(track=track, share=standing_share(samples, rate, track, orders))

    def or_finer(
        self, samples: FloatArray, rate: float, track: AngleTrack, orders: FloatArray
    ) -> _Heard:
        """Return this, or a track followed in short blocks if lines stand more still in it."""
        finer = refine_track(samples, rate, track, orders, block_turns=5.0, wander=0.01)
        other = _Heard.of(samples, rate, finer, orders)
        return other if other.share > self.share else self


def _tacho_track(
    recording: Recording, machine: Machine, train: Kinematics, nominal_hz: float
) -> tuple[AngleTrack, tuple[str, ...]]:
    index = recording.channel_kinds.index("tacho")
    name = recording.channel_names[index]
    column = recording.columns[index] if index < len(recording.columns) else None
    sensor = next(
        (s for s in machine.sensors if s.kind == "tacho" and str(s.column) in (name, str(column))),
        None,
    )
    pulses = find_pulses(recording.samples[index], recording.sampling_rate_hz)
    order = train.shaft(sensor.shaft).order if sensor is not None else 1.0
    count = sensor.pulses_per_turn if sensor else pulses_per_turn(pulses, nominal_hz)
    duration = (recording.samples.shape[-1] - 1) / recording.sampling_rate_hz
    track = track_from_pulses(pulses, count, order, duration)
    notes = [f"tacho {name}: {count} pulse{'s' if count > 1 else ''} a turn"]
    if pulses.missing or pulses.extra:
        notes.append(f"tacho {name}: {pulses.missing} pulses filled in, {pulses.extra} left out")
    return track, tuple(notes)


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
        # both ends of the track are uncertain by what its increments leave, summed as a walk
        walk = track.uncertainty_turns * np.sqrt(max(1, len(speeds)))
        uncertainty = float(walk) / duration_s
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


def line_peak(samples: FloatArray, rate: float, train: Kinematics, track: AngleTrack) -> float:
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
    scan = scan_speed(samples, rate, _comb(train), mean, _PEAK_TOLERANCE, whole)
    return scan.track().mean_hz
