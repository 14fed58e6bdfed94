"""What the strength of evidence means on healthy machines: makes the table of the false alarms.

``python -m gearmon.benchmark.calibration --machines 40 -o calibration.json`` draws machines as the
benchmark of detection does, has every second of them vibrate as `gearmon.simulation` would have it,
makes healthy recordings at several loads, speeds, gains and lengths, and holds each against
references of one to five others; the table goes to ``gearmon/diagnosis/decision/calibration.json``.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gearmon.benchmark.detection_machines import Bench, Condition, Setting, draw_machine
from gearmon.diagnosis.analysis import evidence_against
from gearmon.diagnosis.decision.calibration import situation, table_of
from gearmon.errors import GearmonError
from gearmon.files import write_atomically
from gearmon.machine import Machine
from gearmon.signals.recording import Recording
from gearmon.signatures.measured.measurement import MeasuredSignature, measure_signature
from gearmon.signatures.measured.reference import make_reference
from gearmon.simulation import simulate
from gearmon.terminal import progress_line

MACHINES, SEED = 40, 2026
#: Loads of the recordings that are learned from, and which of them each reference holds.
LEARNED = (1.0, 1.0, 0.7, 0.5, 0.85)
REFERENCES = ((0,), (2,), (0, 1), (0, 3), (0, 2, 3), (0, 1, 2, 3, 4))
#: Loads of the others; and two at other speeds, one of them with another gain, and a short one.
JUDGED = (1.0, 0.9, 0.6, 1.15)
#: Two recordings at one operating point differ by so much in load and speed; others in speed.
LOAD_SPREAD, SPEED_SPREAD, OTHER_SPEED = 0.02, 0.002, 0.02
SHORT_S = 4.0
#: Of `gearmon.simulation`: its duration over that of the others, rate [Hz], flank tolerance classes
#: of ISO 1328-1, and least torque over the drawn one, down to 10 N/mm.
SIMULATED, RATE_HZ, GRADES, LEAST_TORQUE = 0.6, 12_800.0, (5.0, 8.0), 0.1


@dataclass(frozen=True, kw_only=True)
class _Simulated:
    """A drawn machine whose recordings `gearmon.simulation` makes, pair of teeth by pair of teeth.

    Their pattern changes with the load: teeth that are off share it otherwise, and lose contact.
    """

    machine: Machine
    seed: int
    grade: float

    @classmethod
    def draw(cls, rng: np.random.Generator, number: int) -> _Simulated:
        machine = draw_machine(rng, number).machine
        torque_nm = machine.operating[0].torque_nm * np.exp(rng.uniform(np.log(LEAST_TORQUE), 0.0))
        point = replace(machine.operating[0], torque_nm=torque_nm)
        return cls(
            machine=replace(machine, operating=(point,)),
            seed=int(rng.integers(1 << 31)),
            grade=rng.uniform(*GRADES),
        )

    def take(self, setting: Setting) -> Recording:
        """Make a healthy recording."""
        made = simulate(
            self.machine,
            duration_s=SIMULATED * setting.duration_s,
            sampling_rate_hz=RATE_HZ,
            machine_seed=self.seed,
            recording_seed=setting.seed,
            channels=1 + self.seed % 2,
            load=setting.load,
            slip=1.0 - setting.speed,
            accuracy_grade=self.grade,
            tacho_shaft=1 if setting.tacho else None,
        )
        gain = np.where(np.array(made.channel_kinds) == "vibration", setting.gain, 1.0)
        return Recording(
            samples=gain[:, None] * made.samples,
            sampling_rate_hz=made.sampling_rate_hz,
            channel_names=made.channel_names,
            channel_kinds=made.channel_kinds,
        )


Learned = list[MeasuredSignature | None]


def healthy_signatures(number: int, seed: int = SEED) -> tuple[Machine, Learned, Learned]:
    """Measure healthy recordings of one drawn machine.

    Parameters
    ----------
    number, seed : int
        Which machine: those of even numbers are of the benchmark of detection, the others those of
        `gearmon.simulation`. Every second one of either has a tachometer.

    Returns
    -------
    machine : Machine
    learned, judged : list of MeasuredSignature or None
        None where no mesh was found.
    """
    rng = np.random.default_rng([seed, number])
    take: Callable[[Setting], Recording]
    if number % 2:
        simulated = _Simulated.draw(rng, number)
        machine, take = simulated.machine, simulated.take
    else:
        bench = Bench(drawn=draw_machine(rng, number))
        machine = bench.drawn.machine

        def take(setting: Setting) -> Recording:
            return bench.take(Condition(), setting).recording

    def signature(**setting: float) -> MeasuredSignature | None:
        own = Setting(seed=int(rng.integers(1 << 31)), tacho=number % 4 < 2, **setting)
        try:
            found = measure_signature(take(own), machine)
        except GearmonError:
            return None
        return found if found.found else None

    def steady(load: float, **setting: float) -> MeasuredSignature | None:
        return signature(
            load=load * (1 + LOAD_SPREAD * rng.uniform(-1, 1)),
            speed=1 + SPEED_SPREAD * rng.uniform(-1, 1),
            **setting,
        )

    learned = [steady(load) for load in LEARNED]
    judged = [steady(load) for load in JUDGED]
    other = 1 + OTHER_SPEED * rng.uniform(-1, 1, 2)
    judged.append(signature(speed=other[0]))
    loud = 2.0 ** rng.uniform(-1, 1)
    judged.append(signature(load=rng.uniform(0.8, 1.2), speed=other[1], gain=loud))
    judged.append(steady(0.95, duration_s=SHORT_S))
    return machine, learned, judged


def healthy_strengths(
    machine: Machine, learned: Learned, judged: Learned
) -> Iterator[tuple[str, float]]:
    """Hold healthy recordings of one machine against references of others.

    Parameters
    ----------
    machine, learned, judged
        See `healthy_signatures`.

    Yields
    ------
    str, float
        Situation, see `diagnosis.decision.calibration.situation`, and strength of the evidence.
    """
    for chosen in REFERENCES:
        known = [learned[row] for row in chosen]
        if any(one is None for one in known):
            continue
        reference = make_reference([one for one in known if one is not None], machine)
        rest = [learned[row] for row in range(len(learned)) if row not in chosen]
        for own in [*rest, *judged]:
            if own is not None:
                evidence = evidence_against(own, machine, reference)
                gap = evidence.deviation.gap
                yield situation(len(chosen), gap), evidence.strength


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
        for number in range(machines):
            for name, strength in healthy_strengths(*healthy_signatures(number, seed)):
                found.setdefault(name, []).append(strength)
            if progress is not None:
                progress((number + 1) / machines)
    origin = (
        f"python -m gearmon.benchmark.calibration --machines {machines} --seed {seed}: healthy "
        "recordings of drawn machines, half of the benchmark of detection and half of "
        "gearmon.simulation (flank classes 5 to 8, 10 to 350 N/mm), loads 50 to 115 %, speeds "
        "+-2 %, gains to a factor of 2, 4 and 10 s (2.4 and 6 s), half with a tachometer"
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
