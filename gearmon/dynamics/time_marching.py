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
from typing import Any, Literal, get_args

import numpy as np

from gearmon.dynamics.fourier import Complex, Real, fast_length
from gearmon.dynamics.hill import HillProblem
from gearmon.dynamics.piecewise import PiecewiseProblem
from gearmon.errors import ArgumentError, check_range
from gearmon.result import Result

Solver = Literal["RK23", "RK45", "DOP853", "LSODA", "Radau", "BDF"]
Contact = Literal["tied", "one-sided"]
Periodic = HillProblem | PiecewiseProblem
Scalar = Callable[[float], float]

#: Points of Gauss's rule on a stretch over which the fastest part turns by PANEL radians.
GAUSS_POINTS = 12
PANEL = 4.0
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Scaled:
    """A problem without dimensions.

    Attributes
    ----------
    problem : HillProblem or PiecewiseProblem
    ends : float ndarray
        Ends in s of the stretches of a period without a jump, the last being the period.
    pieces : list of (callable, callable)
        Relative stiffness kappa and force g of each stretch as functions of s.
    zeta : float
    w0 : float
        [rad/s], of the mean stiffness.
    size_m : float
        d, scale of deflection.
    mean : float
        Mean force over k0 d; its sign is the direction in which the teeth are pressed.
    """

    problem: Periodic
    ends: Real
    pieces: list[tuple[Scalar, Scalar]]
    zeta: float
    w0: float
    size_m: float
    mean: float

    @property
    def sign(self) -> float:
        """Direction in which the mean force presses the teeth."""
        return math.copysign(1.0, self.mean)

    @property
    def period(self) -> float:
        """Period in s: 2 pi R."""
        return float(self.ends[-1])

    @property
    def units(self) -> Real:
        """Metres, m/s, m/s2 and newtons of what is one here."""
        d, w0 = self.size_m, self.w0
        return np.array([d, d * w0, d * w0**2, self.problem.mass_kg * d * w0**2])


def scaled(problem: Periodic) -> Scaled:
    """Take the dimensions out of a problem."""
    w0 = 2 * math.pi * problem.natural_frequency_hz
    if isinstance(problem, HillProblem):
        mean, stiffness = problem.force_n, problem.stiffness_n_per_m
        swing = 2 * float(np.abs(problem.force_harmonics_n).sum())
    else:
        mean, stiffness = problem.mean_force_n, problem.mean_stiffness_n_per_m
        swing = float(np.abs(problem.force_pieces_n).max())
    size = (max(abs(mean), swing) or stiffness) / stiffness
    unit = 1 / (stiffness * size)
    if isinstance(problem, HillProblem):
        rate = 1 / problem.frequency_ratio
        ends = np.array([2 * math.pi * problem.frequency_ratio])
        kappa = fourier_sum(1.0, problem.stiffness_harmonics, rate)
        pieces = [(kappa, fourier_sum(mean * unit, problem.force_harmonics_n * unit, rate))]
    else:
        ends, levels, forces = _from_zero(problem)
        ends = ends * w0
        pieces = [
            (_constant(level / stiffness), _constant(force * unit))
            for level, force in zip(levels, forces, strict=True)
        ]
    return Scaled(
        problem=problem,
        ends=ends,
        pieces=pieces,
        zeta=problem.damping_ratio,
        w0=w0,
        size_m=size,
        mean=float(mean) * unit,
    )


def _constant(value: float) -> Scalar:
    number = float(value)
    return lambda s: number  # noqa: ARG005


def _from_zero(p: PiecewiseProblem) -> tuple[Real, Real, Real]:
    """Return ends [s], stiffness and force of the pieces as seen from t = 0."""
    period = p.period_s
    begins = np.mod(np.cumsum(p.durations_s) - p.durations_s + p.start_s, period)
    begins[period - begins < 1e-12 * period] = 0.0
    order = np.argsort(begins, kind="stable")
    if begins[order[0]] > 0:
        # the piece that began before t = 0 still lasts
        begins, order = np.append(begins, 0.0), np.concatenate([[len(order)], order])
    which = np.where(order == len(p.durations_s), order[-1], order)
    ends = np.append(begins[order[1:]], period)
    return ends, p.stiffness_n_per_m[which], p.force_pieces_n[which]


def fourier_sum(mean: float, harmonics: Complex, rate: float) -> Scalar:
    """Return the function mean + sum_j (c_j e^{i j rate s} + conjugate), fast for single s."""
    if not harmonics.any():
        return _constant(mean)
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Leg:
    """Solution of one stretch of time.

    Attributes
    ----------
    start, end : float
        In s.
    solution : callable or None
        States (y, y') at s; None unless asked for.
    kappa, g : callable
    apart : bool
        Whether the teeth are apart.
    """

    start: float
    end: float
    solution: Callable[[Real], Real] | None
    kappa: Scalar
    g: Scalar
    apart: bool

    def values(self, s: Real, zeta: float) -> tuple[Real, Real, Real, Real]:
        """Y, y', y'' by the equation, and the mesh force over k0 d."""
        if self.solution is None:
            raise ArgumentError("the solution of this stretch was not kept")
        y, v = self.solution(s)
        push = np.zeros_like(y) if self.apart else sampled(self.kappa, s) * y + 2 * zeta * v
        return y, v, sampled(self.g, s) - push, push


