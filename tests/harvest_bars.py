"""How near harvesting comes to marching, and how often its interval holds: long, by hand.

    python tests/harvest_bars.py marching --count 60
    python tests/harvest_bars.py ranking --count 60
    python tests/harvest_bars.py days --count 200

Quick rounds run with the tests. Marching is that of `reference.marching`: finite elements or the
equations of the spring, step by step under the same recording, knowing nothing of filters.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from reference.marching import marched_answer
from scipy.signal import lfilter

from gearmon.harvesting import CoilHarvester, InertialHarvester, survey_measured
from gearmon.harvesting.harvester import Harvester
from gearmon.harvesting.placement import Survey
from gearmon.harvesting.response import mean_power_w, respond
from gearmon.harvesting.tuning import built_in
from gearmon.harvesting.vibration import OperatingShare, vibration_of_samples
from gearmon.machine import Machine, OperatingPoint, ParallelStage
from gearmon.signals.recording import Recording

MACHINE = Machine(
    name="rig",
    operating=(OperatingPoint(speed_rpm=900.0),),
    stages=(ParallelStage(pinion_teeth=20, gear_teeth=41),),
)
SPRING = InertialHarvester(mass_kg=5e-3, natural_frequency_hz=90.0, lowest_hz=81.0, highest_hz=99.0)
COIL = CoilHarvester(
    mass_kg=0.02,
    natural_frequency_hz=61.0,
    mechanical_damping_ratio=0.003,
    lowest_hz=55.0,
    highest_hz=67.0,
    turns=800.0,
    field_length_tm=8e-3,
    coil_ohm=80.0,
)
BEAM = replace(built_in()[0], most_tip_mass_kg=0.015, clearance_m=math.inf)
HARVESTERS = {
    "beam": built_in()[0],
    "spring": replace(SPRING, lowest_hz=5.0, highest_hz=2000.0),
    "coil": CoilHarvester(
        mass_kg=5e-3,
        natural_frequency_hz=308.0,
        turns=500.0,
        field_length_tm=5e-3,
        coil_ohm=50.0,
        coil_henry=0.02,
    ),
}


@dataclass(frozen=True)
class Setting:
    """What days are like: lengths of recordings [s], wander and its memory [s], noise, loads."""

    seconds: float
    wander: float
    memory_s: float
    noise: float
    harvester: Harvester = SPRING
    #: Line of each operating point [Hz] and its share of all time.
    points: tuple[tuple[float, float], ...] = ((90.0, 1.0),)
    #: Levels of blocks of operation: how they are drawn, and their mean square.
    blocks: tuple[Callable[[Any], Any], float] | None = None
    #: The load over a recording, from count and rate; of mean square 1 in the long run.
    load: Callable[[Any, int, float], Any] | None = None


def swelling(rng, count, rate, *, spread=0.3, memory_s=4.0):
    """Load whose level in dB wanders."""
    kept = math.exp(-1 / (memory_s * rate))
    drawn = rng.normal(size=count) * math.sqrt(1 - kept**2)
    drawn[0] = rng.normal()
    return np.exp(spread * lfilter([1.0], [1.0, -kept], drawn) - spread**2)


def switching(rng, count, rate, *, dwell_s=3.0, idle=0.3):
    """Load that switches between full and idle, each for random times."""
    switched = np.cumsum(rng.random(count) < 1 / (dwell_s * rate)) + rng.integers(2)
    return np.where(switched % 2, idle, 1.0) / math.sqrt((1 + idle**2) / 2)


SETTINGS = {
    "steady line": Setting(60, 0.0, 1.0, 0.5),
    "fast wander": Setting(60, 0.005, 0.05, 0.3),
    "slow wander": Setting(120, 0.005, 1.0, 0.3),
    "slow and wide": Setting(300, 0.01, 3.0, 0.3),
    "two operating points": Setting(60, 0.005, 0.3, 0.3, points=((90.0, 0.6), (86.0, 0.4))),
    "eight blocks": Setting(
        20,
        0.005,
        0.3,
        0.3,
        blocks=(lambda rng: np.exp(0.3 * rng.normal(size=8)), math.exp(2 * 0.3**2)),
    ),
    # not looked at while the interval was made
    "short and noisy": Setting(20, 0.01, 0.1, 1.0),
    "twelve uneven blocks": Setting(
        15, 0.01, 0.2, 0.5, blocks=(lambda rng: np.sqrt(rng.gamma(3.0, 1 / 3, size=12)), 1.0)
    ),
    # nor these
    "noise alone": Setting(40, 0.0, 1.0, 30.0),
    "a sharp coil": Setting(120, 0.003, 2.0, 0.2, harvester=COIL, points=((61.0, 1.0),)),
    "a beam, three points": Setting(
        40, 0.01, 0.5, 0.5, harvester=BEAM, points=((83.0, 0.5), (91.0, 0.3), (102.0, 0.2))
    ),
    "a load that swells": Setting(200, 0.005, 0.3, 0.3, load=swelling),
    "a load that switches": Setting(300, 0.003, 0.5, 0.3, load=switching),
    "a few long, wide": Setting(400, 0.02, 5.0, 0.1, points=((90.0, 0.7), (84.0, 0.3))),
    "twenty short blocks": Setting(
        6, 0.005, 0.2, 0.5, blocks=(lambda rng: np.sqrt(rng.uniform(0.5, 1.5, size=20)), 1.0)
    ),
    "five blocks": Setting(
        30, 0.005, 0.3, 0.3, blocks=(lambda rng: np.sqrt(rng.gamma(5.0, 0.2, size=5)), 1.0)
    ),
    "ten blocks, some idle": Setting(
        20,
        0.005,
        0.3,
        0.3,
        blocks=(lambda rng: np.where(rng.random(10) < 0.3, 0.4, 1.0), 0.7 + 0.3 * 0.4**2),
    ),
}
#: Standard deviation of stated shares.
SHARE_ERROR = 0.05
#: Stretches of 4000 s that are taken for the long run: its mean is then known to 1/15 of what a day
#: of 300 s tells; with a single one a quarter of a day's scatter counts against the interval. Of a
#: day of 60 s four are as many.
DRAWS, DRAWS_OF_A_MINUTE = 16, 4


def heard(rng, seconds, wander, memory_s, noise, *, line_hz=310.0, rate=2000.0):
    """Two lines that wander together, in noise."""
    count = int(seconds * rate)
    kept = math.exp(-1 / (memory_s * rate))
    drift = rng.normal(size=count) * math.sqrt(1 - kept**2)
    drift[0] = rng.normal()
    turn = np.cumsum(1 + wander * lfilter([1.0], [1.0, -kept], drift)) / rate
    first, second = 2 * math.pi * line_hz * turn, 4.2 * math.pi * line_hz * turn
    return np.cos(first) + 0.5 * np.cos(second + 1) + noise * rng.normal(size=count)


def recorded(rows, rate, name="day"):
    rows = np.atleast_2d(rows)
    units = ("m/s2",) * len(rows)
    return Recording(samples=rows, sampling_rate_hz=rate, units=units, origin=name)


def against_marching(seed, longest=600.0):
    """One random recording through one random harvester: what was drawn, power and peak ratios."""
    rng = np.random.default_rng([18, seed])
    kind = list(HARVESTERS)[seed % 3]
    seconds = math.exp(rng.uniform(math.log(3.0), math.log(longest)))
    wander = rng.uniform(0.0, 0.02)
    memory_s, noise = 0.05 * 100 ** rng.uniform(), 10 ** rng.uniform(-3, 0)
    samples = heard(rng, seconds, wander, memory_s, noise)
    samples -= samples.mean()
    harvester = HARVESTERS[kind].retuned(310.0 * rng.uniform(0.97, 1.03))
    low, high = harvester.load_range
    harvester = harvester.with_load(math.sqrt(low * high) * 10 ** rng.uniform(-0.7, 0.7))
    found = respond(harvester, samples, 2000.0)
    power, peaks = marched_answer(harvester, samples, 2000.0, times=12)
    drawn = (kind, seconds, wander, memory_s, noise)
    return drawn, found.power_w / power, found.peaks[: len(peaks)] / peaks


def ranked_as_marched(seed, places=3):
    """Whether a survey ranks places as marching ranks them, each with its own harvester."""
    rng = np.random.default_rng([19, seed])
    wander, memory_s = rng.uniform(0.0, 0.02), 0.05 * 100 ** rng.uniform()
    rows = [
        heard(rng, 12.0, wander, memory_s, 10 ** rng.uniform(-2, 0), line_hz=90.0, rate=500.0)
        * rng.uniform(0.8, 1.25)
        for _ in range(places)
    ]
    survey = survey_measured(MACHINE, SPRING, [recorded(rows, 500.0)])
    marched = {}
    for place in survey.placed:
        row = place.position.healthy[0].vibration.samples_ms2
        marched[place.position.name] = marched_answer(place.tuned.harvester, row, 500.0)[0]
    names = [place.position.name for place in survey.placed]
    return names == sorted(marched, key=lambda name: -marched[name])


class Days:
    """Surveys of simulated days in one setting, and whether their interval holds the truth."""

    def __init__(self, setting, rate=500.0):
        self.setting, self.rate, self.number = (
            SETTINGS[setting],
            rate,
            list(SETTINGS).index(setting),
        )
        # what each operating point is in the long run
        draws = DRAWS if self.setting.seconds > 60 else DRAWS_OF_A_MINUTE
        self.long = [
            [
                self.stretch(np.random.default_rng([20, draw]), line_hz, draws)
                for draw in range(draws)
            ]
            for line_hz, _ in self.setting.points
        ]

    def stretch(self, rng, line_hz, draws):
        shaking = vibration_of_samples(self.day(rng, line_hz, 4000.0), self.rate)
        kept = (shaking.frequency_hz > 20.0) & (shaking.frequency_hz < 240.0)
        return OperatingShare(vibration=shaking.only(kept), share=1 / draws)

    def survey(self, seed) -> tuple[Survey, list[float]]:
        """Survey one day, and say what share of all time each operating point really has."""
        rng, own = np.random.default_rng([21, self.number, seed]), self.setting
        lines, shares = zip(*own.points, strict=True)
        if own.blocks:
            draw, mean_square = own.blocks
            blocks = [recorded(level * self.day(rng, lines[0]), self.rate) for level in draw(rng)]
            return survey_measured(MACHINE, own.harvester, blocks), [mean_square]
        heard_of = [recorded(self.day(rng, line_hz), self.rate) for line_hz in lines]
        if len(lines) == 1:
            return survey_measured(MACHINE, own.harvester, heard_of), [1.0]
        # errors that leave the sum as it is
        errors = rng.normal(size=len(lines))
        errors -= errors.mean()
        errors *= SHARE_ERROR / math.sqrt(1 - 1 / len(lines))
        stated = {"shares": list(np.array(shares) + errors), "share_error": SHARE_ERROR}
        return survey_measured(MACHINE, own.harvester, heard_of, **stated), list(shares)

    def day(self, rng, line_hz, seconds=None):
        own = self.setting
        length = seconds or own.seconds
        how = (own.wander, own.memory_s, own.noise)
        samples = heard(rng, length, *how, line_hz=line_hz, rate=self.rate)
        return samples * own.load(rng, len(samples), self.rate) if own.load else samples

    def held(self, seed) -> bool | None:
        """Tell whether the interval holds what that harvester gives in the long run."""
        survey, weights = self.survey(seed)
        place = survey.best
        if not math.isfinite(place.power_low_w):
            return None
        harvester = place.tuned.harvester
        load = np.array([harvester.load])
        powers = [mean_power_w(harvester, point, load)[0] for point in self.long]
        return bool(place.power_low_w <= np.dot(weights, powers) <= place.power_high_w)


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("marching", "ranking", "days"))
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--setting", choices=tuple(SETTINGS), action="append")
    given = parser.parse_args(arguments)
    seeds = range(given.count)
    if given.what == "marching":
        rows = []
        for seed in seeds:
            drawn, power, peaks = against_marching(seed)
            rows.append((math.log(drawn[1]), math.log(power), np.abs(np.log(peaks)).max()))
            kind, *values = drawn
            told = " ".join(f"{value:8.4g}" for value in values)
            print(f"{kind:8} {told}  power {power:.5f}  peaks {peaks.round(4)}", flush=True)
        length, power, peak = np.array(rows).T
        print(f"worst power {np.abs(power).max():.2%}, worst peak {peak.max():.2%}")
        print(f"trend of the power {np.polyfit(length, power, 1)[0]:.2%} for each e-fold of length")
    elif given.what == "ranking":
        same = [ranked_as_marched(seed) for seed in seeds]
        print(f"ranked as marching ranks: {np.mean(same):.1%} of {len(same)}")
    else:
        for setting in given.setting or SETTINGS:
            days = Days(setting)
            found = [days.held(seed) for seed in seeds]
            known = [one for one in found if one is not None]
            share = np.mean(known) if known else math.nan
            error = math.sqrt(share * (1 - share) / max(len(known), 1))
            told = f"{share:.1%} +- {error:.1%} of {len(known)}"
            print(f"{setting}: {told}; {len(found) - len(known)} told none", flush=True)


if __name__ == "__main__":
    main()
