"""The benchmark of mesh stiffness runs and says what it timed."""

from __future__ import annotations

import json

from gearmon.benchmark.stiffness import time_stiffness


def test_rows():
    rows = time_stiffness(repeats=1)
    assert [row.positions for row in rows] == [1000, 200, 5200, 1000]
    assert all(row.median_s > 0 and row.fastest_s <= row.median_s for row in rows)
    assert [row.times_healthy is not None for row in rows] == [False, False, True, False]
    json.dumps([row.to_dict() for row in rows])
