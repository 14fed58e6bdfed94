"""The gearbox in what is felt: shares of known lines, and damage through a known path."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from reference.small_gearbox import machine
from reference.told_numbers import untold, with_units

import gearmon
from gearmon.errors import GearmonError
from gearmon.exposure import WEIGHTINGS, DayPlan, Job, seat_factor, sum_up
from gearmon.exposure.gearbox import _orders
from gearmon.gears.kinematics import kinematics
from gearmon.machine import load_machine
from gearmon.report import exposure_lines
from gearmon.signals.recording import Recording

RATE, SECONDS = 10_000.0, 8.0
SHAFT_HZ = 2960.0 / 60
#: Gain from the teeth to the hand; noise of both axes [m/s2].
GAIN, NOISE = (0.02, 0.05), 0.05


@cache
def expected(*faults):
    return gearmon.expected_signature(machine(), faults)


@cache
def recording(shaft=0.4):
    """Mesh lines of the healthy machine through a gain, both shafts, and noise."""
    time, generator = np.arange(round(RATE * SECONDS)) / RATE, np.random.default_rng(3)
    healthy = expected()
    kept = healthy["frequency_hz"] < 4500.0
    rows = []
    for gain in GAIN:
        lines = zip(
            healthy["frequency_hz"][kept], healthy["acceleration_ms2"][kept],
            healthy["phase_rad"][kept], strict=True,
        )  # fmt: skip
        row = sum(gain * a * np.cos(2 * np.pi * f * time + p) for f, a, p in lines)
        row += shaft * np.sin(2 * np.pi * SHAFT_HZ * time)
        row += 0.5 * shaft * np.sin(2 * np.pi * SHAFT_HZ * 23 / 57 * time)
        rows.append(row + NOISE * generator.normal(size=len(time)))
    return Recording(
        samples=np.array(rows), sampling_rate_hz=RATE, channel_names=("x", "y"),
        units=("m/s2", "m/s2"), origin="lever.csv",
    )  # fmt: skip


@cache
def found(*faults):
    return gearmon.gear_share(recording(), exposure(), machine(), faults)


def exposure(position="hand"):
    return gearmon.vibration_exposure(recording(), position)


def weight(frequency):
    return np.abs(WEIGHTINGS["Wh"].response(frequency)) ** 2


def of_mesh(gain, *faults, below=np.inf, lines=None):
    """Weighted mean square of expected lines, summed by hand."""
    lines = lines or expected(*faults)
    kept, felt = lines["frequency_hz"] < below, weight(lines["frequency_hz"])
    return float((gain**2 * lines["acceleration_ms2"] ** 2 / 2 * felt)[kept].sum())


def test_shares_are_those_of_the_lines_that_were_put_in():
    total = [axis.rms_ms2**2 for axis in exposure().axes]
    lines = {own.name: own.share for own in found().lines}
    shafts = {"shaft 1": (0.4, SHAFT_HZ), "shaft 2": (0.2, SHAFT_HZ * 23 / 57)}
    for name, (amplitude, frequency) in shafts.items():
        expected_share = amplitude**2 / 2 * weight(frequency) / np.array(total)
        assert lines[name] == pytest.approx(expected_share, rel=0.03)
    assert found().speed_hz == pytest.approx(SHAFT_HZ, rel=1e-4)
    for gain, share, square in zip(GAIN, lines["mesh 1"], total, strict=True):
        assert share == pytest.approx(of_mesh(gain, below=4500.0) / square, rel=0.03)
    for axis in range(2):
        assert found().share[axis] == pytest.approx(sum(own[axis] for own in lines.values()))
        assert 0.8 < found().share[axis] < 1.005  # both are measured


@pytest.mark.parametrize("fault", ["wear:1:pinion:all:20%", "crack:1:pinion:5:40%"])
def test_damage_adds_what_its_lines_are_through_the_path(fault):
    point = found(fault).points[0]
    added = sum(of_mesh(gain, fault) - of_mesh(gain) for gain in GAIN)
    assert point.damaged_ms2**2 - point.value_ms2**2 == pytest.approx(added, rel=0.05)
    assert point.value_ms2 == pytest.approx(exposure().value_ms2, rel=0.01)


def test_what_damage_adds_is_told_in_percent():
    told, fault = found("crack:1:pinion:5:40%"), "crack:1:pinion:5:40%"
    (point,) = told.points
    lines = exposure_lines(told)
    row = lines[next(n for n, line in enumerate(lines) if "added %" in line) + 1]
    rpm, gears, value, damaged, added = map(float, row.split()[-5:])
    assert (rpm, gears) == (point.speed_rpm, pytest.approx(point.gears_ms2, rel=5e-3))
    assert value == pytest.approx(point.value_ms2, rel=5e-3)
    assert damaged == pytest.approx(point.damaged_ms2, rel=5e-3)
    assert added == pytest.approx(100 * (point.damaged_ms2 / point.value_ms2 - 1), rel=5e-3)
    assert any(f"with {fault}" in line for line in lines)


@pytest.mark.parametrize("position", ["hand", "seat"])
def test_the_present_operating_point_is_felt_as_it_was_measured(position):
    """All axes count at the hand, the worst at the seat."""
    felt = exposure(position)
    (point,) = gearmon.gear_share(recording(), felt, machine()).points
    assert point.value_ms2 == pytest.approx(felt.value_ms2, rel=0.01)


def test_operating_points_are_ranked_by_what_is_felt():
    points = [{"speed_rpm": rpm, "torque_nm": nm, "share": 0.5, "name": name} for rpm, nm, name in
              ((2960.0, 120.0, "full"), (2960.0, 60.0, "half"))]  # fmt: skip
    known = machine().to_dict() | {"operating": points}
    told = gearmon.gear_share(recording(), exposure(), known)
    assert [own.name for own in told.points] == ["half", "full"]
    for number, point in enumerate(reversed(told.points)):
        lines = gearmon.expected_signature(known, operating=number)
        by_hand = sum(of_mesh(gain, lines=lines) for gain in GAIN)
        assert point.gears_ms2**2 == pytest.approx(by_hand, rel=0.05)
    assert all(own.damaged_ms2 is None for own in told.points)


@cache
def through_a_slope():
    """A machine of two speeds, recorded at the first; gains to the hand grow steeply."""
    points = [{"speed_rpm": rpm, "torque_nm": 120.0, "share": 0.5} for rpm in (2960.0, 2500.0)]
    known = machine().to_dict() | {"operating": points}
    time, generator = np.arange(round(RATE * SECONDS)) / RATE, np.random.default_rng(5)
    healthy = gearmon.expected_signature(known)
    rows = np.zeros((2, len(time)))
    for f, a, p in zip(*(healthy[n] for n in ("frequency_hz", "acceleration_ms2", "phase_rad")),
                       strict=True):  # fmt: skip
        if f < 4500.0:
            rows += np.outer(slope(f), a * np.cos(2 * np.pi * f * time + p))
    rows += 1e-3 * generator.normal(size=rows.shape)
    lever = Recording(
        samples=rows, sampling_rate_hz=RATE, channel_names=("x", "y"), units=("m/s2", "m/s2"),
        origin="lever.csv",
    )  # fmt: skip
    return known, lever


def slope(frequency, low=0.0, high=np.inf):
    return np.multiply.outer(GAIN, (np.clip(frequency, low, high) / 1000.0) ** 1.5)


def test_other_speeds_and_their_damage_go_through_the_path_as_it_slopes():
    """Straight on logarithmic scales between the mesh lines that were heard, constant beyond."""
    (known, lever), fault = through_a_slope(), "wear:1:pinion:all:20%"
    told = gearmon.gear_share(lever, gearmon.vibration_exposure(lever, "hand"), known, [fault])
    ends = [
        float(own)
        for own in re.findall(r"path is known from (\S+) to (\S+) Hz", told.warnings[0])[0]
    ]
    squares = {}
    for number, rpm in enumerate((2960.0, 2500.0)):
        for wrong in ((), (fault,)):
            lines = gearmon.expected_signature(known, wrong, operating=number)
            f, size = lines["frequency_hz"], lines["acceleration_ms2"] ** 2 / 2
            squares[rpm, wrong] = float((slope(f, *ends) ** 2 * size * weight(f)).sum())
    for point in told.points:
        sound, worn = squares[point.speed_rpm, ()], squares[point.speed_rpm, (fault,)]
        assert point.gears_ms2**2 == pytest.approx(sound, rel=0.03)
        assert point.damaged_ms2**2 - point.value_ms2**2 == pytest.approx(worn - sound, rel=0.05)


def test_sidebands_count_to_the_third_on_both_sides():
    time, numbers = np.arange(round(RATE * SECONDS)) / RATE, (-3, -2, -1, 1, 2, 3)
    places = [(23 + n) * SHAFT_HZ for n in numbers]
    sizes = 0.3 * np.array(GAIN) * expected()["acceleration_ms2"][0]
    added = sum(np.cos(2 * np.pi * f * time + n) for n, f in zip(numbers, places, strict=True))
    lever = replace(recording(), samples=recording().samples + np.outer(sizes, added))
    felt = gearmon.vibration_exposure(lever, "hand")
    told = {own.name: own for own in gearmon.gear_share(lever, felt, machine()).lines}
    for axis, size, share in zip(felt.axes, sizes, told["sidebands of mesh 1"].share, strict=True):
        by_hand = sum(map(weight, places)) * size**2 / 2
        assert share * axis.rms_ms2**2 == pytest.approx(by_hand, rel=0.02)


def test_without_gear_data_shares_are_told_and_damage_is_refused():
    bare = {"operating": {"speed_rpm": 2960.0},
            "stage": {"kind": "parallel", "pinion_teeth": 23, "gear_teeth": 57}}  # fmt: skip
    told = gearmon.gear_share(recording(), exposure(), bare)
    assert told.share == pytest.approx(found().share)
    assert told.points == ()
    assert any("operating points are not foretold" in own for own in told.warnings)
    assert len(told.warnings) == 1
    with pytest.raises(GearmonError, match=r"torque_nm of .* is missing"):
        gearmon.gear_share(recording(), exposure(), bare, ["wear:1:pinion:all:20%"])


def test_what_the_recording_lets_say_of_itself_is_passed_on():
    """Its file's notes stand beside those of the operating points."""
    noted = replace(recording(), notes=("channel x: an hour of it was left out",))
    bare = {**machine().to_dict(), "operating": {"speed_rpm": 2960.0}}
    told = gearmon.gear_share(noted, exposure(), bare)
    assert told.share
    assert any("an hour of it" in own for own in told.warnings)
    assert any("not foretold" in own for own in told.warnings)


