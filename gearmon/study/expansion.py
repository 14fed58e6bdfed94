"""The orders of the multiple scale expansion of the reference case beside the exact solution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearmon.dynamics import Response
from gearmon.dynamics.fourier import rms
from gearmon.dynamics.multiple_scales import Expansion, expand
from gearmon.gears.pulses import FloatArray
from gearmon.study.reference_case import REFERENCE
from gearmon.study.sweeps import acceleration_error, solved, waveform_error

#: Orders that are solved and drawn; the published solution ends at the second.
HIGHEST_ORDER = 6
PUBLISHED_ORDER = 2
# Below the published variation the error falls by its order; above, the next orders mix in.
VARIATIONS = (0.0125, 0.025, 0.05, 0.1)


@dataclass(frozen=True, kw_only=True, eq=False)
class OrderStudy:
    """Orders 0, 1, 2 ... of the reference case.

    Attributes
    ----------
    expansion : Expansion
    exact : Response
    displacement_errors : ndarray, shape (HIGHEST_ORDER + 1,)
        Largest error of the waveform of each order's sum, over the largest displacement.
    acceleration_errors : ndarray, same shape
        Relative L2 error of the acceleration.
    variations : ndarray, shape (V,)
        Values of eps.
    errors_of_variation : ndarray, shape (V, HIGHEST_ORDER + 1)
        RMS error of the displacement over F/k0.
    slopes : ndarray, shape (HIGHEST_ORDER + 1,)
        Power of eps with which that error falls.
    """

    expansion: Expansion
    exact: Response
    displacement_errors: FloatArray
    acceleration_errors: FloatArray
    variations: FloatArray
    errors_of_variation: FloatArray
    slopes: FloatArray


def study_orders() -> OrderStudy:
    """Expand the reference case and measure the error of every order, and its power of eps."""
    problem = REFERENCE.problem()
    exact, expansion = solved(problem), expand(problem, HIGHEST_ORDER)
    sums = np.cumsum(expansion.terms, axis=0)
    errors = np.array([_errors(variation) for variation in VARIATIONS])
    logs = np.log(VARIATIONS)
    return OrderStudy(
        expansion=expansion,
        exact=exact,
        displacement_errors=np.array([waveform_error(z, exact) for z in sums]),
        acceleration_errors=np.array([acceleration_error(z, exact) for z in sums]),
        variations=np.array(VARIATIONS),
        errors_of_variation=errors,
        slopes=np.array([np.polyfit(logs, np.log(column), 1)[0] for column in errors.T]),
    )


def _errors(variation: float) -> FloatArray:
    problem = REFERENCE.with_value("variation", variation).problem()
    exact = expand(problem, 4 * HIGHEST_ORDER, 300).displacement
    sums = np.cumsum(expand(problem, HIGHEST_ORDER, 300).terms, axis=0)
    return np.array([rms(z - exact) for z in sums]) / REFERENCE.static_deflection_m
