"""Methods for the steady vibration of a gear mesh: run time against error, and a stress test.

On named cases each method runs with several settings; the error is the relative L2 error of the
acceleration against an accurate motion that no method shares. At one error all are set side by
side. Rivals know more than a user would: their steps and tolerances are tuned on the accurate
motion, and they read stiffness from tables made beforehand. `steady_state` knows its tolerance
only, and its time contains its error bound.

The errors of a method over many parameter sets are the largest over sets drawn from them; steps and
harmonics of a rival grow with w0/w by one rule, whose factor is the least with which all those sets
are within the error. The growth of the cost is that with a stiffness that dips once in P mesh
periods, P growing; natural frequency, damping and harmonics a mesh stay, so the number of unknowns
grows in proportion.

Two jobs are of many solutions. A stability chart is judged by the error of the growth a period, ln
of the larger multiplier, at points drawn from it, against collocation; compiled RK4 marches two
motions through the period of every point, on all cores. The faults of a machine are judged by the
error of what a fault adds to the acceleration, against RK4 with finer steps, which end at the
corners of the stiffness, where it jumps.

The stress test holds `steady_state` on thousands of random systems against collocation in time.
They come up to nine tenths of the variation that makes them unstable. Drawn log-uniformly: damping
ratio 1e-3 to 3 and w0/w 0.1 to 50; uniformly: 1 to 64 stiffness harmonics with random phases and
sizes that fall with a random power of 0 to 2 of their number, and the share 0 to 0.9 of the
variation at which the system first turns unstable. A variation never exceeds twice the mean
stiffness: the spring may turn negative for part of the period.

Each answer is met (its bound and its true error are within the tolerance), refused (it says that it
misses the tolerance, or that the system is unstable), wrong silently, or its bound is broken: less
than the true error. Where the reference itself is known worse than a tenth of the tolerance, an
answer that claims to meet it is not judged.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.benchmark import equations, rivals, timing
from gearmon.benchmark.equations import CASES, Case, Motion, Reference, as_lines, solve_reference
from gearmon.benchmark.timing import Contender, Judge, Rival, Row, Task, about, against, measured
from gearmon.dynamics import HillProblem, Response, floquet, stability_chart, steady_state
from gearmon.dynamics.stability import FourierShape
from gearmon.dynamics.sweep import Sweep
from gearmon.dynamics.sweep import sweep as solve_sets
from gearmon.errors import ArgumentError, check_range
from gearmon.machine import Machine, OperatingPoint
from gearmon.signatures.expected.baseline import contact_grid
from gearmon.signatures.expected.contact_motion import fourier_sums
from gearmon.signatures.expected.fault_family import FamilyMember, fault_family
from gearmon.signatures.expected.mesh import MeshPlace, PosedStage
from gearmon.terminal import Progress, followed

#: Relative error at which methods are set side by side.
TARGET = 1e-6
OURS, SETS_AT_ONCE, CHART, FAMILY = "steady_state", "sweep", "stability_chart", "fault_family"
ODEINT, COMPILED, BANDED = "SciPy odeint", "compiled RK4", "solve_banded"
#: What others are compared with: the first row of these.
BASES = (SETS_AT_ONCE, OURS, CHART, FAMILY)
WANTED = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10)
#: Every rival by the column of its factor in the headlines.
RIVALS = {"odeint": ODEINT, "compiled": COMPILED, "solve_banded": BANDED}
SWEEP, GROWTH = "parameter sets", "cost growth"
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
#: Shape, damping ratio, range of w/w0 and highest variation of the chart; points of it judged.
SHAPE, ZETA, SPEEDS, HIGHEST = FourierShape(np.array([0.5, 0.2, 0.1])), 0.02, (0.45, 2.6), 0.9
JUDGED = 300
#: Tolerance of half the trace with which the growth is within the target.
CHART_TOLERANCE = 1e-6
#: The published pair as a machine, and what is wrong with its teeth.
MACHINE = Machine(
    name="published pair",
    operating=(OperatingPoint(speed_rpm=1442.3, torque_nm=98.12, share=1.0),),
    stages=(replace(equations.STAGE, damping_ratio=0.07),),
)
KINDS = ("crack", "breakage", "pitting", "spall", "missing")
#: Every so many members are taken through RK4; steps a panel of the reference.
TAKEN, FINEST = 15, 800


def run_dynamics(
    quick: bool = False, seed: int = 0, count: int = 10_000, progress: Progress | None = None
) -> list[Row]:
    """Time all methods on named cases, on many parameter sets, and over growing sizes.

    Parameters
    ----------
    quick : bool
        Few cases, settings and repeats: seconds in place of minutes. The figures are then rough.
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
    """
    jobs: dict[str, Callable[[bool], list[Row]]] = {
        **{name: partial(case_rows, CASES[name]) for name in (equations.QUICK if quick else CASES)},
        SWEEP: partial(sweep_rows, 200 if quick else count, seed),
        "stability chart": chart_rows,
        "fault family": family_rows,
        GROWTH: growth_rows,
    }
    steps = followed(jobs.items(), len(jobs), progress)
    return [{"case": name, **row} for name, job in steps for row in job(quick)]


def case_rows(made: Callable[[], Case], quick: bool = False) -> list[Row]:
    """Time all methods on one case; see `run_dynamics`.

    Parameters
    ----------
    made : callable
        Gives the case.
    quick : bool
        Two errors wanted, three repeats.
    """
    case, wanted = made(), (1e-3, TARGET) if quick else WANTED
    reference = solve_reference(case)
    judge = against(reference, as_lines)
    listed = [*(_for_rectangle(case, judge) if case.rectangle else _own(case, judge, wanted))]
    for rival in _rivals(case):
        # of a hunting period runs are long
        errors = (TARGET,) if rival.note or case.meshes > 100 else wanted
        listed += [rival.tuned(error, against(reference)) for error in errors]
    return with_ratios(measured(listed, 3 if quick else 31, 0.05 if quick else 0.6))


def with_ratios(rows: list[Row]) -> list[Row]:
    """Add the run time over ours, and mark each method's cheapest row at the target."""
    # the row that a user gets who asks for this error, or for none; not one that is lucky
    asked = [row for row in rows if row["median_s"] and row["wanted"] in (None, TARGET)]
    ours = next((row for row in asked if row["method"] in BASES), None)
    within = [row for row in asked if row["error"] is not None and row["error"] <= TARGET]
    falling = sorted(within, key=lambda row: float(row["median_s"]), reverse=True)
    cheapest = {row["method"]: row for row in falling}
    for row in rows:
        for name, column in (("times_ours", "median_s"), ("times_ours_fastest", "fastest_s")):
            row[name] = row[column] / ours[column] if ours and row[column] else None
        row["at_target"] = cheapest.get(row["method"]) is row
    return rows


