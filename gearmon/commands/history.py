"""Command that follows a machine over time: history."""

from __future__ import annotations

import argparse
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gearmon.commands.command import Command
from gearmon.commands.inputs import in_turn, loss_of, machine_of, recording_of
from gearmon.commands.options import recording_options
from gearmon.commands.output import BAD_INPUT, DONE, FLAGGED, show, write_json
from gearmon.errors import ArgumentError

if TYPE_CHECKING:
    from gearmon.diagnosis.history import Entry, HistoryTrends
    from gearmon.machine import Machine


def run_history(arguments: argparse.Namespace) -> int:
    """Run `gearmon history`."""
    from gearmon.diagnosis.history import History, append, history_trends, read_history

    _check(arguments)
    limit = loss_of(arguments.limit, "--limit")
    machine = machine_of(arguments.machine)
    times = _times(arguments)
    _refuse_known(arguments, machine, times)
    entries, errors = _entries(arguments, machine, times)
    replaced = 0
    if arguments.store:
        if entries:
            replaced = append(arguments.store, entries, replace=arguments.replace)
        history = read_history(arguments.store, machine.name)
    else:
        history = History(machine=machine.name)
        for entry in entries:
            history = history.with_entry(entry, replace=arguments.replace)
    found = history_trends(history, limit=limit)
    result = found.to_dict() | {"errors": errors, "replaced": replaced}
    if arguments.output:
        result["files"] = _written(arguments.output, found, result)
    show(arguments, result, lambda: _lines(found, result))
    if errors:
        return BAD_INPUT
    return FLAGGED if found.raised else DONE


def _check(arguments: argparse.Namespace) -> None:
    """Refuse what cannot work before any recording is analysed."""
    if arguments.store == "":
        raise ArgumentError("--store: the name is empty")
    if not arguments.recording and not arguments.store:
        raise ArgumentError("history: name recordings, or with --store a history file to look at")
    if arguments.store:
        store = Path(arguments.store).resolve()
        others = [*arguments.recording, arguments.machine, arguments.reference, arguments.output]
        if any(store == Path(path).resolve() for path in others if path):
            raise ArgumentError(f"{arguments.store}: is another file of this command as well")


def _times(arguments: argparse.Namespace) -> list[datetime]:
    from gearmon.diagnosis.history import recording_times

    if not arguments.recording:
        return []
    return recording_times(arguments.recording, arguments.times, arguments.time_from)


def _refuse_known(arguments: argparse.Namespace, machine: Machine, times: list[datetime]) -> None:
    """Refuse times that the history has already, before any recording is analysed."""
    from gearmon.diagnosis.history import read_history

    if arguments.replace or not arguments.store or not Path(arguments.store).exists():
        return
    known = {e.time_s: e for e in read_history(arguments.store, machine.name).entries}
    for path, time in zip(arguments.recording, times, strict=True):
        if time.timestamp() in known:
            entry = known[time.timestamp()]
            raise ArgumentError(
                f"{path}: {arguments.store} has a recording of {entry.when} already "
                f"({entry.recording}); add --replace, or give the right time"
            )


def _entries(
    arguments: argparse.Namespace, machine: Machine, times: list[datetime]
) -> tuple[list[Entry], list[dict[str, str]]]:
    """Analyse the recordings; a bad one is reported in its place and the others are kept."""
    if not arguments.recording:
        return [], []
    from gearmon.commands.recordings import reference_of
    from gearmon.diagnosis.analysis import analyse
    from gearmon.diagnosis.history import entry_of

    reference = reference_of(arguments, machine)
    source, entries = arguments.time_from or "given", []
    moments = iter(times)

    def entry(path: str) -> dict[str, Any]:
        moment = next(moments)
        analysis = analyse(recording_of(path, arguments, machine), machine, reference)
        entries.append(entry_of(analysis, moment, source))
        return {}

    done = in_turn(arguments.recording, "analysing", entry)
    return entries, [bad for bad in done if bad]


def _written(output: str, found: HistoryTrends, result: dict[str, Any]) -> list[str]:
    """Write the table under the name, and the picture beside it."""
    from gearmon.diagnosis.history import export_history
    from gearmon.report.history_plots import history_figure
    from gearmon.report.plots import save

    target, files = Path(output), []
    if target.suffix.lower() == ".json":
        write_json(output, result)
        files.append(output)
    elif target.suffix.lower() != ".png":
        files.append(str(export_history(found.history, target)))
    if found.history.entries:
        files.append(str(save(history_figure(found), target.with_suffix(".png"))))
    return files


def _lines(found: HistoryTrends, result: dict[str, Any]) -> list[str]:
    from gearmon.report.history_text import history_lines

    lines = history_lines(found)
    lines += [f"{entry['recording']}: not analysed" for entry in result["errors"]]
    if result["replaced"]:
        lines.append(f"replaced: {result['replaced']}")
    return lines + [f"wrote {path}" for path in result.get("files", ())]


def _arguments(parser: argparse.ArgumentParser) -> None:
    recording_options(parser, least=0)
    option = parser.add_argument
    option("--reference", metavar="PATH", help="what gearmon learn wrote, or a healthy recording")
    option(
        "--store",
        metavar="DB",
        help="keep the history in this file; next time name the new recordings only, or none",
    )
    option(
        "--times",
        metavar="ISO8601,...",
        help="when each was made, such as 2026-03-01T08:00; UTC where there is no offset",
    )
    option(
        "--time-from",
        metavar="SOURCE",
        help="name (of the file, such as drive-2026-03-01.csv) or modified (when it was)",
    )
    option("--limit", metavar="LOSS", help="of pair stiffness at which to act, such as 20%%")
    option("--replace", action="store_true", help="recordings of the same time give way")


HISTORY = Command(
    name="history",
    help="follow a machine through recordings: loss of each tooth, when it began, what is left",
    example="gearmon history drive-*.csv --machine machine.toml --reference healthy.ref "
    "--time-from name --store history.db --limit 20% -o history.csv",
    add=_arguments,
    run=run_history,
    endings=(".csv", ".json", ".parquet", ".png"),
    output="write the table to this file, and a picture beside it",
    more="A tooth is listed once its loss stands clear of noise and of zero in several recordings; "
    "changes are looked for in six or more. Exit code: 0 if nothing is flagged, 1 if something "
    "is, 2 if a recording cannot be used.",
)
