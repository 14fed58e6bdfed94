"""Every method with every setting that takes part in the comparison on one case."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from gearmon.benchmark import compiled, rivals, tuning
from gearmon.benchmark.collocation import Lines, Reference, Samples, solve_reference
from gearmon.benchmark.dynamics_cases import MESH_HARMONICS, Case, named_case
from gearmon.dynamics import HillProblem, Response, steady_state
from gearmon.dynamics.piecewise import PiecewiseProblem, PiecewiseResponse, solve_exactly

#: Relative error of acceleration at which methods are set side by side.
TARGET = 1e-6
OURS = "steady_state"
FROM_REST = "SciPy from rest"
AS_USUAL = "SciPy as usual"
CUT_OFF = "the error is that against the true jumps; a bound would be that of the sum"
NOT_INSTALLED = "numba is not installed"
#: A run expected to take longer is left out [s]; of a hunting period, which runs once, more.
LONGEST_RUN_S = 3.0
LONGEST_HUNTING_RUN_S = 15.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Contender:
    """One method with one setting.

    Parameters
    ----------
    method : str
        Name in tables and pictures.
    group : str
        "gearmon", "SciPy from rest", "SciPy as usual", "SciPy shooting", "compiled", "banded" or
        "exact".
    setting : str
        Tolerance, order, steps or harmonics, in words.
    wanted : float or None
        Relative error aimed at, where the setting was made for one.
    run : callable or None
        What is timed; None if it cannot run, for the reason in `note`.
    motion : callable
        Takes what `run` returned and gives what its error is measured on; not timed.
    note : str
    """

    method: str
    group: str
    setting: str = ""
    wanted: float | None = None
    run: Callable[[], Any] | None = None
    motion: Callable[[Any], Lines | Samples] = lambda found: found
    note: str = ""


def contenders(
    case: Case, reference: Reference, wanted: tuple[float, ...], solvers: tuple[str, ...]
) -> list[Contender]:
    """Return all methods of a case, tuned.

    Parameters
    ----------
    case : Case
    reference : Reference
    wanted : tuple of float
        Relative errors to be met by the methods that can be tuned to one.
    solvers : tuple of str
        Of SciPy.
    """
    own = _for_rectangle(case) if case.rectangle else _own(case, wanted)
    banded = [] if case.rectangle else _banded(case, reference, wanted)
    return [
        *own,
        *_from_rest(case, reference, wanted, solvers),
        *_as_usual(case, reference, solvers),
        *_shooting(case, reference, wanted),
        *_compiled(case, reference, wanted),
        *banded,
    ]


def as_lines(response: Response) -> Lines:
    """Return the harmonics of a response, in units of F/k0."""
    p = response.problem
    return Lines(response.displacement * (p.stiffness_n_per_m / p.force_n))


def _own(case: Case, wanted: tuple[float, ...]) -> Iterator[Contender]:
    p = case.problem
    long = case.meshes > 100
    for tolerance in wanted:
        yield _steady(OURS, p, tolerance, f"tolerance {tolerance:.0e}")
        if not long:
            balance = partial(steady_state, p, tolerance, "harmonic balance")
            yield Contender(
                method="harmonic balance",
                group="gearmon",
                setting=f"tolerance {tolerance:.0e}",
                wanted=tolerance,
                run=balance,
                motion=as_lines,
            )
    # a tolerance of 1 keeps a fixed order from being judged more closely than by its residual
    for order in (1, 2, 3) if long else (1, 2, 3, 4, 6, 8):
        yield _fixed("multiple scales, plain sum", partial(steady_state, p, 1.0, "msm", order))
    for order in (2, 4, 8) if long else (1, 2, 3, 4, 6, 8, 12, 16):
        run = partial(steady_state, p, 1e-8, "msm least residual", order)
        yield _fixed("multiple scales, least residual", run)


def _steady(method: str, p: HillProblem, tolerance: float, setting: str) -> Contender:
    return Contender(
        method=method,
        group="gearmon",
        setting=setting,
        wanted=tolerance,
        run=partial(steady_state, p, tolerance),
        motion=as_lines,
    )


def _fixed(method: str, run: partial[Response]) -> Contender:
    return Contender(
        method=method,
        group="gearmon",
        setting=f"order {run.args[3]}",
        run=run,
        motion=as_lines,
    )


def _for_rectangle(case: Case) -> Iterator[Contender]:
    """Fourier sums of growing length against the true rectangle, and the exact pieces."""
    assert case.rectangle is not None
    for count in (10, 30, 100, 300, 1000):
        p = _cut(case.problem, count)
        run = partial(steady_state, p, TARGET)
        setting = f"{count} stiffness harmonics"
        yield Contender(
            method="steady_state of the Fourier sum",
            group="gearmon",
            setting=setting,
            run=run,
            motion=as_lines,
            note=CUT_OFF,
        )
        yield Contender(
            method="the same, acceleration from forces",
            group="gearmon",
            setting=setting,
            run=partial(_by_forces, p, case.rectangle),
        )
    yield Contender(
        method="exact pieces",
        group="exact",
        setting="256 points",
        wanted=TARGET,
        run=partial(_exactly, case.rectangle),
    )


def _cut(p: HillProblem, count: int) -> HillProblem:
    return HillProblem(
        p.mass_kg,
        p.damping_ns_per_m,
        p.stiffness_n_per_m,
        p.stiffness_harmonics[:count],
        p.period_s,
        p.force_n,
    )


def _by_forces(p: HillProblem, true: PiecewiseProblem, points: int = 1024) -> Samples:
    """Take the acceleration from F - c v - k z with the true k: z and v have no jumps."""
    response = steady_state(p, TARGET)
    half = (np.arange(points) + 0.5) / points
    turn = np.exp(1j * math.pi * np.arange(len(response.displacement)) / points)
    length = max(points, 2 * points * math.ceil(len(turn) / points))
    step = length // points
    z, v = (
        np.fft.irfft(part * turn, length, norm="forward")[::step]
        for part in (response.displacement, response.velocity)
    )
    ends = np.cumsum(true.durations_s) / true.period_s
    piece = np.searchsorted(ends, (half - true.start_s / true.period_s) % 1.0, side="right")
    k = true.stiffness_n_per_m[piece]
    force = p.force_n - p.damping_ns_per_m * v - k * z
    return Samples(half, force / p.mass_kg * _per_unit(p))


def _exactly(true: PiecewiseProblem, points: int = 256) -> Samples:
    share = np.arange(points) / points
    response: PiecewiseResponse = solve_exactly(true, 1)
    acceleration = response.at(share * true.period_s, "acceleration")
    return Samples(share, acceleration * (true.mass_kg / true.mean_force_n))


def _per_unit(p: HillProblem) -> float:
    """Acceleration in units of w0^2 F/k0 = F/m."""
    return p.mass_kg / p.force_n


def _from_rest(
    case: Case, reference: Reference, wanted: tuple[float, ...], solvers: tuple[str, ...]
) -> Iterator[Contender]:
    oscillator = rivals.Oscillator(case)
    long = case.meshes > 100
    for solver in solvers:
        method = f"SciPy {solver}"
        known = _map_of(case, oscillator, reference, solver, min(wanted))
        for error in (TARGET,) if long else wanted:
            settling = reference.settling(tuning.SETTLED_SHARE * error)
            periods = 1 + settling / oscillator.period
            longest = LONGEST_HUNTING_RUN_S if long else LONGEST_RUN_S
            expected = known.time_s(error) * periods
            if long:
                expected *= case.meshes / 26
            if expected > longest:
                yield Contender(
                    method=method,
                    group=FROM_REST,
                    setting=f"for {error:.0e}",
                    note=f"not run: about {expected:.0f} s expected",
                )
                continue
            tolerance = known.tolerance(0.6 * error)
            run = partial(rivals.integrate, oscillator, solver, settling=settling)
            if error == TARGET and not long:
                tolerance = tuning.tuned_tolerance(
                    tolerance, error, partial(_error_of, reference, run)
                )
            yield Contender(
                method=method,
                group=FROM_REST,
                setting=f"tolerance {tolerance:.1e}, {periods - 1:.2f} periods to settle",
                wanted=error,
                run=partial(run, tolerance),
            )


def _as_usual(case: Case, reference: Reference, solvers: tuple[str, ...]) -> Iterator[Contender]:
    """Plain use of solve_ivp: stiffness as a sum in NumPy, from z = 0; at the target only."""
    if case.rectangle is not None or case.meshes > 100:
        return
    oscillator = rivals.PlainOscillator(case)
    settling = reference.settling(tuning.SETTLED_SHARE * TARGET, deflection=0.0)
    run = partial(rivals.integrate, oscillator, state=(0.0, 0.0), settling=settling)
    for solver in ("DOP853", "LSODA"):
        if solver not in solvers:
            continue
        one = partial(run, solver)
        known = tuning.tolerance_map(oscillator, reference, solver, 0.5 * TARGET)
        tolerance = tuning.tuned_tolerance(
            known.tolerance(0.6 * TARGET), TARGET, partial(_error_of, reference, one)
        )
        periods = settling / oscillator.period
        yield Contender(
            method=f"SciPy {solver}, as usually written",
            group=AS_USUAL,
            setting=f"tolerance {tolerance:.1e}, {periods:.2f} periods to settle",
            wanted=TARGET,
            run=partial(one, tolerance),
        )


def _error_of(reference: Reference, run: Callable[[float], Samples], setting: float) -> float:
    return reference.error(run(setting))


def _map_of(
    case: Case, oscillator: rivals.Oscillator, reference: Reference, solver: str, finest: float
) -> tuning.ToleranceMap:
    """Errors over tolerances; of a hunting period those of one turn with a cracked tooth."""
    if case.meshes > 100:
        turn = named_case("cracked tooth")
        return tuning.tolerance_map(
            rivals.Oscillator(turn), solve_reference(turn), solver, 0.1 * TARGET
        )
    return tuning.tolerance_map(oscillator, reference, solver, 0.5 * finest)


def _shooting(case: Case, reference: Reference, wanted: tuple[float, ...]) -> Iterator[Contender]:
    if case.meshes > 100:
        return
    oscillator = rivals.Oscillator(case)
    for error in wanted:
        tolerance = tuning.tuned_tolerance(
            0.1 * error, error, lambda t: reference.error(rivals.shoot(oscillator, t))
        )
        yield Contender(
            method="SciPy DOP853, shooting",
            group="SciPy shooting",
            setting=f"tolerance {tolerance:.1e}",
            wanted=error,
            run=partial(rivals.shoot, oscillator, tolerance),
        )


def _compiled(case: Case, reference: Reference, wanted: tuple[float, ...]) -> Iterator[Contender]:
    names = {True: "compiled RK4 from rest", False: "compiled RK4, shooting"}
    if not compiled.is_installed():
        for name in names.values():
            yield Contender(method=name, group="compiled", note=NOT_INSTALLED)
        return
    p = case.problem
    long = case.meshes > 100
    tuned: dict[float, int] = {}
    for rest, name in names.items():
        for error in (1e-4, TARGET) if long else wanted:
            settling = reference.settling(tuning.SETTLED_SHARE * error) if rest else None
            # over a long period a settled motion and a periodic one have the same error
            if error not in tuned or not long:
                tuned[error] = tuning.tuned_steps(
                    case, error, tuning.compiled_error(case, reference, settling)
                )
            steps = tuned[error]
            table = compiled.tables(case, steps)
            common = (table, p.frequency_ratio, p.damping_ratio)
            run = (
                partial(compiled.shoot, *common)
                if settling is None
                else partial(compiled.march, *common, settling)
            )
            yield Contender(
                method=name,
                group="compiled",
                setting=f"{steps} steps a period",
                wanted=error,
                run=run,
            )


def _banded(case: Case, reference: Reference, wanted: tuple[float, ...]) -> Iterator[Contender]:
    p = case.problem
    method, group = "solve_banded", "banded"
    start = math.ceil(p.frequency_ratio) + MESH_HARMONICS
    needed = rivals.banded_bytes(len(p.stiffness_harmonics), start)
    if needed > rivals.BYTES_ALLOWED:
        note = f"not run: the band matrix needs more than {needed / 1e9:.0f} GB"
        yield Contender(method=method, group=group, note=note)
        return

    def error_at(highest: int) -> float:
        bands = rivals.band(p.stiffness_harmonics, highest)
        return reference.error(rivals.solve_band(bands, p.frequency_ratio, p.damping_ratio))

    for error in wanted:
        highest = tuning.fewest_harmonics(error, start, error_at)
        bands = rivals.band(p.stiffness_harmonics, highest)
        yield Contender(
            method=method,
            group=group,
            setting=f"{highest} harmonics",
            wanted=error,
            run=partial(rivals.solve_band, bands, p.frequency_ratio, p.damping_ratio),
        )
