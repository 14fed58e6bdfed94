"""A mesh is found where there is one, and not in noise, shaft lines or tones of another origin."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from reference.synthetic_signals import constant_track, lines_on, wandering_turns, white

from gearmon.signals.orders import InAngle, fine_order_spectrum
from gearmon.signals.tracking import MeshComb, MeshEvidence, SpeedScan, mesh_evidence
from gearmon.signals.tracking.mesh_detection import _Lines, _rivals, combined_comb, sideband_spacing

RATE, NOMINAL, DURATION = 4000.0, 25.0, 6.0
TIME = np.arange(int(DURATION * RATE)) / RATE


def parallel(pinion, gear, order=1.0, harmonics=8):
    """The mesh of a pair whose pinion turns at `order`."""
    mesh = pinion * order
    return MeshComb(
        order=mesh,
        groups=tuple((mesh * k,) for k in range(1, harmonics + 1)),
        spacings=(order, mesh / gear),
    )


def evidence(samples, meshes, shafts, nominal=NOMINAL):
    comb = combined_comb(meshes, shafts)
    scan = SpeedScan(samples, RATE, comb, nominal, block_s=30 / nominal)
    return mesh_evidence(scan, meshes, shafts)


def pair(pinion, gear):
    return [parallel(pinion, gear)], [1.0, pinion / gear]


def test_comb_joins_meshes_sidebands_and_shafts_once_each():
    comb = combined_comb([parallel(20, 40, harmonics=2)], [1.0, 0.5])
    weights = dict(zip(comb.orders.tolist(), comb.weights.tolist(), strict=True))
    assert list(weights) == sorted(weights)
    assert weights[20.0] == weights[40.0] == 1.0
    assert weights[21.0] == weights[19.5] == 0.4
    assert [weights[n] for n in (1.0, 8.0, 0.5, 1.5)] == [0.3] * 4
    assert 9.0 not in weights


def test_larger_weight_wins_where_lines_coincide():
    # the eighth shaft harmonic is the mesh of a pinion with eight teeth
    comb = combined_comb([parallel(8, 42, harmonics=2)], [1.0, 8 / 42])
    assert comb.weights[comb.orders == 8.0] == 1.0


def test_shifted_mesh_moves_each_harmonic_by_its_multiple():
    mesh = MeshComb(order=10.0, groups=((9.0, 10.0), (20.0,)), spacings=(1.0,))
    moved = mesh.shifted(-1.5)
    assert moved.order == 8.5
    assert moved.groups == ((7.5, 8.5), (17.0,))
    assert moved.spacings == mesh.spacings


@pytest.mark.parametrize(
    ("score", "above", "decoys", "clear", "expected"),
    [
        (3.0, 0, 50, 1, True),
        (2.9, 0, 50, 1, False),
        (2.1, 0, 50, 2, True),  # of two clear harmonics less is asked
        (1.9, 0, 50, 2, False),
        (9.0, 6, 50, 3, False),
        (9.0, 5, 50, 3, True),
    ],
)
def test_standing_out_means_far_from_and_above_the_decoys(score, above, decoys, clear, expected):
    seen = MeshEvidence(score=score, decoys_above=above, decoys=decoys, clear=clear, visible=8)
    assert seen.stands_out is expected


def test_what_cannot_be_judged_does_not_stand_out():
    assert not MeshEvidence(decoys_above=40, decoys=40).stands_out


def test_of_many_harmonics_more_have_to_be_clear():
    """Two of sixty are by chance: noise showed slow meshes in two of twenty-three recordings."""
    shown = {"score": 2.5, "decoys_above": 0, "decoys": 40}
    assert MeshEvidence(**shown, clear=2, visible=8).stands_out
    assert not MeshEvidence(**shown, clear=2, visible=60).stands_out
    assert MeshEvidence(**shown, clear=10, visible=60).stands_out


def test_noise_has_no_mesh():
    # 60 recordings, tooth counts at random; a law of 0.1 % would give none, 5 % three
    generator = np.random.default_rng(0)
    false = 0
    for seed in range(60):
        pinion, gear = generator.integers(13, 50), generator.integers(50, 100)
        samples = white((1, len(TIME)), seed=seed)
        false += evidence(samples, *pair(int(pinion), int(gear)))[0].stands_out
    assert false <= 1


@pytest.mark.parametrize("seed", range(8))
def test_shaft_harmonics_alone_are_no_mesh(seed):
    # a loose machine: forty harmonics of shaft 1, with resonances, 10 dB and more above the noise
    generator = np.random.default_rng(seed)
    turns = wandering_turns(TIME, NOMINAL * generator.uniform(0.975, 1.025), 0.002, seed)
    levels = generator.lognormal(0.0, 0.7, 40)
    samples = lines_on(turns, np.arange(1, 41), levels, generator.uniform(0, 6.28, 40))
    samples += white(samples.shape, seed=seed)
    pinion, gear = (int(teeth) for teeth in generator.integers(13, 45, 2))
    assert not evidence(samples, *pair(pinion, gear))[0].stands_out


def seen_at(level, seed):
    """Evidence of a mesh whose first harmonics are lines of this amplitude in unit noise."""
    generator = np.random.default_rng(seed)
    gear = int(generator.integers(30, 80))
    turns = wandering_turns(TIME, NOMINAL * generator.uniform(0.975, 1.025), 0.001, seed)
    orders = [23.0 * k + r for k in (1, 2, 3) for r in (-1, 0, 1)] + [1.0]
    levels = level * np.array([0.2, 1, 0.2] * 3 + [0.5])
    phases = generator.uniform(0, 6.28, len(orders))
    samples = lines_on(turns, orders, levels, phases) + white((1, len(TIME)), seed=seed)
    return evidence(samples, *pair(23, gear))[0]


@pytest.mark.parametrize("seed", range(8))
def test_mesh_well_above_the_noise_is_found(seed):
    # 0.4 in unit noise: 21 dB over the floor of one block of 1.2 s
    assert seen_at(0.4, seed).stands_out


def test_weak_mesh_is_found_more_often_than_not():
    # 0.13: 11 dB over the floor of one block, for three lines
    assert sum(seen_at(0.13, seed).stands_out for seed in range(10)) > 5


def test_scale_does_not_matter():
    turns = 24.8 * TIME
    samples = lines_on(turns, [23.0, 46.0, 69.0], 0.3) + white((1, len(TIME)), seed=1)
    one = evidence(samples, *pair(23, 61))[0]
    other = evidence(1e5 * samples, *pair(23, 61))[0]
    assert other.score == pytest.approx(one.score, rel=1e-6)


def test_other_tooth_counts_than_the_true_one_are_not_found():
    turns = 24.8 * TIME
    orders = [27.0 * k + r for k in (1, 2, 3) for r in (-1, 0, 1)] + [1.0, 2.0]
    samples = lines_on(turns, orders, 0.5) + white((1, len(TIME)), seed=2)
    assert evidence(samples, *pair(27, 61))[0].stands_out
    for teeth in (19, 23, 31, 35):
        assert not evidence(samples, *pair(teeth, 61))[0].stands_out


def test_meshes_of_two_stages_are_found_together():
    meshes = [parallel(26, 53), parallel(23, 61, order=26 / 53)]
    shafts = [1.0, 26 / 53, 26 / 53 * 23 / 61]
    turns = wandering_turns(TIME, 24.7, 0.001, 3)
    orders = [k * mesh.order for mesh in meshes for k in (1, 2, 3)]
    samples = lines_on(turns, [*orders, 1.0, 25.0, 27.0], 0.4) + white((1, len(TIME)), seed=3)
    assert [seen.stands_out for seen in evidence(samples, meshes, shafts)] == [True, True]


def test_nothing_to_compare_with_is_not_found():
    # a mesh above half the sampling rate
    samples = white((1, len(TIME)), seed=4)
    seen = evidence(samples, [parallel(97, 101)], [1.0, 97 / 101])[0]
    assert not seen.stands_out
    assert seen.score == 0.0


def test_mesh_near_half_the_sampling_rate_can_be_judged():
    # decoys with more teeth lie beyond the spectrum
    samples = white((1, len(TIME)), seed=5)
    assert np.isfinite(evidence(samples, *pair(60, 61))[0].score)


def spectrum_of(orders, levels, seed=0, duration=10.0):
    time = np.arange(int(duration * RATE)) / RATE
    samples = lines_on(NOMINAL * time, orders, levels) + white((1, len(time)), seed=seed)
    return fine_order_spectrum(InAngle.of(samples, RATE, constant_track(NOMINAL, time[-1])))


SIDES = (-2, -1, 0, 1, 2)


def test_sidebands_in_their_places_are_no_mismatch():
    orders = [23.0 * k + r for k in (1, 2, 3) for r in SIDES]
    spectrum = spectrum_of(orders, 0.3)
    excess = sideband_spacing(spectrum, parallel(23, 61), 1.0, 0.03).excess
    assert excess == 0.0


@pytest.mark.parametrize("departure", [-0.02, 0.015])
def test_sidebands_of_another_rotation_are_a_mismatch(departure):
    orders = [23.0 * k + r * (1 + departure) for k in (1, 2, 3) for r in SIDES]
    spectrum = spectrum_of(orders, 0.3)
    told = sideband_spacing(spectrum, parallel(23, 61), 1.0, 0.03)
    assert told.excess > 3.0
    assert told.departure == pytest.approx(departure, abs=1.5e-3)


@pytest.mark.parametrize("seed", range(5))
def test_no_sidebands_are_no_mismatch(seed):
    spectrum = spectrum_of([23.0, 46.0, 69.0], 0.3, seed)
    excess = sideband_spacing(spectrum, parallel(23, 61), 1.0, 0.03).excess
    assert excess < 2.0


def test_noise_hardly_ever_tells_another_spacing():
    # of so many spacings one always looks best, 3 deviations above the others one time in six
    told = [
        sideband_spacing(spectrum_of([56.0], 0.3, seed), parallel(56, 59), own, 0.03)
        for seed in range(30)
        for own in (1.0, 56 / 59)
    ]
    assert sum(one.excess > 0 for one in told) <= 3


def test_faint_sidebands_tell_another_tooth_count_sooner_than_anything_else():
    def told(ratio):
        orders = [26.0 * k + r * ratio for k in (1, 2) for r in SIDES]
        levels = [0.02 if order % 26 else 0.3 for order in orders]
        spectra = (spectrum_of(orders, levels, seed) for seed in range(20))
        found = [sideband_spacing(own, parallel(26, 61), 1.0, 0.05) for own in spectra]
        return sum(abs(one.departure - (ratio - 1)) < 2e-3 for one in found)

    assert told(26 / 27) >= 12
    assert told(26 / 26.5) <= 6


def test_sidebands_of_the_other_gear_are_no_mismatch():
    # a ratio near two, and sidebands of the slow gear only
    orders = [26.0 * k + r * 26 / 53 for k in (1, 2, 3) for r in (-4, *SIDES, 4)]
    spectrum = spectrum_of(orders, 0.3)
    excess = sideband_spacing(spectrum, parallel(26, 53), 1.0, 0.03).excess
    assert excess == 0.0


def test_a_far_sideband_of_the_other_gear_is_no_mismatch():
    # each fifth turn of the gear stands 5.9 % beside the pinion's
    orders = [25.0 * k + r * 5 * 25 / 118 for k in (1, 2, 3) for r in SIDES]
    told = sideband_spacing(spectrum_of(orders, 0.3), parallel(25, 118), 1.0, 0.25)
    assert told.excess == 0.0


def test_lines_of_another_mesh_are_no_mismatch():
    # its sixth, twelfth ... harmonic stands 1.12 orders below every second of this one
    orders = [14.0 * k for k in range(1, 9)] + [4.48 * k for k in range(1, 26)]
    sides = [14.0 * k + r for k in (1, 2) for r in (-1, 1)]
    spectrum = spectrum_of([*orders, *sides], [*len(orders) * [0.3], *len(sides) * [0.05]])
    told = [
        sideband_spacing(spectrum, replace(parallel(14, 45), meshing=meshing), 1.0, 0.25)
        for meshing in ((), (4.48,))
    ]
    assert told[0].departure == pytest.approx(0.12, abs=2e-3)
    assert told[1].excess == 0.0


def test_spectrum_without_any_spread_is_no_mismatch():
    spectrum = SimpleNamespace(quality=np.zeros(10_000), step=0.01)
    told = sideband_spacing(spectrum, parallel(23, 61), 1.0, 0.03)
    assert (told.excess, told.departure) == (0.0, 0.0)


def test_bins_are_averaged_so_that_a_line_counts_by_its_power_however_it_is_spread():
    heights = []
    for spread in (1, 2, 4):
        snr = np.zeros(400)
        snr[200 : 200 + spread] = 80.0 / spread
        lines = _Lines(np.log1p(snr), SimpleNamespace(step=0.01, width=0.02), 4)
        heights.append(lines.at(np.array([2.0])))
    np.testing.assert_allclose(heights, np.log1p(80.0 / 4), rtol=1e-12)


def test_a_mesh_with_few_decoys_in_the_band_is_not_judged():
    # decoys of fewer teeth begin at order 3, those of more lie beyond the 11 orders of the band
    rate, mesh = 2 * 11.5 * NOMINAL, MeshComb(order=10.0, groups=((10.0,),), spacings=(1.0,))
    samples = lines_on(NOMINAL * np.arange(int(rate * DURATION)) / rate, 10.0, 1.0)
    scan = SpeedScan(samples, rate, combined_comb([mesh], [1.0]), NOMINAL)
    (found,) = mesh_evidence(scan, [mesh], [1.0])
    assert found.decoys < 8
    assert (found.visible, found.clear, found.decoys_above) == (0, 0, found.decoys)
    assert not found.stands_out


@pytest.mark.parametrize("averaged", [1, 4])
def test_what_is_usual_is_told_by_the_noise_however_high_lines_stand_in_it(averaged):
    """One bin in two hundred is a line's; it stands above what is usual by its own height."""
    quality = np.random.default_rng(2).exponential(size=20_000)
    lines, spectrum = quality.copy(), SimpleNamespace(step=0.01, width=0.02)
    lines[::200] += 12.0
    bare, full = (_Lines(own, spectrum, averaged) for own in (quality, lines))
    assert full.usual == pytest.approx(bare.usual, rel=0.02)
    assert np.all(full.at(spectrum.step * np.arange(200, 20_000, 200)) > bare.usual + 8.0)


