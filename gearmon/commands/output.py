"""Exit codes, and results on the screen and in files."""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gearmon.errors import ArgumentError
from gearmon.terminal import coloured, line_cleared

if TYPE_CHECKING:
    from gearmon.result import Result

#: Version of what JSON output holds: keys may be added within it, none is renamed or goes.
SCHEMA = "gearmon/1"
Rows = Callable[[], list[dict[str, Any]]]
DONE, FLAGGED, BAD_INPUT, UNJUDGED, OWN_FAULT, STOPPED = 0, 1, 2, 3, 70, 130


def judged(entries: Sequence[Mapping[str, Any]], *, flagged: bool) -> int:
    """Return the exit code of recordings that were judged.

    Parameters
    ----------
    entries : sequence of mapping
        With a "verdict", or an "error" of a recording that could not be used.
    flagged : bool
        Whether anything was flagged.
    """
    if any("error" in entry for entry in entries):
        return BAD_INPUT
    if flagged:
        return FLAGGED
    open_ = any(entry["verdict"] in ("cannot tell", "no mesh found") for entry in entries)
    return UNJUDGED if open_ else DONE


def complain(message: str) -> None:
    """Write one line to standard error, if anything can be written there."""
    # names of files need not be text, nor one line; those bytes that are no text are spelled out
    line = "".join(c if c.isprintable() or "\ud800" <= c <= "\udfff" else " " for c in message)
    with suppress(OSError):
        print(f"{line_cleared()}gearmon: {line}", file=sys.stderr)


def show(
    arguments: argparse.Namespace, result: Mapping[str, Any], lines: Callable[[], Iterable[str]]
) -> None:
    """Print a result: one JSON object with --json, else lines of text."""
    text = as_json(result) if arguments.json else coloured(_plain("\n".join(lines())))
    if arguments.progress is not None:
        arguments.progress.close()
    try:
        print(text)
    except OSError as error:
        _no_more(error)
    flushed()


def _plain(text: str) -> str:
    """Leave out what names of files and channels may do to a terminal."""
    return re.sub(r"[\x00-\x09\x0b-\x1f\x7f-\x9f]", " ", text)


def flushed() -> None:
    """Make sure that what was printed has arrived.

    Raises
    ------
    ArgumentError
        If it cannot be written, for lack of room say.
    """
    try:
        sys.stdout.flush()
    except OSError as error:
        _no_more(error)


def _no_more(error: OSError) -> None:
    """Let what is still to be printed go nowhere: Python would complain of it at exit."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    # whoever reads a pipe may have seen enough; the exit code is still that of the result
    if not isinstance(error, BrokenPipeError):
        raise ArgumentError(f"standard output: {error.strerror}") from None


def finish(
    arguments: argparse.Namespace,
    found: Result | dict[str, Any],
    lines: Callable[[], list[str]],
    rows: Rows | Mapping[str, Rows] | None = None,
    figures: Callable[[], Mapping[str, Any]] | None = None,
    *,
    rows_in_json: bool = False,
) -> int:
    """Write a result under the name given, pictures beside it, and show it.

    Parameters
    ----------
    arguments : Namespace
    found : Result or dict
        For JSON; gets "tables" and "pictures" with the names of what is written. A result knows its
        rows and pictures.
    lines : callable
        What the terminal shows.
    rows : callable, or mapping of str to callable, optional
        What a CSV holds; of several tables by what is added to the name.
    figures : callable, optional
        Figures by what is added to the name.
    rows_in_json : bool
        Whether a JSON file holds the rows beside the result; one of a further table holds but rows.
    """
    if isinstance(found, dict):
        result = found
    else:
        result, rows = found.to_dict(), rows or found.frame_rows
        figures = found.figures if found.picture else None
    if arguments.output:
        target = Path(arguments.output)
        if rows is not None:
            tables, written = rows if isinstance(rows, Mapping) else {"": rows}, []
            # the name of a picture is that of no table
            for added, own in tables.items() if target.suffix.lower() != ".png" else ():
                path = str(target.with_name(f"{target.stem}{added}{target.suffix}"))
                listed = own()
                more = {"rows": listed} if added or rows_in_json else {}
                write_table(path, ({} if added else result) | more, listed)
                written.append(path)
            result["tables"] = written
        if figures is not None:
            from gearmon.report.plots import save_all

            pictures = save_all(figures(), target.with_suffix(".png"))
            result["pictures"] = [str(path) for path in pictures]
    files = [path for key in ("tables", "pictures") for path in result.get(key, ())]
    show(arguments, result, lambda: [*lines(), *(f"wrote {path}" for path in files)])
    return DONE


def write_table(path: str, result: Mapping[str, Any], rows: list[dict[str, Any]]) -> None:
    """Write rows as CSV or the whole result as JSON, by the ending of the name."""
    from gearmon.files import write_atomically
    from gearmon.report.wording import rows_as_csv

    is_csv = Path(path).suffix.lower() == ".csv"
    write_atomically(path, rows_as_csv(rows) if is_csv else as_json(result) + "\n")


def as_json(result: Mapping[str, Any]) -> str:
    """Return a result as JSON, marked with the version of its schema (see `schemas.json`)."""
    marked = {"schema": SCHEMA, **result}
    return json.dumps(marked, indent=1, ensure_ascii=False, allow_nan=False)
