"""Condition indicators written out as sums, one number after the other."""

from __future__ import annotations

import math


def mean(x):
    return math.fsum(x) / len(x)


def moment(x, power):
    centre = mean(x)
    return math.fsum((value - centre) ** power for value in x)


def fm0(average, mesh_amplitudes):
    return (max(average) - min(average)) / math.fsum(mesh_amplitudes)


def fm4(d):
    return len(d) * moment(d, 4) / moment(d, 2) ** 2


def m6a(d):
    return len(d) ** 2 * moment(d, 6) / moment(d, 2) ** 3


def m8a(d):
    return len(d) ** 3 * moment(d, 8) / moment(d, 2) ** 4


def na4(run):
    """NA4 of the last of several records of equal length."""
    newest = run[-1]
    mean_sum = math.fsum(moment(record, 2) for record in run) / len(run)
    return len(newest) * moment(newest, 4) / mean_sum**2


def na4_frozen(run, baseline):
    healthy = run[: min(baseline, len(run))]
    mean_sum = math.fsum(moment(record, 2) for record in healthy) / len(healthy)
    return len(run[-1]) * moment(run[-1], 4) / mean_sum**2


def root_mean_square(x):
    return math.sqrt(moment(x, 2) / len(x))


def energy_ratio(d, g):
    return root_mean_square(d) / root_mean_square(g)


def sideband_energy_ratio(sidebands, fundamental):
    return math.fsum(sidebands) / fundamental


def sideband_index(first):
    return mean(first)


def sideband_level_factor(first, average):
    return math.fsum(first) / root_mean_square(average)


def crest_factor(x):
    centre = mean(x)
    return max(abs(value - centre) for value in x) / root_mean_square(x)
