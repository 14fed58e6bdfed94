"""What a crack of growing size adds to the spectrum of a tractor's power take-off.

Run it as it stands: python demos/expected_spectrum.py
"""

from pathlib import Path

import matplotlib.pyplot as plt

import gearmon

MACHINE = Path(__file__).resolve().parents[1] / "signatures" / "tractor_pto.toml"
LOSSES = (1, 5, 10, 20, 40)


def main():
    machine = gearmon.load_machine(MACHINE)
    print("loss of pair stiffness   strongest mesh line   strongest sideband of the pinion")
    strongest = []
    for loss in LOSSES:
        # tooth 5 of the pinion: its sidebands lie whole turns of the pinion beside the mesh lines
        lines = gearmon.expected_signature(machine, (f"crack:1:pinion:5:{loss}%",))
        size, mesh = lines["acceleration_ms2"], lines["sideband"] == 0
        strongest.append(size[~mesh].max())
        print(f"{loss:>20} %   {size[mesh].max():>14.1f} m/s2   {strongest[-1]:>20.2f} m/s2")

    # The mesh lines hardly move: the level of the vibration says nothing of a crack. The sidebands
    # grow in proportion to the loss, and are there from the first per cent.
    figure, (spectrum, growth) = plt.subplots(1, 2, layout="constrained", figsize=(10, 4))
    frequency = lines["frequency_hz"]
    spectrum.vlines(frequency[~mesh], 1e-3, size[~mesh], color="tab:red", label="sidebands")
    spectrum.vlines(frequency[mesh], 1e-3, size[mesh], color="tab:blue", label="mesh harmonics")
    spectrum.set(xlabel="frequency in Hz", ylabel="acceleration in m/s²", yscale="log")
    spectrum.set_title(f"loss of {LOSSES[-1]} %")
    spectrum.set_ylim(top=1e5)  # room for the legend
    spectrum.legend(ncols=2)
    growth.loglog(LOSSES, strongest, "o-")
    growth.set(xlabel="loss of pair stiffness in %", ylabel="strongest sideband in m/s²")
    path = Path("gearmon-spectrum.png")
    figure.savefig(path)
    print("picture:", path)


if __name__ == "__main__":
    main()
