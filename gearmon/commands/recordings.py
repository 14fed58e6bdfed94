"""Commands of monitoring: learn, check of a reference, analyse, kinds, history, fleet."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gearmon
from gearmon import fleet as fleets
from gearmon import report
from gearmon.commands import command
from gearmon.commands.command import argument
from gearmon.diagnosis import history as histories
from gearmon.errors import ArgumentError, check_range, check_word
from gearmon.files import write_table
from gearmon.report.wording import printable, table_lines
from gearmon.terminal import followed, part_of, progress_line

if TYPE_CHECKING:
    from gearmon.diagnosis.fault_types.classifier import KindClassifier
    from gearmon.diagnosis.history import Entry, HistoryTrends
    from gearmon.fleet.plan import Fleet
    from gearmon.fleet.run import Run


#: Examples that a classifier is trained on; kinds less probable than this are not shown.
EXAMPLES, LEAST_SHOWN = 1600, 0.01
_EXIT_CODES = (
    "Exit code: 0 if nothing is flagged, 1 if something is, 2 if a recording cannot be used, 3 if "
    "nothing is flagged but of some recording nothing can be said."
)


@command.command(
    *command.recordings(),
    endings=(),
    help="build a healthy reference from one or more healthy recordings, best at several loads",
    example="gearmon learn idle.csv half.csv full.csv --machine machine.toml -o healthy.ref",
    output="write the reference to this file, of any name; needed",
)
def learn(arguments: Namespace) -> int:
    """Run `gearmon learn`."""
    from gearmon.diagnosis.analysis import learned, measured_healthy

    def measure(path: str, *known: Any, **ways: Any) -> gearmon.MeasuredSignature:
        return gearmon.measure_signature(command.recording_of(path, arguments), *known, **ways)

    machine = arguments.machine
    paths = followed(arguments.recording, len(arguments.recording), arguments.progress)
    signatures = measured_healthy((partial(measure, path) for path in paths), machine)
    reference = learned(signatures, machine)
    gearmon.write_reference(reference, arguments.output)
    result = {
        "reference": arguments.output,
        "machine": reference.machine,
        "channels": list(reference.channel_names),
        "families": len(reference.family_names),
        "recordings": [
            {"recording": s.origin, "speed": s.speed.to_dict(), "warnings": list(s.notes)}
            for s in signatures
        ],
        "warnings": list(reference.notes),
    }
    return command.show(
        arguments, result, lambda: [report.reference_text(reference), f"wrote {arguments.output}"]
    )


@command.command(
    argument("REFERENCE", "what gearmon learn wrote"),
    command.OF_MACHINE,
    help="say what a reference covers, what it would find, and which recording to add",
    example="gearmon check healthy.ref --machine machine.toml -o check.csv",
)
def check(arguments: Namespace) -> int:
    """Run `gearmon check`."""
    reference = gearmon.read_reference(arguments.reference)
    found = gearmon.check_reference(reference, arguments.machine)
    result = found.to_dict()
    rows = [own | {"recording": printable(own["recording"])} for own in result["recordings"]]
    lines = partial(command.words, "check", result, headline=found.headline(), rows=rows)
    return command.finish(arguments, found, lines)


@command.command(
    *command.recordings(),
    command.REFERENCE,
    argument(
        "--must-notice LOSS",
        "of one tooth pair's stiffness; healthy is said only where it would have been noticed "
        "on every gear (default 40%%)",
    ),
    argument("--history FILE", "kept by gearmon history: says since when; only read", dest="past"),
    argument("--report HTML", "write a report (.html), and a PNG a picture beside it"),
    help="say whether the machine of a recording is healthy, and why",
    example="gearmon analyse new.csv --machine machine.toml --reference healthy.ref "
    "--report report.html",
    endings=(".json",),
    more="Without --reference only a gross fault of one tooth can be called, and no machine is "
    f"called healthy. {_EXIT_CODES}",
)
def analyse(arguments: Namespace) -> int:
    """Run `gearmon analyse`."""
    machine, reference = arguments.machine, reference_of(arguments)
    past = None
    if arguments.past:
        past = histories.history_trends(histories.read_history(arguments.past, machine.name))
    # reports take longer than analyses
    share = 0.3 if arguments.report else 1.0
    reported = part_of(arguments.progress, share, 1.0 - share)
    analysed = part_of(arguments.progress, 0.0, share)
    # what goes to other processes
    kept_here = {"progress": None, "recording": (), "asked": None}
    alone = Namespace(**vars(arguments) | kept_here)
    task = partial(_analysed, arguments=alone, reference=reference)
    done = command.each_of(arguments.recording, analysed, task, side_by_side=True)
    results = [own if isinstance(own, dict) else own[0] for own in done]
    good = [own for own in done if not isinstance(own, dict)]
    analyses, drawn = [own[1] for own in good], [own[2] for own in good]
    result: dict[str, Any] = {"recordings": results}
    if arguments.report and good:
        bad = [entry for entry in results if "error" in entry]
        failures = [report.Failure(recording=e["recording"], message=e["error"]) for e in bad]
        more: dict[str, Any] = {"failures": failures, "history": past, "progress": reported}
        files = gearmon.write_report(analyses, drawn, reference, machine, arguments.report, **more)
        result["report"] = [str(file) for file in files]
    # a list of no rows: there is no table but the JSON
    command.finish(arguments, result, lambda: _analysis_lines(result, analyses, past), list)
    return command.judged(results, flagged=any(entry.get("flags") for entry in results))


def _analysed(
    path: str, arguments: Namespace, reference: gearmon.Reference | None
) -> tuple[dict[str, Any], gearmon.Analysis | None, gearmon.Recording | None]:
    """Analyse one recording; with the answer, what is worded of it and what a report draws."""
    recording = command.recording_of(path, arguments)
    options = command.given(arguments, "must_notice")
    analysis = gearmon.analyse(recording, arguments.machine, reference, **options)
    worded = analysis if arguments.report or not arguments.json else None
    return analysis.to_dict(), worded, recording if arguments.report else None


def _analysis_lines(
    result: dict[str, Any], analyses: list[gearmon.Analysis], past: HistoryTrends | None
) -> list[str]:
    from gearmon.report.text import overview_lines, worst_first

    lines = overview_lines(analyses) if len(analyses) > 1 else []
    shown = [analyses[place] for place in worst_first(analyses)]
    lines += [text for analysis in shown for text in (report.analysis_text(analysis, past), "")]
    lines += [f"{e['recording']}: not analysed" for e in result["recordings"] if "error" in e]
    if "report" in result:
        lines.append(f"report: {result['report'][0]} and {len(result['report']) - 1} pictures")
    return lines


def reference_of(arguments: Namespace) -> gearmon.Reference | None:
    """Return the reference that is named, or learn it from the healthy recording that is named."""
    from gearmon.signatures.measured.reference import is_reference

    if not arguments.reference:
        return None
    path = Path(arguments.reference)
    if is_reference(path) or not path.is_file():
        return gearmon.read_reference(path)
    return gearmon.learn([command.recording_of(str(path), arguments)], arguments.machine)


@command.command(
    *command.recordings("[RECORDING...]"),
    command.REFERENCE,
    argument("--trained FILE", "classifier of this machine; trained and written if there is none"),
    argument("--examples N", "simulated machines to train it on, in ten seconds", EXAMPLES),
    argument("--seed N", "of what is drawn at random", 0),
    help="how probable each kind of fault is, by a classifier trained on this machine file",
    example="gearmon kinds new.csv --machine machine.toml --reference healthy.ref "
    "--trained drive.kinds --examples 400 -o kinds.json",
    endings=(".json",),
    more="The classifier is trained on simulated signatures of the machine file, so that no "
    "recording of a fault is needed; its probabilities hold on such machines, not surely on "
    "yours, and there it is right in two of three. A kind is judged only where gearmon analyse "
    f"calls a fault. {_EXIT_CODES}",
)
def kinds(arguments: Namespace) -> int:
    """Run `gearmon kinds`."""
    if arguments.recording and not arguments.reference:
        raise ArgumentError(
            "kinds: --reference is missing; a kind is judged by what changed against healthy "
            "recordings (gearmon learn)"
        )
    if not arguments.recording and not arguments.trained:
        raise ArgumentError("kinds: name recordings to judge, or with --trained a file to write")
    machine, reference = arguments.machine, reference_of(arguments)
    classifier, trained = _classifier(arguments)

    def kind_of(path: str) -> dict[str, Any]:
        from gearmon.diagnosis.fault_types.kinds import kind_of_analysis

        assert reference is not None
        analysis = gearmon.analyse(command.recording_of(path, arguments), machine, reference)
        judgement = kind_of_analysis(analysis, reference, classifier)
        return {
            "recording": path,
            "verdict": analysis.verdict,
            "flagged": [flag.kind for flag in analysis.flags],
            "kind": None if judgement is None else judgement.to_dict(),
        }

    results = command.each_of(arguments.recording, None if trained else arguments.progress, kind_of)
    result = {
        "machine": machine.name,
        "classifier": {"file": arguments.trained, "trained_now": trained},
        "recordings": results,
    }
    lines = partial(command.words, "kinds", result, least_shown=LEAST_SHOWN)
    command.finish(arguments, result, lines, list)
    return command.judged(results, flagged=any(entry.get("flagged") for entry in results))


def _classifier(arguments: Namespace) -> tuple[KindClassifier, bool]:
    """Read the classifier that is named, or train it and keep it under that name."""
    from gearmon.diagnosis.fault_types.classifier import read_kinds, write_kinds
    from gearmon.diagnosis.fault_types.kinds import NAMES
    from gearmon.diagnosis.fault_types.training import EXAMPLES_BETWEEN
    from gearmon.signatures.measured.reference import tooth_counts

    path = arguments.trained
    if path and Path(path).exists():
        classifier = read_kinds(path)
        teeth, known, wrong = tooth_counts(arguments.machine), classifier.machine_ or "not told", ""
        if known != teeth:
            wrong = f"was trained for teeth {known}, the machine file has {teeth}"
        elif classifier.n_features_in_ != len(NAMES):
            wrong = f"knows {classifier.n_features_in_} features, there are {len(NAMES)}"
        if wrong:
            raise ArgumentError(f"{path}: {wrong}; name another file to train one")
        return classifier, False
    check_range("--examples", arguments.examples, *EXAMPLES_BETWEEN)
    check_range("--seed", arguments.seed, 0, 2**63 - 1)
    settings = {"count": arguments.examples, "progress": arguments.progress}
    classifier = gearmon.train_kinds(arguments.machine, arguments.seed, **settings)
    if path:
        write_kinds(classifier, path)
    return classifier, True


@command.command(
    *command.recordings("[RECORDING...]"),
    command.REFERENCE,
    argument("--store FILE", "keep the history in it; next time name new recordings only, or none"),
    argument("--name NAME", "of the machine in the store, if it is not that of the machine file"),
    argument("--times ISO8601,ISO8601", "of each, as 2026-03-01T08:00; UTC without an offset"),
    argument(
        "--time-from SOURCE", "name (of the file, as drive-2026-03-01.csv) or modified (when)"
    ),
    argument("--limit LOSS", "of pair stiffness at which to act, such as 20%%"),
    argument("--replace", "recordings of the same time give way"),
    help="follow a machine through recordings: loss of each tooth, when it began, what is left",
    example="gearmon history drive-*.csv --machine machine.toml --reference healthy.ref "
    "--time-from name --store history.db --limit 20% -o history.csv",
    endings=(".csv", ".json", ".parquet", ".png"),
    output="write the table to this file, and a picture beside it",
    more="A tooth is listed once its loss stands clear of noise and of zero in several recordings; "
    f"changes are looked for in six or more. {_EXIT_CODES}",
    beside=("{}.png",),
)
def history(arguments: Namespace) -> int:
    """Run `gearmon history`."""
    if not arguments.recording and not arguments.store:
        raise ArgumentError("history: name recordings, or with --store a history file to look at")
    name = arguments.name or arguments.machine.name
    arguments.machine = machine = replace(arguments.machine, name=name)
    history, times = histories.History(machine=name), []
    if arguments.recording:
        times = histories.recording_times(arguments.recording, arguments.times, arguments.time_from)
    if arguments.store and Path(arguments.store).exists():
        history = histories.read_history(arguments.store, name)
    if not (times or history.entries):
        known = [own["machine"] for own in histories.read_latest(arguments.store)]
        check_word(f"{arguments.store}: machine ", name, known)
    if not arguments.replace:  # and what is there already is refused before any is analysed
        for path, time in zip(arguments.recording, times, strict=True):
            history.check_new(path, time.timestamp())
    reference = reference_of(arguments) if times else None
    moments = iter(times)

    def entry(path: str) -> Entry:
        moment = next(moments)
        analysis = gearmon.analyse(command.recording_of(path, arguments), machine, reference)
        return histories.entry_of(analysis, moment, arguments.time_from or "given")

    done = command.each_of(arguments.recording, arguments.progress, entry)
    errors = [own for own in done if isinstance(own, dict)]
    entries: list[Entry] = [own for own in done if not isinstance(own, dict)]
    replaced = 0
    if arguments.store and entries:
        replaced = histories.append(arguments.store, entries, replace=arguments.replace)
        history = histories.read_history(arguments.store, name)
    elif not arguments.store:
        for own in entries:
            history = history.with_entry(own, replace=arguments.replace)
    found = histories.history_trends(history, limit=arguments.limit)
    result = found.to_dict() | {"errors": errors, "replaced": replaced}
    if arguments.output:
        result["files"] = _history_written(arguments.output, found, result)
    command.show(arguments, result, lambda: _history_lines(found, result))
    told = [*errors, *({"verdict": entry.verdict} for entry in entries)]
    return command.judged(told, flagged=found.raised)


def _history_written(output: str, found: HistoryTrends, result: dict[str, Any]) -> list[str]:
    """Write the table under the name, and the picture beside it."""
    target, files = Path(output), []
    if target.suffix.lower() == ".json":
        write_table(output, result, [])
        files.append(output)
    elif target.suffix.lower() != ".png":
        files.append(str(histories.export_history(found.history, target)))
    if found.history.entries:
        files.append(str(report.save(report.history_figure(found), target.with_suffix(".png"))))
    return files


def _history_lines(found: HistoryTrends, result: dict[str, Any]) -> list[str]:

    lines: list[str] = report.history_lines(found)
    lines += [f"{entry['recording']}: not analysed" for entry in result["errors"]]
    if result["replaced"]:
        lines.append(f"replaced: {result['replaced']}")
    return lines + [f"wrote {path}" for path in result.get("files", ())]


#: What is shown of a ranking, and seconds between two looks.
_SHOWN, _EVERY_S = 20, 60.0


@command.command(
    argument(
        "ACTION",
        "run (analyse what is new), watch (what arrives), serve (web pages), rank (indicators "
        "by how clearly they change), or compare (machines that have the same gears)",
    ),
    argument("FLEET", "fleet file (TOML)"),
    argument("--engine NAME", "processes (default) or dask", "processes"),
    argument("--scheduler ADDRESS", "of dask, such as tcp://10.0.0.1:8786"),
    argument("--patience S", "until dask is given up, with no batch done", 3600.0),
    argument("--again", "also what failed, or another version analysed"),
    argument("--every S", "of watch: time between two looks", _EVERY_S),
    argument("--host HOST", "of serve; others are asked for a token (%(default)s)", "127.0.0.1"),
    argument("--port N", "of serve", 8765),
    argument("--token TOKEN", "of serve; made up where one is needed and none is given"),
    help="look after many machines: analyse what arrives, raise alarms, show who needs somebody",
    example="gearmon fleet run fleet.toml",
    waits=True,
    more="The fleet file names the machines: [[machine]] with name, file, reference, recordings (a "
    "folder) and pattern, a regular expression with the groups time and, if need be, machine and "
    "class; what several share stands in [defaults]. [[alarm]] with command, webhook or mail says "
    "who is told. All results are kept in one store, which gearmon history --name MACHINE reads. "
    "Exit code: 0 if no alarm stands, 1 if one does, 2 if a recording cannot be used.",
)
def fleet(arguments: Namespace) -> int:
    """Run `gearmon fleet`."""
    check_word("fleet ", arguments.action, _ACTIONS)
    code: int = _ACTIONS[arguments.action](arguments, fleets.read_fleet(arguments.fleet))
    return code


def _run(arguments: Namespace, fleet: Fleet) -> int:
    with progress_line("fleet run") as progress:
        run = fleets.run_fleet(fleet, _engine(arguments), again=arguments.again, progress=progress)
    for path, why in run.failed.items():
        command.complain(f"{path}: {why}")
    for trouble in fleets.deliver(fleet):
        command.complain(trouble)
    result = run.to_dict(fleet)
    command.finish(arguments, result, partial(command.words, "fleet", result, most=_SHOWN), list)
    if run.failed:
        return command.BAD_INPUT
    return command.FLAGGED if result["alarms"] else command.DONE


def _engine(arguments: Namespace) -> Any:
    check_word("--engine ", arguments.engine, ("processes", "dask"))
    if arguments.engine == "processes":
        return fleets.in_processes
    if not arguments.scheduler:
        raise ArgumentError("--engine dask needs --scheduler ADDRESS, such as tcp://10.0.0.1:8786")
    return partial(fleets.on_dask, scheduler=arguments.scheduler, patience_s=arguments.patience)


def _watch(arguments: Namespace, fleet: Fleet) -> int:
    check_range("--every", arguments.every, 0.1, 86400.0, "s")

    def told(what: Run | str) -> None:
        if isinstance(what, str):
            command.complain(what)
        else:
            print(*command.words("fleet", what.to_dict(fleet), most=_SHOWN), sep="\n", flush=True)

    fleets.watch_fleet(fleet, _engine(arguments), every_s=arguments.every, told=told)
    return command.DONE


def _serve(arguments: Namespace, fleet: Fleet) -> int:
    try:
        from gearmon.fleet.pages import serve
    except ImportError:
        raise ArgumentError("fleet serve needs pip install 'gearmon[web]'") from None

    check_range("--port", arguments.port, 1, 65535)
    serve(fleet, arguments.host, arguments.port, arguments.token or "")
    return command.DONE


def _rank(arguments: Namespace, fleet: Fleet) -> int:
    from gearmon.fleet.ledger import FEWEST, compare, rank

    rows = {"rank": rank, "compare": compare}[arguments.action](fleet)
    if not rows:
        told = f"{FEWEST} recordings of a machine, and indicators that differ between them"
        raise ArgumentError(f"{fleet.name}: nothing to rank; it takes {told}")
    result = {"fleet": fleet.name, "rows": rows}
    return command.finish(arguments, result, lambda: table_lines(rows[:_SHOWN]), lambda: rows)


_ACTIONS = {"run": _run, "watch": _watch, "serve": _serve, "rank": _rank, "compare": _rank}
