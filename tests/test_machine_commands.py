"""What the commands that start from a machine file show, and what they hand on."""

from __future__ import annotations

import json
import math
import re
from argparse import ArgumentTypeError
from dataclasses import replace

import pytest
from reference.small_gearbox import MACHINE_FILE

import gearmon
from gearmon.cli import main
from gearmon.commands.command import loss_of, machine_of
from gearmon.dynamics import floquet
from gearmon.errors import ArgumentError
from gearmon.signals.recording import Recording
from gearmon.signatures.expected.mesh import mesh_problem

SECOND = """
[[stage]]
kind = "parallel"
pinion_teeth = 19
gear_teeth = 71
module_mm = 3.5
face_width_mm = 40.0
"""
POINTS = """
[[operating]]
speed_rpm = {}
torque_nm = {}
share = 0.5
"""


@pytest.fixture
def machine(tmp_path):
    path = tmp_path / "machine.toml"
    path.write_text(MACHINE_FILE)
    return path


def rows_below(text, heading):
    """Cells of the table whose head has this column, counted from the right: some are empty."""
    lines = text.splitlines()
    start = next(n for n, line in enumerate(lines) if heading in line.split())
    cells = [line.split() for line in lines[start + 1 :]]
    end = next((n for n, own in enumerate(cells) if not own or own[0].startswith("(")), len(cells))
    names = lines[start].split()[::-1]
    return [dict(zip(names, own[::-1], strict=False)) for own in cells[:end]]


def test_the_strongest_lines_are_shown(machine, capsys):
    crack = "crack:1:pinion:5:20%"
    assert main(["baseline", str(machine), "--fault", crack, "--max-hz", "4000"]) == 0
    out = capsys.readouterr().out
    shown = [float(row["acceleration_ms2"]) for row in rows_below(out, "mesh_harmonic")]
    places = [float(row["frequency_hz"]) for row in rows_below(out, "mesh_harmonic")]
    assert places == sorted(places)
    lines = gearmon.expected_signature(machine, [crack], max_hz=4000.0)["acceleration_ms2"]
    assert len(shown) == 30 < len(lines)
    assert sorted(shown) == pytest.approx(sorted(lines.tolist())[-30:], rel=1e-5)


