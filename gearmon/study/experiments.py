"""The whole study, computed: forms, orders, sweeps, contact, damage, harvesting, run times."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.benchmark.equations import Case, Lines, as_lines, solve_reference
from gearmon.benchmark.rivals import Contender, PlainOscillator, integrate, measured
from gearmon.benchmark.timing import facts_of_run
from gearmon.dynamics import HillProblem, Response, steady_state
from gearmon.dynamics.fourier import fast_length, rms, samples
from gearmon.dynamics.multiple_scales import Expansion, expand
from gearmon.gears.stiffness import Parabolic
from gearmon.harvesting.harvester import InertialHarvester
from gearmon.study.pair import (
    CONTACT_RATIO,
    PINION_TEETH,
    REFERENCE,
    MeshParameters,
    Operation,
    StiffnessSignal,
    Trajectory,
    acceleration_error,
    operate,
    simulate,
    solved,
    solved_start,
    stiffness_signals,
    waveform_error,
)

#: Mesh periods from rest under each form of stiffness, and points in each.
PERIODS, POINTS = 3, 1000
#: A vibration has settled once it stays this close to the quasi-static deflection, as a share of
#: the difference of F/k between the two levels of the rectangle.
SETTLED = 0.05

#: Orders that are solved and drawn; the published solution ends at the second.
HIGHEST_ORDER, PUBLISHED_ORDER = 6, 2
# Below the published variation the error falls by its order; above, the next orders mix in.
VARIATIONS = (0.0125, 0.025, 0.05, 0.1)

# Swept values. Of the stiffness and of the mass only the ends and some values between are printed.
STIFFNESS_VALUES = (2e8, 3e8, 4e8, 5e8, 6e8, 8e8, 1e9, 1.2e9)
MASS_VALUES = (0.2, 0.28, 0.4, 0.6, 1.0, 1.5, 2.0, 2.5, 3.0)
DAMPING_VALUES = (3e3, 6e3, 9e3, 12e3, 15e3, 18e3, 30e3, 60e3, 90e3)
#: Parameter -> label, unit shown, SI units in one of them, values.
SWEEPS = {
    "stiffness_n_per_m": ("mesh stiffness", "GN/m", 1e9, STIFFNESS_VALUES),
    "mass_kg": ("equivalent mass", "kg", 1.0, MASS_VALUES),
    "damping_ns_per_m": ("mesh damping", "kN s/m", 1e3, DAMPING_VALUES),
}

#: Relative error where contact is scanned: enough for a picture and a root to three digits.
SCAN_TOLERANCE = 1e-5
LARGEST_STUDIED_MASS_KG = 3.0
MAP_MASSES_KG, MAP_DAMPINGS = np.geomspace(0.2, 100.0, 49), np.geomspace(3e2, 9e4, 25)

#: Share of the stiffness of its pairs that one pinion tooth has lost.
LOSSES = (0.01, 0.02, 0.05, 0.1, 0.2)
DAMAGE_TOLERANCE = 1e-6
#: A generator of the size of a coin cell; its load is matched.
HARVESTER = InertialHarvester(
    mass_kg=5e-3, natural_frequency_hz=625.0, mechanical_damping_ratio=0.01
)

METHODS = ("RK45", "DOP853", "LSODA")
#: Tolerances of the simulations that are timed, and orders of the expansion.
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
QUICK_TOLERANCES = (1e-2, 1e-6)
ORDERS = (1, 2, 3, 4, 6, 8, 10)
#: Time for each way [s].
LONGEST_S = 60.0
#: Highest response harmonic of the expansion, and number of sets that are substituted together.
HIGHEST, AT_ONCE = 200, 500
SUBSTITUTION, MANY = "substitution", f"substitution, {AT_ONCE} sets at once"
SOLUTION = "new solution with guaranteed error"


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
    def last_period(self) -> slice:
        """The last mesh period of the trajectories, without its end point."""
        return slice(-POINTS - 1, -1)

    @property
    def phase(self) -> FloatArray:
        """Phases of the last period, 0 to 1."""
        return np.arange(POINTS) / POINTS

    @property
    def longest_settling_s(self) -> float:
        """Settling time after the slower of both changes of the number of pairs [s]."""
        cut = 0.5 if self.signal.key == "fourier-half" else CONTACT_RATIO - 1
        phi = REFERENCE.variation * self.signal.smooth_shape(self.phase)
        quasi_static = REFERENCE.static_deflection_m / (1 + phi)
        step = 2 * REFERENCE.variation * REFERENCE.static_deflection_m
        z = self.simulated.displacement_m[self.last_period]
        late = self.phase[np.abs(z - quasi_static) > SETTLED * step]
        lag = max(late[late < cut].max(initial=0.0), late.max(initial=cut) - cut)
        return float(lag) * REFERENCE.period_s


def form_responses() -> dict[str, FormResponse]:
    """Solve and simulate the reference case under every form."""
    time = np.arange(PERIODS * POINTS + 1) / POINTS * REFERENCE.period_s
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
    """Difference of two steady displacements without their means, over the size of `other`."""
    last = [r.simulated.displacement_m[r.last_period] for r in (one, other)]
    a, b = (z - z.mean() for z in last)
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


@dataclass(frozen=True, kw_only=True, eq=False)
class OrderStudy:
    """Orders 0, 1, 2 ... of the reference case.

    Attributes
    ----------
    expansion : Expansion
    exact : Response
    displacement_errors : ndarray, shape (HIGHEST_ORDER + 1,)
        Largest error of the waveform of each order's sum, over the largest displacement.
    acceleration_errors : ndarray, same shape
        Relative L2 error of the acceleration.
    errors_of_variation : ndarray, shape (len(VARIATIONS), HIGHEST_ORDER + 1)
        RMS error of the displacement over F/k0.
    slopes : ndarray, shape (HIGHEST_ORDER + 1,)
        Power of eps with which that error falls.
    """

    expansion: Expansion
    exact: Response
    displacement_errors: FloatArray
    acceleration_errors: FloatArray
    errors_of_variation: FloatArray
    slopes: FloatArray


def study_orders() -> OrderStudy:
    """Expand the reference case and measure the error of every order, and its power of eps."""
    problem = REFERENCE.problem()
    exact, expansion = solved(problem), expand(problem, HIGHEST_ORDER)
    sums = np.cumsum(expansion.terms, axis=0)
    errors = np.array([_errors_of_orders(variation) for variation in VARIATIONS])
    return OrderStudy(
        expansion=expansion,
        exact=exact,
        displacement_errors=np.array([waveform_error(z, exact) for z in sums]),
        acceleration_errors=np.array([acceleration_error(z, exact) for z in sums]),
        errors_of_variation=errors,
        slopes=np.polyfit(np.log(VARIATIONS), np.log(errors), 1)[0],
    )


def _errors_of_orders(variation: float) -> FloatArray:
    problem = replace(REFERENCE, variation=variation).problem()
    exact = expand(problem, 4 * HIGHEST_ORDER, 300).displacement
    sums = np.cumsum(expand(problem, HIGHEST_ORDER, 300).terms, axis=0)
    return np.array([rms(z - exact) for z in sums]) / REFERENCE.static_deflection_m


@dataclass(frozen=True, eq=False)
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


def run_sweeps(progress: Callable[[float], None]) -> dict[str, Sweep]:
    """Solve all sweeps; the keys are the names of the parameters."""
    cases = [(name, value) for name, (*_, values) in SWEEPS.items() for value in values]
    points: dict[str, list[Operation]] = {name: [] for name in SWEEPS}
    for number, (name, value) in enumerate(cases, start=1):
        points[name].append(operate(replace(REFERENCE, **{name: value})))
        progress(number / len(cases))
    told = SWEEPS.items()
    return {name: Sweep(name, *row[:3], tuple(points[name])) for name, row in told}


@dataclass(frozen=True, kw_only=True, eq=False)
class Scan:
    """Least mesh force over F against one parameter; contact is lost where it is <= 0.

    Attributes
    ----------
    values, least_force : ndarray, shape (n,)
    first : float or None
        Value at which contact is lost first, from the harmless end; None if it never is.
    """

    values: FloatArray
    least_force: FloatArray
    first: float | None


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactStudy:
    """Where the teeth part.

    Attributes
    ----------
    mass, damping, variation : Scan
        Of mass at the reference, of damping and variation at a mass of 3 kg.
    map_masses_kg, map_dampings, of_both : ndarray
        Least mesh force over F; `of_both` has shape (dampings, masses).
    """

    mass: Scan
    damping: Scan
    variation: Scan
    map_masses_kg: FloatArray
    map_dampings: FloatArray
    of_both: FloatArray

    @property
    def least_in_study(self) -> float:
        """Least mesh force over F within the study's ranges of mass and damping together."""
        light = self.map_masses_kg <= LARGEST_STUDIED_MASS_KG
        damped = self.map_dampings >= min(DAMPING_VALUES)
        return float(self.of_both[np.ix_(damped, light)].min())


