"""`gearmon exposure`: tables, JSON by its schema, pictures, report, refusals, exit codes."""

from __future__ import annotations

import json
import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from gearmon.cli import main, parsed
from gearmon.demos import farm as demo
from gearmon.demos import run_demo
from gearmon.errors import ArgumentError
from gearmon.exposure import day, gearbox, measures
from gearmon.report import exposure_lines

RATE = 400.0
PLAN = """\
[[job]]
name = "ploughing"
recording = "seat.csv"
hours = 6
hours_error = 0.5
[[job]]
name = "road"
recording = ["seat.csv", "floor.csv"]
hours = 1.0
"""


@pytest.fixture(scope="module")
def farm(tmp_path_factory):
    """A folder with a seat, its floor, and the plan of a day."""
    folder, generator = tmp_path_factory.mktemp("farm"), np.random.default_rng(1)
    rows = 3.0 * generator.normal(size=(3, round(240 * RATE)))
    for name, scale in (("seat", 0.7), ("floor", 1.0)):
        written(scale * rows, folder / f"{name}.csv")
    written(np.clip(rows, -4, 4), folder / "clipped.csv")
    written(rows / 9.80665 + [[0.0], [0.0], [1.0]], folder / "in-g.csv")
    (folder / "plan.toml").write_text(PLAN)
    return folder


def written(rows, path):
    names = [f"seat_{axis} [m/s2]" for axis in "xyz"]
    frame = pd.DataFrame(dict(zip(names, rows, strict=True)))
    frame.insert(0, "time [s]", np.arange(len(frame)) / RATE)
    frame.to_csv(path, index=False, float_format="%.6g")


def run(capsys, monkeypatch, folder, *words):
    monkeypatch.chdir(folder)
    capsys.readouterr()
    try:
        code = main(["exposure", *map(str, words)])
    except SystemExit as stop:  # of the parser
        code = stop.code
    return code, *capsys.readouterr()


def test_everything_of_a_day_in_one_call(farm, tmp_path, capsys, monkeypatch, fits_schema):
    words = ["seat.csv", "--floor", "floor.csv", "--day", "plan.toml", "-o", tmp_path / "out.csv",
             "--report", tmp_path / "out.html", "--json"]  # fmt: skip
    code, out, err = run(capsys, monkeypatch, farm, *words)
    answer = json.loads(out)
    assert (code, err) == (1, "")
    fits_schema("exposure", answer)
    seat = answer["recordings"][0]
    assert seat["seat_factor"]["seat_rms"] == pytest.approx([0.7] * 3, rel=1e-3)
    a8, vdv = answer["day"]["doses"]
    expected = np.hypot(seat["value_ms2"] * np.sqrt(6 / 8), answer["day"]["jobs"][1]["a8_ms2"])
    assert a8["value"] == pytest.approx(expected, rel=1e-6)
    assert vdv["low"] < vdv["value"] < vdv["high"]
    assert a8["verdict"] == "above the action value"
    table = pd.read_csv(tmp_path / "out.csv")
    assert list(table["axis"]) == ["x", "y", "z"]
    assert {"rms_ms2", "mtvv_ms2", "vdv"} <= set(table.columns)
    for name in ("out.png", "out-day.png"):
        with Image.open(tmp_path / name) as picture:
            assert picture.size[0] > 600
    report = (tmp_path / "out.html").read_text()
    assert report.count("data:image/png") == 2
    # numbers to the right, below their headings
    for body in re.findall("<table>(.*?)</table>", report, re.S):
        heads, *rows = re.findall("<tr>(.*?)</tr>", body, re.S)
        right = [own == ' class="r"' for own in re.findall("<th([^>]*)>", heads)]
        assert rows
        assert any(right)
        assert not right[0]
        for row in rows:
            cells = re.findall("<td([^>]*)>([^<]*)", row)
            numbers = [re.fullmatch(r"[\d.e+-]+", text) is not None for _, text in cells]
            assert [own == ' class="r"' for own, _ in cells] == numbers == right
    assert all(own in report for own in ("SEAT factor", "ploughing", "above the action value"))


def commands_in_readme():
    text = (Path(__file__).resolve().parents[1] / "README.md").read_text("utf-8")
    joined = text.replace("\\\n", " ")
    return [shlex.split(line, comments=True)[1:] for line in joined.splitlines()
            if line.startswith("gearmon exposure")]  # fmt: skip


