"""The published pair: gear data, four forms of mesh stiffness, vibration settled and from rest.

The tables of the study print the gear data under shifted labels: the "centre distances" are
reference diameters, the "pitch diameters" base diameters, the "face width ratio" the contact
ratio and the "length of the contact line" the path of contact. `decoded` shows that they agree.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.benchmark.equations import VARIATION, pair
from gearmon.dynamics import HillProblem, Response, steady_state
from gearmon.dynamics.amplitude_equations import transient
from gearmon.dynamics.fourier import rms
from gearmon.dynamics.hill import KINDS
from gearmon.dynamics.multiple_scales import expand
from gearmon.gears import stiffness as forms
from gearmon.gears.pulses import Pulse, PulseTrain

Modulation = Callable[[FloatArray], FloatArray]

# Gear data as printed.
PINION_TEETH, GEAR_TEETH = 26, 53
MODULE_MM, PRESSURE_ANGLE_DEG = 2.0, 20.0
CONTACT_RATIO = 1.412
PATH_OF_CONTACT_MM = 8.338
SPEED_RPM, TORQUE_NM = 1460.0, 98.12

#: Highest harmonic of the Fourier sum of the stiffness; with half duty only odd ones are present.
HIGHEST = 41
#: Half the step between the levels of the rectangle, in units of the greatest stiffness of a pair:
#: eps is counted in it.
HALF_JUMP = -0.5 * float(np.diff(forms.zone_means(CONTACT_RATIO))[0])
#: Harmonics kept where a form is solved by its Fourier series although it jumps.
HARMONICS_OF_JUMPS = 400
#: The published solution ends at this order.
PUBLISHED_ORDER = 2
#: Relative error of the acceleration that every steady state must meet.
TOLERANCE = 1e-9
#: Order of the free vibration that dies out after a start, and stiffness harmonics that it sees.
FREE_ORDER, FREE_HARMONICS = 6, 100
#: Damping ratios between which both free vibrations are too much alike to be expanded one by one.
NEAR_CRITICAL = (0.95, 1.05)
PERIODS_FROM_REST, POINTS_PER_PERIOD = 4, 600
#: Lines with at least this share of the largest line's energy make up the band.
BAND_SHARE = 0.1
#: Mesh periods from rest under each form of stiffness, and points in each.
PERIODS, POINTS = 3, 1000
#: Phases of a mesh period, and where trajectories hold the last one, without its end point.
PHASE, LAST_PERIOD = np.arange(POINTS) / POINTS, slice(-POINTS - 1, -1)
#: A vibration has settled once it stays this close to the quasi-static deflection, as a share of
#: the difference of F/k between the two levels of the rectangle.
SETTLED = 0.05
# A phase this close to a jump is taken from the side of the piece that is being integrated.
_INSIDE = 1e-12


def square_wave_harmonics(highest: int = HIGHEST) -> ComplexArray:
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


#: The published values: m z'' + c z' + k0 [1 + eps f(t)] z = F, f a square wave of +-1.
REFERENCE = pair(VARIATION * square_wave_harmonics())
STATIC_DEFLECTION_M = REFERENCE.force_n / REFERENCE.stiffness_n_per_m


def varied(problem: HillProblem, name: str, value: float) -> HillProblem:
    """Return the pair with another value of its equation, or of "variation", eps of its wave."""
    changed: dict[str, Any] = {name: value}
    if name == "variation":
        changed = {"stiffness_harmonics": value * square_wave_harmonics()}
    return replace(problem, **changed)


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


@dataclass(frozen=True, eq=False)
class StiffnessSignal:
    """One form of mesh stiffness over the mesh phase (0: a pair enters contact).

    Parameters
    ----------
    label : str
        Name to show.
    form : StiffnessForm
    harmonic_count : int
        Harmonics that are kept in a series: all of a Fourier sum, many of a form with jumps.
    jumps : tuple of float
        Phases in [0, 1) where the curve or its slope jumps; empty for a Fourier sum.
    """

    label: str
    form: forms.StiffnessForm
    harmonic_count: int = HARMONICS_OF_JUMPS
    jumps: tuple[float, ...] = (0.0, CONTACT_RATIO - 1)

    @cached_property
    def pulse(self) -> Pulse:
        """Stiffness of one pair, in units of the greatest of a single pair."""
        return self.form.pulse(CONTACT_RATIO)

    def level(self, phase: ArrayLike, *, smooth: bool = False) -> FloatArray:
        """Stiffness in units of the greatest of a single pair.

        Parameters
        ----------
        phase : array_like
            In mesh periods.
        smooth : bool
            Whether to leave out the ripple of a Fourier sum.
        """
        pulse = self.form.outline(CONTACT_RATIO) if smooth else self.pulse
        return PulseTrain.healthy(pulse, 0.0).at(phase)

    def shape(self, phase: ArrayLike, *, smooth: bool = False) -> FloatArray:
        """Shape f = (K - mean)/half jump: zero mean, with the jumps of a +-1 square wave."""
        return (self.level(phase, smooth=smooth) - self.pulse.area) / HALF_JUMP

    def shape_harmonics(self, count: int | None = None) -> ComplexArray:
        """f_1..f_count of ``f = sum_n (f_n e^{2 pi i n phase} + conjugate)``."""
        return self.pulse.transform(np.arange(1, (count or self.harmonic_count) + 1)) / HALF_JUMP

    def modulation(self, phase: FloatArray) -> FloatArray:
        """k/k0 - 1 = eps f."""
        return VARIATION * self.shape(phase)


#: The first four share the duty 0.412 that the contact ratio asks for; "fourier" is the sum of the
#: rectangle. "fourier-half" is the sum of a square wave of half duty: only that has the odd cosines
#: alone that the study speaks of, and it is what the sweeps use.
SIGNALS = {
    "parabolic": StiffnessSignal("parabolic reference", forms.Parabolic()),
    "wave": StiffnessSignal("wave-shaped", forms.Wave()),
    "rectangular": StiffnessSignal("rectangular", forms.Rectangular()),
    "fourier": StiffnessSignal(
        "Fourier sum of the rectangle", forms.FourierSum(terms=HIGHEST, duty="true"), HIGHEST, ()
    ),
    "fourier-half": StiffnessSignal(
        "Fourier sum at half duty", forms.FourierSum(terms=(HIGHEST + 1) // 2), HIGHEST, ()
    ),
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
    problem: HillProblem, modulation: Modulation, time_s: FloatArray, z: FloatArray, v: FloatArray
) -> Trajectory:
    """Complete displacement and velocity by what the equation of motion says of the rest."""
    phi = modulation(np.mod(time_s / problem.period_s, 1.0))
    force = problem.stiffness_n_per_m * (1 + phi) * z + problem.damping_ns_per_m * v
    return Trajectory(time_s, z, v, (problem.force_n - force) / problem.mass_kg, force)


def simulate(
    problem: HillProblem,
    modulation: Modulation,
    time_s: FloatArray,
    jumps: Sequence[float] = (),
    tolerance: float = 1e-9,
) -> Trajectory:
    """Integrate the equation of motion from rest with SciPy's DOP853, restarted at every jump.

    Parameters
    ----------
    problem : HillProblem
        All but its stiffness harmonics.
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

    p, period, state = problem, problem.period_s, np.zeros(2)

    def rates(time: float, state: FloatArray, low: float, high: float) -> tuple[float, float]:
        phase = min(max(time / period, low), high) % 1.0
        restoring = p.stiffness_n_per_m * (1 + float(modulation(np.asarray(phase)))) * state[0]
        return state[1], (p.force_n - p.damping_ns_per_m * state[1] - restoring) / p.mass_kg

    sizes = p.force_n / p.stiffness_n_per_m * np.array([1.0, p.angular_frequency])
    how: dict[str, Any] = {"method": "DOP853", "rtol": tolerance, "atol": tolerance * sizes}
    periods, found = float(time_s[-1]) / period, np.zeros((2, len(time_s)))
    marks = np.add.outer(np.arange(math.ceil(periods)), sorted({0.0, *jumps})).ravel()
    for low, high in itertools.pairwise([*marks[marks < periods].tolist(), periods]):
        inside = (time_s >= low * period) & (time_s < high * period * (1 - _INSIDE))
        wanted, span = np.append(time_s[inside], high * period), (low * period, high * period)
        sides = (low + _INSIDE, high - _INSIDE)
        states = solve_ivp(rates, span, state, t_eval=wanted, args=sides, **how).y
        found[:, inside], state = states[:, :-1], states[:, -1]
    found[:, time_s >= periods * period * (1 - _INSIDE)] = state[:, None]
    return motion(problem, modulation, time_s, *found)


