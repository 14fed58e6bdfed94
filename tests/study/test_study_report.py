"""The study's pictures, page and tables: complete, labelled, and from the results."""

from __future__ import annotations

import csv
import json
import re
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from reference.computed_study import SHARES

from gearmon.errors import ArgumentError
from gearmon.report.plots import as_png
from gearmon.study import report as telling
from gearmon.study import write_study
from gearmon.study.claims import Evidence
from gearmon.study.experiments import LOSSES, SWEEPS
from gearmon.study.pair import POINTS_PER_PERIOD, REFERENCE, SIGNALS, series
from gearmon.study.report import (
    FIGURES,
    PICTURES,
    claim_rows,
    decibels,
    draw_picture,
    shades,
    shown_difference,
    shown_number,
    sweep_rows,
    write_results,
)

NAMED = {picture["name"]: picture for picture in PICTURES}


@pytest.fixture(scope="module")
def report(results, tmp_path_factory):
    shares = []
    with pytest.MonkeyPatch.context() as patch:
        # the real pictures are drawn one by one below
        patch.setattr(telling, "draw_picture", lambda _picture, _results: Figure())
        report = write_results(results, tmp_path_factory.mktemp("study"), shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    return report


def test_the_terminal_is_told_claim_by_claim_and_in_sum(report):
    lines = report.lines()
    for entry in report.judged:
        head = f"{entry.claim.key:<4}{entry.verdict.upper()}"
        assert any(line.startswith(head) for line in lines)
        assert " ".join(entry.reason.split()) in " ".join(" ".join(lines).split())
    counts = Counter(entry.verdict for entry in report.judged)
    for verdict, count in counts.items():
        assert re.search(rf"^{len(report.judged)} claims: .*\b{count} {verdict}", lines[-3])
    assert lines[-2].startswith(f"{len(PICTURES)} pictures for figures 1 to 36, and tables: ")
    assert lines[-1] == f"report: {report.page}"
    assert max(map(len, lines[:-2])) <= 100


def test_every_figure_has_its_picture():
    assert list(FIGURES) == list(range(1, 37))
    numbers = [number for picture in PICTURES for number in picture["figures"]]
    assert len(numbers) == len(set(numbers))


def test_every_picture_is_drawn_by_its_function():
    assert len(NAMED) == len(PICTURES)
    named = {picture.get("drawing", [name])[0] for name, picture in NAMED.items()}
    assert named == {name[6:] for name in vars(telling) if name.startswith("_draw_")}


def test_the_picture_of_contact_has_its_damping_in_the_units_of_its_axes(results):
    study = results.contact
    _, of_damping, _, both, *_ = draw_picture(NAMED["contact"], results).axes
    assert "kN s/m" in of_damping.get_xlabel()
    np.testing.assert_allclose(of_damping.lines[0].get_xdata(), study.damping.values / 1e3)
    assert "kN s/m" in both.get_ylabel()
    low, high = both.dataLim.intervaly
    assert (low, high) == pytest.approx(
        (study.map_dampings.min() / 1e3, study.map_dampings.max() / 1e3)
    )
    (star,) = (own for own in both.lines if own.get_marker() == "*")
    assert star.get_xydata()[0] == pytest.approx(
        [REFERENCE.mass_kg, REFERENCE.damping_ns_per_m / 1e3]
    )


@pytest.mark.parametrize("picture", PICTURES, ids=lambda picture: picture["name"])
def test_panels_name_their_figure_and_axes_their_units(results, picture):
    figure = draw_picture(picture, results)
    titles = [ax.get_title(loc="left") for ax in figure.axes]
    named = {int(n) for title in titles for n in re.findall(r"Fig\. (\d+)", title)}
    # of pictures of several rows the first panel of a column names the figure
    assert named == set(picture["figures"])
    labels = [figure.get_supxlabel(), figure.get_supylabel()]
    labels += [text for ax in figure.axes for text in (ax.get_xlabel(), ax.get_ylabel())]
    labels += [part.get_supylabel() for part in figure.subfigs]
    assert any(re.search(r" in |dB re", label) for label in labels)


def test_energy_panel_holds_the_lines(results):
    figure = draw_picture(NAMED["energy_of_reference"], results)
    heights = figure.axes[0].lines[0].get_ydata()
    odd = 1e6 * results.reference.response.energy_lines[1:16:2]
    assert all(np.isclose(heights, value).any() for value in odd)


def test_curves_are_in_the_units_of_their_axes(results):
    axes = np.array(draw_picture(NAMED["form_responses"], results).axes).reshape(3, 3)
    for ax, key in zip(axes.T, ("wave", "rectangular", "fourier"), strict=True):
        motion = results.forms[key].simulated
        told = (
            ("displacement in µm", 1e6 * motion.displacement_m),
            ("velocity in mm/s", 1e3 * motion.velocity_ms),
            ("acceleration in m/s²", motion.acceleration_ms2),
        )
        for own, (label, values) in zip(ax, told, strict=True):
            np.testing.assert_allclose(own.lines[0].get_ydata(), values[:-1])
            np.testing.assert_allclose(own.lines[0].get_xdata(), 1e3 * motion.time_s[:-1])
            assert axes[list(ax).index(own), 0].get_ylabel() == label


def test_spectra_of_the_forms_are_those_of_their_course(results):
    """Amplitudes over the mean, by sums over a mesh period, at multiples of 625 Hz."""
    figure = draw_picture(NAMED["stiffness_form_spectra"], results)
    turn = np.arange(1 << 14) / (1 << 14)
    for key in ("parabolic", "wave"):
        signal = SIGNALS[key]
        lines = 2 * np.abs(np.fft.rfft(signal.modulation(turn))) / len(turn)
        (ax,) = (ax for ax in figure.axes if ax.get_title(loc="left") == f"Fig. 3: {signal.label}")
        x, y = ax.lines[-1].get_data()
        number = np.rint(np.asarray(x) / 0.625).astype(int)
        np.testing.assert_allclose(x, 0.625 * number, rtol=1e-9)
        assert {1, 2, 3} <= set(number.tolist())
        for own, level in zip(number.tolist(), np.asarray(y), strict=True):
            assert own > 4 or level == pytest.approx(20 * np.log10(lines[own]), abs=0.05)


@pytest.mark.parametrize(
    ("name", "axis", "power", "shown"),
    [
        # velocity in mm/s and acceleration in m/s2 follow from the displacement by the frequency
        ("stiffness_spectra", 1, 1, lambda line: 1e3 * line),
        ("stiffness_spectra", 2, 1, lambda line: 20 * np.log10(1e3 * line)),
        ("mass_spectra", 0, 2, lambda line: line),
        ("damping_spectra", 1, 2, lambda line: 20 * np.log10(line)),
        # the energy per mass of a line of velocity v is v^2 / 2, over 1 uJ/kg
        ("energy_of_stiffness", 0, 1, lambda line: 1e6 * line**2 / 2),
        ("energy_of_stiffness", 1, 1, lambda line: 10 * np.log10(1e6 * line**2 / 2)),
    ],
)
def test_spectra_of_a_sweep_follow_from_its_displacement(results, name, axis, power, shown):
    sweep = results.sweeps[NAMED[name]["drawing"][1]]
    ax = draw_picture(NAMED[name], results).axes[axis]
    for point, first in zip(sweep.points, (0, 2), strict=False):
        for line, number in ((ax.lines[first], 1), (ax.lines[first + 1], 2)):
            x, y = line.get_data()
            count = min(len(x), 6)
            harmonic = number + 2 * np.arange(count)
            np.testing.assert_allclose(x[:count], 0.625 * harmonic, rtol=1e-9)
            size = 2 * np.abs(point.response.displacement[harmonic])
            angular = 2 * np.pi * 625.0 * harmonic
            np.testing.assert_allclose(y[:count], shown(size * angular**power), rtol=1e-6)


def test_files(report):
    names = {path.name for path in report.files}
    assert {"study.html", "claims.csv", "sweeps.csv", "figures.csv"} < names
    assert sum(name.endswith(".png") for name in names) == len(PICTURES)
    for path in report.files:
        assert path.stat().st_size > 0


def test_page_is_whole_and_needs_nothing_else(report):
    page = report.page.read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == len(PICTURES)
    assert not re.search(r"(src|href)=\"(https?:|[^#d\"])", page)
    for number in range(1, 37):
        assert f"Figure {number}:" in page
    for entry in report.judged:
        assert f'id="claim-{entry.claim.key}"' in page


def test_claims_table(report):
    with (report.page.parent / "claims.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["claim"] for row in rows} == {entry.claim.key for entry in report.judged}
    peaks = [row for row in rows if row["claim"] == "8b"]
    assert [float(row["expected"]) for row in peaks][:3] == [646, 388, 276]


def test_sweeps_table(report):
    with (report.page.parent / "sweeps.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 8 + 9 + 9
    assert all(float(row["error_bound"]) <= 1e-9 for row in rows)


def test_lines_tell_every_claim(report):
    text = "\n".join(report.lines())
    for entry in report.judged:
        assert re.search(rf"^{entry.claim.key}\s+{entry.verdict.upper()}", text, re.M)
    assert max(len(line) for line in report.lines()[:-2]) <= 100
    json.dumps(report.to_dict(), allow_nan=False)


def test_unusable_folder(tmp_path):
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(ArgumentError, match="cannot make this folder"):
        write_study(file / "inside")


def test_pictures_of_the_same_results_are_the_same(results):
    one, two = (as_png(draw_picture(NAMED["mesh_force"], results)) for _ in range(2))
    assert one == two


def test_decibels():
    np.testing.assert_allclose(decibels([1.0, 10.0, 0.0]), [0.0, 20.0, -400.0])


def test_shades_are_ordered_in_lightness():
    weights = np.array([0.2126, 0.7152, 0.0722])
    lightness = [float(weights @ np.array(colour[:3])) for colour in shades(9)]
    assert lightness == sorted(lightness)


@pytest.mark.parametrize(
    ("item", "text"),
    [
        (Evidence(quantity="", ours=1.0), ""),
        (Evidence(quantity="", ours=1.0, expected=1.0), "< 0.01 %"),
        (Evidence(quantity="", ours=1.1, expected=1.0), "+10.00 %"),
        (Evidence(quantity="", ours=2e-9, expected=0.0), "2.00e-09"),
    ],
)
def test_shown_difference(item, text):
    assert shown_difference(item) == text


def test_shown_number():
    assert [shown_number(v) for v in (0.0, 1234.56, 2e6)] == ["0", "1235", "2.00e+06"]
    # four digits from a thousandth on, below it a power of ten
    assert [shown_number(v) for v in (0.25, 0.0123456, 0.00123456)] == [
        "0.25",
        "0.01235",
        "0.001235",
    ]
    assert [shown_number(v) for v in (12345.6, 0.000123)] == ["1.235e+04", "1.23e-04"]
    for value in (1e-4, 0.25, 1234.56, 2e6):
        assert shown_number(-value) == f"-{shown_number(value)}"


def test_the_mesh_force_is_drawn_in_kilonewtons_and_by_its_lines(results):
    wide, near, lines = draw_picture(NAMED["mesh_force"], results).axes
    for ax in (wide, near):
        assert any(set(line.get_ydata()) == {4.0} for line in ax.lines)
    motion = results.forms["rectangular"].simulated
    force = 1e-3 * motion.mesh_force_n
    drawn = [line.get_ydata() for line in wide.lines if len(line.get_ydata()) == len(force) - 1]
    assert any(np.allclose(own, force[:-1], rtol=1e-12) for own in drawn)
    # peak amplitudes in decibels over a newton, up to 25 kHz, where they are above one
    steady = results.forms["fourier-half"].steady
    level = 20 * np.log10(2 * np.abs(steady.mesh_force[1:41]))
    (marks,) = (line for line in lines.lines if line.get_marker() == "o")
    shown = level > 0
    np.testing.assert_allclose(marks.get_xdata(), 0.625 * (1 + np.flatnonzero(shown)))
    np.testing.assert_allclose(marks.get_ydata(), level[shown])


def test_claims_table_holds_every_number_behind_every_claim(report):
    """Row by row, with the difference and the agreement worked out from the two numbers."""
    rows = iter(claim_rows(report.judged))
    for entry in report.judged:
        for item in entry.evidence:
            row = next(rows)
            said = (entry.claim.key, entry.claim.text, entry.claim.where)
            assert (row["claim"], row["text"], row["where"]) == said
            assert (row["verdict"], row["reason"]) == (entry.verdict, entry.reason)
            assert (row["quantity"], row["unit"]) == (item.quantity, item.unit)
            assert (row["source"], row["tolerance"]) == (item.source, item.tolerance)
            assert row["ours"] == item.ours or np.isnan(item.ours)
            assert row["expected"] == item.expected
            if item.expected is None:
                assert (row["difference"], row["agrees"]) == (None, None)
                continue
            off = item.ours - item.expected
            off /= item.expected or 1.0
            assert row["difference"] == pytest.approx(off, abs=1e-15)
            assert row["agrees"] is bool(abs(off) <= item.tolerance)
    assert next(rows, None) is None


def test_sweeps_table_follows_from_equation_and_lines(results):
    """One row for each value, its columns by closed forms and sums over the displacement lines."""
    expected = [(name, value) for name, (*_, values) in SWEEPS.items() for value in values]
    rows = sweep_rows(results)
    assert [(row["parameter"], row["value"]) for row in rows] == expected
    points = [point for sweep in results.sweeps.values() for point in sweep.points]
    turn = np.arange(POINTS_PER_PERIOD) / POINTS_PER_PERIOD
    for row, point in zip(rows, points, strict=True):
        own = {
            "stiffness_n_per_m": REFERENCE.stiffness_n_per_m,
            "mass_kg": REFERENCE.mass_kg,
            "damping_ns_per_m": REFERENCE.damping_ns_per_m,
        } | {row["parameter"]: row["value"]}
        k, m, c = own.values()
        z = point.response.displacement
        angular = 2 * np.pi * 625.0 * np.arange(len(z))
        size = np.where(angular > 0, 2 * np.abs(z), 0.0)
        energy = (angular * size) ** 2 / 2
        waves = np.exp(2j * np.pi * np.outer(turn, np.arange(len(z))))
        course, speed = ((waves @ (f * np.r_[z[0], 2 * z[1:]])).real for f in (1, 1j * angular))
        stiffness = k * (1 + series(REFERENCE.stiffness_harmonics)(turn))
        told = {
            "natural_frequency_hz": np.sqrt(k / m) / (2 * np.pi),
            "damping_ratio": c / (2 * np.sqrt(k * m)),
            "mean_displacement_m": z[0].real,
            "displacement_swing_m": course.max() - course.min(),
            "least_displacement_m": course.min(),
            "least_mesh_force_n": (stiffness * course + c * speed).min(),
            "peak_acceleration_ms2": (angular**2 * size).max(),
            "peak_harmonic": np.argmax(angular**2 * size),
            "total_energy_j_per_kg": energy.sum(),
            "total_energy_j": m * energy.sum(),
            "mean_energy_frequency_hz": (energy * angular).sum() / energy.sum() / (2 * np.pi),
            "energy_band_hz": 625.0 * max(np.flatnonzero(energy >= 0.1 * energy.max())),
            "start_error": point.start_error,
            "error_bound": point.response.error_bound,
        }
        assert {name: row[name] for name in told} == pytest.approx(told, rel=1e-6)
        assert row["start_method"] == point.start_method


def test_table_of_figures_names_the_files_of_the_pictures(report):
    with (report.page.parent / "figures.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["figure"]) for row in rows] == list(range(1, 37))
    written = {path.name for path in report.files}
    for row in rows:
        assert row["picture"] in written
        picture = NAMED[row["picture"].removesuffix(".png")]
        assert int(row["figure"]) in picture["figures"]
        assert row["title"] == picture["title"]


def test_what_is_found_stands_indented_under_its_claim(report):
    """A line begins with a key or with the margin that the verdicts leave."""
    margin = " " * 23
    claims_told = report.lines()[: report.lines().index("")]
    heads = [line for line in claims_told if not line.startswith(margin)]
    assert [line.split()[0] for line in heads] == [entry.claim.key for entry in report.judged]
    assert all(line[23] != " " for line in claims_told)


OVER_TIME = [
    (picture["name"], number, *panel)
    for picture in PICTURES
    if picture.get("drawing", [""])[0] == "over_time"
    for number, panel in enumerate(panel for row in picture["drawing"][3] for panel in row)
]


@pytest.mark.parametrize(
    ("name", "number", "quantity", "when", "title", "limits"),
    [(*panel[:5], panel[5:]) for panel in OVER_TIME],
)
def test_curves_over_time_are_the_part_that_is_named(
    results, name, number, quantity, when, title, limits
):
    """First mesh period, the three after it, or one settled: in ms from rest or in mesh periods."""
    sweep = results.sweeps[NAMED[name]["drawing"][1]]
    ax = draw_picture(NAMED[name], results).axes[number]
    assert ax.get_title(loc="left") == title
    field, factor, unit = {
        "displacement": ("displacement_m", 1e6, "µm"),
        "velocity": ("velocity_ms", 1e3, "mm/s"),
        "acceleration": ("acceleration_ms2", 1.0, "m/s²"),
    }[quantity]
    low, high, time = {
        "first": (0.0, 1.6, "time in ms"),
        "later": (1.6, 6.4, "time in ms"),
        "settled": (0.0, 1.0, "mesh phase in mesh periods"),
    }[when]
    assert ax.get_ylabel().endswith(unit)
    assert ax.get_xlabel() == time
    assert len(ax.lines) == len(sweep.points)
    for line, point in zip(ax.lines, sweep.points, strict=True):
        x, y = line.get_data()
        step = (high - low) / (3 if when == "later" else 1) / POINTS_PER_PERIOD
        assert (x[0], x[-1]) == pytest.approx((low, high), abs=1.01 * step)
        if when == "settled":
            kind = field.split("_")[0]
            true = point.response.at(np.asarray(x) * 1.6e-3, kind)
            np.testing.assert_allclose(y, factor * true, atol=1e-6 * np.ptp(y))
        else:
            whole = getattr(point.start, field)
            true = np.interp(1e-3 * np.asarray(x), point.start.time_s, whole)
            np.testing.assert_allclose(y, factor * true, atol=1e-9 * np.ptp(whole) * factor)
    if limits:
        assert ax.get_xlim() == tuple(limits)
    names = [text.get_text() for text in ax.figure.legends[0].get_texts()]
    assert names[: len(sweep.shown)] == sweep.shown


def test_stiffness_forms_are_drawn_in_giganewtons_over_two_mesh_periods(results):
    axes = draw_picture(NAMED["stiffness_forms"], results).axes
    for ax, key in zip(axes, SIGNALS, strict=False):
        assert ax.get_title(loc="left") == f"Fig. 1, {SIGNALS[key].label}"
        line = next(own for own in ax.lines if own.get_label() == SIGNALS[key].label)
        phase, stiffness = map(np.asarray, line.get_data())
        assert (phase[0], phase[-1]) == pytest.approx((0.0, 2.0), abs=1e-3)
        half = len(phase) // 2
        np.testing.assert_allclose(stiffness[:half], stiffness[half:], rtol=1e-9)
        assert stiffness.mean() == pytest.approx(0.8, rel=1e-3)
        if key == "rectangular":
            assert np.ptp(stiffness) == pytest.approx(0.8 * 2 * 0.13)
            assert (stiffness[:half] > 0.8).mean() == pytest.approx(0.412, abs=1e-3)


def test_responses_fill_two_thirds_of_their_axes_once_settled(results):
    """Velocity and acceleration are scaled by the largest settled value, of either sign."""
    axes = np.array(draw_picture(NAMED["form_responses"], results).axes).reshape(3, 3)
    for row, field, factor in ((1, "velocity_ms", 1e3), (2, "acceleration_ms2", 1.0)):
        largest = max(
            np.abs(factor * getattr(results.forms[key].simulated, field)[-1001:-1]).max()
            for key in ("wave", "rectangular", "fourier")
        )
        for ax in axes[row]:
            assert ax.get_ylim() == pytest.approx((-1.5 * largest, 1.5 * largest))


def test_orders_are_drawn_with_their_error_over_the_exact_motion(results):
    together, error, of_order, of_eps = draw_picture(NAMED["orders"], results).axes
    *orders, exact = (np.asarray(line.get_ydata()) for line in together.lines)
    phase = np.asarray(together.lines[0].get_xdata())
    np.testing.assert_allclose(exact, 1e6 * results.reference.response.at(1.6e-3 * phase))
    study = results.orders
    assert len(orders) == 3
    for number, (curve, line) in enumerate(zip(orders, error.lines, strict=False)):
        np.testing.assert_allclose(line.get_ydata(), curve - exact, atol=1e-12)
        off = np.abs(curve - exact).max() / np.abs(exact).max()
        assert off == pytest.approx(study.displacement_errors[number], rel=1e-2)
    for line, values in zip(
        of_order.lines, (study.displacement_errors, study.acceleration_errors), strict=True
    ):
        np.testing.assert_allclose(line.get_xdata(), range(len(values)))
        np.testing.assert_allclose(line.get_ydata(), values)
    for number, line in enumerate(of_eps.lines):
        eps, off = map(np.asarray, line.get_data())
        np.testing.assert_allclose(off, study.errors_of_variation[:, number])
        slope = np.polyfit(np.log(eps), np.log(off), 1)[0]
        assert slope == pytest.approx(number + 1, abs=0.1)
        assert line.get_label() == f"order {number}: slope {slope:.2f}"


def test_harvested_power_stands_at_the_line_it_is_taken_from(results):
    """In mW over kHz, with the best line named over it."""
    upper, lower = draw_picture(NAMED["energy_of_reference"], results).axes
    (marks,) = (line for line in lower.lines if line.get_marker() == "o")
    x, y = map(np.asarray, marks.get_data())
    number = np.rint(x / 0.625).astype(int)
    np.testing.assert_allclose(x, 0.625 * number)
    assert number[0] == 1
    np.testing.assert_allclose(y, 1e3 * results.harvested_w[number - 1])
    energy = 1e6 * results.reference.response.energy_lines
    best = int(energy.argmax())
    words = [text.get_text() for text in upper.texts]
    assert f"best: {625 * best} Hz, {energy[best]:.1f} µJ/kg" in words
    third = [line.get_ydata()[0] for line in upper.lines if line.get_ls() == "--"]
    assert third == pytest.approx([energy[best] / 3])
    limits = [line.get_xdata()[0] for line in upper.lines if line.get_ls() == ":"]
    assert limits == pytest.approx([1.0, 10.0])


def test_sidebands_are_the_lines_between_multiples_of_the_pinion_teeth(results):
    left, right = draw_picture(NAMED["damage"], results).axes
    response = results.damage.responses[LOSSES.index(0.05)]
    level = 20 * np.log10(2 * np.abs(response.acceleration[1:]))
    number = np.arange(1, len(level) + 1)
    (marks,) = (line for line in left.lines if line.get_marker() == "o")
    x, y = map(np.asarray, marks.get_data())
    drawn = (number % 26 == 0) & (level > -40) & (number * 0.625 / 26 <= 25.0)
    np.testing.assert_allclose(x, number[drawn] * 0.625 / 26)
    np.testing.assert_allclose(y, level[drawn])
    between = (number % 26 != 0) & (level > -40) & (number * 0.625 / 26 <= 25.0)
    (stems,) = (own for own in left.collections if own.get_label() == "sidebands")
    ends = np.array([segment[1] for segment in stems.get_segments()])
    np.testing.assert_allclose(ends[:, 0], number[between] * 0.625 / 26)
    np.testing.assert_allclose(ends[:, 1], level[between])
    np.testing.assert_allclose(right.lines[0].get_xdata(), [1, 2, 5, 10, 20])
    np.testing.assert_allclose(right.lines[0].get_ydata(), results.damage.levels_db)


def test_run_times_are_drawn_in_milliseconds_without_ways_that_have_no_error(results):
    costs = [dict(cost) for cost in results.speed.costs]
    costs[0]["error"] = 0.0
    speed = replace(results.speed, costs=costs)
    (ax,) = draw_picture(NAMED["speed"], replace(results, speed=speed)).axes
    drawn = [point for line in ax.lines for point in line.get_xydata().tolist()]
    asked = [[cost["error"], 1e3 * cost["median_s"]] for cost in costs[1:]]
    assert sorted(drawn) == [pytest.approx(own) for own in sorted(asked)]
    assert ax.get_ylabel() == "time in ms"
    ways = {line.get_label().removeprefix("simulation, SciPy ") for line in ax.lines}
    assert ways == {cost["method"] for cost in costs}


def test_least_force_is_drawn_against_what_was_scanned(results):
    """Mass in kg, damping in kN s/m and eps; a point where contact is lost first."""
    study, axes = results.contact, draw_picture(NAMED["contact"], results).axes
    scans = ((study.mass, 1.0), (study.damping, 1e3), (study.variation, 1.0))
    for ax, (scan, scale) in zip(axes, scans, strict=False):
        x, y = map(np.asarray, ax.lines[0].get_data())
        np.testing.assert_allclose(x, scan.values / scale)
        inside = scan.least_force > -1.0
        np.testing.assert_allclose(y[inside], scan.least_force[inside])
        firsts = [line.get_xdata()[0] for line in ax.lines if line.get_marker() == "o"]
        assert firsts == ([] if scan.first is None else [pytest.approx(scan.first / scale)])


def test_progress_of_the_computation_rises_and_stays_within_the_whole(results):
    assert results.sweeps
    assert len(SHARES) >= len(results.sweeps)
    assert sorted(SHARES) == SHARES
    assert SHARES[0] >= 0
    assert SHARES[-1] <= 1


@pytest.mark.parametrize("picture", PICTURES, ids=lambda picture: picture["name"])
def test_axes_of_time_phase_and_frequency_hold_what_their_units_allow(results, picture):
    """Whole mesh periods of 1.6 ms, phases of one or two of them, lines at 0.625 kHz or 26th."""
    for ax in draw_picture(picture, results).axes:
        ends = [np.asarray(line.get_xdata(), dtype=float) for line in ax.lines]
        ends = [x[np.isfinite(x)] for x in ends if len(x) > 3]
        low, high = (min(x.min() for x in ends), max(x.max() for x in ends)) if ends else (0.0, 0.0)
        label = ax.get_xlabel() or next(
            (own.get_xlabel() for own in ax.figure.axes if own.get_shared_x_axes().joined(own, ax)),
            "",
        )
        if "time in ms" in label:
            assert high == pytest.approx(1.6 * round(high / 1.6), abs=0.01)
            assert 1.5 < high < 1.6 * 4.01
            assert low == pytest.approx(1.6 * round(low / 1.6), abs=0.01)
        elif "mesh phase" in label or "mesh periods" in label:
            assert 0.0 <= low < 0.01
            assert round(high) in (1, 2)
            assert high == pytest.approx(round(high), abs=0.01)
        elif "kHz" in label:
            assert low >= 0.0
            steps = np.concatenate(ends) * 26 / 0.625
            np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
            assert np.concatenate(ends).min() <= 0.625 * 2
