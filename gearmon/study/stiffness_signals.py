"""The four forms of mesh stiffness as signals of the same mean and the same jump."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from gearmon.gears.pulses import ComplexArray, FloatArray, Pulse
from gearmon.gears.stiffness_forms import (
    FourierSum,
    Parabolic,
    Rectangular,
    StiffnessForm,
    Wave,
    zone_means,
)
from gearmon.study.reference_case import (
    CONTACT_RATIO,
    HIGHEST_STIFFNESS_HARMONIC,
    MeshParameters,
)
from gearmon.study.trajectories import series

#: Harmonics kept where a form is solved by its Fourier series although it jumps.
HARMONICS_OF_JUMPS = 400


@dataclass(frozen=True, kw_only=True, eq=False)
class StiffnessSignal:
    """One form of mesh stiffness over the mesh phase (0: a pair enters contact).

    Parameters
    ----------
    key, label : str
        Short name and name to show.
    pulse : Pulse
        Stiffness of one pair, in units of the greatest of a single pair.
    outline : Pulse
        The same without the ripple of a Fourier sum: its rectangle.
    half_jump : float
        Half the step between the levels of the rectangle, same unit: eps is counted in it.
    harmonic_count : int
        Harmonics that are kept in a series: all of a Fourier sum, many of a form with jumps.
    jumps : tuple of float
        Phases in [0, 1) where the curve or its slope jumps; empty for a Fourier sum.
    """

    key: str
    label: str
    pulse: Pulse = field(repr=False)
    outline: Pulse = field(repr=False)
    half_jump: float
    harmonic_count: int
    jumps: tuple[float, ...]

    def level(self, phase: ArrayLike) -> FloatArray:
        """Stiffness in units of the greatest of a single pair, at `phase` [mesh periods]."""
        return _pairs_added(self.pulse, phase)

    @property
    def mean(self) -> float:
        """Mean over the mesh period, in units of the greatest of a single pair."""
        return self.pulse.area

    def shape(self, phase: ArrayLike) -> FloatArray:
        """Shape f = (K - mean)/half jump: zero mean, with the jumps of a +-1 square wave."""
        return (self.level(phase) - self.mean) / self.half_jump

    def smooth_shape(self, phase: ArrayLike) -> FloatArray:
        """Shape f without the ripple of a Fourier sum."""
        return (_pairs_added(self.outline, phase) - self.mean) / self.half_jump

    def shape_harmonics(self, count: int | None = None) -> ComplexArray:
        """f_1..f_count of ``f = sum_n (f_n e^{2 pi i n phase} + conjugate)``."""
        orders = np.arange(1, (count or self.harmonic_count) + 1)
        return self.pulse.transform(orders) / self.half_jump

    def modulation(self, parameters: MeshParameters) -> Callable[[FloatArray], FloatArray]:
        """Return the function of the phase that gives k/k0 - 1 = eps f."""
        if not self.jumps:
            return series(parameters.variation * self.shape_harmonics())
        return lambda phase: parameters.variation * self.shape(phase)


def _pairs_added(pulse: Pulse, phase: ArrayLike) -> FloatArray:
    """Sum of the pairs in contact: those that entered in this period and in the one before."""
    x = np.mod(np.asarray(phase, dtype=np.float64), 1.0)
    return pulse.value(x) + pulse.value(x + 1.0)


def stiffness_signals() -> dict[str, StiffnessSignal]:
    """Return the forms by key: parabolic, wave, rectangular, fourier, fourier-half.

    The first four share the duty 0.412 that the contact ratio asks for; "fourier" is the sum of the
    rectangle. "fourier-half" is the sum of a square wave of half duty: only that has the odd
    cosines alone that the study speaks of, and it is what the sweeps use.

    Examples
    --------
    >>> signals = stiffness_signals()
    >>> [round(float(signals["rectangular"].level(x)), 6) for x in (0.2, 0.7)]
    [1.523046, 0.973988]
    """
    high, low = zone_means(CONTACT_RATIO)
    cut = CONTACT_RATIO - 1
    odd = (HIGHEST_STIFFNESS_HARMONIC + 1) // 2
    smooth, true = FourierSum(terms=odd), FourierSum(terms=2 * odd - 1, duty="true")
    table: list[tuple[str, str, StiffnessForm, int, tuple[float, ...]]] = [
        ("parabolic", "parabolic reference", Parabolic(), HARMONICS_OF_JUMPS, (0.0, cut)),
        ("wave", "wave-shaped", Wave(), HARMONICS_OF_JUMPS, (0.0, cut)),
        ("rectangular", "rectangular", Rectangular(), HARMONICS_OF_JUMPS, (0.0, cut)),
        ("fourier", "Fourier sum of the rectangle", true, 2 * odd - 1, ()),
        ("fourier-half", "Fourier sum at half duty", smooth, 2 * odd - 1, ()),
    ]
    return {
        key: StiffnessSignal(
            key=key,
            label=label,
            pulse=form.pulse(CONTACT_RATIO),
            outline=form.outline(CONTACT_RATIO),
            half_jump=0.5 * (high - low),
            harmonic_count=count,
            jumps=jumps,
        )
        for key, label, form, count, jumps in table
    }
