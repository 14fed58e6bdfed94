"""Sets of values sorted into groups that are expanded together, and what became of each.

Sets with the same harmonics near their natural frequency share their equations but for D, so they
form a group. A set that misses the tolerance is taken again with more harmonics and a smaller
residual, then by harmonic balance of its own matrix.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from gearmon.dynamics import sweep_balance
from gearmon.dynamics.fourier import Complex, Real
from gearmon.dynamics.sweep_bounds import Sets, Swing, relative_bounds
from gearmon.dynamics.sweep_orders import INDICES, ManyOrders, SharedCoupling, stacked

MSM, RESONANT, BALANCE, UNSOLVED = range(4)
MOST_TOGETHER = 512
FEWEST_TOGETHER = 48
MOST_NEAR = 10
# share of a group that may go into a second attempt
STRAGGLERS = 0.04
MOST_HARMONICS = 256
# |D_n| below this many times max|phi| makes a harmonic near
NEARNESS = 2.0


@dataclass
class Found:
    """Solutions of a batch of sets, gathered group by group.

    Attributes
    ----------
    bound : float ndarray, shape (B,)
        Relative error of the acceleration; infinite where nothing is known.
    method : int ndarray, shape (B,)
        MSM, RESONANT, BALANCE or UNSOLVED.
    parts : list of (int ndarray, float ndarray)
        Indices of sets and their rows of y, later entries replacing earlier ones.
    """

    bound: Real
    method: npt.NDArray[np.int8]
    parts: list[tuple[INDICES, Real]] = field(default_factory=list)

    def take(self, indices: INDICES, y: Real, bound: Real, method: int) -> None:
        """Keep the columns that are better than what was known."""
        better = bound < self.bound[indices]
        if not better.all():
            indices, y, bound = indices[better], y[:, better], bound[better]
        if len(indices):
            self.bound[indices], self.method[indices] = bound, method
            self.parts.append((indices, y))

    def spectra(self, most: int) -> Complex:
        """Half spectra of all sets, shape (B, N+1) with N <= most."""
        highest = min(most, max([0, *(len(y) // 2 - 1 for _, y in self.parts)]))
        spectra = np.zeros((len(self.bound), highest + 1), dtype=complex)
        for indices, y in self.parts:
            count = min(len(y) // 2, highest + 1)
            half = np.zeros((len(indices), highest + 1), dtype=complex)
            half.real[:, :count] = y[:count].T
            half.imag[:, :count] = y[len(y) // 2 : len(y) // 2 + count].T
            spectra[indices] = half
        spectra[:, 0] += 1
        return spectra


class SharedPattern:
    """Expansions over one phi. What depends on phi alone is made once and kept for further sets.

    Parameters
    ----------
    swing : Swing
        Of phi.
    """

    def __init__(self, swing: Swing) -> None:
        self.swing = swing
        self.sizes = (np.asarray(swing.highest), np.asarray(2 * np.abs(swing.harmonics).sum()))
        self._couplings: dict[int, SharedCoupling] = {}

    def coupling(self, highest: int) -> SharedCoupling:
        """Products for harmonics 0..highest."""
        if highest not in self._couplings:
            self._couplings[highest] = SharedCoupling(self.swing.harmonics, highest)
        return self._couplings[highest]

    def solve(self, sets: Sets, tolerance: float, shown: int) -> Found:
        """Solve all sets as well as it can be done together.

        Parameters
        ----------
        sets : Sets
            With finite gains.
        tolerance : float
            Relative error of the acceleration.
        shown : int
            Highest harmonic handed out.
        """
        count = len(sets.ratio)
        found = Found(bound=np.full(count, np.inf), method=np.full(count, UNSOLVED, dtype=np.int8))
        first, last = windows(sets, self.swing.highest)
        left = np.arange(count)
        # sets that converge alike stand together
        alike = np.where(
            last < first, 1e3 * np.ceil(2 * np.log2(sets.zeta)) + sets.ratio, sets.gain
        )
        for sharper, stragglers in ((1.0, STRAGGLERS), (0.03, 0.0)):
            few = left[last[left] - first[left] < MOST_NEAR]
            chosen = list(groups(few, first, last, alike))
            needed = self._needed([sets[group] for group, _ in chosen], sharper * tolerance, shown)
            for (group, window), highest in zip(chosen, needed, strict=True):
                if highest <= MOST_HARMONICS:
                    aim = sharper * tolerance
                    self._expand(found, sets, group, window, highest, aim, shown, stragglers)
            left = left[found.bound[left] > tolerance]
        each = self.needed_by_each(sets[left], 0.03 * tolerance, shown)
        for group, highest in _batches(left, each, len(self.swing.harmonics)):
            self._balance(found, sets, group, highest, shown)
        return found

    def _needed(self, parts: list[Sets], tolerance: float, shown: int) -> list[int]:
        """Highest harmonic for every group, from its extreme members."""
        if not parts or not len(self.swing.harmonics):
            return [max(2, math.ceil(1.3 * part.ratio.max())) for part in parts]
        # the fastest natural vibration, with the weakest and the strongest damping
        extremes = Sets(
            ratio=np.repeat([part.ratio.max() for part in parts], 2),
            zeta=np.array([pick(part.zeta) for part in parts for pick in (np.min, np.max)]),
            scale=np.repeat([part.scale.max() for part in parts], 2),
            gain=np.repeat([part.gain.max() for part in parts], 2),
        )
        largest = math.ceil(1.5 * extremes.ratio.max() + 3 * len(self.swing.harmonics)) + 10
        coupling = self.coupling(min(largest, 2 * MOST_HARMONICS))
        needed = harmonics_needed(coupling, self.swing, extremes, tolerance, shown)
        highest = needed.reshape(-1, 2).max(axis=1)
        # an even number, so that fewer products are kept
        return [int(n) + int(n) % 2 for n in highest]

    def _expand(
        self,
        found: Found,
        sets: Sets,
        group: INDICES,
        window: tuple[int, int],
        highest: int,
        tolerance: float,
        shown: int,
        stragglers: float,
    ) -> None:
        """Orders of one group, near harmonics solved together."""
        part = sets[group]
        coupling = self.coupling(max(highest, window[1] + 2))
        allowed = 0.3 * tolerance * self._first_sizes(part, shown) / part.gain
        with np.errstate(all="ignore"):
            try:
                series = ManyOrders(coupling, coupling.window(*window), *part.numbers)
            except np.linalg.LinAlgError:
                return
            y = series.solve(allowed, stragglers)
            bound = relative_bounds(
                part, y, coupling.outward @ y, coupling.forcing[:, None], self.sizes, shown
            )
        found.take(group, y, bound, RESONANT if window[1] >= window[0] else MSM)

    def needed_by_each(self, sets: Sets, tolerance: float, shown: int) -> INDICES:
        """Highest harmonic for every set by itself, shape (B,)."""
        needed: list[int] = []
        for start in range(0, len(sets.ratio), MOST_TOGETHER):
            some = range(start, min(start + MOST_TOGETHER, len(sets.ratio)))
            needed += self._needed([sets[np.array([i])] for i in some], tolerance, shown)
        return np.array(needed, dtype=int)

    def _balance(self, found: Found, sets: Sets, group: INDICES, highest: int, shown: int) -> None:
        part = sets[group]
        try:
            y, product, forcing = sweep_balance.balance(
                self.swing.harmonics, highest, *part.numbers
            )
        except np.linalg.LinAlgError:
            return
        bound = relative_bounds(part, y, product, forcing, self.sizes, shown)
        found.take(group, y, bound, BALANCE)

    def _first_sizes(self, part: Sets, shown: int) -> Real:
        """Rms acceleration over w0^2 F/k0 of the first order, and no less than of line 1."""
        count = min(len(self.swing.harmonics), shown)
        squares = (np.arange(1, count + 1)[:, None] / part.ratio) ** 2
        sizes = np.abs(self.swing.harmonics[:count, None]) ** 2 * squares**2
        sizes /= (1 - squares) ** 2 + 4 * part.zeta**2 * squares
        return np.asarray(part.scale * np.sqrt(2 * sizes.sum(axis=0)))


def _batches(left: INDICES, needed: INDICES, reach: int) -> Iterator[tuple[INDICES, int]]:
    """Yield sets of similar size for harmonic balance, and their highest harmonic."""
    few = needed <= MOST_HARMONICS
    order = np.argsort(needed[few])
    left, needed = left[few][order], needed[few][order]
    start = 0
    while start < len(left):
        first = int(needed[start])
        end = start + sweep_balance.most_together(first, first + reach)
        end = min(end, int(np.searchsorted(needed, 1.25 * first + 2)))
        yield left[start:end], int(needed[end - 1])
        start = end


def windows(sets: Sets, swing: float) -> tuple[INDICES, INDICES]:
    """First and last harmonic with |D_n| < NEARNESS max|phi| of every set; last < first if none."""
    bend = 1 - 2 * sets.zeta**2
    spread = bend**2 - 1 + (NEARNESS * swing * sets.scale) ** 2
    root = np.sqrt(np.maximum(spread, 0.0))
    first = np.ceil(sets.ratio * np.sqrt(np.maximum(bend - root, 0.0)))
    last = np.floor(sets.ratio * np.sqrt(np.maximum(bend + root, 0.0)))
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


def harmonics_needed(
    coupling: SharedCoupling, swing: Swing, sets: Sets, tolerance: float, shown: int
) -> INDICES:
    """Highest harmonic that each set takes, shape (B,), by a series that surely converges.

    The orders of the same equations, |D_n| not let below 2.5 max|phi|, fall off above the
    resonance as the solution does. What is left out may be a third of the tolerance.
    """
    x = np.arange(coupling.highest + 1)[:, None] / sets.ratio
    stiffness = 1 - x * x + 2j * sets.zeta * x
    least = 2.5 * swing.highest * sets.scale
    answer = -sets.scale / (stiffness * np.maximum(1.0, least / np.abs(stiffness)))
    count = len(x)
    rows = coupling.inward_forcing[:, None]
    for _ in range(round(8 - 1.5 * math.log10(tolerance))):
        y = answer * (rows[:count] + 1j * rows[count:])
        rows = coupling.inward_forcing[:, None] + coupling.inward @ stacked(y)
    lines = np.abs(y) ** 2
    direct = np.cumsum((x**4 * lines)[::-1], axis=0)[::-1]
    coupled = sets.gain * sets.scale * swing.highest
    beyond = np.sqrt(direct if shown >= count else 0.0) + coupled * np.sqrt(
        np.cumsum(lines[::-1], axis=0)[::-1]
    )
    enough = beyond <= 0.3 * tolerance * np.sqrt(direct[0])
    # the lines from n on may go, so that n - 1 is the last one kept
    needed = np.where(enough.any(axis=0), enough.argmax(axis=0), MOST_HARMONICS + 1)
    return np.asarray(np.maximum(needed, np.ceil(1.3 * sets.ratio).astype(int) + 1))
