"""The healthy reference: what recordings of a sound machine looked like, condensed.

A reference holds, for each healthy recording, the level of every family of lines with its scatter,
and the pattern (complex line amplitudes) of every gear. Recordings at several loads span how a
healthy machine changes with load. Its file is a NumPy archive with a JSON header inside.

It remembers machine, sampling rate, units, version and, by a digest of its samples, every
recording. What makes a comparison with it meaningless is refused; what limits it is said in a
sentence.
"""

from __future__ import annotations

import dataclasses
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from gearmon import __version__
from gearmon.arrays import BoolArray, ComplexArray, FloatArray
from gearmon.errors import ArgumentError, check_type
from gearmon.files import reading_archive, restored, stored, write_archive
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine
from gearmon.result import Result
from gearmon.signals.orders.lines import OrderLines, variance_of_mean
from gearmon.signatures.measured.line_plan import GearMultiples, WheelLines
from gearmon.signatures.measured.measurement import MeasuredSignature, RecordingLevels
from gearmon.signatures.measured.nongear_lines import KINDS, LOCKS

# Least variance of a line over that of the noise between lines. Among the lines of a second stage
# the latter is far too large; with few blocks it is still the better guess.
_FEW_BLOCKS = 9
_LEAST_OF_FEW, _LEAST = 0.25, 0.01
FORMAT = "gearmon reference 6"
# What the axes of arrays and tuples count, by the name of the field.
_AXES: dict[str, tuple[str, ...]] = {"family_names": ("families",), "over_noise_db": ("channels",)}
_AXES |= dict.fromkeys(("channel_names", "units"), ("channels",))
_AXES |= {"number": ("lines",), "mesh": ("lines",)}
_AXES |= dict.fromkeys(("level_db", "scatter_db", "heard"), ("channels", "families"))
_AXES |= dict.fromkeys(("amplitude", "variance"), ("channels", "lines"))
_AXES |= dict.fromkeys(("beside", "beside_variance"), ("sides", "channels", "lines"))
_AXES |= dict.fromkeys(("hidden_db", "in_time_db"), ("channels", "cells"))
_AXES |= {"noise_db": ("channels", "bands of noise"), "band_db": ("channels", "bands")}
# More than any recording gives: what claims to be larger is damaged, or made to do harm.
_MUCH, _MOST_DB, _MOST_AMPLITUDE = 1e12, 7000.0, 1e150
_POSITIVE = ("speed_hz", "duration_s", "sampling_rate_hz", "cell_hz", "width", "top", "pieces")
_BOUNDS = dict.fromkeys((*_POSITIVE, "order"), (1e-9, _MUCH))
_BOUNDS |= dict.fromkeys(("level_db", "band_db"), (-_MOST_DB, _MOST_DB))
_BOUNDS |= dict.fromkeys(("amplitude", "beside"), (0.0, _MOST_AMPLITUDE))
_BOUNDS |= dict.fromkeys(("variance", "beside_variance"), (0.0, _MOST_AMPLITUDE**2))
_BOUNDS |= {"scatter_db": (0.0, _MOST_DB), "number": (1, 1e7), "stage": (1, 100), "teeth": (1, 1e5)}
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


def _kept(kind: type[Any], measured: Any) -> dict[str, Any]:
    """Return what is kept as it was measured, the fields of a kind of value, by name."""
    return {own.name: getattr(measured, own.name) for own in dataclasses.fields(kind)}


