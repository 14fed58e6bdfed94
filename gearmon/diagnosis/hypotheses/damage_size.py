"""From a loss of stiffness to what could be measured on the tooth: crack depth, pitted area."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from gearmon.errors import ArgumentError, check_range
from gearmon.gears.damage import size_for_loss
from gearmon.gears.faults import Fault
from gearmon.gears.pairs import mesh_pairs
from gearmon.gears.tooth_pairs import ToothPair, teeth_of
from gearmon.machine import Machine

#: What is measured for each kind of damage: unit in which `gears.faults` takes it, unit in words,
#: and what it is.
MEASURED: dict[str, tuple[str, str, str]] = {
    "crack": ("mm", "mm", "crack depth"),
    "pitting": ("flank", "share of the flank", "pitted area"),
    "breakage": ("mm", "mm", "broken-off width"),
}
#: Damage of a single tooth that each kind of finding is read as.
READ_AS: dict[str, str] = {
    "tooth damage": "crack",
    "several teeth": "crack",
    "distributed pitting": "pitting",
}


@dataclass(frozen=True, kw_only=True)
class PhysicalSize:
    """Size of damage on a tooth that costs its pair a given stiffness.

    Parameters
    ----------
    quantity : str
        What it is: "crack depth", "pitted area" or "broken-off width".
    unit : str
        "mm" or "share of the flank".
    size : float
        At the estimated loss.
    low, high : float or None
        At the ends of the interval of the loss; None where that end is beyond the reach of this
        kind of damage.
    """

    quantity: str
    unit: str
    size: float
    low: float | None
    high: float | None

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        return {
            "quantity": self.quantity,
            "unit": self.unit,
            "size": self.size,
            "low": self.low,
            "high": self.high,
        }


def physical_size(
    machine: Machine, stage: int, gear: str, kind: str, loss: float, low: float, high: float
) -> PhysicalSize | None:
    """Convert a loss of pair stiffness to the size of the damage behind it.

    Parameters
    ----------
    machine : Machine
        The machine.
    stage : int, >= 1
        Stage.
    gear : str
        Gear with the damaged tooth.
    kind : str
        "crack", "pitting", "breakage", or a kind of finding: "tooth damage" and "several teeth" are
        read as a root crack through the face width, "distributed pitting" as pitting of each tooth.
    loss, low, high : float, in [0, 1)
        Mean loss of the stiffness of the pair over its contact, and its interval.

    Returns
    -------
    PhysicalSize or None
        None where the machine file lacks the geometry (module, face width), where nothing is
        measured for this kind, or where no size of this damage costs so much.

    Raises
    ------
    ArgumentError
        If there is no such stage or gear, or the losses are out of range or order.

    Notes
    -----
    The forward conversion `gears.damage.stiffness_loss` (potential energy of the tooth with a
    flat limit line of the crack) rises with the size, and is inverted by bracketing. Against finite
    elements that line costs shallow cracks too little stiffness, by up to 45 %: the depth given is
    then too large.

    Examples
    --------
    >>> from gearmon.machine import Machine, OperatingPoint, ParallelStage
    >>> stage = ParallelStage(pinion_teeth=26, gear_teeth=53, module_mm=2.0, face_width_mm=20.0)
    >>> machine = Machine(
    ...     name="pair", operating=(OperatingPoint(speed_rpm=1460.0),), stages=(stage,)
    ... )
    >>> found = physical_size(machine, 1, "pinion", "crack", 0.1, 0.05, 0.15)
    >>> found.quantity, found.low < found.size < found.high
    ('crack depth', True)
    """
    check_range("stage", stage, 1, len(machine.stages))
    for name, value in (("loss", loss), ("low", low), ("high", high)):
        check_range(name, value, 0.0, 1.0)
    if not low <= loss <= high:
        raise ArgumentError(f"low={low:g}, loss={loss:g}, high={high:g} must not decrease")
    teeth, index = _teeth_of(machine, stage, gear)
    damage = READ_AS.get(kind, kind)
    if damage not in MEASURED or teeth is None:
        return None
    unit, shown, quantity = MEASURED[damage]
    fault = Fault(kind=damage, stage=stage, gear=gear, tooth=1, size=0.1, unit=unit)
    size, least, most = (_size(fault, value, teeth, index) for value in (loss, low, high))
    if size is None:
        return None
    return PhysicalSize(quantity=quantity, unit=shown, size=size, low=least, high=most)


# the same for every recording of a machine
@lru_cache(maxsize=64)
def _teeth_of(machine: Machine, stage: int, gear: str) -> tuple[ToothPair | None, int]:
    """Return the teeth of a gear's mesh, None where the file lacks geometry, and its place there.

    Of a planet the mesh with the sun is taken.
    """
    pairs = mesh_pairs(machine.stages[stage - 1], stage, machine.path)
    for pair in pairs:
        names = [member.name for member in pair.members]
        if gear in names:
            told = pair.stage.module_mm is not None and pair.stage.face_width_mm is not None
            return teeth_of(pair) if told else None, names.index(gear)
    known = ", ".join(dict.fromkeys(m.name for pair in pairs for m in pair.members))
    raise ArgumentError(f"gear {gear!r} is not in stage {stage}, which has {known}")


def _size(fault: Fault, loss: float, teeth: ToothPair, index: int) -> float | None:
    if loss >= 1.0:
        return None
    try:
        return float(size_for_loss(fault, loss, teeth, index).size)
    except ArgumentError:  # no damage of this kind costs so much
        return None
