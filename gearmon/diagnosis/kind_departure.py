"""Energy of what departs from a healthy pattern around the turn of a gear."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearmon.signatures.reference import WheelPattern

FloatArray = NDArray[np.float64]

_WINDOW_TEETH = 2.0
#: Share of its amplitude by which a healthy line departs.
_DEPARTURE = 0.1


def departure_energy(new: WheelPattern, old: WheelPattern, near: int) -> FloatArray:
    """Return the energy of a departure around the turn of a gear, by tooth.

    Parameters
    ----------
    new, old : WheelPattern
        Of the new recording and of the healthy one, at the same angle.
    near : int
        Sidebands about each mesh harmonic that are left out on both sides.

    Returns
    -------
    ndarray of float, shape (teeth,)
        Over windows of two teeth, median 1.

    Notes
    -----
    About each mesh harmonic one complex gain per channel is fitted; the rest is divided by the
    scatter to expect, that is noise and a tenth of the amplitude.
    """
    teeth, top = new.teeth, int(new.number.max())
    band = (new.number + teeth // 2) // teeth
    start = np.flatnonzero(np.diff(band, prepend=-1))
    width = np.diff(start, append=len(band))
    far = ~new.mesh & (np.abs(new.number - band * teeth) > near)
    lines = np.add.reduceat(far, start, dtype=np.int64)
    value, known = np.where(far, new.amplitude, 0.0), np.where(far, old.amplitude, 0.0)
    product = np.add.reduceat(value * known.conj(), start, axis=1)
    power = np.add.reduceat(np.abs(known) ** 2, start, axis=1)
    gain = np.repeat(product / np.maximum(power, np.finfo(float).tiny), width, axis=1)
    usual = np.add.reduceat(np.abs(value) ** 2, start, axis=1) / np.maximum(lines, 1)
    spread = new.variance + old.variance + _DEPARTURE**2 * np.repeat(usual, width, axis=1)
    # a gain fitted to three lines leaves nothing of them
    counted = far & np.repeat(lines >= 4, width)
    steps = 1 << int(np.ceil(np.log2(4 * top)))
    waveform = np.zeros((len(value), steps), dtype=np.complex128)
    waveform[:, new.number] = np.where(counted, (value - gain * known) / np.sqrt(spread), 0.0)
    energy = np.sum(np.abs(np.fft.ifft(waveform, axis=1)) ** 2, axis=0)
    ends = np.concatenate([[0.0], np.cumsum(np.tile(energy, 2))])
    begin = np.arange(teeth) * steps // teeth
    wide = max(1, round(steps * _WINDOW_TEETH / teeth))
    windows = ends[begin + wide] - ends[begin]
    middle = float(np.median(windows))
    return np.asarray(windows / middle if middle > 0 else np.ones(teeth))
