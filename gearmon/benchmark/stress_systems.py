"""Random systems for the stress test, up to nine tenths of the variation that makes them unstable.

Drawn log-uniformly: damping ratio 1e-3 to 3 and w0/w 0.1 to 50; uniformly: 1 to 64 stiffness
harmonics with random phases and sizes that fall with a random power of 0 to 2 of their number, and
the share 0 to 0.9 of the variation at which the system first turns unstable. A variation never
exceeds twice the mean stiffness: the spring may turn negative for part of the period.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gearmon.dynamics import HillProblem

Real = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

RATIOS = (0.1, 50.0)
ZETAS = (1e-3, 3.0)
MOST_HARMONICS = 64
MOST_SHARE = 0.9
LARGEST_VARIATION = 2.0
MASS_KG = 0.28
STIFFNESS_N_PER_M = 8e8
FORCE_N = 4e3


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
    problem = HillProblem(
        MASS_KG,
        2 * zeta * math.sqrt(STIFFNESS_N_PER_M * MASS_KG),
        STIFFNESS_N_PER_M,
        np.asarray(variation * shape, dtype=np.complex128),
        2 * math.pi * ratio * math.sqrt(MASS_KG / STIFFNESS_N_PER_M),
        FORCE_N,
    )
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
