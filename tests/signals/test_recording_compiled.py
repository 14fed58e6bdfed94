"""Blocks through the compiled parser: what the careful reader makes of them, or nothing at all."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gearmon.errors import RecordingError
from gearmon.signals.reading import byte_scan, whole
from gearmon.signals.reading.careful import read_rows
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


WAYS = ["pandas", "polars"]


@pytest.fixture
def way(request, monkeypatch):
    """Let one of the parsers of whole files do the work."""
    if request.param == "polars":
        pytest.importorskip("polars", minversion="2.1")
    monkeypatch.setattr(whole, "is_at_hand", lambda **_: request.param == "polars")
    monkeypatch.setattr(whole, "_has_pandas", lambda **_: request.param == "pandas")
    return request.param


def same_as_line_by_line(text, dialect, path):
    """Tell whether whole files are parsed as the careful reader does, or left to it."""
    path.write_bytes(text)
    source = open_source(path)
    found = parse_file(source, Layout(dialect=dialect, first_line=1, header=Header()))
    if found is None:
        return True
    expected, empty = [], 0
    for block in source.blocks():
        rows = read_rows(source.path, block, dialect, ["x"] * dialect.columns, empty)
        expected.append(rows.values)
        empty = rows.empty_line
    finite = np.where(np.isfinite(found.T), found.T, np.nan)
    slow = np.concatenate(expected)
    slow[~np.isfinite(slow)] = np.nan
    alike = np.array_equal(finite, slow, equal_nan=True)
    return alike and np.array_equal(np.signbit(finite[slow == 0]), np.signbit(slow[slow == 0]))


FRAGMENTS = [
    "1", "-3", "+4", ".5", "6.", "1e3", "1E-3", "1e00005", "1e-99999", "0e99999", "1e4294967297",
    "1d3", "nan", "inf", "1_0", "0x1", "", " ", "\t", "\r", "\0", "\n", "\r\n", ",", ";", ".", "-",
    "e", '"', "#", "%", "\v", "\f", "\xa0", "\x1a", "\x1f", "-0", "00012", "9" * 40, "1e400", "1,5",
]  # fmt: skip
DIALECTS = [
    Dialect(separator=separator, decimal=decimal, columns=columns)
    for separator, decimal, columns in (
        ("", ".", 1), ("", ",", 1), (",", ".", 2), (";", ",", 2), ("\t", ".", 3), ("\t", ",", 2),
        (";", ".", 1), (",", ".", 4),
    )
]  # fmt: skip


@pytest.mark.usefixtures("way")
@pytest.mark.parametrize("way", WAYS, indirect=True)
@settings(max_examples=400, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    dialect=st.sampled_from(DIALECTS),
    rows=st.lists(st.lists(st.integers(-999, 999), min_size=4, max_size=4), min_size=1, max_size=6),
    changes=st.lists(
        st.tuples(st.integers(0, 99), st.sampled_from(FRAGMENTS), st.integers(0, 2)), max_size=3
    ),
    end=st.sampled_from(["\n", "\r\n"]),
)
def test_whole_files_are_parsed_as_line_by_line_or_not_at_all(
    tmp_path, dialect, rows, changes, end
):
    lines = [
        dialect.separator.join(
            f"{value / 10}".replace(".", dialect.decimal) for value in row[: dialect.columns]
        )
        for row in rows
    ]
    text = end.join(lines) + end
    for place, fragment, cut in changes:
        text = text[:place] + fragment + text[place + cut :]
    assert same_as_line_by_line(text.encode(), dialect, tmp_path / "any.csv")


@pytest.mark.usefixtures("way")
@pytest.mark.parametrize("way", WAYS, indirect=True)
def test_any_double_comes_back_from_a_whole_file(tmp_path):
    bits = np.random.default_rng(16).integers(0, 2**64, 20_000, dtype=np.uint64)
    numbers = bits.view(np.float64)
    numbers = numbers[np.isfinite(numbers)]
    path = tmp_path / "doubles.csv"
    path.write_text("".join(f"{number!r}\n" for number in numbers.tolist()))
    layout = Layout(dialect=ONE, first_line=1, header=Header())
    assert np.array_equal(parse_file(open_source(path), layout), numbers[None])


@pytest.mark.parametrize("many", [False, True])
def test_long_exponents_are_seen_at_every_place_of_the_pieces(tmp_path, monkeypatch, many):
    monkeypatch.setattr(byte_scan, "_PIECE", 32)
    monkeypatch.setattr(byte_scan, "_FEW", 0 if many else 100)
    path = tmp_path / "exponents.csv"
    for before in range(40):
        for exponent in ("e12345", "E-12345", "e+1234", "e1234\n5", "e-123"):
            path.write_text("1" * before + exponent)
            found = any(map(byte_scan.has_long_exponent, byte_scan.pieces(str(path))))
            assert found == (len(exponent.strip("eE+-")) == 5), (before, exponent)


def test_lone_returns_are_seen_at_every_place_of_the_pieces(tmp_path, monkeypatch):
    monkeypatch.setattr(byte_scan, "_PIECE", 16)
    path = tmp_path / "returns.csv"
    for before in range(40):
        for end, lone in ((b"\r\n", False), (b"\r", True), (b"\r,", True), (b"\r\n2\r\n", False)):
            path.write_bytes(b"1" * before + end)
            pieces = list(byte_scan.pieces(str(path)))
            assert len(pieces) >= before // 16
            assert any(map(byte_scan.has_lone_return, byte_scan.pieces(str(path)))) == lone
            lines = sum(map(byte_scan.line_feeds, byte_scan.pieces(str(path))))
            assert lines == end.count(b"\n")


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
@pytest.mark.usefixtures("way")
@pytest.mark.parametrize("way", WAYS, indirect=True)
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
    ["1.5\n", "1,2,3\n", "1,2\n\n", "1,x\n", "1,\n", "1,nan\n", "1,1e400\n", "1,2\r3,4\n",
     '"1",2\n', "1,2\0\n", "#1,2\n", "1,2\x1a\n", "1\r,2\n", "1,2\r\r\n", "1 2,3\n", "1,2,\n3\n"],
)  # fmt: skip
@pytest.mark.parametrize("index", [0, 1, 150, 199])
@pytest.mark.usefixtures("way")
@pytest.mark.parametrize("way", WAYS, indirect=True)
def test_a_doubtful_line_is_never_passed_over(tmp_path, line, index):
    path = tmp_path / "small.csv"
    lines = [f"{first!r},{second!r}\n" for first, second in ROWS[:200].tolist()]
    lines[index] = line
    path.write_text("a,b\n" + "".join(lines))
    source = open_source(path)
    found = parse_file(source, Layout(dialect=COMMA, first_line=2, header=Header()))
    assert found is None or not np.isfinite(found).all()


@pytest.mark.parametrize("line", ["1,2,3\n", "1.5\n", "\n", "1,2\r3,4\n"])
@pytest.mark.usefixtures("way")
@pytest.mark.parametrize("way", WAYS, indirect=True)
def test_nor_is_one_in_a_large_file(tmp_path, line):
    path = written(tmp_path / "large.csv", [(150_000, line)])
    source = open_source(path)
    assert parse_file(source, layout_of(source)) is None


@pytest.mark.usefixtures("way")
@pytest.mark.parametrize("way", WAYS, indirect=True)
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
