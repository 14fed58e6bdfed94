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
from gearmon.diagnosis.history import Entry
from gearmon.diagnosis.history.store import append_to, as_text, opened, put, sound, summarise, vouch
from gearmon.errors import ArgumentError
from gearmon.files import replacing
from gearmon.fleet.plan import Fleet, Job

#: Of what the Parquet files hold; columns may be added within a version.
RESULTS_VERSION = 1
# Rows of a Parquet file: few enough to be held in memory.
_ROWS = 50_000
# Their names; others may keep more in that folder.
_FILE = re.compile(r"[0-9]{12,}-([0-9]{12,})\.parquet")
# Columns of the ledger that a checksum guards.
_GUARDED = (
    *("path", "machine", "class", "time_s", "size", "changed"),
    *("hash", "state", "why", "version", "indicators"),
)
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


def known(fleet: Fleet) -> dict[str, tuple[int, str, str, str]]:
    """Return size, time of change, state and version of every recording in the ledger."""
    with writing(fleet) as store:
        rows = store.execute("SELECT path, size, changed, state, version FROM ledger")
        return {row[0]: (row[1], row[2], row[3], row[4]) for row in rows}


def keep(fleet: Fleet, outcome: Outcome) -> str:
    """Write what became of a recording, after `known`; return "done", or why not."""
    with writing(fleet, known=True) as store:
        why = outcome.why
        if outcome.entry is not None:
            try:
                _add(store, outcome.entry)
            except ArgumentError as error:
                why = str(error)
        state = "being written" if outcome.growing else "failed" if why else "done"
        _insert(store, outcome, state, why)
    return why or state


def _add(store: Connection, entry: Entry) -> None:
    """Add to the history; in the place of what the same file said before, of no other's."""
    before = store.execute(
        "SELECT recording FROM recordings WHERE machine = ? AND time_s = ?",
        (as_text(entry.machine), entry.time_s),
    ).fetchone()
    own = before is not None and before[0] == as_text(entry.recording)
    append_to(store, entry, replace=own)
    summarise(store, [entry.machine])


def _insert(store: Connection, outcome: Outcome, state: str, why: str = "") -> None:
    job = outcome.job
    row = {
        "path": job.path,
        "machine": job.machine.name,
        "class": job.operating_class,
        "time_s": job.time_s,
        "size": job.size,
        "changed": job.changed,
        "hash": outcome.hash,
        "state": state,
        "why": why,
        "version": __version__,
        "indicators": json.dumps(outcome.indicators),
    }
    store.execute("DELETE FROM ledger WHERE path = ?", (as_text(job.path),))  # its number ends
    put(store, "ledger", row)


def keep_growing(fleet: Fleet, jobs: Iterable[Job]) -> None:
    """Write down which recordings are still being written."""
    with writing(fleet) as store:
        for job in jobs:
            _insert(store, Outcome(job=job), "being written")


def counts(fleet: Fleet) -> dict[str, int]:
    """Return how many recordings of each state the ledger knows."""
    with opened(fleet.store, create=False) as store:
        return dict(map(tuple, store.execute("SELECT state, count(*) FROM ledger GROUP BY state")))


_KNOWN = """
SELECT l.*, l.id AS ledger_id, r.id AS number, r.checksum AS known, r.verdict, r.score,
    r.false_alarm_probability, r.speed_hz, r.findings, p.loss, p.loss_low, p.loss_high
FROM ledger l LEFT JOIN recordings r
    ON r.machine = l.machine AND r.time_s = l.time_s AND l.state = 'done'
LEFT JOIN places p ON p.rowid = (SELECT rowid FROM places WHERE recording_id = r.id
    AND tooth IS NULL AND loss IS NOT NULL ORDER BY loss DESC LIMIT 1)
WHERE
"""


def recorded(
    store: Connection, where: str, values: Sequence[Any], *, shown: bool = False
) -> list[dict[str, Any]]:
    """Return rows of the ledger with what the history says of them, checked.

    Parameters
    ----------
    store : Connection
    where : str
        Condition and order in SQL, in which l is the ledger.
    values : sequence
        For its question marks.
    shown : bool
        Whether they are for the eye: what the history says is not checked then, place by place.

    Returns
    -------
    list of dict
        Columns of the ledger; verdict and findings (list of str), among others of the recording,
        the largest loss of a gear, and indicators as a mapping of "name, channel" to value.

    Raises
    ------
    ValueError
        If a row is not what was written.
    """
    rows = [dict(row) for row in store.execute(f"{_KNOWN} {where}", values)]
    for row in rows:
        sound(row, _GUARDED)
        if row["state"] == "done" and row["number"] is None:
            raise ValueError(f"a recording of {row['machine']!r} is missing")
        if row["number"] is not None and not shown:
            vouch(store, {"id": row["number"], "checksum": row["known"]})
        row["findings"] = json.loads(row["findings"] or "[]")
        told = json.loads(row["indicators"]).items()
        row["indicators"] = {f"{name}, {one}": v for name, own in told for one, v in own.items()}
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
    losses = ("loss", "loss_low", "loss_high")
    types = [("ledger_id", pa.int64()), *((name, pa.string()) for name in texts)]
    types += [(name, pa.float64()) for name in (*numbers, *losses)]
    types += [("findings", pa.list_(pa.string()))]
    types += [("indicators", pa.map_(pa.string(), pa.float64()))]
    about = {"gearmon": json.dumps({"fleet results": RESULTS_VERSION})}
    schema = pa.schema(types, about)
    try:
        fleet.results.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ArgumentError(f"{fleet.results}: is no folder ({error.strerror})") from None
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
        new = "l.state NOT IN ('failed', 'being written') AND l.id > ? ORDER BY l.id LIMIT ?"
        return recorded(store, new, (after, _ROWS))
