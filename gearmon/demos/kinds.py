"""Pitting, wear and eccentricity of the same pinion, told apart by what they do to the lines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gearmon.demos import Demo, Steps, conveyor, conveyor_recording, learned, told
from gearmon.diagnosis.analysis import analyse
from gearmon.diagnosis.fault_types.judgement import analysis_features
from gearmon.diagnosis.fault_types.training import train_kinds
from gearmon.diagnosis.hypotheses.fault_kinds import judge_kind
from gearmon.diagnosis.results import Analysis
from gearmon.report.analysis_plots import kind_figure
from gearmon.report.wording import percent, table_lines
from gearmon.signatures.measured.reference import Reference
from gearmon.terminal import Progress

if TYPE_CHECKING:
    import pandas as pd

    from gearmon.diagnosis.fault_types.classifier import KindClassifier

HEALTHY_LOADS = (0.7, 0.85, 1.0, 1.1)
NEW_LOADS = (0.78, 0.93, 1.04)
PITTED, PIT_LOSS = 14, (0.1, 0.5)
#: Examples that the classifier is trained on.
EXAMPLES = 1200


def _pits() -> list[str]:
    """Pits on most teeth of the pinion: each takes its share of the stiffness about the pitch."""
    generator = np.random.default_rng(3)
    teeth = generator.choice(23, PITTED, replace=False) + 1
    losses = generator.uniform(*PIT_LOSS, PITTED)
    return [f"pitting:1:pinion:{t}:{x:.6f}" for t, x in zip(teeth, losses, strict=True)]


#: Faults of the pinion by the name of what is wrong, and what that is.
STATES = {
    "sound": ([], "nothing is wrong"),
    "distributed pitting": (
        _pits(),
        f"pits on {PITTED} of 23 teeth that take {PIT_LOSS[0]:.0%} to {PIT_LOSS[1]:.0%} of the "
        "stiffness about the pitch point",
    ),
    "wear": (["profile:1:pinion:all:12um"], "all flanks worn by 12 µm at tip and root"),
    "eccentricity": (["eccentricity:1:pinion:all:40um"], "its centre is off by another 40 µm"),
}
#: What is drawn of each recording.
FEATURES = {
    "mesh_rms_db": "mesh\nharmonics",
    "once_db": "sidebands\n1 turn away",
    "twice_db": "2 turns",
    "several_db": "4 to 6\nturns",
    "far_db": "farther\naway",
    "peak_db": "highest place\nof the turn",
}


def kinds_demo(folder: Path, progress: Progress | None = None) -> Demo:
    """Record a machine sound, pitted, worn and running out, and tell these apart.

    Parameters
    ----------
    folder : Path
        Where to write; it exists.
    progress : callable, optional
        Called with the share done, 0 to 1.
    """
    machine = conveyor(folder)
    steps = Steps(progress, len(HEALTHY_LOADS) + 1 + len(STATES) * len(NEW_LOADS))
    healthy = [
        conveyor_recording(machine, f"{load:.0%} load", 100 + number, load=load)
        for number, load in enumerate(steps.through(HEALTHY_LOADS))
    ]
    reference = learned(machine, healthy, folder)
    (classifier,) = (train_kinds(machine, count=count) for count in steps.through([EXAMPLES]))
    judged: list[dict[str, Any]] = []
    for truth, load in steps.through(product(STATES, NEW_LOADS)):
        faults, name = STATES[truth][0], f"{load:.0%} load"
        recording = conveyor_recording(machine, name, len(judged), faults, load=load)
        own = _judged(analyse(recording, machine, reference), reference, classifier)
        judged.append({"truth": truth, "load": load} | own)
    right = sum(one["told"] == one["truth"] for one in judged)
    facts = {"right": right, "recordings": judged}
    changes = dict(_changes(truth, judged) for truth in STATES)
    return told(folder, "kinds", kind_figure(changes), _story(judged, right), facts)


def _judged(analysis: Analysis, reference: Reference, classifier: KindClassifier) -> dict[str, Any]:
    """Tell what is made of a recording; the kind is asked for only where a fault is called."""
    features = analysis_features(analysis, reference)
    row = features.named(features.row(1, "pinion"))
    kind = judge_kind(features, classifier) if analysis.verdict == "fault" else None
    words = {"healthy": "sound", "fault": kind.kind if kind else ""}
    return {
        "told": words.get(analysis.verdict, analysis.verdict),
        "features_db": {name: float(row[name]) for name in FEATURES},
        "kind": None if kind is None else kind.to_dict(),
        "analysis": analysis.to_dict(),
    }


def _story(judged: Sequence[dict[str, Any]], right: int) -> Iterator[str]:
    """Tell the story."""
    yield (
        f"The pinion of a conveyor drive in {len(STATES)} states, {len(NEW_LOADS)} recordings "
        "of each, at loads that the reference was not learned at."
    )
    yield (
        "The kind is judged where a fault is called, by a classifier trained on simulated "
        "signatures of this machine file: it has seen no recording."
    )
    yield from ("", *(f"{truth}: {what}" for truth, (_, what) in STATES.items()), "")
    yield from table_lines([_row(one) for one in judged])
    yield from ("", f"Right: {right} of {len(judged)}.")
    for truth in STATES:
        for one in [one for one in judged if one["truth"] == truth and one["kind"]][:1]:
            yield from ("", f"{truth}, at {one['load']:.0%} load: {one['analysis']['reason']}")
            yield from (f"  {sentence}" for sentence in one["kind"]["evidence"])


def _row(one: dict[str, Any]) -> dict[str, Any]:
    kind = one["kind"]
    return {
        "truth": one["truth"],
        "load": percent(one["load"], 0),
        "verdict": one["analysis"]["verdict"],
        "told": one["told"],
        "of": (kind["gear"] or "") if kind else "",
        "share": percent(kind["probability"], 0) if kind else "",
    }


def _changes(truth: str, judged: Sequence[dict[str, Any]]) -> tuple[str, pd.DataFrame]:
    """Return the title of a state and its changes, recordings by features."""
    own = {f"{one['load']:.0%} load": one for one in judged if one["truth"] == truth}
    said = ", ".join(dict.fromkeys(one["told"] for one in own.values()))
    import pandas as pd

    frame = pd.DataFrame({name: one["features_db"] for name, one in own.items()}).T
    return f"Truth: {truth}. Told: {said}.", frame.rename(columns=FEATURES)
