"""Killed, out of room, or not alone: whoever writes leaves the old file or the new one.

A quick round runs with the tests; long ones by hand, the second on a file system below 256 MB:

    python tests/losing.py --kills 500 --rooms 100 --writers 50
    python tests/losing.py --rooms 200 --full 3 --folder /mnt/small
    python tests/losing.py --commands 5 --full 3
"""

from __future__ import annotations

import argparse
import hashlib
import io
import os
import resource
import shutil
import signal
import sqlite3
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import closing, redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from reference.small_gearbox import MACHINE_FILE

from gearmon import cli
from gearmon.diagnosis.history import Entry, History, Place, append, export_history, read_history
from gearmon.errors import GearmonError
from gearmon.files import protecting, reading_archive, write_archive, write_atomically

#: Of a child that refused in one clear line, as of the command line.
REFUSED, FAILED = 2, 70
FILLER = ".filler"


def entry(number: int) -> Entry:
    places = [Place(stage=1, gear="pinion", teeth=60, tooth=tooth) for tooth in range(1, 61)]
    return Entry(
        machine="conveyor",
        recording=f"r{number}.csv",
        time_s=1.7e9 + number * 86400.0,
        time_source="given",
        verdict="healthy",
        score=0.0,
        false_alarm_probability=0.5,
        speed_hz=24.5,
        places=tuple(places),
    )


# Every way to write: (write version n, tell which versions stand there)


def write_text(path: Path, version: int) -> None:
    write_atomically(path, f"{version}\n" * 200_000)


def text_version(path: Path) -> set[int]:
    lines = path.read_text().splitlines()
    assert len(lines) == 200_000
    return {int(line) for line in set(lines)}


def write_arrays(path: Path, version: int) -> None:
    noise = np.random.default_rng(version).integers(256, size=300_000).astype(np.uint8)
    write_archive(path, {"format": "test", "version": version}, {"a": noise})


def arrays_version(path: Path) -> set[int]:
    with reading_archive(path, ["test"], "file", "write it", "write one") as (header, arrays):
        version = int(header["version"])
        noise = np.random.default_rng(version).integers(256, size=300_000)
        assert (arrays["a"] == noise).all()
        return {version}


def write_table(path: Path, version: int) -> None:
    export_history(History(machine="conveyor", entries=(entry(version),)), path)


def table_version(path: Path) -> set[int]:
    rows = pd.read_csv(path)
    assert len(rows) == 60
    return {int(name[1:-4]) for name in set(rows["recording"])}


def write_store(path: Path, version: int) -> None:
    append(path, [entry(version)])


def store_version(path: Path) -> set[int]:
    kept = read_history(path).entries
    assert all(len(own.places) == 60 for own in kept)
    return {len(kept) - 1}


WAYS: dict[str, tuple[Callable[[Path, int], Any], Callable[[Path], set[int]]]] = {
    "a.json": (write_text, text_version),
    "a.ref": (write_arrays, arrays_version),
    "a.csv": (write_table, table_version),
    "a.db": (write_store, store_version),
}


def child(work: Callable[[], Any]) -> int:
    """Begin some work in a process of its own."""
    pid = os.fork()
    if pid:
        return pid
    code = FAILED
    try:
        work()
        code = 0
    except GearmonError as error:
        code = REFUSED if str(error).isprintable() else FAILED
    except BaseException as error:
        print(f"{type(error).__name__}: {error}", flush=True)
    finally:
        os._exit(code)


def ended(pid: int) -> int:
    """Exit code of a child; minus the signal that ended it."""
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def told(name: str, path: Path, allowed: set[int]) -> Iterator[str]:
    """Tell whether neither the old nor the new file stands there."""
    try:
        found = WAYS[name][1](path)
    except Exception as error:
        yield f"{name}: {type(error).__name__}: {error}"
        return
    if len(found) != 1 or not found <= allowed:
        yield f"{name}: holds versions {found}, not one of {allowed}"


def killed(name: str, folder: Path, random: np.random.Generator) -> Iterator[str]:
    """Kill a writer at a moment of its writing, and then write in peace."""
    write, _ = WAYS[name]
    path = folder / name
    write(path, 0)
    begin = time.perf_counter()
    ended(child(lambda: write(folder / f"trial-{name}", 0)))
    usual = time.perf_counter() - begin
    pid = child(lambda: write(path, 1))
    time.sleep(usual * random.uniform(0.0, 1.0))
    os.kill(pid, signal.SIGKILL)
    ended(pid)
    yield from told(name, path, {0, 1})
    try:
        write(path, 2)
    except GearmonError as error:
        yield f"{name}: not written after a kill: {error}"


