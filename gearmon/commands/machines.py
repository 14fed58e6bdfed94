"""Commands that start from a machine file: lines, stiffness, baseline, harvest and more."""

from __future__ import annotations

import math
from argparse import Namespace
from dataclasses import fields
from functools import partial
from typing import TYPE_CHECKING, Any

import gearmon
from gearmon import report
from gearmon.commands import command
from gearmon.commands.command import argument
from gearmon.errors import ArgumentError
from gearmon.report.wording import table_lines
from gearmon.terminal import followed

if TYPE_CHECKING:
    from gearmon.signatures.expected.fault_family import FaultFamily
    from gearmon.signatures.expected.modes import Modes

#: Natural over mesh frequency up to which the instability is searched for, and drawn: beyond, the
#: tongues are many and too narrow to be seen.
MOST_RATIO_SEARCHED, MOST_RATIO_DRAWN = 50.0, 15.0
CHART_POINTS = (120, 48)
#: What the terminal does not show of each member of a family.
HIDDEN_OF_FAMILY = {"teeth", "lines", "method"}
MOST_MODES, MOST_MEETINGS, MOST_LINES = 60, 20, 30
#: What it shows of each stage of a signature.
_STAGE_SHOWN = (
    *("stage", "mesh_frequency_hz", "mean_stiffness_n_per_m", "stiffness_variation"),
    *("contact_ratio", "natural_frequency_hz", "damping_ratio", "error_bound", "error_estimate"),
)
#: What is told of each stage's equation beside its stability.
_PROBLEM_SHOWN = ("natural_frequency_hz", "frequency_ratio", "damping_ratio")
#: What is assumed of expected lines, and known of recordings.
ASSUMED = ("path_gain", "wander", "wander_time_s")
#: Settings of a simulation.
_SETTINGS: dict[str, tuple[str, str, float]] = {
    "duration_s": ("--duration S", "length in s", 10.0),
    "sampling_rate_hz": ("--sampling-rate HZ", "in Hz", 20000.0),
    "channels": ("--channels N", "vibration channels", 2),
    "load": ("--load F", "share of the nominal torque", 1.0),
    "speed_drift": ("--speed-drift F", "wander, relative", 0.005),
    "load_drift": ("--load-drift F", "wander, relative", 0.03),
    "snr_db": ("--snr-db DB", "vibration over noise", 20.0),
    "recording_seed": ("--seed N", "seed of the recording", 0),
    "machine_seed": ("--machine-seed N", "seed of the machine", 0),
}
_STAGE = argument("--stage N", "only this stage, from 1")
_FORM = argument("--form FORM", "stiffness form (parabolic)", "parabolic")
_MAX_HZ = argument("--max-hz F", "no lines above this frequency")


@command.command(
    command.MACHINE,
    help="orders and frequencies of every shaft, mesh, assembly phase, hunting tooth and bearing",
    example="gearmon lines machine.toml",
)
def lines(arguments: Namespace) -> int:
    """Run `gearmon lines`."""
    from gearmon.gears.kinematics import line_table

    table = line_table(arguments.machine)
    return command.finish(arguments, table, lambda: [report.line_table_text(table)])


@command.command(
    command.MACHINE,
    command.FAULT,
    argument(
        "--form FORM",
        "stiffness form (potential-energy), or all: four forms and their spectra side by side",
        "potential-energy",
    ),
    _STAGE,
    help="mesh stiffness over a mesh period or a turn, healthy and damaged, as table and picture",
    example="gearmon stiffness machine.toml --fault crack:1:pinion:5:1.5mm -o stiffness.csv",
    beside=("{}.png", "{}-stage*.png"),
)
def stiffness(arguments: Namespace) -> int:
    """Run `gearmon stiffness`."""
    from gearmon.gears.stiffness_report import compare_forms, stiffness_report

    machine = arguments.machine
    if arguments.form == "all":
        if arguments.fault:
            raise ArgumentError(
                "--form all: compares healthy meshes; leave out --fault, or name a form"
            )
        forms = compare_forms(machine, stage=arguments.stage or 1)
        return command.finish(arguments, forms, lambda: table_lines(forms.spectrum))
    named = command.given(arguments, "form", "stage")
    report = stiffness_report(machine, arguments.fault, **named)
    return command.finish(arguments, report, lambda: _thinned(report.rows(), "rows"))


