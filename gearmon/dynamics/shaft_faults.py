"""What faults on shafts change in the mesh stiffness, and how they go together.

The stiffness of a mesh with faults is phi = phi_0 + sum delta_f over the mean: phi_0 repeats with
the mesh, delta_f with a turn of P_f meshes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gearmon.dynamics.fourier import Complex
from gearmon.dynamics.hill import HillProblem, frozen_vector
from gearmon.dynamics.sweep_bounds import Swing, swing_of
from gearmon.errors import ArgumentError, check_range


@dataclass(frozen=True, eq=False)
class ShaftFault:
    """What the faults of one shaft change in the mesh stiffness.

    Parameters
    ----------
    meshes : int
        P >= 2, meshes (teeth) in a turn of the shaft.
    stiffness_harmonics : complex array, shape (K,)
        d_1..d_K of delta over the turn, relative to the mean mesh stiffness; zero at multiples of
        P, which belong to the mesh.

    Raises
    ------
    ArgumentError
        If a value is out of its range or a multiple of P is not zero.
    """

    meshes: int
    stiffness_harmonics: Complex

    def __post_init__(self) -> None:
        check_range("meshes", self.meshes, 2, 1_000_000)
        harmonics = frozen_vector("stiffness_harmonics", self.stiffness_harmonics)
        object.__setattr__(self, "stiffness_harmonics", harmonics)
        if harmonics[self.meshes - 1 :: self.meshes].any():
            raise ArgumentError(
                f"stiffness_harmonics: multiples of meshes={self.meshes} must be 0; add them to "
                "the mesh, as split_fault does"
            )

    def scaled(self, factor: float) -> ShaftFault:
        """Return the fault `factor` times as large."""
        fault = ShaftFault(self.meshes, factor * self.stiffness_harmonics)
        # the bounds scale as well, and cost more than all the rest
        fault.__dict__["swing"] = self.swing.scaled(abs(factor))
        return fault

    @cached_property
    def swing(self) -> Swing:
        """Bounds of delta."""
        return swing_of(self.stiffness_harmonics)


def split_fault(turn: HillProblem, meshes: int) -> tuple[HillProblem, ShaftFault]:
    """Return the even mesh and the fault of a problem given over a turn of P = `meshes` meshes.

    Raises
    ------
    ArgumentError
        If forces have other harmonics than multiples of P.
    """
    check_range("meshes", meshes, 2, 1_000_000)
    forces = turn.force_harmonics_n
    if np.delete(forces, np.arange(meshes - 1, len(forces), meshes)).any():
        raise ArgumentError(f"force_harmonics_n: only multiples of meshes={meshes} may be given")
    mesh = replace(
        turn,
        stiffness_harmonics=turn.stiffness_harmonics[meshes - 1 :: meshes],
        period_s=turn.period_s / meshes,
        force_harmonics_n=forces[meshes - 1 :: meshes],
    )
    rest = turn.stiffness_harmonics.copy()
    rest[meshes - 1 :: meshes] = 0
    return mesh, ShaftFault(meshes, rest)


def joined(mesh: HillProblem, faults: Sequence[ShaftFault]) -> HillProblem:
    """Return the problem over the common turn of all faults.

    Parameters
    ----------
    mesh : HillProblem
        Over one mesh period.
    faults : sequence of ShaftFault
        Any number.
    """
    turn = math.lcm(*(fault.meshes for fault in faults))
    parts = [(mesh.stiffness_harmonics, turn)]
    parts += [(fault.stiffness_harmonics, turn // fault.meshes) for fault in faults]
    total = np.zeros(max(len(half) * step for half, step in parts), dtype=complex)
    for half, step in parts:
        total[step - 1 : len(half) * step : step] += half
    forces = np.zeros(len(mesh.force_harmonics_n) * turn, dtype=complex)
    forces[turn - 1 :: turn] = mesh.force_harmonics_n
    return replace(
        mesh,
        stiffness_harmonics=total,
        period_s=mesh.period_s * turn,
        force_harmonics_n=forces,
    )


def added_up(faults: Sequence[ShaftFault]) -> tuple[ShaftFault, ...]:
    """Faults on turns of equal length added up."""
    if not faults:
        raise ArgumentError("faults: none given, at least one is needed")
    sums: dict[int, Complex] = {}
    for fault in faults:
        old, new = sums.get(fault.meshes, np.zeros(0, dtype=complex)), fault.stiffness_harmonics
        total = np.zeros(max(len(old), len(new)), dtype=complex)
        total[: len(old)] = old
        total[: len(new)] += new
        sums[fault.meshes] = total
    return tuple(ShaftFault(meshes, total) for meshes, total in sums.items())