def _own(case: Case, judge: Judge, wanted: tuple[float, ...]) -> Iterator[Contender]:
    p, long = case.problem, case.meshes > 100
    settings = {tolerance: f"tolerance {tolerance:.0e}" for tolerance in wanted}
    # the settings of a method follow each other, as those of a rival do: a run of microseconds
    # takes a third longer if another method has just emptied the caches of its code
    for tolerance, setting in settings.items():
        yield Contender(OURS, setting, tolerance, partial(steady_state, p, tolerance), judge)
    for tolerance, setting in () if long else settings.items():
        run = partial(steady_state, p, tolerance, "harmonic balance")
        yield Contender("harmonic balance", setting, tolerance, run, judge)
    # a tolerance of 1 keeps a fixed order from being judged more closely than by its residual
    for order in (1, 2, 3) if long else (1, 2, 3, 4, 6, 8):
        run, method = partial(steady_state, p, 1.0, "msm", order), "multiple scales, plain sum"
        yield Contender(method, f"order {order}", None, run, judge)
    for order in (2, 4, 8) if long else (1, 2, 3, 4, 6, 8, 12, 16):
        run = partial(steady_state, p, 1e-8, "msm least residual", order)
        yield Contender("multiple scales, least residual", f"order {order}", None, run, judge)


def _for_rectangle(case: Case, judge: Judge) -> Iterator[Contender]:
    """Fourier sums of growing length against the true rectangle."""
    note = "the error is that against the true jumps; a bound would be that of the sum"
    told = {"error_bound": None, "note": note}
    for count in (10, 30, 100, 300, 1000):
        kept = case.problem.stiffness_harmonics[:count]
        p, setting = replace(case.problem, stiffness_harmonics=kept), f"{count} stiffness harmonics"
        run, of_sum = partial(steady_state, p, TARGET), "steady_state of the Fourier sum"
        yield Contender(of_sum, setting, None, run, lambda own: judge(own) | told)


