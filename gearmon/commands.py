"""One function a command: arguments -> one call -> output and exit code."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gearmon.errors import ArgumentError, GearmonError
from gearmon.terminal import progress_bar

if TYPE_CHECKING:
    from gearmon.diagnosis.results import Analysis
    from gearmon.machine import Machine
    from gearmon.signals.recording import Recording
    from gearmon.signatures.reference import Reference

DONE, FLAGGED, BAD_INPUT = 0, 1, 2


def check_names(arguments: argparse.Namespace) -> None:
    """Refuse names of files that cannot work, before any work is done.

    Parameters
    ----------
    arguments : argparse.Namespace
        Parsed arguments.

    Raises
    ------
    ArgumentError
        If a name is empty, has the wrong ending, or would be written over what is read.
    """
    given = vars(arguments)
    for name in ("output", "report", "reference", "tacho", "machine", "harvester"):
        if given.get(name) == "":
            raise ArgumentError(f"--{name}: the name is empty")
    inputs = [*given.get("recording", ()), *given.get("degraded", ())]
    inputs += [given.get(name) for name in ("machine", "reference", "harvester")]
    read = {Path(path).resolve() for path in inputs if path}
    for name in ("output", "report"):
        path = given.get(name)
        if path and Path(path).resolve() in read:
            raise ArgumentError(f"{path}: is read as well; give another name to write to")
    if given.get("report") and Path(given["report"]).suffix.lower() not in (".html", ".htm"):
        raise ArgumentError(f"{given['report']}: the name of a report must end in .html")
    endings = _ENDINGS.get(arguments.command)
    if given.get("output") and endings and Path(given["output"]).suffix.lower() not in endings:
        listed = ", ".join(endings)
        raise ArgumentError(f"{given['output']}: the name must end in one of {listed}")


_ENDINGS = {
    "lines": (".csv", ".json"),
    "stiffness": (".csv", ".json"),
    "baseline": (".csv", ".json", ".parquet"),
    "simulate": (".csv",),
    "analyse": (".json",),
    "harvest": (".csv", ".json"),
    "benchmark": (".csv", ".json"),
}


def run_lines(arguments: argparse.Namespace) -> int:
    """Run `gearmon lines`."""
    from gearmon.gears.kinematics import line_table
    from gearmon.report.text import line_table_text
    from gearmon.report.text_tables import rows_as_csv

    table = line_table(_machine(arguments.machine))
    result = table.to_dict()
    if arguments.output:
        _write_table(arguments.output, result, lambda: rows_as_csv(result["rows"]))
    _show(arguments, result, lambda: [line_table_text(table)])
    return DONE


def run_stiffness(arguments: argparse.Namespace) -> int:
    """Run `gearmon stiffness`."""
    from gearmon.gears.stiffness_report import stiffness_report
    from gearmon.report.text_tables import rows_as_csv, table_lines

    report = stiffness_report(
        _machine(arguments.machine),
        tuple(arguments.fault),
        form=arguments.form,
        stage=arguments.stage,
    )
    result = report.to_dict()
    if arguments.output:
        from gearmon.report.stiffness_plots import save_stiffness_figures

        _write_table(arguments.output, result, lambda: rows_as_csv(report.rows()))
        picture = Path(arguments.output).with_suffix(".png")
        result["pictures"] = [str(path) for path in save_stiffness_figures(report, picture)]
    _show(arguments, result, lambda: _stiffness_lines(result, report.rows(), table_lines))
    return DONE


def _stiffness_lines(
    result: dict[str, Any],
    rows: list[dict[str, Any]],
    table_lines: Callable[[list[dict[str, Any]]], list[str]],
) -> list[str]:
    """Show some forty of the rows: the file holds them all."""
    shown = rows[:: max(1, len(rows) // 40)]
    lines = table_lines(shown)
    lines.append(f"({len(shown)} of {len(rows)} rows; -o FILE.csv writes them all, and a picture)")
    return lines + [f"wrote {path}" for path in result.get("pictures", ())]


def run_baseline(arguments: argparse.Namespace) -> int:
    """Run `gearmon baseline`."""
    from gearmon.signatures.expected import expected_signature
    from gearmon.signatures.listing import signature_lines
    from gearmon.signatures.signature import write_signature

    signature = expected_signature(
        _machine(arguments.machine),
        faults=tuple(arguments.fault),
        tolerance=arguments.tolerance,
        max_hz=arguments.max_hz,
    )
    if arguments.output:
        write_signature(signature, arguments.output)
    _show(arguments, signature.to_dict(), lambda: signature_lines(signature))
    return DONE


def run_simulate(arguments: argparse.Namespace) -> int:
    """Run `gearmon simulate`."""
    from gearmon.gears.faults import parse_fault
    from gearmon.simulation import simulate, write_simulation

    if not arguments.output:
        raise ArgumentError("simulate: -o PATH is missing; name the CSV file to write")
    machine = _machine(arguments.machine)
    faults = [parse_fault(text) for text in arguments.fault]
    with progress_bar("simulating") as progress:
        recording = simulate(
            machine,
            faults,
            duration_s=arguments.duration,
            sampling_rate_hz=arguments.sampling_rate,
            machine_seed=arguments.machine_seed,
            recording_seed=arguments.seed,
            channels=arguments.channels,
            load=arguments.load,
            speed_drift=arguments.speed_drift,
            load_drift=arguments.load_drift,
            snr_db=arguments.snr_db,
            tacho_shaft=1 if arguments.tacho else None,
            progress=progress,
        )
    files = write_simulation(recording, arguments.output, with_time=not arguments.no_time)
    result = {"recording": str(files[0]), "truth": str(files[1])}
    _show(arguments, result, lambda: [f"wrote {files[0]} and {files[1]}"])
    return DONE


def run_learn(arguments: argparse.Namespace) -> int:
    """Run `gearmon learn`."""
    from gearmon.report.text import reference_text
    from gearmon.signatures.measured import measure_signature
    from gearmon.signatures.reference import make_reference, write_reference

    if not arguments.output:
        raise ArgumentError("learn: -o REFERENCE is missing; name the reference file to write")
    machine = _machine(arguments.machine)
    signatures = [
        measure_signature(_recording(path, arguments, machine), machine)
        for path in _followed(arguments.recording, "learning")
    ]
    reference = make_reference(signatures, machine)
    write_reference(reference, arguments.output)
    result = {
        "reference": arguments.output,
        "machine": reference.machine,
        "channels": list(reference.channel_names),
        "families": len(reference.family_names),
        "recordings": [
            {"recording": s.origin, "speed": s.speed.to_dict(), "warnings": list(s.notes)}
            for s in signatures
        ],
    }
    _show(arguments, result, lambda: [reference_text(reference), f"wrote {arguments.output}"])
    return DONE


def run_analyse(arguments: argparse.Namespace) -> int:
    """Run `gearmon analyse`."""
    machine = _machine(arguments.machine)
    reference = _reference(arguments, machine)
    kept: list[tuple[Analysis, Recording | None]] = []
    results = [
        _analysed(path, arguments, machine, reference, kept)
        for path in _followed(arguments.recording, "analysing")
    ]
    result: dict[str, Any] = {"recordings": results}
    if arguments.report and kept:
        from gearmon.report.html import Failure, write_report

        analyses, recordings = [a for a, _ in kept], [r for _, r in kept]
        failures = [
            Failure(recording=entry["recording"], message=entry["error"])
            for entry in results
            if "error" in entry
        ]
        files = write_report(
            analyses, recordings, reference, machine, arguments.report, failures=failures
        )
        result["report"] = [str(file) for file in files]
    if arguments.output:
        _write_json(arguments.output, result)
    _show(arguments, result, lambda: _analysis_lines(result, [a for a, _ in kept]))
    if any("error" in entry for entry in results):
        return BAD_INPUT
    return FLAGGED if any(entry["flags"] for entry in results) else DONE


def _analysed(
    path: str,
    arguments: argparse.Namespace,
    machine: Machine,
    reference: Reference | None,
    kept: list[tuple[Analysis, Recording | None]],
) -> dict[str, Any]:
    """Analyse one recording; a bad one is reported in its place."""
    from gearmon.diagnosis.analysis import analyse

    try:
        recording = _recording(path, arguments, machine)
        analysis = analyse(recording, machine, reference)
    except GearmonError as error:
        print(f"gearmon: {error}", file=sys.stderr)
        return {"recording": path, "error": str(error)}
    if arguments.report or not arguments.json:
        # only a report draws the samples
        kept.append((analysis, recording if arguments.report else None))
    return analysis.to_dict()


def _analysis_lines(result: dict[str, Any], analyses: list[Analysis]) -> list[str]:
    from gearmon.report.text import analysis_text

    lines = [text for analysis in analyses for text in (analysis_text(analysis), "")]
    lines += [f"{e['recording']}: not analysed" for e in result["recordings"] if "error" in e]
    if "report" in result:
        lines.append(f"report: {result['report'][0]} and {len(result['report']) - 1} pictures")
    return lines


def _reference(arguments: argparse.Namespace, machine: Machine) -> Reference | None:
    from gearmon.diagnosis.analysis import learn
    from gearmon.signatures.reference import is_reference, read_reference

    if not arguments.reference:
        return None
    path = Path(arguments.reference)
    if is_reference(path) or not path.is_file():
        return read_reference(path)
    return learn([_recording(str(path), arguments, machine)], machine)


def run_harvest(arguments: argparse.Namespace) -> int:
    """Run `gearmon harvest`."""
    from gearmon.harvesting.request import built_in, load_harvester
    from gearmon.harvesting.survey import survey_expected, survey_measured
    from gearmon.report.harvest_text import harvest_lines
    from gearmon.report.text_tables import rows_as_csv

    machine = _machine(arguments.machine)
    harvester, budget = load_harvester(arguments.harvester) if arguments.harvester else built_in()
    if arguments.recording:
        _refuse_with_recordings(arguments)
        survey = survey_measured(
            machine,
            harvester,
            [_recording(path, arguments, machine) for path in arguments.recording],
            budget,
            shares=arguments.share or (),
            degraded=[_recording(path, arguments, machine) for path in arguments.degraded],
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
        )
    result = survey.to_dict()
    if arguments.output:
        from gearmon.report.harvest_plots import save_harvest_figures

        _write_table(arguments.output, result, lambda: rows_as_csv(survey.rows()))
        pictures = save_harvest_figures(survey, Path(arguments.output).with_suffix(".png"))
        result["pictures"] = [str(path) for path in pictures]
    _show(
        arguments,
        result,
        lambda: harvest_lines(survey) + [f"wrote {path}" for path in result.get("pictures", ())],
    )
    return DONE


def _refuse_with_recordings(arguments: argparse.Namespace) -> None:
    if arguments.fault:
        raise ArgumentError(
            "--fault: only for expected lines; give --degraded RECORDING beside recordings"
        )


def _refuse_without_recordings(arguments: argparse.Namespace) -> None:
    for name in ("share", "degraded", "channel"):
        if getattr(arguments, name):
            raise ArgumentError(f"--{name}: only beside recordings; name them after the machine")


def run_demo(arguments: argparse.Namespace) -> int:
    """Run `gearmon demo`."""
    from gearmon.demo import run_demo

    result = run_demo(arguments.name, Path(arguments.output or "gearmon-demo"))
    _show(arguments, result.to_dict(), result.lines)
    return DONE


def run_benchmark(arguments: argparse.Namespace) -> int:
    """Run `gearmon benchmark`."""
    from gearmon.benchmark import run_case
    from gearmon.report.text_tables import rows_as_csv, table_lines

    with progress_bar("measuring") as progress:
        rows = run_case(arguments.case, progress)
    result = {"case": arguments.case, "rows": rows}
    if arguments.output:
        _write_table(arguments.output, result, lambda: rows_as_csv(rows))
    _show(arguments, result, lambda: table_lines(rows))
    return DONE


def _machine(path: str) -> Machine:
    from gearmon.machine import load_machine

    return load_machine(path)


def _recording(path: str, arguments: argparse.Namespace, machine: Machine) -> Recording:
    from gearmon.signals.recording import read_recording

    return read_recording(
        path,
        sampling_rate_hz=arguments.sampling_rate,
        channels=[_channel(text) for text in arguments.channel] if arguments.channel else None,
        tacho=_channel(arguments.tacho) if arguments.tacho else None,
        sensors=machine.sensors,
    )


def _channel(text: str) -> str | int:
    return int(text) if text.isdecimal() else text


def _followed(paths: Iterable[str], what: str) -> Iterator[str]:
    """Give the paths, with a progress bar if there are several and a terminal to show it."""
    listed = list(paths)
    if len(listed) < 2:
        yield from listed
        return
    with progress_bar(what) as progress:
        for number, path in enumerate(listed):
            yield path
            if progress is not None:
                progress((number + 1) / len(listed))


def _show(arguments: argparse.Namespace, result: Any, lines: Callable[[], Iterable[str]]) -> None:
    if arguments.json:
        json.dump(result, sys.stdout, indent=1, ensure_ascii=False, allow_nan=False)
        print()
        return
    for line in lines():
        print(line)


def _write_table(path: str, result: Any, as_csv: Callable[[], str]) -> None:
    if Path(path).suffix.lower() == ".csv":
        from gearmon.files import write_atomically

        write_atomically(path, as_csv())
        return
    _write_json(path, result)


def _write_json(path: str, result: Any) -> None:
    from gearmon.files import write_atomically

    if Path(path).suffix.lower() != ".json":
        raise ArgumentError(f"{path}: the name must end in .json (or .csv, where there is a table)")
    text = json.dumps(result, indent=1, ensure_ascii=False, allow_nan=False)
    write_atomically(path, text + "\n")
