"""Commands that show what is in recordings: indicators, spectrum, orders; exposure of people."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterator, Mapping
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gearmon
from gearmon import report
from gearmon.commands import command
from gearmon.commands.command import argument
from gearmon.errors import ArgumentError
from gearmon.report.wording import printable, table_lines

if TYPE_CHECKING:
    from gearmon.report.survey_text import Told
    from gearmon.signatures.measured.indicators import IndicatorTable

# Columns of the table on a screen; the files hold the others too.
_SHOWN = ("channel", "stage", "gear", "indicator", "value", "unit", "input")
_AVERAGE_SHOWN = ("stage", "gear", "teeth", "rotation_order", "turns")
# Columns of a map that is written beside others: what a table program can open.
_MAP_COLUMNS = 1000
#: What is written by those that draw one picture.
_PICTURED: dict[str, Any] = {
    "endings": (".csv", ".json", ".png"),
    "output": "write the table to this file, and a picture beside it",
    "beside": ("{}.png",),
}
_ORDERS_BESIDE = ("{}.png", "{}-map.*", "{}-averages.*", "{}-lines.*", "{}-average-[0-9]*-*.png")
_WINDOW = argument(
    "--window NAME",
    "hann (default), flat-top, blackman-harris or rectangular",
    "hann",
    dest="window_name",
)
_PEAKS = argument("--peaks N", "peaks listed a channel", 12, dest="most_peaks")


@command.command(
    *command.recordings(machine_required=False),
    argument("--baseline N", "healthy records at the start of the run, for NA4* and NB4*", 1),
    argument("--history FILE", "go on with the run in this file (JSON), and write it"),
    help="every condition indicator of recordings, with its input; several are those of a run",
    example="gearmon indicators monday.csv tuesday.csv --machine machine.toml -o indicators.csv",
    **_PICTURED,
)
def indicators(arguments: Namespace) -> int:
    """Run `gearmon indicators`."""
    from gearmon.signatures.measured.indicators import read_history, write_history

    known = arguments.history and Path(arguments.history).exists()
    history = read_history(arguments.history) if known else None
    tables: list[IndicatorTable] = []

    def table_of(path: str) -> dict[str, Any]:
        about = command.recording_of(path, arguments), arguments.machine
        before = tables[-1].history if tables else history
        tables.append(gearmon.indicator_table(*about, before, arguments.baseline))
        return tables[-1].to_dict()

    entries = command.each_of(arguments.recording, arguments.progress, table_of)
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
    command.finish(arguments, result, lines, rows if tables else None, figures, rows_in_json=True)
    return command.judged(entries)


def _indicator_lines(result: dict[str, Any], tables: list[IndicatorTable]) -> list[str]:
    lines = []
    for table in tables:
        lines.append(printable(table.recording))
        lines += table_lines([{name: row[name] for name in _SHOWN} for row in table.frame_rows()])
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


@command.command(
    *command.recordings("RECORDING", machine_required=False),
    argument(
        "--kind KIND",
        "amplitude (peak; default), rms, density, energy, envelope, cepstrum or kurtogram",
        "amplitude",
    ),
    argument(
        "--band LO HI",
        "in Hz: what is shown; for envelope the band that is demodulated; for cepstrum "
        "quefrencies in s",
    ),
    _WINDOW,
    _PEAKS,
    help="a calibrated spectrum of a recording, of any kind, as table and picture",
    example="gearmon spectrum new.csv --kind envelope --band 2000 4000 --machine machine.toml "
    "-o spectrum.csv",
    **_PICTURED,
)
def spectrum(arguments: Namespace) -> int:
    """Run `gearmon spectrum`."""
    recording = command.recording_of(arguments.recording[0], arguments)
    named = command.given(arguments, "kind", "band", "window_name", "most_peaks", "machine")
    found = gearmon.recording_spectrum(recording, **named)
    title = f"{found.recording}: {found.value_name}, highest peaks"
    lines = partial(command.words, "peaks", found.to_dict(), title=title, rows=())
    return command.finish(arguments, found, lines, rows_in_json=True)


@command.command(
    *command.recordings("RECORDING"),
    argument("--shaft N", "whose turns orders count", 1),
    argument("--map", "write the map only, in full resolution"),
    argument("--against WHAT", "of the map: time (default) or speed", "time", dest="map_against"),
    argument("--max-order X", "no orders above this one", dest="top"),
    _WINDOW,
    _PEAKS,
    help="order spectrum, order map, and the synchronous average of every gear with its scatter",
    example="gearmon orders new.csv --machine machine.toml --shaft 2 -o orders.csv",
    endings=(".csv", ".json", ".png"),
    output="write the tables to files of this name and others beside it, with pictures",
    beside=_ORDERS_BESIDE,
)
def orders(arguments: Namespace) -> int:
    """Run `gearmon orders`."""
    machine, recording = arguments.machine, command.recording_of(arguments.recording[0], arguments)
    named = command.given(arguments, "shaft", "top", "window_name", "most_peaks", "map_against")
    found = gearmon.order_spectra(recording, machine, **named)
    averages = gearmon.gear_averages(recording, machine, signature=found.signature)
    own = averages.to_dict()
    notes = dict.fromkeys([*found.to_dict()["warnings"], *own["warnings"]])
    result = {**found.to_dict(), "averages": own["averages"], "warnings": list(notes)}
    title = f"{found.recording}: amplitude against order of shaft {found.shaft}, highest peaks"
    rows: dict[str, command.Rows] = {
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

    written: dict[str, command.Rows] = {"": found.map_rows} if arguments.map else rows
    shown = [
        {name: own[name] for name in _AVERAGE_SHOWN} | channel
        for own in result["averages"]
        for channel in own["channels"]
    ]
    lines = partial(command.words, "peaks", result, title=title, rows=shown)
    return command.finish(arguments, result, lines, written, figures, rows_in_json=True)


_POSITIONS = "seat (default), hand, standing, backrest, feet or building"


@command.command(
    argument("[RECORDING...]", "on the seat, the hand or where the person is: CSV, WAV, ..."),
    argument("--axes x=A,y=B,z=C", "channels of the axes; by default named so"),
    argument("--position WHERE", _POSITIONS, "seat"),
    argument("--day PLAN", "jobs of a day with hours and recordings (TOML)"),
    argument("--floor RECORDING", "made at once on the floor: tells the SEAT factor"),
    argument("--machine MACHINE", "share of its shafts and meshes, best operating point"),
    command.FAULT,
    command.TACHO,
    command.SAMPLING_RATE,
    argument("--unit UNIT", "m/s2 or g, where nothing else states it"),
    argument("--range MS2", "of the sensor: nothing may reach it", dest="range_ms2"),
    argument("--report HTML", "write a report (.html)"),
    help="what a driver or a hand feels, by ISO 2631-1 and ISO 5349-1, and what gears add to it",
    example="gearmon exposure new.csv --position hand --axes x=a1,y=a2 --machine machine.toml "
    "-o exposure.csv",
    endings=(".csv", ".json", ".png"),
    output="write the table to this file, and pictures beside it",
    beside=("{}.png", "{}-*.png"),
    more="A plan has a [[job]] for each job of the day, with name, recording and hours. Exit code "
    "1: the day reaches an action value, of Directive 2002/44/EC or of the plan's [limits].",
)
def exposure(arguments: Namespace) -> int:
    """Run `gearmon exposure`."""
    if not arguments.recording and not arguments.day:
        raise ArgumentError("exposure: name recordings, or with --day the plan of a day")
    if arguments.fault and not arguments.machine:
        raise ArgumentError("--fault: only with --machine, whose gear it is")
    if arguments.floor and len(arguments.recording) != 1:
        raise ArgumentError("--floor: belongs to one recording, of the seat on that floor")
    named: dict[str, Told] = {}  # by what is added to the name of the output
    numbers = count(1)

    def weighed(path: str) -> dict[str, Any]:
        found = dict(_felt(path, arguments))
        number = next(numbers)
        which = f"-{number}" if number > 1 else ""
        named.update({which + (key and f"-{key}"): own for key, own in found.items()})
        told = {key: own.to_dict() for key, own in found.items()}
        return told.pop("") | {"seat_factor": None, "gearbox": None} | told

    entries = command.each_of(arguments.recording, arguments.progress, weighed)
    day = None
    if arguments.day:
        day = gearmon.exposure_day(arguments.day, arguments.axes, **_reading(arguments))
        named["-day"] = day
    told = list(named.values())
    result: dict[str, Any] = {"recordings": entries, "day": day.to_dict() if day else None}
    if arguments.report and told:
        result["report"] = str(report.write_exposure_report(told, arguments.report))

    def rows() -> list[dict[str, Any]]:
        # a row an axis of each recording, else one a job of the day
        return [row for own in told if type(own) is type(told[0]) for row in own.frame_rows()]

    def figures() -> dict[str, Any]:
        return {name: own.figures()[""] for name, own in named.items() if own.picture}

    command.finish(arguments, result, lambda: _exposure_lines(told, result), rows, figures)
    return command.judged(entries, flagged=day is not None and day.flagged)


def _felt(path: str, arguments: Namespace) -> Iterator[tuple[str, Told]]:
    """Weigh a recording, its floor, and look for the gearbox in it."""
    axes, reading = arguments.axes, _reading(arguments)
    exposure = gearmon.vibration_exposure(path, arguments.position, axes, **reading)
    yield "", exposure
    if arguments.floor:
        floor = gearmon.vibration_exposure(arguments.floor, arguments.position, axes, **reading)
        yield "seat_factor", gearmon.seat_factor(exposure, floor)
    if arguments.machine is not None:
        named = [axis.channel for axis in exposure.axes]
        known = command.given(arguments, "sampling_rate_hz", "tacho")
        known |= {"channels": named, "sensors": reading["sensors"]}
        recording = gearmon.open_recording(path, **known)
        share = gearmon.gear_share(recording, exposure, arguments.machine, arguments.fault)
        yield "gearbox", share


def _reading(arguments: Namespace) -> dict[str, Any]:
    sensors = arguments.machine.sensors if arguments.machine else ()
    return command.given(arguments, "sampling_rate_hz", "unit", "range_ms2") | {"sensors": sensors}


def _exposure_lines(told: list[Told], result: Mapping[str, Any]) -> list[str]:
    lines = [line for own in told for line in (*report.exposure_lines(own), "")]
    lines += [f"{e['recording']}: not weighed" for e in result["recordings"] if "error" in e]
    return [*lines, *([f"report: {result['report']}"] if "report" in result else [])]
