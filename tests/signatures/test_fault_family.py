"""Families of signatures against full solves, slow integration, and laws they must obey."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearmon import read_recording, simulate
from gearmon.cli import main
from gearmon.errors import ArgumentError
from gearmon.gears.assembly import drive_train
from gearmon.gears.stiffness import mesh_stiffness
from gearmon.machine import load_machine
from gearmon.signatures.expected.baseline import contact_grid, expected_signature, faulty_lines
from gearmon.signatures.expected.fault_family import FAMILY_KINDS, fault_family
from gearmon.signatures.expected.mesh import MeshPlace
from gearmon.signatures.expected.tooth_response import (
    GROWN,
    grown_lines,
    loss_response,
    tooth_response,
)
from gearmon.signatures.signature import read_signature, write_signature

FOLDER = Path(__file__).resolve().parents[2] / "signatures"
PAIR = load_machine(FOLDER / "reference_pair.toml")
COMBINE = load_machine(FOLDER / "combine_gearbox.toml")
PTO = load_machine(FOLDER / "tractor_pto.toml")


def lines_of(signature, stage):
    """Complex acceleration by place of the line, of one stage."""
    kept = signature["stage"] == stage
    values = signature["acceleration_ms2"] * np.exp(1j * signature["phase_rad"])
    names = ("mesh_harmonic", "sideband", "sideband_of")
    places = zip(*(signature[name][kept].tolist() for name in names), strict=True)
    return dict(zip(places, values[kept], strict=True))


def distances(made, full, stage):
    """Relative distances of all lines, and of those that are no mesh harmonics."""
    mine, other = lines_of(made, stage), lines_of(full, stage)
    places = sorted(mine.keys() & other.keys())
    assert len(places) >= 0.95 * max(len(mine), len(other))
    difference = np.array([mine[place] - other[place] for place in places])
    truth = np.array([other[place] for place in places])
    side = np.array([place[1] != 0 for place in places])
    whole = np.linalg.norm(difference) / np.linalg.norm(truth)
    if not side.any():
        return whole, 0.0
    return whole, np.linalg.norm(difference[side]) / np.linalg.norm(truth[side])


@pytest.mark.parametrize(
    ("machine", "kind", "stage", "gear", "size", "tooth"),
    [
        (PAIR, "crack", 1, "pinion", "20%", 5),
        (PAIR, "pitting", 1, "gear", "40%", 53),
        (PAIR, "wear", 1, "gear", "10%", 1),
        (COMBINE, "crack", 1, "gear", "1.5mm", 11),
        (COMBINE, "breakage", 1, "pinion", "20%", 60),
        (COMBINE, "spall", 2, "pinion", "40%", 23),
        (COMBINE, "spall", 2, "gear", "10x2x0.3mm", 2),
        (COMBINE, "pitting", 2, "gear", "12%flank", 3),
        (COMBINE, "wear", 1, "gear", "0.02mm", 1),
        (COMBINE, "pitch", 1, "gear", "5um", 7),
        (COMBINE, "eccentricity", 1, "pinion", "20um", 1),
        (COMBINE, "cumulative", 2, "pinion", "20um", 1),
        (PTO, "missing", 1, "pinion", "1tooth", 4),
        (COMBINE, "missing", 1, "gear", "1tooth", 4),
    ],
)
def test_member_is_the_full_solve(machine, kind, stage, gear, size, tooth):
    family = fault_family(
        machine,
        kinds=[kind],
        sizes=[size] if kind != "missing" else None,
        gears=[(stage, gear)],
        operating=0,
    )
    (member,) = family
    full = expected_signature(machine, faults=[member.fault(tooth)], tolerance=1e-5)
    whole, side = distances(member.lines.columns(tooth), full, stage)
    # the bound of the full solve; the share of cut harmonics in it is an estimate, off by up to 2
    told = full.header["stages"][stage - 1]
    bound = 2 * (told["error_bound"] or told["error_estimate"])
    assert whole < bound
    assert member.lines.mean_m == pytest.approx(told["mean_deflection_m"], rel=bound)
    # the bound is relative to all lines
    levels = family.rows()[0]
    if levels["sidebands_ms2"]:
        assert side < bound * max(1.0, levels["healthy_ms2"] / levels["sidebands_ms2"]) * 2


def test_misalignment_is_the_full_solve():
    family = fault_family(COMBINE, kinds=["misalignment"], sizes=["20um"], gears=["1:gear"])
    member = family.members[0]
    full = expected_signature(COMBINE, faults=[member.fault()], tolerance=1e-6)
    assert max(distances(member.lines.columns(), full, 1)) < 1e-6


def test_healthy_is_the_expected_signature():
    family = fault_family(COMBINE, kinds=["wear"], sizes=["5%"])
    full = expected_signature(COMBINE, operating=1)
    for stage in (1, 2):
        healthy, told = family.healthy[1, stage, 0], full.header["stages"][stage - 1]
        assert max(distances(healthy.columns(), full, stage)) < 1e-6
        assert healthy.mean_m == pytest.approx(told["mean_deflection_m"], rel=1e-6)


def test_wear_is_a_softer_mesh():
    family = fault_family(PAIR, kinds=["wear"], sizes=["20%"], gears=["pinion"], max_hz=1.7e4)
    stage = replace(PAIR.stages[0], mesh_stiffness_n_per_m=6.4e8)
    soft = fault_family(
        replace(PAIR, stages=(stage,)), kinds=["wear"], sizes=["0%"], gears=["pinion"], max_hz=1.7e4
    )
    member, other = family.members[0], soft.members[0]
    assert member.loss == pytest.approx(0.2, rel=1e-12)
    assert member.lines.acceleration == pytest.approx(other.lines.acceleration, rel=1e-9)
    assert other.lines.acceleration == pytest.approx(soft.healthy[(0, 1, 0)].acceleration, rel=1e-9)


def test_a_loss_of_one_tooth_is_told_of_its_pair_and_not_of_the_turn():
    """Over its whole contact a cracked tooth lacks what is asked for, a pitted one a part of it."""
    family = fault_family(PTO, kinds=["crack", "pitting"], sizes=["5%", "20%"], max_hz=5e3)
    assert {member.gear for member in family} == {"pinion", "gear"}
    for member in family:
        asked = float(member.size.removesuffix("%")) / 100
        share = 1.0 if member.kind == "crack" else 0.3
        # where pits are carries more than the ends of the contact
        assert member.loss == pytest.approx(share * asked, rel=0.25 * (1 - share) + 1e-9)


@pytest.mark.parametrize("text", ["pitch:1:pinion:1:20um", "missing:1:pinion:1"])
def test_jumping_excitation_against_slow_integration(text):
    # the full solve cuts the harmonics of jumps: only an integration from corner to corner can say
    healthy, turn = MeshPlace(PTO, 1).alone(), MeshPlace(PTO, 1).alone([text])
    own, period = turn.mechanics, turn.period
    grid = contact_grid([healthy, turn], 12e3)
    count = 3 * period
    (found,) = faulty_lines(healthy, [turn], 3.001 * own.mesh_frequency_hz, 1.0)
    made = found.displacement
    lines = stepped_lines(turn, grid.edges, count)
    orders = np.arange(1, count + 1)
    error = np.linalg.norm(orders**2 * (lines - made)) / np.linalg.norm(orders**2 * made)
    assert error < 2e-5
    assert own.mesh_frequency_hz == pytest.approx(540.03, abs=0.1)


def stepped_lines(turn, edges, count, steps=150):
    """Harmonics of z over a turn, in steps of constant k and e from corner to corner.

    q = z' - (c/m) e has no jump where e has one.
    """
    own, period = turn.mechanics, turn.period
    inner = [np.linspace(*ends, steps + 1)[:-1] for ends in pairwise(edges)]
    place = np.concatenate([np.concatenate(inner) + mesh for mesh in range(period)])
    place = np.append(place, period)
    middle, step = 0.5 * (place[1:] + place[:-1]), np.diff(place) / own.mesh_frequency_hz
    stiffness, error = own.stiffness.at(middle), turn.members[0].excitation.at(middle)
    mass, half = own.equivalent_mass_kg, own.damping_ns_per_m / (2 * own.equivalent_mass_kg)
    rate = np.sqrt(stiffness / mass - half**2)
    fade, even, odd = np.exp(-half * step), np.cos(rate * step), np.sin(rate * step) / rate
    maps = np.array(
        [
            [fade * (even + half * odd), fade * odd],
            [-fade * odd * stiffness / mass, fade * (even - half * odd)],
        ]
    ).transpose(2, 0, 1)
    rest = np.stack([own.force_n / stiffness + error, -2 * half * error], axis=1)
    push = rest - (maps @ rest[:, :, None])[:, :, 0]
    state, path = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), []
    for own_map, own_push in zip(maps, push, strict=True):
        path.append(state[0])
        state = own_map @ state
        state[:, 0] += own_push
    path.append(state[0])
    start = np.linalg.solve(np.eye(2) - state[:, 1:], state[:, 0])
    z = np.array(path) @ np.append(1.0, start)
    turned = np.exp(-2j * np.pi / period * np.outer(np.arange(1, count + 1), place)) * z
    return ((turned[:, 1:] + turned[:, :-1]) / 2 * np.diff(place)).sum(axis=1) / period


@pytest.mark.parametrize(
    ("kind", "gear"), [("crack", "pinion"), ("pitting", "gear"), ("spall", "pinion")]
)
def test_small_losses_are_the_response_per_unit(kind, gear):
    response = loss_response(COMBINE, 2, gear, max_order=300.0, kind=kind)
    family = fault_family(
        COMBINE,
        kinds=[kind],
        sizes=[0.005, 0.01],
        gears=[(2, gear)],
        operating=0,
        max_hz=300.0 * COMBINE.operating[0].shaft1_hz,
    )
    left = []
    for member in family:
        exact = member.lines.acceleration - response.mesh_acceleration
        left.append(np.linalg.norm(exact - member.loss * response.acceleration))
    # what a response per unit leaves out is of second order
    assert left[1] / left[0] == pytest.approx(4, rel=0.05)


@given(
    loss=st.floats(1e-3, 0.6),
    gear=st.sampled_from(["pinion", "gear"]),
    kind=st.sampled_from(["crack", "breakage", "pitting", "spall"]),
)
def test_response_at_a_loss_is_the_member_of_that_loss(loss, gear, kind):
    response = loss_response(COMBINE, 1, gear, max_order=100.0, kind=kind, loss=loss)
    (member,) = fault_family(
        COMBINE,
        kinds=[kind],
        sizes=[loss],
        gears=[(1, gear)],
        operating=0,
        max_hz=100.0 * COMBINE.operating[0].shaft1_hz,
    )
    assert response.loss == pytest.approx(member.loss, rel=1e-9)
    whole = response.mesh_acceleration + response.loss * response.acceleration
    exact = member.lines.acceleration
    assert whole == pytest.approx(exact, abs=1e-6 * abs(exact).max())


@pytest.mark.parametrize(("machine", "stage"), [(PAIR, 1), (PTO, 1), (COMBINE, 1), (COMBINE, 2)])
def test_shares_of_the_pairs_in_contact_add_up_to_the_mesh(machine, stage):
    share = tooth_response(machine, stage, "gear", 50.0).pair_share
    together = np.pad(share, (0, -len(share) % 512)).reshape(-1, 512).sum(axis=0)
    np.testing.assert_allclose(together, 1.0, atol=1e-9)


def test_grown_lines_of_a_train_are_those_of_marching():
    """The slow pinion of a two-stage machine, between perfect flanks pressed together by a load."""
    machine = load_machine(FOLDER / "two_stage_simulator.toml")
    machine = replace(machine, operating=(replace(machine.operating[0], torque_nm=40.0),))
    z, still = 32, ("slip", "speed_drift", "load_drift", "torque_ripple", "unbalance")
    known = dict.fromkeys(still, 0.0) | {"snr_db": None, "accuracy_grade": None, "channels": 1}

    def marched(*faults):
        made = read_recording(simulate(machine, faults, 1.0, 25_600.0, seed=1, **known))
        samples = made.vibration().samples.ravel()
        turns = 10.0 * np.arange(len(samples)) / made.sampling_rate_hz
        waves = np.exp(-2j * np.pi * z * np.outer(np.arange(1, 8), turns))
        return waves @ (np.hanning(len(samples)) * samples)

    sound, loss = marched(), 0.2
    mesh, lines = grown_lines(machine, 2, "pinion", 9 * z)
    expected = lines[GROWN.index(loss), z : 8 * z : z] / mesh[1:8]
    # the path to the sensor is the same for the healthy line and for what is added to it; every
    # third one is a line of the fast mesh too
    own, added = np.arange(1, 8) % 3 > 0, marched(f"crack:2:pinion:1:{loss}") / sound - 1
    assert added[own] == pytest.approx(expected[own], rel=0.03)
    # by itself this mesh would take the fourth harmonic for a fifth of what it is
    alone = loss_response(machine, 2, "pinion", loss=loss)
    fourth = alone.loss * alone.acceleration[4 * z - 1] / alone.mesh_acceleration[4 * z - 1]
    assert abs(fourth) < 0.3 * abs(expected[3])


def test_a_pair_without_shafts_is_its_own_train():
    place = MeshPlace(PAIR, 1)
    for wrong in ((), ("crack:1:gear:3:20%",)):
        alone = place.alone(wrong)
        train = replace(alone, train=drive_train(PAIR, place.point))
        same = [faulty_lines(place.alone(), [own], 2e4, 1e-9)[0] for own in (alone, train)]
        assert same[1].displacement == pytest.approx(same[0].displacement, rel=1e-6, abs=1e-18)


@pytest.mark.parametrize("gear", ["sun", "planet", "ring"])
def test_a_planetary_mesh_follows_a_slow_runout_of_any_of_its_gears(gear):
    """Far below resonance z = e: a line of half of the eccentricity, in whichever mesh it acts."""
    stage = {"kind": "planetary", "sun_teeth": 20, "planet_teeth": 40, "ring_teeth": 100}
    stage |= {"planets": 3, "fixed": "ring", "module_mm": 2.0, "face_width_mm": 20.0}
    operating = {"speed_rpm": 300.0, "torque_nm": 50.0}
    known = load_machine({"operating": operating, "stage": stage})
    (member,) = fault_family(known, ["eccentricity"], ["10um"], [gear]).members
    (once,) = member.lines.displacement[member.lines.number == 1]
    assert abs(once) == pytest.approx(5e-6, rel=0.01)


@pytest.mark.parametrize("gear", ["sun", "ring"])
def test_a_line_of_a_set_is_named_without_its_carrier_where_it_can_be(gear):
    """Planets pass a ring that stands still at whole lines of its own."""
    stage = {"kind": "planetary", "sun_teeth": 20, "planet_teeth": 40, "ring_teeth": 100}
    stage |= {"planets": 4, "fixed": "ring", "module_mm": 2.0, "face_width_mm": 20.0}
    known = load_machine({"operating": {"speed_rpm": 900.0, "torque_nm": 50.0}, "stage": stage})
    (member,) = fault_family(known, ["crack"], ["10%"], [gear], max_hz=1300.0).members
    lines = member.lines.of_tooth(1)
    # z lines a mesh order, and a hundred passes of the carrier
    parts = 100 // lines.period
    places = parts * lines.number + lines.carrier
    named = dict.fromkeys((parts * lines.number[lines.carrier == 0]).tolist())
    aside = places[lines.carrier != 0]
    assert not [at for at in aside.tolist() if at in named]
    whole = (aside % parts == 0) & (aside < places.max())
    assert not whole.any()


def test_all_teeth_alike_damaged_leave_mesh_lines_only():
    response = loss_response(COMBINE, 1, "gear", max_order=200.0)
    later = np.arange(response.teeth)[:, None] * response.number / response.teeth
    table = response.acceleration * np.exp(-2j * np.pi * later)
    total = table.sum(axis=0)
    meshes = response.number % 28 == 0
    assert abs(total[~meshes]).max() < 1e-9 * abs(total).max()
    assert response.order[27] == pytest.approx(61.0)


def test_turns_of_the_family_are_faults_of_other_teeth():
    family = fault_family(COMBINE, kinds=["crack"], sizes=["20%"], gears=["1:gear"], operating=0)
    member = family.members[0]
    first = member.lines.acceleration
    delay = np.exp(-2j * np.pi * 6 * member.lines.number / 28)
    assert member.lines.of_tooth(7).acceleration == pytest.approx(first * delay)
    assert member.lines.order == pytest.approx(member.lines.number * 61 / 28)
    assert str(member.fault(7)) == "crack:1:gear:7:20%"
    assert member.lines.columns(7)["acceleration_ms2"] == pytest.approx(2 * abs(first))


def test_family_costs_far_less_than_full_solves():
    kinds = ("crack", "breakage", "pitting", "spall", "pitch", "wear")
    start = time.process_time()
    family = fault_family(PAIR, kinds=kinds, tolerance=1e-6)
    each = (time.process_time() - start) / len(family)
    assert len(family) == 58
    start = time.process_time()
    for size in ("2.5%", "40%"):
        expected_signature(PAIR, faults=[f"crack:1:gear:1:{size}"], tolerance=1e-6)
    assert (time.process_time() - start) / 2 > 3 * each


def test_default_family_holds_every_kind_gear_and_operating_point():
    family = fault_family(COMBINE, sizes=["5%", "20%", "20um"], max_hz=1500.0)
    places = {(m.kind, m.stage, m.gear, m.operating) for m in family}
    assert len(places) == len(FAMILY_KINDS) * 4 * 2
    assert not family.notes
    assert all(row["error"] <= 1e-6 for row in family.rows() if row["kind"] != "missing")
    rows = {row["size"]: row for row in family.rows() if row["kind"] == "crack"}
    assert rows["5%"]["sidebands_ms2"] < rows["20%"]["sidebands_ms2"]


def test_what_the_machine_cannot_tell_is_left_out_and_named():
    stage = replace(PAIR.stages[0], module_mm=None, face_width_mm=None)
    bare = replace(PAIR, stages=(stage,))
    family = fault_family(bare, max_hz=2e3)
    assert {m.kind for m in family} >= {"crack", "pitting", "wear"}
    assert "missing" not in {m.kind for m in family}
    assert any(
        note.startswith("missing of the pinion of stage 1 left out") for note in family.notes
    )
    with pytest.raises(ArgumentError, match="module_mm"):
        fault_family(bare, kinds=["missing"])


@pytest.mark.parametrize("suffix", [".csv", ".json", ".parquet"])
def test_files_give_back_the_table(tmp_path, suffix):
    if suffix == ".parquet":
        pytest.importorskip("pyarrow")
    family = fault_family(COMBINE, kinds=["crack", "missing"], sizes=["5%"], max_hz=2e3)
    path = tmp_path / f"family{suffix}"
    write_signature(family.table(mesh_harmonics=1, sidebands=2), path)
    table, back = family.table(1, 2), read_signature(path)
    assert abs(back["sideband"]).max() == 2
    assert set(back["kind"]) == {"healthy", "crack", "missing"}
    assert set(back["size"]) == {"", "5%", "1tooth"}
    for name in table.columns:
        assert (back[name] == table[name]).all(), name


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"kinds": ["cracks"]}, "did you mean crack"),
        ({"kinds": []}, "kinds: none given"),
        ({"sizes": ["12parsec"]}, "fits none of the kinds"),
        ({"kinds": ["pitch"], "sizes": [0.2]}, "fits none of the kinds pitch"),
        ({"kinds": ["crack", "pitch"], "sizes": [0.2]}, "no size fits kind 'pitch'"),
        ({"kinds": ["crack"], "sizes": [1.2]}, "120"),
        ({"gears": ["1:sun"]}, "gear '1:sun' is not one of 1:pinion, 1:gear, 2:pinion"),
        ({"gears": ["3:pinion"]}, "gear '3:pinion' is not one of 1:pinion"),
        ({"gears": ["one:pinion"]}, "is not one of 1:pinion"),
        ({"gears": ["wheel"]}, "gear 'wheel' is not one of 1:pinion"),
        ({"operating": 2}, "operating"),
        ({"max_hz": -1.0}, "max_hz"),
        ({"max_hz": 10.0}, "below the lowest mesh frequency"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"kinds": ["crack"], "sizes": ["900mm"]}, "900"),
    ],
)
def test_bad_arguments_get_one_line(arguments, says):
    with pytest.raises(ArgumentError, match=says) as caught:
        fault_family(COMBINE, **arguments)
    assert "\n" not in str(caught.value)


def test_teeth_that_are_not_there_are_refused():
    family = fault_family(PAIR, kinds=["crack", "wear"], sizes=["5%"], gears=["pinion"])
    crack, wear = family.members
    with pytest.raises(ArgumentError, match=r"tooth=27 must lie in \[1, 26\]"):
        crack.lines.of_tooth(27)
    with pytest.raises(ArgumentError, match=r"tooth=2 must lie in \[1, 1\]"):
        wear.lines.of_tooth(2)
    with pytest.raises(ArgumentError, match="kind='wear'"):
        loss_response(PAIR, 1, "pinion", kind="wear")
    with pytest.raises(ArgumentError, match="gear 'sun' is not one of pinion, gear"):
        loss_response(PAIR, 1, "sun")
    with pytest.raises(ArgumentError, match="below the first line"):
        loss_response(PAIR, 1, "pinion", max_order=0.5)


def test_an_unstable_mesh_has_no_family():
    stage = replace(PAIR.stages[0], damping_ns_per_m=1e-8)
    with pytest.raises(ArgumentError, match="free vibrations do not die out"):
        fault_family(replace(PAIR, stages=(stage,)), kinds=["crack"])


def test_command_writes_table_and_picture(tmp_path, capsys):
    target = tmp_path / "family.csv"
    words = [
        "family",
        str(FOLDER / "combine_gearbox.toml"),
        "--kind=crack",
        "--kind=pitch",
        "--size=5%",
        "--size=20%",
        "--size=10um",
        "--operating=0",
        "--max-hz=5000",
        "--mesh-harmonics=2",
        "--sidebands=2",
        "--json",
        "-o",
        str(target),
    ]
    assert main(words) == 0
    result = json.loads(capsys.readouterr().out)
    assert len(result["rows"]) == 4 * 3
    assert (tmp_path / "family.png").read_bytes().startswith(b"\x89PNG")
    assert set(read_signature(target)["kind"]) == {"healthy", "crack", "pitch"}
    assert main(words[:-3]) == 0
    assert "sidebands_ms2" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["-o", "family.txt"], "must end in one of"),
        (["--kind", "crak"], "did you mean crack"),
        (["--size", "20%", "--kind", "pitch"], "fits none"),
    ],
)
def test_command_refuses_in_one_line(words, says, capsys):
    assert main(["family", str(FOLDER / "combine_gearbox.toml"), *words]) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1


def test_what_a_fault_changes_goes_to_none_in_proportion_to_its_loss():
    rows, means = [], []
    for loss in (1e-3, 2e-3, 4e-3):
        family = fault_family(PAIR, kinds=["crack"], sizes=[loss], gears=["pinion"], max_hz=6e3)
        (member,) = family
        rows.append(family.rows()[0]["mesh_change_ms2"])
        means.append(member.lines.mean_m)
    assert rows[1] / rows[0] == pytest.approx(2.0, rel=0.02)
    # a softer pair lets the teeth give way
    assert (means[2] - means[1]) / (means[1] - means[0]) == pytest.approx(2.0, rel=0.02)
    assert means[1] > means[0] > 0


def test_millimetres_are_depths_of_damage_and_no_errors():
    known = {"kinds": ["crack", "pitch"], "gears": ["pinion"], "max_hz": 2e3}
    sized = {
        (member.kind, member.size) for member in fault_family(PAIR, sizes=["1mm", "20um"], **known)
    }
    assert sized == {("crack", "1mm"), ("pitch", "20um")}
    with pytest.raises(ArgumentError, match="no size fits kind 'pitch'"):
        fault_family(PAIR, sizes=["1mm"], **known)


@pytest.mark.parametrize(("gear", "teeth"), [("pinion", 23), ("gear", 61)])
def test_a_small_loss_of_every_tooth_is_that_of_the_mesh(gear, teeth):
    """Of F/k its part of F/k: of a machine told by its teeth alone, with their phases."""
    stage = {"kind": "parallel", "pinion_teeth": 23, "gear_teeth": 61}
    machine = load_machine({"operating": {"speed_rpm": 1500.0}, "stage": stage})
    own = replace(machine.stages[0], module_mm=1.0, face_width_mm=10.0)
    steps, harmonic = 512 * 16, np.arange(1, 9)
    phase = (np.arange(steps) + 0.5) / steps
    waves = np.exp(-2j * np.pi * np.outer(harmonic, phase))
    whole = waves @ (1 / mesh_stiffness(own).at(phase)) / steps * (harmonic * teeth) ** 2
    mesh, lines = grown_lines(machine, 1, gear, 8 * teeth)
    np.testing.assert_allclose(mesh[1:], whole, rtol=2e-3)
    few, more = (lines[i, teeth::teeth] / GROWN[i] for i in (0, 1))
    # what is shed grows with the loss: to the limit of none along a straight line
    limit = few - (more - few) * GROWN[0] / (GROWN[1] - GROWN[0])
    np.testing.assert_allclose(teeth * limit, whole, rtol=2e-3)
