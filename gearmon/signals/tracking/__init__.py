"""Speed and angle of shaft 1: from a tachometer, from the lines of the vibration, or from both.

With a tachometer `pulses` finds its pulses and mends their train, and `tacho` lets the phases of
the mesh lines tell the angle between them. Without one `comb` finds the speed that puts known
orders onto the lines of the spectrum, steady or changing, `phases` makes an angle of it, `slips`
tells where that is lost; `mesh_detection` judges whether the mesh is there at all.

>>> import numpy as np
>>> from gearmon.signals.tracking import find_pulses, track_from_pulses
>>> time_s = np.arange(20_000) / 1000
>>> pulses = find_pulses(np.sin(2 * np.pi * 5.0 * time_s), 1000.0)
>>> track = track_from_pulses(pulses, 1, 1.0, 20.0)
>>> track.speed_hz.mean().round(6)
np.float64(5.0)
"""

from gearmon.signals.tracking.comb import Comb, SpeedScan, SpeedTrack, find_path, scan_speed
from gearmon.signals.tracking.mesh_detection import (
    MeshComb,
    MeshEvidence,
    combined_comb,
    foreign_spacing,
    mesh_evidence,
    sideband_spacing,
)
from gearmon.signals.tracking.phases import (
    coherent_share,
    follow_speed,
    integrate_speed,
    lock_track,
)
from gearmon.signals.tracking.pulses import TachoPulses, find_pulses, pulses_from_times
from gearmon.signals.tracking.slips import LEAST_TURNS, SlipCheck, check_slips
from gearmon.signals.tracking.tacho import (
    join,
    pulse_angles,
    pulses_per_turn,
    track_from_pulse_times,
    track_from_pulses,
)

__all__ = [
    "LEAST_TURNS",
    "Comb",
    "MeshComb",
    "MeshEvidence",
    "SlipCheck",
    "SpeedScan",
    "SpeedTrack",
    "TachoPulses",
    "check_slips",
    "coherent_share",
    "combined_comb",
    "find_path",
    "find_pulses",
    "follow_speed",
    "foreign_spacing",
    "integrate_speed",
    "join",
    "lock_track",
    "mesh_evidence",
    "pulse_angles",
    "pulses_from_times",
    "pulses_per_turn",
    "scan_speed",
    "sideband_spacing",
    "track_from_pulse_times",
    "track_from_pulses",
]