def _rivals(case: Case) -> Iterator[Rival]:
    """Yield the strong rivals of a case; of jumps only the one that can step between."""
    p, ratio, words = case.problem, case.problem.frequency_ratio, "{:.0f} steps a period"
    # multiples of four: the jumps of a rectangle fall between steps
    steps, ready = about(24 * ratio + 48, 4), partial(_compiled, case)
    yield Rival(COMPILED, words, steps, ready, rivals.NOT_COMPILED)
    if case.rectangle is None:
        digits = np.linspace(2.0, 13.0, 111).tolist()
        yield Rival(ODEINT, "{:.1f} digits a step", digits, partial(rivals.shooter, case))
        highest = math.ceil(ratio) + equations.MESH_HARMONICS
        needed = rivals.banded_bytes(len(p.stiffness_harmonics), highest)
        note = f"not run: the matrix needs over {needed / 1e9:.0f} GB"
        note = note if needed > rivals.BYTES_ALLOWED else ""
        yield Rival(BANDED, "{:.0f} harmonics", about(highest, 1), partial(_banded, p), note)


def _compiled(case: Case, steps: float) -> Task:
    return partial(rivals.march_compiled, rivals.equal_steps(case, int(steps)), *_of(case.problem))


def _banded(p: HillProblem, highest: float) -> Task:
    return partial(rivals.solve_band, rivals.band(p.stiffness_harmonics, int(highest)), *_of(p))


def _of(p: HillProblem) -> tuple[float, float]:
    return p.frequency_ratio, p.damping_ratio


def draw_sweep(count: int, seed: int) -> list[HillProblem]:
    """Draw parameter sets, log-uniformly in mass, damping and mean stiffness.

    Parameters
    ----------
    count : int, >= 1
    seed : int
    """
    ranges, harmonics = np.log(SWEPT), equations.square_wave(10)
    drawn = np.exp(np.random.default_rng(seed).uniform(ranges[:, :1], ranges[:, 1:], (3, count)))
    known = harmonics, equations.PERIOD_S, equations.FORCE_N
    return [HillProblem(m, c, k, *known) for m, c, k in drawn.T.tolist()]


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
    problems = draw_sweep(count, seed)
    known = [solve_reference(Case(problem=own)) for own in problems[: 6 if quick else PROBES]]
    # all sets have the period and the relative stiffness of this case
    case, many = Case(problem=problems[0]), problems[:MANY]
    bands = lru_cache(maxsize=64)(partial(rivals.band, case.problem.stiffness_harmonics))
    steps = lru_cache(maxsize=64)(partial(rivals.equal_steps, case))

    def error_of(motions: Iterable[Motion]) -> Row:
        return {"error": max(k.error(own) for k, own in zip(known, motions, strict=False))}

    def banded(p: HillProblem, factor: float) -> Task:
        highest = math.ceil(factor * (p.frequency_ratio + 10))
        return partial(rivals.solve_band, bands(highest), *_of(p))

    def compiled(p: HillProblem, factor: float) -> Task:
        count = 4 * math.ceil(factor * (p.frequency_ratio + 3) / 4)
        return partial(rivals.march_compiled, steps(count), *_of(p))

    def ready(of: Callable[[HillProblem, float], Task], factor: float) -> Task:
        return partial(_one_by_one, [of(p, factor) for p in many])

    loop, note = "in a loop, {:.2f} (w0/w + ", rivals.NOT_COMPILED
    listed = [
        Rival(BANDED, loop + "10) harmonics", about(1.0), partial(ready, banded)),
        Rival(COMPILED, loop + "3) steps a period", about(30.0), partial(ready, compiled), note),
    ]
    loops = [rival.tuned(TARGET, error_of, len(many)) for rival in listed]
    own = [_together(problems, known), _own_loop(problems[:FEW], error_of)]
    return with_ratios(measured([*own, *loops], 2 if quick else 9, 0.1 if quick else 3.0))


def _one_by_one(tasks: Sequence[Task]) -> list[Any]:
    return [task() for task in tasks]


