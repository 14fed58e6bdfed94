"""Resonances of Hill's equation by their amplitude equations.

The line p w near the natural frequency carries z = A e^{i p w t} + conjugate, whose amplitude obeys

    A' = alpha A + beta conj(A) + b

alpha = -h + i (w0 - p w) + ..., beta = i w0 c_{2p}/2 + ... and, for whole p, b = i w0 c_p delta/2 +
..., delta = F/k0, each to any order. (Signs: z'' + ... = -w0^2 phi z.)

Forced parametric resonance, n w = w0 (p = n): at first order the steady line has the amplitude
2|A| = w0 |c_n| delta/sqrt(h^2 + (n w - w0)^2), which a direct force f_n at the line adds to.

Principal parametric resonance, n w = 2 w0 (p = n/2): A grows with the rate
-h + sqrt(|beta|^2 - Im(alpha)^2); at first order inside |n w - 2 w0| < 2 sqrt((w0 |c_n|/2)^2 - h^2)
and only if 2|c_n| > 4 zeta (2|c_n| is the real amplitude of the stiffness harmonic n).

Coincidences of second and higher order need nothing else: beta and b then start at that order, from
products c_j c_l with j + l = 2p or p.

Orders: with damping and detuning of order r (r = 1 where c_p or c_2p itself is resonant, 2 where a
product is) A is of order zero and its error of order N + 1 if L and b go to order N + r; the
default is N + 2.

Limits: all other lines must be away from the natural frequency by much more than |phi| w0/2; the
nearest is usually a mesh frequency away, so max|phi| R should not be large. Lines p and p+1 may be
taken together for the steady state (and are, half-way between them). Overdamped systems have no
resonance.

Source: Nayfeh and Mook, Nonlinear Oscillations, 1979, section 5.7 (first order).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from gearmon.dynamics.amplitude_equations import AmplitudeEquations, amplitude_equations
from gearmon.dynamics.hill import HillProblem
from gearmon.errors import ArgumentError, check_range


def forced_resonance(
    problem: HillProblem,
    order: int = 2,
    lines: Sequence[int] | None = None,
    rate_order: int | None = None,
    small_damping: bool = False,
) -> AmplitudeEquations:
    """Amplitude equations of the mesh harmonics near the natural frequency.

    Parameters
    ----------
    problem : HillProblem
        What to expand; zeta < 1.
    order : int
        N >= 0: highest order of the lines.
    lines : sequence of int, optional
        Harmonics >= 0 to treat as resonant; by default the one nearest to the natural frequency,
        or its two neighbours where it is more than w/4 away from both. Two serve the steady state
        only: for initial conditions see `motion.transient`.
    rate_order : int, optional
        Highest order of the rates; default order + 2.
    small_damping : bool
        Damping of order one (h = eps mu) instead of zero.

    Returns
    -------
    AmplitudeEquations
        `steady_displacement()` is the steady vibration; see `motion.Motion` for transients.

    Raises
    ------
    ArgumentError
        If the system is overdamped, or an argument is out of its range.

    Examples
    --------
    >>> p = HillProblem(1.0, 0.02, 1.0, [0.05], 2 * math.pi / 1.02, 1.0)    # w0 = 1, w = 1.02
    >>> e = forced_resonance(p, 0, rate_order=1, small_damping=True)
    >>> a = 2 * abs(e.steady_amplitudes()[0])
    >>> round(float(a), 3), round(0.05 / math.hypot(0.01, 0.02), 3)
    (2.236, 2.236)
    """
    near = natural_line(problem, small_damping)
    chosen = nearest_lines(near) if lines is None else [int(n) for n in lines]
    for n in chosen:
        check_range("lines", n, 0, 100_000)
    slow = [(sign, float(sign * n)) for n in chosen for sign in (1, -1)]
    rate_order = order + 2 if rate_order is None else rate_order
    return amplitude_equations(problem, slow, order, rate_order, small_damping)


def parametric_resonance(
    problem: HillProblem,
    order: int = 2,
    number: int | None = None,
    rate_order: int | None = None,
    small_damping: bool = False,
) -> AmplitudeEquations:
    """Amplitude equations where n w is near twice the natural frequency.

    Parameters
    ----------
    problem : HillProblem
        What to expand; zeta < 1.
    order, rate_order, small_damping
        As in `forced_resonance`.
    number : int, optional
        n >= 1; by default the nearest.

    Returns
    -------
    AmplitudeEquations
        `growth_per_s` > 0 tells instability. For even n this is the forced resonance of n/2, too.

    Raises
    ------
    ArgumentError
        If the system is overdamped, or an argument is out of its range.

    Examples
    --------
    >>> p = HillProblem(1.0, 0.02, 1.0, [0.05], math.pi, 1.0)    # w0 = 1, w = 2, zeta = 0.01
    >>> growth = parametric_resonance(p, 0, rate_order=1, small_damping=True).growth_per_s
    >>> round(growth, 6)    # w0 c_1/2 - h
    0.015
    """
    near = natural_line(problem, small_damping)
    n = max(1, round(2 * near)) if number is None else int(number)
    check_range("number", n, 1, 100_000)
    rate_order = order + 2 if rate_order is None else rate_order
    slow = [(1, n / 2), (-1, -n / 2)]
    return amplitude_equations(problem, slow, order, rate_order, small_damping)


def nearest_lines(natural: float) -> list[int]:
    """Whole lines near the natural frequency: one, or both neighbours of the middle.

    Line n alone would leave a divisor |2 R - 2n - 1|/R, lines n and n+1 together |2 R - 2n|/R.

    Examples
    --------
    >>> nearest_lines(2.2), nearest_lines(2.4)
    ([2], [2, 3])
    """
    below = math.floor(natural)
    if abs(natural - round(natural)) <= 0.25:
        return [round(natural)]
    return [below, below + 1]


def natural_line(problem: HillProblem, small_damping: bool = False) -> float:
    """Natural frequency as a multiple of the mesh frequency, damped unless damping is small.

    Raises
    ------
    ArgumentError
        If the system is overdamped.
    """
    if small_damping:
        return problem.frequency_ratio
    zeta = problem.damping_ratio
    if zeta >= 1:
        raise ArgumentError(
            f"damping_ratio={zeta:.6g} must be < 1: an overdamped system has no resonance; "
            "use expand(problem, order)"
        )
    return problem.frequency_ratio * math.sqrt(1 - zeta**2)
