"""Gear condition monitoring that starts from physics.

The public names load what they need when they are first used, so that `import gearmon` costs
nothing. Pages of them all are made from the docstrings by `python .ci/docs` (extra `docs`).

Terms
-----
shaft
    Counted in the order of power flow; shaft 1 is the input, and its turns count all orders.
stage
    Two gears in mesh, or a planetary set; its driving gear is the pinion.
order
    Cycles a turn of shaft 1. A line that a shaft makes keeps its order whatever the speed does.
mesh frequency
    Teeth that pass the mesh a second; "mesh 1 harmonic 2" (GMF1 ×2) is twice that of stage 1.
sidebands
    Lines beside a mesh harmonic at the spacing of a shaft's rotation: what changes once a turn.
family
    Lines with one cause about one mesh harmonic: the harmonic itself, the sidebands up to the
    sixth of one shaft, or the residual (what else repeats with that shaft).
level
    Power of a family or a line [dB re 1 unit²], of peak amplitudes.
synchronous average
    What repeats with every turn of a gear (TSA), all else averaged out.
loss of stiffness
    Share of the stiffness of one tooth pair that damage has taken; 20 % is a large crack.
reference
    What healthy recordings of the machine looked like, condensed; their prediction for the load and
    speed of a new recording is the healthy machine that it is compared with.
expected signature
    The lines that the machine file lets expect, by the mesh stiffness and the equation of motion.
verdict
    `healthy`, `fault`, `cannot tell` or `no mesh found`.
flag
    One finding, with the place, the size and the probability of as much on a sound machine.
score
    -log10 of the false-alarm probability of the strongest evidence.

Examples
--------
Those of all other names go on from here.

>>> import numpy as np
>>> import gearmon
>>> stage = {"kind": "parallel", "pinion_teeth": 23, "gear_teeth": 57}
>>> stage |= {"module_mm": 2.5, "face_width_mm": 28.0}
>>> operating = {"speed_rpm": 1480.0, "torque_nm": 120.0}
>>> machine = gearmon.load_machine(name="drive", operating=operating, stage=stage)
>>> made = {"duration_s": 3.0, "sampling_rate_hz": 8000.0, "machine_seed": 1, "tacho_shaft": 1}
>>> half, full = (
...     gearmon.simulate(machine, load=load, recording_seed=n, channels=2, **made)
...     for n, load in enumerate([0.7, 1.0])
... )
>>> crack = "crack:1:pinion:7:20%"
>>> new = gearmon.simulate(machine, crack, load=0.9, recording_seed=5, channels=2, **made)
>>> reference = gearmon.learn([half, full], machine)
>>> analysis = gearmon.analyse(new, machine, reference)
>>> analysis.verdict, analysis.flags[0].gear, analysis.flags[0].tooth
('fault', 'pinion', 7)
"""

from __future__ import annotations

from gearmon.lazy import lazily

TYPE_CHECKING = False  # typing takes a moment, in which Ctrl-C would end in a traceback

__version__ = "0.1.0"

_OFFERED = {
    "diagnosis.analysis": ("analyse", "learn"),
    "diagnosis.fault_types.kinds": ("features",),
    "diagnosis.fault_types.training": ("train_kinds",),
    "diagnosis.reference_check": ("check_reference",),
    "diagnosis.results": ("Analysis",),
    "errors": ("GearmonError",),
    "exposure.day": ("exposure_day",),
    "exposure.gearbox": ("gear_share",),
    "exposure.measures": ("Exposure", "vibration_exposure", "seat_factor"),
    "exposure.weighting": ("frequency_weighting",),
    "harvesting.tuning": ("tune_harvester",),
    "machine": ("Machine", "load_machine"),
    "report.html": ("write_report",),
    "signals.orders.resampling": ("angular_waveform", "time_synchronous_average"),
    "signals.orders.spectra": ("order_map",),
    "signals.recording": ("Recording", "read_recording", "open_recording"),
    "signatures.expected.baseline": ("expected_signature",),
    "signatures.expected.fault_family": ("fault_family",),
    "signatures.expected.modes": ("modes",),
    "signatures.expected.tooth_response": ("loss_response",),
    "signatures.gear_averages": ("gear_averages",),
    "signatures.measured.indicators": ("indicator_table",),
    "signatures.measured.measurement": ("MeasuredSignature", "measure_signature"),
    "signatures.measured.reference": ("Reference", "read_reference", "write_reference"),
    "signatures.recording_spectrum": ("order_spectra", "recording_spectrum"),
    "signatures.signature": ("Signature", "read_signature", "write_signature"),
    "simulation": ("simulate",),
}

_NAMES, __getattr__ = lazily(__name__, _OFFERED)
__all__ = ["__version__", *_NAMES]

if TYPE_CHECKING:
    from gearmon.diagnosis.analysis import analyse as analyse
    from gearmon.diagnosis.analysis import learn as learn
    from gearmon.diagnosis.fault_types.kinds import features as features
    from gearmon.diagnosis.fault_types.training import train_kinds as train_kinds
    from gearmon.diagnosis.reference_check import check_reference as check_reference
    from gearmon.diagnosis.results import Analysis as Analysis
    from gearmon.errors import GearmonError as GearmonError
    from gearmon.exposure.day import exposure_day as exposure_day
    from gearmon.exposure.gearbox import gear_share as gear_share
    from gearmon.exposure.measures import Exposure as Exposure
    from gearmon.exposure.measures import seat_factor as seat_factor
    from gearmon.exposure.measures import vibration_exposure as vibration_exposure
    from gearmon.exposure.weighting import frequency_weighting as frequency_weighting
    from gearmon.harvesting.tuning import tune_harvester as tune_harvester
    from gearmon.machine import Machine as Machine
    from gearmon.machine import load_machine as load_machine
    from gearmon.report.html import write_report as write_report
    from gearmon.signals.orders.resampling import angular_waveform as angular_waveform
    from gearmon.signals.orders.resampling import (
        time_synchronous_average as time_synchronous_average,
    )
    from gearmon.signals.orders.spectra import order_map as order_map
    from gearmon.signals.recording import Recording as Recording
    from gearmon.signals.recording import open_recording as open_recording
    from gearmon.signals.recording import read_recording as read_recording
    from gearmon.signatures.expected.baseline import expected_signature as expected_signature
    from gearmon.signatures.expected.fault_family import fault_family as fault_family
    from gearmon.signatures.expected.modes import modes as modes
    from gearmon.signatures.expected.tooth_response import loss_response as loss_response
    from gearmon.signatures.gear_averages import gear_averages as gear_averages
    from gearmon.signatures.measured.indicators import indicator_table as indicator_table
    from gearmon.signatures.measured.measurement import MeasuredSignature as MeasuredSignature
    from gearmon.signatures.measured.measurement import measure_signature as measure_signature
    from gearmon.signatures.measured.reference import Reference as Reference
    from gearmon.signatures.measured.reference import read_reference as read_reference
    from gearmon.signatures.measured.reference import write_reference as write_reference
    from gearmon.signatures.recording_spectrum import order_spectra as order_spectra
    from gearmon.signatures.recording_spectrum import recording_spectrum as recording_spectrum
    from gearmon.signatures.signature import Signature as Signature
    from gearmon.signatures.signature import read_signature as read_signature
    from gearmon.signatures.signature import write_signature as write_signature
    from gearmon.simulation import simulate as simulate


def __dir__() -> list[str]:
    """List the public names."""
    return sorted(__all__)
