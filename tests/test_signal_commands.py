"""The commands indicators, spectrum and orders: tables, files, pictures, exit codes."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from reference.small_gearbox import MACHINE_FILE, RATE_HZ, recording

import gearmon
from gearmon.cli import main

PNG = b"\x89PNG\r\n"


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("signals")
    (folder / "machine.toml").write_text(MACHINE_FILE, encoding="utf-8")
    samples = recording().vibration().samples
    np.savetxt(folder / "a.csv", samples.T, delimiter=",", header="a1,a2", comments="", fmt="%.6g")
    return folder


def run(place, command, *options):
    rate = ["--sampling-rate", str(RATE_HZ)]
    return main([command, str(place / "a.csv"), *rate, *(str(option) for option in options)])


def test_indicators_of_a_run(place, capsys):
    out = place / "i.csv"
    machine, history = place / "machine.toml", place / "run.json"
    code = run(place, "indicators", "--machine", machine, "-o", out, "--history", history, "--json")
    assert code == 0
    result = json.loads(capsys.readouterr().out)
    assert {row["gear"] for row in result["recordings"][0]["indicators"]} == {
        None,
        "pinion",
        "gear",
    }
    assert (place / "i.png").read_bytes().startswith(PNG)
    with out.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {"recording", "indicator", "value", "input", "removed"} <= set(rows[0])
    assert run(place, "indicators", "--machine", machine, "--history", history) == 0
    assert "NA4*" in capsys.readouterr().out
    runs = json.loads(history.read_text(encoding="utf-8"))["variances"]
    assert {len(rows) for rows in runs.values()} == {2}


def test_a_run_is_one_run_whether_told_at_once_or_one_by_one(place, tmp_path, capsys):
    machine, other = place / "machine.toml", tmp_path / "louder.csv"
    rows = np.loadtxt(place / "a.csv", delimiter=",", skiprows=1)
    rows += np.random.default_rng(6).normal(scale=0.1 * rows.std(), size=rows.shape)
    np.savetxt(other, rows, delimiter=",", header="a1,a2", comments="", fmt="%.6g")
    shared = ["--sampling-rate", str(RATE_HZ), "--machine", str(machine), "--json"]

    def second(name, *calls):
        history = tmp_path / name
        for recordings in calls:
            given = ["indicators", *map(str, recordings), *shared, "--history", str(history)]
            assert main(given) == 0
            found = json.loads(capsys.readouterr().out)["recordings"][-1]
        return found["indicators"], json.loads(history.read_text())["variances"]

    first = place / "a.csv"
    assert second("at once", (first, other)) == second("one by one", (first,), (other,))


def test_indicators_report_a_bad_recording_in_its_place(place, capsys):
    code = main(
        [
            "indicators",
            str(place / "none.csv"),
            str(place / "a.csv"),
            "--json",
            "--sampling-rate",
            str(RATE_HZ),
        ]
    )
    assert code == 2
    captured = capsys.readouterr()
    first, second = json.loads(captured.out)["recordings"]
    assert "none.csv" in first["error"]
    assert second["indicators"]
    assert captured.err.count("\n") == 1


@pytest.mark.parametrize("kind", ["amplitude", "density", "envelope", "cepstrum", "kurtogram"])
def test_spectrum_writes_table_and_picture(place, kind, capsys):
    out = place / f"{kind}.csv"
    machine = place / "machine.toml"
    code = run(place, "spectrum", "--kind", kind, "--machine", machine, "--peaks", 3, "-o", out)
    assert code == 0
    assert "highest peaks" in capsys.readouterr().out
    assert out.with_suffix(".png").read_bytes().startswith(PNG)
    assert len(out.read_text(encoding="utf-8").splitlines()) > 20


def test_spectrum_needs_no_machine(place, capsys):
    assert run(place, "spectrum", "--json", "--window", "flat-top", "--band", 100, 2000) == 0
    assert json.loads(capsys.readouterr().out)["peaks"]


def table(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("options", [["--map"], ["--map", "--against", "speed"]])
def test_orders_write_the_map_only_in_full(place, options):
    out = place / f"only{len(options)}.csv"
    assert run(place, "orders", "--machine", place / "machine.toml", "-o", out, *options) == 0
    assert out.with_suffix(".png").read_bytes().startswith(PNG)
    head = out.read_text(encoding="utf-8").split("\n", 1)[0]
    assert head.startswith("time_s,speed_hz,blocks,channel,order_0")
    along = "speed_hz" if "speed" in options else "time_s"
    place_of = [float(row[along]) for row in table(out) if row["channel"] == "a1"]
    assert len(place_of) > 2
    assert place_of == sorted(place_of)
    assert not list(place.glob(f"{out.stem}-*"))


@pytest.mark.parametrize("shaft", ["1", "2"])
def test_orders_write_spectrum_map_and_averages(place, capsys, shaft):
    out = place / f"orders{shaft}.csv"
    machine = place / "machine.toml"
    code = run(place, "orders", "--machine", machine, "-o", out, "--shaft", shaft, "--json")
    assert code == 0
    result = json.loads(capsys.readouterr().out)
    assert set(table(out)[0]) == {"order", "a1", "a2"}
    along = table(place / f"orders{shaft}-map.csv")
    assert len(along[0]) <= 4 + 1000
    waves = table(place / f"orders{shaft}-averages.csv")
    assert {row["gear"] for row in waves} == {"pinion", "gear"}
    assert {"average", "standard_error", "residual", "difference", "regular"} <= set(waves[0])
    lines = table(place / f"orders{shaft}-lines.csv")
    assert {row["part"] for row in lines} == {"shaft", "mesh", "first sideband", "difference"}
    assert [path.rsplit("/", 1)[-1] for path in result["pictures"]] == [
        f"orders{shaft}.png",
        f"orders{shaft}-map.png",
        f"orders{shaft}-average-1-pinion.png",
        f"orders{shaft}-average-1-gear.png",
    ]
    for path in result["pictures"]:
        with open(path, "rb") as file:
            assert file.read(6) == PNG
    assert len(result["tables"]) == 4
    pinion = result["averages"][0]
    assert pinion["removed_orders"]["residual"][:4] == [1, 2, 23, 46]
    assert pinion["turns"] > 100


def test_orders_on_the_screen_and_as_json_files(place, capsys):
    machine, out = place / "machine.toml", place / "o.json"
    assert run(place, "orders", "--machine", machine, "-o", out, "--peaks", 3) == 0
    said = capsys.readouterr().out
    assert "synchronous averages, root mean squares" in said
    assert "pinion of stage 1: residual less" in said
    assert json.loads(out.read_text(encoding="utf-8"))["rows"][0]["order"] == 0
    # the result stands in the first file alone
    for name in ("map", "averages", "lines"):
        own = json.loads((place / f"o-{name}.json").read_text(encoding="utf-8"))
        assert set(own) == {"schema", "rows"}
        assert own["rows"]


@pytest.mark.parametrize("command", ["orders", "spectrum"])
def test_a_name_of_a_picture_is_that_of_no_table(place, tmp_path, capsys, command):
    out = tmp_path / "p.png"
    assert run(place, command, "--machine", place / "machine.toml", "-o", out, "--json") == 0
    result = json.loads(capsys.readouterr().out)
    assert result["tables"] == []
    assert str(out) in result["pictures"]
    assert sorted(result["pictures"]) == sorted(map(str, tmp_path.iterdir()))
    assert all(path.read_bytes().startswith(PNG) for path in tmp_path.iterdir())


def test_orders_warn_of_all_that_spectra_and_averages_warn_of_once(place, capsys, monkeypatch):
    spectra, averages = gearmon.order_spectra, gearmon.gear_averages

    def noted(way, *notes):
        return lambda *given, **named: replace(way(*given, **named), notes=notes)

    monkeypatch.setattr(gearmon, "order_spectra", noted(spectra, "of both", "of spectra"))
    monkeypatch.setattr(gearmon, "gear_averages", noted(averages, "of both", "of averages"))
    assert run(place, "orders", "--machine", place / "machine.toml", "--json") == 0
    told = json.loads(capsys.readouterr().out)["warnings"]
    assert sorted(told) == ["of averages", "of both", "of spectra"]


@pytest.mark.parametrize(
    ("command", "options", "words"),
    [
        ("spectrum", ["--kind", "power"], "kind='power'"),
        ("spectrum", ["--window", "hamming"], "window='hamming'"),
        ("spectrum", ["--band", "5", "1"], "low must be below high"),
        ("spectrum", ["-o", "x.txt"], "must end in one of"),
        ("orders", ["--machine", "M", "--against", "load"], "against='load'"),
        ("indicators", ["--baseline", "0"], "baseline=0"),
        ("indicators", ["--history", ""], "--history: the name is empty"),
    ],
)
def test_bad_options_are_one_line_and_exit_two(place, capsys, command, options, words):
    options = [str(place / "machine.toml") if option == "M" else option for option in options]
    assert run(place, command, *options) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1
