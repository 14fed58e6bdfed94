"""Commands that need no input: demo, benchmark."""

from __future__ import annotations

import argparse
from pathlib import Path

from gearmon.commands.output import DONE, show, write_table
from gearmon.terminal import progress_bar


def run_demo(arguments: argparse.Namespace) -> int:
    """Run `gearmon demo`."""
    from gearmon.demos import run_demo

    usual = "gearmon-demo" if arguments.name == "crack" else f"gearmon-{arguments.name}"
    result = run_demo(arguments.name, Path(arguments.output or usual))
    show(arguments, result.to_dict(), result.lines)
    return DONE


def run_benchmark(arguments: argparse.Namespace) -> int:
    """Run `gearmon benchmark`."""
    from gearmon.benchmark import run_case
    from gearmon.report.text_tables import rows_as_csv, table_lines

    with progress_bar("measuring") as progress:
        rows = run_case(arguments.case, progress)
    result = {"case": arguments.case, "rows": rows}
    if arguments.output:
        write_table(arguments.output, result, lambda: rows_as_csv(rows))
    show(arguments, result, lambda: table_lines(rows))
    return DONE
