"""What an analysis says: value objects that know how to become JSON, and nothing else."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

from gearmon.arrays import FloatArray
from gearmon.diagnosis.nongear import NonGearFinding as ForeignFinding
from gearmon.result import Result
from gearmon.signatures.measured.measurement import MeasuredSignature
from gearmon.signatures.signature import Signature

VERDICTS = ("healthy", "fault", "no mesh found", "cannot tell")


@dataclass(frozen=True, kw_only=True)
class Change(Result):
    """Level of one family of lines in one channel against the healthy reference.

    Parameters
    ----------
    channel : str
        Channel.
    family : str
        The family in words, as "sidebands of shaft 1 around mesh 2 harmonic 1".
    kind : {"mesh", "sidebands", "residual"}
        Kind of the family.
    stage, harmonic : int
        Stage and mesh harmonic, from 1.
    gear : str
        Gear that the spacing belongs to ("" for the mesh itself).
    shaft : int or None
        Shaft that turns at the spacing.
    level_db, reference_db : float
        Measured level, and what the reference makes expect at this load [dB re 1 unit^2].
    scatter_db : float
        Standard deviation of their difference on a healthy machine [dB].
    """

    channel: str
    family: str
    kind: str
    stage: int
    harmonic: int
    gear: str
    shaft: int | None
    level_db: float
    reference_db: float
    scatter_db: float

    @property
    def change_db(self) -> float:
        """Measured less expected level [dB]."""
        return self.level_db - self.reference_db

    @property
    def standardised(self) -> float:
        """The change in standard deviations."""
        return self.change_db / self.scatter_db

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        return super().to_dict() | {"change_db": self.change_db}


@dataclass(frozen=True, kw_only=True, eq=False)
class ToothProfile(Result):
    """Where in the turn of one gear the vibration departs from the reference (or from itself).

    Parameters
    ----------
    stage : int
        Stage, from 1.
    gear : str
        Gear.
    teeth : int
        Teeth.
    order : float
        Rotation of the gear, in turns of shaft 1: gears on one shaft share it.
    energy : ndarray of float, shape (teeth,)
        Energy of the departure in windows of two teeth centred on each tooth, over that beside the
        largest and over what healthy departures let expect at each place; without a reference over
        the median.
    tooth : int or None
        Tooth that stands out, from 1; None where nothing tells which tooth is the first.
    position : float
        The same place in turns of this gear after the recording's own angle zero, in [0, 1).
    ratio : float
        Highest of these.
    log10_probability : float
        Logarithm of the probability that a healthy gear shows as much anywhere in its turn.
    against : {"reference", "other teeth"}
        What was compared with.
    counted_from : {"tacho", "reference"} or None
        Tooth 1 enters mesh at the tachometer pulse, or about where the (first) healthy recording
        begins; None if teeth are not numbered.
    loss_by_tooth, loss_sigma_by_tooth : ndarray of float, shape (teeth,), or None
        Estimated loss of stiffness of each pair, and its standard deviation, in the order of the
        numbers; None without a reference.
    noticed_from : float or None
        Loss of a pair's stiffness from which damage of one tooth would have been noticed; None
        without a reference, or if even the loss of nearly all might not be.
    """

    stage: int
    gear: str
    teeth: int
    order: float
    energy: FloatArray
    tooth: int | None
    position: float
    ratio: float
    log10_probability: float
    against: str
    counted_from: str | None = None
    loss_by_tooth: FloatArray | None = None
    loss_sigma_by_tooth: FloatArray | None = None
    noticed_from: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        left_out = ("order", "energy", "loss_sigma_by_tooth")
        return {name: x for name, x in super().to_dict().items() if name not in left_out}


@dataclass(frozen=True, kw_only=True)
class Flag(Result):
    """One finding that a person should look at.

    Parameters
    ----------
    kind : str
        Of a gear: "tooth damage" (one tooth: crack, breakage, chipping), "several teeth",
        "distributed pitting", "wear", "eccentricity", "misalignment", "looseness", or where no kind
        is clearer than others "changed mesh", "changed sidebands", "changed residual". Of no gear:
        "path changed", "broadband rise", "broadband change", "mesh lost", "bearing", "electrical",
        "unknown lines", and "looseness" heard at half orders.
    stage : int or None
        Stage, from 1.
    gear : str or None
        Gear, where the evidence singles one out.
    tooth : int or None
        Tooth, counted as the evidence tells.
    stiffness_loss, stiffness_loss_low, stiffness_loss_high : float or None
        Estimated loss of the tooth pair's stiffness and its 90 % interval, as fractions; None where
        the recording or the machine file does not bear an estimate.
    false_alarm_probability : float
        Probability of as much evidence on a healthy machine, corrected for all places looked at.
    evidence : tuple of str
        Sentences that can be checked on the pictures.
    """

    kind: str
    stage: int | None = None
    gear: str | None = None
    tooth: int | None = None
    stiffness_loss: float | None = None
    stiffness_loss_low: float | None = None
    stiffness_loss_high: float | None = None
    false_alarm_probability: float
    evidence: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Analysis(Result):
    """The answer for one recording.

    Parameters
    ----------
    recording : str
        The recording.
    machine : str
        Name of the machine.
    verdict : {"healthy", "fault", "no mesh found", "cannot tell"}
        The answer.
    reason : str
        The verdict in one or two sentences.
    score : float
        Orders recordings by the evidence of a fault: -log10 of the probability of the strongest
        test, comparable between tests; 2 and more is a fault.
    false_alarm_probability : float
        Probability of as much evidence on a healthy machine.
    compared_with : {"reference", "expected signature", "nothing"}
        What the recording was held against.
    signature : MeasuredSignature
        What was measured.
    indicators : dict
        Condition indicators: name -> channel -> value.
    changes : tuple of Change
        Every family of lines in every channel, if there was a reference.
    profiles : tuple of ToothProfile
        One for each gear whose turn could be resolved.
    flags : tuple of Flag
        Findings, strongest first.
    expected : Signature or None
        The expected signature, where the machine file has the data for it.
    warnings : tuple of str
        What limits the answer.
    foreign : tuple of ForeignFinding
        Lines of no gear that changed, most striking first.

    Examples
    --------
    >>> analysis.headline()[:40]
    'FAULT: Damage of tooth 7 of the pinion o'
    >>> analysis.to_frame()[["verdict", "kind", "stage", "gear", "tooth"]].values.tolist()
    [['fault', 'tooth damage', 1, 'pinion', 7]]
    >>> analysis.to_dict()["flags"][0]["kind"], len(analysis.frame_rows())
    ('tooth damage', 1)
    """

    picture = "analysis_plots.analysis_pictures"

    recording: str
    machine: str
    verdict: str
    reason: str
    score: float
    false_alarm_probability: float
    compared_with: str
    signature: MeasuredSignature
    indicators: dict[str, dict[str, float]] = field(default_factory=dict)
    changes: tuple[Change, ...] = ()
    profiles: tuple[ToothProfile, ...] = ()
    flags: tuple[Flag, ...] = ()
    expected: Signature | None = None
    warnings: tuple[str, ...]
    foreign: tuple[ForeignFinding, ...] = ()

    def headline(self) -> str:
        """Return the verdict and why."""
        return f"{self.verdict.upper()}: {self.reason}"

    def frame_rows(self) -> list[dict[str, Any]]:
        """Return a row a flag, or one without any: frames of several analyses can be joined."""
        whole = {"recording": self.recording, "verdict": self.verdict, "score": self.score}
        none = dict.fromkeys(field.name for field in fields(Flag) if field.name != "evidence")
        flags: list[dict[str, Any]] = [flag.to_dict() for flag in self.flags]
        return [whole | {name: own[name] for name in none} for own in flags or [none]]

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON: the contract of `gearmon analyse --json`."""
        signature = self.signature
        names: tuple[str, ...] = ("recording", "machine", "verdict", "reason", "score")
        names += ("false_alarm_probability", "compared_with")
        return {name: getattr(self, name) for name in names} | {
            "channels": list(signature.channel_names),
            "sampling_rate_hz": signature.sampling_rate_hz,
            "duration_s": signature.duration_s,
            "speed": signature.speed.to_dict(),
            "mesh": [mesh.to_dict() for mesh in signature.meshes],
            "indicators": self.indicators,
            "flags": [flag.to_dict() for flag in self.flags],
            "changes": [change.to_dict() for change in self.changes],
            "teeth": [profile.to_dict() for profile in self.profiles],
            "lines_of_no_gear": [finding.to_dict() for finding in self.foreign],
            "warnings": list(self.warnings),
        }
