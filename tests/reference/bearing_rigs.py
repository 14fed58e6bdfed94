"""Rigs without gears: a shaft, a bearing with a fault, noise."""

from __future__ import annotations

import numpy as np
from scipy.signal import fftconvolve

KINDS = ("outer", "inner", "ball")


def bearing_rig(generator, kind, rate, duration_s):
    """Vibration of a faulty bearing, its shaft's frequency [Hz] and its fault order.

    Impacts at the ball-pass order, slipping and loaded unevenly, ring one to three modes; shaft
    harmonics and noise are added.
    """
    shaft_hz = generator.uniform(10.0, 45.0)
    balls, ratio = int(generator.integers(7, 17)), generator.uniform(0.15, 0.3)
    cage = (1 - ratio) / 2 * (1 - generator.choice([0.0, 0.012]))
    order = {
        "outer": balls * cage,
        "inner": balls * (1 - cage),
        "ball": (1 - ratio**2) / (2 * ratio),
    }[kind]
    count = int(duration_s * rate)
    turns = shaft_hz * np.arange(count) / rate
    events = np.arange(generator.uniform(), turns[-1] * order - 1)
    at = (events + generator.normal(0, 0.003, len(events))) / order
    height = 1 + 0.1 * generator.normal(size=len(events))
    if kind != "outer":
        height *= 1 + 0.6 * np.cos(2 * np.pi * at * (1.0 if kind == "inner" else cage))
    pulses = np.zeros(count)
    np.add.at(pulses, (at / shaft_hz * rate).astype(int), height)
    time = np.arange(int(0.05 * rate)) / rate
    ringing = np.zeros(len(time))
    for _ in range(int(generator.integers(1, 4))):
        mode = np.exp(generator.uniform(np.log(300), np.log(0.4 * rate)))
        decay = np.exp(-2 * np.pi * generator.uniform(0.02, 0.08) * mode * time)
        ringing += generator.normal() * decay * np.sin(2 * np.pi * mode * time)
    samples = fftconvolve(pulses, ringing)[:count]
    samples /= samples.std()
    for k in range(1, 6):
        samples += (
            0.1 * generator.lognormal() * np.cos(2 * np.pi * (k * turns + generator.uniform()))
        )
    samples += 10 ** (-generator.choice([0, 10, 20]) / 20) * generator.normal(size=count)
    return samples[None], shaft_hz, order
