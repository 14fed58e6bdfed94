"""The shapes that the stiffness of one mesh period can take.

Four forms are in use for a spur mesh, all derived from the contact ratio: the parabola of one
pair summed over the pairs in contact (the reference), half-sine arches through its end and middle
values, a rectangle through its zone means, and the Fourier sum of that rectangle. A form answers
with the `Pulse` of one pair whose sum over the pairs, one mesh period apart, is the form; its
levels are in units of the greatest stiffness of a single pair.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from gearmon.errors import ArgumentError, check_range, nearest_name
from gearmon.gears.involute import contact_zones
from gearmon.gears.pulses import FloatArray, Pulse

#: Loss of stiffness of a pair from the middle of its contact to its ends, Cai & Hayashi (1994).
CURVATURE_CAI = 0.45
#: The same from the closed form of Gu, Velex, Sainsot & Bruyere (2015).
CURVATURE_GU = 0.391

Normalisation = Literal["mean", "maximum"]
Duty = Literal["true", "half"]


class StiffnessForm(Protocol):
    """What every form gives."""

    @property
    def name(self) -> str:
        """Name under which the form is chosen."""

    @property
    def normalisation(self) -> Normalisation:
        """What ISO 6336 fixes: the mean mesh stiffness or the greatest of a single pair."""

    def pulse(self, contact_ratio: float) -> Pulse:
        """Return the stiffness of one pair over its contact, in units of its maximum."""

    def outline(self, contact_ratio: float) -> Pulse:
        """Return the pulse whose sum has the peaks that count: of a Fourier sum, its rectangle."""


@dataclass(frozen=True, kw_only=True)
class Parabolic:
    """Parabola of one pair: ``K_max [1 - q (2 t/(eps_a T) - 1)^2]`` over its contact.

    Parameters
    ----------
    curvature : float, in [0, 1)
        q: 0.45 (Cai & Hayashi 1994) or 0.391 (Gu et al. 2015).
    normalisation : {"mean", "maximum"}
        Whether the mean mesh stiffness is ISO 6336's c_gamma_alpha b, or K_max is c' b (the mean
        is then ``eps_a (1 - q/3) c' b``).
    """

    curvature: float = CURVATURE_CAI
    normalisation: Normalisation = "mean"

    def __post_init__(self) -> None:
        _check_curvature(self.curvature)
        _check_choice("normalisation", self.normalisation, ("mean", "maximum"))

    @property
    def name(self) -> str:
        """Name under which the form is chosen."""
        return "parabolic" if self.normalisation == "mean" else "parabolic-maximum"

    def pulse(self, contact_ratio: float) -> Pulse:
        """Return the stiffness of one pair over its contact, in units of its maximum."""
        q, length = self.curvature, contact_ratio
        coefficients = [1 - q, 4 * q / length, -4 * q / length**2]
        return _pieces([0.0], [length], np.array([coefficients]))

    def outline(self, contact_ratio: float) -> Pulse:
        """Return the pulse itself."""
        return self.pulse(contact_ratio)


@dataclass(frozen=True, kw_only=True)
class Wave:
    """Half-sine arches through the end and middle values of the parabola in each zone.

    Parameters
    ----------
    curvature : float, in [0, 1)
        q of the parabola that gives the values.
    normalisation : {"mean", "maximum"}
        See `Parabolic`.

    Notes
    -----
    The definition is a reconstruction; the pairs in contact share each arch equally.
    """

    curvature: float = CURVATURE_CAI
    normalisation: Normalisation = "mean"

    def __post_init__(self) -> None:
        _check_curvature(self.curvature)
        _check_choice("normalisation", self.normalisation, ("mean", "maximum"))

    @property
    def name(self) -> str:
        """Name under which the form is chosen."""
        return "wave"

    def pulse(self, contact_ratio: float) -> Pulse:
        """Return the stiffness of one pair over its contact, in units of its maximum."""
        zones = contact_zones(contact_ratio)
        starts, ends, pairs = (np.array(part) for part in zip(*zones, strict=True))
        levels = np.array(
            [
                _parabola_sum(
                    np.array([low, 0.5 * (low + high)]) % 1.0, n, contact_ratio, self.curvature
                )
                for low, high, n in zones
            ]
        )
        end, rise = levels[:, 0] / pairs, (levels[:, 1] - levels[:, 0]) / pairs
        rate = np.pi / (ends - starts)
        # rise sin(rate (x - start)) written as the real part of a turning number
        weight = -1j * rise * np.exp(-1j * rate * starts)
        return Pulse(
            starts=starts,
            ends=ends,
            polynomial=np.column_stack([end, 0 * end, 0 * end]),
            weights=weight[:, None],
            rates=rate[:, None],
        )

    def outline(self, contact_ratio: float) -> Pulse:
        """Return the pulse itself."""
        return self.pulse(contact_ratio)


@dataclass(frozen=True, kw_only=True)
class Rectangular:
    """One level while n + 1 pairs carry, a lower one while n do: the parabola's zone means.

    Parameters
    ----------
    duty : {"true", "half"}
        The high level lasts eps_a - n mesh periods (n = whole part of eps_a), or half a period.
    curvature : float, in [0, 1)
        q of the parabola whose zone means are the levels.
    normalisation : {"mean", "maximum"}
        See `Parabolic`.
    """

    duty: Duty = "true"
    curvature: float = CURVATURE_CAI
    normalisation: Normalisation = "mean"

    def __post_init__(self) -> None:
        _check_curvature(self.curvature)
        _check_choice("duty", self.duty, ("true", "half"))
        _check_choice("normalisation", self.normalisation, ("mean", "maximum"))

    @property
    def name(self) -> str:
        """Name under which the form is chosen."""
        return "rectangular" if self.duty == "true" else "rectangular-half"

    def pulse(self, contact_ratio: float) -> Pulse:
        """Return the stiffness of one pair over its contact, in units of its maximum."""
        few = math.floor(contact_ratio)
        high, low = zone_means(contact_ratio, self.curvature)
        nominal = contact_ratio if self.duty == "true" else few + 0.5
        zones = contact_zones(nominal)
        level = np.array([(low if pairs == few else high) / pairs for _, _, pairs in zones])
        starts, ends = [zone[0] for zone in zones], [zone[1] for zone in zones]
        return _pieces(starts, ends, np.column_stack([level, 0 * level, 0 * level]))

    def outline(self, contact_ratio: float) -> Pulse:
        """Return the pulse itself."""
        return self.pulse(contact_ratio)


@dataclass(frozen=True, kw_only=True)
class FourierSum:
    """The first terms of the Fourier series of the rectangle.

    Parameters
    ----------
    terms : int, 1 ... 400
        Number of cosine terms that are kept: the orders 1, 3, 5 ... at half duty (the even ones
        vanish), 1, 2, 3 ... at the true duty.
    duty : {"half", "true"}
        Duty of the rectangle; see `Rectangular`.
    curvature, normalisation
        See `Rectangular`.

    Notes
    -----
    At half duty f(t) = (4/pi) sum_j (-1)^j cos((2j+1) Omega t)/(2j+1), t from the middle of the
    high part. The sum overshoots the levels by up to 8.95 % of the jump at any number of terms.
    """

    terms: int = 30
    duty: Duty = "half"
    curvature: float = CURVATURE_CAI
    normalisation: Normalisation = "mean"

    def __post_init__(self) -> None:
        if self.terms != int(self.terms):
            raise ArgumentError(f"terms={self.terms} must be a whole number in [1, 400]")
        check_range("terms", self.terms, 1, 400)
        self._rectangle()

    @property
    def name(self) -> str:
        """Name under which the form is chosen."""
        return "fourier" if self.duty == "half" else "fourier-true"

    def pulse(self, contact_ratio: float) -> Pulse:
        """Return the stiffness of one pair over its contact, in units of its maximum."""
        orders = np.arange(1, self.terms + 1) * (2 if self.duty == "half" else 1)
        orders = orders - (1 if self.duty == "half" else 0)
        rectangle = self._rectangle().pulse(contact_ratio)
        amplitudes = 2 * rectangle.transform(orders)
        few = math.floor(contact_ratio)
        zones = contact_zones(contact_ratio if self.duty == "true" else few + 0.5)
        share = np.array([1 / pairs for _, _, pairs in zones])
        return Pulse(
            starts=rectangle.starts,
            ends=rectangle.ends,
            polynomial=np.column_stack([share * rectangle.area, 0 * share, 0 * share]),
            weights=share[:, None] * amplitudes,
            rates=np.tile(2 * np.pi * orders, (len(share), 1)),
        )

    def outline(self, contact_ratio: float) -> Pulse:
        """Return the pulse of the rectangle: the overshoot of the sum is no stiffness."""
        return self._rectangle().pulse(contact_ratio)

    def _rectangle(self) -> Rectangular:
        return Rectangular(
            duty=self.duty, curvature=self.curvature, normalisation=self.normalisation
        )


def stiffness_form(form: str | StiffnessForm) -> StiffnessForm:
    """Return the form of this name, or the form itself.

    Raises
    ------
    ArgumentError
        If no form has the name.

    Examples
    --------
    >>> stiffness_form("rectangular-half").duty
    'half'
    """
    if not isinstance(form, str):
        return form
    if form not in FORMS:
        near = nearest_name(form, FORMS)
        hint = f"; did you mean {near}?" if near else ""
        raise ArgumentError(f"form={form!r} is not one of {', '.join(FORMS)}{hint}")
    return FORMS[form]


def zone_means(contact_ratio: float, curvature: float = CURVATURE_CAI) -> tuple[float, float]:
    """Mean of the parabolic form while n + 1 pairs carry, and while n do, in units of K_max.

    Examples
    --------
    >>> [round(level, 6) for level in zone_means(1.412)]
    [1.523046, 0.973988]
    """
    few = math.floor(contact_ratio)
    part = contact_ratio - few
    pulse = Parabolic(curvature=curvature).pulse(contact_ratio)
    starts = np.arange(few + 1)
    inside = pulse.integral(starts + part) - pulse.integral(starts)
    between = pulse.integral(starts[:-1] + 1) - pulse.integral(starts[:-1] + part)
    low = float(between.sum()) / (1 - part)
    # without a zone of n + 1 pairs both levels are the mean of the one zone
    return (low if part < 1e-12 else float(inside.sum()) / part), low


def _parabola_sum(
    phase: FloatArray, pairs: int, contact_ratio: float, curvature: float
) -> FloatArray:
    # summed without the contact test, so that the zone ends give their one-sided limits
    s = 2 * (phase[:, None] + np.arange(pairs)) / contact_ratio - 1
    return np.asarray((1 - curvature * s * s).sum(axis=1))


def _pieces(starts: list[float], ends: list[float], polynomial: FloatArray) -> Pulse:
    return Pulse(starts=np.array(starts), ends=np.array(ends), polynomial=polynomial)


def _check_curvature(value: float) -> None:
    if not 0 <= value < 1:
        raise ArgumentError(f"curvature={value} must lie in [0, 1); usual values 0.45 and 0.391")


def _check_choice(name: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise ArgumentError(f"{name}={value!r} must be one of {', '.join(choices)}")


#: Forms by name.
FORMS: dict[str, StiffnessForm] = {
    "parabolic": Parabolic(),
    "parabolic-maximum": Parabolic(normalisation="maximum"),
    "parabolic-gu": Parabolic(curvature=CURVATURE_GU),
    "wave": Wave(),
    "rectangular": Rectangular(),
    "rectangular-half": Rectangular(duty="half"),
    "fourier": FourierSum(),
    "fourier-true": FourierSum(duty="true"),
}
