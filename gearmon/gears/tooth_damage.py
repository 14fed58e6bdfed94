"""Damage of one tooth as a change of its sections: root crack, spalls and pits, wear.

Sizes are metres here. A section across the tooth has area A and second moment I; a crack cuts a
part of its thickness away, a spall takes a rectangle off the loaded side. `tooth_damage` gives the
damage that measured faults mean.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.errors import ArgumentError
from gearmon.gears.faults import Fault, flank_share

if TYPE_CHECKING:
    from gearmon.gears.tooth import Tooth

#: Slices of the face over which a crack of varying depth is averaged: losses of pairs are then
#: known to 1e-4 of themselves.
WIDTH_SLICES = 128
#: By how many depths of a crack the fillet flares that it shields, see `RootCrack`.
FLARE = 2.0
#: Panels across a round pit, graded towards its ends where its width has a vertical tangent.
PIT_PANELS = 4
#: Largest part of the face width that pits may take at one height.
LARGEST_WIDTH = 0.98


#: Usual radius and depth of round pits, in modules.
PIT_RADIUS, PIT_DEPTH = 0.1, 0.1
#: Part of the face width that the pits of a row take, usually and at most; rows overlap by half.
PIT_FILL, LARGEST_FILL = 0.3, 0.55


@dataclass(frozen=True, kw_only=True)
class RootCrack:
    """Straight crack from the root on the loaded side into the tooth.

    Parameters
    ----------
    depth_m : float
        q, length of the crack where it is deepest [m].
    angle_rad : float
        Angle between crack and middle of the tooth, commonly 45 to 70 degrees.
    far_depth_m : float, optional
        Depth at the other end of the cracked part of the face; by default `depth_m`. In between
        ``q^2`` is linear (Chen & Shao 2011).
    extent : float, in (0, 1]
        Part of the face width that is cracked.
    start : float, in [0, 1)
        Where along the face the cracked part begins, from the side that enters contact first.
    limit : {"flat", "parabolic"}
        Line up to which the cracked side carries.

    Notes
    -----
    The crack is open: it lies at the root of the loaded flank, which is in tension. Under load on
    the other flank it would close and carry again; that is not this state.

    Flat limit line (Wu, Zuo & Parey 2008): on the cracked side the half thickness is at most
    ``h_cr = h_root - q sin(angle)``. Against finite elements with a slit this under-predicts the
    effect of shallow cracks by up to 45 % and over-predicts that of deep ones near the tip.

    A crack without depth takes nothing. Where the sound tooth is thicker than the line of such a
    crack, mostly in the fillet below its start, the surplus ``h - h_root`` goes as the crack grows:
    ``h_lim = h_cr + max(h - h_root - 2 q, 0)``. A crack shields the material to about its own
    depth beside it, over which a fillet flares by twice that. Cracks from a sixth of the module on
    leave nothing of it, so that theirs is the line of the sources.

    Parabolic limit line (after Mohammed, Rantatalo & Aidanpaa 2013): above the start of the crack
    ``h_lim^2 = h_tip^2 + (h_cr^2 - h_tip^2)(y_tip - y)/(y_tip - y_start)``, so that the corner of
    the tip carries again; below it the flat line. Of a crack past the middle of the tooth it is
    ``h_lim = h_cr + (h_tip - h_cr) sqrt[(y - y_start)/(y_tip - y_start)]``.
    With the load near the tip it follows finite elements within 3 % of the sound compliance; with
    the load in the middle it under-predicts as the flat line does.
    """

    depth_m: float
    angle_rad: float = math.radians(60)
    far_depth_m: float | None = None
    extent: float = 1.0
    start: float = 0.0
    limit: str = "flat"

    @property
    def depths(self) -> tuple[float, float]:
        """Least and greatest depth [m]."""
        return min(self.depth_m, self._far), max(self.depth_m, self._far)

    @property
    def _far(self) -> float:
        return self.depth_m if self.far_depth_m is None else self.far_depth_m

    def at(self, places: FloatArray) -> FloatArray:
        """Return the depth [m] at shares of the face width."""
        along = (places - self.start) / self.extent
        square = self.depth_m**2 + (self._far**2 - self.depth_m**2) * along
        inside = (along >= 0) & (along <= 1)
        return np.where(inside, np.sqrt(np.maximum(square, 0.0)), 0.0)

    @property
    def slices(self) -> FloatArray:
        """Depths [m] of slices of the cracked part of the face."""
        low, high = self.depths
        count = 1 if high - low < 1e-9 * high else WIDTH_SLICES
        return self.at(self.start + self.extent * (np.arange(count) + 0.5) / count)

    def limits_m(self, tooth: Tooth) -> FloatArray:
        """Return the limit lines h_cr of the least and of the greatest depth [m]."""
        return tooth.crack_start.real - np.array(self.depths) * math.sin(self.angle_rad)

    def carrying(self, tooth: Tooth, point: ComplexArray, depth: FloatArray | float) -> FloatArray:
        """Return the half thickness [m] up to which sections carry where the crack is so deep.

        Parameters
        ----------
        tooth : Tooth
        point : complex ndarray
            Half thickness + i height of the sound sections [m].
        depth : array_like
            [m]
        """
        kept = point.real - self._line(tooth, point.imag, 0.0) - FLARE * np.asarray(depth)
        return np.asarray(self._line(tooth, point.imag, depth) + np.maximum(kept, 0.0))

    def _line(self, tooth: Tooth, height: FloatArray, depth: FloatArray | float) -> FloatArray:
        """Return the limit line [m] of a crack so deep."""
        cut = tooth.crack_start.real - np.asarray(depth) * math.sin(self.angle_rad)
        if self.limit == "flat":
            return np.asarray(cut + np.zeros_like(height))
        top, tip = float(tooth.height(tooth.tip)), float(tooth.half_thickness(tooth.tip))
        low = np.clip((top - height) / (top - tooth.crack_start.imag), 0.0, 1.0)
        # past the middle of the tooth the parabola hangs from the crack itself
        base = np.minimum(cut, 0.0)
        square = np.maximum(cut, 0.0) ** 2 * low + (tip - base) ** 2 * (1 - low)
        return np.asarray(base + np.sqrt(square))


@dataclass(frozen=True, kw_only=True)
class Hole:
    """Material missing from the loaded flank: a rectangle, or round pits in a row.

    Parameters
    ----------
    low_m, high_m : float
        Heights between which it lies, measured from the gear's centre along the tooth [m].
    width_m : float
        Along the face [m]; of round pits the number of pits times their diameter.
    depth_m : float
        Into the tooth [m].
    round : bool
    start : float, in [0, 1)
        Where along the face it begins.
    is_touched : bool
        Whether the contact that passes it is shortened, as in the formulas of the literature
        (Chaari 2008). Not where the face over it counts as lost altogether, see
        `damage.measured_losses`.
    """

    low_m: float
    high_m: float
    width_m: float
    depth_m: float
    round: bool = False
    start: float = 0.0
    is_touched: bool = True

    def angles(self, tooth: Tooth) -> tuple[float, float]:
        """Return the profile angles between which it lies, clipped to the involute."""
        return tooth.angle_at_height(self.low_m), tooth.angle_at_height(self.high_m)

    def width(self, height: FloatArray) -> FloatArray:
        """Return the missing width [m] at a height."""
        if not self.round:
            inside = (height > self.low_m) & (height < self.high_m)
            return np.where(inside, self.width_m, 0.0)
        x = (2 * height - self.low_m - self.high_m) / (self.high_m - self.low_m)
        return np.asarray(self.width_m * np.sqrt(np.maximum(1 - x * x, 0.0)))

    @property
    def edges_m(self) -> FloatArray:
        """Heights [m] of the corners of its outline, graded for round pits."""
        if not self.round:
            return np.array([self.low_m, self.high_m])
        x = np.cos(np.linspace(0, np.pi, PIT_PANELS + 1))
        return np.asarray(0.5 * (self.low_m + self.high_m) - 0.5 * (self.high_m - self.low_m) * x)


@dataclass(frozen=True, kw_only=True)
class ToothDamage:
    """Everything that is wrong with one tooth; by default nothing.

    Parameters
    ----------
    crack : RootCrack, optional
    holes : tuple of Hole
    wear_m : float
        Material worn off the loaded flank, normal to it [m].
    """

    crack: RootCrack | None = None
    holes: tuple[Hole, ...] = ()
    wear_m: float = 0.0

    @property
    def is_none(self) -> bool:
        """Whether the tooth is sound."""
        cracked = self.crack is not None and self.crack.depths[1] > 0
        return not (cracked or self.wear_m or any(hole.width_m for hole in self.holes))

    def check(self, tooth: Tooth) -> None:
        """Refuse damage that leaves nothing of the tooth.

        Raises
        ------
        ArgumentError
        """
        name = tooth.name
        if self.crack is not None:
            most = 0.97 * deepest_crack(tooth, self.crack.angle_rad)
            if self.crack.depths[1] > most:
                raise ArgumentError(
                    f"crack of {1e3 * self.crack.depths[1]:.4g} mm cuts the tooth of the {name} "
                    f"off: its depth must lie in [0, {1e3 * most:.4g}] mm; beyond it is a breakage"
                )
        thinnest = 2 * float(tooth.half_thickness(tooth.tip))
        most = 0.9 * thinnest * math.cos(tooth.tip)
        if self.wear_m >= most:
            raise ArgumentError(
                f"wear of {1e3 * self.wear_m:.4g} mm consumes the tip of the {name}, which is "
                f"{1e3 * thinnest:.4g} mm thick; it must be below {1e3 * most:.4g} mm"
            )
        for hole in self.holes:
            if hole.depth_m >= 0.9 * thinnest:
                raise ArgumentError(
                    f"spall depth of {1e3 * hole.depth_m:.4g} mm passes through the tooth of the "
                    f"{name}; it must be below {0.9e3 * thinnest:.4g} mm"
                )

    def corners(self, tooth: Tooth) -> FloatArray:
        """Return the profile angles at which the sections of the involute are not smooth."""
        found = [] if self.crack is None else self._crack_corners(tooth, self.crack)
        edges = [height for hole in self.holes for height in hole.edges_m.tolist()]
        return np.array([*found, *map(tooth.angle_at_height, edges)], dtype=np.float64)

    def root_levels(self, tooth: Tooth) -> FloatArray:
        """Return the half thicknesses [m] at which a crack leaves corners in the root."""
        if self.crack is None:
            return np.zeros(0)
        # the line begins where the crack does, and below it ends in what is left of the fillet
        start = tooth.crack_start.real
        kept = start + FLARE * np.array(self.crack.depths)
        return np.array([start, *kept, *self.crack.limits_m(tooth)])

    def missing_width_m(self, height: FloatArray) -> FloatArray:
        """Return by how much all holes together shorten a contact at a height [m]."""
        widths = (hole.width(height) for hole in self.holes if hole.is_touched)
        return np.asarray(sum(widths, np.zeros(height.shape)))

    def sections(
        self, tooth: Tooth, point: ComplexArray, cosine: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return area [m2] and second moment [m4] of sections across a tooth.

        Parameters
        ----------
        tooth : Tooth
        point : complex ndarray
            Half thickness + i height of the sound tooth [m].
        cosine : ndarray, optional
            Cosine of the profile angle, on the involute; not in the root, which neither wears nor
            has holes.

        Notes
        -----
        ``A = b (h + h_lim)``, ``I = b (h + h_lim)^3/12`` averaged over the face width, its sound
        part and slices of the crack; less the holes, with the composite section about its own
        centroid.
        """
        half, holes = point.real, () if cosine is None else self.holes
        loaded = half if cosine is None else half - self.wear_m / cosine
        width, thickness = tooth.face_width_m, half + loaded
        linear, cubic = thickness, thickness**3
        if self.crack is not None:
            crack, share = self.crack, self.crack.extent
            depths = crack.slices.reshape(-1, *[1] * half.ndim)
            cut = half + np.minimum(loaded, crack.carrying(tooth, point, depths))
            linear = share * cut.mean(axis=0) + (1 - share) * linear
            cubic = share * (cut**3).mean(axis=0) + (1 - share) * cubic
        area, inertia = width * linear, width * cubic / 12
        whole = area
        for depth in sorted({hole.depth_m for hole in holes}):
            widths = [hole.width(point.imag) for hole in holes if hole.depth_m == depth]
            lost = np.minimum(np.sum(widths, axis=0), LARGEST_WIDTH * width)
            removed, arm = lost * depth, 0.5 * whole / width - 0.5 * depth
            inertia = inertia - lost * depth**3 / 12 - area * removed * arm**2 / (area - removed)
            area = area - removed
        return area, inertia

    def _crack_corners(self, tooth: Tooth, crack: RootCrack) -> list[float]:
        found: list[float] = []
        for depth in sorted({0.0, *crack.depths}):

            def beyond(t: FloatArray, depth: float = depth) -> FloatArray:
                point = tooth.flank(t)
                loaded = point.real - self.wear_m / np.cos(t)
                return np.asarray(loaded - crack.carrying(tooth, point, depth))

            found += crossings(beyond, tooth.start, tooth.tip, np.zeros(1)).tolist()
        return found


