"""What stands in a recording file, whatever its format: numbers in columns, and what is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from gearmon.signals.reading.columns import Column
from gearmon.signals.reading.rounding import Floats


def _sample(row: int) -> str:
    return f"sample {row + 1}"


def _no_text(row: int, index: int) -> str:  # noqa: ARG001
    return "a value"


@dataclass(frozen=True, kw_only=True)
class Content:
    """Columns of numbers of a file.

    Parameters
    ----------
    path : str
        The file, for messages.
    values : ndarray of float64, shape (columns, rows)
        The numbers; NaN where one is missing.
    columns : tuple of Column
        What the file says about them.
    rate_hz : float > 0 or None
        The sampling rate, if the file states one.
    stamp : int or None
        Index of a column of dates and times or times of day.
    rate_hint : str
        What else in the file may tell the sampling rate.
    notes : tuple of str
        What the reader has to tell the user.
    is_text : bool
        Whether rows are lines of a text.
    place : callable
        Gives the name of a row (counted from 0) in messages.
    shown : callable
        Gives the text of one number, by row and column index, for messages.
    whole : bool
        Whether all rows are here, or only the first ones of a longer recording.
    """

    path: str
    values: Floats
    columns: tuple[Column, ...]
    rate_hz: float | None = None
    stamp: int | None = None
    rate_hint: str = ""
    notes: tuple[str, ...] = ()
    is_text: bool = False
    place: Callable[[int], str] = field(default=_sample)
    shown: Callable[[int, int], str] = field(default=_no_text)
    whole: bool = True

    @property
    def rows_are(self) -> str:
        """What messages call many rows."""
        return "lines" if self.is_text else "samples"

    @property
    def columns_by_number(self) -> dict[int, int]:
        """The index of each column by its number in the file."""
        return {column.number: index for index, column in enumerate(self.columns)}
