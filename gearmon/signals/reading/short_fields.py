"""The quick way for blocks of short numbers: at most 16 characters each, few exponents.

Only separators and line ends are searched for. The last eight characters of every field are taken
as one 64-bit word, and so are the eight before them where a field is longer; arithmetic on whole
words finds the decimal character in it, closes the gap that it leaves, and adds up the digits. As
there are 16 digits at most, the quotient of two whole doubles is the correctly rounded value.

Anything else, also where it only might be something else, gives None; see `digits`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gearmon.signals.reading.fields import is_number, to_number
from gearmon.signals.reading.rounding import Floats, Integers, Words

Bytes = npt.NDArray[np.uint8]
Flags = npt.NDArray[np.bool_]

_WORD = 8
_MARGIN = b"\n" * (2 * _WORD)
_MOST_EXPONENTS = 0.02  # of the fields; if there are more, `digits` is quicker
_NEWLINE, _PLUS, _MINUS, _ZERO = b"\n+-0"
_EVERY_BYTE = 0x0101010101010101
_LOW_BITS, _HIGH_BITS = np.uint64(0x7F * _EVERY_BYTE), np.uint64(0x80 * _EVERY_BYTE)
_SEVEN, _FULL_BYTE = np.uint64(7), np.uint64(0xFF)
# The k last characters of a little-endian word; also without the upper half of their ASCII codes.
_LAST = np.array([2**64 - 2 ** (8 * (_WORD - k)) for k in range(_WORD + 1)], np.uint64)
_LAST_DIGITS = _LAST & np.uint64(0x0F * _EVERY_BYTE)
_PAIRINGS = tuple(
    (np.uint64(mask), np.uint64(1 + (base << shift)), np.uint64(shift))
    for mask, base, shift in (
        (0xFFFFFFFFFFFFFFFF, 10, 8),
        (0x00FF00FF00FF00FF, 100, 16),
        (0x0000FFFF0000FFFF, 10_000, 32),
    )
)
_POWERS = np.array([10**k for k in range(_WORD + 1)], np.uint64)
_DIVISORS = 10.0 ** np.arange(2 * _WORD + 1)
_SIGNS = np.array([1.0, -1.0])


@dataclass(frozen=True, kw_only=True)
class _Part:
    """Up to eight characters of each field.

    Parameters
    ----------
    number : ndarray of uint64
        Their digits as a number.
    points : ndarray of uint8
        How many decimal characters are among them.
    decimals : ndarray of uint8
        How many characters follow the decimal character; 0 without one.
    """

    number: Words
    points: Bytes
    decimals: Bytes


def parse_short_fields(block: bytes, columns: int, separator: str, decimal: str) -> Floats | None:
    r"""Return the numbers of a block of text, or None if not all are plain and short.

    Parameters
    ----------
    block : bytes
        Complete lines, each closed by a line feed.
    columns : int > 0
        Numbers in a line.
    separator, decimal : str
        One character each.

    Returns
    -------
    ndarray of float64, shape (lines, columns), or None
        Equal to ``float`` of each field; NaN for an empty field in a line that has others.

    Examples
    --------
    >>> parse_short_fields(b"1.5,2\n-3,.25\n", 2, ",", ".")
    array([[ 1.5 ,  2.  ],
           [-3.  ,  0.25]])
    """
    text = np.frombuffer(bytearray(_MARGIN + block), np.uint8)
    bounds = _bounds(text, columns, ord(separator))
    if bounds is None:
        return None
    odd = _fields_with_exponents(text, bounds, block, decimal)
    if odd is None:
        return None
    start, end = bounds[:-1] + 1, bounds[1:]
    first = text.take(start)
    negative = first == _MINUS
    signed = negative | (first == _PLUS)
    empty = start == end
    length = end - start
    length -= signed
    if not (length + empty).all() or length.max() > 2 * _WORD or _has_empty_row(empty, columns):
        return None
    point = np.uint64(ord(decimal) * _EVERY_BYTE)
    part = _joined(text, end, length, _part(text, end, length, point), point)
    marks = len(bounds) - 1 + int(part.points.sum()) + np.count_nonzero(signed)
    # every byte that is no digit must be one of these, at most one point in a field, and no field
    # without a digit
    others = np.count_nonzero(text[len(_MARGIN) :] - np.uint8(_ZERO) > 9)
    if marks != others or part.points.max() > 1 or ((length == part.points) & ~empty).any():
        return None
    values = part.number.astype(np.float64)
    values /= _DIVISORS.take(part.decimals)
    values *= _SIGNS.take(negative.view(np.uint8))
    values[empty] = np.nan
    for index, value in odd.items():
        values[index] = value
    return values.reshape(-1, columns)


def _has_empty_row(empty: Flags, columns: int) -> bool:
    return bool(empty.any() and empty.reshape(-1, columns).all(axis=1).any())


def _fields_with_exponents(
    text: Bytes, bounds: Integers, block: bytes, decimal: str
) -> dict[int, float] | None:
    """Return the values of the few fields with an exponent, and overwrite them with zeros.

    None if they are not few, or no numbers.
    """
    found: dict[int, float] = {}
    if not any(letter in block for letter in (b"e", b"E", b"d", b"D")):
        return found
    places = np.flatnonzero((text | 0x20 == ord("e")) | (text | 0x20 == ord("d")))
    if len(places) > _MOST_EXPONENTS * len(bounds):
        return None
    for index in np.searchsorted(bounds, places).tolist():
        start, end = int(bounds[index - 1]) + 1, int(bounds[index])
        field = text[start:end].tobytes().decode("latin-1")
        if not is_number(field, decimal):
            return None
        found[index - 1] = to_number(field, decimal)
        text[start:end] = _ZERO
    return found


def _bounds(text: Bytes, columns: int, separator: int) -> Integers | None:
    """Return the places of the line end before the block and of all that close a field."""
    begin = len(_MARGIN) - 1
    closing = text[begin:] == separator
    closing |= text[begin:] == _NEWLINE
    bounds = np.flatnonzero(closing)
    bounds += begin
    if (len(bounds) - 1) % columns:
        return None
    kinds = text.take(bounds[1:]).reshape(-1, columns)
    right = (kinds[:, -1] == _NEWLINE).all() and (kinds[:, :-1] == separator).all()
    return bounds if right else None


def _joined(text: Bytes, end: Integers, length: Integers, last: _Part, point: np.uint64) -> _Part:
    """Add the characters before the last eight."""
    longer = np.flatnonzero(length > _WORD)
    if longer.size == 0:
        return last
    upper = _part(text, end[longer] - _WORD, length[longer] - _WORD, point)
    own_points = last.points[longer]
    last.number[longer] += upper.number * _POWERS.take(_WORD - own_points)
    last.decimals[longer] += upper.decimals + _WORD * upper.points
    last.points[longer] = own_points + upper.points
    return last


def _part(text: Bytes, end: Integers, length: Integers, point: np.uint64) -> _Part:
    """Return what the last eight characters before `end` say, or as many as the field has."""
    words: Words = np.ndarray((text.size - 7,), np.dtype("<u8"), text, strides=(1,))
    number = words[end - _WORD]
    found = _equal_bytes(number & _LAST.take(length, mode="clip"), point)
    number &= _LAST_DIGITS.take(length, mode="clip")
    number &= ~(found * _FULL_BYTE)
    points = np.bitwise_count(found)
    before = found - np.uint64(1)  # bits of the characters before the point; all without one
    decimals = np.uint8(_WORD - 1) - (np.bitwise_count(before) >> np.uint8(3))
    decimals *= points
    whole = number & before
    number ^= whole
    whole <<= (points << np.uint8(3)).astype(np.uint64)
    number |= whole
    for mask, factor, shift in _PAIRINGS:
        number &= mask
        number *= factor
        number >>= shift
    return _Part(number=number, points=points, decimals=decimals)


def _equal_bytes(words: Words, pattern: np.uint64) -> Words:
    """Return words with 1 in each byte that equals the byte of the pattern, and 0 elsewhere."""
    words ^= pattern
    found = words & _LOW_BITS
    found += _LOW_BITS
    found |= words
    np.invert(found, out=found)
    found &= _HIGH_BITS
    found >>= _SEVEN
    return found
