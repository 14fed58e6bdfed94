"""A harvester for a tractor's power take-off, from gear data alone.

Gears shake at lines that are known beforehand. A harvester that is tuned to the best of them yields
most; one that is tuned beside them yields next to nothing.

Run it as it stands: python demos/harvester_on_tractor.py
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import gearmon
from gearmon.harvesting import (
    BEAM_MATERIALS,
    PIEZO_MATERIALS,
    PiezoCantilever,
    SensorBudget,
    evaluate,
    vibration_of_signature,
)

MACHINE = Path(__file__).resolve().parents[1] / "signatures" / "tractor_pto.toml"
# What of the teeth's acceleration reaches the housing: measure it; a tenth is a guess.
PATH_GAIN = 0.1


def main():
    machine = gearmon.load_machine(MACHINE)
    # The speed of a tractor is never quite constant: half a per cent of wander broadens the lines.
    lines = gearmon.expected_signature(machine)
    shaking = vibration_of_signature(lines, gain=PATH_GAIN, wander=0.005)

    # A strip of piezoceramic on brass, clamped at one end. Its tip mass sets the frequency.
    bimorph = PiezoCantilever(
        wiring="series",
        piezo=PIEZO_MATERIALS["PZT-5A"],
        passive=BEAM_MATERIALS["brass"],
        length_m=15e-3,
        width_m=10e-3,
        passive_thickness_m=0.2e-3,
        piezo_thickness_m=0.2e-3,
    )
    tuned = gearmon.tune_harvester(bimorph, shaking)
    best = tuned.harvester
    print(f"best: {best.natural_frequency_hz:.0f} Hz by {1e3 * best.tip_mass_kg:.2f} g at the tip,")
    print(f"load {best.load_ohm:.3g} ohm, {1e6 * tuned.power_w:.3g} uW on average")

    # What that pays for: recordings of ten seconds, sent by radio.
    interval_s = SensorBudget(sleep_power_w=0.1e-6).interval_s(tuned.power_w)
    print(f"enough for a recording every {interval_s / 60:.3g} min")

    # And if it were tuned to anything else? The first mode need not lie on a line: a higher one may
    # meet a stronger line. So every mode and every line has to be in the sum.
    low, high = best.frequency_range_hz
    tried = np.geomspace(low, high, 300)
    power = [evaluate(best.retuned(float(f)), shaking).power_w for f in tried]
    figure, (above, below) = plt.subplots(2, 1, layout="constrained")
    above.vlines(shaking.frequency_hz, 1e-4, shaking.amplitude_ms2, label="lines in m/s²")
    grid = np.geomspace(low, shaking.frequency_hz[-1], 4000)
    above.plot(grid, 1e6 * best.gains(grid).power_w, "k--", label="harvester in µW per (m/s²)²")
    above.set(xlabel="frequency in Hz", xscale="log", yscale="log", ylim=(1e-4, None))
    above.legend(loc="lower left")
    below.plot(tried, 1e6 * np.array(power))
    below.plot(best.natural_frequency_hz, 1e6 * tuned.power_w, "o")
    below.set(xlabel="first mode tuned to, in Hz", ylabel="mean power in µW")
    below.set(xscale="log", yscale="log")
    path = Path("gearmon-harvester.png")
    figure.savefig(path)
    print("picture:", path)


if __name__ == "__main__":
    main()
