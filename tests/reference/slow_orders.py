"""Slow, obvious versions of what the signal modules compute in clever ways."""

from __future__ import annotations

import itertools
import math

import numpy as np


def hann_values(length):
    """Periodic Hann window, value by value."""
    return np.array([0.5 * (1 - math.cos(2 * math.pi * n / length)) for n in range(length)])


def direct_lines(signal, per_turn, first_turn, orders, block):
    """Sum every Hann block of signals at equal steps of angle against every order.

    Returns complex peak amplitudes, shape (blocks, channels, orders).
    """
    window = hann_values(block)
    rows = []
    for start in range(0, signal.shape[-1] - block + 1, max(1, block // 2)):
        angle = first_turn + (start + np.arange(block)) / per_turn
        part = signal[:, start : start + block] * window
        row = [
            (2.0 if order > 0 else 1.0) * part @ np.exp(-2j * np.pi * order * angle) / window.sum()
            for order in orders
        ]
        rows.append(np.array(row).T)
    return np.array(rows)


def slow_floor(power, width):
    """Median of each half-overlapped window of one spectrum, joined by straight lines."""
    bins = len(power)
    width = min(max(2, width), bins)
    step = max(1, width // 2)
    starts = sorted({*range(0, bins - width + 1, step), bins - width})
    medians = [sorted(power[start : start + width]) for start in starts]
    middle = [0.5 * (part[(width - 1) // 2] + part[width // 2]) for part in medians]
    return np.interp(np.arange(bins), [start + (width - 1) / 2 for start in starts], middle)


def comb_score(quality, bin_hz, orders, weights, speed_hz):
    """Weighted sum of the spectrum at the bins nearest to the lines of a comb."""
    total = 0.0
    for order, weight in zip(orders, weights, strict=True):
        total += weight * quality[min(round(order * speed_hz / bin_hz), len(quality) - 1)]
    return total


def naive_average(channel, sampling_rate_hz, turn_times_s, per_turn):
    """Cut a channel into turns at known times and average them point by point."""
    from scipy.interpolate import CubicSpline

    curve = CubicSpline(np.arange(len(channel)) / sampling_rate_hz, channel)
    turns = [
        curve(start + (stop - start) * np.arange(per_turn) / per_turn)
        for start, stop in itertools.pairwise(turn_times_s)
    ]
    return np.mean(turns, axis=0)


def smallest_smooth(length):
    """Smallest even number >= length without prime factors above five, by trying."""
    candidate = max(2, length)
    while not _even_smooth(candidate):
        candidate += 1
    return candidate


def _even_smooth(number):
    if number % 2:
        return False
    for factor in (2, 3, 5):
        while number % factor == 0:
            number //= factor
    return number == 1
