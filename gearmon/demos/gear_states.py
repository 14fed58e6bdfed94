"""Recordings of one machine whose first pinion is sound, pitted, worn or running out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearmon.gears.faults import Fault
from gearmon.machine import Machine
from gearmon.signals.recording import Recording
from gearmon.simulation import Settings
from gearmon.simulation.contact import Drive, ShaftMotion, random_wander
from gearmon.simulation.path import noise, random_path, tacho_pulses, through_path
from gearmon.simulation.settings import stream
from gearmon.simulation.train import Train, build_train
from gearmon.simulation.vibration import mesh_vibration

FloatArray = NDArray[np.float64]

_TACHO_V, _TACHO_TURNS = 5.0, 0.05
#: Before and after what is kept, for the housing to ring up and down [s].
_MARGIN_S = 0.5
#: Share of the sampling rate up to which harmonics of the wear are made.
_BELOW = 0.4


@dataclass(frozen=True, kw_only=True)
class State:
    """State of the pinion of a one-stage machine.

    Parameters
    ----------
    faults : tuple of Fault
        Losses of stiffness.
    eccentricity_m : float
        Added to the runout amplitude that the pinion has by manufacture [m].
    wear_m : float
        Depth to which the flanks of all teeth are worn at tip and root; nothing is worn at the
        pitch point, where they roll [m].
    """

    faults: tuple[Fault, ...] = ()
    eccentricity_m: float = 0.0
    wear_m: float = 0.0


def state_recording(machine: Machine, settings: Settings, state: State, name: str) -> Recording:
    """Simulate a one-stage machine whose pinion has a state of its own.

    Parameters
    ----------
    machine : Machine
    settings : Settings
    state : State
    name : str
        Of the recording.

    Notes
    -----
    Stiffness and runout go through the equations of motion. Wear moves all pairs alike, with the
    mesh: an error ``-wear |sin(pi x)|`` of the mesh phase x adds a force through the linear mesh
    with its mean stiffness.
    """
    seed, point = settings.recording_seed, machine.operating[0]
    train = build_train(
        machine,
        state.faults,
        load=settings.load,
        seed=settings.machine_seed,
        accuracy_grade=settings.accuracy_grade,
    )
    train = _running_out(train, state.eccentricity_m)
    motion = ShaftMotion(
        mean_hz=settings.mean_shaft1_hz(point),
        wander=random_wander(settings.speed_drift, stream(seed, "speed")),
        start_turns=float(stream(seed, "start").uniform(0, 1000)),
    )
    drive = Drive(
        motion=motion,
        load=random_wander(settings.load_drift, stream(seed, "load")),
        ripples=(),
        static_forcing=train.static_forcing,
    )
    vibration, _ = mesh_vibration(train, drive, settings, None)
    vibration += _of_wear(train, motion, settings, state.wear_m)
    level = 10 ** (-(settings.snr_db or 0.0) / 20)
    for channel, row in enumerate(vibration):
        generator = stream(seed, "noise", channel)
        row += noise(generator, len(row), level * float(np.std(row)))
    time = np.arange(settings.samples) / settings.sampling_rate_hz
    moved = motion.turns(time), settings.sampling_rate_hz, motion.speed_hz(time)
    pulses = tacho_pulses(*moved, _TACHO_V, _TACHO_TURNS)
    names = tuple(f"a{channel + 1}" for channel in range(len(vibration)))
    return Recording(
        samples=np.vstack([vibration, pulses]),
        sampling_rate_hz=settings.sampling_rate_hz,
        channel_names=(*names, "tacho"),
        channel_kinds=("vibration",) * len(names) + ("tacho",),
        units=("m/s2",) * len(names) + ("V",),
        origin=name,
    )


def _running_out(train: Train, eccentricity_m: float) -> Train:
    """Return the train with more runout of its first pinion."""
    first, *others = train.meshes
    pinion, gear = first.errors
    more = replace(pinion, eccentricity_m=pinion.eccentricity_m + eccentricity_m)
    return replace(train, meshes=(replace(first, errors=(more, gear)), *others))


def _of_wear(train: Train, motion: ShaftMotion, settings: Settings, wear_m: float) -> FloatArray:
    """Accelerations that wear of the flanks adds at the sensors [m/s2]."""
    rate = settings.sampling_rate_hz
    margin = round(_MARGIN_S * rate)
    time = (np.arange(settings.samples + 2 * margin) - margin) / rate
    phase = train.meshes[0].phase(motion.turns(time))
    highest = int(_BELOW * rate / (train.meshes[0].order * float(motion.speed_hz(time).max())))
    error = np.zeros(len(time))
    for k in range(1, highest + 1):
        # |sin(pi x)| = 2/pi - 4/pi sum cos(2 pi k x) / (4 k^2 - 1)
        error += wear_m * 4 / np.pi / (4 * k * k - 1) * np.cos(2 * np.pi * k * phase)
    angular = 2 * np.pi * np.fft.rfftfreq(len(time), 1 / rate)
    mass = 1.0 / train.system.coupling[0, 0]
    spring = train.mean_stiffness[0] + 1j * angular * train.system.damping[0]
    force = spring * mass * angular**2 / (spring - mass * angular**2) * np.fft.rfft(error)
    path = random_path(settings.machine_seed, settings.channels, 1, train.gear_mass_kg)
    heard = through_path(path, force[None, :], len(time), rate)
    return np.asarray(heard[:, margin : margin + settings.samples])
