"""What was done with every recording of a fleet, in the file that holds the histories.

The result of a recording, its row in the ledger and the summary of its machine are written in one
transaction: whoever is killed goes on where it was, and nothing is done twice or lost.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from sqlite3 import Connection
from typing import Any

from gearmon import __version__
from gearmon.diagnosis.history.entries import ENTRY, Entry
from gearmon.diagnosis.history.store import (
    append_to,
    as_text,
    largest_loss,
    opened,
    put,
    recording,
    sound,
    summarise,
)
from gearmon.errors import ArgumentError
from gearmon.files import made_folder, replacing
from gearmon.fleet.plan import Fleet, Job

#: Of what the Parquet files hold; columns may be added within a version.
RESULTS_VERSION = 1
# Rows of a Parquet file: few enough to be held in memory.
_ROWS = 50_000
# Their names; others may keep more in that folder.
_FILE = re.compile(r"[0-9]{12,}-([0-9]{12,})\.parquet")
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
    return opened(fleet.store, create=True, more=_TABLES, known=known)


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
    with writing(fleet, known=True) as store:
        return {outcome.job.path: _kept(store, outcome) for outcome in outcomes}


def _kept(store: Connection, outcome: Outcome) -> str:
    job, why = outcome.job, outcome.why
    if outcome.entry is not None:
        try:
            # in the place of what the same file said before, of no other's
            append_to(store, outcome.entry, replace=None)
            summarise(store, [outcome.entry.machine])
        except ArgumentError as error:
            why = str(error)
    state = "being written" if outcome.growing else "failed" if why else "done"
    own = {name: getattr(job, name) for name in ("path", "time_s", "size", "changed")}
    own |= {"machine": job.machine.name, "class": job.operating_class, "hash": outcome.hash}
    own |= {"state": state, "why": why, "version": __version__}
    store.execute("DELETE FROM ledger WHERE path = ?", (as_text(job.path),))  # its number ends
    put(store, "ledger", own | {"indicators": json.dumps(outcome.indicators)})
    return why or state


def counts(fleet: Fleet) -> dict[str, int]:
    """Return how many recordings of each state the ledger knows."""
    with opened(fleet.store, create=False) as store:
        return dict(map(tuple, store.execute("SELECT state, count(*) FROM ledger GROUP BY state")))


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
    for row in store.execute(asked, values).fetchall():
        own = sound(row) | {"id": row["id"]}
        kept: dict[str, Any] = dict.fromkeys(ENTRY) | {"findings": "[]", "places": "[]"}
        if own["state"] == "done":
            kept = recording(store, own["machine"], own["time_s"])
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
    while rows := _results(fleet, last):
        first, last = rows[0]["ledger_id"], rows[-1]["ledger_id"]
        target = fleet.results / f"{first:012d}-{last:012d}.parquet"
        with replacing(target) as temporary:
            pq.write_table(pa.Table.from_pylist(rows, schema), temporary, compression="zstd")
        written.append(target)
    return written


def _results(fleet: Fleet, after: int) -> list[dict[str, Any]]:
    with opened(fleet.store, create=False) as store:
        # a state that is none is damage, and said to be
        new = "state NOT IN ('failed', 'being written') AND id > ? ORDER BY id LIMIT ?"
        rows = recorded(store, new, (after, _ROWS))
    return [row | {"ledger_id": row["id"]} | largest_loss(row["places"]) for row in rows]
