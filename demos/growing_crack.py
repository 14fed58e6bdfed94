"""A crack that grows, week by week: when it is seen, and when it will reach a limit.

Run it as it stands: python demos/growing_crack.py
"""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import gearmon
from gearmon.diagnosis.history import History, entry_of, history_trends
from gearmon.report import history_figure, history_lines, save

FOLDER = Path("gearmon-growth")
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
START, WEEK = datetime(2026, 1, 5, 8, tzinfo=UTC), timedelta(days=7)

# The truth: four sound weeks, then tooth 7 of the pinion loses stiffness, slowly, then faster.
LOSSES = [0.0] * 4 + [0.35 * (n / 8) ** 1.5 for n in range(1, 9)]


def record(name, seed, load, loss=0.0):
    made = gearmon.simulate(
        MACHINE,
        [f"crack:1:pinion:7:{loss:.3%}"] if loss else [],
        duration_s=5.0,
        sampling_rate_hz=10_240.0,
        machine_seed=1,
        recording_seed=seed,
        channels=2,
        load=load,
        tacho_shaft=1,
    )
    (path,) = made.save(FOLDER / f"{name}.csv")
    return gearmon.read_recording(path)


def main():
    FOLDER.mkdir(exist_ok=True)
    healthy = [record(f"healthy-{n}", 100 + n, load) for n, load in enumerate((0.6, 0.8, 1.0))]
    reference = gearmon.learn(healthy, MACHINE)

    # Each recording becomes one entry of the machine's history: what it says of every tooth.
    history = History(machine=MACHINE.name)
    for week, loss in enumerate(LOSSES):
        recording = record(f"week-{week + 1:02d}", week, 0.7 + 0.025 * week, loss)
        analysis = gearmon.analyse(recording, MACHINE, reference)
        history = history.with_entry(entry_of(analysis, START + week * WEEK))
        print(f"week {week + 1:2d}: true loss {loss:5.1%}, {analysis.verdict}")

    # One recording has an interval; many have a trend: when it began, how fast it grows, and when
    # it will reach the limit that you set.
    found = history_trends(history, limit=0.3)
    print(*history_lines(found), sep="\n")
    print("picture:", save(history_figure(found, LOSSES), FOLDER / "growth.png"))


if __name__ == "__main__":
    main()
