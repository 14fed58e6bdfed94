"""Jobs of many solutions against compiled RK4: a stability chart, and the faults of a machine.

A chart is judged by the error of the growth a period, ln of the larger multiplier, at points drawn
from it, against collocation; compiled RK4 marches two motions through the period of every point, on
all cores.

A family is judged by the error of what a fault adds to the acceleration, against RK4 with finer
steps. RK4 takes every damaged tooth through a turn, begun in the static deflection so much earlier
that its free vibration has died out; its steps end at the corners of the stiffness, where it jumps,
and their number is tuned. Its run time is given with the stiffness read from tables made
beforehand, and with the making of the tables.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np

from gearmon.benchmark.equations import Case, Complex, Real, folded, pair, solve_reference
from gearmon.benchmark.rivals import (
    CHART,
    COMPILED,
    FAMILY,
    NOT_INSTALLED,
    TARGET,
    Contender,
    Row,
    least_within,
    measured,
    numba_is_installed,
    rk4_step,
    with_ratios,
)
from gearmon.dynamics.stability import FourierShape, stability_chart
from gearmon.machine import load_machine
from gearmon.signatures.expected.baseline import contact_grid
from gearmon.signatures.expected.contact_motion import fourier_sums
from gearmon.signatures.expected.fault_family import FamilyMember, fault_family
from gearmon.signatures.expected.mesh import MeshPlace, PosedStage

#: Shape, damping ratio, range of w/w0 and highest variation of the chart; points of it judged.
SHAPE, ZETA, SPEEDS, HIGHEST = FourierShape(np.array([0.5, 0.2, 0.1])), 0.02, (0.45, 2.6), 0.9
JUDGED = 300
#: Tolerance of half the trace with which the growth is within the target.
CHART_TOLERANCE = 1e-6
#: The published pair as a machine, and what is wrong with its teeth.
MACHINE = {
    "name": "published pair",
    "operating": {"speed_rpm": 1442.3, "torque_nm": 98.12},
    "stage": [
        {
            "kind": "parallel",
            "pinion_teeth": 26,
            "gear_teeth": 53,
            "module_mm": 2.0,
            "face_width_mm": 20.0,
            "damping_ratio": 0.07,
        }
    ],
}
KINDS = ("crack", "breakage", "pitting", "spall", "missing")
#: Every so many members are taken through RK4; share of a free vibration that is left.
TAKEN, LEFT = 15, 1e-9
#: Steps a panel of the reference.
FINEST = 800


def chart_rows(quick: bool = False) -> list[Row]:
    """Time a stability chart of 200 x 200 points; run times are told a chart.

    Parameters
    ----------
    quick : bool
        40 x 40 points, few repeats.
    """
    points, rng = 40 if quick else 200, np.random.default_rng(0)
    speeds, variations = np.linspace(*SPEEDS, points), np.linspace(0.0, HIGHEST, points)
    place = rng.integers(points, size=(2, JUDGED))
    x, eps = speeds[place[0]], variations[place[1]]
    exact = np.array([_growth(1 / own, e) for own, e in zip(x, eps, strict=True)])
    run = partial(stability_chart, SHAPE, speeds, variations, ZETA, CHART_TOLERANCE)

    def ours() -> float:
        return float(np.abs(run().growth[place[1], place[0]] - exact).max())

    def error_at(steps: float) -> float:
        found = _chart_by_rk4(1 / x[:, None], eps[:, None], int(steps))
        return float(np.abs(found[:, 0] - exact).max())

    known: dict[str, Any] = {"wanted": TARGET, "unknowns": points**2}
    setting = f"tolerance {CHART_TOLERANCE:.0e}"
    listed = [Contender(CHART, setting, run=run, error=ours(), **known)]
    if numba_is_installed():
        steps = least_within(TARGET, 300, error_at, 1)
        every = np.meshgrid(1 / speeds, variations)
        chart = partial(_chart_by_rk4, every[0], every[1], int(steps))
        setting = f"{steps:.0f} steps, all cores"
        listed.append(Contender(COMPILED, setting, run=chart, error=error_at(steps), **known))
    else:
        listed.append(Contender(COMPILED, note=NOT_INSTALLED, **known))
    return with_ratios(measured(listed, 3 if quick else 15, 0.1 if quick else 3.0))


def _growth(ratio: float, variation: float) -> float:
    """Natural logarithm of the larger multiplier of one point, by collocation."""
    problem = pair(variation * SHAPE.harmonics, zeta=ZETA, ratio=ratio)
    reference = solve_reference(Case(name="", problem=problem))
    return -2 * math.pi * ratio * reference.decay_rate


def _chart_by_rk4(ratios: Real, variations: Real, steps: int) -> Real:
    """Growth a period at every point, by `steps` steps of two motions."""
    values = folded(np.concatenate([[0.0 + 0j], SHAPE.harmonics]), 2 * steps)
    found = np.empty(ratios.shape)
    _kernels()[0](ratios, variations, ZETA, np.append(values, values[0]), found)
    return found


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
    # an estimate, where there is no RK4 to tell
    error = max(member.lines.error for member in family)
    listed = [Contender(FAMILY, "", TARGET, run, sets=len(family), error=error)]
    if numba_is_installed():

        def error_at(steps: float) -> float:
            return max(turn.error(turn.lines(int(steps))) for turn in turns)

        steps = least_within(TARGET, 200, error_at, 2)
        errors = [turn.error(turn.member.lines.acceleration) for turn in turns]
        listed[0] = replace(listed[0], error=max(errors))
        count, error = int(steps), error_at(steps)
        for method, tables in (COMPILED, True), (f"{COMPILED} and its tables", False):
            tasks = [turn.task(count, tables) for turn in turns]
            setting, march = f"{steps:.0f} steps a panel", partial(_one_by_one, tasks)
            listed.append(Contender(method, setting, TARGET, march, sets=len(turns), error=error))
    else:
        listed.append(Contender(COMPILED, wanted=TARGET, note=NOT_INSTALLED))
    return with_ratios(measured(listed, 2 if quick else 9, 0.1 if quick else 4.0))


def _one_by_one(tasks: list[Callable[[], Real]]) -> list[Real]:
    return [task() for task in tasks]


@dataclass(frozen=True, eq=False)
class _Turn:
    """A turn with one damaged tooth, for RK4."""

    member: FamilyMember

    @cached_property
    def posed(self) -> PosedStage:
        """The mesh with its damage."""
        return MeshPlace(load_machine(MACHINE), 1).alone([self.member.fault()])

    @cached_property
    def edges(self) -> Real:
        """Corners of the stiffness round the turn, and more panels between them."""
        own = contact_grid([self.posed], self.posed.limit_hz(None)).edges
        return np.concatenate([i + own[:-1] for i in range(self.posed.period)])

    def tables(self, steps: int) -> tuple[Real, Real, Real, Real]:
        """Lengths of the steps, and the stiffness at their begin, middle and end."""
        edges = np.append(self.edges, float(self.posed.period))
        h = np.repeat(np.diff(edges) / steps, steps)
        begin = edges[:-1].repeat(steps) + np.tile(np.arange(steps), len(edges) - 1) * h
        # just inside of each step: what jumps belongs to the next
        places = (begin + share * h for share in (1e-9, 0.5, 1 - 1e-9))
        stiffness = self.posed.mechanics.stiffness
        first, middle, last = (stiffness.at(place) * self.posed.scale for place in places)
        return h, first, middle, last

    def task(self, steps: int, are_made: bool) -> Callable[[], Real]:
        """Return the march, with its tables made beforehand or not."""
        known = self.tables(steps) if are_made else None
        return lambda: self._march(self.tables(steps) if known is None else known)

    def _march(self, tables: tuple[Real, Real, Real, Real]) -> Real:
        around, speeds = self.posed.around, np.empty(len(tables[0]))
        damping, force = float(around.damping[0, 0]), float(around.force[0])
        before = math.ceil(-2 * math.log(LEFT) / damping * len(speeds) / self.posed.period)
        start = force / float(tables[2].mean())
        _kernels()[1](*tables, damping, force, min(before, len(speeds)), start, speeds)
        return speeds

    @cached_property
    def exact(self) -> Complex:
        """Lines by many steps."""
        return self.lines(FINEST)

    def lines(self, steps: int) -> Complex:
        """Acceleration lines of the turn [m/s2], by Simpson's rule on every panel."""
        tables = self.tables(steps)
        h, speeds = tables[0], self._march(tables)
        weights = np.tile(np.where(np.arange(steps) % 2, 4.0, 2.0), len(h) // steps)
        weights[::steps] = 1.0
        weights *= h / 3
        weights[::steps] += np.roll(h, 1)[::steps] / 3
        turns = np.append(0.0, np.cumsum(h)[:-1]) / self.posed.period
        own = self.member.lines
        found = fourier_sums(turns, weights * speeds, int(own.number[-1]))[own.number - 1]
        rate = 2j * math.pi * own.number / self.posed.period
        # a derivative in mesh periods each, of lines over the turn
        return np.asarray(found * rate / self.posed.period * own.mechanics.mesh_frequency_hz**2)

    def error(self, lines: Complex) -> float:
        """Error of acceleration lines over what the fault adds to them."""
        exact, own = self.exact, self.member.lines
        sound = np.zeros(len(exact), dtype=complex)
        sound[own.period - 1 :: own.period] = self.member.sound.acceleration
        return float(np.linalg.norm(lines - exact) / np.linalg.norm(own.acceleration - sound))


@lru_cache(maxsize=1)
def _kernels() -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Compile the loops over the points of a chart, and over the steps of a turn."""
    from numba import njit, prange  # type: ignore[import-not-found,import-untyped,unused-ignore]

    move = rk4_step()

    @njit(fastmath=True, parallel=True)  # type: ignore[untyped-decorator,unused-ignore]
    def chart(ratios, variations, zeta, values, found):  # type: ignore[no-untyped-def]
        steps = (len(values) - 1) // 2
        for i in prange(ratios.shape[0]):
            for j in range(ratios.shape[1]):
                eps, h = variations[i, j], 2 * math.pi * ratios[i, j] / steps
                a, b, c, d = 1.0, 0.0, 0.0, 1.0
                for n in range(steps):
                    k1, k2 = 1 + eps * values[2 * n], 1 + eps * values[2 * n + 1]
                    k3 = 1 + eps * values[2 * n + 2]
                    a, b = move(a, b, 0.0, k1, k2, k3, 2 * zeta, h)
                    c, d = move(c, d, 0.0, k1, k2, k3, 2 * zeta, h)
                half, product = abs(a + d) / 2, a * d - b * c
                root = half * half - product
                found[i, j] = (
                    math.log(half + math.sqrt(root)) if root > 0 else math.log(product) / 2
                )

    @njit(fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
    def turn(h, begin, middle, end, damping, force, before, z, speeds):  # type: ignore[no-untyped-def]
        steps, v = len(h), 0.0
        for i in range(steps - before, steps):
            z, v = move(z, v, force, begin[i], middle[i], end[i], damping, h[i])
        for i in range(steps):
            speeds[i] = v
            z, v = move(z, v, force, begin[i], middle[i], end[i], damping, h[i])

    return chart, turn
