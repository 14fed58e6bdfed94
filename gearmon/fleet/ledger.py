"""What was done with every recording of a fleet, kept with the histories, and what follows from it.

The result of a recording, its row in the ledger and the summary of its machine are written in one
transaction: whoever is killed goes on where it was, and nothing is done twice or lost.

Alarms, one a finding and operating class, are raised and cleared after several recordings in a row.
They follow from the ledger alone, whatever the order in which recordings were analysed; what is
kept beside them is who was told, and who has acknowledged. From the indicators it follows which
machines change (`rank`) and which differ from others of their kind (`compare`).

References
----------
J. Coble and J. W. Hines, Identifying optimal prognostic parameters from data: a genetic algorithms
approach, PHM Society (2009): monotonicity and trendability of a parameter.

Y. Benjamini and Y. Hochberg, Controlling the false discovery rate, J. R. Stat. Soc. B 57 (1995).
"""

from __future__ import annotations

import json
import re
import subprocess
import time
import urllib.request
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from email.message import EmailMessage
from pathlib import Path
from sqlite3 import Connection
from typing import Any

import numpy as np

from gearmon import __version__
from gearmon.diagnosis.history import store as histories
from gearmon.diagnosis.history.entries import ENTRY, Entry, time_text
from gearmon.errors import ArgumentError
from gearmon.files import made_folder, replacing
from gearmon.fleet.plan import Fleet, FleetMachine, Hook, Job
from gearmon.machine import load_machine
from gearmon.report.wording import printable