def _together(problems: Sequence[HillProblem], known: Sequence[Reference]) -> Contender:
    """All sets at once, nothing kept from an earlier call."""
    columns = [(p.mass_kg, p.damping_ns_per_m, p.stiffness_n_per_m) for p in problems]
    common = problems[0].stiffness_harmonics, equations.PERIOD_S, equations.FORCE_N
    mass, damping, stiffness = np.array(columns).T
    run = partial(solve_sets, mass, damping, stiffness, *common, tolerance=TARGET)

    def judge(found: Sweep) -> Row:
        met, refused = np.flatnonzero(found.met).tolist(), int((~found.met).sum())
        errors = [known[i].error(as_lines(found.response(i))) for i in met if i < len(known)]
        bound = max(found.error_bound[found.met].tolist(), default=None)
        row = {"error": max(errors, default=None), "error_bound": bound}
        return row | {"note": f"{refused} sets refused" if refused else ""}

    return Contender(SETS_AT_ONCE, "all at once", TARGET, run, judge, sets=len(problems))


def _own_loop(problems: Sequence[HillProblem], error_of: Judge) -> Contender:
    def judge(found: Sequence[Response]) -> Row:
        return error_of(map(as_lines, found)) | {"error_bound": max(r.error_bound for r in found)}

    run = partial(_one_by_one, [partial(steady_state, p, TARGET) for p in problems])
    return Contender(OURS, "in a loop", TARGET, run, judge, sets=len(problems))


def growth_rows(quick: bool = False) -> list[Row]:
    """Time `steady_state` and solve_banded on the same harmonics over growing periods.

    Parameters
    ----------
    quick : bool
        Three small sizes.
    """
    rows: list[Row] = []
    for meshes in QUICK_MESHES if quick else MESHES:
        timed = measured(list(_of_size(meshes)), 3 if quick else 15, 0.05 if quick else 2.0)
        rows += with_ratios(timed)
    for method in (OURS, BANDED):
        own = [row for row in rows if row["method"] == method]
        exponent = fitted_exponent(own)
        for row in own:
            row["exponent"] = exponent
    return rows


def _of_size(meshes: int) -> Iterator[Contender]:
    p, setting = equations.growing_turn(meshes), f"{meshes} meshes"
    run = partial(steady_state, p, TARGET)
    found = run()
    row: Row = {"unknowns": len(found.displacement)}
    yield Contender(OURS, setting, TARGET, run, lambda _: row | {"error_bound": found.error_bound})
    if rivals.banded_bytes(len(p.stiffness_harmonics), row["unknowns"]) < GROWING_BYTES:
        yield Contender(BANDED, setting, None, _banded(p, row["unknowns"] - 1), lambda _: row)


def fitted_exponent(rows: Sequence[Row]) -> float | None:
    """Exponent p of median_s ~ unknowns^p, or None with fewer than three rows to fit.

    Examples
    --------
    >>> rows = [{"unknowns": n, "median_s": 1e-6 * n**1.5} for n in (3000, 9000, 30000)]
    >>> round(fitted_exponent(rows), 6)
    1.5
    """
    kept = [(row["unknowns"], row["median_s"]) for row in rows if row["unknowns"] >= FIRST_FITTED]
    if len(kept) < 3:
        return None
    x, y = np.log(np.array(kept)).T
    return float(np.polyfit(x, y, 1)[0])


def chart_rows(quick: bool = False) -> list[Row]:
    """Time a stability chart of 200 x 200 points; run times are told a chart.

    Parameters
    ----------
    quick : bool
        40 x 40 points, few repeats.
    """
    points, rng = 40 if quick else 200, np.random.default_rng(0)
    speeds, variations = np.linspace(*SPEEDS, points), np.linspace(0.0, HIGHEST, points)
    row, column = rng.integers(points, size=(2, JUDGED))
    drawn = zip(1 / speeds[row], variations[column], strict=True)
    exact = np.array([_growth(*point) for point in drawn])

    def judge(growth: FloatArray) -> Row:
        error = float(np.abs(growth[column, row] - exact).max())
        return {"error": error, "unknowns": points**2}

    run = partial(stability_chart, SHAPE, speeds, variations, ZETA, CHART_TOLERANCE)
    words, ready = "{:.0f} steps, all cores", partial(_chart, *np.meshgrid(1 / speeds, variations))
    rival = Rival(COMPILED, words, about(300, 1), ready, rivals.NOT_COMPILED)
    setting = f"tolerance {CHART_TOLERANCE:.0e}"
    own = Contender(CHART, setting, TARGET, run, lambda found: judge(found.growth))
    listed = [own, rival.tuned(TARGET, judge)]
    return with_ratios(measured(listed, 3 if quick else 15, 0.1 if quick else 3.0))


