"""Lines of no gear that are new or have grown, and how often a healthy machine shows such.

A healthy machine has such lines too: of bearings, of the mains, of what nobody knows. Only what is
new or has grown counts. A line that the healthy recordings do not list may have been there below
their noise, so that it must stand out of what they could have shown.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import spence, stdtr

from gearmon.arrays import FloatArray
from gearmon.diagnosis.nongear.sources import (
    MAINS_HZ,
    NamedSeries,
    harmonic_sources,
    name_lines,
    of_hunting_tooth,
)
from gearmon.errors import check_finite
from gearmon.gears.kinematics import Kinematics
from gearmon.signatures.measured.line_plan import distance_to, known_orders
from gearmon.signatures.measured.measurement import MeasuredSignature
from gearmon.signatures.measured.nongear_lines import (
    OWN_WIDTHS,
    NonGearLine,
    NonGearLines,
    contaminated,
    noise_exceeds,
    taken,
)
from gearmon.signatures.measured.reference import Reference

# What such a line of a healthy machine is taken to change by from one recording to another before
# any is seen [dB], and the differences that this prior is worth (so that the 4 dB are known to a
# fifth): a change by one zone of vibration severity (ISO 20816: a factor of 2.5, 8 dB) is twice as
# much.
PRIOR_CHANGE_DB, PRIOR_WORTH = 4.0, 15.0
# Sources just below the noise of the reference that a healthy machine has at least: any shaft runs
# in two bearings.
_LEAST_HIDDEN = 2.0
# Lines of two recordings within this share of their order, or so many widths, are the same one.
_SAME_SHARE, _SAME_WIDTHS = 3e-3, 3.0
# So much nearer or farther a peak may stand beside a gear's order in another recording.
_SPARE_WIDTHS = 0.5
# So many unrelated lines have as many chances of a rise as n of one source: n to this power. With
# three quarters of their variance in common, from three standard deviations on, to a tenth.
_ALIKE_POWER = 0.7
# Least probability that is told, as a power of ten.
_LEAST_LOG10 = -300.0
# Lines that change with such a probability help to name what they belong to.
_STRIKING = 0.05
_SENTENCES = 4
# Damping ratio of the modes on the way to the sensor; of built-up gear cases 0.01 to 0.03.
_DAMPING_RATIO = 0.02
# Standard deviation of the level of one line through a path of many modes [dB].
_FIELD_DB = 10 / math.log(10) * math.pi / math.sqrt(6)


@dataclass(frozen=True, kw_only=True)
class LineChange:
    """Change of one line of no gear against healthy recordings.

    Parameters
    ----------
    line : NonGearLine
        The line in the new recording.
    change_db : float
        Rise of its level, mean over the channels that hear it, gains taken off [dB]; of a new line
        the least rise that the noise of the reference allows.
    sigma_db : float
        Standard deviation of that on a healthy machine [dB].
    new : bool
        Whether no healthy recording lists it.
    log10_probability : float
        Logarithm of the expected number of unrelated lines of a healthy machine that change as
        much.
    """

    line: NonGearLine
    change_db: float
    sigma_db: float
    new: bool
    log10_probability: float


@dataclass(frozen=True, kw_only=True)
class NonGearFinding:
    """Something that changed and is no gear.

    Parameters
    ----------
    kind : {"bearing", "electrical", "looseness", "unknown lines"}
        What it may be.
    name : str
        Which one, as "input: outer race (BPFO)".
    changes : tuple of LineChange
        Its lines, most striking first.
    orders : tuple of float
        Orders at which it may show besides, under the lines of gears too.
    width : float
        Resolution of the spectrum [orders].
    log10_probability : float
        Logarithm of the probability that a healthy machine shows any change as striking.
    evidence : tuple of str
        Sentences that can be checked on the spectrum.
    """

    kind: str
    name: str
    changes: tuple[LineChange, ...]
    orders: tuple[float, ...]
    width: float
    log10_probability: float
    evidence: tuple[str, ...]

    @property
    def lines(self) -> tuple[NonGearLine, ...]:
        """Its lines, most striking first."""
        return tuple(change.line for change in self.changes)

    @property
    def change_db(self) -> float:
        """Largest rise of a line [dB]."""
        return max(change.change_db for change in self.changes)

    @property
    def false_alarm_probability(self) -> float:
        """Probability that a healthy machine shows any change as striking."""
        return float(10.0**self.log10_probability)

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        return {
            "kind": self.kind,
            "name": self.name,
            "orders": [line.order for line in self.lines],
            "frequencies_hz": [line.frequency_hz for line in self.lines],
            "change_db": self.change_db,
            "false_alarm_probability": self.false_alarm_probability,
            "evidence": list(self.evidence),
        }


def nongear_findings(
    signature: MeasuredSignature, reference: Reference, train: Kinematics
) -> tuple[NonGearFinding, ...]:
    """Compare the lines of no gear of a recording with those of a reference.

    Parameters
    ----------
    signature : MeasuredSignature
        The new recording.
    reference : Reference
        Healthy recordings.
    train : Kinematics
        The machine.

    Returns
    -------
    tuple of NonGearFinding
        Most striking first.
    """
    shared = [name for name in signature.channel_names if name in reference.channel_names]
    rows = [signature.channel_names.index(name) for name in shared]
    theirs = tuple(reference.channel_names.index(name) for name in shared)
    if not shared:
        return ()
    healthy = _healthy_lines(reference, theirs)
    gain_db = family_gain_db(signature, reference, rows, theirs)
    return compare_lines(taken(signature.foreign, rows), healthy, train, gain_db, shared)


# several recordings are held against one reference
@lru_cache(maxsize=4)
def _healthy_lines(reference: Reference, rows: tuple[int, ...]) -> tuple[NonGearLines, ...]:
    return tuple(taken(profile.foreign, rows) for profile in reference.profiles)


def family_gain_db(
    signature: MeasuredSignature, reference: Reference, rows: Sequence[int], theirs: Sequence[int]
) -> FloatArray:
    """How much louder each channel is than in the reference: median over the families of lines.

    Parameters
    ----------
    signature : MeasuredSignature
        The new recording.
    reference : Reference
        Healthy recordings.
    rows, theirs : sequence of int
        Shared channels in both.

    Returns
    -------
    ndarray of float, shape (shared channels,)
        0 dB where no common family is heard.
    """
    names = [family.name for family in signature.plan.families]
    common = [name for name in reference.family_names if name in names]
    if not common:
        return np.zeros(len(rows))

    def of(values: NDArray[Any], channels: Sequence[int], own: Sequence[str]) -> NDArray[Any]:
        return values[np.ix_(channels, [list(own).index(name) for name in common])]

    heard = of(signature.heard, rows, names) & np.all(
        [of(p.heard, theirs, p.family_names) for p in reference.profiles], axis=0
    )
    healthy = of(reference.level_db.mean(axis=0), theirs, reference.family_names)
    moved = of(signature.level_db, rows, names) - healthy
    return np.array(
        [np.median(m[h]) if h.any() else 0.0 for m, h in zip(moved, heard, strict=True)]
    )


def compare_lines(
    lines: NonGearLines,
    healthy: Sequence[NonGearLines],
    train: Kinematics,
    gain_db: FloatArray | None = None,
    channel_names: Sequence[str] = (),
) -> tuple[NonGearFinding, ...]:
    """Find the lines that are new or have grown, and say what they may be.

    Parameters
    ----------
    lines : NonGearLines
        Of the new recording.
    healthy : sequence of NonGearLines
        Of healthy recordings of the same channels, at least one.
    train : Kinematics
        The machine with its bearings.
    gain_db : ndarray of float, shape (channels,), optional
        How much louder each channel is than in the healthy recordings [dB]; 0 by default.
    channel_names : sequence of str, optional
        For the evidence.

    Returns
    -------
    tuple of NonGearFinding
        Most striking first. Their probabilities are corrected for all lines looked at.

    Notes
    -----
    The change of a line over its standard deviation follows a t law: between healthy recordings it
    changes by 4 dB (a prior worth fifteen differences, joined by those among the healthy recordings
    themselves), more if the speed differs. Summed over the lines that can change (those at
    multiples of one another have one source and count for fewer), with those that may hide below
    the noise of the healthy recordings (as many so far below what is listed as stand above it,
    which have to come out of the noise first, and two just below it), and plus the peaks of mere
    noise that are as high, it gives the number of such changes to expect of a healthy machine.
    """
    gains = np.zeros(len(lines.in_time_db)) if gain_db is None else np.asarray(gain_db)
    changes = [
        change
        for change in _line_changes(lines, healthy, train, gains)
        if change.log10_probability < np.log10(_STRIKING)
    ]
    grid, findings = lines.grid("spectrum"), []
    for series in name_lines([change.line for change in changes], train, grid.width, grid.top):
        first = changes[min(series.labels)].line
        width = lines.grid(first.kind).width
        if series.kind != "unknown lines" or not of_hunting_tooth(first, train, width):
            findings.append(_finding(series, changes, grid.width, channel_names))
    return tuple(sorted(findings, key=lambda finding: finding.log10_probability))


def disturbed(
    orders: FloatArray, findings: Sequence[NonGearFinding], resolution: float
) -> NDArray[np.bool_]:
    """Tell which orders new or grown lines of no gear disturb.

    Parameters
    ----------
    orders : ndarray of float
        Orders that are to be measured.
    findings : sequence of NonGearFinding
        Of `compare_lines`.
    resolution : float
        Distance at which a line still disturbs [orders]; see
        `gearmon.signatures.measured.nongear_lines.contaminated`.

    Returns
    -------
    ndarray of bool
        Also where their lines stand under those of gears and so cannot be seen.
    """
    mask = np.zeros(np.shape(orders), dtype=bool)
    for finding in findings:
        mask |= contaminated(orders, finding.lines, resolution)
        for order in finding.orders:
            mask |= np.abs(orders - order) < resolution + finding.width
    return mask


def _finding(
    series: NamedSeries,
    changes: Sequence[LineChange],
    width: float,
    channel_names: Sequence[str],
) -> NonGearFinding:
    order = sorted(series.labels, key=lambda i: changes[i].log10_probability)
    told = [_sentence(changes[i], series.labels[i], channel_names) for i in order[:_SENTENCES]]
    return NonGearFinding(
        kind=series.kind,
        name=series.name,
        changes=tuple(changes[i] for i in order),
        orders=series.orders,
        width=width,
        log10_probability=min(0.0, changes[order[0]].log10_probability),
        evidence=tuple(told),
    )


def _sentence(change: LineChange, label: str, channel_names: Sequence[str]) -> str:
    line = change.line
    row = int(np.argmax(line.over_noise_db))
    channel = f"{channel_names[row]}: " if channel_names else ""
    what = "line" if line.kind == "spectrum" else "line in the envelope"
    of = f", {label}" if label else ""
    follows = {
        "shaft": "; it follows the shaft",
        "time": "; it keeps its frequency while the speed wanders",
    }.get(line.locked, "")
    where = f"{line.frequency_hz:.4g} Hz (order {line.order:.4g} of shaft 1{of})"
    moved = f"rose {change.change_db:.1f} dB; scatter {change.sigma_db:.1f} dB"
    if change.new:
        moved = (
            f"is in no healthy recording: {line.over_noise_db[row]:.0f} dB over the noise, "
            f"{change.change_db:.1f} dB over what could have been hidden there"
        )
    return f"{channel}{what} at {where} {moved}{follows}"


def _line_changes(
    lines: NonGearLines, healthy: Sequence[NonGearLines], train: Kinematics, gain_db: FloatArray
) -> list[LineChange]:
    """Return the change of every line that the healthy recordings can be asked for."""
    known = cache(lambda top, width: known_orders(train, top, width))
    rises = []
    for line in lines:
        width = lines.grid(line.kind).width
        then = [_level_in(other, line, width, known) for other in healthy]
        told = [level for level, _ in then if level is not None]
        if len(told) == len(then):
            listed = np.array([there for _, there in then])
            rises.append(_rise(line, lines, healthy, np.array(told), listed, gain_db))
    if not rises:
        return []
    return [
        LineChange(
            line=rise.line,
            change_db=rise.change,
            sigma_db=float(sigma),
            new=not rise.listed.any(),
            log10_probability=float(np.log10(max(expected, 10.0**_LEAST_LOG10))),
        )
        for rise, sigma, expected in zip(rises, *_healthy_law(rises, lines, healthy), strict=True)
    ]


class _Rise(NamedTuple):
    """Level of a line in the healthy recordings and its rise, over the channels that hear it [dB].

    `variance` is what the noise and a change of speed add to the rise [dB^2], `peaks` how many
    peaks of mere noise are as high, of a new line.
    """

    line: NonGearLine
    change: float
    then: FloatArray  # (recordings,)
    variance: float
    listed: NDArray[np.bool_]
    peaks: float


def _rise(
    line: NonGearLine,
    lines: NonGearLines,
    healthy: Sequence[NonGearLines],
    then_db: FloatArray,
    listed: NDArray[np.bool_],
    gain_db: FloatArray,
) -> _Rise:
    over, grid = np.array(line.over_noise_db), lines.grid(line.kind)
    heard = over >= min(grid.least_db, over.max())
    now = np.array(line.level_db) - (gain_db if line.kind == "spectrum" else 0.0)
    # a level that is read in noise, mean over channels
    ratio = 10 ** (np.minimum(over[heard], 200.0) / 10)
    variance = float(np.mean((10 / np.log(10)) ** 2 / ratio))
    if line.locked != "time" and line.kind == "spectrum":
        moves = min(abs(lines.speed_hz / other.speed_hz - 1) for other in healthy)
        variance += speed_scatter_db(moves) ** 2 / float(heard.sum())
    then = then_db[:, heard].mean(axis=1)
    exceeding = float(noise_exceeds(10 ** (over.max() / 10), grid.pieces))
    peaks = 0.0 if listed.any() else grid.looked_at * exceeding
    return _Rise(line, float(now[heard].mean() - then.mean()), then, variance, listed, peaks)


def _healthy_law(
    rises: Sequence[_Rise], lines: NonGearLines, healthy: Sequence[NonGearLines]
) -> tuple[FloatArray, FloatArray]:
    """Return the standard deviation of each rise on a healthy machine, and how many rise as much.

    The prior is joined by the scatter among the healthy recordings; unrelated lines are counted.
    """
    found, *columns = zip(*rises, strict=True)
    change, then, noise, listed, peaks = (np.array(column) for column in columns)
    share, count = np.empty(len(rises)), len(healthy)
    for group in _sources(found, lines):
        share[group] = len(group) ** (_ALIKE_POWER - 1)
    # the variance of a difference is twice that of either level
    squares, known = 2 * count * then.var(axis=1), listed.all(axis=1)
    worth = PRIOR_WORTH + (count - 1) * share[known].sum()
    variance = (PRIOR_WORTH * PRIOR_CHANGE_DB**2 + (share * squares)[known].sum()) / worth
    own = squares / max(1, count - 1)
    # a mean over several healthy recordings moves less than one of them
    sigma = np.sqrt(0.5 * (1 + 1 / count) * np.maximum(variance, own) + noise)
    hidden = [below for other in healthy for below in _hidden(other)]
    seen = (_LEAST_HIDDEN + share[listed.any(axis=1)].sum()) * stdtr(worth, -change / sigma)
    # a hidden source has to come out of the noise first
    out = stdtr(worth, -(change[:, None] + np.array(hidden)) / sigma[:, None])
    return sigma, np.asarray(seen + out.sum(axis=1) / count + peaks)


@lru_cache(maxsize=64)
def _hidden(lines: NonGearLines) -> tuple[float, ...]:
    """How far sources are hidden below what is listed [dB].

    As many stand so far below it as stand above; those that only other channels heard do stand
    below.
    """
    over = [max(x.over_noise_db) - lines.grid(x.kind).least_db for x in lines.lines]
    return tuple(abs(max(over[i] for i in group)) for group in _sources(lines.lines, lines))


def _sources(lines: Sequence[NonGearLine], whole: NonGearLines) -> list[list[int]]:
    return harmonic_sources(lines, {grid.kind: grid.width for grid in whole.grids})


def _level_in(
    other: NonGearLines,
    line: NonGearLine,
    width: float,
    known: Callable[[float, float], FloatArray],
) -> tuple[FloatArray | None, bool]:
    """Level of a line in a healthy recording, None if that cannot tell; and whether it lists it."""
    grid = other.grid(line.kind)
    width = max(grid.width, width)
    # a line that keeps its frequency stands at another order when the speed is another
    moved = line.frequency_hz / other.speed_hz
    order = moved if line.locked == "time" else line.order
    if max(order, moved) > grid.top:
        return None, False
    order_of, frequency_hz = _places(other)
    near = np.abs(order_of - line.order) / line.order
    near = np.minimum(near, np.abs(frequency_hz - line.frequency_hz) / line.frequency_hz)
    near_by = np.flatnonzero(near <= 2.0 * _reach(line, width) / line.order)
    close = [other.lines[i] for i in near_by.tolist()]
    same = [x for x in close if x.kind == line.kind and _same(line, x, width)]
    if not same and line.locked != "time":
        away = distance_to(known(grid.top, width), np.array([order]))[0]
        # there it was taken for a gear's
        if away < (OWN_WIDTHS + _SPARE_WIDTHS) * width:
            return None, False
    levels = [grid.unseen_at(order), *(np.array(x.level_db) for x in same)]
    if line.kind == "spectrum" and (line.locked == "time" or _of_the_mains(line)):
        reach = _SAME_SHARE * line.frequency_hz + 2 * width * other.speed_hz
        highest = other.highest_in_time(line.frequency_hz - reach, line.frequency_hz + reach)
        if highest is None and not same:
            return None, False
        levels += [] if highest is None else [highest]
    return np.max(levels, axis=0), bool(same)


def _same(line: NonGearLine, other: NonGearLine, width: float) -> bool:
    """Whether lines of two recordings may be one and the same."""
    near = _reach(line, width)
    if "time" not in (line.locked, other.locked) and abs(other.order - line.order) <= near:
        return True
    if "shaft" in (line.locked, other.locked):
        return False
    # against time widths are those of the same pieces
    return abs(other.frequency_hz - line.frequency_hz) * line.order <= near * line.frequency_hz


def _reach(line: NonGearLine, width: float) -> float:
    """How far apart [orders] a line may be measured in two recordings."""
    return max(_SAME_WIDTHS * width, _SAME_SHARE * line.order)


@lru_cache(maxsize=64)
def _places(lines: NonGearLines) -> tuple[FloatArray, FloatArray]:
    """Orders and frequencies of all lines."""
    told = np.array([(line.order, line.frequency_hz) for line in lines.lines]).reshape(-1, 2)
    return told[:, 0], told[:, 1]


def _of_the_mains(line: NonGearLine) -> bool:
    """Whether a line may be one of the mains."""
    away = (abs(line.frequency_hz / hz - round(line.frequency_hz / hz)) * hz for hz in MAINS_HZ)
    return line.locked != "shaft" and min(away) <= _SAME_SHARE * line.frequency_hz


def speed_scatter_db(relative_change: float, damping_ratio: float = _DAMPING_RATIO) -> float:
    """Return the standard deviation of the change of a line's level when the speed changes.

    Parameters
    ----------
    relative_change : float
        Change of speed over speed, of either sign.
    damping_ratio : float, > 0
        Damping ratio of the modes on the way to the sensor.

    Returns
    -------
    float
        0 dB at equal speeds, rising to 7.9 dB.

    Notes
    -----
    A path of many overlapping modes has a complex Gaussian response, whose correlation between two
    frequencies that differ by the share d is 1 / (1 + i d / (2 zeta)): the Fourier transform of its
    decay exp(-2 zeta w t). The squared moduli then correlate by rho = 1 / (1 + (d / (2 zeta))^2),
    and their logarithms, whose variance is pi^2/6, have the covariance Li2(rho), so that

        sigma = (10 / ln 10) sqrt(2 (pi^2/6 - Li2(rho))).

    Valid above the first modes; below them a line moves less. For a mean over several channels the
    standard deviation is taken to fall as one over the square root.

    References
    ----------
    Schroeder, Frequency-correlation functions of frequency responses in rooms, J. Acoust. Soc. Am.
    34 (1962) 1819-1823.
    """
    shift = check_finite("relative_change", relative_change) / (2 * damping_ratio)
    rho = 1 / (1 + shift**2)
    # spence(1 - x) is the dilogarithm Li2(x)
    left = max(0.0, 1 - 6 / math.pi**2 * float(spence(1 - rho)))
    return _FIELD_DB * math.sqrt(2 * left)
