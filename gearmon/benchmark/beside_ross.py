"""ROSS as a competitor: the same gears in another environment, run in turn with this one."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any

import numpy as np

from gearmon.errors import ArgumentError
from gearmon.gears.foundation import Foundation
from gearmon.gears.pairs import mesh_pairs
from gearmon.gears.pulses import FloatArray
from gearmon.gears.stiffness import mesh_stiffness
from gearmon.gears.tooth import ToothBeam
from gearmon.gears.tooth_pairs import POTENTIAL_ENERGY, teeth_of
from gearmon.machine import ParallelStage

#: Names the interpreter of an environment with ROSS, which needs an old plotly.
VARIABLE = "GEARMON_ROSS_PYTHON"
#: What that environment must hold.
NEEDS = "ross-rotordynamics 2.3.0 and plotly below 6"
SCRIPT = Path(__file__).with_name("ross_positions.py")


@dataclass(frozen=True, kw_only=True)
class RossRun:
    """Run times of ROSS and of a task here, taken in turn, and how far the stiffness agrees.

    Parameters
    ----------
    version : str
        Of ROSS.
    positions : int
        Contact positions of one mesh period.
    ross_s, own_s : tuple of float
        Run times [s], in turn.
    difference : float
        Greatest relative difference of the mesh stiffness over the positions, with the teeth in
        contact where ROSS puts them, its classical sum of the pairs and its arm of the foundation.
    contact_ratios : (float, float)
        By ROSS and here.
    single_n_per_m, double_n_per_m : float
        Median over the zones of one and of two pairs by ROSS.
    own_single_n_per_m, own_double_n_per_m : float
        The same here, where neighbours share the bodies of the gears.
    """

    version: str
    positions: int
    ross_s: tuple[float, ...]
    own_s: tuple[float, ...]
    difference: float
    contact_ratios: tuple[float, float]
    single_n_per_m: float
    double_n_per_m: float
    own_single_n_per_m: float
    own_double_n_per_m: float

    @property
    def ratio(self) -> float:
        """Median run time of ROSS over that of the task here."""
        return statistics.median(self.ross_s) / statistics.median(self.own_s)


def ross_python(given: str | None = None) -> str | None:
    """Return the interpreter of the environment with ROSS, or None if none is named.

    Parameters
    ----------
    given : str, optional
        By default the environment variable GEARMON_ROSS_PYTHON.

    Raises
    ------
    ArgumentError
        If the name is not that of a file.
    """
    name = given if given is not None else os.environ.get(VARIABLE)
    if not name:
        return None
    if not Path(name).is_file():
        raise ArgumentError(
            f"{VARIABLE}={name!r} is no file; it must name the Python interpreter of an "
            f"environment with {NEEDS}"
        )
    return name


def run_against_ross(
    python: str, stage: ParallelStage, task: Callable[[ParallelStage], int], rounds: int = 5
) -> RossRun:
    """Time ROSS and a task here in turn, on the same gears of the same steel.

    Parameters
    ----------
    python : str
        Interpreter of the other environment.
    stage : ParallelStage
        A spur pair without profile shift.
    task : callable
        Takes the stage with the steel of ROSS.
    rounds : int, >= 1

    Raises
    ------
    ArgumentError
        If the other environment does not answer.
    """
    data = {
        "teeth": [stage.pinion_teeth, stage.gear_teeth],
        "bores_m": [
            1e-3 * (stage.bore_diameter_pinion_mm or 0.0),
            1e-3 * (stage.bore_diameter_gear_mm or 0.0),
        ],
        "module_m": 1e-3 * (stage.module_mm or 0.0),
        "face_width_m": 1e-3 * (stage.face_width_mm or 0.0),
        "pressure_angle_rad": float(np.radians(stage.pressure_angle_deg)),
    }
    with subprocess.Popen(
        [python, "-I", str(SCRIPT), json.dumps(data)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as other:
        if other.stdin is None or other.stdout is None:  # pragma: no cover - both are pipes
            raise ArgumentError(f"{python}: no pipes to the other interpreter")
        known = _answer(other.stdout, python)
        same = _of_its_steel(stage, known)
        task(same)
        theirs, own = [], []
        for _ in range(max(1, rounds)):
            print(file=other.stdin, flush=True)
            theirs.append(float(_answer(other.stdout, python)))
            start = time.perf_counter()
            task(same)
            own.append(time.perf_counter() - start)
        other.stdin.close()
    return _compared(known, same, theirs, own)


def _answer(answers: IO[str], python: str) -> Any:
    line = answers.readline()
    if not line.strip():
        raise ArgumentError(f"{python} gives no answer: its environment must hold {NEEDS}")
    return json.loads(line)


def _of_its_steel(stage: ParallelStage, known: dict[str, Any]) -> ParallelStage:
    modulus = known["elastic_modulus_pa"]
    return replace(
        stage,
        elastic_modulus_pinion_pa=modulus,
        elastic_modulus_gear_pa=modulus,
        poisson_ratio=known["poisson_ratio"],
    )


def _compared(
    known: dict[str, Any], stage: ParallelStage, theirs: list[float], own: list[float]
) -> RossRun:
    # the last position is the first of the next period, which ROSS counts to the old one
    stiffness = np.array(known["stiffness_n_per_m"])[:-1]
    turned = _turned(known, stage)[:-1]
    double = turned <= known["contact_ratio"] - 1
    same = _pair_stiffness(known, stage, turned)
    same[double] += _pair_stiffness(known, stage, turned[double] + 1)
    own_stiffness = mesh_stiffness(stage, (), POTENTIAL_ENERGY).at(turned)
    return RossRun(
        version=known["version"],
        positions=len(known["stiffness_n_per_m"]),
        ross_s=tuple(theirs),
        own_s=tuple(own),
        difference=float(np.abs(same / stiffness - 1).max()),
        contact_ratios=(known["contact_ratio"], mesh_pairs(stage)[0].contact_ratio),
        single_n_per_m=float(np.median(stiffness[~double])),
        double_n_per_m=float(np.median(stiffness[double])),
        own_single_n_per_m=float(np.median(own_stiffness[~double])),
        own_double_n_per_m=float(np.median(own_stiffness[double])),
    )


def _turned(known: dict[str, Any], stage: ParallelStage) -> FloatArray:
    """Return its positions in mesh periods, in [0, 1)."""
    pitch = 2 * np.pi / stage.pinion_teeth
    return np.asarray(np.mod(np.array(known["mesh_angles_rad"]), pitch) / pitch)


def _pair_stiffness(known: dict[str, Any], stage: ParallelStage, turned: FloatArray) -> FloatArray:
    """Return the stiffness of one pair where ROSS puts its contact: linear in pressure angle."""
    pair = teeth_of(mesh_pairs(stage)[0])
    moved = known["step_rad"] * turned
    one, two = known["pressure_angles_rad"]
    total = pair.compliances(pair.roll(np.zeros(1))).hertz + np.zeros(turned.shape)
    for tooth, pressure in zip(
        pair.teeth, (one + moved, two - known["gear_ratio"] * moved), strict=True
    ):
        angle = np.tan(pressure) - tooth.base_half_angle_rad
        total += sum(ToothBeam(tooth).compliances(angle))
        total += Foundation(tooth=tooth, arm="contact").compliance(angle)
    return np.asarray(1 / total)
