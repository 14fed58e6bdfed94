"""What the solution is to serve: seeing a damaged tooth, and choosing a harvester."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gearmon.dynamics import HillProblem, Response, steady_state
from gearmon.gears.pulses import ComplexArray, FloatArray
from gearmon.gears.stiffness_forms import Parabolic
from gearmon.harvesting.inertial import InertialHarvester
from gearmon.study.reference_case import CONTACT_RATIO, PINION_TEETH, REFERENCE
from gearmon.study.stiffness_signals import StiffnessSignal

#: Share of the stiffness of its pairs that one pinion tooth has lost.
LOSSES = (0.01, 0.02, 0.05, 0.1, 0.2)
DAMAGE_TOLERANCE = 1e-6
SIDEBAND_SHARE = 0.01
#: A generator of the size of a coin cell; its load is matched.
HARVESTER = InertialHarvester(
    mass_kg=5e-3, natural_frequency_hz=625.0, mechanical_damping_ratio=0.01
)


@dataclass(frozen=True, kw_only=True, eq=False)
class DamageStudy:
    """One pinion tooth that has lost stiffness, over a turn of the pinion.

    Attributes
    ----------
    losses : ndarray, shape (L,)
        Share of the pair stiffness lost.
    responses : tuple of Response
        Steady vibration over a turn for each loss.
    sideband_rms : ndarray, shape (L,)
        RMS acceleration of all lines that are no mesh harmonics [m/s2]; zero without damage.
    mesh_rms : float
        RMS acceleration of the mesh harmonics of the healthy pair [m/s2].
    """

    losses: FloatArray
    responses: tuple[Response, ...]
    sideband_rms: FloatArray
    mesh_rms: float

    @property
    def levels_db(self) -> FloatArray:
        """RMS of the sidebands over that of the healthy mesh harmonics [dB]."""
        return 20 * np.log10(self.sideband_rms / self.mesh_rms)

    def sidebands(self, index: int) -> int:
        """Count the lines between mesh harmonics above a hundredth of the largest line."""
        lines = 2 * np.abs(self.responses[index].acceleration)
        lines[::PINION_TEETH] = 0.0
        largest = 2 * np.abs(self.responses[index].acceleration).max()
        return int((lines > SIDEBAND_SHARE * largest).sum())


@dataclass(frozen=True, kw_only=True, eq=False)
class HarvestStudy:
    """Power that a matched inertial harvester takes from each line, tuned to it.

    Attributes
    ----------
    frequency_hz : ndarray, shape (N,)
        Lines 1, 2 ...
    power_w : ndarray, shape (N,)
        Mean electrical power with the housing moving as the pair does: an upper end, since the
        way from the mesh to the housing is not part of the model.
    generated_first_line_w : float
        Power that leaves the motion at line 1, in the generator and as heat [W].
    """

    frequency_hz: FloatArray
    power_w: FloatArray
    generated_first_line_w: float


def study_damage(healthy: StiffnessSignal) -> DamageStudy:
    """Solve a turn of the pinion with one weaker tooth.

    Parameters
    ----------
    healthy : StiffnessSignal
        Stiffness of the sound pairs.
    """
    responses = tuple(
        steady_state(_turn_problem(healthy, loss), DAMAGE_TOLERANCE) for loss in LOSSES
    )
    sound = steady_state(_turn_problem(healthy, 0.0), DAMAGE_TOLERANCE).acceleration
    return DamageStudy(
        losses=np.array(LOSSES),
        responses=responses,
        sideband_rms=np.array([_rms_between_mesh_lines(r.acceleration) for r in responses]),
        mesh_rms=math.sqrt(2 * float((np.abs(sound[PINION_TEETH::PINION_TEETH]) ** 2).sum())),
    )


def study_harvest(response: Response) -> HarvestStudy:
    """Tune a harvester to every line in turn that its spring can be built for.

    Parameters
    ----------
    response : Response
        Steady vibration.
    """
    reachable = response.frequency_hz <= HARVESTER.highest_hz
    lines = np.flatnonzero(reachable & (response.frequency_hz > 0))
    frequency = response.frequency_hz[lines]
    squares = (2 * np.abs(response.acceleration[lines])) ** 2
    powers = np.array([_tuned_gain(float(f)) for f in frequency]) * squares
    return HarvestStudy(
        frequency_hz=frequency,
        power_w=powers,
        generated_first_line_w=2 * float(powers[0]),  # matched: as much again goes into heat
    )


def _tuned_gain(frequency_hz: float) -> float:
    matched = HARVESTER.retuned(frequency_hz).with_load(HARVESTER.mechanical_damping_ratio)
    return float(matched.gains([frequency_hz]).power_w[0])


def _turn_problem(healthy: StiffnessSignal, loss: float) -> HillProblem:
    """Hill's equation over a turn: tooth 1 loses `loss` of the parabola of its pair."""
    count = healthy.harmonic_count
    mesh = REFERENCE.variation * healthy.shape_harmonics()
    turn = np.zeros(count * PINION_TEETH, dtype=np.complex128)
    turn[PINION_TEETH - 1 :: PINION_TEETH] = mesh
    orders = np.arange(len(turn) + 1) / PINION_TEETH
    pulse = Parabolic().pulse(CONTACT_RATIO)
    lost: ComplexArray = -loss * pulse.transform(orders) / (pulse.area * PINION_TEETH)
    mean = 1.0 + lost[0].real
    return HillProblem(
        REFERENCE.mass_kg,
        REFERENCE.damping_ns_per_m,
        REFERENCE.stiffness_n_per_m * mean,
        (turn + lost[1:]) / mean,
        REFERENCE.period_s * PINION_TEETH,
        REFERENCE.force_n,
    )


def _rms_between_mesh_lines(acceleration: ComplexArray) -> float:
    squares = np.abs(acceleration) ** 2
    return math.sqrt(2 * float(squares.sum() - squares[::PINION_TEETH].sum()))
