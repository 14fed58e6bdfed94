"""What tells one kind of fault from another, as numbers that no sensor and no path decides.

Every number is a change against the healthy machine, in decibels, or the shape of a departure
around the turn of a gear, without unit. What a path does to a line it does in both recordings, so
it cancels; what is common to all lines of a channel (its gain) is taken out before anything else.

A damaged tooth is met once a turn: a short event, many sidebands far from the mesh, strong about
all mesh harmonics. Eccentricity lives in the first sidebands, wobble in the second, wear in the
mesh harmonics themselves, many damaged teeth in far sidebands without any one place in the turn.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.hypotheses.runout import TurnChange
from gearmon.errors import ArgumentError

FloatArray = NDArray[np.float64]

#: What each number means, in the order of the columns.
FEATURES: dict[str, str] = {
    "mesh_db": "change of the mesh harmonics of the stage, mean [dB]",
    "mesh_first_db": "change of the first mesh harmonic [dB]",
    "mesh_slope_db": "rise of that change per octave of the mesh harmonic [dB]",
    "mesh_rms_db": "root mean square of the changes of the mesh harmonics [dB]",
    "near_db": "change of the first six sidebands at the gear's rotation [dB]",
    "near_slope_db": "rise of that change per octave of the mesh harmonic [dB]",
    "far_db": "change of all farther lines that repeat with the gear [dB]",
    "far_slope_db": "rise of that change per octave of the mesh harmonic [dB]",
    "once_db": "change of the sidebands one turn of the gear away [dB]",
    "twice_db": "change of the sidebands two turns away [dB]",
    "thrice_db": "change of the sidebands three turns away [dB]",
    "several_db": "change of the sidebands four to six turns away [dB]",
    "turns_known": "1 if single sidebands were compared, 0 if near_db stands in for them",
    "peak_db": "highest energy of the departure in a turn over its median [dB]",
    "second_db": "highest energy at least an eighth of a turn from the peak, over the median [dB]",
    "top_share": "share of the energy above the median in the best window of four teeth, 0 to 1",
    "teeth_involved": "log2 of the number of teeth that the energy above the median spreads over",
    "peaks": "separate maxima of at least half the highest, up to 6; 0 where nothing stands out",
    "turn_once": "first circular harmonic of the energy above the median over its sum, 0 to 1",
    "turn_twice": "second circular harmonic over the sum, 0 to 1",
    "mate_near_db": "largest near_db of the other gears of the stage [dB]",
    "mate_far_db": "largest far_db of the other gears of the stage [dB]",
    "rival_peak_db": "largest peak_db of all other gears [dB]",
    "shaft_near_db": "largest near_db of gears of other stages on the same shaft [dB]",
    "elsewhere_mesh_db": "largest mesh_rms_db of the other stages [dB]",
    "overall_db": "root mean square of the changes of all families [dB]",
}
NAMES = tuple(FEATURES)
#: Changes are cut here: beyond it a line was below the noise in one of the recordings.
LARGEST_DB = 30.0
_WINDOW_TEETH = 4
_MOST_PEAKS = 6
#: Teeth between separate maxima, at least, and as a share of the turn: vibration rings on.
_APART, _APART_SHARE = 3, 0.125


class LevelLike(Protocol):
    """What is needed of a change of level, such as `diagnosis.results.Change`."""

    @property
    def channel(self) -> str:
        """See there."""

    @property
    def kind(self) -> str:
        """See there."""

    @property
    def stage(self) -> int:
        """See there."""

    @property
    def harmonic(self) -> int:
        """See there."""

    @property
    def gear(self) -> str:
        """See there."""

    @property
    def shaft(self) -> int | None:
        """See there."""

    @property
    def change_db(self) -> float:
        """See there."""

    @property
    def scatter_db(self) -> float:
        """See there."""


class ProfileLike(Protocol):
    """What is needed of a look around a gear, such as `diagnosis.results.ToothProfile`."""

    @property
    def stage(self) -> int:
        """See there."""

    @property
    def gear(self) -> str:
        """See there."""

    @property
    def energy(self) -> FloatArray:
        """See there."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FeatureVector:
    """Features of every gear that was looked at.

    Parameters
    ----------
    gears : tuple of (int, str)
        Stage and gear of each row; gear "" where only the mesh of a stage could be compared.
    values : ndarray of float, shape (gears, len(NAMES))
        Finite; columns as in `FEATURES`.
    """

    gears: tuple[tuple[int, str], ...]
    values: FloatArray

    @property
    def focus(self) -> int:
        """Row with the most evidence of a change, whatever its kind."""
        column = {name: self.values[:, i] for i, name in enumerate(NAMES)}
        sides = np.maximum.reduce(
            [column[name] for name in ("near_db", "far_db", "once_db", "twice_db")]
        )
        # the greatest of the healthy teeth of a gear stands some 4 dB above their median
        local = np.maximum(column["peak_db"] - 4.0, 0.0)
        evidence = np.maximum(sides, 0.0) + local + 0.5 * column["mesh_rms_db"]
        return int(np.argmax(evidence))

    def row(self, stage: int | None = None, gear: str | None = None) -> int:
        """Return the row of a gear, or the focus if none is named.

        Raises
        ------
        ArgumentError
            If that gear was not looked at.
        """
        if stage is None:
            return self.focus
        for index, (own_stage, own_gear) in enumerate(self.gears):
            if own_stage == stage and gear in (None, own_gear):
                return index
        known = ", ".join(f"{gear or 'mesh'} of stage {stage}" for stage, gear in self.gears)
        raise ArgumentError(f"gear {gear!r} of stage {stage} was not looked at; known: {known}")

    def named(self, row: int) -> dict[str, float]:
        """Return one row as name -> value."""
        return dict(zip(NAMES, self.values[row].tolist(), strict=True))


