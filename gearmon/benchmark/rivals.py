"""Contenders run in turn; rivals of `steady_state`, with the settings that meet an error.

Rivals are as strong as they can be made. The equation is dimensionless, z'' + 2 zeta z' + kappa(s)
z = 1 in s = w0 t. SciPy's integrators read stiffness from a table of cubics made beforehand, right
sides are plain Python numbers, dense output is off, and integration restarts where stiffness jumps;
it begins at rest in the static deflection and ends one period after the free vibration has decayed
to the wanted error, whose time is told. Runge-Kutta of order four with fixed steps, compiled by
numba, is what a hand-written loop can reach: its stiffness is read from tables at the begin, middle
and end of every step, so a jump between two steps costs no accuracy; it begins at rest or shoots,
whichever is quicker. Harmonic balance is solved by scipy.linalg.solve_banded.
"""

from __future__ import annotations

import itertools
import math
from array import array
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from importlib.util import find_spec
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicHermiteSpline

from gearmon.benchmark.equations import Case, Complex, Lines, Real, Reference, Samples, folded
from gearmon.benchmark.timing import Timing, interleaved

Row = dict[str, Any]

#: Relative error at which methods are set side by side.
TARGET = 1e-6
OURS, SETS_AT_ONCE, COMPILED = "steady_state", "sweep", "compiled RK4"
CHART, FAMILY = "stability_chart", "fault_family"
#: What others are compared with: the first of these that a case has.
BASES = (SETS_AT_ONCE, OURS, CHART, FAMILY)
CUT_OFF = "the error is that against the true jumps; a bound would be that of the sum"
NOT_INSTALLED = "numba is not installed"


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
    motion: Callable[[Any], Lines | Samples] = lambda found: found
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
    at_target = {row["method"]: row for row in rows if row["wanted"] == TARGET}
    ours = next((at_target[name] for name in BASES if name in at_target), None)
    cheapest: dict[str, Row] = {}
    # of ours the row that a user gets who asks for this error, not one that is lucky
    judged = [
        row
        for row in rows
        if row["median_s"] is not None
        and row["error"] is not None
        and row["error"] <= TARGET
        and (row["method"] != OURS or row["wanted"] == TARGET)
    ]
    for row in sorted(judged, key=lambda row: float(row["median_s"])):
        cheapest.setdefault(row["method"], row)

    def over_ours(row: Row, column: str) -> float | None:
        return row[column] / ours[column] if ours and ours[column] and row[column] else None

    return [
        row
        | {
            "times_ours": over_ours(row, "median_s"),
            "times_ours_fastest": over_ours(row, "fastest_s"),
            "at_target": cheapest.get(row["method"]) is row,
        }
        for row in rows
    ]


SHOT, ODEINT = "DOP853", "odeint"
SOLVERS = (SHOT, ODEINT)
BYTES_ALLOWED = 1e9
#: Beyond so many steps, harmonics or inverse tolerances a search ends.
LARGEST_SETTING = 1e14
Slope = Callable[[float, Real], list[float]]


