"""The study's pictures, page and tables: complete, labelled, and from the results."""

from __future__ import annotations

import csv
import json
import re
from collections import Counter

import numpy as np
import pytest
from matplotlib.figure import Figure

from gearmon.errors import ArgumentError
from gearmon.report.plots import as_png
from gearmon.study import report as telling
from gearmon.study import write_study
from gearmon.study.claims import Evidence
from gearmon.study.pair import REFERENCE, SIGNALS
from gearmon.study.report import (
    FIGURES,
    PICTURES,
    decibels,
    draw_picture,
    shades,
    shown_difference,
    shown_number,
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
