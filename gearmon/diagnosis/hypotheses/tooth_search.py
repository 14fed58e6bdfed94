"""Which gear and which tooth explains a departure best.

Gears on one shaft turn together, and where one turns a whole number of times as often as another
every line of the first is one of the second: damage of one then departs in the pattern of both.
They are told apart on the same lines, by what either should sound like.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.hypotheses.tooth_match import ToothMatch, match_teeth, path_power
from gearmon.diagnosis.law.gear_lines import NEAR, GearDeviation
from gearmon.signatures.expected.tooth_response import ToothResponse

FloatArray = NDArray[np.float64]

# A gear competes for the blame if damage explains its own pattern by this factor (logarithm).
_COMPETES = 2.3
# Weight of the logarithm of the ratio of two gears' log factors beside that of the cells. Of 96
# pairs of gears on one shaft (17 simulated machines, one or three references) the cells alone blame
# the right one 81 times, with a weight of 8 to 12 it is 89.
_BY_FACTORS = 10.0
# Lines of a cell in which gears are told apart, at least; standard deviation of the logarithm of
# its amplitude about what is expected, and freedom of Student's law for it.
_LEAST_CELL, _CELL_DEVIATION, _FREEDOM = 4, 0.6, 4.0
# Sizes of the response that are tried there.
_SIZES = np.geomspace(0.002, 20.0, 70)


@dataclass(frozen=True, kw_only=True, eq=False)
class SearchedGear:
    """One gear with all that is needed to judge it.

    Parameters
    ----------
    difference : GearDeviation
    response : ToothResponse
    match : ToothMatch
    """

    difference: GearDeviation
    response: ToothResponse
    match: ToothMatch

    def expected_power(self, number: FloatArray) -> FloatArray:
        """Mean power of the response to a unit loss at multiples of the rotation, through the path.

        Between mesh harmonics the path is interpolated in its logarithm.
        """
        told, path = self._path
        levels = [np.interp(number / self.match.teeth, told, row) for row in path]
        power: FloatArray = np.exp(np.array(levels)) * self.response.band_power(number)
        return power

    @cached_property
    def _path(self) -> tuple[NDArray[np.int64], FloatArray]:
        """Mesh harmonics that tell of the path, and the logarithm of its power there."""
        path = path_power(self.difference.mesh_power, self.response.mesh, mean=True)
        told = np.flatnonzero(path.all(axis=0))
        return told, np.log(path[:, told])


def search_gear(
    difference: GearDeviation, response: ToothResponse, speed_hz: float
) -> SearchedGear | None:
    """Match damage on every tooth of one gear; None if its path cannot be calibrated."""
    match = match_teeth(difference, response, speed_hz)
    if match is None:
        return None
    return SearchedGear(difference=difference, response=response, match=match)


def most_likely(
    gears: Sequence[SearchedGear],
) -> tuple[SearchedGear, tuple[tuple[SearchedGear, float], ...]]:
    """Choose the gear to blame.

    Parameters
    ----------
    gears : sequence of SearchedGear
        At least one.

    Returns
    -------
    best : SearchedGear
    rivals : tuple of (SearchedGear, float)
        Gears whose patterns show the same event, with the logarithm of the factor by which the best
        explains it better.
    """
    ranked = sorted(gears, key=lambda gear: -gear.match.log_gear)
    best = ranked[0]
    rivals: list[tuple[SearchedGear, float]] = []
    for other in ranked[1:]:
        if other.match.log_gear < _COMPETES:
            break
        lead = _lead(best, other)
        if lead is None:
            continue
        if lead < 0:
            rivals = [(gear, value - lead) for gear, value in rivals]
            best, other, lead = other, best, -lead
        rivals.append((other, lead))
    return best, tuple(rivals)


def share_lines(one: SearchedGear, other: SearchedGear) -> bool:
    """Tell whether one gear turns a whole number of times as often as the other.

    Damage of suns and planets stands beside the lines of their turn, which nobody shares.
    """
    if {one.match.gear, other.match.gear} & {"sun", "planet"}:
        return False
    slow, fast = sorted((one.match.order, other.match.order))
    ratio = fast / slow
    return abs(ratio - round(ratio)) <= 1e-9 * ratio


def _lead(one: SearchedGear, other: SearchedGear) -> float | None:
    """Logarithm of how much better one gear explains the lines that both have; None if none.

    The departure's power in cells of half a mesh order is held against what either gear would add
    there, up to one common factor, its loss. A cell where nothing is heard speaks against a gear
    that should be heard in it. Where the cells hardly part them, that gear is blamed whose teeth
    the event follows better: by the ratio of their log factors, which count every line of it as
    independent.
    """
    if not share_lines(one, other):
        return None
    base, faster = (one, other) if one.match.order <= other.match.order else (other, one)
    times = round(faster.match.order / base.match.order)
    cells = _Cells.of(base.difference, faster.difference, times)
    if cells is None:
        return None
    lead = cells.log_likelihood(base, 1) - cells.log_likelihood(faster, times)
    factors = base.match.log_gear / faster.match.log_gear
    lead += _BY_FACTORS * float(np.log(factors))
    return lead if base is one else -lead


@dataclass(frozen=True, kw_only=True, eq=False)
class _Cells:
    """Power of a departure in cells of lines, noise taken off."""

    number: NDArray[np.int64]
    cell: NDArray[np.int64]
    power: FloatArray
    floor: FloatArray

    @classmethod
    def of(cls, base: GearDeviation, faster: GearDeviation, times: int) -> _Cells | None:
        number = np.concatenate([band.number for band in base.bands])
        rest = np.concatenate([band.rest for band in base.bands], axis=1)
        variance = np.concatenate([band.deviation for band in base.bands], axis=1) ** 2
        period = faster.teeth * times
        away = np.abs(number - period * np.rint(number / period)) > NEAR * times
        if not away.any():
            return None
        number, rest, variance = number[away], rest[:, away], variance[:, away]
        width = max(_LEAST_CELL, min(base.teeth, period) // 2)
        # lines that only the slower gear has stand in cells of their own
        place = 2 * (number // width) + (number % times == 0)
        _, cell = np.unique(place, return_inverse=True)
        count = np.bincount(cell)
        told = (np.abs(rest) ** 2 - 1.0) * variance
        return cls(
            number=number,
            cell=cell,
            power=np.array([np.bincount(cell, row) / count for row in told]),
            floor=np.array([np.bincount(cell, row) / count**1.5 for row in variance]),
        )

    def log_likelihood(self, gear: SearchedGear, times: int) -> float:
        """Logarithm of the likelihood of the cells under damage of one gear, up to a constant."""
        level = gear.expected_power(self.number / times)
        level[:, self.number % times != 0] = 0.0
        count = np.bincount(self.cell)
        expected = np.array([np.bincount(self.cell, row) / count for row in level])
        heard = np.maximum(self.power, 0.0) + self.floor
        size = _SIZES[:, None, None] ** 2
        departure = 0.5 * np.log(heard / (size * expected + self.floor))
        # law of Student: the path may swallow a cell altogether
        spread = np.log1p((departure / _CELL_DEVIATION) ** 2 / _FREEDOM)
        each = -0.5 * (_FREEDOM + 1.0) * spread.sum(axis=(1, 2))
        return float(each.max())