def test_the_largest_multiplier_is_that_of_the_sentence(tmp_path, capsys):
    """Beyond critical damping both are real: the slower vibration counts."""
    path = tmp_path / "machine.toml"
    path.write_text(MACHINE_FILE + "damping_ratio = 1.6\n")
    assert main(["stability", str(path), "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    told = float(re.search(r"shrink by the factor (\S+) a period", row["says"])[1])
    assert row["largest_multiplier"] == pytest.approx(told, rel=1e-5)


@pytest.mark.parametrize("damping_ratio", [0.01, 1.6])
def test_how_much_more_variation_would_be_unstable_is_told_if_any_would(
    tmp_path, capsys, damping_ratio
):
    path = tmp_path / "machine.toml"
    path.write_text(MACHINE_FILE + f"damping_ratio = {damping_ratio}\n")
    assert main(["stability", str(path), "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    factor = row["unstable_at_variation_times"]
    problem = mesh_problem(gearmon.load_machine(path), 1, harmonics=12)
    if damping_ratio > 1:
        assert factor is None
        return
    assert factor > 1
    for share, stable in ((0.999, True), (1.001, False)):
        harmonics = share * factor * problem.stiffness_harmonics
        multipliers = floquet.multipliers(problem.frequency_ratio, problem.damping_ratio, harmonics)
        assert (abs(multipliers[0]) < 1) == stable


def test_meetings_nearest_to_the_operating_speed_are_shown(tmp_path, capsys):
    path = tmp_path / "machine.toml"
    path.write_text(MACHINE_FILE + SECOND)
    assert main(["modes", str(path), "--harmonics", "40", "--to-rpm", "20000"]) == 0
    said = capsys.readouterr().out
    shown = [float(row["speed_rpm"]) for row in rows_below(said, "speed_rpm")]
    found = gearmon.modes(path, harmonics=40, highest_rpm=20_000.0)
    driven = [own.speed_rpm for own in found.campbell if own.drives]
    assert f"20 of {len(driven)} meetings that mesh forces drive" in said
    nearest = sorted(driven, key=lambda rpm: max(rpm / 2960.0, 2960.0 / rpm))[:20]
    assert len(driven) > 20
    assert shown == pytest.approx(sorted(nearest), rel=1e-5)


def test_only_meetings_that_mesh_forces_drive_are_counted(machine, monkeypatch, capsys):
    whole = gearmon.modes(machine, harmonics=12)
    still = tuple(
        replace(own, mesh_share=own.mesh_share if k % 3 else 0.0)
        for k, own in enumerate(whole.campbell)
    )
    driven = len([own for own in still if own.drives])
    assert 0 < driven < len(still)
    monkeypatch.setattr(gearmon, "modes", lambda *_, **__: replace(whole, campbell=still))
    assert main(["modes", str(machine)]) == 0
    said = capsys.readouterr().out
    assert f"{min(driven, 20)} of {driven} meetings that mesh forces drive" in said


def test_a_table_without_rows_keeps_its_columns(machine, tmp_path, monkeypatch):
    """Up to 1 rpm no mesh harmonic meets a natural frequency."""
    monkeypatch.setattr("gearmon.report.save_all", lambda *_: [])
    heads = []
    for rpm in ("1", "20000"):
        target = tmp_path / f"modes{rpm}.csv"
        assert main(["modes", str(machine), "--to-rpm", rpm, "-o", str(target)]) == 0
        heads.append(target.with_name(f"modes{rpm}-campbell.csv").read_text().splitlines())
    empty, full = heads
    assert empty == full[:1]
    assert "speed_rpm" in full[0].split(",")
    assert len(full) > 1


def test_a_speed_hint_belongs_to_the_nearest_operating_point(tmp_path):
    """Its load counts, at the speed that is known better."""
    path = tmp_path / "machine.toml"
    stage = MACHINE_FILE[MACHINE_FILE.index("[[stage]]") :]
    path.write_text(POINTS.format(1000.0, 40.0) + POINTS.format(2960.0, 120.0) + stage)
    for hint, torque in ((990.0, 40.0), (1900.0, 40.0), (2100.0, 120.0), (3100.0, 120.0)):
        (point,) = machine_of(str(path), hint).operating
        assert (point.speed_rpm, point.torque_nm, point.share) == (hint, torque, 1.0)
    assert len(machine_of(str(path)).operating) == 2


def test_a_loss_may_be_all_and_not_nothing():
    told = {"100%": 1.0, "1": 1.0, "20%": 0.2, "0.5": 0.5, "0.01%": 1e-4}
    assert {text: loss_of(text) for text in told} == pytest.approx(told)
    for text in ("0", "0%", "100.1%", "-5%", "1.01", "20 percent"):
        with pytest.raises(ArgumentTypeError, match="must be a loss"):
            loss_of(text)


def test_members_of_a_family_are_told_by_what_is_damaged_and_how_much(machine, capsys):
    words = ["--kind", "crack", "--size", "10%", "--size", "20%", "--gear", "1:pinion"]
    assert main(["family", str(machine), *words, "--max-hz", "8000"]) == 0
    head, *rows = [line.split() for line in capsys.readouterr().out.splitlines() if line][:3]
    assert {"stage", "gear", "kind", "size", "loss"} <= set(head)
    assert not {"teeth", "lines", "method"} & set(head)
    told = [dict(zip(head, row, strict=False)) for row in rows]
    assert [(own["stage"], own["gear"], own["kind"]) for own in told] == 2 * [
        ("1", "pinion", "crack")
    ]
    assert 0 < float(told[0]["loss"]) < float(told[1]["loss"])


def test_members_of_a_family_are_written_as_far_as_was_asked(machine, tmp_path):
    words = ["--kind", "crack", "--size", "20%", "--gear", "1:pinion", "--max-hz", "8000"]
    target = tmp_path / "family.csv"
    limits = ["--mesh-harmonics", "4", "--sidebands", "2"]
    assert main(["family", str(machine), *words, *limits, "-o", str(target)]) == 0
    table = gearmon.read_signature(target).to_frame()
    assert (table["mesh_harmonic"].min(), table["mesh_harmonic"].max()) == (1, 4)
    assert (table["sideband"].min(), table["sideband"].max()) == (-2, 2)


def test_harvest_hands_on_all_that_recordings_are_given_with(machine, monkeypatch, capsys):
    handed = {}

    def survey(*given, **options):
        handed.update(options, recordings=given[2])
        raise ArgumentError("seen")

    def read(path, **_):
        return Recording(samples=[[0.0] * 9], sampling_rate_hz=1.0, origin=str(path))

    monkeypatch.setattr("gearmon.harvesting.placement.survey_measured", survey)
    monkeypatch.setattr("gearmon.signals.recording.read_recording", read)
    words = ["--share", "0.7", "--share", "0.2", "--share-error", "0.03", "--count", "2"]
    damaged = ["--degraded", "c.csv", "--degraded", "d.csv"]
    assert main(["harvest", str(machine), "a.csv", "b.csv", *words, *damaged]) == 2
    assert "seen" in capsys.readouterr().err
    assert [own.origin for own in handed["recordings"]] == ["a.csv", "b.csv"]
    assert [own.origin for own in handed["degraded"]] == ["c.csv", "d.csv"]
    assert (list(handed["shares"]), handed["share_error"], handed["count"]) == ([0.7, 0.2], 0.03, 2)


def test_a_picture_of_others_beside_the_table_stops_the_command_before_it_writes(
    machine, tmp_path, capsys
):
    (tmp_path / "lines.png").write_bytes(b"a photograph")
    target = tmp_path / "lines.csv"
    assert main(["baseline", str(machine), "--max-hz", "2000", "-o", str(target)]) == 2
    assert "lines.png: exists, and gearmon baseline did not write it" in capsys.readouterr().err
    assert not target.exists()
    assert (tmp_path / "lines.png").read_bytes() == b"a photograph"


def test_stability_tells_mesh_and_natural_frequencies_and_how_fast_vibrations_die(machine, capsys):
    """Where nothing grows, a period shrinks them by exp(-2 pi zeta w0/w)."""
    assert main(["stability", str(machine), "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert row["stable"]
    assert row["mesh_frequency_hz"] == pytest.approx(23 * 2960 / 60)
    ratio = row["natural_frequency_hz"] / row["mesh_frequency_hz"]
    assert row["frequency_ratio"] == pytest.approx(ratio)
    decay = math.exp(-2 * math.pi * row["damping_ratio"] * ratio)
    assert row["largest_multiplier"] == pytest.approx(decay, rel=1e-6)


def test_endings_in_capitals_mean_what_small_ones_do(machine, tmp_path):
    for ending in (".csv", ".CSV", ".Csv"):
        assert main(["lines", str(machine), "-o", str(tmp_path / f"lines{ending}")]) == 0
    first, *others = ((tmp_path / f"lines{own}").read_text() for own in (".csv", ".CSV", ".Csv"))
    assert first.startswith("operating,")
    assert others == [first, first]
