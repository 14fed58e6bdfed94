"""Every file that cannot be used gets one clear line: file, line, column, value, remedy."""

from __future__ import annotations

import gzip
import os
import threading

import numpy as np
import pytest

from gearmon.errors import RecordingError
from gearmon.signals.recording import read_recording

HEAD = "a,b,c\n"
LINES = [
    "{:.6f},{:.6f},{:.6f}\n".format(*row)
    for row in np.random.default_rng(11).normal(size=(300, 3)).tolist()
]
BODY = "".join(LINES)


def with_line(index, line, head=HEAD):
    return head + "".join([*LINES[:index], line, *LINES[index + 1 :]])


def refusal(path, content, **arguments):
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(RecordingError) as caught:
        read_recording(path, arguments.pop("sampling_rate_hz", 1000.0), **arguments)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    return message.removeprefix(str(path))


@pytest.fixture
def path(tmp_path):
    return tmp_path / "recording.csv"


@pytest.mark.parametrize("cell", ["nan", "-inf", "1e999", "", "#N/A"])
@pytest.mark.parametrize("index", [0, 1, len(LINES) - 1])
@pytest.mark.parametrize("column", [1, 2, 3])
def test_a_cell_without_a_number_is_named_by_its_place_wherever_it_is(path, index, column, cell):
    cells = ["1"] * 3
    cells[column - 1] = cell
    message = refusal(path, with_line(index, ",".join(cells) + "\n"))
    assert f", line {index + 2}, column {column} ('{'abc'[column - 1]}'): " in message


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "is empty"),
        ("\n\n  \n", "is empty (only blanks)"),
        (b"\0" * 5000, "only zero bytes"),
        (HEAD, "only a header, no rows of numbers in its 1 line (line 1 reads 'a,b,c')"),
        ("some text\n" * 30, "no rows of numbers in its 30 lines"),
        (HEAD + "1.5,2.5,3.5\n", "1 sample(s) per channel; at least 2"),
        (with_line(150, "1,abc,3\n"), "line 152, column 2 ('b'): 'abc' is not a number"),
        (with_line(150, "1,2.5.1,3\n"), "line 152, column 2 ('b'): '2.5.1' is not a number"),
        (with_line(0, "1.5,abc,3\n"), "line 2, column 2: 'abc' is not a number"),
        (with_line(0, "1.5,abc,3\n", ""), "line 1, column 2: 'abc' is not a number"),
        (with_line(0, "x1.5,2,3\n"), "line 2, column 1: 'x1.5' is not a number"),
        (with_line(150, "1,2\n"), "line 152: 2 fields where the table has 3 columns"),
        (with_line(150, "1,2,3,4\n"), "line 152: 4 fields where the table has 3 columns"),
        (with_line(0, "1,2\n"), "line 2: 2 numbers where the rows below have 3"),
        ("512\n" + BODY, "line 1: 1 number where the rows below have 3"),
        (with_line(150, ",,\n"), "line 152: empty between samples; was a sample lost?"),
        (with_line(150, "#1,2,3\n"), "line 152: a sample is taken out by '#'"),
        (with_line(150, "1,\0,3\n"), "line 152: zero bytes; the file is damaged"),
        (HEAD + BODY + "Mean,0,0\n", "line 302, column 1 ('a'): 'Mean' is not a number"),
        (HEAD + BODY + "End of file\n", "line 302: 'End of file' is not a number"),
        (with_line(150, "1,nan,3\n"), "line 152, column 2 ('b'): 'nan' is no number; the column "
         "lacks a usable number in 1 of 300 rows"),
        (with_line(150, "1,-inf,3\n"), "line 152, column 2 ('b'): '-inf' is no number"),
        (with_line(150, "1,1e999,3\n"), "line 152, column 2 ('b'): '1e999' is no number"),
        (with_line(150, "1,,3\n"), "line 152, column 2 ('b'): an empty field is no number"),
        (with_line(150, "1,#N/A,3\n"), "line 152, column 2 ('b'): '#N/A' is no number"),
        (HEAD + "nan,nan,nan\n" * 300, "no usable vibration channel: column 1 ('a') has no numbers "
         "at all in 300 rows (and 2 more)"),
        (HEAD + "1,2,3\n" * 300, "no usable vibration channel: column 1 ('a') is constant"),
        ("t,a\n" + "".join(f"{k / 1000},nan\n" for k in range(90)), "column 2 ('a') has no"),
        ("".join(f"OK,{line}" for line in LINES)[:-4], "line 300: the file is cut off in mid-line"),
        ("1,2,3,4,5" * 500 + "\n" + "1,2,3,4,5" * 500, "numbers in a line; a recording needs one "
         "line per sample"),
        ("torque,speed\n" + "1.5,3.5\n2.5,2\n" * 9, "no vibration channel (column 1 ('torque')"),
    ],
)  # fmt: skip
def test_unusable_tables(path, content, said):
    assert said in refusal(path, content)


def test_a_gap_in_a_single_column_is_no_blank_line(path):
    text = "".join(f"{value:.3f}\n" for value in np.random.default_rng(12).normal(size=90))
    lines = text.split("\n")
    lines[50] = ""
    assert "line 51: empty between samples" in refusal(path, "\n".join(lines))


@pytest.mark.parametrize("cut", [12, 9, 8, 4, 2])
def test_a_file_cut_off_in_mid_line(path, cut):
    text = HEAD + BODY[:-1]
    said = refusal(path, text[:-cut])
    assert "line 301: the file is cut off in mid-line" in said


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("1.5,2.25\n2.5,3.25\n1.5,2.", "'2.'"),
        ("1.5,2.25\n2.5,3.25\n1.5,-", "'-'"),
        ("1.5,2e5\n2.5,3e5\n1.5,2e", "'2e'"),
        ("1.5;2;\n2.5;3;\n1.5;4", "no separator at its end"),
        ("1.5,2.25\n2.5,3.25\n1.5", "1 field of 2"),
    ],
)
def test_half_a_number_at_the_end(path, text, shown):
    assert f"cut off in mid-line ({shown}" in refusal(path, text)