def leave(folder: Path, room: int) -> None:
    """Leave so many bytes on a small file system; elsewhere let no file of ours become larger."""
    if shutil.disk_usage(folder).total > 256e6:
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))
        return
    with (folder / FILLER).open("wb", buffering=0) as file, suppress(OSError):
        while True:
            file.write(b"\0" * 4096)
    os.truncate(folder / FILLER, max(0, (folder / FILLER).stat().st_size - room))


def crowded(name: str, folder: Path, room: int) -> Iterator[str]:
    """Write where there is no more room than so many bytes."""
    write, _ = WAYS[name]
    path = folder / name
    write(path, 0)

    def work() -> None:
        leave(folder, room)
        write(path, 1)

    code = ended(child(work))
    (folder / FILLER).unlink(missing_ok=True)
    if code not in (0, REFUSED):
        yield f"{name}: room {room}: ended with {code}"
    yield from told(name, path, {1} if code == 0 else {0})
    yield from (
        f"{name}: room {room}: left {left.name}" for left in folder.iterdir() if left.name[0] == "."
    )


def together(count: int, folder: Path) -> Iterator[str]:
    """Let so many write to one history at once."""
    path = folder / "shared.db"
    children = [child(lambda n=number: write_store(path, n)) for number in range(count)]
    codes = [ended(pid) for pid in children]
    kept = {own.recording for own in read_history(path).entries}
    if codes != [0] * count or len(kept) != count:
        yield f"{count} writers: exit codes {sorted(set(codes))}, {len(kept)} recordings kept"


# Every command that writes, killed about every file that it writes

LEARNED = "--machine m.toml --reference r.ref"
FLEET_FILE = r"""
[[machine]]
name = "drive"
file = "m.toml"
reference = "r.ref"
recordings = "."
pattern = 'b_(?P<time>[\d-]+)\.csv'
"""
DAY_FILE = """
position = "hand"
[[job]]
name = "turning"
recording = "a.csv"
hours = 4.0
"""
COMMAND_LINES = (
    "simulate m.toml --duration 4 --sampling-rate 10000 --seed 1 --load 0.7 -o a.csv",
    "simulate m.toml --duration 4 --sampling-rate 10000 --seed 2 -o b_2026-03-01.csv",
    "init a.csv --teeth 23/57 --speed 2960rpm -o n.toml",
    "lines m.toml -o lines.csv",
    "stiffness m.toml -o stiffness.csv",
    "baseline m.toml -o baseline.csv",
    "family m.toml --kind crack --size 20% -o family.csv",
    "stability m.toml -o stability.csv",
    "learn a.csv --machine m.toml -o r.ref",
    "check r.ref --machine m.toml -o check.csv",
    f"analyse b_2026-03-01.csv {LEARNED} --report p.html -o analysis.json",
    f"kinds b_2026-03-01.csv {LEARNED} --trained t.kinds --examples 80 -o kinds.json",
    f"history b_2026-03-01.csv {LEARNED} --time-from name --store h.db -o history.csv",
    "indicators b_2026-03-01.csv --machine m.toml --history i.json -o indicators.csv",
    "spectrum b_2026-03-01.csv --machine m.toml -o spectrum.csv",
    "orders b_2026-03-01.csv --machine m.toml -o orders.csv",
    "harvest m.toml b_2026-03-01.csv -o harvest.json",
    "modes m.toml -o modes.csv",
    "exposure a.csv --position hand --axes x=a1,y=a2 --machine m.toml --report e.html -o e.csv",
    "exposure --day day.toml --axes x=a1,y=a2 --report day.html -o day.csv",
    "fleet run fleet.toml -o fleet.json",
    "fleet rank fleet.toml -o rank.csv",
    "demo harvest -o d",
    "benchmark stiffness --quick -o benchmark.csv",
)


def stored(path: Path) -> dict[str, list[Any]]:
    """Return the rows of all tables; of a history those that its reader vouches for."""
    with closing(sqlite3.connect(path)) as store:
        every = "SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name"
        tables = [name for (name,) in store.execute(every)]
        rows = {name: store.execute(f"SELECT * FROM {name}").fetchall() for name in tables}
    return rows | {"history": read_history(path).rows() if rows.get("recordings") else []}


def contents(folder: Path) -> dict[str, str]:
    """Return what stands in each file, but for what a killed writer left under no name of ours."""
    found = {}
    for path in sorted(own for own in folder.rglob("*") if own.is_file() and own.name[0] != "."):
        name = str(path.relative_to(folder))
        if path.suffix == ".db":
            rows = stored(path)
            found |= {name: repr(rows)} if any(rows.values()) else {}
        elif not name.endswith(("-journal", "-wal", "-shm", ".lock")):
            found[name] = hashlib.sha256(path.read_bytes()).hexdigest()
    return found


def killed_within(_: Path, random: np.random.Generator, pid: int) -> str:
    """Kill a writer within the time that writing may take; 0 for the one that is killed."""
    if pid:
        time.sleep(10 ** random.uniform(-3.5, -0.5))
        os.kill(pid, signal.SIGKILL)
        ended(pid)
    return ""


