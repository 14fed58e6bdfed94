"""What people read: tables, words and pictures of results, and a report of all of them.

A result draws itself (`plot`, `figures`), by a function ``..._figure`` of a module ``..._plots``,
which returns a matplotlib figure whose axes say what they show and in which unit; ``save`` writes
it in the format of the suffix. ``write_report`` puts words,
pictures and tables of analyses into one HTML file that needs nothing else. Nothing is loaded before
it is asked for: text does without matplotlib.

Examples
--------
>>> import numpy as np
>>> from gearmon.dynamics.stability import FourierShape
>>> from gearmon.dynamics.stability import stability_map
>>> from gearmon.report import stability_figure
>>> chart = stability_map(FourierShape(np.array([0.5])), 0.05, (1.8, 2.2), 0.4, points=(8, 4))
>>> stability_figure(chart).axes[0].get_ylabel()
'stiffness variation ε'
>>> from gearmon import report
>>> report.analysis_text(analysis).splitlines()[0]
'simulated: FAULT'
>>> report.reference_text(reference).splitlines()[0]
'drive (23/57): reference of 2 healthy recordings'
>>> from gearmon.gears import line_table
>>> report.line_table_text(line_table(machine)).splitlines()[0]
'drive'
>>> rows = [{"gear": "pinion", "teeth": 23}, {"gear": "gear", "teeth": 57}]
>>> report.table_lines(rows), report.rows_as_csv(rows).splitlines()[1]
(['gear    teeth', 'pinion     23', 'gear       57'], 'pinion,23')
>>> recording = gearmon.read_recording(new)
>>> picture = next(report.analysis_figures(analysis, recording))
>>> isinstance(picture, report.Picture), report.save(picture, "new.png").name
(True, 'new.png')
>>> felt = gearmon.vibration_exposure(new, "hand", {"x": "a1", "y": "a2"})
>>> report.exposure_lines(felt)[0]
'simulated: 0.194 m/s2 (vector sum, hand); action value of a day after 1.33e+03 h'
>>> report.save_all({"-felt": felt.figures()[""]}, "new.png")[0].name
'new-felt.png'
>>> report.write_exposure_report([felt], "felt.html").name
'felt.html'
>>> from datetime import datetime, timezone
>>> from gearmon.diagnosis.history import History, entry_of, history_trends
>>> entry = entry_of(analysis, datetime(2026, 3, 1, tzinfo=timezone.utc))
>>> trends = history_trends(History(machine="drive").with_entry(entry))
>>> report.history_lines(trends)[0], report.history_figure(trends).axes[0].get_ylabel()
('drive: 1 recording, times in UTC', 'Loss of pair stiffness (%)')
>>> from gearmon.harvesting import InertialHarvester, survey_expected
>>> spring = InertialHarvester(
...     mass_kg=5e-3, natural_frequency_hz=564.0, lowest_hz=500.0, highest_hz=650.0
... )
>>> report.harvest_lines(survey_expected(machine, spring))[0]
'drive: 1 position(s), expected vibration'
"""

from gearmon.lazy import lazily

_OFFERED = {
    "html": ("Failure", "write_report"),
    "text": ("analysis_text", "history_lines", "line_table_text", "reference_text"),
    "wording": ("rows_as_csv", "table_lines"),
    "survey_text": ("exposure_lines", "harvest_lines", "write_exposure_report"),
    "plots": ("Picture", "save", "save_all"),
    "analysis_plots": ("analysis_figures", "history_figure"),
    "expected_plots": ("stability_figure",),
}
__all__, __getattr__ = lazily(__name__, _OFFERED)
