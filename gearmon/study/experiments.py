"""The whole study, computed: forms, orders, sweeps, contact, damage, harvesting, run times."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.benchmark.equations import VARIATION, Case, Lines, Samples, as_lines, solve_reference
from gearmon.benchmark.timing import Contender, Row, against, facts_of_run, measured
from gearmon.dynamics import HillProblem, Response, steady_state
from gearmon.dynamics.fourier import rms
from gearmon.dynamics.multiple_scales import Expansion, expand
from gearmon.gears.stiffness import Parabolic
from gearmon.harvesting.harvester import InertialHarvester
from gearmon.study import pair
from gearmon.terminal import Progress, followed, part_of

#: Orders that are solved and drawn.
HIGHEST_ORDER = 6
# Below the published variation the error falls by its order; above, the next orders mix in.
VARIATIONS = (0.0125, 0.025, 0.05, 0.1)

# Swept values. Of the stiffness and of the mass only the ends and some values between are printed.
DAMPING_VALUES = (3e3, 6e3, 9e3, 12e3, 15e3, 18e3, 30e3, 60e3, 90e3)
STIFFNESS_VALUES = (2e8, 3e8, 4e8, 5e8, 6e8, 8e8, 1e9, 1.2e9)
#: Parameter -> label, unit shown, SI units in one of them, values.
SWEEPS = {
    "stiffness_n_per_m": ("mesh stiffness", "GN/m", 1e9, STIFFNESS_VALUES),
    "mass_kg": ("equivalent mass", "kg", 1.0, (0.2, 0.28, 0.4, 0.6, 1.0, 1.5, 2.0, 2.5, 3.0)),
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
class OrderStudy:
    """Orders 0, 1, 2 ... of the reference case.

    Attributes
    ----------
    expansion : Expansion
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
    displacement_errors: FloatArray
    acceleration_errors: FloatArray
    errors_of_variation: FloatArray
    slopes: FloatArray


def study_orders(exact: Response) -> OrderStudy:
    """Expand what was solved and measure the error of every order, and its power of eps."""
    expansion = expand(exact.problem, HIGHEST_ORDER)
    sums = np.cumsum(expansion.terms, axis=0)
    errors = np.array([_errors_of_orders(variation) for variation in VARIATIONS])
    return OrderStudy(
        expansion=expansion,
        displacement_errors=np.array([pair.waveform_error(z, exact) for z in sums]),
        acceleration_errors=np.array([pair.acceleration_error(z, exact) for z in sums]),
        errors_of_variation=errors,
        slopes=np.polyfit(np.log(VARIATIONS), np.log(errors), 1)[0],
    )


def _errors_of_orders(variation: float) -> FloatArray:
    problem = pair.varied(pair.REFERENCE, "variation", variation)
    exact = expand(problem, 4 * HIGHEST_ORDER, 300).displacement
    sums = np.cumsum(expand(problem, HIGHEST_ORDER, 300).terms, axis=0)
    return np.array([rms(z - exact) for z in sums]) / pair.STATIC_DEFLECTION_M


@dataclass(frozen=True, eq=False)
class Sweep:
    """One parameter over its values, the others at their reference.

    Attributes
    ----------
    name : str
        Field of `HillProblem`.
    label, unit : str
        To be shown, with `scale` parameter units in one shown unit.
    scale : float
    points : tuple of Operation
    """

    name: str
    label: str
    unit: str
    scale: float
    points: tuple[pair.Operation, ...]

    @property
    def values(self) -> FloatArray:
        """Values of the parameter, SI."""
        return np.array([getattr(point.response.problem, self.name) for point in self.points])

    @property
    def shown(self) -> list[str]:
        """Values as they are to be shown, with unit."""
        return [f"{value / self.scale:.4g} {self.unit}" for value in self.values]

    def take(self, what: Callable[[pair.Operation], float]) -> FloatArray:
        """One number for every value."""
        return np.array([what(point) for point in self.points])


def run_sweeps(progress: Progress | None) -> dict[str, Sweep]:
    """Solve all sweeps; the keys are the names of the parameters."""
    sweeps: dict[str, Sweep] = {}
    for name, (label, unit, scale, values) in followed(SWEEPS.items(), len(SWEEPS), progress):
        points = (pair.operate(pair.varied(pair.REFERENCE, name, value)) for value in values)
        sweeps[name] = Sweep(name, label, unit, scale, tuple(points))
    return sweeps


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
        damped = self.map_dampings >= min(DAMPING_VALUES)
        return float(self.of_both[damped][:, self.map_masses_kg <= LARGEST_STUDIED_MASS_KG].min())


def least_force(problem: HillProblem) -> float:
    """Smallest mesh force of the steady vibration over F; -inf where there is no steady state."""
    response = steady_state(problem, SCAN_TOLERANCE)
    return -np.inf if response.stable is False else response.mesh_force_margin


