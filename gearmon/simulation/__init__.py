"""Recordings of simulated machines whose condition is known."""

from gearmon.simulation.output import write_simulation
from gearmon.simulation.settings import Settings
from gearmon.simulation.simulate import SimulatedRecording, record, simulate

__all__ = ["Settings", "SimulatedRecording", "record", "simulate", "write_simulation"]
