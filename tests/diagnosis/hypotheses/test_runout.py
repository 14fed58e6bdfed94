"""Growth of the first sidebands: a law that holds, and what must not matter to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.diagnosis.hypotheses.turns import (
    PRIOR_DB,
    PRIOR_WORTH,
    SLOPE_DB,
    healthy_turns,
    runout_growth,
    turn_changes,
)
from gearmon.signatures.measured.reference import WheelPattern

TEETH = 20


def turn(*change_db, stage=1, gear="pinion"):
    return {(stage, gear): np.array(change_db, dtype=float)}


def log10(*change_db, **more):
    return runout_growth(turn(*change_db), **more)[0].log10_probability


def test_no_growth_is_nothing():
    assert runout_growth({}) == ()
    assert log10(0, 0, 0, 0, 0, 0) == pytest.approx(0.0)
    assert log10(-20, -20, 0, 0, 0, 0) == 0.0


@pytest.mark.parametrize(
    ("kind", "change"),
    [("eccentricity", (14, 3, 0, 0, 0, 0)), ("misalignment", (3, 14, 0, 0, 0, 0))],
)
def test_what_grew_names_the_kind(kind, change):
    sound, found = turn(1, 0, 0, 0, 0, 0, gear="gear"), turn(*change)
    first, second = runout_growth(sound | found)
    assert (first.gear, first.kind, second.gear) == ("pinion", kind, "gear")
    assert first.change_db == 14
    assert first.log10_probability < -3.3
    assert "+14.0 dB" in first.evidence[0]


def test_probabilities_are_those_of_students_law():
    """Ten degrees of freedom: t exceeds 4.144 with a probability of 0.1 %; two places."""
    assert log10(4.143700494 * PRIOR_DB, 0, 0, 0, 0, 0) == pytest.approx(np.log10(0.002), abs=1e-5)


@given(st.floats(-20, 20), st.floats(0, 30), st.floats(0, 30))
def test_what_all_sidebands_do_is_no_runout(common, once, more):
    plain = log10(once, 0, 0, 0, 0, 0)
    louder = log10(*(max(common, 0.0) + np.array([once, 0, 0, 0, 0, 0])))
    assert louder == pytest.approx(plain, abs=1e-9)
    assert log10(once + more, 0, 0, 0, 0, 0) <= plain + 1e-12


def test_references_that_scatter_more_ask_for_more():
    unsteady = [turn(8, 0, 0, 0, 0, 0), turn(-8, 0, 0, 0, 0, 0)]
    calm = [turn(0.1, 0, 0, 0, 0, 0), turn(-0.1, 0, 0, 0, 0, 0)]
    change = (12, 0, 0, 0, 0, 0)
    assert log10(*change, healthy=unsteady) > log10(*change) > log10(*change, healthy=calm)
    (found,) = runout_growth(turn(*change), unsteady)
    # contrasts +-8 and 0, of two recordings
    square = (PRIOR_WORTH * PRIOR_DB**2 + 2 * 32.0) / (PRIOR_WORTH + 2)
    assert found.sigma_db == pytest.approx(np.sqrt(square))


@pytest.mark.parametrize("gap", [0.05, 0.3])
def test_another_operating_point_adds_to_the_scatter_in_squares(gap):
    gaps, still = (0.0, gap, 2 * gap), turn(*6 * [0])
    here, near, far = (runout_growth(still, gap=own)[0].sigma_db for own in gaps)
    assert near**2 - here**2 == pytest.approx((SLOPE_DB * gap) ** 2)
    assert far**2 - here**2 == pytest.approx(4 * (near**2 - here**2))


def pattern(factor, seed=0):
    """Random sidebands, those once a turn away multiplied."""
    rng = np.random.default_rng(seed)
    number = np.arange(1, 6 * TEETH + 11)
    lines = rng.normal(size=(2, len(number))) + 1j * rng.normal(size=(2, len(number)))
    once = np.abs((number + TEETH // 2) % TEETH - TEETH // 2) == 1
    return WheelPattern(
        stage=1,
        gear="pinion",
        teeth=TEETH,
        order=1.0,
        number=number,
        mesh=number % TEETH == 0,
        amplitude=np.where(once, factor, 1.0) * lines,
        variance=np.full(lines.shape, 1e-9),
    )


def test_healthy_recordings_are_compared_with_one_another():
    assert healthy_turns([[pattern(1.0)]]) == ()
    told = healthy_turns([[pattern(1.0)], [pattern(2.0)]])
    assert [one[0] for own in told for one in own.values()] == pytest.approx(
        [-20 * np.log10(2), 20 * np.log10(2)], abs=1e-4
    )


def about(harmonic, wheel):
    """Whether lines belong to a mesh harmonic."""
    return np.abs(wheel.number - harmonic * TEETH) <= TEETH // 2 - 1


def test_what_a_mesh_harmonic_gains_comes_back_in_its_sidebands_and_is_no_growth():
    sound = pattern(1.0)
    heavy = np.where(about(3, sound), 2.0, 1.0)
    for factor, growth in ((heavy, 0.0), (np.where(sound.mesh, 1.0, heavy), 20 * np.log10(2) / 6)):
        louder = replace(sound, amplitude=factor * sound.amplitude)
        (grown,) = turn_changes([louder], [[sound]]).values()
        # of six harmonics in each channel
        np.testing.assert_allclose(grown, growth, atol=0.02)


def test_sidebands_count_by_how_well_they_are_known():
    """By 1/(scatter^2 + 1 dB^2); all lines are alike, but for the noise of one harmonic."""
    sound = replace(pattern(1.0), amplitude=np.ones((2, 6 * TEETH + 10), dtype=complex))
    noise, gain = 0.05, 2.0
    raised = about(2, sound) & ~sound.mesh
    sound = replace(sound, variance=np.where(raised, noise, 1e-9) * np.ones((2, 1)))
    louder = replace(sound, amplitude=np.where(raised, gain, 1.0) * sound.amplitude)
    (grown,) = turn_changes([louder], [[sound]]).values()
    squares = [2 * noise / (own**2 - noise) for own in (1.0, gain)]
    weight = 1 / ((10 / np.log(10)) ** 2 * sum(squares) + 1)
    change = 10 * np.log10((gain**2 - noise) / (1.0 - noise))
    np.testing.assert_allclose(grown, weight * change / (weight + 5), rtol=1e-3)


def test_harmonics_that_a_recording_lacks_are_not_compared():
    new, whole = pattern(2.0), pattern(1.0, seed=1)
    few = whole.number < 3 * TEETH + 7
    short = replace(
        whole,
        number=whole.number[few],
        mesh=whole.mesh[few],
        amplitude=whole.amplitude[:, few],
        variance=whole.variance[:, few],
    )
    (found,) = turn_changes([new], [[short]]).values()
    beyond = np.where(new.number < 3 * TEETH + 7, 1.0, 100.0)
    (other,) = turn_changes([replace(new, amplitude=new.amplitude * beyond)], [[short]]).values()
    assert found == pytest.approx(other)
    assert found != pytest.approx(turn_changes([new], [[whole]])[1, "pinion"])


def test_lines_below_the_noise_in_all_recordings_did_not_change():
    quiet = pattern(1e-9)
    once = np.abs((quiet.number + TEETH // 2) % TEETH - TEETH // 2) == 1
    # at these ten times the noise, and more of nothing
    louder = replace(quiet, variance=np.where(once, 1e-5, quiet.variance))
    known = replace(quiet, variance=np.where(once, 1e-6, quiet.variance))
    (found,) = turn_changes([louder], [[known]]).values()
    assert found == pytest.approx(np.zeros(6), abs=1e-6)


@pytest.mark.parametrize(("level", "noise", "told"), [(0.1, 1.0, False), (3.0, 0.05, True)])
def test_what_noise_drowns_has_not_risen_but_may_have_fallen(level, noise, told):
    """Of a line in the noise nothing is known but that it is no louder."""
    known = pattern(level)
    once = np.abs((known.number + TEETH // 2) % TEETH - TEETH // 2) == 1
    power = np.where(once, noise, 0.0)
    drowned = replace(
        known,
        amplitude=np.where(power > 0, np.sqrt(power), known.amplitude),
        variance=np.maximum(known.variance, power),
    )
    (found,) = turn_changes([drowned], [[known]]).values()
    assert bool(found[0] < -3.0) == told
    assert found[0] < 0.5


def test_every_gear_and_both_distances_are_places_to_look_at():
    gears = turn(12, 0, 0, 0, 0, 0)
    for number in range(3):
        gears |= turn(0, 0, 0, 0, 0, 0, gear=f"gear {number}")
    four = runout_growth(gears)[0].log10_probability
    assert four - log10(12, 0, 0, 0, 0, 0) == pytest.approx(np.log10(4))
