"""Other detectors given the same reference as our own.

Textbook indicators are taken as the logarithm of their value over that of the reference recording,
of the gear and channel where they rose most: the best that a threshold can do without knowing where
to look. The localised difference is the strongest of what needs no template: averages subtracted,
whitened, mesh gains fitted, and the energy at one tooth held against that at the others.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.hypotheses.own_teeth import locate
from gearmon.diagnosis.results import Analysis
from gearmon.signals import indicators
from gearmon.signals.run_history import RunHistory, na4_frozen
from gearmon.signatures.measured.gear_signals import gear_signals
from gearmon.signatures.measured.measurement import MeasuredSignature
from gearmon.signatures.measured.reference import Profile

FloatArray = NDArray[np.float64]

INDICATORS = (
    "FM4",
    "M6A",
    "NA4*",
    "residual energy",
    "energy ratio",
    "sideband energy ratio",
    "sideband index",
    "sideband level factor",
)
LOCALISED = "localised difference"
#: As they stand in the results.
RIVALS = (
    "FM4",
    "NA4*",
    "residual energy",
    "kurtosis",
    "energy ratio",
    "sideband energy ratio",
    "sideband index",
    LOCALISED,
    "plain learning",
)
_LEAST = 1e-12

#: Indicator -> value by gear and channel, shape (gears, channels).
Values = dict[str, FloatArray]


def gear_values(signature: MeasuredSignature, healthy: MeasuredSignature) -> Values:
    """Compute the indicators of all gears that two recordings resolve.

    Parameters
    ----------
    signature : MeasuredSignature
    healthy : MeasuredSignature
        The reference recording; NA4* divides by its variance.
    """
    rows: dict[str, list[FloatArray]] = {name: [] for name in INDICATORS}
    wheels = {(w.stage, w.gear): w for w in healthy.plan.wheels}
    for wheel in signature.plan.wheels:
        other = wheels.get((wheel.stage, wheel.gear))
        if other is None or not len(wheel.number) or not len(other.number):
            continue
        own = gear_signals(signature.lines.mean, wheel)
        known = gear_signals(healthy.lines.mean, other)
        run = RunHistory.of(len(own.residual)).with_record(known.residual)
        values = {
            "FM4": indicators.fm4(own.difference),
            "M6A": indicators.m6a(own.difference),
            "NA4*": na4_frozen(own.residual, run.with_record(own.residual), 1),
            "residual energy": indicators.rms(own.residual) ** 2,
            "energy ratio": indicators.energy_ratio(own.difference, own.regular),
            "sideband energy ratio": indicators.sideband_energy_ratio(
                own.near_sidebands, own.fundamental
            ),
            "sideband index": indicators.sideband_index(own.first_sidebands),
            "sideband level factor": indicators.sideband_level_factor(
                own.first_sidebands, own.average
            ),
        }
        for name, value in values.items():
            rows[name].append(value)
    return {name: np.array(value) for name, value in rows.items() if value}


def rises(new: Analysis, healthy: Analysis) -> tuple[dict[str, float], FloatArray]:
    """Compare a recording with the reference by indicators.

    Parameters
    ----------
    new, healthy : Analysis

    Returns
    -------
    dict
        Greatest rise of each indicator, as natural logarithm.
    ndarray
        Features for a learning detector: greatest, mean and least rise of each.
    """
    ours = gear_values(new.signature, healthy.signature)
    theirs = gear_values(healthy.signature, healthy.signature)
    changes = {
        name: np.log(np.maximum(ours[name], _LEAST) / np.maximum(theirs[name], _LEAST))
        for name in INDICATORS
        if name in ours and ours[name].shape == theirs[name].shape
    }
    changes["kurtosis"] = _of_waveform(new, healthy)
    features = []
    for name in (*INDICATORS, "kurtosis"):
        change = changes.get(name, np.zeros(1))
        features += [float(change.max()), float(change.mean()), float(change.min())]
    rises_of = {name: float(change.max()) for name, change in changes.items()}
    rises_of[LOCALISED] = localised_difference(new.signature, healthy.signature)
    return rises_of, np.array(features)


def localised_difference(signature: MeasuredSignature, healthy: MeasuredSignature) -> float:
    """Search the whitened difference of two recordings for one tooth, without a template.

    Parameters
    ----------
    signature : MeasuredSignature
    healthy : MeasuredSignature
        The reference recording.

    Returns
    -------
    float
        -log10 of the probability of the most striking tooth of all gears; 0 if none can be judged.
    """
    own, known = Profile.of(signature), Profile.of(healthy)
    patterns = {(wheel.stage, wheel.gear): wheel for wheel in known.wheels}
    channels = range(len(signature.channel_names))
    best = 0.0
    for wheel in own.wheels:
        other = patterns.get((wheel.stage, wheel.gear))
        if other is None:
            continue
        # a pulse on shaft 1 tells where the gears on it stand
        same = own.tacho and known.tacho and abs(wheel.order - 1.0) < 1e-12
        found = locate(wheel, channels, [other], channels, numbered=same, same_zero=same)
        best = best if found is None else max(best, -found.log10_probability)
    return best


def _of_waveform(new: Analysis, healthy: Analysis) -> FloatArray:
    rows = [analysis.indicators["kurtosis"] for analysis in (new, healthy)]
    shared = [name for name in rows[0] if name in rows[1]]
    return np.array([np.log(rows[0][name] / rows[1][name]) for name in shared])
