"""Contenders run in turn; rivals of `steady_state`, with the settings that meet an error.

Rivals are as strong as they can be made. The equation is dimensionless, z'' + 2 zeta z' + kappa(s)
z = 1 in s = w0 t. SciPy's odeint (quicker than its solve_ivp) and compiled Runge-Kutta of order
four with fixed steps both march three motions through one period and superpose them to the periodic
one, so that nothing has to die out. The first reads stiffness from a table of cubics made
beforehand, its right side is of plain Python numbers. The second, compiled by numba, is what a
hand-written loop can reach: its stiffness is read from tables at the begin, middle and end of every
step, so a jump between two steps costs no accuracy. Harmonic balance is solved by
scipy.linalg.solve_banded.
"""

from __future__ import annotations

import math
from array import array
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.benchmark.equations import Case, Lines, Motion, Reference, Samples, folded
from gearmon.benchmark.timing import Row, Timing, interleaved

#: Relative error at which methods are set side by side.
TARGET = 1e-6
OURS, SETS_AT_ONCE, CHART, FAMILY = "steady_state", "sweep", "stability_chart", "fault_family"
ODEINT, COMPILED, BANDED = "SciPy odeint", "compiled RK4", "solve_banded"
#: What others are compared with: the first row of these.
BASES = (SETS_AT_ONCE, OURS, CHART, FAMILY)
BYTES_ALLOWED = 1e9
Judge = Callable[[Any], Row]


@dataclass(frozen=True, eq=False)
class Contender:
    """One method with one setting.

    Parameters
    ----------
    method : str
        Name in tables and pictures.
    setting : str
        Tolerance, order, steps or harmonics, in words.
    wanted : float or None
        Relative error aimed at, where the setting was made for one.
    run : callable or None
        What is timed; None if it cannot run, for the reason in `note`.
    judge : callable
        Takes what `run` returned and gives the columns error, error_bound, unknowns or note, as
        far as they are known; not timed.
    note : str
    sets : int
        How many solutions one run makes.
    """

    method: str
    setting: str = ""
    wanted: float | None = None
    run: Callable[[], Any] | None = None
    judge: Judge = lambda _: {}
    note: str = ""
    sets: int = 1


def against(reference: Reference, motion: Callable[[Any], Motion] = lambda found: found) -> Judge:
    """Return what judges an answer, of which `motion` gives the motion, by an accurate motion."""

    def judge(found: Any) -> Row:
        own, bound = motion(found), getattr(found, "error_bound", math.inf)
        # an endless bound is no number in JSON
        row: Row = {"error_bound": bound if math.isfinite(bound) else None}
        return row | {"error": reference.error(own), "unknowns": len(own[0])}

    return judge


def measured(listed: Sequence[Contender], most: int, budget_s: float) -> list[Row]:
    """Run contenders in turn; one row each.

    Parameters
    ----------
    listed : sequence of Contender
    most : int
        Runs of each at most.
    budget_s : float
        Time for each [s].
    """
    tasks = {place: one.run for place, one in enumerate(listed) if one.run is not None}
    timed = dict(zip(tasks, interleaved(list(tasks.values()), most, budget_s), strict=True))
    return [_row(one, timed.get(place)) for place, one in enumerate(listed)]


def _row(one: Contender, timing: Timing | None) -> Row:
    row: Row = {"method": one.method, "setting": one.setting, "wanted": one.wanted}
    row |= dict.fromkeys(("error", "error_bound", "unknowns"))
    row |= {"sets": one.sets, "note": one.note, "median_s": None, "fastest_s": None}
    row |= {"repeats": 0, "exponent": None}
    if timing is None:
        return row
    each = timing.median_s / one.sets, timing.fastest_s / one.sets
    row |= {"median_s": each[0], "fastest_s": each[1], "repeats": timing.repeats}
    return row | one.judge(timing.result)


