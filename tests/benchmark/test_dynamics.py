"""The dynamics benchmark runs, with the columns and the marks that it promises."""

from __future__ import annotations

import json

import numpy as np
import pytest

from gearmon.benchmark import case_figures, dynamics, rivals, run_case, summary_rows
from gearmon.benchmark.dynamics import (
    GROWTH,
    SWEEP,
    TARGET,
    case_rows,
    draw_sweep,
    fitted_exponent,
    headlines,
    sweep_rows,
    with_ratios,
)
from gearmon.benchmark.equations import CASES, QUICK, Case, growing_turn, pair, square_wave
from gearmon.benchmark.timing import facts_of_run, interleaved
from gearmon.dynamics import steady_state
from gearmon.errors import ArgumentError
from gearmon.report.plots import save_all
from gearmon.signatures.expected.fault_family import fault_family

#: What each job of many solutions is done with.
OF_JOBS = {SWEEP: "sweep", "stability chart": "stability_chart", "fault family": "fault_family"}
OUR_PAIR = ("pair", "steady_state", True)
OF_SUM = "steady_state of the Fourier sum"
COLUMNS = {
    "case",
    "method",
    "setting",
    "wanted",
    "error",
    "error_bound",
    "median_s",
    "fastest_s",
    "repeats",
    "unknowns",
    "sets",
    "note",
    "exponent",
    "times_ours",
    "times_ours_fastest",
    "at_target",
}


@pytest.fixture(scope="module")
def rows():
    seen = []
    found = run_case("dynamics", seen.append, quick=True)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
    return found


def test_rows_are_one_tidy_table(rows):
    assert all(set(row) == set(rows[0]) for row in rows)
    assert set(rows[0]) >= COLUMNS | {"numpy", "scipy", "numba", "model", "cores", "gearmon"}
    json.dumps(rows, allow_nan=False)
    for row in rows:
        if row["median_s"] is None:
            assert row["note"]
        else:
            assert 0 < row["fastest_s"] <= row["median_s"]
            assert row["repeats"] >= 1


def test_bounds_hold(rows):
    judged = [row for row in rows if row["error_bound"] and row["error"]]
    assert len(judged) > 20
    for row in judged:
        assert row["error"] <= row["error_bound"] * (1 + 1e-9)


def test_tuned_rivals_meet_the_target(rows):
    """A rival that misses would be marked, and its run time not used."""
    cases = {row["case"] for row in rows} - {GROWTH}
    for case in cases:
        chosen = {r["method"]: r for r in rows if r["case"] == case and r["at_target"]}
        assert all(row["error"] <= TARGET for row in chosen.values())
        # no Fourier sum comes within the target of true jumps
        if case != "rectangle":
            assert chosen[OF_JOBS.get(case, "steady_state")]["times_ours"] == 1.0
        wanted = set() if case in {*OF_JOBS, "rectangle"} else {"SciPy odeint", "solve_banded"}
        if not rivals.NOT_COMPILED:
            wanted.add("compiled RK4")
        assert wanted <= set(chosen)


def test_each_method_is_marked_where_it_is_cheapest_within_the_error():
    told = [
        ("steady_state", TARGET, 4.0, 1e-7),
        ("steady_state", 1e-4, 1.0, 1e-8),  # a lucky one, which nobody asks for
        ("compiled RK4", TARGET, 8.0, 1e-7),
        ("plain sum", None, 3.0, 1e-3),
        ("plain sum", None, 6.0, 1e-9),
        ("plain sum", None, 5.0, 1e-8),
        ("solve_banded", TARGET, None, None),
    ]
    names = ("method", "wanted", "median_s", "error")
    rows = [dict(zip(names, one, strict=True)) | {"fastest_s": one[2]} for one in told]
    marked = with_ratios(rows)
    assert [row["at_target"] for row in marked] == [True, False, True, False, False, True, False]
    assert [row["times_ours"] for row in marked] == [1.0, 0.25, 2.0, 0.75, 1.5, 1.25, None]


