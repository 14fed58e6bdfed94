"""Dialects of text tables: the numbers must not depend on how they are written."""

from __future__ import annotations

import gzip
import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.slow_csv import read_slowly

from gearmon.errors import RecordingError
from gearmon.signals.reading.channels import Wanted
from gearmon.signals.reading.layout import Dialect
from gearmon.signals.reading.text import Block, Source, parse_rows, read_rows, read_table
from gearmon.signals.recording import read_recording

ROWS = [[0.5, -1.25, 3.0], [1e-3, 2.75, -0.125], [-12.5, 0.0, 7.5], [4.25, 1.5, -2.5]] * 8


def table(data: bytes | str, **source):
    content = data.encode() if isinstance(data, str) else data
    return read_table(Source(path="f.csv", content=content, **source), Wanted())


def heads(found):
    return tuple(column.cell for column in found.columns)


def written(separator=",", decimal=".", trailing="", quote="", shown="{:.6f}", end="\n"):
    lines = []
    for row in ROWS:
        fields = [quote + shown.format(value).replace(".", decimal) + quote for value in row]
        lines.append(separator.join(fields) + trailing + end)
    return "".join(lines)


@st.composite
def tables(draw):
    """Return the text of a table and the fields that were written into it."""
    columns = draw(st.integers(1, 5))
    gaps = ["\t", ";", " ", "   ", " \t", "; "] + ([",", ", "] if columns > 1 else [])
    separator = draw(st.sampled_from(gaps)) if columns > 1 else ""
    decimal = draw(st.sampled_from([".", ","])) if "," not in separator else "."
    shown = draw(st.sampled_from(["{:.6f}", "{!r}", "{:.17e}", "{:+.3f}", "{:12.4f}", "{:.6g}"]))
    finite = st.floats(-1e6, 1e6, allow_nan=False)
    row = st.lists(finite, min_size=columns, max_size=columns)
    values = draw(st.lists(row, min_size=2, max_size=12))
    fields = [[shown.format(value) for value in line] for line in values]
    quote = draw(st.sampled_from(["", "", '"']))
    trailing = draw(st.sampled_from(["", separator.strip(" ")]))
    end = draw(st.sampled_from(["\n", "\r\n", "\r"]))
    head = draw(st.sampled_from(["", "Made by: someone{0}{0}", "DATA{0}", "# a remark{0}"]))
    names = separator.join("abcde"[:columns]) + trailing + end
    unclear = columns == 1 and decimal == ","  # 1,5 without a name may be two columns
    text = head.format(end) + (names if unclear else draw(st.sampled_from(["", names])))
    for line in fields:
        cells = [quote + field.replace(".", decimal) + quote for field in line]
        text += separator.join(cells) + trailing + end
    return text + draw(st.sampled_from(["", end * 3])), fields, separator, decimal


@given(tables())
def test_every_number_is_what_float_makes_of_its_text(case):
    text, fields, _, _ = case
    expected = np.array([[float(field) for field in line] for line in fields])
    values = table(text).values.T
    assert np.array_equal(values, expected)
    assert np.array_equal(values, read_slowly(text.encode()))


@pytest.mark.parametrize("place", range(4))
@pytest.mark.parametrize("mark", [",", ";", "\t"])
@pytest.mark.parametrize("word", ["healthy", '"worn, left"', "gear 2"])
def test_a_column_of_words_changes_no_number_beside_it(place, mark, word):
    names = mark.join([*"abc"[:place], "label", *"abc"[place:]])
    rows = [[repr(own) for own in row] for row in ROWS]
    text = "".join(mark.join([*row[:place], word, *row[place:]]) + "\n" for row in rows)
    found = table(f"{names}\n{text}")
    beside = [own for own in range(4) if own != place]
    assert np.array_equal(found.values[beside].T, ROWS)
    assert np.isnan(found.values[place]).all()
    assert [own.kind for own in found.columns].index("other") == place


def test_a_column_with_words_in_some_rows_is_no_column_of_words(tmp_path):
    rows = [f"{k / 7:.3f},{'overload' if k > 5000 else k / 3:}\n" for k in range(10_000)]
    (tmp_path / "f.csv").write_text("a,b\n" + "".join(rows))
    with pytest.raises(RecordingError, match=r"line 2, column 2|line 5003, column 2"):
        read_recording(tmp_path / "f.csv", 1000.0)


