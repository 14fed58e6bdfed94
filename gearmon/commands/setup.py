"""Commands for a start: init, demo and benchmark."""

from __future__ import annotations

import json
import re
import sys
import tomllib
from argparse import Namespace
from functools import partial
from pathlib import Path
from typing import Any

import gearmon
from gearmon.commands import command
from gearmon.commands.command import argument
from gearmon.errors import ArgumentError
from gearmon.files import write_atomically
from gearmon.report.wording import table_lines, template
from gearmon.units import is_unit

# Gears of one stage reduce by up to 8 or 10 (Niemann, Maschinenelemente II); beyond, a tooth count
# is rather mistyped. A shaft slower than the second is rather told in Hz than in 1/min.
_USUAL_RATIO, _SLOWEST_RPM = 10.0, 100.0
_SPEED = re.compile(r"\s*([0-9]*[.,]?[0-9]+)\s*(rpm|1/min|hz|)\s*", re.IGNORECASE)
_TEETH = re.compile(r"\s*(\d+)\s*/\s*(\d+)\s*(?:/\s*(\d+)\s*x\s*(\d+))?\s*", re.IGNORECASE)


@command.command(
    argument("[RECORDING...]", "one that tells the columns"),
    argument("--teeth A/B...", "of a stage, driver/driven; sun/planet/ring x planets: 30/35/100x3"),
    argument("--speed SPEED", "of shaft 1 with its unit: 1480rpm or 24.7hz"),
    argument("--torque NM", "on shaft 1", dest="torque_nm"),
    argument("--module MM", "of all stages", dest="module_mm"),
    argument("--face-width MM", "of all stages", dest="face_width_mm"),
    argument("--name NAME", "of the machine", "my gearbox"),
    command.SAMPLING_RATE,
    help="write a machine file from tooth counts and speed, and the columns of a recording",
    example="gearmon init new.csv --teeth 23/57 --speed 1480rpm -o mine.toml",
    endings=(".toml",),
    waits=True,
    output="write the machine file to this file; needed",
    more="What is not given is asked for. It is said where numbers look mistaken: a speed in Hz, a "
    "time in ms, swapped tooth counts.",
)
def init(arguments: Namespace) -> int:
    """Run `gearmon init`."""
    from gearmon.gears.kinematics import kinematics

    teeth = arguments.teeth or [_asked("teeth", "teeth of the first stage, driver/driven: ")]
    stages = [_stage(text) for text in teeth]
    rpm = _rpm(arguments.speed or _asked("speed", "speed of shaft 1, such as 1480rpm or 24.7hz: "))
    # a string of JSON is one of TOML, but for DEL, which the latter wants escaped too
    name = json.dumps(arguments.name, ensure_ascii=False).replace("\x7f", "\\u007f")
    known = {"name": name, "rpm": rpm, "stages": stages, "given": vars(arguments)}
    written = partial(template("init.toml", "gearmon.commands").render, known, is_unit=is_unit)
    text = written(columns=())
    machine = gearmon.load_machine(tomllib.loads(text))
    meshes = [mesh.order * rpm / 60.0 for mesh in kinematics(machine).meshes]
    notes = _doubts(machine)
    if arguments.recording:
        # it shows what the columns are
        found = gearmon.read_recording(arguments.recording[0], arguments.sampling_rate_hz)
        if found.sampling_rate_hz < 2.0 * max(meshes):
            raise ArgumentError(
                f"{arguments.recording[0]}: sampled at {found.sampling_rate_hz:.6g} Hz, too slow "
                f"for {machine.name} with a mesh at {max(meshes):.6g} Hz; is the time in ms (name "
                "the column time_ms), or the speed in Hz?"
            )
        columns = found.columns, found.channel_names, found.channel_kinds, found.units
        text = written(columns=zip(*columns, strict=True))
        notes += list(found.notes)
    write_atomically(arguments.output, text)
    result = {"machine": arguments.output, "mesh_hz": meshes, "warnings": notes}
    lines = [f"meshes at nominal speed: {', '.join(f'{own:.4g} Hz' for own in meshes)}"]
    lines += [*(f"note: {note}" for note in notes), f"wrote {arguments.output}"]
    return command.show(arguments, result, lambda: lines)


