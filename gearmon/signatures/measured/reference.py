"""The healthy reference: what recordings of a sound machine looked like, condensed.

A reference holds, for each healthy recording, the level of every family of lines with its scatter,
and the pattern (complex line amplitudes) of every gear. Recordings at several loads span how a
healthy machine changes with load. Its file is a NumPy archive with a JSON header inside.
"""

from __future__ import annotations

import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearmon import __version__
from gearmon.errors import ArgumentError, check_type
from gearmon.files import reading_archive, write_archive
from gearmon.machine import Machine
from gearmon.result import Result
from gearmon.signals.array_types import ComplexArray, FloatArray
from gearmon.signals.orders import OrderLines, variance_of_mean
from gearmon.signatures.measured.line_plan import WheelLines
from gearmon.signatures.measured.measurement import MeasuredSignature
from gearmon.signatures.measured.nongear_lines import NonGearLines, line_arrays, lines_from_arrays
from gearmon.signatures.measured.provenance import (
    check_alike,
    machine_facts,
    refuse_twice,
    tooth_counts,
)

# Least variance of a line over that of the noise between lines. Among the lines of a second stage
# the latter is far too large; with few blocks it is still the better guess.
_FEW_BLOCKS = 9
_LEAST_OF_FEW, _LEAST = 0.25, 0.01
FORMAT = "gearmon reference 5"
# Without lines of no gear, broadband levels, provenance, lines beside; still read.
_OLDER_FORMATS = tuple(f"gearmon reference {number}" for number in (1, 2, 3, 4))
# What stands in the header of the file, and what in arrays of their own.
_OF_WHEEL, _BESIDE = ("stage", "gear", "teeth", "order"), ("beside", "beside_variance")
_WHEEL_ARRAYS = ("number", "mesh", "amplitude", "variance", *_BESIDE)
_OF_PROFILE, _PROFILE_ARRAYS = (
    ("origin", "speed_hz", "duration_s", "tacho", "family_names"),
    ("level_db", "band_db", "scatter_db", "heard"),
)
_OF_REFERENCE = ("machine", "teeth", "channel_names", "units", "family_names")
# What older formats do not tell.
_PROVENANCE, _OF_SAMPLES = ("version", "machine_facts", "notes"), ("sampling_rate_hz", "digests")
# What a profile takes over from a measured signature.
_OF_SIGNATURE = ("origin", "duration_s", "foreign", *_PROFILE_ARRAYS, *_OF_SAMPLES)
# More than any recording gives: what claims to be larger is damaged, or made to do harm.
_MOST_DB, _MOST_LINES, _MOST_AMPLITUDE = 7000.0, 10_000_000, 1e150


