"""Pitting, wear and eccentricity of the same pinion, told apart by what they do to the lines."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gearmon.demos.conveyor import DURATION_S, MACHINE, RATE_HZ
from gearmon.demos.gear_states import State, state_recording
from gearmon.diagnosis.analysis import analyse, learn
from gearmon.diagnosis.fault_types.judgement import analysis_features
from gearmon.diagnosis.fault_types.training import train_kinds
from gearmon.diagnosis.hypotheses.fault_kinds import KindJudgement, judge_kind
from gearmon.diagnosis.results import Analysis
from gearmon.files import write_atomically
from gearmon.gears.faults import Fault
from gearmon.machine import Machine, load_machine
from gearmon.report.demo_plots import KindView, kind_figure
from gearmon.report.plots import save
from gearmon.report.text_tables import table_lines
from gearmon.report.wording import percent
from gearmon.signals.recording import Recording
from gearmon.signatures.measured.reference import Reference, write_reference
from gearmon.simulation import Settings
from gearmon.terminal import Progress

if TYPE_CHECKING:
    from gearmon.diagnosis.fault_types.classifier import KindClassifier

HEALTHY_LOADS = (0.7, 0.85, 1.0, 1.1)
NEW_LOADS = (0.78, 0.93, 1.04)
PITTED, PIT_LOSS = 14, (0.1, 0.5)
#: Examples that the classifier is trained on.
EXAMPLES = 1200


def _pits() -> tuple[Fault, ...]:
    """Pits on most teeth of the pinion: each takes its share of the stiffness about the pitch."""
    generator = np.random.default_rng(3)
    teeth = generator.choice(23, PITTED, replace=False) + 1
    losses = generator.uniform(*PIT_LOSS, PITTED)
    return tuple(
        Fault(kind="pitting", stage=1, gear="pinion", tooth=int(tooth), size=float(loss))
        for tooth, loss in zip(teeth, losses, strict=True)
    )


#: States of the pinion by the name of what is wrong, and what that is.
STATES = {
    "sound": (State(), "nothing is wrong"),
    "distributed pitting": (
        State(faults=_pits()),
        f"pits on {PITTED} of 23 teeth that take {PIT_LOSS[0]:.0%} to {PIT_LOSS[1]:.0%} of the "
        "stiffness about the pitch point",
    ),
    "wear": (State(wear_m=12e-6), "all flanks worn by 12 µm at tip and root"),
    "eccentricity": (State(eccentricity_m=40e-6), "40 µm more runout than by manufacture"),
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Judged:
    """One recording: the truth, and what was made of it.

    Parameters
    ----------
    truth : str
        State of the machine.
    load : float
        Share of the nominal torque.
    analysis : Analysis
    judgement : KindJudgement or None
        Asked only where a fault was called.
    features : dict of str to float
        Those of `FEATURES` [dB], of the pinion.
    """

    truth: str
    load: float
    analysis: Analysis
    judgement: KindJudgement | None
    features: dict[str, float]

    @property
    def told(self) -> str:
        """What is said of the machine, in a word or two."""
        if self.analysis.verdict != "fault":
            return "sound" if self.analysis.verdict == "healthy" else self.analysis.verdict
        return self.judgement.kind if self.judgement is not None else "fault"


@dataclass(frozen=True, kw_only=True, eq=False)
class KindsDemo:
    """What the demo did.

    Parameters
    ----------
    folder : Path
        Where its files are.
    judged : tuple of Judged
    picture, story : Path
    """

    folder: Path
    judged: tuple[Judged, ...]
    picture: Path
    story: Path

    def lines(self) -> list[str]:
        """Tell it on a terminal."""
        return [
            *self.told(),
            f"machine file and reference: {self.folder}",
            f"picture: {self.picture}",
            f"story: {self.story}",
        ]

    def told(self) -> list[str]:
        """Tell the story."""
        right = sum(one.told == one.truth for one in self.judged)
        told = [
            f"The pinion of a conveyor drive in {len(STATES)} states, {len(NEW_LOADS)} recordings "
            "of each, at loads that the reference was not learned at.",
            "The kind is judged where a fault is called, by a classifier trained on simulated "
            "signatures of this machine file: it has seen no recording.",
            "",
            *(f"{truth}: {what}" for truth, (_, what) in STATES.items()),
            "",
            *table_lines([_row(one) for one in self.judged]),
            "",
            f"Right: {right} of {len(self.judged)}.",
        ]
        for truth in STATES:
            own = [one for one in self.judged if one.truth == truth and one.judgement is not None]
            if own and own[0].judgement is not None:
                told += ["", f"{truth}, at {own[0].load:.0%} load: {own[0].analysis.reason}"]
                told += [f"  {sentence}" for sentence in own[0].judgement.evidence]
        return told

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        return {
            "folder": str(self.folder),
            "picture": str(self.picture),
            "story": str(self.story),
            "right": sum(one.told == one.truth for one in self.judged),
            "recordings": [
                {
                    "truth": one.truth,
                    "told": one.told,
                    "load": one.load,
                    "features_db": one.features,
                    "kind": None if one.judgement is None else one.judgement.to_dict(),
                    "analysis": one.analysis.to_dict(),
                }
                for one in self.judged
            ],
        }


def kinds_demo(folder: Path, progress: Progress | None = None) -> KindsDemo:
    """Record a machine sound, pitted, worn and running out, and tell these apart.

    Parameters
    ----------
    folder : Path
        Where to write; it exists.
    progress : callable, optional
        Called with the share done, 0 to 1.
    """
    write_atomically(folder / "machine.toml", MACHINE)
    machine = load_machine(folder / "machine.toml")
    steps = len(HEALTHY_LOADS) + 12 + len(STATES) * len(NEW_LOADS)
    healthy = []
    for number, load in enumerate(HEALTHY_LOADS):
        healthy.append(_recorded(machine, State(), load, 100 + number))
        _follow(progress, len(healthy) / steps)
    reference = learn(healthy, machine)
    write_reference(reference, folder / "healthy.ref")
    classifier = train_kinds(machine, count=EXAMPLES)
    judged: list[Judged] = []
    for truth, (state, _) in STATES.items():
        for load in NEW_LOADS:
            recording = _recorded(machine, state, load, len(judged))
            analysis = analyse(recording, machine, reference)
            judged.append(_judged(truth, load, analysis, reference, classifier))
            _follow(progress, (len(HEALTHY_LOADS) + 12 + len(judged)) / steps)
    picture, story = folder / "kinds.png", folder / "kinds.txt"
    save(kind_figure([_view(truth, judged) for truth in STATES]), picture)
    demo = KindsDemo(folder=folder, judged=tuple(judged), picture=picture, story=story)
    write_atomically(story, "\n".join(demo.told()) + "\n")
    return demo


def _recorded(machine: Machine, state: State, load: float, seed: int) -> Recording:
    settings = Settings(
        duration_s=DURATION_S,
        sampling_rate_hz=RATE_HZ,
        machine_seed=1,
        recording_seed=seed,
        channels=2,
        load=load,
    )
    return state_recording(machine, settings, state, f"{load:.0%} load")


def _judged(
    truth: str,
    load: float,
    analysis: Analysis,
    reference: Reference,
    classifier: KindClassifier,
) -> Judged:
    features = analysis_features(analysis, reference)
    row = features.named(features.row(1, "pinion"))
    return Judged(
        truth=truth,
        load=load,
        analysis=analysis,
        judgement=judge_kind(features, classifier) if analysis.verdict == "fault" else None,
        features={name: float(row[name]) for name in FEATURES},
    )


def _follow(progress: Progress | None, share: float) -> None:
    if progress is not None:
        progress(share)


def _row(one: Judged) -> dict[str, Any]:
    judgement = one.judgement
    return {
        "truth": one.truth,
        "load": percent(one.load, 0),
        "verdict": one.analysis.verdict,
        "told": one.told,
        "of": "" if judgement is None or judgement.gear is None else judgement.gear,
        "share": "" if judgement is None else percent(judgement.probability, 0),
    }


def _view(truth: str, judged: list[Judged]) -> KindView:
    own = [one for one in judged if one.truth == truth]
    told = ", ".join(dict.fromkeys(one.told for one in own))
    return KindView(
        title=f"Truth: {truth}. Told: {told}.",
        features=tuple(FEATURES.values()),
        names=tuple(f"{one.load:.0%} load" for one in own),
        value_db=np.array([list(one.features.values()) for one in own]),
    )
