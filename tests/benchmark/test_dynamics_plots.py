"""Pictures of benchmarks hold their rows."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from gearmon.benchmark import case_figures
from gearmon.benchmark.plots import (
    growth_figure,
    plot_growth,
    plot_ratios,
    plot_work_precision,
    work_precision_figure,
)
from gearmon.report.plots import save_all


def row(case, method, error, median_s, **others):
    return {
        "case": case,
        "method": method,
        "group": "gearmon" if method == "steady_state" else "compiled",
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
    row("pair", "compiled RK4 from rest", 9e-7, 2e-3),
    row("pair", "SciPy Radau", None, None),
    row("other", "steady_state", 1e-9, 1e-4),
    row("other", "compiled RK4 from rest", 9e-7, 3e-5),
    *(
        row("cost growth", "steady_state", None, 1e-6 * n, unknowns=n, exponent=1.0)
        for n in (10, 1000, 100_000)
    ),
]


@pytest.fixture
def ax():
    return Figure().add_subplot()


def test_work_precision(ax):
    assert plot_work_precision([r for r in ROWS if r["case"] == "pair"], ax) is ax
    lines = {line.get_label(): line for line in ax.lines}
    np.testing.assert_array_equal(lines["steady_state"].get_xdata(), [1e-7, 1e-3])
    assert "SciPy Radau" not in lines
    low, high = ax.get_xlim()
    assert low > high  # accuracy grows to the right


def test_small_multiples_leave_special_cases_out():
    figure = work_precision_figure(ROWS)
    titles = [ax.get_title() for ax in figure.axes]
    assert titles[:2] == ["pair", "other"]
    assert "cost growth" not in titles
    names = [text.get_text() for text in figure.axes[2].get_legend().get_texts()]
    assert names == ["steady_state", "compiled RK4 from rest"]


def test_ratios(ax):
    plot_ratios([r for r in ROWS if r["case"] == "pair"], ["compiled RK4 from rest", "x"], ax)
    (bar,) = ax.patches
    assert bar.get_x() == 1
    assert bar.get_x() + bar.get_width() == pytest.approx(20)
    assert [text.get_text().strip() for text in ax.texts] == ["20", "×"]


def test_growth(ax):
    plot_growth([r for r in ROWS if r["case"] == "cost growth"], ax)
    lines = {line.get_label(): line for line in ax.lines}
    np.testing.assert_allclose(lines["steady_state, fitted exponent 1.00"].get_ydata()[-1], 100)
    assert lines["n log n, through the last point"].get_ydata()[-1] == pytest.approx(100)
    assert ax.get_ylabel() == "median run time in ms"
    assert growth_figure(ROWS).axes


def test_files(tmp_path):
    paths = save_all(case_figures("dynamics", ROWS), tmp_path / "b.png")
    assert [p.name for p in paths] == ["b-work-precision.png", "b-ratios.png", "b-growth.png"]
    assert save_all(case_figures("dynamics", [ROWS[0]]), tmp_path / "c.svg") == [
        tmp_path / "c-work-precision.svg"
    ]
