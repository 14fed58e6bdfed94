"""Hill's equation of one gear mesh, and its steady vibration as Fourier coefficients.

    m z'' + c z' + k(t) z = F + f(t),    k(t) = k0 [1 + phi(t)],
    phi(t) = sum_{j=1..J} (c_j e^{ijwt} + conjugate),    w = 2 pi/T

z is the deflection along the line of action in metres, positive when the teeth are pressed
together.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gearmon.arrays import IntArray
from gearmon.dynamics import floquet
from gearmon.dynamics.fourier import Complex, Curve, Modulation, Real, cut, turning
from gearmon.errors import ArgumentError, check_finite, check_positive, check_range, check_word
from gearmon.result import Result

LARGEST = 1e9
# Sum of |c_j|: no spring swings by so many times its mean. That one of 100 is unstable takes 0.4 s
# to find, one of 1000 12 s, one of 10,000 minutes.
MOST_SWING = 100.0
NO_HARMONICS: Complex = np.zeros(0, dtype=complex)
NO_HARMONICS.flags.writeable = False


@dataclass(frozen=True, eq=False)
class HillProblem(Result):
    """One mass on a periodic spring.

    Parameters
    ----------
    mass_kg : float
        m > 0, equivalent mass of the pair on the line of action.
    damping_ns_per_m : float
        c >= 0. Without damping (0) no steady state is ever reached.
    stiffness_n_per_m : float
        k0 > 0, mean stiffness.
    stiffness_harmonics : complex array, shape (J,)
        c_1..c_J of phi(t), relative to the mean stiffness; eps cos(wt) has c_1 = eps/2.
    period_s : float
        T > 0, period of k(t).
    force_n : float
        F, constant force.
    force_harmonics_n : complex array, shape (G,), optional
        f_1..f_G of a periodic force f(t) = sum (f_n e^{inwt} + conjugate). Teeth with the profile
        error e(t) are forced by m (n w)^2 e_n in the coordinate z - e.

    Raises
    ------
    ArgumentError
        If a value is not finite or out of its range.

    Examples
    --------
    >>> p = HillProblem(0.28, 9e3, 8e8, [0.065], 1.6e-3, 4e3)
    >>> round(p.natural_frequency_hz, 2), round(p.damping_ratio, 4), round(p.frequency_ratio, 4)
    (8507.19, 0.3007, 13.6115)
    """

    mass_kg: float
    damping_ns_per_m: float
    stiffness_n_per_m: float
    stiffness_harmonics: Complex
    period_s: float
    force_n: float
    force_harmonics_n: Complex = field(default_factory=lambda: NO_HARMONICS)

    def __post_init__(self) -> None:
        for name in ("stiffness_harmonics", "force_harmonics_n"):
            object.__setattr__(self, name, frozen_vector(name, getattr(self, name)))
        check_swing("stiffness_harmonics", self.stiffness_harmonics)
        check_positive("mass_kg", self.mass_kg, "kg")
        if check_finite("damping_ns_per_m", self.damping_ns_per_m, "N s/m") < 0:
            raise ArgumentError(f"damping_ns_per_m={self.damping_ns_per_m} N s/m must be >= 0")
        stiffness = check_positive("stiffness_n_per_m", self.stiffness_n_per_m, "N/m")
        check_positive("period_s", self.period_s, "s")
        static = abs(check_finite("force_n", self.force_n, "N")) / stiffness
        ratio, zeta = self.frequency_ratio, self.damping_ratio
        if 1 / LARGEST <= ratio <= LARGEST and zeta <= LARGEST and static <= LARGEST:
            return
        values = (
            f"mass_kg={self.mass_kg}, damping_ns_per_m={self.damping_ns_per_m}, "
            f"stiffness_n_per_m={self.stiffness_n_per_m}, period_s={self.period_s}"
        )
        check_range(f"{values}: natural over mesh frequency", ratio, 1 / LARGEST, LARGEST)
        check_range(f"{values}: damping ratio", zeta, 0.0, LARGEST)
        check_range(f"force_n={self.force_n}: force over stiffness", static, 0.0, LARGEST, "m")

    @property
    def angular_frequency(self) -> float:
        """Angular frequency w = 2 pi/T [rad/s]."""
        return 2 * math.pi / self.period_s

    @cached_property
    def natural_frequency_hz(self) -> float:
        """sqrt(k0/m)/(2 pi) [Hz], undamped and with the mean stiffness."""
        return math.sqrt(self.stiffness_n_per_m) / math.sqrt(self.mass_kg) / (2 * math.pi)

    @cached_property
    def damping_ratio(self) -> float:
        """Damping ratio zeta = c/(2 sqrt(k0 m)) [1]."""
        root = math.sqrt(self.stiffness_n_per_m) * math.sqrt(self.mass_kg)
        return self.damping_ns_per_m / (2 * root)

    @cached_property
    def frequency_ratio(self) -> float:
        """R = w0/w [1]: the harmonic that lies on the natural frequency."""
        return self.natural_frequency_hz * self.period_s

    def dynamic_stiffness(self, highest: int) -> Complex:
        """D_n = 1 - (n/R)^2 + 2 i zeta n/R, relative to k0, shape (highest+1,)."""
        return dynamic_stiffness(self.frequency_ratio, self.damping_ratio, highest)

    def static_forcing(self, highest: int) -> Complex:
        """(F, f_1, ..., f_highest)/k0 [m], shape (highest+1,)."""
        forcing = cut(np.concatenate([[self.force_n], self.force_harmonics_n]), highest)
        return forcing / self.stiffness_n_per_m


def frozen_vector(name: str, values: npt.ArrayLike) -> Complex:
    """Return a read-only complex copy of a list of finite coefficients."""
    if values is NO_HARMONICS:
        return NO_HARMONICS
    vector: Complex = np.array(values, dtype=complex)
    if vector.ndim != 1:
        raise ArgumentError(f"{name}: shape {vector.shape} must be one row of coefficients")
    check_entries(name, vector)
    vector.flags.writeable = False
    return vector


def check_entries(name: str, array: Complex | Real, unit: str = "") -> None:
    """Raise with the first entry that is no finite number."""
    # the sum of squares is finite only if all are, and cheaper; it may overflow, then look closer
    if not math.isfinite(np.vdot(array, array).real) and not np.isfinite(array).all():
        place = np.argwhere(~np.isfinite(array))[0]
        raise ArgumentError(f"{_entry(name, array, place, unit)} must be a finite number")


def _entry(name: str, array: Complex | Real, place: IntArray, unit: str) -> str:
    index = f"[{', '.join(map(str, place))}]" if len(place) else ""
    return f"{name}{index}={array[tuple(place)]} {unit}".rstrip()


def check_swing(name: str, harmonics: Complex) -> None:
    """Raise if a stiffness swings beyond all sense; `harmonics` are c_1..c_J, or rows of them."""
    swing = float(np.abs(harmonics).sum(axis=-1).max(initial=0.0))
    if not swing <= MOST_SWING:
        raise ArgumentError(
            f"{name}: the stiffness would swing by {swing:.3g} times its mean (sum of the "
            f"coefficients' sizes); allowed is {MOST_SWING:g} times"
        )


def dynamic_stiffness(ratio: float | Real, zeta: float | Real, highest: int) -> Complex:
    """D_n of lines 0..highest for R = `ratio`, relative to k0; `ratio`, `zeta` may be columns."""
    return stiffness_at(np.arange(highest + 1) / ratio, zeta)


def stiffness_at(x: Real, zeta: float | Real) -> Complex:
    """D = 1 - x^2 + 2 i zeta x at frequencies x relative to the natural one."""
    stiffness: Complex = np.empty(x.shape, dtype=complex)
    np.subtract(1.0, x * x, out=stiffness.real)
    np.multiply(x, 2 * zeta, out=stiffness.imag)
    return stiffness


def largest_responses(
    ratio: float, zeta: float, power: float = 0.0, line: int = 0
) -> tuple[float, float]:
    """Largest 1/s_n and x_n^2/s_n of all lines n >= `line`, s_n^2 = |D_n|^2 + power, x_n = n/R.

    s^2 is a parabola in x^2 and s^2/x^4 one in 1/x^2: the best lines are next to their vertices.
    """
    middle = 1 - 2 * zeta * zeta
    lines = [line]
    # the second vertex is the farther one
    if middle > 0 and line * line * middle < ratio * ratio * (1 + power):
        for vertex in (middle, (1 + power) / middle):
            near = math.floor(ratio * math.sqrt(vertex))
            lines += [n for n in (near, near + 1) if n > line]
    least, least_weighted = math.inf, 1.0
    for n in lines:
        x = (n / ratio) ** 2
        square = (1 - x) ** 2 + 4 * zeta * zeta * x + power
        least = min(least, square)
        if n:
            least_weighted = min(least_weighted, square / (x * x))
    return 1 / math.sqrt(max(least, 1e-300)), 1 / math.sqrt(max(least_weighted, 1e-300))


UNITS = {
    "mass_kg": "kg",
    "damping_ns_per_m": "N s/m",
    "stiffness_n_per_m": "N/m",
    "period_s": "s",
    "force_n": "N",
    "scale": "",
}


def broadcast_values(
    values: dict[str, npt.ArrayLike], axes: tuple[int, ...] = ()
) -> dict[str, Real]:
    """Values of many sets by their names in `UNITS`, checked and broadcast against each other.

    Parameters
    ----------
    values : dict of str to float array
    axes : tuple of int
        Shape of what else broadcasts with them.
    """
    for name in values:
        check_word("", name, UNITS)
    checked = {name: _checked_array(name, value) for name, value in values.items()}
    try:
        shape = np.broadcast_shapes(axes, *(value.shape for value in checked.values()))
    except ValueError:
        shapes = {name: value.shape for name, value in checked.items()}
        shapes["stiffness_harmonics without its last axis"] = axes
        listed = ", ".join(f"{name} {shape}" for name, shape in shapes.items() if shape)
        raise ArgumentError(f"shapes do not broadcast together: {listed}") from None
    return {name: np.broadcast_to(value, shape) for name, value in checked.items()}


def _checked_array(name: str, values: npt.ArrayLike) -> Real:
    """Return values as floats, or raise with the first that is out of its range."""
    if np.iscomplexobj(values):
        raise ArgumentError(f"{name}: complex numbers, must be real")
    numbers = np.asarray(values, dtype=float)
    check_entries(name, numbers, UNITS[name])
    positive = name in ("mass_kg", "stiffness_n_per_m", "period_s")
    bad = np.argwhere((numbers <= 0 if positive else numbers < 0) & (name != "force_n"))
    if len(bad):
        shown = _entry(name, numbers, bad[0], UNITS[name])
        raise ArgumentError(f"{shown} must be {'> 0' if positive else '>= 0'}")
    return numbers


@dataclass(frozen=True, kw_only=True, eq=False)
class PeriodicVibration(Result, ABC):
    """What lines 0..N, on the first axis, tell of a steady vibration.

    Attributes
    ----------
    displacement : complex ndarray, shape (N+1, ...)
        Lines [m], x(t) = x_0 + sum_{n>=1} (x_n e^{inwt} + conjugate). Amplitudes are 2|x_n|.
    error_bound : float
        Guaranteed bound of the relative L2 error of the acceleration, of the harmonics given here
        and of all coordinates together; infinite if none could be computed or if there is no steady
        state.
    method : str
        "msm", "msm least residual", "harmonic balance" or "shooting".
    order : int
        Number of orders of the expansion used; 0 for harmonic balance and shooting.
    stable : bool
        Whether free vibrations die out.
    message : str
        One line: which method and why, or what is wrong, with the number.
    """

    displacement: Complex
    error_bound: float
    method: str
    order: int
    stable: bool
    message: str

    @property
    @abstractmethod
    def _period_s(self) -> float:
        """Time after which it repeats [s]."""

    @property
    def _angular(self) -> Real:
        rows = (-1, *(1,) * (self.displacement.ndim - 1))
        return np.asarray((2 * math.pi * self.frequency_hz).reshape(rows))

    @property
    def frequency_hz(self) -> Real:
        """Frequencies n/T [Hz], shape (N+1,)."""
        return np.arange(len(self.displacement)) / self._period_s

    @cached_property
    def velocity(self) -> Complex:
        """Velocity i n w z_n [m/s], shape of the displacement."""
        return 1j * self._angular * self.displacement

    @cached_property
    def acceleration(self) -> Complex:
        """Acceleration -(n w)^2 z_n [m/s2], shape of the displacement."""
        return -(self._angular**2) * self.displacement

    @property
    def energy_lines(self) -> Real:
        """E_n = (2 pi f_n A_n)^2/2 [J/kg] of each line, A_n = 2|z_n|, shape of the displacement."""
        return 2 * np.abs(self.velocity) ** 2

    def at(self, time_s: npt.ArrayLike, kind: str = "displacement") -> Real:
        """Displacement [m], velocity [m/s], acceleration [m/s2] or mesh force [N] at any times.

        Parameters
        ----------
        time_s : float array
            Times [s], any shape.
        kind : {"displacement", "velocity", "acceleration", "mesh_force"}
            What to evaluate.

        Returns
        -------
        float ndarray
            Shape of the times, and behind it that of one line.
        """
        half: Complex = getattr(self, check_kind(kind))
        turns = np.asarray(time_s, dtype=float) / self._period_s
        phase = turning(2 * math.pi * (turns % 1.0), np.arange(1.0, len(half)))
        return np.asarray(half[0].real + 2 * (phase @ half[1:]).real, dtype=np.float64)


def least_over_mean(force: Complex) -> float:
    """Smallest value over the mean of a force, counted in the direction of its mean."""
    mean = float(force[0].real)
    lowest = Curve(force * math.copysign(1.0, mean)).lowest()
    if mean:
        return lowest / abs(mean)
    return 0.0 if lowest == 0 else -math.inf


KINDS = ("displacement", "velocity", "acceleration", "mesh_force")


def check_kind(kind: str) -> str:
    """Return what to evaluate at times, or raise ArgumentError."""
    check_word("kind=", kind, KINDS)
    return kind


@dataclass(frozen=True, kw_only=True, eq=False)
class Response(PeriodicVibration):
    """Steady vibration of a `HillProblem`.

    Attributes
    ----------
    problem : HillProblem
        What was solved.
    displacement : complex ndarray, shape (N+1,)
        z_0..z_N [m].
    """

    problem: HillProblem

    def __post_init__(self) -> None:
        object.__setattr__(self, "displacement", frozen_vector("displacement", self.displacement))

    @property
    def _period_s(self) -> float:
        return self.problem.period_s

    @cached_property
    def mesh_force(self) -> Complex:
        """Coefficients of k(t) z + c z' [N], harmonics 0..N+J."""
        highest = len(self.displacement) - 1
        c = self.problem.stiffness_harmonics
        force = Modulation(c, highest, highest + len(c))(self.displacement)
        force[: highest + 1] += self.displacement
        force *= self.problem.stiffness_n_per_m
        force[: highest + 1] += self.problem.damping_ns_per_m * self.velocity
        return force

    @cached_property
    def floquet_multipliers(self) -> tuple[complex, complex]:
        """Factors by which a free vibration changes over a period, the larger modulus first."""
        p = self.problem
        return floquet.multipliers(p.frequency_ratio, p.damping_ratio, p.stiffness_harmonics)

    @cached_property
    def mesh_force_margin(self) -> float:
        """Smallest mesh force over its mean [1]: 1 without vibration, <= 0 where contact is lost.

        Minus infinity without a mean force; dips between samples are searched for.
        """
        return least_over_mean(self.mesh_force)

    @property
    def contact_lost(self) -> bool:
        """Whether the mesh force is <= 0 somewhere: there the linear model ends."""
        return self.contact_loss_angle_rad is not None

    @cached_property
    def contact_loss_angle_rad(self) -> float | None:
        """First angle w t in [0, 2 pi) with mesh force <= 0, or None."""
        # positive in the direction of F, which presses the teeth together
        pressing = self.mesh_force * math.copysign(1.0, self.problem.force_n)
        return Curve(pressing).first_not_positive()
