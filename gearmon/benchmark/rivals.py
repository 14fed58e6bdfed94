"""Rivals of `steady_state`, as strong as they can be made, with the settings that meet an error.

The equation is dimensionless, z'' + 2 zeta z' + kappa(s) z = 1 in s = w0 t. SciPy's integrators
read stiffness from a table of cubics made beforehand, right sides are plain Python numbers, dense
output is off, and integration restarts where stiffness jumps; it begins at rest in the static
deflection and ends one period after the free vibration has decayed to the wanted error, whose time
is told. Runge-Kutta of order four with fixed steps, compiled by numba, is what a hand-written loop
can reach: its stiffness is read from tables at the begin, middle and end of every step, so a jump
between two steps costs no accuracy. Harmonic balance is solved by scipy.linalg.solve_banded.
"""

from __future__ import annotations

import itertools
import math
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from importlib.util import find_spec
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.benchmark.equations import Case, Complex
from gearmon.benchmark.references import Lines, Real, Reference, Samples, folded
from gearmon.benchmark.timing import task_time

SOLVERS = ("RK45", "DOP853", "LSODA", "Radau")
ODEINT = "odeint"
BYTES_ALLOWED = 1e9
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
    def cubics(self) -> tuple[Real, Real, Real, Real]:
        """Kappa on equal pieces of the period as a + x (b + x (c + x d)), 0 <= x < 1."""
        harmonics = self.case.problem.stiffness_harmonics
        # relative error of a cubic below 1e-9 times the variation, or what memory allows
        pieces = min(512 * len(harmonics), max(128 * len(harmonics), 200_000))
        half = np.concatenate([[1.0 + 0j], harmonics])
        value = np.fft.irfft(half, pieces, norm="forward")
        turn = 2j * math.pi * np.arange(len(half)) / pieces
        slope = np.fft.irfft(turn * half, pieces, norm="forward")
        rise, end = np.roll(value, -1) - value, np.roll(slope, -1)
        return value, slope, 3 * rise - 2 * slope - end, slope + end - 2 * rise

    @cached_property
    def stiffness(self) -> Callable[[float], float]:
        """Kappa at one time, as quickly as Python reads it."""
        a, b, c, d = (array("d", column) for column in self.cubics)
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
        pieces = len(self.cubics[0])
        place = (time * (pieces / self.period)) % pieces
        i = np.minimum(place.astype(int), pieces - 1)
        x = place - i
        a, b, c, d = (column[i] for column in self.cubics)
        return np.asarray(a + x * (b + x * (c + x * d)))

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

    def jacobian(self, kappa: float | None) -> Callable[[float, Real], Real]:
        """Jacobian for implicit solvers."""

        def of(time: float, _state: Real) -> Real:
            stiffness = self.stiffness(time) if kappa is None else kappa
            return np.array([[0.0, 1.0], [-stiffness, -2 * self.zeta]])

        return of


class PlainOscillator(Oscillator):
    """The same with its stiffness as a sum in NumPy, as it is usually written."""

    def slope(self, kappa: float | None) -> Slope:
        """Right side for (z, z')."""
        if kappa is not None:
            return super().slope(kappa)
        damping, doubled = 2 * self.zeta, 2 * self.case.problem.stiffness_harmonics
        turns = 1j * np.arange(1, len(doubled) + 1) / self.ratio

        def changing(time: float, state: Real) -> list[float]:
            k = 1.0 + (np.exp(turns * time) @ doubled).real
            return [state[1], 1.0 - damping * state[1] - k * state[0]]

        return changing


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
        One of `SOLVERS`, or "odeint".
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
    times, motions, stiffnesses = [], [], []
    for left, right, kappa in oscillator.stretches(-settling, oscillator.period):
        span, begin = (left, right), np.asarray(state)
        if solver == ODEINT:
            time, motion = _with_odeint(oscillator, tolerance, begin, span, kappa)
        else:
            time, motion = _with_solve_ivp(oscillator, solver, tolerance, begin, span, kappa)
        state = motion[:, -1]
        # the end of a stretch is the begin of the next, which has another acceleration
        kept = (time >= 0) & (time < right * (1 - 1e-12))
        times.append(time[kept])
        motions.append(motion[:, kept])
        constant = None if kappa is None else np.full(int(kept.sum()), kappa)
        stiffnesses.append(oscillator.stiffness_at(times[-1]) if constant is None else constant)
    time, (z, v) = np.concatenate(times), np.concatenate(motions, axis=1)
    acceleration = 1.0 - 2 * oscillator.zeta * v - np.concatenate(stiffnesses) * z
    return Samples(time / oscillator.period, acceleration)


