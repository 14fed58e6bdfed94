"""The claims of the study, each held against the computed results.

study.toml is the table of claims: what is claimed, what must rise or fall, which numbers are
expected, and the sentence that tells what is found. A check, by the key of its claim, computes from
the results what the table names; one checker makes verdict, sentence and numbers of both.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.benchmark.equations import VARIATION
from gearmon.dynamics.amplitude_equations import free_vibration
from gearmon.gears.stiffness import zone_means
from gearmon.report.wording import shipped
from gearmon.study import pair
from gearmon.study.experiments import LOSSES, MANY, SOLUTION, StudyResults

Verdict = Literal["reproduced", "partly", "not reproduced", "cannot be checked"]

#: Peaks of lines are "about constant" within this share, and a line "dominates" above this share.
CONSTANT, DOMINATES = 0.1, 0.5
LIGHT_KG, HEAVY_KG, KNEE_NS_PER_M = 0.6, 1.5, 18e3
LIMITS_HZ = {"printed limit": 1e3, "likely limit": 1e4}
COMPARABLE = 1 / 3


@dataclass(frozen=True)
class Evidence:
    """One number of ours, beside the published or otherwise expected one where there is any.

    Attributes
    ----------
    quantity : str
    ours : float
    unit : str
        Empty for a pure number.
    expected : float or None
        None where nothing is published to compare with.
    source : str
        Where `expected` comes from.
    tolerance : float
        Relative difference that the digits of the source allow.
    """

    quantity: str
    ours: float
    unit: str = ""
    expected: float | None = None
    source: str = ""
    tolerance: float = 0.01

    @property
    def difference(self) -> float | None:
        """Ours over the expected less one; the plain difference where zero is expected."""
        if self.expected is None:
            return None
        return self.ours / self.expected - 1 if self.expected else self.ours

    @property
    def agrees(self) -> bool:
        """Whether the difference is within the tolerance; True where nothing is expected."""
        return self.difference is None or abs(self.difference) <= self.tolerance


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One claim of the study; study.toml tells what its fields mean.

    Attributes
    ----------
    key : str
        Number and letter: "6b".
    text, where : str
        What is claimed, in our words, and the equations or figures of the study that claim it.
    reason : str
        What is found, with the names of numbers to be filled in.
    numbers : tuple of lists
    sweep : str
        Parameter that is swept, or "".
    holds : tuple of str
        "rising" or "falling" and a quantity of the sweep.
    agreement : {"", "each", "all"}
    otherwise : str
        Verdict if nothing holds.
    """

    key: str
    text: str
    where: str
    reason: str
    numbers: Sequence[Sequence[Any]]
    sweep: str = ""
    holds: Sequence[str] = ()
    agreement: str = ""
    otherwise: Verdict = "not reproduced"


@dataclass(frozen=True, kw_only=True)
class Finding:
    """What the results say of a claim.

    Attributes
    ----------
    claim : Claim
    verdict : str
    reason : str
        One or two sentences with the numbers that decide.
    evidence : tuple of Evidence
    """

    claim: Claim
    verdict: Verdict
    reason: str
    evidence: tuple[Evidence, ...]


class Series(dict[str, float]):
    """A row of numbers by what each is of; formatted as a chain.

    Examples
    --------
    >>> format(Series({"3 kN s/m": 646.1, "6 kN s/m": 388.2}), ".0f")
    '646 → 388'
    """

    def __format__(self, digits: str) -> str:
        return " → ".join(format(value, digits or ".3g") for value in self.values())

    @classmethod
    def of(cls, names: Iterable[object], values: Iterable[float] | FloatArray) -> Series:
        """Return numbers with their names beside them."""
        return cls(zip(map(str, names), map(float, values), strict=True))


#: Everything that sentences and tables may name.
Numbers = dict[str, Any]
#: Quantities of the sweep that a claim is about.
Taken = Mapping[str, FloatArray]
#: Parts of the verdict, and numbers beside those of the sweep.
Judgement = tuple[tuple[bool, ...], Numbers]

