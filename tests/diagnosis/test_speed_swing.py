"""A drive whose speed swings while it is recorded, beside healthy recordings of a steady one."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.signal import oaconvolve

from gearmon import analyse, learn
from gearmon.machine import Machine, OperatingPoint, ParallelStage
from gearmon.signals.recording import Recording

RATE, DURATION, TEETH, SPEED = 10_000.0, 10.0, (35, 97), 24.0


@cache
def machine():
    stage = ParallelStage(
        pinion_teeth=TEETH[0], gear_teeth=TEETH[1], module_mm=3.0, face_width_mm=30.0
    )
    point = OperatingPoint(speed_rpm=60 * SPEED, torque_nm=100.0)
    return Machine(name="modulated", operating=(point,), stages=(stage,))


def housing(rng):
    """Impulse response of 12 modes, 0.5 to 2 per cent damped."""
    time = np.arange(int(0.1 * RATE)) / RATE
    natural = np.exp(rng.uniform(np.log(300.0), np.log(4500.0), (12, 1)))
    decay = 2 * np.pi * natural * rng.uniform(0.005, 0.02, (12, 1))
    heard = (rng.normal(size=(12, 1)) * np.exp(-decay * time)).T * np.sin(
        2 * np.pi * natural * time
    ).T
    return heard.sum(axis=1) / np.sqrt((heard.sum(axis=1) ** 2).sum())


@cache
def drive(number, swing, seed, load=1.0, broken=0.0, pulses=0):
    """Mesh harmonics modulated by both gears, through a housing; one tooth yields by `broken`.

    A tachometer of so many pulses a turn is named as one only.
    """
    own, rng = np.random.default_rng([21, number]), np.random.default_rng([22, number, seed])
    heard = housing(own)
    count = int(DURATION * RATE) + len(heard)
    course = 1 + swing * np.sin(2 * np.pi * (0.2 * np.arange(count) / RATE + rng.uniform()))
    pinion = rng.uniform(0, 99) + np.cumsum(SPEED * course) / RATE
    angles = pinion, pinion * TEETH[0] / TEETH[1]
    signal = np.zeros(count)
    for k in range(1, 6):
        modulated = np.ones(count)
        for angle, teeth in zip(angles, TEETH, strict=True):
            for turns in (1, 2, 3):
                size, phase = 0.04 * own.lognormal(0, 0.5) / turns, own.uniform(0, 6.28)
                modulated += size * np.cos(2 * np.pi * turns * angle + phase)
            pitch = own.normal(0, 0.02, teeth)
            modulated += np.interp(angle * teeth % teeth, np.arange(teeth + 1), [*pitch, pitch[0]])
        at_tooth = (angles[0] * TEETH[0] - 6.5) % TEETH[0] - 0.5
        modulated -= broken * np.exp(-0.5 * (at_tooth / 0.6) ** 2)
        level, phase = own.lognormal(0, 0.5) * load, own.uniform(0, 6.28)
        signal += level * modulated * np.cos(2 * np.pi * k * TEETH[0] * pinion + phase)
    through = oaconvolve(signal, heard, mode="valid")
    through += 0.1 * through.std() * rng.normal(size=len(through))
    made = {"sampling_rate_hz": RATE, "origin": f"drive {seed}"}
    if not pulses:
        return Recording(samples=through[None], **made)
    marks = np.where((pinion[len(heard) - 1 :] * pulses + 0.3) % 1 < 0.2, 5.0, 0.0)
    kinds = {"channel_names": ("a1", "tacho"), "channel_kinds": ("vibration", "tacho")}
    return Recording(samples=np.stack([through, marks]), **made, **kinds, tacho_told=False)


@cache
def steady_one(number):
    """What three healthy recordings of a steady drive teach."""
    return learn([drive(number, 0.002, seed) for seed in (1, 2, 3)], machine())


@cache
def run_up_and_down(number, swing, pulses):
    """What two healthy recordings at other loads teach."""
    loads = (1, 0.7), (2, 1.0)
    return learn(
        [drive(number, swing, seed, load, pulses=pulses) for seed, load in loads], machine()
    )


@pytest.mark.parametrize("number", [0, 3, 6])
def test_a_speed_that_swings_as_no_healthy_recording_is_no_fault(number):
    for swing in (0.05, 0.1):
        found = analyse(drive(number, swing, seed=4), machine(), steady_one(number))
        assert found.verdict != "fault"
        assert any("swung by" in warning for warning in found.warnings)


def test_a_broken_tooth_is_found_though_the_speed_swings():
    found = analyse(drive(0, 0.05, seed=4, broken=0.4), machine(), steady_one(0))
    assert (found.verdict, found.flags[0].kind, found.flags[0].gear) == (
        "fault",
        "tooth damage",
        "pinion",
    )


def test_beside_recordings_that_swing_alike_nothing_is_said_of_it():
    swinging = learn([drive(1, 0.05, seed) for seed in (1, 2)], machine())
    found = analyse(drive(1, 0.05, seed=4), machine(), swinging)
    assert found.verdict == "healthy"
    assert not any("swung by" in warning for warning in found.warnings)


@pytest.mark.parametrize(("swing", "pulses"), [(0.3, 1), (0.4, 2), (0.12, 0), (0.2, 0)])
def test_a_machine_that_is_run_up_and_down_is_judged_as_a_steady_one(swing, pulses):
    reference = run_up_and_down(0, swing, pulses)
    assert not any("angle" in note for note in reference.notes)
    sound = analyse(drive(0, swing, 4, 0.85, pulses=pulses), machine(), reference)
    assert sound.verdict == "healthy"
    assert sound.signature.speed_swings
    broken = analyse(drive(0, swing, 5, 0.85, 0.4, pulses), machine(), reference)
    assert broken.verdict == "fault"
    assert (broken.flags[0].kind, broken.flags[0].gear) == ("tooth damage", "pinion")


def test_recordings_whose_angle_was_lost_are_named_when_they_are_learned():
    # without a tachometer, behind modes of 0.5 to 2 per cent damping
    reference = learn([drive(3, 0.2, 1), drive(3, 0.2, 2)], machine())
    assert sum("its angle was lost on the way" in note for note in reference.notes) == 2


@pytest.mark.parametrize("number", [0, 2])
def test_knocks_are_no_tooth_while_the_speed_swings(number):
    sound = drive(number, 0.3, 4, 0.85, pulses=1)
    samples, rng = sound.samples.copy(), np.random.default_rng(number)
    ring = np.exp(-np.arange(1000) / 80) * np.sin(0.6 * np.arange(1000))
    for start in rng.integers(0, samples.shape[1] - 1000, 3):
        samples[0, start : start + 1000] += 60 * sound.samples[0].std() * ring
    found = analyse(replace(sound, samples=samples), machine(), run_up_and_down(number, 0.3, 1))
    assert not any(flag.gear for flag in found.flags)
    assert found.verdict in ("healthy", "cannot tell")
