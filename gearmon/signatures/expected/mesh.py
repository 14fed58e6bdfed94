"""One mesh of a machine with what is wrong with it, posed for whoever solves it; and its lines.

Each mesh is taken by itself, at one operating point. A healthy mesh repeats every mesh period;
with damaged teeth or errors on one gear it repeats every turn of that gear. Errors and lost profile
act as displacement excitation e(t) in ``m z'' + c (z - e)' + k(t) (z - e) = F``. Lines are those of
the motion z along the line of action, before any path to a sensor: without errors the deflection of
the teeth.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.dynamics import HillProblem
from gearmon.errors import ArgumentError, check_range, nearest_name
from gearmon.gears.excitation import Excitation, FlankError, displacement_excitation
from gearmon.gears.faults import Fault, GearError, parse_fault_or_error
from gearmon.gears.kinematics import kinematics
from gearmon.gears.mechanics import StageMechanics, stage_mechanics
from gearmon.gears.pairs import mesh_pairs
from gearmon.machine import Machine, OperatingPoint
from gearmon.signals.array_types import ComplexArray, FloatArray, IntArray
from gearmon.signatures.expected.contact_motion import Deviations, PeriodicMotion, Surroundings

Wrong = Fault | GearError

#: What the phases and amplitudes of all expected lines mean.
AMPLITUDES = "peak; phase of the displacement as a cosine when tooth 1 enters contact"


@dataclass(frozen=True, eq=False)
class Heard:
    """Lines of several turns.

    Parameters
    ----------
    number, carrier : ndarray of int, shape (n,)
        A line lies at number/P mesh orders and `carrier` turns of the carrier.
    lines : ndarray of complex, shape (turns, n)
        As `MeshLines.displacement`.
    mean : ndarray, shape (turns,)
        Mean deflection of the mesh, of a set that of the first one [m].
    """

    number: IntArray
    carrier: IntArray
    lines: ComplexArray
    mean: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class PosedMesh:
    """One mesh at one operating point, with its faults and errors, ready to be solved.

    Parameters
    ----------
    mechanics : StageMechanics
        With the faults.
    excitation : Excitation or None
        None where nothing moves the flanks.
    order : float
        Mesh frequency over that of shaft 1.
    warnings : tuple of str
        What was asked for and does not act.
    """

    mechanics: StageMechanics
    excitation: Excitation | None
    order: float
    warnings: tuple[str, ...] = ()

    @property
    def period(self) -> int:
        """P, mesh periods after which it repeats."""
        own = self.mechanics.stiffness.period_mesh
        return own if self.excitation is None else self.excitation.period_mesh

    @property
    def marked(self) -> dict[str, int]:
        """Gears that differ from tooth to tooth, and their teeth."""
        trains = [t for t in self.mechanics.stiffness.marks if " and " not in t.gear]
        found = {train.gear: train.period_mesh for train in trains}
        errors = () if self.excitation is None else self.excitation.errors
        return found | {error.gear: error.teeth for error in errors if error.period_mesh > 1}

    @property
    def is_local(self) -> bool:
        """Whether faults act in a few mesh periods of a turn, or in all of them alike."""
        errors = () if self.excitation is None else self.excitation.errors
        return not self.mechanics.stiffness.modulations and all(
            isinstance(error, FlankError) or error.period_mesh == 1 for error in errors
        )

    @property
    def members(self) -> tuple[tuple[PosedMesh, float], ...]:
        """Its meshes, each with its lead [mesh periods]: itself."""
        return ((self, 0.0),)

    @property
    def pass_order(self) -> Fraction:
        """Signed order of a carrier over that of the mesh: 0, nothing passes."""
        return Fraction(0)

    @property
    def scale(self) -> float:
        """T^2/m, what makes kappa of a stiffness."""
        own = self.mechanics
        return 1 / (own.equivalent_mass_kg * own.mesh_frequency_hz**2)

    @property
    def around(self) -> Surroundings:
        """What is around the mesh: the mass."""
        own = self.mechanics
        damping = own.damping_ns_per_m * self.scale * own.mesh_frequency_hz
        return Surroundings.of_pair(damping, own.force_n * self.scale)

    @property
    def highest_natural_hz(self) -> float:
        """Highest natural frequency [Hz]."""
        return self.mechanics.natural_frequency_hz

    def heard(self, made: PeriodicMotion | Deviations, highest: int, period: int) -> Heard:
        """Return the lines 1..highest of a period: those of the motion along the line of action."""
        del period
        lines = np.atleast_2d(made.lines(highest))
        still = np.zeros(highest, dtype=int)
        return Heard(np.arange(1, highest + 1), still, lines, made.mean_deflection[:, 0])

    @property
    def sound(self) -> PosedMesh:
        """The same mesh with nothing wrong."""
        mechanics = replace(self.mechanics, stiffness=self.mechanics.stiffness.unmarked)
        return replace(self, mechanics=mechanics, excitation=None)

    def limit_hz(self, max_hz: float | None) -> float:
        """Return up to which frequency [Hz] its lines are shown; 10 mesh harmonics by default."""
        if max_hz is not None:
            return max_hz
        own = self.mechanics
        return max(10 * own.mesh_frequency_hz, 2 * own.natural_frequency_hz)

    def hill_problem(self, harmonics: ComplexArray) -> HillProblem:
        """Return its equation without excitation, given the harmonics of its stiffness."""
        own = self.mechanics
        return HillProblem(
            mass_kg=own.equivalent_mass_kg,
            damping_ns_per_m=own.damping_ns_per_m,
            stiffness_n_per_m=own.stiffness.mean_n_per_m,
            stiffness_harmonics=harmonics,
            period_s=own.period_s,
            force_n=own.force_n,
        )


def posed_mesh(
    machine: Machine,
    stage: int,
    operating: int = 0,
    wrong: Iterable[Wrong | str] = (),
    *,
    form: str = "parabolic",
    mesh: int = 0,
) -> PosedMesh:
    """Pose a mesh with what is wrong with it.

    Parameters
    ----------
    machine : Machine
        With the data that a baseline needs; what is missing is named in the error.
    stage, operating : int
        Stage counted from 1, operating point from 0.
    wrong : iterable of Fault, GearError or str
        Of any stage; those of others are left aside.
    form : str
        Form of the stiffness curve, see `gears.stiffness.mesh_stiffness`.
    mesh : {0, 1}
        Of a planetary stage 0 for sun and planet, 1 for planet and ring.

    Raises
    ------
    ArgumentError
        If there is no such stage or operating point, the machine lacks data, or a fault does not
        fit it.
    """
    check_range("stage", stage, 1, len(machine.stages))
    point = operating_point(machine, operating)
    known = [parse_fault_or_error(one) if isinstance(one, str) else one for one in wrong]
    own = [one for one in known if one.stage == stage]
    faults = [fault for fault in own if isinstance(fault, Fault)]
    errors = [error for error in own if isinstance(error, GearError)]
    mechanics = stage_mechanics(
        machine, stage, point, faults=faults, errors=errors, form=form, mesh=mesh
    )
    excitation: Excitation | None = None
    warnings: tuple[str, ...] = ()
    if own:
        pair = mesh_pairs(machine.stages[stage - 1], stage, machine.path)[mesh]
        found = displacement_excitation(pair, mechanics.stiffness, errors, faults)
        excitation, warnings = found if found.errors else None, found.warnings
    order = kinematics(machine).mesh(stage).order
    return PosedMesh(mechanics=mechanics, excitation=excitation, order=order, warnings=warnings)


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
        As in `posed_mesh`.
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
    check_range("stage", stage, 1, len(machine.stages))
    check_range("harmonics", harmonics, 1, 10_000)
    if operating_point(machine, operating).torque_nm == 0:
        raise ArgumentError(f"operating[{operating + 1}]: torque_nm is 0, no tooth is pressed")
    posed = posed_mesh(machine, stage, operating, form=form, mesh=mesh)
    return posed.hill_problem(posed.mechanics.stiffness.harmonics(harmonics))


def operating_point(machine: Machine, number: int) -> OperatingPoint:
    """Return an operating point, counted from 0."""
    if not 0 <= number < len(machine.operating):
        raise ArgumentError(
            f"operating={number} must lie in [0, {len(machine.operating) - 1}]: the machine has "
            f"{len(machine.operating)} operating points, counted from 0"
        )
    return machine.operating[number]


def mesh_with(machine: Machine, stage: int, gear: str) -> int:
    """Return in which mesh of its stage a gear is taken: that with the sun, but for the ring.

    Raises
    ------
    ArgumentError
        If there is no such stage, or no such gear in it.
    """
    check_range("stage", stage, 1, len(machine.stages))
    pairs = mesh_pairs(machine.stages[stage - 1], stage, machine.path)
    for number, pair in enumerate(pairs):
        if gear in (member.name for member in pair.members):
            return number
    known = list(dict.fromkeys(m.name for pair in pairs for m in pair.members))
    near = nearest_name(gear, known)
    hint = f"; did you mean {near}?" if near else ""
    raise ArgumentError(f"gear {gear!r} is not in stage {stage}: {', '.join(known)}{hint}")


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshLines:
    """Lines of one mesh.

    Parameters
    ----------
    mechanics : StageMechanics
        Of this mesh, with its faults.
    mesh_order : float
        Mesh frequency over that of shaft 1.
    period : int
        P, the true period [mesh periods]; 1 where all are alike.
    number : ndarray of int, shape (n,)
        r: frequencies r/P of the mesh frequency.
    carrier : ndarray of int, shape (n,)
        s: turns of the carrier beside them, of sidebands by the planets' pass; else 0.
    pass_order : Fraction
        Signed order of the carrier over that of the mesh; 0 where no planets pass.
    displacement : complex ndarray, shape (n,)
        z_r [m] of ``z = z_0 + sum (z_r exp(2 pi i r s/P) + conj)`` with s the mesh phase: peak
        amplitudes are 2 abs(z_r).
    marked : dict of str to int
        Gears with damage or errors of their own, and their teeth.
    method : str
        How it was solved.
    error : float
        Relative error of the acceleration.
    contact_lost : bool
        Whether teeth part: the linear model ends there.
    mean_m : float
        Mean of z [m].
    """

    mechanics: StageMechanics
    mesh_order: float
    period: int
    number: IntArray
    carrier: IntArray
    pass_order: Fraction = Fraction(0)
    displacement: ComplexArray
    marked: dict[str, int]
    method: str
    error: float
    contact_lost: bool
    mean_m: float

    @property
    def order(self) -> FloatArray:
        """Frequencies over that of shaft 1, shape (n,)."""
        return np.asarray(self._turns * self.mesh_order)

    @property
    def frequency_hz(self) -> FloatArray:
        """Frequencies [Hz], shape (n,)."""
        return np.asarray(self._turns * self.mechanics.mesh_frequency_hz)

    @property
    def _turns(self) -> FloatArray:
        """Frequencies over that of the mesh."""
        return np.asarray(self.number / self.period + self.carrier * float(self.pass_order))

    @property
    def acceleration(self) -> ComplexArray:
        """Acceleration lines [m/s2], shape (n,)."""
        return np.asarray(-((2 * math.pi * self.frequency_hz) ** 2) * self.displacement)

    @property
    def rms(self) -> float:
        """Rms of the acceleration of all lines [m/s2]."""
        return rms(self.acceleration)

    def of_tooth(self, tooth: int = 1) -> MeshLines:
        """Return the lines for another tooth, in order; those that fall together are added.

        Raises
        ------
        ArgumentError
            If the gear has no such tooth.
        """
        check_range("tooth", tooth, 1, self.period)
        z = self.displacement * np.exp(-2j * np.pi * (tooth - 1) / self.period * self.number)
        if not self.pass_order:
            return replace(self, displacement=z)
        steps, parts = self.pass_order.numerator * self.period, self.pass_order.denominator
        place = self.number * parts + self.carrier * steps
        # a mesh line, or one without the carrier, gives its name
        ranked = np.lexsort((self.carrier != 0, self.number % self.period != 0, place))
        _, first, where = np.unique(place[ranked], return_index=True, return_inverse=True)
        total = np.zeros(len(first), dtype=np.complex128)
        np.add.at(total, where, z[ranked])
        chosen = ranked[first]
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
        sideband, gear = own._sidebands(distance)
        carrier = own.carrier.copy()
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
            "displacement_m": 2 * np.abs(z),
            "velocity_ms": 2 * angular * np.abs(z),
            "acceleration_ms2": 2 * angular**2 * np.abs(z),
            "phase_rad": np.angle(z),
        }
        return found | ({"carrier": carrier} if self.pass_order else {})

    def _sidebands(self, distance: IntArray) -> tuple[IntArray, npt.NDArray[np.str_]]:
        """Sideband number and modulating gear of lines by their distance from the mesh harmonic."""
        number = np.zeros(len(self.number), dtype=int)
        name = np.full(len(self.number), "?", dtype="U16")
        for gear, teeth in self.marked.items():
            step = self.period // teeth
            own = (self.number % step == 0) & (name == "?")
            name[own] = gear
            number[own] = distance[own] // step
        name[distance == 0] = ""
        number[distance == 0] = 0
        return number, name

    def header(self) -> dict[str, Any]:
        """Return what holds for all of its lines."""
        own = self.mechanics
        return {
            "stage": own.stage,
            "mesh": own.mesh,
            "mesh_frequency_hz": own.mesh_frequency_hz,
            "mean_stiffness_n_per_m": own.stiffness.mean_n_per_m,
            "stiffness_variation": own.stiffness.variation,
            "contact_ratio": own.stiffness.contact_ratio,
            "natural_frequency_hz": own.natural_frequency_hz,
            "damping_ratio": own.damping_ratio,
            "force_n": own.force_n,
            "overlap_ratio": own.stiffness.overlap_ratio,
            "equivalent_mass_kg": own.equivalent_mass_kg,
            "damping_ns_per_m": own.damping_ns_per_m,
            "period_mesh": self.period,
            "method": self.method,
            "contact_lost": self.contact_lost,
            "mean_deflection_m": self.mean_m,
            "assumptions": list(own.assumptions),
            "warnings": list(own.warnings),
        }


def joined(tables: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """Return tables one under the other; of a column that one lacks it has zeros."""
    found = list(tables)
    names = dict.fromkeys(name for table in found for name in table)
    return {
        name: np.concatenate([t.get(name, np.zeros(len(t["stage"]), dtype=int)) for t in found])
        for name in names
    }


def refuse_no_lines(meshes: Iterable[StageMechanics], max_hz: float | None) -> None:
    """Say that no line is left below the highest frequency."""
    lowest = min(mechanics.mesh_frequency_hz for mechanics in meshes)
    raise ArgumentError(
        f"max_hz={max_hz} Hz lies below the lowest mesh frequency, {lowest:.6g} Hz: no lines"
    )


def rms(lines: ComplexArray | FloatArray) -> float:
    """Rms of a vibration by its one-sided harmonics, without its mean."""
    return math.sqrt(2 * float(np.sum(np.abs(lines) ** 2)))
