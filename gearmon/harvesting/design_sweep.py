"""Energy lines and the best harvester over a grid of stiffness, mass and damping of a gear pair."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.sweep import sweep
from gearmon.errors import ArgumentError, check_positive
from gearmon.harvesting.gains import Harvester
from gearmon.harvesting.tuning_sweep import SweepTuning, tune_sweep

Real = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class DesignSweep:
    """Energy lines of many designs, and the best tuning for each.

    Attributes
    ----------
    mass_kg, damping_ns_per_m, stiffness_n_per_m : ndarray, shape (...)
        Of each design.
    frequency_hz : ndarray, shape (n,)
        Mesh harmonics.
    energy_j_per_kg : ndarray, shape (..., n)
        E_i = (2 pi f_i A_i)^2/2.
    tuning : SweepTuning
        Best natural frequency, load and power of each design.
    """

    mass_kg: Real
    damping_ns_per_m: Real
    stiffness_n_per_m: Real
    frequency_hz: Real
    energy_j_per_kg: Real
    tuning: SweepTuning

    @property
    def total_j_per_kg(self) -> Real:
        """Sum of the lines of each design [J/kg], shape (...)."""
        return np.asarray(self.energy_j_per_kg.sum(axis=-1))

    def operating_lines(self, count: int = 3) -> tuple[Real, Real]:
        """Most energetic lines of each design, the best first.

        Parameters
        ----------
        count : int, 1 to n

        Returns
        -------
        frequency_hz, share : ndarray, shape (..., count)
            Frequency [Hz] and share of the energy of all lines.

        Raises
        ------
        ArgumentError
            If there are not so many lines.
        """
        if not 1 <= count <= len(self.frequency_hz):
            raise ArgumentError(f"count={count} must lie in [1, {len(self.frequency_hz)}]")
        largest = np.argsort(-self.energy_j_per_kg, axis=-1, kind="stable")[..., :count]
        energy = np.take_along_axis(self.energy_j_per_kg, largest, axis=-1)
        return self.frequency_hz[largest], energy / self.total_j_per_kg[..., None]

    def rows(self) -> list[dict[str, Any]]:
        """Return one row a design: its values, best and next line with their shares, tuning."""
        frequency, share = self.operating_lines(2)
        columns = {
            "stiffness_n_per_m": self.stiffness_n_per_m,
            "mass_kg": self.mass_kg,
            "damping_ns_per_m": self.damping_ns_per_m,
            "energy_j_per_kg": self.total_j_per_kg,
            "best_line_hz": frequency[..., 0],
            "best_share": share[..., 0],
            "next_line_hz": frequency[..., 1],
            "next_share": share[..., 1],
            "tuned_to_hz": self.tuning.natural_frequency_hz,
            "load": self.tuning.load,
            "power_w": self.tuning.power_w,
        }
        flat = {name: np.ravel(values).tolist() for name, values in columns.items()}
        return [dict(zip(flat, row, strict=True)) for row in zip(*flat.values(), strict=True)]


def sweep_designs(
    harvester: Harvester,
    *,
    mass_kg: npt.ArrayLike,
    damping_ns_per_m: npt.ArrayLike,
    stiffness_n_per_m: npt.ArrayLike,
    stiffness_harmonics: npt.ArrayLike,
    period_s: float,
    force_n: float,
    highest_hz: float = 12_000.0,
    gain: float = 1.0,
    tolerance: float = 1e-6,
) -> DesignSweep:
    """Solve gear pairs over a grid of values and tune a harvester for each.

    Parameters
    ----------
    harvester : InertialHarvester or PiezoCantilever
    mass_kg, damping_ns_per_m, stiffness_n_per_m : array
        As in `HillProblem`, of shapes that broadcast together to (...).
    stiffness_harmonics : complex array, shape (J,)
        c_1..c_J.
    period_s, force_n : float, > 0
        Mesh period [s] and mean force [N].
    highest_hz : float, > 0
        Mesh harmonics above it are left out.
    gain : float, > 0
        Acceleration at the harvester over that along the line of action.
    tolerance : float
        Relative error of the acceleration.

    Raises
    ------
    ArgumentError
        If a value is out of its range, a design has no steady state, or no line is within reach.
    """
    check_positive("gain", gain)
    check_positive("highest_hz", highest_hz, "Hz")
    found = sweep(
        mass_kg,
        damping_ns_per_m,
        stiffness_n_per_m,
        stiffness_harmonics,
        period_s,
        force_n,
        tolerance=tolerance,
    )
    if not np.isfinite(found.displacement[..., 0]).all():
        first = tuple(int(i) for i in np.argwhere(~np.isfinite(found.displacement[..., 0]))[0])
        raise ArgumentError(
            f"design {first} (mass {found.mass_kg[first]:g} kg, damping "
            f"{found.damping_ns_per_m[first]:g} N s/m, stiffness "
            f"{found.stiffness_n_per_m[first]:g} N/m): {found.reason[first]}"
        )
    count = min(found.displacement.shape[-1] - 1, math.floor(highest_hz * period_s))
    if count < 2:
        raise ArgumentError(
            f"highest_hz={highest_hz:g} Hz must hold two mesh harmonics, {2 / period_s:.6g} Hz"
        )
    frequency = np.arange(1, count + 1) / period_s
    power = 2 * np.abs(gain * found.acceleration[..., 1 : count + 1]) ** 2
    return DesignSweep(
        mass_kg=found.mass_kg,
        damping_ns_per_m=found.damping_ns_per_m,
        stiffness_n_per_m=found.stiffness_n_per_m,
        frequency_hz=frequency,
        energy_j_per_kg=power / (2 * math.pi * frequency) ** 2,
        tuning=tune_sweep(harvester, frequency, power),
    )
