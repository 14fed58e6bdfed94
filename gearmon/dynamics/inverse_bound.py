"""Gain of the inverse operator and stability, from what a band factorisation reveals.

The bound needs no second factorisation. Where max|phi| max 1/|D| < 1 over all frequencies the
Neumann series gives the gain of the inverse operator and stability in one. Elsewhere both come
from the determinant that the factors hold, Hill's infinite determinant

    Q = det((D + phi) D^-1) = det(1 - M)/det(1 - M_0),

with M the map of the state over a period and M_0 that of constant stiffness. With
p = e^{-4 pi zeta R} the multipliers are the roots of rho^2 - (1 + p - q) rho + p = 0,
q = Q det(1 - M_0), so the system is stable if and only if 0 < q < 2 (1 + p). And with column norms
s_n^2 = |D_n|^2 + ms(phi), Hadamard's inequality and that of the means give

    ||(D + phi)^-1 r|| <= max(1/s_n) sqrt(e) prod_n (s_n/|D_n|) / |Q| ||r||.

What lies beyond the lines solved changes ln Q by at most what `beyond_lines` computes.
(Hill, Acta Math. 8, 1886; Magnus and Winkler, Hill's Equation, 1966.)
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gearmon.dynamics.band_system import NEAR_ONE, BandSystem, counting
from gearmon.dynamics.error_bound import peak
from gearmon.dynamics.fourier import Complex, supremum, with_zero_mean

FARTHEST = 1 << 40
MOST_BEYOND = 0.5
UNIT_ROUNDOFF = 2.0**-52


class InverseBound(NamedTuple):
    """What is known of the inverse operator.

    Attributes
    ----------
    gain : float
        ||(L^{-1} r)''|| <= gain ||r||, accelerations over w0^2.
    edge_gain : float
        The same for residuals of the lines above `inside` only.
    inside : int
        See there.
    stable : bool
        Whether free vibrations die out.
    """

    gain: float
    edge_gain: float
    inside: int
    stable: bool


def relative_bound(system: BandSystem, inverse: InverseBound, last: int) -> float:
    """Bound of the relative error, of harmonics 0..last."""
    accelerations: Complex = system.squares[: len(system.swinging)] * system.swinging
    size = _size(accelerations)
    # F - m z'' is the mesh force, and the sum of N lines is at most sqrt(2 N) times their rms
    reach = math.sqrt(2 * len(accelerations)) * size
    system.pressed = reach < 0.999 * abs(system.mean) and not len(system.forces)
    swinging = _size(system.swinging)
    damped = 2 * system.zeta * math.sqrt(size * swinging)
    # products with phi, forces of mass and damper, and n/R and the damping ratio themselves
    rounding = (
        2 * system.sum * ((system.band + 3) * swinging + abs(system.mean))
        + swinging
        + 6 * size
        + 4 * damped
    )
    edge = inverse.inside + 1
    error = inverse.gain * (_size(system.residual[:edge]) + UNIT_ROUNDOFF * rounding)
    if edge < len(system.residual):
        error += inverse.edge_gain * _size(system.residual[edge:])
    if last < len(accelerations) - 1:
        size = _size(accelerations[: last + 1])
    return error / (size - error) + 2 * UNIT_ROUNDOFF if error < size else math.inf


def cheap(system: BandSystem) -> InverseBound | None:
    """Gains from residual to acceleration, and stability; None if neither rule tells."""
    if system.loop < NEAR_ONE:
        gain = peak(system.zeta) / (1 - system.loop)
        return InverseBound(gain, gain, FARTHEST, True)
    return _by_determinant(system)


def _by_determinant(system: BandSystem) -> InverseBound | None:
    solved = system.solved
    distance = _distance(system)
    if distance is None:
        return None
    inside, nearest, decay = distance
    inner = system.stiffness[: solved + 1]
    magnitudes = inner.real**2 + inner.imag**2
    power = 2 * float(system.sizes @ system.sizes)
    norms = magnitudes + power
    log_norms = float(np.add.reduce(np.log(norms)))
    log_stiffness = float(np.add.reduce(np.log(magnitudes)))
    log_determinant, sign = determinant(system)
    log_ratio = log_determinant - log_stiffness
    hadamard = 0.5 + log_norms - log_determinant
    tail_squares = tail_squares_above(system.ratio, solved)
    static = math.sqrt(1 / float(norms.min()))
    margin = nearest - system.swing
    edge = 1 / margin + decay * decay * static * _exp(hadamard)
    beyond = beyond_lines(system, edge, power, tail_squares)
    stable = _is_stable(system, log_ratio, sign, beyond) if beyond < MOST_BEYOND else None
    if stable is None:
        return None
    # beyond resonance x^2/|D| falls, or never exceeds 1.16 where damping is strong
    last = float(system.squares[solved]) / math.sqrt(magnitudes[solved])
    largest = math.sqrt(float((system.squares[: solved + 1] ** 2 / norms).max()))
    largest = max(largest, last, 1.16)
    bound = _exp(hadamard + power * tail_squares + beyond)
    gain = largest * bound
    # residuals of lines well above resonance reach it only through jumps of phi/D
    local = max(1.16, float(system.squares[inside + 1]) / nearest) * nearest / margin
    edge_gain = gain * decay + local * (1 + system.swing * static * bound * decay)
    return InverseBound(gain, edge_gain, solved - system.band, stable)


def _distance(system: BandSystem) -> tuple[int, float, float] | None:
    """Line n above resonance, |D_n+1|, and what comes from the edge to lines 0..n at most.

    Lines within J of the edge are k jumps away from those up to n = N - kJ, and each jump costs
    max|phi|/|D_n+1|.
    """
    system.swing = 2 * system.sum
    if system.swing > 0.1 * abs(complex(system.stiffness[system.solved - system.band + 1])):
        system.swing = supremum(with_zero_mean(system.c))
    best = None
    for jumps in range(1, 30):
        inside = system.solved - jumps * system.band
        if inside + 1 <= system.ratio:
            break
        nearest = abs(complex(system.stiffness[inside + 1]))
        if nearest <= system.swing:
            break
        decay = (system.swing / nearest) ** (jumps - 1) * system.swing / (nearest - system.swing)
        if best is not None and decay >= best[2]:
            break
        best = inside, nearest, decay
    return best


def by_inverse(system: BandSystem, measure: Callable[[Complex], float]) -> InverseBound | None:
    """Gains from the inverse of the matrix of the core, computed and measured; None if too small.

    Parameters
    ----------
    system : BandSystem
        Factorised.
    measure : callable
        `norm`, or `crude_norm` at a fraction of the time.
    """
    solved, band = system.solved, system.band
    swing = system.swing = supremum(with_zero_mean(system.c))
    nearest = abs(complex(system.stiffness[solved + 1]))
    margin = nearest - swing
    if margin <= 0 or solved + 1 <= system.ratio:
        return None
    unit = np.eye(2 * solved + 1, dtype=complex)
    inverse, _ = system.solver(system.factors, band, band, unit, system.pivots, overwrite_b=1)
    if not np.isfinite(inverse).all():
        return None
    lines = np.abs(np.arange(-solved, solved + 1))
    at_edge = lines > solved - band
    moved = system.squares[lines][:, None] * inverse
    rounding = 1 - measure(inverse) * (swing + nearest) * len(lines) * UNIT_ROUNDOFF
    if rounding < 0.5:
        return None
    both = measure(inverse[np.ix_(at_edge, at_edge)]) / rounding
    loop = both * swing * swing / margin
    power, tail_squares = (
        2 * float(system.sizes @ system.sizes),
        tail_squares_above(system.ratio, solved),
    )
    stable = _stability(system, power, tail_squares, both)
    if stable is None or loop >= 1:
        return None
    to_edge = measure(inverse[at_edge]) / rounding / (1 - loop)
    from_edge = measure(moved[:, at_edge]) / rounding * swing / margin
    local = max(1.16, float(system.squares[solved + 1]) / nearest) * nearest / margin
    core = measure(moved) / rounding + (from_edge + local) * swing * to_edge
    outer = (from_edge + local) * (1 + loop / (1 - loop))
    return InverseBound(math.hypot(core, outer), outer, solved, stable)


def _stability(system: BandSystem, power: float, tail_squares: float, edge: float) -> bool | None:
    """Stability from the determinant, if it tells."""
    beyond = beyond_lines(system, edge, power, tail_squares)
    inner = system.stiffness[: system.solved + 1]
    log_determinant, sign = determinant(system)
    log_stiffness = float(np.log(inner.real**2 + inner.imag**2).sum())
    return (
        _is_stable(system, log_determinant - log_stiffness, sign, beyond)
        if beyond < MOST_BEYOND
        else None
    )


def determinant(system: BandSystem) -> tuple[float, float]:
    """ln|det| of the matrix of the lines solved, and the sign of det."""
    upper = system.factors[2 * system.band]
    absolute = np.abs(upper)
    turn = complex(np.multiply.reduce(upper / absolute)).real
    # each D_n meets its conjugate: their product is positive but for n = 0, where it is one
    swaps = int(np.count_nonzero(system.pivots != counting(len(upper))))
    return float(np.add.reduce(np.log(absolute))), -turn if swaps % 2 else turn


def beyond_lines(system: BandSystem, edge: float, power: float, tail_squares: float) -> float:
    """Bound of |ln| of what the lines above N multiply Q by.

    With X = (phi_OO - phi_OC A^-1 phi_CO)/D_O over the outer lines, |ln det(1 + X)| <=
    |tr X| + |X|_F^2/(2 (1 - |X|_F)); of A^-1 only the lines within J of the edge enter, and
    `edge` bounds its norm there.
    """
    outer = 1 / abs(complex(system.stiffness[system.solved + 1]))
    reaching = 2 * float(counting(system.band + 1)[1:] @ (system.sizes * system.sizes))
    trace = edge * reaching * outer
    size = math.sqrt(power * tail_squares) + edge * system.swing * math.sqrt(reaching) * outer
    return trace + size * size / (2 * (1 - size)) if size < 1 else math.inf


def _is_stable(system: BandSystem, log_ratio: float, sign: float, beyond: float) -> bool | None:
    period = 2 * math.pi * system.ratio
    root = cmath.sqrt(system.zeta * system.zeta - 1)
    constant = (1 - cmath.exp((root - system.zeta) * period)) * (
        1 - cmath.exp((-root - system.zeta) * period)
    )
    allowed = 2 * (1 + math.exp(-2 * system.zeta * period))
    q = constant.real * _exp(log_ratio)
    if sign < 0 or q > allowed * math.exp(beyond):
        return False
    return True if q < allowed * math.exp(-beyond) else None


def _size(half: Complex) -> float:
    """Rms of the function whose half spectrum this is, or up to 41 % more for its mean."""
    return math.sqrt(2 * np.vdot(half, half).real)


def norm(matrix: Complex) -> float:
    """Spectral norm."""
    return float(np.linalg.norm(matrix, 2))


def crude_norm(matrix: Complex) -> float:
    """Bound of the spectral norm that needs no singular values."""
    sizes = np.abs(matrix)
    return math.sqrt(float(sizes.sum(axis=0).max()) * float(sizes.sum(axis=1).max()))


def _exp(exponent: float) -> float:
    return math.exp(exponent) if exponent < 700 else math.inf


def tail_squares_above(ratio: float, solved: int) -> float:
    """Bound of the sum of 1/|D_n|^2 over |n| > solved; solved > ratio."""
    x = solved / ratio
    return ratio * (x / (x * x - 1) - 0.5 * math.log((x + 1) / (x - 1)))
