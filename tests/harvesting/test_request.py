"""Harvester files."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gearmon.errors import GearmonError
from gearmon.harvesting.cantilever import PiezoCantilever
from gearmon.harvesting.harvester import InertialHarvester
from gearmon.harvesting.response import SensorBudget
from gearmon.harvesting.tuning import built_in, load_harvester


def written(tmp_path, text):
    path = tmp_path / "harvester.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_cantilever_file(tmp_path):
    text = 'kind = "cantilever"\npiezo = "AlN"\nlength_mm = 20.0\n[budget]\nbits = 16\n'
    harvester, budget = load_harvester(written(tmp_path, text))
    assert isinstance(harvester, PiezoCantilever)
    assert (harvester.piezo.name, harvester.length_m, budget.bits) == ("AlN", 0.02, 16)


def test_inertial_file(tmp_path):
    harvester, _ = load_harvester(written(tmp_path, 'kind = "inertial"\nmass_g = 12.0\n'))
    assert isinstance(harvester, InertialHarvester)
    assert harvester.mass_kg == pytest.approx(0.012)


def test_built_in_is_what_an_empty_table_says(tmp_path):
    harvester, budget = load_harvester(written(tmp_path, 'kind = "cantilever"\n'))
    assert (harvester, budget) == built_in()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("length_mm = 3.0\n", 'must be "cantilever" or "inertial"'),
        ('kind = "cantilever"\nlenght_mm = 3.0\n', ":2: lenght_mm .* did you mean length_mm"),
        ('kind = "cantilever"\nlength_mm = -3.0\n', ":2: length_mm = -3.0 must lie in"),
        ('kind = "cantilever"\nlength_mm = 1.0\n', "thin-beam theory"),
        ('kind = "cantilever"\npiezo = "PZT5A"\n', 'did you mean "PZT-5A"'),
        ('kind = "inertial"\nlowest_hz = 50.0\nhighest_hz = 20.0\n', "highest_hz"),
        ('kind = "inertial"\n[budget]\nefficiency = 2.0\n', ":3: budget.efficiency"),
        ('kind = "inertial"\n[budget]\nefficency = 0.5\n', "did you mean efficiency"),
    ],
)
def test_bad_files_end_in_one_line(tmp_path, text, words):
    with pytest.raises(GearmonError, match=words) as caught:
        load_harvester(written(tmp_path, text))
    assert "\n" not in str(caught.value)


def test_millimetres_and_grams_become_metres_and_kilograms(tmp_path):
    text = """kind = "cantilever"
length_mm = 30.0
width_mm = 5.0
passive_thickness_mm = 0.15
piezo_thickness_mm = 0.25
most_tip_mass_g = 7.0
tip_gyration_mm = 4.0
clearance_mm = 3.0
"""
    beam, _ = load_harvester(written(tmp_path, text))
    assert (beam.length_m, beam.width_m, beam.clearance_m) == pytest.approx((0.03, 0.005, 0.003))
    assert (beam.passive_thickness_m, beam.piezo_thickness_m) == pytest.approx((1.5e-4, 2.5e-4))
    assert (beam.most_tip_mass_kg, beam.tip_gyration_m) == pytest.approx((0.007, 0.004))


@pytest.mark.parametrize("tilt", [0.0, 60.0, 90.0])
def test_a_harvester_that_leans_feels_a_part_of_its_weight(tmp_path, tilt):
    beam, _ = load_harvester(written(tmp_path, f'kind = "cantilever"\ntilt_deg = {tilt}\n'))
    assert beam.weight_ms2 == pytest.approx(9.81 * math.cos(math.radians(tilt)), abs=1e-12)


def test_age_counts_by_decades_and_warmth_by_what_is_away_from_twenty_degrees():
    for years, share in ((0.0, 1.0), (1 / 365, 1.0), (10 / 365, 0.98), (1000 / 365, 0.94)):
        assert SensorBudget(loss_per_decade=0.02, years=years).kept_share == pytest.approx(share)
    for degrees, share in ((20.0, 1.0), (45.0, 0.9), (-5.0, 0.9)):
        warm = SensorBudget(loss_per_k=0.004, temperature_c=degrees)
        assert warm.kept_share == pytest.approx(share)
    both = SensorBudget(loss_per_decade=0.02, years=100 / 365, loss_per_k=0.004, temperature_c=45.0)
    assert both.kept_share == pytest.approx(0.96 * 0.9)
    assert float(both.rectified_w(1e-3, math.nan)) == pytest.approx(0.96 * 0.9e-3)


@pytest.mark.parametrize("dead", [0.0, 0.1, 0.5, 0.99, 1.5])
def test_a_tracking_regulator_gets_what_a_sine_holds_above_the_diodes(dead):
    load, amplitude = 1e4, 2.0
    budget = SensorBudget(regulator="tracking", rectifier_drop_v=dead * amplitude)
    power = amplitude**2 / (2 * load)
    wave = np.sin(2 * np.pi * (np.arange(100_000) + 0.5) / 100_000)
    # the current is that of the sine, the voltage less the drop
    through = float(np.mean(np.maximum(np.abs(wave) - dead, 0.0) * np.abs(wave)) / 0.5)
    found = float(budget.rectified_w(power, load))
    assert found == pytest.approx(through * power, abs=1e-4 * power)


@pytest.mark.parametrize(("drop", "store"), [(0.6, 3.0), (0.0, 2.0), (1.0, 1.0)])
def test_a_store_without_regulator_takes_most_at_half_the_open_voltage(drop, store):
    """Diodes take their share of the voltage that is held, and nothing flows above the peak."""
    budget, load = SensorBudget(regulator="none", rectifier_drop_v=drop, store_v=store), 1e4
    held = store + drop
    # matched, the amplitude is half of that without load
    for amplitude, share in ((held, 1.0), (2 * held, 0.75), (0.501 * held, 0.0), (0.4 * held, 0.0)):
        power = amplitude**2 / (2 * load)
        found = float(budget.rectified_w(power, load))
        assert found == pytest.approx(power * share * store / held, abs=0.01 * power)
