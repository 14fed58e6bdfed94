"""Damaged and hostile files for every reader: each is read as it was, or refused in one line.

Quick rounds run with the tests; long ones by hand, such as

    python tests/fuzzing.py --count 5000 --seed 1 reference

Damage is of two sorts: bytes of the file (flipped, cut, doubled, put in), and, inside a container
that is whole, its content (missing, of another shape or type, not finite, huge).
"""

from __future__ import annotations

import argparse
import io
import json
import sqlite3
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from reference.small_gearbox import MACHINE_FILE, analysis, machine, recording, reference

from gearmon.diagnosis.analysis import analyse
from gearmon.diagnosis.fault_types.classifier import KindClassifier, read_kinds, write_kinds
from gearmon.diagnosis.history import append, entry_of, read_history
from gearmon.errors import GearmonError
from gearmon.machine import load_machine
from gearmon.signals.recording import read_recording
from gearmon.signatures.measured import indicators
from gearmon.signatures.measured.reference import read_reference, write_reference
from gearmon.simulation import simulate, write_simulation

#: No file takes longer to refuse [s], or by much to use, nor more memory [bytes].
MOST_SECONDS, MOST_BYTES = 2.0, 500e6
HOSTILE = [None, "", "x" * 300, -1, 0, 1e308, -1e308, 1e9, 1 << 62, True, [], {}, [[1.0]], "=1+1"]

Change = Callable[[bytes, np.random.Generator], bytes]


@dataclass(frozen=True, kw_only=True)
class Target:
    """A kind of file."""

    name: str
    original: bytes
    #: What is read of it, in a form that tells whether anything is different.
    read: Callable[[Path], Any]
    changes: tuple[Change, ...]
    #: Whether the format protects its content, so that what is read is either the same or hostile.
    sure: bool = False


def flipped(data: bytes, random: np.random.Generator) -> bytes:
    out = bytearray(data)
    for place in random.integers(0, len(out), random.integers(1, 8)):
        out[place] ^= 1 << int(random.integers(8))
    return bytes(out)


def cut(data: bytes, random: np.random.Generator) -> bytes:
    return data[: int(random.integers(len(data)))]


def spliced(data: bytes, random: np.random.Generator) -> bytes:
    first, second, third = sorted(random.integers(0, len(data), 3).tolist())
    return data[:second] + data[first : min(third, first + 400)] + data[second:]


def stuffed(data: bytes, random: np.random.Generator) -> bytes:
    words = [
        b"\0" * 9,
        b"nan",
        b"-inf",
        b"1e999",
        b"\xff\xfe",
        b'"',
        b"\n\n",
        b"=1+1",
        b"[[",
        b"9" * 40,
    ]
    place = int(random.integers(len(data)))
    return data[:place] + words[int(random.integers(len(words)))] + data[place:]


BYTES: tuple[Change, ...] = (flipped, cut, spliced, stuffed)


def hostile_json(value: Any, random: np.random.Generator) -> Any:
    """Change, leave out or replace one thing anywhere in it."""
    if isinstance(value, dict) and value and random.random() < 0.9:
        key = list(value)[int(random.integers(len(value)))]
        if random.random() < 0.2:
            return {name: own for name, own in value.items() if name != key}
        return value | {key: hostile_json(value[key], random)}
    if isinstance(value, list) and value and random.random() < 0.7:
        place = int(random.integers(len(value)))
        return [*value[:place], hostile_json(value[place], random), *value[place + 1 :]]
    return HOSTILE[int(random.integers(len(HOSTILE)))]


def hostile_array(values: np.ndarray, random: np.random.Generator) -> np.ndarray:
    kind = int(random.integers(6))
    if kind == 0:
        return values[:0]
    if kind == 1:
        return values[..., None]
    if kind == 2:
        return values.astype("U8") if values.dtype.kind != "U" else np.zeros(len(values))
    if kind == 3 and values.size:
        return np.repeat(values, 2, axis=0)
    bad = np.array(values, copy=True)
    if bad.size and bad.dtype.kind in "fc":
        flat, hostile = bad.reshape(-1), [np.nan, np.inf, -1e200, 1e300]
        with np.errstate(over="ignore"):  # single precision has infinity for the last two
            flat[int(random.integers(flat.size))] = hostile[int(random.integers(4))]
    elif bad.size and bad.dtype.kind in "iu":
        bad.reshape(-1)[0] = np.iinfo(bad.dtype).max
    return bad


def hostile_archive(data: bytes, random: np.random.Generator) -> bytes:
    with np.load(io.BytesIO(data)) as archive:
        arrays = {name: archive[name] for name in archive.files}
    if random.random() < 0.5:
        header = hostile_json(json.loads(bytes(arrays["header"])), random)
        arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    else:
        name = list(arrays)[int(random.integers(len(arrays)))]
        if random.random() < 0.2:
            del arrays[name]
        else:
            arrays[name] = hostile_array(arrays[name], random)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def hostile_text_of_json(data: bytes, random: np.random.Generator) -> bytes:
    return json.dumps(hostile_json(json.loads(data), random)).encode()


