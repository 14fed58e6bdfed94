"""The kind of a fault that an analysis called, by rules or by a trained classifier."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from gearmon.diagnosis.fault_types.features import (
    NAMES,
    FeatureVector,
    TurnEnergy,
    kind_features,
)
from gearmon.diagnosis.hypotheses.fault_kinds import KindJudgement, judge_kind
from gearmon.diagnosis.hypotheses.own_teeth import aligned, departure_energy
from gearmon.diagnosis.hypotheses.runout import turn_changes
from gearmon.diagnosis.law.machine import same_gear
from gearmon.diagnosis.results import Analysis, ToothProfile
from gearmon.errors import ArgumentError, check_type
from gearmon.signatures.measured.reference import Profile, Reference, WheelPattern

if TYPE_CHECKING:
    import pandas as pd

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
    rows = [names.index(name) for name in shared]
    theirs = [reference.channel_names.index(name) for name in shared]
    wheels = Profile.of(analysis.signature).wheels
    turns = turn_changes(wheels, rows, [p.wheels for p in reference.profiles], theirs)
    shapes: Sequence[ToothProfile | TurnEnergy] = analysis.profiles
    if analysis.verdict == "fault":
        # the law leaves nothing of a sound machine; of a fault, what the training saw
        shapes = _shapes(wheels, rows, reference, theirs)
    return kind_features(analysis.changes, shapes, turns)


def _shapes(
    wheels: Sequence[WheelPattern],
    rows: Sequence[int],
    reference: Reference,
    theirs: Sequence[int],
) -> list[TurnEnergy]:
    """Energy of the departure around every gear, found as in the examples of the training."""
    found = []
    for wheel in wheels:
        healthy = [one for p in reference.profiles if (one := same_gear(wheel, p))]
        pairs = [aligned(wheel, rows, one, theirs) for one in healthy]
        energies = [departure_energy(new, old) for new, old in pairs if len(new.number)]
        if energies:
            found.append(TurnEnergy(wheel.stage, wheel.gear, np.mean(energies, axis=0)))
    return found


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
