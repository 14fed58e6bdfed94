"""What must hold of every command: exit codes, one line for any error, nothing written over."""

from __future__ import annotations

import gzip
import os
import platform
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
import soundfile
from scipy.io import savemat

import gearmon.signals.recording
from gearmon import __version__, cli
from gearmon.cli import COMMANDS, main
from gearmon.commands.command import judged
from gearmon.errors import GearmonError
from gearmon.files import most_unpacked, protecting, table_cell, write_atomically
from gearmon.report.wording import rows_as_csv
from gearmon.signals.recording import open_recording, read_recording

WRITING = [c for c in COMMANDS if "-o" in shlex.split(c.example) and not c.folder]


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def lines_of_error(capsys):
    return capsys.readouterr().err.splitlines()


# One net


def failing(monkeypatch, error):
    def fail(_):
        raise error

    monkeypatch.setattr(cli, "perform", fail)


def test_an_error_of_our_own_has_its_own_exit_code_and_says_where_details_are(
    monkeypatch, capsys, here
):
    monkeypatch.setenv("TMPDIR", str(here))
    monkeypatch.setattr("tempfile.tempdir", None)
    failing(monkeypatch, ZeroDivisionError("no\nluck"))
    monkeypatch.setattr("sys.argv", ["gearmon", "lines", "machine.toml"])
    assert main(["lines", "machine.toml"]) == 70
    (line,) = lines_of_error(capsys)
    assert "an error of gearmon's own (ZeroDivisionError: no luck)" in line
    details = Path(re.search(r"details are in (\S+),", line)[1]).read_text()
    # what whoever mends it asks for first
    versions, words, *_ = details.splitlines()
    assert versions.startswith(f"gearmon {__version__}, Python {platform.python_version()}, ")
    assert words == "gearmon lines machine.toml"
    assert "Traceback" in details
    assert "no\nluck" in details


def test_debug_shows_the_error_itself(monkeypatch):
    failing(monkeypatch, ZeroDivisionError("no luck"))
    with pytest.raises(ZeroDivisionError):
        main(["lines", "machine.toml", "--debug"])


@pytest.mark.parametrize(
    ("error", "code", "words"),
    [
        (GearmonError("bad\x1b[31m\r\nline"), 2, "bad [31m  line"),
        (MemoryError(), 2, "more memory than there is"),
        (KeyboardInterrupt(), 130, "stopped"),
    ],
)
def test_what_stops_a_command_is_one_line(monkeypatch, capsys, error, code, words):
    failing(monkeypatch, error)
    assert main(["lines", "machine.toml"]) == code
    (line,) = lines_of_error(capsys)
    assert words in line


@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", -signal.SIGTERM)])
def test_who_is_stopped_says_so_and_takes_temporary_files_along(here, name, code):
    script = f"""
import signal
# a shell that puts the tests into the background lets them ignore it
signal.signal(signal.SIGINT, signal.default_int_handler)
import gearmon.cli, gearmon.files
from gearmon.__main__ import run
def main():
    with gearmon.files.replacing("out.csv"):
        signal.raise_signal(signal.{name})
gearmon.cli.main = main
raise SystemExit(run())
"""
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, capture_output=True, check=False, text=True)
    assert (done.returncode, done.stderr) == (code, "gearmon: stopped\n")
    assert list(here.iterdir()) == []


def test_exit_codes_of_several_recordings():
    def code(*verdicts, flagged=False):
        return judged([{"verdict": verdict} for verdict in verdicts], flagged=flagged)

    assert code("healthy") == 0
    assert code("healthy", "fault", flagged=True) == 1
    assert judged([{"verdict": "fault"}, {"error": "no such file"}], flagged=True) == 2
    assert code("healthy", "cannot tell") == 3
    assert code("no mesh found") == 3


