"""The machine: stages, operating points, bearings and sensors, and the file that describes them."""

from gearmon.machine.fields import FieldError
from gearmon.machine.parts import Bearing, Machine, OperatingPoint, Sensor, Stage
from gearmon.machine.reading import MachineLike, load_machine
from gearmon.machine.stages import ParallelStage, PlanetaryStage

__all__ = [
    "Bearing",
    "FieldError",
    "Machine",
    "MachineLike",
    "OperatingPoint",
    "ParallelStage",
    "PlanetaryStage",
    "Sensor",
    "Stage",
    "load_machine",
]
