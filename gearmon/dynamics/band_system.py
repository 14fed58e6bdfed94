"""The equations of harmonic balance as a factorised band matrix, and the lines beyond it.

Lines -N..N are solved together by LAPACK's band factors; the lines above N are answered by
r_n/D_n, the core once more by the factors, and so on: every sweep divides the residual by about
|D_N|/max|phi|. All is kept in units of the largest static deflection.
"""

from __future__ import annotations

import math
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from gearmon.dynamics.fourier import Complex, Real

if TYPE_CHECKING:
    from gearmon.dynamics.hill import HillProblem

MOST_LINES = 4000
NEAR_ONE = 0.9
FEW_HARMONICS = 14
SPARE = 1e-3
SPARE_WEAK = 1e-5


@lru_cache(maxsize=128)
def counting(count: int) -> Real:
    """0, 1, ..., count - 1 as floats, read-only."""
    numbers = np.arange(count, dtype=float)
    numbers.flags.writeable = False
    return numbers


@lru_cache(maxsize=128)
def two_sided(highest: int) -> Real:
    """-highest, ..., highest as floats, read-only."""
    numbers = np.arange(-highest, highest + 1, dtype=float)
    numbers.flags.writeable = False
    return numbers


def peak(zeta: float) -> float:
    """Largest 1/|D|, and largest x^2/|D|, over all real frequencies; zeta > 0."""
    inner = min(zeta, math.sqrt(0.5))
    return 1 / (2 * inner * math.sqrt(1 - inner * inner))


@cache
def _lapack() -> tuple[Any, Any]:
    """Band solver and the one that uses its factors; SciPy takes 0.2 s to import, once."""
    from scipy.linalg.lapack import zgbsv, zgbtrs

    return zgbsv, zgbtrs


