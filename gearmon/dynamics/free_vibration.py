"""Free vibration under periodic stiffness, away from parametric resonance.

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
`resonance.parametric_resonance`, and `motion.transient` anywhere.

Source: Nayfeh and Mook, Nonlinear Oscillations, 1979, section 5.2; Floquet exponents by a
perturbation series (Hill 1886).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gearmon.dynamics.amplitude_equations import (
    AmplitudeEquations,
    check_orders,
    coupling_of,
)
from gearmon.dynamics.fourier import Complex, Real
from gearmon.dynamics.hill import HillProblem
from gearmon.dynamics.motion import Motion
from gearmon.dynamics.slow_states import answer_forces, reduce
from gearmon.errors import ArgumentError


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeVibration:
    """The two free vibrations, and the steady one that they die out to.

    Attributes
    ----------
    equations : AmplitudeEquations
        A' = lambda A of both, uncoupled, on line 0: A holds the fast e^{lambda t}.
    """

    equations: AmplitudeEquations

    @property
    def exponent_terms(self) -> Complex:
        """Orders of lambda [1/s], shape (K+1,): order zero first, then D_k A/A."""
        return np.asarray(self.equations.rate_terms[:, 0, 0])

    @property
    def exponent(self) -> complex:
        """Sum of all orders of lambda [1/s], of the vibration with Im lambda > 0 (or slower)."""
        return complex(self.exponent_terms.sum())

    @property
    def frequency_rad_s(self) -> float:
        """Shifted natural frequency Im lambda [rad/s]; 0 if overdamped."""
        return self.exponent.imag

    @property
    def frequency_hz(self) -> float:
        """Shifted natural frequency [Hz]; 0 if overdamped."""
        return self.exponent.imag / (2 * math.pi)

    @property
    def decay_per_s(self) -> float:
        """Decay rate -Re lambda [1/s]."""
        return -self.exponent.real

    def motion(self, displacement_m: float = 0.0, velocity_ms: float = 0.0) -> Motion:
        """Vibration from z(0) [m] and z'(0) [m/s] under the forces of the problem.

        The error at a fixed time is of order N+1 in the variation of stiffness; up to times of
        the order of 1/eps that takes rate_order >= order + 1.
        """
        return Motion(
            equations=self.equations, displacement_m=displacement_m, velocity_ms=velocity_ms
        )

    def rows(self, most: int = 12) -> list[dict[str, float]]:
        """Lines by size, relative to the free amplitude A, with what each order gives.

        Parameters
        ----------
        most : int
            Number of lines.

        Returns
        -------
        list of dict
            harmonic n, frequency_hz of w + n w_mesh (negative: seen at its modulus), relative
            amplitude |U_n|, and order_k (modulus) for every order.
        """
        e = self.equations
        terms = e.shape_terms[:, :, 0]
        sizes = np.abs(terms.sum(axis=0))
        return [
            {
                "harmonic": float(e.lines[at]),
                "frequency_hz": self.frequency_hz + float(e.lines[at]) / e.problem.period_s,
                "relative": float(sizes[at]),
            }
            | {f"order_{k}": float(abs(term[at])) for k, term in enumerate(terms)}
            for at in np.argsort(-sizes, kind="stable")[:most]
            if sizes[at] > 0
        ]


def free_vibration(
    problem: HillProblem,
    order: int = 2,
    rate_order: int | None = None,
    small_damping: bool = False,
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
    >>> round(free_vibration(p, 2).frequency_rad_s, 8)
    3.29155616
    """
    rate_order = order if rate_order is None else rate_order
    check_orders(order, rate_order)
    coupling = coupling_of(problem, small_damping)
    up, down = (reduce(coupling, [(sign, 0.0)], order, rate_order) for sign in (1, -1))
    rates = np.zeros((rate_order + 1, 2, 2), dtype=complex)
    shapes = np.zeros((order + 1, len(up.lines), 2), dtype=complex)
    for p, one in enumerate((up, down)):
        rates[:, p, p] = one.rates[:, 0, 0]
        shapes[:, :, p] = one.states[: order + 1].sum(axis=1)[:, :, 0]
    steady = answer_forces(coupling, problem, [], up, order)
    w0 = 2 * math.pi * problem.natural_frequency_hz
    return FreeVibration(
        equations=AmplitudeEquations(
            problem=problem,
            slow=((1, 0.0), (-1, 0.0)),
            small_damping=small_damping,
            rate_terms=np.asarray(w0 * rates),
            forcing_terms=np.zeros((rate_order + 1, 2), dtype=complex),
            lines=up.lines,
            shape_terms=shapes,
            forced_lines=steady.lines,
            forced_terms=steady.terms,
            smallest_divisor=min(one.smallest_divisor for one in (up, down, steady)),
        )
    )


def frequency_shifts(problem: HillProblem) -> Real:
    """Second-order shift of the natural frequency by each stiffness harmonic [rad/s], shape (J,).

    -w0 |c_n|^2/(4 - (n/R)^2): downwards for harmonics below 2 w0, upwards above.

    Raises
    ------
    ArgumentError
        If a harmonic with c_n != 0 lies within 1e-9 of 2 w0.
    """
    n = np.arange(1, len(problem.stiffness_harmonics) + 1)
    c = problem.stiffness_harmonics
    divisor = 4 - (n / problem.frequency_ratio) ** 2
    hit = (np.abs(divisor) < 4e-9) & (c != 0)
    if hit.any():
        raise ArgumentError(
            f"harmonic {int(n[hit][0])} of the stiffness lies on twice the natural frequency; "
            "use parametric_resonance(problem)"
        )
    w0 = 2 * math.pi * problem.natural_frequency_hz
    shift: Real = -w0 * np.abs(c) ** 2 / np.where(c == 0, 1.0, divisor)
    return shift
