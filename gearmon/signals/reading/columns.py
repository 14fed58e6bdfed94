"""What stands in a file, whatever its format: columns of numbers with names, units and kinds.

And which of them cannot be vibration: those that are dead, pulsed, clipped, or without values.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.errors import RecordingError, nearest_name
from gearmon.units import is_trusted_unit, is_unit, kind_of_unit, speed_factor

_SQUARE = re.compile(r"(.*?)\s*\[\s*([^\]]*?)\s*\]")
_ROUND = re.compile(r"(.*?)\s*[(<]\s*(.+?)\s*[)>]")
_BEHIND = re.compile(r"(.*\S)\s*(?:/|,|\s-|\sin\s)\s*(\S+)")
_SUFFIX = re.compile(r"(?i)(.+)_(m_s2|mm_s|m_s|ms2|mps2|mg|g|rpm|nm|degc|hz|mv|v|ms|us|ns|s)")

_TIME = re.compile(
    r"(?i)t|(x_value|abszisse|time|zeit|temps|tempo|tiempo|tijd|timestamps?|zeitstempel|elapsed|"
    r"seconds?|sekunden?|datetime|datum)(?![a-zäöü]).*"
)
_INDEX = re.compile(
    r"(?i)(unnamed: \d+|index|idx|samples?|punkte?|points?|rows?|zeilen?|nr|no|num|n|i|k|#|counter)"
    r"([ _.-]*(number|index|idx|count|id|no|nr|#))?\.?"
)
_KINDS = (
    ("tacho", r"tach|keyphas|trigger|\bpuls|rpm[ _]?puls|encoder|drehgeber|nullimpuls|once.?per"),
    ("torque", r"torque|drehmoment|\bmoment\b|\bcouple\b|\bmd\b"),
    ("speed", r"speed|\brpm\b|drehzahl|\bomega\b|revolutions|\bn\d?\b"),
    ("other", r"temp|thermo|current\b|\bstrom\b|pressure|\bdruck\b|humid|status|\bflag\b"),
    ("other", r"\bload\b|\blast\b|power\b|leistung|\bforce\b|kraft|\bflow\b"),
)
# Samples at exactly the extreme value, over those at the commonest value next to it. For a rounded
# sine this ratio is at most 1 + sqrt(2), for rounded noise it is below 1.
_PILED_UP = 5.0
_FEWEST_SAMPLES = 10
_HARMLESS_SHARE = 1e-3
# No sensor gives more, in whatever unit; bytes read in another order do.
_MOST_SAMPLE = 1e30
_NEIGHBOURHOOD, _ALIKE = 0.05, 1e-9  # of the range
_SAMPLES_TO_COMPARE = 2**17  # from the first at the extreme on
LONGEST_QUOTE = 60  # characters of a file that a message shows


@dataclass(frozen=True, kw_only=True)
class Column:
    """One column of a table.

    Parameters
    ----------
    number : int > 0
        Its number, counted from 1.
    name : str
        Its name, without the unit; "column 3" where the file gives none.
    cell : str
        The head of the column as it stands in the file.
    unit : str or None
        Its unit as it stands in the file.
    kind : str
        "vibration", "tacho", "torque", "speed", "other", "time" or "index".
    sensitivity : float
        Recorded number per unit.
    told : str
        How the user spoke of it: as a "sensor" of the machine, "named" as a channel, or "".
    array : str
        Name of the array of its file that it stands in, if those have names.
    """

    number: int
    name: str
    cell: str = ""
    unit: str | None = None
    kind: str = "vibration"
    sensitivity: float = 1.0
    told: str = ""
    array: str = ""

    @property
    def label(self) -> str:
        """How messages call the column."""
        name = f" ('{shortened(self.name)}')" if self.cell else ""
        return f"column {self.number}{name}"


@dataclass(frozen=True, kw_only=True)
class Table:
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
    rate_hint : str
        What else in the file may tell the sampling rate.
    notes : tuple of str
        What the reader has to tell the user.
    locate : callable
        Gives the name of a row in messages, and what stands there, by row and column index.
    """

    path: str
    values: FloatArray
    columns: tuple[Column, ...]
    rate_hz: float | None = None
    rate_hint: str = ""
    notes: tuple[str, ...] = ()
    locate: Callable[[int, int], tuple[str, str]] = lambda row, _: (f"sample {row + 1}", "a value")

    def go_straight(self, index: int) -> None:
        """Let a column go straight over what is no number, and on as it is at the ends."""
        from pandas import Series  # hardly any column has such gaps

        own = self.values[index]
        own[~(np.abs(own) < _MOST_SAMPLE)] = np.nan
        own[:] = Series(own).interpolate(limit_direction="both")


