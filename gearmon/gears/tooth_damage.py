"""Damage of one tooth as a change of its sections: root crack, spalls and pits, wear.

Sizes are metres here. A section across the tooth has area A and second moment I; a crack cuts a
part of its thickness away, a spall takes a rectangle off the loaded side.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.gears.panels import FloatArray
from gearmon.gears.tooth_fillet import crossings

if TYPE_CHECKING:
    from gearmon.gears.tooth import Tooth

#: Gauss points across the width of a crack of varying depth; integrands are cubics times a line.
WIDTH_POINTS = 3
#: Panels across a round pit, graded towards its ends where its width has a vertical tangent.
PIT_PANELS = 4
#: Largest part of the face width that pits may take at one height.
LARGEST_WIDTH = 0.98


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

    Notes
    -----
    Flat limit line (Wu, Zuo & Parey 2008): on the cracked side the half thickness is at most
    ``h_cr = h_root - q sin(angle)``, in the root as well: the material below a crack is as idle as
    that above it. Against finite elements with a slit this under-predicts the
    effect of shallow cracks by up to 45 % and over-predicts that of deep ones near the tip.
    """

    depth_m: float
    angle_rad: float = math.radians(60)
    far_depth_m: float | None = None
    extent: float = 1.0
    start: float = 0.0

    def __post_init__(self) -> None:
        check_range("crack depth", self.depth_m, 0, 10, "m")
        check_range("crack angle", math.degrees(self.angle_rad), 5, 90, "deg")
        if self.far_depth_m is not None:
            check_range("far crack depth", self.far_depth_m, 0, 10, "m")
        end = self.start + self.extent
        if not (self.extent > 0 and self.start >= 0 and end <= 1 + 1e-9):
            raise ArgumentError(
                f"crack from {self.start:g} over {self.extent:g} of the face width must lie in "
                f"[0, 1]"
            )

    @property
    def depths(self) -> tuple[float, float]:
        """Least and greatest depth [m]."""
        far = self.depth_m if self.far_depth_m is None else self.far_depth_m
        return min(self.depth_m, far), max(self.depth_m, far)

    def at(self, places: FloatArray) -> FloatArray:
        """Return the depth [m] at shares of the face width."""
        far = self.depth_m if self.far_depth_m is None else self.far_depth_m
        along = (places - self.start) / self.extent
        square = self.depth_m**2 + (far**2 - self.depth_m**2) * along
        inside = (along >= 0) & (along <= 1)
        return np.where(inside, np.sqrt(np.maximum(square, 0.0)), 0.0)

    def limits_m(self, tooth: Tooth) -> FloatArray:
        """Return the limit lines h_cr of the least and of the greatest depth [m]."""
        root = tooth.crack_start[1]
        return np.array([root - depth * math.sin(self.angle_rad) for depth in self.depths])


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
        Where along the face it begins, for pictures.
    """

    low_m: float
    high_m: float
    width_m: float
    depth_m: float
    round: bool = False
    start: float = 0.0

    def __post_init__(self) -> None:
        check_positive("length of the spall", self.high_m - self.low_m, "m")
        check_range("width of the spall", self.width_m, 0, 10, "m")
        check_range("depth of the spall", self.depth_m, 0, 1, "m")

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

    def __post_init__(self) -> None:
        check_range("wear", self.wear_m, 0, 1, "m")

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
            root = tooth.crack_start[1]
            most = root + float(tooth.half_thickness(tooth.tip))
            most = 0.97 * min(most, 2 * root) / math.sin(self.crack.angle_rad)
            if self.crack.depths[1] > most:
                raise ArgumentError(
                    f"crack of {1e3 * self.crack.depths[1]:.4g} mm cuts the tooth of the {name} "
                    f"off: at this angle its depth must lie in [0, {1e3 * most:.4g}] mm; beyond "
                    f"that it is a breakage"
                )
        thinnest = 2 * float(tooth.half_thickness(tooth.tip))
        if self.wear_m >= 0.9 * thinnest * math.cos(tooth.tip):
            most = 0.9 * thinnest * math.cos(tooth.tip)
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
        found = [np.zeros(0)]
        if self.crack is not None:
            found.append(self._crack_corners(tooth, self.crack))
        for hole in self.holes:
            angles = [tooth.angle_at_height(height) for height in hole.edges_m.tolist()]
            found.append(np.array(angles))
        return np.concatenate(found)

    def root_levels(self, tooth: Tooth) -> FloatArray:
        """Return the half thicknesses [m] at which a crack leaves corners in the root."""
        return np.zeros(0) if self.crack is None else self.crack.limits_m(tooth)

    def missing_width_m(self, height: FloatArray) -> FloatArray:
        """Return the width of flank that is missing at a height, of all holes together [m]."""
        return np.asarray(sum((hole.width(height) for hole in self.holes), np.zeros(height.shape)))

    def _crack_corners(self, tooth: Tooth, crack: RootCrack) -> FloatArray:
        levels = np.unique(crack.limits_m(tooth))

        def loaded_side(t: FloatArray) -> FloatArray:
            return tooth.half_thickness(t) - self.wear_m / np.cos(t)

        return crossings(loaded_side, tooth.start, tooth.tip, levels)


#: A tooth without damage.
SOUND = ToothDamage()


def sections(
    tooth: Tooth,
    damage: ToothDamage,
    height: FloatArray,
    half: FloatArray,
    cosine: FloatArray | None,
) -> tuple[FloatArray, FloatArray]:
    """Return area [m2] and second moment [m4] of sections across a tooth.

    Parameters
    ----------
    tooth : Tooth
    damage : ToothDamage
    height, half : ndarray
        Height and half thickness of the sound tooth [m].
    cosine : ndarray or None
        Cosine of the profile angle, on the involute; None in the root, which does not wear.

    Notes
    -----
    ``A = b (h + h_lim)``, ``I = b (h + h_lim)^3/12`` averaged over the face width; less the holes,
    with the composite section about its own centroid.
    """
    width = tooth.face_width_m
    loaded = half
    if damage.wear_m and cosine is not None:
        loaded = half - damage.wear_m / cosine
    thickness = half + loaded
    area, inertia = width * thickness, width * thickness**3 / 12
    if damage.crack is not None:
        area, inertia = _cracked(tooth, damage.crack, half, loaded)
    if cosine is None or not damage.holes:
        return area, inertia
    return _holed(tooth, damage, height, area, inertia)


def _cracked(
    tooth: Tooth, crack: RootCrack, half: FloatArray, loaded: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Average the sections over the face width: sound part, and depths from least to greatest."""
    low, high = crack.depths
    root, sine = tooth.crack_start[1], math.sin(crack.angle_rad)
    if high - low < 1e-9 * max(high, 1e-30):
        cut = half + np.minimum(loaded, root - high * sine)
        first, third = cut, cut**3
    else:
        # depth from which on the crack bites into the section
        depth = np.clip((root - loaded) / sine, low, high)
        first, third = _varying(crack, half, loaded, depth, root)
    full = half + loaded
    share, width = crack.extent, tooth.face_width_m
    area = width * (share * first + (1 - share) * full)
    return area, width * (share * third + (1 - share) * full**3) / 12


