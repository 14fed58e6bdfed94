"""Trials of one random machine: what is said of recordings whose truth is known.

One healthy recording is the reference. New ones are healthy (as the reference, or with load, speed
or sensor gain changed), have one damaged tooth, or something else that is no damaged tooth.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearmon.benchmark.detection_machines import GEARS, DrawnMachine, draw_machine
from gearmon.benchmark.detection_recordings import DURATION_S, Bench, Condition, Setting, Taken
from gearmon.benchmark.detection_rivals import RIVALS, rises
from gearmon.diagnosis.analysis import analyse, learn
from gearmon.diagnosis.results import Analysis, Flag
from gearmon.errors import GearmonError
from gearmon.signatures.measured.reference import Reference

FloatArray = NDArray[np.float64]
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
    judges = {tacho: _Judge.of(drawn, first, tacho) for tacho in (True, False)}
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


def _setting(
    rng: np.random.Generator, variant: str, duration_s: float, tacho: bool = True
) -> Setting:
    load = 1 + LOAD_SPREAD * rng.uniform(-1, 1)
    speed = 1 + SPEED_SPREAD * rng.uniform(-1, 1)
    gain = 1.0
    if variant in ("load", "all"):
        load = rng.uniform(0.8, 1.2)
    if variant in ("speed", "all"):
        speed = rng.uniform(0.98, 1.02)
    if variant in ("gain", "all"):
        gain = 2.0 ** rng.uniform(-1, 1)
    return Setting(
        load=load,
        speed=speed,
        gain=gain,
        tacho=tacho,
        seed=int(rng.integers(1 << 31)),
        duration_s=duration_s,
    )


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


@dataclass(frozen=True, kw_only=True, eq=False)
class _Judge:
    """The reference of one machine, with or without tacho, and what to say of new recordings."""

    drawn: DrawnMachine
    first: Taken
    tacho: bool
    healthy: Analysis | None
    reference: Reference | None
    alone_s: float
    refusal: str

    @classmethod
    def of(cls, drawn: DrawnMachine, first: Taken, tacho: bool) -> _Judge:
        recording = first.recording if tacho else first.recording.vibration()
        healthy, reference, refusal = None, None, ""
        start = time.perf_counter()
        try:
            healthy = analyse(recording, drawn.machine)
            alone_s = time.perf_counter() - start
            reference = learn([recording], drawn.machine)
        except GearmonError as error:
            alone_s, refusal = time.perf_counter() - start, str(error)
        return cls(
            drawn=drawn,
            first=first,
            tacho=tacho,
            healthy=healthy,
            reference=reference,
            alone_s=alone_s,
            refusal=refusal,
        )

    def outcome(self, trial: Trial, taken: Taken) -> Outcome:
        row = {**_truth(trial), "tacho": self.tacho, **_NOTHING}
        if self.reference is None or self.healthy is None:
            return Outcome(row={**row, "verdict": "refused", "note": self.refusal})
        recording = taken.recording if self.tacho else taken.recording.vibration()
        start = time.perf_counter()
        try:
            found = analyse(recording, self.drawn.machine, self.reference)
        except GearmonError as error:
            return Outcome(row={**row, "verdict": "refused", "note": str(error)})
        elapsed = time.perf_counter() - start
        row |= {
            "verdict": found.verdict,
            "score": found.score,
            "probability": found.false_alarm_probability,
            "run_time_s": elapsed,
            "alone_s": self.alone_s,
        }
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
        row |= {
            "found_kind": first.kind,
            "flag_probability": first.false_alarm_probability,
            "tooth_flag": any(is_tooth_flag(flag) for flag in found.flags),
        }
        tooth = next((flag for flag in found.flags if is_tooth_flag(flag)), None)
        if tooth is None:
            return row
        row |= {
            "found_stage": tooth.stage,
            "found_gear": tooth.gear,
            "found_tooth": tooth.tooth,
            "loss": tooth.stiffness_loss,
            "loss_low": tooth.stiffness_loss_low,
            "loss_high": tooth.stiffness_loss_high,
        }
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


_NOTHING: Row = {
    "verdict": "",
    "score": None,
    "probability": None,
    "flags": "",
    "found_kind": "",
    "flag_probability": None,
    "tooth_flag": False,
    "found_stage": None,
    "found_gear": None,
    "found_tooth": None,
    "gear_right": None,
    "tooth_error": None,
    "loss": None,
    "loss_low": None,
    "loss_high": None,
    "run_time_s": None,
    "alone_s": None,
    **dict.fromkeys(RIVALS),
    "note": "",
}


def _truth(trial: Trial) -> Row:
    condition, setting = trial.condition, trial.setting
    return {
        "condition": condition.kind,
        "variant": trial.variant,
        "stage": condition.stage or None,
        "gear": condition.gear or None,
        "tooth": condition.tooth,
        "size": condition.size,
        "load": setting.load,
        "speed": setting.speed,
        "gain": setting.gain,
    }


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
