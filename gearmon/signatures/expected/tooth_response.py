"""What a loss of stiffness on one tooth adds to the lines of its mesh, before any path.

Where the machine file bears a baseline, Hill's equation tells (`faulty_teeth`). Without
dynamics the teeth carry the load on the deflection q = F/k(t): a tooth with a loss makes q larger
while its pair is in contact, and that pulse, once a turn of the gear, travels to the sensors
together with the mesh harmonics of q itself. Lines close to one another pass the same train and the
same housing, so that their ratio holds without the dynamics behind it. Teeth of standard
proportions stand in where the file says nothing of them but their number.

In a planetary set a softer mesh sheds its load to the others, so that only their passing tells them
apart: damage is heard a turn of the carrier below and above the multiples of the gear's turn. A
tooth of the sun or the ring meets N planets in turn: of its lines those that all of them bring
alike add up, the others cancel. On a gear that stands still lines beside are lines of its own turn,
which is that of the carrier, again: multiples of N.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.errors import ArgumentError, GearmonError, check_range
from gearmon.gears.faults import Fault
from gearmon.gears.kinematics import kinematics
from gearmon.gears.pairs import MeshPair, Stage, mesh_pairs
from gearmon.gears.stiffness import MeshStiffness, mesh_stiffness
from gearmon.machine import Machine, PlanetaryStage
from gearmon.result import Result
from gearmon.signatures.expected.faulty_teeth import LossResponse, loss_response

_POINTS = 512
# Mesh harmonics whose growth with the loss is told.
_HARMONICS = 8
_SMALL_LOSS = 1e-3
# Face width over module where the file gives no geometry: it does not enter the ratio of lines.
_STANDARD_WIDTH = 10.0
_UNIT_STIFFNESS = 1e8
# What a mesh harmonic of a set must have to tell of the path, over what one planet would bring if
# all its pairs lost their stiffness: simulated sets in phase have 0.003 to 0.05 in the first, where
# errors of the flanks make them some ten times as loud.
_CANCELLED = 0.2


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
        tooth 1 enters contact at angle 0. Of a planetary set without phase, and about the multiples
        where it is heard.
    mesh : ndarray of complex, shape (harmonics + 1,)
        Acceleration of the healthy mesh at harmonics 0.. of the mesh, in the same unit.
    pair_share : ndarray of float, shape (points,)
        Share of the mesh stiffness that the tooth's pair carries along its contact.
    deflection : ndarray of float, shape (points,)
        Deflection of the healthy mesh there over its mean.
    contact_ratio : float
        Mesh periods that the pair is in contact.
    from_teeth_alone : bool
        Whether standard proportions had to stand in for missing gear data.
    """

    stage: int
    gear: str
    teeth: int
    lines: ComplexArray
    mesh: ComplexArray
    pair_share: FloatArray
    deflection: FloatArray
    contact_ratio: float
    from_teeth_alone: bool

    @cached_property
    def _weight(self) -> FloatArray:
        return self.pair_share**2 / float(np.sum(self.pair_share**2))

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
        size: FloatArray = np.sqrt(np.sum(grown**2 * self._weight, axis=-1))
        return size

    def mesh_growth(self, loss: FloatArray) -> FloatArray:
        """Size of the response to a loss at the mesh harmonics, in units of `lines`.

        It grows faster than `amplitude`: what the pair carries alone counts there for more than
        what it shares with the next. All harmonics grow alike; the mean power of the first is told.

        Parameters
        ----------
        loss : ndarray of float, in [0, 1)
            Loss of the pair's stiffness.
        """
        period = (np.arange(len(self.pair_share)) + 0.5) / _POINTS
        waves = np.exp(-2j * np.pi * np.outer(period, np.arange(1, _HARMONICS + 1)))
        shed = self.pair_share * self.deflection
        grown = shed * loss[:, None] / (1.0 - loss[:, None] * self.pair_share)
        size: FloatArray = np.linalg.norm(grown @ waves, axis=1) / np.linalg.norm(shed @ waves)
        return size

    def band_power(self, number: FloatArray) -> FloatArray:
        """Power of the response to a unit loss about multiples of the rotation.

        Parameters
        ----------
        number : ndarray of float
            Multiples of the rotation; 0 beyond the lines known.

        Returns
        -------
        ndarray of float
            Mean of |lines|^2 over one mesh order about each: single lines of a pulse may vanish for
            a contact ratio that is a little different.
        """
        known = np.rint(number).astype(int)
        heard = self._power_about[np.minimum(known, len(self.lines) - 1)]
        return np.where(known < len(self.lines), heard, 0.0)

    @cached_property
    def _power_about(self) -> FloatArray:
        every = np.arange(len(self.lines), dtype=np.float64)
        return _mean_about(np.abs(self.lines) ** 2, every, self.teeth)