@pytest.mark.usefixtures("here")
def test_many_bad_recordings_end_with_a_line_that_counts_them(capsys, shop):
    missing = [f"{number}.csv" for number in range(30)]
    given = ["indicators", *missing, "--machine", str(shop / "machine.toml")]
    assert main(given) == 2
    told = lines_of_error(capsys)
    assert len(told) == 31
    assert "30 of 30 recordings could not be used" in told[-1]


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ("lines {machine} --json >/dev/full", 2),
        ("lines {machine} --json >&-", 0),
        ("lines missing.toml 2>/dev/full", 2),
        ("--help >&-", 0),
    ],
)
def test_a_stream_that_takes_nothing_is_no_crash(shop, words, code):
    command = f"{sys.executable} -m gearmon {words.format(machine=shop / 'machine.toml')}"
    done = subprocess.run(["sh", "-c", command], capture_output=True, check=False, text=True)
    assert done.returncode == code
    assert len(done.stderr.splitlines()) <= 1


# Outputs


@pytest.mark.parametrize("command", WRITING, ids=lambda c: c.name)
def test_no_command_writes_over_what_it_has_not_written(here, capsys, command):
    words = shlex.split(command.example)[1:]
    at = words.index("-o") + 1
    for name, words_of_error in (
        (words[at], "did not write it"),
        (f"nowhere/{words[at]}", "cannot write there"),
    ):
        mine = here / words[at]
        mine.write_text("mine")
        given = [name if number == at else word for number, word in enumerate(words)]
        # refused before any work: none of the files that are named exists
        assert main(given) == 2
        (line,) = lines_of_error(capsys)
        assert words_of_error in line
        assert mine.read_text() == "mine"


@pytest.mark.parametrize("command", [c for c in WRITING if c.beside], ids=lambda c: c.name)
def test_nor_beside_its_output(here, capsys, command):
    words = shlex.split(command.example)[1:]
    stem = Path(words[words.index("-o") + 1]).stem
    for pattern in command.beside:
        name = pattern.format(stem).replace("[0-9]", "1").replace("*", "1")
        mine = here / name
        mine.write_text("mine")
        assert main(words) == 2
        assert f"{name}: exists, and gearmon {command.name} did not" in lines_of_error(capsys)[0]
        mine.unlink()


def test_a_command_writes_over_what_it_wrote_itself_and_nothing_else(here, shop, capsys):
    given = [str(shop / "machine.toml"), "-o", "out.csv"]
    assert main(["lines", *given]) == 0
    assert main(["lines", *given]) == 0
    capsys.readouterr()
    # another command, and a file that was changed since
    assert main(["baseline", *given]) == 2
    assert "gearmon baseline did not write it" in lines_of_error(capsys)[0]
    with (here / "out.csv").open("a") as file:
        file.write("my remarks\n")
    assert main(["lines", *given]) == 2
    assert "it was changed since" in lines_of_error(capsys)[0]
    # nothing is lost with an empty file
    (here / "out.csv").write_text("")
    assert main(["lines", *given]) == 0


@pytest.mark.parametrize("link", [os.link, os.symlink])
def test_an_input_is_never_written_by_any_name(here, shop, capsys, link):
    machine = here / "machine.toml"
    machine.write_bytes((shop / "machine.toml").read_bytes())
    link(machine, here / "other.csv")
    assert main(["lines", str(machine), "-o", "other.csv"]) == 2
    assert "is read as well" in lines_of_error(capsys)[0]
    assert machine.read_bytes() == (shop / "machine.toml").read_bytes()


def test_an_input_is_known_by_itself_and_not_by_what_is_like_it(here):
    """A copy may be written, the same file by another name or a hard link may not."""
    for name in ("read", "copy"):
        (here / name).write_text("the same")
    os.link(here / "read", here / "hard")
    (here / "soft").symlink_to(here / "read")
    with protecting("learn", ["read"], kept=["copy", "hard", "soft"]):
        write_atomically("copy", "new")
        for name in ("read", "hard", "soft", here / "read"):
            with pytest.raises(GearmonError, match="is read as well; give another name"):
                write_atomically(name, "new")
    assert (here / "copy").read_text() == "new"
    assert (here / "read").read_text() == "the same"