def test_missing_numba_is_told(monkeypatch):
    monkeypatch.setattr(rivals, "NOT_COMPILED", "numba is not installed")
    rows = [*case_rows(CASES["resonance w"], quick=True), *sweep_rows(50, 0, quick=True)]
    absent = [row for row in rows if row["method"] == "compiled RK4"]
    assert len(absent) == 2
    assert {row["note"] for row in absent} == {"numba is not installed"}
    assert all(row["median_s"] is None and not row["at_target"] for row in absent)


def test_headlines(rows):
    lines = {line["case"]: line for line in headlines(rows)}
    assert list(lines) == list(dict.fromkeys(row["case"] for row in rows))
    assert lines["pair"]["solve_banded"] > 0
    assert lines["pair"]["ours_us"] > 0
    assert lines["pair"]["odeint"] > 0


def test_headlines_are_in_microseconds(rows):
    (line,) = [line for line in headlines(rows) if line["case"] == "pair"]
    times = {r["method"]: r["median_s"] for r in rows if r["case"] == "pair" and r["at_target"]}
    assert line["ours_us"] == pytest.approx(1e6 * times["steady_state"])
    slower = times["SciPy odeint"] / times["steady_state"]
    assert line["odeint"] == pytest.approx(slower)


@pytest.mark.parametrize("meshes", [1, 8])
def test_a_growing_turn_has_one_gaussian_dip(meshes):
    """Beside the square wave of the mesh: 0.1 deep, a quarter of a mesh period its deviation."""
    own = growing_turn(meshes).stiffness_harmonics.copy()
    own[meshes - 1 :: meshes] -= square_wave(10)
    phase = np.arange(64 * meshes) / 64
    found = np.fft.irfft(np.append(0j, own), len(phase), norm="forward")
    away = phase[:, None] - meshes * np.arange(-9, 10)
    dip = -0.1 * np.exp(-(away**2) / (2 * 0.25**2)).sum(axis=1)
    np.testing.assert_allclose(found, dip - dip.mean(), atol=1e-6)


def test_unknowns_are_the_harmonics_that_were_solved_for(rows):
    """The mean and every harmonic of the answer to the case, and their number alone."""
    (row,) = (r for r in rows if (r["case"], r["method"], r["at_target"]) == OUR_PAIR)
    solved = steady_state(CASES["pair"]().problem, row["wanted"])
    assert row["unknowns"] == len(solved.displacement)


def test_times_of_a_family_are_those_of_a_member(rows):
    family = fault_family(dynamics.MACHINE, dynamics.KINDS[:1], tolerance=TARGET)
    (row,) = (r for r in rows if r["method"] == OF_JOBS["fault family"])
    assert row["sets"] == len(family) > len(family.members[:: dynamics.TAKEN])


def test_the_error_of_a_family_is_that_of_the_worst_member(monkeypatch):
    monkeypatch.setattr(rivals, "NOT_COMPILED", "numba is not installed")
    monkeypatch.setattr(dynamics, "TAKEN", 1)
    family = fault_family(dynamics.MACHINE, dynamics.KINDS[:1], tolerance=TARGET)
    (row,) = (r for r in dynamics.family_rows(quick=True) if r["median_s"] is not None)
    assert len(family) > 1
    assert row["error"] == pytest.approx(max(own.lines.error for own in family.members), rel=1e-6)


def test_sums_of_a_rectangle_are_judged_by_its_jumps(rows):
    """No bound of a sum is one of the true jumps, which more harmonics come nearer to."""
    told = [r for r in rows if (r["case"], r["method"]) == ("rectangle", OF_SUM)]
    assert {row["error_bound"] for row in told} == {None}
    errors = [row["error"] for row in told]
    assert len(errors) > 2
    assert errors == sorted(errors, reverse=True)


def test_fixed_orders_gain_accuracy(rows):
    errors = [
        row["error"]
        for row in rows
        if row["case"] == "pair" and row["method"] == "multiple scales, plain sum"
    ]
    assert errors == sorted(errors, reverse=True)


