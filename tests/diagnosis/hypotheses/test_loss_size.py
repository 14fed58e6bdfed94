"""Loss of stiffness from a likelihood whose shape is known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from gearmon.diagnosis.hypotheses.damage_size import loss_estimate
from gearmon.diagnosis.hypotheses.tooth_match import LOSSES


@pytest.mark.parametrize("loss", [0.08, 0.15])
def test_median_and_nine_tenths_of_a_normal_law_of_the_logarithm(loss):
    """Its own scatter of 0.3, that of the search of 0.35, and what lines have in common, 0.16."""
    match = -0.5 * (np.log(np.array(LOSSES) / loss) / 0.3) ** 2
    gear = SimpleNamespace(
        match=SimpleNamespace(log_likelihood=np.column_stack([0 * match, match]), best=1),
        difference=SimpleNamespace(mesh_lines=None),
        response=SimpleNamespace(mesh_growth=lambda losses: losses),
    )
    found = loss_estimate(gear, 25.0)
    reach = np.exp(1.645 * np.sqrt(0.3**2 + 0.35**2 + 0.16**2))
    assert found.loss == pytest.approx(loss, rel=0.05)
    assert (found.low, found.high) == pytest.approx((loss / reach, loss * reach), rel=0.1)