#: A tooth without damage.
SOUND = ToothDamage()


def crossings(
    curve: Callable[[FloatArray], FloatArray], low: float, high: float, levels: FloatArray
) -> FloatArray:
    """Return where a smooth curve crosses any of `levels` between `low` and `high`."""
    grid = np.linspace(low, high, 65)
    above = curve(grid)[None, :] > levels[:, None]

    def crossing(level: float, left: float, right: float) -> float:
        # a corner found to a millionth of the range spoils an integral by the square of that
        far = 1e-6 * (high - low)

        def off(t: float) -> float:
            return float(curve(np.array(t))) - level

        # where it only touches, rounding tells the sides apart
        if off(left) * off(right) > 0:
            return min(left, right, key=lambda t: abs(off(t)))
        return float(brentq(off, left, right, xtol=far))

    places = zip(*np.nonzero(above[:, 1:] != above[:, :-1]), strict=True)
    return np.array([crossing(levels[i], grid[j], grid[j + 1]) for i, j in places])


def tooth_damage(faults: Sequence[Fault], tooth: Tooth) -> ToothDamage:
    """Return what measured faults do to the sections of a tooth.

    Parameters
    ----------
    faults : sequence of Fault
        Of one tooth; broken-off and missing teeth and losses of stiffness are left aside.
    tooth : Tooth
    """
    cracks = [_crack(fault, tooth) for fault in faults if fault.kind == "crack"]
    makers = {"spall": _spall, "pitting": _pits}
    holes = [hole for f in faults if f.kind in makers for hole in makers[f.kind](f, tooth)]
    if len(cracks) > 1:
        raise ArgumentError(f"fault {faults[0]}: a tooth can have one root crack in mm, not more")
    wear = sum(1e-3 * fault.size for fault in faults if fault.kind == "wear")
    return ToothDamage(crack=cracks[0] if cracks else None, holes=tuple(holes), wear_m=wear)


