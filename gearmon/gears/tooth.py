"""One tooth as a beam, and the body that it stands on: compliances, for many contacts at once.

The energy integrals run along the middle line of the tooth from its root to the contact. Their
integrands do not depend on where the contact is, apart from the lever arm, which enters through
three moments: so running integrals serve all contacts. Below the involute the beam is the fillet
that the rack generates, or straight; in a ring it is an arc that touches the involute and the root
circle: the tool that shapes a ring is a pinion whose data nobody gives, its fillet lies close to an
arc (ISO 6336-3 describes it by a radius too), and what matters most, where the involute ends and
how deep the root lies, is kept.

The body of an external gear follows a published fit. A ring is held all round its outside: the
tooth root loads an arc of the root circle, and the deflection is the exact plane-stress one of a
ring, so that thickness of the rim and coupling of teeth any distance apart follow from it. Every
Fourier component of the tractions is one small linear system for the complex potentials of the
ring; the loads are those that a tooth root passes on: a moment as linear pressure, a pull along the
circle as uniform shear, a push into the body as uniform pressure.

References
----------
Yang & Lin, J. Vib. Acoust. 109 (1987) 189; Tian (2004); Ma et al., Mech. Mach. Theory 73 (2014) 1;
Sainsot, Velex & Duverger, J. Mech. Des. 126 (2004) 142, for the fit and the loads of bodies;
Muskhelishvili, Some Basic Problems of the Mathematical Theory of Elasticity (1953).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.polynomial.legendre import legder, legval
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.gears.geometry import USUAL_RIM, RackTooth
from gearmon.gears.pulses import POINTS, Pulse, distinct, gauss, panel_nodes
from gearmon.gears.tooth_damage import SOUND, ToothDamage, crossings

#: Tangent angle of the critical section of a fillet, ISO 6336-3 [rad].
CRITICAL_TANGENT = math.radians(30)
#: Maps parameters, 0 at the root circle and 1 at the involute, to half thickness + i height [m].
Curve = Callable[[FloatArray], ComplexArray]


#: Tangent angle of the critical section of a ring's fillet, ISO 6336-3 [rad].
RING_TANGENT = math.radians(60)
#: Which curve joins the involute and the root circle; see `Tooth`.
ROOTS = ("fillet", "straight", "base")
#: Where the involute is split for its integrals: 1/h^3 is steep towards the tip.
SPLITS = (0.6, 0.87)
#: Shear factor of a rectangular section.
SHEAR_FACTOR = 1.2
#: Fourier components are taken up to this many radians over half the loaded arc.
ARC_PHASE = 60.0
#: Beyond so many decades of decay across the ring, its other circle is as good as infinitely far.
LARGEST_DECAY = 40.0
#: Coefficients A ... F of the polynomials L, M, P, Q.
SAINSOT = {
    "L": (-5.574e-5, -1.9986e-3, -2.3015e-4, 4.7702e-3, 0.0271, 6.8045),
    "M": (60.111e-5, 28.100e-3, -83.431e-4, -9.9256e-3, 0.1624, 0.9086),
    "P": (-50.952e-5, 185.50e-3, 0.0538e-4, 53.300e-3, 0.2895, 0.9236),
    "Q": (-6.2042e-5, 9.0889e-3, -4.0964e-4, 7.8297e-3, -0.1472, 0.6904),
}
#: Where the polynomials were fitted: R_f/r_bore and the half root angle [rad].
RADIUS_RATIOS = (1.4, 7.0)
ROOT_ANGLES = (0.01, 0.12)
#: Fit of the coupling to finite elements: E b C = torsion + slope ln(z) + bore r/R + constant.
COUPLING_SLOPE, COUPLING_BORE, COUPLING_CONSTANT = 0.69, -2.03, -0.43
#: Tangent of the fillet against the middle of the tooth where the loaded arc ends: there it ends
#: in the fillet foundation of external gears with the standard rack.
ARC_TANGENT = math.radians(75)


def where_tangent(curve: Curve, angle_rad: float) -> complex:
    """Return the point of a fillet at which its tangent makes an angle with the tooth's middle."""
    grid = np.linspace(0, 1, 129)
    along = np.gradient(curve(grid), grid)
    tangent = np.arctan2(-along.real, along.imag)
    # at the root circle the tangent lies across; towards the involute it stands up
    place = np.interp(-angle_rad, -tangent, grid)
    return complex(curve(np.atleast_1d(place))[0])


