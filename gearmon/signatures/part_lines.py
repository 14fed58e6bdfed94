"""One mesh solved over one period: stiffness and displacement excitation into Hill's equation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gearmon.dynamics import HillProblem, Method, Response, steady_state
from gearmon.gears.excitation import Excitation
from gearmon.gears.mechanics import StageMechanics

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

#: Most stiffness harmonics of one problem.
MOST_HARMONICS = 200_000
#: Effect of stiffness harmonics above J over A^2 (R/J)^3, see `_stiffness_harmonics`.
CUT_FACTOR = 6.0
#: The same for the harmonics of e, and of the stiffness that they meet, see `_excitation_cut`.
EXCITATION_FACTOR = 4.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """One solved problem.

    Parameters
    ----------
    mechanics : StageMechanics
        With the damage that this part has.
    response : Response
        In the coordinate z - e.
    moved : complex ndarray, shape (N+1,)
        Harmonics of e [m].
    cut : float
        Estimate of the relative error of the acceleration by harmonics that were left out.
    """

    mechanics: StageMechanics
    response: Response
    moved: ComplexArray
    cut: float

    @property
    def period_mesh(self) -> int:
        """Period [mesh periods]."""
        period = self.response.problem.period_s * self.mechanics.mesh_frequency_hz
        return round(period)

    @property
    def displacement(self) -> ComplexArray:
        """Harmonics of z [m]."""
        return np.asarray(self.response.displacement + self.moved)

    @property
    def size(self) -> float:
        """Rms of the acceleration of z - e [m/s2]."""
        return rms(self.response.acceleration)


def solve_part(
    mechanics: StageMechanics,
    excitation: Excitation | None,
    max_hz: float,
    tolerance: float,
    method: Method,
    order: int | None,
) -> Part:
    """Solve a mesh over its true period.

    Parameters
    ----------
    mechanics : StageMechanics
    excitation : Excitation or None
    max_hz, tolerance, method, order
        As in `stage_lines`.
    """
    stiffness = mechanics.stiffness
    period = stiffness.period_mesh if excitation is None else excitation.period_mesh
    period_s = period / mechanics.mesh_frequency_hz
    shown = max(1, math.floor(max_hz * period_s * (1 + 1e-12)))
    own, cut = _stiffness_harmonics(mechanics, shown * stiffness.period_mesh // period, tolerance)
    step = period // stiffness.period_mesh
    harmonics = np.zeros(len(own) * step, dtype=np.complex128)
    harmonics[step - 1 :: step] = own
    problem = HillProblem(
        mass_kg=mechanics.equivalent_mass_kg,
        damping_ns_per_m=mechanics.damping_ns_per_m,
        stiffness_n_per_m=stiffness.mean_n_per_m,
        stiffness_harmonics=harmonics,
        period_s=period_s,
        force_n=mechanics.force_n,
    )
    moved = np.zeros(1, dtype=np.complex128)
    if excitation is not None:
        moved = excitation.harmonics(max(shown, len(harmonics)), period)
        problem = problem.with_transmission_error(_used(moved[1:]))
    response = steady_state(
        problem, max(0.6 * tolerance, 1e-13), method=method, order=order, harmonics=shown
    )
    if excitation is not None:
        cut += _excitation_cut(response, moved, period)
    moved = np.concatenate([moved, np.zeros(max(0, shown + 1 - len(moved)))])[: shown + 1]
    return Part(mechanics=mechanics, response=response, moved=moved, cut=cut)


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
    problem = response.problem
    last = len(moved) - 1
    c = problem.stiffness_harmonics
    tail = np.arange(max(1, last - 4 * period), last + 1) / period
    falls = np.sqrt(np.sum(np.abs(moved[-len(tail) :] * tail) ** 2) / 4)
    used = np.arange(max(1, len(c) - 4 * period), len(c) + 1) / period
    jumps = np.sqrt(np.sum(np.abs(c[-len(used) :] * used) ** 2) / 4)
    left = float(falls * jumps) / (last / period) / (2 * problem.damping_ratio or 1.0)
    natural = (2 * math.pi * problem.natural_frequency_hz) ** 2
    size = rms(response.acceleration)
    return EXCITATION_FACTOR * natural * left / size if size else 0.0


def rms(lines: npt.NDArray[np.complexfloating] | FloatArray) -> float:
    """Rms of a vibration by its one-sided harmonics, without its mean."""
    return math.sqrt(2 * float(np.sum(np.abs(lines[1:]) ** 2)))
