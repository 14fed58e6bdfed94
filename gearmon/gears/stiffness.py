"""Mesh stiffness over its true period, and its Fourier coefficients in closed form.

The stiffness is a sum of pulse trains: one pulse per mesh period for the pairs that are all alike,
and, for every gear with damaged teeth, the missing part of those pulses once per turn of that
gear. One damaged tooth costs the contact of that tooth, not a turn.

Beside the curve that follows from the energy of the teeth four forms are in use for a spur mesh,
all derived from the contact ratio: the parabola of one pair summed over the pairs in contact (the
reference), half-sine arches through its end and middle values, a rectangle through its zone means,
and the Fourier sum of that rectangle. A form answers with the `Pulse` of one pair whose sum over
the pairs, one mesh period apart, is the form; its levels are in units of the greatest stiffness of
a single pair.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.errors import ArgumentError, check_word
from gearmon.gears.damage import CurvePairs, PairsInMesh, TeethInMesh, acting_faults, gear_losses
from gearmon.gears.excitation import ModulationTrain, modulation_trains
from gearmon.gears.faults import Fault, GearError
from gearmon.gears.geometry import contact_zones
from gearmon.gears.pairs import MeshPair, Stage, mesh_pairs
from gearmon.gears.pulses import POINTS, Pulse, PulseTrain, panel_nodes
from gearmon.gears.tooth_pairs import POTENTIAL_ENERGY, PotentialEnergy, teeth_of
from gearmon.machine.fields import Checked, Choice, Count, held, within

#: Loss of stiffness of a pair from the middle of its contact to its ends, Cai & Hayashi (1994).
CURVATURE_CAI = 0.45
#: The same from the closed form of Gu, Velex, Sainsot & Bruyere (2015).
CURVATURE_GU = 0.391

#: How long the high level of a rectangle may last, see `Rectangular`.
DUTY = Choice(options=("true", "half"))


@dataclass(frozen=True, kw_only=True)
class Parabolic(Checked):
    """Parabola of one pair: ``K_max [1 - q (2 t/(eps_a T) - 1)^2]`` over its contact.

    Parameters
    ----------
    curvature : float, in [0, 1)
        q: 0.45 (Cai & Hayashi 1994) or 0.391 (Gu et al. 2015).
    normalisation : {"mean", "maximum"}
        Whether the mean mesh stiffness is ISO 6336's c_gamma_alpha b, or K_max is c' b (the mean
        is then ``eps_a (1 - q/3) c' b``).
    """

    curvature: float = within(0, 1, default=CURVATURE_CAI, open_high=True)
    normalisation: str = held(Choice(options=("mean", "maximum")), "mean")

    @property
    def name(self) -> str:
        """Name under which the form is chosen."""
        return "parabolic" if self.normalisation == "mean" else "parabolic-maximum"

    def pulse(self, contact_ratio: float) -> Pulse:
        """Return the stiffness of one pair over its contact, in units of its maximum."""
        edges, q = [0.0, contact_ratio], self.curvature
        return Pulse.of(edges, lambda t: 1 - q * (2 * t / contact_ratio - 1) ** 2, points=3)

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
        edges, pairs = contact_zones(contact_ratio)
        width = np.diff(edges)
        own = super().pulse(contact_ratio).at(edges[:-1, None] + np.outer(width, [0.0, 0.5]))
        levels = over_pairs(own, contact_ratio) / pairs[:, None]
        end, rise = levels[:, :1], np.diff(levels)
        turned = np.pi * (panel_nodes(edges) - edges[:-1, None]) / width[:, None]
        return Pulse.through(edges, end + rise * np.sin(turned))


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

    duty: str = held(DUTY, "true")

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
        edges, pairs = contact_zones(self.length(contact_ratio))
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

    terms: int = held(Count(1, 400), 30)
    duty: str = held(DUTY, "half")

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
        edges, pairs = contact_zones(self.length(contact_ratio))
        rates = 2 * np.pi * orders
        # over half a piece the fastest term turns by w: beyond w + 36 coefficients vanish
        reach = 0.5 * float(rates[-1] * np.diff(edges).max())
        phase = panel_nodes(edges, POINTS + math.ceil(1.05 * reach) + 20)
        turned = np.exp(1j * rates * phase[..., None]) @ amplitudes
        return Pulse.through(edges, (mean + turned.real) / pairs[:, None], float(rates[-1]))


def over_pairs(values: FloatArray, length: float) -> FloatArray:
    """Return what all pairs in contact have together, zone by zone.

    Parameters
    ----------
    values : ndarray, shape (zones, ...)
        What one pair has at the same place in each of the zones that it passes.
    length : float
        Of its contact, see `contact_zones`: every second zone has as many pairs.
    """
    step = 2 if length % 1 > 1e-12 else 1
    return np.array([values[zone % step :: step].sum(axis=0) for zone in range(len(values))])


def zone_means(contact_ratio: float, curvature: float = CURVATURE_CAI) -> tuple[float, float]:
    """Mean of the parabolic form while n + 1 pairs carry, and while n do, in units of K_max.

    Examples
    --------
    >>> [round(level, 6) for level in zone_means(1.412)]
    [1.523046, 0.973988]
    """
    few, (edges, _) = math.floor(contact_ratio), contact_zones(contact_ratio)
    areas = np.diff(Parabolic(curvature=curvature).pulse(contact_ratio).integral(edges))
    means = over_pairs(areas, contact_ratio) / np.diff(edges)
    # without a zone of n + 1 pairs both levels are the mean of the one zone
    return float(means[0]), float(means[:2][-1]) if few else 0.0


@lru_cache(maxsize=64)
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
    natural, wanted = _variation(form.outline(eps), overlap), pair.given("stiffness_variation")
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


@lru_cache(maxsize=64)
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
    return _stretched(pulse, wanted and wanted / _variation(form.outline(eps), pair.overlap_ratio))


def _stretched(pulse: Pulse, factor: float) -> Pulse:
    """Return the pulse whose sum departs `factor` times as far from the mean.

    The constant that this adds is shared among the pairs in contact as they share the stiffness
    at the ends of each zone, linearly between.
    """
    zones, pairs = contact_zones(pulse.length)
    parts = pulse * Pulse(zones, np.ones((len(pairs), 1)))
    share = parts.limits / over_pairs(parts.limits, pulse.length)
    series = factor * parts.series
    series = np.pad(series, ((0, 0), (0, max(0, 2 - series.shape[1]))))
    series[:, 0] += (1 - factor) * share.mean(axis=1)
    series[:, 1] += (1 - factor) * 0.5 * np.diff(share)[:, 0]
    return Pulse(parts.edges, series, pulse.fastest)


def _mesh_curve(pulse: Pulse, overlap: float) -> FloatArray:
    """Return the sum of a pulse over the pairs where its extremes are, with a margin of points."""
    corners = np.concatenate([pulse.edges, pulse.edges + overlap])
    edges = np.unique(np.append(corners % 1, [0.0, 1.0]))
    # between the zone ends a curve has one extreme at most, a Fourier sum has its ripple
    points = 4096 if pulse.fastest else 64
    fractions = np.concatenate([[1e-9], np.arange(1, points) / points, [1 - 1e-9]])
    phase = edges[:-1, None] + np.diff(edges)[:, None] * fractions
    return PulseTrain.healthy(pulse, overlap).at(phase)


def _variation(pulse: Pulse, overlap: float) -> float:
    return 0.5 * float(np.ptp(_mesh_curve(pulse, overlap))) / pulse.area


#: A form, or its name in `FORM_NAMES`.
AnyForm = str | StiffnessForm | PotentialEnergy
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

#: Names of all forms: curves over a mesh period, and the one computed from the teeth.
FORM_NAMES: tuple[str, ...] = (*FORMS, POTENTIAL_ENERGY)


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshStiffness:
    """Stiffness of a mesh along the line of action over its true period.

    Mesh phase 0 is the entry of a pair into contact; tooth j of either gear (counted from 1)
    enters contact at phase j - 1.

    Parameters
    ----------
    healthy : PulseTrain
        The teeth that are all alike, with the wear of all.
    pulses : tuple of PulseTrain
        What damaged teeth take away, with a period each; empty for a healthy mesh.
    modulations : tuple of ModulationTrain
        What errors of turning gears change together, if there are any; damaged teeth lose what they
        lose where the teeth would be without these errors.
    contact_ratio, overlap_ratio : float
        Transverse contact ratio and overlap ratio.
    variation : float
        Relative: eps of ``k = k_mean (1 + eps f)`` for the healthy mesh: half the peak to peak of
        k over its mean, so that f spans 2; with a symmetric square wave, f = +-1.
    form : StiffnessForm or PotentialEnergy
    free_gap_m : float
        Lead deviation across the face that the static force just closes, 2 F/k [m]; 0 where the
        force is not known.
    warnings : tuple of str
    """

    healthy: PulseTrain
    pulses: tuple[PulseTrain, ...]
    contact_ratio: float
    overlap_ratio: float
    variation: float
    form: StiffnessForm | PotentialEnergy
    modulations: tuple[ModulationTrain, ...] = ()
    free_gap_m: float = 0.0
    warnings: tuple[str, ...] = ()

    @property
    def trains(self) -> tuple[PulseTrain, ...]:
        """Healthy and missing parts together; with `modulations` their sum is the stiffness."""
        return self.healthy, *self.pulses

    @property
    def parts(self) -> tuple[PulseTrain | ModulationTrain, ...]:
        """All parts; their sum is the stiffness."""
        return *self.trains, *self.modulations

    @cached_property
    def mean_n_per_m(self) -> float:
        """Mean stiffness over the true period, with the damage [N/m]."""
        still = sum(train.mean for train in self.trains)
        return still + sum(float(t.coefficients([0])[0].real) for t in self.modulations)

    @cached_property
    def healthy_mean_n_per_m(self) -> float:
        """Mean stiffness without the damaged teeth [N/m]."""
        return self.healthy.mean

    @property
    def period_mesh(self) -> int:
        """True period [mesh periods]."""
        return math.lcm(*(train.period_mesh for train in self.parts))

    @property
    def total_contact_ratio(self) -> float:
        """eps_gamma = eps_alpha + eps_beta."""
        return self.contact_ratio + self.overlap_ratio

    def at(self, phase: ArrayLike) -> FloatArray:
        """Return the stiffness [N/m] at `phase` [mesh periods], any shape."""
        return np.asarray(sum(train.at(phase) for train in self.parts))

    def harmonics(self, count: int) -> ComplexArray:
        """Return c_1 ... c_count of ``k = mean (1 + sum_r (c_r exp(2 pi i r phase/P) + conj))``.

        Parameters
        ----------
        count : int, >= 0
            Number of harmonics of the true period P = period_mesh: count/P mesh orders.

        Returns
        -------
        ndarray of complex, shape (count,)
            Relative to `mean_n_per_m`; exact, none aliased.
        """
        total = np.zeros(count, dtype=np.complex128)
        for train in self.parts:
            step = self.period_mesh // train.period_mesh
            total[step - 1 :: step] += train.coefficients(np.arange(1, count // step + 1))
        return total / self.mean_n_per_m

    def mesh_amplitudes(self, count: int) -> FloatArray:
        """Return the amplitudes [N/m] of the first mesh harmonics of the healthy mesh."""
        return 2 * np.abs(self.healthy.coefficients(np.arange(1, count + 1)))

    def to_dict(self) -> dict[str, Any]:
        """Return what its form makes of the healthy mesh in built-in types."""
        told = {"form": self.form.name, "stiffness_variation": self.variation}
        return told | {"mean_stiffness_n_per_m": self.healthy_mean_n_per_m}


def mesh_stiffness(
    stage: Stage | MeshPair,
    faults: Iterable[Fault | GearError] = (),
    form: AnyForm = "parabolic",
    *,
    number: int | None = None,
    force_n: float | None = None,
) -> MeshStiffness:
    """Return the stiffness of a mesh.

    Parameters
    ----------
    stage : ParallelStage, PlanetaryStage or MeshPair
        Of a planetary stage its sun-planet mesh, unless the pair itself is given.
    faults : iterable of Fault or GearError
        Of this stage. Of the errors eccentricity, cumulative pitch error and, under a known force,
        misalignment modulate the stiffness as the gear turns.
    form : str, StiffnessForm or PotentialEnergy
        A name in `FORM_NAMES`, or a form with parameters of its own.
    number : int, optional
        Number of the stage for messages, counted from 1.
    force_n : float, optional
        Static force on the line of action [N]; loads below 100 N/mm lower the ISO stiffness.

    Returns
    -------
    MeshStiffness

    Raises
    ------
    ArgumentError
        If the stage lacks data, its gears cannot run, or a fault does not fit it.

    Notes
    -----
    The mean is the override mesh_stiffness_n_per_m, or c_gamma_alpha b of ISO 6336-1 Method B.
    The override stiffness_variation stretches the curve about its mean until half its peak to
    peak over its mean is that value (of a Fourier sum: the rectangle under it). The form
    "potential-energy" takes mean and curve from the teeth; only the mean can be imposed on it.
    """
    pair = stage if isinstance(stage, MeshPair) else mesh_pairs(stage, number)[0]
    chosen = _chosen(form)
    _check_contact(pair)
    acting, notes = acting_faults(pair, faults)
    hurt = [own for own in acting if isinstance(own, Fault)]
    errors = [own for own in acting if isinstance(own, GearError)]
    if isinstance(chosen, PotentialEnergy):
        new, factor, more = _from_teeth(pair, chosen, force_n)
    else:
        new, factor, more = _from_form(pair, chosen, force_n)
    # what wear that is given as a loss leaves
    wear = [fault for fault in hurt if fault.kind == "wear"]
    factor *= math.prod(1 - fault.loss for fault in wear if fault.is_loss)
    in_mm = [fault for fault in wear if not fault.is_loss]

    def worn(lost: float) -> PairsInMesh:
        """Return the pairs with the wear of all their teeth."""
        pairs = new(lost)
        one, two = gear_losses(pair, in_mm, pairs)
        return replace(pairs, worn=(one.get(0, ()), two.get(0, ())))

    def pulse(lost: float) -> Pulse:
        """Return the pulse [N/m] of a pair whose contact ratio is so much smaller."""
        return worn(lost).healthy.scaled(factor)

    pairs, overlap = worn(0.0), pair.overlap_ratio
    whole = pairs.healthy.scaled(factor)
    local = [fault for fault in hurt if fault.tooth is not None]
    missing = pairs.trains(pair, gear_losses(pair, local, pairs))
    gap = 0.0 if force_n is None else 2 * abs(force_n) / whole.area
    modulations, told = modulation_trains(pair, errors, pulse, gap)
    if pair.given("contact_ratio") is None:
        more = (*pair.geometry.warnings, *more)
    return MeshStiffness(
        healthy=PulseTrain.healthy(whole, overlap),
        pulses=tuple(train.scaled(factor) for train in missing),
        contact_ratio=pair.contact_ratio,
        overlap_ratio=overlap,
        variation=_variation(whole, overlap) if pairs.teeth else mesh_variation(pair, chosen),
        form=chosen,
        modulations=modulations,
        free_gap_m=gap,
        warnings=(*more, *notes, *told),
    )


#: What a form says of a mesh: its new pairs, by how much smaller their contact ratio is, the scale
#: of what they carry, and notes.
_Said = tuple[Callable[[float], PairsInMesh], float, tuple[str, ...]]


def _from_form(pair: MeshPair, form: StiffnessForm, force_n: float | None) -> _Said:
    mesh_variation(pair, form)  # refuses one that cannot be imposed
    mean, notes = pair.given("mesh_stiffness_n_per_m"), tuple[str, ...]()
    if mean is None:
        instead = "mesh_stiffness_n_per_m" if pair.is_main else ""
        width = 1e-3 * pair.need("face_width_mm", "mean stiffness", instead)
        iso = pair.method_b(force_n)
        mean, notes = iso.mean_n_per_m(width), iso.warnings
        if form.normalisation == "maximum":
            mean = iso.single_n_per_m(width) * form.pulse(pair.contact_ratio).area

    def new(lost: float) -> PairsInMesh:
        pulse = unit_pulse(pair, form, lost)
        return CurvePairs(pulse=pulse, points=pulse.points)

    return new, mean, notes


def _from_teeth(pair: MeshPair, form: PotentialEnergy, force_n: float | None) -> _Said:
    if pair.given("stiffness_variation") is not None:
        raise ArgumentError(
            f"{pair.where}: stiffness_variation cannot be imposed on the {form.name} form, whose "
            f"curve follows from the teeth; leave it out or choose another form"
        )
    if form.contact == "load-dependent" and force_n is None:
        raise ArgumentError(
            f"{pair.where}: the load-dependent contact needs the static tooth force; give "
            f"torque_nm of [operating], force_n in this stage, or contact='constant'"
        )
    teeth, imposed = teeth_of(pair, form), pair.given("mesh_stiffness_n_per_m")
    new = TeethInMesh(teeth=teeth, force_n=force_n)
    factor = 1.0 if imposed is None else imposed / new.healthy.area
    return lambda lost: replace(new, teeth=teeth.parted(lost)), factor, teeth.warnings


def _chosen(form: AnyForm) -> StiffnessForm | PotentialEnergy:
    if not isinstance(form, str):
        return form
    check_word("form=", form, FORM_NAMES)
    return PotentialEnergy() if form == POTENTIAL_ENERGY else FORMS[form]


def _check_contact(pair: MeshPair) -> None:
    total = pair.contact_ratio + pair.overlap_ratio
    if total < 1:
        raise ArgumentError(
            f"{pair.where}: total contact ratio {total:.4f} is below 1: no pair would carry for a "
            f"while; raise contact_ratio={pair.contact_ratio:g} or face_width_mm"
        )
