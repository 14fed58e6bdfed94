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


@pytest.fixture(scope="module")
def perfect(bench):
    """The same machine with perfect flanks that run true."""
    (stage,) = bench.stages
    gears = (replace(g, pitch_m=0 * g.pitch_m, runout_m=0 * g.runout_m) for g in stage.gears)
    return replace(bench, stages=(replace(stage, gears=tuple(gears)),))


@pytest.fixture(scope="module")
def two_stages():
    drawn = draw_machine(np.random.default_rng(0), channels=2)
    assert len(drawn.stages) == 2
    return drawn


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


def test_gears_run_out_once_a_turn_and_ever_less_by_higher_harmonics():
    rng = np.random.default_rng(1)
    gears = [makers._draw_gear(rng, 40) for _ in range(200)]
    sizes = np.abs([gear.runout_m for gear in gears])
    np.testing.assert_allclose(sizes / sizes[:, :1], [[1.0, 0.2, 0.1, 0.05]] * 200)
    low, high = makers.ECCENTRICITY_M
    assert low <= sizes[:, 0].min() < 1.2 * low < 0.8 * high < sizes[:, 0].max() <= high
    # as many of small ones as of large: the logarithm is uniform
    assert np.median(sizes[:, 0]) == pytest.approx(np.sqrt(low * high), rel=0.25)
    phases = np.angle([gear.runout_m for gear in gears])
    assert np.abs(np.exp(1j * phases).mean(axis=0)).max() < 0.2
    pitch = [gear.pitch_m.std() for gear in gears]
    assert np.mean(pitch) == pytest.approx(np.mean(makers.PITCH_M), rel=0.1)


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
def test_perfect_gears_send_as_much_as_they_carry_and_errors_the_same_at_any_load(bench, perfect):
    (half, whole), (less, more) = (
        [
            drawn.take(Condition(), replace(SHORT, load=load)).recording.samples[:-1]
            for load in (0.5, 1.0)
        ]
        for drawn in (perfect, bench)
    )
    np.testing.assert_allclose(2 * half, whole, atol=1e-9 * np.abs(whole).max())
    np.testing.assert_allclose(less - half, more - whole, atol=1e-9 * np.abs(whole).max())
    assert np.abs(more - whole).max() > 1e-3 * np.abs(whole).max()


def test_impacts_of_a_bearing_slip_a_little_about_their_order(bench):
    """Every one within 2 % (standard deviation) of its place, as loud as the condition says."""
    turns = 3.3 + bench.speed_hz * np.arange(200_000) / makers.RATE_HZ
    force = np.random.default_rng(1).normal(5.0, 3.0, len(turns))
    state = Condition(kind="bearing", size=0.4)
    train = bench._impacts(state, turns, force, np.random.default_rng(2))
    order = bench.bearing_orders[0]
    at = order * turns[train > 0]
    expected = order * (turns[-1] - turns[0])
    assert len(at) == pytest.approx(expected, abs=2)
    assert np.std(at - np.round(at)) == pytest.approx(0.02, rel=0.15)
    # a sample is late by half of one in the mean
    assert abs(np.mean(at - np.round(at))) < 0.005
    assert np.sqrt(np.mean(train**2)) == pytest.approx(0.4 * force.std(), rel=0.01)
    assert len(set(train[train > 0])) == 1
    sound = bench._impacts(Condition(), turns, force, np.random.default_rng(2))
    low, high = makers.SOUND_BEARING
    assert low <= np.sqrt(np.mean(sound**2)) / force.std() <= high


def test_every_stage_hides_the_mesh_of_its_own_gears(two_stages):
    hidden = [stage.mechanics for stage in two_stages.stages]
    mesh_hz = [two_stages.speed_hz * mesh.order for mesh in kinematics(two_stages.machine).meshes]
    assert [own.mesh_frequency_hz for own in hidden] == pytest.approx(mesh_hz, rel=1e-3)
    for own, stage in zip(two_stages.stages, two_stages.machine.stages, strict=True):
        assert [gear.teeth for gear in own.gears] == [stage.pinion_teeth, stage.gear_teeth]


def test_tones_are_those_of_bearings_and_shafts_with_their_share(two_stages):
    seconds = np.arange(100_000) / makers.RATE_HZ
    turns = two_stages.speed_hz * seconds
    heard = np.random.default_rng(1).normal(size=(2, len(turns))) * np.array([[1.0], [7.0]])
    state = Condition(kind="bearing", size=0.4)
    tones = two_stages._tones(state, turns, heard, np.random.default_rng(2))
    orders = [*two_stages.bearing_orders[1:], *two_stages.shaft_orders]
    waves = np.array([f(2 * np.pi * own * turns) for own in orders for f in (np.sin, np.cos)])
    parts, rest, *_ = np.linalg.lstsq(waves.T, tones.T, rcond=None)
    assert rest.max() < 1e-9 * np.square(tones).sum()
    amplitude = np.hypot(*parts.reshape(len(orders), 2, 2).transpose(1, 0, 2))
    weights = np.array([0.4, 0.4, *[makers.UNBALANCE] * 3])
    share = amplitude / weights[:, None] / heard.std(axis=1)
    assert share.min() >= 0.5
    assert share.max() <= 1.5
    # each tone and channel with a part of its own
    assert len(set(share.ravel().round(6))) == share.size


