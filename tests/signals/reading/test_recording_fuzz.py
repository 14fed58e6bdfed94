"""Damaged files: the same numbers as the slow reader's, or one clear error; never anything else."""

from __future__ import annotations

import random

import pytest
from reference.damaged_tables import alike, damaged, encoded, mixed_up, some_table
from reference.slow_csv import NotATableError, read_slowly

from gearmon.errors import RecordingError
from gearmon.signals.reading import text
from gearmon.signals.reading.channels import Wanted
from gearmon.signals.reading.formats import identify
from gearmon.signals.reading.text import Source, open_source, read_table
from gearmon.signals.recording import read_recording


@pytest.mark.parametrize(
    ("block_bytes", "careful"), [(37, True), (200, False), (1024 * 1024, False)]
)
def test_damaged_files_give_the_slow_readers_numbers_or_an_error(
    block_bytes, careful, tmp_path, monkeypatch
):
    monkeypatch.setattr(Source.blocks, "__defaults__", (block_bytes,))
    if careful:
        monkeypatch.setattr(text, "parse_rows", lambda *_, **__: None)
    path, read, messages = tmp_path / "f.csv", 0, []
    for seed in range(300):
        rng = random.Random(seed)
        data, plain = encoded(damaged(mixed_up(some_table(rng), rng), rng), rng)
        if len(data) > 20_000 and block_bytes < 100:
            continue  # a long line in small pieces takes long, and says nothing more
        path.write_bytes(data)
        try:
            source = open_source(path)
            if identify(source):
                continue
            rows = read_table(source, Wanted()).values.T.tolist()
        except RecordingError as error:
            messages.append(str(error))
            continue
        try:
            expected = read_slowly(plain)
        except NotATableError as error:
            pytest.fail(f"seed {seed}: read, but the slow reader refuses: {error}")
        read += 1
        assert len(rows) == len(expected), seed
        for row, slow in zip(rows, expected, strict=True):
            assert all(map(alike, row, slow)), seed
    assert read > 60
    assert not any("\n" in message or len(message) > 600 for message in messages)


def test_a_cut_last_number_is_told_below_a_header_too(tmp_path):
    # lines above the rows end otherwise than rows do, and say nothing about them
    path = tmp_path / "cut.csv"
    path.write_text("DATA\na\n[g]\n" + "".join(f"{k / 7:.6f}\n" for k in range(60)) + "5.24806")
    with pytest.raises(RecordingError, match="line 64: the file is cut off"):
        read_table(open_source(path), Wanted())


def test_damaged_files_cause_no_other_exception(tmp_path):
    path = tmp_path / "damaged.csv"
    messages = []
    for seed in range(200):
        rng = random.Random(seed)
        data = damaged(some_table(rng), rng)
        path.write_bytes(rng.choice([data, data.decode("latin-1").encode("utf-16")]))
        try:
            recording = read_recording(path, sampling_rate_hz=rng.choice([None, 1000.0]))
        except RecordingError as error:
            messages.append(str(error))
        else:
            assert recording.samples.shape[1] >= 2
    assert all(message.startswith(str(path)) and "\n" not in message for message in messages)


def test_a_zero_byte_does_not_part_a_quoted_field(tmp_path):
    # five fields, three of them numbers: a damaged row, not a line of six names
    path = tmp_path / "zero.txt"
    path.write_bytes(b'a b c d\n"1.5" "2.5" . "4.\x004" "5.5"\n"1" "2" "3" "4"\n"5" "6" "7" "9"\n')
    with pytest.raises(RecordingError, match="line 2"):
        read_table(open_source(path), Wanted())
