"""The angle of shaft 1 in a recording: from a tachometer, a steady comb, or a followed one.

The steady comb is tried first, within 3 % of a nominal speed. Where its lines do not stand still in
the angle that it gives, or no mesh shows at it, the speed is looked for in short blocks and far
about the nominal one, and kept only if the mesh stands out better at the speeds so found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from gearmon.gears.kinematics import Kinematics, Mesh
from gearmon.machine import Machine
from gearmon.signals.angle import AngleTrack
from gearmon.signals.comb import SpeedScan, SpeedTrack, scan_speed
from gearmon.signals.order_lines import order_quality
from gearmon.signals.phase import integrate_speed, refine_track, standing_share
from gearmon.signals.phase_lock import lock_track
from gearmon.signals.presence import MeshEvidence, mesh_evidence
from gearmon.signals.recording import Recording
from gearmon.signals.sideband_spacing import spacing_mismatch, spacing_support
from gearmon.signals.speed_path import find_path, follow_speed
from gearmon.signals.tacho import find_pulses, pulses_per_turn, track_from_pulses
from gearmon.signatures.families import group_orders
from gearmon.signatures.speed import (
    SPEED_TOLERANCE,
    machine_comb,
    mesh_combs,
    scan_nominal_speeds,
)

FloatArray = NDArray[np.float64]

# Shorter blocks, searched about the track so far, follow a speed that wanders (turns, tolerance).
_FINER_SCANS = ((10.0, 0.012), (6.0, 0.006))
# Share of the mesh lines' power that must stand still in angle for a track to be left alone.
_STANDING = 0.82
# Below this share shorter blocks do not mend a track: the speed must be followed.
_NEARLY = 0.6
# Above this share nothing is left to gain from shorter blocks.
_STILL = 0.93
# Below this share the angle of a mesh line is not known to a tenth of its period.
_LOST = 0.5
# Wander of the speed from which the ends of a recording need care, relative standard deviation.
_WANDERS = 1e-3
# How much more of the lines must stand still before a speed far away is believed.
_BETTER = 0.02
# The same if fewer meshes stand out there.
_FAR_BETTER = 0.2
# Turns that are looked at for a speed elsewhere, and how far off it counts.
_LOOK_TURNS = 60.0
_ELSEWHERE = 0.01
# How far the speed is looked for when it is not found about nominal.
_REACH = 0.25
# Sidebands that contradict or support a followed speed, in robust standard deviations.
_CONTRADICTED = 6.0
_SUPPORTED = 3.0
# Scan about a followed speed, for judging whether a mesh is there [turns, reach].
_JUDGED_TURNS = 20.0
_JUDGED_REACH = 0.012
# Harmonics of each mesh whose phases are followed.
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
    """

    track: AngleTrack
    nominal_hz: float
    scan: SpeedScan
    evidence: tuple[MeshEvidence, ...]
    notes: tuple[str, ...] = ()

    @property
    def plan_hz(self) -> float:
        """Speed for which orders are planned [Hz]: nominal, unless they would leave the band."""
        highest = float(self.track.speed_hz.max())
        return self.nominal_hz if highest < 1.06 * self.nominal_hz else highest

    @property
    def standing(self) -> int:
        """Meshes that stand out."""
        return sum(seen.stands_out for seen in self.evidence)

    @property
    def convincing(self) -> bool:
        """Whether several harmonics of meshes that stand out are clear."""
        return sum(seen.clear for seen in self.evidence if seen.stands_out) >= 2


@dataclass(frozen=True, kw_only=True)
class _Heard:
    """Vibration and what is listened for in it."""

    samples: FloatArray
    rate: float
    train: Kinematics
    nominal_hz: float

    @property
    def last_s(self) -> float:
        return float((self.samples.shape[-1] - 1) / self.rate)

    def orders(self, speed_hz: float) -> FloatArray:
        """Mesh harmonics whose phases are followed while the speed is at most `speed_hz`."""
        top = 0.45 * self.rate / speed_hz
        found = {
            float(order)
            for mesh in self.train.meshes
            for k in range(1, _HARMONICS + 1)
            for order in _followed(mesh, k)
        }
        return np.array(sorted(order for order in found if order < top))

    def share(self, track: AngleTrack) -> float:
        orders = self.orders(float(track.speed_hz.max()))
        return standing_share(self.samples, self.rate, track, orders) if len(orders) else 0.0