def test_where_a_sideband_falls_on_a_shaft_the_line_is_the_shafts():
    """Shaft 2 turns a fifth as fast: (17 - 2) / 5 and (17 + 3) / 5 are harmonics of shaft 1."""
    stages = [{"kind": "parallel", "pinion_teeth": first, "gear_teeth": second}
              for first, second in ((20, 100), (17, 60))]  # fmt: skip
    train = kinematics(load_machine({"operating": {"speed_rpm": 1500.0}, "stage": stages}))
    named = {round(order, 9): name for order, name in _orders(train, 30.0, 1e-3).items()}
    assert [named[order] for order in (1.0, 2.0, 3.0, 4.0)] == ["shaft 1"] * 4
    assert [named[order] for order in (2.8, 3.2, 3.4)] == ["sidebands of mesh 2"] * 2 + ["mesh 2"]
    assert named[20.0] == "mesh 1"


def test_a_recording_without_a_mesh_has_no_share():
    rows = np.random.default_rng(0).normal(size=(2, round(RATE * SECONDS)))
    noise = Recording(samples=rows, sampling_rate_hz=RATE, channel_names=("x", "y"),
                      units=("m/s2",) * 2, origin="noise.csv")  # fmt: skip
    told = gearmon.gear_share(noise, gearmon.vibration_exposure(noise, "hand"), machine())
    assert told.speed_hz is None
    assert told.headline().startswith("no mesh found")
    assert told.rows() == []


