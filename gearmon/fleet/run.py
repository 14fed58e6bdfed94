"""What arrives is analysed once, by processes here or on a cluster; what is being written waits."""

from __future__ import annotations

import fcntl
import hashlib
import logging
import os
import tempfile
import time
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent import futures
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import replace
from datetime import UTC, datetime
from functools import lru_cache, partial
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gearmon import __version__
from gearmon.diagnosis.history.entries import entry_of
from gearmon.diagnosis.history.store import as_text
from gearmon.errors import ArgumentError, GearmonError
from gearmon.fleet.ledger import Outcome, alarms, deliver, keep, known, renew, write_results
from gearmon.fleet.plan import Fleet, FleetMachine, Job, arrived, is_remote
from gearmon.machine import Machine, load_machine
from gearmon.signals.recording import Recording, free_bytes, read_recording
from gearmon.signatures.measured.reference import Reference, read_reference
from gearmon.threads import THREADS, alone_on_a_core, cores

if TYPE_CHECKING:
    from gearmon.diagnosis.results import Analysis

Task = Callable[[Job], Outcome]
#: Deaths of its process that a recording is forgiven: whoever kills processes at random (the
#: kernel, short of memory) hits the same one rarely as often, alone in its process.
_FORGIVEN = 3
#: Processes in a row that may be killed as they begin.
_BARREN = 20
_KILLED = "its process was killed each time it was read, by lack of memory most likely"
#: Recordings that go to a worker of a cluster at once: fewer cost more messages than work, more
#: are lost with a worker.
_BATCH = (20, 100)
# Memory that a recording takes while it is analysed, in sizes of its file: 5.4 GB of float32 took
# 15.7 GB.
_GROWS = 3.0
# Seconds until a scheduler that does not answer is given up.
_CONNECT_S = 20.0


def analysed(job: Job) -> Outcome:
    """Analyse a recording; whatever is wrong with it stands in the outcome."""
    if job.size * _GROWS > (free := free_bytes()) / (os.cpu_count() or 1):
        told = f"{job.size / 1e9:.1f} GB of recording take more memory than there is"
        told += f" ({free / 1e9:.1f} GB free for {os.cpu_count()} processes)"
        return Outcome(job=job, why=f"{told}; make shorter recordings")
    file = job.path
    try:
        with at_hand(job.path) as file:
            with open(file, "rb") as content:
                short = partial(hashlib.blake2b, digest_size=16)
                digest = hashlib.file_digest(content, short).hexdigest()
            analysis, *_ = judged(job.machine, file, job.path)
            growing = not is_remote(job.path) and _state(file) != job.state
        entry = entry_of(analysis, datetime.fromtimestamp(job.time_s, UTC), "name")
    except MemoryError:
        return Outcome(job=job, why="takes more memory than there is; make shorter recordings")
    except (GearmonError, OSError) as error:
        return Outcome(job=job, why=str(error).removeprefix(f"{file}: "))
    except Exception as error:  # one recording must not stop the night
        return Outcome(job=job, why=f"an error of gearmon's own ({type(error).__name__}: {error})")
    if growing:
        return Outcome(job=job, growing=True)
    return Outcome(job=job, hash=digest, entry=entry, indicators=analysis.indicators)


@contextmanager
def at_hand(path: str) -> Iterator[str]:
    """Give a recording as a file of this computer, for as long as it is needed."""
    if not is_remote(path):
        yield path
        return
    import fsspec

    with tempfile.TemporaryDirectory() as folder:
        system, there = fsspec.core.url_to_fs(path)
        here = str(Path(folder) / there.rpartition("/")[2])
        system.get_file(there, here)
        yield here


def _state(file: str) -> tuple[int, str]:
    told = os.stat(file)
    return told.st_size, str(told.st_mtime_ns)


