"""Averages of every gear of a recording: exact rotations, what was taken out, tables."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from reference.small_gearbox import as_json, machine, recording
from reference.synthetic_signals import lines_on, track_of, wandering_turns, white

from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine, OperatingPoint, ParallelStage, PlanetaryStage
from gearmon.signals.recording import Recording
from gearmon.signatures.gear_averages import gear_averages, wheel_lines
from gearmon.signatures.measured.indicators import gear_signals
from gearmon.signatures.measured.measurement import measure_signature


@pytest.fixture(scope="module")
def found():
    return gear_averages(recording(), machine())


def test_every_gear_has_its_exact_rotation(found):
    assert [(own.wheel.stage, own.wheel.gear, own.wheel.teeth) for own in found.gears] == [
        (1, "pinion", 23),
        (1, "gear", 57),
    ]
    assert found.of(1, "gear").average.rotation_order == pytest.approx(23 / 57, rel=1e-15)
    assert found.of(1, "pinion").numbered
    assert not found.of(1, "gear").numbered
    turns = found.of(1, "pinion").average.turns
    assert found.of(1, "gear").average.turns == pytest.approx(turns * 23 / 57, abs=1.5)
    with pytest.raises(KeyError):
        found.of(2, "pinion")


def test_average_is_residual_and_what_was_removed(found):
    for own in found.gears:
        centred = own.average.waveform - own.average.lines[:, :1].real
        np.testing.assert_allclose(own.signals.regular + own.signals.difference, centred, atol=1e-9)
        residual, difference = own.signals.removed.values()
        assert set(residual) < set(difference)
        # the list is complete: what is left has none of these lines
        left = np.fft.rfft(own.signals.residual)[:, list(residual)]
        assert np.abs(left).max() < 1e-9 * own.average.per_turn


def test_lines_taken_out_are_told_in_orders_of_shaft_1(found):
    """Of either gear its shaft once and twice a turn, then the mesh that they share."""
    for own in found.to_dict()["averages"]:
        orders = own["removed_orders"]["residual"]
        turn = 1.0 if own["shaft"] == 1 else 23 / 57
        assert orders[:4] == pytest.approx([turn, 2 * turn, 23.0, 46.0])


def test_mesh_line_agrees_with_the_hann_blocks(found):
    signature = measure_signature(recording(), machine())
    at = int(np.argmin(np.abs(signature.lines.orders - 23.0)))
    np.testing.assert_allclose(
        found.of(1, "pinion").average.amplitude[:, 23],
        np.abs(signature.lines.mean[:, at]),
        rtol=0.05,
    )


def test_tables(found):
    rows, lines = found.rows(), found.line_rows()
    own = found.of(1, "pinion")
    mine = [row for row in rows if (row["gear"], row["channel"]) == ("pinion", "a1")]
    assert len(mine) == own.average.per_turn
    assert mine[-1]["angle_teeth"] == pytest.approx(23 * (1 - 1 / own.average.per_turn))
    np.testing.assert_allclose(
        [row["average"] for row in mine], own.average.waveform[0], rtol=1e-6, atol=1e-9
    )
    told = [row for row in lines if (row["gear"], row["channel"]) == ("pinion", "a1")]
    amplitude, phase = (
        np.array([row[name] for row in told]) for name in ("amplitude", "phase_deg")
    )
    found_lines = own.average.lines[0, 1:]
    turned = amplitude * np.exp(1j * np.radians(phase))
    np.testing.assert_allclose(turned, found_lines, rtol=1e-4, atol=1e-6 * amplitude.max())
    parts = {row["multiple"]: row["part"] for row in lines if row["gear"] == "pinion"}
    assert [parts[n] for n in (1, 2, 3, 22, 23, 24, 25, 46)] == [
        "shaft",
        "shaft",
        "difference",
        "first sideband",
        "mesh",
        "first sideband",
        "difference",
        "mesh",
    ]
    assert all(row["standard_error"] > 0 for row in lines)
    for row in lines:
        turn = 1.0 if row["gear"] == "pinion" else 23 / 57
        assert row["order"] == pytest.approx(row["multiple"] * turn, rel=1e-12)
    brief = as_json(found.to_dict())
    assert {one["gear"] for one in brief["averages"]} == {"pinion", "gear"}
    assert brief["averages"][0]["channels"][0]["standard_error_rms"] > 0


def train_of(*stages):
    return kinematics(Machine(operating=(OperatingPoint(speed_rpm=1500.0),), stages=stages))


def test_mesh_harmonics_of_both_stages_are_told_on_a_common_shaft():
    train = train_of(
        ParallelStage(pinion_teeth=23, gear_teeth=57), ParallelStage(pinion_teeth=20, gear_teeth=61)
    )
    lines = wheel_lines(2, train.meshes[1].wheels[0], train, 130)
    assert lines.number[lines.mesh].tolist() == [20, 40, 57, 60, 80, 100, 114, 120]
    # a mesh elsewhere, slower than this gear, counts up to its eighth harmonic only
    first = wheel_lines(1, train.meshes[0].wheels[0], train, 400)
    assert set(first.number[first.mesh]) == set(range(23, 401, 23))


def test_planet_of_a_planetary_set():
    stage = PlanetaryStage(sun_teeth=20, planet_teeth=31, ring_teeth=82, planets=3)
    planetary = Machine(operating=(OperatingPoint(speed_rpm=1800.0),), stages=(stage,))
    train = kinematics(planetary)
    planet = train.meshes[0].wheel("planet").relative_order
    time = np.arange(80_000) / 8000.0

    def turns(time_s):
        return wandering_turns(time_s, 30.0, 0.004, seed=2)

    mesh = train.meshes[0].order
    samples = lines_on(turns(time), [mesh, 5 * planet], [1.0, 0.3], 0.2)
    samples = samples + white(samples.shape, 0.05, seed=1)
    own = Recording(samples=samples, sampling_rate_hz=8000.0)
    track = track_of(turns, time[-1], 400)
    # of a signature only the track is used: any will do to carry it
    signature = replace(measure_signature(recording(), machine()), track=track)
    found = gear_averages(own, planetary, signature=signature)
    average = found.of(1, "planet").average
    assert average.rotation_order == planet
    assert average.amplitude[0, 5] == pytest.approx(0.3, abs=4 * average.line_error[0, 5] + 1e-3)
    assert average.amplitude[0, 31] == pytest.approx(1.0, abs=0.01)
    assert {own.wheel.gear for own in found.gears} == {"sun", "planet", "ring"}


def test_a_gear_with_too_few_turns_is_left_out_and_said_so():
    slow = Machine(
        operating=(OperatingPoint(speed_rpm=2960.0),),
        stages=(
            ParallelStage(pinion_teeth=23, gear_teeth=57),
            ParallelStage(pinion_teeth=17, gear_teeth=500),
        ),
    )
    whole = recording()
    signature = measure_signature(whole, machine())
    short = replace(whole, samples=whole.samples[:, :6000].copy())
    found = gear_averages(short, slow, signature=signature)
    assert [(own.wheel.stage, own.wheel.gear) for own in found.gears] == [
        (1, "pinion"),
        (1, "gear"),
        (2, "pinion"),
    ]
    assert any("gear of stage 2: fewer than two turns" in note for note in found.notes)


def test_signals_on_a_coarser_grid(found):
    own = found.of(1, "pinion")
    fine = gear_signals(own.average.lines, own.wheel)
    step = fine.average.shape[-1]
    angle = np.arange(own.average.per_turn) / own.average.per_turn
    read = np.interp(angle, np.arange(step + 1) / step, np.append(fine.residual[0], 0.0))
    assert np.corrcoef(read[:-5], own.signals.residual[0, :-5])[0, 1] > 0.98


@pytest.mark.parametrize("seed", range(8))
def test_mesh_harmonics_of_an_average_are_those_counted_one_by_one(seed):
    """Of the gear's own meshes all, of any other the first eight that fall on whole multiples."""
    rng = np.random.default_rng(seed)
    # few common factors and many: ratios of small whole numbers meet often
    teeth = rng.choice([12, 16, 18, 20, 24, 36, 40, 48, 60], (3, 2)).tolist()
    train = train_of(*(ParallelStage(pinion_teeth=z, gear_teeth=w) for z, w in teeth))
    orders = []
    turning = Fraction(1)
    for pinion, gear in teeth:
        orders.append((turning * pinion, {turning, turning * pinion / gear}))
        turning = turning * pinion / gear
    for stage, mesh in enumerate(train.meshes, 1):
        for wheel in mesh.wheels:
            own_turn = wheel.exact_relative
            expected = set()
            for order, turns in orders:
                for harmonic in range(1, 700 if own_turn in turns else 9):
                    multiple = harmonic * order / own_turn
                    if multiple.denominator == 1 and multiple <= 500:
                        expected.add(int(multiple))
            lines = wheel_lines(stage, wheel, train, 500)
            assert set(lines.number[lines.mesh].tolist()) == expected
