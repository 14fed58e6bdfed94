"""Variation of a mesh stiffness about its mean, and curves with a given variation."""

from __future__ import annotations

import numpy as np

from gearmon.errors import ArgumentError
from gearmon.gears.involute import contact_zones
from gearmon.gears.pairs import MeshPair
from gearmon.gears.pulse_trains import PulseTerm, PulseTrain
from gearmon.gears.pulses import FloatArray, Pulse
from gearmon.gears.stiffness_forms import StiffnessForm


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
