"""Figures: paper, files, labels that make room for each other, and names with dollar signs."""

from __future__ import annotations

import io

import matplotlib
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from gearmon.report.plots import (
    PNG_DOTS_PER_INCH,
    as_png,
    legend,
    save,
    save_all,
    sheet,
    sheet_style,
    spread,
    stack,
    style,
)
from gearmon.report.spectrum_plots import line_marks
from gearmon.signatures.measured.line_plan import Mark


@given(
    st.lists(st.tuples(st.floats(-5.0, 105.0), st.booleans(), st.integers(1, 3)), max_size=60),
    st.randoms(use_true_random=False),
)
def test_marks_of_an_axis_can_be_told_apart_and_none_is_left_out_for_nothing(told, random):
    marks = [
        Mark(place=place, name=f"{n}", kind="mesh" if mesh else "shaft", number=number)
        for n, (place, mesh, number) in enumerate(told)
    ]
    inside = [mark for mark in marks if 0.0 <= mark.place <= 100.0]
    kept = line_marks(random.sample(marks, len(marks)), 0.0, 100.0)
    places = [mark.place for mark in kept]
    assert places == sorted(places)
    assert np.all(np.diff(places) >= 1.2 - 1e-9)
    for mark in inside:
        # whatever gives way does so for a mark that goes before it
        beside = [own for own in kept if abs(own.place - mark.place) < 1.2]
        assert mark in kept or beside
        if mark.kind == "mesh" and mark not in kept:
            assert any(own.kind == "mesh" and own.number <= mark.number for own in beside)


def test_png_has_the_stated_size_and_white_paper():
    figure, _ = stack([1.0, 1.0], sharex=True)
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


def test_a_legend_names_what_has_data_each_once():
    figure, (above, below) = stack([1.0, 1.0])
    above.plot([1, 2], label="measured")
    above.plot([], label="changed")
    below.plot([3, 4], label="measured")
    below.bar([1, 2], [3, 4], label="healthy")
    below.plot([5, 6])
    legend(figure, [above, below])
    (found,) = figure.legends
    assert [text.get_text() for text in found.get_texts()] == ["measured", "healthy"]


# Formulas that matplotlib would refuse to draw, and one that it would draw as something else.
NAMES = ["US$ mill", "$", "$$", r"$\frac{", "cost$_gear$", "a^{$", r"$\bad$"]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("way", [style, sheet_style])
def test_a_name_is_drawn_as_it_is_wherever_it_stands(name, way):
    with way():
        figure, (ax,) = stack([1.0])
        ax.plot([1, 2, 3], label=name)
        ax.set_title(name)
        ax.set_xlabel(name)
        ax.set_xticks([0, 1], [name, name])
        ax.text(0, 1, name)
        ax.annotate(name, (0, 1))
        legend(figure, [ax])
        figure.suptitle(name)
    # drawn outside the style that it was made in
    assert as_png(figure).startswith(b"\x89PNG")
    texts = [text for text in figure.findobj(matplotlib.text.Text) if text.get_text() == name]
    assert len(texts) >= 8
    assert not any(text.get_parse_math() for text in texts)


@pytest.mark.parametrize(("low", "high", "said"), [(1e-3, 1e4, "10⁻²"), (0.9, 4.0, "2×10⁰")])
def test_powers_of_ten_need_no_formula(low, high, said):
    with sheet_style():
        figure = sheet(3.0, 2.0)
        ax = figure.add_subplot()
        ax.plot([low, high])
        ax.set(yscale="log", ylim=(low, high))
    as_png(figure)
    labels = [tick.get_text() for tick in ax.get_yticklabels(which="both")]
    assert said in labels
    assert not any("$" in label for label in labels)


def test_a_figure_keeps_its_style_and_leaves_that_of_others_alone():
    before = dict(matplotlib.rcParams)
    with style():
        figure, (ax,) = stack([1.0])
        ax.plot([1, 2])
    as_png(figure)
    assert {tick.label1.get_fontsize() for tick in ax.xaxis.get_major_ticks()} == {7.0}
    assert dict(matplotlib.rcParams) == before


def test_files_are_named_by_what_they_show_in_the_format_of_the_suffix(tmp_path):
    figures = {"-energy": stack([1.0])[0], "": stack([1.0])[0]}
    written = save_all(figures, tmp_path / "day.svg")
    assert [path.name for path in written] == ["day-energy.svg", "day.svg"]
    assert all(path.read_bytes().startswith(b"<?xml") for path in written)
    assert save(figures[""], tmp_path / "day.png").read_bytes().startswith(b"\x89PNG")