@dataclass(frozen=True, kw_only=True, eq=False)
class WheelPattern:
    """Complex amplitudes of all multiples of one gear's rotation.

    Parameters
    ----------
    stage : int
        Stage, from 1.
    gear : str
        Gear.
    teeth : int
        Teeth.
    number : ndarray of int, shape (lines,)
        Multiple of the rotation.
    mesh : ndarray of bool, shape (lines,)
        Whether the line is a harmonic of a mesh.
    amplitude : ndarray of complex, shape (channels, lines)
        Synchronous mean.
    variance : ndarray of float, shape (channels, lines)
        Variance of that mean, see `variance_of_mean`.
    order : float
        Rotation of the gear, in turns of shaft 1.
    beside, beside_variance : ndarray, shape (2, channels, lines), or empty
        The same a turn of the carrier below and above each, see `WheelLines`; variance 0 where
        nothing was measured. References of older formats have none.
    """

    stage: int
    gear: str
    teeth: int
    order: float
    number: NDArray[np.int64]
    mesh: NDArray[np.bool_]
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
        variance = np.maximum(variance_of_mean(blocks), least * floor)
        amplitude, variance = (
            np.where(places >= 0, own, 0.0).swapaxes(0, 1)
            for own in (blocks.mean(axis=0), variance)
        )
        return cls(
            **_named(wheel, (*_OF_WHEEL, "number", "mesh")),
            amplitude=amplitude[0],
            variance=variance[0],
            beside=amplitude[1:],
            beside_variance=variance[1:],
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Profile:
    """One recording, condensed to what is compared.

    Parameters
    ----------
    origin : str
        The recording.
    speed_hz : float
        Mean speed of shaft 1 [Hz].
    duration_s : float
        Length [s].
    tacho : bool
        Whether the angle zero is that of a tachometer with one pulse a turn of shaft 1.
    family_names : tuple of str
        Families of lines.
    level_db, scatter_db : ndarray of float, shape (channels, families)
        Level and its standard error within the recording [dB].
    heard : ndarray of bool, shape (channels, families)
        Whether the family stands above its own scatter.
    wheels : tuple of WheelPattern
        Patterns of the gears.
    band_db : ndarray of float, shape (channels, bands)
        Levels of the broadband spectrum, see `broadband_levels`; no bands in references of an older
        format.
    foreign : NonGearLines or None
        Lines that no gear explains; None in references of the oldest format.
    sampling_rate_hz : float
        Sampling rate [Hz]; 0 where an older format does not tell.
    digests : tuple of str
        Mark of the samples of each channel.
    """

    origin: str
    speed_hz: float
    duration_s: float
    tacho: bool
    family_names: tuple[str, ...]
    level_db: FloatArray
    scatter_db: FloatArray
    heard: NDArray[np.bool_]
    wheels: tuple[WheelPattern, ...]
    band_db: FloatArray
    foreign: NonGearLines | None = None
    sampling_rate_hz: float = 0.0
    digests: tuple[str, ...] = ()

    @classmethod
    def of(cls, signature: MeasuredSignature) -> Profile:
        """Condense a measured signature."""
        return cls(
            **_named(signature, _OF_SIGNATURE),
            speed_hz=signature.speed.estimated_hz,
            tacho=signature.track.indexed,
            family_names=tuple(family.name for family in signature.plan.families),
            wheels=tuple(
                WheelPattern.of(wheel, signature.lines) for wheel in signature.plan.wheels
            ),
        )


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
        Of gearmon that learned it; empty in older formats.
    machine_facts : dict
        What the machine file said.
    notes : tuple of str
        What was doubtful about the recordings.

    Examples
    --------
    >>> reference.origins, reference.channel_names
    (('simulated 1', 'simulated 2'), ('a1', 'a2'))
    >>> reference.level_db.shape == reference.scatter_db.shape
    True
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

    @property
    def level_db(self) -> FloatArray:
        """Levels, shape (recordings, channels, families) [dB re 1 unit^2]."""
        return np.array([_taken(p, self.family_names, p.level_db) for p in self.profiles])

    @property
    def scatter_db(self) -> FloatArray:
        """Standard errors of the levels, shape (recordings, channels, families) [dB]."""
        return np.array([_taken(p, self.family_names, p.scatter_db) for p in self.profiles])


def _taken(profile: Profile, names: Sequence[str], values: FloatArray) -> FloatArray:
    """Columns of `values` for these families, in this order."""
    index = {name: column for column, name in enumerate(profile.family_names)}
    return values[:, [index[name] for name in names]]


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
    for signature in signatures:
        if not signature.found:
            raise ArgumentError(
                f"{signature.origin}: no mesh found, so it cannot serve as a reference: "
                f"{signature.meshes[0].reason}"
            )
        if signature.channel_names != first.channel_names:
            raise ArgumentError(
                f"{signature.origin}: channels {', '.join(signature.channel_names)} differ from "
                f"{', '.join(first.channel_names)} of {first.origin}; name the same ones with "
                "--channel"
            )
    profiles = tuple(Profile.of(signature) for signature in signatures)
    common = [
        name
        for name in profiles[0].family_names
        if all(name in profile.family_names for profile in profiles)
    ]
    if not common:
        raise ArgumentError(
            "the recordings share no family of lines: they differ too much in sampling rate or "
            "length"
        )
    reference = Reference(
        machine=machine.name,
        teeth=tooth_counts(machine),
        channel_names=first.channel_names,
        units=first.units,
        family_names=tuple(common),
        profiles=profiles,
        version=__version__,
        machine_facts=machine_facts(machine),
    )
    refuse_twice(profiles)
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
    named = _named(reference, (*_OF_REFERENCE, *_PROVENANCE))
    header: dict[str, Any] = {"format": FORMAT, **named, "profiles": []}
    arrays: dict[str, NDArray[Any]] = {}
    for row, profile in enumerate(reference.profiles):
        wheels = [_named(wheel, _OF_WHEEL) for wheel in profile.wheels]
        own = _named(profile, (*_OF_PROFILE, *_OF_SAMPLES))
        header["profiles"].append({**own, "wheels": wheels})
        arrays |= _prefixed(f"{row}", _named(profile, _PROFILE_ARRAYS))
        for column, wheel in enumerate(profile.wheels):
            arrays |= _prefixed(f"{row}/{column}", _named(wheel, _WHEEL_ARRAYS))
        if profile.foreign is not None:
            arrays |= _prefixed(f"{row}/foreign", line_arrays(profile.foreign))
    write_archive(path, header, arrays)


def _named(owner: object, names: Sequence[str]) -> dict[str, Any]:
    return {name: getattr(owner, name) for name in names}


def _prefixed(prefix: str, arrays: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    return {f"{prefix}/{name}": values for name, values in arrays.items()}


def is_reference(path: str | Path) -> bool:
    """Tell whether a file is a stored reference (and not, say, a recording)."""
    try:
        return zipfile.is_zipfile(path)
    except OSError:
        return False


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
    formats = (FORMAT, *_OLDER_FORMATS)
    told_of = "gearmon reference", "learn it", "make one with gearmon learn"
    with reading_archive(path, formats, *told_of) as (header, arrays):
        profiles = tuple(
            _read_profile(arrays, row, entry) for row, entry in enumerate(header["profiles"])
        )
        told = {name: _frozen(header[name]) for name in _OF_REFERENCE}
        told |= {name: _frozen(header[name]) for name in _PROVENANCE if name in header}
        reference = Reference(**told, profiles=profiles)
        _check(reference)
    return reference


def _check(reference: Reference) -> None:
    """Refuse what no recording gives: a file may be damaged and still be an archive."""
    names = (*reference.channel_names, *reference.family_names, *reference.notes)
    told = (reference.machine, reference.teeth, reference.version, *names)
    told += tuple(unit for unit in reference.units if unit is not None)
    _need(all(isinstance(text, str) for text in told), "names")
    _need(isinstance(reference.machine_facts, dict), "machine data")
    channels = len(reference.channel_names)
    _need(0 < channels == len(set(reference.channel_names)) == len(reference.units), "channels")
    _need(bool(reference.profiles) and bool(reference.family_names), "recordings")
    bands = reference.profiles[0].band_db.shape
    gears = [(wheel.stage, wheel.gear, wheel.teeth) for wheel in reference.profiles[0].wheels]
    for profile in reference.profiles:
        _check_profile(profile, channels, set(reference.family_names))
        _need(profile.band_db.shape == bands, "broadband levels")
        own = [(wheel.stage, wheel.gear, wheel.teeth) for wheel in profile.wheels]
        _need(bool(own) and own == gears, "gears")
        for wheel in profile.wheels:
            _check_wheel(wheel, channels)


def _check_profile(profile: Profile, channels: int, families: set[str]) -> None:
    shape = channels, len(profile.family_names)
    _need(families <= set(profile.family_names), "families")
    _need(all(isinstance(text, str) for text in (profile.origin, *profile.digests)), "origin")
    for name in ("speed_hz", "duration_s"):
        _need(1e-6 < float(getattr(profile, name)) < 1e9, name)
    _need(0 <= float(profile.sampling_rate_hz) < 1e12 and isinstance(profile.tacho, bool), "rate")
    for name in ("level_db", "scatter_db"):
        values = getattr(profile, name)
        _need(values.shape == shape and values.dtype.kind == "f", name)
        _need(bool((np.abs(values) < _MOST_DB).all()), name)
    _need(bool((profile.scatter_db >= 0).all()), "scatter_db")
    _need(profile.heard.shape == shape and profile.heard.dtype.kind == "b", "heard")
    _need(profile.band_db.ndim == 2 and len(profile.band_db) == channels, "band_db")
    _need(profile.band_db.dtype.kind == "f", "band_db")
    # short recordings have bands without a bin
    _need(not bool((np.abs(profile.band_db) >= _MOST_DB).any()), "band_db")
    foreign = profile.foreign
    _need(foreign is None or len(foreign.in_time_db) == channels, "lines of no gear")


def _check_wheel(wheel: WheelPattern, channels: int) -> None:
    lines = len(wheel.number)
    _need(isinstance(wheel.gear, str) and 0 < wheel.stage < 100 and 0 < wheel.teeth < 1e5, "gear")
    _need(0 < float(wheel.order) < 1e4, "order")
    _need(wheel.number.shape == wheel.mesh.shape == (lines,), "lines")
    _need(wheel.number.dtype.kind == "i" and wheel.mesh.dtype.kind == "b", "lines")
    _need(bool(((wheel.number > 0) & (wheel.number < _MOST_LINES)).all()), "lines")
    _need(wheel.amplitude.shape == wheel.variance.shape == (channels, lines), "amplitudes")
    _need(wheel.amplitude.dtype.kind == "c" and wheel.variance.dtype.kind == "f", "amplitudes")
    _need(bool((np.abs(wheel.amplitude) < _MOST_AMPLITUDE).all()), "amplitudes")
    _need(wheel.beside.shape == wheel.beside_variance.shape, "amplitudes beside")
    _need(not wheel.beside.size or wheel.beside.shape == (2, channels, lines), "amplitudes beside")
    _need(wheel.beside.dtype.kind == "c", "amplitudes beside")
    _need(bool((np.abs(wheel.beside) < _MOST_AMPLITUDE).all()), "amplitudes beside")
    for variance in (wheel.variance, wheel.beside_variance):
        positive = (variance >= 0) & (variance < _MOST_AMPLITUDE**2)
        _need(variance.dtype.kind == "f" and bool(positive.all()), "variances")


def _need(ok: bool, what: str) -> None:
    if not ok:
        raise ValueError(f"its {what} cannot be")


def _frozen(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _read_profile(archive: Mapping[str, Any], row: int, entry: dict[str, Any]) -> Profile:
    wheels = tuple(
        WheelPattern(
            **{name: wheel[name] for name in _OF_WHEEL},
            **{
                name: archive[place]
                for name in _WHEEL_ARRAYS
                if (place := f"{row}/{column}/{name}") in archive or name not in _BESIDE
            },
        )
        for column, wheel in enumerate(entry["wheels"])
    )
    arrays = {
        name: archive[f"{row}/{name}"]
        for name in _PROFILE_ARRAYS
        if name != "band_db" or f"{row}/{name}" in archive
    }
    arrays.setdefault("band_db", np.zeros((len(arrays["level_db"]), 0)))
    start = f"{row}/foreign/"
    names = [name for name in archive if name.startswith(start)]
    stored = {name.removeprefix(start): archive[name] for name in names}
    return Profile(
        **{name: _frozen(entry[name]) for name in _OF_PROFILE},
        **{name: _frozen(entry[name]) for name in _OF_SAMPLES if name in entry},
        **arrays,
        wheels=wheels,
        foreign=lines_from_arrays(stored) if stored else None,
    )
