"""Gear data -> stiffness -> Hill's equation -> the lines that a machine should show.

A mesh repeats after its mesh period, a turn of the gear that is marked by damage or errors, or the
hunting period if both are. The last is long, so by default the vibrations with either gear marked
are added instead, less that with neither: exact for errors, and for damage up to what each gear's
lost stiffness does to the vibration that the other one adds.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.dynamics import Method, Response, steady_state
from gearmon.dynamics.fourier import samples
from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.gears.faults import faults_of
from gearmon.gears.mechanics import StageMechanics
from gearmon.machine import Machine, MachineLike, load_machine
from gearmon.signatures.expected.mesh import (
    ComplexArray,
    FloatArray,
    MeshLines,
    PosedMesh,
    Wrong,
    joined,
    machine_header,
    operating_point,
    posed_mesh,
    refuse_no_lines,
    rms,
)
from gearmon.signatures.signature import Signature

#: Most stiffness harmonics of one problem.
MOST_HARMONICS = 200_000
#: Effect of stiffness harmonics above J over A^2 (R/J)^3, see `_stiffness_harmonics`.
CUT_FACTOR = 6.0
#: The same for the harmonics of e, and of the stiffness that they meet, see `_excitation_cut`.
EXCITATION_FACTOR = 4.0
#: Points a mesh period, and in all, at which the parts of two gears are multiplied.
MOST_POINTS, MOST_SAMPLES = 4096, 4_000_000
#: Times by which the effect of two damaged gears on one another may exceed its estimate.
CROSS_MARGIN = 2.0


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
    fall). With both gears marked, method "auto" adds the vibrations with either marked; what
    damaged gears then do to one another is estimated (`superposition_error`) and part of
    `error_bound`. Every other method solves the hunting period as a whole: seconds in place of a
    fraction. Lines are attributed to the nearest mesh harmonic. Lines that belong to neither shaft
    are not listed; where they were solved for, their share of the acceleration is given as
    `cross_lines_share`.

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
        posed = posed_mesh(machine, number, operating, known, form=form, mesh=int(ring))
        limit = posed.limit_hz(max_hz)
        lines = steady_lines(posed, limit, tolerance, method, order)
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


def _listed(lines: SteadyLines, max_hz: float) -> tuple[dict[str, npt.NDArray[Any]], float]:
    """Columns of the lines to list, and the share of acceleration in lines of no gear."""
    columns = lines.columns()
    strange = columns["sideband_of"] == "?"
    known = ~strange & (lines.frequency_hz <= max_hz * (1 + 1e-12))
    energy = np.abs(lines.acceleration) ** 2
    share = math.sqrt(float(energy[strange].sum() / energy.sum())) if energy.any() else 0.0
    return {name: column[known] for name, column in columns.items()}, share


@dataclass(frozen=True, kw_only=True, eq=False)
class SteadyLines(MeshLines):
    """Lines of one mesh with the bound of their error.

    Parameters
    ----------
    response : Response
        The solution, or the first of those that were added.
    mean_m : float
        Mean of z [m].
    cut : float
        Share of `error` that is estimated: harmonics of stiffness and excitation left out.
    superposed : float or None
        Share of `error` for the effect of damaged gears on one another; None where all was solved
        together.
    contact_loss : float or None
        Mesh phase at which teeth lose contact first.
    """

    response: Response
    mean_m: float
    cut: float
    superposed: float | None
    contact_loss: float | None

    def header(self) -> dict[str, Any]:
        """Return what holds for all of its lines, with how they were solved."""
        own, response, loss = self.mechanics, self.response, self.contact_loss
        return super().header() | {
            "overlap_ratio": own.stiffness.overlap_ratio,
            "equivalent_mass_kg": own.equivalent_mass_kg,
            "damping_ns_per_m": own.damping_ns_per_m,
            "mean_deflection_m": self.mean_m,
            "order_used": response.order,
            "error_bound": self.error,
            "stiffness_harmonics": len(response.problem.stiffness_harmonics),
            "stiffness_cut": self.cut,
            "stable": response.stable,
            "contact_loss_angle_rad": None if loss is None else 2 * math.pi * loss / self.period,
            "superposition_error": self.superposed,
            "message": f"{response.message}; stiffness harmonics left out: {self.cut:.2g}",
        }

    def warnings(self, tolerance: float) -> list[str]:
        """Say where the linear model ends or the accuracy asked for was not reached."""
        found = []
        if self.response.stable is False:
            found.append(self.response.message)
        elif self.error > tolerance:
            found.append(f"error bound {self.error:.2g} misses the tolerance {tolerance:.2g}")
        if self.superposed:
            found.append(
                "what marks both gears was solved gear by gear and added; the effect of one on the "
                f"other is estimated as {self.superposed:.2g} of the acceleration"
            )
        if self.contact_loss is not None:
            when = "first at" if self.superposed is None else "at worst at"
            found.append(
                f"teeth lose contact, {when} mesh phase {self.contact_loss:.4g}: the linear model "
                f"ends there"
            )
        return found


def steady_lines(
    posed: PosedMesh,
    max_hz: float,
    tolerance: float,
    method: Method = "auto",
    order: int | None = None,
) -> SteadyLines:
    """Solve one mesh with all that is wrong with it.

    Parameters
    ----------
    posed : PosedMesh
    max_hz : float
        Highest frequency of the lines [Hz].
    tolerance : float
        Relative L2 error of the acceleration.
    method, order
        As in `dynamics.steady_state`; all but "auto" solve a hunting period as a whole.
    """
    marked = posed.marked
    if len(marked) < 2 or method != "auto":
        return _alone(_Part.solved(posed, max_hz, tolerance, method, order))
    names = [(), *((gear,) for gear in marked)]
    base, *parts = (
        _Part.solved(posed.only(gears), max_hz, tolerance, method, order) for gears in names
    )
    return _added(posed, base, parts)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Part:
    """One solved problem: its response in z - e, harmonics of e [m], and what cutting them left."""

    posed: PosedMesh
    response: Response
    moved: ComplexArray
    cut: float

    @classmethod
    def solved(
        cls, posed: PosedMesh, max_hz: float, tolerance: float, method: Method, order: int | None
    ) -> _Part:
        """Solve a mesh over its true period."""
        mechanics, excitation, period = posed.mechanics, posed.excitation, posed.period
        shown = max(1, math.floor(max_hz * period / mechanics.mesh_frequency_hz * (1 + 1e-12)))
        least = shown * mechanics.stiffness.period_mesh // period
        harmonics, cut = _stiffness_harmonics(mechanics, least, tolerance)
        problem = posed.hill_problem(harmonics)
        moved = np.zeros(shown + 1, dtype=np.complex128)
        if excitation is not None:
            count = max(shown, len(problem.stiffness_harmonics))
            moved = excitation.harmonics(count, period)
            problem = problem.with_transmission_error(_used(moved[1:]))
        response = steady_state(
            problem, max(0.6 * tolerance, 1e-13), method=method, order=order, harmonics=shown
        )
        if excitation is not None:
            cut += _excitation_cut(response, moved, period)
        return cls(posed=posed, response=response, moved=moved[: shown + 1], cut=cut)

    @property
    def period(self) -> int:
        """Period [mesh periods]."""
        return self.posed.period

    @property
    def displacement(self) -> ComplexArray:
        """Harmonics of z [m]."""
        return np.asarray(self.response.displacement + self.moved)

    @cached_property
    def size(self) -> float:
        """Rms of the acceleration of z - e [m/s2]."""
        return rms(self.response.acceleration[1:])

    def sampled(self, lines: ComplexArray, points: int) -> FloatArray:
        """Return what has these harmonics, at `points` phases a mesh period."""
        count = self.period * points
        return np.asarray(samples(lines[: count // 2], count), dtype=np.float64)


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


def _alone(part: _Part) -> SteadyLines:
    response, posed = part.response, part.posed
    angle = response.contact_loss_angle_rad
    found = SteadyLines(
        mechanics=posed.mechanics,
        mesh_order=posed.order,
        period=part.period,
        number=np.arange(1, len(part.displacement)),
        displacement=part.displacement[1:],
        marked=posed.marked,
        method=response.method,
        error=response.error_bound + part.cut,
        contact_lost=angle is not None,
        response=response,
        mean_m=float(part.displacement[0].real),
        cut=part.cut,
        superposed=None,
        contact_loss=None if angle is None else angle / (2 * math.pi) * part.period,
    )
    if not (part.moved.any() and found.rms):
        return found
    # the bound is of z - e, the lines are of z
    grown = part.size / found.rms
    return replace(found, error=found.error * grown, cut=found.cut * grown)


def _added(posed: PosedMesh, base: _Part, parts: Sequence[_Part]) -> SteadyLines:
    """Add the vibrations with either gear marked, less that with neither."""
    each = [*parts, base]
    period = math.lcm(*(part.period for part in parts))
    places = [np.arange(len(part.displacement)) * (period // part.period) for part in each]
    number, where = np.unique(np.concatenate(places), return_inverse=True)
    signs = [*(1.0 for _ in parts), 1.0 - len(parts)]
    total = np.zeros(len(number), dtype=np.complex128)
    values = [sign * part.displacement for sign, part in zip(signs, each, strict=True)]
    np.add.at(total, where, np.concatenate(values))
    loss = _contact_loss(base, parts)
    found = SteadyLines(
        mechanics=posed.mechanics,
        mesh_order=posed.order,
        period=period,
        number=number[1:],
        displacement=total[1:],
        marked=posed.marked,
        method=parts[0].response.method,
        error=0.0,
        contact_lost=loss is not None,
        response=parts[0].response,
        mean_m=float(total[0].real),
        cut=0.0,
        superposed=None,
        contact_loss=loss,
    )
    size = found.rms
    solved = sum(part.response.error_bound * part.size for part in each) / size
    cut = sum(part.cut * part.size for part in each) / size
    cross = _cross_effect(posed.mechanics, base, parts) / size
    return replace(found, error=solved + cut + cross, cut=cut, superposed=cross)


def _cross_effect(mechanics: StageMechanics, base: _Part, parts: Sequence[_Part]) -> float:
    """Estimate the rms acceleration [m/s2] by which damaged gears act on each other's vibration.

    The sum leaves the residual ``d1 (z2 - z0) + d2 (z1 - z0) + d12 z``, which is known over the
    hunting period. Its lines are answered by the mesh with its mean stiffness, r_n/D_n; what the
    variation of the stiffness makes of that is covered by `CROSS_MARGIN`, so this is an estimate
    and no guaranteed bound.
    """
    stiffness = mechanics.stiffness
    if not stiffness.marks:
        return 0.0
    period = math.lcm(*(part.period for part in parts))
    most = max(len(part.displacement) / part.period for part in (base, *parts))
    points = max(8, min(_points(most), MOST_SAMPLES // period))
    still = base.sampled(base.response.displacement, points)
    residual = np.zeros(period * points)
    for part, other in zip(parts, reversed(parts), strict=True):
        phase = np.arange(part.period * points) / points
        own = part.posed.mechanics.stiffness
        lost = sum((train.at(phase) for train in own.marks), 0 * phase)
        added = other.sampled(other.response.displacement, points)
        added -= np.tile(still, len(added) // len(still))
        residual += np.tile(lost, period // part.period) * np.tile(added, period // other.period)
    for train in stiffness.marks:
        if " and " in train.gear:
            lost = train.at(np.arange(len(residual)) / points)
            residual += lost * np.resize(still, len(residual))
    lines = np.fft.rfft(residual, norm="forward")
    angular = 2 * math.pi * mechanics.mesh_frequency_hz / period * np.arange(len(lines))
    spring = base.response.problem.stiffness_n_per_m
    mass, damping = mechanics.equivalent_mass_kg, mechanics.damping_ns_per_m
    answered = lines * angular**2 / (spring - mass * angular**2 + 1j * damping * angular)
    return CROSS_MARGIN * rms(answered[1:])


def _contact_loss(base: _Part, parts: Sequence[_Part]) -> float | None:
    """Return a mesh phase in [0, 1) at which the worst meeting of both gears lets go, or None."""
    points = _points(max(len(part.response.mesh_force) / part.period for part in (base, *parts)))
    sign = math.copysign(1.0, base.posed.mechanics.force_n)
    still, *forces = (
        sign * part.sampled(part.response.mesh_force, points).reshape(-1, points)
        for part in (base, *parts)
    )
    least = still[0] + sum((force - still[0]).min(axis=0) for force in forces)
    lost = np.flatnonzero(least <= 0)
    return float(lost[0]) / points if len(lost) else None


def _points(highest: float) -> int:
    """Return so many points a mesh period that a product of lines up to `highest` is known."""
    return int(min(MOST_POINTS, 2 ** math.ceil(math.log2(2 * highest + 2))))