def largest_size(fault: Fault, tooth: Tooth) -> float:
    """Return the largest size of a kind of damage on a tooth, in the unit of the fault."""
    width = 1e3 * tooth.face_width_m
    if fault.kind in ("spall", "breakage"):
        return 0.98 * (width - (fault.start or 0.0))
    if fault.kind == "pitting":
        return 0.5 if fault.unit == "flank" else 50.0
    if fault.kind == "wear":
        return 0.85 * 2e3 * float(tooth.half_thickness(tooth.tip)) * math.cos(tooth.tip)
    return 0.96e3 * deepest_crack(tooth, _crack_angle(fault))


def deepest_crack(tooth: Tooth, angle_rad: float) -> float:
    """Return the depth [m] at which a root crack has cut the tooth off."""
    root = tooth.crack_start.real
    return min(root + float(tooth.half_thickness(tooth.tip)), 2 * root) / math.sin(angle_rad)


def _crack_angle(fault: Fault) -> float:
    return math.radians(60 if fault.angle is None else fault.angle)


def face_part(fault: Fault, tooth: Tooth) -> tuple[float, float]:
    """Return where along the face a damage begins, and how far it reaches, in face widths.

    Raises
    ------
    ArgumentError
        If it reaches over the face, or the whole face is broken off.
    """
    whole = 1e3 * tooth.face_width_m
    width = fault.width or whole if fault.kind == "crack" else fault.size
    start, share = (fault.start or 0.0) / whole, width / whole
    broken = fault.kind == "breakage"
    if start + share > 1 + 1e-9 or (broken and share > 0.99):
        gone = f"; for a whole tooth write missing:{fault.stage}:{fault.gear}:{fault.tooth}"
        raise ArgumentError(
            f"fault {fault}: the {fault.kind} reaches over the face width of {whole:g} mm; width "
            f"and from must add up to less{gone if broken else ''}"
        )
    return start, share


