"""Progress and colours on a terminal; quiet and plain everywhere else."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from time import monotonic

Progress = Callable[[float], None]

# Who waits less wonders about nothing [s].
_PATIENCE_S = 2.0
# Letters of a verdict by the colours that all terminals have: red, yellow, green.
_COLOURS = {"FAULT": 31, "CANNOT TELL": 33, "NO MESH FOUND": 33, "HEALTHY": 32}


def coloured(text: str) -> str:
    """Give the verdicts in a text their colours, where standard output is a terminal that has them.

    `NO_COLOR` in the environment, set to anything, keeps them away.

    Parameters
    ----------
    text : str
        Lines for people.
    """
    plain = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb"
    if plain or not sys.stdout.isatty():
        return text
    named = "|".join(_COLOURS)
    return re.sub(rf"\b({named})\b", lambda own: f"\033[1;{_COLOURS[own[1]]}m{own[1]}\033[0m", text)


@contextmanager
def working(what: str) -> Iterator[None]:
    """Tell on standard error, if that is a terminal, what takes longer than two seconds.

    Parameters
    ----------
    what : str
        What is being done.
    """
    if not sys.stderr.isatty():
        yield
        return
    done, began = Event(), monotonic()

    def tell() -> None:
        wait = _PATIENCE_S
        while not done.wait(wait):
            print(f"\r{what}: {monotonic() - began:.0f} s ", end="", file=sys.stderr, flush=True)
            wait = 1.0
        if wait < _PATIENCE_S:
            print("\r\033[K", end="", file=sys.stderr, flush=True)

    clock = Thread(target=tell, daemon=True)
    clock.start()
    try:
        yield
    finally:
        done.set()
        clock.join()


@contextmanager
def progress_bar(what: str) -> Iterator[Progress | None]:
    """Show a progress bar on standard error if that is a terminal.

    Parameters
    ----------
    what : str
        What is being done.

    Yields
    ------
    callable or None
        To be called with the share done, 0 to 1; None where nobody watches.
    """
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=1.0)
        yield lambda share: bar.update(task, completed=share)
