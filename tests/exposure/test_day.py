"""A day of several jobs: the sums of the standards, their errors, when limits are reached."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.errors import GearmonError
from gearmon.exposure import DayPlan, Exposure, Job, Limits, exposure_day, load_day, sum_up
from gearmon.exposure.measures import LIMITS, AxisExposure


def axis(name, rms, factor=1.0, scatter=0.0, vdv=1.0):
    values = {"mean_ms2": 0.0, "peak_ms2": rms, "mtvv_ms2": rms, "crest_factor": 1.0}
    scatters = {"square_scatter": scatter, "fourth_scatter": scatter, "filter_error": 0.0}
    told = {"axis": name, "channel": name, "weighting": "Wk", "factor": factor}
    return AxisExposure(**told, rms_ms2=rms, vdv=vdv, **values, **scatters)


def felt(*axes, position="seat", duration=300.0):
    """An exposure with these axes; the rest does not enter the day."""
    nothing = {"value_ms2": 0.0, "value_axis": "", "vector_sum_ms2": 0.0, "vdv": 0.0}
    arrays = {"running_ms2": np.zeros((1, 1)), "band_hz": np.ones(1), "band_ms2": np.ones((1, 1))}
    return Exposure(
        recording="a.csv", position=position, duration_s=duration, sampling_rate_hz=1000.0,
        axes=axes, limits=None, advice=(), warnings=(), **nothing, **arrays,
    )  # fmt: skip


def plan(*hours, position="seat", errors=None, instrument=0.0, limits=None):
    late = errors or [0.0] * len(hours)
    jobs = tuple(
        Job(name=f"job {n}", recording="a.csv", hours=h, hours_error=e)
        for n, (h, e) in enumerate(zip(hours, late, strict=True), start=1)
    )
    return DayPlan(jobs=jobs, position=position, instrument=instrument, limits=limits)


def test_a_tool_for_two_and_a_half_hours():
    """ISO 5349-2, example E.2.1: 7.4 m/s2 for 2.5 h a day are 4.1 m/s2."""
    tool = felt(*(axis(name, 7.4 / np.sqrt(3)) for name in "xyz"), position="hand")
    day = sum_up(plan(2.5, position="hand"), [[tool]])
    assert day.doses[0].value == pytest.approx(4.1, abs=0.05)
    assert (day.doses[0].axis, len(day.doses)) == ("vector sum", 1)
    assert day.doses[0].verdict == "above the action value"
    # 8 h (2.5 / 7.4)^2 and 8 h (5 / 7.4)^2 at this tool
    assert day.jobs[0].action_h == pytest.approx(0.913, abs=1e-3)
    assert day.jobs[0].limit_h == pytest.approx(3.652, abs=1e-3)


def test_jobs_add_by_energy_and_fourth_powers():
    jobs = [[felt(axis("x", 0.4, 1.4, vdv=3.0))], [felt(axis("x", 0.8, 1.4, vdv=4.0))]]
    day = sum_up(plan(4.0, 1.0), jobs)
    a8, vdv = day.doses
    assert a8.value == pytest.approx(1.4 * np.sqrt((0.16 * 4 + 0.64 * 1) / 8))
    assert vdv.value == pytest.approx(1.4 * (81.0 * 4 * 12 + 256.0 * 1 * 12) ** 0.25)
    assert [job.share for job in day.jobs] == pytest.approx([0.5, 0.5])
    assert day.jobs[0].a8_ms2 == pytest.approx(1.4 * 0.4 * np.sqrt(0.5))
    assert [job.value_ms2 for job in day.jobs] == pytest.approx([1.4 * 0.4, 1.4 * 0.8])
    # the action value of 0.5 is reached within the second job
    needed = 8 * 0.25 / 1.96
    assert a8.reached_h["action"] == pytest.approx(4.0 + (needed - 0.64) / 0.64)
    assert a8.reached_h["limit"] is None
    assert day.course["A(8)"][-1] == pytest.approx(a8.value)
    assert day.course["VDV"][0] == 0.0
    assert np.all(np.diff(day.course["VDV"]) >= 0)
    assert day.flagged


def test_the_worst_axis_judges_the_day_not_the_job():
    jobs = [[felt(axis("x", 0.5), axis("z", 0.3))], [felt(axis("x", 0.1), axis("z", 0.6))]]
    day = sum_up(plan(3.0, 3.0), jobs)
    assert day.doses[0].axis == "z"
    assert day.doses[0].value == pytest.approx(np.sqrt((0.09 + 0.36) * 3 / 8))


def test_errors_follow_from_recordings_hours_and_instrument():
    """d(A8)/A8 is half of the relative error of the energy; the instrument's adds in full."""
    one = felt(axis("z", 0.5, scatter=0.1))
    by_scatter = sum_up(plan(8.0), [[one]]).doses[0]
    assert by_scatter.high / by_scatter.value == pytest.approx(1 + 2 * 0.05)
    by_hours = sum_up(plan(8.0, errors=[0.8]), [[felt(axis("z", 0.5))]]).doses[0]
    assert by_hours.low / by_hours.value == pytest.approx(1 - 2 * 0.05)
    by_both = sum_up(plan(8.0, instrument=0.04), [[one]]).doses[0]
    assert by_both.high / by_both.value == pytest.approx(1 + 2 * np.hypot(0.05, 0.04))
    # several recordings of a job: their mean, and how they scatter
    squares = np.array([0.2, 0.3, 0.4])
    several = [felt(axis("z", float(np.sqrt(own)), scatter=9.0)) for own in squares]
    found = sum_up(plan(8.0), [several]).doses[0]
    assert found.value == pytest.approx(np.sqrt(0.3))
    relative = squares.std(ddof=1) / np.sqrt(3) / 0.3
    assert found.high / found.value == pytest.approx(1 + relative)


