"""Pictures of `gearmon orders`: axes and scales say what is drawn, and all of it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.drawn_extent import badly_filled
from reference.small_gearbox import machine, recording

from gearmon.report.curves import mark_label
from gearmon.report.plots import sheet
from gearmon.report.recording_plots import (
    average_figure,
    indicator_figure,
    order_map_figure,
)
from gearmon.report.spectrum_plots import label_marks, line_marks, order_figure
from gearmon.report.text import words
from gearmon.signals.orders import order_map
from gearmon.signatures.gear_averages import gear_averages
from gearmon.signatures.measured.indicators import indicator_table
from gearmon.signatures.measured.line_plan import Mark
from gearmon.signatures.recording_spectrum import order_spectra


@pytest.fixture(scope="module")
def spectra():
    return {
        way: order_spectra(recording(), machine(), map_against=way) for way in ("time", "speed")
    }


@pytest.fixture(scope="module")
def averages():
    return gear_averages(recording(), machine())


def texts(figure):
    return " | ".join(text.get_text() for text in figure.findobj(lambda a: hasattr(a, "get_text")))


def labels(figure):
    assert badly_filled(figure) == []
    return [ax.get_xlabel() for ax in figure.axes] + [ax.get_ylabel() for ax in figure.axes]


def test_a_mean_and_what_leaks_from_it_through_the_window_are_no_lines(spectra):
    """The main lobe of Hann's window reaches two bins to either side."""
    found = spectra["time"]
    values = found.values.copy()
    values[:, :2] = 1e6
    for ax in order_figure(replace(found, values=values)).axes:
        assert max(np.max(line.get_ydata()) for line in ax.lines) < 1e6


def test_names_above_the_axes_stand_apart_and_point_at_their_places():
    ax, rng = sheet(6.0, 3.0).add_subplot(), np.random.default_rng(5)
    places = np.sort(np.append(rng.uniform(100.0, 500.0, 12), [101.0, 101.5]))
    marks = [
        Mark(place=own, name=f"mesh 1 ×{n}", kind="mesh", number=1)
        for n, own in enumerate(places, 1)
    ]
    ax.set_xlim(100.0, 500.0)
    label_marks(marks, ax)
    foot, text = np.array([(own.xy[0], own.xyann[0]) for own in ax.texts]).T
    assert foot == pytest.approx((places - 100.0) / 400.0)
    assert [own.get_text() for own in ax.texts] == [mark_label(mark) for mark in marks]
    assert np.diff(text).min() > 0.5 * np.diff(text).max() / 12 > np.diff(foot).min()
    assert 0.0 <= text[0] < text[-1] <= 1.0


def test_map_keeps_every_line_and_is_calibrated(spectra):
    found = spectra["time"]
    figure = order_map_figure(found)
    assert "GMF1 ×1" in texts(figure)
    ax = figure.axes[0]
    image = ax.images[0]
    drawn = image.get_array()
    assert drawn.max() == pytest.approx(found.map.amplitude[:, 0, 2:].max())
    assert image.norm.vmax / image.norm.vmin <= 1e4 * (1 + 1e-9)
    low, high = ax.get_ylim()
    assert (low, high) == pytest.approx((found.map.low[0], found.map.high[-1]))
    assert ax.get_xlim()[1] == pytest.approx(found.map.order[-1])


@pytest.mark.parametrize("way", ["time", "speed"])
def test_maps_of_several_channels_are_labelled_below_the_last(spectra, way):
    figure, names = order_map_figure(spectra[way]), spectra[way].channel_names
    assert len(names) == 2
    maps = [ax for ax in figure.axes if ax.images]
    assert [bool(ax.get_xlabel()) for ax in maps] == [False, True]
    assert maps[1].get_xlabel().startswith("Order")
    scales = [ax.get_ylabel() for ax in figure.axes if "amplitude" in ax.get_ylabel()]
    assert [own.split("\n")[0] for own in scales] == list(names)


def test_a_line_of_a_map_is_drawn_at_its_order(spectra):
    """In more bins than there are columns: a column shows the highest of its own."""
    found, count = spectra["time"], 3002
    order, rows = np.arange(count) * found.map.order[1], len(found.map.amplitude)
    lines = np.linspace(2, count - 1, rows).astype(int)
    amplitude = np.full((*found.map.amplitude.shape[:2], count), 1e-3)
    amplitude[np.arange(rows), :, lines] = 1.0
    own = replace(found.map, amplitude=amplitude, order=order)
    image = order_map_figure(replace(found, map=own)).axes[0].images[0]
    drawn, (low, high, *_) = image.get_array(), image.get_extent()
    bins = (count - 2) / drawn.shape[1]
    assert bins > 2
    row, column = np.nonzero(drawn == 1.0)
    assert row.tolist() == list(range(rows))
    place = (order[lines] - low) / (high - low) * drawn.shape[1] - column
    assert place.min() >= -1 / bins
    assert place.max() <= 1 + 1 / bins


def test_strips_of_one_unit_share_a_scale_that_holds_them_all(spectra):
    found = spectra["time"]
    quiet = found.values.copy()
    quiet[0] *= 1e-3
    alike = replace(found, values=quiet)
    shown = alike.values[:, 2:]
    ((low, high),) = {ax.get_ylim() for ax in order_figure(alike).axes}
    assert high >= shown.max()
    assert low <= shown[0].max() / 10
    # a channel of another unit has a scale of its own
    other = replace(alike, units=("g", *found.units[1:]))
    assert len({ax.get_ylim() for ax in order_figure(other).axes}) > 1