#: Of what the Parquet files hold; columns may be added within a version.
RESULTS_VERSION = 1
# Rows of a Parquet file: few enough to be held in memory.
_ROWS = 50_000
# Their names; others may keep more in that folder.
_FILE = re.compile(r"[0-9]{12,}-([0-9]{12,})\.parquet")
# Seconds until a hook is given up, and until it is tried again.
_PATIENCE_S, _AGAIN_S = 20.0, (1.0, 4.0, 16.0)
_KEY = ("machine", "class", "finding", "since_s")
#: A recording that could not be analysed at all.
NOT_ANALYSED = "not analysed"
#: Fewest recordings of a machine from which a course can be told.
FEWEST = 6
#: Fewest others beside which a machine is seen: their scatter has two degrees of freedom then; and
#: the latest recordings of a machine of which the median is taken.
FEWEST_OTHERS, LATEST = 3, 20
# Parts of a course between whose medians steps are counted: single recordings go up and down.
_PARTS = 10
#: `alarms` is made anew from the ledger, but for who was told and who has acknowledged.
_TABLES = """
CREATE TABLE IF NOT EXISTS ledger
    (id INTEGER PRIMARY KEY AUTOINCREMENT, path TEXT NOT NULL UNIQUE, machine TEXT NOT NULL,
     class TEXT NOT NULL, time_s REAL NOT NULL, size INTEGER NOT NULL, changed TEXT NOT NULL,
     hash TEXT NOT NULL, state TEXT NOT NULL, why TEXT NOT NULL, version TEXT NOT NULL,
     indicators TEXT NOT NULL, alarmed INTEGER NOT NULL DEFAULT 0, checksum TEXT);
CREATE INDEX IF NOT EXISTS ledger_by_machine ON ledger (machine, time_s);
CREATE INDEX IF NOT EXISTS ledger_alarmed ON ledger (machine) WHERE alarmed = 0;
CREATE TABLE IF NOT EXISTS alarms
    (machine TEXT NOT NULL, class TEXT NOT NULL, finding TEXT NOT NULL, since_s REAL NOT NULL,
     until_s REAL, told TEXT NOT NULL DEFAULT '[]', acknowledged INTEGER NOT NULL DEFAULT 0,
     checksum TEXT, PRIMARY KEY (machine, class, finding, since_s));
"""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of a recording.

    Parameters
    ----------
    job : Job
    hash : str
        Of its content.
    entry : Entry or None
        What its history keeps; None if it could not be analysed.
    why : str
        Why it could not.
    growing : bool
        Whether it changed while it was read.
    indicators : dict of str to dict of str to float
        Condition indicators: name -> channel -> value.
    """

    job: Job
    hash: str = ""
    entry: Entry | None = None
    why: str = ""
    growing: bool = False
    indicators: dict[str, dict[str, float]] = field(default_factory=dict)


def writing(fleet: Fleet, *, known: bool = False) -> AbstractContextManager[Connection]:
    """Open the store of a fleet to write: one transaction."""
    return histories.opened(fleet.store, create=True, more=_TABLES, known=known)


def known(fleet: Fleet) -> dict[str, list[Any]]:
    """Return size, time of change, state and version of every recording in the ledger."""
    with writing(fleet) as store:
        rows = store.execute("SELECT path, size, changed, state, version FROM ledger")
        return {path: told for path, *told in rows}


def keep(fleet: Fleet, outcomes: Iterable[Outcome]) -> dict[str, str]:
    """Write what became of recordings, after `known`, all or none of it.

    Returns
    -------
    dict of str to str
        By path "done", "being written", or why it cannot be used.
    """
    kept: dict[str, str] = {}
    with writing(fleet, known=True) as store:
        for outcome in outcomes:
            job, why = outcome.job, outcome.why
            if outcome.entry is not None:
                try:
                    # in the place of what the same file said before, of no other's
                    histories.append_to(store, outcome.entry, replace=None)
                    histories.summarise(store, [outcome.entry.machine])
                except ArgumentError as error:
                    why = str(error)
            state = "being written" if outcome.growing else "failed" if why else "done"
            own = {name: getattr(job, name) for name in ("path", "time_s", "size", "changed")}
            own |= {"machine": job.machine.name, "class": job.operating_class, "hash": outcome.hash}
            own |= {"state": state, "why": why, "version": __version__}
            # its number ends
            store.execute("DELETE FROM ledger WHERE path = ?", (histories.as_text(job.path),))
            histories.put(store, "ledger", own | {"indicators": json.dumps(outcome.indicators)})
            kept[job.path] = why or state
    return kept


def recorded(store: Connection, where: str, values: Sequence[Any]) -> list[dict[str, Any]]:
    """Return rows of the ledger with what the history says of them, checked.

    Parameters
    ----------
    store : Connection
    where : str
        Condition and order in SQL.
    values : sequence
        For its question marks.

    Returns
    -------
    list of dict
        Columns of the ledger and of the recording, if it is done; findings as list of str, and
        indicators as a mapping of "name, channel" to value.

    Raises
    ------
    ValueError
        If a row is not what was written.
    """
    rows, asked = [], f"SELECT * FROM ledger WHERE {where}"  # noqa: S608 - ours
    for own in histories.rows(store, asked, values):
        kept: dict[str, Any] = dict.fromkeys(ENTRY) | {"findings": "[]", "places": "[]"}
        if own["state"] == "done":
            kept = histories.recording(store, own["machine"], own["time_s"])
            if not kept:
                raise ValueError(f"a recording of {own['machine']!r} is missing")
        told = json.loads(own["indicators"]).items()
        own["indicators"] = {f"{name}, {one}": v for name, by in told for one, v in by.items()}
        rows.append(kept | own | {"findings": json.loads(kept["findings"])})
    return rows


def write_results(fleet: Fleet) -> list[Path]:
    """Write what the Parquet files of a fleet do not hold yet; return the files written.

    Notes
    -----
    A row a recording: ledger_id, path, machine, class, time_s, verdict, score,
    false_alarm_probability, speed_hz, findings (list), loss, loss_low, loss_high (the largest of a
    gear, as estimated), hash, version, indicators (map of "name, channel" to value). A recording
    that was analysed again stands there twice: the higher ledger_id counts. The metadata key
    "gearmon" holds the version of this schema.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    texts = ("path", "machine", "class", "verdict", "hash", "version")
    numbers = ("time_s", "score", "false_alarm_probability", "speed_hz")
    types = {"ledger_id": pa.int64()} | dict.fromkeys(texts, pa.string())
    types |= dict.fromkeys((*numbers, "loss", "loss_low", "loss_high"), pa.float64())
    types |= {"findings": pa.list_(pa.string()), "indicators": pa.map_(pa.string(), pa.float64())}
    schema = pa.schema(types, {"gearmon": json.dumps({"fleet results": RESULTS_VERSION})})
    made_folder(fleet.results)
    written: list[Path] = []
    there = (_FILE.fullmatch(path.name) for path in fleet.results.iterdir())
    last = max((int(own[1]) for own in there if own), default=0)
    # a state that is none is damage, and said to be
    new = "state NOT IN ('failed', 'being written') AND id > ? ORDER BY id LIMIT ?"
    while True:
        with histories.opened(fleet.store, create=False) as store:
            rows = recorded(store, new, (last, _ROWS))
        if not rows:
            return written
        told = [r | {"ledger_id": r["id"]} | histories.largest_loss(r["places"]) for r in rows]
        first, last = rows[0]["id"], rows[-1]["id"]
        target = fleet.results / f"{first:012d}-{last:012d}.parquet"
        with replacing(target) as temporary:
            pq.write_table(pa.Table.from_pylist(told, schema), temporary, compression="zstd")
        written.append(target)


