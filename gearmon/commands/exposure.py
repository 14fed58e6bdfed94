"""The command that says what people on a machine feel: exposure."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from gearmon.commands.command import SAMPLING_RATE, TACHO, command, fault, option
from gearmon.commands.inputs import channel_of, in_turn, machine_of
from gearmon.commands.output import BAD_INPUT, DONE, FLAGGED, finish
from gearmon.errors import ArgumentError

if TYPE_CHECKING:
    from gearmon.machine import Machine
    from gearmon.report.exposure_text import Told

_POSITIONS = "seat (default), hand, standing, backrest, feet or building"


@command(
    option(
        "recording",
        metavar="RECORDING",
        nargs="*",
        default=[],
        help="on the seat, the hand or where the person is: CSV, WAV, ...",
    ),
    option("--axes", metavar="x=A,y=B,z=C", help="channels of the axes; by default named so"),
    option("--position", default="seat", metavar="WHERE", help=_POSITIONS),
    option("--day", metavar="PLAN", help="jobs of a day with hours and recordings (TOML)"),
    option("--floor", metavar="RECORDING", help="made at once on the floor: tells the SEAT factor"),
    option(
        "--machine", metavar="MACHINE", help="share of its shafts and meshes, best operating point"
    ),
    fault(),
    TACHO,
    SAMPLING_RATE,
    option("--unit", metavar="UNIT", help="m/s2 or g, where nothing else states it"),
    option(
        "--range", type=float, metavar="MS2", help="of the sensor in m/s2: nothing may reach it"
    ),
    option("--report", metavar="HTML", help="write a report (.html)"),
    help="what a driver or a hand feels, by ISO 2631-1 and ISO 5349-1, and what gears add to it",
    example="gearmon exposure new.csv --position hand --axes x=a1,y=a2 --machine machine.toml "
    "-o exposure.csv",
    endings=(".csv", ".json", ".png"),
    output="write the table to this file, and pictures beside it",
    beside=("{}.png", "{}-*.png"),
    more="A plan has a [[job]] for each job of the day, with name, recording and hours. Exit code "
    "1: the day reaches an action value, of Directive 2002/44/EC or of the plan's [limits].",
)
def exposure(arguments: argparse.Namespace) -> int:
    """Run `gearmon exposure`."""
    from gearmon.exposure import exposure_day

    _check(arguments)
    machine = machine_of(arguments.machine) if arguments.machine else None
    told: list[Told] = []

    def weighed(path: str) -> dict[str, Any]:
        found = list(_felt(path, arguments, machine))
        told.extend(found)
        names = ("SeatFactor", "GearShare")
        extra = {name: own.to_dict() for own in found if (name := type(own).__name__) in names}
        more = {"seat_factor": extra.get(names[0]), "gearbox": extra.get(names[1])}
        return found[0].to_dict() | more

    entries = in_turn(arguments.recording, arguments.progress, weighed)
    day = None
    if arguments.day:
        day = exposure_day(arguments.day, _axes(arguments.axes), **_reading(arguments, machine))
        told.append(day)
    result: dict[str, Any] = {"recordings": entries, "day": day.to_dict() if day else None}
    if arguments.report and told:
        from gearmon.report.exposure_text import write_exposure_report

        result["report"] = str(write_exposure_report(told, arguments.report))
    finish(
        arguments, result, lambda: _lines(told, result), lambda: _rows(told), lambda: _drawn(told)
    )
    if any("error" in entry for entry in entries):
        return BAD_INPUT
    return FLAGGED if day is not None and day.flagged else DONE


def _check(arguments: argparse.Namespace) -> None:
    """Refuse what cannot go together, before any work is done."""
    if not arguments.recording and not arguments.day:
        raise ArgumentError("exposure: name recordings, or with --day the plan of a day")
    if arguments.fault and not arguments.machine:
        raise ArgumentError("--fault: only with --machine, whose gear it is")
    if arguments.floor and len(arguments.recording) != 1:
        raise ArgumentError("--floor: belongs to one recording, of the seat on that floor")


def _felt(path: str, arguments: argparse.Namespace, machine: Machine | None) -> Iterator[Told]:
    """Weigh a recording, its floor, and look for the gearbox in it."""
    from gearmon.exposure import gear_share, seat_factor, vibration_exposure
    from gearmon.signals.recording import open_recording

    axes, reading = _axes(arguments.axes), _reading(arguments, machine)
    exposure = vibration_exposure(path, arguments.position, axes, **reading)
    yield exposure
    if arguments.floor:
        floor = vibration_exposure(arguments.floor, arguments.position, axes, **reading)
        yield seat_factor(exposure, floor)
    if machine is not None:
        tacho = channel_of(arguments.tacho) if arguments.tacho else None
        named = [axis.channel for axis in exposure.axes]
        recording = open_recording(path, arguments.sampling_rate, named, tacho, machine.sensors)
        yield gear_share(recording, exposure, machine, arguments.fault)


def _reading(arguments: argparse.Namespace, machine: Machine | None) -> dict[str, Any]:
    return {
        "sampling_rate_hz": arguments.sampling_rate,
        "unit": arguments.unit,
        "sensors": machine.sensors if machine is not None else (),
        "range_ms2": arguments.range,
    }


def _axes(text: str | None) -> dict[str, str | int] | None:
    """Return the channel of each axis of a text such as "x=a1,y=a2,z=3"."""
    if text is None:
        return None
    pairs = [part.partition("=") for part in text.split(",")]
    if not all(mark and axis and channel for axis, mark, channel in pairs):
        raise ArgumentError(f"--axes {text}: must name channels as x=NAME,y=NAME,z=NAME or x=1,y=2")
    if len({axis for axis, _, _ in pairs}) < len(pairs):
        raise ArgumentError(f"--axes {text}: names an axis twice")
    return {axis.strip(): channel_of(channel.strip()) for axis, _, channel in pairs}


def _lines(told: list[Told], result: Mapping[str, Any]) -> list[str]:
    from gearmon.report.exposure_text import exposure_lines

    lines = [line for own in told for line in (*exposure_lines(own), "")]
    lines += [f"{e['recording']}: not weighed" for e in result["recordings"] if "error" in e]
    return [*lines, *([f"report: {result['report']}"] if "report" in result else [])]


def _rows(told: list[Told]) -> list[dict[str, Any]]:
    """Return a row an axis of each recording, else one a job of the day."""
    from gearmon.exposure import DayExposure, Exposure

    rows = [row for own in told if isinstance(own, Exposure) for row in own.frame_rows()]
    return rows or [row for own in told if isinstance(own, DayExposure) for row in own.frame_rows()]


def _drawn(told: list[Told]) -> dict[str, Any]:
    """Return the pictures by what is added to the name: of several recordings their numbers."""
    figures: dict[str, Any] = {}
    number = 0
    added = {"GearShare": "-gearbox", "DayExposure": "-day"}
    for own in told:
        number += type(own).__name__ == "Exposure"
        if own.picture:
            which = f"-{number}" if number > 1 and type(own).__name__ != "DayExposure" else ""
            figures[which + added.get(type(own).__name__, "")] = own.figures()[""]
    return figures