def test_every_mesh_harmonic_of_a_spectrum_is_marked_up_to_its_end(spectra):
    found = spectra["time"]
    ax = order_figure(found).axes[0]
    named = [mark_label(mark) for mark in found.marks if mark.kind == "mesh"]
    assert len(named) >= 3
    assert found.marks[-1].place > 0.7 * found.place[-1]
    assert set(named) <= {text.get_text() for text in ax.texts}


def test_speeds_never_driven_are_grey_and_said_so(spectra):
    own = spectra["speed"].map
    kept = np.array([0, 2])
    width = 1.0
    gap = replace(
        own,
        amplitude=np.repeat(own.amplitude[:1], 2, axis=0),
        time_s=np.zeros(2),
        speed_hz=40.5 + kept,
        low=40.0 + kept,
        high=40.0 + kept + width,
        blocks=np.ones(2, dtype=np.int64),
    )
    found = replace(spectra["speed"], map=gap)
    figure = order_map_figure(found)
    drawn = figure.axes[0].images[0].get_array()
    assert drawn.shape[0] == 3
    assert np.ma.getmaskarray(drawn)[1].all()
    assert "speeds that were not recorded" in texts(figure)


def test_average_shows_the_whole_turn_with_its_errors(averages):
    for own in averages.gears:
        figure = average_figure(averages, own)
        assert figure.axes[0].get_xlim() == (0.0, own.wheel.teeth)
        said = texts(figure)
        assert f"{own.wheel.teeth} teeth: mean of {own.average.turns} of its turns" in said
        assert {"residual", "difference", "synchronous average"} <= set(said.split(" | "))
        assert "± 2 standard errors" in said
        zero = "tachometer pulse" if own.wheel.gear == "pinion" else "0 anywhere"
        assert any(zero in label for label in labels(figure))
        angle, whole = figure.axes[0].lines[0].get_data()
        assert whole[-1] == whole[0]
        assert len(whole) > 24 * own.wheel.teeth
        # where it has a value the curve goes through it
        known = np.arange(own.average.per_turn) * own.wheel.teeth / own.average.per_turn
        read = np.interp(known, angle, whole)
        assert np.corrcoef(read, own.average.waveform[0])[0, 1] > 0.99
        (band,) = figure.axes[1].collections
        error = np.append(own.average.waveform_error[0], own.average.waveform_error[0, 0])
        reach = 2 * np.interp(angle, np.append(known, own.wheel.teeth), error).max()
        heights = band.get_paths()[0].vertices[:, 1]
        assert (heights.min(), heights.max()) == pytest.approx((-reach, reach), rel=1e-9)


def test_indicators_say_what_is_dashed():
    figure = indicator_figure([indicator_table(recording(), machine())])
    assert "Gaussian noise" in texts(figure)
    # of a normal law the n-th moment is the product of the odd numbers below n
    orders = {"kurtosis": 4, "FM4": 4, "NA4": 4, "NA4*": 4, "M6A": 6, "M8A": 8}
    for ax in figure.axes:
        name = ax.get_title(loc="left").split("\n")[0].split(" (")[0]
        dashed = [line.get_ydata()[0] for line in ax.lines if line.get_linestyle() == "--"]
        moment = [math.prod(range(1, orders[name], 2))] if name in orders else []
        assert dashed == moment, name


@pytest.mark.parametrize("count", [1, 4, 5, 8, 9])
def test_panels_of_indicators_fill_every_row_but_the_last(count):
    table = indicator_table(recording(), machine())
    kinds = list(dict.fromkeys((row.indicator, row.input.split(",")[0]) for row in table.rows))
    kept = [r for r in table.rows if (r.indicator, r.input.split(",")[0]) in kinds[:count]]
    figure = indicator_figure(replace(table, rows=tuple(kept)))
    assert len(figure.axes) == count
    grid = figure.axes[0].get_gridspec()
    assert grid.ncols == 4
    assert grid.nrows == math.ceil(count / 4)


def test_every_indicator_of_the_table_is_defined():
    names = {row.indicator.lower() for row in indicator_table(recording(), machine()).rows}
    assert names <= set(words()["indicators"])


def test_order_map_of_signals_is_that_of_the_recording(spectra):
    found = spectra["time"]
    vibration = recording().vibration()
    own = order_map(
        vibration.samples,
        vibration.sampling_rate_hz,
        found.signature.track,
        top=float(found.map.order[-1]),
        block_turns=found.map.block_turns,
    )
    np.testing.assert_allclose(own.amplitude, found.map.amplitude, rtol=1e-9)


@given(
    st.lists(st.tuples(st.sampled_from(["mesh", "shaft"]), st.integers(1, 3), st.floats(0, 50))),
    st.floats(1.0, 20.0),
    st.floats(1.0, 25.0),
)
def test_marks_lie_on_the_axis_and_stand_apart_those_of_meshes_first(told, low, width):
    marks = [Mark(place=place, name="", kind=kind, number=n) for kind, n, place in told]
    kept = line_marks(marks, low, low + width)
    places = [mark.place for mark in kept]
    assert places == sorted(places)
    assert all(low <= place <= low + width for place in places)
    assert set(kept) <= set(marks)
    if len(places) > 1:
        assert np.diff(places).min() > 0
    # a mesh is left out for another mesh alone
    inside = [mark for mark in marks if low <= mark.place <= low + width]
    if any(mark.kind == "mesh" for mark in inside):
        assert any(mark.kind == "mesh" for mark in kept)
    if inside:
        assert kept
