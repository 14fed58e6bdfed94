"""Recordings and machines that are in memory already: every kind is taken, and means the same."""

from __future__ import annotations

import re
import tomllib

import numpy as np
import pandas as pd
import pytest
from reference.small_gearbox import MACHINE_FILE, simulated

import gearmon
from gearmon.signals.recording import read_recordings

RATE = float(simulated(tacho=False).sampling_rate_hz)
MACHINE = tomllib.loads(MACHINE_FILE)
KNOWN = {"sampling_rate_hz": RATE, "unit": "m/s2"}


@pytest.fixture(scope="module")
def samples():
    return simulated(tacho=False).samples


def frame(samples, index=None):
    names = [f"channel {number + 1} [m/s2]" for number in range(len(samples))]
    return pd.DataFrame(samples.T, columns=names, index=index)


def times(samples):
    return np.arange(samples.shape[1]) / RATE


IN_MEMORY = {
    "channels first": lambda x: (x, KNOWN),
    "time first": lambda x: (x.T, KNOWN),
    "single precision": lambda x: (x.astype(np.float32), KNOWN),
    "frame and rate": lambda x: (frame(x), {"sampling_rate_hz": RATE}),
    "durations": lambda x: (frame(x, pd.to_timedelta(times(x), unit="s")), {}),
    "moments": lambda x: (
        frame(x, pd.Timestamp("2026-03-01", tz="UTC") + pd.to_timedelta(times(x), unit="s")),
        {},
    ),
    "numbers": lambda x: (frame(x, pd.Index(times(x), name="time_s")), {}),
    "time column": lambda x: (frame(x).assign(time_s=times(x)), {}),
}


@pytest.mark.parametrize("kind", IN_MEMORY)
def test_every_kind_is_the_same_recording(samples, kind):
    source, known = IN_MEMORY[kind](samples)
    found = gearmon.read_recording(source, **known)
    assert found.sampling_rate_hz == pytest.approx(RATE, rel=1e-6)
    assert found.channel_names == ("channel 1", "channel 2")
    assert found.units == ("m/s2", "m/s2")
    tolerance = 1e-6 if kind == "single precision" else 0.0
    np.testing.assert_allclose(found.samples, samples, rtol=tolerance, atol=tolerance)
    assert not np.shares_memory(found.samples, samples)


def test_what_was_simulated_is_a_recording(samples):
    found = gearmon.read_recording(simulated(tacho=False))
    assert found.channel_names == simulated(tacho=False).channel_names
    np.testing.assert_array_equal(found.samples, samples)
    assert gearmon.read_recording(found) is found


def test_a_recording_without_a_name_is_told_by_its_number(samples):
    made = gearmon.read_recording(samples, sampling_rate_hz=10_000.0, unit="m/s2")
    known = {name: getattr(made, name) for name in ("samples", "sampling_rate_hz", "units")}
    named = {name: getattr(made, name) for name in ("channel_names", "channel_kinds")}
    one, two = read_recordings([gearmon.Recording(**known, **named)] * 2)
    assert (one.origin, two.origin) == ("unnamed 1", "unnamed 2")


def test_units_are_told_or_unknown_and_never_guessed(samples):
    assert gearmon.read_recording(samples, RATE).units == (None, None)
    in_g = gearmon.read_recording(samples, RATE, unit="g")
    np.testing.assert_allclose(in_g.samples, 9.80665 * samples)
    with pytest.raises(gearmon.GearmonError, match=r"is in m/s2, unit='g' was given; leave it out"):
        gearmon.read_recording(frame(samples), RATE, unit="g")
    with pytest.raises(gearmon.GearmonError, match=r"'parsec': is no known unit; give m/s2, g"):
        gearmon.read_recording(samples, RATE, unit="parsec")


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ({"a": 1}, "recording: dict is no recording; give the name of a file, an array"),
        (3, "int is no recording"),
        (np.zeros(9), "does not say its sampling rate; give sampling_rate_hz"),
        (np.zeros((5, 5)), "an array of shape .5, 5. .* more samples than channels"),
        (np.array(["a", "b"]), "and type <U1 without a signal in it"),
        (
            pd.DataFrame({"a": np.arange(9.0) % 4}),
            "does not say its sampling rate; give sampling_rate_hz",
        ),
        (
            pd.DataFrame({"a": ["x", "y"]}),
            r"without a signal in it .it holds a.; an array of real numbers",
        ),
        (
            pd.DataFrame({"time_s": np.arange(9.0)}),
            "no vibration channel .*; name one with channels",
        ),
        (
            pd.DataFrame({"time_s": np.arange(9.0), "a": [1.0, np.nan, 2.0] * 3}),
            "name the channels to use with channels",
        ),
    ],
)
def test_what_is_no_recording_is_refused_in_one_line(source, said):
    with pytest.raises(gearmon.GearmonError, match=said) as refused:
        gearmon.read_recording(source)
    # and whoever has samples in memory has no command line
    assert not re.search(r"\n|--|\bHZ\b", str(refused.value))


@pytest.mark.parametrize("rows", [0, 1])
@pytest.mark.parametrize(
    "index", [None, pd.timedelta_range(0, periods=1), pd.date_range("2026-01-01", periods=1)]
)
def test_a_frame_of_no_row_or_one_is_no_signal(rows, index):
    whole = pd.DataFrame({"time_s": [0.0], "a": [1.0]}, index=index)
    with pytest.raises(gearmon.GearmonError, match=rf"a frame of shape .{rows}, 2. without a sign"):
        gearmon.read_recording(whole.iloc[:rows], RATE)