def _mean_about(power: FloatArray, number: FloatArray, teeth: int) -> FloatArray:
    """Mean of the power of the lines that are heard over one mesh order about each."""
    total, heard = (np.concatenate([[0.0], np.cumsum(own)]) for own in (power, power > 0))
    top = len(power)
    low = np.clip(np.rint(number - teeth / 2).astype(int), 0, top)
    high = np.clip(np.rint(number + teeth / 2).astype(int), 0, top)
    mean: FloatArray = (total[high] - total[low]) / np.maximum(heard[high] - heard[low], 1)
    return np.where(number < top, mean, 0.0)


# of one machine all recordings ask for the same gears
@lru_cache(maxsize=64)
def tooth_response(
    machine: Machine,
    stage: int,
    gear: str,
    max_order: float,
    operating: int = 0,
) -> ToothResponse:
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
    operating : int
        Operating point, from 0.

    Returns
    -------
    ToothResponse

    Raises
    ------
    ArgumentError
        If there is no such gear, or the file says too little of a planetary set: how it sheds load
        depends on masses and stiffnesses.
    """
    check_range("stage", stage, 1, len(machine.stages))
    own = machine.stages[stage - 1]
    pair, stiffness, standard = _teeth(own, stage, gear)
    teeth, planets = pair.member(gear).teeth, isinstance(own, PlanetaryStage)
    share, phase = _pair_share(pair, stiffness, stage, gear)
    deflection = 1.0 / stiffness.at(phase)
    lines = mesh = None
    # nothing is found where the file bears no baseline: no torque, no module, or teeth that would
    # not run
    with suppress(GearmonError):
        found = loss_response(machine, stage, gear, operating, max_order)
        lines = np.append(0.0, found.acceleration)
        mesh = np.append(0.0, found.mesh_acceleration)[::teeth]
        if planets:
            lines, mesh = _of_set(machine, found)
        standard = False
    if lines is None or mesh is None:
        if gear in ("sun", "planet"):
            raise ArgumentError(f"stage={stage} is planetary, and its file bears no baseline")
        top = int(max_order / kinematics(machine).mesh(stage).order * teeth)
        lines, mesh = _deflected(stiffness, share, phase, teeth, top)
    return ToothResponse(
        stage=stage,
        gear=gear,
        teeth=teeth,
        lines=lines,
        mesh=mesh,
        pair_share=share,
        deflection=deflection / deflection.mean(),
        contact_ratio=stiffness.total_contact_ratio,
        from_teeth_alone=standard,
    )


def _of_set(machine: Machine, found: LossResponse) -> tuple[ComplexArray, ComplexArray]:
    """Sizes of lines by multiples of the rotation, and of mesh harmonics, wherever they stand.

    Those in which planets cancel but for what their errors leave tell nothing, and are 0.
    """
    mesh, number = kinematics(machine).mesh(found.stage), found.number
    wheel = mesh.wheel(found.gear)
    alike = {side: mesh.brought_alike(found.gear, side) for side in (-1, 0, 1)}
    step, first = np.array([alike[side] for side in found.carrier.tolist()]).T
    power = np.where(number % step == first, np.abs(found.acceleration) ** 2, 0.0)
    lines = np.zeros(int(number.max()) + 2)
    if wheel.exact == 0:
        np.add.at(lines, np.rint(found.order / wheel.relative_order).astype(int), power)
    else:
        np.maximum.at(lines, number, power)
    of_mesh = np.flatnonzero(found.mesh_acceleration)
    harmonic = found.number[of_mesh] // found.teeth
    meshes = np.bincount(harmonic, np.abs(found.mesh_acceleration[of_mesh]) ** 2)
    # a tooth of sun or ring is heard as often as it meets planets
    of_one = found.teeth / (1 if found.gear == "planet" else mesh.planets)
    places = found.teeth * np.arange(len(meshes), dtype=np.float64)
    brought = of_one**2 * _mean_about(lines, places, found.teeth)
    meshes[meshes < _CANCELLED**2 * brought] = 0.0
    return np.sqrt(lines) + 0j, np.sqrt(meshes) + 0j


def _deflected(
    stiffness: MeshStiffness, share: FloatArray, phase: FloatArray, teeth: int, top: int
) -> tuple[ComplexArray, ComplexArray]:
    """Lines of q = F/k(t) up to a multiple of the rotation, per loss and of the healthy mesh."""
    number = np.arange(min(top, teeth * _POINTS // 2) + 1)
    pulse = np.zeros(teeth * _POINTS)
    pulse[: len(share)] = share / stiffness.at(phase)
    # the pulse is taken in the middle of each step
    late = np.exp(-1j * np.pi * number / len(pulse))
    lines = np.fft.rfft(pulse)[: len(number)] * late / len(pulse) * number**2
    healthy = np.fft.fft(1.0 / stiffness.at(np.arange(_POINTS) / _POINTS)) / _POINTS
    harmonic = np.arange(number[-1] // teeth + 1)
    return lines, np.asarray(healthy[harmonic] * (harmonic * teeth) ** 2)


def _teeth(own: Stage, stage: int, gear: str) -> tuple[MeshPair, MeshStiffness, bool]:
    """Teeth of the file or, where it does not tell, of standard proportions; whether these."""
    pair = _pair(own, stage, gear)
    try:
        return pair, mesh_stiffness(pair, number=stage), False
    except GearmonError:
        told = {"planets", "fixed", "driving"}
        told |= {"mesh_stiffness_n_per_m", "ring_mesh_stiffness_n_per_m"}
        given: dict[str, Any] = {
            key.name: _UNIT_STIFFNESS if "stiffness" in key.name else getattr(own, key.name)
            for key in fields(own)
            if key.name.endswith("_teeth") or key.name in told
        }
        plain = type(own)(**given, module_mm=1.0, face_width_mm=_STANDARD_WIDTH)
        pair = _pair(plain, stage, gear)
        return pair, mesh_stiffness(pair, number=stage), True


def _pair(own: Stage, stage: int, gear: str) -> MeshPair:
    """Return the mesh of a gear."""
    pairs = mesh_pairs(own, stage)
    return next((p for p in pairs if gear in (m.name for m in p.members)), pairs[0])


def _pair_share(
    pair: MeshPair, stiffness: MeshStiffness, stage: int, gear: str
) -> tuple[FloatArray, FloatArray]:
    """Share of the mesh that the pair of one tooth carries, and the phases of its contact."""
    fault = Fault(kind="stiffness", stage=stage, gear=gear, tooth=1, size=_SMALL_LOSS)
    hurt = mesh_stiffness(pair, [fault], number=stage)
    count = int(np.ceil(stiffness.total_contact_ratio * _POINTS))
    phase = (np.arange(count) + 0.5) / _POINTS
    healthy = stiffness.at(phase)
    share: FloatArray = (healthy - hurt.at(phase)) / (_SMALL_LOSS * healthy)
    return np.clip(share, 0.0, 1.0), phase