@dataclass(frozen=True, kw_only=True)
class Tooth(RackTooth):
    """One tooth and the body that it stands on; of helical gears that of their normal section.

    A tooth is described from its root upwards, whether it points away from the gear's centre or,
    in a ring, towards it: heights and profile angles t grow from root to tip. Heights of a ring's
    tooth are therefore negative, distances from the centre with their sign turned.

    Parameters
    ----------
    bore_radius_m : float
        Radius on which the body is held: of a disc its bore; of a ring
        its outside, at most 3 root radii.
    face_width_m : float
    poisson_ratio : float
    root : {"fillet", "straight", "base"}
        The fillet that the rack generates (in a ring an arc that touches involute and root
        circle); a straight part of constant thickness from the base circle to the root circle (an
        involute cut by the root circle where that is larger, and in a ring); or nothing below the
        base circle (Yang & Lin 1987), an option for comparison only.
    """

    bore_radius_m: float
    face_width_m: float
    poisson_ratio: float = 0.3
    root: str = "fillet"

    def __post_init__(self) -> None:
        thickness = self.bore_radius_m - self.root_radius_m
        if not self.internal and not 0 < self.bore_radius_m < self.root_radius_m:
            raise ArgumentError(
                f"bore radius {1e3 * self.bore_radius_m:g} mm of the {self.name} must be > 0 and "
                f"less than its root radius {1e3 * self.root_radius_m:.5g} mm: the body of the "
                f"gear yields between them; set bore_diameter_{self.name}_mm"
            )
        if self.internal and not 0 < thickness <= 2 * self.root_radius_m:
            raise ArgumentError(
                f"rim thickness {1e3 * thickness:.5g} mm of the {self.name} must lie above 0 and "
                f"up to its root diameter, {2e3 * self.root_radius_m:.5g} mm; set "
                f"rim_thickness_{self.name}_mm"
            )

    @cached_property
    def form_roll_m(self) -> float:
        """Roll length [m] at which the involute meets the fillet; in a ring one that has room."""
        if not self.internal or self._beyond_space(self.form_roll) <= 0:
            return self.form_roll
        highest = self.roll_at(self.root_radius_m)
        return float(brentq(self._beyond_space, self.form_roll, highest, xtol=1e-15))

    def _fillet_arc(self, roll_m: float) -> tuple[complex, complex]:
        """Return the arc of a ring that touches the involute at a roll length, and the root circle.

        Its centre, half thickness + i height [m], and the radius from it to the involute turned
        round.

        Notes
        -----
        With the end P of the involute and the normal n into the space, the arc about P + rho n
        touches the root circle if ``rho = (R_f^2 - |P|^2)/(2 (R_f + P n))``; -P n is the roll
        length.
        """
        end = complex(self.flank(self.angle(roll_m)))
        radius = (self.root_radius_m**2 - abs(end) ** 2) / (2 * (self.root_radius_m - roll_m))
        arm = cmath.rect(radius, float(self.slope(self.angle(roll_m))))
        return end + arm, arm

    def _beyond_space(self, roll_m: float) -> float:
        """Angle [rad] by which the centre of that arc lies beyond the middle of the tooth space."""
        centre, _ = self._fillet_arc(roll_m)
        return math.atan2(centre.real, -centre.imag) - math.pi / self.teeth

    @cached_property
    def start(self) -> float:
        """Profile angle t at which the involute part of the beam begins."""
        if self.root == "fillet":
            return float(self.angle(self.form_roll_m))
        return self.angle_at_radius(self.root_radius_m)

    @cached_property
    def tip(self) -> float:
        """Profile angle t at the tip."""
        return self.angle_at_radius(self.tip_radius_m)

    def angle(self, roll_m: ArrayLike) -> FloatArray:
        """Return the profile angle t [rad] of roll lengths [m]."""
        rolled = np.asarray(roll_m, dtype=np.float64) / self.base_radius_m
        return np.asarray(self.sign * (rolled - self.base_half_angle))

    def roll(self, angle: ArrayLike) -> FloatArray:
        """Return the roll length [m] of profile angles t [rad]; the inverse of `angle`."""
        return self.base_radius_m * (self.slope(angle) + self.base_half_angle)

    def slope(self, angle: ArrayLike) -> FloatArray:
        """Return the angle [rad] by which the force on the flank points into the tooth's root.

        Counted from the normal to the middle of the tooth.
        """
        return np.asarray(self.sign * np.asarray(angle, dtype=np.float64))

    def angle_at_radius(self, radius_m: float) -> float:
        """Return the profile angle t [rad] on a circle outside the base circle."""
        return float(self.angle(self.roll_at(radius_m)))

    def flank(self, angle: ArrayLike) -> ComplexArray:
        """Return points of the loaded side: half thickness + i height [m], from the centre."""
        slope = self.slope(angle)
        along = np.exp(1j * slope) * (slope + self.base_half_angle + 1j)
        return np.asarray(self.sign * self.base_radius_m * along)

    def height(self, angle: ArrayLike) -> FloatArray:
        """Return heights [m] of the profile along the middle of the tooth, from the centre."""
        return np.asarray(self.flank(angle).imag)

    def half_thickness(self, angle: ArrayLike) -> FloatArray:
        """Return distances [m] of the profile from the middle of the tooth."""
        return np.asarray(self.flank(angle).real)

    def angle_at_height(self, height_m: float) -> float:
        """Return the profile angle t of a height on the involute, clipped to its ends."""
        low, high = self.start, self.tip
        if not self.height(low) < height_m < self.height(high):
            return low if height_m <= self.height(low) else high
        return float(brentq(lambda t: float(self.height(t)) - height_m, low, high, xtol=1e-15))

    @cached_property
    def root_part(self) -> Curve | None:
        """The beam below the involute, if there is any."""
        if self.root == "fillet" and self.internal:
            centre, arm = self._fillet_arc(self.form_roll_m)
            # the beam begins where the arc is deepest; beyond that it rises with the root circle
            low, high = math.pi, math.atan2(-arm.real, -arm.imag) % (2 * math.pi)
            return lambda x: centre + 1j * abs(arm) * np.exp(-1j * (low + (high - low) * x))
        if self.root == "fillet":
            # as the rack generates it, from the root circle to where the involute begins
            low, undercut = 0.5 * math.pi, self.least_shift > self.profile_shift
            high = self.undercut_end if undercut else self.pressure_angle_rad
            return lambda parameter: self.fillet(low + (high - low) * parameter)
        if self.root == "base" or self.internal or self.root_radius_m >= self.base_radius_m:
            return None
        # of constant thickness from the root circle up to the base circle
        half = self.base_radius_m * math.sin(self.base_half_angle)
        foot = math.sqrt(self.root_radius_m**2 - half**2)
        up = self.base_radius_m * math.cos(self.base_half_angle) - foot
        return lambda parameter: np.asarray(half + 1j * (foot + up * parameter), complex)

    @cached_property
    def crack_start(self) -> complex:
        """Half thickness + i height [m] where a root crack begins.

        On a fillet where its tangent makes 30 degrees with the middle of the tooth, in a ring 60,
        the section that ISO 6336-3 calls critical; else at the lower end of the beam.
        """
        if self.root_part is None:
            return complex(self.flank(self.start))
        if self.root != "fillet":
            return complex(self.root_part(np.zeros(1))[0])
        return where_tangent(self.root_part, RING_TANGENT if self.internal else CRITICAL_TANGENT)


