"""From time to angle: angle tracks and angular resampling.

Angles are counted in turns of shaft 1 since the start of the recording; an *order* is a number of
cycles a turn of shaft 1. Time is the last axis everywhere, channels the one before.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError, check_positive
from gearmon.signals.transforms import fast_length

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: Share of the sampling rate up to which tones are read; above, they fade towards half the rate.
READ_UP_TO = 0.45
# Samples to either side that the low-pass of the doubling reaches, and Kaiser's shape of it: what
# passes and what is stopped is 110 dB apart between 0.456 and 0.544 of the rate.
_REACH, _KAISER = 40, 11.16
# Times of which so many do not come after the one before are no times.
_WAVEFORM = 0.1
# Samples beyond a chunk that its resampling sees: the taper that makes the chunk periodic for its
# Fourier transform, and the reach of the quintic spline.
_MARGIN = 256
_CHUNK = 1 << 16


@dataclass(frozen=True, kw_only=True)
class AngleTrack:
    """Angle of shaft 1 against time, as knots of a cubic Hermite curve.

    Parameters
    ----------
    time_s : ndarray of float, shape (knots,)
        Times of the knots [s], increasing; at least two.
    turns : ndarray of float, shape (knots,)
        Angle at the knots [turns], increasing.
    method : str
        How it was found: "comb", "tacho" or "constant".
    uncertainty_turns : float
        Standard deviation of the angle about the true one, slow common offset left out [turns].
    indexed : bool
        Whether angle zero is the same position of shaft 1 in every recording.

    Raises
    ------
    ArgumentError
        If there are fewer than two knots or either sequence does not increase.
    """

    time_s: FloatArray
    turns: FloatArray
    method: str
    uncertainty_turns: float
    indexed: bool = False

    def __post_init__(self) -> None:
        """Check the knots."""
        if len(self.time_s) < 2 or len(self.time_s) != len(self.turns):
            raise ArgumentError(f"an angle track needs two knots or more, got {len(self.time_s)}")
        falling = np.diff(self.time_s) <= 0
        if falling.any() or np.any(np.diff(self.turns) <= 0):
            text = "an angle track must increase: the shaft stands still or turns back"
            if falling.mean() > _WAVEFORM:
                text += (
                    "; time_s looks like a tacho waveform, not like times of pulses: find them "
                    "with gearmon.signals.tacho.find_pulses"
                )
            raise ArgumentError(text)

    @property
    def speed_hz(self) -> FloatArray:
        """Mean rotation frequency between the knots [Hz], shape (knots - 1,)."""
        return np.diff(self.turns) / np.diff(self.time_s)

    @cached_property
    def _time(self) -> _Curve:
        return _Curve(self.turns, self.time_s)

    @cached_property
    def _angle(self) -> _Curve:
        return _Curve(self.time_s, self.turns)

    def of_shaft(self, shaft_order: float) -> AngleTrack:
        """Return the angle of another shaft.

        Parameters
        ----------
        shaft_order : float > 0
            Its turns a turn of this track's shaft.

        Raises
        ------
        ArgumentError
            If `shaft_order` is not above zero.
        """
        order = check_positive("shaft_order", shaft_order)
        return AngleTrack(
            time_s=self.time_s,
            turns=self.turns * order,
            method=self.method,
            uncertainty_turns=self.uncertainty_turns * order,
            # several turns of a slower shaft begin alike at shaft 1
            indexed=self.indexed and order == 1.0,
        )

    def time_at(self, turns: FloatArray) -> FloatArray:
        """Time [s] at the given angles [turns], ascending; linear beyond the ends."""
        return self._time.at(turns)[0]

    def time_and_slope_at(self, turns: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Time [s] at the given angles [turns], ascending, and its slope there [s/turn]."""
        return self._time.at(turns)

    def turns_at(self, time_s: FloatArray) -> FloatArray:
        """Angle [turns] at the given times [s], ascending; linear beyond the ends."""
        angle = self._angle.at(time_s)[0]
        # Newton steps on the curve of time against angle, so that both are one and the same curve
        for _ in range(2):
            time, slope = self._time.at(angle)
            angle += (time_s - time) / slope
        return angle