@dataclass(frozen=True, eq=False)
class Oscillator:
    """What a time integrator needs of a case.

    Parameters
    ----------
    case : Case
        Its stiffness is tabled on first use.
    """

    case: Case

    @property
    def zeta(self) -> float:
        """Damping ratio."""
        return self.case.problem.damping_ratio

    @property
    def ratio(self) -> float:
        """w0/w."""
        return self.case.problem.frequency_ratio

    @property
    def period(self) -> float:
        """Period in units of 1/w0."""
        return 2 * math.pi * self.ratio

    @cached_property
    def table(self) -> CubicHermiteSpline:
        """Kappa of a smooth case as cubics on equal pieces of the period, counted in these."""
        harmonics = self.case.problem.stiffness_harmonics
        # relative error of a cubic below 1e-9 times the variation, or what memory allows
        pieces = min(512 * len(harmonics), max(128 * len(harmonics), 200_000))
        half = np.concatenate([[1.0 + 0j], harmonics])
        lines = np.stack([half, 2j * math.pi * np.arange(len(half)) / pieces * half])
        value, slope = np.pad(np.fft.irfft(lines, pieces, norm="forward"), ((0, 0), (0, 1)), "wrap")
        return CubicHermiteSpline(np.arange(pieces + 1), value, slope, extrapolate="periodic")

    @cached_property
    def stiffness(self) -> Callable[[float], float]:
        """Kappa at one time, as quickly as Python reads it."""
        powers: list[array[float]] = [array("d", column) for column in self.table.c]
        d, c, b, a = powers
        pieces, per_time = len(a), len(a) / self.period

        def at(time: float) -> float:
            place = time * per_time % pieces
            i = int(place)
            x = place - i
            # rounding can give the end of the period for a time just below zero
            return a[i] + x * (b[i] + x * (c[i] + x * d[i])) if i < pieces else a[0]

        return at

    def stiffness_at(self, time: Real) -> Real:
        """Kappa at many times, of a smooth case."""
        return np.asarray(self.table(time * (self.table.x[-1] / self.period)))

    def stretches(self, begin: float, end: float) -> Iterator[tuple[float, float, float | None]]:
        """Yield times between jumps with their kappa, one stretch of a smooth case."""
        if self.case.rectangle is None:
            yield begin, end, None
            return
        quarter = self.period / 4
        first, last = math.floor(begin / quarter), math.ceil(end / quarter)
        jumps = [k for k in range(first + 1, last) if k % 2]  # at T/4 and 3T/4
        edges = [begin, *(k * quarter for k in jumps), end]
        for left, right in itertools.pairwise(edges):
            if right > left:
                share = 0.5 * (left + right) / self.period % 1.0
                yield left, right, float(self.case.relative_stiffness(share))

    def slope(self, kappa: float | None) -> Slope:
        """Right side for (z, z')."""
        damping = 2 * self.zeta
        if kappa is None:
            at = self.stiffness

            def changing(time: float, state: Real) -> list[float]:
                z, v = state.tolist()
                return [v, 1.0 - damping * v - at(time) * z]

            return changing

        def constant(_time: float, state: Real) -> list[float]:
            z, v = state.tolist()
            return [v, 1.0 - damping * v - kappa * z]

        return constant


class PlainOscillator(Oscillator):
    """The same with its stiffness as a sum in NumPy, as it is usually written."""

    @cached_property
    def stiffness(self) -> Callable[[float], float]:
        """Kappa at one time."""
        doubled = 2 * self.case.problem.stiffness_harmonics
        turns = 1j * np.arange(1, len(doubled) + 1) / self.ratio
        return lambda time: 1.0 + float((np.exp(turns * time) @ doubled).real)


def integrate(
    oscillator: Oscillator,
    solver: str,
    tolerance: float,
    state: npt.ArrayLike = (1.0, 0.0),
    settling: float = 0.0,
) -> Samples:
    """Integrate from `state` at -settling to the end of the period, and keep the period.

    Parameters
    ----------
    oscillator : Oscillator
    solver : str
        One of `SOLVERS`: of solve_ivp, or "odeint".
    tolerance : float
        Relative tolerance a step.
    state : array-like, shape (2,)
        z and z' to begin with.
    settling : float
        Time before the period begins [1/w0].

    Returns
    -------
    Samples
        Of the last period, at the solver's own steps.
    """
    slope, begin = oscillator.slope, np.asarray(state, dtype=float)
    time, (z, v), kappa, _ = _marched(oscillator, solver, tolerance, slope, begin, -settling)
    return Samples(time / oscillator.period, 1.0 - 2 * oscillator.zeta * v - kappa * z)


def shoot(oscillator: Oscillator, tolerance: float) -> Samples:
    """Find the periodic state from one period of three motions by DOP853, and superpose them.

    Parameters
    ----------
    oscillator : Oscillator
    tolerance : float
        Relative tolerance a step.
    """
    begin, slope = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0]), partial(_three_slopes, oscillator)
    time, y, kappa, end = _marched(oscillator, SHOT, tolerance, slope, begin, 0.0)
    period_map = np.array([[end[0], end[2]], [end[1], end[3]]])
    a, b = np.linalg.solve(np.eye(2) - period_map, end[4:])
    z, v = a * y[0] + b * y[2] + y[4], a * y[1] + b * y[3] + y[5]
    return Samples(time / oscillator.period, 1.0 - 2 * oscillator.zeta * v - kappa * z)


