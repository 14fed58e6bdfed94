"""Steady vibration of Hill's equation by the cheapest method that meets a tolerance."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Literal, get_args, overload

import numpy as np

from gearmon.dynamics import direct
from gearmon.dynamics.compliance import PairCompliance
from gearmon.dynamics.direct import Solution, lines
from gearmon.dynamics.floquet import SETTLED
from gearmon.dynamics.fourier import Complex, cut
from gearmon.dynamics.hill import HillProblem, Response
from gearmon.dynamics.mesh_equations import (
    MOST_ORDERS,
    Approximation,
    MeshEquations,
    balance,
    equations_of,
    first_highest,
    plain_sum,
    recombine,
    sharpened,
    widen,
)
from gearmon.dynamics.shooting import Shooting
from gearmon.dynamics.system import HillSystem, SystemResponse
from gearmon.errors import ArgumentError, check_range, check_word

Method = Literal["auto", "msm", "msm least residual", "harmonic balance"]
METHODS = get_args(Method)

UNDAMPED = "undamped: free vibrations never die out, so no steady state is reached"
#: What to say of each method, its orders to be filled in, and why there is no bound.
_HOW = {
    "msm": "plain expansion to order {}",
    "msm least residual": "{} orders recombined by least residual",
    "harmonic balance": "all harmonics solved together",
}
_NO_INVERSE = "the inverse operator could not be bounded"
_TOO_LARGE = "the residual leaves an error as large as the vibration"
#: Lines up to which a matrix is inverted for a bound where no other tells.
MOST_OF_A_MATRIX = 1000
#: w0/w up to which the harmonics are solved for.
MOST_RATIO = 1e6


@overload
def steady_state(
    problem: HillProblem,
    tolerance: float = ...,
    method: Method = ...,
    order: int | None = ...,
    harmonics: int | None = ...,
) -> Response: ...


@overload
def steady_state(
    problem: HillSystem,
    tolerance: float = ...,
    method: Method = ...,
    order: int | None = ...,
    harmonics: int | None = ...,
) -> SystemResponse: ...


def steady_state(
    problem: HillProblem | HillSystem,
    tolerance: float = 1e-6,
    method: Method = "auto",
    order: int | None = None,
    harmonics: int | None = None,
) -> Response | SystemResponse:
    """Steady vibration, with a guaranteed bound of its error.

    Parameters
    ----------
    problem : HillProblem or HillSystem
        The equation.
    tolerance : float
        Relative L2 error of the acceleration to be met, 1e-13 to 1.
    method : str
        "auto": small problems directly, by harmonic balance; larger ones by shooting; systems, and
        what is left, by the orders of the expansion recombined by least residual.
        "msm": the plain sum of the orders. "msm least residual" and "harmonic balance": that one.
    order : int, optional
        Number of orders to use, >= 0; by default as many as the tolerance takes. Not for harmonic
        balance.
    harmonics : int, optional
        Highest response harmonic wanted, >= 1; the tolerance and the bound then concern harmonics
        0..harmonics. By default all that the tolerance takes.

    Returns
    -------
    Response or SystemResponse
        Its `error_bound` says what was reached and its `message` why. Where free vibrations grow
        there is no steady state: the periodic solution is returned, with `stable` False
        and an infinite bound.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, or harmonic balance asked for more than memory holds.

    Examples
    --------
    >>> p = HillProblem(0.28, 9e3, 8e8, [0.065], 1.6e-3, 4e3)
    >>> r = steady_state(p)
    >>> r.error_bound < 1e-6, r.stable, r.contact_lost
    (True, True, False)
    >>> plain = steady_state(p, method="msm", order=2)
    >>> 1e-4 < plain.error_bound < 1e-1
    True
    """
    check_arguments(tolerance, harmonics, method, order)
    is_free = method == "auto" and order is None
    if isinstance(problem, HillProblem):
        ratio = problem.frequency_ratio
        if ratio > MOST_RATIO:
            raise ArgumentError(
                f"mass_kg={problem.mass_kg} kg, stiffness_n_per_m={problem.stiffness_n_per_m} N/m, "
                f"period_s={problem.period_s} s: the natural frequency is {ratio:.4g} times that "
                f"of the mesh, and as many harmonics must be solved; allowed is {MOST_RATIO:.0g} "
                "times"
            )
        if problem.damping_ns_per_m == 0 and ratio.is_integer():
            raise ArgumentError(
                f"damping_ns_per_m=0 N s/m: the natural frequency is just {ratio:.0f} times that "
                "of the mesh, a resonance of infinite height; give damping above 0"
            )
        small = direct.solve(problem, tolerance, harmonics) if is_free else None
        if small is not None:
            text = f"small enough to solve directly, harmonics 0 to {small.solved} together: "
            text += _verdict(small.bound, tolerance)
            return _response(problem, small, "harmonic balance", 0, text)
    equations = equations_of(problem, harmonics)
    if isinstance(problem, HillProblem):
        shot = _shot(equations, tolerance) if is_free else None
        if shot is not None:
            text = f"shot round the period, harmonics 0 to {shot.solved}: "
            text += _verdict(shot.bound, tolerance)
            return _response(problem, shot, "shooting", 0, text)
    if method == "msm":
        found = _plain(equations, tolerance, order)
    elif method == "harmonic balance":
        found = widen(equations, tolerance, partial(balance, equations))
    else:
        method, most = "msm least residual", MOST_ORDERS if order is None else order
        improve = partial(recombine, equations, tolerance=tolerance, most=most)
        found = widen(equations, tolerance, improve, repeat=order is None)
    return _respond(problem, equations, found, method, tolerance)


def _shot(equations: MeshEquations, tolerance: float) -> Solution | None:
    """Shoot for the motion of a pair, or None where that does not meet the tolerance."""
    pair, highest = equations.compliance, first_highest(equations, tolerance)
    assert isinstance(pair, PairCompliance)
    if not (equations.gain.stable and equations.pattern.harmonics.any()):
        return None
    for more, by_inverse in ((1.0, False), (1.5, False), (1.5, True)):
        if by_inverse and highest > MOST_OF_A_MATRIX:
            break
        gain = equations.gain_by_inverse if by_inverse else equations.gain.acceleration
        if not math.isfinite(gain):
            continue
        known = np.ones(1), gain[None], equations.pattern, math.ceil(more * highest)
        shot = Shooting(pair, *known).solve(tolerance, equations.shown)
        if shot.relative[0] <= tolerance:
            half, bound = shot.lines[:, 0], float(shot.relative[0])
            return Solution(cut(half, equations.shown), bound, True, len(half) - 1, False)
    return None


def check_arguments(
    tolerance: float, harmonics: int | None, method: str = "auto", order: int | None = None
) -> None:
    """Raise if what is asked for is out of its range."""
    check_range("tolerance", tolerance, 1e-13, 1.0)
    check_word("method=", method, METHODS)
    if order is not None:
        check_range("order", order, 0, 10_000)
        if method == "harmonic balance":
            raise ArgumentError(f"order={order}: harmonic balance has no orders; leave it out")
    if harmonics is not None:
        check_range("harmonics", harmonics, 1, 10_000_000)


def _plain(equations: MeshEquations, tolerance: float, order: int | None) -> Approximation:
    if order is None:
        improve = partial(plain_sum, equations, tolerance=tolerance, order=None)
        found = widen(equations, tolerance, improve, counts_add=False)
    else:
        forced = len(equations.compliance.forces) - 1
        reached = forced + order * equations.pattern.harmonics.shape[-1]
        least = max(1, forced, equations.shown or 1)
        highest = max(least, min(reached, first_highest(equations, 1e-13)))
        found = plain_sum(equations, equations.zeros(highest), tolerance, order)
    return found if found.relative <= tolerance else sharpened(equations, found)


def _response(
    problem: HillProblem, found: Solution, method: str, order: int, message: str
) -> Response:
    """Put an answer into words: `message` is what to say of a steady vibration."""
    response = Response(
        problem=problem,
        displacement=found.displacement,
        error_bound=found.bound if found.stable else math.inf,
        method=method,
        order=order,
        stable=found.stable,
        message=message,
    )
    if problem.damping_ns_per_m == 0:
        return replace(response, message=UNDAMPED)
    if not found.stable:
        return replace(response, message=growing_by(abs(response.floquet_multipliers[0])))
    return response if found.pressed else _with_contact(response)


def _with_contact(response: Response) -> Response:
    """Add to the message where the teeth part, if they do."""
    p, z = response.problem, response.displacement
    squares = lines(0, len(z) - 1) ** 2
    # the mesh force is F + f - m z'': where the lines together stay below F it cannot vanish
    swing = p.mass_kg * p.angular_frequency**2 * float(np.dot(squares, np.abs(z)))
    if len(p.force_harmonics_n):
        swing += float(np.abs(p.force_harmonics_n).sum())
    if 2.001 * swing < abs(p.force_n) or not response.error_bound < 1:
        return response
    angle = response.contact_loss_angle_rad
    if angle is None:
        return response
    lost = (
        f"; teeth lose contact, first at w t = {angle:.4g} rad (least mesh force "
        f"{response.mesh_force_margin:.3g} of its mean): the linear model ends there"
    )
    return replace(response, message=response.message + lost)


def _respond(
    problem: HillProblem | HillSystem,
    equations: MeshEquations,
    found: Approximation,
    method: str,
    tolerance: float,
) -> Response | SystemResponse:
    """Hand out the harmonics asked for, with what there is to say about them."""
    bound, stable = float(found.relative), bool(equations.gain.stable)
    text = f"{_HOW[method].format(found.orders)}, harmonics 0 to {found.highest}: "
    if math.isfinite(bound):
        text += _verdict(bound, tolerance)
    else:
        why = _NO_INVERSE if math.isinf(equations.gain.acceleration) else _TOO_LARGE
        text += f"no error bound could be given ({why})"
    shown = cut(found.motion, equations.shown)
    if isinstance(problem, HillProblem):
        solution = Solution(shown, bound, stable, found.highest, False)
        return _response(problem, solution, method, found.orders, text)
    largest = float(np.abs(equations.multipliers[:1]).max(initial=0.0))
    # forces of springs and dampers of all meshes [N], shape (meshes, N+1): of the swing that these
    # deflections make, one order better than the one they come from
    scale, u = np.sqrt(problem.mesh_stiffness_n_per_m)[:, None], found.deflection
    force: Complex = scale * (u - found.swing - found.residual[:, : u.shape[1]])
    rates = 1j * problem.angular_frequency * np.arange(u.shape[1]) * u
    force += problem.mesh_damping_ns_per_m[:, None] / scale * rates
    return SystemResponse(
        system=problem,
        displacement=shown.T,
        mesh_force=cut(force, equations.shown).T,
        error_bound=bound if stable else math.inf,
        method=method,
        order=found.orders,
        floquet_multipliers=equations.multipliers,
        stable=stable,
        message=text if stable else growing_by(largest),
    )


def _verdict(bound: float, tolerance: float) -> str:
    verdict = "meets" if bound <= tolerance else "misses"
    return f"error bound {bound:.2g} {verdict} the tolerance {tolerance:.2g}"


def growing_by(size: float) -> str:
    """Say that there is no steady state: `size` is the modulus of the largest multiplier."""
    if size <= 1 + SETTLED:
        return (
            "some free vibration never dies out (Floquet multiplier 1): no steady state is reached"
        )
    return (
        f"unstable: free vibrations grow by {size:.6g} a period (largest Floquet multiplier), so "
        "there is no steady state"
    )
