"""Equations of a gear mesh that methods are judged on: named cases, and random systems.

The random systems of the stress test come up to nine tenths of the variation that makes them
unstable. Drawn log-uniformly: damping ratio 1e-3 to 3 and w0/w 0.1 to 50; uniformly: 1 to 64
stiffness harmonics with random phases and sizes that fall with a random power of 0 to 2 of their
number, and the share 0 to 0.9 of the variation at which the system first turns unstable. A
variation never exceeds twice the mean stiffness: the spring may turn negative for part of the
period.
"""

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
    damping = DAMPING_NS_PER_M if zeta is None else zeta * CRITICAL_NS_PER_M
    own = np.asarray(harmonics, dtype=np.complex128)
    return HillProblem(MASS_KG, damping, STIFFNESS_N_PER_M, own, meshes * period, FORCE_N)


def _smooth(
    name: str,
    title: str,
    harmonics: int = 10,
    zeta: float | None = None,
    ratio: float | None = None,
) -> Case:
    problem = pair(square_wave(harmonics), zeta=zeta, ratio=ratio)
    return Case(name=name, title=title, problem=problem)


def _resonant(name: str, ratio: float) -> Case:
    title = f"resonance w0 = {name}, damping ratio 0.05"
    return _smooth(f"resonance {name}", title, zeta=0.05, ratio=ratio)


def _rectangle() -> Case:
    known = MASS_KG, DAMPING_NS_PER_M, STIFFNESS_N_PER_M, VARIATION, 0.5, PERIOD_S, FORCE_N
    true, title = PiecewiseProblem.rectangular(*known), "rectangular stiffness, true jumps"
    return Case(name="rectangle", title=title, problem=pair(square_wave(1000)), rectangle=true)


def _cracked(name: str, title: str, *cracks: str) -> Case:
    from gearmon.gears.faults import parse_fault
    from gearmon.gears.stiffness import mesh_stiffness

    stiffness = mesh_stiffness(STAGE, [parse_fault(crack) for crack in cracks], FORM)
    harmonics = stiffness.harmonics(MESH_HARMONICS * stiffness.period_mesh)
    meshes = len(harmonics) // MESH_HARMONICS
    problem = pair(harmonics, meshes=meshes)
    return Case(name=name, title=title.format(meshes), problem=problem, meshes=meshes)


