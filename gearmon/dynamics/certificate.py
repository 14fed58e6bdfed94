"""Residual of the full equation, and the bound of the relative error that follows from it.

An approximation z_0..z_N leaves a residual r_0..r_{N+J}, all of which is computed. Above a core of
harmonics 0..n', beyond which |D_n| dominates max|phi|, it is answered explicitly, e' = r_n/D_n for
n > n'; what then remains is s = r_0..r_n' less phi e', and

    ||error of acceleration|| <= ||e''|| + gain (||r_0..r_n'|| + max|phi| ||e'|| + rounding)

with the gain of `error_bound`; or, with s answered once more above the core,

    ||e''|| + gain (||s_0..s_n'|| + max|phi|^2 ||e'||/|D_n'+1| + rounding)
           + max|phi| ||e'|| max_{n>n'} (n/R)^2/|D_n|.

So high harmonics, solved for or not, cost what they are worth and not the gain of a resonance they
have no part in. One problem is a `HillProblem`; `Sets` are many that share a pattern of stiffness.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import cast

import numpy as np

from gearmon.dynamics.error_bound import Gain, Pattern, best_gain, convergence
from gearmon.dynamics.fourier import (
    FEWEST_FOR_A_MATRIX,
    Complex,
    Modulation,
    Real,
    rms_of_each,
)
from gearmon.dynamics.hill import NO_HARMONICS, HillProblem

UNIT_ROUNDOFF = 2.0**-52


@dataclass(frozen=True, kw_only=True, eq=False)
class Sets:
    """Many problems that share a pattern of stiffness, under a unit of static deflection.

    Attributes
    ----------
    frequency_ratio, damping_ratio, scale : float ndarray, shape (B, 1)
        R, damping ratio, and the factor of phi.
    """

    frequency_ratio: Real
    damping_ratio: Real
    scale: Real
    stiffness_harmonics: Complex
    force_harmonics_n: Complex = field(default_factory=lambda: NO_HARMONICS)

    def dynamic_stiffness(self, highest: int) -> Complex:
        """D_n, shape (B, highest+1)."""
        x = np.arange(highest + 1) / self.frequency_ratio
        return np.asarray((1 - x**2) + 2j * self.damping_ratio * x)

    def static_forcing(self, highest: int) -> Complex:
        """One and zeros, shape (highest+1,)."""
        return np.asarray(np.arange(highest + 1) == 0, dtype=complex)


@dataclass(frozen=True, kw_only=True)
class Bound:
    """What is known of the error of approximations; rms of acceleration over w0^2 [m].

    Attributes
    ----------
    relative : float ndarray
        Guaranteed relative L2 error of the acceleration; may be infinite.
    size : float ndarray
        Rms of the acceleration handed out.
    core, above, rounding : float ndarray
        Shares of the bound of the rms error: residual of the core, of all harmonics above it, and
        rounding.
    """

    relative: Real
    size: Real
    core: Real
    above: Real
    rounding: Real

    @property
    def total(self) -> Real:
        """Bound of the rms error."""
        return self.core + self.above + self.rounding


@dataclass(frozen=True, kw_only=True)
class Approximation:
    """An approximate steady vibration z = start + dynamic, and how good it is.

    Attributes
    ----------
    start : complex ndarray, shape (..., N+1)
        g_n/D_n, the answer to the forces alone [m]; apart, so that a vibration far smaller than
        F/k0 keeps its digits.
    dynamic : complex ndarray, shape (..., N+1)
        The rest [m].
    residual : complex ndarray, shape (..., N+J+1)
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
        return int(self.start.shape[-1]) - 1


