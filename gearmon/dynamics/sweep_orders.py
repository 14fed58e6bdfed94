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

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.fourier import Complex, Modulation, Real
from gearmon.dynamics.mesh_equations import MeshEquations

MOST_ORDERS = 60
# the mean square that an order must leave of the one before, or the series is given up
SLOWEST = 0.5
FEWEST_ORDERS = 3
MOST_ROUNDS = 6
MOST_TOGETHER, FEWEST_TOGETHER = 512, 48
MOST_NEAR = 10
MOST_HARMONICS = 256
# share of a group that may go into a second attempt
STRAGGLERS = 0.04
# |D_n| below this many times max|phi| makes a harmonic near
NEARNESS = 2.0
# mean square that a single-precision sum leaves of its right side, with room for its rounding
SINGLE = 1e-10

INDICES = npt.NDArray[np.int_]
Single = npt.NDArray[np.float32]


def stacked(half: Complex) -> Real:
    """Half spectra on the first axis as real rows: real parts, then imaginary parts."""
    return np.concatenate([half.real, half.imag])


def product_matrix(harmonics: Complex, highest: int) -> Real:
    """Matrix of y -> phi y on such rows, harmonics 0..highest, shape (2 highest + 2,) twice."""
    count = highest + 1
    unit = np.concatenate([np.eye(count), 1j * np.eye(count)])
    matrix = stacked(Modulation(harmonics, highest, highest)(unit).T)
    # no product exceeds the sum of two coefficients: what is smaller by far is rounding
    return np.where(np.abs(matrix) > 1e-14 * np.abs(matrix).max(initial=0.0), matrix, 0.0)


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


class Coupling:
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
        self.inward = product_matrix(harmonics, highest)
        line = np.zeros(highest + 1, dtype=complex)
        line[1 : len(harmonics) + 1] = harmonics[:highest]
        self.inward_forcing = stacked(line)
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
    coupling : Coupling
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
        self, coupling: Coupling, window: Window, ratio: Real, zeta: Real, scale: Real
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


def windows(sets: MeshEquations) -> tuple[INDICES, INDICES]:
    """First and last harmonic with |D_n| < NEARNESS max|phi| of every set; last < first if none."""
    ratio, zeta = sets.pairs.ratio[:, 0], sets.pairs.zeta[:, 0]
    bend = 1 - 2 * zeta**2
    spread = bend**2 - 1 + (NEARNESS * sets.swing) ** 2
    root = np.sqrt(np.maximum(spread, 0.0))
    first = np.ceil(ratio * np.sqrt(np.maximum(bend - root, 0.0)))
    last = np.floor(ratio * np.sqrt(np.maximum(bend + root, 0.0)))
    none = (spread <= 0) | (bend + root <= 0) | (last < first)
    return np.where(none, 0, first).astype(int), np.where(none, -1, last).astype(int)


def groups(
    chosen: INDICES, first: INDICES, last: INDICES, alike: Real
) -> Iterator[tuple[INDICES, tuple[int, int]]]:
    """Yield sets that are expanded together, and their near harmonics.

    Few sets with their own near harmonics join the next group if that widens it by little.
    """
    ordered = chosen[np.lexsort((alike[chosen], last[chosen], first[chosen]))]
    if not len(ordered):
        return
    keys = np.stack([first[ordered], last[ordered]])
    starts = np.flatnonzero((np.diff(keys) != 0).any(axis=0)) + 1
    runs = np.split(ordered, starts)
    waiting: list[INDICES] = []
    low, high, widest, number = 0, -1, 0, 0

    def flush() -> Iterator[tuple[INDICES, tuple[int, int]]]:
        whole = np.concatenate(waiting)
        for start in range(0, len(whole), MOST_TOGETHER):
            yield whole[start : start + MOST_TOGETHER], (low, high)

    for run in runs:
        a, b = int(first[run[0]]), int(last[run[0]])
        if waiting:
            joined = max(high, b) - min(low, a) + 1
            small = min(number, len(run)) < FEWEST_TOGETHER
            if small and low <= high and joined <= max(widest, b - a + 1) + 3:
                waiting.append(run)
                low, high, number = min(low, a), max(high, b), number + len(run)
                widest = max(widest, b - a + 1)
                continue
            yield from flush()
        waiting, low, high, widest, number = [run], a, b, b - a + 1, len(run)
    yield from flush()


