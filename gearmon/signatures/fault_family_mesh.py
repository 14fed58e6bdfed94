"""Stiffness and displacement excitation of meshes with damage, at the points where it is solved."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearmon.errors import ArgumentError, check_range, nearest_name
from gearmon.gears.excitation import Excitation, FlankError, displacement_excitation
from gearmon.gears.faults import Fault, GearError
from gearmon.gears.mechanics import StageMechanics, stage_mechanics
from gearmon.gears.pairs import MeshPair, mesh_pairs
from gearmon.gears.pulses import PulseTrain
from gearmon.machine import Machine, OperatingPoint
from gearmon.signatures.fault_family_motion import (
    Deviations,
    EvenMesh,
    deviations,
    linear_deviations,
)
from gearmon.signatures.fault_family_panels import FloatArray, PhaseGrid


@dataclass(frozen=True, kw_only=True, eq=False)
class Turn:
    """One mesh with a fault of one gear, ready to be solved.

    Parameters
    ----------
    fault : Fault, GearError or None
        Of tooth 1; None for the healthy mesh.
    mechanics : StageMechanics
        With the fault.
    excitation : Excitation or None
    """

    fault: Fault | GearError | None
    mechanics: StageMechanics
    excitation: Excitation | None

    @property
    def period(self) -> int:
        """P, mesh periods of its turn."""
        own = self.mechanics.stiffness.period_mesh
        return own if self.excitation is None else self.excitation.period_mesh

    @property
    def is_local(self) -> bool:
        """Whether it acts in a few mesh periods of a turn, or in all of them alike."""
        if self.mechanics.stiffness.modulations:
            return False
        errors = () if self.excitation is None else self.excitation.errors
        return all(isinstance(e, FlankError) or e.period_mesh == 1 for e in errors)

    @cached_property
    def window(self) -> int:
        """Mesh periods, from the entry of tooth 1, in which the mesh differs."""
        stiffness = self.mechanics.stiffness
        ends = [_end(train) for train in stiffness.pulses]
        if self.excitation is not None and self.excitation.errors:
            ends.append(stiffness.total_contact_ratio)
        return min(self.period, max(1, math.ceil(max(ends, default=1.0) - 1e-9)))

    @property
    def corners(self) -> FloatArray:
        """Mesh phases at which stiffness or excitation are not smooth."""
        stiffness = self.mechanics.stiffness
        found = [np.zeros(1), *(_corners(train) for train in stiffness.trains)]
        for error in () if self.excitation is None else self.excitation.errors:
            if isinstance(error, FlankError) and error.corners:
                limits = np.asarray(error.corners, dtype=np.float64)
                found += [limits, limits + stiffness.overlap_ratio]
        return np.concatenate(found)

    @property
    def fastest(self) -> float:
        """Cycles a mesh period of the fastest part of an oscillating stiffness form."""
        terms = [term for train in self.mechanics.stiffness.trains for term in train.terms]
        return max((term.pulse.fastest for term in terms), default=0.0) / (2 * math.pi)

    def stiffness(self, grid: PhaseGrid, periods: int) -> FloatArray:
        """Return k [N/m] in the first mesh periods, shape (periods, panels, points)."""
        phase = np.arange(periods)[:, None, None] + grid.phase
        return self.mechanics.stiffness.at(phase)

    def moved(self, grid: PhaseGrid, periods: int) -> FloatArray | None:
        """Return e [m] in the first mesh periods, same shape; None where nothing moves."""
        if self.excitation is None or not self.excitation.errors:
            return None
        return self.excitation.at(np.arange(periods)[:, None, None] + grid.phase)

    def even(self, grid: PhaseGrid) -> EvenMesh:
        """Solve the mesh period that all teeth share."""
        own = self.mechanics
        scale = 1 / (own.equivalent_mass_kg * own.mesh_frequency_hz**2)
        moved = self.moved(grid, 1) if self.period == 1 else None
        return EvenMesh(
            grid=grid,
            gamma=own.damping_ns_per_m * scale * own.mesh_frequency_hz,
            phi=own.force_n * scale,
            kappa=own.stiffness.healthy.at(grid.phase) * scale,
            excitation=None if moved is None else moved[0],
        )


def turn_of(
    machine: Machine,
    stage: int,
    point: OperatingPoint,
    fault: Fault | GearError | None,
    form: str,
    mesh: int = 0,
) -> Turn:
    """Return a mesh with one fault or error.

    Parameters
    ----------
    machine : Machine
    stage : int
        From 1.
    point : OperatingPoint
    fault : Fault, GearError or None
    form : str
        Of the stiffness.
    mesh : {0, 1}
        Of a planetary stage 0 for sun and planet, 1 for planet and ring.

    Raises
    ------
    ArgumentError
        If the machine lacks data, or the fault does not fit it.
    """
    faults = [fault] if isinstance(fault, Fault) else []
    errors = [fault] if isinstance(fault, GearError) else []
    mechanics = stage_mechanics(
        machine, stage, point, faults=faults, errors=errors, form=form, mesh=mesh
    )
    excitation = None
    if fault is not None:
        found = displacement_excitation(
            pair_of(machine, stage, mesh), mechanics.stiffness, errors, faults
        )
        excitation = found if found.errors else None
    return Turn(fault=fault, mechanics=mechanics, excitation=excitation)


def pair_of(machine: Machine, stage: int, mesh: int) -> MeshPair:
    """Return the pair of gears of a mesh."""
    return mesh_pairs(machine.stages[stage - 1], stage, machine.path)[mesh]


def common_grid(turns: Sequence[Turn], highest_hz: float) -> PhaseGrid:
    """Return panels on which all these turns can be solved, up to a frequency [Hz]."""
    corners = np.concatenate([turn.corners for turn in turns])
    return PhaseGrid.between(corners, max(turn_cycles(turn, highest_hz) for turn in turns))


def solved(turns: Sequence[Turn], period: int, even: EvenMesh) -> Deviations:
    """Solve turns of one gear whose damping and even mesh are the same."""
    window = min(period, max(turn.window for turn in turns))
    grid, own = even.grid, turns[0].mechanics
    scale = 1 / (own.equivalent_mass_kg * own.mesh_frequency_hz**2)
    kappa = np.stack([turn.stiffness(grid, window) for turn in turns]) * scale
    moved = [turn.moved(grid, window) for turn in turns]
    still = np.zeros(kappa.shape[1:])
    excitation = None
    if any(e is not None for e in moved):
        excitation = np.stack([still if e is None else e for e in moved])
    return deviations(even, period, kappa, excitation)


def first_order(
    turns: Sequence[Turn], losses: FloatArray, period: int, even: EvenMesh
) -> Deviations:
    """Answer turns of one gear to first order, per unit of the losses that they have."""
    if any(turn.excitation is not None for turn in turns):
        raise ArgumentError("the answer per unit of loss is of lost stiffness, not of lost profile")
    window = min(period, max(turn.window for turn in turns))
    own = turns[0].mechanics
    scale = 1 / (own.equivalent_mass_kg * own.mesh_frequency_hz**2)
    lost = np.stack([even.kappa - scale * turn.stiffness(even.grid, window) for turn in turns])
    return linear_deviations(even, period, lost / losses[:, None, None, None])


def pair_loss(turn: Turn, healthy: StageMechanics) -> float:
    """Return the share of the stiffness of a pair, integrated over its contact, that is lost."""
    own, whole = turn.mechanics.stiffness, healthy.stiffness.mean_n_per_m
    return float(own.period_mesh * (1 - own.mean_n_per_m / whole))


def _end(train: PulseTrain) -> float:
    return max(
        (t.offset + t.pulse.length + t.face_end * train.overlap_ratio for t in train.terms),
        default=0.0,
    )


def _corners(train: PulseTrain) -> FloatArray:
    found = [np.zeros(0)]
    for term in train.terms:
        limits = term.offset + np.concatenate([term.pulse.starts, term.pulse.ends])
        faces = (term.face_start, term.face_end) if train.overlap_ratio else (0.0,)
        found += [limits + face * train.overlap_ratio for face in faces]
    return np.concatenate(found)


def turn_cycles(turn: Turn, highest_hz: float) -> float:
    """Return the cycles a mesh period that panels are to follow: motion times highest line.

    The motion itself is followed with a margin, also where no high line is asked for.
    """
    own, natural = turn.mechanics, turn.mechanics.natural_frequency_hz
    fastest = max(2 * natural, natural + highest_hz) / own.mesh_frequency_hz
    return max(fastest, turn.fastest)


def default_limit_hz(mechanics: StageMechanics) -> float:
    """Return up to which frequency [Hz] the lines of a healthy mesh are shown by default."""
    return max(10 * mechanics.mesh_frequency_hz, 2 * mechanics.natural_frequency_hz)


def operating_point(machine: Machine, number: int) -> OperatingPoint:
    """Return an operating point, counted from 0."""
    check_range("operating", number, 0, len(machine.operating) - 1)
    return machine.operating[number]


def mesh_with(machine: Machine, stage: int, gear: str) -> int:
    """Return in which mesh of its stage a gear is taken: that with the sun, but for the ring.

    Raises
    ------
    ArgumentError
        If there is no such stage, or no such gear in it.
    """
    check_range("stage", stage, 1, len(machine.stages))
    pairs = mesh_pairs(machine.stages[stage - 1], stage, machine.path)
    for number, pair in enumerate(pairs):
        if gear in (member.name for member in pair.members):
            return number
    known = list(dict.fromkeys(m.name for pair in pairs for m in pair.members))
    near = nearest_name(gear, known)
    hint = f"; did you mean {near}?" if near else ""
    raise ArgumentError(f"gear {gear!r} is not in stage {stage}: {', '.join(known)}{hint}")