def test_runs_as_a_case(rows):
    assert {row["case"] for row in rows} == {*QUICK, GROWTH, *OF_JOBS}


def test_summary_and_pictures_by_case(rows, tmp_path):
    assert summary_rows("dynamics", rows) == headlines(rows)
    shown = summary_rows("memory", rows)
    # what it ran on is for the file
    assert {*rows[0]} - {*shown[0]} == {"fastest_s", "repeats", *facts_of_run()} & {*rows[0]}
    assert [row["median_s"] for row in shown] == [row["median_s"] for row in rows]
    paths = save_all(case_figures("dynamics", rows), tmp_path / "b.svg")
    assert [path.stem for path in paths] == ["b"]
    with pytest.raises(ArgumentError, match="'memory' has no pictures"):
        save_all(case_figures("memory", rows), tmp_path / "b.svg")


def test_sweep_is_seeded():
    first, again, other = ([p.mass_kg for p in draw_sweep(5, seed)] for seed in (3, 3, 4))
    assert first == again
    assert first != other


@pytest.mark.parametrize("power", [0.8, 1.0, 2.5])
def test_exponent_is_that_of_the_time_over_the_unknowns(power):
    rows = [{"unknowns": n, "median_s": 1e-7 * n**power} for n in (10, 3000, 8000, 50_000)]
    rows[0]["median_s"] = 1.0  # too small to count
    assert fitted_exponent(rows) == pytest.approx(power)


def test_exponent_needs_sizes():
    assert fitted_exponent([{"unknowns": 10, "median_s": 1.0}]) is None


def test_a_turn_errs_in_parts_of_what_its_fault_adds():
    (member,) = fault_family(dynamics.MACHINE, ["crack"], ["20%"], ["pinion"], max_hz=5e3)
    turn, whole = dynamics._Turn(member), member.lines.acceleration
    added = whole.copy()
    added[member.lines.period - 1 :: member.lines.period] -= member.sound.acceleration
    vars(turn)["exact"] = whole
    for share in (0.0, 0.1, 2.0):
        assert turn.error(whole - share * added) == pytest.approx(share)


def test_a_run_sweeps_as_many_sets_as_are_asked_for_by_its_seed(monkeypatch):
    asked = []
    for name in ("case_rows", "chart_rows", "family_rows", "growth_rows"):
        monkeypatch.setattr(dynamics, name, lambda *_: [])
    monkeypatch.setattr(dynamics, "sweep_rows", lambda *given: asked.append(given) or [])
    assert dynamics.run_dynamics(seed=7, count=30) == []
    assert dynamics.run_dynamics(quick=True, seed=8) == []
    assert asked == [(30, 7, False), (200, 8, True)]


def test_tasks_are_taken_in_turn():
    calls = []
    timings = interleaved([lambda: calls.append("a"), lambda: calls.append("b")], most=3)
    assert "".join(calls) == "ab" + 3 * "ab"  # once before, then in turn
    assert [timing.repeats for timing in timings] == [3, 3]


def test_long_task_runs_once():
    calls = []

    def task():
        calls.append(sum(range(20_000)))

    (timing,) = interleaved([task], most=9, budget_s=1e-7)
    assert len(calls) == timing.repeats == 1


