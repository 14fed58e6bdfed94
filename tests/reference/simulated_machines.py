"""Machines that the tests of the simulation share."""

from __future__ import annotations

from gearmon.machine import Bearing, Machine, OperatingPoint, ParallelStage, PlanetaryStage


def one_pair(pinion_teeth=13, gear_teeth=17, mesh_hz=625.0, **overrides):
    """One stage with known mass, stiffness and force."""
    known = {
        "module_mm": 2.0,
        "mesh_stiffness_n_per_m": 8e8,
        "equivalent_mass_kg": 0.28,
        "damping_ns_per_m": 4e3,
        "contact_ratio": 1.4122,
        "force_n": 4e3,
    }
    stage = ParallelStage(pinion_teeth=pinion_teeth, gear_teeth=gear_teeth, **(known | overrides))
    point = OperatingPoint(speed_rpm=60 * mesh_hz / pinion_teeth)
    return Machine(name="one pair", operating=(point,), stages=(stage,))


def two_stages(**second):
    """Two reductions that are described by their geometry."""
    return Machine(
        name="two stages",
        operating=(OperatingPoint(speed_rpm=1500.0, torque_nm=98.0),),
        stages=(
            ParallelStage(pinion_teeth=26, gear_teeth=53, module_mm=2.0, face_width_mm=20.0),
            ParallelStage(
                **{
                    "pinion_teeth": 23,
                    "gear_teeth": 61,
                    "module_mm": 2.5,
                    "face_width_mm": 30.0,
                    **second,
                }
            ),
        ),
        bearings=(
            Bearing(name="input", shaft=1, balls=9, ball_diameter_mm=7.94, pitch_diameter_mm=39.04),
        ),
    )


def planetary(**changes):
    """A planetary set with its ring fixed."""
    stage = {
        "sun_teeth": 20,
        "planet_teeth": 40,
        "ring_teeth": 100,
        "planets": 3,
        "module_mm": 1.5,
        "face_width_mm": 20.0,
        **changes,
    }
    return Machine(
        name="planetary",
        operating=(OperatingPoint(speed_rpm=1800.0, torque_nm=150.0),),
        stages=(PlanetaryStage(**stage),),
    )