@given(tables())
def test_the_fast_and_the_careful_way_agree(case):
    text, fields, separator, decimal = case
    kind = " " if separator and not separator.strip(" \t") and separator != "\t" else separator
    dialect = Dialect(
        separator=kind.strip(" ") if kind.strip(" \t") else kind,
        decimal=decimal,
        columns=len(fields[0]),
        trailing=bool(separator.strip(" ")),  # blanks at the end of a line are none
    )
    lines = text.replace("\r\n", "\n").replace("\r", "\n").strip("\n").split("\n")
    body = "".join(f"{line}\n" for line in lines[-len(fields) :]).encode()
    careful = read_rows("f.csv", Block(text=body, first_line=1), dialect)[0]
    fast = parse_rows(body, dialect)
    assert fast is None or np.array_equal(fast, careful)
    plain = '"' not in text and separator in (",", ";", "\t", " ", "")
    assert fast is not None or not plain


@pytest.mark.parametrize(
    "text",
    [
        written(),
        written(";", ","),
        written("\t", ","),
        written("    "),
        written(" ", ","),
        written(",", trailing=","),
        written(";", trailing=";"),
        written(", "),
        written(quote='"'),
        written(quote='"', decimal=","),
        written(";", quote='"', decimal=","),
        written(shown="{:.9e}").replace("e", "D"),
        written(end="\r\n"),
        written(end="\r"),
        written() + "\n" * 3000,
        written() + ",,\n" * 100,
        written() + "\x1a",
        written()[:-1],
        "\n" * 15 + "DATA\n" + written("\t", trailing="\t"),
        "a,b,c\n" + written(),
        "a;b;c;\n" + written(";", trailing=";"),
        "a;b;c\n" + written(";", trailing=";"),
        "a;b;c;\n" + written(";"),
        "Serial: 5\nDate: 2024-03-12\n\nx,y,z\n[g],[g],[g]\n\n" + written(),
        "# x y z\n" + written(" "),
        "% made by hand\n" + written(),
        "0,1,2\n" + written(),
        "".join(f"{line}\n\n" for line in written().split("\n")),
        written().replace("\n", "\n# remark\n", 3),
    ],
)
def test_dialects(text):
    assert np.array_equal(table(text).values.T, ROWS)


def test_a_headerless_file_keeps_its_first_row():
    assert table(written()).values[:, 0].tolist() == ROWS[0]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "utf-16", "utf-32"])
def test_encodings(encoding, tmp_path):
    path = tmp_path / "recording.csv"
    path.write_bytes(("Größe [m/s²],b,c\n" + written()).encode(encoding))
    recording = read_recording(path, sampling_rate_hz=100)
    assert np.array_equal(recording.samples.T, ROWS)
    assert recording.channel_names == ("Größe", "b", "c")
    assert recording.units[0] == "m/s2"


def test_gzip_is_known_by_its_first_bytes(tmp_path):
    path = tmp_path / "recording.csv"
    path.write_bytes(gzip.compress(written().encode()))
    assert np.array_equal(read_recording(path, 100).samples.T, ROWS)


@pytest.mark.parametrize("size", [1, 2, 3, 7, 64, 1000])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_blocks_are_whole_lines_with_their_numbers(size, end):
    text = "".join(f"line {number}{end}" for number in range(1, 40)) + "last"
    blocks = list(Source(path="f", content=text.encode()).blocks(size))
    assert b"".join(block.text for block in blocks).decode() == text.replace(end, "\n") + "\n"
    assert [block.closed for block in blocks] == [True] * (len(blocks) - 1) + [False]
    for block in blocks:
        first = block.text.split(b"\n")[0].decode()
        assert first in (f"line {block.first_line}", "last")


def test_a_preamble_longer_than_the_first_look():
    preamble = "".join(f"setting {number} = on and off\n" for number in range(20_000))
    assert np.array_equal(table(preamble + "a,b,c\n" + written()).values.T, ROWS)


def test_a_file_of_many_blocks_read_by_threads(monkeypatch):
    monkeypatch.setattr("gearmon.signals.reading.text._THREADED_BYTES", 0)
    rng = np.random.default_rng(4)
    values = rng.normal(size=(40_000, 3)).round(6)
    text = "".join("{:.6f},{:.6f},{:.6f}\n".format(*row) for row in values.tolist())
    assert np.array_equal(table(text).values.T, values)


def test_rows_that_get_shorter_than_the_first_ones():
    # far more rows than the first block lets expect
    values = np.concatenate([np.full(2000, 1.234567890123), np.tile([1.0, 2.0, 5.0], 300_000)])
    text = "".join(f"{value!r}\n" for value in values[:2000].tolist()) + "1\n2\n5\n" * 300_000
    assert np.array_equal(table(text).values[0], values)


