"""Speed and angle of shaft 1: from a tachometer, from the lines of the vibration, or from both.

With a tachometer `tacho` finds its pulses and mends their train, and lets the phases of the mesh
lines tell the angle between them. Without one `comb` finds the speed that puts known
orders onto the lines of the spectrum, steady or changing, `phases` makes an angle of it and tells
where that is lost; `mesh_detection` judges whether the mesh is there at all.

>>> import numpy as np
>>> from gearmon.signals.tracking import find_pulses, track_from_pulses
>>> time_s = np.arange(20_000) / 1000
>>> pulses = find_pulses(np.sin(2 * np.pi * 5.0 * time_s), 1000.0)
>>> track = track_from_pulses(pulses, 1, 1.0, 20.0)
>>> track.speed_hz.mean().round(6)
np.float64(5.0)
"""

from gearmon.lazy import lazily

_OFFERED = {
    "comb": ("Comb", "SpeedScan", "SpeedTrack"),
    "mesh_detection": ("MeshComb", "MeshEvidence", "foreign_spacing", "mesh_evidence"),
    "phases": (
        *("SlipCheck", "check_slips", "coherent_share", "follow_lines", "integrate_speed"),
        *("lock_track", "mend_slips"),
    ),
    "tacho": (
        *("TachoPulses", "find_pulses", "join", "pulses_per_turn", "track_from_pulse_times"),
        "track_from_pulses",
    ),
}

__all__, __getattr__ = lazily(__name__, _OFFERED)
