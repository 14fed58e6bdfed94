"""Many parameter sets of one mesh stiffness: run time a set.

Mass, damping and mean stiffness are drawn over the ranges of the published study; the relative
stiffness harmonics are the same for all. The error of a method is the largest over sets drawn from
them, against an accurate motion of each. Steps and harmonics of a rival grow with w0/w by one rule,
whose factor is the least with which all those sets are within the error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from gearmon.benchmark import compiled, rivals
from gearmon.benchmark.collocation import Lines, Reference, Samples, solve_reference
from gearmon.benchmark.contenders import NOT_INSTALLED, OURS, TARGET, as_lines
from gearmon.benchmark.dynamics_cases import (
    FORCE_N,
    PERIOD_S,
    Case,
    square_wave,
)
from gearmon.benchmark.timing import Timing, interleaved
from gearmon.dynamics import HillProblem, steady_state
from gearmon.dynamics.sweep import sweep as solve_sets

Row = dict[str, Any]
MASS_KG = (0.2, 3.0)
DAMPING_NS_PER_M = (3e3, 9e4)
STIFFNESS_N_PER_M = (4e8, 1.6e9)
SETS_AT_ONCE = "sweep"
PROBES = 48
#: Sets that a loop of a slow method is timed on, and of a quicker one.
FEW, MANY = 300, 2000


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
        return max(
            reference.error(motion_of(self.problems[i]))
            for i, reference in zip(self.probes, self.references, strict=True)
        )


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
    ranges = np.log([MASS_KG, DAMPING_NS_PER_M, STIFFNESS_N_PER_M])
    drawn = np.exp(rng.uniform(ranges[:, :1], ranges[:, 1:], (3, count)))
    harmonics = square_wave(10)
    problems = tuple(
        HillProblem(m, c, k, harmonics, PERIOD_S, FORCE_N) for m, c, k in drawn.T.tolist()
    )
    chosen = rng.choice(count, min(probes, count), replace=False).tolist()
    references = tuple(
        solve_reference(Case(name="set", title="one set", problem=problems[i])) for i in chosen
    )
    return Sweep(problems=problems, probes=tuple(chosen), references=references)


@dataclass(frozen=True, kw_only=True, eq=False)
class Loop:
    """A method over some of the sets.

    Parameters
    ----------
    method, group, setting : str
    sets : int
        How many it is timed on.
    error : float
    run : callable or None
    note : str
    """

    method: str
    group: str
    setting: str = ""
    sets: int = 0
    error: float | None = None
    error_bound: float | None = None
    run: Callable[[], Any] | None = None
    note: str = ""


def sweep_rows(count: int, seed: int, quick: bool = False) -> list[Row]:
    """Time all methods over the same sets.

    Parameters
    ----------
    count : int, >= 1
        Number of sets. Loops over single solutions are timed on the first of them only, and run
        times are told a set.
    seed : int
    quick : bool
        Few sets and repeats.
    """
    sweep = draw_sweep(count, seed, 6 if quick else PROBES)
    loops = [*_own(sweep), *_banded(sweep), *_compiled(sweep)]
    running = [loop for loop in loops if loop.run is not None]
    timings = interleaved(
        [loop.run for loop in running if loop.run is not None],
        most=2 if quick else 9,
        budget_s=0.1 if quick else 3.0,
    )
    timed = dict(zip(map(id, running), timings, strict=True))
    return [_row(loop, timed.get(id(loop))) for loop in loops]


def _row(loop: Loop, timing: Timing | None) -> Row:
    return {
        "method": loop.method,
        "group": loop.group,
        "setting": loop.setting,
        "wanted": TARGET,
        "error": loop.error,
        "error_bound": loop.error_bound,
        "median_s": timing.median_s / loop.sets if timing else None,
        "fastest_s": timing.fastest_s / loop.sets if timing else None,
        "repeats": timing.repeats if timing else 0,
        "unknowns": None,
        "sets": loop.sets,
        "exponent": None,
        "note": loop.note,
    }


def _own(sweep: Sweep) -> Iterator[Loop]:
    few = sweep.problems[:FEW]
    yield _together(sweep)
    found = {i: steady_state(sweep.problems[i], TARGET) for i in sweep.probes}
    yield Loop(
        method=OURS,
        group="gearmon",
        setting="in a loop",
        sets=len(few),
        error=sweep.largest_error(lambda p: as_lines(found[sweep.problems.index(p)])),
        error_bound=max(response.error_bound for response in found.values()),
        run=lambda: [steady_state(p, TARGET) for p in few],
    )


def _together(sweep: Sweep) -> Loop:
    """All sets at once, nothing kept from an earlier call."""
    mass, damping, stiffness = np.array(
        [(p.mass_kg, p.damping_ns_per_m, p.stiffness_n_per_m) for p in sweep.problems]
    ).T
    harmonics = sweep.problems[0].stiffness_harmonics
    run = partial(
        solve_sets, mass, damping, stiffness, harmonics, PERIOD_S, FORCE_N, tolerance=TARGET
    )
    found = run()
    refused = int((~found.met).sum())
    errors = [
        reference.error(as_lines(found.response(i)))
        for i, reference in zip(sweep.probes, sweep.references, strict=True)
        if found.met[i]
    ]
    return Loop(
        method=SETS_AT_ONCE,
        group="gearmon",
        setting="all at once",
        sets=len(sweep.problems),
        error=max(errors, default=None),
        error_bound=float(found.error_bound[found.met].max()) if found.met.any() else None,
        run=run,
        note=f"{refused} sets refused" if refused else "",
    )


def _banded(sweep: Sweep) -> Iterator[Loop]:
    harmonics = sweep.problems[0].stiffness_harmonics

    def highest(p: HillProblem, factor: float) -> int:
        return math.ceil(factor * (p.frequency_ratio + 10))

    def one(p: HillProblem, factor: float) -> Lines:
        bands = rivals.band(harmonics, highest(p, factor))
        return rivals.solve_band(bands, p.frequency_ratio, p.damping_ratio)

    factor = _least_factor(1.0, lambda f: sweep.largest_error(partial(one, factor=f)))
    some = sweep.problems[:MANY]
    sizes = [highest(p, factor) for p in some]
    bands = {size: rivals.band(harmonics, size) for size in set(sizes)}
    chosen = [
        (bands[size], p.frequency_ratio, p.damping_ratio)
        for p, size in zip(some, sizes, strict=True)
    ]
    yield Loop(
        method="solve_banded",
        group="banded",
        setting=f"in a loop, {factor:.2f} (w0/w + 10) harmonics",
        sets=len(some),
        error=sweep.largest_error(partial(one, factor=factor)),
        run=lambda: [rivals.solve_band(*each) for each in chosen],
    )


def _compiled(sweep: Sweep) -> Iterator[Loop]:
    names = {True: "compiled RK4 from rest", False: "compiled RK4, shooting"}
    if not compiled.is_installed():
        for name in names.values():
            yield Loop(method=name, group="compiled", note=NOT_INSTALLED)
        return
    some = sweep.problems[:MANY]
    # all sets have the period and the relative stiffness of this case
    case = Case(name="set", title="one set", problem=some[0])
    for rest, name in names.items():
        kept: dict[int, compiled.Tables] = {}

        def one(
            p: HillProblem,
            factor: float,
            rest: bool = rest,
            kept: dict[int, compiled.Tables] = kept,
        ) -> Samples:
            steps = 4 * math.ceil(factor * (p.frequency_ratio + 3) / 4)
            if steps not in kept:
                kept[steps] = compiled.tables(case, steps)
            ratio, zeta = p.frequency_ratio, p.damping_ratio
            if not rest:
                return compiled.shoot(kept[steps], ratio, zeta)
            return compiled.march(kept[steps], ratio, zeta, _settling(zeta))

        def error_at(factor: float, one: Callable[..., Samples] = one) -> float:
            return sweep.largest_error(partial(one, factor=factor))

        factor = _least_factor(30.0, error_at)
        yield Loop(
            method=name,
            group="compiled",
            setting=f"in a loop, {factor:.0f} (w0/w + 3) steps a period",
            sets=len(some),
            error=error_at(factor),
            run=partial(_all, one, some, factor),
        )


def _all(
    one: Callable[[HillProblem, float], Samples], problems: Sequence[HillProblem], factor: float
) -> list[Samples]:
    return [one(p, factor) for p in problems]


def _settling(zeta: float) -> float:
    """Time for the slowest free vibration to fall by 3e7 with the mean stiffness [1/w0]."""
    rate = zeta if zeta < 1 else zeta - math.sqrt(zeta**2 - 1)
    return math.log(3e7) / rate


def _least_factor(first: float, error_at: Callable[[float], float]) -> float:
    """Least factor, to 3 %, with which every probe is within the target."""
    low, high = 0.0, first
    while error_at(high) > TARGET and high < 1e4 * first:
        low, high = high, 1.5 * high
    low = max(low, 0.3 * high)
    while high / low > 1.03:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if error_at(middle) > TARGET else (low, middle)
    return high