class TestDecimalCommaInASingleColumn:
    def test_a_name_settles_it(self):
        assert table("acceleration\n1,5\n2,5\n3,5\n").values.tolist() == [[1.5, 2.5, 3.5]]
        assert table("a,b\n1,5\n2,5\n").values.tolist() == [[1.0, 2.0], [5.0, 5.0]]

    def test_digits_settle_it(self):
        assert table("1,05\n2,5\n").values.tolist() == [[1.05, 2.5]]
        assert table("-0,5\n2,5\n").values.tolist() == [[-0.5, 2.5]]
        assert table("1.5,5\n2,5\n").values.tolist() == [[1.5, 2.0], [5.0, 5.0]]

    def test_otherwise_it_is_not_guessed(self):
        with pytest.raises(RecordingError, match=r"one column with decimal commas or two columns"):
            table("1,5\n2,5\n3,7\n")


def test_names_above_columns_that_are_not_as_many_are_not_used():
    found = table("a,b\n" + written())
    assert heads(found) == ("",) * len(found.columns)
    assert "2 names for 3 columns" in found.notes[0]
    assert np.array_equal(found.values.T, ROWS)


def test_names_with_blanks_above_columns_of_blanks():
    found = table("Time (s)  Acc x (g)  b\n" + written("  "))
    assert heads(found) == ("Time (s)", "Acc x (g)", "b")


def test_a_named_column_without_any_number_is_a_column():
    found = table("a,b,c,d\n" + written(trailing=","))
    assert found.values.shape == (4, len(ROWS))
    assert np.isnan(found.values[3]).all()


class TestQuotesWithoutAnEnd:
    @pytest.mark.parametrize("end", ["\n", "\r\n"])
    def test_line_breaks_within_names_are_refused_with_their_line(self, end):
        with pytest.raises(RecordingError, match="line 2: a quote is not closed in this line"):
            table(f'3" pipe{end}"a1{end}[g]","b{end}[V]"{end}' + "1.5,2\n" * 9)

    @pytest.mark.parametrize("row", ['"0.25\n",1.5,2', '0.25,"1.5\n",2', '0.25,1.5,"2\n"'])
    @pytest.mark.parametrize("head", ["", "a,b,c\n"])
    def test_so_are_they_in_the_first_row(self, head, row):
        line = 1 + head.count("\n")
        with pytest.raises(RecordingError, match=f"line {line}: a quote is not closed"):
            table(head + row + "\n" + written())

    @pytest.mark.parametrize("row", ['0.5,1.5,"2', '"0.5,1.5,2', '0.5,"1.5",2"'])
    def test_a_first_row_that_closes_a_quote_of_the_header_is_not_lost(self, row):
        with pytest.raises(RecordingError, match="line 1: "):
            table(f'"[g],[g],[g]\na,b,c\n{row}\n' + written())

    @pytest.mark.parametrize("row", ['"1.5","2","3e"-1","4"', '1.5,"2x,3', '1.5x,2"', '1.5,2;3"'])
    def test_a_damaged_one_neither(self, row):
        with pytest.raises(RecordingError, match="line 2: "):
            table(f'a,b,c\n"x=5\n{row}\n' + written())

    def test_in_a_later_row_too(self):
        with pytest.raises(RecordingError, match="line 34"):
            table("a,b,c\n" + written() + '1,"2\n",3\n' + written())

    def test_a_stray_quote_is_none(self):
        found = table('pipe of 3"\na,b,c\n' + written())
        assert heads(found) == ("a", "b", "c")
        assert np.array_equal(found.values.T, ROWS)


LABVIEW = """LabVIEW Measurement\t
Writer_Version\t2
Date\t2024/03/12
***End_of_Header***\t

Channels\t2\t\t
Samples\t32\t32\t
X_Dimension\tTime\tTime\t
Delta_X\t0.001000\t0.001000\t
***End_of_Header***\t\t\t
X_Value\tacc x\tacc y\tComment
"""
OSCILLOSCOPE = "Time,Ch A,Ch B\n(ms),(V),(g)\n\n"
GERMAN = "sep=;\nMessstelle;Lager 1;\nDatum;12.03.2024;\nZeit in ms;Beschl. x [m/s²];Drehzahl\n"


@pytest.mark.parametrize(
    ("head", "separator", "decimal", "step", "names", "kinds", "units"),
    [
        (LABVIEW, "\t", ".", 1e-3, ("acc x", "acc y"), ("vibration",) * 2, (None, None)),
        (OSCILLOSCOPE, ",", ".", 1.0, ("Ch A", "Ch B"), ("vibration",) * 2, ("V", "m/s2")),
        (GERMAN, ";", ",", 1.0, ("Beschl. x", "Drehzahl"), ("vibration", "speed"), ("m/s2", None)),
    ],
)
def test_files_as_instruments_write_them(
    tmp_path, head, separator, decimal, step, names, kinds, units
):
    rows = [(k * step, math.sin(k), math.cos(k)) for k in range(32)]
    lines = [separator.join(f"{value:.6f}" for value in row) for row in rows]
    path = tmp_path / "recording.txt"
    text = head + "\n".join(lines).replace(".", decimal) + "\n"
    path.write_bytes(text.encode("cp1252"))
    recording = read_recording(path)
    assert recording.sampling_rate_hz == pytest.approx(1000.0)
    assert recording.channel_names == names
    assert recording.channel_kinds == kinds
    assert recording.units == units
    assert recording.columns == (2, 3)


