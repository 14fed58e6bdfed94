"""Samples that no machine made: what a cable, a connector or a recorder put into a recording.

A channel that stands still, single samples far above all others, a dropout, a cut cable, a range
that was changed: each is named with its time and channel. Single samples are bridged; short
stretches are left out, of all channels; a channel that is bad for long is left out, and a recording
without a sound one refused. Nothing else is touched.

Averages over turns leave out the turns about such a stretch, where a tachometer tells the angle
across it (`inspected`); all else is made of the longest piece between them (`sound_part`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from gearmon.arrays import FloatArray, runs_where
from gearmon.errors import RecordingError
from gearmon.signals.reading import find_defect
from gearmon.signals.recording import Recording

# What the limits do was tried on 180 recordings (2, 5 or 10 s) of 60 drawn machines of
# `gearmon.benchmark` (sound, with a cracked tooth, with a bad bearing). Left as they were, rounded
# to 16, 12, 8 and 6 bits, at a load that doubled at once, in run-ups and shut-downs, none was
# touched; of 180 with one knock of 15 times their peak one was, whose knock had died away within
# 15 samples. Nor is anything found in 15 real recordings of three rigs. Of what was put in, beside
# each limit stands what was found of 180; what is missed is too small to matter to the averages.
_CHUNK = 1 << 20
# Samples that tell the middle of a channel: to less than a hundredth of its spread.
_TOLD_BY = 1 << 15
# A run of equal samples is a channel that stands still if it is so many times as long as all but
# one in a thousand of the others: runs of rounded noise grow with the logarithm of their number.
# Sound: 3 times at most. 12 bits that stood still for 20 samples: 44, for 50 and more: 180.
_RUN_TIMES, _RUN_SHARE, _LONGEST_RUN = 10, 0.999, 4096
# A single sample, or up to three, above the rest so many times, whose neighbours ring no more than
# this share: an impact rings through the anti-aliasing filter. More of them are the signal itself.
# Sound: the largest four samples within a factor of 1.3. Of 3 peaks: 0, of 5 and more: 180.
_OVER_REST, _SPIKE_SAMPLES, _RINGS, _REACH, _MOST_SPIKES = 4.0, 3, 0.1, 8, 20
# Share of samples that stay at an extreme, as that which readers of files refuse.
_CLIPPED_SHARE = 1e-3
# Frames whose levels tell a step or a dropout: their number, and their fewest samples. Silence of
# 30 to 60 dB over 0.5 % of a recording: about 100, over 1 %: 179 or 180.
_FRAMES, _FRAME_SAMPLES, _FEWEST_FRAMES = 200, 256, 12
_SPREAD = np.array([0.84, 0.50, 0.16])
# A step at once that no load makes [dB], so many times the scatter to either side of it; and how
# far below its median level a channel is silent [dB]. Sound: steps of 9 and levels of -9 dB at
# most. A range changed by 6 dB: 0, 10 dB: 53, 12 dB: 166, 20 dB: 175, 40 dB: 180.
_STEP_DB, _STEP_TIMES, _SILENT_DB = 10.0, 6.0, 25.0
# Pieces of a frame, and the share of a step that must be seen across five of them: run through a
# resonance between 0.35 and 1 of their speed, 4 of 11 lumped machines rise 10 to 21 dB in 0.4 s (of
# their 279 recordings 24 were taken for a range that was changed, one is).
_PIECES, _SUDDEN = 8, 0.7
# A machine that begins to work raises channels at one moment, each as it hears it; an amplifier or
# a range all of them by the same: within 1.1 dB in four seconds of a load that wanders, where gears
# of a lumped model that begin to rattle differ by 2.
_ALIKE_DB = 1.5
# Share of a channel that may be bad, and of the recording that must be left.
_MOST_BAD, _LEAST_LEFT = 0.2, 0.3
# How notes end.
_TOLD = "not taken into account", "the channel is left out"


class BadStretch(NamedTuple):
    """A stretch of one channel that no machine made.

    Parameters
    ----------
    start, stop : int
        First sample, and the one behind the last.
    what : str
        What is wrong, as the rest of a sentence that begins with the channel.
    bridged : bool
        Whether so few samples are concerned that a straight line does in their place.
    step_db : float
        By how much the level is higher behind it, or behind its start, at once [dB]; 0 if it is bad
        for another reason.
    of_machine : bool
        Whether the machine was in another state there: the sensor is sound.
    """

    start: int
    stop: int
    what: str
    bridged: bool = False
    step_db: float = 0.0
    of_machine: bool = False

    def told(self, rate: float) -> str:
        """Return when it is, and what is wrong."""
        if self.bridged:
            return f"at {self.start / rate:.4f} s {self.what}"
        return f"from {self.start / rate:.4g} to {self.stop / rate:.4g} s {self.what}"


def bad_stretches(values: FloatArray) -> list[BadStretch]:
    """Find what no machine made in one channel; of one that is clipped nothing else is asked.

    Parameters
    ----------
    values : ndarray of float, shape (n,)
        Finite samples.

    Returns
    -------
    list of BadStretch
        In the order of time.
    """
    # a channel that stays at an extreme; files are searched for it as they are read. One of one
    # value or two is silent, or no vibration at all
    defect = find_defect(values)
    if defect is not None and defect.fatal and defect.row >= 0:
        # a tone of whole samples a period has its extremes as often, but few values, and no extreme
        # twice in a row; of fast vibration that is cut off they are far apart as well
        again = values[1:][values[1:] == values[:-1]]
        at_it = np.isin(again, (values.min(), values.max())).sum()
        if at_it >= _CLIPPED_SHARE * len(values) or len(np.unique(values)) > 2 / _CLIPPED_SHARE:
            return [BadStretch(0, len(values), defect.text)]
    still = list(_standing_still(values))
    every = *still, *_spikes(values), *_level_changes(values, still)
    return sorted(every, key=lambda bad: bad.start)


def inspected(recording: Recording) -> Recording:
    """Return a recording with notes on what is not sound of it, and zeros in its place.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    Recording
        The same samples if nothing is wrong with its vibration channels; `left_out` says where the
        zeros are.

    Raises
    ------
    RecordingError
        If no vibration channel is sound.
    """
    if recording.left_out is not None:
        return recording
    samples, rate = recording.samples, recording.sampling_rate_hz
    vibrates = [kind == "vibration" for kind in recording.channel_kinds]
    notes, lost, mended = [], {}, []
    found = {row: bad_stretches(samples[row]) for row in np.flatnonzero(vibrates).tolist()}
    for row, own in _of_machine(found, samples.shape[1]).items():
        name = recording.channel_names[row]
        if not own:
            continue
        label = name if name.startswith("channel") else f"channel {name}"
        told = [f"{label} {bad.told(rate)}" for bad in own]
        spoilt = (bad for bad in own if not bad.bridged and not bad.of_machine)
        lasting = sum(bad.stop - bad.start for bad in spoilt)
        if lasting > _MOST_BAD * samples.shape[1]:
            lost[row] = told[0]
        else:
            mended += [(row, bad) for bad in own]
        more = f" (and {len(told) - 3} more such places)" if len(told) > 3 else ""
        notes.append(f"{'; '.join(told[:3])}{more}: {_TOLD[row in lost]}")
    if lost and len(lost) == sum(vibrates):
        raise RecordingError(
            f"{_where(recording)}{next(iter(lost.values()))}, and no channel is sound; check "
            "cable and sensor, and record again"
        )
    samples = samples.copy() if mended else samples
    for row, bad in sorted(mended, key=lambda one: not one[1].bridged):
        if bad.bridged:
            # a straight line from the sample before to the one behind
            beside = [k for k in (bad.start - 1, bad.stop) if 0 <= k < samples.shape[1]]
            straight = np.interp(range(bad.start, bad.stop), beside, samples[row, beside])
            samples[row, bad.start : bad.stop] = straight
        else:
            samples[vibrates, bad.start : bad.stop] = 0.0
    out = tuple(sorted((bad.start, bad.stop) for _, bad in mended if not bad.bridged))
    sound = _with(recording, notes, samples=samples, left_out=out)
    return sound.part([row for row in range(len(samples)) if row not in lost]) if lost else sound


def sound_piece(recording: Recording) -> tuple[int, int]:
    """Return first sample and end of the longest piece without zeros in place of bad samples.

    Parameters
    ----------
    recording : Recording
        As `inspected` returns it.
    """
    out = recording.left_out or ()
    begins = [0, *accumulate((end for _, end in out), max)]
    ends = [*(first for first, _ in out), recording.samples.shape[1]]
    return max(zip(begins, ends, strict=True), key=lambda piece: piece[1] - piece[0])


def sound_part(recording: Recording, least: float = _LEAST_LEFT) -> Recording:
    """Return the longest sound piece of a recording, with notes on what is not sound.

    Parameters
    ----------
    recording : Recording
    least : float, in [0, 1]
        Share of the recording that it must be.

    Returns
    -------
    Recording
        The same samples if nothing is wrong with its vibration channels.

    Raises
    ------
    RecordingError
        If no vibration channel is sound for long enough.
    """
    recording = inspected(recording)
    if not recording.left_out:
        return recording
    start, stop = sound_piece(recording)
    rate, duration_s = recording.sampling_rate_hz, recording.duration_s
    if (stop - start) / rate < least * duration_s:
        told = "; ".join(note for note in recording.notes if note.endswith(_TOLD))
        raise RecordingError(
            f"{_where(recording)}{told}; the longest sound piece is {(stop - start) / rate:.3g} of "
            f"{duration_s:.3g} s; check cables, and record again"
        )
    told = f"only {start / rate:.4g} to {stop / rate:.4g} s are looked at"
    return _with(recording, [told], samples=recording.samples[:, start:stop], left_out=())


def _with(recording: Recording, notes: Sequence[str], **changed: Any) -> Recording:
    """Return a recording with further notes and other samples, which are as finite as its own."""
    return replace(recording, notes=(*recording.notes, *notes), known_finite=True, **changed)


def _of_machine(found: dict[int, list[BadStretch]], samples: int) -> dict[int, list[BadStretch]]:
    """Tell a step of level that the machine makes: at one moment in all of several channels."""
    steps = {row: bad for row, own in found.items() for bad in own if bad.step_db}
    if len(steps) < max(2, len(found)):
        return found
    told = [(bad.start, bad.stop, abs(bad.step_db)) for bad in steps.values()]
    begin, end, size = np.ptp(told, axis=0)
    frames = 2 * max(_FRAME_SAMPLES, samples // _FRAMES)
    if max(begin, end) > frames or size < _ALIKE_DB or np.max(told, axis=0)[2] >= _SILENT_DB:
        return found
    changed = dict(found)
    for row, bad in steps.items():
        # as `_level_changes` has it: what is left out lies before the step, or behind it
        way = "quieter" if (bad.step_db > 0) == (bad.start == 0) else "louder"
        what = (
            f"is {abs(bad.step_db):.0f} dB {way}, as all are: the machine itself changed, as when "
            "a clutch engages"
        )
        told_so = bad._replace(what=what, of_machine=True)
        changed[row] = [told_so if own is bad else own for own in found[row]]
    return changed


def _where(recording: Recording) -> str:
    return f"{recording.origin}: " if recording.origin else ""


def _standing_still(values: FloatArray) -> Iterator[BadStretch]:
    """Find runs of equal samples that are far longer than rounding makes them."""
    runs = runs_where(values[1:] == values[:-1])
    runs[:, 1] += 1
    length = runs[:, 1] - runs[:, 0]
    counts = np.bincount(np.minimum(length, _LONGEST_RUN), minlength=2)
    counts[1] = len(values) - length.sum()
    usual = int(np.searchsorted(np.cumsum(counts), _RUN_SHARE * counts.sum()))
    for begin, end in runs[length > _RUN_TIMES * usual].tolist():
        # what stands at an extreme is clipped, which is judged as such
        if values.min() < values[begin] < values.max():
            what = f"stands still at {values[begin]:.4g} ({end - begin} equal samples)"
            yield BadStretch(begin, end, what)


def _spikes(values: FloatArray) -> Iterator[BadStretch]:
    """Find few samples far above all others, whose neighbours know nothing of them."""
    most = _MOST_SPIKES * _SPIKE_SAMPLES + 1
    if len(values) < most:
        return  # of so few samples, chance puts one at four times the others
    some = values[:: max(1, len(values) // _TOLD_BY)]
    middle = float(np.median(some))
    if not np.median(np.abs(some - middle)):
        return
    # places and sizes of the largest departures, as many as stretches can hold, and one; in pieces:
    # files are long
    place, size, count = np.zeros(0, dtype=np.int64), np.zeros(0), _SPIKE_SAMPLES * most
    for first in range(0, len(values), _CHUNK):
        part = np.abs(values[first : first + _CHUNK] - middle)
        largest = np.argpartition(part, max(0, len(part) - count))[-count:]
        place, size = np.append(place, first + largest), np.append(size, part[largest])
    order = np.argsort(-size)[:count]
    place, size = place[order], size[order]
    # those above the widest gap in size among them
    height = np.maximum(size[:most], np.finfo(float).tiny)
    high = np.sort(place[: 1 + int(np.argmax(height[:-1] / height[1:]))])
    edges = np.flatnonzero(np.diff(high) > _SPIKE_SAMPLES) + 1
    stretches = [(int(own[0]), int(own[-1]) + 1) for own in np.split(high, edges)]
    inside = np.any([(place >= start) & (place < stop) for start, stop in stretches], axis=0)
    if inside.all() or any(stop - start > _SPIKE_SAMPLES for start, stop in stretches):
        return
    rest = float(size[~inside].max())
    for start, stop in stretches:
        peak = float(np.abs(values[start:stop] - middle).max())
        beside = np.r_[values[max(0, start - _REACH) : start], values[stop : stop + _REACH]]
        rings = float(np.abs(beside - middle).max(initial=0.0))
        if peak > _OVER_REST * rest and rings < max(_RINGS * peak, 1.5 * rest):
            what = f"jumps to {peak / rest:.3g} times the largest other sample"
            yield BadStretch(start, stop, what, bridged=True)


def _level_changes(values: FloatArray, still: Sequence[BadStretch]) -> Iterator[BadStretch]:
    """Find stretches of another level that begin or end at once."""
    length = max(_FRAME_SAMPLES, len(values) // _FRAMES)
    count = len(values) // length
    if count < _FEWEST_FRAMES:
        return
    middle, spread = _middles(values, length)

    def framed(first: int, end: int, what: str) -> BadStretch:
        return BadStretch(max(0, first * length), min(end * length, len(values)), what)

    what = "goes over to another mean value at once, as by a connector or an amplifier"
    # by more than the samples spread
    at_once = _at_once(middle)
    least = max(float(np.median(spread)), _STEP_TIMES * _scatter(at_once))
    for begin, end in runs_where(np.abs(at_once) > least).tolist():
        yield framed(begin + 2, end + 4, what)
    level = 20 * np.log10(np.maximum(spread, _finest_step(values)))
    sound = np.ones(count, dtype=bool)
    for bad in still:
        sound[bad.start // length : bad.stop // length + 1] = False
    where = np.flatnonzero(sound)
    if len(where) < _FEWEST_FRAMES:
        return
    step = _step(level[where])
    if step is None:
        below = level - np.median(level[sound])
        silent = (below < -_SILENT_DB) & sound
        runs = runs_where(silent).tolist()
        # levels that come and go with the work have all values between
        if ((below < -0.5 * _SILENT_DB) & ~silent & sound).sum() <= 2 * len(runs):
            for first, end in runs:
                yield framed(first - 1, end + 1, "drops out: there is next to no signal")
        return
    first, change = step
    edge = int(where[first])
    # a speed that passes a resonance takes its time
    near, piece = values[max(0, edge - 4) * length : (edge + 2) * length], length // _PIECES
    quick = _at_once(20 * np.log10(np.maximum(_middles(near, piece)[1], _finest_step(values))))
    if np.max(np.sign(change) * quick) < _SUDDEN * abs(change):
        return
    before_is_bad = change > 0 if abs(change) >= _SILENT_DB else first < len(where) - first
    what = (
        f"is {abs(change):.0f} dB {'quieter' if (change > 0) == before_is_bad else 'louder'} "
        "than the rest from one moment to the next, as by a cable, a connector or a range"
    )
    # somewhere within the frame at which it was seen
    bad = framed(0, edge + 1, what) if before_is_bad else framed(edge - 1, count + 1, what)
    yield bad._replace(step_db=change)


def _middles(values: FloatArray, length: int) -> tuple[FloatArray, FloatArray]:
    """Middle of each frame, and the spread of half of its samples: a spike changes nothing."""
    frames = values[: len(values) // length * length].reshape(-1, length)
    some = np.sort(frames[:, :: 1 + length // 4096], axis=1)
    # percentiles by rank: twice as quick as between ranks
    high, middle, low = some[:, np.rint((some.shape[1] - 1) * _SPREAD).astype(int)].T
    return middle, high - low


def _finest_step(values: FloatArray) -> float:
    """Least difference between two samples: no recorder tells anything quieter."""
    steps = np.diff(np.unique(values[:: max(1, len(values) >> 16)]))
    return float(steps.min()) if len(steps) else 1.0


def _step(level: FloatArray) -> tuple[int, float] | None:
    """First frame behind the clearest step, and its height [dB]; None without one."""
    found = []
    at_once = _at_once(level)
    for first in (np.flatnonzero(np.abs(at_once) > _STEP_DB) + 4).tolist():
        before, after = level[: first - 1], level[first:]
        change = float(np.median(after) - np.median(before))
        clear = min(abs(change), float(np.sign(change) * at_once[first - 4]))
        if clear > max(_STEP_DB, _STEP_TIMES * max(_scatter(before), _scatter(after))):
            found.append((clear, first, change))
    return max(found, key=lambda one: one[0])[1:] if found else None


def _at_once(level: FloatArray) -> FloatArray:
    """Three frames behind against three before: the frame in which it happens is a bit of both."""
    middles = np.median(np.lib.stride_tricks.sliding_window_view(level, 3), axis=1)
    return np.asarray(middles[4:] - middles[:-4])


def _scatter(level: FloatArray) -> float:
    return float(np.median(np.abs(level - np.median(level)))) / 0.6745
