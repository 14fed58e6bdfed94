"""Histories in an SQLite file: append, read, export. A file may hold several machines.

Its table `recordings` has the fields of `Entry` as columns, findings and places as JSON; `latest`
sums up each machine, so that thousands are overlooked without reading them all. A fleet keeps its
ledger and its alarms in the same file.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import shutil
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any

from gearmon.diagnosis.history.entries import ENTRY, Entry, History, Place, duplicate_time
from gearmon.errors import ArgumentError, GearmonError, SignatureError
from gearmon.files import parquet, replacing, write_atomically

#: "GMhi": SQLite files of other programs have another mark.
APPLICATION_ID = 0x474D6869
#: Earlier versions guarded less, had no summaries, or a table of places; their files are refused.
SCHEMA_VERSION = 5
#: Seconds that a writer waits for others to finish: 20 at once were seen to take turns unevenly.
_PATIENCE_S = 60.0
#: Up to here the whole file is looked through when it is opened; the checksums of what is read
#: guard larger ones, whose every page would take seconds [bytes].
_LOOKED_THROUGH = 1 << 24
#: Newest scores of a machine that its summary holds.
_SCORES = 30
# SQLite's index of what is not yet in the file takes 32 kB, and its rest little.
_SHARED_BYTES = 1 << 17
# Columns that say nothing of what was put.
_UNGUARDED = ("checksum", "id", "alarmed")
_SCHEMA = f"""
CREATE TABLE IF NOT EXISTS recordings
    (machine TEXT NOT NULL, time_s REAL NOT NULL, time_source TEXT NOT NULL,
     recording TEXT NOT NULL, verdict TEXT NOT NULL, score REAL NOT NULL,
     false_alarm_probability REAL NOT NULL, speed_hz REAL NOT NULL, findings TEXT NOT NULL,
     places TEXT NOT NULL, checksum TEXT, PRIMARY KEY (machine, time_s));
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


def append_to(store: sqlite3.Connection, entry: Entry, *, replace: bool | None = False) -> bool:
    """Add one recording to an `opened` file; `summarise` its machine afterwards.

    Where `replace` is None it may take the place of what the same recording said before.
    """
    machine = as_text(entry.machine)
    for stage, gear, teeth in {(p.stage, p.gear, p.teeth) for p in entry.places if p.teeth}:
        # one tells for all, which were held against each other when they came
        other = store.execute(
            "SELECT json_extract(value, '$.teeth') AS teeth FROM recordings, json_each(places) "
            "WHERE machine = ? AND json_extract(value, '$.stage') = ? "
            "AND json_extract(value, '$.gear') = ? AND teeth IS NOT NULL LIMIT 1",
            (machine, stage, gear),
        ).fetchone()
        if other is not None and other[0] != teeth:  # another machine under the same name
            raise ArgumentError(
                f"{entry.recording}: the {gear} of stage {stage} has {teeth} teeth, and {other[0]} "
                f"in the history of {entry.machine!r}; another machine needs another name"
            )
    known = recording(store, machine, entry.time_s)
    again = known.get("recording") == as_text(entry.recording)
    if known and not (again if replace is None else replace):
        raise duplicate_time(entry.recording, entry.machine, entry.time_s, known["recording"])
    places = [{n: x for n, x in vars(own).items() if x is not None} for own in entry.places]
    findings = json.dumps(entry.findings, ensure_ascii=False)
    own = {name: getattr(entry, name) for name in ENTRY} | {"findings": findings}
    put(store, "recordings", own | {"places": json.dumps(places)})
    return bool(known)


def recording(store: sqlite3.Connection, machine: str, time_s: float) -> dict[str, Any]:
    """Return what was `put` of the recording of a machine and time; nothing if there is none."""
    asked = "SELECT * FROM recordings WHERE machine = ? AND time_s = ?"
    return next(iter(rows(store, asked, (machine, time_s))), {})


def summarise(store: sqlite3.Connection, machines: Iterable[str]) -> None:
    """Renew what `latest` says of machines, from their recordings."""
    for machine in map(as_text, machines):
        asked = "SELECT time_s, verdict, score FROM recordings WHERE machine = ? "
        told = store.execute(asked + "ORDER BY time_s DESC", (machine,)).fetchall()
        alike = next(groupby(told, key=itemgetter("verdict")))[1]
        last = recording(store, machine, told[0]["time_s"])
        kept = {name: last[name] for name in ("machine", "time_s", "verdict", "score", "findings")}
        scores = json.dumps([round(row["score"], 3) for row in reversed(told[:_SCORES])])
        since_s = min(row["time_s"] for row in alike)
        kept |= {"recordings": len(told), "since_s": since_s, "scores": scores}
        # only where it stands clear of zero is the loss of a whole gear more than noise
        kept |= largest_loss(last["places"], 0.0 if last["verdict"] == "fault" else math.inf)
        put(store, "latest", kept)


