"""Tables as aligned text and as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from typing import Any


def rows_as_csv(rows: Sequence[dict[str, Any]]) -> str:
    """Return rows as CSV text with a header.

    Parameters
    ----------
    rows : sequence of dict
        Rows with the same keys.

    Returns
    -------
    str
        None is an empty field.
    """
    text = io.StringIO()
    if rows:
        writer = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return text.getvalue()


def table_lines(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Return rows as aligned text: words to the left, numbers to the right.

    Parameters
    ----------
    rows : sequence of dict
        Rows with the same keys.

    Returns
    -------
    list of str
    """
    if not rows:
        return ["(nothing)"]
    names = list(rows[0])
    cells = [[_cell(row[name]) for name in names] for row in rows]
    widths = [max(len(name), *(len(row[i]) for row in cells)) for i, name in enumerate(names)]
    right = [all(_is_number(row[name]) for row in rows) for name in names]
    return [_line(names, widths, right), *(_line(row, widths, right) for row in cells)]


def _line(cells: Iterable[str], widths: Sequence[int], right: Sequence[bool]) -> str:
    padded = (
        cell.rjust(width) if to_right else cell.ljust(width)
        for cell, width, to_right in zip(cells, widths, right, strict=True)
    )
    return "  ".join(padded).rstrip()


def _is_number(value: Any) -> bool:
    return value is None or isinstance(value, int | float)


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.6g}" if isinstance(value, float) else str(value)