def start_from_rest(
    steady: Response, periods: int = PERIODS_FROM_REST, points: int = POINTS_PER_PERIOD
) -> tuple[Trajectory, float, str]:
    """Solve the start by multiple scales and measure its error against direct integration.

    Parameters
    ----------
    steady : Response
        What the motion settles to.
    periods, points : int
        Number of mesh periods, and of points in each.

    Returns
    -------
    (Trajectory, float, str)
        The motion, its error, and how it was solved: see `Operation`. By direct integration where
        the damping is within 5 % of the critical one.
    """
    time = np.arange(periods * points + 1) / points * steady.problem.period_s
    modulation = series(steady.problem.stiffness_harmonics)
    simulated = simulate(steady.problem, modulation, time, tolerance=1e-8)
    if NEAR_CRITICAL[0] < steady.problem.damping_ratio < NEAR_CRITICAL[1]:
        return simulated, 0.0, "direct integration"
    found = solved_start(steady, modulation, time)
    apart = largest_difference(simulated.displacement_m, found.displacement_m)
    return found, apart, "multiple scales"


def solved_start(steady: Response, modulation: Modulation, time_s: FloatArray) -> Trajectory:
    """Add to the steady vibration the free one that brings it to rest at t = 0.

    The free vibration has the damping in order zero and `FREE_HARMONICS` of the stiffness.
    """
    kept = steady.problem.stiffness_harmonics[:FREE_HARMONICS]
    unforced = replace(steady.problem, force_n=0.0, stiffness_harmonics=kept)
    kinds = ("displacement", "velocity")
    displacement, velocity = (-float(steady.at(0.0, kind)) for kind in kinds)
    free = transient(unforced, displacement, velocity, FREE_ORDER)
    z, v = (steady.at(time_s, kind) + free.at(time_s, kind) for kind in kinds)
    return motion(steady.problem, modulation, time_s, z, v)


