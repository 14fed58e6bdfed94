"""Time integration of one mass on a periodic spring with SciPy's solvers, leg by leg.

A leg is a stretch of time without a jump: it ends where the stiffness or the force jumps, and,
if the teeth may part, where they do so or meet again. Dimensionless inside: s = w0 t,
y = z/d with d the scale of deflection,

    y'' + 2 zeta y' + kappa(s) y = g(s)         teeth in contact, or tied to each other
    y'' = g(s)                                  teeth apart
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, Protocol, get_args

import numpy as np

from gearmon.dynamics.fourier import Complex, Real
from gearmon.dynamics.hill import HillProblem
from gearmon.dynamics.piecewise import PiecewiseProblem
from gearmon.errors import ArgumentError, check_range

Solver = Literal["RK23", "RK45", "DOP853", "LSODA", "Radau", "BDF"]
Contact = Literal["tied", "one-sided"]
Periodic = HillProblem | PiecewiseProblem
Scalar = Callable[[float], float]

#: More legs than this within a period are taken as chatter of the contact.
MOST_LEGS = 20_000
#: From here on a NumPy sum over harmonics is faster than Horner's scheme.
MANY_HARMONICS = 30


@dataclass(frozen=True)
class Integrator:
    """Which of SciPy's solvers, and how accurate.

    Parameters
    ----------
    solver : str
        "RK23", "RK45", "DOP853", "LSODA", "Radau" or "BDF".
    relative_tolerance : float
        Of displacement and velocity in each step, 2.3e-14 to 0.1.
    absolute_tolerance : float
        The same, in static deflections F/k0 (and times w0), 1e-20 to 0.1.
    """

    solver: Solver = "DOP853"
    relative_tolerance: float = 1e-9
    absolute_tolerance: float = 1e-11

    def __post_init__(self) -> None:
        if self.solver not in get_args(Solver):
            raise ArgumentError(
                f"solver={self.solver!r} must be one of: {', '.join(get_args(Solver))}"
            )
        # SciPy raises smaller ones with a warning
        check_range("relative_tolerance", self.relative_tolerance, 2.3e-14, 0.1)
        check_range("absolute_tolerance", self.absolute_tolerance, 1e-20, 0.1)


class Spring(Protocol):
    """Stiffness and force, each relative, over the legs of one period.

    Attributes
    ----------
    ends : float ndarray
        Ends of the legs in s, the last being the period.
    """

    ends: Real

    def leg(self, index: int) -> tuple[Scalar | float, Scalar | float]:
        """Kappa and g of a leg: a function of s, or a number."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Scaled:
    """A problem without dimensions.

    Attributes
    ----------
    problem : HillProblem or PiecewiseProblem
    spring : Spring
    zeta : float
    w0 : float
        [rad/s], of the mean stiffness.
    size_m : float
        d, scale of deflection.
    sign : float
        Direction in which the mean force presses the teeth.
    """

    problem: Periodic
    spring: Spring
    zeta: float
    w0: float
    size_m: float
    sign: float

    @property
    def period(self) -> float:
        """Period in s: 2 pi R."""
        return float(self.spring.ends[-1])


def scaled(problem: Periodic) -> Scaled:
    """Take the dimensions out of a problem."""
    w0 = 2 * math.pi * problem.natural_frequency_hz
    if isinstance(problem, HillProblem):
        mean = problem.force_n
        swing = 2 * float(np.abs(problem.force_harmonics_n).sum())
        stiffness = problem.stiffness_n_per_m
    else:
        mean = problem.mean_force_n
        swing = float(np.abs(problem.force_pieces_n).max())
        stiffness = problem.mean_stiffness_n_per_m
    size = (max(abs(mean), swing) or stiffness) / stiffness
    spring: Spring
    if isinstance(problem, HillProblem):
        spring = _FourierSpring(problem, size)
    else:
        spring = _SteppedSpring(problem, size, w0)
    return Scaled(
        problem=problem,
        spring=spring,
        zeta=problem.damping_ratio,
        w0=w0,
        size_m=size,
        sign=math.copysign(1.0, mean),
    )


