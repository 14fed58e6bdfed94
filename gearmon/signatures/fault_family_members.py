"""Members of a family of signatures: what one fault of one gear makes of the lines of its mesh."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gearmon.errors import ArgumentError, check_range
from gearmon.gears.faults import Fault, GearError, parse_fault_or_error
from gearmon.gears.mechanics import StageMechanics

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
IntArray = npt.NDArray[np.int_]


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshLines:
    """Lines of one mesh, spaced by the turn of one of its gears, or by nothing.

    Parameters
    ----------
    mechanics : StageMechanics
        Of this mesh, with its fault.
    mesh_order : float
        Mesh frequency over that of shaft 1.
    gear : str
        Gear whose turn spaces the lines; "" where all mesh periods are alike.
    period : int
        P, mesh periods of its turn; 1 where all are alike.
    displacement : complex ndarray, shape (n,)
        z_1..z_n [m] of ``z = z_0 + sum (z_r exp(2 pi i r s/P) + conj)`` with s the mesh phase, for
        a fault of tooth 1: peak amplitudes are 2 abs(z_r).
    method : str
        "contact": only the contact of the tooth was solved anew; "whole turn".
    error : float
        Relative error of the acceleration: an estimate, or a bound for "whole turn".
    contact_lost : bool
        Whether teeth part: the linear model ends there.
    """

    mechanics: StageMechanics
    mesh_order: float
    gear: str
    period: int
    displacement: ComplexArray
    method: str
    error: float
    contact_lost: bool

    @property
    def number(self) -> IntArray:
        """Harmonics r of the turn, shape (n,)."""
        return np.arange(1, len(self.displacement) + 1)

    @property
    def order(self) -> FloatArray:
        """Frequencies over that of shaft 1, shape (n,)."""
        return np.asarray(self.number * (self.mesh_order / self.period))

    @property
    def frequency_hz(self) -> FloatArray:
        """Frequencies [Hz], shape (n,)."""
        return np.asarray(self.number * (self.mechanics.mesh_frequency_hz / self.period))

    @property
    def acceleration(self) -> ComplexArray:
        """Acceleration lines [m/s2] for a fault of tooth 1, shape (n,)."""
        return np.asarray(-((2 * math.pi * self.frequency_hz) ** 2) * self.displacement)

    def turned(self, tooth: int) -> ComplexArray:
        """Return the factors that turn lines of tooth 1 into those of another, shape (n,).

        Raises
        ------
        ArgumentError
            If the gear has no such tooth.
        """
        check_range("tooth", tooth, 1, self.period)
        return np.asarray(np.exp(-2j * np.pi * (tooth - 1) / self.period * self.number))

    def columns(self, tooth: int = 1) -> dict[str, npt.NDArray[Any]]:
        """Return the columns of a `Signature` for a fault of one tooth."""
        harmonic = np.ceil(self.number / self.period - 0.5).astype(int)
        sideband = self.number - harmonic * self.period
        z, angular = self.displacement * self.turned(tooth), 2 * math.pi * self.frequency_hz
        return {
            "stage": np.full(len(z), self.mechanics.stage),
            "mesh_harmonic": harmonic,
            "sideband": sideband,
            "sideband_of": np.where(sideband == 0, "", self.gear).astype("U16"),
            "order": self.order,
            "frequency_hz": self.frequency_hz,
            "displacement_m": 2 * np.abs(z),
            "velocity_ms": 2 * angular * np.abs(z),
            "acceleration_ms2": 2 * angular**2 * np.abs(z),
            "phase_rad": np.angle(z),
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class FamilyMember:
    """One kind and size of fault of one gear at one operating point.

    Parameters
    ----------
    kind, gear : str
    stage : int
    size : str
        As in ``KIND:STAGE:GEAR:TOOTH:SIZE``.
    loss : float
        Share that the pair of a faulty tooth loses of its stiffness, integrated over its contact.
        0 for errors that take no stiffness.
    operating : int
        Operating point, from 0.
    lines : MeshLines
        Of its mesh, with tooth 1 faulty.
    """

    kind: str
    stage: int
    gear: str
    size: str
    loss: float
    operating: int
    lines: MeshLines

    @property
    def teeth(self) -> int:
        """Teeth for which there are lines of their own; 1 where the whole gear is concerned."""
        return 1 if self.is_whole else self.lines.period

    @property
    def is_whole(self) -> bool:
        """Whether the fault is of the whole gear."""
        fault = self.fault()
        return fault.tooth is None

    def fault(self, tooth: int = 1) -> Fault | GearError:
        """Return the fault of one tooth."""
        return parse_fault_or_error(fault_text(self.kind, self.stage, self.gear, self.size, tooth))

    def response(self, tooth: int = 1) -> tuple[FloatArray, ComplexArray]:
        """Return orders of shaft 1 and acceleration lines [m/s2] for a fault of one tooth.

        Parameters
        ----------
        tooth : int
            From 1; 1 only where the whole gear is concerned.

        Returns
        -------
        order : ndarray, shape (n,)
        acceleration : complex ndarray, shape (n,)
            Half the peak amplitude, with the phase at the entry of tooth 1 of both gears.

        Raises
        ------
        ArgumentError
            If the gear has no such tooth.
        """
        self.check_tooth(tooth)
        return self.lines.order, self.lines.acceleration * self.lines.turned(tooth)

    def check_tooth(self, tooth: int) -> None:
        """Refuse teeth that the gear does not have."""
        if not 1 <= tooth <= self.teeth or tooth != int(tooth):
            why = "it is of the whole gear" if self.is_whole else f"the gear has {self.teeth} teeth"
            raise ArgumentError(
                f"tooth={tooth} of {self.kind} of the {self.gear} must be a whole number in "
                f"[1, {self.teeth}]: {why}"
            )


def fault_text(kind: str, stage: int, gear: str, size: str, tooth: int = 1) -> str:
    """Return ``KIND:STAGE:GEAR:TOOTH:SIZE``, with TOOTH ``all`` where the kind asks for it."""
    place = "all" if kind in ALL_TEETH else str(tooth)
    return f"{kind}:{stage}:{gear}:{place}:{size}"


#: Kinds that concern all teeth of a gear.
ALL_TEETH = ("wear", "eccentricity", "cumulative", "misalignment", "profile")
