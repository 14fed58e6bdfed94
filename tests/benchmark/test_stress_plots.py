"""Pictures of the stress test hold its rows."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from gearmon.benchmark import case_figures
from gearmon.benchmark.plots import (
    plot_bound_ratios,
    plot_bounds,
    plot_refusals,
)
from gearmon.report.plots import save_all

STRESS = [
    {
        "tolerance": 1e-6,
        "ratio": 10.0**i,
        "zeta": 0.1,
        "outcome": outcome,
        "reason": reason,
        "error": 1e-8,
        "error_bound": bound,
        "bound_over_error": bound and bound / 1e-8,
    }
    for i, (outcome, reason, bound) in enumerate(
        [
            ("met", "", 1e-7),
            ("met", "", 2e-8),
            ("refused", "bound too wide", 1e-5),
            ("refused", "no bound", None),
            ("crashed", "OverflowError", None),
        ]
    )
]


@pytest.fixture
def ax():
    return Figure().add_subplot()


def test_bound_ratios(ax):
    plot_bound_ratios(STRESS, ax)
    assert sum(patch.get_height() for patch in ax.patches) == 3
    assert any(np.isclose(patch.get_x(), 1.0) for patch in ax.patches)


def test_bounds_and_refusals(ax):
    plot_bounds(STRESS, 1e-6, ax)
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["met (2)", "refused (2)", "crashed (1)"]
    other = Figure().add_subplot()
    plot_refusals(STRESS, other)
    labels = [text.get_text() for text in other.get_legend().get_texts()]
    assert labels == ["met", "bound too wide (1)", "no bound (1)", "crashed (1)"]


def test_file(tmp_path):
    (path,) = save_all(case_figures("stress", STRESS), tmp_path / "s.svg")
    assert path.read_bytes().startswith(b"<?xml")
