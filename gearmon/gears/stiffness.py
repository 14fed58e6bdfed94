"""Mesh stiffness over its true period, and its Fourier coefficients in closed form.

The stiffness is a sum of pulse trains: one pulse per mesh period for the pairs that are all alike,
and, for every gear with damaged teeth, the missing part of those pulses once per turn of that
gear. One damaged tooth costs the contact of that tooth, not a turn.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from gearmon.errors import ArgumentError, check_word
from gearmon.gears.damage import acting_faults, gear_losses, worn_losses
from gearmon.gears.faults import Fault, GearError
from gearmon.gears.iso6336 import MethodB
from gearmon.gears.modulation import MOVING_KINDS, ModulationTrain, modulation_trains
from gearmon.gears.pairs import MeshPair, Stage, mesh_pairs
from gearmon.gears.pulses import ComplexArray, FloatArray, Pulse, PulseTrain
from gearmon.gears.stiffness_forms import FORMS, StiffnessForm, mesh_variation, unit_pulse
from gearmon.gears.tooth_mesh import CurvePairs, PairsInMesh, TeethInMesh
from gearmon.gears.tooth_pairs import POTENTIAL_ENERGY, PotentialEnergy, ToothPair, teeth_of

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
        What errors of turning gears change, with a period each; damaged teeth lose what they lose
        where the teeth would be without these errors.
    contact_ratio, overlap_ratio : float
        Transverse contact ratio and overlap ratio.
    variation : float
        Relative: eps of ``k = k_mean (1 + eps f)`` for the healthy mesh: half the peak to peak of
        k over its mean, so that f spans 2; with a symmetric square wave, f = +-1.
    form : StiffnessForm or PotentialEnergy
    iso : MethodB or None
        ISO 6336 stiffness behind the mean; None where the mean was given or follows from the
        energy of the teeth.
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
    iso: MethodB | None = None
    modulations: tuple[ModulationTrain, ...] = ()
    free_gap_m: float = 0.0
    warnings: tuple[str, ...] = field(default=())

    @property
    def trains(self) -> tuple[PulseTrain, ...]:
        """Healthy and missing parts together; with `modulations` their sum is the stiffness."""
        return self.healthy, *self.pulses

    @property
    def parts(self) -> tuple[PulseTrain | ModulationTrain, ...]:
        """All parts; their sum is the stiffness."""
        return self.healthy, *self.marks

    @property
    def marks(self) -> tuple[PulseTrain | ModulationTrain, ...]:
        """What makes the mesh differ from one mesh period to the next."""
        return *self.pulses, *self.modulations

    def only(self, gears: Sequence[str]) -> MeshStiffness:
        """Return the same with no gear marked but these."""
        return replace(
            self,
            pulses=tuple(train for train in self.pulses if train.gear in gears),
            modulations=tuple(train for train in self.modulations if train.gear in gears),
        )

    @cached_property
    def mean_n_per_m(self) -> float:
        """Mean stiffness over the true period, with the damage [N/m]."""
        return sum(float(train.coefficients([0])[0].real) for train in self.parts)

    @cached_property
    def healthy_mean_n_per_m(self) -> float:
        """Mean stiffness without the damaged teeth [N/m]."""
        return float(self.healthy.coefficients([0])[0].real)

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

    def sample(self, points_per_mesh: int) -> FloatArray:
        """Return the stiffness [N/m] over the true period.

        Parameters
        ----------
        points_per_mesh : int, >= 1
            Equally spaced phases i/points_per_mesh.

        Returns
        -------
        ndarray, shape (period_mesh * points_per_mesh,)

        Raises
        ------
        ArgumentError
            If there is not one point at least.
        """
        count = int(points_per_mesh)
        if count < 1:
            raise ArgumentError(f"points_per_mesh={points_per_mesh} must be >= 1")
        found = [train.at(np.arange(train.period_mesh * count) / count) for train in self.parts]
        return np.asarray(sum(np.tile(k, self.period_mesh * count // len(k)) for k in found))

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

    def mesh_harmonics(self, count: int) -> ComplexArray:
        """Return c_1 ... c_count of the healthy mesh relative to its own mean."""
        orders = np.arange(1, count + 1)
        return self.healthy.coefficients(orders) / self.healthy_mean_n_per_m


def mesh_stiffness(
    stage: Stage | MeshPair,
    faults: Iterable[Fault] = (),
    form: str | StiffnessForm | PotentialEnergy = "parabolic",
    *,
    number: int | None = None,
    force_n: float | None = None,
    errors: Iterable[GearError] = (),
) -> MeshStiffness:
    """Return the stiffness of a mesh.

    Parameters
    ----------
    stage : ParallelStage, PlanetaryStage or MeshPair
        Of a planetary stage its sun-planet mesh, unless the pair itself is given.
    faults : iterable of Fault
        Faults of this stage.
    form : str, StiffnessForm or PotentialEnergy
        A name in `FORM_NAMES`, or a form with parameters of its own.
    number : int, optional
        Number of the stage for messages, counted from 1.
    force_n : float, optional
        Static force on the line of action [N]; loads below 100 N/mm lower the ISO stiffness.
    errors : iterable of GearError
        Errors of gears of this stage: eccentricity, cumulative pitch error and, under a known
        force, misalignment modulate the stiffness as the gear turns.

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
    if isinstance(chosen, PotentialEnergy):
        parts = _from_teeth(pair, acting, chosen, force_n)
    else:
        parts = _from_form(pair, acting, chosen, force_n)
    healthy = PulseTrain.healthy(parts.pulse(0.0), pair.overlap_ratio)
    mean = float(healthy.coefficients([0])[0].real)
    gap = 0.0 if force_n is None else 2 * abs(force_n) / mean
    moving, still = _moving(pair, errors, force_n)
    modulations, more = modulation_trains(pair, moving, parts.pulse, gap)
    geometry = pair.geometry.warnings if pair.given("contact_ratio") is None else ()
    return MeshStiffness(
        healthy=healthy,
        pulses=parts.missing(pair, acting),
        contact_ratio=pair.contact_ratio,
        overlap_ratio=pair.overlap_ratio,
        variation=_variation(healthy) if parts.variation is None else parts.variation,
        form=chosen,
        iso=parts.iso,
        modulations=modulations,
        free_gap_m=gap,
        warnings=(*geometry, *parts.warnings, *notes, *still, *more),
    )