def kind_features(
    changes: Sequence[LevelLike],
    profiles: Sequence[ProfileLike] = (),
    turns: Sequence[TurnChange] = (),
) -> FeatureVector:
    """Condense changes against the healthy machine to the features of each gear.

    Parameters
    ----------
    changes : sequence of Change
        Levels of families of lines against the reference; empty without a reference.
    profiles : sequence of ToothProfile
        Energy of the departure around each gear.
    turns : sequence of TurnChange
        Changes of single sidebands, see `kind_turns.turn_changes`.

    Returns
    -------
    FeatureVector
        Free of NaN: what could not be compared counts as unchanged.

    Raises
    ------
    ArgumentError
        If there is nothing to look at.

    Notes
    -----
    From the changes of each channel their median over all families is taken away. Means over
    channels and harmonics weigh each change by ``1/(scatter^2 + 1 dB^2)``.
    """
    groups, shafts = _grouped(changes)
    gears = _gears(groups, profiles, turns)
    if not gears:
        raise ArgumentError("no change of level and no turn of a gear to tell a kind of fault from")
    own_turns = {(turn.stage, turn.gear): turn for turn in turns}
    shapes = {(p.stage, p.gear): _shape(p.energy) for p in profiles}
    single = {
        gear: _mesh(groups, gear[0])
        | _sides(groups, gear, own_turns.get(gear))
        | shapes.get(gear, _NO_SHAPE)
        for gear in gears
    }
    overall = _rms(np.concatenate([g.change for g in groups.values()])) if groups else 0.0
    rows = []
    for gear in gears:
        found = single[gear] | _others(gear, single, shafts) | {"overall_db": overall}
        rows.append([found[name] for name in NAMES])
    return FeatureVector(gears=gears, values=np.array(rows, dtype=np.float64))


_Gear = tuple[int, str]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Group:
    """Changes of one kind of family about one gear, over channels and harmonics."""

    change: FloatArray
    weight: FloatArray
    harmonic: FloatArray

    @property
    def mean(self) -> float:
        return float(np.average(self.change, weights=self.weight))

    @property
    def slope(self) -> float:
        """Weighted least-squares slope over log2 of the harmonic; 0 where there is only one."""
        octave = np.log2(self.harmonic)
        centred = octave - np.average(octave, weights=self.weight)
        spread = float(np.sum(self.weight * centred**2))
        if spread < 1e-9:
            return 0.0
        return float(np.sum(self.weight * centred * self.change)) / spread


def _grouped(
    changes: Sequence[LevelLike],
) -> tuple[dict[tuple[str, int, str], _Group], dict[_Gear, int]]:
    """Sort changes by kind, stage and gear, freed of the gain of their channels."""
    by_channel: dict[str, list[float]] = {}
    for change in changes:
        by_channel.setdefault(change.channel, []).append(change.change_db)
    gain = {channel: float(np.median(values)) for channel, values in by_channel.items()}
    lists: dict[tuple[str, int, str], list[tuple[float, float, int]]] = {}
    shafts: dict[_Gear, int] = {}
    for change in changes:
        key = (change.kind, change.stage, change.gear)
        moved = change.change_db - gain[change.channel]
        lists.setdefault(key, []).append((moved, change.scatter_db, change.harmonic))
        if change.shaft is not None and change.gear:
            shafts[change.stage, change.gear] = change.shaft
    groups = {}
    for key, members in lists.items():
        moved_db, scatter_db, harmonic = np.array(members, dtype=np.float64).T
        groups[key] = _Group(
            change=np.clip(moved_db, -LARGEST_DB, LARGEST_DB),
            weight=1.0 / (scatter_db**2 + 1.0),
            harmonic=harmonic,
        )
    return groups, shafts


def _gears(
    groups: Mapping[tuple[str, int, str], _Group],
    profiles: Iterable[ProfileLike],
    turns: Iterable[TurnChange],
) -> tuple[_Gear, ...]:
    found = {(stage, gear) for kind, stage, gear in groups if kind != "mesh"}
    found |= {(profile.stage, profile.gear) for profile in profiles}
    found |= {(turn.stage, turn.gear) for turn in turns}
    bare = {stage for _, stage, _ in groups} - {stage for stage, _ in found}
    return tuple(sorted(found | {(stage, "") for stage in bare}))


