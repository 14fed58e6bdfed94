"""Argument checks: what passes comes back as a float, what does not gives one clear line."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.errors import (
    ArgumentError,
    GearmonError,
    MachineFileError,
    RecordingError,
    SignatureError,
    check_finite,
    check_positive,
    check_range,
    nearest_name,
)

NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
NOT_FINITE = [math.nan, math.inf, -math.inf]


@pytest.mark.parametrize("kind", [MachineFileError, RecordingError, ArgumentError, SignatureError])
def test_every_error_is_a_value_error_of_gearmon(kind):
    assert issubclass(kind, GearmonError)
    assert issubclass(kind, ValueError)


@given(NUMBERS)
def test_finite_numbers_pass_unchanged(value):
    assert check_finite("x", value) == value


@pytest.mark.parametrize("value", NOT_FINITE)
@pytest.mark.parametrize(
    "check", [check_finite, check_positive, lambda name, value: check_range(name, value, 0, 1)]
)
def test_what_is_not_finite_is_refused(check, value):
    with pytest.raises(ArgumentError, match=f"x={value} must be a finite number"):
        check("x", value)


@given(NUMBERS)
def test_positive_means_above_zero(value):
    if value > 0:
        assert check_positive("x", value) == value
    else:
        with pytest.raises(ArgumentError, match="must be > 0"):
            check_positive("x", value)


@given(NUMBERS, NUMBERS, NUMBERS)
def test_range_is_closed(value, one, other):
    low, high = sorted((one, other))
    if low <= value <= high:
        assert check_range("x", value, low, high) == value
    else:
        with pytest.raises(ArgumentError, match="must lie in"):
            check_range("x", value, low, high)


def test_whole_numbers_come_back_as_floats():
    assert isinstance(check_positive("x", 3), float)


def test_message_names_thing_value_range_and_unit():
    with pytest.raises(ArgumentError, match=r"^face_width_m=-0\.02 m must lie in \[0\.001, 2\] m$"):
        check_range("face_width_m", -0.02, 0.001, 2.0, "m")


def test_message_without_unit_has_no_stray_space():
    with pytest.raises(ArgumentError, match=r"^load=0 must be > 0$"):
        check_positive("load", 0)


def test_message_is_one_line():
    with pytest.raises(ArgumentError) as caught:
        check_positive("speed_hz", -1.0, "Hz")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("word", "meant"),
    [("modul_mm", "module_mm"), ("face_with_mm", "face_width_mm"), ("xyzzy", None), ("", None)],
)
def test_nearest_name(word, meant):
    assert nearest_name(word, ["module_mm", "face_width_mm", "pinion_teeth"]) == meant


def test_nearest_name_among_none():
    assert nearest_name("module_mm", iter(())) is None