def sampled(values: Scalar, s: Real) -> Real:
    """Values at an array of s."""
    return np.array([values(float(x)) for x in s], dtype=np.float64)


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
        ends, period = self.system.ends, self.system.period
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
        kappa, g = self.system.pieces[index]
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
        self, end: float, kappa: Scalar, g: Scalar, apart: bool, *, keep: bool
    ) -> tuple[Leg, bool]:
        from scipy.integrate import solve_ivp

        i, zeta = self.integrator, 0.0 if apart else self.system.zeta
        spring, twice = _constant(0.0) if apart else kappa, 2 * zeta
        extra: dict[str, Any] = {}
        if self.contact == "one-sided":
            extra["events"] = self._switch(kappa, apart)
        if i.solver in ("Radau", "BDF"):
            extra["jac"] = lambda s, _: np.array([[0.0, 1.0], [-spring(s), -twice]])
        found = solve_ivp(
            lambda s, x: (x[1], g(s) - twice * x[1] - spring(s) * x[0]),
            (self.s, end),
            self.state,
            method=i.solver,
            rtol=i.relative_tolerance,
            atol=i.absolute_tolerance,
            dense_output=keep,
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

    def _push(self, kappa: Scalar) -> float:
        y, v = self.state
        return self.system.sign * (kappa(self.s) * y + 2 * self.system.zeta * v)

    def _switch(self, kappa: Scalar, apart: bool) -> Callable[[float, Real], float]:
        sign, zeta = self.system.sign, self.system.zeta

        def push(s: float, state: Real) -> float:
            return float(sign * (kappa(s) * state[0] + 2 * zeta * state[1]))

        push.terminal = True  # type: ignore[attr-defined]
        push.direction = 1.0 if apart else -1.0  # type: ignore[attr-defined]
        return push


@dataclass(frozen=True, kw_only=True, eq=False)
class TimeHistory:
    """A vibration as a time series.

    Attributes
    ----------
    time_s, displacement, velocity, acceleration, mesh_force : float ndarray, shape (M,)
        [s], [m], [m/s], [m/s2], [N]; acceleration and mesh force by the equation of motion, not by
        differences. At a jump the values after it.
    apart : bool ndarray, shape (M,)
        Where the teeth are apart.
    evaluations : int
        Calls of the right side.
    solver : str
    """

    time_s: Real
    displacement: Real
    velocity: Real
    acceleration: Real
    mesh_force: Real
    apart: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]
    evaluations: int
    solver: Solver


@dataclass(frozen=True, kw_only=True, eq=False)
class IntegratedResponse(Result):
    """Periodic vibration found by time integration.

    Attributes
    ----------
    problem : HillProblem or PiecewiseProblem
    displacement, velocity, acceleration, mesh_force : complex ndarray, shape (N+1,)
        Fourier coefficients 0..N of the last period [m, m/s, m/s2, N], each from its own time
        function; the acceleration is by the equation of motion.
    history : TimeHistory
        Last period.
    periods : int
        Periods marched through.
    evaluations : int
        Calls of the right side in all.
    defect : float
        Change of state over the last period, relative to the rms swing of the state.
    error_bound : float
        Infinite: time integration bounds nothing.
    method : str
        "integration" or "shooting", with the solver.
    order : int
        0.
    stable : bool or None
        Shooting: whether both multipliers lie inside the unit circle. Settling: whether the motion
        settled; None if it had not yet.
    floquet_multipliers : (complex, complex) or None
        Shooting only.
    parted_at_rad : float or None
        First angle w t, counted from the start of the march, at which the teeth parted
        (one-sided contact only).
    message : str
    """

    problem: Periodic
    displacement: Complex
    velocity: Complex
    acceleration: Complex
    mesh_force: Complex
    history: TimeHistory
    periods: int
    evaluations: int
    defect: float
    error_bound: float
    method: str
    order: int
    stable: bool | None
    floquet_multipliers: tuple[complex, complex] | None
    parted_at_rad: float | None
    message: str

    @property
    def frequency_hz(self) -> Real:
        """Frequencies n/T [Hz], shape (N+1,)."""
        return np.arange(len(self.displacement)) / self.problem.period_s

    @property
    def energy_lines(self) -> Real:
        """E_n = (2 pi f_n A_n)^2/2 [J/kg] of each line, A_n = 2|z_n|, shape (N+1,)."""
        energy: Real = 2 * np.abs(self.velocity) ** 2
        return energy

    @property
    def contact_lost(self) -> bool:
        """Whether the mesh force is <= 0 somewhere on the points of the last period."""
        force = self.history.mesh_force * scaled(self.problem).sign
        return bool(self.history.apart.any() or (force <= 0).any())


