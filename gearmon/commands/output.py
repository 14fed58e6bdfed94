"""Exit codes, and results on the screen and in files."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from gearmon.errors import ArgumentError

DONE, FLAGGED, BAD_INPUT, UNJUDGED = 0, 1, 2, 3


def show(arguments: argparse.Namespace, result: Any, lines: Callable[[], Iterable[str]]) -> None:
    """Print a result: one JSON object with --json, else lines of text."""
    if arguments.json:
        json.dump(result, sys.stdout, indent=1, ensure_ascii=False, allow_nan=False)
        print()
        return
    for line in lines():
        print(line)


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
        For JSON; gets "pictures" if any are drawn.
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
    text = json.dumps(result, indent=1, ensure_ascii=False, allow_nan=False)
    write_atomically(path, text + "\n")