@dataclass(frozen=True, eq=False)
class ToothBeam:
    """Running energy integrals of a tooth, sound or damaged.

    Parameters
    ----------
    tooth : Tooth
    damage : ToothDamage
    """

    tooth: Tooth
    damage: ToothDamage = SOUND

    def compliances(self, angle: FloatArray) -> FloatArray:
        """Return compliances in bending, shear and compression [m/N] for contacts at `angle`.

        Parameters
        ----------
        angle : ndarray, shape (n,)
            Profile angle t of the contact, in size also the angle between the force and the
            normal to the middle of the tooth [rad].

        Notes
        -----
        ``1/k_b = int [(y_c - y) cos t - h_c sin t]^2/(E I) dy``,
        ``1/k_s = int 1.2 cos^2 t/(G A) dy``, ``1/k_a = int sin^2 t/(E A) dy``.
        """
        tooth = self.tooth
        area, zeroth, first, second = self._integrals.at(angle)
        slope, point = tooth.slope(angle), tooth.flank(angle)
        cosine, sine = np.cos(slope), np.sin(slope)
        lever = (point.imag - self._reference) * cosine - point.real * sine
        bending = (lever * zeroth - 2 * cosine * first) * lever + cosine * cosine * second
        # with G = E/(2 (1 + nu))
        shear = 2 * (1 + tooth.poisson_ratio) * SHEAR_FACTOR * cosine * cosine * area
        return np.stack([bending, shear, sine * sine * area]) / tooth.elastic_modulus_pa

    @cached_property
    def corners(self) -> FloatArray:
        """Profile angles at which the sections of the involute are not smooth."""
        return self.damage.corners(self.tooth)

    @cached_property
    def _reference(self) -> float:
        # moments about the foot of the involute: about the gear's centre they would cancel
        return float(self.tooth.height(self.tooth.start))

    @cached_property
    def _integrals(self) -> Pulse:
        """Running integrals of 1/A and of (1, y, y^2)/I along the involute."""
        tooth = self.tooth
        splits = tooth.start + (tooth.tip - tooth.start) * np.array(SPLITS)
        inner = [t for t in self.corners if tooth.start + 1e-12 < t < tooth.tip - 1e-12]
        edges = distinct([tooth.start, *splits, *inner, tooth.tip], 1e-12)
        t = panel_nodes(edges)
        curves = self._integrands(tooth.flank(t), tooth.roll(t) * np.cos(t), np.cos(t))
        return Pulse.through(edges, curves).running(self._root())

    def _root(self) -> FloatArray:
        part = self.tooth.root_part
        if part is None:
            return np.zeros(4)
        levels = self.damage.root_levels(self.tooth)
        corners = crossings(lambda x: part(x).real, 0.0, 1.0, levels)
        edges = distinct([0.0, 1.0, *corners], 1e-12)
        point, (nodes, _, analysis) = part(panel_nodes(edges)), gauss(POINTS)
        slope = 2 * legval(nodes, legder(analysis @ point.imag.T)) / np.diff(edges)[:, None]
        return Pulse.through(edges, self._integrands(point, slope)).running().at(1.0)

    def _integrands(
        self, point: ComplexArray, slope: FloatArray, cosine: FloatArray | None = None
    ) -> FloatArray:
        area, inertia = self.damage.sections(self.tooth, point, cosine)
        lever, weight = point.imag - self._reference, slope / inertia
        return np.stack([slope / area, weight, weight * lever, weight * lever * lever], axis=-1)