def _mesh(groups: Mapping[tuple[str, int, str], _Group], stage: int) -> dict[str, float]:
    group = groups.get(("mesh", stage, ""))
    if group is None:
        return dict.fromkeys(("mesh_db", "mesh_first_db", "mesh_slope_db", "mesh_rms_db"), 0.0)
    first = group.harmonic == group.harmonic.min()
    return {
        "mesh_db": group.mean,
        "mesh_first_db": float(np.average(group.change[first], weights=group.weight[first])),
        "mesh_slope_db": group.slope,
        "mesh_rms_db": _rms(group.change, group.weight),
    }


def _sides(
    groups: Mapping[tuple[str, int, str], _Group], gear: _Gear, turn: TurnChange | None
) -> dict[str, float]:
    found: dict[str, float] = {}
    for kind, name in (("sidebands", "near"), ("residual", "far")):
        group = groups.get((kind, *gear))
        found[f"{name}_db"] = group.mean if group else 0.0
        found[f"{name}_slope_db"] = group.slope if group else 0.0
    single = ("once_db", "twice_db", "thrice_db", "several_db")
    if turn is None:
        return found | dict.fromkeys(single, found["near_db"]) | {"turns_known": 0.0}
    moved = np.clip(turn.change_db, -LARGEST_DB, LARGEST_DB)
    values = (*moved[:3].tolist(), float(moved[3:].mean()))
    return found | dict(zip(single, values, strict=True)) | {"turns_known": 1.0}


_NO_SHAPE = {
    "peak_db": 0.0,
    "second_db": 0.0,
    "top_share": 0.0,
    "teeth_involved": 0.0,
    "peaks": 0.0,
    "turn_once": 0.0,
    "turn_twice": 0.0,
}


def _shape(energy: FloatArray) -> dict[str, float]:
    """Describe how the departure is spread around a turn."""
    level = np.maximum(np.asarray(energy, dtype=np.float64), 0.0)
    middle, top = float(np.median(level)), float(level.max(initial=0.0))
    excess = np.maximum(level - middle, 0.0)
    total = float(excess.sum())
    if middle <= 0 or total <= 0:
        return _NO_SHAPE
    teeth = len(level)
    wide = min(_WINDOW_TEETH, teeth)
    window = sum((np.roll(excess, -i) for i in range(wide)), np.zeros(teeth))
    turns = np.exp(2j * np.pi * np.arange(teeth) / teeth)
    return {
        "peak_db": min(10 * float(np.log10(top / middle)), 60.0),
        "second_db": min(10 * float(np.log10(_second(level) / middle)), 60.0),
        "top_share": float(window.max()) / total,
        "teeth_involved": float(np.log2(total**2 / float(np.sum(excess**2)))),
        "peaks": float(min(_separate_peaks(level, middle), _MOST_PEAKS)),
        "turn_once": float(np.abs(np.sum(excess * turns))) / total,
        "turn_twice": float(np.abs(np.sum(excess * turns**2))) / total,
    }


def _second(level: FloatArray) -> float:
    """Return the highest value away from the highest; the highest itself in a very short turn."""
    away = np.abs((np.arange(len(level)) - int(np.argmax(level))) % len(level))
    others = level[np.minimum(away, len(level) - away) >= _apart(len(level))]
    return float(others.max()) if len(others) and others.max() > 0 else float(level.max())


def _separate_peaks(level: FloatArray, middle: float) -> int:
    """Count maxima of half the highest at least that stand out, well apart."""
    least = max(middle + 0.5 * (float(level.max()) - middle), 4.0 * middle)
    left, teeth, found = level.copy(), len(level), 0
    while found < _MOST_PEAKS and float(left.max()) >= least:
        place = (int(np.argmax(left)) + np.arange(1 - _apart(teeth), _apart(teeth))) % teeth
        left[place] = 0.0
        found += 1
    return found


def _apart(teeth: int) -> int:
    return max(_APART, round(_APART_SHARE * teeth))


def _others(
    gear: _Gear, single: Mapping[_Gear, Mapping[str, float]], shafts: Mapping[_Gear, int]
) -> dict[str, float]:
    """Return what the other gears show, for contrast."""
    stage, shaft = gear[0], shafts.get(gear)
    others = {other: row for other, row in single.items() if other != gear}
    mates = [row for other, row in others.items() if other[0] == stage]
    coupled = [
        row
        for other, row in others.items()
        if shaft is not None and shafts.get(other) == shaft and other[0] != stage
    ]
    apart = [row for other, row in others.items() if other[0] != stage]
    return {
        "mate_near_db": max((row["near_db"] for row in mates), default=0.0),
        "mate_far_db": max((row["far_db"] for row in mates), default=0.0),
        "rival_peak_db": max((row["peak_db"] for row in others.values()), default=0.0),
        "shaft_near_db": max((row["near_db"] for row in coupled), default=0.0),
        "elsewhere_mesh_db": max((row["mesh_rms_db"] for row in apart), default=0.0),
    }


def _rms(values: FloatArray, weight: FloatArray | None = None) -> float:
    return float(np.sqrt(np.average(values**2, weights=weight)))
