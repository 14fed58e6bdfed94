"""Histories in an SQLite file: append, read, export. A file may hold several machines."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

from gearmon.diagnosis.history import Entry, History, Place, duplicate_text
from gearmon.errors import ArgumentError, SignatureError
from gearmon.files import replacing, write_atomically

#: "GMhi": SQLite files of other programs have another mark.
APPLICATION_ID = 0x474D6869
SCHEMA_VERSION = 1
#: Seconds that a writer waits for another one to finish.
_PATIENCE_S = 10.0

_SCHEMA = f"""
CREATE TABLE IF NOT EXISTS recordings (
    id INTEGER PRIMARY KEY,
    machine TEXT NOT NULL,
    recording TEXT NOT NULL,
    time_s REAL NOT NULL,
    time_source TEXT NOT NULL,
    verdict TEXT NOT NULL,
    score REAL NOT NULL,
    false_alarm_probability REAL NOT NULL,
    speed_hz REAL NOT NULL,
    findings TEXT NOT NULL,
    UNIQUE (machine, time_s)
);
CREATE TABLE IF NOT EXISTS places (
    recording_id INTEGER NOT NULL REFERENCES recordings (id) ON DELETE CASCADE,
    stage INTEGER NOT NULL,
    gear TEXT NOT NULL,
    teeth INTEGER,
    tooth INTEGER,
    statistic REAL,
    log10_probability REAL,
    loss REAL,
    loss_low REAL,
    loss_high REAL,
    loss_sigma REAL
);
CREATE INDEX IF NOT EXISTS places_by_recording ON places (recording_id);
PRAGMA application_id = {APPLICATION_ID};
PRAGMA user_version = {SCHEMA_VERSION};
"""
_OWN = tuple(f.name for f in fields(Entry) if f.name not in ("findings", "places"))
_PLACE = tuple(f.name for f in fields(Place))


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
        If the file is damaged, of another program or of a later version.
    """
    replaced = 0
    with _opened(Path(path), create=True) as store:
        for entry in entries:
            _check_teeth(store, entry)
            known = store.execute(
                "SELECT id, recording FROM recordings WHERE machine = ? AND time_s = ?",
                (entry.machine, entry.time_s),
            ).fetchone()
            if known is not None:
                if not replace:
                    raise ArgumentError(duplicate_text(entry, known[1]))
                store.execute("DELETE FROM recordings WHERE id = ?", (known[0],))
                replaced += 1
            _insert(store, entry)
    return replaced


def _check_teeth(store: sqlite3.Connection, entry: Entry) -> None:
    """Refuse gears whose teeth have changed: it is another machine under the same name."""
    for place in {(p.stage, p.gear, p.teeth) for p in entry.places if p.teeth is not None}:
        other = store.execute(
            "SELECT p.teeth FROM places p JOIN recordings r ON r.id = p.recording_id WHERE "
            "r.machine = ? AND p.stage = ? AND p.gear = ? AND p.teeth != ? LIMIT 1",
            (entry.machine, *place),
        ).fetchone()
        if other is not None:
            raise ArgumentError(
                f"{entry.recording}: the {place[1]} of stage {place[0]} has {place[2]} teeth, and "
                f"{other[0]} in the history of {entry.machine!r}; another machine needs another "
                "name"
            )


def _insert(store: sqlite3.Connection, entry: Entry) -> None:
    names = (*_OWN, "findings")
    values = [getattr(entry, name) for name in _OWN]
    values.append(json.dumps(list(entry.findings), ensure_ascii=False))
    marks = ", ".join("?" * len(names))
    cursor = store.execute(
        f"INSERT INTO recordings ({', '.join(names)}) VALUES ({marks})", [_text(v) for v in values]
    )
    marks = ", ".join("?" * (1 + len(_PLACE)))
    store.executemany(
        f"INSERT INTO places (recording_id, {', '.join(_PLACE)}) VALUES ({marks})",
        [(cursor.lastrowid, *(getattr(p, name) for name in _PLACE)) for p in entry.places],
    )


