"""Results as people meet them: short texts, frames with units, built-in types, pictures, JSON."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from inspect import isfunction, signature

import numpy as np
import pytest
from reference.drawn_extent import badly_filled
from reference.small_gearbox import CRACK, machine, simulated

import gearmon
from gearmon.cli import COMMANDS as ALL
from gearmon.cli import main
from gearmon.exposure import DayPlan, Job, sum_up
from gearmon.harvesting import InertialHarvester, vibration_of_lines
from gearmon.report.survey_text import exposure_lines
from gearmon.result import Result


@cache
def results():
    """A result of every public function that returns one."""
    healthy = [gearmon.read_recording(simulated(load=load, seed=3)) for load in (0.7, 1.0)]
    reference = gearmon.learn(healthy, machine())
    new = gearmon.read_recording(simulated(CRACK))
    analysis = gearmon.analyse(new, machine(), reference)
    orders = gearmon.order_spectra(new, machine())
    track, samples = analysis.signature.track, new.samples[:1]
    felt = gearmon.vibration_exposure(new, "hand", {"x": "a1", "y": "a2"})
    job = Job(name="mowing", recording="mowing.csv", hours=2.0)
    spring = InertialHarvester(
        mass_kg=5e-3, natural_frequency_hz=600.0, lowest_hz=500.0, highest_hz=700.0
    )
    shaken = vibration_of_lines([600.0], acceleration_ms2=[2.0])
    return {
        "machine": machine(),
        "recording": new,
        "simulated": simulated(CRACK),
        "reference": reference,
        "check": gearmon.check_reference(reference, machine()),
        "analysis": analysis,
        "flag": analysis.flags[0],
        "signature": analysis.signature,
        "orders": orders,
        "map": orders.map,
        "waveform": gearmon.angular_waveform(samples, 10_000.0, track, per_turn=64),
        "spectrum": gearmon.recording_spectrum(new),
        "averages": gearmon.gear_averages(new, machine(), signature=analysis.signature),
        "average": gearmon.time_synchronous_average(samples, 10_000.0, track),
        "indicators": gearmon.indicator_table(new, machine()),
        "expected": gearmon.expected_signature(machine()),
        "family": gearmon.fault_family(machine(), kinds=["crack"], sizes=["20%"]),
        "response": gearmon.loss_response(machine(), 1, "pinion"),
        "modes": gearmon.modes(machine()),
        "tuned": gearmon.tune_harvester(spring, shaken),
        "exposure": felt,
        "day": sum_up(DayPlan(jobs=(job,), position="hand"), [[felt]]),
        "gear share": gearmon.gear_share(new, felt, machine()),
        "seat factor": gearmon.seat_factor(felt, felt),
        "weighting": gearmon.frequency_weighting("Wk"),
    }


NAMES = (
    *("machine", "recording", "simulated", "reference", "check", "analysis", "flag", "signature"),
    *("orders", "map", "waveform", "spectrum", "averages", "average", "indicators", "expected"),
    *("family", "response", "modes", "tuned", "exposure", "day", "gear share", "seat factor"),
    "weighting",
)
#: Those that a command draws.
DRAWN = {
    *("analysis", "orders", "spectrum", "averages", "indicators", "family", "modes"),
    *("exposure", "day", "gear share", "expected"),
}


def test_the_table_holds_a_result_of_every_public_function():
    made = {type(own).__name__ for own in results().values()}
    known = {own.__name__ for own in Result.__subclasses__()}
    assert set(NAMES) == set(results())
    functions = [own for name in gearmon.__all__ if isfunction(own := getattr(gearmon, name))]
    given = {str(signature(own).return_annotation).partition("[")[0] for own in functions}
    assert given & known <= made
    assert len(given & known) > 15


@pytest.mark.parametrize("name", NAMES)
def test_every_result_has_a_short_text_a_frame_and_built_in_types(name, tmp_path):
    result = results()[name]
    assert len(repr(result)) < 500
    assert repr(result).startswith(type(result).__name__)
    assert "\n" not in repr(result)
    frame = result.to_frame()
    assert len(frame) > 0
    assert frame.columns.is_unique
    # what has several values has no place in a cell
    if not hasattr(result, "rows"):
        assert not any(isinstance(cell, list | dict) for cell in frame.to_numpy().ravel())
    assert json.loads(json.dumps(result.to_dict()))
    shown = result._repr_html_()
    assert "<table" in shown
    assert "<script" not in shown
    for ending in (".csv", ".json"):
        (path,) = result.save(tmp_path / f"result{ending}")
        assert path.stat().st_size > 0


def otherwise(own, told, place=()):
    """Where built-in types tell a field of a result, or of what it holds, otherwise than it is."""
    if isinstance(told, dict) and not isinstance(own, dict):
        known = {key: getattr(own, key) for key in told if hasattr(own, key)}
        for key, value in known.items():
            yield from otherwise(value, told[key], (*place, key))
    elif isinstance(told, list) and isinstance(own, list | tuple) and len(told) == len(own):
        for number, (value, one) in enumerate(zip(own, told, strict=True)):
            yield from otherwise(value, one, (*place, number))
    elif isinstance(own, str | int | float):
        # JSON has no number for what is not finite
        finite = isinstance(own, str) or math.isfinite(own)
        if told != own if finite else told not in (None, str(own)):
            yield place, own, told


@pytest.mark.parametrize("name", NAMES)
def test_what_is_called_like_a_field_is_told_as_the_field_is(name):
    result = results()[name]
    assert list(otherwise(result, result.to_dict())) == []


@pytest.mark.parametrize("name", NAMES)
def test_pictures_are_drawn_and_their_axes_returned(name):
    result = results()[name]
    assert bool(result.picture) == (name in DRAWN)
    if name not in DRAWN:
        with pytest.raises(gearmon.GearmonError, match=f"{type(result).__name__} has no picture"):
            result.plot()
        return
    axes = result.plot()
    if isinstance(axes, dict):
        kind = next(iter(axes))
        # as they are called: the dash belongs to the name of a file
        assert {own.lstrip("-") for own in result.figures()} == set(axes)
        assert np.size(result.plot(kind=kind)) == np.size(axes[kind])
        axes = axes[kind]
    first = np.ravel(axes)[0]
    assert badly_filled(first.get_figure()) == []
    if name == "modes":
        # mesh harmonics end in the corner, whatever natural frequencies there are
        assert badly_filled(first.get_figure(), 0.99, across=False) == []
    assert first.get_ylabel() or first.get_xlabel() or first.get_title("left")


@pytest.mark.parametrize("name", ["exposure", "gear share"])
def test_notes_of_an_exposure_cannot_steer_the_terminal(name):
    noted = replace(results()[name], warnings=("channel a\x1b[2Jb",))
    lines = exposure_lines(noted)
    assert any("[2Jb" in line for line in lines)
    assert all(line.isprintable() for line in lines)


def test_a_short_text_shows_short_fields_and_counts_long_ones():
    @dataclass(frozen=True, kw_only=True)
    class Lines(Result):
        few: tuple[int, ...]
        many: tuple[int, ...]
        size: float

    text = repr(Lines(few=(1, 2), many=tuple(range(100)), size=1 / 3))
    assert text == "Lines(few=(1, 2), many=<100>, size=0.333333)"


def test_what_a_result_holds_comes_in_built_in_types_from_which_it_can_be_made_again():
    @dataclass(frozen=True, kw_only=True)
    class Held(Result):
        lines: np.ndarray
        line: complex
        number: np.float64
        names: frozenset[str]
        inner: dict[int, tuple[np.ndarray, ...]]

    lines = np.array([[1.0 + 2.0j, 3.0], [0.0, -4.0j]])
    held = Held(
        lines=lines,
        line=5.0 - 6.0j,
        number=np.float64(0.1),
        names=frozenset({"a"}),
        inner={1: (np.arange(3),)},
    )
    told = json.loads(json.dumps(held.to_dict()))
    again = np.array(told["lines"]["real"]) + 1j * np.array(told["lines"]["imag"])
    assert np.array_equal(again, lines)
    assert told["line"] == {"real": 5.0, "imag": -6.0}
    assert (told["number"], told["names"]) == (0.1, ["a"])
    assert told["inner"] == {"1": [[0, 1, 2]]}


def test_the_result_itself_is_no_option_of_its_picture():
    family = results()["family"]
    for word in ("family", "found"):
        with pytest.raises(gearmon.GearmonError, match=f"plot option '?{word}"):
            family.plot(**{word: family})


def test_what_is_saved_is_read_again(tmp_path):
    for name, read in (
        ("reference", gearmon.read_reference),
        ("expected", gearmon.read_signature),
        ("recording", gearmon.read_recording),
        ("simulated", gearmon.read_recording),
    ):
        result, suffix = results()[name], ".ref" if name == "reference" else ".csv"
        (path,) = result.save(tmp_path / f"{name}{suffix}")
        assert type(read(path)) is type(read(result) if name == "simulated" else result)
    # pictures in every format, and nothing in another
    for ending, begin in ((".png", b"\x89PNG"), (".svg", b"<?xml"), (".pdf", b"%PDF")):
        (path,) = results()["modes"].save(tmp_path / f"modes{ending}")
        assert path == tmp_path / f"modes{ending}"
        assert path.read_bytes().startswith(begin)
    with pytest.raises(gearmon.GearmonError, match=r"ending of path='.jpg' is not one of .csv"):
        results()["modes"].save(tmp_path / "modes.jpg")
    with pytest.raises(gearmon.GearmonError, match=r"ending of path=.*xlsx"):
        results()["orders"].save(tmp_path / "orders.xlsx")


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


def test_pictures_go_on_axes_that_are_given():
    from matplotlib.figure import Figure

    one, two = Figure().subplots(2)
    assert results()["orders"].plot(one) is one
    assert "Order" in one.get_xlabel()
    assert one.get_ylabel() == "Peak amplitude, a1 (m/s²)"
    results()["spectrum"].plot([one, two])
    with pytest.raises(gearmon.GearmonError, match="arranges its axes itself; leave ax out"):
        results()["indicators"].plot(one)
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
    "harvest": ["machine.toml", "--path-gain", "0.1"],
    "benchmark": ["stress", "--quick", "--count", "3"],
    "simulate": ["machine.toml", "--seed", "1", "-o", "made.csv"],
}


@pytest.mark.parametrize("command", COMMANDS)
def test_json_is_as_its_schema_says(shop, tmp_path, monkeypatch, capsys, fits_schema, command):
    for path in shop.iterdir():
        (tmp_path / path.name).symlink_to(path)
    monkeypatch.chdir(tmp_path)
    main([command, *COMMANDS[command], "--json"])
    fits_schema(command, json.loads(capsys.readouterr().out))


def test_every_command_has_a_schema():
    shipped = resources.files("gearmon.commands").joinpath("schemas.json").read_text("utf-8")
    assert {own.name for own in ALL} <= set(json.loads(shipped)["$defs"])


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


def test_a_table_is_safe_to_open_and_json_has_numbers_only(tmp_path):
    """What a spreadsheet would run is quoted; what is infinite or no number is null or empty."""

    @dataclass(frozen=True)
    class Odd(Result):
        name: str
        value: float
        open_: float

    odd = Odd("=1+1", math.nan, math.inf)
    (path,) = odd.save(tmp_path / "odd.csv")
    assert path.read_text().splitlines() == ["name,value,open_", "'=1+1,,inf"]
    (path,) = odd.save(tmp_path / "odd.json")
    told = json.loads(path.read_text())
    assert told == {"schema": "gearmon/1", "name": "=1+1", "value": None, "open_": None}
