"""Solves the meshes of a family of signatures, group by group."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from gearmon.gears.faults import parse_fault_or_error
from gearmon.gears.kinematics import kinematics
from gearmon.gears.mechanics import StageMechanics
from gearmon.machine import Machine
from gearmon.signatures.fault_family_members import (
    ComplexArray,
    FamilyMember,
    MeshLines,
    fault_text,
)
from gearmon.signatures.fault_family_mesh import (
    Turn,
    common_grid,
    default_limit_hz,
    operating_point,
    pair_loss,
    solved,
    turn_of,
)
from gearmon.signatures.fault_family_motion import Deviations
from gearmon.signatures.fault_family_turns import solved_turn, turn_grid, turn_lines

#: How often panels are halved at most.
MOST_HALVINGS = 4


class Solver:
    """Solves healthy meshes and those with faults of one machine.

    Parameters
    ----------
    machine : Machine
    max_hz : float or None
        Highest frequency [Hz].
    tolerance : float
        Relative error of what a fault adds.
    form : str
        Of the stiffness.
    """

    def __init__(self, machine: Machine, max_hz: float | None, tolerance: float, form: str) -> None:
        self.machine, self.max_hz, self.tolerance, self.form = machine, max_hz, tolerance, form
        self.train = kinematics(machine)
        self._even: dict[tuple[int, int, int], Turn] = {}

    def healthy(self, operating: int, stage: int, mesh: int) -> MeshLines:
        """Solve a healthy mesh."""
        turn = self._healthy_turn(operating, stage, mesh)
        return self._alone(turn, self._limit(turn.mechanics))

    def members(
        self, operating: int, stage: int, gear: str, mesh: int, kind: str, sizes: Sequence[str]
    ) -> list[FamilyMember]:
        """Solve one kind of fault of one gear at several sizes.

        Raises
        ------
        ArgumentError
            If a size does not fit the gear, or the machine lacks data for it.
        """
        point = operating_point(self.machine, operating)
        faults = [parse_fault_or_error(fault_text(kind, stage, gear, size)) for size in sizes]
        even = self._healthy_turn(operating, stage, mesh)
        turns = [turn_of(self.machine, stage, point, f, self.form, mesh) for f in faults]
        limit = self._limit(even.mechanics)
        if not all(turn.is_local for turn in turns):
            found = [self._whole(turn, limit, gear) for turn in turns]
        elif all(turn.period == 1 for turn in turns):
            found = [self._alone(turn, limit) for turn in turns]
        else:
            found = self._contacts(even, turns, limit, gear)
        return [
            FamilyMember(
                kind=kind,
                stage=stage,
                gear=gear,
                size=size,
                loss=self._loss(turn, even),
                operating=operating,
                lines=lines,
            )
            for size, turn, lines in zip(sizes, turns, found, strict=True)
        ]

    def _healthy_turn(self, operating: int, stage: int, mesh: int) -> Turn:
        key = operating, stage, mesh
        if key not in self._even:
            point = operating_point(self.machine, operating)
            self._even[key] = turn_of(self.machine, stage, point, None, self.form, mesh)
        return self._even[key]

    def _limit(self, mechanics: StageMechanics) -> float:
        return default_limit_hz(mechanics) if self.max_hz is None else self.max_hz

    @staticmethod
    def _loss(turn: Turn, even: Turn) -> float:
        # modulated stiffness loses nothing: its mean wanders a little
        if turn.mechanics.stiffness.modulations or not _takes_stiffness(turn, even):
            return 0.0
        return pair_loss(turn, even.mechanics)

    def _alone(self, turn: Turn, limit: float) -> MeshLines:
        """Solve a mesh whose periods are all alike."""
        grid = common_grid([turn], limit)
        mesh = turn.even(grid)
        for _ in range(MOST_HALVINGS):
            if mesh.unresolved <= self.tolerance:
                break
            grid = grid.halved()
            mesh = turn.even(grid)
        count = _count(turn.mechanics, limit, 1)
        return self._lines(
            turn, "", 1, mesh.lines(count), "contact", mesh.unresolved, mesh.least_force <= 0
        )

    def _contacts(
        self, even: Turn, turns: Sequence[Turn], limit: float, gear: str
    ) -> list[MeshLines]:
        """Solve the contacts of a faulty tooth of several sizes."""
        period = max(turn.period for turn in turns)
        count = _count(even.mechanics, limit, period)
        found = self._resolved(even, turns, period, limit)
        lines = found.lines(count)
        lines[:, period - 1 :: period] += found.mesh.lines(count // period)
        return [
            self._lines(turn, gear, period, half, "contact", float(error), bool(least <= 0))
            for turn, half, error, least in zip(
                turns,
                lines,
                np.maximum(found.unresolved, found.mesh.unresolved),
                found.least_force,
                strict=True,
            )
        ]

    def _resolved(self, even: Turn, turns: Sequence[Turn], period: int, limit: float) -> Deviations:
        """Solve on panels that are halved until nothing is left unresolved."""
        grid = common_grid([even, *turns], limit)
        found = solved(turns, period, even.even(grid))
        for _ in range(MOST_HALVINGS):
            if max(found.unresolved.max(), found.mesh.unresolved) <= self.tolerance:
                break
            grid = grid.halved()
            found = solved(turns, period, even.even(grid))
        return found

    def _whole(self, turn: Turn, limit: float, gear: str) -> MeshLines:
        """Solve a turn as a whole, on panels that are halved until nothing is left unresolved."""
        grid = turn_grid(turn, limit)
        found = solved_turn(turn, grid)
        for _ in range(MOST_HALVINGS):
            if found.unresolved <= self.tolerance:
                break
            grid = grid.halved()
            found = solved_turn(turn, grid)
        half = turn_lines(found, turn.period, _count(turn.mechanics, limit, turn.period))
        lost = found.least_force <= 0
        return self._lines(turn, gear, turn.period, half, "whole turn", found.unresolved, lost)

    def _lines(
        self,
        turn: Turn,
        gear: str,
        period: int,
        displacement: ComplexArray,
        method: str,
        error: float,
        lost: bool,
    ) -> MeshLines:
        return MeshLines(
            mechanics=turn.mechanics,
            mesh_order=self.train.mesh(turn.mechanics.stage).order,
            gear=gear,
            period=period,
            displacement=displacement,
            method=method,
            error=error,
            contact_lost=lost,
        )


def _count(mechanics: StageMechanics, limit_hz: float, period: int) -> int:
    return math.floor(limit_hz / mechanics.mesh_frequency_hz * period * (1 + 1e-12))


def _takes_stiffness(turn: Turn, even: Turn) -> bool:
    own, healthy = turn.mechanics.stiffness, even.mechanics.stiffness
    return bool(own.pulses) or own.healthy_mean_n_per_m != healthy.healthy_mean_n_per_m
