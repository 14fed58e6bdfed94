"""Measured signatures: a recording reduced to the order lines of its machine."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearmon.arrays import FloatArray, median_along
from gearmon.errors import RecordingError
from gearmon.gears.kinematics import Kinematics, Mesh, kinematics
from gearmon.machine import Machine, MachineLike, load_machine
from gearmon.result import Result
from gearmon.signals.angle import AngleTrack
from gearmon.signals.bad_samples import inspected, sound_part, sound_piece
from gearmon.signals.orders.lines import OrderBlocks, OrderLines, without_knocks
from gearmon.signals.orders.resampling import InAngle
from gearmon.signals.orders.spectra import FineSpectrum, fine_order_spectrum
from gearmon.signals.recording import Recording, RecordingLike, read_recording
from gearmon.signals.spectra import window, window_powers
from gearmon.signals.tracking import mesh_detection
from gearmon.signals.tracking.mesh_detection import MeshComb, MeshEvidence, SidebandSpacing
from gearmon.signatures.measured.line_plan import LinePlan, line_plan
from gearmon.signatures.measured.nongear_lines import NonGearLines, nongear_lines
from gearmon.signatures.speed_channels import track_recording
from gearmon.signatures.tracking import SPEED_TOLERANCE, Speed, Tracking
from gearmon.threads import at_once

#: What a line may add elsewhere, relative to it: the angle is not known as well.
LEAKAGE = 1e-4
# Samples up to which all steps of angle are held: 16 MB.
_HELD_SAMPLES = 1 << 21
# Mesh periods over which phases hold an angle alone: a speed 1 % off that on both sides slips by a
# quarter of one.
_HELD_PERIODS = 25.0
# Bands of the broadband spectrum, a sixth of an octave each at most, samples of a segment, and
# segments at most: medians in time are then right to 0.4 dB a bin, those of bands better.
_BANDS, _BAND_SAMPLES, _BAND_SEGMENTS = 40, 2048, 256
# Height of a gear's own sidebands, in robust standard deviations, from which they count.
_SUPPORTED = 4.0
# Share of the power of mesh lines that stands still in the angle, from which they hold it. Of
# 12 simulated teeth that had lost 70 to 90 % it was 0.995 to 1.
_HELD = 0.9
# A mesh whose sidebands would rather stand elsewhere must be far clearer than others.
_FOUND_DESPITE_MISMATCH = 6.0
# Speed of shaft 1 up to which it is asked whether Hz were meant [1/min].
_SLOW_RPM = 100.0
# Fluctuation of the speed up to which knocks are looked for: of six sound machines and as many with
# a cracked tooth up to 13 % of the blocks seem knocked at 0 to 0.06 (once 22 %), 4 to 57 % at 0.12
# and 0.37, where half of the cracks were taken for knocks.
_STEADY = 0.05


@dataclass(frozen=True, kw_only=True)
class MeshFinding(Result):
    """What a recording shows of one mesh.

    Parameters
    ----------
    stage : int
        Stage, from 1.
    frequency_hz : float
        Where its line stands in a spectrum of the whole recording [Hz].
    found : bool
        Whether its lines stand out.
    snr_db : float or None
        Height of its clearest harmonic over the local noise floor [dB], best channel; None if no
        mesh at all was found.
    score : float
        Distance from the lines of other tooth counts, in standard deviations.
    reason : str
        Why it counts as found or not.
    held : bool
        Whether it is found, or its lines hold the angle of the gears, with sidebands at the
        rotation of one: a broken tooth fills all orders of its gear, and no mesh stands out of
        these.
    """

    stage: int
    frequency_hz: float
    found: bool
    snr_db: float | None
    score: float
    reason: str
    held: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordingLevels:
    """What of a recording is compared with others, as it was measured.

    Parameters
    ----------
    origin : str
        The recording.
    duration_s, sampling_rate_hz : float
        Of the recording.
    level_db : ndarray of float, shape (channels, families)
        Power of each family of the plan [dB re 1 unit^2, peak amplitudes].
    scatter_db : ndarray of float, shape (channels, families)
        Standard error of the level, from the scatter of the blocks [dB].
    heard : ndarray of bool, shape (channels, families)
        Whether the family stands above its own scatter.
    band_db : ndarray of float, shape (channels, bands)
        Levels of the broadband spectrum, see `broadband_levels` [dB re 1 unit^2/Hz].
    speed_fluctuation : float, >= 0
        Amplitude of a sine with the standard deviation of the speed, over the mean speed.
    foreign : NonGearLines
        Lines that no gear explains.
    digests : tuple of str
        Mark of the samples of each channel.
    """

    origin: str
    duration_s: float
    sampling_rate_hz: float
    level_db: FloatArray
    scatter_db: FloatArray
    heard: NDArray[np.bool_]
    band_db: FloatArray
    speed_fluctuation: float
    foreign: NonGearLines
    digests: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class MeasuredSignature(RecordingLevels, Result):
    """A recording reduced to order lines.

    Parameters
    ----------
    origin, duration_s, sampling_rate_hz, level_db, scatter_db, heard, band_db, speed_fluctuation, \
    foreign, digests
        As of `RecordingLevels`.
    channel_names : tuple of str
        Vibration channels.
    units : tuple of str or None
        Their units, None where not known.
    speed : Speed
        Rotation of shaft 1.
    meshes : tuple of MeshFinding
        One a stage.
    track : AngleTrack
        Angle of shaft 1 against time.
    plan : LinePlan
        Which line is what.
    lines : OrderLines
        Complex amplitudes, block by block.
    notes : tuple of str
        What the reader should know.
    angle_lost : bool
        Whether the mesh lines do not stand still in the angle, all along.

    Examples
    --------
    >>> signature = analysis.signature
    >>> signature.found, signature.held, round(signature.speed.estimated_hz, 1)
    (True, True, 24.5)
    >>> signature.speed_fluctuation < 0.01, signature.speed_swings  # a steady speed
    (True, False)
    """

    channel_names: tuple[str, ...]
    units: tuple[str | None, ...]
    speed: Speed
    meshes: tuple[MeshFinding, ...]
    track: AngleTrack
    plan: LinePlan
    lines: OrderLines
    notes: tuple[str, ...]
    angle_lost: bool

    @property
    def found(self) -> bool:
        """Whether any mesh was found."""
        return any(mesh.found for mesh in self.meshes)

    @property
    def held(self) -> bool:
        """Whether the angle of the gears is held, be it by pulses or by lines of any mesh."""
        return self.track.indexed or any(mesh.held for mesh in self.meshes)

    @property
    def speed_swings(self) -> bool:
        """Whether the speed swings so far that no knock can be told from what the path does."""
        return self.speed_fluctuation > _STEADY


def measure_signature(
    recording: RecordingLike,
    machine: MachineLike,
    *,
    sampling_rate_hz: float | None = None,
    unit: str | None = None,
    far: bool = False,
) -> MeasuredSignature:
    """Reduce a recording to the order lines of its machine.

    The speed comes from a tacho channel if there is one, else from the comb of mesh and shaft lines
    about a nominal speed of the machine file, refined by the phases of the mesh lines.

    Parameters
    ----------
    recording : str, Path, array, DataFrame or Recording
        Vibration channels, and perhaps a tacho channel.
    machine : Machine, path or dict
        Tooth counts and nominal speeds.
    sampling_rate_hz, unit
        Of an array, or where the recording does not state them: as of `gearmon.read_recording`.
    far : bool
        Whether healthy recordings show a mesh of this machine: then one that stands out far from
        the nominal speeds, its lines coherent, is believed without sidebands.

    Returns
    -------
    MeasuredSignature
        Also if no mesh was found: then its `found` is false and its levels mean nothing.

    Raises
    ------
    RecordingError
        If the recording has no vibration channel, none that is sound (see
        `gearmon.signals.bad_samples`), or is too short for a turn of the slowest shaft.

    Examples
    --------
    >>> signature = gearmon.measure_signature(half, machine)
    >>> signature.found, signature.level_db.shape, len(signature.plan.families)
    (True, (2, 30), 30)
    """
    machine = load_machine(machine)
    recording = read_recording(recording, sampling_rate_hz, sensors=machine.sensors, unit=unit)
    recording, tracking = _tracked(recording, machine, far)
    vibration, train, track = recording.vibration(), kinematics(machine), tracking.track
    samples, rate = vibration.samples, vibration.sampling_rate_hz
    start, stop = sound_piece(vibration)
    # what is sound in one piece sets the length of blocks, and has the spectra
    part = track.between(start / rate, stop / rate) if vibration.left_out else track
    piece = samples[:, start:stop]
    block_turns = _block_turns(float(part.turns[-1] - part.turns[0]), train)
    # from the nominal speed, so that recordings at one rate and speed have the same families
    top = 0.48 * rate / tracking.plan_hz / (1 + SPEED_TOLERANCE)
    # a Hann block tells lines apart that are two over its length away from each other
    plan = line_plan(train, top, 0.999 * 2.0 / block_turns, tracking.plan_hz)
    # the lines and the spectrum of the whole recording are made of one and the same steps of angle
    gaps, held = vibration.left_out or (), not vibration.left_out and samples.size <= _HELD_SAMPLES
    blocks = OrderBlocks(samples, rate, track, plan.orders, block_turns, LEAKAGE, gaps, held)
    in_angle = blocks.signals if held else InAngle.of(piece, rate, part)

    def others() -> tuple[FineSpectrum, NonGearLines, tuple[str, ...]]:
        # at most some millions of points: the test needs the resolution of seconds, not of hours
        pieces = max(1, piece.shape[-1] >> 18)
        spectrum = fine_order_spectrum(in_angle, pieces)
        return spectrum, nongear_lines(in_angle, train, spectrum), digests(samples)

    lines, (spectrum, foreign, marks) = at_once(blocks.lines, others, samples.size)
    # as the speed swings the path turns lines from block to block, as much as a knock would
    fluctuation = float(np.sqrt(2.0)) * track.wander
    for wheel in () if fluctuation > _STEADY else plan.wheels:
        lines = without_knocks(lines, wheel.lines, wheel.number)
    level, scatter, heard = family_levels(lines, plan)
    speed = tracking.speed()
    told = ("origin", "duration_s", "sampling_rate_hz", "channel_names", "units")
    return MeasuredSignature(
        **{name: getattr(vibration, name) for name in told},
        speed=speed,
        meshes=_findings(tracking, speed.peak_hz, spectrum, lines, plan),
        track=track,
        plan=plan,
        lines=lines,
        level_db=level,
        scatter_db=scatter,
        heard=heard,
        band_db=broadband_levels(piece, rate),
        speed_fluctuation=fluctuation,
        notes=tuple(recording.notes) + tracking.notes,
        angle_lost=tracking.lost,
        foreign=foreign,
        digests=marks,
    )


def _block_turns(turns: float, train: Kinematics) -> float:
    """Five turns of the slowest shaft or twenty of shaft 1, where the recording has room.

    A hundred turns of the fastest shaft do for those twenty.
    """
    orders = [shaft.order for shaft in train.shafts]
    slowest, wanted = min(orders), max(5.0 / min(orders), min(20.0, 100.0 / max(orders)))
    return min(wanted, max(turns / 2.5, min(turns, 2.0 / slowest)))


def opened(
    recording: RecordingLike, machine: Machine | None, rate_hz: float | None, unit: str | None
) -> Recording:
    """Read a recording as `measure_signature` takes it; return its longest sound part."""
    sensors = () if machine is None else machine.sensors
    return sound_part(read_recording(recording, rate_hz, sensors=sensors, unit=unit))


def digests(samples: FloatArray) -> tuple[str, ...]:
    """Return a mark of each channel that no other recording has.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
    """
    rows = (np.ascontiguousarray(row) for row in samples)
    return tuple(hashlib.blake2b(row.data, digest_size=12).hexdigest() for row in rows)


def _tracked(recording: Recording, machine: Machine, far: bool) -> tuple[Recording, Tracking]:
    """Find what is sound, and the angle in it.

    Where the angle is not known across what is left out the longest sound piece is all.

    Raises
    ------
    RecordingError
        If what is sound shows nothing of the fastest shaft, or not two turns of the slowest.
    """
    recording, found = inspected(recording), None
    whole, fastest_hz = sound_part(recording, 0.0), max(own.shaft1_hz for own in machine.operating)
    rate = whole.sampling_rate_hz
    if rate < 2.0 * fastest_hz * (1 - SPEED_TOLERANCE):
        raise RecordingError(
            f"{whole.origin}: {rate:.6g} samples a second show nothing of a shaft at "
            f"{fastest_hz:.6g} Hz; if the time is in ms, name its column time (ms), or give "
            f"--sampling-rate {1000 * rate:.6g}"
        )
    slowest_hz = min(shaft.order for shaft in kinematics(machine).shafts)
    slowest_hz *= min(point.shaft1_hz for point in machine.operating)
    needed, slow = 2.0 / slowest_hz, min(point.speed_rpm for point in machine.operating)
    if whole.duration_s < needed:
        asked = f"; speed_rpm is {slow:g} turns a minute: did you mean {60 * slow:g} ({slow:g} Hz)?"
        raise RecordingError(
            f"{whole.origin}: {whole.duration_s:.3g} s are too short: the slowest shaft turns at "
            f"{slowest_hz:.3g} Hz, two turns need {needed:.3g} s"
            + (asked if slow <= _SLOW_RPM else "")
        )
    if recording.left_out and _held(recording, machine, "tacho" in recording.channel_kinds):
        found = track_recording(recording, machine, far)
    if found is None or not _held(recording, machine, found.track.method == "tacho"):
        recording = sound_part(recording)
        found = track_recording(recording, machine, far)
    if found.held_s is None:
        return recording, found
    # nor is what lies beyond the part in which the angle is known
    start, stop = (round(time * recording.sampling_rate_hz) for time in found.held_s)
    every = [*(recording.left_out or ()), (0, start), (stop, recording.samples.shape[-1])]
    left_out = tuple(sorted(own for own in every if own[1] > own[0]))
    return replace(recording, left_out=left_out), found


def _held(recording: Recording, machine: Machine, tacho: bool) -> bool:
    """Whether the angle is known across all that is left out: by pulses, or because it is short."""
    fastest_hz = max(point.shaft1_hz for point in machine.operating)
    mesh_hz = fastest_hz * max(mesh.order for mesh in kinematics(machine).meshes)
    short = _HELD_PERIODS / mesh_hz * recording.sampling_rate_hz
    long = [slice(*own) for own in recording.left_out or () if own[1] - own[0] > short]
    if not tacho:
        return not long
    pulses = recording.samples[recording.channel_kinds.index("tacho")]
    # a recorder that stood still did so with all channels
    return all(np.ptp(pulses[gap]) > 0 for gap in long)


def broadband_levels(samples: FloatArray, rate: float) -> FloatArray:
    """Levels of the spectrum between its lines, in bands of equal ratio.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        Vibration.
    rate : float
        Sampling rate [Hz].

    Returns
    -------
    ndarray of float, shape (channels, 40)
        Median over the bins of each band of the density [dB re 1 unit^2/Hz], from a thousandth of
        the sampling rate to 0.475 of it: order lines fill few of the bins. NaN where a short
        recording has no bin in a band.

    Notes
    -----
    The density is the median in time, over ln 2: that of stationary noise, whose power in a bin is
    spread exponentially. Stones, ruts and what else knocks now and then are loud, but short: of
    eight lumped machines with two knocks a second, up to 15 times as loud as the rest, in each of
    their recordings, 46 of 96 sound ones (beside one and three references) were left open by
    Welch's mean, and of six with a crack the channels looked exchanged; 2 and none by the median.
    """
    length = samples.shape[-1]
    block = min(_BAND_SAMPLES, length // 8)
    blocks = np.lib.stride_tricks.sliding_window_view(samples, block, axis=-1)
    blocks = blocks[:, :: max(1, block // 2, length // _BAND_SEGMENTS)]
    weights = window("hann", block)
    power = median_along(window_powers(blocks, weights, block), axis=1)
    density = power * 2.0 / np.log(2.0) / (rate * (weights @ weights))
    frequency = np.fft.rfftfreq(block, 1.0 / rate)
    edges = np.geomspace(2.0 * rate / _BAND_SAMPLES, 0.475 * rate, _BANDS + 1)
    band = np.digitize(frequency, edges) - 1
    middle = np.full((len(samples), _BANDS), np.nan)
    for number in np.intersect1d(band, range(_BANDS)):
        middle[:, number] = np.median(density[:, band == number], axis=1)
    return np.asarray(10 * np.log10(np.maximum(middle, np.finfo(float).tiny)))


def family_levels(
    lines: OrderLines, plan: LinePlan
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Power of each family of lines in decibels, its standard error, and whether it is heard.

    Parameters
    ----------
    lines : OrderLines
        Measured lines, in the order of the plan.
    plan : LinePlan
        The families.

    Returns
    -------
    level_db, scatter_db : ndarray of float, shape (channels, families)
        Level and its standard error from the scatter of the blocks [dB].
    heard : ndarray of bool, shape (channels, families)
        Whether the power exceeds twice its standard error.

    Notes
    -----
    The powers are means of products of blocks that share no sample, so that noise has no share in
    them; a family that is not heard is put at its own standard error, an upper estimate.
    """
    products, pairs = lines.block_powers()
    series, floor = plan.by_family(products), np.sqrt(plan.by_family(lines.noise**2))
    scatter = np.std(series, axis=0, ddof=1) if len(series) > 1 else 0.0
    power, error = series.mean(axis=0), np.maximum(scatter, floor) / np.sqrt(pairs)
    return *level_and_error_db(power, error), power > 2 * error


