"""Thinned curves: what a picture can show of a long signal, and no more.

Pictures have some thousand columns of pixels. A spectrum is thinned by holding the largest value of
each column, so that no line is lost; waveforms keep the smallest and largest value of each column.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gearmon.signals.angle import AngleTrack
from gearmon.signals.orders import AngleGrid, angle_blocks, one_turn
from gearmon.signals.spectra import Spectrum, amplitude_spectrum
from gearmon.signals.transforms import fast_length
from gearmon.signatures.measured.reference import WheelPattern

FloatArray = NDArray[np.float64]

# Columns of pixels that a full-width picture has in print.
COLUMNS = 1200
_TIME_BLOCK = 1 << 17
# A drawing needs no more than this: about a minute at usual rates.
_ANGLE_SAMPLES = 1 << 19


def max_hold(x: FloatArray, y: FloatArray, columns: int = COLUMNS) -> tuple[FloatArray, FloatArray]:
    """Keep the largest value in each of `columns` equal groups, at its own place.

    Parameters
    ----------
    x, y : ndarray of float, shape (n,)
        The curve.
    columns : int
        Groups, >= 1; a curve with fewer points is returned as it is.

    Returns
    -------
    x, y : ndarray of float, shape (min(n, columns),)

    Examples
    --------
    >>> max_hold(np.arange(6.0), np.array([0.0, 3, 1, 1, 2, 0]), 2)
    (array([1., 4.]), array([3., 2.]))
    """
    if len(y) <= columns:
        return x, y
    index = np.array([a + int(np.argmax(y[a:b])) for a, b in _groups(len(y), columns)])
    return x[index], y[index]


def extremes(x: FloatArray, y: FloatArray, columns: int = COLUMNS) -> tuple[FloatArray, FloatArray]:
    """Keep the smallest and the largest value in each of `columns` equal groups, in their order.

    Parameters
    ----------
    x, y : ndarray of float, shape (n,)
        The curve.
    columns : int
        Groups, >= 1; a curve with fewer than twice as many points is returned as it is.

    Returns
    -------
    x, y : ndarray of float
    """
    if len(y) <= 2 * columns:
        return x, y
    index: list[int] = []
    for a, b in _groups(len(y), columns):
        both = {a + int(np.argmin(y[a:b])), a + int(np.argmax(y[a:b]))}
        index.extend(sorted(both))
    return x[index], y[index]


def _groups(count: int, columns: int) -> list[tuple[int, int]]:
    edges = np.linspace(0, count, columns + 1).astype(int)
    return list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))


def time_spectrum(samples: FloatArray, sampling_rate_hz: float) -> tuple[Spectrum, int]:
    """Return the amplitude spectrum of a recording of any length.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        The signals.
    sampling_rate_hz : float
        Sampling rate [Hz].

    Returns
    -------
    spectrum : Spectrum
        Root mean square over half-overlapped Hann blocks of the peak amplitude.
    blocks : int
        Number of blocks.
    """
    block = min(samples.shape[-1], _TIME_BLOCK)
    block -= block % 2 if block > 2 else 0
    starts = range(0, samples.shape[-1] - block + 1, max(1, block // 2))
    power = np.zeros((len(samples), block // 2 + 1))
    for start in starts:
        part = samples[:, start : start + block]
        part = part - part.mean(axis=-1, keepdims=True)
        spectrum = amplitude_spectrum(part, sampling_rate_hz)
        power += spectrum.values**2
    return replace(spectrum, values=np.sqrt(power / len(starts))), len(starts)


def angle_spectrum(
    samples: FloatArray, sampling_rate_hz: float, track: AngleTrack, block_turns: float, top: float
) -> Spectrum:
    """Return the amplitude spectrum in angle, where a wandering speed smears no line.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        The signals; of very long ones the first half million samples are taken.
    sampling_rate_hz : float
        Sampling rate [Hz].
    track : AngleTrack
        Angle of shaft 1 against time.
    block_turns : float
        Length of the Hann blocks [turns]; cut to the recording.
    top : float
        Highest order wanted.

    Returns
    -------
    Spectrum
        Its frequencies are orders: cycles a turn of shaft 1.
    """
    part = samples[:, :_ANGLE_SAMPLES]
    grid = AngleGrid.of(part.shape[-1], sampling_rate_hz, track, top)
    block = min(grid.count, fast_length(max(8, int(block_turns * grid.per_turn))))
    power, count = np.zeros((len(part), block // 2 + 1)), 0
    for _, values in angle_blocks(part, sampling_rate_hz, track, grid, block):
        level = values.mean(axis=-1, keepdims=True)
        spectrum = amplitude_spectrum(values - level, float(grid.per_turn))
        power += spectrum.values**2
        count += 1
    return replace(spectrum, values=np.sqrt(power / count))


def turn_waveform(pattern: WheelPattern, points: int, *, mesh: bool = True) -> FloatArray:
    """Return one turn of a gear by its lines, with or without the mesh harmonics.

    Parameters
    ----------
    pattern : WheelPattern
        The lines; those that so few points cannot hold are left out.
    points : int
        Equal steps over the turn, from the angle zero of the recording.
    mesh : bool
        Whether with the mesh harmonics.

    Returns
    -------
    ndarray of float, shape (channels, points)
        In the units of the channels.
    """
    half = np.zeros((len(pattern.amplitude), -(-points // 2)), dtype=complex)
    chosen = (pattern.number < half.shape[1]) & (mesh | ~pattern.mesh)
    half[:, pattern.number[chosen]] = pattern.amplitude[:, chosen]
    return one_turn(half, points)
