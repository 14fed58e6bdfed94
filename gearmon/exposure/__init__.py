"""Exposure: what people on a machine feel of its vibration, by ISO 2631-1 and ISO 5349-1.

The rooms inside: `weighting` (what the body feels of which frequency), `measures` (one recording:
rms, running rms, dose value, advice), `day` (several jobs, limits, how sure) and `gearbox` (what
shafts, meshes and their damage have to do with it).

>>> import numpy as np
>>> from gearmon.exposure import vibration_exposure
>>> time = np.arange(60_000) / 1000.0
>>> shaking = np.sqrt(2) * np.sin(2 * np.pi * 10**0.6 * time)
>>> found = vibration_exposure(
...     np.array([0.1 * shaking, 0.1 * shaking, shaking]), "seat", {"x": 1, "y": 2, "z": 3},
...     sampling_rate_hz=1000.0, unit="m/s2",
... )
>>> found.value_axis, round(found.value_ms2, 2)
('z', 0.96)
"""

from gearmon.exposure.day import DayExposure, DayPlan, Job, exposure_day, load_day, sum_up
from gearmon.exposure.gearbox import GearShare, gear_share
from gearmon.exposure.measures import (
    LIMITS,
    POSITIONS,
    Exposure,
    Limits,
    SeatFactor,
    seat_factor,
    vibration_exposure,
)
from gearmon.exposure.weighting import WEIGHTINGS, Weighting, frequency_weighting

__all__ = [
    "LIMITS",
    "POSITIONS",
    "WEIGHTINGS",
    "DayExposure",
    "DayPlan",
    "Exposure",
    "GearShare",
    "Job",
    "Limits",
    "SeatFactor",
    "Weighting",
    "exposure_day",
    "frequency_weighting",
    "gear_share",
    "load_day",
    "seat_factor",
    "sum_up",
    "vibration_exposure",
]
