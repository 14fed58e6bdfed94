"""How much stiffness a damaged tooth has lost, how surely, and what could be measured on it.

A mesh harmonic is what the pulses of z equal teeth add up to, and damage changes one of these in
proportion. At the mesh harmonic itself what it adds is loss / z of the healthy line there,
whatever the form of the pulse, the resonances of the teeth and the path to the sensor: these are
the same for both. It is told by the sidebands around, since an event that rings for a short while
has a smooth spectrum. What the teeth's response adds at each loss is told by its own sidebands in
the same way, so that neither the form of the pulse nor the smoothing biases the ratio. It corrects
for what stiffness does in the square, and for load that the damaged pair sheds through the dynamics
of the mesh. Where that correction is large, the line is not what the pulses make of it in the first
place, and tells little.

The size that the search finds most likely, which takes the path's mean power from the mesh lines,
is the prior: it is all that is known where the path rings too long, where noise hides the
sidebands, and in planetary sets.

What could be measured, crack depth or pitted area, follows from the loss by the teeth's stiffness.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.diagnosis.hypotheses.tooth_match import (
    DECAY_S,
    LOSSES,
    SearchedGear,
    event_delays,
    ringing,
)
from gearmon.diagnosis.law.gear_lines import BandDeviation
from gearmon.errors import ArgumentError, check_range
from gearmon.gears.damage import size_for_loss
from gearmon.gears.faults import Fault
from gearmon.gears.pairs import mesh_pairs
from gearmon.gears.tooth_pairs import ToothPair, teeth_of
from gearmon.machine import Machine
from gearmon.signatures.expected.tooth_response import GROWN, grown_lines

# Losses that are told apart; the last is the largest there is.
_FINE = np.geomspace(LOSSES[0], 0.95, 200)
# Standard deviations of the logarithm of a loss: by the search alone (0.34 and 0.42 on two kinds of
# simulated machines); what all lines have in common, above all the load that this tooth carries by
# its own pitch error; of a mesh harmonic, whose line flank errors make as well; of the response
# over the logarithm of its correction (with droop and run-in of the pairs' stiffness drawn at
# random 0.1 at the first harmonics, where that logarithm is 0.05, and 0.5 where it is 0.45; of a
# Student's law a part); and over that of how far a harmonic grows unlike most others. Of losses of
# 20 % on 80 machines of both kinds (288 analyses) intervals of a factor of 1.9 hold 91 %, on the 26
# of them that were not used to set these 85 %; of 30 % 92 and 93 %. The medians of 10 to 40 % are
# right within 6 % on each kind. A tooth's pitch error weighs the more the less it is loaded: of
# teeth at 0.17 and 0.42 of full load intervals hold 26 of 35 losses of 15 and 30 % if what lines
# have in common is taken as at full load, 29 if its square grows in inverse proportion.
_SEARCHED, _COMMON, _LINE, _RESPONSE, _GROWTH = 0.35, 0.12, 0.2, 0.2, 0.5
# Share of a departure's mean square that is noise at least: no event is all of it.
_MISFIT = 0.03
# Freedom of Student's law for a mesh harmonic: some are those of another cause.
_FREEDOM = 4.0


@dataclass(frozen=True, kw_only=True)
class LossEstimate:
    """Loss of stiffness of a tooth pair.

    Parameters
    ----------
    loss : float
        Median of what the recording leaves possible.
    low, high : float
        5 and 95 per cent points of it.
    """

    loss: float
    low: float
    high: float


def loss_estimate(gear: SearchedGear, machine: Machine, speed_hz: float) -> LossEstimate:
    """Estimate the loss of the most likely tooth of a gear.

    Parameters
    ----------
    gear : SearchedGear
        The gear to blame.
    machine : Machine
        Its machine.
    speed_hz : float
        Speed of shaft 1 [Hz].

    Returns
    -------
    LossEstimate
        Of the likelihood over the logarithm of the loss.
    """
    steps, fine = np.log(LOSSES), np.log(_FINE)
    likely = _blurred(gear.match.log_likelihood[:, gear.match.best], steps, _SEARCHED)
    total = np.interp(fine, steps, np.log(likely))
    # of a set, whose planets bring every line together, the search has to do
    if gear.difference.mesh_lines is not None and gear.difference.gear in ("pinion", "gear"):
        own = gear.response
        expected = grown_lines(machine, own.stage, own.gear, len(own.lines) - 1)
        grid = np.log(GROWN)
        for apart, variance in _at_harmonics(gear, *expected, speed_hz):
            # below what is told the logarithms of line and loss go together
            off = np.interp(fine, grid, apart + grid) - fine
            unsure = np.interp(fine, grid, variance)
            misfit = 0.5 * (_FREEDOM + 1.0) * np.log1p(off**2 / (_FREEDOM * unsure))
            total -= misfit + 0.5 * np.log(unsure)
    loaded = min(1.0, gear.difference.load)
    chance = _blurred(total, fine, _COMMON / np.sqrt(loaded))
    share = np.cumsum(chance) - 0.5 * chance
    low, middle, high = np.exp(np.interp([0.05, 0.5, 0.95], share / chance.sum(), fine)).tolist()
    return LossEstimate(loss=middle, low=low, high=high)


def _blurred(logarithm: FloatArray, steps: FloatArray, deviation: float) -> FloatArray:
    """Likelihood by its logarithm over even steps, once the steps are that unsure."""
    blur = np.exp(-0.5 * ((steps[:, None] - steps) / deviation) ** 2)
    return np.asarray((blur / blur.sum(axis=0)) @ np.exp(logarithm - logarithm.max()))


def _at_harmonics(
    gear: SearchedGear, sound: ComplexArray, grown: ComplexArray, speed_hz: float
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Logarithm of the damage by each mesh harmonic over what `GROWN` losses add; its variance."""
    difference = gear.difference
    assert difference.mesh_lines is not None
    last = min(len(sound), difference.mesh_lines.shape[1]) - 1
    rotation_hz, teeth = difference.order * speed_hz, difference.teeth
    entry_s = gear.match.best / (teeth * rotation_hz)
    delay = np.concatenate([event_delays(gear.response, rotation_hz, t) for t in DECAY_S]) + entry_s
    sizes = np.abs(grown[:, teeth::teeth])
    sizes = sizes[:, sizes[0] > 0]
    usual = np.median(np.log(sizes / sizes[0]), axis=1) if sizes.size else np.zeros(len(GROWN))
    for band in difference.bands:
        k = band.harmonic
        if k > last or sound[k] * grown[0, k * teeth] == 0:
            continue
        mesh = difference.mesh_lines[:, k]
        turned = grown[:, band.number] * np.exp(-2j * np.pi / teeth * gear.match.best * band.number)
        value, expected, variance = _at_mesh(band, k * teeth, rotation_hz, delay, turned)
        # more than `mesh_power` is heard where the mesh of another stage stands on the same line
        alone = np.abs(mesh) ** 2 <= 1.001 * difference.mesh_power[:, k]
        heard = alone & (np.abs(value * mesh) > 0)
        if not heard.any():
            continue
        weight = np.abs(value[heard]) ** 2 / variance[heard]
        ratio = value[heard] / mesh[heard] * sound[k] / expected[:, heard]
        corrected = teeth * grown[0, k * teeth] / (GROWN[0] * sound[k])
        unsure = _RESPONSE * float(np.abs(np.log(np.abs(corrected))))
        told = np.average(np.log(np.abs(ratio)), axis=1, weights=weight)
        odd = _GROWTH * (told[0] - told - usual)
        yield told, 1.0 / weight.sum() + _LINE**2 + unsure**2 + odd**2


