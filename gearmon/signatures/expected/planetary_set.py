"""A planetary set as a part of its machine, and what a sensor on the housing hears of it.

The set vibrates as a part of its machine (`gears.drive_train`): the stiffness of each of its meshes
varies, each in its phase, those of other stages stay at their means. A damaged tooth of the sun or
the ring meets every planet in turn; that of a planet, the first one, meets the sun and, half a turn
of the planet later, the ring.

Of the forces F_p of planet p, in both of its meshes, the share d is heard only as it passes the
sensor,

    g_p(t) = 1 - d/2 + (d/2) cos(2 pi f_c t + psi_p),

so that every line of the forces has sidebands one turn of the carrier apart: line r of the turn of
a gear with z teeth is heard at (r/z) f_m + s f_c, s = -1, 0, 1, with w_s sum_p F_rp exp(i s psi_p),
w_0 = 1 - d/2, w_+-1 = d/4. The N equal planets of an equally spaced healthy set leave the lines
with k z_r + s divisible by N (McFadden and Smith, Proc. IMechE 199 C1 (1985) 65).

Lines are told as those of a pair are, whose motion z'' is its dynamic force over the equivalent
mass: as force on the housing over the equivalent mass of the sun-planet mesh.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from gearmon.errors import ArgumentError, check_range
from gearmon.gears.assembly import drive_train
from gearmon.gears.drive_train import DriveTrain
from gearmon.gears.excitation import Excitation
from gearmon.gears.faults import parse_fault_or_error
from gearmon.gears.kinematics import PLANET_PASS_DEPTH, Mesh, kinematics
from gearmon.gears.mechanics import StageMechanics
from gearmon.machine import Machine, PlanetaryStage
from gearmon.signals.array_types import FloatArray
from gearmon.signatures.expected.contact_motion import Deviations, PeriodicMotion, Surroundings
from gearmon.signatures.expected.mesh import Heard, PosedMesh, Wrong, operating_point, posed_mesh

#: Share of what planets bring to a line up to which they cancel.
CANCELLED = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class PosedSet:
    """All meshes of a planetary set at one operating point, ready to be solved.

    Parameters
    ----------
    members : tuple of (PosedMesh, float)
        The sun-planet meshes, then the planet-ring meshes, with their leads [mesh periods].
    mesh : Mesh
        Its kinematics.
    train : DriveTrain
        The machine around it.
    angles_rad : ndarray, shape (planets,)
        psi, where the planets sit.
    """

    members: tuple[tuple[PosedMesh, float], ...]
    mesh: Mesh
    train: DriveTrain
    angles_rad: FloatArray

    @property
    def sound(self) -> PosedSet:
        """The same with nothing wrong."""
        return replace(self, members=tuple((mesh.sound, lead) for mesh, lead in self.members))

    @property
    def mechanics(self) -> StageMechanics:
        """Of the mesh of sun and first planet."""
        own = self.members[0][0].mechanics
        return replace(own, assumptions=self.train.notes, warnings=())

    @property
    def order(self) -> float:
        """Mesh frequency over that of shaft 1."""
        return self.mesh.order

    @property
    def pass_order(self) -> Fraction:
        """Signed order of the carrier over that of the mesh."""
        return self.mesh.carrier / self.mesh.exact

    @property
    def period(self) -> int:
        """P, mesh periods after which it repeats."""
        return math.lcm(*(mesh.period for mesh, _ in self.members))

    @property
    def marked(self) -> dict[str, int]:
        """Gears that differ from tooth to tooth, and their teeth."""
        return {gear: z for mesh, _ in self.members for gear, z in mesh.marked.items()}

    @property
    def excitation(self) -> Excitation | None:
        """Any one of its meshes; None where nothing moves the flanks."""
        found = (mesh.excitation for mesh, _ in self.members)
        return next((own for own in found if own is not None), None)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is to be said of its teeth, and what was asked for and acts in no mesh."""
        told = [(*mesh.warnings, *mesh.mechanics.warnings) for mesh, _ in self.members]
        every = dict.fromkeys(word for own in told for word in own)
        mild = ("fault ", "error ")
        return tuple(w for w in every if not w.startswith(mild) or all(w in own for own in told))

    def limit_hz(self, max_hz: float | None) -> float:
        """Return up to which frequency [Hz] its lines are shown; 10 mesh harmonics by default."""
        return self.members[0][0].limit_hz(max_hz)

    @property
    def scale(self) -> float:
        """T^2 [s2]: coordinates are modes of unit mass."""
        return self.mechanics.mesh_frequency_hz**-2

    @property
    def highest_natural_hz(self) -> float:
        """Highest natural frequency [Hz]."""
        return math.sqrt(self.train.modes[0][-1]) / (2 * math.pi)

    @cached_property
    def around(self) -> Surroundings:
        """The machine around its meshes, in modes."""
        own, stage = self.mechanics, self.mechanics.stage
        around, period_s = self.train.around(self.train.meshes(stage)), 1 / own.mesh_frequency_hz
        torques = around.shapes.T @ self.train.load({stage: own.force_n})
        whole = around.damping + (around.vectors.T * around.dampers) @ around.vectors
        return Surroundings(
            stiffness=around.stiffness * period_s**2,
            damping=whole * period_s,
            vectors=around.vectors,
            dampers=around.dampers * period_s,
            force=torques * period_s**2,
        )

    def heard(self, made: PeriodicMotion | Deviations, highest: int, period: int) -> Heard:
        """Return the lines 1..highest of a period, with the sidebands of the planet pass."""
        forces = made.force_lines(highest) / self.scale
        forces = forces.reshape(-1, 2, len(self.angles_rad), highest).sum(axis=1)
        sides = np.array([-1, 0, 1] if self.mesh.carrier else [0])
        turned = np.exp(1j * np.outer(sides, self.angles_rad))
        depth = PLANET_PASS_DEPTH if self.mesh.carrier else 0.0
        weights = np.where(sides == 0, 1 - depth / 2, depth / 4)
        lines = weights[:, None] * np.einsum("sp,tpr->tsr", turned, forces)
        brought = np.abs(forces).sum(axis=1).max(axis=0)
        number = np.arange(1, highest + 1)
        turn = number / period + sides[:, None] * float(self.pass_order)
        kept = (np.abs(lines).max(axis=0) > CANCELLED * brought) & (turn > 0)
        which, line = np.nonzero(kept)
        angular = 2 * math.pi * self.mechanics.mesh_frequency_hz * turn[kept]
        # the dynamic force of a pair is -m z''
        moved = lines[:, which, line] / (self.mechanics.equivalent_mass_kg * angular**2)
        return Heard(number[line], sides[which], np.asarray(moved), made.mean_deflection[:, 0])


