"""Angle of shaft 1 from all that a recording holds: a tachometer, a channel of speed, the lines.

The pulses of a tachometer tell the turn, the phases of the mesh lines the angle between them. A
channel of speed, such as an engine's bus or a frequency inverter gives, is slow, late and a little
off: it tells about which speed the lines are looked for where that changes farther than they can be
followed alone (`gearmon.signatures.tracking`). A channel that only its name makes one or the other
is left alone where it is none.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import cache

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.errors import ArgumentError, RecordingError, counted
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine, Sensor
from gearmon.signals.recording import Recording
from gearmon.signals.tracking import tacho
from gearmon.signals.tracking.comb import SpeedTrack
from gearmon.signatures.tracking import (
    COHERENT,
    SPEED_REACH,
    SPEED_TOLERANCE,
    TACHO_REACH,
    GearVibration,
    Tracking,
    follow_told,
)
from gearmon.units import speed_factor

# Blocks in which nominal speeds are told apart [turns], by lines that a speed that wanders must not
# smear.
_COMPARED_TURNS = 12.0
# Mean speeds over the nominal one at which pulses are counted by the mesh, and the most a turn.
_SPEEDS, _TRIED = (0.3, 1.3), 8
# Share of the harmonics that must be clear for a count to be believed, and from which at the
# nominal speed no other is asked. Of 14 lumped models of machines, 1 to 6 pulses a turn, steady at
# 0.45 to 1.2 of that speed and run up and down between 0.3 and 1.1 (504 recordings), all are
# counted right.
_SHOWN, _PLAIN = 0.25, 0.75
# Share of the samples of a channel of pulses that may lie half way up. Of speeds over 279 duty
# cycles and run-ups 16 % and more do, of pulses none but those on an edge.
_HALF_WAY = 0.1
# Blocks in which a channel tells the speed [turns]: longer ones round off where a ramp begins.
_TOLD_TURNS = 1.0
# Uncertainty in mesh periods up to which the lines alone tell an angle well: a quarter of a period
# off, a mesh line adds nothing to its mean.
_KNOWN_CYCLES = 0.25
# Share of its nominal speed that a shaft is taken to turn with where it is slower, or stands: an
# angle has to go on. What the lines do not hold of it is left out like any other stretch.
_STANDS = 0.2


def track_recording(recording: Recording, machine: Machine, far: bool = False) -> Tracking:
    """Find the angle of shaft 1: from a tachometer if there is one, else by the mesh lines.

    Parameters
    ----------
    recording : Recording
        Vibration, and perhaps a tacho channel or one of speed.
    machine : Machine
        Nominal speeds, of which that is meant whose own lines are clearest; its sensors tell what
        shaft the tachometer or the speed is of.
    far : bool
        As of `GearVibration`; not asked where a tachometer tells the speed.

    Returns
    -------
    Tracking

    Raises
    ------
    RecordingError
        If a tacho channel that somebody named as such holds no usable pulses.
    """
    vibration, shaft1_hz = recording.vibration(), machine.operating[0].shaft1_hz
    pace = max(shaft.exact for shaft in kinematics(machine).shafts)
    signal = GearVibration(
        samples=vibration.samples,
        rate=vibration.sampling_rate_hz,
        machine=machine,
        nominal_hz=shaft1_hz * float(pace),
        pace=pace,
        far=far,
    )
    if any(point.shaft1_hz != shaft1_hz for point in machine.operating):
        signal, _ = signal.meant(lambda own: own.scan(_COMPARED_TURNS))
    notes: list[str] = []
    for index, kind in enumerate(recording.channel_kinds):
        if kind != "tacho" and not (kind == "speed" and _is_pulsed(recording.samples[index])):
            continue
        sure = recording.tacho_told and kind == "tacho"
        try:
            return _with_tacho(recording, index, signal, sure).by_shaft1()
        except (ArgumentError, RecordingError) as error:
            if sure:
                raise
            if kind == "speed":
                continue
            why = str(error).removeprefix("tacho channel: ").split(". ")[0]
            notes.append(
                f"{recording.channel_names[index]} is no usable tachometer, though its name "
                f"suggests one: {why}; it is left alone"
            )
    found = (_by_speed_channel(recording, signal) or signal.alone).by_shaft1()
    return replace(found, notes=(*notes, *found.notes))


def _is_pulsed(values: FloatArray) -> bool:
    """Whether a channel of speed holds pulses: hardly a sample lies half way up."""
    low, high = float(values.min()), float(values.max())
    half_way = np.abs(values - 0.5 * (low + high)) < 0.25 * (high - low)
    return bool(low < high and np.mean(half_way) < _HALF_WAY)


def _sensor(recording: Recording, index: int, machine: Machine) -> Sensor | None:
    """Return what the machine file says of a channel of this kind."""
    places = recording.channel_names[index], str(recording.columns[index])
    sensors = (own for own in machine.sensors if own.kind == recording.channel_kinds[index])
    return next((own for own in sensors if str(own.column) in places), None)


def _with_tacho(recording: Recording, index: int, signal: GearVibration, sure: bool) -> Tracking:
    """Track by the pulses of one channel, surely one of pulses or not, and the lines between."""
    name = recording.channel_names[index]
    sensor = _sensor(recording, index, signal.machine)
    known = sensor.pulses_per_turn if sensor else None
    pulses = tacho.find_pulses(recording.samples[index], recording.sampling_rate_hz, known)
    if sensor:
        count = sensor.pulses_per_turn
        found = signal.by_pulses(
            pulses, count, kinematics(signal.machine).shaft(sensor.shaft).order
        )
    else:
        count, found = _pulses_counted(pulses, signal)
    if not sure:
        _check_believed(found)
    # no mesh is heard less with pulses than without, where both tell the same speed: about one
    # speed there are few combs of other teeth to stand out of (of 14 drawn machines, 3 s each, one
    # shows its mesh without the pulses alone); the first costs less
    for way in ("first", "alone"):
        if found.detected == len(found.evidence):
            break
        rival: Tracking = getattr(signal, way)
        if rival.detected > found.detected and found.is_near(rival):
            found = replace(found, scan=rival.scan, evidence=rival.evidence)
    told = [f"{counted(count, 'pulse')} a turn"]
    if pulses.missing or pulses.extra:
        told.append(f"{pulses.missing} pulses filled in, {pulses.extra} left out")
    track = found.track
    sums = signal.sums(float(track.speed_hz.max()))
    if sums is not None:
        track, beyond = tacho.join(sums, track)
        if beyond > 1.0:
            told.append(
                f"the mesh lines would move the angle {beyond:.3g} times as far as the "
                "scatter of the pulses allows; the pulses alone tell it"
            )
    return replace(found, track=track, notes=tuple(f"tacho {name}: {one}" for one in told))


def _pulses_counted(pulses: tacho.TachoPulses, signal: GearVibration) -> tuple[int, Tracking]:
    """Count pulses a turn of shaft 1 as the nominal speed and the mesh have it.

    At half the speed every second line of a comb is a mesh line, at twice the speed every one, but
    then those between are as clear: the fastest speed counts at which they are not.
    """
    near, refused = tuple[int, ...](), list[RecordingError]()

    @cache
    def judged(count: int) -> Tracking | None:
        try:
            return signal.by_pulses(pulses, count)
        except RecordingError as error:
            refused.append(error)
            return None

    try:
        near = tacho.pulses_per_turn(pulses, signal.shaft1_hz)
    except RecordingError as error:
        refused.append(error)
    # most harmonics clear at the nominal speed: no other is asked
    plain = judged(near[0]) if len(near) == 1 else None
    if plain and plain.clear_share > _PLAIN:
        return near[0], plain
    mean = len(pulses.time_s[1:]) / float(np.ptp(pulses.time_s)) / signal.shaft1_hz
    slowest, fastest = _SPEEDS
    elsewhere = range(max(1, math.ceil(mean / fastest)), min(_TRIED, int(mean / slowest)) + 1)
    tried = sorted({*near, *elsewhere})
    for count in tried:
        own = judged(count)
        slower = [count / other for other in tried if other > count]
        if own and own.clear_share > _SHOWN and not own.finer(slower):
            return count, own
    at_nominal = any(own.detected for own in map(judged, near) if own)
    if not at_nominal and signal.alone.detected:
        known_hz = signal.alone.track.mean_hz / float(signal.pace)
        with suppress(RecordingError):
            near += tacho.pulses_per_turn(pulses, known_hz, TACHO_REACH)
    held = [(count, own) for count in near if (own := judged(count))]
    if not held:
        raise refused[0]
    return max(held, key=lambda known: known[1].clarity)


def _check_believed(judged: Tracking) -> None:
    """Refuse pulses at whose speed fewer lines show than at another one that holds the angle."""
    signal = judged.signal
    for way in ("first", "alone") if judged.detected else ("alone",):
        rival: Tracking = getattr(signal, way)
        if judged.is_near(rival) or rival.clarity <= judged.clarity:
            return
    # where the speed changes far, lines show at that of any part, but stand still in no angle
    if judged.detected and rival.lost:
        return
    told_hz, rival_hz = (own.track.mean_hz / float(signal.pace) for own in (judged, rival))
    raise RecordingError(
        f"the mesh lines stand out less at the {told_hz:.4g} Hz that its pulses "
        f"say than at {rival_hz:.4g} Hz"
    )


def _by_speed_channel(recording: Recording, signal: GearVibration) -> Tracking | None:
    """Track about the speed that a channel tells; None if the lines alone tell it as well.

    Of a speed that changes farther than these can be followed only a channel tells. Where it may be
    of several shafts that counts at whose speed most lines are clear.
    """
    every: list[Tracking] = []
    for channel, course in _courses_told(recording, signal):
        usual, low, high = (float(own(course.speed_hz)) for own in (np.median, np.min, np.max))
        nominal = (float(signal.pace) * point.shaft1_hz for point in signal.machine.operating)
        nominal_hz = min(nominal, key=lambda own: abs(math.log(own / usual)))
        alone = signal.alone if high < (1 + 2 * SPEED_REACH) * low else None
        if alone and _tells(course, alone) and _is_sure(alone):
            return None
        found = follow_told(replace(signal, nominal_hz=nominal_hz), course)
        if found is None or not _tells(course, found):
            continue
        if alone and _tells(course, alone):
            counts = found.track.uncertainty_turns <= alone.track.uncertainty_turns
        elif alone and _is_sure(alone):
            slow, fast = sorted((alone, found), key=lambda own: own.track.mean_hz)
            finer = fast.finer([slow.track.mean_hz / fast.track.mean_hz])
            counts = (slow if finer else fast) is found
        else:
            counts = True
        if counts:
            told = f"{channel} tells the speed about which the mesh lines were looked for"
            every.append(replace(found, notes=(told, *found.notes)))
    return max(every, key=lambda own: (own.clarity, own.coherent), default=None)


def _is_sure(found: Tracking) -> bool:
    """Whether the lines tell an angle well by themselves."""
    cycles = found.track.uncertainty_turns * max(own.order for own in found.signal.train.meshes)
    return found.detected > 0 and found.coherent > COHERENT and cycles < _KNOWN_CYCLES


def _tells(course: SpeedTrack, found: Tracking) -> bool:
    """Whether a course that is told is that of an angle, as far as a channel's scale may be off."""
    return abs(found.track.mean_hz / course.mean_hz - 1) < SPEED_TOLERANCE


