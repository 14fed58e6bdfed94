"""How far levels of lines scatter because a change of speed moves them across resonances."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError, check_finite, check_positive
from gearmon.signatures.measured.line_plan import Family

FloatArray = NDArray[np.float64]

# Standard deviation of the level of one line through a path of many modes [dB].
_FIELD_DB = 10 / math.log(10) * math.pi / math.sqrt(6)
DAMPING_RATIO = 0.02


def speed_scatter_db(
    relative_change: float, damping_ratio: float = DAMPING_RATIO, independent: float = 1.0
) -> float:
    """Return the standard deviation of the change of a level when the speed changes.

    Parameters
    ----------
    relative_change : float
        Change of speed over speed, of either sign.
    damping_ratio : float, > 0
        Damping ratio of the modes on the way to the sensor; of built-up gear cases 0.01 to 0.03.
    independent : float, > 0
        Lines and channels whose powers were averaged, counted as independent.

    Returns
    -------
    float
        0 dB at equal speeds; with one line it rises to 7.9 dB.

    Notes
    -----
    A path of many overlapping modes has a complex Gaussian response, whose correlation between two
    frequencies that differ by the share d is 1 / (1 + i d / (2 zeta)): the Fourier transform of its
    decay exp(-2 zeta w t). The squared moduli then correlate by rho = 1 / (1 + (d / (2 zeta))^2),
    and their logarithms, whose variance is pi^2/6, have the covariance Li2(rho), so that

        sigma = (10 / ln 10) sqrt(2 (pi^2/6 - Li2(rho))).

    Valid above the first modes; below them a line moves less. For a mean over several lines the
    standard deviation is taken to fall as one over the square root.

    References
    ----------
    Schroeder, Frequency-correlation functions of frequency responses in rooms, J. Acoust. Soc. Am.
    34 (1962) 1819-1823.
    """
    from scipy.special import spence

    check_positive("damping_ratio", damping_ratio)
    check_positive("independent", independent)
    shift = check_finite("relative_change", relative_change) / (2 * damping_ratio)
    rho = 1 / (1 + shift**2)
    # spence(1 - x) is the dilogarithm Li2(x)
    left = max(0.0, 1 - 6 / math.pi**2 * float(spence(1 - rho)))
    return _FIELD_DB * math.sqrt(2 * left / independent)


def independent_lines(orders: FloatArray, damping_ratio: float = DAMPING_RATIO) -> float:
    """Count lines as independent: those within the bandwidth of a mode rise and fall together.

    Parameters
    ----------
    orders : ndarray of float, shape (lines,)
        Orders or frequencies of the lines, > 0, at least one.
    damping_ratio : float, > 0
        Damping ratio of the modes.

    Returns
    -------
    float
        From 1, for lines close together, to their number, for lines far apart.

    Raises
    ------
    ArgumentError
        If there is no line or one is not above zero.

    Notes
    -----
    The variance of the mean of n powers whose pairs correlate by rho_ij is sum(rho_ij) / n^2 times
    that of one; rho = 1 / (1 + (d / (2 zeta))^2), d the distance of the lines over their mean.
    """
    check_positive("damping_ratio", damping_ratio)
    lines = np.asarray(orders, dtype=float).ravel()
    if len(lines) == 0 or not (lines > 0).all():
        raise ArgumentError("orders: at least one, all > 0, are needed")
    apart = (lines[:, None] - lines) / (0.5 * (lines[:, None] + lines))
    rho = 1 / (1 + (apart / (2 * damping_ratio)) ** 2)
    return float(len(lines) ** 2 / rho.sum())


def family_speed_scatter_db(
    families: Sequence[Family],
    orders: FloatArray,
    speed_hz: float,
    healthy_hz: Iterable[float],
    damping_ratio: float = DAMPING_RATIO,
) -> FloatArray:
    """Return how far the level of each family may move because the speed is another one.

    Parameters
    ----------
    families : sequence of Family
        Groups of lines.
    orders : ndarray of float
        Orders of the plan that their lines point into.
    speed_hz : float
        Speed of the new recording [Hz].
    healthy_hz : iterable of float
        Speeds of the healthy recordings [Hz], at least one; the nearest counts.
    damping_ratio : float, > 0
        Damping ratio of the modes.

    Returns
    -------
    ndarray of float, shape (families,)
        Standard deviation [dB], to be added in squares to the standard errors of the levels.

    Raises
    ------
    ArgumentError
        If there is no healthy speed, or one is not above zero.
    """
    speeds = [check_positive("healthy_hz", speed, "Hz") for speed in healthy_hz]
    if not speeds:
        raise ArgumentError("healthy_hz: at least one speed is needed")
    change = min(abs(check_positive("speed_hz", speed_hz, "Hz") / speed - 1) for speed in speeds)
    return np.array(
        [
            speed_scatter_db(
                change, damping_ratio, independent_lines(orders[list(f.lines)], damping_ratio)
            )
            for f in families
        ]
    )