def _varying(
    crack: RootCrack, half: FloatArray, loaded: FloatArray, depth: FloatArray, root: float
) -> tuple[FloatArray, FloatArray]:
    """Mean of thickness and of its cube over depths whose squares are spread evenly."""
    low, high = crack.depths
    spread = high**2 - low**2
    full = half + loaded
    nodes, weights = np.polynomial.legendre.leggauss(WIDTH_POINTS)
    uncut = (depth**2 - low**2) / spread
    first, third = uncut * full, uncut * full**3
    for node, weight in zip(nodes, weights, strict=True):
        q = 0.5 * (depth + high) + 0.5 * (high - depth) * node
        thickness = half + root - q * math.sin(crack.angle_rad)
        share = weight * (high - depth) * q / spread
        first, third = first + share * thickness, third + share * thickness**3
    return first, third


def _holed(
    tooth: Tooth, damage: ToothDamage, height: FloatArray, area: FloatArray, inertia: FloatArray
) -> tuple[FloatArray, FloatArray]:
    whole = area
    for depth in sorted({hole.depth_m for hole in damage.holes}):
        widths = [hole.width(height) for hole in damage.holes if hole.depth_m == depth]
        lost = np.minimum(np.sum(widths, axis=0), LARGEST_WIDTH * tooth.face_width_m)
        removed = lost * depth
        arm = 0.5 * whole / tooth.face_width_m - 0.5 * depth
        inertia = inertia - lost * depth**3 / 12
        inertia = inertia - area * removed * arm**2 / (area - removed)
        area = area - removed
    return area, inertia