def test_time_of_day_and_dates_become_seconds():
    stamps = [f"2024-03-12T23:59:59.{k:03d}" for k in range(0, 40, 10)]
    found = table("t;a\n" + "".join(f"{stamp};{k}\n" for k, stamp in enumerate(stamps)))
    assert found.values[0] == pytest.approx([0.0, 0.01, 0.02, 0.03], abs=1e-12)
    clock = table("t;a\n" + "".join(f"{stamp[11:]};1\n" for stamp in stamps))
    assert np.array_equal(clock.values[0], found.values[0])


@pytest.mark.parametrize("day", ["11/29/2026 ", "29.11.2026 ", "4-5-2026 "])
@pytest.mark.parametrize("hour", ["09", "12", "23"])
def test_dates_that_may_be_read_in_two_ways_tell_the_time_of_day(day, hour):
    half = ("AM", "PM")[int(hour) >= 12]
    stamps = [f":59:{k // 100:02d}.{k % 100:02d}" for k in range(0, 400, 10)]
    plain, dated, halved = (
        table("t;a\n" + "".join(f"{front}{stamp}{behind};1\n" for stamp in stamps)).values[0]
        for front, behind in (
            (hour, ""), (day + hour, ""), (f"{day}{(int(hour) - 1) % 12 + 1}", " " + half)
        )
    )  # fmt: skip
    assert plain == pytest.approx(0.1 * np.arange(40), abs=1e-9)
    assert np.array_equal(plain, dated)
    assert np.array_equal(plain, halved)


def test_a_morning_goes_over_into_an_afternoon():
    found = table("t;a\n11:59:59 AM;1\n12:00:00 PM;2\n12:00:01 PM;3\n1:00:00 PM;4\n")
    assert found.values[0].tolist() == [0.0, 1.0, 2.0, 3601.0]


def test_decimal_commas_with_exponents_under_one_name_are_one_column():
    found = table("a\n0,0\n1,5e-162\n-2,5e+3\n").values
    np.testing.assert_array_equal(found, [[0.0, 1.5e-162, -2500.0]])
    two = table("a,b\n0,0\n1,5e-162\n").values
    np.testing.assert_array_equal(two, [[0.0, 1.0], [0.0, 5e-162]])
    assert table("0,0\n1,5e-162\n" * 4).values.shape == (2, 8)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -1e31])
def test_a_speed_goes_straight_over_what_is_no_speed(wrong):
    frame = pd.DataFrame({"a": np.arange(99.0) % 7, "speed_rpm": 1500.0 + np.arange(99.0)})
    frame.loc[[0, 40, 41, 98], "speed_rpm"] = wrong
    speed = read_recording(frame, 1000.0).samples[1]
    assert np.array_equal(speed[1:98], 1501.0 + np.arange(97.0))
    assert speed[[0, 98]].tolist() == [1501.0, 1597.0]


@pytest.mark.parametrize("names", ["time_s,a,speed_rpm\n", "time_s,a,speed_rpm,\n"])
@pytest.mark.parametrize("first", [0, 7])
def test_a_last_column_may_hold_a_number_now_and_then(tmp_path, names, first):
    end, path = "," if names.endswith(",\n") else "", tmp_path / "bus.csv"
    told = {row: f"{1500 + row / 100:.2f}" for row in range(first, 3000, 500)}
    rows = (f"{row / 1000},{row % 7 - 3},{told.get(row, '')}{end}\n" for row in range(3000))
    path.write_text(names + "".join(rows))
    found = read_recording(path)
    assert found.channel_kinds == ("vibration", "speed")
    inside = slice(first, first + 2501)
    assert found.samples[1, inside] == pytest.approx(1500 + np.arange(3000)[inside] / 100)
    assert "lacks a usable number in 2994 of 3000 rows" in found.notes[1]
    # what is no speed is not made up between two numbers
    path.write_text(names.replace("speed_rpm", "acc") + path.read_text().split("\n", 1)[1])
    with pytest.raises(RecordingError, match="lacks a usable number in 2994 of 3000 rows"):
        read_recording(path)
