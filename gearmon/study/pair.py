"""The published pair: gear data, four forms of mesh stiffness, vibration settled and from rest.

The tables of the study print the gear data under shifted labels: the "centre distances" are
reference diameters, the "pitch diameters" base diameters, the "face width ratio" the contact
ratio and the "length of the contact line" the path of contact. `decoded` shows that they agree.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.dynamics import HillProblem, Response, steady_state
from gearmon.dynamics.fourier import rms
from gearmon.dynamics.free_vibration import transient
from gearmon.dynamics.multiple_scales import expand
from gearmon.gears.pulses import Pulse
from gearmon.gears.stiffness import (
    FourierSum,
    Parabolic,
    Rectangular,
    StiffnessForm,
    Wave,
    zone_means,
)

Modulation = Callable[[FloatArray], FloatArray]

# Gear data as printed.
PINION_TEETH, GEAR_TEETH = 26, 53
MODULE_MM, PRESSURE_ANGLE_DEG = 2.0, 20.0
CONTACT_RATIO = 1.412
PATH_OF_CONTACT_MM = 8.338
SPEED_RPM, TORQUE_NM = 1460.0, 98.12

#: Highest harmonic of the Fourier sum of the stiffness; with half duty only odd ones are present.
HIGHEST_STIFFNESS_HARMONIC = 41
#: Harmonics kept where a form is solved by its Fourier series although it jumps.
HARMONICS_OF_JUMPS = 400
#: Relative error of the acceleration that every steady state must meet.
TOLERANCE = 1e-9
#: Order of the free vibration that dies out after a start, and stiffness harmonics that it sees.
FREE_ORDER, FREE_HARMONICS = 6, 100
#: Damping ratios between which both free vibrations are too much alike to be expanded one by one.
NEAR_CRITICAL = (0.95, 1.05)
PERIODS_FROM_REST = 4
POINTS_PER_PERIOD = 600
#: Lines with at least this share of the largest line's energy make up the band.
BAND_SHARE = 0.1
# A phase this close to a jump is taken from the side of the piece that is being integrated.
_INSIDE = 1e-12


@dataclass(frozen=True, kw_only=True)
class MeshParameters:
    """Parameters of ``m z'' + c z' + k0 [1 + eps f(t)] z = F``, f a square wave of +-1.

    Parameters
    ----------
    mass_kg : float, > 0
        Equivalent mass on the line of action.
    damping_ns_per_m : float, > 0
        Mesh damping.
    stiffness_n_per_m : float, > 0
        Mean mesh stiffness k0.
    variation : float, in [0, 1)
        eps.
    period_s : float, > 0
        Mesh period.
    force_n : float, > 0
        Normal force.
    """

    mass_kg: float = 0.28
    damping_ns_per_m: float = 9e3
    stiffness_n_per_m: float = 8e8
    variation: float = 0.13
    period_s: float = 1.6e-3
    force_n: float = 4e3

    @property
    def static_deflection_m(self) -> float:
        """F/k0 [m]."""
        return self.force_n / self.stiffness_n_per_m

    @property
    def decay_rate(self) -> float:
        """Decay rate h = c/(2 m) [1/s] of free vibrations."""
        return self.damping_ns_per_m / (2 * self.mass_kg)

    def problem(self, harmonics: ComplexArray | None = None) -> HillProblem:
        """Return Hill's equation, by default with the Fourier sum of the square wave.

        Parameters
        ----------
        harmonics : complex ndarray, shape (J,), optional
            c_1..c_J of the stiffness relative to its mean.
        """
        own = self.variation * square_wave_harmonics() if harmonics is None else harmonics
        mass, damping, stiffness = self.mass_kg, self.damping_ns_per_m, self.stiffness_n_per_m
        return HillProblem(mass, damping, stiffness, own, self.period_s, self.force_n)


#: The published reference values.
REFERENCE = MeshParameters()


def square_wave_harmonics(highest: int = HIGHEST_STIFFNESS_HARMONIC) -> ComplexArray:
    """c_1..c_highest of the +-1 square wave that is high in the first half of the period.

    Parameters
    ----------
    highest : int, >= 1
        Only odd harmonics are present: c_n = -2i/(pi n).

    Examples
    --------
    >>> import numpy as np
    >>> np.round(np.abs(square_wave_harmonics(4)), 6).tolist()
    [0.63662, 0.0, 0.212207, 0.0]
    """
    orders = np.arange(1, highest + 1)
    return np.where(orders % 2 == 1, -2j / (math.pi * orders), 0.0)


def decoded() -> dict[str, float]:
    """Compute the printed gear data from teeth, module and pressure angle alone.

    Returns
    -------
    dict of str to float
        pinion_mm and gear_mm, the base diameters z m cos(alpha); contact_ratio, the printed path of
        contact over the base pitch; printed_hz, the mesh frequency of 26 teeth at the printed
        speed; force_n, the printed torque over the base radius of the pinion.

    Examples
    --------
    >>> {name: round(value, 3) for name, value in decoded().items()}["contact_ratio"]
    1.412
    """
    base_mm = MODULE_MM * math.cos(math.radians(PRESSURE_ANGLE_DEG))
    return {
        "pinion_mm": PINION_TEETH * base_mm,
        "gear_mm": GEAR_TEETH * base_mm,
        "contact_ratio": PATH_OF_CONTACT_MM / (math.pi * base_mm),
        "printed_hz": PINION_TEETH * SPEED_RPM / 60,
        "force_n": TORQUE_NM / (0.5e-3 * PINION_TEETH * base_mm),
    }


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

    def modulation(self, parameters: MeshParameters) -> Modulation:
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
    odd = (HIGHEST_STIFFNESS_HARMONIC + 1) // 2
    true, half = FourierSum(terms=2 * odd - 1, duty="true"), FourierSum(terms=odd)
    forms: dict[str, tuple[str, StiffnessForm]] = {
        "parabolic": ("parabolic reference", Parabolic()),
        "wave": ("wave-shaped", Wave()),
        "rectangular": ("rectangular", Rectangular()),
        "fourier": ("Fourier sum of the rectangle", true),
        "fourier-half": ("Fourier sum at half duty", half),
    }
    return {
        key: StiffnessSignal(
            key=key,
            label=label,
            pulse=form.pulse(CONTACT_RATIO),
            outline=form.outline(CONTACT_RATIO),
            half_jump=0.5 * (high - low),
            harmonic_count=2 * odd - 1 if key.startswith("fourier") else HARMONICS_OF_JUMPS,
            jumps=() if key.startswith("fourier") else (0.0, CONTACT_RATIO - 1),
        )
        for key, (label, form) in forms.items()
    }


def series(harmonics: ComplexArray) -> Modulation:
    """Return the function of the phase with the Fourier coefficients c_1..c_J."""
    kept = np.flatnonzero(harmonics)
    rates, weights = 2j * np.pi * (kept + 1), 2 * harmonics[kept]
    return lambda phase: np.asarray((np.exp(np.multiply.outer(phase, rates)) @ weights).real)


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Motion along the line of action at given times.

    Attributes
    ----------
    time_s : ndarray, shape (n,)
    displacement_m, velocity_ms, acceleration_ms2 : ndarray, shape (n,)
    mesh_force_n : ndarray, shape (n,)
        k(t) z + c z'.
    """

    time_s: FloatArray
    displacement_m: FloatArray
    velocity_ms: FloatArray
    acceleration_ms2: FloatArray
    mesh_force_n: FloatArray


