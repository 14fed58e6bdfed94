"""What the strength of evidence means on healthy machines: makes the table of the false alarms.

``python -m gearmon.benchmark.calibration --machines 40 -o calibration.json`` draws machines as the
benchmark of detection does, makes healthy recordings at several loads, speeds, gains and lengths,
and holds each against references of one to five others; the table goes to
``gearmon/diagnosis/decision/calibration.json``.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from gearmon.benchmark.detection_machines import Condition, Setting, draw_machine
from gearmon.diagnosis.analysis import evidence_against
from gearmon.diagnosis.decision.thresholds import situation, table_of
from gearmon.errors import GearmonError
from gearmon.files import write_atomically
from gearmon.signatures.measured.measurement import MeasuredSignature, measure_signature
from gearmon.signatures.measured.reference import make_reference
from gearmon.terminal import followed, progress_line

MACHINES, SEED = 40, 2026
#: Loads of the recordings that are learned from, and which of them each reference holds.
LEARNED = (1.0, 1.0, 0.7, 0.5, 0.85)
REFERENCES = ((0,), (2,), (0, 1), (0, 3), (0, 2, 3), (0, 1, 2, 3, 4))
#: Loads of the others; and two at other speeds, one of them with another gain, and a short one.
JUDGED = (1.0, 0.9, 0.6, 1.15)
#: Two recordings at one operating point differ by so much in load and speed; others in speed.
LOAD_SPREAD, SPEED_SPREAD, OTHER_SPEED = 0.02, 0.002, 0.02
SHORT_S = 4.0


def healthy_strengths(number: int, seed: int = SEED) -> Iterator[tuple[str, float]]:
    """Hold healthy recordings of one drawn machine against references of others.

    Parameters
    ----------
    number, seed : int
        Which machine.

    Yields
    ------
    str, float
        Situation, see `diagnosis.decision.thresholds.situation`, and strength of the evidence.
    """
    rng = np.random.default_rng([seed, number])
    drawn = draw_machine(rng, number)

    def signature(**setting: float) -> MeasuredSignature | None:
        drawn_seed = int(rng.integers(1 << 31))
        # every second machine has a tachometer
        taken = drawn.take(Condition(), Setting(seed=drawn_seed, tacho=number % 2 == 0, **setting))
        with suppress(GearmonError):
            found = measure_signature(taken.recording, drawn.machine)
            return found if found.found else None
        return None

    def about(spread: float, middle: float = 1.0) -> float:
        return float(middle * (1 + spread * rng.uniform(-1, 1)))

    def steady(load: float) -> MeasuredSignature | None:
        return signature(load=about(LOAD_SPREAD, load), speed=about(SPEED_SPREAD))

    learned = [steady(load) for load in LEARNED]
    judged = [steady(load) for load in JUDGED]
    judged.append(signature(speed=about(OTHER_SPEED)))
    load, speed, gain = rng.uniform(0.8, 1.2), about(OTHER_SPEED), 2.0 ** rng.uniform(-1, 1)
    judged.append(signature(load=load, speed=speed, gain=gain))
    judged.append(signature(load=0.95, duration_s=SHORT_S))
    for chosen in REFERENCES:
        known = [own for row, own in enumerate(learned) if row in chosen and own is not None]
        if len(known) < len(chosen):
            continue
        reference = make_reference(known, drawn.machine)
        rest = [own for row, own in enumerate(learned) if row not in chosen]
        for own in [*rest, *judged]:
            if own is not None:
                evidence = evidence_against(own, drawn.machine, reference)
                yield situation(len(chosen), evidence.deviation.gap), evidence.strength


def calibrate(machines: int = MACHINES, seed: int = SEED) -> dict[str, Any]:
    """Make the table of the false alarms.

    Parameters
    ----------
    machines : int
        How many to draw.
    seed : int
        Of the draws.
    """
    found: dict[str, list[float]] = {}
    with progress_line("calibrating") as progress:
        for number in followed(range(machines), machines, progress):
            for name, strength in healthy_strengths(number, seed):
                found.setdefault(name, []).append(strength)
    origin = (
        f"python -m gearmon.benchmark.calibration --machines {machines} --seed {seed}: healthy "
        "recordings of drawn machines, loads 50 to 115 %, speeds +-2 %, gains to a factor of 2, "
        "4 and 10 s, every second machine with a tachometer"
    )
    return table_of(found, origin)


def main(argv: Sequence[str] | None = None) -> int:
    """Make the table and write it."""
    parser = argparse.ArgumentParser(prog="gearmon.benchmark.calibration", description=__doc__)
    parser.add_argument("--machines", type=int, default=MACHINES)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("-o", "--output", required=True)
    arguments = parser.parse_args(argv)
    table = calibrate(arguments.machines, arguments.seed)
    write_atomically(arguments.output, json.dumps(table, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
