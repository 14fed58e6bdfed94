"""Tables of mesh stiffness of a machine, and the pictures' data."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from gearmon.errors import ArgumentError
from gearmon.gears.faults import parse_fault
from gearmon.gears.pairs import mesh_pairs
from gearmon.gears.stiffness_report import size_curve, stiffness_report
from gearmon.gears.tooth_pairs import teeth_of
from gearmon.machine import Machine, OperatingPoint, ParallelStage, PlanetaryStage

STAGE = ParallelStage(
    pinion_teeth=26,
    gear_teeth=53,
    module_mm=2.0,
    face_width_mm=20.0,
    bore_diameter_pinion_mm=20.8,
    bore_diameter_gear_mm=42.4,
)


def machine(*stages):
    return Machine(
        name="rig",
        operating=(OperatingPoint(speed_rpm=1460.0, torque_nm=98.0),),
        stages=stages or (STAGE,),
        bearings=(),
        sensors=(),
        path="rig.toml",
    )


def test_healthy_table_is_one_mesh_period():
    report = stiffness_report(machine())
    rows = report.rows()
    assert len(rows) == 201
    assert rows[0]["healthy_n_per_m"] == rows[0]["damaged_n_per_m"]
    assert (rows[0]["mesh_phase"], rows[-1]["mesh_phase"]) == (0.0, 1.0)
    (stage,) = report.stages
    assert stage.curve.fault.kind == "crack"
    assert stage.curve.fault.size == 0


def test_damaged_table_shows_the_contact_of_the_tooth():
    report = stiffness_report(machine(), ["crack:1:pinion:5:1.5mm"])
    (stage,) = report.stages
    phase = np.array([row["mesh_phase"] for row in report.rows()])
    lost = np.array([row["healthy_n_per_m"] - row["damaged_n_per_m"] for row in report.rows()])
    assert (phase[0], phase[-1]) == (3.0, 7.0)
    assert (phase[lost > 1].min(), phase[lost > 1].max()) == pytest.approx((4.0, 5.69), abs=0.03)
    assert stage.curve.fault.size == 1.5
    assert stage.drawn == (parse_fault("crack:1:pinion:5:1.5mm"),)


def test_report_is_json():
    report = stiffness_report(machine(), ["crack:1:pinion:5:20%", "missing:1:gear:3"])
    text = json.dumps(report.to_dict())
    found = json.loads(text)["stages"][0]
    crack, missing = found["faults"]
    assert crack["mean_loss"] == pytest.approx(0.2)
    # the crack that costs as much, in mm
    size = float(crack["size"].removesuffix("mm"))
    back = stiffness_report(machine(), [f"crack:1:pinion:5:{size}mm"]).stages[0].faults[0]
    assert back.loss.mean == pytest.approx(0.2, rel=0.01)
    assert missing["size"] == "whole tooth"
    assert found["form"] == "potential-energy"
    assert sum(found["compliance_shares_at_middle"].values()) == pytest.approx(1)


@pytest.mark.parametrize("form", ["parabolic", "fourier"])
def test_other_forms(form):
    report = stiffness_report(machine(), ["pitting:1:gear:3:2level"], form=form)
    assert report.to_dict()["stages"][0]["form"] == form
    assert report.stages[0].curve.fault.unit == "flank"


def test_stages_can_be_chosen():
    two = machine(STAGE, replace(STAGE, pinion_teeth=20))
    assert [s.stage for s in stiffness_report(two).stages] == [1, 2]
    assert [s.stage for s in stiffness_report(two, stage=2).stages] == [2]
    with pytest.raises(ArgumentError, match=r"stage=3 must lie in \[1, 2\]"):
        stiffness_report(two, stage=3)
    with pytest.raises(ArgumentError, match="stage 4 does not exist, the machine has 2"):
        stiffness_report(two, ["crack:4:pinion:5:1mm"])


PLANETARY = PlanetaryStage(
    sun_teeth=20, planet_teeth=40, ring_teeth=100, planets=4, module_mm=1.0, face_width_mm=10.0
)


def test_planetary_stage_shows_both_of_its_meshes():
    inner, outer = stiffness_report(machine(PLANETARY)).stages
    assert (inner.mesh, outer.mesh) == ("sun-planet", "planet-ring")
    assert any("bore_diameter_sun_mm" in text for text in inner.warnings)
    assert {row["mesh"] for row in stiffness_report(machine(PLANETARY)).rows()} == {
        "sun-planet",
        "planet-ring",
    }


@pytest.mark.parametrize(
    ("gear", "meshes"), [("sun", (True, False)), ("planet", (True, False)), ("ring", (False, True))]
)
def test_damage_is_shown_in_the_meshes_of_its_gear(gear, meshes):
    fault = f"crack:1:{gear}:4:0.6mm"
    for stage, hurt in zip(
        stiffness_report(machine(PLANETARY), [fault]).stages, meshes, strict=True
    ):
        assert (len(stage.faults) == 1) is hurt
        lower = stage.damaged.at(stage.phase) < 0.999 * stage.healthy.at(stage.phase)
        assert lower.any() == hurt
        assert stage.phase[0] == (2.0 if hurt else 0.0)


def test_overrides_alone_give_a_table_without_a_picture():
    stage = ParallelStage(
        pinion_teeth=26, gear_teeth=53, mesh_stiffness_n_per_m=8e8, contact_ratio=1.412
    )
    (found,) = stiffness_report(machine(stage), form="parabolic").stages
    assert found.teeth is None
    assert found.shares(0.5) == {}
    assert any("module_mm is missing" in text for text in found.warnings)
    with pytest.raises(ArgumentError, match="module_mm is missing"):
        stiffness_report(machine(stage))


def test_one_tooth_of_each_gear_is_drawn_and_losses_as_sizes():
    faults = ["crack:1:pinion:5:20%", "wear:1:gear:all:0.1mm", "pitting:1:pinion:7:10%flank"]
    (stage,) = stiffness_report(machine(), faults).stages
    crack, worn = stage.drawn
    assert (crack.unit, crack.tooth, str(worn)) == ("mm", 5, faults[1])
    assert stage.faults[0].measured.startswith(f"{crack.size:.3g}")
    twice = ["crack:1:pinion:5:1mm", "crack:1:pinion:5:20%"]
    assert [str(f) for f in stiffness_report(machine(), twice).stages[0].drawn] == twice[:1]


def test_size_curve_rises():
    pair = teeth_of(mesh_pairs(STAGE)[0])
    curve = size_curve(parse_fault("crack:1:gear:5:1mm"), pair, 1)
    assert curve.mean_loss[0] == 0
    assert (np.diff(curve.mean_loss) > 0).all()
    assert (curve.greatest_loss >= curve.mean_loss).all()
    level = parse_fault("pitting:1:gear:5:2level")
    with pytest.raises(ArgumentError, match=r"size = 0.0 must lie in \[1, 3\]"):
        size_curve(level, pair, 1)
