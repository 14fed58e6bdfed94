"""Pictures of the benchmark of detection hold its rows."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from gearmon.benchmark import case_figures
from gearmon.benchmark.detection import RIVALS, detection_summary
from gearmon.benchmark.plots import (
    DETECTOR_STYLES,
    detection_figures,
    plot_areas,
    plot_kinds,
    plot_reliability,
    plot_sizes,
    styles,
)
from gearmon.report.plots import save_all


def row(rng, machine, condition, size, tacho):
    hurt = condition == "tooth"
    score = rng.normal(30 * size if hurt else 0.0)
    return {
        "machine": machine,
        "condition": condition,
        "variant": "same",
        "size": size,
        "tacho": tacho,
        "stage": 1,
        "gear": "pinion",
        "verdict": "fault" if score > 2 else "healthy",
        "score": score,
        "probability": float(rng.random()),
        "found_kind": "tooth damage" if hurt else "",
        "tooth_flag": hurt,
        "found_stage": 1,
        "found_gear": "pinion" if rng.random() < 0.9 else "gear",
        "gear_right": machine % 4 > 0 if hurt else None,
        "tooth_error": float(rng.choice([0.1, 1.0, 2.0, 5.0])),
        "loss": size * (1.1 if machine % 2 else 0.9) if hurt else None,
        "loss_low": size * 0.8 if machine % 3 else size * 1.05,
        "loss_high": size * 1.4,
        "run_time_s": 0.4 + 0.1 * float(rng.random()),
        "alone_s": 0.3,
        **{name: float(rng.normal()) for name in RIVALS},
    }


@pytest.fixture(scope="module")
def rows():
    rng = np.random.default_rng(0)
    kinds = [("healthy", 0.0), ("healthy", 0.0), ("tooth", 0.05), ("tooth", 0.2), ("wear", 0.4)]
    return [
        row(rng, machine, kind, size, tacho)
        for machine in range(12)
        for kind, size in kinds
        for tacho in (True, False)
    ]


@pytest.fixture(scope="module")
def table(rows):
    return pd.DataFrame(rows)


@pytest.fixture
def ax():
    return Figure().add_subplot()


def test_every_detector_has_a_style():
    assert set(DETECTOR_STYLES) == {"gearmon", *RIVALS}
    looks = [tuple(look.values()) for look in styles(map(str, range(20))).values()]
    assert len(set(looks)) == 20


def test_areas(rows, ax):
    summary = pd.DataFrame(detection_summary(rows))
    plot_areas(summary[summary["tacho"]], ax)
    assert ax.get_legend_handles_labels()[1] == list(DETECTOR_STYLES)
    assert [t.get_text() for t in ax.get_xticklabels()] == ["5", "20"]


def test_reliability_ends_at_one(table, ax):
    plot_reliability(table, ax, "black", "with tacho")
    assert ax.lines[0].get_ydata()[-1] == 1.0


def test_kinds_are_all_counted(table, ax):
    plot_kinds(table, ax)
    assert sum(int(text.get_text()) for text in ax.texts) == len(table)
    # a row is coloured by the shares of what was found in its condition
    shares = np.asarray(ax.images[0].get_array())
    assert shares.sum(axis=1) == pytest.approx(1.0)
    sizes = table["condition"].value_counts().sort_index()
    for text in ax.texts:
        column, row = text.get_position()
        assert shares[row, column] * sizes.iloc[row] == pytest.approx(int(text.get_text()))


def test_sizes_show_every_estimate(table, ax):
    own = table[table["condition"] == "tooth"]
    plot_sizes(own, ax)
    dots = [line for line in ax.lines if line.get_marker() == "."]
    assert sum(len(line.get_xdata()) for line in dots) == len(own)
    held = own["size"].between(own["loss_low"], own["loss_high"])
    # blue are those whose interval holds the true loss, and there are more of them
    assert [len(line.get_xdata()) for line in dots] == [held.sum(), (~held).sum()]
    assert held.sum() == 2 * (~held).sum()
    drawn = np.sort(np.concatenate([line.get_ydata() for line in dots]))
    np.testing.assert_allclose(drawn, np.sort(100 * own["loss"]))
    # recordings of one loss stand beside one another about it
    for line in dots:
        for true in (5.0, 20.0):
            at = line.get_xdata()[np.abs(line.get_xdata() / true - 1) < 0.5]
            assert np.exp(np.mean(np.log(at))) == pytest.approx(true, rel=0.02)
            assert len(set(at.tolist())) == len(at)
    plot_sizes(own[:0], Figure().add_subplot())


def test_pictures_say_what_they_show_with_tacho_and_without(rows, table):
    figures = detection_figures(rows)
    said = {
        name: {(ax.get_xlabel(), ax.get_ylabel()) for ax in figure.axes}
        for name, figure in figures.items()
    }
    assert said == {
        "roc": {("loss of one tooth's pair stiffness in %", "area under the ROC curve")},
        "false-alarms": {
            ("stated false-alarm probability", "observed share of healthy recordings")
        },
        "kinds": {("found", "true")},
        "size": {("true loss in %", "estimated loss in %")},
    }
    summary = pd.DataFrame(detection_summary(rows))
    for place, tacho in enumerate((True, False)):
        areas, sizes = (figures[name].axes[place] for name in ("roc", "size"))
        assert (
            areas.get_title() == sizes.get_title() == ("with tacho" if tacho else "without tacho")
        )
        own = summary[(summary["figure"] == "ROC area") & (summary["tacho"] == tacho)]
        for line in areas.lines:
            told = own[own["detector"] == line.get_label()]
            if len(told):
                assert line.get_ydata() == pytest.approx(told["value"])
                losses = 100 * told["of"].str.removeprefix("loss ").astype(float)
                assert line.get_xdata() == pytest.approx(losses, rel=0.15)
        ends = np.concatenate([own.get_segments() for own in areas.collections])[:, :, 1]
        told = own[own["detector"].isin(DETECTOR_STYLES)][["low", "high"]].to_numpy()
        np.testing.assert_allclose(np.sort(ends, axis=0), np.sort(told, axis=0))
        # of a gear that is not hurt no loss can be right
        right = table["gear_right"].eq(True) & (table["condition"] == "tooth")
        hurt = table[(table["tacho"] == tacho) & right]
        assert 0 < len(hurt) < (table["tacho"] == tacho).sum()
        dots = [len(line.get_xdata()) for line in sizes.lines if line.get_marker() == "."]
        assert sum(dots) == len(hurt)
    (alarms,) = figures["false-alarms"].axes
    with_tacho, without, stated = alarms.lines
    for line, tacho in ((with_tacho, True), (without, False)):
        own = table[(table["tacho"] == tacho) & (table["condition"] == "healthy")]["probability"]
        for level in (0.1, 0.5, 0.9):
            share = line.get_ydata()[line.get_xdata() <= level]
            assert max(share, default=0.0) == pytest.approx((own <= level).mean())
        word = "with" if tacho else "without"
        assert line.get_label() == f"{word} tacho, {len(own)} healthy recordings"
    assert list(stated.get_xdata()) == list(stated.get_ydata())
    (kinds,) = figures["kinds"].axes
    names = [
        [own.get_text() for own in ticks]
        for ticks in (kinds.get_xticklabels(), kinds.get_yticklabels())
    ]
    own = table[table["tacho"]]
    found = own["found_kind"].where(own["found_kind"] != "", own["verdict"])
    for text in kinds.texts:
        column, row = text.get_position()
        is_there = (own["condition"] == names[1][row]) & (found == names[0][column])
        assert int(text.get_text()) == is_there.sum()


def test_files(rows, tmp_path):
    paths = save_all(case_figures("detection", rows), tmp_path / "d.svg")
    names = ["roc", "false-alarms", "kinds", "size"]
    assert [path.stem for path in paths] == [f"d-{name}" for name in names]
    assert all(path.read_bytes().startswith(b"<?xml") for path in paths)
