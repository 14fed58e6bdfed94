"""Speed and angle of shaft 1 in a recording: from a tachometer and the mesh lines, or tacholess.

Without a tachometer the steady comb is tried first, within 3 % of a nominal speed. Where its lines
are not phase-coherent in the angle that it gives, or no mesh shows at it, the speed is looked for
in short blocks and far about the nominal one, and kept only if the mesh stands out better at the
speeds so found. On the way it is told how clearly every mesh stands out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache, cached_property, partial

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.errors import ArgumentError, RecordingError
from gearmon.gears.kinematics import Kinematics, kinematics
from gearmon.machine import Machine
from gearmon.result import Result
from gearmon.signals.angle import AngleTrack
from gearmon.signals.orders.lines import OrderSums
from gearmon.signals.orders.resampling import InAngle
from gearmon.signals.orders.spectra import fine_order_spectrum
from gearmon.signals.recording import Recording
from gearmon.signals.threads import at_once
from gearmon.signals.tracking import mesh_detection, phases, tacho
from gearmon.signals.tracking.comb import Comb, SpeedScan, clearest
from gearmon.signals.tracking.mesh_detection import MeshComb, MeshEvidence
from gearmon.signatures.measured.line_plan import MESH_HARMONICS, group_orders, mesh_harmonics

SPEED_TOLERANCE = 0.03
#: How far it is looked for when it is not found so near to nominal.
SPEED_REACH = 0.25
# Blocks of the first scan [turns]: they tell the sidebands of shaft 1 from the mesh lines. High
# harmonics of a slow mesh are smeared in long blocks by a speed that drifts; short ones still tell
# them from sidebands of shaft 1.
_SCAN_TURNS, _SLOW_MESH_TURNS = 30.0, 8.0
# Those in which a speed is followed that may change.
_PATH_TURNS = 8.0
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
# How far pulses and comb may be apart before it is asked which of them is right.
_APART = 0.01
# Mean speeds over the nominal one at which pulses are counted by the mesh, and the most a turn.
_SPEEDS, _TRIED = (0.3, 1.3), 8
# Share of the harmonics that must be clear for a count to be believed, and from which at the
# nominal speed no other is asked. Of 14 lumped models of machines, 1 to 6 pulses a turn, steady at
# 0.45 to 1.2 of that speed and run up and down between 0.3 and 1.1 (504 recordings), all are
# counted right.
_SHOWN, _PLAIN = 0.25, 0.75
# Share of the mesh lines' power that must be phase-coherent, of a speed that wanders and of a calm
# one, for no other speed to be looked for.
_COHERENT, _NEARLY = 0.82, 0.6
# Below this share the angle of a mesh line is not known to a tenth of its period.
_LOST = 0.5
# A path through noise gathers lines, too, which are not coherent in its angle: this share of them
# has to be. Of 40 recordings of noise it is 0.00, of gears whose speed wanders fast 0.74 and more,
# 0.38 where the angle slips.
_GATHERED = 0.2
# Share of a path that may lie where the search ends. Of 5 drawn machines at 0.8 of their nominal
# speed, wandering by 0.5 %, a third and more does: it was off by 0.3 to 1.2 % in the mean.
_AT_THE_END = 0.1
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
# The same if fewer meshes stand out there, or the speed is another within reach of the first scan,
# so far beside it at least: of a drawn machine (39/82, 28/30 teeth) 40 % of a tooth put the speed
# off by 2.1 %, where 0.59 of the lines are coherent instead of 0.98.
_FAR_BETTER, _BESIDE = 0.2, 0.005
# Turns that are looked at for a speed elsewhere, and how far off it counts.
_LOOK_TURNS = 60.0
_ELSEWHERE = 0.01
# Lines at which something turns or passes.
_TURNING = ("shaft", "rotation", "local fault", "planet pass")
# Sidebands that contradict or support a followed speed, in robust standard deviations.
_CONTRADICTED = 6.0
_SUPPORTED = 3.0


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
    turning = {line.order for line in train.lines if line.kind in _TURNING}
    found = []
    for mesh in train.meshes:
        harmonics = range(1, mesh_harmonics(mesh.order * shaft1_hz) + 1)
        wheels = tuple(wheel.relative_order for wheel in mesh.wheels)
        found.append(
            MeshComb(
                order=mesh.order,
                groups=tuple(tuple(map(float, group_orders(mesh, k))) for k in harmonics),
                # what sets sidebands apart: both shafts, or the carrier of a planetary set
                spacings=(abs(float(mesh.carrier)),) if mesh.carrier else wheels,
                turning=tuple(sorted(turning)),
                meshing=tuple(sorted({own.order for own in train.meshes} - {mesh.order})),
            )
        )
    return tuple(found)


def machine_comb(train: Kinematics, shaft1_hz: float) -> Comb:
    """Return the lines of a drive train that its speed is known by: meshes, sidebands, shafts."""
    shafts = [shaft.order for shaft in train.shafts]
    return mesh_detection.combined_comb(mesh_combs(train, shaft1_hz), shafts)


@dataclass(frozen=True, kw_only=True, eq=False)
class GearVibration:
    """Vibration of a gearbox, and the lines that its speed and angle are known by.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        Vibration.
    rate : float
        Sampling rate [Hz].
    machine : Machine
    nominal_hz : float
        Speed that is meant, of the shaft that turns are counted of [Hz].
    pace : Fraction
        Turns of that shaft a turn of shaft 1. The angle is sought in turns of the fastest shaft:
        blocks of some turns of a slow input would smear the lines of all behind it.
    far : bool
        Whether a mesh that healthy recordings show is looked for far about that speed, too.
    """

    samples: FloatArray
    rate: float
    machine: Machine
    nominal_hz: float
    pace: Fraction = Fraction(1)
    far: bool = False

    @cached_property
    def train(self) -> Kinematics:
        """Orders of the machine, in turns of that shaft."""
        return kinematics(self.machine, self.pace)

    @property
    def shaft1_hz(self) -> float:
        """Speed of shaft 1 that is meant [Hz]."""
        return self.nominal_hz / float(self.pace)

    @property
    def last_s(self) -> float:
        """Time of the last sample [s]."""
        return float((self.samples.shape[-1] - 1) / self.rate)

    @cached_property
    def comb(self) -> Comb:
        """Lines that the speed is known by: meshes, sidebands, shafts."""
        return machine_comb(self.train, self.nominal_hz)

    @cached_property
    def meshes(self) -> tuple[MeshComb, ...]:
        """Its meshes, one comb a stage."""
        return mesh_combs(self.train, self.nominal_hz)

    def meant(
        self, scanned: Callable[[GearVibration], SpeedScan]
    ) -> tuple[GearVibration, SpeedScan]:
        """Return it at that nominal speed of the machine whose own lines are clearest in a scan."""
        pace = float(self.pace)
        speeds = sorted({pace * point.shaft1_hz for point in self.machine.operating})
        every = [replace(self, nominal_hz=own) for own in speeds]
        scans = [scanned(own) for own in every]
        chosen = clearest([(scan, own.comb) for scan, own in zip(scans, every, strict=True)])
        return every[chosen], scans[chosen]

    def scan(
        self, turns: float, tolerance: float = SPEED_TOLERANCE, about_hz: float | None = None
    ) -> SpeedScan:
        """Scan in blocks of so many turns about the nominal speed, or another one.

        Of a short recording all is one block.
        """
        whole, block_s = self.samples.shape[-1] / self.rate, turns / self.nominal_hz
        block_s = block_s if whole >= 4 * block_s else whole
        about = about_hz or self.nominal_hz
        return SpeedScan(self.samples, self.rate, self.comb, about, tolerance, block_s)

    def path(self) -> SpeedScan:
        """Follow the comb in short blocks far about the nominal speed."""
        looked_for = self.comb, self.nominal_hz, SPEED_REACH, _PATH_TURNS / self.nominal_hz
        return SpeedScan(self.samples, self.rate, *looked_for, changing=True)

    def sums(self, fastest_hz: float) -> OrderSums | None:
        """Mesh harmonics whose phases are followed up to a speed; None if the band has none."""
        found: set[float] = set()
        for mesh, comb in zip(self.train.meshes, self.meshes, strict=True):
            for k, group in enumerate(comb.groups, start=1):
                if len(comb.groups) <= MESH_HARMONICS:
                    found.update(group if k <= _HARMONICS else ())
                    continue
                # of so many only those that the phases of planets allow, nearest to the harmonic
                away = float(max(mesh.planets, 1) * abs(mesh.carrier)) or np.inf
                allowed = mesh.healthy_orders(k, 1)
                found.update(own for own in allowed if abs(own - k * mesh.order) < 0.999 * away)
        orders = sorted(order for order in found if order < 0.45 * self.rate / fastest_hz)
        return OrderSums(self.samples, self.rate, np.array(orders)) if orders else None

    def in_angle(self, track: AngleTrack) -> InAngle:
        """Return the vibration in the angle of a track."""
        return InAngle.of(self.samples, self.rate, track)

    @cached_property
    def first(self) -> Tracking:
        """The comb about the nominal speed, in blocks that tell meshes from sidebands."""
        looked_at = max(len(comb.groups) for comb in self.meshes)
        scan = self.scan(_SLOW_MESH_TURNS if looked_at > MESH_HARMONICS else _SCAN_TURNS)
        return self.judged(phases.integrate_speed(scan.track(), self.last_s), scan)

    @cached_property
    def alone(self) -> Tracking:
        """The angle by comb and phases, without a tachometer, beginning with the steady comb."""
        first, sums = self.first, self.sums(self.nominal_hz * (1 + SPEED_TOLERANCE))
        if sums is None:
            return replace(first, notes=("no mesh harmonic lies below the Nyquist frequency",))
        track, share = phases.follow_lines(sums, first.track, self.comb)
        found = replace(first, track=track, coherent=share)
        calm = share > (_NEARLY if wander(track) < _WANDERS else _COHERENT)
        if not calm:
            # a broken tooth fills the orders of its gear, and the comb suits two speeds alike
            course = phases.integrate_speed(first.scan.elsewhere(_BESIDE), self.last_s)
            other, its = phases.follow_lines(sums, course, self.comb)
            if its > share + _FAR_BETTER:
                judged = replace(self.judged(other), coherent=its)
                if judged.detected >= found.detected:
                    found, track, share, calm = judged, other, its, True
        if not calm or self.far or _elsewhere(first):
            followed = _followed(self)
            if followed is not None:
                # it must show more meshes, or lines far more coherent
                more = followed[0].detected - found.detected
                least = share + (_BETTER if more == 0 else _FAR_BETTER)
                if self.far or more > 0 or followed[0].coherent > least:
                    return _with_doubt(*followed)
        if share > _COHERENT and first.detected < len(first.evidence) and wander(track) > _WANDERS:
            # a speed that wanders smears lines in long blocks
            judged = replace(self.judged(track), coherent=share)
            if judged.detected > first.detected and _agrees(judged):
                found = judged
        return _with_doubt(found, sums) if found.detected else found

    def by_pulses(self, pulses: tacho.TachoPulses, count: int, order: float = 1.0) -> Tracking:
        """Judge the meshes at the speed of so many pulses a turn of a shaft of this order."""
        told = tacho.track_from_pulses(pulses, count, order, self.last_s)
        told = replace(told.of_shaft(float(self.pace)), indexed=told.indexed)
        return self.judged(told, reach=TACHO_REACH)

    def judged(
        self, track: AngleTrack, scan: SpeedScan | None = None, reach: float = _JUDGED_REACH
    ) -> Tracking:
        """Tell how clearly each mesh stands out beside a track.

        By default in a scan in its angle, so far about its speed as a fraction.
        """
        if scan is None:
            vibration = InAngle.of(self.samples, self.rate, track)
            block = min(_JUDGED_TURNS, 0.25 * float(track.turns[-1] - track.turns[0]))
            scan = phases.scan_angle(vibration, self.comb, reach, block)
        orders = [shaft.order for shaft in self.train.shafts]
        judged = partial(mesh_detection.mesh_evidence, scan, self.meshes, orders)
        # the path through all blocks, which is wanted next, is found meanwhile
        evidence, _ = at_once(judged, lambda: scan.best_score, scan.scores.size)
        return Tracking(signal=self, track=track, scan=scan, evidence=evidence)


@dataclass(frozen=True, kw_only=True)
class Tracking:
    """The angle of shaft 1, and what was found on the way.

    Parameters
    ----------
    signal : GearVibration
        The recording, with the nominal speed that is meant.
    track : AngleTrack
        Angle of shaft 1; in turns of the shaft that the signal counts while it is sought.
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

    signal: GearVibration
    track: AngleTrack
    scan: SpeedScan
    evidence: tuple[MeshEvidence, ...]
    notes: tuple[str, ...] = ()
    held_s: tuple[float, float] | None = None
    lost: bool = False
    coherent: float = 0.0

    def by_shaft1(self) -> Tracking:
        """Return the same with its angle in turns of shaft 1.

        In long blocks of a known angle slow meshes stand out that were smeared while it was sought.
        """
        signal, pace = self.signal, self.signal.pace
        if pace == 1:
            return self
        signal = replace(signal, nominal_hz=signal.shaft1_hz, pace=Fraction(1))
        # of the fastest shaft's angle the zero is known as that of shaft 1 is
        track = replace(self.track.of_shaft(1.0 / float(pace)), indexed=self.track.indexed)
        found = replace(self, signal=signal, track=track)
        if self.detected in (0, len(self.evidence)):
            return found
        every = zip(self.evidence, signal.judged(found.track).evidence, strict=True)
        clearer = [max(own, key=lambda seen: seen.score) for own in every]
        return replace(found, evidence=tuple(clearer))

    @property
    def plan_hz(self) -> float:
        """Speed for which orders are planned [Hz]: nominal, unless they would leave the band."""
        highest, nominal_hz = float(self.track.speed_hz.max()), self.signal.nominal_hz
        return nominal_hz if highest < 1.06 * nominal_hz else highest

    def speed(self) -> Speed:
        """Sum it up as a speed with its uncertainty."""
        track, signal = self.track, self.signal
        # both ends of the track are uncertain
        doubt = float(np.sqrt(2) * track.uncertainty_turns)
        if track.method == "tacho":
            # beyond the first and the last pulse the speed changes as between the others: c a step
            # comes to c (g + g^2)/2 steps over g of them
            steps, speeds = np.diff(track.turns), track.speed_hz[1:-1]
            usual = float(np.median(steps))
            ends = steps[[0, -1]] / usual
            change = float(np.std(np.diff(np.log(speeds))))
            doubt = float(np.hypot(doubt, 0.5 * usual * change * np.linalg.norm(ends + ends**2)))
        uncertainty = doubt * signal.rate / signal.samples.shape[-1]
        if not np.isfinite(uncertainty):
            relative = self.scan.resolution_hz / self.scan.nominal_hz
            uncertainty = 0.5 * relative * track.mean_hz
        # where lines stand in one spectrum of the whole recording: at the mean if a tachometer
        # tells it, and where they have no one place
        peak_hz, told = track.mean_hz, track.method == "tacho" or wander(track) > _PEAK_TOLERANCE
        if not told and signal.samples.shape[-1] <= _PEAK_SAMPLES:
            peak_hz = signal.scan(np.inf, _PEAK_TOLERANCE, about_hz=peak_hz).track().mean_hz
        return Speed(
            nominal_hz=signal.nominal_hz,
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
    def clear_share(self) -> float:
        """Share of the harmonics of all meshes that is clear; 0 where no mesh stands out."""
        visible = sum(seen.visible for seen in self.evidence)
        return sum(seen.clear for seen in self.evidence) / visible if self.detected else 0.0

    def finer(self, slower: Sequence[float]) -> bool:
        """Whether lines between those of a mesh are as clear: they are another speed's.

        `slower` holds the speeds that may be, over this one.
        """
        if not slower:
            return False
        spectrum = fine_order_spectrum(self.signal.in_angle(self.track))
        return any(
            own.stands_out and mesh_detection.foreign_spacing(spectrum, comb, parts=slower)
            for comb, own in zip(self.signal.meshes, self.evidence, strict=True)
        )

    @property
    def clarity(self) -> tuple[int, int]:
        """How many meshes stand out, and how many of their harmonics are clear."""
        return self.detected, sum(seen.clear for seen in self.evidence if seen.stands_out)

    def is_near(self, other: Tracking) -> bool:
        """Whether another one tells the same speed."""
        return abs(self.track.mean_hz / other.track.mean_hz - 1) <= _APART


def track_recording(recording: Recording, machine: Machine, far: bool = False) -> Tracking:
    """Find the angle of shaft 1: from a tachometer if there is one, else from comb and phases.

    The pulses of a tachometer tell the turn, the phases of the mesh lines the angle between them
    (`gearmon.signals.tracking`). A channel that only its name makes a tachometer is left alone
    where it is none.

    Parameters
    ----------
    recording : Recording
        Vibration, and perhaps a tacho channel.
    machine : Machine
        Nominal speeds, of which that is meant whose own lines are clearest; its sensors tell what
        the tachometer sits on.
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
        if kind != "tacho":
            continue
        try:
            return _with_tacho(recording, index, signal).by_shaft1()
        except (ArgumentError, RecordingError) as error:
            if recording.tacho_told:
                raise
            why = str(error).removeprefix("tacho channel: ").split(". ")[0]
            notes.append(
                f"{recording.channel_names[index]} is no usable tachometer, though its name "
                f"suggests one: {why}; the vibration alone tells the angle"
            )
    alone = signal.alone.by_shaft1()
    return replace(alone, notes=(*notes, *alone.notes))


def _with_tacho(recording: Recording, index: int, signal: GearVibration) -> Tracking:
    """Track by the pulses of one channel and the lines between them."""
    name = recording.channel_names[index]
    places = name, str(recording.columns[index])
    sensors = (s for s in signal.machine.sensors if s.kind == "tacho")
    sensor = next((s for s in sensors if str(s.column) in places), None)
    known = sensor.pulses_per_turn if sensor else None
    pulses = tacho.find_pulses(recording.samples[index], recording.sampling_rate_hz, known)
    if sensor:
        count = sensor.pulses_per_turn
        found = signal.by_pulses(
            pulses, count, kinematics(signal.machine).shaft(sensor.shaft).order
        )
    else:
        count, found = _pulses_counted(pulses, signal)
    if not recording.tacho_told:
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
    told = [f"{count} pulse{'s' if count > 1 else ''} a turn"]
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


def _elsewhere(first: Tracking) -> bool:
    """Whether the comb may stand at another speed: no mesh shows, or one does but a look says so.

    The look is at some turns from the middle of the recording, far about the nominal speed.
    """
    signal = first.signal
    if first.detected in (0, len(first.evidence)):
        return first.detected == 0
    length = round(_LOOK_TURNS / signal.nominal_hz * signal.rate)
    begin = max(0, (signal.samples.shape[-1] - length) // 2)
    speed = replace(signal, samples=signal.samples[:, begin : begin + length]).path().track()
    known = first.scan.track().at(begin / signal.rate + speed.time_s)
    return bool(np.median(np.abs(speed.speed_hz / known - 1)) > _ELSEWHERE)


def _followed(signal: GearVibration) -> tuple[Tracking, OrderSums] | None:
    """Look for the comb in short blocks far about nominal; None if no mesh stands out there."""
    signal, path = signal.meant(GearVibration.path)
    speed = path.track()
    course = speed.speed_hz
    sums = signal.sums(float(course.max()))
    ends = path.nominal_hz * path.ratio[[1, -2]]
    # beyond what is looked at the speed is not known
    if sums is None or np.mean((course <= ends[0]) | (course >= ends[1])) > _AT_THE_END:
        return None
    track = phases.integrate_speed(speed, signal.last_s)
    for reach in _PATH_REACHES:
        track = phases.unwarp(sums, track, signal.comb, reach)
    track, share = phases.lock_track(sums, track)
    judged = replace(signal.judged(track), coherent=share)
    if share < _GATHERED or not _agrees(judged):
        return None
    course = course / float(signal.pace)
    note = (
        f"the speed was followed over the recording, from {course[0]:.4g} to {course[-1]:.4g} Hz "
        f"between {course.min():.4g} and {course.max():.4g} Hz; nominal is {signal.shaft1_hz:.4g} "
        "Hz"
    )
    return replace(judged, notes=(note,)), sums


def _agrees(judged: Tracking) -> bool:
    """Whether meshes are clear and sidebands agree with a speed; they must show if it is far off.

    A mesh of one tooth more stands at the same lines if the shaft turns a little slower: only the
    spacing of its sidebands tells. Of a machine whose mesh is known coherent lines are enough.
    """
    if judged.clarity[1] < 2:
        return False
    signal, speeds = judged.signal, judged.track.speed_hz
    low, high = (1 - SPEED_TOLERANCE) * speeds.min(), (1 + SPEED_TOLERANCE) * speeds.max()
    pieces = max(1, signal.samples.shape[-1] >> 18)
    spectrum = fine_order_spectrum(signal.in_angle(judged.track), pieces)
    known, supported = signal.far and judged.coherent > _COHERENT, False
    for mesh, comb, seen in zip(signal.train.meshes, signal.meshes, judged.evidence, strict=True):
        if not seen.stands_out or mesh.carrier != 0:
            continue
        told = [
            mesh_detection.sideband_spacing(spectrum, comb, own, SPEED_REACH)
            for own in comb.spacings
        ]
        excess, support = max(one.excess for one in told), max(one.support for one in told)
        clear = support >= _SUPPORTED
        # right sidebands of one gear fix the speed: what beats those of the other is some line else
        least = 0.0 if known else _CONTRADICTED
        if not (clear and support > excess) and excess > 0 and seen.score - excess < least:
            return False
        supported = supported or clear
    return supported or known or bool(low <= signal.nominal_hz <= high)


def _with_doubt(found: Tracking, sums: OrderSums) -> Tracking:
    """State how far the angle may be off, and say so if the lines do not hold it."""
    track, share = found.track, found.coherent
    if track.turns[-1] - track.turns[0] < phases.LEAST_TURNS:
        return replace(found, coherent=0.0)
    check = phases.check_slips(sums, track)
    if share >= _LOST and not check.locked:
        track, check = phases.mend_slips(sums, track, check, found.signal.comb)
    doubt, notes, held_s = check.typical_turns(), found.notes, None
    lost = share < _LOST and not check.held_throughout
    if lost:
        order = max(mesh.order for mesh in found.signal.train.meshes)
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
            notes += (
                f"only {start:.4g} to {stop:.4g} s are looked at: beyond, the mesh lines do not "
                "hold the angle, which may have slipped by whole mesh periods",
            )
        else:
            away = [stretch for stretch in check.lost if not stretch.harmless]
            where = ", ".join(f"{one.start_s:.4g} to {one.end_s:.4g} s" for one in away[:_NAMED])
            more = f" and {len(away) - _NAMED} times more" if len(away) > _NAMED else ""
            notes += (
                f"the angle is doubtful: the mesh lines do not hold it from {where}{more}, where "
                "it may have slipped by whole mesh periods; leave these parts out, or record with "
                "a tachometer",
            )
    track = replace(track, uncertainty_turns=float(doubt))
    return replace(found, track=track, notes=notes, held_s=held_s, lost=lost)


def wander(track: AngleTrack) -> float:
    """Return the relative standard deviation of the speed over half seconds; 0 if too short."""
    halves = np.arange(track.time_s[0], track.time_s[-1], 0.5)
    if len(halves) < 3:
        return 0.0
    turns = np.diff(track.turns_at(halves))
    return float(np.std(turns) / np.mean(turns))