def judged(
    own: FleetMachine, file: str, path: str
) -> tuple[Analysis, Recording, Reference | None, Machine]:
    """Analyse a recording, of which a file here is a copy; return what it was judged by as well."""
    from gearmon.diagnosis.analysis import analyse

    files = (own.file, *([own.reference] if own.reference else []))
    machine, reference = _read(files, tuple(map(_state, files)))
    machine = replace(machine, name=own.name)
    known: dict[str, Any] = {"sampling_rate_hz": own.sampling_rate_hz, "sensors": machine.sensors}
    recording = read_recording(file, channels=own.sensors or None, **known)
    recording = replace(recording, origin=path)
    return analyse(recording, machine, reference), recording, reference, machine


@lru_cache(maxsize=8)
def _read(files: tuple[str, ...], _states: tuple[Any, ...]) -> tuple[Machine, Reference | None]:
    """Read machine file and reference, again only if they were written to."""
    return load_machine(files[0]), read_reference(files[1]) if len(files) > 1 else None


def in_processes(jobs: Sequence[Job], task: Task = analysed) -> Iterator[Outcome]:
    """Do the work on all cores of this computer, each process on one of them.

    Parameters
    ----------
    jobs : sequence of Job
    task : callable
        A function of a module: it goes to the processes by its name.

    Yields
    ------
    Outcome
        In the order in which they are done.

    Raises
    ------
    ArgumentError
        If processes are killed again and again before they begin.
    """
    # read when NumPy is first loaded, which the processes do
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    waiting, suspects, deaths = deque(jobs), deque[Job](), Counter[str]()
    barren = 0
    while waiting or suspects:
        # who was at work when a process died is given one to itself, to see which it was
        queue, width = (suspects, 1) if suspects else (waiting, cores())
        running: dict[futures.Future[Outcome], Job] = {}
        # not forked: threads that deliver alarms may run
        pool = futures.ProcessPoolExecutor(width, get_context("spawn"), alone_on_a_core)
        try:
            with suppress(BrokenProcessPool):
                if width == 1:
                    # a process that is killed as it begins says nothing of the recording
                    pool.submit(os.getpid).result()
                while queue or running:
                    # one more than there are processes: none waits, and memory stays flat
                    while queue and len(running) < width + (width > 1):
                        future = pool.submit(task, queue[0])
                        running[future] = queue.popleft()
                    for future in futures.wait(running, return_when=futures.FIRST_COMPLETED).done:
                        yield future.result()
                        del running[future]
        finally:
            pool.shutdown(cancel_futures=True)
        barren = 0 if running else barren + 1
        if barren > _BARREN:
            told = f"{barren} processes were killed before they could begin; free memory"
            raise ArgumentError(f"{told}, and run again to go on")
        for job in running.values():
            deaths[job.path] += 1
            if deaths[job.path] > _FORGIVEN:
                yield Outcome(job=job, why=_KILLED)
            else:
                suspects.append(job)