def describe_columns(
    cells: Sequence[str], units: Sequence[str] = (), *, first: int = 1, array: str | None = None
) -> tuple[Column, ...]:
    """Return the columns of a table, as far as their heads tell.

    Parameters
    ----------
    cells : sequence of str
        The head of each column; "" where there is none.
    units : sequence of str
        What stands in a row of units below them, if there is one.
    first : int
        Number of the first of them.
    array : str, optional
        Name of the array that they stand in, if it is no table.
    """
    parted = [_name_and_unit(cell) for cell in cells]
    # among acc_e, acc_f, acc_g the last letter is no unit, unless all columns have one
    sure = bool(units) or all(unit or _TIME.fullmatch(name) for name, unit in parted)
    columns = []
    rows = zip(cells, units or ("",) * len(cells), parted, strict=True)
    for number, (cell, below, (name, unit)) in enumerate(rows, first):
        if not (sure or "[" in cell or _TIME.fullmatch(name)) and unit and len(unit) == 1:
            name, unit = cell, None
        text = below.strip().strip("[]()<> ")
        own = unit or (text if text not in ("", "-", "--", "1") else None)
        kind = _kind_of(name, own, named=cell != "")
        name = name or f"{'column' if array is None else 'channel'} {number}"
        found = Column(number=number, name=name, cell=cell, unit=own, kind=kind)
        columns.append(replace(found, array=array or ""))
    return tuple(columns)


def _name_and_unit(cell: str) -> tuple[str, str | None]:
    """Return name and unit of the head of a column.

    Examples
    --------
    >>> _name_and_unit("acc_x [g]"), _name_and_unit("a1 (m/s2)"), _name_and_unit("Acc (x)")
    (('acc_x', 'g'), ('a1', 'm/s2'), ('Acc (x)', None))
    """
    square = _SQUARE.fullmatch(cell)
    if square:
        return square[1], square[2] or None
    if "/" in cell and is_unit(cell):
        return cell, cell
    for pattern in (_ROUND, _BEHIND):
        match = pattern.fullmatch(cell)
        if match and match[1] and is_trusted_unit(match[2]):
            return match[1], match[2]
    suffix = _SUFFIX.fullmatch(cell)
    if suffix:
        return cell, suffix[2].replace("_", "/")
    return cell, None


def _kind_of(name: str, unit: str | None, *, named: bool) -> str:
    by_unit = kind_of_unit(unit)
    if by_unit == "time" or (by_unit is None and _TIME.fullmatch(name)):
        return "time"
    if named and by_unit is None and _INDEX.fullmatch(name):
        return "index"
    words = name.lower().replace("_", " ")
    by_name = next((kind for kind, pattern in _KINDS if re.search(pattern, words)), "vibration")
    if by_unit in ("speed", "torque", "other"):
        # in Hz it may be any frequency
        return "speed" if by_name == "speed" and speed_factor(unit) else by_unit
    moves = unit is not None and by_unit == "vibration" and unit.lower() not in ("v", "mv")
    return "vibration" if moves else by_name


def find_columns(origin: str, key: str | int, columns: Sequence[Column]) -> list[int]:
    """Return the indices of the channels that are meant by a name or by a column number.

    It is one, but for the name of an array: that means all its channels.

    Parameters
    ----------
    origin : str
        The file, for messages.
    key : str or int
        A name, or the number of a column counted from 1. Digits are a number unless a channel has
        that name.
    columns : sequence of Column
        The channels.

    Raises
    ------
    RecordingError
        If there is no such channel, or several have that name.
    """
    text = str(key)
    whole = [k for k, own in enumerate(columns) if own.array and own.array == key]
    if whole:
        return whole
    # also as messages list them, and channels of one name are called
    names = [(own.name, own.cell or own.name, f"{own.name} ({own.number})") for own in columns]
    numbers = [own.number for own in columns]
    if isinstance(key, str):
        for spelling in (str.strip, str.lower):
            wanted = spelling(text)
            found = [k for k, own in enumerate(names) if wanted in map(spelling, own)]
            if len(found) > 1:
                several = " and ".join(str(numbers[k]) for k in found)
                raise RecordingError(
                    f"{origin}: '{text}' is the name of columns {several}; give the number"
                )
            if found:
                return found
    if text.strip().isdigit() and int(text) in numbers:
        return [numbers.index(int(text))]
    shown = [f"{shortened(own.name)} ({own.number})" for own in columns]
    listed = ", ".join(shown[:20]) + (", ..." if len(shown) > 20 else "")
    near = nearest_name(text, [name for own in names for name in own[:2]])
    meant = f"did you mean {shortened(near)}? " if near else ""
    raise RecordingError(
        f"{origin}: no channel '{shortened(text)}'; {meant}channels (and columns): {listed}"
    )


