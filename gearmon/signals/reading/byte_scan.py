"""Bytes of a file that parsers pass over, found piece by piece."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Bytes = npt.NDArray[np.uint8]

_PIECE = 1 << 18
# Bytes at the end of a piece that are looked at again with the next: to see an exponent whole.
_AHEAD = 8
_LONG_EXPONENTS = {letter: re.compile(letter + rb"[+-]?[0-9]{5}") for letter in (b"e", b"E")}
_LONGEST_EXPONENT = 4
# Up to so many letters in a piece are looked at one by one.
_FEW = 100
_RETURN, _NEWLINE = b"\r\n"


@dataclass(frozen=True, kw_only=True)
class Piece:
    """Part of a file.

    Parameters
    ----------
    text : bytearray
        Its bytes; used again for the next piece.
    seen : int
        How many of them the piece before ended with.
    last : bool
        Whether the file ends here.
    """

    text: bytearray
    seen: int
    last: bool


def pieces(path: str, begin: int = 0) -> Iterator[Piece]:
    """Yield a file from a byte on, in pieces that each begin with the end of the one before.

    They share one piece of memory, which so stays in the cache.
    """
    size, place, seen = os.path.getsize(path), begin, 0
    held = bytearray(_PIECE)
    with open(path, "rb", buffering=0) as file:
        while place < size:
            file.seek(place - seen)
            got = file.readinto(held)
            if got <= seen:
                return  # cut while it is read
            place += got - seen
            text = held if got == len(held) else held[:got]
            yield Piece(text=text, seen=seen, last=place >= size)
            seen = min(_AHEAD, got)


def line_feeds(piece: Piece) -> int:
    """Count the line feeds that were not in the piece before."""
    text = np.frombuffer(piece.text, np.uint8)[piece.seen :]
    return int(np.count_nonzero(text == _NEWLINE))


def has_lone_return(piece: Piece) -> bool:
    """Tell whether a carriage return is followed by something else than a line feed."""
    if b"\r" not in piece.text:
        return False
    text = np.frombuffer(piece.text, np.uint8)
    returns = text == _RETURN
    closed = np.count_nonzero(returns[:-1] & (text[1:] == _NEWLINE))
    # of the last byte of a piece the next one tells
    return bool(closed != np.count_nonzero(returns[:-1]) or (piece.last and returns[-1]))


def has_long_exponent(piece: Piece) -> bool:
    """Tell whether more than four digits follow a letter e and a sign, if there is one."""
    text = piece.text
    for letter, pattern in _LONG_EXPONENTS.items():
        place, count = text.find(letter), 0
        while place >= 0:
            if count == _FEW:
                return _has_one_among_many(np.frombuffer(text, np.uint8))
            if pattern.match(text, place):
                return True
            place, count = text.find(letter, place + 1), count + 1
    return False


def _has_one_among_many(text: Bytes) -> bool:
    letters = np.flatnonzero(text | 0x20 == ord("e"))
    last = len(text) - 1
    after = np.minimum(letters + 1, last)
    signed = (text[after] == ord("+")) | (text[after] == ord("-"))
    digits = np.ones(len(letters), np.bool_)
    for step in range(1, _LONGEST_EXPONENT + 2):
        place = letters + signed + step
        characters = text[np.minimum(place, last)]
        digits &= (characters - np.uint8(ord("0")) <= 9) & (place <= last)
    return bool(digits.any())
