"""What measured damage looks like on a tooth: cracks, spalls, pits and wear in metres."""

from __future__ import annotations

import math
from collections.abc import Sequence

from gearmon.errors import ArgumentError
from gearmon.gears.fault_shapes import flank_share
from gearmon.gears.faults import Fault
from gearmon.gears.tooth import Tooth
from gearmon.gears.tooth_damage import Hole, RootCrack, ToothDamage

#: Usual radius and depth of round pits, in modules.
PIT_RADIUS, PIT_DEPTH = 0.1, 0.1
#: Part of the face width that the pits of a row take, usually and at most; rows overlap by half.
PIT_FILL, LARGEST_FILL = 0.3, 0.55


def tooth_damage(faults: Sequence[Fault], tooth: Tooth) -> ToothDamage:
    """Return what measured faults do to the sections of a tooth.

    Parameters
    ----------
    faults : sequence of Fault
        Of one tooth; broken-off and missing teeth and losses of stiffness are left aside.
    tooth : Tooth
    """
    cracks = [_crack(fault, tooth) for fault in faults if fault.kind == "crack"]
    holes: list[Hole] = []
    for fault in faults:
        if fault.kind == "spall":
            holes.append(_spall(fault, tooth))
        elif fault.kind == "pitting":
            holes += _pits(fault, tooth)
    if len(cracks) > 1:
        raise ArgumentError(f"fault {faults[0]}: a tooth can have one root crack in mm, not more")
    wear = sum(1e-3 * fault.size for fault in faults if fault.kind == "wear")
    return ToothDamage(crack=cracks[0] if cracks else None, holes=tuple(holes), wear_m=wear)


def largest_size(fault: Fault, tooth: Tooth) -> float:
    """Return the largest size of a kind of damage on a tooth, in the unit of the fault."""
    width = 1e3 * tooth.face_width_m
    if fault.kind in ("spall", "breakage"):
        start = fault.shape.start or 0.0
        return 0.98 * (width - start)
    if fault.kind == "pitting":
        return 0.5 if fault.unit == "flank" else 50.0
    thickness = float(tooth.half_thickness(tooth.tip))
    if fault.kind == "wear":
        return 0.85 * 2e3 * thickness * math.cos(tooth.tip)
    root = tooth.crack_start[1]
    sine = math.sin(math.radians(60 if fault.shape.angle is None else fault.shape.angle))
    return 0.96e3 * min(root + thickness, 2 * root) / sine


def _crack(fault: Fault, tooth: Tooth) -> RootCrack:
    shape, width = fault.shape, 1e3 * tooth.face_width_m
    extent = (shape.width or width) / width
    start = (shape.start or 0.0) / width
    if start + extent > 1 + 1e-9:
        raise ArgumentError(
            f"fault {fault}: the crack reaches over the face width of {width:g} mm; width and from "
            f"must add up to less"
        )
    return RootCrack(
        depth_m=1e-3 * fault.size,
        angle_rad=math.radians(60 if shape.angle is None else shape.angle),
        far_depth_m=None if shape.far is None else 1e-3 * shape.far,
        extent=extent,
        start=start,
        limit="parabolic" if shape.limit == "parabolic" else "flat",
    )


def _spall(fault: Fault, tooth: Tooth) -> Hole:
    shape = fault.shape
    if shape.length is None or shape.depth is None:
        raise ArgumentError(f"fault {fault}: a spall needs width x length x depth")
    width, start = 1e-3 * fault.size, 1e-3 * (shape.start or 0.0)
    if start + width > tooth.face_width_m * (1 + 1e-9):
        raise ArgumentError(
            f"fault {fault}: the spall reaches over the face width of "
            f"{1e3 * tooth.face_width_m:g} mm; width and from must add up to less"
        )
    middle = _pitch_height(tooth) + 1e-3 * (shape.at or 0.0)
    half = 0.5e-3 * shape.length
    if not tooth.height(tooth.start) < middle < tooth.height(tooth.tip):
        raise ArgumentError(f"fault {fault}: at={shape.at:g} mm lies outside the flank")
    return Hole(
        low_m=middle - half,
        high_m=middle + half,
        width_m=width,
        depth_m=1e-3 * shape.depth,
        start=start / tooth.face_width_m,
    )


def _pits(fault: Fault, tooth: Tooth) -> list[Hole]:
    """Return rows of staggered round pits about the pitch line, more rows for a larger share."""
    shape, share = fault.shape, flank_share(fault.size, fault.unit)
    if share == 0:
        return []
    radius = 1e-3 * shape.radius if shape.radius else PIT_RADIUS * tooth.module_m
    depth = 1e-3 * shape.depth if shape.depth else PIT_DEPTH * tooth.module_m
    low, high = float(tooth.height(tooth.start)), float(tooth.height(tooth.tip))
    rows = _rows(_pitch_height(tooth), low, high, radius)
    # area of a row that fills the face width to the part f: f b pi r/2
    filled = share * (high - low) / (0.5 * math.pi * radius)
    # the usual fill as long as there are rows, so that every section only loses with the share
    fill = max(PIT_FILL, filled / len(rows)) if rows else math.inf
    if fill > LARGEST_FILL:
        raise ArgumentError(
            f"fault {fault}: pits of radius {1e3 * radius:g} mm do not fit on {share:.0%} of the "
            f"flank of the {tooth.name}; give a smaller radius"
        )
    fills = [min(fill, filled - fill * i) for i in range(len(rows))]
    return [
        Hole(
            low_m=row - radius,
            high_m=row + radius,
            width_m=part * tooth.face_width_m,
            depth_m=depth,
            round=True,
        )
        for row, part in zip(rows, fills, strict=True)
        if part > 1e-12
    ]


def _rows(middle: float, low: float, high: float, radius: float) -> list[float]:
    """Return heights of rows one radius apart: on the pitch line, below, above, below ..."""
    count = int((high - low) / radius) + 1
    steps = [0, *(sign * n for n in range(1, count) for sign in (-1, 1))]
    rows = [middle + radius * step for step in steps]
    return [row for row in rows if low + radius <= row <= high - radius]


def _pitch_height(tooth: Tooth) -> float:
    return float(tooth.height(tooth.angle_at_radius(tooth.reference_radius_m)))
