"""The comb of a bearing is no mesh, whatever tooth counts are claimed; a faulty gear is one."""

from __future__ import annotations

import numpy as np
import pytest
from reference.bearing_rigs import KINDS, bearing_rig
from reference.speed_cases import train_of
from reference.synthetic_signals import constant_track, lines_on, white

from gearmon.gears.kinematics import kinematics
from gearmon.signals.orders import InAngle, fine_order_spectrum
from gearmon.signals.recording import Recording
from gearmon.signals.tracking import foreign_spacing
from gearmon.signatures.measured.measurement import measure_signature
from gearmon.signatures.tracking import mesh_combs

RATE = 12_000.0


def spacing_about(samples, rate, speed_hz, *teeth, own=()):
    """What `foreign_spacing` says of a pair at a speed."""
    train = kinematics(train_of(teeth, speed_hz=speed_hz))
    track = constant_track(speed_hz, (samples.shape[-1] - 1) / rate)
    spectrum = fine_order_spectrum(InAngle.of(samples, rate, track))
    (comb,) = mesh_combs(train, speed_hz)
    assert comb.turning == (teeth[0] / teeth[1], 1.0)
    return foreign_spacing(spectrum, comb, own)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("multiple", [3, 5, 7])
def test_multiple_of_a_ball_pass_line_belongs_to_the_finer_comb(kind, multiple):
    generator = np.random.default_rng([multiple, KINDS.index(kind)])
    samples, shaft_hz, order = bearing_rig(generator, kind, RATE, 5.0)
    # the speed at which the mesh of 31 teeth falls on that multiple
    speed_hz = multiple * order * shaft_hz / 31
    spacing = spacing_about(samples, RATE, speed_hz, 31, 78)
    assert spacing is not None
    parts = 31 / multiple / spacing
    assert parts == pytest.approx(round(parts), abs=1e-6)


@pytest.mark.parametrize("damaged", [False, True])
def test_lines_of_a_gear_are_its_own(damaged):
    # a mesh with sidebands; a damaged tooth fills every order of its shaft
    generator = np.random.default_rng(4)
    time = np.arange(int(8 * RATE)) / RATE
    orders = [24.0 * k + r for k in range(1, 7) for r in (-1, 0, 1)]
    levels = np.array([0.1, 1.0, 0.1] * 6)
    if damaged:
        orders = [float(n) for n in range(1, 150)]
        levels = np.where(np.array(orders) % 24 == 0, 1.0, 0.3)
    phases = generator.uniform(0, 6.28, len(orders))
    samples = lines_on(20.0 * time, orders, levels, phases) + white((1, len(time)), seed=1)
    assert spacing_about(samples, RATE, 20.0, 24, 65) is None


def test_alternating_pitch_errors_are_a_gears_own_comb_at_half_the_mesh():
    # errors of the 24 teeth that alternate: order 12 of the pinion, between all mesh harmonics
    generator = np.random.default_rng(7)
    time = np.arange(int(8 * RATE)) / RATE
    orders = np.arange(1, 15) * 12.0
    levels = np.where(orders % 24 == 0, 1.0, 0.6)
    phases = generator.uniform(0, 6.28, len(orders))
    samples = lines_on(20.0 * time, orders, levels, phases) + white((1, len(time)), seed=1)
    assert spacing_about(samples, RATE, 20.0, 24, 65) == pytest.approx(12.0)
    # 65 teeth have no such pattern
    assert spacing_about(samples, RATE, 20.0, 24, 65, own=[24 / 65]) == pytest.approx(12.0)
    assert spacing_about(samples, RATE, 20.0, 24, 65, own=[1.0, 24 / 65]) is None
    # nor is what the path leaves of it, each third line, a comb of something else
    orders = np.arange(1, 24) * 12.0
    levels = np.where(orders % 24 == 0, 1.0, np.where(orders % 36 == 0, 0.9, 0.0))
    samples = lines_on(20.0 * time, orders, levels) + white((1, len(time)), seed=2)
    assert spacing_about(samples, RATE, 20.0, 24, 65) == pytest.approx(36.0)
    assert spacing_about(samples, RATE, 20.0, 24, 65, own=[1.0, 24 / 65]) is None


@pytest.mark.parametrize("beside", [0.35, 0.0])
def test_every_third_order_of_a_broken_pinion_is_no_other_thing_that_turns(beside):
    """Of 18 teeth these are four lines of its pattern; but a comb alone there is another thing."""
    generator = np.random.default_rng(3)
    time = np.arange(int(8 * RATE)) / RATE
    orders = np.arange(1, 127.0)
    levels = np.where(orders % 3 == 0, 1.0, beside) * generator.lognormal(0, 0.2, len(orders))
    phases = generator.uniform(0, 6.28, len(orders))
    samples = lines_on(20.0 * time, orders, levels, phases) + white((1, len(time)), 5.0, seed=1)
    assert spacing_about(samples, RATE, 20.0, 18, 37) in (3.0, 9.0)
    own = spacing_about(samples, RATE, 20.0, 18, 37, own=[1.0])
    assert own is None if beside else own == pytest.approx(3.0)


def test_invented_pairs_are_not_found_on_bearings():
    # 20 rigs: at the one in fifty of a larger trial (568 pairs) more than one would be rare
    found = []
    for seed in range(20):
        generator = np.random.default_rng([seed, 9])
        kind = KINDS[seed % 3]
        samples, shaft_hz, _ = bearing_rig(
            generator, kind, RATE, float(generator.choice([1.0, 3.0]))
        )
        pinion, gear = int(generator.integers(13, 40)), int(generator.integers(41, 100))
        machine = train_of((pinion, gear), speed_hz=shaft_hz / generator.uniform(0.97, 1.03))
        recording = Recording(samples=samples, sampling_rate_hz=RATE, origin=f"{kind} {seed}")
        found.append(measure_signature(recording, machine).found)
    assert sum(found) <= 1
