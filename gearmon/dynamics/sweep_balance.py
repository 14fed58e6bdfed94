"""Harmonic balance of many sets at once that share a pattern of stiffness.

For sets whose orders do not converge. The harmonics 0..N of every set are one real system

    (D + s phi) y = -s c

and LAPACK solves the stack of them.
"""

from __future__ import annotations

import numpy as np

from gearmon.dynamics.fourier import Complex, Real
from gearmon.dynamics.sweep_orders import product_matrix, stacked

BYTES_TOGETHER = 32e6


def most_together(highest: int, reach: int) -> int:
    """How many sets fit in the memory set aside."""
    return max(1, int(BYTES_TOGETHER / (32.0 * (highest + 1) * (reach + 1))))


def balance(
    harmonics: Complex, highest: int, ratio: Real, zeta: Real, scale: Real
) -> tuple[Real, Real, Real]:
    """Solve all sets for harmonics 0..highest.

    Parameters
    ----------
    harmonics : complex ndarray, shape (J,)
        c_1..c_J.
    highest : int
        N.
    ratio, zeta, scale : float ndarray, shape (B,)
        R, damping ratio, factor of phi.

    Returns
    -------
    y : float ndarray, shape (2 N + 2, B)
        Rows of the deflection over the static one, less one.
    product, forcing : float ndarray, shape (2 (N + J) + 2, B) and (2 (N + J) + 2, 1)
        phi y and the coefficients of phi, for the bound.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a matrix is singular to working precision.
    """
    reach = highest + len(harmonics)
    outward = product_matrix(harmonics, highest, reach)
    line = np.zeros((reach + 1, 1), dtype=complex)
    line[1 : len(harmonics) + 1, 0] = harmonics
    forcing = stacked(line)
    # the mean is real: its imaginary row and column are left out
    within = np.arange(highest + 1)
    rows = np.concatenate([within, reach + 2 + within[:-1]])
    columns = np.concatenate([within, highest + 2 + within[:-1]])
    matrix = outward[rows[:, None], columns] * scale[:, None, None]
    x = within / ratio[:, None]
    real, imaginary = 1 - x * x, (2 * zeta[:, None]) * x
    matrix[:, within, within] += real
    upper, lower = within[1:], highest + within[1:]
    matrix[:, lower, lower] += real[:, 1:]
    matrix[:, upper, lower] -= imaginary[:, 1:]
    matrix[:, lower, upper] += imaginary[:, 1:]
    right = -(forcing[rows] * scale).T
    solved = np.linalg.solve(matrix, right[..., None])[..., 0]
    y = np.zeros((2 * highest + 2, len(ratio)))
    y[: highest + 1] = solved[:, : highest + 1].T
    y[highest + 2 :] = solved[:, highest + 1 :].T
    return y, outward @ y, forcing
