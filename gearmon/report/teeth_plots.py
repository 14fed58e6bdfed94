"""A pair of teeth in contact, to scale: cut square to the flanks, and a flank as its mate sees it.

Cracks, spalls and pits are where they are in the tooth.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon, Rectangle

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.gears.faults import Fault
from gearmon.gears.tooth import Tooth
from gearmon.gears.tooth_damage import Hole, tooth_damage
from gearmon.gears.tooth_pairs import ToothPair
from gearmon.report import plots

#: How what is broken off or worn away looks, and a hole.
_HOLE: dict[str, Any] = {"facecolor": "white", "edgecolor": plots.VERMILLION, "linewidth": 1.0}
_GONE = _HOLE | {"hatch": "///"}
#: Points of each curve of an outline.
POINTS = 60


@dataclass(frozen=True, eq=False)
class DrawnDamage:
    """A damage of a tooth, in its section and on its flank as the mate sees it; lengths in mm.

    Parameters
    ----------
    kind : {"crack", "spall", "pits", "breakage", "missing"}
    section : ndarray, shape (n, 2)
        Outline of what is lost; of a crack its line.
    face_start, face_width : float
        Along the face, from the side that enters contact first.
    low, high : float
        Heights above the root circle.
    """

    kind: str
    section: FloatArray
    face_start: float
    face_width: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class DrawnGear:
    """A gear in contact, cut square to its flanks; what it tells is in mm.

    Parameters
    ----------
    tooth : Tooth
        The loaded one; its points are half thickness + i height.
    centre, across : complex
        Where it stands: centre [m], and direction of its thickness.
    faults : tuple of Fault
        Those whose sizes are no losses are drawn.
    """

    tooth: Tooth
    centre: complex
    across: complex
    faults: tuple[Fault, ...]

    def place(self, points: ComplexArray) -> FloatArray:
        """Return points of the tooth in the plane [mm], shape (n, 2)."""
        placed = 1e3 * (self.centre + points * self.across)
        return np.stack([placed.real, placed.imag], axis=-1)

    def above_root(self, height_m: float) -> float:
        """Return a height above the root circle [mm]."""
        return 1e3 * float(height_m - self.tooth.sign * self.tooth.root_radius_m)

    @property
    def tip(self) -> float:
        """Height of the tip above the root circle [mm]."""
        return self.above_root(float(self.tooth.height(self.tooth.tip)))

    @property
    def flank_start(self) -> float:
        """Height of the flank's lower end above the root circle [mm]."""
        return self.above_root(float(self.tooth.height(self.tooth.start)))

    @cached_property
    def outline(self) -> FloatArray:
        """Five teeth, the loaded one in the middle [mm], shape (n, 2)."""
        profile = half_profile(self.tooth)
        pitch = self.tooth.sign * 2 * math.pi / self.tooth.teeth
        # teeth one after the other across the tooth in the middle
        turns = [cmath.exp(-1j * k * pitch) for k in range(-2, 3)]
        row = [turn * _between(-profile.conj(), profile) for turn in turns]
        return self.place(np.concatenate(row))

    @cached_property
    def damage(self) -> tuple[DrawnDamage, ...]:
        """Damage of the loaded tooth."""
        tooth, found = self.tooth, list[DrawnDamage]()
        faults = [f for f in self.faults if f.gear == tooth.name and not f.is_loss]
        damage = tooth_damage(faults, tooth)
        profile, width = half_profile(tooth), tooth.face_width_m
        root, tip = tooth.sign * tooth.root_radius_m, profile[-1].imag

        def draw(kind: str, section: ComplexArray, *where: float) -> None:
            begin, part, low, high = where
            ends = self.above_root(low), self.above_root(high)
            drawn = DrawnDamage(kind, self.place(section), 1e3 * begin, 1e3 * part, *ends)
            found.append(drawn)

        if damage.crack is not None:
            crack, start = damage.crack, tooth.crack_start
            line = start - 1j * np.array([0, crack.depths[1]]) * cmath.exp(-1j * crack.angle_rad)
            face = crack.start * width, crack.extent * width
            draw("crack", line, *face, start.imag, start.imag)
        for hole in damage.holes:
            kind, face = "pits" if hole.round else "spall", (hole.start * width, hole.width_m)
            draw(kind, _hole(hole, tooth), *face, hole.low_m, hole.high_m)
        for fault in faults:
            if fault.kind in ("breakage", "missing"):
                low = root if fault.height is None else tip - 1e-3 * fault.height
                lost = profile if fault.height is None else profile[profile.imag >= low]
                part = width if fault.kind == "missing" else 1e-3 * fault.size
                face = 1e-3 * (fault.start or 0.0), part
                draw(fault.kind, _between(-lost.conj(), lost), *face, low, tip)
        return tuple(found)


@dataclass(frozen=True, eq=False)
class TeethPicture:
    """Two gears in contact, and the point at which they touch, shape (2,) [mm]."""

    gears: tuple[DrawnGear, DrawnGear]
    contact: FloatArray


