"""What lines that no gear explains may be, and which of them have one source.

A bearing, the mains, a loose part: each has its own series of lines. Whatever the cause, the
harmonics of one source rise and fall together for the most part: counted one by one they would be
as many chances of a false alarm, and as many witnesses of how much lines scatter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import pdtrc

from gearmon.arrays import FloatArray
from gearmon.gears.kinematics import Kinematics
from gearmon.signatures.measured.nongear_lines import NonGearLine

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
# Highest order of half and third orders.
_LOOSE_ORDER = 20.0
# Highest multiple of a fundamental that is looked for; unrelated lines stand at as many multiples
# by chance with less than this probability.
_MULTIPLES, _CHANCE = 20, 0.01


@dataclass(frozen=True, kw_only=True)
class NamedSeries:
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


def name_lines(
    lines: Sequence[NonGearLine], train: Kinematics, width: float, top: float
) -> tuple[NamedSeries, ...]:
    """Group lines by what they may be.

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

    Returns
    -------
    tuple of NamedSeries
        Every line stands in one. Bearings need two lines that agree on the slip, or the fundamental
        itself, or one line at the slip that others of the same bearing have; half and third orders
        need two, or the first.
    """
    naming = _Naming(lines=lines, train=train, width=width, top=top)
    left = set(range(len(lines)))
    found = naming.mains({i for i in left if lines[i].locked == "time"})
    left -= _members(found)
    turning = {i for i in left if lines[i].locked != "time"}
    # of lines whose lock cannot be told those of the mains must not make up a bearing alone
    found += naming.of_machine(turning, _members(naming.mains(turning)))
    found += naming.mains(left - _members(found))
    for i in sorted(left - _members(found)):
        name = f"unknown line at {lines[i].frequency_hz:.4g} Hz"
        if lines[i].locked == "shaft":
            name = f"unknown line at order {lines[i].order:.4g} of shaft 1"
        found.append(NamedSeries(kind="unknown lines", name=name, labels={i: ""}))
    return tuple(found)


def _members(series: Sequence[NamedSeries]) -> set[int]:
    return {i for one in series for i in one.labels}


@dataclass(frozen=True, kw_only=True, eq=False)
class _Naming:
    """Lines of one recording, to be named."""

    lines: Sequence[NonGearLine]
    train: Kinematics
    width: float
    top: float
    slips: dict[str, float] = field(default_factory=dict)

    def mains(self, left: set[int]) -> list[NamedSeries]:
        found = []
        for mains in MAINS_HZ:
            own = [i for i in sorted(left) if self._of_mains(self.lines[i], mains)]
            labels = {i: f"{round(self.lines[i].frequency_hz / mains)} x {mains:g} Hz" for i in own}
            name = f"mains, multiples of {mains:g} Hz"
            found += [NamedSeries(kind="electrical", name=name, labels=labels)] if own else []
        return found

    def _of_mains(self, line: NonGearLine, mains: float) -> bool:
        multiple = round(line.frequency_hz / mains)
        # a line that follows the shafts is none of the mains; envelopes are against angle
        if line.locked == "shaft" or line.kind == "envelope" or multiple not in _MAINS_MULTIPLES:
            return False
        width_hz = 2 * self.width * line.frequency_hz / line.order
        reach = max(_MAINS_TOLERANCE * multiple * mains, width_hz)
        return abs(line.frequency_hz - multiple * mains) <= reach

    def of_machine(self, left: set[int], doubtful: set[int]) -> list[NamedSeries]:
        """Bearings and loose shafts, those with most lines first."""
        found: list[NamedSeries] = []
        bearings = [n for n, line in enumerate(self.train.lines) if line.kind == "bearing"]
        while True:
            options = [self._bearing(left, number) for number in bearings]
            options += [self._loose(left, number) for number in range(len(self.train.shafts))]
            usable = [one for one in options if one and set(one.labels) - doubtful]
            if not usable:
                return found
            best = max(usable, key=lambda one: len(one.labels))
            found.append(best)
            left = left - set(best.labels)
            if best.kind == "bearing":
                self.slips.setdefault(best.name.rpartition(":")[0], best.slip)

    def _modulation(self, number: int) -> tuple[float, str]:
        """Order that modulates a bearing's line, and its name: the shaft's, the cage's, or none."""
        line = self.train.lines[number]
        if "inner race" in line.name and line.shaft is not None:
            return self.train.shaft(line.shaft).order, "shaft"
        if "ball spin" in line.name:
            cage = f"{line.name.rpartition(':')[0]}: cage (FTF)"
            return next(x.order for x in self.train.lines if x.name == cage), "cage"
        return 0.0, ""

    def _bearing(self, left: set[int], number: int) -> NamedSeries | None:
        """Lines of one ring, ball or cage that agree on its slip, or on that of its bearing."""
        wanted, (modulating, by) = self.train.lines[number], self._modulation(number)
        reach = _BEARING_SIDEBANDS if modulating else 0
        sidebands = range(-reach, reach + 1)
        # how far each line would slip as each harmonic with each sideband
        seen = {
            (i, h, r): (self.lines[i].order - r * modulating) / (h * wanted.order) - 1
            for h in range(1, _BEARING_HARMONICS + 1)
            for r in sorted(sidebands, key=abs)
            for i in left
        }
        seen = {key: slip for key, slip in seen.items() if _SLIP_LOW <= slip <= _SLIP_HIGH}

        def agreeing(slip: float) -> dict[int, tuple[int, int]]:
            near: dict[int, tuple[int, int]] = {}
            for (i, h, r), own in seen.items():
                away = h * wanted.order * abs(own - slip)
                if away <= max(self.width, _SLIP_SWING * self.lines[i].order):
                    near.setdefault(i, (h, r))
            return near

        def rank(slip: float) -> tuple[int, bool]:
            near = agreeing(slip)
            return len(near), (1, 0) in near.values()

        # the slip that most lines agree on is that of one of them
        best_slip = max(seen.values(), key=rank, default=0.0)
        best = agreeing(best_slip)
        known = self.slips.get(wanted.name.rpartition(":")[0])
        agrees = known is not None and abs(best_slip - known) <= _SLIP_ALIKE
        if len(set(best.values())) < 2 and (1, 0) not in best.values() and not agrees:
            return None
        centre = wanted.order * (1 + best_slip)
        count = int(min(self.top / centre, 2 * _BEARING_HARMONICS))
        orders = (h * centre + r * modulating for h in range(1, count + 1) for r in sidebands)
        return NamedSeries(
            kind="bearing",
            name=wanted.name,
            labels={i: _label(*best[i], by) for i in sorted(best)},
            orders=tuple(order for order in orders if 0 < order < self.top),
            slip=best_slip,
        )

    def _loose(self, left: set[int], number: int) -> NamedSeries | None:
        """Half or third orders of a shaft."""
        shaft, options = self.train.shafts[number], []
        for part, word in ((2, "half"), (3, "third")):
            spacing = shaft.order / part
            nearest = {i: round(self.lines[i].order / spacing) for i in sorted(left)}
            labels = {
                i: f"{multiple}/{part}"
                for i, multiple in nearest.items()
                if multiple % part
                and multiple <= _LOOSE_ORDER * part
                and abs(self.lines[i].order - multiple * spacing) <= self.width
            }
            if spacing >= 4 * self.width and (len(labels) > 1 or f"1/{part}" in labels.values()):
                name = f"{word} orders of shaft {shaft.number}"
                options.append(NamedSeries(kind="looseness", name=name, labels=labels))
        return max(options, key=lambda option: len(option.labels), default=None)


