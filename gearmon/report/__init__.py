"""What people read: tables, words and pictures of results, and a report of all of them.

A function ``..._figure`` takes a result and returns a matplotlib figure whose axes say what they
show and in which unit; ``save`` writes it in the format of the suffix. ``write_report`` puts words,
pictures and tables of analyses into one HTML file that needs nothing else. Nothing is loaded before
it is asked for: text does without matplotlib.

Examples
--------
>>> import numpy as np
>>> from gearmon.dynamics.stability import FourierShape
>>> from gearmon.dynamics.stability_map import stability_map
>>> from gearmon.report import stability_figure
>>> chart = stability_map(FourierShape(np.array([0.5])), 0.05, (1.8, 2.2), 0.4, points=(8, 4))
>>> stability_figure(chart).axes[0].get_ylabel()
'stiffness variation ε'
"""

from importlib import import_module
from typing import Any

_OFFERED = {
    "html": ("Failure", "write_report"),
    "text": ("analysis_text", "line_table_text", "reference_text"),
    "text_tables": ("Table", "rows_as_csv", "table_lines"),
    "history_text": ("history_lines",),
    "harvest_text": ("harvest_lines",),
    "plots": ("Picture", "save", "save_all"),
    "analysis_plots": ("analysis_figures", "speed_figure", "turn_figure"),
    "spectrum_plots": ("amplitude_figure", "close_up_figure", "order_figure", "spectrum_figure"),
    "level_plots": ("changes_figure", "pattern_figure"),
    "recording_plots": ("average_figures", "indicator_figure", "order_map_figure"),
    "history_plots": ("history_figure",),
    "harvest_plots": ("harvest_figures",),
    "exposure_text": ("exposure_lines", "write_exposure_report"),
    "exposure_plots": ("day_exposure_figure", "exposure_figure", "gear_share_figure"),
    "stiffness_plots": ("form_figure", "stiffness_figures"),
    "expected_plots": ("family_figure", "stability_figure"),
}
_HOMES = {name: home for home, names in _OFFERED.items() for name in names}
__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    """Load a public name from its home."""
    if name not in _HOMES:
        raise AttributeError(f"module 'gearmon.report' has no attribute {name!r}")
    return getattr(import_module(f"gearmon.report.{_HOMES[name]}"), name)