class _Curve:
    """Cubic Hermite curve with slopes from parabolas through neighbours, linear outside."""

    def __init__(self, x: FloatArray, y: FloatArray) -> None:
        width = np.diff(x)
        secant = np.diff(y) / width
        slope = np.empty_like(y)
        slope[0], slope[-1] = secant[0], secant[-1]
        slope[1:-1] = (secant[:-1] * width[1:] + secant[1:] * width[:-1]) / (width[1:] + width[:-1])
        second = (3 * secant - 2 * slope[:-1] - slope[1:]) / width
        third = (slope[:-1] + slope[1:] - 2 * secant) / width**2
        self._x = x
        # two straight pieces at the ends continue the curve
        self._pieces = (
            np.concatenate([x[:1], x[:-1], x[-1:]]),
            np.concatenate([y[:1], y[:-1], y[-1:]]),
            np.concatenate([slope[:1], slope[:-1], slope[-1:]]),
            np.concatenate([[0.0], second, [0.0]]),
            np.concatenate([[0.0], third, [0.0]]),
        )

    def at(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return values and slopes at ascending points: pieces are found by cutting."""
        if len(points) == 0:
            return np.zeros(0), np.zeros(0)
        first, last = np.searchsorted(self._x, points[[0, -1]], side="right")
        cuts = np.searchsorted(points, self._x[first:last])
        sizes = np.diff(np.concatenate([[0], cuts, [len(points)]]))
        knot, value, tangent, turn, bend = (
            np.repeat(coefficient[first : last + 1], sizes) for coefficient in self._pieces
        )
        u = np.subtract(points, knot, out=knot)
        bend *= u
        curve = turn + bend
        curve *= u
        curve += tangent
        curve *= u
        curve += value
        turn *= 2.0
        bend *= 3.0
        turn += bend
        turn *= u
        tangent += turn
        return curve, tangent


def resample_to_angle(
    samples: FloatArray,
    sampling_rate_hz: float,
    track: AngleTrack,
    per_turn: int,
    first_turn: float,
    count: int,
    *,
    precise: bool = True,
) -> FloatArray:
    """Sample signals at equal steps of the angle of shaft 1.

    The rate is doubled by a Fourier transform of each chunk before a quintic spline reads it at the
    wanted instants: relative error of a tone below 1e-6 at 0.1 and below 1e-4 at 0.3 of the
    sampling rate, 40 samples and more away from the ends; above 0.45 tones fade. Nothing else is
    removed: choose `per_turn` so that no angular step exceeds the time step, or let
    `gearmon.signals.angular_waveform` take out first what would alias.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        The signals.
    sampling_rate_hz : float
        Sampling rate [Hz].
    track : AngleTrack
        Angle of shaft 1 against time.
    per_turn : int
        Samples a turn of shaft 1.
    first_turn : float
        Angle of the first sample [turns].
    count : int
        Samples wanted.
    precise : bool
        Whether to double the rate first; without, a tone at 0.1 of the sampling rate is read to
        4e-6, one at 0.2 to 4e-4.

    Returns
    -------
    ndarray of float, shape (channels, count)
        The signals against angle.

    Raises
    ------
    ArgumentError
        If the wanted angles reach beyond the recording.
    """
    check_positive("per_turn", per_turn)
    output = np.empty((samples.shape[0], count))
    for start in range(0, count, _CHUNK):
        stop = min(count, start + _CHUNK)
        angle = first_turn + np.arange(start, stop) / per_turn
        position = track.time_at(angle) * sampling_rate_hz
        output[:, start:stop] = _read_at(samples, position, 2 if precise else 1)
    return output


def _read_at(samples: FloatArray, position: FloatArray, oversampling: int) -> FloatArray:
    """Values of band-limited signals at fractional sample positions (increasing)."""
    from scipy.ndimage import map_coordinates, spline_filter1d

    last = samples.shape[-1] - 1
    if position[0] < -1e-6 or position[-1] > last + 1e-6:
        raise ArgumentError(
            f"angle track reaches from sample {position[0]:.1f} to {position[-1]:.1f}, "
            f"the recording from 0 to {last}"
        )
    first = int(position[0]) - _MARGIN
    stop = int(position[-1]) + 2 + _MARGIN
    length = fast_length(stop - first)
    index, mirrored, end = _beyond_ends(np.arange(first, first + length), last)
    taper = np.ones(length)
    ramp = 0.5 - 0.5 * np.cos(np.pi * np.arange(_MARGIN // 2) / (_MARGIN // 2))
    taper[: len(ramp)] = ramp
    taper[-len(ramp) :] = ramp[::-1]
    coordinates = oversampling * (position - first)[None, :]
    result = np.empty((samples.shape[0], len(position)))
    for row, channel in enumerate(samples):
        chunk = np.where(mirrored, 2.0 * channel[end] - channel[index], channel[index])
        level = float(chunk.mean())
        tapered = (chunk - level) * taper
        if oversampling == 2:
            weights = _doubled_weights(tapered)
        else:
            weights = spline_filter1d(tapered, order=5, mode="mirror")
        result[row] = level + map_coordinates(
            weights, coordinates, order=5, mode="mirror", prefilter=False
        )
    return result


def _beyond_ends(
    index: NDArray[np.int64], last: int
) -> tuple[NDArray[np.int64], NDArray[np.bool_], NDArray[np.int64]]:
    """Continue a recording oddly about its first and last sample.

    Value and slope then go on smoothly: a step there would ring through the transform.
    """
    below, above = index < 0, index > last
    reflected = np.where(below, -index, np.where(above, 2 * last - index, index))
    end = np.where(above, last, 0)
    return np.clip(reflected, 0, last), below | above, end


def _doubled_weights(chunk: FloatArray) -> FloatArray:
    """Weights of quintic B-splines, two a sample, that interpolate a periodic band-limited chunk.

    The chunk is brought to twice its rate by a low-pass that reaches 40 samples to either side and
    leaves the samples as they are: what is wrong beyond an end of the recording is not heard
    further inside. A low-pass with an edge at half the rate would ring by 1/(pi k^2) at k samples.
    """
    half = np.fft.rfft(chunk)
    # zeros between the samples repeat the spectrum
    repeated = np.concatenate([half, np.conj(half[-2::-1])])
    repeated *= _doubling(len(chunk))
    result: FloatArray = np.fft.irfft(repeated, n=2 * len(chunk))
    return result


@lru_cache(maxsize=8)
def _doubling(length: int) -> FloatArray:
    """Transform of the low-pass over that of a quintic B-spline read at its knots; read-only."""
    reach = np.arange(2 * _REACH + 1)
    # a windowed sinc whose every second value is zero: it keeps the samples
    side = np.sinc(reach / 2) * np.kaiser(4 * _REACH + 1, _KAISER)[2 * _REACH :]
    kernel = np.zeros(2 * length)
    kernel[: len(reach)] = side
    kernel[-reach[1:]] = side[1:]
    angle = np.pi * np.arange(length + 1) / length
    # a quintic B-spline is 66, 26 and 1 over 120 at its knots
    knots = (66 + 52 * np.cos(angle) + 2 * np.cos(2 * angle)) / 120
    gain = np.fft.rfft(kernel).real / knots
    gain.flags.writeable = False
    return np.asarray(gain, dtype=np.float64)


@dataclass(frozen=True, kw_only=True)
class AngleGrid:
    """Equal steps of angle that cover a recording without losing bandwidth.

    Parameters
    ----------
    per_turn : int
        Samples a turn of shaft 1.
    first_turn : float
        Angle of the first sample [turns].
    count : int
        Samples in all.
    """

    per_turn: int
    first_turn: float
    count: int

    @classmethod
    def of(
        cls, samples: int, sampling_rate_hz: float, track: AngleTrack, top_order: float
    ) -> AngleGrid:
        """Return the grid of a recording of `samples` samples, with room for `top_order`.

        Raises
        ------
        ArgumentError
            If the recording is shorter than 64 steps of angle.
        """
        last_s = (samples - 1) / sampling_rate_hz
        first, last = (float(v) for v in track.turns_at(np.array([0.0, last_s])))
        slowest = float(track.speed_hz.min())
        # a step of angle may nowhere last longer than a step of time: nothing then aliases
        per_turn = int(np.ceil(max(2.2 * top_order, sampling_rate_hz / slowest)))
        count = int((last - first) * per_turn)
        if count < 64:
            raise ArgumentError(
                f"recording of {last_s:.3g} s holds {last - first:.2g} turns of shaft 1: too short"
            )
        return cls(per_turn=per_turn, first_turn=first, count=count)


def angle_blocks(
    samples: FloatArray,
    sampling_rate_hz: float,
    track: AngleTrack,
    grid: AngleGrid,
    block: int,
    *,
    precise: bool = True,
) -> Iterator[tuple[int, FloatArray]]:
    """Give half-overlapped blocks of a recording at equal steps of angle.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        The signals.
    sampling_rate_hz : float
        Sampling rate [Hz].
    track : AngleTrack
        Angle of shaft 1 against time.
    grid : AngleGrid
        The steps of angle.
    block : int
        Steps a block.
    precise : bool
        As for `order_lines`.

    Yields
    ------
    start : int
        First step of the block.
    part : ndarray of float, shape (channels, block)
        The block.
    """
    hop = max(1, block // 2)
    starts = range(0, grid.count - block + 1, hop)
    together = max(1, _CHUNK // hop)
    for first in range(0, len(starts), together):
        group = starts[first : first + together]
        piece = resample_to_angle(
            samples,
            sampling_rate_hz,
            track,
            grid.per_turn,
            grid.first_turn + group[0] / grid.per_turn,
            group[-1] - group[0] + block,
            precise=precise,
        )
        for start in group:
            yield start, piece[:, start - group[0] : start - group[0] + block]