@dataclass(frozen=True, kw_only=True)
class Defect:
    """What is wrong with a channel.

    Parameters
    ----------
    text : str
        What, as the rest of a sentence that begins with the channel.
    row : int
        Index of the first sample concerned; -1 if it is all of them.
    fatal : bool
        Whether the channel is useless.
    missing : str
        What the first value is that is no sample; "" if all are.
    """

    text: str
    row: int
    fatal: bool = True
    missing: str = ""


def all_finite(values: FloatArray) -> bool:
    """Tell whether all values are numbers that a sensor can give."""
    return not len(values) or bool(values.min() > -_MOST_SAMPLE and values.max() < _MOST_SAMPLE)


def find_defect(values: FloatArray) -> Defect | None:
    """Return why a channel cannot be vibration, or None.

    Parameters
    ----------
    values : ndarray of float64, shape (n,)
        Samples of one channel.

    Notes
    -----
    A channel is called clipped if its largest or smallest value occurs at least five times as
    often as any value within 5 % of the range next to it (and as the very next one). Clipping
    piles up samples at the limit; rounding alone does not: the top level of a rounded sine holds at
    most 1 + sqrt(2) times as many samples as the next, that of rounded noise fewer. It is fatal
    from one sample in a thousand on.
    """
    count = len(values)
    if count < 2 and all_finite(values):
        return None
    low, high = float(values.min()), float(values.max())
    if not (low > -_MOST_SAMPLE and high < _MOST_SAMPLE):  # also if they are no numbers
        return _missing(values)
    if low == high:
        return Defect(text=f"is constant ({low:g} in all {count} samples)", row=-1)
    if count < _FEWEST_SAMPLES:
        return None
    at = {extreme: int(np.count_nonzero(values == extreme)) for extreme in (high, low)}
    if sum(at.values()) == count:
        text = f"has only two values, {low:g} and {high:g}: is it a tacho or a switch?"
        return Defect(text=text, row=-1)
    for extreme, own in at.items():
        if own < _FEWEST_SAMPLES:
            continue
        first = int(np.argmax(values == extreme))
        if _is_piled_up(values[first:], high - low):
            share = own / count
            text = f"is clipped: {own} samples ({100 * share:.2g} %) are exactly {extreme:g}"
            return Defect(text=text, row=first, fatal=share >= _HARMLESS_SHARE)
    return None


def _missing(values: FloatArray) -> Defect:
    bad, count = np.flatnonzero(~(np.abs(values) < _MOST_SAMPLE)), len(values)
    if len(bad) == count:
        return Defect(text=f"has no numbers at all in {count} rows", row=-1, missing="no number")
    text = f"lacks a usable number in {len(bad)} of {count} rows ({100 * len(bad) / count:.3g} %)"
    what = "more than any sensor gives" if np.isfinite(values[bad[0]]) else "no number"
    return Defect(text=text, row=int(bad[0]), fatal=False, missing=what)


def _is_piled_up(values: FloatArray, range_: float) -> bool:
    """Tell whether far more samples equal the first one, an extreme, than any value next to it."""
    distance = np.abs(values[:_SAMPLES_TO_COMPARE] - values[0])
    beside = distance[distance > 0]
    if beside.size == 0:
        return False
    near = beside[beside <= max(float(beside.min()), _NEIGHBOURHOOD * range_)]
    # of an exact sine only the flat top is alike to the last digit
    _, counts = np.unique(np.round(near / (_ALIKE * range_)), return_counts=True)
    return bool(distance.size - beside.size >= _PILED_UP * counts.max())


def shortened(text: str) -> str:
    """Return the text, cut to what fits in a message, with no line ends or control characters."""
    begin = text[: LONGEST_QUOTE + 1]
    shown = "".join(character if character.isprintable() else "?" for character in begin)
    return shown if len(shown) <= LONGEST_QUOTE else shown[: LONGEST_QUOTE - 3] + "..."
