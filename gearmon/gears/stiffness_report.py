"""Stiffness of the meshes of a machine: tables and data for pictures.

`stiffness_report` holds healthy and damaged teeth against each other, `compare_forms` the forms of
a healthy mesh: curves over mesh periods, and their lines.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gearmon.arrays import FloatArray
from gearmon.errors import ArgumentError
from gearmon.gears.damage import PairLoss, acting_faults, size_for_loss, stiffness_loss
from gearmon.gears.faults import LEVELS, Fault, faults_of, flank_level, flank_share
from gearmon.gears.kinematics import kinematics
from gearmon.gears.mechanics import known_force, pair_of, pairs_of
from gearmon.gears.pairs import MeshPair
from gearmon.gears.stiffness import AnyForm, MeshStiffness, mesh_stiffness
from gearmon.gears.tooth_damage import largest_size
from gearmon.gears.tooth_pairs import ToothPair, teeth_of
from gearmon.result import Result, channel_rows

#: Points of a table on a mesh period, and mesh harmonics of a spectrum.
POINTS_PER_MESH, HARMONICS = 200, 20
#: The four forms, before the hyphen, and their variants: the duty of the rectangle is eps_a - 1, or
#: one half.
FOUR_FORMS = ("parabolic", "wave", "rectangular", "rectangular-half", "fourier-true", "fourier")
#: Sizes at which a curve of loss against size is taken.
CURVE_POINTS = 25
#: Unit and dimensions in which a loss of each kind is told as a size.
MEASURED_UNITS = {"crack": "mm", "breakage": "mm", "wear": "mm", "pitting": "flank"}


@dataclass(frozen=True, kw_only=True, eq=False)
class FormComparison(Result):
    """Forms of the stiffness of one mesh side by side.

    Parameters
    ----------
    machine : str
    stage : int
    mesh : str
    contact_ratio, overlap_ratio : float
        Transverse contact ratio and overlap ratio.
    forms : tuple of MeshStiffness
    table : list of dict
        The curves: one row a phase, one column a form, in N/m.
    spectrum : list of dict
        One row a mesh harmonic, amplitudes in N/m.
    """

    picture = "expected_plots.form_figure"

    machine: str
    stage: int
    mesh: str
    contact_ratio: float
    overlap_ratio: float
    forms: tuple[MeshStiffness, ...]
    table: list[dict[str, Any]]
    spectrum: list[dict[str, Any]]

    def rows(self) -> list[dict[str, Any]]:
        """Return the curves: one row a phase, one column a form, in N/m."""
        return self.table


def compare_forms(machine: Any, stage: int = 1) -> FormComparison:
    """Return the four forms of the stiffness of a healthy mesh side by side, with their spectra.

    Parameters
    ----------
    machine : Machine
    stage : int
        Counted from 1; of a planetary stage its sun-planet mesh.

    Returns
    -------
    FormComparison

    Raises
    ------
    ArgumentError
        If the machine lacks data, or has no such stage.
    """
    pair, point = pair_of(machine, stage), machine.operating[0]
    hertz = kinematics(machine).mesh(stage).order * point.shaft1_hz
    # most forms do without a load
    force = known_force(machine, pair, point)
    forms = tuple(mesh_stiffness(pair, (), name, force_n=force) for name in FOUR_FORMS)
    phase = np.arange(2 * POINTS_PER_MESH + 1) / POINTS_PER_MESH
    heads = [f"{name.replace('-', '_')}_n_per_m" for name in FOUR_FORMS]
    table = channel_rows("mesh_phase", phase, [own.at(phase) for own in forms], heads)
    amplitudes = [own.mesh_amplitudes(HARMONICS) for own in forms]
    lines = channel_rows("frequency_hz", hertz * np.arange(1, HARMONICS + 1), amplitudes, heads)
    return FormComparison(
        machine=machine.name,
        stage=stage,
        mesh=pair.name,
        contact_ratio=pair.contact_ratio,
        overlap_ratio=pair.overlap_ratio,
        forms=forms,
        table=[{"stage": stage} | row for row in table],
        spectrum=[{"stage": stage, "mesh_harmonic": n} | row for n, row in enumerate(lines, 1)],
    )


@dataclass(frozen=True)
class FaultLoss:
    """A fault, what it costs, and the size or loss on the other side.

    Parameters
    ----------
    fault : Fault
    loss : PairLoss or None
        Of the pair of the damaged tooth; None where the teeth are not known.
    measured : str
        The size that means the same mean loss, where the fault is given as a loss; else its own.
    sized : Fault or None
        The fault with a size that can be varied and drawn, where there is one.
    """

    fault: Fault
    loss: PairLoss | None = None
    measured: str = ""
    sized: Fault | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return what it costs in built-in types; of pitting, also of a loss, its level."""
        found: dict[str, Any] = {"fault": str(self.fault), "size": self.measured}
        if self.fault.kind == "pitting" and self.sized is not None:
            level = flank_level(flank_share(self.sized.size, self.sized.unit))
            found |= {} if level is None else {"level": f"{level} ({LEVELS[level][0]})"}
        if self.loss is None:
            return found
        losses = {"mean_loss": self.loss.mean, "greatest_loss": self.loss.greatest}
        return found | losses | {"loss_at_middle": self.loss.at_middle}