def test_the_commands_of_readme_run(farm, tmp_path, capsys, monkeypatch):
    alone, of_a_day = commands_in_readme()
    told = parsed(alone)
    assert (told.recording, told.position, told.fault) == (
        ["new.csv"], "hand", ["wear:1:pinion:all:20%"]
    )  # fmt: skip
    for name in ("seat.csv", "floor.csv"):
        (tmp_path / name).symlink_to(farm / name)
    (tmp_path / "day.toml").write_text(PLAN)
    code, out, _ = run(capsys, monkeypatch, tmp_path, *of_a_day[1:])
    assert code == 1
    assert "above the action value" in out
    assert (tmp_path / "day.html").is_file()


def test_a_terminal_is_told_what_matters(farm, capsys, monkeypatch):
    code, out, _ = run(capsys, monkeypatch, farm, "seat.csv")
    assert code == 0
    assert out.startswith("seat.csv: ")
    assert "action value of a day after" in out
    assert "VDV reaches the action value after" in out


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ([], "name recordings, or with --day"),
        (["in-g.csv"], "g were read as m/s2"),
        (["clipped.csv", "--axes", "x=seat_x,y=seat_y,z=seat_z"], "clipped"),
        (["clipped.csv"], "clipped"),
        (["seat.csv", "--axes", "x=2,y=2"], "one channel for two axes"),
        (["seat.csv", "--axes", "x=2,x=3"], "names an axis twice"),
        (["seat.csv", "--axes", "seat_x"], "must name channels as x=NAME"),
        (["seat.csv", "--position", "hand"], "counts vibration up to 1000 Hz"),
        (["seat.csv", "--range", "5"], "of the sensor's range of 5"),
        (["seat.csv", "floor.csv", "--floor", "floor.csv"], "belongs to one recording"),
        (["seat.csv", "--fault", "wear:1:pinion:all:20%"], "only with --machine"),
        (["--day", "none.toml"], "no such file"),
        (["-"], "-: no such file; name a recording, or /dev/stdin"),
        (["seat.csv", "-o", "seat.csv"], "is read as well"),
    ],
)
def test_what_is_wrong_ends_in_one_line(farm, capsys, monkeypatch, words, told):
    code, _, err = run(capsys, monkeypatch, farm, *words)
    assert code == 2
    assert told in err
    assert err.count("\n") == 1


def test_a_bad_recording_does_not_stop_the_others(farm, capsys, monkeypatch):
    code, out, err = run(capsys, monkeypatch, farm, "in-g.csv", "seat.csv", "--json")
    entries = json.loads(out)["recordings"]
    assert code == 2
    assert "error" in entries[0]
    assert entries[1]["value_ms2"] > 0
    assert err.count("\n") == 1


def test_several_recordings_stand_in_one_table_and_have_a_picture_each(
    farm, tmp_path, capsys, monkeypatch
):
    words = ["seat.csv", "floor.csv", "-o", tmp_path / "out.csv", "--json"]
    code, out, _ = run(capsys, monkeypatch, farm, *words)
    assert code == 0
    seat, floor = json.loads(out)["recordings"]
    rows = pd.read_csv(tmp_path / "out.csv")
    assert list(rows["axis"]) == 2 * ["x", "y", "z"]
    told = [axis["rms_ms2"] for own in (seat, floor) for axis in own["axes"]]
    assert list(rows["rms_ms2"]) == pytest.approx(told, rel=1e-5)
    assert seat["value_ms2"] == pytest.approx(0.7 * floor["value_ms2"], rel=1e-3)
    pictures = [(tmp_path / name).read_bytes() for name in ("out.png", "out-2.png")]
    assert pictures[0] != pictures[1]