def on_dask(
    jobs: Sequence[Job], task: Task = analysed, *, scheduler: str, patience_s: float = 3600.0
) -> Iterator[Outcome]:
    """Do the work on a Dask cluster, in batches; outcomes are those of `in_processes`.

    Parameters
    ----------
    jobs : sequence of Job
        Their files and those of their machines are to be found under the same names by all workers.
    task : callable
    scheduler : str
        Its address, as "tcp://10.0.0.1:8786".
    patience_s : float, > 0
        Longest time without any batch being done [s].

    Yields
    ------
    Outcome

    Raises
    ------
    ArgumentError
        If the scheduler cannot be reached, or nothing is done for too long. What was done is kept.
    """
    try:
        from distributed import Client, KilledWorker
        from distributed import wait as wait_for
    except ImportError:
        raise ArgumentError("--engine dask needs pip install 'gearmon[cluster]'") from None
    # what is lost is said in one line below
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    try:
        with Client(scheduler, timeout=_CONNECT_S) as client:
            workers = len(client.scheduler_info(n_workers=-1)["workers"])
            share = -(-len(jobs) // (4 * max(1, workers)))
            size = min(max(share, _BATCH[0]), _BATCH[1])

            def worked(batches: Sequence[Sequence[Job]]) -> Generator[Outcome, None, list[Job]]:
                """Work through batches; return the jobs of those that workers died of."""
                running = {client.submit(_batch, own, task, pure=False): own for own in batches}
                lost: list[Job] = []
                while running:
                    for future in wait_for([*running], patience_s, "FIRST_COMPLETED").done:
                        batch, error = running.pop(future), future.exception()
                        if isinstance(error, KilledWorker):
                            lost += batch
                        elif error is not None:
                            raise error
                        else:
                            yield from future.result()
                return lost

            lost = yield from worked([jobs[n : n + size] for n in range(0, len(jobs), size)])
            # the scheduler has tried a batch on several workers: which one of it was it?
            lost = yield from worked([[job] for job in lost])
            for job in lost:
                # with nothing else at work, nobody dies for another's fault
                if (yield from worked([[job]])):
                    yield Outcome(job=job, why=_KILLED)
    except TimeoutError:
        told = f"--scheduler {scheduler}: does not answer, or did nothing for {patience_s:g} s"
        raise ArgumentError(f"{told}; run again to go on") from None
    except (OSError, futures.CancelledError) as error:
        told = f"--scheduler {scheduler}: was lost ({' '.join(str(error).split())[:80]})"
        raise ArgumentError(f"{told}; run again to go on") from None


def _batch(jobs: Sequence[Job], task: Task) -> list[Outcome]:
    os.environ[THREADS] = "1"
    return [task(job) for job in jobs]


Engine = Callable[[Sequence[Job]], Iterator[Outcome]]
#: A file that was written to so lately is looked at again before it is read [s].
SETTLED_S = 5.0


class Run:
    """What a run did.

    Parameters
    ----------
    told : dict of str to str
        What became of recordings by their paths, see `ledger.keep`.
    refused : dict of str to str
        Files that are not taken, and why.
    results : tuple of Path
        Parquet files written.

    Attributes
    ----------
    done : int
        Recordings analysed.
    failed, refused : dict of str to str
        Those that could not be, and files that are not taken; and why.
    growing : tuple of str
        Recordings still being written.
    results : tuple of Path
    """

    def __init__(
        self, told: dict[str, str], refused: dict[str, str], results: tuple[Path, ...]
    ) -> None:
        self.growing = tuple(path for path, what in told.items() if what == "being written")
        sound = ("done", "being written")
        self.failed = {path: why for path, why in told.items() if why not in sound}
        self.done = len(told) - len(self.failed) - len(self.growing)
        self.refused, self.results = refused, results

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
            "ledger": dict(Counter(sorted(state for _, _, state, _ in known(fleet).values()))),
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
        How large recordings were a while ago, and when they had changed, by path: two looks tell
        which are settled. By default it is found out, which takes `SETTLED_S` if files were written
        to so lately.
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
            before = {job.path: job.state for job in jobs}
            # written to lately, or the clock has jumped back since
            written_s = [int(job.changed) / 1e9 for job in jobs if job.changed.isdecimal()]
            if written_s and time.time() - max(written_s) < SETTLED_S:
                time.sleep(SETTLED_S)
                jobs, refused = arrived(fleet)
        ledger, new = known(fleet), []
        for job in jobs:
            *state, what, version = ledger.get(as_text(job.path), (0, "", "", ""))
            old = again and (what == "failed" or version != __version__)
            if tuple(state) != job.state or what == "being written" or old:
                new.append(job)
        growing = [job for job in new if before.get(job.path) != job.state]
        told = keep(fleet, (Outcome(job=job, growing=True) for job in growing))
        ready = [job for job in new if job.path not in told]
        for count, outcome in enumerate(engine(ready), 1):
            told |= keep(fleet, [outcome])
            if progress:
                progress(count / len(ready))
        renew(fleet)
        return Run(told, refused, tuple(write_results(fleet)))


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
    delivery: futures.Future[list[str]] | None = None
    with futures.ThreadPoolExecutor(1, "alarms") as thread:
        while rounds > 0:
            rounds -= 1
            seen = {job.path: job.state for job in arrived(fleet)[0]}
            run = run_fleet(fleet, engine, before=before)
            before = seen
            if run.done or run.failed:
                told(run)
            if delivery is None or delivery.done():
                for trouble in delivery.result() if delivery else ():
                    told(trouble)
                delivery = thread.submit(deliver, fleet)
            if rounds > 0:
                time.sleep(every_s)
