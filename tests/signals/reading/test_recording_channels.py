"""Which columns are channels, what they are called, what they measure and in which unit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gearmon.errors import RecordingError
from gearmon.signals.reading.columns import (
    LONGEST_QUOTE,
    describe_columns,
    find_defect,
    shortened,
)
from gearmon.signals.recording import read_recording
from gearmon.signatures.measured.indicators import indicator_table
from gearmon.signatures.recording_spectrum import recording_spectrum
from gearmon.units import acceleration_factor, time_factor

GRAVITY = 9.80665


@dataclass(frozen=True)
class Sensor:
    column: str | int
    unit: str | None = None
    sensitivity: float = 1.0
    kind: str = "vibration"


@pytest.fixture
def write(tmp_path):
    def written(names, values=None, units=""):
        count = len(names.split(","))
        samples = np.random.default_rng(7).normal(size=(500, count)).round(5)
        for column, own in (values or {}).items():
            samples[:, column] = own
        lines = [",".join(f"{value:.5f}" for value in row) + "\n" for row in samples]
        path = tmp_path / "recording.csv"
        path.write_text(f"{names}\n{units}" + "".join(lines), encoding="utf-8")
        return path

    return written


def column(cell, below=""):
    return describe_columns((cell,), (below,) if below else ())[0]


@pytest.mark.parametrize(
    ("cell", "name", "unit"),
    [
        ("acc_x [g]", "acc_x", "g"),
        ("a1 (m/s2)", "a1", "m/s2"),
        ("a1 <m/s^2>", "a1", "m/s^2"),
        ("a1 / g", "a1", "g"),
        ("Weg in mm", "Weg", "mm"),
        ("Acc (x)", "Acc (x)", None),
        ("Bearing (A)", "Bearing (A)", None),
        ("drive_end_g", "drive_end_g", "g"),
        ("a1_m_s2", "a1_m_s2", "m/s2"),
        ("a1", "a1", None),
        ("a1/a2", "a1/a2", None),
    ],
)
def test_names_and_units(cell, name, unit):
    found = column(cell)
    assert (found.name, found.unit) == (name, unit)


def test_a_last_letter_is_a_unit_only_if_all_columns_have_one():
    lettered = describe_columns(("acc_e", "acc_f", "acc_g"))
    assert [found.unit for found in lettered] == [None, None, None]
    ends = describe_columns(("time_s", "drive_g", "fan_g"))
    assert [found.unit for found in ends] == ["s", "g", "g"]


@pytest.mark.parametrize(
    ("cell", "kind"),
    [
        ("a1", "vibration"), ("Voltage_0", "vibration"), ("acc_x [g]", "vibration"),
        ("velocity [mm/s]", "vibration"), ("tacho", "tacho"), ("Keyphasor [V]", "tacho"),
        ("Trigger", "tacho"), ("rpm pulse", "tacho"), ("torque", "torque"), ("M [Nm]", "torque"),
        ("Drehmoment (N·m)", "torque"), ("speed", "speed"), ("Drehzahl", "speed"),
        ("n [1/min]", "speed"), ("motor_speed_rpm", "speed"), ("temperature", "other"),
        ("T [°C]", "other"), ("oil temp", "other"), ("load [%]", "other"), ("t", "time"),
        ("Time (s)", "time"), ("Zeit", "time"), ("timestamp", "time"), ("X_Value", "time"),
        ("Time 1 - default", "time"), ("T1", "vibration"), ("tempo di prova", "time"),
        ("index", "index"), ("sample", "index"), ("No.", "index"),
    ],
)  # fmt: skip
def test_kinds_from_names_and_units(cell, kind):
    assert column(cell).kind == kind


def test_accelerations_become_metres_per_second_squared(write):
    path = write("time_s,a [g],b [mm/s2],v [mm/s],w", {0: np.arange(500) / 1000})
    recording = read_recording(path)
    raw = np.loadtxt(path, delimiter=",", skiprows=1)[:, 1:].T
    assert recording.units == ("m/s2", "m/s2", "mm/s", None)
    assert np.array_equal(recording.samples, raw * [[GRAVITY], [1e-3], [1.0], [1.0]])


@pytest.mark.parametrize("first", ["[g]", "[1]", "(s)"])
def test_names_beside_a_cell_in_brackets_stay_names(write, first):
    recording = read_recording(write(f"{first},front,rear"), 1000.0)
    assert recording.channel_names[-2:] == ("front", "rear")


@pytest.mark.parametrize("units", ["[s],[g],[m/s^2]\n", "s,g,m/s²\n", "(s),(g),(m/s2)\n"])
def test_a_row_of_units(write, units):
    recording = read_recording(write("t,a,b", {0: np.arange(500) / 1000}, units))
    assert recording.units == ("m/s2", "m/s2")
    assert recording.channel_names == ("a", "b")


def test_channels_by_name_or_number_of_the_column(write):
    path = write("t,a,b [g],c", {0: np.arange(500) / 1000})
    assert read_recording(path).channel_names == ("a", "b", "c")
    assert read_recording(path, channels="b").channel_names == ("b",)
    assert read_recording(path, channels=["b [g]", "A"]).channel_names == ("a", "b")
    assert read_recording(path, channels=3).channel_names == ("b",)
    assert read_recording(path, channels=["4"]).channel_names == ("c",)
    recording = read_recording(path)
    assert recording.columns == (2, 3, 4)
    assert recording.select(["c", 2]).channel_names == ("c", "a")


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("bb", r"no channel 'bb'; did you mean b\? channels \(and columns\): t \(1\), a \(2\)"),
        (9, r"no channel '9'"),
        (0, r"no channel '0'"),
    ],
)
def test_unknown_channels_are_refused_with_what_there_is(write, key, message):
    path = write("t,a,b", {0: np.arange(500) / 1000})
    with pytest.raises(RecordingError, match=message):
        read_recording(path, channels=key)


def test_channels_of_one_name_are_told_apart_by_their_columns_in_every_result(tmp_path):
    path = tmp_path / "same.csv"
    samples = np.random.default_rng(1).normal(size=(400, 3)) * [1.0, 2.0, 3.0]
    np.savetxt(path, samples, delimiter=",", header="a,b,a", comments="", fmt="%.6f")
    names = ("a (1)", "b", "a (3)")
    both = read_recording(path, 1000.0)
    assert both.channel_names == names
    for key in (3, names[2]):
        assert read_recording(path, 1000.0, channels=key).channel_names == names[2:]
    frame = recording_spectrum(both, "rms").to_frame()
    assert list(frame.columns)[1:] == list(names)
    told = {row.channel: row.value for row in indicator_table(both).rows if row.indicator == "RMS"}
    assert list(told) == list(names)
    assert list(told.values()) == pytest.approx(samples.std(axis=0), rel=1e-6)


def test_a_name_that_stands_twice_is_refused_only_when_asked_for(write):
    path = write("a,a,b")
    assert read_recording(path, 100).samples.shape[0] == 3
    assert read_recording(path, 100, channels=[2]).columns == (2,)
    with pytest.raises(RecordingError, match=r"'a' is the name of columns 1 and 2; give the"):
        read_recording(path, 100, channels="a")


def test_other_kinds_are_kept_apart(write):
    recording = read_recording(write("a,torque,tacho,b"), 100)
    assert recording.channel_kinds == ("vibration", "torque", "tacho", "vibration")
    assert recording.vibration().channel_names == ("a", "b")
    assert any("'torque'" in note and "'tacho'" in note for note in recording.notes)


def test_the_user_goes_before_the_file(write):
    path = write("a,torque,c")
    recording = read_recording(path, 100, channels="torque", tacho="c")
    assert recording.channel_names == ("torque", "c")
    assert recording.channel_kinds == ("vibration", "tacho")


def test_a_tacho_that_is_told_goes_before_one_that_is_named_so(write):
    path = write("a,tacho,c")
    assert not read_recording(path, 100).tacho_told
    told = read_recording(path, 100, tacho="c")
    assert told.channel_kinds == ("vibration", "other", "tacho")
    assert told.tacho_told
    sensed = read_recording(path, 100, sensors=[Sensor("tacho", kind="tacho")])
    assert sensed.channel_kinds == ("vibration", "tacho", "vibration")
    assert sensed.tacho_told


def test_sensors_tell_unit_sensitivity_and_kind(write):
    path = write("a,b,c")
    raw = np.loadtxt(path, delimiter=",", skiprows=1).T
    sensors = [
        Sensor("a", unit="g", sensitivity=0.1),
        Sensor(3, unit="Nm", kind="torque"),
        Sensor("d"),
    ]
    recording = read_recording(path, 100, sensors=sensors)
    assert recording.channel_kinds == ("vibration", "vibration", "torque")
    assert recording.units == ("m/s2", None, "Nm")
    assert recording.samples[0] == pytest.approx(raw[0] / 0.1 * GRAVITY, rel=1e-15)
    assert any("'d' of the machine file is not in the recording" in n for n in recording.notes)


def test_a_sensitivity_without_unit_leaves_none(write):
    path = write("a (mV),b")
    raw = np.loadtxt(path, delimiter=",", skiprows=1).T
    recording = read_recording(path, 100, sensors=[Sensor("a", sensitivity=100.0), Sensor("b")])
    assert recording.units == (None, None)
    assert np.array_equal(recording.samples[0], raw[0] * (1 / 100.0))


def test_samples_that_a_sensitivity_makes_too_large_are_refused(write):
    with pytest.raises(RecordingError, match="no finite numbers, or above 1e30"):
        read_recording(write("a,b"), 100, sensors=[Sensor("b", sensitivity=1e-40)])


def test_a_bad_channel_is_left_out_unless_it_is_asked_for(write):
    path = write("a,b,c", {1: 3.0})
    recording = read_recording(path, 100)
    assert recording.channel_names == ("a", "c")
    assert recording.columns == (1, 3)
    assert "column 2 ('b') is constant (3 in all 500 samples): left out" in recording.notes
    with pytest.raises(RecordingError, match=r"column 2 \('b'\) is constant.*check the sensor"):
        read_recording(path, 100, channels=["b", "c"])
    assert read_recording(path, 100, channels="c").notes == ()


def test_a_channel_of_pulses_is_no_vibration_but_may_be_a_tacho(write):
    path = write("a,b", {1: np.arange(500) % 25 < 3})
    recording = read_recording(path, 100)
    assert recording.channel_names == ("a",)
    assert "only two values, 0 and 1: is it a tacho" in recording.notes[0]
    assert read_recording(path, 100, tacho="b").channel_kinds == ("vibration", "tacho")


class TestClipping:
    @pytest.mark.parametrize("limit", [0.5, 1.0, 2.0, 2.5])
    @pytest.mark.parametrize("step", [1e-6, 1e-3, 1e-2])
    def test_a_clipped_signal_is_found(self, limit, step):
        noise = np.random.default_rng(8).normal(size=20_000)
        defect = find_defect(np.round(np.clip(noise, -limit, limit) / step) * step)
        assert defect is not None
        assert defect.fatal
        assert "is clipped" in defect.text

    def test_on_one_side(self):
        sine = np.minimum(np.sin(0.0123 * np.arange(20_000)), 0.9)
        defect = find_defect(sine)
        assert defect is not None
        assert sine[defect.row] == 0.9
        assert sine[: defect.row].max() < 0.9

    def test_a_little_is_only_noted(self):
        noise = np.random.default_rng(9).normal(size=100_000)
        top = np.sort(noise)[-30]
        defect = find_defect(np.minimum(noise, top))
        assert defect is not None
        assert not defect.fatal

    @pytest.mark.parametrize("amplitude", [1.0, 1.51, 2.49, 3.0, 10.49, 20.0, 200.0])
    def test_a_coarsely_rounded_signal_is_not_clipped(self, amplitude):
        time = np.arange(50_000)
        rng = np.random.default_rng(10)
        for frequency in (1e-4, 1e-3, 0.0317, 0.25):
            assert find_defect(np.round(amplitude * np.sin(2 * np.pi * frequency * time))) is None
        assert find_defect(np.round(amplitude * rng.normal(size=50_000))) is None
        assert find_defect(np.round(amplitude * rng.uniform(-1, 1, size=50_000))) is None

    def test_in_a_file(self, write):
        clipped = np.clip(np.random.default_rng(7).normal(size=500), -1, 1)
        path = write("a,b", {1: clipped})
        line = 2 + int(np.argmax(clipped == 1.0))
        with pytest.raises(
            RecordingError,
            match=rf"line {line}, column 2 \('b'\) is clipped: \d+ samples \(\d+ %\) are exactly 1",
        ):
            read_recording(path, 100, channels="b")


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        ("m/s²", 1.0),
        ("mm/s2", 1e-3),
        ("cm/s2", 1e-2),
        ("ft/s2", 12 * 0.0254),
        ("in/s2", 0.0254),
        ("g", GRAVITY),
        ("mg", 1e-3 * GRAVITY),
        ("mm/s", None),
        ("V", None),
    ],
)
def test_accelerations_are_told_in_metres_by_their_definitions(unit, factor):
    assert acceleration_factor(unit) == (factor and pytest.approx(factor, rel=1e-12))


@pytest.mark.parametrize(
    ("unit", "factor"), [("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9), ("h", 3600)]
)
def test_times_are_told_in_seconds(unit, factor):
    assert time_factor(unit) == pytest.approx(factor, rel=1e-12)


def test_a_sensor_brings_no_channel_in_that_is_not_named(write):
    sensors = [Sensor("a1", "g"), Sensor("a2", "g"), Sensor("tacho", kind="tacho")]
    recording = read_recording(write("a1,a2,tacho"), 1000.0, ["a1"], sensors=sensors)
    assert recording.channel_names == ("a1", "tacho")


@pytest.mark.parametrize("length", [LONGEST_QUOTE, LONGEST_QUOTE + 1])
def test_a_long_sentence_above_one_column_is_no_name(tmp_path, length):
    path, line = (
        tmp_path / "a.csv",
        2 * "taken while it rained and nobody looked so ",
    )
    numbers = np.random.default_rng(7).normal(size=99)
    path.write_text("\n".join([line[:length], *map(str, numbers)]) + "\n")
    found = read_recording(path, 5000.0)
    np.testing.assert_array_equal(found.samples[0], numbers)
    assert (found.channel_names == ("column 1",)) == (length > LONGEST_QUOTE)


@example("a" * LONGEST_QUOTE)
@example("a" * LONGEST_QUOTE + "b")
@given(st.text(max_size=3 * LONGEST_QUOTE))
def test_what_a_message_quotes_is_short_and_says_whether_it_is_all(text):
    whole = "".join(own if own.isprintable() else "?" for own in text)
    shown = shortened(text)
    assert len(shown) <= LONGEST_QUOTE
    assert shown == whole if len(text) <= LONGEST_QUOTE else shown.endswith("...")
    assert whole.startswith(shown.removesuffix("..."))


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize(
    ("head", "named"),
    [
        (["a1", "a2", "a3"], ("a1", "a2", "a3")),
        (["a1", "a2", ""], ("a1", "a2", "column 3")),
        (["a1", "", ""], ("a1", "column 2", "column 3")),
        (["a1", "", "a3"], ("a1", "column 2", "a3")),
        (["a1", "a2", "a3", "Comment"], ("a1", "a2", "a3")),
    ],
)
def test_names_stand_above_their_columns_even_if_some_are_empty(tmp_path, head, named, separator):
    path, rows = tmp_path / "a.csv", np.random.default_rng(7).normal(size=(99, 3))
    lines = [separator.join(head), *(separator.join(map(str, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    found = read_recording(path, 5000.0)
    assert found.channel_names == named
    np.testing.assert_array_equal(found.samples, rows.T)


@pytest.mark.parametrize("count", [49, 50])
def test_fifty_rows_without_a_nought_are_two_columns_of_whole_numbers(tmp_path, count):
    """Of so many decimals one in ten would begin with it."""
    path, rows = tmp_path / "a.csv", np.random.default_rng(7).integers(10, 100, (count, 2))
    path.write_text("".join(f"{one},{other}\n" for one, other in rows))
    if count < 50:
        with pytest.raises(RecordingError, match="may be one column with decimal commas or two"):
            read_recording(path, 5000.0)
    else:
        np.testing.assert_array_equal(read_recording(path, 5000.0).samples, rows.T)
