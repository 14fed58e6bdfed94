"""Tasks side by side on the cores of this machine; their results do not depend on how many."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from gearmon.errors import ArgumentError

# Values handled from which on threads are worth starting, and how many at the most: more than four
# wait for the interpreter.
_WORTH_THREADS, MOST_THREADS = 1 << 19, 4
#: Variable of the environment that limits the cores that are used.
THREADS = "GEARMON_THREADS"

Item = TypeVar("Item")
Found = TypeVar("Found")
Other = TypeVar("Other")


def side_by_side(task: Callable[[Item], Found], items: Sequence[Item], work: int) -> list[Found]:
    """Do a task for every item, by threads where there is work for them.

    Parameters
    ----------
    task : callable
        Takes an item. Tasks must not depend on one another.
    items : sequence
    work : int
        Values that all of them handle.

    Returns
    -------
    list
        What the tasks returned, in the order of the items.
    """
    threads = min(cores(), MOST_THREADS, len(items))
    if threads < 2 or work < _WORTH_THREADS:
        return [task(item) for item in items]
    from concurrent.futures import ThreadPoolExecutor  # short recordings do without

    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(task, items))


def cores() -> int:
    """Return how many processor cores this process may use.

    Those that the system grants it, or as many as `GEARMON_THREADS` in the environment says.

    Raises
    ------
    ArgumentError
        If that is no whole number from 1.
    """
    told = os.environ.get(THREADS, "")
    if told:
        if not told.isascii() or not told.isdecimal() or int(told) < 1:
            raise ArgumentError(
                f"{THREADS}={told}: must be a whole number of cores from 1; unset it for all"
            )
        return int(told)
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def alone_on_a_core() -> None:
    """Keep a process to one core; Ctrl-C is for who began it, and it goes when that is killed."""
    from multiprocessing import parent_process

    os.environ[THREADS] = "1"
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
        began = parent_process()
        # killed before this was asked; it need not be the parent by number: a server may fork
        if began is None or not began.is_alive():
            os._exit(1)


def at_once(one: Callable[[], Found], other: Callable[[], Other], work: int) -> tuple[Found, Other]:
    """Do two tasks, by threads where there is work for them.

    Parameters
    ----------
    one, other : callable
        The tasks, without arguments.
    work : int
        Values that they handle.
    """
    tasks: tuple[Callable[[], Any], ...] = (one, other)
    first, second = side_by_side(lambda task: task(), tasks, work)
    return first, second
