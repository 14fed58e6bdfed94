"""Modes of a clamped uniform beam with a body at its tip.

    1 + cos l cosh l + l M (cos l sinh l - sin l cosh l) - l^3 J (cosh l sin l + sinh l cos l)
      - 2 l^2 S sin l sinh l + l^4 (M J - S^2) (1 - cos l cosh l) = 0

with M the mass of the body over that of the beam, S its first moment and J its second moment about
the tip, over mass of the beam times length and length squared. For S = 0: Erturk and Inman,
Piezoelectric Energy Harvesting, 2011, appendix C; the terms in S follow from the same conditions
with the shear M phi + S phi' and the moment S phi + J phi' of the body.
Euler-Bernoulli: length over thickness above about 20.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError, check_positive, check_range

Real = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BeamModes:
    """Modes of a beam of unit length, unit mass and unit flexural stiffness, normalised by mass.

    Attributes
    ----------
    eigenvalue : ndarray, shape (modes,)
        l_r; the circular frequency of a real beam is l_r^2 sqrt(YI/(mu L^4)).
    tip, tip_slope : ndarray, shape (modes,)
        phi_r(1), phi_r'(1).
    root_curvature : ndarray, shape (modes,)
        phi_r''(0).
    forcing : ndarray, shape (modes,)
        integral of phi_r plus M phi_r(1) plus S phi_r'(1): what a unit acceleration of the base
        excites.
    in_beam : ndarray, shape (modes,)
        integral of phi_r^2: the share of the modal mass that is the beam's own.

    Notes
    -----
    For length L and mass per length mu: phi_r = (mu L)^(-1/2) times these; slope and curvature
    take another 1/L and 1/L^2, forcing becomes (mu L)^(1/2) times these.
    """

    eigenvalue: Real
    tip: Real
    tip_slope: Real
    root_curvature: Real
    forcing: Real
    in_beam: Real


@lru_cache(maxsize=8192)
def beam_modes(
    tip_mass_ratio: float = 0.0,
    tip_inertia_ratio: float = 0.0,
    count: int = 3,
    tip_moment_ratio: float = 0.0,
) -> BeamModes:
    """Return the first modes.

    Parameters
    ----------
    tip_mass_ratio : float, 0 to 1e6
        Tip mass over mass of the beam.
    tip_inertia_ratio : float, 0 to 1e6
        Rotary inertia of the tip mass about the tip over mass of the beam times length squared.
    count : int, 1 to 12
        Number of modes.
    tip_moment_ratio : float, 0 to 1e6
        Tip mass times the distance of its middle beyond the tip, over mass of the beam times
        length.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Examples
    --------
    >>> beam_modes().eigenvalue.round(6)
    array([1.875104, 4.694091, 7.854757])
    """
    check_range("tip_mass_ratio", tip_mass_ratio, 0.0, 1e6)
    check_range("tip_inertia_ratio", tip_inertia_ratio, 0.0, 1e6)
    check_range("tip_moment_ratio", tip_moment_ratio, 0.0, 1e6)
    if count not in range(1, 13):
        raise ArgumentError(f"count={count} must be a whole number in [1, 12]")
    body = (tip_mass_ratio, tip_moment_ratio, tip_inertia_ratio)
    columns = np.array([_roots(count, *body), *np.empty((5, count))])
    columns[1:] = _shapes(columns[0], *body)
    columns.flags.writeable = False
    return BeamModes(*columns)


def mass_ratio_for(
    first_eigenvalue: float,
    moments_of: Callable[[float], tuple[float, float]] = lambda _: (0.0, 0.0),
) -> float:
    """Return the tip mass ratio that gives a wanted first eigenvalue.

    Parameters
    ----------
    first_eigenvalue : float, > 0 and <= 1.8751
    moments_of : callable, optional
        Gives first and second moment ratios of the tip mass for a mass ratio; those of a point if
        not given.

    Raises
    ------
    ArgumentError
        If the eigenvalue is not above 0 or above that of the bare beam.
    """
    from scipy.optimize import brentq

    check_positive("first_eigenvalue", first_eigenvalue)
    bare = float(beam_modes().eigenvalue[0])
    if first_eigenvalue > bare * (1 + 1e-12):
        raise ArgumentError(
            f"first_eigenvalue={first_eigenvalue:.6g} must not exceed that of the bare beam, "
            f"{bare:.6g}"
        )

    def above(mass: float) -> float:
        return float(_characteristic(first_eigenvalue, mass, *moments_of(mass)))

    # a point of this mass has that root, so that a body of its mass has a lower one
    s, c, t = math.sin(first_eigenvalue), math.cos(first_eigenvalue), math.tanh(first_eigenvalue)
    point = (1 / math.cosh(first_eigenvalue) + c) / (first_eigenvalue * (s - c * t))
    if point <= 1e-13:
        return 0.0
    if above(point) >= 0:
        return point
    return float(brentq(above, 0.0, point, xtol=1e-15 * point, rtol=1e-14))


def _characteristic(root: Any, mass: float, moment: float, inertia: float, m: Any = math) -> Any:
    """Characteristic function over cosh l, which neither overflows nor loses digits.

    Of one root by `math`, which is faster then, or of many by NumPy as `m`.
    """
    s, c, t, sech = m.sin(root), m.cos(root), m.tanh(root), 1 / m.cosh(root)
    value = sech + c + root * mass * (c * t - s) - root**3 * inertia * (s + t * c)
    value = value - 2 * root**2 * moment * t * s
    return value + root**4 * (mass * inertia - moment**2) * (sech - c)


def _roots(count: int, mass: float, moment: float, inertia: float) -> Real:
    """Find the first roots of the characteristic function, whose signs alternate between them."""
    from scipy.optimize import brentq

    # near 0 the first two lie a factor of 1.9 or more apart
    grid = _scanned()
    signs = np.sign(_characteristic(grid, mass, moment, inertia, np))
    changes = np.flatnonzero(signs[1:] != signs[:-1])[:count]
    if len(changes) < count:
        raise ArgumentError(f"mode {count} of the beam was not found; ask for fewer modes")
    body = (mass, moment, inertia)
    return np.array(
        [brentq(_characteristic, grid[i], grid[i + 1], body, xtol=1e-15) for i in changes]
    )


@lru_cache(maxsize=1)
def _scanned() -> Real:
    return np.concatenate([np.geomspace(5e-3, 2, 600, endpoint=False), np.arange(2, 42, 0.02)])


def _shapes(root: Real, mass: float, moment: float, inertia: float) -> Real:
    """Tip, tip slope, root curvature, forcing, share in the beam; shape (5, modes)."""
    share, rest = _sine_share(root, moment, inertia)
    nodes, weights = _quadrature()
    shape = _shape(root, share, rest, nodes, 0)
    tip = _shape(root, share, rest, np.ones(1), 0)[:, 0]
    slope = _shape(root, share, rest, np.ones(1), 1)[:, 0]
    # phi''(0) of cosh - cos is 2 l^2, that of sinh - sin is 0
    curvature = 2 * root**2
    beam = shape**2 @ weights
    norm = np.sqrt(beam + mass * tip**2 + 2 * moment * tip * slope + inertia * slope**2)
    norm = np.where(tip < 0, -norm, norm)
    forcing = shape @ weights + mass * tip + moment * slope
    return np.array([tip, slope, curvature, forcing, beam / norm]) / norm


def _sine_share(root: Real, moment: float, inertia: float) -> tuple[Real, Real]:
    """Share of sinh - sin beside cosh - cos, from the moment at the tip, and 1 less that share."""
    s, c, t, sech = np.sin(root), np.cos(root), np.tanh(root), 1 / np.cosh(root)
    rotary, shifted = root**3 * inertia, root**2 * moment
    # phi''(1) = l^4 (J phi'(1) + S phi(1)), both sides over cosh l
    below = s * sech + t - rotary * (1 - c * sech) - shifted * (t - s * sech)
    # tanh l - 1, without the loss of digits that a difference of large terms would bring
    gap = -2 / (np.exp(2 * root) + 1)
    less = gap + sech * (s - c) + rotary * (gap + sech * (c + s)) - shifted * (gap + sech * (c - s))
    return 1 - less / below, less / below


def _shape(root: Real, share: Real, rest: Real, x: Real, derivative: int) -> Real:
    """Evaluate cosh - cos - share (sinh - sin), or its slope, at x; shape (modes, x)."""
    turned, share, rest = root[:, None] * x, share[:, None], rest[:, None]
    rising, falling = rest * np.exp(turned) / 2, (1 + share) * np.exp(-turned) / 2
    if derivative == 0:
        return np.asarray(rising + falling - np.cos(turned) + share * np.sin(turned))
    return np.asarray(root[:, None] * (rising - falling + np.sin(turned) + share * np.cos(turned)))


@lru_cache(maxsize=1)
def _quadrature() -> tuple[Real, Real]:
    nodes, weights = np.polynomial.legendre.leggauss(80)
    return (nodes + 1) / 2, weights / 2
