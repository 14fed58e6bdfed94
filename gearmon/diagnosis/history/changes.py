"""When did it begin: changes of a short, unevenly spaced, unevenly certain series.

A change is either *growth* from any time after the first recording on or a *step* between two
neighbouring recordings. Growth is found as a kink ``b max(0, t - tau)``, to which any that speeds
up is close enough. The penalty for assuming a change is not a matter of taste: it is the bound on
the probability that noise alone correlates as well with any kink or step.

A crack grows faster the larger it is, and a straight line through such growth meets the level
before it far too late; a tooth that chips loses some at once, what is worn in wears slower, and a
straight line through these meets it far too early: when it began can only be told along with how it
bends. Along the courses (straight, powers of time, exponentials, with a jump) one trades off
against the other, so that the likelihood is flat along a ridge. Times are those of the posterior
law over all courses and places, begun at any time with the same chance: its median, whose bias is a
small part of that of a kink, and its quantiles.

References
----------
I. Johnstone and D. Siegmund, On Hotelling's formula for the volume of tubes and Naiman's
inequality, Ann. Statist. 17 (1989), for the bound; M. Knowles, D. Siegmund and H. Zhang, Confidence
regions in semilinear regression, Biometrika 78 (1991), for its use on kinks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.special import betainc

from gearmon.arrays import FloatArray, IntArray
from gearmon.diagnosis.history.entries import time_text

#: Fewest recordings on which a change is looked for, and that must bear one: one that stands out is
#: not yet a change.
FEWEST, BORNE_BY = 6, 2
#: Changes that are looked for one after the other.
MOST_CHANGES = 3
#: Probability of calling any change on a machine that does not change, and of all intervals.
BELOW, LEVEL = 0.01, 0.9
#: A change has to be this improbable even without the recording that speaks for it most.
WITHOUT_ONE = 0.05
#: Share of the false-alarm probability for growth that was undone, which is looked for only where
#: the scatter is so many times what was stated.
_PAIR_SHARE, _UNEXPLAINED = 0.2, 1.5
# Places of a change that are tried between two recordings, and in all: to find it (fewer of long
# series, for the sake of time), and to time it.
_BETWEEN, _MOST_NUMBERS, _FOUND_AT, _TIMED_AT = 16, 400_000, (200, 4000), (320, 500)
# Exponents beyond which an exponential is as good as without end, and its square still finite.
_MOST_FOLDS = 200.0
_TINY = np.finfo(float).tiny
# Step of differences in place of derivatives: half of the digits are left.
_SMALL = 1e-7


@dataclass(frozen=True, kw_only=True)
class Growth:
    """Course of a change from 0 before it began to 1 at the last recording.

    Parameters
    ----------
    exponent : float, in [0, 10]
        p of ``x^p``; 1 is straight, 0 a step, what lies between slows down.
    folds : float, in [-50, 50]
        g of ``(e^(g x) - 1) / (e^g - 1)``, which is taken if it is not 0; below 0 growth
        comes to a halt.
    jump : float, in [0, 1)
        Share that came at once when it began.

    Examples
    --------
    >>> Growth(exponent=2.0).at(np.array([-1.0, 0.5, 1.0, 2.0]))
    array([0.  , 0.25, 1.  , 4.  ])
    """

    exponent: float = 1.0
    folds: float = 0.0
    jump: float = 0.0

    @property
    def straight(self) -> bool:
        """Whether it goes on at one rate."""
        return self.exponent == 1.0 and self.folds == 0.0

    @property
    def kind(self) -> str:
        """``straight``, ``power``, ``exponential``, or ``jump and straight``."""
        named = "straight" if self.straight else "exponential" if self.folds else "power"
        return f"jump and {named}" if self.jump else named

    def at(self, share: FloatArray) -> FloatArray:
        """Return values at shares of the time from its begin to the last recording; 0 before."""
        since = np.maximum(share, 0.0)
        grown = since**self.exponent
        if self.folds:
            grown = np.expm1(np.minimum(self.folds * since, _MOST_FOLDS)) / np.expm1(self.folds)
        return np.where(share > 0, self.jump + (1.0 - self.jump) * grown, 0.0)

    def tangents(self, share: FloatArray) -> list[FloatArray]:
        """Return the directions in which `at` moves with its begin and bends, of any length."""
        smooth, bent = replace(self, jump=0.0), "folds" if self.folds else "exponent"
        at, more = smooth.at(share), replace(smooth, **{bent: getattr(self, bent) + _SMALL})
        return [at - smooth.at(share - _SMALL), more.at(share) - at]


STEP, STRAIGHT = Growth(exponent=0.0), Growth()
# Courses that speed up, as powers and as exponentials, and those that have come to more at first
# than a straight line. Data that are sure tell coarser ones apart, and would exclude where growth
# did begin.
_POWERS = tuple(Growth(exponent=p) for p in (1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0))
_FOLDS = tuple(Growth(folds=g) for g in (1.5, 2.25, 3.0, 3.75, 4.5, 6.0))
_AT_FIRST = (
    *(Growth(jump=h) for h in (0.05, 0.1, 0.15, 0.2, 0.25, 0.35, 0.5, 0.65)),
    *(Growth(exponent=p, jump=h) for p in (1.5, 2.0, 3.0) for h in (0.1, 0.25)),
    *(Growth(exponent=p) for p in (0.25, 0.35, 0.5, 0.6, 0.75)),
    *(Growth(folds=g) for g in (-1.5, -2.0, -3.0, -4.0, -5.5)),
)
_FAMILIES = ((STEP,), (STRAIGHT,), _POWERS, _FOLDS, _AT_FIRST)
_SIZES = [len(family) for family in _FAMILIES]
#: Courses that are tried: a step, then those of growth, the straight one first.
COURSES = tuple(growth for family in _FAMILIES for growth in family)
GROWTHS = COURSES[1:]
#: How likely each is held beforehand: that growth speeds up as likely as that it does not.
CHANCES = np.repeat(np.divide([0.1, 0.25, 0.225, 0.225, 0.2], _SIZES), _SIZES)
# Share of what an interval leaves out that is left out on each side. Half of it would end a little
# too soon: the courses tried lie far apart for the noise.
_TAIL = 0.2


@dataclass(frozen=True, kw_only=True)
class ChangePoint:
    """One change of a series.

    Parameters
    ----------
    growth : Growth
        Its course.
    time_s : float
        Of growth when it began; of a step the middle between the two recordings [s].
    low_s, high_s : float
        Interval of `time_s` [s], at `LEVEL`; see `open_before`.
    open_before : bool
        Whether the interval begins with the first recording: it may have begun before.
    size : float
        How much higher values are for it at the last recording.
    false_alarm_probability : float
        Bound on the probability that noise gives as clear a change anywhere in the series.
    """

    growth: Growth
    time_s: float
    low_s: float = -math.inf
    high_s: float = math.inf
    open_before: bool = True
    size: float = 0.0
    false_alarm_probability: float = 1.0

    @property
    def kind(self) -> str:
        """``growth`` from some time on, or a ``step`` between two recordings."""
        return "growth" if self.growth.exponent else "step"

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        return {
            "kind": self.kind,
            "course": self.growth.kind if self.growth.exponent else None,
            "time": time_text(self.time_s),
            "time_low": time_text(self.low_s),
            "time_high": time_text(self.high_s),
            "may_have_begun_before": self.open_before,
            "direction": "rise" if self.size > 0 else "fall",
            "false_alarm_probability": self.false_alarm_probability,
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class Series:
    """Values over time with their standard deviations; histories have checked them.

    Parameters
    ----------
    time_s : ndarray of float, shape (n,)
        Strictly increasing [s], at least one.
    value : ndarray of float, shape (n,)
    sigma : ndarray of float, shape (n,)
        Standard deviations, > 0.
    sigma_known : bool
        Whether they are known in size and not only relative to one another: noise is then never
        held to be smaller, whatever the scatter.
    """

    time_s: FloatArray
    value: FloatArray
    sigma: FloatArray
    sigma_known: bool = True

    def __len__(self) -> int:
        """Return the number of values."""
        return len(self.time_s)

    def shares(self, time_s: FloatArray, begin_s: FloatArray | float) -> FloatArray:
        """Return times as shares of that from a begin to the last recording."""
        return np.asarray((time_s - begin_s) / np.maximum(self.time_s[-1] - begin_s, _TINY))

    def columns(
        self, time_s: FloatArray, changes: Sequence[ChangePoint], *, tangents: bool = False
    ) -> FloatArray:
        """Return a constant and the courses of some changes as columns.

        Parameters
        ----------
        time_s : ndarray of float, shape (n,)
            Times [s].
        changes : sequence of ChangePoint
        tangents : bool
            Whether growth brings the directions in which it would move and bend as well: what
            growth that is a little off leaves behind must not be taken for another change.

        Returns
        -------
        ndarray of float, shape (n, columns)
        """
        columns = [np.ones(len(time_s))]
        for change in changes:
            share = self.shares(time_s, change.time_s)
            columns.append(change.growth.at(share))
            columns += change.growth.tangents(share) if tangents and change.growth.exponent else []
        return np.column_stack(columns)

    def solver(self, changes: Sequence[ChangePoint]) -> FloatArray:
        """Return what makes values, in standard deviations, the constant and sizes of changes."""
        columns = self.columns(self.time_s, changes)
        return np.asarray(np.linalg.pinv(columns / self.sigma[:, None]))


def find_changes(
    series: Series, *, below: float = BELOW, most: int = MOST_CHANGES
) -> tuple[ChangePoint, ...]:
    """Find the changes of a series that noise would not make.

    Parameters
    ----------
    series : Series
        The scatter about the trend sets the scale of the noise; where the standard deviations are
        known in size, noise is held to be at least that.
    below : float, in (0, 0.5]
        Probability of calling any change in a series without one.
    most : int
        Changes looked for; each further one is tested against those found before.

    Returns
    -------
    tuple of ChangePoint
        In the order of time.

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
    found = _repaired(series, _PAIR_SHARE * below) if most > 1 else []
    while len(found) < most and len(series) >= FEWEST + 2 * len(found):
        best = _search(series, found)
        allowed = below if found else (1.0 - _PAIR_SHARE) * below
        if best.false_alarm_probability >= allowed or not _borne(series, found, best):
            break
        found = _refined(series, [*found, _bent(series, best, found)], below)
    timed = (_timed(series, one, [c for c in found if c is not one]) for one in found)
    placed = sorted(timed, key=lambda change: change.time_s)
    # the sizes of all are fitted together
    sizes = series.solver(placed) @ (series.value / series.sigma)
    return tuple(replace(c, size=float(x)) for c, x in zip(placed, sizes[1:], strict=True))


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
    return _search(series, []).false_alarm_probability if len(series) >= FEWEST else 1.0


