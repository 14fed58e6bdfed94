"""Blocks of rows through the compiled parser: what the careful reader makes of them, or nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearmon.errors import RecordingError
from gearmon.signals.reading.channels import Wanted
from gearmon.signals.reading.layout import Dialect, is_number
from gearmon.signals.reading.text import Block, open_source, parse_rows, read_rows, read_table
from gearmon.signals.recording import read_recording

ONE = Dialect(separator="", decimal=".", columns=1)
TWO = Dialect(separator=";", decimal=",", columns=2)
COMMA = Dialect(separator=",", decimal=".", columns=2)
ODD = st.text("0123456789.,;+-eE dx\t\"'", max_size=12)
PLAIN = st.floats(allow_nan=False, allow_infinity=False).map(repr)


@given(st.lists(ODD | PLAIN | st.from_regex(r"[+-]?[0-9]{1,25}[.,]?[0-9]{0,25}", fullmatch=True)))
def test_one_column(fields):
    found = parse_rows("".join(f"{field}\n" for field in [*fields, "1.5"]).encode(), ONE)
    if found is not None:
        bare = [field.strip().strip('"').strip() for field in fields]
        assert all(is_number(field, ".") for field in bare)
        assert found[:-1, 0].tolist() == [ONE.value(0, field) for field in bare]


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


def test_an_empty_field_is_missing_but_an_empty_row_needs_a_closer_look():
    three = Dialect(separator=",", decimal=".", columns=3)
    found = parse_rows(b"1,,3\n,2,3\n1,2,\n", three)
    assert np.array_equal(np.isnan(found), [[0, 1, 0], [1, 0, 0], [0, 0, 1]])
    assert parse_rows(b"1,2,3\n,,\n", three) is None
    assert parse_rows(b"1\n\n2\n", ONE) is None


def careful(text, dialect):
    """Return the rows of a text as the careful reader has them; None if it refuses."""
    try:
        values, empty_line = read_rows("f.csv", Block(text=text.encode(), first_line=1), dialect)
    except RecordingError:
        return None
    return None if empty_line else values


def same_as_line_by_line(text, dialect):
    """Tell whether a block is parsed as the careful reader does, or left to it."""
    found = parse_rows(text.encode(), dialect)
    slow = careful(text, dialect)
    if found is None or slow is None:
        return found is None
    alike = np.array_equal(found, slow, equal_nan=True)
    return alike and np.array_equal(np.signbit(found[found == 0]), np.signbit(slow[slow == 0]))


FRAGMENTS = [
    "1", "-3", "+4", ".5", "6.", "1e3", "1E-3", "1e00005", "1e-99999", "0e99999", "1e4294967297",
    "1d3", "nan", "NaN", "inf", "1_0", "0x1", "", " ", "\t", "\0", "\n", "\n\n", ",", ";", ".", "-",
    "e", '"', '""', '"2"', "#", "%", "\v", "\f", "\xa0", "\x1a", "\x1f", "\ufeff", "-0", "00012",
    "9" * 40, "1e400", "1,5", "N/A", "--", "?",
]  # fmt: skip
DIALECTS = [
    Dialect(separator=separator, decimal=decimal, columns=columns, trailing=trailing)
    for separator, decimal, columns, trailing in (
        ("", ".", 1, False), ("", ",", 1, False), (",", ".", 2, False), (";", ",", 2, False),
        ("\t", ".", 3, False), ("\t", ",", 2, True), (";", ".", 1, True), (",", ".", 4, False),
        (" ", ".", 2, False), (" ", ",", 3, False), (",", ".", 3, True), (",", ",", 2, False),
    )
]  # fmt: skip


@pytest.mark.parametrize("form", ["{},{}", '"{}","{}"', "{};{}", "{}\t{}", "{} {}", "{}"])
def test_numbers_with_a_sign_behind_a_blank_are_the_nearest_floats(tmp_path, form):
    values = np.abs(np.random.default_rng(3).normal(size=(2, 300)))
    columns = values[: form.count("{}")].T.tolist()
    rows = [form.format(*(f" +{value:.17g}" for value in row)) for row in columns]
    (tmp_path / "a.txt").write_text("\n".join(rows) + "\n")
    assert np.array_equal(read_table(open_source(tmp_path / "a.txt"), Wanted()).values.T, columns)


@settings(max_examples=300)  # fuzzing: few of the changes matter
@given(
    dialect=st.sampled_from(DIALECTS),
    rows=st.lists(st.lists(st.integers(-999, 999), min_size=4, max_size=4), min_size=1, max_size=6),
    changes=st.lists(
        st.tuples(st.integers(0, 99), st.sampled_from(FRAGMENTS), st.integers(0, 2)), max_size=3
    ),
    quoted=st.sampled_from(["", "", '"']),
)
def test_blocks_are_parsed_as_line_by_line_or_not_at_all(dialect, rows, changes, quoted):
    quoted = '"' if dialect.separator == dialect.decimal else quoted
    end = dialect.separator * dialect.trailing + "\n"
    text = "".join(
        dialect.separator.join(
            quoted + f"{value / 10}".replace(".", dialect.decimal) + quoted
            for value in row[: dialect.columns]
        )
        + end
        for row in rows
    )
    if not changes:
        assert parse_rows(text.encode(), dialect) is not None
    for place, fragment, cut in changes:
        text = text[:place] + fragment + text[place + cut :]
    assert same_as_line_by_line(text.removesuffix("\n") + "\n", dialect)


@pytest.mark.parametrize(
    "text",
    [b"1\n\n2\n", b"1\0x\n2\n", b"nan\n2\n", b"1e400\n2\n", b"1\n2;3\n", b"#1\n2\n", b"1\n2\n-\n",
     b'"1"2\n2\n', b'"1\n"\n2\n', b"\xef\xbb\xbf1\n2\n", b"inf\n2\n", b"1 2\n3\n", b"1\n%\n"],
)  # fmt: skip
def test_doubtful_blocks_are_left_to_the_careful_reader(text):
    assert parse_rows(text, ONE) is None


@pytest.mark.parametrize(
    "line",
    ["1..2,3\n", "1.2,.\n", "1-2,3\n", "1.2345678.,3\n", "1e,2\n", "e5,2\n", "1e+,2\n", "1e5e,2\n",
     "1 1,2\n", "1e5.0,2\n", "1e12345,2\n", "0x1.8p1,2\n", "1'000,2\n", "1_0,2\n", "0x1,2\n",
     "--1,2\n", "1,2;\n", "1-e5,2\n", "+-1,2\n", "١,2\n", "1.5\n", "1,2,3\n", "1,x\n",
     "1,1e400\n", "1,inf\n", "1,2\0\n", "#1,2\n", "1,2\x1a\n",
     "1 2,3\n", "1,2,\n3\n", ",\n", "nan,nan\n", " \n", '"1"2,3\n', '"1,2"\n'],
)  # fmt: skip
@pytest.mark.parametrize("index", [0, 199])
def test_a_doubtful_line_is_never_passed_over(line, index):
    lines = [f"{first!r},{second!r}\n" for first, second in ROWS[:200].tolist()]
    lines[index] = line
    assert parse_rows("".join(lines).encode(), COMMA) is None


@pytest.mark.parametrize("line", ["1,\n", ",2\n", "1,nan\n", "NaN,2\n", "1,N/A\n", '"1",""\n'])
@pytest.mark.parametrize("index", [0, 1, 199])
def test_a_missing_number_is_no_doubt(line, index):
    lines = [f"{first!r},{second!r}\n" for first, second in ROWS[:200].tolist()]
    lines[index] = line
    found = parse_rows("".join(lines).encode(), COMMA)
    assert np.count_nonzero(np.isnan(found)) == 1
    assert np.array_equal(np.delete(found, index, axis=0), np.delete(ROWS[:200], index, axis=0))


ROWS = np.random.default_rng(15).normal(size=(60_000, 2))


def written(path, rows=(), head="a,b\n", end="\n"):
    """Write a file of several blocks in which some rows are others."""
    lines = [f"{first!r},{second!r}{end}" for first, second in ROWS.tolist()]
    for index, line in rows:
        lines[index] = line
    path.write_bytes((head + "".join(lines)).encode())
    return path


@pytest.mark.parametrize("head", ["", "a,b\n", "Made by me\n\na,b\n"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_a_file_of_several_blocks(tmp_path, head, end):
    path = written(tmp_path / "large.csv", head=head, end=end)
    assert np.array_equal(read_recording(path, 1000.0).samples, ROWS.T)


def test_numbers_are_converted_in_place(tmp_path):
    found = read_recording(written(tmp_path / "large.csv", head="a [g],b [m/s2]\n"), 1000.0)
    assert np.array_equal(found.samples, [ROWS[:, 0] * 9.80665, ROWS[:, 1]])
    assert found.units == ("m/s2", "m/s2")


def test_a_file_without_a_last_line_end(tmp_path):
    path = written(tmp_path / "large.csv")
    whole = path.read_bytes()
    path.write_bytes(whole[:-1])
    assert np.array_equal(read_recording(path, 1000.0).samples, ROWS.T)
    path.write_bytes(whole[: whole.rindex(b",") + 1] + b"-")
    with pytest.raises(RecordingError, match="line 60001: the file is cut off in mid-line"):
        read_recording(path, 1000.0)


def test_odd_lines_among_plain_ones(tmp_path):
    first, second = ROWS[50_000].tolist()
    odd = f' {first!r} , "{second!r}"\n'
    remark = "# a remark\n{!r},{!r}\n".format(*ROWS[30_000].tolist())
    path = written(tmp_path / "large.csv", [(30_000, remark), (50_000, odd)])
    assert np.array_equal(read_recording(path, 1000.0).samples, ROWS.T)


@pytest.mark.parametrize("line", ["1,2,3\n", "1.5\n", "\0\n", "1,x\n"])
def test_a_bad_line_of_a_later_block_is_named(tmp_path, line):
    path = written(tmp_path / "large.csv", [(50_000, line)])
    with pytest.raises(RecordingError, match="line 50002"):
        read_recording(path, 1000.0)