#: What is known of every point of a sweep.
QUANTITIES: dict[str, Callable[[pair.Operation], float]] = {
    "mean": lambda p: 1e6 * p.figures["mean_displacement_m"],
    "swing": lambda p: 1e6 * p.figures["displacement_swing_m"],
    "velocity": lambda p: 2e3 * np.abs(p.response.velocity).max(),
    "peak": lambda p: p.figures["peak_acceleration_ms2"],
    "harmonic": lambda p: p.figures["peak_harmonic"],
    "in_time_peak": lambda p: np.abs(p.waveform.acceleration_ms2).max(),
    "first_line": lambda p: p.acceleration_lines[1] / p.acceleration_lines.max(),
    "natural": lambda p: p.figures["natural_frequency_hz"],
    "decay": lambda p: _slowest_decay(p),
    "energy": lambda p: 1e6 * p.figures["total_energy_j_per_kg"],
    "centroid": lambda p: p.figures["mean_energy_frequency_hz"],
    "band": lambda p: p.figures["energy_band_hz"],
    "strongest": lambda p: int(p.response.energy_lines.argmax()),
    "change": lambda p: _change_of_last_period(p),
}


def judge(results: StudyResults) -> tuple[Finding, ...]:
    """Hold every claim against the results.

    Parameters
    ----------
    results : StudyResults

    Returns
    -------
    tuple of Finding
        In the order of `CLAIMS`; every number is computed from the results.
    """
    return tuple(_found(claim, results) for claim in CLAIMS)


def _found(claim: Claim, results: StudyResults) -> Finding:
    numbers: Numbers = {}
    taken: dict[str, FloatArray] = {}
    if claim.sweep:
        sweep = results.sweeps[claim.sweep]
        taken = {name: sweep.take(quantity) for name, quantity in QUANTITIES.items()}
        numbers |= {name: Series.of(sweep.shown, values) for name, values in taken.items()}
    # one without a check is judged by its table alone
    check = globals().get(f"check_{claim.key}")
    parts, further = check(results, taken) if check else ((), {})
    evidence = tuple(_evidence(claim, numbers := numbers | further))
    held = [DIRECTIONS[way](taken[name]) for way, name in map(str.split, claim.holds)]
    agreeing = [item.agrees for item in evidence if item.expected is not None]
    agreements = {"each": agreeing, "all": [all(agreeing)]}.get(claim.agreement, [])
    verdict = verdict_of(*held, *parts, *agreements, otherwise=claim.otherwise)
    reason = claim.reason.strip().format(**numbers)
    return Finding(claim=claim, verdict=verdict, reason=reason, evidence=evidence)


def _evidence(claim: Claim, numbers: Numbers) -> Iterator[Evidence]:
    """Yield the numbers that the table of a claim asks for."""
    for name, quantity, *rest in claim.numbers:
        usual: list[Any] = ["", None, "", 0.01, 0.0]
        unit, expected, source, tolerance, rounding = [*rest, *usual[len(rest) :]]
        if isinstance(expected, str):
            expected = float(numbers[expected])
        row = numbers[name] if isinstance(numbers[name], Series) else Series({"": numbers[name]})
        chosen: list[tuple[str, float]] = list(row.items())
        if "{ends}" in quantity:
            chosen = [chosen[0], chosen[-1]]
        elif "{each}" not in quantity:
            chosen = [("", max(row.values()))]
        known = expected if isinstance(expected, list) else [expected] * len(chosen)
        for (label, ours), one in zip(chosen, known, strict=True):
            told = quantity.format(each=label, ends=label)
            allowed = tolerance + (rounding / one if rounding else 0.0)
            yield Evidence(told, float(ours), unit, one, source, allowed)


def verdict_of(*parts: bool, otherwise: Verdict = "not reproduced") -> Verdict:
    """Reproduced if all parts hold, partly if some do, else not reproduced or what else is said."""
    if all(parts):
        return "reproduced"
    return "partly" if any(parts) else otherwise


