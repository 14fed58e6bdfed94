"""Recordings of one machine in the order of time: what each said, and the file that keeps it.

A history file is an SQLite database of two tables, `recordings` and `places` (gears and teeth),
whose columns are the fields of `Entry` and `Place`; it may hold several machines.
"""

from __future__ import annotations

import json
import math
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass, fields
from datetime import datetime
from pathlib import Path
from typing import Any

from gearmon.diagnosis.history.recording_times import time_text
from gearmon.diagnosis.results import VERDICTS, Analysis, Flag, ToothProfile
from gearmon.errors import ArgumentError, SignatureError, check_finite, check_range
from gearmon.files import replacing, write_atomically

#: Half the width of the 90 % interval of a loss, in standard deviations.
HALF_OF_90 = 1.6448536269514722
#: "GMhi": SQLite files of other programs have another mark.
APPLICATION_ID = 0x474D6869
SCHEMA_VERSION = 1
#: Seconds that a writer waits for another one to finish.
_PATIENCE_S = 10.0


@dataclass(frozen=True, kw_only=True)
class Place:
    """What one recording said about a gear, or about one of its teeth.

    Parameters
    ----------
    stage : int, >= 1
        Stage.
    gear : str
        Gear.
    teeth : int or None
        Teeth of the gear, where known.
    tooth : int or None
        Tooth; None for the gear as a whole.
    statistic : float or None
        Energy of the departure over that of the median tooth.
    log10_probability : float or None
        Of the gear: logarithm of the probability of as much on a healthy one.
    loss, loss_low, loss_high, loss_sigma : float or None
        Estimated loss of the pair's stiffness as a fraction, its 90 % interval and its standard
        deviation; None without an estimate, which does not mean that nothing is lost.

    Raises
    ------
    ArgumentError
        If a number is not finite or a sigma not above zero.
    """

    stage: int
    gear: str
    teeth: int | None = None
    tooth: int | None = None
    statistic: float | None = None
    log10_probability: float | None = None
    loss: float | None = None
    loss_low: float | None = None
    loss_high: float | None = None
    loss_sigma: float | None = None

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name, value in asdict(self).items():
            if isinstance(value, float):
                check_finite(name, value)
        if self.loss_sigma is not None and self.loss_sigma <= 0:
            raise ArgumentError(f"loss_sigma={self.loss_sigma} must be > 0")
        if self.loss is not None and self.loss_sigma is None:
            raise ArgumentError(f"loss={self.loss} needs loss_sigma beside it: how sure is it?")

    @property
    def key(self) -> tuple[int, str, int | None]:
        """Stage, gear and tooth."""
        return self.stage, self.gear, self.tooth


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One recording of a machine, as its history keeps it.

    Parameters
    ----------
    time_s : float
        When it was made, in seconds since 1970-01-01 UTC.
    time_source : str
        Where that is from: "given", "modified", "name".
    machine : str
        Name of the machine.
    recording : str
        The recording.
    verdict : str
        The verdict.
    score : float
        The score.
    false_alarm_probability : float, in [0, 1]
        Probability of as much evidence on a healthy machine.
    speed_hz : float
        Estimated speed of shaft 1 [Hz].
    findings : tuple of str
        Flags in words, strongest first.
    places : tuple of Place
        Gears and teeth.

    Raises
    ------
    ArgumentError
        If a value has no meaning.
    """

    time_s: float
    time_source: str
    machine: str
    recording: str
    verdict: str
    score: float
    false_alarm_probability: float
    speed_hz: float
    findings: tuple[str, ...] = ()
    places: tuple[Place, ...] = ()

    def __post_init__(self) -> None:
        """Check the values."""
        check_finite("time_s", self.time_s, "s")
        check_finite("score", self.score)
        check_finite("speed_hz", self.speed_hz, "Hz")
        check_range("false_alarm_probability", self.false_alarm_probability, 0.0, 1.0)
        if self.verdict not in VERDICTS:
            raise ArgumentError(f"verdict={self.verdict!r} must be one of {', '.join(VERDICTS)}")
        if len({place.key for place in self.places}) < len(self.places):
            raise ArgumentError(f"{self.recording}: a gear or a tooth stands there twice")

    @property
    def when(self) -> str:
        """Time as text, in UTC."""
        return time_text(self.time_s)

    def _own(self) -> dict[str, Any]:
        return {"time": self.when} | {name: getattr(self, name) for name in _OWN}

    def rows(self) -> list[dict[str, Any]]:
        """Return one row a gear and tooth, built-in types only; one without, if there are none."""
        places = [asdict(place) for place in self.places] or [dict.fromkeys(_PLACE)]
        return [self._own() | place for place in places]

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON; without the teeth."""
        return self._own() | {"findings": list(self.findings)}


