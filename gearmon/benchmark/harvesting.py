"""Tuning over a design sweep beside time integration; one optimum beside brute force."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.benchmark.timing import task_time
from gearmon.benchmark.whole_process import machine_facts
from gearmon.dynamics.hill import HillProblem
from gearmon.dynamics.integration import settle
from gearmon.dynamics.sweep import sweep
from gearmon.harvesting.answer import OperatingShare, mean_power_w
from gearmon.harvesting.cantilever import PiezoCantilever
from gearmon.harvesting.inertial import InertialHarvester
from gearmon.harvesting.request import built_in
from gearmon.harvesting.tuning import tune_harvester
from gearmon.harvesting.tuning_sweep import SweepTuning, tune_sweep
from gearmon.harvesting.vibration import vibration_of_lines
from gearmon.terminal import Progress

Real = npt.NDArray[np.float64]

# Reference pair of the source study: mesh period [s], force [N], square wave of +-13 %.
PERIOD_S, FORCE_N = 1.6e-3, 4.0e3
ODD = np.arange(1, 20, 2)
VARIATION = np.zeros(19)
VARIATION[ODD - 1] = 0.13 * (2 / math.pi) * (-1.0) ** ((ODD - 1) // 2) / ODD
STIFFNESS = 1e8 * np.array([2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0])
MASS = np.array([0.2, 0.28, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 3.0])
DAMPING = 1e3 * np.array([3.0, 6.0, 9.0, 12.0, 15.0, 18.0, 30.0, 60.0, 90.0])
HIGHEST_HZ = 12_000.0
#: Lines that the time integration tries to tune to, the most energetic ones of each set.
TRIED_LINES = 5
#: Ring-downs that a harvester is integrated for.
RING_DOWNS = 7.0


def time_harvesting(progress: Progress | None = None, quick: bool = False) -> list[dict[str, Any]]:
    """Measure the tuned design sweep and the optimum of a single tuning.

    Parameters
    ----------
    progress : callable, optional
        Called with the share done, 0 to 1.
    quick : bool
        One set by time integration and a coarse grid.

    Returns
    -------
    list of dict
        ``case``, ``sets``, ``time_s``, ``rival``, ``rival_time_s`` (of all sets, from a sample),
        ``rival_sample``, ``ratio`` of times and ``power_ratio``, ours over the rival's.
    """
    tell = progress or (lambda _: None)
    rows = [_sweep_row(1 if quick else 6, tell)]
    rows += [_optimum_row(harvester, quick) for harvester in (_inertial(), built_in()[0])]
    tell(1.0)
    facts = machine_facts()
    return [row | facts for row in rows]


def _sweep_row(sample: int, tell: Progress) -> dict[str, Any]:
    _swept()  # plans and caches, as in any longer run
    seconds, found = task_time(_swept)
    rng = np.random.default_rng(0)
    chosen = rng.choice(found.power_w.size, sample, replace=False)
    spent, ratios = [], []
    for number, index in enumerate(chosen):
        place = tuple(int(i) for i in np.unravel_index(index, found.power_w.shape))
        taken, power = task_time(partial(_integrated, place))
        spent.append(taken)
        ratios.append(float(found.power_w[place]) / power)
        tell(0.8 * (number + 1) / sample)
    whole = float(np.mean(spent)) * found.power_w.size
    return {
        "case": "design sweep, 8 stiffnesses x 9 masses x 9 dampings, each tuned",
        "sets": found.power_w.size,
        "time_s": seconds,
        "rival": "time integration of pair and harvester (SciPy LSODA, DOP853)",
        "rival_time_s": whole,
        "rival_sample": sample,
        "ratio": whole / seconds,
        "power_ratio": float(np.median(ratios)),
    }


def _swept() -> SweepTuning:
    found = sweep(
        MASS[:, None],
        DAMPING,
        STIFFNESS[:, None, None],
        VARIATION,
        PERIOD_S,
        FORCE_N,
        tolerance=1e-6,
    )
    count = min(found.displacement.shape[-1] - 1, int(HIGHEST_HZ * PERIOD_S))
    frequency = np.arange(1, count + 1) / PERIOD_S
    power = 2 * np.abs(found.acceleration[..., 1 : count + 1]) ** 2
    return tune_sweep(_inertial(), frequency, power)


def _integrated(place: tuple[int, ...]) -> float:
    """Best mean power [W] of one set: march the pair, then a harvester at each strong line."""
    problem = HillProblem(
        float(MASS[place[1]]),
        float(DAMPING[place[2]]),
        float(STIFFNESS[place[0]]),
        VARIATION.astype(complex),
        PERIOD_S,
        FORCE_N,
    )
    count = int(HIGHEST_HZ * PERIOD_S)
    lines = settle(problem, count, 1e-6).acceleration
    order = np.arange(1, count + 1)
    energy = np.abs(lines[1:]) ** 2 / order**2
    best = 0.0
    for line in order[np.argsort(-energy)[:TRIED_LINES]]:
        harvester = _inertial().retuned(line / PERIOD_S)
        harvester = harvester.with_load(harvester.mechanical_damping_ratio)
        best = max(best, _marched(harvester, lines))
    return best


def _marched(harvester: InertialHarvester, lines: npt.NDArray[np.complex128]) -> float:
    """Mean power [W] in the last mesh period of a march through the ring-down."""
    from scipy.integrate import solve_ivp

    natural = 2 * math.pi * harvester.natural_frequency_hz
    total = harvester.mechanical_damping_ratio + harvester.electrical_damping_ratio
    angular = 2 * math.pi / PERIOD_S * np.arange(1, len(lines))

    def rates(t: float, state: Real) -> list[float]:
        push = 2 * float((lines[1:] * np.exp(1j * angular * t)).real.sum())
        swing = -push - 2 * total * natural * state[1] - natural**2 * state[0]
        return [float(state[1]), swing]

    periods = math.ceil(RING_DOWNS / (total * natural) / PERIOD_S)
    end = periods * PERIOD_S
    times = np.linspace(end - PERIOD_S, end, 401)[:-1]
    marched = solve_ivp(rates, (0.0, end), [0.0, 0.0], "DOP853", times, rtol=1e-6, atol=1e-12)
    damper = 2 * harvester.mass_kg * harvester.electrical_damping_ratio * natural
    return float(damper * np.mean(marched.y[1] ** 2))


def _optimum_row(harvester: InertialHarvester | PiezoCantilever, quick: bool) -> dict[str, Any]:
    duty = _duty()
    tune_harvester(harvester, duty)
    seconds, found = task_time(lambda: tune_harvester(harvester, duty))
    frequencies, loads = (200, 10) if quick else (3000, 24)
    rival_s, best = task_time(lambda: _brute_force(harvester, duty, frequencies, loads))
    return {
        "case": f"optimum of one tuning, {type(harvester).__name__}",
        "sets": 1,
        "time_s": seconds,
        "rival": f"brute force, {frequencies} frequencies x {loads} loads",
        "rival_time_s": rival_s,
        "rival_sample": 1,
        "ratio": rival_s / seconds,
        "power_ratio": found.power_w / best,
    }


def _brute_force(
    harvester: InertialHarvester | PiezoCantilever,
    duty: list[OperatingShare],
    frequencies: int,
    loads: int,
) -> float:
    low, high = harvester.frequency_range_hz
    best = 0.0
    for frequency in np.geomspace(low, high, frequencies):
        tuned = harvester.retuned(float(min(frequency, high)))
        least, most = tuned.load_range
        for load in np.geomspace(least, most, loads):
            best = max(best, mean_power_w(tuned.with_load(float(load)), duty))
    return best


def _duty() -> list[OperatingShare]:
    """Two operating points of five mesh harmonics with four sidebands to either side."""
    rng = np.random.default_rng(1)
    frequency = np.concatenate([540.0 * k + 18.0 * np.arange(-4, 5) for k in range(1, 6)])
    amplitude = rng.lognormal(-1, 1, frequency.size)
    full = vibration_of_lines(frequency, acceleration_ms2=amplitude)
    part = vibration_of_lines(0.6 * frequency, acceleration_ms2=0.5 * amplitude)
    return [
        OperatingShare(vibration=full, share=0.8),
        OperatingShare(vibration=part, share=0.2),
    ]


def _inertial() -> InertialHarvester:
    return InertialHarvester(
        mass_kg=5e-3, natural_frequency_hz=625.0, lowest_hz=300.0, highest_hz=20_000.0
    )
