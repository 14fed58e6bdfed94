"""The tables of the study: claims with their numbers, sweeps, and which picture is which figure."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence
from typing import Any

from gearmon.report.study_index import figure_index
from gearmon.study.findings import Evidence, Judged
from gearmon.study.results import StudyResults
from gearmon.study.sweeps import Operation, Sweep

CLAIM_COLUMNS = (
    "claim",
    "text",
    "where",
    "verdict",
    "reason",
    "quantity",
    "ours",
    "unit",
    "expected",
    "source",
    "difference",
    "agrees",
)
SWEEP_COLUMNS = (
    "parameter",
    "value",
    "natural_frequency_hz",
    "damping_ratio",
    "mean_displacement_m",
    "displacement_swing_m",
    "least_displacement_m",
    "least_mesh_force_n",
    "peak_acceleration_ms2",
    "peak_harmonic",
    "total_energy_j_per_kg",
    "total_energy_j",
    "mean_energy_frequency_hz",
    "energy_band_hz",
    "second_order_error",
    "start_error",
    "start_method",
    "error_bound",
    "method",
)


def claim_rows(judged: Sequence[Judged]) -> list[dict[str, Any]]:
    """One row for every number behind every claim."""
    return [
        {
            "claim": entry.claim.key,
            "text": entry.claim.text,
            "where": entry.claim.where,
            "verdict": entry.finding.verdict,
            "reason": entry.finding.reason,
            "quantity": item.quantity,
            "ours": item.ours,
            "unit": item.unit,
            "expected": item.expected,
            "source": item.source,
            "difference": item.difference,
            "agrees": item.agrees if item.expected is not None else None,
        }
        for entry in judged
        for item in entry.finding.evidence
    ]


def sweep_rows(results: StudyResults) -> list[dict[str, Any]]:
    """One row for every value of every sweep."""
    return [
        {"parameter": sweep.name, "value": float(value)} | _operation(point)
        for sweep in results.sweeps.values()
        for value, point in zip(sweep.values, sweep.points, strict=True)
    ]


def figure_rows() -> list[dict[str, Any]]:
    """One row for every figure of the study."""
    return [
        {"figure": number, "picture": f"{picture.name}.png", "title": picture.title}
        for number, picture in figure_index().items()
    ]


def as_csv(rows: Sequence[dict[str, Any]], columns: Iterable[str]) -> str:
    """Write rows as comma-separated text; nothing where there is no value."""
    target = io.StringIO()
    writer = csv.DictWriter(target, fieldnames=list(columns), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return target.getvalue()


def shown_number(value: float | None) -> str:
    """Write a number to four digits.

    Examples
    --------
    >>> shown_number(276.19071), shown_number(None), shown_number(float("nan"))
    ('276.2', '', 'none')
    """
    if value is None:
        return ""
    if math.isnan(value):
        return "none"
    if value == 0 or 1e-3 <= abs(value) < 1e5:
        return f"{value:.4g}"
    return f"{value:.2e}"


def shown_difference(item: Evidence) -> str:
    """Write the difference of a number to the expected one."""
    if item.difference is None:
        return ""
    if item.expected == 0:
        return shown_number(item.difference)
    if abs(item.difference) < 5e-5:
        return "< 0.01 %"
    return f"{100 * item.difference:+.2f} %"


def shown_sweep(sweep: Sweep) -> list[list[str]]:
    """Rows of a sweep for reading: value, peak line, its harmonic, energy, force, second order."""
    return [
        [
            shown,
            f"{point.response.problem.natural_frequency_hz:.0f}",
            f"{point.response.problem.damping_ratio:.3f}",
            f"{1e6 * point.swing_m:.2f}",
            f"{point.peak_acceleration:.1f}",
            f"{point.peak_harmonic}",
            f"{1e6 * point.total_energy:.1f}",
            f"{1e6 * point.total_energy * point.parameters.mass_kg:.1f}",
            f"{point.waveform.mesh_force_n.min():.0f}",
            f"{100 * point.second_order_error:.1f}",
        ]
        for shown, point in zip(sweep.shown, sweep.points, strict=True)
    ]


SHOWN_SWEEP_HEADINGS = (
    "value",
    "natural frequency, Hz",
    "damping ratio",
    "displacement peak to peak, µm",
    "largest acceleration line, m/s²",
    "its harmonic",
    "energy, µJ/kg",
    "energy with m, µJ",
    "least mesh force, N",
    "error of second order in acceleration, %",
)


def _operation(point: Operation) -> dict[str, Any]:
    problem, waveform = point.response.problem, point.waveform
    return {
        "natural_frequency_hz": problem.natural_frequency_hz,
        "damping_ratio": problem.damping_ratio,
        "mean_displacement_m": float(point.response.displacement[0].real),
        "displacement_swing_m": point.swing_m,
        "least_displacement_m": float(waveform.displacement_m.min()),
        "least_mesh_force_n": float(waveform.mesh_force_n.min()),
        "peak_acceleration_ms2": point.peak_acceleration,
        "peak_harmonic": point.peak_harmonic,
        "total_energy_j_per_kg": point.total_energy,
        "total_energy_j": point.total_energy * point.parameters.mass_kg,
        "mean_energy_frequency_hz": point.energy_centroid_hz,
        "energy_band_hz": point.energy_band_hz,
        "second_order_error": point.second_order_error,
        "start_error": point.start.error,
        "start_method": point.start.method,
        "error_bound": point.response.error_bound,
        "method": point.response.method,
    }
