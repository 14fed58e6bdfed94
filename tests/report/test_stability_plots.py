"""Pictures of stability hold the boundaries and say their axes."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from gearmon.dynamics.stability import FourierShape
from gearmon.dynamics.stability_map import stability_map
from gearmon.report.stability_plots import (
    plot_damped_tongues,
    plot_stability_map,
    save_stability_figure,
    stability_figure,
)

COSINE = FourierShape(np.array([0.5]))


def small_map(damping_ratio=0.02, **more):
    return stability_map(
        COSINE, damping_ratio, (1.5, 2.5), 0.5, points=(30, 15), mark=(2.2, 0.3), **more
    )


@pytest.fixture(scope="module")
def stability():
    return small_map()


def test_map_shows_boundaries_and_mark(stability):
    ax = Figure().add_subplot()
    filled = plot_stability_map(stability, ax)
    assert filled is not None
    lines = {line.get_label(): line for line in ax.lines}
    assert set(lines) == {
        "boundary, exact",
        "multiple scales, 1st order",
        "multiple scales, 2nd order",
        "this pair",
        "$2/n$",
    }
    x, y = lines["boundary, exact"].get_data()
    edges = stability.tongues[0].exact
    there = np.isfinite(edges).all(axis=1)
    assert set(np.round(x, 12)) == set(np.round(edges[there].ravel(), 12))
    assert y.min() == pytest.approx(0.08, abs=1e-3)
    assert lines["this pair"].get_xydata().tolist() == [[2.2, 0.3]]
    assert "natural frequency" in ax.get_xlabel()
    assert ax.get_ylim() == (0.0, 0.5)


def test_nothing_is_filled_where_nothing_grows():
    calm = stability_map(COSINE, 0.5, (1.5, 2.5), 0.5, orders=(), points=(10, 10))
    assert plot_stability_map(calm, Figure().add_subplot()) is None
    assert any(
        "stable everywhere" in text.get_text() for text in stability_figure(calm).axes[0].texts
    )


def test_damping_variants(stability):
    ax = Figure().add_subplot()
    plot_damped_tongues([small_map(0.0, orders=()), stability], ax)
    names = {text.get_text() for text in ax.get_legend().get_texts()}
    assert names == {"damping ratio 0", "damping ratio 0.02", "$2/n$"}


def test_figure_is_written(stability, tmp_path):
    path = save_stability_figure(stability, tmp_path / "chart.png")
    assert path.read_bytes().startswith(b"\x89PNG")