def least_force(parameters: MeshParameters) -> float:
    """Smallest mesh force of the steady vibration over F; -inf where there is no steady state."""
    response = steady_state(parameters.problem(), SCAN_TOLERANCE)
    if response.stable is False:
        return -np.inf
    force = response.mesh_force
    return float(samples(force, fast_length(8 * len(force))).min()) / parameters.force_n


def study_contact(every: int = 1) -> ContactStudy:
    """Scan mass, damping and variation, and find where contact is lost first.

    Parameters
    ----------
    every : int, >= 1
        Takes every so many of the values to scan.
    """
    heavy = replace(REFERENCE, mass_kg=LARGEST_STUDIED_MASS_KG)
    masses, dampings = MAP_MASSES_KG[::every], MAP_DAMPINGS[::every]
    both = [
        [least_force(replace(REFERENCE, damping_ns_per_m=c, mass_kg=m)) for m in masses.tolist()]
        for c in dampings.tolist()
    ]
    # from the harmless end on: light, well damped, little varied
    harmless_first = np.geomspace(30.0, 9e4, 61)[::every][::-1]
    return ContactStudy(
        mass=_scan(REFERENCE, "mass_kg", np.geomspace(0.2, 200.0, 161)[::every]),
        damping=_scan(heavy, "damping_ns_per_m", harmless_first),
        variation=_scan(heavy, "variation", np.linspace(0.02, 0.98, 49)[::every]),
        map_masses_kg=masses,
        map_dampings=dampings,
        of_both=np.array(both),
    )