def _growth(ratio: float, variation: float) -> float:
    """Natural logarithm of the larger multiplier of one point, by collocation."""
    problem = equations.pair(variation * SHAPE.harmonics, zeta=ZETA, ratio=ratio)
    return -2 * math.pi * ratio * solve_reference(Case(problem=problem)).decay_rate


def _chart(ratios: FloatArray, variations: FloatArray, steps: float) -> Task:
    """Growth a period at every point, by so many steps of two motions."""
    values = equations.folded(np.concatenate([[0.0 + 0j], SHAPE.harmonics]), 2 * int(steps))
    return partial(rivals.growth, ratios, variations, ZETA, np.append(values, values[0]))


def family_rows(quick: bool = False) -> list[Row]:
    """Time every kind and size of damage of both gears of a pair; run times are told a member.

    Parameters
    ----------
    quick : bool
        Few members and repeats.
    """
    run = partial(fault_family, MACHINE, KINDS[:1] if quick else KINDS, tolerance=TARGET)
    family = run()
    turns = [_Turn(member) for member in family.members[::TAKEN]]

    def from_tables(steps: float) -> Task:
        return partial(_one_by_one, [turn.marched(int(steps)) for turn in turns])

    def judge(marched: list[tuple[FloatArray, FloatArray]]) -> Row:
        pairs = zip(turns, marched, strict=True)
        return {"error": max(turn.error(turn.lines(*own)) for turn, own in pairs)}

    note, words = rivals.NOT_COMPILED, "{:.0f} steps a panel"
    with_tables = f"{COMPILED} and its tables"
    ways = {COMPILED: from_tables, with_tables: lambda steps: lambda: from_tables(steps)()}
    # an estimate, where there is no RK4 to tell
    errors = [t.member.lines.error if note else t.error(t.member.lines.acceleration) for t in turns]
    known = {"error": max(errors)}
    listed = [Contender(FAMILY, "", TARGET, run, lambda _: known, sets=len(family))]
    for name, ready in ways.items():
        rival = Rival(name, words, about(200, 2), ready, note)
        listed.append(rival.tuned(TARGET, judge, len(turns)))
    return with_ratios(measured(listed, 2 if quick else 9, 0.1 if quick else 4.0))


