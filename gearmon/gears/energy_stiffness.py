"""Mesh stiffness from the energy of the teeth: healthy and missing pulses of a pair of gears."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearmon.errors import ArgumentError
from gearmon.gears.curve_pulses import CurvePulse
from gearmon.gears.damage import gear_losses
from gearmon.gears.fault_sizes import measured_patches
from gearmon.gears.faults import Fault
from gearmon.gears.pairs import MeshPair
from gearmon.gears.potential_energy import PotentialEnergy, teeth_of
from gearmon.gears.pulse_trains import PulseTerm, PulseTrain
from gearmon.gears.tooth_mesh import PairState, TeethInMesh
from gearmon.gears.tooth_pairs import ToothPair


@dataclass(frozen=True, kw_only=True, eq=False)
class EnergyStiffness:
    """Parts of a mesh stiffness.

    Parameters
    ----------
    healthy : PulseTrain
    missing : tuple of PulseTrain
    variation : float
        Half the peak to peak of the healthy stiffness over its mean.
    warnings : tuple of str
    """

    healthy: PulseTrain
    missing: tuple[PulseTrain, ...]
    variation: float
    warnings: tuple[str, ...]


def energy_stiffness(
    pair: MeshPair, faults: Sequence[Fault], form: PotentialEnergy, force_n: float | None
) -> EnergyStiffness:
    """Return the stiffness of a mesh from its teeth.

    Parameters
    ----------
    pair : MeshPair
    faults : sequence of Fault
        That act in this mesh.
    form : PotentialEnergy
    force_n : float or None
        Static force on the line of action [N].

    Raises
    ------
    ArgumentError
        If data are missing, or damage does not fit its tooth.
    """
    if pair.given("stiffness_variation") is not None:
        raise ArgumentError(
            f"{pair.where}: stiffness_variation cannot be imposed on the {form.name} form, whose "
            f"curve follows from the teeth; leave it out or choose another form"
        )
    if form.contact == "load-dependent" and force_n is None:
        raise ArgumentError(
            f"{pair.where}: the load-dependent contact needs the static tooth force; give "
            f"torque_nm of [operating], force_n in this stage, or contact='constant'"
        )
    teeth = teeth_of(pair, form)
    mesh = TeethInMesh(
        pair=teeth, worn=_worn(pair, teeth, faults), is_coupled=form.is_coupled, force_n=force_n
    )
    factor = _factor(pair, teeth, form, force_n, faults)
    healthy = _train(pair, "all teeth", 1, [PulseTerm(pulse=mesh.healthy)], factor)
    return EnergyStiffness(
        healthy=healthy,
        missing=_missing(pair, teeth, mesh, faults, factor),
        variation=_variation(healthy),
        warnings=teeth.warnings,
    )


def energy_member(
    pair: MeshPair, faults: Sequence[Fault], form: PotentialEnergy, force_n: float | None
) -> Callable[[float], CurvePulse]:
    """Return what gives the pulse [N/m] of sound or worn pairs at other centre distances.

    Parameters
    ----------
    pair, faults, form, force_n
        As in `energy_stiffness`.

    Returns
    -------
    callable
        Maps what the contact ratio loses to the pulse of a pair, from its entry.
    """
    teeth = teeth_of(pair, form)
    factor = _factor(pair, teeth, form, force_n, faults)

    def member(lost: float) -> CurvePulse:
        moved = teeth.parted(lost)
        mesh = TeethInMesh(
            pair=moved,
            worn=_worn(pair, moved, faults),
            is_coupled=form.is_coupled,
            force_n=force_n,
        )
        return mesh.healthy.scaled(factor)

    return member


def _missing(
    pair: MeshPair, teeth: ToothPair, mesh: TeethInMesh, faults: Sequence[Fault], factor: float
) -> tuple[PulseTrain, ...]:
    names = [member.name for member in pair.members]
    z = (pair.first.teeth.teeth, pair.second.teeth.teeth)
    one, two = (gear_losses(pair, name, faults, teeth.contact_ratio, teeth) for name in names)
    trains = [
        _train(pair, names[0], z[0], mesh.terms(one, {}, z) if one else [], factor),
        _train(pair, names[1], z[1], mesh.terms({}, two, z) if two else [], factor),
        _train(
            pair,
            f"{names[0]} and {names[1]}",
            math.lcm(*z),
            mesh.meeting_terms(one, two, z) if one and two else [],
            factor,
        ),
    ]
    return tuple(train for train in trains if train.terms)


def _worn(pair: MeshPair, teeth: ToothPair, faults: Sequence[Fault]) -> PairState:
    """Return the loss by measured wear of each gear."""
    helical = pair.overlap_ratio > 0
    one, two = (
        measured_patches(
            [f for f in faults if f.kind == "wear" and f.gear == member.name and not f.is_loss],
            teeth,
            index,
            helical,
        )
        for index, member in enumerate(pair.members)
    )
    return one, two


def _factor(
    pair: MeshPair,
    teeth: ToothPair,
    form: PotentialEnergy,
    force_n: float | None,
    faults: Sequence[Fault],
) -> float:
    """Return what the pulses are multiplied by: wear given as a loss, and an imposed mean."""
    worn = math.prod(1 - f.loss for f in faults if f.kind == "wear" and f.is_loss)
    imposed = pair.given("mesh_stiffness_n_per_m")
    if imposed is None:
        return worn
    sound = TeethInMesh(pair=teeth, is_coupled=form.is_coupled, force_n=force_n)
    return worn * imposed / sound.healthy.area


def _train(
    pair: MeshPair, gear: str, period: int, terms: list[PulseTerm], factor: float
) -> PulseTrain:
    scaled = terms
    if factor != 1:
        scaled = [replace(term, pulse=term.pulse.scaled(factor)) for term in terms]
    return PulseTrain(
        gear=gear, period_mesh=period, overlap_ratio=pair.overlap_ratio, terms=tuple(scaled)
    )


def _variation(train: PulseTrain) -> float:
    pulse = train.terms[0].pulse
    corners = np.concatenate([pulse.starts, pulse.ends[-1:]])
    edges = np.unique(np.concatenate([corners, corners + train.overlap_ratio]) % 1.0)
    edges = np.concatenate([edges, edges[:1] + 1])
    inside = np.concatenate([[1e-9], np.arange(1, 32) / 32, [1 - 1e-9]])
    values = train.at(edges[:-1, None] + np.diff(edges)[:, None] * inside)
    return 0.5 * float(np.ptp(values)) / float(train.coefficients([0])[0].real)
