"""Pitting, wear and eccentricity of the same pinion, told apart by what they do to the lines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gearmon.demos import Demo, Steps, told
from gearmon.demos.conveyor import DURATION_S, RATE_HZ, conveyor, learned
from gearmon.diagnosis.analysis import analyse
from gearmon.diagnosis.fault_types.judgement import analysis_features
from gearmon.diagnosis.fault_types.training import train_kinds
from gearmon.diagnosis.hypotheses.fault_kinds import judge_kind
from gearmon.diagnosis.results import Analysis
from gearmon.gears.faults import Fault
from gearmon.machine import Machine
from gearmon.report.analysis_plots import kind_figure
from gearmon.report.wording import percent, table_lines
from gearmon.signals.recording import Recording
from gearmon.signatures.measured.reference import Reference
from gearmon.simulation import Settings
from gearmon.simulation.contact import Drive, ShaftMotion, random_wander
from gearmon.simulation.settings import stream
from gearmon.simulation.train import Train, build_train
from gearmon.simulation.vibration import (
    mesh_vibration,
    noise,
    random_path,
    tacho_pulses,
    through_path,
)
from gearmon.terminal import Progress

if TYPE_CHECKING:
    import pandas as pd

    from gearmon.diagnosis.fault_types.classifier import KindClassifier

FloatArray = NDArray[np.float64]

_TACHO_V, _TACHO_TURNS = 5.0, 0.05
#: Before and after what is kept, for the housing to ring up and down [s].
_MARGIN_S = 0.5
#: Share of the sampling rate up to which harmonics of the wear are made.
_BELOW = 0.4
HEALTHY_LOADS = (0.7, 0.85, 1.0, 1.1)
NEW_LOADS = (0.78, 0.93, 1.04)
PITTED, PIT_LOSS = 14, (0.1, 0.5)
#: Examples that the classifier is trained on.
EXAMPLES = 1200


@dataclass(frozen=True, kw_only=True)
class State:
    """State of the pinion of a one-stage machine.

    Parameters
    ----------
    faults : tuple of Fault
        Losses of stiffness.
    eccentricity_m : float
        Added to the runout amplitude that the pinion has by manufacture [m].
    wear_m : float
        Depth to which the flanks of all teeth are worn at tip and root; nothing is worn at the
        pitch point, where they roll [m].
    """

    faults: tuple[Fault, ...] = ()
    eccentricity_m: float = 0.0
    wear_m: float = 0.0


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
        _recorded(machine, State(), load, 100 + number)
        for number, load in enumerate(steps.through(HEALTHY_LOADS))
    ]
    reference = learned(machine, healthy, folder)
    (classifier,) = (train_kinds(machine, count=count) for count in steps.through([EXAMPLES]))
    judged: list[dict[str, Any]] = []
    for truth, load in steps.through(product(STATES, NEW_LOADS)):
        recording = _recorded(machine, STATES[truth][0], load, len(judged))
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


def _recorded(machine: Machine, state: State, load: float, seed: int) -> Recording:
    """Simulate a one-stage machine whose pinion has a state of its own.

    Notes
    -----
    Stiffness and runout go through the equations of motion. Wear moves all pairs alike, with the
    mesh: an error ``-wear |sin(pi x)|`` of the mesh phase x adds a force through the linear mesh
    with its mean stiffness.
    """
    taken: dict[str, Any] = {"duration_s": DURATION_S, "sampling_rate_hz": RATE_HZ, "load": load}
    settings = Settings(machine_seed=1, recording_seed=seed, channels=2, **taken)
    point = machine.operating[0]
    known: dict[str, Any] = {"load": load, "accuracy_grade": settings.accuracy_grade}
    train = build_train(machine, state.faults, seed=settings.machine_seed, **known)
    train = _running_out(train, state.eccentricity_m)
    motion = ShaftMotion(
        mean_hz=settings.mean_shaft1_hz(point),
        wander=random_wander(settings.speed_drift, stream(seed, "speed")),
        start_turns=float(stream(seed, "start").uniform(0, 1000)),
    )
    drive = Drive(
        motion=motion,
        load=random_wander(settings.load_drift, stream(seed, "load")),
        ripples=(),
        static_forcing=train.static_forcing,
    )
    vibration, _ = mesh_vibration(train, drive, settings, None)
    vibration += _of_wear(train, motion, settings, state.wear_m)
    level = 10 ** (-(settings.snr_db or 0.0) / 20)
    for channel, row in enumerate(vibration):
        generator = stream(seed, "noise", channel)
        row += noise(generator, len(row), level * float(np.std(row)))
    time = np.arange(settings.samples) / settings.sampling_rate_hz
    moved = motion.turns(time), settings.sampling_rate_hz, motion.speed_hz(time)
    pulses = tacho_pulses(*moved, _TACHO_V, _TACHO_TURNS)
    count = len(vibration)
    return Recording(
        samples=np.vstack([vibration, pulses]),
        sampling_rate_hz=settings.sampling_rate_hz,
        channel_names=(*(f"a{channel + 1}" for channel in range(count)), "tacho"),
        channel_kinds=("vibration",) * count + ("tacho",),
        units=("m/s2",) * count + ("V",),
        origin=f"{load:.0%} load",
    )


def _running_out(train: Train, eccentricity_m: float) -> Train:
    """Return the train with more runout of its first pinion."""
    first, *others = train.meshes
    pinion, gear = first.errors
    more = replace(pinion, eccentricity_m=pinion.eccentricity_m + eccentricity_m)
    return replace(train, meshes=(replace(first, errors=(more, gear)), *others))


def _of_wear(train: Train, motion: ShaftMotion, settings: Settings, wear_m: float) -> FloatArray:
    """Accelerations that wear of the flanks adds at the sensors [m/s2]."""
    rate = settings.sampling_rate_hz
    margin = round(_MARGIN_S * rate)
    time = (np.arange(settings.samples + 2 * margin) - margin) / rate
    phase = train.meshes[0].phase(motion.turns(time))
    highest = int(_BELOW * rate / (train.meshes[0].order * float(motion.speed_hz(time).max())))
    error = np.zeros(len(time))
    for k in range(1, highest + 1):
        # |sin(pi x)| = 2/pi - 4/pi sum cos(2 pi k x) / (4 k^2 - 1)
        error += wear_m * 4 / np.pi / (4 * k * k - 1) * np.cos(2 * np.pi * k * phase)
    angular = 2 * np.pi * np.fft.rfftfreq(len(time), 1 / rate)
    mass = 1.0 / train.system.coupling[0, 0]
    spring = train.mean_stiffness[0] + 1j * angular * train.system.damping[0]
    force = spring * mass * angular**2 / (spring - mass * angular**2) * np.fft.rfft(error)
    path = random_path(settings.machine_seed, settings.channels, 1, train.gear_mass_kg)
    arrived = through_path(path, force[None, :], len(time), rate)
    return np.asarray(arrived[:, margin : margin + settings.samples])