def motion(
    parameters: MeshParameters,
    modulation: Modulation,
    time_s: FloatArray,
    displacement_m: FloatArray,
    velocity_ms: FloatArray,
) -> Trajectory:
    """Complete displacement and velocity by what the equation of motion says of the rest."""
    phi = modulation(np.mod(time_s / parameters.period_s, 1.0))
    stiffness = parameters.stiffness_n_per_m * (1 + phi)
    force = stiffness * displacement_m + parameters.damping_ns_per_m * velocity_ms
    acceleration = (parameters.force_n - force) / parameters.mass_kg
    return Trajectory(time_s, displacement_m, velocity_ms, acceleration, force)


def simulate(
    parameters: MeshParameters,
    modulation: Modulation,
    time_s: FloatArray,
    jumps: Sequence[float] = (),
    tolerance: float = 1e-9,
) -> Trajectory:
    """Integrate the equation of motion from rest with SciPy's DOP853, restarted at every jump.

    Parameters
    ----------
    parameters : MeshParameters
    modulation : callable
        k/k0 - 1 as a function of the phase [mesh periods].
    time_s : ndarray, shape (n,)
        Rising times >= 0 at which the motion is wanted.
    jumps : sequence of float
        Phases in [0, 1) at which the stiffness jumps.
    tolerance : float
        Relative tolerance of a step; the absolute one is the same share of F/k0.

    Returns
    -------
    Trajectory
    """
    from scipy.integrate import solve_ivp

    period, state, end = parameters.period_s, np.zeros(2), float(time_s[-1])
    mass, force, stiffness = parameters.mass_kg, parameters.force_n, parameters.stiffness_n_per_m
    damping = parameters.damping_ns_per_m

    def slope(time: float, state: FloatArray, low: float, high: float) -> tuple[float, float]:
        phase = min(max(time / period, low), high) % 1.0
        restoring = stiffness * (1 + float(modulation(np.asarray(phase)))) * state[0]
        return state[1], (force - damping * state[1] - restoring) / mass

    scale = parameters.static_deflection_m * np.array([1.0, 2 * np.pi / period])
    found = np.zeros((2, len(time_s)))
    marks = np.add.outer(np.arange(math.ceil(end / period)), sorted({0.0, *jumps})).ravel()
    edges = [*marks[marks < end / period].tolist(), end / period]
    for start, stop in itertools.pairwise(edges):
        inside = (time_s >= start * period) & (time_s < stop * period * (1 - _INSIDE))
        solution = solve_ivp(
            slope,
            (start * period, stop * period),
            state,
            method="DOP853",
            t_eval=np.append(time_s[inside], stop * period),
            args=(start + _INSIDE, stop - _INSIDE),
            rtol=tolerance,
            atol=tolerance * scale,
        )
        found[:, inside], state = solution.y[:, :-1], solution.y[:, -1]
    found[:, time_s >= end * (1 - _INSIDE)] = state[:, None]
    return motion(parameters, modulation, time_s, found[0], found[1])


