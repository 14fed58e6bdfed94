"""Instability of systems with several meshes, in closed form: which harmonics feed which modes.

With modes of unit mass, D^(l) = Phi^T [sum_j k_j c_jl v_j v_j^T] Phi of the l-th harmonic of the
stiffness couples mode p to mode q where l w = w_p + w_q (p = q: principal resonance). To first
order of multiple scales, with z_p = A_p e^{i w_p t} + conjugate,

    A_p' = -mu_p A_p + i D_pq/(2 w_p) conj(A_q) e^{i s t},    s = l w - w_p - w_q

and the same with p and q exchanged. With kappa = |D_pq|/(2 sqrt(w_p w_q)) free vibrations grow for

    |s| < (mu_p + mu_q) sqrt(kappa^2/(mu_p mu_q) - 1),    undamped |s| < 2 kappa.

Where modes share a frequency, as the translational ones of planetary sets, D is a block and its
singular values take the place of |D_pq|. Differences of frequencies do not occur, because D is
symmetric. The error is of second order in the variation of stiffness.

Source: Nayfeh and Mook, Nonlinear Oscillations, 1979, chapter 5; for gears Lin and Parker,
J. Vib. Acoust. 124 (2002) 68.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gearmon.dynamics.fourier import Real
from gearmon.dynamics.system import HillSystem

#: Frequencies that agree so closely are one: rounding of eigenvalues is far below.
SAME = 1e-6
#: A coupling below this share of the largest is rounding.
NO_COUPLING = 1e-9


@dataclass(frozen=True, kw_only=True)
class Tongue:
    """Where two modes are unstable together.

    Attributes
    ----------
    harmonic : int
        l, of the stiffness.
    modes : (int, int)
        p <= q, the first of each frequency, counted from 0 in ascending order.
    frequency_hz : float
        Centre: 1/T at which l/T is the sum of both natural frequencies.
    half_width_hz : float
        Half width in 1/T; 0 where damping closes the tongue.
    coupling_per_s : float
        kappa [1/s]: rate of growth at the centre without damping.
    damping_per_s : (float, float)
        mu_p and mu_q [1/s].
    """

    harmonic: int
    modes: tuple[int, int]
    frequency_hz: float
    half_width_hz: float
    coupling_per_s: float
    damping_per_s: tuple[float, float]


def combination_tongues(system: HillSystem) -> list[Tongue]:
    """Principal and combination instabilities of first order, the widest first.

    Parameters
    ----------
    system : HillSystem
        Its own period does not matter: the tongues say at which it is unstable. Gyroscopic terms
        are left out.

    Returns
    -------
    list of Tongue
        Every pair of modes that some harmonic couples, damped shut or not.

    Examples
    --------
    >>> pair = HillSystem(0.28, 0.0, 0.0, 1.0, 8e8, [[0.065]], 1.6e-3, 4e3)
    >>> tongue = combination_tongues(pair)[0]
    >>> round(tongue.half_width_hz / tongue.frequency_hz, 6)    # eps/4 of 2 w0
    0.0325
    """
    squares, shapes = system.modes
    natural = np.sqrt(np.where(system.rigid, 0.0, squares))
    damping = 0.5 * np.diag(shapes.T @ system.velocity_matrix @ shapes)
    groups = _groups(natural)
    meshes = shapes.T @ system.mesh_vectors.T
    found = []
    for index, c in enumerate(system.mesh_harmonics.T):
        coupling = meshes @ ((system.mesh_stiffness_n_per_m * c)[:, None] * meshes.T)
        for i, p in enumerate(groups):
            for q in groups[i:]:
                sizes = np.linalg.svd(coupling[np.ix_(p, q)], compute_uv=False)
                found += _tongues(index + 1, p, q, sizes, natural, damping)
    most = max((tongue.coupling_per_s for tongue in found), default=0.0)
    open_ = [tongue for tongue in found if tongue.coupling_per_s > NO_COUPLING * most]
    return sorted(open_, key=lambda tongue: (-tongue.half_width_hz, -tongue.coupling_per_s))


def _groups(natural: Real) -> list[list[int]]:
    """Modes of one frequency together, rigid-body motions left out."""
    groups: list[list[int]] = []
    for mode, frequency in enumerate(natural):
        if frequency == 0:
            continue
        if groups and frequency - natural[groups[-1][0]] <= SAME * frequency:
            groups[-1].append(mode)
        else:
            groups.append([mode])
    return groups


def _tongues(
    harmonic: int, p: list[int], q: list[int], sizes: Real, natural: Real, damping: Real
) -> list[Tongue]:
    """One tongue for every different coupling of two frequencies."""
    one, other = float(natural[p[0]]), float(natural[q[0]])
    rates = float(damping[p].mean()), float(damping[q].mean())
    found: list[Tongue] = []
    for size in sizes:
        kappa = float(size) / (2 * math.sqrt(one * other))
        if found and found[-1].coupling_per_s - kappa <= SAME * kappa:
            continue
        width = 2 * kappa
        if min(rates) > 0:
            excess = kappa**2 / (rates[0] * rates[1]) - 1
            width = sum(rates) * math.sqrt(max(0.0, excess))
        found.append(
            Tongue(
                harmonic=harmonic,
                modes=(p[0], q[0]),
                frequency_hz=(one + other) / (2 * math.pi * harmonic),
                half_width_hz=width / (2 * math.pi * harmonic),
                coupling_per_s=kappa,
                damping_per_s=rates,
            )
        )
    return found
