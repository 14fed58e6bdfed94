"""A gear that runs at another speed meets the housing's modes elsewhere: that is no damage."""

from __future__ import annotations

import numpy as np
import pytest
from reference.gear_departures import held_against

from gearmon.diagnosis.law.machine import SPEED_UNIT
from gearmon.signatures.measured.reference import WheelPattern

TEETH, HARMONICS, ROTATION_HZ, NOISE = 40, 8, 25.0, 1e-3


def modes(hz, seed):
    """Acceleration through a housing: modes from 300 Hz to 9 kHz, 1 to 6 per cent damped."""
    rng = np.random.default_rng([7, seed])
    natural = np.exp(rng.uniform(np.log(300), np.log(9000), 16))
    damping = rng.uniform(0.01, 0.06, 16)
    ratio = hz[:, None] / natural
    return (ratio**2 / (1 - ratio**2 + 2j * damping * ratio)) @ rng.normal(size=16)


def pattern(speed, seed, number, excitation, rng):
    heard = excitation * modes(ROTATION_HZ * speed * number, seed)
    hiss = rng.normal(size=(len(number), 2)) @ np.array([1.0, 1j]) / np.sqrt(2)
    return WheelPattern(
        stage=1,
        gear="pinion",
        teeth=TEETH,
        order=1.0,
        number=number,
        mesh=number % TEETH == 0,
        amplitude=(heard + NOISE * hiss)[None],
        variance=np.full((1, len(number)), NOISE**2),
    )


def differences(change, seed, told):
    rng = np.random.default_rng([8, seed])
    number = np.arange(1, HARMONICS * TEETH + TEETH // 2)
    excitation = 0.03 * (rng.normal(size=(len(number), 2)) @ np.array([1.0, 1j]))
    excitation[number % TEETH == 0] = 1.0
    healthy, new = (pattern(1 + c, seed, number, excitation, rng) for c in (0.0, change))
    state = (0.0, told / SPEED_UNIT)
    return held_against(new, [healthy], state=state).bands


def mean_squares(change, told):
    return [
        np.mean(np.abs(band.rest) ** 2)
        for seed in range(20)
        for band in differences(change, seed, told)
    ]


@pytest.mark.parametrize("change", [-0.02, -0.005, 0.002, 0.01, 0.02])
def test_what_the_modes_change_stays_within_the_stated_deviation(change):
    # in step with the change, be it small or large; bands differ as their modes are damped
    means = mean_squares(change, change)
    assert 0.25 < np.mean(means) < 1.5
    assert np.quantile(means, 0.95) < 5.0


def test_taken_for_the_same_speed_the_modes_look_like_damage():
    assert np.quantile(mean_squares(0.02, 0.0), 0.95) > 10.0


def test_quiet_lines_stay_sharp_beside_loud_ones():
    # the deviation grows with the pattern about a line, so that it says little of quiet places
    [band, *_] = differences(0.02, 5, 0.02)
    assert band.deviation.max() > 3 * band.deviation.min()
