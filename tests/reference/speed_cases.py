"""Recordings of gear trains built in the angle domain, whose angle and tooth patterns are known.

Written apart from `gearmon.simulation`: there is no equation of motion here. Every gear carries a
pattern of its own, tooth by tooth, on one shape that all its teeth share; the sum of the patterns
is read at the angles of a shaft that wanders or ramps, and sent through a random decaying path.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearmon.machine import Machine, OperatingPoint, ParallelStage
from gearmon.signals.recording import Recording


def train_of(*teeth, speed_hz=25.0):
    """A machine of parallel stages, each given as (pinion teeth, gear teeth)."""
    stages = tuple(ParallelStage(pinion_teeth=a, gear_teeth=b) for a, b in teeth)
    point = OperatingPoint(speed_rpm=60.0 * speed_hz)
    return Machine(name="train", operating=(point,), stages=stages)


def random_train(generator, stages=2, speed_hz=25.0):
    """A machine of random tooth counts."""
    teeth = [
        (int(generator.integers(17, 41)), int(generator.integers(42, 90))) for _ in range(stages)
    ]
    return train_of(*teeth, speed_hz=speed_hz)


@dataclass(frozen=True, kw_only=True)
class Pattern:
    """A waveform that repeats every turn of one gear, as its harmonics.

    Parameters
    ----------
    order : float
        Turns of the gear a turn of shaft 1.
    amplitude : ndarray of complex, shape (harmonics,)
        Peak amplitudes of harmonics 1, 2, ... of the gear's turn.
    """

    order: float
    amplitude: np.ndarray

    def at(self, turns):
        """Values at angles of shaft 1 [turns], read off a fine table by cubic interpolation."""
        count = 32 * (len(self.amplitude) + 1)
        table = count * np.fft.irfft(np.concatenate([[0.0], self.amplitude / 2]), n=count)
        place = (np.asarray(turns) * self.order % 1.0) * count
        base = np.floor(place).astype(int)
        u = place - base
        a, b, c, d = (table[(base + shift) % count] for shift in (-1, 0, 1, 2))
        return b + u * (
            (-2 * a - 3 * b + 6 * c - d) / 6
            + u * ((a - 2 * b + c) / 2 + u * (d - a + 3 * (b - c)) / 6)
        )


def tooth_pattern(generator, teeth, order, harmonics=3, scatter=0.2):
    """Teeth of one shape, each with a strength of its own; an eccentricity modulates them all."""
    fine = 64
    shape = np.zeros(fine)
    for k in range(1, harmonics + 1):
        phase = generator.uniform(0, 2 * np.pi)
        level = generator.uniform(0.3, 1.0) / k
        shape += level * np.cos(2 * np.pi * k * np.arange(fine) / fine + phase)
    strength = 1 + scatter * generator.standard_normal(teeth)
    strength += 0.2 * np.cos(2 * np.pi * np.arange(teeth) / teeth + generator.uniform(0, 6.28))
    # strengths pass smoothly from tooth to tooth, so that the pattern ends at a known harmonic
    own = np.fft.fft(strength) / teeth
    place = np.arange(teeth * fine) / (fine * teeth)
    smooth = np.zeros(teeth * fine)
    for q in range(-(teeth // 2) + 1, teeth // 2):
        smooth += (own[q] * np.exp(2j * np.pi * q * place)).real
    total = np.tile(shape, teeth) * smooth
    top = teeth * (harmonics + 1)
    amplitude = 2 * np.fft.rfft(total)[1 : top + 1] / len(total)
    return Pattern(order=float(order), amplitude=amplitude)


def gear_patterns(machine, generator):
    """Patterns of all gears of a parallel train, the pinion of stage 1 first."""
    patterns, order = [], 1.0
    for stage in machine.stages:
        level = generator.uniform(0.5, 1.0)
        after = order * stage.pinion_teeth / stage.gear_teeth
        for teeth, turning, share in (
            (stage.pinion_teeth, order, level),
            (stage.gear_teeth, after, 0.4 * level),
        ):
            found = tooth_pattern(generator, teeth, turning)
            patterns.append(Pattern(order=found.order, amplitude=share * found.amplitude))
        order = after
    return patterns


def wandering(duration_s, rate, deviation, generator, memory_s=0.6):
    """Relative departure of the speed, sample by sample: noise through a Gaussian window."""
    step = 0.01
    count = int(duration_s / step) + 800
    kernel = np.exp(-0.5 * (np.arange(-300, 301) * step / memory_s) ** 2)
    rough = np.convolve(generator.standard_normal(count + 600), kernel, "valid")
    rough = (rough - rough.mean()) * deviation / rough.std()
    return np.interp(
        np.arange(int(duration_s * rate)) / rate, np.arange(count) * step, rough[:count]
    )


@dataclass(frozen=True, kw_only=True)
class Case:
    """A recording with its truth.

    Parameters
    ----------
    machine : Machine
    recording : Recording
    turns : ndarray of float, shape (n,)
        True angle of shaft 1 at every sample.
    clean : ndarray of float, shape (channels, n)
        The vibration of the machine alone, without noise and without tones of others.
    """

    machine: Machine
    recording: Recording
    turns: np.ndarray
    clean: np.ndarray


def make_case(
    seed,
    *,
    machine=None,
    law="wander",
    amount=0.01,
    duration_s=10.0,
    rate=8000.0,
    speed_hz=25.0,
    off=0.0,
    snr_db=20.0,
    tones=0,
    channels=1,
    memory_s=0.6,
    path_s=0.002,
    stages=2,
):
    """A recording of a train.

    `law` is "wander" (random speed, relative deviation `amount`), "ramp" (speed rises evenly by
    `amount`, its middle at nominal) or the shares of nominal that the speed runs through, evenly in
    time; `off` is how far the true speed departs from nominal; `tones`
    steady lines of other machines, each as strong as a mesh, are added.
    """
    generator = np.random.default_rng(seed)
    machine = machine or random_train(generator, stages, speed_hz)
    count = int(duration_s * rate)
    time = np.arange(count) / rate
    if law == "wander":
        relative = wandering(duration_s, rate, amount, generator, memory_s)
    elif law == "ramp":
        relative = amount * (time / duration_s - 0.5)
    else:
        relative = np.interp(time, np.linspace(0.0, duration_s, len(law)), law) - 1
    nominal = machine.operating[0].shaft1_hz
    speed = nominal * (1 + off) * (1 + relative)
    turns = generator.uniform(0, 1) + np.concatenate(
        [[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1])) / rate]
    )
    patterns = gear_patterns(machine, generator)
    source = sum(pattern.at(turns) for pattern in patterns)
    taps = np.arange(int(6 * path_s * rate))
    rows, noisy = [], []
    for _ in range(channels):
        path = generator.standard_normal(len(taps)) * np.exp(-taps / (path_s * rate))
        length = count + len(taps)
        row = np.fft.irfft(np.fft.rfft(source, length) * np.fft.rfft(path, length), length)[:count]
        rows.append(row / row.std())
        other = np.zeros(count)
        for _ in range(tones):
            hz = generator.uniform(5 * nominal, 60 * nominal)
            other += 0.5 * np.sqrt(2) * np.cos(2 * np.pi * hz * time + generator.uniform(0, 6.28))
        noise = 10 ** (-snr_db / 20) * generator.standard_normal(count)
        noisy.append(rows[-1] + other + noise)
    clean = np.array(rows)
    recording = Recording(
        samples=np.array(noisy),
        sampling_rate_hz=rate,
        channel_names=tuple(f"a{i + 1}" for i in range(channels)),
        channel_kinds=("vibration",) * channels,
        units=("m/s2",) * channels,
        origin="case",
    )
    return Case(machine=machine, recording=recording, turns=turns, clean=clean)
