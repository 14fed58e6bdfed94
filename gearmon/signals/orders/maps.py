"""Order maps: calibrated amplitude against order, along a recording's time or speed.

Half-overlapped windowed blocks of equal angle are transformed one by one; their powers are averaged
in rows of equal time or equal speed. A line locked to a shaft stands upright in the map whatever
the speed does; a resonance or an electrical line slants.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearmon.errors import ArgumentError, check_positive
from gearmon.result import Result
from gearmon.signals.angle import AngleTrack, check_track
from gearmon.signals.array_types import FloatArray, IntArray
from gearmon.signals.orders.resampling import READ_UP_TO, AngleGrid, angle_blocks
from gearmon.signals.spectra.spectrum import amplitude_spectrum
from gearmon.signals.transforms import fast_length

#: Most rows of a map along time, and along speed.
TIME_ROWS, SPEED_ROWS = 200, 60
# Rows of speed are no finer than this share of the mean, and hold some blocks each.
_FINEST_SPEED, _BLOCKS_A_ROW = 1e-3, 3


@dataclass(frozen=True, kw_only=True, eq=False)
class OrderMap(Result):
    """Amplitude against order of a shaft, row by row.

    Parameters
    ----------
    against : {"time", "speed"}
        What the rows run along.
    shaft_order : float
        Turns of the shaft a turn of shaft 1.
    order : ndarray of float, shape (bins,)
        Cycles a turn of the shaft, from 0.
    amplitude : ndarray of float, shape (rows, channels, bins)
        Peak amplitude in the units of the channels, root mean square over the row's blocks. A
        steady sine on a bin reads its amplitude.
    time_s, speed_hz : ndarray of float, shape (rows,)
        Mean over the blocks of each row: middle of the block [s], speed of the shaft [Hz].
    low, high : ndarray of float, shape (rows,)
        From where to where each row reaches, in s or Hz by `against`; ascending.
    blocks : ndarray of int, shape (rows,)
        Blocks in each row, at least 1.
    block_turns : float
        Length of a block [turns of the shaft].
    resolution : float
        Noise bandwidth of a bin [orders of the shaft].
    """

    against: str
    shaft_order: float
    order: FloatArray
    amplitude: FloatArray
    time_s: FloatArray
    speed_hz: FloatArray
    low: FloatArray
    high: FloatArray
    blocks: IntArray
    block_turns: float
    resolution: float

    @property
    def mean(self) -> FloatArray:
        """Order spectrum: root mean square over all blocks, shape (channels, bins)."""
        power = np.einsum("rcb,r->cb", self.amplitude**2, self.blocks.astype(float))
        return np.asarray(np.sqrt(power / self.blocks.sum()))


def order_map(
    samples: FloatArray,
    sampling_rate_hz: float,
    track: AngleTrack,
    *,
    shaft_order: float = 1.0,
    top: float | None = None,
    block_turns: float = 40.0,
    window_name: str = "hann",
    against: str = "time",
    rows: int | None = None,
) -> OrderMap:
    """Compute an order map.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        The signals, in any unit.
    sampling_rate_hz : float
        Sampling rate [Hz].
    track : AngleTrack
        Angle of shaft 1 against time.
    shaft_order : float > 0
        Turns a turn of shaft 1 of the shaft whose orders are counted.
    top : float > 0, optional
        Highest order of that shaft; by default, and at most, 0.45 of the sampling rate at the
        highest speed.
    block_turns : float > 0
        Length of a block [turns of the shaft]; cut to a quarter of the recording.
    window_name : {"hann", "flat-top", "blackman-harris", "rectangular"}
    against : {"time", "speed"}
        Rows of equal time, or of equal speed (a speed-order waterfall).
    rows : int >= 1, optional
        At most so many; 200 along time; 60 along speed, and a third of the blocks.

    Returns
    -------
    OrderMap
        Rows of speed in which the recording never was are left out.

    Raises
    ------
    ArgumentError
        If an argument is out of its range or the recording is too short.

    Examples
    --------
    >>> vibration = gearmon.read_recording(new).vibration()
    >>> found = gearmon.order_map(vibration.samples, 8000.0, analysis.signature.track, top=100.0)
    >>> found.amplitude.shape, found.order[:3]
    ((6, 2, 1874), array([0.        , 0.05338542, 0.10677083]))
    """
    check_track(track)
    if against not in ("time", "speed"):
        raise ArgumentError(f"against={against!r} must be one of time, speed")
    most = rows if rows is not None else TIME_ROWS if against == "time" else SPEED_ROWS
    if most < 1:
        raise ArgumentError(f"rows={rows} must be at least 1")
    ratio = check_positive("shaft_order", shaft_order)
    wanted = check_positive("block_turns", block_turns) / ratio
    limit = READ_UP_TO * sampling_rate_hz / float(track.speed_hz.max())
    highest = limit if top is None else top * ratio
    if not 0 < highest <= limit * (1 + 1e-9):
        raise ArgumentError(f"top={top} orders must lie in (0, {limit / ratio:.4g}]")
    grid = AngleGrid.of(samples.shape[-1], sampling_rate_hz, track, highest)
    turns = min(wanted, grid.count / grid.per_turn / 4)
    block = min(grid.count, fast_length(max(16, int(turns * grid.per_turn))))
    # of every block its middle [s] and the mean speed of shaft 1 within it [Hz]
    length = block / grid.per_turn
    starts = np.arange(0, grid.count - block + 1, max(1, block // 2))
    begin = grid.first_turn + starts / grid.per_turn
    ends = track.time_at(begin), track.time_at(begin + length)
    middle, speed = 0.5 * (ends[0] + ends[1]), length / (ends[1] - ends[0])
    row, low, high = _rows(middle if against == "time" else ratio * speed, against, most)
    bins = int(highest * block / grid.per_turn) + 1
    powers = np.zeros((len(low), len(samples), bins))
    seen = np.bincount(row, minlength=len(low))
    resolution = 0.0
    for number, (_, part) in enumerate(angle_blocks(samples, sampling_rate_hz, track, grid, block)):
        found = amplitude_spectrum(
            part - part.mean(axis=-1, keepdims=True),
            float(grid.per_turn),
            window_name=window_name,
            length=block,
        )
        powers[row[number]] += found.values[:, :bins] ** 2
        resolution = found.resolution_hz
    kept = seen > 0
    counts = seen[kept].astype(float)
    return OrderMap(
        against=against,
        shaft_order=ratio,
        order=np.arange(float(bins)) * float(grid.per_turn / block / ratio),
        amplitude=np.sqrt(powers[kept] / counts[:, None, None]),
        time_s=np.bincount(row, middle, len(low))[kept] / counts,
        speed_hz=ratio * np.bincount(row, speed, len(low))[kept] / counts,
        low=low[kept],
        high=high[kept],
        blocks=seen[kept],
        block_turns=block / grid.per_turn * ratio,
        resolution=resolution / ratio,
    )


def _rows(place: FloatArray, against: str, most: int) -> tuple[IntArray, FloatArray, FloatArray]:
    """Row of each block by its place, and where the rows begin and end."""
    low, high = float(place.min()), float(place.max())
    if against == "time":
        # blocks follow one another: a row takes as many as there are, each within its own bounds
        together = -(-len(place) // most)
        row = np.arange(len(place)) // together
        step = (high - low) / max(1, len(place) - 1) if high > low else 1.0
        edges: FloatArray = low - step / 2 + step * together * np.arange(row[-1] + 2.0)
        edges[-1] = high + step / 2
        return row, edges[:-1], edges[1:]
    least = _FINEST_SPEED * float(place.mean())
    count = int(max(1, min(most, len(place) // _BLOCKS_A_ROW, np.ceil((high - low) / least))))
    width = max((high - low) / count, least)
    begin = 0.5 * (low + high) - 0.5 * count * width
    row = np.clip(((place - begin) / width).astype(np.int64), 0, count - 1)
    edges = begin + width * np.arange(count + 1.0)
    return row, edges[:-1], edges[1:]
