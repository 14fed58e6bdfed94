"""A small simulated gearbox whose recordings many tests share; each is simulated once."""

from __future__ import annotations

import json
from functools import cache

from reference.synthetic_signals import as_recording

from gearmon.diagnosis.analysis import analyse, learn
from gearmon.gears.faults import parse_fault
from gearmon.machine import Machine, OperatingPoint, ParallelStage
from gearmon.simulation import simulate

RATE_HZ, DURATION_S = 10_000.0, 4.0
HEALTHY_LOADS = (0.7, 0.85, 1.0)
CRACK = "crack:1:pinion:7:40%"

MACHINE_FILE = """\
name = "small gearbox"

[operating]
speed_rpm = 2960.0
torque_nm = 120.0

[[stage]]
kind = "parallel"
pinion_teeth = 23
gear_teeth = 57
module_mm = 2.5
face_width_mm = 28.0
"""


@cache
def machine():
    """One stage, 23/57 teeth, the machine of `MACHINE_FILE`."""
    return Machine(
        name="small gearbox",
        operating=(OperatingPoint(speed_rpm=2960.0, torque_nm=120.0),),
        stages=(ParallelStage(pinion_teeth=23, gear_teeth=57, module_mm=2.5, face_width_mm=28.0),),
    )


@cache
def simulated(fault="", load=0.9, seed=17, tacho=True, machine_seed=1):
    """Four seconds of two accelerometers and, if wanted, a tacho."""
    return simulate(
        machine(),
        [parse_fault(fault)] if fault else [],
        DURATION_S,
        RATE_HZ,
        machine_seed=machine_seed,
        recording_seed=seed,
        channels=2,
        load=load,
        tacho_shaft=1 if tacho else None,
    )


def recording(fault="", load=0.9, seed=17, tacho=True, **changes):
    """The same, as it would have been read from a file."""
    whole = as_recording(simulated(fault, load, seed, **changes), origin=f"{fault}@{load}")
    # the same samples as a simulation without a tacho, at no cost
    return whole if tacho else whole.vibration()


@cache
def reference(tacho=True):
    """Three healthy recordings at three loads."""
    loads = enumerate(HEALTHY_LOADS)
    return learn([recording(load=load, seed=seed, tacho=tacho) for seed, load in loads], machine())


@cache
def analysis(fault="", load=0.9, seed=17, with_reference=True, tacho=True, known_tacho=True):
    """Analysis of one recording, by default against the reference, each with its tacho."""
    known = reference(known_tacho) if with_reference else None
    return analyse(recording(fault, load, seed, tacho), machine(), known)


def as_json(value):
    """What a reader of the JSON gets; fails for NaN and for types that are not built in."""
    return json.loads(json.dumps(value, allow_nan=False))
