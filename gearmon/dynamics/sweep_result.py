"""Steady vibrations of many Hill problems, as arrays over a grid of values."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gearmon.dynamics.fourier import Complex, Real
from gearmon.dynamics.hill import HillProblem, Response
from gearmon.dynamics.sweep_groups import UNSOLVED
from gearmon.errors import ArgumentError

METHODS = np.array(["msm", "msm resonant", "harmonic balance", "refused", "one by one"])
ONE_BY_ONE = 4


@dataclass(frozen=True, kw_only=True, eq=False)
class Sweep:
    """Steady vibrations over a grid of values; `...` is the shape that all values broadcast to.

    Attributes
    ----------
    mass_kg, damping_ns_per_m, stiffness_n_per_m, period_s, force_n, scale : float ndarray, (...)
        Values of each set, as in `HillProblem`; `scale` multiplies its stiffness variation.
    stiffness_harmonics : complex ndarray, shape (J,) or (..., J)
        c_1..c_J for scale 1.
    tolerance : float
        What was aimed at.
    displacement : complex ndarray, shape (..., N+1)
        z_0..z_N [m] as in `Response`, zero above what a set takes; nan where refused.
    error_bound : float ndarray, shape (...)
        Guaranteed relative L2 error of the acceleration; infinite where refused.
    stable : bool ndarray, shape (...)
        Whether free vibrations die out for certain.
    method : str ndarray, shape (...)
        "msm": orders alone. "msm resonant": with the harmonics near the natural frequency solved
        together. "harmonic balance". "one by one": `steady_state`. "refused".
    reason : object ndarray of str, shape (...)
        Empty where the tolerance is met, else one line that says why it is not.
    """

    mass_kg: Real
    damping_ns_per_m: Real
    stiffness_n_per_m: Real
    period_s: Real
    force_n: Real
    scale: Real
    stiffness_harmonics: Complex
    tolerance: float
    displacement: Complex
    error_bound: Real
    stable: npt.NDArray[np.bool_]
    method: npt.NDArray[np.str_]
    reason: npt.NDArray[np.object_]

    @property
    def met(self) -> npt.NDArray[np.bool_]:
        """Where the tolerance is met for certain, shape (...)."""
        return np.asarray(self.error_bound <= self.tolerance)

    @property
    def velocity(self) -> Complex:
        """Velocity i n w z_n [m/s], shape (..., N+1)."""
        return 1j * self._angular * self.displacement

    @property
    def acceleration(self) -> Complex:
        """Acceleration -(n w)^2 z_n [m/s2], shape (..., N+1)."""
        return -(self._angular**2) * self.displacement

    def problem(self, index: int | tuple[int, ...]) -> HillProblem:
        """Return one set by itself.

        Parameters
        ----------
        index : int or tuple of int
            Its place in the grid.
        """
        harmonics = self.stiffness_harmonics
        if harmonics.ndim > 1:
            harmonics = harmonics[index]
        return HillProblem(
            float(self.mass_kg[index]),
            float(self.damping_ns_per_m[index]),
            float(self.stiffness_n_per_m[index]),
            self.scale[index] * harmonics,
            float(self.period_s[index]),
            float(self.force_n[index]),
        )

    def response(self, index: int | tuple[int, ...]) -> Response:
        """Vibration of one set, with mesh force, contact loss and the rest of `Response`.

        Parameters
        ----------
        index : int or tuple of int
            Its place in the grid.

        Raises
        ------
        ArgumentError
            If the set was refused.
        """
        if self.method[index] == METHODS[UNSOLVED]:
            raise ArgumentError(f"set {index} has no steady state here: {self.reason[index]}")
        bound = float(self.error_bound[index])
        return Response(
            problem=self.problem(index),
            displacement=self.displacement[index],
            error_bound=bound,
            method=str(self.method[index]),
            order=0,
            stable=bool(self.stable[index]),
            message=self.reason[index] or f"swept: error bound {bound:.2g}",
        )

    @property
    def _angular(self) -> Real:
        lines = np.arange(self.displacement.shape[-1])
        return np.asarray(2 * math.pi * lines / self.period_s[..., None])
