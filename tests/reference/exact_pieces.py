"""Exact steady vibration where the mesh stiffness is constant piece by piece.

    m z'' + c z' + k(t) z = F,    k(t) = k_i during tau_i,  i = 1..P, periodic

A rectangular mesh stiffness (one and two pairs in contact in turn) is the case P = 2. Nothing is
truncated: within a piece z - F/k_i is a free vibration, with h = c/(2m) and r^2 = h^2 - k_i/m

    y(t) = e^{-ht} [cosh(rt) y(0) + sinh(rt)/r (y'(0) + h y(0))],

and the state that returns after all pieces is the steady one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.fourier import Complex, Real
from gearmon.dynamics.hill import KINDS, HillProblem, check_kind
from gearmon.errors import ArgumentError, check_finite, check_positive, check_range

#: Points of Gauss's rule on a stretch over which the fastest part turns by PANEL radians.
GAUSS_POINTS, PANEL = 12, 4.0
#: 1 less a multiplier that rounding cannot tell from 0.
SINGULAR = 1e-13


@dataclass(frozen=True, kw_only=True, eq=False)
class PiecewiseProblem:
    """One mass on a spring whose stiffness is constant piece by piece.

    Parameters
    ----------
    mass_kg : float
        m > 0.
    damping_ns_per_m : float
        c >= 0. Without damping (0) no steady state is ever reached.
    stiffness_n_per_m : float array, shape (P,)
        k_1..k_P > 0, in the order of time.
    durations_s : float array, shape (P,)
        tau_1..tau_P > 0; their sum is the period T.
    force_n : float
        F.
    start_s : float
        Time at which the first piece begins; it sets the phases of the lines.

    Raises
    ------
    ArgumentError
        If a value is not finite or out of its range.

    Examples
    --------
    >>> p = PiecewiseProblem.rectangular(0.28, 9e3, 8e8, 0.13, 0.412, 1.6e-3, 4e3)
    >>> round(p.mean_stiffness_n_per_m, 3), round(p.hill(10).frequency_ratio, 4)
    (800000000.0, 13.6115)
    """

    mass_kg: float
    damping_ns_per_m: float
    stiffness_n_per_m: Real
    durations_s: Real
    force_n: float
    start_s: float = 0.0

    def __post_init__(self) -> None:
        check_finite("start_s", self.start_s, "s")
        for name, unit in (("stiffness_n_per_m", "N/m"), ("durations_s", "s")):
            object.__setattr__(self, name, _row(name, getattr(self, name), unit))
        if len(self.durations_s) != len(self.stiffness_n_per_m):
            raise ArgumentError(
                f"durations_s: {len(self.durations_s)} values for {len(self.stiffness_n_per_m)} "
                "pieces; give one to each"
            )
        self.hill(1)  # which refuses what no pair can have

    @classmethod
    def rectangular(
        cls,
        mass_kg: float,
        damping_ns_per_m: float,
        mean_stiffness_n_per_m: float,
        variation: float,
        duty: float,
        period_s: float,
        force_n: float,
    ) -> PiecewiseProblem:
        """Two levels: k0 (1 + eps) for D T about t = 0, k0 (1 - eps D/(1-D)) for the rest.

        Parameters
        ----------
        mass_kg, damping_ns_per_m, mean_stiffness_n_per_m, period_s, force_n : float
            As of `HillProblem`.
        variation : float
            eps > -1; both levels must be above zero.
        duty : float
            D in (0, 1): contact ratio less one for spur gears below two pairs.

        Raises
        ------
        ArgumentError
            If a value is out of its range.
        """
        check_positive("mean_stiffness_n_per_m", mean_stiffness_n_per_m, "N/m")
        check_positive("period_s", period_s, "s")
        check_finite("variation", variation)
        if not 0 < duty < 1:
            raise ArgumentError(f"duty={duty} must lie between 0 and 1")
        levels = np.array([1 + variation, 1 - variation * duty / (1 - duty)])
        if levels.min() <= 0:
            raise ArgumentError(
                f"variation={variation} with duty={duty} makes the stiffness {levels.min():.4g} "
                "times its mean; it must stay > 0"
            )
        return cls(
            mass_kg=mass_kg,
            damping_ns_per_m=damping_ns_per_m,
            stiffness_n_per_m=mean_stiffness_n_per_m * levels,
            durations_s=period_s * np.array([duty, 1 - duty]),
            force_n=force_n,
            start_s=-duty * period_s / 2,
        )

    @property
    def period_s(self) -> float:
        """T [s]."""
        return float(self.durations_s.sum())

    @property
    def mean_stiffness_n_per_m(self) -> float:
        """k0, mean over the period [N/m]."""
        return float(self.stiffness_n_per_m @ self.durations_s) / self.period_s

    def hill(self, harmonics: int) -> HillProblem:
        """Return the problem with k(t) cut after so many harmonics.

        Parameters
        ----------
        harmonics : int
            J >= 1. The cut series overshoots each jump by 9 % of it however many are kept, and its
            response approaches the exact one as 1/J^2 in displacement.
        """
        orders = np.arange(1, int(check_range("harmonics", harmonics, 1, 10_000_000)) + 1)
        levels, mean = self.stiffness_n_per_m, self.mean_stiffness_n_per_m
        begins = np.cumsum(self.durations_s) - self.durations_s + self.start_s
        # the integral of e^{-inwt} over the pieces, by the jumps at their starts
        turns = np.exp(-2j * math.pi * np.mod(orders[:, None] * (begins / self.period_s), 1.0))
        half = turns @ (levels - np.roll(levels, 1)) / (2j * math.pi * orders * mean)
        fixed = self.mass_kg, self.damping_ns_per_m, mean
        return HillProblem(*fixed, half, self.period_s, self.force_n)


def _row(name: str, values: npt.ArrayLike, unit: str) -> Real:
    """Return a read-only copy of a row of finite numbers above zero."""
    row = np.array(values, dtype=np.float64)
    if row.ndim != 1 or not len(row):
        raise ArgumentError(f"{name}: shape {row.shape} must be one row, one value to each piece")
    bad = ~np.isfinite(row) | (row <= 0)
    if bad.any():
        i = int(np.flatnonzero(bad)[0])
        raise ArgumentError(f"{name}: piece {i + 1} is {row[i]} {unit}, must be finite and > 0")
    row.flags.writeable = False
    return row


@dataclass(frozen=True, eq=False)
class PiecewiseMotion:
    """The periodic motion of a `PiecewiseProblem`."""

    problem: PiecewiseProblem

    def _moved(self, piece: npt.NDArray[np.int_] | int, time_s: Real | float) -> Real:
        """Matrices of (z - F/k_i, z') over some time within a piece, shape (..., 2, 2)."""
        p = self.problem
        h, square = p.damping_ns_per_m / (2 * p.mass_kg), p.stiffness_n_per_m[piece] / p.mass_kg
        r = np.sqrt(np.asarray(h**2 - square, dtype=complex))
        up, down = np.exp((r - h) * time_s), np.exp(-(r + h) * time_s)
        even = ((up + down) / 2).real
        safe = np.where(r == 0, 1.0, r)
        odd = np.where(r == 0, time_s * np.exp(-h * time_s), (up - down) / (2 * safe)).real
        rows = [[even + h * odd, odd], [-square * odd, even - h * odd]]
        return np.moveaxis(np.array(rows), (0, 1), (-2, -1))

    @cached_property
    def period_map(self) -> Real:
        """Matrix of free vibrations (z, z') over the period, shape (2, 2)."""
        steps = self._moved(np.arange(len(self.problem.durations_s)), self.problem.durations_s)
        return np.asarray(np.linalg.multi_dot([*steps[::-1], np.eye(2)]))

    @property
    def floquet_multipliers(self) -> tuple[complex, complex]:
        """Factors by which a free vibration changes over a period, the larger modulus first."""
        values = sorted(np.linalg.eigvals(self.period_map), key=abs, reverse=True)
        return complex(values[0]), complex(values[1])

    @property
    def stable(self) -> bool:
        """Whether free vibrations die out."""
        return abs(self.floquet_multipliers[0]) < 1

    @cached_property
    def starts(self) -> Real:
        """State (z - F/k_i, z') at the start of each piece, shape (P, 2)."""
        p = self.problem
        still = p.force_n / p.stiffness_n_per_m
        state = np.zeros(2)
        # the motion from rest, then the state that it and the free vibration bring back
        for turn in range(2):
            found = []
            for i, time in enumerate(p.durations_s):
                found.append(state - [still[i], 0.0])
                state = self._moved(i, time) @ found[-1] + [still[i], 0.0]
            if not turn:
                matrix = np.eye(2) - self.period_map
                if abs(np.linalg.det(matrix)) < SINGULAR:
                    raise ArgumentError(
                        "the equation has no periodic solution: a multiplier is 1 and nothing "
                        f"damps it; give damping_ns_per_m={p.damping_ns_per_m} N s/m a value > 0"
                    )
                state = np.linalg.solve(matrix, state)
        return np.array(found)

    def at(self, time_s: npt.ArrayLike, kind: str = "displacement") -> Real:
        """Displacement [m], velocity [m/s], acceleration [m/s2] or mesh force [N] at any times.

        Parameters
        ----------
        time_s : float array
            Times [s], any shape. At a jump the value after it.
        kind : {"displacement", "velocity", "acceleration", "mesh_force"}
            What to evaluate; exact, not a sum of harmonics.
        """
        p, which = self.problem, KINDS.index(check_kind(kind))
        ends = np.cumsum(p.durations_s)
        since = np.mod(np.asarray(time_s, dtype=np.float64) - p.start_s, ends[-1])
        i = np.searchsorted(ends[:-1], since, side="right")
        passed = since - (ends - p.durations_s)[i]
        y, v = np.moveaxis((self._moved(i, passed) @ self.starts[i][..., None])[..., 0], -1, 0)
        spring = p.stiffness_n_per_m[i] * y + p.damping_ns_per_m * v
        found = y + p.force_n / p.stiffness_n_per_m[i], v, -spring / p.mass_kg, spring + p.force_n
        return np.asarray(found[which])

    def lines(self, highest: int, kind: str = "displacement") -> Complex:
        """Fourier coefficients 0..highest, by Gauss's rule on every piece, shape (highest+1,)."""
        p, count = self.problem, math.isqrt(highest) + 1
        x, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
        ends = np.cumsum(p.durations_s)
        # radians that the free vibration and the highest line turn by in a second
        rate = math.sqrt(p.stiffness_n_per_m.max() / p.mass_kg) + 2 * math.pi * highest / ends[-1]
        total: Complex = np.zeros((count, count), dtype=complex)
        for end, length in zip(ends, p.durations_s, strict=True):
            edges = np.linspace(end - length, end, math.ceil(length * rate / PANEL) + 1)
            half = np.diff(edges)[:, None] / 2
            # Gauss points never touch the jumps
            at = (edges[:-1, None] + half * (1 + x)).ravel() + p.start_s
            values = self.at(at, kind) * (half * weights).ravel()
            # line count a + b turns by the product of what lines count a and b turn by
            turn = -2j * math.pi * np.mod(at[:, None] / ends[-1], 1.0)
            few = np.exp(turn * np.arange(count))
            total += np.exp(turn * count * np.arange(count)).T @ (values[:, None] * few)
        return total.ravel()[: highest + 1] / ends[-1]


def solve_exactly(problem: PiecewiseProblem) -> PiecewiseMotion:
    """Steady vibration in closed form; where free vibrations grow, the periodic one all the same.

    Parameters
    ----------
    problem : PiecewiseProblem
        The equation.

    Raises
    ------
    ArgumentError
        If the equation has no periodic solution at all (undamped, on the boundary of instability).

    Examples
    --------
    >>> p = PiecewiseProblem.rectangular(0.28, 9e3, 8e8, 0.13, 0.5, 1.6e-3, 4e3)
    >>> motion = solve_exactly(p)
    >>> float(round(1e6 * motion.lines(0)[0].real, 6)), motion.stable
    (5.083494, True)
    """
    motion = PiecewiseMotion(problem)
    _ = motion.starts
    return motion