def _text(value: Any) -> Any:
    # names of files need not be text in UTF-8, and SQLite takes nothing else
    return value.encode("utf-8", "backslashreplace").decode() if isinstance(value, str) else value


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
        If there is no such file, or it is damaged, of another program or of a later version.
    ArgumentError
        If the file holds several machines and none was named.
    """
    with _opened(Path(path), create=False) as store:
        if machine is None:
            names = [row[0] for row in store.execute("SELECT DISTINCT machine FROM recordings")]
            if len(names) != 1:
                listed = ", ".join(repr(name) for name in sorted(names)) or "none"
                raise ArgumentError(f"{path}: name one of its machines: {listed}")
            machine = str(names[0])
        found = store.execute(
            f"SELECT id, {', '.join(_OWN)}, findings FROM recordings WHERE machine = ? "
            "ORDER BY time_s",
            (machine,),
        ).fetchall()
        places: dict[int, list[Place]] = {}
        for number, *values in store.execute(
            f"SELECT recording_id, {', '.join('p.' + name for name in _PLACE)} FROM places p JOIN "
            "recordings r ON r.id = p.recording_id WHERE r.machine = ? ORDER BY p.rowid",
            (machine,),
        ):
            place = Place(**dict(zip(_PLACE, values, strict=True)))
            places.setdefault(number, []).append(place)
        entries = tuple(
            Entry(
                **dict(zip(_OWN, values, strict=True)),
                findings=tuple(json.loads(findings)),
                places=tuple(places.get(number, ())),
            )
            for number, *values, findings in found
        )
    return History(machine=machine, entries=entries)


@contextmanager
def _opened(path: Path, *, create: bool) -> Iterator[sqlite3.Connection]:
    """Give a connection whose changes are kept together or not at all."""
    if path.is_dir():
        raise ArgumentError(f"{path}: is a folder; give the name of a history file")
    if not path.exists():
        if not create:
            raise SignatureError(f"{path}: there is no such history file")
        if not path.resolve().parent.is_dir():
            raise ArgumentError(f"{path}: cannot be made, its folder does not exist")
    try:
        # the transaction is begun by hand: one for the schema and all rows
        with closing(
            sqlite3.connect(path, timeout=_PATIENCE_S, isolation_level=None)
        ) as connection:
            _prepare(connection, path, create=create)
            connection.execute("BEGIN IMMEDIATE" if create else "BEGIN")
            try:
                yield connection
            except BaseException:
                connection.execute("ROLLBACK")
                raise
            connection.execute("COMMIT")
    except sqlite3.OperationalError as error:
        if "locked" in str(error):
            raise SignatureError(f"{path}: another program is writing to it; try again") from None
        raise SignatureError(f"{path}: cannot be used as a history ({error})") from None
    except (sqlite3.DatabaseError, json.JSONDecodeError) as error:
        raise SignatureError(
            f"{path}: is no history file, or a damaged one ({error}); restore a copy, or analyse "
            "the recordings anew"
        ) from None


def _prepare(connection: sqlite3.Connection, path: Path, *, create: bool) -> None:
    """Check whose file it is, and make its tables if it is new."""
    mark, version = (
        connection.execute(f"PRAGMA {name}").fetchone()[0]
        for name in ("application_id", "user_version")
    )
    tables = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
    if not mark and not tables and create:
        # readers are not kept waiting by a writer; where the disk does not bear it nothing changes
        connection.execute("PRAGMA journal_mode = WAL").fetchone()
        connection.executescript(f"BEGIN IMMEDIATE;{_SCHEMA}COMMIT;")
    elif mark != APPLICATION_ID:
        raise SignatureError(f"{path}: is a database of another program, no history of gearmon")
    elif version > SCHEMA_VERSION:
        raise SignatureError(
            f"{path}: has schema {version}, this version of gearmon knows {SCHEMA_VERSION}; use a "
            "later one"
        )
    connection.execute("PRAGMA foreign_keys = ON")
    answer = connection.execute("PRAGMA quick_check(1)").fetchone()[0]
    if answer != "ok":
        raise SignatureError(
            f"{path}: is a damaged history file ({' '.join(str(answer).split())}); restore a copy, "
            "or analyse the recordings anew"
        )


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
    target = Path(path)
    rows = history.rows()
    names = list(rows[0]) if rows else [*_EMPTY_COLUMNS]
    if target.suffix.lower() == ".csv":
        write_atomically(target, _as_csv(names, rows))
    elif target.suffix.lower() == ".parquet":
        _write_parquet(names, rows, history.machine, target)
    else:
        raise ArgumentError(f"{target}: the name of a table must end in .csv or .parquet")
    return target


_EMPTY_COLUMNS = ("time", *_OWN, *_PLACE)


def _as_csv(names: Sequence[str], rows: Sequence[dict[str, Any]]) -> str:
    import csv
    import io

    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=list(names), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _write_parquet(
    names: Sequence[str], rows: Sequence[dict[str, Any]], machine: str, path: Path
) -> None:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise ArgumentError(
            "Parquet files need pyarrow: pip install 'gearmon[parquet]', or use .csv"
        ) from None
    words = {"time", "time_source", "machine", "recording", "verdict", "gear"}
    whole = {"stage", "teeth", "tooth"}
    kinds = [
        pyarrow.string()
        if name in words
        else pyarrow.int64()
        if name in whole
        else pyarrow.float64()
        for name in names
    ]
    schema = pyarrow.schema(
        list(zip(names, kinds, strict=True)),
        metadata={"gearmon": json.dumps({"history": 1, "machine": machine})},
    )
    table = pyarrow.Table.from_pylist(list(rows), schema=schema)
    with replacing(path) as temporary:
        pyarrow.parquet.write_table(table, temporary)
