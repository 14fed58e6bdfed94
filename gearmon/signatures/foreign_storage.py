"""Foreign lines as plain arrays, to be stored in a reference, and back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearmon.signatures.foreign_lines import ForeignLine, ForeignLines, NoiseGrid

KINDS = ("spectrum", "envelope")
LOCKS = ("shaft", "time", "either")
_PLACES = ("order", "frequency_hz", "low_order", "high_order")
_GRID = ("width", "top", "pieces", "least_db", "looked_at")


def foreign_arrays(foreign: ForeignLines) -> dict[str, NDArray[Any]]:
    """Return arrays that hold all of the lines.

    Parameters
    ----------
    foreign : ForeignLines

    Returns
    -------
    dict of str to ndarray
        "speed_hz", with the width of the cells of "in_time_db"; "kind" and "locked" (positions in
        `KINDS` and `LOCKS`), "place" and "level" with one row a line; "grid", "noise/KIND" and
        "hidden/KIND" of each grid.
    """
    lines = foreign.lines
    arrays: dict[str, NDArray[Any]] = {
        "speed_hz": np.array([foreign.speed_hz, foreign.cell_hz]),
        "in_time_db": foreign.in_time_db,
        "kind": np.array([KINDS.index(line.kind) for line in lines], dtype=np.int8),
        "locked": np.array([LOCKS.index(line.locked) for line in lines], dtype=np.int8),
        "place": np.array([[getattr(line, name) for name in _PLACES] for line in lines]),
        "level": np.array([[line.level_db, line.over_noise_db] for line in lines]),
        "grid": np.array([[getattr(grid, name) for name in _GRID] for grid in foreign.grids]),
    }
    for grid in foreign.grids:
        arrays[f"noise/{grid.kind}"] = grid.noise_db
        arrays[f"hidden/{grid.kind}"] = grid.hidden_db
    return arrays


def foreign_from_arrays(arrays: Mapping[str, NDArray[Any]]) -> ForeignLines:
    """Return the lines that `foreign_arrays` took apart.

    Parameters
    ----------
    arrays : mapping of str to ndarray

    Returns
    -------
    ForeignLines

    Raises
    ------
    KeyError, ValueError, IndexError
        If something is missing or does not fit.
    """
    rows = zip(arrays["kind"], arrays["locked"], arrays["place"], arrays["level"], strict=True)
    lines = tuple(
        ForeignLine(
            kind=KINDS[kind],
            locked=LOCKS[locked],
            level_db=tuple(level[0].tolist()),
            over_noise_db=tuple(level[1].tolist()),
            **dict(zip(_PLACES, place.tolist(), strict=True)),
        )
        for kind, locked, place, level in rows
    )
    grids = []
    for kind, values in zip(KINDS, arrays["grid"].tolist(), strict=True):
        known = dict(zip(_GRID, values, strict=True))
        known["pieces"] = int(known["pieces"])
        noise, hidden = arrays[f"noise/{kind}"], arrays[f"hidden/{kind}"]
        grids.append(NoiseGrid(kind=kind, noise_db=noise, hidden_db=hidden, **known))
    speed_hz, cell_hz = arrays["speed_hz"].tolist()
    return ForeignLines(
        lines=lines,
        grids=tuple(grids),
        speed_hz=speed_hz,
        cell_hz=cell_hz,
        in_time_db=arrays["in_time_db"],
    )