def _scan(parameters: MeshParameters, name: str, values: FloatArray) -> Scan:
    """Scan one parameter, and find between two values where the force first reaches zero."""
    from scipy.optimize import bisect

    def force_at(value: float) -> float:
        return least_force(replace(parameters, **{name: float(value)}))

    found = np.array([force_at(value) for value in values])
    if found.min() > 0:
        return Scan(values=values, least_force=found, first=None)
    lost = int((found <= 0).argmax())
    first = float(bisect(force_at, values[max(0, lost - 1)], values[lost], rtol=1e-4))
    return Scan(values=values, least_force=found, first=first)


@dataclass(frozen=True, kw_only=True, eq=False)
class DamageStudy:
    """One pinion tooth that has lost stiffness, over a turn of the pinion.

    Attributes
    ----------
    losses : ndarray, shape (L,)
        Share of the pair stiffness lost.
    responses : tuple of Response
        Steady vibration over a turn for each loss.
    levels_db : ndarray, shape (L,)
        RMS acceleration of all lines that are no mesh harmonics over that of the mesh harmonics of
        the healthy pair [dB].
    """

    losses: FloatArray
    responses: tuple[Response, ...]
    levels_db: FloatArray


def study_damage(healthy: StiffnessSignal) -> DamageStudy:
    """Solve a turn of the pinion with one weaker tooth.

    Parameters
    ----------
    healthy : StiffnessSignal
        Stiffness of the sound pairs.
    """
    problems = (_turn_problem(healthy, loss) for loss in (0.0, *LOSSES))
    sound, *hurt = (steady_state(problem, DAMAGE_TOLERANCE) for problem in problems)
    mesh_rms = np.linalg.norm(sound.acceleration[PINION_TEETH::PINION_TEETH])
    between = [np.arange(len(r.acceleration)) % PINION_TEETH > 0 for r in hurt]
    sidebands = [np.linalg.norm(r.acceleration[b]) for r, b in zip(hurt, between, strict=True)]
    levels = 20 * np.log10(np.array(sidebands) / mesh_rms)
    return DamageStudy(losses=np.array(LOSSES), responses=tuple(hurt), levels_db=levels)


def _turn_problem(healthy: StiffnessSignal, loss: float) -> HillProblem:
    """Hill's equation over a turn: tooth 1 loses `loss` of the parabola of its pair."""
    turn = np.zeros(healthy.harmonic_count * PINION_TEETH, dtype=np.complex128)
    turn[PINION_TEETH - 1 :: PINION_TEETH] = REFERENCE.variation * healthy.shape_harmonics()
    orders = np.arange(len(turn) + 1) / PINION_TEETH
    pulse = Parabolic().pulse(CONTACT_RATIO)
    lost: ComplexArray = -loss * pulse.transform(orders) / (pulse.area * PINION_TEETH)
    mean = 1.0 + lost[0].real
    p = REFERENCE
    weaker = replace(
        p, stiffness_n_per_m=p.stiffness_n_per_m * mean, period_s=p.period_s * PINION_TEETH
    )
    return weaker.problem((turn + lost[1:]) / mean)


@dataclass(frozen=True, kw_only=True, eq=False)
class HarvestStudy:
    """Power that a matched inertial harvester takes from each line, tuned to it.

    Attributes
    ----------
    frequency_hz : ndarray, shape (N,)
        Lines 1, 2 ... that its spring can be built for.
    power_w : ndarray, shape (N,)
        Mean electrical power with the housing moving as the pair does: an upper end, since the
        way from the mesh to the housing is not part of the model.
    generated_first_line_w : float
        Power that leaves the motion at line 1, in the generator and as heat [W].
    """

    frequency_hz: FloatArray
    power_w: FloatArray
    generated_first_line_w: float


