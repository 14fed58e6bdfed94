"""Lines of no gear: new or grown against healthy recordings, and what they may be.

Bearings, the mains, loose parts and unknown lines are found in the lists that
`gearmon.signatures.measured.nongear_lines` makes of each recording. A healthy machine has such
lines too: only what is new or has grown counts. A line that the healthy recordings do not list may
have been there below their noise, so that it must stand out of what they could have shown.

Whatever the cause, the harmonics of one source rise and fall together for the most part: counted
one by one they would be as many chances of a false alarm, and as many witnesses of how much lines
scatter.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import pdtrc, spence, stdtr

from gearmon.arrays import FloatArray
from gearmon.diagnosis.law.machine import channel_gain
from gearmon.gears.kinematics import Kinematics, Line, Shaft
from gearmon.signatures.measured import nongear_lines
from gearmon.signatures.measured.line_plan import distance_to, known_orders
from gearmon.signatures.measured.nongear_lines import KINDS, OWN_WIDTHS, NonGearLine, NonGearLines
from gearmon.signatures.measured.reference import Profile, Reference

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
# A gearbox of the same kind beside this one turns at its speed within this share; so many of its
# mesh harmonics, among so many of the loudest lines, tell one speed to this share.
_NEIGHBOUR, _TELLING, _LOUDEST, _ONE_SPEED = 0.1, 3, 30, 1e-3
# Least probability that is told, as a power of ten.
_LEAST_LOG10 = -300.0
# Lines that change with such a probability help to name what they belong to.
_STRIKING = 0.05
_SENTENCES = 4
# Damping ratio of the modes on the way to the sensor; of built-up gear cases 0.01 to 0.03.
_DAMPING_RATIO = 0.02
# Standard deviation of the level of one line through a path of many modes [dB].
_FIELD_DB = 10 / math.log(10) * math.pi / math.sqrt(6)
MAINS_HZ = (50.0, 60.0)
# Multiples of the mains frequency at which motors and their supplies are heard.
_MAINS_MULTIPLES = (1, 2, 3, 4, 6, 8, 10, 12)
# How far mains frequencies depart from their nominal ones, as a share.
_MAINS_TOLERANCE = 2e-3
# How far a bearing's lines may stand from the kinematic ones because it slips, as shares.
_SLIP_LOW, _SLIP_HIGH = -0.025, 0.01
# Rings, balls and cage of one bearing slip alike to this share; while recording by this share.
_SLIP_ALIKE, _SLIP_SWING = 3e-3, 1e-3
# Harmonics and sidebands of a bearing's lines that are looked for.
_BEARING_HARMONICS, _BEARING_SIDEBANDS = 6, 2
# What nothing names repeats up to so many times; unrelated lines stand at as many of its multiples
# by chance with less than this probability. Knocks at 60 to 100 Hz whose distances scatter by 1 %
# spread their lines, of 10 s, over 0.85 % of their order: so far from one another.
_REPEATS, _CHANCE, _SLIP_SPREAD = 12, 0.01, 8e-3
# Multiples at which they stand, and sidebands of the first three: of farther ones any line would be
# one. So many times farther than a line that tells the order another may be told by it.
_FARTHEST, _PLACES = 3, [(times, 0) for times in range(1, _REPEATS + 1)]
_PLACES += product(range(1, _FARTHEST + 1), (-2, -1, 1, 2))
# Parts of a turn in which a loose shaft repeats, and the highest order at which it is looked for.
_PARTS, _LOOSE_ORDER = {2: "half", 3: "third"}, 20.0


@dataclass(frozen=True, kw_only=True)
class NonGearFinding:
    """Something that changed and is no gear.

    Parameters
    ----------
    kind : {"bearing", "electrical", "looseness", "unknown lines"}
        What it may be.
    name : str
        Which one, as "input: outer race (BPFO)".
    lines : tuple of NonGearLine
        Its lines, most striking first.
    change_db : float
        Largest rise of a line: of its level, mean over the channels that hear it, gains taken off;
        of a new line the least rise that the noise of the reference allows [dB].
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
    lines: tuple[NonGearLine, ...]
    change_db: float
    orders: tuple[float, ...]
    width: float
    log10_probability: float
    evidence: tuple[str, ...]

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
    own: Profile, reference: Reference, train: Kinematics
) -> tuple[NonGearFinding, ...]:
    """Compare the lines of no gear of a recording with those of a reference.

    Parameters
    ----------
    own : Profile
        The new recording.
    reference : Reference
        Healthy recordings of the same channels.
    train : Kinematics
        The machine.

    Returns
    -------
    tuple of NonGearFinding
        Most striking first.
    """
    healthy, gain_db = [one.foreign for one in reference.profiles], family_gain_db(own, reference)
    names = reference.channel_names
    return LineComparison(own.foreign, healthy, train, gain_db, names).findings()


