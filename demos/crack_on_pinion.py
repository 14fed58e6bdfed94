"""A crack on one tooth of a pinion: learn what healthy is, then ask what a new recording says.

Run it as it stands: python demos/crack_on_pinion.py
"""

from pathlib import Path

import gearmon
from gearmon.report import analysis_figures, analysis_text, save

FOLDER = Path("gearmon-crack")

# What the name plate and the drawing say is enough: teeth, module, width, speed and torque.
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


def record(name, seed, load, *faults):
    """Let the machine run for six seconds; what comes back is read from the file, as yours will."""
    made = gearmon.simulate(
        MACHINE,
        faults,
        duration_s=6.0,
        sampling_rate_hz=10_240.0,
        machine_seed=1,  # always the same machine: its pitch errors, its housing
        recording_seed=seed,  # another day: other noise, other wander of the speed
        channels=2,
        load=load,
        tacho_shaft=1,
    )
    (path,) = made.save(FOLDER / f"{name}.csv")
    return gearmon.read_recording(path)


def main():
    FOLDER.mkdir(exist_ok=True)
    # Load changes a vibration more than a crack does. Three healthy recordings at different loads
    # show what changes with the load, so that it is not taken for damage later.
    healthy = [record(f"healthy-{n}", n, load) for n, load in enumerate((0.6, 0.8, 1.0))]
    reference = gearmon.learn(healthy, MACHINE)

    # Two new ones, at a load that was never learned: nothing wrong, and tooth 7 of the pinion
    # cracked, so that its pair has lost 20 % of its stiffness.
    sound = record("new-sound", 10, 0.9)
    cracked = record("new-cracked", 11, 0.9, "crack:1:pinion:7:20%")
    for recording in (sound, cracked):
        analysis = gearmon.analyse(recording, MACHINE, reference)
        print(analysis_text(analysis), end="\n\n")

    # The pictures of an analysis, one after the other; the last verdict is that of the crack.
    for number, figure in enumerate(analysis_figures(analysis, cracked)):
        print("picture:", save(figure, FOLDER / f"crack-{number}.png"))


if __name__ == "__main__":
    main()
