"""What a person feels of a recording: weighted acceleration, running rms, dose value, advice.

The recording is filtered block by block, so that memory stays bounded. The offset that it begins
with is taken off first: a sensor that shows gravity would else ring through the high-pass filter.
The filter begins at rest. Led in by the mirrored start it erred more: 9 to 25 % of the rms in the
first five seconds of noise as on a seat, in place of 7 to 17 %.

References
----------
ISO 2631-1:1997, 5.5 (duration), 6.2 (crest factor), 6.3 (running rms, MTVV, VDV), 7 and 8 (factors
k); ISO 5349-1:2001 (hand); ISO 10326-1 (SEAT); Directive 2002/44/EC, article 3 (limits).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.errors import ArgumentError, RecordingError, check_positive, check_type, check_word
from gearmon.exposure.weighting import HALF_BAND, WEIGHTINGS, Weighting
from gearmon.machine import Sensor
from gearmon.machine.fields import check_fields, limit, within
from gearmon.result import Result
from gearmon.signals.reading import find_defect
from gearmon.signals.recording import Recording, RecordingLike, read_recording
from gearmon.signals.spectra import power_density
from gearmon.threads import side_by_side
from gearmon.units import STANDARD_GRAVITY

#: Weighting and factor k of each axis, by where the vibration enters.
POSITIONS: dict[str, dict[str, tuple[str, float]]] = {
    "seat": {"x": ("Wd", 1.4), "y": ("Wd", 1.4), "z": ("Wk", 1.0)},
    "hand": {"x": ("Wh", 1.0), "y": ("Wh", 1.0), "z": ("Wh", 1.0)},
    "standing": {"x": ("Wd", 1.0), "y": ("Wd", 1.0), "z": ("Wk", 1.0)},
    "backrest": {"x": ("Wc", 0.8), "y": ("Wd", 0.5), "z": ("Wd", 0.4)},
    "feet": {"x": ("Wk", 0.25), "y": ("Wk", 0.25), "z": ("Wk", 0.4)},
    "building": {"x": ("Wm", 1.0), "y": ("Wm", 1.0), "z": ("Wm", 1.0)},
}
#: Running rms is taken over this time [s], and the reference day lasts so long [s].
RUNNING_S, DAY_S = 1.0, 8 * 3600.0
#: From here on rms understates shocks: crest factor; MTVV over rms; VDV over rms T^(1/4).
MOST_CREST, MOST_MTVV, MOST_VDV = 9.0, 1.5, 1.75
#: Least duration for bands from 0.5 Hz, and from 1 Hz on [s]: an error below 3 dB, 90 % sure.
LEAST_S = {0.5: 227.0, 1.0: 108.0}
# A sensor that shows gravity has an offset of that much; what is still taken for it.
_NEAR_GRAVITY = 0.03
# The offset is the mean of so many periods of the high-pass filter.
_OFFSET_PERIODS = 10.0
_BLOCK = 1 << 16
# Share of the sensor's range from which it counts as reached.
_FULL = 0.98
# Stretches between which a mean is seen to scatter, each of some seconds at least.
_STRETCHES, _STRETCH_S = 20, 5
#: The row of each axis in the samples of a recording.
Rows = dict[str, int]


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Action and limit values of a day.

    Parameters
    ----------
    action_ms2, limit_ms2 : float, > 0
        Of A(8) [m/s2].
    action_vdv, limit_vdv : float or None
        Of the vibration dose value [m/s^1.75].

    Raises
    ------
    FieldError
        If a value is out of its range or an action value above its limit.
    """

    action_ms2: float = within(0, 1e3, "m/s2", open_low=True)
    limit_ms2: float = within(0, 1e3, "m/s2", open_low=True)
    action_vdv: float | None = within(0, 1e3, "m/s^1.75", default=None, open_low=True)
    limit_vdv: float | None = within(0, 1e3, "m/s^1.75", default=None, open_low=True)

    def __post_init__(self) -> None:
        check_fields(self)
        for name in ("ms2", "vdv"):
            if (most := getattr(self, f"limit_{name}")) is not None:
                limit(self, f"action_{name}", 0, most, "", f"not above limit_{name}")