@dataclass(frozen=True, eq=False)
class SizeCurve:
    """Loss of pair stiffness against the size of a damage.

    Parameters
    ----------
    fault : Fault
        With the size in hand, 0 where there is none.
    sizes : ndarray
        In the unit of the fault.
    mean_loss, greatest_loss : ndarray
        Shares of the stiffness of the pair.
    """

    fault: Fault
    sizes: FloatArray
    mean_loss: FloatArray
    greatest_loss: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class StageStiffness:
    """Stiffness of one mesh.

    Parameters
    ----------
    stage : int
    mesh : str
    healthy, damaged : MeshStiffness
        The same object where there is no fault.
    faults : tuple of FaultLoss
    teeth : ToothPair or None
        Where they are known, to be drawn.
    warnings : tuple of str
    """

    stage: int
    mesh: str
    healthy: MeshStiffness
    damaged: MeshStiffness
    faults: tuple[FaultLoss, ...]
    teeth: ToothPair | None
    warnings: tuple[str, ...]

    @property
    def phase(self) -> FloatArray:
        """Mesh phases of the table [mesh periods].

        One mesh period, or the contact of the first damaged tooth and a mesh period on both sides:
        the tooth before and the tooth after show what is sound.
        """
        teeth = [entry.fault.tooth for entry in self.faults if entry.fault.tooth is not None]
        meshes = math.ceil(self.healthy.total_contact_ratio) + 2 if teeth else 1
        first = teeth[0] - 2 if teeth else 0
        return first + np.arange(meshes * POINTS_PER_MESH + 1) / POINTS_PER_MESH

    def shares(self, phase: ArrayLike) -> dict[str, FloatArray]:
        """Return the share of each cause in the compliance of a sound pair along its contact.

        Parameters
        ----------
        phase : array_like
            Phases of the contact of one pair [mesh periods].
        """
        return self.teeth.compliances(self.teeth.roll(phase)).shares if self.teeth else {}

    @property
    def drawn(self) -> tuple[Fault, ...]:
        """What can be drawn of faults: of each gear the tooth that is damaged first.

        With one crack: a second one, of which the loss is told, has no place of its own.
        """
        told = (entry.sized if entry.fault.is_loss else entry.fault for entry in self.faults)
        teeth: dict[str, int | None] = {}
        drawn = [f for f in told if f and teeth.setdefault(f.gear, f.tooth) == f.tooth]
        cracks = {f.gear: f for f in reversed(drawn) if f.kind == "crack"}
        return tuple(f for f in drawn if f.kind != "crack" or f is cracks[f.gear])

    @cached_property
    def curve(self) -> SizeCurve | None:
        """Loss against the size of the first fault that has one; without faults of a root crack."""
        if self.teeth is None:
            return None
        names = [tooth.name for tooth in self.teeth.teeth]
        sized = [entry.sized for entry in self.faults if entry.sized is not None]
        if not self.faults:
            place: dict[str, Any] = {"stage": self.stage, "gear": names[0], "tooth": 1}
            sized = [Fault(kind="crack", size=0.0, unit="mm", **place)]
        return size_curve(sized[0], self.teeth, names.index(sized[0].gear)) if sized else None

    def rows(self) -> list[dict[str, Any]]:
        """Return the table: one row a phase, stiffness in N/m."""
        both = [mesh.at(self.phase) for mesh in (self.healthy, self.damaged)]
        names = ("healthy_n_per_m", "damaged_n_per_m")
        rows = channel_rows("mesh_phase", self.phase, both, names)
        return [{"stage": self.stage, "mesh": self.mesh} | row for row in rows]

    def to_dict(self) -> dict[str, Any]:
        """Return everything but what is drawn in built-in types."""
        return self.healthy.to_dict() | {
            "stage": self.stage,
            "mesh": self.mesh,
            "contact_ratio": self.healthy.contact_ratio,
            "overlap_ratio": self.healthy.overlap_ratio,
            "damaged_mean_stiffness_n_per_m": self.damaged.mean_n_per_m,
            "period_mesh": self.damaged.period_mesh,
            "faults": [entry.to_dict() for entry in self.faults],
            "compliance_shares_at_middle": {
                name: float(share)
                for name, share in self.shares(0.5 * self.healthy.contact_ratio).items()
            },
            "warnings": list(self.warnings),
            "table": self.rows(),
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class StiffnessReport(Result):
    """Stiffness of the meshes of a machine.

    Parameters
    ----------
    machine : str
    stages : tuple of StageStiffness
        One for each mesh: of a planetary stage sun and planet, then planet and ring.
    """

    picture = "expected_plots.stiffness_figures"

    machine: str
    stages: tuple[StageStiffness, ...]

    def rows(self) -> list[dict[str, Any]]:
        """Return the tables of all stages, one after the other."""
        return [row for stage in self.stages for row in stage.rows()]


def stiffness_report(
    machine: Any,
    faults: Iterable[Fault | str] = (),
    *,
    form: AnyForm = "potential-energy",
    stage: int | None = None,
) -> StiffnessReport:
    """Return the stiffness of the meshes of a machine, healthy and damaged.

    Parameters
    ----------
    machine : Machine
    faults : iterable of Fault or str
        Such as "crack:1:pinion:5:1.5mm" or "crack:1:pinion:5:20%".
    form : str, StiffnessForm or PotentialEnergy
        See `gears.stiffness.mesh_stiffness`.
    stage : int, optional
        Only this stage, counted from 1; by default all of them.

    Returns
    -------
    StiffnessReport

    Raises
    ------
    ArgumentError
        If the machine lacks data, its gears cannot run, or a fault does not fit.
    """
    last = len(machine.stages)
    known = faults_of(faults, errors=False, stages=last)
    numbers = range(1, last + 1) if stage is None else [stage]
    pairs = [pair for number in numbers for pair in pairs_of(machine, number)]
    # overrides of a planetary stage are meant for sun and planet
    able = [pair for pair in pairs if pair.is_main or pair.stage.module_mm is not None]
    stages = tuple(_mesh(machine, pair, known, form) for pair in able)
    return StiffnessReport(machine=machine.name, stages=stages)


def size_curve(fault: Fault, pair: ToothPair, index: int) -> SizeCurve:
    """Return the loss of pair stiffness against the size of a damage.

    Parameters
    ----------
    fault : Fault
        With a size in mm or as share of the flank; everything but its size is kept.
    pair : ToothPair
    index : {0, 1}
        Gear of the damaged tooth.
    """
    sizes = np.linspace(0.0, largest_size(fault, pair.teeth[index]), CURVE_POINTS)
    losses = [stiffness_loss(replace(fault, size=size), pair, index) for size in sizes.tolist()]
    mean, greatest = np.array([(loss.mean, loss.greatest) for loss in losses]).T
    return SizeCurve(fault, sizes, mean, greatest)


def _mesh(machine: Any, pair: MeshPair, known: Sequence[Fault], form: AnyForm) -> StageStiffness:
    force = known_force(machine, pair, machine.operating[0])
    faults = [own for own in known if own.stage == pair.number]
    healthy = mesh_stiffness(pair, (), form, force_n=force)
    damaged = mesh_stiffness(pair, faults, form, force_n=force) if faults else healthy
    notes, teeth = list(damaged.warnings), None
    try:
        teeth = teeth_of(pair)
    except ArgumentError as error:
        notes.append(f"no picture and no sizes: {error}")
    acting = acting_faults(pair, faults)[0]
    losses = tuple(_fault_loss(fault, pair, teeth) for fault in acting)
    return StageStiffness(
        stage=pair.number or 1,
        mesh=pair.name,
        healthy=healthy,
        damaged=damaged,
        faults=losses,
        teeth=teeth,
        warnings=tuple(dict.fromkeys(notes)),
    )


def _fault_loss(fault: Fault, pair: MeshPair, teeth: ToothPair | None) -> FaultLoss:
    if teeth is None:
        return FaultLoss(fault)
    index = pair.names.index(fault.gear)
    loss, told = stiffness_loss(fault, teeth, index), fault.size_text or "whole tooth"
    if fault.unit == "level":
        sized = replace(fault, unit="flank", size=flank_share(fault.size, fault.unit))
        return FaultLoss(fault, loss, told, sized)
    if not fault.is_loss:
        return FaultLoss(fault, loss, told, None if fault.unit == "tooth" else fault)
    if fault.kind not in MEASURED_UNITS:
        return FaultLoss(fault, loss)
    try:
        sized = replace(fault, unit=MEASURED_UNITS[fault.kind], size=0.0)
        found = size_for_loss(sized, loss.mean, teeth, index)
    except ArgumentError:
        return FaultLoss(fault, loss, "out of reach")
    return FaultLoss(fault, loss, f"{found.size:.3g}{found.unit}", found)
