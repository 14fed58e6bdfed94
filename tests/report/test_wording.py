from __future__ import annotations

import json
import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gearmon.report.wording import (
    as_data,
    gear_text,
    loss_text,
    percent,
    printable,
    probability_text,
    score_text,
    shortened,
    unit_text,
    with_uncertainty,
)


@pytest.mark.parametrize(
    ("probability", "text"),
    [
        (1.0, "1"),
        (0.034, "0.034"),
        (2.5e-7, "2.5·10⁻⁷"),
        (1e-300, "below 10⁻¹²"),
        (math.nan, "not known"),
    ],
)
def test_probability(probability, text):
    assert probability_text(probability) == text


SMALL = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")


@example(-2.5)
@example(-3.0)
@example(-3.1)
@given(st.floats(-11.9, 0.0))
def test_a_probability_in_words_is_right_to_two_figures_and_plain_from_a_thousandth_on(exponent):
    probability = 10.0**exponent
    text = probability_text(probability)
    mantissa, _, power = text.partition("·10")
    told = float(mantissa) * 10.0 ** int(power.translate(SMALL) or 0)
    assert told == pytest.approx(probability, rel=0.051)
    assert (power == "") == (probability >= 1e-3)
    assert 1.0 <= float(mantissa) <= 10.0 or not power
    assert len(mantissa.replace(".", "").lstrip("0")) <= 2


@pytest.mark.parametrize(
    ("value", "uncertainty", "text"),
    [
        (29.65123, 0.0034, "29.6512 ± 0.0034 Hz"),
        (29.65123, 0.34, "29.65 ± 0.34 Hz"),
        (2965.123, 34.0, "2965 ± 34 Hz"),
        (29.65, math.inf, "29.65 Hz"),
        (29.65, 1e-9, "29.650000 Hz (uncertainty below 1e-06)"),
    ],
)
def test_a_value_is_rounded_to_its_uncertainty(value, uncertainty, text):
    assert with_uncertainty(value, uncertainty, "Hz") == text


def test_units_that_are_not_known_are_said_to_be_so():
    assert unit_text(None) == unit_text("") == "unit not stated"
    assert unit_text("m/s2") == "m/s²"
    assert unit_text("g") == "g"


def test_places_and_losses_in_words():
    assert gear_text(1, "pinion", 5) == "stage 1, pinion, tooth 5"
    assert gear_text(None, None, None) == "whole machine"
    assert loss_text(0.2, 0.1, 0.3) == "20 % (10 to 30 %)"
    assert loss_text(None, None, None) == ""


def test_small_signs():
    assert score_text(-0.0) == "0.00"
    assert percent(-0.0105, signed=True) == "−1.05 %"
    assert printable("a\x1b[31m\n") == "a�[31m�"
    assert len(shortened("x" * 80, 16)) == 16


@given(st.dictionaries(st.text(), st.text() | st.just("</script><!--")))
def test_no_name_ends_the_element_that_holds_the_charts(charts):
    text = as_data(charts)
    assert "<" not in text
    assert json.loads(text) == charts
