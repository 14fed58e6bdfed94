"""Plane-stress ring loaded over an arc of one circle and held on the other: exact compliances.

Every Fourier component of the tractions is one small linear system for the complex potentials of
the ring; the loads are those that a tooth root passes on: a moment as linear pressure, a pull
along the circle as uniform shear, a push into the body as uniform pressure.

References
----------
Muskhelishvili, Some Basic Problems of the Mathematical Theory of Elasticity (1953), for the
potentials; Sainsot, Velex & Duverger, J. Mech. Des. 126 (2004) 142, for the loads.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.gears.panels import ComplexArray, FloatArray

#: Fourier components are taken up to this many radians over half the loaded arc.
ARC_PHASE = 60.0
#: Beyond so many decades of decay across the ring, its other circle is as good as infinitely far.
LARGEST_DECAY = 40.0


@lru_cache(maxsize=256)
def arc_compliance(
    ratio: float, half_angle_rad: float, poisson_ratio: float, apart_rad: float = 0.0
) -> FloatArray:
    """Return the compliances of a ring under loads on an arc, for E b = 1 and loaded radius 1.

    Parameters
    ----------
    ratio : float, > 0, not 1
        Radius of the held circle over that of the loaded one: below 1 a disc on its bore, above 1
        a ring held round its outside.
    half_angle_rad : float
        Half the angle of the loaded arc.
    poisson_ratio : float
    apart_rad : float
        Angle from the arc whose deflection is asked for to the loaded one, counted in the
        direction of the shear.

    Returns
    -------
    ndarray, shape (3, 3)
        Rows: rotation, displacement along the circle, displacement into the body, each as the mean
        over its arc that the corresponding load does work on. Columns: moment (which presses where
        the shear points to), shear force, pressing force.

    Notes
    -----
    Symmetric for `apart_rad` 0, by reciprocity.
    """
    if check_positive("ratio", ratio) == 1:
        raise ArgumentError("ratio=1 leaves no body between the circles; it must differ from 1")
    check_range("half_angle_rad", half_angle_rad, 1e-4, math.pi / 2, "rad")
    outwards = 1.0 if ratio < 1 else -1.0
    kappa = (3 - poisson_ratio) / (1 + poisson_ratio)
    count = math.ceil(ARC_PHASE / half_angle_rad)
    orders = np.arange(1, count + 1, dtype=np.float64)
    ahead, behind = (_tractions(sign * orders, half_angle_rad, outwards) for sign in (1, -1))
    # loads as (T_k, conj T_-k); they move (U_k, conj U_-k)
    loads = np.stack([ahead, behind.conj()])
    moves = np.einsum("kij,jkl->ikl", _responses(count, ratio, kappa), loads)
    turn = np.exp(-1j * orders * apart_rad)[:, None]
    # work of stress s - i t and displacement u + i v: the components k and -k pair up
    work = np.einsum("kr,kl->rl", loads[1].conj(), moves[0] * turn)
    work = work + np.einsum("kr,kl->rl", loads[0], moves[1].conj() * turn.conj())
    total = 2 * math.pi * (np.real(work) + _mean_work(ratio, kappa, half_angle_rad, outwards))
    shear_modulus = 1 / (2 * (1 + poisson_ratio))
    return np.asarray(outwards * total / (2 * shear_modulus))


def _tractions(orders: FloatArray, half: float, outwards: float) -> ComplexArray:
    """Return the components of ``s_rr - i s_rt`` for unit moment, shear and pressure.

    Shape (orders, 3). Pressure is negative radial stress on either circle; shear points the other
    way where the outside of the body lies inwards.
    """
    x = orders * half
    uniform = np.sinc(x / np.pi) / (2 * np.pi)
    linear = -1j * (np.sin(x) - x * np.cos(x)) / np.where(x == 0, 1, x) ** 2
    moment = -3 * linear / (2 * np.pi * half)
    return np.stack([moment, -1j * outwards * uniform, -uniform + 0j], axis=-1)


def _responses(count: int, ratio: float, kappa: float) -> FloatArray:
    """Return the matrices, shape (count, 2, 2), from (T_k, conj T_-k) to 2 G (U_k, conj U_-k).

    ``T_k = (1-k) A_k r^k + A'_-k r^-k - B_k-2 r^k-2`` and
    ``U_k = kappa A_k r^(k+1)/(k+1) - A'_-k r^(1-k) + B'_-k-2 r^(-k-1)/(k+1)`` with the potentials
    ``Phi = sum A_n z^n``, ``Psi = sum B_n z^n`` and ' for the conjugate.
    """
    k = np.arange(2, count + 1, dtype=np.float64)
    decay = math.log(ratio) * k
    far = np.exp(np.clip(decay, -LARGEST_DECAY, LARGEST_DECAY) / k)
    matrix = np.zeros((len(k), 4, 4))
    one = np.ones_like(k)
    matrix[:, 0] = np.stack([1 - k, one, -one, 0 * k], axis=-1)
    matrix[:, 1] = np.stack([one, 1 + k, 0 * k, -one], axis=-1)
    matrix[:, 2:] = _displacements(k, far, kappa)
    near = _displacements(k, one, kappa)
    scale = np.abs(matrix).max(axis=1, keepdims=True)
    right = np.zeros((len(k), 4, 2))
    right[:, 0, 0] = right[:, 1, 1] = 1.0
    solved = np.linalg.solve(matrix / scale, right) / np.swapaxes(scale, 1, 2)
    return np.concatenate([_first_response(ratio, kappa)[None], near @ solved])


def _displacements(k: FloatArray, r: FloatArray, kappa: float) -> FloatArray:
    ahead = [kappa * r ** (k + 1) / (k + 1), -(r ** (1 - k)), 0 * k, r ** (-k - 1) / (k + 1)]
    behind = [-(r ** (1 + k)), kappa * r ** (1 - k) / (1 - k), r ** (k - 1) / (1 - k), 0 * k]
    return np.stack([np.stack(ahead, axis=-1), np.stack(behind, axis=-1)], axis=1)


def _first_response(ratio: float, kappa: float) -> FloatArray:
    """Return the response to tractions with a resultant force: logarithms, and a shift."""

    def displacements(r: float) -> FloatArray:
        ahead = [kappa * r * r / 2, -1.0, r**-2 / 2, 0.0]
        return np.array([ahead, [-r * r, 2 * kappa * math.log(r), 0.0, 1.0]])

    stresses = np.array([[0.0, 1 + kappa, 0.0, 0.0], [1.0, 2.0, -1.0, 0.0]])
    matrix = np.concatenate([stresses, displacements(ratio)])
    right = np.zeros((4, 2))
    right[0, 0] = right[1, 1] = 1.0
    return np.asarray(displacements(1.0) @ np.linalg.solve(matrix, right))


def _mean_work(ratio: float, kappa: float, half: float, outwards: float) -> FloatArray:
    """Return the work of the components of order 0: breathing and torsion of the ring."""
    mean = _tractions(np.zeros(1), half, outwards)[0]
    breathing = np.linalg.solve([[2.0, -1.0], [(kappa - 1) * ratio, 1 / ratio]], [1.0, 0.0])
    radial = (kappa - 1) * breathing[0] + breathing[1]
    torsion = 1 - ratio**-2
    moved = radial * mean.real + 1j * torsion * mean.imag
    return np.asarray(np.real(np.outer(mean, moved)))
