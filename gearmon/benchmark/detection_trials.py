"""Trials of one random machine: what gearmon and other detectors say of recordings of known truth.

One healthy recording is the reference. New ones are healthy (as the reference, or with load, speed
or sensor gain changed), have one damaged tooth, or something else that is no damaged tooth.

The other detectors get the same reference. Textbook indicators are taken as the logarithm of their
value over that of the reference recording, of the gear and channel where they rose most: the best
that a threshold can do without knowing where to look. The localised difference is the strongest of
what needs no template: averages subtracted, whitened, mesh gains fitted, and the energy at one
tooth held against that at the others.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearmon.benchmark.detection_machines import GEARS, DrawnMachine, draw_machine
from gearmon.benchmark.detection_recordings import DURATION_S, Bench, Condition, Setting, Taken
from gearmon.diagnosis.analysis import analyse, learn
from gearmon.diagnosis.hypotheses.own_teeth import locate
from gearmon.diagnosis.results import Analysis, Flag
from gearmon.errors import GearmonError
from gearmon.signals import indicators
from gearmon.signals.indicators import RunHistory, na4_frozen
from gearmon.signals.recording import Recording
from gearmon.signatures.measured.gear_signals import gear_signals
from gearmon.signatures.measured.measurement import MeasuredSignature
from gearmon.signatures.measured.reference import Profile, Reference

FloatArray = NDArray[np.float64]

INDICATORS = (
    "FM4",
    "M6A",
    "NA4*",
    "residual energy",
    "energy ratio",
    "sideband energy ratio",
    "sideband index",
    "sideband level factor",
)
LOCALISED = "localised difference"
#: As they stand in the results.
RIVALS = (
    "FM4",
    "NA4*",
    "residual energy",
    "kurtosis",
    "energy ratio",
    "sideband energy ratio",
    "sideband index",
    LOCALISED,
    "plain learning",
)
_LEAST = 1e-12

#: Indicator -> value by gear and channel, shape (gears, channels).
Values = dict[str, FloatArray]


def gear_values(signature: MeasuredSignature, healthy: MeasuredSignature) -> Values:
    """Compute the indicators of all gears that two recordings resolve.

    Parameters
    ----------
    signature : MeasuredSignature
    healthy : MeasuredSignature
        The reference recording; NA4* divides by its variance.
    """
    rows: dict[str, list[FloatArray]] = {name: [] for name in INDICATORS}
    wheels = {(w.stage, w.gear): w for w in healthy.plan.wheels}
    for wheel in signature.plan.wheels:
        other = wheels.get((wheel.stage, wheel.gear))
        if other is None or not len(wheel.number) or not len(other.number):
            continue
        own = gear_signals(signature.lines.mean, wheel)
        known = gear_signals(healthy.lines.mean, other)
        run = RunHistory.of(len(own.residual)).with_record(known.residual)
        values = {
            "FM4": indicators.fm4(own.difference),
            "M6A": indicators.m6a(own.difference),
            "NA4*": na4_frozen(own.residual, run.with_record(own.residual), 1),
            "residual energy": indicators.rms(own.residual) ** 2,
            "energy ratio": indicators.energy_ratio(own.difference, own.regular),
            "sideband energy ratio": indicators.sideband_energy_ratio(
                own.near_sidebands, own.fundamental
            ),
            "sideband index": indicators.sideband_index(own.first_sidebands),
            "sideband level factor": indicators.sideband_level_factor(
                own.first_sidebands, own.average
            ),
        }
        for name, value in values.items():
            rows[name].append(value)
    return {name: np.array(value) for name, value in rows.items() if value}


def rises(new: Analysis, healthy: Analysis) -> tuple[dict[str, float], FloatArray]:
    """Compare a recording with the reference by indicators.

    Parameters
    ----------
    new, healthy : Analysis

    Returns
    -------
    dict
        Greatest rise of each indicator, as natural logarithm.
    ndarray
        Features for a learning detector: greatest, mean and least rise of each.
    """
    ours = gear_values(new.signature, healthy.signature)
    theirs = gear_values(healthy.signature, healthy.signature)
    changes = {
        name: np.log(np.maximum(ours[name], _LEAST) / np.maximum(theirs[name], _LEAST))
        for name in INDICATORS
        if name in ours and ours[name].shape == theirs[name].shape
    }
    changes["kurtosis"] = _of_waveform(new, healthy)
    features = []
    for name in (*INDICATORS, "kurtosis"):
        change = changes.get(name, np.zeros(1))
        features += [float(change.max()), float(change.mean()), float(change.min())]
    rises_of = {name: float(change.max()) for name, change in changes.items()}
    rises_of[LOCALISED] = localised_difference(new.signature, healthy.signature)
    return rises_of, np.array(features)


def localised_difference(signature: MeasuredSignature, healthy: MeasuredSignature) -> float:
    """Search the whitened difference of two recordings for one tooth, without a template.

    Parameters
    ----------
    signature : MeasuredSignature
    healthy : MeasuredSignature
        The reference recording.

    Returns
    -------
    float
        -log10 of the probability of the most striking tooth of all gears; 0 if none can be judged.
    """
    own, known = Profile.of(signature), Profile.of(healthy)
    patterns = {(wheel.stage, wheel.gear): wheel for wheel in known.wheels}
    channels = range(len(signature.channel_names))
    best = 0.0
    for wheel in own.wheels:
        other = patterns.get((wheel.stage, wheel.gear))
        if other is None:
            continue
        # a pulse on shaft 1 tells where the gears on it stand
        same = own.tacho and known.tacho and abs(wheel.order - 1.0) < 1e-12
        found = locate(wheel, channels, [other], channels, numbered=same, same_zero=same)
        best = best if found is None else max(best, -found.log10_probability)
    return best


def _of_waveform(new: Analysis, healthy: Analysis) -> FloatArray:
    rows = [analysis.indicators["kurtosis"] for analysis in (new, healthy)]
    shared = [name for name in rows[0] if name in rows[1]]
    return np.array([np.log(rows[0][name] / rows[1][name]) for name in shared])


Row = dict[str, Any]

LOSSES = (0.01, 0.025, 0.05, 0.1, 0.2, 0.4)
QUICK_LOSSES = (0.4,)
#: Load, speed and gain of healthy recordings over nominal, by the name of the variant.
VARIANTS = ("same", "load", "speed", "gain", "all")
OTHERS = ("eccentricity", "misalignment", "bearing", "pitting", "wear")
#: Sizes of the other conditions, see `Condition`.
SIZES = {
    "eccentricity": (2.0, 8.0),
    "misalignment": (0.05, 0.3),
    "bearing": (0.3, 0.8),
    "pitting": (0.05, 0.25),
    "wear": (0.2, 1.0),
}
#: Two recordings at one operating point differ by so much in load and speed.
LOAD_SPREAD, SPEED_SPREAD = 0.02, 0.002
#: A tooth is found if it is no further away [teeth].
TOOTH_WITHIN = 0.75
QUICK_S = 3.0


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One new recording.

    Parameters
    ----------
    condition : Condition
    setting : Setting
        With tacho; where `no_tacho`, its channel is also left out.
    variant : str
        One of `VARIANTS`.
    no_tacho : bool
        Whether to analyse the recording a second time without its tacho.
    """

    condition: Condition
    setting: Setting
    variant: str = "same"
    no_tacho: bool = True


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """What came of one analysis.

    Parameters
    ----------
    row : dict
        Truth and findings, in built-in types.
    features : ndarray
        Of a learning detector; empty where the recording was refused.
    """

    row: Row
    features: FloatArray = field(default_factory=lambda: np.zeros(0))


