"""Help texts as a newcomer reads them: every example can be pasted into a shell, and works."""

from __future__ import annotations

import glob
import shlex
from itertools import pairwise
from pathlib import Path

import pytest

from gearmon import demos
from gearmon.cli import COMMANDS, main, parsed
from gearmon.commands.command import output_files, outputs_claimed
from gearmon.dynamics import stability
from gearmon.errors import ArgumentError
from gearmon.gears.faults import ERROR_KINDS, KINDS
from gearmon.harvesting import tuning

NAMES = [command.name for command in COMMANDS]
# Files that examples name, and those that stand for them.
FILES = {
    "machine.toml": "machine.toml",
    "healthy.ref": "healthy.ref",
    "fleet.toml": "fleet.toml",
    "idle.csv": "healthy-0.csv",
    "half.csv": "healthy-1.csv",
    "full.csv": "healthy-2.csv",
    "monday.csv": "new.csv",
    "tuesday.csv": "cracked.csv",
    "drive-2026-03-01.csv": "new.csv",
    "drive-2026-03-02.csv": "cracked.csv",
    "new.csv": "cracked.csv",
}


def help_of(capsys, *words):
    capsys.readouterr()
    with pytest.raises(SystemExit) as stop:
        main([*words, "--help"])
    assert stop.value.code == 0
    return capsys.readouterr().out


def example_in(text):
    """The words of the example, as a shell would take them from the screen."""
    shown = text[text.index("example: ") + len("example: ") :]
    # it is the last thing there; a shell joins lines that end in a backslash
    return shlex.split(shown.replace("\\\n", ""))


@pytest.mark.parametrize("name", NAMES)
def test_help_fits_a_terminal_and_ends_with_an_example(capsys, name):
    text = help_of(capsys, name)
    assert max(map(len, text.splitlines())) <= 80
    words = example_in(text)
    assert words[:2] == ["gearmon", name]
    assert all(option in text for option in ("--json", "-o PATH"))
    written = next(command for command in COMMANDS if command.name == name)
    assert words == shlex.split(written.example)


@pytest.mark.parametrize("name", [n for n in NAMES if n not in ("demo", "benchmark")])
def test_the_example_runs(shop, tmp_path, monkeypatch, capsys, name):
    for known, original in FILES.items():
        (tmp_path / known).symlink_to(shop / original)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(stability, "MOST_TONGUES", 0)  # they take most of a minute
    monkeypatch.setattr(tuning, "MOST_STEPS", 10)  # near the best is enough
    words = example_in(help_of(capsys, name))[1:]
    # a shell finds files by their pattern; what is written must not be what is read
    words = [found for word in words for found in (sorted(glob.glob(word)) or [word])]
    if "-o" in words and (tmp_path / words[words.index("-o") + 1]).is_symlink():
        (tmp_path / words[words.index("-o") + 1]).unlink()
    # as few simulated signatures to learn from as may be
    words = ["120" if before == "--examples" else word for before, word in pairwise(["", *words])]
    flags = name in ("analyse", "history", "kinds")
    before = set(tmp_path.iterdir())
    assert main(words) == (1 if flags else 0)
    # what a command writes it has named before it began to work
    named = set(output_files(parsed(words))) | {Path(word) for word in words}
    if name == "fleet":  # its file names them
        named |= set(tmp_path.glob("fleet.db*")) | {tmp_path / "fleet-results"}
    assert set(tmp_path.iterdir()) - before <= {tmp_path / path for path in named}
    if "-o" in words:
        assert (tmp_path / words[words.index("-o") + 1]).stat().st_size > 0


def test_a_folder_that_is_there_may_be_written_into_by_what_writes_a_folder(tmp_path):
    folder = str(tmp_path)
    with outputs_claimed(parsed(["demo", next(iter(demos.DEMOS)), "-o", folder])):
        pass
    single = parsed(["lines", "machine.toml", "-o", folder])
    with pytest.raises(ArgumentError, match="folder"), outputs_claimed(single):
        pass


def test_examples_of_long_runs_name_what_there_is(capsys):
    from gearmon.benchmark import CASES

    assert example_in(help_of(capsys, "demo"))[2] in demos.DEMOS
    assert example_in(help_of(capsys, "benchmark"))[2] in CASES
    told = help_of(capsys, "demo").replace("(", " ").replace(",", " ").split()
    assert set(demos.DEMOS) <= set(told)
    told = " ".join(help_of(capsys, "benchmark").split()).replace(",", " ").split()
    assert set(CASES) <= set(told)


def test_help_names_every_kind_of_fault(capsys):
    told = help_of(capsys, "family").replace(",", " ").replace(";", " ").split()
    assert {*KINDS, *ERROR_KINDS} <= set(told)


def test_the_first_help_lists_all_commands_and_the_exit_codes(capsys):
    text = " ".join(help_of(capsys).split())
    assert all(f" {name} " in text for name in NAMES)
    assert "Exit codes: 0 done" in text