def test_a_frame_with_a_gap_in_its_time_is_refused(samples):
    gap = np.delete(np.arange(samples.shape[1]), slice(100, 110))
    with pytest.raises(gearmon.GearmonError, match=r"'time_ns'.: the time is irregular"):
        gearmon.read_recording(frame(samples, pd.to_timedelta(times(samples), unit="s")).iloc[gap])


def test_machines_of_a_file_a_dictionary_and_keywords_are_the_same(tmp_path):
    (tmp_path / "machine.toml").write_text(MACHINE_FILE)
    read = gearmon.load_machine(tmp_path / "machine.toml")
    for made in (gearmon.load_machine(MACHINE), gearmon.load_machine(**MACHINE)):
        assert made.stages == read.stages
        assert made.operating == read.operating
    assert gearmon.load_machine(read) is read


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (3, "int is no machine; give the name of a machine file, a dictionary"),
        ({}, "machine: lacks a stage"),
        (MACHINE | {"stages": []}, "machine: stages is not a known key; did you mean stage"),
        (MACHINE | {"stage": {"kind": "parallel"}}, "lacks pinion_teeth and gear_teeth"),
    ],
)
def test_what_is_no_machine_is_refused_in_one_line(given, said):
    with pytest.raises(gearmon.GearmonError, match=said) as refused:
        gearmon.load_machine(given)
    assert "\n" not in str(refused.value)


def test_a_machine_given_twice_is_refused():
    with pytest.raises(gearmon.GearmonError, match="machine: given twice, also as name="):
        gearmon.load_machine(MACHINE, name="x")


def test_every_entry_takes_arrays_and_dictionaries(samples):
    reference = gearmon.learn([samples, samples[:, ::-1]], MACHINE, **KNOWN)
    assert reference.origins == ("array 1", "array 2")
    analysis = gearmon.analyse(samples, MACHINE, reference, **KNOWN)
    assert analysis.recording == "array"
    assert gearmon.order_spectra(samples, MACHINE, **KNOWN).units == ("m/s2", "m/s2")
    assert gearmon.gear_averages(samples, MACHINE, **KNOWN).recording == "array"
    assert gearmon.recording_spectrum(samples, **KNOWN).channel_names == ("channel 1", "channel 2")
    assert gearmon.indicator_table(samples[0], MACHINE, **KNOWN).rows[0].unit == "m/s2"
    assert gearmon.measure_signature(samples, MACHINE, **KNOWN).found


@pytest.mark.parametrize("faults", [7, [7], None])
def test_what_is_no_fault_is_refused_in_one_line(faults):
    with pytest.raises(gearmon.GearmonError, match="must be faults or their text, such as"):
        gearmon.simulate(MACHINE, faults, duration_s=1.0)


def test_one_fault_needs_no_list():
    given = {"duration_s": 1.0, "sampling_rate_hz": 5000.0}
    one = gearmon.simulate(MACHINE, "crack:1:pinion:5:20%", **given)
    np.testing.assert_array_equal(
        one.samples, gearmon.simulate(MACHINE, ["crack:1:pinion:5:20%"], **given).samples
    )


SOUND = np.sin(np.arange(4000.0))
TRACKED = np.zeros((2, 4000)), 8000.0, 24.7
MISTAKES = [
    (
        lambda: gearmon.recording_spectrum(np.sin(np.arange(4000.0)), band=500, **KNOWN),
        "band=500 must be two",
    ),
    (lambda: gearmon.read_recording(TRACKED[0], "8000"), r"sampling_rate_hz='8000' \(a text\)"),
    (lambda: gearmon.time_synchronous_average(*TRACKED), "track: float is not taken; give"),
    (lambda: gearmon.angular_waveform(*TRACKED), "track: float is not taken; give"),
    (lambda: gearmon.order_map(*TRACKED), "track: float is not taken; give"),
    (lambda: gearmon.expected_signature(MACHINE, 5), "faults=5: must be faults or their text"),
    (lambda: gearmon.check_reference(5, MACHINE), "reference: int is not taken; give what"),
    (lambda: gearmon.write_reference(5, "x.ref"), "reference: int is not taken"),
    (lambda: gearmon.write_signature(5, "x.csv"), "signature: int is not taken"),
    (lambda: gearmon.features(5), "analyses: int is not taken"),
    (lambda: gearmon.features([]), "analyses: none is given"),
    (lambda: gearmon.seat_factor(5, 5), "seat: int is not taken"),
    (lambda: gearmon.gear_share("new.csv", 5, MACHINE), "exposure: int is not taken"),
    (lambda: gearmon.tune_harvester(None, 5), "duty cycle: int is not taken"),
    (lambda: gearmon.fault_family(MACHINE, kinds="crak"), "kind 'crak' .* did you mean crack"),
]


@pytest.mark.parametrize(("mistake", "said"), MISTAKES)
def test_a_mistake_is_told_in_one_line_with_what_is_accepted(mistake, said):
    with pytest.raises(gearmon.GearmonError, match=said) as refused:
        mistake()
    assert "\n" not in str(refused.value)


def test_a_name_that_does_not_exist_has_a_neighbour_that_does():
    with pytest.raises(AttributeError, match="did you mean analyse"):
        _ = gearmon.analyze


def test_one_sample_is_no_recording(tmp_path):
    (tmp_path / "one.csv").write_text("time [s],a1 [m/s2]\n0.0,1.0\n")
    with pytest.raises(gearmon.GearmonError, match="a single sample is no recording"):
        gearmon.read_recording(tmp_path / "one.csv")
