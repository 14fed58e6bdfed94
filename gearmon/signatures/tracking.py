"""Speed and angle of a shaft by the lines of its meshes, and how clearly every mesh stands out.

The steady comb is tried first, within 3 % of a nominal speed. Where its lines are not
phase-coherent in the angle that it gives, or no mesh shows at it, the speed is looked for in short
blocks and far about the nominal one, and kept only if the mesh stands out better at the speeds so
found. Where a channel tells the course of the speed they are looked for about that, whose lag and
scale the lines tell. What else a recording holds: `gearmon.signatures.speed_channels`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property, partial

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.gears.kinematics import Kinematics, kinematics
from gearmon.machine import Machine
from gearmon.result import Result
from gearmon.signals.angle import AngleTrack
from gearmon.signals.orders.lines import OrderSums
from gearmon.signals.orders.resampling import InAngle
from gearmon.signals.orders.spectra import fine_order_spectrum
from gearmon.signals.tracking import mesh_detection, phases, tacho
from gearmon.signals.tracking.comb import Comb, SpeedScan, SpeedTrack, clearest
from gearmon.signals.tracking.mesh_detection import MeshComb, MeshEvidence
from gearmon.signatures.measured.line_plan import MESH_HARMONICS, group_orders, mesh_harmonics
from gearmon.threads import at_once

SPEED_TOLERANCE = 0.03
#: How far it is looked for when it is not found so near to nominal.
SPEED_REACH = 0.25
# Blocks of the first scan [turns]: they tell the sidebands of shaft 1 from the mesh lines. High
# harmonics of a slow mesh are smeared in long blocks by a speed that drifts; short ones still tell
# them from sidebands of shaft 1.
_SCAN_TURNS, _SLOW_MESH_TURNS = 30.0, 8.0
# Those in which a speed is followed that may change.
_PATH_TURNS = 8.0
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
# Share of the mesh lines' power that must be phase-coherent, of a speed that wanders and of a calm
# one, for no other speed to be looked for.
COHERENT, _NEARLY = 0.82, 0.6
# Below this share the angle of a mesh line is not known to a tenth of its period.
_LOST = 0.5
# A path through noise gathers lines, too, which are not coherent in its angle: this share of them
# has to be. Of 40 recordings of noise it is 0.00, of gears whose speed wanders fast 0.74 and more,
# 0.38 where the angle slips.
_GATHERED = 0.2
# Share of a path that may lie where the search ends. Of 5 drawn machines at 0.8 of their nominal
# speed, wandering by 0.5 %, a third and more does: it was off by 0.3 to 1.2 % in the mean.
_AT_THE_END = 0.1
# How far about a path of speeds the comb is looked for in its angle, and then again. About a course
# that a channel tells: for its lag and scale, and, in blocks of so many turns, when these are
# known. Seven lumped machines over cycles of 0.35 to 1.05 of their speed, a channel that rounds to
# 1 rpm, lags by 60 ms, scatters by 2 rpm and is off by 0.3 %: a lag of 62 ms is told; where a
# second search was made in blocks of 10 turns the angle slipped by a mesh period where a ramp
# begins. In 278 of 279 recordings of eleven such machines it is right to 0.3 mesh periods (95 % of
# the time within the part that the lines hold), in the other to 0.43.
_PATH_SEARCHES, _TOLD_SEARCHES = ((0.015, None), (0.008, None)), ((0.015, 5.0),)
_LAG_REACHES = 0.12, 0.03
# Wander of the speed from which the ends of a recording need care, relative standard deviation.
_WANDERS = 1e-3
# Share of a recording in which the angle must be held for the rest to be left out: without and with
# a channel that tells the speed, by which lines too faint at low speeds are found again.
_HELD = 0.5, 0.2
# Stretches in which the angle may have slipped that a note names.
_NAMED = 3
# How much more of the lines must be phase-coherent before another speed within reach of the
# first scan is believed, so far beside it at least: of a drawn machine (39/82, 28/30 teeth) 40 %
# of a tooth put the speed off by 2.1 %, where 0.59 of the lines are coherent instead of 0.98.
_FAR_BETTER, _BESIDE = 0.2, 0.005
# Turns looked at for a speed elsewhere, and how far off it counts. Of 195 recordings of the
# catalogue's and 16 drawn machines at 0.78 to 1.22 of their speed, wandering by up to 2 %, 152 had
# the right angle when this was 60 turns in short blocks, by which alone a speed far off was found,
# 7 a wrong one; of 185 tried again 179 have since, 1 a wrong one.
_LOOK_TURNS = 120.0
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
    told : bool, optional
        Whether a channel of the recording tells the course of that shaft's speed.
    """

    samples: FloatArray
    rate: float
    machine: Machine
    nominal_hz: float
    pace: Fraction = Fraction(1)
    far: bool = False
    told: bool = False

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

    def far_scan(self) -> SpeedScan:
        """Scan far about the nominal speed, in blocks that tell meshes from sidebands."""
        return self.scan(_SCAN_TURNS, SPEED_REACH)

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
        track, share = phases.follow_lines(sums, first.track)
        found = replace(first, track=track, coherent=share)
        calm = share > (_NEARLY if track.wander < _WANDERS else COHERENT)
        if not calm:
            # a broken tooth fills the orders of its gear, and the comb suits two speeds alike
            course = phases.integrate_speed(first.scan.elsewhere(_BESIDE), self.last_s)
            other, its = phases.follow_lines(sums, course)
            if its > share + _FAR_BETTER:
                judged = replace(self.judged(other), coherent=its)
                if judged.detected >= found.detected:
                    found, track, share, calm = judged, other, its, its > COHERENT
        if share > COHERENT and first.detected < len(first.evidence) and track.wander > _WANDERS:
            # a speed that wanders smears lines in long blocks
            judged = replace(self.judged(track), coherent=share)
            if judged.detected > first.detected and _agrees(judged):
                found = judged
        found = _with_doubt(found, sums) if found.detected else found
        if not calm or self.far or found.notes or _elsewhere(first):
            followed = _followed(self)
            # about one speed blocks of another length judge other harmonics
            if followed and followed.is_near(found) and followed.detected != found.detected:
                return max(followed, found, key=lambda own: own.detected)
            if followed and (self.far or followed.shown > found.shown):
                return followed
        return found

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
        peak_hz, told = track.mean_hz, track.method == "tacho" or track.wander > _PEAK_TOLERANCE
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
        """Share of the harmonics of a mesh that is clear, in the mean; 0 where none stands out."""
        told = [seen.clear / seen.visible for seen in self.evidence if seen.visible]
        return float(np.mean(told)) if self.detected else 0.0

    @property
    def shown(self) -> float:
        """Share of the lines that could be seen that is clear, stands still and is held."""
        start, stop = self.held_s or (0.0, self.signal.last_s)
        return self.clear_share * self.coherent * (stop - start) / self.signal.last_s

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


