from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from gearmon.report.level_views import change_views, level_views, pattern_views
from gearmon.report.pictures import pictures
from gearmon.report.plots import PNG_DOTS_PER_INCH, as_png, new_figure, spread
from gearmon.report.plots_levels import label_groups, plot_changes, plot_levels, plot_pattern
from gearmon.report.plots_spectrum import label_meshes, label_sidebands, plot_spectrum
from gearmon.report.plots_turn import label_teeth, plot_speed, plot_teeth, plot_turn
from gearmon.report.spectrum_views import close_up_views, spectrum_views
from gearmon.report.turn_views import speed_view, teeth_view, turn_views


@pytest.fixture
def ax():
    return new_figure([1.5])[1][0]


def texts(ax):
    return [text.get_text() for text in ax.texts]


def test_spectrum_is_drawn_on_a_log_axis_with_its_unit(ax, healthy):
    view = spectrum_views(healthy.analysis, healthy.recording)[0][0]
    assert plot_spectrum(view, ax) is ax
    curve = max(ax.lines, key=lambda line: len(line.get_xdata()))
    assert np.array_equal(curve.get_ydata(), view.amplitude)
    assert ax.get_yscale() == "log"
    assert "m/s²" in ax.get_ylabel()
    label_meshes(view, ax)
    assert texts(ax) == [mark.label for mark in view.meshes]


def test_sidebands_are_marked_where_they_were_measured(ax, healthy):
    mesh = healthy.analysis.signature.meshes[0]
    view = close_up_views(healthy.analysis, healthy.recording, mesh)[0][1]
    plot_spectrum(view, ax)
    label_sidebands(view, ax)
    drawn = {line.get_label(): line for line in ax.lines}
    assert {"sidebands of shaft 1", "sidebands of shaft 2"} <= set(drawn)
    heard = [m for m in view.sidebands if m.amplitude is not None and m.series == view.legend[0][1]]
    first = drawn[f"sidebands of {view.legend[0][0]}"]
    assert np.allclose(first.get_ydata(), [m.amplitude for m in heard])
    assert "+1" in texts(ax)


def test_levels_beyond_scatter_have_their_own_marker(ax, faulty):
    view = level_views(faulty.analysis, faulty.reference)[0]
    plot_levels(view, ax)
    label_groups(view.groups, ax, ax)
    named = {line.get_label(): line for line in ax.lines}
    changed = named["measured, changed by more than 3 standard deviations"]
    assert len(changed.get_xdata()) == view.beyond.sum() > 0
    assert changed.get_marker() != named["measured"].get_marker()
    assert "mesh 1" in texts(ax)


def test_changes_are_coloured_symmetrically_and_framed_beyond_scatter(ax, faulty):
    (view,) = change_views(faulty.analysis)
    image = plot_changes(view, ax)
    assert image.get_clim() == (-view.limit_db, view.limit_db)
    assert len(ax.patches) == view.beyond.sum()
    assert (
        len([t for t in ax.texts if t.get_text() not in view.channels])
        == np.isfinite(view.change_db).sum()
    )


def test_patterns_show_expected_bars_and_a_marker_a_channel(ax, alone):
    (view,) = pattern_views(alone.analysis)
    plot_pattern(view, ax)
    tops = [bar.get_y() + bar.get_height() for bar in ax.patches]
    assert np.allclose(tops, view.expected_db)
    assert [line.get_label() for line in ax.lines] == ["measured, front", "measured, rear"]


def test_the_flagged_tooth_is_named_and_coloured(ax, faulty):
    profile = next(p for p in faulty.analysis.profiles if p.gear == "pinion")
    assert profile.tooth is not None
    plot_teeth(teeth_view(faulty.analysis, profile), ax)
    bars = [patch for patch in ax.patches if patch.get_height() in profile.energy]
    assert len({bar.get_facecolor() for bar in bars}) == 2
    assert f"tooth {profile.tooth}: " in texts(ax)[0]
    assert "(flagged)" in texts(ax)[0]


@pytest.mark.parametrize(
    ("counted_from", "words"),
    [("tacho", "tachometer pulse"), ("reference", "first healthy recording"), (None, "relative")],
)
def test_teeth_are_numbered_honestly(ax, counted_from, words):
    label_teeth(23, counted_from, ax)
    assert words in ax.get_xlabel()
    assert list(ax.get_xticks()) == list(range(1, 24))


def test_turn_and_speed_show_their_data(ax, healthy):
    view = turn_views(healthy.analysis, healthy.analysis.signature.plan.wheels[0])[0]
    plot_turn(view, ax)
    assert np.array_equal(ax.lines[0].get_ydata(), view.average)
    assert np.array_equal(ax.lines[1].get_ydata(), view.rest)
    speed = plot_speed(speed_view(healthy.analysis), new_figure([1.0])[1][0])
    assert speed.get_ylabel() == "Shaft 1 (Hz)"
    assert "nominal 20 Hz" in speed.get_legend_handles_labels()[1]


def test_png_has_the_stated_size_and_white_paper():
    figure, _ = new_figure([1.0, 1.0], sharex=True)
    image = Image.open(io.BytesIO(as_png(figure)))
    width, height = figure.get_size_inches()
    assert image.size == (int(width * PNG_DOTS_PER_INCH), int(height * PNG_DOTS_PER_INCH))
    assert image.convert("RGB").getpixel((1, 1)) == (255, 255, 255)


@pytest.mark.parametrize("count", [1, 2, 5, 40])
def test_labels_are_spread_within_the_axis(count):
    places = spread([0.97] * count, 0.02, 0.0, 1.0)
    assert places == sorted(places)
    assert places[-1] <= 1.0 + 1e-12
    assert places[0] >= -1e-12
    assert np.all(np.diff(places) >= min(0.02, 1 / max(1, count - 1)) - 1e-12)


def test_every_case_has_its_pictures(faulty, alone, gearless):
    names = [p.name for p in pictures(faulty.analysis, faulty.recording, faulty.reference)]
    assert names == [
        "spectrum",
        "sidebands-mesh-1",
        "changes",
        "levels",
        "turn-1-pinion",
        "turn-1-gear",
        "speed",
    ]
    alone_names = [p.name for p in pictures(alone.analysis, alone.recording, None)]
    assert "pattern" in alone_names
    assert "changes" not in alone_names
    shown = pictures(gearless.analysis, gearless.recording, None)
    assert [p.name for p in shown] == ["spectrum", "searched-mesh-1"]
    assert "none was found" in shown[0].caption
    assert all(picture.alt and picture.caption for picture in shown)
