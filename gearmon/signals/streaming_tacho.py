"""Pulses of a tacho channel in a recording of any size, in two passes and bounded memory."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import RecordingError
from gearmon.signals.streaming import BLOCK, RecordingStream
from gearmon.signals.tacho import TachoPulses, _edges, repaired_pulses

FloatArray = NDArray[np.float64]

# As in `tacho`: where the level is not judged.
_HYSTERESIS = 0.1
_FEWEST = 4


def stream_pulses(
    stream: RecordingStream,
    channel: int | None = None,
    *,
    per_turn: int | None = None,
    samples: int = BLOCK,
    progress: Callable[[float], object] | None = None,
) -> TachoPulses:
    """Find the rising edges of the tacho channel of a stream.

    The first pass finds its extremes, the second the edges, as `gearmon.signals.tacho.find_pulses`
    finds them in a waveform that is in memory.

    Parameters
    ----------
    stream : RecordingStream
        The recording.
    channel : int, optional
        Index of the tacho channel; the only one of that kind if not given.
    per_turn : int, optional
        Pulses a turn, if known: the spacing of several is learned, so that uneven ones are left
        alone.
    samples : int > 0
        Samples of each channel in memory at a time.
    progress : callable, optional
        Called with the share done, from 0 to 1.

    Returns
    -------
    TachoPulses

    Raises
    ------
    RecordingError
        If there is no tacho channel or several, there are fewer than four pulses, or more than 2 %
        have to be repaired.
    """
    row = _tacho_row(stream) if channel is None else channel
    told = progress or _untold
    low, high = np.inf, -np.inf
    for first, block in stream.blocks(samples):
        low, high = min(low, block[row].min()), max(high, block[row].max())
        told(0.5 * (first + block.shape[1]) / stream.shape[1])
    middle, margin = 0.5 * (low + high), _HYSTERESIS * (high - low)
    found: list[FloatArray] = []
    kept = np.empty(0)
    for first, block in stream.blocks(samples):
        # from the last sample whose level is certain on: an edge may be under way
        wave = np.concatenate([kept, block[row]])
        found.append(_edges(wave, middle, margin) + (first - len(kept)))
        certain = np.flatnonzero(np.abs(wave - middle) > margin)
        kept = wave[certain[-1] :] if len(certain) else wave
        told(0.5 + 0.5 * (first + block.shape[1]) / stream.shape[1])
    raw = np.concatenate(found) / stream.sampling_rate_hz
    if len(raw) < _FEWEST:
        raise RecordingError(
            f"{stream.origin}: {len(raw)} pulses found in the tacho channel between {low:g} and "
            f"{high:g}; at least {_FEWEST} are needed. Name the right channel with --tacho, or "
            "leave the tacho out"
        )
    return repaired_pulses(raw, per_turn, f"{stream.origin}: tacho channel")


def _untold(share: float) -> None:
    """Tell nobody."""


def _tacho_row(stream: RecordingStream) -> int:
    rows = [row for row, kind in enumerate(stream.channel_kinds) if kind == "tacho"]
    if len(rows) != 1:
        raise RecordingError(
            f"{stream.origin}: {len(rows)} tacho channels; name the one to use with --tacho"
        )
    return rows[0]