def family_gain_db(own: Profile, reference: Reference) -> FloatArray:
    """How much louder each channel is than in the reference: median over the families of lines.

    Parameters
    ----------
    own, reference
        As in `nongear_findings`.

    Returns
    -------
    ndarray of float, shape (channels,)
        0 where no family can be heard in both [dB].
    """
    common = [name for name in reference.family_names if name in own.family_names]
    levels = [one.of_families(common) for one in (own, *reference.profiles)]
    moved = levels[0].level_db - np.mean([one.level_db for one in levels[1:]], axis=0)
    clear = np.logical_and.reduce([one.heard for one in levels])
    return np.nan_to_num(channel_gain(np.where(clear, moved, np.nan)))


def disturbed(
    orders: FloatArray, findings: Sequence[NonGearFinding], resolution: float
) -> NDArray[np.bool_]:
    """Tell which orders new or grown lines of no gear disturb.

    Parameters
    ----------
    orders : ndarray of float
        Orders that are to be measured.
    findings : sequence of NonGearFinding
        Of a `LineComparison`; their lines in the envelope disturb nothing.
    resolution : float
        Distance at which a line still disturbs [orders]: twice one over the length of a Hann
        block for single blocks, twice one over the recording for its synchronous mean.

    Returns
    -------
    ndarray of bool
        Also where their lines stand under those of gears and so cannot be seen.
    """
    seen = [own for found in findings for own in found.lines if own.kind == KINDS[0]]
    swept = [(own.low_order, own.high_order) for own in seen]
    swept += [(order - f.width, order + f.width) for f in findings for order in f.orders]
    low, high = np.reshape(swept, (-1, 2)).T[..., None]
    return np.asarray(np.any((orders > low - resolution) & (orders < high + resolution), axis=0))


class _LineChange(NamedTuple):
    """Rise of a line over the channels that hear it, and its standard deviation when healthy [dB].

    Then whether any healthy recording lists it, and the logarithm of the number of unrelated lines
    that are expected to change as much on a healthy machine.
    """

    line: NonGearLine
    change_db: float
    sigma_db: float
    listed: bool
    log10_probability: float