@pytest.mark.parametrize(
    ("rms", "told"),
    [
        (0.3, "below the action value"),
        (0.48, "may be above the action value"),
        (0.52, "may be above the action value"),
        (0.6, "above the action value"),
        (1.1, "may be above the limit value"),
        (1.18, "may be above the limit value"),
        (1.3, "above the limit value"),
    ],
)
def test_verdicts_heed_the_interval(rms, told):
    day = sum_up(plan(8.0, instrument=0.04), [[felt(axis("z", rms))]])
    assert day.doses[0].verdict == told
    assert told in day.headline()


@pytest.mark.parametrize(
    ("rms", "shown"),
    [
        (0.3, {"action": 0.5, "limit": 1.15}),
        (0.2, {"action": 0.5}),
        (2.0, {"action": 0.5, "limit": 1.15}),
    ],
)
def test_a_picture_of_the_day_holds_its_curve_and_the_limits_that_are_near(rms, shown):
    day = sum_up(plan(5.0, 3.0, instrument=0.04), [[felt(axis("z", rms))]] * 2)
    ax = np.ravel(day.plot())[0]
    assert ax.get_xlim() == (0.0, 8.0)
    assert ax.get_ylabel() == "A(8) in m/s²"
    hours, grown = ax.lines[0].get_data()
    # all alike: as the root of the hours
    np.testing.assert_allclose(grown, rms * np.sqrt(hours / 8), atol=1e-12)
    levels = {line.get_ydata()[0] for line in ax.lines if len(set(line.get_ydata())) == 1}
    assert set(shown.values()) <= levels
    for own in (*shown.values(), 1.08 * rms):
        assert own < ax.get_ylim()[1] < 1.3 * max(*shown.values(), 1.08 * rms)
    told = [text.get_text() for text in ax.texts if " value " in text.get_text()]
    for text, (name, value) in zip(told, shown.items(), strict=True):
        reached = 8 * (value / rms) ** 2
        when = f", reached after {reached:.2g} h" if value < rms else ""
        assert text == f"{name} value {value:g}{when}"


def test_the_interval_of_a_dose_is_drawn_from_its_low_to_its_high_end():
    day = sum_up(plan(8.0), [[felt(axis("z", 0.6))]])
    doses = tuple(replace(own, low=0.9 * own.value, high=1.5 * own.value) for own in day.doses)
    for ax, dose in zip(np.ravel(replace(day, doses=doses).plot()), doses, strict=True):
        (bars,) = ax.containers
        ((begin, end),) = bars.lines[2][0].get_segments()
        assert (begin.tolist(), end.tolist()) == (
            [8.0, pytest.approx(dose.low)],
            [8.0, pytest.approx(dose.high)],
        )


def test_a_day_at_the_action_value_is_flagged():
    at_it = sum_up(plan(8.0), [[felt(axis("z", 0.5))]])
    assert at_it.doses[0].value == 0.5
    assert at_it.flagged
    assert not sum_up(plan(8.0), [[felt(axis("z", 0.499))]]).flagged


@given(
    st.lists(st.tuples(st.floats(0.1, 3.0), st.floats(0.1, 4.0)), min_size=1, max_size=5),
    st.randoms(use_true_random=False),
)
def test_the_order_of_jobs_changes_no_sum(jobs, random):
    shuffled = random.sample(jobs, len(jobs))
    one, other = (
        sum_up(plan(*(h for _, h in order)), [[felt(axis("z", rms, vdv=rms))] for rms, _ in order])
        for order in (jobs, shuffled)
    )
    for mine, yours in zip(one.doses, other.doses, strict=True):
        assert mine.value == pytest.approx(yours.value)
    assert sum(job.a8_ms2**2 for job in one.jobs) == pytest.approx(one.doses[0].value ** 2)


