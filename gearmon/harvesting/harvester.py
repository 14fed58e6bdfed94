"""What a harvester is: modes that a shaken base drives, a circuit that they drive, answers to both.

Every harvester here is linear. With the modes eta normalised by mass, the acceleration a of the
base and u for what the circuit knows (the voltage of a piezoelectric layer, the current of a coil,
the force of a damper over the root of the mass):

    eta_r'' + 2 z_r w_r eta_r' + w_r^2 eta_r + chi_r u = -F_r a
    C u' + g u = sum_r chi_r eta_r',                         power = (k u)^2

g and k follow from the load. At one frequency all answers are

    u/a = -i w sum_r chi_r F_r/alpha_r / (g + i w (C + sum_r chi_r^2/alpha_r))
    alpha_r = w_r^2 - w^2 + 2 i z_r w_r w

k u is the root of the power: its square is the power at every instant, so that the mean power is
half its squared size times A^2 at one frequency, and the mean square of the filtered recording in
general. Erturk and Inman, J. Vib. Acoust. 130 (2008) 041002, have this form for a beam.

A single mass on a spring whose motion is damped by a generator:

    m z'' + 2 m (zm + ze) wn z' + m wn^2 z = -m a(t),   P = 2 m ze wn <z'^2>

with zm the mechanical and ze the electrical damping ratio. For a = A cos(wt), r = w/wn:

    P = m ze A^2 r^2 / (wn [(1 - r^2)^2 + (2 (zm + ze) r)^2])   (electrical, mean)

At r = 1, ze = zm this is m A^2/(16 zm wn), the most that any load takes. Valid for a generator
that acts as a viscous damper, as a coil does below the corner of its inductance. Williams and
Yates, Sensors and Actuators A 52 (1996) 8-11; Roundy, J. Intell. Mater. Syst. Struct. 16 (2005)
809-823.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self, TypeVar

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError, check_range
from gearmon.machine.fields import Checked, Number, held, within

Real = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

#: Rows of `transfer`: root of the power [W^(1/2)], travel [m], and the stresses of both layers,
#: each over its safe stress and times that of the first [Pa]; zero where they are not modelled.
OUTPUTS = ("root_power", "travel_m", "stress_pa", "other_stress_pa")
FREQUENCY = Number(low=0, high=1e6, unit="Hz", open_low=True)
#: Points of a response table, half of them about the resonance.
POINTS = 240


class Gains(NamedTuple):
    """Answers of a harvester to a unit acceleration amplitude of its base, by frequency.

    Attributes
    ----------
    frequency_hz : ndarray, shape (n,)
    power_w : ndarray, shape (n,)
        Mean electrical power per squared acceleration amplitude [W/(m/s2)^2].
    travel_m : ndarray, shape (n,)
        Amplitude of the moving mass against the base [m/(m/s2)].
    stress_pa : ndarray, shape (n,)
        Amplitude of the largest stress, each part over its safe stress and times that of the
        weakest: zero for harvesters whose spring is not modelled [Pa/(m/s2)].
    voltage_v : ndarray, shape (n,)
        Amplitude of the voltage at the load [V/(m/s2)]; zero where there is no circuit.
    """

    frequency_hz: Real
    power_w: Real
    travel_m: Real
    stress_pa: Real
    voltage_v: Real


@dataclass(frozen=True, kw_only=True, eq=False)
class Modes:
    """Modes of a harvester, as the docstring of this module has them.

    Attributes
    ----------
    natural_rad_s, damping_ratio, forcing : ndarray, shape (modes,)
        w_r [rad/s], z_r, F_r [sqrt(kg)].
    rows : ndarray, shape (4, modes)
        chi_r, then travel and the two stresses per eta_r, see `OUTPUTS`.
    direct : ndarray, shape (4,)
        What u adds to each of these by itself; the first is not used.
    store : float
        C.
    """

    natural_rad_s: Real
    damping_ratio: Real
    forcing: Real
    rows: Real
    direct: Real
    store: float

    def compliance(self, circular: Real, rows: int) -> tuple[Complex, Complex]:
        """First rows of the answers to an acceleration and to u, each (rows, n)."""
        natural, damping = self.natural_rad_s[:, None], self.damping_ratio[:, None]
        below = natural**2 - circular**2 + 2j * damping * natural * circular
        mode: Complex = np.asarray(1 / below, dtype=np.complex128)
        shapes = self.rows[:rows]
        return (shapes * self.forcing) @ mode, (shapes * self.rows[0]) @ mode


@dataclass(frozen=True, kw_only=True)
class Harvester(Checked, ABC):
    """A linear harvester on a moving base.

    Parameters
    ----------
    clearance_m : float, > 0
        Room of the moving mass to either side [m]; infinite if none is given.
    weight_ms2 : float, -1000 to 1000
        Gravity along the motion: 9.81 m/s2 for a motion up and down.
    restitution : float, 0 to 1
        Speed after a blow at the end of the clearance over that before. It depends on the stop, so
        that it has to be measured; 0.5 is no more than the middle of what is possible.
    load_kept : bool
        Whether the load is given, not tuned.
    """

    #: What it is called in a file.
    kind: ClassVar[str]
    #: What `to_dict` tells of it, and what else than `mechanical_damping_ratio` damps it if given.
    told: ClassVar[tuple[str, ...]] = ()
    other_damping: ClassVar[tuple[str, ...]] = ()
    #: Field that holds the load: a resistance [ohm], or a ratio where there is no circuit.
    load_name: ClassVar[str] = "load_ohm"
    clearance_m: float = within(0, math.inf, "m", default=math.inf, open_low=True)
    weight_ms2: float = within(-1e3, 1e3, "m/s2", default=0.0)
    restitution: float = within(0, 1, default=0.5)
    load_kept: bool = False

    if TYPE_CHECKING:
        # a field of some, a property of others

        @property
        def natural_frequency_hz(self) -> float:
            """Frequency of the first mode, short-circuited [Hz]."""

    @property
    @abstractmethod
    def usual_loads(self) -> tuple[float, float]:
        """Loads that may be worth trying, low and high."""

    @property
    @abstractmethod
    def frequency_range_hz(self) -> tuple[float, float]:
        """Natural frequencies that `retuned` can reach [Hz]."""

    @property
    def stress_limit_pa(self) -> float:
        """Safe stress of the weakest part [Pa]; infinite where no stress is modelled."""
        return math.inf

    @cached_property
    @abstractmethod
    def modes(self) -> Modes:
        """Modes, which do not depend on the load."""

    def circuit(self, loads: Any) -> tuple[Any, Any]:
        """G and k of several loads: of a voltage at a resistance, if nothing else is said."""
        return 1 / loads, 1 / np.sqrt(loads)

    @abstractmethod
    def retuned(self, frequency_hz: float) -> Self:
        """Return the same harvester with another natural frequency [Hz]."""

    def with_damping_ratio(self, ratio: float) -> Self:
        """Return the same harvester with another mechanical damping ratio, of every mode."""
        changed: dict[str, Any] = {name: getattr(type(self), name) for name in self.other_damping}
        return replace(self, **changed | {"mechanical_damping_ratio": float(ratio)})

    def to_dict(self) -> dict[str, Any]:
        """Return dimensions and what follows from them in built-in types; no clearance is null."""
        told = {name: getattr(self, name) for name in ("kind", *self.told)}
        return told | {"clearance_m": None if math.isinf(self.clearance_m) else self.clearance_m}

    @property
    def load(self) -> float:
        """Load: resistance [ohm], or electrical damping ratio where there is no circuit."""
        return float(getattr(self, self.load_name))

    @property
    def resistance_ohm(self) -> float:
        """Load resistance [ohm]; NaN where there is no circuit."""
        return self.load if self.load_name == "load_ohm" else math.nan

    @property
    def load_range(self) -> tuple[float, float]:
        """Loads to tune within: the usual ones, or the one that is kept."""
        return (self.load, self.load) if self.load_kept else self.usual_loads

    @property
    def damping_ratio(self) -> float:
        """Mechanical damping ratio of the first mode."""
        return float(self.modes.damping_ratio[0])

    @property
    def settling_s(self) -> float:
        """Time constant of the ring-down of the first mode, open or short [s]."""
        return 1 / (self.damping_ratio * float(self.modes.natural_rad_s[0]))

    def with_load(self, load: float) -> Self:
        """Return the same harvester with another load."""
        changed: dict[str, Any] = {self.load_name: load}
        other = replace(self, **changed)
        if "modes" in self.__dict__:
            other.__dict__["modes"] = self.modes
        return other

    def transfer(self, loads: Real, frequency_hz: Real, rows: int = len(OUTPUTS)) -> Complex:
        """First answers per unit acceleration of the base, shape (rows, loads, n).

        Parameters
        ----------
        loads : ndarray, shape (loads,)
        frequency_hz : ndarray, shape (n,), >= 0
        rows : int, 1 to 4
            See `OUTPUTS`.
        """
        circular, modes = 2 * math.pi * frequency_hz, self.modes
        by_push, by_circuit = modes.compliance(circular, rows)
        leak, worth = self.circuit(loads[:, None])
        around = leak + 1j * circular * (modes.store + by_circuit[0])
        driven = -1j * circular * by_push[0] / around
        others = [(modes.direct[k] - by_circuit[k]) * driven - by_push[k] for k in range(1, rows)]
        return np.array([worth * driven, *others])

    def gains(self, frequency_hz: npt.ArrayLike) -> Gains:
        """Answers to a unit acceleration amplitude of the base, with the load as it is.

        Parameters
        ----------
        frequency_hz : float array, shape (n,) or a number, >= 0
        """
        frequency = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
        answers = np.abs(self.transfer(np.array([self.load]), frequency)[:, 0])
        return Gains(frequency_hz=frequency, power_w=answers[0] ** 2 / 2, **self.sizes(answers))

    def sizes(self, answers: Real) -> dict[str, Real]:
        """Travel, stress and voltage of sizes that are as `OUTPUTS` has them."""
        root_power, travel, *stress = answers
        voltage = np.nan_to_num(root_power * math.sqrt(self.resistance_ohm))
        return {"travel_m": travel, "stress_pa": np.maximum(*stress), "voltage_v": voltage}

    def power_bound_w(self) -> float:
        """Sum over modes of F^2/(16 z w): no load takes more, at no frequency [W/(m/s2)^2].

        The power available to any load is |D|^2/(8 Re Y); by the inequality of Cauchy and Schwarz
        it does not exceed the sum of what the modes would give one by one.
        """
        modes = self.modes
        return float((modes.forcing**2 / (16 * modes.damping_ratio * modes.natural_rad_s)).sum())


H = TypeVar("H", bound=Harvester)


@dataclass(frozen=True, kw_only=True)
class _MassOnSpring(Harvester):
    """What harvesters with a stiff mass share; the electrical side is theirs."""

    mass_kg: float = within(0, 1e6, "kg", open_low=True)
    natural_frequency_hz: float = held(FREQUENCY)
    mechanical_damping_ratio: float = within(1e-6, 0.999, default=0.01)
    lowest_hz: float = held(FREQUENCY, 5.0)
    highest_hz: float = held(FREQUENCY, 20_000.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        name = "lowest_hz to highest_hz: natural_frequency_hz"
        check_range(name, self.natural_frequency_hz, self.lowest_hz, self.highest_hz, "Hz")

    @property
    def frequency_range_hz(self) -> tuple[float, float]:
        """Natural frequencies that the spring may be built for [Hz]."""
        return self.lowest_hz, self.highest_hz

    @property
    def stiffness_n_per_m(self) -> float:
        """Spring stiffness m wn^2 [N/m]."""
        return self.mass_kg * self._natural**2

    def retuned(self, frequency_hz: float) -> Self:
        """Return the same mass on a spring for another natural frequency [Hz].

        Raises
        ------
        ArgumentError
            If it lies outside `frequency_range_hz`.
        """
        return replace(self, natural_frequency_hz=float(frequency_hz))

    def to_dict(self) -> dict[str, Any]:
        """Return the values in built-in types; no clearance is null."""
        return asdict(self) | {"stiffness_n_per_m": self.stiffness_n_per_m} | super().to_dict()

    @property
    def _natural(self) -> float:
        return 2 * math.pi * self.natural_frequency_hz

    def _modes(self, coupling: float, store: float) -> Modes:
        root = math.sqrt(self.mass_kg)
        return Modes(
            natural_rad_s=np.array([self._natural]),
            damping_ratio=np.array([self.mechanical_damping_ratio]),
            forcing=np.array([root]),
            rows=np.array([[coupling / root], [1 / root], [0.0], [0.0]]),
            direct=np.zeros(4),
            store=store,
        )


@dataclass(frozen=True, kw_only=True)
class InertialHarvester(_MassOnSpring):
    """A mass on a spring with mechanical and electrical damping.

    Parameters
    ----------
    mass_kg : float, > 0
    natural_frequency_hz : float, > 0
        Of mass and spring.
    mechanical_damping_ratio : float, 1e-6 to 0.999
        What is lost to heat.
    electrical_damping_ratio : float, > 0 and <= 10
        What the load takes.
    lowest_hz, highest_hz : float, > 0
        Natural frequencies that the spring may be built for.
    clearance_m, weight_ms2, restitution, load_kept
        See `Harvester`.

    Raises
    ------
    ArgumentError
        If a value is out of its range.

    Examples
    --------
    >>> h = InertialHarvester(mass_kg=5e-3, natural_frequency_hz=625.0)
    >>> h = h.with_load(h.mechanical_damping_ratio)   # matched
    >>> round(float(h.gains(625.0).power_w[0]) / h.power_bound_w(), 12)
    1.0
    """

    kind: ClassVar[str] = "inertial"
    load_name: ClassVar[str] = "electrical_damping_ratio"
    electrical_damping_ratio: float = within(0, 10, open_low=True, default=0.01)

    @property
    def usual_loads(self) -> tuple[float, float]:
        """Electrical damping ratios worth trying: from a hundredth of the mechanical one to 3."""
        return self.mechanical_damping_ratio / 100, 3.0

    @cached_property
    def modes(self) -> Modes:
        """The one mode; u is the force of the damper over the root of the mass."""
        return self._modes(math.sqrt(self.mass_kg), 0.0)

    def circuit(self, loads: Any) -> tuple[Any, Any]:
        """G and k of several loads, by u = 2 ze wn eta'."""
        return super().circuit(2 * loads * self._natural)


