"""The table of indicators: names, inputs, scale, run history and its file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from reference.small_gearbox import CRACK, as_json, machine, recording
from reference.synthetic_signals import white

from gearmon.errors import ArgumentError, SignatureError
from gearmon.signals import indicators
from gearmon.signals.recording import Recording
from gearmon.signatures.measured.indicators import indicator_table, read_history, write_history
from gearmon.signatures.measured.measurement import measure_signature

RAW = {"RMS", "peak to peak", "crest factor", "kurtosis"}
GEAR = RAW | {
    "FM0",
    "FM4",
    "M6A",
    "M8A",
    "NA4",
    "NA4*",
    "NB4",
    "NB4*",
    "energy ratio",
    "SER",
    "sideband index",
    "sideband level factor",
}
SIZES = {"RMS", "peak to peak", "sideband index"}


@pytest.fixture(scope="module")
def healthy():
    return indicator_table(recording(), machine())


def values(table):
    return {(r.indicator, r.channel, r.gear, r.input): r.value for r in table.rows}


def test_every_channel_and_gear_has_every_indicator(healthy):
    for channel in ("a1", "a2"):
        of_raw = {r.indicator for r in healthy.rows if r.channel == channel and r.gear is None}
        assert of_raw == RAW
        for gear in ("pinion", "gear"):
            own = {r.indicator for r in healthy.rows if (r.channel, r.gear) == (channel, gear)}
            assert own == GEAR
    assert all(np.isfinite(row.value) for row in healthy.rows)


def test_every_row_says_what_it_was_computed_of(healthy):
    inputs = {row.indicator: row.input for row in healthy.rows if row.gear == "pinion"}
    assert inputs["FM0"] == "average"
    assert inputs["FM4"] == inputs["M6A"] == inputs["M8A"] == "difference"
    assert inputs["NA4"] == "residual"
    assert inputs["NB4"] == "envelope of the average, multiples 12 to 34"
    fm4 = next(r for r in healthy.rows if r.indicator == "FM4" and r.gear == "pinion")
    assert "mesh harmonics at 23, 46, 69" in fm4.removed
    assert {22.0, 23.0, 24.0} <= set(fm4.removed_orders)
    na4 = next(r for r in healthy.rows if r.indicator == "NA4" and r.gear == "gear")
    assert min(na4.removed_orders) == pytest.approx(23.0)
    assert 22.0 not in na4.removed_orders


def test_without_a_machine_there_is_the_raw_vibration():
    table = indicator_table(recording())
    assert {row.indicator for row in table.rows} == RAW
    samples = recording().vibration().samples
    np.testing.assert_allclose(
        [r.value for r in table.rows if r.indicator == "kurtosis"], indicators.kurtosis(samples)
    )


def test_channels_of_one_name_have_a_row_each():
    samples = white((2, 4000)) * [[1.0], [3.0]]
    both = Recording(samples=samples, sampling_rate_hz=1000.0, channel_names=("a", "a"))
    rows = [row for row in indicator_table(both).rows if row.indicator == "RMS"]
    assert [row.channel for row in rows] == ["a", "a"]
    assert [row.value for row in rows] == pytest.approx([1.0, 3.0], rel=0.1)


def test_scale_moves_sizes_only(healthy):
    known = recording()
    samples = known.samples.copy()
    samples[[k == "vibration" for k in known.channel_kinds]] *= 1000.0
    loud = values(indicator_table(replace(known, samples=samples), machine()))
    for key, value in values(healthy).items():
        factor = 1000.0 if key[0] in SIZES else 1.0
        assert loud[key] == pytest.approx(factor * value, rel=1e-9)


def test_a_cracked_tooth_raises_the_indicators_of_impulses(healthy):
    cracked = values(indicator_table(recording(CRACK), machine()))
    known = values(healthy)
    rows = [key for key in known if key[0] == "energy ratio" and key[2] == "pinion"]
    assert any(cracked[key] > known[key] for key in rows)


def test_a_run_goes_on_from_its_history(healthy, tmp_path):
    second = indicator_table(recording(CRACK), machine(), healthy.history)
    path = tmp_path / "run.json"
    write_history(second.history, path)
    kept = read_history(path)
    assert kept.channel_names == ("a1", "a2")
    assert {len(run) for run in kept.variances.values()} == {2}
    third = indicator_table(recording(), machine(), kept, baseline=2)
    run = third.history.variances["residual, pinion of stage 1"]
    assert len(run) == 3
    fm4 = third.value("NA4", "a1", 1, "pinion")
    variance = run[:, 0]
    alone = indicator_table(recording(), machine()).value("NA4", "a1", 1, "pinion")
    assert fm4 == pytest.approx(alone * variance[-1] ** 2 / variance.mean() ** 2, rel=1e-9)
    frozen = third.value("NA4*", "a1", 1, "pinion")
    assert frozen == pytest.approx(alone * variance[-1] ** 2 / variance[:2].mean() ** 2, rel=1e-9)


def test_first_record_says_that_a_run_begins(healthy):
    assert any("a run begins here" in note for note in healthy.notes)
    assert healthy.value("NA4", "a1", 1, "gear") == healthy.value("NA4*", "a1", 1, "gear")


def test_other_channels_are_refused(healthy):
    with pytest.raises(ArgumentError, match="the run so far is of channels a1, a2"):
        indicator_table(recording().select(["a1"]), machine(), healthy.history)


@pytest.mark.parametrize("text", ["", "{}", "[1]", '{"kind": "gearmon indicator history"}'])
def test_files_that_are_none_are_refused(tmp_path, text):
    path = tmp_path / "other.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SignatureError, match="history of indicators") as caught:
        read_history(path)
    # why, in words; not what Python calls it
    assert "Error" not in str(caught.value)


def test_table_is_ready_for_json(healthy):
    assert len(as_json(healthy.to_dict())["indicators"]) == len(healthy.rows)


def test_where_no_mesh_is_found_no_gear_has_indicators():
    mute = Recording(samples=white((1, 20_000), 1.0, seed=4), sampling_rate_hz=10_000.0)
    table = indicator_table(mute, machine())
    assert {row.indicator for row in table.rows} == RAW
    assert {row.gear for row in table.rows} == {None}


def test_a_history_of_gears_without_a_residual_is_kept(healthy, tmp_path):
    """A variance of nothing is a variance; what is below nothing or without bound is none."""
    name = next(iter(healthy.history.variances))
    for value, fits in ((0.0, True), (1e-30, True), (-1e-30, False), (np.inf, False)):
        rows = healthy.history.variances[name] * 0.0 + value
        history = replace(healthy.history, variances=healthy.history.variances | {name: rows})
        write_history(history, tmp_path / "run.json")
        if fits:
            np.testing.assert_array_equal(read_history(tmp_path / "run.json").variances[name], rows)
        else:
            with pytest.raises(SignatureError, match=r"finite and >= 0|history of indicators"):
                read_history(tmp_path / "run.json")


def test_lines_are_planned_as_far_as_the_rate_allows_at_the_fastest_speed_looked_for():
    """Within 0.48 of the rate still 3 % above the nominal speed, and up to the turn below that."""
    plan = measure_signature(recording(), machine()).plan
    allowed = 0.48 * 10_000.0 / (2960.0 / 60.0) / 1.03
    assert allowed - 1.0 < max(map(float, plan.orders)) <= allowed
