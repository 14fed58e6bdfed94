"""The angle between two patterns, also where one tooth is louder than all others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.diagnosis.law.patterns import GearPattern, turn_energy, turning

TEETH, TOP = 29, 6 * 29
NUMBER = np.arange(TOP + 1)


def complex_noise(rng, *shape):
    return (rng.normal(size=shape) + 1j * rng.normal(size=shape)) / np.sqrt(2)


def pattern(lines, noise, rng):
    return GearPattern(
        amplitude=(lines + noise * complex_noise(rng, *lines.shape))[None],
        variance=np.full((1, *lines.shape), max(noise, 1e-6) ** 2),
        usable=((NUMBER > 0) & (NUMBER % TEETH > 0))[None],
    )


def pair(seed, turn, event=0.0, noise=0.05, apart=(0,)):
    """Healthy pattern of random teeth, and the same turned, with an event on one tooth or more."""
    rng = np.random.default_rng([9, seed])
    path = np.exp(-2j * np.pi * np.outer(rng.uniform(0, 1.5, 8), NUMBER) / TEETH)
    path = complex_noise(rng, 2, 8) @ path
    healthy = path * np.fft.fft(rng.normal(size=TEETH))[NUMBER % TEETH]
    # the event is heard through another path: it moves no flank, it bends a tooth
    other = complex_noise(rng, 2, 8) @ np.exp(
        -2j * np.pi * np.outer(rng.uniform(0, 1.5, 8), NUMBER) / TEETH
    )
    teeth = int(rng.integers(TEETH)) + np.array(apart)
    added = event * other * np.exp(-2j * np.pi * np.outer(teeth, NUMBER) / TEETH).sum(axis=0)
    new = healthy * np.exp(2j * np.pi * turn * NUMBER) + added
    return pattern(healthy, noise, rng), pattern(new, noise, rng)


def error(found, turn):
    return abs((found - turn + 0.5) % 1.0 - 0.5) * TEETH


@given(st.integers(0, 50), st.floats(0, 1))
def test_the_angle_is_found(seed, turn):
    known, new = pair(seed, turn)
    assert error(turning(known, new, TEETH), turn) < 0.1


@pytest.mark.parametrize("lost", [0.0, 1.0])
def test_mesh_harmonics_tell_where_within_a_tooth_a_faint_pattern_stands(lost):
    """They keep their phases but for a third of a radian, or one of them loses it altogether.

    Of 40 patterns in as much noise 25 stand within a fifth of a tooth beside a whole number by
    their own lines alone.
    """
    rng, mesh, noise = np.random.default_rng(21), NUMBER % TEETH == 0, 20.0
    beside = []
    for seed, turn in enumerate(rng.uniform(size=40)):
        known, new = pair(seed, turn, noise=0.0)
        kept = np.exp(1j * rng.normal(0, 0.3, TOP + 1) * mesh)
        kept[2 * TEETH] *= np.exp(1j * lost * rng.uniform(0, 2 * np.pi))
        loud = np.where(mesh, 30.0, 1.0)
        lines = known.amplitude * loud, new.amplitude * loud * kept
        noisy = (own + noise * complex_noise(rng, *own.shape) for own in lines)
        error_power = np.full(known.variance.shape, noise**2)
        faint = (replace(known, amplitude=own, variance=error_power) for own in noisy)
        off = error(turning(*faint, TEETH), turn)
        beside.append(abs(off - round(off)) < 0.2)
    assert sum(beside) >= 36


@pytest.mark.parametrize("event", [10.0, 40.0, 300.0])
@pytest.mark.parametrize("apart", [(0,), (0, 1), (0, 2), (0, 3)])
def test_loud_teeth_do_not_turn_the_gear(event, apart):
    turns = np.random.default_rng(3).uniform(size=30)
    found = []
    for seed, turn in enumerate(turns):
        known, new = pair(seed, turn, event=event, apart=apart)
        found.append(error(turning(known, new, TEETH), turn) < 0.5)
    assert all(found)


def test_lines_beside_a_gear_that_planets_carry_take_the_phase_of_the_carrier():
    rng = np.random.default_rng(12)
    (known, _), angle = pair(2, 0.0, noise=1e-6), 0.375
    beside = complex_noise(rng, 2, *known.amplitude.shape[1:])
    phase = np.exp(1j * np.array([0.0, 1.1, -2.3]))[:, None, None]
    three = {name: np.repeat(getattr(known, name), 3, axis=0) for name in ("variance", "usable")}
    old = GearPattern(amplitude=np.concatenate([known.amplitude, beside]), **three)
    turned = replace(old.turned(angle), amplitude=old.turned(angle).amplitude * phase)
    found, told = old.turned_to(turned, TEETH)
    assert error(told, angle) < 1e-3
    same = found.amplitude - turned.amplitude
    assert np.abs(same).max() < 1e-2 * np.abs(turned.amplitude).max()
    # the lines of the gear itself keep theirs, whatever the other's path
    assert found.amplitude[0] == pytest.approx(old.turned(told).amplitude[0])


@pytest.mark.parametrize("event", [0.0, 5.0])
def test_nothing_healthy_to_turn_is_no_error(event):
    known, new = pair(1, 0.3, event=event)
    silent = replace(known, amplitude=np.zeros_like(known.amplitude))
    assert 0.0 <= turning(silent, new, TEETH) < 1.0
    none = replace(known, usable=np.zeros_like(known.usable))
    assert 0.0 <= turning(none, new, TEETH) < 1.0


def test_a_sum_of_patterns_has_the_errors_of_a_sum():
    (one, _), (other, _) = pair(1, 0.0, noise=0.1), pair(2, 0.0, noise=0.3)
    other = replace(other, usable=other.usable & (NUMBER > TEETH))
    found = GearPattern.combined([one, other], np.array([0.25, 0.75]), TOP)
    assert found.amplitude == pytest.approx(0.25 * one.amplitude + 0.75 * other.amplitude)
    assert found.variance == pytest.approx(0.25**2 * 0.1**2 + 0.75**2 * 0.3**2)
    assert np.array_equal(found.usable, other.usable)


def test_a_pattern_up_to_a_line_has_that_line_and_none_beyond():
    known, _ = pair(3, 0.0)
    short = GearPattern.combined([known], np.ones(1), TEETH)
    assert short.top == TEETH
    assert np.array_equal(short.amplitude, known.amplitude[..., : TEETH + 1])
    assert short.variance.shape == (1, 2, TEETH + 1)


@pytest.mark.parametrize("steps", [TOP + 1, 256])
def test_the_energy_around_a_turn_is_that_of_its_lines(steps):
    lines = complex_noise(np.random.default_rng(4), 3, 2, TOP + 1)
    energy = turn_energy(lines, NUMBER, steps)
    assert energy.mean(axis=-1) == pytest.approx(np.sum(np.abs(lines) ** 2, axis=(1, 2)))


def test_an_event_has_all_its_energy_where_it_stands():
    band = NUMBER[2 * TEETH : 3 * TEETH]
    lines = np.exp(-2j * np.pi * band * 7 / TEETH)[None]
    expected = np.where(np.arange(TEETH) == 7, float(TEETH) ** 2, 0.0)
    assert turn_energy(lines, band, TEETH) == pytest.approx(expected, abs=1e-9)
    assert np.argmax(turn_energy(lines, band, 8 * TEETH)) == 8 * 7