HUNTING = "a cracked tooth on either gear, hunting period of {} meshes"
CASES: dict[str, Callable[[], Case]] = {
    "pair": lambda: _smooth("pair", "published pair, 10 stiffness harmonics"),
    "damping 0.02": lambda: _smooth("damping 0.02", "damping ratio 0.02", zeta=0.02),
    "damping 0.005": lambda: _smooth("damping 0.005", "damping ratio 0.005", zeta=0.005),
    "resonance w": lambda: _resonant("w", 1.0),
    "resonance 2w": lambda: _resonant("2w", 2.0),
    "resonance w/2": lambda: _resonant("w/2", 0.5),
    "resonance 13.6w": lambda: _resonant("13.6w", 13.6),
    "64 harmonics": lambda: _smooth("64 harmonics", "64 stiffness harmonics", 64),
    "rectangle": _rectangle,
    "cracked tooth": lambda: _cracked(
        "cracked tooth", "one cracked tooth, {} meshes a turn", CRACK
    ),
    "hunting period": lambda: _cracked("hunting period", HUNTING, CRACK, GEAR_CRACK),
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


RATIOS = (0.1, 50.0)
ZETAS = (1e-3, 3.0)
MOST_HARMONICS = 64
MOST_SHARE = 0.9
LARGEST_VARIATION = 2.0


@dataclass(frozen=True, kw_only=True, eq=False)
class System:
    """One random system.

    Parameters
    ----------
    problem : HillProblem
    variation : float
        Largest absolute value of phi.
    limit : float
        Variation at which the system turns unstable, or 2.
    """

    problem: HillProblem
    variation: float
    limit: float


def draw_system(rng: np.random.Generator) -> System:
    """Draw one system.

    Parameters
    ----------
    rng : numpy.random.Generator
    """
    ratio, zeta = np.exp(rng.uniform(*np.log([RATIOS, ZETAS]).T)).tolist()
    count = int(rng.integers(1, MOST_HARMONICS + 1))
    shape = rng.normal(size=count) + 1j * rng.normal(size=count)
    shape /= np.arange(1, count + 1) ** rng.uniform(0.0, 2.0)
    shape /= np.abs(_values(shape, 16 * count)).max()
    limit = instability_limit(ratio, zeta, shape)
    variation = float(rng.uniform(0.0, MOST_SHARE)) * limit
    problem = pair(variation * shape, zeta=zeta, ratio=ratio)
    return System(problem=problem, variation=variation, limit=limit)


def instability_limit(ratio: float, zeta: float, shape: Complex) -> float:
    """Smallest variation, to half a percent, that makes a free vibration grow; at most 2.

    Parameters
    ----------
    ratio, zeta : float
        w0/w and damping ratio.
    shape : complex ndarray, shape (J,)
        Stiffness harmonics of a variation of 1.

    Examples
    --------
    >>> import numpy as np                 # 2 w0 = w: unstable above 4 zeta, nearly
    >>> bool(abs(instability_limit(0.5, 0.05, np.array([0.5 + 0j])) / 0.2 - 1) < 0.03)
    True
    """
    low = 1e-3 * LARGEST_VARIATION
    grid = np.geomspace(low, LARGEST_VARIATION, 28)
    for _ in range(3):
        growing = np.flatnonzero(growth(ratio, zeta, shape, grid) > 0)
        if not len(growing):
            return float(grid[-1])
        first = int(growing[0])
        if first == 0:
            return float(grid[0])
        grid = np.geomspace(grid[first - 1], grid[first], 8)
    return float(grid[0])


def growth(ratio: float, zeta: float, shape: Complex, variations: Real) -> Real:
    """Logarithm of the larger Floquet multiplier's modulus, for many variations at once.

    Parameters
    ----------
    ratio, zeta : float
    shape : complex ndarray, shape (J,)
    variations : ndarray, shape (V,)

    Returns
    -------
    ndarray, shape (V,)
        From steps of constant stiffness, whose error falls with the square of their number.
    """
    steps = 1 << math.ceil(math.log2(12 * max(4.0, len(shape), 3 * ratio)))
    step = 2 * math.pi * ratio / steps
    # without its damping, z = e^{-zeta s} y, the motion y has this stiffness
    stiffness = 1 - zeta**2 + variations * _values(shape, steps)[:, None]
    root = np.sqrt(np.abs(stiffness)) * step
    swings = stiffness > 0
    bounded = np.minimum(root, 700.0)
    cosine = np.where(swings, np.cos(root), np.cosh(bounded))
    sine = np.where(swings, np.sin(root), np.sinh(bounded))
    sine = step * np.where(root > 1e-8, sine / np.maximum(root, 1e-8), 1.0)
    product, log = _product(np.array([[cosine, sine], [-stiffness * sine, cosine]]))
    half = 0.5 * (product[0, 0] + product[1, 1])
    determinant = product[0, 0] * product[1, 1] - product[0, 1] * product[1, 0]
    inner = half**2 - determinant
    modulus = np.where(
        inner > 0,
        np.abs(half) + np.sqrt(np.maximum(inner, 0.0)),
        np.sqrt(np.maximum(determinant, 1e-300)),
    )
    return np.asarray(np.log(modulus) + log - zeta * 2 * math.pi * ratio)


def _product(maps: Real) -> tuple[Real, Real]:
    """Ordered product of 2 x 2 maps along axis 2, whose length is a power of two; log of scale."""
    log = np.zeros(maps.shape[3])
    while maps.shape[2] > 1:
        early, late = maps[:, :, 0::2], maps[:, :, 1::2]
        maps = np.array(
            [
                [late[i, 0] * early[0, j] + late[i, 1] * early[1, j] for j in range(2)]
                for i in range(2)
            ]
        )
        size = np.abs(maps).max(axis=(0, 1))
        maps = maps / size
        log += np.log(size).sum(axis=0)
    return maps[:, :, 0], log


def _values(shape: Complex, length: int) -> Real:
    half = np.concatenate([np.zeros(1, dtype=np.complex128), shape])
    return np.asarray(np.fft.irfft(half, length, norm="forward"))
