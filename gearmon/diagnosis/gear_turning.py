"""How far a gear has turned between two recordings, beside the event of a damaged tooth.

Without a pulse on its own shaft a gear's healthy pattern is turned until it explains most of the
new one. A tooth that lost much of its stiffness is louder than all else in the new pattern and may
be laid on whichever tooth of the healthy gear departs most. So the event is looked for in what the
healthy pattern leaves, all that is heard about its place is fitted to the lines and taken out of
the new pattern, and the angle sought once more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.gear_pattern import GearPattern, IntArray, turning_angle

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

# An event counts from this energy over that of the median place on.
_EVENT = 6.0
# Teeth before and after its middle that it takes up, the ringing of the housing included, and steps
# of its waveform: a band holds one value a tooth, but not at places known beforehand.
_BEFORE, _AFTER, _STEP = 2, 5, 0.5
# Share of the largest singular value below which a direction is noise.
_RANK = 1e-2
# Teeth over which its energy is summed, and places looked at for each tooth.
_WINDOW, _PLACES = 3, 8
# Times that event and angle are sought, and change of the angle [teeth] at which that ends.
_ROUNDS, _SETTLED = 2, 0.25


def turning_beside_event(
    known: GearPattern, new: GearPattern, bands: Sequence[IntArray], teeth: int
) -> float:
    """Angle [turns] by which a healthy pattern must be turned, whatever one tooth does.

    Parameters
    ----------
    known : GearPattern
        The healthy pattern.
    new : GearPattern
        The new one, perhaps with a damaged tooth.
    bands : sequence of ndarray of int
        Multiples of the rotation about each mesh harmonic.
    teeth : int
        Of the gear.

    Returns
    -------
    float
        In [0, 1); that of `gear_pattern.turning_angle` if no event stands out.
    """
    angle = turning_angle(known, new, bands)
    for _ in range(_ROUNDS):
        event = _event(known.turned(angle), new, bands, teeth)
        if event is None:
            return angle
        beside = replace(new, amplitude=new.amplitude - event)
        moved = turning_angle(known, beside, bands)
        step = abs((moved - angle + 0.5) % 1.0 - 0.5) * teeth
        angle = moved
        if step < _SETTLED:
            break
    return angle


def _event(
    known: GearPattern, new: GearPattern, bands: Sequence[IntArray], teeth: int
) -> ComplexArray | None:
    """Lines of the greatest event in what the healthy pattern leaves; None if there is none."""
    rest, deviation = np.zeros_like(new.amplitude), np.ones(new.amplitude.shape)
    used = []
    for band in bands:
        use = band[new.usable[band] & known.usable[band]]
        if not len(use):
            continue
        variance = new.variance[:, use] + known.variance[:, use]
        old, value = known.amplitude[:, use] / variance, new.amplitude[:, use]
        power = np.sum(np.abs(known.amplitude[:, use]) ** 2 / variance, axis=1)
        gain = np.sum(old.conj() * value, axis=1) / np.maximum(power, np.finfo(float).tiny)
        deviation[:, use] = np.sqrt(variance)
        rest[:, use] = (value - gain[:, None] * known.amplitude[:, use]) / deviation[:, use]
        used.append(use)
    places = _PLACES * teeth
    energy = np.sum(
        [np.sum(np.abs(_around(rest, use, places)) ** 2, axis=0) for use in used], axis=0
    )
    if not used or not energy.any():
        return None
    wide = _WINDOW * _PLACES
    ends = np.cumsum(np.tile(energy, 2))
    window = ends[wide : wide + places] - ends[:places]
    if float(window.max()) < _EVENT * float(np.median(window)):
        return None
    middle = (int(np.argmax(window)) + 1 + wide // 2) / _PLACES
    delay = (middle + np.arange(-_BEFORE, _AFTER + 0.25, _STEP)) / teeth
    event = np.zeros_like(new.amplitude)
    for use in used:
        # all that is heard there, not what the healthy pattern leaves of it: that would put the
        # pattern in its place, at the very angle that is in doubt
        waves = np.exp(-2j * np.pi * np.outer(use, delay))
        for channel, scale in enumerate(deviation[:, use]):
            told = new.amplitude[channel, use] / scale
            size = np.linalg.lstsq(waves / scale[:, None], told, rcond=_RANK)[0]
            event[channel, use] = waves @ size
    return event


def _around(lines: ComplexArray, use: IntArray, places: int) -> ComplexArray:
    """Return the lines of one band over the turn, its carrier folded."""
    folded = np.zeros((len(lines), places), dtype=np.complex128)
    # a band is narrower than the places of a turn, so that no two of its lines fall together
    folded[:, use % places] = lines[:, use]
    return np.asarray(np.fft.ifft(folded, axis=1) * places)
