"""The error classes of gearmon and the small checks that raise them.

Every error that a user can cause is a `GearmonError`: its text is one line that names the thing,
its value, the allowed range and the remedy. The command line prints that line and exits with 2.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable


class GearmonError(ValueError):
    """Bad input; the message is one clear line.

    Examples
    --------
    >>> try:
    ...     gearmon.load_machine(operating={"speed_rpm": 1480.0}, stage={"kind": "belt"})
    ... except gearmon.GearmonError as error:
    ...     print(error)
    machine: stage[1].kind = "belt" must be "parallel" or "planetary"
    """


class MachineFileError(GearmonError):
    """A machine file (TOML) cannot be used."""


class RecordingError(GearmonError):
    """A recording cannot be used."""


class ArgumentError(GearmonError):
    """A function or command-line argument is out of its range."""


class SignatureError(GearmonError):
    """A stored signature or reference cannot be used."""


def check_type(name: str, value: object, kind: type | tuple[type, ...], accepted: str) -> None:
    """Raise if `value` is of another kind, with what is accepted.

    Raises
    ------
    ArgumentError
        If it is.
    """
    if not isinstance(value, kind):
        raise ArgumentError(f"{name}: {type(value).__name__} is not taken; give {accepted}")


def check_finite(name: str, value: float, unit: str = "") -> float:
    """Return `value` as a float, or raise if it is not a finite number.

    Raises
    ------
    ArgumentError
        If `value` is NaN, infinite, or no real number at all.
    """
    try:
        # NumPy would let an imaginary part go, and float read a text
        number = math.nan if isinstance(value, complex | str) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise _refusal(name, value, unit, "be a finite number")
    return number


def check_positive(name: str, value: float, unit: str = "") -> float:
    """Return `value` as a float, or raise if it is not finite and > 0.

    Raises
    ------
    ArgumentError
        If `value` is not a finite number above zero.
    """
    number = check_finite(name, value, unit)
    if number <= 0:
        raise _refusal(name, value, unit, "be > 0")
    return number


def check_range(name: str, value: float, low: float, high: float, unit: str = "") -> float:
    """Return `value` as a float, or raise if it is outside [low, high].

    Raises
    ------
    ArgumentError
        If `value` is not finite or lies outside the closed range.
    """
    number = check_finite(name, value, unit)
    if not low <= number <= high:
        raise _refusal(name, value, unit, f"lie in [{low:g}, {high:g}] {unit}".rstrip())
    return number


def nearest_name(word: str, known: Iterable[str]) -> str | None:
    """Return the known name that looks most like `word`, or None if none does.

    Examples
    --------
    >>> nearest_name("modul_mm", ["module_mm", "face_width_mm"])
    'module_mm'
    """
    matches = difflib.get_close_matches(word, list(known), n=1, cutoff=0.5)
    return matches[0] if matches else None


def counted(number: int, noun: str, plural: str = "") -> str:
    """Return a count with its noun, as "1 mesh", "2 meshes".

    Examples
    --------
    >>> counted(1, "mesh", "meshes"), counted(3, "turn")
    ('1 mesh', '3 turns')
    """
    return f"{number} {noun if number == 1 else plural or noun + 's'}"


def check_word(name: str, word: str, known: Iterable[str]) -> None:
    """Raise if `word` is not one of the known words, with the one that looks most like it.

    Parameters
    ----------
    name : str
        What the word is, with what stands between it and the word: "form=", "gear ".
    word : str
    known : iterable of str

    Raises
    ------
    ArgumentError
        If the word is not known.
    """
    words = list(known)
    if word not in words:
        near = nearest_name(str(word), words)
        hint = f"; did you mean {near}?" if near else ""
        raise ArgumentError(f"{name}{word!r} is not one of {', '.join(words)}{hint}")


def _refusal(name: str, value: float, unit: str, must: str) -> ArgumentError:
    shown = f"{value!r} (a text)" if isinstance(value, str) else f"{value} {unit}".rstrip()
    return ArgumentError(f"{name}={shown} must {must}")
