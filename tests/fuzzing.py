"""Damaged and hostile files for every reader: each is read as it was, or refused in one line.

Quick rounds run with the tests; long ones by hand, such as

    python tests/fuzzing.py --count 5000 --seed 1 reference

Damage is of two sorts: bytes of the file (flipped, cut, doubled, put in), and, inside a container
that is whole, its content (missing, of another shape or type, not finite, huge). What is read is
compared with what a slow or another reader makes of the same bytes, or, where the format protects
its content, with the original.
"""

from __future__ import annotations

import argparse
import gzip
import io
import json
import random as plain_random
import sqlite3
import sys
import tempfile
import time
import zlib
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import nptdms
import numpy as np
import pyarrow
import pyarrow.parquet
import soundfile
from reference import fleet_stand_in
from reference.damaged_tables import alike, damaged, encoded, mixed_up, some_table
from reference.slow_csv import NotATableError, read_slowly
from reference.small_gearbox import MACHINE_FILE, analysis, machine, recording, reference
from scipy.io import savemat, wavfile

import gearmon.demos
from gearmon.diagnosis.analysis import analyse
from gearmon.diagnosis.fault_types.classifier import KindClassifier, read_kinds, write_kinds
from gearmon.diagnosis.history import append, entry_of, read_history, read_latest
from gearmon.errors import GearmonError, RecordingError
from gearmon.exposure import load_day
from gearmon.fleet import alarms, deliver, read_fleet, run_fleet
from gearmon.fleet.ledger import rank, write_results
from gearmon.fleet.plan import Fleet, arrived
from gearmon.harvesting.tuning import load_harvester
from gearmon.machine import load_machine
from gearmon.signals.reading import Wanted, interpret
from gearmon.signals.reading.formats import identify
from gearmon.signals.reading.text import open_source, read_table
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
    #: What is wrong with what was read of a file; "" if nothing is known to be.
    judged: Callable[[Path, Any], str] = lambda *_: ""


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
#: Samples that differ where bytes of them were changed and nothing of their places.
FEW_SAMPLES = 60


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