def permuted_probability(series: Series, *, permutations: int = 4999) -> float:
    """Probability that a series in random order shows a change as clear as this one.

    Parameters
    ----------
    series : Series
        Its standard deviations must be equal, or the order has a meaning.
    permutations : int, > 0
        Random orders, always the same.

    Returns
    -------
    float
        ``(1 + orders at least as clear) / (1 + permutations)``: exact whatever the law of the
        values, if their order has no meaning; never below ``1 / (1 + permutations)``. 1 for a
        series too short or without any variation.
    """
    if len(series) < FEWEST or np.ptp(series.value) <= 1e-12 * np.abs(series.value).max():
        return 1.0
    fits = Fits.of(series, ())
    paths, rest = fits.paths, fits.rest
    generator = np.random.default_rng(0)
    clearest, as_clear = float(np.abs(paths @ rest).max()), 0
    for start in range(0, permutations, 500):
        count = min(500, permutations - start)
        orders = generator.permuted(np.tile(rest, (count, 1)), axis=1)
        # the same order, up to rounding, is as clear
        peaks = np.abs(paths @ orders.T).max(axis=0)
        as_clear += int(np.sum(peaks >= clearest * (1.0 - 1e-9)))
    return (1 + as_clear) / (1 + permutations)


def _repaired(series: Series, below: float) -> list[ChangePoint]:
    """Return growth with the step that undid it, where neither shows without the other.

    Each step is taken for granted in turn; what then shows is charged with the number of steps.
    """
    if not series.sigma_known or len(series) < FEWEST + 2:
        return []
    fits = Fits.of(series, ())
    scatter = np.linalg.norm(fits.rest) / math.sqrt(len(series))
    if scatter < _UNEXPLAINED or change_probability(series) < below:
        return []
    places = fits.places[fits.courses == 0].tolist()
    steps = [ChangePoint(growth=STEP, time_s=place) for place in places]
    pairs = [[step, _search(series, [step])] for step in steps]
    best = min(pairs, key=lambda pair: pair[1].false_alarm_probability)
    if best[1].false_alarm_probability * len(places) >= below:
        return []
    return _refined(series, best, below) if _borne(series, best[:1], best[1]) else []


