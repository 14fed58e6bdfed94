"""The command that places and tunes harvesters."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Any

from gearmon.commands.command import Command
from gearmon.commands.inputs import machine_of, recording_of
from gearmon.commands.options import fault_option, machine_argument
from gearmon.commands.output import finish
from gearmon.errors import ArgumentError


def run_harvest(arguments: argparse.Namespace) -> int:
    """Run `gearmon harvest`."""
    from gearmon.harvesting.placement import survey_expected, survey_measured
    from gearmon.harvesting.request import built_in, load_harvester
    from gearmon.report.harvest_text import harvest_lines

    machine = machine_of(arguments.machine)
    harvester, budget = load_harvester(arguments.harvester) if arguments.harvester else built_in()
    if arguments.recording:
        _refuse_with_recordings(arguments)
        survey = survey_measured(
            machine,
            harvester,
            [recording_of(path, arguments, machine) for path in arguments.recording],
            budget,
            shares=arguments.share or (),
            degraded=[recording_of(path, arguments, machine) for path in arguments.degraded],
            count=arguments.count,
        )
    else:
        _refuse_without_recordings(arguments)
        survey = survey_expected(
            machine,
            harvester,
            budget,
            faults=tuple(arguments.fault),
            path_gain=arguments.path_gain,
            wander=arguments.wander,
            count=arguments.count,
        )

    def figures() -> Mapping[str, Any]:
        from gearmon.report.harvest_plots import harvest_figures

        return harvest_figures(survey)

    return finish(arguments, survey.to_dict(), lambda: harvest_lines(survey), survey.rows, figures)


def _refuse_with_recordings(arguments: argparse.Namespace) -> None:
    if arguments.fault:
        raise ArgumentError(
            "--fault: only for expected lines; give --degraded RECORDING beside recordings"
        )


def _refuse_without_recordings(arguments: argparse.Namespace) -> None:
    for name in ("share", "degraded", "channel"):
        if getattr(arguments, name):
            raise ArgumentError(f"--{name}: only beside recordings; name them after the machine")


def _arguments(parser: argparse.ArgumentParser) -> None:
    option = parser.add_argument
    machine_argument(parser)
    option(
        "recording",
        metavar="RECORDING",
        nargs="*",
        help="one for each operating point, every vibration channel a position; without any, the "
        "expected lines of the machine are used",
    )
    option("--harvester", metavar="FILE", help="harvester file (TOML); a 15 mm bimorph by default")
    option("--count", type=int, default=1, metavar="N", help="harvesters of a set, 1 to 3 (1)")
    option(
        "--share",
        action="append",
        type=float,
        metavar="F",
        help="share of time of each recording, in their order; repeatable",
    )
    option(
        "--degraded",
        action="append",
        default=[],
        metavar="RECORDING",
        help="the same operating point with a damaged gear; repeatable, in the same order",
    )
    fault_option(parser)
    option("--path-gain", type=float, default=1.0, metavar="G", help="mesh to harvester (1)")
    option("--wander", type=float, default=0.005, metavar="F", help="of speed, relative (0.005)")
    option("--sampling-rate", type=float, metavar="HZ", help="needed if the file does not hold it")
    option("--channel", action="append", metavar="NAME|N", help="only these channels; repeatable")
    option("--tacho", metavar="NAME|N", help=argparse.SUPPRESS)


HARVEST = Command(
    name="harvest",
    help="say where to put a vibration energy harvester, how to tune it and what it will power",
    example="gearmon harvest machine.toml full.csv idle.csv --share 0.7 --share 0.3 "
    "-o harvest.json",
    add=_arguments,
    run=run_harvest,
    endings=(".csv", ".json"),
    output="write the result to this file, and pictures beside it",
)