def renew(fleet: Fleet) -> None:
    """Bring the alarms of all machines with new recordings up to date, in one transaction."""
    known = "machine = ? AND state != 'being written' ORDER BY time_s, path"
    with writing(fleet) as store:
        new = store.execute("SELECT DISTINCT machine FROM ledger WHERE alarmed = 0").fetchall()
        for machine in filter(None, (fleet.machine(name) for (name,) in new)):
            classes: dict[str, list[tuple[float, set[str]]]] = defaultdict(list)
            for row in recorded(store, known, (machine.name,)):
                classes[row["class"]].append((row["time_s"], _findings(row, machine)))
            rule = machine.alarm_after, machine.alarm_clear
            now = {
                (machine.name, name, finding, since): until
                for name, rows in classes.items()
                for finding, since, until in episodes(rows, *rule)
            }
            asked = "SELECT * FROM alarms WHERE machine = ?"
            stored = histories.rows(store, asked, (machine.name,))
            before = {tuple(row[name] for name in _KEY): row for row in stored}
            # a recording that arrived late has taken them back, or moved their begin
            gone = {key: row for key, row in before.items() if key not in now}
            moved = {key[:3]: row for key, row in gone.items()}
            for key, until in now.items():
                own = before.get(key, {"told": "[]", "acknowledged": 0})
                own = moved.get(key[:3], own) if own["told"] == "[]" else own
                told = dict(zip(_KEY, key, strict=True)) | {"until_s": until}
                histories.put(store, "alarms", own | told)
            where = " AND ".join(f"{name} = ?" for name in _KEY)
            store.executemany(f"DELETE FROM alarms WHERE {where}", gone)  # noqa: S608 - ours
        store.execute("UPDATE ledger SET alarmed = 1 WHERE alarmed = 0")


def _findings(row: dict[str, Any], machine: FleetMachine) -> set[str]:
    """Return what a recording found, by kind and gear: tooth and size go up and down."""
    if row["state"] == "failed":
        return {NOT_ANALYSED}
    if row["verdict"] not in machine.alarm_on:
        return set()
    findings = [text.partition(":")[0] for text in row["findings"]]
    kinds = {re.sub(r", tooth \d+", "", finding) for finding in findings}
    return kinds if row["verdict"] == "fault" and kinds else {row["verdict"]}


def episodes(
    rows: Iterable[tuple[float, set[str]]], after: int, clear: int
) -> Iterator[tuple[str, float, float | None]]:
    """Give every alarm of one machine and class: the finding, since when, until when (or None).

    Parameters
    ----------
    rows : iterable of (float, set of str)
        Time and findings of the recordings, in their order.
    after, clear : int
        Recordings in a row with the finding, and without it.

    Examples
    --------
    >>> rows = [(t, {"wear"} if t in (1, 3, 4, 6) else set()) for t in range(10)]
    >>> list(episodes(rows, 2, 3))
    [('wear', 3, 7)]
    """
    listed = list(rows)
    for finding in sorted({finding for _, found in listed for finding in found}):
        since: float | None = None
        streak: list[float] = []  # of what would change the state
        for time_s, found in listed:
            streak = [*streak, time_s] if (finding in found) == (since is None) else []
            if since is None and len(streak) == after:
                since, streak = streak[0], []
            elif since is not None and len(streak) == clear:
                yield finding, since, streak[0]
                since, streak = None, []
        if since is not None:
            yield finding, since, None