@dataclass(frozen=True, kw_only=True)
class _Parts:
    """What a form says of a mesh.

    `member` gives the pairs, sound or worn, of a contact ratio that is so much smaller, and `teeth`
    the teeth behind them if the form has any; `factor` scales what they carry.
    """

    member: Callable[[float], PairsInMesh]
    factor: float = 1.0
    teeth: ToothPair | None = None
    variation: float | None = None
    iso: MethodB | None = None
    warnings: tuple[str, ...] = ()

    def pulse(self, lost: float) -> Pulse:
        """Return the pulse [N/m] of a pair whose contact ratio is so much smaller."""
        return self.member(lost).healthy.scaled(self.factor)

    def missing(self, pair: MeshPair, acting: Sequence[Fault]) -> tuple[PulseTrain, ...]:
        """Return what damaged teeth take away."""
        pairs = self.member(0.0)
        trains = pairs.trains(pair, gear_losses(pair, acting, pairs.length, self.teeth))
        return tuple(train.scaled(self.factor) for train in trains)


def _from_form(
    pair: MeshPair, acting: list[Fault], form: StiffnessForm, force_n: float | None
) -> _Parts:
    variation = mesh_variation(pair, form)
    mean, iso = _mean(pair, form, force_n)

    def member(lost: float) -> CurvePairs:
        pulse = unit_pulse(pair, form, lost).scaled(mean * _worn_share(acting))
        return CurvePairs(pulse=pulse, worn=worn_losses(pair, acting, pulse.length))

    return _Parts(member=member, variation=variation, iso=iso, warnings=iso.warnings if iso else ())


def _from_teeth(
    pair: MeshPair, acting: list[Fault], form: PotentialEnergy, force_n: float | None
) -> _Parts:
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
    teeth = teeth_of(pair, form)

    def member(lost: float = 0.0, wear: Sequence[Fault] = acting) -> TeethInMesh:
        moved = teeth.parted(lost)
        worn = worn_losses(pair, wear, teeth=moved)
        return TeethInMesh(pair=moved, worn=worn, is_coupled=form.is_coupled, force_n=force_n)

    factor, imposed = _worn_share(acting), pair.given("mesh_stiffness_n_per_m")
    if imposed is not None:
        factor *= imposed / member(wear=()).healthy.area
    return _Parts(member=member, factor=factor, teeth=teeth, warnings=teeth.warnings)


def _worn_share(acting: Sequence[Fault]) -> float:
    """Return what wear that is given as a loss leaves of the stiffness."""
    return math.prod(1 - f.loss for f in acting if f.kind == "wear" and f.is_loss)


def _variation(train: PulseTrain) -> float:
    edges = train.terms[0].pulse.edges
    edges = np.unique(np.concatenate([edges, edges + train.overlap_ratio]) % 1.0)
    edges = np.append(edges, edges[0] + 1)
    inside = np.concatenate([[1e-9], np.arange(1, 32) / 32, [1 - 1e-9]])
    values = train.at(edges[:-1, None] + np.diff(edges)[:, None] * inside)
    return 0.5 * float(np.ptp(values)) / float(train.coefficients([0])[0].real)


def _moving(
    pair: MeshPair, errors: Iterable[GearError], force_n: float | None
) -> tuple[list[GearError], list[str]]:
    """Return the errors that modulate the stiffness, and notes on those that cannot."""
    own = [member.name for member in pair.members]
    moving, notes = [], []
    for error in errors:
        if error.kind not in MOVING_KINDS or not error.size_m or error.gear not in own:
            continue
        if error.kind == "misalignment":
            missing = "the static tooth force is not known" if force_n is None else ""
        else:
            missing = "module_mm is missing" if pair.stage.module_mm is None else ""
        if missing:
            notes.append(f"error {error} moves the flanks only, not the stiffness: {missing}")
        else:
            moving.append(error)
    return moving, notes


def _chosen(form: str | StiffnessForm | PotentialEnergy) -> StiffnessForm | PotentialEnergy:
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


def _mean(
    pair: MeshPair, form: StiffnessForm, force_n: float | None
) -> tuple[float, MethodB | None]:
    """Return the mean stiffness of the healthy mesh [N/m] and the ISO stiffness behind it."""
    known = pair.given("mesh_stiffness_n_per_m")
    if known is not None:
        return known, None
    instead = "mesh_stiffness_n_per_m" if pair.is_main else ""
    width = 1e-3 * pair.need("face_width_mm", "mean stiffness", instead)
    iso = pair.method_b(force_n)
    if form.normalisation == "mean":
        return iso.mean_n_per_m(width), iso
    return iso.single_n_per_m(width) * form.pulse(pair.contact_ratio).area, iso
