"""Blocks through the compiled parser: what the careful reader makes of them, or nothing at all."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.errors import RecordingError
from gearmon.signals.reading.compiled import is_worthwhile, parse_compiled
from gearmon.signals.reading.dialect import Dialect, Layout
from gearmon.signals.reading.fields import is_number, to_number
from gearmon.signals.reading.header import Header
from gearmon.signals.reading.plain import parse_plain
from gearmon.signals.reading.source import open_source
from gearmon.signals.reading.table import layout_of
from gearmon.signals.reading.whole import is_eligible, parse_file
from gearmon.signals.recording import read_recording

pytest.importorskip("pandas", minversion="3.1")

ONE = Dialect(separator="", decimal=".", columns=1)
TWO = Dialect(separator=";", decimal=",", columns=2)
COMMA = Dialect(separator=",", decimal=".", columns=2)
ODD = st.text("0123456789.,;+-eE dx\t\"'", max_size=12)
PLAIN = st.floats(allow_nan=False, allow_infinity=False).map(repr)


@given(st.lists(ODD | PLAIN | st.from_regex(r"[+-]?[0-9]{1,25}[.,]?[0-9]{0,25}", fullmatch=True)))
def test_one_column(fields):
    found = parse_compiled("".join(f"{field}\n" for field in [*fields, "1.5"]).encode(), ONE)
    if found is not None:
        assert all(is_number(field, ".") for field in fields)
        assert found[:-1, 0].tolist() == [to_number(field, ".") for field in fields]


@given(st.lists(st.tuples(ODD | PLAIN, ODD | PLAIN)))
def test_two_columns_with_decimal_commas(rows):
    lines = [";".join(row).replace(".", ",") for row in rows]
    found = parse_compiled("".join(f"{line}\n" for line in [*lines, "1,5;2"]).encode(), TWO)
    if found is not None:
        parted = [line.split(";") for line in lines]
        assert all(len(row) == 2 and all(is_number(f, ",") for f in row) for row in parted)
        assert found[:-1].tolist() == [[to_number(f, ",") for f in row] for row in parted]


def test_any_double_comes_back_and_equals_the_own_parser():
    bits = np.random.default_rng(14).integers(0, 2**64, 20_000, dtype=np.uint64)
    numbers = bits.view(np.float64)
    numbers = numbers[np.isfinite(numbers)]
    text = "".join(f"{number!r}\n" for number in numbers.tolist()).encode()
    found = parse_compiled(text, ONE)
    assert found is not None
    assert np.array_equal(found[:, 0], numbers)
    assert np.array_equal(parse_plain(text, ONE), found)


@pytest.mark.parametrize(
    "text",
    [b"1\n\n2\n", b"1 \n2\n", b"1\0x\n2\n", b"nan\n2\n", b"1e400\n2\n", b"1\n2;3\n", b"#1\n2\n",
     b"1e00005\n2\n", b'"1"\n2\n', b"1\r2\n", b"1\n2\n-\n"],
)  # fmt: skip
def test_doubtful_blocks_are_left_to_others(text):
    assert parse_compiled(text, ONE) is None


def test_only_large_files_of_long_numbers():
    sample = b"0.1234567890123456789\n" * 100
    assert is_worthwhile(sample, ONE, 2**30)
    assert not is_worthwhile(sample, ONE, 2**20)
    assert not is_worthwhile(b"0.123\n" * 100, ONE, 2**30)
    assert not is_worthwhile(sample, Dialect(separator=" ", decimal=".", columns=1), 2**30)


ROWS = np.random.default_rng(15).normal(size=(240_000, 2))


def written(path, rows=(), head="a,b\n", end="\n"):
    """Write a large file of long numbers in which some rows are others."""
    lines = [f"{first!r},{second!r}{end}" for first, second in ROWS.tolist()]
    for index, line in rows:
        lines[index] = line
    path.write_text(head + "".join(lines))
    assert path.stat().st_size > 8 * 2**20
    return path


@pytest.mark.parametrize("head", ["", "a,b\n", "Made by me\n\na,b\n"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_large_plain_file_in_one_go(tmp_path, head, end):
    path = tmp_path / "large.csv"
    source = open_source(written(path, head=head, end=end))
    layout = layout_of(source)
    assert is_eligible(source, layout)
    assert np.array_equal(parse_file(source, layout), ROWS.T)
    shares = []
    assert np.array_equal(read_recording(path, 1000.0, progress=shares.append).samples, ROWS.T)
    assert shares[-1] == 1.0


@pytest.mark.parametrize(
    "line",
    ["1.5\n", "1,2,3\n", "1,2\n\n", "1, 2\n", "1,x\n", "1,\n", "1,nan\n", "1,1e400\n", "1,2\r3,4\n",
     "1,2e00001\n", '"1",2\n', "1,2\0\n", "#1,2\n", "1,2\x1a\n"],
)  # fmt: skip
@pytest.mark.parametrize("index", [0, 1, 150, 199])
def test_a_doubtful_line_is_never_passed_over(tmp_path, line, index):
    path = tmp_path / "small.csv"
    lines = [f"{first!r},{second!r}\n" for first, second in ROWS[:200].tolist()]
    lines[index] = line
    path.write_text("a,b\n" + "".join(lines))
    source = open_source(path)
    found = parse_file(source, Layout(dialect=COMMA, first_line=2, header=Header()))
    assert found is None or not np.isfinite(found).all()


@pytest.mark.parametrize("line", ["1,2,3\n", "1.5\n", "1, 2\n"])
def test_nor_is_one_in_a_large_file(tmp_path, line):
    path = written(tmp_path / "large.csv", [(150_000, line)])
    source = open_source(path)
    assert parse_file(source, layout_of(source)) is None


def test_numbers_read_in_one_go_are_converted_in_place(tmp_path):
    found = read_recording(written(tmp_path / "large.csv", head="a [g],b [m/s2]\n"), 1000.0)
    assert np.array_equal(found.samples, [ROWS[:, 0] * 9.80665, ROWS[:, 1]])
    assert found.units == ("m/s2", "m/s2")


def test_a_file_without_a_last_line_end(tmp_path):
    path = written(tmp_path / "large.csv")
    whole = path.read_bytes()
    path.write_bytes(whole[:-1])
    assert np.array_equal(read_recording(path, 1000.0).samples, ROWS.T)
    path.write_bytes(whole[: whole.rindex(b",") + 1] + b"-")
    with pytest.raises(RecordingError, match="line 240001: the file is cut off in mid-line"):
        read_recording(path, 1000.0)


def test_a_large_file_with_odd_lines_in_it(tmp_path):
    first, second = ROWS[200_000].tolist()
    odd = f' {first!r} , "{second!r}"\n'
    remark = "# a remark\n{!r},{!r}\n".format(*ROWS[100_000].tolist())
    path = written(tmp_path / "large.csv", [(100_000, remark), (200_000, odd)])
    assert np.array_equal(read_recording(path, 1000.0).samples, ROWS.T)