def _borne(series: Series, known: Sequence[ChangePoint], change: ChangePoint) -> bool:
    """Tell whether a change stands without the recording that speaks for it most.

    A single wrong estimate at one end of a series looks like growth, and no law of its noise holds.
    """
    course = np.array([COURSES.index(change.growth)])
    fits = Fits(series=series, known=known, places=np.array([change.time_s]), courses=course)
    along = fits.paths[0] * fits.rest
    kept = np.arange(len(series)) != np.argmax(along * np.sign(along.sum()))
    parts = {name: getattr(series, name)[kept] for name in ("time_s", "value", "sigma")}
    return _search(replace(series, **parts), known).false_alarm_probability < WITHOUT_ONE


def _refined(series: Series, found: list[ChangePoint], below: float) -> list[ChangePoint]:
    """Place each change anew while the others stand, and drop what noise then explains."""
    for _ in range(3 if len(found) > 1 else 0):
        for number in range(len(found)):
            others = found[:number] + found[number + 1 :]
            better = _search(series, others)
            if better.time_s < series.time_s[-1]:
                found[number] = _bent(series, better, others)
    return [change for change in found if change.false_alarm_probability < below]


def _search(series: Series, known: Sequence[ChangePoint]) -> ChangePoint:
    """Return the clearest change beside those known; where there is none, one at the end."""
    fits = Fits.of(series, tuple(known))
    left, size = fits.dimensions, float(np.linalg.norm(fits.rest))
    # less than known noise leaves: whatever the shape, the probability of the two families is 1
    quiet = series.sigma_known and 2.0 * known_noise_bound(size, 0.0) >= 1.0
    if quiet or left < 3 or size <= 1e-12 * np.linalg.norm(series.value / series.sigma):
        return ChangePoint(growth=STRAIGHT, time_s=float(series.time_s[-1]))
    lengths = []
    for course in (0, 1):
        path = fits.paths[(fits.courses == course) & (fits.sizes > 0)]
        # the length of a path through directions, which may be turned round
        turned = np.abs(np.sum(path[1:] * path[:-1], axis=1))
        lengths += [float(np.arccos(np.minimum(turned, 1.0)).sum())] if len(path) else []
    along = np.abs(fits.paths @ fits.rest) / size
    best = int(np.argmax(along))
    probability = sum(tube_bound(along[best], length, left) for length in lengths)
    if series.sigma_known:
        least = sum(known_noise_bound(along[best] * size, length) for length in lengths)
        probability = max(probability, least)
    growth, time_s = COURSES[fits.courses[best]], float(fits.places[best])
    chance = min(1.0, probability) if lengths else 1.0
    return ChangePoint(growth=growth, time_s=time_s, false_alarm_probability=chance)


