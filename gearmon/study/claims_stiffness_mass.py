"""Claims on the sweeps of stiffness and mass."""

from __future__ import annotations

import math

import numpy as np

from gearmon.study.contact import LARGEST_STUDIED_MASS_KG, ContactStudy
from gearmon.study.findings import (
    INDEPENDENT,
    STUDY,
    Claim,
    Evidence,
    Finding,
    chain,
    falling,
    rising,
    verdict_of,
)
from gearmon.study.reference_case import DAMPING_VALUES
from gearmon.study.results import StudyResults
from gearmon.study.sweeps import POINTS_PER_PERIOD, Operation, Sweep

# Peaks of lines are "about constant" within this share, and a line "dominates" above this share.
CONSTANT, DOMINATES = 0.1, 0.5
LIGHT_KG, HEAVY_KG = 0.6, 1.5


def displacement_of_stiffness(results: StudyResults) -> Finding:
    """Mean and swing of the displacement against stiffness."""
    sweep = results.sweeps["stiffness_n_per_m"]
    swing = 1e6 * sweep.take(lambda p: p.swing_m)
    mean = 1e6 * sweep.take(lambda p: float(p.response.displacement[0].real))
    evidence = (
        *_ends(sweep, "mean displacement", mean, "µm"),
        *_ends(sweep, "peak to peak of the displacement", swing, "µm"),
    )
    return Finding(
        verdict=verdict_of(falling(swing.tolist()), falling(mean.tolist())),
        reason=f"Peak to peak {chain(swing.tolist())} µm: nearly F/k times the same shape.",
        evidence=evidence,
    )


def lines_stay(results: StudyResults) -> Finding:
    """Whether the vibration repeats with the mesh period at every stiffness."""
    sweep = results.sweeps["stiffness_n_per_m"]
    repeats = sweep.take(_change_of_last_period)
    evidence = (
        Evidence(
            quantity="change from the third to the fourth mesh period after rest, over the peak "
            "to peak; largest of all stiffnesses",
            ours=float(repeats.max()),
            expected=0.0,
            source="lines at whole mesh orders alone",
            tolerance=1e-6,
        ),
        Evidence(
            quantity="mesh frequency",
            ours=1 / results.reference.parameters.period_s,
            unit="Hz",
            expected=results.gears.mesh_frequency_hz,
            source=STUDY,
            tolerance=0.02,
        ),
    )
    return Finding(
        verdict=verdict_of(*(item.agrees for item in evidence)),
        reason="Only multiples of the mesh frequency are left once the start is forgotten, at "
        "every stiffness; with the printed period they are multiples of "
        f"{evidence[1].ours:.0f} Hz, with the printed speed of {evidence[1].expected:.1f} Hz.",
        evidence=evidence,
    )


def energy_moves_up(results: StudyResults) -> Finding:
    """Mean frequency of the energy lines against stiffness."""
    sweep = results.sweeps["stiffness_n_per_m"]
    centroid = sweep.take(lambda p: p.energy_centroid_hz)
    return Finding(
        verdict=verdict_of(rising(centroid.tolist())),
        reason=f"Mean frequency of the energy lines {chain(centroid.tolist(), '.0f')} Hz.",
        evidence=_ends(sweep, "mean frequency of the energy lines", centroid, "Hz"),
    )


def constant_peak(results: StudyResults) -> Finding:
    """Largest acceleration line, and its harmonic, against stiffness."""
    sweep = results.sweeps["stiffness_n_per_m"]
    peaks = sweep.take(lambda p: p.peak_acceleration)
    harmonics = sweep.take(lambda p: p.peak_harmonic)
    evidence = (
        _expected("smallest peak acceleration line", peaks.min(), "m/s²", 276, 5e-3),
        _expected("largest peak acceleration line", peaks.max(), "m/s²", 291, 5e-3),
        _expected(f"harmonic of the peak at {sweep.shown[0]}", harmonics[0], "", 7, 0.0),
        _expected(f"harmonic of the peak at {sweep.shown[-1]}", harmonics[-1], "", 17, 0.0),
    )
    spread = float(peaks.max() / peaks.min() - 1)
    return Finding(
        verdict=verdict_of(spread < CONSTANT, rising(harmonics.tolist())),
        reason=f"Peaks {chain(peaks.tolist(), '.0f')} m/s², {100 * spread:.0f} % apart, at "
        f"harmonics {chain(harmonics.tolist(), '.0f')}: near the natural frequency.",
        evidence=evidence,
    )


def first_line_dominates(results: StudyResults) -> Finding:
    """Whether the mesh frequency itself is the largest line of the acceleration."""
    sweep = results.sweeps["stiffness_n_per_m"]
    share = sweep.take(lambda p: float(p.acceleration_lines[1] / p.peak_acceleration))
    in_displacement = all(np.abs(p.response.displacement[1:]).argmax() == 0 for p in sweep.points)
    return Finding(
        verdict=verdict_of(bool(share[0] > DOMINATES)),
        reason=f"At {sweep.shown[0]} the line at the mesh frequency is {100 * share[0]:.0f} % of "
        f"the largest acceleration line, at {sweep.shown[-1]} {100 * share[-1]:.0f} %; in the "
        f"displacement it is the largest line "
        f"{'everywhere' if in_displacement else 'not everywhere'}.",
        evidence=_ends(sweep, "first line over the largest line, acceleration", share, ""),
    )


