"""Orders of many expansions at once that share one pattern of stiffness.

The equations of a set with the frequency ratio R, damping ratio zeta and scale s of the variation,
for the deflection y = k0 z/F - 1 over the static one, are

    D_n y_n + s sum_m phi_{n-m} y_m = -s c_n,      D_n = 1 - (n/R)^2 + 2 i zeta n/R

and only D and s differ from set to set: one product of matrices multiplies all sets by phi. Where
D is small beside phi the plain series fails. There the harmonics a..b about the natural frequency
are solved together by their amplitude equations, in which the others ("far") stand to second order,

    (D + s phi - s^2 phi D_far^{-1} phi)_{near, near} y_near = right side,

and the rest is eliminated order by order: each order solves what the one before left undone among
the far harmonics. Harmonics that couple through n + m (near 2 R = j, parametric resonance) are in
the same block, since real and imaginary parts are unknowns of their own.

Arrays hold a half spectrum as rows Re y_0..Re y_N, Im y_0..Im y_N, one column for each set.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.fourier import Complex, Real

MOST_ORDERS = 60
# the mean square that an order must leave of the one before, or the series is given up
SLOWEST = 0.5
FEWEST_ORDERS = 3
MOST_ROUNDS = 6
# mean square that a single-precision sum leaves of its right side, with room for its rounding
SINGLE = 1e-10

INDICES = npt.NDArray[np.int_]
Single = npt.NDArray[np.float32]


def stacked(half: Complex) -> Real:
    """Half spectra on the first axis as real rows: real parts, then imaginary parts."""
    return np.concatenate([half.real, half.imag])


def product_matrix(harmonics: Complex, inputs: int, outputs: int) -> Real:
    """Matrix of y -> phi y on half spectra, shape (..., 2 outputs + 2, 2 inputs + 2).

    Parameters
    ----------
    harmonics : complex ndarray, shape (..., J)
        c_1..c_J; any leading axes are sets of their own.
    inputs, outputs : int
        Highest harmonic of y and of the product.
    """
    kept = min(harmonics.shape[-1], inputs + outputs)
    # phi_k for k = -inputs..outputs+inputs, read through sliding windows
    line = np.zeros((*harmonics.shape[:-1], 2 * inputs + outputs + 1), dtype=complex)
    below = min(kept, inputs)
    line[..., inputs - below : inputs] = harmonics[..., :below][..., ::-1].conj()
    line[..., inputs + 1 : inputs + 1 + kept] = harmonics[..., :kept]
    windows = np.lib.stride_tricks.sliding_window_view(line, inputs + 1, axis=-1)
    difference = windows[..., : outputs + 1, ::-1]
    total = windows[..., inputs : inputs + outputs + 1, :]
    matrix = np.empty((*harmonics.shape[:-1], 2 * outputs + 2, 2 * inputs + 2))
    upper, lower = matrix[..., : outputs + 1, :], matrix[..., outputs + 1 :, :]
    np.add(difference.real, total.real, out=upper[..., : inputs + 1])
    np.subtract(total.imag, difference.imag, out=upper[..., inputs + 1 :])
    np.add(difference.imag, total.imag, out=lower[..., : inputs + 1])
    np.subtract(difference.real, total.real, out=lower[..., inputs + 1 :])
    # the mean has no conjugate
    upper[..., 0] = difference.real[..., 0]
    lower[..., 0] = difference.imag[..., 0]
    upper[..., inputs + 1] = 0.0
    lower[..., inputs + 1] = 0.0
    return matrix


@dataclass(frozen=True, kw_only=True)
class Window:
    """The product by phi split at near harmonics a..b, and what their equations are made of.

    Rows are ordered: real and imaginary parts of the far harmonics, then of the near ones.

    Attributes
    ----------
    near, far : int ndarray
        Harmonics solved together, and the others of 0..N.
    rows : int ndarray
        Where the reordered rows stand in a column.
    far_all, near_far, near_near : float ndarray
        Blocks of the product matrix, the first with its sign changed.
    second : float ndarray, shape (4 s^2, 2 F)
        Makes phi_{near, far} H phi_{far, near} of the rows Re H, Im H.
    """

    near: INDICES
    far: INDICES
    rows: INDICES
    far_all: Single
    near_far: Single
    near_near: Real
    second: Real


class SharedCoupling:
    """Products by one phi, for harmonics 0..N; its parts are made once and kept.

    Parameters
    ----------
    harmonics : complex ndarray, shape (J,)
        c_1..c_J.
    highest : int
        N.
    """

    def __init__(self, harmonics: Complex, highest: int) -> None:
        self.highest = highest
        self.reach = highest + len(harmonics)
        self.outward = product_matrix(harmonics, highest, self.reach)
        line = np.zeros(self.reach + 1, dtype=complex)
        line[1 : len(harmonics) + 1] = harmonics
        self.forcing = stacked(line)
        within = np.arange(highest + 1)
        rows = np.concatenate([within, self.reach + 1 + within])
        self.inward = self.outward[rows]
        self.inward_forcing = self.forcing[rows]
        self._windows: dict[tuple[int, int], Window] = {}

    def window(self, first: int, last: int) -> Window:
        """Split at near harmonics first..last; none if last < first."""
        if (first, last) not in self._windows:
            self._windows[first, last] = self._split(first, last)
        return self._windows[first, last]

    def _split(self, first: int, last: int) -> Window:
        every = np.arange(self.highest + 1)
        is_near = (every >= first) & (every <= last)
        near, far = every[is_near], every[~is_near]
        near_rows = np.concatenate([near, self.highest + 1 + near])
        far_rows = np.concatenate([far, self.highest + 1 + far])
        rows, count = np.concatenate([far_rows, near_rows]), len(far)
        near_far = np.ascontiguousarray(self.inward[np.ix_(near_rows, far_rows)])
        far_near = self.inward[np.ix_(far_rows, near_rows)].T
        left_re, left_im = near_far[:, None, :count], near_far[:, None, count:]
        right_re, right_im = far_near[:, :count], far_near[:, count:]
        second = np.concatenate(
            [left_re * right_re + left_im * right_im, left_im * right_re - left_re * right_im],
            axis=2,
        )
        return Window(
            near=near,
            far=far,
            rows=rows,
            far_all=-self.inward[np.ix_(far_rows, rows)].astype(np.float32),
            near_far=near_far.astype(np.float32),
            near_near=self.inward[np.ix_(near_rows, near_rows)],
            second=second.reshape(-1, 2 * count),
        )


class ManyOrders:
    """Orders of the sets of one group, near harmonics solved together.

    Orders are summed in single precision, as a correction to a residual known in double precision;
    a few rounds of that reach any accuracy that double precision has.

    Parameters
    ----------
    coupling : SharedCoupling
        Product by phi.
    window : Window
        Near and far harmonics.
    ratio, zeta, scale : float ndarray, shape (B,)
        R, damping ratio, and s > 0.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the equations of the near harmonics of a set are singular to working precision.
    """

    def __init__(
        self, coupling: SharedCoupling, window: Window, ratio: Real, zeta: Real, scale: Real
    ) -> None:
        self.coupling, self.window, self.scale = coupling, window, scale
        self.count = len(window.far)
        x = np.arange(coupling.highest + 1)[:, None] / ratio
        self.real = (1 - x * x) / scale
        self.imaginary = 2 * zeta * x / scale
        share = 1 / (self.real * self.real + self.imaginary * self.imaginary)
        keep = window.far if len(window.near) else slice(None)
        inverse = np.concatenate([(self.real * share)[keep], (-self.imaginary * share)[keep]])
        self.answer: Single = inverse.astype(np.float32)
        self.spare: Single = np.empty((self.count, len(ratio)), dtype=np.float32)
        if len(window.near):
            self.through_far, self.near_inverse = self._near_equations(inverse)

    def _near_equations(self, inverse: Real) -> tuple[Single, Single]:
        """Make s phi D_far^{-1} phi between near harmonics, and invert their equations over s.

        Both have the shape (2 s, 2 s, B).
        """
        near, size = self.window.near, len(self.window.near)
        through_far = (self.window.second @ inverse).reshape(2 * size, 2 * size, -1)
        matrix = self.window.near_near[:, :, None] - through_far
        row = np.arange(size)
        matrix[row, row] += self.real[near]
        matrix[size + row, size + row] += self.real[near]
        matrix[row, size + row] -= self.imaginary[near]
        matrix[size + row, row] += self.imaginary[near]
        near_inverse = np.linalg.inv(np.ascontiguousarray(matrix.transpose(2, 0, 1)))
        return (
            through_far.astype(np.float32),
            np.ascontiguousarray(near_inverse.transpose(1, 2, 0), dtype=np.float32),
        )

    def solve(self, allowed: Real, stragglers: float) -> Real:
        """Add orders until the rms residual of the sets is <= `allowed`, shape (B,), or they stall.

        A share of `stragglers` may be left above it.

        Returns
        -------
        float ndarray, shape (2 N + 2, B)
            Rows of y.
        """
        limits = (allowed / self.scale) ** 2 / 2
        batch = len(self.scale)
        residual = np.broadcast_to(
            -self.coupling.inward_forcing[:, None], (2 * self.coupling.highest + 2, batch)
        )
        y = np.zeros(residual.shape)
        for _ in range(MOST_ROUNDS):
            reachable = SINGLE * np.einsum("nb,nb->b", residual, residual)
            y += self._sum_up(residual, np.maximum(limits, reachable), stragglers)
            if np.count_nonzero(reachable > limits) <= stragglers * batch:
                break
            residual = self._residual(y)
        return y

    def _residual(self, y: Real) -> Real:
        half = self.coupling.highest + 1
        left: Real = self.coupling.inward @ y
        left += self.coupling.inward_forcing[:, None]
        left[:half] += self.real * y[:half]
        left[:half] -= self.imaginary * y[half:]
        left[half:] += self.imaginary * y[:half]
        left[half:] += self.real * y[half:]
        np.negative(left, out=left)
        return left

    def _sum_up(self, right_side: Real, limits: Real, stragglers: float) -> Single:
        """Orders of the answer to a right side over s, as rows; limits of half the mean square."""
        window, far = self.window, 2 * self.count
        batch = len(self.scale)
        undone = right_side[window.rows[:far]].astype(np.float32)
        near_undone = right_side[window.rows[far:]].astype(np.float32)
        step: Single = np.empty((len(window.rows), batch), dtype=np.float32)
        total = np.zeros_like(step)
        before = np.full(batch, np.inf)
        for order in range(1, MOST_ORDERS + 1):
            self._divide(undone, step[:far])
            if len(window.near):
                right = near_undone - window.near_far @ step[:far]
                near_step = np.einsum("pqb,qb->pb", self.near_inverse, right, out=step[far:])
                near_undone = -np.einsum("pqb,qb->pb", self.through_far, near_step)
            total += step
            np.matmul(window.far_all, step, out=undone)
            if order < FEWEST_ORDERS:
                continue
            left = np.einsum("nb,nb->b", undone, undone)
            # what is not a number compares false: settled here, and refused by its bound
            worth_more = (left > limits) & (left < SLOWEST * before)
            if np.count_nonzero(worth_more) <= stragglers * batch:
                break
            before = left
        if not len(window.near):
            return total
        y = np.empty_like(total)
        y[window.rows] = total
        return y

    def _divide(self, rows: Single, out: Single) -> None:
        """Far rows times s/D."""
        half = self.count
        real, imaginary = self.answer[:half], self.answer[half:]
        np.multiply(rows[:half], real, out=out[:half])
        np.multiply(rows[half:], imaginary, out=self.spare)
        out[:half] -= self.spare
        np.multiply(rows[:half], imaginary, out=out[half:])
        np.multiply(rows[half:], real, out=self.spare)
        out[half:] += self.spare
