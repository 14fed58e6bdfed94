"""Meshes of a machine with what is wrong with them, posed for whoever solves them, and their lines.

Each stage is taken at one operating point. A pair is taken by itself: a healthy one repeats every
mesh period, with damaged teeth or errors on one gear every turn of that gear. Errors and lost
profile act as displacement excitation e(t) in ``m z'' + c (z - e)' + k(t) (z - e) = F``.

A planetary set vibrates as a part of its machine (`DriveTrain`): the stiffness of each of its
meshes varies, each in its phase, those of other stages stay at their means. A damaged tooth of the
sun or the ring meets every planet in turn; that of a planet, the first one, meets the sun and, half
a turn of the planet later, the ring.

Of the forces F_p of planet p, in both of its meshes, the share d is heard only as it passes the
sensor,

    g_p(t) = 1 - d/2 + (d/2) cos(2 pi f_c t + psi_p),

so that every line of the forces has sidebands one turn of the carrier apart: line r of the turn of
a gear with z teeth is heard at (r/z) f_m + s f_c, s = -1, 0, 1, with w_s sum_p F_rp exp(i s psi_p),
w_0 = 1 - d/2, w_+-1 = d/4. The N equal planets of an equally spaced healthy set leave the lines
with k z_r + s divisible by N (McFadden and Smith, Proc. IMechE 199 C1 (1985) 65).

Lines are those of the motion z of a pair along the line of action, before any path to a sensor:
without errors the deflection of the teeth. Its dynamic force is -m z''. So they follow from the
force, and those of a set are told alike: as force on the housing over the equivalent mass of the
sun-planet mesh.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from gearmon.arrays import ComplexArray, FloatArray, IntArray
from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.gears.assembly import drive_train
from gearmon.gears.excitation import FlankError
from gearmon.gears.faults import Fault, GearError, faults_of
from gearmon.gears.kinematics import PLANET_PASS_DEPTH, Mesh, kinematics
from gearmon.gears.mechanics import Around, DriveTrain, StageMechanics, stage_mechanics
from gearmon.gears.stiffness import MeshStiffness
from gearmon.machine import Machine, OperatingPoint, PlanetaryStage
from gearmon.signatures.signature import SIZES

if TYPE_CHECKING:  # an analysis solves no mesh
    from gearmon.dynamics import HillProblem

Wrong = Fault | GearError

#: Share of what planets bring to a line up to which they cancel.
CANCELLED = 1e-9
# What is told of a mesh beside its lines.
_TOLD: tuple[str, ...] = ("stage", "mesh", "mesh_frequency_hz", "force_n")
_TOLD += ("natural_frequency_hz", "damping_ratio", "equivalent_mass_kg", "damping_ns_per_m")
# Sensors of acoustic emission reach up to here [Hz]; beyond it lines by the million would follow.
_HIGHEST_HZ = 1e6


@dataclass(frozen=True, kw_only=True, eq=False)
class PosedStage:
    """A pair, or all meshes of a planetary set, at one operating point, ready to be solved.

    Parameters
    ----------
    members : tuple of StageMechanics
        With the faults; of a set the sun-planet meshes, then the planet-ring meshes.
    mesh : Mesh
        Its kinematics.
    train : DriveTrain or None
        The machine around it; None for a mesh that is taken by itself.
    angles_rad : ndarray, shape (planets,)
        psi, where the planets sit.
    note : str
        Why it is not taken as a whole.
    """

    members: tuple[StageMechanics, ...]
    mesh: Mesh
    train: DriveTrain | None = None
    angles_rad: FloatArray
    note: str = ""

    @property
    def mechanics(self) -> StageMechanics:
        """Of its first mesh."""
        return self.members[0]

    @property
    def pass_order(self) -> Fraction:
        """Signed order of a carrier whose planets pass the housing, over that of the mesh."""
        return Fraction(0) if self.train is None else self.mesh.carrier / self.mesh.exact

    @property
    def period(self) -> int:
        """P, mesh periods after which it repeats."""
        return math.lcm(*(mesh.excitation.period_mesh for mesh in self.members))

    @property
    def marked(self) -> dict[str, int]:
        """Gears that differ from tooth to tooth, and their teeth."""
        trains = (train for mesh in self.members for train in mesh.stiffness.pulses)
        damaged = {t.gear: t.period_mesh for t in trains if " and " not in t.gear}
        # an error that modulates the stiffness moves the flanks too
        return damaged | {e.wrong.gear: e.period_mesh for e in self.errors if e.period_mesh > 1}

    @property
    def errors(self) -> list[FlankError]:
        """What moves the flanks of its meshes."""
        return [error for mesh in self.members for error in mesh.excitation.errors]

    @property
    def is_local(self) -> bool:
        """Whether faults act in a few mesh periods of a turn, or in all of them alike."""
        turning = any(e.gap is None and e.period_mesh > 1 for e in self.errors)
        return not turning and not any(mesh.stiffness.modulations for mesh in self.members)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is to be said of its teeth, and what was asked for and acts in no mesh."""
        told = [mesh.stiffness.warnings for mesh in self.members]
        every = dict.fromkeys(word for own in told for word in own)
        mild = ("fault ", "error ")
        kept = (w for w in every if not w.startswith(mild) or all(w in own for own in told))
        return (*kept, *filter(None, [self.note]))

    @property
    def sound(self) -> PosedStage:
        """The same with nothing wrong with single teeth."""
        return self._with(lambda k: replace(k, pulses=(), modulations=()), errors=())

    def scaled(self, factor: float) -> PosedStage:
        """Return the same with `factor` times what its damaged teeth lose."""
        return self._with(lambda k: replace(k, pulses=tuple(t.scaled(factor) for t in k.pulses)))

    def _with(self, changed: Callable[[MeshStiffness], MeshStiffness], **moved: Any) -> PosedStage:
        members = []
        for mesh in self.members:
            own = replace(mesh.excitation, stiffness=changed(mesh.stiffness), **moved)
            members.append(replace(mesh, excitation=own))
        return replace(self, members=tuple(members))

    def loss(self, whole: PosedStage) -> float:
        """Return the share of the stiffness of a pair, integrated over its contact, that is lost.

        The greatest of its meshes. A stiffness that errors modulate loses nothing: its mean wanders
        a little.
        """
        both = zip(self.members, whole.members, strict=True)
        return max(
            0.0 if k.modulations else k.period_mesh * (1 - k.mean_n_per_m / even.mean_n_per_m)
            for k, even in ((own.stiffness, sound.stiffness) for own, sound in both)
        )

    @cached_property
    def modes(self) -> Around:
        """The machine in modes under its load; of a pair by itself its mass is all there is."""
        own, none = self.mechanics, np.zeros((1, 1))
        if self.train is not None:
            load = self.train.load({own.stage: own.force_n})
            return self.train.around(self.train.meshes(own.stage), load[:, None])
        shape = none + own.equivalent_mass_kg**-0.5
        return Around(
            vectors=shape,
            means=none[0] + own.stiffness.healthy_mean_n_per_m,
            dampers=none[0] + own.damping_ns_per_m,
            stiffness=none,
            damping=none,
            inputs=own.force_n * shape,
        )

    def limit_hz(self, max_hz: float | None) -> float:
        """Return up to which frequency [Hz] its lines are shown; 10 mesh harmonics by default."""
        if max_hz is not None:
            check_positive("max_hz", max_hz, "Hz")
            return check_range("max_hz", max_hz, 0.0, _HIGHEST_HZ, "Hz")
        own = self.mechanics
        return max(10 * own.mesh_frequency_hz, 2 * own.natural_frequency_hz)

    def heard(self, forces: ComplexArray, period: int) -> tuple[dict[str, Any], ComplexArray]:
        """Return the lines that mesh forces make, of a set with sidebands of the planet pass.

        Parameters
        ----------
        forces : ndarray of complex, shape (turns, meshes, highest)
            Lines 1..highest over the period [N].
        period : int
            P.

        Returns
        -------
        places : dict
            `period`, `number` and `carrier` of the lines, as in `MeshLines`.
        lines : ndarray of complex, shape (turns, n)
            As `MeshLines.displacement`.
        """
        planets, highest = len(self.angles_rad), forces.shape[-1]
        shape = len(forces), len(self.members) // planets, planets, highest
        forces = forces.reshape(shape).sum(axis=1)
        sides = np.array([-1, 0, 1] if self.pass_order else [0])
        turned = np.exp(1j * np.outer(sides, self.angles_rad))
        depth = PLANET_PASS_DEPTH if self.pass_order else 0.0
        weights = np.where(sides == 0, 1 - depth / 2, depth / 4)
        lines = (weights[:, None] * turned) @ forces
        number = np.arange(1, highest + 1)
        turn = number / period + sides[:, None] * float(self.pass_order)
        kept = turn > 0
        if self.train is not None:
            brought = np.abs(forces).sum(axis=1, keepdims=True)
            # each turn beside its own loudest line
            loudest = brought.max(axis=2, keepdims=True, initial=np.finfo(float).tiny)
            share = (np.abs(lines) / loudest).max(axis=0)
            kept &= share > CANCELLED * (brought / loudest).max(axis=0)
        which, line = np.nonzero(kept)
        own = self.mechanics
        angular = 2 * math.pi * own.mesh_frequency_hz * turn[kept]
        places = {"period": period, "number": number[line], "carrier": sides[which]}
        return places, lines[:, kept] / (own.equivalent_mass_kg * angular**2)

    def hill_problem(self, harmonics: ComplexArray) -> HillProblem:
        """Return the equation of a pair without excitation, by the harmonics of its stiffness."""
        from gearmon.dynamics import HillProblem

        own = self.mechanics
        return HillProblem(
            mass_kg=own.equivalent_mass_kg,
            damping_ns_per_m=own.damping_ns_per_m,
            stiffness_n_per_m=own.stiffness.mean_n_per_m,
            stiffness_harmonics=harmonics,
            period_s=own.period_s,
            force_n=own.force_n,
        )


