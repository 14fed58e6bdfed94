"""The command that looks after many machines: fleet."""

from __future__ import annotations

from argparse import Namespace
from functools import partial
from typing import TYPE_CHECKING, Any

from gearmon import fleet as fleets
from gearmon.commands.command import (
    BAD_INPUT,
    DONE,
    FLAGGED,
    argument,
    command,
    complain,
    finish,
    words,
)
from gearmon.errors import ArgumentError, check_range, check_word
from gearmon.report.wording import table_lines
from gearmon.terminal import progress_line

if TYPE_CHECKING:
    from gearmon.fleet.plan import Fleet
    from gearmon.fleet.run import Run

#: What is shown of a ranking, and seconds between two looks.
_SHOWN, _EVERY_S = 20, 60.0


@command(
    argument(
        "ACTION",
        "run (analyse what is new), watch (what arrives), serve (web pages), rank (indicators "
        "by how clearly they change), or compare (machines that have the same gears)",
    ),
    argument("FLEET", "fleet file (TOML)"),
    argument("--engine NAME", "processes (default) or dask", "processes"),
    argument("--scheduler ADDRESS", "of dask, such as tcp://10.0.0.1:8786"),
    argument("--patience S", "until dask is given up, with no batch done", 3600.0),
    argument("--again", "also what failed, or another version analysed"),
    argument("--every S", "of watch: time between two looks", _EVERY_S),
    argument("--host HOST", "of serve; others are asked for a token (%(default)s)", "127.0.0.1"),
    argument("--port N", "of serve", 8765),
    argument("--token TOKEN", "of serve; made up where one is needed and none is given"),
    help="look after many machines: analyse what arrives, raise alarms, show who needs somebody",
    example="gearmon fleet run fleet.toml",
    waits=True,
    more="The fleet file names the machines: [[machine]] with name, file, reference, recordings (a "
    "folder) and pattern, a regular expression with the groups time and, if need be, machine and "
    "class; what several share stands in [defaults]. [[alarm]] with command, webhook or mail says "
    "who is told. All results are kept in one store, which gearmon history --name MACHINE reads. "
    "Exit code: 0 if no alarm stands, 1 if one does, 2 if a recording cannot be used.",
)
def fleet(arguments: Namespace) -> int:
    """Run `gearmon fleet`."""
    check_word("fleet ", arguments.action, _ACTIONS)
    code: int = _ACTIONS[arguments.action](arguments, fleets.read_fleet(arguments.fleet))
    return code


def _run(arguments: Namespace, fleet: Fleet) -> int:
    with progress_line("fleet run") as progress:
        run = fleets.run_fleet(fleet, _engine(arguments), again=arguments.again, progress=progress)
    for path, why in run.failed.items():
        complain(f"{path}: {why}")
    for trouble in fleets.deliver(fleet):
        complain(trouble)
    result = run.to_dict(fleet)
    finish(arguments, result, partial(words, "fleet", result, most=_SHOWN), list)
    return BAD_INPUT if run.failed else FLAGGED if result["alarms"] else DONE


def _engine(arguments: Namespace) -> Any:
    check_word("--engine ", arguments.engine, ("processes", "dask"))
    if arguments.engine == "processes":
        return fleets.in_processes
    if not arguments.scheduler:
        raise ArgumentError("--engine dask needs --scheduler ADDRESS, such as tcp://10.0.0.1:8786")
    return partial(fleets.on_dask, scheduler=arguments.scheduler, patience_s=arguments.patience)


def _watch(arguments: Namespace, fleet: Fleet) -> int:
    check_range("--every", arguments.every, 0.1, 86400.0, "s")

    def told(what: Run | str) -> None:
        if isinstance(what, str):
            complain(what)
        else:
            print(*words("fleet", what.to_dict(fleet), most=_SHOWN), sep="\n", flush=True)

    fleets.watch_fleet(fleet, _engine(arguments), every_s=arguments.every, told=told)
    return DONE


def _serve(arguments: Namespace, fleet: Fleet) -> int:
    try:
        from gearmon.fleet.pages import serve
    except ImportError:
        raise ArgumentError("fleet serve needs pip install 'gearmon[web]'") from None

    check_range("--port", arguments.port, 1, 65535)
    serve(fleet, arguments.host, arguments.port, arguments.token or "")
    return DONE


def _rank(arguments: Namespace, fleet: Fleet) -> int:
    from gearmon.fleet.ledger import compare, rank

    rows = {"rank": rank, "compare": compare}[arguments.action](fleet)
    result = {"fleet": fleet.name, "rows": rows}
    return finish(arguments, result, lambda: table_lines(rows[:_SHOWN]), lambda: rows)


_ACTIONS = {"run": _run, "watch": _watch, "serve": _serve, "rank": _rank, "compare": _rank}
