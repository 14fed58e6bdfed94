"""Loss of stiffness: from a likelihood whose shape is known, and of simulated cracks."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from gearmon import analyse, learn, simulate
from gearmon.diagnosis.hypotheses.damage_size import loss_estimate
from gearmon.diagnosis.hypotheses.tooth_match import LOSSES
from gearmon.machine import Machine, OperatingPoint, ParallelStage


@pytest.mark.parametrize("loss", [0.08, 0.15])
def test_median_and_nine_tenths_of_a_normal_law_of_the_logarithm(loss):
    """Its own scatter of 0.3, that of the search of 0.35, and what lines have in common, 0.12."""
    match = -0.5 * (np.log(np.array(LOSSES) / loss) / 0.3) ** 2
    gear = SimpleNamespace(
        match=SimpleNamespace(log_likelihood=np.column_stack([0 * match, match]), best=1),
        difference=SimpleNamespace(mesh_lines=None, load=1.0),
    )
    found = loss_estimate(gear, None, 25.0)
    reach = np.exp(1.645 * np.sqrt(0.3**2 + 0.35**2 + 0.12**2))
    assert found.loss == pytest.approx(loss, rel=0.05)
    assert (found.low, found.high) == pytest.approx((loss / reach, loss * reach), rel=0.1)


def test_cracks_between_perfect_flanks_are_sized_as_they_are():
    """A pair answers to its own loss through the mesh, each harmonic by a law of its own."""
    stage = ParallelStage(pinion_teeth=23, gear_teeth=57, module_mm=2.5, face_width_mm=28.0)
    point = OperatingPoint(speed_rpm=1480.0, torque_nm=120.0)
    machine = Machine(name="pair", operating=(point,), stages=(stage,))

    def recorded(seed, *faults):
        own = {"machine_seed": 2, "recording_seed": seed, "channels": 2, "tacho_shaft": 1}
        return simulate(machine, faults, 5.0, 12_800.0, accuracy_grade=None, **own)

    reference = learn(recorded(1), machine)
    for gear in ("pinion", "gear"):
        found = analyse(recorded(4, f"crack:1:{gear}:7:30%"), machine, reference).flags[0]
        assert found.gear == gear
        assert found.stiffness_loss == pytest.approx(0.3, rel=0.06)
        assert found.stiffness_loss_high < 1.7 * found.stiffness_loss_low
