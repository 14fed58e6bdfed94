"""Methods for the steady vibration of a gear mesh: run time against error.

On named cases each method runs with several settings; the error is the relative L2 error of the
acceleration against an accurate motion that no method shares. At one error all are set side by
side. Rivals know more than a user would: their steps and tolerances are tuned on the accurate
motion, the time that free vibrations need to settle is told to them, and (but for SciPy "as usually
written") they begin in the static deflection and read stiffness from tables made beforehand.
`steady_state` knows its tolerance only, and its time contains its error bound.

The errors of a method over many parameter sets are the largest over sets drawn from them; steps and
harmonics of a rival grow with w0/w by one rule, whose factor is the least with which all those sets
are within the error. The growth of the cost is that with a stiffness that dips once in P mesh
periods, P growing; natural frequency, damping and harmonics a mesh stay, so the number of unknowns
grows in proportion. A stability chart and a family of faults are in `jobs`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from gearmon.benchmark import jobs, rivals
from gearmon.benchmark.equations import (
    CASES,
    FORCE_N,
    MESH_HARMONICS,
    PERIOD_S,
    QUICK,
    Case,
    Lines,
    Reference,
    Samples,
    as_lines,
    growing_turn,
    named_case,
    solve_reference,
    square_wave,
)
from gearmon.benchmark.rivals import (
    COMPILED,
    CUT_OFF,
    NOT_INSTALLED,
    OURS,
    SETS_AT_ONCE,
    TARGET,
    Contender,
    Row,
    measured,
    with_ratios,
)
from gearmon.benchmark.timing import task_time
from gearmon.dynamics import HillProblem, steady_state
from gearmon.dynamics.sweep import sweep as solve_sets
from gearmon.terminal import Progress, followed

WANTED = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10)
BANDED = "solve_banded"
AS_USUAL, FROM_REST, SHOOTING = "SciPy {}, as usually written", "SciPy {}", "SciPy {}, shooting"
#: Every rival by the column of its factor in the headlines.
RIVALS = {
    "as_usual": AS_USUAL.format(rivals.SHOT),
    "solve_ivp": FROM_REST.format(rivals.SHOT),
    "odeint": FROM_REST.format(rivals.ODEINT),
    "shooting": SHOOTING.format(rivals.SHOT),
    "compiled": COMPILED,
    "solve_banded": BANDED,
}
SWEEP, GROWTH = "parameter sets", "cost growth"
#: Jobs of more than one solution.
JOBS = {"stability chart": jobs.chart_rows, "fault family": jobs.family_rows}
#: Share of the wanted error that may be left of the free vibration.
SETTLED_SHARE = 0.3
#: A run expected to take longer is left out [s]; of a hunting period, which runs once, more.
LONGEST_RUN_S, LONGEST_HUNTING_RUN_S = 10.0, 30.0
#: A solver's tolerance over the error aimed at, before it is tuned.
GUESSED_TOLERANCE = 0.01
#: Ranges of mass [kg], damping [Ns/m] and stiffness [N/m] of the parameter sets: those of the
#: published study.
SWEPT = ((0.2, 3.0), (3e3, 9e4), (4e8, 1.6e9))
PROBES = 48
#: Sets that a loop of a slow method is timed on, and of a quicker one.
FEW, MANY = 300, 2000
#: Mesh periods in the period of a growing turn.
MESHES, QUICK_MESHES = tuple(2**power for power in range(12)), (1, 8, 32)
#: Larger matrices of a growing turn are left out.
GROWING_BYTES = 3e8
#: Below, the run time is that of calls and not of numbers.
FIRST_FITTED = 2000


def run_dynamics(
    quick: bool = False,
    cases: Sequence[str] | None = None,
    seed: int = 0,
    count: int = 10_000,
    progress: Progress | None = None,
) -> list[Row]:
    """Time all methods on named cases, on many parameter sets, and over growing sizes.

    Parameters
    ----------
    quick : bool
        Few cases, settings and repeats: seconds in place of minutes. The figures are then rough.
    cases : sequence of str, optional
        Names of cases, "parameter sets", "stability chart", "fault family" or "cost growth"; all by
        default.
    seed : int
        Of the parameter sets.
    count : int, >= 1
        Number of parameter sets.
    progress : callable, optional
        Called with the share done, 0 to 1.

    Returns
    -------
    list of dict
        One row a method and setting. `median_s` is the run time
        [s] of one solution, of a sweep that of one set; `times_ours` is it over ours at 1e-6 in the
        same case (of parameter sets `sweep`), and
        `times_ours_fastest` the same of the fastest runs, which a busy machine disturbs less;
        `at_target` marks each method's cheapest row with an error within 1e-6. `exponent` is, of
        the growing sizes, that of a power of the unknowns fitted to the run times of a method.

    Raises
    ------
    ArgumentError
        If there is no such case.
    """
    names = (
        list(cases) if cases is not None else [*(QUICK if quick else CASES), SWEEP, *JOBS, GROWTH]
    )
    rows: list[Row] = []
    for name in followed(names, len(names), progress):
        if name == SWEEP:
            found = sweep_rows(200 if quick else count, seed, quick)
        elif name == GROWTH:
            found = growth_rows(quick)
        elif name in JOBS:
            found = JOBS[name](quick)
        else:
            found = case_rows(named_case(name), quick)
        rows += [{"case": name, **row} for row in found]
    return rows


def case_rows(case: Case, quick: bool = False) -> list[Row]:
    """Time all methods on one case; see `run_dynamics`.

    Parameters
    ----------
    case : Case
    quick : bool
        Two errors wanted, three repeats.
    """
    reference, wanted = solve_reference(case), (1e-3, TARGET) if quick else WANTED
    listed = [
        *(_for_rectangle(case) if case.rectangle else _own(case, wanted)),
        *_of_scipy(case, reference, wanted),
        *_compiled(case, reference, wanted),
        *([] if case.rectangle else _banded(case, reference, wanted)),
    ]
    return with_ratios(measured(listed, 3 if quick else 31, 0.05 if quick else 0.6, reference))


def _own(case: Case, wanted: tuple[float, ...]) -> Iterator[Contender]:
    p, long = case.problem, case.meshes > 100
    for tolerance in wanted:
        setting = f"tolerance {tolerance:.0e}"
        yield Contender(OURS, setting, tolerance, partial(steady_state, p, tolerance), as_lines)
        if not long:
            run = partial(steady_state, p, tolerance, "harmonic balance")
            yield Contender("harmonic balance", setting, tolerance, run, as_lines)
    # a tolerance of 1 keeps a fixed order from being judged more closely than by its residual
    for order in (1, 2, 3) if long else (1, 2, 3, 4, 6, 8):
        run, method = partial(steady_state, p, 1.0, "msm", order), "multiple scales, plain sum"
        yield Contender(method, f"order {order}", None, run, as_lines)
    for order in (2, 4, 8) if long else (1, 2, 3, 4, 6, 8, 12, 16):
        run = partial(steady_state, p, 1e-8, "msm least residual", order)
        yield Contender("multiple scales, least residual", f"order {order}", None, run, as_lines)


def _for_rectangle(case: Case) -> Iterator[Contender]:
    """Fourier sums of growing length against the true rectangle."""
    assert case.rectangle is not None
    for count in (10, 30, 100, 300, 1000):
        kept = case.problem.stiffness_harmonics[:count]
        p, setting = replace(case.problem, stiffness_harmonics=kept), f"{count} stiffness harmonics"
        run, of_sum = partial(steady_state, p, TARGET), "steady_state of the Fourier sum"
        yield Contender(of_sum, setting, None, run, as_lines, CUT_OFF)


def _of_scipy(case: Case, reference: Reference, wanted: tuple[float, ...]) -> Iterator[Contender]:
    """From rest with tables; of a short smooth period also as usually written, and by shooting."""
    oscillator, long = rivals.Oscillator(case), case.meshes > 100

    def from_rest(solver: str, error: float) -> tuple[Callable[[float], Samples], float]:
        settling = reference.settling(SETTLED_SHARE * error)
        run = partial(rivals.integrate, oscillator, solver, settling=settling)
        return run, settling / oscillator.period

    for solver in rivals.SOLVERS:
        for error in (TARGET,) if long else wanted:
            run, periods = from_rest(solver, error)
            yield _timed_out_or(case, FROM_REST.format(solver), run, error, periods, reference)
    if long:
        return
    if case.rectangle is None:
        settling = reference.settling(SETTLED_SHARE * TARGET, deflection=0.0)
        plain = rivals.PlainOscillator(case)
        run = partial(rivals.integrate, plain, rivals.SHOT, state=(0.0, 0.0), settling=settling)
        periods, usual = settling / oscillator.period, AS_USUAL.format(rivals.SHOT)
        yield _timed_out_or(case, usual, run, TARGET, periods, reference)
    for error in wanted:
        run = partial(rivals.shoot, oscillator)
        yield _timed_out_or(case, SHOOTING.format(rivals.SHOT), run, error, 0.0, reference)


def _timed_out_or(
    case: Case,
    method: str,
    run: Callable[[float], Samples],
    error: float,
    periods: float,
    reference: Reference,
) -> Contender:
    """Tune a tolerance; of a hunting period it is guessed, for its runs are too long to repeat."""
    long, tolerance = case.meshes > 100, GUESSED_TOLERANCE * error
    taken, _ = task_time(partial(run, tolerance))
    if taken > (LONGEST_HUNTING_RUN_S if long else LONGEST_RUN_S):
        return Contender(method, f"for {error:.0e}", note=f"left out: a run takes {taken:.0f} s")
    if not long:
        tolerance = rivals.tolerance_within(error, run, reference)
    setting = f"tolerance {tolerance:.1e}, {periods:.2f} periods to settle"
    return Contender(method, setting, error, partial(run, tolerance))


def _compiled(case: Case, reference: Reference, wanted: tuple[float, ...]) -> Iterator[Contender]:
    if not rivals.numba_is_installed():
        yield Contender(COMPILED, note=NOT_INSTALLED)
        return
    p = case.problem
    for error in (1e-4, TARGET) if case.meshes > 100 else wanted:
        settling = reference.settling(SETTLED_SHARE * error)

        def run(steps: float, settling: float = settling) -> Callable[[], Samples]:
            table = rivals.tables(case, int(steps))
            known = table, p.frequency_ratio, p.damping_ratio, settling
            return partial(rivals.march_compiled, *known)

        def error_at(steps: float) -> float:
            return reference.error(run(steps)())

        # multiples of four: the jumps of a rectangle fall between steps
        steps = rivals.least_within(error, 24 * p.frequency_ratio + 48, error_at, 4)
        yield Contender(COMPILED, f"{steps:.0f} steps a period", error, run(steps))


def _banded(case: Case, reference: Reference, wanted: tuple[float, ...]) -> Iterator[Contender]:
    p = case.problem
    start = math.ceil(p.frequency_ratio) + MESH_HARMONICS
    needed = rivals.banded_bytes(len(p.stiffness_harmonics), start)
    if needed > rivals.BYTES_ALLOWED:
        yield Contender(BANDED, note=f"not run: the matrix needs over {needed / 1e9:.0f} GB")
        return

    def error_at(harmonics: float) -> float:
        return reference.error(_solve_band(p, int(harmonics))())

    for error in wanted:
        highest = int(rivals.least_within(error, start, error_at, 1))
        yield Contender(BANDED, f"{highest} harmonics", error, _solve_band(p, highest))


def _solve_band(p: HillProblem, highest: int) -> Callable[[], Lines]:
    bands = rivals.band(p.stiffness_harmonics, highest)
    return partial(rivals.solve_band, bands, p.frequency_ratio, p.damping_ratio)


@dataclass(frozen=True, kw_only=True, eq=False)
class Sweep:
    """Parameter sets and the accurate motions of some.

    Parameters
    ----------
    problems : tuple of HillProblem
    references : dict of int to Reference
        By the indices of the sets that have one.
    """

    problems: tuple[HillProblem, ...]
    references: dict[int, Reference]

    def largest_error(self, motion_of: Callable[[int], Lines | Samples]) -> float:
        """Largest relative error of the acceleration over the sets with a reference."""
        return max(known.error(motion_of(i)) for i, known in self.references.items())


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
    references = {i: solve_reference(_one_set(problems[i])) for i in chosen}
    return Sweep(problems=problems, references=references)


def _one_set(problem: HillProblem) -> Case:
    return Case(name="set", problem=problem)


def sweep_rows(count: int, seed: int, quick: bool = False) -> list[Row]:
    """Time all methods over the same parameter sets; run times are told a set.

    Parameters
    ----------
    count : int, >= 1
        Number of sets; loops over single solutions take the first of them.
    seed : int
    quick : bool
        Few sets and repeats.
    """
    sweep = draw_sweep(count, seed, 6 if quick else PROBES)
    listed = [_together(sweep), _own_loop(sweep), _banded_loop(sweep), _compiled_loop(sweep)]
    return with_ratios(measured(listed, 2 if quick else 9, 0.1 if quick else 3.0))


def _together(sweep: Sweep) -> Contender:
    """All sets at once, nothing kept from an earlier call."""
    columns = [(p.mass_kg, p.damping_ns_per_m, p.stiffness_n_per_m) for p in sweep.problems]
    mass, damping, stiffness = np.array(columns).T
    common = mass, damping, stiffness, sweep.problems[0].stiffness_harmonics, PERIOD_S, FORCE_N
    run = partial(solve_sets, *common, tolerance=TARGET)
    found = run()
    refused, met = int((~found.met).sum()), [i for i in sweep.references if found.met[i]]
    errors = [sweep.references[i].error(as_lines(found.response(i))) for i in met]
    return Contender(
        SETS_AT_ONCE,
        "all at once",
        TARGET,
        run,
        note=f"{refused} sets refused" if refused else "",
        sets=len(sweep.problems),
        error=max(errors, default=None),
        error_bound=float(found.error_bound[found.met].max()) if found.met.any() else None,
    )


def _own_loop(sweep: Sweep) -> Contender:
    few = sweep.problems[:FEW]
    found = {i: steady_state(sweep.problems[i], TARGET) for i in sweep.references}
    return Contender(
        OURS,
        "in a loop",
        TARGET,
        run=lambda: [steady_state(p, TARGET) for p in few],
        sets=len(few),
        error=sweep.largest_error(lambda i: as_lines(found[i])),
        error_bound=max(response.error_bound for response in found.values()),
    )


def _loop(
    method: str, rule: str, first: float, sweep: Sweep, ready: Callable[..., Callable[[], Any]]
) -> Contender:
    """One solution after another, each with a setting that grows with w0/w by the tuned factor."""

    def error_at(factor: float) -> float:
        return sweep.largest_error(lambda i: ready(sweep.problems[i], factor)())

    factor = rivals.least_within(TARGET, first, error_at)
    tasks = [ready(p, factor) for p in sweep.problems[:MANY]]
    setting, error = f"in a loop, {factor:.2f} ({rule}", error_at(factor)
    run = lambda: [task() for task in tasks]  # noqa: E731
    return Contender(method, setting, TARGET, run, sets=len(tasks), error=error)


def _banded_loop(sweep: Sweep) -> Contender:
    bands: dict[int, Any] = {}

    def ready(p: HillProblem, factor: float) -> Callable[[], Lines]:
        highest = math.ceil(factor * (p.frequency_ratio + 10))
        if highest not in bands:
            bands[highest] = rivals.band(p.stiffness_harmonics, highest)
        return partial(rivals.solve_band, bands[highest], p.frequency_ratio, p.damping_ratio)

    return _loop(BANDED, "w0/w + 10) harmonics", 1.0, sweep, ready)


def _compiled_loop(sweep: Sweep) -> Contender:
    if not rivals.numba_is_installed():
        return Contender(COMPILED, wanted=TARGET, note=NOT_INSTALLED, sets=0)
    # all sets have the period and the relative stiffness of this case
    case, tables = _one_set(sweep.problems[0]), dict[int, rivals.Tables]()

    def ready(p: HillProblem, factor: float) -> Callable[[], Samples]:
        steps = 4 * math.ceil(factor * (p.frequency_ratio + 3) / 4)
        if steps not in tables:
            tables[steps] = rivals.tables(case, steps)
        settling = _settling(p.damping_ratio)
        known = tables[steps], p.frequency_ratio, p.damping_ratio, settling
        return partial(rivals.march_compiled, *known)

    return _loop(COMPILED, "w0/w + 3) steps a period", 30.0, sweep, ready)


def _settling(zeta: float) -> float:
    """Time for the slowest free vibration to fall by 3e7 with the mean stiffness [1/w0]."""
    rate = zeta if zeta < 1 else zeta - math.sqrt(zeta**2 - 1)
    return math.log(3e7) / rate


def growth_rows(quick: bool = False) -> list[Row]:
    """Time `steady_state` and solve_banded on the same harmonics over growing periods.

    Parameters
    ----------
    quick : bool
        Three small sizes.
    """
    rows = measured(list(_growing(quick)), 3 if quick else 15, 0.05 if quick else 2.0)
    for method in (OURS, BANDED):
        own = [row for row in rows if row["method"] == method]
        exponent = fitted_exponent(own)
        for row in own:
            row["exponent"] = exponent
    # sizes are compared each by itself
    settings = dict.fromkeys(row["setting"] for row in rows)
    groups = [[row for row in rows if row["setting"] == setting] for setting in settings]
    return [row for group in groups for row in with_ratios(group)]


def _growing(quick: bool) -> Iterator[Contender]:
    for meshes in QUICK_MESHES if quick else MESHES:
        p, setting = growing_turn(meshes), f"{meshes} meshes"
        response = steady_state(p, TARGET)
        count, bound = len(response.displacement), response.error_bound
        run = partial(steady_state, p, TARGET)
        yield Contender(OURS, setting, TARGET, run, error_bound=bound, unknowns=count)
        if rivals.banded_bytes(len(p.stiffness_harmonics), count) < GROWING_BYTES:
            band = _solve_band(p, count - 1)
            yield Contender(BANDED, setting, None, band, unknowns=count)


def fitted_exponent(rows: Sequence[Row], least: int = FIRST_FITTED) -> float | None:
    """Exponent p of median_s ~ unknowns^p, or None with fewer than three rows to fit.

    Examples
    --------
    >>> rows = [{"unknowns": n, "median_s": 1e-6 * n**1.5} for n in (3000, 9000, 30000)]
    >>> round(fitted_exponent(rows), 6)
    1.5
    """
    kept = [(row["unknowns"], row["median_s"]) for row in rows if row["unknowns"] >= least]
    if len(kept) < 3:
        return None
    x, y = np.log(np.array(kept)).T
    return float(np.polyfit(x, y, 1)[0])


def headlines(rows: Sequence[Row]) -> list[Row]:
    """One line a case: our run time at 1e-6, and how many times longer each rival takes.

    Parameters
    ----------
    rows : sequence of dict
        From `run_dynamics`.

    Returns
    -------
    list of dict
        Columns case, ours_us, error, then a factor a rival of `RIVALS` (None where it has none),
        and `exponent` of the cost over the unknowns.
    """
    lines = []
    for name in dict.fromkeys(row["case"] for row in rows):
        own = [row for row in rows if row["case"] == name]
        chosen = {row["method"]: row for row in own if row["at_target"]}
        ours = next((row for row in chosen.values() if row["times_ours"] == 1.0), None)
        line: Row = {"case": name, "ours_us": None, "error": None}
        if ours:
            line |= {"ours_us": 1e6 * ours["median_s"], "error": ours["error"]}
        line |= {key: chosen.get(method, {}).get("times_ours") for key, method in RIVALS.items()}
        exponents = (row["exponent"] for row in own if row["exponent"])
        lines.append(line | {"exponent": next(exponents, None)})
    return lines