def machine_trials(number: int, seed: int, quick: bool = False) -> Iterator[Outcome]:
    """Run all trials of one machine.

    Parameters
    ----------
    number : int
        Of the machine; with the seed it sets all that is random.
    seed : int
    quick : bool
        Few and short recordings.
    """
    rng = np.random.default_rng([seed, number])
    drawn = draw_machine(rng, number, channels=1 if quick else None)
    bench = Bench(drawn=drawn)
    duration_s = QUICK_S if quick else DURATION_S
    first = bench.take(Condition(), _setting(rng, "same", duration_s))
    trials = _plan(rng, drawn, quick, duration_s)
    judges = {tacho: _Judge(drawn, first, tacho).learned() for tacho in (True, False)}
    for trial in trials:
        taken = bench.take(trial.condition, trial.setting)
        for tacho in (True, False) if trial.no_tacho else (True,):
            outcome = judges[tacho].outcome(trial, taken)
            yield Outcome(
                row={"machine": number, **_facts(drawn), **outcome.row}, features=outcome.features
            )


def _facts(drawn: DrawnMachine) -> Row:
    teeth = (f"{s.gears[0].teeth}/{s.gears[1].teeth}" for s in drawn.stages)
    return {
        "teeth": ", ".join(teeth),
        "speed_hz": round(drawn.speed_hz, 3),
        "channels": drawn.channels,
    }


