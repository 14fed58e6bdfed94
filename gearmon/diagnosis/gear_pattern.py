"""Lines of one gear on a full grid, and how to turn one such pattern to another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearmon.signatures.reference import WheelPattern

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class GearPattern:
    """A gear's lines on a full grid 0..top of multiples of its rotation.

    Parameters
    ----------
    amplitude : ndarray of complex, shape (channels, top + 1)
        Amplitudes, 0 where not measured.
    variance : ndarray of float, shape (channels, top + 1)
        Their variances, 1 where not measured.
    usable : ndarray of bool, shape (top + 1,)
        Lines that were measured and are no mesh harmonics.
    """

    amplitude: ComplexArray
    variance: FloatArray
    usable: NDArray[np.bool_]

    @classmethod
    def of(cls, wheel: WheelPattern, channels: Sequence[int], top: int) -> GearPattern:
        """Return the pattern of some channels up to a multiple of the rotation."""
        inside = wheel.number <= top
        number = wheel.number[inside]
        amplitude = np.zeros((len(channels), top + 1), dtype=complex)
        variance = np.ones((len(channels), top + 1))
        usable = np.zeros(top + 1, dtype=bool)
        amplitude[:, number] = wheel.amplitude[list(channels)][:, inside]
        variance[:, number] = np.maximum(
            wheel.variance[list(channels)][:, inside], np.finfo(float).tiny
        )
        usable[number] = ~wheel.mesh[inside]
        return cls(amplitude=amplitude, variance=variance, usable=usable)

    def turned(self, angle: float) -> GearPattern:
        """Return the same pattern `angle` turns later."""
        turn = np.exp(2j * np.pi * angle * np.arange(len(self.usable)))
        return replace(self, amplitude=self.amplitude * turn)


def mesh_bands(teeth: int, top: int) -> list[IntArray]:
    """Return multiples of the rotation about each mesh harmonic, half a mesh order either way."""
    bands: list[IntArray] = []
    for k in range(1, (top + teeth // 2) // teeth + 1):
        low, high = max(1, k * teeth - teeth // 2), min(top, k * teeth + (teeth - 1) // 2)
        if high - low >= 3:
            bands.append(np.arange(low, high + 1))
    return bands


def turning_angle(known: GearPattern, new: GearPattern, bands: Sequence[IntArray]) -> float:
    """Angle [turns] by which a healthy pattern must be turned to explain most of the new one."""
    top = len(new.usable) - 1
    # eight steps per cycle of the highest line: the best angle is met within 3 per cent of power
    steps = 1 << int(np.ceil(np.log2(8 * (top + 1))))
    explained = np.zeros(steps)
    for band in bands:
        use = band[new.usable[band] & known.usable[band]]
        weight = 1.0 / (new.variance[:, use] + known.variance[:, use])
        product = np.zeros((len(weight), steps), dtype=complex)
        product[:, use] = weight * np.conj(known.amplitude[:, use]) * new.amplitude[:, use]
        power = np.sum(weight * np.abs(known.amplitude[:, use]) ** 2, axis=1)
        match = np.abs(np.fft.fft(product, axis=1)) ** 2
        explained += (match / np.maximum(power, np.finfo(float).tiny)[:, None]).sum(axis=0)
    return int(np.argmax(explained)) / steps
