"""The signals of one gear that indicators are computed of, and what was taken out of each.

From the synchronous average of a gear's turn:

- the *residual* is the average less the harmonics 1 and 2 of the gear's rotation and less every
  mesh harmonic on it, also of other meshes;
- the *difference* is the residual less the first sidebands of all these mesh harmonics;
- the *regular* signal is what was taken out to get the difference;
- the *envelope* is that of the average in a band about the first mesh harmonic.

The average holds the multiples of the rotation that lie up to half a mesh order from one of the
first eight mesh harmonics, as far as the sampling rate reaches.

References
----------
Lebold, McClintic, Campbell, Byington and Maynard, MFPT 54 (2000) 623-634; Zakrajsek, Townsend and
Decker, NASA TM-105950 (1993).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError
from gearmon.signals.array_types import ComplexArray, FloatArray
from gearmon.signatures.measured.line_plan import NEAR_SIDEBANDS, WheelLines

#: Harmonics of the rotation that count as the shaft's own.
SHAFT_HARMONICS = 2
# Samples of a turn over its highest multiple: sums of eighth powers are then exact.
_OVERSAMPLING = 8.5


@dataclass(frozen=True, kw_only=True, eq=False)
class GearSignals:
    """Signals over one turn of a gear, and lines about its mesh.

    Parameters
    ----------
    wheel : WheelLines
        The gear.
    average, residual, difference, regular, envelope : ndarray of float, shape (channels, n)
        See the module; without mean, but for the envelope.
    mesh_amplitude : ndarray of float, shape (channels, harmonics)
        Peak amplitudes of the gear's own mesh harmonics.
    fundamental : ndarray of float, shape (channels,)
        That of the first.
    first_sidebands : ndarray of float, shape (channels, 2)
        Peak amplitudes of the lines -1 and +1 of the first mesh harmonic; 0 where not measured.
    near_sidebands : ndarray of float, shape (channels, 12)
        The same of -6 to +6.
    shaft, mesh, first : tuple of int
        Multiples of the rotation taken out: the shaft's own, all mesh harmonics, their first
        sidebands.
    band : (int, int)
        Lowest and highest multiple of the envelope's band.
    """

    wheel: WheelLines
    average: FloatArray
    residual: FloatArray
    difference: FloatArray
    regular: FloatArray
    envelope: FloatArray
    mesh_amplitude: FloatArray
    fundamental: FloatArray
    first_sidebands: FloatArray
    near_sidebands: FloatArray
    shaft: tuple[int, ...]
    mesh: tuple[int, ...]
    first: tuple[int, ...]
    band: tuple[int, int]

    @property
    def removed_orders(self) -> dict[str, tuple[float, ...]]:
        """Orders of shaft 1 taken out of the average, by the signal that was left."""
        residual = sorted(self.shaft + self.mesh)
        difference = sorted(self.shaft + self.mesh + self.first)
        return {
            "residual": tuple(n * self.wheel.order for n in residual),
            "difference": tuple(n * self.wheel.order for n in difference),
        }


def gear_signals(
    mean: ComplexArray, wheel: WheelLines, *, per_turn: int | None = None
) -> GearSignals:
    """Build the signals of a gear from the lines of its machine.

    Parameters
    ----------
    mean : ndarray of complex, shape (channels, lines)
        Complex peak amplitudes of all lines of the plan.
    wheel : WheelLines
        Which of them belong to the gear.
    per_turn : int, optional
        Values a turn, more than twice the highest multiple; by default so many that sums of eighth
        powers over them are exact.

    Returns
    -------
    GearSignals

    Raises
    ------
    ArgumentError
        If `per_turn` is too small for the lines.
    """
    number, teeth = wheel.number, wheel.teeth
    top = int(number.max(initial=0))
    if per_turn is None:
        per_turn = 1 << int(np.ceil(np.log2(_OVERSAMPLING * (top + 1))))
    elif per_turn <= 2 * top:
        raise ArgumentError(
            f"per_turn={per_turn} must be above {2 * top}, twice the highest multiple"
        )
    spectrum = np.zeros((len(mean), max(top, teeth + NEAR_SIDEBANDS) + 1), dtype=complex)
    spectrum[:, number] = mean[:, wheel.lines]
    meshes = number[wheel.mesh]
    shaft = (number <= SHAFT_HARMONICS) & ~wheel.mesh
    first = np.isin(number, np.concatenate([meshes - 1, meshes + 1])) & ~wheel.mesh & ~shaft
    taken = wheel.mesh | shaft
    near = [teeth + r for r in range(-NEAR_SIDEBANDS, NEAR_SIDEBANDS + 1) if r and teeth + r > 0]
    size = np.abs(spectrum)
    reach = max(1, min(teeth // 2, teeth - 1))
    band = (teeth - reach, teeth + reach)
    return GearSignals(
        wheel=wheel,
        average=_waveform(spectrum, number, per_turn),
        residual=_waveform(spectrum, number[~taken], per_turn),
        difference=_waveform(spectrum, number[~(taken | first)], per_turn),
        regular=_waveform(spectrum, number[taken | first], per_turn),
        envelope=_envelope(spectrum, number[(number >= band[0]) & (number <= band[1])], per_turn),
        mesh_amplitude=size[:, number[(number % teeth == 0) & (number >= teeth)]],
        fundamental=size[:, teeth],
        first_sidebands=size[:, [teeth - 1, teeth + 1]],
        near_sidebands=size[:, near],
        shaft=_listed(number[shaft]),
        mesh=_listed(meshes),
        first=_listed(number[first]),
        band=band,
    )


def _listed(number: NDArray[np.int64]) -> tuple[int, ...]:
    return tuple(int(n) for n in number)


def _part(spectrum: ComplexArray, chosen: NDArray[np.int64], size: int) -> ComplexArray:
    part = np.zeros((len(spectrum), size), dtype=complex)
    part[:, chosen] = spectrum[:, chosen]
    return part


def _waveform(spectrum: ComplexArray, chosen: NDArray[np.int64], per_turn: int) -> FloatArray:
    """One turn of the gear from the chosen multiples of its rotation."""
    part = _part(spectrum, chosen, per_turn // 2 + 1)
    result: FloatArray = np.fft.irfft(part, n=per_turn, axis=-1) * per_turn / 2
    return result


def _envelope(spectrum: ComplexArray, chosen: NDArray[np.int64], per_turn: int) -> FloatArray:
    part = _part(spectrum, chosen, per_turn)
    return np.asarray(np.abs(np.fft.ifft(part, axis=-1, norm="forward")), dtype=np.float64)
