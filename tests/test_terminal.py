"""What a terminal gives and gets: files, folders and standard input; colours; the time it takes."""

from __future__ import annotations

import errno
import io
import sys
from types import SimpleNamespace

import pytest
from reference.small_gearbox import MACHINE_FILE

from gearmon.cli import main
from gearmon.commands.command import recordings_named
from gearmon.errors import ArgumentError
from gearmon.terminal import coloured, followed, part_of, progress_line


def test_a_folder_stands_for_the_recordings_in_it(tmp_path):
    for name in ("b.csv", "a.WAV", "b.json", "healthy.ref"):
        (tmp_path / name).write_text("")
    inside = [str(tmp_path / "a.WAV"), str(tmp_path / "b.csv")]
    assert recordings_named(["x.csv", str(tmp_path), "-"]) == ["x.csv", *inside, "-"]


def test_a_folder_without_a_recording_stays_and_two_inputs_are_refused(tmp_path):
    assert recordings_named([str(tmp_path)]) == [str(tmp_path)]
    with pytest.raises(ArgumentError, match="named twice"):
        recordings_named(["-", "a.csv", "-"])


def test_standard_input_is_read_as_a_file_is(monkeypatch, capsys):
    rows = "\n".join(f"{0.001 * k:.3f},{(-1) ** k * (k % 7)}" for k in range(4000))
    text = io.BytesIO(f"time [s],a1 [m/s2]\n{rows}\n".encode())
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=text))
    assert main(["spectrum", "-"]) == 0
    assert "standard input" in capsys.readouterr().out


@pytest.mark.parametrize("when", ["write", "flush"])
@pytest.mark.parametrize(
    ("error", "code", "told"),
    [
        (BrokenPipeError(errno.EPIPE, "Broken pipe"), 0, ""),
        (OSError(errno.ENOSPC, "No space left"), 2, "gearmon: standard output: No space left\n"),
    ],
)
def test_a_reader_may_have_seen_enough_but_a_full_disk_is_said(
    tmp_path, monkeypatch, capsys, when, error, code, told
):
    def fails(*_):
        raise error

    machine = tmp_path / "m.toml"
    machine.write_text(MACHINE_FILE)
    out = io.StringIO()
    monkeypatch.setattr(out, when, fails)
    monkeypatch.setattr(sys, "stdout", out)
    assert main(["lines", str(machine)]) == code
    assert capsys.readouterr().err == told


def test_a_speed_hint_must_be_a_speed(tmp_path, capsys):
    machine = tmp_path / "m.toml"
    machine.write_text(
        "[operating]\nspeed_rpm = 1480.0\n[[stage]]\nkind = 'parallel'\n"
        "pinion_teeth = 23\ngear_teeth = 57\n"
    )
    given = ["analyse", "none.csv", "--machine", str(machine), "--speed-hint", "-3"]
    assert main(given) == 2
    assert "--speed-hint" in capsys.readouterr().err


@pytest.mark.parametrize(("watched", "no_colour"), [(True, ""), (True, "1"), (False, "")])
def test_verdicts_have_colours_where_somebody_sees_them(monkeypatch, watched, no_colour):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("NO_COLOR", no_colour)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: watched)
    line = "new.csv: FAULT, by default"
    expected = "new.csv: \033[1;31mFAULT\033[0m, by default"
    assert coloured(line) == (expected if watched and not no_colour else line)


def test_long_work_tells_its_time_on_a_terminal_only(monkeypatch, capsys):
    monkeypatch.setattr("gearmon.terminal._PATIENCE_S", 0.02)
    for watched in (False, True):
        monkeypatch.setattr(sys.stderr, "isatty", lambda seen=watched: seen)
        with progress_line("family") as progress:
            _pause(0.1)
            if progress is not None:
                part_of(progress, 0.5, 0.5)(0.4)
            _pause(1.0)
        told = capsys.readouterr().err
        assert ("family: 0 s" in told) is watched
        assert ("family: ##############...... 70 % after 1 s" in told) is watched
    assert part_of(None, 0.5, 0.5) is None


def test_work_is_done_by_as_much_as_came_back_for_more():
    """A part is told when it is through, the last one with all; of a part, within its part."""
    told = []
    for number in followed("abcd", 4, part_of(told.append, 0.2, 0.8)):
        assert len(told) == "abcd".index(number)
    assert told == pytest.approx([0.4, 0.6, 0.8, 1.0])
    assert list(followed("ab", 2, None)) == ["a", "b"]


def _pause(seconds):
    from threading import Event

    Event().wait(seconds)
