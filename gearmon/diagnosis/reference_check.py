"""What a reference is good for: loads and speeds it covers, odd recordings, what it would find."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gearmon.diagnosis.evidence import LIMITS, Evidence, noticed_from
from gearmon.diagnosis.hypotheses.tooth_damage import find_tooth
from gearmon.diagnosis.law.gear_lines import LENGTH
from gearmon.diagnosis.law.machine import HealthyMachine
from gearmon.errors import check_type
from gearmon.machine import MachineLike, load_machine
from gearmon.result import Result
from gearmon.signatures.measured.reference import Reference, machine_notes, read_reference

#: Loads less than this factor apart count as one.
ONE_LOAD = 1.25


@dataclass(frozen=True, kw_only=True)
class CheckedRecording:
    """One recording of a reference, held against the others.

    Parameters
    ----------
    recording : str
    duration_s : float
        Length [s].
    speed_hz : float
        Speed of shaft 1 [Hz].
    relative_load : float
        Load as heard at the meshes, over that of the first recording.
    strength : float or None
        Strength of the evidence that this one is not as the others (a fault from 2); None where
        there are fewer than two others.
    """

    recording: str
    duration_s: float
    speed_hz: float
    relative_load: float
    strength: float | None


@dataclass(frozen=True, kw_only=True)
class CheckedGear:
    """What a reference would find on one gear.

    Parameters
    ----------
    stage : int
    gear : str
    noticed_from : float or None
        Loss of the stiffness of one tooth's pair that would be called a fault in the least
        favourable of its recordings; None if even the loss of nearly all might not be.
    """

    stage: int
    gear: str
    noticed_from: float | None


@dataclass(frozen=True, kw_only=True)
class ReferenceCheck(Result):
    """What a reference covers, and what to add to it.

    Parameters
    ----------
    machine : str
    recordings : tuple of CheckedRecording
    gears : tuple of CheckedGear
    advice : tuple of str
        What to do about it, most important first; empty if nothing is amiss.
    """

    machine: str
    recordings: tuple[CheckedRecording, ...]
    gears: tuple[CheckedGear, ...]
    advice: tuple[str, ...]

    def headline(self) -> str:
        """Return the first advice."""
        return self.advice[0] if self.advice else "The reference is good as it is."

    def rows(self) -> list[dict[str, Any]]:
        """Return a row a recording."""
        return [asdict(own) for own in self.recordings]


def check_reference(reference: Reference | str | Path, machine: MachineLike) -> ReferenceCheck:
    """Hold every recording of a reference against the others.

    Parameters
    ----------
    reference : Reference, str or Path
        What `gearmon.learn` returned, or the file that it was stored in.
    machine : Machine, path or dict

    Returns
    -------
    ReferenceCheck
        What the whole reference finds is at least what is said here, of one recording less.

    Raises
    ------
    ArgumentError
        If the reference is of a machine with other gears.

    Examples
    --------
    >>> check = gearmon.check_reference(reference, machine)
    >>> len(check.recordings), [own.gear for own in check.gears]
    (2, ['pinion', 'gear'])
    """
    machine = load_machine(machine)
    if isinstance(reference, str | Path):
        reference = read_reference(reference)
    check_type("reference", reference, Reference, "what gearmon.learn returns, or its file")
    machine_notes(machine, reference)
    loads = np.exp(HealthyMachine(reference, machine).states[:, 0])
    held: list[CheckedRecording] = []
    heard: dict[tuple[int, str], float] = {}
    for number, own in enumerate(reference.profiles):
        others = (*reference.profiles[:number], *reference.profiles[number + 1 :])
        law = HealthyMachine(replace(reference, profiles=others or (own,)), machine)
        deviation = law.deviation(own)
        finding = find_tooth(own, deviation, machine)
        evidence = Evidence(deviation=deviation, finding=finding, references=max(1, len(others)))
        held.append(
            CheckedRecording(
                recording=own.origin,
                duration_s=own.duration_s,
                speed_hz=own.speed_hz,
                relative_load=float(loads[number]),
                strength=float(evidence.strength) if len(others) > 1 else None,
            )
        )
        for gear in evidence.searched:
            # even the loss of all might not be noticed
            heard[gear.key] = max(heard.get(gear.key, 0.0), noticed_from(gear) or 1.0)
    # what was doubtful when it was learned comes first
    gears, advice = list[CheckedGear](), [*reference.notes, *_missing_loads(held)]
    for (stage, name), loss in heard.items():
        told = loss if loss < 1.0 else None
        gears.append(CheckedGear(stage=stage, gear=name, noticed_from=told))
        if loss > LIMITS.must_notice:
            advice.append(
                f"Damage of one tooth of the {name} of stage {stage} might go unnoticed: record "
                "longer, under load, or nearer to it."
            )
    return ReferenceCheck(
        machine=reference.machine, recordings=tuple(held), gears=tuple(gears), advice=tuple(advice)
    )


def _missing_loads(recordings: list[CheckedRecording]) -> list[str]:
    """Say which recording would teach the most."""
    loads = np.sort([own.relative_load for own in recordings])
    if len(loads) == 1:
        return [
            "Add two healthy recordings, one at about half the load: from one recording it cannot "
            "be known how this machine differs from one to the next."
        ]
    if loads[-1] < ONE_LOAD * loads[0]:
        return ["Add a healthy recording at about half the load: all of these are at one."]
    steps = np.log(loads[1:] / loads[:-1])
    if steps.max() > LENGTH:
        between = float(np.sqrt(np.prod(loads[steps.argmax() : steps.argmax() + 2])))
        return [
            f"Add a healthy recording at about {between:.2g} times the load of the first: none "
            "lies near it."
        ]
    return []