def defect_of(before: list[float], after: list[float], legs: list[Leg], system: Scaled) -> float:
    """Return the change of state over the last period, relative to the rms swing of the state."""
    s, weights = _quadrature(legs, 1.0)
    states = np.concatenate([np.array(leg.values(x, system.zeta)[:2]) for leg, x in s], axis=1)
    share = np.concatenate(weights) / system.period
    swing = states - (states * share).sum(axis=1, keepdims=True)
    size = math.sqrt(float((swing**2 * share).sum()))
    change = math.hypot(after[0] - before[0], after[1] - before[1])
    return change / size if size else change


def _quadrature(legs: list[Leg], fastest: float) -> tuple[list[tuple[Leg, Real]], list[Real]]:
    """Gauss points and weights of each leg, for parts that turn by up to `fastest` rad a unit."""
    x, w = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    points, weights = [], []
    for leg in legs:
        panels = max(1, math.ceil((leg.end - leg.start) * max(1.0, fastest) / PANEL))
        width = (leg.end - leg.start) / panels
        begins = leg.start + width * np.arange(panels)
        points.append((leg, (begins[:, None] + width * (x + 1) / 2).ravel()))
        weights.append(np.tile(w * width / 2, panels))
    return points, weights


def response(
    march: March,
    legs: list[Leg],
    harmonics: int,
    points: int,
    periods: int,
    defect: float,
    stable: bool | None,
    pair: tuple[complex, complex] | None,
    message: str,
) -> IntegratedResponse:
    """Return the lines and the time series of the last period, whose legs are given."""
    check_range("points", points, 2, 10_000_000)
    system = march.system
    lines = _lines(legs, system, harmonics)
    begin = legs[0].start
    steps: Real = np.arange(points, dtype=np.float64)
    last = history(march, legs, begin + steps * (system.period / points))
    units = system.units
    parted = march.parted_at
    kind = "shooting" if pair is not None else "integration"
    return IntegratedResponse(
        problem=system.problem,
        displacement=lines[0] * units[0],
        velocity=lines[1] * units[1],
        acceleration=lines[2] * units[2],
        mesh_force=lines[3] * units[3],
        history=last,
        periods=periods,
        evaluations=march.evaluations,
        defect=defect,
        error_bound=math.inf,
        method=f"{kind} ({march.integrator.solver})",
        order=0,
        stable=stable,
        floquet_multipliers=pair,
        parted_at_rad=None if parted is None else 2 * math.pi * parted / system.period,
        message=message,
    )


def _lines(legs: list[Leg], system: Scaled, harmonics: int) -> Complex:
    """Fourier coefficients of y, y', y'' and the mesh force over one period, shape (4, N+1)."""
    period = system.period
    if len(legs) == 1:
        # smooth and periodic: equal steps are as good as any
        length = fast_length(max(256, 4 * harmonics + 16, math.ceil(8 * period)))
        steps: Real = np.arange(length, dtype=np.float64)
        s = legs[0].start + steps * (period / length)
        values = np.array(legs[0].values(s, system.zeta))
        found: Complex = np.fft.rfft(values, norm="forward", axis=1)[:, : harmonics + 1]
        return found
    total = np.zeros((4, harmonics + 1), dtype=np.complex128)
    orders = np.arange(harmonics + 1)
    points, weights = _quadrature(legs, 2 * math.pi * harmonics / period)
    for (leg, s), weight in zip(points, weights, strict=True):
        turns = np.exp(-2j * math.pi / period * np.mod(s, period)[:, None] * orders)
        total += (np.array(leg.values(s, system.zeta)) * weight) @ turns / period
    return total


def history(march: March, legs: list[Leg], s: Real) -> TimeHistory:
    """Return the motion at s, in units."""
    system = march.system
    values = np.empty((4, len(s)))
    apart = np.zeros(len(s), dtype=bool)
    # a point on a jump, up to rounding, takes the values after it
    jumps = np.array([leg.start for leg in legs[1:]]) - 1e-12 * system.period
    first = np.searchsorted(s, jumps)
    edges = [0, *first.tolist(), len(s)]
    for leg, low, high in zip(legs, edges[:-1], edges[1:], strict=True):
        if high > low:
            values[:, low:high] = leg.values(s[low:high], system.zeta)
            apart[low:high] = leg.apart
    z, v, a, force = values * system.units[:, None]
    return TimeHistory(
        time_s=s / system.w0,
        displacement=z,
        velocity=v,
        acceleration=a,
        mesh_force=force,
        apart=apart,
        evaluations=march.evaluations,
        solver=march.integrator.solver,
    )