def test_noise_is_white_and_a_third_of_its_power_coloured_by_a_sum_of_eight():
    """Power at angle w a sample: 2/3 + |sum of e^(-iwk)|^2 / 24, times the square of its size."""
    noise = makers._noise(np.random.default_rng(1), 1 << 18, 3.0)
    assert noise.std() == pytest.approx(3.0, rel=0.02)
    blocks = np.fft.rfft(noise.reshape(-1, 64), axis=1)
    power = np.mean(np.abs(blocks) ** 2, axis=0) / 64
    # leaks of a block without a window: Fejer's kernel, which has the sum of lags
    lags = np.arange(-7, 8)
    correlation = np.where(lags == 0, 2 / 3, 0.0) + (8 - np.abs(lags)) / 24
    angles = 2 * np.pi * np.arange(33) / 64
    expected = 9.0 * np.cos(np.outer(angles, lags)) @ (correlation * (1 - np.abs(lags) / 64))
    np.testing.assert_allclose(power, expected, rtol=0.1)


def test_what_wanders_does_so_slowly_and_as_far_as_is_said():
    """Of many, the mean square is the deviation's; nothing above half a turn a second."""
    rng = np.random.default_rng(3)
    count = round(20 * makers.RATE_HZ)
    courses = np.array([makers._wander(rng, count, 0.03)[::200] for _ in range(25)])
    assert np.sqrt(np.mean(courses**2)) == pytest.approx(0.03, rel=0.1)
    assert abs(courses.mean()) < 0.003
    power = np.abs(np.fft.rfft(courses * np.hanning(courses.shape[1]), axis=1)) ** 2
    hertz = np.fft.rfftfreq(courses.shape[1], 200 / makers.RATE_HZ)
    assert power[:, hertz > makers.WANDER_HZ + 0.1].sum() < 1e-3 * power.sum()
    assert power[:, hertz > 0.25].sum() > 0.1 * power.sum()


def test_marks_of_a_gear_are_as_large_as_its_condition_says(bench, perfect):
    """Over the static deflection, and over the stiffness of the mesh."""
    stage, sound = bench.stages[0], perfect.stages[0]
    model, teeth = stage.model, stage.gears[1].teeth
    whole = model.wave(np.ones(teeth))
    deflection = stage.mechanics.force_n / model.stiffness_n_per_m

    def marks(own=sound, **state):
        return makers.gear_marks(own, 1, model, Condition(stage=1, gear="gear", **state))

    error, loss = marks()
    assert np.abs(error).max() == 0.0
    assert loss == 0.0
    error, _ = marks(kind="eccentricity", size=2.0, seed=1)
    lines = np.abs(np.fft.rfft(error, norm="forward"))
    assert 2 * lines[1] == pytest.approx(2.0 * deflection)
    assert lines[2:].max() < 1e-9 * lines[1]
    error, _ = marks(kind="wear", size=0.5)
    once = error.reshape(teeth, -1)
    # alike on all teeth; the difference of root or tip from the pitch point is the size
    np.testing.assert_allclose(once, np.tile(once[0], (teeth, 1)), atol=1e-12 * deflection)
    assert np.ptp(error) == pytest.approx(0.5 * deflection, rel=1e-3)
    assert abs(error.mean()) < 1e-3 * deflection
    middle = once[0][round((0.5 * model.length % 1) * model.points) % model.points]
    assert middle == pytest.approx(error.max(), rel=0.02)
    _, loss = marks(kind="tooth", tooth=4, size=0.3)
    hurt = np.eye(teeth)[3]
    np.testing.assert_allclose(loss, 0.3 * model.wave(hurt))
    _, loss = marks(kind="pitting", size=0.1, seed=3)
    assert 0.05 * 0.1 < loss.mean() / whole.mean() < 0.1
    error, _ = marks(stage)
    once = np.fft.rfft(error - model.wave(stage.gears[1].pitch_m) / whole, norm="forward")
    np.testing.assert_allclose(2 * once[1:5], stage.gears[1].runout_m)


@pytest.mark.usefixtures("quiet")
def test_what_a_sound_mesh_sends_is_mass_times_acceleration(perfect):
    """Without errors, housing and wander every mesh line is force times m (2 pi f)^2 z_f."""
    (stage,) = perfect.stages
    plain = replace(perfect, path=np.ones((1, 1, 1)))
    # its motions are solved for already
    plain._tables.update(perfect._tables)
    taken = plain.take(Condition(), SHORT)
    model, teeth = stage.model, stage.gears[0].teeth
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


@pytest.mark.parametrize("seed", range(4))
def test_paths_ring_in_the_band_of_their_modes_until_they_have_died_away(seed):
    """What a mode adds begins at rest, as its deflection does after a blow."""
    path = makers._draw_path(np.random.default_rng(seed), 2, 1)[:, 0]
    assert np.abs(path[:, 0]).max() < 1e-12 * np.abs(path).max()
    assert np.abs(path[:, -50:]).max() < 1e-3 * np.abs(path).max()
    power = np.abs(np.fft.rfft(path, 1 << 16)) ** 2
    hertz = makers.RATE_HZ * np.arange(power.shape[1]) / (1 << 16)
    low, high = makers.MODE_BAND_HZ
    inside = (hertz > 0.9 * low) & (hertz < 1.1 * high)
    assert np.all(power[:, inside].sum(axis=1) > 0.98 * power.sum(axis=1))
