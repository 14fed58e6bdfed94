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

from gearmon.dynamics.error_bound import peak
from gearmon.dynamics.fourier import Complex, Real

if TYPE_CHECKING:
    from gearmon.dynamics.hill import HillProblem

MOST_LINES = 4000
NEAR_ONE = 0.9
SPARE = 1e-3
SPARE_WEAK = 1e-5


@lru_cache(maxsize=128)
def counting(count: int) -> Real:
    """0, 1, ..., count - 1 as floats, read-only."""
    numbers = np.arange(count, dtype=float)
    numbers.flags.writeable = False
    return numbers


@cache
def _lapack() -> tuple[Any, Any]:
    """Band factorisation and its solver; SciPy takes 0.2 s to import, once."""
    from scipy.linalg.lapack import zgbtrf, zgbtrs

    return zgbtrf, zgbtrs


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
        #: max|phi| max 1/|D| over all frequencies
        self.loop = self.swing * peak(self.zeta)
        self.pressed = False
        #: z without the mean deflection under the mean force, harmonics 0.. in units of `unit`
        self.swinging: Complex = np.zeros(1, dtype=complex)
        self.factor, self.solver = _lapack()

    def enough_lines(self, tolerance: float) -> int:
        """Guess the lines to solve together; those above are cheap to add.

        A line above resonance is reached by jumps of about the mean bandwidth of phi, each of
        which costs sum|c|/|D_n|.
        """
        total, band = self.sum, self.band
        top = max(band, math.ceil(1.2 * self.ratio) + 1, len(self.forces), 2)
        if not total:
            return top
        jump = max(1, round(float(np.dot(counting(band + 1)[1:], self.sizes)) / total))
        weak = self.loop >= NEAR_ONE
        wanted = (SPARE_WEAK if weak else SPARE) * tolerance
        reached, share = 1.2 * self.ratio, 1.0
        while share > wanted and reached < MOST_LINES:
            reached += jump
            share *= min(0.8, total / abs((reached / self.ratio) ** 2 - 1))
        if weak:
            # the bound of what lies beyond wants edges clear of the resonance
            top = max(top, math.ceil(1.4 * self.ratio) + band)
        return max(top, math.ceil(reached))

    def factorise(self, solved: int) -> bool:
        """Factorise the band matrix of lines -solved..solved; False if it is singular."""
        band = self.band
        self.solved = solved
        self._stiffness(solved + 2 * band + 1)
        column = np.zeros(3 * band + 1, dtype=complex)
        column[2 * band + 1 :] = self.c
        column[band : 2 * band] = self.c[::-1].conj()
        self.kernel = column[band:]
        matrix = np.empty((2 * solved + 1, 3 * band + 1), dtype=complex)
        matrix[:] = column
        diagonal = matrix[:, 2 * band]
        diagonal[solved:] = self.stiffness[: solved + 1]
        diagonal[:solved] = self.stiffness[solved:0:-1].conj()
        # LAPACK reads the rows of this array as the columns of its band storage
        self.factors, self.pivots, failed = self.factor(matrix.T, band, band, overwrite_ab=1)
        return bool(failed == 0)

    def _stiffness(self, count: int) -> None:
        x = counting(count) * (1 / self.ratio)
        self.squares = x * x
        stiffness = np.empty(count, dtype=complex)
        np.subtract(1.0, self.squares, out=stiffness.real)
        np.multiply(x, 2 * self.zeta, out=stiffness.imag)
        self.stiffness = stiffness

    def begin(self) -> None:
        """Solve for the core, the constant force standing on the mean stiffness."""
        solved, band = self.solved, self.band
        right_side = np.zeros(2 * solved + 1, dtype=complex)
        right_side[solved - band : solved + band + 1] = self.kernel * -self.mean
        if len(self.forces):
            count = len(self.forces)
            right_side[solved + 1 : solved + count + 1] += self.forces / self.scale
            right_side[solved - count : solved] += self.forces[::-1].conj() / self.scale
        self._extend(right_side, None)

    def sweep(self) -> None:
        """Correct the core and the lines above it by what the residual asks for."""
        solved = self.solved
        inner = self.residual[: solved + 1]
        right_side = np.concatenate([inner[:0:-1].conj(), inner])
        self._extend(right_side, self.residual[solved + 1 :])

    def _extend(self, right_side: Complex, above: Complex | None) -> None:
        """Solve for the core and answer the lines above it one by one; then the residual."""
        solved, band = self.solved, self.band
        inner, _ = self.solver(self.factors, band, band, right_side, self.pivots, overwrite_b=1)
        reach = solved + band + 1 if above is None else solved + len(above) + 1
        if reach + band > len(self.stiffness):
            self._stiffness(reach + 2 * band)
        # lines -J..-1 and 2J zeros stand about the lines 0..reach-1, for the product with phi
        padded = np.zeros(reach + 3 * band, dtype=complex)
        swinging = padded[band : band + reach]
        swinging[: solved + 1] = inner[solved:]
        # rounding of the unsymmetric factors must not feed on itself
        swinging[0] = inner[solved].real
        edge = padded[solved + 1 : solved + 1 + 3 * band]
        outer = swinging[solved + 1 :]
        coupled = np.correlate(edge, self.kernel, "valid")[:band]
        if above is None:
            np.negative(coupled, out=outer)
            outer /= self.stiffness[solved + 1 : reach]
        else:
            outer[:] = above
            outer[:band] -= coupled
            outer /= self.stiffness[solved + 1 : reach]
            swinging[: len(self.swinging)] += self.swinging
        np.conjugate(swinging[band:0:-1], out=padded[:band])
        self.swinging = swinging
        self._residual(padded)

    def _residual(self, padded: Complex) -> None:
        """Residual of all lines; phi times the mean force needs no product and its rounding."""
        swinging = self.swinging
        # phi_{n-m} is the conjugate of phi_{m-n}: the product is a correlation
        product = np.correlate(padded, self.kernel, "valid")
        product[: len(swinging)] += self.stiffness[: len(swinging)] * swinging
        product[1 : self.band + 1] += self.mean * self.c
        if len(self.forces):
            product[1 : len(self.forces) + 1] -= self.forces / self.scale
        self.residual = np.negative(product, out=product)

    def vibration(self, shown: int | None) -> tuple[Complex, int]:
        """Displacement [m] as handed out, and its highest harmonic that was computed."""
        whole: Complex = self.unit * self.swinging
        whole[0] += self.unit * self.mean
        last = len(whole) - 1
        if shown is None:
            return whole, last
        if shown > last:
            whole = np.concatenate([whole, np.zeros(shown - last, dtype=complex)])
        return whole[: shown + 1], min(shown, last)
