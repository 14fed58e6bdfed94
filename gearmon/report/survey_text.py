"""A harvester survey, and what people feel of vibration, in words; the latter as a page too."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from gearmon.exposure.day import DayExposure
from gearmon.exposure.gearbox import GearShare
from gearmon.exposure.measures import Exposure, SeatFactor
from gearmon.files import write_atomically
from gearmon.harvesting.placement import Placed, Survey
from gearmon.report.wording import base64_text, printable, table_lines, template

MICRO = 1e6
#: Energy lines shown.
_MOST_LINES = 8
#: Units of time with their lengths [s], and how many of them are needed to be spoken of.
_UNITS = (
    ("years", 365.25 * 86400.0, 2.0),
    ("days", 86400.0, 2.0),
    ("h", 3600.0, 2.0),
    ("min", 60.0, 1.5),
)
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


def harvest_lines(survey: Survey, published: bool = False) -> list[str]:
    """Return a survey as lines of text: positions, the harvester, the energy lines, assumptions.

    Parameters
    ----------
    survey : Survey
    published : bool
        Whether published harvesters are shown beside the best one.

    Returns
    -------
    list of str
        Without line ends.
    """
    ranked = sorted(survey.lines(), key=lambda row: -row["share_of_time"] * row["energy_j_per_kg"])
    names = [point.vibration.name for point in survey.best.position.healthy]
    powers = [[found.power_w for found in tuned.answers] for tuned in survey.together]
    told = template("harvest.txt").render(
        survey=survey,
        own=survey.tuned.harvester.to_dict(),
        places=[_place_row(place) for place in survey.placed],
        lines=[
            {
                "operating_point": row["operating_point"],
                "frequency_hz": row["frequency_hz"],
                "acceleration_ms2": row["acceleration_ms2"],
                "energy_uj_per_kg": MICRO * row["energy_j_per_kg"],
                "share_percent": 100 * row["share"],
            }
            for row in ranked[:_MOST_LINES]
        ],
        together=[
            {"tuned_to_hz": tuned.harvester.natural_frequency_hz, "load": tuned.harvester.load}
            | {f"{name} uw": MICRO * power for name, power in zip(names, own, strict=True)}
            for tuned, own in zip(survey.together, powers, strict=True)
        ],
        worst_w=min(map(sum, zip(*powers, strict=True)), default=0.0),
        # of the best harvester, by the quality factor of its mechanics
        bands=[
            {
                "quality_factor": row["quality_factor"],
                "loaded": row["loaded_quality_factor"],
                "bandwidth_hz": row["width_hz"],
                "peak_uw": MICRO * row["peak_power_w"],
                "wandering_uw": MICRO * row["power_w"],
            }
            for row in survey.bandwidths()
        ],
        published=[_published(row) for row in survey.published()] if published else [],
        spoken_time=spoken_time,
        known=math.isfinite,
    )
    return told.splitlines()


def spoken_time(seconds: float) -> str:
    """Say a time in the unit that suits it, such as "4.7 days"; "never" if infinite.

    Examples
    --------
    >>> spoken_time(403_200.0), spoken_time(90.0)
    ('4.7 days', '1.5 min')
    """
    if not math.isfinite(seconds):
        return "never"
    for unit, length, least in _UNITS:
        if seconds >= least * length:
            return f"{float(f'{seconds / length:.2g}'):g} {unit}"
    return f"{seconds:.2g} s"


def _place_row(place: Placed) -> dict[str, Any]:
    row = place.to_dict()
    return {
        "position": row["position"],
        "tuned_to_hz": row["natural_frequency_hz"],
        "power_uw": MICRO * place.power_w,
        "interval_90_uw": _interval(place),
        "damaged_uw": _micro(row["degraded_power_w"]),
        "best_damaged_hz": row["degraded_best_hz"],
        "best_damaged_uw": _micro(row["degraded_best_power_w"]),
        "a_recording_every": spoken_time(place.interval_s),
        "remark": row["refusal"]
        or ("better only when damaged" if place.good_only_when_damaged else ""),
    }


def _interval(place: Placed) -> str:
    if not math.isfinite(place.power_low_w):
        return "too few stretches" if math.isfinite(place.independent_stretches) else ""
    return f"{MICRO * place.power_low_w:.3g} to {MICRO * place.power_high_w:.3g}"


def _micro(value: float | None) -> float | None:
    return None if value is None else MICRO * value


def _published(row: dict[str, Any]) -> dict[str, Any]:
    """Return a published harvester, and the best one here in its place."""
    names = ("frequency_hz", "acceleration_ms2", "power_uw", "uw_per_cm3", "model_uw")
    unsure = " (unverified)" if row["checked"] == "no" else ""
    shown = {name: row[name] for name in (*names, "own_uw", "own_uw_per_cm3")}
    return {"name": row["name"] + unsure} | shown


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
        notes = [
            f"{dose.measure} reaches the {of} value after {hours:.3g} h of work"
            for dose in found.doses
            for of, hours in dose.reached_h.items()
            if hours is not None
        ]
        notes += _noted(found.warnings)
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