def teeth_picture(
    pair: ToothPair, faults: Sequence[Fault] = (), phase: float | None = None
) -> TeethPicture:
    """Return the picture of a pair of teeth in contact.

    The second gear stands above the first, a ring around it with its centre below.

    Parameters
    ----------
    pair : ToothPair
    faults : sequence of Fault
        Drawn on the loaded tooth of their gear where their sizes are no losses.
    phase : float, optional
        Contact phase [mesh periods]; by default the middle of the contact.
    """
    roll = pair.roll(0.5 * pair.contact_ratio if phase is None else phase)
    centres, working = pair.centres_m
    # the normal of the flank turns into the line of action
    rolled = zip(pair.teeth, pair.rolls(roll), strict=True)
    slopes = [float(tooth.slope(tooth.angle(own))) for tooth, own in rolled]
    one, two = (cmath.exp(1j * (working - slope)) for slope in slopes)
    lower = DrawnGear(pair.first, 0j, one, tuple(faults))
    upper = DrawnGear(pair.second, 1j * centres, -two, tuple(faults))
    touching = pair.first.flank(pair.first.angle(roll))
    return TeethPicture((lower, upper), lower.place(touching))


def half_profile(tooth: Tooth) -> ComplexArray:
    """Return the loaded side from the root circle to the tip: half thickness + i height [m]."""
    flank = tooth.flank(np.linspace(tooth.start, tooth.tip, POINTS))
    root = [tooth.root_part(np.linspace(0, 1, POINTS))] if tooth.root_part else []
    return np.concatenate([*root, flank])


def _between(one: ComplexArray, other: ComplexArray) -> ComplexArray:
    """Return the outline along one curve and back along the other."""
    return np.concatenate([one, other[::-1]])


def _hole(hole: Hole, tooth: Tooth) -> ComplexArray:
    """Return the outline of missing material at its deepest section."""
    t = np.linspace(*hole.angles(tooth), POINTS)
    across = np.linspace(-1, 1, POINTS) if hole.round else np.zeros(POINTS)
    surface, depth = tooth.flank(t), hole.depth_m * np.sqrt(1 - across**2)
    return _between(surface, surface - depth * np.exp(1j * tooth.slope(t)))


def plot_teeth(picture: TeethPicture, ax: Axes) -> None:
    """Draw the pair of teeth, cut square to their flanks, to scale."""
    # the body of the first gear lies below its teeth, that of the second above, a ring's too
    for gear, colour, side in zip(picture.gears, (plots.BLUE, plots.GREEN), (-1, 1), strict=True):
        row = gear.outline
        far = side * (2 * np.ptp(row[:, 1]) + np.ptp(row[:, 0]))
        edge = (row[:, 1].max() if side > 0 else row[:, 1].min()) + far
        body = np.concatenate([row, [[row[-1, 0], edge], [row[0, 0], edge]]])
        ax.fill(*body.T, facecolor=colour, alpha=0.18, linewidth=0)
        ax.plot(*row.T, color=colour, linewidth=1.2, label=gear.tooth.name)
    for damage in picture.gears[0].damage + picture.gears[1].damage:
        if damage.kind == "crack":
            ax.plot(*damage.section.T, color=plots.VERMILLION, linewidth=2.2, label="crack")
        else:
            looks = _HOLE if damage.kind in ("spall", "pits") else _GONE
            ax.add_patch(Polygon(damage.section, closed=True, **looks))
    x, y = picture.contact
    plots.plot_marks(ax, x, y, "o", 4, "black", label="contact")
    # the loaded teeth with their roots and no more
    reach = 1.7 * max(gear.tip for gear in picture.gears)
    ax.set(xlim=(x - reach, x + reach), ylim=(y - 0.95 * reach, y + 0.95 * reach), aspect="equal")
    ax.set(xlabel="across the line of centres in mm", ylabel="along the line of centres in mm")
    ax.legend(loc="upper right", fontsize=8)


def plot_flank(gear: DrawnGear, ax: Axes) -> None:
    """Draw the loaded flank of a gear as its mate sees it, with its damage to scale."""
    width, low, high = 1e3 * gear.tooth.face_width_m, gear.flank_start, gear.tip
    ax.add_patch(Rectangle((0, 0), width, low, facecolor=plots.GREY, alpha=0.25, linewidth=0))
    shade: dict[str, Any] = {"facecolor": plots.BLUE, "alpha": 0.15, "linewidth": 0}
    ax.add_patch(Rectangle((0, low), width, high - low, **shade))
    ax.add_patch(Rectangle((0, 0), width, high, fill=False, edgecolor="black", linewidth=1.0))
    for own in gear.damage:
        begin, size = own.face_start, own.high - own.low
        if own.kind == "crack":
            reach = [begin, begin + own.face_width]
            ax.plot(reach, [own.low] * 2, color=plots.VERMILLION, linewidth=2.5)
        elif own.kind == "pits":
            _plot_pits(ax, width, own.face_width, own.low + size / 2, size / 2)
        else:
            ax.add_patch(Rectangle((begin, own.low), own.face_width, size, **_GONE))
    ax.set(xlim=(-0.03 * width, 1.03 * width), ylim=(-0.08 * high, 1.12 * high), aspect="equal")
    ax.set(xlabel="along the face in mm", ylabel="above root in mm")
    ax.set_title(f"loaded flank of the {gear.tooth.name} (fillet grey)", fontsize=9)


def _plot_pits(ax: Axes, face: float, width: float, middle: float, radius: float) -> None:
    """Spread pits evenly along the face; their number times their diameter is `width`."""
    count = max(1, round(width / (2 * radius)))
    # every other row is shifted by half a step
    shift = 0.25 if round(middle / radius) % 2 else 0.75
    for k in range(count):
        centre = face * (k + shift) / count, middle
        ax.add_patch(Circle(centre, radius, **_HOLE | {"linewidth": 0.6}))
