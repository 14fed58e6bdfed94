"""README's story: three loads learned, or one, without a tachometer; then a crack, and none."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from reference.synthetic_signals import as_recording

from gearmon.diagnosis.analysis import analyse, learn
from gearmon.gears.faults import parse_fault
from gearmon.machine import Machine, OperatingPoint, ParallelStage
from gearmon.signatures.measured.reference import write_reference
from gearmon.simulation import simulate

README = Path(__file__).resolve().parents[1] / "README.md"


@cache
def machine():
    stage = ParallelStage(pinion_teeth=23, gear_teeth=57, module_mm=2.5, face_width_mm=28.0)
    point = OperatingPoint(speed_rpm=1480.0, torque_nm=120.0)
    return Machine(name="conveyor drive", operating=(point,), stages=(stage,))


@cache
def recording(load, seed, fault=""):
    faults = [parse_fault(fault)] if fault else []
    return as_recording(
        simulate(
            machine(),
            faults,
            8.0,
            10_240.0,
            machine_seed=3,
            recording_seed=seed,
            channels=2,
            load=load,
        )
    )


@cache
def reference(loads):
    return learn([recording(load, seed) for seed, load in enumerate(loads)], machine())


LEARNED = [(0.4, 0.7, 1.0), (1.0,), (1.0, 1.0)]


@cache
def analysis(loads, load, seed, fault=""):
    return analyse(recording(load, seed, fault), machine(), reference(loads))


@pytest.mark.parametrize("loads", LEARNED)
@pytest.mark.parametrize("gear", ["pinion", "gear"])
def test_the_crack_is_found_however_the_machine_was_learned(loads, gear):
    told = analysis(loads, 0.9, 11, f"crack:1:{gear}:5:20%")
    assert told.verdict == "fault"
    assert (told.flags[0].kind, told.flags[0].stage) == ("tooth damage", 1)
    assert told.flags[0].gear == gear
    assert told.reason.startswith("Damage of tooth")


@pytest.mark.parametrize("loads", LEARNED)
@pytest.mark.parametrize("load", [0.8, 0.95])
def test_a_healthy_recording_is_no_fault(loads, load):
    told = analysis(loads, load, 21)
    assert told.verdict == "healthy"
    assert told.reason.startswith("The machine sounds as it did")


@pytest.mark.parametrize("gear", ["pinion", "gear"])
def test_evidence_does_not_shrink_with_references(gear):
    crack = 0.9, 11, f"crack:1:{gear}:5:20%"
    alone = analysis((1.0,), *crack).score
    assert analysis((0.4, 0.7, 1.0), *crack).score > 0.7 * alone


def python_blocks():
    """The Python blocks of README, in their order."""
    text = README.read_text("utf-8")
    return re.findall(r"```python\n(.*?)```", text, re.DOTALL)


def test_the_block_on_arrays_runs_and_finds_the_crack(tmp_path, monkeypatch, capsys):
    block = next(own for own in python_blocks() if "np.load" in own)
    assert len([line for line in block.splitlines() if line.strip()]) <= 15
    imported = {line.split()[1] for line in block.splitlines() if line.startswith("import ")}
    assert imported <= {"gearmon", "numpy", "matplotlib"}
    monkeypatch.chdir(tmp_path)
    known = [recording(load, seed) for seed, load in enumerate((0.4, 0.7, 1.0))]
    new = recording(0.9, 11, "crack:1:pinion:5:20%")
    np.save("recordings.npy", [own.samples for own in (*known, new)])
    exec(block, {})
    assert capsys.readouterr().out.startswith("FAULT: Damage of tooth")
    assert (tmp_path / "orders.png").stat().st_size > 10_000
    found = pd.read_csv("findings.csv")
    assert list(found["gear"][:1]) == ["pinion"]
    assert {"verdict", "stage", "tooth", "stiffness_loss_low"} <= set(found.columns)


def test_the_block_on_files_runs(tmp_path, monkeypatch, capsys):
    block = next(own for own in python_blocks() if '"healthy.ref"' in own)
    monkeypatch.chdir(tmp_path)
    write_reference(reference((1.0,)), "healthy.ref")
    recording(0.9, 11, "crack:1:pinion:5:20%").to_frame().to_csv("new.csv", index=False)
    toml = re.findall(r"```toml\n(.*?)```", README.read_text("utf-8"), re.DOTALL)
    Path("machine.toml").write_text("".join(own for own in toml if "[[machine]]" not in own))
    exec(block, {})
    assert "verdict='fault'" in capsys.readouterr().out
