"""The sheet of the four forms: a curve and a spectrum of each, with units."""

from __future__ import annotations

import numpy as np
import pytest

from gearmon.gears.stiffness_report import FOUR_FORMS, compare_forms
from gearmon.machine import Machine, OperatingPoint, ParallelStage
from gearmon.report.expected_plots import form_figure

POINT = OperatingPoint(speed_rpm=1460.0, torque_nm=98.12)
STAGE = ParallelStage(
    pinion_teeth=26, gear_teeth=53, module_mm=2.0, face_width_mm=20.0, contact_ratio=1.412
)


@pytest.fixture(scope="module")
def comparison():
    return compare_forms(Machine(name="box", operating=(POINT,), stages=(STAGE,)))


GROUPS = list(dict.fromkeys(name.split("-")[0] for name in FOUR_FORMS))


@pytest.mark.parametrize("group", GROUPS)
def test_curves_and_lines_of_a_form(comparison, group):
    row = GROUPS.index(group)
    left, right = form_figure(comparison).axes[2 * row : 2 * row + 2]
    assert left.get_ylabel() == "stiffness in GN/m"
    assert right.get_ylabel() == "amplitude in MN/m"
    own = [curve for curve in comparison.forms if curve.form.name.split("-")[0] == group]
    phase = np.arange(401) / 200
    drawn = left.lines[-len(own) :]
    for curve, line in zip(own, drawn, strict=True):
        np.testing.assert_allclose(line.get_ydata(), 1e-9 * curve.at(phase))
    for curve, line in zip(own, right.lines, strict=True):
        np.testing.assert_allclose(line.get_ydata(), 1e-6 * curve.mesh_amplitudes(20))
