"""What tells one kind of fault from another, as numbers that no sensor and no path decides.

Every number is a change against the healthy machine, in decibels, or the shape of a departure
around the turn of a gear, without unit. What a path does to a line it does in both recordings, so
it cancels; what is common to all lines of a channel (its gain) is taken out before anything else.

A damaged tooth is met once a turn: a short event, many sidebands far from the mesh, strong about
all mesh harmonics. Eccentricity lives in the first sidebands, wobble in the second, wear in the
mesh harmonics themselves, many damaged teeth in far sidebands without any one place in the turn.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.errors import ArgumentError

if TYPE_CHECKING:
    from gearmon.diagnosis.hypotheses.runout import TurnChange
    from gearmon.diagnosis.results import Change, ToothProfile


#: Nothing is wrong with the gears: healthy, or something that repeats with no gear.
NONE = "none of these"
#: Kinds of fault that are told apart; the last is none of them.
KINDS = (
    "tooth damage",
    "several teeth",
    "distributed pitting",
    "wear",
    "eccentricity",
    "misalignment",
    "looseness",
    NONE,
)
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


class TurnEnergy(NamedTuple):
    """Stage and gear, and the energy of a departure by tooth, as in a `ToothProfile`."""

    stage: int
    gear: str
    energy: FloatArray


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
        column = dict(zip(NAMES, self.values.T, strict=True))
        sides = [column[name] for name in ("near_db", "far_db", "once_db", "twice_db")]
        # the greatest of the healthy teeth of a gear stands some 4 dB above their median
        local = np.maximum(column["peak_db"] - 4.0, 0.0)
        evidence = np.maximum(np.max(sides, axis=0), 0.0) + local + 0.5 * column["mesh_rms_db"]
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
    changes: Sequence[Change],
    profiles: Sequence[ToothProfile | TurnEnergy] = (),
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
        Changes of single sidebands, see `hypotheses.runout.turn_changes`.

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
    groups = _grouped(changes)
    shafts = {(c.stage, c.gear): c.shaft for c in changes if c.shaft is not None and c.gear}
    own_turns = {(turn.stage, turn.gear): turn for turn in turns}
    shapes = {(p.stage, p.gear): _shape(p.energy) for p in profiles}
    gears = {key[1:] for key in groups if key[0] != "mesh"} | own_turns.keys() | shapes.keys()
    gears |= {(stage, "") for _, stage, _ in groups if stage not in {own for own, _ in gears}}
    if not gears:
        raise ArgumentError("no change of level and no turn of a gear to tell a kind of fault from")
    ranked = tuple(sorted(gears))
    single = {
        gear: _mesh(groups.get(("mesh", gear[0], ""), _UNCHANGED))
        | _sides(groups, gear, own_turns.get(gear))
        | shapes.get(gear, _NO_SHAPE)
        for gear in ranked
    }
    overall = _rms(np.concatenate([g.change for g in groups.values()])) if groups else 0.0
    rows = []
    for gear in ranked:
        found = single[gear] | _others(gear, single, shafts) | {"overall_db": overall}
        rows.append([found[name] for name in NAMES])
    return FeatureVector(gears=ranked, values=np.array(rows, dtype=np.float64))


_Gear = tuple[int, str]


class _Group(NamedTuple):
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
        spread, product = np.cov(octave, self.change, aweights=self.weight, ddof=0)[0]
        return float(product / spread) if spread >= 1e-9 else 0.0


_UNCHANGED = _Group(np.zeros(1), np.ones(1), np.ones(1))


def _grouped(changes: Sequence[Change]) -> dict[tuple[str, int, str], _Group]:
    """Sort changes by kind, stage and gear, freed of the gain of their channels."""
    moved_db = np.array([change.change_db for change in changes], dtype=np.float64)
    channel = np.array([change.channel for change in changes])
    for name in set(channel.tolist()):
        moved_db[channel == name] -= np.median(moved_db[channel == name])
    members: dict[tuple[str, int, str], list[tuple[float, float, int]]] = {}
    for change, cut_db in zip(changes, np.clip(moved_db, -LARGEST_DB, LARGEST_DB), strict=True):
        row = (cut_db, 1.0 / (change.scatter_db**2 + 1.0), change.harmonic)
        members.setdefault((change.kind, change.stage, change.gear), []).append(row)
    return {key: _Group(*np.array(rows, dtype=float).T) for key, rows in members.items()}


def _mesh(group: _Group) -> dict[str, float]:
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
        group = groups.get((kind, *gear), _UNCHANGED)
        found |= {f"{name}_db": group.mean, f"{name}_slope_db": group.slope}
    values = [found["near_db"]] * 4
    if turn is not None:
        moved = np.clip(turn.change_db, -LARGEST_DB, LARGEST_DB)
        values = [*moved[:3].tolist(), float(moved[3:].mean())]
    single = ("once_db", "twice_db", "thrice_db", "several_db")
    known = {"turns_known": float(turn is not None)}
    return found | dict(zip(single, values, strict=True)) | known


_SHAPE = ("peak_db", "second_db", "top_share", "teeth_involved", "peaks", "turn_once", "turn_twice")
_NO_SHAPE = dict.fromkeys(_SHAPE, 0.0)


def _shape(energy: FloatArray) -> dict[str, float]:
    """Describe how the departure is spread around a turn."""
    level = np.maximum(np.asarray(energy, dtype=np.float64), 0.0)
    level = level / max(float(level.max(initial=0.0)), np.finfo(float).tiny)
    middle, teeth = float(np.median(level)), len(level)
    excess = np.maximum(level - middle, 0.0)
    total = float(excess.sum())
    if middle <= 0 or total <= 0:
        return _NO_SHAPE
    window = sum(np.roll(excess, -i) for i in range(min(_WINDOW_TEETH, teeth)))
    # 60 dB are the most that is told: a median far below it must not divide
    peaks = np.array([level.max(), _second(level)]) / max(middle, 1e-9)
    turns = np.exp(2j * np.pi * np.outer([1, 2], np.arange(teeth)) / teeth)
    values = (
        *np.minimum(10 * np.log10(peaks), 60.0),
        np.max(window) / total,
        np.log2(total**2 / np.sum(excess**2)),
        _separate_peaks(level, middle),
        *(np.abs(turns @ excess) / total),
    )
    return {name: float(value) for name, value in zip(_SHAPE, values, strict=True)}


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
    gear: _Gear, single: Mapping[_Gear, Mapping[str, float]], shafts: Mapping[_Gear, int | None]
) -> dict[str, float]:
    """Return what the other gears show, for contrast."""
    others = [other for other in single if other != gear]
    mates = [other for other in others if other[0] == gear[0]]
    apart = [other for other in others if other[0] != gear[0]]
    shaft = shafts.get(gear)
    coupled = [other for other in apart if shaft is not None and shafts.get(other) == shaft]

    def largest(name: str, of: Sequence[_Gear]) -> float:
        return max((single[other][name] for other in of), default=0.0)

    return {
        "mate_near_db": largest("near_db", mates),
        "mate_far_db": largest("far_db", mates),
        "rival_peak_db": largest("peak_db", others),
        "shaft_near_db": largest("near_db", coupled),
        "elsewhere_mesh_db": largest("mesh_rms_db", apart),
    }


def _rms(values: FloatArray, weight: FloatArray | None = None) -> float:
    return float(np.sqrt(np.average(values**2, weights=weight)))
