"""Claims on the sweep of damping."""

from __future__ import annotations

import math

import numpy as np

from gearmon.study.findings import (
    INDEPENDENT,
    Claim,
    Evidence,
    Finding,
    chain,
    falling,
    rising,
    verdict_of,
)
from gearmon.study.reference_case import REFERENCE
from gearmon.study.results import StudyResults
from gearmon.study.sweeps import Operation

#: Peak acceleration lines at 3, 6, 9, 12, 15, 18, 30, 60, 90 kN s/m [m/s2].
PEAKS_OF_DAMPING = (646, 388, 276, 213, 172, 145, 88, 44, 29)
KNEE_NS_PER_M = 18e3


def decay(results: StudyResults) -> Finding:
    """Slowest decay of a free vibration against damping."""
    sweep = results.sweeps["damping_ns_per_m"]
    rates = sweep.take(_slowest_decay)
    critical = 2 * math.sqrt(REFERENCE.stiffness_n_per_m * REFERENCE.mass_kg)
    evidence = (
        *(
            Evidence(quantity=f"slowest decay rate at {shown}", ours=float(rate), unit="1/s")
            for shown, rate in zip(sweep.shown, rates, strict=True)
        ),
        Evidence(quantity="critical damping 2 sqrt(k m)", ours=critical, unit="N s/m"),
    )
    below = rates[sweep.values < critical]
    return Finding(
        verdict=verdict_of(rising(below.tolist()), rising(rates.tolist())),
        reason=f"The slowest decay rate is {chain(rates.tolist(), '.0f')} 1/s: it rises up to the "
        f"critical damping of {critical:.3g} N s/m and falls beyond, where the teeth creep.",
        evidence=evidence,
    )


def peaks_of_damping(results: StudyResults) -> Finding:
    """Largest acceleration line and swing against damping."""
    sweep = results.sweeps["damping_ns_per_m"]
    peaks = sweep.take(lambda p: p.peak_acceleration)
    swing = 1e6 * sweep.take(lambda p: p.swing_m)
    evidence = tuple(
        Evidence(
            quantity=f"peak acceleration line at {shown}",
            ours=float(peak),
            unit="m/s²",
            expected=expected,
            source=INDEPENDENT,
            tolerance=0.5 / expected + 2e-3,
        )
        for shown, peak, expected in zip(sweep.shown, peaks, PEAKS_OF_DAMPING, strict=True)
    )
    return Finding(
        verdict=verdict_of(falling(peaks.tolist()), falling(swing.tolist())),
        reason=f"Peak lines {chain(peaks.tolist(), '.0f')} m/s²; the displacement swings by "
        f"{chain(swing.tolist())} µm.",
        evidence=evidence,
    )


def knee(results: StudyResults) -> Finding:
    """Which share of the drop of the peaks is done at 18 kN s/m."""
    sweep = results.sweeps["damping_ns_per_m"]
    peaks = sweep.take(lambda p: p.peak_acceleration)
    at_knee = float(peaks[sweep.values == KNEE_NS_PER_M][0])
    share = float((peaks[0] - at_knee) / (peaks[0] - peaks[-1]))
    product = sweep.values * peaks
    return Finding(
        verdict=verdict_of(share > 0.5),
        reason=f"{100 * share:.0f} % of the drop is done at {KNEE_NS_PER_M / 1e3:g} kN s/m. There "
        "is no threshold: the line on the natural frequency is close to proportional to 1/c "
        f"(c times it varies by {100 * (product.max() / product.min() - 1):.0f} %).",
        evidence=(
            Evidence(
                quantity="share of the drop up to 18 kN s/m",
                ours=100 * share,
                unit="%",
            ),
        ),
    )


def peak_stays(results: StudyResults) -> Finding:
    """Harmonic of the largest acceleration line against damping."""
    sweep = results.sweeps["damping_ns_per_m"]
    harmonics = sweep.take(lambda p: p.peak_harmonic)
    kept = bool(np.ptp(harmonics[:-1]) == 0)
    moved = bool(harmonics[-1] != harmonics[-2])
    changes = [
        f"from {before} to {after}"
        for before, after, step in zip(
            sweep.shown[:-1], sweep.shown[1:], np.diff(harmonics), strict=True
        )
        if step
    ]
    where = " and ".join(changes) or "nowhere"
    last = np.sort(sweep.points[-1].acceleration_lines)
    even = float(last[-2] / last[-1])
    return Finding(
        verdict=verdict_of(kept, moved, len(changes) <= 1),
        reason=f"Harmonics {chain(harmonics.tolist(), '.0f')}: it moves {where}. At the "
        f"largest damping the next line has {100 * even:.2f} % of the highest, so that which of "
        "them is the highest there hangs on details of the stiffness.",
        evidence=tuple(
            Evidence(quantity=f"harmonic of the peak at {shown}", ours=float(n))
            for shown, n in zip(sweep.shown, harmonics, strict=True)
        ),
    )


def _slowest_decay(point: Operation) -> float:
    largest = abs(point.response.floquet_multipliers[0])
    return -math.log(largest) / point.parameters.period_s


DAMPING_CLAIMS = (
    Claim(
        key="8a",
        text="More damping, faster decay.",
        where="Fig. 25-27",
        evaluate=decay,
    ),
    Claim(
        key="8b",
        text="More damping, lower peaks.",
        where="Fig. 25-29",
        evaluate=peaks_of_damping,
    ),
    Claim(
        key="8c",
        text="The largest drop of the peaks is up to about 18,000 N s/m.",
        where="Fig. 28, 29",
        evaluate=knee,
    ),
    Claim(
        key="8d",
        text="The frequency of the highest peak stays, except at the largest damping.",
        where="Fig. 28, 29",
        evaluate=peak_stays,
    ),
)