def _with_solve_ivp(
    oscillator: Oscillator,
    solver: str,
    tolerance: float,
    state: Real,
    span: tuple[float, float],
    kappa: float | None,
) -> tuple[Real, Real]:
    from scipy.integrate import solve_ivp

    options: dict[str, Any] = {}
    if solver in ("Radau", "LSODA"):
        options["jac"] = oscillator.jacobian(kappa)
    found = solve_ivp(
        oscillator.slope(kappa),
        span,
        state,
        method=solver,
        rtol=tolerance,
        atol=0.1 * tolerance,
        **options,
    )
    return found.t, found.y


def _with_odeint(
    oscillator: Oscillator,
    tolerance: float,
    state: Real,
    span: tuple[float, float],
    kappa: float | None,
) -> tuple[Real, Real]:
    """LSODA driven by compiled code, read at 24 points a natural period."""
    from scipy.integrate import odeint

    left, right = span
    from_zero = max(left, 0.0)
    points = max(2, math.ceil(24 * (right - from_zero) / (2 * math.pi))) if right > 0 else 0
    wanted = np.linspace(from_zero, right, points + 1) if points else np.array([right])
    before = np.array([left]) if wanted[0] > left else np.zeros(0)
    time = np.concatenate([before, wanted])
    motion = odeint(
        oscillator.slope(kappa),
        state,
        time,
        rtol=tolerance,
        atol=0.1 * tolerance,
        tfirst=True,
        mxstep=10_000_000,
    ).T
    return time, motion


def shoot(oscillator: Oscillator, tolerance: float) -> Samples:
    """Find the periodic state from one period of three motions, and superpose them.

    Parameters
    ----------
    oscillator : Oscillator
    tolerance : float
        Of DOP853 a step.
    """
    from scipy.integrate import solve_ivp

    times, motions, stiffnesses = [], [], []
    state = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    for left, right, kappa in oscillator.stretches(0.0, oscillator.period):
        found = solve_ivp(
            _three_slopes(oscillator, kappa),
            (left, right),
            state,
            method="DOP853",
            rtol=tolerance,
            atol=0.1 * tolerance,
        )
        state = found.y[:, -1]
        times.append(found.t[:-1])
        motions.append(found.y[:, :-1])
        constant = None if kappa is None else np.full(len(times[-1]), kappa)
        stiffnesses.append(oscillator.stiffness_at(times[-1]) if constant is None else constant)
    period_map = np.array([[state[0], state[2]], [state[1], state[3]]])
    a, b = np.linalg.solve(np.eye(2) - period_map, state[4:])
    y = np.concatenate(motions, axis=1)
    z, v = a * y[0] + b * y[2] + y[4], a * y[1] + b * y[3] + y[5]
    acceleration = 1.0 - 2 * oscillator.zeta * v - np.concatenate(stiffnesses) * z
    return Samples(np.concatenate(times) / oscillator.period, acceleration)


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


def march(
    table: Tables,
    ratio: float,
    zeta: float,
    settling: float = 0.0,
    state: tuple[float, float] = (1.0, 0.0),
) -> Samples:
    """Integrate from `state` at -settling to the end of the period, and keep the period.

    Parameters
    ----------
    table : Tables
    ratio, zeta : float
        w0/w and damping ratio.
    settling : float
        Time before the period begins [1/w0].
    state : tuple of two floats
        z and z' to begin with.
    """
    step = 2 * math.pi * ratio / table.steps
    before = math.ceil(settling / step)
    out = np.empty(table.steps)
    _kernels()[0](table.begin, table.middle, table.end, zeta, step, before, *state, out)
    return Samples(_shares(table.steps), out)


def shoot_compiled(table: Tables, ratio: float, zeta: float) -> Samples:
    """Find the periodic state from one period of three motions, then march once more."""
    step = 2 * math.pi * ratio / table.steps
    out = np.empty(table.steps)
    _kernels()[1](table.begin, table.middle, table.end, zeta, step, out)
    return Samples(_shares(table.steps), out)


