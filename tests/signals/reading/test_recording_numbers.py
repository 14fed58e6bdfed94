"""Text to doubles: every value must be the one that `float` gives, or the block be refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.signals.reading.layout import Dialect
from gearmon.signals.reading.text import parse_rows

ONE = Dialect(separator="", decimal=".", columns=1)
TWO = Dialect(separator=";", decimal=",", columns=2)
COMMA = Dialect(separator=",", decimal=".", columns=2)


def numbers_as_text(*, longest: int, exponents: bool) -> st.SearchStrategy[str]:
    digits = f"[0-9]{{1,{longest}}}"
    body = rf"[+-]?({digits}\.?|\.{digits}|[0-9]{{1,{longest // 2}}}\.[0-9]{{1,{longest // 2}}})"
    exponent = "([eEdD][+-]?[0-9]{1,2})?" if exponents else ""
    return st.from_regex(body + exponent, fullmatch=True)


def as_python_reads(fields: list[str]) -> np.ndarray:
    return np.array([float(field.lower().replace("d", "e")) for field in fields])


def same_bits(found: np.ndarray, expected: np.ndarray) -> bool:
    return np.array_equal(found.copy().view(np.uint64), expected.view(np.uint64))


def one_column(fields: list[str]) -> np.ndarray:
    return parse_rows("".join(f"{field}\n" for field in fields).encode(), ONE)[:, 0]


@given(st.lists(numbers_as_text(longest=30, exponents=True), min_size=1, max_size=30))
def test_any_number_is_read_as_float_reads_it(fields):
    assert same_bits(one_column(fields), as_python_reads(fields))


@given(st.lists(numbers_as_text(longest=15, exponents=False), min_size=1, max_size=30))
def test_decimal_commas_are_read_as_float_reads_points(fields):
    block = "".join(f"{field};1\n" for field in fields).replace(".", ",").encode()
    found = parse_rows(block, TWO)
    assert same_bits(found[:, 0], as_python_reads(fields))
    assert np.all(found[:, 1] == 1.0)


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=50))
def test_shortest_and_long_prints_come_back(values):
    for shown in (repr, "{:.17g}".format, "{:.18e}".format):
        assert same_bits(one_column([shown(value) for value in values]), np.array(values))


def test_any_double_comes_back():
    bits = np.random.default_rng(14).integers(0, 2**64, 20_000, dtype=np.uint64)
    numbers = bits.view(np.float64)
    numbers = numbers[np.isfinite(numbers)]
    assert same_bits(one_column([repr(number) for number in numbers.tolist()]), numbers)


@pytest.mark.parametrize("offset", [-1, 0, 1])
def test_halves_between_neighbouring_doubles_round_to_even(offset):
    rng = np.random.default_rng(1)
    odd = 2 * rng.integers(2**52, 2**53, 2000, dtype=np.uint64) + np.uint64(1)
    fields = [f"{100 * int(digits) + offset}e-2" for digits in odd]
    assert same_bits(one_column(fields), as_python_reads(fields))


@pytest.mark.parametrize("span", [(-345, -290), (-30, 30), (270, 289)])
def test_random_mantissas_at_all_powers(span):
    rng = np.random.default_rng(2)
    mantissa = rng.integers(0, 10**19, 3000, dtype=np.uint64)
    pairs = zip(mantissa.tolist(), rng.integers(*span, 3000).tolist(), strict=True)
    fields = [f"{digits}e{exponent}" for digits, exponent in pairs]
    assert same_bits(one_column(fields), as_python_reads(fields))


@pytest.mark.parametrize("power", ["00005", "-99999", "-0000000000000000000003", "+0000012"])
def test_long_exponents(power):
    fields = [f"{mantissa}e{power}" for mantissa in ("1", "-1.5", "0", "0.0000000001")]
    assert same_bits(one_column(fields), as_python_reads(fields))


@pytest.mark.parametrize(
    "block",
    [
        "1..2,3\n", "1.2,.\n", "1-2,3\n", "1,2\n3\n", "1,2,3\n", "+-1,2\n",
        "1,2.3.\n", "1.2345678.,3\n", "1e,2\n", "e5,2\n", "1e+,2\n", "1e5e,2\n", "1 1,2\n",
        "1e5.0,2\n", "1e12345,2\n", "inf,2\n", '"1"1,2\n', "0x1.8p1,2\n", "1'000,2\n",
        "1_0,2\n", "0x1,2\n", "1,2;\n", "1e5-,2\n", "1-e5,2\n", "--1,2\n", "1,2\0\n", "١,2\n",
    ],
)  # fmt: skip
def test_what_is_no_plain_number_is_left_to_the_careful_reader(block):
    assert parse_rows(block.encode(), COMMA) is None
    assert parse_rows(b"1.5,2\n" + block.encode() + b"3,4\n", COMMA) is None


def test_an_empty_field_is_missing_but_an_empty_row_needs_a_closer_look():
    three = Dialect(separator=",", decimal=".", columns=3)
    found = parse_rows(b"1,,3\n,2,3\n1,2,\n", three)
    assert np.array_equal(np.isnan(found), [[0, 1, 0], [1, 0, 0], [0, 0, 1]])
    assert parse_rows(b"1,2,3\n,,\n", three) is None
    assert parse_rows(b"1\n\n2\n", ONE) is None


@pytest.mark.parametrize(
    "field",
    [str(2**64) + ".5", str(2**65), "2" + "0" * 36, "0" * 60 + "2" + "0" * 36,
     "0." + "0" * 40 + "7", str(2**64) + ".", "-" + str(3 * 2**64) + ".25e-3",
     "0.000000000000000000000000123456789", "1" * 60 + ".5"],
)  # fmt: skip
def test_a_field_may_be_longer_than_any_word(field):
    assert one_column(["1.5", field])[1] == float(field)
