"""What faults of different shafts do to each other, followed over their common turn.

Superposed, faults delta_f with answers b_f leave r = -sum_{f != g} delta_f b_g undone. The error
e = L^{-1} r is bounded by gain ||r|| at once; but most of r lies where L is stiff. So the first
orders of e are followed line by line,

    e_1 = r/D,      e_{k+1} = -(phi e_k)/D
    ||e''|| <= ||(e_1 + ... + e_k)''|| + gain ||phi e_k||

which takes a few Fourier transforms of the common turn and no solution over it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearmon.dynamics.fourier import Complex, Real, fast_length, rms, samples
from gearmon.dynamics.sideband_bounds import TurnGain
from gearmon.dynamics.sideband_families import dynamic_stiffness

MOST_SAMPLES = 1 << 22
MOST_ORDERS = 4
# an order that does not lower the bound to this share is the last one
WORTH = 0.8


@dataclass(frozen=True, kw_only=True)
class Part:
    """One fault and its answer, as half spectra over its turn.

    Attributes
    ----------
    meshes : int
        Meshes in the turn.
    delta, added : complex ndarray
        Fault with its mean, and what it adds to the deflection.
    """

    meshes: int
    delta: Complex
    added: Complex


def followed(
    ratio: float, zeta: float, even: Complex, parts: Sequence[Part], gain: TurnGain
) -> float:
    """Bound of the rms acceleration over w0^2 that the cross terms make.

    Parameters
    ----------
    ratio, zeta : float
        w0 over the mesh frequency, damping ratio.
    even : complex ndarray
        phi_0 with its mean over the mesh period, as a half spectrum.
    parts : sequence of Part
        Faults of different shafts.
    gain : TurnGain
        Of all together.

    Returns
    -------
    float
        Infinite if the common turn would take too many samples.
    """
    turn = math.lcm(*(part.meshes for part in parts))
    stiff = max(len(even), *(len(p.delta) / p.meshes for p in parts))
    moving = max(len(p.added) / p.meshes for p in parts)
    # the mean square of a product of phi and an order needs twice its bandwidth
    length = fast_length(2 * math.ceil(MOST_ORDERS * stiff + moving) + 4)
    if length * turn > MOST_SAMPLES:
        return math.inf
    deltas = [_over(part.delta, part.meshes, turn, length) for part in parts]
    answers = [_over(part.added, part.meshes, turn, length) for part in parts]
    whole = np.sum(answers, axis=0)
    undone = -np.sum(
        [delta * (whole - own) for delta, own in zip(deltas, answers, strict=True)], axis=0
    )
    phi = np.sum(deltas, axis=0) + _over(even, 1, turn, length)
    lines = np.arange(length * turn // 2 + 1)
    stiffness = dynamic_stiffness(ratio * turn, zeta, lines)
    weights = (lines / (ratio * turn)) ** 2
    total: Complex = np.zeros(len(lines), dtype=complex)
    best = gain.acceleration * math.sqrt(float(np.mean(undone**2)))
    for _ in range(MOST_ORDERS):
        order = np.fft.rfft(undone, norm="forward") / stiffness
        total += order
        undone = -phi * samples(order, len(phi))
        left = gain.acceleration * math.sqrt(float(np.mean(undone**2)))
        bound = rms(weights * total) + left
        if bound > WORTH * best:
            return min(bound, best)
        best = bound
    return best


def _over(half: Complex, meshes: int, turn: int, length: int) -> Real:
    """Values over the common turn, `length` to a mesh."""
    return np.tile(samples(half, length * meshes), turn // meshes)
