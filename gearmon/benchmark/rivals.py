"""Time integration with SciPy and banded harmonic balance, as strong as they can be made.

The equation is dimensionless, z'' + 2 zeta z' + kappa(s) z = 1 in s = w0 t. Stiffness is read from
a table of cubics made beforehand, right sides are plain Python numbers, dense output is off, and
integration restarts where stiffness jumps. Integration begins at rest in the static deflection and
ends one period after the free vibration has decayed to the wanted error, whose time is told.
"""

from __future__ import annotations

import itertools
import math
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.benchmark.collocation import Lines, Real, Samples
from gearmon.benchmark.dynamics_cases import Case, Complex

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
