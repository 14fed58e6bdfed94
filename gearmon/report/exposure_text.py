"""Exposure in words: lines for a terminal, and a report that needs nothing else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gearmon.exposure.day import DayExposure
from gearmon.exposure.gearbox import GearShare
from gearmon.exposure.measures import Exposure, SeatFactor
from gearmon.files import write_atomically
from gearmon.report.page import base64_text, template
from gearmon.report.wording import printable, table_lines

#: Results that have words: in a command's answer in this order.
Told = Exposure | SeatFactor | GearShare | DayExposure
_AXIS_COLUMNS = {
    "axis": "axis",
    "channel": "channel",
    "weighting": "weighting",
    "factor": "k",
    "rms_ms2": "rms m/s2",
    "peak_ms2": "peak m/s2",
    "crest_factor": "crest",
    "mtvv_ms2": "MTVV m/s2",
    "vdv": "VDV m/s^1.75",
}


def exposure_lines(found: Told) -> list[str]:
    """Return a result as lines of text.

    Parameters
    ----------
    found : Exposure, SeatFactor, GearShare or DayExposure

    Returns
    -------
    list of str
        Without line ends.
    """
    title, rows, notes = _told(found)
    return [title, *table_lines(rows), *notes]


def _told(found: Told) -> tuple[str, list[dict[str, Any]], list[str]]:
    """Return title, rows of a table and sentences of a result."""
    rows = [{key: _short(value) for key, value in row.items()} for row in found.rows()]
    if isinstance(found, Exposure):
        rows = [{name: row[key] for key, name in _AXIS_COLUMNS.items()} for row in rows]
        notes = [*_times(found.times_s()), *found.advice, *_noted(found.warnings)]
        title = f"{printable(found.recording)}: {found.headline()}"
    elif isinstance(found, SeatFactor):
        title = f"SEAT factor: {printable(found.seat)} over {printable(found.floor)}"
        notes = ["below 1 the seat helps"]
    elif isinstance(found, GearShare):
        title, notes = f"{found.machine}: {found.headline()}", _point_lines(found)
    else:
        title = f"day of {found.hours:g} h ({found.position}): {found.headline()}"
        notes = [*_reached(found), *_noted(found.warnings)]
    return title, rows, notes


def _short(value: Any) -> Any:
    return float(f"{value:.3g}") if isinstance(value, float) else value


def _noted(warnings: Sequence[str]) -> list[str]:
    return [f"note: {printable(own)}" for own in warnings]


def _times(times: Mapping[str, float | None]) -> list[str]:
    """Say how long a day with this vibration may be."""
    names = {"ms2": "A(8)", "vdv": "VDV"}
    told = []
    for name, seconds in times.items():
        of, _, unit = name.partition("_")
        if seconds is not None:
            often = f"{seconds / 3600:.3g} h" if seconds < 86400 else "more than a day"
            told.append(f"{names[unit]} reaches the {of} value after {often}")
    return told


def _reached(day: DayExposure) -> list[str]:
    return [
        f"{dose.measure} reaches the {of} value after {hours:.3g} h of work"
        for dose in day.doses
        for of, hours in dose.reached_h.items()
        if hours is not None
    ]


def _point_lines(found: GearShare) -> list[str]:
    """Tell the operating points, best first, and what damage adds."""
    lines = []
    if found.points:
        named = f", with {' and '.join(found.faults)}" if found.faults else ""
        lines.append(f"operating points, best for the driver first{named}:")
        rows = [
            {
                "point": own.name,
                "rpm": own.speed_rpm,
                "mesh lines m/s2": _short(own.gears_ms2),
                "felt m/s2": _short(own.value_ms2),
            }
            | ({} if own.damaged_ms2 is None else {
                "damaged m/s2": _short(own.damaged_ms2),
                "added %": _short(100 * (own.damaged_ms2 / (own.value_ms2 or 1.0) - 1)),
            })
            for own in found.points
        ]  # fmt: skip
        lines += table_lines(rows)
    return [*lines, *_noted(found.warnings)]


def write_exposure_report(found: Sequence[Told], path: str | Path) -> Path:
    """Write results with their pictures as one HTML file that needs nothing else.

    Parameters
    ----------
    found : sequence of Exposure, SeatFactor, GearShare or DayExposure
    path : str or Path

    Returns
    -------
    Path
        What was written.

    Raises
    ------
    ArgumentError
        If the file cannot be written.
    """
    from gearmon.report.plots import as_png

    sections = []
    for own in found:
        title, rows, notes = _told(own)
        pictures = [as_png(figure) for figure in own.figures().values()] if own.picture else []
        told = {"title": title, "rows": rows, "notes": notes}
        sections.append(told | {"pictures": map(base64_text, pictures)})
    write_atomically(path, template("exposure.html").render(sections=sections))
    return Path(path)
