"""What a command is: name, arguments, an example, the function; and arguments of several."""

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


Run = Callable[[argparse.Namespace], int]
#: Names and settings of an argument, as a parser takes them.
Argument = tuple[tuple[str, ...], dict[str, Any]]


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
    arguments : tuple of Argument
        What it takes, beside what all take.
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
    arguments: tuple[Argument, ...]
    run: Run
    endings: tuple[str, ...] = (".csv", ".json")
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
        for names, settings in self.arguments:
            option(*names, **settings)

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


def command(*arguments: Argument, **said: Any) -> Callable[[Run], Command]:
    """Make the function below a command of its name.

    Parameters
    ----------
    *arguments : Argument
        What it takes.
    **said
        The other fields of `Command`.
    """

    def made(run: Run) -> Command:
        return Command(name=run.__name__, run=run, arguments=arguments, **said)

    return made


def option(*names: str, **settings: Any) -> Argument:
    """Describe an argument as `ArgumentParser.add_argument` takes it."""
    return names, settings


def repeatable(flag: str, metavar: str, told: str, **more: Any) -> Argument:
    """Describe an option that may be given several times; its values make a list."""
    return option(flag, action="append", metavar=metavar, help=f"{told}; repeatable", **more)


def number(flag: str, default: float, metavar: str, told: str) -> Argument:
    """Describe an option that takes a number of the kind of its default, which the help names."""
    shown = f"{told} ({f'{default:g}'.replace('e-0', 'e-')})"
    return option(flag, type=type(default), default=default, metavar=metavar, help=shown)


def fault(*, errors: bool = False) -> Argument:
    """Describe --fault; `errors` tells of those that only a baseline knows."""
    told = f"{_FAULT}; {_ERRORS}" if errors else _FAULT
    return repeatable("--fault", "KIND:STAGE:GEAR:TOOTH:SIZE", told, default=[])


MACHINE = option("machine", metavar="MACHINE", help="machine file (TOML)")
SAMPLING_RATE = option(
    "--sampling-rate", type=float, metavar="HZ", help="needed if the file does not hold it"
)
REFERENCE = option(
    "--reference", metavar="PATH", help="what gearmon learn wrote, or one healthy recording"
)
TACHO = option("--tacho", metavar="NAME|N", help="channel with tachometer pulses")


def recordings(
    *, machine_required: bool = True, several: bool = True, least: int = 1
) -> tuple[Argument, ...]:
    """Describe recordings, their machine, and how they are to be read.

    Parameters
    ----------
    machine_required : bool
    several : bool
        Whether more than one recording may be named.
    least : {0, 1}
        Recordings to be named at least.
    """
    return (
        option(
            "recording",
            metavar="RECORDING",
            nargs=("+" if least else "*") if several else 1,
            help="CSV, plain or gzip; also WAV, FLAC, MATLAB, HDF5, TDMS, UFF 58, Parquet, NPY; a "
            "folder of these; - for standard input",
        ),
        machine_option(required=machine_required),
        option(
            "--speed-hint",
            type=float,
            metavar="RPM",
            help="speed of shaft 1, where the machine file's is far off; it is looked for about "
            "this",
        ),
        SAMPLING_RATE,
        repeatable(
            "--channel", "NAME|N", "vibration channel by name or column number (all by default)"
        ),
        TACHO,
    )


def machine_option(*, required: bool = True) -> Argument:
    """Describe --machine."""
    return option("--machine", metavar="MACHINE", required=required, help="machine file (TOML)")
