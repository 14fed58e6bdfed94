"""Piezoelectric cantilevers: unimorph and bimorph, series and parallel, with a mass at the tip.

Layers are bonded along the whole length, b wide. With mass-normalised modes phi_r:

    unimorph           chi = -e31 b d phi'(L),           C = eps b L/hp
                       with d from the neutral axis to the middle of the layer
    bimorph, series    chi = -e31 b (hp + hs)/2 phi'(L), C = eps b L/(2 hp)
    bimorph, parallel  chi = -e31 b (hp + hs) phi'(L),   C = 2 eps b L/hp
    forcing            F = mu integral of phi + M (phi + x phi')(L),   x from the end to the middle
                       of the tip mass M

The modes are those of Ritz among shapes whose curvatures are Legendre polynomials: they fulfil the
conditions at the clamp, hold the static shapes under any load at the tip, its own weight and a volt
exactly, and the first modes to rounding. So the sum over all of them leaves nothing out.

Linear; thin beam (length over thickness above about 20); perfect bonds and thin electrodes. Erturk
and Inman, J. Vib. Acoust. 130 (2008) 041002; Smart Mater. Struct. 18 (2009) 025009.

Material values are typical ones of makers and textbooks; a real part differs by 5 to 10 %, so
replace them by the data sheet where there is one.
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from importlib import resources
from typing import Any, ClassVar

import numpy as np

from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.harvesting.harvester import Harvester, Modes, Real
from gearmon.machine.fields import Checked, Choice, FieldError, Number, held, within

#: Piezoelectric layers, and the share of the voltage that each of them sees.
WIRINGS = {"unimorph": (1, 1.0), "series": (2, 0.5), "parallel": (2, 1.0)}
#: Shapes that the modes are made of: the first four frequencies come out to 1e-8.
SHAPES = 12
#: Least length over thickness that is taken; 20 and more is better.
THINNEST = 5.0
#: Tungsten: no tip mass is made of anything denser [kg/m3].
DENSEST_KG_M3 = 19_300.0
#: Viscosity of air at 20 degrees C by Sutherland's formula; density at 1 bar by the law of ideal
#: gases with 287 J/(kg K).
AIR_PA_S, AIR_KG_M3 = 1.81e-5, 1.19


@dataclass(frozen=True, kw_only=True)
class BeamMaterial(Checked):
    """What the passive part of a beam is made of.

    Parameters
    ----------
    name : str
    youngs_modulus_pa, density_kg_m3, safe_stress_pa : float, > 0
        [Pa], [kg/m3], [Pa] (peak stress that it bears for good).
    source : str
        Where the numbers come from.

    Raises
    ------
    ArgumentError
        If a number is out of its range.
    """

    name: str
    youngs_modulus_pa: float = within(0, 1e13, "Pa", open_low=True)
    density_kg_m3: float = within(0, 1e5, "kg/m3", open_low=True)
    safe_stress_pa: float = within(0, 1e11, "Pa", open_low=True)
    source: str = ""


@dataclass(frozen=True, kw_only=True)
class PiezoMaterial(BeamMaterial):
    """A thin piezoelectric layer that is poled through its thickness and strained along the beam.

    Parameters
    ----------
    name, youngs_modulus_pa, density_kg_m3, safe_stress_pa, source
        As of a `BeamMaterial`; the modulus at constant field, 1/s11E.
    d31_m_per_v : float, -1e-8 to 1e-8
        Strain along the beam per field through the thickness [m/V].
    permittivity_f_per_m : float, > 0
        eps33 at constant strain, eps33T - d31^2 Y for a beam [F/m].
    """

    # the most that is known, of single crystals, is some 2e-9
    d31_m_per_v: float = within(-1e-8, 1e-8, "m/V", why="1 pC/N is 1e-12 m/V; is it in pC/N?")
    permittivity_f_per_m: float = within(0, 1e-6, "F/m", open_low=True)

    @property
    def e31_c_per_m2(self) -> float:
        """Stress per field of a beam, d31 Y [C/m2]."""
        return self.d31_m_per_v * self.youngs_modulus_pa


@lru_cache(maxsize=1)
def known() -> dict[str, Any]:
    """Return what harvesting knows by name, its file known.toml."""
    text = resources.files("gearmon.harvesting").joinpath("known.toml").read_text("utf-8")
    return tomllib.loads(text)


#: Piezoelectric layers by name.
PIEZO_MATERIALS = {n: PiezoMaterial(name=n, **own) for n, own in known()["piezo"].items()}
#: Passive layers and tip masses by name.
BEAM_MATERIALS = {n: BeamMaterial(name=n, **own) for n, own in known()["passive"].items()}


@lru_cache(maxsize=1)
def _shapes() -> tuple[Real, Real, Real]:
    """Mass matrix of the shapes, their values that matter, and their curvature at the clamp.

    Of a beam of unit length, mass and flexural stiffness. The curvatures are Legendre polynomials
    normalised over the length, so that the stiffness matrix is that of unity. Rows of the values:
    integral over the length, value and slope at the tip.
    """
    from numpy.polynomial.legendre import Legendre, leggauss

    curved = [Legendre.basis(k, (0, 1)) * math.sqrt(2 * k + 1) for k in range(SHAPES)]
    bent = [p.integ(2, lbnd=0) for p in curved]
    nodes, weights = leggauss(SHAPES + 2)
    at = np.array([p((nodes + 1) / 2) for p in bent])
    values = np.array([[p.integ(lbnd=0)(1), p(1), p.deriv()(1)] for p in bent]).T
    return (at * weights / 2) @ at.T, values, np.array([p(0) for p in curved])


@dataclass(frozen=True, kw_only=True)
class PiezoCantilever(Harvester):
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
    passive_thickness_m, piezo_thickness_m : float, > 0 and <= 1
        Thickness of the passive layer and of each piezoelectric one [m].
    tip_mass_kg : float, 0 to `most_tip_mass_kg`
    tip_gyration_m : float, 0 to `length_m`
        Radius of gyration of the tip mass about the end of the beam [m]; 0 for a point. A cube of
        side s glued on with the middle of a face has s sqrt(5/12), 0.65 s.
    tip_block_height_m, tip_block_density_kg_m3 : float, >= 0
        Of a tip mass that is a block as wide as the beam and begins at its end, instead: it is
        longer the heavier it is, and its offset and gyration follow. Height 0 for none.
    load_ohm : float, > 0
    mechanical_damping_ratio, mass_rate_per_s, stiffness_time_s : float, >= 0
        Damping ratio of each mode: that plus mass_rate/(2 w_r) (drag in proportion to mass) plus
        stiffness_time w_r/2 (strain-rate damping). Not all may be 0.
    in_air : bool
        Whether the drag of air is added to the damping: that on spheres as wide as the beam, side
        by side along it, each by itself (the part of the force on an oscillating sphere that is in
        phase with its velocity: Landau and Lifshitz, Fluid Mechanics, 1987, section 24).
    most_tip_mass_kg : float, >= 0
        Largest tip mass there is room for: `retuned` stays below it.
    clearance_m, weight_ms2, restitution, load_kept
        See `Harvester`.

    Raises
    ------
    ArgumentError
        If a value is out of its range.
    """

    kind: ClassVar[str] = "cantilever"
    told: ClassVar[tuple[str, ...]] = (
        *("wiring", "length_m", "width_m", "passive_thickness_m", "piezo_thickness_m"),
        *("tip_mass_kg", "tip_gyration_m", "tip_offset_m", "load_ohm", "natural_frequency_hz"),
        *("open_circuit_hz", "damping_ratio", "capacitance_f"),
    )
    other_damping: ClassVar[tuple[str, ...]] = ("mass_rate_per_s", "stiffness_time_s", "in_air")
    wiring: str = held(Choice(options=tuple(WIRINGS)))
    piezo: PiezoMaterial
    passive: BeamMaterial
    length_m: float = within(0, 1, "m", open_low=True, why="is it in mm?")
    width_m: float = within(0, 1, "m", open_low=True, why="is it in mm?")
    passive_thickness_m: float = within(0, 1, "m", open_low=True, why="is it in mm?")
    piezo_thickness_m: float = within(0, 1, "m", open_low=True, why="is it in mm?")
    tip_mass_kg: float = 0.0
    tip_gyration_m: float = 0.0
    tip_block_height_m: float = within(0, 1, "m", default=0.0)
    tip_block_density_kg_m3: float = within(0, 1e5, "kg/m3", open_low=True, default=7850.0)
    load_ohm: float = within(0, 1e12, "ohm", open_low=True, default=1e5)
    mechanical_damping_ratio: float = within(0, 1, default=0.01)
    mass_rate_per_s: float = within(0, 1e6, "1/s", default=0.0)
    stiffness_time_s: float = within(0, 1, "s", default=0.0)
    in_air: bool = False
    most_tip_mass_kg: float = 0.05

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.length_m < THINNEST * self.thickness_m:
            least = f"{THINNEST:g} times the thickness of {self.thickness_m:g} m"
            reason = f"must be at least {least}: this is thin-beam theory"
            raise FieldError("length_m", reason, self.length_m)
        if self.mechanical_damping_ratio + self.mass_rate_per_s + self.stiffness_time_s == 0:
            raise ArgumentError("damping: all parts are 0, at least one must be > 0")
        check_range("tip_gyration_m", self.tip_gyration_m, 0.0, self.length_m, "m")
        roomy = DENSEST_KG_M3 * (2 * self.length_m) ** 3
        room = Number(low=0, high=roomy, unit="kg", why="a cube of tungsten twice its length")
        room.checked("most_tip_mass_kg", self.most_tip_mass_kg)
        check_range("tip_mass_kg", self.tip_mass_kg, 0.0, self.most_tip_mass_kg * (1 + 1e-9), "kg")

    @property
    def thickness_m(self) -> float:
        """Of all layers together [m]."""
        return self.passive_thickness_m + WIRINGS[self.wiring][0] * self.piezo_thickness_m

    @cached_property
    def _section(self) -> tuple[float, float, float]:
        """Height of the neutral axis [m], YI [N m2], and mass per length [kg/m]."""
        hs, hp = self.passive_thickness_m, self.piezo_thickness_m
        count = 1 + WIRINGS[self.wiring][0]
        parts = [self.passive, self.piezo, self.piezo][:count]
        thick, middle = np.array([[hs, hp, hp], [hs / 2, hs + hp / 2, -hp / 2]])[:, :count]
        told = np.array([[part.youngs_modulus_pa, part.density_kg_m3] for part in parts]).T
        stiff, heavy = told * thick * self.width_m
        axis = float(stiff @ middle / stiff.sum())
        return axis, float(stiff @ (thick**2 / 12 + (middle - axis) ** 2)), float(heavy.sum())

    @property
    def neutral_axis_m(self) -> float:
        """Height of the neutral axis above the lower face of the passive layer [m]."""
        return self._section[0]

    @property
    def flexural_stiffness_nm2(self) -> float:
        """YI of the section about its neutral axis [N m2]."""
        return self._section[1]

    @property
    def mass_per_length_kg_m(self) -> float:
        """[kg/m]."""
        return self._section[2]

    @property
    def beam_mass_kg(self) -> float:
        """Mass of the beam without the tip mass [kg]."""
        return self.mass_per_length_kg_m * self.length_m

    @property
    def capacitance_f(self) -> float:
        """Of the electrodes as wired, at constant strain [F]."""
        layers, volts = WIRINGS[self.wiring]
        one = self.piezo.permittivity_f_per_m * self.length_m * self.width_m
        return one / self.piezo_thickness_m * layers * volts**2

    @property
    def volume_m3(self) -> float:
        """Of the beam and its tip mass, without room to move [m3]."""
        beam = self.length_m * self.width_m * self.thickness_m
        return beam + self.tip_mass_kg / self.tip_block_density_kg_m3

    @property
    def tip_offset_m(self) -> float:
        """Distance of the middle of the tip mass beyond the end of the beam [m]."""
        return float(self._inertia(self.tip_mass_kg / self.beam_mass_kg)[0, 1]) * self.length_m

    @cached_property
    def modes(self) -> Modes:
        """Modes of Ritz; u is the voltage, and the stresses are those at the clamp."""
        length, ratio = self.length_m, self.tip_mass_kg / self.beam_mass_kg
        own, values, bent = _shapes()
        body = ratio * self._inertia(ratio)
        squares, shares = np.linalg.eigh(own + values[1:].T @ body @ values[1:])
        # the heaviest swings slowest; of unit modal mass
        shares = (shares / np.sqrt(squares))[:, ::-1]
        mean, tip, slope = values @ shares
        root_mass = math.sqrt(self.beam_mass_kg)
        pulled = mean + body[0] @ (tip, slope)
        natural = math.sqrt(self._scale) / np.sqrt(squares[::-1])
        hs, hp, axis = self.passive_thickness_m, self.piezo_thickness_m, self.neutral_axis_m
        layers, volts = WIRINGS[self.wiring]
        # stress of a layer by a volt, and the bending moment of all: with the arm to their middle
        by_volt = self.piezo.e31_c_per_m2 * volts / hp
        moment = -by_volt * hp * self.width_m * (hs + hp / 2 - axis) * layers
        coupling = moment / length / root_mass * slope
        # of the outer fibres of both layers, scaled to the piezoelectric limit
        curved = bent @ shares / length**2 / root_mass
        layer = self.piezo.youngs_modulus_pa * (hs + hp - axis)
        plate = self.passive.youngs_modulus_pa * max(axis, hs - axis)
        plate *= self.piezo.safe_stress_pa / self.passive.safe_stress_pa
        return Modes(
            natural_rad_s=natural,
            damping_ratio=self._ratios(natural, (shares * (own @ shares)).sum(axis=0)),
            forcing=root_mass * pulled,
            rows=np.array([coupling, tip / root_mass, layer * curved, plate * curved]),
            direct=np.array([0.0, 0.0, -by_volt, 0.0]),
            store=self.capacitance_f,
        )

    @property
    def natural_frequency_hz(self) -> float:
        """Frequency of the first mode, short-circuited [Hz]."""
        return float(self.modes.natural_rad_s[0]) / (2 * math.pi)

    @property
    def open_circuit_hz(self) -> float:
        """First natural frequency with open electrodes [Hz]."""
        # an open circuit adds the stiffness chi chi^T/C
        modes = self.modes
        chi = modes.rows[0]
        stiff = np.diag(modes.natural_rad_s**2) + np.outer(chi, chi) / modes.store
        return math.sqrt(float(np.linalg.eigvalsh(stiff)[0])) / (2 * math.pi)

    @property
    def usual_loads(self) -> tuple[float, float]:
        """Three decades to either side of 1/(w C) at the first mode [ohm]."""
        middle = 1 / (float(self.modes.natural_rad_s[0]) * self.capacitance_f)
        return middle * 1e-3, middle * 1e3

    @cached_property
    def frequency_range_hz(self) -> tuple[float, float]:
        """First natural frequencies from the largest tip mass to none [Hz]."""
        low, high = (replace(self, tip_mass_kg=m) for m in (self.most_tip_mass_kg, 0.0))
        return low.natural_frequency_hz, high.natural_frequency_hz

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
        from scipy.optimize import brentq

        own, values, _ = _shapes()
        bare = float(np.linalg.eigvalsh(own)[-1])
        wanted = self._scale / (2 * math.pi * check_positive("frequency_hz", frequency_hz)) ** 2
        # what the bare beam answers to a body at its tip: value and slope, to a force and a moment
        answer = values[1:] @ np.linalg.solve(wanted * np.eye(SHAPES) - own, values[1:].T)

        def left(ratio: float) -> float:
            return float(np.linalg.det(np.eye(2) - ratio * self._inertia(ratio) @ answer))

        # the end of the range is reached to rounding; beyond it only a higher mode would answer
        ratio = 0.0 if wanted > bare * (1 - 1e-9) else math.nan
        if wanted > bare and answer[0, 0] > 0:
            # a point of this mass has that root, so that a body of its mass has a lower one
            most = 1 / float(answer[0, 0])
            ratio = most if left(most) >= 0 else brentq(left, 0.0, most, xtol=1e-15 * most)
        mass = ratio * self.beam_mass_kg
        if not mass <= self.most_tip_mass_kg * (1 + 1e-9):
            low, high = self.frequency_range_hz
            raise ArgumentError(
                f"frequency_hz={frequency_hz:.6g} Hz cannot be reached by a tip mass from 0 to "
                f"{self.most_tip_mass_kg:g} kg: this beam reaches {low:.6g} to {high:.6g} Hz; "
                "change its length or thickness"
            )
        return replace(self, tip_mass_kg=mass)

    def best_load_ohm(self, frequency_hz: float) -> float:
        """Load that takes the most from a single line, 1/|Y(w)| [ohm]."""
        circular = np.array([2 * math.pi * check_positive("frequency_hz", frequency_hz, "Hz")])
        by_volt = self.modes.compliance(circular, 1)[1][0, 0]
        return float(1 / (circular[0] * abs(self.capacitance_f + by_volt)))

    def to_dict(self) -> dict[str, Any]:
        """Return dimensions and what follows from them in built-in types; no clearance is null."""
        return super().to_dict() | {"piezo": self.piezo.name, "passive": self.passive.name}

    @property
    def _scale(self) -> float:
        """Squared circular frequency that the unit beam's 1 stands for [1/s2]."""
        return self.flexural_stiffness_nm2 / (self.mass_per_length_kg_m * self.length_m**4)

    def _inertia(self, ratio: float) -> Real:
        """Inertia of a tip mass of so many times the beam's against value and slope at the end.

        Over the mass, and lengths over that of the beam: 1, the offset of its middle and the square
        of its radius of gyration about the end.
        """
        offset, square, height = 0.0, self.tip_gyration_m**2, self.tip_block_height_m
        if height > 0:
            section = self.tip_block_density_kg_m3 * self.width_m * height
            offset = ratio * self.beam_mass_kg / section / 2
            square = 4 * offset**2 / 3 + height**2 / 12
        offset, square = offset / self.length_m, square / self.length_m**2
        return np.array([[1.0, offset], [offset, square]])

    def _ratios(self, natural: Real, in_beam: Real) -> Real:
        """Damping ratios of the modes, each with the share of its mass that is the beam's own."""
        rate = self.mass_rate_per_s / natural + self.stiffness_time_s * natural
        found = self.mechanical_damping_ratio + rate / 2
        if self.in_air:
            viscous = 3 * math.pi * AIR_PA_S * self.width_m
            layer = 0.75 * math.pi * self.width_m**2 * np.sqrt(2 * AIR_KG_M3 * AIR_PA_S * natural)
            drag = (viscous + layer) / self.width_m * in_beam
            found = found + drag / (2 * self.mass_per_length_kg_m * natural)
        return np.asarray(found)
