"""Random machines and their recordings are what they are said to be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gearmon.benchmark import detection_machines as makers
from gearmon.benchmark.detection import OTHERS, SIZES
from gearmon.benchmark.detection_machines import (
    GEARS,
    MESH_HZ,
    Condition,
    Setting,
    draw_machine,
)
from gearmon.gears.kinematics import kinematics

SHORT = Setting(seed=5, duration_s=1.0)


@pytest.fixture(scope="module")
def bench():
    return draw_machine(np.random.default_rng(2), channels=2)


@pytest.fixture
def quiet(monkeypatch):
    """Without noise, wander, bearings and unbalance, so that laws hold exactly."""
    for name in ("SPEED_WANDER", "LOAD_WANDER", "UNBALANCE"):
        monkeypatch.setattr(makers, name, 0.0)
    monkeypatch.setattr(makers, "SNR_DB", 300.0)
    monkeypatch.setattr(makers, "SOUND_BEARING", (0.0, 0.0))


def test_machines_can_be_heard_and_differ():
    drawn = [draw_machine(np.random.default_rng(seed), seed) for seed in range(12)]
    assert len({d.machine.stages[0].pinion_teeth for d in drawn}) > 5
    assert {len(d.stages) for d in drawn} == {1, 2}
    for one in drawn:
        for stage in one.stages:
            assert MESH_HZ[0] <= stage.mechanics.mesh_frequency_hz <= MESH_HZ[1]
            assert stage.mechanics.stiffness.contact_ratio > 1
            model = stage.model
            critical = 2 * np.sqrt(model.stiffness_n_per_m * model.mass_kg)
            assert 0.04 <= model.damping_ns_per_m / critical <= 0.12
            assert 0.9 <= model.stiffness_n_per_m / stage.mechanics.stiffness.mean_n_per_m <= 1.1


def test_drawn_machines_are_loaded_and_turn_as_is_said():
    slowest, loads, longest_s = [], [], []
    for seed in range(40):
        drawn = draw_machine(np.random.default_rng(seed), seed)
        machine = drawn.machine
        for gear in (own for stage in drawn.stages for own in stage.gears):
            assert abs(gear.pitch_m.mean()) < 1e-3 * gear.pitch_m.std()
            assert 0.5 * makers.PITCH_M[0] < gear.pitch_m.std() < 1.5 * makers.PITCH_M[1]
        longest_s.append(drawn.path.shape[-1] / makers.RATE_HZ)
        train, point, first = kinematics(machine), machine.operating[0], machine.stages[0]
        slowest.append(min(shaft.order for shaft in train.shafts) * point.speed_rpm / 60)
        for mesh in train.meshes:
            assert MESH_HZ[0] <= mesh.order * point.speed_rpm / 60 <= MESH_HZ[1]
        # tangential force on the pitch circle of the pinion, over the width
        radius_mm = first.module_mm * first.pinion_teeth / 2
        loads.append(1e3 * point.torque_nm / radius_mm / first.face_width_mm)
    low, high = makers.LOAD_N_PER_MM
    assert 0.97 * low <= min(loads) < 1.3 * low
    assert 0.8 * high < max(loads) <= 1.03 * high
    assert makers.SLOWEST_HZ <= min(slowest) < 2 * makers.SLOWEST_HZ
    # a mode has fallen to 1e-4 after ln 1e4/(2 pi f zeta): 0.59 s for the slowest there may be
    rest = np.log(1e4) / (2 * np.pi * makers.MODE_BAND_HZ[0] * makers.MODE_DAMPING[0])
    assert 0.3 * rest < max(longest_s) <= rest + 1 / makers.RATE_HZ


def test_same_seeds_same_recording(bench):
    one = bench.take(Condition(), SHORT)
    again = draw_machine(np.random.default_rng(2), channels=2).take(Condition(), SHORT)
    assert np.array_equal(one.recording.samples, again.recording.samples)
    other = bench.take(Condition(), replace(SHORT, seed=6))
    assert not np.array_equal(one.recording.samples, other.recording.samples)


def test_gain_and_tacho(bench):
    plain = bench.take(Condition(), SHORT).recording
    loud = bench.take(Condition(), replace(SHORT, gain=2.0)).recording
    assert loud.channel_kinds == ("vibration", "vibration", "tacho")
    np.testing.assert_allclose(loud.samples, np.array([[2], [2], [1]]) * plain.samples, rtol=1e-12)


@pytest.mark.usefixtures("quiet")
def test_modes_of_a_warmer_housing_are_lower(bench):
    seconds = np.arange(4000) / makers.RATE_HZ

    def heard(mode_hz, warmth):
        ringing = np.exp(-0.02 * 2 * np.pi * mode_hz * seconds) * np.sin(
            2 * np.pi * mode_hz * seconds
        )
        path = np.tile(ringing, (1, len(bench.stages), 1))
        taken = replace(bench, path=path).take(Condition(), replace(SHORT, warmth=warmth))
        return taken.recording.vibration().samples

    lower, same = heard(990.0, 0.0), heard(1000.0, -0.01)
    np.testing.assert_allclose(same, lower, atol=2e-3 * np.abs(lower).max())
    assert np.abs(heard(1000.0, 0.0) - lower).max() > 0.02 * np.abs(lower).max()


def test_pulses_stand_at_whole_turns(bench):
    taken = bench.take(Condition(), SHORT)
    pulses = taken.recording.samples[-1]
    rise = np.flatnonzero((pulses[:-1] < 2.5) & (pulses[1:] >= 2.5))
    share = (2.5 - pulses[rise]) / (pulses[rise + 1] - pulses[rise])
    turns = [taken.turns_at(t) for t in (rise + share) / taken.recording.sampling_rate_hz]
    np.testing.assert_allclose(turns, np.round(turns), atol=2e-5)
    assert np.all(np.diff(np.round(turns)) == 1)


def test_noise_is_twenty_decibels_down(bench, monkeypatch):
    noisy = bench.take(Condition(), SHORT)
    monkeypatch.setattr(makers, "SNR_DB", 300.0)
    silent = bench.take(Condition(), SHORT)
    rest = noisy.recording.samples[0] - silent.recording.samples[0]
    assert np.std(rest) == pytest.approx(0.1 * np.std(silent.recording.samples[0]), rel=0.02)


@pytest.mark.usefixtures("quiet")
def test_vibration_is_a_part_with_the_load_and_a_part_of_errors(bench):
    rows = [
        bench.take(Condition(), replace(SHORT, load=load)).recording.samples[0]
        for load in (0.8, 1.0, 1.2)
    ]
    np.testing.assert_allclose(rows[1], 0.5 * (rows[0] + rows[2]), atol=1e-6 * np.std(rows[1]))
    # the errors are a part that does not grow with the load
    assert np.std(rows[2]) / np.std(rows[1]) != pytest.approx(1.2, rel=1e-6)


@pytest.mark.usefixtures("quiet")
def test_what_a_sound_mesh_sends_is_mass_times_acceleration(bench):
    """Without errors, housing and wander every mesh line is force times m (2 pi f)^2 z_f."""
    stage = bench.stages[0]
    sound = tuple(replace(g, pitch_m=0 * g.pitch_m, runout_m=0 * g.runout_m) for g in stage.gears)
    plain = replace(bench, stages=(replace(stage, gears=sound),), path=np.ones((1, 1, 1)))
    taken = plain.take(Condition(), SHORT)
    model, teeth = stage.model, sound[0].teeth
    turns, weights = taken.turns * teeth, np.hanning(len(taken.turns))
    for harmonic in (1, 2, 3):
        z = model.motion(teeth)[0][harmonic * teeth]
        angular = 2 * np.pi * harmonic * model.mesh_hz
        expected = stage.mechanics.force_n * model.mass_kg * angular**2 * z
        wave = weights * np.exp(-2j * np.pi * harmonic * turns) / weights.sum()
        assert abs(taken.recording.samples[0] @ wave - expected) < 0.01 * abs(expected)


@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize("gear", GEARS)
def test_damaged_tooth_departs_once_a_turn_where_it_meshes(bench, gear):
    drawn = bench
    number = len(drawn.stages)
    stage = drawn.stages[-1]
    teeth = stage.gears[GEARS.index(gear)].teeth
    hurt = Condition(kind="tooth", stage=number, gear=gear, tooth=9, size=0.1)
    taken, sound = (bench.take(c, SHORT) for c in (hurt, Condition()))
    turns = taken.turns.copy()
    for other in drawn.stages[:-1]:
        turns *= other.gears[0].teeth / other.gears[1].teeth
    phase = turns * stage.gears[0].teeth % teeth
    departure = taken.recording.samples[0] - sound.recording.samples[0]
    energy, _ = np.histogram(phase, bins=teeth, range=(0, teeth), weights=departure**2)
    # tooth 9 enters at phase 8; the housing rings on for a while
    assert int(np.argmax(energy)) in (7, 8, 9, 10)
    assert energy.max() > 5 * np.median(energy)


@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize("kind", OTHERS)
def test_every_condition_is_heard(bench, kind):
    condition = Condition(kind=kind, stage=1, gear="pinion", size=SIZES[kind][1], seed=4)
    taken, sound = (bench.take(c, SHORT).recording for c in (condition, Condition()))
    # a flank that moves but once a turn takes the masses along: it excites next to nothing
    least = 1e-3 if kind == "eccentricity" else 0.01
    assert np.std(taken.samples[0] - sound.samples[0]) > least * np.std(sound.samples[0])


def test_misalignment_takes_its_size_once_a_turn_and_nothing_half_a_turn_later(bench):
    stage = bench.stages[0]
    state = Condition(kind="misalignment", stage=1, gear="pinion", size=0.3, seed=4)
    _, lost = makers.gear_marks(stage, 0, stage.model, state)
    share = lost / stage.model.wave(np.ones(stage.gears[0].teeth))
    assert (share.min(), share.max()) == pytest.approx((0.0, 0.3), abs=1e-5)
    assert share.mean() == pytest.approx(0.15, rel=1e-6)
