"""Stiffness of the meshes of a machine: tables and data for pictures.

`stiffness_report` holds healthy and damaged teeth against each other, `compare_forms` the forms of
a healthy mesh: curves over mesh periods, and their lines; `teeth_picture` a pair of teeth to scale,
with cracks, spalls and pits where they are.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.errors import ArgumentError, check_range
from gearmon.gears.damage import PairLoss, acting_faults, size_for_loss, stiffness_loss
from gearmon.gears.faults import LEVELS, Fault, faults_of, flank_level, flank_share
from gearmon.gears.kinematics import kinematics
from gearmon.gears.mechanics import known_force, pair_of
from gearmon.gears.pairs import MeshPair, mesh_pairs
from gearmon.gears.stiffness import AnyForm, MeshStiffness, mesh_stiffness
from gearmon.gears.tooth import Tooth
from gearmon.gears.tooth_damage import Hole, largest_size, tooth_damage
from gearmon.gears.tooth_pairs import ToothPair, teeth_of
from gearmon.result import Result, channel_rows

#: Points of each curve of an outline.
POINTS = 60
#: Points of a table on a mesh period, and mesh harmonics of a spectrum.
POINTS_PER_MESH, HARMONICS = 200, 20
#: The four forms, before the hyphen, and their variants: the duty of the rectangle is eps_a - 1, or
#: one half.
FOUR_FORMS = ("parabolic", "wave", "rectangular", "rectangular-half", "fourier-true", "fourier")
#: Sizes at which a curve of loss against size is taken.
CURVE_POINTS = 25
#: Unit and dimensions in which a loss of each kind is told as a size.
MEASURED_UNITS = {"crack": "mm", "breakage": "mm", "wear": "mm", "pitting": "flank"}


@dataclass(frozen=True, eq=False)
class DrawnDamage:
    """A damage of a tooth, in its section and on its flank as the mate sees it; lengths in mm.

    Parameters
    ----------
    kind : {"crack", "spall", "pits", "breakage", "missing"}
    section : ndarray, shape (n, 2)
        Outline of what is lost; of a crack its line.
    face_start, face_width : float
        Along the face, from the side that enters contact first.
    low, high : float
        Heights above the root circle.
    """

    kind: str
    section: FloatArray
    face_start: float
    face_width: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class DrawnGear:
    """A gear in contact, cut square to its flanks; lengths in mm.

    Parameters
    ----------
    name : str
    outline : ndarray, shape (n, 2)
        Five teeth, the loaded one in the middle.
    damage : tuple of DrawnDamage
        Of the loaded tooth.
    face_width, flank_start, tip : float
        Width of the face, heights of the flank's lower end and of the tip above the root circle.
    """

    name: str
    outline: FloatArray
    damage: tuple[DrawnDamage, ...]
    face_width: float
    flank_start: float
    tip: float


@dataclass(frozen=True, eq=False)
class TeethPicture:
    """Two gears in contact, and the point at which they touch, shape (2,) [mm]."""

    gears: tuple[DrawnGear, DrawnGear]
    contact: FloatArray


@dataclass(frozen=True)
class _Frame:
    """Where a tooth stands, as complex numbers [m]: centre, and direction of its thickness.

    Points of a tooth are half thickness + i height.
    """

    tooth: Tooth
    centre: complex
    across: complex

    def place(self, points: ComplexArray) -> FloatArray:
        """Return points of the tooth in the plane [mm], shape (n, 2)."""
        placed = 1e3 * (self.centre + points * self.across)
        return np.stack([placed.real, placed.imag], axis=-1)

    def drawn(self, faults: Sequence[Fault]) -> DrawnGear:
        """Return the gear with those faults whose sizes are no losses."""
        tooth, profile = self.tooth, half_profile(self.tooth)
        root = tooth.sign * tooth.root_radius_m
        pitch = tooth.sign * 2 * math.pi / tooth.rack.teeth
        # teeth one after the other across the tooth in the middle
        turns = [cmath.exp(-1j * k * pitch) for k in range(-2, 3)]
        row = [turn * _between(-profile.conj(), profile) for turn in turns]
        own = [fault for fault in faults if fault.gear == tooth.name and not fault.is_loss]
        return DrawnGear(
            name=tooth.name,
            outline=self.place(np.concatenate(row)),
            damage=tuple(self._damage(own, profile)),
            face_width=1e3 * tooth.face_width_m,
            flank_start=1e3 * float(tooth.height(tooth.start) - root),
            tip=1e3 * (profile[-1].imag - root),
        )

    def _damage(self, faults: Sequence[Fault], profile: ComplexArray) -> Iterator[DrawnDamage]:
        tooth, damage = self.tooth, tooth_damage(faults, self.tooth)
        tip = profile[-1].imag
        width, root = tooth.face_width_m, tooth.sign * tooth.root_radius_m

        def drawn(kind: str, section: ComplexArray, *where: float) -> DrawnDamage:
            begin, part, low, high = (1e3 * x for x in where)
            foot = 1e3 * root
            return DrawnDamage(kind, self.place(section), begin, part, low - foot, high - foot)

        if damage.crack is not None:
            crack, start = damage.crack, tooth.crack_start
            line = start - 1j * np.array([0, crack.depths[1]]) * cmath.exp(-1j * crack.angle_rad)
            face = crack.start * width, crack.extent * width
            yield drawn("crack", line, *face, start.imag, start.imag)
        for hole in damage.holes:
            kind, face = "pits" if hole.round else "spall", (hole.start * width, hole.width_m)
            yield drawn(kind, _hole(hole, tooth), *face, hole.low_m, hole.high_m)
        for fault in faults:
            if fault.kind in ("breakage", "missing"):
                low = root if fault.height is None else tip - 1e-3 * fault.height
                lost = profile if fault.height is None else profile[profile.imag >= low]
                part = width if fault.kind == "missing" else 1e-3 * fault.size
                face = 1e-3 * (fault.start or 0.0), part
                yield drawn(fault.kind, _between(-lost.conj(), lost), *face, low, tip)


def teeth_picture(
    pair: ToothPair, faults: Sequence[Fault] = (), phase: float | None = None
) -> TeethPicture:
    """Return the picture of a pair of teeth in contact.

    The second gear stands above the first, a ring around it with its centre below.

    Parameters
    ----------
    pair : ToothPair
    faults : sequence of Fault
        Drawn on the loaded tooth of their gear where their sizes are no losses.
    phase : float, optional
        Contact phase [mesh periods]; by default the middle of the contact.
    """
    roll = pair.roll(0.5 * pair.contact_ratio if phase is None else phase)
    centres, working = pair.centres_m
    # the normal of the flank turns into the line of action
    rolled = zip(pair.teeth, pair.rolls(roll), strict=True)
    slopes = [float(tooth.slope(tooth.angle(own))) for tooth, own in rolled]
    one, two = (cmath.exp(1j * (working - slope)) for slope in slopes)
    frames = _Frame(pair.first, 0j, one), _Frame(pair.second, 1j * centres, -two)
    touching = pair.first.flank(pair.first.angle(roll))
    gears = frames[0].drawn(faults), frames[1].drawn(faults)
    return TeethPicture(gears, frames[0].place(touching))


def half_profile(tooth: Tooth) -> ComplexArray:
    """Return the loaded side from the root circle to the tip: half thickness + i height [m]."""
    flank = tooth.flank(np.linspace(tooth.start, tooth.tip, POINTS))
    root = [tooth.root_part(np.linspace(0, 1, POINTS))] if tooth.root_part else []
    return np.concatenate([*root, flank])


def _between(one: ComplexArray, other: ComplexArray) -> ComplexArray:
    """Return the outline along one curve and back along the other."""
    return np.concatenate([one, other[::-1]])


def _hole(hole: Hole, tooth: Tooth) -> ComplexArray:
    """Return the outline of missing material at its deepest section."""
    t = np.linspace(*hole.angles(tooth), POINTS)
    across = np.linspace(-1, 1, POINTS) if hole.round else np.zeros(POINTS)
    surface, depth = tooth.flank(t), hole.depth_m * np.sqrt(1 - across**2)
    return _between(surface, surface - depth * np.exp(1j * tooth.slope(t)))


@dataclass(frozen=True, eq=False)
class FormCurve:
    """One form of the stiffness of a mesh.

    Parameters
    ----------
    group, form : str
        The form, and the variant of it.
    stiffness : MeshStiffness
    stiffness_n_per_m : ndarray, shape (p,)
        At the phases of the comparison [N/m].
    amplitudes_n_per_m : ndarray, shape (n,)
        Of the mesh harmonics [N/m], exact and none aliased.
    """

    group: str
    form: str
    stiffness: MeshStiffness
    stiffness_n_per_m: FloatArray
    amplitudes_n_per_m: FloatArray

    def to_dict(self) -> dict[str, Any]:
        """Return what it makes of the mesh in built-in types."""
        mean, variation = self.stiffness.healthy_mean_n_per_m, self.stiffness.variation
        told = {"mean_stiffness_n_per_m": mean, "stiffness_variation": variation}
        return {"form": self.form} | told


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
    forms : tuple of FormCurve
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
    forms: tuple[FormCurve, ...]
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
    phase, curves = np.arange(2 * POINTS_PER_MESH + 1) / POINTS_PER_MESH, []
    for name in FOUR_FORMS:
        found = mesh_stiffness(pair, (), name, force_n=force)
        lines = 2 * np.abs(found.mesh_harmonics(HARMONICS)) * found.healthy_mean_n_per_m
        curves.append(FormCurve(name.split("-")[0], name, found, found.at(phase), lines))
    heads = [f"{own.form.replace('-', '_')}_n_per_m" for own in curves]
    table = channel_rows("mesh_phase", phase, [own.stiffness_n_per_m for own in curves], heads)
    amplitudes = np.transpose([own.amplitudes_n_per_m for own in curves]).tolist()
    spectrum = [
        {"stage": stage, "mesh_harmonic": n, "frequency_hz": n * hertz}
        | dict(zip(heads, row, strict=True))
        for n, row in enumerate(amplitudes, start=1)
    ]
    return FormComparison(
        machine=machine.name,
        stage=stage,
        mesh=pair.name,
        contact_ratio=pair.contact_ratio,
        overlap_ratio=pair.overlap_ratio,
        forms=tuple(curves),
        table=[{"stage": stage} | row for row in table],
        spectrum=spectrum,
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
    phase : ndarray
        Mesh phases of the table [mesh periods]: one mesh period, or the contact of the first
        damaged tooth and a mesh period on both sides.
    contact_phase : ndarray
        Phases of the contact of one pair [mesh periods].
    shares : dict of str to ndarray
        Share of each cause in the compliance of a sound pair, at `contact_phase`.
    faults : tuple of FaultLoss
    curve : SizeCurve or None
    picture : TeethPicture or None
    warnings : tuple of str
    """

    stage: int
    mesh: str
    healthy: MeshStiffness
    damaged: MeshStiffness
    phase: FloatArray
    contact_phase: FloatArray
    shares: dict[str, FloatArray]
    faults: tuple[FaultLoss, ...]
    curve: SizeCurve | None
    picture: TeethPicture | None
    warnings: tuple[str, ...]

    def rows(self) -> list[dict[str, Any]]:
        """Return the table: one row a phase, stiffness in N/m."""
        both = [mesh.at(self.phase) for mesh in (self.healthy, self.damaged)]
        names = ("healthy_n_per_m", "damaged_n_per_m")
        rows = channel_rows("mesh_phase", self.phase, both, names)
        return [{"stage": self.stage, "mesh": self.mesh} | row for row in rows]

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the picture in built-in types."""
        return {
            "stage": self.stage,
            "mesh": self.mesh,
            "form": self.healthy.form.name,
            "contact_ratio": self.healthy.contact_ratio,
            "overlap_ratio": self.healthy.overlap_ratio,
            "mean_stiffness_n_per_m": self.healthy.mean_n_per_m,
            "stiffness_variation": self.healthy.variation,
            "damaged_mean_stiffness_n_per_m": self.damaged.mean_n_per_m,
            "period_mesh": self.damaged.period_mesh,
            "faults": [entry.to_dict() for entry in self.faults],
            "compliance_shares_at_middle": {
                name: float(np.interp(0.5 * self.healthy.contact_ratio, self.contact_phase, share))
                for name, share in self.shares.items()
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
    if stage is not None:
        check_range("stage", stage, 1, last)
    numbers = range(1, last + 1) if stage is None else [stage]
    pairs = [p for n in numbers for p in mesh_pairs(machine.stages[n - 1], n, machine.path)]
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
    if fault.unit == "level":
        raise ArgumentError(f"fault {fault}: a level is no size to draw; give a share of the flank")
    sizes = np.linspace(0.0, largest_size(fault, pair.teeth[index]), CURVE_POINTS)
    losses = [stiffness_loss(replace(fault, size=size), pair, index) for size in sizes.tolist()]
    mean, greatest = np.array([(loss.mean, loss.greatest) for loss in losses]).T
    return SizeCurve(fault, sizes, mean, greatest)


def _mesh(machine: Any, pair: MeshPair, known: Sequence[Fault], form: AnyForm) -> StageStiffness:
    force = known_force(machine, pair, machine.operating[0])
    faults = [own for own in known if own.stage == pair.number]
    healthy = mesh_stiffness(pair, (), form, force_n=force)
    damaged = mesh_stiffness(pair, faults, form, force_n=force) if faults else healthy
    notes = list(damaged.warnings)
    teeth = _teeth(pair, notes)
    contact = np.linspace(0.0, healthy.contact_ratio, 201)
    acting = acting_faults(pair, faults)[0]
    losses = tuple(_fault_loss(fault, pair, teeth) for fault in acting)
    return StageStiffness(
        stage=pair.number or 1,
        mesh=pair.name,
        healthy=healthy,
        damaged=damaged,
        phase=_window(losses, healthy),
        contact_phase=contact,
        shares=teeth.compliances(teeth.roll(contact)).shares if teeth else {},
        faults=losses,
        curve=_curve(losses, pair, teeth) if teeth else None,
        picture=_picture(losses, teeth) if teeth else None,
        warnings=tuple(dict.fromkeys(notes)),
    )


def _teeth(pair: MeshPair, notes: list[str]) -> ToothPair | None:
    try:
        return teeth_of(pair)
    except ArgumentError as error:
        notes.append(f"no picture and no sizes: {error}")
        return None


def _window(losses: tuple[FaultLoss, ...], mesh: MeshStiffness) -> FloatArray:
    tooth = next((entry.fault.tooth for entry in losses if entry.fault.tooth is not None), None)
    # the tooth before and the tooth after show what is sound
    meshes = 1 if tooth is None else math.ceil(mesh.total_contact_ratio) + 2
    first = 0 if tooth is None else tooth - 2
    return first + np.arange(meshes * POINTS_PER_MESH + 1) / POINTS_PER_MESH


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


def _curve(losses: tuple[FaultLoss, ...], pair: MeshPair, teeth: ToothPair) -> SizeCurve | None:
    """Return the curve of the first fault that has a size; without faults that of a root crack."""
    sized = [entry.sized for entry in losses if entry.sized is not None]
    if not losses:
        gear, stage = pair.first.name, pair.number or 1
        sized = [Fault(kind="crack", stage=stage, gear=gear, tooth=1, size=0.0, unit="mm")]
    return size_curve(sized[0], teeth, pair.names.index(sized[0].gear)) if sized else None


def _picture(losses: tuple[FaultLoss, ...], teeth: ToothPair) -> TeethPicture:
    told = (entry.sized if entry.fault.is_loss else entry.fault for entry in losses)
    drawn = [fault for fault in told if fault is not None]
    seen: dict[str, int | None] = {}
    # one tooth of each gear is drawn: the first that is damaged
    return teeth_picture(teeth, [f for f in drawn if seen.setdefault(f.gear, f.tooth) == f.tooth])