def test_the_gearbox_is_looked_for_in_what_was_weighed(farm, tmp_path, capsys, monkeypatch):
    """Of channels and sensitivities as the machine file and --axes tell."""
    sensors = "".join(
        f"[[sensor]]\ncolumn = 'v{axis}'\nunit = 'm/s2'\nsensitivity = 0.02\n" for axis in "xyz"
    )
    stage = "[[stage]]\nkind = 'parallel'\npinion_teeth = 23\ngear_teeth = 57\n"
    (tmp_path / "m.toml").write_text(f"name = 'm'\n[operating]\nspeed_rpm = 300\n{stage}{sensors}")
    volts = pd.read_csv(farm / "seat.csv")
    volts.columns = ["time [s]", "vx", "vy", "vz"]
    volts.to_csv(tmp_path / "volts.csv", index=False)
    seen = []

    def taken(recording, exposure, *_):
        seen.append((recording, exposure))
        raise ArgumentError("volts.csv: enough")

    monkeypatch.setattr("gearmon.gear_share", taken)
    words = ["volts.csv", "--machine", "m.toml", "--axes", "x=vy,z=vz"]
    assert run(capsys, monkeypatch, tmp_path, *words)[0] == 2
    ((recording, exposure),) = seen
    assert recording.channel_names == ("vy", "vz")
    samples = recording.samples
    np.testing.assert_allclose(samples, volts[["vy", "vz"]].to_numpy().T / 0.02, rtol=1e-9)
    (x, z) = exposure.axes
    assert (x.channel, z.channel) == ("vy", "vz")


def test_results_are_like_the_others(farm):
    felt = measures.vibration_exposure(str(farm / "seat.csv"))
    found = day.exposure_day(farm / "plan.toml")
    lines = gearbox.LineShare(name="mesh 1", frequency_hz=500.0, weighted_ms2=(0.1, 0.2, 0.1),
                              share=(0.1, 0.2, 0.3))  # fmt: skip
    share = gearbox.GearShare(
        recording="a.csv", machine="m", speed_hz=25.0, axes=("x", "y", "z"), share=(0.1, 0.2, 0.3),
        lines=(lines,), faults=(), points=(), warnings=(),
    )  # fmt: skip
    shafts = replace(lines, name="shaft 1", share=(0.25, 0.1, 0.0))
    bars = np.array(
        [
            [(bar.get_x(), bar.get_width()) for bar in own]
            for own in replace(share, lines=(shafts, lines)).plot().containers
        ]
    )
    # in per cent, one behind the other, and the rest of what is felt behind them
    parts = [[25.0, 10.0, 0.0], [10.0, 20.0, 30.0], [65.0, 70.0, 70.0]]
    np.testing.assert_allclose(bars[..., 1], parts)
    np.testing.assert_allclose(bars[..., 0], np.cumsum([[0.0] * 3, *parts], axis=0)[:-1])
    for result in (felt, found, share, measures.seat_factor(felt, felt)):
        assert len(repr(result)) < 500
        assert len(result.to_frame()) > 0
        assert json.loads(json.dumps(result.to_dict(), allow_nan=False))
    for result in (felt, found, share):
        first = np.ravel(result.plot())[0]
        assert first.get_xlabel() or first.get_ylabel()
    bands, course = felt.plot()
    assert len(bands.get_lines()) == 6
    assert len(course.get_lines()) == 4
    drawn = [line.get_ydata() for line in bands.get_lines()]
    for number in range(3):
        np.testing.assert_array_equal(drawn[2 * number], felt.weighted_band_ms2[number])
        np.testing.assert_array_equal(drawn[2 * number + 1], felt.band_ms2[number])
        assert bands.get_lines()[2 * number].get_linestyle() == "-"
    told = "\n".join(exposure_lines(felt))
    for name, said in (
        ("action_ms2", "A(8) reaches the action"),
        ("action_vdv", "VDV reaches the action"),
    ):
        (hours,) = re.findall(rf"{re.escape(said)} value after (\S+) h", told)
        assert float(hours) == pytest.approx(felt.times_s()[name] / 3600, rel=5e-3)
    assert "hours of work" in found.plot()[-1].get_xlabel()


def test_the_demo_sums_up_a_day(tmp_path, monkeypatch):
    monkeypatch.setattr(demo, "LEVER_S", 3.0)
    told = run_demo("exposure", tmp_path / "demo")
    a8, vdv = told.facts["day"]["doses"]
    assert a8["low"] < 0.5 < a8["high"]
    assert a8["verdict"] == vdv["verdict"] == "may be above the action value"
    assert 0 < max(told.facts["gearbox"]["share"]) < 1
    assert all(own["damaged_ms2"] > own["value_ms2"] for own in told.facts["gearbox"]["points"])
    assert len(told.facts["pictures"]) == 3
    assert told.files["report"].is_file()
    assert any(line.startswith("day of 6.5 h") for line in told.lines())