def _at_mesh(
    band: BandDeviation, number: int, rotation_hz: float, delay: FloatArray, grown: ComplexArray
) -> tuple[ComplexArray, ComplexArray, FloatArray]:
    """Line that an event adds at a mesh harmonic in each channel, by its sidebands; its variance.

    The event is a sum of random impulses at the given delays, of the power that the band has.
    Between them what is told in the same way of the lines `grown`, shape (losses, channels).
    """
    lines = ringing(np.append(band.number, number)[None] * rotation_hz, delay)[0]
    white = lines[:-1] / band.deviation[:, :, None]
    energy = np.abs(band.rest) ** 2
    power = np.maximum(np.mean((energy - 1.0) * band.deviation**2, axis=1), 0.0)
    noise = np.maximum(1.0, _MISFIT * energy.mean(axis=1))
    over = noise / np.maximum(power, 1e-9 * np.mean(band.deviation**2, axis=1))
    turned = white.conj().swapaxes(1, 2)
    inverse = np.linalg.inv(turned @ white + over[:, None, None] * np.eye(len(delay)))
    weight = np.einsum("i,cij,cjl->cl", lines[-1], inverse, turned, optimize=True)
    value = np.sum(weight * band.rest, axis=1)
    expected = grown @ (weight / band.deviation).T
    variance = noise * np.einsum("i,cij,j->c", lines[-1], inverse, lines[-1].conj()).real
    return np.where(power > 0, value, 0.0), expected, variance


#: What is measured for each kind of damage: unit in which `gears.faults` takes it, unit in words,
#: and what it is.
MEASURED: dict[str, tuple[str, str, str]] = {
    "crack": ("mm", "mm", "crack depth"),
    "pitting": ("flank", "share of the flank", "pitted area"),
    "breakage": ("mm", "mm", "broken-off width"),
}
#: Damage of a single tooth that each kind of finding is read as.
READ_AS: dict[str, str] = {
    "tooth damage": "crack",
    "several teeth": "crack",
    "distributed pitting": "pitting",
}


