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
from typing import Literal

import numpy as np

from gearmon.errors import ArgumentError, check_range, check_word
from gearmon.gears.geometry import contact_zones
from gearmon.gears.pairs import MeshPair
from gearmon.gears.pulses import POINTS, FloatArray, Pulse, PulseTrain

#: Loss of stiffness of a pair from the middle of its contact to its ends, Cai & Hayashi (1994).
CURVATURE_CAI = 0.45
#: The same from the closed form of Gu, Velex, Sainsot & Bruyere (2015).
CURVATURE_GU = 0.391

Normalisation = Literal["mean", "maximum"]
Duty = Literal["true", "half"]


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
        q = self.curvature
        if not 0 <= q < 1:
            raise ArgumentError(f"curvature={q} must lie in [0, 1); usual values 0.45 and 0.391")
        check_word("normalisation=", self.normalisation, ("mean", "maximum"))

    @property
    def name(self) -> str:
        """Name under which the form is chosen."""
        return "parabolic" if self.normalisation == "mean" else "parabolic-maximum"

    def pulse(self, contact_ratio: float) -> Pulse:
        """Return the stiffness of one pair over its contact, in units of its maximum."""
        return Pulse.of(
            [0.0, contact_ratio],
            lambda t: 1 - self.curvature * (2 * t / contact_ratio - 1) ** 2,
            points=3,
        )

    def outline(self, contact_ratio: float) -> Pulse:
        """Return the pulse whose sum has the peaks that count: of a Fourier sum, its rectangle."""
        return self.pulse(contact_ratio)


#: Every form is made from the parabola of one pair.
StiffnessForm = Parabolic


@dataclass(frozen=True, kw_only=True)
class Wave(Parabolic):
    """Half-sine arches through the end and middle values of the parabola in each zone.

    Parameters
    ----------
    curvature, normalisation
        Of the parabola that gives the values.

    Notes
    -----
    The definition is a reconstruction; the pairs in contact share each arch equally.
    """

    @property
    def name(self) -> str:
        """Name under which the form is chosen."""
        return "wave"

    def pulse(self, contact_ratio: float) -> Pulse:
        """Return the stiffness of one pair over its contact, in units of its maximum."""
        edges, pairs = _zones(contact_ratio)
        width = np.diff(edges)
        at = np.stack([edges[:-1], edges[:-1] + 0.5 * width], axis=1) % 1.0
        levels = np.array([self._sum(x, n, contact_ratio) for x, n in zip(at, pairs, strict=True)])
        end, rise = (levels[:, 0] / pairs)[:, None], (np.diff(levels)[:, 0] / pairs)[:, None]

        def arches(t: FloatArray) -> FloatArray:
            return np.asarray(end + rise * np.sin(np.pi * (t - edges[:-1, None]) / width[:, None]))

        return Pulse.of(edges, arches)

    def _sum(self, phase: FloatArray, pairs: int, contact_ratio: float) -> FloatArray:
        # summed without the contact test, so that the zone ends give their one-sided limits
        s = 2 * (phase[:, None] + np.arange(pairs)) / contact_ratio - 1
        return np.asarray((1 - self.curvature * s * s).sum(axis=1))


@dataclass(frozen=True, kw_only=True)
class Rectangular(Parabolic):
    """One level while n + 1 pairs carry, a lower one while n do: the parabola's zone means.

    Parameters
    ----------
    duty : {"true", "half"}
        The high level lasts eps_a - n mesh periods (n = whole part of eps_a), or half a period.
    curvature, normalisation
        Of the parabola whose zone means are the levels.
    """

    duty: Duty = "true"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_word("duty=", self.duty, ("true", "half"))

    @property
    def name(self) -> str:
        """Name under which the form is chosen."""
        return "rectangular" if self.duty == "true" else "rectangular-half"

    def length(self, contact_ratio: float) -> float:
        """Return the nominal length of the contact of a pair [mesh periods]."""
        return contact_ratio if self.duty == "true" else math.floor(contact_ratio) + 0.5

    def pulse(self, contact_ratio: float) -> Pulse:
        """Return the stiffness of one pair over its contact, in units of its maximum."""
        high, low = zone_means(contact_ratio, self.curvature)
        edges, pairs = _zones(self.length(contact_ratio))
        level = np.where(pairs == math.floor(contact_ratio), low, high) / pairs
        return Pulse(edges, level[:, None])


