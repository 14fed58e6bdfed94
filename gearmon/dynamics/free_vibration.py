"""Free vibration and transients under periodic stiffness, by amplitude equations.

Away from parametric resonance the free vibration is

    z(t) = A e^{lambda t} sum_n U_n e^{i n w t} + conjugate,    U_0 = 1 + order two

The amplitude equation is A' = lambda A: the modulation of amplitude and phase is a' = -decay a and
theta' = Im lambda. With small damping (h = eps mu, h = zeta w0) and to second order

    Im lambda = w0 - h^2/(2 w0) - w0 sum_{n>=1} |c_n|^2/(4 - (n/R)^2),     decay = h
    U_n = c_n/[(n/R)(2 + n/R)]       side lines at w0 + n w, first order

and with the damping in order zero lambda starts from -h + i w0 sqrt(1 - zeta^2); overdamped, both
exponents are real. Higher orders follow by recursion and agree with the Floquet exponents, up to
the multiple of i w that these leave open.

Limits: the divisors are n/R (slow stiffness against w0: the side lines are then many, like those
of frequency modulation with index c_n R/n) and 2 sqrt(1 - zeta^2) - n/R (n w near 2 w0: parametric
resonance); `AmplitudeEquations.smallest_divisor` tells how near. Near parametric resonance use
`parametric_resonance`, and `transient` anywhere.

Source: Nayfeh and Mook, Nonlinear Oscillations, 1979, section 5.2; Floquet exponents by a
perturbation series (Hill 1886).

Motion from given initial conditions. Of two amplitude equations,

    z(t) = sum_n [q_n + sum_p U_np A_p(t)] e^{i n w t},    A(t) = A_s + e^{L t} (A(0) - A_s)

A_s is the steady amplitude and A(0) is found from z(0) and z'(0). The exponential of the 2 x 2
matrix L is in closed form, also where its two exponents coincide (edge of an instability tongue).
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.amplitude_equations import AmplitudeEquations, amplitude_equations
from gearmon.dynamics.fourier import Complex, Real, turning
from gearmon.dynamics.hill import KINDS, HillProblem, check_kind
from gearmon.errors import ArgumentError, check_finite
from gearmon.result import Result

VALUES_AT_ONCE = 1 << 20


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion(Result):
    """Transient and steady vibration that starts at t = 0.

    Parameters
    ----------
    equations : AmplitudeEquations
        Of two slow states.
    displacement_m, velocity_ms : float
        z(0) and z'(0), met exactly.

    Raises
    ------
    ArgumentError
        If there are not two slow states, or they cannot carry the initial conditions.
    """

    equations: AmplitudeEquations
    displacement_m: float
    velocity_ms: float

    def __post_init__(self) -> None:
        check_finite("displacement_m", self.displacement_m, "m")
        check_finite("velocity_ms", self.velocity_ms, "m/s")
        if len(self.equations.slow) != 2:
            raise ArgumentError(
                f"slow={self.equations.slow}: initial conditions fix two amplitudes, no more or "
                "less; choose a single line"
            )

    @cached_property
    def start_amplitudes(self) -> Complex:
        """A(0) [m], shape (2,)."""
        # z and z' at t = 0 per amplitude, and without any
        sums = np.array([shape.sum(axis=0) for shape in self._shapes[:2]])
        matrix = sums[:, :2]
        wanted = np.array([self.displacement_m, self.velocity_ms]) - sums[:, 2]
        scale = np.array([1.0, 2 * math.pi * self.equations.problem.natural_frequency_hz])
        if np.linalg.cond(matrix / scale[:, None]) > 1e12:
            raise ArgumentError(
                "the two slow states look alike at t = 0 and cannot carry the initial conditions; "
                "take a lower order"
            )
        return np.asarray(np.linalg.solve(matrix, wanted), dtype=np.complex128)

    @cached_property
    def steady_amplitudes(self) -> Complex:
        """A_s [m], shape (2,)."""
        return self.equations.steady_amplitudes()

    def amplitudes(self, time_s: npt.ArrayLike) -> Complex:
        """Slow amplitudes A(t) [m], shape (..., 2): envelope and phase of the modulation."""
        time = np.asarray(time_s, dtype=float)
        away = self.start_amplitudes - self.steady_amplitudes
        even, odd = self._exponential(time)
        spread = (self.equations.rate - self._middle * np.eye(2)) @ away
        moved = self.steady_amplitudes + even[..., None] * away + odd[..., None] * spread
        return np.asarray(moved, dtype=np.complex128)

    def at(self, time_s: npt.ArrayLike, kind: str = "displacement") -> Real:
        """Displacement [m], velocity [m/s], acceleration [m/s2] or mesh force [N] at any times.

        Parameters
        ----------
        time_s : float array
            Times [s] from the start, any shape.
        kind : {"displacement", "velocity", "acceleration", "mesh_force"}
            What to evaluate: the displacement as it stands, its derivatives, or k(t) z + c z'.
        """
        derivative = KINDS.index(check_kind(kind))
        time = np.asarray(time_s, dtype=float)
        rows = max(1, VALUES_AT_ONCE // len(self.equations.lines))
        flat = time.ravel()
        found = np.empty(len(flat))
        for first in range(0, len(flat), rows):
            part = slice(first, first + rows)
            found[part] = self._values(flat[part], derivative)
        return found.reshape(time.shape)

    @cached_property
    def _shapes(self) -> list[Complex]:
        """Lines of z, z' and z'' per amplitude, and without any, shape (M, 3) each."""
        e = self.equations
        rates = np.zeros((3, 3), dtype=complex)
        rates[:2, :2], rates[:2, 2] = e.rate, e.forcing
        turning = 1j * e.problem.angular_frequency * e.lines[:, None]
        shapes = [np.column_stack([e.shape_terms.sum(axis=0), e.forced_terms.sum(axis=0)])]
        for _ in range(2):
            shapes.append(turning * shapes[-1] + shapes[-1] @ rates)
        return shapes

    @cached_property
    def _middle(self) -> complex:
        return complex(np.trace(self.equations.rate)) / 2

    @cached_property
    def _half_split(self) -> complex:
        """Half the difference of both exponents [1/s]."""
        away = self.equations.rate - self._middle * np.eye(2)
        return cmath.sqrt(-complex(away[0, 0] * away[1, 1] - away[0, 1] * away[1, 0]))

    def _exponential(self, time: Real) -> tuple[Complex, Complex]:
        """e^{Lt} = even + odd (L - middle): the two factors."""
        # the root of the slower exponent has the positive real part: nothing overflows
        first, twice = np.exp((self._middle + self._half_split) * time), 2 * self._half_split * time
        safe = np.where(twice == 0, 1.0, twice)
        share = np.where(twice == 0, 1.0, -np.expm1(-safe) / safe)
        return first * (1 + np.exp(-twice)) / 2, first * time * share

    def _values(self, time: Real, derivative: int) -> Real:
        """Differentiate the displacement at a few times, or for 3 give the mesh force."""
        e = self.equations
        if derivative == KINDS.index("mesh_force"):
            return self._mesh_force(time)
        moved = turning(e.problem.angular_frequency * time, e.lines) @ self._shapes[derivative]
        z = (moved[:, :2] * self.amplitudes(time)).sum(axis=1) + moved[:, 2]
        return np.asarray(z.real, dtype=np.float64)

    def _mesh_force(self, time: Real) -> Real:
        p = self.equations.problem
        n = np.arange(1.0, len(p.stiffness_harmonics) + 1)
        phi = 2 * (turning(p.angular_frequency * time, n) @ p.stiffness_harmonics).real
        stiffness = p.stiffness_n_per_m * (1 + phi)
        force: Real = stiffness * self._values(time, 0)
        force += p.damping_ns_per_m * self._values(time, 1)
        return force


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeVibration(AmplitudeEquations):
    """The two free vibrations, A' = lambda A each, and the steady one that they die out to.

    Both are states of line 0: A holds the fast e^{lambda t}. As a start for `Motion` the error at a
    fixed time is of order N+1 in the variation of stiffness; up to times of the order of 1/eps that
    takes rate_order >= order + 1.
    """

    @property
    def exponent(self) -> complex:
        """Sum of all orders of lambda [1/s], of the vibration with Im lambda > 0 (or slower)."""
        return complex(self.rate[0, 0])

    @property
    def frequency_hz(self) -> float:
        """Shifted natural frequency [Hz]; 0 if overdamped."""
        return self.exponent.imag / (2 * math.pi)

    @property
    def decay_per_s(self) -> float:
        """Decay rate -Re lambda [1/s]."""
        return -self.exponent.real


