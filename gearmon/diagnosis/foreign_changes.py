"""How foreign lines changed against healthy recordings, and how often a healthy machine does so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.foreign_names import MAINS_HZ
from gearmon.diagnosis.foreign_sources import sources
from gearmon.diagnosis.speed_scatter import speed_scatter_db
from gearmon.gears.kinematics import Kinematics
from gearmon.signatures.foreign_lines import ForeignLine, ForeignLines
from gearmon.signatures.foreign_search import OWN_WIDTHS, noise_exceeds
from gearmon.signatures.gear_orders import distance_to, known_orders

FloatArray = NDArray[np.float64]

# What a foreign line of a healthy machine is taken to change by from one recording to another
# before any is seen [dB], and the differences that this prior is worth (so that the 4 dB are known
# to a fifth): a change by one zone of vibration severity (ISO 20816: a factor of 2.5, 8 dB) is
# twice as much.
PRIOR_CHANGE_DB, PRIOR_WORTH = 4.0, 15.0
# Sources just below the noise of the reference that a healthy machine has at least: any shaft runs
# in two bearings.
_LEAST_HIDDEN = 2.0
# Lines of two recordings within this share of their order, or so many widths, are the same one.
_SAME_SHARE, _SAME_WIDTHS = 3e-3, 3.0
# So much nearer or farther a peak may stand beside a gear's order in another recording.
_SPARE_WIDTHS = 0.5
# Least probability that is told, as a power of ten.
LEAST_LOG10 = -300.0


@dataclass(frozen=True, kw_only=True)
class LineChange:
    """Change of one foreign line against healthy recordings.

    Parameters
    ----------
    line : ForeignLine
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

    line: ForeignLine
    change_db: float
    sigma_db: float
    new: bool
    log10_probability: float


@dataclass(frozen=True, kw_only=True, eq=False)
class _Before:
    """What healthy recordings show where a line stands now."""

    level_db: FloatArray  # (recordings, channels)
    listed: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Rise:
    """Level of a line now and then, means over the channels that hear it [dB].

    `reading` and `moved` are variances [dB^2] that the noise and a change of speed add to the
    difference.
    """

    now: float
    then: FloatArray  # (recordings,)
    reading: float
    moved: float
    listed: NDArray[np.bool_]

    @property
    def change(self) -> float:
        return self.now - float(self.then.mean())


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
        return float(np.sqrt(share * max(self.variance, own) + rise.reading + rise.moved))

    def expected(self, rises: Sequence[_Rise]) -> FloatArray:
        """Return how many unrelated lines of a healthy machine rise as much as each does."""
        from scipy.special import stdtr

        change = np.array([[rise.change] for rise in rises])
        sigma = np.array([[self.sigma(rise)] for rise in rises])
        seen = self.listed * stdtr(self.worth, -change / sigma)
        # a hidden source has to come out of the noise first
        out = stdtr(self.worth, -(change + self.hidden_db) / sigma)
        return np.asarray(seen[:, 0] + self.hidden_weight * out.sum(axis=1))