def peaks_diminish(results: StudyResults) -> Finding:
    """Whether peaks of velocity and acceleration fall as stiffness rises."""
    sweep = results.sweeps["stiffness_n_per_m"]
    velocity = 1e3 * sweep.take(lambda p: float(2 * np.abs(p.response.velocity).max()))
    waveform = sweep.take(lambda p: float(np.abs(p.waveform.acceleration_ms2).max()))
    lines = sweep.take(lambda p: p.peak_acceleration)
    evidence = (
        *_ends(sweep, "largest velocity line", velocity, "mm/s"),
        *_ends(sweep, "largest acceleration line", lines, "m/s²"),
        *_ends(sweep, "peak of the acceleration in time", waveform, "m/s²"),
    )
    return Finding(
        verdict=verdict_of(falling(velocity.tolist()), lines[-1] < (1 - CONSTANT) * lines[0]),
        reason=f"Velocity lines fall ({chain(velocity.tolist())} mm/s), acceleration lines do not "
        "(6d, which the study says too). In time the peak acceleration falls by "
        f"{100 * (1 - waveform[-1] / waveform[0]):.0f} %.",
        evidence=evidence,
    )


def displacement_of_mass(results: StudyResults) -> Finding:
    """Swing and period of the free vibration against mass."""
    sweep = results.sweeps["mass_kg"]
    swing = 1e6 * sweep.take(lambda p: p.swing_m)
    natural = sweep.take(lambda p: p.response.problem.natural_frequency_hz)
    largest = int(swing.argmax())
    ratio = sweep.points[largest].response.problem.frequency_ratio
    evidence = (
        *_ends(sweep, "peak to peak of the displacement", swing, "µm"),
        Evidence(quantity="mass with the largest swing", ours=sweep.values[largest], unit="kg"),
        Evidence(quantity="natural over mesh frequency there", ours=ratio),
        *_ends(sweep, "natural frequency", natural, "Hz"),
    )
    return Finding(
        verdict=verdict_of(
            rising(swing.tolist()), bool(swing[-1] > swing[0]), falling(natural.tolist())
        ),
        reason=f"Peak to peak {chain(swing.tolist())} µm: it grows to {sweep.shown[largest]}, "
        f"where harmonic {round(ratio)} lies on the natural frequency, and is smaller beyond. The "
        "free vibration slows down throughout.",
        evidence=evidence,
    )


def acceleration_of_mass(results: StudyResults) -> Finding:
    """Peaks and band of the acceleration against mass."""
    sweep = results.sweeps["mass_kg"]
    peaks = sweep.take(lambda p: p.peak_acceleration)
    band = sweep.take(lambda p: p.energy_band_hz)
    light, heavy = peaks[sweep.values < LIGHT_KG], peaks[sweep.values >= HEAVY_KG]
    evidence = (
        *_ends(sweep, "largest acceleration line", peaks, "m/s²"),
        Evidence(quantity="least of the peaks below 0.6 kg", ours=float(light.min()), unit="m/s²"),
        Evidence(quantity="largest peak at 1.5 kg or more", ours=float(heavy.max()), unit="m/s²"),
        *_ends(sweep, "highest line with a tenth of the largest energy", band, "Hz"),
    )
    return Finding(
        verdict=verdict_of(bool(light.min() > heavy.max()), falling(band.tolist())),
        reason=f"Peaks {chain(peaks.tolist(), '.0f')} m/s²; the energy reaches up to "
        f"{chain(band.tolist(), '.0f')} Hz. Not in equal steps: the peak is high wherever an odd "
        "harmonic meets the natural frequency.",
        evidence=evidence,
    )


