"""What the commands answer: every key and column, and the figures that others build on.

Stored output: it tells that nothing moved, not that it is right. Where a change is meant, `python
tests/test_contracts.py` writes `contracts.json` anew, and its difference is read before it is kept.
"""

from __future__ import annotations

import csv
import json
import sys
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import pytest
from reference.small_gearbox import CRACK

from gearmon.cli import main

STORED = Path(__file__).with_name("contracts.json")
MACHINE, JUDGED = "--machine machine.toml", "--machine machine.toml --reference healthy.ref"
COMMANDS = {
    "lines": "lines machine.toml",
    "stiffness": f"stiffness machine.toml --fault {CRACK}",
    "forms": "stiffness machine.toml --form all",
    "baseline": "baseline machine.toml --max-hz 6000",
    "baseline-cracked": f"baseline machine.toml --max-hz 2500 --fault {CRACK}",
    "family": "family machine.toml --kind crack --size 5% --size 20%",
    "learn": f"learn healthy-0.csv healthy-1.csv {MACHINE}",
    "analyse": f"analyse cracked.csv new.csv {JUDGED}",
    "analyse-alone": f"analyse new.csv {MACHINE}",
    "history": f"history new.csv cracked.csv {JUDGED} --times 2026-03-01,2026-03-08 --limit 60%",
    "indicators": f"indicators new.csv {MACHINE}",
    "spectrum": f"spectrum new.csv {MACHINE} --peaks 3",
    "orders": f"orders new.csv {MACHINE} --peaks 3",
    "harvest": "harvest machine.toml new.csv",
    "harvest-expected": "harvest machine.toml --path-gain 0.01",
}
ENDING = {"learn": "ref", "analyse": "json", "analyse-alone": "json", "harvest": "json"}
# What may differ, relative: what is computed from gear data, measured in samples, and estimated.
EXACT, MEASURED, ESTIMATED = 1e-5, 2e-3, 0.05
FROM_GEAR_DATA = ("lines", "stiffness", "forms", "baseline", "baseline-cracked", "family")


def answered(name: str, folder: Path) -> dict[str, object]:
    """Keys, columns and figures of a command."""
    out = folder / f"{name}.{ENDING.get(name.removesuffix('-expected'), 'csv')}"
    said = StringIO()
    with redirect_stdout(said):
        assert main([*COMMANDS[name].split(), "--json", "-o", str(out)]) in (0, 1, 3)
    found = dict(leaves(json.loads(said.getvalue())))
    columns = []
    if out.suffix == ".csv":
        text = [line for line in out.read_text().splitlines() if not line.startswith("#")]
        columns = next(csv.reader(text))
    return {
        "keys": sorted({anywhere(key) for key in found}),
        "columns": columns[:40],
        "figures": {key: value for key, value in found.items() if is_figure(key, value)},
    }


def leaves(value: object, place: str = ""):
    """Everything that holds nothing else, by its place; of lists the first two."""
    if isinstance(value, dict) and value:
        for key, held in value.items():
            yield from leaves(held, f"{place}.{key}" if place else key)
    elif isinstance(value, list) and value:
        for number, held in enumerate(value[:2]):
            yield from leaves(held, f"{place}[{number}]")
    else:
        yield place, value


def anywhere(key: str) -> str:
    return key.replace("[0]", "[]").replace("[1]", "[]")


def is_figure(key: str, value: object) -> bool:
    """Tell whether a value is worth keeping: verdicts, and numbers with a unit."""
    name = key.rpartition(".")[2]
    if name in ("verdict", "method") or key.startswith("recordings[0].flags[0]."):
        return name in ("verdict", "method", "kind", "gear", "tooth", "stiffness_loss")
    units = ("_hz", "_m", "_ms2", "_n_per_m", "_w", "order", "value")
    # of sums of 1e8 N/m what cancels leaves its rounding, which differs from machine to machine
    least = 1e-3 if name.endswith("_n_per_m") else 1e-9
    return isinstance(value, float) and name.endswith(units) and abs(value) > least


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_answers_as_it_did(name, shop, tmp_path, monkeypatch):
    monkeypatch.chdir(shop)
    found, stored = answered(name, tmp_path), json.loads(STORED.read_text())[name]
    assert found["keys"] == stored["keys"]
    assert found["columns"] == stored["columns"]
    for key, value in stored["figures"].items():
        near = EXACT if name in FROM_GEAR_DATA else MEASURED
        near = ESTIMATED if key.endswith(("_loss", "uncertainty_hz", "power_w")) else near
        expected = pytest.approx(value, rel=near) if isinstance(value, float) else value
        assert found["figures"].get(key) == expected, key


if __name__ == "__main__":
    # in a folder with what the fixture `shop` makes: python tests/test_contracts.py FOLDER
    import os
    import tempfile

    os.chdir(sys.argv[1])
    with tempfile.TemporaryDirectory() as place:
        written = {name: answered(name, Path(place)) for name in COMMANDS}
    STORED.write_text(json.dumps(written, indent=0, ensure_ascii=False) + "\n")