def alarms(fleet: Fleet, machine: str | None = None) -> list[dict[str, Any]]:
    """Return the alarms of a fleet, or of one machine, the newest first, in built-in types.

    Parameters
    ----------
    fleet : Fleet
    machine : str, optional
        Name of the one machine; by default all.

    Returns
    -------
    list of dict
        id, machine, class, finding, since and until (times in words; None while it lasts), over,
        acknowledged and told (targets that know of it), among others.
    """
    with histories.opened(fleet.store, create=False) as store:
        asked = "SELECT rowid AS id, * FROM alarms WHERE machine = coalesce(?, machine) "
        newest_first = "ORDER BY since_s DESC, machine, class, finding"
        found = histories.rows(store, asked + newest_first, (machine,))
    for own in found:
        until = own.pop("until_s")
        own |= {"since": time_text(own["since_s"]), "acknowledged": bool(own["acknowledged"])}
        own |= {"until": None if until is None else time_text(until), "over": until is not None}
        own["told"] = json.loads(own["told"])
    return found


def acknowledge(fleet: Fleet, number: int) -> None:
    """Note that a person knows of an alarm.

    Parameters
    ----------
    fleet : Fleet
    number : int
        The alarm's `id`, as `alarms` gives it.
    """
    _note(fleet, number, acknowledged=1)


def deliver(fleet: Fleet) -> list[str]:
    """Tell the hooks of every alarm that they do not know of; return what went wrong.

    Parameters
    ----------
    fleet : Fleet

    Returns
    -------
    list of str
        A line for each hook that could not be told, with the reason.

    Notes
    -----
    Who is killed between telling and noting so tells again. One that is over or acknowledged
    before anybody was told is not told any more.
    """
    trouble: dict[str, str] = {}
    for alarm in alarms(fleet):
        machine = fleet.machine(alarm["machine"])
        if alarm["over"] or alarm["acknowledged"] or machine is None:
            continue
        for hook in fleet.hooks:
            for target, send in _targets(hook, machine, alarm):
                # who cannot be told of one alarm does not hold up the others
                if target in alarm["told"] or target in trouble:
                    continue
                if why := _tried(send):
                    trouble[target] = f"{target}: could not be told of an alarm ({why})"
                    continue
                alarm["told"].append(target)
                _note(fleet, alarm["id"], told=json.dumps(alarm["told"]))
    return list(trouble.values())


def _note(fleet: Fleet, number: int, **known: str | int) -> None:
    """Change what an alarm's row says, if there still is one."""
    with writing(fleet) as store:
        for row in histories.rows(store, "SELECT * FROM alarms WHERE rowid = ?", (number,)):
            histories.put(store, "alarms", row | known)


