"""Foreign lines that have one source: a fundamental and its multiples.

The harmonics of one source rise and fall together for the most part. Counted one by one they would
be as many chances of a false alarm, and as many witnesses of how much lines scatter.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gearmon.signatures.foreign_lines import ForeignLine

FloatArray = NDArray[np.float64]

# Highest multiple of a fundamental that is looked for.
_MULTIPLES = 20
# Unrelated lines stand at as many multiples by chance with less than this probability.
_CHANCE = 0.01


def sources(lines: Sequence[ForeignLine], widths: dict[str, float]) -> list[list[int]]:
    """Group lines that are multiples of one another.

    Parameters
    ----------
    lines : sequence of ForeignLine
        Of one recording.
    widths : dict of str to float
        Resolution of the spectrum and of the envelope [orders], by the kind of line.

    Returns
    -------
    list of list of int
        Positions of the lines of each source, fundamental first. Each line stands in one source;
        those of the spectrum and of the envelope, and those that follow the shafts and that keep
        their frequency, are held apart.

    Notes
    -----
    A line is a multiple of a fundamental if it stands within a width of it, and as many lines would
    hardly stand so near to multiples by chance: unrelated ones fall on them as a Poisson law has
    it, each with the share of the axis that the widths about the multiples cover. A source whose
    fundamental is not listed is not put together.
    """
    found = []
    for kind in sorted({line.kind for line in lines}):
        for still in (False, True):
            own = [
                i
                for i, line in enumerate(lines)
                if line.kind == kind and (line.locked == "time") == still
            ]
            own.sort(key=lambda i: lines[i].order)
            places = np.array([lines[i].order for i in own])
            found += [[own[i] for i in group] for group in _grouped(places, widths[kind])]
    return found


def _grouped(places: FloatArray, width: float) -> list[list[int]]:
    """Group rising places that are multiples of one another."""
    left = np.ones(len(places), dtype=bool)
    groups = []
    for first in range(len(places)):
        if not left[first]:
            continue
        group = [first, *_multiples(places, first, left, width)]
        left[group] = False
        groups.append(group)
    return groups


def _multiples(places: FloatArray, first: int, left: NDArray[np.bool_], width: float) -> list[int]:
    """Return which places are multiples of the first, none if that may be chance."""
    base = places[first]
    reached = int(np.searchsorted(places, (_MULTIPLES + 0.5) * base))
    candidates = first + 1 + np.flatnonzero(left[first + 1 : reached])
    # a fundamental is known to half a width; each multiple found tells it more finely
    known, at, found, expected = base, 1, list[int](), 0.0
    for i in candidates:
        number = round(places[i] / known)
        reach = width * max(1.0, number / at)
        expected += min(1.0, 2 * reach / base)
        if number > 1 and abs(places[i] - number * known) <= reach:
            found.append(int(i))
            if number > at:
                known, at = places[i] / number, number
    if not found or _poisson_reaches(len(found), expected) > _CHANCE:
        return []
    return found


def _poisson_reaches(count: int, expected: float) -> float:
    """Probability that a Poisson law reaches a count, >= 1."""
    from scipy.special import pdtrc

    return float(pdtrc(count - 1, expected))