@dataclass(frozen=True, kw_only=True)
class PhysicalSize:
    """Size of damage on a tooth that costs its pair a given stiffness.

    Parameters
    ----------
    quantity : str
        What it is: "crack depth", "pitted area" or "broken-off width".
    unit : str
        "mm" or "share of the flank".
    size : float
        At the estimated loss.
    low, high : float or None
        At the ends of the interval of the loss; None where that end is beyond the reach of this
        kind of damage.
    """

    quantity: str
    unit: str
    size: float
    low: float | None
    high: float | None

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        return {
            "quantity": self.quantity,
            "unit": self.unit,
            "size": self.size,
            "low": self.low,
            "high": self.high,
        }


def physical_size(
    machine: Machine, stage: int, gear: str, kind: str, loss: float, low: float, high: float
) -> PhysicalSize | None:
    """Convert a loss of pair stiffness to the size of the damage behind it.

    Parameters
    ----------
    machine : Machine
        The machine.
    stage : int, >= 1
        Stage.
    gear : str
        Gear with the damaged tooth.
    kind : str
        "crack", "pitting", "breakage", or a kind of finding: "tooth damage" and "several teeth" are
        read as a root crack through the face width, "distributed pitting" as pitting of each tooth.
    loss, low, high : float, in [0, 1)
        Mean loss of the stiffness of the pair over its contact, and its interval.

    Returns
    -------
    PhysicalSize or None
        None where the machine file lacks the geometry (module, face width), where nothing is
        measured for this kind, or where no size of this damage costs so much.

    Raises
    ------
    ArgumentError
        If there is no such stage or gear, or the losses are out of range or order.

    Notes
    -----
    The forward conversion `gears.damage.stiffness_loss` (potential energy of the tooth with a
    flat limit line of the crack) rises with the size, and is inverted by bracketing. Against finite
    elements that line costs shallow cracks too little stiffness, by up to 45 %: the depth given is
    then too large.

    Examples
    --------
    >>> from gearmon.machine import Machine, OperatingPoint, ParallelStage
    >>> stage = ParallelStage(pinion_teeth=26, gear_teeth=53, module_mm=2.0, face_width_mm=20.0)
    >>> machine = Machine(
    ...     name="pair", operating=(OperatingPoint(speed_rpm=1460.0),), stages=(stage,)
    ... )
    >>> found = physical_size(machine, 1, "pinion", "crack", 0.1, 0.05, 0.15)
    >>> found.quantity, found.low < found.size < found.high
    ('crack depth', True)
    """
    check_range("stage", stage, 1, len(machine.stages))
    for name, value in (("loss", loss), ("low", low), ("high", high)):
        check_range(name, value, 0.0, 1.0)
    if not low <= loss <= high:
        raise ArgumentError(f"low={low:g}, loss={loss:g}, high={high:g} must not decrease")
    teeth, index = _teeth_of(machine, stage, gear)
    damage = READ_AS.get(kind, kind)
    if damage not in MEASURED or teeth is None:
        return None
    unit, shown, quantity = MEASURED[damage]
    fault = Fault(kind=damage, stage=stage, gear=gear, tooth=1, size=0.1, unit=unit)
    size, least, most = (_size(fault, value, teeth, index) for value in (loss, low, high))
    if size is None:
        return None
    return PhysicalSize(quantity=quantity, unit=shown, size=size, low=least, high=most)


# the same for every recording of a machine
@lru_cache(maxsize=64)
def _teeth_of(machine: Machine, stage: int, gear: str) -> tuple[ToothPair | None, int]:
    """Return the teeth of a gear's mesh, None where the file lacks geometry, and its place there.

    Of a planet the mesh with the sun is taken.
    """
    pairs = mesh_pairs(machine.stages[stage - 1], stage, machine.path)
    for pair in pairs:
        names = [member.name for member in pair.members]
        if gear in names:
            told = pair.stage.module_mm is not None and pair.stage.face_width_mm is not None
            return teeth_of(pair) if told else None, names.index(gear)
    known = ", ".join(dict.fromkeys(m.name for pair in pairs for m in pair.members))
    raise ArgumentError(f"gear {gear!r} is not in stage {stage}, which has {known}")


def _size(fault: Fault, loss: float, teeth: ToothPair, index: int) -> float | None:
    if loss >= 1.0:
        return None
    try:
        return float(size_for_loss(fault, loss, teeth, index).size)
    except ArgumentError:  # no damage of this kind costs so much
        return None