def rising(values: Sequence[float] | FloatArray) -> bool:
    """Whether no value is below the one before."""
    return bool((np.diff(values) >= 0).all())


def falling(values: Sequence[float] | FloatArray) -> bool:
    """Whether no value is above the one before."""
    return bool((np.diff(values) <= 0).all())


DIRECTIONS = {"rising": rising, "falling": falling}


def _slowest_decay(point: pair.Operation) -> float:
    """Decay rate of the slowest free vibration [1/s]."""
    return -math.log(abs(point.response.floquet_multipliers[0])) / point.response.problem.period_s


def _change_of_last_period(point: pair.Operation) -> float:
    """Change from the third to the fourth mesh period after rest, over the peak to peak."""
    z, count = point.start.displacement_m, pair.POINTS_PER_PERIOD
    last, before = z[-count:], z[-2 * count : -count]
    return float(np.abs(last - before).max() / np.ptp(last))


def _spread(values: FloatArray) -> float:
    """By how much the largest value is above the least [%]."""
    return 100 * float(values.max() / values.min() - 1)


def check_1a(_results: StudyResults, _of: Taken) -> Judgement:
    """Stiffness of a pair and its sum over the pairs."""
    pulse, (high, low) = pair.SIGNALS["parabolic"].pulse, zone_means(pair.CONTACT_RATIO)
    end, middle = pulse.value(pair.CONTACT_RATIO * np.array([0.0, 0.5]))
    lines = np.abs(pulse.transform(np.arange(1, 6))) / pulse.area
    rows = Series.of(range(1, 6), lines)
    return (), {"ends": end / middle, "mean": pulse.area, "high": high, "low": low, "lines": rows}


def check_1b(_results: StudyResults, _of: Taken) -> Judgement:
    """Whether the printed gear data agree."""
    gears, mesh_hz = pair.decoded(), 1 / pair.REFERENCE.period_s
    rounded = 100 * (mesh_hz / gears["printed_hz"] - 1)
    numbers = {"mesh_hz": mesh_hz, "rounded": rounded, "period_ms": 1e3 * pair.REFERENCE.period_s}
    return (), gears | numbers


def check_2(_results: StudyResults, _of: Taken) -> Judgement:
    """Whether the forms share their first line and part in the higher ones."""
    lines = np.array([np.abs(signal.shape_harmonics(60)) for signal in pair.SIGNALS.values()])
    four, half = lines[:4], lines[4]
    first = float(four[:, 0].max() / four[:, 0].min())
    high = np.sqrt((four[:3, 9:40] ** 2).sum(axis=1))
    beyond = np.sqrt((four[2:, 41:] ** 2).sum(axis=1))
    second, ends = float(four[2, 1] / four[2, 0]), float(beyond[1] / beyond[0])
    numbers = {"first": first, "first_percent": 100 * (first - 1), "beyond": ends}
    numbers |= {"second": second, "second_percent": 100 * second, "half": half[1] / half[0]}
    parts = first < 1.1, ends < 1e-9, second < 1e-3
    return parts, numbers | {"jumpers": high.max() / high.min()}


def check_3a(results: StudyResults, _of: Taken) -> Judgement:
    """Which form's response is closest to that under the parabola."""
    forms, keys = results.forms, ("wave", "rectangular", "fourier")
    off = {key: 100 * pair.dynamic_difference(forms[key], forms["parabolic"]) for key in keys}
    apart = Series({forms[key].signal.label: value for key, value in off.items()})
    closer = off["rectangular"] < off["wave"], off["fourier"] < off["wave"]
    return closer, {**off, "apart": apart}


