"""The demos of a harvester's day, a driver's day and a fleet, with short recordings or none."""

from __future__ import annotations

from datetime import timedelta
from pathlib import Path
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


def test_every_job_and_axis_is_driven_on_ground_of_its_own(ridden):
    """A common engine of 0.1 m/s2 is little beside it."""
    folder = ridden[0].files["folder"]
    jobs = [gearmon.read_recording(folder / f"{job}.csv").samples for job in farm._JOBS]
    alike = np.corrcoef(np.concatenate(jobs))
    assert np.abs(alike[np.triu_indices(len(alike), 1)]).max() < 0.2


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


def test_recordings_of_a_harvester_are_of_the_machine_at_that_point(tmp_path, monkeypatch):
    monkeypatch.setattr(farm, "recorded", lambda path, _, **settings: (path, settings))
    machine = load_machine(farm.given_file("tractor.toml", tmp_path, "machine.toml"))
    for number, point in enumerate(machine.operating):
        for fault in ("", farm.FAULT):
            path, told = farm._recorded(machine, tmp_path, number, fault)
            state = "damaged" if fault else "sound"
            assert path == tmp_path / f"{point.name.split(',')[0]}-{state}.csv"
            assert (told["point"], told["faults"]) == (point, [fault] if fault else [])
            assert (told["channels"], told["duration_s"]) == (3, 12.0)


@pytest.mark.parametrize("fault", ["", "crack:1:pinion:5:35%"])
def test_sound_and_damaged_are_heard_at_one_load_with_one_wander(monkeypatch, fault):
    asked = []

    def simulate(_machine, faults, _duration_s, _rate_hz, **settings):
        asked.append((faults, settings))
        return SimpleNamespace(samples=np.full((3, 4), float(len(faults))))

    monkeypatch.setattr(farm.gearmon, "simulate", simulate)
    sound, damaged = farm._heard(None, 7, fault, 0.8)
    assert [faults for faults, _ in asked] == [[], [fault]][: 2 if fault else 1]
    assert (sound.max(), damaged.max()) == (0.0, 1.0 if fault else 0.0)
    for _, settings in asked:
        assert settings["load"] == 0.8
        assert (settings["machine_seed"], settings["recording_seed"]) == (7, 7)
        assert settings["snr_db"] is None


@pytest.mark.parametrize("name", ["baler-1", "baler-2", "mixer-1", "mixer-4"])
def test_a_machine_of_the_fleet_turns_bad_on_its_day(tmp_path, monkeypatch, name):
    """A fault grows in a straight line from a tenth on its first day to all of it on the last."""
    asked, loads = [], {}

    def heard(machine, _seed, fault, load):
        loads[load] = machine.name, fault
        return load, fault

    def stretch(own, share, _generator):
        asked.append((own, share))
        return np.tile(own[0] * np.cos(np.arange(64)), (3, 1))

    monkeypatch.setattr(farm, "_heard", heard)
    monkeypatch.setattr(farm, "_stretch", stretch)
    monkeypatch.setattr(farm, "_elsewhere", lambda samples: -samples)
    monkeypatch.setattr(farm.gearmon, "learn", lambda healthy, _: [own.origin for own in healthy])
    learned = []
    monkeypatch.setattr(farm.gearmon, "write_reference", lambda own, _: learned.extend(own))
    (tmp_path / "inbox").mkdir()
    farm._made(tmp_path, name)
    what, first = farm.WRONG.get(name, ("", 60))
    fault = what if ":" in what else ""
    assert loads == {load: (name.split("-")[0], fault) for load in (0.8, 1.0)}
    assert learned == [f"{name}, sound {number}" for number in range(1, 5)]
    shares = [share for _, share in asked]
    assert shares[: 4 + first] == [0.0] * (4 + first)
    assert shares[4 + first :] == pytest.approx(np.linspace(0.1, 1.0, 60 - first))
    files = sorted((tmp_path / "inbox").iterdir())
    assert len(files) == 60
    pinion, gear, speed = farm.KINDS[name.split("-")[0]]
    machine = load_machine(tmp_path / f"{name}.toml")
    assert (machine.stages[0].pinion_teeth, machine.stages[0].gear_teeth) == (pinion, gear)
    assert machine.operating[0].speed_rpm == speed
    for count, (file, (own, _)) in enumerate(zip(files, asked[4:], strict=True)):
        day = farm.START + timedelta(days=count)
        label = ("grass", "maize")[count % 2]
        assert file.name.startswith(f"{name}_{day:%Y-%m-%dT%H}")
        assert file.name.endswith(f"_{label}.npy")
        assert own == (farm.LOADS[label], fault)
        first_channel, *others = np.load(file)[:, 0].tolist()
        assert others == pytest.approx([own[0]] * 2)
        bad = count >= first
        gain = {"dead sensor": 0.0, "moved sensor": -1.0}.get(what, 1.0) if bad else 1.0
        assert first_channel == pytest.approx(gain * own[0])


def test_the_fleet_is_read_as_it_was_written(tmp_path, monkeypatch):
    class Pool:
        def __init__(self, *_):
            pass

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def map(self, _function, names):
            made.extend(names)
            for name in names:
                (tmp_path / f"{name}.ref").touch()
                known = {"kind": "mixer", "pinion": 17, "gear": 52, "speed": 1450.0}
                farm.given_file("fleet_machine.toml", tmp_path, f"{name}.toml", **known)
            return ()

    made, shown = [], {}
    monkeypatch.setattr(farm, "ProcessPoolExecutor", Pool)
    monkeypatch.setattr(farm, "_rows", lambda _: [{"machine": "baler-1"}])
    monkeypatch.setattr(farm, "read_latest", lambda store: [str(store)])
    answer = SimpleNamespace(to_dict=lambda fleet: {"fleet": fleet.name})
    monkeypatch.setattr(
        farm, "run_fleet", lambda fleet, **_: (shown.update(fleet=fleet), answer)[1]
    )
    demo = farm.fleet_demo(tmp_path)
    assert made == [f"{kind}-{n}" for kind in ("baler", "mower", "mixer") for n in range(1, 5)]
    fleet = shown["fleet"]
    assert [own.name for own in fleet.machines] == made
    for own in fleet.machines:
        assert Path(own.file) == tmp_path / f"{own.name}.toml"
        assert Path(own.reference) == tmp_path / f"{own.name}.ref"
        assert Path(own.recordings) == tmp_path / "inbox"
        assert (own.sampling_rate_hz, own.limit) == (farm.RATE_HZ, 0.3)
    assert demo.files == {
        "folder": tmp_path,
        "fleet file": tmp_path / "fleet.toml",
        "store": fleet.store,
    }
    assert demo.facts["truth"] == {name: what for name, (what, _) in farm.WRONG.items()}
    assert demo.facts["latest"] == [str(fleet.store)]
    assert demo.facts["run"] == {"fleet": fleet.name}
    assert "12 machines, 60 recordings of each, one a day." in demo.story
    assert f"gearmon fleet serve {tmp_path / 'fleet.toml'}" in demo.story[-1]


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