def largest_difference(true: FloatArray, other: FloatArray) -> float:
    """Largest difference of two motions, over the largest value of the first."""
    return float(np.abs(true - other).max() / np.abs(true).max())


@dataclass(frozen=True, eq=False)
class Operation:
    """The pair under one set of parameters.

    Attributes
    ----------
    response : Response
        Steady vibration to `TOLERANCE`.
    start : Trajectory
        Motion from rest, `PERIODS_FROM_REST` mesh periods.
    start_error : float
        Largest difference of its displacement to direct integration, over the largest
        displacement; 0 where it is that integration.
    start_method : str
        "multiple scales" or "direct integration".
    """

    response: Response
    start: Trajectory
    start_error: float
    start_method: str

    @cached_property
    def acceleration_lines(self) -> FloatArray:
        """Amplitudes of the acceleration of harmonics 0, 1, 2 ... [m/s2]."""
        return np.asarray(2 * np.abs(self.response.acceleration))

    @cached_property
    def waveform(self) -> Trajectory:
        """One steady mesh period, `POINTS_PER_PERIOD` equal steps."""
        time = np.arange(POINTS_PER_PERIOD) / POINTS_PER_PERIOD * self.response.problem.period_s
        return Trajectory(time, *(self.response.at(time, kind) for kind in KINDS))

    @cached_property
    def figures(self) -> dict[str, Any]:
        """All that is told of it, by the columns of sweeps.csv."""
        response, waveform, energy = self.response, self.waveform, self.response.energy_lines
        total, frequency = float(energy.sum()), response.frequency_hz
        second_order = expand(response.problem, PUBLISHED_ORDER).displacement
        strong = np.flatnonzero(energy >= BAND_SHARE * energy.max())
        return {
            "natural_frequency_hz": response.problem.natural_frequency_hz,
            "damping_ratio": response.problem.damping_ratio,
            "mean_displacement_m": float(response.displacement[0].real),
            "displacement_swing_m": float(np.ptp(waveform.displacement_m)),
            "least_displacement_m": float(waveform.displacement_m.min()),
            "least_mesh_force_n": float(waveform.mesh_force_n.min()),
            "peak_acceleration_ms2": float(self.acceleration_lines.max()),
            "peak_harmonic": int(self.acceleration_lines.argmax()),
            "total_energy_j_per_kg": total,
            "total_energy_j": total * response.problem.mass_kg,
            "mean_energy_frequency_hz": float(energy @ frequency) / total,
            "energy_band_hz": float(frequency[strong[-1]]),
            "second_order_error": acceleration_error(second_order, response),
            "start_error": self.start_error,
            "start_method": self.start_method,
            "error_bound": response.error_bound,
            "method": response.method,
        }


