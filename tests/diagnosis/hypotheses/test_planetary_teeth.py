"""Damaged teeth of planetary sets are told by how often they are heard in a turn of the carrier."""

from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from reference.gear_departures import complex_noise

import gearmon
from gearmon.diagnosis.evidence import noticed_from
from gearmon.diagnosis.hypotheses.mesh_harmonics import loss_estimate
from gearmon.diagnosis.hypotheses.tooth_damage import GearEvidence, as_heard
from gearmon.diagnosis.hypotheses.tooth_match import search_gear
from gearmon.diagnosis.law.gear_lines import CONTACT_CENTRE, BandDeviation, GearDeviation
from gearmon.diagnosis.verdict import _sun_held
from gearmon.gears.assembly import drive_train
from gearmon.gears.kinematics import PLANET_PASS_DEPTH, kinematics
from gearmon.machine import Bearing, Machine, OperatingPoint, ParallelStage, PlanetaryStage
from gearmon.signatures.expected.tooth_response import tooth_response, with_floating_sun
from gearmon.signatures.measured.line_plan import line_plan
from gearmon.simulation.train import build_train

FOLDER = Path(__file__).resolve().parents[3] / "signatures"
SUN, PLANET, RING, PLANETS, BANDS = 18, 27, 72, 3, 8
# turns about the carrier for one of the carrier
ORDERS = {"sun": RING / SUN, "planet": RING / PLANET, "ring": 1.0}
TEETH = {"sun": SUN, "planet": PLANET, "ring": RING}


def machine(planets=PLANETS):
    stage = PlanetaryStage(
        sun_teeth=SUN, planet_teeth=PLANET, ring_teeth=RING, planets=planets, fixed="ring"
    )
    return Machine(name="set", operating=(OperatingPoint(speed_rpm=600.0),), stages=(stage,))


