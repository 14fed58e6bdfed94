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
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
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
CUT_OFF = "the error is that against the true jumps; a bound would be that of the sum"
BYTES_ALLOWED = 1e9
#: Beyond so many steps or harmonics a search ends.
LARGEST_SETTING = 1e14


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
    motion : callable
        Takes what `run` returned and gives what its error is measured on; not timed.
    note : str
    sets : int
        How many solutions one run makes.
    error, error_bound, unknowns : float, float, int or None
        Where they are known before the run.
    """

    method: str
    setting: str = ""
    wanted: float | None = None
    run: Callable[[], Any] | None = None
    motion: Callable[[Any], Motion] = lambda found: found
    note: str = ""
    sets: int = 1
    error: float | None = None
    error_bound: float | None = None
    unknowns: int | None = None


def measured(
    listed: Sequence[Contender], most: int, budget_s: float, reference: Reference | None = None
) -> list[Row]:
    """Run contenders in turn; one row each, with the errors against a reference if there is one.

    Parameters
    ----------
    listed : sequence of Contender
    most : int
        Runs of each at most.
    budget_s : float
        Time for each [s].
    reference : Reference, optional
    """
    running = [one for one in listed if one.run is not None]
    timings = interleaved([one.run for one in running if one.run is not None], most, budget_s)
    timed = dict(zip(map(id, running), timings, strict=True))
    return [_row(one, timed.get(id(one)), reference) for one in listed]


def _row(one: Contender, timing: Timing | None, reference: Reference | None) -> Row:
    known = ("method", "setting", "wanted", "error", "error_bound", "unknowns", "sets", "note")
    row: Row = {name: getattr(one, name) for name in known}
    row |= {
        "median_s": timing.median_s / one.sets if timing else None,
        "fastest_s": timing.fastest_s / one.sets if timing else None,
        "repeats": timing.repeats if timing else 0,
        "exponent": None,
    }
    if timing is None or reference is None:
        return row
    motion = one.motion(timing.result)
    values = motion.displacement if isinstance(motion, Lines) else motion.share
    bound = getattr(timing.result, "error_bound", None)
    if one.note == CUT_OFF or bound is None or math.isinf(bound):
        bound = None  # an endless bound is no number in JSON
    return row | {"error": reference.error(motion), "error_bound": bound, "unknowns": len(values)}


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
    first, whole : float, int
        Setting to begin with; settings are multiples of `whole`, of 0 any number.
    ready : callable
        Takes a setting and gives the task, with all made that may be made beforehand.
    note : str
        Why it cannot run.
    """

    method: str
    words: str
    first: float
    whole: int
    ready: Callable[[float], Callable[[], Any]]
    note: str = ""

    def tuned(self, wanted: float, error_of: Callable[[Any], float], **known: Any) -> Contender:
        """Return the contender with the least setting whose error is within `wanted`."""
        if self.note:
            return Contender(self.method, wanted=wanted, note=self.note, **known)
        setting = least_within(wanted, self.first, lambda n: error_of(self.ready(n)()), self.whole)
        task, words = self.ready(setting), self.words.format(setting)
        return Contender(self.method, words, wanted, task, error=error_of(task()), **known)


def least_within(
    wanted: float, first: float, error_at: Callable[[float], float], whole: int = 0
) -> float:
    """Least setting, to three per cent of it, whose error is within `wanted`.

    Parameters
    ----------
    wanted : float
        Relative error.
    first : float, > 0
        Setting to begin with.
    error_at : callable
        Error at a setting; falls as the setting grows.
    whole : int
        Settings are multiples of this; 0: any number.
    """

    def allowed(setting: float) -> float:
        return whole * math.ceil(setting / whole) if whole else setting

    low, high = 0.0, allowed(first)
    while error_at(high) > wanted and high < LARGEST_SETTING:
        low, high = high, allowed(1.4 * high)
    while low == 0.0 and (less := max(whole, min(allowed(high / 1.4), high - whole))) < high:
        low, high = (less, high) if error_at(less) > wanted else (low, less)
    while high - low > max(whole, 0.03 * high):
        middle = allowed(math.sqrt(low * high))
        if middle >= high:
            break
        low, high = (middle, high) if error_at(middle) > wanted else (low, middle)
    return high


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


@dataclass(frozen=True, eq=False)
class Steps:
    """Steps through a period.

    Attributes
    ----------
    length : ndarray
        Of every step.
    begin, middle, end : ndarray
        Stiffness there; what jumps between two steps has two values.
    """

    length: FloatArray
    begin: FloatArray
    middle: FloatArray
    end: FloatArray