def _crack(fault: Fault, tooth: Tooth) -> RootCrack:
    start, extent = face_part(fault, tooth)
    return RootCrack(
        depth_m=1e-3 * fault.size,
        angle_rad=_crack_angle(fault),
        far_depth_m=None if fault.far is None else 1e-3 * fault.far,
        extent=extent,
        start=start,
        limit=fault.limit or "flat",
    )


def _spall(fault: Fault, tooth: Tooth) -> list[Hole]:
    start, _ = face_part(fault, tooth)
    middle = _pitch_height(tooth) + 1e-3 * (fault.at or 0.0)
    # no spall in mm is made without length and depth
    half, depth = 0.5e-3 * (fault.length or 0.0), 1e-3 * (fault.depth or 0.0)
    if not tooth.height(tooth.start) < middle < tooth.height(tooth.tip):
        raise ArgumentError(f"fault {fault}: at={fault.at:g} mm lies outside the flank")
    flat = Hole(low_m=middle - half, high_m=middle + half, width_m=1e-3 * fault.size, depth_m=depth)
    return [replace(flat, start=start, is_touched=False)]


def _pits(fault: Fault, tooth: Tooth) -> list[Hole]:
    """Return rows of staggered round pits about the pitch line, more rows for a larger share."""
    share = flank_share(fault.size, fault.unit)
    if share == 0:
        return []
    radius = 1e-3 * fault.radius if fault.radius else PIT_RADIUS * tooth.module_m
    depth = 1e-3 * fault.depth if fault.depth else PIT_DEPTH * tooth.module_m
    low, high = float(tooth.height(tooth.start)), float(tooth.height(tooth.tip))
    # rows one radius apart: on the pitch line, below, above, below ...
    count, middle = int((high - low) / radius), _pitch_height(tooth)
    steps = sorted(range(-count, count + 1), key=abs)
    rows = [middle + radius * step for step in steps]
    rows = [row for row in rows if low + radius <= row <= high - radius]
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
    parts = [(row, fill * tooth.face_width_m) for row, fill in zip(rows, fills, strict=True)]
    return [
        Hole(low_m=row - radius, high_m=row + radius, width_m=width, depth_m=depth, round=True)
        for row, width in parts
        if width > 1e-12 * tooth.face_width_m
    ]


def _pitch_height(tooth: Tooth) -> float:
    return float(tooth.height(tooth.angle_at_radius(tooth.reference_radius_m)))
