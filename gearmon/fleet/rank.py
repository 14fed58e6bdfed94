"""Which machines change, and which indicators show it.

References
----------
J. Coble and J. W. Hines, Identifying optimal prognostic parameters from data: a genetic algorithms
approach, PHM Society (2009): monotonicity and trendability of a parameter.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from gearmon.diagnosis.history.store import opened
from gearmon.fleet.ledger import recorded
from gearmon.fleet.plan import Fleet

if TYPE_CHECKING:
    import pandas as pd

#: Fewest recordings of a machine from which a course can be told.
FEWEST = 6
# Parts of a course between whose medians steps are counted: single recordings go up and down.
_PARTS = 10


def rank(fleet: Fleet) -> list[dict[str, Any]]:
    """Rank the indicators of all machines by how clearly they change, the clearest first.

    Returns
    -------
    list of dict
        machine, indicator, recordings; monotonicity (steps up less steps down over all steps,
        between the medians of ten parts of the course), trend (Spearman's correlation with time)
        and separation (2 AUC - 1 between the recordings called a fault and the others; where there
        are not both, between the last and the first third), each in [0, 1] without its sign; rises
        (whether it rises); and clearness, the mean of the three. Values are taken against the
        median of their operating class.
    """
    import pandas as pd

    rows: list[dict[str, Any]] = []
    for machine in fleet.machines:
        with opened(fleet.store, create=False) as store:
            every = recorded(store, "l.machine = ? ORDER BY l.time_s", (machine.name,))
        told = [row for row in every if row["state"] == "done"]
        if len(told) < FEWEST:
            continue
        course = pd.DataFrame([{"score": r["score"]} | r["indicators"] for r in told])
        usual = course.groupby([row["class"] for row in told]).transform("median")
        fault = pd.Series([row["verdict"] == "fault" for row in told])
        measures = _measures(course - usual, fault)
        measures.insert(0, "machine", machine.name)
        rows += json.loads(measures.to_json(orient="records"))
    return sorted(rows, key=lambda row: -row["clearness"])


def _measures(course: pd.DataFrame, fault: pd.Series[bool]) -> pd.DataFrame:
    """Return a row an indicator that was measured in most recordings and is no constant."""
    import pandas as pd

    course = course.loc[:, (course.notna().mean() > 0.5) & (course.nunique() > 1)]
    count = len(course)
    time = pd.Series(range(count))
    parts = course.groupby(time * min(_PARTS, count) // count).median()
    steps = (parts.diff() > 0).sum() - (parts.diff() < 0).sum()
    trend = course.rank().corrwith(time)
    if fault.any() and not fault.all():
        late, early = course[fault], course[~fault]
    else:
        late, early = course[time >= 2 * count / 3], course[time < count / 3]
    ranks = pd.concat([late, early]).rank()
    wins = ranks.head(len(late)).sum() - late.count() * (late.count() + 1) / 2
    area = wins / (late.count() * early.count())
    found = pd.DataFrame(
        {
            "recordings": course.count(),
            "monotonicity": (steps / (len(parts) - 1)).abs(),
            "trend": trend.abs(),
            "separation": (2 * area - 1).abs(),
            "rises": area > 0.5,
        }
    )
    found["clearness"] = found[["monotonicity", "trend", "separation"]].mean(axis=1)
    return found.rename_axis("indicator").reset_index()
