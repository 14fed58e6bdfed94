"""How often noise alone looks like a change: closed bounds and quantiles."""

from __future__ import annotations

import math


def tube_bound(closeness: float, length: float, dimensions: int) -> float:
    """Bound the probability that a random direction comes close to a path or its mirror image.

    Parameters
    ----------
    closeness : float, in [0, 1]
        Cosine of the angle.
    length : float, >= 0
        Length of the path on the unit sphere [rad].
    dimensions : int, >= 2
        Of the space that the sphere lies in.

    Returns
    -------
    float
        ``length / pi (1 - c^2)^(m/2 - 1) + P(B(1/2, (m - 1)/2) >= c^2)``, at most 1. Exact for a
        single direction (length 0); an upper bound for any path, close to it where it is small.

    Examples
    --------
    >>> tube_bound(0.0, 0.0, 5), round(tube_bound(0.5, 0.0, 3), 12)
    (1.0, 0.5)
    """
    from scipy.special import betainc

    rest = max(0.0, 1.0 - closeness**2)
    end = float(betainc(0.5 * (dimensions - 1), 0.5, rest))
    middle = length / math.pi * math.pow(rest, 0.5 * dimensions - 1.0)
    return min(1.0, middle + end)


def known_noise_bound(gain: float, length: float) -> float:
    """Bound the probability that noise of known size reaches as far along any direction of a path.

    Parameters
    ----------
    gain : float, >= 0
        Length of the projection, in standard deviations of the noise.
    length : float, >= 0
        Length of the path of directions on the unit sphere [rad].

    Returns
    -------
    float
        ``length / pi exp(-g^2 / 2) + erfc(g / sqrt 2)``, at most 1: the limit of `tube_bound` for
        many dimensions.

    Examples
    --------
    >>> known_noise_bound(0.0, 0.0), round(known_noise_bound(1.6448536, 0.0), 6)
    (1.0, 0.1)
    """
    end = math.erfc(gain / math.sqrt(2.0))
    return min(1.0, length / math.pi * math.exp(-0.5 * gain**2) + end)


def kink_quantile(level: float, freedom: int) -> float:
    """Return the square of Student's t that a two-sided interval at `level` takes."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.5 + 0.5 * level)) ** 2


def step_quantile(level: float, freedom: int) -> float:
    """Return how much worse, in variances, the fit of a step may be elsewhere at `level`.

    Notes
    -----
    About a small step the gain in fit is that of two independent random walks with drift, one to
    each side: ``P(gain <= x) = (1 - exp(-x/2))^2``, with the exponential averaged over the
    uncertainty of the variance, ``(1 + x / nu)^(-nu/2)``. For large steps it is conservative.
    """
    tail = 1.0 - math.sqrt(level)
    return float(freedom * math.expm1(-2.0 / freedom * math.log(tail)))