def hostile_table(
    data: bytes, random: np.random.Generator, tables: Sequence[str] = ("recordings",)
) -> bytes:
    """Write one hostile cell into a database, by whatever column."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "h.db"
        path.write_bytes(data)
        with closing(sqlite3.connect(path)) as store:
            table = tables[int(random.integers(len(tables)))]
            columns = [row[1] for row in store.execute(f"PRAGMA table_info({table})")]
            columns = [name for name in columns if name != "checksum"]
            name = columns[int(random.integers(len(columns)))]
            cell = [b"\xff\xfe", "x", -1, 0, 4e209, 1e308, 1 << 60][int(random.integers(7))]
            row = int(random.integers(1, 4))
            try:
                store.execute(f"UPDATE {table} SET {name} = ? WHERE rowid = ?", (cell, row))
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


# Recordings of every format: (write arrays by name with one rate and one unit)

SAMPLES = 0.1 * np.random.default_rng(7).normal(size=(2, 300))
RATE_HZ = 5000.0
Arrays = dict[str, np.ndarray]


def wav(path: Path, arrays: Arrays, rate: Any, _: str) -> None:
    wavfile.write(path, rate, (np.array([*arrays.values()]).T * 2**15).astype("i2"))


def wav_of_floats(path: Path, arrays: Arrays, rate: Any, _: str) -> None:
    wavfile.write(path, rate, np.array([*arrays.values()]).T.astype("f4"))


def npy(path: Path, arrays: Arrays, *_: Any) -> None:
    with path.open("wb") as stream:
        np.save(stream, np.array([*arrays.values()]))


def npz(path: Path, arrays: Arrays, rate: Any, _: str) -> None:
    with path.open("wb") as stream:
        np.savez_compressed(stream, vib=np.array([*arrays.values()]), fs=rate)


def mat(path: Path, arrays: Arrays, rate: Any, unit: str, *, packed: bool = False) -> None:
    own = {"acc": np.array([*arrays.values()]), "fs": rate, "unit": unit}
    savemat(path, {"run": own, "names": [*arrays]}, do_compression=packed)


def packed_mat(path: Path, *given: Any) -> None:
    mat(path, *given, packed=True)


def flac(path: Path, arrays: Arrays, rate: Any, _: str) -> None:
    soundfile.write(path, np.array([*arrays.values()]).T, rate, format="FLAC")


def hdf5(path: Path, arrays: Arrays, rate: Any, unit: str) -> None:
    with h5py.File(path, "w") as file:
        file["acc"] = np.array([*arrays.values()])
        file.attrs["fs"], file["acc"].attrs["units"] = rate, unit
        file["acc"].attrs["names"] = [*arrays]


def tdms(path: Path, arrays: Arrays, rate: Any, unit: str) -> None:
    wave = {"wf_increment": float(np.divide(1.0, rate)), "unit_string": unit}
    with nptdms.TdmsWriter(path) as writer:
        channels = [nptdms.ChannelObject("g", name, arrays[name], wave) for name in arrays]
        writer.write_segment(channels)


def parquet(path: Path, arrays: Arrays, rate: Any, unit: str) -> None:
    table = pyarrow.table(arrays)
    fields = [own.with_metadata({"unit": unit}) for own in table.schema]
    told = pyarrow.schema(fields, metadata={"fs": repr(rate)})
    pyarrow.parquet.write_table(table.cast(told), path)


def uff(path: Path, arrays: Arrays, rate: Any, unit: str) -> None:
    lines = []
    for name, values in arrays.items():
        lines += ["    -1", "    58", name, "NONE", "01-Jan-24 00:00:00", "NONE", "NONE"]
        lines += [
            "    1         0    0         0 NONE               1   3 NONE               0   0"
        ]
        lines += [
            f"         4{len(values):10d}         1  0.00000e+00{1 / rate:13.5e}  0.00000e+00"
        ]
        for kind, told in ((17, "s"), (12, unit), (0, "NONE"), (0, "NONE")):
            lines.append(f"{kind:10d}{0:5d}{0:5d}{0:5d} {'NONE':20s} {told:20s}")
        rows = (values[place : place + 4] for place in range(0, len(values), 4))
        lines += ["".join(f"{value:20.11E}" for value in row) for row in rows]
        lines += ["    -1"]
    path.write_text("\n".join(lines) + "\n")


FORMATS = (wav, wav_of_floats, npy, npz, mat, packed_mat, flac, hdf5, tdms, parquet, uff)


def near_ends(data: bytes, random: np.random.Generator) -> bytes:
    """Change what most formats keep what matters in: their beginning, or their end."""
    out = bytearray(data)
    for _ in range(int(random.integers(1, 5))):
        place = int(random.integers(min(len(out), 600)))
        place = place if random.random() < 0.7 else len(out) - 1 - place
        words = [bytes(4), b"\xff" * 4, b"\xff\xff\xff\x7f", random.bytes(1)]
        word = words[int(random.integers(4))]
        out[place : place + len(word)] = word
    return bytes(out)


def hostile_signals(write: Callable[..., None]) -> Change:
    """Return what writes a sound file of this format with hostile content."""

    def hostile_content(data: bytes, random: np.random.Generator) -> bytes:
        names = ["a1", "a$2^", "=1+1", "", "time [ms]", "x" * 300, "a\nb", "\x1b[31m", "é\0"]
        rates = [RATE_HZ, 0, 1, -1, 1e-9, 1e308, np.nan, np.inf, 2**32 - 1, True, np.zeros(3)]
        units = ["g", "", "parsec", "m/s2" * 40, "\n", "=1+1"]
        arrays = {
            names[int(random.integers(len(names)))]: hostile_array(own, random)
            if random.random() < 0.5
            else own[: int(random.integers(301))]
            for own in SAMPLES
        }
        rate, unit = rates[int(random.integers(11))], units[int(random.integers(6))]
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "hostile"
            try:
                write(path, arrays, rate, unit)
                return path.read_bytes()
            except Exception:  # the library that writes refuses it
                return data

    return hostile_content


def samples_of(path: Path, rate: float | None) -> np.ndarray | None:
    """Return what is read, which is finite; nothing if it is said that a channel is left out."""
    found = read_recording(path, rate)
    assert np.isfinite(found.samples).all()
    assert all(text.isprintable() for text in found.notes)
    return found.samples if not any("left out" in text for text in found.notes) else None


def any_table(_: bytes, random: np.random.Generator) -> bytes:
    """Return a table in some dialect and encoding, damaged, at times packed and damaged then."""
    own = plain_random.Random(int(random.integers(1 << 62)))
    data, _ = encoded(damaged(mixed_up(some_table(own), own), own), own)
    if own.random() < 0.1:
        data = gzip.compress(data)
        return flipped(data, random) if own.random() < 0.5 else data
    return data


def rows_of(path: Path) -> np.ndarray | None:
    """Return the numbers of a text; what the columns mean has to be found out or refused."""
    source = open_source(path)
    if identify(source):
        return None
    table = read_table(source, Wanted())
    rows = table.values.copy()  # what is found to be in g is turned into m/s2 in its place
    with suppress(RecordingError):
        rate = 1000.0 if path.stat().st_size % 2 else None
        assert len(interpret(table, Wanted(sampling_rate_hz=rate))["samples"])
    return rows


def judged_slowly(path: Path, rows: np.ndarray | None) -> str:
    """Compare the numbers of a text with those of the slow reader."""
    if rows is None:
        return ""
    try:
        data = path.read_bytes()
        data = gzip.decompress(data) if data.startswith(b"\x1f\x8b") else data
        encoding = open_source(path).encoding
        plain = data if encoding in ("", "utf-8-sig") else data.decode(encoding, "replace").encode()
        slow = read_slowly(plain)
    except (NotATableError, EOFError, OSError, zlib.error) as error:
        return f"read, where the slow reader refuses: {error}"
    same = len(slow) == rows.shape[1] and all(
        all(map(alike, row, own)) for row, own in zip(rows.T.tolist(), slow, strict=True)
    )
    return "" if same else "other numbers than the slow reader's"


def targets(folder: Path) -> dict[str, Target]:
    """Return every kind of file, made from small originals."""
    made: dict[str, Target] = {}

    def add(name: str, path: Path, read: Callable[[Path], Any], *more: Change, sure: bool) -> None:
        made[name] = Target(
            name=name, original=path.read_bytes(), read=read, changes=(*BYTES, *more), sure=sure
        )

    made["tables"] = Target(
        name="tables",
        original=b"a,b\n" + b"1.5,2\n" * 9,
        read=rows_of,
        changes=(any_table,),
        judged=judged_slowly,
    )
    write_simulation(simulate(machine(), (), 0.3, 4000.0, seed=1), folder / "a.csv")
    add("csv", folder / "a.csv", lambda p: read_recording(p).samples.tobytes(), sure=False)
    for write in FORMATS:
        path, rate = folder / write.__name__, RATE_HZ if write is npy else None
        write(path, dict(zip(("a1", "a2"), SAMPLES, strict=True)), int(RATE_HZ), "m/s2")
        made[write.__name__] = Target(
            name=write.__name__,
            original=path.read_bytes(),
            read=partial(samples_of, rate=rate),
            changes=(*BYTES, near_ends, hostile_signals(write)),
        )
    write_reference(reference(), folder / "a.ref")
    add("reference", folder / "a.ref", used_reference, hostile_archive, sure=True)
    random = np.random.default_rng(0)
    rows = random.normal(size=(60, 5)) + np.repeat([[0.0], [3.0], [6.0]], 20, axis=0)
    trained = KindClassifier(random_state=0)
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
        lambda p: {k: v.tolist() for k, v in indicators.read_history(p).variances.items()},
        hostile_text_of_json,
        sure=False,
    )
    fleet = some_fleet(folder / "fleet")
    told = (folder / "fleet" / "fleet.toml").read_text()
    for name in ("machine.toml", "inbox"):  # damaged ones lie elsewhere
        told = told.replace(f"'{name}'", f"'{folder / 'fleet' / name}'")
    (folder / "a.fleet").write_text(told)
    add("fleet", folder / "a.fleet", read_whole_fleet, hostile_toml, sure=False)
    tables = partial(hostile_table, tables=("ledger", "latest", "alarms", "recordings"))
    tables.__name__ = "hostile_tables"
    used = partial(used_ledger, fleet)
    add("ledger", fleet.store, used, tables, sure=True)
    demos = Path(gearmon.demos.__file__).parent
    plans = (("plan", load_day, "exposure_day"), ("harvester", load_harvester, "harvester"))
    for name, load, file in plans:
        add(
            name,
            demos / f"{file}.toml",
            lambda p, load=load: repr(load(p)),
            hostile_toml,
            sure=False,
        )
    (folder / "a.toml").write_text(MACHINE_FILE)
    add("machine", folder / "a.toml", lambda p: repr(load_machine(p)), hostile_toml, sure=False)
    return made


def some_fleet(folder: Path) -> Fleet:
    """Make a fleet of two machines, one of them with an alarm, that has worked."""
    fleet = fleet_stand_in.made_fleet(folder, more='[[alarm]]\ncommand = ["true"]\n')
    for day in range(6):
        fleet_stand_in.arrive(folder, "a_{}_hay.txt", f"0.{day}", days=day)
        fleet_stand_in.arrive(folder, "b_{}.txt", f"fault 0.{day + 1}", days=day)
    run_fleet(fleet, fleet_stand_in.at_once)
    deliver(fleet)
    with closing(sqlite3.connect(fleet.store)) as store:
        store.execute("PRAGMA journal_mode = DELETE")
    return fleet


def read_whole_fleet(path: Path) -> Any:
    """Read a fleet file, and what has arrived."""
    fleet = read_fleet(path)
    return repr(fleet), arrived(fleet)


def used_ledger(fleet: Fleet, path: Path) -> Any:
    """Return all that is told of a fleet by its store."""
    with tempfile.TemporaryDirectory() as folder:
        own = replace(fleet, store=path, results=Path(folder))
        rows = [pyarrow.parquet.read_table(name).to_pylist() for name in write_results(own)]
    return repr((rank(own), alarms(own), read_latest(path), rows))


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


def memory(name: str) -> float:
    """Return the memory that this process holds, or has held at most [bytes]."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(name):
            return 1024.0 * int(line.split()[1])
    raise KeyError(name)