def _followed(mesh: Mesh, harmonic: int) -> tuple[Fraction, ...]:
    """Lines of one mesh harmonic whose phase is followed: those that the planets leave."""
    if mesh.carrier == 0:
        return (harmonic * mesh.exact,)
    return group_orders(mesh, harmonic)


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
    heard = _Heard(samples=samples, rate=rate, train=train, nominal_hz=nominal_hz)
    if "tacho" in recording.channel_kinds:
        track, notes = _tacho_track(recording, machine, train, nominal_hz)
        if _departs(track, nominal_hz):
            return replace(_judged(heard, track), notes=notes)
        evidence = _evidence(heard, scan, nominal_hz, SPEED_TOLERANCE)
        return Tracking(
            track=track, nominal_hz=nominal_hz, scan=scan, evidence=evidence, notes=notes
        )
    evidence = _evidence(heard, scan, nominal_hz, SPEED_TOLERANCE)
    first = Tracking(
        track=integrate_speed(scan.track(), heard.last_s),
        nominal_hz=nominal_hz,
        scan=scan,
        evidence=evidence,
    )
    if len(heard.orders(nominal_hz * (1 + SPEED_TOLERANCE))) == 0:
        return replace(first, notes=("no mesh harmonic lies below the Nyquist frequency",))
    return _by_ear(heard, first, machine)


def _by_ear(heard: _Heard, first: Tracking, machine: Machine) -> Tracking:
    """Track without a tachometer, beginning with the track of the comb."""
    steady, share = _steady(heard, first)
    calm = share > (_NEARLY if _wander(steady) < _WANDERS else _STANDING)
    if not calm or _elsewhere(heard, first):
        followed = _follow(heard, machine)
        if followed is not None and _outdoes(followed, (first, share)):
            return _with_doubt(heard, *followed)
        if share <= _STANDING:
            steady, share = _finer(heard, first, steady, share)
    return _with_doubt(heard, replace(first, track=steady), share if first.standing else 1.0)


