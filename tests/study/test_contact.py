"""Where contact is lost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gearmon.study.experiments import least_force
from gearmon.study.pair import REFERENCE, varied


def test_first_losses_are_where_the_force_is_zero(results):
    contact = results.contact
    at_mass = replace(REFERENCE, mass_kg=contact.mass.first)
    assert abs(least_force(at_mass)) < 5e-3
    heavy = replace(REFERENCE, mass_kg=3.0)
    assert abs(least_force(varied(heavy, "variation", contact.variation.first))) < 5e-3


def test_contact_is_lost_near_resonance(results):
    """The first mass without contact throughout lies next to w0 = w."""
    resonant = 8e8 * (1.6e-3 / (2 * np.pi)) ** 2
    assert 0.8 * resonant < results.contact.mass.first < resonant


def test_without_variation_the_force_is_constant():
    assert least_force(varied(REFERENCE, "variation", 0.0)) == pytest.approx(1.0)


def test_unstable_means_no_contact():
    """w = 2 w0 within the tongue, hardly damped: no steady state."""
    mass = 8e8 * (2 * 1.6e-3 / (2 * np.pi)) ** 2
    unstable = replace(REFERENCE, mass_kg=mass, damping_ns_per_m=10.0)
    assert least_force(unstable) == -np.inf


def test_every_scan_begins_at_its_harmless_end(results):
    """Light, well damped or little varied: there the force is farther from zero."""
    for scan in (results.contact.mass, results.contact.damping, results.contact.variation):
        assert scan.least_force[0] > scan.least_force[-1]
        assert scan.least_force[0] > 0
