"""The pair under each form of mesh stiffness: from rest, and steady."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearmon.dynamics import Response
from gearmon.gears.pulses import FloatArray
from gearmon.study.reference_case import CONTACT_RATIO, REFERENCE
from gearmon.study.starts import solved_start
from gearmon.study.stiffness_signals import StiffnessSignal, stiffness_signals
from gearmon.study.sweeps import solved
from gearmon.study.trajectories import Trajectory, simulate

PERIODS = 3
POINTS_PER_PERIOD = 1000
# A vibration has settled once it stays this close to the quasi-static deflection, as a share of
# the difference of F/k between the two levels of the rectangle.
SETTLED = 0.05


@dataclass(frozen=True, kw_only=True, eq=False)
class FormResponse:
    """The reference case under one form of stiffness.

    Attributes
    ----------
    signal : StiffnessSignal
    steady : Response
        Of the form's Fourier series, by multiple scales.
    simulated : Trajectory
        From rest, by direct integration of the form itself with its jumps.
    solved : Trajectory
        The same by multiple scales, acceleration and force from the equation of motion.
    """

    signal: StiffnessSignal
    steady: Response
    simulated: Trajectory
    solved: Trajectory

    @property
    def start_difference(self) -> float:
        """Largest difference of both displacements from rest on, over the largest."""
        one, other = self.simulated.displacement_m, self.solved.displacement_m
        return float(np.abs(one - other).max() / np.abs(one).max())

    @property
    def last_period(self) -> slice:
        """The last mesh period of the trajectories, without its end point."""
        return slice(-POINTS_PER_PERIOD - 1, -1)

    @property
    def phase(self) -> FloatArray:
        """Phases of the last period, 0 to 1."""
        return np.arange(POINTS_PER_PERIOD) / POINTS_PER_PERIOD

    @property
    def difference(self) -> float:
        """Largest difference of both displacements in the last period, over the largest."""
        one = self.simulated.displacement_m[self.last_period]
        other = self.solved.displacement_m[self.last_period]
        return float(np.abs(one - other).max() / np.abs(one).max())

    @property
    def quasi_static_m(self) -> FloatArray:
        """F/k(t) over the last period, without the ripple of a Fourier sum [m]."""
        phi = REFERENCE.variation * self.signal.smooth_shape(self.phase)
        return REFERENCE.static_deflection_m / (1 + phi)

    def settling_s(self, after_phase: float, until_phase: float) -> float:
        """Time after a change of the number of pairs until F/k(t) is followed closely [s]."""
        inside = (self.phase >= after_phase) & (self.phase < until_phase)
        z = self.simulated.displacement_m[self.last_period]
        step = 2 * REFERENCE.variation * REFERENCE.static_deflection_m
        late = np.abs(z - self.quasi_static_m)[inside] > SETTLED * step
        if not late.any():
            return 0.0
        last = float(self.phase[inside][np.flatnonzero(late)[-1]])
        return (last - after_phase) * REFERENCE.period_s

    @property
    def longest_settling_s(self) -> float:
        """Settling time after the slower of both changes [s]."""
        cut = 0.5 if self.signal.key == "fourier-half" else CONTACT_RATIO - 1
        return max(self.settling_s(0.0, cut), self.settling_s(cut, 1.0))


def form_responses() -> dict[str, FormResponse]:
    """Solve and simulate the reference case under every form."""
    time = np.arange(PERIODS * POINTS_PER_PERIOD + 1) / POINTS_PER_PERIOD * REFERENCE.period_s
    found = {}
    for key, signal in stiffness_signals().items():
        modulation = signal.modulation(REFERENCE)
        steady = solved(REFERENCE.problem(REFERENCE.variation * signal.shape_harmonics()))
        found[key] = FormResponse(
            signal=signal,
            steady=steady,
            simulated=simulate(REFERENCE, modulation, time, signal.jumps, 1e-8),
            solved=solved_start(REFERENCE, steady, modulation, time),
        )
    return found


def dynamic_difference(one: FormResponse, other: FormResponse) -> float:
    """Difference of two steady displacements without their means, over the size of `other`.

    The forms are compared over the last period at the same phase.
    """
    a, b = (
        r.simulated.displacement_m[r.last_period] - r.simulated.displacement_m[r.last_period].mean()
        for r in (one, other)
    )
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))
