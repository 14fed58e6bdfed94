"""Piezoelectric cantilevers: a published unimorph, identities, and time integration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.beam_elements import answers, natural_hz
from reference.harvester_simulation import marched_power

from gearmon.errors import ArgumentError
from gearmon.harvesting.cantilever import (
    BEAM_MATERIALS,
    PIEZO_MATERIALS,
    BeamMaterial,
    PiezoCantilever,
    PiezoMaterial,
)

G = 9.81

#: The beam of Erturk and Inman, J. Vib. Acoust. 130 (2008) 041002.
PUBLISHED = PiezoCantilever(
    wiring="unimorph",
    piezo=PiezoMaterial(
        name="published",
        youngs_modulus_pa=66e9,
        density_kg_m3=7800,
        d31_m_per_v=-190e-12,
        permittivity_f_per_m=15.93e-9,
        safe_stress_pa=27.6e6,
    ),
    passive=BeamMaterial(
        name="published", youngs_modulus_pa=100e9, density_kg_m3=7165, safe_stress_pa=1e8
    ),
    length_m=0.1,
    width_m=0.02,
    passive_thickness_m=0.5e-3,
    piezo_thickness_m=0.4e-3,
    mechanical_damping_ratio=0.0,
    mass_rate_per_s=4.886,
    stiffness_time_s=1.2433e-5,
)


def bimorph(**changes):
    values = {
        "wiring": "series",
        "piezo": PIEZO_MATERIALS["PZT-5A"],
        "passive": BEAM_MATERIALS["brass"],
        "length_m": 0.03,
        "width_m": 0.01,
        "passive_thickness_m": 0.2e-3,
        "piezo_thickness_m": 0.2e-3,
    }
    return PiezoCantilever(**(values | changes))


def test_section_of_the_published_beam():
    assert PUBLISHED.flexural_stiffness_nm2 == pytest.approx(0.0978472, rel=1e-5)
    assert PUBLISHED.mass_per_length_kg_m == pytest.approx(0.13405, rel=1e-9)
    assert PUBLISHED.capacitance_f == pytest.approx(79.65e-9, rel=1e-6)


def test_modes_of_the_published_beam():
    found = PUBLISHED.modes.natural_rad_s[:3] / (2 * np.pi)
    np.testing.assert_allclose(found, [47.809, 299.615, 838.93], rtol=1e-5)
    np.testing.assert_allclose(
        PUBLISHED.modes.damping_ratio[:3], [0.0100, 0.0130, 0.0332], atol=5e-5
    )
    assert abs(PUBLISHED.modes.rows[0, 0]) == pytest.approx(0.0175627, rel=1e-5)
    gamma = PUBLISHED.modes.forcing[0] / PUBLISHED.mass_per_length_kg_m
    assert gamma == pytest.approx(0.676276, rel=1e-5)
    assert PUBLISHED.open_circuit_hz == pytest.approx(48.82, rel=1e-3)


def three_modes(beam, grid):
    """Voltage per acceleration, and admittance, of three modes alone, as published."""
    circular, natural = 2 * np.pi * grid, beam.modes.natural_rad_s[:3, None]
    damping, coupling = beam.modes.damping_ratio[:3, None], beam.modes.rows[0, :3]
    mode = 1 / (natural**2 - circular**2 + 2j * damping * natural * circular)
    admittance = 1j * circular * (beam.capacitance_f + coupling**2 @ mode)
    driven = 1j * circular * ((coupling * beam.modes.forcing[:3]) @ mode)
    return np.abs(driven / (1 / beam.load_ohm + admittance)), np.abs(admittance)


@pytest.mark.parametrize(
    ("load_ohm", "volt_per_g", "peak_power_mw"),
    [(1e3, 2.472, 6.111), (1e4, 17.01, 28.95), (1e5, 56.68, 32.12), (1e6, 96.64, 9.338)],
)
def test_voltage_and_power_of_the_published_beam(load_ohm, volt_per_g, peak_power_mw):
    grid = np.linspace(45, 51, 12001)
    loaded = PUBLISHED.with_load(load_ohm)
    # the published figures are of three modes, 0.8 % above those of all near the open circuit, and
    # the power is its peak, twice the mean
    volt = G * three_modes(loaded, grid)[0].max()
    assert volt == pytest.approx(volt_per_g, rel=1e-3)
    assert 1e3 * volt**2 / load_ohm == pytest.approx(peak_power_mw, rel=1e-3)
    gains, elements = loaded.gains(grid), answers(loaded, grid[::50])[0].max()
    assert gains.voltage_v.max() == pytest.approx(elements, rel=1e-3)
    assert gains.power_w.max() == pytest.approx(elements**2 / (2 * load_ohm), rel=1e-3)


@pytest.mark.parametrize(
    ("frequency_hz", "load_ohm", "peak_power_mw"), [(47.8, 17.5e3, 31.1), (48.8, 91.8e3, 31.4)]
)
def test_best_load_of_the_published_beam(frequency_hz, load_ohm, peak_power_mw):
    # published of three modes; all of them as the elements have it
    at = np.array([frequency_hz])
    _, admittance = three_modes(PUBLISHED, at)
    assert 1 / admittance[0] == pytest.approx(load_ohm, rel=3e-3)
    volt = G * three_modes(PUBLISHED.with_load(1 / admittance[0]), at)[0][0]
    assert 1e3 * volt**2 * admittance[0] == pytest.approx(peak_power_mw, rel=2e-3)
    best = PUBLISHED.best_load_ohm(frequency_hz)
    loads = np.linspace(0.9, 1.1, 41) * best
    powers = [answers(PUBLISHED.with_load(r), at)[0][0] ** 2 / (2 * r) for r in loads]
    assert best == pytest.approx(loads[np.argmax(powers)], rel=6e-3)
    power = PUBLISHED.with_load(best).gains(frequency_hz).power_w[0]
    assert power == pytest.approx(max(powers), rel=1e-3)


@pytest.mark.parametrize(
    ("load_ohm", "peaks"), [(1e2, [47.81, 299.58, 837.7]), (1e8, [48.80, 301.49, 838.7])]
)
def test_peaks_from_short_to_open_circuit(load_ohm, peaks):
    grid = np.linspace(20, 1000, 98_001)
    loaded = PUBLISHED.with_load(load_ohm)

    def tops(grid, volt):
        return grid[np.flatnonzero((volt[1:-1] > volt[:-2]) & (volt[1:-1] > volt[2:])) + 1]

    # three modes, as published; all of them as the elements have it
    np.testing.assert_allclose(tops(grid, three_modes(loaded, grid)[0]), peaks, rtol=1e-4)
    found = tops(grid, loaded.gains(grid).voltage_v)
    near = np.concatenate([f + np.arange(-6, 7) * 0.05 for f in found])
    np.testing.assert_allclose(found, tops(near, answers(loaded, near)[0]), rtol=2e-4)


def test_bound_of_the_published_beam():
    # the published figure is that of the first mode; a bound has to hold the others as well
    first = PUBLISHED.modes.forcing[0] ** 2 / (
        16 * PUBLISHED.damping_ratio * PUBLISHED.modes.natural_rad_s[0]
    )
    assert 2e3 * first * G**2 == pytest.approx(32.9, rel=1e-3)
    assert first < PUBLISHED.power_bound_w() < 1.1 * first


beams = st.builds(
    bimorph,
    wiring=st.sampled_from(["unimorph", "series", "parallel"]),
    piezo=st.sampled_from(list(PIEZO_MATERIALS.values())),
    passive=st.sampled_from(list(BEAM_MATERIALS.values())),
    length_m=st.floats(0.01, 0.1),
    tip_mass_kg=st.floats(0, 0.02),
    passive_thickness_m=st.floats(5e-5, 5e-4),
    piezo_thickness_m=st.floats(2e-5, 5e-4),
)


@given(beam=beams, detuning=st.floats(0.8, 1.3), decade=st.floats(-3, 3))
def test_no_load_takes_more_than_the_bound(beam, detuning, decade):
    frequency = beam.natural_frequency_hz * detuning
    low, high = beam.load_range
    loaded = beam.with_load(np.sqrt(low * high) * 10**decade)
    assert loaded.gains(frequency).power_w[0] <= beam.power_bound_w() * (1 + 1e-9)


@given(beam=beams, detuning=st.floats(0.9, 1.2), factor=st.floats(1.01, 5))
def test_best_load_is_the_best(beam, detuning, factor):
    frequency = beam.natural_frequency_hz * detuning
    best = beam.best_load_ohm(frequency)
    power = beam.with_load(best).gains(frequency).power_w[0]
    for load in (best * factor, best / factor):
        assert beam.with_load(load).gains(frequency).power_w[0] <= power * (1 + 1e-12)


@given(beam=beams, frequency=st.floats(20, 3000))
def test_series_and_parallel_give_the_same_power(beam, frequency):
    series = replace(beam, wiring="series")
    parallel = replace(beam, wiring="parallel").with_load(series.load_ohm / 4)
    assert parallel.gains(frequency).power_w[0] == pytest.approx(
        series.gains(frequency).power_w[0], rel=1e-9
    )


@given(beam=beams, share=st.floats(0.01, 0.99))
def test_retuned_beam_has_the_frequency_wanted(beam, share):
    low, high = beam.frequency_range_hz
    wanted = low + share * (high - low)
    assert beam.retuned(wanted).natural_frequency_hz == pytest.approx(wanted, rel=1e-9)


def test_frequencies_out_of_reach_are_refused_with_the_range():
    with pytest.raises(ArgumentError, match=r"reaches .* Hz"):
        bimorph().retuned(1e5)
    with pytest.raises(ArgumentError, match=r"reaches .* Hz"):
        bimorph().retuned(1.0)
    # a mass may bring the second mode there, which is not what is wanted
    second = bimorph(tip_mass_kg=1e-4).modes.natural_rad_s[1] / (2 * np.pi)
    with pytest.raises(ArgumentError, match=r"reaches .* Hz"):
        bimorph().retuned(second)


#: The brass-reinforced PZT-5H bimorph of Erturk and Inman, Piezoelectric Energy Harvesting, Wiley
#: 2011, chapter 4, without tip mass.
BOOK = PiezoCantilever(
    wiring="series",
    piezo=PIEZO_MATERIALS["PZT-5H"],
    passive=replace(BEAM_MATERIALS["brass"], density_kg_m3=9000.0),
    length_m=24.53e-3,
    width_m=6.4e-3,
    passive_thickness_m=0.140e-3,
    piezo_thickness_m=0.265e-3,
    mechanical_damping_ratio=0.00874,
)


def test_bimorph_of_the_book_peaks_where_its_model_and_the_experiment_do():
    # model, of three modes, 502.5 and 524.7 Hz, printed to 0.1 Hz; measured 502.6 and 524.2 Hz
    grid = np.linspace(490, 540, 50_001)
    beams = [BOOK.with_load(load) for load in (470.0, 995e3)]
    printed = [grid[three_modes(beam, grid)[0].argmax()] for beam in beams]
    assert printed == pytest.approx([502.5, 524.7], abs=0.15)
    peaks = [grid[beam.gains(grid).voltage_v.argmax()] for beam in beams]
    assert peaks == pytest.approx([502.6, 524.2], rel=5e-4)


#: The bimorph with a tip mass of Erturk and Inman, Smart Mater. Struct. 18 (2009) 025009.
WEIGHTED = replace(
    BOOK,
    piezo=replace(
        PUBLISHED.piezo, permittivity_f_per_m=13.28e-9, youngs_modulus_pa=66e9, d31_m_per_v=-190e-12
    ),
    length_m=50.8e-3,
    width_m=31.8e-3,
    passive_thickness_m=0.14e-3,
    piezo_thickness_m=0.26e-3,
    tip_mass_kg=0.012,
    mechanical_damping_ratio=0.027,
)


@pytest.mark.parametrize("beam", [PUBLISHED, BOOK, replace(BOOK, wiring="parallel"), WEIGHTED])
@pytest.mark.parametrize("load_ohm", 10.0 ** np.arange(0, 10, 3))
def test_published_beams_equal_finite_elements_from_short_to_open_circuit(beam, load_ohm):
    loaded, (short, opened) = beam.with_load(load_ohm), natural_hz(beam)
    np.testing.assert_allclose(beam.modes.natural_rad_s[:2] / (2 * np.pi), short[:2], rtol=1e-5)
    assert beam.open_circuit_hz == pytest.approx(opened[0], rel=1e-5)
    grid = np.concatenate([short[0] * np.linspace(0.5, 1.4, 10), opened[0] * np.array([0.99, 1.0])])
    grid = np.append(grid, short[1] * np.array([0.98, 1.0]))
    gains, (voltage, travel, stress) = loaded.gains(grid), answers(loaded, grid)
    np.testing.assert_allclose(gains.voltage_v, voltage, rtol=1e-3)
    np.testing.assert_allclose(gains.power_w, voltage**2 / load_ohm / 2, rtol=1e-3)
    np.testing.assert_allclose(gains.travel_m, travel, rtol=1e-3)
    np.testing.assert_allclose(gains.stress_pa, stress, rtol=1e-3)


@pytest.mark.parametrize("seed", range(9))
def test_beam_equals_finite_elements(seed):
    rng = np.random.default_rng(seed)
    beam = bimorph(
        wiring=["unimorph", "series", "parallel"][seed % 3],
        length_m=rng.uniform(0.02, 0.06),
        tip_mass_kg=rng.choice([0.0, 1e-3, 8e-3]),
        tip_gyration_m=rng.choice([0.0, 2e-3, 6e-3]),
        passive_thickness_m=rng.uniform(1e-4, 4e-4),
        piezo_thickness_m=rng.uniform(5e-5, 4e-4),
    )
    if seed >= 4:
        beam = replace(beam, tip_block_density_kg_m3=7850.0, tip_block_height_m=4e-3)
    short, opened = natural_hz(beam)
    np.testing.assert_allclose(beam.modes.natural_rad_s[:3] / (2 * np.pi), short, rtol=1e-4)
    assert beam.open_circuit_hz == pytest.approx(opened[0], rel=1e-4)
    grid = short[0] * np.array([0.5, 0.9, 0.98, 1.0, 1.02, 1.1])
    for load in (1e3, 1e5, 1e7):
        loaded = beam.with_load(load)
        voltage, travel, stress = answers(loaded, grid)
        gains = loaded.gains(grid)
        # a few modes and the static rest of the others against all
        np.testing.assert_allclose(gains.voltage_v, voltage, rtol=1e-3)
        np.testing.assert_allclose(gains.travel_m, travel, rtol=1e-3)
        np.testing.assert_allclose(gains.stress_pa, stress, rtol=1e-3)


@pytest.mark.parametrize("seed", range(5))
def test_power_under_random_lines_equals_marching_in_time(seed):
    rng = np.random.default_rng(seed)
    beam = bimorph(
        wiring=["unimorph", "series", "parallel"][seed % 3],
        tip_gyration_m=rng.choice([0.0, 4e-3]),
        mechanical_damping_ratio=rng.uniform(0.008, 0.04),
    ).retuned(rng.uniform(80, 200))
    beam = beam.with_load(beam.best_load_ohm(beam.natural_frequency_hz) * rng.uniform(0.3, 3))
    # all multiples of 10 Hz, up to the second mode
    numbers = rng.choice(np.arange(4, 220), 12, replace=False)
    frequency = np.append(10.0 * numbers, 10.0 * round(beam.natural_frequency_hz / 10))
    amplitude = rng.lognormal(0, 1, len(frequency))
    same = np.unique(frequency)
    squared = np.array([np.sum(amplitude[frequency == f]) ** 2 for f in same])
    ours = float(beam.gains(same).power_w @ squared)
    lines = list(zip(same, np.sqrt(squared), strict=True))
    assert ours == pytest.approx(marched_power(beam, lines, 10.0), rel=0.01)


def test_retuned_beam_keeps_the_gyration_of_its_tip_mass():
    beam = bimorph(tip_gyration_m=5e-3)
    low, high = beam.frequency_range_hz
    wanted = np.sqrt(low * high)
    assert beam.retuned(wanted).tip_gyration_m == 5e-3
    assert beam.retuned(wanted).natural_frequency_hz == pytest.approx(wanted, rel=1e-9)
    assert beam.retuned(wanted).tip_mass_kg < bimorph().retuned(wanted).tip_mass_kg


@pytest.mark.parametrize("width_m", [2e-4, 2e-3, 0.02])
def test_air_drags_as_on_spheres_side_by_side(width_m):
    """Stokes: 6 pi mu R (1 + R/delta) on one, with the depth delta that its motion reaches."""
    still = bimorph(width_m=width_m)
    circular = still.modes.natural_rad_s
    viscosity, density, radius = 1.81e-5, 1.19, width_m / 2
    depth = np.sqrt(2 * viscosity / (density * circular))
    a_metre = 6 * np.pi * viscosity * radius * (1 + radius / depth) / width_m
    added = replace(still, in_air=True).modes.damping_ratio - still.modes.damping_ratio
    expected = a_metre / (2 * still.mass_per_length_kg_m * circular)
    np.testing.assert_allclose(added, expected, rtol=1e-9)
    # a mass at the tip is not dragged, and makes the beam a part of what moves
    loaded = replace(still, tip_mass_kg=still.beam_mass_kg)
    first = replace(loaded, in_air=True).damping_ratio - loaded.damping_ratio
    assert 0 < first < added[0]


@pytest.mark.parametrize(("passive_m", "piezo_m"), [(0.5e-3, 0.1e-3), (0.1e-3, 0.3e-3)])
def test_stress_of_a_weak_plate_counts_by_what_it_bears(passive_m, piezo_m):
    """Shaken slowly a beam bends under its own weight; the farther face of the plate breaks."""
    plate = replace(BEAM_MATERIALS["brass"], safe_stress_pa=1e5)
    sizes = {"passive_thickness_m": passive_m, "piezo_thickness_m": piezo_m, "load_ohm": 1e-3}
    beam = bimorph(wiring="unimorph", passive=plate, **sizes)
    one, two = plate.youngs_modulus_pa * passive_m, beam.piezo.youngs_modulus_pa * piezo_m
    axis = (one * passive_m / 2 + two * (passive_m + piezo_m / 2)) / (one + two)
    stiff = beam.width_m * (
        one * (passive_m**2 / 12 + (axis - passive_m / 2) ** 2)
        + two * (piezo_m**2 / 12 + (passive_m + piezo_m / 2 - axis) ** 2)
    )
    curved = beam.mass_per_length_kg_m * beam.length_m**2 / 2 / stiff
    farther = max(abs(axis), abs(passive_m - axis))
    share = plate.youngs_modulus_pa * farther * curved / plate.safe_stress_pa
    found = beam.gains(beam.natural_frequency_hz / 200).stress_pa[0]
    assert found / beam.stress_limit_pa == pytest.approx(share, rel=1e-3)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"length_m": -0.01}, "length_m"),
        ({"length_m": 1e-3}, "thin-beam"),
        ({"piezo_thickness_m": 0.0}, "piezo_thickness_m"),
        ({"load_ohm": 0.0}, "load_ohm"),
        ({"wiring": "star"}, "wiring"),
        ({"clearance_m": 0.0}, "clearance"),
    ],
)
def test_impossible_beams_are_refused(changes, words):
    with pytest.raises(ArgumentError, match=words):
        bimorph(**changes)


def test_every_material_names_its_source():
    assert all(m.source for m in (*PIEZO_MATERIALS.values(), *BEAM_MATERIALS.values()))


def test_damping_of_zero_is_refused():
    with pytest.raises(ArgumentError, match="damping"):
        bimorph(mechanical_damping_ratio=0.0)