def deviation(gear, tooth, seed, height=8.0):
    """A gear in noise, one tooth of which is heard as planets pass the sensor, or none."""
    rng = np.random.default_rng([9, seed])
    teeth, bands = TEETH[gear], []
    for k in range(1, BANDS + 1):
        for side in (0,) if gear == "ring" else (-1, 0, 1):
            number = k * teeth + np.setdiff1d(np.arange(-(teeth // 2), teeth // 2), range(-2, 3))
            step, first = kinematics(machine()).mesh(1).brought_alike(gear, side)
            # a path that differs from band to band
            pulse = np.exp(-2j * np.pi * number * ((tooth or 0) + CONTACT_CENTRE) / teeth)
            pulse = pulse * height * (number % step == first) * complex_noise(rng, 2, 1)
            heard = tooth is not None and (side != 0 or gear == "ring")
            noise = np.full((2, len(number)), 1.0)
            bands.append(
                BandDeviation(
                    harmonic=k,
                    number=number,
                    rest=pulse * heard + complex_noise(rng, *noise.shape),
                    deviation=noise,
                    noise=noise,
                    pattern=np.zeros(noise.shape, dtype=complex),
                    known=np.zeros((0, *noise.shape), dtype=complex),
                    side=side,
                )
            )
    return GearDeviation(
        stage=1,
        gear=gear,
        teeth=teeth,
        order=0.2 * ORDERS[gear],
        bands=tuple(bands),
        mesh_power=np.full((2, BANDS + 1), 1e5),
        shift_turns=0.0,
    )


def evidence(gear, tooth=None, seed=0):
    return GearEvidence(deviation=as_heard(deviation(gear, tooth, seed), machine()), search=None)


@pytest.mark.parametrize(("gear", "met"), [("sun", PLANETS), ("planet", 2), ("ring", PLANETS)])
def test_lines_are_those_that_all_planets_bring_alike(gear, met):
    told = evidence(gear).deviation
    assert told.meetings == met
    assert {band.side for band in told.bands} == ({0} if gear == "ring" else {-1, 1})
    for band in told.bands:
        assert gear == "planet" or np.all((band.number - band.side) % PLANETS == 0)


def test_planets_at_unequal_distances_do_not_meet_a_tooth_at_equal_parts_of_a_turn():
    """Of 18 + 72 teeth a third of the sum is whole, a quarter is not."""
    for planets, alike in ((3, 3), (4, 1)):
        for gear, met in (("sun", alike), ("ring", alike), ("planet", 2)):
            told = as_heard(deviation(gear, None, 0), machine(planets))
            assert told.meetings == met


@pytest.mark.parametrize("gear", list(TEETH))
def test_a_tooth_stands_out_without_a_template(gear):
    for seed in range(4):
        told = evidence(gear, tooth=5, seed=seed)
        assert told.believed > 12.0
        # teeth that meet planets at the same moments sound alike
        alike = TEETH[gear] / told.deviation.meetings
        apart = (int(np.argmax(told.deviation.by_tooth)) - 5) % alike
        assert min(apart, alike - apart) <= 1.0
        assert evidence(gear, seed=seed).believed < 8.0
        # how loud a loss would be is not known of such a machine
        assert noticed_from(told) is None


def full(sun, planet, ring, planets):
    teeth = {"sun_teeth": sun, "planet_teeth": planet, "ring_teeth": ring, "planets": planets}
    more = {"module_mm": 4.0, "face_width_mm": 50.0, "bore_diameter_planet_mm": 2.2 * planet}
    stage = {"kind": "planetary", "fixed": "ring"} | teeth | more
    return gearmon.load_machine(operating={"speed_rpm": 900.0, "torque_nm": 2000.0}, stage=stage)


@pytest.mark.parametrize("teeth", [(18, 27, 72, 3), (19, 26, 71, 3), (25, 29, 83, 4)])
@pytest.mark.parametrize("gear", ["sun", "planet"])
def test_planned_lines_hold_what_damage_adds(teeth, gear):
    train = full(*teeth)
    known = gearmon.loss_response(train, 1, gear, max_order=60.0)
    plan = line_plan(kinematics(train), 80.0, 0.1)
    wheel = next(one for one in plan.wheels if one.gear == gear)
    orders = plan.orders[wheel.beside[wheel.beside >= 0]]
    near = np.isclose(known.order[:, None], orders, rtol=0, atol=1e-9).any(axis=1)
    told = known.order > orders.min()
    power = np.abs(known.acceleration) ** 2
    assert power[near].sum() > 0.98 * power[told].sum()
    # each multiple stands a turn of the carrier from its own line
    for side, places in zip((-1, 1), wheel.beside, strict=True):
        apart = plan.orders[places] - plan.orders[wheel.lines]
        carrier = float(kinematics(train).mesh(1).carrier)
        assert apart[places >= 0] == pytest.approx(side * carrier)


@pytest.mark.parametrize("teeth", [(18, 27, 72, 3), (25, 29, 83, 4)])
@pytest.mark.parametrize("gear", ["sun", "planet"])
def test_damage_is_heard_at_the_turn_itself_where_the_other_planets_cannot_follow(teeth, gear):
    """Limits: slowly load is shed whole; fast a mesh is nearly alone: (1 - d/2)^2 over (d/4)^2."""
    response = tooth_response(full(*teeth), 1, gear, 2500.0)
    places = response.teeth * np.arange(1, len(response.mesh) - 1)
    own, below, above = (response.band_power(places, side) for side in (0, -1, 1))
    assert own[0] < 1e-4 * below[0]
    alone = ((1 - PLANET_PASS_DEPTH / 2) / (PLANET_PASS_DEPTH / 4)) ** 2
    for beside in (below, above):
        # dampers of the other meshes still take some
        assert 0.9 * alone < np.median((own / beside)[-12:]) < 2 * alone


def test_each_side_has_the_lines_of_its_own():
    train = full(19, 26, 71, 3)
    known = gearmon.loss_response(train, 1, "planet", max_order=100.0)
    told = tooth_response(train, 1, "planet", 100.0)
    for side, lines in ((0, told.lines), (-1, told.beside[0]), (1, told.beside[1])):
        own = known.carrier == side
        assert np.abs(lines[known.number[own]]).tolist() == pytest.approx(
            np.abs(known.acceleration[own]).tolist()
        )
        assert np.count_nonzero(lines) == np.count_nonzero(known.acceleration[own])
    assert tooth_response(train, 1, "ring", 100.0).beside.shape[0] == 0


@pytest.mark.parametrize("gear", ["sun", "ring"])
def test_lines_of_one_mesh_stand_for_those_beside_it(gear):
    """Of a set told by one mesh alone, and of a ring that turns where only teeth are told."""
    mesh = {"contact_ratio": 1.5, "mesh_stiffness_n_per_m": 8e8, "force_n": 4e3}
    known = replace(machine().stages[0], equivalent_mass_kg=0.3, **mesh)
    turning = replace(machine().stages[0], fixed="sun", driving="carrier")
    told = replace(machine(), stages=(known if gear == "sun" else turning,))
    response = tooth_response(told, 1, gear, 100.0)
    assert not len(response.beside)
    places = np.arange(response.teeth, 3 * response.teeth)
    own = response.band_power(places)
    assert own.min() > 0
    assert all(np.array_equal(own, response.band_power(places, side)) for side in (-1, 1))
    # where nothing tells more of the gear's own turn the lines beside it count alone
    heard = as_heard(deviation("sun", None, 0), told, replace(response, mesh=1 + 0 * response.mesh))
    assert {band.side for band in heard.bands} == {-1, 1}


def test_lines_at_the_turn_count_where_the_response_is_louder_there():
    gear, train = deviation("planet", None, 0), full(SUN, PLANET, RING, PLANETS)
    response = tooth_response(train, 1, "planet", 200.0)
    # told where planets do not cancel in the mesh harmonic
    heard = np.ones_like(response.mesh)
    for louder, sides in ((3.0, {-1, 0, 1}), (0.3, {-1, 1})):
        lines = louder * np.sqrt(np.abs(response.beside[0]) * np.abs(response.beside[1]))
        told = replace(response, lines=lines + 0j, mesh=heard)
        assert {band.side for band in as_heard(gear, machine(), told).bands} == sides
    assert not as_heard(gear, machine(), replace(told, mesh=0 * heard)).bands


def test_planets_yield_alike_in_what_is_expected_and_in_what_is_simulated():
    """By Hertz, as if the stiffness were told; natural frequencies are the same."""
    train = full(18, 27, 72, 3)
    balls = {"balls": 18, "ball_diameter_mm": 8.0, "pitch_diameter_mm": 54.0}
    rolling = replace(train, bearings=(Bearing(name="pins", planet_stage=1, **balls),))
    (spring, *_) = (own for own in drive_train(rolling).springs if own.part == "pins of stage 1")
    pins = Bearing(name="pins", planet_stage=1, stiffness_n_per_m=float(spring.stiffness[0, 0]))
    as_told = replace(train, bearings=(pins,))
    rigid, one, two = (tooth_response(own, 1, "sun", 60.0) for own in (train, rolling, as_told))
    assert one.lines == pytest.approx(two.lines, rel=1e-9)
    assert one.beside == pytest.approx(two.beside, rel=1e-9)
    assert one.lines != pytest.approx(rigid.lines, rel=1e-3)
    modes = np.array([own.frequency_hz for own in gearmon.modes(rolling).rows])
    built = build_train(rolling, carried_hz=1e9)
    mean = np.array([own.mechanics.stiffness.healthy_mean_n_per_m for own in built.meshes])
    simulated = built.system.natural_frequencies_hz(mean)
    told = simulated[simulated > 1.0]
    assert len(told) > 3
    assert np.abs(modes[:, None] / told - 1.0).min(axis=0) == pytest.approx(0.0, abs=1e-6)


def test_a_small_loss_of_a_planet_is_found_on_the_final_drive_of_the_catalogue():
    train = gearmon.load_machine(FOLDER / "planetary_final_drive.toml")
    given = {"machine_seed": 7, "channels": 1, "sampling_rate_hz": 6000.0, "load": 0.7}
    healthy, hurt = (
        gearmon.simulate(train, fault, seed=seed, **given)
        for seed, fault in ((0, ()), (4, "crack:2:planet:3:15%"))
    )
    told = gearmon.analyse(hurt, train, gearmon.learn([healthy], train))
    first = told.flags[0]
    assert (told.verdict, first.kind, first.gear) == ("fault", "tooth damage", "planet")
    assert first.stiffness_loss_low < 0.15 < first.stiffness_loss_high
    assert next(p.noticed_from for p in told.profiles if p.gear == "planet") < 0.15


def test_harmonics_that_planets_cancel_tell_nothing_of_the_path():
    in_phase, in_turn = (
        tooth_response(full(*teeth), 1, "planet", 100.0).mesh[1:6]
        for teeth in ((18, 27, 72, 3), (19, 26, 71, 3))
    )
    assert in_phase[0] == 0
    assert np.abs(in_turn[[0, 1, 3, 4]]).min() > 0


def test_a_harmonic_tells_of_the_path_from_a_fifth_of_what_a_planet_brings_without_stiffness():
    """Slowly: all its pairs without stiffness, by the strongest line of each multiple about it."""
    train = full(18, 27, 72, 3)
    known, heard = gearmon.loss_response(train, 1, "planet", max_order=100.0), []
    of_mesh = known.number % 27 == 0
    for k in range(1, 6):
        multiples = range(27 * k - 13, 27 * k + 13)
        lines = [np.abs(known.acceleration[known.number == n]).max(initial=0) for n in multiples]
        whole = 27 * np.sqrt(np.mean(np.square(lines)))
        own = of_mesh & (known.number == 27 * k)
        heard.append(np.linalg.norm(known.mesh_acceleration[own]) > 0.2 * whole)
    assert len(set(heard)) == 2
    assert (tooth_response(train, 1, "planet", 100.0).mesh[1:6] != 0).tolist() == heard


def test_damage_of_sun_and_planet_is_found_in_a_simulated_set():
    train = full(18, 27, 72, 3)
    given = {"duration_s": 6.0, "sampling_rate_hz": 8000.0, "channels": 1, "machine_seed": 5}
    healthy, sound, hurt, sun = (
        gearmon.simulate(train, faults=fault, recording_seed=seed, load=load, **given)
        for seed, (load, *fault) in enumerate(
            [(1.0,), (0.8,), (0.8, "crack:1:planet:7:30%"), (0.9, "crack:1:sun:3:30%")]
        )
    )
    reference = gearmon.learn(healthy, train)
    loose = gearmon.analyse(sound, train, reference)
    assert loose.verdict == "cannot tell"
    assert "give its shaft a [[bearing]]" in loose.reason
    assert "(shaft = 1)" in loose.reason
    seat = Bearing(name="sun", shaft=1, stiffness_n_per_m=1e12)
    firm = replace(train, bearings=(*train.bearings, seat))
    assert gearmon.analyse(sound, firm, reference).verdict == "healthy"
    for gear, recording in (("planet", hurt), ("sun", sun)):
        told = gearmon.analyse(recording, firm, reference)
        assert told.verdict == "fault"
        assert (told.flags[0].kind, told.flags[0].gear) == ("tooth damage", gear)
        assert 0.1 < told.flags[0].stiffness_loss < 0.5
    # each of three planets meets every sixth tooth of eighteen at one moment
    first = (told.flags[0].tooth - 1) % 6 + 1
    alike = f"teeth {first}, {first + 6}, {first + 12} meet a planet at the same moments"
    assert any(text.startswith(alike) for text in told.flags[0].evidence)


def ring_with(loss, tooth, stage, seed):
    """A ring one tooth of which lost stiffness, each meeting at the same place of the housing."""
    rng = np.random.default_rng([10, seed])
    response = tooth_response(machine(stage.planets), 1, "ring", 0.2 * RING * (BANDS + 2))
    bands, delay = [], np.arange(0.0, 0.3, 0.02)
    ringing = complex_noise(rng, 2, len(delay)) * np.exp(-delay / 0.05)
    heard = np.zeros((2, BANDS + 1))
    noise = 0.02 * abs(response.mesh[1]) * np.sqrt(np.sum(np.abs(ringing) ** 2))
    for k in range(1, BANDS + 1):
        number = k * RING + np.setdiff1d(np.arange(-RING // 2, RING // 2), range(-2, 3))
        path = ringing @ np.exp(-2j * np.pi * np.outer(delay, number) / RING)
        # N meetings in turn, each of a mesh of N: those that come together are as of one mesh
        place = np.exp(-2j * np.pi * number * (tooth - 1) / RING) * (number % stage.planets == 0)
        size = float(response.amplitude(np.array([loss]))[0])
        hiss = complex_noise(rng, 2, len(number))
        at_mesh = ringing @ np.exp(-2j * np.pi * delay * k)
        heard[:, k] = np.abs(at_mesh * response.mesh[k]) ** 2
        bands.append(
            BandDeviation(
                harmonic=k,
                number=number,
                rest=size * path * response.lines[number] * place / noise + hiss,
                deviation=np.full(hiss.shape, noise),
                noise=np.full(hiss.shape, noise),
                pattern=np.zeros(hiss.shape, dtype=complex),
                known=np.zeros((0, *hiss.shape), dtype=complex),
            )
        )
    made = GearDeviation(
        stage=1,
        gear="ring",
        teeth=RING,
        order=0.2,
        bands=tuple(bands),
        mesh_power=heard,
        shift_turns=0.0,
    )
    ring = as_heard(made, machine(stage.planets))
    return GearEvidence(deviation=ring, search=search_gear(ring, response, 10.0))


def test_a_tooth_of_the_ring_is_found_with_its_loss():
    (stage,) = machine().stages
    losses = []
    for seed in range(6):
        told = ring_with(0.3, 20, stage, seed)
        assert told.believed > 26.0
        assert told.search.best % (RING // PLANETS) == 19 % (RING // PLANETS)
        losses.append(loss_estimate(told.search, machine()).loss)
        # planets put the mesh harmonics as their phases have it: these tell no loss
        lines = np.sqrt(told.deviation.mesh_power) + 0j
        heard = copy(told.search)
        heard.difference = replace(told.search.difference, mesh_lines=lines)
        assert loss_estimate(heard, machine()).loss == losses[-1]
        assert ring_with(0.0, 20, stage, seed).believed < 5.0
    assert np.median(losses) == pytest.approx(0.3, rel=0.35)


@pytest.mark.parametrize("apart", [-0.45, -0.1, 0.0, 0.3])
@pytest.mark.parametrize("best", [0, 7, RING - 1])
def test_the_place_is_the_top_of_the_parabola_through_the_best_tooth_and_its_neighbours(
    best, apart
):
    (stage,) = machine().stages
    known = ring_with(0.3, 20, stage, 0)
    search = copy(known.search)
    search.best = best
    away = (np.arange(RING) - best + RING // 2) % RING - RING // 2
    search.log_place = -3.0 * (away - apart) ** 2
    free = GearEvidence(deviation=known.deviation, search=search)
    assert free.place[0] == best + 1
    assert free.place[1] == pytest.approx((best + apart + CONTACT_CENTRE) / RING % 1.0)
    # teeth that are counted from the pulse of a tachometer stand where they are
    seated = replace(known.deviation, same_zero=True)
    fixed = GearEvidence(deviation=seated, search=search)
    assert fixed.place == (best + 1, pytest.approx((best + CONTACT_CENTRE) / RING % 1.0))


def told(planets=3, **held):
    """A set whose file bears a baseline; `held` is the bearing of the sun's shaft."""
    stage = PlanetaryStage(
        sun_teeth=18,
        planet_teeth=27,
        ring_teeth=72,
        planets=planets,
        fixed="ring",
        module_mm=3.0,
        face_width_mm=36.0,
    )
    point = OperatingPoint(speed_rpm=900.0, torque_nm=400.0)
    bearings = (Bearing(name="sun", shaft=1, **held),) if held else ()
    return Machine(name="set", operating=(point,), stages=(stage,), bearings=bearings)


@pytest.mark.parametrize("gear", ["sun", "planet", "ring"])
def test_a_sun_that_floats_lets_next_to_nothing_of_three_planets_be_heard(gear):
    """Below its resonances; one that is held as firmly as can be is that of the file."""
    free = with_floating_sun(told(), 1)
    firm = told(stiffness_n_per_m=1e13)
    held, loose, known = (
        np.linalg.norm(gearmon.loss_response(own, 1, gear, max_order=30.0).acceleration)
        for own in (told(), free, firm)
    )
    assert loose < 0.1 * held
    assert known == pytest.approx(held, rel=0.01)


def test_a_sun_floats_only_where_the_file_does_not_tell_how_it_is_held():
    assert with_floating_sun(told(stiffness_n_per_m=1e8), 1) is None
    fixed = replace(told().stages[0], fixed="sun", driving="carrier")
    own = with_floating_sun(replace(told(), stages=(fixed,)), 1)
    assert 0 < own.stages[0].fixed_support_n_per_m < 1e7
    seated = replace(fixed, fixed_support_n_per_m=1e9)
    assert with_floating_sun(replace(told(), stages=(seated,)), 1) is None
    pair = ParallelStage(pinion_teeth=20, gear_teeth=60)
    assert with_floating_sun(replace(told(), stages=(pair,)), 1) is None


def test_the_key_that_tells_how_a_sun_is_held_is_named():
    assert _sun_held(told(), 1) == (
        "its shaft a [[bearing]] (shaft = 1) with its stiffness_n_per_m"
    )
    fixed = replace(told().stages[0], fixed="sun", driving="carrier")
    assert "fixed_support_n_per_m" in _sun_held(replace(told(), stages=(fixed,)), 1)


def test_what_a_sun_that_may_float_hides_has_to_be_larger_to_be_noticed():
    own = as_heard(deviation("planet", None, 1), machine())
    held, free = (
        search_gear(own, tooth_response(each, 1, "planet", 400.0), 10.0)
        for each in (told(), with_floating_sun(told(), 1))
    )
    sure, unsure = (
        noticed_from(GearEvidence(deviation=own, search=s)) or 1.0 for s in (held, free)
    )
    either = GearEvidence(deviation=own, search=held, instead=free)
    assert sure < unsure
    assert (noticed_from(either) or 1.0) == unsure