@dataclass(frozen=True, kw_only=True, eq=False)
class History:
    """Recordings of one machine in the order of time.

    Parameters
    ----------
    machine : str
        Name of the machine.
    entries : tuple of Entry
        Of this machine, their times strictly increasing.

    Raises
    ------
    ArgumentError
        If an entry is of another machine or two have the same time.
    """

    machine: str
    entries: tuple[Entry, ...] = ()

    def __post_init__(self) -> None:
        """Check machine and order."""
        for entry in self.entries:
            if entry.machine != self.machine:
                raise ArgumentError(
                    f"{entry.recording}: is of machine {entry.machine!r}, the history of "
                    f"{self.machine!r}"
                )
        for one, other in zip(self.entries, self.entries[1:], strict=False):
            if one.time_s >= other.time_s:
                raise ArgumentError(
                    f"{one.recording} and {other.recording} are both of {one.when}, or out of order"
                )

    def with_entry(self, entry: Entry, *, replace: bool = False) -> History:
        """Return the history with one more recording, in its place in time.

        Parameters
        ----------
        entry : Entry
        replace : bool
            Whether it may take the place of one of the same time.

        Raises
        ------
        ArgumentError
            If there is one of the same time and `replace` is false.
        """
        known = {one.time_s: one for one in self.entries}
        if entry.time_s in known and not replace:
            raise _duplicate(entry, known[entry.time_s].recording)
        entries = known | {entry.time_s: entry}
        return History(machine=self.machine, entries=tuple(entries[t] for t in sorted(entries)))

    def rows(self) -> list[dict[str, Any]]:
        """Return one row a recording, gear and tooth."""
        return [row for entry in self.entries for row in entry.rows()]


def _duplicate(entry: Entry, known: str) -> ArgumentError:
    return ArgumentError(
        f"{entry.recording}: the history of {entry.machine or 'this machine'!r} has a recording of "
        f"{entry.when} already ({known}); replace it explicitly, or give the right time"
    )


# What a recording said


def entry_of(analysis: Analysis, time: datetime, time_source: str = "given") -> Entry:
    """Return what a history keeps of an analysis.

    Parameters
    ----------
    analysis : Analysis
        The analysis.
    time : datetime
        When the recording was made; with its offset from UTC.
    time_source : str
        Where that is from.

    Returns
    -------
    Entry

    Raises
    ------
    ArgumentError
        If the time has no offset.
    """
    if time.tzinfo is None:
        raise ArgumentError(f"time={time.isoformat()} has no offset from UTC; give one, such as Z")
    places: dict[tuple[int, str, int | None], Place] = {}
    for profile in analysis.profiles:
        for place in _places(profile, analysis.flags):
            places.setdefault(place.key, place)
    return Entry(
        time_s=time.timestamp(),
        time_source=time_source,
        machine=analysis.machine,
        recording=analysis.recording,
        verdict=analysis.verdict,
        score=analysis.score,
        false_alarm_probability=analysis.false_alarm_probability,
        speed_hz=float(analysis.signature.speed.estimated_hz),
        findings=tuple(_finding(flag) for flag in analysis.flags),
        places=tuple(places.values()),
    )