def _setting(rng: np.random.Generator, variant: str, duration_s: float) -> Setting:
    load = 1 + LOAD_SPREAD * rng.uniform(-1, 1)
    speed = 1 + SPEED_SPREAD * rng.uniform(-1, 1)
    gain = 1.0
    if variant in ("load", "all"):
        load = rng.uniform(0.8, 1.2)
    if variant in ("speed", "all"):
        speed = rng.uniform(0.98, 1.02)
    if variant in ("gain", "all"):
        gain = 2.0 ** rng.uniform(-1, 1)
    seed = int(rng.integers(1 << 31))
    return Setting(load=load, speed=speed, gain=gain, seed=seed, duration_s=duration_s)


def _plan(
    rng: np.random.Generator, drawn: DrawnMachine, quick: bool, duration_s: float
) -> list[Trial]:
    def trial(condition: Condition, variant: str = "same", no_tacho: bool = True) -> Trial:
        setting = _setting(rng, variant, duration_s)
        return Trial(condition=condition, setting=setting, variant=variant, no_tacho=no_tacho)

    variants = ("same", "all") if quick else ("same", *VARIANTS)
    losses = QUICK_LOSSES if quick else LOSSES
    others = ("pitting",) if quick else OTHERS
    healthy = [trial(Condition(), name, name == "same") for name in variants]
    damaged = [trial(_somewhere(rng, drawn, "tooth", loss)) for loss in losses]
    changed = [
        trial(_somewhere(rng, drawn, kind, rng.uniform(*SIZES[kind])), no_tacho=False)
        for kind in others
    ]
    return healthy + damaged + changed


def _somewhere(rng: np.random.Generator, drawn: DrawnMachine, kind: str, size: float) -> Condition:
    """Draw where a condition is."""
    seed = int(rng.integers(1 << 31))
    if kind == "bearing":
        return Condition(kind=kind, size=size, seed=seed)
    stage, side = int(rng.integers(len(drawn.stages))), int(rng.integers(2))
    teeth = drawn.stages[stage].gears[side].teeth
    return Condition(
        kind=kind,
        stage=stage + 1,
        gear=GEARS[side],
        tooth=int(rng.integers(teeth)) + 1 if kind == "tooth" else None,
        size=size,
        seed=seed,
    )


