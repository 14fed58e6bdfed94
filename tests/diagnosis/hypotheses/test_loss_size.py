"""Loss of stiffness: from a likelihood whose shape is known, of simulated cracks, and as one."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from reference.simulated_machines import one_pair, two_stages

from gearmon import analyse, learn, simulate
from gearmon.diagnosis.hypotheses.mesh_harmonics import loss_estimate
from gearmon.diagnosis.hypotheses.tooth_damage import crack_depth_mm
from gearmon.diagnosis.hypotheses.tooth_match import LOSSES
from gearmon.gears.damage import stiffness_loss
from gearmon.gears.faults import Fault
from gearmon.gears.pairs import mesh_pairs
from gearmon.gears.tooth_pairs import teeth_of
from gearmon.machine import Machine, OperatingPoint, ParallelStage, PlanetaryStage


@pytest.mark.parametrize(("loss", "scatter"), [(0.08, 0.3), (0.15, 0.3), (0.15, 0.02)])
def test_median_and_nine_tenths_of_a_normal_law_of_the_logarithm(loss, scatter):
    """Its own scatter, that of the search of 0.35, and what lines have in common, 0.12."""
    match = -0.5 * (np.log(np.array(LOSSES) / loss) / scatter) ** 2
    gear = SimpleNamespace(
        log_likelihood=np.column_stack([0 * match, match]),
        best=1,
        difference=SimpleNamespace(mesh_lines=None, load=1.0),
    )
    found = loss_estimate(gear, None)
    reach = np.exp(1.645 * np.sqrt(scatter**2 + 0.35**2 + 0.12**2))
    assert found.loss == pytest.approx(loss, rel=0.02)
    assert (found.low, found.high) == pytest.approx((loss / reach, loss * reach), rel=0.1)


def test_cracks_between_perfect_flanks_are_sized_as_they_are():
    """A pair answers to its own loss through the mesh, each harmonic by a law of its own."""
    stage = ParallelStage(pinion_teeth=23, gear_teeth=57, module_mm=2.5, face_width_mm=28.0)
    point = OperatingPoint(speed_rpm=1480.0, torque_nm=120.0)
    machine = Machine(name="pair", operating=(point,), stages=(stage,))

    def recorded(seed, *faults):
        own = {"machine_seed": 2, "recording_seed": seed, "channels": 2, "tacho_shaft": 1}
        return simulate(machine, faults, 3.0, 12_800.0, accuracy_grade=None, **own)

    reference = learn(recorded(1), machine)
    for gear in ("pinion", "gear"):
        found = analyse(recorded(4, f"crack:1:{gear}:7:30%"), machine, reference).flags[0]
        assert found.gear == gear
        assert found.stiffness_loss == pytest.approx(0.3, rel=0.06)
        assert found.stiffness_loss_high < 1.7 * found.stiffness_loss_low


@pytest.mark.parametrize(("stage", "gear"), [(1, "pinion"), (2, "gear")])
def test_a_crack_of_the_depth_told_costs_the_loss_it_came_from(stage, gear):
    train = two_stages()
    depth = crack_depth_mm(train, stage, gear, 0.04)
    pair = mesh_pairs(train.stages[stage - 1])[0]
    index = [member.name for member in pair.members].index(gear)
    crack = Fault(kind="crack", stage=stage, gear=gear, tooth=1, size=depth, unit="mm")
    assert stiffness_loss(crack, teeth_of(pair), index).mean == pytest.approx(0.04, rel=1e-6)


def test_cracks_grow_deeper_with_the_loss_until_none_costs_so_much():
    depths = [crack_depth_mm(two_stages(), 1, "pinion", loss) for loss in (0.0, 0.1, 0.3)]
    assert depths[0] == 0.0
    assert depths == sorted(set(depths))
    assert crack_depth_mm(two_stages(), 1, "pinion", 0.97) is None


def test_without_geometry_no_depth_is_told():
    assert crack_depth_mm(one_pair(), 1, "pinion", 0.1) is None


def test_of_a_planet_the_crack_is_one_beside_the_sun():
    told = {"module_mm": 2.0, "face_width_mm": 20.0, "planets": 3, "fixed": "ring"}
    stage = PlanetaryStage(sun_teeth=18, planet_teeth=27, ring_teeth=72, **told)
    train = Machine(name="set", operating=(OperatingPoint(speed_rpm=900.0),), stages=(stage,))
    crack = Fault(kind="crack", stage=1, gear="planet", tooth=1, size=1.0, unit="mm")
    loss = stiffness_loss(crack, teeth_of(mesh_pairs(stage)[0]), 1).mean
    assert crack_depth_mm(train, 1, "planet", loss) == pytest.approx(1.0, rel=1e-6)
