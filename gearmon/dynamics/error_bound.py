"""How large the error of an approximate vibration can be, from its residual.

Write the equation as L z = z'' + 2 zeta z' + (1 + phi) z = g in the dimensionless time s = w0 t,
the approximation y, its residual r = g - L y and its error e = z - y = L^{-1} r. All of r is
known. A number `gain` with ||(L^{-1} r)''|| <= gain ||r|| for every periodic r then bounds the
error of the acceleration. Three such numbers are computed here:

small gain
    L = (D + b) + (phi - b) with D diagonal over the harmonics and b midway between the extremes of
    phi. If max|phi - b| max 1/|D_n + b| < 1 the Neumann series of L^{-1} converges and gives the
    gain; the same with all real frequencies instead of the harmonics proves stability (circle
    criterion).
Floquet
    With the state x = (z, z' + q z) and the periodic change of variables x = P(s) y that makes the
    matrix constant, each component of y is a scalar equation whose gain is 1/|in/R - exponent|
    exactly. The gain of L^{-1} is at most cond(P) times the larger of the two. What the step
    matrices neglect is the small rest of `floquet`, and is added by a Neumann argument.

dense
    The matrix of the harmonics that |D_n| does not dominate is inverted outright, the others are
    added by a Neumann argument. Only for small problems of which the other two know too little:
    strong damping with a stiffness that turns negative.

Sizes are those of exact arithmetic; rounding enters through the residual, see `steady_state`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gearmon.dynamics import floquet
from gearmon.dynamics.fourier import Complex, middle_and_swing, supremum, with_zero_mean

MOST_DENSE = 300


@dataclass(frozen=True, kw_only=True)
class Gain:
    """A bound of the inverse operator.

    Attributes
    ----------
    acceleration : float
        ||(L^{-1} r)''|| <= acceleration ||r||, rms over the period, in units of w0^2 z. Infinite if
        none is known.
    source : str
        "small gain", "Floquet", "dense" or "none".
    stable : bool or None
        True if free vibrations die out, None if that was not settled here.
    """

    acceleration: float
    source: str
    stable: bool | None


def dynamic_stiffness(ratio: float, zeta: float, highest: int) -> Complex:
    """D_n = 1 - (n/R)^2 + 2 i zeta n/R for n = 0..highest, relative to the mean stiffness."""
    x = np.arange(highest + 1) / ratio
    return (1 - x**2) + 2j * zeta * x


def best_gain(ratio: float, zeta: float, harmonics: Complex) -> Gain:
    """Cheapest gain that is of use.

    Parameters
    ----------
    ratio : float
        R = w0/w > 0.
    zeta : float
        Damping ratio >= 0.
    harmonics : complex ndarray, shape (J,)
        c_1..c_J of phi.
    """
    cheap = small_gain(ratio, zeta, harmonics)
    if cheap is not None and cheap.stable:
        return cheap
    form = floquet_gain(ratio, zeta, harmonics)
    if form.stable is not False and form.acceleration > 1e4:
        dense = dense_gain(ratio, zeta, harmonics)
        if dense is not None and dense.acceleration < form.acceleration:
            return dense
    if form.stable is None:
        multiplier = abs(floquet.multipliers(ratio, zeta, harmonics)[0])
        return Gain(acceleration=math.inf, source="none", stable=multiplier < 1)
    return form


def small_gain(ratio: float, zeta: float, harmonics: Complex) -> Gain | None:
    """Gain by the Neumann series, or None where it does not converge.

    Examples
    --------
    >>> import numpy as np
    >>> small_gain(13.6, 0.3, np.array([0.08 + 0j])).stable
    True
    """
    middle, swing = middle_and_swing(harmonics) if len(harmonics) else (0.0, 0.0)
    if middle <= -1:
        return None
    # (1 + middle) times the operator of this stiffness and of the damping ratio that goes with it
    largest = peak(zeta / math.sqrt(1 + middle))
    stable = swing * largest < 1 + middle
    softest, response = _responses(ratio, zeta, middle)
    loop = swing * softest
    if loop >= 1:
        return None
    return Gain(
        acceleration=response / (1 - loop), source="small gain", stable=True if stable else None
    )


def _responses(ratio: float, zeta: float, middle: float) -> tuple[float, float]:
    """Largest 1/|D_n + middle|, and (n/R)^2/|D_n + middle| at most 13 % above, over harmonics."""
    highest = math.ceil(3 * ratio * math.sqrt(1 + middle)) + 2
    stiffness = np.abs(dynamic_stiffness(ratio, zeta, highest) + middle)
    squares = (np.arange(len(stiffness)) / ratio) ** 2
    # beyond three times resonance the first only falls, the second stays below 9/8
    with np.errstate(divide="ignore"):
        return float((1 / stiffness).max()), max(float((squares / stiffness).max()), 1.125)


def peak(zeta: float) -> float:
    """Largest 1/|D|, and largest x^2/|D|, over all real frequencies.

    Parameters
    ----------
    zeta : float
        Damping ratio >= 0; without damping the peak is infinite.
    """
    if zeta >= math.sqrt(0.5):
        return 1.0
    return 1 / (2 * zeta * math.sqrt(1 - zeta * zeta)) if zeta > 0 else math.inf


def floquet_gain(ratio: float, zeta: float, harmonics: Complex) -> Gain:
    """Gain from the Floquet form of the equation; its `acceleration` is infinite if unstable."""
    swing = supremum(with_zero_mean(harmonics))
    steepness = floquet.slope(ratio, harmonics)
    count = _first_count(ratio, zeta, len(harmonics), steepness)
    most = min(floquet.MOST_STEPS, 30 * count)
    while count <= most:
        form = floquet.floquet_form(ratio, zeta, harmonics, count)
        if form.margin <= 0:
            return Gain(acceleration=math.inf, source="none", stable=False)
        # P between the steps, from its values at the steps: logarithmic norm of the matrix
        within = form.length * (math.hypot(zeta + form.rest, swing / 2 + zeta * form.rest) + zeta)
        state = form.state_gain * math.exp(2 * within)
        loop = state * _rest_norm(form.rest, zeta)
        if loop < 0.5:
            force = math.hypot(1 + swing + 2 * zeta * form.rest, 2 * zeta)
            acceleration = 1 + force * state / (1 - loop)
            return Gain(acceleration=float(acceleration), source="Floquet", stable=True)
        count = math.ceil(count * min(8.0, 1.1 * math.sqrt(loop / 0.4)))
    return Gain(acceleration=math.inf, source="none", stable=None)


def _first_count(ratio: float, zeta: float, highest: int, steepness: float) -> int:
    """Count steps short enough for the rest to be small beside a resonance at this damping."""
    period = 2 * math.pi * ratio
    for_rest = math.sqrt(steepness * (1 + zeta) / max(zeta, 1e-6))
    return math.ceil(max(16, 2 * highest + 2, period * max(3 * (1 + zeta), for_rest)))


def _rest_norm(rest: float, zeta: float) -> float:
    """Norm of what the step matrices leave out; q less its mean is at most twice `rest`."""
    return 2 * rest * (1 + 2 * zeta) + rest**2


def dense_gain(ratio: float, zeta: float, harmonics: Complex) -> Gain | None:
    """Gain from the inverse of the matrix of harmonics -M..M, or None if it is large or fails."""
    swing = supremum(with_zero_mean(harmonics))
    highest = math.ceil(ratio * math.sqrt(1 + 2 * swing)) + len(harmonics) + 1
    while highest <= MOST_DENSE:
        inverse, edge = _inverse_norms(ratio, zeta, harmonics, highest)
        outer = 1 / abs(complex(dynamic_stiffness(ratio, zeta, highest + 1)[-1]))
        chain = outer / (1 - outer * swing) if outer * swing < 1 else math.inf
        loop = edge * swing**2 * chain
        if loop < 0.5:
            inside = (inverse + edge * swing * chain) / (1 - loop)
            whole = inside + chain * (1 + swing * inside)
            acceleration = _responses(ratio, zeta, 0.0)[1] * (1 + swing * whole)
            multiplier = abs(floquet.multipliers(ratio, zeta, harmonics)[0])
            return Gain(acceleration=acceleration, source="dense", stable=multiplier < 1)
        highest = math.ceil(1.5 * highest)
    return None


def _inverse_norms(
    ratio: float, zeta: float, harmonics: Complex, highest: int
) -> tuple[float, float]:
    """Norms of the inverse and of its columns that the harmonics left out can reach."""
    half = dynamic_stiffness(ratio, zeta, highest)
    size = 2 * highest + 1
    row = np.zeros(2 * size - 1, dtype=complex)
    c = harmonics[: size - 1]
    row[size : size + len(c)] = c
    row[size - 1 - len(c) : size - 1] = c[::-1].conj()
    matrix = np.lib.stride_tricks.sliding_window_view(row, size)[:, ::-1].copy()
    matrix[np.diag_indices(size)] += np.concatenate([half[:0:-1].conj(), half])
    inverse = np.linalg.inv(matrix)
    reached = np.abs(np.arange(-highest, highest + 1)) > highest - len(harmonics)
    # norms that bound the spectral one without a singular value decomposition
    sizes = np.abs(inverse)
    whole = math.sqrt(float(sizes.sum(axis=0).max()) * float(sizes.sum(axis=1).max()))
    return whole, float(np.linalg.norm(inverse[:, reached]))
