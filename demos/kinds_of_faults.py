"""What different faults do to the lines of a gear, before anything has broken.

A crack is one tooth, once a turn: its energy lies in many weak sidebands. Eccentricity is the whole
gear: it lies in the first one. Wear changes all teeth alike and leaves no sidebands at all. That is
how they are told apart.

Run it as it stands: python demos/kinds_of_faults.py
"""

from pathlib import Path

import gearmon

MACHINE = Path(__file__).resolve().parents[1] / "signatures" / "reference_pair.toml"

# What is wrong with the pinion, as it would be given to `gearmon baseline --fault`.
FAULTS = {
    "crack, a fifth of the stiffness of tooth 3": "crack:1:pinion:3:20%",
    "pitting of tooth 3": "pitting:1:pinion:3:20%",
    "eccentricity of 20 µm": "eccentricity:1:pinion:all:20um",
}


def main():
    machine = gearmon.load_machine(MACHINE)
    healthy = gearmon.expected_signature(machine)
    mesh = healthy["acceleration_ms2"].max()
    print(f"healthy: mesh lines up to {mesh:.3g} m/s2 and no sidebands")

    # Every line has its order, its frequency and the shaft that it is a sideband of, so that a
    # question about them is one line of code.
    for name, fault in FAULTS.items():
        lines = gearmon.expected_signature(machine, (fault,))
        away, size = abs(lines["sideband"]), lines["acceleration_ms2"]
        first, farther = size[away == 1].max(), size[away > 3].max(initial=0.0)
        print(
            f"{name}: first sideband {first:.3g} m/s2, strongest beyond the third {farther:.3g}, "
            f"{farther / first:.0%} of it"
        )

    # The same for many sizes and both gears at once: a family, and its picture.
    family = gearmon.fault_family(machine, kinds=["crack", "pitting", "eccentricity"])
    print("picture:", *family.save("gearmon-kinds.png"))


if __name__ == "__main__":
    main()
