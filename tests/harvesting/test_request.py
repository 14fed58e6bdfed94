"""Harvester files."""

from __future__ import annotations

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
