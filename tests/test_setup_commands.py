"""`gearmon init` catches what is easily mistaken; `gearmon check` says what a reference lacks."""

from __future__ import annotations

import json
import re

import pytest
from reference.small_gearbox import machine, simulated

import gearmon
from gearmon.cli import main
from gearmon.diagnosis.reference_check import CheckedRecording, _missing_loads

TOLD = ["--teeth", "23/57", "--speed", "2960rpm"]


def init(tmp_path, *words):
    return main(["init", *map(str, words), "-o", str(tmp_path / "mine.toml")])


def test_init_writes_a_machine_file_that_loads(tmp_path, capsys):
    assert init(tmp_path, *TOLD, "--module", "2.5", "--face-width", "28", "--torque", "120") == 0
    made = gearmon.load_machine(tmp_path / "mine.toml")
    assert made.stages == machine().stages
    assert made.operating == machine().operating
    assert "meshes at nominal speed: 1135 Hz" in capsys.readouterr().out
    assert (tmp_path / "mine.toml").read_text().count("#") > 2


@pytest.mark.parametrize("name", ['a "quoted" one', "back\\slash", "Mähdrescher 😀"])
def test_init_keeps_any_name_of_one_line(tmp_path, name):
    assert init(tmp_path, *TOLD, "--name", name) == 0
    assert gearmon.load_machine(tmp_path / "mine.toml").name == name


def test_what_is_not_known_is_left_as_a_remark(tmp_path):
    assert init(tmp_path, "--teeth", "30/35/100x3", "--teeth", "20/40", "--speed", "24.5hz") == 0
    made = gearmon.load_machine(tmp_path / "mine.toml")
    assert [stage.kind for stage in made.stages] == ["planetary", "parallel"]
    assert made.operating[0].speed_rpm == 1470.0
    assert made.stages[1].module_mm is None
    assert "# module_mm = 2.5" in (tmp_path / "mine.toml").read_text()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--teeth", "23/57", "--speed", "24.7"], "write 24.7hz if it is in Hz (1482 1/min)"),
        (["--teeth", "23/57", "--speed", "fast"], "must be a number with its unit: 1480rpm"),
        (["--teeth", "23", "--speed", "1480"], "--teeth 23: must be driver/driven, such as 23/57"),
        (["--teeth", "2/57", "--speed", "1480"], "pinion_teeth = 2 must lie in [5, 2000]"),
        (["--speed", "1480"], "init: --teeth is missing"),
        ([*TOLD, "--name", "two\nlines"], "must be one line of text in quotes"),
        ([*TOLD, "--name", "d\x7fel"], "must be one line of text in quotes"),
    ],
)
def test_init_refuses_what_cannot_be(tmp_path, capsys, words, said):
    assert init(tmp_path, *words) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "mine.toml").exists()


@pytest.mark.parametrize(
    ("teeth", "said"),
    [
        ("57/23", "57 teeth drive 23: it speeds up by 2.48; if it slows down, swap them"),
        ("17/570", "a ratio of 33.5 is more than one stage usually has"),
        ("570/17", "a ratio of 33.5 is more than one stage usually has"),
    ],
)
def test_init_says_what_looks_mistaken(tmp_path, capsys, teeth, said):
    assert init(tmp_path, "--teeth", teeth, "--speed", "1480") == 0
    assert said in capsys.readouterr().out


def test_init_describes_the_columns_of_a_recording(tmp_path, shop):
    assert init(tmp_path, shop / "new.csv", *TOLD) == 0
    sensors = gearmon.load_machine(tmp_path / "mine.toml").sensors
    assert [own.kind for own in sensors] == ["vibration", "vibration", "tacho"]
    found = gearmon.read_recording(shop / "new.csv", sensors=sensors)
    assert found.units == gearmon.read_recording(shop / "new.csv").units


def test_init_asks_for_unit_and_shaft_of_a_column_of_speed(tmp_path):
    rows = "\n".join(f"{k % 7 - 3},{1480 + k % 3},{50 + k % 5}" for k in range(4000))
    (tmp_path / "new.csv").write_text(f"acc (m/s2),speed,torque\n{rows}\n")
    assert init(tmp_path, tmp_path / "new.csv", *TOLD, "--sampling-rate", 6000) == 0
    text = (tmp_path / "mine.toml").read_text()
    assert 'kind = "speed"\n# unit = "rpm"' in text
    assert 'kind = "torque"\n# unit = "Nm"' in text
    assert text.count("# shaft = 1") == 1
    sensor = gearmon.load_machine(tmp_path / "mine.toml").sensors[1]
    assert (sensor.kind, sensor.shaft, sensor.unit) == ("speed", 1, None)


