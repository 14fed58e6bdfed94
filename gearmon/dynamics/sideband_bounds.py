"""How large the error of superposed sidebands can be, without ever building the common turn.

Faults delta_f repeat with turns of P_f meshes each, a pinion of 26 and a gear of 53 only together
after 26 x 53. Three bounds of the inverse of L = L_0 + sum delta_f are known that need no such
period, hold at every real frequency, and prove stability: the small gain of `error_bound`; the
energy bound of `sweep_bounds`, in which every part contributes the oscillation of its own
variation; and the gain of L_0 with the faults added by a Neumann series.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearmon.dynamics.certificate import UNIT_ROUNDOFF
from gearmon.dynamics.fourier import Complex, Real, fast_length, rms, samples
from gearmon.dynamics.sweep_bounds import Swing, energy_gain
from gearmon.dynamics.sweep_floquet import floquet_gain


@dataclass(frozen=True, kw_only=True)
class TurnGain:
    """Bound of the inverse operator over any turn.

    Attributes
    ----------
    acceleration : float
        As in `error_bound.Gain`; infinite if none of the bounds holds.
    swing : float
        Bound of the largest |phi_0 + sum delta_f|.
    """

    acceleration: float
    swing: float


def turn_gain(
    ratio: float, zeta: float, mesh: Swing, faults: Sequence[tuple[Swing, int]]
) -> TurnGain:
    """Gain of the mesh with all its faults.

    Parameters
    ----------
    ratio, zeta : float
        w0 over the mesh frequency, damping ratio.
    mesh : Swing
        Of phi_0 over the mesh period.
    faults : sequence of (Swing, int)
        Of every delta over its turn, and the meshes in that turn.
    """
    added = sum(fault.highest for fault, _ in faults)
    swing = mesh.highest + added
    if zeta <= 0:
        return TurnGain(acceleration=math.inf, swing=swing)
    peak = 1 / (2 * zeta * math.sqrt(1 - zeta**2)) if zeta < math.sqrt(0.5) else 1.0
    gains = [peak / (1 - swing * peak) if swing * peak < 1 else math.inf]
    gains.append(_energy(ratio, zeta, swing, mesh, faults))
    alone, _ = floquet_gain(np.array([ratio]), np.array([zeta]), np.ones(1), mesh, everywhere=True)
    bare = float(alone[0])
    # the gain of displacement is one less at most, by the way it is made
    if added * (bare - 1) < 1:
        gains.append(bare / (1 - added * (bare - 1)))
    return TurnGain(acceleration=min(gains), swing=swing)


def _energy(
    ratio: float, zeta: float, swing: float, mesh: Swing, faults: Sequence[tuple[Swing, int]]
) -> float:
    """Energy bound; variation a period and its oscillation are summed part by part."""
    rate = mesh.variation + sum(fault.variation / meshes for fault, meshes in faults)
    oscillation = mesh.variation + sum(fault.variation for fault, _ in faults)
    one = np.array([ratio]), np.array([zeta]), np.array([swing])
    return float(energy_gain(*one, np.array([rate]), np.array([oscillation]))[0])


def answered(
    residual: Complex, stiffness: Complex, weights: Real, kept: int, gain: TurnGain
) -> float:
    """Bound of the rms acceleration that a residual leaves, lines above `kept` answered by r/D.

    Parameters
    ----------
    residual, stiffness : complex ndarray, shape (M+1,)
        r and D.
    weights : float ndarray, shape (M+1,)
        Acceleration over w0^2 z of every line.
    kept : int
        Highest line that was solved for.
    """
    extra = residual.copy()
    extra[: kept + 1] = 0
    extra /= stiffness
    coupled = rms(residual[: kept + 1]) + gain.swing * rms(extra)
    return rms(weights * extra) + (gain.acceleration * coupled if coupled else 0.0)


def rounding(lines: Complex, stiffness: Complex, swing: float) -> float:
    """Size of rounding errors in a residual: of D z, and of a Fourier product."""
    depth = 4 + math.log2(8 * len(lines))
    return UNIT_ROUNDOFF * (2 * rms(stiffness * lines) + depth * swing * rms(lines))


def rms_of_product(first: Complex, first_meshes: int, second: Complex, second_meshes: int) -> float:
    """Rms over their common turn of two functions that repeat with different turns.

    Parameters
    ----------
    first, second : complex ndarray
        Half spectra over their own turns.
    first_meshes, second_meshes : int
        Meshes in those turns.

    Notes
    -----
    Over the common turn every stretch of `gcd` meshes of the one meets every one of the other, so
    the mean of the product of squares is that of the averaged squares; nothing is left out.
    """
    together = math.gcd(first_meshes, second_meshes)
    reach = math.ceil(max(len(first) / first_meshes, len(second) / second_meshes))
    length = fast_length(4 * reach + 4)
    means = []
    for half, meshes in ((first, first_meshes), (second, second_meshes)):
        squares = samples(half, length * meshes) ** 2
        means.append(squares.reshape(meshes // together, -1).mean(axis=0))
    return math.sqrt(max(0.0, float(np.mean(means[0] * means[1]))))


def common_lines(parts: Sequence[tuple[Complex, int]]) -> tuple[Real, Complex]:
    """Lines of several half spectra over turns of their own, added up where they coincide.

    Returns
    -------
    orders : float ndarray, shape (L,)
        Frequencies over the mesh frequency, rising.
    lines : complex ndarray, shape (L,)
        Amplitudes.
    """
    turn = math.lcm(*(meshes for _, meshes in parts))
    keys = np.concatenate([np.arange(len(half)) * (turn // meshes) for half, meshes in parts])
    orders, place = np.unique(keys, return_inverse=True)
    lines = np.zeros(len(orders), dtype=complex)
    np.add.at(lines, place, np.concatenate([half for half, _ in parts]))
    return orders / turn, lines
