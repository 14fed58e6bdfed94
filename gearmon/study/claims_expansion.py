"""Claims on the expansion: its orders, the start from rest, the frequency ratio."""

from __future__ import annotations

import cmath
import math

import numpy as np

from gearmon.dynamics.free_vibration import free_vibration
from gearmon.study.expansion import PUBLISHED_ORDER
from gearmon.study.findings import CLOSED_FORM, STUDY, Claim, Evidence, Finding, chain, verdict_of
from gearmon.study.reference_case import REFERENCE
from gearmon.study.results import StudyResults


def orders(results: StudyResults) -> Finding:
    """Errors of the orders and the power of eps with which they fall."""
    study = results.orders
    sums = study.expansion.terms[:3].sum(axis=0)
    micro = 1e6
    evidence = (
        Evidence(
            quantity="mean displacement, exact",
            ours=micro * float(study.exact.displacement[0].real),
            unit="µm",
            expected=5.083524,
            source=CLOSED_FORM,
            tolerance=2e-7,
        ),
        Evidence(
            quantity="mean displacement, second order",
            ours=micro * float(sums[0].real),
            unit="µm",
            expected=5.082153,
            source=CLOSED_FORM,
            tolerance=2e-7,
        ),
        Evidence(
            quantity="largest error of the first order over the largest displacement",
            ours=100 * float(study.displacement_errors[1]),
            unit="%",
            expected=3.3,
            source=CLOSED_FORM,
            tolerance=0.02,
        ),
        Evidence(
            quantity="largest error of the second order over the largest displacement",
            ours=100 * float(study.displacement_errors[2]),
            unit="%",
            expected=0.51,
            source=CLOSED_FORM,
            tolerance=0.02,
        ),
        *(
            Evidence(
                quantity=f"power of eps in the error of order {order}",
                ours=float(study.slopes[order]),
                expected=order + 1.0,
                source=STUDY,
                tolerance=0.02,
            )
            for order in range(3)
        ),
        Evidence(
            quantity="relative error of the acceleration, second order",
            ours=100 * float(study.acceleration_errors[2]),
            unit="%",
        ),
    )
    return Finding(
        verdict=verdict_of(*(item.agrees for item in evidence)),
        reason=f"The error of orders 0, 1, 2 falls as eps to the power "
        f"{chain(study.slopes[:3].tolist(), '.2f')}. At eps = {REFERENCE.variation:g} the second "
        f"order is off by {100 * study.displacement_errors[2]:.2f} % in displacement and "
        f"{100 * study.acceleration_errors[2]:.1f} % in acceleration.",
        evidence=evidence,
    )


def from_rest(results: StudyResults) -> Finding:
    """Solutions from rest, and the free vibration that they start with."""
    problem = results.reference.response.problem
    textbook = free_vibration(problem, PUBLISHED_ORDER, small_damping=True)
    exact = _free_frequency_hz(results)
    points = [point for sweep in results.sweeps.values() for point in sweep.points]
    solved = [point.start.error for point in points if point.start.method == "multiple scales"]
    left = len(points) - len(solved)
    evidence = (
        Evidence(
            quantity="largest error of the displacement from rest, reference case",
            ours=100 * results.reference.start.error,
            unit="%",
        ),
        Evidence(quantity="the same, largest of all sweeps", ours=100 * max(solved), unit="%"),
        Evidence(
            quantity="starts left to direct integration (damping next to critical)",
            ours=float(left),
        ),
        Evidence(
            quantity="frequency of the free vibration, damping in the first order",
            ours=textbook.frequency_hz,
            unit="Hz",
            expected=exact,
            source="Floquet exponent",
            tolerance=0.01,
        ),
        Evidence(
            quantity="its decay rate, damping in the first order",
            ours=textbook.decay_per_s,
            unit="1/s",
            expected=-math.log(abs(results.reference.response.floquet_multipliers[0]))
            / problem.period_s,
            source="Floquet exponent",
            tolerance=1e-6,
        ),
    )
    return Finding(
        verdict=verdict_of(max(solved) < 0.01, all(item.agrees for item in evidence)),
        reason="With the secular terms removed and the damping in order zero the starts from rest "
        f"are within {100 * max(solved):.1f} % of direct integration in {len(solved)} of "
        f"{len(points)} cases (not expanded next to critical damping: {left}). With the damping in "
        f"the first order, as in the study, the free vibration has {textbook.frequency_hz:.0f} Hz "
        f"instead of {exact:.0f} Hz.",
        evidence=evidence,
    )


def _free_frequency_hz(results: StudyResults) -> float:
    """Frequency of the free vibration from the Floquet multiplier, next to the damped one."""
    response = results.reference.response
    problem = response.problem
    damped = problem.natural_frequency_hz * math.sqrt(1 - problem.damping_ratio**2)
    turn = cmath.phase(response.floquet_multipliers[0]) / (2 * math.pi * problem.period_s)
    # known up to its sign and whole mesh frequencies
    choices = [
        sign * turn + round((damped - sign * turn) * problem.period_s) / problem.period_s
        for sign in (1, -1)
    ]
    return min(choices, key=lambda frequency: abs(frequency - damped))


def frequency_ratio(results: StudyResults) -> Finding:
    """Whether the ratio of natural to mesh frequency follows from the printed parameters."""
    ratio = results.reference.response.problem.frequency_ratio
    evidence = (
        Evidence(
            quantity="natural over mesh frequency, of the printed parameters",
            ours=ratio,
            expected=16.0,
            source="256 = 16² in the study",
        ),
        Evidence(quantity="its square", ours=ratio**2, expected=256.0, source=STUDY),
        Evidence(
            quantity="256 (1 + 4/pi), the likeliest origin of 582",
            ours=256 * (1 + 4 / np.pi),
            expected=582.0,
            source=STUDY,
            tolerance=5e-4,
        ),
    )
    return Finding(
        verdict="cannot be checked" if not evidence[0].agrees else "reproduced",
        reason=f"The printed parameters have the ratio {ratio:.2f}, not 16, and the relation that "
        "would explain the numbers 256 and 582 is lost. We compute with the printed parameters.",
        evidence=evidence,
    )


EXPANSION_CLAIMS = (
    Claim(
        key="5a",
        text="Orders 0, 1 and 2 by multiple scales; the error is of the next order of eps.",
        where="eq. 9-26",
        evaluate=orders,
    ),
    Claim(
        key="5b",
        text="With the secular terms removed, displacement and velocity follow from the initial "
        "conditions.",
        where="eq. 23-26, Fig. 4-6",
        evaluate=from_rest,
    ),
    Claim(
        key="5c",
        text="The natural frequency is 16 mesh frequencies (256 and 582 in the equations).",
        where="eq. 9",
        evaluate=frequency_ratio,
    ),
)
