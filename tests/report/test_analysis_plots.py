"""Pictures of an analysis: what is drawn is what was measured, and the words say the same."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gearmon.report.analysis_plots import (
    analysis_figures,
    changes_figure,
    family_groups,
    speed_figure,
    turn_figure,
)
from gearmon.report.curves import flagged_place, mark_label, mesh_marks, profile_of
from gearmon.report.plots import as_png
from gearmon.report.spectrum_plots import (
    amplitude_figure,
    close_up_figure,
    close_up_harmonic,
)
from gearmon.report.text import BEYOND


def texts(ax):
    return [text.get_text() for text in ax.texts]


def named(ax):
    return {line.get_label(): line for line in ax.lines}


def curve(ax):
    """The longest line: that of the spectrum."""
    return max(ax.lines, key=lambda line: len(line.get_xdata()))


def test_every_case_has_its_pictures(faulty, alone, gearless):
    def names(case):
        return [p.name for p in analysis_figures(case.analysis, case.recording)]

    assert names(faulty) == [
        "spectrum",
        "sidebands-mesh-1",
        "changes",
        "turn-1-pinion",
        "turn-1-gear",
        "speed",
    ]
    assert "changes" not in names(alone)
    shown = list(analysis_figures(gearless.analysis, gearless.recording))
    assert [p.name for p in shown] == ["spectrum", "searched-mesh-1"]
    assert "none was found" in shown[0].caption
    assert all(picture.alt and picture.caption and picture.heading for picture in shown)


# --- spectra ---------------------------------------------------------------------------------


def test_mesh_marks_stand_at_the_harmonics_of_the_estimated_speed(healthy):
    marks = mesh_marks(healthy.analysis.signature)
    expected = 23 * healthy.analysis.signature.speed.estimated_hz * np.arange(1, 9)
    assert np.allclose([mark.place for mark in marks], expected)
    assert mark_label(marks[1]) == "GMF1 ×2"


def test_without_a_mesh_the_searched_range_is_marked_about_the_nominal_speed(gearless):
    marks = mesh_marks(gearless.analysis.signature)
    assert marks[0].place == pytest.approx(23 * 20.0)
    (shaded, *_), *_ = (
        ax.patches for ax in amplitude_figure(gearless.analysis, gearless.recording).axes
    )
    assert shaded.get_width() == pytest.approx(2 * 0.03 * 23 * 20.0)


def test_harmonics_of_two_meshes_at_one_place_share_a_mark(healthy):
    signature = healthy.analysis.signature
    mesh = signature.meshes[0]
    twin = replace(mesh, stage=2, frequency_hz=2 * mesh.frequency_hz)
    labels = [mark_label(mark) for mark in mesh_marks(replace(signature, meshes=(mesh, twin)))]
    assert "GMF1 ×2\nGMF2 ×1" in labels
    assert len(labels) == 12


def test_the_spectrum_reads_the_amplitude_of_the_lines(healthy):
    figure = amplitude_figure(healthy.analysis, healthy.recording)
    front, rear = figure.axes
    for number, ax in enumerate((front, rear)):
        # at the first mesh harmonic, whose amplitude the lines of the signature have
        x, y = curve(ax).get_data()
        mesh_hz = healthy.analysis.signature.meshes[0].frequency_hz
        near = y[np.abs(x - mesh_hz) < 1.0].max()
        order = healthy.analysis.signature.plan.orders
        line = int(np.argmin(np.abs(order - 23)))
        power = healthy.analysis.signature.lines.cross_power()[number, line]
        assert near == pytest.approx(np.sqrt(power), rel=0.2)
        assert ax.get_yscale() == "log"
        assert x[-1] <= 2048.0
    high = f"{curve(front).get_ydata().max():.3g} m/s² at "
    assert f"front peaks with {high}" in figure.alt
    assert "resolution" in figure.caption
    marks = [mark_label(mark) for mark in mesh_marks(healthy.analysis.signature)]
    assert texts(front) == [label for label in marks if label in texts(front)] != []


def test_channels_are_found_by_name_where_not_all_were_analysed(healthy):
    signature = healthy.analysis.signature
    rear = replace(
        signature,
        channel_names=("rear",),
        units=signature.units[1:],
        level_db=signature.level_db[1:],
    )
    both = amplitude_figure(healthy.analysis, healthy.recording)
    (ax,) = amplitude_figure(replace(healthy.analysis, signature=rear), healthy.recording).axes
    assert np.array_equal(curve(ax).get_ydata(), curve(both.axes[1]).get_ydata())


def test_sidebands_of_a_close_up_stand_on_the_lines_of_the_spectrum(healthy):
    mesh = healthy.analysis.signature.meshes[0]
    figure = close_up_figure(healthy.analysis, healthy.recording, mesh)
    harmonic = int(figure.heading.split()[-1])
    ax = figure.axes[0]
    assert {"sidebands of shaft 1", "sidebands of shaft 2"} <= set(named(ax))
    x, y = named(ax)["sidebands of shaft 1"].get_data()
    speed = healthy.analysis.signature.speed.estimated_hz
    first = np.flatnonzero(np.abs(np.asarray(x) / speed - 23 * harmonic - 1) < 1e-9)
    assert len(first) == 1
    drawn_x, drawn_y = curve(ax).get_data()
    near = np.abs(drawn_x - x[first[0]]) < 0.3
    assert y[first[0]] == pytest.approx(drawn_y[near].max(), rel=0.3)
    assert "+1" in texts(ax)


def test_sidebands_of_a_close_up_are_counted_upwards_from_the_mesh(healthy):
    signature = healthy.analysis.signature
    (mesh,) = signature.meshes
    figure = close_up_figure(healthy.analysis, healthy.recording, mesh)
    harmonic = close_up_harmonic(healthy.analysis, 1)
    counted = {int(text.get_text().replace("−", "-")): text.xy[0] for text in figure.axes[0].texts}
    assert {-2, -1, 1, 2} <= set(counted)
    for number, place in counted.items():
        # the faster shaft is the farthest apart
        expected = harmonic * mesh.frequency_hz + number * signature.speed.estimated_hz
        assert place == pytest.approx(expected)


def test_without_a_mesh_the_close_up_shows_as_much_below_as_above_where_it_was_looked_for(gearless):
    signature = gearless.analysis.signature
    (mesh,) = signature.meshes
    (front, *_) = close_up_figure(gearless.analysis, gearless.recording, mesh).axes
    drawn = curve(front).get_xdata()
    (mark,) = mesh_marks(signature)[:1]
    # beyond what was searched, which is shaded
    assert drawn[0] < 0.96 * mark.place
    assert drawn[-1] > 1.04 * mark.place
    assert mark.place - drawn[0] == pytest.approx(drawn[-1] - mark.place, rel=0.02)


@pytest.mark.parametrize("change_db", [40, -40])
def test_the_close_up_shows_the_harmonic_whose_sidebands_changed(faulty, change_db):
    changes = [
        replace(change, level_db=change.reference_db + change_db * (change.harmonic == 3))
        for change in faulty.analysis.changes
    ]
    assert close_up_harmonic(replace(faulty.analysis, changes=tuple(changes)), 1) == 3


@pytest.mark.parametrize("harmonic", [1, 2, 3])
def test_a_close_up_shows_as_much_below_its_harmonic_as_above(faulty, harmonic):
    changes = [
        replace(change, level_db=change.reference_db + 40 * (change.harmonic == harmonic))
        for change in faulty.analysis.changes
    ]
    (mesh,) = faulty.analysis.signature.meshes
    shown = replace(faulty.analysis, changes=tuple(changes))
    figure = close_up_figure(shown, faulty.recording, mesh)
    assert figure.heading.endswith(f"harmonic {harmonic}")
    assert "because its sidebands changed most" in figure.caption
    others = tuple(change for change in changes if change.kind != "sidebands")
    assert others
    alone = close_up_figure(replace(shown, changes=others), faulty.recording, mesh)
    assert "because it is the strongest" in alone.caption
    for ax in figure.axes:
        drawn, place = curve(ax).get_xdata(), harmonic * mesh.frequency_hz
        assert place - drawn[0] == pytest.approx(drawn[-1] - place, rel=0.01)


def test_numbers_in_the_words_of_pictures_are_those_of_the_recording(faulty):
    """It turns at 19.9 Hz throughout, nominal are 20; its pinion has 23 teeth."""
    shown = {own.name: own for own in analysis_figures(faulty.analysis, faulty.recording)}
    peaks = re.findall(r"(\w+) peaks with (\S+) .*? at (\S+) Hz", shown["spectrum"].alt)
    assert [name for name, *_ in peaks] == ["front", "rear"]
    for ax, (_, height, hertz) in zip(shown["spectrum"].axes, peaks, strict=True):
        place, values = curve(ax).get_data()
        assert float(height) == pytest.approx(values.max(), rel=5e-3)
        assert float(hertz) == pytest.approx(place[np.argmax(values)], abs=0.0501)
    close = shown["sidebands-mesh-1"]
    harmonic, hertz = re.search(r"harmonic (\d) of mesh 1 at (\S+) Hz", close.alt).groups()
    assert float(hertz) == pytest.approx(int(harmonic) * 23 * 19.9, abs=0.1)
    assert ": −0.50 % from nominal, wandering over 0.0" in shown["speed"].caption
    low, high, mean, nominal = re.findall(r"\d+\.?\d*", shown["speed"].alt.split("shaft 1")[1])
    assert [float(own) for own in (low, high, mean)] == pytest.approx([19.9] * 3, rel=2e-3)
    assert float(nominal) == 20.0
    change = max(faulty.analysis.changes, key=lambda own: abs(own.standardised))
    assert shown["changes"].alt.endswith(
        f"; the clearest is {change.family} in {change.channel}: {change.change_db:+.1f} dB, "
        f"{abs(change.standardised):.1f} standard deviations."
    )


# --- levels ----------------------------------------------------------------------------------


def test_groups_hold_every_family_once(healthy):
    families = healthy.analysis.signature.plan.families
    groups = family_groups(families)
    held = [family.name for _, _, own in groups for family in own]
    assert sorted(held) == sorted(family.name for family in families)
    assert groups[0][:2] == (1, "mesh 1")
    for _, _, own in groups:
        assert [family.harmonic for family in own] == sorted(family.harmonic for family in own)


@pytest.mark.parametrize("times", [1, 4, 10, 16])
def test_numbers_of_many_harmonics_stand_apart(faulty, times):
    """As of a slow mesh, of which up to 128 harmonics are looked at."""
    signature = faulty.analysis.signature
    top = max(own.harmonic for own in signature.plan.families)
    families = tuple(
        replace(own, harmonic=own.harmonic + n * top)
        for own in signature.plan.families
        for n in range(times)
    )
    slow = replace(signature, plan=replace(signature.plan, families=families))
    figure = changes_figure(replace(faulty.analysis, signature=slow))
    figure.canvas.draw()
    for ax in figure.axes[:-1]:
        shown = [label.get_window_extent() for label in ax.get_xticklabels()]
        assert len(shown) > 6
        assert all(one.x1 < other.x0 for one, other in pairwise(shown))


def test_changes_are_coloured_symmetrically_and_framed_beyond_scatter(faulty):
    ax, scale = changes_figure(faulty.analysis).axes
    (image,) = ax.images
    low, high = image.get_clim()
    assert low == -high
    assert 6 <= high <= 20
    shown = np.sort(image.get_array().compressed())
    assert np.allclose(shown, np.sort([c.change_db for c in faulty.analysis.changes]))
    assert len(ax.patches) == sum(abs(c.standardised) > BEYOND for c in faulty.analysis.changes)
    assert {"front", "rear"} <= set(texts(ax))
    assert scale.get_ylabel() == "Change (dB)"
    # every change stands in the block of its channel and the row of its family
    groups = [label.get_text() for label in ax.get_yticklabels()]
    change = next(c for c in faulty.analysis.changes if c.kind == "mesh" and c.channel == "rear")
    harmonics = image.get_array().shape[1] // 2
    column = harmonics + change.harmonic - 1
    assert image.get_array()[groups.index("mesh 1"), column] == pytest.approx(change.change_db)


def test_rows_of_changes_are_named_by_what_repeats(faulty):
    """Every family stands in a row of its kind and shaft, those of a mesh first."""
    ax, _ = changes_figure(faulty.analysis).axes
    names = {
        f"mesh {own.stage}" if own.kind == "mesh" else f"{own.kind}, shaft {own.shaft}"
        for own in faulty.analysis.signature.plan.families
    }
    groups = [label.get_text() for label in ax.get_yticklabels()]
    assert set(groups) == names
    assert len(groups) == len(names)
    assert groups[0] == "mesh 1"
    table = ax.images[0].get_array()
    harmonics = table.shape[1] // 2
    for change in faulty.analysis.changes:
        kind = "mesh 1" if change.kind == "mesh" else f"{change.kind}, shaft {change.shaft}"
        block = ["front", "rear"].index(change.channel)
        cell = table[groups.index(kind), block * harmonics + change.harmonic - 1]
        assert cell == pytest.approx(change.change_db)


# --- the turn of a gear, and the speed -------------------------------------------------------


def pinion(case):
    return next(w for w in case.analysis.signature.plan.wheels if w.gear == "pinion")


def test_the_burst_shows_at_the_tooth_where_it_was_put(faulty):
    profile = profile_of(faulty.analysis, 1, "pinion")
    place = flagged_place(faulty.analysis, 1, "pinion")
    # the ring-down, about a tooth long, begins a quarter of 23 mesh periods after the angle zero
    assert place == pytest.approx(23 * 0.25 + 0.2, abs=1.5)
    assert round(place) == profile.tooth
    figure = turn_figure(faulty.analysis, pinion(faulty))
    tooth, rest = named(figure.axes[0])["the same without mesh harmonics"].get_data()
    assert tooth[np.argmax(np.abs(rest))] == pytest.approx(place, abs=1.5)
    teeth = figure.axes[-1]
    bars = [patch for patch in teeth.patches if patch.get_height() in profile.energy]
    assert len({bar.get_facecolor() for bar in bars}) == 2
    highest = max(bars, key=lambda bar: bar.get_height())
    assert highest.get_x() + 0.4 == pytest.approx(place, abs=1)
    assert f"tooth {profile.tooth}: " in texts(teeth)[0]
    assert "(flagged)" in texts(teeth)[0]
    # one bar has a colour of its own, that of the tooth flagged, and its words stand above it
    colours = [bar.get_facecolor() for bar in bars]
    (flagged,) = (bar for bar in bars if colours.count(bar.get_facecolor()) == 1)
    middle = flagged.get_x() + 0.4
    assert middle == pytest.approx(place, abs=0.5)
    (said,) = (own for own in teeth.texts if "(flagged)" in own.get_text())
    assert said.xy[0] == pytest.approx(middle)
    assert f"highest at place {round(place)} of 23" in figure.alt


def test_a_turn_is_drawn_from_half_a_tooth_before_the_first(healthy):
    ax = turn_figure(healthy.analysis, pinion(healthy)).axes[0]
    tooth = ax.lines[0].get_xdata()
    assert np.all(np.diff(tooth) > 0)
    assert tooth[0] >= 0.5
    assert tooth[-1] < 23.5
    assert flagged_place(healthy.analysis, 1, "pinion") is None


@pytest.mark.parametrize(
    ("tooth", "counted_from", "words"),
    [
        (5, "tacho", "tachometer pulse"),
        (5, "reference", "first healthy recording"),
        (None, None, "relative"),
    ],
)
def test_teeth_are_numbered_honestly(healthy, tooth, counted_from, words):
    profiles = [
        replace(p, tooth=tooth, counted_from=counted_from) for p in healthy.analysis.profiles
    ]
    analysis = replace(healthy.analysis, profiles=tuple(profiles))
    ax = turn_figure(analysis, pinion(healthy)).axes[-1]
    assert words in ax.get_xlabel()
    assert list(ax.get_xticks()) == list(range(1, 24))


def test_teeth_counted_from_the_reference_keep_their_number(faulty):
    own = profile_of(faulty.analysis, 1, "pinion")
    moved = replace(own, tooth=9, counted_from="reference")
    analysis = replace(faulty.analysis, profiles=(moved,))
    ax = turn_figure(analysis, pinion(faulty)).axes[-1]
    assert "tooth 9: " in texts(ax)[0]
    highest = max(ax.patches, key=lambda bar: bar.get_height())
    assert highest.get_x() + 0.4 == pytest.approx(9, abs=1)


def test_speed_is_within_the_range_that_the_analysis_states(healthy):
    figure = speed_figure(healthy.analysis)
    (ax,) = figure.axes
    speed = healthy.analysis.signature.speed
    drawn = named(ax)["speed, by tacho"].get_ydata()
    assert (drawn.min(), drawn.max()) == (speed.lowest_hz, speed.highest_hz)
    assert "nominal 20 Hz" in named(ax)
    assert speed.uncertainty_hz > 0
    (band,) = ax.patches
    low, high = speed.estimated_hz - speed.uncertainty_hz, speed.estimated_hz + speed.uncertainty_hz
    ends = band.get_extents().transformed(ax.transData.inverted())
    assert (ends.y0, ends.y1) == pytest.approx((low, high), abs=1e-3 * (high - low))


def test_the_tooth_that_is_named_without_a_flag_is_the_highest_bar(healthy):
    ax = turn_figure(healthy.analysis, pinion(healthy)).axes[-1]
    (said,) = [text.get_text() for text in ax.texts]
    highest = max(ax.patches, key=lambda bar: bar.get_height())
    number = round(highest.get_x() + 0.5 * highest.get_width())
    assert said == f"tooth {number}: {highest.get_height():.1f} × elsewhere (highest, not flagged)"


@pytest.mark.parametrize("place", [0.0, 0.5, 0.62, 1.0])
def test_words_at_the_highest_tooth_stand_within_the_picture(healthy, place):
    gear = pinion(healthy)
    energy = np.ones(gear.teeth)
    energy[round(place * (gear.teeth - 1))] = 30.0
    profiles = [
        replace(own, energy=energy) if own.gear == gear.gear else own
        for own in healthy.analysis.profiles
    ]
    figure = turn_figure(replace(healthy.analysis, profiles=tuple(profiles)), gear)
    as_png(figure)
    (words,) = figure.axes[-1].texts
    box, room = words.get_window_extent(), figure.axes[-1].get_window_extent()
    assert room.x0 <= box.x0 < box.x1 <= room.x1


def test_what_is_called_without_mesh_harmonics_has_none_and_the_average_has(faulty):
    gear = pinion(faulty)
    for ax in turn_figure(faulty.analysis, gear).axes[:-1]:
        drawn = (
            named(ax)[own] for own in ("synchronous average", "the same without mesh harmonics")
        )
        whole, rest = (np.abs(np.fft.rfft(own.get_ydata()))[gear.teeth] for own in drawn)
        assert rest < 1e-6 * whole
