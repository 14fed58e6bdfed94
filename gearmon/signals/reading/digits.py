"""Digits to doubles for a whole block of text at once, with array operations only.

The block is looked at as bytes. All bytes that are no digits ("marks": separators, line ends,
decimal points, signs, exponent letters) are found in one sweep; the pattern of marks shows whether
every field is a number and nothing else. Then the digits before and after each decimal point are
taken eight at a time as one 64-bit word, and three multiplications turn such a word into a number.

A block that is anything but a plain table of numbers gives None; the caller then looks closer.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from gearmon.signals.reading.rounding import Floats, Integers, Words, decimal_to_double

Bytes = npt.NDArray[np.uint8]
Flags = npt.NDArray[np.bool_]

_NEWLINE, _SEPARATOR, _POINT, _SIGN, _EXPONENT, _FOREIGN = range(6)
_ZERO, _MINUS = np.uint8(ord("0")), np.uint8(ord("-"))
_WORD = 8  # digits in one word
_MOST_WORDS = 3
# Room before the block for the words of its first field, closed by the line end before it.
_MARGIN = b"0" * (_MOST_WORDS * _WORD) + b"\n"
_SIGNS = np.array([1.0, -1.0])
_MOST_DIGITS = 19  # 10**19 < 2**64
# Pairs of digits, then pairs of pairs, then pairs of those: mask, 1 + base * 2**shift, shift.
_PAIRINGS = tuple(
    (np.uint64(mask), np.uint64(1 + (base << shift)), np.uint64(shift))
    for mask, base, shift in (
        (0xFFFFFFFFFFFFFFFF, 10, 8),
        (0x00FF00FF00FF00FF, 100, 16),
        (0x0000FFFF0000FFFF, 10_000, 32),
    )
)
_POWERS = np.array([10**k for k in range(20)], np.uint64)
# The k last characters of a little-endian word, without the upper half of their ASCII codes.
_LAST_DIGITS = np.array(
    [0x0F0F0F0F0F0F0F0F & ~((1 << 8 * (_WORD - k)) - 1) for k in range(_WORD + 1)], np.uint64
)


@dataclass(frozen=True, kw_only=True)
class _Fields:
    """Where each field starts and ends, and the marks in it (indices into the list of marks)."""

    start: Integers
    end: Integers
    first: Integers
    last: Integers


@dataclass(frozen=True, kw_only=True)
class _Mantissas:
    """Where the digits of each field are: `before` of them up to `point`, `after` up to `end`."""

    point: Integers
    end: Integers
    before: Integers
    after: Integers


def parse_block(block: bytes, columns: int, separator: str, decimal: str) -> Floats | None:
    r"""Return the numbers of a block of text, or None if it is no plain table of numbers.

    Parameters
    ----------
    block : bytes
        Complete lines, each closed by a line feed; no blanks, no quotes, no empty lines.
    columns : int > 0
        Numbers in a line.
    separator, decimal : str
        One character each.

    Returns
    -------
    ndarray of float64, shape (lines, columns), or None
        Equal to ``float`` of each field.

    Examples
    --------
    >>> parse_block(b"1.5,2\n-3,4e1\n", 2, ",", ".")
    array([[ 1.5,  2. ],
           [-3. , 40. ]])
    """
    text = np.frombuffer(_MARGIN + block, np.uint8)
    marks, kinds = _marks(text, separator, decimal)
    fields = _fields(marks, kinds, columns)
    if fields is None:
        return None
    mantissas, powers = _parts(text, marks, kinds, fields)
    if mantissas is None:
        return None
    values, known = _values(text, mantissas, powers)
    values *= _SIGNS.take((text.take(fields.start) == _MINUS).view(np.uint8))
    for index in np.flatnonzero(~known):
        field = block[fields.start[index] - len(_MARGIN) : fields.end[index] - len(_MARGIN)]
        values[index] = float(field.translate(_python_number(decimal)))
    return values.reshape(-1, columns)


def _marks(text: Bytes, separator: str, decimal: str) -> tuple[Integers, Bytes]:
    """Return the places of all bytes that are no digits, from the line end before the block on."""
    begin = len(_MARGIN) - 1
    marks = np.flatnonzero(text[begin:] - _ZERO > 9)
    marks += begin
    return marks, _kinds(separator, decimal).take(text.take(marks))


@cache
def _kinds(separator: str, decimal: str) -> Bytes:
    kinds = np.full(256, _FOREIGN, np.uint8)
    for characters, kind in (
        ("\n", _NEWLINE),
        ("+-", _SIGN),
        ("eEdD", _EXPONENT),
        (decimal, _POINT),
        (separator, _SEPARATOR),
    ):
        kinds[[ord(character) for character in characters]] = kind
    return kinds


def _fields(marks: Integers, kinds: Bytes, columns: int) -> _Fields | None:
    """Return the fields, or None if a byte is foreign or a line has another number of fields."""
    delimiters = np.flatnonzero(kinds <= _SEPARATOR)
    if kinds.max() == _FOREIGN or (delimiters.size - 1) % columns:
        return None
    closings = kinds.take(delimiters[1:]).reshape(-1, columns)
    if closings[:, -1].any() or not closings[:, :-1].all():
        return None
    bounds = marks.take(delimiters)
    return _Fields(
        start=bounds[:-1] + 1, end=bounds[1:], first=delimiters[:-1] + 1, last=delimiters[1:]
    )


def _parts(
    text: Bytes, marks: Integers, kinds: Bytes, fields: _Fields
) -> tuple[_Mantissas | None, Integers | None]:
    """Return the places of the digits and the exponents; None, None if a field is no number."""
    signed = kinds.take(fields.first) == _SIGN
    if (signed & (marks.take(fields.first) != fields.start)).any():
        return None, None
    if not (kinds == _EXPONENT).any():
        return _mantissas(marks, kinds, fields, fields.last, signed), None
    powers, closing = _exponents(text, marks, kinds, fields)
    if powers is None:
        return None, None
    return _mantissas(marks, kinds, fields, closing, signed), powers


def _exponents(
    text: Bytes, marks: Integers, kinds: Bytes, fields: _Fields
) -> tuple[Integers | None, Integers]:
    """Return the exponents (0 where there is none) and the marks that close the mantissas."""
    before = fields.last - 1
    signed = (kinds.take(before) == _SIGN) & (before > fields.first)
    letter = before - signed
    present = kinds.take(letter) == _EXPONENT
    begin = marks.take(letter) + 1 + signed
    count = np.where(present, fields.end - begin, 1)
    plain = (present | ~signed) & (marks.take(before) - signed == marks.take(letter))
    if not (plain & (count >= 1) & (count <= 4)).all():
        return None, letter
    count[~present] = 0
    size = _digits(text, fields.end, count).astype(np.int64)
    negative = signed & (text.take(begin - 1) == _MINUS)
    return np.where(negative, -size, size), np.where(present, letter, fields.last)


def _mantissas(
    marks: Integers, kinds: Bytes, fields: _Fields, closing: Integers, signed: Flags
) -> _Mantissas | None:
    """Return the places of the digits, or None if a mantissa has other marks or no digits."""
    pointed = kinds.take(closing - 1) == _POINT
    if (closing - fields.first != signed.view(np.int8) + pointed.view(np.int8)).any():
        return None
    end = fields.end if closing is fields.last else marks.take(closing)
    point = marks.take(closing - pointed)
    before = point - fields.start
    before -= signed
    after = end - point
    after -= pointed
    if not (before + after).all():
        return None
    return _Mantissas(point=point, end=end, before=before, after=after)


def _values(text: Bytes, parts: _Mantissas, powers: Integers | None) -> tuple[Floats, Flags]:
    """Return the values without their signs, and which of them have few enough digits."""
    mantissa = _digits(text, parts.point, parts.before)
    known = parts.before <= _MOST_DIGITS - parts.after
    crowded = not known.all()
    if crowded:  # 0.00001234567890123456789 is still a matter of 19 digits
        leading = _word(text, parts.end - 2 * _WORD, parts.after - 2 * _WORD)
        # of more digits before the point the number may be a multiple of 2**64
        nothing = (mantissa == 0) & (parts.before <= _MOST_DIGITS)
        known |= nothing & (leading < 1000) & (parts.after <= _MOST_WORDS * _WORD)
    mantissa *= _POWERS.take(parts.after, mode="clip")
    mantissa += _digits(text, parts.end, parts.after)
    if crowded:
        mantissa[~known] = 0
    scale = -parts.after if powers is None else powers - parts.after
    return decimal_to_double(mantissa, scale), known


def _digits(text: Bytes, end: Integers, count: Integers) -> Words:
    """Return the numbers made of the `count` digits before `end`, modulo 2**64."""
    number = _word(text, end, count)
    for done in (_WORD, 2 * _WORD):
        longer = np.flatnonzero(count > done)
        if longer.size == 0:
            break
        upper = _word(text, end[longer] - done, count[longer] - done)
        number[longer] += _POWERS[done] * upper
    return number


def _word(text: Bytes, end: Integers, count: Integers) -> Words:
    """Return the numbers made of the last 8 or fewer of the `count` digits before `end`."""
    words: Words = np.ndarray((text.size - 7,), np.dtype("<u8"), text, strides=(1,))
    number = words[end - _WORD]
    number &= _LAST_DIGITS.take(count, mode="clip")
    for mask, factor, shift in _PAIRINGS:
        number &= mask
        number *= factor
        number >>= shift
    return number


@cache
def _python_number(decimal: str) -> bytes:
    return bytes.maketrans(f"{decimal}dD".encode(), b".ee")
