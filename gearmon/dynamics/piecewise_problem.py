"""One mass on a spring whose stiffness is constant piece by piece: the problem, checked."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gearmon.dynamics import floquet, step_maps
from gearmon.dynamics.fourier import Complex, Real
from gearmon.dynamics.hill import HillProblem
from gearmon.errors import ArgumentError, check_finite, check_positive, check_range

MOST_HARMONICS = 10_000_000


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
    force_n : float or float array, shape (P,)
        F, constant or piece by piece.
    start_s : float
        Time at which the first piece begins; it sets the phases of the lines.

    Raises
    ------
    ArgumentError
        If a value is not finite or out of its range.

    Examples
    --------
    >>> p = PiecewiseProblem.rectangular(0.28, 9e3, 8e8, 0.13, 0.412, 1.6e-3, 4e3)
    >>> round(p.mean_stiffness_n_per_m, 3), round(p.frequency_ratio, 4)
    (800000000.0, 13.6115)
    """

    mass_kg: float
    damping_ns_per_m: float
    stiffness_n_per_m: Real
    durations_s: Real
    force_n: float | Real
    start_s: float = 0.0

    def __post_init__(self) -> None:
        check_positive("mass_kg", self.mass_kg, "kg")
        check_finite("damping_ns_per_m", self.damping_ns_per_m, "N s/m")
        if self.damping_ns_per_m < 0:
            raise ArgumentError(f"damping_ns_per_m={self.damping_ns_per_m} N s/m must be >= 0")
        check_finite("start_s", self.start_s, "s")
        levels = _row("stiffness_n_per_m", self.stiffness_n_per_m, "N/m", above_zero=True)
        times = _row("durations_s", self.durations_s, "s", above_zero=True)
        force = np.atleast_1d(np.asarray(self.force_n, dtype=np.float64))
        force = _row("force_n", force, "N", above_zero=False)
        if len(times) != len(levels):
            raise ArgumentError(
                f"durations_s: {len(times)} values for {len(levels)} pieces; give one to each"
            )
        if len(force) not in (1, len(levels)):
            raise ArgumentError(
                f"force_n: {len(force)} values for {len(levels)} pieces; give one, or one to each"
            )
        object.__setattr__(self, "stiffness_n_per_m", levels)
        object.__setattr__(self, "durations_s", times)
        object.__setattr__(self, "force_n", float(force[0]) if len(force) == 1 else force)

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
        check_finite("duty", duty)
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
    def angular_frequency(self) -> float:
        """Angular frequency w = 2 pi/T [rad/s]."""
        return 2 * math.pi / self.period_s

    @property
    def mean_stiffness_n_per_m(self) -> float:
        """k0, mean over the period [N/m]."""
        return float(self.stiffness_n_per_m @ self.durations_s) / self.period_s

    @property
    def natural_frequency_hz(self) -> float:
        """sqrt(k0/m)/(2 pi) [Hz], undamped and with the mean stiffness."""
        return math.sqrt(self.mean_stiffness_n_per_m / self.mass_kg) / (2 * math.pi)

    @property
    def damping_ratio(self) -> float:
        """Damping ratio zeta = c/(2 sqrt(k0 m)) [1]."""
        return self.damping_ns_per_m / (2 * math.sqrt(self.mean_stiffness_n_per_m * self.mass_kg))

    @property
    def frequency_ratio(self) -> float:
        """R = w0/w [1]."""
        return self.natural_frequency_hz * self.period_s

    @property
    def relative_levels(self) -> Real:
        """k_i/k0 [1], shape (P,)."""
        return np.asarray(self.stiffness_n_per_m / self.mean_stiffness_n_per_m)

    @property
    def shares(self) -> Real:
        """tau_i/T [1], shape (P,)."""
        return np.asarray(self.durations_s / self.period_s)

    @property
    def force_pieces_n(self) -> Real:
        """Force in each piece [N], shape (P,)."""
        return np.broadcast_to(self.force_n, self.durations_s.shape)

    @property
    def mean_force_n(self) -> float:
        """Mean of F(t) [N]."""
        return float(self.force_pieces_n @ self.shares)

    def harmonics_of(self, values: npt.ArrayLike, highest: int) -> Complex:
        """Fourier coefficients 0..highest of what has one value in each piece."""
        pieces = np.broadcast_to(np.asarray(values, dtype=np.float64), self.durations_s.shape)
        ends = np.concatenate([[0.0], np.cumsum(self.shares)]) + self.start_s / self.period_s
        orders = np.arange(1, highest + 1)
        # sum over pieces of value times the integral of e^{-inwt}, by the jumps at their starts
        jumps = pieces - np.roll(pieces, 1)
        turns = np.exp(-2j * math.pi * np.mod(orders[:, None] * ends[:-1], 1.0))
        half = np.empty(highest + 1, dtype=complex)
        half[0] = pieces @ self.shares
        half[1:] = (turns @ jumps) / (2j * math.pi * orders)
        return half

    def hill(self, harmonics: int) -> HillProblem:
        """Return the problem with k(t), and F(t), cut after so many harmonics.

        Parameters
        ----------
        harmonics : int
            J >= 1. The cut series overshoots each jump by 9 % of it however many are kept, and its
            response approaches the exact one as 1/J^2 in displacement.
        """
        check_range("harmonics", harmonics, 1, MOST_HARMONICS)
        stiffness = self.harmonics_of(self.relative_levels, harmonics)
        force = self.harmonics_of(self.force_n, harmonics)[1:]
        return HillProblem(
            self.mass_kg,
            self.damping_ns_per_m,
            self.mean_stiffness_n_per_m,
            stiffness[1:],
            self.period_s,
            self.mean_force_n,
            force if np.ndim(self.force_n) else np.zeros(0, dtype=complex),
        )


def _row(name: str, values: npt.ArrayLike, unit: str, *, above_zero: bool) -> Real:
    """Return a read-only copy of a row of finite numbers."""
    row = np.array(values, dtype=np.float64)
    if row.ndim != 1 or not len(row):
        raise ArgumentError(f"{name}: shape {row.shape} must be one row, one value to each piece")
    bad = ~np.isfinite(row) | (above_zero & (row <= 0))
    if bad.any():
        place = int(np.flatnonzero(bad)[0])
        wanted = "finite and > 0" if above_zero else "finite"
        raise ArgumentError(f"{name}: piece {place + 1} is {row[place]} {unit}, must be {wanted}")
    row.flags.writeable = False
    return row


def multipliers(problem: PiecewiseProblem) -> tuple[complex, complex]:
    """Floquet multipliers, the larger modulus first, in closed form.

    Examples
    --------
    >>> p = PiecewiseProblem.rectangular(1.0, 0.0, 1.0, 0.0, 0.5, 1.0, 1.0)
    >>> first, second = multipliers(p)
    >>> round(first.real, 12) == round(math.cos(1.0), 12), round(abs(first * second), 12)
    (True, 1.0)
    """
    h = problem.damping_ns_per_m / (2 * problem.mass_kg)
    steps, logs = step_maps.unit_matrices(
        np.array(h), problem.stiffness_n_per_m / problem.mass_kg, problem.durations_s
    )
    product, log = step_maps.scaled_product(steps, logs)
    pair = floquet.exponents(product, float(log))
    decay = h * problem.period_s
    return cmath.exp(pair[0] - decay), cmath.exp(pair[1] - decay)
