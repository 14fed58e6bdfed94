"""Piezoelectric cantilevers: unimorph and bimorph, series and parallel, with a mass at the tip.

Layers are bonded along the whole length, b wide. With the modes of `beam` (mass-normalised):

    eta_r'' + 2 z_r w_r eta_r' + w_r^2 eta_r + chi_r v = -F_r a(t)
    C v' + v/R = sum_r chi_r eta_r',      w(x, t) = sum_r phi_r(x) eta_r(t)   (against the base)

    unimorph           chi = -e31 b d phi'(L),           C = eps b L/hp
                       with d from the neutral axis to the middle of the layer
    bimorph, series    chi = -e31 b (hp + hs)/2 phi'(L), C = eps b L/(2 hp)
    bimorph, parallel  chi = -e31 b (hp + hs) phi'(L),   C = 2 eps b L/hp

    v/a = -i w sum_r chi_r F_r/alpha_r / (1/R + Y),   Y = i w C + i w sum_r chi_r^2/alpha_r
    alpha_r = w_r^2 - w^2 + 2 i z_r w_r w;            mean power |v|^2/(2R), largest at R = 1/|Y(w)|

Linear; thin beam (length over thickness above about 20); perfect bonds and thin electrodes. Erturk
and Inman, J. Vib. Acoust. 130 (2008) 041002; Smart Mater. Struct. 18 (2009) 025009.

Material values are typical ones of makers and textbooks; a real part differs by 5 to 10 %, so
replace them by the data sheet where there is one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError, check_finite, check_positive, check_range
from gearmon.harvesting.beam import BeamModes, beam_modes, mass_ratio_for
from gearmon.harvesting.power import Gains, OneLoad

Complex = npt.NDArray[np.complex128]
Real = npt.NDArray[np.float64]
Wiring = Literal["unimorph", "series", "parallel"]


@dataclass(frozen=True)
class PiezoMaterial:
    """A thin piezoelectric layer that is poled through its thickness and strained along the beam.

    Parameters
    ----------
    name : str
    youngs_modulus_pa : float, > 0
        At constant field, 1/s11E [Pa].
    density_kg_m3 : float, > 0
        [kg/m3].
    d31_m_per_v : float
        Strain along the beam per field through the thickness [m/V].
    permittivity_f_per_m : float, > 0
        eps33 at constant strain, eps33T - d31^2 Y for a beam [F/m].
    safe_stress_pa : float, > 0
        Peak stress along the beam that it bears for good [Pa].
    source : str
        Where the numbers come from.

    Raises
    ------
    ArgumentError
        If a number is not finite or out of its range.
    """

    name: str
    youngs_modulus_pa: float
    density_kg_m3: float
    d31_m_per_v: float
    permittivity_f_per_m: float
    safe_stress_pa: float
    source: str = ""

    def __post_init__(self) -> None:
        for name in ("youngs_modulus_pa", "density_kg_m3", "permittivity_f_per_m"):
            check_positive(name, getattr(self, name))
        check_finite("d31_m_per_v", self.d31_m_per_v, "m/V")
        check_positive("safe_stress_pa", self.safe_stress_pa, "Pa")

    @property
    def e31_c_per_m2(self) -> float:
        """Stress per field of a beam, d31 Y [C/m2]."""
        return self.d31_m_per_v * self.youngs_modulus_pa


@dataclass(frozen=True)
class BeamMaterial:
    """What the passive part of a beam is made of.

    Parameters
    ----------
    name : str
    youngs_modulus_pa, density_kg_m3, safe_stress_pa : float, > 0
        [Pa], [kg/m3], [Pa] (peak stress that it bears for good).
    source : str

    Raises
    ------
    ArgumentError
        If a number is not finite and above 0.
    """

    name: str
    youngs_modulus_pa: float
    density_kg_m3: float
    safe_stress_pa: float
    source: str = ""

    def __post_init__(self) -> None:
        for name in ("youngs_modulus_pa", "density_kg_m3", "safe_stress_pa"):
            check_positive(name, getattr(self, name))


_ERTURK = "Erturk and Inman, Piezoelectric Energy Harvesting, Wiley 2011, appendix E"
_STRENGTH = "dynamic tensile strength of bulk PZT, 27.6 MPa, makers' data sheets"
_FILM = "film makers' data sheets (d31 23 pC/N, 12 eps0); half the yield strength"
_SPUTTERED = "sputtered films: e31 about -0.6 C/m2, 10.5 eps0; a third of the film strength"

#: Piezoelectric layers by name.
PIEZO_MATERIALS = {
    row[0]: PiezoMaterial(*row)
    for row in (
        # modulus [Pa], density [kg/m3], d31 [m/V], permittivity [F/m], safe stress [Pa], source
        ("PZT-5A", 61.0e9, 7750.0, -171e-12, 13.3e-9, 27.6e6, f"{_ERTURK}; {_STRENGTH}"),
        ("PZT-5H", 60.6e9, 7500.0, -274e-12, 25.55e-9, 27.6e6, f"{_ERTURK}; {_STRENGTH}"),
        ("PVDF", 3.0e9, 1780.0, 23e-12, 1.1e-10, 25e6, _FILM),
        ("AlN", 330e9, 3260.0, -1.9e-12, 9.3e-11, 300e6, _SPUTTERED),
    )
}
#: Passive layers and tip masses by name.
BEAM_MATERIALS = {
    row[0]: BeamMaterial(*row)
    for row in (
        # modulus [Pa], density [kg/m3], safe stress [Pa], source
        ("steel", 200e9, 7850.0, 250e6, "spring steel; half of a fatigue limit near 500 MPa"),
        ("brass", 105e9, 8500.0, 80e6, "half-hard sheet, fatigue limit near 100 MPa"),
        ("aluminium", 70e9, 2700.0, 80e6, "wrought alloys at 1e8 cycles"),
    )
}


@dataclass(frozen=True, kw_only=True)
class ModalDamping:
    """Damping ratio of each mode: z_r = constant + mass_rate/(2 w_r) + stiffness_time w_r/2.

    Parameters
    ----------
    constant : float, 0 to 1
    mass_rate_per_s : float, >= 0
        Of drag in proportion to mass [1/s].
    stiffness_time_s : float, >= 0
        Of strain-rate damping in proportion to stiffness [s].

    Raises
    ------
    ArgumentError
        If a value is out of its range, or all are 0.
    """

    constant: float = 0.0
    mass_rate_per_s: float = 0.0
    stiffness_time_s: float = 0.0

    def __post_init__(self) -> None:
        check_range("constant", self.constant, 0.0, 1.0)
        check_range("mass_rate_per_s", self.mass_rate_per_s, 0.0, 1e6, "1/s")
        check_range("stiffness_time_s", self.stiffness_time_s, 0.0, 1.0, "s")
        if self.constant + self.mass_rate_per_s + self.stiffness_time_s == 0:
            raise ArgumentError("damping: all parts are 0, at least one must be > 0")

    def ratios(self, natural: Real) -> Real:
        """Damping ratios for natural circular frequencies [rad/s]."""
        return (
            self.constant
            + self.mass_rate_per_s / (2 * natural)
            + self.stiffness_time_s * natural / 2
        )


@dataclass(frozen=True, kw_only=True)
class PiezoCantilever(OneLoad):
    """A bonded strip of passive and piezoelectric layers, clamped at one end.

    Parameters
    ----------
    wiring : {"unimorph", "series", "parallel"}
        One piezoelectric layer on top of the passive one, or one on each side of it (a bimorph)
        with the electrodes in series or in parallel.
    piezo : PiezoMaterial
    passive : BeamMaterial
    length_m, width_m : float, > 0
        Free length and width [m].
    passive_thickness_m, piezo_thickness_m : float, > 0
        Thickness of the passive layer and of each piezoelectric one [m].
    tip_mass_kg : float, >= 0
    tip_gyration_m : float, >= 0
        Radius of gyration of the tip mass about the end of the beam [m]; 0 for a point. A cube of
        side s glued on with the middle of a face has s sqrt(5/12), 0.65 s.
    load_ohm : float, > 0
    damping : ModalDamping
    clearance_m : float, > 0
        Room of the tip to either side [m].
    most_tip_mass_kg : float, >= 0
        Largest tip mass there is room for: `retuned` stays below it.
    modes : int, 1 to 5
        Modes that are taken into account.

    Raises
    ------
    ArgumentError
        If a value is out of its range.
    """

    wiring: Wiring
    piezo: PiezoMaterial
    passive: BeamMaterial
    length_m: float
    width_m: float
    passive_thickness_m: float
    piezo_thickness_m: float
    tip_mass_kg: float = 0.0
    tip_gyration_m: float = 0.0
    load_ohm: float = 1e5
    damping: ModalDamping = field(default_factory=lambda: ModalDamping(constant=0.01))
    clearance_m: float = math.inf
    most_tip_mass_kg: float = 0.05
    modes: int = 3

    def __post_init__(self) -> None:
        if self.wiring not in get_args(Wiring):
            raise ArgumentError(
                f"wiring={self.wiring!r} must be one of {', '.join(get_args(Wiring))}"
            )
        for name in ("length_m", "width_m", "passive_thickness_m", "piezo_thickness_m"):
            check_positive(name, getattr(self, name), "m")
        check_range("tip_mass_kg", self.tip_mass_kg, 0.0, 1e3, "kg")
        check_range("tip_gyration_m", self.tip_gyration_m, 0.0, self.length_m, "m")
        check_range("load_ohm", self.load_ohm, 1e-6, 1e15, "ohm")
        check_range("modes", self.modes, 1, 5)
        if not self.clearance_m > 0:
            raise ArgumentError(f"clearance_m={self.clearance_m} m must be > 0")
        check_range("most_tip_mass_kg", self.most_tip_mass_kg, 0.0, 1e3, "kg")
        slender = self.length_m / self.thickness_m
        if slender < 5:
            raise ArgumentError(
                f"length_m={self.length_m:g} m is only {slender:.2g} times the thickness of "
                f"{self.thickness_m:g} m; thin-beam theory needs at least 5 (better 20)"
            )

    @property
    def thickness_m(self) -> float:
        """Of all layers together [m]."""
        return self.passive_thickness_m + self._layers * self.piezo_thickness_m

    @property
    def flexural_stiffness_nm2(self) -> float:
        """YI of the section about its neutral axis [N m2]."""
        hs, hp = self.passive_thickness_m, self.piezo_thickness_m
        ys, yp = self.passive.youngs_modulus_pa, self.piezo.youngs_modulus_pa
        axis = self.neutral_axis_m
        passive = ys * (hs**3 / 12 + hs * (hs / 2 - axis) ** 2)
        upper = yp * (hp**3 / 12 + hp * (hs + hp / 2 - axis) ** 2)
        lower = yp * (hp**3 / 12 + hp * (hp / 2 + axis) ** 2) if self._layers == 2 else 0.0
        return self.width_m * (passive + upper + lower)

    @property
    def neutral_axis_m(self) -> float:
        """Height of the neutral axis above the lower face of the passive layer [m]."""
        hs, hp = self.passive_thickness_m, self.piezo_thickness_m
        if self._layers == 2:
            return hs / 2
        ys, yp = self.passive.youngs_modulus_pa * hs, self.piezo.youngs_modulus_pa * hp
        return (ys * hs / 2 + yp * (hs + hp / 2)) / (ys + yp)

    @property
    def mass_per_length_kg_m(self) -> float:
        """[kg/m]."""
        layers = self._layers * self.piezo.density_kg_m3 * self.piezo_thickness_m
        return self.width_m * (self.passive.density_kg_m3 * self.passive_thickness_m + layers)

    @property
    def beam_mass_kg(self) -> float:
        """Mass of the beam without the tip mass [kg]."""
        return self.mass_per_length_kg_m * self.length_m

    @property
    def capacitance_f(self) -> float:
        """Of the electrodes as wired, at constant strain [F]."""
        area = self.width_m * self.length_m
        one = self.piezo.permittivity_f_per_m * area / self.piezo_thickness_m
        return one * {"unimorph": 1.0, "series": 0.5, "parallel": 2.0}[self.wiring]

    @cached_property
    def natural_rad_s(self) -> Real:
        """Circular natural frequencies, short-circuited [rad/s], shape (modes,)."""
        scale = self.flexural_stiffness_nm2 / (self.mass_per_length_kg_m * self.length_m**4)
        return np.asarray(self._shapes.eigenvalue**2 * math.sqrt(scale), dtype=np.float64)

    @cached_property
    def damping_ratios(self) -> Real:
        """Of each mode, shape (modes,)."""
        return self.damping.ratios(self.natural_rad_s)

    @cached_property
    def coupling(self) -> Real:
        """chi_r [N/V / sqrt(kg)], shape (modes,)."""
        hs, hp = self.passive_thickness_m, self.piezo_thickness_m
        arm = {
            "unimorph": hs + hp / 2 - self.neutral_axis_m,
            "series": (hp + hs) / 2,
            "parallel": hp + hs,
        }[self.wiring]
        slope = self._shapes.tip_slope / (self.length_m * math.sqrt(self.beam_mass_kg))
        return np.asarray(-self.piezo.e31_c_per_m2 * self.width_m * arm * slope)

    @cached_property
    def forcing(self) -> Real:
        """F_r [sqrt(kg)], shape (modes,)."""
        return np.asarray(self._shapes.forcing * math.sqrt(self.beam_mass_kg))

    @property
    def open_circuit_hz(self) -> float:
        """First natural frequency with open electrodes, single mode [Hz]."""
        first = float(self.natural_rad_s[0])
        stiffening = float(self.coupling[0] ** 2) / (self.capacitance_f * first**2)
        return first * math.sqrt(1 + stiffening) / (2 * math.pi)

    @property
    def natural_frequency_hz(self) -> float:
        """First natural frequency, short-circuited [Hz]."""
        return float(self.natural_rad_s[0]) / (2 * math.pi)

    @property
    def resonances_hz(self) -> Real:
        """Natural frequencies of all modes, short-circuited [Hz], shape (modes,)."""
        return np.asarray(self.natural_rad_s / (2 * math.pi))

    @property
    def damping_ratio(self) -> float:
        """Mechanical damping ratio of the first mode."""
        return float(self.damping_ratios[0])

    @property
    def load(self) -> float:
        """Load resistance [ohm]."""
        return self.load_ohm

    @property
    def load_range(self) -> tuple[float, float]:
        """Three decades to either side of 1/(w C) at the first mode [ohm]."""
        middle = 1 / (float(self.natural_rad_s[0]) * self.capacitance_f)
        return middle * 1e-3, middle * 1e3

    @property
    def frequency_range_hz(self) -> tuple[float, float]:
        """First natural frequencies from the largest tip mass to none [Hz]."""
        heaviest = replace(self, tip_mass_kg=self.most_tip_mass_kg)
        bare = replace(self, tip_mass_kg=0.0)
        return heaviest.natural_frequency_hz, bare.natural_frequency_hz

    @property
    def travel_limit_m(self) -> float:
        """Clearance of the tip [m]."""
        return self.clearance_m

    @property
    def stress_limit_pa(self) -> float:
        """Safe stress of the piezoelectric layer [Pa]; stresses are scaled to it."""
        return self.piezo.safe_stress_pa

    def retuned(self, frequency_hz: float) -> PiezoCantilever:
        """Return the same beam with the tip mass that gives a first natural frequency.

        Parameters
        ----------
        frequency_hz : float, > 0
            Short-circuited [Hz]. The radius of gyration of the tip mass stays as it is.

        Raises
        ------
        ArgumentError
            If it lies outside `frequency_range_hz`, with that range.
        """
        check_positive("frequency_hz", frequency_hz, "Hz")
        scale = self.flexural_stiffness_nm2 / (self.mass_per_length_kg_m * self.length_m**4)
        eigenvalue = math.sqrt(2 * math.pi * frequency_hz / math.sqrt(scale))
        bare = float(beam_modes().eigenvalue[0])
        if eigenvalue > bare:
            # the ends of the range are reached to rounding
            mass = 0.0 if eigenvalue <= bare * (1 + 1e-9) else math.nan
        else:
            gyration = self.tip_gyration_m / self.length_m
            mass = mass_ratio_for(eigenvalue, gyration) * self.beam_mass_kg
        if not mass <= self.most_tip_mass_kg * (1 + 1e-9):
            low, high = self.frequency_range_hz
            raise ArgumentError(
                f"frequency_hz={frequency_hz:.6g} Hz cannot be reached by a tip mass from 0 to "
                f"{self.most_tip_mass_kg:g} kg: this beam reaches {low:.6g} to {high:.6g} Hz; "
                "change its length or thickness"
            )
        return replace(self, tip_mass_kg=mass)

    def with_load(self, load: float) -> PiezoCantilever:
        """Return the same with another load resistance [ohm]."""
        other = replace(self, load_ohm=float(load))
        # modes do not depend on the load
        for name in ("natural_rad_s", "damping_ratios", "coupling", "forcing", "_shapes"):
            if name in self.__dict__:
                other.__dict__[name] = self.__dict__[name]
        return other

    def with_damping_ratio(self, ratio: float) -> PiezoCantilever:
        """Return the same with another damping ratio, that of every mode."""
        return replace(self, damping=ModalDamping(constant=float(ratio)))

    def best_load_ohm(self, frequency_hz: float) -> float:
        """Load that takes the most from a single line, 1/|Y(w)| [ohm]."""
        circular = np.array([2 * math.pi * check_positive("frequency_hz", frequency_hz, "Hz")])
        return float(1 / np.abs(self._admittance(circular, self._dynamic(circular)))[0])

    def gains_by_load(self, loads: Real, frequency_hz: Real) -> Gains:
        """Answers at several load resistances, every array but the frequencies (loads, n)."""
        circular = 2 * math.pi * frequency_hz
        dynamic = self._dynamic(circular)
        driven = self._driven(circular, dynamic)
        voltage = driven / (1 / loads[:, None] + self._admittance(circular, dynamic))
        scale = 1 / math.sqrt(self.beam_mass_kg)
        tip = self._shapes.tip * scale
        root = self._shapes.root_curvature * scale / self.length_m**2
        size = np.abs(voltage)
        stress = self._stress(self._moved(root, dynamic, voltage), size)
        power, travel = size**2 / (2 * loads[:, None]), self._moved(tip, dynamic, voltage)
        return Gains(frequency_hz, power, travel, stress, size)

    def power_by_load(self, loads: Real, frequency_hz: Real) -> Real:
        """Power gains at several load resistances, shape (loads, frequencies)."""
        circular = 2 * math.pi * frequency_hz
        dynamic = self._dynamic(circular)
        squared = np.abs(self._driven(circular, dynamic)) ** 2
        taken = np.abs(1 / loads[:, None] + self._admittance(circular, dynamic)) ** 2
        return np.asarray(squared / taken / (2 * loads[:, None]), dtype=np.float64)

    def power_bound_w(self) -> float:
        """F^2/(16 z w1) of the first mode: no load takes more from it [W/(m/s2)^2]."""
        first = float(self.natural_rad_s[0])
        return float(self.forcing[0] ** 2) / (16 * self.damping_ratio * first)

    def to_dict(self) -> dict[str, Any]:
        """Return dimensions and what follows from them in built-in types; no clearance is null."""
        sizes = ("length_m", "width_m", "passive_thickness_m", "piezo_thickness_m")
        names = (*sizes, "tip_mass_kg", "tip_gyration_m", "load_ohm")
        derived = ("natural_frequency_hz", "open_circuit_hz", "damping_ratio", "capacitance_f")
        return {
            "kind": "cantilever",
            "wiring": self.wiring,
            "piezo": self.piezo.name,
            "passive": self.passive.name,
            **{name: getattr(self, name) for name in names},
            "clearance_m": None if math.isinf(self.clearance_m) else self.clearance_m,
            **{name: getattr(self, name) for name in derived},
        }

    @property
    def _layers(self) -> int:
        return 1 if self.wiring == "unimorph" else 2

    @cached_property
    def _shapes(self) -> BeamModes:
        ratio = self.tip_mass_kg / self.beam_mass_kg
        gyration = self.tip_gyration_m / self.length_m
        return beam_modes(ratio, ratio * gyration**2, self.modes)

    def _dynamic(self, circular: Real) -> Complex:
        natural, damping = self.natural_rad_s[:, None], self.damping_ratios[:, None]
        return np.asarray(natural**2 - circular**2 + 2j * damping * natural * circular)

    def _driven(self, circular: Real, dynamic: Complex) -> Complex:
        """Return the current into a short circuit per unit acceleration."""
        shares = ((self.coupling * self.forcing)[:, None] / dynamic).sum(axis=0)
        return np.asarray(-1j * circular * shares)

    def _admittance(self, circular: Real, dynamic: Complex) -> Complex:
        motional = (self.coupling[:, None] ** 2 / dynamic).sum(axis=0)
        return np.asarray(1j * circular * (self.capacitance_f + motional))

    def _moved(self, shape: Real, dynamic: Complex, voltage: Complex) -> Real:
        """Sum the modes, weighted by a value of their shapes: by inertia and by the voltage."""
        by_inertia = ((shape * self.forcing)[:, None] / dynamic).sum(axis=0)
        by_voltage = ((shape * self.coupling)[:, None] / dynamic).sum(axis=0)
        return np.asarray(np.abs(by_inertia + by_voltage * voltage), dtype=np.float64)

    def _stress(self, curvature: Real, voltage: Real) -> Real:
        """Largest stress at the clamp, of both layers, scaled to the piezoelectric limit [Pa]."""
        hs, hp, axis = self.passive_thickness_m, self.piezo_thickness_m, self.neutral_axis_m
        far = hs + hp - axis
        field_share = 0.5 if self.wiring == "series" else 1.0
        # bending and field stresses are added by size: a bound whatever their phase
        layer = self.piezo.youngs_modulus_pa * far * curvature
        layer = layer + abs(self.piezo.e31_c_per_m2) * field_share * voltage / hp
        edge = max(axis, hs - axis)
        plate = self.passive.youngs_modulus_pa * edge * curvature
        return np.maximum(layer, plate * self.piezo.safe_stress_pa / self.passive.safe_stress_pa)
