"""Indicators of a measured signature: closed forms from a known synchronous average."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.small_gearbox import CRACK, analysis

from gearmon.signals import indicators
from gearmon.signatures.measured.indicators import gear_indicators, waveform_indicators

NAMES = {"FM0", "FM4", "M6A", "M8A", "energy ratio", "SER"}


def of(signature, pattern):
    """Indicators of the pinion when its lines are just `pattern`: multiple -> amplitude."""
    wheel = signature.plan.wheels[0]
    amplitude = np.zeros_like(signature.lines.amplitude)
    for number, value in pattern.items():
        column = int(wheel.lines[list(wheel.number).index(number)])
        amplitude[:, :, column] = value
    known = replace(signature, lines=replace(signature.lines, amplitude=amplitude))
    table = gear_indicators(known)
    return {name: table[f"{name}, pinion of stage 1"]["a1"] for name in NAMES}


@given(st.integers(0, 3), st.floats(1e-6, 1e6), st.floats(-1e3, 1e3))
def test_waveform_indicators_are_those_of_the_whole(seed, scale, offset):
    # written piece by piece for long recordings, against the plain formulas
    samples = offset * scale + scale * np.random.default_rng(seed).standard_normal((2, 5000))
    table = waveform_indicators(samples, ("x", "y"))
    plain = {
        "rms": indicators.rms,
        "peak to peak": indicators.peak_to_peak,
        "crest factor": indicators.crest_factor,
        "kurtosis": indicators.kurtosis,
    }
    assert set(table) == set(plain)
    for name, formula in plain.items():
        np.testing.assert_allclose(list(table[name].values()), formula(samples), rtol=1e-7)


def test_long_waveforms_are_taken_in_pieces():
    samples = np.random.default_rng(0).standard_normal((1, 700_001)) + 3
    table = waveform_indicators(samples, ("x",))
    assert table["kurtosis"]["x"] == pytest.approx(float(indicators.kurtosis(samples)[0]), rel=1e-9)
    assert table["rms"]["x"] == pytest.approx(float(np.std(samples)), rel=1e-9)


def test_constant_waveform_has_no_kurtosis_and_no_warning():
    table = waveform_indicators(np.full((1, 100), 2.5), ("x",))
    assert [table[name]["x"] for name in ("rms", "crest factor", "kurtosis")] == [0.0, 0.0, 0.0]


def test_huge_and_tiny_waveforms_do_not_overflow():
    for scale in (1e150, 1e-150):
        samples = scale * np.sin(np.arange(1000) / 5)[None]
        assert waveform_indicators(samples, ("x",))["kurtosis"]["x"] == pytest.approx(1.5, rel=0.01)


def test_every_gear_has_every_indicator():
    table = gear_indicators(analysis().signature)
    expected = {f"{name}, {gear} of stage 1" for name in NAMES for gear in ("pinion", "gear")}
    assert set(table) == expected
    assert all(set(row) == {"a1", "a2"} for row in table.values())
    assert all(np.isfinite(value) for row in table.values() for value in row.values())


def test_mesh_lines_alone():
    values = of(analysis().signature, {23: 2.0})
    assert values["FM0"] == pytest.approx(2.0, rel=1e-2)
    assert values["SER"] == 0.0
    assert values["energy ratio"] == 0.0
    assert values["FM4"] == 0.0


def test_first_sidebands_belong_to_the_regular_signal():
    values = of(analysis().signature, {22: 0.3j, 23: 2.0, 24: 0.1})
    assert values["SER"] == pytest.approx(0.4 / 2.0)
    assert values["FM4"] == 0.0


def test_six_sidebands_on_either_side_count_over_the_first_mesh_line():
    """FM0 is over all mesh lines: a cosine and one of half its size and period swing by 4.5."""
    sides = {17: 0.1, 18: 0.02, 28: 0.3, 29: 0.2j}
    values = of(analysis().signature, {16: 5.0, 23: 2.0, 30: 7.0, 46: 1.0, 45: 3.0} | sides)
    assert values["SER"] == pytest.approx(0.62 / 2.0)
    values = of(analysis().signature, {23: 2.0, 46: 1.0})
    # 2 cos t + cos 2t: 3 at its top, -1.5 where cos t = -1/2
    assert values["FM0"] == pytest.approx(4.5 / 3.0, rel=1e-2)


def test_one_line_between_is_a_sine_in_the_difference():
    values = of(analysis().signature, {23: 2.0, 30: 0.5})
    assert values["FM4"] == pytest.approx(1.5, rel=1e-9)
    assert values["M6A"] == pytest.approx(2.5, rel=1e-9)
    assert values["M8A"] == pytest.approx(35 / 8, rel=1e-9)
    assert values["energy ratio"] == pytest.approx(0.25, rel=1e-9)


def test_an_event_once_a_turn_raises_fm4():
    numbers = [int(n) for n in analysis().signature.plan.wheels[0].number if n > 2]
    values = of(analysis().signature, dict.fromkeys(numbers, 0.1))
    assert values["FM4"] > 10
    assert values["M8A"] > values["M6A"] > values["FM4"]


def test_all_gear_indicators_do_not_depend_on_the_unit():
    signature = analysis(CRACK).signature
    lines = replace(signature.lines, amplitude=1000 * signature.lines.amplitude)
    one, two = gear_indicators(signature), gear_indicators(replace(signature, lines=lines))
    for name, row in one.items():
        np.testing.assert_allclose(list(two[name].values()), list(row.values()), rtol=1e-12)
