"""What every result can do: say itself in a line, become a frame or built-in types, and be drawn.

Results know the name of their picture only; drawing stays in `gearmon.report`, and neither it nor
pandas is loaded before it is asked for.
"""

from __future__ import annotations

import dataclasses
import html
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from gearmon.errors import ArgumentError, check_word
from gearmon.files import write_table

if TYPE_CHECKING:
    import pandas as pd

#: Longest text of a result, and of one of its fields.
_LONGEST, _LONGEST_FIELD = 480, 72
_ROWS_SHOWN = 10


class Result:
    """A frozen dataclass that people meet."""

    #: Module and function of `gearmon.report` that draw it; "" if nothing does.
    picture: ClassVar[str] = ""

    def __init_subclass__(cls, **more: Any) -> None:
        """Keep the short text: a dataclass writes its own only where the class has none."""
        super().__init_subclass__(**more)
        cls.__repr__ = Result.__repr__  # type: ignore[method-assign]

    def __repr__(self) -> str:
        """Return a text of one line: every field, arrays and lists by their size."""
        fields = dataclasses.fields(self)  # type: ignore[arg-type]
        said = [f"{field.name}={_brief(getattr(self, field.name))}" for field in fields]
        text = f"{type(self).__name__}({', '.join(said)})"
        return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 5]} ...)"

    def _repr_html_(self) -> str:
        """Return the first rows of the frame, for a notebook."""
        frame = self.to_frame()
        more = f"<p>{len(frame)} rows</p>" if len(frame) > _ROWS_SHOWN else ""
        head = f"<p><b>{type(self).__name__}</b> {html.escape(self.headline())}</p>"
        return f"{head}{frame.head(_ROWS_SHOWN).to_html(index=False)}{more}"

    def headline(self) -> str:
        """Return what the result says, in a sentence; "" if it is but numbers."""
        return ""

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON; complex numbers as their two parts."""
        return {
            field.name: _plain(getattr(self, field.name))
            for field in dataclasses.fields(self)  # type: ignore[arg-type]
        }

    def frame_rows(self) -> list[dict[str, Any]]:
        """Return the rows of the frame: `rows()`, or one of everything that is a single value."""
        rows = getattr(self, "rows", None)
        if rows is not None:
            return list(rows()) if callable(rows) else [_plain(row) for row in rows]
        plain = self.to_dict().items()
        return [{name: own for name, own in plain if not isinstance(own, list | dict)}]

    def to_frame(self) -> pd.DataFrame:
        """Return a tidy DataFrame: a row an observation, units in the names of columns.

        Returns
        -------
        pandas.DataFrame
            The rows of the file that the command of the same name writes.
        """
        import pandas as pd  # takes longer to load than most results to compute

        return pd.DataFrame(self.frame_rows())

    def plot(self, ax: Any = None, *, kind: str = "", **options: Any) -> Any:
        """Draw the picture, or the pictures, that the command of the same name draws.

        Parameters
        ----------
        ax : matplotlib Axes, or a sequence of them, optional
            Where to draw, one for each of the first channels; by default a new figure.
        kind : str
            Which picture, of a result that has several; by default all.
        **options
            Of the function in `gearmon.report` that draws it.

        Returns
        -------
        Axes, ndarray of Axes, or dict of str to these
            Where it was drawn: one axes, or all of the picture from the top; of several pictures by
            their kind.

        Raises
        ------
        ArgumentError
            If the result has no picture, or its picture cannot be drawn on given axes.
        """
        draw = self._drawing()
        known = signature(draw).parameters
        for name in options:
            check_word("plot option ", name, {"ax": 0, "kind": 0} | dict(list(known.items())[1:]))
        if ax is None:
            drawn = draw(self, **options)
            if not isinstance(drawn, dict):
                return _shown(drawn)
            named = {name.strip("-"): figure for name, figure in drawn.items()}
            if kind:
                check_word("kind=", kind, named)
                return _shown(named[kind])
            return {name: _shown(figure) for name, figure in named.items()}
        if "ax" not in known:
            raise ArgumentError(
                f"plot: the picture of {type(self).__name__} arranges its axes itself; leave ax out"
            )
        axes = np.ravel(np.asarray(ax, dtype=object)).tolist()
        if not all(hasattr(own, "axvline") for own in axes):
            kinds = ", ".join(dict.fromkeys(type(own).__name__ for own in axes))
            raise ArgumentError(f"plot: ax={kinds} is not taken; give matplotlib Axes, one or more")
        draw(self, ax=axes, **options)
        return ax

    def save(self, path: str | Path) -> list[Path]:
        """Write it as the command of the same name does.

        Parameters
        ----------
        path : str or Path
            Ending in .csv for the rows of the frame, .json for all of it, or .png, .svg or .pdf for
            its pictures.

        Returns
        -------
        list of Path
            What was written.

        Raises
        ------
        ArgumentError
            If the ending is none of these, or there is no picture.
        """
        target = Path(path)
        if target.suffix in (".png", ".svg", ".pdf"):
            plots = import_module(f"{__package__}.report.plots")
            written: list[Path] = plots.save_all(self.figures(), target)
            return written
        check_word("ending of path=", target.suffix, (".csv", ".json", ".png", ".svg", ".pdf"))
        write_table(target, self.to_dict(), self.frame_rows())
        return [target]

    def figures(self) -> dict[str, Any]:
        """Return the pictures that the command of the same name writes, as matplotlib figures.

        Returns
        -------
        dict of str to Figure
            By what is added to the name of the file: "-energy", or "" of a single picture.

        Raises
        ------
        ArgumentError
            If the result has no picture.
        """
        drawn = self._drawing()(self)
        return drawn if isinstance(drawn, dict) else {"": drawn}

    def _drawing(self) -> Any:
        """Return the function that draws this result."""
        if not self.picture:
            raise ArgumentError(f"plot: {type(self).__name__} has no picture; take to_frame()")
        home, name = self.picture.split(".")
        return getattr(import_module(f"gearmon.report.{home}"), name)


def with_units(names: Sequence[str], units: Sequence[str | None]) -> list[str]:
    """Return the heads of columns: names with their units, as the reader of recordings takes them.

    Examples
    --------
    >>> with_units(["a1", "ratio", "x"], ["m/s2", "1", None])
    ['a1 [m/s2]', 'ratio', 'x']
    """
    pairs = zip(names, units, strict=True)
    return [f"{name} [{unit}]" if unit and unit != "1" else name for name, unit in pairs]


def channel_rows(axis: str, places: Any, values: Any, heads: Sequence[str]) -> list[dict[str, Any]]:
    """Return a row a place on an axis: the place, and every channel under its head."""
    rows = np.vstack([places, values]).T.tolist()
    return [dict(zip([axis, *heads], row, strict=True)) for row in rows]


def sample_rows(
    samples: Any, sampling_rate_hz: float, heads: Sequence[str]
) -> list[dict[str, Any]]:
    """Return a row a sample: the time, and every channel under its head."""
    return channel_rows("time_s", np.arange(samples.shape[1]) / sampling_rate_hz, samples, heads)


def _shown(figure: Any) -> Any:
    """Hand a figure to pyplot, if it is in use, and return its axes."""
    pyplot = sys.modules.get("matplotlib.pyplot")
    if pyplot is not None:
        with suppress(ValueError):  # before 3.11 pyplot takes none but its own
            pyplot.figure(figure)
    axes = np.array(figure.axes, dtype=object)
    return axes[0] if axes.size == 1 else axes


def _brief(value: Any) -> str:
    """Return what a field holds, in few letters."""
    if isinstance(value, np.ndarray):
        return f"{value.dtype.name}{list(value.shape)}"
    if isinstance(value, tuple | list | Mapping) and len(repr(value)) > _LONGEST_FIELD:
        return f"<{len(value)}>"
    text = f"{value:.6g}" if isinstance(value, float) else repr(value)
    if dataclasses.is_dataclass(value) or text.startswith("<"):
        return f"<{type(value).__name__}>"
    return text if len(text) <= _LONGEST_FIELD else f"{text[: _LONGEST_FIELD - 4]}...{text[-1]}"


def _plain(value: Any) -> Any:
    """Return a value in built-in types."""
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if isinstance(value, np.ndarray | np.generic | complex):
        array = np.asarray(value)
        both = {"real": array.real, "imag": array.imag} if np.iscomplexobj(array) else {}
        return {part: own.tolist() for part, own in both.items()} or array.tolist()
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {str(name): _plain(own) for name, own in value.items()}
    if isinstance(value, tuple | list | set | frozenset):
        return [_plain(own) for own in value]
    return value if isinstance(value, str | int | float | bool | None) else str(value)