def check_3b(results: StudyResults, _of: Taken) -> Judgement:
    """Whether the wave form settles later than the others."""
    chosen = [results.forms[key] for key in ("wave", "rectangular", "fourier")]
    settled = Series({form.signal.label: 1e3 * form.longest_settling_s for form in chosen})
    wave, *others = settled.values()
    numbers: Numbers = {"settled": settled, "wave": wave, "others": max(others)}
    numbers |= {"decay": pair.REFERENCE.damping_ns_per_m / (2 * pair.REFERENCE.mass_kg)}
    return (wave > 1.05 * max(others),), numbers


def check_3c(results: StudyResults, _of: Taken) -> Judgement:
    """Overshoot of the Fourier sum, and what of it reaches the motion."""
    forms = results.forms
    fine = pair.SIGNALS["fourier-half"].shape(np.arange(20_000) / 20_000)
    ripple = 100 * pair.dynamic_difference(forms["fourier"], forms["rectangular"])
    smooth, sharp = (
        np.abs(forms[key].simulated.acceleration_ms2[pair.LAST_PERIOD]).max()
        for key in ("fourier", "rectangular")
    )
    numbers = {"overshoot": 50 * (fine.max() - 1), "ripple": ripple, "peak": smooth / sharp}
    return (), numbers | {"peak_percent": 100 * smooth / sharp}


def check_4(results: StudyResults, _of: Taken) -> Judgement:
    """How the mesh force jumps, settles and repeats."""
    force, nominal = results.forms["rectangular"].simulated.mesh_force_n, pair.REFERENCE.force_n
    last = force[pair.LAST_PERIOD]
    before = force[-2 * len(last) - 1 : -len(last) - 1]
    cut = round((pair.CONTACT_RATIO - 1) * len(last))
    entering, leaving = last[0] - last[-1], last[cut] - last[cut - 1]
    two, one = last[:cut].mean(), last[cut:].mean()
    zones = 100 * max(abs(two / nominal - 1), abs(one / nominal - 1))
    # two pairs share the load evenly
    numbers = {"mean": last.mean(), "one_pair": last[cut] - last[cut - 1] / 2}
    numbers |= {"entering": entering, "leaving": leaving, "two_carry": two, "one_carries": one}
    numbers |= {"repeat": np.abs(last - before).max() / nominal, "zones_percent": zones}
    return (bool(leaving > 0 > entering),), numbers


def check_5a(results: StudyResults, _of: Taken) -> Judgement:
    """Errors of the orders and the power of eps with which they fall."""
    study, sums = results.orders, results.orders.expansion.terms[:3].sum(axis=0)
    slopes = Series.of(range(3), study.slopes[:3])
    first, second = 100 * study.displacement_errors[1:3]
    exact, to_second = (1e6 * z[0].real for z in (results.reference.response.displacement, sums))
    numbers = {"exact_um": exact, "second_um": to_second, "first": first, "second": second}
    acceleration = 100 * study.acceleration_errors[2]
    return (), numbers | {"slopes": slopes, "acceleration": acceleration, "eps": VARIATION}


def check_5b(results: StudyResults, _of: Taken) -> Judgement:
    """Judge starts from rest, and the free vibration that they start with."""
    response = results.reference.response
    textbook = free_vibration(response.problem, pair.PUBLISHED_ORDER, small_damping=True)
    starts = [point for sweep in results.sweeps.values() for point in sweep.points]
    errors = [100 * p.start_error for p in starts if p.start_method == "multiple scales"]
    numbers: Numbers = {"textbook_hz": textbook.frequency_hz, "worst": max(errors)}
    numbers |= {"textbook_decay": textbook.decay_per_s, "exact_hz": _free_frequency_hz(results)}
    numbers |= {"exact_decay": _slowest_decay(results.reference), "left": len(starts) - len(errors)}
    numbers |= {"own": 100 * results.reference.start_error, "all": len(starts)}
    return (max(errors) < 1,), numbers | {"solved": len(errors)}


