"""What the gearbox has to do with it: its lines in what is felt, damage, and the best speed.

The lines of shafts and meshes are followed through the recording at their orders and weighted like
the rest. What a damaged tooth or a worn gear would add, and what other operating points would do,
is foretold by the machine's expected lines, carried to the seat by the path that the recording
shows: measured over expected amplitude of every mesh harmonic that is heard. Between them the path
is straight on logarithmic scales, beyond them constant; all that is no mesh line stays as it is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.errors import ArgumentError, check_type
from gearmon.exposure.measures import Exposure, vibration_exposure
from gearmon.gears.kinematics import Kinematics, kinematics
from gearmon.machine import Machine, MachineLike, load_machine
from gearmon.result import Result
from gearmon.signals.bad_samples import sound_part
from gearmon.signals.orders.lines import OrderBlocks
from gearmon.signals.recording import Recording, RecordingLike, read_recording
from gearmon.signatures.expected.baseline import expected_signature
from gearmon.signatures.measured.measurement import MeasuredSignature, measure_signature
from gearmon.signatures.signature import Signature

#: Harmonics of shafts, and sidebands to either side of a mesh harmonic, that are looked for.
SHAFT_HARMONICS, SIDEBANDS = 4, 3
#: Lines nearer than so many reciprocal block lengths are one: the main lobe of a Hann window.
_APART = 2.0
# Share of the sampling rate up to which order lines are measured, and their leakage.
_TOP, _LEAKAGE = 0.48, 1e-4


@dataclass(frozen=True, kw_only=True)
class LineShare:
    """Lines of one shaft or mesh in what is felt.

    Parameters
    ----------
    name : str
        "shaft 1", "mesh 1" or "sidebands of mesh 1".
    frequency_hz : float
        Of the first of them.
    weighted_ms2 : tuple of float
        Their weighted rms, times k, axis by axis [m/s2].
    share : tuple of float
        Of the weighted mean square of the axis.
    """

    name: str
    frequency_hz: float
    weighted_ms2: tuple[float, ...]
    share: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class PointExposure:
    """What would be felt at one operating point.

    Parameters
    ----------
    name : str
    speed_rpm : float
    gears_ms2 : float
        Weighted rms of the mesh lines, over all axes, times k [m/s2].
    value_ms2 : float
        What is compared with limits, if all but the mesh lines stays as it was [m/s2].
    damaged_ms2 : float or None
        The same with the fault; None where none was named.
    """

    name: str
    speed_rpm: float
    gears_ms2: float
    value_ms2: float
    damaged_ms2: float | None


@dataclass(frozen=True, kw_only=True)
class GearShare(Result):
    """The gearbox in what a person feels.

    Parameters
    ----------
    recording, machine : str
    speed_hz : float or None
        Of shaft 1; None where no mesh was found.
    axes : tuple of str
    share : tuple of float
        Of the weighted mean square that stands on lines of shafts and meshes, axis by axis.
    lines : tuple of LineShare
    faults : tuple of str
    points : tuple of PointExposure
        Best first; empty where they cannot be foretold.
    warnings : tuple of str
    """

    picture: ClassVar[str] = "survey_plots.gear_share_figure"

    recording: str
    machine: str
    speed_hz: float | None = None
    axes: tuple[str, ...]
    share: tuple[float, ...] = ()
    lines: tuple[LineShare, ...] = ()
    faults: tuple[str, ...]
    points: tuple[PointExposure, ...] = ()
    warnings: tuple[str, ...]

    def headline(self) -> str:
        """Return the shares in a sentence."""
        if self.speed_hz is None:
            return "no mesh found: the share of the gearbox is not known"
        told = [f"{a} {100 * s:.2g} %" for a, s in zip(self.axes, self.share, strict=True)]
        return f"on lines of shafts and meshes: {', '.join(told)} of what is felt"

    def rows(self) -> list[dict[str, Any]]:
        """Return a row a shaft or mesh, its shares axis by axis."""
        names = ("lines", "frequency_hz", *(f"share_{axis}" for axis in self.axes))
        rows = [(own.name, own.frequency_hz, *own.share) for own in self.lines]
        return [dict(zip(names, row, strict=True)) for row in rows]


def gear_share(
    recording: RecordingLike, exposure: Exposure, machine: MachineLike, faults: Iterable[str] = ()
) -> GearShare:
    """Tell the share of a gearbox in what is felt, and what damage would add.

    Parameters
    ----------
    recording : Recording, str or Path
        With the channels of `exposure`, and perhaps a tacho.
    exposure : Exposure
        Of it.
    machine : Machine, path or dict
        What it takes beyond tooth counts is asked for where faults are named.
    faults : iterable of str
        Such as "wear:1:pinion:all:20%" or "crack:1:pinion:5:40%".

    Returns
    -------
    GearShare

    Raises
    ------
    GearmonError
        If the recording is too short for the machine, or a fault cannot be.

    Examples
    --------
    >>> felt = gearmon.vibration_exposure(new, "hand", {"x": "a1", "y": "a2"})
    >>> found = gearmon.gear_share(new, felt, machine, ["wear:1:pinion:all:20%"])
    >>> found.axes, [0.0 < own <= 1.0 for own in found.share]
    (('x', 'y'), [True, True])
    """
    check_type("exposure", exposure, Exposure, "what gearmon.vibration_exposure returns")
    machine, named = load_machine(machine), tuple(faults)
    whole = read_recording(recording, sensors=machine.sensors)
    part = sound_part(whole)
    if part.samples.shape[1] < whole.samples.shape[1]:
        channels = {axis.axis: axis.channel for axis in exposure.axes}
        exposure = vibration_exposure(part, exposure.position, channels)
    signature = measure_signature(part, machine)
    found = GearShare(
        recording=exposure.recording,
        machine=machine.name,
        axes=tuple(axis.axis for axis in exposure.axes),
        faults=named,
        # those of the recording stand with what is felt
        warnings=tuple(own for own in signature.notes if own not in exposure.warnings),
    )
    if not signature.found:
        return found
    heard = _Heard(part, exposure, kinematics(machine), signature)
    points, note = heard.points(machine, named)
    lines = []
    for name in dict.fromkeys(heard.names.tolist()):
        own = heard.names == name
        square = heard.weighted[:, own].sum(axis=1)
        line = LineShare(
            name=name,
            frequency_hz=float(heard.frequency_hz[own][0]),
            weighted_ms2=tuple(np.sqrt(square).tolist()),
            share=tuple((square / np.maximum(heard.felt, np.finfo(float).tiny)).tolist()),
        )
        lines.append(line)
    share = tuple(np.sum([own.share for own in lines], axis=0).tolist())
    told: dict[str, Any] = {"share": share, "lines": tuple(lines), "points": tuple(points)}
    return replace(found, speed_hz=heard.shaft1_hz, warnings=(*found.warnings, note), **told)


class _Heard:
    """Lines of shafts and meshes as they were recorded in the channels of the axes.

    Arrays of the shape (lines,), with axes (axes, lines). Mean squares are without those of noise:
    of the acceleration as recorded, and as felt. What is felt in all has the shape (axes,).
    """

    def __init__(
        self, part: Recording, exposure: Exposure, train: Kinematics, signature: MeasuredSignature
    ) -> None:
        rate, block_turns = part.sampling_rate_hz, signature.lines.block_turns
        self.shaft1_hz, self.exposure = signature.speed.estimated_hz, exposure
        named = _orders(train, _TOP * rate / self.shaft1_hz, _APART / block_turns)
        self.order = np.array(sorted(named))
        self.names = np.array([named[own] for own in self.order])
        self.frequency_hz = self.order * self.shaft1_hz
        samples = part.select([axis.channel for axis in exposure.axes]).samples
        track = signature.track
        blocks = OrderBlocks(samples, rate, track, self.order, block_turns, error=_LEAKAGE)
        lines = blocks.lines()
        power = np.maximum(lines.cross_power(), 0.0)
        self.square, self.above_noise = power / 2, power / lines.noise
        self.weighted = self.square * self.weight(self.frequency_hz)
        self.felt = np.array([(axis.factor * axis.rms_ms2) ** 2 for axis in exposure.axes])

    def weight(self, frequency_hz: FloatArray) -> FloatArray:
        """Return k^2 |W|^2 of every axis, shape (axes, lines)."""
        return np.square([axis.gain(frequency_hz) for axis in self.exposure.axes])

    def points(self, machine: Machine, faults: tuple[str, ...]) -> tuple[list[PointExposure], str]:
        """Foretell every operating point, healthy and damaged; say how far that goes."""
        numbers = range(len(machine.operating))
        try:
            healthy = [expected_signature(machine, operating=number) for number in numbers]
        except ArgumentError as error:
            if faults:
                raise
            return [], f"operating points are not foretold: {error}"
        speeds = [point.shaft1_hz for point in machine.operating]
        here = healthy[min(numbers, key=lambda number: abs(speeds[number] - self.shaft1_hz))]
        # the path: frequencies, and gains to every axis where all axes hear a mesh harmonic
        on_mesh, known, gains = np.char.startswith(self.names, "mesh"), [], []
        for line in np.flatnonzero(on_mesh & (self.above_noise > 1).all(axis=0)):
            near = np.abs(here["order"] / self.order[line] - 1) < 1e-9
            expected = float(np.square(here["acceleration_ms2"][near]).sum()) / 2
            if expected > 0:
                known.append(self.frequency_hz[line])
                gains.append(self.square[:, line] / expected)
        if not known:
            return [], "no mesh line stands clear on all axes: operating points are not foretold"

        def through(lines: Signature) -> FloatArray:
            """Return the weighted mean square that expected lines make at every axis."""
            frequency = lines["frequency_hz"]
            at, levels = np.log(frequency), np.log(gains).T
            path = np.exp([np.interp(at, np.log(known), own) for own in levels])
            square = np.square(lines["acceleration_ms2"]) / 2
            return np.asarray((path * self.weight(frequency) * square).sum(axis=1))

        # what is compared with limits, of mean squares axis by axis
        compared = np.sum if self.exposure.position == "hand" else np.max
        rest = np.maximum(self.felt - self.weighted[:, on_mesh].sum(axis=1), 0.0)
        points = []
        for number, point in enumerate(machine.operating):
            gears, damaged = through(healthy[number]), None
            if faults:
                worn = expected_signature(machine, faults, operating=number)
                damaged = math.sqrt(compared(rest + through(worn)))
            points.append(
                PointExposure(
                    name=point.name or f"{point.speed_rpm:g} rpm",
                    speed_rpm=point.speed_rpm,
                    gears_ms2=math.sqrt(gears.sum()),
                    value_ms2=math.sqrt(compared(rest + gears)),
                    damaged_ms2=damaged,
                )
            )
        low, high = known[0], known[-1]
        note = f"the path is known from {low:.4g} to {high:.4g} Hz, and taken as constant beyond"
        return sorted(points, key=lambda own: own.value_ms2), note


def _orders(train: Kinematics, top: float, apart: float) -> dict[float, str]:
    """Return orders and what each belongs to; of those too near the first in rank stays."""
    wanted = []
    for mesh in train.meshes:
        for k in range(1, int(top / mesh.order) + 1):
            centres = mesh.healthy_orders(k)
            wanted += [(0, order, f"mesh {mesh.stage}") for order in centres]
            for family in mesh.modulations:
                shifts = [s * family.order for s in range(-SIDEBANDS, SIDEBANDS + 1) if s]
                told = f"sidebands of mesh {mesh.stage}"
                wanted += [(2, order + shift, told) for order in centres for shift in shifts]
    for shaft in train.shafts:
        own = [k * shaft.order for k in range(1, SHAFT_HARMONICS + 1)]
        wanted += [(1, order, f"shaft {shaft.number}") for order in own]
    kept: dict[float, str] = {}
    for _, order, name in sorted(wanted):
        if apart < order < top and all(abs(order - other) > apart for other in kept):
            kept[order] = name
    return kept
