"""How lines of no gear changed against healthy recordings, and how often a healthy machine does so.

A healthy machine has such lines too: of bearings, of the mains, of what nobody knows. Only what is
new or has grown counts. A line that the healthy recordings do not list may have been there below
their noise, so that it must stand out of what they could have shown.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from gearmon.diagnosis.nongear.names import MAINS_HZ, harmonic_sources
from gearmon.diagnosis.nongear.speed_scatter import speed_scatter_db
from gearmon.gears.kinematics import Kinematics
from gearmon.signatures.measured.line_plan import distance_to, known_orders
from gearmon.signatures.measured.nongear_lines import (
    OWN_WIDTHS,
    NonGearLine,
    NonGearLines,
    noise_exceeds,
)

FloatArray = NDArray[np.float64]

# What such a line of a healthy machine is taken to change by from one recording to another before
# any is seen [dB], and the differences that this prior is worth (so that the 4 dB are known to a
# fifth): a change by one zone of vibration severity (ISO 20816: a factor of 2.5, 8 dB) is twice as
# much.
PRIOR_CHANGE_DB, PRIOR_WORTH = 4.0, 15.0
# Sources just below the noise of the reference that a healthy machine has at least: any shaft runs
# in two bearings.
_LEAST_HIDDEN = 2.0
# Lines of two recordings within this share of their order, or so many widths, are the same one.
_SAME_SHARE, _SAME_WIDTHS = 3e-3, 3.0
# So much nearer or farther a peak may stand beside a gear's order in another recording.
_SPARE_WIDTHS = 0.5
# So many unrelated lines have as many chances of a rise as n of one source: n to this power. With
# three quarters of their variance in common, from three standard deviations on, to a tenth.
_ALIKE_POWER = 0.7
# Least probability that is told, as a power of ten.
LEAST_LOG10 = -300.0


@dataclass(frozen=True, kw_only=True)
class LineChange:
    """Change of one line of no gear against healthy recordings.

    Parameters
    ----------
    line : NonGearLine
        The line in the new recording.
    change_db : float
        Rise of its level, mean over the channels that hear it, gains taken off [dB]; of a new line
        the least rise that the noise of the reference allows.
    sigma_db : float
        Standard deviation of that on a healthy machine [dB].
    new : bool
        Whether no healthy recording lists it.
    log10_probability : float
        Logarithm of the expected number of unrelated lines of a healthy machine that change as
        much.
    """

    line: NonGearLine
    change_db: float
    sigma_db: float
    new: bool
    log10_probability: float


def line_changes(
    lines: NonGearLines, healthy: Sequence[NonGearLines], train: Kinematics, gain_db: FloatArray
) -> list[LineChange]:
    """Return the change of every line that the healthy recordings can be asked for.

    Parameters
    ----------
    lines : NonGearLines
        Of the new recording.
    healthy : sequence of NonGearLines
        Of healthy recordings of the same channels.
    train : Kinematics
        The machine.
    gain_db : ndarray of float, shape (channels,)
        How much louder each channel is than in the healthy recordings [dB].
    """
    known = cache(lambda top, width: known_orders(train, top, width))
    rises = []
    for line in lines:
        seen = [_level_in(other, line, lines.grid(line.kind).width, known) for other in healthy]
        then = [level for level, _ in seen if level is not None]
        if len(then) == len(seen):
            listed = np.array([there for _, there in seen])
            rises.append(_rise(line, lines, healthy, np.array(then), listed, gain_db))
    if not rises:
        return []
    law = _law(rises, lines, healthy)
    found = []
    for rise, expected in zip(rises, law.expected(rises), strict=True):
        grid, new = lines.grid(rise.line.kind), not rise.listed.any()
        if new:
            ratio = 10 ** (max(rise.line.over_noise_db) / 10)
            expected += grid.looked_at * float(noise_exceeds(ratio, grid.pieces))
        change = LineChange(
            line=rise.line,
            change_db=rise.change,
            sigma_db=law.sigma(rise),
            new=new,
            log10_probability=float(np.log10(max(expected, 10.0**LEAST_LOG10))),
        )
        found.append(change)
    return found


@dataclass(frozen=True, kw_only=True, eq=False)
class _Rise:
    """Level of a line now and in the healthy recordings, means over the channels that hear it [dB].

    `variance` is what the noise and a change of speed add to the difference [dB^2].
    """

    line: NonGearLine
    now: float
    then: FloatArray  # (recordings,)
    variance: float
    listed: NDArray[np.bool_]

    @property
    def change(self) -> float:
        return self.now - float(self.then.mean())


def _rise(
    line: NonGearLine,
    lines: NonGearLines,
    healthy: Sequence[NonGearLines],
    then_db: FloatArray,
    listed: NDArray[np.bool_],
    gain_db: FloatArray,
) -> _Rise:
    over = np.array(line.over_noise_db)
    heard = over >= min(lines.grid(line.kind).least_db, over.max())
    gain = gain_db if line.kind == "spectrum" else np.zeros(len(over))
    # a level that is read in noise, mean over channels
    ratio = 10 ** (np.minimum(over[heard], 200.0) / 10)
    variance = 0.5 * float(np.mean((10 / np.log(10)) ** 2 * 2 / ratio))
    if line.locked != "time" and line.kind == "spectrum":
        moves = min(abs(lines.speed_hz / other.speed_hz - 1) for other in healthy)
        variance += speed_scatter_db(moves, independent=float(heard.sum())) ** 2
    return _Rise(
        line=line,
        now=float(np.mean((np.array(line.level_db) - gain)[heard])),
        then=then_db[:, heard].mean(axis=1),
        variance=variance,
        listed=listed,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Law:
    """How much lines of a healthy machine change, and how many there are.

    Parameters
    ----------
    variance, worth : float
        Of the difference between two healthy recordings [dB^2], and the differences known.
    listed : float
        Lines that can change, counted as unrelated ones.
    hidden_db : ndarray of float
        How far other sources stand below what is listed [dB].
    hidden_weight : float
        What each of those counts for.
    """

    variance: float
    worth: float
    listed: float
    hidden_db: FloatArray
    hidden_weight: float

    def sigma(self, rise: _Rise) -> float:
        """Return the standard deviation of a rise on a healthy machine [dB]."""
        count = len(rise.then)
        own = 2 * float(np.var(rise.then, ddof=1)) if count > 1 else 0.0
        # a mean over several healthy recordings moves less than one of them
        share = 0.5 * (1 + 1 / count)
        return float(np.sqrt(share * max(self.variance, own) + rise.variance))

    def expected(self, rises: Sequence[_Rise]) -> FloatArray:
        """Return how many unrelated lines of a healthy machine rise as much as each does."""
        change = np.array([[rise.change] for rise in rises])
        sigma = np.array([[self.sigma(rise)] for rise in rises])
        seen = self.listed * stdtr(self.worth, -change / sigma)
        # a hidden source has to come out of the noise first
        out = stdtr(self.worth, -(change + self.hidden_db) / sigma)
        return np.asarray(seen[:, 0] + self.hidden_weight * out.sum(axis=1))


def _law(rises: Sequence[_Rise], lines: NonGearLines, healthy: Sequence[NonGearLines]) -> _Law:
    """Scatter of lines, the prior joined by healthy recordings, and how many may change."""
    total, worth, listed = PRIOR_WORTH * PRIOR_CHANGE_DB**2, PRIOR_WORTH, _LEAST_HIDDEN
    for group in _sources([rise.line for rise in rises], lines):
        share = len(group) ** (_ALIKE_POWER - 1)
        for rise in (rises[i] for i in group):
            if rise.listed.any():
                listed += share
            if rise.listed.all() and len(rise.listed) > 1:
                # the variance of a difference is twice that of either level
                total += share * 2 * float(np.var(rise.then) * len(rise.then))
                worth += share * (len(rise.then) - 1)
    # as many sources stand so far below what is listed as stand above it; those that only other
    # channels heard do stand below
    hidden = [
        abs(
            max(max(other.lines[i].over_noise_db) for i in group)
            - other.grid(other.lines[group[0]].kind).least_db
        )
        for other in healthy
        for group in _sources(other.lines, other)
    ]
    return _Law(
        variance=total / worth,
        worth=worth,
        listed=listed,
        hidden_db=np.array(hidden),
        hidden_weight=1 / len(healthy),
    )


def _sources(lines: Sequence[NonGearLine], whole: NonGearLines) -> list[list[int]]:
    return harmonic_sources(lines, {grid.kind: grid.width for grid in whole.grids})


def _level_in(
    other: NonGearLines,
    line: NonGearLine,
    width: float,
    known: Callable[[float, float], FloatArray],
) -> tuple[FloatArray | None, bool]:
    """Level of a line in a healthy recording, None if that cannot tell; and whether it lists it."""
    grid = other.grid(line.kind)
    width = max(grid.width, width)
    # a line that keeps its frequency stands at another order when the speed is another
    moved = line.frequency_hz / other.speed_hz
    order = moved if line.locked == "time" else line.order
    if max(order, moved) > grid.top:
        return None, False
    same = [x for x in other if x.kind == line.kind and _same(line, x, width)]
    if not same and line.locked != "time":
        away = distance_to(known(grid.top, width), np.array([order]))[0]
        # there it was taken for a gear's
        if away < (OWN_WIDTHS + _SPARE_WIDTHS) * width:
            return None, False
    levels = [grid.unseen_at(order), *(np.array(x.level_db) for x in same)]
    level: FloatArray = np.max(levels, axis=0)
    if line.kind == "spectrum" and (line.locked == "time" or _of_the_mains(line)):
        reach = _SAME_SHARE * line.frequency_hz + 2 * width * other.speed_hz
        highest = other.highest_in_time(line.frequency_hz - reach, line.frequency_hz + reach)
        if highest is None:
            return (level, True) if same else (None, False)
        level = np.maximum(level, highest)
    return level, bool(same)


def _same(line: NonGearLine, other: NonGearLine, width: float) -> bool:
    """Whether lines of two recordings may be one and the same."""
    near = max(_SAME_WIDTHS * width, _SAME_SHARE * line.order)
    if "time" not in (line.locked, other.locked) and abs(other.order - line.order) <= near:
        return True
    if "shaft" in (line.locked, other.locked):
        return False
    # against time widths are those of the same pieces
    return abs(other.frequency_hz - line.frequency_hz) * line.order <= near * line.frequency_hz


def _of_the_mains(line: NonGearLine) -> bool:
    """Whether a line may be one of the mains."""
    away = (abs(line.frequency_hz / hz - round(line.frequency_hz / hz)) * hz for hz in MAINS_HZ)
    return line.locked != "shaft" and min(away) <= _SAME_SHARE * line.frequency_hz