class Certifier:
    """Residuals and error bounds of approximations to one problem, or to many at once.

    Parameters
    ----------
    problem : HillProblem or Sets
        The equation.
    shown : int, optional
        Harmonics 0..shown are handed out, others dropped; default all.
    gain : Gain, optional
        Of the inverse operators, if it is known.
    pattern : Pattern, optional
        Of the stiffness harmonics, if it is known.
    """

    def __init__(
        self,
        problem: HillProblem | Sets,
        shown: int | None = None,
        gain: Gain | None = None,
        pattern: Pattern | None = None,
    ) -> None:
        #: `Sets` has all that is asked of a problem here
        self.problem = cast(HillProblem, problem)
        self.shown = shown
        self.pattern = pattern or Pattern(problem.stiffness_harmonics)
        self.ratio, self.zeta = (
            np.atleast_1d(x) for x in (problem.frequency_ratio, problem.damping_ratio)
        )
        #: factor of phi, shape (1,) or (B, 1)
        self.scale: Real = problem.scale if isinstance(problem, Sets) else np.ones(1)
        self.sets = 1 if self.ratio.ndim == 1 else len(self.ratio)
        self._stiffness: Complex = np.zeros(0, dtype=complex)
        self._weights: Real = np.zeros(0)
        if gain is not None:
            self.gain = gain

    @cached_property
    def gain(self) -> Gain:
        """Bound of the inverse operator; the cheap one where it is good."""
        ratio, zeta, scale = (np.atleast_1d(x[..., 0]) for x in (self.ratio, self.zeta, self.scale))
        found = best_gain(ratio, zeta, scale, self.pattern)
        if self.ratio.ndim > 1:
            return found
        return Gain(
            acceleration=found.acceleration[0], stable=found.stable[0], growth=found.growth[0]
        )

    @cached_property
    def swing(self) -> Real:
        """Bound of max|phi|."""
        return np.asarray(self.scale[..., 0] * self.pattern.highest)

    @cached_property
    def convergence(self) -> Real:
        """Factor an order of the expansion about the middle of the stiffness."""
        return convergence(self.zeta[..., 0], self.scale[..., 0], self.pattern)

    def product(self, inputs: int, outputs: int, middle: float = 0.0) -> Modulation:
        """Multiplication by phi/scale - middle; kept for all sets that share phi."""
        key = inputs, outputs, middle, self.sets >= FEWEST_FOR_A_MATRIX
        if key not in self.pattern.products:
            c = self.problem.stiffness_harmonics
            self.pattern.products[key] = Modulation(c, inputs, outputs, self.sets, middle)
        return self.pattern.products[key]

    def modulate(self, half: Complex, outputs: int) -> Complex:
        """Harmonics 0..outputs of phi times a function."""
        product = self.product(half.shape[-1] - 1, outputs)(half)
        if self.ratio.ndim > 1:
            product *= self.scale
        return product

    def weights(self, highest: int) -> Real:
        """(n/R)^2: acceleration over w0^2 z, shape (..., highest+1)."""
        if self._weights.shape[-1] <= highest:
            self._weights = (np.arange(highest + 1) / self.ratio) ** 2
        return self._weights[..., : highest + 1]

    def stiffness(self, highest: int) -> Complex:
        """D_n of the lines 0..highest, relative to k0, shape (..., highest+1)."""
        if self._stiffness.shape[-1] <= highest:
            self._stiffness = self.problem.dynamic_stiffness(highest)
        return self._stiffness[..., : highest + 1]

    @cached_property
    def core(self) -> int:
        """Harmonic above which |D_n| >= 10 max|phi| and 10: there each order gains a digit."""
        reach = self.ratio[..., 0] * np.sqrt(1 + 10 * np.maximum(1.0, self.swing))
        return math.ceil(float(reach.max()))

    def judge(self, dynamic: Complex, orders: int = 0) -> Approximation:
        """Compute residual and bound of z = g/D + dynamic, shape (..., N+1)."""
        highest = int(dynamic.shape[-1]) - 1
        c = self.problem.stiffness_harmonics
        self.weights(highest + len(c))
        stiffness = self.stiffness(highest + len(c))[..., : highest + 1]
        start, forcing = self.answer_to_forces(highest)
        swinging = start + dynamic
        mean = swinging[..., :1].real.copy()
        swinging[..., 0] = 0
        residual = self.modulate(swinging, highest + len(c))
        # phi times the large mean deflection is known without a transform and its rounding
        residual[..., 1 : len(c) + 1] += mean * self.scale * c
        moved = stiffness * dynamic
        residual[..., : highest + 1] += moved
        np.negative(residual, out=residual)
        # rounding of D z, of the forces and of a product, by transforms or by a matrix
        length = 4 * (highest + 1) + 2 * len(c)
        depth = 4 + (math.log2(length) if self.sets == 1 else length)
        forcing[0] = 0
        rounding = rms_of_each(moved) + rms_of_each(forcing)
        rounding = rounding + depth * self.swing * rms_of_each(swinging)
        rounding = rounding + np.abs(mean[..., 0]) * self.scale[..., 0] * self.pattern.size
        swinging[..., :1] = mean
        bound = self._bound(swinging, residual, UNIT_ROUNDOFF * rounding)
        return Approximation(
            start=start, dynamic=dynamic, residual=residual, bound=bound, orders=orders
        )

    def answer_to_forces(self, highest: int) -> tuple[Complex, Complex]:
        """g_n/D_n, shape (..., highest+1), and g_n, shape (highest+1,)."""
        forcing = self.problem.static_forcing(highest)
        stiffness = self.stiffness(highest)
        forced = np.flatnonzero(forcing)
        start = np.zeros(stiffness.shape, dtype=complex)
        start[..., forced] = forcing[forced] / stiffness[..., forced]
        return start, forcing

    def answer(self, residual: Complex, above: int) -> Complex:
        """First-order answer to the residual above a harmonic, r_n/D_n; 0 up to it."""
        extra = np.zeros_like(residual)
        outer = slice(above + 1, residual.shape[-1])
        stiffness = self.stiffness(residual.shape[-1] - 1)
        extra[..., outer] = residual[..., outer] / stiffness[..., outer]
        return extra

    def size(self, half: Complex) -> Real:
        """Rms acceleration over w0^2 of the harmonics of a deflection that are handed out."""
        highest = half.shape[-1] - 1
        last = highest if self.shown is None else min(self.shown, highest)
        return rms_of_each((self.weights(last)) * half[..., : last + 1])

    def sharpened(self, found: Approximation, better: Approximation) -> Approximation:
        """Bound the error of `found` by its distance from `better` and the error of that one."""
        apart = np.zeros(max(found.highest, better.highest) + 1, dtype=complex)
        apart[: better.highest + 1] = better.start + better.dynamic
        size = self.size(apart)
        apart[: found.highest + 1] -= found.start + found.dynamic
        left = better.bound.total
        if not left < size:
            return found
        relative = np.minimum(found.bound.relative, (self.size(apart) + left) / (size - left))
        return replace(found, bound=replace(found.bound, relative=relative))

    def _bound(self, z: Complex, residual: Complex, rounding: Real) -> Bound:
        highest = int(z.shape[-1]) - 1
        # of many sets the short bound, about all lines solved for, costs half the time
        inner, above = self._shares(
            residual, min(self.core, highest) if self.sets == 1 else highest
        )
        bound = Bound(
            relative=np.zeros(()),
            size=self.size(z),
            core=inner,
            above=above,
            rounding=_times(self.gain.acceleration, rounding),
        )
        total, size = bound.total, bound.size
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = np.where(total < size, total / (size - total), np.inf)
        return replace(bound, relative=np.where(total == 0, 0.0, relative))

    def _shares(self, residual: Complex, core: int) -> tuple[Real, Real]:
        """Bounds of the error that residuals of the core and above it cause."""
        gain = self.gain.acceleration
        extra = self.answer(residual, core)
        direct = self.size(extra)
        inner = _times(gain, rms_of_each(residual[..., : core + 1]))
        spread = self.swing * rms_of_each(extra)
        coupled = _times(gain, spread)
        if self.sets > 1 or (coupled <= 0.1 * (inner + direct)).all():
            return inner, direct + coupled
        # what the lines above do to the core is computed, and only their second answer is bounded
        back = self.modulate(extra, core)
        nearest = np.abs(self.stiffness(core + 1)[..., -1])
        share = np.maximum(1.0, self.weights(core + 1)[..., -1] / nearest)
        second = _times(gain, rms_of_each(residual[..., : core + 1] - back))
        beyond = direct + spread * share + _times(gain, spread * self.swing / nearest)
        better = second + beyond < inner + direct + coupled
        return (second, beyond) if better else (inner, direct + coupled)


def _times(gain: Real, size: Real) -> Real:
    """Product in which nothing times an unknown gain is nothing."""
    with np.errstate(invalid="ignore"):
        return np.where(size > 0, gain * size, 0.0)