def largest_loss(places: str, above: float = -math.inf) -> dict[str, float | None]:
    """Return the largest loss of a gear as a whole, of those whose interval lies above a loss."""
    gears = [own for own in json.loads(places) if "tooth" not in own and "loss" in own]
    clear = [own for own in gears if own.get("loss_low", 0.0) > above]
    worst: dict[str, float] = max(clear, key=itemgetter("loss"), default={})
    return {name: worst.get(name) for name in ("loss", "loss_low", "loss_high")}


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
        told, listed = rows(store, "SELECT * FROM latest ORDER BY machine"), ("findings", "scores")
        return [row | {name: json.loads(row[name]) for name in listed} for row in told]


def _mark(told: Mapping[str, Any]) -> str:
    text = json.dumps(told, default=repr, sort_keys=True)
    return hashlib.blake2b(text.encode(), digest_size=8).hexdigest()


def rows(store: sqlite3.Connection, asked: str, values: Sequence[Any] = ()) -> list[dict[str, Any]]:
    """Return rows as they were `put`, and their `id`; raise ValueError if one is not."""
    found = []
    for row in map(dict, store.execute(asked, values).fetchall()):
        told = {name: value for name, value in row.items() if name not in _UNGUARDED}
        if row["checksum"] != _mark(told):
            raise ValueError("a row is not what was written")
        found.append(told | ({"id": row["id"]} if "id" in row else {}))
    return found


def as_text(name: str) -> str:
    """Return a name as it is stored: those of files need not be text in UTF-8."""
    return name.encode("utf-8", "backslashreplace").decode()


def put(store: sqlite3.Connection, table: str, row: dict[str, Any]) -> None:
    """Add a row with its checksum, or change the one of its key; all its columns are given."""
    told = {name: as_text(v) if isinstance(v, str) else v for name, v in row.items()}
    told["checksum"] = _mark(told)
    changed = ", ".join(f"{name} = excluded.{name}" for name in told)
    marks = ", ".join("?" * len(told))
    words = f"INSERT INTO {table} ({', '.join(told)}) VALUES ({marks})"  # noqa: S608 - ours
    store.execute(f"{words} ON CONFLICT DO UPDATE SET {changed}", [*told.values()])


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
        counted = "SELECT machine, recordings FROM latest ORDER BY machine"
        known = dict(map(tuple, store.execute(counted)))
        if machine is None and len(known) != 1:
            listed = ", ".join(map(repr, known)) or "none"
            raise ArgumentError(f"{path}: name one of its machines: {listed}")
        name = as_text(machine if machine is not None else next(iter(known)))
        asked = "SELECT * FROM recordings WHERE machine = ? ORDER BY time_s"
        found, entries = rows(store, asked, (name,)), []
        try:
            if len(found) != known.get(name, 0):
                raise ValueError(f"recordings of {name!r} are missing")
            for told in found:
                places = tuple(Place(**own) for own in json.loads(told["places"]))
                parts = {"findings": tuple(json.loads(told["findings"])), "places": places}
                entries.append(Entry(**told | parts))
        except (ArgumentError, LookupError, TypeError, ValueError, OverflowError) as error:
            raise _damaged(Path(path), "is a damaged history file", error) from None
    return History(machine=name, entries=tuple(entries))


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
        with closing(_connected(path, create=create)) as store:
            store.row_factory = sqlite3.Row
            # the transaction, which this block ends, is begun by hand: one for schema and all rows
            with store:
                # of several that begin a history at once the others find the tables of the first
                store.execute("BEGIN IMMEDIATE" if create else "BEGIN")
                if not known:
                    _prepare(store, path, create=create)
                    _executed(store, more if create else "")
                yield store
            if create and not known:
                # readers and a writer work side by side, where file and disk bear it by now
                with suppress(sqlite3.OperationalError):
                    store.execute("PRAGMA journal_mode = WAL").fetchone()
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
    asked = "application_id", "user_version", look
    mark, version, answer = (store.execute(f"PRAGMA {name}").fetchone()[0] for name in asked)
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
    target, frame = Path(path), history.to_frame()
    if target.suffix.lower() == ".csv":
        write_atomically(target, frame.to_csv(index=False, lineterminator="\n"))
    elif target.suffix.lower() == ".parquet":
        parquet()  # or it says what is missing
        with replacing(target) as temporary:
            frame.to_parquet(temporary, index=False)
    else:
        raise ArgumentError(f"{target}: the name of a table must end in .csv or .parquet")
    return target