@lru_cache(maxsize=256)
def arc_compliance(
    ratio: float, half_angle_rad: float, poisson_ratio: float, apart_rad: float = 0.0
) -> FloatArray:
    """Return the compliances of a ring under loads on an arc, for E b = 1 and loaded radius 1.

    Parameters
    ----------
    ratio : float, > 0, not 1
        Radius of the held circle over that of the loaded one: below 1 a disc on its bore, above 1
        a ring held round its outside.
    half_angle_rad : float
        Half the angle of the loaded arc.
    poisson_ratio : float
    apart_rad : float
        Angle from the arc whose deflection is asked for to the loaded one, counted in the
        direction of the shear.

    Returns
    -------
    ndarray, shape (3, 3)
        Rows: rotation, displacement along the circle, displacement into the body, each as the mean
        over its arc that the corresponding load does work on. Columns: moment (which presses where
        the shear points to), shear force, pressing force.

    Notes
    -----
    Symmetric for `apart_rad` 0, by reciprocity.
    """
    if check_positive("ratio", ratio) == 1:
        raise ArgumentError("ratio=1 leaves no body between the circles; it must differ from 1")
    check_range("half_angle_rad", half_angle_rad, 1e-4, math.pi / 2, "rad")
    outwards = 1.0 if ratio < 1 else -1.0
    kappa = (3 - poisson_ratio) / (1 + poisson_ratio)
    count = math.ceil(ARC_PHASE / half_angle_rad)
    orders = np.arange(1, count + 1, dtype=np.float64)
    ahead, behind = (_tractions(sign * orders, half_angle_rad, outwards) for sign in (1, -1))
    # loads as (T_k, conj T_-k); they move (U_k, conj U_-k)
    loads = np.stack([ahead, behind.conj()])
    moves = np.einsum("kij,jkl->ikl", _responses(count, ratio, kappa), loads)
    turn = np.exp(-1j * orders * apart_rad)[:, None]
    # work of stress s - i t and displacement u + i v: the components k and -k pair up
    work = np.einsum("kr,kl->rl", loads[1].conj(), moves[0] * turn)
    work = work + np.einsum("kr,kl->rl", loads[0], moves[1].conj() * turn.conj())
    # the components of order 0: breathing and torsion of the ring
    mean = _tractions(np.zeros(1), half_angle_rad, outwards)[0]
    breathing = np.linalg.solve([[2.0, -1.0], [(kappa - 1) * ratio, 1 / ratio]], [1.0, 0.0])
    radial, torsion = (kappa - 1) * breathing[0] + breathing[1], 1 - ratio**-2
    work = work + np.outer(mean, radial * mean.real + 1j * torsion * mean.imag)
    total = 2 * math.pi * np.real(work)
    shear_modulus = 1 / (2 * (1 + poisson_ratio))
    return np.asarray(outwards * total / (2 * shear_modulus))


