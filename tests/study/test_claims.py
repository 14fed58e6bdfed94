"""Every claim is judged, from results, with numbers that follow them."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from types import SimpleNamespace
from typing import get_args

import numpy as np
import pytest

from gearmon.study.claims import (
    CLAIMS,
    QUANTITIES,
    Evidence,
    Verdict,
    falling,
    judge,
    rising,
    verdict_of,
)
from gearmon.study.pair import POINTS_PER_PERIOD, REFERENCE

NOT_REPRODUCED = {"3a", "3b", "6e", "7c", "9b"}


def test_keys_cover_the_twelve_claims_once():
    keys = [claim.key for claim in CLAIMS]
    assert len(set(keys)) == len(keys)
    assert {int(key.rstrip("abcdef")) for key in keys} == set(range(1, 13))


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: claim.key)
def test_finding_is_complete(findings, claim):
    finding = findings[claim.key]
    assert finding.verdict in get_args(Verdict)
    assert finding.evidence
    assert finding.reason.endswith(".")
    for item in finding.evidence:
        assert math.isfinite(item.ours) or "loses contact" in item.quantity


def test_verdicts(findings):
    counts = Counter(finding.verdict for finding in findings.values())
    assert [counts[verdict] for verdict in get_args(Verdict)] == [14, 10, 5, 2]
    assert {k for k, f in findings.items() if f.verdict == "not reproduced"} == NOT_REPRODUCED
    for key in ("1a", "5a", "6a", "6c", "6d", "8b", "9a", "9d", "11"):
        assert findings[key].verdict == "reproduced"
    for key in ("5c", "12a"):
        assert findings[key].verdict == "cannot be checked"


@pytest.mark.parametrize("key", ["1a", "5a", "6d", "8b", "9c", "10", "12b"])
def test_expected_numbers_are_met(findings, key):
    differing = [item.quantity for item in findings[key].evidence if not item.agrees]
    assert not differing


def test_numbers_known_from_elsewhere_are_met_in_every_claim(findings):
    """Closed forms and independent computations hold, whatever becomes of what was claimed."""
    known = [
        item
        for finding in findings.values()
        for item in finding.evidence
        if item.expected is not None and "study" not in item.source
    ]
    assert len(known) > 40
    assert not [item.quantity for item in known if not item.agrees]


def test_square_of_the_frequency_ratio_is_told_beside_it(findings):
    ratio, square = (item.ours for item in findings["5c"].evidence[:2])
    assert ratio == pytest.approx(REFERENCE.frequency_ratio)
    assert square == pytest.approx(ratio**2)


def test_verdicts_follow_the_results(results, findings):
    """Other results, other verdicts: nothing is typed in."""
    sweep = results.sweeps["stiffness_n_per_m"]
    turned = replace(sweep, points=sweep.points[::-1])
    other = replace(results, sweeps=results.sweeps | {"stiffness_n_per_m": turned})
    changed = {entry.claim.key: entry for entry in judge(other)}
    assert changed["6a"].verdict == changed["6c"].verdict == "not reproduced"
    assert changed["9a"].verdict == "not reproduced"
    assert changed["9d"] == findings["9d"]


def test_substitution_is_compared_at_no_less_accuracy(results):
    for cost in (results.speed.substitution(), results.speed.finest):
        rival, ratio = results.speed.ratio(cost)
        assert rival["error"] <= cost["error"]
        assert ratio == pytest.approx(rival["median_s"] / cost["median_s"])


def test_change_of_the_last_period_is_over_the_peak_to_peak():
    """A wave on a mean that moves by a tenth of its amplitude from one period to the next."""
    phase = np.arange(4 * POINTS_PER_PERIOD) / POINTS_PER_PERIOD
    wave = 5.0 + np.cos(2 * np.pi * phase) + 0.1 * np.floor(phase)
    start = SimpleNamespace(motion=SimpleNamespace(displacement_m=wave))
    assert QUANTITIES["change"](SimpleNamespace(start=start)) == pytest.approx(0.05)


def test_contact_is_lost_at_the_resonance_that_is_told(results, findings):
    """Natural over mesh frequency at the least mass that loses contact, sqrt(k/m) T / 2 pi."""
    told = {item.quantity: item.ours for item in findings["7c"].evidence}
    ratio = told["natural over mesh frequency at the least mass that loses contact"]
    resonant = replace(REFERENCE, mass_kg=results.contact.mass.first)
    assert ratio == pytest.approx(resonant.frequency_ratio)


def test_displacement_at_three_kilograms_is_negative_only_where_it_is_counted_from_rest(findings):
    told = {item.quantity: item.ours for item in findings["7c"].evidence}
    least_um = told["least steady displacement at 3 kg"]
    counted_um = told["least steady displacement at 3 kg, counted from F/k0"]
    assert counted_um < 0 < least_um
    assert least_um - counted_um == pytest.approx(
        1e6 * REFERENCE.force_n / REFERENCE.stiffness_n_per_m
    )


def test_evidence():
    item = Evidence(quantity="q", ours=1.02, expected=1.0, tolerance=0.01)
    assert item.difference == pytest.approx(0.02)
    assert not item.agrees
    assert Evidence(quantity="q", ours=5.0).agrees
    assert Evidence(quantity="q", ours=1e-9, expected=0.0, tolerance=1e-6).agrees


def test_verdict_of_parts():
    assert verdict_of(True, True) == "reproduced"
    assert verdict_of(True, False) == "partly"
    assert verdict_of(False, False) == "not reproduced"


def test_rising_and_falling():
    assert rising([1, 1, 2])
    assert not rising([1, 2, 1])
    assert falling([3, 2, 1])
    assert not falling([1, 2])
