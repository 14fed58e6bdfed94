"""What arrives is analysed, once; what is still being written is waited for."""

from __future__ import annotations

import fcntl
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from gearmon import __version__
from gearmon.diagnosis.history.store import as_text
from gearmon.errors import ArgumentError
from gearmon.fleet.alarm import alarms, deliver, renew
from gearmon.fleet.engines import in_processes
from gearmon.fleet.ledger import Outcome, counts, keep, keep_growing, known, write_results
from gearmon.fleet.plan import Fleet, Job, arrived

Engine = Callable[[Sequence[Job]], Iterator[Outcome]]
#: A file that was written to so lately is looked at again before it is read [s].
SETTLED_S = 5.0


@dataclass(frozen=True, kw_only=True)
class Run:
    """What a run did.

    Parameters
    ----------
    done : int
        Recordings analysed.
    failed, refused : dict of str to str
        Those that could not be, and files that are not taken; and why.
    growing : tuple of str
        Recordings still being written.
    results : tuple of Path
        Parquet files written.
    """

    done: int
    failed: dict[str, str]
    refused: dict[str, str]
    growing: tuple[str, ...]
    results: tuple[Path, ...]

    def to_dict(self, fleet: Fleet) -> dict[str, Any]:
        """Return built-in types, ready for JSON; with what the ledger knows of all runs."""
        listed = {"failed": self.failed, "not_taken": self.refused}
        told = {
            key: [{"recording": p, "why": w} for p, w in d.items()] for key, d in listed.items()
        }
        current = [own for own in alarms(fleet) if not own["over"]]
        return {
            "fleet": fleet.name,
            "store": str(fleet.store),
            "analysed": self.done,
            **told,
            "being_written": list(self.growing),
            "ledger": counts(fleet),
            "alarms": current,
            "results": [str(path) for path in self.results],
        }


def run_fleet(
    fleet: Fleet,
    engine: Engine = in_processes,
    *,
    again: bool = False,
    before: dict[str, Any] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Run:
    """Analyse what is new in the folders of a fleet.

    Parameters
    ----------
    fleet : Fleet
    engine : callable
        `in_processes`, or `on_dask` with its scheduler.
    again : bool
        Whether those that failed, or were analysed by another version, are analysed once more.
    before : dict, optional
        What `_seen` said a while ago; by default it is found out, which takes `SETTLED_S` if files
        were written to so lately.
    progress : callable, optional
        Called with the share done, 0 to 1.

    Returns
    -------
    Run
        What was analysed, what failed and was not taken, with reasons, and the files written.

    Raises
    ------
    ArgumentError
        If another process works on the same fleet.
    """
    with _alone(fleet):
        jobs, refused = arrived(fleet)
        if before is None:
            before = _seen(jobs)
            if any(_fresh(job) for job in jobs):
                time.sleep(SETTLED_S)
                jobs, refused = arrived(fleet)
        new = list(_new(jobs, known(fleet), again))
        growing = [job for job in new if before.get(job.path) != job.state]
        keep_growing(fleet, growing)
        ready = [job for job in new if before.get(job.path) == job.state]
        told: dict[str, str] = {}
        for outcome in engine(ready):
            told[outcome.job.path] = keep(fleet, outcome)
            if progress:
                progress(len(told) / len(ready))
        renew(fleet)
        results = tuple(write_results(fleet))
    late = [path for path, what in told.items() if what == "being written"]
    failed = {path: what for path, what in told.items() if what not in ("done", "being written")}
    return Run(
        done=list(told.values()).count("done"),
        failed=failed,
        refused=refused,
        growing=(*(job.path for job in growing), *late),
        results=results,
    )


def _seen(jobs: Sequence[Job]) -> dict[str, Any]:
    """Return how large recordings are and when they changed: two looks tell which are settled."""
    return {job.path: job.state for job in jobs}


def _fresh(job: Job) -> bool:
    """Whether a file was written to lately; also where the clock has jumped back since."""
    changed = job.changed
    return changed.isdecimal() and time.time() - int(changed) / 1e9 < SETTLED_S


def _new(jobs: Sequence[Job], ledger: dict[str, Any], again: bool) -> Iterator[Job]:
    """Give the recordings that the ledger does not know as they are now."""
    for job in jobs:
        *state, what, version = ledger.get(as_text(job.path), (0, "", "", ""))
        old = again and (what == "failed" or version != __version__)
        if tuple(state) != job.state or what == "being written" or old:
            yield job


@contextmanager
def _alone(fleet: Fleet) -> Iterator[None]:
    """Let nobody else work on the same fleet; whoever is killed gives way."""
    path = f"{fleet.store}.lock"
    try:
        file = open(path, "a")  # noqa: SIM115 - what another program keeps there stays as it is
    except OSError as error:
        raise ArgumentError(f"{path}: cannot write there ({error.strerror})") from None
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            told = f"{fleet.store}: another gearmon fleet works on it; stop that one, or wait"
            raise ArgumentError(told) from None
        yield


def watch_fleet(
    fleet: Fleet,
    engine: Engine = in_processes,
    *,
    every_s: float,
    told: Callable[[Run | str], None],
    rounds: float = float("inf"),
) -> None:
    """Analyse recordings as they arrive, and tell of alarms, until stopped.

    Parameters
    ----------
    fleet : Fleet
    engine : callable
    every_s : float, > 0
        Time between two looks [s]: a file that is the same in both is ready.
    told : callable
        Gets what every look did, if it did anything, and what hooks could not do.
    rounds : float
        Looks after which to stop, dimensionless; without end by default.
    """
    before: dict[str, Any] = {}
    delivery: Future[list[str]] | None = None
    with ThreadPoolExecutor(1, "alarms") as thread:
        while rounds > 0:
            rounds -= 1
            seen = _seen(arrived(fleet)[0])
            run = run_fleet(fleet, engine, before=before)
            before = seen
            if run.done or run.failed:
                told(run)
            if delivery is None or delivery.done():
                for trouble in delivery.result() if delivery else ():
                    told(trouble)
                delivery = thread.submit(partial(deliver, fleet))
            if rounds > 0:
                time.sleep(every_s)
