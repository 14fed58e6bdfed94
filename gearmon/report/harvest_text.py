"""A harvester survey in words."""

from __future__ import annotations

import math
from typing import Any

from gearmon.harvesting.placement import Placed, Survey
from gearmon.report.page import template

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
        places=[_row(place) for place in survey.placed],
        lines=[_line(row) for row in ranked[:_MOST_LINES]],
        together=[
            {"tuned_to_hz": tuned.harvester.natural_frequency_hz, "load": tuned.harvester.load}
            | {f"{name} uw": MICRO * power for name, power in zip(names, own, strict=True)}
            for tuned, own in zip(survey.together, powers, strict=True)
        ],
        worst_w=min(map(sum, zip(*powers, strict=True)), default=0.0),
        bands=[_band(row) for row in survey.bandwidths()],
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


def _row(place: Placed) -> dict[str, Any]:
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


def _band(row: dict[str, float]) -> dict[str, float]:
    """Return the bandwidth of the best harvester at a quality factor of its mechanics."""
    return {
        "quality_factor": row["quality_factor"],
        "loaded": row["loaded_quality_factor"],
        "bandwidth_hz": row["width_hz"],
        "peak_uw": MICRO * row["peak_power_w"],
        "wandering_uw": MICRO * row["power_w"],
    }


def _published(row: dict[str, Any]) -> dict[str, Any]:
    """Return a published harvester, and the best one here in its place."""
    names = ("frequency_hz", "acceleration_ms2", "power_uw", "uw_per_cm3", "model_uw")
    unsure = " (unverified)" if row["checked"] == "no" else ""
    shown = {name: row[name] for name in (*names, "own_uw", "own_uw_per_cm3")}
    return {"name": row["name"] + unsure} | shown


def _line(row: dict[str, Any]) -> dict[str, Any]:
    return {
        "operating_point": row["operating_point"],
        "frequency_hz": row["frequency_hz"],
        "acceleration_ms2": row["acceleration_ms2"],
        "energy_uj_per_kg": MICRO * row["energy_j_per_kg"],
        "share_percent": 100 * row["share"],
    }
