"""The angle of shaft 1 in a recording: from a tachometer and the mesh lines, or tacholess."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from gearmon.errors import ArgumentError, RecordingError
from gearmon.gears.kinematics import Kinematics
from gearmon.machine import Machine
from gearmon.signals.angle import AngleTrack
from gearmon.signals.recording import Recording
from gearmon.signals.tracking.comb import SpeedScan
from gearmon.signals.tracking.phases import integrate_speed
from gearmon.signals.tracking.tacho import (
    TachoPulses,
    find_pulses,
    join,
    pulse_angles,
    pulses_per_turn,
    track_from_pulses,
)
from gearmon.signatures.mesh_evidence import (
    TACHO_REACH,
    GearVibration,
    Tracking,
    evidence_of,
    judge,
    speed_in_blocks,
    wander,
)
from gearmon.signatures.speed import SPEED_TOLERANCE, scan_nominal_speeds
from gearmon.signatures.tacholess import track_tacholess

# How far pulses and comb may be apart before it is asked which of them is right.
_APART = 0.01


def track_recording(recording: Recording, machine: Machine, train: Kinematics) -> Tracking:
    """Find the angle of shaft 1: from a tachometer if there is one, else from comb and phases.

    The pulses of a tachometer tell the turn, the phases of the mesh lines the angle between them
    (`gearmon.signals.tracking`). A channel that only its name makes a tachometer is left alone
    where it is none.

    Parameters
    ----------
    recording : Recording
        Vibration, and perhaps a tacho channel.
    machine : Machine
        Nominal speeds; its sensors tell what the tachometer sits on.
    train : Kinematics
        Orders of the machine.

    Returns
    -------
    Tracking

    Raises
    ------
    RecordingError
        If a tacho channel that somebody named as such holds no usable pulses.
    """
    vibration = recording.vibration()
    samples, rate = vibration.samples, vibration.sampling_rate_hz
    nominal_hz, scan = scan_nominal_speeds(samples, rate, train, machine)
    signal = GearVibration(samples=samples, rate=rate, train=train, nominal_hz=nominal_hz)
    tacholess = _Tacholess(signal=signal, scan=scan, machine=machine)
    notes: list[str] = []
    for index, kind in enumerate(recording.channel_kinds):
        if kind != "tacho":
            continue
        try:
            return _with_tacho(recording, index, tacholess)
        except (ArgumentError, RecordingError) as error:
            if recording.tacho_told:
                raise
            why = str(error).removeprefix("tacho channel: ").split(". ")[0]
            notes.append(
                f"{recording.channel_names[index]} is no usable tachometer, though its name "
                f"suggests one: {why}; the vibration alone tells the angle"
            )
    return replace(tacholess.alone, notes=(*notes, *tacholess.alone.notes))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Tacholess:
    """What the vibration alone tells, as far as it is asked for."""

    signal: GearVibration
    scan: SpeedScan
    machine: Machine

    @cached_property
    def first(self) -> Tracking:
        """The comb about a nominal speed."""
        signal, nominal_hz = self.signal, self.signal.nominal_hz
        evidence = evidence_of(signal, self.scan, nominal_hz, SPEED_TOLERANCE)
        track = integrate_speed(self.scan.track(), signal.last_s)
        return Tracking(track=track, nominal_hz=nominal_hz, scan=self.scan, evidence=evidence)

    @cached_property
    def alone(self) -> Tracking:
        """The angle by comb and phases."""
        sums = self.signal.sums()
        if sums is None:
            note = "no mesh harmonic lies below the Nyquist frequency"
            return replace(self.first, notes=(note,))
        return track_tacholess(self.signal, sums, self.first, self.machine)


def _with_tacho(recording: Recording, index: int, tacholess: _Tacholess) -> Tracking:
    """Track by the pulses of one channel and the lines between them."""
    tacho = _Tacho.of(recording, index, tacholess.machine, tacholess.signal)
    if _departs(tacho.track, tacholess.signal.nominal_hz):
        found = judge(tacholess.signal, tacho.track)
        if not recording.tacho_told:
            _check_believed(found, tacholess)
    else:
        found = _at_pulses(tacholess, tacho.track)
        if not recording.tacho_told and _shows_elsewhere(tacholess.first, tacho.track):
            _check_believed(judge(tacholess.signal, tacho.track), tacholess)
    track, notes = tacho.joined(tacholess.signal)
    return replace(found, track=track, notes=notes)


def _shows_elsewhere(found: Tracking, track: AngleTrack) -> bool:
    return found.detected > 0 and _apart(track, found.track) > _APART


def _at_pulses(tacholess: _Tacholess, track: AngleTrack) -> Tracking:
    """Judge the meshes at the speed that pulses tell."""
    signal, scan = tacholess.signal, tacholess.scan
    known = speed_in_blocks(track, scan)
    evidence = evidence_of(signal, scan, known.mean_hz, TACHO_REACH, known)
    return Tracking(track=track, nominal_hz=signal.nominal_hz, scan=scan, evidence=evidence)


def _check_believed(judged: Tracking, tacholess: _Tacholess) -> None:
    """Refuse pulses at whose speed fewer lines show than at another one."""
    rival = tacholess.first if tacholess.first.detected or judged.detected else tacholess.alone
    if _apart(judged.track, rival.track) > _APART and _clarity(rival) > _clarity(judged):
        raise RecordingError(
            f"the mesh lines stand out less at the {_mean_hz(judged.track):.4g} Hz that its pulses "
            f"say than at {_mean_hz(rival.track):.4g} Hz"
        )


def _clarity(found: Tracking) -> tuple[int, int]:
    """How many meshes stand out, and how many of their harmonics are clear."""
    return found.detected, sum(seen.clear for seen in found.evidence if seen.stands_out)


def _apart(one: AngleTrack, other: AngleTrack) -> float:
    """How far the mean speeds of two tracks are apart, as a fraction."""
    return abs(_mean_hz(one) / _mean_hz(other) - 1)


def _departs(track: AngleTrack, nominal_hz: float) -> bool:
    """Whether a track leaves the speeds that the scan about nominal covers well."""
    return abs(_mean_hz(track) / nominal_hz - 1) > SPEED_TOLERANCE or wander(track) > 0.005


def _mean_hz(track: AngleTrack) -> float:
    return float((track.turns[-1] - track.turns[0]) / (track.time_s[-1] - track.time_s[0]))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Tacho:
    """A tachometer's channel, its pulses and the angle that they give."""

    name: str
    pulses: TachoPulses
    per_turn: int
    shaft_order: float
    track: AngleTrack

    @classmethod
    def of(
        cls, recording: Recording, index: int, machine: Machine, signal: GearVibration
    ) -> _Tacho:
        """Find the pulses of a channel."""
        name, column = recording.channel_names[index], str(recording.columns[index])
        sensor = next(
            (s for s in machine.sensors if s.kind == "tacho" and str(s.column) in (name, column)),
            None,
        )
        known = sensor.pulses_per_turn if sensor else None
        pulses = find_pulses(recording.samples[index], recording.sampling_rate_hz, known)
        order = signal.train.shaft(sensor.shaft).order if sensor is not None else 1.0
        count = known or pulses_per_turn(pulses, signal.nominal_hz)
        track = track_from_pulses(pulses, count, order, signal.last_s)
        return cls(name=name, pulses=pulses, per_turn=count, shaft_order=order, track=track)

    def joined(self, signal: GearVibration) -> tuple[AngleTrack, tuple[str, ...]]:
        """Return the angle of pulses and lines together, and what is to be said about it."""
        pulses, count = self.pulses, self.per_turn
        notes = [f"tacho {self.name}: {count} pulse{'s' if count > 1 else ''} a turn"]
        if pulses.missing or pulses.extra:
            notes.append(
                f"tacho {self.name}: {pulses.missing} pulses filled in, {pulses.extra} left out"
            )
        sums = signal.sums(float(self.track.speed_hz.max()))
        if sums is None:
            return self.track, tuple(notes)
        time_s, turns, _ = pulse_angles(pulses, count, self.shaft_order)
        found = join(sums, self.track, time_s, turns)
        if found.beyond > 1.0:
            notes.append(
                f"tacho {self.name}: the mesh lines would move the angle {found.beyond:.3g} times "
                "as far as the scatter of the pulses allows; the pulses alone tell it"
            )
        return found.track, tuple(notes)