def with_ratios(rows: list[Row]) -> list[Row]:
    """Add the run time over ours, and mark each method's cheapest row at the target."""
    asked = [row for row in rows if row["wanted"] == TARGET]
    ours = next((row for row in asked if row["method"] in BASES and row["median_s"]), None)
    cheapest: dict[str, Row] = {}

    def judged(row: Row) -> bool:
        # of ours the row that a user gets who asks for this error, not one that is lucky
        told = row["median_s"] is not None and row["error"] is not None
        asked = row["method"] != OURS or row["wanted"] == TARGET
        return told and asked and bool(row["error"] <= TARGET)

    for row in sorted(filter(judged, rows), key=lambda row: float(row["median_s"])):
        cheapest.setdefault(row["method"], row)
    for row in rows:
        for name, column in (("times_ours", "median_s"), ("times_ours_fastest", "fastest_s")):
            row[name] = row[column] / ours[column] if ours and row[column] else None
        row["at_target"] = cheapest.get(row["method"]) is row
    return rows


@dataclass(frozen=True, eq=False)
class Rival:
    """A method with one setting to be tuned: the greater, the smaller its error.

    Parameters
    ----------
    method, words : str
        Its name, and the setting in words.
    settings : sequence of float
        What may be set, ascending.
    ready : callable
        Takes a setting and gives the task, with all made that may be made beforehand.
    note : str
        Why it cannot run.
    """

    method: str
    words: str
    settings: Sequence[float]
    ready: Callable[[float], Callable[[], Any]]
    note: str = ""

    def tuned(self, wanted: float, judge: Judge, sets: int = 1) -> Contender:
        """Return the contender with the least setting whose error is within `wanted`."""
        if self.note:
            return Contender(self.method, wanted=wanted, note=self.note, sets=sets)

        def within(setting: float) -> bool:
            return bool(judge(self.ready(setting)())["error"] <= wanted)

        setting = self.settings[bisect_left(self.settings[:-1], True, key=within)]
        words, task = self.words.format(setting), self.ready(setting)
        return Contender(self.method, words, wanted, task, judge, sets=sets)


def about(first: float, whole: int = 0) -> list[float]:
    """Return settings three per cent apart, from a twentieth of one to twenty times it.

    Parameters
    ----------
    first : float, > 0
        What a search begins with.
    whole : int
        Settings are multiples of this; 0: any number.
    """
    settings = first * 1.03 ** np.arange(-102.0, 103.0)
    found: list[float] = (
        np.unique(whole * np.ceil(settings / whole)) if whole else settings
    ).tolist()
    return found


Read = Callable[[float], float]


def table_of(case: Case) -> CubicHermiteSpline:
    """Kappa of a smooth case as cubics on equal pieces of the period, counted in these."""
    half, count = case.half, len(case.half) - 1
    # relative error of a cubic below 1e-9 times the variation, or what memory allows
    pieces = min(512 * count, max(128 * count, 200_000))
    lines = np.stack([half, 2j * math.pi * np.arange(len(half)) / pieces * half])
    value, slope = np.pad(np.fft.irfft(lines, pieces, norm="forward"), ((0, 0), (0, 1)), "wrap")
    return CubicHermiteSpline(np.arange(pieces + 1), value, slope, extrapolate="periodic")


def reader(table: CubicHermiteSpline, period: float) -> Read:
    """Return what reads a table at one time, as quickly as Python can."""
    powers: list[array[float]] = [array("d", column) for column in table.c]
    d, c, b, a = powers
    pieces, per_time = len(a), len(a) / period

    def at(time: float) -> float:
        place = time * per_time % pieces
        i = int(place)
        x = place - i
        # rounding can give the end of the period for a time just below zero
        return a[i] + x * (b[i] + x * (c[i] + x * d[i])) if i < pieces else a[0]

    return at


