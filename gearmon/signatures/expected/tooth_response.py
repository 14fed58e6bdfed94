"""What a loss of stiffness on one tooth adds to the lines of its mesh, before any path.

Where the machine file bears a baseline, the equation of motion tells (`baseline`). Without
dynamics the teeth carry the load on the deflection q = F/k(t): a tooth with a loss makes q larger
while its pair is in contact, and that pulse, once a turn of the gear, travels to the sensors
together with the mesh harmonics of q itself. Lines close to one another pass the same train and the
same housing, so that their ratio holds without the dynamics behind it. Teeth of standard
proportions stand in where the file says nothing of them but their number.

In a planetary set a softer mesh sheds its load to the others, so that only their passing tells them
apart: damage is heard a turn of the carrier below and above the multiples of the gear's turn, and
at these themselves where the others are too heavy to follow. A tooth of the sun or the ring meets N
planets in turn: of its lines those that all of them bring alike add up, the others cancel. On a
gear that stands still lines beside are lines of its own turn, which is that of the carrier, again:
multiples of N.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Any

import numpy as np

from gearmon.arrays import ComplexArray, FloatArray, IntArray
from gearmon.errors import ArgumentError, GearmonError, check_positive, check_range, check_word
from gearmon.gears.assembly import drive_train
from gearmon.gears.kinematics import kinematics
from gearmon.gears.pairs import Stage, mesh_pairs
from gearmon.gears.stiffness import MeshStiffness, mesh_stiffness
from gearmon.machine import Bearing, Machine, MachineLike, PlanetaryStage, load_machine
from gearmon.result import Result
from gearmon.signatures.expected.baseline import added_lines
from gearmon.signatures.expected.mesh import MeshPlace

#: Loss of a tooth that stands for the derivative at none: it leaves out as much of it.
SMALL_LOSS = 1e-6
_POINTS = 512
#: Losses at which `grown_lines` are told; at the first they still grow in proportion.
GROWN = (0.01, 0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.75, 0.95)
# Radial stiffness of a sun on a spline: a hundredth of that of its meshes or less.
_FREE_N_PER_M = 1e6
# Face width over module where the file gives no geometry: it does not enter the ratio of lines.
_STANDARD_WIDTH = 10.0
# What a mesh harmonic of a set must have to tell of the path, over what one planet would bring if
# all its pairs lost their stiffness: simulated sets in phase have 0.003 to 0.05 in the first, where
# errors of the flanks make them some ten times as loud.
_CANCELLED = 0.2


@dataclass(frozen=True, kw_only=True, eq=False)
class LossResponse(Result):
    """What a loss of stiffness of one tooth adds to the lines of its mesh, per unit of loss.

    Parameters
    ----------
    stage : int
    gear : str
    kind : str
    teeth : int
        z of the gear.
    operating : int
    loss : float
        Loss at which it holds: the share that the pair of the tooth loses of its stiffness,
        integrated over its contact; 0 for the derivative at no loss.
    number : ndarray of int, shape (n,)
        r: harmonics of the turn of the gear in its mesh, of a planetary gear relative to the
        carrier; mesh harmonic h is r = h z. Of a parallel stage r = 1..n.
    carrier : ndarray of int, shape (n,)
        s: turns of the carrier beside them. A sensor on the housing hears every line of a planetary
        set at s = -1, 0, 1: planets pass. It turns with the place of the sensor, a, as exp(i s a).
    order, frequency_hz : ndarray, shape (n,)
        Frequency over that of shaft 1, and in Hz at the operating point.
    acceleration : complex ndarray, shape (n,)
        Change of acceleration over loss [m/s2], tooth 1; half of peak amplitudes. At `loss`, or at
        small losses, the lines are ``mesh_acceleration + loss * acceleration``; tooth j turns it by
        ``exp(-2 pi i r (j - 1) / z)``.
    mesh_acceleration : complex ndarray, shape (n,)
        The healthy mesh [m/s2]; zero but at multiples of z.
    """

    stage: int
    gear: str
    kind: str
    teeth: int
    operating: int
    loss: float
    number: IntArray
    carrier: IntArray
    order: FloatArray
    frequency_hz: FloatArray
    acceleration: ComplexArray
    mesh_acceleration: ComplexArray


def loss_response(
    machine: MachineLike,
    stage: int,
    gear: str,
    operating: int = 0,
    max_order: float | None = None,
    *,
    kind: str = "crack",
    loss: float = 0.0,
    form: str = "parabolic",
) -> LossResponse:
    """Return what a small loss of stiffness of one tooth adds to the lines of its mesh.

    Parameters
    ----------
    machine : Machine, path or dict
        With the data that a baseline needs.
    stage : int
        From 1.
    gear : str
        "pinion", "gear", "sun", "planet" or "ring".
    operating : int
        Operating point, from 0.
    max_order : float, optional
        Highest order of shaft 1; by default 10 mesh harmonics or 2 natural frequencies.
    kind : {"crack", "stiffness", "breakage", "pitting", "spall"}
        How the loss is spread along the contact of the tooth.
    loss : float, in [0, 1)
        0 for the derivative at no loss; else the whole change at this loss (the lost share of the
        stiffness of the pair where the fault acts), divided by `LossResponse.loss`.
    form : str
        Form of the stiffness curve, see `gears.stiffness.mesh_stiffness`.

    Returns
    -------
    LossResponse
        Costs one mesh period and the contact of one tooth.

    Raises
    ------
    ArgumentError
        If the machine lacks data, has no such gear, or nothing lies below `max_order`.

    Notes
    -----
    The derivative at no loss leaves out what is of second order: of the shipped machines it misses
    the sidebands by 1 to 3 % of them at a loss of 1 %, 20 to 30 % at 20 %. A corner that breaks off
    a helical tooth moves on along the face as it grows: its derivative holds for slivers only, so
    give a `loss` there.

    Examples
    --------
    >>> response = gearmon.loss_response(machine, 1, "pinion", max_order=50.0)
    >>> response.teeth, response.acceleration.shape == response.order.shape
    (23, True)
    """
    check_word("kind=", kind, ("crack", "stiffness", "breakage", "pitting", "spall"))
    machine = load_machine(machine)
    check_word("gear ", gear, [wheel.gear for wheel in kinematics(machine).mesh(stage).wheels])
    check_range("loss", loss, 0.0, 0.999)
    text = f"{kind}:{stage}:{gear}:1:{float(loss) or SMALL_LOSS!r}"
    place = MeshPlace(machine, stage, operating, form, int(gear == "ring"))
    healthy, faulty = place.posed(), place.posed([text])
    top = None if max_order is None else check_positive("max_order", max_order)
    highest_hz = healthy.limit_hz(top and top * place.point.shaft1_hz)
    if highest_hz * faulty.period < healthy.mechanics.mesh_frequency_hz * (1 - 1e-12):
        raise ArgumentError(f"max_order={max_order} lies below the first line: nothing is left")
    even, (added,) = added_lines(healthy, [faulty], highest_hz)
    lost = faulty.loss(healthy)
    return LossResponse(
        stage=stage,
        gear=gear,
        kind=kind,
        teeth=faulty.period,
        operating=operating,
        loss=lost if loss else 0.0,
        **{name: getattr(added, name) for name in ("number", "carrier", "order", "frequency_hz")},
        acceleration=added.acceleration / lost,
        mesh_acceleration=even.acceleration,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class ToothResponse(Result):
    """Lines that a small loss of stiffness on tooth 1 adds, beside the mesh harmonics.

    Parameters
    ----------
    stage : int
        Stage, from 1.
    gear : {"pinion", "gear", "sun", "planet", "ring"}
        Gear.
    teeth : int
        z of the gear.
    lines : ndarray of complex, shape (top + 1,)
        Change of the acceleration per unit of loss at multiples 0..top of the gear's rotation;
        tooth 1 enters contact at angle 0. Of a planetary set without phase.
    beside : ndarray of complex, shape (2, top + 1) or (0, top + 1)
        The same a turn of the carrier below and above, where a sensor hears planets pass; none of a
        set of which only one mesh is known: `lines` stand for them.
    mesh : ndarray of complex, shape (harmonics + 1,)
        Acceleration of the healthy mesh at harmonics 0.. of the mesh, in the same unit.
    pair_share : ndarray of float, shape (points,)
        Share of the mesh stiffness that the tooth's pair carries along its contact.
    contact_ratio : float
        Mesh periods that the pair is in contact.
    from_teeth_alone : bool
        Whether standard proportions had to stand in for missing gear data.
    """

    stage: int
    gear: str
    teeth: int
    lines: ComplexArray
    beside: ComplexArray
    mesh: ComplexArray
    pair_share: FloatArray
    contact_ratio: float
    from_teeth_alone: bool

    def amplitude(self, loss: FloatArray) -> FloatArray:
        """Size of the response to a loss, in units of `lines`; about the loss itself if small.

        Parameters
        ----------
        loss : ndarray of float, in [0, 1)
            Loss of the pair's stiffness.

        Returns
        -------
        ndarray of float
            sqrt of the mean over the contact of [loss / (1 - loss s)]^2, weighted with s^2: where
            the pair carries the share s of the mesh alone, the deflection grows by s loss/(1 - s
            loss).
        """
        grown = loss[..., None] / (1.0 - loss[..., None] * self.pair_share)
        weight = self.pair_share**2
        return np.asarray(np.sqrt(np.sum(grown**2 * (weight / float(weight.sum())), axis=-1)))

    def band_power(self, number: FloatArray | IntArray, side: int = 0) -> FloatArray:
        """Power of the response to a unit loss about multiples of the rotation.

        Parameters
        ----------
        number : ndarray of float or int
            Multiples of the rotation; 0 beyond the lines known.
        side : {-1, 0, 1}
            Turns of the carrier beside them.

        Returns
        -------
        ndarray of float
            Mean of |lines|^2 over one mesh order about each: single lines of a pulse may vanish for
            a contact ratio that is a little different.
        """
        lines = self.beside[max(side, 0)] if side and len(self.beside) else self.lines
        return _mean_about(np.abs(lines) ** 2, np.rint(number), self.teeth)


def _mean_about(power: FloatArray, number: FloatArray | IntArray, teeth: int) -> FloatArray:
    """Mean of the power of the lines that are heard over one mesh order about each."""
    total, heard = (np.concatenate([[0.0], np.cumsum(own)]) for own in (power, power > 0))
    top = len(power)
    ends = np.rint(np.add.outer([-teeth / 2, teeth / 2], number))
    low, high = np.clip(ends.astype(int), 0, top)
    mean = (total[high] - total[low]) / np.maximum(heard[high] - heard[low], 1)
    return np.where(number < top, mean, 0.0)


# of one machine all recordings ask for the same gears
@lru_cache(maxsize=64)
def tooth_response(machine: Machine, stage: int, gear: str, max_order: float) -> ToothResponse:
    """Compute the response to a small loss on one tooth.

    Parameters
    ----------
    machine : Machine
        The machine; tooth counts suffice.
    stage : int
        Stage, from 1.
    gear : {"pinion", "gear", "sun", "planet", "ring"}
        Gear.
    max_order : float
        Highest order of shaft 1.

    Returns
    -------
    ToothResponse
        At the first operating point.

    Raises
    ------
    ArgumentError
        If there is no such gear, or the file says too little of a planetary set: how it sheds load
        depends on masses and stiffnesses.
    """
    mesh_of_stage, own = kinematics(machine).mesh(stage), machine.stages[stage - 1]
    teeth = mesh_of_stage.wheel(gear).teeth
    stiffness, standard, share, phase = _mesh_alone(own, stage, gear, teeth)
    try:
        found = loss_response(machine, stage, gear, max_order=max_order)
    except GearmonError:
        # where the file bears no baseline: no torque, no module, or teeth that would not run
        if gear in ("sun", "planet"):
            told = f"stage={stage} is planetary, and its file bears no baseline"
            raise ArgumentError(told) from None
        top = int(max_order / mesh_of_stage.order * teeth)
        mesh, lines = _deflected(stiffness, share, phase, teeth, top)
        every = lines[None]
    else:
        lines, mesh = (np.append(0.0, own) for own in (found.acceleration, found.mesh_acceleration))
        is_set = isinstance(own, PlanetaryStage)
        every, mesh = _of_set(machine, found) if is_set else (lines[None], mesh[::teeth])
    return ToothResponse(
        stage=stage,
        gear=gear,
        teeth=teeth,
        lines=every[0],
        beside=every[1:],
        mesh=mesh,
        pair_share=share,
        contact_ratio=stiffness.total_contact_ratio,
        from_teeth_alone=standard,
    )


def with_floating_sun(machine: Machine, stage: int) -> Machine | None:
    """Return a machine whose sun is free across its axis, as on a spline.

    Parameters
    ----------
    machine : Machine
        The machine.
    stage : int
        Stage, from 1.

    Returns
    -------
    Machine or None
        None if the stage is no planetary one, or the file tells how its sun is held.

    Notes
    -----
    Planets share the load of a sun that floats evenly, whatever the stiffness of their meshes: of
    what a damaged tooth changes in the forces, only what the sun's inertia opposes is left.
    """
    own = machine.stages[stage - 1]
    if not isinstance(own, PlanetaryStage):
        return None
    if own.fixed == "sun":
        if own.fixed_support_n_per_m is not None:
            return None
        freed = replace(own, fixed_support_n_per_m=_FREE_N_PER_M)
        return replace(
            machine, stages=(*machine.stages[: stage - 1], freed, *machine.stages[stage:])
        )
    shaft = stage + own.on_shafts.index("sun")
    held = {each.shaft for each in machine.bearings} | {each.shaft for each in machine.sections}
    if shaft in held:
        return None
    spline = Bearing(name="spline", shaft=shaft, stiffness_n_per_m=_FREE_N_PER_M)
    return replace(machine, bearings=(*machine.bearings, spline))


# recordings of a machine blame the same gear
@lru_cache(maxsize=16)
def grown_lines(
    machine: Machine, stage: int, gear: str, top: int
) -> tuple[ComplexArray, ComplexArray]:
    """Lines of a healthy mesh, and what losses of one tooth add to them.

    Parameters
    ----------
    machine : Machine
        The machine; tooth counts suffice.
    stage : int
        A parallel stage, from 1.
    gear : {"pinion", "gear"}
        Gear.
    top : int
        Highest multiple of the gear's rotation.

    Returns
    -------
    mesh : ndarray of complex, shape (harmonics + 1,)
        Acceleration of the healthy mesh at harmonics 0.. of the mesh, at the first operating point.
    lines : ndarray of complex, shape (losses, top + 1)
        Its change at each of `GROWN` losses, in the same unit, tooth 1.

    Notes
    -----
    A damaged pair answers to its own loss through the dynamics of the machine, so that every
    harmonic grows by a law of its own: from a loss of 5 to one of 30 % on README's pinion the third
    mesh harmonic of what is added grows 4 times, the seventh 19 times, the others 9 to 16 times.
    The mesh is a part of its drive train: by itself it lets expect twice what is added to the mesh
    harmonics of the slow stage of `signatures/combine_gearbox.toml`.
    """
    wheel = kinematics(machine).mesh(stage).wheel(gear)
    try:
        place = MeshPlace(machine, stage)
        train = drive_train(machine, place.point)
        healthy = replace(place.alone(), train=train)
        # the same pulse, more or less of it
        half = replace(place.alone([f"crack:{stage}:{gear}:1:0.5"]), train=train)
        hurt = [half.scaled(2 * loss) for loss in GROWN]
        rotation_hz = wheel.relative_order * place.point.shaft1_hz
        even, added = added_lines(healthy, hurt, (top + 0.5) * rotation_hz)
        told: ComplexArray = np.zeros((1 + len(GROWN), top + 1), dtype=complex)
        told[:, even.number] = [own.acceleration for own in (even, *added)]
        return told[0, :: wheel.teeth], told[1:]
    except GearmonError:  # as of `tooth_response`
        own = machine.stages[stage - 1]
        stiffness, _, share, phase = _mesh_alone(own, stage, gear, wheel.teeth)
        shed = np.array([x * share / (1.0 - x * share) for x in GROWN])
        return _deflected(stiffness, shed, phase, wheel.teeth, top)


def _of_set(machine: Machine, found: LossResponse) -> tuple[ComplexArray, ComplexArray]:
    """Sizes of lines by multiples of the rotation, and of mesh harmonics, wherever they stand.

    Lines by themselves, and a turn of the carrier below and above. Those in which planets cancel
    but for what their errors leave tell nothing, and are 0.
    """
    mesh, number = kinematics(machine).mesh(found.stage), found.number
    wheel = mesh.wheel(found.gear)
    alike = {side: mesh.brought_alike(found.gear, side) for side in (-1, 0, 1)}
    step, first = np.array([alike[side] for side in found.carrier.tolist()]).T
    power = np.where(number % step == first, np.abs(found.acceleration) ** 2, 0.0)
    if wheel.exact == 0:
        own = np.rint(found.order / wheel.relative_order).astype(int)
        lines = np.asarray([np.bincount(own, power)], dtype=np.float64)
    else:
        # by themselves, below and above
        lines = np.zeros((3 if found.carrier.any() else 1, int(number.max()) + 2))
        lines[np.array([0, 2, 1])[found.carrier], number] = power
    of_mesh = np.flatnonzero(found.mesh_acceleration)
    harmonic = found.number[of_mesh] // found.teeth
    meshes = np.bincount(harmonic, np.abs(found.mesh_acceleration[of_mesh]) ** 2)
    # a tooth of sun or ring is heard as often as it meets planets
    of_one = found.teeth / (1 if found.gear == "planet" else mesh.planets)
    places = found.teeth * np.arange(len(meshes), dtype=np.float64)
    brought = of_one**2 * _mean_about(lines.max(axis=0), places, found.teeth)
    meshes[meshes < _CANCELLED**2 * brought] = 0.0
    return np.sqrt(lines) + 0j, np.sqrt(meshes) + 0j


def _deflected(
    stiffness: MeshStiffness, share: FloatArray, phase: FloatArray, teeth: int, top: int
) -> tuple[ComplexArray, ComplexArray]:
    """Lines of q = F/k(t), healthy, and of what a pair sheds up to a multiple of the rotation."""
    number, count = np.arange(min(top, teeth * _POINTS // 2) + 1), teeth * _POINTS
    # both are taken in the middle of each step
    late = np.exp(-1j * np.pi * number / count) * number**2
    lines = np.fft.rfft(share / stiffness.at(phase), count)[..., : len(number)] * late / count
    mesh = np.fft.fft(1.0 / stiffness.at((np.arange(_POINTS) + 0.5) / _POINTS)) / _POINTS
    return mesh[np.arange(number[-1] // teeth + 1)] * late[::teeth], np.asarray(lines)


def _mesh_alone(
    own: Stage, stage: int, gear: str, teeth: int
) -> tuple[MeshStiffness, bool, FloatArray, FloatArray]:
    """Mesh of the file or, where it does not tell, of standard proportions; whether of these.

    And the share of it that the pair of one tooth carries, with the phases of its contact.
    """
    standard, pair = False, mesh_pairs(own, stage)[gear == "ring"]
    try:
        stiffness = mesh_stiffness(pair)
    except GearmonError:
        given: dict[str, Any] = {
            key.name: getattr(own, key.name)
            for key in fields(own)
            if key.name.endswith("_teeth") or key.name in ("planets", "fixed", "driving")
        }
        plain = type(own)(**given, module_mm=1.0, face_width_mm=_STANDARD_WIDTH)
        standard, stiffness = True, mesh_stiffness(mesh_pairs(plain, stage)[gear == "ring"])
    phase = (np.arange(math.ceil(stiffness.total_contact_ratio * _POINTS)) + 0.5) / _POINTS
    alone = replace(stiffness.healthy, period_mesh=teeth)
    share = np.clip(alone.at(phase) / stiffness.at(phase), 0.0, 1.0)
    return stiffness, standard, share, phase
