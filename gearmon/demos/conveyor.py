"""The one-stage conveyor drive that two demos record, sound or with a weak tooth."""

from __future__ import annotations

from collections.abc import Sequence

from gearmon.gears.faults import Fault
from gearmon.machine import Machine
from gearmon.signals.recording import Recording
from gearmon.simulation import simulate

MACHINE = """\
# A one-stage gearbox of our own invention
name = "conveyor drive"

[operating]
speed_rpm = 1480.0
torque_nm = 120.0

[[stage]]
kind = "parallel"
pinion_teeth = 23
gear_teeth = 57
module_mm = 2.5
face_width_mm = 28.0
bore_diameter_pinion_mm = 25.0
bore_diameter_gear_mm = 40.0
"""

#: Length and rate of a recording: short, so that a demo takes less than a minute.
DURATION_S, RATE_HZ = 5.0, 10_240.0


def conveyor_recording(
    machine: Machine,
    name: str,
    seed: int,
    faults: Sequence[Fault] = (),
    *,
    load: float = 1.0,
    slip: float = 0.01,
    speed_drift: float = 0.005,
    load_drift: float = 0.03,
) -> Recording:
    """Simulate two accelerometers and a tachometer of always the same conveyor drive.

    Parameters
    ----------
    machine : Machine
    name : str
        Of the recording.
    seed : int
        Of what differs from recording to recording.
    faults : sequence of Fault
    load : float
        Share of the nominal torque.
    slip : float
        Share by which the machine runs slower than its nominal speed.
    speed_drift, load_drift : float
        Standard deviations of their wander within the recording, as shares.
    """
    simulated = simulate(
        machine,
        faults,
        DURATION_S,
        RATE_HZ,
        machine_seed=1,
        recording_seed=seed,
        channels=2,
        load=load,
        slip=slip,
        speed_drift=speed_drift,
        load_drift=load_drift,
        tacho_shaft=1,
    )
    return Recording(
        samples=simulated.samples,
        sampling_rate_hz=simulated.sampling_rate_hz,
        channel_names=simulated.channel_names,
        channel_kinds=simulated.channel_kinds,
        units=simulated.units,
        origin=name,
    )
