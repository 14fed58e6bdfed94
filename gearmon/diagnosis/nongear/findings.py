"""Findings that are no gear's: new and grown lines, named, with the sentences that tell them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearmon.diagnosis.nongear.changes import LEAST_LOG10, LineChange, line_changes
from gearmon.diagnosis.nongear.names import NamedSeries, name_lines, of_hunting_tooth
from gearmon.gears.kinematics import Kinematics
from gearmon.signatures.measured.measurement import MeasuredSignature
from gearmon.signatures.measured.nongear_lines import NonGearLine, NonGearLines, contaminated, taken
from gearmon.signatures.measured.reference import Reference

FloatArray = NDArray[np.float64]

# Lines that change with such a probability help to name what they belong to.
_STRIKING = 0.05
_SENTENCES = 4


@dataclass(frozen=True, kw_only=True)
class NonGearFinding:
    """Something that changed and is no gear.

    Parameters
    ----------
    kind : {"bearing", "electrical", "looseness", "unknown lines"}
        What it may be.
    name : str
        Which one, as "input: outer race (BPFO)".
    changes : tuple of LineChange
        Its lines, most striking first.
    orders : tuple of float
        Orders at which it may show besides, under the lines of gears too.
    width : float
        Resolution of the spectrum [orders].
    log10_probability : float
        Logarithm of the probability that a healthy machine shows any change as striking.
    evidence : tuple of str
        Sentences that can be checked on the spectrum.
    """

    kind: str
    name: str
    changes: tuple[LineChange, ...]
    orders: tuple[float, ...]
    width: float
    log10_probability: float
    evidence: tuple[str, ...]

    @property
    def lines(self) -> tuple[NonGearLine, ...]:
        """Its lines, most striking first."""
        return tuple(change.line for change in self.changes)

    @property
    def change_db(self) -> float:
        """Largest rise of a line [dB]."""
        return max(change.change_db for change in self.changes)

    @property
    def false_alarm_probability(self) -> float:
        """Probability that a healthy machine shows any change as striking."""
        return float(10.0**self.log10_probability)

    def contaminates(self, orders: FloatArray, resolution: float) -> NDArray[np.bool_]:
        """Tell which orders it disturbs.

        Parameters
        ----------
        orders : ndarray of float
            Orders that are to be measured.
        resolution : float
            Distance at which a line still disturbs [orders]; see
            `gearmon.signatures.measured.nongear_lines.contaminated`.

        Returns
        -------
        ndarray of bool
            Also where its lines stand under those of gears and so cannot be seen.
        """
        mask = contaminated(orders, self.lines, resolution)
        for order in self.orders:
            mask |= np.abs(orders - order) < resolution + self.width
        return mask

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        return {
            "kind": self.kind,
            "name": self.name,
            "orders": [line.order for line in self.lines],
            "frequencies_hz": [line.frequency_hz for line in self.lines],
            "change_db": self.change_db,
            "false_alarm_probability": self.false_alarm_probability,
            "evidence": list(self.evidence),
        }


def nongear_findings(
    signature: MeasuredSignature,
    reference: Reference,
    train: Kinematics,
    gain_db: FloatArray | None = None,
) -> tuple[NonGearFinding, ...]:
    """Compare the lines of no gear of a recording with those of a reference.

    Parameters
    ----------
    signature : MeasuredSignature
        The new recording.
    reference : Reference
        Healthy recordings.
    train : Kinematics
        The machine.
    gain_db : ndarray of float, shape (channels,), optional
        How much louder each shared channel is than in the reference [dB], in the order of the
        recording; by default the median over the gears' families of lines.

    Returns
    -------
    tuple of NonGearFinding
        Most striking first; none if the reference is of a format that holds no lines of no gear.
    """
    shared = [name for name in signature.channel_names if name in reference.channel_names]
    profiles = [p for p in reference.profiles if p.foreign is not None]
    if not shared or not profiles or signature.foreign is None:
        return ()
    rows = [signature.channel_names.index(name) for name in shared]
    theirs = [reference.channel_names.index(name) for name in shared]
    if gain_db is None:
        gain_db = family_gain_db(signature, reference, rows, theirs)
    healthy = [taken(p.foreign, theirs) for p in profiles if p.foreign is not None]
    return compare_lines(taken(signature.foreign, rows), healthy, train, gain_db, shared)


def family_gain_db(
    signature: MeasuredSignature, reference: Reference, rows: Sequence[int], theirs: Sequence[int]
) -> FloatArray:
    """How much louder each channel is than in the reference: median over the families of lines.

    Parameters
    ----------
    signature : MeasuredSignature
        The new recording.
    reference : Reference
        Healthy recordings.
    rows, theirs : sequence of int
        Shared channels in both.

    Returns
    -------
    ndarray of float, shape (shared channels,)
        0 dB where no common family is heard.
    """
    names = [family.name for family in signature.plan.families]
    common = [name for name in reference.family_names if name in names]
    if not common:
        return np.zeros(len(rows))

    def columns(own: Sequence[str]) -> list[int]:
        return [list(own).index(name) for name in common]

    mine, known = columns(names), columns(reference.family_names)
    healthy = reference.level_db.mean(axis=0)[np.ix_(theirs, known)]
    heard = signature.heard[np.ix_(rows, mine)].copy()
    for profile in reference.profiles:
        heard &= profile.heard[np.ix_(theirs, columns(profile.family_names))]
    moved = signature.level_db[np.ix_(rows, mine)] - healthy
    return np.array(
        [np.median(m[h]) if h.any() else 0.0 for m, h in zip(moved, heard, strict=True)]
    )


def compare_lines(
    lines: NonGearLines,
    healthy: Sequence[NonGearLines],
    train: Kinematics,
    gain_db: FloatArray | None = None,
    channel_names: Sequence[str] = (),
) -> tuple[NonGearFinding, ...]:
    """Find the lines that are new or have grown, and say what they may be.

    Parameters
    ----------
    lines : NonGearLines
        Of the new recording.
    healthy : sequence of NonGearLines
        Of healthy recordings of the same channels, at least one.
    train : Kinematics
        The machine with its bearings.
    gain_db : ndarray of float, shape (channels,), optional
        How much louder each channel is than in the healthy recordings [dB]; 0 by default.
    channel_names : sequence of str, optional
        For the evidence.

    Returns
    -------
    tuple of NonGearFinding
        Most striking first. Their probabilities are corrected for all lines looked at.

    Notes
    -----
    The change of a line over its standard deviation follows a t law: between healthy recordings it
    changes by 4 dB (a prior worth fifteen differences, joined by those among the healthy recordings
    themselves), more if the speed differs. Summed over the lines that can change (those at
    multiples of one another have one source and count for fewer), with those that may hide below
    the noise of the healthy recordings (as many so far below what is listed as stand above it,
    which have to come out of the noise first, and two just below it), and plus the peaks of mere
    noise that are as high, it gives the number of such changes to expect of a healthy machine.
    """
    gains = np.zeros(len(lines.in_time_db)) if gain_db is None else np.asarray(gain_db)
    changes = line_changes(lines, healthy, train, gains)
    striking = [change for change in changes if change.log10_probability < np.log10(_STRIKING)]
    grid, findings = lines.grid("spectrum"), []
    for series in name_lines([change.line for change in striking], train, grid.width, grid.top):
        first = striking[min(series.labels)].line
        width = lines.grid(first.kind).width
        if series.kind != "unknown lines" or not of_hunting_tooth(first, train, width):
            findings.append(_finding(series, striking, grid.width, channel_names))
    return tuple(sorted(findings, key=lambda finding: finding.log10_probability))


def _finding(
    series: NamedSeries,
    changes: Sequence[LineChange],
    width: float,
    channel_names: Sequence[str],
) -> NonGearFinding:
    order = sorted(series.labels, key=lambda i: changes[i].log10_probability)
    first = changes[order[0]].log10_probability
    told = order[:_SENTENCES]
    return NonGearFinding(
        kind=series.kind,
        name=series.name,
        changes=tuple(changes[i] for i in order),
        orders=series.orders,
        width=width,
        log10_probability=min(0.0, max(first, LEAST_LOG10)),
        evidence=tuple(_sentence(changes[i], series.labels[i], channel_names) for i in told),
    )


def _sentence(change: LineChange, label: str, channel_names: Sequence[str]) -> str:
    line = change.line
    row = int(np.argmax(line.over_noise_db))
    channel = f"{channel_names[row]}: " if channel_names else ""
    what = "line" if line.kind == "spectrum" else "line in the envelope"
    of = f", {label}" if label else ""
    follows = {
        "shaft": "; it follows the shaft",
        "time": "; it keeps its frequency while the speed wanders",
    }.get(line.locked, "")
    where = f"{line.frequency_hz:.4g} Hz (order {line.order:.4g} of shaft 1{of})"
    if change.new:
        moved = (
            f"is in no healthy recording: {line.over_noise_db[row]:.0f} dB over the noise, "
            f"{change.change_db:.1f} dB over what could have been hidden there"
        )
    else:
        moved = f"rose {change.change_db:.1f} dB; scatter {change.sigma_db:.1f} dB"
    return f"{channel}{what} at {where} {moved}{follows}"


def disturbed(
    orders: FloatArray,
    findings: Sequence[NonGearFinding],
    resolution: float,
    below: float = 0.01,
) -> NDArray[np.bool_]:
    """Tell which orders new or grown lines of no gear disturb.

    Parameters
    ----------
    orders : ndarray of float
        Orders that are to be measured.
    findings : sequence of NonGearFinding
        Of `compare_lines`.
    resolution : float
        Distance at which a line still disturbs [orders].
    below : float
        Findings of a higher false-alarm probability are passed over.

    Returns
    -------
    ndarray of bool
    """
    mask = np.zeros(np.shape(orders), dtype=bool)
    for finding in findings:
        if finding.false_alarm_probability < below:
            mask |= finding.contaminates(orders, resolution)
    return mask