def contact_loss(results: StudyResults) -> Finding:
    """Whether the teeth part at 3 kg, and where they do."""
    heavy = results.sweeps["mass_kg"].points[-1]
    contact = results.contact
    z, force = heavy.waveform.displacement_m, heavy.waveform.mesh_force_n
    started = heavy.start.motion.mesh_force_n
    after_first_peak = started[int(started[:POINTS_PER_PERIOD].argmax()) :]
    evidence = (
        _expected("least steady displacement at 3 kg", 1e6 * z.min(), "µm", 3.6, 0.015),
        Evidence(quantity="least steady mesh force at 3 kg", ours=float(force.min()), unit="N"),
        Evidence(
            quantity="least steady displacement at 3 kg, counted from F/k0",
            ours=1e6 * float(z.min() - heavy.parameters.static_deflection_m),
            unit="µm",
        ),
        Evidence(
            quantity="least mesh force after the first peak from rest at 3 kg",
            ours=float(after_first_peak.min()),
            unit="N",
        ),
        _limit("least mass that loses contact", contact.first_mass_kg, "kg"),
        _limit("largest damping that loses contact at 3 kg", contact.first_damping, "N s/m"),
        _limit("least eps that loses contact at 3 kg", contact.first_variation, ""),
        Evidence(
            quantity="least mesh force over F for all masses to 3 kg and dampings from 3 kN s/m",
            ours=_least_in_study(contact),
        ),
        Evidence(
            quantity="natural over mesh frequency at the least mass that loses contact",
            ours=math.nan
            if contact.first_mass_kg is None
            else math.sqrt(heavy.parameters.stiffness_n_per_m / contact.first_mass_kg)
            * heavy.parameters.period_s
            / (2 * math.pi),
        ),
    )
    lost = bool(force.min() <= 0 or z.min() <= 0)
    return Finding(
        verdict=verdict_of(lost),
        reason=f"At {LARGEST_STUDIED_MASS_KG:g} kg the steady displacement stays above "
        f"{1e6 * z.min():.2f} µm and the mesh force above {force.min():.0f} N; from rest the force "
        f"comes back to {after_first_peak.min():.0f} N and no less. Only counted from F/k0 is the "
        f"displacement negative, as it is at every mass. {_where_lost(results)}",
        evidence=evidence,
    )


def _where_lost(results: StudyResults) -> str:
    contact = results.contact
    mass = (
        f"The mass alone would have to reach {contact.first_mass_kg:.1f} kg"
        if contact.first_mass_kg is not None
        else "No mass in the range scanned is large enough"
    )
    variation = (
        f"at 3 kg eps would have to reach {contact.first_variation:.2f}"
        if contact.first_variation is not None
        else "at 3 kg no eps is large enough"
    )
    damping = (
        f"or the damping fall to {contact.first_damping:.3g} N s/m"
        if contact.first_damping is not None
        else f"and no damping down to {contact.dampings.min():.0f} N s/m does it"
    )
    return (
        f"{mass}; {variation}, {damping}. Within the study's ranges of mass and damping together "
        f"the force never falls below {_least_in_study(contact):.2f} F."
    )


def _least_in_study(contact: ContactStudy) -> float:
    light = contact.map_masses_kg <= LARGEST_STUDIED_MASS_KG
    damped = contact.map_dampings >= min(DAMPING_VALUES)
    return float(contact.of_both[np.ix_(damped, light)].min())


def _change_of_last_period(point: Operation) -> float:
    z = point.start.motion.displacement_m
    last, before = z[-POINTS_PER_PERIOD:], z[-2 * POINTS_PER_PERIOD : -POINTS_PER_PERIOD]
    return float(np.abs(last - before).max() / np.ptp(last))


def _ends(sweep: Sweep, what: str, values: np.ndarray, unit: str) -> tuple[Evidence, Evidence]:
    first, last = (
        Evidence(quantity=f"{what} at {sweep.shown[i]}", ours=float(values[i]), unit=unit)
        for i in (0, -1)
    )
    return first, last


def _expected(quantity: str, ours: float, unit: str, expected: float, tolerance: float) -> Evidence:
    return Evidence(
        quantity=quantity,
        ours=float(ours),
        unit=unit,
        expected=expected,
        source=INDEPENDENT,
        tolerance=tolerance,
    )


def _limit(quantity: str, value: float | None, unit: str) -> Evidence:
    return Evidence(quantity=quantity, ours=math.nan if value is None else value, unit=unit)


SWEEP_CLAIMS = (
    Claim(
        key="6a",
        text="Lower stiffness, larger displacement.",
        where="Fig. 8, 11, 15",
        evaluate=displacement_of_stiffness,
    ),
    Claim(
        key="6b",
        text="The mesh frequency and its harmonics stay whatever the stiffness.",
        where="Fig. 15-19",
        evaluate=lines_stay,
    ),
    Claim(
        key="6c",
        text="Energy moves to higher frequencies as stiffness rises.",
        where="Fig. 16-19",
        evaluate=energy_moves_up,
    ),
    Claim(
        key="6d",
        text="The peak acceleration is about the same at every stiffness, at a rising frequency.",
        where="Fig. 10, 13, 14",
        evaluate=constant_peak,
    ),
    Claim(
        key="6e",
        text="The mesh frequency dominates the acceleration at low stiffness.",
        where="Fig. 18, 19",
        evaluate=first_line_dominates,
    ),
    Claim(
        key="6f",
        text="Peaks of velocity and acceleration diminish as stiffness rises.",
        where="Fig. 9, 16-19",
        evaluate=peaks_diminish,
    ),
    Claim(
        key="7a",
        text="Larger mass, larger and slower oscillation of the displacement.",
        where="Fig. 20-22",
        evaluate=displacement_of_mass,
    ),
    Claim(
        key="7b",
        text="Small masses have higher acceleration peaks, spread over a wider band.",
        where="Fig. 23, 24",
        evaluate=acceleration_of_mass,
    ),
    Claim(
        key="7c",
        text="At 3 kg the teeth lose contact; above, the model does not apply.",
        where="Fig. 21",
        evaluate=contact_loss,
    ),
)
