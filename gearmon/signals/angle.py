"""Angle tracks: the angle of shaft 1 against time, and points of the unit circle for many phases.

Angles are counted in turns of shaft 1 since the start of the recording; an *order* is a number of
cycles a turn of shaft 1. Time is the last axis everywhere, channels the one before.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.errors import ArgumentError, check_positive, check_type

# Times of which so many do not come after the one before are no times.
_WAVEFORM = 0.1


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
                    "with gearmon.signals.tracking.find_pulses"
                )
            raise ArgumentError(text)

    @property
    def speed_hz(self) -> FloatArray:
        """Mean rotation frequency between the knots [Hz], shape (knots - 1,)."""
        return np.diff(self.turns) / np.diff(self.time_s)

    @property
    def mean_hz(self) -> float:
        """Mean rotation frequency from the first to the last knot [Hz]."""
        return float((self.turns[-1] - self.turns[0]) / (self.time_s[-1] - self.time_s[0]))

    @cached_property
    def wander(self) -> float:
        """Relative standard deviation of the speed over half seconds; 0 if too short."""
        halves = np.arange(self.time_s[0], self.time_s[-1], 0.5)
        turns = np.diff(self.turns_at(halves))
        return float(np.std(turns) / np.mean(turns)) if len(turns) > 1 else 0.0

    @cached_property
    def _pieces(self) -> FloatArray:
        """Time against angle: of each piece its beginning, value and slope there, and bends.

        Slopes are those of parabolas through neighbours; linear outside. SciPy's curves keep all
        other threads waiting while they are read: of 500 s at 20 kHz half a second of 4.6.
        """
        slope, step = np.gradient(self.time_s, self.turns), np.diff(self.turns)
        third = (slope[1:] + slope[:-1] - 2 / self.speed_hz) / step
        rows = [self.turns, self.time_s, slope, 0 * slope, 0 * slope]
        pieces = np.pad(rows, ((0, 0), (1, 0)), "edge")
        pieces[3:, 1:-1] = (1 / self.speed_hz - slope[:-1]) / step - third, third / step
        return pieces

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
        # several turns of a slower shaft begin alike at shaft 1
        indexed, doubt = self.indexed and order == 1.0, self.uncertainty_turns * order
        return replace(self, turns=self.turns * order, uncertainty_turns=doubt, indexed=indexed)

    def between(self, start_s: float, stop_s: float) -> AngleTrack:
        """Return the track of a part, its time counted from there; the angle stays as it is.

        Parameters
        ----------
        start_s, stop_s : float
            Of the part [s].
        """
        inside = (self.time_s > start_s) & (self.time_s < stop_s)
        time = np.concatenate([[start_s], self.time_s[inside], [stop_s]])
        return replace(self, time_s=time - start_s, turns=self.turns_at(time))

    def moved(self, angle: FloatArray, ahead: FloatArray, uncertainty_turns: float) -> AngleTrack:
        """Return the track with other angles at the same times.

        Parameters
        ----------
        angle : ndarray of float
            Angles of this track [turns], ascending, at least two.
        ahead : ndarray of float
            By how much each is to be moved [turns]: straight between them, and on with the slopes
            beyond.
        uncertainty_turns : float
            Of the result [turns].
        """
        first, last = self.turns[[0, -1]]
        known = np.concatenate([[first], angle[(angle > first) & (angle < last)], [last]])
        slope, turns = np.gradient(ahead, angle), known + np.interp(known, angle, ahead)
        turns += slope[0] * np.minimum(known - angle[0], 0.0)
        turns += slope[-1] * np.maximum(known - angle[-1], 0.0)
        time_s, doubt = self.time_at(known), uncertainty_turns
        return replace(self, time_s=time_s, turns=turns, uncertainty_turns=doubt, indexed=False)

    def time_at(self, turns: FloatArray) -> FloatArray:
        """Time [s] at the given angles [turns]; linear beyond the ends."""
        return self.time_and_slope_at(turns)[0]

    def time_and_slope_at(self, turns: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Time [s] at the given angles [turns], and its slope there [s/turn]."""
        at = np.asarray(turns, dtype=float)
        # looked for only among the pieces that are asked for
        ends = at.min(initial=np.inf), at.max(initial=-np.inf)
        first, last = np.searchsorted(self.turns, ends, "right")
        piece = np.searchsorted(self.turns[first:last], at, "right") + first
        start, time_s, slope, square, cubic = self._pieces.take(piece, axis=1)
        away = at - start
        cubic *= away
        square += cubic
        time_s += away * (slope + away * square)
        slope += away * (2 * square + cubic)
        return time_s, slope

    def turns_at(self, time_s: FloatArray) -> FloatArray:
        """Angle [turns] at the given times [s]; linear beyond the ends."""
        angle = np.interp(time_s, self.time_s, self.turns)
        # Newton steps: of speeds that scatter by a tenth from knot to knot they leave 3e-11 s
        for _ in range(3):
            time, slope = self.time_and_slope_at(angle)
            angle += (time_s - time) / slope
        return angle


def check_track(track: object) -> None:
    """Raise an `ArgumentError` if it is no `AngleTrack`."""
    check_type("track", track, AngleTrack, "that of gearmon.measure_signature(...).track")


def phasors(cycles: FloatArray) -> ComplexArray:
    """Return exp(2 pi i x).

    Parameters
    ----------
    cycles : ndarray of float
        The phases x [cycles], below 1e12 in size.

    Returns
    -------
    ndarray of complex, same shape
        Right to the last digit beside what rounding of x costs.

    Examples
    --------
    >>> phasors(np.array([0.25, 1e6 + 0.5])).round(12).tolist()
    [1j, (-1+0j)]
    """
    # whole cycles off first: what is left keeps all its digits. The tangent of half an angle tells
    # cosine and sine: processors with AVX-512 take 1 ns for it, 20 for these
    tangent = np.tan(np.pi * (cycles - np.rint(cycles)))
    twice = 2 / (1 + tangent**2)
    return np.stack([twice - 1, twice * tangent], axis=-1).view(complex)[..., 0]
