"""Run times of mesh stiffness: contact positions of a sound pair, a turn with a cracked tooth.

ROSS is the competitor: the same gears of the same steel in another environment, run in turn.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from gearmon.arrays import FloatArray
from gearmon.benchmark.equations import CRACK, FORM, STAGE
from gearmon.benchmark.timing import Competitor, Timing, interleaved
from gearmon.gears.faults import Fault, parse_fault
from gearmon.gears.pairs import mesh_pairs
from gearmon.gears.stiffness import mesh_stiffness
from gearmon.gears.tooth import Foundation, ToothBeam
from gearmon.gears.tooth_pairs import POTENTIAL_ENERGY, teeth_of
from gearmon.machine import ParallelStage

Row = dict[str, Any]

#: It needs an old plotly.
ROSS = Competitor("ROSS", "GEARMON_ROSS_PYTHON", "ross-rotordynamics 2.3.0 and plotly below 6")
#: A pair with published stiffness by ROSS.
PUBLISHED = ParallelStage(
    pinion_teeth=25,
    gear_teeth=30,
    module_mm=2.0,
    face_width_mm=20.0,
    bore_diameter_pinion_mm=20.0,
    bore_diameter_gear_mm=20.0,
)
POSITIONS = 1000
NO_LIMIT_S = 3600.0


def time_stiffness(repeats: int = 25, ross_python: str | None = None) -> list[Row]:
    """Return the run times of mesh stiffness by the energy of the teeth.

    Parameters
    ----------
    repeats : int, >= 1
    ross_python : str, optional
        Interpreter of an environment with ROSS; by default the environment variable
        GEARMON_ROSS_PYTHON. Without one the rows say so.

    Returns
    -------
    list of dict
        One healthy mesh period at 200 positions; one turn of the pinion with a cracked tooth at
        200 positions a mesh; 1,000 harmonics of that; then 1,000 positions of a healthy mesh
        period, for two pairs, beside ROSS. Columns: case, positions (contact positions or samples
        that came out), median_s, fastest_s, repeats, positions_per_s; times_healthy (over one
        healthy mesh period taken in turn); ross_median_s, ross_times_slower and ross_difference
        (greatest relative difference of the stiffness, at the same contacts); note.

    Raises
    ------
    ArgumentError
        If `ross_python` is no interpreter with ROSS.
    """
    python = ROSS.python(ross_python)
    crack = [parse_fault(CRACK)]
    tasks = (partial(_sample, []), partial(_sample, crack), partial(_harmonics, crack))
    healthy, cracked, harmonics = interleaved(tasks, max(1, repeats), NO_LIMIT_S)
    ratio = cracked.median_s / healthy.median_s
    turn = 200 * STAGE.pinion_teeth
    return [
        _row("healthy mesh period", 200, healthy),
        _row("pinion turn, one cracked tooth", turn, cracked, times_healthy=ratio),
        _row("harmonics, one cracked tooth", 1000, harmonics),
        *(_beside_ross(stage, python, repeats) for stage in (STAGE, PUBLISHED)),
    ]


def _row(case: str, positions: int, timing: Timing, **further: Any) -> Row:
    known = {"case": case, "positions": positions, **timing.columns()}
    known["positions_per_s"] = positions / timing.median_s
    unknown = ("times_healthy", "ross_median_s", "ross_times_slower", "ross_difference")
    return known | dict.fromkeys(unknown) | {"note": ""} | further


def _sample(faults: list[Fault], stage: ParallelStage = STAGE, points: int = 200) -> int:
    return len(mesh_stiffness(stage, faults, FORM).sample(points))


def _harmonics(faults: list[Fault]) -> int:
    return len(mesh_stiffness(STAGE, faults, FORM).harmonics(1000))


def _beside_ross(stage: ParallelStage, python: str | None, repeats: int) -> Row:
    case = f"contact positions, sound pair {stage.pinion_teeth}/{stage.gear_teeth}"
    if python is None:
        task = partial(_sample, [], stage, POSITIONS)
        (own,) = interleaved([task], max(1, repeats), NO_LIMIT_S)
        return _row(case, POSITIONS, own, note=ROSS.absent)

    def same(known: dict[str, Any]) -> ParallelStage:
        """Return the gears of the steel that ROSS has."""
        modulus, ratio = known["elastic_modulus_pa"], known["poisson_ratio"]
        moduli = {f"elastic_modulus_{gear}_pa": modulus for gear in ("pinion", "gear")}
        return replace(stage, poisson_ratio=ratio, **moduli)

    known, theirs, own = ROSS.in_turn(
        python,
        _gears_for_ross(stage),
        lambda known: partial(_sample, [], same(known), POSITIONS),
        min(repeats, 7),
    )
    difference, note = _compared(known, same(known))
    beside = {"ross_median_s": theirs.median_s, "ross_difference": difference, "note": note}
    beside["ross_times_slower"] = theirs.median_s / own.median_s
    return _row(case, len(known["stiffness_n_per_m"]), own, **beside)


def _gears_for_ross(stage: ParallelStage) -> dict[str, Any]:
    bores_mm = stage.bore_diameter_pinion_mm or 0.0, stage.bore_diameter_gear_mm or 0.0
    return {
        "teeth": [stage.pinion_teeth, stage.gear_teeth],
        "bores_m": [1e-3 * bore for bore in bores_mm],
        "module_m": 1e-3 * (stage.module_mm or 0.0),
        "face_width_m": 1e-3 * (stage.face_width_mm or 0.0),
        "pressure_angle_rad": float(np.radians(stage.pressure_angle_deg)),
        "positions": POSITIONS,
    }


def _compared(known: dict[str, Any], stage: ParallelStage) -> tuple[float, str]:
    """Compare the stiffness with the teeth in contact where ROSS puts them.

    Returns
    -------
    (float, str)
        Greatest relative difference to its classical sum of the pairs, with its arm of the
        foundation; and what else there is to say, with neighbours that share the bodies here.
    """
    # the last position is the first of the next period, which ROSS counts to the old one
    stiffness = np.array(known["stiffness_n_per_m"])[:-1]
    pitch = 2 * np.pi / stage.pinion_teeth
    turned = (np.mod(np.array(known["mesh_angles_rad"]), pitch) / pitch)[:-1]
    double = turned <= known["contact_ratio"] - 1
    same = _pair_stiffness(known, stage, turned)
    same[double] += _pair_stiffness(known, stage, turned[double] + 1)
    own = mesh_stiffness(stage, (), POTENTIAL_ENERGY).at(turned)
    single, two = (float(np.median(stiffness[zone])) for zone in (~double, double))
    own_single, own_two = (float(np.median(own[zone])) for zone in (~double, double))
    note = (
        f"ROSS {known['version']}: contact ratio {known['contact_ratio']:.6g}, one pair "
        f"{single:.4g} N/m, two pairs {two:.4g} N/m by the classical sum; here "
        f"{mesh_pairs(stage)[0].contact_ratio:.6g}, {own_single:.4g} and {own_two:.4g} N/m "
        "with shared bodies"
    )
    return float(np.abs(same / stiffness - 1).max()), note


def _pair_stiffness(known: dict[str, Any], stage: ParallelStage, turned: FloatArray) -> FloatArray:
    """Return the stiffness of one pair where ROSS puts its contact: linear in pressure angle."""
    pair = teeth_of(mesh_pairs(stage)[0])
    moved = known["step_rad"] * turned
    one, two = known["pressure_angles_rad"]
    total = pair.compliances(pair.roll(np.zeros(1))).hertz + np.zeros(turned.shape)
    pressures = one + moved, two - known["gear_ratio"] * moved
    for tooth, pressure in zip(pair.teeth, pressures, strict=True):
        angle = np.tan(pressure) - tooth.base_half_angle_rad
        total += sum(ToothBeam(tooth).compliances(angle))
        total += Foundation(tooth=tooth, arm="contact").compliance(angle)
    return np.asarray(1 / total)