def study_harvest(response: Response) -> HarvestStudy:
    """Tune a harvester to every line of a steady vibration in turn."""
    frequency = response.frequency_hz[1:]
    frequency = frequency[frequency <= HARVESTER.highest_hz]
    matched = HARVESTER.with_load(HARVESTER.mechanical_damping_ratio)
    gains = [float(matched.retuned(f).gains([f]).power_w[0]) for f in frequency.tolist()]
    powers = np.array(gains) * (2 * np.abs(response.acceleration[1 : len(gains) + 1])) ** 2
    # matched: as much again goes into heat
    generated = 2 * float(powers[0])
    return HarvestStudy(frequency_hz=frequency, power_w=powers, generated_first_line_w=generated)


@dataclass(frozen=True)
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
        fastest = min(as_good, key=lambda cost: cost.seconds, default=None)
        return None if fastest is None else (fastest, fastest.seconds / of.seconds)

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
    """Measure all ways on the reference case, interleaved; the median of repeats.

    The expansion is planned once. A simulation starts from rest, lets one mesh period pass and
    records the next: with e^(-c T/(2 m)) = 7e-12 the start is forgotten then.

    Parameters
    ----------
    repeats : int, >= 1
    tolerances : sequence of float
        Of the simulations.
    """
    case, facts = Case(name="reference", problem=REFERENCE.problem()), facts_of_run()
    rows = measured(list(_ways(case, tolerances)), repeats, LONGEST_S, solve_reference(case))
    columns = ("method", "setting", "error", "median_s")
    return SpeedStudy(
        costs=tuple(Cost(*(row[name] for name in columns)) for row in rows),
        repeats=repeats,
        machine="{processor}, {cores} processors, Python {python}, NumPy {numpy}".format(**facts),
    )


def _ways(case: Case, tolerances: Sequence[float]) -> Iterator[Contender]:
    """Yield every way; of many sets that are substituted at once the first is the reference."""
    p, oscillator = REFERENCE, PlainOscillator(case)
    for order in ORDERS:
        substitute = expand(case.problem, order, HIGHEST).substitute
        for way, sets in ((SUBSTITUTION, 1), (MANY, AT_ONCE)):
            masses = p.mass_kg * np.linspace(1.0, 1.5, sets)
            of_sets = partial(substitute, mass_kg=masses, damping_ns_per_m=p.damping_ns_per_m)
            yield Contender(way, f"{order}", run=of_sets, motion=_first_set, sets=sets)
    for tolerance in (1e-3, 1e-6, 1e-8):
        anew = partial(steady_state, case.problem, tolerance)
        yield Contender(SOLUTION, f"{tolerance:.0e}", run=anew, motion=as_lines)
    for method in METHODS:
        for tolerance in tolerances:
            rest: dict[str, Any] = {"state": (0.0, 0.0), "settling": oscillator.period}
            stepping = partial(integrate, oscillator, method, tolerance, **rest)
            yield Contender(method, f"{tolerance:.0e}", run=stepping)


def _first_set(found: ComplexArray) -> Lines:
    return Lines(found[0] / REFERENCE.static_deflection_m)


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyResults:
    """Everything that is drawn, tabulated and held against the claims.

    Attributes
    ----------
    forms : dict of str to FormResponse
        The reference case under each form of stiffness.
    reference : Operation
        The reference case.
    sweeps : dict of str to Sweep
        By parameter: stiffness_n_per_m, mass_kg, damping_ns_per_m.
    orders : OrderStudy
    contact : ContactStudy
    damage : DamageStudy
    harvest : HarvestStudy
    speed : SpeedStudy
    """

    forms: dict[str, FormResponse]
    reference: Operation
    sweeps: dict[str, Sweep]
    orders: OrderStudy
    contact: ContactStudy
    damage: DamageStudy
    harvest: HarvestStudy
    speed: SpeedStudy


def run_study(progress: Callable[[float], None] | None = None, quick: bool = False) -> StudyResults:
    """Compute the whole study, in about 20 s.

    Parameters
    ----------
    progress : callable, optional
        Called with the share done, 0 to 1.
    quick : bool
        Scan contact more coarsely and time fewer simulations, once each; all else is the same.

    Returns
    -------
    StudyResults
    """
    done = progress or (lambda _: None)
    forms, reference = form_responses(), operate(REFERENCE)
    done(0.25)
    results = StudyResults(
        forms=forms,
        reference=reference,
        sweeps=run_sweeps(lambda share: done(0.25 + 0.3 * share)),
        orders=study_orders(),
        contact=study_contact(every=4 if quick else 1),
        damage=study_damage(forms["fourier-half"].signal),
        harvest=study_harvest(reference.response),
        speed=study_speed(1, QUICK_TOLERANCES) if quick else study_speed(),
    )
    done(1.0)
    return results
