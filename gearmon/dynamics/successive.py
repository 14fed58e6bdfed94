"""The plain sum of the orders, for problems where each order is known to be smaller.

The expansion is made about a constant stiffness 1 + b midway between the extremes of 1 + phi,

    (D_n + b) Z^(k+1)_n = -[(phi - b) Z^(k)]_n,

which for a stiffness that drops at one tooth of many is well below the mean and nearer to the
extremes. Where max|phi - b| max 1/|D + b| < 1 it converges for certain, by at least that factor an
order. An order costs two Fourier transforms and nothing is stored: the cheapest there is for the
thousands of harmonics of a shaft turn. The partial sum leaves the residual -(phi - b) Z^(k), which
is the force of the next order: what is left is known before it is summed.
"""

from __future__ import annotations

import math

import numpy as np

from gearmon.dynamics.certificate import Approximation, Certifier
from gearmon.dynamics.error_bound import peak
from gearmon.dynamics.fourier import Complex, Modulation, rms

SLOWEST = 0.7
AIM = 0.3
MOST_ORDERS = 120


def converges_fast(certifier: Certifier) -> bool:
    """Whether every order is known to be smaller than the last by a factor worth having."""
    gain = certifier.gain
    if gain.source != "small gain" or gain.stable is not True:
        return False
    middle, swing = certifier.middle
    largest = peak(certifier.problem.damping_ratio / math.sqrt(1 + middle))
    return swing * largest < SLOWEST * (1 + middle)


def sum_orders(certifier: Certifier, dynamic: Complex, tolerance: float) -> Approximation:
    """Improve z = g/D + dynamic by as many further orders as the tolerance takes.

    Parameters
    ----------
    certifier : Certifier
        Of the problem; `converges_fast`.
    dynamic : complex ndarray, shape (N+1,)
        What is known so far, zeros to begin with.
    tolerance : float
        Relative error of the acceleration aimed at.
    """
    highest = len(dynamic) - 1
    p = certifier.problem
    stiffness = p.dynamic_stiffness(highest)
    start = p.static_forcing(highest) / stiffness
    modulate = Modulation(p.stiffness_harmonics, highest, highest)
    if dynamic.any():
        force = certifier.judge(dynamic).residual[: highest + 1].copy()
    else:
        force = -modulate(start)
    middle = certifier.middle[0]
    modulate.values -= middle
    compliance = 1 / (stiffness + middle)
    total = dynamic.copy()
    weights = certifier.weights(highest)
    last = certifier.last_shown(highest) + 1
    gain = certifier.gain.acceleration
    size = math.inf
    orders = 0
    while orders < MOST_ORDERS:
        force *= compliance
        total += force
        orders += 1
        force = modulate(force)
        np.negative(force, out=force)
        left = gain * rms(force)
        if orders > 2 and left > 2 * AIM * tolerance * size:
            continue
        # the size hardly changes after the first orders: it is taken again only to decide
        size = rms((weights * (start + total))[:last])
        if left <= AIM * tolerance * size:
            break
    return certifier.judge(total, orders)
