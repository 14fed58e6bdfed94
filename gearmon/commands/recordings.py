"""Commands that judge recordings: learn, analyse."""

from __future__ import annotations

import argparse
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gearmon.commands.command import Command
from gearmon.commands.inputs import each_of, followed, loss_of, machine_of, recording_of
from gearmon.commands.options import recording_options
from gearmon.commands.output import BAD_INPUT, DONE, FLAGGED, UNJUDGED, show, write_json
from gearmon.errors import ArgumentError, GearmonError

if TYPE_CHECKING:
    from gearmon.diagnosis.results import Analysis
    from gearmon.machine import Machine
    from gearmon.signals.recording import Recording
    from gearmon.signatures.measured.reference import Reference


def run_learn(arguments: argparse.Namespace) -> int:
    """Run `gearmon learn`."""
    from gearmon.report.text import reference_text
    from gearmon.signatures.measured.measurement import measure_signature
    from gearmon.signatures.measured.reference import make_reference, write_reference

    if not arguments.output:
        raise ArgumentError("learn: -o REFERENCE is missing; name the reference file to write")
    machine = machine_of(arguments.machine)
    signatures = [
        measure_signature(recording_of(path, arguments, machine), machine)
        for path in followed(arguments.recording, "learning")
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
    show(arguments, result, lambda: [reference_text(reference), f"wrote {arguments.output}"])
    return DONE


def run_analyse(arguments: argparse.Namespace) -> int:
    """Run `gearmon analyse`."""
    must_notice = loss_of(arguments.must_notice, "--must-notice")
    machine = machine_of(arguments.machine)
    reference = reference_of(arguments, machine)
    task = partial(
        _analysed,
        arguments=arguments,
        machine=machine,
        reference=reference,
        must_notice=must_notice,
    )
    results: list[dict[str, Any]] = []
    kept: list[tuple[Analysis, Recording | None]] = []
    for entry, found in each_of(task, arguments.recording, "analysing"):
        if "error" in entry:
            print(f"gearmon: {entry['error']}", file=sys.stderr)
        results.append(entry)
        kept += [found] if found is not None else []
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
        write_json(arguments.output, result)
    show(arguments, result, lambda: _analysis_lines(result, [a for a, _ in kept]))
    if any("error" in entry for entry in results):
        return BAD_INPUT
    if any(entry["flags"] for entry in results):
        return FLAGGED
    open_ = any(entry["verdict"] in ("cannot tell", "no mesh found") for entry in results)
    return UNJUDGED if open_ else DONE


def _analysed(
    path: str,
    arguments: argparse.Namespace,
    machine: Machine,
    reference: Reference | None,
    must_notice: float | None,
) -> tuple[dict[str, Any], tuple[Analysis, Recording | None] | None]:
    """Analyse one recording; a bad one is reported in its place.

    With the answer come the analysis, where it is to be worded, and the samples of a report.
    """
    from gearmon.diagnosis.analysis import analyse

    try:
        recording = recording_of(path, arguments, machine)
        options = {} if must_notice is None else {"must_notice": must_notice}
        analysis = analyse(recording, machine, reference, **options)
    except GearmonError as error:
        return {"recording": path, "error": str(error)}, None
    if arguments.json and not arguments.report:
        return analysis.to_dict(), None
    return analysis.to_dict(), (analysis, recording if arguments.report else None)


def _analysis_lines(result: dict[str, Any], analyses: list[Analysis]) -> list[str]:
    from gearmon.report.text import analysis_text

    lines = [text for analysis in analyses for text in (analysis_text(analysis), "")]
    lines += [f"{e['recording']}: not analysed" for e in result["recordings"] if "error" in e]
    if "report" in result:
        lines.append(f"report: {result['report'][0]} and {len(result['report']) - 1} pictures")
    return lines


def reference_of(arguments: argparse.Namespace, machine: Machine) -> Reference | None:
    """Return the reference that is named, or learn it from the healthy recording that is named."""
    from gearmon.diagnosis.analysis import learn
    from gearmon.signatures.measured.reference import is_reference, read_reference

    if not arguments.reference:
        return None
    path = Path(arguments.reference)
    if is_reference(path) or not path.is_file():
        return read_reference(path)
    return learn([recording_of(str(path), arguments, machine)], machine)


def _analyse_arguments(parser: argparse.ArgumentParser) -> None:
    recording_options(parser)
    parser.add_argument(
        "--reference", metavar="PATH", help="what gearmon learn wrote, or one healthy recording"
    )
    parser.add_argument(
        "--must-notice",
        metavar="LOSS",
        help="of one tooth pair's stiffness; healthy is said only where it would have been noticed "
        "on every gear (default 40%%)",
    )
    parser.add_argument(
        "--report", metavar="HTML", help="write a report (.html), and a PNG a picture beside it"
    )


LEARN = Command(
    name="learn",
    help="build a healthy reference from one or more healthy recordings, best at several loads",
    example="gearmon learn idle.csv half.csv full.csv --machine machine.toml -o healthy.ref",
    add=recording_options,
    run=run_learn,
    output="write the reference to this file, of any name; needed",
)
ANALYSE = Command(
    name="analyse",
    help="say whether the machine of a recording is healthy, and why",
    example="gearmon analyse new.csv --machine machine.toml --reference healthy.ref "
    "--report report.html",
    add=_analyse_arguments,
    run=run_analyse,
    endings=(".json",),
    more="Without --reference only a gross fault of one tooth can be called, and no machine is "
    "called healthy. Exit code: 0 if nothing is flagged, 1 if something is, 2 if a recording "
    "cannot be used, 3 if nothing is flagged but of some recording nothing can be said.",
)
