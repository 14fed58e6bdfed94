"""Text to doubles: every value must be the one that `float` gives, or the block be refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearmon.signals.reading.digits import parse_block
from gearmon.signals.reading.rounding import decimal_to_double
from gearmon.signals.reading.short_fields import parse_short_fields

repeatable = settings(derandomize=True, deadline=None)


def numbers_as_text(*, longest: int, exponents: bool) -> st.SearchStrategy[str]:
    digits = f"[0-9]{{1,{longest}}}"
    body = rf"[+-]?({digits}\.?|\.{digits}|[0-9]{{1,{longest // 2}}}\.[0-9]{{1,{longest // 2}}})"
    exponent = "([eEdD][+-]?[0-9]{1,3})?" if exponents else ""
    return st.from_regex(body + exponent, fullmatch=True)


def as_python_reads(fields: list[str]) -> np.ndarray:
    return np.array([float(field.lower().replace("d", "e")) for field in fields])


def same_bits(found: np.ndarray, expected: np.ndarray) -> bool:
    return np.array_equal(found.view(np.uint64), expected.view(np.uint64))


@repeatable
@given(st.lists(numbers_as_text(longest=30, exponents=True), min_size=1, max_size=30))
def test_any_number_is_read_as_float_reads_it(fields):
    block = "".join(f"{field}\n" for field in fields).encode()
    found = parse_block(block, 1, ",", ".")
    assert same_bits(found[:, 0], as_python_reads(fields))


@repeatable
@given(st.lists(numbers_as_text(longest=15, exponents=False), min_size=1, max_size=30))
def test_short_numbers_are_read_as_float_reads_them(fields):
    block = "".join(f"{field};1\n" for field in fields).replace(".", ",").encode()
    found = parse_short_fields(block, 2, ";", ",")
    assert same_bits(found[:, 0].copy(), as_python_reads(fields))
    assert np.all(found[:, 1] == 1.0)


@repeatable
@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=50))
def test_shortest_and_long_prints_come_back(values):
    for shown in (repr, "{:.17g}".format, "{:.18e}".format):
        block = "".join(f"{shown(value)}\n" for value in values).encode()
        assert same_bits(parse_block(block, 1, ",", ".")[:, 0], np.array(values))


@pytest.mark.parametrize("offset", [-1, 0, 1])
def test_halves_between_neighbouring_doubles_round_to_even(offset):
    rng = np.random.default_rng(1)
    odd = 2 * rng.integers(2**52, 2**53, 2000, dtype=np.uint64) + np.uint64(1)
    mantissa = odd * np.uint64(100) + np.uint64(100 + offset) - np.uint64(100)
    power = np.full(2000, -2)
    expected = [float(f"{digits}e-2") for digits in mantissa.tolist()]
    assert same_bits(decimal_to_double(mantissa, power), np.array(expected))


@pytest.mark.parametrize("span", [(-345, -290), (-30, 30), (270, 310)])
def test_random_mantissas_at_all_powers(span):
    rng = np.random.default_rng(2)
    mantissa = rng.integers(0, 10**19, 3000, dtype=np.uint64)
    power = rng.integers(*span, 3000)
    pairs = zip(mantissa.tolist(), power.tolist(), strict=True)
    expected = np.array([float(f"{digits}e{exponent}") for digits, exponent in pairs])
    assert same_bits(decimal_to_double(mantissa, power), expected)


def test_prints_of_doubles_with_19_digits():
    # these lie next to the doubles, where the first 64 bits of a product do not decide
    values = np.random.default_rng(3).normal(size=3000)
    block = "".join(f"{value:.18e}\n" for value in values).encode()
    assert same_bits(parse_block(block, 1, ",", ".")[:, 0], values)


def test_a_few_exponents_among_short_numbers():
    fields = ["1.5"] * 99 + ["-2.5e-05"]
    found = parse_short_fields("".join(f"{field}\n" for field in fields).encode(), 1, ",", ".")
    assert same_bits(found[:, 0], as_python_reads(fields))


@pytest.mark.parametrize("parse", [parse_block, parse_short_fields])
@pytest.mark.parametrize(
    "block",
    [
        "1..2,3\n", "1.2,.\n", "-,3\n", "1-2,3\n", "1,2\n3\n", "1,2,3\n", "1 ,2\n", "+-1,2\n",
        "1,2.3.\n", "1.2345678.,3\n", "1e,2\n", "e5,2\n", "1e+,2\n", "1e5e,2\n",
        "1e5.0,2\n", "1e12345,2\n", "nan,2\n", "inf,2\n", "1,2\n\n", "\n1,2\n", '"1",2\n',
        "1_0,2\n", "0x1,2\n", "1,2;\n", "1e5-,2\n", "1-e5,2\n", "--1,2\n", "1,2\0\n",
    ],
)  # fmt: skip
def test_what_is_no_plain_number_is_left_to_the_careful_reader(parse, block):
    assert parse(block.encode(), 2, ",", ".") is None


def test_an_empty_field_is_missing_but_an_empty_row_needs_a_closer_look():
    found = parse_short_fields(b"1,,3\n,2,3\n1,2,\n", 3, ",", ".")
    assert np.array_equal(np.isnan(found), [[0, 1, 0], [1, 0, 0], [0, 0, 1]])
    assert parse_short_fields(b"1,2,3\n,,\n", 3, ",", ".") is None
    assert parse_short_fields(b"1\n\n2\n", 1, ",", ".") is None
    assert parse_block(b"1,,3\n", 3, ",", ".") is None


def test_a_field_may_be_longer_than_any_word():
    block = b"0.000000000000000000000000123456789,1\n" + b"1" * 60 + b".5,2\n"
    found = parse_block(block, 2, ",", ".")
    assert found[0, 0] == 1.23456789e-25
    assert found[1, 0] == float("1" * 60)


@pytest.mark.parametrize(
    "field",
    [str(2**64) + ".5", str(2**65), "2" + "0" * 36, "0" * 60 + "2" + "0" * 36,
     "0." + "0" * 40 + "7", str(2**64) + ".", "-" + str(3 * 2**64) + ".25e-3"],
)  # fmt: skip
def test_digits_beyond_a_word_are_never_dropped(field):
    found = parse_block(f"1.5\n{field}\n".encode(), 1, ";", ".")
    assert found[1, 0] == float(field)
