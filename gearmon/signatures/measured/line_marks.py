"""Where a machine puts lines, at a given speed: names for the peaks of a spectrum."""

from __future__ import annotations

from dataclasses import dataclass

from gearmon.gears.kinematics import Kinematics, kinematics
from gearmon.machine import Machine
from gearmon.signatures.measured.line_plan import MESH_HARMONICS

SHAFT_HARMONICS = 3


@dataclass(frozen=True, kw_only=True)
class Mark:
    """A line of the machine.

    Parameters
    ----------
    place : float
        Frequency [Hz], or order of the shaft that the axis counts by.
    name : str
        "shaft 2 ×1", "mesh 1 ×3"; several names are joined by " = ".
    kind : {"shaft", "mesh"}
    number : int
        Shaft, or stage.
    """

    place: float
    name: str
    kind: str
    number: int


def machine_marks(machine: Machine, per_order: float, top: float) -> tuple[Mark, ...]:
    """Return the shaft and mesh harmonics of a machine, lowest first.

    Parameters
    ----------
    machine : Machine
        The machine.
    per_order : float
        What one order of shaft 1 is on the axis: its speed [Hz], or the reciprocal of the order of
        the shaft that the axis counts by.
    top : float
        No marks above this place.
    """
    train: Kinematics = kinematics(machine)
    found: dict[float, Mark] = {}

    def add(order: float, name: str, kind: str, number: int) -> None:
        place = order * per_order
        if place > top:
            return
        key = round(order, 9)
        known = found.get(key)
        if known is None:
            found[key] = Mark(place=place, name=name, kind=kind, number=number)
        else:
            joined = f"{known.name} = {name}"
            found[key] = Mark(place=place, name=joined, kind=known.kind, number=known.number)

    for mesh in train.meshes:
        for k in range(1, MESH_HARMONICS + 1):
            add(k * mesh.order, f"mesh {mesh.stage} ×{k}", "mesh", mesh.stage)
    for shaft in train.shafts:
        for k in range(1, SHAFT_HARMONICS + 1):
            add(k * shaft.order, f"shaft {shaft.number} ×{k}", "shaft", shaft.number)
    return tuple(found[key] for key in sorted(found))


def mark_near(marks: tuple[Mark, ...], place: float, within: float) -> str:
    """Return the name of the mark nearest to a place, "" if none lies within a distance."""
    near = min(marks, key=lambda mark: abs(mark.place - place), default=None)
    return near.name if near is not None and abs(near.place - place) <= within else ""