@dataclass(frozen=True)
class MeshPlace:
    """A mesh of a machine at an operating point: where faults are to be.

    Parameters
    ----------
    machine : Machine
        With the data that a baseline needs; what is missing is named in the error.
    stage, operating : int
        Stage counted from 1, operating point from 0.
    form : str
        Form of the stiffness curve, see `gears.stiffness.mesh_stiffness`.
    mesh : {0, 1}
        Of a planetary stage 0 for sun and planet, 1 for planet and ring.

    Raises
    ------
    ArgumentError
        If there is no such stage or operating point.
    """

    machine: Machine
    stage: int
    operating: int = 0
    form: str = "parabolic"
    mesh: int = 0

    def __post_init__(self) -> None:
        check_range("stage", self.stage, 1, len(self.machine.stages))
        check_range("operating", self.operating, 0, len(self.machine.operating) - 1)

    @property
    def point(self) -> OperatingPoint:
        """The operating point."""
        return self.machine.operating[self.operating]

    def alone(self, wrong: Iterable[Wrong | str] = (), why: str = "") -> PosedStage:
        """Pose the mesh, taken by itself, with what is wrong with it.

        Parameters
        ----------
        wrong : iterable of Fault, GearError or str
            Of any stage; those of others are left aside.
        why : str
            Reason to be noted.

        Raises
        ------
        ArgumentError
            If the machine lacks data, or a fault does not fit it.
        """
        mesh = kinematics(self.machine).mesh(self.stage)
        own = self._meshed(self.mesh, faults_of(wrong, errors=True))
        note = f"the {own.mesh} mesh is taken by itself: {why}" if why else ""
        return PosedStage(members=(own,), mesh=mesh, angles_rad=np.zeros(1), note=note)

    def posed(self, wrong: Iterable[Wrong | str] = ()) -> PosedStage:
        """Pose a pair, or a planetary set as a part of its machine if the file says enough.

        Parameters
        ----------
        wrong
            As in `alone`, which is taken where the set cannot be. What concerns one tooth of a
            planet, or a planet that runs out, concerns the first; wear and profiles concern all of
            them.
        """
        stage, known = self.machine.stages[self.stage - 1], faults_of(wrong, errors=True)
        if not isinstance(stage, PlanetaryStage):
            return replace(self, mesh=0).alone(known)
        alike = tuple(w for w in known if w.gear != "planet" or w.kind in ("wear", "profile"))
        places = [(side, alike if i else known) for side in (0, 1) for i in range(stage.planets)]
        try:
            train = drive_train(self.machine, self.point, self.form)
            springs, meshed = train.meshes(self.stage), cache(self._meshed)
            every = zip(places, springs, strict=True)
            found = PosedStage(
                members=tuple(replace(meshed(*own), lead=spring.phase) for own, spring in every),
                mesh=kinematics(self.machine).mesh(self.stage),
                train=train,
                angles_rad=train.planets[self.stage].angles_rad,
            )
        except ArgumentError as error:
            return self.alone(known, str(error))
        if found.is_local:
            return found
        return self.alone(known, "an error of a turning gear acts all through the turn")

    def _meshed(self, mesh: int, wrong: Sequence[Wrong]) -> StageMechanics:
        place = self.machine, self.stage, self.point
        return stage_mechanics(*place, faults=wrong, form=self.form, mesh=mesh)