def equal_steps(case: Case, count: int) -> Steps:
    """Return equal steps [shares of the period]; of a rectangle their number is divisible by 4."""
    length = np.full(count, 1.0 / count)
    if case.rectangle is not None:
        level = case.level((np.arange(count) + 0.5) / count)
        return Steps(length, level, level, level)
    both = folded(case.half, 2 * count)
    begin = both[::2].copy()
    return Steps(length, begin, both[1::2].copy(), np.roll(begin, -1))


def march_compiled(steps: Steps, ratio: float, zeta: float) -> Samples:
    """Return the periodic motion; `ratio` and `zeta` are w0/w and the damping ratio."""
    known = steps.length, steps.begin, steps.middle, steps.end
    _, out = shooting()(*known, 2 * math.pi * ratio, 2 * zeta, 1.0)
    return Samples(_shares(len(out)), out)


@lru_cache(maxsize=64)
def _shares(count: int) -> FloatArray:
    return np.arange(count) / count


@lru_cache(maxsize=1)
def rk4_step() -> Callable[..., Any]:
    """Compile one step of a motion; it is written out, so that nothing is called within."""
    from numba import njit  # type: ignore[import-not-found,import-untyped,unused-ignore]

    @njit(fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
    def move(z, v, force, k1, k2, k3, damping, h):  # type: ignore[no-untyped-def]
        a1 = force - damping * v - k1 * z
        v2 = v + 0.5 * h * a1
        a2 = force - damping * v2 - k2 * (z + 0.5 * h * v)
        v3 = v + 0.5 * h * a2
        a3 = force - damping * v3 - k2 * (z + 0.5 * h * v2)
        v4 = v + h * a3
        a4 = force - damping * v4 - k3 * (z + h * v3)
        sixth = h / 6
        return z + sixth * (v + 2 * (v2 + v3) + v4), v + sixth * (a1 + 2 * (a2 + a3) + a4)

    return move  # type: ignore[no-any-return,unused-ignore]


@lru_cache(maxsize=1)
def shooting() -> Callable[..., tuple[FloatArray, FloatArray]]:
    """Compile the loop over steps; it gives velocity and acceleration at the begin of each."""
    from numba import njit  # type: ignore[import-not-found,import-untyped,unused-ignore]

    move = rk4_step()

    @njit(fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
    def shoot(length, begin, middle, end, unit, damping, force):  # type: ignore[no-untyped-def]
        count = len(begin)
        kept, velocity, acceleration = np.empty((count, 6)), np.empty(count), np.empty(count)
        a, b, c, d, z, v = 1.0, 0.0, 0.0, 1.0, 0.0, 0.0
        for i in range(count):
            h, k1, k2, k3 = unit * length[i], begin[i], middle[i], end[i]
            row = kept[i]
            row[0], row[1], row[2], row[3], row[4], row[5] = a, b, c, d, z, v
            a, b = move(a, b, 0.0, k1, k2, k3, damping, h)
            c, d = move(c, d, 0.0, k1, k2, k3, damping, h)
            z, v = move(z, v, force, k1, k2, k3, damping, h)
            if i % 256 == 255 and abs(a) + abs(b) + abs(c) + abs(d) < 1e-40:
                # numbers below the smallest normal one would slow every step down
                a = b = c = d = 0.0
        scale = (1 - a) * (1 - d) - b * c
        one, two = ((1 - d) * z + c * v) / scale, (b * z + (1 - a) * v) / scale
        for i in range(count):
            row = kept[i]
            velocity[i] = one * row[1] + two * row[3] + row[5]
            deflection = one * row[0] + two * row[2] + row[4]
            acceleration[i] = force - damping * velocity[i] - begin[i] * deflection
        return velocity, acceleration

    return shoot  # type: ignore[no-any-return,unused-ignore]


@lru_cache(maxsize=1)
def chart() -> Callable[..., FloatArray]:
    """Compile the loop over the points of a chart; it gives the growth a period of each."""
    from numba import njit, prange  # type: ignore[import-not-found,import-untyped,unused-ignore]

    move = rk4_step()

    @njit(fastmath=True, parallel=True)  # type: ignore[untyped-decorator,unused-ignore]
    def growth(ratios, variations, zeta, values):  # type: ignore[no-untyped-def]
        steps, found = (len(values) - 1) // 2, np.empty(ratios.shape)
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
                if root > 0:
                    found[i, j] = math.log(half + math.sqrt(root))
                else:
                    found[i, j] = math.log(product) / 2
        return found

    return growth  # type: ignore[no-any-return,unused-ignore]