@dataclass(frozen=True, kw_only=True)
class FourierSum(Rectangular):
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

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.terms != int(self.terms):
            raise ArgumentError(f"terms={self.terms} must be a whole number in [1, 400]")
        check_range("terms", self.terms, 1, 400)

    @property
    def name(self) -> str:
        """Name under which the form is chosen."""
        return "fourier" if self.duty == "half" else "fourier-true"

    def outline(self, contact_ratio: float) -> Pulse:
        """Return the pulse of the rectangle: the overshoot of a Fourier sum is no stiffness."""
        return Rectangular.pulse(self, contact_ratio)

    def pulse(self, contact_ratio: float) -> Pulse:
        """Return the stiffness of one pair over its contact, in units of its maximum."""
        orders = np.arange(1, self.terms + 1)
        if self.duty == "half":
            orders = 2 * orders - 1
        rectangle = self.outline(contact_ratio)
        mean, amplitudes = rectangle.area, 2 * rectangle.transform(orders)
        edges, pairs = _zones(self.length(contact_ratio))
        rates = 2 * np.pi * orders

        def terms(t: FloatArray) -> FloatArray:
            turned = np.exp(1j * rates * t[..., None]) @ amplitudes
            return np.asarray((mean + turned.real) / pairs[:, None])

        # over half a piece the fastest term turns by w: beyond w + 36 coefficients vanish
        reach = 0.5 * float(rates[-1] * np.diff(edges).max())
        found = Pulse.of(edges, terms, POINTS + math.ceil(1.05 * reach) + 20)
        return Pulse(found.edges, found.series, fastest=float(rates[-1]))


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


def mesh_variation(pair: MeshPair, form: StiffnessForm) -> float:
    """Return half the peak to peak of the mesh stiffness over its mean, imposed or of the form.

    Parameters
    ----------
    pair : MeshPair
        Its stage may impose stiffness_variation.
    form : StiffnessForm

    Raises
    ------
    ArgumentError
        If the variation imposed would make the stiffness negative somewhere.
    """
    eps, overlap = pair.contact_ratio, pair.overlap_ratio
    natural, wanted = _variation(form, eps, overlap), pair.given("stiffness_variation")
    if wanted is None:
        return natural
    if eps < 1 or (natural < 1e-9 and wanted > 0):
        raise ArgumentError(
            f"{pair.where}: stiffness_variation={wanted:g} cannot be imposed: a mesh with contact "
            f"ratios {eps:.4g} and {overlap:.4g} has no curve to stretch; leave it out"
        )
    if _mesh_curve(unit_pulse(pair, form), overlap).min() <= 0:
        raise ArgumentError(
            f"{pair.where}: stiffness_variation={wanted:g} makes the {form.name} stiffness "
            f"negative in a part of the mesh; {natural:.4g} follows from its contact ratio"
        )
    return wanted


def unit_pulse(pair: MeshPair, form: StiffnessForm, lost: float = 0.0) -> Pulse:
    """Return the pulse of one pair that makes a mean stiffness of 1.

    Parameters
    ----------
    pair : MeshPair
        Its stage may impose stiffness_variation, see `mesh_variation`.
    form : StiffnessForm
    lost : float
        What the contact ratio has lost: the greatest stiffness of a single pair is kept, and the
        factor of an imposed variation.
    """
    eps = pair.contact_ratio
    pulse = form.pulse(eps - lost).scaled(1 / form.pulse(eps).area)
    wanted = pair.given("stiffness_variation")
    if wanted is None:
        return pulse
    return _stretched(pulse, wanted and wanted / _variation(form, eps, pair.overlap_ratio))


def _stretched(pulse: Pulse, factor: float) -> Pulse:
    """Return the pulse whose sum departs `factor` times as far from the mean.

    The constant that this adds is shared among the pairs in contact as they share the stiffness
    at the ends of each zone, linearly between.
    """
    parts = pulse.cut(_zones(pulse.length)[0])
    kinds = np.arange(len(parts.series)) % (2 if pulse.length % 1 > 1e-12 else 1)
    sums = np.array([parts.limits[kinds == kind].sum(axis=0) for kind in range(kinds.max() + 1)])
    share = parts.limits / sums[kinds]
    series = factor * parts.series
    series = np.pad(series, ((0, 0), (0, max(0, 2 - series.shape[1]))))
    series[:, 0] += (1 - factor) * share.mean(axis=1)
    series[:, 1] += (1 - factor) * 0.5 * np.diff(share)[:, 0]
    return Pulse(parts.edges, series, pulse.fastest)


def _mesh_curve(pulse: Pulse, overlap: float) -> FloatArray:
    """Return the sum of a pulse over the pairs where its extremes are, with a margin of points."""
    zones = _zones(pulse.length)[0] % 1
    edges = np.unique(np.concatenate([[0.0, 1.0], zones, (zones + overlap) % 1]))
    # between the zone ends a curve has one extreme at most, a Fourier sum has its ripple
    points = 4096 if pulse.fastest else 64
    fractions = np.concatenate([[1e-9], np.arange(1, points) / points, [1 - 1e-9]])
    phase = edges[:-1, None] + np.diff(edges)[:, None] * fractions
    return PulseTrain.healthy(pulse, overlap).at(phase)


def _variation(form: StiffnessForm, contact_ratio: float, overlap: float) -> float:
    outline = form.outline(contact_ratio)
    return 0.5 * float(np.ptp(_mesh_curve(outline, overlap))) / outline.area


def _zones(contact_ratio: float) -> tuple[FloatArray, FloatArray]:
    """Return the edges of the zones that a pair passes, and how many pairs carry in each."""
    starts, ends, pairs = (
        np.array(part) for part in zip(*contact_zones(contact_ratio), strict=True)
    )
    return np.append(starts, ends[-1]), pairs


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
