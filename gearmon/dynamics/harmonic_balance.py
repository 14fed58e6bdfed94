"""Harmonic balance: all harmonics 0..N together, as one linear system.

    D_n z_n + sum_m phi_{n-m} z_m = g_n,    n = -N..N

The matrix has the bandwidth of the stiffness harmonics. It is solved banded (SciPy) where that
pays and dense elsewhere. This is the direct rival of the expansion: exact for its N, no
convergence to wait for, and dear for the thousands of harmonics of a shaft turn.
"""

from __future__ import annotations

import numpy as np

from gearmon.dynamics.certificate import Approximation, Certifier
from gearmon.dynamics.fourier import Complex
from gearmon.dynamics.hill import HillProblem
from gearmon.errors import ArgumentError

BYTES_ALLOWED = 1e9


def solve(problem: HillProblem, highest: int, right_side: Complex | None = None) -> Complex:
    """Harmonics 0..highest of the steady vibration [m].

    Parameters
    ----------
    problem : HillProblem
        What to solve.
    highest : int
        N >= 1.
    right_side : complex ndarray, shape (N+1,), optional
        g [m] to use in place of the forces of the problem (for refinement).

    Raises
    ------
    ArgumentError
        If the matrix would not fit in memory; multiple scales needs no matrix.
    """
    half = problem.static_forcing(highest) if right_side is None else right_side
    full: Complex = np.concatenate([half[:0:-1].conj(), half])
    c = problem.stiffness_harmonics[: 2 * highest]
    bytes_needed = 16 * (2 * highest + 1) * min(3 * len(c) + 1, 2 * highest + 1)
    if bytes_needed > BYTES_ALLOWED:
        raise ArgumentError(
            f"harmonic balance of {highest} harmonics with {len(c)} stiffness harmonics needs "
            f"{bytes_needed / 1e9:.1f} GB; use method='auto', which stores no matrix"
        )
    stiffness = problem.dynamic_stiffness(highest)
    diagonal: Complex = np.concatenate([stiffness[:0:-1].conj(), stiffness])
    solve_full = _dense if _is_wide(highest, len(c)) else _banded
    return solve_full(diagonal, c, full)[highest:]


def _is_wide(highest: int, bandwidth: int) -> bool:
    """Small or nearly full matrices are not worth the import and the storage of a band."""
    return highest < 150 or 3 * bandwidth > highest


def _dense(diagonal: Complex, c: Complex, right_side: Complex) -> Complex:
    size = len(diagonal)
    # phi_{n-m} for n - m = -(size-1)..size-1, read through a sliding window
    row = np.zeros(2 * size - 1, dtype=complex)
    row[size : size + len(c)] = c
    row[size - 1 - len(c) : size - 1] = c[::-1].conj()
    matrix = np.lib.stride_tricks.sliding_window_view(row, size)[:, ::-1].copy()
    matrix[np.diag_indices(size)] += diagonal
    return np.asarray(np.linalg.solve(matrix, right_side), dtype=np.complex128)


def _banded(diagonal: Complex, c: Complex, right_side: Complex) -> Complex:
    from scipy.linalg import solve_banded

    width = len(c)
    bands = np.zeros((2 * width + 1, len(diagonal)), dtype=complex)
    bands[width] = diagonal
    bands[:width] = c[::-1].conj()[:, None]
    bands[width + 1 :] = c[:, None]
    solution: Complex = solve_banded((width, width), bands, right_side, check_finite=False)
    return solution


def balance(certifier: Certifier, highest: int) -> Approximation:
    """Harmonics 0..highest together, refined once so that only rounding is left.

    Raises
    ------
    ArgumentError
        If the matrix would not fit in memory.
    """
    dynamic = np.zeros(highest + 1, dtype=complex)
    for _ in range(2):
        residual = certifier.judge(dynamic).residual[: highest + 1]
        dynamic = dynamic + solve(certifier.problem, highest, residual)
    return certifier.judge(dynamic)
