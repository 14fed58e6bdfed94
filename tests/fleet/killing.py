"""Whoever works on a fleet is killed at random moments: the store is that of an undisturbed run.

By hand; a quick round for the runner runs with the tests:

    python tests/fleet/killing.py --kills 25
    python tests/fleet/killing.py --kills 5 --seed 3 --target "dask scheduler"
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from reference.fleet_stand_in import arrive, at_once, content, made_fleet, said, standing_in

from gearmon.errors import GearmonError
from gearmon.fleet import on_dask, read_fleet, run_fleet

TARGETS = ("runner", "worker", "dask worker", "dask scheduler")
#: Longest time between two kills [s]: a run takes a few seconds. And for a run in all.
WITHIN_S, PATIENCE_S = 4.0, 300.0
GAVE_UP = 3


def children(parent: int) -> list[int]:
    """Processes that do the work of one, or of those it began."""
    found = []
    for task in Path(f"/proc/{parent}/task").glob("*/children"):
        with suppress(OSError):
            found += map(int, task.read_text().split())
    return [*found, *(far for near in found for far in children(near))]


def workers(parent: int) -> list[int]:
    """Of these, the ones that analyse: those that keep account of resources are spared."""
    own = []
    for process in children(parent):
        with suppress(OSError):
            line = Path(f"/proc/{process}/cmdline").read_bytes()
            own += [process] if b"spawn_main" in line else []
    return own


class Cluster:
    """A scheduler and two workers as processes of their own."""

    def __init__(self) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.scheduler = self.workers = None
        self.begin()

    def begin(self) -> None:
        begun = partial(subprocess.Popen, stderr=subprocess.DEVNULL, start_new_session=True)
        words = [sys.executable, "-m", "dask"]
        place = ["--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard"]
        if self.scheduler is None or self.scheduler.poll() is not None:
            self.scheduler = begun([*words, "scheduler", *place])
        known = ["--nworkers", "2", "--nthreads", "1", "--no-dashboard"]
        self.workers = begun([*words, "worker", self.address, *known])

    def tend(self) -> None:
        """Begin again what has ended, as a service would: a nanny whose worker dies early goes."""
        if self.workers.poll() is not None:
            self.begin()

    def end(self) -> None:
        for process in (self.workers, self.scheduler):
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def runner(fleet: Path, address: str) -> subprocess.Popen[bytes]:
    words = [sys.executable, __file__, "--run", str(fleet), "--scheduler", address]
    return subprocess.Popen(words)


def run(fleet: Path, address: str) -> int:
    """Go through a fleet once, in a process of its own."""
    engine = partial(on_dask, task=said, scheduler=address) if address else standing_in
    try:
        run_fleet(read_fleet(fleet), engine)
    except GearmonError as error:
        print(error, file=sys.stderr)
        return 0 if "run again" in str(error) or "another gearmon" in str(error) else GAVE_UP
    return 0


def emptied(fleet) -> None:
    for path in (*fleet.store.parent.glob("fleet.db*"), *fleet.results.glob("*.parquet")):
        path.unlink()


def attack(target: str, kills: int, folder: Path, chance: random.Random) -> list[str]:
    """Kill so many times; return what went wrong."""
    fleet = made_fleet(folder)
    for number in range(80):
        text = chance.choice(["slow 0.1", "fault 0.2", "bad", "slow 0.3"])
        for name in ("a", "b"):
            day, own = number % 28, f"{name}_{{}}T{number // 28:02d}-00_c{number % 2}.txt"
            arrive(folder, own, text, days=day)
    run_fleet(fleet, at_once)
    undisturbed = content(fleet)
    cluster = Cluster() if "dask" in target else None
    done, wrong = 0, []
    try:
        while done < kills:
            emptied(fleet)
            done += disturbed(target, kills - done, folder / "fleet.toml", cluster, chance)
            if (found := content(fleet)) != undisturbed:
                rows = {key: set(own) ^ set(undisturbed[key]) for key, own in found.items()}
                wrong.append(f"{target}: another store after {done} kills: {rows}"[:2000])
            if run_fleet(fleet, at_once).done:
                wrong.append(f"{target}: something was left to do")
    finally:
        if cluster:
            cluster.end()
    return wrong


def disturbed(
    target: str, kills: int, fleet: Path, cluster: Cluster | None, chance: random.Random
) -> int:
    """Run until all is done, with kills on the way; return their number."""
    done, began = 0, time.monotonic()
    address = cluster.address if cluster else ""
    at_work = runner(fleet, address)
    while True:
        try:
            ended = at_work.wait(chance.uniform(0.0, WITHIN_S))
        except subprocess.TimeoutExpired:
            if time.monotonic() - began > PATIENCE_S:
                at_work.kill()
                return done
            if done < kills:
                done += killed(target, at_work, cluster, chance)
            if cluster:
                cluster.tend()
            continue
        if ended == GAVE_UP:
            return done
        if ended == 0 and not left_over(fleet):
            return done
        at_work = runner(fleet, address)


def left_over(fleet: Path) -> bool:
    return len(content(read_fleet(fleet))["ledger"]) < len(list(fleet.parent.glob("inbox/*")))


def killed(target: str, at_work, cluster: Cluster | None, chance: random.Random) -> int:
    own = {
        "runner": lambda: [at_work.pid],
        "worker": lambda: workers(at_work.pid),
        "dask worker": lambda: workers(cluster.workers.pid),
        "dask scheduler": lambda: [cluster.scheduler.pid],
    }[target]()
    if not own:
        return 0
    with suppress(ProcessLookupError):
        os.kill(chance.choice(own), signal.SIGKILL)
    if target == "dask scheduler":
        cluster.end()
        cluster.begin()
    return 1


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=0, help="of each target")
    parser.add_argument("--target", choices=TARGETS, action="append")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--run", type=Path)
    parser.add_argument("--scheduler", default="")
    given = parser.parse_args()
    if given.run:
        return run(given.run, given.scheduler)
    os.environ["PYTHONPATH"] = os.pathsep.join([sys.path[0], os.environ.get("PYTHONPATH", "")])
    wrong = []
    for target in given.target or TARGETS:
        began = time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            found = attack(target, given.kills, Path(folder), random.Random(given.seed))
        took = time.monotonic() - began
        print(f"{target}: {given.kills} kills, {len(found)} wrong, {took:.0f} s", flush=True)
        wrong += found
    print("\n".join(wrong))
    return min(len(wrong), 1)


if __name__ == "__main__":
    sys.exit(main())