class BandSystem:
    """The equations of one problem in the units of its largest static deflection.

    Call `factorise`, then `begin`, then `sweep` as often as the residual asks for.

    Parameters
    ----------
    problem : HillProblem
        With damping and at least one stiffness harmonic.
    """

    def __init__(self, problem: HillProblem) -> None:
        self.c = problem.stiffness_harmonics
        self.band = len(self.c)
        self.ratio = problem.frequency_ratio
        self.zeta = problem.damping_ratio
        self.sizes = np.abs(self.c)
        self.sum = float(np.add.reduce(self.sizes))
        self.forces = problem.force_harmonics_n
        force = abs(problem.force_n)
        if len(self.forces):
            force = max(force, float(np.abs(self.forces).max()))
        self.scale = force
        self.unit = force / problem.stiffness_n_per_m
        self.mean = problem.force_n / force if force else 0.0
        self.swing = 2 * self.sum
        #: max 1/|D| over all frequencies, and times max|phi|
        self.peak = peak(self.zeta)
        self.loop = self.swing * self.peak
        self.pressed = False
        #: z without the mean deflection under the mean force, harmonics 0.. in units of `unit`
        self.swinging: Complex = np.zeros(1, dtype=complex)

    def nearest(self, line: int) -> float:
        """|D_n|; above resonance, the least of all from there on."""
        x = line / self.ratio
        return math.hypot(1 - x * x, 2 * self.zeta * x)

    def enough_lines(self, tolerance: float) -> int:
        """Guess the lines to solve together; those above are cheap to add.

        A line above resonance is reached by jumps of about the mean bandwidth of phi, each of
        which costs sum|c|/|D_n|.
        """
        total, band, ratio = self.sum, self.band, self.ratio
        top = max(band, math.ceil(1.2 * ratio) + 1, len(self.forces), 2)
        if not total:
            return top
        jump = max(1, round(float(counting(band + 1)[1:].dot(self.sizes)) / total))
        weak = self.loop >= NEAR_ONE
        wanted = (SPARE_WEAK if weak else SPARE) * tolerance
        reached, share, step = 1.2, 1.0, jump / ratio
        most = MOST_LINES / ratio
        while share > wanted and reached < most:
            reached += step
            each = total / (reached * reached - 1)
            share *= each if each < 0.8 else 0.8
        if weak:
            # the bound of what lies beyond wants edges clear of the resonance
            top = max(top, math.ceil(1.4 * ratio) + band)
        if band <= FEW_HARMONICS:
            # another jump takes less time than to answer the lines above
            reached += step
        return max(top, math.ceil(reached * ratio))

    def factorise(self, solved: int) -> bool:
        """Factorise the band matrix of lines -solved..solved; False if it is singular.

        The forces are answered on the way, the constant one standing on the mean stiffness.
        """
        band = self.band
        self.solved = solved
        x = two_sided(solved) * (1 / self.ratio)
        squares = x * x
        matrix = np.empty((2 * solved + 1, 3 * band + 1), dtype=complex)
        kernel = self.kernel = np.zeros(2 * band + 1, dtype=complex)
        kernel[band + 1 :] = self.c
        np.conjugate(self.c[::-1], out=kernel[:band])
        # LAPACK fills the first J rows of its storage itself
        matrix[:, band:] = kernel
        diagonal = matrix[:, 2 * band]
        np.subtract(1.0, squares, out=diagonal.real)
        np.multiply(x, 2 * self.zeta, out=diagonal.imag)
        self.squares = squares[solved:]
        self.diagonal = diagonal.copy()
        self.stiffness = self.diagonal[solved:]
        forcing = self._forcing()
        # LAPACK reads the rows of this array as the columns of its band storage
        self.factors, self.pivots, self.core, failed = _lapack()[0](
            band, band, matrix.T, forcing, overwrite_ab=1, overwrite_b=1
        )
        return bool(failed == 0)

    def _forcing(self) -> Complex:
        """Return the forces on lines -solved..solved, less phi times the mean force."""
        solved, band = self.solved, self.band
        forcing = np.zeros(2 * solved + 1, dtype=complex)
        np.multiply(self.kernel, -self.mean, out=forcing[solved - band : solved + band + 1])
        count = len(self.forces)
        if count:
            forcing[solved + 1 : solved + count + 1] += self.forces / self.scale
            forcing[solved - count : solved] += self.forces[::-1].conj() / self.scale
        #: right side of lines 0..solved
        self.forcing: Complex = forcing[solved:].copy()
        return forcing

    def solve_core(self, right_side: Complex) -> Complex:
        """Answer of the lines solved together to right sides of theirs, overwritten."""
        band = self.band
        answer: Complex = _lapack()[1](
            self.factors, band, band, right_side, self.pivots, overwrite_b=1
        )[0]
        return answer

    def begin(self) -> None:
        """Take the answer of the core, and what it makes of many lines above it."""
        # sweeps before may have gone farther
        if len(self.stiffness) > self.solved + 1:
            self._stiffness(self.solved + 1)
        padded = self.core[self.solved - self.band :]
        self._take(padded if self.band <= FEW_HARMONICS else self._with_lines_above(padded))

    def _with_lines_above(self, padded: Complex) -> Complex:
        """Append lines N+1..N+J, each answering the core alone."""
        solved, band = self.solved, self.band
        self._stiffness(solved + band + 1)
        coupled = np.correlate(padded[-band:], self.kernel, "full")[-band:]
        coupled /= self.stiffness[solved + 1 :]
        return np.concatenate([padded, np.negative(coupled, out=coupled)])

    def sweep(self) -> None:
        """Correct the core and the lines above it by what the residual asks for.

        The lines above are answered one by one, after what the core's correction does to them.
        """
        solved, band = self.solved, self.band
        residual = np.negative(self.excess)
        inner = residual[: solved + 1]
        core = self.solve_core(np.concatenate([inner[:0:-1].conj(), inner]))
        reach = len(residual)
        self._stiffness(reach)
        padded = np.zeros(reach + band, dtype=complex)
        swinging = padded[band:]
        swinging[: solved + 1] = core[solved:]
        outer = swinging[solved + 1 :]
        outer += residual[solved + 1 :]
        outer[:band] -= np.correlate(core[2 * solved + 1 - band :], self.kernel, "full")[-band:]
        outer /= self.stiffness[solved + 1 :]
        swinging[: len(self.swinging)] += self.swinging
        self._take(padded)

    def _stiffness(self, count: int) -> None:
        """Provide D_n and (n/R)^2 of lines 0..count - 1."""
        x = counting(count) * (1 / self.ratio)
        self.squares = x * x
        stiffness = np.empty(count, dtype=complex)
        np.subtract(1.0, self.squares, out=stiffness.real)
        np.multiply(x, 2 * self.zeta, out=stiffness.imag)
        self.stiffness = stiffness

    def _take(self, padded: Complex) -> None:
        """Take lines -J..-1, to be set, and 0.., and compute what they leave of the equations.

        phi times the mean force needs no product and its rounding.
        """
        band = self.band
        swinging = padded[band:]
        # rounding of the unsymmetric factors must not feed on itself
        swinging[0] = swinging[0].real
        np.conjugate(swinging[band:0:-1], out=padded[:band])
        self.swinging = swinging
        # phi_{n-m} is the conjugate of phi_{m-n}: the product is a correlation
        excess = np.correlate(padded, self.kernel, "full")[2 * band :]
        excess[: len(swinging)] += self.stiffness * swinging
        excess[: len(self.forcing)] -= self.forcing
        self.excess = excess

    def vibration(self, shown: int | None) -> tuple[Complex, int]:
        """Displacement [m] as handed out, and its highest harmonic that was computed."""
        whole: Complex = self.swinging * self.unit
        whole[0] += self.unit * self.mean
        last = len(whole) - 1
        if shown is None:
            return whole, last
        if shown > last:
            whole = np.concatenate([whole, np.zeros(shown - last, dtype=complex)])
        return whole[: shown + 1], min(shown, last)
