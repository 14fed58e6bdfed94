"""The machine: stages, operating points, bearings and sensors, and the file that describes them.

Examples
--------
>>> from gearmon.machine import Bearing, Disc, FieldError, Machine, OperatingPoint, ParallelStage
>>> from gearmon.machine import Sensor, ShaftSection, load_machine
>>> drive = Machine(
...     name="conveyor drive",
...     operating=(OperatingPoint(speed_rpm=1480.0, torque_nm=120.0),),
...     stages=(ParallelStage(pinion_teeth=23, gear_teeth=57),),
...     sections=(ShaftSection(shaft=1, length_mm=180.0, diameter_mm=35.0),),
...     bearings=(Bearing(name="input", shaft=1, stiffness_n_per_m=2e8, position_mm=0.0),),
...     discs=(Disc(name="motor", shaft=1, inertia_kgm2=0.04),),
...     sensors=(Sensor(column="a1", unit="g", sensitivity=0.1),),
... )
>>> load_machine(drive.to_dict()).discs == drive.discs
True
>>> try:
...     ParallelStage(pinion_teeth=2, gear_teeth=57)
... except FieldError as error:
...     print(error.message("machine.toml: stage 1"))
machine.toml: stage 1 = 2 must lie in [5, 2000]: the range of cylindrical gears
"""

from gearmon.machine.fields import FieldError
from gearmon.machine.parts import (
    Bearing,
    Disc,
    Machine,
    MachineLike,
    OperatingPoint,
    Sensor,
    ShaftSection,
    Stage,
    load_machine,
)
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
