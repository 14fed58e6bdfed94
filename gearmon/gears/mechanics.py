"""Numbers for dynamics: mass, damping and force of a mesh, and the machine as one elastic system.

A mesh by itself is ``m z'' + c z' + k(t) z = F``, the whole machine

    M q'' + C q' + [K + sum_j k_j v_j v_j^T] q,    d_j = v_j . q the deflection of mesh j

Coordinates are displacements [m] and rotations [rad]; `assembly` tells which, and puts the machine
together.

References
----------
R. H. MacNeal, A hybrid method of component mode synthesis, Comput. Struct. 1 (1971) 581.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt
from scipy.linalg import eigh

from gearmon.arrays import FloatArray
from gearmon.errors import ArgumentError
from gearmon.gears.excitation import Excitation, displacement_excitation
from gearmon.gears.faults import Fault, GearError, faults_of
from gearmon.gears.geometry import USUAL_RIM
from gearmon.gears.kinematics import kinematics, numbered
from gearmon.gears.pairs import LOW_LOAD_N_PER_MM, MeshPair, mesh_pairs
from gearmon.gears.stiffness import AnyForm, MeshStiffness, mesh_stiffness
from gearmon.machine import Machine, OperatingPoint, PlanetaryStage

#: Damping ratio of a mesh where none is given; 0.03 to 0.17 were measured
#: (Kasuba & Evans 1981, Wang & Cheng 1981).
DAMPING_RATIO = 0.07
#: Share of the largest eigenvalue below which a mode is a rigid one: they are rounding, some 1e-14.
RIGID = 1e-11
#: Damping over stiffness of shafts, bearings and supports that tell no damper [s]; ball bearings
#: have 0.25e-5 to 2.5e-5 s (E. Kraemer, Dynamics of Rotors and Foundations, 1993).
ELASTIC_DAMPING_S = 1e-5
#: Share of the compliance of meshes up to which what is in fast modes only is left out.
NEGLIGIBLE = 1e-3
#: Share of a mode's strain energy in meshes up to which they do not feel it: even resonant, at a
#: damping ratio of 0.01, it answers their forces by 50 times this share of what they feel at rest.
UNFELT = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class StageMechanics:
    """One mesh at one operating point, ready for ``m z'' + c z' + k(t) z = F``.

    z is the displacement along the transverse line of action. Of meshes that work side by side, as
    those of planets do, the numbers are those of one.

    Parameters
    ----------
    stage : int
        Number of the stage, counted from 1.
    mesh : str
        Name of the mesh: "pinion-gear", "sun-planet" or "planet-ring".
    equivalent_mass_kg : float
        Mass of both gears reduced to the line of action.
    damping_ns_per_m : float
    damping_ratio : float
        c/(2 sqrt(k m)).
    force_n : float
        Static force on the line of action.
    mesh_frequency_hz : float
    excitation : Excitation
        What moves the flanks, if anything does, and the stiffness that shares it.
    lead : float
        By how much it is ahead of the first one of its stage [mesh periods].
    assumptions : tuple of str
        What was not in the machine file and had to be taken, in words.
    """

    stage: int
    mesh: str
    equivalent_mass_kg: float
    damping_ns_per_m: float
    damping_ratio: float
    force_n: float
    mesh_frequency_hz: float
    excitation: Excitation
    lead: float = 0.0
    assumptions: tuple[str, ...] = ()

    @property
    def stiffness(self) -> MeshStiffness:
        """Stiffness of the mesh, with its faults."""
        return self.excitation.stiffness

    @property
    def natural_frequency_hz(self) -> float:
        """sqrt(k/m)/(2 pi) with the mean stiffness of the healthy mesh [Hz]."""
        stiffness = self.stiffness.healthy_mean_n_per_m
        return math.sqrt(stiffness / self.equivalent_mass_kg) / (2 * math.pi)

    @property
    def period_s(self) -> float:
        """True period of the stiffness [s]: mesh period times `stiffness.period_mesh`."""
        return self.stiffness.period_mesh / self.mesh_frequency_hz


def stage_mechanics(
    machine: Machine,
    number: int,
    point: OperatingPoint | None = None,
    *,
    faults: Iterable[Fault | GearError] = (),
    form: AnyForm = "parabolic",
    mesh: int = 0,
) -> StageMechanics:
    """Return stiffness, mass, damping and force of a mesh at an operating point.

    Parameters
    ----------
    machine : Machine
    number : int
        Stage, counted from 1 in the order of power flow.
    point : OperatingPoint, optional
        By default the machine's first.
    faults : iterable of Fault or GearError
        Of any stage; those of others are left aside. Errors of turning gears modulate the
        stiffness, and all errors move the flanks, as lost profile does.
    form : str or StiffnessForm
        See `gears.stiffness.mesh_stiffness`.
    mesh : {0, 1}
        Mesh of the stage: of a planetary stage 0 is sun-planet, 1 planet-ring.

    Returns
    -------
    StageMechanics

    Raises
    ------
    ArgumentError
        If the machine lacks data, with the key to add; or its gears cannot run.

    Notes
    -----
    ``1/m = r_b1^2/J1 + r_b2^2/J2`` with discs of the mean diameter (d_a + d_f)/2 less their bores,
    as ISO 6336-1 does, of webbed gears with the rim at full face width; the sun counts once per
    planet, a ring does not yield. The torque passes through the train without loss and divides
    equally among planets. c = 2 zeta sqrt(k m).
    """
    pair = pair_of(machine, number, mesh)
    running = machine.operating[0] if point is None else point
    notes: list[str] = []
    force = static_force(machine, pair, running)
    given = faults_of(faults, errors=True, stages=len(machine.stages))
    wrong = [own for own in given if own.stage == number]
    stiffness = mesh_stiffness(pair, wrong, form, force_n=force)
    mass = equivalent_mass(pair, notes)
    ratio, damping = mesh_damping(pair, math.sqrt(stiffness.healthy_mean_n_per_m * mass), notes)
    return StageMechanics(
        stage=number,
        mesh=pair.name,
        equivalent_mass_kg=mass,
        damping_ns_per_m=damping,
        damping_ratio=ratio,
        force_n=force,
        mesh_frequency_hz=kinematics(machine).mesh(number).order * running.shaft1_hz,
        excitation=displacement_excitation(pair, stiffness, wrong),
        assumptions=tuple(notes),
    )


@lru_cache(maxsize=256)
def load_share(machine: Machine, number: int) -> float:
    """Return how the teeth of a stage are loaded beside what its stiffness supposes.

    Parameters
    ----------
    machine : Machine
        The machine; its largest torque counts.
    number : int
        Stage, counted from 1.

    Returns
    -------
    float, > 0
        Specific load over the 100 N/mm of ISO 6336-1, below which its stiffness falls; infinite
        where the machine file does not tell the load.

    Notes
    -----
    14 N/(mm um), the usual mesh stiffness, make 7 um of 100 N/mm: the single pitch tolerance of
    ISO 1328-1 class 6 for small gears. Teeth pressed together by less touch where their deviations
    stand out, and what is missing of one tooth's stiffness is felt the less.
    """
    pair = pair_of(machine, number)
    forces = [known_force(machine, pair, point) for point in machine.operating]
    loads = [load for force in forces if (load := pair.specific_load(force)) is not None]
    return max(loads, default=math.inf) / LOW_LOAD_N_PER_MM


def pair_of(machine: Machine, number: int, mesh: int = 0) -> MeshPair:
    """Return a pair of a stage, counted from 1; of a planetary stage 0 is sun-planet."""
    pairs = pairs_of(machine, number)
    if mesh not in range(len(pairs)):
        names = ", ".join(f"{i} ({pair.name})" for i, pair in enumerate(pairs))
        raise ArgumentError(f"mesh={mesh} of stage {number} must be one of {names}")
    return pairs[mesh]


def pairs_of(machine: Machine, number: int) -> tuple[MeshPair, ...]:
    """Return the pairs of a stage, counted from 1."""
    return mesh_pairs(numbered("stage", machine.stages, number), number, machine.path)


def known_force(machine: Machine, pair: MeshPair, point: OperatingPoint) -> float | None:
    """Return the static force on the line of action [N]; None where data are missing."""
    try:
        return static_force(machine, pair, point)
    except ArgumentError:
        return None


def static_force(machine: Machine, pair: MeshPair, point: OperatingPoint) -> float:
    """Return the static force on the line of action [N]."""
    # the forces of sun and ring on a planet balance, so one override serves both meshes
    if pair.stage.force_n is not None:
        return float(pair.stage.force_n)
    if not point.torque_nm:
        shown = "is missing" if point.torque_nm is None else "= 0 leaves the teeth unloaded"
        raise ArgumentError(
            f"{pair.where}: torque_nm of [operating] {shown}: the static tooth force needs it; "
            f"give torque_nm > 0 on shaft 1, or force_n in this stage"
        )
    torque = point.torque_nm / kinematics(machine).shaft(pair.number or 1).order
    main = pair if pair.inner is None else pair.inner
    if isinstance(pair.stage, PlanetaryStage):
        # loads on the members balance in the proportion of the weights of their speeds
        sun, ring = pair.stage.sun_teeth, pair.stage.ring_teeth
        weights = {"sun": sun, "ring": ring, "carrier": sun + ring}
        torque *= weights["sun"] / weights[pair.stage.driving] / pair.planets
    return torque / main.base_radii_m[0]


def equivalent_mass(pair: MeshPair, notes: list[str]) -> float:
    """Return the mass of both gears reduced to the line of action [kg]; note what is assumed."""
    known = pair.given("equivalent_mass_kg")
    if known is not None:
        return known
    instead, yielding, solid = "equivalent_mass_kg" if pair.is_main else "", 0.0, []
    for index, member in enumerate(pair.members):
        if member.internal:
            notes.append("the ring is taken as rigid and heavy: its inertia is not counted")
            continue
        times = pair.planets if member.name == "sun" else 1
        inertia = gear_disc(pair, index, "equivalent mass", instead)[1]
        yielding += times * pair.base_radii_m[index] ** 2 / inertia
        if not member.bore_m and not getattr(pair.stage, f"inertia_{member.name}_kgm2"):
            solid.append(member.name)
    if solid:
        notes.append(f"{' and '.join(solid)} taken as solid discs: no bore diameter is given")
    return 1 / yielding


def gear_disc(
    pair: MeshPair, index: int, purpose: str = "mass of a gear", instead: str = ""
) -> tuple[float, float]:
    """Return mass [kg] and moment of inertia [kg m2] of a gear.

    As given, else of a disc of the mean diameter less bore and web; of a ring, what is left around
    its mean diameter to the rim, or to `USUAL_RIM` modules behind the tooth roots.

    Parameters
    ----------
    pair : MeshPair
    index : {0, 1}
    purpose, instead : str
        For the message where data are missing, see `MeshPair.need`.
    """
    name = pair.members[index].name
    mass: float | None = getattr(pair.stage, f"mass_{name}_kg")
    inertia: float | None = getattr(pair.stage, f"inertia_{name}_kgm2")
    if mass is not None and inertia is not None:
        return mass, inertia
    width, density = disc_body(pair, purpose, instead)
    volume, second = _disc(pair, index, width)
    return mass or density * volume, inertia or density * second


def disc_body(pair: MeshPair, purpose: str, instead: str) -> tuple[float, float]:
    """Return width [m] and density [kg/m3] of the discs of a stage.

    Where the stage gives its equivalent mass the density is what makes it, at any width.

    Parameters
    ----------
    pair : MeshPair
    purpose, instead : str
        For the message where the width is missing, see `MeshPair.need`.
    """
    main = pair if pair.inner is None else pair.inner
    known = main.given("equivalent_mass_kg")
    if known is None:
        width = 1e-3 * pair.need("face_width_mm", purpose, instead)
        pair.need("module_mm", purpose, instead)
        return width, pair.stage.density_kgm3
    width, (one, two) = 1e-3 * (pair.stage.face_width_mm or 1e3), main.base_radii_m
    yielding = main.planets * one**2 / _disc(main, 0, width)[1] + two**2 / _disc(main, 1, width)[1]
    return width, known * yielding


def _disc(pair: MeshPair, index: int, width_m: float) -> tuple[float, float]:
    """Return volume [m3] and polar moment of inertia over density [m5] of a gear as a disc."""
    gear = pair.geometry.gears[index]
    root, bore = gear.root_radius_m, 0.5 * gear.bore_m
    outer = 0.5 * (gear.tip_radius_m + root)
    if gear.internal:
        usual = USUAL_RIM * gear.module_m
        outer, bore = root + (usual if gear.rim_m is None else gear.rim_m), outer
    # what a web lacks of a solid disc, from the bore to the rim
    lacking, rim = 0.0, bore
    if gear.web_m is not None and gear.rim_m is not None and not gear.internal:
        lacking, rim = max(width_m - gear.web_m, 0.0), root - gear.rim_m
    volume, second = (
        math.pi * (width_m * (outer**n - bore**n) - lacking * (rim**n - bore**n)) for n in (2, 4)
    )
    return volume, 0.5 * second


def mesh_damping(pair: MeshPair, root: float, notes: list[str]) -> tuple[float, float]:
    """Return damping ratio and coefficient; `root` is sqrt(k m)."""
    known = pair.given("damping_ns_per_m")
    if known is not None:
        return known / (2 * root), known
    ratio = pair.stage.damping_ratio
    if ratio is None:
        ratio = DAMPING_RATIO
        notes.append(f"damping ratio of the mesh taken as {ratio}: commonly 0.03 to 0.17")
    return ratio, 2 * ratio * root


@dataclass(frozen=True, eq=False)
class Spring:
    """An elastic part of a drive train, or some of it.

    Parameters
    ----------
    part : str
        What it belongs to; of a mesh "mesh 1 pinion-gear", "mesh 1 sun-planet" or the like.
    rows : ndarray, shape (k, n)
        Its deflections are rows @ q; of a mesh the one row is v.
    stiffness : ndarray, shape (k, k)
    damping_ns_per_m : float
        Of dampers beside it, one for each row.
    phase : float
        Of a mesh: by how much it leads the first of its kind [mesh periods].
    resolved_hz : float
        Up to which frequency it is fine enough, of a shaft with mass.
    """

    part: str
    rows: FloatArray
    stiffness: FloatArray
    damping_ns_per_m: float = 0.0
    phase: float = 0.0
    resolved_hz: float = math.inf


@dataclass(frozen=True, eq=False)
class Planets:
    """The planets of one set.

    Parameters
    ----------
    rows : ndarray, shape (planets, 3, n)
        Radial and tangential displacement [m] and rotation [rad] of each are rows @ q.
    inertia : ndarray, shape (3,)
        Mass twice [kg], and moment of inertia [kg m2].
    angles_rad : ndarray, shape (planets,)
        psi, where they sit, counted as the sun turns past the carrier.
    """

    rows: FloatArray
    inertia: FloatArray
    angles_rad: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Around:
    """What is around some meshes, in the m modes of unit mass of the whole machine that feel them.

    Parameters
    ----------
    vectors : ndarray, shape (meshes, m)
        v_j.
    means, dampers : ndarray, shape (meshes,)
        Mean stiffness [N/m] and damping [Ns/m] of the meshes.
    stiffness, damping : ndarray, shape (m, m)
        K and C without these meshes [1/s2, 1/s].
    inputs : ndarray, shape (m, loads)
        How loads on the machine act on the modes.
    """

    vectors: FloatArray
    means: FloatArray
    dampers: FloatArray
    stiffness: FloatArray
    damping: FloatArray
    inputs: FloatArray

    @property
    def whole_damping(self) -> FloatArray:
        """C with these meshes."""
        return np.asarray(self.damping + (self.vectors.T * self.dampers) @ self.vectors)

    @property
    def fastest_hz(self) -> float:
        """Highest of its natural frequencies with mean mesh stiffnesses [Hz]."""
        squares = np.diagonal(self.stiffness) + self.means @ self.vectors**2
        return math.sqrt(float(squares.max())) / (2 * math.pi)


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveTrain:
    """Matrices of a machine.

    Parameters
    ----------
    coordinates : tuple of str, n of them
    turning : bool ndarray, shape (n,)
        Which are rotations of shafts and of members of planetary sets.
    mass : ndarray, shape (n, n)
    springs : tuple of Spring
        Shafts, bearings, pins, supports and meshes.
    planets : dict of int to Planets
        Of stages, counted from 1.
    shafts : tuple of int
        Coordinate of the rotation where torque comes to each shaft: of the last one its end.
    notes : tuple of str
        What is left out, and what was taken where the machine file says nothing.
    """

    coordinates: tuple[str, ...]
    turning: npt.NDArray[np.bool_]
    mass: FloatArray
    springs: tuple[Spring, ...]
    planets: dict[int, Planets]
    shafts: tuple[int, ...]
    notes: tuple[str, ...]

    def meshes(self, stage: int) -> list[Spring]:
        """Return the meshes of a stage, counted from 1."""
        return [own for own in self.springs if own.part.startswith(f"mesh {stage} ")]

    @cached_property
    def stiffness(self) -> FloatArray:
        """K with the means of all meshes, shape (n, n)."""
        springs = (own.rows.T @ own.stiffness @ own.rows for own in self.springs)
        return sum(springs, np.zeros_like(self.mass))

    @cached_property
    def damping(self) -> FloatArray:
        """C with that of all meshes, shape (n, n)."""
        whole = np.zeros_like(self.mass)
        for own in self.springs:
            told = own.damping_ns_per_m * np.eye(len(own.rows))
            if not own.damping_ns_per_m and not own.part.startswith("mesh"):
                told = ELASTIC_DAMPING_S * own.stiffness
            whole += own.rows.T @ told @ own.rows
        return whole

    @cached_property
    def modes(self) -> tuple[FloatArray, FloatArray]:
        """Squares of angular natural frequencies [1/s2], ascending, and shapes of unit mass.

        Rigid-body motions have 0. Coordinates without mass follow those that have it.
        """
        stiffness, heavy = self.stiffness, np.diag(self.mass) > 0
        carried = np.zeros((len(heavy), int(heavy.sum())))
        carried[heavy] = np.eye(carried.shape[1])
        light = np.linalg.pinv(stiffness[~heavy][:, ~heavy], hermitian=True)
        carried[~heavy] = -light @ stiffness[~heavy][:, heavy]
        squares, shapes = eigh(carried.T @ stiffness @ carried, carried.T @ self.mass @ carried)
        squares[squares < RIGID * squares[-1]] = 0.0
        return np.asarray(squares), np.asarray(carried @ shapes)

    @property
    def elastic(self) -> tuple[FloatArray, FloatArray]:
        """The modes without rigid-body motions."""
        squares, shapes = self.modes
        return squares[squares > 0], shapes[:, squares > 0]

    def load(self, forces_n: Mapping[int, float]) -> FloatArray:
        """Return the torques on shafts that load meshes statically, shape (n,).

        Parameters
        ----------
        forces_n : mapping of int to float
            Of stages, counted from 1, the static force of each of their meshes [N]. Torques come
            in at the beginning of the first shaft and go out at the end of the last one.

        Raises
        ------
        ArgumentError
            If shafts are held against rotation.
        """
        (squares, shapes), total = self.elastic, np.zeros(len(self.mass))
        if len(squares) == len(self.modes[0]):
            raise ArgumentError("the machine cannot turn: its shafts are held against rotation")
        turned = self.modes[1][:, 0]
        for stage, force in forces_n.items():
            one, two = self.shafts[stage - 1 : stage + 1]
            pair = np.zeros(len(total))
            pair[one], pair[two] = 1.0, -turned[one] / turned[two]
            mesh = self.meshes(stage)[0]
            carried = mesh.stiffness[0, 0] * (mesh.rows[0] @ shapes) @ ((pair @ shapes) / squares)
            total += force / carried * pair
        return total

    def around(
        self, meshes: Sequence[Spring], loads: FloatArray, carried_hz: float = math.inf
    ) -> Around:
        """Return the machine without some of its meshes, in its elastic modes.

        Parameters
        ----------
        meshes : sequence of Spring
        loads : ndarray, shape (n, loads)
            Forces on the machine.
        carried_hz : float
            Natural frequency up to which modes are kept as they are. Of those above, the motions
            are kept by which they follow forces of these meshes without inertia (residual modes,
            MacNeal 1971): the flexibility of the machine at the meshes stays whole, and nothing
            swings faster than it needs to.
        """
        squares, shapes = self.elastic
        rows = np.array([own.rows[0] for own in meshes])
        means = np.array([own.stiffness[0, 0] for own in meshes])
        felt = means @ (rows @ shapes) ** 2 > UNFELT * squares
        beside, soft = shapes[:, ~felt], squares[~felt]
        squares, shapes = squares[felt], shapes[:, felt]
        fast = squares > (2 * math.pi * carried_hz) ** 2
        if fast.any():
            # what these do at rest under forces of the meshes, which is a vector of modes for each
            heavy = squares[fast][:, None]
            forced = (rows @ shapes[:, fast]).T / heavy * np.sqrt(means)
            share, parts = np.linalg.eigh(forced.T @ (heavy * forced))
            forced = forced @ parts[:, share > NEGLIGIBLE]
            own, mixed = eigh(forced.T @ (heavy * forced), forced.T @ forced)
            squares = np.append(squares[~fast], own)
            shapes = np.hstack([shapes[:, ~fast], shapes[:, fast] @ forced @ mixed])
        vectors = rows @ shapes
        dampers = np.array([own.damping_ns_per_m for own in meshes])
        # a steady load presses the meshes through modes that they hardly feel as well
        pressed = (rows @ beside / soft) @ beside.T
        held = np.linalg.pinv((vectors / squares) @ vectors.T, rcond=UNFELT)
        return Around(
            vectors=vectors,
            means=means,
            dampers=dampers,
            stiffness=np.diag(squares) - (vectors.T * means) @ vectors,
            damping=shapes.T @ self.damping @ shapes - (vectors.T * dampers) @ vectors,
            inputs=(shapes + pressed.T @ held @ vectors).T @ loads,
        )
