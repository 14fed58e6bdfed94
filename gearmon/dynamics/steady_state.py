"""Steady vibration of Hill's equation by the cheapest method that meets a tolerance."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Literal, get_args, overload

import numpy as np

from gearmon.dynamics import direct, floquet, harmonic_balance, least_residual, multiple_scales
from gearmon.dynamics.band_system import counting
from gearmon.dynamics.certificate import Approximation, Certifier
from gearmon.dynamics.fourier import Complex, rms
from gearmon.dynamics.hill import HillProblem, Response
from gearmon.dynamics.meshes import solve_system
from gearmon.dynamics.system import HillSystem, SystemResponse
from gearmon.errors import ArgumentError, check_range

Method = Literal["auto", "msm", "msm least residual", "harmonic balance"]

MOST_ROUNDS = 12


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
        "auto": small problems directly, by harmonic balance; larger ones by the plain sum of the
        orders of the expansion where that is known to converge fast, else by the orders recombined
        by least residual, then by harmonic balance if they stall; systems by least residual.
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
    _check(tolerance, method, order, harmonics)
    if isinstance(problem, HillSystem):
        return solve_system(problem, tolerance, method, order, harmonics)
    if method == "auto" and order is None:
        solution = direct.solve(problem, tolerance, harmonics)
        if solution is not None:
            return _respond_directly(problem, solution, tolerance)
    certifier = Certifier(problem, harmonics)
    if method == "msm":
        found = _plain(certifier, tolerance, order)
        return _respond(certifier, found, tolerance, "msm")
    if method == "harmonic balance":
        found = _widen(
            certifier, tolerance, lambda z: harmonic_balance.balance(certifier, len(z) - 1)
        )
        return _respond(certifier, found, tolerance, method)
    if (
        method == "auto"
        and order is None
        and (certifier.gain.stable and certifier.convergence < multiple_scales.SLOWEST)
    ):
        found = _widen(
            certifier, tolerance, lambda z: multiple_scales.sum_orders(certifier, z, tolerance)
        )
        if found.bound.relative <= tolerance:
            return _respond(certifier, found, tolerance, "msm")
    improve = _recombining(certifier, tolerance, order)
    found = _widen(certifier, tolerance, improve, repeat=order is None)
    if method == "auto" and order is None and _worth_solving_directly(certifier, found, tolerance):
        solution = direct.solve(problem, tolerance, harmonics, thorough=True)
        if solution is not None and solution.stable and solution.bound < found.bound.relative:
            return _respond_directly(problem, solution, tolerance)
        balanced = harmonic_balance.balance(certifier, found.highest)
        if balanced.bound.relative < found.bound.relative:
            return _respond(certifier, balanced, tolerance, "harmonic balance")
    return _respond(certifier, found, tolerance, "msm least residual")


def _check(tolerance: float, method: str, order: int | None, harmonics: int | None) -> None:
    check_range("tolerance", tolerance, 1e-13, 1.0)
    if method not in get_args(Method):
        raise ArgumentError(f"method={method!r} must be one of: {', '.join(get_args(Method))}")
    if order is not None:
        check_range("order", order, 0, 10_000)
        if method == "harmonic balance":
            raise ArgumentError(f"order={order}: harmonic balance has no orders; leave it out")
    if harmonics is not None:
        check_range("harmonics", harmonics, 1, 10_000_000)


def _plain(certifier: Certifier, tolerance: float, order: int | None) -> Approximation:
    p = certifier.problem
    if order is None:
        found = _widen(
            certifier,
            tolerance,
            lambda z: multiple_scales.plain_sum(certifier, len(z) - 1, tolerance, None),
            counts_add=False,
        )
    else:
        forced = max(1, len(p.force_harmonics_n), certifier.shown or 1)
        all_reached = len(p.force_harmonics_n) + order * len(p.stiffness_harmonics)
        highest = max(forced, min(all_reached, first_highest(certifier, 1e-13)))
        found = multiple_scales.plain_sum(certifier, highest, tolerance, order)
    return found if found.bound.relative <= tolerance else sharpened(certifier, found)


def sharpened(certifier: Certifier, found: Approximation) -> Approximation:
    """Bound a large error by the distance from a good solution, more sharply than by the gain."""
    if not certifier.gain.stable:
        return found
    for _ in range(2):
        wanted = max(1e-12, 0.05 * min(float(found.bound.relative), 0.1))
        better = _widen(certifier, wanted, _recombining(certifier, wanted))
        found = certifier.sharpened(found, better)
    return found


def _recombining(
    certifier: Certifier, tolerance: float, order: int | None = None
) -> Callable[[Complex], Approximation]:
    most = least_residual.MOST_ORDERS if order is None else order
    return lambda z: least_residual.recombine(certifier, z, tolerance, most)


def first_highest(certifier: Certifier, tolerance: float) -> int:
    """Guess the number of harmonics that a tolerance takes.

    The significant stiffness harmonics all appear at first order. Above them and above resonance,
    a line is reached only by jumps of about the mean bandwidth of phi, each of which costs
    max|phi|/|D_n|.
    """
    p = certifier.problem
    sizes = np.abs(p.stiffness_harmonics)
    ratio, swing = p.frequency_ratio, float(certifier.swing)
    top = max(2, math.ceil(1.2 * ratio), len(p.force_harmonics_n), certifier.shown or 1)
    if not sizes.any():
        return top
    orders = np.arange(1, len(sizes) + 1)
    if certifier.shown is not None:
        # a line that is not handed out matters by what it gives to the others
        hidden = np.minimum(1, (ratio / orders) ** 2)
        sizes = np.where(orders > certifier.shown, sizes * hidden, sizes)
    above = np.sqrt(np.cumsum((sizes**2)[::-1]))[::-1]
    top = max(top, int(np.flatnonzero(above > 0.1 * tolerance * above[0])[-1]) + 1)
    jump = max(1, round(float(orders @ sizes / sizes.sum())))
    share = 1.0
    for _ in range(400):
        if share < 3e-3 * tolerance:
            break
        top += jump
        share *= min(0.8, swing / max(1e-9, abs((top / ratio) ** 2 - 1)))
    return top


def _widen(
    certifier: Certifier,
    tolerance: float,
    improve: Callable[[Complex], Approximation],
    repeat: bool = True,
    counts_add: bool = True,
) -> Approximation:
    """Improve and add harmonics in turn, until the tolerance is met or neither helps."""
    dynamic = np.zeros(first_highest(certifier, tolerance) + 1, dtype=complex)
    found = improve(dynamic)
    orders = found.orders
    for _ in range(MOST_ROUNDS if repeat else 0):
        if found.bound.relative <= tolerance:
            break
        highest = _larger(certifier, found, tolerance)
        padding = np.zeros(highest - found.highest, dtype=complex)
        better = improve(np.concatenate([found.dynamic, padding]))
        orders = better.orders + counts_add * orders
        old, found = found, replace(better, orders=orders)
        if highest == old.highest and rms(found.residual) > 0.5 * rms(old.residual):
            break
    return found


def _larger(certifier: Certifier, found: Approximation, tolerance: float) -> int:
    """Find the harmonic beyond which the residual asks for too little to matter."""
    extra = np.abs(certifier.answer(found.residual, found.highest))
    worth = certifier.weights(len(extra) - 1) * (certifier.shown is None)
    gain = float(certifier.gain.acceleration)
    if gain < math.inf:
        worth = worth + gain * certifier.swing
    beyond = np.sqrt(2 * np.cumsum(((worth * extra) ** 2)[::-1]))[::-1]
    allowed = tolerance * found.bound.size
    if beyond[0] <= 0.4 * allowed:
        return found.highest
    needed = int((beyond > 0.1 * allowed).sum())
    return max(needed, found.highest + max(8, found.highest // 4))


def _worth_solving_directly(certifier: Certifier, found: Approximation, tolerance: float) -> bool:
    # the core is what a matrix can mend, and a bound of the inverse that is missing or loose
    known = certifier.gain.acceleration < math.inf
    missed = found.bound.relative > tolerance and bool(certifier.gain.stable)
    inner = found.bound.core + found.bound.rounding
    return bool(missed and not (known and found.bound.above > inner) and found.highest <= 1000)


def _respond_directly(
    problem: HillProblem, solution: direct.Solution, tolerance: float
) -> Response:
    if solution.stable:
        message = (
            f"small enough to solve directly, harmonics 0 to {solution.solved} together: "
            + _verdict(solution.bound, tolerance)
        )
    else:
        ratio, zeta = problem.frequency_ratio, problem.damping_ratio
        message = _growth(floquet.multipliers(ratio, zeta, problem.stiffness_harmonics))
    response = Response(
        problem=problem,
        displacement=solution.displacement,
        error_bound=solution.bound,
        method="harmonic balance",
        order=0,
        stable=solution.stable,
        message=message,
    )
    return response if solution.pressed else _with_contact(response)


def _with_contact(response: Response) -> Response:
    """Add to the message where the teeth part, if they do."""
    p, z = response.problem, response.displacement
    squares = counting(len(z)) ** 2
    # the mesh force is F + f - m z'': where the lines together stay below F it cannot vanish
    swing = p.mass_kg * p.angular_frequency**2 * float(np.dot(squares, np.abs(z)))
    if len(p.force_harmonics_n):
        swing += float(np.abs(p.force_harmonics_n).sum())
    if 2.001 * swing < abs(p.force_n) or not (response.stable and response.error_bound < 1):
        return response
    angle = response.contact_loss_angle_rad
    if angle is None:
        return response
    lost = (
        f"; teeth lose contact, first at w t = {angle:.4g} rad (least mesh force "
        f"{response.mesh_force_margin:.3g} of its mean): the linear model ends there"
    )
    return replace(response, message=response.message + lost)


def _growth(multipliers: tuple[complex, complex]) -> str:
    return (
        f"unstable: free vibrations grow by {abs(multipliers[0]):.6g} a period (largest Floquet "
        "multiplier), so there is no steady state"
    )


def _respond(certifier: Certifier, found: Approximation, tolerance: float, method: str) -> Response:
    """Hand out the harmonics asked for, with what there is to say about them."""
    p = certifier.problem
    z = found.start + found.dynamic
    shown = certifier.shown
    if shown is not None:
        z = np.concatenate([z, np.zeros(max(0, shown + 1 - len(z)))])[: shown + 1]
    stable = p.damping_ns_per_m > 0 and bool(certifier.gain.stable)
    response = Response(
        problem=p,
        displacement=z,
        error_bound=float(found.bound.relative) if stable is not False else math.inf,
        method=method,
        order=found.orders,
        stable=stable,
        message="",
    )
    return _with_contact(replace(response, message=_message(response, found, tolerance)))


def _message(response: Response, found: Approximation, tolerance: float) -> str:
    if response.problem.damping_ns_per_m == 0:
        return "undamped: free vibrations never die out, so no steady state is reached"
    if response.stable is False:
        return _growth(response.floquet_multipliers)
    how = {
        "msm": f"plain expansion to order {found.orders}",
        "msm least residual": f"{found.orders} orders recombined by least residual",
        "harmonic balance": "all harmonics solved together",
    }[response.method]
    text = f"{how}, harmonics 0 to {found.highest}"
    if math.isinf(response.error_bound):
        return f"{text}: no error bound could be given ({_reason(found)})"
    return f"{text}: {_verdict(response.error_bound, tolerance)}"


def _verdict(bound: float, tolerance: float) -> str:
    verdict = "meets" if bound <= tolerance else "misses"
    return f"error bound {bound:.2g} {verdict} the tolerance {tolerance:.2g}"


def _reason(found: Approximation) -> str:
    if math.isinf(found.bound.core):
        return "the inverse operator could not be bounded"
    return "the residual leaves an error as large as the vibration"