@dataclass(frozen=True, eq=False)
class Start:
    """Motion from rest.

    Attributes
    ----------
    motion : Trajectory
    error : float
        Largest difference of the displacement to direct integration, over the largest
        displacement; 0 where `motion` is that integration.
    method : str
        "multiple scales" or "direct integration".
    """

    motion: Trajectory
    error: float
    method: str


def start_from_rest(
    parameters: MeshParameters, steady: Response, periods: int, points: int
) -> Start:
    """Solve the start by multiple scales and measure its error against direct integration.

    Parameters
    ----------
    parameters : MeshParameters
    steady : Response
        What the motion settles to.
    periods, points : int
        Number of mesh periods, and of points in each.

    Returns
    -------
    Start
        By direct integration where the damping is within 5 % of the critical one.
    """
    time = np.arange(periods * points + 1) / points * parameters.period_s
    modulation = series(steady.problem.stiffness_harmonics)
    simulated = simulate(parameters, modulation, time, tolerance=1e-8)
    if NEAR_CRITICAL[0] < steady.problem.damping_ratio < NEAR_CRITICAL[1]:
        return Start(simulated, 0.0, "direct integration")
    found = solved_start(parameters, steady, modulation, time)
    apart = largest_difference(simulated.displacement_m, found.displacement_m)
    return Start(found, apart, "multiple scales")


def solved_start(
    parameters: MeshParameters, steady: Response, modulation: Modulation, time_s: FloatArray
) -> Trajectory:
    """Add to the steady vibration the free one that brings it to rest at t = 0.

    The free vibration has the damping in order zero and `FREE_HARMONICS` of the stiffness.
    """
    kept = steady.problem.stiffness_harmonics[:FREE_HARMONICS]
    unforced = replace(steady.problem, force_n=0.0, stiffness_harmonics=kept)
    kinds = ("displacement", "velocity")
    displacement, velocity = (-float(steady.at(0.0, kind)) for kind in kinds)
    free = transient(unforced, displacement, velocity, FREE_ORDER)
    z, v = (steady.at(time_s, kind) + free.at(time_s, kind) for kind in kinds)
    return motion(parameters, modulation, time_s, z, v)


def largest_difference(true: FloatArray, other: FloatArray) -> float:
    """Largest difference of two motions, over the largest value of the first."""
    return float(np.abs(true - other).max() / np.abs(true).max())


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

    @cached_property
    def waveform(self) -> Trajectory:
        """One steady mesh period, `POINTS_PER_PERIOD` equal steps."""
        time = np.arange(POINTS_PER_PERIOD) / POINTS_PER_PERIOD * self.parameters.period_s
        kinds = ("displacement", "velocity", "acceleration", "mesh_force")
        return Trajectory(time, *(self.response.at(time, kind) for kind in kinds))

    @cached_property
    def figures(self) -> dict[str, Any]:
        """All that is told of it, by the columns of sweeps.csv."""
        response, waveform, energy = self.response, self.waveform, self.energy
        total, frequency = float(energy.sum()), response.frequency_hz
        strong = np.flatnonzero(energy >= BAND_SHARE * energy.max())
        return {
            "natural_frequency_hz": response.problem.natural_frequency_hz,
            "damping_ratio": response.problem.damping_ratio,
            "mean_displacement_m": float(response.displacement[0].real),
            "displacement_swing_m": float(np.ptp(waveform.displacement_m)),
            "least_displacement_m": float(waveform.displacement_m.min()),
            "least_mesh_force_n": float(waveform.mesh_force_n.min()),
            "peak_acceleration_ms2": self.peak_acceleration,
            "peak_harmonic": self.peak_harmonic,
            "total_energy_j_per_kg": total,
            "total_energy_j": total * self.parameters.mass_kg,
            "mean_energy_frequency_hz": float(energy @ frequency) / total,
            "energy_band_hz": float(frequency[strong[-1]]),
            "second_order_error": acceleration_error(self.second_order, response),
            "start_error": self.start.error,
            "start_method": self.start.method,
            "error_bound": response.error_bound,
            "method": response.method,
        }


def operate(parameters: MeshParameters) -> Operation:
    """Solve one set of parameters."""
    response = solved(parameters.problem())
    return Operation(
        parameters=parameters,
        response=response,
        second_order=expand(response.problem, 2).displacement,
        start=start_from_rest(parameters, response, PERIODS_FROM_REST, POINTS_PER_PERIOD),
    )


def solved(problem: HillProblem) -> Response:
    """Steady vibration by multiple scales, orders recombined, to the tolerance of this study."""
    return steady_state(problem, TOLERANCE, method="msm least residual")


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
    share = np.arange(points) / points
    given = displacement[0].real + series(displacement[1:])(share)
    return largest_difference(exact.at(share * exact.problem.period_s), given)
