"""Commands that show what is in recordings: indicators, spectrum, orders."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gearmon.commands.command import command, number, option, recordings
from gearmon.commands.inputs import in_turn, machine_of, recording_of
from gearmon.commands.output import BAD_INPUT, DONE, Rows, finish, finish_with
from gearmon.report.wording import printable, table_lines

if TYPE_CHECKING:
    from gearmon.signatures.measured.indicators import IndicatorTable

# Columns of the table on a screen; the files hold the others too.
_SHOWN = ("channel", "stage", "gear", "indicator", "value", "unit", "input")
_AVERAGE_SHOWN = ("stage", "gear", "teeth", "rotation_order", "turns")
# Columns of a map that is written beside others: what a table program can open.
_MAP_COLUMNS = 1000
_WRITTEN = "write the table to this file, and a picture beside it"
_ORDERS_BESIDE = ("{}.png", "{}-map.*", "{}-averages.*", "{}-lines.*", "{}-average-[0-9]*-*.png")
_WINDOW = option(
    "--window",
    default="hann",
    metavar="NAME",
    help="hann (default), flat-top, blackman-harris or rectangular",
)
_PEAKS = number("--peaks", 12, "N", "peaks listed a channel")


@command(
    *recordings(machine_required=False),
    number(
        "--baseline", 1, "N", "records at the start of the run that were healthy, for NA4* and NB4*"
    ),
    option(
        "--history", metavar="FILE", help="go on with the run in this file (JSON), and write it"
    ),
    help="every condition indicator of recordings, with its input; several are those of a run",
    example="gearmon indicators monday.csv tuesday.csv --machine machine.toml -o indicators.csv",
    endings=(".csv", ".json", ".png"),
    output=_WRITTEN,
    beside=("{}.png",),
)
def indicators(arguments: argparse.Namespace) -> int:
    """Run `gearmon indicators`."""
    from gearmon.signatures.measured.indicators import indicator_table, read_history, write_history

    machine = machine_of(arguments.machine, arguments.speed_hint) if arguments.machine else None
    known = arguments.history and Path(arguments.history).exists()
    history = read_history(arguments.history) if known else None
    tables: list[IndicatorTable] = []

    def table_of(path: str) -> dict[str, Any]:
        recording = recording_of(path, arguments, machine)
        before = tables[-1].history if tables else history
        tables.append(indicator_table(recording, machine, before, arguments.baseline))
        return tables[-1].to_dict()

    entries = in_turn(arguments.recording, arguments.progress, table_of)
    history = tables[-1].history if tables else history
    result: dict[str, Any] = {"recordings": entries}
    if arguments.history and history is not None:
        write_history(history, arguments.history)
        result["history"] = arguments.history

    def rows() -> list[dict[str, Any]]:
        return [row for table in tables for row in table.frame_rows()]

    def figures() -> Mapping[str, Any]:
        from gearmon.report.recording_plots import indicator_figure

        return {"": indicator_figure(tables)} if tables else {}

    lines = partial(_indicator_lines, result, tables)
    finish(arguments, result, lines, rows if tables else None, figures, rows_in_json=True)
    return BAD_INPUT if any("error" in entry for entry in entries) else DONE


def _indicator_lines(result: dict[str, Any], tables: list[IndicatorTable]) -> list[str]:
    lines = []
    for table in tables:
        lines.append(printable(table.recording))
        brief = [row.brief() for row in table.rows]
        lines += table_lines([{name: row[name] for name in _SHOWN} for row in brief])
        removed = dict.fromkeys(
            (row.stage, row.gear, row.input, row.removed)
            for row in table.rows
            if row.input in ("residual", "difference")
        )
        lines += [
            f"{input_} signal, {gear} of stage {stage}: the average less {what}"
            for stage, gear, input_, what in removed
        ]
        lines += [f"note: {note}" for note in table.notes] + [""]
    return lines + [f"{e['recording']}: not read" for e in result["recordings"] if "error" in e]


@command(
    *recordings(machine_required=False, several=False),
    option(
        "--kind",
        default="amplitude",
        metavar="KIND",
        help="amplitude (peak; default), rms, density, energy, envelope, cepstrum, kurtogram or "
        "coherence",
    ),
    option(
        "--band",
        type=float,
        nargs=2,
        metavar=("LO", "HI"),
        help="in Hz: what is shown; for envelope the band that is demodulated; for coherence the "
        "modulation frequencies; for cepstrum quefrencies in s",
    ),
    _WINDOW,
    _PEAKS,
    help="a calibrated spectrum of a recording, of any kind, as table and picture",
    example="gearmon spectrum new.csv --kind envelope --band 2000 4000 --machine machine.toml "
    "-o spectrum.csv",
    endings=(".csv", ".json", ".png"),
    output=_WRITTEN,
    beside=("{}.png",),
)
def spectrum(arguments: argparse.Namespace) -> int:
    """Run `gearmon spectrum`."""
    from gearmon.signatures.recording_spectrum import recording_spectrum

    machine = machine_of(arguments.machine, arguments.speed_hint) if arguments.machine else None
    found = recording_spectrum(
        recording_of(arguments.recording[0], arguments, machine),
        arguments.kind,
        machine=machine,
        band=tuple(arguments.band) if arguments.band else None,
        window_name=arguments.window,
        most_peaks=arguments.peaks,
    )
    title = f"{found.recording}: {found.value_name}, highest peaks"
    lines = partial(_peak_lines, title, found.to_dict())
    return finish_with(arguments, found, lines, rows_in_json=True)


@command(
    *recordings(several=False),
    number("--shaft", 1, "N", "whose turns orders count"),
    option("--map", action="store_true", help="write the map only, in full resolution"),
    option("--against", default="time", metavar="WHAT", help="of the map: time (default) or speed"),
    option("--max-order", type=float, metavar="X", help="no orders above this one"),
    _WINDOW,
    _PEAKS,
    help="order spectrum, order map, and the synchronous average of every gear with its scatter",
    example="gearmon orders new.csv --machine machine.toml --shaft 2 -o orders.csv",
    endings=(".csv", ".json", ".png"),
    output="write the tables to files of this name and others beside it, with pictures",
    beside=_ORDERS_BESIDE,
)
def orders(arguments: argparse.Namespace) -> int:
    """Run `gearmon orders`."""
    from gearmon.signatures.gear_averages import gear_averages
    from gearmon.signatures.order_spectra import order_spectra

    machine = machine_of(arguments.machine, arguments.speed_hint)
    recording = recording_of(arguments.recording[0], arguments, machine)
    found = order_spectra(
        recording,
        machine,
        arguments.shaft,
        top=arguments.max_order,
        window_name=arguments.window,
        most_peaks=arguments.peaks,
        map_against=arguments.against,
    )
    averages = gear_averages(recording, machine, signature=found.signature)
    own = averages.to_dict()
    notes = dict.fromkeys([*found.to_dict()["warnings"], *own["warnings"]])
    result = {**found.to_dict(), "averages": own["averages"], "warnings": list(notes)}
    title = f"{found.recording}: amplitude against order of shaft {found.shaft}, highest peaks"
    rows: dict[str, Rows] = {
        "": found.rows,
        "-map": partial(found.map_rows, _MAP_COLUMNS),
        "-averages": averages.rows,
        "-lines": averages.line_rows,
    }

    def figures() -> Mapping[str, Any]:
        from gearmon.report.recording_plots import order_map_figure

        chart = order_map_figure(found)
        if arguments.map:
            return {"": chart}
        turns = {f"-average{name}": figure for name, figure in averages.figures().items()}
        return found.figures() | {"-map": chart} | turns

    written: dict[str, Rows] = {"": found.map_rows} if arguments.map else rows
    lines = partial(_order_lines, title, result)
    return finish(arguments, result, lines, written, figures, rows_in_json=True)


def _order_lines(title: str, result: dict[str, Any]) -> list[str]:
    rows = [
        {name: own[name] for name in _AVERAGE_SHOWN} | channel
        for own in result["averages"]
        for channel in own["channels"]
    ]
    lines = ["", "synchronous averages, root mean squares", *table_lines(rows)]
    for own in result["averages"]:
        removed = own["removed_orders"]["residual"], own["removed_orders"]["difference"]
        lines.append(
            f"{own['gear']} of stage {own['stage']}: residual less {len(removed[0])} orders "
            f"({_some(removed[0])}), difference less {len(removed[1])} ({_some(removed[1])})"
        )
    return _peak_lines(title, result, lines)


def _some(orders: list[float]) -> str:
    shown = [f"{order:.6g}" for order in orders]
    return ", ".join(shown if len(shown) < 6 else [*shown[:4], "...", shown[-1]])


def _peak_lines(title: str, result: dict[str, Any], more: Sequence[str] = ()) -> list[str]:
    lines = [printable(title), *table_lines(result["peaks"]), *more]
    return lines + [f"note: {note}" for note in result["warnings"]]
