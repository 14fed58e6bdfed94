"""Recordings of simulated machines whose condition is known.

The equations of motion of all shafts and meshes are integrated along the drive's turning, with
teeth that differ by manufacture and damage, and what reaches a sensor is recorded with its truth:
`simulate` from a machine, its faults and `Settings`; `write_simulation` puts recording and truth
into files.

The modules: `contact` (what every mesh sees as the shafts turn), `train` (settings, the random
streams of a seed, the machine as masses and meshes), `integrate` (the marching of the system),
`vibration` (blocks of it, as samples, on their path to the sensors), `recorder` (all together, with
the truth).

Examples
--------
>>> from gearmon.simulation import Settings, SimulatedRecording, record, write_simulation
>>> settings = Settings(duration_s=1.0, sampling_rate_hz=4000.0, channels=1)
>>> made = record(machine, settings=settings)
>>> isinstance(made, SimulatedRecording), made.duration_s
(True, 1.0)
>>> [path.name for path in write_simulation(made, "healthy.csv")]
['healthy.csv', 'healthy.json']
"""

from gearmon.simulation.recorder import SimulatedRecording, record, simulate, write_simulation
from gearmon.simulation.train import Settings

__all__ = ["Settings", "SimulatedRecording", "record", "simulate", "write_simulation"]
