"""What a line that no gear explains may be: a bearing, the mains, a loose part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gearmon.gears.kinematics import Kinematics
from gearmon.signatures.foreign_lines import ForeignLine

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


@dataclass(frozen=True, kw_only=True)
class NamedSeries:
    """Lines with one cause.

    Parameters
    ----------
    kind : {"bearing", "electrical", "looseness", "unknown lines"}
        The cause.
    name : str
        As "input: outer race (BPFO)".
    members : tuple of int
        Positions of its lines among those that were named.
    labels : tuple of str
        What each of them is in the series, as "2 x", "1 x + 1 x shaft".
    orders : tuple of float
        Orders at which the series may show besides, those under gears' lines included.
    slip : float
        Departure of a bearing's lines from the kinematic ones, as a share.
    """

    kind: str
    name: str
    members: tuple[int, ...]
    labels: tuple[str, ...]
    orders: tuple[float, ...] = ()
    slip: float = 0.0


def name_lines(
    lines: Sequence[ForeignLine], train: Kinematics, width: float, top: float
) -> tuple[NamedSeries, ...]:
    """Group lines by what they may be.

    Parameters
    ----------
    lines : sequence of ForeignLine
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
    left = set(range(len(lines)))
    found = _mains(lines, {i for i in left if lines[i].locked == "time"}, width)
    left -= _members(found)
    turning = {i for i in left if lines[i].locked != "time"}
    # of lines whose lock cannot be told those of the mains must not make up a bearing alone
    doubtful = _members(_mains(lines, turning, width))
    series = _series_of_machine(lines, turning, doubtful, train, width, top)
    left -= _members(series)
    rest = _mains(lines, left, width)
    left -= _members(rest)
    found += series + rest
    for i in sorted(left):
        line = lines[i]
        name = f"unknown line at {line.frequency_hz:.4g} Hz"
        if line.locked == "shaft":
            name = f"unknown line at order {line.order:.4g} of shaft 1"
        found.append(NamedSeries(kind="unknown lines", name=name, members=(i,), labels=("",)))
    return tuple(found)


def _members(series: Sequence[NamedSeries]) -> set[int]:
    return {i for one in series for i in one.members}


def _mains(lines: Sequence[ForeignLine], left: set[int], width: float) -> list[NamedSeries]:
    found = (_electrical(lines, left, mains, width) for mains in MAINS_HZ)
    return [series for series in found if series is not None]


def _series_of_machine(
    lines: Sequence[ForeignLine],
    left: set[int],
    doubtful: set[int],
    train: Kinematics,
    width: float,
    top: float,
) -> list[NamedSeries]:
    """Bearings and loose shafts, those with most lines first."""
    found: list[NamedSeries] = []
    left, slips = set(left), dict[str, float]()
    while left:
        options = [
            _bearing(lines, left, train, n, width, top, slips)
            for n, line in enumerate(train.lines)
            if line.kind == "bearing"
        ]
        options += [_loose(lines, left, train, n, width) for n in range(len(train.shafts))]
        usable = [one for one in options if one and set(one.members) - doubtful]
        best = max(usable, key=lambda one: len(one.members), default=None)
        if best is None:
            break
        found.append(best)
        left -= set(best.members)
        if best.kind == "bearing":
            slips.setdefault(best.name.rpartition(":")[0], best.slip)
    return found


def _electrical(
    lines: Sequence[ForeignLine], left: set[int], mains: float, width: float
) -> NamedSeries | None:
    members, labels = [], []
    for i in sorted(left):
        line = lines[i]
        multiple = round(line.frequency_hz / mains)
        away = abs(line.frequency_hz - multiple * mains)
        # a line that follows the shafts is none of the mains; envelopes are against angle
        if line.locked == "shaft" or line.kind == "envelope" or multiple not in _MAINS_MULTIPLES:
            continue
        reach = max(_MAINS_TOLERANCE * multiple * mains, 2 * width * line.frequency_hz / line.order)
        if away <= reach:
            members.append(i)
            labels.append(f"{multiple} x {mains:g} Hz")
    if not members:
        return None
    name = f"mains, multiples of {mains:g} Hz"
    return NamedSeries(kind="electrical", name=name, members=tuple(members), labels=tuple(labels))


