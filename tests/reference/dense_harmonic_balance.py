"""Harmonic balance as plainly as it can be written: one dense system of all harmonics."""

from __future__ import annotations

import numpy as np


def steady_displacement(mass_kg, damping_ns_per_m, mean_n_per_m, relative, period_s, force_n):
    """Solve m z'' + c z' + k(t) z = F for the periodic z.

    k(t) = mean (1 + sum (c_n exp(i n w t) + conj)), with c_1 ... c_2N in `relative`. Returns the
    complex coefficients z_0 ... z_N with z(t) = z_0 + sum (z_n exp(i n w t) + conj).
    """
    harmonics = len(relative) // 2
    spectrum = mean_n_per_m * np.concatenate([[1.0], relative, relative[::-1].conj()])
    orders = np.arange(-harmonics, harmonics + 1)
    matrix = spectrum[orders[:, None] - orders[None, :]].copy()
    w = 2 * np.pi * orders / period_s
    matrix[np.diag_indices(len(orders))] += -mass_kg * w**2 + 1j * damping_ns_per_m * w
    right = np.zeros(len(orders), dtype=complex)
    right[harmonics] = force_n
    return np.linalg.solve(matrix, right)[harmonics:]