def _courses_told(recording: Recording, signal: GearVibration) -> Iterator[tuple[str, SpeedTrack]]:
    """Give the courses of speed that channels tell, as that of the shaft turns are counted of.

    What the machine file and the channel leave open, the shaft and the unit, is what brings it
    near a nominal speed.
    """
    nominal_hz = [point.shaft1_hz for point in signal.machine.operating]
    for index in np.flatnonzero(np.array(recording.channel_kinds) == "speed").tolist():
        name, unit = recording.channel_names[index], recording.units[index]
        sensor = _sensor(recording, index, signal.machine)
        values = np.abs(recording.samples[index])
        # a value that is held until the next one comes is that at the middle of this time
        held = np.flatnonzero(np.diff(values, prepend=np.nan, append=np.nan))
        values = np.interp(np.arange(len(values)), 0.5 * (held[1:] + held[:-1]), values[held[:-1]])
        block = max(1, round(_TOLD_TURNS / signal.nominal_hz * signal.rate))
        starts = np.arange(0, max(1, len(values) - block // 2), block)
        ends = np.append(starts[1:], len(values))
        mean = np.add.reduceat(values, starts) / (ends - starts)
        stated = unit or (name if speed_factor(name) else None)
        for spelt in (stated,) if stated else ("rpm", "Hz", "rad/s"):
            for shaft in kinematics(signal.machine).shafts:
                course_hz = mean * (speed_factor(spelt) or 0.0) / shaft.order
                usual = float(np.median(course_hz))
                near = _SPEEDS[0] * min(nominal_hz) < usual < _SPEEDS[1] * max(nominal_hz)
                if near and (sensor is None or shaft.number == sensor.shaft):
                    least = _STANDS * min(nominal_hz)
                    course_hz = float(signal.pace) * np.maximum(course_hz, least)
                    what = f"channel {name} ({spelt}, shaft {shaft.number})"
                    centres_s = 0.5 * (starts + ends) / signal.rate
                    yield what, SpeedTrack(time_s=centres_s, speed_hz=course_hz)
