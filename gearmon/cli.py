"""Arguments -> one call -> output and exit code; nobody imports this module.

Exit codes: 0 done and no flag raised, 1 done and a flag raised, 2 bad input or usage, 3 done but
nothing can be said. What a command takes stands beside it in `gearmon.commands`; everything heavy
is imported inside the command that needs it.
"""

from __future__ import annotations

import argparse
import io
import os
import sys
from collections.abc import Sequence

from gearmon import __version__
from gearmon.commands import COMMANDS
from gearmon.commands.inputs import check_names
from gearmon.commands.output import BAD_INPUT, DONE
from gearmon.errors import GearmonError
from gearmon.signals.threads import cores


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
    parser = _parser()
    arguments = parser.parse_args(argv)
    if arguments.command is None:
        parser.print_help()
        return DONE
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # file names need not be text
    try:
        check_names(arguments)
        cores()  # refuses a wrong number of them before any work
        code: int = arguments.run(arguments)
        sys.stdout.flush()
        return code
    except GearmonError as error:
        print(f"gearmon: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("gearmon: stopped", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # whoever reads the output has seen enough; stop Python from complaining at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gearmon",
        description="Gear condition monitoring that starts from physics.",
        epilog="Every command explains itself: gearmon COMMAND --help. First steps, without any "
        "recording: gearmon demo. Exit codes: 0 done, 1 done and a fault was flagged, "
        "2 bad input, 3 done but nothing can be said.",
    )
    parser.add_argument("--version", action="version", version=f"gearmon {__version__}")
    parsers = parser.add_subparsers(dest="command", metavar="COMMAND")
    for command in COMMANDS:
        command.add_to(parsers)
    return parser