@pytest.mark.parametrize(
    ("last", "said"),
    [
        ("1.5,x,2.", "line 302, column 2 ('b'): 'x' is not a number"),
        ("sum,1.25,2.", "line 302, column 1 ('a'): 'sum' is not a number"),
        ("Mean,0", "line 302: 2 fields where the table has 3 columns"),
    ],
)
def test_a_last_line_of_words_is_no_row_that_was_cut(path, last, said):
    assert said in refusal(path, HEAD + BODY + last)


def test_words_above_whole_numbers_do_not_tell_whether_a_comma_parts_them(path):
    rows = "".join(f"{k % 9},{k % 7}\n" for k in range(40))
    assert "may be one column with decimal commas" in refusal(path, f"first run in June\n{rows}")
    path.write_text(f"a\n{rows}")
    assert read_recording(path, 1000.0).samples.shape == (1, 40)
    path.write_text(f"a,b\n{rows}")
    assert read_recording(path, 1000.0).samples.shape == (2, 40)


def test_a_complete_last_line_needs_no_line_end(path):
    path.write_text(HEAD + BODY[:-1])
    assert read_recording(path, 1000.0).samples.shape == (3, 300)


def test_a_last_number_may_be_as_short_as_others_are(path):
    values = [0.25, 0.125, 0.5, 0.375] * 20
    path.write_text("".join(f"{value:g},{value:g}\n" for value in values) + "0.125,0.5")
    assert read_recording(path, 1000.0).samples[1, -1] == 0.5


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (bytes(range(256)) * 40, "a binary file of unknown kind"),
        (b"PK\x03\x04" + b"\0" * 30 + b"[Content_Types].xml", "an Excel workbook"),
        (b"PK\x03\x04" + b"\0" * 30 + b"data.csv", "an archive or a compressed file"),
        (b"MDF     4.10    " + bytes(50), "an MDF measurement file"),
        (b"OggS" + bytes(50), "an Ogg sound file"),
        (b"%PDF-1.7\n", "a PDF document"),
        (b"\n<!DOCTYPE html>\n<html>", "a web page"),
        (b'{"samples": [1, 2]}', "a JSON document"),
        (b"version https://git-lfs.github.com/spec/v1\n", "a pointer left by Git LFS"),
        (
            gzip.compress(gzip.compress(b"1\n2\n", mtime=0), mtime=0),
            "an archive or a compressed file",
        ),
    ],
)
def test_other_kinds_of_file_are_named(path, content, what):
    said = refusal(path, content)
    assert f"looks like {what}" in said
    assert "read are: text" in said


def test_a_column_of_minus_one_is_no_universal_file(path):
    path.write_text("".join(f"{value:6d}\n" for value in [-1, 2, 5, -7, 3] * 10))
    assert read_recording(path, 100.0).samples.shape == (1, 50)


def test_damaged_compression(path):
    packed = gzip.compress((HEAD + BODY).encode())
    assert "damaged (Compressed file ended before" in refusal(path, packed[:-30])
    damaged = bytearray(packed)
    damaged[400] ^= 255
    assert "the compressed file is damaged" in refusal(path, bytes(damaged))


def test_a_line_without_end(path, monkeypatch):
    monkeypatch.setattr("gearmon.signals.reading.text._LONGEST_LINE", 1000)
    monkeypatch.setattr("gearmon.signals.reading.text._HEAD_BYTES", 100)
    assert "line 2: over" in refusal(path, HEAD + "1" * 5000)


def test_missing_files(tmp_path):
    (tmp_path / "healthy_1.csv").write_text(HEAD + BODY)
    with pytest.raises(RecordingError, match=r"no such file; did you mean .*healthy_1\.csv\?"):
        read_recording(tmp_path / "healty_1.csv")
    with pytest.raises(RecordingError, match=r"no such file, nor a folder"):
        read_recording(tmp_path / "nowhere" / "x.csv")
    with pytest.raises(RecordingError, match=r"is a folder; name a recording in it"):
        read_recording(tmp_path)


def test_a_pipe_is_read_once(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_text, args=(HEAD + BODY,))
    writer.start()
    recording = read_recording(pipe, 1000.0)
    writer.join()
    assert recording.samples.shape == (3, 300)


def test_a_slow_channel_with_gaps_is_left_out(path):
    rows = [f"{line.strip()},{k if k % 10 == 0 else ''}\n" for k, line in enumerate(LINES)]
    path.write_text("a,b,c,torque\n" + "".join(rows))
    recording = read_recording(path, 1000.0)
    assert recording.channel_names == ("a", "b", "c")
    assert "column 4 ('torque') lacks a usable number in 270 of 300 rows" in recording.notes[0]


def test_a_gap_is_refused_where_that_channel_is_wanted_only(path):
    path.write_text(with_line(150, "1,nan,3\n"))
    assert read_recording(path, 1000.0, channels=["a", "c"]).samples.shape == (2, 300)
    with pytest.raises(RecordingError, match="line 152, column 2"):
        read_recording(path, 1000.0, channels="a", tacho="b")


def test_numbers_above_the_names_of_columns_are_none_of_the_samples(path):
    path.write_text(f"2026,51200\n7\n{HEAD}{BODY}")
    assert read_recording(path, 1000.0).samples.shape == (3, len(LINES))
    assert "line 3: 2 numbers where the rows below have 3" in refusal(path, f"7\n{HEAD}1,2\n{BODY}")
