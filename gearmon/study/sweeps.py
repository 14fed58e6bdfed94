"""Sweeps of one parameter: steady lines, second order beside exact, and the start from rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearmon.dynamics import HillProblem, Response, steady_state
from gearmon.dynamics.fourier import rms
from gearmon.dynamics.multiple_scales import expand
from gearmon.gears.pulses import ComplexArray, FloatArray
from gearmon.study.reference_case import (
    DAMPING_VALUES,
    MASS_VALUES,
    REFERENCE,
    STIFFNESS_VALUES,
    MeshParameters,
)
from gearmon.study.starts import Start, start_from_rest
from gearmon.study.trajectories import Trajectory

#: Relative error of the acceleration that every steady state must meet.
TOLERANCE = 1e-9
PERIODS_FROM_REST = 4
POINTS_PER_PERIOD = 600
#: Lines with at least this share of the largest line's energy make up the band.
BAND_SHARE = 0.1


@dataclass(frozen=True, kw_only=True, eq=False)
class Operation:
    """The pair under one set of parameters.

    Attributes
    ----------
    parameters : MeshParameters
    response : Response
        Steady vibration to `TOLERANCE`.
    second_order : complex ndarray, shape (M,)
        Harmonics of the displacement by multiple scales, orders 0 to 2 [m].
    start : Start
        From rest, `PERIODS_FROM_REST` mesh periods.
    """

    parameters: MeshParameters
    response: Response
    second_order: ComplexArray
    start: Start

    @cached_property
    def acceleration_lines(self) -> FloatArray:
        """Amplitudes of the acceleration of harmonics 0, 1, 2 ... [m/s2]."""
        return np.asarray(2 * np.abs(self.response.acceleration))

    @property
    def peak_harmonic(self) -> int:
        """Harmonic of the largest acceleration line."""
        return int(self.acceleration_lines.argmax())

    @property
    def peak_acceleration(self) -> float:
        """Amplitude of the largest acceleration line [m/s2]."""
        return float(self.acceleration_lines.max())

    @property
    def energy(self) -> FloatArray:
        """E_n = (2 pi f_n A_n)^2/2 of the lines [J/kg]."""
        return self.response.energy_lines

    @property
    def total_energy(self) -> float:
        """Sum of the energy lines [J/kg]."""
        return float(self.energy.sum())

    @property
    def energy_centroid_hz(self) -> float:
        """Mean frequency of the energy lines, weighted by their energy [Hz]."""
        return float((self.energy * self.response.frequency_hz).sum() / self.total_energy)

    @property
    def energy_band_hz(self) -> float:
        """Highest frequency of a line with a tenth of the largest line's energy [Hz]."""
        strong = np.flatnonzero(self.energy >= BAND_SHARE * self.energy.max())
        return float(self.response.frequency_hz[strong[-1]])

    @cached_property
    def waveform(self) -> Trajectory:
        """One steady mesh period, `POINTS_PER_PERIOD` equal steps."""
        time = np.arange(POINTS_PER_PERIOD) / POINTS_PER_PERIOD * self.parameters.period_s
        at = self.response.at
        return Trajectory(
            time_s=time,
            displacement_m=at(time),
            velocity_ms=at(time, "velocity"),
            acceleration_ms2=at(time, "acceleration"),
            mesh_force_n=at(time, "mesh_force"),
        )

    @property
    def swing_m(self) -> float:
        """Peak to peak of the steady displacement [m]."""
        return float(np.ptp(self.waveform.displacement_m))

    @property
    def second_order_error(self) -> float:
        """Relative L2 error of the acceleration of the second order."""
        return acceleration_error(self.second_order, self.response)


@dataclass(frozen=True, kw_only=True, eq=False)
class Sweep:
    """One parameter over its values, the others at their reference.

    Attributes
    ----------
    name : str
        Field of `MeshParameters`.
    label, unit : str
        To be shown, with `scale` parameter units in one shown unit.
    scale : float
    points : tuple of Operation
    """

    name: str
    label: str
    unit: str
    scale: float
    points: tuple[Operation, ...]

    @property
    def values(self) -> FloatArray:
        """Values of the parameter, SI."""
        return np.array([getattr(point.parameters, self.name) for point in self.points])

    @property
    def shown(self) -> list[str]:
        """Values as they are to be shown, with unit."""
        return [f"{value / self.scale:.4g} {self.unit}" for value in self.values]

    def take(self, what: Callable[[Operation], float]) -> FloatArray:
        """One number for every value."""
        return np.array([what(point) for point in self.points])


SWEEPS = (
    ("stiffness_n_per_m", "mesh stiffness", "GN/m", 1e9, STIFFNESS_VALUES),
    ("mass_kg", "equivalent mass", "kg", 1.0, MASS_VALUES),
    ("damping_ns_per_m", "mesh damping", "kN s/m", 1e3, DAMPING_VALUES),
)


def operate(parameters: MeshParameters) -> Operation:
    """Solve one set of parameters."""
    problem = parameters.problem()
    response = solved(problem)
    return Operation(
        parameters=parameters,
        response=response,
        second_order=expand(problem, 2).displacement,
        start=start_from_rest(parameters, response, PERIODS_FROM_REST, POINTS_PER_PERIOD),
    )


def run_sweeps(progress: Callable[[float], None] | None = None) -> dict[str, Sweep]:
    """Solve all sweeps; the keys are the names of the parameters."""
    total, done, found = sum(len(values) for *_, values in SWEEPS), 0, {}
    for name, label, unit, scale, values in SWEEPS:
        points = []
        for value in values:
            points.append(operate(REFERENCE.with_value(name, value)))
            done += 1
            if progress is not None:
                progress(done / total)
        found[name] = Sweep(name=name, label=label, unit=unit, scale=scale, points=tuple(points))
    return found


def acceleration_error(displacement: ComplexArray, exact: Response) -> float:
    """Relative L2 error of the acceleration that these harmonics of the displacement give."""
    size = max(len(displacement), len(exact.displacement))
    difference = np.zeros(size, dtype=np.complex128)
    difference[: len(displacement)] += displacement
    difference[: len(exact.displacement)] -= exact.displacement
    squares = np.arange(size) ** 2 * exact.problem.angular_frequency**2
    return rms(squares * difference) / rms(exact.acceleration)


def waveform_error(displacement: ComplexArray, exact: Response, points: int = 4096) -> float:
    """Largest error of the displacement over a period, relative to the largest displacement."""
    time = np.arange(points) / points
    phase = np.exp(2j * np.pi * np.outer(time, np.arange(1, len(displacement))))
    given = displacement[0].real + 2 * (phase @ displacement[1:]).real
    true = exact.at(time * exact.problem.period_s)
    return float(np.abs(given - true).max() / np.abs(true).max())


def solved(problem: HillProblem) -> Response:
    """Steady vibration by multiple scales, orders recombined, to the tolerance of this study."""
    return steady_state(problem, TOLERANCE, method="msm least residual")
