"""Signals whose angle, lines and noise are known exactly."""

from __future__ import annotations

import numpy as np

from gearmon.signals.angle import AngleTrack
from gearmon.signals.recording import Recording


def as_recording(simulated, **changes):
    """A simulated recording as it would have been read from a file."""
    known = {
        "samples": simulated.samples,
        "sampling_rate_hz": simulated.sampling_rate_hz,
        "channel_names": simulated.channel_names,
        "channel_kinds": simulated.channel_kinds,
        "units": simulated.units,
        "origin": "simulated",
    }
    return Recording(**(known | changes))


def wandering_turns(time_s, speed_hz, wander, seed=0, slowest_s=8.0, components=4):
    """Angle [turns] of a shaft whose speed departs from its mean by `wander` (standard deviation).

    The departure is a sum of sines with periods from `slowest_s` down to a quarter of it, so that
    the angle is known in closed form.
    """
    generator = np.random.default_rng(seed)
    rates = (1 + 3 * np.arange(components) / max(1, components - 1)) / slowest_s
    phases = generator.uniform(0, 2 * np.pi, components)
    size = wander * np.sqrt(2 / components)
    turns = speed_hz * np.asarray(time_s, dtype=float)
    for rate, phase in zip(rates, phases, strict=True):
        swing = speed_hz * size / (2 * np.pi * rate)
        turns = turns + swing * (np.sin(2 * np.pi * rate * time_s + phase) - np.sin(phase))
    return turns


def constant_track(speed_hz, duration_s):
    """The track of a shaft that turns at `speed_hz` throughout."""
    return track_of(lambda time_s: speed_hz * time_s, duration_s, 2, method="constant")


def track_of(turns_of_time, duration_s, knots, method="tacho"):
    """An angle track through a known curve."""
    time_s = np.linspace(0.0, duration_s, knots)
    return AngleTrack(
        time_s=time_s, turns=turns_of_time(time_s), method=method, uncertainty_turns=0.0
    )


def lines_on(turns, orders, amplitudes, phases=0.0):
    """Sum of lines amplitude * cos(2 pi order turns + phase), shape (1, n)."""
    orders = np.atleast_1d(orders)
    amplitudes = np.broadcast_to(amplitudes, orders.shape)
    phases = np.broadcast_to(phases, orders.shape)
    total = np.zeros(len(turns))
    for order, amplitude, phase in zip(orders, amplitudes, phases, strict=True):
        total += amplitude * np.cos(2 * np.pi * order * turns + phase)
    return total[None, :]


def white(shape, level=1.0, seed=0):
    """Gaussian noise of standard deviation `level`."""
    return level * np.random.default_rng(seed).standard_normal(shape)


def band_limited(channels, count, share=0.3, seed=0):
    """Noise without anything above `share` of the sampling rate."""
    spectrum = np.fft.rfft(white((channels, count), seed=seed))
    spectrum[:, round(share * count) :] = 0.0
    return np.fft.irfft(spectrum, n=count)
