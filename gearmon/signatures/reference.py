"""The healthy reference: what recordings of a sound machine looked like, condensed.

A reference holds, for each healthy recording, the level of every family of lines with its scatter,
and the pattern (complex line amplitudes) of every gear. Recordings at several loads span how a
healthy machine changes with load.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError
from gearmon.machine import Machine, ParallelStage
from gearmon.signals.orders import OrderLines, variance_of_mean
from gearmon.signatures.families import WheelLines
from gearmon.signatures.measured import MeasuredSignature
from gearmon.signatures.nongear_lines import NonGearLines

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

# Least variance of a line over that of the noise between lines. Among the lines of a second stage
# the latter is far too large; with few blocks it is still the better guess.
_FEW_BLOCKS = 9
_LEAST_OF_FEW, _LEAST = 0.25, 0.01


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
    """

    stage: int
    gear: str
    teeth: int
    order: float
    number: NDArray[np.int64]
    mesh: NDArray[np.bool_]
    amplitude: ComplexArray
    variance: FloatArray

    @classmethod
    def of(cls, wheel: WheelLines, lines: OrderLines) -> WheelPattern:
        """Return the pattern of a gear from measured lines."""
        blocks = lines.amplitude[:, :, wheel.lines]
        # a few blocks tell little about their scatter: the noise between the lines helps
        floor = lines.noise[:, wheel.lines] / max(1.0, lines.independent_blocks)
        least = _LEAST_OF_FEW if len(blocks) < _FEW_BLOCKS else _LEAST
        return cls(
            stage=wheel.stage,
            gear=wheel.gear,
            teeth=wheel.teeth,
            order=wheel.order,
            number=wheel.number,
            mesh=wheel.mesh,
            amplitude=blocks.mean(axis=0),
            variance=np.maximum(variance_of_mean(blocks), least * floor),
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

    @classmethod
    def of(cls, signature: MeasuredSignature) -> Profile:
        """Condense a measured signature."""
        return cls(
            origin=signature.origin,
            speed_hz=signature.speed.estimated_hz,
            duration_s=signature.duration_s,
            tacho=signature.track.indexed,
            family_names=tuple(family.name for family in signature.plan.families),
            level_db=signature.level_db,
            scatter_db=signature.scatter_db,
            heard=signature.heard,
            wheels=tuple(
                WheelPattern.of(wheel, signature.lines) for wheel in signature.plan.wheels
            ),
            band_db=signature.band_db,
            foreign=signature.foreign,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Reference:
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
    """

    machine: str
    teeth: str
    channel_names: tuple[str, ...]
    units: tuple[str | None, ...]
    family_names: tuple[str, ...]
    profiles: tuple[Profile, ...]

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
        If there is none, no mesh was found in one of them, or their channels differ.
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
    return Reference(
        machine=machine.name,
        teeth=tooth_counts(machine),
        channel_names=first.channel_names,
        units=first.units,
        family_names=tuple(common),
        profiles=profiles,
    )