def test_links_in_a_circle_are_refused(here, shop, capsys):
    (here / "a.csv").symlink_to(here / "b.csv")
    (here / "b.csv").symlink_to(here / "a.csv")
    machine = str(shop / "machine.toml")
    assert main(["lines", machine, "-o", "a.csv"]) == 2
    assert main(["lines", "a.csv"]) == 2
    assert main(["indicators", "a.csv"]) == 2
    assert main(["analyse", "new.csv", "--machine", machine, "--reference", "a.csv"]) == 2
    assert len(lines_of_error(capsys)) == 4


@pytest.mark.usefixtures("here")
def test_one_name_for_two_outputs_is_refused(shop, capsys):
    given = ["indicators", "new.csv", "--machine", str(shop / "machine.toml")]
    assert main([*given, "-o", "x.json", "--history", "./x.json"]) == 2
    assert "would be written twice" in lines_of_error(capsys)[0]


def test_a_full_disk_is_said_and_keeps_what_was_there(here, monkeypatch):
    write_atomically("a.csv", "old")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(GearmonError, match=r"a\.csv: cannot write it \(No space left on device\)"):
        write_atomically("a.csv", "new")
    assert (here / "a.csv").read_text() == "old"
    assert [path.name for path in here.iterdir()] == ["a.csv"]


def test_outside_commands_python_decides_what_is_written_over(here):
    (here / "a.csv").write_text("old")
    write_atomically("a.csv", "new")
    # and a command goes on from there
    with protecting("lines", ()):
        write_atomically("a.csv", "newer")
    assert (here / "a.csv").read_text() == "newer"


# Costs and cells


def test_missing_files_cost_nothing(here):
    for number in range(300):
        (here / f"recording-{number}.csv").touch()
    begin = time.process_time()
    assert main(["indicators", *(f"recordin-{number}.csv" for number in range(300))]) == 2
    assert time.process_time() - begin < 5.0


def test_operating_points_too_far_apart_are_refused_with_the_numbers(here, shop, capsys):
    text = (shop / "machine.toml").read_text()
    other = text.replace("[operating]", "[[operating]]\nspeed_rpm = 6.0\n\n[[operating]]")
    (here / "m.toml").write_text(other)
    assert main(["lines", "m.toml"]) == 2
    assert "from 6 to 2960 1/min" in lines_of_error(capsys)[0]


@pytest.mark.parametrize("text", ["=1+1", "@x", "+cmd|' /C calc'!A0", "-2+3", "-x", "\tx", "--"])
def test_text_that_a_spreadsheet_would_run_is_quoted(text):
    assert table_cell(text) == "'" + text
    for line in rows_as_csv([{text: text}]).splitlines():
        assert line.lstrip('"').startswith("'")


@pytest.mark.parametrize("cell", ["mesh", "-5", "+1.5e-3", "a=b", "", None, -5.0, 3, "é"])
def test_other_cells_stay_as_they_are(cell):
    assert table_cell(cell) is cell


def packed_csv(path):
    path.write_bytes(gzip.compress(b"0.125,0.25\n" * 5_000_000))


def in_many_parts(path):
    path.write_bytes(gzip.compress(b"0.125,0.25\n" * 200_000) * 20)


def packed_npz(path):
    with path.open("wb") as file:
        np.savez_compressed(file, a=np.zeros(6_000_000))


def packed_mat(path):
    # beyond 32 MB glibc never takes an array from what the process holds already
    savemat(path, {f"a{k}": np.zeros(5_000_000) for k in range(3)}, do_compression=True)


def unwritten_hdf5(path):
    with h5py.File(path, "w") as file:
        file.create_dataset("a", shape=(10**12,), dtype="f8", chunks=(1 << 16,))


def constant_parquet(path):
    pyarrow.parquet.write_table(pyarrow.table({"a": np.zeros(6_000_000)}), path)


def silent_flac(path):
    soundfile.write(path, np.zeros(20_000_000, dtype="i2"), 48_000, format="FLAC")