def _asked(option: str, question: str) -> str:
    """Ask for what no option told, if there is somebody to answer."""
    if not sys.stdin.isatty():
        raise ArgumentError(f"init: --{option} is missing")
    sys.stderr.write(question)
    return sys.stdin.readline().strip()


def _rpm(text: str) -> float:
    """Return a speed in 1/min; refuse a number that may be in either unit."""
    match = _SPEED.fullmatch(text)
    if match is None:
        raise ArgumentError(f"--speed {text}: must be a number with its unit: 1480rpm or 24.7hz")
    number, unit = float(match[1].replace(",", ".")), match[2].lower()
    if not unit and number < _SLOWEST_RPM:
        raise ArgumentError(
            f"--speed {text}: {number:g} 1/min is slow for a shaft 1; write {number:g}hz if it is "
            f"in Hz ({60 * number:g} 1/min), {number:g}rpm if it is not"
        )
    return 60.0 * number if unit == "hz" else number


def _stage(text: str) -> list[str]:
    """Return the tooth counts of a stage: two, or three and the number of planets."""
    match = _TEETH.fullmatch(text)
    if match is None:
        raise ArgumentError(
            f"--teeth {text}: must be driver/driven, such as 23/57, or sun/planet/ring and "
            "planets, such as 30/35/100x3"
        )
    return [own for own in match.groups() if own is not None]


def _doubts(machine: gearmon.Machine) -> list[str]:
    """Name tooth counts that are rather mistyped than meant."""
    from gearmon.machine import ParallelStage

    notes = list(machine.notes)
    for place, stage in enumerate(machine.stages, start=1):
        if not isinstance(stage, ParallelStage):
            continue
        pinion, gear = stage.pinion_teeth, stage.gear_teeth
        ratio = max(pinion, gear) / min(pinion, gear)
        if pinion > gear:
            told = f"{pinion} teeth drive {gear}: it speeds up by {ratio:.3g}"
            notes.append(f"stage {place}: {told}; if it slows down, swap them")
        if ratio > _USUAL_RATIO:
            told = f"a ratio of {ratio:.3g} is more than one stage usually has"
            notes.append(f"stage {place}: {told}; look at the tooth counts again")
    return notes


@command.command(
    argument(
        "[NAME]",
        "crack (found; default), growth (of a crack), kinds (pitting, wear and eccentricity "
        "told apart), day (of a sound machine), harvest, exposure (of a driver), fleet (of twelve "
        "machines), study",
        "crack",
    ),
    endings=(),
    help="run a whole job on data it makes itself",
    example="gearmon demo growth",
    output="write into this folder (gearmon-NAME)",
    folder=True,
)
def demo(arguments: Namespace) -> int:
    """Run `gearmon demo`."""
    from gearmon.demos import run_demo

    usual = "gearmon-demo" if arguments.name == "crack" else f"gearmon-{arguments.name}"
    result = run_demo(arguments.name, Path(arguments.output or usual), arguments.progress)
    return command.show(arguments, result.to_dict(), result.lines)


@command.command(
    argument("--quick", "rough figures in seconds"),
    argument("--seed N", "of what is drawn at random", 0),
    argument("--count N", "random systems, parameter sets or machines"),
    argument(
        "[CASE]",
        "analyse (default), memory, stiffness, signals, harvesting, dynamics, stress or detection",
        "analyse",
    ),
    help="measure run time, memory and error, side by side with named competitors",
    example="gearmon benchmark dynamics --quick -o benchmark.csv",
    beside=("{}.png", "{}-*.png"),
)
def benchmark(arguments: Namespace) -> int:
    """Run `gearmon benchmark`."""
    from gearmon.benchmark import PICTURED, case_figures, run_case, summary_rows

    named = command.given(arguments, "quick", "seed", "count")
    rows = run_case(arguments.case, arguments.progress, **named)
    result: dict[str, Any] = {"case": arguments.case, "rows": rows}
    figures = partial(case_figures, arguments.case, rows) if arguments.case in PICTURED else None
    lines = partial(summary_rows, arguments.case, rows)
    return command.finish(arguments, result, lambda: table_lines(lines()), lambda: rows, figures)
