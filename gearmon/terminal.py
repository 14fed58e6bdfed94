"""Progress and colours on a terminal; quiet and plain everywhere else."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, closing, nullcontext
from threading import Event, Thread
from time import monotonic
from typing import TypeVar

Progress = Callable[[float], None]
Found = TypeVar("Found")

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


class ProgressLine:
    """A line on standard error that tells how far a work is, once that takes two seconds.

    Parameters
    ----------
    what : str
        What is being done.
    """

    def __init__(self, what: str) -> None:
        self._what, self._began, self._share = what, monotonic(), 0.0
        self._done, self._clock = Event(), Thread(target=self._tell, daemon=True)
        self._clock.start()

    def __call__(self, share: float) -> None:
        """Take the share done, 0 to 1; who knows none leaves it, and the time spent is told."""
        self._share = share

    def close(self) -> None:
        """Take the line away."""
        self._done.set()
        self._clock.join()

    def _tell(self) -> None:
        wait = _PATIENCE_S
        while not self._done.wait(wait):
            spent, share = monotonic() - self._began, self._share
            bar = f"{'#' * round(20 * share):.<20} {100 * share:.0f} % after " if share else ""
            print(f"\r{self._what}: {bar}{spent:.0f} s \033[K", end="", file=sys.stderr, flush=True)
            wait = 0.5
        if wait < _PATIENCE_S:
            print(end=line_cleared(), file=sys.stderr, flush=True)


def progress_line(what: str) -> AbstractContextManager[ProgressLine | None]:
    """Return a `ProgressLine` to be closed at the end; None where nobody watches.

    Parameters
    ----------
    what : str
        What is being done.
    """
    return closing(ProgressLine(what)) if sys.stderr.isatty() else nullcontext()


def line_cleared() -> str:
    """Return what takes away a line that is told on standard error, where that is a terminal."""
    return "\r\033[K" if sys.stderr.isatty() else ""


def followed(items: Iterable[Found], count: int, progress: Progress | None) -> Iterator[Found]:
    """Give so many items, and tell after each how far that is."""
    for number, item in enumerate(items, start=1):
        yield item
        if progress is not None:
            progress(number / count)


def part_of(progress: Progress | None, start: float, part: float) -> Progress | None:
    """Return what tells the progress of a part of the work.

    Parameters
    ----------
    progress : callable or None
        Of all the work.
    start, part : float, 0 to 1
        Share that is done before it, and its own.
    """
    return None if progress is None else lambda share: progress(start + part * share)
