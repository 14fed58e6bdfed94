"""Turns whose errors act all the way round: eccentricity, cumulative pitch error, misalignment.

They shift the contact of every pair a little, and with it the corners of the stiffness; the panels
follow the corners round the turn.
"""

from __future__ import annotations

import math

import numpy as np

from gearmon.gears.modulation import ModulationTrain, state_of
from gearmon.signatures.fault_family_mesh import Turn, turn_cycles
from gearmon.signatures.fault_family_motion import ComplexArray, EvenMesh
from gearmon.signatures.fault_family_panels import FloatArray, PhaseGrid

#: Rounds of putting a corner where the contact is when it is reached: a shift of 1e-2 is then 1e-8.
ROUNDS = 4
#: Collocation points transformed together; bounds the memory.
POINTS_PER_BLOCK = 8192


def turn_grid(turn: Turn, highest_hz: float) -> PhaseGrid:
    """Return panels round a turn, with edges at all corners of stiffness and excitation."""
    period, own = turn.period, turn.mechanics
    found = [np.add.outer(np.arange(period), turn.corners).ravel(), _kinks(turn)]
    moving = [train for train in own.stiffness.modulations if _moves(train)]
    found += [_moved_corners(train, period, own.stiffness.overlap_ratio) for train in moving]
    if moving:
        # the contact as it would be without errors is no longer to be seen
        found[0] = np.zeros(0)
    return PhaseGrid.between(np.concatenate(found), turn_cycles(turn, highest_hz), period)


def solved_turn(turn: Turn, grid: PhaseGrid) -> EvenMesh:
    """Solve a turn as a whole: one period on panels all the way round."""
    own = turn.mechanics
    scale = 1 / (own.equivalent_mass_kg * own.mesh_frequency_hz**2)
    return EvenMesh(
        grid=grid,
        gamma=own.damping_ns_per_m * scale * own.mesh_frequency_hz,
        phi=own.force_n * scale,
        kappa=own.stiffness.at(grid.phase) * scale,
        excitation=None if turn.excitation is None else turn.excitation.at(grid.phase),
    )


def turn_lines(solved: EvenMesh, period: int, highest: int) -> ComplexArray:
    """Return the harmonics 1..highest of the turn of z [m]."""
    meshes = highest // period + 1
    phase, weights = solved.grid.phase.ravel(), solved.grid.weights.ravel()
    speed = weights * solved.motion[1].ravel()
    table = np.zeros((meshes, period), dtype=np.complex128)
    for low in range(0, len(phase), POINTS_PER_BLOCK):
        block = slice(low, low + POINTS_PER_BLOCK)
        turned = np.exp(-2j * np.pi * phase[block])
        slowly = np.exp(-2j * np.pi / period * phase[block])
        fast = _powers(turned, speed[block].astype(np.complex128), meshes)
        table += fast @ _powers(slowly, np.ones_like(slowly), period).T
    found = table.ravel()[1 : highest + 1]
    return np.asarray(found / (2j * np.pi * np.arange(1, highest + 1)))


def _powers(factor: ComplexArray, start: ComplexArray, count: int) -> ComplexArray:
    """Return start, start factor, start factor^2, ..., shape (count, points)."""
    found = np.empty((count, len(factor)), dtype=np.complex128)
    found[0] = start
    for number in range(1, count):
        np.multiply(found[number - 1], factor, out=found[number])
    return found


def _moves(train: ModulationTrain) -> bool:
    return any(offset.leaving or offset.entering for offset in train.offsets)


def _moved_corners(train: ModulationTrain, period: int, overlap: float) -> FloatArray:
    """Return where corners of the pulses of all pairs lie [mesh periods]."""
    family = train.family
    at_rest = family.pulse(0.0)
    edges = np.append(at_rest.starts, at_rest.ends[-1:])
    place = np.add.outer(np.arange(period), edges)
    spread = np.array([0.0, overlap] if overlap else [0.0])
    place = place[..., None] + spread
    home = place.copy()
    for _ in range(ROUNDS):
        flat = place.ravel()
        state = state_of(
            train.offsets, [2 * np.pi * flat / o.teeth for o in train.offsets], train.free_gap_m
        )
        shift = family.entry(state.leaving, state.entering)
        grown = _edge_shifts(train, state.lost.reshape(place.shape))
        place = home + shift.reshape(place.shape) + grown
    return np.asarray(place.ravel())


def _edge_shifts(train: ModulationTrain, lost: FloatArray) -> FloatArray:
    """Return by how much the edges of a pulse lie later where its contact ratio is smaller."""
    if not train.family.largest:
        return np.zeros(lost.shape)
    # the edges are linear in the contact ratio but for rounding: two pulses tell all
    half = 0.5 * train.family.largest
    more, less = (train.family.pulse(value) for value in (half, -half))
    slope = (
        np.append(more.starts, more.ends[-1:]) - np.append(less.starts, less.ends[-1:])
    ) / train.family.largest
    return np.asarray(lost * slope[:, None])


def _kinks(turn: Turn) -> FloatArray:
    """Return phases at which a wobbling gear changes the end of its face, or lifts off a part."""
    found = [np.zeros(1)]
    gap = turn.mechanics.stiffness.free_gap_m
    for train in turn.mechanics.stiffness.modulations:
        for offset in train.offsets:
            size, angle = abs(offset.lead_m), math.atan2(offset.lead_m.imag, offset.lead_m.real)
            if size:
                inner = math.acos(min(1.0, gap / size))
                ends = np.array([inner, math.pi - inner, math.pi + inner, -inner])
                whole = np.concatenate([ends, [0.5 * math.pi, 1.5 * math.pi]]) - angle
                found.append(whole / (2 * math.pi) * offset.teeth)
    return np.concatenate(found)
