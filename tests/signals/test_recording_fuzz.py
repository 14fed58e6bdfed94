"""Damaged files: the same numbers as the slow reader's, or one clear error; never anything else."""

from __future__ import annotations

import math
import random

import pytest
from reference.slow_csv import NotATableError, read_slowly

from gearmon.errors import RecordingError
from gearmon.signals.reading.formats import identify
from gearmon.signals.reading.source import Source
from gearmon.signals.reading.table import read_table
from gearmon.signals.recording import read_recording

ANYTHING = b'0123456789.,;-+eE\n\r\t "#%x\0n'


def some_table(rng: random.Random) -> bytes:
    columns = rng.choice([1, 2, 3, 4])
    separator = rng.choice([",", ";", "\t", " ", "  ", ", ", "; "]) if columns > 1 else ""
    decimal = rng.choice(".,") if separator.strip() != "," else "."
    shown = rng.choice(["%.6f", "%.4g", "%.3e", "%d", "%.17g", "%.1f"])
    trailing = rng.choice(["", "", "", separator.strip()])
    end = rng.choice(["\n", "\n", "\r\n", "\r"])
    quote = '"' if rng.random() < 0.1 and columns > 1 else ""
    text = rng.choice(["", "", f"Made by: me{end}x = 5{end}", f"DATA{end}", f"# remark{end}"])
    if rng.random() < 0.5:
        text += (separator or ",").join("abcd"[:columns]) + trailing + end
        text += rng.choice(["", (separator or ",").join(["[g]"] * columns) + end])
    timed = columns > 1 and rng.random() < 0.4
    for row in range(rng.choice([3, 5, 12, 60])):
        fields = [shown % rng.gauss(0, 3) for _ in range(columns)]
        fields[0] = f"{row / 1000:.4f}" if timed else fields[0]
        fields = [quote + field.replace(".", decimal) + quote for field in fields]
        text += separator.join(fields) + trailing + end
    return (text[: -len(end)] if rng.random() < 0.3 else text).encode()


def damaged(data: bytes, rng: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice([0, 1, 1, 1, 2, 3, 6])):
        if not changed:
            break
        place = rng.randrange(len(changed))
        end = min(len(changed), place + rng.randrange(1, 30))
        other = rng.randrange(len(changed))
        match rng.randrange(7):
            case 0:
                del changed[place]
            case 1:
                changed[place:place] = changed[place:end]
            case 2:
                changed[place], changed[other] = changed[other], changed[place]
            case 3:
                changed[place] = rng.choice(ANYTHING)
            case 4:
                del changed[place:end]
            case 5:
                changed.insert(place, rng.choice(ANYTHING))
            case 6:
                del changed[place:]
    return bytes(changed)


def alike(first: float, second: float) -> bool:
    if not math.isfinite(first) or not math.isfinite(second):
        return math.isfinite(first) == math.isfinite(second)
    return first == second and math.copysign(1, first) == math.copysign(1, second)


@pytest.mark.parametrize("block_bytes", [37, 256 * 1024])
def test_damaged_files_give_the_slow_readers_numbers_or_an_error(block_bytes, monkeypatch):
    monkeypatch.setattr(Source.blocks, "__defaults__", (block_bytes,))
    read, messages = 0, []
    for seed in range(400):
        rng = random.Random(seed)
        data = damaged(some_table(rng), rng)
        source = Source(path="f.csv", content=data)
        try:
            if identify(source).key != "text":
                continue
            rows = read_table(source).values.T.tolist()
        except RecordingError as error:
            messages.append(str(error))
            continue
        try:
            expected = read_slowly(data)
        except NotATableError as error:
            pytest.fail(f"seed {seed}: read, but the slow reader refuses: {error}")
        read += 1
        assert len(rows) == len(expected), seed
        for row, slow in zip(rows, expected, strict=True):
            assert all(map(alike, row, slow)), seed
    assert read > 100
    assert not any("\n" in message for message in messages)


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