def _elsewhere(heard: _Heard, first: Tracking) -> bool:
    """Whether the comb may stand at another speed: no mesh shows, or one does but a look says so.

    The look is at some turns from the middle of the recording, far about the nominal speed.
    """
    if first.standing in (0, len(first.evidence)):
        return first.standing == 0
    length = round(_LOOK_TURNS / heard.nominal_hz * heard.rate)
    begin = max(0, (heard.samples.shape[-1] - length) // 2)
    part = heard.samples[:, begin : begin + length]
    path = find_path(part, heard.rate, machine_comb(heard.train), heard.nominal_hz, _REACH)
    here = begin / heard.rate + path.speed.time_s
    known = first.scan.track().at(here)
    return bool(np.median(np.abs(path.speed.speed_hz / known - 1)) > _ELSEWHERE)


def _outdoes(followed: tuple[Tracking, float], steady: tuple[Tracking, float]) -> bool:
    """Whether a followed speed shows more meshes than a steady one, or lines far more still."""
    more = followed[0].standing - steady[0].standing
    return more > 0 or followed[1] > steady[1] + (_BETTER if more == 0 else _FAR_BETTER)


def _steady(heard: _Heard, first: Tracking) -> tuple[AngleTrack, float]:
    """Refine the comb's track by phases; lock it to them if its speed wanders."""
    orders = heard.orders(heard.nominal_hz * (1 + SPEED_TOLERANCE))
    # long blocks part the mesh lines from the sidebands of slow shafts; a calm speed allows them
    slowest = min(shaft.order for shaft in heard.train.shafts)
    calm = float(np.clip(2.0 / slowest, 8.0, 20.0))
    track = refine_track(heard.samples, heard.rate, first.track, orders, calm)
    share = standing_share(heard.samples, heard.rate, track, orders)
    if share > _STANDING and _wander(track) > _WANDERS:
        return _locked(heard, orders, (track, share))
    if _NEARLY < share < _STILL:
        best = _better(heard, orders, (track, share), _in_short_blocks(heard, track, orders))
        # an angle that wobbles puts sidebands of slow shafts beside every mesh line
        return _better(heard, orders, best, lock_track(*_ear(heard), best[0], orders))
    return track, share


def _locked(
    heard: _Heard, orders: FloatArray, known: tuple[AngleTrack, float]
) -> tuple[AngleTrack, float]:
    """Lock a track that wanders to the lines, which shorter blocks lose half a block from the end.

    A path whose delay changes makes lines that a track stands still in turn a little.
    """
    return _better(heard, orders, known, lock_track(*_ear(heard), known[0], orders), 0.01)


def _ear(heard: _Heard) -> tuple[FloatArray, float]:
    return heard.samples, heard.rate


def _in_short_blocks(heard: _Heard, track: AngleTrack, orders: FloatArray) -> AngleTrack:
    return refine_track(*_ear(heard), track, orders, block_turns=5.0, wander=0.01)


def _better(
    heard: _Heard,
    orders: FloatArray,
    known: tuple[AngleTrack, float],
    track: AngleTrack,
    leeway: float = 0.0,
) -> tuple[AngleTrack, float]:
    """Return the known track, or another one in which the lines stand more still."""
    share = standing_share(heard.samples, heard.rate, track, orders)
    return (track, share) if share > known[1] - leeway else known


def _finer(
    heard: _Heard, first: Tracking, track: AngleTrack, share: float
) -> tuple[AngleTrack, float]:
    """Follow a speed that wanders within the tolerance by scans in shorter blocks."""
    orders = heard.orders(heard.nominal_hz * (1 + SPEED_TOLERANCE))
    comb, speed = machine_comb(heard.train), first.scan.track()
    best = (track, share)
    if share <= _NEARLY:
        best = _better(heard, orders, best, _in_short_blocks(heard, track, orders))
    enough = _STANDING
    for turns, tolerance in _FINER_SCANS:
        block_s = turns / heard.nominal_hz
        if best[1] > enough or heard.last_s < 8 * block_s:
            break
        enough = _STILL  # once the speed is known to wander, even its last second must be right
        finer = scan_speed(*_ear(heard), comb, heard.nominal_hz, tolerance, block_s, around=speed)
        speed = finer.track()
        other = _in_short_blocks(heard, integrate_speed(speed, heard.last_s), orders)
        best = _better(heard, orders, best, other)
    if best[1] > _STANDING and _wander(best[0]) > _WANDERS:
        best = _locked(heard, orders, best)
    return best


def _follow(heard: _Heard, machine: Machine) -> tuple[Tracking, float] | None:
    """Look for the comb in short blocks far about nominal; None if no mesh stands out there."""
    comb = machine_comb(heard.train)
    nominal = {point.shaft1_hz for point in machine.operating}
    paths = [(find_path(*_ear(heard), comb, hz, _REACH), hz) for hz in sorted(nominal)]
    path, nominal_hz = max(paths, key=lambda pair: pair[0].score)
    heard = replace(heard, nominal_hz=nominal_hz)
    orders = heard.orders(0.5 * nominal_hz)
    track = follow_speed(*_ear(heard), comb, orders, path.speed)
    judged = _judged(heard, track)
    if not judged.convincing or not _spacing_agrees(heard, judged):
        return None
    speeds = path.speed.speed_hz
    note = (
        f"the speed was followed over the recording, from {speeds[0]:.4g} to {speeds[-1]:.4g} Hz "
        f"between {speeds.min():.4g} and {speeds.max():.4g} Hz; nominal is {nominal_hz:.4g} Hz"
    )
    return replace(judged, notes=(note,)), heard.share(track)


def _judged(heard: _Heard, track: AngleTrack) -> Tracking:
    """Judge the meshes on a scan about a track whose speed changes or is far from nominal."""
    time_s = np.linspace(0.0, heard.last_s, 2 + int(8 * heard.last_s))
    middle = 0.5 * (time_s[1:] + time_s[:-1])
    speed = np.diff(track.turns_at(time_s)) / np.diff(time_s)
    around = SpeedTrack(time_s=middle, speed_hz=speed, resolution_hz=float("nan"))
    block_s = min(_JUDGED_TURNS / float(speed.mean()), 0.25 * heard.last_s)
    comb = machine_comb(heard.train)
    scan = scan_speed(*_ear(heard), comb, heard.nominal_hz, _JUDGED_REACH, block_s, around=around)
    centre_hz = float(np.mean(scan.middle_hz))
    return Tracking(
        track=track,
        nominal_hz=heard.nominal_hz,
        scan=scan,
        evidence=_evidence(heard, scan, centre_hz, _JUDGED_REACH),
    )


def _evidence(
    heard: _Heard, scan: SpeedScan, centre_hz: float, tolerance: float
) -> tuple[MeshEvidence, ...]:
    orders = [shaft.order for shaft in heard.train.shafts]
    return mesh_evidence(scan, mesh_combs(heard.train), orders, centre_hz, tolerance)


def _spacing_agrees(heard: _Heard, judged: Tracking) -> bool:
    """Whether the sidebands agree with a followed speed; they must show if it is far off.

    A mesh of one tooth more stands at the same lines if the shaft turns a little slower: only the
    spacing of its sidebands tells.
    """
    speeds = judged.track.speed_hz
    nominal = heard.nominal_hz
    low, high = (1 - SPEED_TOLERANCE) * speeds.min(), (1 + SPEED_TOLERANCE) * speeds.max()
    quality = order_quality(*_ear(heard), judged.track, max(1, heard.samples.shape[-1] >> 18))
    supported = False
    combs = mesh_combs(heard.train)
    for mesh, comb, seen in zip(heard.train.meshes, combs, judged.evidence, strict=True):
        if not seen.stands_out or mesh.carrier != 0:
            continue
        excess, support = 0.0, 0.0
        for spacing in comb.spacings:
            others = [other for other in comb.spacings if other != spacing]
            excess = max(excess, spacing_mismatch(*quality, comb, spacing, _REACH, others)[0])
            support = max(support, spacing_support(*quality, comb, spacing, _REACH, others))
        clear = support >= _SUPPORTED
        # right sidebands of one gear fix the speed: what beats those of the other is some line else
        if not (clear and support > excess) and excess > 0 and seen.score - excess < _CONTRADICTED:
            return False
        supported = supported or clear
    return supported or bool(low <= nominal <= high)


def _with_doubt(heard: _Heard, tracking: Tracking, share: float) -> Tracking:
    """Say so if the lines do not stand still in the angle that was found."""
    if share >= _LOST:
        return tracking
    order = max(mesh.order for mesh in heard.train.meshes)
    cycles = np.sqrt(-np.log(max(share, 1e-3))) / (2 * np.pi)
    known = tracking.track.uncertainty_turns
    doubt = max(cycles / order, known if np.isfinite(known) else 0.0)
    note = (
        f"the angle is doubtful: only {share:.0%} of the power of the mesh lines stands still in "
        "it; record with a tachometer"
    )
    return replace(
        tracking,
        track=replace(tracking.track, uncertainty_turns=float(doubt)),
        notes=(*tracking.notes, note),
    )


def _wander(track: AngleTrack) -> float:
    """Relative standard deviation of the speed over half seconds."""
    halves = np.arange(track.time_s[0], track.time_s[-1], 0.5)
    if len(halves) < 3:
        return 0.0
    turns = np.diff(track.turns_at(halves))
    return float(np.std(turns) / np.mean(turns))


def _departs(track: AngleTrack, nominal_hz: float) -> bool:
    """Whether a track leaves the speeds that the scan about nominal hears well."""
    mean = (track.turns[-1] - track.turns[0]) / (track.time_s[-1] - track.time_s[0])
    return abs(mean / nominal_hz - 1) > SPEED_TOLERANCE or _wander(track) > 0.005


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
