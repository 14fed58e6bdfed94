"""The kind of a fault, judged by physical rules or by a trained classifier, with its reasons.

The rules need no training. Each weighs, in decibels, what speaks for a kind against what it cannot
explain: one tooth is a short event, eccentricity ends after the first sideband, wear leaves the
sidebands alone. Their probabilities order the kinds; only a trained classifier's are calibrated.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gearmon.diagnosis.fault_types.features import (
    KINDS,
    NAMES,
    NONE,
    FeatureVector,
    TurnEnergy,
    kind_features,
)
from gearmon.diagnosis.hypotheses.own_teeth import aligned, departure_energy
from gearmon.diagnosis.hypotheses.runout import turn_changes
from gearmon.diagnosis.results import Analysis
from gearmon.errors import ArgumentError, check_type
from gearmon.result import Result
from gearmon.signatures.measured.reference import Profile, Reference

if TYPE_CHECKING:
    import pandas as pd

    from gearmon.diagnosis.fault_types.classifier import KindClassifier
    from gearmon.diagnosis.hypotheses.several_teeth import DepartureSpread

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


@dataclass(frozen=True, kw_only=True)
class KindJudgement(Result):
    """What kind of fault the evidence is most like.

    Parameters
    ----------
    kind : str
        One of `features.KINDS`.
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
    features: FeatureVector,
    classifier: KindClassifier | None = None,
    *,
    stage: int | None = None,
    gear: str | None = None,
    spread: DepartureSpread | None = None,
) -> KindJudgement:
    """Judge the kind of a fault.

    Parameters
    ----------
    features : FeatureVector
        See `fault_types.features.kind_features`.
    classifier : KindClassifier, optional
        Trained by `fault_types.training.train_kinds` on this machine; by default the rules judge.
    stage, gear : int, str, optional
        Gear that was found damaged by other means; by default the one with the most evidence.
    spread : DepartureSpread, optional
        How far the departure of that gear is one tooth's; the rules then rest on it. A classifier
        has not seen such numbers and passes over it.

    Returns
    -------
    KindJudgement

    Raises
    ------
    ArgumentError
        If that gear was not looked at, or the classifier was trained on other features.
    """
    row = features.row(stage, gear)
    if classifier is None:
        probabilities = rule_probabilities(features.named(row), spread)
    else:
        values = features.values[row : row + 1]
        if classifier.n_features_in_ != values.shape[1]:
            raise ArgumentError(
                f"the classifier was trained on {classifier.n_features_in_} features, not on "
                f"{values.shape[1]}; train it anew"
            )
        shares = classifier.predict_proba(values)[0].tolist()
        probabilities = dict(zip(map(str, classifier.classes_.tolist()), shares, strict=True))
    kind = max(probabilities, key=lambda name: probabilities[name])
    own_stage, own_gear = features.gears[row]
    single = own_gear if own_gear and kind not in (*_OF_A_MESH, NONE) else None
    return KindJudgement(
        kind=kind,
        stage=None if kind == NONE else own_stage,
        gear=single,
        probability=probabilities[kind],
        probabilities=probabilities,
        method="rules" if classifier is None else "classifier",
        evidence=_evidence(kind, features.gears[row], features.named(row)),
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
    weights = _of_teeth(row, spread) | _of_lines(row, spread is not None)
    values = np.array([weights[kind] for kind in KINDS]) / _SOFTNESS_DB
    shares = np.exp(values - values.max())
    return dict(zip(KINDS, (shares / shares.sum()).tolist(), strict=True))


def _of_teeth(row: Mapping[str, float], spread: DepartureSpread | None) -> dict[str, float]:
    """Return what speaks for damage of one tooth, and of several [dB]."""
    if spread is None:
        peak = min(row["peak_db"] - USUAL_PEAK_DB, 12.0)
        # in a short turn two teeth are a large share: spread over half of the teeth is no event
        wide = 4.0 * max(row["teeth_involved"] - 3.0, 0.0)
        alone = row["peaks"] <= 1
        return {
            "tooth damage": peak - (0.0 if alone else 5.0) - wide,
            "several teeth": peak - (5.0 if alone else 0.0) - 0.5 * wide,
        }
    one = min(max(spread.one_tooth, 1e-9), 1.0 - 1e-9)
    odds_db = 10.0 * float(np.log10(one / (1.0 - one)))
    share = spread.teeth_involved / len(spread.by_tooth)
    height = min(row["peak_db"] - USUAL_PEAK_DB, 5.0)
    return {
        "tooth damage": float(np.clip(odds_db, -_SURE_DB, _SURE_DB)),
        "several teeth": min(-odds_db, 6.0) + 2.0 * height + 16.0 * (0.5 - share),
    }


def _of_lines(row: Mapping[str, float], seen: bool) -> dict[str, float]:
    """Return for other kinds what speaks for each less what it leaves unexplained [dB].

    Parameters
    ----------
    row : mapping of str to float
    seen : bool
        Whether it is known by other means how far one tooth is the cause.
    """
    far, once = row["far_db"], row["once_db"]
    if row["turns_known"] > 0:
        twice, thrice, several = row["twice_db"], row["thrice_db"], row["several_db"]
    else:
        # where single sidebands are not known the nearest are taken to lead, the rest to follow
        twice, thrice, several = row["near_db"] - 3.0, far, far
    event = wide = 0.0
    if not seen:
        event = min(max(row["peak_db"] - USUAL_PEAK_DB, 0.0), _SURE_DB)
        wide = 2.0 * max(row["teeth_involved"] - 3.0, 0.0)
    pitted = far - USUAL_DB
    # what changes smoothly over the turn does not reach the farther lines
    rough = _ROUGH * max(pitted, 0.0) + event
    if pitted > 0:
        pitted = min(3.0 * pitted, _SURE_DB) - event + wide
    lasting = max(several - max(once - _DECAY_DB, 0.0), 0.0)
    loose = min(twice, thrice, several) - 0.7 * max(far, 0.0) + 0.3 * max(row["shaft_near_db"], 0.0)
    unworn = max(once, twice, far, several, 0.0) + event
    return {
        "distributed pitting": pitted,
        "wear": row["mesh_rms_db"] - USUAL_DB - unworn,
        "eccentricity": once - USUAL_DB - 1.5 * lasting - rough - max(twice - once + 3.0, 0.0),
        "misalignment": twice - USUAL_DB - max(once, thrice, 0.0) - rough,
        "looseness": loose - USUAL_DB,
        NONE: 0.0,
    }


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
    stage, gear = next((own for own in flagged if own in features.gears), (None, None))
    return judge_kind(features, classifier, stage=stage, gear=gear)


def analysis_features(analysis: Analysis, reference: Reference) -> FeatureVector:
    """Condense an analysis to what a kind is judged by.

    Parameters
    ----------
    analysis : Analysis
        Of a recording against the reference.
    reference : Reference
        The same reference.

    Returns
    -------
    FeatureVector

    Raises
    ------
    ArgumentError
        If no gear was compared.
    """
    known, rows = reference.shared_with(analysis.signature)
    wheels = Profile.of(analysis.signature).part(rows).wheels
    turns = turn_changes(wheels, [profile.wheels for profile in known.profiles])
    if analysis.verdict != "fault":
        return kind_features(analysis.changes, analysis.profiles, turns)
    # the law leaves nothing of a sound machine; of a fault, what the training saw
    shapes = []
    for wheel in wheels:
        healthy = [one for p in known.profiles if (one := wheel.same_in(p.wheels))]
        pairs = [aligned(wheel, one) for one in healthy]
        energies = [departure_energy(new, old) for new, old in pairs if len(new.number)]
        if energies:
            shapes.append(TurnEnergy(wheel.stage, wheel.gear, np.mean(energies, axis=0)))
    return kind_features(analysis.changes, shapes, turns)


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
        counts; see `gearmon.diagnosis.fault_types.features.FEATURES`.

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
    frames = []
    for analysis in several:
        check_type("analyses", analysis, Analysis, "what gearmon.analyse returns")
        found = (
            kind_features(analysis.changes, analysis.profiles)
            if reference is None
            else analysis_features(analysis, reference)
        )
        rows = [(analysis.recording, stage, gear) for stage, gear in found.gears]
        index = pd.MultiIndex.from_tuples(rows, names=["recording", "stage", "gear"])
        frames.append(pd.DataFrame(found.values, index=index, columns=list(NAMES)))
    if not frames:
        raise ArgumentError("analyses: none is given; features need at least one")
    return pd.concat(frames)