def _marched(
    oscillator: Oscillator,
    solver: str,
    tolerance: float,
    slope: Callable[[float | None], Slope],
    state: Real,
    begin: float,
) -> tuple[Real, Real, Real, Real]:
    """Return times of the period, states and kappa there, and the state at its end."""
    times, states, stiffnesses = [], [], []
    for left, right, kappa in oscillator.stretches(begin, oscillator.period):
        time, found = _solved(solver, tolerance, slope(kappa), state, (left, right))
        state = found[:, -1]
        # the end of a stretch is the begin of the next, which has another acceleration
        kept = (time >= 0) & (time < right * (1 - 1e-12))
        times.append(time[kept])
        states.append(found[:, kept])
        constant = None if kappa is None else np.full(int(kept.sum()), kappa)
        stiffnesses.append(oscillator.stiffness_at(times[-1]) if constant is None else constant)
    return (
        np.concatenate(times),
        np.concatenate(states, axis=1),
        np.concatenate(stiffnesses),
        state,
    )


def _solved(
    solver: str, tolerance: float, slope: Slope, state: Real, span: tuple[float, float]
) -> tuple[Real, Real]:
    """Return times and states by solve_ivp at its own steps; by odeint 24 times a period of w0."""
    from scipy.integrate import odeint, solve_ivp

    known: dict[str, Any] = {"rtol": tolerance, "atol": 0.1 * tolerance}
    if solver != ODEINT:
        found = solve_ivp(slope, span, state, method=solver, **known)
        return found.t, found.y
    left, right = span
    from_zero = max(left, 0.0)
    points = max(2, math.ceil(24 * (right - from_zero) / (2 * math.pi))) if right > 0 else 0
    wanted = np.linspace(from_zero, right, points + 1) if points else np.array([right])
    time = np.concatenate([np.array([left]) if wanted[0] > left else np.zeros(0), wanted])
    return time, odeint(slope, state, time, tfirst=True, mxstep=10_000_000, **known).T


def _three_slopes(oscillator: Oscillator, kappa: float | None) -> Slope:
    damping, at = 2 * oscillator.zeta, oscillator.stiffness

    def slope(time: float, state: Real) -> list[float]:
        z1, v1, z2, v2, z, v = state.tolist()
        k = at(time) if kappa is None else kappa
        return [
            v1,
            -damping * v1 - k * z1,
            v2,
            -damping * v2 - k * z2,
            v,
            1.0 - damping * v - k * z,
        ]

    return slope


def banded_bytes(harmonics: int, highest: int) -> int:
    """Bytes of the band matrix with its fill for one solve."""
    return 16 * (2 * highest + 1) * (3 * min(harmonics, 2 * highest) + 1)


def band(harmonics: Complex, highest: int) -> Complex:
    """Band matrix of the stiffness alone, for harmonics -highest..highest."""
    kept = harmonics[: 2 * highest]
    width = len(kept)
    bands = np.zeros((2 * width + 1, 2 * highest + 1), dtype=np.complex128)
    bands[:width] = kept[::-1].conj()[:, None]
    bands[width + 1 :] = kept[:, None]
    return bands


def solve_band(bands: Complex, ratio: float, zeta: float) -> Lines:
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


def numba_is_installed() -> bool:
    """Whether numba can be imported."""
    return find_spec("numba") is not None


@dataclass(frozen=True, eq=False)
class Tables:
    """Relative stiffness at begin, middle and end of `steps` equal steps of the period."""

    begin: Real
    middle: Real
    end: Real

    @property
    def steps(self) -> int:
        """Steps in the period."""
        return len(self.begin)


def tables(case: Case, steps: int) -> Tables:
    """Return the stiffness of a case at its steps; of a rectangle `steps` is divisible by 4."""
    if case.rectangle is not None:
        level = case.relative_stiffness((np.arange(steps) + 0.5) / steps)
        return Tables(level, level, level)
    half = np.concatenate([[1.0 + 0j], case.problem.stiffness_harmonics])
    both = folded(half, 2 * steps)
    begin = both[::2].copy()
    return Tables(begin, both[1::2].copy(), np.roll(begin, -1))


