"""Residual of the full equation, and the bound of the relative error that follows from it.

An approximation z_0..z_N leaves a residual r_0..r_{N+J}, all of which is computed. Above a core of
harmonics 0..n', beyond which |D_n| dominates max|phi|, it is answered explicitly, e' = r_n/D_n for
n > n'; what then remains is s = r_0..r_n' less phi e', and

    ||error of acceleration|| <= ||e''|| + gain (||r_0..r_n'|| + max|phi| ||e'|| + rounding)

with the gain of `error_bound`; or, with s answered once more above the core,

    ||e''|| + gain (||s_0..s_n'|| + max|phi|^2 ||e'||/|D_n'+1| + rounding)
           + max|phi| ||e'|| max_{n>n'} (n/R)^2/|D_n|.

So high harmonics, solved for or not, cost what they are worth and not the gain of a resonance they
have no part in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gearmon.dynamics import error_bound
from gearmon.dynamics.error_bound import Gain
from gearmon.dynamics.fourier import (
    Complex,
    Modulation,
    Real,
    middle_and_swing,
    rms,
    supremum,
    with_zero_mean,
)
from gearmon.dynamics.hill import HillProblem

UNIT_ROUNDOFF = 2.0**-52


@dataclass(frozen=True, kw_only=True)
class Bound:
    """What is known of the error of one approximation; rms of acceleration over w0^2 [m].

    Attributes
    ----------
    relative : float
        Guaranteed relative L2 error of the acceleration; may be infinite.
    size : float
        Rms of the acceleration handed out.
    core, above, rounding : float
        Shares of the bound of the rms error: residual of the core, of all harmonics above it, and
        rounding.
    """

    relative: float
    size: float
    core: float
    above: float
    rounding: float

    @property
    def total(self) -> float:
        """Bound of the rms error."""
        return self.core + self.above + self.rounding


@dataclass(frozen=True, kw_only=True)
class Approximation:
    """An approximate steady vibration z = start + dynamic, and how good it is.

    Attributes
    ----------
    start : complex ndarray, shape (N+1,)
        g_n/D_n, the answer to the forces alone [m]; apart, so that a vibration far smaller than
        F/k0 keeps its digits.
    dynamic : complex ndarray, shape (N+1,)
        The rest [m].
    residual : complex ndarray, shape (N+J+1,)
        Of the full equation [m].
    bound : Bound
        Of the error of the harmonics handed out.
    orders : int
        Orders of the expansion that went into it.
    """

    start: Complex
    dynamic: Complex
    residual: Complex
    bound: Bound
    orders: int

    @property
    def highest(self) -> int:
        """N."""
        return len(self.start) - 1


class Certifier:
    """Residuals and error bounds of approximations to one problem.

    Parameters
    ----------
    problem : HillProblem
        The equation.
    shown : int, optional
        Harmonics 0..shown are handed out, others dropped; default all.
    """

    def __init__(self, problem: HillProblem, shown: int | None = None) -> None:
        self.problem = problem
        self.shown = shown

    @cached_property
    def gain(self) -> Gain:
        """Bound of the inverse operator; the cheap one where it is good."""
        p = self.problem
        ratio, zeta, c = p.frequency_ratio, p.damping_ratio, p.stiffness_harmonics
        return error_bound.best_gain(ratio, zeta, c)

    @cached_property
    def swing(self) -> float:
        """Bound of max|phi|."""
        c = self.problem.stiffness_harmonics
        return supremum(with_zero_mean(c)) if len(c) else 0.0

    @cached_property
    def middle(self) -> tuple[float, float]:
        """A number b midway between the extremes of phi, and a bound of max|phi - b|."""
        c = self.problem.stiffness_harmonics
        return middle_and_swing(c) if len(c) else (0.0, 0.0)

    def weights(self, highest: int) -> Real:
        """(n/R)^2: acceleration over w0^2 z, shape (highest+1,)."""
        weights: Real = (np.arange(highest + 1) / self.problem.frequency_ratio) ** 2
        return weights

    @cached_property
    def core(self) -> int:
        """Harmonic above which |D_n| >= 10 max|phi| and 10: there each order gains a digit."""
        return math.ceil(self.problem.frequency_ratio * math.sqrt(1 + 10 * max(1.0, self.swing)))

    def judge(self, dynamic: Complex, orders: int = 0) -> Approximation:
        """Compute residual and bound of z = g/D + dynamic, shape (N+1,)."""
        p = self.problem
        highest = len(dynamic) - 1
        stiffness = p.dynamic_stiffness(highest)
        start = p.static_forcing(highest) / stiffness
        reach = highest + len(p.stiffness_harmonics)
        swinging = start + dynamic
        mean = swinging[0].real
        swinging[0] = 0
        residual = -Modulation(p.stiffness_harmonics, highest, reach)(swinging)
        residual[: highest + 1] -= stiffness * dynamic
        # phi times the large mean deflection is known without a transform and its rounding
        residual[1 : len(p.stiffness_harmonics) + 1] -= mean * p.stiffness_harmonics
        rounding = self._rounding(stiffness * start, stiffness * dynamic, swinging)
        rounding += UNIT_ROUNDOFF * abs(mean) * rms(with_zero_mean(p.stiffness_harmonics))
        bound = self._bound(start + dynamic, residual, rounding)
        return Approximation(
            start=start, dynamic=dynamic, residual=residual, bound=bound, orders=orders
        )

    def answer(self, residual: Complex, above: int) -> Complex:
        """First-order answer to the residual above a harmonic, r_n/D_n; 0 up to it."""
        extra = residual.copy()
        extra[: above + 1] = 0
        extra /= self.problem.dynamic_stiffness(len(residual) - 1)
        return extra

    def sharpened(self, found: Approximation, better: Approximation) -> Approximation:
        """Bound the error of `found` by its distance from `better` and the error of that one."""
        highest = max(found.highest, better.highest)
        apart = np.zeros(highest + 1, dtype=complex)
        apart[: better.highest + 1] = better.start + better.dynamic
        size = rms((self.weights(highest) * apart)[: self.last_shown(highest) + 1])
        apart[: found.highest + 1] -= found.start + found.dynamic
        distance = rms((self.weights(highest) * apart)[: self.last_shown(highest) + 1])
        left = better.bound.total
        if not left < size:
            return found
        relative = float(min(found.bound.relative, (distance + left) / (size - left)))
        return replace(found, bound=replace(found.bound, relative=relative))

    def last_shown(self, highest: int) -> int:
        """Highest harmonic that is handed out, of 0..highest."""
        return highest if self.shown is None else min(self.shown, highest)

    def _bound(self, z: Complex, residual: Complex, rounding: float) -> Bound:
        highest = len(z) - 1
        core = min(self.core, highest)
        inner, above = self._shares(residual, core)
        size = rms((self.weights(highest) * z)[: self.last_shown(highest) + 1])
        bound = Bound(
            relative=0.0,
            size=size,
            core=inner,
            above=above,
            rounding=_times(self.gain.acceleration, rounding),
        )
        if bound.total == 0:
            return bound
        total = bound.total
        return replace(bound, relative=float(total / (size - total)) if total < size else math.inf)

    def _shares(self, residual: Complex, core: int) -> tuple[float, float]:
        """Bounds of the error that residuals of the core and above it cause."""
        gain = self.gain.acceleration
        extra = self.answer(residual, core)
        outer = len(extra) - 1
        direct = rms((self.weights(outer) * extra)[: self.last_shown(outer) + 1])
        inner = _times(gain, rms(residual[: core + 1]))
        coupled = _times(gain, self.swing * rms(extra))
        if coupled <= 0.1 * (inner + direct):
            return inner, direct + coupled
        # what the lines above do to the core is computed, and only their second answer is bounded
        back = Modulation(self.problem.stiffness_harmonics, outer, core)(extra)
        inner = gain * rms(residual[: core + 1] - back)
        nearest = abs(complex(self.problem.dynamic_stiffness(core + 1)[-1]))
        share = max(1.0, float(self.weights(core + 1)[-1]) / nearest)
        spread = self.swing * rms(extra)
        return inner, direct + spread * (share + gain * self.swing / nearest)

    def _rounding(self, forces: Complex, inner: Complex, z: Complex) -> float:
        """Size of rounding errors in the residual: of D z, and of a Fourier product."""
        depth = 4 + math.log2(4 * len(z) + 2 * len(self.problem.stiffness_harmonics))
        alternating = forces.copy()
        alternating[0] = 0
        return UNIT_ROUNDOFF * (rms(inner) + rms(alternating) + depth * self.swing * rms(z))


def _times(gain: float, size: float) -> float:
    """Product in which nothing times an unknown gain is nothing."""
    return gain * size if size else 0.0