def level_and_error_db(power: FloatArray, error: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return powers and their standard errors in decibels; what is lower is put at its error."""
    shown = np.maximum(power, np.maximum(error, np.finfo(float).tiny))
    return 10 * np.log10(shown), 10 / np.log(10) * np.minimum(error / shown, 1.0)


def _findings(
    tracking: Tracking, peak_hz: float, spectrum: FineSpectrum, lines: OrderLines, plan: LinePlan
) -> tuple[MeshFinding, ...]:
    signal, by_tacho = tracking.signal, tracking.track.method == "tacho"
    every = zip(signal.train.meshes, signal.meshes, tracking.evidence, strict=True)
    meshes = [_SeenMesh(spectrum, *own) for own in every]
    snr = 10 * np.log10(np.maximum(lines.cross_power() / lines.noise, 1e-3))
    # one harmonic could be a tone of anything; two, of whichever stage, fix the speed as well
    several = sum(own.seen.clear for own in meshes if own.seen.stands_out) >= 2
    # a tachometer tells the speed, as do the sidebands of a gear about a mesh of several harmonics
    told = by_tacho or any(own.support >= _SUPPORTED and own.seen.clear >= 2 for own in meshes)
    # what stands at a speed that was told by lines of something else is no mesh either
    misled = not by_tacho and any(own.foreign is not None for own in meshes)
    findings = []
    for own in meshes:
        found, reason = own.judged(told, misled, several)
        holds = tracking.coherent >= _HELD and not misled
        # lines where the mesh shows, be they its own or of another one as well
        shared = np.isin(np.round(plan.orders, 9), np.round(np.concatenate(own.comb.groups), 9))
        findings.append(
            MeshFinding(
                stage=own.mesh.stage,
                frequency_hz=own.mesh.order * peak_hz,
                found=found,
                snr_db=float(snr[:, shared].max()) if shared.any() else None,
                score=float(own.seen.score),
                reason=reason,
                held=found or (holds and bool(own.shown)),
            )
        )
    return tuple(findings)


@dataclass(frozen=True, eq=False)
class _SeenMesh:
    """A mesh, how clear its lines are, and what the spectrum shows about and between them."""

    spectrum: FineSpectrum
    mesh: Mesh
    comb: MeshComb
    seen: MeshEvidence

    def sidebands(self, spacing: float, *, broken: bool = False) -> SidebandSpacing:
        """Return what the sidebands of the mesh say of a spacing."""
        told = mesh_detection.sideband_spacing
        return told(self.spectrum, self.comb, spacing, SPEED_TOLERANCE, broken)

    @cached_property
    def shown(self) -> tuple[float, ...]:
        """Rotations of gears at which sidebands stand; none where they stand elsewhere as well."""
        told = {own: self.sidebands(own, broken=True) for own in self.comb.spacings}
        least = max(one.excess for one in told.values())
        high = {own: one.support for own, one in told.items() if one.support >= _SUPPORTED}
        return tuple(own for own, support in high.items() if support > least)

    @cached_property
    def support(self) -> float:
        """How clearly a mesh that stands out has sidebands of a gear not turning with shaft 1.

        A machine without gears has lines at multiples of shaft 1 about anything: a gear is left
        out when one of its first four sidebands falls on these.
        """
        if not self.seen.stands_out or self.mesh.carrier:
            return 0.0
        multiples = np.outer(self.comb.spacings, np.arange(1, 5))
        away = np.abs(multiples - np.rint(multiples)).min(axis=1)
        apart = np.array(self.comb.spacings)[away > max(4 * self.spectrum.step, 1e-3)]
        return max((self.sidebands(own).support for own in apart.tolist()), default=0.0)

    @cached_property
    def foreign(self) -> float | None:
        """Spacing of what else its lines belong to, such as a bearing; None if to nothing."""
        if not self.seen.stands_out:
            return None
        spacing = mesh_detection.foreign_spacing(self.spectrum, self.comb)
        if spacing is None or not self.shown:
            return spacing
        # gears that are there have pitch errors of their own
        return mesh_detection.foreign_spacing(self.spectrum, self.comb, self.shown)

    def judged(self, told: bool, misled: bool, several: bool) -> tuple[bool, str]:
        """Whether the mesh is found, and why.

        `told` if it is known to be the right speed, `misled` if it is that of something else;
        `several` if harmonics of any meshes fix it.
        """
        seen = self.seen
        if not seen.visible:
            return False, "too few of its harmonics lie below half the sampling rate to judge it"
        stands = f"its lines stand {seen.score:.1f} standard deviations above those of other tooth "
        if not seen.stands_out:
            above = f"{seen.decoys_above} of {seen.decoys}"
            return False, f"{stands}counts, {above} of which are as clear"
        # its sidebands may yet tell another speed
        doubted = not self.mesh.carrier and not (told and seen.clear >= 2)
        for own in map(self.sidebands, self.comb.spacings if doubted else ()):
            if own.excess > 0 and seen.score - own.excess < _FOUND_DESPITE_MISMATCH:
                return False, (
                    "a line suits it, but the sidebands about it are spaced "
                    f"{own.departure:+.1%} from the rotation that this mesh would need: it "
                    "belongs to something else"
                )
        if self.foreign is not None:
            return False, (
                f"lines suit it, but others as clear stand every {self.foreign:.4g} orders between "
                "them, and nothing in this machine turns so: they belong to something else, such "
                "as a bearing"
            )
        if misled:
            return False, (
                "lines suit it, but at a speed at which those of another stage belong to something "
                "else, such as a bearing"
            )
        if not several and seen.visible > 1 and self.support < _SUPPORTED:
            return False, (
                f"one line suits it, but none of the {seen.visible - 1} other harmonics that could "
                "be seen: it may be a tone of anything"
            )
        return True, f"{stands}counts"
