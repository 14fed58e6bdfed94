"""Time for new parameter values: substituted in the expansion, or simulated anew."""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gearmon.dynamics import Response, steady_state
from gearmon.dynamics.multiple_scales import expand
from gearmon.gears.pulses import ComplexArray, FloatArray
from gearmon.study.expansion import PUBLISHED_ORDER
from gearmon.study.reference_case import REFERENCE, MeshParameters
from gearmon.study.sweeps import acceleration_error, solved
from gearmon.study.trajectories import motion, series

METHODS = ("RK45", "DOP853", "LSODA")
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
ORDERS = (1, 2, 3, 4, 6, 8, 10)
POINTS = 400
#: Highest response harmonic of the expansion, and number of sets that are substituted together.
HIGHEST = 200
AT_ONCE = 500
SUBSTITUTION, MANY = "substitution", f"substitution, {AT_ONCE} sets at once"
SOLUTION = "new solution with guaranteed error"


@dataclass(frozen=True, kw_only=True)
class Cost:
    """One way to obtain the steady vibration of one set of parameters.

    Attributes
    ----------
    way : str
        `SUBSTITUTION`, `MANY`, `SOLUTION` or the name of SciPy's method.
    setting : str
        Order or tolerance.
    error : float
        Relative L2 error of the acceleration over a steady period.
    seconds : float
        Median over the repeats, one set.
    """

    way: str
    setting: str
    error: float
    seconds: float


@dataclass(frozen=True, kw_only=True)
class SpeedStudy:
    """Costs measured side by side on this machine.

    Attributes
    ----------
    costs : tuple of Cost
    repeats : int
    machine : str
        Processor, Python and NumPy.
    """

    costs: tuple[Cost, ...]
    repeats: int
    machine: str

    def ratio(self, of: Cost) -> tuple[Cost, float] | None:
        """Fastest simulation that is at least as accurate, and its time over that of `of`."""
        as_good = [c for c in self.costs if c.way in METHODS and c.error <= of.error]
        if not as_good:
            return None
        fastest = min(as_good, key=lambda cost: cost.seconds)
        return fastest, fastest.seconds / of.seconds

    @property
    def published_order(self) -> Cost:
        """Substitution in the expansion to second order, one set."""
        return self.substitution(f"{PUBLISHED_ORDER}")

    def substitution(self, order: str, way: str = SUBSTITUTION) -> Cost:
        """Cost of a substitution at one order, one set or many at once."""
        return next(c for c in self.costs if (c.way, c.setting) == (way, order))

    @property
    def finest(self) -> Cost:
        """Most accurate substitution that some simulation still matches."""
        matched = [c for c in self.costs if c.way == SUBSTITUTION and self.ratio(c)]
        return min(matched, key=lambda cost: cost.error)


def study_speed(repeats: int = 3, tolerances: Sequence[float] = TOLERANCES) -> SpeedStudy:
    """Measure all ways on neighbours of the reference case, interleaved; the median of repeats.

    Every repeat takes another mass and damping, so that nothing can be kept from the one before.
    The expansion is planned once, for the reference case. A simulation starts from rest, lets one
    mesh period pass and records the next: with e^(-c T/(2 m)) = 7e-12 the start is forgotten then.

    Parameters
    ----------
    repeats : int, >= 1
    tolerances : sequence of float
        Of the simulations.
    """
    sets = [
        REFERENCE.with_value("mass_kg", 0.28 * (1 + 0.01 * i)).with_value(
            "damping_ns_per_m", 9e3 * (1 - 0.01 * i)
        )
        for i in range(repeats + 1)
    ]
    ways = _ways(tolerances)
    seconds: dict[tuple[str, str], list[float]] = {key: [] for key in ways}
    # the first round warms lazy imports up and is not counted
    for number, parameters in enumerate(sets):
        for key, (run, at_once) in ways.items():
            run(parameters)  # what the other ways pushed out of the caches comes back
            begin = time.perf_counter()
            run(parameters)
            if number:
                seconds[key].append((time.perf_counter() - begin) / at_once)
    exact = solved(REFERENCE.problem())
    costs = [
        Cost(
            way=way,
            setting=setting,
            error=_error(run(REFERENCE), exact),
            seconds=statistics.median(seconds[way, setting]),
        )
        for (way, setting), (run, _) in ways.items()
    ]
    text = f"{platform.machine()}, {os.cpu_count()} processors, "
    text += f"Python {platform.python_version()}, NumPy {np.__version__}"
    return SpeedStudy(costs=tuple(costs), repeats=repeats, machine=text)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Recorded:
    """Acceleration at times of a steady period."""

    time_s: FloatArray
    acceleration: FloatArray


_Run = Callable[[MeshParameters], "ComplexArray | _Recorded"]


def _error(answer: ComplexArray | _Recorded, exact: Response) -> float:
    """Relative L2 error of the acceleration, from lines or from a record."""
    if not isinstance(answer, _Recorded):
        return acceleration_error(answer, exact)
    true = exact.at(answer.time_s, "acceleration")
    return float(np.linalg.norm(answer.acceleration - true) / np.linalg.norm(true))


def _ways(tolerances: Sequence[float]) -> dict[tuple[str, str], tuple[_Run, int]]:
    """Return every way with the number of parameter sets that one run solves."""
    ways: dict[tuple[str, str], tuple[_Run, int]] = {}
    for order in ORDERS:
        ways[SUBSTITUTION, f"{order}"] = _substituting(order, 1), 1
        ways[MANY, f"{order}"] = _substituting(order, AT_ONCE), AT_ONCE
    for tolerance in (1e-3, 1e-6, 1e-8):
        ways[SOLUTION, f"{tolerance:.0e}"] = _solving(tolerance), 1
    for method in METHODS:
        for tolerance in tolerances:
            ways[method, f"{tolerance:.0e}"] = _simulating(method, tolerance), 1
    return ways


def _substituting(order: int, sets: int) -> _Run:
    formula = expand(REFERENCE.problem(), order, HIGHEST).formula
    spread = np.linspace(1.0, 1.5, sets)

    def run(parameters: MeshParameters) -> ComplexArray:
        found = formula.at(
            mass_kg=parameters.mass_kg * spread, damping_ns_per_m=parameters.damping_ns_per_m
        )
        return np.asarray(found[0], dtype=np.complex128)

    return run


def _solving(tolerance: float) -> _Run:
    return lambda parameters: steady_state(parameters.problem(), tolerance).displacement


def _simulating(method: str, tolerance: float) -> _Run:
    def run(parameters: MeshParameters) -> _Recorded:
        from scipy.integrate import solve_ivp

        modulation = series(parameters.problem().stiffness_harmonics)
        period, mass = parameters.period_s, parameters.mass_kg
        stiffness, damping = parameters.stiffness_n_per_m, parameters.damping_ns_per_m
        force = parameters.force_n

        def slope(now: float, state: FloatArray) -> tuple[float, float]:
            phi = float(modulation(np.asarray(now / period)))
            restoring = stiffness * (1 + phi) * state[0]
            return state[1], (force - damping * state[1] - restoring) / mass

        times = period * (1 + np.arange(POINTS) / POINTS)
        scale = np.array([1.0, 2 * np.pi / period]) * parameters.static_deflection_m
        solution = solve_ivp(
            slope,
            (0.0, 2 * period),
            np.zeros(2),
            method=method,
            t_eval=times,
            rtol=tolerance,
            atol=tolerance * scale,
        )
        found = motion(parameters, modulation, times, solution.y[0], solution.y[1])
        return _Recorded(time_s=times, acceleration=found.acceleration_ms2)

    return run
