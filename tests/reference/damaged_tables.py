"""Tables of numbers in every dialect, and what may happen to them on their way."""

from __future__ import annotations

import math
import random

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


HUGE = (
    b"9" * 400, b"0." + b"0" * 400 + b"1", b"1e" + b"9" * 50, b"x" * 5000, b"1" * 9000,
    b"-" * 1000, b'"' + b"a" * 3000, b"1e400", b"1e-400", b"0x1F", b"1_000", b"1,000.5", b"1e5e5",
    b"+-1", b".", b"1.e3", b"1d3", b"infinity", b"1.#QNAN", b"0.000000000000000000000000000123",
)  # fmt: skip


def mixed_up(data: bytes, rng: random.Random) -> bytes:
    """Return the table with a huge or odd field, a line of another separator, or lines moved."""
    lines = data.split(b"\n")
    index = rng.randrange(len(lines))
    match rng.randrange(6):
        case 0:
            place = rng.randrange(len(data) + 1)
            return data[:place] + rng.choice(HUGE) + data[place:]
        case 1:
            one, other = rng.sample([b",", b";", b"\t", b" "], 2)
            lines[index] = lines[index].replace(one, other)
        case 2:
            lines.insert(index, rng.choice(lines))
        case 3:
            other_index = rng.randrange(len(lines))
            lines[index], lines[other_index] = lines[other_index], lines[index]
        case 4:
            fields = lines[index].split(b",")
            fields[rng.randrange(len(fields))] = rng.choice(HUGE)
            lines[index] = rng.choice([b",", b";"]).join(fields)
        case 5:
            return data + data[: rng.randrange(len(data) + 1)]
    return b"\n".join(lines)


def encoded(data: bytes, rng: random.Random) -> tuple[bytes, bytes]:
    """Return the table in some encoding, and in UTF-8 without a mark."""
    if not data.isascii() or b"\0" in data:
        return data, data
    text = data.decode()
    match rng.randrange(8):
        case 0:
            return text.encode("utf-8-sig"), data
        case 1:
            return text.encode("utf-16"), data
        case 2:
            return b"\xfe\xff" + text.encode("utf-16-be"), data
        case 3:
            return text.encode("utf-32"), data
        case 4:
            remark = "# \u00b5\u00e4\n" + text
            return remark.encode("latin-1"), remark.encode()
    return data, data


def alike(first: float, second: float) -> bool:
    if not math.isfinite(first) or not math.isfinite(second):
        return math.isfinite(first) == math.isfinite(second)
    return first == second and math.copysign(1, first) == math.copysign(1, second)