def _tractions(orders: FloatArray, half: float, outwards: float) -> ComplexArray:
    """Return the components of ``s_rr - i s_rt`` for unit moment, shear and pressure.

    Shape (orders, 3). Pressure is negative radial stress on either circle; shear points the other
    way where the outside of the body lies inwards.
    """
    x = orders * half
    uniform = np.sinc(x / np.pi) / (2 * np.pi)
    linear = -1j * (np.sin(x) - x * np.cos(x)) / np.where(x == 0, 1, x) ** 2
    moment = -3 * linear / (2 * np.pi * half)
    return np.stack([moment, -1j * outwards * uniform, -uniform + 0j], axis=-1)


def _responses(count: int, ratio: float, kappa: float) -> FloatArray:
    """Return the matrices, shape (count, 2, 2), from (T_k, conj T_-k) to 2 G (U_k, conj U_-k).

    ``T_k = (1-k) A_k r^k + A'_-k r^-k - B_k-2 r^k-2`` and
    ``U_k = kappa A_k r^(k+1)/(k+1) - A'_-k r^(1-k) + B'_-k-2 r^(-k-1)/(k+1)`` with the potentials
    ``Phi = sum A_n z^n``, ``Psi = sum B_n z^n`` and ' for the conjugate.
    """
    k = np.arange(2, count + 1, dtype=np.float64)
    decay = math.log(ratio) * k
    far = np.exp(np.clip(decay, -LARGEST_DECAY, LARGEST_DECAY) / k)
    one = np.ones_like(k)
    stresses = np.array([[1 - k, one, -one, 0 * k], [one, 1 + k, 0 * k, -one]])
    matrix = np.moveaxis(np.concatenate([stresses, _displacements(k, far, kappa)]), -1, 0)
    scale = np.abs(matrix).max(axis=1, keepdims=True)
    solved = np.linalg.solve(matrix / scale, np.eye(4, 2)) / np.swapaxes(scale, 1, 2)
    near = np.moveaxis(_displacements(k, one, kappa), -1, 0) @ solved
    return np.concatenate([_first_response(ratio, kappa)[None], near])


def _displacements(k: FloatArray, r: FloatArray, kappa: float) -> FloatArray:
    """Return what each potential moves where a circle has the radius r, shape (2, 4, count)."""
    ahead = [kappa * r ** (k + 1) / (k + 1), -(r ** (1 - k)), 0 * k, r ** (-k - 1) / (k + 1)]
    behind = [-(r ** (1 + k)), kappa * r ** (1 - k) / (1 - k), r ** (k - 1) / (1 - k), 0 * k]
    return np.array([ahead, behind])


def _first_response(ratio: float, kappa: float) -> FloatArray:
    """Return the response to tractions with a resultant force: logarithms, and a shift."""

    def displacements(r: float) -> FloatArray:
        ahead = [kappa * r * r / 2, -1.0, r**-2 / 2, 0.0]
        return np.array([ahead, [-r * r, 2 * kappa * math.log(r), 0.0, 1.0]])

    stresses = np.array([[0.0, 1 + kappa, 0.0, 0.0], [1.0, 2.0, -1.0, 0.0]])
    matrix = np.concatenate([stresses, displacements(ratio)])
    return np.asarray(displacements(1.0) @ np.linalg.solve(matrix, np.eye(4, 2)))


