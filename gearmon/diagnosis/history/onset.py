"""When did it begin: changes of a short, unevenly spaced, unevenly certain series.

A change is either *growth* from any time after the first recording on or a *step* between two
neighbouring recordings. Growth is found as a kink ``b max(0, t - tau)``, to which any that speeds
up is close enough. The penalty for assuming a change is not a matter of taste: it is the bound on
the probability that noise alone correlates as well with any kink or step.

A crack grows faster the larger it is, and a straight line through such growth meets the level
before it far too late: when it began can only be told along with how it bends. Along the courses
(straight, powers of time, exponentials) one trades off against the other, so that the likelihood is
flat along a ridge. The interval is the profile over all courses, joined with the credible interval
of even chances: the first alone ends a little too soon where the courses tried lie far apart for
the noise. The time itself is the median of what the courses and places leave possible, whose bias
is a small part of that of a kink.

References
----------
I. Johnstone and D. Siegmund, On Hotelling's formula for the volume of tubes and Naiman's
inequality, Ann. Statist. 17 (1989), for the bound; M. Knowles, D. Siegmund and H. Zhang, Confidence
regions in semilinear regression, Biometrika 78 (1991), for its use on kinks; Y.-C. Yao,
Approximating the distribution of the maximum likelihood estimate of the change-point, Ann. Statist.
15 (1987), for the two-sided walk about a step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.history.noise_bounds import (
    kink_quantile,
    known_noise_bound,
    step_quantile,
    tube_bound,
)
from gearmon.diagnosis.history.shapes import (
    CHANCES,
    GROWTHS,
    STEP,
    STRAIGHT,
    ChangePoint,
    Growth,
    Series,
    change_columns,
    growth_rows,
)
from gearmon.errors import ArgumentError, check_range

FloatArray = NDArray[np.float64]

#: Fewest recordings on which a change is looked for, and that must bear one: one that stands out is
#: not yet a change.
FEWEST, BORNE_BY = 6, 2
#: Changes that are looked for one after the other.
MOST_CHANGES = 3
#: A change has to be this improbable even without the recording that speaks for it most.
WITHOUT_ONE = 0.05
#: Share of the false-alarm probability for growth that was undone, which is looked for only where
#: the scatter is so many times what was stated.
_PAIR_SHARE, _UNEXPLAINED = 0.2, 1.5
# Places of a change that are tried between two recordings, and in all: to find it (fewer of long
# series, for the sake of time), and to time it.
_BETWEEN, _MOST_NUMBERS, _FOUND_AT, _TIMED_AT = 16, 400_000, (200, 4000), (320, 1000)
_TINY = np.finfo(float).tiny


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
    enough = len(series) >= FEWEST and most > 1
    found = _repaired(series, _PAIR_SHARE * below) if enough else []
    while len(found) < most and len(series) >= FEWEST + 2 * len(found):
        best = _search(series, found)
        allowed = below if found else (1.0 - _PAIR_SHARE) * below
        if best is None or best.false_alarm_probability >= allowed:
            break
        if not _borne(series, found, best):
            break
        found = _refined(series, [*found, _bent(series, best, found)], below)
    placed = [_timed(series, one, _others(found, one), level) for one in found]
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
    if len(series) < FEWEST or np.ptp(series.value) <= 1e-12 * np.abs(series.value).max():
        return 1.0
    rows = [_tried(series, growth)[1] for growth in (STRAIGHT, STEP)]
    paths, _, rest = _beside(series, change_columns(series.time_s, []), np.concatenate(rows))
    generator = np.random.default_rng(seed)
    clearest, as_clear = float(np.abs(paths @ rest).max()), 0
    for start in range(0, permutations, 500):
        count = min(500, permutations - start)
        orders = generator.permuted(np.tile(rest, (count, 1)), axis=1)
        # the same order, up to rounding, is as clear
        peaks = np.abs(paths @ orders.T).max(axis=0)
        as_clear += int(np.sum(peaks >= clearest * (1.0 - 1e-9)))
    return (1 + as_clear) / (1 + permutations)


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
    if change_probability(series) < below:
        return []
    places, end = _tried(series, STEP)[0], float(series.time_s[-1])
    steps = [ChangePoint(growth=STEP, time_s=float(place), end_s=end) for place in places]
    pairs = [[step, other] for step in steps if (other := _search(series, [step])) is not None]
    best = min(pairs, key=lambda pair: pair[1].false_alarm_probability, default=None)
    if best is None or best[1].false_alarm_probability * len(places) >= below:
        return []
    return _refined(series, best, below) if _borne(series, best[:1], best[1]) else []


def _borne(series: Series, known: Sequence[ChangePoint], change: ChangePoint) -> bool:
    """Tell whether a change stands without the recording that speaks for it most.

    A single wrong estimate at one end of a series looks like growth, and no law of its noise holds.
    """
    base = change_columns(series.time_s, known)
    shape = change_columns(series.time_s, [change])[:, 1]
    (path,), _, rest = _beside(series, base, shape[None])
    kept = np.arange(len(series)) != np.argmax(path * rest * np.sign(path @ rest))
    parts = {name: getattr(series, name)[kept] for name in ("time_s", "value", "sigma")}
    without = _search(replace(series, **parts), known)
    return without is not None and without.false_alarm_probability < WITHOUT_ONE


def _refined(series: Series, found: list[ChangePoint], below: float) -> list[ChangePoint]:
    """Place each change anew while the others stand, and drop what noise then explains."""
    for _ in range(3 if len(found) > 1 else 0):
        for number, change in enumerate(found):
            better = _search(series, _others(found, change))
            if better is not None:
                found[number] = _bent(series, better, _others(found, change))
    return [change for change in found if change.false_alarm_probability < below]


def _search(series: Series, known: Sequence[ChangePoint]) -> ChangePoint | None:
    """Return the clearest change beside those known."""
    base = change_columns(series.time_s, known, tangents=True)
    left, whole = len(series) - base.shape[1], float(np.linalg.norm(series.value / series.sigma))
    best, closest, lengths = None, 0.0, []
    for growth in (STRAIGHT, STEP) if left >= 3 else ():
        places, rows = _tried(series, growth)
        paths, kept, rest = _beside(series, base, rows)
        size = float(np.linalg.norm(rest))
        if size <= 1e-12 * whole:
            return None
        if series.sigma_known and 2.0 * known_noise_bound(size, 0.0) >= 1.0:
            return None  # whatever the shape, the probability of the two families is 1
        if not len(paths):
            continue
        # the length of a path through directions, which may be turned round
        turned = np.abs(np.sum(paths[1:] * paths[:-1], axis=1))
        lengths.append(float(np.arccos(np.minimum(turned, 1.0)).sum()))
        along = np.abs(paths @ rest) / size
        if best is None or along.max() > closest:
            place, closest = float(places[kept][np.argmax(along)]), float(along.max())
            best = ChangePoint(growth=growth, time_s=place, end_s=float(series.time_s[-1]))
    if best is None:
        return None
    probability = sum(tube_bound(closest, length, left) for length in lengths)
    if series.sigma_known:
        least = sum(known_noise_bound(closest * size, length) for length in lengths)
        probability = max(probability, least)
    return replace(best, false_alarm_probability=min(1.0, probability))


def _tried(series: Series, growth: Growth) -> tuple[FloatArray, FloatArray]:
    """Return the places at which kinks or steps are tried, and their shapes as rows."""
    times, most = series.time_s, int(np.clip(_MOST_NUMBERS // max(1, len(series)), *_FOUND_AT))
    if growth.exponent:
        places = _between(times[: len(times) - BORNE_BY], most, most)
    else:
        places = 0.5 * (times[1:] + times[:-1])[BORNE_BY - 1 : len(times) - BORNE_BY]
        if len(places) > most:
            places = places[np.linspace(0, len(places) - 1, most).astype(int)]
    return places, growth_rows(times, places, float(times[-1]), growth)


def _between(knots: FloatArray, about: int, most: int) -> FloatArray:
    """Return about so many places at and between recordings."""
    between = int(np.clip(about // max(1, len(knots)), 1, _BETWEEN))
    numbers = np.linspace(0, len(knots) - 1, min(most, between * (len(knots) - 1) + 1))
    return np.interp(numbers, np.arange(len(knots)), knots)


def _beside(
    series: Series, base: FloatArray, rows: FloatArray
) -> tuple[FloatArray, NDArray[np.bool_], FloatArray]:
    """Project known columns out of shapes and values, in standard deviations.

    Returns the unit directions of the shapes, which of the shapes have one, and what is left of the
    values.
    """
    basis = np.linalg.qr(base / series.sigma[:, None])[0]
    whole = np.vstack([series.value, rows]) / series.sigma
    rest = whole - (whole @ basis) @ basis.T
    size, before = np.linalg.norm(rest[1:], axis=1), np.linalg.norm(whole[1:], axis=1)
    kept = size > 1e-7 * np.maximum(before, _TINY)
    return rest[1:][kept] / size[kept, None], kept, rest[0]


def _sized(series: Series, changes: Sequence[ChangePoint]) -> tuple[ChangePoint, ...]:
    """Fit the sizes of all changes together."""
    columns = change_columns(series.time_s, changes) / series.sigma[:, None]
    # seconds of years stand beside ones
    scale = np.linalg.norm(columns, axis=0)
    sizes = np.linalg.lstsq(columns / scale, series.value / series.sigma, rcond=None)[0] / scale
    return tuple(replace(c, size=float(x)) for c, x in zip(changes, sizes[1:], strict=True))


# Timing


def profile(series: Series, rows: FloatArray, others: Sequence[ChangePoint]) -> FloatArray:
    """Return the weighted sum of squares that each of some shapes leaves, beside known changes.

    Parameters
    ----------
    series : Series
    rows : ndarray of float, shape (places, n)
        Shapes of the change at each place.
    others : sequence of ChangePoint

    Returns
    -------
    ndarray of float, shape (places,)
    """
    paths, kept, rest = _beside(series, change_columns(series.time_s, others), rows)
    left = np.full(len(rows), float(rest @ rest))
    left[kept] -= (paths @ rest) ** 2
    return np.asarray(np.maximum(left, 0.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Left:
    """What growth of every course from every place, and every step, leave of a series."""

    places: FloatArray
    growth: FloatArray  # (courses, places)
    middles: FloatArray
    step: FloatArray
    freedom: int
    variance: float

    @classmethod
    def of(cls, series: Series, others: Sequence[ChangePoint]) -> _Left:
        times, end = series.time_s, float(series.time_s[-1])
        # it may have begun at any time before the last recording but one
        places = _between(times[:-1], *_TIMED_AT)
        grown = np.concatenate([growth_rows(times, places, end, course) for course in GROWTHS])
        growth = profile(series, grown, others).reshape(len(GROWTHS), -1)
        middles, rows = _tried(series, STEP)
        step, freedom = profile(series, rows, others), len(series) - 3 - len(others)
        variance = max(
            min(growth.min(), step.min()) / max(1, freedom), 1.0 if series.sigma_known else 0.0
        )
        return cls(
            places=places,
            growth=growth,
            middles=middles,
            step=step,
            freedom=freedom,
            variance=variance,
        )

    @property
    def chance(self) -> FloatArray:
        """Chance of each course from each place, shape (courses, places)."""
        told = np.exp(-0.5 * (self.growth - self.growth.min()) / max(self.variance, _TINY))
        # places stand closer together where recordings do
        chance = CHANCES[:, None] * told * np.gradient(self.places)
        return np.asarray(chance / chance.sum())


def _bent(series: Series, change: ChangePoint, others: Sequence[ChangePoint]) -> ChangePoint:
    """Return a change with the course and place of growth that fit best.

    A step that growth explains better, by more than one fitted number is worth, becomes growth.
    """
    left = _Left.of(series, others)
    worth = left.variance * math.log(len(series))
    if change.kind == "step" and left.growth.min() + worth > left.step.min():
        return change
    course, place = np.unravel_index(int(np.argmin(left.growth)), left.growth.shape)
    return replace(change, time_s=float(left.places[place]), growth=GROWTHS[course])


def _timed(
    series: Series, change: ChangePoint, others: Sequence[ChangePoint], level: float
) -> ChangePoint:
    """Return a change with its time and the interval of that.

    A small change may be a step as well as growth: places of both count.
    """
    times, left = series.time_s, _Left.of(series, others)
    if left.freedom < 1:
        return replace(change, low_s=float(times[0]), high_s=float(times[-1]))
    quantile = kink_quantile(level, left.freedom)
    if change.kind == "step":
        quantile = max(quantile, step_quantile(level, left.freedom))
    most = min(left.growth.min(), left.step.min()) + left.variance * quantile + _TINY
    # a step lies anywhere between the recordings on its two sides
    later = np.searchsorted(times, left.middles[left.step <= most])
    kept = [left.places[left.growth.min(axis=0) <= most], times[later - 1], times[later]]
    if change.kind == "step":
        change = replace(change, time_s=float(left.middles[np.argmin(left.step)]))
    else:
        chance = left.chance.sum(axis=0)
        inside = [0.5 - 0.5 * level, 0.5, 0.5 + 0.5 * level]
        low, middle, high = np.interp(inside, np.cumsum(chance) - 0.5 * chance, left.places)
        near = int(np.argmin(np.abs(left.places - middle)))
        course = GROWTHS[int(np.argmax(left.chance[:, near]))]
        change = replace(change, time_s=float(left.places[near]), growth=course)
        kept.append(np.array([low, high]))
    first, last = (float(end(np.concatenate(kept))) for end in (np.min, np.max))
    return replace(change, low_s=first, high_s=last, open_before=bool(first <= times[0]))
