"""Signals at equal steps of the angle of a shaft: read between their samples, averaged, or spread.

For waveforms, averages and maps, which must show what was recorded, signals are read between their
samples without aliases. For transforms at given orders samples are spread onto the steps by a short
kernel. A line of order o is the sum of x_n exp(-2 pi i o a_n) over the samples, a_n their angles.
Spreading every sample onto the nearest steps of an even grid of angle,

    g_j = sum over n of phi((j - P a_n)) x_n P da/dn,      P steps a turn,

turns that sum into the transform of g over that of the kernel, at every order at once. Unlike
interpolation this needs no band limit of the samples and no filter before; what is left is the
share of order P - o that the kernel lets through, below exp(-pi w sqrt(1 - 2 o / P)) with a kernel
of w steps.

The kernel is that of Kaiser and Bessel, phi(u) = I0(b sqrt(1 - (2 u / w)^2)) / I0(b), read from a
table that is straight from one of its places to the next.

Time-synchronous average. The recording is read over all whole turns of a rotation. Of the Fourier
transform of N turns every N-th line is a multiple of the rotation: these lines *are* the average.
What stands right beside them does not repeat from turn to turn and says how far the average can be
trusted, whatever it is: noise, lines of other shafts, a load that drifts. Only these lines and
neighbours are computed: across the turns first, then around the turn, which takes no time more
where the number of turns is awkward.

References
----------
J. F. Kaiser, Nonrecursive digital filter design using the I0-sinh window function, Proc. IEEE Int.
Symp. Circuits and Systems (1974) 20-23: length and shape of the low-pass. Fessler and Sutton,
Nonuniform fast Fourier transforms using min-max interpolation, IEEE Trans. Signal Processing 51
(2003) 560-574; Beatty, Nishimura and Pauly, Rapid gridding reconstruction with a minimal
oversampling ratio, IEEE Trans. Medical Imaging 24 (2005) 799-808.
P. D. McFadden, A revised model for the extraction of periodic waveforms by time domain averaging,
Mech. Syst. Signal Process. 1 (1987) 83-95: averaging over N turns as a comb filter.
D. R. Brillinger, Time Series: Data Analysis and Theory, SIAM 2001, ch. 5: variance of a mean from
the periodogram near frequency zero.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.errors import ArgumentError, RecordingError, check_positive
from gearmon.result import Result
from gearmon.signals.angle import AngleTrack, check_track, phasors
from gearmon.signals.spectra import fast_length
from gearmon.threads import side_by_side

#: Share of the sampling rate up to which tones are read; above, they fade towards half the rate.
READ_UP_TO = 0.45
# Samples to either side that the low-pass of the doubling reaches, and Kaiser's shape of it: what
# passes and what is stopped is 110 dB apart between 0.456 and 0.544 of the rate. It keeps the
# samples; half way between two of them it reads these weights.
_REACH, _KAISER = 40, 11.16
_HALF_WAY = np.sinc(np.arange(0.5 - _REACH, _REACH)) * np.kaiser(4 * _REACH + 1, _KAISER)[1::2]
_HALF_WAY /= _HALF_WAY.sum()
# Samples beyond a chunk that its quintic spline sees: of its edge 0.43 is left a half sample on.
_MARGIN = 32
_CHUNK = 1 << 16
#: Orders up to this share of the samples a turn pass unchanged, from half of it on none does.
PASSED = 0.4
_STOPPED = 0.5
# What is left of a line that would fold [dB]; what passes ripples by as much, a millionth.
_ATTENUATION_DB = 120.0
# Steps taken at a time: few calls, and their weights stay in the cache of a processor core (35 ns
# a step with 2^14, 40 with 2^12 and 2^16).
_PIECE = 1 << 14
# Places a step at which a kernel is held: straight lines between them are off by 6e-8 at most, an
# eighth of the square of their distance times the curvature 4 b / w^2.
_HELD = 2048
# Reach of a kernel that reads a line to 0.3 % [steps].
_QUICK = 4
# Neighbours of a line that tell its error: at least so many on either side, at most an eighth of
# the way to the next multiple, so that the noise there is the noise here.
_FEWEST_NEIGHBOURS = 8
_SHARE_OF_GAP = 8


@dataclass(frozen=True, kw_only=True)
class AngleGrid:
    """Equal steps of the angle of a shaft.

    Parameters
    ----------
    per_turn : float
        Samples a turn of shaft 1.
    first_turn : float
        Angle of the first sample [turns].
    count : int
        Samples in all.
    """

    per_turn: float
    first_turn: float
    count: int

    @classmethod
    def of(cls, samples: int, rate: float, track: AngleTrack, top_order: float) -> AngleGrid:
        """Return steps over a recording of `samples` samples that lose no bandwidth.

        There is room for `top_order`.

        Raises
        ------
        ArgumentError
            If the recording is shorter than 64 steps of angle.
        """
        last_s = (samples - 1) / rate
        first, last = (float(v) for v in track.turns_at(np.array([0.0, last_s])))
        slowest = float(track.speed_hz.min())
        # a step of angle may nowhere last longer than a step of time: nothing then aliases
        per_turn = int(np.ceil(max(2.2 * top_order, rate / slowest)))
        count = int((last - first) * per_turn)
        if count < 64:
            raise ArgumentError(
                f"recording of {last_s:.3g} s holds {last - first:.2g} turns of shaft 1: too short"
            )
        return cls(per_turn=per_turn, first_turn=first, count=count)


def resample_to_angle(
    samples: FloatArray, sampling_rate_hz: float, track: AngleTrack, grid: AngleGrid
) -> FloatArray:
    """Sample signals at equal steps of the angle of shaft 1.

    The rate is doubled by a low-pass of 80 samples before a quintic spline reads it at the wanted
    instants: relative error of a tone below 1e-6 at 0.1 and below 1e-4 at 0.3 of the
    sampling rate, 40 samples and more away from the ends; above 0.45 tones fade. Nothing else is
    removed: choose a grid whose steps nowhere exceed the time step, or let `angular_waveform` take
    out first what would alias.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        The signals.
    sampling_rate_hz : float
        Sampling rate [Hz].
    track : AngleTrack
        Angle of shaft 1 against time.
    grid : AngleGrid
        The steps wanted.

    Returns
    -------
    ndarray of float, shape (channels, grid.count)
        The signals against angle.

    Raises
    ------
    ArgumentError
        If the wanted angles reach beyond the recording.
    """
    from scipy.ndimage import map_coordinates

    check_positive("per_turn", grid.per_turn)
    last = samples.shape[-1] - 1
    output = np.empty((samples.shape[0], grid.count))
    for start in range(0, grid.count, _CHUNK):
        stop = min(grid.count, start + _CHUNK)
        angle = grid.first_turn + np.arange(start, stop) / grid.per_turn
        position = track.time_at(angle) * sampling_rate_hz
        if position[0] < -1e-6 or position[-1] > last + 1e-6:
            raise ArgumentError(
                f"angle track reaches from sample {position[0]:.1f} to {position[-1]:.1f}, "
                f"the recording from 0 to {last}"
            )
        first, end = int(position[0]) - _MARGIN, int(position[-1]) + 2 + _MARGIN
        doubled = np.empty(2 * (end - first))
        for row, channel in enumerate(samples):
            chunk = _odd_stretch(channel, first - _REACH, end + _REACH)
            doubled[::2] = chunk[_REACH:-_REACH]
            doubled[1::2] = np.convolve(chunk, _HALF_WAY, "valid")[1:]
            coordinates = 2 * (position - first)[None, :]
            map_coordinates(doubled, coordinates, output[row, start:stop], order=5, mode="mirror")
    return output


def _odd_stretch(channel: FloatArray, begin: int, end: int) -> FloatArray:
    """Return samples from `begin` to before `end`, odd about the first and last one beyond.

    Value and slope then go on smoothly: a step there would ring through a transform, or stand out
    from a line that begins or ends with the recording.
    """
    beyond = max(0, -begin), max(0, end - len(channel))
    inside = channel[max(0, begin) : end]
    return np.pad(inside, beyond, "reflect", reflect_type="odd") if any(beyond) else inside


@dataclass(frozen=True, kw_only=True, eq=False)
class AngularWaveform(Result):
    """Signals at equal steps of the angle of a shaft.

    Parameters
    ----------
    values : ndarray of float, shape (channels, turns * per_turn)
        In the units of the channels.
    per_turn : int
        Samples a turn of the shaft.
    first_turn : int
        Angle of the shaft at the first sample [turns], counted from the zero of its track.
    top_order : float
        Cycles a turn of the shaft up to which lines have their amplitude.
    """

    values: FloatArray
    per_turn: int
    first_turn: int
    top_order: float

    @property
    def turns(self) -> int:
        """Whole turns of the shaft."""
        return int(self.values.shape[-1]) // self.per_turn

    @property
    def angle_turns(self) -> FloatArray:
        """Angle of the shaft at every sample [turns], shape (turns * per_turn,)."""
        return self.first_turn + np.arange(self.values.shape[-1]) / self.per_turn


def angular_waveform(
    samples: FloatArray, sampling_rate_hz: float, track: AngleTrack, per_turn: int | None = None
) -> AngularWaveform:
    """Sample signals at equal steps of the angle of a shaft, over all its whole turns.

    Where a step of angle lasts longer than a step of time, the signals are first read on an angular
    grid finer by a whole factor, low-passed there and thinned: what would fold is taken out by
    120 dB, and since the low-pass lives in the angle domain it follows the speed. It is symmetric,
    so that nothing is delayed.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        The signals, in any unit.
    sampling_rate_hz : float
        Sampling rate [Hz].
    track : AngleTrack
        Angle of the shaft against time: that of another one than shaft 1 is `track.of_shaft`.
    per_turn : int, >= 4, optional
        Samples wanted a turn of the shaft; as many as keep the whole bandwidth at the lowest speed
        if not given.

    Returns
    -------
    AngularWaveform
        Lines up to 0.4 `per_turn` and 0.45 of the sampling rate keep their amplitude and phase
        (relative error of a tone at 0.1 of the sampling rate below 1e-5, at 0.3 below 1e-4), from
        0.5 `per_turn` on they are gone.
        Within 40 samples of either end the low-pass sees the recording continued oddly.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.
    RecordingError
        If the recording holds no whole turn of the shaft.

    Examples
    --------
    >>> vibration = gearmon.read_recording(new).vibration()
    >>> track = analysis.signature.track
    >>> wave = gearmon.angular_waveform(vibration.samples, 8000.0, track, per_turn=512)
    >>> wave.turns, wave.values.shape == (2, 512 * wave.turns)
    (73, True)
    """
    rate = check_positive("sampling_rate_hz", sampling_rate_hz, "Hz")
    check_track(track)
    enough, last_s = _steps_to_keep_all(rate, track), (samples.shape[-1] - 1) / rate
    steps = _whole(per_turn) or enough
    begin, end = (float(turn) for turn in track.turns_at(np.array([0.0, last_s])))
    # a turn that begins with the recording is not lost to rounding
    slack = 5e-7 * float(track.speed_hz.min()) / rate
    first, last = math.ceil(begin - slack), math.floor(end + slack)
    if last <= first:
        raise RecordingError(
            f"recording of {last_s:.3g} s: {end - begin:.3g} turns of the shaft, none of them "
            "whole; record longer"
        )
    highest, count = READ_UP_TO * rate / float(track.speed_hz.max()), (last - first) * steps
    # a grid finer by a whole factor
    factor = -(-enough // steps)
    if factor > 1:
        highest = min(highest, PASSED * steps)
    # whole steps before and behind the turns that lie inside the recording
    before = max(0, math.floor((first - begin) * steps))
    over = (before + math.floor((end - first) * steps)) * factor + 1
    grid = AngleGrid(per_turn=steps * factor, first_turn=first - before / steps, count=over)
    values = np.empty((len(samples), count))
    for row, channel in enumerate(samples):  # one by one: the fine grid takes memory
        found = resample_to_angle(channel[None], rate, track, grid)[0]
        values[row] = _thinned(found, factor)[before:][:count]
    return AngularWaveform(values=values, per_turn=steps, first_turn=first, top_order=highest)


def _thinned(values: FloatArray, factor: int) -> FloatArray:
    """Return every `factor`-th value, low-passed over Kaiser's length before."""
    if factor == 1:
        return values
    from scipy.signal import firwin, kaiser_beta, resample_poly  # takes half a second to load

    half = math.ceil((_ATTENUATION_DB - 7.95) / (14.36 * (_STOPPED - PASSED)) / 2) * factor
    window = ("kaiser", kaiser_beta(_ATTENUATION_DB))
    kernel = firwin(2 * half + 1, (PASSED + _STOPPED) / factor, window=window)
    return np.asarray(resample_poly(values, 1, factor, window=kernel, padtype="antireflect"))