def sainsot(radius_ratio: float, root_angle_rad: float) -> list[float]:
    """Return the polynomials L, M, P, Q.

    Parameters
    ----------
    radius_ratio : float
        Root radius over bore radius, fitted for 1.4 to 7.
    root_angle_rad : float
        Half the angle of the tooth root, fitted for 0.01 to 0.12.

    Examples
    --------
    >>> [round(x, 6) for x in sainsot(3.0, 0.05)]
    [6.927112, 1.190046, 4.324115, 0.437799]
    """
    h, theta = radius_ratio, root_angle_rad
    terms = [1 / theta**2, h * h, h / theta, 1 / theta, h, 1.0]
    found: list[float] = (np.array([*SAINSOT.values()]) @ terms).tolist()
    return found


@dataclass(frozen=True, kw_only=True)
class Foundation:
    """The body of a gear under its teeth.

    Parameters
    ----------
    tooth : Tooth
    arm : {"axis", "contact"}
        Whether u runs from the root circle to where the force meets the middle of the tooth
        (``R_b/cos a - R_f``, exact), or to the height of the contact, as some codes have it.
    """

    tooth: Tooth
    arm: str = "axis"

    @cached_property
    def root_angle_rad(self) -> float:
        """theta_f, half the angle of the tooth root on the root circle."""
        rack = self.tooth
        alpha, rounding = rack.pressure_angle_rad, rack.rounding
        across = math.pi / 2 + 2 * math.tan(alpha) * (rack.straight_depth - rounding)
        return (across + 2 * rounding / math.cos(alpha)) / self.tooth.teeth

    @property
    def warnings(self) -> tuple[str, ...]:
        """What lies outside the range of the fit."""
        ratio = self.tooth.root_radius_m / self.tooth.bore_radius_m
        angle, name = self.root_angle_rad, self.tooth.name
        body = f"body of the {name} has R_f/r_bore = {ratio:.3g}"
        teeth = f"teeth of the {name} have a half root angle of {angle:.4f} rad"
        told = (body, ratio, RADIUS_RATIOS), (teeth, angle, ROOT_ANGLES)
        return tuple(
            f"the {what}, outside the range {low:g} to {high:g} of the fillet-foundation fit"
            for what, value, (low, high) in told
            if not low <= value <= high
        )

    def compliance(self, angle: FloatArray) -> FloatArray:
        """Return the compliance [m/N] for contacts at profile angles `angle`.

        Notes
        -----
        ``1/k_f = cos^2 a/(E b) [L (u/S)^2 + M u/S + P (1 + Q tan^2 a)]``, ``S = 2 R_f theta_f``.
        """
        tooth = self.tooth
        ratio = tooth.root_radius_m / tooth.bore_radius_m
        lower, middle, upper, slope = sainsot(ratio, self.root_angle_rad)
        cosine = np.cos(angle)
        point = tooth.base_radius_m / cosine if self.arm == "axis" else tooth.height(angle)
        u = (point - tooth.root_radius_m) / (2 * tooth.root_radius_m * self.root_angle_rad)
        square = cosine * cosine
        total = square * (lower * u * u + middle * u + upper) + upper * slope * (1 - square)
        return np.asarray(total / (tooth.elastic_modulus_pa * tooth.face_width_m))

    def coupling(self, apart: int = 1, *_contacts: FloatArray) -> float:
        """Return how far a tooth gives way when another one is loaded [m/N].

        Parameters
        ----------
        apart : int, >= 1
            Distance of the two teeth [teeth].
        *_contacts : ndarray
            Profile angles of the contacts, which the fit does not tell apart.

        Notes
        -----
        ``E b C = E R_b^2/(4 pi G) (1/r^2 - 1/R_f^2) + 0.69 ln(z/apart) - 2.03 r/R - 0.43``: the
        wind-up of the disc on its bore, and the dip of its rim, fitted to finite elements for
        neighbouring teeth (z = 19 to 100, r/R = 0.3 to 0.6). Teeth further apart follow the
        logarithm of the half plane, whose factor 2/pi is that of the fit.
        """
        tooth = self.tooth
        inner, root = tooth.bore_radius_m, tooth.root_radius_m
        # E/(4 pi G) = (1 + nu)/(2 pi)
        torsion = (1 + tooth.poisson_ratio) / (2 * math.pi)
        torsion *= tooth.base_radius_m**2 * (inner**-2 - root**-2)
        dip = COUPLING_SLOPE * math.log(tooth.teeth / apart) + COUPLING_CONSTANT
        dip += COUPLING_BORE * inner / tooth.reference_radius_m
        return max(0.0, torsion + dip) / (tooth.elastic_modulus_pa * tooth.face_width_m)


