"""Pictures of stability hold the boundaries and say their axes."""

from __future__ import annotations

import numpy as np
import pytest

from gearmon.dynamics.stability import FourierShape, stability_map
from gearmon.report.expected_plots import stability_figure

COSINE = FourierShape(np.array([0.5]))


def small_map(damping_ratio=0.02, **more):
    return stability_map(
        COSINE, damping_ratio, (1.5, 2.5), 0.5, points=(30, 15), mark=(2.2, 0.3), **more
    )


@pytest.fixture(scope="module")
def stability():
    return small_map()


def test_map_shows_boundaries_and_mark(stability):
    ax, scale = stability_figure(stability).axes
    assert scale.get_ylabel() == "growth: ln of the largest multiplier, per mesh period"
    lines = {line.get_label(): line for line in ax.lines}
    assert set(lines) == {
        "boundary, exact",
        "multiple scales, 1st order",
        "multiple scales, 2nd order",
        "this pair",
        "2/n",
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
    (ax,) = stability_figure(calm).axes
    assert any("stable everywhere" in text.get_text() for text in ax.texts)
