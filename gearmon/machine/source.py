"""The text of a machine file: how it is opened, parsed, and where its keys stand."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gearmon.errors import MachineFileError

LARGEST_FILE_BYTES = 1 << 20

_TABLE = re.compile(r"^\s*(\[\[?)\s*([A-Za-z0-9_-]+)\s*\]\]?\s*(#.*)?$")
_KEY = re.compile(r"""^\s*(["']?)([A-Za-z0-9_-]+)\1\s*=""")
_POSITION = re.compile(r"^(.*?)\s*\(at (?:line (\d+), column (\d+)|end of document)\)$", re.DOTALL)
_DECIMAL_COMMA = re.compile(r"=\s*[+-]?\d+,\d")


@dataclass(frozen=True, kw_only=True)
class MachineSource:
    """The text of one machine file and its parsed content.

    Parameters
    ----------
    path : str
        The file.
    document : dict
        What the TOML parser made of it.
    lines : dict of str to int
        Line of each table and key, such as ``"stage[2].module_mm"``, as far as it is known.
    """

    path: str
    document: dict[str, Any]
    lines: dict[str, int] = field(default_factory=dict)

    def error(self, key: str, message: str) -> MachineFileError:
        """Return the error that says `message` about the line of `key`."""
        line = self.lines.get(key) or self.lines.get(key.rpartition(".")[0])
        place = f"{self.path}:{line}" if line else self.path or "machine"
        return MachineFileError(f"{place}: {message}")


def read_source(path: str | Path) -> MachineSource:
    """Open and parse a machine file.

    Raises
    ------
    MachineFileError
        If there is no such file, or it is not TOML in UTF-8.
    """
    shown = str(path)
    text = _decoded(shown, _read_bytes(Path(path), shown))
    return MachineSource(path=shown, document=_parsed(shown, text), lines=key_lines(text))


def key_lines(text: str) -> dict[str, int]:
    r"""Return the line of every table header and bare key of a TOML text, counted from 1.

    A key is written with its table; tables of an array are counted from 1. Inline and dotted
    tables are left out: a line not known is better than a wrong one.

    Examples
    --------
    >>> key_lines('name = "a"\n[[stage]]\nkind = "parallel"')
    {'name': 1, 'stage[1]': 2, 'stage[1].kind': 3}
    """
    found: dict[str, int] = {}
    counts: dict[str, int] = {}
    prefix = ""
    inside_string = False
    for number, line in enumerate(text.splitlines(), start=1):
        quotes = line.count('"""') + line.count("'''")
        if inside_string:
            inside_string = quotes % 2 == 0
            continue
        inside_string = quotes % 2 == 1
        if header := _TABLE.match(line):
            label = _label(header[1], header[2], counts)
            found.setdefault(label, number)
            prefix = f"{label}."
        elif key := _KEY.match(line):
            found.setdefault(prefix + key[2], number)
    return found


def _label(bracket: str, table: str, counts: dict[str, int]) -> str:
    if bracket == "[":
        return table
    counts[table] = counts.get(table, 0) + 1
    return f"{table}[{counts[table]}]"


def _read_bytes(path: Path, shown: str) -> bytes:
    try:
        if path.is_dir():
            raise MachineFileError(f"{shown}: is a folder; give the name of a machine file (TOML)")
        if path.exists() and not path.is_file():
            raise MachineFileError(f"{shown}: is not an ordinary file")
        size = path.stat().st_size
        if size > LARGEST_FILE_BYTES:
            reason = f"has {size / 1e6:.1f} MB; a machine file is a short text (at most 1 MB)"
            raise MachineFileError(f"{shown}: {reason}")
        return path.read_bytes()
    except FileNotFoundError:
        hint = "; give the name of a TOML file, standard input is not taken" if shown == "-" else ""
        raise MachineFileError(f"{shown}: no such file{hint}") from None
    except OSError as error:
        raise MachineFileError(f"{shown}: cannot be read ({error.strerror})") from None
    except ValueError as error:
        if isinstance(error, MachineFileError):
            raise
        raise MachineFileError(f"{shown!r}: is not the name of a file ({error})") from None


def _decoded(shown: str, data: bytes) -> str:
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise MachineFileError(f"{shown}: is UTF-16 text; save it as UTF-8")
    if b"\0" in data:
        raise MachineFileError(f"{shown}: is a binary file; a machine file is TOML text")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        reason = f"byte 0x{data[error.start]:02x} is not UTF-8; save the file as UTF-8"
        raise MachineFileError(f"{shown}:{line}: {reason}") from None


def _parsed(shown: str, text: str) -> dict[str, Any]:
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise _syntax_error(shown, text, str(error)) from None
    except ValueError:  # of int(): Python limits the digits that it converts
        raise MachineFileError(f"{shown}: holds an integer of thousands of digits") from None
    except RecursionError:
        raise MachineFileError(f"{shown}: holds arrays nested too deeply") from None
    if not document:
        raise MachineFileError(f"{shown}: is empty; a machine file has [operating] and [[stage]]")
    return document


def _syntax_error(shown: str, text: str, message: str) -> MachineFileError:
    """Return the parser's complaint with its place in front, the line itself and a remedy."""
    match = _POSITION.match(message)
    if match is None:
        return MachineFileError(f"{shown}: is not valid TOML: {_one_line(message)}")
    lines = text.splitlines()
    number = int(match[2]) if match[2] else max(len(lines), 1)
    line = lines[number - 1].strip() if number <= len(lines) else ""
    place = f"{number}:{match[3]}" if match[3] else f"{number}"
    complaint = _one_line(_reworded(match[1]))
    here = f", in: {_shortened(line)}" if line else ""
    hint = " (decimal numbers take a point)" if _DECIMAL_COMMA.search(line) else ""
    return MachineFileError(f"{shown}:{place}: not valid TOML: {complaint}{here}{hint}")


def _reworded(complaint: str) -> str:
    if complaint == "Cannot overwrite a value":
        return "this key stands here for the second time"
    if complaint.startswith("Cannot declare") and complaint.endswith("twice"):
        return "this [table] stands here for the second time; a list of them takes [[table]]"
    return complaint


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _shortened(line: str) -> str:
    clean = "".join(letter if letter.isprintable() else "?" for letter in line)
    return clean if len(clean) <= 60 else f"{clean[:57]}..."
