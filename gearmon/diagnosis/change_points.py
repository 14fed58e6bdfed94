"""When did it begin: change points of a short, unevenly spaced, unevenly certain series.

A change is either *growth* from any time after the first recording on or a *step* between two
neighbouring recordings. Growth is found as a kink ``b max(0, t - tau)``, to which any that speeds
up is close enough; when it began and how it bends is then told by `onsets`. The penalty for
assuming a change is not a matter of taste: it is the bound on the probability that noise alone
correlates as well with any kink or step.

References
----------
I. Johnstone and D. Siegmund, On Hotelling's formula for the volume of tubes and Naiman's
inequality, Ann. Statist. 17 (1989), for the bound; M. Knowles, D. Siegmund and H. Zhang, Confidence
regions in semilinear regression, Biometrika 78 (1991), for its use on kinks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.change_shapes import (
    ChangePoint,
    Series,
    base_columns,
    directions,
    kinks,
    path_length,
    steps,
)
from gearmon.diagnosis.noise_bounds import known_noise_bound, tube_bound
from gearmon.diagnosis.onsets import shaped, with_interval
from gearmon.errors import ArgumentError, check_range

FloatArray = NDArray[np.float64]

#: Fewest recordings on which a change is looked for.
FEWEST = 6
#: Changes that are looked for one after the other.
MOST_CHANGES = 3
#: A change has to be this improbable even without the recording that speaks for it most.
WITHOUT_ONE = 0.05
#: Share of the false-alarm probability for growth that was undone, which is looked for only where
#: the scatter is so many times what was stated.
_PAIR_SHARE, _UNEXPLAINED = 0.2, 1.5


def find_changes(
    series: Series, *, below: float = 0.01, level: float = 0.9, most: int = MOST_CHANGES
) -> tuple[ChangePoint, ...]:
    """Find the changes of a series that noise would not make.

    Parameters
    ----------
    series : Series
        The scatter about the trend sets the scale of the noise; where the standard deviations are
        known in size, noise is held to be at least that.
    below : float, in (0, 0.5]
        Probability of calling any change in a series without one.
    level : float, in (0, 1)
        Of the intervals of their times.
    most : int
        Changes looked for; each further one is tested against those found before.

    Returns
    -------
    tuple of ChangePoint
        In the order of time.

    Raises
    ------
    ArgumentError
        If a level is out of its range.

    Notes
    -----
    With the mean (and the changes already found) projected out, Gaussian noise points into a
    direction that is uniform on the sphere of the remaining m dimensions. The places of a kink are
    a curve on that sphere, of length kappa; that the noise comes within an angle arccos(c) of it
    has a probability of at most ``kappa / 2 pi (1 - c^2)^(m/2 - 1) + P(B(1/2, (m-1)/2) >= c^2) /
    2``, for either sign. Recordings are taken as independent. Where the standard deviations are
    known, a change also has to be larger than noise of that size would make it: values that scatter
    less than they are said to be sure of tell nothing below that.
    """
    check_range("below", below, 0.0, 0.5)
    check_range("level", level, 0.0, 1.0)
    found: list[ChangePoint] = []
    if len(series) >= FEWEST and most > 1:
        found = _repaired(series, _PAIR_SHARE * below)
    while len(found) < most and len(series) >= FEWEST + 2 * len(found):
        best = _search(series, found)
        allowed = below if found else (1.0 - _PAIR_SHARE) * below
        if best is None or best.false_alarm_probability >= allowed:
            break
        if not _borne(series, found, best):
            break
        found = _refined(series, [*found, shaped(series, best, found)], below)
    placed = [with_interval(series, one, _others(found, one), level) for one in found]
    return _sized(series, sorted(placed, key=lambda change: change.time_s))


def change_probability(series: Series) -> float:
    """Bound on the probability that noise gives a change as clear as the clearest of a series.

    Parameters
    ----------
    series : Series

    Returns
    -------
    float
        In [0, 1]; 1 for series too short to bear a change.
    """
    best = _search(series, []) if len(series) >= FEWEST else None
    return 1.0 if best is None else best.false_alarm_probability


def _others(found: Sequence[ChangePoint], one: ChangePoint) -> list[ChangePoint]:
    return [change for change in found if change is not one]


def _repaired(series: Series, below: float) -> list[ChangePoint]:
    """Return growth with the step that undid it, where neither shows without the other.

    Each step is taken for granted in turn; what then shows is charged with the number of steps.
    """
    mean = np.average(series.value, weights=series.sigma**-2.0)
    scatter = np.sqrt(np.mean(((series.value - mean) / series.sigma) ** 2))
    if not series.sigma_known or scatter < _UNEXPLAINED or len(series) < FEWEST + 2:
        return []
    single = _search(series, [])
    if single is not None and single.false_alarm_probability < below:
        return []
    places = steps(series.time_s)[0]
    best: list[ChangePoint] = []
    for place in places:
        step = ChangePoint(
            kind="step",
            time_s=float(place),
            low_s=float(series.time_s[0]),
            high_s=float(series.time_s[-1]),
            open_before=True,
            size=0.0,
            false_alarm_probability=1.0,
        )
        other = _search(series, [step])
        if other is None or other.false_alarm_probability * len(places) >= below:
            continue
        if not best or other.false_alarm_probability < best[1].false_alarm_probability:
            best = [step, other]
    if not best or not _borne(series, best[:1], best[1]):
        return []
    return _refined(series, best, below)


def _borne(series: Series, known: Sequence[ChangePoint], change: ChangePoint) -> bool:
    """Tell whether a change stands without the recording that speaks for it most.

    A single wrong estimate at one end of a series looks like growth, and no law of its noise holds.
    """
    weight = 1.0 / series.sigma
    base = base_columns(series.time_s, known, with_tangents=False) * weight[:, None]
    basis = np.linalg.qr(base)[0]
    columns = np.column_stack([change.column(series.time_s), series.value]) * weight[:, None]
    shape, rest = (columns - basis @ (basis.T @ columns)).T
    kept = np.arange(len(series)) != np.argmax(shape * rest * np.sign(shape @ rest))
    fewer = replace(
        series,
        time_s=series.time_s[kept],
        value=series.value[kept],
        sigma=series.sigma[kept],
    )
    without = _search(fewer, known)
    return without is not None and without.false_alarm_probability < WITHOUT_ONE


def permuted_probability(series: Series, *, permutations: int = 4999, seed: int = 0) -> float:
    """Probability that a series in random order shows a change as clear as this one.

    Parameters
    ----------
    series : Series
        Its standard deviations must be equal.
    permutations : int, > 0
        Random orders.
    seed : int
        Of these.

    Returns
    -------
    float
        ``(1 + orders at least as clear) / (1 + permutations)``: exact whatever the law of the
        values, if their order has no meaning; never below ``1 / (1 + permutations)``. 1 for a
        series too short or without any variation.

    Raises
    ------
    ArgumentError
        If the standard deviations differ.
    """
    if len(series) and np.ptp(series.sigma) > 0:
        raise ArgumentError("sigma: must be equal, or the order has a meaning")
    if len(series) < FEWEST:
        return 1.0
    rest = series.value - series.value.mean()
    if float(np.abs(rest).max()) <= 1e-12 * float(np.abs(series.value).max()):
        return 1.0
    basis = np.full((len(series), 1), 1.0 / math.sqrt(len(series)))
    shapes = [rows for _, rows in (kinks(series.time_s), steps(series.time_s))]
    paths = np.vstack([directions(rows, basis)[0] for rows in shapes])
    generator = np.random.default_rng(seed)
    clearest = float(np.abs(paths @ rest).max())
    as_clear = 0
    for start in range(0, permutations, 500):
        count = min(500, permutations - start)
        orders = generator.permuted(np.tile(rest, (count, 1)), axis=1)
        peaks = np.abs(paths @ orders.T).max(axis=0)
        # the same order, up to rounding, is as clear
        as_clear += int(np.sum(peaks >= clearest * (1.0 - 1e-9)))
    return (1 + as_clear) / (1 + permutations)


def _refined(series: Series, found: list[ChangePoint], below: float) -> list[ChangePoint]:
    """Place each change anew while the others stand, and drop what noise then explains."""
    for _ in range(3 if len(found) > 1 else 0):
        for number, change in enumerate(found):
            better = _search(series, _others(found, change))
            if better is not None:
                found[number] = shaped(series, better, _others(found, change))
    return [change for change in found if change.false_alarm_probability < below]


def _search(series: Series, known: Sequence[ChangePoint]) -> ChangePoint | None:
    """Return the clearest change beside those known."""
    base = base_columns(series.time_s, known, with_tangents=True)
    weight = 1.0 / series.sigma
    basis = np.linalg.qr(base * weight[:, None])[0]
    rest = series.value * weight
    rest = rest - basis @ (basis.T @ rest)
    size = float(np.linalg.norm(rest))
    left = len(series) - base.shape[1]
    if left < 3 or size <= 1e-12 * float(np.linalg.norm(series.value * weight)):
        return None
    if series.sigma_known and 2.0 * known_noise_bound(size, 0.0) >= 1.0:
        return None  # whatever the shape, the probability of the two families is 1
    families = [kinks(series.time_s), steps(series.time_s)]
    best: tuple[float, str, float] | None = None
    bounds = []
    for kind, (places, columns) in zip(("growth", "step"), families, strict=True):
        paths, kept = directions(columns * weight, basis)
        if not len(paths):
            continue
        along = paths @ rest / size
        peak = int(np.argmax(np.abs(along)))
        bounds.append(path_length(paths))
        if best is None or abs(along[peak]) > best[0]:
            best = (float(abs(along[peak])), kind, float(places[kept][peak]))
    if best is None:
        return None
    closeness, kind, place = best
    probability = min(1.0, sum(tube_bound(closeness, length, left) for length in bounds))
    if series.sigma_known:
        least = sum(known_noise_bound(closeness * size, length) for length in bounds)
        probability = max(probability, min(1.0, least))
    return ChangePoint(
        kind=kind,
        time_s=place,
        low_s=float(series.time_s[0]),
        high_s=float(series.time_s[-1]),
        open_before=True,
        size=0.0,
        false_alarm_probability=probability,
    )


def _sized(series: Series, changes: Sequence[ChangePoint]) -> tuple[ChangePoint, ...]:
    """Fit the sizes of all changes together."""
    columns = base_columns(series.time_s, changes, with_tangents=False) / series.sigma[:, None]
    scale = np.linalg.norm(columns, axis=0)
    sizes = np.linalg.lstsq(columns / scale, series.value / series.sigma, rcond=None)[0] / scale
    return tuple(
        replace(change, size=float(size)) for change, size in zip(changes, sizes[1:], strict=True)
    )
