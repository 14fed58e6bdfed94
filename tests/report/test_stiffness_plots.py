"""Pictures hold their data and say their units."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gearmon.gears.stiffness_report import stiffness_report
from gearmon.machine import Machine, OperatingPoint, ParallelStage, PlanetaryStage
from gearmon.report.expected_plots import stiffness_figure, stiffness_figures
from gearmon.report.plots import save_all

STAGE = ParallelStage(pinion_teeth=26, gear_teeth=53, module_mm=2.0, face_width_mm=20.0)

SET = PlanetaryStage(
    sun_teeth=20, planet_teeth=40, ring_teeth=100, planets=3, module_mm=1.5, face_width_mm=20.0
)


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


@pytest.fixture(scope="module")
def sheet(stage):
    """Axes of the sheet by what stands along their vertical axis."""
    return {ax.get_ylabel(): ax for ax in stiffness_figure(stage).axes}


def test_stiffness(stage, sheet):
    lines = {line.get_label(): line for line in sheet["mesh stiffness in GN/m"].lines}
    x, y = lines["healthy"].get_data()
    np.testing.assert_allclose(y, 1e-9 * stage.healthy.at(x))
    x, y = lines["damaged"].get_data()
    np.testing.assert_allclose(y, 1e-9 * stage.damaged.at(x))


def test_both_stiffnesses_are_drawn_over_the_whole_turn_of_phases(stage, sheet):
    ax = sheet["mesh stiffness in GN/m"]
    first, last = stage.phase[0], stage.phase[-1]
    assert ax.get_xlim() == pytest.approx((first, last))
    for line in ax.lines:
        x = line.get_xdata()
        assert (x[0], x[-1]) == pytest.approx((first, last), abs=0.01 * (last - first))


def test_teeth(sheet):
    ax = sheet["along the line of centres in mm"]
    assert [line.get_label() for line in ax.lines] == ["pinion", "gear", "crack", "contact"]
    assert ax.get_aspect() == 1.0


def test_flank(sheet):
    ax = sheet["above root in mm"]
    assert "pinion" in ax.get_title()
    (crack,) = ax.lines
    assert list(crack.get_xdata()) == [0.0, 20.0]


def test_shares_fill_the_whole(stage, sheet):
    ax = sheet["share of pair compliance in %"]
    assert ax.get_ylim() == (0, 100)
    top = ax.collections[-1].get_paths()[0].vertices[:, 1].max()
    assert top == pytest.approx(100)
    # the lowest band, from the first to the last contact
    (label, band), *_ = ((own.get_label(), own.get_paths()[0].vertices) for own in ax.collections)
    x, y = band[band[:, 1] > 0].T
    np.testing.assert_allclose(y, 100 * stage.shares(x)[label], rtol=1e-6)
    assert np.ptp(y) > 1


def test_size_curve(stage, sheet):
    mark = sheet["loss of pair stiffness in %"].lines[-1]
    assert mark.get_xdata()[0] == 1.5
    assert mark.get_ydata()[0] == pytest.approx(100 * stage.faults[0].loss.mean, rel=0.02)


@pytest.mark.parametrize(
    "fault",
    [
        "spall:1:gear:5:6x1.5x0.5mm",
        "pitting:1:gear:5:20%flank",
        "missing:1:pinion:3",
        "breakage:1:pinion:3:5mm,height=1",
        "wear:1:pinion:all:0.1mm",
        "crack:1:pinion:5:20%",
    ],
)
def test_sheets_of_every_kind(fault, tmp_path):
    report = stiffness_report(machine(), [fault])
    assert len(stiffness_figure(report.stages[0]).axes) >= 4
    (path,) = save_all(stiffness_figures(report), tmp_path / "sheet.svg")
    assert path.read_bytes().startswith(b"<?xml")


def test_each_stage_has_its_file(tmp_path):
    report = stiffness_report(machine(2))
    paths = save_all(stiffness_figures(report), tmp_path / "sheet.png")
    assert [path.name for path in paths] == ["sheet-stage1.png", "sheet-stage2.png"]


@pytest.mark.parametrize(
    ("stages", "names"),
    [
        ((STAGE,), [""]),
        ((STAGE, STAGE), ["-stage1", "-stage2"]),
        ((SET,), ["-stage1-sun-planet", "-stage1-planet-ring"]),
        ((STAGE, SET), ["-stage1", "-stage2-sun-planet", "-stage2-planet-ring"]),
    ],
)
def test_every_mesh_has_a_sheet_with_a_name_of_its_own(monkeypatch, stages, names):
    monkeypatch.setattr("gearmon.report.expected_plots.stiffness_figure", lambda stage: stage)
    report = stiffness_report(replace(machine(), stages=stages))
    figures = stiffness_figures(report)
    assert list(figures) == names
    assert list(figures.values()) == list(report.stages)