@dataclass(frozen=True, kw_only=True)
class CoilHarvester(_MassOnSpring):
    """A magnet on a spring that moves through a coil.

        m z'' + c z' + k z + theta i = -m a(t),     L i' + (R_coil + R) i = theta z'

    Parameters
    ----------
    mass_kg, natural_frequency_hz, mechanical_damping_ratio, lowest_hz, highest_hz
        As of an `InertialHarvester`.
    turns : float, > 0
    field_length_tm : float, > 0
        Flux density across the wire times the length of a turn in it, B l [T m]; theta is this
        times the turns [N/A = V s/m].
    coil_ohm : float, > 0
    coil_henry : float, >= 0
        Inductance of the coil [H].
    load_ohm : float, > 0
    clearance_m, weight_ms2, restitution, load_kept
        See `Harvester`.

    Raises
    ------
    ArgumentError
        If a value is out of its range.
    """

    kind: ClassVar[str] = "coil"
    turns: float = within(0, 1e7, open_low=True)
    field_length_tm: float = within(0, 1e3, "T m", open_low=True)
    coil_ohm: float = within(0, 1e9, "ohm", open_low=True)
    coil_henry: float = within(0, 1e3, "H", default=0.0)
    load_ohm: float = within(0, 1e12, "ohm", open_low=True, default=100.0)

    @property
    def transduction_n_per_a(self) -> float:
        """Turns times B l, theta [N/A]."""
        return self.turns * self.field_length_tm

    @property
    def usual_loads(self) -> tuple[float, float]:
        """From a hundredth of the coil to a hundred times it with what the motion stands for."""
        heat = 2 * self.mass_kg * self.mechanical_damping_ratio * self._natural
        return self.coil_ohm / 100, 100 * (self.coil_ohm + self.transduction_n_per_a**2 / heat)

    @cached_property
    def modes(self) -> Modes:
        """The one mode; u is the current."""
        return self._modes(self.transduction_n_per_a, self.coil_henry)

    def circuit(self, loads: Any) -> tuple[Any, Any]:
        """G and k of several loads: the resistance around, and the root of that outside."""
        return loads + self.coil_ohm, np.sqrt(loads)


