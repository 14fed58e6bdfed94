"""Lines of one mesh: stiffness and displacement excitation through Hill's equation.

A mesh repeats after its mesh period, a turn of the gear that is marked by damage or errors, or the
hunting period if both are. The last is long, so by default the vibrations with either gear marked
are added instead, less that with neither: exact for errors, and for damage up to what each gear's
lost stiffness does to the vibration that the other one adds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gearmon.dynamics import Method, Response
from gearmon.dynamics.fourier import samples
from gearmon.gears.excitation import Excitation
from gearmon.gears.mechanics import StageMechanics
from gearmon.signatures.part_lines import ComplexArray, FloatArray, Part, rms, solve_part

IntArray = npt.NDArray[np.int_]

#: Points a mesh period, and in all, at which the parts of two gears are multiplied.
MOST_POINTS, MOST_SAMPLES = 4096, 4_000_000
#: Times by which the effect of two damaged gears on one another may exceed its estimate.
CROSS_MARGIN = 2.0


@dataclass(frozen=True, kw_only=True, eq=False)
class StageLines:
    """Lines of one mesh.

    Parameters
    ----------
    mechanics : StageMechanics
        What was solved.
    period_mesh : int
        P, the true period [mesh periods].
    lines : ndarray of int, shape (n,)
        r: frequencies r/P of the mesh frequency; increasing.
    displacement : complex ndarray, shape (n,)
        z_r [m].
    marked : dict of str to int
        Gears with damage or errors of their own, and their teeth.
    response : Response
        The solution, or the first of those that were added.
    mean_m : float
        Mean of z [m].
    error_bound, cut : float
        Of the relative error of the acceleration: bound, and the share of it that is estimated.
    superposed : float or None
        Share of the bound for the effect of damaged gears on one another; None where all was solved
        together.
    contact_loss : float or None
        Mesh phase at which teeth lose contact first.
    max_hz : float
        Highest frequency asked for.
    """

    mechanics: StageMechanics
    period_mesh: int
    lines: IntArray
    displacement: ComplexArray
    marked: dict[str, int]
    response: Response
    mean_m: float
    error_bound: float
    cut: float
    superposed: float | None
    contact_loss: float | None
    max_hz: float

    @property
    def frequency_hz(self) -> FloatArray:
        """Frequencies of the lines [Hz]."""
        return np.asarray(self.lines / self.period_mesh * self.mechanics.mesh_frequency_hz)

    @property
    def acceleration(self) -> ComplexArray:
        """Acceleration lines [m/s2]."""
        return np.asarray(-((2 * math.pi * self.frequency_hz) ** 2) * self.displacement)


def stage_lines(
    mechanics: StageMechanics,
    excitation: Excitation | None,
    max_hz: float,
    tolerance: float,
    method: Method = "auto",
    order: int | None = None,
) -> StageLines:
    """Solve one mesh.

    Parameters
    ----------
    mechanics : StageMechanics
    excitation : Excitation or None
    max_hz : float
        Highest frequency of the lines [Hz].
    tolerance : float
        Relative L2 error of the acceleration.
    method, order
        As in `dynamics.steady_state`; all but "auto" solve a hunting period as a whole.
    """
    marked = _marked(mechanics, excitation)
    if len(marked) < 2 or method != "auto":
        part = solve_part(mechanics, excitation, max_hz, tolerance, method, order)
        return _alone(part, marked, max_hz)
    names = [(), *((gear,) for gear in marked)]
    base, *parts = (
        solve_part(*_only(mechanics, excitation, gears), max_hz, tolerance, method, order)
        for gears in names
    )
    return _added(mechanics, base, parts, marked, max_hz)


def _marked(mechanics: StageMechanics, excitation: Excitation | None) -> dict[str, int]:
    """Return the gears that differ from tooth to tooth, and their teeth."""
    trains = [train for train in mechanics.stiffness.marks if " and " not in train.gear]
    marked = {train.gear: train.period_mesh for train in trains}
    if excitation is not None:
        marked |= {e.gear: e.teeth for e in excitation.errors if e.period_mesh > 1}
    return marked


def _only(
    mechanics: StageMechanics, excitation: Excitation | None, gears: Sequence[str]
) -> tuple[StageMechanics, Excitation | None]:
    """Return the same mesh with no gear marked but these."""
    stiffness = mechanics.stiffness.only(gears)
    if excitation is not None:
        kept = tuple(e for e in excitation.errors if e.gear in gears or e.period_mesh == 1)
        excitation = replace(excitation, stiffness=stiffness, errors=kept) if kept else None
    return replace(mechanics, stiffness=stiffness), excitation


def _alone(part: Part, marked: dict[str, int], max_hz: float) -> StageLines:
    response, count = part.response, len(part.displacement)
    size = rms(response.acceleration)
    lines = np.arange(1, count)
    moved = rms(part.displacement * (response.problem.angular_frequency * np.arange(count)) ** 2)
    # the bound is of z - e, the lines are of z
    grown = size / moved if moved and part.moved.any() else 1.0
    angle = response.contact_loss_angle_rad
    return StageLines(
        mechanics=part.mechanics,
        period_mesh=part.period_mesh,
        lines=lines,
        displacement=part.displacement[1:],
        marked=marked,
        response=response,
        mean_m=float(part.displacement[0].real),
        error_bound=(response.error_bound + part.cut) * grown,
        cut=part.cut * grown,
        superposed=None,
        contact_loss=None if angle is None else angle / (2 * math.pi) * part.period_mesh,
        max_hz=max_hz,
    )


def _added(
    mechanics: StageMechanics,
    base: Part,
    parts: Sequence[Part],
    marked: dict[str, int],
    max_hz: float,
) -> StageLines:
    """Add the vibrations with either gear marked, less that with neither."""
    period = math.lcm(*(part.period_mesh for part in parts))
    total: dict[int, complex] = {}
    for part, sign in [*((part, 1.0) for part in parts), (base, 1.0 - len(parts))]:
        step = period // part.period_mesh
        for n, value in enumerate(part.displacement.tolist()):
            total[n * step] = total.get(n * step, 0.0) + sign * value
    mean = total.pop(0)
    lines = np.array(sorted(total))
    found = StageLines(
        mechanics=mechanics,
        period_mesh=period,
        lines=lines,
        displacement=np.array([total[line] for line in lines.tolist()]),
        marked=marked,
        response=parts[0].response,
        mean_m=mean.real,
        error_bound=0.0,
        cut=0.0,
        superposed=None,
        contact_loss=_contact_loss(base, parts),
        max_hz=max_hz,
    )
    size = math.sqrt(2 * float(np.sum(np.abs(found.acceleration) ** 2)))
    each = [*parts, base]
    solved = sum(part.response.error_bound * part.size for part in each) / size
    cut = sum(part.cut * part.size for part in each) / size
    cross = _cross_effect(mechanics, base, parts) / size
    return replace(found, error_bound=solved + cut + cross, cut=cut, superposed=cross)


def _cross_effect(mechanics: StageMechanics, base: Part, parts: Sequence[Part]) -> float:
    """Estimate the rms acceleration [m/s2] by which damaged gears act on each other's vibration.

    The sum leaves the residual ``d1 (z2 - z0) + d2 (z1 - z0) + d12 z``, which is known over the
    hunting period. Its lines are answered by the mesh with its mean stiffness, r_n/D_n; what the
    variation of the stiffness makes of that is covered by `CROSS_MARGIN`, so this is an estimate
    and no guaranteed bound.
    """
    stiffness = mechanics.stiffness
    if not stiffness.marks:
        return 0.0
    period = math.lcm(*(part.period_mesh for part in parts))
    points = max(8, min(_points([base, *parts]), MOST_SAMPLES // period))
    still = _motion(base, points)
    residual = np.zeros(period * points)
    for part, other in zip(parts, reversed(parts), strict=True):
        phase = np.arange(part.period_mesh * points) / points
        lost = sum((train.at(phase) for train in part.mechanics.stiffness.marks), 0 * phase)
        added = _motion(other, points)
        added -= np.tile(still, len(added) // len(still))
        residual += np.tile(lost, period // part.period_mesh) * np.tile(
            added, period // other.period_mesh
        )
    for train in stiffness.marks:
        if " and " in train.gear:
            for first, values in train.windows(points):
                where = (first + np.arange(len(values))) % len(residual)
                residual[where] += values * still[where % len(still)]
    lines = np.fft.rfft(residual, norm="forward")
    angular = 2 * math.pi * mechanics.mesh_frequency_hz / period * np.arange(len(lines))
    answered = (
        lines
        * angular**2
        / (
            base.response.problem.stiffness_n_per_m
            - mechanics.equivalent_mass_kg * angular**2
            + 1j * mechanics.damping_ns_per_m * angular
        )
    )
    return CROSS_MARGIN * rms(answered)


def _motion(part: Part, points: int) -> FloatArray:
    """Return z - e [m] over the period of a part, at `points` phases a mesh period."""
    count = part.period_mesh * points
    return np.asarray(samples(part.response.displacement[: count // 2], count), dtype=np.float64)


def _contact_loss(base: Part, parts: Sequence[Part]) -> float | None:
    """Return a mesh phase in [0, 1) at which the worst meeting of both gears lets go, or None."""
    highest = max(len(part.response.mesh_force) / part.period_mesh for part in (base, *parts))
    points = min(MOST_POINTS, 2 ** math.ceil(math.log2(2 * highest + 2)))
    sign = math.copysign(1.0, base.mechanics.force_n)
    forces = [sign * _sampled(part, points).reshape(-1, points) for part in parts]
    still = sign * _sampled(base, points)
    least = still + sum((force - still).min(axis=0) for force in forces)
    lost = np.flatnonzero(least <= 0)
    return float(lost[0]) / points if len(lost) else None


def _sampled(part: Part, points: int) -> FloatArray:
    force, count = part.response.mesh_force, part.period_mesh * points
    return np.asarray(samples(force[: count // 2], count), dtype=np.float64)


def _points(parts: Sequence[Part]) -> int:
    highest = max(len(part.displacement) / part.period_mesh for part in parts)
    return int(min(MOST_POINTS, 2 ** math.ceil(math.log2(2 * highest + 2))))
