"""A harvester for a tractor's power take-off: three places, a day's duty cycle."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gearmon.files import write_atomically
from gearmon.gears.faults import parse_fault
from gearmon.harvesting.request import load_harvester
from gearmon.harvesting.survey import Survey, survey_measured
from gearmon.machine import Machine, load_machine
from gearmon.report.harvest_plots import harvest_figures
from gearmon.report.harvest_text import harvest_lines
from gearmon.report.plots import save_all
from gearmon.signals.recording import Recording, read_recording
from gearmon.simulation import simulate, write_simulation
from gearmon.terminal import Progress

MACHINE = """\
name = "tractor PTO gearbox"

[[operating]]
name = "baling"
speed_rpm = 1906.0
torque_nm = 240.0
share = 0.5

[[operating]]
name = "mowing"
speed_rpm = 1906.0
torque_nm = 140.0
share = 0.4

[[operating]]
name = "headland, idling"
speed_rpm = 950.0
torque_nm = 15.0
share = 0.1

[[stage]]
kind = "parallel"
pinion_teeth = 17
gear_teeth = 60
module_mm = 4.0
face_width_mm = 36.0
profile_shift_pinion = 0.3
profile_shift_gear = -0.3
bore_diameter_pinion_mm = 35.0
bore_diameter_gear_mm = 50.0

[[sensor]]
column = "a1"
unit = "m/s2"
position = "front bearing, radial"

[[sensor]]
column = "a2"
unit = "m/s2"
position = "rear bearing, radial"

[[sensor]]
column = "a3"
unit = "m/s2"
position = "cover, normal to the plate"
"""

HARVESTER = """\
# A bimorph of 60 x 15 mm for a low-power node that sends a short recording now and then.
kind = "cantilever"
wiring = "series"
piezo = "PZT-5A"
passive = "steel"
length_mm = 60.0
width_mm = 15.0
passive_thickness_mm = 0.5
piezo_thickness_mm = 0.3
most_tip_mass_g = 60.0
damping_ratio = 0.01
clearance_mm = 3.0

[budget]
duration_s = 2.0
sampling_rate_hz = 5000.0
sleep_power_w = 0.2e-6
"""

FAULT = "crack:1:pinion:5:30%"


@dataclass(frozen=True, kw_only=True, eq=False)
class HarvestDemo:
    """What the demo did.

    Parameters
    ----------
    folder : Path
        Where its files are.
    survey : Survey
        Places, the best harvester and what it powers.
    pictures : tuple of Path
    """

    folder: Path
    survey: Survey
    pictures: tuple[Path, ...]

    def lines(self) -> list[str]:
        """Tell it on a terminal."""
        return [
            *harvest_lines(self.survey),
            f"recordings, machine and harvester files: {self.folder}",
            *(f"picture: {picture}" for picture in self.pictures),
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        pictures = [str(picture) for picture in self.pictures]
        return {"folder": str(self.folder), "pictures": pictures} | self.survey.to_dict()


def harvest_demo(folder: Path, progress: Progress | None = None) -> HarvestDemo:
    """Simulate a day at three places, sound and damaged, and place and tune a harvester.

    Parameters
    ----------
    folder : Path
        Where to write; it exists.
    progress : callable, optional
        Called with the share done, 0 to 1.
    """
    write_atomically(folder / "machine.toml", MACHINE)
    write_atomically(folder / "harvester.toml", HARVESTER)
    machine = load_machine(folder / "machine.toml")
    harvester, budget = load_harvester(folder / "harvester.toml")
    sound, damaged = [], []
    steps = 2 * len(machine.operating) + 2
    for number in range(len(machine.operating)):
        sound.append(_recorded(machine, folder, number, ""))
        damaged.append(_recorded(machine, folder, number, FAULT))
        if progress is not None:
            progress(2 * (number + 1) / steps)
    survey = survey_measured(
        machine,
        harvester,
        sound,
        budget,
        shares=[point.share for point in machine.operating],
        degraded=damaged,
    )
    pictures = save_all(harvest_figures(survey), folder / "harvest.png")
    return HarvestDemo(folder=folder, survey=survey, pictures=tuple(pictures))


def _recorded(machine: Machine, folder: Path, number: int, fault: str) -> Recording:
    """Simulate an operating point, write it and read it back as a user would."""
    point = machine.operating[number]
    recording = simulate(
        machine,
        [parse_fault(fault)] if fault else [],
        point=point,
        duration_s=12.0,
        sampling_rate_hz=12_800.0,
        machine_seed=4,
        recording_seed=2 * number + bool(fault),
        channels=3,
    )
    state = "damaged" if fault else "sound"
    path = folder / f"{point.name.split(',')[0]}-{state}.csv"
    write_simulation(recording, path)
    return read_recording(path, sensors=machine.sensors)