class LineComparison(NamedTuple):
    """Lines of no gear of a new recording, held against those of healthy ones.

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

    lines: NonGearLines
    healthy: Sequence[NonGearLines]
    train: Kinematics
    gain_db: FloatArray | float = 0.0
    channel_names: Sequence[str] = ()

    def findings(self) -> tuple[NonGearFinding, ...]:
        """Find the lines that are new or have grown, and say what they may be.

        Returns
        -------
        tuple of NonGearFinding
            Most striking first. Their probabilities are corrected for all lines looked at.
        """
        changes = [one for one in self.changes() if one.log10_probability < np.log10(_STRIKING)]
        grid, lines = self.lines.grid("spectrum"), [change.line for change in changes]
        findings: list[NonGearFinding] = []
        for series in Naming(lines, self.train, grid.width, grid.top).series():
            ranked = sorted(series.labels, key=lambda i: changes[i].log10_probability)
            if series.kind == "unknown lines" and all(self._hunts(lines[i]) for i in ranked):
                continue
            told = [self._sentence(changes[i], series.labels[i]) for i in ranked[:_SENTENCES]]
            findings.append(
                NonGearFinding(
                    kind=series.kind,
                    name=series.name,
                    lines=tuple(lines[i] for i in ranked),
                    change_db=max(changes[i].change_db for i in ranked),
                    orders=series.orders,
                    width=grid.width,
                    log10_probability=min(0.0, changes[ranked[0]].log10_probability),
                    evidence=tuple(told),
                )
            )
        return tuple(sorted(findings, key=lambda finding: finding.log10_probability))

    def _hunts(self, line: NonGearLine) -> bool:
        """Whether a line is at a multiple of the turn in which the same two teeth meet again."""
        width = self.lines.grid(line.kind).width
        turns = (own.order for own in self.train.lines if own.kind == "hunting tooth")
        # where these stand apart
        apart = (turn for turn in turns if turn >= 4 * width)
        off = (abs(line.order - turn * max(1, round(line.order / turn))) for turn in apart)
        return min(off, default=math.inf) <= 0.5 * width

    def _sentence(self, change: _LineChange, label: str) -> str:
        line = change.line
        row = int(np.argmax(line.over_noise_db))
        channel = f"{self.channel_names[row]}: " if self.channel_names else ""
        what = "line" if line.kind == "spectrum" else "line in the envelope"
        of = f", {label}" if label else ""
        follows = {
            "shaft": "; it follows the shaft",
            "time": "; it keeps its frequency while the speed wanders",
        }.get(line.locked, "")
        where = f"{line.frequency_hz:.4g} Hz (order {line.order:.4g} of shaft 1{of})"
        moved = f"rose {change.change_db:.1f} dB; scatter {change.sigma_db:.1f} dB"
        if not change.listed:
            moved = (
                f"is in no healthy recording: {line.over_noise_db[row]:.0f} dB over the noise, "
                f"{change.change_db:.1f} dB over what could have been hidden there"
            )
        return f"{channel}{what} at {where} {moved}{follows}"

    def changes(self) -> list[_LineChange]:
        """Return the change of every line that the healthy recordings can be asked for.

        The prior is joined by the scatter among the healthy recordings; unrelated lines are
        counted.
        """
        told = zip(*map(self._rises, KINDS), strict=True)
        place, *columns = (np.concatenate(own) for own in told)
        order = np.argsort(place)
        order = order[np.isfinite(columns[0][order])]
        found = [self.lines.lines[i] for i in place[order]]
        change, then, listed, noise, peaks = (own[order] for own in columns)
        share, count = np.empty(len(found)), len(self.healthy)
        for group in _sources(found, self.lines):
            share[group] = len(group) ** (_ALIKE_POWER - 1)
        # the variance of a difference is twice that of either level
        squares, known = 2 * count * then.var(axis=1), listed.all(axis=1)
        worth = PRIOR_WORTH + (count - 1) * share[known].sum()
        variance = (PRIOR_WORTH * PRIOR_CHANGE_DB**2 + (share * squares)[known].sum()) / worth
        own = squares / max(1, count - 1)
        # a mean over several healthy recordings moves less than one of them
        sigma = np.sqrt(0.5 * (1 + 1 / count) * np.maximum(variance, own) + noise)
        hidden = [below for other in self.healthy for below in _hidden(other)]
        ever = listed.any(axis=1)
        seen = (_LEAST_HIDDEN + share[ever].sum()) * stdtr(worth, -change / sigma)
        # a hidden source has to come out of the noise first
        out = stdtr(worth, -(change[:, None] + np.array(hidden)) / sigma[:, None])
        expected = seen + out.sum(axis=1) / count + np.where(ever, 0.0, peaks)
        log10 = np.log10(np.maximum(expected, 10.0**_LEAST_LOG10))
        rows = zip(found, *(own.tolist() for own in (change, sigma, ever, log10)), strict=True)
        return [_LineChange(*row) for row in rows]

    def _rises(self, kind: str) -> tuple[NDArray[Any], ...]:
        """Return places in the list of the lines of a kind, and how far they rose, NaN if unknown.

        Then levels in the healthy recordings, mean over the channels that hear a line [dB]; which
        of them list it; what the noise and a change of speed add to the rise [dB^2]; and how many
        peaks of mere noise are as high.
        """
        own, grid, in_spectrum = self.lines.columns[kind], self.lines.grid(kind), kind == KINDS[0]
        asked = [self._seen_in(other, kind) for other in self.healthy]
        levels, listed, turned = (np.array(told) for told in zip(*asked, strict=True))
        over, highest = own["over_noise_db"], own["over_noise_db"].max(axis=1)
        heard = over >= np.minimum(grid.least_db, highest)[:, None]
        count = heard.sum(axis=1)
        share = heard / count[:, None]
        now = own["level_db"] - (self.gain_db if in_spectrum else 0.0)
        # a level that is read in noise, mean over channels
        variance = (share * (10 / np.log(10)) ** 2 / 10 ** (np.minimum(over, 200.0) / 10)).sum(1)
        if in_spectrum:
            speeds = np.array([other.speed_hz for other in self.healthy])
            moves = np.abs(self.lines.speed_hz / (speeds[:, None] * turned) - 1).min(axis=0)
            moving = (own["locked"] != "time") | (turned != 1.0).any(axis=0)
            variance += moving * speed_scatter_db(moves) ** 2 / count
        then = (levels * share).sum(axis=2).T
        change = (now * share).sum(axis=1) - then.mean(axis=1)
        peaks = grid.looked_at * nongear_lines.noise_exceeds(10 ** (highest / 10), grid.pieces)
        return own["place"], change, then, listed.T, variance, peaks

    def _turned(self, other: NonGearLines) -> FloatArray:
        """Order of each line of the spectrum in another recording, over that in this one.

        1 but for what may be of a neighbour that is heard in both: it turns at a speed of its own.
        """
        own, grid = self.lines.columns[KINDS[0]]["order"], self.lines.grid(KINDS[0])
        (here, told), (there, also) = (_neighbour(one, self.train) for one in (self.lines, other))
        # where one of both tells it, less does in the other
        if max(told, also) < _TELLING or min(told, also) < _TELLING - 1:
            return np.ones(len(own))
        away = distance_to(known_orders(self.train, grid.top, grid.width), own / here)
        its = away <= np.maximum(OWN_WIDTHS * grid.width, _SAME_SHARE * own)
        return np.where(its, there / here, 1.0)

    def _seen_in(self, other: NonGearLines, kind: str) -> tuple[NDArray[Any], ...]:
        """Levels of lines in a healthy recording, NaN if it cannot tell; whether it lists them.

        Last the order of each there over that in this one.
        """
        own, there, grid = self.lines.columns[kind], other.columns[kind], other.grid(kind)
        width, hertz = max(grid.width, self.lines.grid(kind).width), own["frequency_hz"]
        turned = self._turned(other) if kind == KINDS[0] else np.ones(len(own))
        still, moved = own["locked"] == "time", hertz / other.speed_hz
        # a line that keeps its frequency stands at another order when the speed is another
        order = np.where(still, moved, own["order"])
        one, its = own[:, None], turned[:, None]
        again = its * one["order"]
        near = np.maximum(_SAME_WIDTHS * width, _SAME_SHARE * np.array([one["order"], again]))
        same = (its != 1.0) & (np.abs(there["order"] - again) <= near[1])
        turning = (there["locked"] != "time") & (np.abs(there["order"] - one["order"]) <= near[0])
        # against time widths are those of the same pieces
        away = np.abs(there["frequency_hz"] - one["frequency_hz"]) * one["order"]
        keeping = (there["locked"] != "shaft") & (away <= near[0] * one["frequency_hz"])
        same |= turning & ~still[:, None] | keeping & (one["locked"] != "shaft")
        listed = np.asarray(same.any(axis=1))
        level = np.where(same[..., None], there["level_db"], -np.inf).max(axis=1, initial=-np.inf)
        level = np.maximum(level, grid.unseen_at(order).T)
        # there it may have been taken for a gear's
        known = distance_to(known_orders(self.train, grid.top, width), order)
        taken = ~listed & ~still & (known < (OWN_WIDTHS + _SPARE_WIDTHS) * width)
        level[taken | (np.maximum(order, moved) > grid.top)] = np.nan
        if kind == KINDS[0]:
            # lines of the mains may stand under those of gears there
            off = [np.abs(hertz - np.rint(hertz / mains) * mains) for mains in MAINS_HZ]
            supply = (own["locked"] != "shaft") & (np.min(off, axis=0) <= _SAME_SHARE * hertz)
            reach = _SAME_SHARE * hertz + 2 * width * other.speed_hz
            highest = other.highest_in_time(hertz - reach, hertz + reach).T
            unasked = ~(still | supply)[:, None] | (listed[:, None] & np.isnan(highest))
            level = np.where(unasked, level, np.maximum(level, highest))
        return level, listed, turned


@lru_cache(maxsize=64)
def _neighbour(lines: NonGearLines, train: Kinematics) -> tuple[float, int]:
    """Speed of a gearbox of the same kind beside this one, over its own, and what tells it.

    That is a number of harmonics of its meshes. On either side of a tractor there is the same
    final drive, in the next row the same unit. Each turns at a speed of its own, so that its lines
    would be new in every recording.
    """
    own = lines.columns[KINDS[0]]
    loudest = np.argsort(-own["over_noise_db"].max(axis=1, initial=0.0))[:_LOUDEST]
    order, meshes = own["order"][loudest, None], np.array([mesh.order for mesh in train.meshes])
    harmonic = meshes * np.maximum(1.0, np.rint(order / meshes))
    ratio = order / harmonic
    usable = np.abs(ratio - 1.0) <= _NEIGHBOUR
    found = [usable & (np.abs(ratio / one - 1.0) <= _ONE_SPEED) for one in ratio[usable]]
    told = [len(np.unique(harmonic[agree])) for agree in found]
    most = max(told, default=0)
    return float(np.median(ratio[found[told.index(most)]])) if most else 1.0, most


@lru_cache(maxsize=64)
def _hidden(lines: NonGearLines) -> tuple[float, ...]:
    """How far sources are hidden below what is listed [dB].

    As many stand so far below it as stand above; those that only other channels heard do stand
    below.
    """
    over = [max(x.over_noise_db) - lines.grid(x.kind).least_db for x in lines.lines]
    return tuple(abs(max(over[i] for i in group)) for group in _sources(lines.lines, lines))


def _sources(lines: Sequence[NonGearLine], whole: NonGearLines) -> list[list[int]]:
    return nongear_lines.harmonic_sources(lines, {grid.kind: grid.width for grid in whole.grids})


def speed_scatter_db(relative_change: FloatArray | float) -> FloatArray:
    """Return the standard deviation of the change of a line's level when the speed changes.

    Parameters
    ----------
    relative_change : ndarray of float, shape (...)
        Change of speed over speed, of either sign.

    Returns
    -------
    ndarray of float, shape (...)
        0 dB at equal speeds, rising to 7.9 dB.

    Notes
    -----
    A path of many overlapping modes has a complex Gaussian response, whose correlation between two
    frequencies that differ by the share d is 1 / (1 + i d / (2 zeta)): the Fourier transform of its
    decay exp(-2 zeta w t), zeta being their damping ratio. The squared moduli then correlate by
    rho = 1 / (1 + (d / (2 zeta))^2), and their logarithms, whose variance is pi^2/6, have the
    covariance Li2(rho), so that

        sigma = (10 / ln 10) sqrt(2 (pi^2/6 - Li2(rho))).

    Valid above the first modes; below them a line moves less. For a mean over several channels the
    standard deviation is taken to fall as one over the square root.

    References
    ----------
    Schroeder, Frequency-correlation functions of frequency responses in rooms, J. Acoust. Soc. Am.
    34 (1962) 1819-1823.
    """
    rho = 1 / (1 + np.square(relative_change / (2 * _DAMPING_RATIO)))
    # spence(1 - x) is the dilogarithm Li2(x)
    left = np.maximum(1 - 6 / math.pi**2 * spence(1 - rho), 0.0)
    return np.asarray(_FIELD_DB * np.sqrt(2 * left))


class NamedSeries(NamedTuple):
    """Lines with one cause.

    Parameters
    ----------
    kind : {"bearing", "electrical", "looseness", "unknown lines"}
        The cause.
    name : str
        As "input: outer race (BPFO)".
    labels : dict of int to str
        Its lines, by their positions among those that were named, and what each of them is in the
        series, as "2 x", "1 x + 1 x shaft".
    orders : tuple of float
        Orders at which the series may show besides, those under gears' lines included.
    slip : float
        Departure of a bearing's lines from the kinematic ones, as a share.
    """

    kind: str
    name: str
    labels: dict[int, str]
    orders: tuple[float, ...] = ()
    slip: float = 0.0


def _members(series: Sequence[NamedSeries]) -> set[int]:
    return {i for one in series for i in one.labels}


class Naming(NamedTuple):
    """Lines of one recording, to be grouped by what they may be.

    Parameters
    ----------
    lines : sequence of NonGearLine
        Lines that no gear explains.
    train : Kinematics
        The machine with its bearings.
    width : float
        Resolution of the spectrum [orders].
    top : float
        Highest order of the recording.
    """

    lines: Sequence[NonGearLine]
    train: Kinematics
    width: float
    top: float

    def series(self) -> tuple[NamedSeries, ...]:
        """Group them.

        Returns
        -------
        tuple of NamedSeries
            Every line stands in one. Bearings need two lines that agree on the slip, or the
            fundamental itself, or one line at the slip that others of the same bearing have; what
            stands about their multiples is theirs then. Half and third orders need two, or the
            first; what repeats without a name needs three.
        """
        still = {i for i, line in enumerate(self.lines) if line.locked == "time"}
        every = set(range(len(self.lines)))
        turning, others = every - still, still - _members(self.mains(still))
        # of lines whose lock cannot be told those of the mains must not make up a bearing alone
        found = self.of_machine(turning, _members(self.mains(turning)), others)
        found += self.mains(every - _members(found))
        found += self.repeating(every - _members(found))
        for i in sorted(every - _members(found)):
            line = self.lines[i]
            name = f"unknown line at {line.frequency_hz:.4g} Hz"
            if line.locked == "shaft":
                name = f"unknown line at order {line.order:.4g} of shaft 1"
            found.append(NamedSeries("unknown lines", name, {i: ""}))
        return tuple(found)

    def mains(self, left: set[int]) -> list[NamedSeries]:
        """Lines of the supply; what both frequencies explain is of the one that explains more."""
        found: list[NamedSeries] = []
        own = {hz: [i for i in sorted(left) if self._of_mains(i, hz)] for hz in MAINS_HZ}
        for hz, of_hz in sorted(own.items(), key=lambda item: -len(item[1])):
            rest = [i for i in of_hz if i not in _members(found)]
            labels = {i: f"{round(self.lines[i].frequency_hz / hz)} x {hz:g} Hz" for i in rest}
            name = f"mains, multiples of {hz:g} Hz"
            found += [NamedSeries("electrical", name, labels)] if rest else []
        return found

    def _of_mains(self, i: int, mains: float) -> bool:
        line = self.lines[i]
        multiple = round(line.frequency_hz / mains)
        # a line that follows the shafts is none of the mains; envelopes are against angle
        if line.locked == "shaft" or line.kind == "envelope" or multiple not in _MAINS_MULTIPLES:
            return False
        width_hz = 2 * self.width * line.frequency_hz / line.order
        reach = max(_MAINS_TOLERANCE * multiple * mains, width_hz)
        return abs(line.frequency_hz - multiple * mains) <= reach

    def of_machine(self, left: set[int], doubtful: set[int], still: set[int]) -> list[NamedSeries]:
        """Bearings and loose shafts, those with most lines first."""
        found: list[NamedSeries] = []
        bearings = {line.name: line for line in self.train.lines if line.kind == "bearing"}
        loose = [(shaft, part) for shaft in self.train.shafts for part in _PARTS]
        while True:
            options = [self._bearing(left, line, found) for line in bearings.values()]
            options += [self._loose(left, *one) for one in loose]
            usable = [one for one in options if one and set(one.labels) - doubtful]
            if not usable:
                return found
            best = max(usable, key=lambda one: len(one.labels))
            left = left - set(best.labels)
            if ring := bearings.pop(best.name, None):
                # knocks that scatter: also where one of its lines keeps its frequency by chance
                modulating, by = self._modulating(ring)
                more = self._about(left | still, ring.order * (1 + best.slip), modulating)
                best.labels.update({i: _label(*place, by) for i, place in more.items()})
                left, still = left - set(more), still - set(more)
            found.append(best)

    def _bearing(self, left: set[int], ring: Line, found: list[NamedSeries]) -> NamedSeries | None:
        """Lines of one ring, ball or cage that agree on its slip, or on that of its bearing."""
        modulating, by = self._modulating(ring)
        reach = _BEARING_SIDEBANDS if modulating else 0
        sidebands = sorted(range(-reach, reach + 1), key=abs)
        series = list(product(range(1, _BEARING_HARMONICS + 1), sidebands))
        harmonic, sideband = np.array(series).T
        orders = np.array([[self.lines[i].order] for i in left]).reshape(-1, 1)
        # how far each line would slip as each harmonic with each sideband
        slips = (orders - sideband * modulating) / (harmonic * ring.order) - 1
        usual = (slips >= _SLIP_LOW) & (slips <= _SLIP_HIGH)
        swing = np.maximum(self.width, _SLIP_SWING * orders) / (harmonic * ring.order)
        if not usual.any():
            return None
        # the slip that most lines agree on is that of one of them; the fundamental stands first
        tried = slips.T[usual.T]
        near = usual & (np.abs(slips - tried[:, None, None]) <= swing)
        chosen = int(np.argmax(near.any(axis=2).sum(axis=1)))
        slip, pairs = float(tried[chosen]), zip(left, near[chosen], strict=True)
        best = {i: series[int(np.argmax(row))] for i, row in pairs if row.any()}
        known = [one.slip for one in found if _bearing_of(one) == _bearing_of(ring)]
        agrees = bool(known) and abs(slip - known[0]) <= _SLIP_ALIKE
        if len(set(best.values())) < 2 and (1, 0) not in best.values() and not agrees:
            return None
        centre = ring.order * (1 + slip)
        count = int(min(self.top / centre, 2 * _BEARING_HARMONICS))
        places = (h * centre + r * modulating for h in range(1, count + 1) for r in sidebands)
        labels = {i: _label(*best[i], by) for i in sorted(best)}
        inside = tuple(order for order in places if 0 < order < self.top)
        return NamedSeries("bearing", ring.name, labels, inside, slip)

    def _modulating(self, ring: Line) -> tuple[float, str]:
        """Order of what modulates an inner race (the shaft) or balls (the cage), and its name."""
        if "inner race" in ring.name and ring.shaft is not None:
            return self.train.shaft(ring.shaft).order, "shaft"
        cage = f"{_bearing_of(ring)}: cage (FTF)" if "ball spin" in ring.name else ""
        return next(
            ((own.order, "cage") for own in self.train.lines if own.name == cage), (0.0, "")
        )

    def repeating(self, left: set[int]) -> list[NamedSeries]:
        """Lines at multiples of one of them, and about these: of what nothing names."""
        found: list[NamedSeries] = []
        turning = {"": 0.0} | {f"shaft {own.number}": own.order for own in self.train.shafts}
        while True:
            options = [(self._multiples(left, i, turning[by]), by) for by in turning for i in left]
            series, by = max(options, key=lambda one: len(one[0]), default=({}, ""))
            if not series:
                return found
            rows = [(self.lines[i].order, *place) for i, place in series.items()]
            base = np.median([(order - side * turning[by]) / times for order, times, side in rows])
            name = f"lines at multiples of order {base:.4g} of shaft 1"
            if any(self.lines[i].kind == "envelope" for i in series):
                name += ", as knocks of a rolling bearing or a shaft of another machine make them"
            labels = {i: _label(*place, by) for i, place in series.items()}
            found.append(NamedSeries("unknown lines", name, labels))
            left = left - set(series)

    def _about(self, lines: set[int], base: float, modulating: float) -> dict[int, tuple[int, int]]:
        """Multiple and sideband of lines that stand at some of an order: knocks that scatter.

        Sidebands stand by the order of what modulates them apart; 0 where nothing does.
        """
        times, side = np.array(_PLACES if modulating else _PLACES[:_REPEATS]).T
        place = np.array(sorted(lines), dtype=int)
        orders = np.array([[self.lines[i].order] for i in place]).reshape(-1, 1)
        # the order itself may stand at the edge of what they spread over
        for _ in range(2):
            reach = np.maximum(self.width, _SLIP_SPREAD * base * times)
            off = np.abs(orders - times * base - side * modulating) / reach
            best, near = off.argmin(axis=1), off.min(axis=1) <= 1.0
            own = ((orders[:, 0] - side[best] * modulating) / times[best])[near]
            base = float(np.median(own)) if near.any() else base
        told = zip(place.tolist(), times[best].tolist(), side[best].tolist(), strict=True)
        found = {i: (n, r) for (i, n, r), kept in zip(told, near, strict=True) if kept}
        # knocks that do not scatter go on far up, where each line tells the order more finely
        highest = max((n for n, _ in found.values()), default=1)
        sidebands = sorted({*side.tolist()}, key=abs)
        for i in sorted(lines - set(found), key=lambda i: self.lines[i].order):
            for r in sidebands:
                from_side = self.lines[i].order - r * modulating
                n = round(from_side / base)
                finely = self.width * max(1.0, n / highest)
                if 1 <= n <= _FARTHEST * highest and abs(from_side - n * base) <= finely:
                    found[i] = n, r
                    if n > highest:
                        base, highest = from_side / n, n
                    break
        return found

    def _multiples(
        self, left: set[int], first: int, modulating: float
    ) -> dict[int, tuple[int, int]]:
        """Lines at multiples of one of them and about these; none where that may be chance."""
        base = self.lines[first].order
        found = self._about(left, base, modulating)
        orders = np.sort([self.lines[i].order for i in left])
        # what one line may show, scattered, is one place
        orders = orders[np.append(True, np.diff(orders) > _SLIP_SPREAD * orders[1:])]
        times = np.rint(orders / base)
        most = 2 * _BEARING_SIDEBANDS * (modulating > 0)
        # the share of the axis about each at which it would count
        share = 2 * np.maximum(self.width / base, _SLIP_SPREAD * times)
        share *= 1 + np.where(times <= _FARTHEST, most, 0)
        counts = (times <= _REPEATS) & (np.abs(orders / base - 1) > _SLIP_SPREAD)
        if _beyond_chance({*found.values()} & {*_PLACES}, 1, np.minimum(share, 1.0)[counts].sum()):
            return found
        # those that do not scatter stand at multiples of what the highest of them tells
        one = {i: (self.lines[i].order - r * modulating) / n for i, (n, r) in found.items()}
        order = one[max(found, key=lambda i: found[i])]
        off = {i: n * abs(one[i] - order) for i, (n, _) in found.items()}
        sharp = {i: place for i, place in found.items() if off[i] <= self.width}
        expected = len(left) * min(1.0, 2 * self.width * (1 + most) / base)
        return sharp if _beyond_chance({*sharp.values()}, 2, expected) else {}

    def _loose(self, left: set[int], shaft: Shaft, part: int) -> NamedSeries | None:
        """Half or third orders of a shaft."""
        spacing, labels = shaft.order / part, {}
        for i in sorted(left):
            multiple = round(self.lines[i].order / spacing)
            near = abs(self.lines[i].order - multiple * spacing) <= self.width
            if near and multiple % part and multiple <= _LOOSE_ORDER * part:
                labels[i] = f"{multiple}/{part}"
        if spacing < 4 * self.width or not (len(labels) > 1 or f"1/{part}" in labels.values()):
            return None
        return NamedSeries("looseness", f"{_PARTS[part]} orders of shaft {shaft.number}", labels)


def _beyond_chance(places: Collection[tuple[int, int]], fitted: int, expected: float) -> bool:
    """Whether lines at so many places, beside those that were fitted, are more than chance."""
    others = len(places) - fitted
    return others >= 2 and bool(pdtrc(others - 1, expected) <= _CHANCE)


def _bearing_of(named: Line | NamedSeries) -> str:
    """Name of the bearing whose ring, balls or cage this is."""
    return named.name.rpartition(":")[0]


def _label(harmonic: int, sideband: int, by: str) -> str:
    if not sideband:
        return f"{harmonic} x"
    return f"{harmonic} x {'+' if sideband > 0 else '-'} {abs(sideband)} x {by}"
