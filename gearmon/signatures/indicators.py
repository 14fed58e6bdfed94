"""Condition indicators of a measured signature, gear by gear.

Every gear's synchronous average is split as the indicators ask: the *regular* signal holds the
harmonics of the shaft's rotation below three and of all meshes with their first sidebands, the
*residual* is the average less shaft and mesh harmonics, the *difference* is the residual less the
first sidebands.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearmon.signals import indicators
from gearmon.signatures.families import WheelLines
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
    rows = [_of_waveform(channel) for channel in samples]
    return {
        name: {channel: row[name] for channel, row in zip(channel_names, rows, strict=True)}
        for name in _WAVEFORM
    }


_WAVEFORM = ("rms", "peak to peak", "crest factor", "kurtosis")
_PIECE = 1 << 18


def _of_waveform(channel: FloatArray) -> dict[str, float]:
    """Compute those of one channel, piece by piece: a long recording is never copied as a whole."""
    pieces = [channel[start : start + _PIECE] for start in range(0, len(channel), _PIECE)]
    mean = float(np.sum([piece.sum() for piece in pieces])) / len(channel)
    least, largest = float(channel.min()), float(channel.max())
    peak = max(largest - mean, mean - least)
    scale = peak if peak > 0 else 1.0
    second = fourth = 0.0
    for piece in pieces:
        square = ((piece - mean) / scale) ** 2
        second += float(square.sum())
        fourth += float(square @ square)
    rms = scale * float(np.sqrt(second / len(channel)))
    return {
        "rms": rms,
        "peak to peak": largest - least,
        "crest factor": peak / rms if rms > 0 else 0.0,
        "kurtosis": fourth * len(channel) / second**2 if second > 0 else 0.0,
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
    mean = signature.lines.mean[:, wheel.lines]
    number, top = wheel.number, int(wheel.number.max(initial=0))
    spectrum = np.zeros((mean.shape[0], top + 1), dtype=complex)
    spectrum[:, number] = mean
    offset = (number + wheel.teeth // 2) % wheel.teeth - wheel.teeth // 2
    own_mesh = (offset == 0) & (number >= wheel.teeth)
    first = (np.abs(offset) == 1) & (number >= wheel.teeth - 1)
    shaft = number <= 2
    regular = wheel.mesh | first | shaft
    per_turn = 1 << int(np.ceil(np.log2(2 * (top + 1))))
    average = _waveform(spectrum, number, np.ones(len(number), dtype=bool), per_turn)
    difference = _waveform(spectrum, number, ~regular, per_turn)
    steady = _waveform(spectrum, number, regular, per_turn)
    fundamental = np.abs(spectrum[:, wheel.teeth]) if wheel.teeth <= top else np.zeros(len(mean))
    near = [wheel.teeth + r for r in range(-6, 7) if r and 0 < wheel.teeth + r <= top]
    return {
        "FM0": indicators.fm0(average, np.abs(mean[:, own_mesh])),
        "FM4": indicators.normalised_moment(difference, 4),
        "M6A": indicators.normalised_moment(difference, 6),
        "M8A": indicators.normalised_moment(difference, 8),
        "energy ratio": indicators.energy_ratio(difference, steady),
        "SER": indicators.sideband_energy_ratio(np.abs(spectrum[:, near]), fundamental),
    }


def _waveform(
    spectrum: NDArray[np.complex128],
    number: NDArray[np.int64],
    chosen: NDArray[np.bool_],
    per_turn: int,
) -> FloatArray:
    """One turn of the gear from the chosen multiples of its rotation."""
    part = np.zeros((spectrum.shape[0], per_turn // 2 + 1), dtype=complex)
    part[:, number[chosen]] = spectrum[:, number[chosen]]
    result: FloatArray = np.fft.irfft(part, n=per_turn, axis=-1) * per_turn / 2
    return result
