"""Tables as text and CSV."""

from __future__ import annotations

import csv
import io

from hypothesis import given
from hypothesis import strategies as st

from gearmon.report.wording import rows_as_csv, table_lines

ROWS = [
    {"name": "mesh 1", "stage": 1, "order": 23.0, "shaft": None},
    {"name": "x", "stage": 12, "order": 0.123456789, "shaft": 3},
]


def test_numbers_stand_to_the_right_and_words_to_the_left():
    assert table_lines(ROWS) == [
        "name    stage     order  shaft",
        "mesh 1      1        23",
        "x          12  0.123457      3",
    ]


def test_a_table_of_texts_is_aligned_as_it_says():
    assert table_lines([{"name": "mesh", "Hz": "4.25"}], "lr") == ["name    Hz", "mesh  4.25"]


def test_no_rows():
    assert table_lines([]) == ["(nothing)"]
    assert rows_as_csv([]) == ""


def test_rows_as_csv():
    assert rows_as_csv(ROWS) == ("name,stage,order,shaft\nmesh 1,1,23.0,\nx,12,0.123456789,3\n")


WORDS = st.text(st.characters(codec="utf-8", exclude_characters="\r\x00"), max_size=8)


@given(
    st.lists(
        st.fixed_dictionaries(
            {"word": WORDS, "value": st.floats(allow_nan=False), "count": st.integers()}
        ),
        min_size=1,
        max_size=4,
    )
)
def test_csv_gives_back_what_was_written(rows):
    read = list(csv.DictReader(io.StringIO(rows_as_csv(rows), newline="")))
    for told, row in zip(read, rows, strict=True):
        # what a spreadsheet would run stands behind a quote
        assert told["word"] in (row["word"], "'" + row["word"])
        assert not (told["word"][:1] in ("=", "@") and told["word"] == row["word"])
    assert [int(row["count"]) for row in read] == [row["count"] for row in rows]
    assert [float(row["value"]) for row in read] == [row["value"] for row in rows]


@given(st.lists(st.tuples(st.integers(), st.text("abc ", max_size=9)), min_size=1, max_size=5))
def test_columns_line_up(values):
    lines = table_lines([{"count": count, "word": word} for count, word in values])
    width = max(len("count"), *(len(str(count)) for count, _ in values))
    assert all(line[:width].strip() for line in lines)
    assert {line[width : width + 2].strip() for line in lines} == {""}
