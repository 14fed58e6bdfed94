"""Vibration by time integration: transients, the settled motion, and the periodic one by shooting.

SciPy's solvers are restarted wherever the stiffness jumps. They need no theory, give no error
bound, and are the only way here to follow teeth that part: with ``contact="one-sided"`` the mesh
force is max(0, k z + c z') (counted in the direction of the mean force), so that the mass flies
freely until the spring and damper would press again. Backlash, and contact of the back flanks,
are not modelled.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from gearmon.dynamics.fourier import Real
from gearmon.dynamics.time_marching import (
    Contact,
    IntegratedResponse,
    Integrator,
    March,
    Periodic,
    Scaled,
    TimeHistory,
    defect_of,
    history,
    response,
    scaled,
)
from gearmon.errors import ArgumentError, check_finite, check_range

Start = Literal["rest", "static"] | tuple[float, float]


def transient(
    problem: Periodic,
    periods: int,
    start: Start = "rest",
    integrator: Integrator | None = None,
    contact: Contact = "tied",
    points: int = 256,
) -> TimeHistory:
    """Vibration after t = 0.

    Parameters
    ----------
    problem : HillProblem or PiecewiseProblem
        The equation.
    periods : int
        Length, 1 to 1,000,000 periods.
    start : {"rest", "static"} or (float, float)
        State at t = 0: z = z' = 0; the static deflection F/k0; or (z [m], z' [m/s]).
    integrator : Integrator, optional
        By default DOP853 with a relative tolerance of 1e-9.
    contact : {"tied", "one-sided"}
        "tied": the linear equation, also where it pulls. "one-sided": the teeth may part.
    points : int
        Points a period, >= 2.

    Returns
    -------
    TimeHistory
        At t = 0, T/points, ... up to the end.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, or the solver fails.

    Examples
    --------
    >>> from gearmon.dynamics import HillProblem
    >>> p = HillProblem(0.28, 9e3, 8e8, [0.065], 1.6e-3, 4e3)
    >>> h = transient(p, 2, points=4)
    >>> h.time_s.shape, float(h.displacement[0]), float(round(h.acceleration[0]))
    ((9,), 0.0, 14286.0)
    """
    check_range("periods", periods, 1, 1_000_000)
    check_range("points", points, 2, 10_000_000)
    system = scaled(problem)
    march = _begun(system, start, integrator, contact)
    legs = march.periods(int(periods), keep=True)
    s: Real = np.arange(periods * points + 1, dtype=np.float64)
    return history(march, legs, s * (system.period / points))


def settle(
    problem: Periodic,
    harmonics: int,
    tolerance: float = 1e-6,
    start: Start = "rest",
    integrator: Integrator | None = None,
    contact: Contact = "tied",
    most_periods: int = 100_000,
    points: int = 256,
) -> IntegratedResponse:
    """Integrate until the vibration repeats from period to period.

    The slowest free vibration of the mean stiffness says how many periods the tolerance takes;
    then periods are added until the change of state over one, divided by 1 - e^{-decay}, meets it.

    Parameters
    ----------
    problem, start, integrator, contact, points
        As in `transient`; by default the integrator is a hundred times more accurate than the
        tolerance.
    harmonics : int
        Highest harmonic wanted, >= 1.
    tolerance : float
        Remaining change, relative to the rms swing of the state, 1e-13 to 1.
    most_periods : int
        After so many the search ends, and `stable` says None.

    Returns
    -------
    IntegratedResponse

    Raises
    ------
    ArgumentError
        If an argument is out of its range, the solver fails, or nothing damps the vibration.
    """
    check_range("harmonics", harmonics, 1, 1_000_000)
    check_range("tolerance", tolerance, 1e-13, 1.0)
    check_range("most_periods", most_periods, 2, 10_000_000)
    if problem.damping_ns_per_m == 0:
        raise ArgumentError(
            "damping_ns_per_m=0: free vibrations never die out; use transient() or give damping"
        )
    if integrator is None:
        integrator = Integrator(
            relative_tolerance=max(2.3e-14, tolerance / 100), absolute_tolerance=tolerance / 1e4
        )
    system = scaled(problem)
    march = _begun(system, start, integrator, contact)
    decay = slowest_decay(system.zeta) * system.period
    wait = min(most_periods, 2 + math.ceil(math.log(10 / tolerance) / decay))
    march.periods(wait - 1, keep=False)
    done = wait - 1
    while True:
        before = list(march.state)
        legs = march.periods(1, keep=True)
        done += 1
        defect = defect_of(before, march.state, legs, system)
        settled = defect <= tolerance * -math.expm1(-decay)
        if settled or done >= most_periods or not math.isfinite(defect):
            break
        more = min(max(1, wait // 4), most_periods - done)
        march.periods(more - 1, keep=False)
        done += more - 1
    message = (
        f"{done} periods by {integrator.solver}: state repeats to {defect:.2g} of its swing"
        if settled
        else f"after {done} periods the state still changes by {defect:.3g} of its swing a period"
    )
    stable = True if settled else None
    return response(march, legs, harmonics, points, done, defect, stable, None, message)


def slowest_decay(zeta: float) -> float:
    """Decay rate of the slowest free vibration on the mean stiffness, over w0.

    Examples
    --------
    >>> slowest_decay(0.3), slowest_decay(1.25)
    (0.3, 0.5)
    """
    return zeta if zeta <= 1 else 1 / (zeta + math.sqrt(zeta**2 - 1))


def shoot(
    problem: Periodic,
    harmonics: int,
    integrator: Integrator | None = None,
    points: int = 256,
) -> IntegratedResponse:
    """Periodic vibration from one period of integration.

    The state after a period depends linearly on that before it. Two free vibrations and one
    forced one give that map, whose fixed point starts the periodic motion; only the linear
    equation (tied teeth) has it so.

    Parameters
    ----------
    problem, integrator, points
        As in `transient`.
    harmonics : int
        Highest harmonic wanted, >= 1.

    Returns
    -------
    IntegratedResponse
        Errors of the integration are magnified by about 1/|1 - multiplier|. Where free vibrations
        grow, the (unstable) periodic motion is returned with `stable` False.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, the solver fails, or there is no periodic motion.

    Examples
    --------
    >>> from gearmon.dynamics import HillProblem, steady_state
    >>> p = HillProblem(0.28, 9e3, 8e8, [0.065], 1.6e-3, 4e3)
    >>> found, exact = shoot(p, 5), steady_state(p, 1e-10)
    >>> bool(abs(found.displacement - exact.displacement[:6]).max() < 1e-8 * 5e-6)
    True
    """
    check_range("harmonics", harmonics, 1, 1_000_000)
    integrator = integrator or Integrator()
    system = scaled(problem)
    matrix, moved, evaluations = _period_map(system, integrator)
    try:
        state = np.linalg.solve(np.eye(2) - matrix, moved)
    except np.linalg.LinAlgError:
        raise ArgumentError(
            "a free vibration returns after a period: there is no single periodic motion; "
            "give damping_ns_per_m a value > 0"
        ) from None
    march = March(system=system, integrator=integrator, contact="tied", s=0.0, state=state.tolist())
    legs = march.periods(1, keep=True)
    march.evaluations += evaluations
    defect = defect_of(list(state), march.state, legs, system)
    values = sorted(np.linalg.eigvals(matrix), key=abs, reverse=True)
    pair = (complex(values[0]), complex(values[1]))
    stable = abs(pair[0]) < 1
    message = f"periodic state by {integrator.solver} over one period, repeats to {defect:.2g}"
    if not stable:
        message = (
            f"unstable: free vibrations grow by {abs(pair[0]):.6g} a period (largest Floquet "
            "multiplier), so there is no steady state"
        )
    return response(march, legs, harmonics, points, 1, defect, stable, pair, message)


def _period_map(system: Scaled, integrator: Integrator) -> tuple[Real, Real, int]:
    """M and b of x -> M x + b over a period, and the calls it took."""
    columns, evaluations = [], 0
    for start in ([0.0, 0.0], [1.0, 0.0], [0.0, 1.0]):
        march = March(system=system, integrator=integrator, contact="tied", s=0.0, state=start)
        march.periods(1, keep=False)
        columns.append(np.array(march.state))
        evaluations += march.evaluations
    moved = columns[0]
    return np.array([columns[1] - moved, columns[2] - moved]).T, moved, evaluations


def _begun(system: Scaled, start: Start, integrator: Integrator | None, contact: Contact) -> March:
    if contact not in ("tied", "one-sided"):
        raise ArgumentError(f"contact={contact!r} must be tied or one-sided")
    if isinstance(start, str):
        if start not in ("rest", "static"):
            raise ArgumentError(f"start={start!r} must be rest, static or a pair (z, z')")
        state = [0.0 if start == "rest" else system.mean, 0.0]
    else:
        z, v = start
        check_finite("start", z, "m")
        check_finite("start", v, "m/s")
        state = [z / system.size_m, v / (system.size_m * system.w0)]
    return March(
        system=system, integrator=integrator or Integrator(), contact=contact, s=0.0, state=state
    )
