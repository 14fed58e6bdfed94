"""What a command is: name, arguments, an example, the function; and options of several."""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

_WIDTH = 78
_FAULT = "such as crack:1:pinion:5:20%%, a loss of the tooth pair's stiffness, or 1.5mm"
_ERRORS = (
    "also errors, such as eccentricity:1:pinion:all:20um, pitch:1:gear:7:8um or "
    "cumulative:1:gear:all:15um"
)


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
    beside : tuple of str
        What is written beside the output: patterns of names, in which {} stands for its name
        without the ending.
    folder : bool
        Whether the output is a folder.
    more : str
        What else a newcomer has to know, after the options.
    waits : bool
        Whether it waits for people or files, so that nothing tells how long it takes.
    """

    name: str
    help: str
    example: str
    add: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int]
    endings: tuple[str, ...] = ()
    output: str = "write the result to this file"
    beside: tuple[str, ...] = ()
    folder: bool = False
    more: str = ""
    waits: bool = False

    def add_to(self, parsers: Any) -> None:
        """Add the parser of this command to the sub-parsers of the command line."""
        parser: argparse.ArgumentParser = parsers.add_parser(
            self.name,
            help=self.help,
            description=textwrap.fill(self.help[0].upper() + self.help[1:] + ".", _WIDTH),
            epilog=self._epilog(),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        own = {"output_endings": self.endings, "beside": self.beside, "folder": self.folder}
        own |= {"waits": self.waits}
        parser.set_defaults(run=self.run, **own)
        option = parser.add_argument
        option("--json", action="store_true", help="print one JSON object")
        endings = f" ({', '.join(self.endings)})" if self.endings else ""
        option("-o", "--output", metavar="PATH", help=self.output + endings)
        option("--debug", action="store_true", help="show where an error of gearmon's own happened")
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


def machine_argument(parser: argparse.ArgumentParser) -> None:
    """Add the machine file as the first argument."""
    parser.add_argument("machine", metavar="MACHINE", help="machine file (TOML)")


def fault_option(parser: argparse.ArgumentParser, *, errors: bool = False) -> None:
    """Add --fault; `errors` tells of those that only a baseline knows."""
    told = f"{_FAULT}; {_ERRORS}" if errors else _FAULT
    repeatable(parser, "--fault", "KIND:STAGE:GEAR:TOOTH:SIZE", told, default=[])


def repeatable(
    parser: argparse.ArgumentParser, flag: str, metavar: str, told: str, **more: Any
) -> None:
    """Add an option that may be given several times; its values make a list."""
    parser.add_argument(flag, action="append", metavar=metavar, help=f"{told}; repeatable", **more)


def number(
    parser: argparse.ArgumentParser, flag: str, default: float, metavar: str, told: str
) -> None:
    """Add an option that takes a number of the kind of its default, which the help names."""
    shown = f"{default:g}".replace("e-0", "e-")
    parser.add_argument(
        flag, type=type(default), default=default, metavar=metavar, help=f"{told} ({shown})"
    )


def sampling_rate(parser: argparse.ArgumentParser) -> None:
    """Add --sampling-rate, of recordings that are read."""
    told = "needed if the file does not hold it"
    parser.add_argument("--sampling-rate", type=float, metavar="HZ", help=told)


def reference_option(parser: argparse.ArgumentParser) -> None:
    """Add --reference."""
    told = "what gearmon learn wrote, or one healthy recording"
    parser.add_argument("--reference", metavar="PATH", help=told)


def recording_options(
    parser: argparse.ArgumentParser,
    *,
    machine_required: bool = True,
    several: bool = True,
    least: int = 1,
) -> None:
    """Add recordings, their machine, and how they are to be read.

    Parameters
    ----------
    parser : ArgumentParser
    machine_required : bool
    several : bool
        Whether more than one recording may be named.
    least : {0, 1}
        Recordings to be named at least.
    """
    option = parser.add_argument
    count: str | int = ("+" if least else "*") if several else 1
    option(
        "recording",
        metavar="RECORDING",
        nargs=count,
        help="CSV, plain or gzip; also WAV, FLAC, MATLAB, HDF5, TDMS, UFF 58, Parquet, NPY; a "
        "folder of these; - for standard input",
    )
    option("--machine", metavar="MACHINE", required=machine_required, help="machine file (TOML)")
    told = "speed of shaft 1, where the machine file's is far off; it is looked for about this"
    option("--speed-hint", type=float, metavar="RPM", help=told)
    sampling_rate(parser)
    told = "vibration channel by name or column number (all by default)"
    repeatable(parser, "--channel", "NAME|N", told)
    option("--tacho", metavar="NAME|N", help="channel with tachometer pulses")


def window_and_peaks(parser: argparse.ArgumentParser) -> None:
    """Add --window and --peaks."""
    told = "hann (default), flat-top, blackman-harris or rectangular"
    parser.add_argument("--window", default="hann", metavar="NAME", help=told)
    number(parser, "--peaks", 12, "N", "peaks listed a channel")
