"""How foreign lines changed against healthy recordings, and how often a healthy machine does so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.foreign_names import MAINS_HZ
from gearmon.diagnosis.speed_scatter import speed_scatter_db
from gearmon.gears.kinematics import Kinematics
from gearmon.signatures.foreign_lines import ForeignLine, ForeignLines
from gearmon.signatures.foreign_search import OWN_WIDTHS, noise_exceeds
from gearmon.signatures.gear_orders import distance_to, known_orders

FloatArray = NDArray[np.float64]

# What a foreign line of a healthy machine is taken to change by from one recording to another
# before any is seen [dB], and the differences that this prior is worth.
PRIOR_CHANGE_DB, PRIOR_WORTH = 3.0, 10.0
# Lines below the noise of the reference that a healthy machine has at least, on average.
_LEAST_HIDDEN = 0.2
# Lines so little above the least that is listed tell how many stand below it [dB].
_NEAR_NOISE_DB = 6.0
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
        Logarithm of the expected number of lines of a healthy machine that change as much.
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
        pooled, worth = self._scatter([before for _, before in kept])
        opportunities = sum(bool(before.listed.any()) for _, before in kept) + self._hidden
        return [self._change(line, b, pooled, worth, opportunities) for line, b in kept]

    @cached_property
    def _hidden(self) -> float:
        """Lines that healthy recordings may hide below their noise."""
        near = [
            sum(
                max(line.over_noise_db) < other.grid(line.kind).least_db + _NEAR_NOISE_DB
                for line in other
            )
            for other in self.healthy
        ]
        return _LEAST_HIDDEN + float(np.mean(near))

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

    def _scatter(self, before: Sequence[_Before]) -> tuple[float, float]:
        """Variance between healthy recordings and the differences that it rests on."""
        total, worth = PRIOR_WORTH * PRIOR_CHANGE_DB**2, PRIOR_WORTH
        for one in before:
            if one.listed.all() and len(one.listed) > 1:
                # the variance of a difference is twice that of either level
                total += 2 * float(np.var(one.level_db.mean(axis=1)) * len(one.listed))
                worth += len(one.listed) - 1
        return total / worth, worth

    def _change(
        self,
        line: ForeignLine,
        before: _Before,
        pooled: float,
        worth: float,
        opportunities: float,
    ) -> LineChange:
        grid = self.lines.grid(line.kind)
        over = np.array(line.over_noise_db)
        heard = over >= min(grid.least_db, over.max())
        gain = self.gain_db if line.kind == "spectrum" else np.zeros(len(over))
        then = before.level_db[:, heard].mean(axis=1)
        now = float(np.mean((np.array(line.level_db) - gain)[heard]))
        count = len(then)
        own = 2 * float(np.var(then, ddof=1)) if count > 1 else 0.0
        # a mean over several healthy recordings moves less than one of them
        share = 0.5 * (1 + 1 / count)
        variance = share * max(pooled, own) + 0.5 * _reading_variance(over[heard])
        if line.locked != "time" and line.kind == "spectrum":
            moves = min(abs(self.lines.speed_hz / x.speed_hz - 1) for x in self.healthy)
            variance += speed_scatter_db(moves, independent=float(heard.sum())) ** 2
        change, sigma = now - float(then.mean()), float(np.sqrt(variance))
        new = not before.listed.any()
        expected = opportunities * _t_exceeds(change / sigma, worth)
        if new:
            ratio = 10 ** (over.max() / 10)
            expected += grid.looked_at * float(noise_exceeds(ratio, grid.pieces))
        return LineChange(
            line=line,
            change_db=change,
            sigma_db=sigma,
            new=new,
            log10_probability=float(np.log10(max(expected, 10.0**LEAST_LOG10))),
        )


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


def _t_exceeds(value: float, freedom: float) -> float:
    """Probability that Student's t with so many degrees of freedom exceeds a value."""
    from scipy.special import stdtr

    return float(stdtr(freedom, -value))