#: Limits of Directive 2002/44/EC.
LIMITS = {
    "seat": Limits(action_ms2=0.5, limit_ms2=1.15, action_vdv=9.1, limit_vdv=21.0),
    "hand": Limits(action_ms2=2.5, limit_ms2=5.0),
}
LIMITS["standing"] = LIMITS["seat"]


@dataclass(frozen=True, kw_only=True)
class AxisExposure(Result):
    """What is felt along one axis; all values without the factor k.

    Parameters
    ----------
    axis, channel, weighting : str
        Axis, its channel, and how it was weighted.
    factor : float
        k, by which the axis counts.
    mean_ms2 : float
        Offset that was taken off [m/s2].
    rms_ms2, peak_ms2, mtvv_ms2 : float
        Of the weighted acceleration: rms, largest size, largest running rms over 1 s [m/s2].
    crest_factor : float
        Peak over rms; 0 where nothing moves.
    vdv : float
        Vibration dose value of the recording [m/s^1.75].
    square_scatter, fourth_scatter : float or None
        Relative standard error of the mean square and of the mean fourth power, from stretches of
        the recording; None if it is too short for that.
    filter_error : float
        Largest relative error of the filter in the nominal range.
    """

    axis: str
    channel: str
    weighting: str
    factor: float
    mean_ms2: float
    rms_ms2: float
    peak_ms2: float
    mtvv_ms2: float
    crest_factor: float
    vdv: float
    square_scatter: float | None
    fourth_scatter: float | None
    filter_error: float

    def gain(self, frequency_hz: FloatArray) -> FloatArray:
        """Return k |W|, as how strong vibration at a frequency is felt."""
        response = WEIGHTINGS[self.weighting].response(frequency_hz)
        return np.asarray(self.factor * np.abs(response))


