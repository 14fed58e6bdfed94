"""Names of files that cannot work are refused before any work is done."""

from __future__ import annotations

import argparse
from pathlib import Path

from gearmon.errors import ArgumentError

_OUTPUTS = ("output", "report")
_NEVER_EMPTY = (*_OUTPUTS, "reference", "tacho", "machine", "harvester", "history", "trained")


def check_names(arguments: argparse.Namespace) -> None:
    """Refuse names of files that cannot work, before any work is done.

    Parameters
    ----------
    arguments : argparse.Namespace
        Parsed arguments; `output_endings` holds the endings that the output may have, if not any.

    Raises
    ------
    ArgumentError
        If a name is empty, has the wrong ending, or would be written over what is read.
    """
    given = vars(arguments)
    for name in _NEVER_EMPTY:
        if given.get(name) == "":
            raise ArgumentError(f"--{name}: the name is empty")
    inputs = [*given.get("recording", ()), *given.get("degraded", ())]
    inputs += [given.get(name) for name in ("machine", "reference", "harvester")]
    read = {Path(path).resolve() for path in inputs if path}
    for name in _OUTPUTS:
        path = given.get(name)
        if path and Path(path).resolve() in read:
            raise ArgumentError(f"{path}: is read as well; give another name to write to")
    if given.get("report") and Path(given["report"]).suffix.lower() not in (".html", ".htm"):
        raise ArgumentError(f"{given['report']}: the name of a report must end in .html")
    endings = arguments.output_endings
    if given.get("output") and endings and Path(given["output"]).suffix.lower() not in endings:
        listed = ", ".join(endings)
        raise ArgumentError(f"{given['output']}: the name must end in one of {listed}")
