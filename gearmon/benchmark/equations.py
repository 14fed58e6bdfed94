"""Equations of a gear mesh that methods are judged on, and their accurate motions.

`solve_reference`: Gauss collocation in time. The period is cut into equal segments; in each, the
acceleration is a polynomial through the Gauss-Legendre nodes, and the equation holds at the nodes.
Every segment is then an affine map of its first state to its last; the periodic state closes the
chain. No Fourier series is involved, so a jump of stiffness between two segments costs nothing, and
the order is twice the number of nodes (Hairer, Lubich and Wanner, Geometric Numerical Integration,
2006, section II.1). Dimensionless, with time s = w0 t and deflection in F/k0:
z'' + 2 zeta z' + kappa(s) z = 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numpy.polynomial.legendre import legint, legval, legvander

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.dynamics import HillProblem, Response
from gearmon.gears.pulses import gauss
from gearmon.machine import ParallelStage

MASS_KG = 0.28
DAMPING_NS_PER_M = 9e3
STIFFNESS_N_PER_M = 8e8
PERIOD_S = 1.6e-3
FORCE_N = 4e3
VARIATION = 0.13
#: Damping whose ratio is 0.3 with the mass and stiffness above, per unit of damping ratio.
CRITICAL_NS_PER_M = 2 * math.sqrt(STIFFNESS_N_PER_M * MASS_KG)
#: Teeth whose stiffness is that of a turn with cracks.
STAGE = ParallelStage(
    pinion_teeth=26,
    gear_teeth=53,
    module_mm=2.0,
    face_width_mm=20.0,
    bore_diameter_pinion_mm=20.8,
    bore_diameter_gear_mm=42.4,
)
FORM = "potential-energy"
CRACK, GEAR_CRACK = "crack:1:pinion:5:1.5mm", "crack:1:gear:9:1mm"
MESH_HARMONICS = 10
NODES = 12
#: Segments solved in one batch, so that a long period does not fill the memory.
BATCH = 20_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """One equation to be solved by all methods.

    Parameters
    ----------
    problem : HillProblem
        The equation; of a rectangle its Fourier sum, cut off.
    rectangle : float, optional
        Variation of the true stiffness where it jumps, up about t = 0, at quarters of the period.
    meshes : int
        Mesh periods in the period.
    """

    problem: HillProblem
    rectangle: float | None = None
    meshes: int = 1

    @property
    def half(self) -> ComplexArray:
        """k/k0 as harmonics 0..J."""
        return np.concatenate([[1.0 + 0j], self.problem.stiffness_harmonics])

    def level(self, share: npt.ArrayLike) -> FloatArray:
        """k/k0 of a rectangle at shares of its period."""
        assert self.rectangle is not None
        turned = (np.asarray(share, dtype=float) + 0.25) % 1.0
        return np.where(turned < 0.5, 1 + self.rectangle, 1 - self.rectangle)


def square_wave(harmonics: int) -> ComplexArray:
    """c_1..c_J of 1 + eps for half a period about t = 0, 1 - eps for the other half."""
    j = np.arange(1, harmonics + 1)
    sizes = VARIATION * np.sin(0.5 * math.pi * j) * 2 / (math.pi * j)
    return np.asarray(sizes, dtype=np.complex128)


def pair(
    harmonics: npt.ArrayLike, zeta: float | None = None, ratio: float | None = None, meshes: int = 1
) -> HillProblem:
    """Return the published pair, with another damping ratio, w0/w or number of meshes a period.

    Parameters
    ----------
    harmonics : complex array, shape (J,)
        Relative stiffness harmonics of the period.
    zeta : float, optional
        Damping ratio; 0.3007 by default.
    ratio : float, optional
        Natural over mesh frequency; 13.6115 by default.
    meshes : int
        Mesh periods in the period.
    """
    period = PERIOD_S
    if ratio is not None:
        period = 2 * math.pi * ratio * math.sqrt(MASS_KG / STIFFNESS_N_PER_M)
    damping = DAMPING_NS_PER_M if zeta is None else zeta * CRITICAL_NS_PER_M
    own = np.asarray(harmonics, dtype=np.complex128)
    return HillProblem(MASS_KG, damping, STIFFNESS_N_PER_M, own, meshes * period, FORCE_N)


def _smooth(harmonics: int = 10, zeta: float | None = None, ratio: float | None = None) -> Case:
    return Case(problem=pair(square_wave(harmonics), zeta=zeta, ratio=ratio))


def _cracked(*cracks: str) -> Case:
    from gearmon.gears.faults import parse_fault
    from gearmon.gears.stiffness import mesh_stiffness

    stiffness = mesh_stiffness(STAGE, [parse_fault(crack) for crack in cracks], FORM)
    meshes = stiffness.period_mesh
    problem = pair(stiffness.harmonics(MESH_HARMONICS * meshes), meshes=meshes)
    return Case(problem=problem, meshes=meshes)


#: Natural over mesh frequency of the cases of a resonance, at a damping ratio of 0.05.
_RESONANCES = {"w": 1.0, "2w": 2.0, "w/2": 0.5, "13.6w": 13.6}
CASES: dict[str, Callable[[], Case]] = {
    # the published pair, 10 stiffness harmonics
    "pair": _smooth,
    "damping 0.02": partial(_smooth, zeta=0.02),
    "damping 0.005": partial(_smooth, zeta=0.005),
    **{f"resonance {at}": partial(_smooth, 10, 0.05, own) for at, own in _RESONANCES.items()},
    "64 harmonics": partial(_smooth, 64),
    # with its true jumps
    "rectangle": lambda: Case(problem=pair(square_wave(1000)), rectangle=VARIATION),
    # one cracked tooth over a turn of the pinion; one on either gear over the hunting period
    "cracked tooth": partial(_cracked, CRACK),
    "hunting period": partial(_cracked, CRACK, GEAR_CRACK),
}
QUICK = ("pair", "resonance w", "rectangle")


def growing_turn(meshes: int) -> HillProblem:
    """Return a pair whose stiffness dips once in `meshes` mesh periods; ten harmonics a mesh.

    Parameters
    ----------
    meshes : int, >= 1
        Mesh periods in the period: the number of unknowns grows in proportion.

    Notes
    -----
    The dip is a Gaussian of 0.1 of the mean and of a quarter mesh period's standard deviation, so
    its harmonics are known in closed form.
    """
    r = np.arange(1, MESH_HARMONICS * meshes + 1)
    width, depth = 0.25, 0.1
    dip = depth * width * math.sqrt(2 * math.pi) / meshes
    harmonics = -dip * np.exp(-2 * (math.pi * width * r / meshes) ** 2).astype(np.complex128)
    harmonics[meshes - 1 :: meshes] += square_wave(MESH_HARMONICS)
    return pair(harmonics, zeta=0.07, meshes=meshes)


class Lines(NamedTuple):
    """A steady motion given as harmonics z_0..z_N of its deflection [F/k0]."""

    displacement: ComplexArray


def as_lines(response: Response) -> Lines:
    """Return the harmonics of a response, in units of F/k0."""
    p = response.problem
    return Lines(response.displacement * (p.stiffness_n_per_m / p.force_n))


class Samples(NamedTuple):
    """A steady motion given as accelerations [w0^2 F/k0] at shares of the period, ascending."""

    share: FloatArray
    acceleration: FloatArray


Motion = Lines | Samples


@dataclass(frozen=True, kw_only=True, eq=False)
class Reference:
    """Accurate periodic motion of one case.

    Attributes
    ----------
    ratio : float
        w0/w.
    decay_rate : float
        Slowest decay of free vibrations, in units of w0; negative if they grow.
    acceleration : ndarray, shape (segments, nodes)
        At the Gauss nodes of every segment.
    """

    ratio: float
    decay_rate: float
    acceleration: FloatArray

    @property
    def size(self) -> float:
        """Rms acceleration."""
        return math.sqrt(float((self.acceleration**2 @ rule(NODES).weights).mean()))

    def error(self, motion: Motion) -> float:
        """Relative L2 error of the acceleration of a motion over the period."""
        if isinstance(motion, Lines):
            orders, segments = np.arange(len(motion.displacement)), len(self.acceleration)
            lines = -((orders / self.ratio) ** 2) * motion.displacement
            wrong = at_nodes(lines, segments) - self.acceleration
            weights = rule(NODES).weights / segments
        else:
            wrong = motion.acceleration - self._at_shares(motion.share)
            # every sample stands for the share of the period that is nearest to it
            gaps = np.diff(motion.share, append=motion.share[0] + 1.0)
            weights = 0.5 * (gaps + np.roll(gaps, 1))
        return math.sqrt(float((weights * wrong**2).sum())) / self.size

    def _at_shares(self, share: FloatArray) -> FloatArray:
        """Acceleration anywhere, from the polynomial of the segment that begins at or before."""
        place = (share % 1.0) * len(self.acceleration)
        # a sample on a jump belongs to the segment that begins there, rounding or not
        segment = np.floor(place + 1e-9).astype(int)
        series = self.acceleration[segment % len(self.acceleration)] @ gauss(NODES)[2].T
        return np.asarray((series * legvander(2 * (place - segment) - 1, NODES - 1)).sum(axis=1))


def folded(half: ComplexArray, length: int) -> FloatArray:
    """Values of a half spectrum on `length` equal steps, however many harmonics it has."""
    if len(half) <= length // 2:
        return np.asarray(np.fft.irfft(half, length, norm="forward"))
    whole = np.zeros(length, dtype=np.complex128)
    np.add.at(whole, np.arange(len(half)) % length, np.where(np.arange(len(half)), 2.0, 1.0) * half)
    return np.asarray(np.fft.ifft(whole, norm="forward").real)


def at_nodes(half: ComplexArray, segments: int) -> FloatArray:
    """Values of a half spectrum at the nodes of all segments, shape (segments, nodes)."""
    turns = 2j * math.pi * np.arange(len(half)) / segments
    # the phase of a node turns every harmonic
    return np.column_stack([folded(half * np.exp(turns * x), segments) for x in rule(NODES).nodes])


class Rule(NamedTuple):
    """Gauss-Legendre collocation on [0, 1].

    Attributes
    ----------
    nodes, weights : ndarray, shape (n,)
    integral : ndarray, shape (n, n)
        Row i integrates the polynomial through the nodes from 0 to node i.
    """

    nodes: FloatArray
    weights: FloatArray
    integral: FloatArray


@lru_cache(maxsize=4)
def rule(count: int) -> Rule:
    """Return the collocation with `count` nodes."""
    x, w, analysis = gauss(count)
    integral = np.asarray(legval(x, legint(analysis, lbnd=-1)).T, dtype=np.float64)
    return Rule(0.5 * (x + 1), 0.5 * w, 0.5 * integral)


def solve_reference(case: Case, segments: int | None = None) -> Reference:
    """Periodic motion of a case to about 1e-13.

    Parameters
    ----------
    case : Case
    segments : int, optional
        Divisible by 4; by default what resonance and stiffness harmonics take.
    """
    p = case.problem
    ratio, zeta = p.frequency_ratio, p.damping_ratio
    if segments is None:
        # short enough for rounding accuracy; divisible by 4 for the jumps of a rectangle
        lines = 0 if case.rectangle else len(p.stiffness_harmonics)
        segments = 4 * math.ceil(max(8.0, 2 * math.pi * max(1.3 * ratio, lines + 1)) / 4)
    step = 2 * math.pi * ratio / segments
    stiffness = _stiffness(case, segments)
    parts = np.array_split(stiffness, math.ceil(segments / BATCH))
    solved = (_segment_maps(part, zeta, step) for part in parts)
    maps, accelerations = (np.concatenate(found) for found in zip(*solved, strict=True))
    states, growth = _close(maps)
    # acceleration is linear in (z, v, 1) at the start of the segment
    ends = np.column_stack([states, np.ones(segments)])
    acceleration = np.einsum("sij,sj->si", accelerations, ends)
    decay_rate = -growth / (2 * math.pi * ratio)
    return Reference(ratio=ratio, decay_rate=decay_rate, acceleration=acceleration)


def reference_and_doubt(problem: HillProblem) -> tuple[Reference, float]:
    """Return the accurate motion of a problem, and by how much it may be wrong.

    The doubt is its relative difference to a second solution, with a quarter more segments and a
    period that is longer by four roundings: what the numbers given tell, and no more.
    """
    case = Case(problem=problem)
    first = solve_reference(case)
    segments, period_s = len(first.acceleration), problem.period_s
    moved = replace(problem, period_s=period_s + 4 * math.ulp(period_s))
    second = solve_reference(replace(case, problem=moved), 4 * math.ceil(1.25 * segments / 4))
    share = (np.arange(segments)[:, None] + rule(NODES).nodes) / segments
    return first, second.error(Samples(share.ravel(), first.acceleration.ravel()))


def _stiffness(case: Case, segments: int) -> FloatArray:
    """Relative stiffness at the nodes of all segments, shape (segments, nodes)."""
    if case.rectangle is not None:
        middle = (np.arange(segments) + 0.5) / segments
        return np.repeat(case.level(middle)[:, None], NODES, axis=1)
    return at_nodes(case.half, segments)


def _segment_maps(stiffness: FloatArray, zeta: float, step: float) -> tuple[FloatArray, FloatArray]:
    """Return what maps (z, v, 1) to the next (z, v), and to accelerations at the nodes."""
    r = rule(NODES)
    once, twice = step * r.integral, step**2 * (r.integral @ r.integral)
    matrix = np.eye(NODES) + 2 * zeta * once + stiffness[:, :, None] * twice
    right = np.empty((*stiffness.shape, 3))
    right[:, :, 0] = -stiffness
    right[:, :, 1] = -2 * zeta - stiffness * (step * r.nodes)
    right[:, :, 2] = 1.0
    acceleration = np.linalg.solve(matrix, right)
    deflection = step**2 * ((r.weights @ r.integral) @ acceleration)
    moved = np.stack([deflection, step * (r.weights @ acceleration)], axis=1)
    moved += np.array([[1.0, step, 0.0], [0.0, 1.0, 0.0]])
    return moved, np.asarray(acceleration, dtype=np.float64)


def _close(maps: FloatArray) -> tuple[FloatArray, float]:
    """Periodic states at the start of every segment, and log of the largest multiplier."""
    whole, shift, log = np.eye(2), np.zeros(2), 0.0
    for moved in maps:
        whole = moved[:, :2] @ whole
        shift = moved[:, :2] @ shift + moved[:, 2]
        # the map of a long period is smaller than the smallest number
        size = float(np.abs(whole).max())
        whole /= size
        log += math.log(size)
    state = np.linalg.solve(np.eye(2) - math.exp(min(log, 700.0)) * whole, shift)
    states = [state]
    for moved in maps[:-1]:
        states.append(moved[:, :2] @ states[-1] + moved[:, 2])
    return np.array(states), log + math.log(float(np.abs(np.linalg.eigvals(whole)).max()))