def _places(profile: ToothProfile, flags: Sequence[Flag]) -> Iterator[Place]:
    """Give the gear as a whole, then its teeth where they can be told between recordings.

    Loss estimates are those of the profile; where there are none, those of the flags.
    """
    gear: dict[str, Any] = {"stage": profile.stage, "gear": profile.gear, "teeth": profile.teeth}
    own = [flag for flag in flags if (flag.stage, flag.gear) == (profile.stage, profile.gear)]
    flagged = next((flag for flag in own if flag.stiffness_loss is not None), None)
    told = {} if flagged is None else _flag_loss(flagged)
    losses, sigmas = profile.loss_by_tooth, profile.loss_sigma_by_tooth
    teeth = [] if losses is None or sigmas is None else list(map(_loss, losses, sigmas))
    worst = max((t for t in teeth if t), key=lambda tooth: tooth["loss"], default={})
    yield Place(
        **gear,
        statistic=_finite(profile.ratio),
        log10_probability=_finite(profile.log10_probability),
        **(told or worst),
    )
    # without a numbered tooth the same number is another tooth in the next recording
    for number, loss in enumerate(teeth if profile.tooth is not None else [], 1):
        if told and flagged and (flagged.tooth, told["loss"]) == (number, loss.get("loss")):
            # the same estimate, whose interval is not the same to both sides
            loss = loss | {name: told[name] for name in ("loss_low", "loss_high")}
        yield Place(**gear, tooth=number, statistic=_finite(profile.energy[number - 1]), **loss)


def _loss(loss: float, sigma: float) -> dict[str, float]:
    """Return an estimate with its 90 % interval; nothing where there is none."""
    if not (math.isfinite(loss) and math.isfinite(sigma) and sigma > 0):
        return {}
    loss, half = float(loss), HALF_OF_90 * float(sigma)
    return {
        "loss": loss,
        "loss_low": loss - half,
        "loss_high": loss + half,
        "loss_sigma": float(sigma),
    }


def _flag_loss(flag: Flag) -> dict[str, float]:
    loss, low, high = flag.stiffness_loss, flag.stiffness_loss_low, flag.stiffness_loss_high
    if loss is None or low is None or high is None:
        return {}
    # an interval cut off at zero says more on its other side
    told = _loss(loss, max(high - loss, loss - low) / HALF_OF_90)
    return told and told | {"loss_low": low, "loss_high": high}


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _finding(flag: Flag) -> str:
    parts = [flag.kind]
    parts += [f"stage {flag.stage}"] if flag.stage else []
    parts += [flag.gear] if flag.gear else []
    parts += [f"tooth {flag.tooth}"] if flag.tooth else []
    text = ", ".join(parts)
    loss, low, high = flag.stiffness_loss, flag.stiffness_loss_low, flag.stiffness_loss_high
    if loss is None or low is None or high is None:
        return text
    least, middle, most = (f"{100 * x:.{0 if high >= 0.1 else 1}f}" for x in (low, loss, high))
    return f"{text}: loss {middle} % ({least} to {most} %)"


# The file