@dataclass(frozen=True, kw_only=True, eq=False)
class WheelPattern(GearMultiples):
    """Complex amplitudes of all multiples of one gear's rotation.

    Parameters
    ----------
    stage, gear, teeth, order, number, mesh
        As of `GearMultiples`.
    amplitude : ndarray of complex, shape (channels, lines)
        Synchronous mean.
    variance : ndarray of float, shape (channels, lines)
        Variance of that mean, see `variance_of_mean`.
    beside, beside_variance : ndarray, shape (2, channels, lines), or empty
        The same a turn of the carrier below and above each, see `WheelLines`; variance 0 where
        nothing was measured.
    """

    amplitude: ComplexArray
    variance: FloatArray
    beside: ComplexArray = field(default_factory=lambda: np.zeros((0, 0, 0), dtype=complex))
    beside_variance: FloatArray = field(default_factory=lambda: np.zeros((0, 0, 0)))

    @classmethod
    def of(cls, wheel: WheelLines, lines: OrderLines) -> WheelPattern:
        """Return the pattern of a gear from measured lines."""
        places = np.concatenate([wheel.lines[None], wheel.beside])
        blocks = lines.amplitude[:, :, places]
        # a few blocks tell little about their scatter: the noise between the lines helps
        floor = lines.noise[:, places] / max(1.0, lines.independent_blocks)
        least = _LEAST_OF_FEW if len(blocks) < _FEW_BLOCKS else _LEAST
        told = blocks.mean(axis=0), np.maximum(variance_of_mean(blocks), least * floor)
        amplitude, variance = (np.where(places >= 0, own, 0.0).swapaxes(0, 1) for own in told)
        return cls(
            **_kept(GearMultiples, wheel),
            amplitude=amplitude[0],
            variance=variance[0],
            beside=amplitude[1:],
            beside_variance=variance[1:],
        )

    def only(self, kept: NDArray[np.bool_]) -> WheelPattern:
        """Return some lines, those at the multiples of the rotation without the ones beside."""
        of_lines = ("number", "mesh", "amplitude", "variance")
        own: dict[str, Any] = {name: getattr(self, name)[..., kept] for name in of_lines}
        own |= {"beside": self.beside[:0], "beside_variance": self.beside_variance[:0]}
        return replace(self, **own)

    def same_in(self, wheels: Iterable[WheelPattern]) -> WheelPattern | None:
        """Return the pattern of the same gear in another recording, or None."""
        key = self.stage, self.gear, self.teeth
        return next((own for own in wheels if (own.stage, own.gear, own.teeth) == key), None)


class Levels(NamedTuple):
    """Levels of one recording, arrays of shape (channels, levels).

    Parameters
    ----------
    level_db, error_db : ndarray of float
        Levels and their standard errors [dB].
    heard : ndarray of bool
        Whether each stands above its own scatter.
    """

    level_db: FloatArray
    error_db: FloatArray
    heard: BoolArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Profile(RecordingLevels):
    """One recording, condensed to what is compared.

    Parameters
    ----------
    origin, duration_s, sampling_rate_hz, level_db, scatter_db, heard, band_db, speed_fluctuation, \
    foreign, digests
        As of `RecordingLevels`.
    speed_hz : float
        Mean speed of shaft 1 [Hz].
    tacho : bool
        Whether the angle zero is that of a tachometer with one pulse a turn of shaft 1.
    family_names : tuple of str
        Families of lines.
    wheels : tuple of WheelPattern
        Patterns of the gears.
    """

    speed_hz: float
    tacho: bool
    family_names: tuple[str, ...]
    wheels: tuple[WheelPattern, ...]

    @classmethod
    def of(cls, signature: MeasuredSignature) -> Profile:
        """Condense a measured signature."""
        return cls(
            **_kept(RecordingLevels, signature),
            speed_hz=signature.speed.estimated_hz,
            tacho=signature.track.indexed,
            family_names=tuple(family.name for family in signature.plan.families),
            wheels=tuple(WheelPattern.of(own, signature.lines) for own in signature.plan.wheels),
        )

    def part(self, rows: Sequence[int]) -> Profile:
        """Return the same of some channels only, in this order."""
        own: Profile = taken(self, rows)
        return own

    def of_families(self, names: Sequence[str]) -> Levels:
        """Return the levels of some families of lines."""
        index = {name: column for column, name in enumerate(self.family_names)}
        columns = [index[name] for name in names]
        level, error, heard = self.level_db, self.scatter_db, self.heard
        return Levels(level[:, columns], error[:, columns], heard[:, columns])

    @property
    def bands(self) -> Levels:
        """Levels of the broadband spectrum."""
        return Levels(self.band_db, np.zeros_like(self.band_db), self.band_db < np.inf)


