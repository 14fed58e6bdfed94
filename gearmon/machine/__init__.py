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

from gearmon.lazy import offered_to_checkers

TYPE_CHECKING = False  # see `gearmon.lazy`
if TYPE_CHECKING:
    from gearmon.machine.fields import FieldError as FieldError
    from gearmon.machine.parts import Bearing as Bearing
    from gearmon.machine.parts import Disc as Disc
    from gearmon.machine.parts import Machine as Machine
    from gearmon.machine.parts import OperatingPoint as OperatingPoint
    from gearmon.machine.parts import Sensor as Sensor
    from gearmon.machine.parts import ShaftSection as ShaftSection
    from gearmon.machine.parts import Stage as Stage
    from gearmon.machine.reading import MachineLike as MachineLike
    from gearmon.machine.reading import load_machine as load_machine
    from gearmon.machine.stages import ParallelStage as ParallelStage
    from gearmon.machine.stages import PlanetaryStage as PlanetaryStage

__all__, __getattr__ = offered_to_checkers(__name__, __file__)
