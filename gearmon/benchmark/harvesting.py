"""Tuning beside time integration of pair and harvester, and beside brute force."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.benchmark.equations import FORCE_N, PERIOD_S, Case, square_wave
from gearmon.benchmark.rivals import Oscillator
from gearmon.benchmark.timing import task_time
from gearmon.dynamics.hill import HillProblem
from gearmon.dynamics.steady_state import steady_state
from gearmon.harvesting.harvester import Harvester, InertialHarvester
from gearmon.harvesting.request import built_in
from gearmon.harvesting.response import mean_power_w
from gearmon.harvesting.tuning import tune_harvester
from gearmon.harvesting.vibration import OperatingShare, Points, vibration_of_lines
from gearmon.terminal import Progress

Real = npt.NDArray[np.float64]
Row = dict[str, Any]

# Of the source study, about its reference pair.
STIFFNESS = 1e8 * np.array([2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0])
MASS = np.array([0.2, 0.28, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 3.0])
DAMPING = 1e3 * np.array([3.0, 6.0, 9.0, 12.0, 15.0, 18.0, 30.0, 60.0, 90.0])
HIGHEST_HZ = 12_000.0
#: Natural frequencies and loads of the grid for brute force: a tenth of a damping ratio and
#: 15 to 35 % apart.
FINE_GRID = (5000, 48)
REPEATS = 7
#: Lines that the time integration tries to tune to, the most energetic ones of each set.
TRIED_LINES = 5
#: What is left of the start when the pair has settled.
SETTLED = 1e-7
#: Time constants of its ring-down that a harvester is integrated for, and steps of a mesh period.
RING_DOWNS, STEPS = 7.0, 1024


def time_harvesting(progress: Progress | None = None, quick: bool = False) -> list[Row]:
    """Measure the tuning of gear pairs' lines and the optimum of a single tuning.

    Parameters
    ----------
    progress : callable, optional
        Called with the share done, 0 to 1.
    quick : bool
        One pair and a coarse grid.

    Returns
    -------
    list of dict
        ``case``, ``sets``, ``time_s`` and ``rival_time_s`` of one, ``rival``, ``ratio`` of times
        and ``power_ratio``, ours over the rival's.
    """
    tell = progress or (lambda _: None)
    rows = [_pairs_row(1 if quick else 6, tell)]
    rows += [_optimum_row(harvester, quick) for harvester in (_inertial(), built_in()[0])]
    tell(1.0)
    return rows


def _pairs_row(sample: int, tell: Progress) -> Row:
    rng = np.random.default_rng(0)
    times, ratios = [], []
    for number in range(sample):
        mass, damping, stiffness = (float(rng.choice(v)) for v in (MASS, DAMPING, STIFFNESS))
        known = mass, damping, stiffness, square_wave(19)
        problem = HillProblem(*known, PERIOD_S, FORCE_N)
        _tuned_power(problem)  # plans and caches, as in any longer run
        runs = [task_time(partial(_tuned_power, problem)) for _ in range(REPEATS)]
        spent, power = task_time(partial(_integrated, problem))
        times.append((float(np.median([taken for taken, _ in runs])), spent))
        ratios.append(runs[0][1] / power)
        tell(0.8 * (number + 1) / sample)
    ours, rival_s = np.mean(times, axis=0).tolist()
    rival = "time integration of pair and harvester (SciPy LSODA, exact steps)"
    power = float(np.median(ratios))
    return _row("lines of a gear pair and their tuning", sample, ours, rival, rival_s, power)


def _row(case: str, sets: int, ours: float, rival: str, rival_s: float, power: float) -> Row:
    row: Row = {"case": case, "sets": sets, "time_s": ours, "rival": rival}
    return row | {"rival_time_s": rival_s, "ratio": rival_s / ours, "power_ratio": power}


def _tuned_power(problem: HillProblem) -> float:
    """Mean power [W] of the harvester that is tuned to the lines of a pair."""
    lines = steady_state(problem, 1e-6).acceleration
    count = min(len(lines) - 1, int(HIGHEST_HZ * PERIOD_S))
    shaking = vibration_of_lines(
        np.arange(1, count + 1) / PERIOD_S, acceleration_ms2=2 * np.abs(lines[1 : count + 1])
    )
    return tune_harvester(_inertial(), shaking).power_w


def _integrated(problem: HillProblem) -> float:
    """Best mean power [W] of one pair: march it, then a harvester at each strong line."""
    count = int(HIGHEST_HZ * PERIOD_S)
    lines = _settled(problem, count)
    order = np.arange(1, count + 1)
    energy = np.abs(lines[1:]) ** 2 / order**2
    tried = [_inertial().retuned(n / PERIOD_S) for n in order[np.argsort(-energy)[:TRIED_LINES]]]
    return max(_marched(own.with_load(own.mechanical_damping_ratio), lines) for own in tried)


def _settled(problem: HillProblem, count: int) -> npt.NDArray[np.complex128]:
    """Acceleration lines 0..count [m/s2] of a pair marched from its static deflection."""
    from scipy.integrate import solve_ivp

    one = Oscillator(Case(name="pair", problem=problem))
    zeta, period = one.zeta, one.period
    slowest = min(zeta, 1 / (zeta + math.sqrt(max(0.0, zeta**2 - 1))))
    rest = math.ceil(math.log(1 / SETTLED) / (slowest * period)) * period
    times = rest + period * np.arange(8 * count) / (8 * count)
    z, v = solve_ivp(
        one.slope(None), (0.0, times[-1]), (1.0, 0.0), "DOP853", times, rtol=1e-8, atol=1e-10
    ).y
    acceleration = 1.0 - 2 * zeta * v - one.stiffness_at(times) * z
    lines = np.fft.rfft(acceleration, norm="forward")[: count + 1]
    return np.asarray(lines * (problem.force_n / problem.mass_kg))


def _marched(harvester: InertialHarvester, lines: npt.NDArray[np.complex128]) -> float:
    """Mean power [W] in the last mesh period of a march through the ring-down.

    The strongest march there is for a linear harvester on a given motion: the exact step between
    samples with the acceleration linear in between, as a recursive filter in compiled code.
    """
    from scipy.signal import cont2discrete, lfilter

    natural = 2 * math.pi * harvester.natural_frequency_hz
    total = harvester.mechanical_damping_ratio + harvester.electrical_damping_ratio
    step = PERIOD_S / STEPS
    velocity = ([-1.0, 0.0], [1.0, 2 * total * natural, natural**2])
    above, below, _ = cont2discrete(velocity, step, "foh")
    periods = math.ceil(RING_DOWNS / (total * natural) / PERIOD_S)
    padded = np.zeros(STEPS // 2 + 1, dtype=np.complex128)
    padded[1 : len(lines)] = lines[1:]
    push = np.tile(STEPS * np.fft.irfft(padded, STEPS), periods)
    speed = lfilter(np.ravel(above), below, push)[-STEPS:]
    damper = 2 * harvester.mass_kg * harvester.electrical_damping_ratio * natural
    return float(damper * np.mean(speed**2))


def _optimum_row(harvester: Harvester, quick: bool) -> Row:
    duty = _duty()
    tune_harvester(harvester, duty)
    frequencies, loads = (200, 10) if quick else FINE_GRID
    ours, rivals = [], []
    for _ in range(1 if quick else REPEATS):
        ours.append(task_time(lambda: tune_harvester(harvester, duty)))
        rivals.append(task_time(lambda: _brute_force(harvester, duty, frequencies, loads)))
    seconds, rival_s = (float(np.median([t for t, _ in runs])) for runs in (ours, rivals))
    case = f"optimum of one tuning, {type(harvester).__name__}"
    rival = f"brute force, {frequencies} frequencies x {loads} loads"
    return _row(case, 1, seconds, rival, rival_s, ours[0][1].power_w / rivals[0][1])


def _brute_force(harvester: Harvester, duty: Points, frequencies: int, loads: int) -> float:
    """Largest power on a grid, all loads of a natural frequency at once."""
    low, high = harvester.frequency_range_hz
    grid = np.minimum(np.geomspace(low, high, frequencies), high).tolist()
    tuned = [harvester.retuned(frequency) for frequency in grid]
    powers = [mean_power_w(own, duty, np.geomspace(*own.load_range, loads)) for own in tuned]
    return float(np.max(powers))


def _duty() -> Points:
    """Two operating points of five mesh harmonics with four sidebands to either side."""
    rng = np.random.default_rng(1)
    frequency = np.concatenate([540.0 * k + 18.0 * np.arange(-4, 5) for k in range(1, 6)])
    amplitude = rng.lognormal(-1, 1, frequency.size)
    full = vibration_of_lines(frequency, acceleration_ms2=amplitude)
    part = vibration_of_lines(0.6 * frequency, acceleration_ms2=0.5 * amplitude)
    return OperatingShare(vibration=full, share=0.8), OperatingShare(vibration=part, share=0.2)


def _inertial() -> InertialHarvester:
    return InertialHarvester(
        mass_kg=5e-3, natural_frequency_hz=625.0, lowest_hz=300.0, highest_hz=20_000.0
    )