def _whole(per_turn: int | None) -> int | None:
    """Return the wanted samples a turn, if any are; refuse what is no number of samples."""
    if per_turn is not None and (per_turn != int(per_turn) or per_turn < 4):
        raise ArgumentError(f"per_turn={per_turn} must be a whole number, at least 4")
    return per_turn and int(per_turn)


def _steps_to_keep_all(sampling_rate_hz: float, shaft: AngleTrack) -> int:
    """Return the samples a turn at which no step of angle lasts longer than a step of time."""
    return math.ceil(sampling_rate_hz / float(shaft.speed_hz.min()) * (1 - 1e-12))


@dataclass(frozen=True, kw_only=True)
class Kernel:
    """The kernel of Kaiser and Bessel for a share of the grid's bandwidth.

    Parameters
    ----------
    width : int
        Reach w [steps].
    beta : float
        Shape b.
    """

    width: int
    beta: float

    @classmethod
    def of(cls, width: int, oversampling: float) -> Kernel:
        """Return the kernel for orders up to half the steps a turn over `oversampling`."""
        sigma = float(np.clip(oversampling, 1.05, 3.0))
        return cls(width=width, beta=float(0.97 * np.pi * width * (1 - 0.5 / sigma)))

    def at(self, u: FloatArray) -> FloatArray:
        """Value at a distance u [steps], zero beyond its reach."""
        from scipy.special import i0

        inside = 1 - (2 * u / self.width) ** 2
        value = i0(self.beta * np.sqrt(np.maximum(inside, 0.0))) / i0(self.beta)
        return np.where(inside < 0, 0.0, value)

    @cached_property
    def _table(self) -> tuple[FloatArray, FloatArray]:
        """Values at distances of so many to a step, and their rises from one to the next."""
        values = self.at(np.arange(self.width * _HELD // 2 + 1) / _HELD)
        rises = np.diff(values, append=0.0)
        values[-1] = rises[-1] = 0.0
        return values, rises

    def read(self, place: FloatArray) -> FloatArray:
        """Values at places of the table, of either sign, written where these stand."""
        values, rises = self._table
        np.abs(place, out=place)
        cell = place.astype(np.intp)
        place -= cell
        place *= rises.take(cell, mode="clip")
        place += values.take(cell, mode="clip")
        return place

    def transform(self, x: FloatArray) -> FloatArray:
        """Fourier transform at x cycles a step."""
        inside = self.beta**2 - (np.pi * self.width * np.asarray(x)) ** 2
        # sinh(r) / r of a root that may be imaginary
        shape = np.sinc(1j / np.pi * np.sqrt(inside + 0j)).real
        return np.asarray(self.width * shape / np.i0(self.beta))


@dataclass(frozen=True, eq=False)
class InAngle:
    """Signals and their angle; spreads them onto equal steps of it, any stretch, by any thread.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        The signals.
    sampling_rate_hz : float
        Sampling rate [Hz].
    track : AngleTrack
        Angle of shaft 1 against time.
    grid : AngleGrid
        The steps.
    kernel : Kernel
        The kernel.
    held : ndarray of float, shape (channels, grid.count), optional
        All steps, where several ask for them.
    """

    samples: FloatArray
    sampling_rate_hz: float
    track: AngleTrack
    grid: AngleGrid
    kernel: Kernel
    held: FloatArray | None = None

    @classmethod
    def of(cls, samples: FloatArray, sampling_rate_hz: float, track: AngleTrack) -> InAngle:
        """Return signals for as many steps as keep the whole band, a line to 0.3 %."""
        grid = AngleGrid.of(samples.shape[-1], sampling_rate_hz, track, 0.0)
        return cls(samples, sampling_rate_hz, track, grid, Kernel.of(_QUICK, 1.3))

    def holding(self) -> InAngle:
        """Return the same with all its steps at hand."""
        parts = range(0, self.grid.count, _PIECE)
        held = side_by_side(lambda first: self[:, first : first + _PIECE], parts, self.samples.size)
        return replace(self, held=np.concatenate(held, axis=1))

    @property
    def shape(self) -> tuple[int, int]:
        """Channels and steps, as of an array."""
        return len(self.samples), self.grid.count

    def __getitem__(self, part: tuple[slice, slice]) -> FloatArray:
        """Return a stretch of the steps of all channels, as of an array."""
        first, end, _ = part[1].indices(self.grid.count)
        return self.steps(first, end - first)

    def steps(self, first: int, count: int) -> FloatArray:
        """Return so many steps from one on, shape (channels, count)."""
        if self.held is not None:
            return self.held[:, first : first + count]
        out, rate = np.empty((len(self.samples), count)), self.sampling_rate_hz
        for start in range(0, count, _PIECE):
            number = first + np.arange(start, min(start + _PIECE, count))
            angle = self.grid.first_turn + number / self.grid.per_turn
            time_s, slope = self.track.time_and_slope_at(angle)
            steps = self.grid.per_turn / (slope * rate)
            out[:, start : start + _PIECE] = self._piece(time_s * rate, steps)
        return out

    def _piece(self, position: FloatArray, steps: FloatArray) -> FloatArray:
        """Values at some places [samples], where so many steps last a sample."""
        drift = np.gradient(steps) * steps if len(steps) > 1 else np.zeros(1)
        taps = int(np.ceil(self.kernel.width / float(steps.min())))
        first = np.rint(position - 0.5 * (taps - 1))
        begin, away = int(first[0]), first - position
        # the speed changes by so much a sample: of tap k the angle is a parabola in k, and how
        # densely samples lie there its slope
        slope = steps + drift * away
        parabola = np.stack([0.5 * away * (slope + steps), slope, 0.5 * drift])
        powers = np.vander(np.arange(float(taps)), 3, increasing=True)
        weights = self.kernel.read((_HELD * powers) @ parabola)
        weights *= (powers[:, :2] * [1.0, 2.0]) @ parabola[1:]
        index = (first - begin).astype(np.intp) + np.arange(taps)[:, None]
        end = begin + int(index[-1, -1]) + 1
        near = (_odd_stretch(own, begin, end).take(index, mode="clip") for own in self.samples)
        return np.array([np.einsum("kn,kn->n", own, weights) for own in near])


@dataclass(frozen=True, kw_only=True, eq=False)
class SynchronousAverage(Result):
    """What repeats with every turn of a rotation.

    Parameters
    ----------
    rotation_order : float
        Turns of the rotation a turn of shaft 1.
    turns : int
        Turns averaged.
    first_turn : int
        Angle of the rotation at which the first of them begins [turns].
    lines : ndarray of complex, shape (channels, top + 1)
        Peak amplitudes A_n of the multiples 0 (the mean) to `top`: line n is
        Re(A_n exp(2 pi i n angle)), angle in turns of the rotation.
    line_error : ndarray of float, shape (channels, top + 1)
        Standard error of each: root mean square of |A_n less its true value|, in the complex plane.
    waveform : ndarray of float, shape (channels, per_turn)
        The same lines as one turn, in the units of the channels, from a whole angle on.
    waveform_error : ndarray of float, shape (channels, per_turn)
        Standard error of every value.
    """

    rotation_order: float
    turns: int
    first_turn: int
    lines: ComplexArray
    line_error: FloatArray
    waveform: FloatArray
    waveform_error: FloatArray

    @property
    def per_turn(self) -> int:
        """Values a turn."""
        return int(self.waveform.shape[-1])

    @property
    def top(self) -> int:
        """Highest multiple of the rotation."""
        return int(self.lines.shape[-1]) - 1

    @property
    def amplitude(self) -> FloatArray:
        """Peak amplitudes, shape (channels, top + 1)."""
        return np.abs(self.lines)


def time_synchronous_average(
    samples: FloatArray,
    sampling_rate_hz: float,
    track: AngleTrack,
    *,
    rotation_order: float | Fraction = 1,
    per_turn: int | None = None,
) -> SynchronousAverage:
    """Average signals over the turns of a rotation.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        The signals, in any unit.
    sampling_rate_hz : float
        Sampling rate [Hz].
    track : AngleTrack
        Angle of shaft 1 against time.
    rotation_order : float or Fraction > 0
        Turns of the rotation a turn of shaft 1: of an output shaft or a planet a ratio of tooth
        counts. Its turn need be no whole number of turns of shaft 1.
    per_turn : int, >= 4, optional
        Values wanted a turn; as many as keep the whole bandwidth if not given. With fewer, lines
        from half of them on are left out, not folded.

    Returns
    -------
    SynchronousAverage
        Of all whole turns, with the lines up to 0.45 of the sampling rate at the highest speed.

    Raises
    ------
    RecordingError
        If the recording holds fewer than two whole turns: they tell no scatter.
    ArgumentError
        If an argument is out of its range.

    Notes
    -----
    With X_b the transform of N turns, their mean has the lines X_nN. The variance of a mean of N
    turns is the power density of what departs from it, near frequency zero, over N; here the mean
    of abs(X_nN+b)^2 over M = max(8, N/8) bins b on either side, as far as b <= N/2. Turns need not
    be independent: a drift over many turns shows at small b. For N <= 16 the error of the waveform
    is the usual sqrt(s^2 / N). With some 2 M degrees of freedom it is itself known to about
    1/sqrt(4 M), 18 % or better from 16 turns on.

    Lines of another rotation, d turns off the next multiple, leak into the average by up to
    1/(N sin(pi d)). Those that fall on a multiple cannot be told from it.

    Examples
    --------
    >>> vibration = gearmon.read_recording(new).vibration()
    >>> track = analysis.signature.track
    >>> average = gearmon.time_synchronous_average(vibration.samples, 8000.0, track)
    >>> average.turns, average.waveform.shape == (2, average.per_turn)
    (73, True)
    """
    check_positive("sampling_rate_hz", sampling_rate_hz, "Hz")
    check_track(track)
    shaft = track.of_shaft(float(rotation_order))
    given = _whole(per_turn)
    steps = fast_length(max(_steps_to_keep_all(sampling_rate_hz, shaft), given or 4))
    wanted = given or steps
    found = []
    for channel in samples:
        # a channel at a time: memory holds one in angle
        wave = angular_waveform(channel[None], sampling_rate_hz, shaft, steps)
        if wave.turns < 2:
            raise RecordingError(
                f"recording of {len(channel) / sampling_rate_hz:.3g} s: whole turns of the shaft: "
                f"{wave.turns}; an average with its scatter needs 2"
            )
        found.append(_of_record(wave, wanted))
    lines, line_error, waveform_error = (np.array(own) for own in zip(*found, strict=True))
    return SynchronousAverage(
        rotation_order=float(rotation_order),
        turns=wave.turns,
        first_turn=wave.first_turn,
        lines=lines,
        line_error=line_error,
        waveform=one_turn(lines, wanted),
        waveform_error=waveform_error,
    )


def one_turn(lines: ComplexArray, per_turn: int) -> FloatArray:
    """Return one turn of lines.

    Parameters
    ----------
    lines : ndarray of complex, shape (..., top + 1)
        Peak amplitudes of the multiples 0 to top.
    per_turn : int, > 2 top
        Values wanted.

    Returns
    -------
    ndarray of float, shape (..., per_turn)
    """
    half = np.zeros((*lines.shape[:-1], per_turn // 2 + 1), dtype=complex)
    half[..., : lines.shape[-1]] = 0.5 * lines
    half[..., 0] = lines[..., 0].real
    return np.asarray(np.fft.irfft(half, n=per_turn, axis=-1, norm="forward"))


def _of_record(wave: AngularWaveform, per_turn: int) -> tuple[ComplexArray, FloatArray, FloatArray]:
    """Lines, their errors and those of the waveform, of one channel at equal steps of angle."""
    steps, turns = wave.per_turn, wave.turns
    top = min((per_turn - 1) // 2, int(wave.top_order))
    near = np.arange(1, min(turns // 2, max(_FEWEST_NEIGHBOURS, turns // _SHARE_OF_GAP)) + 1)
    wanted = np.append(0, near)
    course = np.fft.rfft(wave.values[0].reshape(turns, steps), axis=0)[wanted]
    # row b holds the transform of the record at the bins n N + b, n from 0 and from below
    course *= phasors(np.outer(wanted, np.arange(steps)) / -(turns * steps))
    bins = np.fft.fft(course, axis=1)
    upper, lower = bins[:, : top + 1], bins[:, -np.arange(top + 1)]
    scale = np.full(top + 1, 2.0 / (turns * steps))
    scale[0] *= 0.5  # the mean is no peak amplitude
    power = 0.5 * (_squared(upper[1:]) + _squared(lower[1:])).mean(axis=0)
    # of the highest bin of an even count there is one, of the others one on either side
    weight = np.where(2 * near == turns, 1.0, 2.0)
    variance = np.zeros(per_turn)
    for row, own in zip(bins[1:], weight, strict=True):
        # what lies beyond the lines that are kept is no part of the waveform
        kept = np.zeros(per_turn, dtype=complex)
        kept[: top + 1], kept[per_turn - top :] = row[: top + 1], row[steps - top :]
        variance += own * _squared(np.fft.ifft(kept, norm="forward"))
    error = np.sqrt(variance / weight.sum()) / (turns * steps)
    return upper[0] * scale, scale * np.sqrt(power), error


def _squared(values: ComplexArray) -> FloatArray:
    return np.asarray(values.real**2 + values.imag**2)
