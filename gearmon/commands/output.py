"""Exit codes, and results on the screen and in files."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from gearmon.errors import ArgumentError

#: Version of what JSON output holds: keys may be added within it, none is renamed or goes.
SCHEMA = "gearmon/1"
DONE, FLAGGED, BAD_INPUT, UNJUDGED, OWN_FAULT, STOPPED = 0, 1, 2, 3, 70, 130


def judged(verdicts: Iterable[str], *, flagged: bool, bad: bool) -> int:
    """Return the exit code of recordings that were judged.

    Parameters
    ----------
    verdicts : iterable of str
    flagged : bool
        Whether anything was flagged.
    bad : bool
        Whether a recording could not be used.
    """
    if bad:
        return BAD_INPUT
    if flagged:
        return FLAGGED
    open_ = any(verdict in ("cannot tell", "no mesh found") for verdict in verdicts)
    return UNJUDGED if open_ else DONE


def complain(message: str) -> None:
    """Write one line to standard error, if anything can be written there."""
    # names of files need not be text, nor one line; those bytes that are no text are spelled out
    line = "".join(c if c.isprintable() or "\ud800" <= c <= "\udfff" else " " for c in message)
    with suppress(OSError):
        print(f"gearmon: {line}", file=sys.stderr)


def complain_of(results: Sequence[Mapping[str, Any]]) -> None:
    """Say of several recordings that some could not be used, after the lines of each."""
    bad = sum("error" in entry for entry in results)
    if bad > 2:
        complain(f"{bad} of {len(results)} recordings could not be used; the lines above say why")


def show(
    arguments: argparse.Namespace, result: Mapping[str, Any], lines: Callable[[], Iterable[str]]
) -> None:
    """Print a result: one JSON object with --json, else lines of text."""
    text = as_json(result) if arguments.json else "\n".join(lines())
    try:
        print(text)
    except OSError as error:
        _no_more(error)
    flushed()


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
    result: dict[str, Any],
    lines: Callable[[], list[str]],
    rows: Callable[[], list[dict[str, Any]]] | None = None,
    figures: Callable[[], Mapping[str, Any]] | None = None,
    *,
    rows_in_json: bool = False,
) -> int:
    """Write a result under the name given, pictures beside it, and show it.

    Parameters
    ----------
    arguments : Namespace
    result : dict
        For JSON; gets "tables" and "pictures" with the names of what is written.
    lines : callable
        What the terminal shows.
    rows : callable, optional
        What a CSV holds.
    figures : callable, optional
        Figures by what is added to the name.
    rows_in_json : bool
        Whether a JSON file holds the rows beside the result.
    """
    if arguments.output:
        target = Path(arguments.output)
        if rows is not None and target.suffix.lower() != ".png":
            listed = rows()
            whole = result | {"rows": listed} if rows_in_json else result
            write_table(arguments.output, whole, listed)
            result["tables"] = [arguments.output]
        if figures is not None:
            from gearmon.report.plots import save_all

            pictures = save_all(figures(), target.with_suffix(".png"))
            result["pictures"] = [str(path) for path in pictures]
    show(arguments, result, lambda: [*lines(), *wrote(result)])
    return DONE


def wrote(result: dict[str, Any]) -> list[str]:
    """Tell which files a result names."""
    return [f"wrote {path}" for key in ("tables", "pictures") for path in result.get(key, ())]


def write_table(path: str, result: Any, rows: list[dict[str, Any]]) -> None:
    """Write rows as CSV or the whole result as JSON, by the ending of the name."""
    if Path(path).suffix.lower() == ".csv":
        from gearmon.files import write_atomically
        from gearmon.report.text_tables import rows_as_csv

        write_atomically(path, rows_as_csv(rows))
        return
    write_json(path, result)


def write_json(path: str, result: Any) -> None:
    """Write a result as JSON."""
    from gearmon.files import write_atomically

    if Path(path).suffix.lower() != ".json":
        raise ArgumentError(f"{path}: the name must end in .json (or .csv, where there is a table)")
    write_atomically(path, as_json(result) + "\n")


def as_json(result: Mapping[str, Any]) -> str:
    """Return a result as JSON, marked with the version of its schema (see `schemas.json`)."""
    marked = {"schema": SCHEMA, **result}
    return json.dumps(marked, indent=1, ensure_ascii=False, allow_nan=False)
