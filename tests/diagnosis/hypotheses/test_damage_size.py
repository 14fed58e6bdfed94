"""From a loss of stiffness back to the damage that costs it."""

from __future__ import annotations

import pytest
from reference.simulated_machines import one_pair, two_stages

from gearmon.diagnosis.hypotheses.damage_size import physical_size
from gearmon.errors import ArgumentError
from gearmon.gears.fault_sizes import stiffness_loss
from gearmon.gears.faults import Fault
from gearmon.gears.pairs import mesh_pairs
from gearmon.gears.potential_energy import teeth_of


@pytest.mark.parametrize(
    ("kind", "damage", "unit"),
    [
        ("tooth damage", "crack", "mm"),
        ("crack", "crack", "mm"),
        ("distributed pitting", "pitting", "flank"),
        ("breakage", "breakage", "mm"),
    ],
)
@pytest.mark.parametrize(("stage", "gear"), [(1, "pinion"), (2, "gear")])
def test_the_size_costs_the_loss_it_came_from(kind, damage, unit, stage, gear):
    machine, loss = two_stages(), 0.04
    found = physical_size(machine, stage, gear, kind, loss, 0.02, 0.06)
    pair = mesh_pairs(machine.stages[stage - 1])[0]
    index = [member.name for member in pair.members].index(gear)
    fault = Fault(kind=damage, stage=stage, gear=gear, tooth=1, size=found.size, unit=unit)
    assert stiffness_loss(fault, teeth_of(pair), index).mean == pytest.approx(loss, rel=1e-6)
    assert found.low < found.size < found.high


def test_sizes_grow_with_the_loss():
    sizes = [
        physical_size(two_stages(), 1, "pinion", "crack", x, x, x).size for x in (0.0, 0.1, 0.3)
    ]
    assert sizes[0] == 0.0
    assert sizes == sorted(set(sizes))


def test_beyond_reach_there_is_no_size():
    assert physical_size(two_stages(), 1, "pinion", "pitting", 0.9, 0.8, 0.95) is None
    found = physical_size(two_stages(), 1, "pinion", "pitting", 0.03, 0.01, 0.95)
    assert found.high is None
    assert found.to_dict()["quantity"] == "pitted area"


def test_without_geometry_or_measure_there_is_none():
    assert physical_size(one_pair(), 1, "pinion", "crack", 0.1, 0.0, 0.2) is None
    assert physical_size(two_stages(), 1, "pinion", "eccentricity", 0.1, 0.0, 0.2) is None


def test_bad_requests_are_refused():
    with pytest.raises(ArgumentError, match="stage"):
        physical_size(two_stages(), 3, "pinion", "crack", 0.1, 0.0, 0.2)
    with pytest.raises(ArgumentError, match="which has pinion, gear"):
        physical_size(two_stages(), 1, "sun", "crack", 0.1, 0.0, 0.2)
    with pytest.raises(ArgumentError, match="must not decrease"):
        physical_size(two_stages(), 1, "pinion", "crack", 0.1, 0.2, 0.2)
    with pytest.raises(ArgumentError, match="high"):
        physical_size(two_stages(), 1, "pinion", "crack", 0.1, 0.0, 2.0)
