"""Who does the work: the processes of this computer, or a Dask cluster; each recording on its own.

Both give the outcomes as they come, hold few recordings at a time, and set aside a recording that
kills the process it is read by: it is reported, and the others go on.
"""

from __future__ import annotations

import hashlib
import logging
import math
import os
import signal
import sys
import tempfile
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from functools import lru_cache
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gearmon.errors import ArgumentError, GearmonError
from gearmon.fleet.ledger import Outcome
from gearmon.fleet.plan import FleetMachine, Job, is_remote
from gearmon.signals.threads import THREADS, cores

if TYPE_CHECKING:
    from gearmon.machine import Machine
    from gearmon.signatures.measured.reference import Reference

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
    from gearmon.diagnosis.analysis import analyse
    from gearmon.diagnosis.history import entry_of
    from gearmon.signals.recording import read_recording

    if job.size * _GROWS > (free := _free_memory()) / (os.cpu_count() or 1):
        told = f"{job.size / 1e9:.1f} GB of recording take more memory than there is"
        told += f" ({free / 1e9:.1f} GB free for {os.cpu_count()} processes)"
        return Outcome(job=job, why=f"{told}; make shorter recordings")
    file = job.path
    try:
        with at_hand(job.path) as file:
            digest = _hash(file)
            machine, reference = equipment(job.machine)
            recording = read_recording(
                file,
                sampling_rate_hz=job.machine.sampling_rate_hz,
                channels=job.machine.sensors or None,
                sensors=machine.sensors,
            )
            analysis = analyse(replace(recording, origin=job.path), machine, reference)
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


def _free_memory() -> float:
    """Return how much memory may be taken [bytes]; without end where that is not told."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
    except OSError:
        return math.inf
    return next((1024.0 * int(own.split()[1]) for own in lines if "Available" in own), math.inf)


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


def _hash(file: str) -> str:
    with open(file, "rb") as content:
        return hashlib.file_digest(content, lambda: hashlib.blake2b(digest_size=16)).hexdigest()


def equipment(own: FleetMachine) -> tuple[Machine, Reference | None]:
    """Read machine file and reference, again only if they were written to."""
    files = (own.file, *([own.reference] if own.reference else []))
    machine, reference = _read(files, tuple(map(_state, files)))
    return replace(machine, name=own.name), reference


@lru_cache(maxsize=8)
def _read(files: tuple[str, ...], states: tuple[Any, ...]) -> tuple[Machine, Reference | None]:
    from gearmon.machine import load_machine
    from gearmon.signatures.measured.reference import read_reference

    assert len(states) == len(files)
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
        died = yield from _until_broken(queue, task, width)
        barren = 0 if died else barren + 1
        if barren > _BARREN:
            told = f"{barren} processes were killed before they could begin; free memory"
            raise ArgumentError(f"{told}, and run again to go on")
        for job in died:
            deaths[job.path] += 1
            if deaths[job.path] > _FORGIVEN:
                yield Outcome(job=job, why=_KILLED)
            else:
                suspects.append(job)


def _until_broken(queue: deque[Job], task: Task, width: int) -> Generator[Outcome, None, list[Job]]:
    """Work through a queue; return what was at work when a process died."""
    running: dict[Future[Outcome], Job] = {}
    # not forked: threads that deliver alarms may run
    pool = ProcessPoolExecutor(width, get_context("spawn"), _alone_on_a_core, (os.getpid(),))
    try:
        if width == 1:
            # a process that is killed as it begins says nothing of the recording
            pool.submit(os.getpid).result()
        while queue or running:
            # one more than there are processes: none waits, and memory stays flat
            while queue and len(running) < width + (width > 1):
                future = pool.submit(task, queue[0])
                running[future] = queue.popleft()
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                yield future.result()
                del running[future]
    except BrokenProcessPool:
        return list(running.values())
    finally:
        pool.shutdown(cancel_futures=True)
    return []


def _alone_on_a_core(parent: int) -> None:
    """Keep a process to one core, and let it go when the one that began it is killed."""
    os.environ[THREADS] = "1"
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
        if os.getppid() != parent:
            os._exit(1)


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
            batches = deque(jobs[n : n + size] for n in range(0, len(jobs), size))
            running: dict[Any, Sequence[Job]] = {}
            suspects, alone = deque[Sequence[Job]](), None
            while batches or running or suspects:
                if not batches and not running:
                    # with nothing else at work, nobody dies for another's fault
                    alone = suspects.popleft()
                    batches.append(alone)
                while batches:
                    batch = batches.popleft()
                    running[client.submit(_batch, batch, task, pure=False)] = batch
                done = wait_for([*running], patience_s, "FIRST_COMPLETED").done
                for future in done:
                    batch, error = running.pop(future), future.exception()
                    if error is None:
                        yield from future.result()
                    elif not isinstance(error, KilledWorker):
                        raise error
                    elif batch is alone:
                        yield Outcome(job=batch[0], why=_KILLED)
                    elif len(batch) == 1:
                        suspects.append(batch)
                    else:  # the scheduler has tried it on several workers: which one is it?
                        batches.extend([one] for one in batch)
    except TimeoutError:
        told = f"--scheduler {scheduler}: does not answer, or did nothing for {patience_s:g} s"
        raise ArgumentError(f"{told}; run again to go on") from None
    except (OSError, CancelledError) as error:
        told = f"--scheduler {scheduler}: was lost ({' '.join(str(error).split())[:80]})"
        raise ArgumentError(f"{told}; run again to go on") from None


def _batch(jobs: Sequence[Job], task: Task) -> list[Outcome]:
    os.environ[THREADS] = "1"
    return [task(job) for job in jobs]