def _free_frequency_hz(results: StudyResults) -> float:
    """Frequency of the free vibration from the Floquet multiplier, next to the damped one."""
    response = results.reference.response
    problem, period = response.problem, response.problem.period_s
    damped = problem.natural_frequency_hz * math.sqrt(1 - problem.damping_ratio**2)
    turn = np.angle(response.floquet_multipliers[0]) / (2 * math.pi * period)
    # known up to its sign and whole mesh frequencies
    choices = [s * turn + round((damped - s * turn) * period) / period for s in (1, -1)]
    return min(choices, key=lambda frequency: abs(frequency - damped))


def check_5c(results: StudyResults, _of: Taken) -> Judgement:
    """Whether the ratio of natural to mesh frequency follows from the data."""
    ratio = results.reference.response.problem.frequency_ratio
    numbers = {"ratio": ratio, "squared": ratio**2, "origin": 256 * (1 + 4 / math.pi)}
    return (abs(ratio / 16 - 1) <= 0.01,), numbers


def check_6d(_results: StudyResults, of: Taken) -> Judgement:
    """Largest acceleration line and its harmonic against stiffness."""
    peaks, spread = of["peak"], _spread(of["peak"])
    numbers = {"smallest": peaks.min(), "largest": peaks.max(), "spread": spread}
    return (spread < 100 * CONSTANT,), numbers


def check_6e(results: StudyResults, of: Taken) -> Judgement:
    """Whether the mesh frequency is the largest line of the acceleration."""
    sweep, share = results.sweeps["stiffness_n_per_m"], of["first_line"]
    largest = all(np.abs(p.response.displacement[1:]).argmax() == 0 for p in sweep.points)
    numbers = {"low": sweep.shown[0], "high": sweep.shown[-1], "at_low": 100 * share[0]}
    everywhere = "everywhere" if largest else "not everywhere"
    numbers |= {"at_high": 100 * share[-1], "everywhere": everywhere}
    return (bool(share[0] > DOMINATES),), numbers


def check_6f(_results: StudyResults, of: Taken) -> Judgement:
    """Whether peaks of velocity and acceleration fall as stiffness rises."""
    in_time, lines = of["in_time_peak"], of["peak"]
    fall = 100 * (1 - in_time[-1] / in_time[0])
    return (bool(lines[-1] < (1 - CONSTANT) * lines[0]),), {"in_time": fall}


def check_7a(results: StudyResults, of: Taken) -> Judgement:
    """Swing and period of the free vibration against mass."""
    sweep, largest = results.sweeps["mass_kg"], int(of["swing"].argmax())
    ratio = sweep.points[largest].response.problem.frequency_ratio
    numbers = {"largest_kg": sweep.values[largest], "ratio": ratio, "where": sweep.shown[largest]}
    return (bool(of["swing"][-1] > of["swing"][0]),), numbers


def check_7b(results: StudyResults, of: Taken) -> Judgement:
    """Peaks and band of the acceleration against mass."""
    mass, peaks = results.sweeps["mass_kg"].values, of["peak"]
    light, heavy = peaks[mass < LIGHT_KG].min(), peaks[mass >= HEAVY_KG].max()
    return (bool(light > heavy),), {"light": light, "heavy": heavy}


def check_7c(results: StudyResults, _of: Taken) -> Judgement:
    """Whether the teeth part at 3 kg, and where they do."""
    heavy, contact = results.sweeps["mass_kg"].points[-1], results.contact
    least_um = 1e6 * float(heavy.waveform.displacement_m.min())
    force = float(heavy.waveform.mesh_force_n.min())
    started = heavy.start.mesh_force_n
    first_peak = int(started[: pair.POINTS_PER_PERIOD].argmax())
    scans = {"mass": contact.mass, "damping": contact.damping, "variation": contact.variation}
    first = {name: scan.first or math.nan for name, scan in scans.items()}
    p = heavy.response.problem
    ratio = math.sqrt(p.stiffness_n_per_m / first["mass"]) * p.period_s / (2 * math.pi)
    numbers: Numbers = {"least_um": least_um, "force_n": force, "ratio": ratio}
    numbers |= {"counted_um": least_um - 1e6 * pair.STATIC_DEFLECTION_M}
    numbers |= {"after_n": float(started[first_peak:].min()), "lost_at": _where_lost(results)}
    return (force <= 0 or least_um <= 0,), numbers | first | {"in_study": contact.least_in_study}


