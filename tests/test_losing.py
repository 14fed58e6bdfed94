"""Killed, out of room, or not alone: a quick round of `losing.py`, which runs longer by hand."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from losing import COMMAND_LINES

from gearmon.cli import COMMANDS

SCRIPT = Path(__file__).parent / "losing.py"


def test_every_command_is_troubled():
    assert {line.split()[0] for line in COMMAND_LINES} == {own.name for own in COMMANDS}


def test_the_old_file_or_the_new_one_whatever_happens():
    # in a process of its own, whose children share nothing with the tests
    given = ["--kills", "12", "--rooms", "16", "--writers", "8"]
    done = subprocess.run(
        [sys.executable, str(SCRIPT), *given], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, "", "")
