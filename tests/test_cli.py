"""The command line: exit codes, outputs, and one clear line for whatever is wrong."""

from __future__ import annotations

import csv
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from reference.small_gearbox import CRACK

from gearmon import read_reference
from gearmon.cli import main

COMMANDS = ("lines", "stiffness", "baseline", "simulate", "learn", "analyse", "demo", "benchmark")
FLAG_KEYS = {"kind", "stage", "gear", "tooth", "false_alarm_probability", "evidence"}


@pytest.fixture
def run(shop, capsys, monkeypatch):
    """Run a command inside the folder; exit code, standard output, standard error."""
    monkeypatch.chdir(shop)
    capsys.readouterr()

    def run_it(*arguments):
        try:
            code = main([str(argument) for argument in arguments])
        except SystemExit as stop:
            code = stop.code
        out, err = capsys.readouterr()
        return code, out, err

    return run_it


def process(*arguments, **options):
    """Run a command as a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "gearmon", *arguments],
        capture_output=True,
        check=False,
        timeout=120,
        **options,
    )


def analyse(*recordings):
    return ["analyse", *recordings, "--machine", "machine.toml"]


# Help and usage


@pytest.mark.parametrize("word", ["anaylse", "Analyse", "ANALYSE"])
def test_the_command_that_was_meant_is_named(run, word):
    code, out, err = run(word, "new.csv", "--machine", "machine.toml")
    assert (code, out) == (2, "")
    assert f"there is no command {word!r}; did you mean analyse?" in err


@pytest.mark.parametrize("option", ["--reference", "--report", "-o", "--tacho"])
def test_an_empty_name_is_refused(run, shop, option):
    unchanged(shop, lambda: one_line(run(*analyse("new.csv"), option, ""), ""))


def test_a_recording_is_never_written_over(run, tmp_path, shop):
    copy = tmp_path / "mine.csv"
    copy.write_bytes((shop / "healthy-0.csv").read_bytes())
    code, _, _ = run("learn", copy, "--machine", "machine.toml", "-o", copy)
    assert code == 2
    assert copy.read_bytes() == (shop / "healthy-0.csv").read_bytes()


def test_a_wrong_output_name_is_refused_before_the_report_is_written(run, tmp_path):
    report = tmp_path / "report.html"
    given = [*analyse("new.csv"), "--report", report, "-o", tmp_path / "answer.txt"]
    assert run(*given)[0] == 2
    assert list(tmp_path.iterdir()) == []


def test_file_names_that_are_no_text(shop):
    done = process(*analyse(b"\xff.csv"), "--json", cwd=shop)
    assert done.returncode == 2
    assert b"Traceback" not in done.stderr
    assert "error" in json.loads(done.stdout)["recordings"][0]


def test_without_a_command_the_help_is_shown(run):
    code, out, _ = run()
    assert code == 0
    assert all(command in out for command in COMMANDS)


def test_version(run):
    import gearmon

    assert run("--version")[1] == f"gearmon {gearmon.__version__}\n"


@pytest.mark.parametrize(
    "arguments",
    [
        ["analyze"],
        ["analyse"],
        ["analyse", "new.csv"],
        ["analyse", "--machine", "machine.toml"],
        ["learn", "new.csv"],
        ["lines"],
        ["lines", "machine.toml", "--colour"],
        ["baseline", "machine.toml", "--tolerance", "small"],
        ["baseline", "machine.toml", "--max-hz"],
        ["simulate", "machine.toml", "--channels", "2.5"],
        ["simulate", "machine.toml", "--seed", "x"],
        [*analyse("new.csv"), "--sampling-rate", "10k"],
        ["demo", "a", "b"],
    ],
)
def test_wrong_usage_exits_with_2(run, arguments):
    code, out, err = run(*arguments)
    assert code == 2
    assert out == ""
    assert err.startswith("gearmon: ")
    assert err.count("\n") == 1


# What the commands do


def test_lines_as_text_json_and_csv(run, tmp_path):
    code, out, err = run("lines", "machine.toml")
    assert (code, err) == (0, "")
    assert "mesh" in out
    code, out, _ = run("lines", "machine.toml", "--json", "-o", tmp_path / "lines.csv")
    rows = json.loads(out)["rows"]
    mesh = next(row for row in rows if row["kind"] == "mesh")
    assert mesh["frequency_hz"] == pytest.approx(23 * 2960 / 60)
    written = list(csv.DictReader((tmp_path / "lines.csv").read_text().splitlines()))
    assert len(written) == len(rows)
    assert float(written[0]["order"]) == rows[0]["order"]
    run("lines", "machine.toml", "-o", tmp_path / "lines.json")
    assert json.loads((tmp_path / "lines.json").read_text())["rows"] == rows


def test_stiffness_as_table_and_picture(run, tmp_path):
    target = tmp_path / "stiffness.csv"
    code, out, err = run("stiffness", "machine.toml", "--fault", CRACK, "--json", "-o", target)
    assert (code, err) == (0, "")
    assert target.read_text().startswith("stage,")
    assert all(Path(name).is_file() for name in json.loads(out)["pictures"])


def test_baseline_writes_the_lines_asked_for(run, tmp_path):
    target = tmp_path / "lines.csv"
    code, out, err = run("baseline", "machine.toml", "--max-hz", 4000, "--json", "-o", target)
    assert (code, err) == (0, "")
    told = json.loads(out)
    assert all(row["frequency_hz"] <= 4000 for row in told["rows"])
    table = [line for line in target.read_text().splitlines() if not line.startswith("#")]
    assert len(table) == len(told["rows"]) + 1
    assert told["tables"] == [str(target)]
    assert [Path(name).read_bytes()[:4] for name in told["pictures"]] == [b"\x89PNG"]


def test_every_file_that_is_written_is_told(run, tmp_path):
    _, out, _ = run("baseline", "machine.toml", "--max-hz", 2000, "-o", tmp_path / "lines.csv")
    told = {line.removeprefix("wrote ") for line in out.splitlines() if line.startswith("wrote ")}
    assert told == {str(path) for path in tmp_path.iterdir()}
    assert {Path(name).suffix for name in told} == {".csv", ".png"}


def test_baseline_with_a_fault_has_sidebands(run):
    code, out, _ = run("baseline", "machine.toml", "--max-hz", 2000, "--fault", CRACK, "--json")
    assert code == 0
    sidebands = {row["sideband_of"] for row in json.loads(out)["rows"] if row["sideband"]}
    assert "pinion" in "".join(map(str, sidebands))


def test_simulate_writes_recording_and_truth(run, tmp_path):
    target = tmp_path / "sim.csv"
    options = ["--duration", "0.3", "--sampling-rate", "8000", "--fault", CRACK, "--tacho"]
    code, out, err = run("simulate", "machine.toml", *options, "--json", "-o", target)
    assert (code, err) == (0, "")
    assert json.loads(out) == {
        "schema": "gearmon/1",
        "recording": str(target),
        "truth": str(target.with_suffix(".json")),
    }
    header = target.read_text().splitlines()[0]
    assert header == "time (s),a1 (m/s2),a2 (m/s2),tacho (V)"
    truth = json.loads(target.with_suffix(".json").read_text())
    # a pulse a turn of shaft 1
    pulses = np.loadtxt(target, delimiter=",", skiprows=1, usecols=3)
    turns = np.count_nonzero((pulses[:-1] < 2.5) & (pulses[1:] >= 2.5))
    assert turns == pytest.approx(0.3 * truth["speed"]["mean_hz"], abs=1.0)
    again = tmp_path / "again.csv"
    run("simulate", "machine.toml", *options, "-o", again)
    assert again.read_bytes() == target.read_bytes()


def test_simulate_takes_errors_of_gears_or_says_why_not(run, tmp_path):
    target = tmp_path / "runout.csv"
    options = ["--duration", "0.3", "--sampling-rate", "8000", "-o", target]
    runout = "eccentricity:1:pinion:all:20um"
    assert run("simulate", "machine.toml", "--fault", runout, *options)[0] == 0
    assert json.loads(target.with_suffix(".json").read_text())["faults"][0]["fault"] == runout
    code, out, err = run("simulate", "machine.toml", "--fault", "profile:1:pinion:3:8um", *options)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "of all teeth alike, profile" in err


def test_healthy_recording_exits_with_0(run):
    code, out, err = run(*analyse("new.csv"), "--reference", "healthy.ref", "--json")
    assert (code, err) == (0, "")
    (told,) = json.loads(out)["recordings"]
    assert told["recording"] == "new.csv"
    assert told["verdict"] == "healthy"
    assert told["speed"]["method"] == "tacho"


def test_cracked_recording_exits_with_1(run):
    code, out, err = run(*analyse("cracked.csv"), "--reference", "healthy.ref", "--json")
    assert (code, err) == (1, "")
    (told,) = json.loads(out)["recordings"]
    assert told["verdict"] == "fault"
    assert set(told["flags"][0]) >= FLAG_KEYS


def test_a_report_names_the_recordings_that_cannot_be_used(run, tmp_path, monkeypatch):
    # pictures take longer than all the rest
    monkeypatch.setattr("gearmon.report.analysis_plots.analysis_figures", lambda *_: [])
    page = tmp_path / "report.html"
    given = [*analyse("new.csv", "nowhere.csv"), "--reference", "healthy.ref"]
    code, _, err = run(*given, "--report", page)
    assert code == 2
    (told,) = (line for line in err.splitlines() if "nowhere.csv" in line)
    text = " ".join(page.read_text("utf-8").split())
    assert told.removeprefix("gearmon: ") in text
    assert "new.csv" in text


def test_the_worst_recording_is_told_first_and_files_of_the_report_are_counted(
    run, tmp_path, monkeypatch
):
    # pictures take longer than all the rest
    monkeypatch.setattr("gearmon.report.analysis_plots.analysis_figures", lambda *_: [])
    given = [*analyse("new.csv", "cracked.csv"), "--reference", "healthy.ref"]
    code, out, _ = run(*given, "--report", tmp_path / "report.html")
    assert code == 1
    # what all of them say together is above
    assert out.startswith("FAULT (2 recordings: 1 fault, 1 healthy)")
    assert out.index("cracked.csv: FAULT") < out.index("new.csv: HEALTHY")
    pictures = len(list(tmp_path.rglob("*.png")))
    assert f"report: {tmp_path / 'report.html'} and {pictures} pictures" in out.splitlines()


def test_a_recording_serves_as_reference(run):
    code, out, _ = run(*analyse("cracked.csv"), "--reference", "healthy-1.csv", "--json")
    told = json.loads(out)["recordings"][0]
    assert code in (0, 1)
    assert told["compared_with"] == "reference"
    assert any("the reference is one recording" in warning for warning in told["warnings"])


def test_without_reference_it_cannot_tell(run):
    code, out, _ = run(*analyse("new.csv"), "--json")
    told = json.loads(out)["recordings"][0]
    assert code == 3
    assert told["verdict"] == "cannot tell"


@pytest.mark.parametrize("loss", ["140%", "0", "much"])
def test_a_loss_to_be_noticed_that_is_none_is_refused_before_any_work(run, loss):
    code, out, err = run(*analyse("new.csv", "noise.csv"), "--must-notice", loss)
    assert (code, out) == (2, "")
    assert err.splitlines() == [
        f"gearmon: argument --must-notice: {loss}: must be a loss of pair stiffness above 0, "
        "up to 100%, such as 20%; see gearmon analyse --help"
    ]


def test_noise_is_a_verdict_and_no_error(run):
    code, out, err = run(*analyse("noise.csv"), "--json")
    assert (code, err) == (3, "")
    assert json.loads(out)["recordings"][0]["verdict"] == "no mesh found"


def test_several_recordings_with_bad_ones_between(run):
    given = ["new.csv", "missing.csv", "cracked.csv", "letter.txt", "noise.csv"]
    code, out, err = run(*analyse(*given), "--reference", "healthy.ref", "--json")
    assert code == 2
    told = json.loads(out)["recordings"]
    assert [entry["recording"] for entry in told] == given
    assert [entry.get("verdict") for entry in told] == [
        "healthy",
        None,
        "fault",
        None,
        "fault",  # the reference had a mesh
    ]
    assert told[4]["flags"][0]["kind"] == "mesh lost"
    assert all(entry["error"].startswith(entry["recording"]) for entry in (told[1], told[3]))
    assert len(err.splitlines()) == 2


def test_several_recordings_as_text(run):
    code, out, _ = run(*analyse("new.csv", "missing.csv"), "--reference", "healthy.ref")
    assert code == 2
    assert "HEALTHY" in out
    assert "missing.csv: not analysed" in out


def test_channels_by_name_and_by_column(run):
    by_name = run(*analyse("new.csv"), "--channel", "a2", "--reference", "healthy.ref", "--json")
    by_number = run(*analyse("new.csv"), "--channel", "3", "--reference", "healthy.ref", "--json")
    assert by_name == by_number
    assert json.loads(by_name[1])["recordings"][0]["channels"] == ["a2"]


def test_it_asks_for_the_sampling_rate(run):
    code, out, err = run(*analyse("no-time.csv"), "--json")
    assert code == 2
    assert "--sampling-rate" in err or "sampling rate" in err
    assert "error" in json.loads(out)["recordings"][0]
    given = [*analyse("no-time.csv"), "--sampling-rate", 10_000]
    assert run(*given, "--reference", "healthy.ref", "--json")[0] == 0


def test_json_is_written_to_a_file_too(run, tmp_path):
    target = tmp_path / "answer.json"
    _, out, _ = run(*analyse("new.csv"), "--reference", "healthy.ref", "--json", "-o", target)
    told = json.loads(out)
    assert told.pop("tables") == [str(target)]
    assert json.loads(target.read_text()) == told


def test_report_is_one_file_with_pictures_beside_it(run, tmp_path):
    target = tmp_path / "report.html"
    given = [*analyse("cracked.csv"), "--reference", "healthy.ref", "--report", target]
    code, out, err = run(*given, "--json")
    assert (code, err) == (1, "")
    written = [Path(name) for name in json.loads(out)["report"]]
    assert written[0] == target
    assert all(path.is_file() and path.stat().st_size for path in written)
    assert not re.search(r"(?:src|href)=\"https?:", target.read_text())


def test_learn_says_what_it_learned(run, tmp_path):
    given = ["learn", "healthy-0.csv", "--machine", "machine.toml", "-o", tmp_path / "x", "--json"]
    code, out, err = run(*given)
    assert (code, err) == (0, "")
    told = json.loads(out)
    assert told["channels"] == ["a1", "a2"]
    assert told["recordings"][0]["speed"]["estimated_hz"] == pytest.approx(49, rel=0.03)
    assert told["families"] == len(read_reference(tmp_path / "x").family_names) > 3


# What may be wrong

BAD_MACHINES = {
    "missing": (["missing.toml"], r"missing\.toml"),
    "a folder": (["folder"], "folder"),
    "not TOML": (["broken.toml"], r"broken\.toml"),
    "a letter": (["letter.txt"], r"letter\.txt"),
    "bytes": (["bytes.bin"], r"bytes\.bin"),
    "empty": (["empty.csv"], r"empty\.csv"),
    "a recording": (["new.csv"], r"new\.csv"),
    "a reference": (["healthy.ref"], r"healthy\.ref"),
}


@pytest.mark.parametrize("command", ["lines", "baseline"])
@pytest.mark.parametrize("kind", BAD_MACHINES)
def test_bad_machine_files_get_one_line(run, command, kind):
    arguments, named = BAD_MACHINES[kind]
    one_line(run(command, *arguments), named)


def test_baseline_names_what_the_machine_lacks(run):
    one_line(run("baseline", "bare.toml"), "module_mm|torque_nm|face_width_mm")


# what each value may be is tested where it is used; here that every way to a refusal is one line
BAD_MODELS = {
    "NaN tolerance": ("baseline --tolerance nan", "tolerance"),
    "top below all lines": ("baseline --max-hz 1", "max_hz"),
    "infinite top": ("baseline --max-hz inf", "max_hz"),
    "fault in four parts": ("baseline --fault crack:1:pinion:5", "crack:1:pinion:5"),
    "unknown kind": ("baseline --fault crak:1:pinion:5:20%", "crack"),
    "gear of another kind": ("baseline --fault crack:1:sun:5:20%", "sun"),
    "missing tooth": ("baseline --fault crack:1:pinion:24:20%", "tooth|24"),
    "all too much": ("baseline --fault crack:1:pinion:5:120%", "120|1\\.2"),
    "unknown form": ("stiffness --form nonsense", "nonsense"),
    "missing stage": ("stiffness --stage 2", "stage"),
    "deeper than the tooth": ("stiffness --fault crack:1:pinion:5:500mm", "500"),
    "no output": ("simulate", "-o PATH"),
    "less than a turn": ("simulate -o x.csv --duration 0.001", "duration_s"),
    "no channel": ("simulate -o x.csv --channels 0", "channels"),
    "negative seed": ("simulate -o x.csv --seed -1", "seed"),
}


@pytest.mark.parametrize("kind", BAD_MODELS)
def test_bad_arguments_of_models_get_one_line(run, shop, kind):
    words, named = BAD_MODELS[kind]
    command, *arguments = words.split()
    unchanged(shop, lambda: one_line(run(command, "machine.toml", *arguments), named))


BAD_ANALYSES = {
    "missing recording": (["missing.csv"], r"missing\.csv"),
    "folder as recording": (["folder"], "folder"),
    "letter as recording": (["letter.txt"], r"letter\.txt"),
    "bytes as recording": (["bytes.bin"], r"bytes\.bin"),
    "empty recording": (["empty.csv"], r"empty\.csv"),
    "cut gzip": (["cut.csv.gz", "--sampling-rate", "1000"], r"cut\.csv\.gz"),
    "machine file as recording": (["machine.toml"], r"machine\.toml"),
    "reference as recording": (["healthy.ref"], r"healthy\.ref"),
    "unknown channel": (["new.csv", "--channel", "a9"], "a9"),
    "channel 0": (["new.csv", "--channel", "0"], "0"),
    "channel 99": (["new.csv", "--channel", "99"], "99"),
    "time as channel": (["new.csv", "--channel", "1"], "time|1"),
    "unknown tacho": (["new.csv", "--tacho", "pulses"], "pulses"),
    "noise as tacho": (["noise.csv", "--tacho", "a1", "--channel", "a1"], "a1"),
    "tacho and channel at once": (["new.csv", "--tacho", "a1", "--channel", "a1"], "a1"),
    "NaN rate": (["no-time.csv", "--sampling-rate", "nan"], "sampling"),
    "huge rate": (["no-time.csv", "--sampling-rate", "1e12"], "must lie in"),
    "rate against the time column": (["new.csv", "--sampling-rate", "9000"], "9000"),
}


@pytest.mark.parametrize("kind", BAD_ANALYSES)
def test_bad_recordings_get_one_line(run, kind):
    arguments, named = BAD_ANALYSES[kind]
    code, out, err = run(*analyse(*arguments), "--json")
    one_line((code, "", err), named)
    (entry,) = json.loads(out)["recordings"]
    assert entry["error"] in err


BAD_REFERENCES = {
    "missing": ("missing.ref", r"missing\.ref: no such file; make one with gearmon learn"),
    "a folder": ("folder", "folder: is a folder, no gearmon reference"),
    "a letter": ("letter.txt", r"letter\.txt"),
    "noise": ("noise.csv", "no mesh found"),
    "a machine file": ("machine.toml", r"machine\.toml"),
}


@pytest.mark.parametrize("kind", BAD_REFERENCES)
def test_bad_references_get_one_line(run, kind):
    name, named = BAD_REFERENCES[kind]
    one_line(run(*analyse("new.csv"), "--reference", name, "--json"), named)


BAD_LEARNING = {
    "no output": (["healthy-0.csv"], "-o PATH is missing; write the reference"),
    "no mesh": (["noise.csv", "-o", "x.ref"], r"noise\.csv: no mesh found"),
    "one missing": (["healthy-0.csv", "missing.csv", "-o", "x.ref"], r"missing\.csv"),
    "other channels": (["healthy-0.csv", "no-time.csv", "-o", "x.ref"], "sampling"),
    "nowhere": (["healthy-0.csv", "-o", "nowhere/x.ref"], "nowhere"),
    "a folder": (["healthy-0.csv", "-o", "folder"], "folder"),
}


@pytest.mark.parametrize("kind", BAD_LEARNING)
def test_bad_learning_gets_one_line(run, shop, kind):
    arguments, named = BAD_LEARNING[kind]
    given = ["learn", *arguments, "--machine", "machine.toml"]
    unchanged(shop, lambda: one_line(run(*given), named))


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["lines", "machine.toml", "-o", "lines.txt"], r"lines\.txt"),
        (["lines", "machine.toml", "-o", "nowhere/lines.csv"], "nowhere"),
        (["lines", "machine.toml", "-o", "folder"], "folder"),
        ([*analyse("new.csv"), "-o", "answer.csv"], r"answer\.csv"),
        ([*analyse("new.csv"), "-o", "nowhere/answer.json"], "nowhere"),
        ([*analyse("new.csv"), "-o", "folder"], "folder"),
        ([*analyse("new.csv"), "--report", "nowhere/report.html"], "nowhere"),
        ([*analyse("new.csv"), "--report", "folder"], "folder"),
        ([*analyse("new.csv"), "--report", "report.pdf"], r"report\.pdf"),
        (["demo", "bearing", "-o", "nowhere"], "crack"),
        (["demo", "-o", "letter.txt"], r"letter\.txt"),
        (["benchmark", "nonsense"], "nonsense"),
    ],
)
def test_bad_outputs_get_one_line_and_leave_nothing(run, shop, arguments, named):
    unchanged(shop, lambda: one_line(run(*arguments), named))


def one_line(result, named):
    """Exit 2, nothing on standard output, one line on standard error that names the culprit."""
    code, out, err = result
    assert code == 2
    assert out == ""
    lines = err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("gearmon: ")
    assert re.search(named, lines[0])
    assert "Traceback" not in err


def unchanged(folder, action):
    """Do something that must leave the files of a folder as they are."""
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    action()
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before


# As a process of its own


def test_nothing_but_the_answer_where_nobody_watches(shop):
    given = [*analyse("new.csv", "cracked.csv"), "--reference", "healthy.ref", "--json"]
    done = process(*given, cwd=shop)
    assert done.returncode == 1
    assert done.stderr == b""
    assert len(json.loads(done.stdout)["recordings"]) == 2


def test_a_reader_that_stops_is_no_error(shop):
    with subprocess.Popen(
        [sys.executable, "-m", "gearmon", "baseline", "machine.toml", "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=shop,
    ) as running:
        running.stdout.read(10)
        running.stdout.close()
        errors = running.stderr.read()
        assert running.wait(60) == 0
    assert errors == b""
