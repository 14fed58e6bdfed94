"""A sound machine through a working day: load and speed change, and nothing is wrong.

A limit on the level of the vibration would cry wolf. What is judged against a reference that knows
several loads should not.

Run it as it stands: python demos/changing_day.py
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import gearmon

MACHINE = gearmon.load_machine(
    name="conveyor drive",
    operating={"speed_rpm": 1480.0, "torque_nm": 120.0},
    stage={
        "kind": "parallel",
        "pinion_teeth": 23,
        "gear_teeth": 57,
        "module_mm": 2.5,
        "face_width_mm": 28.0,
    },
)


def record(seed, load, slip):
    made = gearmon.simulate(
        MACHINE,
        duration_s=5.0,
        sampling_rate_hz=10_240.0,
        machine_seed=1,
        recording_seed=seed,
        channels=2,
        load=load,
        slip=slip,  # a motor runs slower under load: the nominal speed is never the true one
        tacho_shaft=1,
    )
    return gearmon.read_recording(made)


def level_db(recording):
    return 10 * np.log10(recording.vibration().samples[0].var())


def main():
    # the day before: five recordings across the range of loads
    learned = [record(100 + n, load, 0.01) for n, load in enumerate((0.5, 0.65, 0.8, 0.95, 1.1))]
    reference = gearmon.learn(learned, MACHINE)

    # two shifts with a break
    hours = np.arange(6, 18)
    loads = 0.8 + 0.27 * np.sin(2 * np.pi * (hours - 6) / 8.0 - 1.0)
    slips = 0.004 + 0.016 * np.sin(2 * np.pi * hours / 11.0)
    levels, scores, verdicts = [], [], []
    for hour, load, slip in zip(hours, loads, slips, strict=True):
        recording = record(int(hour), float(load), float(slip))
        analysis = gearmon.analyse(recording, MACHINE, reference)
        levels.append(level_db(recording) - np.mean([level_db(one) for one in learned]))
        scores.append(analysis.score)
        verdicts.append(analysis.verdict)
        print(f"{hour:02d}:00  load {load:4.0%}  level {levels[-1]:+5.1f} dB  {analysis.verdict}")

    # The level follows the load by several decibels; the score, which knows the load, does not.
    figure, (above, below) = plt.subplots(2, 1, sharex=True, layout="constrained")
    above.plot(hours, levels, "o-")
    above.axhline(3.0, linestyle="--", color="grey")
    above.set_ylabel("level over reference in dB")
    below.plot(hours, scores, "s-")
    below.set(xlabel="hour of the day", ylabel="score")
    figure.suptitle(f"false alarms: {verdicts.count('fault')} of {len(hours)}")
    path = Path("gearmon-day.png")
    figure.savefig(path)
    print("picture:", path)


if __name__ == "__main__":
    main()
