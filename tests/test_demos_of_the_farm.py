"""The demos of a harvester's day, a driver's day and a fleet, with short recordings or none."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import gearmon
from gearmon.demos import farm
from gearmon.machine import load_machine


@pytest.fixture(scope="module")
def ridden(tmp_path_factory):
    """The exposure demo with short recordings; figures by the names that they would be saved as."""
    folder, saved = tmp_path_factory.mktemp("exposure"), {}

    def save(figures, path):
        saved.update({f"{path.stem}{name}": figure for name, figure in figures.items()})
        return [path.with_name(f"{path.stem}{name}.png") for name in figures]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(farm, "RIDE_S", 40.0)
        patch.setattr(farm, "LEVER_S", 3.0)
        patch.setattr(farm, "save_all", save)
        patch.setattr(farm, "write_exposure_report", lambda told, path: (told, path)[1])
        yield farm.exposure_demo(folder), saved


def test_a_driver_is_told_of_the_day_the_hand_and_the_gearbox_in_turn(ridden):
    demo, saved = ridden
    folder = demo.files["folder"]
    day = gearmon.exposure_day(folder / "day.toml")
    assert demo.facts["day"]["doses"] == day.to_dict()["doses"]
    assert [job["hours"] for job in demo.facts["day"]["jobs"]] == [4.0, 1.5, 1.0]
    axes = {"x": "a1", "y": "a2", "z": "a3"}
    hand = gearmon.vibration_exposure(folder / "lever.csv", "hand", axes)
    machine = load_machine(folder / "machine.toml")
    gears = gearmon.gear_share(folder / "lever.csv", hand, machine, [farm.WEAR])
    assert demo.facts["gearbox"]["share"] == gears.to_dict()["share"]
    assert demo.facts["gearbox"]["faults"] == [farm.WEAR]
    assert list(saved) == ["exposure-day", "exposure-hand", "exposure-gearbox"]
    for name, own in zip(saved, (day, hand, gears), strict=True):
        drawn, same = (
            [(ax.get_xlabel(), ax.get_ylabel()) for ax in figure.axes]
            for figure in (saved[name], own.figures()[""])
        )
        assert drawn == same
    first, *_ = demo.story
    assert first.startswith("day of 6.5 h (seat): A(8) ")


@pytest.mark.parametrize(("job", "level"), [("ploughing", 0.7), ("loader", 0.45)])
def test_the_ground_shakes_as_hard_as_the_job_says_and_the_engine_at_35_hz(ridden, job, level):
    """Along the spine; the engine has an amplitude of 0.1 m/s2, and is louder than the ground."""
    found = gearmon.read_recording(ridden[0].files["folder"] / f"{job}.csv")
    samples = found.samples[found.row_of("seat_z")]
    assert found.sampling_rate_hz == pytest.approx(400.0)
    lines = 2 * np.abs(np.fft.rfft(samples)) / len(samples)
    assert lines[round(35.0 * len(samples) / 400.0)] == pytest.approx(0.1, rel=0.15)
    bumps = 4 if job == "loader" else 0
    quiet = np.sqrt(level**2 + 0.1**2 / 2)
    assert samples.std() == pytest.approx(quiet, rel=0.02 if not bumps else 0.2)


def test_a_day_of_a_harvester_is_recorded_sound_and_damaged_at_every_operating_point(
    tmp_path, monkeypatch
):
    asked, given = {}, {}

    def noted(path, _machine, **settings):
        asked[path.name] = settings
        return path.name

    def survey(machine, _harvester, sound, _budget, *, shares, degraded):
        given.update(sound=sound, degraded=degraded, shares=shares, machine=machine)
        return SimpleNamespace(figures=dict, to_dict=lambda: {"best": "bearing"})

    monkeypatch.setattr(farm, "recorded", noted)
    monkeypatch.setattr(farm, "survey_measured", survey)
    monkeypatch.setattr(farm, "harvest_lines", lambda _: ["told"])
    demo = farm.harvest_demo(tmp_path)
    points = given["machine"].operating
    assert len(points) > 1
    assert given["shares"] == [point.share for point in points]
    names = [point.name.partition(",")[0] for point in points]
    assert given["sound"] == [f"{name}-sound.csv" for name in names]
    assert given["degraded"] == [f"{name}-damaged.csv" for name in names]
    for state, faults in (("sound", []), ("damaged", [farm.FAULT])):
        for point, name in zip(points, given[state.replace("damaged", "degraded")], strict=True):
            assert asked[name]["point"] == point
            assert asked[name]["faults"] == faults
    # no two recordings have the same noise, all the same machine
    assert len({own["recording_seed"] for own in asked.values()}) == 2 * len(points)
    assert len({own["machine_seed"] for own in asked.values()}) == 1
    assert demo.facts == {"pictures": [], "best": "bearing"}


@pytest.mark.parametrize(("frequency_hz", "gain"), [(90.0, 0.505), (900.0, 5.0), (1800.0, 0.1663)])
def test_from_elsewhere_it_is_half_as_loud_but_for_a_resonance_at_900_hz(frequency_hz, gain):
    """Gain 0.5 / |1 - r^2 + 0.1 i r| at r = f / 900 Hz."""
    time_s = np.arange(5120) / farm.RATE_HZ
    heard = farm._elsewhere(np.cos(2 * np.pi * frequency_hz * time_s))
    assert np.sqrt(2) * heard.std() == pytest.approx(gain, rel=2e-3)


def test_the_truth_stands_beside_what_the_fleet_found(monkeypatch):
    latest = [
        {"machine": "baler-2", "verdict": "fault"},
        {"machine": "baler-1", "verdict": "healthy"},
    ]
    told = {
        "baler-2": [
            {"finding": "tooth damage", "since": "2026-06-24T06:00", "over": False},
            {"finding": "tooth damage", "since": "2026-06-22T06:00", "over": False},
            {"finding": "a change", "since": "2026-06-02T06:00", "over": True},
        ],
        "baler-1": [],
    }
    monkeypatch.setattr(farm, "read_latest", lambda _: latest)
    monkeypatch.setattr(farm, "alarms", lambda _, name: told[name])
    worn, sound = farm._rows(SimpleNamespace(store=None))
    assert worn == {
        "machine": "baler-2",
        "truth": "crack:1:pinion:5:35%",
        "true since": "2026-06-21",
        "verdict": "fault",
        "alarms": "tooth damage",
        "alarm since": "2026-06-22",
    }
    assert set(sound.values()) == {"baler-1", "healthy", ""}


def test_a_stretch_mixes_sound_and_damaged_by_share_under_noise_20_db_below():
    generator = np.random.default_rng(3)
    sound = np.vstack([np.sin(np.arange(40_000) / 7), np.arange(40_000.0)])
    damaged = np.vstack([3.0 * sound[0], sound[1]])
    taken = farm._stretch((sound, damaged), 0.25, generator)
    assert taken.shape == (2, round(farm.DURATION_S * farm.RATE_HZ))
    # the last row is the tacho: it tells where the stretch begins, and has no noise
    start = int(taken[1, 0])
    assert np.array_equal(taken[1], np.arange(start, start + taken.shape[1]))
    mixed = 1.5 * sound[0, start : start + taken.shape[1]]
    assert (taken[0] - mixed).std() == pytest.approx(0.1 * sound[0].std(), rel=0.03)