def posed_set(
    machine: Machine,
    stage: int,
    operating: int = 0,
    wrong: Iterable[Wrong | str] = (),
    *,
    form: str = "parabolic",
) -> PosedSet:
    """Pose a planetary set with what is wrong with it.

    Parameters
    ----------
    machine : Machine
        With what a baseline and `modes` need.
    stage, operating : int
        A planetary stage, counted from 1, and operating point, from 0.
    wrong : iterable of Fault, GearError or str
        Of any stage; those of others are left aside. What concerns one tooth of a planet, or a
        planet that runs out, concerns the first; wear and profiles concern all of them.
    form : str
        Of the stiffness curves.

    Raises
    ------
    ArgumentError
        If the stage is not planetary, the machine lacks data, or a fault does not fit it.
    """
    check_range("stage", stage, 1, len(machine.stages))
    own = machine.stages[stage - 1]
    if not isinstance(own, PlanetaryStage):
        raise ArgumentError(f"stage={stage} is not planetary: no planets pass the housing")
    train = drive_train(machine, operating_point(machine, operating), form)
    before = sum(isinstance(other, PlanetaryStage) for other in machine.stages[: stage - 1])
    known = [parse_fault_or_error(one) if isinstance(one, str) else one for one in wrong]
    shared = [one for one in known if one.gear != "planet" or one.kind in ("wear", "profile")]
    posed = {
        (side, first): posed_mesh(
            machine, stage, operating, known if first else shared, form=form, mesh=side
        )
        for side in (0, 1)
        for first in ((True, False) if len(shared) < len(known) else (True,))
    }
    count = own.planets
    members = tuple(
        (posed.get((side, i == 0), posed[side, True]), train.meshes(stage)[side * count + i].phase)
        for side in (0, 1)
        for i in range(count)
    )
    return PosedSet(
        members=members,
        mesh=kinematics(machine).mesh(stage),
        train=train,
        angles_rad=train.planets[before].angles_rad,
    )


def posed_stage(
    machine: Machine,
    stage: int,
    operating: int = 0,
    wrong: Iterable[Wrong | str] = (),
    *,
    form: str = "parabolic",
    mesh: int = 0,
) -> PosedMesh | PosedSet:
    """Pose a stage: a pair, or a planetary set as a whole if the machine file says enough.

    Parameters
    ----------
    machine, stage, operating, wrong, form, mesh
        As in `posed_mesh`, which is taken where the set cannot be.
    """
    if not isinstance(machine.stages[stage - 1], PlanetaryStage):
        return posed_mesh(machine, stage, operating, wrong, form=form)
    faults = tuple(wrong)
    try:
        found = posed_set(machine, stage, operating, faults, form=form)
        if all(own.is_local for own, _ in found.members):
            return found
        why = "an error of a turning gear acts all through the turn"
    except ArgumentError as error:
        why = str(error)
    alone = posed_mesh(machine, stage, operating, faults, form=form, mesh=mesh)
    told = f"the {alone.mechanics.mesh} mesh is taken by itself: {why}"
    return replace(alone, warnings=(*alone.warnings, told))
