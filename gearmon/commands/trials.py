"""Commands that need no input: demo, benchmark."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gearmon.commands.command import command, number, option
from gearmon.commands.output import DONE, finish, show
from gearmon.report.wording import table_lines


@command(
    option(
        "name",
        metavar="NAME",
        nargs="?",
        default="crack",
        help="crack (found; default), growth (of a crack), kinds (pitting, wear and eccentricity "
        "told apart), day (of a sound machine), harvest, exposure (of a driver), fleet (of twelve "
        "machines), study",
    ),
    endings=(),
    help="run a whole job on data it makes itself",
    example="gearmon demo growth",
    output="write into this folder (gearmon-NAME)",
    folder=True,
)
def demo(arguments: argparse.Namespace) -> int:
    """Run `gearmon demo`."""
    from gearmon.demos import run_demo

    usual = "gearmon-demo" if arguments.name == "crack" else f"gearmon-{arguments.name}"
    result = run_demo(arguments.name, Path(arguments.output or usual), arguments.progress)
    show(arguments, result.to_dict(), result.lines)
    return DONE


@command(
    option("--quick", action="store_true", help="rough figures in seconds"),
    number("--seed", 0, "N", "of what is drawn at random"),
    option("--count", type=int, metavar="N", help="random systems, parameter sets or machines"),
    option("--ross-python", metavar="PATH", help="interpreter of an environment with ROSS"),
    option(
        "case",
        metavar="CASE",
        nargs="?",
        default="analyse",
        help="analyse (default), memory, stiffness, signals, harvesting, dynamics, stress or "
        "detection",
    ),
    help="measure run time, memory and error, side by side with named competitors",
    example="gearmon benchmark dynamics --quick -o benchmark.csv",
    beside=("{}.png", "{}-*.png"),
)
def benchmark(arguments: argparse.Namespace) -> int:
    """Run `gearmon benchmark`."""
    from gearmon.benchmark import PICTURED, case_figures, run_case, summary_rows

    rows = run_case(
        arguments.case,
        arguments.progress,
        ross_python=arguments.ross_python,
        quick=arguments.quick,
        seed=arguments.seed,
        count=arguments.count,
    )
    result: dict[str, Any] = {"case": arguments.case, "rows": rows}

    def lines() -> list[str]:
        return table_lines(summary_rows(arguments.case, rows))

    def figures() -> Mapping[str, Any]:
        return case_figures(arguments.case, rows)

    drawn = figures if arguments.case in PICTURED else None
    return finish(arguments, result, lines, lambda: rows, drawn)
