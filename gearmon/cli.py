"""Arguments -> one call -> output and exit code; nobody imports this module.

Exit codes: 0 done and no flag raised, 1 done and a flag raised, 2 bad input or usage, 3 done but
nothing can be said, 130 stopped, 70 an error of our own. What a command takes stands beside it in
`gearmon.commands`; everything heavy is imported inside the command that needs it.
"""

from __future__ import annotations

import argparse
import io
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import NoReturn

from gearmon import __version__
from gearmon.commands import machines, recordings, setup, signals
from gearmon.commands.command import BAD_INPUT, DONE, OWN_FAULT, STOPPED, complain, flushed, perform
from gearmon.errors import GearmonError, nearest_name

#: All commands, in the order of a first use.
COMMANDS = (
    setup.init,
    *(machines.lines, machines.stiffness, machines.baseline, machines.family),
    *(machines.stability, machines.modes, machines.simulate),
    *(recordings.learn, recordings.check, recordings.analyse, recordings.kinds),
    *(recordings.history, recordings.fleet),
    *(signals.indicators, signals.spectrum, signals.orders),
    *(machines.harvest, signals.exposure, setup.demo, setup.benchmark),
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments; those of the process by default.

    Returns
    -------
    int
        Exit code.
    """
    # threads of linear algebra only wait for each other: the matrices here are small (six analyses
    # beside one busy core took 7.0 s with them, 2.2 s without); read when NumPy is first imported
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    _open_streams()
    # what stands there until the arguments are known: their parser leaves by an exit of its own
    arguments = argparse.Namespace(debug=False)
    try:
        try:
            parsed(argv, arguments)
            if arguments.command is None:
                _parser().print_help()
                return DONE
            return perform(arguments)
        finally:
            flushed()
    except GearmonError as error:
        complain(str(error))
        return BAD_INPUT
    except KeyboardInterrupt:
        complain("stopped")
        return STOPPED
    except MemoryError:
        complain(
            "this takes more memory than there is; give shorter recordings, or fewer at a time"
        )
        return BAD_INPUT
    except Exception as error:
        if arguments.debug:
            raise
        complain(_own_fault(error))
        return OWN_FAULT


def parsed(
    argv: Sequence[str] | None, arguments: argparse.Namespace | None = None
) -> argparse.Namespace:
    """Return the parsed arguments of a command line; wrong ones, and --help, leave by an exit."""
    parser, words = _parser(), sys.argv[1:] if argv is None else argv
    names = [command.name for command in COMMANDS]
    word = words[0] if words else "-"
    if "_ARGCOMPLETE" in os.environ:  # the shell asks how a line may go on
        with suppress(ImportError):
            import argcomplete

            argcomplete.autocomplete(parser)
    near = None if word.startswith("-") or word in names else nearest_name(word.lower(), names)
    if near is not None:
        parser.error(f"there is no command {word!r}; did you mean {near}?")
    return parser.parse_args(argv, arguments)


def _open_streams() -> None:
    """See to it that there is something to write to, and that any name can be written."""
    for name in ("stdin", "stdout", "stderr"):
        # a closed one would give its number to the next file that is opened, and write into that
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "r" if name == "stdin" else "w"))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # file names need not be text


def _own_fault(error: Exception) -> str:
    """Write down what happened; return a line that says where."""
    import platform
    import tempfile
    import traceback

    told = f"an error of gearmon's own ({type(error).__name__}: {error})"
    details = [
        f"gearmon {__version__}, Python {platform.python_version()}, {platform.platform()}",
        " ".join(sys.argv),
        *traceback.format_exception(error),
    ]
    try:
        with tempfile.NamedTemporaryFile(
            "w", encoding="utf-8", prefix="gearmon-", suffix=".txt", delete=False, errors="replace"
        ) as file:
            file.write("\n".join(details))
    except OSError:
        return f"{told}; --debug shows where it happened"
    return f"{told}; details are in {file.name}, please report them"


class _Parser(argparse.ArgumentParser):
    """A parser, and those of its commands, whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        complain(f"{message}; see {self.prog} --help")
        sys.exit(BAD_INPUT)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="gearmon",
        description="Gear condition monitoring that starts from physics.",
        epilog="Every command explains itself: gearmon COMMAND --help. First steps, without any "
        "recording: gearmon demo. Exit codes: 0 done, 1 done and a fault was flagged, "
        "2 bad input, 3 done but nothing can be said, 130 stopped, 70 an error of gearmon's own.",
    )
    parser.add_argument("--version", action="version", version=f"gearmon {__version__}")
    parsers = parser.add_subparsers(dest="command", metavar="COMMAND")
    for command in COMMANDS:
        command.add_to(parsers)
    return parser
