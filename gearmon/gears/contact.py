"""Flattening of two flanks at their contact: a constant, or the load-dependent form.

References
----------
Yang & Sun, J. Mech. Transm. Autom. Des. 107 (1985) 529; Weber & Banaschek (1953).
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from gearmon.gears.panels import FloatArray

#: How flanks give way; see `hertz_compliance` and `weber_banaschek_compliance`.
Contact = Literal["constant", "load-dependent"]
CONTACTS: tuple[Contact, ...] = ("constant", "load-dependent")


def hertz_compliance(
    width_m: FloatArray | float, moduli_pa: tuple[float, float], poisson_ratio: float
) -> FloatArray:
    """Return the load-independent compliance of a line contact [m/N].

    Parameters
    ----------
    width_m : array_like
        Length of the line of contact [m].
    moduli_pa : (float, float)
        Young's moduli of both gears [Pa].
    poisson_ratio : float

    Notes
    -----
    ``k_h = pi E b/(4 (1 - nu^2))`` for equal moduli; compliances of both bodies add up.

    Examples
    --------
    >>> round(1e-9 / float(hertz_compliance(0.02, (206e9, 206e9), 0.3)), 6)
    3.555869
    """
    one, two = moduli_pa
    plane = 2 * (1 - poisson_ratio**2) * (1 / one + 1 / two) / math.pi
    return np.asarray(plane / np.asarray(width_m))


def weber_banaschek_compliance(
    force_n: FloatArray,
    width_m: FloatArray | float,
    curvature_radius_m: FloatArray,
    depths_m: tuple[FloatArray, FloatArray],
    moduli_pa: tuple[float, float],
    poisson_ratio: float,
) -> FloatArray:
    """Return the secant compliance delta/F of a line contact under load [m/N].

    Parameters
    ----------
    force_n : ndarray, > 0
        Force on the contact [N].
    width_m : array_like
        Length of the line of contact [m].
    curvature_radius_m : ndarray
        Equivalent radius of curvature ``rho_1 rho_2/(rho_1 + rho_2)`` [m].
    depths_m : (ndarray, ndarray)
        Distance from the contact to the middle of each tooth, along the force [m].
    moduli_pa : (float, float)
    poisson_ratio : float

    Notes
    -----
    ``a = sqrt(8 w rho (1 - nu^2)/(pi E))``,
    ``delta = 4 (1 - nu^2) w/(pi E) [ln(2 sqrt(h1 h2)/a) - nu/(2 (1 - nu))]``, w = F/b; of unequal
    moduli the harmonic mean.
    """
    modulus = 2 / (1 / moduli_pa[0] + 1 / moduli_pa[1])
    plane = (1 - poisson_ratio**2) / (math.pi * modulus)
    load = force_n / width_m
    half_width = np.sqrt(8 * load * curvature_radius_m * plane)
    depth = 2 * np.sqrt(depths_m[0] * depths_m[1]) / half_width
    bracket = np.log(depth) - poisson_ratio / (2 * (1 - poisson_ratio))
    # crushing loads flatten a contact as wide as the tooth, beyond what the form describes
    return np.asarray(4 * plane / np.asarray(width_m) * np.maximum(bracket, 0.25))
