"""What a command is: its name, its arguments, an example, and the function that runs it."""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

_WIDTH = 78


@dataclass(frozen=True, kw_only=True)
class Command:
    """A sub-command of the command line.

    Parameters
    ----------
    name : str
        As typed.
    help : str
        What it does, in one line without a full stop.
    example : str
        A command line that works, given the files that it names.
    add : callable
        Adds its arguments to a parser.
    run : callable
        Runs it with the parsed arguments; returns the exit code.
    endings : tuple of str
        Endings that the name of the output may have; empty: any.
    output : str
        What is written under that name.
    more : str
        What else a newcomer has to know, after the options.
    """

    name: str
    help: str
    example: str
    add: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int]
    endings: tuple[str, ...] = ()
    output: str = "write the result to this file"
    more: str = ""

    def add_to(self, parsers: Any) -> None:
        """Add the parser of this command to the sub-parsers of the command line."""
        parser: argparse.ArgumentParser = parsers.add_parser(
            self.name,
            help=self.help,
            description=textwrap.fill(self.help[0].upper() + self.help[1:] + ".", _WIDTH),
            epilog=self._epilog(),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        parser.set_defaults(run=self.run, output_endings=self.endings)
        option = parser.add_argument
        option("--json", action="store_true", help="print one JSON object")
        endings = f" ({', '.join(self.endings)})" if self.endings else ""
        option("-o", "--output", metavar="PATH", help=self.output + endings)
        self.add(parser)

    def _epilog(self) -> str:
        """Return the example, broken so that it can be pasted into a shell."""
        lines = ["example:"]
        for part in self.example.replace(" -", "\n-").splitlines():
            # an option stays with its value
            if len(lines[-1]) + len(part) > _WIDTH - 4:
                lines.append("   ")
            lines[-1] += f" {part}"
        told = [textwrap.fill(self.more, _WIDTH)] if self.more else []
        return "\n\n".join([*told, " \\\n".join(lines)])