def study_contact(every: int = 1) -> ContactStudy:
    """Scan mass, damping and variation, and find where contact is lost first.

    Parameters
    ----------
    every : int, >= 1
        Takes every so many of the values to scan.
    """
    heavy = replace(pair.REFERENCE, mass_kg=LARGEST_STUDIED_MASS_KG)
    masses, dampings = MAP_MASSES_KG[::every], MAP_DAMPINGS[::every]
    both = [
        least_force(replace(pair.REFERENCE, damping_ns_per_m=damping, mass_kg=mass))
        for damping, mass in itertools.product(dampings.tolist(), masses.tolist())
    ]
    # from the harmless end on: light, well damped, little varied
    return ContactStudy(
        mass=_scan(pair.REFERENCE, "mass_kg", np.geomspace(0.2, 200.0, 161)[::every]),
        damping=_scan(heavy, "damping_ns_per_m", np.geomspace(30.0, 9e4, 61)[::every][::-1]),
        variation=_scan(heavy, "variation", np.linspace(0.02, 0.98, 49)[::every]),
        map_masses_kg=masses,
        map_dampings=dampings,
        of_both=np.reshape(both, (len(dampings), len(masses))),
    )


def _scan(problem: HillProblem, name: str, values: FloatArray) -> Scan:
    """Scan one parameter, and find between two values where the force first reaches zero."""
    from scipy.optimize import bisect

    def force_at(value: float) -> float:
        return least_force(pair.varied(problem, name, value))

    found, first = np.array([force_at(value) for value in values.tolist()]), None
    if found.min() <= 0:
        lost = int((found <= 0).argmax())
        first = float(bisect(force_at, values[max(0, lost - 1)], values[lost], rtol=1e-4))
    return Scan(values=values, least_force=found, first=first)


@dataclass(frozen=True, kw_only=True, eq=False)
class DamageStudy:
    """One pinion tooth that has lost stiffness, over a turn of the pinion.

    Attributes
    ----------
    responses : tuple of Response
        Steady vibration over a turn for each loss.
    levels_db : ndarray, shape of `LOSSES`
        RMS acceleration of all lines that are no mesh harmonics over that of the mesh harmonics of
        the healthy pair [dB].
    """

    responses: tuple[Response, ...]
    levels_db: FloatArray


def study_damage(healthy: pair.StiffnessSignal) -> DamageStudy:
    """Solve a turn of the pinion with one weaker tooth.

    Parameters
    ----------
    healthy : StiffnessSignal
        Stiffness of the sound pairs.
    """
    problems = (_turn_problem(healthy, loss) for loss in (0.0, *LOSSES))
    sound, *hurt = (steady_state(problem, DAMAGE_TOLERANCE) for problem in problems)
    mesh = slice(None, None, pair.PINION_TEETH)
    mesh_rms = np.linalg.norm(sound.acceleration[mesh][1:])
    sidebands = [np.linalg.norm(np.delete(r.acceleration, mesh)) for r in hurt]
    levels = 20 * np.log10(np.array(sidebands) / mesh_rms)
    return DamageStudy(responses=tuple(hurt), levels_db=levels)


def _turn_problem(healthy: pair.StiffnessSignal, loss: float) -> HillProblem:
    """Hill's equation over a turn: tooth 1 loses `loss` of the parabola of its pair."""
    turn = np.zeros(healthy.harmonic_count * pair.PINION_TEETH, dtype=np.complex128)
    turn[pair.PINION_TEETH - 1 :: pair.PINION_TEETH] = VARIATION * healthy.shape_harmonics()
    orders = np.arange(len(turn) + 1) / pair.PINION_TEETH
    pulse = Parabolic().pulse(pair.CONTACT_RATIO)
    lost: ComplexArray = -loss * pulse.transform(orders) / (pulse.area * pair.PINION_TEETH)
    mean = 1.0 + lost[0].real
    return replace(
        pair.REFERENCE,
        stiffness_n_per_m=pair.REFERENCE.stiffness_n_per_m * mean,
        period_s=pair.REFERENCE.period_s * pair.PINION_TEETH,
        stiffness_harmonics=(turn + lost[1:]) / mean,
    )


def harvested_w(response: Response) -> FloatArray:
    """Mean electrical power of a harvester tuned and matched to line 1, 2 ... in turn [W].

    An upper end: its housing moves as the pair does, since the way from the mesh to the housing is
    not part of the model.
    """
    frequency = response.frequency_hz[1:]
    frequency = frequency[frequency <= HARVESTER.highest_hz]
    # tuned and matched it gives the most that any load takes
    most = np.array([HARVESTER.retuned(f).power_bound_w() for f in frequency.tolist()])
    amplitudes = 2 * np.abs(response.acceleration[1 : len(most) + 1])
    return np.asarray(most * amplitudes**2)


