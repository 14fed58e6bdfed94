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

The first few modes stand in these sums as they are; the sum of the others changes little with w, so
that their static answers stand for them, the difference of the whole static answer, known in closed
form, and that of the modes kept.

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
from gearmon.harvesting.harvester import OneLoad, Oscillator

Complex = npt.NDArray[np.complex128]
Real = npt.NDArray[np.float64]
Wiring = Literal["unimorph", "series", "parallel"]

#: Least length over thickness that is taken; 20 and more is better.
THINNEST = 5.0
#: Tungsten: no tip mass is made of anything denser [kg/m3].
DENSEST_KG_M3 = 19_300.0
#: Viscosity of air at 20 degrees C by Sutherland's formula; density at 1 bar by the law of ideal
#: gases with 287 J/(kg K).
AIR_PA_S, AIR_KG_M3 = 1.81e-5, 1.19


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
        # the most that is known, of single crystals, is some 2e-9
        if abs(check_finite("d31_m_per_v", self.d31_m_per_v, "m/V")) > 1e-8:
            raise ArgumentError(
                f"d31_m_per_v={self.d31_m_per_v:g} m/V must lie in [-1e-08, 1e-08]; "
                "is it in pC/N? 1 pC/N is 1e-12 m/V"
            )
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
        Damping ratio that all modes have.
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
class TipBlock:
    """A block as wide as the beam that begins at its end, so that it is longer the heavier it is.

    Parameters
    ----------
    density_kg_m3, height_m : float, > 0
        Of its material [kg/m3]; across the beam's plane [m].

    Raises
    ------
    ArgumentError
        If a value is not finite and above 0.
    """

    density_kg_m3: float
    height_m: float

    def __post_init__(self) -> None:
        check_positive("density_kg_m3", self.density_kg_m3, "kg/m3")
        check_positive("height_m", self.height_m, "m")


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
    length_m, width_m : float, > 0 and <= 1
        Free length and width [m].
    passive_thickness_m, piezo_thickness_m : float, > 0
        Thickness of the passive layer and of each piezoelectric one [m].
    tip_mass_kg : float, 0 to `most_tip_mass_kg`
    tip_gyration_m : float, >= 0
        Radius of gyration of the tip mass about the end of the beam [m]; 0 for a point. A cube of
        side s glued on with the middle of a face has s sqrt(5/12), 0.65 s.
    tip_block : TipBlock, optional
        Shape of the tip mass, from which its offset and gyration follow, instead.
    load_ohm : float, > 0
    damping : ModalDamping
    in_air : bool
        Whether the drag of air is added to the damping: that on oscillating spheres as wide as the
        beam, side by side (Hosaka, Itao and Kuroda, Sensors and Actuators A 49 (1995) 87-95).
    most_tip_mass_kg : float, >= 0
        Largest tip mass there is room for: `retuned` stays below it.
    clearance_m, weight_ms2, restitution, load_kept
        See `OneLoad`.
    modes : int, 1 to 12
        Modes that are taken into account as such; all others count with their stiffness, which is
        known in closed form from the beam under a static load.

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
    tip_block: TipBlock | None = None
    load_ohm: float = 1e5
    damping: ModalDamping = field(default_factory=lambda: ModalDamping(constant=0.01))
    in_air: bool = False
    most_tip_mass_kg: float = 0.05
    modes: int = 4

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.wiring not in get_args(Wiring):
            raise ArgumentError(
                f"wiring={self.wiring!r} must be one of {', '.join(get_args(Wiring))}"
            )
        for name in ("length_m", "width_m", "passive_thickness_m", "piezo_thickness_m"):
            if check_positive(name, getattr(self, name), "m") > 1:
                raise ArgumentError(
                    f"{name}={getattr(self, name):g} m must not exceed 1 m; is it in millimetres?"
                )
        if self.length_m < THINNEST * self.thickness_m:
            raise ArgumentError(
                f"length_m={self.length_m:g} m must be at least {THINNEST:g} times the thickness "
                f"of {self.thickness_m:g} m: this is thin-beam theory"
            )
        check_positive("load_ohm", self.load_ohm, "ohm")
        check_range("tip_gyration_m", self.tip_gyration_m, 0.0, self.length_m, "m")
        if self.modes not in range(1, 13):
            raise ArgumentError(f"modes={self.modes} must be a whole number in [1, 12]")
        # of the densest common material, a cube twice as long as the beam
        roomy = DENSEST_KG_M3 * (2 * self.length_m) ** 3
        check_range("most_tip_mass_kg", self.most_tip_mass_kg, 0.0, roomy, "kg")
        check_range("tip_mass_kg", self.tip_mass_kg, 0.0, self.most_tip_mass_kg * (1 + 1e-9), "kg")

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
        natural = self.natural_rad_s
        ratios = self.damping.ratios(natural)
        if not self.in_air:
            return ratios
        viscous = 3 * math.pi * AIR_PA_S * self.width_m
        layer = 0.75 * math.pi * self.width_m**2 * np.sqrt(2 * AIR_KG_M3 * AIR_PA_S * natural)
        drag = (viscous + layer) / self.width_m * self._shapes.in_beam
        return ratios + drag / (2 * self.mass_per_length_kg_m * natural)

    @cached_property
    def coupling(self) -> Real:
        """chi_r [N/V / sqrt(kg)], shape (modes,)."""
        slope = self._shapes.tip_slope / (self.length_m * math.sqrt(self.beam_mass_kg))
        return np.asarray(self._moment_per_volt * slope)

    @cached_property
    def forcing(self) -> Real:
        """F_r [sqrt(kg)], shape (modes,)."""
        return np.asarray(self._shapes.forcing * math.sqrt(self.beam_mass_kg))

    @property
    def tip_offset_m(self) -> float:
        """Distance of the middle of the tip mass beyond the end of the beam [m]."""
        return self._body(self.tip_mass_kg)[0]

    @property
    def natural_frequency_hz(self) -> float:
        """Frequency of the first mode, short-circuited [Hz]."""
        return float(self.natural_rad_s[0]) / (2 * math.pi)

    @property
    def open_circuit_hz(self) -> float:
        """First natural frequency with open electrodes, all modes counted [Hz]."""
        from scipy.optimize import brentq

        first = float(self.natural_rad_s[0])
        if not self.coupling[0]:
            return first / (2 * math.pi)
        higher = float(self.natural_rad_s[1]) if self.modes > 1 else 10 * first
        capacity = self.capacitance_f + float(self._rest[0, 1])

        def charge(circular: float) -> float:
            modes = self.coupling**2 / (self.natural_rad_s**2 - circular**2)
            return float(capacity + modes.sum())

        found = brentq(charge, first * (1 + 1e-12), higher * (1 - 1e-12))
        return float(found) / (2 * math.pi)

    @property
    def damping_ratio(self) -> float:
        """Mechanical damping ratio of the first mode."""
        return float(self.damping_ratios[0])

    @property
    def load(self) -> float:
        """Load resistance [ohm]."""
        return self.load_ohm

    @property
    def usual_loads(self) -> tuple[float, float]:
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
    def stress_limit_pa(self) -> float:
        """Safe stress of the piezoelectric layer [Pa]; stresses are scaled to it."""
        return self.piezo.safe_stress_pa

    def retuned(self, frequency_hz: float) -> PiezoCantilever:
        """Return the same beam with the tip mass that gives a first natural frequency.

        Parameters
        ----------
        frequency_hz : float, > 0
            Short-circuited [Hz]. The shape of the tip mass stays as it is.

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
            mass = mass_ratio_for(eigenvalue, moments_of=self._moments) * self.beam_mass_kg
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
        known = self.__dict__.keys() - self.__dataclass_fields__
        other.__dict__.update({name: self.__dict__[name] for name in known})
        return other

    def with_damping_ratio(self, ratio: float) -> PiezoCantilever:
        """Return the same with another damping ratio, that of every mode."""
        return replace(self, damping=ModalDamping(constant=float(ratio)), in_air=False)

    def best_load_ohm(self, frequency_hz: float) -> float:
        """Load that takes the most from a single line, 1/|Y(w)| [ohm]."""
        circular = np.array([2 * math.pi * check_positive("frequency_hz", frequency_hz, "Hz")])
        by_volt = self._compliance(circular, 1)[1][0]
        return float(1 / np.abs(self._admittance(circular, by_volt))[0])

    def root_power(self, loads: Real, frequency_hz: Real) -> Complex:
        """Voltage over the root of the load [W^(1/2)/(m/s2)], shape (loads, n).

        Parameters
        ----------
        loads : ndarray of float, shape (loads,)
            Load resistances [ohm].
        frequency_hz : ndarray of float, shape (n,)
            Of the base [Hz].
        """
        circular = 2 * math.pi * frequency_hz
        by_push, by_volt = (answer[0] for answer in self._compliance(circular, 1))
        taken = 1 / loads[:, None] + self._admittance(circular, by_volt)
        return np.asarray(-1j * circular * by_push / (taken * np.sqrt(loads[:, None])))

    def transfer(self, loads: Real, frequency_hz: Real) -> Complex:
        """Answers per unit acceleration of the base, shape (4, loads, n), see `OUTPUTS`.

        Parameters
        ----------
        loads : ndarray of float, shape (loads,)
            Load resistances [ohm].
        frequency_hz : ndarray of float, shape (n,)
            Of the base [Hz].
        """
        root_power = self.root_power(loads, frequency_hz)
        voltage = root_power * np.sqrt(loads[:, None])
        by_push, by_volt = self._compliance(2 * math.pi * frequency_hz, 3)
        travel, curvature = (-by_push[row] - by_volt[row] * voltage for row in (1, 2))
        return np.array([root_power, travel, *self._stresses(curvature, voltage)])

    def power_bound_w(self) -> float:
        """Sum over modes of F^2/(16 z w): no load takes more, at no frequency [W/(m/s2)^2].

        The power available to any load is |D|^2/(8 Re Y); by the inequality of Cauchy and Schwarz
        it does not exceed the sum of what the modes would give one by one. Modes left out have
        what is left of the mass together, and the damping of the last.
        """
        damped = 16 * self.damping_ratios * self.natural_rad_s
        left = self.beam_mass_kg + self.tip_mass_kg - float((self.forcing**2).sum())
        return float((self.forcing**2 / damped).sum() + max(0.0, left) / damped[-1])

    def single_mode(self) -> Oscillator:
        """First mode with its circuit, for what is not linear."""
        scale = float(self._shapes.tip[0]) / math.sqrt(self.beam_mass_kg)
        return Oscillator(
            natural_rad_s=float(self.natural_rad_s[0]),
            damping_ratio=self.damping_ratio,
            push=float(self.forcing[0]) * scale,
            back=float(self.coupling[0]) * scale,
            drive=float(self.coupling[0]) / scale,
            store=self.capacitance_f + float(self._rest[0, 1]),
            leak=1 / self.load_ohm,
            worth=1 / self.load_ohm,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return dimensions and what follows from them in built-in types; no clearance is null."""
        sizes = ("length_m", "width_m", "passive_thickness_m", "piezo_thickness_m")
        names = (*sizes, "tip_mass_kg", "tip_gyration_m", "tip_offset_m", "load_ohm")
        derived = ("natural_frequency_hz", "open_circuit_hz", "damping_ratio", "capacitance_f")
        return {
            "kind": "cantilever",
            "wiring": self.wiring,
            "piezo": self.piezo.name,
            "passive": self.passive.name,
            "clearance_m": None if math.isinf(self.clearance_m) else self.clearance_m,
            **{name: getattr(self, name) for name in (*names, *derived)},
        }

    @property
    def _layers(self) -> int:
        return 1 if self.wiring == "unimorph" else 2

    @property
    def _moment_per_volt(self) -> float:
        """Bending moment that a volt makes [N m/V]."""
        hs, hp = self.passive_thickness_m, self.piezo_thickness_m
        arm = {
            "unimorph": hs + hp / 2 - self.neutral_axis_m,
            "series": (hp + hs) / 2,
            "parallel": hp + hs,
        }[self.wiring]
        return -self.piezo.e31_c_per_m2 * self.width_m * arm

    def _body(self, mass: float) -> tuple[float, float]:
        """Offset of the middle and radius of gyration about the end of a tip mass [m]."""
        if self.tip_block is None:
            return 0.0, self.tip_gyration_m
        height = self.tip_block.height_m
        long = mass / (self.tip_block.density_kg_m3 * self.width_m * height)
        return long / 2, math.sqrt(long**2 / 3 + height**2 / 12)

    def _moments(self, ratio: float) -> tuple[float, float]:
        """First and second moment ratios of a tip mass ratio, as `beam` has them."""
        offset, gyration = self._body(ratio * self.beam_mass_kg)
        return ratio * offset / self.length_m, ratio * (gyration / self.length_m) ** 2

    @cached_property
    def _shapes(self) -> BeamModes:
        ratio = self.tip_mass_kg / self.beam_mass_kg
        moment, inertia = self._moments(ratio)
        return beam_modes(ratio, inertia, self.modes, moment)

    @cached_property
    def _rows(self) -> Real:
        """Charge per volt, tip and root curvature of the modes, shape (3, modes)."""
        scale = 1 / math.sqrt(self.beam_mass_kg)
        bent = scale * self._shapes.root_curvature / self.length_m**2
        return np.array([self.coupling, scale * self._shapes.tip, bent])

    @cached_property
    def _rest(self) -> Real:
        """What the modes left out answer: all modes at rest, less those that are kept.

        Rows as in `_rows`, by an acceleration and by a volt. At rest the beam bends under its own
        weight, that at its tip and the moment of the volt. Shape (3, 2).
        """
        length, tip, moment = self.length_m, self.tip_mass_kg, self._moment_per_volt
        own, offset = self.mass_per_length_kg_m, self.tip_offset_m
        slope = own * length**3 / 6 + tip * length**2 / 2 + tip * offset * length
        sag = own * length**4 / 8 + tip * length**3 / 3 + tip * offset * length**2 / 2
        root = own * length**2 / 2 + tip * (length + offset)
        whole = np.array(
            [[moment * slope, moment**2 * length], [sag, moment * length**2 / 2], [root, moment]]
        )
        kept = (self._rows / self.natural_rad_s**2) @ np.array([self.forcing, self.coupling]).T
        return np.asarray(whole / self.flexural_stiffness_nm2 - kept)

    def _compliance(self, circular: Real, rows: int) -> tuple[Complex, Complex]:
        """First answers of the mechanics to an acceleration and to a volt, each (rows, n)."""
        natural, damping = self.natural_rad_s[:, None], self.damping_ratios[:, None]
        mode: Complex = np.asarray(
            1 / (natural**2 - circular**2 + 2j * damping * natural * circular)
        )
        shapes, rest = self._rows[:rows], self._rest[:rows, :, None]
        by_push = (shapes * self.forcing) @ mode + rest[:, 0]
        by_volt = (shapes * self.coupling) @ mode + rest[:, 1]
        return np.asarray(by_push), np.asarray(by_volt)

    def _admittance(self, circular: Real, by_volt: Complex) -> Complex:
        return np.asarray(1j * circular * (self.capacitance_f + by_volt))

    def _stresses(self, curvature: Complex, voltage: Complex) -> tuple[Complex, Complex]:
        """At the clamp, of the outer fibres of both layers, scaled to the piezoelectric limit."""
        hs, hp, axis = self.passive_thickness_m, self.piezo_thickness_m, self.neutral_axis_m
        field_share = 0.5 if self.wiring == "series" else 1.0
        layer = self.piezo.youngs_modulus_pa * (hs + hp - axis) * curvature
        layer = layer - self.piezo.e31_c_per_m2 * field_share * voltage / hp
        plate = self.passive.youngs_modulus_pa * max(axis, hs - axis) * curvature
        return layer, plate * self.piezo.safe_stress_pa / self.passive.safe_stress_pa
