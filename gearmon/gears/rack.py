"""The basic rack and the tooth root that it generates: fillet, form circle, undercut.

All lengths are in normal modules. The rack tip is rounded so that its flank stays straight down
to the standard clearance of 0.25 modules, or rounded fully where less room is left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gearmon.errors import ArgumentError
from gearmon.gears.pulses import FloatArray

#: Bottom clearance of ISO 53 racks; the rounding takes it up.
CLEARANCE = 0.25


@dataclass(frozen=True, kw_only=True)
class Rack:
    """Basic rack of a gear.

    Parameters
    ----------
    dedendum : float
        h_fP*, depth of the gear's root below the rack's datum line.
    pressure_angle_rad : float
        Normal pressure angle [rad].
    helix_angle_rad : float
        Helix angle at the reference circle [rad].

    Examples
    --------
    >>> round(Rack(dedendum=1.25, pressure_angle_rad=math.radians(20)).rounding, 5)
    0.37995
    """

    dedendum: float
    pressure_angle_rad: float
    helix_angle_rad: float = 0.0

    @property
    def rounding(self) -> float:
        """Radius of the rounded rack tip rho_fP*."""
        alpha = self.pressure_angle_rad
        wanted = CLEARANCE / (1 - math.sin(alpha))
        # full rounding: the centre of the arc sits on the middle line of the rack tooth
        full = (math.pi / 4 - self.dedendum * math.tan(alpha)) * math.cos(alpha)
        full /= 1 - math.sin(alpha)
        rounding = min(wanted, full)
        if rounding <= 0:
            most = math.pi / 4 / math.tan(alpha)
            raise ArgumentError(
                f"root_factor={self.dedendum} makes the rack pointed at a pressure angle of "
                f"{math.degrees(alpha):g} deg; it must be < {most:.4g}"
            )
        return rounding

    @property
    def straight_depth(self) -> float:
        """Depth below the datum line down to which the flank is straight."""
        return self.dedendum - self.rounding * (1 - math.sin(self.pressure_angle_rad))

    @property
    def transverse_pressure_angle_rad(self) -> float:
        """alpha_t = atan(tan alpha_n/cos beta)."""
        return math.atan(math.tan(self.pressure_angle_rad) / math.cos(self.helix_angle_rad))

    def least_shift(self, teeth: int) -> float:
        """Return the profile shift below which `teeth` are undercut."""
        sine = math.sin(self.transverse_pressure_angle_rad)
        return self.straight_depth - 0.5 * teeth / math.cos(self.helix_angle_rad) * sine**2

    def least_teeth(self, profile_shift: float) -> int:
        """Return the number of teeth from which on there is no undercut."""
        sine = math.sin(self.transverse_pressure_angle_rad)
        depth = max(self.straight_depth - profile_shift, 0.0)
        return math.ceil(2 * depth * math.cos(self.helix_angle_rad) / sine**2 - 1e-9)

    def form_roll(self, teeth: int, profile_shift: float, *, internal: bool = False) -> float:
        """Return the roll length at which the involute meets the fillet.

        Parameters
        ----------
        teeth : int
        profile_shift : float
        internal : bool
            For a ring the involute ends there; its tool is not a rack, so the circle that the
            straight part of the rack would reach is taken.

        Returns
        -------
        float
            In normal modules; above the undercut where there is one.
        """
        radius = 0.5 * teeth / math.cos(self.helix_angle_rad)
        alpha = self.transverse_pressure_angle_rad
        depth = self.straight_depth - profile_shift
        if internal:
            return math.sqrt(max((radius + depth) ** 2 - (radius * math.cos(alpha)) ** 2, 0.0))
        roll = radius * math.sin(alpha) - depth / math.sin(alpha)
        return roll if roll >= 0 else self._undercut_roll(teeth, profile_shift)

    def fillet(
        self, teeth: int, profile_shift: float, angles_rad: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return points of the generated fillet of an external gear, in the transverse section.

        Parameters
        ----------
        teeth : int
        profile_shift : float
        angles_rad : ndarray
            Angles of the rack-tip normal in the normal section, from alpha_n (where the involute
            begins) to pi/2 (root circle).

        Returns
        -------
        height, half_thickness : ndarray
            Distance from the gear's centre along the middle line of the tooth, and from that line,
            in normal modules.

        Notes
        -----
        The point of the rack tip whose normal has angle g touches the gear when that normal passes
        through the pitch point: with depth a and distance b from the middle line of the tooth,
        ``phi = (a/tan g + b)/R`` has been rolled.
        """
        g, cosine = np.asarray(angles_rad, dtype=np.float64), math.cos(self.helix_angle_rad)
        alpha, rounding = self.pressure_angle_rad, self.rounding
        depth = self.dedendum - rounding - profile_shift + rounding * np.sin(g)
        middle = math.pi / 4 + self.straight_depth * math.tan(alpha) + rounding * math.cos(alpha)
        across = (middle - rounding * np.cos(g)) / cosine
        # the transverse section is wider by 1/cos(beta), so its normals are flatter or steeper
        slope = np.arctan2(np.sin(g), np.cos(g) * cosine)
        radius = 0.5 * teeth / cosine
        rolled = (depth / np.tan(slope) + across) / radius
        reach = depth / np.sin(slope)
        height = radius * np.cos(rolled) - reach * np.sin(slope - rolled)
        half = radius * np.sin(rolled) - reach * np.cos(slope - rolled)
        return height, half

    def base_half_angle(self, teeth: int, profile_shift: float) -> float:
        """Return half the angle that a tooth takes on the base circle [rad]."""
        alpha = self.transverse_pressure_angle_rad
        shift = 2 * profile_shift * math.tan(self.pressure_angle_rad)
        return (math.pi / 2 + shift) / teeth + math.tan(alpha) - alpha

    def _undercut_roll(self, teeth: int, profile_shift: float) -> float:
        """Return the roll length at which the fillet cuts the involute, found by halving."""
        base = 0.5 * teeth / math.cos(self.helix_angle_rad)
        base *= math.cos(self.transverse_pressure_angle_rad)
        half_angle = self.base_half_angle(teeth, profile_shift)
        low, high = self.pressure_angle_rad, math.pi / 2
        for _ in range(60):
            middle = 0.5 * (low + high)
            height, half = self.fillet(teeth, profile_shift, np.array([middle]))
            radius = float(np.hypot(height[0], half[0]))
            tangent = math.sqrt(max((radius / base) ** 2 - 1, 0.0))
            flank = half_angle - (tangent - math.atan(tangent))
            beyond = radius > base and math.atan2(float(half[0]), float(height[0])) > flank
            low, high = (middle, high) if beyond else (low, middle)
        return base * tangent