def _targets(hook: Hook, machine: FleetMachine, alarm: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Give whom a hook tells, and how."""
    wanted = not hook.tags or set(hook.tags) & set(machine.tags)
    if not wanted or (hook.classes and alarm["class"] not in hook.classes):
        return
    body = {name: alarm[name] for name in ("machine", "class", "finding", "since")}
    told = json.dumps(body | {"tags": list(machine.tags)}, ensure_ascii=False).encode()
    if hook.command:
        yield f"command {hook.command[0]}", lambda: _run(hook.command, told)
    if hook.webhook:
        yield f"webhook {hook.webhook}", lambda: _post(hook.webhook, told)
    for address in hook.mail:
        message = EmailMessage()
        message["To"] = address
        # no line of its own may end that of the subject
        message["Subject"] = printable(f"{alarm['machine']}: {alarm['finding']}")
        said = "".join(f"{name}: {value}\n" for name, value in body.items() if value)
        message.set_content(said)
        letter = message.as_bytes()
        yield f"mail {address}", lambda letter=letter: _run(("sendmail", "-t", "-oi"), letter)


def _tried(send: Any) -> str:
    """Try several times; return why it did not work, "" if it did."""
    why = ""
    for pause in (*_AGAIN_S, 0.0):
        try:
            send()
            return ""
        except (OSError, subprocess.SubprocessError) as error:
            why = " ".join(str(error).split())
            time.sleep(pause)
    return why


def _run(words: tuple[str, ...], content: bytes) -> None:
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    subprocess.run(words, input=content, timeout=_PATIENCE_S, check=True, **quiet)


def _post(url: str, content: bytes) -> None:
    request = urllib.request.Request(url, content, {"Content-Type": "application/json"})
    urllib.request.urlopen(request, timeout=_PATIENCE_S).close()


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
        with histories.opened(fleet.store, create=False) as store:
            every = recorded(store, "machine = ? ORDER BY time_s", (machine.name,))
        told = [row for row in every if row["state"] == "done"]
        if len(told) < FEWEST:
            continue
        course = pd.DataFrame([{"score": r["score"]} | r["indicators"] for r in told])
        course -= course.groupby([row["class"] for row in told]).transform("median")
        # measured in most recordings, and no constant
        course = course.loc[:, (course.notna().mean() > 0.5) & (course.nunique() > 1)]
        count, time = len(told), pd.Series(range(len(told)))
        parts = course.groupby(time * min(_PARTS, count) // count).median()
        steps = (parts.diff() > 0).sum() - (parts.diff() < 0).sum()
        late = pd.Series([row["verdict"] == "fault" for row in told])
        early = ~late
        if not (late.any() and early.any()):
            late, early = time >= 2 * count / 3, time < count / 3
        known, before = course[late].count(), course[early].count()
        wins = course.where(late | early).rank()[late].sum() - known * (known + 1) / 2
        measures = pd.DataFrame(
            {
                "recordings": course.count(),
                "monotonicity": (steps / (len(parts) - 1)).abs(),
                "trend": course.rank().corrwith(time).abs(),
                "separation": (2 * wins / (known * before) - 1).abs(),
                "rises": wins / (known * before) > 0.5,
            }
        )
        clear = measures[["monotonicity", "trend", "separation"]].mean(axis=1)
        table = measures.assign(clearness=clear).rename_axis("indicator").reset_index()
        table.insert(0, "machine", machine.name)
        rows += json.loads(table.to_json(orient="records"))
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
    import pandas as pd
    from scipy.stats import false_discovery_control
    from scipy.stats import t as student

    stages = {file: load_machine(file).stages for file in {own.file for own in fleet.machines}}
    kinds = list(stages.values())
    with histories.opened(fleet.store, create=False) as store:
        order = "machine = ? AND state = 'done' ORDER BY time_s DESC LIMIT ?"
        told = [
            (kinds.index(stages[own.file]), row["class"], name, own.name, value)
            for own in fleet.machines
            if machine is None or stages[own.file] == stages[machine.file]
            for row in recorded(store, order, (own.name, LATEST))
            for name, value in row["indicators"].items()
        ]
    alike, columns = ["kind", "class", "indicator"], ["machine", "value"]
    every = pd.DataFrame(told, columns=[*alike, *columns]).astype({"value": float})
    values = every.groupby([*alike, "machine"])["value"].median().dropna()
    group = values.groupby(level=alike)
    others, positive = group.transform("size") - 1, group.transform("min") > 0
    kept = (others >= FEWEST_OTHERS) & (group.transform("max") > group.transform("min"))
    if not kept.any():
        needed = f"{FEWEST_OTHERS + 1} machines with the same gears and recordings of one class"
        raise ArgumentError(f"{fleet.name}: nothing to compare; it takes {needed}")
    values, count, positive = values[kept], others[kept], positive[kept]
    scaled = np.log(values.where(positive)).fillna(values)
    apart = scaled - scaled.groupby(level=alike).transform("mean")
    mean = scaled - apart * (count + 1) / count
    # of the others: what is left of the sum of squares without one of them
    squares = (apart**2).groupby(level=alike).transform("sum") - apart**2 * (count + 1) / count
    scatter = np.sqrt(squares.clip(lower=0.0) / (count - 1) * (1 + 1 / count))
    reach = student.ppf(0.95, count - 1) * scatter
    ends = {"value": scaled, "usual": mean, "low": mean - reach, "high": mean + reach}
    table = pd.DataFrame(ends)
    table = table.where(positive).apply(np.exp).fillna(table)
    # others that are all alike leave no scatter to divide by
    away = ((scaled - mean).abs() / scatter).fillna(0.0)
    chance = 2 * student.sf(away, count - 1)
    table = table.assign(others=count, probability=chance)
    table["false_discoveries"] = false_discovery_control(chance)
    ranked = table.sort_values("probability", kind="stable").reset_index()
    rows: list[Any] = ranked[["machine", *alike[1:], *table]].to_dict("records")
    return rows