def moved(name: str, change: Change, found: Any, whole: Any) -> bool:
    """Tell whether damaged bytes moved samples or lost a channel without a word."""
    if not isinstance(found, np.ndarray):
        return False
    if name == "uff" and change is cut:  # nothing in it says how many channels follow
        whole = whole[: len(found)]
    if found.shape != whole.shape:
        return True
    # a name that was damaged may change their order
    return min((found != whole).sum(), (found != whole[::-1]).sum()) > FEW_SAMPLES


def attack(
    target: Target, count: int, seed: int, folder: Path, most_used: list[float] | None = None
) -> list[str]:
    """Return what went wrong in so many trials; `most_used` gets the most seconds and bytes."""
    random = np.random.default_rng(seed)
    path = folder / f"damaged.{target.name}"
    path.write_bytes(target.original)
    begin = time.process_time()
    whole, wrong = target.read(path), []
    most = MOST_SECONDS + 2 * (time.process_time() - begin)
    for number in range(count):
        change = target.changes[number % len(target.changes)]
        path.write_bytes(change(target.original, random))
        Path("/proc/self/clear_refs").write_text("5")  # the most memory counts from here
        held, begin = memory("VmRSS"), time.process_time()
        what = f"{target.name} {number} ({change.__name__}, seed {seed}): "
        try:
            found = target.read(path)
            used = time.process_time() - begin
            if target.sure and change in BYTES and found != whole:
                wrong.append(what + "another content was read without a word")
            if change in (*BYTES, near_ends) and moved(target.name, change, found, whole):
                wrong.append(what + f"other samples ({found.shape})")
            if told := target.judged(path, found):
                wrong.append(what + told)
            begin = time.process_time() - used
        except GearmonError as error:
            if not str(error).isprintable():
                wrong.append(what + f"not one line: {error!r}")
        except Exception as error:
            wrong.append(what + f"{type(error).__name__}: {error}")
        costs = [time.process_time() - begin, memory("VmHWM") - held]
        if costs[0] > most:
            wrong.append(what + f"took {costs[0]:.1f} s")
        if costs[1] > MOST_BYTES:
            wrong.append(what + f"took {costs[1] / 1e6:.0f} MB")
        if most_used is not None:
            most_used[:] = map(max, most_used, costs)
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
    for name in given.target or known:
        begin = time.perf_counter()
        most = [0.0, 0.0]
        wrong = attack(known[name], given.count, given.seed, folder, most)
        bad += len(wrong)
        took = f"{time.perf_counter() - begin:.0f} s"
        took += f", at most {most[0]:.2f} s, {most[1] / 1e6:.0f} MB a file"
        print(f"{name}: {given.count} files, {len(wrong)} wrong, {took}", flush=True)
        print("\n".join(wrong[:20]), flush=True)
    print(f"files that went wrong are in {folder}" if bad else "nothing went wrong")
    return min(bad, 1)


if __name__ == "__main__":
    sys.exit(main())
