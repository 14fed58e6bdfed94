"""Condition indicators of a measured signature, gear by gear.

What a gear's signals hold and what was taken out of them is told in `gear_signals`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearmon.signals import indicators
from gearmon.signatures.families import WheelLines
from gearmon.signatures.gear_signals import gear_signals
from gearmon.signatures.measured import MeasuredSignature

FloatArray = NDArray[np.float64]

Table = dict[str, dict[str, float]]


def waveform_indicators(samples: FloatArray, channel_names: tuple[str, ...]) -> Table:
    """Compute indicators of the raw vibration: name -> channel -> value.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        Vibration.
    channel_names : tuple of str
        Names.

    Returns
    -------
    dict
        "rms", "peak to peak", "crest factor" and "kurtosis".
    """
    rows = {
        name: indicators.describe_waveform(channel)
        for name, channel in zip(channel_names, samples, strict=True)
    }
    return {
        "rms": {name: row.rms for name, row in rows.items()},
        "peak to peak": {name: row.peak_to_peak for name, row in rows.items()},
        "crest factor": {name: row.crest_factor for name, row in rows.items()},
        "kurtosis": {name: row.kurtosis for name, row in rows.items()},
    }


def gear_indicators(signature: MeasuredSignature) -> Table:
    """Compute indicators of every gear's synchronous average: name -> channel -> value.

    Parameters
    ----------
    signature : MeasuredSignature
        Measured lines.

    Returns
    -------
    dict
        FM0, FM4, M6A, M8A, energy ratio, SER, each with the gear in its name.
    """
    table: Table = {}
    for wheel in signature.plan.wheels:
        where = f"{wheel.gear} of stage {wheel.stage}"
        for name, values in _of_wheel(signature, wheel).items():
            row = zip(signature.channel_names, values, strict=True)
            table[f"{name}, {where}"] = {channel: float(value) for channel, value in row}
    return table


def _of_wheel(signature: MeasuredSignature, wheel: WheelLines) -> dict[str, FloatArray]:
    own = gear_signals(signature.lines.mean, wheel)
    return {
        "FM0": indicators.fm0(own.average, own.mesh_amplitude),
        "FM4": indicators.fm4(own.difference),
        "M6A": indicators.m6a(own.difference),
        "M8A": indicators.m8a(own.difference),
        "energy ratio": indicators.energy_ratio(own.difference, own.regular),
        "SER": indicators.sideband_energy_ratio(own.near_sidebands, own.fundamental),
    }