@dataclass(frozen=True, eq=False)
class _Turn:
    """A turn with one damaged tooth, for RK4."""

    member: FamilyMember

    @cached_property
    def posed(self) -> PosedStage:
        """The mesh with its damage."""
        return MeshPlace(MACHINE, 1).alone([self.member.fault()])

    @cached_property
    def edges(self) -> FloatArray:
        """Corners of the stiffness round the turn, and more panels between them."""
        own = contact_grid([self.posed], self.posed.limit_hz(None)).edges[:-1]
        return np.append(np.add.outer(np.arange(self.posed.period), own), float(self.posed.period))

    def marched(self, steps: int) -> Task:
        """Return the march with its tables made; it gives lengths of the steps and velocities."""
        h = np.repeat(np.diff(self.edges) / steps, steps)
        begin = self.edges[:-1].repeat(steps) + np.tile(np.arange(steps), len(self.edges) - 1) * h
        # just inside of each step: what jumps belongs to the next
        places = [begin + share * h for share in (1e-9, 0.5, 1 - 1e-9)]
        own, mass = self.posed.mechanics, self.posed.mechanics.equivalent_mass_kg
        tables = [own.stiffness.at(place) / mass for place in places]
        known = *tables, 1 / own.mesh_frequency_hz, own.damping_ns_per_m / mass, own.force_n / mass
        return lambda: (h, rivals.shoot(h, *known)[0])

    def lines(self, h: FloatArray, velocity: FloatArray) -> ComplexArray:
        """Acceleration lines of the turn [m/s2], by Simpson's rule on every panel."""
        panels = len(self.edges) - 1
        weights = np.tile(np.where(np.arange(len(h) // panels) % 2, 4.0, 2.0), (panels, 1))
        weights *= h.reshape(panels, -1) / 3
        # the begin of a panel is the end of the one before
        weights[:, 0] = (h.reshape(panels, -1)[:, 0] + np.roll(h.reshape(panels, -1)[:, 0], 1)) / 3
        own, period = self.member.lines, self.posed.period
        turns = np.append(0.0, np.cumsum(h)[:-1]) / period
        found = fourier_sums(turns, weights.ravel() * velocity, int(own.number[-1]))[own.number - 1]
        # of velocities the sum over mesh periods, of the turn P of them
        return np.asarray(found / period * 2j * math.pi * own.frequency_hz)

    @cached_property
    def exact(self) -> ComplexArray:
        """Lines by many steps."""
        return self.lines(*self.marched(FINEST)())

    def error(self, lines: ComplexArray) -> float:
        """Error of acceleration lines over what the fault adds to them."""
        own = self.member.lines
        sound = np.zeros(len(lines), dtype=complex)
        sound[own.period - 1 :: own.period] = self.member.sound.acceleration
        return float(np.linalg.norm(lines - self.exact) / np.linalg.norm(own.acceleration - sound))


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


OUTCOMES = ("met", "refused", "wrong_silently", "bound_broken", "not_judged", "crashed")

RATIOS, ZETAS, MOST_HARMONICS, MOST_SHARE = (0.1, 50.0), (1e-3, 3.0), 64, 0.9
LARGEST_VARIATION = 2.0
#: The limit is wanted to half a percent.
TRACE_TOLERANCE = 1e-5
TOLERANCES = (1e-6, 1e-10)
QUICK = 40
#: An error is known to ten per cent where it is so many times what the reference may be wrong by.
KNOWN = 10


def draw_system(rng: np.random.Generator) -> tuple[HillProblem, float, float]:
    """Draw one system.

    Parameters
    ----------
    rng : numpy.random.Generator

    Returns
    -------
    (HillProblem, float, float)
        With the largest absolute value of its variation, and the variation at which it turns
        unstable, or 2.
    """
    ratio, zeta = np.exp(rng.uniform(*np.log([RATIOS, ZETAS]).T)).tolist()
    count = int(rng.integers(1, MOST_HARMONICS + 1))
    shape = rng.normal(size=count) + 1j * rng.normal(size=count)
    shape /= np.arange(1, count + 1) ** rng.uniform(0.0, 2.0)
    values = np.fft.irfft(np.append(0j, shape), 16 * count, norm="forward")
    shape /= np.abs(values).max()
    limit = instability_limit(ratio, zeta, shape)
    variation = float(rng.uniform(0.0, MOST_SHARE)) * limit
    return equations.pair(variation * shape, zeta=zeta, ratio=ratio), variation, limit


def instability_limit(ratio: float, zeta: float, shape: ComplexArray) -> float:
    """Smallest variation, to half a percent, that makes a free vibration grow; at most 2.

    Parameters
    ----------
    ratio, zeta : float
        w0/w and damping ratio.
    shape : complex ndarray, shape (J,)
        Stiffness harmonics of a variation of 1.

    Examples
    --------
    >>> import numpy as np                 # 2 w0 = w: unstable above 4 zeta, nearly
    >>> bool(abs(instability_limit(0.5, 0.05, np.array([0.5 + 0j])) / 0.2 - 1) < 0.03)
    True
    """
    low, high, points = 1e-3 * LARGEST_VARIATION, LARGEST_VARIATION, 28
    # it only draws systems; whether one is stable is judged by the reference
    while high > 1.005 * low:
        grid = np.geomspace(low, high, points)
        growing = floquet.growth_of(ratio, grid, zeta, shape, TRACE_TOLERANCE) > 0
        # with the largest variation it may be stable still
        first = int(np.argmax(np.append(growing[:-1], True)))
        low, high, points = grid[max(0, first - 1)], grid[first], 8
    return float(low)


def run_stress(
    count: int = 5000, seed: int = 0, quick: bool = False, progress: Progress | None = None
) -> list[Row]:
    """Judge `steady_state` on random systems.

    Parameters
    ----------
    count : int, >= 1
        Number of systems; drawn as told above.
    seed : int
    quick : bool
        40 systems at most.
    progress : callable, optional
        Called with the share done, 0 to 1.

    Returns
    -------
    list of dict
        One row a system and tolerance: the system, the outcome ("met", "refused", "wrong silently",
        "bound broken", "not judged", "crashed"), the reason of a refusal, true error and bound.

    Raises
    ------
    ArgumentError
        If `count` is out of its range.
    """
    check_range("count", count, 1, 10_000_000)
    if quick:
        count = min(count, QUICK)
    rng = np.random.default_rng(seed)
    return [
        {"system": number, **row}
        for number in followed(range(count), count, progress)
        for row in judged(*draw_system(rng))
    ]


def judged(p: HillProblem, variation: float, limit: float) -> list[Row]:
    """Judge the answers for one system, to every tolerance; the system as `draw_system` gives it.

    Parameters
    ----------
    p : HillProblem
    variation, limit : float
    """
    reference, doubt = equations.reference_and_doubt(p)
    facts: Row = {
        "ratio": p.frequency_ratio,
        "zeta": p.damping_ratio,
        "harmonics": len(p.stiffness_harmonics),
        "variation": variation,
        "share_of_limit": variation / limit,
        "log_multiplier": -reference.decay_rate * 2 * math.pi * p.frequency_ratio,
        "reference_uncertainty": doubt,
    }
    return [facts | _verdict(p, reference, tolerance, facts) for tolerance in TOLERANCES]


def _verdict(problem: HillProblem, reference: Reference, tolerance: float, facts: Row) -> Row:
    doubt = facts["reference_uncertainty"]
    row: Row = {"tolerance": tolerance, "outcome": "crashed", "reason": "", "method": ""}
    row |= dict.fromkeys(("order", "error", "error_bound", "bound_over_error", "run_time_s"))
    try:
        elapsed, response = timing.task_time(partial(steady_state, problem, tolerance))
    except ArgumentError as refusal:
        return row | {"outcome": "refused", "reason": str(refusal)}
    except (ArithmeticError, ValueError, np.linalg.LinAlgError) as crash:
        return row | {"reason": f"{type(crash).__name__}: {crash}"}
    error, bound = reference.error(as_lines(response)), response.error_bound
    outcome, reason = _outcome(response, error, tolerance, doubt, facts["log_multiplier"])
    row |= {"outcome": outcome, "reason": reason, "error": error, "run_time_s": elapsed}
    row |= {"method": response.method, "order": response.order}
    if math.isfinite(bound):  # an endless bound is no number in JSON
        known = error > KNOWN * doubt
        row |= {"error_bound": bound, "bound_over_error": bound / error if known else None}
    return row


def _outcome(
    response: Response, error: float, tolerance: float, uncertainty: float, rate: float
) -> tuple[str, str]:
    if response.error_bound < error - 2 * uncertainty:
        return "bound broken", response.message
    if response.stable is False:
        # the judge's multiplier is good to some digits only
        return "refused", "unstable" if rate > -1e-6 else "called unstable, but is stable"
    if response.error_bound > tolerance:
        if math.isinf(response.error_bound):
            return "refused", "no bound"
        return "refused", "bound too wide" if error <= tolerance else "not accurate enough"
    if uncertainty > 0.1 * tolerance:
        return "not judged", "the reference is too uncertain"
    return ("met", "") if error <= tolerance else ("wrong silently", "")


def stress_summary(rows: Sequence[Row]) -> list[Row]:
    """One line a tolerance: outcomes, refusals, and how the bounds compare with the errors.

    Parameters
    ----------
    rows : sequence of dict
        From `run_stress`.
    """
    tolerances = dict.fromkeys(row["tolerance"] for row in rows)
    return [_summary(own, [row for row in rows if row["tolerance"] == own]) for own in tolerances]


def _summary(tolerance: float, rows: list[Row]) -> Row:
    outcomes = Counter(row["outcome"].replace(" ", "_") for row in rows)
    stable = [row for row in rows if row["log_multiplier"] < 0]
    refused = [row for row in stable if row["outcome"] == "refused"]
    reasons = Counter(row["reason"] for row in refused)
    ratios = [row["bound_over_error"] for row in rows if row["bound_over_error"]]
    least, median, most = np.quantile(ratios, (0, 0.5, 0.95)).tolist() if ratios else 3 * [None]
    errors_met = (row["error"] for row in rows if row["outcome"] == "met")
    run_times = [row["run_time_s"] for row in rows if row["run_time_s"]]
    return {
        "tolerance": tolerance,
        "systems": len(rows),
        **{name: outcomes[name] for name in OUTCOMES},
        "refused_of_stable_percent": 100 * len(refused) / max(1, len(stable)),
        "reasons": "; ".join(f"{reason}: {n}" for reason, n in reasons.most_common()),
        "least_bound_over_error": least,
        "median_bound_over_error": median,
        "p95_bound_over_error": most,
        "largest_error_met": max(errors_met, default=None),
        "worst_uncertainty": max(row["reference_uncertainty"] for row in rows),
        "median_run_time_s": float(np.median(run_times)) if run_times else None,
    }
