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
from gearmon.gears.geometry import contact_zones
from gearmon.gears.pairs import MeshPair
from gearmon.gears.pulses import FloatArray, Pulse, PulseTerm, PulseTrain

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


def unit_pulse(pair: MeshPair, form: StiffnessForm) -> tuple[Pulse, float]:
    """Return the pulse of one pair that makes a mean stiffness of 1, and the variation.

    Parameters
    ----------
    pair : MeshPair
        Its stage may impose stiffness_variation.
    form : StiffnessForm

    Returns
    -------
    pulse : Pulse
    variation : float
        Half the peak to peak of the mesh stiffness over its mean.

    Raises
    ------
    ArgumentError
        If the variation imposed would make the stiffness negative somewhere.
    """
    eps, overlap = pair.contact_ratio, pair.overlap_ratio
    pulse, outline = form.pulse(eps), form.outline(eps)
    pulse = pulse.scaled(1 / pulse.area)
    natural = _variation(outline.scaled(1 / outline.area), overlap)
    wanted = pair.given("stiffness_variation")
    if wanted is None:
        return pulse, natural
    if eps < 1 or (natural < 1e-9 and wanted > 0):
        raise ArgumentError(
            f"{pair.where}: stiffness_variation={wanted:g} cannot be imposed: a mesh with contact "
            f"ratios {eps:.4g} and {overlap:.4g} has no curve to stretch; leave it out"
        )
    stretched = _stretched(pulse, wanted / natural if wanted else 0.0)
    if _least(stretched, overlap) <= 0:
        raise ArgumentError(
            f"{pair.where}: stiffness_variation={wanted:g} makes the {form.name} stiffness "
            f"negative in a part of the mesh; {natural:.4g} follows from its contact ratio"
        )
    return stretched, wanted


def shorter_pulse(pair: MeshPair, form: StiffnessForm, lost: float) -> Pulse:
    """Return the pulse of `unit_pulse` where the contact ratio is smaller by `lost`.

    The greatest stiffness of a single pair is kept, and the factor of an imposed variation.
    """
    eps = pair.contact_ratio
    usual, outline = form.pulse(eps), form.outline(eps)
    pulse = form.pulse(eps - lost).scaled(1 / usual.area)
    wanted = pair.given("stiffness_variation")
    if wanted is None:
        return pulse
    natural = _variation(outline.scaled(1 / outline.area), pair.overlap_ratio)
    return _stretched(pulse, wanted / natural if wanted else 0.0)


def _stretched(pulse: Pulse, factor: float) -> Pulse:
    """Return the pulse whose sum departs `factor` times as far from the mean.

    The constant that this adds is shared among the pairs in contact as they share the stiffness
    at the ends of each zone, linearly between.
    """
    parts = pulse.cut([zone[0] for zone in contact_zones(pulse.length)])
    kinds = np.arange(len(parts.starts)) % (2 if pulse.length % 1 > 1e-12 else 1)
    ends = np.array([parts.limits_of(i) for i in range(len(parts.starts))])
    sums = np.array([ends[kinds == kind].sum(axis=0) for kind in range(kinds.max() + 1)])
    share = ends / sums[kinds]
    slope = (share[:, 1] - share[:, 0]) / (parts.ends - parts.starts)
    level = share[:, 0] - slope * parts.starts
    constant = (1 - factor) * np.column_stack([level, slope, 0 * slope])
    return Pulse(
        starts=parts.starts,
        ends=parts.ends,
        polynomial=factor * parts.polynomial + constant,
        weights=factor * parts.weights,
        rates=parts.rates,
    )


def _mesh_curve(pulse: Pulse, overlap: float) -> FloatArray:
    """Return the sum of a pulse over the pairs where its extremes are, with a margin of points."""
    zones = np.array([[low % 1, high % 1] for low, high, _ in contact_zones(pulse.length)])
    edges = np.unique(np.concatenate([[0.0, 1.0], zones.ravel(), (zones.ravel() + overlap) % 1]))
    # between the zone ends a curve has one extreme at most, a Fourier sum has its ripple
    points = 4096 if pulse.weights.shape[1] > 1 else 64
    fractions = np.concatenate([[1e-9], np.arange(1, points) / points, [1 - 1e-9]])
    phase = edges[:-1, None] + np.diff(edges)[:, None] * fractions
    train = PulseTrain(
        gear="all teeth", period_mesh=1, overlap_ratio=overlap, terms=(PulseTerm(pulse=pulse),)
    )
    return train.at(phase)


def _variation(pulse: Pulse, overlap: float) -> float:
    return 0.5 * float(np.ptp(_mesh_curve(pulse, overlap)))


def _least(pulse: Pulse, overlap: float) -> float:
    return float(_mesh_curve(pulse, overlap).min())
