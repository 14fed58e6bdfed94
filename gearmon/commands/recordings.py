"""Commands that judge recordings: learn, analyse."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gearmon.commands.inputs import followed, machine_of, recording_of
from gearmon.commands.output import BAD_INPUT, DONE, FLAGGED, show, write_json
from gearmon.errors import ArgumentError, GearmonError

if TYPE_CHECKING:
    from gearmon.diagnosis.results import Analysis
    from gearmon.machine import Machine
    from gearmon.signals.recording import Recording
    from gearmon.signatures.reference import Reference


def run_learn(arguments: argparse.Namespace) -> int:
    """Run `gearmon learn`."""
    from gearmon.report.text import reference_text
    from gearmon.signatures.measured import measure_signature
    from gearmon.signatures.reference import make_reference, write_reference

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
    machine = machine_of(arguments.machine)
    reference = reference_of(arguments, machine)
    kept: list[tuple[Analysis, Recording | None]] = []
    results = [
        _analysed(path, arguments, machine, reference, kept)
        for path in followed(arguments.recording, "analysing")
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
        write_json(arguments.output, result)
    show(arguments, result, lambda: _analysis_lines(result, [a for a, _ in kept]))
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
        recording = recording_of(path, arguments, machine)
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


def reference_of(arguments: argparse.Namespace, machine: Machine) -> Reference | None:
    """Return the reference that is named, or learn it from the healthy recording that is named."""
    from gearmon.diagnosis.analysis import learn
    from gearmon.signatures.reference import is_reference, read_reference

    if not arguments.reference:
        return None
    path = Path(arguments.reference)
    if is_reference(path) or not path.is_file():
        return read_reference(path)
    return learn([recording_of(str(path), arguments, machine)], machine)
