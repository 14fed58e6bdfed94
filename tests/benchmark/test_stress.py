"""The stress test draws what it says, and its verdicts follow from the numbers."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from reference.refined_balance import refined_balance

from gearmon.benchmark import dynamics as stress
from gearmon.benchmark import equations, run_case
from gearmon.benchmark.dynamics import (
    OUTCOMES,
    TRACE_TOLERANCE,
    draw_system,
    instability_limit,
    stress_summary,
)
from gearmon.benchmark.equations import Lines, reference_and_doubt
from gearmon.dynamics import HillProblem, floquet, steady_state
from gearmon.errors import ArgumentError


@pytest.fixture(scope="module")
def rows():
    return stress.run_stress(40, seed=11)


def test_no_answer_is_wrong_silently(rows):
    assert len(rows) == 80
    for summary in stress.stress_summary(rows):
        assert summary["wrong_silently"] == summary["bound_broken"] == summary["crashed"] == 0
        assert summary["met"] + summary["refused"] == 40
        assert summary["least_bound_over_error"] >= 1 - 1e-9
    json.dumps(rows, allow_nan=False)


@pytest.mark.parametrize("seed", range(8))
def test_doubt_of_the_reference_against_extended_precision(seed):
    problem, *_ = draw_system(np.random.default_rng(seed))
    reference, doubt = reference_and_doubt(problem)
    exact = Lines(refined_balance(problem).displacement.astype(complex))
    assert reference.error(exact) < max(1e-13, 3 * doubt)
    assert doubt < 1e-11


@pytest.mark.parametrize("zeta", [1e-3, 1e-4])
def test_at_a_resonance_the_doubt_is_what_four_roundings_of_the_period_do(zeta):
    """Where w = w0 an answer of 1 / (w0^2 - w^2 + 2 i zeta w w0) moves by (dT / T) / zeta."""
    problem = HillProblem(1.0, 2 * zeta, 1.0, np.array([zeta + 0j]), 2 * np.pi, 1.0)
    _, doubt = reference_and_doubt(problem)
    moved = 4 * np.spacing(problem.period_s) / problem.period_s
    assert 0.5 < doubt / (moved / zeta) < 2.0


def test_the_doubt_of_a_coarse_reference_is_its_error(monkeypatch):
    problem = HillProblem(1.0, 0.1, 1.0, np.array([0.2 + 0.1j, 0.1j]), 20.0, 1.0)
    solved = equations.solve_reference
    fine = solved(equations.Case(problem=problem))
    monkeypatch.setattr(equations, "solve_reference", lambda own, count=4: solved(own, count))
    coarse, doubt = reference_and_doubt(problem)
    count = len(coarse.acceleration)
    share = (np.arange(count)[:, None] + equations.rule(equations.NODES).nodes) / count
    error = fine.error(equations.Samples(share.ravel(), coarse.acceleration.ravel()))
    assert error > 1e-9
    assert doubt == pytest.approx(error, rel=0.2)


def test_same_seed_same_systems(rows):
    again = stress.run_stress(3, seed=11)
    for row, known in zip(again, rows, strict=False):
        assert row["ratio"] == known["ratio"]
        assert row["error"] == known["error"]


@pytest.mark.parametrize("seed", range(6))
def test_drawn_systems(seed):
    p, variation, limit = draw_system(np.random.default_rng(seed))
    assert 0.1 <= p.frequency_ratio <= 50
    assert 1e-3 <= p.damping_ratio <= 3
    assert 1 <= len(p.stiffness_harmonics) <= 64
    assert variation <= 0.9 * limit
    values = np.fft.irfft(np.concatenate([[0], p.stiffness_harmonics]), 4096, norm="forward")
    assert np.abs(values).max() == pytest.approx(variation, rel=0.02)


def test_limit_of_the_principal_tongue():
    """Unstable at w = 2 w0 where eps > 4 zeta, to first order."""
    assert instability_limit(0.5, 0.02, np.array([0.5 + 0j])) == pytest.approx(0.08, rel=0.03)


@pytest.mark.parametrize(("ratio", "zeta"), [(0.7, 0.02), (6.3, 0.1), (0.5, 0.01), (2.0, 2.0)])
def test_growth_against_floquet(ratio, zeta):
    shape = np.array([0.3 + 0.1j, 0.1 - 0.2j])
    found = floquet.growth_of(ratio, np.array([0.2, 0.8]), zeta, shape, TRACE_TOLERANCE)
    for variation, value in zip((0.2, 0.8), found, strict=True):
        largest = abs(floquet.multipliers(ratio, zeta, variation * shape)[0])
        assert value == pytest.approx(np.log(largest), rel=2e-2, abs=2e-3)


def verdict(response, **others):
    given = {"error": 1e-8, "tolerance": 1e-6, "uncertainty": 1e-18, "rate": -1.0} | others
    return stress._outcome(response, **given)


def test_outcomes():
    problem, *_ = draw_system(np.random.default_rng(1))
    good = replace(steady_state(problem), error_bound=1e-7, stable=True)
    assert verdict(good) == ("met", "")
    assert verdict(good, error=2e-7)[0] == "bound broken"
    assert verdict(replace(good, error_bound=1e-5)) == ("refused", "bound too wide")
    missed = replace(good, error_bound=1e-5)
    assert verdict(missed, error=2e-6) == ("refused", "not accurate enough")
    assert verdict(replace(good, error_bound=np.inf)) == ("refused", "no bound")
    unstable = replace(good, error_bound=np.inf, stable=False)
    assert verdict(unstable, rate=0.1) == ("refused", "unstable")
    assert verdict(unstable)[1] == "called unstable, but is stable"
    assert verdict(good, uncertainty=2e-7)[0] == "not judged"


def test_a_summary_holds_what_its_rows_say_by_tolerance():
    rng, tolerances = np.random.default_rng(2), (1e-3, 1e-6)
    rows = [
        {
            "tolerance": tolerances[n % 2],
            "outcome": str(rng.choice([name.replace("_", " ") for name in OUTCOMES])),
            "reason": str(rng.choice(["unstable", "no bound"])),
            "log_multiplier": rng.normal(),
            "bound_over_error": rng.choice([None, 1 + rng.exponential()]),
            "error": rng.exponential(),
            "reference_uncertainty": rng.exponential(),
            "run_time_s": rng.exponential(),
        }
        for n in range(200)
    ]
    told = pd.DataFrame(stress_summary(rows)).set_index("tolerance")
    for tolerance, own in pd.DataFrame(rows).groupby("tolerance"):
        found, stable = told.loc[tolerance], own[own["log_multiplier"] < 0]
        refused, ratio = stable[stable["outcome"] == "refused"], own["bound_over_error"].dropna()
        assert found["systems"] == len(own)
        counted = own["outcome"].value_counts()
        assert all(found[name.replace(" ", "_")] == count for name, count in counted.items())
        assert found["refused_of_stable_percent"] == 100 * len(refused) / len(stable)
        for reason, count in refused["reason"].value_counts().items():
            assert f"{reason}: {count}" in found["reasons"]
        names = ["least_bound_over_error", "median_bound_over_error", "p95_bound_over_error"]
        shares = ratio.astype(float).quantile([0.0, 0.5, 0.95])
        assert found[names].tolist() == pytest.approx(shares.tolist())
        assert found["largest_error_met"] == own.loc[own["outcome"] == "met", "error"].max()
        assert found["worst_uncertainty"] == own["reference_uncertainty"].max()
        assert found["median_run_time_s"] == pytest.approx(own["run_time_s"].median())


def test_crash_and_refusal_are_told_apart(monkeypatch):
    system = draw_system(np.random.default_rng(1))

    def refusing(_problem, _tolerance):
        raise ArgumentError("too large")

    def crashing(_problem, _tolerance):
        raise OverflowError("math range error")

    monkeypatch.setattr(stress, "steady_state", refusing)
    for row in stress.judged(*system):
        assert (row["outcome"], row["reason"]) == ("refused", "too large")
    monkeypatch.setattr(stress, "steady_state", crashing)
    for row in stress.judged(*system):
        assert row["outcome"] == "crashed"
        assert "OverflowError" in row["reason"]


def test_refined_balance_knows_a_wrong_line():
    problem, *_ = draw_system(np.random.default_rng(4))
    exact = refined_balance(problem)
    unit = problem.force_n / problem.stiffness_n_per_m
    z = exact.displacement.astype(complex) * unit
    assert exact.error(z, problem) < 1e-14
    weighted = np.arange(len(z)) ** 2 * np.abs(z)
    strongest = int(weighted.argmax())
    z[strongest] *= 1.01
    share = weighted[strongest] / np.linalg.norm(weighted)
    assert exact.error(z, problem) == pytest.approx(0.01 * share, rel=1e-6)


def test_quick_case():
    seen = []
    rows = run_case("stress", progress=seen.append, quick=True, count=4, seed=2)
    assert len(rows) == 8
    assert seen == [0.25, 0.5, 0.75, 1.0]


def test_count_is_checked():
    with pytest.raises(ArgumentError, match="count=0"):
        stress.run_stress(0)
