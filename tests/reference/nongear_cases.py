"""Recordings of a two-stage train with lines that are no gears', known in every part."""

from __future__ import annotations

from functools import cache

import numpy as np
from reference.simulated_machines import two_stages
from reference.synthetic_signals import track_of, wandering_turns

from gearmon.gears.kinematics import kinematics
from gearmon.signals.orders import InAngle, fine_order_spectrum
from gearmon.signatures.measured.nongear_lines import nongear_lines

RATE_HZ, DURATION_S, SPEED_HZ = 6000.0, 6.0, 24.7


@cache
def train():
    """Stages 26/53 and 23/61, a bearing with nine balls on shaft 1."""
    return kinematics(two_stages())


def bearing_order(ring):
    """Kinematic order of one of the bearing's lines, by a part of its name."""
    return next(line.order for line in train().lines if ring in line.name)


def gear_lines(machine_seed):
    """Orders, amplitudes and phases of shafts, meshes and sidebands of one machine."""
    generator = np.random.default_rng([1, machine_seed])
    shafts = [shaft.order for shaft in train().shafts]
    orders = [k * order for order in shafts for k in (1, 2, 3)]
    sizes = [0.1] * len(orders)
    for mesh in train().meshes:
        for k in range(1, 5):
            orders.append(k * mesh.order)
            sizes.append(1.0 / k)
            for wheel in mesh.wheels:
                near = [k * mesh.order + r * wheel.relative_order for r in (-2, -1, 1, 2)]
                orders += near
                sizes += [0.1 / k] * len(near)
    scale = np.exp(0.5 * generator.standard_normal((2, len(orders))))
    return np.array(orders), np.array(sizes) * scale, generator.uniform(0, 2 * np.pi, scale.shape)


def recorded(
    seed=0,
    *,
    machine_seed=0,
    orders=(),
    tones_hz=(),
    level=0.05,
    speed_hz=SPEED_HZ,
    wander=0.005,
    noise=0.1,
    gain=1.0,
    load=1.0,
    duration_s=DURATION_S,
    added=None,
):
    """Samples of two channels and the track of their angle; lines of no gear all have `level`."""
    generator = np.random.default_rng([2, seed])
    time_s = np.arange(round(duration_s * RATE_HZ)) / RATE_HZ
    turns = wandering_turns(time_s, speed_hz, wander, seed=seed)
    samples = noise * generator.standard_normal((2, len(time_s)))
    for order, size, phase in zip(*map(np.transpose, gear_lines(machine_seed)), strict=True):
        samples += load * size[:, None] * np.cos(2 * np.pi * order * turns + phase[:, None])
    levels = np.broadcast_to(level, (len(orders) + len(tones_hz),))
    places = [order * turns for order in orders] + [hertz * time_s for hertz in tones_hz]
    for size, place in zip(levels, places, strict=True):
        samples += size * np.cos(2 * np.pi * (place + generator.uniform()))
    if added is not None:
        samples += added(time_s, turns, generator)
    track = track_of(
        lambda t: wandering_turns(t, speed_hz, wander, seed=seed),
        duration_s,
        round(20 * duration_s),
    )
    return gain * samples, track


def heard(seed=0, **changes):
    """The lines of no gear of such a recording."""
    samples, track = recorded(seed, **changes)
    vibration = InAngle.of(samples, RATE_HZ, track)
    return nongear_lines(vibration, train(), fine_order_spectrum(vibration))


def impacts(ring, size, slip=-0.01, jitter=0.02, resonance_hz=1900.0, damping=0.05):
    """Impacts of a bearing that slip at random and ring in a resonance, to be added."""

    def added(time_s, turns, generator):
        spacing = 1 / (bearing_order(ring) * (1 + slip))
        count = int(turns[-1] / spacing)
        steps = spacing * (1 + jitter * generator.standard_normal(count))
        at_s = np.interp(np.cumsum(steps), turns, time_s)
        train_of_blows = np.zeros(len(time_s))
        index = np.minimum((at_s * RATE_HZ).astype(int), len(time_s) - 1)
        np.add.at(train_of_blows, index, 1.0)
        pulse_s = time_s[: round(0.02 * RATE_HZ)]
        pulse = np.sin(2 * np.pi * resonance_hz * pulse_s)
        pulse *= np.exp(-2 * np.pi * damping * resonance_hz * pulse_s)
        return size * np.convolve(train_of_blows, pulse)[: len(time_s)]

    return added