@pytest.mark.parametrize(("zeta", "ratio"), [(None, None), (0.05, None), (None, 2.0), (0.2, 0.5)])
@pytest.mark.parametrize("meshes", [1, 26])
def test_a_pair_has_the_damping_the_resonance_and_the_period_that_are_told(zeta, ratio, meshes):
    """zeta = c/(2 sqrt(k m)); w0/w counts mesh frequencies, of which a period has some."""
    found = pair([0.1, 0.02j], zeta, ratio, meshes)
    stiffness, mass = found.stiffness_n_per_m, found.mass_kg
    damping = found.damping_ns_per_m / (2 * np.sqrt(stiffness * mass))
    assert damping == pytest.approx(0.3007 if zeta is None else zeta, rel=1e-3)
    natural_hz = np.sqrt(stiffness / mass) / (2 * np.pi)
    mesh_hz = meshes / found.period_s
    assert natural_hz / mesh_hz == pytest.approx(13.6115 if ratio is None else ratio, rel=1e-5)
    assert found.stiffness_harmonics.tolist() == [0.1, 0.02j]
    for name, case in CASES.items():
        if name.startswith(("resonance", "damping")):
            own = case().problem
            known = {"w": 1.0, "2w": 2.0, "w/2": 0.5, "13.6w": 13.6}.get(name.split()[1])
            natural_hz = np.sqrt(own.stiffness_n_per_m / own.mass_kg) / (2 * np.pi)
            assert known is None or natural_hz * own.period_s == pytest.approx(known)


def test_a_rectangle_is_that_of_its_fourier_sum():
    case, share = Case(problem=pair(square_wave(4000)), rectangle=0.13), np.arange(200) / 200
    j = np.arange(1, 4001)
    waves = np.exp(2j * np.pi * np.outer(share, j))
    summed = 1 + 2 * (waves @ case.problem.stiffness_harmonics).real
    away = np.abs((share - 0.25 + 0.25) % 0.5 - 0.25) > 0.01
    np.testing.assert_allclose(summed[away], case.level(share)[away], atol=2e-3)
    assert case.level([0.0, 0.5]).tolist() == [1.13, 0.87]


@pytest.mark.parametrize("meshes", [7, 26])
def test_a_turn_dips_once_about_its_beginning_under_the_waves_of_its_meshes(meshes):
    """A Gaussian of a tenth, a quarter mesh period wide, but for its mean, and the square waves."""
    found = growing_turn(meshes)
    place = np.arange(40 * meshes) / 40
    j = np.arange(1, len(found.stiffness_harmonics) + 1)
    waves = np.exp(2j * np.pi * np.outer(place / meshes, j))
    stiffness = 2 * (waves @ found.stiffness_harmonics).real
    k = np.arange(1, 11)
    mesh = 2 * (np.exp(2j * np.pi * np.outer(place, k)) @ square_wave(10)).real
    away = (place + meshes / 2) % meshes - meshes / 2
    dip = -0.1 * np.exp(-0.5 * (away / 0.25) ** 2)
    np.testing.assert_allclose(stiffness - mesh, dip - dip.mean(), atol=1e-6)


@pytest.mark.parametrize(("name", "meshes"), [("cracked tooth", 26), ("hunting period", 26 * 53)])
def test_cases_of_cracks_have_ten_harmonics_a_mesh_over_their_whole_period(name, meshes):
    case = CASES[name]()
    harmonics = case.problem.stiffness_harmonics
    assert (case.meshes, len(harmonics)) == (meshes, 10 * meshes)
    assert case.problem.period_s == pytest.approx(meshes * 1.6e-3)
    # the mesh stands out of what the crack leaves between its harmonics
    mesh = np.abs(harmonics[meshes - 1 :: meshes])
    between = np.delete(np.abs(harmonics), np.s_[meshes - 1 :: meshes])
    assert mesh[0] > 10 * between.max() > 0


@pytest.mark.skipif(bool(rivals.NOT_COMPILED), reason="numba is not installed")
def test_a_turn_that_is_marched_has_the_lines_of_the_family():
    (member,) = fault_family(
        dynamics.MACHINE, ["crack"], ["20%"], ["pinion"], max_hz=5e3, tolerance=1e-9
    )
    turn, lines = dynamics._Turn(member), member.lines.acceleration
    errors = []
    for steps in (16, 32, 64):
        marched = turn.lines(*turn.marched(steps)())
        errors.append(np.linalg.norm(marched - lines) / np.linalg.norm(lines))
    assert errors[2] < 3e-6
    np.testing.assert_allclose(np.log2(np.divide(errors[:2], errors[1:])), 4.0, atol=0.15)
