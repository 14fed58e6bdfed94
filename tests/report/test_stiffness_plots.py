"""Pictures hold their data and say their units."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from gearmon.gears.stiffness_report import stiffness_report
from gearmon.machine import Machine, OperatingPoint, ParallelStage
from gearmon.report.stiffness_plots import (
    plot_compliance_shares,
    plot_flank,
    plot_size_curve,
    plot_stiffness,
    plot_teeth,
    save_stiffness_figures,
    stiffness_figure,
)

STAGE = ParallelStage(pinion_teeth=26, gear_teeth=53, module_mm=2.0, face_width_mm=20.0)


def machine(stages=1):
    return Machine(
        name="rig",
        operating=(OperatingPoint(speed_rpm=1460.0, torque_nm=98.0),),
        stages=(STAGE,) * stages,
        bearings=(),
        sensors=(),
        path="rig.toml",
    )


@pytest.fixture(scope="module")
def stage():
    (found,) = stiffness_report(machine(), ["crack:1:pinion:5:1.5mm"]).stages
    return found


@pytest.fixture
def ax():
    return Figure().add_subplot()


def test_stiffness(stage, ax):
    assert plot_stiffness(stage, ax) is ax
    lines = {line.get_label(): line for line in ax.lines}
    x, y = lines["healthy"].get_data()
    np.testing.assert_allclose(y, 1e-9 * stage.healthy.at(x))
    x, y = lines["damaged"].get_data()
    np.testing.assert_allclose(y, 1e-9 * stage.damaged.at(x))
    assert ax.get_ylabel() == "mesh stiffness in GN/m"


def test_teeth(stage, ax):
    plot_teeth(stage.picture, ax)
    labels = [line.get_label() for line in ax.lines]
    assert labels == ["pinion", "gear", "crack", "contact"]
    assert ax.get_aspect() == 1.0
    assert ax.get_xlabel().endswith("in mm")


def test_flank(stage, ax):
    plot_flank(stage.picture, "pinion", ax)
    assert "pinion" in ax.get_title()
    (crack,) = ax.lines
    assert list(crack.get_xdata()) == [0.0, 20.0]


def test_shares_fill_the_whole(stage, ax):
    plot_compliance_shares(stage, ax)
    assert ax.get_ylim() == (0, 100)
    top = ax.collections[-1].get_paths()[0].vertices[:, 1].max()
    assert top == pytest.approx(100)


def test_size_curve(stage, ax):
    plot_size_curve(stage.curve, ax)
    assert ax.get_xlabel() == "depth of the root crack (pinion) in mm"
    mark = ax.lines[-1]
    assert mark.get_xdata()[0] == 1.5
    assert mark.get_ydata()[0] == pytest.approx(100 * stage.faults[0].loss.mean, rel=0.02)


@pytest.mark.parametrize(
    "fault",
    [
        "spall:1:gear:5:6x1.5x0.5mm",
        "pitting:1:gear:5:2level",
        "missing:1:pinion:3",
        "breakage:1:pinion:3:5mm,height=1",
        "wear:1:pinion:all:0.1mm",
        "crack:1:pinion:5:20%",
    ],
)
def test_sheets_of_every_kind(fault, tmp_path):
    report = stiffness_report(machine(), [fault], points_per_mesh=20)
    assert len(stiffness_figure(report.stages[0]).axes) >= 4
    (path,) = save_stiffness_figures(report, tmp_path / "sheet.svg")
    assert path.read_bytes().startswith(b"<?xml")


def test_each_stage_has_its_file(tmp_path):
    report = stiffness_report(machine(2), points_per_mesh=20)
    paths = save_stiffness_figures(report, tmp_path / "sheet.png")
    assert [path.name for path in paths] == ["sheet-stage1.png", "sheet-stage2.png"]