def half_power_band(harvester: Harvester) -> dict[str, float]:
    """Find the half-power band of the first mode with the load as it is.

    For a mass on a spring with the damping ratios zm (heat) and ze (load) it is 2 (zm + ze) fn
    exactly. The largest power rises with Q and the bandwidth falls as 1/Q: their product stays, so
    that a line which wanders further than the bandwidth yields no more from a higher Q.

    Parameters
    ----------
    harvester : InertialHarvester, CoilHarvester or PiezoCantilever

    Returns
    -------
    dict
        peak_hz, low_hz and high_hz (where the power is largest, and the ends of the band around
        it), power_w (largest mean power per squared acceleration amplitude [W/(m/s2)^2]), width_hz
        and quality_factor (peak frequency over it, with the load).

    Raises
    ------
    ArgumentError
        If the power does not fall to a half on both sides, as with a very large load damping.

    Examples
    --------
    >>> from gearmon.harvesting import InertialHarvester
    >>> h = InertialHarvester(mass_kg=5e-3, natural_frequency_hz=100.0)   # zm = ze = 0.01
    >>> round(half_power_band(h)["width_hz"], 9)
    4.0
    """
    from scipy.optimize import brentq, minimize_scalar

    def power(frequency: float) -> float:
        return float(harvester.gains(frequency).power_w[0])

    natural = harvester.natural_frequency_hz
    grid = natural * np.exp(np.linspace(-1.2, 1.2, 24_001))
    found = harvester.gains(grid).power_w
    # higher modes have bands of their own
    top = int(np.argmax(np.where(np.abs(np.log(grid / natural)) < 0.7, found, 0.0)))
    near, fine = (grid[max(top - 1, 0)], grid[top + 1]), {"xatol": 1e-9 * natural}
    peak = float(minimize_scalar(lambda f: -power(f), bounds=near, options=fine).x)
    half = power(peak) / 2
    crossed = np.flatnonzero(np.diff(found < half))
    sides = [*crossed[crossed < top][-1:], *crossed[crossed >= top][:1]]
    if len(sides) < 2:
        raise ArgumentError(
            f"load={harvester.load:g}: the power does not fall to a half within a factor of 3 of "
            f"{natural:.4g} Hz; there is no band"
        )
    cross = partial(brentq, lambda f: power(f) - half, xtol=1e-12 * natural)
    low, high = (float(cross(grid[i], grid[i + 1])) for i in sides)
    ends = {"peak_hz": peak, "low_hz": low, "high_hz": high, "power_w": 2 * half}
    return ends | {"width_hz": high - low, "quality_factor": peak / (high - low)}


def response_rows(harvester: Harvester) -> list[dict[str, Any]]:
    """Power, voltage, travel and peak stress at 1 m/s2, from a third to three times the first mode.

    Parameters
    ----------
    harvester : InertialHarvester, CoilHarvester or PiezoCantilever

    Returns
    -------
    list of dict
        frequency_hz (dense about the mode), power_w, voltage_v, travel_m and stress_pa for an
        amplitude of 1 m/s2: the power goes with its square, the others with it. Voltage and stress
        are None where they are not modelled.
    """
    wide = np.linspace(-1, 1, POINTS // 2)
    factors = np.concatenate([np.exp(20 * harvester.damping_ratio * wide**3), 3**wide])
    gains = harvester.gains(np.unique(harvester.natural_frequency_hz * factors))
    names = ("frequency_hz", "power_w", "voltage_v", "travel_m", "stress_pa")
    columns = {name: getattr(gains, name).tolist() for name in names}
    nothing = [None] * len(gains.frequency_hz)
    columns |= {name: nothing for name in ("voltage_v", "stress_pa") if not any(columns[name])}
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