def march_compiled(table: Tables, ratio: float, zeta: float, settling: float) -> Samples:
    """Take fixed steps to the periodic motion, the quicker of the two ways, and keep the period.

    Either from the static deflection until the free vibration has decayed, or from one period of
    three motions to the periodic state.

    Parameters
    ----------
    table : Tables
    ratio, zeta : float
        w0/w and damping ratio.
    settling : float
        Time that a start from the static deflection needs [1/w0].
    """
    step = 2 * math.pi * ratio / table.steps
    before, out = math.ceil(settling / step), np.empty(table.steps)
    from_rest, shooting = _kernels()
    known = table.begin, table.middle, table.end, zeta, step
    if 1 + before / table.steps < shooting_periods():
        from_rest(*known, before, 1.0, 0.0, out)
    else:
        shooting(*known, out)
    return Samples(_shares(table.steps), out)


@lru_cache(maxsize=1)
def shooting_periods() -> float:
    """Return how many periods of one motion take as long as compiled shooting, measured here."""
    from_rest, shooting = _kernels()
    level, out = np.ones(20_000), np.empty(20_000)
    known = level, level, level, 0.1, 1e-3
    tasks = partial(from_rest, *known, 0, 1.0, 0.0, out), partial(shooting, *known, out)
    one, shot = interleaved(tasks, 5)
    return shot.fastest_s / one.fastest_s


@lru_cache(maxsize=64)
def _shares(steps: int) -> Real:
    return np.arange(steps) / steps


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
def _kernels() -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Compile both loops over the steps of a period."""
    from numba import njit  # type: ignore[import-not-found,import-untyped,unused-ignore]

    move = rk4_step()

    @njit(fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
    def from_rest(begin, middle, end, zeta, h, before, z, v, out):  # type: ignore[no-untyped-def]
        steps, damping = len(begin), 2 * zeta
        i = (-before) % steps
        for _ in range(before):
            z, v = move(z, v, 1.0, begin[i], middle[i], end[i], damping, h)
            i += 1
            if i == steps:
                i = 0
        for i in range(steps):
            out[i] = 1.0 - damping * v - begin[i] * z
            z, v = move(z, v, 1.0, begin[i], middle[i], end[i], damping, h)

    @njit(fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
    def shooting(begin, middle, end, zeta, h, out):  # type: ignore[no-untyped-def]
        steps, damping = len(begin), 2 * zeta
        a, b, c, d, z, v = 1.0, 0.0, 0.0, 1.0, 0.0, 0.0
        for i in range(steps):
            a, b = move(a, b, 0.0, begin[i], middle[i], end[i], damping, h)
            c, d = move(c, d, 0.0, begin[i], middle[i], end[i], damping, h)
            z, v = move(z, v, 1.0, begin[i], middle[i], end[i], damping, h)
            if i % 256 == 255 and abs(a) + abs(b) + abs(c) + abs(d) < 1e-40:
                # numbers below the smallest normal one would slow every step down
                a = b = c = d = 0.0
        scale = (1 - a) * (1 - d) - b * c
        z, v = ((1 - d) * z + c * v) / scale, (b * z + (1 - a) * v) / scale
        for i in range(steps):
            out[i] = 1.0 - damping * v - begin[i] * z
            z, v = move(z, v, 1.0, begin[i], middle[i], end[i], damping, h)

    return from_rest, shooting


def least_within(
    wanted: float,
    first: float,
    error_at: Callable[[float], float],
    whole: int = 0,
    factor: float = 1.4,
    fineness: float = 0.03,
) -> float:
    """Least setting, to a share of it, whose error is within `wanted`.

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
    factor : float, > 1
        By which the setting grows or shrinks until it is bracketed.
    fineness : float
        Share of the setting to which it is found.
    """

    def allowed(setting: float) -> float:
        return whole * math.ceil(setting / whole) if whole else setting

    low, high = 0.0, allowed(first)
    while error_at(high) > wanted and high < LARGEST_SETTING:
        low, high = high, allowed(factor * high)
    while low == 0.0 and (less := max(whole, min(allowed(high / factor), high - whole))) < high:
        low, high = (less, high) if error_at(less) > wanted else (low, less)
    while high - low > max(whole, fineness * high):
        middle = allowed(math.sqrt(low * high))
        if middle >= high:
            break
        low, high = (middle, high) if error_at(middle) > wanted else (low, middle)
    return high


def tolerance_within(wanted: float, run: Callable[[float], Samples], reference: Reference) -> float:
    """Loosest tolerance of a solver, to a third, whose error is within `wanted`."""

    def error_at(inverse: float) -> float:
        return reference.error(run(1 / inverse))

    return 1 / least_within(wanted, 3 / wanted, error_at, factor=4.0, fineness=0.34)
