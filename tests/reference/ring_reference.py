"""Slow versions for rings: Fourier components by finite elements, a tooth by its thickness."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

gauss = cache(np.polynomial.legendre.leggauss)


def arc_compliance_slow(ratio, half, nu, apart=0.0, orders=240, elements=40):
    """Compliances of a plane ring for loads on an arc; see `gears.tooth.arc_compliance`.

    Displacements of each order by quadratic elements along the radius: no potentials.
    """
    outwards = 1.0 if ratio < 1 else -1.0
    total = np.zeros((3, 3))
    stiffness = _stiffness(ratio, nu, elements)
    for k in range(orders + 1):
        yielding = _yielding(k, stiffness)
        loads = _loads(k, half, outwards)
        # order -k is the conjugate of order k, so together they are twice the real part
        work = np.conj(loads.T) @ yielding @ loads * np.exp(-1j * k * apart)
        total += (1 if k == 0 else 2) * 2 * math.pi * np.real(work)
    return total


def _loads(k, half, outwards):
    """Components of (t_r, t_theta) for unit moment, shear and push on an arc, shape (2, 3)."""
    x, w = gauss(40 + 2 * int(k * half))
    angle, weight = half * x, half * w / (2 * math.pi) * np.exp(-1j * k * half * x)
    uniform = np.sum(weight) / (2 * half)
    linear = np.sum(weight * angle) * 3 / (2 * half**3)
    # the body lies on the other side of the outward normal
    return np.array([[-outwards * linear, 0, -outwards * uniform], [0, uniform, 0]], dtype=complex)


def _stiffness(ratio, nu, elements):
    """Stiffness of the ring as coefficients of 1, k and k^2."""
    # elements crowd at the loaded circle, where high orders decay
    s = np.linspace(0, 1, elements + 1)
    radii = 1 + (ratio - 1) * s**3
    size = 2 * (2 * elements + 1)
    stiff = np.zeros((3, size, size))
    elastic = np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]]) / (1 - nu**2)
    points, weights = np.polynomial.legendre.leggauss(4)
    for n in range(elements):
        low, high = radii[n], radii[n + 1]
        jacobian = 0.5 * (high - low)
        for x, w in zip(points, weights, strict=True):
            r = 0.5 * (low + high) + jacobian * x
            shape = np.array([0.5 * x * (x - 1), 1 - x * x, 0.5 * x * (x + 1)])
            slope = np.array([x - 0.5, -2 * x, x + 0.5]) / jacobian
            strain, turning = np.zeros((3, 6)), np.zeros((3, 6))
            # u = U exp(ik theta), v = -i W exp(ik theta): strains are `strain` + k `turning`
            strain[0, 0::2] = slope
            strain[1, 0::2], turning[1, 1::2] = shape / r, shape / r
            turning[2, 0::2], strain[2, 1::2] = shape / r, shape / r - slope
            where = np.ix_(np.arange(4 * n, 4 * n + 6), np.arange(4 * n, 4 * n + 6))
            mixed = strain.T @ elastic @ turning
            for power, part in enumerate(
                (strain.T @ elastic @ strain, mixed + mixed.T, turning.T @ elastic @ turning)
            ):
                stiff[power][where] += part * r * w * abs(jacobian)
    return stiff


def _yielding(k, stiffness):
    """Displacement (u, v) at radius 1 by tractions (t_r, t_theta) there, held at the other edge."""
    stiff = stiffness[0] + k * stiffness[1] + k**2 * stiffness[2]
    found = np.linalg.solve(stiff[:-2, :-2], np.eye(len(stiff) - 2, 2))[:2]
    turn = np.array([[1, 0], [0, -1j]])
    return turn @ found @ np.conj(turn.T)


def ring_tooth_compliances(pair, root, roll, modulus, nu, steps=40_000):
    """Bending, shear and axial compliance times face width of a ring's tooth.

    Parameters
    ----------
    pair : PairGeometry
    root : tuple of ndarray
        Distance from the centre and half thickness of the fillet, from the root on.
    roll : float
        Roll length of the contact on the ring.
    """
    base = pair.base_radii_m[1]

    def point(at):
        radius = math.hypot(base, at)
        half = pair.gears[1].thickness_m(radius) / (2 * radius)
        return radius * math.cos(half), radius * math.sin(half)

    contact_y, contact_h = point(roll)
    near = math.hypot(contact_y, contact_h)
    far = math.hypot(root[0][-1], root[1][-1])
    flank = [point(math.sqrt(r * r - base * base)) for r in np.linspace(far, near, steps)]
    y = np.concatenate([root[0][:-1], [p[0] for p in flank]])
    h = np.concatenate([root[1][:-1], [p[1] for p in flank]])
    # slope of the flank from two neighbouring points
    ahead, behind = point(roll * (1 + 1e-6)), point(roll * (1 - 1e-6))
    slope = math.atan2(ahead[1] - behind[1], ahead[0] - behind[0])
    lever = (y - contact_y) * math.cos(slope) - contact_h * math.sin(slope)
    shear_modulus = modulus / (2 * (1 + nu))

    def integral(values):
        return abs(float(np.sum(0.5 * (values[1:] + values[:-1]) * np.diff(y))))

    return (
        integral(lever**2 / (modulus * 2 * h**3 / 3)),
        integral(1.2 * math.cos(slope) ** 2 / (shear_modulus * 2 * h)),
        integral(math.sin(slope) ** 2 / (modulus * 2 * h)),
    )