@lru_cache(maxsize=64)
def _shares(steps: int) -> Real:
    return np.arange(steps) / steps


@lru_cache(maxsize=1)
def _kernels() -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Compile both loops; the step is written out, so that nothing is called within."""
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


#: Share of the wanted error that may be left of the free vibration.
SETTLED_SHARE = 0.3
#: A trial that takes longer is not followed by a finer one [s].
LONGEST_TRIAL_S = 1.5
#: Beyond so many steps or harmonics the search ends.
LARGEST_SETTING = 1e6


@dataclass(frozen=True, kw_only=True, eq=False)
class ToleranceMap:
    """Errors of one solver over its tolerances, started on the periodic motion.

    Parameters
    ----------
    tolerances, errors, times_s : tuple of float
        From loose to tight; run times are those of one period.
    """

    tolerances: tuple[float, ...]
    errors: tuple[float, ...]
    times_s: tuple[float, ...]

    def tolerance(self, wanted: float) -> float:
        """Tolerance whose error is `wanted`, by interpolation of logarithms."""
        ordered = np.minimum.accumulate(self.errors)
        found = np.interp(-math.log(wanted), -np.log(ordered), np.log(self.tolerances))
        return math.exp(float(found))

    def time_s(self, wanted: float) -> float:
        """Run time of a period at that tolerance [s]; beyond the finest trial it is a guess."""
        place = -math.log(wanted)
        errors = -np.log(np.minimum.accumulate(self.errors))
        beyond = max(0.0, place - float(errors[-1]))
        return float(np.interp(place, errors, self.times_s)) * math.exp(beyond / 4)


def tolerance_map(
    oscillator: Oscillator, reference: Reference, solver: str, finest: float
) -> ToleranceMap:
    """Try tolerances from 1e-2 downwards until the error is below `finest` or a trial is long."""
    tolerances, errors, times = [], [], []
    for tolerance in 10.0 ** -np.arange(2, 13):
        elapsed, motion = task_time(
            partial(integrate, oscillator, solver, float(tolerance), reference.state)
        )
        tolerances.append(float(tolerance))
        errors.append(max(reference.error(motion), 1e-15))
        times.append(elapsed)
        if errors[-1] < finest or elapsed > LONGEST_TRIAL_S:
            break
    return ToleranceMap(tolerances=tuple(tolerances), errors=tuple(errors), times_s=tuple(times))


def tuned_tolerance(
    first: float, wanted: float, error_at: Callable[[float], float], trials: int = 5
) -> float:
    """Loosest of some tolerances whose error is within `wanted`.

    Parameters
    ----------
    first : float
        To begin with.
    wanted : float
        Relative error.
    error_at : callable
        Error at a tolerance.
    trials : int
        Runs allowed.
    """
    tolerance, best = first, 0.0
    for _ in range(trials):
        elapsed, error = task_time(partial(error_at, tolerance))
        if error <= wanted:
            best = max(best, tolerance)
            if error > 0.5 * wanted or elapsed > LONGEST_TRIAL_S:
                break
        tolerance *= (0.75 * wanted / max(error, 1e-3 * wanted)) ** 0.9
        tolerance = max(tolerance, 3e-14)
    return best or tolerance


def least_within(
    wanted: float, first: float, error_at: Callable[[float], float], whole: int = 0
) -> float:
    """Least setting, to 3 %, whose error is within `wanted`.

    Parameters
    ----------
    wanted : float
        Relative error.
    first : float, > 0
        Setting to begin with; from there it grows or is halved.
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
    while low == 0.0 and (half := allowed(high / 2)) < high:
        low, high = (half, high) if error_at(half) > wanted else (low, half)
    while high - low > max(whole, 0.03 * high):
        middle = allowed(math.sqrt(low * high))
        if middle >= high:
            break
        low, high = (middle, high) if error_at(middle) > wanted else (low, middle)
    return high


def compiled_error(
    case: Case, reference: Reference, settling: float | None
) -> Callable[[float], float]:
    """Error of compiled steps over their number; by shooting where nothing settles."""
    p = case.problem
    ratio, zeta = p.frequency_ratio, p.damping_ratio

    def error_at(steps: float) -> float:
        table = tables(case, int(steps))
        if settling is None:
            return reference.error(shoot_compiled(table, ratio, zeta))
        return reference.error(march(table, ratio, zeta, settling))

    return error_at
