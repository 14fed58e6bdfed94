"""Named cases of a gear mesh on which methods for its steady vibration are compared."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gearmon.benchmark.stiffness import CRACK, FORM, STAGE
from gearmon.dynamics import HillProblem
from gearmon.dynamics.piecewise import PiecewiseProblem
from gearmon.errors import ArgumentError

Real = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

MASS_KG = 0.28
DAMPING_NS_PER_M = 9e3
STIFFNESS_N_PER_M = 8e8
PERIOD_S = 1.6e-3
FORCE_N = 4e3
VARIATION = 0.13
#: Damping whose ratio is 0.3 with the mass and stiffness above, per unit of damping ratio.
CRITICAL_NS_PER_M = 2 * math.sqrt(STIFFNESS_N_PER_M * MASS_KG)
GEAR_CRACK = "crack:1:gear:9:1mm"
MESH_HARMONICS = 10


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """One equation to be solved by all methods.

    Parameters
    ----------
    name : str
        Short, for tables and files.
    title : str
        What it is, for pictures.
    problem : HillProblem
        The equation; of a rectangle its Fourier sum, cut off.
    rectangle : PiecewiseProblem, optional
        The true stiffness where it jumps. Its jumps lie at quarters of the period.
    meshes : int
        Mesh periods in the period.
    """

    name: str
    title: str
    problem: HillProblem
    rectangle: PiecewiseProblem | None = None
    meshes: int = 1

    def relative_stiffness(self, share: npt.ArrayLike) -> Real:
        """k/k0 of a rectangle at shares of its period.

        Raises
        ------
        ArgumentError
            If the stiffness is no rectangle.
        """
        if self.rectangle is None:
            raise ArgumentError(f"case {self.name}: its stiffness is no rectangle")
        r = self.rectangle
        ends = np.cumsum(r.durations_s) / r.period_s
        turned = (np.asarray(share, dtype=float) - r.start_s / r.period_s) % 1.0
        piece = np.minimum(np.searchsorted(ends, turned, side="right"), len(ends) - 1)
        return np.asarray(r.stiffness_n_per_m[piece] / self.problem.stiffness_n_per_m)


def square_wave(harmonics: int, variation: float = VARIATION) -> Complex:
    """c_1..c_J of 1 + eps for half a period about t = 0, 1 - eps for the other half."""
    j = np.arange(1, harmonics + 1)
    sizes = variation * np.sin(0.5 * math.pi * j) * 2 / (math.pi * j)
    return np.asarray(sizes, dtype=np.complex128)


def pair(
    harmonics: npt.ArrayLike,
    *,
    zeta: float | None = None,
    ratio: float | None = None,
    meshes: int = 1,
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
    return HillProblem(
        MASS_KG,
        DAMPING_NS_PER_M if zeta is None else zeta * CRITICAL_NS_PER_M,
        STIFFNESS_N_PER_M,
        np.asarray(harmonics, dtype=np.complex128),
        meshes * period,
        FORCE_N,
    )


def _paper() -> Case:
    return Case(
        name="pair", title="published pair, 10 stiffness harmonics", problem=pair(square_wave(10))
    )


def _damped(zeta: float) -> Case:
    return Case(
        name=f"damping {zeta:g}",
        title=f"damping ratio {zeta:g}",
        problem=pair(square_wave(10), zeta=zeta),
    )


def _resonant(name: str, ratio: float) -> Case:
    return Case(
        name=f"resonance {name}",
        title=f"resonance w0 = {name}, damping ratio 0.05",
        problem=pair(square_wave(10), zeta=0.05, ratio=ratio),
    )


def _many() -> Case:
    return Case(name="64 harmonics", title="64 stiffness harmonics", problem=pair(square_wave(64)))


def _rectangle() -> Case:
    true = PiecewiseProblem.rectangular(
        MASS_KG, DAMPING_NS_PER_M, STIFFNESS_N_PER_M, VARIATION, 0.5, PERIOD_S, FORCE_N
    )
    return Case(
        name="rectangle",
        title="rectangular stiffness, true jumps",
        problem=pair(square_wave(1000)),
        rectangle=true,
    )


def _cracked(faults: tuple[str, ...]) -> Complex:
    from gearmon.gears.faults import parse_fault
    from gearmon.gears.stiffness import mesh_stiffness

    stiffness = mesh_stiffness(STAGE, [parse_fault(fault) for fault in faults], FORM)
    return stiffness.harmonics(MESH_HARMONICS * stiffness.period_mesh)


def _one_tooth() -> Case:
    harmonics = _cracked((CRACK,))
    meshes = len(harmonics) // MESH_HARMONICS
    return Case(
        name="cracked tooth",
        title=f"one cracked tooth, {meshes} meshes a turn",
        problem=pair(harmonics, meshes=meshes),
        meshes=meshes,
    )


def _hunting() -> Case:
    harmonics = _cracked((CRACK, GEAR_CRACK))
    meshes = len(harmonics) // MESH_HARMONICS
    return Case(
        name="hunting period",
        title=f"a cracked tooth on either gear, hunting period of {meshes} meshes",
        problem=pair(harmonics, meshes=meshes),
        meshes=meshes,
    )


CASES: dict[str, Callable[[], Case]] = {
    "pair": _paper,
    "damping 0.02": lambda: _damped(0.02),
    "damping 0.005": lambda: _damped(0.005),
    "resonance w": lambda: _resonant("w", 1.0),
    "resonance 2w": lambda: _resonant("2w", 2.0),
    "resonance w/2": lambda: _resonant("w/2", 0.5),
    "resonance 13.6w": lambda: _resonant("13.6w", 13.6),
    "64 harmonics": _many,
    "rectangle": _rectangle,
    "cracked tooth": _one_tooth,
    "hunting period": _hunting,
}
QUICK = ("pair", "resonance w", "rectangle")


def named_case(name: str) -> Case:
    """Return the case of this name.

    Raises
    ------
    ArgumentError
        If there is none.
    """
    if name not in CASES:
        raise ArgumentError(f"case {name!r} must be one of: {', '.join(CASES)}")
    return CASES[name]()


def growing_turn(meshes: int, zeta: float = 0.07) -> HillProblem:
    """Return a pair whose stiffness dips once in `meshes` mesh periods; ten harmonics a mesh.

    Parameters
    ----------
    meshes : int, >= 1
        Mesh periods in the period: the number of unknowns grows in proportion.
    zeta : float
        Damping ratio.

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
    return pair(harmonics, zeta=zeta, meshes=meshes)
