"""Whether a recording may be held against a reference: where both come from.

A reference remembers machine, sampling rate, units, version and, by a digest of its samples, every
recording. What makes a comparison meaningless is refused; what limits it is said in a sentence.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from gearmon import __version__
from gearmon.errors import ArgumentError
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine, ParallelStage
from gearmon.signals.array_types import FloatArray

if TYPE_CHECKING:
    from gearmon.signatures.measured.measurement import MeasuredSignature
    from gearmon.signatures.measured.reference import Profile, Reference


# Rates that are told by time stamps differ by less, and so little moves no level.
_SAME_RATE = 1e-2
# Of the speeds of the reference: beyond it lines lie elsewhere on resonances. Of 4 sound machines,
# simulated, none was called faulty within 9 %, and 10 of 24 recordings 12 to 20 % off were.
_OTHER_SPEED = 0.1
# A change of all bands alike that no load makes [dB], and how much alike [dB].
_GAIN_DB, _ALIKE_DB = 10.0, 1.5
# Channels look exchanged if that leaves less than this share of their distance [dB] from the
# healthy ones, which must be larger than two healthy recordings ever were apart.
_BETTER, _FAR_DB = 0.5, 3.0
# A velocity falls by this an octave beside its acceleration [dB]; departure from whole multiples.
_OCTAVE_DB, _WHOLE = 20 * np.log10(2.0), 0.12
_FACTS_NAMED = 4


def digests(samples: FloatArray) -> tuple[str, ...]:
    """Return a mark of each channel that no other recording has.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
    """
    rows = (np.ascontiguousarray(row) for row in samples)
    return tuple(hashlib.blake2b(row.data, digest_size=12).hexdigest() for row in rows)


def tooth_counts(machine: Machine) -> str:
    """Return the tooth counts of a machine in one line, as "32/96, 20/40/100".

    Parameters
    ----------
    machine : Machine
        The machine.

    Returns
    -------
    str
    """
    stages = []
    for stage in machine.stages:
        if isinstance(stage, ParallelStage):
            stages.append(f"{stage.pinion_teeth}/{stage.gear_teeth}")
        else:
            stages.append(f"{stage.sun_teeth}/{stage.planet_teeth}/{stage.ring_teeth}")
    return ", ".join(stages)


def machine_facts(machine: Machine) -> dict[str, Any]:
    """Return what a machine file says, one number or word a name, such as "stage 1 module_mm".

    Parameters
    ----------
    machine : Machine
    """
    facts: dict[str, Any] = {}
    for kind in ("operating", "stages", "bearings", "sensors"):
        for number, part in enumerate(getattr(machine, kind), start=1):
            for name, value in dataclasses.asdict(part).items():
                if value is not None:
                    plain = value if isinstance(value, int | float | str) else str(value)
                    facts[f"{kind.removesuffix('s')} {number} {name}"] = plain
    return facts


def machine_notes(machine: Machine, reference: Reference) -> list[str]:
    """Compare the machine with that of the reference.

    Parameters
    ----------
    machine : Machine
    reference : Reference

    Returns
    -------
    list of str
        What differs and may matter.

    Raises
    ------
    ArgumentError
        If the reference was learned for other gears.
    """
    if reference.teeth != tooth_counts(machine):
        raise ArgumentError(
            f"the reference was learned for teeth {reference.teeth} ({reference.machine}), the "
            f"machine file has {tooth_counts(machine)}; learn one for this machine"
        )
    _check_orders(machine, reference)
    notes = []
    if reference.machine != machine.name:
        notes.append(
            f"the reference was learned from {reference.machine!r}, the machine file names "
            f"{machine.name!r}: is it the same machine?"
        )
    if reference.version != __version__:
        notes.append(
            f"the reference was learned by gearmon {reference.version}, this is {__version__}; "
            "learn it anew if levels seem to have changed"
        )
    return notes + _changed_facts(reference.machine_facts, machine_facts(machine))


def _check_orders(machine: Machine, reference: Reference) -> None:
    """Refuse a reference whose gears turn otherwise than those of the machine."""
    orders = {
        (mesh.stage, wheel.gear): float(wheel.relative_order)
        for mesh in kinematics(machine).meshes
        for wheel in mesh.wheels
    }
    for profile in reference.profiles:
        for wheel in profile.wheels:
            order = orders.get((wheel.stage, wheel.gear))
            if order is None or abs(wheel.order - order) > 1e-6 * order:
                raise ArgumentError(
                    f"the reference has a {wheel.gear} in stage {wheel.stage} of order "
                    f"{wheel.order:.6g}, the machine file {order or 'none'}; learn one for this "
                    "machine"
                )


def _changed_facts(then: dict[str, Any], now: dict[str, Any]) -> list[str]:
    names = [name for name in {**then, **now} if then.get(name) != now.get(name)]
    if not names:
        return []
    shown = [f"{n} {then.get(n, 'none')}, now {now.get(n, 'none')}" for n in names[:_FACTS_NAMED]]
    more = f" and {len(names) - len(shown)} more" if len(names) > len(shown) else ""
    return [
        f"the machine file has changed since the reference was learned: {'; '.join(shown)}{more}"
    ]


def check_alike(own: MeasuredSignature, reference: Reference) -> None:
    """Refuse a recording of another rate or in other units than those of a reference.

    Parameters
    ----------
    own : MeasuredSignature
        The recording.
    reference : Reference

    Raises
    ------
    ArgumentError
        If they cannot be compared.
    """
    other = reference.profiles[0]
    theirs = dict(zip(reference.channel_names, reference.units, strict=True))
    for name, unit in zip(own.channel_names, own.units, strict=True):
        known = theirs.get(name)
        if unit and known and unit != known:
            raise ArgumentError(
                f"{own.origin}: channel {name} is in {unit}, in {other.origin} it is in {known}; "
                "record the same quantity, or learn a reference of this one"
            )
    here, there = own.sampling_rate_hz, other.sampling_rate_hz
    if here and there and abs(here - there) > _SAME_RATE * there:
        raise ArgumentError(
            f"{own.origin}: was sampled at {here:.8g} Hz, {other.origin} at {there:.8g} Hz; record "
            "at the same rate, or learn a reference at this one"
        )


def other_speed(own: MeasuredSignature, reference: Reference) -> str | None:
    """Say that a recording is at a speed at which nobody knows how the healthy machine sounds.

    Parameters
    ----------
    own : MeasuredSignature
        The recording.
    reference : Reference
        Healthy recordings.

    Returns
    -------
    str or None
        None where the reference covers the speed.
    """
    speed = own.speed.estimated_hz
    speeds = [profile.speed_hz for profile in reference.profiles]
    low, high = min(speeds), max(speeds)
    if (1 - _OTHER_SPEED) * low <= speed <= (1 + _OTHER_SPEED) * high:
        return None
    return (
        f"Shaft 1 turns at {speed:.4g} Hz, in the reference at {low:.4g} to {high:.4g} Hz, and "
        "levels change with speed: add healthy recordings at this speed to the reference"
    )


def recording_notes(own: MeasuredSignature, reference: Reference) -> list[str]:
    """Compare a recording with those of the reference.

    Parameters
    ----------
    own : MeasuredSignature
        The recording.
    reference : Reference

    Returns
    -------
    list of str
        What differs and may matter.

    Raises
    ------
    ArgumentError
        If it cannot be compared with them.
    """
    shared = [name for name in own.channel_names if name in reference.channel_names]
    if not shared:
        raise ArgumentError(
            f"{own.origin}: channels {', '.join(own.channel_names)} are not in the reference, "
            f"which has {', '.join(reference.channel_names)}; if they were renamed, give them "
            "their old names"
        )
    check_alike(own, reference)
    rows = [own.channel_names.index(name) for name in shared]
    theirs = [reference.channel_names.index(name) for name in shared]
    notes = [
        f"this recording is the same as {profile.origin}, from which the reference was learned: "
        "that they agree says nothing"
        for profile in reference.profiles
        if set(own.digests) & set(profile.digests)
    ]
    unknown = [
        name
        for row, there, name in zip(rows, theirs, shared, strict=True)
        if (own.units[row] is None) != (reference.units[there] is None)
    ]
    if unknown:
        notes.append(
            f"the unit of {', '.join(unknown)} is known of the recording or of the reference only; "
            "taken as the same"
        )
    bands = [profile.band_db[theirs] for profile in reference.profiles]
    if own.band_db.shape[1] and bands[0].shape[1] == own.band_db.shape[1]:
        change = own.band_db[rows][:, None] - np.mean(bands, axis=0)[None]
        _refuse_exchanged(own.origin, shared, change)
        notes += _changed_sensors(own.origin, shared, np.diagonal(change, axis1=0, axis2=1).T)
    return notes


def _refuse_exchanged(origin: str, names: Sequence[str], change: FloatArray) -> None:
    """Refuse channels that look like other ones; `change` is (own, theirs, bands) in dB."""
    if len(names) < 2:
        return
    seen = np.isfinite(change).all(axis=(0, 1))
    # a gain or a load that changed all channels alike is no matter here
    named = np.diagonal(change[:, :, seen], axis1=0, axis2=1).T
    middle = np.median(named)
    distance = np.median(np.abs(change[:, :, seen] - middle), axis=-1)
    _, best = linear_sum_assignment(distance)
    moved = [row for row, column in enumerate(best) if row != column]
    if not moved:
        return
    as_named = float(np.mean([distance[row, row] for row in moved]))
    exchanged = float(np.mean([distance[row, best[row]] for row in moved]))
    # as named, but for a gain of each channel
    amplified = np.median(np.abs(named - np.median(named, axis=1, keepdims=True)), axis=1)
    nearest = min(_BETTER * as_named, float(np.mean(amplified[moved])))
    if as_named > _FAR_DB and exchanged < nearest:
        pairs = ", ".join(f"{names[row]} is like {names[best[row]]}" for row in moved)
        raise ArgumentError(
            f"{origin}: the channels look exchanged: {pairs} of the reference ({exchanged:.1f} dB "
            f"apart, as named {as_named:.1f} dB); check the cables, or the names in the file"
        )


def _changed_sensors(origin: str, names: Sequence[str], change: FloatArray) -> list[str]:
    """Tell of channels that changed as no machine does; `change` is (channels, bands) in dB."""
    notes = []
    for name, bands in zip(names, change, strict=True):
        seen = np.flatnonzero(np.isfinite(bands))
        if len(seen) < 10:
            continue
        # bands are of equal ratio: from a thousandth of the sampling rate to 0.475 of it
        octaves = seen * np.log2(475.0) / (len(bands) - 1)
        slope, start = np.polyfit(octaves, bands[seen], 1)
        integrations = round(slope / -_OCTAVE_DB)
        bent = float(np.std(bands[seen] - slope * octaves - start))
        whole = abs(slope / -_OCTAVE_DB - integrations) < _WHOLE
        if integrations and whole and bent < _ALIKE_DB:
            raise ArgumentError(
                f"{origin}: channel {name} changes by {slope:+.1f} dB an octave against the "
                "reference, as velocity does against acceleration: it is another kind of sensor, "
                "or was integrated; record as for the reference, or learn one"
            )
        gain = float(np.median(bands[seen]))
        if abs(gain) > _GAIN_DB and float(np.std(bands[seen])) < _ALIKE_DB:
            heard = "louder" if gain > 0 else "quieter"
            notes.append(
                f"channel {name} is about {abs(gain):.0f} dB {heard} in all bands alike (factor "
                f"{10 ** (abs(gain) / 20):.2g}), as after a change of gain, sensitivity or unit; "
                "levels are compared without it"
            )
    return notes


def refuse_twice(profiles: Sequence[Profile]) -> None:
    """Refuse to learn from the same samples twice.

    Raises
    ------
    ArgumentError
        If a channel of one recording is that of another.
    """
    known: dict[str, str] = {}
    for profile in profiles:
        for digest in profile.digests:
            if digest in known:
                raise ArgumentError(
                    f"{profile.origin}: holds the same samples as {known[digest]}; a recording "
                    "counts once, name it once"
                )
        known |= dict.fromkeys(profile.digests, profile.origin)