def without_room(folder: Path, random: np.random.Generator, pid: int) -> str:
    """Leave a writer little room or none; say how it ended if it neither wrote nor refused."""
    room = int(random.integers(2)) * int(10 ** random.uniform(2, 6.5))
    if not pid:
        leave(folder, room)
        return ""
    code = ended(pid)
    (folder / FILLER).unlink(missing_ok=True)
    return "" if code in (0, 1, REFUSED, 3) else f"room {room}: ended with {code}"


def troubled_command(
    line: str, folder: Path, often: int, random: np.random.Generator, trouble: Callable[..., str]
) -> tuple[int, list[str]]:
    """Run a command, of which copies meet trouble from each file on that it writes.

    Returns how many did, and what stood there then that the command did not write.
    """
    words, kept = line.split(), folder.with_name("kept")
    seen: list[tuple[str, str]] = []
    wrong: list[str] = []
    count = [0]
    complete: set[tuple[str, str]] = set()
    real = Path.touch, sqlite3.connect

    def told() -> None:
        Path.touch, sqlite3.connect = real
        complete.update(contents(folder).items())

    def hooked(call: Callable[..., Any]) -> Callable[..., Any]:
        def begin(*given: Any, **named: Any) -> Any:
            told()
            shutil.copytree(folder, kept)
            for _ in range(often):
                pid = os.fork()
                report = trouble(folder, random, pid)
                if not pid:
                    return call(*given, **named)
                random.random()  # another number for the next one
                count[0] += 1
                wrong.extend([f"{line}: {report}"] if report else [])
                seen.extend(contents(folder).items())
                shutil.rmtree(folder, ignore_errors=True)  # it may be a mount
                shutil.copytree(kept, folder, dirs_exist_ok=True)
                os.chdir(folder)
            shutil.rmtree(kept)
            Path.touch, sqlite3.connect = map(hooked, real)
            return call(*given, **named)

        return begin

    parent = os.getpid()
    with protecting(words[0], ()):
        if "d" not in words:
            write_atomically(words[-1], "old")
    Path.touch, sqlite3.connect = map(hooked, real)
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()) as said:
        code = cli.main(words)
    if os.getpid() != parent:
        plain = code != REFUSED or any(why in said.getvalue() for why in ("cannot write", "disk"))
        print("" if plain else said.getvalue(), end="", file=sys.stderr, flush=True)
        os._exit(code if plain else FAILED)
    told()
    wrong += [f"{line}: {name}: neither old nor new" for name, _ in set(seen) - complete]
    return count[0], wrong + ([f"{line}: ended with {code}"] if code not in (0, 1, 3) else [])


def trouble_commands(often: int, folder: Path, seed: int, trouble: Callable[..., str]) -> list[str]:
    """Trouble every command about every file that it writes; say how often."""
    random, place, all_wrong = np.random.default_rng(seed), folder / "place", []
    place.mkdir()
    os.chdir(place)
    for name, told in (("m", MACHINE_FILE), ("fleet", FLEET_FILE), ("day", DAY_FILE)):
        Path(f"{name}.toml").write_text(told)
    for line in COMMAND_LINES:
        count, wrong = troubled_command(line, place, often, random, trouble)
        print(f"{line.split()[0]}: {count} trials, {len(wrong)} wrong", file=sys.stderr, flush=True)
        all_wrong += wrong
    return all_wrong


def attack(kills: int, rooms: int, writers: int, folder: Path, seed: int = 0) -> list[str]:
    """Return what went wrong."""
    random, wrong = np.random.default_rng(seed), []
    for number in range(kills + rooms):
        name = list(WAYS)[number % len(WAYS)]
        place = Path(tempfile.mkdtemp(dir=folder))
        if number < kills:
            wrong += killed(name, place, random)
        else:
            wrong += crowded(name, place, int(10 ** random.uniform(0, 5.7)))
        shutil.rmtree(place)
    return [*wrong, *(together(writers, folder) if writers else ())]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=0)
    parser.add_argument("--rooms", type=int, default=0)
    parser.add_argument("--writers", type=int, default=0)
    parser.add_argument("--commands", type=int, default=0, help="kills a file that is written")
    parser.add_argument("--full", type=int, default=0, help="full disks a file that is written")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--folder", type=Path, default=None)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=given.folder) as folder:
        wrong = attack(given.kills, given.rooms, given.writers, Path(folder), given.seed)
        for often, trouble in ((given.commands, killed_within), (given.full, without_room)):
            if often:
                place = tempfile.mkdtemp(dir=folder)
                wrong += trouble_commands(often, Path(place), given.seed, trouble)
                os.chdir("/")
                shutil.rmtree(place)
    print("\n".join(wrong))
    return min(len(wrong), 1)


if __name__ == "__main__":
    sys.exit(main())
