"""Every method with every setting that takes part: on one case, over many parameter sets, by size.

The errors of a method over many parameter sets, mass, damping and mean stiffness drawn from the
ranges of the published study, are the largest over sets drawn from them; steps and harmonics of a
rival grow with w0/w by one rule, whose factor is the least with which all those sets are within the
error. The growth of the cost is that with a stiffness that dips once in P mesh periods, P growing;
natural frequency, damping and harmonics a mesh stay, so the number of unknowns grows in proportion.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from gearmon.benchmark import rivals
from gearmon.benchmark.equations import (
    FORCE_N,
    MESH_HARMONICS,
    PERIOD_S,
    Case,
    growing_turn,
    named_case,
    square_wave,
)
from gearmon.benchmark.references import Lines, Reference, Samples, solve_reference
from gearmon.dynamics import HillProblem, Response, steady_state
from gearmon.dynamics.piecewise import PiecewiseProblem, PiecewiseResponse, solve_exactly
from gearmon.dynamics.sweep import sweep as solve_sets

#: Relative error of acceleration at which methods are set side by side.
TARGET = 1e-6
OURS, SETS_AT_ONCE, BANDED = "steady_state", "sweep", "solve_banded"
FROM_REST, AS_USUAL, SHOOTING = "SciPy from rest", "SciPy as usual", "SciPy shooting"
COMPILED = {True: "compiled RK4 from rest", False: "compiled RK4, shooting"}
CUT_OFF = "the error is that against the true jumps; a bound would be that of the sum"
NOT_INSTALLED = "numba is not installed"
#: A run expected to take longer is left out [s]; of a hunting period, which runs once, more.
LONGEST_RUN_S, LONGEST_HUNTING_RUN_S = 3.0, 15.0
#: Ranges of mass [kg], damping [Ns/m] and stiffness [N/m] of the parameter sets.
SWEPT = ((0.2, 3.0), (3e3, 9e4), (4e8, 1.6e9))
PROBES = 48
#: Sets that a loop of a slow method is timed on, and of a quicker one.
FEW, MANY = 300, 2000
#: Mesh periods in the period of a growing turn.
MESHES, QUICK_MESHES = tuple(2**power for power in range(12)), (1, 8, 32)
#: Larger matrices of a growing turn are left out.
GROWING_BYTES = 3e8


@dataclass(frozen=True, eq=False)
class Contender:
    """One method with one setting.

    Parameters
    ----------
    method : str
        Name in tables and pictures.
    group : str
        "gearmon", "SciPy from rest", "SciPy as usual", "SciPy shooting", "compiled", "banded" or
        "exact".
    setting : str
        Tolerance, order, steps or harmonics, in words.
    wanted : float or None
        Relative error aimed at, where the setting was made for one.
    run : callable or None
        What is timed; None if it cannot run, for the reason in `note`.
    motion : callable
        Takes what `run` returned and gives what its error is measured on; not timed.
    note : str
    sets : int
        How many solutions one run makes.
    error, error_bound, unknowns : float, float, int or None
        Where they are known before the run.
    """

    method: str
    group: str
    setting: str = ""
    wanted: float | None = None
    run: Callable[[], Any] | None = None
    motion: Callable[[Any], Lines | Samples] = lambda found: found
    note: str = ""
    sets: int = 1
    error: float | None = None
    error_bound: float | None = None
    unknowns: int | None = None


def contenders(
    case: Case, reference: Reference, wanted: tuple[float, ...], solvers: tuple[str, ...]
) -> list[Contender]:
    """Return all methods of a case, tuned.

    Parameters
    ----------
    case : Case
    reference : Reference
    wanted : tuple of float
        Relative errors to be met by the methods that can be tuned to one.
    solvers : tuple of str
        Of SciPy.
    """
    own = _for_rectangle(case) if case.rectangle else _own(case, wanted)
    banded = [] if case.rectangle else _banded(case, reference, wanted)
    return [
        *own,
        *_from_rest(case, reference, wanted, solvers),
        *_as_usual(case, reference, solvers),
        *_shooting(case, reference, wanted),
        *_compiled(case, reference, wanted),
        *banded,
    ]


def as_lines(response: Response) -> Lines:
    """Return the harmonics of a response, in units of F/k0."""
    p = response.problem
    return Lines(response.displacement * (p.stiffness_n_per_m / p.force_n))


def _own(case: Case, wanted: tuple[float, ...]) -> Iterator[Contender]:
    p, long = case.problem, case.meshes > 100
    for tolerance in wanted:
        setting = f"tolerance {tolerance:.0e}"
        run = partial(steady_state, p, tolerance)
        yield Contender(OURS, "gearmon", setting, tolerance, run, as_lines)
        if not long:
            run = partial(steady_state, p, tolerance, "harmonic balance")
            yield Contender("harmonic balance", "gearmon", setting, tolerance, run, as_lines)
    # a tolerance of 1 keeps a fixed order from being judged more closely than by its residual
    plain, least = (1, 2, 3, 4, 6, 8), (1, 2, 3, 4, 6, 8, 12, 16)
    for order in plain[:3] if long else plain:
        run, method = partial(steady_state, p, 1.0, "msm", order), "multiple scales, plain sum"
        yield Contender(method, "gearmon", f"order {order}", None, run, as_lines)
    for order in (2, 4, 8) if long else least:
        run = partial(steady_state, p, 1e-8, "msm least residual", order)
        method = "multiple scales, least residual"
        yield Contender(method, "gearmon", f"order {order}", None, run, as_lines)


def _for_rectangle(case: Case) -> Iterator[Contender]:
    """Fourier sums of growing length against the true rectangle, and the exact pieces."""
    assert case.rectangle is not None
    for count in (10, 30, 100, 300, 1000):
        kept = case.problem.stiffness_harmonics[:count]
        p, setting = replace(case.problem, stiffness_harmonics=kept), f"{count} stiffness harmonics"
        run, of_sum = partial(steady_state, p, TARGET), "steady_state of the Fourier sum"
        yield Contender(of_sum, "gearmon", setting, None, run, as_lines, CUT_OFF)
        forces = partial(_by_forces, p, case.rectangle)
        yield Contender("the same, acceleration from forces", "gearmon", setting, run=forces)
    exactly = partial(_exactly, case.rectangle)
    yield Contender("exact pieces", "exact", "256 points", TARGET, exactly)


def _by_forces(p: HillProblem, true: PiecewiseProblem, points: int = 1024) -> Samples:
    """Take the acceleration from F - c v - k z with the true k: z and v have no jumps."""
    response = steady_state(p, TARGET)
    half = (np.arange(points) + 0.5) / points
    turn = np.exp(1j * math.pi * np.arange(len(response.displacement)) / points)
    length = max(points, 2 * points * math.ceil(len(turn) / points))
    step = length // points
    z, v = (
        np.fft.irfft(part * turn, length, norm="forward")[::step]
        for part in (response.displacement, response.velocity)
    )
    ends = np.cumsum(true.durations_s) / true.period_s
    piece = np.searchsorted(ends, (half - true.start_s / true.period_s) % 1.0, side="right")
    force = p.force_n - p.damping_ns_per_m * v - true.stiffness_n_per_m[piece] * z
    return Samples(half, force / p.force_n)  # in units of w0^2 F/k0 = F/m


def _exactly(true: PiecewiseProblem, points: int = 256) -> Samples:
    share = np.arange(points) / points
    response: PiecewiseResponse = solve_exactly(true, 1)
    acceleration = response.at(share * true.period_s, "acceleration")
    return Samples(share, acceleration * (true.mass_kg / true.mean_force_n))


def _from_rest(
    case: Case, reference: Reference, wanted: tuple[float, ...], solvers: tuple[str, ...]
) -> Iterator[Contender]:
    oscillator, long = rivals.Oscillator(case), case.meshes > 100
    for solver in solvers:
        method = f"SciPy {solver}"
        known = _map_of(case, oscillator, reference, solver, min(wanted))
        for error in (TARGET,) if long else wanted:
            settling = reference.settling(rivals.SETTLED_SHARE * error)
            periods = 1 + settling / oscillator.period
            expected = known.time_s(error) * periods * (case.meshes / 26 if long else 1)
            if expected > (LONGEST_HUNTING_RUN_S if long else LONGEST_RUN_S):
                note = f"not run: about {expected:.0f} s expected"
                yield Contender(method, FROM_REST, f"for {error:.0e}", note=note)
                continue
            tolerance = known.tolerance(0.6 * error)
            run = partial(rivals.integrate, oscillator, solver, settling=settling)
            if error == TARGET and not long:
                error_at = partial(_error_of, reference, run)
                tolerance = rivals.tuned_tolerance(tolerance, error, error_at)
            setting = f"tolerance {tolerance:.1e}, {periods - 1:.2f} periods to settle"
            yield Contender(method, FROM_REST, setting, error, partial(run, tolerance))


def _as_usual(case: Case, reference: Reference, solvers: tuple[str, ...]) -> Iterator[Contender]:
    """Plain use of solve_ivp: stiffness as a sum in NumPy, from z = 0; at the target only."""
    if case.rectangle is not None or case.meshes > 100:
        return
    oscillator = rivals.PlainOscillator(case)
    settling = reference.settling(rivals.SETTLED_SHARE * TARGET, deflection=0.0)
    run = partial(rivals.integrate, oscillator, state=(0.0, 0.0), settling=settling)
    for solver in (name for name in ("DOP853", "LSODA") if name in solvers):
        one, method = partial(run, solver), f"SciPy {solver}, as usually written"
        known = rivals.tolerance_map(oscillator, reference, solver, 0.5 * TARGET)
        first, error_at = known.tolerance(0.6 * TARGET), partial(_error_of, reference, one)
        tolerance = rivals.tuned_tolerance(first, TARGET, error_at)
        periods = settling / oscillator.period
        setting = f"tolerance {tolerance:.1e}, {periods:.2f} periods to settle"
        yield Contender(method, AS_USUAL, setting, TARGET, partial(one, tolerance))


def _error_of(reference: Reference, run: Callable[[float], Samples], setting: float) -> float:
    return reference.error(run(setting))


def _map_of(
    case: Case, oscillator: rivals.Oscillator, reference: Reference, solver: str, finest: float
) -> rivals.ToleranceMap:
    """Errors over tolerances; of a hunting period those of one turn with a cracked tooth."""
    if case.meshes > 100:
        turn = named_case("cracked tooth")
        oscillator, reference, finest = rivals.Oscillator(turn), solve_reference(turn), 0.2 * TARGET
    return rivals.tolerance_map(oscillator, reference, solver, 0.5 * finest)


def _shooting(case: Case, reference: Reference, wanted: tuple[float, ...]) -> Iterator[Contender]:
    oscillator = rivals.Oscillator(case)
    for error in () if case.meshes > 100 else wanted:
        run = partial(rivals.shoot, oscillator)
        error_at = partial(_error_of, reference, run)
        tolerance = rivals.tuned_tolerance(0.1 * error, error, error_at)
        setting, ready = f"tolerance {tolerance:.1e}", partial(run, tolerance)
        yield Contender("SciPy DOP853, shooting", SHOOTING, setting, error, ready)


def _compiled(case: Case, reference: Reference, wanted: tuple[float, ...]) -> Iterator[Contender]:
    if not rivals.numba_is_installed():
        yield from (Contender(m, "compiled", note=NOT_INSTALLED) for m in COMPILED.values())
        return
    p, long = case.problem, case.meshes > 100
    tuned: dict[float, int] = {}
    for rest, method in COMPILED.items():
        for error in (1e-4, TARGET) if long else wanted:
            settling = reference.settling(rivals.SETTLED_SHARE * error) if rest else None
            # over a long period a settled motion and a periodic one have the same error
            if error not in tuned or not long:
                error_at = rivals.compiled_error(case, reference, settling)
                # multiples of four: the jumps of a rectangle fall between steps
                first = 24 * p.frequency_ratio + 48
                tuned[error] = int(rivals.least_within(error, first, error_at, 4))
            steps = tuned[error]
            common = (rivals.tables(case, steps), p.frequency_ratio, p.damping_ratio)
            run: Callable[[], Samples] = partial(rivals.shoot_compiled, *common)
            if settling is not None:
                run = partial(rivals.march, *common, settling)
            yield Contender(method, "compiled", f"{steps} steps a period", error, run)


def _banded(case: Case, reference: Reference, wanted: tuple[float, ...]) -> Iterator[Contender]:
    p = case.problem
    start = math.ceil(p.frequency_ratio) + MESH_HARMONICS
    needed = rivals.banded_bytes(len(p.stiffness_harmonics), start)
    if needed > rivals.BYTES_ALLOWED:
        note = f"not run: the band matrix needs more than {needed / 1e9:.0f} GB"
        yield Contender(BANDED, "banded", note=note)
        return

    def error_at(harmonics: float) -> float:
        return reference.error(_solve_band(p, int(harmonics))())

    for error in wanted:
        highest = int(rivals.least_within(error, start, error_at, 1))
        run = _solve_band(p, highest)
        yield Contender(BANDED, "banded", f"{highest} harmonics", error, run)


def _solve_band(p: HillProblem, highest: int) -> Callable[[], Lines]:
    bands = rivals.band(p.stiffness_harmonics, highest)
    return partial(rivals.solve_band, bands, p.frequency_ratio, p.damping_ratio)


@dataclass(frozen=True, kw_only=True, eq=False)
class Sweep:
    """Parameter sets and the accurate motions of some.

    Parameters
    ----------
    problems : tuple of HillProblem
    probes : tuple of int
        Indices of the sets with a reference.
    references : tuple of Reference
    """

    problems: tuple[HillProblem, ...]
    probes: tuple[int, ...]
    references: tuple[Reference, ...]

    def largest_error(self, motion_of: Callable[[HillProblem], Lines | Samples]) -> float:
        """Largest relative error of the acceleration over the probes."""
        pairs = zip(self.probes, self.references, strict=True)
        return max(reference.error(motion_of(self.problems[i])) for i, reference in pairs)


def draw_sweep(count: int, seed: int, probes: int = PROBES) -> Sweep:
    """Draw parameter sets, log-uniformly in mass, damping and mean stiffness.

    Parameters
    ----------
    count : int, >= 1
    seed : int
    probes : int
        How many of them get a reference.
    """
    rng = np.random.default_rng(seed)
    ranges = np.log(SWEPT)
    drawn = np.exp(rng.uniform(ranges[:, :1], ranges[:, 1:], (3, count)))
    harmonics = square_wave(10)
    problems = tuple(
        HillProblem(m, c, k, harmonics, PERIOD_S, FORCE_N) for m, c, k in drawn.T.tolist()
    )
    chosen = rng.choice(count, min(probes, count), replace=False).tolist()
    references = tuple(solve_reference(_one_set(problems[i])) for i in chosen)
    return Sweep(problems=problems, probes=tuple(chosen), references=references)


def _one_set(problem: HillProblem) -> Case:
    return Case(name="set", title="one set", problem=problem)


def sweep_contenders(sweep: Sweep) -> list[Contender]:
    """Return all methods over the same sets; loops over single solutions take the first of them."""
    return [*_own_loops(sweep), _banded_loop(sweep), *_compiled_loops(sweep)]


def _own_loops(sweep: Sweep) -> Iterator[Contender]:
    few = sweep.problems[:FEW]
    yield _together(sweep)
    found = {i: steady_state(sweep.problems[i], TARGET) for i in sweep.probes}
    yield Contender(
        OURS,
        "gearmon",
        "in a loop",
        TARGET,
        run=lambda: [steady_state(p, TARGET) for p in few],
        sets=len(few),
        error=sweep.largest_error(lambda p: as_lines(found[sweep.problems.index(p)])),
        error_bound=max(response.error_bound for response in found.values()),
    )


def _together(sweep: Sweep) -> Contender:
    """All sets at once, nothing kept from an earlier call."""
    columns = [(p.mass_kg, p.damping_ns_per_m, p.stiffness_n_per_m) for p in sweep.problems]
    mass, damping, stiffness = np.array(columns).T
    common = mass, damping, stiffness, sweep.problems[0].stiffness_harmonics, PERIOD_S, FORCE_N
    run = partial(solve_sets, *common, tolerance=TARGET)
    found = run()
    refused = int((~found.met).sum())
    pairs = zip(sweep.probes, sweep.references, strict=True)
    errors = [ref.error(as_lines(found.response(i))) for i, ref in pairs if found.met[i]]
    return Contender(
        SETS_AT_ONCE,
        "gearmon",
        "all at once",
        TARGET,
        run,
        note=f"{refused} sets refused" if refused else "",
        sets=len(sweep.problems),
        error=max(errors, default=None),
        error_bound=float(found.error_bound[found.met].max()) if found.met.any() else None,
    )


def _banded_loop(sweep: Sweep) -> Contender:
    harmonics, some = sweep.problems[0].stiffness_harmonics, sweep.problems[:MANY]

    def highest(p: HillProblem, factor: float) -> int:
        return math.ceil(factor * (p.frequency_ratio + 10))

    def error_at(factor: float) -> float:
        return sweep.largest_error(lambda p: _solve_band(p, highest(p, factor))())

    factor = rivals.least_within(TARGET, 1.0, error_at)
    sizes = [highest(p, factor) for p in some]
    bands = {size: rivals.band(harmonics, size) for size in set(sizes)}
    chosen = [
        (bands[size], p.frequency_ratio, p.damping_ratio)
        for p, size in zip(some, sizes, strict=True)
    ]
    setting = f"in a loop, {factor:.2f} (w0/w + 10) harmonics"
    run, error = lambda: [rivals.solve_band(*each) for each in chosen], error_at(factor)
    return Contender(BANDED, "banded", setting, TARGET, run, sets=len(some), error=error)


def _compiled_loops(sweep: Sweep) -> Iterator[Contender]:
    if not rivals.numba_is_installed():
        for method in COMPILED.values():
            yield Contender(method, "compiled", wanted=TARGET, note=NOT_INSTALLED, sets=0)
        return
    for rest, method in COMPILED.items():
        # all sets have the period and the relative stiffness of this case
        loop = _CompiledLoop(_one_set(sweep.problems[0]), rest, {})
        factor = rivals.least_within(TARGET, 30.0, partial(loop.error_at, sweep))
        setting = f"in a loop, {factor:.0f} (w0/w + 3) steps a period"
        some, error = sweep.problems[:MANY], loop.error_at(sweep, factor)
        run = partial(loop.all, some, factor)
        yield Contender(method, "compiled", setting, TARGET, run, sets=len(some), error=error)


@dataclass(frozen=True)
class _CompiledLoop:
    """Compiled steps over many sets, with the tables of stiffness that they share."""

    case: Case
    rest: bool
    kept: dict[int, rivals.Tables]

    def one(self, p: HillProblem, factor: float) -> Samples:
        steps = 4 * math.ceil(factor * (p.frequency_ratio + 3) / 4)
        if steps not in self.kept:
            self.kept[steps] = rivals.tables(self.case, steps)
        common = self.kept[steps], p.frequency_ratio, p.damping_ratio
        if self.rest:
            return rivals.march(*common, _settling(p.damping_ratio))
        return rivals.shoot_compiled(*common)

    def all(self, problems: tuple[HillProblem, ...], factor: float) -> list[Samples]:
        return [self.one(p, factor) for p in problems]

    def error_at(self, sweep: Sweep, factor: float) -> float:
        return sweep.largest_error(partial(self.one, factor=factor))


def _settling(zeta: float) -> float:
    """Time for the slowest free vibration to fall by 3e7 with the mean stiffness [1/w0]."""
    rate = zeta if zeta < 1 else zeta - math.sqrt(zeta**2 - 1)
    return math.log(3e7) / rate


def growing_contenders(quick: bool = False) -> Iterator[Contender]:
    """Yield `steady_state` and solve_banded on the same harmonics over growing periods."""
    for meshes in QUICK_MESHES if quick else MESHES:
        p, setting = growing_turn(meshes), f"{meshes} meshes"
        response = steady_state(p, TARGET)
        count, bound = len(response.displacement), response.error_bound
        run = partial(steady_state, p, TARGET)
        yield Contender(OURS, "gearmon", setting, TARGET, run, error_bound=bound, unknowns=count)
        if rivals.banded_bytes(len(p.stiffness_harmonics), count) < GROWING_BYTES:
            band = _solve_band(p, count - 1)
            yield Contender(BANDED, "banded", setting, None, band, unknowns=count)
