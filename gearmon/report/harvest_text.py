"""A harvester survey in words."""

from __future__ import annotations

import math
from typing import Any

from gearmon.harvesting.placement import Placed, Survey
from gearmon.harvesting.response import Tuned
from gearmon.report.wording import table_lines

MICRO = 1e6
#: Units of time with their lengths [s], and how many of them are needed to be spoken of.
_UNITS = (
    ("years", 365.25 * 86400.0, 2.0),
    ("days", 86400.0, 2.0),
    ("h", 3600.0, 2.0),
    ("min", 60.0, 1.5),
)


def harvest_lines(survey: Survey, most_lines: int = 8, published: bool = False) -> list[str]:
    """Return a survey as lines of text: positions, the harvester, the energy lines, assumptions.

    Parameters
    ----------
    survey : Survey
    most_lines : int, >= 1
        Energy lines shown.
    published : bool
        Whether published harvesters are shown beside the best one.

    Returns
    -------
    list of str
        Without line ends.
    """
    best = survey.best
    text = [f"{survey.machine}: {len(survey.placed)} position(s), {survey.origin} vibration", ""]
    text += table_lines([_row(place) for place in survey.placed])
    text += ["", *_harvester_lines(best, survey.tuned), *_budget_lines(survey)]
    ranked = sorted(survey.lines(), key=lambda row: -row["share_of_time"] * row["energy_j_per_kg"])
    text += ["", "lines by energy and share of time:"]
    text += table_lines([_line(row) for row in ranked[:most_lines]])
    if survey.together:
        text += ["", *_set_lines(survey)]
    text += ["", *_band_lines(survey)]
    if published:
        text += ["", *_published_lines(survey)]
    return [*text, "", *(f"note: {note}" for note in survey.notes)]


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


def _harvester_lines(place: Placed, tuned: Tuned[Any]) -> list[str]:
    values, answers = tuned.harvester.to_dict(), tuned.answers
    volts = max(a.voltage_v for a in answers)
    if values["kind"] == "cantilever":
        what = (
            f"{values['piezo']} on {values['passive']}, {values['wiring']}, "
            f"{1e3 * values['length_m']:.3g} x {1e3 * values['width_m']:.3g} mm, tip mass "
            f"{1e3 * values['tip_mass_kg']:.3g} g, load {values['load_ohm']:.3g} ohm, "
            f"{volts:.3g} V peak"
        )
    else:
        load = (
            f"electrical damping ratio {values['electrical_damping_ratio']:.3g}"
            if values["kind"] == "inertial"
            else f"load {values['load_ohm']:.3g} ohm, {volts:.3g} V peak"
        )
        what = (
            f"{1e3 * values['mass_kg']:.3g} g on a spring of "
            f"{values['stiffness_n_per_m']:.4g} N/m, {load}"
        )
    travel = 1e3 * max(a.travel_m for a in answers)
    limits = (
        f"travel {travel:.3g} mm and {1e3 * tuned.static_travel_m:.3g} mm of its own weight "
        f"({100 * tuned.travel_share:.3g} % of the clearance), stress with that of its "
        f"weight {100 * tuned.stress_share:.3g} % of what is safe"
    )
    told = [f"best at {place.position.name}: {what}", limits]
    if math.isfinite(place.power_unseen_w):
        told.append(
            f"{MICRO * tuned.power_w:.3g} uW on the recordings that it is tuned to, "
            f"{MICRO * place.power_w:.3g} to expect: on stretches that the tuning did not know"
        )
    if math.isfinite(place.line_share):
        told.append(f"{100 * place.line_share:.0f} % of the power comes from lines")
    if math.isfinite(place.power_with_stops_w):
        told.append(
            f"beyond the clearance: tuned to {place.stops_hz:.4g} Hz it would hit its stops and "
            f"give {MICRO * place.power_with_stops_w:.3g} uW, if a blow leaves "
            f"{tuned.harvester.restitution:g} of its speed: measure that"
        )
    return [*told, *_degraded_lines(place)]


def _degraded_lines(place: Placed) -> list[str]:
    """Say what the best tuning for the damaged gear is, and what it gives while sound."""
    found, tuned = place.tuned_degraded, place.tuned
    if found is None or tuned is None:
        return []
    sound = place.degraded_best_power_when_healthy_w
    return [
        f"best once damaged: {found.harvester.natural_frequency_hz:.6g} Hz, "
        f"{MICRO * found.power_w:.4g} uW then and {MICRO * sound:.4g} uW while sound; the "
        f"tuning above gives {MICRO * place.degraded_power_w:.4g} uW then"
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
        "bandwidth against the quality factor of the mechanics, best load, one line of 1 m/s2 that "
        f"wanders by {100 * survey.wander:.2g} %:",
        *table_lines(rows),
    ]


def _published_lines(survey: Survey) -> list[str]:
    """List published harvesters, and the best one here in the place of each."""
    rows = survey.published()
    names = ("name", "frequency_hz", "acceleration_ms2", "power_uw", "uw_per_cm3", "model_uw")
    shown = [{k: row[k] for k in (*names, "own_uw", "own_uw_per_cm3", "checked")} for row in rows]
    for row in shown:
        row["name"] += "" if row.pop("checked") != "no" else " (unverified)"
    told = (f"{row['name']}: {row['source']}; {row['remark'] or ''}" for row in rows)
    return [
        "published harvesters, by model where all dimensions are known, and this one in their "
        "place (per cm3 at 1 m/s2); unverified: put down from memory, not checked in the source:",
        *table_lines(shown),
        *(line.removesuffix("; ") for line in told),
    ]


def _budget_lines(survey: Survey) -> list[str]:
    task, supply = survey.budget, survey.best.supply
    job = (
        f"{task.duration_s:g} s at {task.sampling_rate_hz:g} Hz and {task.bits} bit, "
        f"{1e3 * task.energy_j:.3g} mJ to make and send"
    )
    way = (
        f"of {MICRO * supply['harvested_w']:.3g} uW, {MICRO * supply['rectified_w']:.3g} pass the "
        f"rectifier and {MICRO * supply['regulated_w']:.3g} the converter; "
        f"{MICRO * supply['constant_w']:.3g} are taken all the time"
    )
    if not supply["starts"]:
        return [
            f"powers no recording ({job}): the voltage never gets past the rectifier "
            "and the cold start",
            way,
        ]
    if supply["interval_s"] is None:
        return [f"powers no recording ({job})", way]
    start = spoken_time(supply["charging_s"])
    often = f"powers one recording ({job}) every {spoken_time(supply['interval_s'])}"
    return [often, f"{way}; the empty store takes {start} to charge"]


def _line(row: dict[str, Any]) -> dict[str, Any]:
    return {
        "operating_point": row["operating_point"],
        "frequency_hz": row["frequency_hz"],
        "acceleration_ms2": row["acceleration_ms2"],
        "energy_uj_per_kg": MICRO * row["energy_j_per_kg"],
        "share_percent": 100 * row["share"],
    }
