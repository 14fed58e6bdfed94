"""Writing a simulated recording as people get recordings: a CSV, and the truth beside it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError
from gearmon.files import replacing, write_atomically
from gearmon.simulation.recorder import SimulatedRecording

#: Rows that are formatted at a time.
ROWS_AT_A_TIME = 20_000


def write_simulation(
    recording: SimulatedRecording, path: str | Path, *, with_time: bool = True
) -> tuple[Path, Path]:
    """Write a simulated recording as CSV and its truth as JSON beside it.

    Parameters
    ----------
    recording : SimulatedRecording
    path : str or Path
        Of the CSV, ending in ``.csv``; the truth gets the same name with ``.json``.
    with_time : bool
        Whether the first column is the time. Without it whoever reads the file must be told the
        sampling rate.

    Returns
    -------
    (Path, Path)
        The CSV and the JSON file.

    Raises
    ------
    ArgumentError
        If the name does not end in ``.csv`` or the file cannot be written.

    Notes
    -----
    The header holds names and units, ``a1 (m/s2)``. Values have six significant digits, times
    nine decimals.
    """
    target = Path(path)
    if target.suffix.lower() != ".csv":
        raise ArgumentError(f"{target}: the name of a simulated recording must end in .csv")
    truth = target.with_suffix(".json")
    with replacing(target) as temporary:
        _write_csv(recording, temporary, with_time)
    write_atomically(truth, json.dumps(recording.truth, indent=1, ensure_ascii=False) + "\n")
    return target, truth


def _write_csv(recording: SimulatedRecording, path: Path, with_time: bool) -> None:
    columns = zip(recording.channel_names, recording.units, strict=True)
    header = [f"{name} ({unit})" for name, unit in columns]
    form = ["%.6g"] * len(header)
    if with_time:
        header, form = ["time (s)", *header], ["%.9f", *form]
    line = ",".join(form) + "\n"
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(",".join(header) + "\n")
        for start in range(0, recording.samples.shape[1], ROWS_AT_A_TIME):
            rows = _rows(recording, start, with_time)
            # one format for many rows is several times as fast as one for each
            file.write(line * len(rows) % tuple(rows.ravel().tolist()))


def _rows(recording: SimulatedRecording, start: int, with_time: bool) -> NDArray[np.float64]:
    part = recording.samples[:, start : start + ROWS_AT_A_TIME].T
    if not with_time:
        return part
    times = np.arange(start, start + len(part)) / recording.sampling_rate_hz
    return np.column_stack([times, part])
