"""The command `gearmon kinds`: what kind of fault it is, by a classifier of this machine."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gearmon.commands.command import Command
from gearmon.commands.inputs import followed, machine_of, recording_of
from gearmon.commands.options import recording_options
from gearmon.commands.output import BAD_INPUT, DONE, FLAGGED, show, write_json
from gearmon.commands.recordings import reference_of
from gearmon.errors import ArgumentError, GearmonError, check_range

if TYPE_CHECKING:
    from gearmon.diagnosis.fault_types.classifier import KindClassifier
    from gearmon.machine import Machine
    from gearmon.signatures.measured.reference import Reference

#: Examples that a classifier is trained on; kinds less probable than this are not shown.
EXAMPLES, LEAST_SHOWN = 1600, 0.01


def run_kinds(arguments: argparse.Namespace) -> int:
    """Run `gearmon kinds`."""
    if arguments.recording and not arguments.reference:
        raise ArgumentError(
            "kinds: --reference is missing; a kind is judged by what changed against healthy "
            "recordings (gearmon learn)"
        )
    if not arguments.recording and not arguments.trained:
        raise ArgumentError("kinds: name recordings to judge, or with --trained a file to write")
    machine = machine_of(arguments.machine)
    reference = reference_of(arguments, machine)
    classifier, trained = _classifier(arguments, machine)
    results = [
        _judged(path, arguments, machine, reference, classifier)
        for path in followed(arguments.recording, "judging")
    ]
    result = {
        "machine": machine.name,
        "classifier": {"file": arguments.trained, "trained_now": trained},
        "recordings": results,
    }
    if arguments.output:
        write_json(arguments.output, result)
    show(arguments, result, lambda: _lines(result))
    if any("error" in entry for entry in results):
        return BAD_INPUT
    return FLAGGED if any(entry["flagged"] for entry in results) else DONE


def _classifier(arguments: argparse.Namespace, machine: Machine) -> tuple[KindClassifier, bool]:
    """Read the classifier that is named, or train it and keep it under that name."""
    from gearmon.diagnosis.fault_types.classifier import read_kinds, write_kinds
    from gearmon.diagnosis.fault_types.training import EXAMPLES_BETWEEN, train_kinds
    from gearmon.signatures.measured.reference import tooth_counts

    path = arguments.trained
    if path and Path(path).exists():
        classifier = read_kinds(path)
        if classifier.machine_ != tooth_counts(machine):
            raise ArgumentError(
                f"{path}: was trained for teeth {classifier.machine_ or 'not told'}, the machine "
                f"file has {tooth_counts(machine)}; name another file to train one"
            )
        return classifier, False
    check_range("--examples", arguments.examples, *EXAMPLES_BETWEEN)
    check_range("--seed", arguments.seed, 0, 2**63 - 1)
    classifier = train_kinds(machine, seed=arguments.seed, count=arguments.examples)
    if path:
        write_kinds(classifier, path)
    return classifier, True


def _judged(
    path: str,
    arguments: argparse.Namespace,
    machine: Machine,
    reference: Reference | None,
    classifier: KindClassifier,
) -> dict[str, Any]:
    """Judge one recording; a bad one is reported in its place."""
    from gearmon.diagnosis.analysis import analyse
    from gearmon.diagnosis.fault_types.judgement import kind_of_analysis

    assert reference is not None
    try:
        analysis = analyse(recording_of(path, arguments, machine), machine, reference)
        judgement = kind_of_analysis(analysis, reference, classifier)
    except GearmonError as error:
        print(f"gearmon: {error}", file=sys.stderr)
        return {"recording": path, "error": str(error)}
    return {
        "recording": path,
        "verdict": analysis.verdict,
        "flagged": [flag.kind for flag in analysis.flags],
        "kind": None if judgement is None else judgement.to_dict(),
    }


def _lines(result: dict[str, Any]) -> list[str]:
    from gearmon.report.wording import gear_text, percent, printable

    classifier = result["classifier"]
    lines = []
    if classifier["file"]:
        done = "wrote" if classifier["trained_now"] else "classifier"
        lines.append(f"{done}: {printable(classifier['file'])}")
    for entry in result["recordings"]:
        name = printable(entry["recording"])
        if "error" in entry:
            lines.append(f"{name}: not analysed")
            continue
        lines.append(f"{name}: {entry['verdict'].upper()}")
        told = entry["kind"]
        if told is None:
            lines.append("  no fault called, so no kind judged")
            continue
        where = f", {gear_text(told['stage'], told['gear'], None)}" if told["stage"] else ""
        lines.append(f"  most like {told['kind']}{where}")
        ranked = sorted(told["probabilities"].items(), key=lambda item: -item[1])
        shown = [f"{kind} {percent(p, 0)}" for kind, p in ranked if p >= LEAST_SHOWN]
        lines.append(f"  {', '.join(shown)}")
        lines += [f"  {sentence}" for sentence in told["evidence"]]
        if told["kind"] not in entry["flagged"]:
            flagged = ", ".join(dict.fromkeys(entry["flagged"]))
            lines.append(
                f"  gearmon analyse flags {flagged}: it looks at the turn of each gear, the "
                "classifier at levels; where they differ, trust the flag"
            )
    return lines


def _arguments(parser: argparse.ArgumentParser) -> None:
    recording_options(parser, least=0)
    option = parser.add_argument
    option("--reference", metavar="PATH", help="what gearmon learn wrote, or a healthy recording")
    option(
        "--trained",
        metavar="FILE",
        help="classifier of this machine; trained and written to this file if there is none",
    )
    option(
        "--examples",
        type=int,
        default=EXAMPLES,
        metavar="N",
        help=f"simulated machines to train it on ({EXAMPLES}, about a minute)",
    )
    option("--seed", type=int, default=0, metavar="N", help="of what is drawn at random (0)")


KINDS = Command(
    name="kinds",
    help="how probable each kind of fault is, by a classifier trained on this machine file",
    example="gearmon kinds new.csv --machine machine.toml --reference healthy.ref "
    "--trained drive.kinds --examples 400 -o kinds.json",
    add=_arguments,
    run=run_kinds,
    endings=(".json",),
    more="The classifier is trained on simulated signatures of the machine file, so that no "
    "recording of a fault is needed; its probabilities hold on such machines, not surely on "
    "yours, and there it is right in two of three. A kind is judged only where gearmon analyse "
    "calls a fault. Exit code: 0 if nothing is flagged, 1 if something is, 2 if a recording cannot "
    "be used.",
)