@dataclass(frozen=True, kw_only=True)
class RingBody:
    """The body of a ring under its teeth.

    Parameters
    ----------
    tooth : Tooth
        Of a ring; its `bore_radius_m` is the radius round which the ring is held.

    Notes
    -----
    ``1/k_f = cos^2 a (R_mm u^2 + 2 R_mt u + R_tt + R_nn tan^2 a)/(E b)`` with the compliances R of
    `arc_compliance` and u from the root circle to where the force meets the middle of
    the tooth. For discs the same solution gives the terms P and Q of Sainsot, Velex & Duverger
    within 7 %; their L, for the moment, is a fifth larger than the mean rotation over the arc.
    Against finite elements of one tooth on its ring, tooth and body together are 11 % too compliant
    under the tip, 20 % halfway and 30 % near the root, where little yields; external teeth 10 %.
    """

    tooth: Tooth

    @cached_property
    def root_angle_rad(self) -> float:
        """Half the angle of the loaded arc on the root circle."""
        tooth, part = self.tooth, self.tooth.root_part
        end = tooth.flank(tooth.start) if part is None else where_tangent(part, ARC_TANGENT)
        return math.atan2(end.real, -end.imag)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is taken for granted of the body."""
        name, tooth = self.tooth.name, self.tooth
        rim = (tooth.bore_radius_m - tooth.root_radius_m) / tooth.module_m
        held = (
            f"the {name} is taken as held all round its outer diameter of "
            f"{2e3 * tooth.bore_radius_m:.5g} mm: one that floats or stands on few bolts "
            f"yields more"
        )
        thin = (
            f"the rim of the {name} is {rim:.3g} modules thick, below {USUAL_RIM:g}: "
            f"how the ring is held matters much"
        )
        return (held, thin) if rim < USUAL_RIM - 1e-9 else (held,)

    def compliance(self, angle: FloatArray) -> FloatArray:
        """Return the compliance [m/N] for contacts at profile angles `angle`."""
        return self.deflection(angle, angle)

    def coupling(self, apart: int, ahead: FloatArray, behind: FloatArray) -> FloatArray:
        """Return how far a tooth gives way when another one is loaded [m/N].

        Parameters
        ----------
        apart : int, >= 1
            Distance of the two teeth [teeth].
        ahead, behind : ndarray
            Profile angles of the contacts of the tooth that entered first and of the other.
        """
        away = -2 * math.pi * apart / self.tooth.teeth
        return np.maximum(self.deflection(ahead, behind, away), 0.0)

    def deflection(
        self, felt: FloatArray, loaded: FloatArray, apart_rad: float = 0.0
    ) -> FloatArray:
        """Return how far a contact gives way under a unit force on another [m/N].

        Parameters
        ----------
        felt, loaded : ndarray
            Their profile angles.
        apart_rad : float
            Angle from the one to the other tooth, see `arc_compliance`.
        """
        tooth = self.tooth
        ratio = tooth.bore_radius_m / tooth.root_radius_m
        arc = arc_compliance(ratio, self.root_angle_rad, tooth.poisson_ratio, apart_rad)
        moved = np.einsum("i...,ij,j...->...", self._load(felt), arc, self._load(loaded))
        return np.asarray(moved / (tooth.elastic_modulus_pa * tooth.face_width_m))

    def _load(self, angle: FloatArray) -> FloatArray:
        """Return moment, shear and push at the root per unit force, for unit root radius."""
        tooth = self.tooth
        cosine = np.cos(angle)
        arm = 1 - tooth.base_radius_m / (tooth.root_radius_m * cosine)
        return np.stack([arm * cosine, cosine, np.sin(tooth.slope(angle))])
