"""Gear data -> stiffness -> Hill's equation -> the lines that a machine should show.

A mesh repeats after its mesh period, a turn of the gear that is marked by damage or errors, or the
hunting period if both are. One that repeats after a turn is solved with a guaranteed bound of its
error. What damage changes over a hunting period, and in a planetary set, is solved from corner to
corner of the stiffness, in the few mesh periods that differ.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.dynamics import Method, Response, steady_state
from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.gears.faults import faults_of
from gearmon.gears.mechanics import StageMechanics
from gearmon.machine import Machine, MachineLike, load_machine
from gearmon.signals.array_types import ComplexArray
from gearmon.signatures.expected.faulty_teeth import Posed, faulty_lines
from gearmon.signatures.expected.mesh import (
    MeshLines,
    PosedMesh,
    Wrong,
    joined,
    machine_header,
    operating_point,
    refuse_no_lines,
    rms,
)
from gearmon.signatures.expected.planetary_set import PosedSet, posed_stage
from gearmon.signatures.signature import Signature

#: Most stiffness harmonics of one problem.
MOST_HARMONICS = 200_000
#: Effect of stiffness harmonics above J over A^2 (R/J)^3, see `_stiffness_harmonics`.
CUT_FACTOR = 6.0
#: The same for the harmonics of e, and of the stiffness that they meet, see `_excitation_cut`.
EXCITATION_FACTOR = 4.0


def expected_signature(
    machine: MachineLike,
    faults: Iterable[Wrong | str] = (),
    tolerance: float = 1e-6,
    max_hz: float | None = None,
    operating: int = 0,
    *,
    form: str = "parabolic",
    method: Method = "auto",
    order: int | None = None,
) -> Signature:
    """Lines that a machine should show at one operating point.

    Parameters
    ----------
    machine : Machine, path or dict
        With the data that a baseline needs; what is missing is named in the error.
    faults : iterable of Fault, GearError or str
        Damaged teeth, such as "crack:1:pinion:5:20%", and errors of gears, such as
        "eccentricity:1:gear:all:20um".
    tolerance : float
        Relative L2 error of the acceleration of the lines of each stage, 1e-13 to 1.
    max_hz : float, optional
        Highest frequency [Hz], > 0. By default each stage is shown up to 10 mesh harmonics or 2
        natural frequencies, whichever is higher.
    operating : int
        Which operating point of the machine, counted from 0.
    form : str
        Form of the stiffness curve, see `gears.stiffness.mesh_stiffness`.
    method, order
        As in `dynamics.steady_state`.

    Returns
    -------
    Signature
        Origin "expected". The header holds the numbers of stage 1 and, under "stages", those of
        each stage.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, or the machine lacks data.

    Notes
    -----
    `error_bound` is the guaranteed bound of the solution for the harmonics taken of stiffness and
    excitation, plus an estimate of what the others would change (`stiffness_cut`, from their 1/n
    fall). Damage of both gears (method "auto") and planetary sets have no bound but an
    `error_estimate`. Lines are attributed to the nearest mesh harmonic. Lines that belong to
    neither shaft are not listed; where they were solved for, their share of the acceleration is
    given as `cross_lines_share`.

    Examples
    --------
    >>> healthy = gearmon.expected_signature(machine, max_hz=2000.0)
    >>> healthy.header["mesh_frequency_hz"], healthy["mesh_harmonic"].tolist()
    (567.3333333333334, [1, 2, 3])
    """
    machine = load_machine(machine)
    operating_point(machine, operating)
    known = _faults(machine, faults)
    if max_hz is not None:
        check_positive("max_hz", max_hz, "Hz")
    check_range("tolerance", tolerance, 1e-13, 1.0)
    tables, stages, mechanics = [], [], []
    for number in range(1, len(machine.stages) + 1):
        ring = any(fault.stage == number and fault.gear == "ring" for fault in known)
        posed = posed_stage(machine, number, operating, known, form=form, mesh=int(ring))
        limit = posed.limit_hz(max_hz)
        lines = _solved(posed, limit, tolerance, method, order)
        columns, share = _listed(lines, limit)
        warnings = [*posed.mechanics.warnings, *posed.warnings, *lines.warnings(tolerance)]
        added = {"max_hz": limit, "cross_lines_share": share, "warnings": warnings}
        tables.append(columns)
        stages.append(lines.header() | added)
        mechanics.append(posed.mechanics)
    if max_hz is not None and not any(len(table["stage"]) for table in tables):
        refuse_no_lines(mechanics, max_hz)
    header = machine_header(machine, operating, known, stages) | {"tolerance": tolerance}
    return Signature(machine=machine.name, origin="expected", header=header, columns=joined(tables))


def _faults(machine: Machine, faults: Iterable[Wrong | str]) -> tuple[Wrong, ...]:
    known = faults_of(faults, errors=True)
    for fault in known:
        if fault.stage > len(machine.stages):
            raise ArgumentError(
                f"fault {fault}: stage {fault.stage} must lie in [1, {len(machine.stages)}]"
            )
    return known


def _listed(lines: MeshLines, max_hz: float) -> tuple[dict[str, npt.NDArray[Any]], float]:
    """Columns of the lines to list, and the share of acceleration in lines of no gear."""
    columns = lines.columns()
    strange = columns["sideband_of"] == "?"
    known = ~strange & (columns["frequency_hz"] <= max_hz * (1 + 1e-12))
    energy = columns["acceleration_ms2"] ** 2
    share = math.sqrt(float(energy[strange].sum() / energy.sum())) if energy.any() else 0.0
    return {name: column[known] for name, column in columns.items()}, share


def _solved(
    posed: Posed, max_hz: float, tolerance: float, method: Method, order: int | None
) -> SteadyLines | ContactLines:
    """Solve one stage with all that is wrong with it."""
    if isinstance(posed, PosedMesh) and not (
        method == "auto" and posed.is_local and len(posed.marked) > 1
    ):
        return _steady_lines(posed, max_hz, tolerance, method, order)
    (found,) = faulty_lines(posed.sound, [posed], max_hz, tolerance)
    what = "the whole set, as the housing hears it" if isinstance(posed, PosedSet) else "both gears"
    return ContactLines(**vars(found), what=what)


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactLines(MeshLines):
    """Lines of a mesh or a planetary set, solved from corner to corner of its stiffnesses."""

    what: str

    def header(self) -> dict[str, Any]:
        """Return what holds for all of its lines, with how they were solved."""
        added = " of what the faults add" if self.period > 1 else ""
        return super().header() | {
            "mean_deflection_m": self.mechanics.static_deflection_m,
            "order_used": 0,
            "error_bound": None,
            "error_estimate": self.error,
            "stiffness_harmonics": 0,
            "stiffness_cut": 0.0,
            "stable": True,
            "contact_loss_angle_rad": None,
            "superposition_error": None,
            "message": f"{self.what}: error estimated as {self.error:.2g}{added}",
        }

    def warnings(self, tolerance: float) -> list[str]:
        """Say where the linear model ends or the accuracy asked for was not reached."""
        found = []
        if self.error > tolerance:
            found.append(f"error {self.error:.2g} misses the tolerance {tolerance:.2g}")
        if self.contact_lost:
            found.append("teeth lose contact: the linear model ends there")
        return found


@dataclass(frozen=True, kw_only=True, eq=False)
class SteadyLines(MeshLines):
    """Lines of one mesh with the bound of their error.

    Parameters
    ----------
    response : Response
        The solution in z - e.
    mean_m : float
        Mean of z [m].
    cut : float
        Share of `error` that is estimated: harmonics of stiffness and excitation left out.
    """

    response: Response
    mean_m: float
    cut: float

    def header(self) -> dict[str, Any]:
        """Return what holds for all of its lines, with how they were solved."""
        response = self.response
        return super().header() | {
            "mean_deflection_m": self.mean_m,
            "order_used": response.order,
            "error_bound": self.error,
            "error_estimate": None,
            "stiffness_harmonics": len(response.problem.stiffness_harmonics),
            "stiffness_cut": self.cut,
            "stable": response.stable,
            "contact_loss_angle_rad": response.contact_loss_angle_rad,
            "superposition_error": None,
            "message": f"{response.message}; stiffness harmonics left out: {self.cut:.2g}",
        }

    def warnings(self, tolerance: float) -> list[str]:
        """Say where the linear model ends or the accuracy asked for was not reached."""
        found = []
        if self.response.stable is False:
            found.append(self.response.message)
        elif self.error > tolerance:
            found.append(f"error bound {self.error:.2g} misses the tolerance {tolerance:.2g}")
        angle = self.response.contact_loss_angle_rad
        if angle is not None:
            found.append(
                f"teeth lose contact, first at mesh phase {angle / (2 * math.pi) * self.period:.4g}"
                ": the linear model ends there"
            )
        return found


def _steady_lines(
    posed: PosedMesh, max_hz: float, tolerance: float, method: Method, order: int | None
) -> SteadyLines:
    """Solve a mesh over its true period."""
    mechanics, excitation, period = posed.mechanics, posed.excitation, posed.period
    shown = max(1, math.floor(max_hz * period / mechanics.mesh_frequency_hz * (1 + 1e-12)))
    least = shown * mechanics.stiffness.period_mesh // period
    harmonics, cut = _stiffness_harmonics(mechanics, least, tolerance)
    problem = posed.hill_problem(harmonics)
    moved = np.zeros(shown + 1, dtype=np.complex128)
    if excitation is not None:
        moved = excitation.harmonics(max(shown, len(problem.stiffness_harmonics)), period)
        problem = problem.with_transmission_error(_used(moved[1:]))
    response = steady_state(
        problem, max(0.6 * tolerance, 1e-13), method=method, order=order, harmonics=shown
    )
    if excitation is not None:
        cut += _excitation_cut(response, moved, period)
    displacement = response.displacement + moved[: shown + 1]
    found = SteadyLines(
        mechanics=mechanics,
        mesh_order=posed.order,
        period=period,
        number=np.arange(1, shown + 1),
        carrier=np.zeros(shown, dtype=int),
        displacement=displacement[1:],
        marked=posed.marked,
        method=response.method,
        error=response.error_bound + cut,
        contact_lost=response.contact_loss_angle_rad is not None,
        response=response,
        mean_m=float(displacement[0].real),
        cut=cut,
    )
    if not (moved[: shown + 1].any() and found.rms):
        return found
    # the bound is of z - e, the lines are of z
    grown = rms(response.acceleration[1:]) / found.rms
    return replace(found, error=found.error * grown, cut=found.cut * grown)


def _used(error: ComplexArray) -> ComplexArray:
    """Return the harmonics up to the last that is more than rounding error."""
    sizes = np.abs(error)
    used = np.flatnonzero(sizes > 1e-15 * sizes.max(initial=0.0))
    return error[: used[-1] + 1] if len(used) else error[:0]


def _stiffness_harmonics(
    mechanics: StageMechanics, shown: int, tolerance: float
) -> tuple[ComplexArray, float]:
    """As many stiffness harmonics as the tolerance takes, and what the others may change.

    A stiffness with jumps has |c_n| = A/n. Harmonics above J reach the lines shown only through
    the lines that they make themselves, A (R/n)^2/n each: together a share of about A^2 (R/J)^3.
    """
    stiffness = mechanics.stiffness
    meshes = stiffness.period_mesh
    ratio = mechanics.natural_frequency_hz / mechanics.mesh_frequency_hz
    most = max(MOST_HARMONICS // meshes, math.ceil(shown / meshes), 8)
    count = min(most, max(32, math.ceil(2 * ratio), math.ceil(shown / meshes)))
    while True:
        harmonics = stiffness.harmonics(count * meshes)
        orders = np.arange(1, count * meshes + 1) / meshes
        blocks = (np.abs(harmonics * orders) ** 2).reshape(count, meshes).sum(axis=1)
        cut = CUT_FACTOR * float(blocks[-8:].max()) * (ratio / count) ** 3
        if cut <= 0.3 * tolerance or count == most:
            return harmonics, cut
        count = min(most, math.ceil(1.05 * count * (cut / (0.3 * tolerance)) ** (1 / 3)) + 1)


def _excitation_cut(response: Response, moved: ComplexArray, period: int) -> float:
    """Estimate what the harmonics of e that were left out change in the lines.

    Where e jumps, |e_n| = B/n against |c_n| = A/n; above resonance z - e follows -e, and the lines
    above N reach those shown by sum c_{n-m} e_n, about A B/N, at most 1/(2 zeta) times amplified.
    """

    def falls(lines: ComplexArray) -> float:
        """B: the rms of n |e_n| over the last four mesh orders."""
        last = len(lines)
        tail = np.arange(max(1, last - 4 * period), last + 1) / period
        return float(np.sqrt(np.sum(np.abs(lines[-len(tail) :] * tail) ** 2) / 4))

    problem = response.problem
    left = falls(moved[1:]) * falls(problem.stiffness_harmonics)
    left *= period / (len(moved) - 1) / (2 * problem.damping_ratio or 1.0)
    natural = (2 * math.pi * problem.natural_frequency_hz) ** 2
    size = rms(response.acceleration[1:])
    return EXCITATION_FACTOR * natural * left / size if size else 0.0