@dataclass(frozen=True, kw_only=True, eq=False)
class Exposure(Result):
    """What a person feels of one recording.

    Parameters
    ----------
    recording, position : str
    duration_s, sampling_rate_hz : float
    axes : tuple of AxisExposure
    value_ms2 : float
        What is compared with limits [m/s2]: of the hand a_hv, the vector sum; else the largest
        rms times k of an axis.
    value_axis : str
        Whose it is; "vector sum" of the hand.
    vector_sum_ms2 : float
        Root of the sum of (k rms)^2 over the axes [m/s2].
    vdv : float or None
        Largest k VDV of an axis [m/s^1.75]; None for the hand.
    limits : Limits or None
    advice : tuple of str
        Where the standard wants more than the rms.
    warnings : tuple of str
    running_ms2 : ndarray of float, shape (axes, seconds)
        k times the weighted rms of each second.
    band_hz : ndarray of float, shape (bands,)
        Centres of third octaves.
    band_ms2 : ndarray of float, shape (axes, bands)
        Rms of the acceleration as recorded, in third octaves [m/s2].

    Examples
    --------
    >>> felt = gearmon.vibration_exposure(new, "hand", {"x": "a1", "y": "a2"})
    >>> felt.times_s()["action_ms2"] == felt.time_to(felt.limits.action_ms2)
    True
    >>> [row["axis"] for row in felt.rows()], felt.weighted_band_ms2.shape == felt.band_ms2.shape
    (['x', 'y'], True)
    >>> felt.headline()[:5], felt.to_dict()["position"]
    ('0.194', 'hand')
    """

    picture: ClassVar[str] = "survey_plots.exposure_figure"

    recording: str
    position: str
    duration_s: float
    sampling_rate_hz: float
    axes: tuple[AxisExposure, ...]
    value_ms2: float
    value_axis: str
    vector_sum_ms2: float
    vdv: float | None
    limits: Limits | None
    advice: tuple[str, ...]
    warnings: tuple[str, ...]
    running_ms2: FloatArray
    band_hz: FloatArray
    band_ms2: FloatArray

    @property
    def weighted_band_ms2(self) -> FloatArray:
        """Third octaves times k and the weighting at their centres, shape (axes, bands)."""
        return np.asarray(self.band_ms2 * np.array([a.gain(self.band_hz) for a in self.axes]))

    def time_to(self, value: float | None, *, vdv: bool = False) -> float | None:
        """Return after how many seconds a day like this reaches a value; None if never.

        Parameters
        ----------
        value : float or None
            Of A(8) [m/s2], or of the dose value.
        vdv : bool
        """
        if value is None or not self.value_ms2 or (vdv and not self.vdv):
            return None
        if vdv:
            return self.duration_s * (value / (self.vdv or math.nan)) ** 4
        return DAY_S * (value / self.value_ms2) ** 2

    def times_s(self) -> dict[str, float | None]:
        """Return the times to each limit by its name, such as "limit_ms2" [s]."""
        named = vars(self.limits) if self.limits else {}
        return {name: self.time_to(own, vdv="vdv" in name) for name, own in named.items()}

    def headline(self) -> str:
        """Return value, axis and time to the action value in a sentence."""
        left = self.times_s().get("action_ms2")
        told = "" if left is None else f"; action value of a day after {left / 3600:.3g} h"
        return f"{self.value_ms2:.3g} m/s2 ({self.value_axis}, {self.position}){told}"

    def rows(self) -> list[dict[str, Any]]:
        """Return a row an axis."""
        return [{"recording": self.recording} | axis.to_dict() for axis in self.axes]

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types; times to the limits in seconds, no running rms."""
        whole = super().to_dict() | {"time_to_s": self.times_s()}
        del whole["running_ms2"]
        return whole


def vibration_exposure(
    recording: RecordingLike,
    position: str = "seat",
    axes: Mapping[str, str | int] | None = None,
    *,
    sampling_rate_hz: float | None = None,
    unit: str | None = None,
    sensors: Iterable[Sensor] = (),
    range_ms2: float | None = None,
    limits: Limits | None = None,
) -> Exposure:
    """Weigh a recording as the human body does.

    Parameters
    ----------
    recording : str, Path, array, DataFrame or Recording
        Accelerations in m/s2 or g, of one to three axes. A file of any size is read to disk.
    position : {"seat", "hand", "standing", "backrest", "feet", "building"}
        Where the vibration enters.
    axes : mapping of str to str or int, optional
        Channel of each axis "x", "y", "z"; by default those that are named so (z along the spine,
        x forwards; on the hand z along the forearm).
    sampling_rate_hz, unit, sensors
        As of `gearmon.read_recording`.
    range_ms2 : float, > 0, optional
        Largest acceleration that the sensor takes [m/s2]; a recording that reaches it is refused.
    limits : Limits, optional
        By default those of Directive 2002/44/EC.

    Returns
    -------
    Exposure

    Raises
    ------
    RecordingError
        If axes are missing or look exchanged, a channel is clipped, its unit is no acceleration or
        looks wrong, or the recording is too short.
    ArgumentError
        If an argument is out of its range, or the rate lower than the weighting needs.

    Examples
    --------
    >>> felt = gearmon.vibration_exposure(new, "hand", {"x": "a1", "y": "a2"})
    >>> felt.value_axis, felt.duration_s
    ('vector sum', 3.0)
    """
    check_word("position=", position, POSITIONS)
    told = dict(axes or {})
    for axis in told:
        check_word("axes: axis ", axis, POSITIONS[position])
    if len(set(told.values())) < len(told):
        raise ArgumentError(f"axes: {told} name one channel for two axes; each needs its own")
    found = read_recording(
        recording,
        sampling_rate_hz,
        list(told.values()) or None,
        sensors=sensors,
        unit=unit,
        on_disk=isinstance(recording, str | Path),
    )
    rows = _rows(found, told, position)
    _check_samples(found, rows, position, range_ms2)
    weigh = partial(_weighed, found, position, rows)
    felt, seconds = zip(*side_by_side(weigh, list(rows), found.samples.size), strict=True)
    counted = {own.axis: own.factor * own.rms_ms2 for own in felt}
    worst, total = max(counted, key=lambda axis: counted[axis]), math.hypot(*counted.values())
    by_sum = position == "hand"
    centres, bands = _third_octaves(found, rows, WEIGHTINGS[felt[0].weighting])
    return Exposure(
        recording=found.origin,
        position=position,
        duration_s=found.duration_s,
        sampling_rate_hz=found.sampling_rate_hz,
        axes=felt,
        value_ms2=total if by_sum else counted[worst],
        value_axis="vector sum" if by_sum else worst,
        vector_sum_ms2=total,
        vdv=None if by_sum else max(own.factor * own.vdv for own in felt),
        limits=limits or LIMITS.get(position),
        advice=tuple(_advice(felt, found.duration_s)),
        warnings=(*found.notes, *_warnings(found, position, felt)),
        running_ms2=np.array(seconds),
        band_hz=centres,
        band_ms2=bands,
    )


def _rows(found: Recording, told: Mapping[str, str | int], position: str) -> Rows:
    """Return the row of each axis in the samples."""
    if told:
        return {axis: found.row_of(told[axis]) for axis in POSITIONS[position] if axis in told}
    named: dict[str, list[int]] = {}
    for row, name in enumerate(found.channel_names):
        match = re.fullmatch(r"(?:.*[\W_])?(?:a|acc)?([xyz])", name.lower())
        if match and found.channel_kinds[row] == "vibration":
            named.setdefault(match[1], []).append(row)
    if not named or any(len(several) > 1 for several in named.values()):
        notes = "".join(f" ({note})" for note in found.notes)
        raise RecordingError(
            f"{found.origin}: which channel is which axis? {', '.join(found.channel_names)} do not "
            f"tell{notes}; name them: --axes x=1,y=2,z=3"
        )
    return {axis: named[axis][0] for axis in POSITIONS[position] if axis in named}


def _check_samples(found: Recording, rows: Rows, position: str, range_ms2: float | None) -> None:
    """Refuse what would be weighed but was not felt: wrong units, clipped samples, wrong axes."""
    where, weighting = found.origin, WEIGHTINGS[POSITIONS[position][next(iter(rows))][0]]
    weighting.sections(found.sampling_rate_hz)  # refuses a rate that is too low
    least_s = max(RUNNING_S, 1 / weighting.limits_hz[0])
    if found.duration_s < least_s:
        raise RecordingError(
            f"{where}: {found.duration_s:.3g} s are too short for {weighting.name}, which needs "
            f"{least_s:.3g} s at least, and minutes to be representative"
        )
    for row in rows.values():
        if told := _trouble(found.samples[row], found.units[row], range_ms2):
            raise RecordingError(f"{where}: channel {found.channel_names[row]} {told}")
    # an offset may be gravity: in the right unit, and along the right axis
    offsets = {axis: float(found.samples[row].mean()) for axis, row in rows.items()}
    size = math.hypot(*offsets.values())
    mistaken = {1.0: "g were read as m/s2: the unit must be g", STANDARD_GRAVITY**2: "m/s2 were "
                "read as g: the unit must be m/s2"}  # fmt: skip
    for standing, told in mistaken.items():
        if abs(size / standing - 1) <= _NEAR_GRAVITY:
            raise RecordingError(
                f"{where}: a mean of {size:.4g} m/s2 is gravity in the wrong unit; {told} (if it "
                "is an offset of the sensor, take it off first)"
            )
    axis = max(offsets, key=lambda own: abs(offsets[own]))
    leaning = abs(offsets[axis]) / STANDARD_GRAVITY
    if position in ("seat", "standing", "feet") and axis != "z" and 0.9 <= leaning <= 1.1:
        raise RecordingError(
            f"{where}: axis {axis} has a mean of {offsets[axis]:.3g} m/s2, which is gravity, but z "
            "is the one along the spine; the axes are exchanged: correct --axes"
        )


def _trouble(values: FloatArray, unit: str | None, range_ms2: float | None) -> str:
    """Say what is wrong with a channel, and what to do; "" if nothing is."""
    if unit != "m/s2":
        told = f"has unit {unit or 'not stated'}; exposure needs acceleration in m/s2 or g"
        return f"{told}: state it in the heading, a [[sensor]] or --unit"
    if (defect := find_defect(values)) is not None:
        return f"{defect.text}; check sensor, cable and range, and record again"
    if range_ms2 is not None:
        peak = max(float(values.max()), -float(values.min()))
        if peak >= _FULL * check_positive("range_ms2", range_ms2, "m/s2"):
            told = f"reaches {peak:.4g} m/s2 of the sensor's range of {range_ms2:g} m/s2"
            return f"{told}; take a sensor of a larger range, and record again"
    return ""


def _weighed(
    found: Recording, position: str, rows: Rows, axis: str
) -> tuple[AxisExposure, FloatArray]:
    """Filter one channel block by block, and keep what its measures need."""
    from scipy.signal import sosfilt

    row, (name, factor) = rows[axis], POSITIONS[position][axis]
    samples, rate, weighting = found.samples[row], found.sampling_rate_hz, WEIGHTINGS[name]
    sections = weighting.sections(rate)
    offset = float(samples[: round(_OFFSET_PERIODS / weighting.limits_hz[0] * rate)].mean())
    state = np.zeros((len(sections), 2))
    window = max(1, round(RUNNING_S * rate))
    block = window * max(1, _BLOCK // window)  # whole windows, so that seconds end with blocks
    last, highest, most, sums = np.zeros(0), 0.0, 0.0, np.zeros(2)
    seconds: list[FloatArray] = []
    for start in range(0, len(samples), block):
        weighted, state = sosfilt(sections, samples[start : start + block] - offset, zi=state)
        squares = np.square(weighted, out=weighted)
        highest = max(highest, float(squares.max()))
        joined = np.concatenate([last, squares])
        # the largest mean over a window that lies wholly within the samples
        total = np.append(0.0, np.cumsum(joined))
        most = max(most, float((total[window:] - total[:-window]).max(initial=0.0)) / window)
        last = joined[len(joined) - window + 1 :]
        sums += squares.sum(), np.square(squares).sum()
        whole = squares[: len(squares) // window * window].reshape(-1, window)
        seconds.append(np.array([whole.mean(axis=1), np.einsum("ij,ij->i", whole, whole) / window]))
    square, fourth = np.concatenate(seconds, axis=1)
    rms, peak = math.sqrt(sums[0] / len(samples)), math.sqrt(highest)
    values = AxisExposure(
        axis=axis,
        channel=found.channel_names[row],
        weighting=name,
        factor=factor,
        mean_ms2=offset,
        rms_ms2=rms,
        peak_ms2=peak,
        mtvv_ms2=math.sqrt(most),
        crest_factor=peak / rms if rms else 0.0,
        vdv=float(sums[1] / rate) ** 0.25,
        square_scatter=_scatter(square),
        fourth_scatter=_scatter(fourth),
        filter_error=weighting.error(rate),
    )
    return values, factor * np.sqrt(square)


def _scatter(seconds: FloatArray) -> float | None:
    """Relative standard error of a mean, from stretches that are taken for independent."""
    count = min(_STRETCHES, len(seconds) // _STRETCH_S)
    if count < 2 or not seconds.any():
        return None
    means = np.array([part.mean() for part in np.array_split(seconds, count)])
    return float(means.std(ddof=1) / math.sqrt(count) / means.mean())


def _third_octaves(
    found: Recording, rows: Rows, weighting: Weighting
) -> tuple[FloatArray, FloatArray]:
    """Return centres 10^(n/10) and rms of bands, from Welch's spectrum of long blocks."""
    rate, count = found.sampling_rate_hz, found.samples.shape[1]
    low, high = weighting.band_hz
    top = min(10 * math.log10(high) + 1, 10 * math.log10(0.5 * rate / HALF_BAND))
    centres = 10 ** (np.arange(round(10 * math.log10(low)), math.floor(top + 1e-9) + 1) / 10)
    # four bins in the narrowest band where the recording has room
    narrow = low * (HALF_BAND - 1 / HALF_BAND)
    block = min(2 ** math.ceil(math.log2(4 * rate / narrow)), 2 ** int(math.log2(count)))
    edges = np.append(centres / HALF_BAND, centres[-1] * HALF_BAND)
    bands = []
    for row in rows.values():
        spectrum = power_density(found.samples[row], rate, block)
        step = float(spectrum.frequency_hz[1])
        power = spectrum.values[0] * step
        power[:2] = 0.0  # the window spreads the offset over these
        below = np.interp(edges, spectrum.frequency_hz + step / 2, np.cumsum(power))
        bands.append(np.sqrt(np.maximum(np.diff(below), 0.0)))
    return centres, np.array(bands)