def _where_lost(results: StudyResults) -> str:
    contact = results.contact
    mass, eps, damping = contact.mass.first, contact.variation.first, contact.damping.first
    by_mass = f"The mass alone would have to reach {mass or 0:.1f} kg"
    by_eps = f"at 3 kg eps would have to reach {eps or 0:.2f}"
    by_damping = f"or the damping fall to {damping or 0:.3g} N s/m"
    nowhere = f"and no damping down to {contact.damping.values.min():.0f} N s/m does it"
    return (
        f"{by_mass if mass else 'No mass in the range scanned is large enough'}; "
        f"{by_eps if eps else 'at 3 kg no eps is large enough'}, "
        f"{by_damping if damping else nowhere}"
    )


def check_8a(results: StudyResults, of: Taken) -> Judgement:
    """Slowest decay of a free vibration against damping."""
    critical = 2 * math.sqrt(pair.REFERENCE.stiffness_n_per_m * pair.REFERENCE.mass_kg)
    below = of["decay"][results.sweeps["damping_ns_per_m"].values < critical]
    return (rising(below),), {"critical": critical}


def check_8c(results: StudyResults, of: Taken) -> Judgement:
    """Which share of the drop of the peaks is done at 18 kN s/m."""
    damping, peaks = results.sweeps["damping_ns_per_m"].values, of["peak"]
    at_knee = peaks[damping == KNEE_NS_PER_M][0]
    share = 100 * (peaks[0] - at_knee) / np.ptp(peaks)
    return (bool(share > 50),), {"share": share, "varies": _spread(damping * peaks)}


def check_8d(results: StudyResults, of: Taken) -> Judgement:
    """Harmonic of the largest acceleration line against damping."""
    sweep, harmonics = results.sweeps["damping_ns_per_m"], of["harmonic"]
    steps = zip(sweep.shown[:-1], sweep.shown[1:], np.diff(harmonics), strict=True)
    changes = [f"from {before} to {after}" for before, after, step in steps if step]
    last = np.sort(sweep.points[-1].acceleration_lines)
    kept, moved = np.ptp(harmonics[:-1]) == 0, harmonics[-1] != harmonics[-2]
    numbers = {"moves": " and ".join(changes) or "nowhere", "even": 100 * last[-2] / last[-1]}
    return (bool(kept), bool(moved), len(changes) <= 1), numbers


def check_9a(results: StudyResults, of: Taken) -> Judgement:
    """Total energy against stiffness."""
    return (), {"varies": _spread(of["energy"] * results.sweeps["stiffness_n_per_m"].values)}


def check_9b(_results: StudyResults, of: Taken) -> Judgement:
    """Whether the energy lines keep their shape when stiffness changes."""
    band, strongest = of["band"], of["strongest"]
    parts = bool(np.ptp(strongest) == 0), bool(np.ptp(band) == 0)
    return parts, {"first_hz": band[0], "last_hz": band[-1]}


def check_9c(results: StudyResults, of: Taken) -> Judgement:
    """Total energy and its band against mass, per kilogram and whole."""
    sweep, specific = results.sweeps["mass_kg"], of["energy"]
    mass, whole = sweep.values, specific * sweep.values
    rows = Series.of(sweep.shown, whole)
    numbers = {"light": whole[mass == 0.2][0], "one_kg": whole[mass == 1.0][0], "whole": rows}
    numbers |= {"near": specific[mass <= 1.0].mean(), "last_hz": of["band"][-1]}
    return (rising(whole), bool(whole[-1] > 2 * whole[0])), numbers


