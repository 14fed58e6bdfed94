"""Features of a kind of fault: what must not matter does not, and shapes have known values."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon.diagnosis.fault_types import FEATURES, NAMES, kind_features
from gearmon.diagnosis.fault_types.kinds import focus_of, judge_kind
from gearmon.diagnosis.hypotheses.turns import turn_changes
from gearmon.errors import ArgumentError
from gearmon.signatures.measured.reference import WheelPattern, taken


@dataclass(frozen=True)
class Level:
    channel: str
    kind: str
    stage: int
    harmonic: int
    gear: str
    shaft: int | None
    change_db: float
    scatter_db: float = 2.0


def levels(change=lambda *_: 0.0, channels=("a", "b"), harmonics=6):
    """Changes of all families of two stages, pinion and gear each."""
    gears = {(1, "pinion"): 1, (1, "gear"): 2, (2, "pinion"): 2, (2, "gear"): 3}
    found = []
    for channel in channels:
        for k in range(1, harmonics + 1):
            for stage in (1, 2):
                moved = change("mesh", stage, "", k)
                found.append(Level(channel, "mesh", stage, k, "", None, moved))
            for (stage, gear), shaft in gears.items():
                for kind in ("sidebands", "residual"):
                    moved = change(kind, stage, gear, k)
                    found.append(Level(channel, kind, stage, k, gear, shaft, moved))
    return found


def ragged(seed=0):
    """Changes of different size in every family and channel."""
    random = np.random.default_rng(seed)
    return [replace(level, change_db=float(random.normal(0, 4))) for level in levels()]


def one_tooth(teeth, at, height=100.0):
    energy = np.ones(teeth)
    energy[at] = height
    return energy


def values(found):
    return np.array([[*row.values()] for row in found.values()])


def test_every_feature_is_described():
    assert len(set(NAMES)) == len(NAMES) == len(FEATURES)
    assert all(FEATURES.values())


def test_no_change_is_no_feature():
    found = kind_features(levels())
    assert [*found] == [(1, "gear"), (1, "pinion"), (2, "gear"), (2, "pinion")]
    assert not values(found).any()


def test_gain_of_a_channel_does_not_matter():
    plain = kind_features(ragged())
    louder = [
        replace(level, change_db=level.change_db + (60.0 if level.channel == "a" else -3.0))
        for level in ragged()
    ]
    assert np.allclose(values(kind_features(louder)), values(plain), atol=1e-9)


def test_exchange_and_names_of_channels_do_not_matter():
    other = {"a": "b", "b": "a"}
    exchanged = [replace(level, channel=other[level.channel]) for level in reversed(ragged())]
    plain = values(kind_features(ragged()))
    assert np.allclose(values(kind_features(exchanged)), plain, atol=1e-9)


def test_known_changes_come_back():
    def change(kind, stage, gear, k):
        if (kind, stage) == ("mesh", 1):
            return 3.0 + 2.0 * np.log2(k)
        return 7.0 if (kind, stage, gear) == ("residual", 1, "pinion") else 0.0

    found = kind_features(levels(change))
    row = found[1, "pinion"]
    assert focus_of(found) == (1, "pinion")
    assert row["far_db"] == pytest.approx(7.0)
    assert row["near_db"] == pytest.approx(0.0)
    assert row["mesh_first_db"] == pytest.approx(3.0)
    assert row["mesh_slope_db"] == pytest.approx(2.0)
    assert found[1, "gear"]["mate_far_db"] == pytest.approx(7.0)
    assert found[2, "gear"]["elsewhere_mesh_db"] == pytest.approx(row["mesh_rms_db"])


def test_the_overall_change_is_the_root_mean_square_of_all_families():
    """Of ten families about each harmonic one changed."""
    found = kind_features(levels(lambda *own: 4.0 if own[:2] == ("mesh", 1) else 0.0))
    for row in found.values():
        assert row["overall_db"] == pytest.approx(4.0 / np.sqrt(10.0))


def test_gears_on_one_shaft_know_of_each_other():
    def change(*family):
        return 5.0 if family[:3] == ("sidebands", 1, "gear") else 0.0

    found = kind_features(levels(change))
    assert found[2, "pinion"]["shaft_near_db"] == pytest.approx(5.0)
    assert found[2, "gear"]["shaft_near_db"] == 0.0


def test_one_tooth_is_one_peak():
    found = kind_features([], {(1, "pinion"): one_tooth(30, 4)})
    (row,) = found.values()
    assert row["peak_db"] == pytest.approx(20.0)
    assert row["second_db"] == pytest.approx(0.0)
    assert row["top_share"] == pytest.approx(1.0)
    assert row["teeth_involved"] == pytest.approx(0.0)
    assert row["peaks"] == 1
    assert row["turn_once"] == pytest.approx(1.0)


def test_two_opposite_teeth_are_two_peaks():
    energy = one_tooth(40, 3)
    energy[23] = 100.0
    (row,) = kind_features([], {(1, "pinion"): energy}).values()
    assert row["peaks"] == 2
    assert row["second_db"] == pytest.approx(20.0)
    assert row["top_share"] == pytest.approx(0.5)
    assert row["teeth_involved"] == pytest.approx(1.0)
    assert row["turn_once"] == pytest.approx(0.0, abs=1e-12)
    assert row["turn_twice"] == pytest.approx(1.0)


def test_what_speaks_for_a_kind_is_told_in_teeth_per_cent_and_decibels():
    """Two teeth of forty at 20 dB, half of the excess each; sidebands of a known size."""
    energy = one_tooth(40, 3)
    energy[23] = 100.0
    single = np.array([9.0, -1.0, 2.0, 3.0, 4.0, 5.0])
    found = kind_features(levels(), {(1, "gear"): energy}, sidebands={(1, "gear"): single})
    told = " ".join(judge_kind(found, gear=(1, "gear")).evidence)
    assert "is 20.0 dB above its median at its highest, 50 % of the excess within four" in told
    assert "(2 separate peaks, 2.0 teeth involved)" in told
    assert "changed by +9.0 dB one turn away from the mesh harmonics, -1.0 dB two turns" in told
    assert "+4.0 dB four to six turns, +0.0 dB farther away" in told


@pytest.mark.parametrize(("teeth", "apart"), [(40, 5), (40, -5), (12, 3), (12, -3)])
def test_peaks_stand_an_eighth_of_a_turn_and_three_teeth_apart(teeth, apart):
    for away, peaks, second_db in ((apart, 2, 18.0), (apart - np.sign(apart), 1, 0.0)):
        energy = one_tooth(teeth, 3)
        energy[3 + away] = 10**1.8
        (row,) = kind_features([], {(1, "pinion"): energy}).values()
        assert row["peaks"] == peaks
        assert row["second_db"] == pytest.approx(second_db)


def test_no_more_than_six_peaks_are_counted_and_only_of_half_the_height():
    energy = np.ones(80)
    energy[::10] = 100.0
    assert kind_features([], {(1, "pinion"): energy})[1, "pinion"]["peaks"] == 6
    energy[30:] = np.where(energy[30:] > 1.0, 49.0, 1.0)
    assert kind_features([], {(1, "pinion"): energy})[1, "pinion"]["peaks"] == 3


@given(st.integers(0, 29))
def test_which_tooth_it_is_does_not_matter(shift):
    energy = np.random.default_rng(2).exponential(size=30)
    plain = values(kind_features([], {(1, "gear"): energy}))
    turned = values(kind_features([], {(1, "gear"): np.roll(energy, shift)}))
    assert np.allclose(turned, plain, atol=1e-9)


@given(
    st.lists(st.floats(0, 1e12), min_size=1, max_size=60),
    st.lists(st.floats(-400, 400), min_size=1, max_size=20),
)
def test_features_are_finite_whatever_comes(energy, moved):
    changes = [
        Level("a", "mesh" if i % 3 else "sidebands", 1, 1 + i % 8, "" if i % 3 else "gear", 2, x)
        for i, x in enumerate(moved)
    ]
    found = kind_features(changes, {(1, "pinion"): np.array(energy)})
    assert np.isfinite(values(found)).all()


def test_turns_take_the_place_of_the_near_family():
    single = np.array([9.0, 1.0, 2.0, 3.0, 4.0, 5.0])
    row = kind_features(levels(), sidebands={(1, "gear"): single})[1, "gear"]
    assert (row["once_db"], row["twice_db"], row["thrice_db"]) == (9.0, 1.0, 2.0)
    assert row["several_db"] == pytest.approx(4.0)
    assert row["turns_known"] == 1.0


def test_mesh_alone_makes_a_row():
    only = [level for level in levels() if level.kind == "mesh"]
    assert [*kind_features(only)] == [(1, ""), (2, "")]


def test_nothing_to_look_at_is_said():
    with pytest.raises(ArgumentError, match="no change of level"):
        kind_features([])


def pattern(amplitude, teeth=20):
    number = np.arange(1, amplitude.shape[1] + 1)
    return WheelPattern(
        stage=1,
        gear="pinion",
        teeth=teeth,
        order=1.0,
        number=number,
        mesh=number % teeth == 0,
        amplitude=amplitude,
        variance=np.full(amplitude.shape, 1e-12),
    )


def of_pinion(new, old):
    return turn_changes(new, old)[1, "pinion"]


def random_lines(seed=0, lines=130, channels=2):
    random = np.random.default_rng(seed)
    return random.normal(size=(channels, lines)) + 1j * random.normal(size=(channels, lines))


def distance(lines=130, teeth=20):
    number = np.arange(1, lines + 1)
    return np.abs((number + teeth // 2) % teeth - teeth // 2)


def test_doubled_first_sidebands_are_six_decibels():
    old = random_lines()
    new = np.where(distance() == 1, 2.0, 1.0) * old
    (turn,) = turn_changes([pattern(new)], [[pattern(old)]]).values()
    assert turn[0] == pytest.approx(20 * np.log10(2), abs=1e-6)
    assert np.allclose(turn[1:], 0.0, atol=1e-6)


def test_sidebands_that_follow_their_mesh_have_not_grown():
    """As under a heavier load, or of worn teeth; of runout they grow and the mesh does not."""
    old = random_lines()
    louder = np.repeat(3.0 ** np.arange(1, 8), 20)[10:140][:130]  # another gain in each band
    worn = np.where(distance() <= 1, louder, 1.0) * old
    runs_out = np.where(distance() == 1, 2.0, 1.0) * worn
    changed = [of_pinion([pattern(new)], [[pattern(old)]])[0] for new in (worn, runs_out)]
    assert changed == pytest.approx([0.0, 20 * np.log10(2)], abs=1e-6)


@given(st.floats(-3, 3), st.floats(-3, 3))
def test_gains_do_not_matter_to_single_sidebands(one, two):
    old, factor = random_lines(), np.array([[10**one], [10**two]])
    new = np.where(distance() == 2, 3.0, 1.0) * old
    quiet = 1e-12 * np.ones(old.shape)
    plain = of_pinion([pattern(new)], [[pattern(old)]])
    louder = replace(pattern(factor * new), variance=np.abs(factor) ** 2 * quiet)
    scaled = of_pinion([louder], [[pattern(old)]])
    swapped = of_pinion([taken(louder, [1, 0])], [[taken(pattern(old), [1, 0])]])
    assert np.allclose(scaled, plain, atol=1e-4)
    assert np.allclose(swapped, scaled, atol=1e-9)


def test_lines_near_the_noise_do_not_tell_the_gain():
    old = random_lines()
    clear, first = distance() <= 3, distance() == 1
    new = np.where(clear, 2.0, 20.0) * np.where(first, 2.0, 1.0) * old
    noise = np.where(clear, 1e-6, 0.3)
    before, after = (replace(pattern(x), variance=noise * np.abs(x) ** 2) for x in (old, new))
    (turn,) = turn_changes([after], [[before]]).values()
    assert turn[:2] == pytest.approx([20 * np.log10(2), 0.0], abs=1e-3)


def test_gears_that_the_reference_lacks_are_left_out():
    new = pattern(random_lines())
    assert turn_changes([new], [[replace(new, gear="gear")]]) == {}


def test_means_weigh_each_change_by_its_scatter_and_one_decibel():
    """1 / (scatter^2 + 1 dB^2): 1/2 and 1/10 here; most changes are none, so no gain is taken."""
    still = [Level("a", "residual", 1, k, "pinion", 1, 0.0) for k in range(1, 6)]
    moved = [("pinion", 6.0, 1.0), ("pinion", 1.0, 3.0)]
    sides = [
        Level("a", "sidebands", 1, k, gear, 1, change, scatter)
        for k, (gear, change, scatter) in enumerate(moved, start=1)
    ]
    found = kind_features([*still, *sides])
    near = found[1, "pinion"]["near_db"]
    assert near == pytest.approx((6.0 / 2 + 1.0 / 10) / (1 / 2 + 1 / 10))


@pytest.mark.parametrize(
    ("more", "less"),
    [
        # a peak counts from 4 dB on, which sound teeth reach, mesh lines by half
        ({"peak_db": 5.1}, {"once_db": 1.0}),
        ({"once_db": 1.0}, {"peak_db": 4.9}),
        ({"mesh_rms_db": 2.2}, {"twice_db": 1.0}),
        ({"far_db": 1.0}, {"mesh_rms_db": 1.8}),
        # of sidebands the loudest counts, and none that fell
        ({"near_db": 3.0}, {"near_db": 2.0, "far_db": 2.0, "once_db": 2.0, "twice_db": 2.0}),
        ({"twice_db": 0.5}, {"once_db": -9.0}),
        ({"once_db": 2.0, "peak_db": 6.0, "mesh_rms_db": 2.0}, {"once_db": 4.9}),
    ],
)
def test_evidence_of_a_gear_is_its_sidebands_its_peak_and_half_its_mesh(more, less):
    quiet = dict.fromkeys(("near_db", "far_db", "once_db", "twice_db", "peak_db"), 0.0)
    quiet["mesh_rms_db"] = 0.0
    gears = {(1, "pinion"): quiet | less, (1, "gear"): quiet | more, (2, "pinion"): quiet}
    assert focus_of(gears) == (1, "gear")
    assert focus_of(dict(reversed(gears.items()))) == (1, "gear")