@dataclass(frozen=True, kw_only=True, eq=False)
class Reference(Result):
    """Healthy recordings of one machine.

    Parameters
    ----------
    machine : str
        Name of the machine.
    teeth : str
        Its tooth counts, as "32/96, 32/80"; a reference fits machines with the same ones.
    channel_names : tuple of str
        Vibration channels.
    units : tuple of str or None
        Their units.
    family_names : tuple of str
        Families that all recordings have.
    profiles : tuple of Profile
        The recordings.
    version : str
        Of gearmon that learned it.
    machine_facts : dict
        What the machine file said.
    notes : tuple of str
        What was doubtful about the recordings.

    Examples
    --------
    >>> reference.origins, reference.channel_names
    (('simulated 1', 'simulated 2'), ('a1', 'a2'))
    >>> len(reference.family_names), [profile.level_db.shape for profile in reference.profiles]
    (30, [(2, 30), (2, 30)])
    >>> known, rows = reference.shared_with(analysis.signature)
    >>> known.channel_names, rows
    (('a1', 'a2'), [0, 1])
    >>> reference.save("healthy.ref")[0].name
    'healthy.ref'
    """

    machine: str
    teeth: str
    channel_names: tuple[str, ...]
    units: tuple[str | None, ...]
    family_names: tuple[str, ...]
    profiles: tuple[Profile, ...]
    version: str = ""
    machine_facts: dict[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def save(self, path: str | Path) -> list[Path]:
        """Write it as `write_reference` does, for `read_reference`."""
        write_reference(self, path)
        return [Path(path)]

    @property
    def origins(self) -> tuple[str, ...]:
        """The recordings' names."""
        return tuple(profile.origin for profile in self.profiles)

    def shared_with(self, signature: MeasuredSignature) -> tuple[Reference, list[int]]:
        """Return the reference in the channels that a recording has too, and their rows there."""
        names = tuple(name for name in signature.channel_names if name in self.channel_names)
        known = self if names == self.channel_names else _part(self, names)
        return known, [signature.channel_names.index(name) for name in names]


# several recordings are held against one reference
@lru_cache(maxsize=4)
def _part(reference: Reference, names: tuple[str, ...]) -> Reference:
    own: Reference = taken(reference, [reference.channel_names.index(name) for name in names])
    return own


def taken(held: Any, rows: Sequence[int], axes: Sequence[str] = ()) -> Any:
    """Return what a reference holds of some channels only, in this order.

    Parameters
    ----------
    held : Reference, or any part of one
    rows : sequence of int
        Channels to keep.
    axes : sequence of str
        What the axes of an array or a tuple count.
    """
    if dataclasses.is_dataclass(held) and not isinstance(held, type):
        names = [own.name for own in dataclasses.fields(held)]
        kept = {name: taken(getattr(held, name), rows, _AXES.get(name, ())) for name in names}
        return replace(held, **kept)
    if isinstance(held, tuple):
        chosen = [held[k] for k in rows] if "channels" in axes else held
        return tuple(taken(own, rows) for own in chosen)
    return held.take(rows, axes.index("channels")) if "channels" in axes and held.size else held


def make_reference(signatures: Sequence[MeasuredSignature], machine: Machine) -> Reference:
    """Join measured signatures of healthy recordings into a reference.

    Parameters
    ----------
    signatures : sequence of MeasuredSignature
        One or more; of the same channels. Different loads are welcome.
    machine : Machine
        The machine.

    Returns
    -------
    Reference

    Raises
    ------
    ArgumentError
        If there is none, no mesh was found in one of them, one is there twice, or their channels,
        units or sampling rates differ.
    """
    if not signatures:
        raise ArgumentError("a reference needs at least one healthy recording")
    first = signatures[0]
    for number, signature in enumerate(signatures):
        wrong, digests = "", set(signature.digests)
        again = [own.origin for own in signatures[:number] if digests & set(own.digests)]
        if not signature.found:
            why = signature.meshes[0].reason
            wrong = f"no mesh found, so it cannot serve as a reference: {why}"
        elif signature.channel_names != first.channel_names:
            own, known = (", ".join(one.channel_names) for one in (signature, first))
            wrong = f"channels {own} differ from {known} of {first.origin}; "
            wrong += "name the same ones with --channel"
        elif again:
            wrong = f"holds the same samples as {again[0]}; a recording counts once, name it once"
        if wrong:
            raise ArgumentError(f"{signature.origin}: {wrong}")
    profiles = tuple(Profile.of(signature) for signature in signatures)
    shared = set.intersection(*(set(profile.family_names) for profile in profiles))
    if not shared:
        raise ArgumentError(
            "the recordings share no family of lines: they differ too much in sampling rate or "
            "length"
        )
    reference = Reference(
        machine=machine.name,
        teeth=tooth_counts(machine),
        channel_names=first.channel_names,
        units=first.units,
        family_names=tuple(name for name in profiles[0].family_names if name in shared),
        profiles=profiles,
        version=__version__,
        machine_facts=machine_facts(machine),
    )
    for signature in signatures:
        check_alike(signature, reference)
    return reference


def write_reference(reference: Reference, path: str | Path) -> None:
    """Store a reference in one file (a NumPy archive with a JSON header inside).

    Parameters
    ----------
    reference : Reference
        The reference.
    path : str or Path
        The file; any name.

    Raises
    ------
    ArgumentError
        If the file cannot be written.

    Examples
    --------
    >>> gearmon.write_reference(reference, "healthy.ref")
    """
    check_type("reference", reference, Reference, "what gearmon.learn returns")
    arrays: dict[str, NDArray[Any]] = {}
    write_archive(path, {"format": FORMAT, "reference": stored(reference, arrays)}, arrays)


def is_reference(path: str | Path) -> bool:
    """Tell whether a file is a stored reference (and not, say, a recording)."""
    return zipfile.is_zipfile(path)


def read_reference(path: str | Path) -> Reference:
    """Read a stored reference.

    Parameters
    ----------
    path : str or Path
        A file written by `write_reference`.

    Returns
    -------
    Reference

    Raises
    ------
    SignatureError
        If the file is missing, is no reference, or is damaged.

    Examples
    --------
    >>> gearmon.write_reference(reference, "healthy.ref")
    >>> gearmon.read_reference("healthy.ref").origins == reference.origins
    True
    """
    told_of = "gearmon reference", "learn it", "make one with gearmon learn"
    with reading_archive(path, (FORMAT,), *told_of) as (header, arrays):
        reference: Reference = restored(Reference, header["reference"], arrays)
        # a file may be damaged and still be an archive: what no recording gives is refused
        channels, profiles = len(reference.channel_names), reference.profiles
        _need(0 < channels == len(set(reference.channel_names)), "channels")
        _need(bool(profiles) and bool(reference.family_names), "recordings")
        _check_held("", reference, {"channels": channels, "bands": len(profiles[0].band_db.T)})
        gears = {tuple((own.stage, own.gear, own.teeth) for own in p.wheels) for p in profiles}
        _need(len(gears) == 1 and all(gears), "gears")
        for profile in profiles:
            foreign = profile.foreign
            _need(set(reference.family_names) <= set(profile.family_names), "families")
            _need(tuple(grid.kind for grid in foreign.grids) == KINDS, "spectra")
            seen = [own for grid in foreign.grids for own in (grid.noise_db, grid.hidden_db)]
            _need(all(own.size for own in (foreign.in_time_db, *seen)), "spectra")
            known = (line.kind in KINDS and line.locked in LOCKS for line in foreign)
            _need(all(known), "other lines")
            _need(all(len(own.beside) in (0, 2) for own in profile.wheels), "lines beside")
    return reference


def _check_held(name: str, held: Any, sizes: dict[str, int]) -> None:
    """Refuse axes of another size than others have, and numbers beyond all that is recorded."""
    axes, (low, high) = _AXES.get(name, ()), _BOUNDS.get(name, (-np.inf, _MUCH))
    if dataclasses.is_dataclass(held):
        sizes = dict(sizes)
        for own in dataclasses.fields(held):
            _check_held(own.name, getattr(held, own.name), sizes)
    elif isinstance(held, tuple):
        _need(not axes or sizes.setdefault(axes[0], len(held)) == len(held), name)
        for own in held:
            _check_held(name, own, sizes)
    elif isinstance(held, np.ndarray):
        shape = zip(axes, held.shape, strict=True)
        _need(all(sizes.setdefault(axis, size) == size for axis, size in shape), name)
        size = np.abs(held) if held.dtype.kind == "c" else held
        # short recordings have bands without a bin
        size = size[~np.isnan(size)] if name == "band_db" else size
        _need(bool(((size >= low) & (size < high)).all()), name)
    elif isinstance(held, int | float):
        _need(low <= held < high, name)


def _need(ok: bool, what: str) -> None:
    if not ok:
        raise ValueError(f"its {what} cannot be")


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
    meshes = kinematics(machine).meshes
    return ", ".join("/".join(str(wheel.teeth) for wheel in mesh.wheels) for mesh in meshes)


def machine_facts(machine: Machine) -> dict[str, Any]:
    """Return what a machine file says, one number or word a name, such as "stage 1 module_mm".

    Parameters
    ----------
    machine : Machine
    """
    return {
        f"{kind.removesuffix('s')} {number} {name}": (
            value if isinstance(value, int | float | str) else str(value)
        )
        for kind in ("operating", "stages", "bearings", "sensors")
        for number, part in enumerate(getattr(machine, kind), start=1)
        for name, value in dataclasses.asdict(part).items()
        if value is not None
    }


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
    wheels = [(mesh.stage, own) for mesh in kinematics(machine).meshes for own in mesh.wheels]
    orders = {(stage, own.gear): own.relative_order for stage, own in wheels}
    for own in (wheel for profile in reference.profiles for wheel in profile.wheels):
        order = orders.get((own.stage, own.gear))
        if order is None or abs(own.order - order) > 1e-6 * order:
            raise ArgumentError(
                f"the reference has a {own.gear} in stage {own.stage} of order {own.order:.6g}, "
                f"the machine file {order or 'none'}; learn one for this machine"
            )
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
    then, now = reference.machine_facts, machine_facts(machine)
    changed = [
        f"{name} {then.get(name, 'none')}, now {now.get(name, 'none')}"
        for name in {**then, **now}
        if then.get(name) != now.get(name)
    ]
    if changed:
        shown, more = "; ".join(changed[:_FACTS_NAMED]), len(changed) - _FACTS_NAMED
        shown += f" and {more} more" if more > 0 else ""
        notes.append(f"the machine file has changed since the reference was learned: {shown}")
    return notes


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
    known, rows = reference.shared_with(own)
    shared = known.channel_names
    if not shared:
        raise ArgumentError(
            f"{own.origin}: channels {', '.join(own.channel_names)} are not in the reference, "
            f"which has {', '.join(reference.channel_names)}; if they were renamed, give them "
            "their old names"
        )
    check_alike(own, reference)
    notes = [
        f"this recording is the same as {profile.origin}, from which the reference was learned: "
        "that they agree says nothing"
        for profile in reference.profiles
        if set(own.digests) & set(profile.digests)
    ]
    units = [(name, own.units[row]) for name, row in zip(shared, rows, strict=True)]
    both = zip(units, known.units, strict=True)
    unknown = [name for (name, unit), other in both if (unit is None) != (other is None)]
    if unknown:
        notes.append(
            f"the unit of {', '.join(unknown)} is known of the recording or of the reference only; "
            "taken as the same"
        )
    bands = [profile.band_db for profile in known.profiles]
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
            f"apart, as named {as_named:.1f} dB); check cables and names, or learn moved sensors"
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