class _FourierSpring:
    """Smooth stiffness and force from Fourier coefficients: one leg."""

    def __init__(self, p: HillProblem, size: float) -> None:
        self.ends = np.array([2 * math.pi * p.frequency_ratio])
        rate = 1 / p.frequency_ratio
        unit = 1 / (p.stiffness_n_per_m * size)
        self.kappa = fourier_sum(1.0, p.stiffness_harmonics, rate)
        self.g = fourier_sum(p.force_n * unit, p.force_harmonics_n * unit, rate)

    def leg(self, index: int) -> tuple[Scalar | float, Scalar | float]:  # noqa: ARG002
        return self.kappa, self.g


def fourier_sum(mean: float, harmonics: Complex, rate: float) -> Scalar | float:
    """Return the function mean + sum_j (c_j e^{i j rate s} + conjugate), fast for single s."""
    if not harmonics.any():
        return mean
    if len(harmonics) >= MANY_HARMONICS:
        turns = 1j * rate * np.arange(1, len(harmonics) + 1)
        return lambda s: mean + 2 * float((harmonics @ np.exp(turns * s)).real)
    backwards = [complex(c) for c in harmonics[::-1]]

    def horner(s: float) -> float:
        e = cmath.exp(1j * rate * s)
        total = 0j
        for c in backwards:
            total = (total + c) * e
        return mean + 2 * total.real

    return horner


class _SteppedSpring:
    """Stiffness and force piece by piece, seen from t = 0."""

    def __init__(self, p: PiecewiseProblem, size: float, w0: float) -> None:
        period = p.period_s
        begins = np.mod(np.cumsum(p.durations_s) - p.durations_s + p.start_s, period)
        begins[period - begins < 1e-12 * period] = 0.0
        order = np.argsort(begins, kind="stable")
        kappa = p.stiffness_n_per_m[order] / p.mean_stiffness_n_per_m
        g = p.force_pieces_n[order] / (p.mean_stiffness_n_per_m * size)
        if begins[order[0]] > 0:
            # the piece that began before t = 0 still lasts
            kappa = np.concatenate([kappa[-1:], kappa])
            g = np.concatenate([g[-1:], g])
            ends = np.concatenate([begins[order], [period]])
        else:
            ends = np.concatenate([begins[order[1:]], [period]])
        self.ends = ends * w0
        self.pieces = [(float(a), float(b)) for a, b in zip(kappa, g, strict=True)]

    def leg(self, index: int) -> tuple[Scalar | float, Scalar | float]:
        return self.pieces[index]


@dataclass(frozen=True, kw_only=True, eq=False)
class Leg:
    """Solution of one stretch of time.

    Attributes
    ----------
    start, end : float
        In s.
    solution : callable or None
        States (y, y') at s; None unless asked for.
    kappa, g : callable or float
    apart : bool
        Whether the teeth are apart.
    """

    start: float
    end: float
    solution: Callable[[Real], Real] | None
    kappa: Scalar | float
    g: Scalar | float
    apart: bool

    def values(self, s: Real, zeta: float) -> tuple[Real, Real, Real, Real]:
        """Y, y', y'' by the equation, and the mesh force over k0 d."""
        if self.solution is None:
            raise ArgumentError("the solution of this stretch was not kept")
        y, v = self.solution(s)
        push = np.zeros_like(y) if self.apart else sampled(self.kappa, s) * y + 2 * zeta * v
        return y, v, sampled(self.g, s) - push, push


def sampled(values: Scalar | float, s: Real) -> Real:
    """Values at an array of s."""
    if callable(values):
        return np.array([values(float(x)) for x in s], dtype=np.float64)
    return np.full(len(s), values)