def _modulation(train: Kinematics, number: int) -> tuple[float, str]:
    """Order that modulates a bearing's line, and its name: the shaft's, the cage's, or none."""
    line = train.lines[number]
    start = line.name.rpartition(":")[0]
    if "inner race" in line.name and line.shaft is not None:
        return train.shaft(line.shaft).order, "shaft"
    if "ball spin" in line.name:
        cage = next(x for x in train.lines if x.name == f"{start}: cage (FTF)")
        return cage.order, "cage"
    return 0.0, ""


def _bearing(
    lines: Sequence[ForeignLine],
    left: set[int],
    train: Kinematics,
    number: int,
    width: float,
    top: float,
    slips: dict[str, float],
) -> NamedSeries | None:
    """Lines of one ring, ball or cage that agree on its slip, or on that of its bearing."""
    wanted = train.lines[number]
    modulating, by = _modulation(train, number)
    sidebands = range(-_BEARING_SIDEBANDS, _BEARING_SIDEBANDS + 1) if modulating else (0,)
    seen = [
        (i, h, r)
        for h in range(1, _BEARING_HARMONICS + 1)
        for r in sorted(sidebands, key=abs)
        for i in left
        if _SLIP_LOW <= (lines[i].order - r * modulating) / (h * wanted.order) - 1 <= _SLIP_HIGH
    ]
    best: dict[int, tuple[int, int]] = {}
    best_slip = 0.0
    # the slip that most lines agree on is that of one of them
    for one, harmonic, sideband in seen:
        slip = (lines[one].order - sideband * modulating) / (harmonic * wanted.order) - 1
        near: dict[int, tuple[int, int]] = {}
        for i, h, r in seen:
            away = abs(lines[i].order - r * modulating - h * wanted.order * (1 + slip))
            if away <= max(width, _SLIP_SWING * lines[i].order):
                near.setdefault(i, (h, r))
        if (len(near), (1, 0) in near.values()) > (len(best), (1, 0) in best.values()):
            best, best_slip = near, slip
    known_slip = slips.get(wanted.name.rpartition(":")[0])
    agrees = known_slip is not None and abs(best_slip - known_slip) <= _SLIP_ALIKE
    if len(set(best.values())) < 2 and (1, 0) not in best.values() and not agrees:
        return None
    members = tuple(sorted(best))
    centre = wanted.order * (1 + best_slip)
    count = int(min(top / centre, 2 * _BEARING_HARMONICS))
    orders = (h * centre + r * modulating for h in range(1, count + 1) for r in sidebands)
    return NamedSeries(
        kind="bearing",
        name=wanted.name,
        members=members,
        labels=tuple(_label(*best[i], by) for i in members),
        orders=tuple(order for order in orders if 0 < order < top),
        slip=best_slip,
    )


def _label(harmonic: int, sideband: int, by: str) -> str:
    if not sideband:
        return f"{harmonic} x"
    return f"{harmonic} x {'+' if sideband > 0 else '-'} {abs(sideband)} x {by}"


def _loose(
    lines: Sequence[ForeignLine], left: set[int], train: Kinematics, number: int, width: float
) -> NamedSeries | None:
    """Half or third orders of a shaft."""
    shaft = train.shafts[number]
    options = []
    for part, word in ((2, "half"), (3, "third")):
        if shaft.order / part < 4 * width:
            continue
        members, labels = [], []
        for i in sorted(left):
            multiple = round(lines[i].order * part / shaft.order)
            away = abs(lines[i].order - multiple * shaft.order / part)
            if multiple % part and multiple <= _LOOSE_ORDER * part and away <= width:
                members.append(i)
                labels.append(f"{multiple}/{part}")
        if len(members) > 1 or f"1/{part}" in labels:
            name = f"{word} orders of shaft {shaft.number}"
            options.append(
                NamedSeries(
                    kind="looseness", name=name, members=tuple(members), labels=tuple(labels)
                )
            )
    return max(options, key=lambda option: len(option.members), default=None)


def of_hunting_tooth(line: ForeignLine, train: Kinematics, width: float) -> bool:
    """Whether a line is a multiple of the turn in which the same two teeth meet again.

    Only where these multiples stand far enough apart for that to mean something.

    Parameters
    ----------
    line : ForeignLine
    train : Kinematics
    width : float
        Resolution of the spectrum [orders].

    Returns
    -------
    bool
    """
    for hunting in train.lines:
        if hunting.kind != "hunting tooth" or hunting.order < 4 * width:
            continue
        multiple = round(line.order / hunting.order)
        if multiple > 0 and abs(line.order - multiple * hunting.order) <= 0.5 * width:
            return True
    return False