@dataclass(frozen=True, eq=False)
class _Judge:
    """The reference of one machine, with or without tacho, and what to say of new recordings."""

    drawn: DrawnMachine
    first: Taken
    tacho: bool
    healthy: Analysis | None = None
    reference: Reference | None = None
    alone_s: float = 0.0
    refusal: str = ""

    def learned(self) -> _Judge:
        """Analyse the first recording alone and learn from it."""
        recording, machine = self._recording(self.first), self.drawn.machine
        start = time.perf_counter()
        try:
            healthy = analyse(recording, machine)
            alone_s = time.perf_counter() - start
            reference = learn([recording], machine)
        except GearmonError as error:
            return replace(self, alone_s=time.perf_counter() - start, refusal=str(error))
        return replace(self, healthy=healthy, alone_s=alone_s, reference=reference)

    def _recording(self, taken: Taken) -> Recording:
        return taken.recording if self.tacho else taken.recording.vibration()

    def outcome(self, trial: Trial, taken: Taken) -> Outcome:
        row = {**_truth(trial), "tacho": self.tacho, **_NOTHING}
        if self.reference is None or self.healthy is None:
            return Outcome(row={**row, "verdict": "refused", "note": self.refusal})
        start = time.perf_counter()
        try:
            found = analyse(self._recording(taken), self.drawn.machine, self.reference)
        except GearmonError as error:
            return Outcome(row={**row, "verdict": "refused", "note": str(error)})
        row |= {"run_time_s": time.perf_counter() - start, "alone_s": self.alone_s}
        row |= {"verdict": found.verdict, "score": found.score}
        row |= {"probability": found.false_alarm_probability}
        row |= self._findings(trial.condition, taken, found)
        if not (found.signature.found and self.healthy.signature.found):
            return Outcome(row=row)
        rises_of, features = rises(found, self.healthy)
        row |= {name: rises_of[name] for name in RIVALS if name in rises_of}
        return Outcome(row=row, features=features)

    def _findings(self, condition: Condition, taken: Taken, found: Analysis) -> Row:
        row: Row = {"flags": "; ".join(flag.kind for flag in found.flags)}
        if not found.flags:
            return row
        first = found.flags[0]
        row |= {"found_kind": first.kind, "flag_probability": first.false_alarm_probability}
        tooth = next((flag for flag in found.flags if is_tooth_flag(flag)), None)
        row["tooth_flag"] = tooth is not None
        if tooth is None:
            return row
        row |= {"found_stage": tooth.stage, "found_gear": tooth.gear, "found_tooth": tooth.tooth}
        row |= {"loss": tooth.stiffness_loss, "loss_low": tooth.stiffness_loss_low}
        row["loss_high"] = tooth.stiffness_loss_high
        right = (tooth.stage, tooth.gear) == (condition.stage, condition.gear)
        if condition.kind == "tooth":
            row["gear_right"] = right
            if right:
                row["tooth_error"] = self._tooth_error(condition, taken, found, tooth)
        return row

    def _tooth_error(
        self, condition: Condition, taken: Taken, found: Analysis, flag: Flag
    ) -> float | None:
        """Distance of the tooth found from the true one [teeth].

        A number is one from the pulse on shaft 1 where the gear turns with it, else one from the
        angle zero of the new recording or of the reference: either is as good.
        """
        stage = self.drawn.stages[condition.stage - 1]
        teeth = stage.gears[GEARS.index(condition.gear)].teeth
        assert self.healthy is not None
        zero = [
            _entered(self.drawn, condition, one.turns_at(_time_of_zero(analysis)))
            for one, analysis in ((taken, found), (self.first, self.healthy))
        ]
        true = [(condition.tooth or 1) - 1 - entered for entered in zero]
        if flag.tooth is not None:
            return min(_around(flag.tooth - 1 - place, teeth) for place in true)
        profile = next(
            (p for p in found.profiles if (p.stage, p.gear) == (flag.stage, flag.gear)), None
        )
        if profile is None:
            return None
        # a place is where the contact has its middle
        return _around(profile.position * teeth - (true[0] + 0.5 * stage.shape.reach), teeth)


#: Columns of what was found, and what they hold before anything is.
_FOUND = (
    *("verdict", "score", "probability", "flags", "found_kind", "flag_probability", "tooth_flag"),
    *("found_stage", "found_gear", "found_tooth", "gear_right", "tooth_error"),
    *("loss", "loss_low", "loss_high", "run_time_s", "alone_s", *RIVALS, "note"),
)
_TEXTS = ("verdict", "flags", "found_kind", "note")
_NOTHING: Row = dict.fromkeys(_FOUND) | dict.fromkeys(_TEXTS, "") | {"tooth_flag": False}


def _truth(trial: Trial) -> Row:
    condition, setting = trial.condition, trial.setting
    where = {"stage": condition.stage or None, "gear": condition.gear or None}
    what = {"tooth": condition.tooth, "size": condition.size}
    how = {"load": setting.load, "speed": setting.speed, "gain": setting.gain}
    return {"condition": condition.kind, "variant": trial.variant, **where, **what, **how}


def is_tooth_flag(flag: Flag) -> bool:
    """Tell whether a flag blames one tooth."""
    return flag.tooth is not None or "tooth" in flag.kind or flag.kind in ("crack", "breakage")


def _time_of_zero(analysis: Analysis) -> float:
    """Return when a recording's angle is zero [s], be it before its start."""
    return float(analysis.signature.track.time_at(np.zeros(1))[0])


def _entered(drawn: DrawnMachine, condition: Condition, turns: float) -> float:
    """Return how many teeth of the damaged gear have entered contact at an angle of shaft 1."""
    shaft = turns
    for stage in drawn.stages[: condition.stage - 1]:
        shaft *= stage.gears[0].teeth / stage.gears[1].teeth
    return shaft * drawn.stages[condition.stage - 1].gears[0].teeth


def _around(distance: float, teeth: int) -> float:
    """Return the distance of two places on a gear [teeth], the shorter way round."""
    away = distance % teeth
    return min(away, teeth - away)