def _advice(axes: Iterable[AxisExposure], duration_s: float) -> Iterator[str]:
    """Say where ISO 2631-1 holds the rms for too low, because of shocks."""
    body = [own for own in axes if own.weighting != "Wh" and own.rms_ms2]
    ratios: tuple[tuple[str, float, Callable[[AxisExposure], float]], ...] = (
        ("crest factor", MOST_CREST, lambda own: own.crest_factor),
        ("MTVV over rms", MOST_MTVV, lambda own: own.mtvv_ms2 / own.rms_ms2),
        ("VDV over rms T^(1/4)", MOST_VDV, lambda own: own.vdv / own.rms_ms2 / duration_s**0.25),
    )
    for name, most, ratio in ratios:
        above = [f"{own.axis} {ratio(own):.3g}" for own in body if ratio(own) > most]
        if above:
            yield f"{name} above {most:g} ({', '.join(above)}): shocks; rms understates, judge VDV"


def _warnings(found: Recording, position: str, axes: tuple[AxisExposure, ...]) -> Iterator[str]:
    weighting, rate = WEIGHTINGS[axes[0].weighting], found.sampling_rate_hz
    have = [own.axis for own in axes]
    missing = [axis for axis in POSITIONS[position] if axis not in have]
    if missing:
        yield f"axes not measured: {', '.join(missing)}; the value may be too low"
    if rate < 2 * weighting.tolerances_hz[3]:
        yield (
            f"sampled at {rate:.6g} Hz: nothing above {rate / 2:.4g} Hz is counted, and aliases "
            f"are; the filter is within {100 * max(a.filter_error for a in axes):.2g} %"
        )
    least = LEAST_S.get(weighting.band_hz[0])
    if least is not None and found.duration_s < least:
        yield (
            f"{found.duration_s:.4g} s are too short for the statistics of VDV and of bands from "
            f"{weighting.band_hz[0]:g} Hz; record {least:g} s at least (ISO 2631-1, 5.5)"
        )