def hostile_table(data: bytes, random: np.random.Generator) -> bytes:
    """Write one hostile cell into a database, by whatever column."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "h.db"
        path.write_bytes(data)
        with closing(sqlite3.connect(path)) as store:
            table = ("recordings", "places")[int(random.integers(2))]
            columns = [row[1] for row in store.execute(f"PRAGMA table_info({table})")]
            columns = [name for name in columns if name != "checksum"]
            name = columns[int(random.integers(len(columns)))]
            cell = [b"\xff\xfe", "x", -1, 0, 4e209, 1e308, 1 << 60][int(random.integers(7))]
            try:
                store.execute(f"UPDATE {table} SET {name} = ? WHERE rowid = 1", (cell,))
            except sqlite3.Error:
                return data
            store.commit()
        return path.read_bytes()


def hostile_toml(data: bytes, random: np.random.Generator) -> bytes:
    lines = data.decode().splitlines()
    places = [number for number, line in enumerate(lines) if "=" in line]
    place = places[int(random.integers(len(places)))]
    key = lines[place].split("=")[0]
    values = [
        "nan",
        "inf",
        "-1",
        "0",
        "1e308",
        "1e-320",
        "[]",
        "{}",
        '""',
        "true",
        "9" * 25,
        "1979-05-27",
    ]
    lines[place] = f"{key}= {values[int(random.integers(len(values)))]}"
    return "\n".join(lines).encode()


def targets(folder: Path) -> dict[str, Target]:
    """Return every kind of file, made from small originals."""
    made: dict[str, Target] = {}

    def add(name: str, path: Path, read: Callable[[Path], Any], *more: Change, sure: bool) -> None:
        made[name] = Target(
            name=name, original=path.read_bytes(), read=read, changes=(*BYTES, *more), sure=sure
        )

    write_simulation(simulate(machine(), (), 0.3, 4000.0, seed=1), folder / "a.csv")
    add("csv", folder / "a.csv", lambda p: read_recording(p).samples.tobytes(), sure=False)
    np.savez(folder / "a.npz", a1=np.arange(300.0) % 7, sampling_rate_hz=4000.0)
    add("npz", folder / "a.npz", lambda p: read_recording(p, 4000.0).samples.tobytes(), sure=False)
    write_reference(reference(), folder / "a.ref")
    add("reference", folder / "a.ref", used_reference, hostile_archive, sure=True)
    random = np.random.default_rng(0)
    rows = random.normal(size=(60, 5)) + np.repeat([[0.0], [3.0], [6.0]], 20, axis=0)
    trained = KindClassifier(hidden=4, folds=2, max_iter=20, random_state=0)
    trained.fit(rows, np.repeat(["crack", "wear", "none"], 20))
    write_kinds(trained, folder / "a.kinds")
    add("kinds", folder / "a.kinds", lambda p: used_kinds(p, rows), hostile_archive, sure=True)
    entries = [
        entry_of(analysis(fault), datetime(2026, 3, day, tzinfo=UTC))
        for day, fault in ((1, ""), (8, "crack:1:pinion:7:40%"))
    ]
    append(folder / "a.db", entries)
    with closing(sqlite3.connect(folder / "a.db")) as store:
        store.execute("PRAGMA journal_mode = DELETE")
    add("history", folder / "a.db", lambda p: read_history(p).rows(), hostile_table, sure=True)
    run = indicators.indicator_table(recording(), machine()).history
    assert run is not None
    indicators.write_history(run, folder / "a.json")
    add(
        "indicators",
        folder / "a.json",
        lambda p: {k: v.variances.tolist() for k, v in indicators.read_history(p).runs.items()},
        hostile_text_of_json,
        sure=False,
    )
    (folder / "a.toml").write_text(MACHINE_FILE)
    add("machine", folder / "a.toml", lambda p: repr(load_machine(p)), hostile_toml, sure=False)
    return made


def used_reference(path: Path) -> Any:
    """Read a reference and hold a recording against it."""
    known = read_reference(path)
    answer = analyse(recording(), machine(), known)
    json.dumps(answer.to_dict(), allow_nan=False)
    return answer.verdict


def used_kinds(path: Path, rows: np.ndarray) -> Any:
    known = read_kinds(path)
    return (
        known.predict_proba(rows).round(9).tolist() if known.n_features_in_ == rows.shape[1] else 0
    )


def attack(target: Target, count: int, seed: int, folder: Path) -> list[str]:
    """Return what went wrong in so many trials."""
    random = np.random.default_rng(seed)
    path = folder / f"damaged.{target.name}"
    path.write_bytes(target.original)
    begin = time.process_time()
    whole, wrong = target.read(path), []
    most = MOST_SECONDS + 2 * (time.process_time() - begin)
    for number in range(count):
        change = target.changes[number % len(target.changes)]
        path.write_bytes(change(target.original, random))
        begin = time.process_time()
        what = f"{target.name} {number} ({change.__name__}, seed {seed}): "
        try:
            found = target.read(path)
            if target.sure and change in BYTES and found != whole:
                wrong.append(what + "another content was read without a word")
        except GearmonError as error:
            if not str(error).isprintable():
                wrong.append(what + f"not one line: {error!r}")
        except Exception as error:
            wrong.append(what + f"{type(error).__name__}: {error}")
        if time.process_time() - begin > most:
            wrong.append(what + f"took {time.process_time() - begin:.1f} s")
        if wrong and wrong[-1].startswith(what):
            (folder / f"wrong-{target.name}-{number}").write_bytes(path.read_bytes())
    return wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("target", nargs="*", help="kinds of file (all)")
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="fuzzing-"))
    known, bad = targets(folder), 0
    tracemalloc.start()
    for name in given.target or known:
        wrong = attack(known[name], given.count, given.seed, folder)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.reset_peak()
        bad += len(wrong) + (peak > MOST_BYTES)
        print(f"{name}: {given.count} files, {len(wrong)} wrong, {peak / 1e6:.0f} MB", flush=True)
        print("\n".join(wrong[:20]), flush=True)
    print(f"files that went wrong are in {folder}" if bad else "nothing went wrong")
    return min(bad, 1)


if __name__ == "__main__":
    sys.exit(main())
