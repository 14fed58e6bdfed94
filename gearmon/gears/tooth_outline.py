"""A pair of teeth to scale: outlines in contact, with cracks, spalls and pits where they are."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.gears.faults import Fault
from gearmon.gears.tooth import Tooth
from gearmon.gears.tooth_damage import ToothDamage, tooth_damage
from gearmon.gears.tooth_pairs import ToothPair

#: Points of each curve of an outline.
POINTS = 60


_GONE = ("breakage", "missing")
#: Half thickness and height.
Curve = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class FlankMark:
    """A damaged part of a flank, seen from the mate.

    Parameters
    ----------
    kind : str
    face_start_mm, face_width_mm : float
        Along the face, from the side that enters contact first.
    low_mm, high_mm : float
        Heights above the root circle.
    """

    kind: str
    face_start_mm: float
    face_width_mm: float
    low_mm: float
    high_mm: float


@dataclass(frozen=True, kw_only=True, eq=False)
class TeethPicture:
    """Two gears in contact, cut square to their flanks; all points in mm, shape (n, 2).

    Parameters
    ----------
    names : (str, str)
    outlines : (ndarray, ndarray)
        Five teeth of each gear; the loaded ones in the middle.
    contact : ndarray, shape (2,)
    cracks : tuple of ndarray
        Lines.
    holes : tuple of ndarray
        Outlines of missing material.
    gone : tuple of ndarray
        Outlines of broken-off or missing teeth.
    marks : dict of str to tuple of FlankMark
        Damage on the flank of each gear.
    flank_sizes_mm : dict of str to (float, float, float)
        Face width, height of the flank's lower end and of the tip above the root circle.
    """

    names: tuple[str, str]
    outlines: tuple[FloatArray, FloatArray]
    contact: FloatArray
    cracks: tuple[FloatArray, ...]
    holes: tuple[FloatArray, ...]
    gone: tuple[FloatArray, ...]
    marks: dict[str, tuple[FlankMark, ...]]
    flank_sizes_mm: dict[str, tuple[float, float, float]]


@dataclass(frozen=True)
class _Frame:
    """Where a tooth stands, as complex numbers: centre, and direction of its thickness.

    Its height points a quarter turn ahead of its thickness.
    """

    centre: complex
    across: complex

    def place(self, half: FloatArray, height: FloatArray) -> FloatArray:
        points = 1e3 * (self.centre + (half + 1j * height) * self.across)
        return np.stack([points.real, points.imag], axis=-1)

    def between(self, one: Curve, other: Curve) -> FloatArray:
        """Place the line along one curve and back along the other."""
        half, height = (np.concatenate([a, b[::-1]]) for a, b in zip(one, other, strict=True))
        return self.place(half, height)


def teeth_picture(
    pair: ToothPair, faults: Sequence[Fault] = (), phase: float | None = None
) -> TeethPicture:
    """Return the picture of a pair of teeth in contact.

    Parameters
    ----------
    pair : ToothPair
    faults : sequence of Fault
        Drawn on the loaded tooth of their gear where their sizes are no losses.
    phase : float, optional
        Contact phase [mesh periods]; by default the middle of the contact.
    """
    roll = float(pair.roll(0.5 * pair.contact_ratio if phase is None else phase))
    frames = _frames(pair, roll)
    measured = [fault for fault in faults if not fault.is_loss]
    cracks: list[FloatArray] = []
    holes: list[FloatArray] = []
    gone: list[FloatArray] = []
    marks: dict[str, tuple[FlankMark, ...]] = {}
    for tooth, frame in zip(pair.teeth, frames, strict=True):
        own = [fault for fault in measured if fault.gear == tooth.name]
        damage = tooth_damage([f for f in own if f.kind in ("crack", "spall", "pitting")], tooth)
        cracks += _cracks(damage, tooth, frame)
        holes += _holes(damage, tooth, frame)
        gone += [_gone(fault, tooth, frame) for fault in own if fault.kind in _GONE]
        marks[tooth.name] = tuple(_marks(damage, own, tooth))
    angle = np.array([pair.first.angle(roll)])
    touching = frames[0].place(pair.first.half_thickness(angle), pair.first.height(angle))
    return TeethPicture(
        names=(pair.first.name, pair.second.name),
        outlines=(_outline(pair.first, frames[0]), _outline(pair.second, frames[1])),
        contact=touching[0],
        cracks=tuple(cracks),
        holes=tuple(holes),
        gone=tuple(gone),
        marks=marks,
        flank_sizes_mm={tooth.name: _flank_size(tooth) for tooth in pair.teeth},
    )


def half_profile(tooth: Tooth) -> Curve:
    """Return half thickness and height [m] of the loaded side, from the root circle to the tip."""
    t = np.linspace(tooth.start, tooth.tip, POINTS)
    half, height = tooth.half_thickness(t), tooth.height(t)
    part = tooth.root_part
    if part is None:
        return half, height
    low_height, low_half = part.at(np.linspace(0, 1, POINTS))
    return np.concatenate([low_half, half]), np.concatenate([low_height, height])


def _frames(pair: ToothPair, roll: float) -> tuple[_Frame, _Frame]:
    """Place both teeth so that their flanks touch at this roll length of the first.

    The second gear stands above the first, a ring around it with its centre below.
    """
    centres, working = pair.centres_m
    # the normal of the flank turns into the line of action
    one, two = (
        cmath.exp(1j * (working - float(tooth.slope(tooth.angle(own)))))
        for tooth, own in zip(pair.teeth, pair.rolls(np.array(roll)), strict=True)
    )
    return _Frame(0j, one), _Frame(1j * centres, -two)


def _outline(tooth: Tooth, frame: _Frame) -> FloatArray:
    half, height = half_profile(tooth)
    ends, pitch = ((-half, height), (half, height)), tooth.sign * 2 * math.pi / tooth.teeth
    # teeth one after the other across the tooth in the middle
    turns = [cmath.exp(-1j * k * pitch) for k in range(-2, 3)]
    placed = (replace(frame, across=frame.across * turn) for turn in turns)
    return np.concatenate([own.between(*ends) for own in placed])


def _cracks(damage: ToothDamage, tooth: Tooth, frame: _Frame) -> list[FloatArray]:
    if damage.crack is None:
        return []
    height, half = tooth.crack_start
    depth, angle = damage.crack.depths[1], damage.crack.angle_rad
    ends = np.array([half, half - depth * math.sin(angle)])
    return [frame.place(ends, np.array([height, height - depth * math.cos(angle)]))]


def _holes(damage: ToothDamage, tooth: Tooth, frame: _Frame) -> list[FloatArray]:
    found = []
    for hole in damage.holes:
        t = np.linspace(*hole.angles(tooth), POINTS)
        half, height = tooth.half_thickness(t), tooth.height(t)
        across = np.linspace(-1, 1, POINTS) if hole.round else np.zeros(POINTS)
        depth = hole.depth_m * np.sqrt(1 - across**2)
        slope = tooth.slope(t)
        inner_half, inner_height = half - depth * np.cos(slope), height - depth * np.sin(slope)
        found.append(frame.between((half, height), (inner_half, inner_height)))
    return found


def _gone(fault: Fault, tooth: Tooth, frame: _Frame) -> FloatArray:
    half, height = half_profile(tooth)
    if fault.kind == "breakage" and fault.shape.height is not None:
        lowest = tooth.sign * tooth.radius_below_tip(1e-3 * fault.shape.height)
        kept = height >= lowest
        half, height = half[kept], height[kept]
    return frame.between((-half, height), (half, height))


def _marks(damage: ToothDamage, faults: Sequence[Fault], tooth: Tooth) -> list[FlankMark]:
    width, root = 1e3 * tooth.face_width_m, 1e3 * tooth.root_height_m
    crack, top = damage.crack, 1e3 * float(tooth.height(tooth.tip)) - root
    found = []
    if crack is not None:
        start = 1e3 * tooth.crack_start[0] - root
        found.append(FlankMark("crack", width * crack.start, width * crack.extent, start, start))
    for hole in damage.holes:
        kind, start = ("pits", 0.0) if hole.round else ("spall", width * hole.start)
        low, high = 1e3 * hole.low_m - root, 1e3 * hole.high_m - root
        found.append(FlankMark(kind, start, 1e3 * hole.width_m, low, high))
    for fault in faults:
        if fault.kind in _GONE:
            share = width if fault.kind == "missing" else fault.size
            lost = top if fault.shape.height is None else fault.shape.height
            found.append(FlankMark(fault.kind, fault.shape.start or 0.0, share, top - lost, top))
    return found


def _flank_size(tooth: Tooth) -> tuple[float, float, float]:
    root = tooth.root_height_m
    low = float(tooth.height(tooth.start)) - root
    return 1e3 * tooth.face_width_m, 1e3 * low, 1e3 * (float(tooth.height(tooth.tip)) - root)