def operate(problem: HillProblem) -> Operation:
    """Solve one set of parameters."""
    response = solved(problem)
    return Operation(response, *start_from_rest(response))


def solved(problem: HillProblem) -> Response:
    """Steady vibration by multiple scales, orders recombined, to the tolerance of this study."""
    return steady_state(problem, TOLERANCE, method="msm least residual")


def acceleration_error(displacement: ComplexArray, exact: Response) -> float:
    """Relative L2 error of the acceleration that these harmonics of the displacement give."""
    size = max(len(displacement), len(exact.displacement))
    given, true = (np.pad(z, (0, size - len(z))) for z in (displacement, exact.displacement))
    squares = np.arange(size) ** 2
    return rms(squares * (given - true)) / rms(squares * true)


def waveform_error(displacement: ComplexArray, exact: Response, points: int = 4096) -> float:
    """Largest error of the displacement over a period, relative to the largest displacement."""
    share = np.arange(points) / points
    given = displacement[0].real + series(displacement[1:])(share)
    return largest_difference(exact.at(share * exact.problem.period_s), given)


@dataclass(frozen=True, eq=False)
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
    def longest_settling_s(self) -> float:
        """Settling time after the slower of both changes of the number of pairs [s]."""
        cut = 0.5 if self.signal is SIGNALS["fourier-half"] else CONTACT_RATIO - 1
        quasi_static = STATIC_DEFLECTION_M / (1 + VARIATION * self.signal.shape(PHASE, smooth=True))
        z, step = self.simulated.displacement_m[LAST_PERIOD], 2 * VARIATION * STATIC_DEFLECTION_M
        late = PHASE[np.abs(z - quasi_static) > SETTLED * step]
        lag = max(late[late < cut].max(initial=0.0), late.max(initial=cut) - cut)
        return float(lag) * REFERENCE.period_s


def form_responses() -> dict[str, FormResponse]:
    """Solve and simulate the reference case under every form."""
    time = np.arange(PERIODS * POINTS + 1) / POINTS * REFERENCE.period_s
    found = {}
    for key, signal in SIGNALS.items():
        harmonics = VARIATION * signal.shape_harmonics()
        steady = solved(replace(REFERENCE, stiffness_harmonics=harmonics))
        modulation = signal.modulation if signal.jumps else series(harmonics)
        simulated = simulate(REFERENCE, modulation, time, signal.jumps, 1e-8)
        start = solved_start(steady, modulation, time)
        found[key] = FormResponse(signal, steady, simulated, start)
    return found


def dynamic_difference(one: FormResponse, other: FormResponse) -> float:
    """Difference of two steady displacements without their means, over the size of `other`."""
    last = (form.simulated.displacement_m[LAST_PERIOD] for form in (one, other))
    a, b = (z - z.mean() for z in last)
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))
