"""The command `gearmon family`: every kind and size of fault of every gear, in one run."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from gearmon.commands.command import Command
from gearmon.commands.inputs import machine_of
from gearmon.commands.options import machine_argument
from gearmon.commands.output import DONE, show
from gearmon.errors import ArgumentError

#: What the terminal shows of each member.
SHOWN = (
    "kind",
    "stage",
    "gear",
    "size",
    "loss",
    "operating",
    "sidebands_ms2",
    "mesh_change_ms2",
    "healthy_ms2",
    "contact_lost",
    "error",
)
MOST_ROWS = 60


def run_family(arguments: argparse.Namespace) -> int:
    """Run `gearmon family`."""
    from gearmon.signatures.expected.fault_family import fault_family

    output = arguments.output
    family = fault_family(
        machine_of(arguments.machine),
        kinds=arguments.kind or None,
        sizes=arguments.size or None,
        gears=arguments.gear or None,
        operating=arguments.operating or None,
        max_hz=arguments.max_hz,
        tolerance=arguments.tolerance,
    )
    if not len(family):
        raise ArgumentError("no fault is left: " + "; ".join(family.notes))
    result = family.to_dict()
    if output:
        from gearmon.report.expected_plots import family_figure
        from gearmon.report.plots import save

        family.write(output, arguments.mesh_harmonics, arguments.sidebands)
        picture = Path(output).with_suffix(".png")
        result["pictures"] = [str(save(family_figure(family), picture))]
    show(arguments, result, lambda: _lines(result))
    return DONE


def _lines(result: dict[str, Any]) -> list[str]:
    from gearmon.report.text_tables import table_lines

    rows = [{name: row[name] for name in SHOWN} for row in result["rows"]]
    step = max(1, -(-len(rows) // MOST_ROWS))
    shown = rows[::step]
    lines = table_lines(shown)
    if step > 1:
        lines.append(f"({len(shown)} of {len(rows)} members; --json or -o FILE gives them all)")
    lines += [f"note: {note}" for note in result["notes"]]
    return lines + [f"wrote {path}" for path in result.get("pictures", ())]


def _arguments(parser: argparse.ArgumentParser) -> None:
    machine_argument(parser)
    option = parser.add_argument
    option(
        "--kind",
        action="append",
        metavar="KIND",
        help="stiffness, crack, breakage, pitting, spall, wear or missing; of errors pitch, "
        "profile, cumulative, eccentricity or misalignment; repeatable (nine of these)",
    )
    option(
        "--size",
        action="append",
        metavar="SIZE",
        help="such as 20%% or 1.5mm, of errors 20um; repeatable (2.5%% to 40%%, 5um to 40um)",
    )
    option("--gear", action="append", metavar="STAGE:GEAR", help="such as 1:pinion; repeatable")
    option(
        "--operating",
        action="append",
        type=int,
        metavar="N",
        help="operating point, from 0; repeatable (all)",
    )
    option("--max-hz", type=float, metavar="F", help="no lines above this frequency")
    option(
        "--tolerance",
        type=float,
        default=1e-6,
        metavar="X",
        help="relative error of what a fault adds (1e-6)",
    )
    option("--mesh-harmonics", type=int, metavar="N", help="write no lines about higher ones")
    option("--sidebands", type=int, metavar="N", help="write no sidebands farther off")


FAMILY = Command(
    name="family",
    help="the spectra of every kind and size of fault of every gear, as table and picture",
    example="gearmon family machine.toml --kind crack --kind pitting --size 5% --size 20% -o f.csv",
    add=_arguments,
    run=run_family,
    endings=(".csv", ".json", ".parquet"),
)
