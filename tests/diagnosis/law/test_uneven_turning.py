"""A gear that turns unevenly, as an engine or a joint has it, and as each start has it anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from reference.gear_departures import held_against

from gearmon.diagnosis.law.patterns import GearPattern, _Bands, turned_alike
from gearmon.signatures.measured.reference import WheelPattern

TEETH, HARMONICS, STEPS = 24, 8, 1024
NUMBER = np.arange(1, HARMONICS * TEETH + TEETH // 2)
TURN = 2 * np.pi * np.arange(STEPS) / STEPS
NOISE = 2e-4


def excitation(seed):
    """Bands of a gear around its turn: mesh harmonics, modulated by pitch errors and runout."""
    rng = np.random.default_rng([7, seed])
    bands = []
    for k in range(1, HARMONICS + 1):
        errors = np.zeros(STEPS, dtype=complex)
        at = np.arange(-TEETH // 2 + 1, TEETH // 2)
        errors[at] = 0.01 * (rng.normal(size=at.size) + 1j * rng.normal(size=at.size))
        errors[[1, -1]] *= 4.0
        errors[0] = 1.0
        bands.append(np.exp(1j * rng.uniform(0, 6.28)) / k * np.fft.fft(errors))
    return bands


def wheel(bands, seed, ahead=0.0, turn=0.0, event=0.0, torque=0.0, channels=2):
    """Lines of the bands, of a gear that is `ahead` [rad of mesh 1] around its turn."""
    rng = np.random.default_rng([8, seed])
    lines = np.zeros((channels, NUMBER.size), dtype=complex)
    for k, band in enumerate(bands, start=1):
        answer = torque * np.exp(1j * rng.uniform(0, 6.28, 2)) @ np.exp([2j * TURN, -2j * TURN])
        own = np.fft.ifft(band * np.exp(1j * k * ahead + answer))
        own = np.roll(own, k * TEETH)[NUMBER]
        gains = 1.0 + 0.5j * np.arange(channels)
        near = np.abs(NUMBER - k * TEETH) <= TEETH // 2
        lines += gains[:, None] * np.where(near, own + event / k, 0.0)
    lines *= np.exp(2j * np.pi * turn * NUMBER)
    lines += NOISE * (rng.normal(size=lines.shape) + 1j * rng.normal(size=lines.shape))
    return WheelPattern(
        stage=1,
        gear="pinion",
        teeth=TEETH,
        order=1.0,
        number=NUMBER,
        mesh=NUMBER % TEETH == 0,
        amplitude=lines,
        variance=np.full(lines.shape, 2 * NOISE**2),
    )


def pulsating(twice, phase):
    """Angle of a shaft that pulses twice a turn, and half as much once."""
    return twice * (np.cos(2 * TURN + phase) + 0.5 * np.cos(TURN - phase))


def patterns(known, new):
    top = int(NUMBER[-1])
    return GearPattern.of(known, top), GearPattern.of(new, top)


def off(known, new):
    """Departure beyond the near sidebands, over what the noise of both explains."""
    far = np.abs((NUMBER + TEETH // 2) % TEETH - TEETH // 2) > 2
    apart = np.abs(known.amplitude - new.amplitude)[..., NUMBER[far]] ** 2
    return float(np.mean(apart) / (4 * NOISE**2))


@pytest.mark.parametrize("twice", [0.06, 0.09, 0.12])
@pytest.mark.parametrize("seed", range(3))
def test_lines_of_an_even_turn_become_those_of_an_uneven_one(seed, twice):
    bands = excitation(seed)
    known, new = patterns(wheel(bands, 1), wheel(bands, 2, ahead=pulsating(twice, 0.7 + seed)))
    moved = known.modulated_as(new, TEETH)
    # noise alone leaves 1
    assert off(known, new) > 10.0
    assert off(moved, new) < 1.5 + 0.01 * off(known, new)
    change = np.abs(moved.amplitude - known.amplitude) ** 2
    np.testing.assert_allclose(moved.variance, known.variance + change)


@pytest.mark.parametrize("seed", range(3))
def test_what_each_band_answers_to_the_torque_goes_with_the_angle(seed):
    bands = excitation(seed)
    new = wheel(bands, 2, ahead=pulsating(0.06, 0.7 + seed), torque=0.2)
    known, new = patterns(wheel(bands, 1), new)
    assert off(known.modulated_as(new, TEETH), new) < 1.5 + 0.04 * off(known, new)


@pytest.mark.parametrize("seed", range(3))
def test_an_uneven_turn_becomes_another(seed):
    bands = excitation(seed)
    first, second = (wheel(bands, n, ahead=pulsating(0.06, 2.0 * n)) for n in (1, 2))
    known, new = patterns(first, second)
    assert off(known.modulated_as(new, TEETH), new) < 0.1 * off(known, new)


@pytest.mark.parametrize("event", [0.0, 0.003, 0.01, 0.03, 0.1])
@pytest.mark.parametrize("seed", range(4))
def test_of_a_gear_that_turns_evenly_nothing_is_taken_damaged_or_not(seed, event):
    bands = excitation(seed)
    place = np.exp(-2j * np.pi * NUMBER * 0.3)
    known, new = patterns(wheel(bands, 1), wheel(bands, 2, event=event * place))
    np.testing.assert_array_equal(known.modulated_as(new, TEETH).amplitude, known.amplitude)


@pytest.mark.parametrize("seed", range(6))
def test_the_angle_is_that_of_the_teeth_not_that_of_the_pulses(seed):
    bands, turn = excitation(seed), 0.1 + 0.13 * seed
    first = wheel(bands, 1, ahead=pulsating(0.06, 0.0))
    second = wheel(bands, 2, ahead=pulsating(0.06, 1.5 + seed), turn=turn)
    known, new = patterns(first, second)
    _, angle = known.turned_to(new, TEETH)
    assert abs((angle - turn + 0.5) % 1.0 - 0.5) * TEETH < 0.25


@pytest.mark.parametrize("same_zero", [True, False])
def test_healthy_recordings_of_a_gear_become_those_of_the_first_turn(same_zero):
    bands, turn = excitation(3), 0.0 if same_zero else 0.3
    wheels = [wheel(bands, 1), wheel(bands, 2, ahead=pulsating(0.09, 0.7), turn=turn)]
    first, second = turned_alike(wheels, same_zero=same_zero)
    assert off(second, first) < 0.05 * off(*patterns(*wheels))


def test_sound_gears_do_not_stand_out_and_a_crack_does():
    peaks, cracked = [], []
    for seed in range(6):
        bands = excitation(seed)
        healthy = [wheel(bands, n, ahead=pulsating(0.05, 2.2 * n)) for n in range(2)]
        ahead = pulsating(0.06, 5.0 + seed)
        place = np.exp(-2j * np.pi * NUMBER * 0.4)
        for found, event in ((peaks, 0.0), (cracked, 0.03)):
            new = wheel(bands, 9, ahead=ahead, event=event * place)
            found.append(held_against(new, healthy, same_zero=False).peak)
    assert max(peaks) < 4.0
    assert min(cracked) > 2.0 * max(peaks)


def test_where_planets_pass_the_sensor_nothing_is_taken():
    bands = excitation(1)
    known, new = patterns(wheel(bands, 1), wheel(bands, 2, ahead=pulsating(0.06, 1.0)))
    known, new = (replace(own, usable=np.repeat(own.usable, 3, axis=0)) for own in (known, new))
    assert known.modulated_as(new, TEETH) is known


@pytest.mark.parametrize("size", [0.2, 0.8, 1.2, 1.6, 3.0])
def test_what_turns_a_band_by_more_than_a_radian_is_taken_for_no_modulation(size):
    """Bands modulated on their own by so much: what is found is that much, or nothing at all."""
    rng = np.random.default_rng(5)
    own = np.array([[np.fft.fftshift(np.fft.fft(band)[:TEETH]) for band in excitation(1)]] * 2)
    own = own / np.abs(own).max() * 0.01
    own[:, :, TEETH // 2] = 1.0
    bands = _Bands(own, own, np.full(own.shape, 1e-6))
    exponent = np.zeros(bands.beyond(np.zeros((2, HARMONICS, 9), complex)).shape, complex)
    middle = exponent.shape[2] // 2
    phase = rng.uniform(0, 2 * np.pi, (2, HARMONICS))
    exponent[:, :, middle + 1] = size / np.sqrt(2) * np.exp(1j * phase)
    exponent[:, :, middle - 1] = -exponent[:, :, middle + 1].conj()
    common = np.zeros_like(exponent)
    common[:, :, [middle - 1, middle + 1]] = 0.02
    moved = _Bands(own, bands.modulated(common + exponent), bands.noise)
    found = moved.beyond(common)
    power = np.sum(np.abs(found) ** 2, axis=2)
    assert power.max() <= 1.0
    if size < 0.5:
        np.testing.assert_allclose(found, exponent, atol=0.05 * size)