# annotation of a field -> column in SQL and in a table
_TYPES = {
    "str": ("TEXT NOT NULL", "str"),
    "int": ("INTEGER NOT NULL", "Int64"),
    "float": ("REAL NOT NULL", "float"),
    "int | None": ("INTEGER", "Int64"),
    "float | None": ("REAL", "float"),
}
_OWN = {f.name: _TYPES[str(f.type)] for f in fields(Entry) if f.type in _TYPES}
_PLACE = {f.name: _TYPES[str(f.type)] for f in fields(Place)}
_SQL_OWN, _SQL_PLACE = (
    ", ".join(f"{name} {sql}" for name, (sql, _) in columns.items()) for columns in (_OWN, _PLACE)
)
_SCHEMA = f"""
CREATE TABLE IF NOT EXISTS recordings
    (id INTEGER PRIMARY KEY, {_SQL_OWN}, findings TEXT NOT NULL, UNIQUE (machine, time_s));
CREATE TABLE IF NOT EXISTS places
    (recording_id INTEGER NOT NULL REFERENCES recordings (id) ON DELETE CASCADE, {_SQL_PLACE});
CREATE INDEX IF NOT EXISTS places_by_recording ON places (recording_id);
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
                    raise _duplicate(entry, known["recording"])
                store.execute("DELETE FROM recordings WHERE id = ?", (known["id"],))
                replaced += 1
            findings = json.dumps(list(entry.findings), ensure_ascii=False)
            own = {name: getattr(entry, name) for name in _OWN} | {"findings": findings}
            number = _insert(store, "recordings", own)
            for place in entry.places:
                _insert(store, "places", {"recording_id": number} | asdict(place))
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


def _insert(store: sqlite3.Connection, table: str, row: dict[str, Any]) -> int | None:
    # names of files need not be text in UTF-8, and SQLite takes nothing else
    values = [
        v.encode("utf-8", "backslashreplace").decode() if isinstance(v, str) else v
        for v in row.values()
    ]
    marks = ", ".join("?" * len(row))
    return store.execute(
        f"INSERT INTO {table} ({', '.join(row)}) VALUES ({marks})", values
    ).lastrowid


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
        asked = "SELECT * FROM recordings WHERE machine = ? ORDER BY time_s"
        rows = store.execute(asked, (machine,)).fetchall()
        return History(machine=machine, entries=tuple(_entry(store, row) for row in rows))


def _entry(store: sqlite3.Connection, row: sqlite3.Row) -> Entry:
    asked = "SELECT * FROM places WHERE recording_id = ? ORDER BY rowid"
    places = store.execute(asked, (row["id"],)).fetchall()
    return Entry(
        **{name: row[name] for name in _OWN},
        findings=tuple(json.loads(row["findings"])),
        places=tuple(Place(**{name: place[name] for name in _PLACE}) for place in places),
    )


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
        with closing(sqlite3.connect(path, timeout=_PATIENCE_S, isolation_level=None)) as store:
            store.row_factory = sqlite3.Row
            _prepare(store, path, create=create)
            store.execute("BEGIN IMMEDIATE" if create else "BEGIN")
            try:
                yield store
            except BaseException:
                store.execute("ROLLBACK")
                raise
            store.execute("COMMIT")
    except sqlite3.OperationalError as error:
        if "locked" in str(error):
            raise SignatureError(f"{path}: another program is writing to it; try again") from None
        raise SignatureError(f"{path}: cannot be used as a history ({error})") from None
    except (sqlite3.DatabaseError, json.JSONDecodeError) as error:
        raise _damaged(path, "is no history file, or a damaged one", error) from None


def _prepare(store: sqlite3.Connection, path: Path, *, create: bool) -> None:
    """Check whose file it is, and make its tables if it is new."""
    mark, version, answer = (
        store.execute(f"PRAGMA {name}").fetchone()[0]
        for name in ("application_id", "user_version", "quick_check(1)")
    )
    tables = store.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
    if not mark and not tables and create:
        # readers are not kept waiting by a writer; where the disk does not bear it nothing changes
        store.execute("PRAGMA journal_mode = WAL").fetchone()
        store.executescript(f"BEGIN IMMEDIATE;{_SCHEMA}COMMIT;")
    elif mark != APPLICATION_ID:
        raise SignatureError(f"{path}: is a database of another program, no history of gearmon")
    elif version > SCHEMA_VERSION:
        raise SignatureError(
            f"{path}: has schema {version}, this version of gearmon knows {SCHEMA_VERSION}; use a "
            "later one"
        )
    store.execute("PRAGMA foreign_keys = ON")
    if answer != "ok":
        raise _damaged(path, "is a damaged history file", " ".join(str(answer).split()))


def _damaged(path: Path, what: str, why: object) -> SignatureError:
    return SignatureError(f"{path}: {what} ({why}); restore a copy, or analyse the recordings anew")


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
    kinds = {"time": "str"} | {name: kind for name, (_, kind) in (_OWN | _PLACE).items()}
    # a gear as a whole has no row in places where nothing was looked at
    kinds["gear"] = "object"
    frame = pd.DataFrame(history.rows(), columns=list(kinds)).astype(kinds)
    if target.suffix.lower() == ".csv":
        write_atomically(target, frame.to_csv(index=False, lineterminator="\n"))
    elif target.suffix.lower() == ".parquet":
        _write_parquet(frame, history.machine, target)
    else:
        raise ArgumentError(f"{target}: the name of a table must end in .csv or .parquet")
    return target


def _write_parquet(frame: Any, machine: str, path: Path) -> None:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise ArgumentError(
            "Parquet files need pyarrow: pip install 'gearmon[parquet]', or use .csv"
        ) from None
    about = {"gearmon": json.dumps({"history": 1, "machine": machine})}
    table = pyarrow.Table.from_pandas(frame, preserve_index=False).replace_schema_metadata(about)
    with replacing(path) as temporary:
        pyarrow.parquet.write_table(table, temporary)
