"""The command `gearmon family`: every kind and size of fault of every gear, in one run."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from gearmon.commands.inputs import machine_of
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
    from gearmon.signatures.fault_family import fault_family

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
        from gearmon.report.family_plots import save_family_figure

        family.write(output, arguments.mesh_harmonics, arguments.sidebands)
        picture = Path(output).with_suffix(".png")
        result["pictures"] = [str(save_family_figure(family, picture))]
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