def _thinned(rows: list[dict[str, Any]], what: str) -> list[str]:
    """Show some forty of the rows, evenly taken: a file holds them all."""
    shown = rows[:: max(1, len(rows) // 40)]
    told = f"({len(shown)} of {len(rows)} {what}; --json or -o FILE gives them all)"
    return [*table_lines(shown), *([told] if len(shown) < len(rows) else [])]


@command.command(
    command.MACHINE,
    command.FAULT_OR_ERROR,
    argument("--tolerance X", "relative error of the acceleration", 1e-6),
    _MAX_HZ,
    help="the spectrum that a healthy (or damaged) machine should emit, as table and picture",
    example="gearmon baseline machine.toml --fault crack:1:pinion:5:20% -o lines.csv",
    endings=(".csv", ".json", ".parquet"),
    beside=("{}.png",),
)
def baseline(arguments: Namespace) -> int:
    """Run `gearmon baseline`."""
    settings = command.given(arguments, "tolerance", "max_hz")
    signature = gearmon.expected_signature(arguments.machine, arguments.fault, **settings)
    lines, write = partial(_baseline_lines, signature), partial(gearmon.write_signature, signature)
    return command.finish(arguments, signature, lines, write=write)


def _baseline_lines(signature: gearmon.Signature) -> list[str]:
    stages, rows = signature.header["stages"], list(signature.rows())
    shown = [{name: stage[name] for name in _STAGE_SHOWN} for stage in stages]
    strongest = sorted(rows, key=lambda row: -row["acceleration_ms2"])[:MOST_LINES]
    strongest.sort(key=lambda row: row["frequency_hz"])
    known = {"stages": stages, "shown": shown, "strongest": strongest, "count": len(rows)}
    return command.words("baseline", known)


@command.command(
    command.MACHINE,
    argument(
        "--kind KIND...",
        "stiffness, crack, breakage, pitting, spall, wear or missing; of errors pitch, profile, "
        "cumulative, eccentricity or misalignment (nine of these)",
        dest="kinds",
    ),
    argument(
        "--size SIZE...",
        "such as 20%% or 1.5mm, of errors 20um (2.5%% to 40%%, 5um to 40um)",
        dest="sizes",
    ),
    argument("--gear STAGE:GEAR...", "such as 1:pinion (all)", dest="gears"),
    argument("--operating N...", "operating point, from 0 (all)"),
    argument("--tolerance X", "relative error of what a fault adds", 1e-6),
    _MAX_HZ,
    argument("--mesh-harmonics N", "write no lines about higher ones"),
    argument("--sidebands N", "write no sidebands farther off"),
    help="the spectra of every kind and size of fault of every gear, as table and picture",
    example="gearmon family machine.toml --kind crack --kind pitting --size 5% --size 20% -o f.csv",
    endings=(".csv", ".json", ".parquet"),
    beside=("{}.png",),
)
def family(arguments: Namespace) -> int:
    """Run `gearmon family`."""
    named = command.given(arguments, "kinds", "sizes", "gears", "operating", "max_hz", "tolerance")
    family = gearmon.fault_family(arguments.machine, **named)
    if not len(family):
        raise ArgumentError("no fault is left: " + "; ".join(family.notes))

    def write(path: str) -> None:
        table = family.table(arguments.mesh_harmonics, arguments.sidebands)
        gearmon.write_signature(table, path)

    return command.finish(arguments, family, partial(_family_lines, family), write=write)


def _family_lines(family: FaultFamily) -> list[str]:
    rows = [{k: row[k] for k in row if k not in HIDDEN_OF_FAMILY} for row in family.rows()]
    return [*_thinned(rows, "members"), *(f"note: {note}" for note in family.notes)]


@command.command(
    command.MACHINE,
    _FORM,
    _STAGE,
    argument("--harmonics N", "stiffness harmonics taken", 12),
    help="how far each mesh is from parametric instability, as table and chart",
    example="gearmon stability machine.toml -o stability.csv",
    beside=("{}-stage*.png",),
)
def stability(arguments: Namespace) -> int:
    """Run `gearmon stability`."""
    from gearmon.dynamics.stability import stability_margin
    from gearmon.signatures.expected.mesh import mesh_problem

    machine = arguments.machine
    stages = [arguments.stage] if arguments.stage else range(1, len(machine.stages) + 1)
    named, rows = command.given(arguments, "form", "harmonics"), []
    problems = {stage: mesh_problem(machine, stage, **named) for stage in stages}
    for stage, p in problems.items():
        margin = stability_margin(p, search=p.frequency_ratio <= MOST_RATIO_SEARCHED)
        factor = margin.variation_factor
        row = {"stage": stage, "mesh_frequency_hz": 1 / p.period_s}
        row |= {name: getattr(p, name) for name in _PROBLEM_SHOWN}
        row |= {"stable": margin.stable, "largest_multiplier": abs(margin.multipliers[0])}
        row["unstable_at_variation_times"] = factor if math.isfinite(factor) else None
        rows.append(row | {"says": margin.message})
    result: dict[str, Any] = {"machine": machine.name, "rows": rows}

    def charts() -> dict[str, Any]:
        from gearmon.dynamics.stability import stability_map_of

        drawn = {s: p for s, p in problems.items() if p.frequency_ratio <= MOST_RATIO_DRAWN}
        steps = followed(drawn.items(), len(drawn), arguments.progress)
        maps = ((stage, stability_map_of(problem, points=CHART_POINTS)) for stage, problem in steps)
        return {f"-stage{stage}": report.stability_figure(own) for stage, own in maps}

    return command.finish(arguments, result, lambda: table_lines(rows), lambda: rows, charts)


@command.command(
    command.MACHINE,
    argument("--harmonics N", "mesh harmonics of the Campbell table", 10),
    argument("--to-rpm RPM", "its highest speed of shaft 1 (1.5 x nominal)", dest="highest_rpm"),
    _FORM,
    help="natural frequencies of the whole machine, and at which speeds mesh harmonics meet them",
    example="gearmon modes machine.toml -o modes.csv",
    beside=("{}.png", "{}-campbell.*"),
)
def modes(arguments: Namespace) -> int:
    """Run `gearmon modes`."""
    from gearmon.signatures.expected.modes import Meeting

    named = command.given(arguments, "harmonics", "highest_rpm", "form")
    found = gearmon.modes(arguments.machine, **named)
    tables = {"": found.frame_rows, "-campbell": found.campbell_rows}
    columns = [own.name for own in fields(Meeting)]
    return command.finish(arguments, found, lambda: _modes_lines(found), tables, columns=columns)


def _modes_lines(found: Modes) -> list[str]:
    listed = [
        {
            "mode": mode.number,
            "frequency_hz": mode.frequency_hz,
            "damping_ratio": float(f"{mode.damping_ratio:.3g}"),
            "type": mode.type,
            "strain energy": mode.strained(),
        }
        for mode in found.rows[:MOST_MODES]
    ]
    met = [own for own in found.campbell if own.drives]
    near = sorted(met, key=lambda own: abs(math.log(own.speed_rpm / found.speeds_rpm[0])))
    meetings = sorted(near[:MOST_MEETINGS], key=lambda own: own.speed_rpm)
    known: dict[str, Any] = {"modes": listed, "meetings": found.campbell_rows(meetings)}
    known |= {"all_modes": len(found.rows), "all_meetings": len(met), "rpm": found.speeds_rpm[0]}
    return command.words("modes", known | {"notes": found.notes, "headline": found.headline()})


@command.command(
    command.MACHINE,
    command.FAULT_OR_ERROR,
    *(argument(*told, dest=name) for name, told in _SETTINGS.items()),
    argument("--tacho", "add a column with one pulse a turn of shaft 1"),
    argument("--no-time", "leave out the time column"),
    help="write a recording of a simulated machine (CSV), with the truth beside it (JSON)",
    example="gearmon simulate machine.toml --fault crack:1:pinion:5:20% -o cracked.csv",
    endings=(".csv",),
    output="write the recording to this file; needed",
    beside=("{}.json",),
)
def simulate(arguments: Namespace) -> int:
    """Run `gearmon simulate`."""
    from gearmon.simulation import write_simulation

    settings = command.given(arguments, *_SETTINGS, "progress")
    settings["tacho_shaft"] = 1 if arguments.tacho else None
    recording = gearmon.simulate(arguments.machine, arguments.fault, **settings)
    files = write_simulation(recording, arguments.output, with_time=not arguments.no_time)
    result = {"recording": str(files[0]), "truth": str(files[1])}
    return command.show(arguments, result, lambda: [f"wrote {files[0]} and {files[1]}"])


@command.command(
    command.MACHINE,
    argument(
        "[RECORDING...]",
        "one for each operating point, every vibration channel a position; without any, the "
        "expected lines of the machine are used",
    ),
    argument("--harvester FILE", "harvester file (TOML); a 15 mm bimorph by default"),
    argument("--count N", "harvesters of a set, 1 to 3", 1),
    argument("--share F...", "share of time of each recording, in their order", dest="shares"),
    argument("--degraded RECORDING...", "the same points with a damaged gear, in the same order"),
    command.FAULT,
    argument("--path-gain G", "mesh to harvester (1)"),
    argument("--wander F", "of speed, relative (0.005)"),
    argument(
        "--wander-time S", "its correlation time (long beside a ring-down)", dest="wander_time_s"
    ),
    argument("--published", "show published harvesters beside the best one"),
    argument("--share-error F", "standard deviation of the shares (0)"),
    command.SAMPLING_RATE,
    argument("--channel NAME|N...", "only these channels"),
    command.TACHO,
    help="say where to put a vibration energy harvester, how to tune it and what it will power",
    example="gearmon harvest machine.toml full.csv idle.csv --share 0.7 --share 0.3 "
    "-o harvest.json",
    output="write the result to this file, and pictures beside it",
    beside=("{}-energy.png", "{}-tuning.png", "{}-positions.png", "{}-response.png"),
)
def harvest(arguments: Namespace) -> int:
    """Run `gearmon harvest`."""
    from gearmon.harvesting.placement import survey_expected, survey_measured
    from gearmon.harvesting.tuning import built_in, load_harvester

    machine = arguments.machine
    harvester, budget = load_harvester(arguments.harvester) if arguments.harvester else built_in()
    of_recordings = ("shares", "share_error", "degraded", "channel", "sampling_rate_hz")
    wrong = dict.fromkeys(of_recordings, "only beside recordings; name them after the machine")
    if arguments.recording:
        wrong = dict.fromkeys(ASSUMED, "only for expected lines; recordings hold their own")
        wrong["fault"] = "only for expected lines; give --degraded RECORDING beside recordings"
        if not arguments.shares:
            wrong["share_error"] = "only beside --share"
    for name in command.given(arguments, *wrong):
        option = name.removesuffix("_hz").removesuffix("_s").removesuffix("s").replace("_", "-")
        raise ArgumentError(f"--{option}: {wrong[name]}")
    if arguments.recording:
        read, damaged = (
            [command.recording_of(path, arguments) for path in paths]
            for paths in (arguments.recording, arguments.degraded)
        )
        named = command.given(arguments, "shares", "share_error", "count", "progress")
        survey = survey_measured(machine, harvester, read, budget, degraded=damaged, **named)
    else:
        named = command.given(arguments, "count", *ASSUMED)
        survey = survey_expected(machine, harvester, budget, faults=arguments.fault, **named)
    return command.finish(
        arguments, survey, lambda: report.harvest_lines(survey, published=arguments.published)
    )
