"""Lines of one mesh or planetary set: what was solved, and the table that is made of it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.arrays import ComplexArray, FloatArray, IntArray
from gearmon.errors import ArgumentError, check_range
from gearmon.gears.mechanics import StageMechanics
from gearmon.signatures.expected.mesh import PosedStage

#: What the phases and amplitudes of all expected lines mean.
AMPLITUDES = "peak; phase of the displacement as a cosine when tooth 1 enters contact"


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshLines:
    """Lines of one mesh.

    Parameters
    ----------
    posed : PosedStage
        What was solved, with its faults.
    period : int
        P, the true period [mesh periods]; 1 where all are alike.
    number : ndarray of int, shape (n,)
        r: frequencies r/P of the mesh frequency.
    carrier : ndarray of int, shape (n,)
        s: turns of the carrier beside them, of sidebands by the planets' pass; else 0.
    displacement : complex ndarray, shape (n,)
        z_r [m] of ``z = z_0 + sum (z_r exp(2 pi i r s/P) + conj)`` with s the mesh phase: peak
        amplitudes are 2 abs(z_r).
    method : str
        How it was solved.
    error : float
        Relative error of the acceleration.
    contact_lost : bool
        Whether teeth part: the linear model ends there.
    mean_m : float
        Mean of z [m].
    """

    posed: PosedStage
    period: int
    number: IntArray
    carrier: IntArray
    displacement: ComplexArray
    method: str
    error: float
    contact_lost: bool
    mean_m: float

    @property
    def mechanics(self) -> StageMechanics:
        """Of its first mesh, with the faults."""
        return self.posed.mechanics

    @property
    def pass_order(self) -> Fraction:
        """Signed order of the carrier over that of the mesh; 0 where no planets pass."""
        return self.posed.pass_order

    @property
    def order(self) -> FloatArray:
        """Frequencies over that of shaft 1, shape (n,)."""
        return np.asarray(self._turns * self.posed.order)

    @property
    def frequency_hz(self) -> FloatArray:
        """Frequencies [Hz], shape (n,)."""
        return np.asarray(self._turns * self.mechanics.mesh_frequency_hz)

    @property
    def _turns(self) -> FloatArray:
        """Frequencies over that of the mesh."""
        return np.asarray(self.number / self.period + self.carrier * float(self.pass_order))

    @property
    def acceleration(self) -> ComplexArray:
        """Acceleration lines [m/s2], shape (n,)."""
        return np.asarray(-((2 * math.pi * self.frequency_hz) ** 2) * self.displacement)

    @property
    def rms(self) -> float:
        """Rms of the acceleration of all lines [m/s2]."""
        return rms(self.acceleration)

    def of_tooth(self, tooth: int = 1) -> MeshLines:
        """Return the lines for another tooth, in order; those that fall together are added.

        Raises
        ------
        ArgumentError
            If the gear has no such tooth.
        """
        check_range("tooth", tooth, 1, self.period)
        z = self.displacement * np.exp(-2j * np.pi * (tooth - 1) / self.period * self.number)
        if not self.pass_order:
            return replace(self, displacement=z)
        steps, parts = self.pass_order.numerator * self.period, self.pass_order.denominator
        place = self.number * parts + self.carrier * steps
        # a mesh line, or one without the carrier, gives its name
        ranked = np.lexsort((self.carrier != 0, self.number % self.period != 0, place))
        first, total = added_up(place[ranked], z[ranked])
        chosen = ranked[first]
        return replace(
            self, number=self.number[chosen], carrier=self.carrier[chosen], displacement=total
        )

    def columns(self, tooth: int = 1) -> dict[str, npt.NDArray[Any]]:
        """Return the columns of a `Signature`; where one gear is marked, for another tooth of it.

        Lines are attributed to the nearest mesh harmonic; `sideband_of` is "?" for those that
        belong to neither gear. Where planets pass there is a column `carrier` more: turns of the
        carrier beside those of the gear.
        """
        own = self.of_tooth(tooth)
        harmonic = np.ceil(own.number / self.period - 0.5).astype(int)
        distance = own.number - harmonic * self.period
        sideband, gear = own._sidebands(distance)
        carrier = own.carrier.copy()
        passing = (distance == 0) & (carrier != 0)
        sideband[passing], carrier[passing], gear[passing] = carrier[passing], 0, "carrier"
        z, angular = own.displacement, 2 * math.pi * own.frequency_hz
        found = {
            "stage": np.full(len(z), self.mechanics.stage),
            "mesh_harmonic": harmonic,
            "sideband": sideband,
            "sideband_of": gear,
            "order": own.order,
            "frequency_hz": own.frequency_hz,
            "displacement_m": 2 * np.abs(z),
            "velocity_ms": 2 * angular * np.abs(z),
            "acceleration_ms2": 2 * angular**2 * np.abs(z),
            "phase_rad": np.angle(z),
        }
        return found | ({"carrier": carrier} if self.pass_order else {})

    def _sidebands(self, distance: IntArray) -> tuple[IntArray, npt.NDArray[np.str_]]:
        """Sideband number and modulating gear of lines by their distance from the mesh harmonic."""
        number = np.zeros(len(self.number), dtype=int)
        name = np.full(len(self.number), "?", dtype="U16")
        for gear, teeth in self.posed.marked.items():
            step = self.period // teeth
            own = (self.number % step == 0) & (name == "?")
            name[own] = gear
            number[own] = distance[own] // step
        name[distance == 0] = ""
        number[distance == 0] = 0
        return number, name

    def header(self) -> dict[str, Any]:
        """Return what holds for all of its lines."""
        own = self.mechanics
        return {
            "stage": own.stage,
            "mesh": own.mesh,
            "mesh_frequency_hz": own.mesh_frequency_hz,
            "mean_stiffness_n_per_m": own.stiffness.mean_n_per_m,
            "stiffness_variation": own.stiffness.variation,
            "contact_ratio": own.stiffness.contact_ratio,
            "natural_frequency_hz": own.natural_frequency_hz,
            "damping_ratio": own.damping_ratio,
            "force_n": own.force_n,
            "overlap_ratio": own.stiffness.overlap_ratio,
            "equivalent_mass_kg": own.equivalent_mass_kg,
            "damping_ns_per_m": own.damping_ns_per_m,
            "period_mesh": self.period,
            "method": self.method,
            "contact_lost": self.contact_lost,
            "mean_deflection_m": self.mean_m,
            "assumptions": list(own.assumptions),
        }


def added_up(place: IntArray, lines: ComplexArray) -> tuple[IntArray, ComplexArray]:
    """Add lines that share a place; return the first of each place, and the sums."""
    _, first, where = np.unique(place, return_index=True, return_inverse=True)
    total = np.zeros(len(first), dtype=np.complex128)
    np.add.at(total, where, lines)
    return first, total


def joined(tables: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """Return tables one under the other; of a column that one lacks it has zeros."""
    found = list(tables)
    names = dict.fromkeys(name for table in found for name in table)
    return {
        name: np.concatenate([t.get(name, np.zeros(len(t["stage"]), dtype=int)) for t in found])
        for name in names
    }


def refuse_no_lines(meshes: Iterable[StageMechanics], max_hz: float | None) -> None:
    """Say that no line is left below the highest frequency."""
    lowest = min(mechanics.mesh_frequency_hz for mechanics in meshes)
    raise ArgumentError(
        f"max_hz={max_hz} Hz lies below the lowest mesh frequency, {lowest:.6g} Hz: no lines"
    )


def rms(lines: ComplexArray | FloatArray) -> float:
    """Rms of a vibration by its one-sided harmonics, without its mean."""
    return math.sqrt(2 * float(np.sum(np.abs(lines) ** 2)))
