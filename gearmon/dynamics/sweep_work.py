"""Solve the sets of a sweep: together where they share a pattern, else one by one."""

from __future__ import annotations

import math

import numpy as np

from gearmon.dynamics.fourier import Complex, Real
from gearmon.dynamics.hill import HillProblem
from gearmon.dynamics.steady_state import steady_state
from gearmon.dynamics.sweep_bounds import Sets
from gearmon.dynamics.sweep_groups import MSM, UNSOLVED, SharedPattern
from gearmon.dynamics.sweep_orders import INDICES
from gearmon.dynamics.sweep_result import ONE_BY_ONE
from gearmon.dynamics.sweep_stability import settle

EVERY_HARMONIC = 1 << 30


class SweepWork:
    """Results of the sets of one substitution, filled in pattern by pattern.

    Parameters
    ----------
    values : dict of str to float ndarray, shape (sets,)
        Values of each set, as in `HillProblem`, and `scale`.
    tolerance : float
        Relative L2 error of the acceleration to be met.
    shown : int
        Highest response harmonic wanted, `EVERY_HARMONIC` for all.
    """

    def __init__(self, values: dict[str, Real], tolerance: float, shown: int) -> None:
        self.values, self.tolerance, self.shown = values, tolerance, shown
        mass, stiffness = values["mass_kg"], values["stiffness_n_per_m"]
        self.ratio = np.sqrt(stiffness / mass) * values["period_s"] / (2 * math.pi)
        self.zeta = values["damping_ns_per_m"] / (2 * np.sqrt(stiffness * mass))
        count = len(mass)
        self.bound = np.full(count, np.inf)
        self.stable = np.zeros(count, dtype=bool)
        self.method = np.full(count, UNSOLVED, dtype=np.int8)
        self.reason = np.full(count, "", dtype=object)
        self._parts: list[tuple[INDICES, Complex]] = []

    def displacement(self) -> Complex:
        """Deflections [m] of all sets, nan where there are none."""
        wanted = 0 if self.shown == EVERY_HARMONIC else self.shown
        highest = max([wanted, *(half.shape[1] - 1 for _, half in self._parts)])
        if len(self._parts) == 1 and self._parts[0][1].shape == (len(self.bound), highest + 1):
            whole = self._parts[0][1]
        else:
            whole = np.zeros((len(self.bound), highest + 1), dtype=complex)
            for sets, half in self._parts:
                whole[sets, : half.shape[1]] = half
                whole[sets, half.shape[1] :] = 0
        whole *= (self.values["force_n"] / self.values["stiffness_n_per_m"])[:, None]
        whole[self.method == UNSOLVED] = np.nan
        return whole

    def together(self, pattern: SharedPattern, at: INDICES) -> None:
        """Settle, solve and judge the sets `at`, whose stiffness follows the pattern."""
        scale = self.values["scale"][at]
        settled = settle(self.ratio[at], self.zeta[at], scale, pattern.swing)
        self.stable[at] = settled.stable
        for i in np.flatnonzero(~np.isnan(settled.growth)):
            self.reason[at[i]] = _why_unstable(float(settled.growth[i]))
        still = np.asarray(scale * pattern.swing.highest == 0) & settled.stable
        if still.any():
            self.bound[at[still]], self.method[at[still]] = 0.0, MSM
            self._parts.append((at[still], np.ones((np.count_nonzero(still), 1), dtype=complex)))
        known = np.flatnonzero(np.isfinite(settled.gain) & settled.stable & ~still)
        for i in np.flatnonzero(np.isinf(settled.gain) & np.isnan(settled.growth)):
            self.reason[at[i]] = "no error bound could be given: the inverse operator is unbounded"
        if not len(known):
            return
        chosen = at[known]
        sets = Sets(
            ratio=self.ratio[chosen],
            zeta=self.zeta[chosen],
            scale=scale[known],
            gain=settled.gain[known],
        )
        found = pattern.solve(sets, self.tolerance, self.shown)
        self._parts.append((chosen, found.spectra(self.shown)))
        self.bound[chosen], self.method[chosen] = found.bound, found.method
        for i in chosen[found.bound > self.tolerance]:
            self.alone(int(i), pattern.swing.harmonics)

    def alone(self, i: int, harmonics: Complex) -> None:
        """One set by `steady_state`."""
        values = self.values
        stiffness = float(values["stiffness_n_per_m"][i])
        problem = HillProblem(
            float(values["mass_kg"][i]),
            float(values["damping_ns_per_m"][i]),
            stiffness,
            values["scale"][i] * harmonics,
            float(values["period_s"][i]),
            stiffness,
        )
        shown = None if self.shown == EVERY_HARMONIC else self.shown
        response = steady_state(problem, self.tolerance, harmonics=shown)
        self.stable[i] = response.stable is True
        if response.error_bound < self.bound[i]:
            self.bound[i], self.method[i] = response.error_bound, ONE_BY_ONE
            self._parts.append((np.array([i]), np.array(response.displacement)[None]))
        if self.bound[i] > self.tolerance:
            self.reason[i] = response.message


def _why_unstable(growth: float) -> str:
    if math.isinf(growth):
        return "undamped: free vibrations never die out, so no steady state is reached"
    return (
        f"unstable: free vibrations grow by {math.exp(min(growth, 700.0)):.6g} a period (largest "
        "Floquet multiplier), so there is no steady state"
    )
