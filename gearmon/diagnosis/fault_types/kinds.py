"""What tells one kind of fault from another, and which kind it is most like.

Every feature is a change against the healthy machine, in decibels, or the shape of a departure
around the turn of a gear, without unit. What a path does to a line it does in both recordings, so
it cancels; what is common to all lines of a channel (its gain) is taken out before anything else.

A damaged tooth is met once a turn: a short event, many sidebands far from the mesh, strong about
all mesh harmonics. Eccentricity lives in the first sidebands, wobble in the second, wear in the
mesh harmonics themselves, many damaged teeth in far sidebands without any one place in the turn.

The kind is judged by physical rules, which need no training, or by a trained classifier. Each rule
weighs, in decibels, what speaks for a kind against what it cannot explain: one tooth is a short
event, eccentricity ends after the first sideband, wear leaves the sidebands alone. Their
probabilities order the kinds; only a trained classifier's are calibrated.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import softmax

from gearmon.arrays import FloatArray
from gearmon.diagnosis.hypotheses.turns import aligned, departure_energy, turn_changes
from gearmon.diagnosis.results import Analysis, Change
from gearmon.errors import ArgumentError, check_type
from gearmon.result import Result
from gearmon.signatures.measured.reference import Profile, Reference

if TYPE_CHECKING:
    import pandas as pd

    from gearmon.diagnosis.fault_types.classifier import KindClassifier
    from gearmon.diagnosis.hypotheses.several_teeth import DepartureSpread

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
#: Change that healthy machines reach now and then [dB].
USUAL_DB = 2.0
#: Highest energy over the median that the teeth of a healthy gear reach now and then [dB].
USUAL_PEAK_DB = 6.0
#: Decibels of evidence that make a kind e times as probable, by the rules.
_SOFTNESS_DB = 2.5
#: Most that speaks for a kind of teeth [dB].
_SURE_DB = 12.0
#: Decibels that speak against a smooth change for each by which farther lines changed; and by which
#: its fourth to sixth sidebands stay behind the first.
_ROUGH, _DECAY_DB = 4.0, 6.0
#: Kinds that show in the mesh and not in the turn of one of its gears.
_OF_A_MESH = ("wear",)


_Gear = tuple[int, str]
_ByGear = Mapping[_Gear, FloatArray]
_NOTHING: _ByGear = {}
#: What each of `FEATURES` is of every gear that was looked at, by stage and gear; gear "" where
#: only the mesh of a stage could be compared.
GearFeatures = dict[_Gear, dict[str, float]]


def focus_of(features: GearFeatures) -> _Gear:
    """Return the gear with the most evidence of a change, whatever its kind."""

    def evidence(gear: _Gear) -> float:
        own = features[gear]
        sides = (own[name] for name in ("near_db", "far_db", "once_db", "twice_db"))
        # the greatest of the healthy teeth of a gear stands some 4 dB above their median
        return max(0.0, *sides) + max(own["peak_db"] - 4.0, 0.0) + 0.5 * own["mesh_rms_db"]

    return max(features, key=evidence)


def kind_features(
    changes: Sequence[Change], energies: _ByGear = _NOTHING, sidebands: _ByGear = _NOTHING
) -> GearFeatures:
    """Condense changes against the healthy machine to the features of each gear.

    Parameters
    ----------
    changes : sequence of Change
        Levels of families of lines against the reference; empty without a reference.
    energies : mapping of (int, str) to ndarray of float, shape (teeth,)
        Energy of the departure around each gear, as in a `ToothProfile`.
    sidebands : mapping of (int, str) to ndarray of float, shape (6,)
        Changes of single sidebands of each gear, see `hypotheses.turns.turn_changes`.

    Returns
    -------
    dict of (int, str) to dict
        By stage and gear, in this order; free of NaN: what could not be compared counts as
        unchanged.

    Raises
    ------
    ArgumentError
        If there is nothing to look at.

    Notes
    -----
    From the changes of each channel their median over all families is taken away. Means over
    channels and harmonics weigh each change by ``1/(scatter^2 + 1 dB^2)``.
    """
    moved_db = np.array([change.change_db for change in changes], dtype=np.float64)
    channel = np.array([change.channel for change in changes])
    for name in set(channel.tolist()):
        moved_db[channel == name] -= np.median(moved_db[channel == name])
    moved_db = np.clip(moved_db, -LARGEST_DB, LARGEST_DB)
    groups = _grouped(changes, moved_db)
    shafts = {(c.stage, c.gear): c.shaft for c in changes if c.shaft is not None and c.gear}
    gears = {key[1:] for key in groups if key[0] != "mesh"} | sidebands.keys() | energies.keys()
    gears |= {(stage, "") for _, stage, _ in groups if stage not in {own for own, _ in gears}}
    if not gears:
        raise ArgumentError("no change of level and no turn of a gear to tell a kind of fault from")
    ranked = tuple(sorted(gears))
    rows, still = [], np.zeros(1)  # what could not be compared
    for gear in ranked:
        keys = ("mesh", gear[0], ""), ("sidebands", *gear), ("residual", *gear)
        mesh, near, far = (groups.get(key, _UNCHANGED) for key in keys)
        single = np.clip(sidebands.get(gear, [near[0]] * 4), -LARGEST_DB, LARGEST_DB)
        turns = *single[:3], single[3:].mean(), gear in sidebands
        beside = near[0], near[2], far[0], far[2], *turns
        rows.append([*mesh, *beside, *_shape(energies.get(gear, still))])
    own = np.array(rows, dtype=np.float64)
    # for contrast, "mate_near_db" to "elsewhere_mesh_db": the most that other gears show
    stage, shaft = np.array([(gear[0], shafts.get(gear, 0)) for gear in ranked]).T
    others, mates = ~np.eye(len(ranked), dtype=bool), stage[:, None] == stage
    coupled = ~mates & (shaft[:, None] == shaft) & (shaft > 0)
    names = ("near_db", "far_db", "peak_db", "near_db", "mesh_rms_db")
    among = np.stack([mates & others, mates & others, others, coupled, ~mates])
    column = own[:, [NAMES.index(name) for name in names]].T
    shown = np.where(among, column[:, None], -np.inf).max(axis=2).T
    overall = np.full(len(own), np.sqrt(np.mean((moved_db if len(moved_db) else still) ** 2)))
    values = np.column_stack([own, np.where(np.isfinite(shown), shown, 0.0), overall])
    told = (dict(zip(NAMES, row, strict=True)) for row in values.tolist())
    return dict(zip(ranked, told, strict=True))


def _grouped(
    changes: Sequence[Change], moved_db: FloatArray
) -> dict[tuple[str, int, str], tuple[float, float, float, float]]:
    """Condense changes by kind of family, stage and gear, over channels and harmonics.

    To their weighted mean, that of the first harmonic, the slope over log2 of the harmonic (0 where
    there is only one), and their root mean square.
    """
    keys = [(change.kind, change.stage, change.gear) for change in changes]
    every = 1.0 / (np.array([change.scatter_db for change in changes]) ** 2 + 1.0)
    octaves, found = np.log2([change.harmonic for change in changes]), {}
    for key in dict.fromkeys(keys):
        own = [place for place, one in enumerate(keys) if one == key]
        octave, moved, weight = octaves[own], moved_db[own], every[own]
        first = octave == octave.min()
        spread, product = np.cov(octave, moved, aweights=weight, ddof=0)[0]
        slope = product / spread if spread >= 1e-9 else 0.0
        mean, square = (np.average(told, weights=weight) for told in (moved, moved**2))
        lowest = np.average(moved[first], weights=weight[first])
        found[key] = float(mean), float(lowest), float(slope), float(np.sqrt(square))
    return found


_UNCHANGED = (0.0,) * 4


def _shape(energy: FloatArray) -> tuple[float, ...]:
    """Describe how the departure is spread around a turn, by "peak_db" to "turn_twice"."""
    level = np.maximum(np.asarray(energy, dtype=np.float64), 0.0)
    level = level / max(float(level.max(initial=0.0)), np.finfo(float).tiny)
    middle, teeth = float(np.median(level)), len(level)
    excess = np.maximum(level - middle, 0.0)
    total = float(excess.sum())
    if middle <= 0 or total <= 0:
        return (0.0,) * 7
    window = sum(np.roll(excess, -i) for i in range(min(_WINDOW_TEETH, teeth)))
    # the highest values well apart from one another, the highest first; 0 for none
    left, maxima = level.copy(), np.zeros(_MOST_PEAKS)
    apart = max(_APART, round(_APART_SHARE * teeth))
    for number in range(_MOST_PEAKS):
        place = int(left.argmax())
        maxima[number] = left[place]
        left[(place + np.arange(1 - apart, apart)) % teeth] = 0.0
    first, second = maxima[0], maxima[1] or maxima[0]  # a very short turn has no second
    # 60 dB are the most that is told: a median far below it must not divide
    peaks = np.minimum(10 * np.log10(np.array([first, second]) / max(middle, 1e-9)), 60.0)
    # half the highest at least, and what stands out
    least = max(middle + 0.5 * (first - middle), 4.0 * middle)
    turns = np.exp(2j * np.pi * np.outer([1, 2], np.arange(teeth)) / teeth)
    share, spread = np.max(window) / total, np.log2(total**2 / np.sum(excess**2))
    around = np.abs(turns @ excess) / total
    return *peaks, share, spread, np.count_nonzero(maxima >= least), *around


@dataclass(frozen=True, kw_only=True)
class KindJudgement(Result):
    """What kind of fault the evidence is most like.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    stage : int or None
        Stage, from 1; None for "none of these".
    gear : str or None
        Gear; None where the evidence singles out none, as with wear.
    probability : float
        Of the kind, given the evidence: calibrated on simulated machines if a classifier judged.
    probabilities : mapping of str to float
        Of every kind.
    method : {"rules", "classifier"}
        Who judged.
    evidence : tuple of str
        Sentences with the numbers that the judgement rests on.
    """

    kind: str
    stage: int | None
    gear: str | None
    probability: float
    probabilities: Mapping[str, float]
    method: str
    evidence: tuple[str, ...]


def judge_kind(
    features: GearFeatures,
    classifier: KindClassifier | None = None,
    *,
    gear: _Gear | None = None,
    spread: DepartureSpread | None = None,
) -> KindJudgement:
    """Judge the kind of a fault.

    Parameters
    ----------
    features : dict of (int, str) to dict
        See `kind_features`.
    classifier : KindClassifier, optional
        Trained by `fault_types.training.train_kinds` on this machine; by default the rules judge.
    gear : (int, str), optional
        One of `features` that was found damaged by other means; by default the gear with the most
        evidence.
    spread : DepartureSpread, optional
        How far the departure of that gear is one tooth's; the rules then rest on it. A classifier
        has not seen such numbers and passes over it.

    Returns
    -------
    KindJudgement

    Raises
    ------
    ArgumentError
        If the classifier was trained on other features.
    """
    stage, name = gear = gear or focus_of(features)
    row = features[gear]
    if classifier is None:
        probabilities = rule_probabilities(row, spread)
    else:
        if classifier.n_features_in_ != len(row):
            raise ArgumentError(
                f"the classifier was trained on {classifier.n_features_in_} features, not on "
                f"{len(row)}; train it anew"
            )
        shares = classifier.predict_proba([[*row.values()]])[0].tolist()
        probabilities = dict(zip(map(str, classifier.classes_.tolist()), shares, strict=True))
    kind = max(probabilities, key=lambda name: probabilities[name])
    return KindJudgement(
        kind=kind,
        stage=None if kind == NONE else stage,
        gear=None if kind in (*_OF_A_MESH, NONE) else name or None,
        probability=probabilities[kind],
        probabilities=probabilities,
        method="rules" if classifier is None else "classifier",
        evidence=_evidence(kind, gear, row),
    )


def rule_probabilities(
    row: Mapping[str, float], spread: DepartureSpread | None = None
) -> dict[str, float]:
    """Weigh the kinds by rules.

    Parameters
    ----------
    row : mapping of str to float
        One row of features by name.
    spread : DepartureSpread, optional
        How far the departure of this gear is that of one tooth, see `several_teeth`.

    Returns
    -------
    dict of str to float
        Of every kind of `KINDS`; they sum to 1.
    """
    far, once = row["far_db"], row["once_db"]
    twice, thrice, several = row["twice_db"], row["thrice_db"], row["several_db"]
    if row["turns_known"] <= 0:
        # where single sidebands are not known the nearest are taken to lead, the rest to follow
        twice, thrice, several = row["near_db"] - 3.0, far, far
    peak, alone = row["peak_db"] - USUAL_PEAK_DB, row["peaks"] <= 1
    if spread is None:
        event = min(max(peak, 0.0), _SURE_DB)
        # in a short turn two teeth are a large share: spread over half of the teeth is no event
        wide = 2.0 * max(row["teeth_involved"] - 3.0, 0.0)
        one_tooth = min(peak, _SURE_DB) - (0.0 if alone else 5.0) - 2.0 * wide
        teeth = min(peak, _SURE_DB) - (5.0 if alone else 0.0) - wide
    else:
        # it is known by other means how far one tooth is the cause
        one, event, wide = min(max(spread.one_tooth, 1e-9), 1.0 - 1e-9), 0.0, 0.0
        odds_db = 10.0 * float(np.log10(one / (1.0 - one)))
        share = spread.teeth_involved / len(spread.by_tooth)
        one_tooth = float(np.clip(odds_db, -_SURE_DB, _SURE_DB))
        teeth = min(-odds_db, 6.0) + 2.0 * min(peak, 5.0) + 16.0 * (0.5 - share)
    pitted = far - USUAL_DB
    # what changes smoothly over the turn does not reach the farther lines
    rough = _ROUGH * max(pitted, 0.0) + event
    if pitted > 0:
        pitted = min(3.0 * pitted, _SURE_DB) - event + wide
    lasting = max(several - max(once - _DECAY_DB, 0.0), 0.0)
    loose = min(twice, thrice, several) - 0.7 * max(far, 0.0) + 0.3 * max(row["shaft_near_db"], 0.0)
    unworn = max(once, twice, far, several, 0.0) + event
    # what speaks for each less what it leaves unexplained [dB]
    weights = {
        "tooth damage": one_tooth,
        "several teeth": teeth,
        "distributed pitting": pitted,
        "wear": row["mesh_rms_db"] - USUAL_DB - unworn,
        "eccentricity": once - USUAL_DB - 1.5 * lasting - rough - max(twice - once + 3.0, 0.0),
        "misalignment": twice - USUAL_DB - max(once, thrice, 0.0) - rough,
        "looseness": loose - USUAL_DB,
        NONE: 0.0,
    }
    shares = softmax(np.array([weights[kind] for kind in KINDS]) / _SOFTNESS_DB)
    return dict(zip(KINDS, shares.tolist(), strict=True))


def _evidence(kind: str, gear: tuple[int, str], row: Mapping[str, float]) -> tuple[str, ...]:
    """Return the numbers that matter for a kind, in words."""
    stage, name = gear
    whose = f"the {name} of stage {stage}" if name else f"stage {stage}"
    teeth = 2 ** row["teeth_involved"]
    event = (
        f"the departure around the turn of {whose} is {row['peak_db']:.1f} dB above its median at "
        f"its highest, {100 * row['top_share']:.0f} % of the excess within four teeth "
        f"({row['peaks']:.0f} separate peaks, {teeth:.1f} teeth involved)"
    )
    sides = (
        f"sidebands of {whose} changed by {row['once_db']:+.1f} dB one turn away from the mesh "
        f"harmonics, {row['twice_db']:+.1f} dB two turns, {row['several_db']:+.1f} dB four to six "
        f"turns, {row['far_db']:+.1f} dB farther away"
    )
    mesh = (
        f"mesh harmonics of stage {stage} changed by {row['mesh_db']:+.1f} dB in the mean and by "
        f"{row['mesh_slope_db']:+.1f} dB per octave"
    )
    shaft = row["shaft_near_db"]
    both = f"gears of other stages on the same shaft: sidebands changed by {shaft:+.1f} dB"
    askew = (
        f"what changes once a turn of {whose} may also be a gear that stands askew on its shaft: "
        "measure runout and face of the gear"
    )
    told = {
        "tooth damage": (event, sides),
        "several teeth": (event, sides),
        "distributed pitting": (sides, event),
        "wear": (mesh, sides),
        "eccentricity": (sides, askew),
        "misalignment": (sides, mesh),
        "looseness": (sides, both),
    }
    return told.get(kind, (sides, event, mesh))


def kind_of_analysis(
    analysis: Analysis, reference: Reference, classifier: KindClassifier | None = None
) -> KindJudgement | None:
    """Judge the kind of the fault that an analysis called.

    Parameters
    ----------
    analysis : Analysis
        Of a recording against the reference.
    reference : Reference
        The same reference.
    classifier : KindClassifier, optional
        Trained on the machine, see `train_kinds`; by default the rules judge.

    Returns
    -------
    KindJudgement or None
        Of the gear that was flagged first, else of the one that changed most. None where no fault
        was called: what a sound machine is most like is no finding; and where no gear was compared.

    Raises
    ------
    ArgumentError
        If the classifier was trained on other features.
    """
    if analysis.verdict != "fault" or not (analysis.changes or analysis.profiles):
        return None
    features = analysis_features(analysis, reference)
    flagged = [(flag.stage, flag.gear) for flag in analysis.flags]
    first = min((gear for gear in features if gear in flagged), key=flagged.index, default=None)
    return judge_kind(features, classifier, gear=first)


def analysis_features(analysis: Analysis, reference: Reference | None) -> GearFeatures:
    """Condense an analysis to what a kind is judged by.

    Parameters
    ----------
    analysis : Analysis
        Of a recording against a reference.
    reference : Reference or None
        The same reference; without it single sidebands are not compared.

    Returns
    -------
    dict of (int, str) to dict
        See `kind_features`.

    Raises
    ------
    ArgumentError
        If no gear was compared.
    """
    energies = {(own.stage, own.gear): own.energy for own in analysis.profiles}
    if reference is None:
        return kind_features(analysis.changes, energies)
    known, rows = reference.shared_with(analysis.signature)
    wheels = Profile.of(analysis.signature).part(rows).wheels
    sidebands = turn_changes(wheels, [profile.wheels for profile in known.profiles])
    # the law leaves nothing of a sound machine; of a fault, what the training saw
    if analysis.verdict == "fault":
        energies = {}
        for wheel in wheels:
            same = (one for p in known.profiles if (one := wheel.same_in(p.wheels)))
            pairs = [aligned(wheel, one) for one in same]
            found = [departure_energy(new, old) for new, old in pairs if len(new.number)]
            if found:
                energies[wheel.stage, wheel.gear] = np.mean(found, axis=0)
    return kind_features(analysis.changes, energies, sidebands)


def features(
    analyses: Analysis | Sequence[Analysis], reference: Reference | None = None
) -> pd.DataFrame:
    """Return what a fault is judged by, as a frame that estimators of scikit-learn take.

    Parameters
    ----------
    analyses : Analysis, or sequence of Analysis
        Of one or several recordings, each compared with a reference.
    reference : Reference, optional
        The same reference; without it single sidebands are not compared, and mean levels of
        sidebands stand in for them.

    Returns
    -------
    pandas.DataFrame, shape (gears, 26)
        A row a gear of each recording, told by the index (`recording`, `stage`, `gear`). All
        columns are finite numbers: changes against the healthy machine [dB], shares from 0 to 1 and
        counts; see `gearmon.diagnosis.fault_types.FEATURES`.

    Raises
    ------
    ArgumentError
        If a recording was compared with nothing.

    Examples
    --------
    >>> frame = gearmon.features(analysis, reference)
    >>> [gear for _, _, gear in frame.index], frame.shape[1]
    (['gear', 'pinion'], 26)
    """
    import pandas as pd  # slow to load, and no verdict needs it

    several = [analyses] if isinstance(analyses, Analysis) else analyses
    check_type("analyses", several, Iterable, "what gearmon.analyse returns, or several of it")
    index, rows = [], list[dict[str, float]]()
    for analysis in several:
        check_type("analyses", analysis, Analysis, "what gearmon.analyse returns")
        found = analysis_features(analysis, reference)
        index += [(analysis.recording, *gear) for gear in found]
        rows += found.values()
    if not rows:
        raise ArgumentError("analyses: none is given; features need at least one")
    names = ["recording", "stage", "gear"]
    return pd.DataFrame(rows, index=pd.MultiIndex.from_tuples(index, names=names))
