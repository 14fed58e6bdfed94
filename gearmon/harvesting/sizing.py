"""Dimensions of a cantilever for a wanted natural frequency."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal, get_args

from gearmon.errors import ArgumentError, check_positive
from gearmon.harvesting.cantilever import PiezoCantilever

Dimension = Literal["tip_mass_kg", "length_m", "passive_thickness_m", "piezo_thickness_m"]


def sized_for(
    beam: PiezoCantilever,
    frequency_hz: float,
    dimension: Dimension = "tip_mass_kg",
    low: float | None = None,
    high: float | None = None,
) -> PiezoCantilever:
    """Change one dimension so that the first natural frequency (short-circuited) is as wanted.

    Parameters
    ----------
    beam : PiezoCantilever
    frequency_hz : float, > 0
    dimension : {"tip_mass_kg", "length_m", "passive_thickness_m", "piezo_thickness_m"}
        What may change.
    low, high : float, optional
        Its range; by default 0 to the largest tip mass, or a fifth to five times what it is.

    Returns
    -------
    PiezoCantilever

    Raises
    ------
    ArgumentError
        If no value in the range gives that frequency; the message names the nearest possible.

    Notes
    -----
    Found by bisection: each of these moves the frequency one way only, but the piezoelectric
    thickness of a stiff beam, for which the range may hold two answers or none.
    """
    check_positive("frequency_hz", frequency_hz, "Hz")
    if dimension not in get_args(Dimension):
        raise ArgumentError(
            f"dimension={dimension!r} must be one of {', '.join(get_args(Dimension))}"
        )
    now = getattr(beam, dimension)
    least = low if low is not None else (0.0 if dimension == "tip_mass_kg" else now / 5)
    most = high if high is not None else _most(beam, dimension, now)
    if not least < most:
        raise ArgumentError(f"{dimension}: low={least:g} must be less than high={most:g}")

    def frequency(value: float) -> float:
        # dataclasses.replace knows no types for a name that is chosen at run time
        return replace(beam, **{dimension: value}).natural_frequency_hz  # type: ignore[arg-type]

    ends = frequency(least), frequency(most)
    if not min(ends) <= frequency_hz <= max(ends):
        nearest = least if abs(ends[0] - frequency_hz) < abs(ends[1] - frequency_hz) else most
        raise ArgumentError(
            f"frequency_hz={frequency_hz:.6g} Hz is out of reach: {dimension} from {least:.4g} to "
            f"{most:.4g} gives {min(ends):.6g} to {max(ends):.6g} Hz; nearest at {nearest:.4g}"
        )
    from scipy.optimize import brentq

    found = brentq(lambda value: math.log(frequency(value) / frequency_hz), least, most, xtol=1e-14)
    return replace(beam, **{dimension: float(found)})  # type: ignore[arg-type]


def _most(beam: PiezoCantilever, dimension: str, now: float) -> float:
    if dimension == "tip_mass_kg":
        return beam.most_tip_mass_kg
    if dimension == "length_m":
        return 5 * now
    # thin-beam theory ends where the length is five times the thickness
    return min(5 * now, now + (beam.length_m / 5 - beam.thickness_m) / 2)