@dataclass(frozen=True, kw_only=True)
class SeatFactor(Result):
    """How much of the floor's vibration a seat lets through, axis by axis.

    Parameters
    ----------
    seat, floor : str
        The recordings.
    axes : tuple of str
    seat_rms, seat_vdv : tuple of float
        SEAT factor by rms and by dose value, both weighted as on the seat; below 1 it helps.
    """

    seat: str
    floor: str
    axes: tuple[str, ...]
    seat_rms: tuple[float, ...]
    seat_vdv: tuple[float, ...]

    def rows(self) -> list[dict[str, Any]]:
        """Return a row an axis."""
        names = ("axis", "seat_rms", "seat_vdv")
        columns = zip(self.axes, self.seat_rms, self.seat_vdv, strict=True)
        return [dict(zip(names, own, strict=True)) for own in columns]


def seat_factor(seat: Exposure, floor: Exposure) -> SeatFactor:
    """Compare the exposure on a seat with that on the floor under it, recorded at once.

    Parameters
    ----------
    seat, floor : Exposure
        Of one position, "seat": the weighting of the seat counts for both.

    Returns
    -------
    SeatFactor

    Raises
    ------
    ArgumentError
        If they were weighted differently, have no axis in common, or the floor does not move.

    Examples
    --------
    >>> floor, seat = ({"x": "a1", "y": "a2"}, {"x": "a2", "y": "a1"})
    >>> felt = [gearmon.vibration_exposure(new, "seat", axes) for axes in (seat, floor)]
    >>> gearmon.seat_factor(*felt).axes
    ('x', 'y')
    """
    for name, own in (("seat", seat), ("floor", floor)):
        check_type(name, own, Exposure, "what gearmon.vibration_exposure returns")
    pairs = [(s, f) for s in seat.axes for f in floor.axes if s.axis == f.axis]
    if not pairs or any(s.weighting != f.weighting for s, f in pairs):
        raise ArgumentError(
            f"SEAT: {seat.position} and {floor.position} are not weighted alike along a common "
            "axis; weigh both recordings at one position"
        )
    if not all(f.rms_ms2 > 0 for _, f in pairs):
        raise ArgumentError(f"SEAT: {floor.recording}: the floor does not move")
    longer = (floor.duration_s / seat.duration_s) ** 0.25
    return SeatFactor(
        seat=seat.recording,
        floor=floor.recording,
        axes=tuple(s.axis for s, _ in pairs),
        seat_rms=tuple(s.rms_ms2 / f.rms_ms2 for s, f in pairs),
        seat_vdv=tuple(s.vdv / f.vdv * longer for s, f in pairs),
    )
