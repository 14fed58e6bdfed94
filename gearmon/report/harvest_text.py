"""A harvester survey in words."""

from __future__ import annotations

import math
from typing import Any

from gearmon.harvesting.placement import Placed, Survey
from gearmon.report.text_tables import table_lines

MICRO = 1e6


def harvest_lines(survey: Survey, most_lines: int = 8) -> list[str]:
    """Return a survey as lines of text: positions, the harvester, the energy lines, assumptions.

    Parameters
    ----------
    survey : Survey
    most_lines : int, >= 1
        Energy lines shown.
    """
    best = survey.best
    text = [f"{survey.machine}: {len(survey.placed)} position(s), {survey.origin} vibration", ""]
    text += table_lines([_row(place) for place in survey.placed])
    if best.tuned is not None:
        text += ["", *_harvester_lines(best), _budget_line(survey)]
    ranked = sorted(survey.lines(), key=lambda row: -row["share_of_time"] * row["energy_j_per_kg"])
    text += ["", "lines by energy and share of time:"]
    text += table_lines([_line(row) for row in ranked[:most_lines]])
    if survey.together:
        text += ["", *_set_lines(survey)]
    if best.tuned is not None:
        text += ["", *_band_lines(survey)]
    return [*text, "", *(f"note: {note}" for note in survey.notes)]


def _row(place: Placed) -> dict[str, Any]:
    row = place.to_dict()
    often = place.interval_s / 60
    return {
        "position": row["position"],
        "tuned_to_hz": row["natural_frequency_hz"],
        "power_uw": MICRO * place.power_w,
        "interval_90_uw": _interval(place),
        "damaged_uw": _micro(row["degraded_power_w"]),
        "best_damaged_hz": row["degraded_best_hz"],
        "best_damaged_uw": _micro(row["degraded_best_power_w"]),
        "minutes_between_recordings": often if math.isfinite(often) else None,
        "remark": place.refusal
        or ("better only when damaged" if place.good_only_when_damaged else ""),
    }


def _interval(place: Placed) -> str:
    if not math.isfinite(place.power_low_w):
        return ""
    return f"{MICRO * place.power_low_w:.3g} to {MICRO * place.power_high_w:.3g}"


def _micro(value: float | None) -> float | None:
    return None if value is None else MICRO * value


def _harvester_lines(place: Placed) -> list[str]:
    assert place.tuned is not None
    values = place.tuned.harvester.to_dict()
    answers = place.tuned.answers
    if values["kind"] == "cantilever":
        what = (
            f"{values['piezo']} on {values['passive']}, {values['wiring']}, "
            f"{1e3 * values['length_m']:.3g} x {1e3 * values['width_m']:.3g} mm, tip mass "
            f"{1e3 * values['tip_mass_kg']:.3g} g, load {values['load_ohm']:.3g} ohm, "
            f"{max(a.voltage_v for a in answers):.3g} V peak"
        )
    else:
        what = (
            f"{1e3 * values['mass_kg']:.3g} g on a spring of "
            f"{values['stiffness_n_per_m']:.4g} N/m, electrical damping ratio "
            f"{values['electrical_damping_ratio']:.3g}"
        )
    travel = 1e3 * max(a.travel_m for a in answers)
    limits = (
        f"travel {travel:.3g} mm ({100 * place.tuned.travel_share:.3g} % of the clearance), stress "
        f"{100 * place.tuned.stress_share:.3g} % of what is safe"
    )
    return [f"best at {place.position.name}: {what}", limits, *_degraded_lines(place)]


def _degraded_lines(place: Placed) -> list[str]:
    """Say what the best tuning for the damaged gear is, and what it gives while sound."""
    found, tuned = place.tuned_degraded, place.tuned
    if found is None or tuned is None:
        return []
    return [
        f"best once damaged: {found.harvester.natural_frequency_hz:.6g} Hz, "
        f"{MICRO * found.power_w:.4g} uW then and {MICRO * place.healthy_power_of_degraded_w:.4g} "
        f"uW while sound; the tuning above gives {MICRO * place.degraded_power_w:.4g} uW then"
    ]


def _set_lines(survey: Survey) -> list[str]:
    """Tunings of a set, and what they yield together at each operating point."""
    names = [point.vibration.name for point in survey.best.position.healthy]
    rows = [
        {
            "tuned_to_hz": tuned.harvester.natural_frequency_hz,
            "load": tuned.harvester.load,
            **{
                f"{name} uw": MICRO * found.power_w
                for name, found in zip(names, tuned.answers, strict=True)
            },
        }
        for tuned in survey.together
    ]
    worst = min(sum(t.answers[k].power_w for t in survey.together) for k in range(len(names)))
    return [
        f"set of {len(rows)}, for the worst operating point ({MICRO * worst:.4g} uW together):",
        *table_lines(rows),
    ]


def _band_lines(survey: Survey) -> list[str]:
    """Bandwidth of the best harvester, and against the quality factor of its mechanics."""
    rows = [
        {
            "quality_factor": row["quality_factor"],
            "loaded": row["loaded_quality_factor"],
            "bandwidth_hz": row["width_hz"],
            "peak_uw": MICRO * row["peak_power_w"],
            "wandering_uw": MICRO * row["power_w"],
        }
        for row in survey.bandwidths()
    ]
    return [
        "bandwidth against the quality factor of the mechanics, best load, one line of 1 m/s2:",
        *table_lines(rows),
    ]


def _budget_line(survey: Survey) -> str:
    task, interval = survey.budget, survey.best.interval_s
    job = (
        f"{task.duration_s:g} s at {task.sampling_rate_hz:g} Hz and {task.bits} bit, "
        f"{1e3 * task.energy_j:.3g} mJ to make and send"
    )
    if math.isfinite(interval):
        return f"powers one recording ({job}) every {interval / 60:.3g} min"
    needed = MICRO * task.sleep_power_w / task.efficiency
    return f"powers no recording ({job}): sleeping alone takes {needed:.3g} uW of harvested power"


def _line(row: dict[str, Any]) -> dict[str, Any]:
    return {
        "operating_point": row["operating_point"],
        "frequency_hz": row["frequency_hz"],
        "acceleration_ms2": row["acceleration_ms2"],
        "energy_uj_per_kg": MICRO * row["energy_j_per_kg"],
        "share_percent": 100 * row["share"],
    }
