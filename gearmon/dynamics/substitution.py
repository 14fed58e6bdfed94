"""The orders of multiple scales as a formula in the parameters, evaluated for arrays of them.

The recursion of `multiple_scales` depends on mass, damping, mean stiffness and period only through
D_n, on the size of the variation through its power, and on the force through a factor. What is
planned once is the shape of k(t): its samples, the length of the transforms, the harmonics that
every order reaches. Values of parameters are then substituted, all sets at once.

Limits: the plain sum of `order` orders for every set, accurate where the series converges
(max|phi| max 1/|D_n| below about 0.5 for order 10 and 1e-3); no error bound. `steady_state` bounds
the error of one set.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.fourier import Complex, Real, fast_length, samples, with_zero_mean
from gearmon.dynamics.hill import HillProblem
from gearmon.errors import ArgumentError

VALUES_AT_ONCE = 1 << 18


@dataclass(frozen=True, kw_only=True, eq=False)
class Formula:
    """Sum of orders 0..order as a function of the parameters.

    Attributes
    ----------
    problem : HillProblem
        Gives the shape of k(t), the force harmonics and all values that are not substituted.
    order : int
        Highest order.
    highest : int
        Highest harmonic.
    small_damping : bool
        Whether damping counts as order one.
    """

    problem: HillProblem
    order: int
    highest: int
    small_damping: bool = False

    def at(
        self,
        *,
        mass_kg: npt.ArrayLike | None = None,
        damping_ns_per_m: npt.ArrayLike | None = None,
        stiffness_n_per_m: npt.ArrayLike | None = None,
        period_s: npt.ArrayLike | None = None,
        force_n: npt.ArrayLike | None = None,
        variation: npt.ArrayLike = 1.0,
    ) -> Complex:
        """Displacement for parameter values, which broadcast against each other.

        Parameters
        ----------
        mass_kg, damping_ns_per_m, stiffness_n_per_m, period_s, force_n : float array, optional
            As in `HillProblem`; by default the problem's own.
        variation : float array
            Factor of every c_j.

        Returns
        -------
        complex ndarray, shape (..., highest+1)
            z_0..z_highest [m] of every set.

        Raises
        ------
        ArgumentError
            If a value is not finite or out of its range, or the shapes do not broadcast.
        """
        p = self.problem
        values = (
            _checked("mass_kg", mass_kg, p.mass_kg, positive=True),
            _checked("damping_ns_per_m", damping_ns_per_m, p.damping_ns_per_m, least=0.0),
            _checked("stiffness_n_per_m", stiffness_n_per_m, p.stiffness_n_per_m, positive=True),
            _checked("period_s", period_s, p.period_s, positive=True),
            _checked("force_n", force_n, p.force_n),
            _checked("variation", variation, 1.0),
        )
        try:
            sets = np.broadcast_arrays(*values)
        except ValueError:
            shapes = ", ".join(str(value.shape) for value in values)
            raise ArgumentError(f"shapes {shapes} of the parameters must broadcast") from None
        flat = np.array([part.ravel() for part in sets])
        found = np.empty((flat.shape[1], self.highest + 1), dtype=complex)
        rows = max(1, VALUES_AT_ONCE // len(self._stiffness))
        for first in range(0, len(found), rows):
            part = slice(first, first + rows)
            found[part] = self._sum(flat[:, part, None])
        return found.reshape(*sets[0].shape, self.highest + 1)

    @cached_property
    def _stiffness(self) -> Real:
        """Values of phi at equal steps, as many as the longest product needs."""
        kept = with_zero_mean(self.problem.stiffness_harmonics, 2 * self.highest)
        values: Real = samples(kept, fast_length(2 * self.highest + len(kept)))
        return values

    def _sum(self, sets: Real) -> Complex:
        """All orders for sets of shape (6, B, 1)."""
        mass, damping, stiffness, period, force, variation = sets
        angular = np.arange(self.highest + 1) * (2 * math.pi / period)
        inertia = 1 - angular**2 * (mass / stiffness)
        friction = angular * (damping / stiffness)
        inverse = self._inverse(inertia, friction)
        term = self._forcing(force) / stiffness * inverse
        total: Complex = term.copy()
        inverse *= -variation if not self.small_damping else -1
        for _ in range(self.order):
            following = self._modulated(term)
            if self.small_damping:
                following *= variation
                following += 1j * friction * term
            term = following * inverse
            total += term
        return total

    def _inverse(self, inertia: Real, friction: Real) -> Complex:
        diagonal = np.asarray(inertia if self.small_damping else inertia + 1j * friction)
        if not diagonal.all():
            n = int(np.argwhere(diagonal == 0)[0][1])
            raise ArgumentError(
                f"harmonic {n} lies on the natural frequency of one of the sets and has no damping "
                "in order zero; use forced_resonance for it"
            )
        return np.asarray(1 / diagonal, dtype=np.complex128)

    def _forcing(self, force: Real) -> Complex:
        """Return the forces F, f_1, ... [N], shape (B, highest+1)."""
        given = self.problem.force_harmonics_n[: self.highest]
        forcing = np.zeros((len(force), self.highest + 1), dtype=complex)
        forcing[:, :1] = force
        forcing[:, 1 : len(given) + 1] = given
        return forcing

    def _modulated(self, half: Complex) -> Complex:
        length = len(self._stiffness)
        product = np.fft.irfft(half, length, axis=-1, norm="forward")
        product *= self._stiffness
        return np.asarray(
            np.fft.rfft(product, axis=-1, norm="forward")[:, : self.highest + 1],
            dtype=np.complex128,
        )


def _checked(
    name: str,
    given: npt.ArrayLike | None,
    default: float,
    positive: bool = False,
    least: float = -math.inf,
) -> Real:
    values = np.asarray(default if given is None else given, dtype=np.float64)
    allowed = np.isfinite(values) & ((values > 0) if positive else (values >= least))
    if not allowed.all():
        bad = values[~allowed].flat[0]
        limit = " and > 0" if positive else (f" and >= {least:g}" if least > -math.inf else "")
        raise ArgumentError(f"{name}={bad} must be finite{limit}")
    return values
