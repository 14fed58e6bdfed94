"""The drive train as it is integrated: the elastic system of the machine, in modes, and its meshes.

The system is that of `gears.mechanics`, which also tells natural frequencies and expected lines.
Modes that hold next to nothing of any mesh and are faster than a recording carries are left out.
Motor and load act as torques on the first and the last shaft; the rotation of the train as a whole
is given, not computed.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.errors import ArgumentError, check_range
from gearmon.gears.assembly import WIDTH_OVER_MODULE, drive_train
from gearmon.gears.faults import Fault, GearError
from gearmon.gears.geometry import GearTeeth
from gearmon.gears.kinematics import kinematics
from gearmon.gears.mechanics import DriveTrain, Spring, stage_mechanics
from gearmon.gears.pairs import MeshPair, mesh_pairs
from gearmon.machine import Machine, OperatingPoint
from gearmon.machine.fields import Checked, Count, held, within
from gearmon.simulation.contact import GearErrors, ToothMesh, ideal, random_errors
from gearmon.simulation.integrate import GearedSystem

#: Sampling rate over mesh frequency that anti-aliasing needs to let the mesh through.
LEAST_RATE_OVER_MESH = 2.56
#: Most samples in a channel.
MOST_SAMPLES = 100_000_000
LARGEST_SEED = 2**64
_POSITIVE = {"open_low": True, "open_high": True}


def stream(seed: int, *purpose: str | int) -> np.random.Generator:
    """Return the generator of one purpose.

    Parameters
    ----------
    seed : int, >= 0
    *purpose : str or int
        What the numbers are for, such as ``"pitch", 1, "pinion"``.

    Examples
    --------
    >>> one, two = stream(7, "noise", 1), stream(7, "noise", 1)
    >>> bool(one.random() == two.random())
    True
    """
    name = "/".join(str(part) for part in purpose).encode()
    return np.random.default_rng([seed, zlib.crc32(name)])


@dataclass(frozen=True, kw_only=True)
class Settings(Checked):
    """What a simulated recording is to be like.

    Parameters
    ----------
    duration_s : float, > 0
        Length [s].
    sampling_rate_hz : float, > 0
        [Hz].
    machine_seed : int, >= 0
        Of all that belongs to the machine: pitch errors, eccentricities, path to the sensors.
    recording_seed : int, >= 0
        Of all that differs between its recordings: wander of speed and load, start angle, noise.
    channels : int, 1 to 64
        Number of accelerometers.
    load : float, in (0, 10]
        Mean load, as a share of the torque of the operating point.
    slip : float, in [-0.2, 0.2]
        Share by which the machine runs slower than its nominal speed.
    speed_drift, load_drift : float, in [0, 0.1]
        Standard deviations of the slow wander of speed and of load, as shares of their means.
    torque_ripple : float, in [0, 0.5]
        Largest amplitude of the torque that varies with each turn of each shaft, as a share.
    snr_db : float or None
        Power of the vibration over that of the noise in each channel [dB]; None for no noise.
    accuracy_grade : float, 1 to 11, or None
        Flank tolerance class of ISO 1328-1 of all gears; None for perfect gears.
    unbalance : float, >= 0
        Shaft lines, as a multiple of those at the permissible unbalance G 6.3.
    bearing_tones : float, >= 0
        Amplitude of the lines of the machine's rolling bearings over the rms of the vibration.
    mains_hz : float, optional
        Mains frequency whose double is heard, at a tenth of the rms of the vibration.
    tacho_shaft : int, optional
        Shaft that gives a tacho pulse per turn, in a column of its own.

    Raises
    ------
    ArgumentError
        If a value is out of its range.
    """

    duration_s: float = within(0, math.inf, "s", default=10.0, **_POSITIVE)
    sampling_rate_hz: float = within(0, math.inf, "Hz", default=20_000.0, **_POSITIVE)
    machine_seed: int = held(Count(low=0, high=LARGEST_SEED), 0)
    recording_seed: int = held(Count(low=0, high=LARGEST_SEED), 0)
    channels: int = held(Count(low=1, high=64), 4)
    load: float = within(0, 10, default=1.0, open_low=True)
    slip: float = within(-0.2, 0.2, default=0.01)
    speed_drift: float = within(0, 0.1, default=0.005)
    load_drift: float = within(0, 0.1, default=0.03)
    torque_ripple: float = within(0, 0.5, default=0.02)
    snr_db: float | None = 20.0
    accuracy_grade: float | None = 6.0
    unbalance: float = within(0, 1000, default=1.0)
    bearing_tones: float = within(0, 1000, default=0.0)
    mains_hz: float | None = within(0, math.inf, "Hz", default=None, **_POSITIVE)
    tacho_shaft: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.duration_s * self.sampling_rate_hz > MOST_SAMPLES:
            raise ArgumentError(
                f"duration_s={self.duration_s:g} s makes more than {MOST_SAMPLES} samples at "
                f"{self.sampling_rate_hz:g} Hz; take less of either"
            )
        if self.snr_db is not None:
            check_range("snr_db", self.snr_db, -60, 200, "dB")
        if self.accuracy_grade is not None:
            check_range("accuracy_grade", self.accuracy_grade, 1, 11)

    @property
    def samples(self) -> int:
        """Samples in each channel."""
        return round(self.duration_s * self.sampling_rate_hz)

    def mean_shaft1_hz(self, point: OperatingPoint) -> float:
        """Speed about which shaft 1 wanders [Hz]."""
        return point.shaft1_hz * (1.0 - self.slip)

    def check_against(self, machine: Machine, point: OperatingPoint) -> None:
        """Refuse what this machine cannot be recorded with.

        Parameters
        ----------
        machine : Machine
            What is to be recorded.
        point : OperatingPoint
            How it runs.

        Raises
        ------
        ArgumentError
            If the recording is shorter than one turn of the slowest shaft, its rate too low for a
            mesh, a wanted line above half the rate, or the tacho's shaft does not exist.
        """
        train, speed = kinematics(machine), self.mean_shaft1_hz(point)
        slowest = min(train.shafts, key=lambda shaft: shaft.order)
        turn_s = 1 / (slowest.order * speed)
        if self.duration_s < turn_s:
            raise ArgumentError(
                f"duration_s={self.duration_s:g} s is less than one turn of shaft "
                f"{slowest.number}, {turn_s:.4g} s; take at least that"
            )
        fastest = max(train.meshes, key=lambda mesh: mesh.order)
        least_hz = LEAST_RATE_OVER_MESH * fastest.order * speed
        if self.sampling_rate_hz < least_hz:
            raise ArgumentError(
                f"sampling_rate_hz={self.sampling_rate_hz:g} Hz is too low for the mesh of stage "
                f"{fastest.stage} at {fastest.order * speed:.4g} Hz; take at least "
                f"{math.ceil(least_hz)} Hz"
            )
        if self.mains_hz is not None and 2 * self.mains_hz > 0.4 * self.sampling_rate_hz:
            raise ArgumentError(
                f"mains_hz={self.mains_hz:g} Hz: its double must lie below 0.4 of the sampling rate"
            )
        if self.tacho_shaft is not None and self.tacho_shaft not in range(1, len(train.shafts) + 1):
            raise ArgumentError(
                f"tacho_shaft={self.tacho_shaft} must lie in [1, {len(train.shafts)}]"
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class Train:
    """A drive train ready to be integrated.

    Parameters
    ----------
    system : GearedSystem
        Its inputs: the load over its mean, then the acceleration of the runout [m/s2] of each mesh
        that does not float.
    meshes : tuple of ToothMesh
    gear_mass_kg : float
        Mass of all gears as solid discs; what a ring weighs goes with the housing.
    carrier_orders : tuple of float
        For each stage the turns of its carrier per turn of shaft 1, positive where tooth contacts
        on the ring run with it; 0 where no planets pass the housing.
    notes : tuple of str
        Assumptions, in words.
    """

    system: GearedSystem
    meshes: tuple[ToothMesh, ...]
    gear_mass_kg: float
    carrier_orders: tuple[float, ...]
    notes: tuple[str, ...]

    @property
    def static_force(self) -> FloatArray:
        """Force of every mesh [N] under the mean load."""
        return np.array([own.mechanics.force_n for own in self.meshes])

    @property
    def greatest_stiffness(self) -> FloatArray:
        """Of every mesh without damage [N/m]."""
        variation = np.array([own.mechanics.stiffness.variation for own in self.meshes])
        return np.asarray(self.system.means * (1 + variation))


def build_train(
    machine: Machine,
    faults: Sequence[Fault | GearError] = (),
    *,
    point: OperatingPoint | None = None,
    load: float = 1.0,
    seed: int = 0,
    accuracy_grade: float | None = 6.0,
    carried_hz: float = math.inf,
) -> Train:
    """Build the model of a machine's drive train.

    Parameters
    ----------
    machine : Machine
        Every stage needs its module, and face width or the overrides in its place; the machine
        needs a torque.
    faults : sequence of Fault or GearError
    point : OperatingPoint, optional
        By default the machine's first.
    load : float, > 0
        Mean load over the torque of the operating point.
    seed : int
        Of the errors of manufacture.
    accuracy_grade : float or None
        Flank tolerance class of ISO 1328-1; None for perfect gears.
    carried_hz : float
        Natural frequency up to which all modes are kept, see `DriveTrain.around`.

    Returns
    -------
    Train

    Raises
    ------
    ArgumentError
        If the machine lacks data, or a fault does not fit it.
    """
    running = machine.operating[0] if point is None else point
    if running.torque_nm is not None:
        running = replace(running, torque_nm=load * running.torque_nm)
    pairs = [mesh_pairs(stage, i, machine.path) for i, stage in enumerate(machine.stages, start=1)]
    gears = {(pair.number, m.name) for own in pairs for pair in own for m in pair.members}
    for error in faults:
        if isinstance(error, GearError) and (error.stage, error.gear) not in gears:
            raise ArgumentError(f"error {error}: {machine.name} has no such gear")
    train = drive_train(machine, running)
    drawn = partial(_errors, faults, seed, accuracy_grade)
    sides = _meshes(machine, faults, running, load, train, pairs, drawn)
    springs, meshes = zip(*sides, strict=True)
    floats = "a floating sun shares the load among planets but for the pitch deviations"
    forces = {own.mechanics.stage: own.mechanics.force_n for own in meshes}
    loads = [train.load(forces)]
    # runout of a mesh that strains nothing: all behind it turns
    rows = np.concatenate([own.rows[0:1] for own in springs])
    still = [own.stiffness @ own.rows for own in train.springs if own not in springs]
    still = [own / np.linalg.norm(own) for own in still]
    free = np.linalg.pinv(np.concatenate([rows, *still]), rcond=1e-9)
    loads += [-train.mass @ free[:, j] for j, mesh in enumerate(meshes) if not mesh.floating]
    around = train.around(springs, np.transpose(loads), carried_hz)
    backlash_m = np.array([mesh.backlash_m for mesh in meshes])
    return Train(
        system=GearedSystem(**vars(around), backlash_m=backlash_m),
        meshes=meshes,
        gear_mass_kg=sum(_gear_mass_kg(own[0]) for own in pairs),
        carrier_orders=tuple(float(mesh.carrier) for mesh in kinematics(machine).meshes),
        notes=(*train.notes, *([floats] if train.planets else [])),
    )


def _meshes(
    machine: Machine,
    faults: Sequence[Fault | GearError],
    point: OperatingPoint,
    load: float,
    train: DriveTrain,
    pairs: Sequence[Sequence[MeshPair]],
    drawn: Callable[[MeshPair, GearTeeth, str], GearErrors],
) -> Iterator[tuple[Spring, ToothMesh]]:
    """Give the meshes stage by stage, those with the sun before those with the ring."""
    for number, own in enumerate(pairs, start=1):
        is_set = number in train.planets
        angles = train.planets[number].angles_rad.tolist() if is_set else [0.0]
        places = product(own, enumerate(angles, start=1))
        for (pair, (planet, angle)), spring in zip(places, train.meshes(number), strict=True):
            # damage of a planet is on the first one; wear of all of its teeth on every planet
            acting = [f for f in faults if isinstance(f, Fault)]
            if planet > 1:
                acting = [f for f in acting if f.gear != "planet" or not f.tooth]
            side = int(pair.second.internal)
            mechanics = stage_mechanics(machine, number, point, faults=acting, mesh=side)
            if pair.stage.force_n is not None:  # the load must scale it, as it does a torque
                mechanics = replace(mechanics, force_n=load * mechanics.force_n)
            name = f" {planet}" if is_set else ""
            first, second = (drawn(pair, member, name) for member in pair.members)
            # the least normal backlash that ISO/TR 10064-2 recommends for industrial drives:
            # j_bn = 2/3 (0.06 + 0.0005 a + 0.03 m_n), all in mm
            distance_mm = 1e3 * pair.geometry.centre_distance_m
            module_mm = pair.need("module_mm", "backlash")
            backlash_m = 2e-3 / 3 * (0.06 + 0.0005 * distance_mm + 0.03 * module_mm)
            mesh = ToothMesh(
                mechanics=mechanics,
                name=pair.name + name,
                order=kinematics(machine).mesh(number).order,
                offset=spring.phase,
                teeth=pair.teeth,
                errors=(first, second),
                base_pitch_m=pair.geometry.base_pitch_m,
                backlash_m=backlash_m,
                place_turns=angle / (2 * math.pi),
                floating=is_set,
            )
            yield spring, mesh


def _errors(
    faults: Sequence[Fault | GearError],
    seed: int,
    accuracy_grade: float | None,
    pair: MeshPair,
    member: GearTeeth,
    planet: str,
) -> GearErrors:
    if accuracy_grade is None:
        own = ideal(member.teeth)
    else:
        # a planet has two flanks at work, and there are several planets
        flank = f"{pair.name}{planet}" if member.name == "planet" else ""
        generator = stream(seed, "errors", pair.number or 1, member.name, flank)
        diameter_m = pair.geometry.transverse_module_m * member.teeth
        sizes_m = diameter_m, 1e-3 * pair.need("module_mm", "pitch errors")
        own = random_errors(member.teeth, *sizes_m, accuracy_grade, generator)
    for error in faults:
        if isinstance(error, GearError) and (error.stage, error.gear) == (pair.number, member.name):
            own = own.with_error(error)
    return own


def _gear_mass_kg(pair: MeshPair) -> float:
    module, width = pair.geometry.transverse_module_m, pair.stage.face_width_mm
    radii = [0.5 * module * teeth for teeth in pair.teeth]
    area = math.pi * (radii[0] ** 2 + pair.planets * radii[1] ** 2)
    width_m = WIDTH_OVER_MODULE * module if width is None else 1e-3 * width
    return pair.stage.density_kgm3 * width_m * area
