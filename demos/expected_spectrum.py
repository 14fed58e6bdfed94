"""Print what a crack of growing size adds to the spectrum of a tractor's power take-off.

Run it as it stands: python demos/expected_spectrum.py
"""

from pathlib import Path

import gearmon

MACHINE = Path(__file__).resolve().parents[1] / "signatures" / "tractor_pto.toml"


def main():
    machine = gearmon.load_machine(MACHINE)
    print("loss of pair stiffness   strongest mesh line   strongest sideband of the pinion")
    for loss in (1, 5, 10, 20, 40):
        signature = gearmon.expected_signature(machine, (f"crack:1:pinion:5:{loss}%",))
        acceleration = signature["acceleration_ms2"]
        mesh = signature["sideband"] == 0
        print(
            f"{loss:>20} %   {acceleration[mesh].max():>14.1f} m/s2   "
            f"{acceleration[~mesh].max():>20.2f} m/s2"
        )


if __name__ == "__main__":
    main()
