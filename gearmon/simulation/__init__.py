"""Recordings of simulated machines whose condition is known.

The equations of motion of all shafts and meshes are integrated along the drive's turning, with
teeth that differ by manufacture and damage, and what reaches a sensor is recorded with its truth:
`simulate` from a machine, its faults and `Settings`; `write_simulation` puts recording and truth
into files.

The modules: `settings` and the random streams of a seed; `contact` (what every mesh sees as the
shafts turn), `train` (the machine as masses and meshes), `integrate` (the marching of the system),
`vibration` (blocks of it, as samples, on their path to the sensors), `recorder` (all together, with
the truth).
"""

from gearmon.simulation.recorder import SimulatedRecording, record, simulate, write_simulation
from gearmon.simulation.settings import Settings

__all__ = ["Settings", "SimulatedRecording", "record", "simulate", "write_simulation"]
