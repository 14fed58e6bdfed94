"""How much damage a search would have noticed, had there been any.

A clean bill of health is worth what the search behind it could see. The likelihood of damage says
so itself: at a tooth that has lost some stiffness the logarithm of its ratio to that of no damage
is known on average, from the noise about every line and from how loud the path makes the response.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gearmon.diagnosis.matched import LOSSES, PATH_DEVIATION, ToothMatch

# The factor is a mean over all losses held possible, of which a quarter or so explain a departure.
_LOSSES_IN_FIVE = 5.0
# Largest logarithm of a factor that is looked for, and the steps that halve the span about it.
_LARGEST, _HALVINGS = 1e4, 40


def needed_factor(log10_probability: Callable[[float], float], log10_limit: float) -> float:
    """Find the evidence that would have been called a fault.

    Parameters
    ----------
    log10_probability : callable
        log10 of the false-alarm probability of a logarithm of a Bayes factor, never rising.
    log10_limit : float
        Limit of the verdict.

    Returns
    -------
    float
        Smallest logarithm of a factor below the limit; infinite if none up to 10,000 is.
    """
    low, high = 0.0, _LARGEST
    if log10_probability(high) > log10_limit:
        return float("inf")
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if log10_probability(middle) > log10_limit else (low, middle)
    return high


def noticed_from(match: ToothMatch, needed: float, gears: int) -> float | None:
    """Find the loss from which damage of one tooth would have been noticed.

    Parameters
    ----------
    match : ToothMatch
        The gear.
    needed : float
        Logarithm of the Bayes factor of damage of some tooth of some gear that counts as a fault.
    gears : int, >= 1
        Gears searched.

    Returns
    -------
    float or None
        Loss of the pair's stiffness; None if even the largest of `LOSSES` might not be.

    Notes
    -----
    One tooth has to overcome that all teeth, gears and losses share the prior probability. The path
    about the lines of the response is taken as weaker than its mesh harmonics tell by one standard
    deviation. On simulated machines half of the losses of this size are noticed that way, nearly
    all of twice the size and one in twenty of half the size.
    """
    needed += float(np.log(match.teeth * gears * _LOSSES_IN_FIVE))
    enough = match.expected >= needed
    if not enough.any():
        return None
    loss = float(LOSSES[int(np.argmax(enough))]) * float(np.exp(PATH_DEVIATION))
    return loss if loss <= LOSSES[-1] else None
