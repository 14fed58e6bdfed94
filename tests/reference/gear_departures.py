"""Departures of one gear whose content is known: of teeth by their weights, or of sidebands."""

from __future__ import annotations

from functools import cache

import numpy as np

from gearmon.diagnosis.hypotheses.tooth_match import search_gear
from gearmon.diagnosis.law.gear_lines import BandDeviation, GearDeviation, GearLaw
from gearmon.diagnosis.law.patterns import turned_alike
from gearmon.machine import Machine, OperatingPoint, ParallelStage
from gearmon.signatures.expected.tooth_response import tooth_response

TEETH, HARMONICS, SPEED_HZ = 31, 6, 25.0


@cache
def machine():
    stage = ParallelStage(pinion_teeth=TEETH, gear_teeth=47, module_mm=2.0, face_width_mm=20.0)
    point = OperatingPoint(speed_rpm=60 * SPEED_HZ)
    return Machine(name="pair", operating=(point,), stages=(stage,))


@cache
def response():
    return tooth_response(machine(), 1, "pinion", (HARMONICS + 1) * TEETH)


def complex_noise(rng, *shape):
    return (rng.normal(size=shape) + 1j * rng.normal(size=shape)) / np.sqrt(2)


def gear(weight, seed=0, height=10.0, smooth=None, noise=1.0):
    """A gear whose departure is the response of its teeth, each with a weight of its own.

    `smooth` instead gives sidebands that fall by this factor from one to the next. The path rings
    for half a mesh period and is another one about each mesh harmonic.
    """
    rng = np.random.default_rng([3, seed])
    number = np.arange(1, HARMONICS * TEETH + TEETH // 2)
    period = np.arange(-0.3, 3.0, 0.05)
    ringing = complex_noise(rng, 2, len(period)) * np.exp(-np.maximum(period - 1.5, 0.0) / 0.5)
    path = ringing @ np.exp(-2j * np.pi * np.outer(period, number) / TEETH)
    by_tooth = np.fft.fft(weights(0) if weight is None else weight)[number % TEETH]
    bands = []
    for k in range(1, HARMONICS + 1):
        inside = np.abs(number - k * TEETH) <= TEETH // 2
        inside &= np.abs(number - k * TEETH) > 2
        own = number[inside]
        if smooth is None:
            lines = path[:, inside] * by_tooth[inside]
        else:
            lines = complex_noise(rng, 2, len(own)) * smooth ** np.abs(own - k * TEETH)
        lines *= height / max(np.sqrt(np.mean(np.abs(lines) ** 2)), 1e-30)
        hiss = noise * complex_noise(rng, *lines.shape)
        bands.append(
            BandDeviation(
                harmonic=k,
                number=own,
                rest=lines + hiss,
                deviation=np.full(lines.shape, 0.01),
                noise=np.full(lines.shape, 0.01),
                pattern=np.zeros(lines.shape, dtype=complex),
                known=np.zeros((0, *lines.shape), dtype=complex),
            )
        )
    return search_gear(
        GearDeviation(
            stage=1,
            gear="pinion",
            teeth=TEETH,
            order=1.0,
            bands=tuple(bands),
            mesh_power=np.ones((2, HARMONICS + 1)),
            shift_turns=0.0,
            same_zero=True,
        ),
        response(),
        SPEED_HZ,
    )


def weights(*teeth):
    own = np.zeros(TEETH)
    own[list(teeth)] = 1.0
    return own


def held_against(new, healthy, *, same_zero=True, states=None, state=(0.0, 0.0)):
    """Deviation of a new pattern from the law of healthy ones, all at one operating state."""
    law = GearLaw(
        wheel=healthy[0],
        patterns=turned_alike(healthy, same_zero=same_zero),
        states=np.zeros((len(healthy), 2)) if states is None else np.asarray(states, dtype=float),
    )
    return law.deviation(new, np.asarray(state, dtype=float), same_zero=same_zero)


def beside_others(own, size, *seed):
    """A gear whose departure has unrelated lines of this size as well."""
    rng = np.random.default_rng(seed)
    for band in own.difference.bands:
        band.rest[:] += size * complex_noise(rng, *band.rest.shape)
    return search_gear(own.difference, response(), SPEED_HZ)
