"""Results as people meet them: short texts, frames with units, built-in types, pictures, JSON."""

from __future__ import annotations

import json
from functools import cache
from importlib import resources

import numpy as np
import pytest
from reference.small_gearbox import CRACK, machine, simulated

import gearmon
from gearmon.cli import main


@cache
def results():
    """A result of every public function that is quick."""
    healthy = [gearmon.read_recording(simulated(load=load, seed=3)) for load in (0.7, 1.0)]
    reference = gearmon.learn(healthy, machine())
    new = gearmon.read_recording(simulated(CRACK))
    analysis = gearmon.analyse(new, machine(), reference)
    orders = gearmon.order_spectra(new, machine())
    track = analysis.signature.track
    return {
        "machine": machine(),
        "recording": new,
        "simulated": simulated(CRACK),
        "reference": reference,
        "analysis": analysis,
        "flag": analysis.flags[0],
        "signature": analysis.signature,
        "orders": orders,
        "map": orders.map,
        "spectrum": gearmon.recording_spectrum(new),
        "averages": gearmon.gear_averages(new, machine(), signature=analysis.signature),
        "average": gearmon.time_synchronous_average(new.samples[:1], 10_000.0, track),
        "indicators": gearmon.indicator_table(new, machine()),
        "expected": gearmon.expected_signature(machine()),
        "family": gearmon.fault_family(machine(), kinds=["crack"], sizes=["20%"]),
        "response": gearmon.loss_response(machine(), 1, "pinion"),
    }


NAMES = (
    *("machine", "recording", "simulated", "reference", "analysis", "flag", "signature", "orders"),
    *("map", "spectrum", "averages", "average", "indicators", "expected", "family", "response"),
)


@pytest.mark.parametrize("name", NAMES)
def test_every_result_has_a_short_text_a_frame_and_built_in_types(name):
    result = results()[name]
    assert len(repr(result)) < 500
    assert repr(result).startswith(type(result).__name__)
    assert "\n" not in repr(result)
    frame = result.to_frame()
    assert len(frame) > 0
    assert frame.columns.is_unique
    assert json.loads(json.dumps(result.to_dict()))
    shown = result._repr_html_()
    assert "<table" in shown
    assert "<script" not in shown


def test_frames_name_their_units():
    assert "a1 [m/s2]" in results()["orders"].to_frame().columns
    assert "a1 [m/s2]" in results()["spectrum"].to_frame().columns
    again = gearmon.read_recording(results()["recording"].to_frame())
    assert again.units[:2] == ("m/s2", "m/s2")
    np.testing.assert_allclose(again.samples, results()["recording"].samples)


def test_a_frame_of_an_analysis_has_a_row_a_flag():
    analysis = results()["analysis"]
    frame = analysis.to_frame()
    assert len(frame) == len(analysis.flags)
    assert frame["verdict"][0] == "fault"
    assert frame["tooth"][0] == analysis.flags[0].tooth
    assert analysis.headline() in analysis._repr_html_().replace("&#x27;", "'")


@pytest.mark.parametrize("name", ["orders", "spectrum", "averages", "indicators", "analysis"])
def test_pictures_are_drawn_and_their_axes_returned(name):
    axes = results()[name].plot()
    if isinstance(axes, dict):
        kind = next(iter(axes))
        chosen = results()[name].plot(kind=kind)
        assert np.size(chosen) == np.size(axes[kind])
        axes = axes[kind]
    first = np.ravel(axes)[0]
    assert first.get_ylabel() or first.get_xlabel() or first.get_title("left")


def test_pictures_go_on_axes_that_are_given():
    from matplotlib.figure import Figure

    one, two = Figure().subplots(2)
    assert results()["orders"].plot(one) is one
    assert "Order" in one.get_xlabel()
    assert one.get_ylabel() == "Peak amplitude, a1 (m/s²)"
    results()["spectrum"].plot([one, two])
    with pytest.raises(gearmon.GearmonError, match="arranges its axes itself; leave ax out"):
        results()["indicators"].plot(one)
    with pytest.raises(gearmon.GearmonError, match="Recording has no picture"):
        results()["recording"].plot()
    with pytest.raises(gearmon.GearmonError, match="kind='turn' is not one of"):
        results()["analysis"].plot(kind="turn")


def test_a_machine_is_made_again_of_its_dictionary():
    again = gearmon.load_machine(machine().to_dict())
    assert again.stages == machine().stages
    assert again.operating == machine().operating


_GIVEN = ["--machine", "machine.toml"]
COMMANDS = {
    "analyse": ["new.csv", "letter.txt", "--reference", "healthy.ref", *_GIVEN],
    "learn": ["healthy-0.csv", "-o", "again.ref", *_GIVEN],
    "check": ["healthy.ref", *_GIVEN],
    "history": ["new.csv", "--times", "2026-03-01", "--reference", "healthy.ref", *_GIVEN],
    "indicators": ["new.csv", *_GIVEN],
    "spectrum": ["new.csv", *_GIVEN],
    "orders": ["new.csv", *_GIVEN],
    "fleet": ["run", "fleet.toml"],
    "init": ["--teeth", "23/57", "--speed", "1480rpm", "-o", "mine.toml"],
    "lines": ["machine.toml"],
    "stiffness": ["machine.toml"],
    "baseline": ["machine.toml"],
    "family": ["machine.toml", "--kind", "eccentricity", "--size", "20um"],
    "stability": ["machine.toml"],
    "simulate": ["machine.toml", "--seed", "1", "-o", "made.csv"],
}


@pytest.mark.parametrize("command", COMMANDS)
def test_json_is_as_its_schema_says(shop, tmp_path, monkeypatch, capsys, command):
    jsonschema = pytest.importorskip("jsonschema")
    for path in shop.iterdir():
        (tmp_path / path.name).symlink_to(path)
    monkeypatch.chdir(tmp_path)
    main([command, *COMMANDS[command], "--json"])
    answer = json.loads(capsys.readouterr().out)
    shipped = resources.files("gearmon.commands").joinpath("schemas.json").read_text("utf-8")
    schema = json.loads(shipped)
    jsonschema.Draft202012Validator.check_schema(schema)
    assert set(COMMANDS) <= set(schema["$defs"])
    jsonschema.validate(answer, schema | {"$ref": f"#/$defs/{command}"})
    broken = {name: own for name, own in answer.items() if name != "schema"}
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(broken, schema | {"$ref": f"#/$defs/{command}"})


def test_features_of_analyses_go_into_a_pipeline():
    from sklearn.linear_model import LogisticRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    frame = gearmon.features([results()["analysis"]] * 2, results()["reference"])
    assert frame.index.names == ["recording", "stage", "gear"]
    assert len(frame) == 2 * len(results()["signature"].plan.wheels)
    assert np.isfinite(frame.to_numpy()).all()
    cracked = frame.index.get_level_values("gear") == results()["flag"].gear
    pipeline = make_pipeline(StandardScaler(), LogisticRegression()).fit(frame, cracked)
    assert list(pipeline.predict(frame)) == list(cracked)
    assert pipeline.feature_names_in_[0] == "mesh_db"
    alone = gearmon.features(results()["analysis"])
    assert list(alone.columns) == list(frame.columns)
