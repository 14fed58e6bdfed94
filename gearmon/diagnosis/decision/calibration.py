"""What a strength of evidence means: the share of healthy machines that show as much.

The table `calibration.json` was made by `gearmon benchmark calibration` from healthy pairs of
machines drawn at random, of which the detector knows the file only; it says how many. Beyond its
last entry the probability falls by a decade for each unit of strength, which is what strength means
where the tests' own laws hold.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import lru_cache
from importlib import resources
from typing import Any

import numpy as np

#: Shares of healthy pairs at which the table gives the strength.
SHARES = (0.9, 0.7, 0.5, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01)
#: Distance of states [nepers of load] from which a recording counts as far from its references.
FAR = 0.25
_DECADE = 1.0
# Least logarithm of a probability: it stays a number above 0, whatever the strength.
_LEAST = -300.0


def situation(references: int, gap: float) -> str:
    """Name the situation of a comparison: how many references, and how near the nearest is."""
    count = "one" if references == 1 else "several"
    return f"{count}, {'far' if gap > FAR else 'near'}"


def false_alarm_probability(strength: float, references: int, gap: float) -> float:
    """Share of healthy machines that show evidence of this strength.

    Parameters
    ----------
    strength : float
        Of the strongest test.
    references : int, >= 1
        Healthy recordings learned.
    gap : float, >= 0
        Distance of the recording's operating state to the nearest reference's [Np].

    Returns
    -------
    float, in (0, 1]

    Examples
    --------
    >>> low, high = (false_alarm_probability(s, 3, 0.0) for s in (0.0, 4.0))
    >>> low > 0.05 > 0.001 > high
    True
    """
    known = _table()["situations"][situation(references, gap)]
    return probability_of(strength, known["strength"], known["share"])


def probability_of(strength: float, known: Sequence[float], shares: Sequence[float]) -> float:
    """Interpolate log10 of the share that exceeds a strength."""
    logs = np.log10(np.asarray(shares, dtype=np.float64))
    if strength <= known[0]:
        # weaker than what nine of ten show: between there and certainty
        return float(shares[0] + (1.0 - shares[0]) * min(1.0, known[0] - strength))
    if strength >= known[-1]:
        beyond = logs[-1] - (strength - known[-1]) / _DECADE
        return float(10.0 ** max(beyond, _LEAST))
    return float(10.0 ** np.interp(strength, known, logs))


def table_of(strengths: Mapping[str, Sequence[float]], origin: str) -> dict[str, Any]:
    """Make the table from strengths of healthy pairs, by situation.

    Parameters
    ----------
    strengths : mapping of str to sequence of float
        Situation, see `situation`, to the strengths seen.
    origin : str
        How they were made.
    """
    entries = {}
    for name, values in strengths.items():
        levels = np.quantile(np.asarray(values), 1.0 - np.asarray(SHARES))
        levels = np.maximum.accumulate(levels + 1e-6 * np.arange(len(SHARES)))
        entries[name] = {
            "pairs": len(values),
            "share": list(SHARES),
            "strength": [round(float(level), 6) for level in levels],
        }
    return {"format": "gearmon calibration 1", "origin": origin, "situations": entries}


@lru_cache(maxsize=1)
def _table() -> dict[str, Any]:
    text = resources.files("gearmon.diagnosis.decision").joinpath("calibration.json").read_text()
    table: dict[str, Any] = json.loads(text)
    return table
