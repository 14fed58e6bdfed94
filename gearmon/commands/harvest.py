"""The command that places and tunes harvesters."""

from __future__ import annotations

import argparse
from pathlib import Path

from gearmon.commands.inputs import machine_of, recording_of
from gearmon.commands.output import DONE, show, write_table
from gearmon.errors import ArgumentError


def run_harvest(arguments: argparse.Namespace) -> int:
    """Run `gearmon harvest`."""
    from gearmon.harvesting.request import built_in, load_harvester
    from gearmon.harvesting.survey import survey_expected, survey_measured
    from gearmon.report.harvest_text import harvest_lines
    from gearmon.report.text_tables import rows_as_csv

    machine = machine_of(arguments.machine)
    harvester, budget = load_harvester(arguments.harvester) if arguments.harvester else built_in()
    if arguments.recording:
        _refuse_with_recordings(arguments)
        survey = survey_measured(
            machine,
            harvester,
            [recording_of(path, arguments, machine) for path in arguments.recording],
            budget,
            shares=arguments.share or (),
            degraded=[recording_of(path, arguments, machine) for path in arguments.degraded],
            count=arguments.count,
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
            count=arguments.count,
        )
    result = survey.to_dict()
    if arguments.output:
        from gearmon.report.harvest_plots import save_harvest_figures

        write_table(arguments.output, result, lambda: rows_as_csv(survey.rows()))
        pictures = save_harvest_figures(survey, Path(arguments.output).with_suffix(".png"))
        result["pictures"] = [str(path) for path in pictures]
    show(
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