def mesh_problem(
    machine: Machine,
    stage: int = 1,
    operating: int = 0,
    *,
    form: str = "parabolic",
    harmonics: int = 32,
    mesh: int = 0,
) -> HillProblem:
    """Return Hill's equation of a healthy mesh at an operating point, to look at by itself.

    Parameters
    ----------
    machine, stage, operating, form, mesh
        As in `MeshPlace`.
    harmonics : int, 1 to 10,000
        Stiffness harmonics taken.

    Returns
    -------
    HillProblem

    Raises
    ------
    ArgumentError
        If there is no such stage or operating point, or the machine lacks data.
    """
    place = MeshPlace(machine, stage, operating, form, mesh)
    check_range("harmonics", harmonics, 1, 10_000)
    if place.point.torque_nm == 0:
        raise ArgumentError(f"operating[{operating + 1}]: torque_nm is 0, no tooth is pressed")
    posed = place.alone()
    return posed.hill_problem(posed.mechanics.stiffness.harmonics(harmonics))


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshLines:
    """Lines of one mesh.

    Parameters
    ----------
    posed : PosedStage
        What was solved, with its faults.
    period : int
        P, the true period [mesh periods]; 1 where all are alike.
    number : ndarray of int, shape (n,)
        r: frequencies r/P of the mesh frequency.
    carrier : ndarray of int, shape (n,)
        s: turns of the carrier beside them, of sidebands by the planets' pass; else 0.
    displacement : complex ndarray, shape (n,)
        z_r [m] of ``z = z_0 + sum (z_r exp(2 pi i r s/P) + conj)`` with s the mesh phase: peak
        amplitudes are 2 abs(z_r).
    method : str
        How it was solved.
    error : float
        Relative error of the acceleration.
    contact_lost : bool
        Whether teeth part: the linear model ends there.
    mean_m : float
        Mean of z [m].
    """

    posed: PosedStage
    period: int
    number: IntArray
    carrier: IntArray
    displacement: ComplexArray
    method: str
    error: float
    contact_lost: bool
    mean_m: float

    @property
    def mechanics(self) -> StageMechanics:
        """Of its first mesh, with the faults."""
        return self.posed.mechanics

    @property
    def order(self) -> FloatArray:
        """Frequencies over that of shaft 1, shape (n,)."""
        return np.asarray(self._turns * self.posed.mesh.order)

    @property
    def frequency_hz(self) -> FloatArray:
        """Frequencies [Hz], shape (n,)."""
        return np.asarray(self._turns * self.mechanics.mesh_frequency_hz)

    @property
    def _turns(self) -> FloatArray:
        """Frequencies over that of the mesh."""
        return np.asarray(self.number / self.period + self.carrier * float(self.posed.pass_order))

    @property
    def acceleration(self) -> ComplexArray:
        """Acceleration lines [m/s2], shape (n,)."""
        return np.asarray(-((2 * math.pi * self.frequency_hz) ** 2) * self.displacement)

    def of_tooth(self, tooth: int = 1) -> MeshLines:
        """Return the lines for another tooth, in order; those that fall together are added.

        Raises
        ------
        ArgumentError
            If the gear has no such tooth.
        """
        check_range("tooth", tooth, 1, self.period)
        z = self.displacement * np.exp(-2j * np.pi * (tooth - 1) / self.period * self.number)
        passing = self.posed.pass_order
        if not passing:
            return replace(self, displacement=z)
        steps, parts = passing.numerator * self.period, passing.denominator
        place = self.number * parts + self.carrier * steps
        # a mesh line, or one without the carrier, gives its name
        ranked = np.lexsort((self.carrier != 0, self.number % self.period != 0, place))
        _, first, where = np.unique(place[ranked], return_index=True, return_inverse=True)
        chosen, total = ranked[first], np.zeros(len(first), dtype=np.complex128)
        np.add.at(total, where, z[ranked])
        return replace(
            self, number=self.number[chosen], carrier=self.carrier[chosen], displacement=total
        )

    def columns(self, tooth: int = 1) -> dict[str, npt.NDArray[Any]]:
        """Return the columns of a `Signature`; where one gear is marked, for another tooth of it.

        Lines are attributed to the nearest mesh harmonic; `sideband_of` is "?" for those that
        belong to neither gear. Where planets pass there is a column `carrier` more: turns of the
        carrier beside those of the gear.
        """
        own = self.of_tooth(tooth)
        harmonic = np.ceil(own.number / self.period - 0.5).astype(int)
        distance = own.number - harmonic * self.period
        # steps of lines that repeat with a marked gear
        steps = {gear: own.period // teeth for gear, teeth in self.posed.marked.items()}
        mine = [distance == 0, *(own.number % step == 0 for step in steps.values())]
        aside = [np.zeros_like(distance), *(distance // step for step in steps.values())]
        sideband, carrier = np.select(mine, aside), own.carrier.copy()
        gear = np.select(mine, ["", *steps], "?").astype("U16")
        passing = (distance == 0) & (carrier != 0)
        sideband[passing], carrier[passing], gear[passing] = carrier[passing], 0, "carrier"
        z, angular = own.displacement, 2 * math.pi * own.frequency_hz
        found = {
            "stage": np.full(len(z), self.mechanics.stage),
            "mesh_harmonic": harmonic,
            "sideband": sideband,
            "sideband_of": gear,
            "order": own.order,
            "frequency_hz": own.frequency_hz,
            **{name: 2 * angular**times * np.abs(z) for times, name in enumerate(SIZES)},
            "phase_rad": np.angle(z),
        }
        return found | ({"carrier": carrier} if self.posed.pass_order else {})

    def header(self) -> dict[str, Any]:
        """Return what holds for all of its lines."""
        own, train = self.mechanics, self.posed.train
        return {name: getattr(own, name) for name in _TOLD} | {
            "mean_stiffness_n_per_m": own.stiffness.mean_n_per_m,
            "stiffness_variation": own.stiffness.variation,
            "contact_ratio": own.stiffness.contact_ratio,
            "overlap_ratio": own.stiffness.overlap_ratio,
            "period_mesh": self.period,
            "method": self.method,
            "contact_lost": self.contact_lost,
            "mean_deflection_m": self.mean_m,
            "assumptions": list(own.assumptions if train is None else train.notes),
        }


def joined(tables: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """Return tables one under the other; of a column that one lacks it has zeros."""
    found = list(tables)
    names = dict.fromkeys(name for table in found for name in table)
    return {
        name: np.concatenate([t.get(name, np.zeros(len(t["stage"]), dtype=int)) for t in found])
        for name in names
    }


def rms(lines: ComplexArray | FloatArray) -> float:
    """Rms of a vibration by its one-sided harmonics, without its mean."""
    return math.sqrt(2 * float(np.sum(np.abs(lines) ** 2)))
