"""Pictures of benchmarks hold their rows."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from gearmon.benchmark import case_figures
from gearmon.benchmark.plots import dynamics_figures, plot_work_precision, styles
from gearmon.report.plots import save_all


def row(case, method, error, median_s, **others):
    return {
        "case": case,
        "method": method,
        "error": error,
        "median_s": median_s,
        "times_ours": median_s and median_s / 1e-4,
        "at_target": error is not None and error <= 1e-6,
        "unknowns": 10,
        "exponent": None,
    } | others


ROWS = [
    row("pair", "steady_state", 1e-7, 1e-4),
    row("pair", "steady_state", 1e-3, 5e-5),
    row("pair", "compiled RK4", 9e-7, 2e-3),
    row("pair", "SciPy odeint", None, None),
    row("other", "steady_state", 1e-9, 1e-4),
    row("other", "compiled RK4", 9e-7, 3e-5),
    *(
        row("cost growth", "steady_state", None, 1e-6 * n, unknowns=n, exponent=1.0)
        for n in (10, 1000, 100_000)
    ),
]


def test_work_precision():
    ax = Figure().add_subplot()
    table = pd.DataFrame([r for r in ROWS if r["case"] == "pair" and r["error"]])
    assert plot_work_precision(table, ax, styles(table["method"])) is ax
    np.testing.assert_array_equal(ax.lines[0].get_xdata(), [1e-7, 1e-3])
    low, high = ax.get_xlim()
    assert low > high  # accuracy grows to the right


def test_small_multiples_leave_out_what_has_no_figures():
    figure = dynamics_figures(ROWS)[""]
    titles = [ax.get_title() for ax in figure.axes]
    assert titles[:2] == ["pair", "other"]
    assert "cost growth" not in titles
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == ["steady_state", "compiled RK4"]


def test_every_panel_draws_run_time_over_error_of_its_case_in_the_units_that_are_said():
    figure = dynamics_figures(ROWS)[""]
    assert figure.get_supxlabel().startswith("relative L2 error of acceleration")
    assert figure.get_supylabel() == "median run time in s"
    for ax in figure.axes:
        own = [r for r in ROWS if r["case"] == ax.get_title() and r["error"] is not None]
        drawn = {
            line.get_label(): list(zip(*line.get_data(), strict=True))
            for line in ax.lines
            if not line.get_label().startswith("_")
        }
        methods = dict.fromkeys(r["method"] for r in own)
        assert drawn == {
            name: [(r["error"], r["median_s"]) for r in own if r["method"] == name]
            for name in methods
        }
        assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
        (target,) = (line for line in ax.lines if line.get_label().startswith("_"))
        assert set(target.get_xdata()) == {1e-6}
        # nothing drawn lies beyond the ends
        right, left = ax.get_xlim()
        assert left < min(r["error"] for r in own)
        assert right > max(r["error"] for r in own)


def test_files(tmp_path):
    (path,) = save_all(case_figures("dynamics", ROWS), tmp_path / "b.png")
    assert path.name == "b.png"


def test_every_setting_lies_within_the_axis_from_less_accurate_to_more():
    for errors in ([1e-3, 1e-7], [0.4, 1e-12], [5e-8, 2e-9], [2.0, 3e-15]):
        table = pd.DataFrame({"method": "one", "error": errors, "median_s": [1e-5, 1e-3]})
        ax = plot_work_precision(table, Figure().add_subplot(), styles(["one"]))
        left, right = ax.get_xlim()
        assert left > max(errors)
        assert right < min(errors)
        assert left < 10 * max(errors)


def test_methods_are_told_apart_by_colour_or_marker():
    looks = styles(map(str, range(40)))
    assert len({(own["color"], own["marker"]) for own in looks.values()}) == 40
