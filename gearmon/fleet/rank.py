"""Which machines change, which differ from others of their kind, and which indicators show it.

References
----------
J. Coble and J. W. Hines, Identifying optimal prognostic parameters from data: a genetic algorithms
approach, PHM Society (2009): monotonicity and trendability of a parameter.

Y. Benjamini and Y. Hochberg, Controlling the false discovery rate, J. R. Stat. Soc. B 57 (1995).
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from gearmon.diagnosis.history.store import opened
from gearmon.errors import ArgumentError
from gearmon.fleet.ledger import recorded
from gearmon.fleet.plan import Fleet, FleetMachine
from gearmon.machine import load_machine

if TYPE_CHECKING:
    import pandas as pd

#: Fewest recordings of a machine from which a course can be told.
FEWEST = 6
#: Fewest others beside which a machine is seen: their scatter has two degrees of freedom then; and
#: the latest recordings of a machine of which the median is taken.
FEWEST_OTHERS, LATEST = 3, 20
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
            every = recorded(store, "machine = ? ORDER BY time_s", (machine.name,))
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


def compare(fleet: Fleet, machine: FleetMachine | None = None) -> list[dict[str, Any]]:
    """Put every machine beside the others with the same gears, the most different first.

    Parameters
    ----------
    fleet : Fleet
    machine : FleetMachine, optional
        Only those with the same gears as this one; all kinds by default.

    Returns
    -------
    list of dict
        A row for a machine, an operating class and an indicator: machine, class, indicator;
        value, the median of its latest recordings; usual, the mean of the others (the geometric
        one where all are positive); low and high, between which 90 % of such machines would lie;
        others (how many); probability, two-sided, of a difference like this among machines alike;
        and false_discoveries, the share of chance finds among all rows at least as improbable.

    Raises
    ------
    ArgumentError
        If no kind has enough machines.

    Notes
    -----
    A further value x of a normal law of which n others have mean m and standard deviation s lies so
    that (x - m) / (s sqrt(1 + 1 / n)) is Student's with n - 1 degrees of freedom. Few others make a
    wide law: of three, only what is eight of their standard deviations away has a probability below
    2 %. Another one that is broken widens it too. The share of false discoveries holds for rows
    that are independent or depend positively on each other.
    """
    from scipy.stats import false_discovery_control

    stages = {file: load_machine(file).stages for file in {own.file for own in fleet.machines}}
    kinds: dict[Any, list[FleetMachine]] = {}
    for own in fleet.machines:
        kinds.setdefault(stages[own.file], []).append(own)
    rows = [
        row
        for alike in kinds.values()
        if len(alike) > FEWEST_OTHERS and (machine is None or machine in alike)
        for row in _beside(fleet, alike)
    ]
    if not rows:
        told = f"{FEWEST_OTHERS + 1} machines with the same gears and recordings of one class"
        raise ArgumentError(f"{fleet.name}: nothing to compare; it takes {told}")
    shares = false_discovery_control([row["probability"] for row in rows])
    told_rows = [row | {"false_discoveries": float(q)} for row, q in zip(rows, shares, strict=True)]
    return sorted(told_rows, key=lambda row: row["probability"])


def _beside(fleet: Fleet, alike: list[FleetMachine]) -> Iterator[dict[str, Any]]:
    """Yield the rows of machines of one kind."""
    import pandas as pd
    from scipy.stats import t as student

    with opened(fleet.store, create=False) as store:
        order = "machine = ? AND state = 'done' ORDER BY time_s DESC LIMIT ?"
        told = [
            {"machine": own.name, "class": row["class"]} | row["indicators"]
            for own in alike
            for row in recorded(store, order, (own.name, LATEST))
        ]
    if not told:
        return
    latest = pd.DataFrame(told).groupby(["class", "machine"], sort=True).median()
    for group, name in itertools.product(latest.index.unique("class"), latest.columns):
        values = latest.loc[group, name].dropna()
        own = values.to_numpy(float)
        count = own.size - 1
        if count < FEWEST_OTHERS or np.ptp(own) == 0:
            continue
        positive = bool(own.min() > 0)
        scaled = np.log(own) if positive else own
        apart = scaled - scaled.mean()
        mean = scaled - apart * (count + 1) / count
        # of the others: what is left of the sum of squares without one of them
        squares = np.sum(apart**2) - apart**2 * (count + 1) / count
        scatter = np.sqrt(np.maximum(squares, 0) / (count - 1) * (1 + 1 / count))
        with np.errstate(divide="ignore", invalid="ignore"):  # others that are all alike
            away = np.nan_to_num(np.abs(scaled - mean) / scatter)
        reach = student.ppf(0.95, count - 1) * scatter
        columns = {"value": scaled, "usual": mean, "low": mean - reach, "high": mean + reach}
        table = pd.DataFrame({c: np.exp(x) if positive else x for c, x in columns.items()})
        table = table.assign(others=count, probability=2 * student.sf(away, count - 1))
        for machine, row in zip(values.index, table.to_dict("records"), strict=True):
            place = {"machine": machine, "class": group, "indicator": name}
            yield place | {str(column): value for column, value in row.items()}


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
