"""The sampling rate: derived from the whole time column, checked, never guessed."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from gearmon.errors import ArgumentError, RecordingError
from gearmon.signals.reading.channels import even_step, spacing
from gearmon.signals.recording import read_recording

RATE_HZ = 4266.6667
COUNT = 3000


@pytest.fixture
def write(tmp_path):
    def written(stamps, name="time_s"):
        samples = np.random.default_rng(5).normal(size=len(stamps))
        lines = [f"{stamp},{value:.5f}\n" for stamp, value in zip(stamps, samples, strict=True)]
        path = tmp_path / "recording.csv"
        path.write_text((f"{name},a1\n" if name else "") + "".join(lines))
        return path

    return written


def printed(decimals, rate_hz=RATE_HZ, start_s=0.0):
    return [f"{start_s + index / rate_hz:.{decimals}f}" for index in range(COUNT)]


@pytest.mark.parametrize(("decimals", "error"), [(12, 1e-9), (6, 1e-6), (5, 1e-6), (4, 2e-6)])
def test_rounded_stamps_give_the_rate_of_the_whole_span(write, decimals, error):
    recording = read_recording(write(printed(decimals)))
    assert recording.sampling_rate_hz == pytest.approx(RATE_HZ, rel=error)


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("time_ms", 1e3),
        ("t [us]", 1e6),
        ("Zeit (ms)", 1e3),
        ("Time [µs]", 1e6),
        ("t [ns]", 1e9),
        ("x [s]", 1.0),
        ("t [min]", 1 / 60),
        ("t [h]", 1 / 3600),
    ],
)
def test_units_of_time(write, name, factor):
    stamps = [f"{index / 2000 * factor:.12g}" for index in range(COUNT)]
    rate = read_recording(write(stamps, name)).sampling_rate_hz
    assert rate == pytest.approx(2000.0, rel=1e-9)


def test_single_precision_stamps(write):
    stamps = [f"{np.float32(50 + index / 5120):.9g}" for index in range(COUNT)]
    assert read_recording(write(stamps)).sampling_rate_hz == pytest.approx(5120, rel=1e-5)


def test_six_significant_digits_lose_decimals_along_the_way(write):
    stamps = [f"{9.8 + index / 4096:.6g}" for index in range(COUNT)]  # 4 decimals from 10 s on
    assert read_recording(write(stamps)).sampling_rate_hz == pytest.approx(4096, rel=1e-5)


def test_a_first_column_without_name_that_rises_evenly_is_time(write):
    recording = read_recording(write(printed(6), name=""))
    assert recording.sampling_rate_hz == pytest.approx(RATE_HZ, rel=1e-6)
    assert recording.columns == (2,)
    assert any("taken as the time" in note for note in recording.notes)


@pytest.mark.parametrize("name", ["", "index", "sample", "n", "#", "Unnamed: 0", "no."])
def test_a_counter_is_no_time(write, name):
    path = write(range(COUNT), name)
    with pytest.raises(RecordingError, match=r"no time column.*give --sampling-rate HZ"):
        read_recording(path)
    assert read_recording(path, 1000.0).columns == (2,)


def test_a_named_first_column_that_rises_evenly_is_not_taken_for_the_time(write):
    path = write(printed(6), name="stelle")
    with pytest.raises(RecordingError, match=r"if that is the time, name it time_s"):
        read_recording(path)
    assert read_recording(path, RATE_HZ).vibration().columns == (2,)


def test_without_time_the_rate_is_asked_for_and_a_hint_is_quoted(tmp_path):
    path = tmp_path / "recording.csv"
    path.write_text("Sampling rate: 51200 Hz\n\na,b\n" + "1.5,2.5\n2.5,1.5\n3.5,0.5\n" * 10)
    with pytest.raises(
        RecordingError,
        match=r"give --sampling-rate HZ \(line 1 says 'Sampling rate: 51200 Hz'\)",
    ):
        read_recording(path)
    assert read_recording(path, 51200).sampling_rate_hz == 51200


def test_a_given_rate_must_agree_with_the_time_column(write):
    path = write(printed(9))
    assert read_recording(path, 4266.0).sampling_rate_hz == 4266.0
    with pytest.raises(RecordingError, match=r"stamps say 4266\.667 Hz, but 4275 Hz was given"):
        read_recording(path, 4275.0)


def test_a_time_without_unit_is_seconds_unless_that_cannot_be(write):
    recording = read_recording(write(printed(9), name="time"))
    assert any("taken as seconds" in note for note in recording.notes)
    milliseconds = write([f"{index / 2:.1f}" for index in range(COUNT)], name="time")
    with pytest.raises(RecordingError, match=r"goes up by 0\.5 in an unknown unit; name it"):
        read_recording(milliseconds)
    recording = read_recording(milliseconds, 2000.0)
    assert any("it is in ms" in note for note in recording.notes)


@pytest.mark.parametrize(
    ("name", "step", "alike"),
    [
        ("time2_s", 5e-4, True),
        ("time_ms", 0.5, True),
        ("time2", 500.0, True),
        ("time2_s", 1e-3, False),
        ("time_ms", 0.6, False),
        ("time2", 700.0, False),
        ("time2_s", 0.0, True),
    ],
)
def test_two_time_columns_must_tell_the_same(tmp_path, name, step, alike):
    path = tmp_path / "twice.csv"
    rows = [f"{i / 2000:.4f},{np.sin(i):.5f},{i * step:.9g},{np.cos(i):.5f}\n" for i in range(400)]
    path.write_text(f"time_s,a1,{name},a2\n" + "".join(rows))
    assert read_recording(path, 2000.0).sampling_rate_hz == 2000.0
    if alike:
        assert read_recording(path).channel_names == ("a1", "a2")
        return
    with pytest.raises(RecordingError, match=r"another time column says 2000 Hz; delete the one"):
        read_recording(path)


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns", "min"])
def test_a_given_rate_tells_the_unit_of_the_time(write, unit):
    seconds = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}[unit]
    path = write([f"{index / 2000 / seconds:.12g}" for index in range(COUNT)], name="time")
    recording = read_recording(path, 2000.0)
    assert recording.sampling_rate_hz == 2000.0
    assert any(note.endswith(f"by the given rate it is in {unit}") for note in recording.notes)


def test_a_time_in_whole_seconds_is_no_counter(write):
    recording = read_recording(write(range(COUNT), name="time"), 1000.0)
    assert any("counts samples" in note for note in recording.notes)
    with pytest.raises(RecordingError, match="stamps say 1 Hz, but 1000 Hz was given"):
        read_recording(write(range(COUNT), name="time_s"), 1000.0)


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, float("nan")])
def test_a_rate_must_be_positive(write, rate_hz):
    with pytest.raises(ArgumentError, match="sampling_rate_hz"):
        read_recording(write(printed(9)), rate_hz)


def changed(index, value):
    stamps = printed(6)
    stamps[index] = value if isinstance(value, str) else f"{value:.6f}"
    return stamps


@pytest.mark.parametrize(
    ("stamps", "message"),
    [
        (changed(100, printed(6)[99]), r"line 102, .*0\.023203 is repeated"),
        (changed(100, printed(6)[50]), r"line 102, .*comes after"),
        (changed(100, 100.4 / RATE_HZ), r"line 102, .*a step of 0\.000328 where 0\.000234"),
        (printed(6)[:500] + printed(6)[501:], r"line 502, .*about 1 sample is missing"),
        (printed(6)[:500] + printed(6)[600:], r"line 502, .*about 100 samples are missing"),
        (printed(4)[:1500] + printed(4)[1501:], r"irregular"),
        (changed(7, "nan"), r"line 9, .*the time is missing \(in 1 of 3000 rows\)"),
        (["1.5"] * COUNT, r"line 3, .*1\.5 is repeated"),
        (
            [f"{index / 5000 * (1 + index / 3e5):.9f}" for index in range(COUNT)],
            r"is off the even spacing of",
        ),
    ],
)
def test_irregular_time_is_refused_with_its_line(write, stamps, message):
    with pytest.raises(RecordingError, match=message) as caught:
        read_recording(write(stamps))
    assert "--sampling-rate" in str(caught.value)


def test_stamps_coarser_than_the_interval_ask_for_the_rate(write):
    path = write(printed(3))
    with pytest.raises(RecordingError, match=r"rounded so much .* about 4267"):
        read_recording(path)
    assert read_recording(path, RATE_HZ).sampling_rate_hz == RATE_HZ
    with pytest.raises(RecordingError, match="but 5000 Hz was given"):
        read_recording(path, 5000.0)


def test_rounded_stamps_are_wrong_by_no_more_than_their_uncertainty(tmp_path):
    for rate_hz in np.geomspace(1300.0, 9000.0, 9).tolist():
        stamps = np.round(np.arange(60) / rate_hz, 3)
        found = spacing(stamps)
        assert 0 < abs(found.step * rate_hz - 1) <= found.uncertainty <= 0.2
        path = tmp_path / "few.csv"
        path.write_text("time_s,a1\n" + "".join(f"{t:.3f},{t * t % 0.7}\n" for t in stamps))
        assert read_recording(path, rate_hz).sampling_rate_hz == rate_hz


def test_a_lost_sample_shows_behind_any_rounding_finer_than_the_interval():
    for decimals, rate_hz in ((4, 1600.0), (3, 700.0), (3, 450.0)):
        stamps = np.round(np.arange(2000) / rate_hz, decimals)
        assert spacing(stamps).fault == ""
        found = spacing(np.delete(stamps, 1000))
        assert found.fault
        assert abs(found.row - 1000) <= 1


@pytest.mark.parametrize("count", [5, 20, 50, 150])
def test_a_lost_sample_in_few_stamps_as_coarse_as_the_interval(count):
    stamps = np.delete(np.arange(count) / 1000, count // 2)
    assert "about 1 sample is missing" in spacing(stamps).fault


def test_spacing_of_exact_stamps_is_exact():
    found = spacing(np.arange(1000) * 0.001)
    assert found.step == pytest.approx(0.001, rel=1e-14)
    assert not found.coarse


def test_what_goes_up_evenly():
    assert even_step(np.arange(5.0) + 3) == 1.0
    assert even_step(np.arange(5.0) * 2) == 2.0
    assert not even_step(np.array([0.0, 1.0, 3.0, 4.0]))
    assert not even_step(np.random.default_rng(6).normal(size=100))
    assert not even_step(np.full(100, 2.0))


@pytest.mark.parametrize("bend", [1, -1])
def test_of_a_clock_that_drifts_the_end_is_named(bend):
    """A parabola lies farthest from its best line at its ends, whichever way it bends."""
    number = np.arange(COUNT)
    found = spacing(np.round(number / 5000 * (1 + bend * number / 3e5), 9))
    assert "is off the even spacing of" in found.fault
    assert found.row in (0, COUNT - 1)


def test_dates_and_times_of_day(write):
    stamps = [f"2024-03-12 10:11:{12 + index / 1000:09.6f}" for index in range(COUNT)]
    assert read_recording(write(stamps, "Datum")).sampling_rate_hz == 1000.0
    clock = [stamp[11:] for stamp in stamps]
    assert read_recording(write(clock, "x")).sampling_rate_hz == 1000.0


def test_stamps_that_mostly_do_not_rise_are_a_fault():
    # their usual step is none
    assert "comes after" in spacing(np.arange(4000.0) ** 2 % 17).fault
    flat = np.ones(500)
    flat[0], flat[-1] = 0.0, 2.0
    assert "is repeated" in spacing(flat).fault
    assert not even_step(flat)


def test_of_two_samples_that_changed_places_the_second_is_named():
    stamps = np.arange(200) / 1000
    stamps[[99, 100]] = stamps[[100, 99]]
    assert spacing(stamps).row == 100
    assert "comes after" in spacing(stamps).fault


def test_a_clock_that_was_set_back_is_told_before_the_leap_that_went_ahead():
    stamps = 0.001 * np.arange(30.0)
    stamps[10] += 0.5
    found = spacing(stamps)
    assert (found.fault, found.row) == ("irregular: 0.011 comes after 0.51", 11)


@pytest.mark.parametrize("step_s", [1.0, 0.1, 1e-3])
@pytest.mark.parametrize("factor", [None, 1.0, 1e-3, 1e3, 2.0])
def test_written_moments_tell_seconds_whatever_rate_is_given(tmp_path, step_s, factor):
    path, begin = tmp_path / "a.csv", datetime(2024, 5, 1, tzinfo=UTC)
    moments = [(begin + timedelta(seconds=n * step_s)).isoformat(" ") for n in range(60)]
    values = np.random.default_rng(3).normal(size=60)
    rows = [f"{own},{value}" for own, value in zip(moments, values, strict=True)]
    path.write_text("\n".join(["stamp,a1", *rows]) + "\n")
    given = None if factor is None else factor / step_s
    if factor in (None, 1.0):
        found = read_recording(path, given)
        assert found.sampling_rate_hz == pytest.approx(1 / step_s, rel=1e-6)
        assert found.notes == ()
    else:
        with pytest.raises(RecordingError, match=f"say {1 / step_s:.7g} Hz, but {given:.7g} Hz"):
            read_recording(path, given)
