"""Detection of damaged teeth on random machines, beside textbook indicators.

Every machine, its errors, paths, noise and faults are drawn; recordings come from
`detection_machines`: their meshes obey the package's equation of motion, and nothing else is shared
with the detector. Of each machine one healthy recording is the reference. New ones are healthy (as
the reference, or with load, speed or sensor gain changed), have one damaged tooth, or something
else that is no damaged tooth. The figures: areas under ROC curves against loss of stiffness, false
alarms against the stated probability, what was blamed, how well the loss was estimated, and run
times.

The other detectors get the same reference. Textbook indicators are taken as the logarithm of their
value over that of the reference recording, of the gear and channel where they rose most: the best
that a threshold can do without knowing where to look. The localised difference is the strongest of
what needs no template: averages subtracted, whitened, mesh gains fitted, and the energy at one
tooth held against that at the others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.benchmark.detection_machines import (
    DURATION_S,
    GEARS,
    Condition,
    DrawnMachine,
    Setting,
    Taken,
    draw_machine,
)
from gearmon.benchmark.timing import Row, task_time
from gearmon.diagnosis.analysis import analyse, learn
from gearmon.diagnosis.hypotheses.turns import aligned, departure_energy
from gearmon.diagnosis.results import Analysis, Flag
from gearmon.errors import GearmonError, check_range
from gearmon.signals import indicators
from gearmon.signals.recording import Recording
from gearmon.signatures.measured.indicators import gear_signals
from gearmon.signatures.measured.measurement import MeasuredSignature
from gearmon.signatures.measured.reference import Profile
from gearmon.terminal import Progress, followed

if TYPE_CHECKING:
    import pandas as pd

#: A recording and its analysis.
Heard = tuple[Taken, Analysis]
#: A new recording: condition, setting, which of `VARIANTS`, and with and without its tacho.
Trial = tuple[Condition, Setting, str, tuple[bool, ...]]

OURS, LOCALISED, LEARNING = "gearmon", "localised difference", "plain learning"
#: Textbook detectors, by the names of their indicators in an analysis; the last two are made here.
_TOLD = ("FM4", "energy ratio", "sideband energy ratio", "kurtosis", "residual energy", "NA4*")
TEXTBOOK = {name: {"sideband energy ratio": "SER"}.get(name, name) for name in _TOLD}
RIVALS = (*TEXTBOOK, LOCALISED, LEARNING)
LOSSES = (0.01, 0.025, 0.05, 0.1, 0.2, 0.4)
QUICK_LOSSES = (0.4,)
#: Load, speed and gain of healthy recordings over nominal, by the name of the variant; and one of
#: a housing that is warmer or colder, by 60 K of steel (212 GPa at 20 C, 200 GPa at 200 C).
VARIANTS, WARM, WARMTH = ("same", "load", "speed", "gain", "all"), "warm", 0.01
#: Sizes of the other conditions, see `Condition`.
SIZES = {
    "eccentricity": (2.0, 8.0),
    "misalignment": (0.05, 0.3),
    "bearing": (0.3, 0.8),
    "pitting": (0.05, 0.25),
    "wear": (0.2, 1.0),
}
OTHERS = tuple(SIZES)
#: Two recordings at one operating point differ by so much in load and speed.
LOAD_SPREAD, SPEED_SPREAD = 0.02, 0.002
#: A tooth is found if it is no further away [teeth].
TOOTH_WITHIN = 0.75
QUICK_S = 3.0
MACHINES, QUICK_MACHINES = 60, 2
#: Groups of machines of which the learning detector sees all but the one that it judges.
FOLDS = 5
#: False-alarm probabilities at which the healthy recordings are counted.
LEVELS = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3)
STATED = 0.01
RESAMPLES = 400
_LEAST = 1e-12
#: What is known of a recording that was refused.
_TEXTS = dict.fromkeys(("verdict", "flags", "found_kind", "note"), "")
_NUMBERS = (
    *("score", "probability", "flag_probability", "found_stage", "found_gear", "found_tooth"),
    *("gear_right", "tooth_error", "loss", "loss_low", "loss_high", "run_time_s", "alone_s"),
)
NOTHING: Row = _TEXTS | {"tooth_flag": False} | dict.fromkeys((*_NUMBERS, *RIVALS))


def run_detection(
    count: int = MACHINES,
    seed: int = 0,
    quick: bool = False,
    progress: Progress | None = None,
) -> list[Row]:
    """Judge the detector and its rivals on random machines.

    Parameters
    ----------
    count : int, >= 1
        Machines.
    seed : int, >= 0
    quick : bool
        Two machines, few and short recordings: figures that show only that all works.
    progress : callable, optional
        Called with the share done, 0 to 1.

    Returns
    -------
    list of dict
        One row an analysis: machine, truth, findings, run times, rivals.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.
    """
    check_range("count", count, 1, 1_000_000)
    check_range("seed", seed, 0, 2**63 - 1)
    if quick:
        count = min(count, QUICK_MACHINES)
    numbers = followed(range(count), count, progress)
    rows = [row for number in numbers for row in machine_trials(number, seed, quick)]
    return with_learning(rows, seed)


def with_learning(rows: Sequence[Row], seed: int = 0) -> list[Row]:
    """Add the scores of a learning detector, trained on healthy pairs of other machines.

    What many monitoring systems do: an isolation forest (Liu, Ting and Zhou, ICDM 2008) that has
    seen how the textbook indicators of healthy machines rise from one recording to the next.

    Parameters
    ----------
    rows : sequence of dict
        As of `machine_trials`.
    seed : int
    """
    from sklearn.ensemble import IsolationForest

    scored = [dict(row) for row in rows]
    told = [row for row in scored if row[LOCALISED] is not None]
    for tacho, fold in product((True, False), range(FOLDS)):
        heard = [row for row in told if row["tacho"] == tacho]
        judged = [row for row in heard if row["machine"] % FOLDS == fold]
        others = (row for row in heard if row["machine"] % FOLDS != fold)
        healthy = [row for row in others if row["condition"] == "healthy"]
        if len(healthy) < 2 or not judged:
            continue
        known, new = ([[row[k] for k in TEXTBOOK] for row in part] for part in (healthy, judged))
        scores = IsolationForest(random_state=seed).fit(known).score_samples(new)
        for row, score in zip(judged, scores, strict=True):
            row[LEARNING] = -float(score)
    return scored


def machine_trials(number: int, seed: int, quick: bool = False) -> Iterator[Row]:
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
    first = drawn.take(Condition(), _setting(rng, "same", QUICK_S if quick else DURATION_S))
    judges = {tacho: _judge(drawn, first, tacho) for tacho in (True, False)}
    teeth = ", ".join(f"{s.gears[0].teeth}/{s.gears[1].teeth}" for s in drawn.stages)
    facts: Row = {"machine": number, "teeth": teeth, "speed_hz": round(drawn.speed_hz, 3)}
    facts["channels"] = len(drawn.path)
    for condition, setting, variant, tachos in list(_plan(rng, drawn, quick)):
        taken = drawn.take(condition, setting)
        where = {name: getattr(condition, name) or None for name in ("stage", "gear", "tooth")}
        truth = {"condition": condition.kind, "variant": variant, **where, "size": condition.size}
        truth |= {name: getattr(setting, name) for name in ("load", "speed", "gain", "warmth")}
        for tacho in tachos:
            yield facts | truth | {"tacho": tacho} | NOTHING | judges[tacho](condition, taken)


def _setting(rng: np.random.Generator, variant: str, duration_s: float) -> Setting:
    load = 1 + LOAD_SPREAD * rng.uniform(-1, 1)
    speed = 1 + SPEED_SPREAD * rng.uniform(-1, 1)
    load = rng.uniform(0.8, 1.2) if variant in ("load", "all") else load
    speed = rng.uniform(0.98, 1.02) if variant in ("speed", "all") else speed
    gain = 2.0 ** rng.uniform(-1, 1) if variant in ("gain", "all") else 1.0
    known: Row = {"seed": int(rng.integers(1 << 31)), "duration_s": duration_s}
    known["warmth"] = WARMTH * rng.uniform(-1, 1) if variant == WARM else 0.0
    return Setting(load=load, speed=speed, gain=gain, **known)


def _plan(rng: np.random.Generator, drawn: DrawnMachine, quick: bool) -> Iterator[Trial]:
    duration_s, both = QUICK_S if quick else DURATION_S, (True, False)
    for variant in ("same", "all") if quick else ("same", *VARIANTS):
        tachos = both if variant == "same" else both[:1]
        yield Condition(), _setting(rng, variant, duration_s), variant, tachos
    for loss in QUICK_LOSSES if quick else LOSSES:
        condition = _somewhere(rng, drawn, "tooth", loss)
        yield condition, _setting(rng, "same", duration_s), "same", both
    for kind in ("pitting",) if quick else OTHERS:
        condition = _somewhere(rng, drawn, kind, rng.uniform(*SIZES[kind]))
        yield condition, _setting(rng, "same", duration_s), "same", both[:1]
    if not quick:
        yield Condition(), _setting(rng, WARM, duration_s), WARM, both[:1]


def _somewhere(rng: np.random.Generator, drawn: DrawnMachine, kind: str, size: float) -> Condition:
    """Draw where a condition is."""
    seed = int(rng.integers(1 << 31))
    if kind == "bearing":
        return Condition(kind=kind, size=size, seed=seed)
    stage, side = int(rng.integers(len(drawn.stages))), int(rng.integers(2))
    teeth = drawn.stages[stage].gears[side].teeth
    tooth = int(rng.integers(teeth)) + 1 if kind == "tooth" else None
    where: dict[str, Any] = {"stage": stage + 1, "gear": GEARS[side], "tooth": tooth}
    return Condition(kind=kind, size=size, seed=seed, **where)


def _judge(drawn: DrawnMachine, first: Taken, tacho: bool) -> Callable[[Condition, Taken], Row]:
    """Learn from one recording, with or without its tacho; return what judges new ones."""
    machine = drawn.machine

    def recording(taken: Taken) -> Recording:
        return taken.recording if tacho else taken.recording.vibration()

    try:
        alone_s, healthy = task_time(lambda: analyse(recording(first), machine))
        reference = learn([recording(first)], machine)
    except GearmonError as error:
        unheard = {"verdict": "refused", "note": str(error)}
        return lambda *_: unheard

    def outcome(condition: Condition, taken: Taken) -> Row:
        try:
            run_time_s, found = task_time(lambda: analyse(recording(taken), machine, reference))
        except GearmonError as error:
            return {"verdict": "refused", "note": str(error)}
        row: Row = {"run_time_s": run_time_s, "alone_s": alone_s, "verdict": found.verdict}
        row |= {"score": found.score, "probability": found.false_alarm_probability}
        row |= {"flags": "; ".join(flag.kind for flag in found.flags)}
        for flag in found.flags[:1]:
            row |= {"found_kind": flag.kind, "flag_probability": flag.false_alarm_probability}
        for flag in [flag for flag in found.flags if is_tooth_flag(flag)][:1]:
            row |= {"tooth_flag": True, "loss": flag.stiffness_loss}
            row |= {"found_stage": flag.stage, "found_gear": flag.gear, "found_tooth": flag.tooth}
            row |= {"loss_low": flag.stiffness_loss_low, "loss_high": flag.stiffness_loss_high}
            if condition.kind == "tooth":
                right = (flag.stage, flag.gear) == (condition.stage, condition.gear)
                both = (taken, found), (first, healthy)
                away = tooth_error(drawn, condition, flag, both) if right else None
                row |= {"gear_right": right, "tooth_error": away}
        heard = found.signature.found and healthy.signature.found
        return row | rises(found, healthy) if heard else row

    return outcome


def tooth_error(
    drawn: DrawnMachine, condition: Condition, flag: Flag, recordings: Sequence[Heard]
) -> float | None:
    """Return the distance of the tooth found from the true one [teeth]; None without a place.

    Parameters
    ----------
    drawn : DrawnMachine
    condition : Condition
        The truth.
    flag : Flag
        Its tooth is counted from the pulse on shaft 1 where the gear turns with it, else from the
        angle zero of the new recording or of the reference: either is as good. Without a number
        the place of the gear's profile is taken, where the contact has its middle.
    recordings : sequence of (Taken, Analysis)
        The new one and the reference.
    """
    number, side = condition.stage - 1, GEARS.index(condition.gear)
    stage = drawn.stages[number]
    teeth, per_turn = stage.gears[side].teeth, drawn.shaft_orders[number] * stage.gears[0].teeth
    # teeth that have entered contact where the angle is zero, be it before the start
    zeros = [
        taken.turns_at(float(analysis.signature.track.time_at(np.zeros(1))[0])) * per_turn
        for taken, analysis in recordings
    ]
    true = [(condition.tooth or 1) - 1 - entered for entered in zeros]
    if flag.tooth is not None:
        return min(_around(flag.tooth - 1 - place, teeth) for place in true)
    for profile in recordings[0][1].profiles:
        if (profile.stage, profile.gear) == (flag.stage, flag.gear):
            return _around(profile.position * teeth - true[0] - 0.5 * stage.model.reach, teeth)
    return None


def is_tooth_flag(flag: Flag) -> bool:
    """Tell whether a flag blames one tooth."""
    return flag.tooth is not None or "tooth" in flag.kind or flag.kind in ("crack", "breakage")


def _around(distance: float, teeth: int) -> float:
    """Return the distance of two places on a gear [teeth], the shorter way round."""
    away = distance % teeth
    return min(away, teeth - away)


def rises(new: Analysis, healthy: Analysis) -> dict[str, float]:
    """Compare a recording with the reference by indicators.

    Parameters
    ----------
    new, healthy : Analysis

    Returns
    -------
    dict
        Greatest rise of each indicator, as natural logarithm.
    """
    ours, theirs = (_by_place(one, healthy.signature) for one in (new, healthy))
    found = {LOCALISED: localised_difference(new.signature, healthy.signature)}
    for detector, name in TEXTBOOK.items():
        pairs = [(ours[key], theirs[key]) for key in ours if key[0] == name and key in theirs]
        own, known = np.maximum(pairs or [(1.0, 1.0)], _LEAST).T
        found[detector] = float(np.log(own / known).max())
    return found


def _by_place(analysis: Analysis, healthy: MeasuredSignature) -> dict[tuple[str, ...], float]:
    """Return indicators by name, gear and channel; NA4* divides by the reference's variance."""
    found: dict[tuple[str, ...], float] = {}
    for name, values in analysis.indicators.items():
        kind, _, gear = name.partition(", ")
        found |= {(kind, gear, channel): value for channel, value in values.items()}
    wheels = {(wheel.stage, wheel.gear): wheel for wheel in healthy.plan.wheels}
    signature = analysis.signature
    for wheel in signature.plan.wheels:
        known = wheels.get((wheel.stage, wheel.gear))
        if known is None or not len(wheel.number) or not len(known.number):
            continue
        own = gear_signals(signature.lines.mean, wheel).residual
        sound = np.var(gear_signals(healthy.lines.mean, known).residual, axis=-1)
        energy, star = indicators.rms(own) ** 2, indicators.na4(own, sound[None])
        for name, row in (("residual energy", energy), ("NA4*", star)):
            found |= {(name, str(wheel), f"{n}"): float(value) for n, value in enumerate(row)}
    return found


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
        Largest energy over two teeth, over that of the median, of all gears, in decibels; 0 if none
        can be judged.
    """
    own, known = Profile.of(signature), Profile.of(healthy)
    best = 0.0
    for wheel in own.wheels:
        other = wheel.same_in(known.wheels)
        if other is None:
            continue
        # a pulse on shaft 1 tells where the gears on it stand
        same = own.tacho and known.tacho and abs(wheel.order - 1.0) < 1e-12
        new, old = aligned(wheel, other, same_zero=same)
        if len(new.number):
            best = max(best, 10.0 * float(np.log10(departure_energy(new, old).max())))
    return best


def roc_area_interval(
    healthy: Sequence[FloatArray], faulty: Sequence[FloatArray], seed: int = 0
) -> tuple[float, float, float]:
    """Area under the ROC curve with a 95 % interval by resampling of machines.

    Recordings of one machine resemble one another, so that whole machines are drawn.

    Parameters
    ----------
    healthy, faulty : sequence of ndarray
        Scores, machine by machine; of a machine there may be none. One each there must be.
    seed : int

    Returns
    -------
    (float, float, float)
        Area, the probability that a faulty score exceeds a healthy one (ties count half); lower and
        upper limit.

    Examples
    --------
    >>> roc_area_interval([np.array([0.0, 1.0])], [np.array([1.0, 2.0])])[0]
    0.875
    """
    low, high = np.concatenate(healthy), np.concatenate(faulty)
    in_order, machines = (high > low[:, None]) + 0.5 * (high == low[:, None]), len(healthy)
    chosen = np.random.default_rng(seed).integers(0, machines, (RESAMPLES, machines))
    drawn = (chosen[:, :, None] == np.arange(machines)).sum(axis=1)
    # how often each score was drawn
    left, right = (np.repeat(drawn, [*map(len, own)], axis=1) for own in (healthy, faulty))
    pairs = left.sum(axis=1) * right.sum(axis=1)
    areas = ((left @ in_order) * right).sum(axis=1)[pairs > 0] / pairs[pairs > 0]
    return float(in_order.mean()), *np.quantile(areas, (0.025, 0.975)).tolist()


def detection_summary(rows: Sequence[Row]) -> list[Row]:
    """All figures of merit, one a row, with intervals.

    Parameters
    ----------
    rows : sequence of dict
        From `run_detection`.

    Returns
    -------
    list of dict
        ``figure, detector, of, tacho, value, low, high, count``; 95 % intervals, by machines for
        ROC areas, by Wilson for shares; quartiles for errors of the loss and run times.
    """
    import pandas as pd

    columns = ("figure", "detector", "of", "value", "low", "high", "count")
    found = []
    for tacho, own in pd.DataFrame(rows).groupby("tacho", sort=False):
        told = ((figure, OURS, of, *_summed(v), len(v)) for figure, of, v in _told(own) if len(v))
        figures = [dict(zip(columns, one, strict=True)) for one in (*_areas(own), *told)]
        found += [one | {"tacho": bool(tacho)} for one in figures]
    return found


def _summed(values: pd.Series[Any]) -> tuple[float, float, float]:
    """Return a share with its 95 % interval by Wilson, or a median with its quartiles."""
    from scipy.stats import binomtest

    if values.dtype == bool:
        share = binomtest(int(values.sum()), len(values))
        return share.statistic, *map(float, share.proportion_ci(method="wilson"))
    median, low, high = np.quantile(values.astype(float), (0.5, 0.25, 0.75)).tolist()
    return median, low, high


#: Figure, detector, of what; value, lower and upper limit; count.
_Figure = tuple[str, str, str, float, float, float, int]


def _areas(rows: pd.DataFrame) -> Iterator[_Figure]:
    """Areas under ROC curves, healthy at the same operating point against one damaged tooth."""
    machines = rows["machine"].unique().tolist()
    sound = rows[(rows["condition"] == "healthy") & (rows["variant"] == "same")]
    for loss, hurt in rows[rows["condition"] == "tooth"].groupby("size"):
        for name in (OURS, *RIVALS):
            low, high = (_by_machine(part, name, machines) for part in (sound, hurt))
            count = sum(map(len, high))
            if count and sum(map(len, low)):
                area = roc_area_interval(low, high)
                yield "ROC area", name, f"loss {loss:.3g}", *area, count


def _by_machine(rows: pd.DataFrame, name: str, machines: Sequence[int]) -> list[FloatArray]:
    scores = rows["score" if name == OURS else name].astype(float)
    # a recording that is refused is no evidence of a fault
    scores = scores.fillna(-np.inf) if name == OURS else scores.dropna()
    return [np.asarray(scores[rows["machine"] == one], dtype=np.float64) for one in machines]


def _told(rows: pd.DataFrame) -> Iterator[tuple[str, str, pd.Series[Any]]]:
    """Yield figure, of what, and whether it holds for each recording, or a number of each.

    False alarms are healthy recordings whose stated probability is at most so large; then come
    right gears and teeth, error and coverage of the loss, others called a tooth, and run times.
    """
    sound = rows[(rows["condition"] == "healthy") & (rows["probability"].notna())]
    for level in LEVELS:
        yield "false alarms", f"stated {level:g}", sound["probability"] <= level
    for variant, own in sound.groupby("variant", sort=False):
        yield "false alarms", f"stated {STATED:g}, {variant}", own["probability"] <= STATED
    for loss, own in rows[rows["condition"] == "tooth"].groupby("size"):
        of, size = f"loss {loss:.3g}", float(str(loss))
        flagged = own[own["tooth_flag"].astype(bool)]
        sized = own[own["gear_right"].eq(True) & own["loss"].notna()]
        bounded = sized[sized["loss_low"].notna()]
        yield "called a fault", of, own["verdict"] == "fault"
        yield "gear right", of, flagged["gear_right"].eq(True)
        yield "tooth right", of, flagged["tooth_error"].astype(float) <= TOOTH_WITHIN
        covers = bounded["loss_low"].le(size) & bounded["loss_high"].ge(size)
        yield "interval covers", of, covers
        yield "loss error, quartiles", of, sized["loss"].astype(float) / size - 1
    for kind, own in rows[rows["condition"] != "tooth"].groupby("condition", sort=False):
        yield "called a fault", str(kind), own["verdict"] == "fault"
        yield "called a tooth", str(kind), own["tooth_flag"].astype(bool)
    timed = rows[rows["run_time_s"].notna()]
    yield "run time in s", "with reference", timed["run_time_s"].astype(float)
    yield "run time in s", "without", timed.groupby("machine")["alone_s"].first().astype(float)
