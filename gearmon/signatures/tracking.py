"""The angle of shaft 1 in a recording: from a tachometer if there is one, else by ear."""

from __future__ import annotations

from dataclasses import replace

from gearmon.gears.kinematics import Kinematics
from gearmon.machine import Machine
from gearmon.signals.angle import AngleTrack
from gearmon.signals.phase import integrate_speed
from gearmon.signals.recording import Recording
from gearmon.signals.tacho import find_pulses, pulses_per_turn, track_from_pulses
from gearmon.signatures.hearing import Heard, Tracking, evidence_of, judge, wander
from gearmon.signatures.speed import SPEED_TOLERANCE, scan_nominal_speeds
from gearmon.signatures.tracking_by_ear import track_by_ear


def track_recording(recording: Recording, machine: Machine, train: Kinematics) -> Tracking:
    """Find the angle of shaft 1: from a tachometer if there is one, else from comb and phases.

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
        If a tacho channel holds no usable pulses.
    """
    vibration = recording.vibration()
    samples, rate = vibration.samples, vibration.sampling_rate_hz
    nominal_hz, scan = scan_nominal_speeds(samples, rate, train, machine)
    heard = Heard(samples=samples, rate=rate, train=train, nominal_hz=nominal_hz)
    if "tacho" in recording.channel_kinds:
        track, notes = _tacho_track(recording, machine, train, nominal_hz)
        if _departs(track, nominal_hz):
            return replace(judge(heard, track), notes=notes)
        evidence = evidence_of(heard, scan, nominal_hz, SPEED_TOLERANCE)
        return Tracking(
            track=track, nominal_hz=nominal_hz, scan=scan, evidence=evidence, notes=notes
        )
    evidence = evidence_of(heard, scan, nominal_hz, SPEED_TOLERANCE)
    first = Tracking(
        track=integrate_speed(scan.track(), heard.last_s),
        nominal_hz=nominal_hz,
        scan=scan,
        evidence=evidence,
    )
    sums = heard.sums()
    if sums is None:
        return replace(first, notes=("no mesh harmonic lies below the Nyquist frequency",))
    return track_by_ear(heard, sums, first, machine)


def _departs(track: AngleTrack, nominal_hz: float) -> bool:
    """Whether a track leaves the speeds that the scan about nominal hears well."""
    mean = (track.turns[-1] - track.turns[0]) / (track.time_s[-1] - track.time_s[0])
    return abs(mean / nominal_hz - 1) > SPEED_TOLERANCE or wander(track) > 0.005


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
    known = sensor.pulses_per_turn if sensor else None
    pulses = find_pulses(recording.samples[index], recording.sampling_rate_hz, known)
    order = train.shaft(sensor.shaft).order if sensor is not None else 1.0
    count = known or pulses_per_turn(pulses, nominal_hz)
    duration = (recording.samples.shape[-1] - 1) / recording.sampling_rate_hz
    track = track_from_pulses(pulses, count, order, duration)
    notes = [f"tacho {name}: {count} pulse{'s' if count > 1 else ''} a turn"]
    if pulses.missing or pulses.extra:
        notes.append(f"tacho {name}: {pulses.missing} pulses filled in, {pulses.extra} left out")
    return track, tuple(notes)