def test_init_finds_milliseconds_taken_for_seconds(tmp_path, capsys):
    rows = [f"{10 * row},{row % 7}" for row in range(2000)]
    (tmp_path / "slow.csv").write_text("time_ms,a1 [m/s2]\n" + "\n".join(rows))
    assert init(tmp_path, tmp_path / "slow.csv", *TOLD) == 2
    assert "too slow for my gearbox with a mesh at 1134" in capsys.readouterr().err


@pytest.mark.parametrize(("rate", "code"), [(2200, 2), (2300, 0)])
def test_init_wants_twice_the_mesh_frequency(tmp_path, capsys, rate, code):
    """1134.7 Hz here: below 2269 Hz its first harmonic is not in the recording."""
    rows = "".join(f"{(row * row) % 17}\n" for row in range(4000))
    (tmp_path / "new.csv").write_text(f"a1 (m/s2)\n{rows}")
    assert init(tmp_path, tmp_path / "new.csv", "--sampling-rate", rate, *TOLD) == code
    assert ("too slow" in capsys.readouterr().err) == (code == 2)


def test_check_tells_what_a_reference_covers(shop, capsys):
    words = ["check", str(shop / "healthy.ref"), "--machine", str(shop / "machine.toml")]
    assert main([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    loads = [own["relative_load"] for own in told["recordings"]]
    assert loads[0] == pytest.approx(1.0)
    assert loads == sorted(loads)
    assert all(own["strength"] < 2.0 for own in told["recordings"])
    assert {(own["stage"], own["gear"]) for own in told["gears"]} == {(1, "pinion"), (1, "gear")}
    assert not any("fault" in advice for advice in told["advice"])
    assert main(words) == 0
    said = capsys.readouterr().out
    for own in told["gears"]:
        (share,) = re.findall(rf"{own['gear']} of stage 1: .* noticed from (\S+) % on", said)
        assert float(share) == pytest.approx(100 * own["noticed_from"], rel=0.06)
    assert main(["check", str(shop), *words[2:]]) == 2
    told = "is a folder, no gearmon reference; make one with gearmon learn"
    assert capsys.readouterr().err == f"gearmon: {shop}: {told}\n"


def test_check_asks_for_loads_and_names_the_odd_one():
    one = gearmon.learn(simulated(seed=1), machine())
    alone = gearmon.check_reference(one, machine())
    assert alone.headline().startswith("Add two healthy recordings")
    assert alone.recordings[0].strength is None
    same = [simulated(seed=seed) for seed in (1, 2)]
    two = gearmon.check_reference(gearmon.learn(same, machine()), machine())
    assert any("at about half the load" in advice for advice in two.advice)
    odd = [*same, simulated(seed=3), simulated("crack:1:pinion:7:40%", seed=4)]
    told = gearmon.check_reference(gearmon.learn(odd, machine()), machine())
    assert told.headline().startswith("simulated 4: ")
    assert "departs from the other recordings as a fault would" in " ".join(told.advice)
    assert len(told.to_frame()) == 4


@pytest.mark.parametrize(
    ("loads", "said"),
    [
        ([1.0], "Add two healthy recordings, one at about half the load"),
        ([1.0, 1.2, 1.1], "at about half the load: all of these are at one."),
        ([1.0, 1.3], ""),
        ([1.0, 4.0, 1.1], "at about 2.1 times the load of the first: none lies near it."),
    ],
)
def test_the_load_that_would_teach_most_is_in_the_middle_of_the_widest_gap(loads, said):
    """On the scale of logarithms, on which the law of loads is learned."""
    heard = [
        CheckedRecording(
            recording="a", duration_s=4.0, speed_hz=50.0, relative_load=load, strength=None
        )
        for load in loads
    ]
    assert " ".join(_missing_loads(heard)).find(said) >= 0
    assert bool(_missing_loads(heard)) == bool(said)
