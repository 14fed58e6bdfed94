"""Tables as aligned text, as CSV and, in a report, as HTML."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from gearmon.files import table_cell


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table of texts.

    Parameters
    ----------
    headings : tuple of str
        Headings of the columns.
    rows : tuple of tuple of str
        The rows.
    align : str
        One letter a column: "l" for text, "r" for numbers.
    marked : tuple of bool
        Rows to highlight; empty for none.
    """

    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    align: str
    marked: tuple[bool, ...] = ()

    @staticmethod
    def of(
        rows: Sequence[dict[str, Any]], align: str | None = None, marked: Sequence[bool] = ()
    ) -> Table:
        """Make a table of rows with the same keys: six figures of a number, nothing for None.

        Parameters
        ----------
        rows : sequence of dict
            Without rows there are no headings either.
        align : str, optional
            As in the table; by default columns of numbers stand to the right.
        marked : sequence of bool
            As in the table.
        """
        names = tuple(rows[0]) if rows else ()
        number = [all(_is_number(row[name]) for row in rows) for name in names]
        return Table(
            headings=names,
            rows=tuple(tuple(_cell(row[name]) for name in names) for row in rows),
            align=align or "".join("r" if right else "l" for right in number),
            marked=tuple(marked),
        )


def table_lines(table: Table | Sequence[dict[str, Any]]) -> list[str]:
    """Return a table in columns of equal width, two spaces apart: numbers stand to the right.

    Parameters
    ----------
    table : Table or sequence of dict
        A table, or rows with the same keys.

    Returns
    -------
    list of str
        Without line ends.

    Examples
    --------
    >>> table_lines([{"name": "mesh", "Hz": 4.25}])
    ['name    Hz', 'mesh  4.25']
    """
    table = table if isinstance(table, Table) else Table.of(table)
    if not table.headings:
        return ["(nothing)"]
    everything = (table.headings, *table.rows)
    widths = [max(map(len, column)) for column in zip(*everything, strict=True)]
    return [
        "  ".join(
            cell.rjust(width) if side == "r" else cell.ljust(width)
            for cell, width, side in zip(row, widths, table.align, strict=True)
        ).rstrip()
        for row in everything
    ]


def rows_as_csv(rows: Sequence[dict[str, Any]]) -> str:
    """Return rows as CSV text with a header.

    Parameters
    ----------
    rows : sequence of dict
        Rows with the same keys.

    Returns
    -------
    str
        None is an empty field; see `gearmon.files.table_cell`.
    """
    text = io.StringIO()
    if rows:
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(map(table_cell, rows[0]))
        writer.writerows([table_cell(row.get(name)) for name in rows[0]] for row in rows)
    return text.getvalue()


def _is_number(value: Any) -> bool:
    return value is None or isinstance(value, int | float)


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.6g}" if isinstance(value, float) else str(value)
