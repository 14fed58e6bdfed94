"""Harvesting: where to put a vibration energy harvester, how to tune it, what it will power.

A harvester is linear (`InertialHarvester`, `CoilHarvester`, `PiezoCantilever`): its power and peaks
under a recording are the recording through its filter, lines and noise alike. Before there is a
recording, and for the search, the mean square of the acceleration by frequency stands for it:

    P = sum over lines of 2 G(f_i) <a_i^2>,    G the mean power per squared amplitude

From the lines of a gear pair to a tuned harvester and what it powers:

>>> from gearmon.harvesting import PIEZO_MATERIALS, BEAM_MATERIALS, PiezoCantilever, SensorBudget
>>> from gearmon.harvesting import tune_harvester, vibration_of_lines
>>> shaking = vibration_of_lines(
...     [633.0, 1266.0, 1899.0], acceleration_ms2=[4.0, 6.0, 2.0], wander=0.005
... )
>>> bimorph = PiezoCantilever(
...     wiring="series", piezo=PIEZO_MATERIALS["PZT-5A"], passive=BEAM_MATERIALS["brass"],
...     length_m=15e-3, width_m=10e-3, passive_thickness_m=0.2e-3, piezo_thickness_m=0.2e-3,
... )
>>> tuned = tune_harvester(bimorph, shaking)
>>> round(tuned.harvester.natural_frequency_hz), tuned.within_limits
(610, True)
>>> SensorBudget(sleep_power_w=0.1e-6).interval_s(tuned.power_w) < 86400   # a recording a day
True

The modules inside: `vibration` (what shakes), `harvester` (what all are; springs and coils),
`cantilever` (piezoelectric beams), `response` (what they make of it), `tuning` (one and sets),
`request` (the harvester's file and what a sensor gets of it) and `placement` (where to put it).
"""

from gearmon.harvesting.cantilever import BEAM_MATERIALS, PIEZO_MATERIALS, PiezoCantilever
from gearmon.harvesting.harvester import (
    CoilHarvester,
    InertialHarvester,
    half_power_band,
    response_rows,
)
from gearmon.harvesting.placement import Survey, survey_expected, survey_measured
from gearmon.harvesting.request import SensorBudget, load_harvester
from gearmon.harvesting.response import Tuned, evaluate, power_with_stops
from gearmon.harvesting.tuning import bandwidth_against_quality, tune_harvester, tune_set
from gearmon.harvesting.vibration import (
    OperatingShare,
    Vibration,
    vibration_of_lines,
    vibration_of_samples,
    vibration_of_signature,
)

__all__ = [
    "BEAM_MATERIALS",
    "PIEZO_MATERIALS",
    "CoilHarvester",
    "InertialHarvester",
    "OperatingShare",
    "PiezoCantilever",
    "SensorBudget",
    "Survey",
    "Tuned",
    "Vibration",
    "bandwidth_against_quality",
    "evaluate",
    "half_power_band",
    "load_harvester",
    "power_with_stops",
    "response_rows",
    "survey_expected",
    "survey_measured",
    "tune_harvester",
    "tune_set",
    "vibration_of_lines",
    "vibration_of_samples",
    "vibration_of_signature",
]
