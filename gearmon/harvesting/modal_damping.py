"""Damping of the modes of a beam."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError, check_range

Real = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ModalDamping:
    """Damping ratio of each mode: z_r = constant + mass_rate/(2 w_r) + stiffness_time w_r/2.

    Parameters
    ----------
    constant : float, 0 to 1
    mass_rate_per_s : float, >= 0
        Of drag in proportion to mass [1/s].
    stiffness_time_s : float, >= 0
        Of strain-rate damping in proportion to stiffness [s].

    Raises
    ------
    ArgumentError
        If a value is out of its range, or all are 0.
    """

    constant: float = 0.0
    mass_rate_per_s: float = 0.0
    stiffness_time_s: float = 0.0

    def __post_init__(self) -> None:
        check_range("constant", self.constant, 0.0, 1.0)
        check_range("mass_rate_per_s", self.mass_rate_per_s, 0.0, 1e6, "1/s")
        check_range("stiffness_time_s", self.stiffness_time_s, 0.0, 1.0, "s")
        if self.constant + self.mass_rate_per_s + self.stiffness_time_s == 0:
            raise ArgumentError("damping: all parts are 0, at least one must be > 0")

    def ratios(self, natural: Real) -> Real:
        """Damping ratios for natural circular frequencies [rad/s]."""
        return (
            self.constant
            + self.mass_rate_per_s / (2 * natural)
            + self.stiffness_time_s * natural / 2
        )
