"""Families of signatures: a machine healthy, and with every kind and size of fault of every gear.

The healthy mesh is solved once. A fault of tooth 1 changes it for the contact of that tooth only,
and only that is solved anew (see `fault_family_motion`), exactly for every size; a fault of tooth j
gives the same lines, turned by ``exp(-2 pi i r (j - 1)/z)`` at the harmonic r of the gear's turn.
Eccentricity, cumulative pitch error and misalignment act all through the turn and shift the corners
of the stiffness: their turns are solved as a whole.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gearmon.errors import ArgumentError, check_positive, check_range
from gearmon.machine import Machine
from gearmon.signatures.fault_family_members import FamilyMember, MeshLines
from gearmon.signatures.fault_family_plan import FAMILY_KINDS, Plan, family_plan
from gearmon.signatures.fault_family_response import LossResponse, loss_response
from gearmon.signatures.fault_family_solution import Solver
from gearmon.signatures.signature import Signature, write_signature

__all__ = [
    "FAMILY_KINDS",
    "FamilyMember",
    "FaultFamily",
    "LossResponse",
    "MeshLines",
    "fault_family",
    "loss_response",
]

Size = float | str


@dataclass(frozen=True, kw_only=True, eq=False)
class FaultFamily:
    """A machine healthy and with every fault asked for.

    Parameters
    ----------
    machine : Machine
    members : tuple of FamilyMember
        One for each kind, size, gear and operating point; teeth follow by turning.
    healthy : mapping of (int, int, int) to MeshLines
        The healthy meshes by operating point, stage and mesh (1: planet and ring).
    max_hz : float or None
        As asked for.
    tolerance : float
    notes : tuple of str
        What was left out, and why.
    """

    machine: Machine
    members: tuple[FamilyMember, ...]
    healthy: Mapping[tuple[int, int, int], MeshLines]
    max_hz: float | None
    tolerance: float
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.members)

    def __iter__(self) -> Iterator[FamilyMember]:
        return iter(self.members)

    def select(
        self,
        kind: str | None = None,
        stage: int | None = None,
        gear: str | None = None,
        operating: int | None = None,
    ) -> tuple[FamilyMember, ...]:
        """Return the members of a kind, stage, gear or operating point; None takes all."""
        wanted = {"kind": kind, "stage": stage, "gear": gear, "operating": operating}
        asked = {name: value for name, value in wanted.items() if value is not None}
        return tuple(
            m for m in self.members if all(getattr(m, name) == v for name, v in asked.items())
        )

    def signature(
        self, member: FamilyMember | None = None, tooth: int = 1, operating: int = 0
    ) -> Signature:
        """Return the lines of the machine with one of its faults, or healthy.

        Parameters
        ----------
        member : FamilyMember, optional
            By default none: the healthy machine.
        tooth : int
            Faulty tooth, from 1.
        operating : int
            Of the healthy machine; a member has its own.

        Returns
        -------
        Signature
            Origin "expected": the lines of `expected_signature` for the same fault.
        """
        number = operating if member is None else member.operating
        check_range("operating", number, 0, len(self.machine.operating) - 1)
        stages = range(1, len(self.machine.stages) + 1)
        meshes = {stage: self._healthy(number, stage) for stage in stages}
        tables = {stage: lines.columns() for stage, lines in meshes.items()}
        if member is not None:
            member.check_tooth(tooth)
            meshes[member.stage] = member.lines
            tables[member.stage] = member.lines.columns(tooth)
        header = _headers(meshes.values())
        header |= {
            "speed_rpm": self.machine.operating[number].speed_rpm,
            "torque_nm": self.machine.operating[number].torque_nm,
            "operating": self.machine.operating[number].name,
            "faults": [] if member is None else [str(member.fault(tooth))],
            "tolerance": self.tolerance,
            "amplitudes": AMPLITUDES,
        }
        return Signature(
            machine=self.machine.name,
            origin="expected",
            header=header,
            columns=_joined(list(tables.values())),
        )

    def table(self, mesh_harmonics: int | None = None, sidebands: int | None = None) -> Signature:
        """Return all lines of the family as one table.

        Parameters
        ----------
        mesh_harmonics, sidebands : int, optional
            Most mesh harmonics, and most sidebands to each side of them; by default all.

        Returns
        -------
        Signature
            Origin "expected family". Beside its columns: `kind`, `gear`, `size`, `loss`,
            `operating` (from 0); of each member the lines of its own stage with tooth 1 faulty, and
            those of the healthy stages (kind "healthy").
        """
        parts = []
        for (operating, _, mesh), lines in self.healthy.items():
            gear = "ring" if mesh else ""
            parts.append((lines, "healthy", gear, "", 0.0, operating))
        parts += [(m.lines, m.kind, m.gear, m.size, m.loss, m.operating) for m in self.members]
        tables = [_limited(_with_member(*part), mesh_harmonics, sidebands) for part in parts]
        header = {
            "operating_points": [
                {"speed_rpm": point.speed_rpm, "torque_nm": point.torque_nm, "name": point.name}
                for point in self.machine.operating
            ],
            "max_hz": self.max_hz,
            "tolerance": self.tolerance,
            "amplitudes": AMPLITUDES + "; tooth 1 is faulty",
            "largest_error": max((m.lines.error for m in self.members), default=0.0),
            "notes": list(self.notes),
        }
        return Signature(
            machine=self.machine.name,
            origin="expected family",
            header=header,
            columns=_joined(tables),
        )

    def rows(self) -> list[dict[str, Any]]:
        """Return one row for each member: what it is, and how strong its lines are.

        `sidebands_ms2` is the rms acceleration of all lines that are no mesh harmonics,
        `mesh_change_ms2` that of the change of the mesh harmonics, `healthy_ms2` that of the
        healthy mesh, all up to the highest frequency asked for.
        """
        return [self._row(member) for member in self.members]

    def to_dict(self) -> dict[str, Any]:
        """Return machine, rows and notes as built-in types that JSON can hold."""
        return {"machine": self.machine.name, "rows": self.rows(), "notes": list(self.notes)}

    def write(
        self,
        path: str | Path,
        mesh_harmonics: int | None = None,
        sidebands: int | None = None,
    ) -> None:
        """Write `table` as CSV, JSON or Parquet, by the suffix of `path`."""
        write_signature(self.table(mesh_harmonics, sidebands), path)

    def _healthy(self, operating: int, stage: int) -> MeshLines:
        return self.healthy[(operating, stage, 0)]

    def _row(self, member: FamilyMember) -> dict[str, Any]:
        lines = member.lines
        mesh = 1 if member.gear == "ring" else 0
        even = self.healthy[(member.operating, member.stage, mesh)].acceleration
        mine = lines.acceleration
        meshes = mine[lines.period - 1 :: lines.period]
        side = np.delete(mine, np.arange(lines.period - 1, len(mine), lines.period))
        return {
            "kind": member.kind,
            "stage": member.stage,
            "gear": member.gear,
            "size": member.size,
            "loss": member.loss,
            "operating": member.operating,
            "teeth": member.teeth,
            "lines": len(mine),
            "healthy_ms2": _rms(even),
            "sidebands_ms2": _rms(side),
            "mesh_change_ms2": _rms(meshes - even[: len(meshes)]),
            "contact_lost": lines.contact_lost,
            "method": lines.method,
            "error": lines.error,
        }


AMPLITUDES = "peak; phase of the displacement as a cosine when tooth 1 enters contact"


def fault_family(
    machine: Machine,
    kinds: Iterable[str] | None = None,
    sizes: Sequence[Size] | Mapping[str, Sequence[Size]] | None = None,
    gears: Iterable[tuple[int, str] | str] | None = None,
    operating: Iterable[int] | int | None = None,
    max_hz: float | None = None,
    tolerance: float = 1e-6,
    *,
    form: str = "parabolic",
) -> FaultFamily:
    """Solve a machine healthy and with every kind and size of fault of every gear.

    Parameters
    ----------
    machine : Machine
        With the data that a baseline needs.
    kinds : iterable of str, optional
        Kinds of `gears.faults.KINDS` and `gears.faults.ERROR_KINDS`; by default
        `FAMILY_KINDS`, of which those that the machine file has too little data for are left out
        and named in `FaultFamily.notes`.
    sizes : sequence or mapping of str to sequence, optional
        As in ``KIND:STAGE:GEAR:TOOTH:SIZE``, or numbers: losses of pair stiffness in [0, 1). By
        kind, or for all kinds that understand them (of a plain sequence, um are errors and mm
        damage). By default 2.5, 5, 10, 20 and 40 % and 5, 10, 20 and 40 um.
    gears : iterable of (int, str) or str, optional
        Stages and gears, such as (1, "pinion"), "1:pinion" or "pinion"; by default all.
    operating : iterable of int, or int, optional
        Operating points, from 0; by default all.
    max_hz : float, optional
        Highest frequency [Hz], > 0; by default as in `expected_signature`.
    tolerance : float, in [1e-10, 1]
        Relative error of what a fault adds (an estimate), and of the acceleration of turns that
        are solved as a whole (a bound).
    form : str
        Form of the stiffness curve, see `gears.stiffness.mesh_stiffness`.

    Returns
    -------
    FaultFamily

    Raises
    ------
    ArgumentError
        If an argument is out of its range or the machine lacks data.

    Notes
    -----
    One fault at a time, in one mesh of its stage: a planet meets the sun, unless the fault is of
    the ring. The motion is that of `expected_signature`: linear, along the line of action, before
    any path to a sensor.
    """
    if max_hz is not None:
        check_positive("max_hz", max_hz, "Hz")
    check_range("tolerance", tolerance, 1e-10, 1.0)
    plan: Plan = family_plan(machine, kinds, sizes, gears, operating)
    solver = Solver(machine, max_hz, tolerance, form)
    healthy = {}
    for number in plan.operating:
        for stage in range(1, len(machine.stages) + 1):
            for mesh in sorted({0, *(m for s, _, m in plan.gears if s == stage)}):
                healthy[(number, stage, mesh)] = solver.healthy(number, stage, mesh)
    if not any(len(lines.displacement) for lines in healthy.values()):
        lowest = min(lines.mechanics.mesh_frequency_hz for lines in healthy.values())
        raise ArgumentError(
            f"max_hz={max_hz} Hz lies below the lowest mesh frequency, {lowest:.6g} Hz: no lines"
        )
    members: list[FamilyMember] = []
    notes: list[str] = []
    for number in plan.operating:
        for stage, gear, mesh in plan.gears:
            for kind, texts in plan.sizes.items():
                try:
                    members += solver.members(number, stage, gear, mesh, kind, texts)
                except ArgumentError as error:
                    if kinds is not None:
                        raise
                    note = f"{kind} of the {gear} of stage {stage} left out: {error}"
                    notes += [] if note in notes else [note]
    return FaultFamily(
        machine=machine,
        members=tuple(members),
        healthy=healthy,
        max_hz=max_hz,
        tolerance=tolerance,
        notes=tuple(notes),
    )


def _headers(meshes: Iterable[MeshLines]) -> dict[str, Any]:
    stages = []
    for lines in meshes:
        own = lines.mechanics
        stages.append(
            {
                "stage": own.stage,
                "mesh": own.mesh,
                "mesh_frequency_hz": own.mesh_frequency_hz,
                "mean_stiffness_n_per_m": own.stiffness.mean_n_per_m,
                "stiffness_variation": own.stiffness.variation,
                "contact_ratio": own.stiffness.contact_ratio,
                "natural_frequency_hz": own.natural_frequency_hz,
                "damping_ratio": own.damping_ratio,
                "force_n": own.force_n,
                "period_mesh": lines.period,
                "method": lines.method,
                "error": lines.error,
                "contact_lost": lines.contact_lost,
                "assumptions": list(own.assumptions),
                "warnings": list(own.warnings),
            }
        )
    header = {key: value for key, value in stages[0].items() if key != "stage"}
    return header | {"stages": stages}


def _with_member(
    lines: MeshLines, kind: str, gear: str, size: str, loss: float, operating: int
) -> dict[str, Any]:
    columns = lines.columns()
    count = len(columns["stage"])
    return {
        "kind": np.full(count, kind),
        "gear": np.full(count, gear, dtype="U16"),
        "size": np.full(count, size, dtype="U64"),
        "loss": np.full(count, loss),
        "operating": np.full(count, float(operating)),
        **columns,
    }


def _limited(
    columns: dict[str, Any], mesh_harmonics: int | None, sidebands: int | None
) -> dict[str, Any]:
    kept = np.ones(len(columns["stage"]), dtype=bool)
    if mesh_harmonics is not None:
        # lines below the first mesh harmonic are multiples of the turn, not its sidebands
        kept &= (columns["mesh_harmonic"] >= 1) & (columns["mesh_harmonic"] <= mesh_harmonics)
    if sidebands is not None:
        kept &= np.abs(columns["sideband"]) <= sidebands
    return {name: column[kept] for name, column in columns.items()}


def _joined(tables: Sequence[dict[str, Any]]) -> dict[str, Any]:
    return {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}


def _rms(lines: Any) -> float:
    return float(np.sqrt(2 * np.sum(np.abs(lines) ** 2)))