def free_vibration(
    problem: HillProblem, order: int = 2, rate_order: int | None = None, small_damping: bool = False
) -> FreeVibration:
    """Expand the free vibration.

    Parameters
    ----------
    problem : HillProblem
        What to expand.
    order : int
        N >= 0: highest order of the lines.
    rate_order : int, optional
        K >= 0: highest order of the exponent; by default `order`. Its error is of order K+1, and
        K+2 with K even and no damping.
    small_damping : bool
        Damping of order one (h = eps mu) instead of zero. For zeta well below 1 only.

    Raises
    ------
    ArgumentError
        If orders are out of range, damping is critical in order zero, or n w equals twice the
        natural frequency for some n that the orders reach.

    Examples
    --------
    >>> p = HillProblem(1.0, 0.0, 3.3**2, [0.1], 2 * math.pi, 0.0)    # w0 = 3.3 w, eps = 0.2
    >>> round(free_vibration(p, 2).exponent.imag, 8)
    3.29155616
    """
    rate_order = order if rate_order is None else rate_order
    slow = [(1, 0.0), (-1, 0.0)]
    found = amplitude_equations(problem, slow, order, rate_order, small_damping, apart=True)
    return FreeVibration(**vars(found))


def transient(
    problem: HillProblem,
    displacement_m: float = 0.0,
    velocity_ms: float = 0.0,
    order: int = 4,
    small_damping: bool = False,
) -> Motion:
    """Vibration from given initial conditions, resonant or not.

    Parameters
    ----------
    problem : HillProblem
        What to expand.
    displacement_m, velocity_ms : float
        z(0) [m] and z'(0) [m/s].
    order : int
        N >= 0: the error is of order N+1 in the variation of stiffness, up to times of the order
        of its inverse squared; rates are taken to order N+2.
    small_damping : bool
        Damping of order one (h = eps mu) instead of zero.

    Returns
    -------
    Motion
        Of the slow line p w nearest to the natural frequency, p = 0, 1/2, 1, 3/2, ...: that also
        covers parametric (2p) and forced (p) resonance. Overdamped, and where the damped natural
        frequency is below w/4, p = 0.

    Raises
    ------
    ArgumentError
        If an argument is out of its range or the damping critical.

    Notes
    -----
    Other lines are at least w/2 away, so that max|phi| R should be well below one (fast meshes);
    with it above, as for w0 = 13.6 w, more orders help as long as they converge.

    Examples
    --------
    >>> p = HillProblem(0.28, 9e3, 8e8, [0.065], 4e-5, 4e3)
    >>> m = transient(p)    # from rest
    >>> abs(float(m.at(0.0))) < 1e-18, abs(float(m.at(1.0)) / 5e-6 - 1) < 0.1
    (True, True)
    """
    zeta = 0.0 if small_damping else problem.damping_ratio
    near = problem.frequency_ratio * math.sqrt(max(0.0, 1 - zeta**2))
    line = round(2 * near) / 2
    slow = [(1, line), (-1, -line)]
    equations = amplitude_equations(problem, slow, order, small_damping=small_damping)
    return Motion(equations=equations, displacement_m=displacement_m, velocity_ms=velocity_ms)
