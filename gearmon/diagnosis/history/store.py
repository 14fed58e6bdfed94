"""Histories in an SQLite file: append, read, export. A file may hold several machines.

Its tables `recordings` and `places` (gears and teeth) have the fields of `Entry` and `Place` as
columns; `latest` sums up each machine, so that thousands are overlooked without reading them all.
A fleet keeps its ledger and its alarms in the same file.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import fields
from importlib.util import find_spec
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any

from gearmon.diagnosis.history.entries import ENTRY, PLACE, Entry, History, Place, duplicate_time
from gearmon.errors import ArgumentError, GearmonError, SignatureError
from gearmon.files import replacing, table_cell, write_atomically

#: "GMhi": SQLite files of other programs have another mark.
APPLICATION_ID = 0x474D6869
#: Earlier versions guarded less, or had no summaries; their files are refused.
SCHEMA_VERSION = 4
#: Seconds that a writer waits for others to finish: 20 at once were seen to take turns unevenly.
_PATIENCE_S = 60.0
#: Up to here the whole file is looked through when it is opened; the checksums of what is read
#: guard larger ones, whose every page would take seconds [bytes].
_LOOKED_THROUGH = 1 << 24
#: Newest scores of a machine that its summary holds.
_SCORES = 30
# SQLite's index of what is not yet in the file takes 32 kB, and its rest little.
_SHARED_BYTES = 1 << 17

# annotation of a field -> column in SQL and in a table
_TYPES = {
    "str": ("TEXT NOT NULL", "str"),
    "int": ("INTEGER NOT NULL", "Int64"),
    "float": ("REAL NOT NULL", "float"),
    "int | None": ("INTEGER", "Int64"),
    "float | None": ("REAL", "float"),
}
_COLUMNS = {
    f.name: _TYPES[str(f.type)] for f in (*fields(Entry), *fields(Place)) if f.type in _TYPES
}
_SQL_ENTRY, _SQL_PLACE = (
    ", ".join(f"{name} {_COLUMNS[name][0]}" for name in names) for names in (ENTRY, PLACE)
)
_SCHEMA = f"""
CREATE TABLE IF NOT EXISTS recordings
    (id INTEGER PRIMARY KEY, {_SQL_ENTRY}, findings TEXT NOT NULL, checksum TEXT,
     UNIQUE (machine, time_s));
CREATE TABLE IF NOT EXISTS places
    (recording_id INTEGER NOT NULL REFERENCES recordings (id) ON DELETE CASCADE, {_SQL_PLACE});
CREATE INDEX IF NOT EXISTS places_by_recording ON places (recording_id);
CREATE TABLE IF NOT EXISTS latest
    (machine TEXT PRIMARY KEY, recordings INTEGER NOT NULL, time_s REAL NOT NULL,
     verdict TEXT NOT NULL, since_s REAL NOT NULL, score REAL NOT NULL, findings TEXT NOT NULL,
     loss REAL, loss_low REAL, loss_high REAL, scores TEXT NOT NULL, checksum TEXT);
