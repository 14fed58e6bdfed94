"""Recordings of simulated machines whose condition is known."""

from gearmon.simulation.recorder import SimulatedRecording, record, simulate, write_simulation
from gearmon.simulation.settings import Settings

__all__ = ["Settings", "SimulatedRecording", "record", "simulate", "write_simulation"]
