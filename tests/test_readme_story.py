"""README's story: three loads learned, or one, without a tachometer; then a crack, and none."""

from __future__ import annotations

from functools import cache

import pytest
from reference.synthetic_signals import as_recording

from gearmon.diagnosis.analysis import analyse, learn
from gearmon.gears.faults import parse_fault
from gearmon.machine import Machine, OperatingPoint, ParallelStage
from gearmon.simulation import simulate


@cache
def machine():
    stage = ParallelStage(pinion_teeth=23, gear_teeth=57, module_mm=2.5, face_width_mm=28.0)
    point = OperatingPoint(speed_rpm=1480.0, torque_nm=120.0)
    return Machine(name="conveyor drive", operating=(point,), stages=(stage,))


@cache
def recording(load, seed, fault=""):
    faults = [parse_fault(fault)] if fault else []
    return as_recording(
        simulate(
            machine(),
            faults,
            8.0,
            10_240.0,
            machine_seed=3,
            recording_seed=seed,
            channels=2,
            load=load,
        )
    )


@cache
def reference(loads):
    return learn([recording(load, seed) for seed, load in enumerate(loads)], machine())


LEARNED = [(0.4, 0.7, 1.0), (1.0,), (0.7, 1.0), (1.0, 1.0)]


@pytest.mark.parametrize("loads", LEARNED)
@pytest.mark.parametrize("gear", ["pinion", "gear"])
def test_the_crack_is_found_however_the_machine_was_learned(loads, gear):
    told = analyse(recording(0.9, 11, f"crack:1:{gear}:5:20%"), machine(), reference(loads))
    assert told.verdict == "fault"
    assert (told.flags[0].kind, told.flags[0].stage) == ("tooth damage", 1)
    assert told.flags[0].gear == gear
    assert told.reason.startswith("Damage of tooth")


@pytest.mark.parametrize("loads", LEARNED)
@pytest.mark.parametrize("load", [0.8, 0.95])
def test_a_healthy_recording_is_no_fault(loads, load):
    told = analyse(recording(load, 21), machine(), reference(loads))
    assert told.verdict == "healthy"
    assert told.reason.startswith("The machine sounds as it did")


@pytest.mark.parametrize("gear", ["pinion", "gear"])
def test_evidence_does_not_shrink_with_references(gear):
    crack = recording(0.9, 11, f"crack:1:{gear}:5:20%")
    alone = analyse(crack, machine(), reference((1.0,))).score
    assert analyse(crack, machine(), reference((0.4, 0.7, 1.0))).score > 0.7 * alone
