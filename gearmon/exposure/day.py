"""A working day of several jobs: A(8), dose value, how sure they are, when limits are reached.

    A(8)^2 = sum of a_i^2 T_i / 8 h,     VDV^4 = sum of VDV_i^4 T_i / t_i

with a_i and VDV_i of a recording of t_i, its axis counted with k, in a job of T_i. The day is
judged by its worst axis, the hand by its vector sum.

The plan is a file (TOML); recordings stand beside it:

    position = "seat"                 # or "hand", "standing"
    instrument = 0.04                 # relative standard error that all recordings share

    [limits]                          # optional: those of Directive 2002/44/EC else
    action_ms2 = 0.5
    limit_ms2 = 1.15

    [[job]]                           # in the order of the day
    name = "ploughing"
    recording = "plough.csv"          # or several: ["one.csv", "two.csv"]
    hours = 4.5
    hours_error = 0.5                 # standard error; 0 if left out
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.errors import ArgumentError
from gearmon.exposure.measures import LEAST_S, LIMITS, Exposure, Limits, vibration_exposure
from gearmon.machine import FieldError, fields
from gearmon.machine.fields import Checked, Choice, Several, Text, check_fields, held, within
from gearmon.result import Result

#: Relative standard error of an instrument: all of the tolerance of ISO 8041-1, table 2, for its
#: indication at the reference frequency.
INSTRUMENT = 0.04
#: Standard errors to either side that an interval holds: 95 %.
COVERAGE = 2.0
_POINTS_A_JOB = 60
#: What was felt in the recordings of each job.
Felt = Sequence[Sequence[Exposure]]
#: By the power that is summed up: name and unit of a dose, ending of its limits, and the hours over
#: which it is a mean; VDV is a sum over seconds.
_DOSES = {2: ("A(8)", "m/s2", "ms2", 8.0), 4: ("VDV", "m/s^1.75", "vdv", 1 / 3600)}


@dataclass(frozen=True, kw_only=True)
class Job(Checked):
    """A job of the day.

    Parameters
    ----------
    name : str
    recording : str or sequence of str
        One or several recordings of it.
    hours : float, above 0, up to 24
        How long a day a person is exposed to it [h].
    hours_error : float, 0 to 12
        Standard error of that [h].

    Raises
    ------
    FieldError
        If a value is out of its range.
    """

    name: str = held(Text(example='"ploughing"'))
    recording: str | Sequence[str] = held(
        Several(rule=Text(), one=True, example='"a.csv", or ["a.csv", "b.csv"]')
    )
    hours: float = within(0, 24, "h", open_low=True)
    hours_error: float = within(0, 12, "h", default=0.0)


@dataclass(frozen=True, kw_only=True)
class DayPlan:
    """What a person does in a day.

    Parameters
    ----------
    jobs : tuple of Job
        In the order of the day, 24 h at most.
    position : {"seat", "hand", "standing"}
    instrument : float, 0 to 0.5
        Relative standard error that all recordings share.
    limits : Limits, optional
        By default those of Directive 2002/44/EC.
    path : str
        The file it was read from, if any.

    Raises
    ------
    FieldError
        If a value is out of its range, or the jobs do not fit in a day.
    """

    jobs: tuple[Job, ...]
    position: str = held(Choice(options=tuple(LIMITS)), "seat")
    instrument: float = within(0, 0.5, default=INSTRUMENT)
    limits: Limits | None = None
    path: str = ""

    def __post_init__(self) -> None:
        check_fields(self)
        object.__setattr__(self, "limits", self.limits or LIMITS[self.position])
        if not self.jobs:
            raise FieldError("job", "is missing: write [[job]] with name, recording and hours")
        total = math.fsum(job.hours for job in self.jobs)
        if total > 24:
            told = f"must sum to 24 h at most over all jobs; it is {total:g}"
            raise FieldError("job.hours", told)


def load_day(path: str | Path) -> DayPlan:
    """Read the plan of a day; recordings are looked for beside it.

    Parameters
    ----------
    path : str or Path
        TOML as in the docstring of `gearmon.exposure.day`.

    Returns
    -------
    DayPlan

    Raises
    ------
    MachineFileError
        If the file cannot be read, or a key is unknown, missing or out of its range: with file,
        line, key and value.
    """
    source, folder = fields.read_source(path), Path(path).parent
    document, usual = source.document, ("position", "instrument")
    source.refuse_unknown_keys(document, (*usual, "limits", "job"))
    jobs = [source.part(Job, *own) for own in source.tables("job")]
    limits = source.table("limits")
    placed = [
        dataclasses.replace(job, recording=[str(folder / name) for name in job.recording])
        for job in jobs
    ]
    told = {key: document[key] for key in usual if key in document}
    told |= {"jobs": tuple(placed), "path": str(path)}
    told["limits"] = source.part(Limits, "limits", limits) if limits else None
    return source.part(DayPlan, "", told)


@dataclass(frozen=True, kw_only=True)
class Dose:
    """A(8) or the dose value of a day.

    Parameters
    ----------
    measure : {"A(8)", "VDV"}
    unit : str
    value, low, high : float
        With its interval of 95 %.
    axis : str
        The worst one, or "vector sum".
    action, limit : float or None
    verdict : str
        "above the limit value", "above the action value" or "below the action value"; with "may be"
        before it where the interval holds the value in question.
    reached_h : dict of str to float or None
        Hours of work after which "action" and "limit" are reached in this day; None: not in it.
    """

    measure: str
    unit: str
    value: float
    low: float
    high: float
    axis: str
    action: float | None
    limit: float | None
    verdict: str
    reached_h: Mapping[str, float | None]


@dataclass(frozen=True, kw_only=True)
class JobExposure:
    """What one job adds.

    Parameters
    ----------
    name : str
    recordings : int
    hours : float
    value_ms2 : float
        Weighted rms times k along the day's worst axis [m/s2].
    a8_ms2 : float
        A(8) of a day with this job only [m/s2].
    share : float
        Of the day's A(8) squared.
    action_h, limit_h : float or None
        Hours of this job alone after which A(8) is at the action and the limit value.
    """

    name: str
    recordings: int
    hours: float
    value_ms2: float
    a8_ms2: float
    share: float
    action_h: float | None
    limit_h: float | None


@dataclass(frozen=True, kw_only=True)
class DayExposure(Result):
    """Exposure of a person over a day.

    Parameters
    ----------
    plan, position : str
    hours : float
        Of all jobs [h].
    jobs : tuple of JobExposure
    doses : tuple of Dose
        A(8), and the dose value where it is known.
    warnings : tuple of str
    course_h : tuple of float
        Hours of work for which `course` tells the doses.
    course : dict of str to tuple of float
        A(8) and VDV as they grow [m/s2, m/s^1.75], by their names.
    """

    picture: ClassVar[str] = "survey_plots.day_exposure_figure"

    plan: str
    position: str
    hours: float
    jobs: tuple[JobExposure, ...]
    doses: tuple[Dose, ...]
    warnings: tuple[str, ...]
    course_h: tuple[float, ...]
    course: Mapping[str, tuple[float, ...]]

    @property
    def flagged(self) -> bool:
        """Whether an action value is reached, by A(8) or VDV, as far as is known."""
        return any(dose.action is not None and dose.value >= dose.action for dose in self.doses)

    def headline(self) -> str:
        """Return A(8) with its interval, and the verdict."""
        told = [
            f"{d.measure} {d.value:.3g} {d.unit} ({d.low:.3g} to {d.high:.3g}), {d.verdict}"
            for d in self.doses
        ]
        return "; ".join(told)

    def rows(self) -> list[dict[str, Any]]:
        """Return a row a job."""
        return [dataclasses.asdict(job) for job in self.jobs]


def exposure_day(
    plan: DayPlan | str | Path, axes: Mapping[str, str | int] | None = None, **reading: Any
) -> DayExposure:
    """Sum up the exposure of a day.

    Parameters
    ----------
    plan : DayPlan, str or Path
        Or the name of its file.
    axes : mapping of str to str or int, optional
        As of `vibration_exposure`.
    **reading : float, str or list of Sensor
        sampling_rate_hz, unit, sensors and range_ms2 of `vibration_exposure`.

    Returns
    -------
    DayExposure

    Raises
    ------
    GearmonError
        If the plan or a recording cannot be used; the line names it.

    Examples
    --------
    >>> from gearmon.exposure import DayPlan, Job
    >>> from gearmon.simulation import write_simulation
    >>> _ = write_simulation(new, "mowing.csv")
    >>> jobs = (Job(name="mowing", recording="mowing.csv", hours=4.0),)
    >>> plan = DayPlan(jobs=jobs, position="hand")
    >>> gearmon.exposure_day(plan, {"x": "a1", "y": "a2"}).hours
    4.0
    """
    plan = plan if isinstance(plan, DayPlan) else load_day(plan)
    felt = [
        [vibration_exposure(path, plan.position, axes, **reading) for path in job.recording]
        for job in plan.jobs
    ]
    return sum_up(plan, felt)


def sum_up(plan: DayPlan, felt: Felt) -> DayExposure:
    """Sum up a day whose recordings are weighed already.

    Parameters
    ----------
    plan : DayPlan
    felt : sequence of sequence of Exposure
        Those of each job.

    Returns
    -------
    DayExposure

    Raises
    ------
    ArgumentError
        If recordings show different axes.
    """
    every = [exposure for job in felt for exposure in job]
    known = {tuple(axis.axis for axis in e.axes) for e in every}
    if len(known) > 1:
        told = " and ".join("".join(axes) for axes in sorted(known))
        raise ArgumentError(f"day: recordings with axes {told}; all must show the same axes")
    told_of = ((e.recording, told) for e in every for told in (*e.advice, *e.warnings))
    # that on the statistics of VDV is said once for the day
    warnings = [f"{name}: {told}" for name, told in told_of if "statistics of VDV" not in told]
    powers, short = [2], [e for e in every if e.duration_s < LEAST_S[0.5]]
    if plan.position != "hand" and not short:
        powers.append(4)
    elif plan.position != "hand":
        warnings.append(
            f"{short[0].recording}: {short[0].duration_s:.4g} s are too short for the statistics "
            f"of VDV, {LEAST_S[0.5]:g} s are needed: none is told for the day"
        )
    grown = [_growth(plan, felt, power) for power in powers]
    if any(np.isnan(error).any() for _, error, _ in grown):
        warnings.append("a recording is too short to see its scatter: intervals leave it out")
    hours = np.array([job.hours for job in plan.jobs])
    ends = np.append(0.0, np.cumsum(hours))
    # closer behind the start of a job: a dose of nothing begins steeply
    at = (ends[:-1, None] + np.multiply.outer(hours, np.linspace(0, 1, _POINTS_A_JOB) ** 3)).ravel()
    doses, course = [], {}
    for power, growth in zip(powers, grown, strict=True):
        dose, grows = _dose(plan, power, growth, ends)
        doses.append(dose)
        course[dose.measure] = tuple(grows(at).tolist())
    return DayExposure(
        plan=plan.path or "plan",
        position=plan.position,
        hours=float(ends[-1]),
        jobs=tuple(_jobs(plan, felt, grown[0][0])),
        doses=tuple(doses),
        warnings=tuple(dict.fromkeys(warnings)),
        course_h=tuple(at.tolist()),
        course=course,
    )


def _growth(plan: DayPlan, felt: Felt, power: int) -> tuple[FloatArray, FloatArray, str]:
    """Return how fast a dose grows in each job, with its error, and the axis that it is of.

    That is the mean p-th power, k included, of the worst axis of the day; of the hand, of all. The
    standard errors follow from how the recordings of a job differ, of a single one from its
    stretches; NaN where that is not known.
    """
    means, errors = [], []
    for job in felt:
        sizes = [[a.factor * (a.rms_ms2 if power == 2 else a.vdv) for a in e.axes] for e in job]
        # VDV is a sum over the recording
        spans = [1.0 if power == 2 else e.duration_s for e in job]
        own = np.array(sizes) ** power / np.array(spans)[:, None]
        scatter = [a.square_scatter if power == 2 else a.fourth_scatter for a in job[0].axes]
        single = own[0] * np.array(scatter, dtype=np.float64)  # None becomes NaN
        means.append(own.mean(axis=0))
        errors.append(own.std(axis=0, ddof=1) / math.sqrt(len(job)) if len(job) > 1 else single)
    mean, error = np.array(means), np.array(errors)
    if plan.position == "hand":
        return mean.sum(axis=1), np.linalg.norm(error, axis=1), "vector sum"
    most = int(np.argmax(np.array([job.hours for job in plan.jobs]) @ mean))
    return mean[:, most], error[:, most], felt[0][0].axes[most].axis


def _jobs(plan: DayPlan, felt: Felt, squares: FloatArray) -> Iterator[JobExposure]:
    limits, total = plan.limits, float(squares @ [job.hours for job in plan.jobs]) or 1.0
    assert limits is not None
    for job, own, square in zip(plan.jobs, felt, squares.tolist(), strict=True):
        yield JobExposure(
            name=job.name,
            recordings=len(own),
            hours=job.hours,
            value_ms2=math.sqrt(square),
            a8_ms2=math.sqrt(square * job.hours / 8),
            share=square * job.hours / total,
            action_h=8 * limits.action_ms2**2 / square if square else None,
            limit_h=8 * limits.limit_ms2**2 / square if square else None,
        )


def _dose(
    plan: DayPlan, power: int, growth: tuple[FloatArray, FloatArray, str], ends_h: FloatArray
) -> tuple[Dose, Callable[[FloatArray], FloatArray]]:
    """Sum up, with the errors of what was recorded and of the hours, and compare with limits.

    Returns
    -------
    dose, and what returns it at times of the day
    """
    measure, unit, name, span_h = _DOSES[power]
    mean, error, axis = growth
    taken = np.append(0.0, np.cumsum(mean * np.diff(ends_h)))

    def grown(at_h: FloatArray) -> FloatArray:
        return np.asarray((np.interp(at_h, ends_h, taken) / span_h) ** (1 / power))

    total, late = float(taken[-1]), np.array([job.hours_error for job in plan.jobs])
    errors = [np.nan_to_num(error) * np.diff(ends_h), mean * late]
    own = float(np.linalg.norm(errors)) / total / power if total else 0.0
    relative = COVERAGE * math.hypot(own, plan.instrument)
    value = float(grown(ends_h[-1]))
    low, high = value * max(0.0, 1 - relative), value * (1 + relative)
    values = {of: getattr(plan.limits, f"{of}_{name}") for of in ("action", "limit")}
    verdict, reached = "below the action value", dict.fromkeys(values)
    for of, wanted in values.items():
        if wanted is not None and high >= wanted:
            verdict = f"{'' if low >= wanted else 'may be '}above the {of} value"
        needed = math.inf if wanted is None else wanted**power * span_h
        if needed <= total:
            reached[of] = float(np.interp(needed, taken, ends_h))
    told: dict[str, Any] = {"measure": measure, "unit": unit, "axis": axis, "verdict": verdict}
    return Dose(value=value, low=low, high=high, **values, reached_h=reached, **told), grown
