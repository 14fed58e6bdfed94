"""From recordings of a simulated gearbox, through the analysis, to the kind of fault.

The simulation integrates the motion in time, with its own path and noise: nothing of it is what the
classifier was trained on.
"""

from __future__ import annotations

from functools import cache

import pytest
from reference.small_gearbox import analysis, machine, reference

from gearmon.diagnosis.fault_types import NONE, train_kinds
from gearmon.diagnosis.fault_types.kinds import analysis_features, judge_kind

PINION_10 = "crack:1:pinion:3:10%"
WORN = "wear:1:pinion:all:20%"


@cache
def classifier():
    return train_kinds(machine(), seed=1, count=400)


@cache
def features(fault, load, seed):
    return analysis_features(analysis(fault, load, seed), reference())


@pytest.mark.parametrize("judge", ["rules", "classifier"])
@pytest.mark.parametrize(("load", "seed"), [(0.8, 40), (0.9, 41)])
def test_healthy_recordings_are_none_of_these(judge, load, seed):
    judged = judge_kind(features("", load, seed), classifier() if judge == "classifier" else None)
    assert judged.kind == NONE
    assert judged.gear is None


@pytest.mark.parametrize("judge", ["rules", "classifier"])
@pytest.mark.parametrize(
    ("fault", "kinds"),
    [
        # a housing that rings on makes one tooth look like neighbours
        (PINION_10, ("tooth damage", "several teeth")),
        (WORN, ("wear",)),
    ],
)
def test_faults_are_told_by_kind(judge, fault, kinds):
    judged = judge_kind(features(fault, 0.9, 42), classifier() if judge == "classifier" else None)
    assert judged.kind in kinds
    assert judged.stage == 1
    assert judged.gear == (None if fault == WORN else "pinion")
