"""Yielding of the gear body under a tooth, and what it does to the neighbouring tooth.

The body of an external gear follows a published fit. A ring is held all round its outside: the
tooth root loads an arc of the root circle, and the deflection is the exact plane-stress one of a
ring, so that thickness of the rim and coupling of teeth any distance apart follow from it. Every
Fourier component of the tractions is one small linear system for the complex potentials of the
ring; the loads are those that a tooth root passes on: a moment as linear pressure, a pull along the
circle as uniform shear, a push into the body as uniform pressure.

References
----------
Sainsot, Velex & Duverger, J. Mech. Des. 126 (2004) 142, for the fit and the loads; Muskhelishvili,
Some Basic Problems of the Mathematical Theory of Elasticity (1953), for the potentials.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.gears.tooth import Tooth, where_tangent

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
#: From where the arm u of the force is measured to the root circle.
Arm = Literal["axis", "contact"]
#: Tangent of the fillet against the middle of the tooth where the loaded arc ends: there it ends
#: in the fillet foundation of external gears with the standard rack.
ARC_TANGENT = math.radians(75)
#: Rim thickness in modules below which a ring is called thin (ISO 6336-3: rim factor above 1).
THIN_RIM = 3.5


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
    total = 2 * math.pi * (np.real(work) + _mean_work(ratio, kappa, half_angle_rad, outwards))
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
    matrix = np.zeros((len(k), 4, 4))
    one = np.ones_like(k)
    matrix[:, 0] = np.stack([1 - k, one, -one, 0 * k], axis=-1)
    matrix[:, 1] = np.stack([one, 1 + k, 0 * k, -one], axis=-1)
    matrix[:, 2:] = _displacements(k, far, kappa)
    near = _displacements(k, one, kappa)
    scale = np.abs(matrix).max(axis=1, keepdims=True)
    right = np.zeros((len(k), 4, 2))
    right[:, 0, 0] = right[:, 1, 1] = 1.0
    solved = np.linalg.solve(matrix / scale, right) / np.swapaxes(scale, 1, 2)
    return np.concatenate([_first_response(ratio, kappa)[None], near @ solved])


def _displacements(k: FloatArray, r: FloatArray, kappa: float) -> FloatArray:
    ahead = [kappa * r ** (k + 1) / (k + 1), -(r ** (1 - k)), 0 * k, r ** (-k - 1) / (k + 1)]
    behind = [-(r ** (1 + k)), kappa * r ** (1 - k) / (1 - k), r ** (k - 1) / (1 - k), 0 * k]
    return np.stack([np.stack(ahead, axis=-1), np.stack(behind, axis=-1)], axis=1)


def _first_response(ratio: float, kappa: float) -> FloatArray:
    """Return the response to tractions with a resultant force: logarithms, and a shift."""

    def displacements(r: float) -> FloatArray:
        ahead = [kappa * r * r / 2, -1.0, r**-2 / 2, 0.0]
        return np.array([ahead, [-r * r, 2 * kappa * math.log(r), 0.0, 1.0]])

    stresses = np.array([[0.0, 1 + kappa, 0.0, 0.0], [1.0, 2.0, -1.0, 0.0]])
    matrix = np.concatenate([stresses, displacements(ratio)])
    right = np.zeros((4, 2))
    right[0, 0] = right[1, 1] = 1.0
    return np.asarray(displacements(1.0) @ np.linalg.solve(matrix, right))


def _mean_work(ratio: float, kappa: float, half: float, outwards: float) -> FloatArray:
    """Return the work of the components of order 0: breathing and torsion of the ring."""
    mean = _tractions(np.zeros(1), half, outwards)[0]
    breathing = np.linalg.solve([[2.0, -1.0], [(kappa - 1) * ratio, 1 / ratio]], [1.0, 0.0])
    radial = (kappa - 1) * breathing[0] + breathing[1]
    torsion = 1 - ratio**-2
    moved = radial * mean.real + 1j * torsion * mean.imag
    return np.asarray(np.real(np.outer(mean, moved)))


def sainsot(radius_ratio: float, root_angle_rad: float) -> tuple[float, float, float, float]:
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
    terms = (1 / theta**2, h * h, h / theta, 1 / theta, h, 1.0)
    lower, middle, upper, slope = (
        sum(c * term for c, term in zip(row, terms, strict=True)) for row in SAINSOT.values()
    )
    return lower, middle, upper, slope


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
    arm: Arm = "axis"

    @cached_property
    def root_angle_rad(self) -> float:
        """theta_f, half the angle of the tooth root on the root circle."""
        rack = self.tooth.rack
        alpha, rounding = rack.pressure_angle_rad, rack.rounding
        across = math.pi / 2 + 2 * math.tan(alpha) * (rack.straight_depth - rounding)
        return (across + 2 * rounding / math.cos(alpha)) / self.tooth.teeth

    @property
    def radius_ratio(self) -> float:
        """R_f over bore radius."""
        return self.tooth.root_radius_m / self.tooth.bore_radius_m

    @property
    def warnings(self) -> tuple[str, ...]:
        """What lies outside the range of the fit."""
        ratio, angle, name = self.radius_ratio, self.root_angle_rad, self.tooth.name
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
        lower, middle, upper, slope = sainsot(self.radius_ratio, self.root_angle_rad)
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
        stiff = tooth.elastic_modulus_pa / (4 * math.pi * tooth.shear_modulus_pa)
        torsion = stiff * tooth.base_radius_m**2 * (inner**-2 - root**-2)
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
        height, half = tooth.height(tooth.start), tooth.half_thickness(tooth.start)
        if part is not None:
            height, half = part.at(np.array(where_tangent(part.at, ARC_TANGENT)))
        return math.atan2(float(half), -float(height))

    @property
    def rim_modules(self) -> float:
        """Thickness of the rim in modules."""
        return (self.tooth.bore_radius_m - self.tooth.root_radius_m) / self.tooth.module_m

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is taken for granted of the body."""
        name = self.tooth.name
        held = (
            f"the {name} is taken as held all round its outer diameter of "
            f"{2e3 * self.tooth.bore_radius_m:.5g} mm: one that floats or stands on few bolts "
            f"yields more"
        )
        thin = (
            f"the rim of the {name} is {self.rim_modules:.3g} modules thick, below {THIN_RIM:g}: "
            f"how the ring is held matters much"
        )
        return (held, thin) if self.rim_modules < THIN_RIM - 1e-9 else (held,)

    def compliance(self, angle: FloatArray) -> FloatArray:
        """Return the compliance [m/N] for contacts at profile angles `angle`."""
        load = self._load(angle)
        return self._scaled(load, self._arc(0.0), load)

    def coupling(
        self, apart: int = 1, ahead: FloatArray | None = None, behind: FloatArray | None = None
    ) -> FloatArray | float:
        """Return how far a tooth gives way when another one is loaded [m/N].

        Parameters
        ----------
        apart : int, >= 1
            Distance of the two teeth [teeth].
        ahead, behind : ndarray, optional
            Profile angles of the contacts of the tooth that entered first and of the other; by
            default halfway up.
        """
        middle = np.array([0.5 * (self.tooth.start + self.tooth.tip)])
        first, second = (self._load(middle if a is None else a) for a in (ahead, behind))
        away = -2 * math.pi * apart / self.tooth.teeth
        found = np.maximum(self._scaled(first, self._arc(away), second), 0.0)
        return found if ahead is not None else float(found[0])

    def _arc(self, apart_rad: float) -> FloatArray:
        tooth = self.tooth
        ratio = tooth.bore_radius_m / tooth.root_radius_m
        return arc_compliance(ratio, self.root_angle_rad, tooth.poisson_ratio, apart_rad)

    def _load(self, angle: FloatArray) -> FloatArray:
        """Return moment, shear and push at the root per unit force, for unit root radius."""
        tooth = self.tooth
        cosine = np.cos(angle)
        arm = 1 - tooth.base_radius_m / (tooth.root_radius_m * cosine)
        return np.stack([arm * cosine, cosine, np.sin(tooth.slope(angle))])

    def _scaled(self, first: FloatArray, arc: FloatArray, second: FloatArray) -> FloatArray:
        stiff = self.tooth.elastic_modulus_pa * self.tooth.face_width_m
        return np.asarray(np.einsum("i...,ij,j...->...", first, arc, second) / stiff)