@dataclass(frozen=True, kw_only=True)
class SpeedStudy:
    """Costs of ways to the steady vibration of one set of parameters, measured side by side.

    Attributes
    ----------
    costs : list of Row
        Of `measured`: method (`SUBSTITUTION`, `MANY`, `SOLUTION` or SciPy's), setting (order or
        tolerance), error (of the acceleration over a steady period, relative L2) and median_s.
    repeats : int
    machine : str
        Processor, Python and NumPy.
    """

    costs: list[Row]
    repeats: int
    machine: str

    def ratio(self, of: Row) -> tuple[Row, float] | None:
        """Fastest simulation that is at least as accurate, and its time over that of `of`."""
        as_good = [c for c in self.costs if c["method"] in METHODS and c["error"] <= of["error"]]
        fastest = min(as_good, key=lambda cost: float(cost["median_s"]), default=None)
        return None if fastest is None else (fastest, fastest["median_s"] / of["median_s"])

    def substitution(self, order: str = f"{pair.PUBLISHED_ORDER}", way: str = SUBSTITUTION) -> Row:
        """Cost of a substitution at one order, one set or many at once."""
        return next(c for c in self.costs if (c["method"], c["setting"]) == (way, order))

    @property
    def finest(self) -> Row:
        """Most accurate substitution that some simulation still matches."""
        matched = [c for c in self.costs if c["method"] == SUBSTITUTION and self.ratio(c)]
        return min(matched, key=lambda cost: float(cost["error"]))


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
    case, facts = Case(problem=pair.REFERENCE), facts_of_run()
    machine = "{processor}, {cores} processors, Python {python}, NumPy {numpy}".format(**facts)
    costs = measured(list(_ways(case, tolerances)), repeats, LONGEST_S)
    return SpeedStudy(costs=costs, repeats=repeats, machine=machine)


def _ways(case: Case, tolerances: Sequence[float]) -> Iterator[Contender]:
    """Yield every way; of many sets that are substituted at once the first is the reference."""
    p, reference = pair.REFERENCE, solve_reference(case)
    for order in ORDERS:
        substitute = expand(case.problem, order, HIGHEST).substitute
        for way, sets in ((SUBSTITUTION, 1), (MANY, AT_ONCE)):
            masses = p.mass_kg * np.linspace(1.0, 1.5, sets)
            of_sets = partial(substitute, mass_kg=masses, damping_ns_per_m=p.damping_ns_per_m)
            judge = against(reference, lambda found: Lines(found[0] / pair.STATIC_DEFLECTION_M))
            yield Contender(way, f"{order}", run=of_sets, judge=judge, sets=sets)
    for tolerance in (1e-3, 1e-6, 1e-8):
        anew = partial(steady_state, case.problem, tolerance)
        yield Contender(SOLUTION, f"{tolerance:.0e}", run=anew, judge=against(reference, as_lines))
    for method in METHODS:
        for tolerance in tolerances:
            stepping = partial(_integrated, case, method, tolerance)
            yield Contender(method, f"{tolerance:.0e}", run=stepping, judge=against(reference))


def _integrated(case: Case, solver: str, tolerance: float) -> Samples:
    """Integrate as it is usually written: from zero, the stiffness a sum; keep a second period."""
    from scipy.integrate import solve_ivp

    p = case.problem
    damping, period = 2 * p.damping_ratio, 2 * math.pi * p.frequency_ratio
    doubled = 2 * p.stiffness_harmonics
    turns = 1j * np.arange(1, len(doubled) + 1) / p.frequency_ratio

    def slope(time: float, state: FloatArray) -> list[float]:
        kappa = 1.0 + float((np.exp(turns * time) @ doubled).real)
        z, v = state.tolist()
        return [v, 1.0 - damping * v - kappa * z]

    span, rest = (-period, period), (0.0, 0.0)
    found = solve_ivp(slope, span, rest, solver, rtol=tolerance, atol=0.1 * tolerance)
    own = (found.t >= 0) & (found.t < period * (1 - 1e-12))
    rows = zip(found.t[own], found.y[:, own].T, strict=True)
    return Samples(found.t[own] / period, np.array([slope(*row)[1] for row in rows]))


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
    harvested_w : ndarray, shape (N,)
        See `harvested_w`.
    speed : SpeedStudy
    """

    forms: dict[str, pair.FormResponse]
    reference: pair.Operation
    sweeps: dict[str, Sweep]
    orders: OrderStudy
    contact: ContactStudy
    damage: DamageStudy
    harvested_w: FloatArray
    speed: SpeedStudy


def run_study(progress: Progress | None = None, quick: bool = False) -> StudyResults:
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
    forms, reference = pair.form_responses(), pair.operate(pair.REFERENCE)
    return StudyResults(
        forms=forms,
        reference=reference,
        sweeps=run_sweeps(part_of(progress, 0.25, 0.3)),
        orders=study_orders(reference.response),
        contact=study_contact(every=4 if quick else 1),
        damage=study_damage(forms["fourier-half"].signal),
        harvested_w=harvested_w(reference.response),
        speed=study_speed(1, QUICK_TOLERANCES) if quick else study_speed(),
    )
