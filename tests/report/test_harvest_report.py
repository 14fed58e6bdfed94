"""Pictures and words of a harvester survey."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.container import ErrorbarContainer
from PIL import Image
from reference.drawn_extent import badly_filled
from reference.told_numbers import disordered

from gearmon.harvesting import tuning
from gearmon.harvesting.harvester import InertialHarvester
from gearmon.harvesting.placement import survey_measured
from gearmon.harvesting.tuning import built_in
from gearmon.harvesting.vibration import vibration_of_lines
from gearmon.machine import Machine, OperatingPoint, ParallelStage
from gearmon.report.plots import save_all, sheet
from gearmon.report.survey_plots import _draw_energy, harvest_figures
from gearmon.report.survey_text import harvest_lines, spoken_time
from gearmon.signals.recording import Recording

RATE = 4000.0


def recorded(amplitudes):
    rng = np.random.default_rng(1)
    t = np.arange(int(12 * RATE)) / RATE
    rows = [a * np.cos(2 * np.pi * 300.0 * t) for a in amplitudes]
    rows = np.array(rows) + rng.normal(scale=0.05, size=(len(amplitudes), len(t)))
    return Recording(
        samples=rows,
        sampling_rate_hz=RATE,
        units=("m/s2",) * len(amplitudes),
        origin="day.csv",
    )


@pytest.fixture(scope="module", params=["inertial", "cantilever"])
def survey(request):
    machine = Machine(
        name="mower",
        operating=(OperatingPoint(speed_rpm=900.0),),
        stages=(ParallelStage(pinion_teeth=20, gear_teeth=41),),
    )
    inertial = InertialHarvester(mass_kg=5e-3, natural_frequency_hz=100.0, highest_hz=1500.0)
    harvester = inertial if request.param == "inertial" else built_in()[0]
    given = [recorded([0.5, 1.0, 0.0])], [recorded([1.0, 1.0, 0.3])]
    with pytest.MonkeyPatch.context() as patch:
        # near the best is enough to be drawn
        patch.setattr(tuning, "MOST_STEPS", 10)
        return survey_measured(machine, harvester, given[0], degraded=given[1])


def test_four_pictures_are_written(survey, tmp_path):
    written = save_all(harvest_figures(survey), tmp_path / "day.png")
    assert [p.name for p in written] == [
        "day-energy.png",
        "day-tuning.png",
        "day-positions.png",
        "day-response.png",
    ]
    for path in written:
        with Image.open(path) as picture:
            assert picture.size == (1040, 598)


def test_figures_are_those_of_the_survey_in_the_units_of_their_axes(survey):
    for figure in survey.figures().values():
        assert badly_filled(figure) == []
    figures = harvest_figures(survey)
    positions = figures["-positions"].axes[0]
    assert positions.get_xlabel() == "mean power over the duty cycle in µW"
    widths = [bar.get_width() for bar in positions.patches]
    assert widths == pytest.approx([1e6 * place.power_w for place in survey.placed])
    (bars,) = [own for own in positions.containers if isinstance(own, ErrorbarContainer)]
    ends = [(1e6 * p.power_low_w, 1e6 * p.power_high_w) for p in survey.placed]
    drawn = bars.lines[2][0].get_segments()
    known = [pair for pair in zip(drawn, ends, strict=True) if np.isfinite(pair[1]).all()]
    assert known
    for segment, end in known:
        assert segment[:, 0] == pytest.approx(end)
    remarks = [text.get_text() for text in positions.texts]
    for place, told in zip(survey.placed, remarks, strict=True):
        if place.tuned is None:
            often = "nothing to tune to"
        elif np.isfinite(place.interval_s):
            often = f"a recording every {spoken_time(place.interval_s)}"
        else:
            often = "too little to send a recording"
        assert told == often + "; better only when damaged" * place.good_only_when_damaged
    tuning = figures["-tuning"].axes[0]
    assert tuning.get_ylabel() == "mean power over the duty cycle in µW"
    best = next(line for line in tuning.lines if line.get_marker() == "o")
    assert best.get_ydata()[0] == pytest.approx(1e6 * survey.best.tuned.power_w)
    energy, beside = figures["-energy"].axes
    assert energy.get_ylabel() == "energy of a line in J/kg, (2πfA)²/2"
    (left, right), (bottom, top) = energy.get_xlim(), energy.get_ylim()
    lowest, highest = survey.tuned.harvester.frequency_range_hz
    assert left < min(lowest, 300.0) / 1.2
    assert right > 1.2 * max(highest, 300.0)
    assert bottom < max(row["energy_j_per_kg"] for row in survey.lines()) < top
    assert beside.get_ylabel() == "harvester: µW per (m/s²)² (dashed)"
    frequency, gain = beside.lines[0].get_data()
    (name,) = (text.get_text() for text in energy.get_legend().get_texts())
    assert name.endswith(" (100 % of the time)")
    harvester = survey.best.tuned.harvester
    assert gain == pytest.approx(1e6 * harvester.gains(frequency).power_w)
    factors = {
        "mean power in µW": ("power_w", 1e6),
        "voltage amplitude in V": ("voltage_v", 1.0),
        "tip amplitude in µm": ("travel_m", 1e6),
        "peak stress in MPa": ("stress_pa", 1e-6),
    }
    rows = survey.response()
    drawn = [ax for ax in figures["-response"].axes if ax.lines]
    assert len(drawn) >= 2
    for ax in drawn:
        name, factor = factors[ax.get_ylabel()]
        assert ax.lines[0].get_ydata() == pytest.approx([factor * row[name] for row in rows])


def test_the_highest_lines_of_a_crowd_are_drawn_and_a_spectrum_by_its_peaks():
    rng = np.random.default_rng(4)
    frequency, levels = np.sort(rng.uniform(10, 2000, 3000)), rng.lognormal(size=3000)
    lines = vibration_of_lines(frequency, acceleration_ms2=levels)
    bins = replace(lines, resolution_hz=0.5)
    ax, other = sheet(4.0, 3.0).subplots(2)
    _draw_energy(ax, lines, "black", "a")
    tops = {tuple(own[1]) for own in ax.collections[0].get_segments()}
    assert 0 < len(tops) < 1000
    ranked = np.argsort(-lines.energy_j_per_kg)[: len(tops)]
    assert tops == set(zip(frequency[ranked], lines.energy_j_per_kg[ranked], strict=True))
    _draw_energy(other, bins, "black", "b")
    place, height = other.lines[0].get_data()
    owner = np.searchsorted(place, frequency, side="right") - 1
    highest = [lines.energy_j_per_kg[owner == number].max() for number in range(len(place))]
    np.testing.assert_array_equal(height, highest)


def test_words_name_places_harvester_and_what_is_missing(survey):
    text = "\n".join(harvest_lines(survey))
    assert "mower: 3 position(s), measured vibration" in text
    assert "best at channel 2" in text
    assert "of the power comes from lines" in text
    assert "recording" in text
    assert any(np.isfinite(place.power_low_w) for place in survey.placed)
    assert disordered(text) == []


def column(lines, heading):
    """Numbers under a heading, counted from the right: names on the left may have spaces."""
    start = next(n for n, line in enumerate(lines) if heading in line.split())
    place = lines[start].split().index(heading) - len(lines[start].split())
    rows = itertools.takewhile(str.strip, lines[start + 1 :])
    return [float(row.split()[place]) for row in rows]


def test_numbers_in_words_are_in_the_units_of_their_headings(survey):
    lines, bands = harvest_lines(survey), survey.bandwidths()
    for heading, name, factor in (
        ("bandwidth_hz", "width_hz", 1.0),
        ("peak_uw", "peak_power_w", 1e6),
        ("wandering_uw", "power_w", 1e6),
    ):
        expected = [factor * row[name] for row in bands]
        assert column(lines, heading) == pytest.approx(expected, rel=5e-3)
    ranked = sorted(survey.lines(), key=lambda row: -row["energy_j_per_kg"])
    energy = column(lines, "energy_uj_per_kg")
    expected = [1e6 * row["energy_j_per_kg"] for row in ranked[: len(energy)]]
    assert energy == pytest.approx(expected, rel=5e-3)


def test_a_place_is_told_by_its_own_numbers_in_the_order_of_their_headings(survey):
    lines = harvest_lines(survey)
    head = next(line for line in lines if line.startswith("position"))
    names = "tuned_to_hz power_uw interval_90_uw damaged_uw best_damaged_hz best_damaged_uw"
    assert head.split()[1:7] == names.split()
    known = [place for place in survey.placed if np.isfinite(place.power_low_w)]
    assert len(known) >= 2
    for place in known:
        own, name = place.to_dict(), place.position.name
        micro = [1e6 * own[key] for key in ("power_w", "power_low_w", "power_high_w")]
        expected = [own["natural_frequency_hz"], *micro, 1e6 * own["degraded_power_w"]]
        expected += [own["degraded_best_hz"], 1e6 * own["degraded_best_power_w"]]
        told = next(line for line in lines if line.startswith(name)).removeprefix(name)
        found = [float(number) for number in told.replace(" to ", " ").split()[:7]]
        assert found == pytest.approx(expected, rel=5e-3)


def test_what_was_not_checked_in_its_source_is_marked_and_nothing_else(survey):
    lines = harvest_lines(survey, published=True)
    marks = {row["checked"]: set() for row in survey.published()}
    for row in survey.published():
        told = next(line for line in lines if line.startswith(row["name"]))
        marks[row["checked"]].add("(unverified)" in told)
    assert marks == {"abstract": {False}, "no": {True}}


def test_lines_are_told_by_what_they_bring_over_the_time(survey, monkeypatch):
    """Energy times share of time, the largest first; no more than a page holds."""
    known = {"operating_point": "mowing", "acceleration_ms2": 1.0, "share": 0.1}
    rows = [
        known | {"frequency_hz": 100.0 + n, "energy_j_per_kg": 2.0**n, "share_of_time": 3.0**-n}
        for n in range(30)
    ]
    monkeypatch.setattr(type(survey), "lines", lambda _: rows[::-1])
    told = column(harvest_lines(survey), "frequency_hz")
    assert 5 <= len(told) < 30
    assert told == [100.0 + n for n in range(len(told))]
    assert set(column(harvest_lines(survey), "share_percent")) == {10.0}


def test_numbers_in_sentences_are_those_of_the_survey_in_their_units(survey):
    text, best, tuned = "\n".join(harvest_lines(survey)), survey.best, survey.tuned
    supply, degraded, budget = best.supply, best.tuned_degraded, survey.budget
    travel_m = max(own.travel_m for own in tuned.answers)
    passed = [supply[f"{name}_w"] for name in ("harvested", "rectified", "regulated", "constant")]
    known = {
        "travel # mm and # mm of its own": [1e3 * travel_m, 1e3 * tuned.static_travel_m],
        "(# % of the clearance), stress": [100 * tuned.travel_share],
        "with that of its weight # % of what is safe": [100 * tuned.stress_share],
        "# uW on the recordings that it": [1e6 * tuned.power_w],
        "tuned to, # to expect": [1e6 * best.power_unseen_w],
        "best once damaged: # Hz, # uW then": [
            degraded.harvester.natural_frequency_hz,
            1e6 * degraded.power_w,
        ],
        "and # uW while sound": [1e6 * best.degraded_best_power_when_healthy_w],
        "tuning above gives # uW": [1e6 * best.degraded_power_w],
        "of # uW, # pass the rectifier and # the converter; # are taken": [
            1e6 * own for own in passed
        ],
        "(# s at # Hz and # bit": [budget.duration_s, budget.sampling_rate_hz, budget.bits],
        "bit, # mJ to make": [1e3 * budget.energy_j],
    }
    for sentence, expected in known.items():
        found = re.search(re.escape(sentence).replace(r"\#", r"([\d.eE+-]+)"), text)
        assert found, sentence
        assert [float(own) for own in found.groups()] == pytest.approx(expected, rel=6e-3)


def test_times_are_in_the_unit_that_suits_them():
    spoken = [spoken_time(s) for s in (12.0, 600.0, 4.7 * 86400, 3e8, np.inf)]
    assert spoken == ["12 s", "10 min", "4.7 days", "9.5 years", "never"]
