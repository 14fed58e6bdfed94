"""The angle of shaft 1 in a recording: from a tachometer and the mesh lines, or tacholess.

Without a tachometer the steady comb is tried first, within 3 % of a nominal speed. Where its lines
are not phase-coherent in the angle that it gives, or no mesh shows at it, the speed is looked for
in short blocks and far about the nominal one, and kept only if the mesh stands out better at the
speeds so found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gearmon.errors import ArgumentError, RecordingError
from gearmon.gears.kinematics import Kinematics
from gearmon.machine import Machine
from gearmon.signals.orders.lines import OrderSums
from gearmon.signals.orders.spectra import fine_order_spectrum
from gearmon.signals.recording import Recording
from gearmon.signals.tracking.comb import clearest
from gearmon.signals.tracking.mesh_detection import sideband_spacing
from gearmon.signals.tracking.phases import (
    coherent_share,
    follow_lines,
    integrate_speed,
    lock_track,
    unwarp,
)
from gearmon.signals.tracking.slips import LEAST_TURNS, SlipCheck, check_slips, mend_slips
from gearmon.signals.tracking.tacho import (
    find_pulses,
    join,
    pulses_per_turn,
    track_from_pulses,
)
from gearmon.signatures.speed import (
    SPEED_REACH,
    SPEED_TOLERANCE,
    TACHO_REACH,
    GearVibration,
    Tracking,
    meant_speed,
    wander,
)

# How far pulses and comb may be apart before it is asked which of them is right.
_APART = 0.01
# Share of the mesh lines' power that must be phase-coherent, of a speed that wanders and of a calm
# one, for no other speed to be looked for.
_COHERENT, _NEARLY = 0.82, 0.6
# Below this share the angle of a mesh line is not known to a tenth of its period.
_LOST = 0.5
# A path through noise gathers lines, too, which are not coherent in its angle: this share of them
# has to be. Of 40 recordings of noise it is 0.00, of gears whose speed wanders fast 0.74 and more,
# 0.38 where the angle slips.
_GATHERED = 0.2
# How far about a path of speeds the comb is looked for in its angle, and then again.
_PATH_REACHES = (0.015, 0.008)
# Wander of the speed from which the ends of a recording need care, relative standard deviation.
_WANDERS = 1e-3
# Share of a recording in which the angle must be held for the rest to be left out.
_HELD = 0.5
# Stretches in which the angle may have slipped that a note names.
_NAMED = 3
# How much more of the lines must be phase-coherent before a speed far away is believed.
_BETTER = 0.02
# The same if fewer meshes stand out there.
_FAR_BETTER = 0.2
# Turns that are looked at for a speed elsewhere, and how far off it counts.
_LOOK_TURNS = 60.0
_ELSEWHERE = 0.01
# Sidebands that contradict or support a followed speed, in robust standard deviations.
_CONTRADICTED = 6.0
_SUPPORTED = 3.0


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
    tacholess = _Tacholess(signal=meant_speed(samples, rate, train, machine), machine=machine)
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
    machine: Machine

    @cached_property
    def first(self) -> Tracking:
        """The comb about a nominal speed."""
        signal, nominal_hz = self.signal, self.signal.nominal_hz
        scan = signal.first_scan()
        evidence = signal.evidence(scan, nominal_hz, SPEED_TOLERANCE)
        track = integrate_speed(scan.track(), signal.last_s)
        return Tracking(track=track, nominal_hz=nominal_hz, scan=scan, evidence=evidence)

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
    signal, name = tacholess.signal, recording.channel_names[index]
    places = name, str(recording.columns[index])
    sensors = (s for s in tacholess.machine.sensors if s.kind == "tacho")
    sensor = next((s for s in sensors if str(s.column) in places), None)
    known = sensor.pulses_per_turn if sensor else None
    pulses = find_pulses(recording.samples[index], recording.sampling_rate_hz, known)
    order = signal.train.shaft(sensor.shaft).order if sensor else 1.0
    count = known or pulses_per_turn(pulses, signal.nominal_hz)
    track = track_from_pulses(pulses, count, order, signal.last_s)
    found = signal.judged(track, TACHO_REACH)
    if not recording.tacho_told:
        _check_believed(found, tacholess)
    found = _as_without(found, tacholess)
    told = [f"{count} pulse{'s' if count > 1 else ''} a turn"]
    if pulses.missing or pulses.extra:
        told.append(f"{pulses.missing} pulses filled in, {pulses.extra} left out")
    sums = signal.sums(float(track.speed_hz.max()))
    if sums is not None:
        track, beyond = join(sums, track)
        if beyond > 1.0:
            told.append(
                f"the mesh lines would move the angle {beyond:.3g} times as far as the "
                "scatter of the pulses allows; the pulses alone tell it"
            )
    return replace(found, track=track, notes=tuple(f"tacho {name}: {one}" for one in told))


def _check_believed(judged: Tracking, tacholess: _Tacholess) -> None:
    """Refuse pulses at whose speed fewer lines show than at another one."""
    rival = tacholess.first if tacholess.first.detected or judged.detected else tacholess.alone
    if _apart(judged, rival) > _APART and rival.clarity > judged.clarity:
        raise RecordingError(
            f"the mesh lines stand out less at the {judged.track.mean_hz:.4g} Hz that its pulses "
            f"say than at {rival.track.mean_hz:.4g} Hz"
        )


def _as_without(judged: Tracking, tacholess: _Tacholess) -> Tracking:
    """Hear no mesh less with pulses than without, where both tell the same speed.

    About one speed there are few combs of other teeth to stand out of: of 14 drawn machines, 3 s
    each, one shows its mesh without the pulses alone.
    """
    # the first costs less
    for way in ("first", "alone"):
        if judged.detected == len(judged.evidence):
            break
        rival: Tracking = getattr(tacholess, way)
        if rival.detected > judged.detected and _apart(judged, rival) <= _APART:
            judged = replace(rival, track=judged.track)
    return judged


def _apart(one: Tracking, other: Tracking) -> float:
    """How far the speeds are apart, as a fraction."""
    return abs(one.track.mean_hz / other.track.mean_hz - 1)


def track_tacholess(
    signal: GearVibration, sums: OrderSums, first: Tracking, machine: Machine
) -> Tracking:
    """Track without a tachometer, beginning with the track of the comb.

    Parameters
    ----------
    signal : GearVibration
        The recording.
    sums : OrderSums
        Its mesh lines.
    first : Tracking
        The steady comb's track and evidence.
    machine : Machine
        Nominal speeds.

    Returns
    -------
    Tracking
    """
    track, share = follow_lines(sums, first.track, signal.comb)
    calm = share > (_NEARLY if wander(track) < _WANDERS else _COHERENT)
    if not calm or _elsewhere(signal, first):
        followed = _follow(signal, machine)
        if followed is not None and _outdoes(followed, (first, share)):
            return _with_doubt(signal, *followed)
    found = replace(first, track=track)
    if share > _COHERENT and first.detected < len(first.evidence) and wander(track) > _WANDERS:
        # a speed that wanders smears lines in long blocks
        judged = signal.judged(track)
        if judged.detected > first.detected and _agrees(signal, judged):
            found = judged
    if found.detected:
        return _with_doubt(signal, found, share, sums)
    return replace(found, coherent=share)


def _elsewhere(signal: GearVibration, first: Tracking) -> bool:
    """Whether the comb may stand at another speed: no mesh shows, or one does but a look says so.

    The look is at some turns from the middle of the recording, far about the nominal speed.
    """
    if first.detected in (0, len(first.evidence)):
        return first.detected == 0
    length = round(_LOOK_TURNS / signal.nominal_hz * signal.rate)
    begin = max(0, (signal.samples.shape[-1] - length) // 2)
    speed = replace(signal, samples=signal.samples[:, begin : begin + length]).path().track()
    known = first.scan.track().at(begin / signal.rate + speed.time_s)
    return bool(np.median(np.abs(speed.speed_hz / known - 1)) > _ELSEWHERE)


def _outdoes(followed: tuple[Tracking, float, OrderSums], steady: tuple[Tracking, float]) -> bool:
    """Whether a followed speed shows more meshes than a steady one, or lines far more coherent."""
    more = followed[0].detected - steady[0].detected
    return more > 0 or followed[1] > steady[1] + (_BETTER if more == 0 else _FAR_BETTER)


def _follow(signal: GearVibration, machine: Machine) -> tuple[Tracking, float, OrderSums] | None:
    """Look for the comb in short blocks far about nominal; None if no mesh stands out there.

    Returns the track, the share of the lines that is coherent in it, and the lines.
    """
    speeds = sorted({point.shaft1_hz for point in machine.operating})
    signals = [replace(signal, nominal_hz=own) for own in speeds]
    paths = [own.path() for own in signals]
    meant = clearest([(path, own.comb) for path, own in zip(paths, signals, strict=True)])
    signal, speed = signals[meant], paths[meant].track()
    sums = signal.sums(float(speed.speed_hz.max()))
    if sums is None:
        return None
    track = integrate_speed(speed, signal.last_s)
    for reach in _PATH_REACHES:
        track = unwarp(signal.samples, signal.rate, track, signal.comb, reach)
    track = lock_track(sums, track)
    judged, share = signal.judged(track), coherent_share(sums, track)
    if share < _GATHERED or not _agrees(signal, judged):
        return None
    course = speed.speed_hz
    note = (
        f"the speed was followed over the recording, from {course[0]:.4g} to {course[-1]:.4g} Hz "
        f"between {course.min():.4g} and {course.max():.4g} Hz; nominal is {signal.nominal_hz:.4g} "
        "Hz"
    )
    return replace(judged, notes=(note,)), share, sums


def _agrees(signal: GearVibration, judged: Tracking) -> bool:
    """Whether meshes are clear and sidebands agree with a speed; they must show if it is far off.

    A mesh of one tooth more stands at the same lines if the shaft turns a little slower: only the
    spacing of its sidebands tells.
    """
    if judged.clarity[1] < 2:
        return False
    speeds = judged.track.speed_hz
    nominal = signal.nominal_hz
    low, high = (1 - SPEED_TOLERANCE) * speeds.min(), (1 + SPEED_TOLERANCE) * speeds.max()
    pieces = max(1, signal.samples.shape[-1] >> 18)
    spectrum = fine_order_spectrum(signal.samples, signal.rate, judged.track, pieces)
    supported = False
    for mesh, comb, seen in zip(signal.train.meshes, signal.meshes, judged.evidence, strict=True):
        if not seen.stands_out or mesh.carrier != 0:
            continue
        told = [
            sideband_spacing(spectrum.quality, spectrum.step, comb, spacing, SPEED_REACH)
            for spacing in comb.spacings
        ]
        excess = max((one.excess for one in told), default=0.0)
        support = max((one.support for one in told), default=0.0)
        clear = support >= _SUPPORTED
        # right sidebands of one gear fix the speed: what beats those of the other is some line else
        if not (clear and support > excess) and excess > 0 and seen.score - excess < _CONTRADICTED:
            return False
        supported = supported or clear
    return supported or bool(low <= nominal <= high)


def _with_doubt(
    signal: GearVibration, tracking: Tracking, share: float, sums: OrderSums
) -> Tracking:
    """State how far the angle may be off, and say so if the lines do not hold it."""
    track = tracking.track
    if track.turns[-1] - track.turns[0] < LEAST_TURNS:
        return tracking
    check = check_slips(sums, track)
    if share >= _LOST and not check.locked:
        track, check = mend_slips(sums, track, check)
    doubt, notes, held_s = check.typical_turns(), tracking.notes, None
    if share < _LOST:
        order = max(mesh.order for mesh in signal.train.meshes)
        cycles = np.sqrt(-np.log(max(share, 1e-3))) / (2 * np.pi)
        doubt = max(cycles / order, doubt)
        notes += (
            f"the angle is doubtful: only {share:.0%} of the power of the mesh lines stands still "
            "in it; record with a tachometer",
        )
    elif not check.locked:
        start, stop = check.held(track)
        if stop - start >= _HELD * (track.time_s[-1] - track.time_s[0]):
            doubt, held_s = check.typical_turns(start, stop), (start, stop)
        notes += (_slips_told(check, held_s),)
    track = replace(track, uncertainty_turns=float(doubt))
    told = replace(tracking, track=track, notes=notes, held_s=held_s)
    return replace(told, coherent=share, lost=share < _LOST)


def _slips_told(check: SlipCheck, held_s: tuple[float, float] | None) -> str:
    """Say where an angle may have slipped."""
    if held_s is not None:
        return (
            f"only {held_s[0]:.4g} to {held_s[1]:.4g} s are looked at: beyond, the mesh lines do "
            "not hold the angle, which may have slipped by whole mesh periods"
        )
    lost = [stretch for stretch in check.lost if not stretch.harmless]
    where = ", ".join(f"{one.start_s:.4g} to {one.end_s:.4g} s" for one in lost[:_NAMED])
    more = f" and {len(lost) - _NAMED} times more" if len(lost) > _NAMED else ""
    return (
        f"the angle is doubtful: the mesh lines do not hold it from {where}{more}, where it may "
        "have slipped by whole mesh periods; leave these parts out, or record with a tachometer"
    )