def test_numbers_in_words_are_those_of_the_result_in_its_units():
    generator = np.random.default_rng(4)
    rows = np.array([[1.0], [2.0], [3.0]]) * generator.normal(size=(3, 92_000))
    known = {"channel_names": ("x", "y", "z"), "units": ("m/s2",) * 3, "origin": "ride.csv"}
    ride = Recording(samples=rows, sampling_rate_hz=400.0, **known)
    seat = gearmon.vibration_exposure(ride, "seat")
    jobs = [Job(name=own, recording="ride.csv", hours=hours) for own, hours in (("a", 3), ("b", 4))]
    day = sum_up(DayPlan(jobs=tuple(jobs)), [[seat], [replace(seat, duration_s=900.0)]])
    assert [dose.measure for dose in day.doses] == ["A(8)", "VDV"]
    shares = found("wear:1:pinion:all:20%")
    for own, least in ((seat, 3), (exposure(), 3), (day, 5), (shares, 2)):
        text = "\n".join([own.headline(), *exposure_lines(own), own._repr_html_()])
        # what is said of limits of the standards is no number of the recording
        text = "\n".join(line for line in text.splitlines() if not line.startswith("note: "))
        assert len(with_units(text)) >= least
        assert untold(text, own.to_dict()) == []
    assert f"{shares.axes[1]} {100 * shares.share[1]:.2g} %" in shares.headline()
    assert with_units(exposure_lines(seat_factor(seat, seat))[0]) == []
