from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gearmon.report.level_views import (
    BEYOND,
    change_views,
    family_groups,
    level_views,
    pattern_views,
)
from gearmon.report.spectrum_views import (
    close_up_harmonic,
    close_up_views,
    mesh_marks,
    spectrum_views,
    vibration_of,
)
from gearmon.report.turn_views import flagged_place, speed_view, teeth_view, turn_views


def test_mesh_marks_stand_at_the_harmonics_of_the_estimated_speed(healthy):
    marks = mesh_marks(healthy.analysis.signature)
    expected = 23 * healthy.analysis.signature.speed.estimated_hz * np.arange(1, 9)
    assert np.allclose([mark.frequency_hz for mark in marks], expected)
    assert marks[1].label == "GMF1 ×2"
    assert all(mark.half_width_hz == 0 for mark in marks)


def test_without_a_mesh_the_searched_range_is_marked_about_the_nominal_speed(gearless):
    marks = mesh_marks(gearless.analysis.signature)
    assert marks[0].frequency_hz == pytest.approx(23 * 20.0)
    assert marks[2].half_width_hz == pytest.approx(0.03 * 3 * 23 * 20.0)


def test_harmonics_of_two_meshes_at_one_place_share_a_mark(healthy):
    signature = healthy.analysis.signature
    mesh = signature.meshes[0]
    twin = replace(mesh, stage=2, frequency_hz=2 * mesh.frequency_hz)
    labels = [mark.label for mark in mesh_marks(replace(signature, meshes=(mesh, twin)))]
    assert "GMF1 ×2\nGMF2 ×1" in labels
    assert len(labels) == 12


def test_the_spectrum_ends_at_the_nyquist_frequency_or_says_that_it_does_not(healthy):
    views, remark = spectrum_views(healthy.analysis, healthy.recording)
    assert [view.channel for view in views] == ["front", "rear"]
    assert [view.unit for view in views] == ["m/s²", "unit not stated"]
    assert views[0].frequency_hz[-1] <= 2048.0
    assert "resolution" in remark


def test_channels_are_found_by_name_where_not_all_were_analysed(healthy):
    signature = replace(healthy.analysis.signature, channel_names=("rear",))
    chosen = vibration_of(replace(healthy.analysis, signature=signature), healthy.recording)
    assert np.array_equal(chosen.samples, healthy.recording.samples[1:2])


def test_sidebands_of_a_close_up_stand_on_the_lines_of_the_spectrum(healthy):
    mesh = healthy.analysis.signature.meshes[0]
    views, harmonic = close_up_views(healthy.analysis, healthy.recording, mesh)
    speed = healthy.analysis.signature.speed.estimated_hz
    first = [
        m for m in views[0].sidebands if abs(m.frequency_hz / speed - 23 * harmonic - 1) < 1e-9
    ]
    assert first[0].label == "+1"
    near = np.abs(views[0].frequency_hz - first[0].frequency_hz) < 0.3
    assert first[0].amplitude == pytest.approx(views[0].amplitude[near].max(), rel=0.3)


def test_the_close_up_shows_the_harmonic_whose_sidebands_changed(faulty):
    changes = [
        replace(change, level_db=change.reference_db + (40 if change.harmonic == 3 else 0))
        for change in faulty.analysis.changes
    ]
    assert close_up_harmonic(replace(faulty.analysis, changes=tuple(changes)), 1) == 3


def test_groups_hold_every_family_once(healthy):
    families = healthy.analysis.signature.plan.families
    groups = family_groups(families)
    columns = [column for group in groups for column in group.columns]
    assert sorted(columns) == list(range(len(families)))
    assert groups[0].label == "mesh 1"
    for group in groups:
        assert [families[c].harmonic for c in group.columns] == list(group.harmonics)


def test_levels_carry_the_range_of_the_reference_and_the_changes(faulty):
    view = level_views(faulty.analysis, faulty.reference)[1]
    column = faulty.reference.family_names.index("mesh 1 harmonic 1")
    own = [f.name for f in faulty.analysis.signature.plan.families].index("mesh 1 harmonic 1")
    levels = faulty.reference.level_db[:, 1, column]
    assert (view.low_db[own], view.high_db[own]) == (levels.min(), levels.max())
    beyond = sum(
        abs(c.standardised) > BEYOND for c in faulty.analysis.changes if c.channel == "rear"
    )
    assert view.beyond.sum() == beyond > 0


def test_without_a_reference_levels_have_no_range(alone):
    view = level_views(alone.analysis, None)[0]
    assert np.isnan(view.low_db).all()
    assert np.isnan(view.expected_db).all()
    assert not view.beyond.any()
    assert change_views(alone.analysis) == []


def test_the_table_of_changes_holds_every_change(faulty):
    (view,) = change_views(faulty.analysis)
    shown = np.sort(view.change_db[np.isfinite(view.change_db)])
    assert np.allclose(shown, np.sort([c.change_db for c in faulty.analysis.changes]))
    assert view.channels == ("front", "rear")


def test_patterns_are_relative_to_their_strongest_harmonic(alone):
    (view,) = pattern_views(alone.analysis)
    assert view.expected_db.max() == 0.0
    assert np.allclose(np.nanmax(view.measured_db, axis=1), 0.0)
    assert view.frequency_hz[0] == alone.analysis.signature.meshes[0].frequency_hz


def test_the_burst_shows_at_the_tooth_where_it_was_put(faulty):
    wheel = next(w for w in faulty.analysis.signature.plan.wheels if w.gear == "pinion")
    profile = next(p for p in faulty.analysis.profiles if p.gear == "pinion")
    place = flagged_place(faulty.analysis, 1, "pinion")
    # the ring-down, about a tooth long, begins a quarter of 23 mesh periods after the angle zero
    assert place == pytest.approx(23 * 0.25 + 0.2, abs=1.5)
    assert round(place) == profile.tooth
    view = turn_views(faulty.analysis, wheel)[0]
    loudest = view.tooth[np.argmax(np.abs(view.rest))]
    assert loudest == pytest.approx(place, abs=1.5)
    teeth = teeth_view(faulty.analysis, profile)
    assert teeth.numbered
    assert (teeth.flagged, teeth.place) == (True, place)
    assert teeth.number[np.argmax(teeth.energy)] == pytest.approx(place, abs=1)


def test_a_turn_is_drawn_from_half_a_tooth_before_the_first(healthy):
    wheel = healthy.analysis.signature.plan.wheels[0]
    view = turn_views(healthy.analysis, wheel)[0]
    assert np.all(np.diff(view.tooth) > 0)
    assert view.tooth[0] >= 0.5
    assert view.tooth[-1] < wheel.teeth + 0.5
    assert view.flagged is None


def test_speed_is_within_the_range_that_the_analysis_states(healthy):
    view = speed_view(healthy.analysis)
    speed = healthy.analysis.signature.speed
    assert (view.speed_hz.min(), view.speed_hz.max()) == (speed.lowest_hz, speed.highest_hz)