@dataclass(frozen=True, eq=False, kw_only=True)
class ForeignComparison:
    """The foreign lines of a recording beside those of healthy ones.

    Parameters
    ----------
    lines : ForeignLines
        Of the new recording.
    healthy : tuple of ForeignLines
        Of healthy recordings of the same channels.
    train : Kinematics
        The machine.
    gain_db : ndarray of float, shape (channels,)
        How much louder each channel is than in the healthy recordings [dB].
    """

    lines: ForeignLines
    healthy: tuple[ForeignLines, ...]
    train: Kinematics
    gain_db: FloatArray

    def changes(self) -> list[LineChange]:
        """Return the change of every line that the healthy recordings can be asked for."""
        pairs = [(line, self._before(line)) for line in self.lines]
        kept = [(line, before) for line, before in pairs if before is not None]
        if not kept:
            return []
        rises = [self._rise(line, before) for line, before in kept]
        groups = _sources_of([line for line, _ in kept], self.lines)
        law = self._law([[rises[i] for i in group] for group in groups])
        return [
            self._change(line, rise, law, float(expected))
            for (line, _), rise, expected in zip(kept, rises, law.expected(rises), strict=True)
        ]

    def _law(self, sources_rises: Sequence[Sequence[_Rise]]) -> _Law:
        """Scatter of lines, the prior joined by healthy recordings, and how many may change."""
        total, worth, listed = PRIOR_WORTH * PRIOR_CHANGE_DB**2, PRIOR_WORTH, _LEAST_HIDDEN
        for rises in sources_rises:
            share = _chances(len(rises)) / len(rises)
            for rise in rises:
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
            for other in self.healthy
            for group in _sources_of(other.lines, other)
        ]
        return _Law(
            variance=total / worth,
            worth=worth,
            listed=listed,
            hidden_db=np.array(hidden),
            hidden_weight=1 / len(self.healthy),
        )

    def _before(self, line: ForeignLine) -> _Before | None:
        """Level of a line in the healthy recordings; None if one of them cannot tell."""
        levels, listed = [], []
        for other in self.healthy:
            level, is_listed = self._in(other, line)
            if level is None:
                return None
            levels.append(level)
            listed.append(is_listed)
        return _Before(level_db=np.array(levels), listed=np.array(listed))

    def _in(self, other: ForeignLines, line: ForeignLine) -> tuple[FloatArray | None, bool]:
        grid = other.grid(line.kind)
        width = max(grid.width, self.lines.grid(line.kind).width)
        # a line that keeps its frequency stands at another order when the speed is another
        moved = line.frequency_hz / other.speed_hz
        order = moved if line.locked == "time" else line.order
        if max(order, moved) > grid.top:
            return None, False
        same = [x for x in other if x.kind == line.kind and _same(line, x, width)]
        if not same and line.locked != "time":
            away = distance_to(self._known(grid.top, width), np.array([order]))[0]
            # there it was taken for a gear's
            if away < (OWN_WIDTHS + _SPARE_WIDTHS) * width:
                return None, False
        level = grid.unseen_at(order)
        if same:
            level = np.maximum(level, np.max([x.level_db for x in same], axis=0))
        if line.kind == "spectrum" and (line.locked == "time" or _of_the_mains(line)):
            reach = _SAME_SHARE * line.frequency_hz + 2 * width * other.speed_hz
            highest = other.highest_in_time(line.frequency_hz - reach, line.frequency_hz + reach)
            if highest is None:
                return (level, True) if same else (None, False)
            level = np.maximum(level, highest)
        return level, bool(same)

    def _known(self, top: float, width: float) -> FloatArray:
        if (top, width) not in self._orders:
            self._orders[top, width] = known_orders(self.train, top, width)
        return self._orders[top, width]

    @cached_property
    def _orders(self) -> dict[tuple[float, float], FloatArray]:
        """Orders of the gears, by the top order and the resolution asked for."""
        return {}

    def _rise(self, line: ForeignLine, before: _Before) -> _Rise:
        grid = self.lines.grid(line.kind)
        over = np.array(line.over_noise_db)
        heard = over >= min(grid.least_db, over.max())
        gain = self.gain_db if line.kind == "spectrum" else np.zeros(len(over))
        moved = 0.0
        if line.locked != "time" and line.kind == "spectrum":
            moves = min(abs(self.lines.speed_hz / x.speed_hz - 1) for x in self.healthy)
            moved = speed_scatter_db(moves, independent=float(heard.sum())) ** 2
        return _Rise(
            now=float(np.mean((np.array(line.level_db) - gain)[heard])),
            then=before.level_db[:, heard].mean(axis=1),
            reading=0.5 * _reading_variance(over[heard]),
            moved=moved,
            listed=before.listed,
        )

    def _change(self, line: ForeignLine, rise: _Rise, law: _Law, expected: float) -> LineChange:
        grid = self.lines.grid(line.kind)
        new = not rise.listed.any()
        if new:
            ratio = 10 ** (max(line.over_noise_db) / 10)
            expected += grid.looked_at * float(noise_exceeds(ratio, grid.pieces))
        return LineChange(
            line=line,
            change_db=rise.change,
            sigma_db=law.sigma(rise),
            new=new,
            log10_probability=float(np.log10(max(expected, 10.0**LEAST_LOG10))),
        )


def _chances(lines: int) -> float:
    """Return how many unrelated lines have as many chances of a rise as those of one source.

    With three quarters of their variance in common, from three standard deviations on, to a tenth.
    """
    return float(lines**0.7)


def _sources_of(lines: Sequence[ForeignLine], whole: ForeignLines) -> list[list[int]]:
    return sources(lines, {grid.kind: grid.width for grid in whole.grids})


def _same(line: ForeignLine, other: ForeignLine, width: float) -> bool:
    """Whether lines of two recordings may be one and the same."""
    by_order = abs(other.order - line.order)
    if "time" not in (line.locked, other.locked):
        near = max(_SAME_WIDTHS * width, _SAME_SHARE * line.order)
        if by_order <= near:
            return True
    if "shaft" in (line.locked, other.locked):
        return False
    # against time widths are those of the same pieces
    width_hz = width * line.frequency_hz / line.order
    near = max(_SAME_WIDTHS * width_hz, _SAME_SHARE * line.frequency_hz)
    return abs(other.frequency_hz - line.frequency_hz) <= near


def _of_the_mains(line: ForeignLine) -> bool:
    """Whether a line may be one of the mains."""
    if line.locked == "shaft":
        return False
    away = (abs(line.frequency_hz / hz - round(line.frequency_hz / hz)) * hz for hz in MAINS_HZ)
    return min(away) <= _SAME_SHARE * line.frequency_hz


def _reading_variance(over_noise_db: FloatArray) -> float:
    """Variance of a level that is read in noise [dB^2], mean over channels."""
    ratio = 10 ** (np.minimum(over_noise_db, 200.0) / 10)
    return float(np.mean((10 / np.log(10)) ** 2 * 2 / ratio))