def shooter(case: Case, digits: float) -> Callable[[], Samples]:
    """Return what finds the periodic motion of a smooth case, to so many digits a step.

    odeint marches two free motions and a driven one through the period and gives them at 24 times
    a period of w0.
    """
    from scipy.integrate import odeint

    damping, period = 2 * case.problem.damping_ratio, 2 * math.pi * case.problem.frequency_ratio
    table = table_of(case)
    slope, start = _three_slopes(damping, reader(table, period)), (1.0, 0.0, 0.0, 1.0, 0.0, 0.0)
    time = np.linspace(0.0, period, max(2, math.ceil(12 * period / math.pi)) + 1)
    share, kappa = time[:-1] / period, table(time[:-1] * (table.x[-1] / period))
    known: dict[str, Any] = {"rtol": 10**-digits, "atol": 10 ** -(digits + 1), "tfirst": True}

    def shoot() -> Samples:
        *rows, end = odeint(slope, start, time, mxstep=10_000_000, **known)
        own = np.linalg.solve(np.eye(2) - end[:4].reshape(2, 2).T, end[4:])
        z, v = np.einsum("m,tmi->it", [*own, 1.0], np.reshape(rows, (-1, 3, 2)))
        return Samples(share, 1.0 - damping * v - kappa * z)

    return shoot


def _three_slopes(damping: float, at: Read) -> Callable[[float, FloatArray], list[float]]:
    """Right side of two free motions and a driven one, in plain numbers."""

    def slope(time: float, state: FloatArray) -> list[float]:
        a, u, b, w, z, v = state.tolist()
        k = at(time)
        free = u, -damping * u - k * a, w, -damping * w - k * b
        return [*free, v, 1.0 - damping * v - k * z]

    return slope


def banded_bytes(harmonics: int, highest: int) -> int:
    """Bytes of the band matrix with its fill for one solve."""
    return 16 * (2 * highest + 1) * (3 * min(harmonics, 2 * highest) + 1)


def band(harmonics: ComplexArray, highest: int) -> ComplexArray:
    """Band matrix of the stiffness alone, for harmonics -highest..highest."""
    kept = harmonics[: 2 * highest]
    width = len(kept)
    bands = np.zeros((2 * width + 1, 2 * highest + 1), dtype=np.complex128)
    bands[:width] = kept[::-1].conj()[:, None]
    bands[width + 1 :] = kept[:, None]
    return bands


def solve_band(bands: ComplexArray, ratio: float, zeta: float) -> Lines:
    """Harmonic balance by scipy.linalg.solve_banded; `bands` as `band` gives them.

    Parameters
    ----------
    bands : complex ndarray
        Left as it is.
    ratio, zeta : float
        w0/w and damping ratio.
    """
    from scipy.linalg import solve_banded

    width, size = len(bands) // 2, bands.shape[1]
    highest = size // 2
    matrix = bands.copy()
    x = np.arange(-highest, highest + 1) / ratio
    matrix[width] = (1 - x**2) + 2j * zeta * x
    right = np.zeros(size, dtype=np.complex128)
    right[highest] = 1.0
    solution = solve_banded(
        (width, width), matrix, right, overwrite_ab=True, overwrite_b=True, check_finite=False
    )
    return Lines(solution[highest:])


def numba_is_missing() -> str:
    """Return why nothing can be compiled; "" if it can."""
    return "" if find_spec("numba") else "numba is not installed"


#: Begin and length of steps through a period, in shares of it, and the stiffness at the begin, in
#: the middle and at the end of each; what jumps between two steps has two values.
Steps = tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]


def equal_steps(case: Case, count: int) -> Steps:
    """Return equal steps; of a rectangle their number is divisible by 4."""
    share, length = np.arange(count) / count, np.full(count, 1.0 / count)
    if case.rectangle is not None:
        level = case.level(share + 0.5 / count)
        return share, length, level, level, level
    both = folded(case.half, 2 * count)
    begin = both[::2].copy()
    return share, length, begin, both[1::2].copy(), np.roll(begin, -1)


def march_compiled(steps: Steps, ratio: float, zeta: float) -> Samples:
    """Return the periodic motion; `ratio` and `zeta` are w0/w and the damping ratio."""
    from gearmon.benchmark import compiled  # numba is slow to load

    share, *tables = steps
    return Samples(share, compiled.shoot(*tables, 2 * math.pi * ratio, 2 * zeta, 1.0)[1])
