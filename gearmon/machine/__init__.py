"""The machine: stages, operating points, bearings and sensors, and the file that describes them."""

from gearmon.machine.fields import FieldError
from gearmon.machine.parts import (
    Bearing,
    Disc,
    Machine,
    OperatingPoint,
    Sensor,
    ShaftSection,
    Stage,
)
from gearmon.machine.reading import MachineLike, load_machine
from gearmon.machine.stages import ParallelStage, PlanetaryStage

__all__ = [
    "Bearing",
    "Disc",
    "FieldError",
    "Machine",
    "MachineLike",
    "OperatingPoint",
    "ParallelStage",
    "PlanetaryStage",
    "Sensor",
    "ShaftSection",
    "Stage",
    "load_machine",
]
