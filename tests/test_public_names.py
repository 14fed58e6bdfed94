"""The public names: each is found where it is said to live, and nothing else is."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

import pytest

import gearmon

PROMISED = {
    "load_machine",
    "read_recording",
    "expected_signature",
    "measure_signature",
    "learn",
    "analyse",
    "tune_harvester",
    "open_recording",
    "time_synchronous_average",
    "angular_waveform",
    "order_map",
    "order_spectra",
    "gear_averages",
    "indicator_table",
    "recording_spectrum",
    "fault_family",
    "loss_response",
    "train_kinds",
}


@pytest.mark.parametrize("name", gearmon.__all__)
def test_every_public_name_resolves(name):
    value = getattr(gearmon, name)
    assert value is getattr(gearmon, name)
    if name != "__version__":
        assert value.__name__ == name
        assert value.__module__.startswith("gearmon.")
        assert value.__doc__


def test_promised_names_are_there():
    assert set(gearmon.__all__) >= PROMISED


def test_names_that_the_readme_gives_are_there():
    text = open_text(Path(__file__).parents[1] / "README.md")
    names = set(re.findall(r"`gearmon\.([a-z_]+(?:\.[a-z_]+)*)", text))
    assert len(names) > 3
    for name in names:
        value = gearmon
        for part in name.split("."):
            value = getattr(value, part, None) or import_module(f"{value.__name__}.{part}")


def test_names_are_listed_sorted_and_once():
    assert dir(gearmon) == sorted(set(gearmon.__all__))


def test_homes_are_declared_for_type_checkers_too():
    text = open_text(gearmon.__file__)
    typed = {line.split(" as ")[-1].strip(" ,") for line in text.splitlines() if " as " in line}
    assert set(gearmon.__all__) - {"__version__"} <= typed


def open_text(path):
    with open(path, encoding="utf-8") as file:
        return file.read()


def test_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'gearmon' has no attribute 'analize'"):
        gearmon.analize  # noqa: B018


def test_star_import():
    names: dict[str, object] = {}
    exec("from gearmon import *", names)
    assert set(gearmon.__all__) <= set(names)


def test_version_is_that_of_the_distribution():
    assert gearmon.__version__ == version("gearmon")


def test_one_name_loads_only_its_home():
    script = (
        "import sys, gearmon; gearmon.load_machine; "
        "print([m for m in sys.modules if m.startswith(('gearmon.signals', 'gearmon.report'))])"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.strip() == "[]"


DEMOS = sorted((Path(__file__).resolve().parents[1] / "demos").glob("*.py"))


@pytest.mark.parametrize("path", DEMOS, ids=lambda own: own.stem)
def test_scripts_that_teach_are_short_and_use_public_names(path):
    text = path.read_text("utf-8")
    assert 40 <= len(text.splitlines()) <= 100
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("gearmon"):
            offered = import_module(node.module).__all__
            assert {own.name for own in node.names} <= set(offered), node.module