def _label(harmonic: int, sideband: int, by: str) -> str:
    if not sideband:
        return f"{harmonic} x"
    return f"{harmonic} x {'+' if sideband > 0 else '-'} {abs(sideband)} x {by}"


def of_hunting_tooth(line: NonGearLine, train: Kinematics, width: float) -> bool:
    """Whether a line is a multiple of the turn in which the same two teeth meet again.

    Only where these multiples stand far enough apart for that to mean something.

    Parameters
    ----------
    line : NonGearLine
    train : Kinematics
    width : float
        Resolution of the spectrum [orders].

    Returns
    -------
    bool
    """
    hunting = (x.order for x in train.lines if x.kind == "hunting tooth" and x.order >= 4 * width)
    return any(
        round(line.order / order) > 0
        and abs(line.order - round(line.order / order) * order) <= 0.5 * width
        for order in hunting
    )


def harmonic_sources(lines: Sequence[NonGearLine], widths: dict[str, float]) -> list[list[int]]:
    """Group lines that are multiples of one another.

    Parameters
    ----------
    lines : sequence of NonGearLine
        Of one recording.
    widths : dict of str to float
        Resolution of the spectrum and of the envelope [orders], by the kind of line.

    Returns
    -------
    list of list of int
        Positions of the lines of each source, fundamental first. Each line stands in one source;
        those of the spectrum and of the envelope, and those that follow the shafts and that keep
        their frequency, are held apart.

    Notes
    -----
    A line is a multiple of a fundamental if it stands within a width of it, and as many lines would
    hardly stand so near to multiples by chance: unrelated ones fall on them as a Poisson law has
    it, each with the share of the axis that the widths about the multiples cover. A source whose
    fundamental is not listed is not put together.
    """
    apart: dict[tuple[str, bool], list[int]] = {}
    for i in sorted(range(len(lines)), key=lambda i: lines[i].order):
        apart.setdefault((lines[i].kind, lines[i].locked == "time"), []).append(i)
    found = []
    for (kind, _), own in sorted(apart.items()):
        places = np.array([lines[i].order for i in own])
        left = np.ones(len(places), dtype=bool)
        for first in range(len(places)):
            if left[first]:
                group = [first, *_multiples(places, first, left, widths[kind])]
                left[group] = False
                found.append([own[i] for i in group])
    return found


def _multiples(places: FloatArray, first: int, left: NDArray[np.bool_], width: float) -> list[int]:
    """Return which rising places are multiples of the first, none if that may be chance."""
    base = places[first]
    reached = int(np.searchsorted(places, (_MULTIPLES + 0.5) * base))
    # a fundamental is known to half a width; each multiple found tells it more finely
    known, at, found, expected = base, 1, list[int](), 0.0
    for i in first + 1 + np.flatnonzero(left[first + 1 : reached]):
        number = round(places[i] / known)
        reach = width * max(1.0, number / at)
        expected += min(1.0, 2 * reach / base)
        if number > 1 and abs(places[i] - number * known) <= reach:
            found.append(int(i))
            if number > at:
                known, at = places[i] / number, number
    return found if found and pdtrc(len(found) - 1, expected) <= _CHANCE else []