def check_10(results: StudyResults, _of: Taken) -> Judgement:
    """Energy lines of the reference case."""
    response = results.reference.response
    lines, frequency = response.energy_lines, response.frequency_hz
    odd = Series.of([f"{hz:.0f}" for hz in frequency[1:16:2]], 1e6 * lines[1:16:2])
    runner_up = np.sort(lines)[-2] / lines.max()
    comparable = int((lines >= COMPARABLE * lines.max()).sum()) - 1
    shares = [lines[frequency > limit].sum() / lines.sum() for limit in LIMITS_HZ.values()]
    above_1khz, above_10khz = (100 * share for share in shares)
    numbers: Numbers = {"lines": odd}
    numbers |= {"best_hz": frequency[lines.argmax()], "comparable": comparable}
    numbers |= {"runner_up": runner_up, "next_percent": 100 * runner_up}
    numbers |= {"above_1khz": above_1khz, "above_10khz": above_10khz}
    return (comparable >= 5, bool(above_1khz < 20)), numbers


def check_11(results: StudyResults, _of: Taken) -> Judgement:
    """Time of a substitution against that of a simulation as accurate."""
    speed, told = results.speed, []
    own, rivals, ratios, at_once = Series(), Series(), Series(), Series()
    for cost in (speed.substitution(), speed.finest):
        matched, order, error = speed.ratio(cost), cost["setting"], f"error {cost['error']:.1e}"
        if matched is None:
            continue
        rival, ratios[order] = matched
        ms, rival_ms = 1e3 * cost["median_s"], 1e3 * rival["median_s"]
        way, at = rival["method"], f"{rival['setting']} (error {rival['error']:.1e})"
        own[f"order {order} ({error})"], rivals[f"{way} at {at}"] = ms, rival_ms
        at_once[order] = rival["median_s"] / speed.substitution(order, MANY)["median_s"]
        told.append(
            f"at an {error.replace(' ', ' of ')} order {order} takes {ms:.2f} ms, "
            f"{way} {rival_ms:.1f} ms, {ratios[order]:.0f} times as long"
        )
    anew_ms = 1e3 * min(c["median_s"] for c in speed.costs if c["method"] == SOLUTION)
    numbers: Numbers = {"own": own, "rivals": rivals, "ratios": ratios, "at_once": at_once}
    numbers |= {"machine": speed.machine, "told": "; ".join(told), "anew_ms": anew_ms}
    return tuple(ratio > 1 for ratio in ratios.values()), numbers


def check_12a(results: StudyResults, _of: Taken) -> Judgement:
    """Measure what one damaged tooth adds to the lines."""
    rows = Series.of([f"{100 * loss:g}" for loss in LOSSES], results.damage.levels_db)
    # what stands out on a machine, only recordings tell
    return (False,), {"levels": rows, "five": rows["5"], "twenty": rows["20"]}


def check_12b(results: StudyResults, _of: Taken) -> Judgement:
    """Power of a matched harvester at each line, against the energy lines."""
    response, power = results.reference.response, 1e3 * results.harvested_w
    best = int(power.argmax())
    by_energy = int(response.energy_lines[1 : len(power) + 1].argmax())
    best_hz, energy_hz = response.frequency_hz[[best + 1, by_energy + 1]]
    numbers = {"best_hz": best_hz, "energy_hz": energy_hz, "power_mw": power[best]}
    # as much again as the generator takes goes into heat
    numbers |= {"generated_mw": 2 * power[0]}
    agree = "agree" if best == by_energy else "disagree"
    # a choice before any measurement is no figure of power
    return (best == by_energy, False), numbers | {"agree": agree}


# both ask for the mesh frequency
check_6b = check_1b


#: The lists "claim" and "picture".
STUDY: dict[str, list[dict[str, Any]]] = tomllib.loads(shipped("study.toml", "gearmon.study"))
#: In the order of the study.
CLAIMS = tuple(Claim(**row) for row in STUDY["claim"])