class SharedOrders:
    """Expansions of sets that share phi; products are made once and kept.

    Parameters
    ----------
    equations : MeshEquations
        Of all the sets.
    tolerance : float
        Relative error of the acceleration to be met.
    """

    def __init__(self, equations: MeshEquations, tolerance: float) -> None:
        self.equations, self.tolerance = equations, tolerance
        self.gain = np.asarray(equations.gain.acceleration)
        pairs = equations.pairs
        self.numbers = pairs.ratio[:, 0], pairs.zeta[:, 0], equations.scale[:, 0]
        self._couplings: dict[int, Coupling] = {}

    def coupling(self, highest: int) -> Coupling:
        """Products for harmonics 0..highest."""
        if highest not in self._couplings:
            harmonics = self.equations.pattern.harmonics
            self._couplings[highest] = Coupling(harmonics, highest)
        return self._couplings[highest]

    def attempt(
        self, left: INDICES, sharper: float, stragglers: float
    ) -> Iterator[tuple[INDICES, Complex, bool]]:
        """Yield groups of sets, their half spectra less the mean, and whether lines were near."""
        ratio, zeta, _ = self.numbers
        first, last = windows(self.equations)
        # sets that converge alike stand together
        alike = np.where(last < first, 1e3 * np.ceil(2 * np.log2(zeta)) + ratio, self.gain)
        few = left[last[left] - first[left] < MOST_NEAR]
        chosen = list(groups(few, first, last, alike))
        needed = self._needed([group for group, _ in chosen], sharper * self.tolerance)
        for (group, window), highest in zip(chosen, needed, strict=True):
            if highest <= MOST_HARMONICS:
                y = self._expand(group, window, highest, sharper * self.tolerance, stragglers)
                if y is not None:
                    yield group, y, window[1] >= window[0]

    def _expand(
        self,
        group: INDICES,
        window: tuple[int, int],
        highest: int,
        tolerance: float,
        stragglers: float,
    ) -> Complex | None:
        """Orders of one group, near harmonics solved together."""
        coupling = self.coupling(max(highest, window[1] + 2))
        ratio, zeta, scale = (x[group] for x in self.numbers)
        allowed = 0.3 * tolerance * self._first_sizes(group) / self.gain[group]
        with np.errstate(all="ignore"):
            try:
                series = ManyOrders(coupling, coupling.window(*window), ratio, zeta, scale)
            except np.linalg.LinAlgError:
                return None
            y = series.solve(allowed, stragglers)
        count = coupling.highest + 1
        half: Complex = np.empty((len(group), count), dtype=complex)
        half.real, half.imag = y[:count].T, y[count:].T
        return half

    def _first_sizes(self, group: INDICES) -> Real:
        """Rms acceleration over w0^2 F/k0 of the first order, and no less than of line 1."""
        harmonics, shown = self.equations.pattern.harmonics, self.equations.shown
        count = min(len(harmonics), shown or len(harmonics))
        ratio, zeta, scale = (x[group] for x in self.numbers)
        squares = (np.arange(1, count + 1)[:, None] / ratio) ** 2
        sizes = np.abs(harmonics[:count, None]) ** 2 * squares**2
        sizes /= (1 - squares) ** 2 + 4 * zeta**2 * squares
        return np.asarray(scale * np.sqrt(2 * sizes.sum(axis=0)))

    def _needed(self, parts: list[INDICES], tolerance: float) -> list[int]:
        """Highest harmonic for every group, from its extreme members."""
        if not parts:
            return []
        ratio, zeta, scale = self.numbers
        # the fastest natural vibration, with the weakest and the strongest damping
        fastest, strongest, loosest = (
            np.repeat([x[part].max() for part in parts], 2) for x in (ratio, scale, self.gain)
        )
        dampings = np.array([pick(zeta[part]) for part in parts for pick in (np.min, np.max)])
        needed = self._harmonics_needed(dampings, fastest, strongest, loosest, tolerance)
        # an even number, so that fewer products are kept
        return [int(n) + int(n) % 2 for n in needed.reshape(-1, 2).max(axis=1)]

    def _harmonics_needed(
        self, zeta: Real, ratio: Real, scale: Real, gain: Real, tolerance: float
    ) -> INDICES:
        """Highest harmonic that each set takes, shape (B,), by a series that surely converges.

        The orders of the same equations, |D_n| not let below 2.5 max|phi|, fall off above the
        resonance as the solution does. What is left out may be a third of the tolerance.
        """
        harmonics, shown = self.equations.pattern.harmonics, self.equations.shown
        largest = math.ceil(1.5 * ratio.max() + 3 * len(harmonics)) + 10
        coupling = self.coupling(min(largest, 2 * MOST_HARMONICS))
        x = np.arange(coupling.highest + 1)[:, None] / ratio
        stiffness = 1 - x * x + 2j * zeta * x
        swing = self.equations.pattern.highest * scale
        answer = -scale / (stiffness * np.maximum(1.0, 2.5 * swing / np.abs(stiffness)))
        count = len(x)
        rows = coupling.inward_forcing[:, None]
        for _ in range(round(8 - 1.5 * math.log10(tolerance))):
            y = answer * (rows[:count] + 1j * rows[count:])
            rows = coupling.inward_forcing[:, None] + coupling.inward @ stacked(y)
        lines = np.abs(y) ** 2
        direct = np.cumsum((x**4 * lines)[::-1], axis=0)[::-1]
        beyond = np.sqrt(direct if shown is None else 0.0) + gain * swing * np.sqrt(
            np.cumsum(lines[::-1], axis=0)[::-1]
        )
        enough = beyond <= 0.3 * tolerance * np.sqrt(direct[0])
        # the lines from n on may go, so that n - 1 is the last one kept
        needed = np.where(enough.any(axis=0), enough.argmax(axis=0), MOST_HARMONICS + 1)
        return np.asarray(np.maximum(needed, np.ceil(1.3 * ratio).astype(int) + 1))