@dataclass
class March:
    """State of a march in time; grows leg by leg.

    Attributes
    ----------
    system : Scaled
    integrator : Integrator
    contact : str
    s : float
    state : list of float
        (y, y').
    evaluations : int
        Calls of the right side so far.
    parted_at : float or None
        First s at which the teeth parted.
    """

    system: Scaled
    integrator: Integrator
    contact: Contact
    s: float
    state: list[float]
    evaluations: int = 0
    parted_at: float | None = None

    def periods(self, count: int, *, keep: bool) -> list[Leg]:
        """March over whole periods; returns their legs if `keep`."""
        ends, period = self.system.spring.ends, self.system.period
        begin = round(self.s / period)
        kept: list[Leg] = []
        if len(ends) == 1 and not keep and self.contact == "tied":
            # a smooth problem needs no stop at the ends of the periods
            self._stretch(0, (begin + count) * period, keep=False)
            return kept
        for turn in range(begin, begin + count):
            for index, end in enumerate(ends):
                legs = self._stretch(index, turn * period + float(end), keep=keep)
                kept += legs if keep else []
        return kept

    def _stretch(self, index: int, end: float, *, keep: bool) -> list[Leg]:
        """March to `end` on one piece, through the partings and meetings on the way."""
        kappa, g = self.system.spring.leg(index)
        legs: list[Leg] = []
        apart = self.contact == "one-sided" and self._push(kappa) < 0
        while self.s < end:
            if apart and self.parted_at is None:
                self.parted_at = self.s
            leg, met = self._leg(end, kappa, g, apart, keep=keep)
            legs.append(leg)
            if len(legs) > MOST_LEGS:
                raise ArgumentError(
                    f"the teeth part and meet more than {MOST_LEGS} times on one piece of the "
                    "period; the contact chatters, choose contact='tied'"
                )
            apart = apart != met
        return legs

    def _leg(
        self, end: float, kappa: Scalar | float, g: Scalar | float, apart: bool, *, keep: bool
    ) -> tuple[Leg, bool]:
        from scipy.integrate import solve_ivp

        event = None
        if self.contact == "one-sided":
            event = self._switch(kappa, apart)
        i = self.integrator
        extra: dict[str, Any] = {}
        if i.solver in ("Radau", "BDF"):
            extra["jac"] = _jacobian(0.0 if apart else kappa, 0.0 if apart else self.system.zeta)
        found = solve_ivp(
            right_side(0.0 if apart else kappa, g, 0.0 if apart else self.system.zeta),
            (self.s, end),
            self.state,
            method=i.solver,
            rtol=i.relative_tolerance,
            atol=i.absolute_tolerance,
            dense_output=keep,
            events=event,
            **extra,
        )
        if not found.success:
            raise ArgumentError(
                f"solver={i.solver!r} failed at s={found.t[-1]:.6g}: {found.message}"
            )
        start, self.s = self.s, float(found.t[-1])
        met = found.status == 1
        if not met:
            self.s = end
        self.state = [float(x) for x in found.y[:, -1]]
        self.evaluations += found.nfev
        leg = Leg(start=start, end=self.s, solution=found.sol, kappa=kappa, g=g, apart=apart)
        return leg, met

    def _push(self, kappa: Scalar | float) -> float:
        stiffness = kappa(self.s) if callable(kappa) else kappa
        y, v = self.state
        return self.system.sign * (stiffness * y + 2 * self.system.zeta * v)

    def _switch(self, kappa: Scalar | float, apart: bool) -> Callable[[float, Real], float]:
        sign, zeta = self.system.sign, self.system.zeta

        def push(s: float, state: Real) -> float:
            stiffness = kappa(s) if callable(kappa) else kappa
            return float(sign * (stiffness * state[0] + 2 * zeta * state[1]))

        push.terminal = True  # type: ignore[attr-defined]
        push.direction = 1.0 if apart else -1.0  # type: ignore[attr-defined]
        return push


def right_side(
    kappa: Scalar | float, g: Scalar | float, zeta: float
) -> Callable[[float, Real], tuple[float, float]]:
    """Right side of y' = v, v' = g - 2 zeta v - kappa y, with what is constant bound early."""
    twice = 2 * zeta
    if callable(kappa) and callable(g):
        return lambda s, x: (x[1], g(s) - twice * x[1] - kappa(s) * x[0])
    if callable(kappa):
        return lambda s, x: (x[1], g - twice * x[1] - kappa(s) * x[0])
    if callable(g):
        return lambda s, x: (x[1], g(s) - twice * x[1] - kappa * x[0])
    return lambda s, x: (x[1], g - twice * x[1] - kappa * x[0])  # noqa: ARG005


def _jacobian(kappa: Scalar | float, zeta: float) -> Callable[[float, Real], Real]:
    def jacobian(s: float, _: Real) -> Real:
        return np.array([[0.0, 1.0], [-(kappa(s) if callable(kappa) else kappa), -2 * zeta]])

    return jacobian
