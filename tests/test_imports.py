"""The package and its help start quickly: they load nothing heavy."""

from __future__ import annotations

import subprocess
import sys

import pytest
from reference.small_gearbox import MACHINE_FILE, simulated

from gearmon.simulation import write_simulation

HEAVY = ("scipy.signal", "scipy.stats", "pandas", "matplotlib", "sklearn")

LOADED = """
import sys
sys.argv[1:] = {arguments!r}
try:
    {action}
except SystemExit as stop:
    status = stop.code
else:
    status = 0
print(status, file=sys.stderr)
print(*sorted(sys.modules), file=sys.stderr)
"""


def loaded_after(action, arguments=()):
    """Exit status and modules loaded after an action in an interpreter of its own."""
    run = subprocess.run(
        [sys.executable, "-c", LOADED.format(action=action, arguments=list(arguments))],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    status, names = run.stderr.strip().splitlines()[-2:]
    return status, set(names.split()), run.stdout


def heavy(names):
    return {
        name for name in names if name in HEAVY or name.startswith(tuple(f"{h}." for h in HEAVY))
    }


def test_package_loads_nothing_heavy():
    _, names, _ = loaded_after("import gearmon")
    assert "gearmon" in names
    assert not heavy(names)
    assert "numpy" not in names


@pytest.mark.parametrize(
    "arguments", [["--help"], ["analyse", "--help"], ["baseline", "--help"], ["--version"]]
)
def test_help_loads_nothing_heavy(arguments):
    action = "import runpy; runpy.run_module('gearmon', run_name='__main__')"
    status, names, shown = loaded_after(action, arguments)
    assert status in {"0", "None"}
    assert "gearmon" in shown
    assert "gearmon.cli" in names
    assert not heavy(names)
    assert "numpy" not in names


def test_reading_and_measuring_need_no_heavy_library():
    _, names, _ = loaded_after("import gearmon.signatures.measured.measurement")
    assert not heavy(names)


def test_judging_a_recording_needs_no_classifier_and_no_picture(tmp_path):
    (tmp_path / "machine.toml").write_text(MACHINE_FILE)
    write_simulation(simulated(), tmp_path / "new.csv")
    words = ["analyse", str(tmp_path / "new.csv"), "--machine", str(tmp_path / "machine.toml")]
    action = "import runpy; runpy.run_module('gearmon', run_name='__main__')"
    _, names, shown = loaded_after(action, words)
    assert "shaft 1 at" in shown
    assert "gearmon.diagnosis.analysis" in names
    assert not {"sklearn", "matplotlib"} & names


def test_module_is_the_command():
    run = subprocess.run(
        [sys.executable, "-m", "gearmon", "--help"],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert run.returncode == 0
    assert "gearmon" in run.stdout
    assert run.stderr == ""
