"""Modes of a clamped uniform beam with a mass at its tip.

    1 + cos l cosh l + l M (cos l sinh l - sin l cosh l) - l^3 J (cosh l sin l + sinh l cos l)
      + l^4 M J (1 - cos l cosh l) = 0

with M the tip mass over the mass of the beam and J its rotary inertia about the tip over mass of
the beam times length squared (Erturk and Inman, Piezoelectric Energy Harvesting, 2011, appendix C).
Euler-Bernoulli: length over thickness above about 20.
"""

from __future__ import annotations

import math
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
        integral of phi_r plus M phi_r(1): what a unit acceleration of the base excites.

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


@lru_cache(maxsize=512)
def beam_modes(
    tip_mass_ratio: float = 0.0, tip_inertia_ratio: float = 0.0, count: int = 3
) -> BeamModes:
    """Return the first modes.

    Parameters
    ----------
    tip_mass_ratio : float, >= 0
        Tip mass over mass of the beam.
    tip_inertia_ratio : float, >= 0
        Rotary inertia of the tip mass about the tip over mass of the beam times length squared.
    count : int, 1 to 8
        Number of modes.

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
    check_range("count", count, 1, 8)
    roots = np.array([_root(r, tip_mass_ratio, tip_inertia_ratio) for r in range(count)])
    columns = np.array([roots, *_shapes(roots, tip_mass_ratio, tip_inertia_ratio)])
    columns.flags.writeable = False
    return BeamModes(*columns)


def mass_ratio_for(first_eigenvalue: float, gyration_ratio: float = 0.0) -> float:
    """Return the tip mass ratio that gives a wanted first eigenvalue.

    With J = M g^2 the characteristic equation is A + B M + C M^2 = 0; the smaller root belongs to
    the first mode. It falls from infinity at l -> 0 to 0 at l = 1.8751.

    Parameters
    ----------
    first_eigenvalue : float, > 0 and <= 1.8751
    gyration_ratio : float, 0 to 1
        Radius of gyration of the tip mass about the tip over the length of the beam, g.

    Raises
    ------
    ArgumentError
        If the eigenvalue is not above 0 or above that of the bare beam.
    """
    check_positive("first_eigenvalue", first_eigenvalue)
    check_range("gyration_ratio", gyration_ratio, 0.0, 1.0)
    bare = float(beam_modes().eigenvalue[0])
    if first_eigenvalue > bare * (1 + 1e-12):
        raise ArgumentError(
            f"first_eigenvalue={first_eigenvalue:.6g} must not exceed that of the bare beam, "
            f"{bare:.6g}"
        )
    s, c = math.sin(first_eigenvalue), math.cos(first_eigenvalue)
    sh, ch = math.sinh(first_eigenvalue), math.cosh(first_eigenvalue)
    rotary = first_eigenvalue**3 * gyration_ratio**2
    constant = 1 + c * ch
    linear = first_eigenvalue * (s * ch - c * sh) + rotary * (ch * s + sh * c)
    square = first_eigenvalue * rotary * (1 - c * ch)
    # this form of the root loses no digits where the square is small
    return max(0.0, 2 * constant / (linear + math.sqrt(linear**2 - 4 * constant * square)))


def _characteristic(eigenvalue: Any, mass: float, inertia: float, m: Any = math) -> Any:
    """Characteristic function over cosh l, which neither overflows nor loses digits.

    Of one eigenvalue by `math`, which is faster then, or of many by NumPy as `m`.
    """
    s, c, t, sech = m.sin(eigenvalue), m.cos(eigenvalue), m.tanh(eigenvalue), 1 / m.cosh(eigenvalue)
    rotary = eigenvalue**3 * inertia
    value = sech + c + eigenvalue * mass * (c * t - s) - rotary * (s + t * c)
    return value + eigenvalue * rotary * mass * (sech - c)


def _root(number: int, mass: float, inertia: float) -> float:
    """Find root number 0, 1, ... of the characteristic function."""
    from scipy.optimize import brentq

    if inertia == 0:
        # a mass moves the root from that of a free tip towards that of a pinned one
        low = (number + 0.25) * math.pi - 1e-3 if number else 1e-9
        high = (number + 0.5) * math.pi + 0.31 * (number == 0) + 5e-3
        return float(brentq(_characteristic, low, high, (mass, 0.0), xtol=1e-15))
    # signs alternate from root to root; near 0 the first two lie a factor of 1.9 or more apart
    grid = _scanned()
    values = _characteristic(grid, mass, inertia, np)
    changes = np.flatnonzero(np.sign(values[1:]) != np.sign(values[:-1]))
    if len(changes) <= number:
        raise ArgumentError(f"mode {number + 1} of the beam was not found; ask for fewer modes")
    low, high = grid[changes[number]], grid[changes[number] + 1]
    return float(brentq(_characteristic, low, high, (mass, inertia), xtol=1e-15))


@lru_cache(maxsize=1)
def _scanned() -> Real:
    return np.concatenate([np.geomspace(5e-3, 2, 600, endpoint=False), np.arange(2, 32, 0.02)])


def _shapes(roots: Real, mass: float, inertia: float) -> tuple[Real, Real, Real, Real]:
    """Tip value, tip slope, root curvature and forcing of the modes, normalised by mass."""
    share = _sine_share(roots, inertia)
    nodes, weights = _quadrature()
    shape = _shape(roots, share, nodes, 0)
    tip = _shape(roots, share, np.ones(1), 0)[:, 0]
    slope = _shape(roots, share, np.ones(1), 1)[:, 0]
    # phi''(0) of cosh - cos is 2 l^2, that of sinh - sin is 0
    curvature = 2 * roots**2
    norm = np.sqrt(shape**2 @ weights + mass * tip**2 + inertia * slope**2)
    norm = np.where(tip < 0, -norm, norm)
    return tip / norm, slope / norm, curvature / norm, (shape @ weights + mass * tip) / norm


def _sine_share(root: Real, inertia: float) -> Real:
    """Share of sin - sinh beside cosh - cos, from the moment at the tip."""
    s, c, t = np.sin(root), np.cos(root), np.tanh(root)
    sech = 1 / np.cosh(root)
    rotary = root**3 * inertia
    # phi''(1) = l^4 J phi'(1), both sides over cosh l
    above = c * sech + 1 - rotary * (s * sech + t)
    below = s * sech + t + rotary * (c * sech - 1)
    return np.asarray(above / below, dtype=np.float64)


def _shape(root: Real, share: Real, x: Real, derivative: int) -> Real:
    """Evaluate cosh - cos - share (sinh - sin), or its slope, at x; shape (modes, x)."""
    turned, share = root[:, None] * x, share[:, None]
    s, c, sh, ch = np.sin(turned), np.cos(turned), np.sinh(turned), np.cosh(turned)
    if derivative == 0:
        return np.asarray((ch - c) - share * (sh - s))
    return np.asarray(root[:, None] * ((sh + s) - share * (ch - c)))


@lru_cache(maxsize=1)
def _quadrature() -> tuple[Real, Real]:
    nodes, weights = np.polynomial.legendre.leggauss(80)
    return (nodes + 1) / 2, weights / 2