SWELLING = (
    packed_csv,
    in_many_parts,
    packed_npz,
    packed_mat,
    unwritten_hdf5,
    constant_parquet,
    silent_flac,
)


@pytest.mark.parametrize("write", SWELLING)
def test_a_file_that_swells_is_refused_before_it_does(tmp_path, write):
    path = tmp_path / "bomb"
    write(path)
    begin = time.process_time()
    with pytest.raises(GearmonError, match=r"as no recording does|unpacks to more than any"):
        read_recording(path, 1000.0)
    assert time.process_time() - begin < 2.0


@pytest.mark.parametrize(("packed", "allowed"), [(10, 1 << 24), (1 << 20, 250 << 20)])
def test_small_files_may_unpack_to_sixteen_megabytes_and_large_ones_to_a_multiple(packed, allowed):
    assert most_unpacked(packed) == allowed


def test_packed_recordings_are_read_however_quiet(tmp_path):
    # noise of one step of the last digit, in one column of three
    steps = np.random.default_rng(0).integers(-1, 2, 600_000)
    rows = [f"{0.000001 * step:.6f},0.000000,0.000000\n" for step in (0, 1, -1)]
    text = "".join(rows[step] for step in steps.tolist())
    (tmp_path / "a.csv.gz").write_bytes(gzip.compress(text.encode()))
    assert read_recording(tmp_path / "a.csv.gz", 1000.0).samples.shape == (1, 600_000)


def test_more_samples_than_there_is_memory_for_are_refused_with_the_number(tmp_path, monkeypatch):
    rows = np.random.default_rng(0).normal(size=(1000, 2)).tolist()
    (tmp_path / "a.csv").write_text("".join(f"{first},{second}\n" for first, second in rows))
    monkeypatch.setattr(gearmon.signals.recording, "free_bytes", lambda: 1000.0)
    with pytest.raises(GearmonError, match=r"need .* GB of memory; .* open_recording"):
        read_recording(tmp_path / "a.csv", 1000.0)
    assert open_recording(tmp_path / "a.csv", 1000.0).samples.shape == (2, 1000)


# Likely cures


@pytest.mark.parametrize("command", COMMANDS, ids=lambda c: c.name)
def test_wrong_usage_is_one_line(capsys, command):
    for words in ([], ["--no-such-option"], ["--json=3"]):
        if command.name in ("demo", "benchmark", "init", "exposure") and not words:
            continue
        with pytest.raises(SystemExit) as stop:
            main([command.name, *words])
        assert stop.value.code == 2
        (line,) = lines_of_error(capsys)
        assert re.search(r"; see gearmon( \w+)? --help$", line)


def test_a_command_that_is_spelt_otherwise_is_named(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["analyze", "new.csv"])
    assert stop.value.code == 2
    assert "did you mean analyse?" in capsys.readouterr().err


def test_a_size_without_per_cent_is_asked_for(here, shop, capsys):
    given = ["stiffness", str(shop / "machine.toml"), "--fault", "crack:1:pinion:5:20"]
    assert main(given) == 2
    assert "did you mean 20%?" in lines_of_error(capsys)[0]
    assert list(here.iterdir()) == []


def test_time_in_ms_and_speed_in_hz_are_guessed(here, shop, capsys):
    rows = (shop / "new.csv").read_text().splitlines()[1:2001]
    text = [f"{1000 * float(time)},{rest}" for time, rest in (row.split(",", 1) for row in rows)]
    (here / "ms.csv").write_text("\n".join(["time (s),a1,a2,tacho", *text]))
    assert main(["analyse", "ms.csv", "--machine", str(shop / "machine.toml")]) == 2
    assert "--sampling-rate 10000" in lines_of_error(capsys)[0]
    slow = (shop / "machine.toml").read_text().replace("2960.0", "49.3")
    (here / "hz.toml").write_text(slow)
    assert main(["analyse", str(shop / "new.csv"), "--machine", "hz.toml"]) == 2
    assert "did you mean 2958 (49.3 Hz)?" in lines_of_error(capsys)[0]