@pytest.mark.parametrize("spacing", [0.2, 1.0, 3.7])
@pytest.mark.parametrize("beside", [0.0, 0.6, 2.4])
def test_decoys_are_meshes_of_other_teeth_beyond_the_reach_of_sidebands(spacing, beside):
    """Two to four teeth farther than the lines of one harmonic lie apart, to both sides."""
    harmonics = 60.0 * spacing * np.arange(1, 4)
    groups = tuple((x - beside, x, x + beside) if beside else (x,) for x in harmonics.tolist())
    mesh = MeshComb(order=60.0 * spacing, groups=groups, spacings=(spacing,))
    (own, _), *decoys = _rivals(mesh, (mesh,))
    assert own == mesh
    teeth = np.array([decoy.order - mesh.order for decoy, _ in decoys]) / spacing
    np.testing.assert_allclose(teeth, np.rint(teeth), atol=1e-9)
    np.testing.assert_allclose(np.sort(teeth), -np.sort(-teeth)[::-1])
    away, reach = np.abs(teeth).min(), 2 * beside / spacing
    assert reach + 2 <= away <= reach + 4
    for decoy, _ in decoys:
        for k, group in enumerate(decoy.groups, 1):
            np.testing.assert_allclose(
                np.array(group) - groups[k - 1], k * (decoy.order - mesh.order)
            )
