"""The sampling rate from a column of time stamps."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gearmon.signals.reading.rounding import Floats

Flags = npt.NDArray[np.bool_]

# Deviation of a stamp from even spacing, in sampling intervals, beyond what rounding explains.
_JITTER = 0.1
# Rounding to more than this share of an interval hides lost samples.
_COARSE = 0.75
# ... and to more than this share hides them from the differences, though not from a straight line.
_DOUBTFUL = 0.45
_DRIFT = 1e-3
_CHUNK = 2**18


@dataclass(frozen=True, kw_only=True)
class Spacing:
    """How time stamps follow each other.

    Parameters
    ----------
    step : float > 0
        Mean difference over the whole span, in the unit of the stamps.
    uncertainty : float
        Relative uncertainty of the step that rounding of the stamps leaves, at most.
    coarse : bool
        Whether the stamps are rounded so much that neighbours are alike or nearly so.
    fault : str
        What is irregular; "" if nothing.
    row : int
        Index of the stamp where that shows first.
    """

    step: float
    uncertainty: float = 0.0
    coarse: bool = False
    fault: str = ""
    row: int = 0


def spacing(stamps: Floats) -> Spacing:
    """Return the spacing of time stamps, and what is irregular about it.

    Rounding of the stamps when they were printed is allowed for: their resolution is the last
    decimal that any of them uses.

    Parameters
    ----------
    stamps : ndarray of float64, shape (n,), n >= 2
        Finite time stamps.

    Examples
    --------
    >>> spacing(np.array([0.0, 0.001, 0.002, 0.004])).fault
    'a step of 0.002 where 0.001 is usual: about 1 sample is missing'
    """
    step = float(stamps[-1] - stamps[0]) / (len(stamps) - 1)
    usual, exact = _usual_step(stamps)
    backwards = _first(stamps, lambda steps: steps < 0)
    if backwards >= 0 or usual < 0 or step <= 0:
        return _backward(stamps, step, max(backwards, 1))
    resolution = _resolution(stamps)
    if exact and resolution > _DOUBTFUL * step:
        resolution = 0.0  # a step such as 0.001 with three decimals: nothing was rounded
    if resolution > _COARSE * step:
        found = _coarse(stamps, step, resolution)
    else:
        found = _fine(stamps, step, usual, resolution)
    if exact or found.fault:
        return found
    return replace(found, step=_slope(stamps), uncertainty=resolution / (step * len(stamps)))


def counts_evenly(values: Floats) -> bool:
    """Tell whether the values go up by exactly 1 from each sample to the next."""
    return len(values) > 1 and _first(values, lambda steps: steps != 1) < 0


def rises_evenly(values: Floats) -> bool:
    """Tell whether the values look like time stamps: strictly rising by nearly equal steps."""
    # the ends decide for nearly every channel; a NaN anywhere shows in the extremes
    if len(values) < 3 or not (values[1] > values[0] and values[-1] > values[-2]):
        return False
    if not np.isfinite(values.max() - values.min()) or values[-1] <= values[0]:
        return False
    found = spacing(values)
    return not found.fault and not found.coarse


def _backward(stamps: Floats, step: float, row: int) -> Spacing:
    before, after = stamps[row - 1], stamps[row]
    what = f"comes after {before:.9g}" if after < before else "is repeated"
    fault = f"{after:.9g} {what}"
    return Spacing(step=abs(step), fault=fault, row=row)


def _fine(stamps: Floats, step: float, usual: float, resolution: float) -> Spacing:
    repeated = _first(stamps, lambda steps: steps == 0)
    if repeated >= 0:
        return Spacing(step=step, fault=f"{stamps[repeated]:.9g} is repeated", row=repeated)
    tolerance = resolution + _JITTER * usual
    uneven = _first(stamps, lambda steps: np.abs(steps - usual) > tolerance)
    if uneven >= 0:
        return Spacing(step=step, fault=_uneven(stamps, uneven, usual), row=uneven)
    if resolution > _DOUBTFUL * step:
        row = _off_line(stamps, 0.5 * resolution + _JITTER * step)
        if row >= 0:
            fault = f"{stamps[row]:.9g} is off the even spacing of {step:.6g}"
            return Spacing(step=step, fault=fault, row=row)
    return _undrifted(stamps, step, resolution)


def _undrifted(stamps: Floats, step: float, resolution: float) -> Spacing:
    half = len(stamps) // 2
    if half > 1:
        early = float(stamps[half] - stamps[0]) / half
        late = float(stamps[-1] - stamps[half]) / (len(stamps) - 1 - half)
        if abs(late - early) > _DRIFT * step + 4 * resolution / half:
            fault = f"the step changes from {early:.6g} to {late:.6g} between its two halves"
            return Spacing(step=step, fault=fault, row=half)
    return Spacing(step=step)


def _coarse(stamps: Floats, step: float, resolution: float) -> Spacing:
    row = _off_line(stamps, resolution + _JITTER * step)
    fault = f"{stamps[row]:.9g} is off the even spacing of {step:.6g}" if row >= 0 else ""
    return Spacing(step=step, coarse=True, fault=fault, row=max(row, 0))


def _uneven(stamps: Floats, row: int, usual: float) -> str:
    found = float(stamps[row] - stamps[row - 1])
    lost = round(found / usual) - 1
    text = f"a step of {found:.6g} where {usual:.6g} is usual"
    if lost < 1 or abs(found / usual - lost - 1) > 0.2:
        return text
    return f"{text}: about {lost} {'sample is' if lost == 1 else 'samples are'} missing"


def _usual_step(stamps: Floats) -> tuple[float, bool]:
    """Return the median step, and whether nearly all steps are equal to it (nothing rounded)."""
    steps = np.diff(stamps[: 2 * _CHUNK])
    if len(stamps) > 2 * _CHUNK:
        steps = np.concatenate([steps[:_CHUNK], np.diff(stamps[-_CHUNK:])])
    usual = float(np.median(steps))
    slack = 1e-6 * abs(usual) + 4 * np.spacing(np.abs(stamps[[0, -1]]).max())
    others = int(np.count_nonzero(np.abs(steps - usual) > slack))
    return usual, others <= max(1, 0.01 * len(steps))


def _resolution(stamps: Floats) -> float:
    """Return the unit of the last decimal of the stamps, or of their single precision."""
    ends = np.concatenate([stamps[:1000], stamps[-1000:]])
    with np.errstate(over="ignore"):
        single = ends.astype(np.float32).astype(np.float64)
    if np.all(np.abs(ends - single) <= 1e-9 * np.abs(ends)):
        return float(np.spacing(np.float32(np.abs(ends).max())))
    return max(_last_decimal(stamps[:1000]), _last_decimal(stamps[-1000:]))


def _last_decimal(stamps: Floats) -> float:
    for decimals in range(-3, 16):
        if np.array_equal(np.round(stamps, decimals), stamps):
            return float(10.0**-decimals)
    return 0.0


def _first(stamps: Floats, wrong: Callable[[Floats], Flags]) -> int:
    """Return the index of the first stamp whose step from the one before is wrong; -1: none."""
    for start, steps in _steps(stamps):
        bad = wrong(steps)
        if bad.any():
            return start + int(bad.argmax()) + 1
    return -1


def _steps(stamps: Floats) -> Iterator[tuple[int, Floats]]:
    for start in range(0, len(stamps) - 1, _CHUNK):
        yield start, np.diff(stamps[start : start + _CHUNK + 1])


def _slope(stamps: Floats) -> float:
    """Return the mean step as the slope of the best straight line: rounding averages out."""
    middle, mean = 0.5 * (len(stamps) - 1), float(stamps.mean())
    moment = 0.0
    for start in range(0, len(stamps), _CHUNK):
        part = stamps[start : start + _CHUNK] - mean
        moment += float(part @ (np.arange(start, start + len(part)) - middle))
    return moment * 12.0 / (len(stamps) * (len(stamps) ** 2 - 1.0))


def _off_line(stamps: Floats, tolerance: float) -> int:
    """Return the index of the stamp farthest from their straight line if too far; else -1."""
    middle, mean, slope = 0.5 * (len(stamps) - 1), float(stamps.mean()), _slope(stamps)
    worst, row = tolerance, -1
    for start in range(0, len(stamps), _CHUNK):
        part = stamps[start : start + _CHUNK] - mean
        off = np.abs(part - slope * (np.arange(start, start + len(part)) - middle))
        if off.max() > worst:
            worst, row = float(off.max()), start + int(off.argmax())
    return row
