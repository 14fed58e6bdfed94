"""The kind of a fault that an analysis called, by rules or by a trained classifier."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gearmon.diagnosis.fault_types.features import FeatureVector, kind_features
from gearmon.diagnosis.hypotheses.fault_kinds import KindJudgement, judge_kind
from gearmon.diagnosis.hypotheses.runout import turn_changes
from gearmon.diagnosis.results import Analysis
from gearmon.signatures.reference import Profile, Reference

if TYPE_CHECKING:
    from gearmon.diagnosis.fault_types.classifier import KindClassifier


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
    names = analysis.signature.channel_names
    shared = [name for name in names if name in reference.channel_names]
    turns = turn_changes(
        Profile.of(analysis.signature).wheels,
        [names.index(name) for name in shared],
        [profile.wheels for profile in reference.profiles],
        [reference.channel_names.index(name) for name in shared],
    )
    return kind_features(analysis.changes, analysis.profiles, turns)
