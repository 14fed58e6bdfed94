"""Exit codes, and results on the screen and in files."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable
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


def write_table(path: str, result: Any, as_csv: Callable[[], str]) -> None:
    """Write a result as CSV or JSON, by the ending of the name."""
    if Path(path).suffix.lower() == ".csv":
        from gearmon.files import write_atomically

        write_atomically(path, as_csv())
        return
    write_json(path, result)


def write_json(path: str, result: Any) -> None:
    """Write a result as JSON."""
    from gearmon.files import write_atomically

    if Path(path).suffix.lower() != ".json":
        raise ArgumentError(f"{path}: the name must end in .json (or .csv, where there is a table)")
    text = json.dumps(result, indent=1, ensure_ascii=False, allow_nan=False)
    write_atomically(path, text + "\n")