PRAGMA application_id = {APPLICATION_ID};
PRAGMA user_version = {SCHEMA_VERSION};
"""


def append(path: str | Path, entries: Sequence[Entry], *, replace: bool = False) -> int:
    """Add recordings to a history file, all of them or none; the file is made if need be.

    Parameters
    ----------
    path : str or Path
        The file.
    entries : sequence of Entry
    replace : bool
        Whether a recording takes the place of one of the same machine and time; such a one is
        refused otherwise.

    Returns
    -------
    int
        Recordings that were replaced.

    Raises
    ------
    ArgumentError
        If a recording of the same time is there already, or a gear has other teeth than before.
    SignatureError
        If the file is damaged, of another program or of another version.
    """
    with opened(Path(path), create=True) as store:
        replaced = [append_to(store, entry, replace=replace) for entry in entries]
        summarise(store, {entry.machine for entry in entries})
    return sum(replaced)


def append_to(store: sqlite3.Connection, entry: Entry, *, replace: bool = False) -> bool:
    """Add one recording to an `opened` file; `summarise` its machine afterwards."""
    _check_teeth(store, entry)
    known = store.execute(
        "SELECT id, recording FROM recordings WHERE machine = ? AND time_s = ?",
        (as_text(entry.machine), entry.time_s),
    ).fetchone()
    if known is not None:
        if not replace:
            raise duplicate_time(entry, known["recording"])
        store.execute("DELETE FROM recordings WHERE id = ?", (known["id"],))
    findings = json.dumps(list(entry.findings), ensure_ascii=False)
    own = {name: getattr(entry, name) for name in ENTRY} | {"findings": findings}
    number = insert(store, "recordings", own)
    for place in entry.places:
        insert(store, "places", {"recording_id": number} | vars(place))
    told = _checksum(store, number)
    store.execute("UPDATE recordings SET checksum = ? WHERE id = ?", (told, number))
    return known is not None


def summarise(store: sqlite3.Connection, machines: Iterable[str]) -> None:
    """Renew what `latest` says of machines, from their recordings."""
    for machine in map(as_text, machines):
        asked = "SELECT * FROM recordings WHERE machine = ? ORDER BY time_s DESC"
        told = store.execute(asked, (machine,)).fetchall()
        if not told:
            continue
        last, (_, alike) = told[0], next(groupby(told, key=itemgetter("verdict")))
        # only where it stands clear of zero is the loss of a whole gear more than noise
        loss = store.execute(
            "SELECT loss, loss_low, loss_high FROM places WHERE recording_id = ? AND tooth IS NULL "
            "AND loss_low > 0 AND ? = 'fault' ORDER BY loss DESC LIMIT 1",
            (last["id"], last["verdict"]),
        ).fetchone()
        kept = {name: last[name] for name in ("machine", "time_s", "verdict", "score", "findings")}
        scores = json.dumps([round(row["score"], 3) for row in reversed(told[:_SCORES])])
        since_s = min(row["time_s"] for row in alike)
        kept |= {"recordings": len(told), "since_s": since_s, "scores": scores}
        kept |= dict(loss) if loss else dict.fromkeys(("loss", "loss_low", "loss_high"))
        put(store, "latest", kept)


def read_latest(path: str | Path) -> list[dict[str, Any]]:
    """Return what every machine of a file was last said to be.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    list of dict
        machine, recordings (number), time_s, verdict, since_s (of this verdict), score, findings
        (list of str), loss, loss_low, loss_high (of the newest fault, or None), scores (the
        newest, oldest of them first).

    Raises
    ------
    SignatureError
        If there is no such file, or it is damaged, of another program or of another version.
    """
    with opened(Path(path), create=False) as store:
        rows = map(sound, store.execute("SELECT * FROM latest ORDER BY machine").fetchall())
        listed = ("findings", "scores")
        return [row | {name: json.loads(row[name]) for name in listed} for row in rows]


def _checksum(store: sqlite3.Connection, number: int | None) -> str:
    """Return a mark of all that is stored of one recording."""
    own = store.execute("SELECT * FROM recordings WHERE id = ?", (number,)).fetchone()
    places = _places(store, number)
    told = [[own[name] for name in (*ENTRY, "findings")]]
    return _mark(told + [[place[name] for name in PLACE] for place in places])


def _mark(told: Any) -> str:
    return hashlib.blake2b(json.dumps(told, default=repr).encode(), digest_size=8).hexdigest()


def vouch(store: sqlite3.Connection, row: sqlite3.Row | dict[str, Any]) -> None:
    """Raise ValueError if a row of `recordings`, or a place of it, is not what was written."""
    if row["checksum"] != _checksum(store, row["id"]):
        raise ValueError(f"recording {row['id']} is not what was written")


def sound(row: sqlite3.Row | dict[str, Any], names: Sequence[str] = ()) -> dict[str, Any]:
    """Return what was `put`, the columns named or all of them; raise ValueError if it is not."""
    told = {name: row[name] for name in names or row.keys() if name != "checksum"}
    if row["checksum"] != _mark(sorted(told.items())):
        raise ValueError("a row is not what was written")
    return told


def _places(store: sqlite3.Connection, number: int | None) -> list[sqlite3.Row]:
    asked = "SELECT * FROM places WHERE recording_id = ? ORDER BY rowid"
    return store.execute(asked, (number,)).fetchall()


def _check_teeth(store: sqlite3.Connection, entry: Entry) -> None:
    """Refuse gears whose teeth have changed: it is another machine under the same name."""
    for place in {(p.stage, p.gear, p.teeth) for p in entry.places if p.teeth is not None}:
        # one tells for all, which were held against each other when they came
        other = store.execute(
            "SELECT p.teeth FROM recordings r CROSS JOIN places p ON p.recording_id = r.id WHERE "
            "r.machine = ? AND p.stage = ? AND p.gear = ? AND p.teeth IS NOT NULL LIMIT 1",
            (as_text(entry.machine), *place[:2]),
        ).fetchone()
        if other is not None and other[0] != place[2]:
            raise ArgumentError(
                f"{entry.recording}: the {place[1]} of stage {place[0]} has {place[2]} teeth, and "
                f"{other[0]} in the history of {entry.machine!r}; another machine needs another "
                "name"
            )


def as_text(name: str) -> str:
    """Return a name as it is stored: those of files need not be text in UTF-8."""
    return name.encode("utf-8", "backslashreplace").decode()


def insert(
    store: sqlite3.Connection, table: str, row: dict[str, Any], known: str = ""
) -> int | None:
    """Add a row, a value a column, to a table of an `opened` file; return its number."""
    values = [as_text(v) if isinstance(v, str) else v for v in row.values()]
    marks = ", ".join("?" * len(row))
    words = f"INSERT INTO {table} ({', '.join(row)}) VALUES ({marks}) {known}"  # noqa: S608 - ours
    return store.execute(words, values).lastrowid


def put(store: sqlite3.Connection, table: str, row: dict[str, Any]) -> None:
    """Add a row with its checksum, or change the one of its key; all its columns are given."""
    told = {name: as_text(v) if isinstance(v, str) else v for name, v in row.items()}
    told["checksum"] = _mark(sorted(told.items()))
    changed = ", ".join(f"{name} = excluded.{name}" for name in told)
    insert(store, table, told, f"ON CONFLICT DO UPDATE SET {changed}")


def read_history(path: str | Path, machine: str | None = None) -> History:
    """Read the history of one machine from a file.

    Parameters
    ----------
    path : str or Path
        The file.
    machine : str, optional
        Name of the machine; may be left out where the file holds one only.

    Returns
    -------
    History
        Empty if the file knows nothing of a machine that was named.

    Raises
    ------
    SignatureError
        If there is no such file, or it is damaged, of another program or of another version.
    ArgumentError
        If the file holds several machines and none was named.
    """
    with opened(Path(path), create=False) as store:
        if machine is None:
            names = [row[0] for row in store.execute("SELECT machine FROM latest ORDER BY machine")]
            if len(names) != 1:
                listed = ", ".join(map(repr, names)) or "none"
                raise ArgumentError(f"{path}: name one of its machines: {listed}")
            machine = names[0]
        named = (as_text(machine),)
        asked = "SELECT * FROM recordings WHERE machine = ? ORDER BY time_s"
        rows = store.execute(asked, named).fetchall()
        told = store.execute("SELECT recordings FROM latest WHERE machine = ?", named).fetchone()
        try:
            if len(rows) != (told[0] if told else 0):
                raise ValueError(f"recordings of {machine!r} are missing")
            entries = tuple(_entry(store, row) for row in rows)
        except (ArgumentError, LookupError, TypeError, ValueError, OverflowError) as error:
            raise _damaged(Path(path), "is a damaged history file", error) from None
    return History(machine=as_text(machine), entries=entries)


def _entry(store: sqlite3.Connection, row: sqlite3.Row) -> Entry:
    vouch(store, row)
    places = _places(store, row["id"])
    return Entry(
        **{name: row[name] for name in ENTRY},
        findings=tuple(json.loads(row["findings"])),
        places=tuple(Place(**{name: place[name] for name in PLACE}) for place in places),
    )


@contextmanager
def opened(
    path: Path, *, create: bool, more: str = "", known: bool = False
) -> Iterator[sqlite3.Connection]:
    """Give a connection whose changes are kept together or not at all.

    Parameters
    ----------
    path : Path
        The file.
    create : bool
        Whether it is to be written, and made if need be.
    more : str
        Statements that make further tables, where it is written.
    known : bool
        Whether it was looked through, and its tables made, a moment ago.
    """
    if path.is_dir():
        raise ArgumentError(f"{path}: is a folder; give the name of a history file")
    if not path.exists():
        if not create:
            raise SignatureError(f"{path}: there is no such history file")
        if not path.resolve().parent.is_dir():
            raise ArgumentError(f"{path}: cannot be made, its folder does not exist")
    try:
        # the transaction is begun by hand: one for the schema and all rows
        with closing(_connected(path, create=create)) as store:
            store.row_factory = sqlite3.Row
            store.execute("PRAGMA foreign_keys = ON")
            # of several that begin a history at once the others find the tables of the first
            store.execute("BEGIN IMMEDIATE" if create else "BEGIN")
            try:
                if not known:
                    _prepare(store, path, create=create)
                    _executed(store, more if create else "")
                yield store
            except BaseException:
                if store.in_transaction:  # a full disk ends it by itself
                    store.execute("ROLLBACK")
                raise
            store.execute("COMMIT")
            if create and not known:
                _shared(store)
    except sqlite3.OperationalError as error:
        if "locked" in str(error):
            raise SignatureError(f"{path}: another program is writing to it; try again") from None
        what = "cannot write to it" if create else "cannot be used as a history"
        raise SignatureError(f"{path}: {what} ({_line(error)})") from None
    except GearmonError:
        raise
    except (sqlite3.DatabaseError, LookupError, ValueError) as error:
        raise _damaged(path, "is no history file, or a damaged one", error) from None


def _connected(path: Path, *, create: bool) -> sqlite3.Connection:
    target = path.resolve()
    writable = os.access(target.parent, os.W_OK) and os.access(target, os.W_OK)
    if create or (writable and shutil.disk_usage(target.parent).free > _SHARED_BYTES):
        return sqlite3.connect(path, timeout=_PATIENCE_S, isolation_level=None)
    # who may only read, or has no room, cannot make the files that writers and readers share
    journal = Path(f"{target}-wal")
    if journal.exists() and journal.stat().st_size:
        raise SignatureError(
            f"{path}: its last changes are still in {journal.name}; copy both files to a folder "
            "that can be written to, and read them there"
        )
    name = f"{target.as_uri()}?immutable=1"
    return sqlite3.connect(name, uri=True, timeout=_PATIENCE_S, isolation_level=None)


def _prepare(store: sqlite3.Connection, path: Path, *, create: bool) -> None:
    """Check whose file it is, and make its tables if it is new, within the transaction."""
    look = "integrity_check(1)" if path.stat().st_size <= _LOOKED_THROUGH else "application_id"
    mark, version, answer = (
        store.execute(f"PRAGMA {name}").fetchone()[0]
        for name in ("application_id", "user_version", look)
    )
    tables = store.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
    if not mark and not tables and create:
        _executed(store, _SCHEMA)
    elif mark != APPLICATION_ID:
        raise SignatureError(f"{path}: is a database of another program, no history of gearmon")
    elif version != SCHEMA_VERSION:
        cure = "use a later one" if version > SCHEMA_VERSION else "analyse the recordings anew"
        raise SignatureError(
            f"{path}: has schema {version}, this version of gearmon knows {SCHEMA_VERSION}; {cure}"
        )
    if answer not in ("ok", mark):
        raise _damaged(path, "is a damaged history file", answer)


def _executed(store: sqlite3.Connection, script: str) -> None:
    """Execute statements one by one: a whole script would end the transaction first."""
    for statement in filter(str.strip, script.split(";")):
        store.execute(statement)


def _shared(store: sqlite3.Connection) -> None:
    """Let readers and a writer work side by side, where file and disk bear it by now."""
    with suppress(sqlite3.OperationalError):
        store.execute("PRAGMA journal_mode = WAL").fetchone()


def _damaged(path: Path, what: str, why: object) -> SignatureError:
    told = _line(why)
    return SignatureError(
        f"{path}: {what} ({told}); restore a copy, or analyse the recordings anew"
    )


def _line(why: object) -> str:
    """Put what SQLite says, with what it quotes of a damaged file, into one line."""
    return "".join(c if c.isprintable() else " " for c in " ".join(str(why).split()))


def export_history(history: History, path: str | Path) -> Path:
    """Write a history as a table, one row a recording, gear and tooth.

    Parameters
    ----------
    history : History
    path : str or Path
        Ending in .csv or .parquet.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    ArgumentError
        If the name has another ending, or pyarrow is missing for Parquet.
    """
    import pandas as pd

    target = Path(path)
    kinds = {"time": "str"} | {name: _COLUMNS[name][1] for name in (*ENTRY, *PLACE)}
    # a gear as a whole has no row in places where nothing was looked at
    kinds["gear"] = "object"
    rows = [{name: table_cell(v) for name, v in row.items()} for row in history.rows()]
    frame = pd.DataFrame(rows, columns=list(kinds)).astype(kinds)
    if target.suffix.lower() == ".csv":
        write_atomically(target, frame.to_csv(index=False, lineterminator="\n"))
    elif target.suffix.lower() == ".parquet":
        if find_spec("pyarrow") is None:
            raise ArgumentError(
                "Parquet files need pyarrow: pip install 'gearmon[parquet]', or use .csv"
            )
        with replacing(target) as temporary:
            frame.to_parquet(temporary, index=False)
    else:
        raise ArgumentError(f"{target}: the name of a table must end in .csv or .parquet")
    return target
