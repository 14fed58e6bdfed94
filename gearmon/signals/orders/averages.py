"""Time-synchronous average (TSA) of any rotation, with the standard error of all that it gives.

The recording is read at equal steps of the angle of the rotation, over all its whole turns. Of the
Fourier transform of N turns every N-th line is a multiple of the rotation: these lines *are* the
average. What stands right beside them does not repeat from turn to turn and says how far the
average can be trusted, whatever it is: noise, lines of other shafts, a load that drifts. Only these
lines and neighbours are computed: across the turns first, then around the turn, which takes no time
more where the number of turns is awkward.

References
----------
P. D. McFadden, A revised model for the extraction of periodic waveforms by time domain averaging,
Mech. Syst. Signal Process. 1 (1987) 83-95: averaging over N turns as a comb filter.
D. R. Brillinger, Time Series: Data Analysis and Theory, SIAM 2001, ch. 5: variance of a mean from
the periodogram near frequency zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from gearmon.arrays import ComplexArray, FloatArray, IntArray
from gearmon.errors import ArgumentError, RecordingError, check_positive
from gearmon.result import Result
from gearmon.signals.angle import AngleTrack, check_track
from gearmon.signals.orders.resampling import AngularWaveform, angular_waveform, steps_to_keep_all
from gearmon.signals.spectra import fast_length, half_lobe, window

# Neighbours of a line that tell its error: at least so many on either side, at most an eighth of
# the way to the next multiple, so that the noise there is the noise here.
_FEWEST_NEIGHBOURS = 8
_SHARE_OF_GAP = 8
# Angles of a turn whose course from turn to turn is transformed at a time [numbers].
_TOGETHER = 1 << 22


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
    window_name: str = "rectangular",
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
    window_name : {"rectangular", "hann", "flat-top", "blackman-harris"}
        Weights of the turns. Equal ones leave the least noise; with a Hann window the average has
        1.22 times as much of it, but the lines of other rotations are gone.

    Returns
    -------
    SynchronousAverage
        Of all whole turns, with the lines up to 0.45 of the sampling rate at the highest speed.

    Raises
    ------
    RecordingError
        If the recording holds fewer whole turns than tell the scatter: 2, with a Hann window 4.
    ArgumentError
        If an argument is out of its range.

    Notes
    -----
    With X_b the transform of N weighted turns, their mean has the lines X_nN. The variance of a
    mean of N turns is the power density of what departs from it, near frequency zero, over N; here
    the mean of abs(X_nN+b)^2 over M bins b on either side, from the edge of the window's main lobe
    on, M = max(8, N/8), as far as b <= N/2. Turns need not be independent: a drift over many turns
    shows at small b. For N <= 16 equal turns the error of the waveform is the usual sqrt(s^2 / N).
    With some 2 M degrees of freedom it is itself known to about 1/sqrt(4 M), 18 % or better from
    16 turns on.

    Lines of another rotation, d turns off the next multiple, leak into the average: of equal turns
    by up to 1/(N sin(pi d)), with a Hann window by the cube of that. Those that fall on a multiple
    cannot be told from it.

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
    if per_turn is not None and (per_turn != int(per_turn) or per_turn < 4):
        raise ArgumentError(f"per_turn={per_turn} must be a whole number, at least 4")
    steps = fast_length(max(steps_to_keep_all(sampling_rate_hz, shaft), per_turn or 4))
    wanted = steps if per_turn is None else int(per_turn)
    found, fewest = [], 2 * half_lobe(window_name)
    for channel in samples:
        # a channel at a time: memory holds one in angle
        wave = angular_waveform(channel[None], sampling_rate_hz, shaft, steps)
        if wave.turns < fewest:
            raise RecordingError(
                f"recording of {len(channel) / sampling_rate_hz:.3g} s: whole turns of the shaft: "
                f"{wave.turns}; an average with its scatter needs {fewest}"
            )
        found.append(_of_record(wave, wanted, window_name))
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


def _of_record(
    wave: AngularWaveform, per_turn: int, window_name: str
) -> tuple[ComplexArray, FloatArray, FloatArray]:
    """Lines, their errors and those of the waveform, of one channel at equal steps of angle."""
    steps, turns, lobe = wave.per_turn, wave.turns, half_lobe(window_name)
    top = min((per_turn - 1) // 2, int(wave.top_order))
    neighbours = max(_FEWEST_NEIGHBOURS, turns // _SHARE_OF_GAP)
    near = np.arange(lobe, min(turns // 2, lobe - 1 + neighbours) + 1)
    weights = window(window_name, turns * steps)
    values = wave.values[0] * (weights / weights.mean())
    course = _courses(values.reshape(turns, steps), np.concatenate([[0], near]))
    # column b holds the transform of the record at the bins n N + b, n from 0 and from below
    angle = np.arange(steps)[:, None] * np.concatenate([[0], near]) / (turns * steps)
    course *= np.exp(-2j * np.pi * angle)
    bins = np.fft.fft(course, axis=0)
    upper = bins[: top + 1]
    lower = bins[-np.arange(top + 1)]
    scale = np.full(top + 1, 2.0 / (turns * steps))
    scale[0] *= 0.5  # the mean is no peak amplitude
    lines = upper[:, 0] * scale
    power = 0.5 * (_squared(upper[:, 1:]) + _squared(lower[:, 1:])).mean(axis=1)
    error: FloatArray = scale * np.sqrt(power)
    return lines, error, _waveform_error(bins[:, 1:], turns, top, per_turn, near)


def _courses(record: FloatArray, wanted: IntArray) -> ComplexArray:
    """Transform a record over its turns, at the wanted bins: shape (steps, bins)."""
    turns, steps = record.shape
    course = np.empty((steps, len(wanted)), dtype=complex)
    width = max(1, _TOGETHER // turns)
    for start in range(0, steps, width):
        columns = np.ascontiguousarray(record[:, start : start + width].T)
        course[start : start + width] = np.fft.rfft(columns, axis=1)[:, wanted]
    return course


def _waveform_error(
    bins: ComplexArray, turns: int, top: int, per_turn: int, near: IntArray
) -> FloatArray:
    """Return standard errors of the mean over turns at every angle."""
    # of the highest bin of an even count there is one, of the others one on either side
    weight = np.where(2 * near == turns, 1.0, 2.0)
    variance = np.zeros(per_turn)
    for column, own in zip(bins.T, weight, strict=True):
        # what lies beyond the lines that are kept is no part of the waveform
        kept = np.zeros(per_turn, dtype=complex)
        kept[: top + 1] = column[: top + 1]
        if top:
            kept[-top:] = column[-top:]
        variance += own * _squared(np.fft.ifft(kept, norm="forward"))
    return np.asarray(np.sqrt(variance / weight.sum()) / len(bins) / turns)


def _squared(values: ComplexArray) -> FloatArray:
    return np.asarray(values.real**2 + values.imag**2)
