"""Lines of a recording that no gear explains, as value objects.

Such lines come from bearings, the mains, loose parts, other machines. `gearmon.signatures.
foreign_search` finds them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ForeignLine:
    """A line that no gear explains.

    Parameters
    ----------
    kind : {"spectrum", "envelope"}
        Where it stands: in the spectrum, or in that of the squared envelope.
    order : float
        Its mean place [cycles a turn of shaft 1].
    frequency_hz : float
        The same [Hz].
    locked : {"shaft", "time", "either"}
        Whether it follows the speed, stays at its frequency, or the speed is too even to tell.
    level_db : tuple of float
        Level in each channel [dB re 1 unit^2, peak amplitude; of an envelope: dB re 1].
    over_noise_db : tuple of float
        Power over the mean of the noise about it, each channel [dB].
    low_order, high_order : float
        Orders that it sweeps while the speed wanders.
    """

    kind: str
    order: float
    frequency_hz: float
    locked: str
    level_db: tuple[float, ...]
    over_noise_db: tuple[float, ...]
    low_order: float
    high_order: float


@dataclass(frozen=True, kw_only=True, eq=False)
class NoiseGrid:
    """What a spectrum could have shown: its noise, resolution and reach.

    Parameters
    ----------
    kind : {"spectrum", "envelope"}
        Which spectrum.
    width : float
        One over the turns in a piece [orders].
    top : float
        Highest order.
    pieces : int
        Pieces whose powers were averaged.
    least_db : float
        Power over noise from which lines were listed [dB].
    looked_at : float
        Independent values, all channels.
    noise_db : ndarray of float, shape (channels, bands)
        Mean noise power of a bin in equal bands from 0 to `top` [dB, as the levels].
    hidden_db : ndarray of float32, shape (channels, cells)
        Level up to which a line about a far stronger one is taken for a part of that and not
        listed, in equal cells from 0 to `top` [dB].
    """

    kind: str
    width: float
    top: float
    pieces: int
    least_db: float
    looked_at: float
    noise_db: FloatArray
    hidden_db: NDArray[np.float32]

    def unseen_at(self, order: float) -> FloatArray:
        """Level up to which a line at an order would not be listed, shape (channels,) [dB]."""
        cells = self.hidden_db.shape[-1]
        cell = min(int(order * cells / self.top), cells - 1)
        return np.maximum(self.noise_at(order) + self.least_db, self.hidden_db[:, cell])

    def noise_at(self, order: float) -> FloatArray:
        """Noise about an order, shape (channels,) [dB]."""
        bands = self.noise_db.shape[-1]
        middles = (np.arange(bands) + 0.5) * self.top / bands
        return np.array([np.interp(order, middles, row) for row in self.noise_db])


@dataclass(frozen=True, kw_only=True, eq=False)
class ForeignLines:
    """The foreign lines of one recording and what else could have been seen.

    Parameters
    ----------
    lines : tuple of ForeignLine
        Strongest over the noise first.
    grids : tuple of NoiseGrid
        Of the spectrum and of the envelope.
    speed_hz : float
        Mean speed of shaft 1 [Hz].
    cell_hz : float
        Width of the cells of `in_time_db` [Hz].
    in_time_db : ndarray of float32, shape (channels, cells)
        Highest power in the spectrum against time, gears included, in cells from 0 Hz on: no line
        of the mains was stronger, even where a gear's line hid it [dB].
    """

    lines: tuple[ForeignLine, ...]
    grids: tuple[NoiseGrid, ...]
    speed_hz: float
    cell_hz: float
    in_time_db: NDArray[np.float32]

    def __iter__(self) -> Iterator[ForeignLine]:
        """Go through the lines."""
        return iter(self.lines)

    def __len__(self) -> int:
        """Return the number of lines."""
        return len(self.lines)

    def grid(self, kind: str) -> NoiseGrid:
        """Return the grid of the spectrum or of the envelope."""
        return next(grid for grid in self.grids if grid.kind == kind)

    def highest_in_time(self, low_hz: float, high_hz: float) -> FloatArray | None:
        """Highest power in time between two frequencies [dB], a channel; None if not known."""
        first, last = int(low_hz / self.cell_hz), int(high_hz / self.cell_hz)
        if last >= self.in_time_db.shape[-1]:
            return None
        return np.asarray(self.in_time_db[:, first : last + 1].max(axis=-1))


def contaminated(
    orders: FloatArray, lines: Iterable[ForeignLine], resolution: float
) -> NDArray[np.bool_]:
    """Tell which orders a foreign line disturbs.

    Parameters
    ----------
    orders : ndarray of float
        Orders that are to be measured.
    lines : iterable of ForeignLine
        Lines; those of the envelope disturb nothing and are passed over.
    resolution : float
        Distance at which a line still disturbs [orders]: twice one over the length of a Hann
        block for single blocks, twice one over the recording for its synchronous mean.

    Returns
    -------
    ndarray of bool
        Like `orders`.
    """
    mask = np.zeros(np.shape(orders), dtype=bool)
    for line in lines:
        if line.kind == "spectrum":
            mask |= (orders > line.low_order - resolution) & (orders < line.high_order + resolution)
    return mask


def taken(lines: ForeignLines, rows: Sequence[int]) -> ForeignLines:
    """Keep some channels of the lines only.

    Parameters
    ----------
    lines : ForeignLines
        Lines of all channels.
    rows : sequence of int
        Channels to keep, in their new order.

    Returns
    -------
    ForeignLines
    """
    kept = tuple(
        replace(
            line,
            level_db=tuple(line.level_db[row] for row in rows),
            over_noise_db=tuple(line.over_noise_db[row] for row in rows),
        )
        for line in lines
    )
    own = list(rows)
    grids = tuple(
        replace(grid, noise_db=grid.noise_db[own], hidden_db=grid.hidden_db[own])
        for grid in lines.grids
    )
    return replace(lines, lines=kept, grids=grids, in_time_db=lines.in_time_db[own])