def follow_told(signal: GearVibration, told: SpeedTrack) -> Tracking | None:
    """Find the angle about the course of speed that a channel tells; None if no mesh is there."""
    signal = replace(signal, told=True)
    return _locked(signal, _without_lag(signal, told), _TOLD_SEARCHES)


def _elsewhere(first: Tracking) -> bool:
    """Whether the comb may stand at another speed: no mesh shows, or one does but a look says so.

    The look is at some turns from the middle of the recording, far about the nominal speed.
    """
    signal = first.signal
    if first.detected in (0, len(first.evidence)):
        return first.detected == 0
    length = round(_LOOK_TURNS / signal.nominal_hz * signal.rate)
    begin = max(0, (signal.samples.shape[-1] - length) // 2)
    speed = replace(signal, samples=signal.samples[:, begin : begin + length]).far_scan().track()
    known = first.scan.track().at(begin / signal.rate + speed.time_s)
    return bool(np.median(np.abs(speed.speed_hz / known - 1)) > _ELSEWHERE)


def _followed(signal: GearVibration) -> Tracking | None:
    """Look for the comb far about nominal, as if the speed were steady and as if it changed.

    None if no mesh stands out there.
    """
    found: list[Tracking] = []
    # long blocks show the turns of a shaft without gears so sharply that a single mesh may suit
    ways = (GearVibration.far_scan, GearVibration.path)
    for way in ways if len(signal.meshes) > 1 else ways[1:]:
        meant, scan = signal.meant(way)
        speed, ends = scan.track(), scan.nominal_hz * scan.ratio[[1, -2]]
        # beyond what is looked at the speed is not known
        if np.mean((speed.speed_hz <= ends[0]) | (speed.speed_hz >= ends[1])) <= _AT_THE_END:
            one = _locked(meant, speed, _PATH_SEARCHES)
            least = COHERENT if way == GearVibration.far_scan else _GATHERED
            found += [one] if one and one.coherent >= least else []
        if found and found[0].coherent > phases.ALL_COHERENT:
            break
    return max(found, key=lambda one: one.shown, default=None)


def _locked(
    signal: GearVibration, speed: SpeedTrack, searches: Sequence[tuple[float, float | None]]
) -> Tracking | None:
    """Lock the angle to the lines about a course of speed; None if no mesh agrees with it."""
    sums = signal.sums(float(speed.speed_hz.max()))
    if sums is None:
        return None
    track = phases.integrate_speed(speed, signal.last_s)
    for reach, turns in searches:
        track = phases.unwarp(sums, track, signal.comb, reach, turns)
    track, share = phases.follow_lines(sums, track)
    judged = replace(signal.judged(track), coherent=share)
    if not _agrees(judged):
        return None
    course = speed.speed_hz / float(signal.pace)
    note = (
        f"the speed was followed over the recording, from {course[0]:.4g} to {course[-1]:.4g} Hz "
        f"between {course.min():.4g} and {course.max():.4g} Hz; nominal is {signal.shaft1_hz:.4g} "
        "Hz"
    )
    return _with_doubt(replace(judged, notes=(note,)), sums)


def _without_lag(signal: GearVibration, course: SpeedTrack) -> SpeedTrack:
    """Take from a course that is told what its channel lags behind, and what its scale is off.

    With the lag tau and the scale a, ln(true / told) = ln a + tau d(ln told)/dt to first order.
    """
    edges_s = np.linspace(0.0, signal.last_s, max(4, round(signal.last_s * signal.nominal_hz / 8)))
    middle_s = 0.5 * (edges_s[1:] + edges_s[:-1])
    for reach in _LAG_REACHES:
        told = phases.integrate_speed(course, signal.last_s)
        sums = signal.sums(float(course.speed_hz.max()))
        if sums is None:
            break
        true = phases.unwarp(sums, told, signal.comb, reach)
        known, found = (np.log(np.diff(own.turns_at(edges_s))) for own in (told, true))
        terms = np.stack([np.gradient(known, middle_s), np.ones(len(known))], axis=1)
        lag_s, scale = np.linalg.lstsq(terms, found - known)[0]
        lagged_s = course.time_s + lag_s
        course = SpeedTrack(time_s=course.time_s, speed_hz=np.exp(scale) * course.at(lagged_s))
    return course


def _agrees(judged: Tracking) -> bool:
    """Whether meshes are clear and sidebands agree with a speed; they must show if it is far off.

    A mesh of one tooth more stands at the same lines if the shaft turns a little slower: only the
    spacing of its sidebands tells. Where the mesh is known coherent lines are enough, and where a
    channel tells the speed clear ones.
    """
    if judged.clarity[1] < 2:
        return False
    signal, speeds = judged.signal, judged.track.speed_hz
    # a planetary set has lines every turn of its carrier, which pass for sidebands of any spacing
    every = judged.detected == len(judged.evidence) and judged.coherent > COHERENT
    if every and any(mesh.carrier for mesh in signal.train.meshes):
        return True
    low, high = (1 - SPEED_TOLERANCE) * speeds.min(), (1 + SPEED_TOLERANCE) * speeds.max()
    pieces = max(1, signal.samples.shape[-1] >> 18)
    spectrum = fine_order_spectrum(signal.in_angle(judged.track), pieces)
    known, supported = signal.far and judged.coherent > COHERENT, False
    known |= signal.told
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
    # a channel tells the speed however the path turns the lines
    told = found.signal.told
    lost = share < _LOST and not check.held_throughout and not told
    if lost:
        order = max(mesh.order for mesh in found.signal.train.meshes)
        cycles = np.sqrt(-np.log(max(share, 1e-3))) / (2 * np.pi)
        doubt = max(cycles / order, doubt)
        notes += (
            f"the angle is doubtful: only {share:.0%} of the power of the mesh lines stands still "
            "in it; record with a tachometer, or the speed in a column",
        )
    elif not check.locked:
        start, stop = check.held(track)
        if stop - start >= _HELD[told] * (track.time_s[-1] - track.time_s[0]):
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
                "a tachometer, or the speed in a column",
            )
    track = replace(track, uncertainty_turns=float(doubt))
    return replace(found, track=track, notes=notes, held_s=held_s, lost=lost)