@dataclass(kw_only=True, eq=False)
class Fits:
    """Least squares by a constant, known changes and one more, for each place and course of that.

    Parameters
    ----------
    series : Series
    known : sequence of ChangePoint
    places : ndarray of float, shape (fits,)
        Where the one more began [s]; of a step any time between two recordings.
    courses : ndarray of int, shape (fits,)
        Its course, by its number in `COURSES`.
    tangents : bool
        Whether the known changes may move and bend as well, see `Series.columns`.

    Attributes
    ----------
    paths : ndarray of float, shape (fits, n)
        Unit directions of the one more beside what is known; nought where nothing is left of it.
    sizes : ndarray of float, shape (fits,)
        What is left of it, in standard deviations.
    rest : ndarray of float, shape (n,)
        What the known leave of the values, in standard deviations.
    dimensions : int
        Of the space in which that lies.
    left : ndarray of float, shape (fits,)
        Weighted sum of squares that each leaves.
    freedom : int
        Values beyond those that fits with one more take up, which a step outside does not.
    variance : float
        Of the noise in units of the stated one, at least 1 where its size is known.
    """

    series: Series
    known: Sequence[ChangePoint]
    places: FloatArray
    courses: IntArray
    tangents: bool = False

    def __post_init__(self) -> None:
        """Fit all of them."""
        series, known, places = self.series, self.known, self.places
        base = series.columns(series.time_s, known, tangents=self.tangents)
        basis = np.linalg.qr(base / series.sigma[:, None])[0]
        shapes = self._rows(series.time_s, np.arange(len(places)))
        whole = np.vstack([series.value, shapes]) / series.sigma
        rest = whole - (whole @ basis) @ basis.T
        size, before = np.linalg.norm(rest[1:], axis=1), np.linalg.norm(whole[1:], axis=1)
        size[size <= 1e-7 * np.maximum(before, _TINY)] = 0.0
        self.paths = rest[1:] * (size > 0)[:, None] / np.where(size > 0, size, 1.0)[:, None]
        self.sizes, self.rest, self.dimensions = size, rest[0], len(series) - base.shape[1]
        square = float(self.rest @ self.rest)
        self.left = np.maximum(square - (self.paths @ self.rest) ** 2, 0.0)
        self.freedom = len(series) - 1 - 2 * (len(known) + bool(size.any()))
        least = 1.0 if series.sigma_known else 0.0
        self.variance = max(float(self.left.min()) / max(1, self.freedom), least)

    @classmethod
    @lru_cache(maxsize=6)  # a change is bent, and timed a moment later
    def of(cls, series: Series, known: tuple[ChangePoint, ...], *, bent: bool = False) -> Fits:
        """Return steps and growth at places all along: straight to find it, bent to time it.

        Bent growth, of all courses, may have begun any time before the last recording but one.
        """
        times = series.time_s
        most = int(np.clip(_MOST_NUMBERS // max(1, len(times)), *_FOUND_AT))
        steps = 0.5 * (times[1:] + times[:-1])[BORNE_BY - 1 : len(times) - BORNE_BY]
        steps = steps[np.linspace(0, len(steps) - 1, min(most, len(steps))).astype(int)]
        # about so many places at and between recordings, and how many at most
        about, limit = _TIMED_AT if bent else (most, most)
        knots = times[: -1 if bent else -BORNE_BY]
        between = int(np.clip(about // max(1, len(knots)), 1, _BETWEEN))
        numbers = np.linspace(0, len(knots) - 1, min(limit, between * (len(knots) - 1) + 1))
        begun = np.interp(numbers, np.arange(len(knots)), knots)
        growths = range(1, len(COURSES) if bent else 2)
        places = np.concatenate([steps, np.tile(begun, len(growths))])
        courses = np.repeat([0, *growths], [len(steps), *[len(begun)] * len(growths)])
        return cls(series=series, known=known, places=places, courses=courses, tangents=not bent)

    def at(
        self, time_s: FloatArray, which: IntArray, weights: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Value of some fits and its variance in units of that of the noise.

        Parameters
        ----------
        time_s : ndarray of float, shape (k,)
            Times [s].
        which : ndarray of int, shape (some,)
            The fits.
        weights : ndarray of float, shape (sums, k), optional
            Of weighted sums over the times, which are then told in place of the values.

        Returns
        -------
        value, variance : ndarray of float, shape (some, k) or (some, sums)

        Notes
        -----
        What the known columns explain of the one more is taken off it, so that its size is
        independent of theirs and the variances add (Frisch and Waugh).
        """
        series, solver = self.series, self.series.solver(self.known)
        known, rows = series.columns(time_s, self.known), self._rows(time_s, which)
        if weights is not None:
            known, rows = weights @ known, rows @ weights.T
        explained = self._rows(series.time_s, which) / series.sigma @ solver.T
        beside = rows - explained @ known.T
        size = self.sizes[which, None]
        beside *= np.where(size > 0, 1 / np.where(size > 0, size, 1.0), 0.0)
        value = known @ solver @ (series.value / series.sigma)
        variance = np.sum((known @ solver) ** 2, axis=1)
        along = (self.paths[which] @ self.rest)[:, None]
        return value + beside * along, variance + beside**2

    def _rows(self, time_s: FloatArray, which: IntArray) -> FloatArray:
        """Shapes of the one more at some times, shape (some, times)."""
        shares, courses = self.series.shares(time_s, self.places[which, None]), self.courses[which]
        for number in np.unique(courses):
            own = courses == number
            shares[own] = COURSES[number].at(shares[own])
        return shares


def _bent(series: Series, change: ChangePoint, others: Sequence[ChangePoint]) -> ChangePoint:
    """Return a change with the course and place of growth that fit best.

    A step that growth explains better, by more than one fitted number is worth, becomes growth.
    """
    fits = Fits.of(series, tuple(others), bent=True)
    grown = np.where(fits.courses > 0, fits.left, np.inf)
    best, worth = int(np.argmin(grown)), fits.variance * math.log(len(series))
    if change.kind == "step" and grown[best] + worth > fits.left[fits.courses == 0].min():
        return change
    return replace(change, time_s=float(fits.places[best]), growth=COURSES[fits.courses[best]])


def _timed(series: Series, change: ChangePoint, others: Sequence[ChangePoint]) -> ChangePoint:
    """Return a change with its time and the interval of that.

    A small change may be a step as well as growth: the interval is that of both.
    """
    times, fits = series.time_s, Fits.of(series, tuple(others), bent=True)
    steps, begun = fits.courses == 0, fits.places[fits.courses == 1]
    # every time is as likely beforehand, and places stand closer together where recordings do
    width = [np.gradient(fits.places[steps]), np.tile(np.gradient(begun), len(GROWTHS))]
    # of what fits to the last digit nothing is left to divide by
    variance = max(fits.variance, 1e-12 * fits.left.max(), _TINY)
    likely = np.exp(-0.5 * (fits.left - fits.left.min()) / variance)
    chance = CHANCES[fits.courses] * likely * np.concatenate(width)
    chance /= chance.sum()
    # a step is one anywhere between the recordings on its two sides
    later = np.searchsorted(times, fits.places)
    low = np.where(steps, times[later - 1], fits.places)
    high = np.where(steps, times[later], fits.places)
    own, tail = chance * (steps == (change.kind == "step")), _TAIL * (1.0 - LEVEL)

    def quantile(place: FloatArray, share: float, weights: FloatArray) -> float:
        return float(np.quantile(place, share, weights=weights, method="inverted_cdf"))

    middle = quantile(fits.places, 0.5, own)
    first, last = quantile(low, tail, chance), quantile(high, 1.0 - tail, chance)
    growth = COURSES[fits.courses[np.argmax(np.where(fits.places == middle, own, -1.0))]]
    ends = {"low_s": min(first, middle), "high_s": max(last, middle)}
    before = bool(first <= times[0])
    return replace(change, time_s=middle, growth=growth, open_before=before, **ends)


def tube_bound(closeness: float, length: float, dimensions: int) -> float:
    """Bound the probability that a random direction comes close to a path or its mirror image.

    Parameters
    ----------
    closeness : float, in [0, 1]
        Cosine of the angle.
    length : float, >= 0
        Length of the path on the unit sphere [rad].
    dimensions : int, >= 2
        Of the space that the sphere lies in.

    Returns
    -------
    float
        ``length / pi (1 - c^2)^(m/2 - 1) + P(B(1/2, (m - 1)/2) >= c^2)``, at most 1. Exact for a
        single direction (length 0); an upper bound for any path, close to it where it is small.

    Examples
    --------
    >>> tube_bound(0.0, 0.0, 5), round(tube_bound(0.5, 0.0, 3), 12)
    (1.0, 0.5)
    """
    rest = max(0.0, 1.0 - closeness**2)
    end = float(betainc(0.5 * (dimensions - 1), 0.5, rest))
    middle = length / math.pi * math.pow(rest, 0.5 * dimensions - 1.0)
    return min(1.0, middle + end)


def known_noise_bound(gain: float, length: float) -> float:
    """Bound the probability that noise of known size reaches as far along any direction of a path.

    Parameters
    ----------
    gain : float, >= 0
        Length of the projection, in standard deviations of the noise.
    length : float, >= 0
        Length of the path of directions on the unit sphere [rad].

    Returns
    -------
    float
        ``length / pi exp(-g^2 / 2) + erfc(g / sqrt 2)``, at most 1: the limit of `tube_bound` for
        many dimensions.

    Examples
    --------
    >>> known_noise_bound(0.0, 0.0), round(known_noise_bound(1.6448536, 0.0), 6)
    (1.0, 0.1)
    """
    end = math.erfc(gain / math.sqrt(2.0))
    return min(1.0, length / math.pi * math.exp(-0.5 * gain**2) + end)