def test_what_is_too_short_is_said():
    day = sum_up(plan(8.0), [[replace(felt(axis("z", 0.4, scatter=None)), duration_s=60.0)]])
    assert [dose.measure for dose in day.doses] == ["A(8)"]
    assert any("60 s are too short for the statistics of VDV" in told for told in day.warnings)
    assert any("too short to see its scatter" in told for told in day.warnings)
    with pytest.raises(GearmonError, match="recordings with axes x and z"):
        sum_up(plan(1.0, 1.0), [[felt(axis("x", 1.0))], [felt(axis("z", 1.0))]])


PLAN = """\
position = "seat"
[limits]
action_ms2 = 0.4
limit_ms2 = 1.0
[[job]]
name = "mowing"
recording = ["one.csv", "two.csv"]
hours = 3
hours_error = 0.5
"""


def test_a_day_reads_its_recordings_as_it_is_told(tmp_path):
    """Columns without time, in g: a sine of 0.1 g at 16 Hz along the spine, Wk = 0.77 there."""
    time_s = np.arange(0.0, 120.0, 1 / 500.0)
    path = tmp_path / "seat.csv"
    np.savetxt(path, 0.1 * np.sin(2 * np.pi * 16.0 * time_s), header="up", comments="")
    jobs = (Job(name="mowing", recording=str(path), hours=8.0),)
    settings = {"sampling_rate_hz": 500.0, "unit": "g"}
    day = exposure_day(DayPlan(jobs=jobs, position="seat"), {"z": "up"}, **settings)
    assert day.doses[0].value == pytest.approx(0.1 * 9.80665 / np.sqrt(2) * 0.77, rel=0.01)
    with pytest.raises(GearmonError, match="range"):
        exposure_day(DayPlan(jobs=jobs, position="seat"), {"z": "up"}, range_ms2=0.098, **settings)


def test_a_plan_is_read_with_limits_of_its_own(tmp_path):
    (tmp_path / "plan.toml").write_text(PLAN)
    found = load_day(tmp_path / "plan.toml")
    assert found.limits == Limits(action_ms2=0.4, limit_ms2=1.0)
    assert found.jobs[0].recording == (str(tmp_path / "one.csv"), str(tmp_path / "two.csv"))
    (tmp_path / "plan.toml").write_text(
        PLAN.replace("[limits]\naction_ms2 = 0.4\nlimit_ms2 = 1.0", "")
    )
    assert load_day(tmp_path / "plan.toml").limits == LIMITS["seat"]


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("hours = 3", "hours = 30", r"plan.toml:8: job\[1\].hours = 30 must lie in \(0, 24\] h"),
        ("hours = 3", 'hours = "3"', r"plan.toml:8: job\[1\].hours = \"3\" must be a number"),
        ("hours = 3\n", "", r"plan.toml:5: job\[1\] lacks hours"),
        ("hours =", "hour =", r"plan.toml:8: job\[1\].hour is not a known key; did you mean hours"),
        (
            '"seat"',
            '"chair"',
            r"plan.toml:1: position = \"chair\" must be one of \"seat\", \"hand\"",
        ),
        ("= 0.4", "= 4.0", r"plan.toml:3: limits.action_ms2 = 4.0 must lie in \[0, 1\]: not above"),
        (
            '["one.csv", "two.csv"]',
            "[]",
            r"plan.toml:7: job\[1\].recording = \[\] must be a list",
        ),
        ("[[job]]", "[job]", r"plan.toml:5: job must be a table: write \[\[job\]\]"),
        ("[limits]", "[limit]", r"plan.toml:2: limit is not a known key; did you mean limits"),
        ("hours = 3", "hours = 20\n[[job]]\nname='b'\nrecording='c'\nhours = 8", "24 h at most"),
        (PLAN, 'position = "hand"', r"plan.toml.*: job is missing: write \[\[job\]\]"),
        (PLAN, "position = ", "not valid TOML"),
    ],
)
def test_a_wrong_plan_is_refused_with_line_key_and_value(tmp_path, old, new, told):
    (tmp_path / "plan.toml").write_text(PLAN.replace(old, new, 1))
    with pytest.raises(GearmonError, match=told) as stop:
        load_day(tmp_path / "plan.toml")
    assert "\n" not in str(stop.value)
