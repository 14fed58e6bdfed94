"""Damaged teeth of planetary sets are told by how often they are heard in a turn of the carrier."""

import numpy as np
import pytest
from reference.gear_departures import complex_noise

from gearmon.diagnosis.decision.coverage import noticed_from
from gearmon.diagnosis.hypotheses.tooth_damage import GearEvidence, of_ring, planetary_evidence
from gearmon.diagnosis.hypotheses.tooth_search import loss_estimate, search_gear
from gearmon.diagnosis.law import GearDeviation
from gearmon.diagnosis.law.gear_lines import CONTACT_CENTRE, BandDeviation
from gearmon.machine import Machine, OperatingPoint, PlanetaryStage
from gearmon.signatures.expected.tooth_response import tooth_response

SUN, PLANET, RING, PLANETS, BANDS = 18, 27, 72, 3, 8
SUN_A_TURN = RING // SUN
# turns about the carrier for one of the carrier
ORDERS = {"sun": RING / SUN, "planet": RING / PLANET, "ring": 1.0}
TEETH = {"sun": SUN, "planet": PLANET, "ring": RING}


def machine(planets=PLANETS):
    stage = PlanetaryStage(
        sun_teeth=SUN, planet_teeth=PLANET, ring_teeth=RING, planets=planets, fixed="ring"
    )
    return Machine(name="set", operating=(OperatingPoint(speed_rpm=600.0),), stages=(stage,))


def deviation(gear, places, seed, height=6.0):
    """A gear of which pulses are left at some places of the carrier's turn, in noise.

    A gear that turns q times while the carrier does has every q-th of the lines.
    """
    rng = np.random.default_rng([9, seed])
    times, teeth = ORDERS[gear], TEETH[gear]
    bands = []
    for k in range(1, BANDS + 1):
        number = k * teeth + np.setdiff1d(np.arange(-(teeth // 2), teeth // 2), range(-2, 3))
        turn = np.exp(-2j * np.pi * np.outer(number * times, places)).sum(axis=1)
        noise = np.full((2, len(number)), 1.0)
        # a path that differs from band to band
        pulse = height * complex_noise(rng, 2, 1) * turn / np.sqrt(RING)
        bands.append(
            BandDeviation(
                harmonic=k,
                number=number,
                rest=pulse + complex_noise(rng, *noise.shape),
                deviation=noise,
                noise=noise,
                pattern=np.zeros(noise.shape, dtype=complex),
            )
        )
    return GearDeviation(
        stage=1,
        gear=gear,
        teeth=teeth,
        order=0.2 * times,
        bands=tuple(bands),
        mesh_power=np.full((2, BANDS + 1), 1e5),
        shift_turns=0.0,
    )


def evidence(tooth_of=None, tooth=5, seed=0):
    """All gears of a set of which one tooth is damaged."""
    count = {"sun": PLANETS * SUN_A_TURN, "ring": PLANETS}.get(tooth_of, 0)
    own = TEETH.get(tooth_of, 1) * ORDERS.get(tooth_of, 1.0)
    places = (tooth + CONTACT_CENTRE) / own + np.arange(count) / max(1, count)
    gears = [deviation(gear, places, seed) for gear in TEETH]
    (stage,) = machine().stages
    found = {one.gear: planetary_evidence(one, gears, stage) for one in gears[:2]}
    ring = of_ring(gears[2], stage)
    response = tooth_response(machine(), 1, "ring", 0.2 * RING * (BANDS + 2))
    return found | {"ring": GearEvidence(deviation=ring, search=search_gear(ring, response, 10.0))}


def test_sun_and_ring_meet_every_planet_in_a_turn_and_planets_both():
    told = evidence()
    assert {gear: one.deviation.meetings for gear, one in told.items()} == {
        "sun": PLANETS,
        "planet": 2,
        "ring": PLANETS,
    }
    # the sun's tooth is heard at twelve places of the housing
    assert told["sun"].heard_in is not None
    heard_in = told["sun"].heard_in
    assert (heard_in.gear, heard_in.meetings) == ("ring", PLANETS * SUN_A_TURN)
    # of the ring what comes three times a turn of the carrier
    ring = told["ring"].deviation
    assert ring.meetings == PLANETS
    assert all(np.all(band.number % PLANETS == 0) for band in ring.bands)


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
    ring = of_ring(made, stage)
    return GearEvidence(deviation=ring, search=search_gear(ring, response, 10.0))


@pytest.mark.parametrize("planets", [3, 4])
def test_a_tooth_of_the_ring_is_found_with_its_loss(planets):
    (stage,) = machine(planets).stages
    losses = []
    for seed in range(6):
        told = ring_with(0.3, 20, stage, seed)
        assert told.believed > 26.0
        assert told.search.match.best % (RING // planets) == 19 % (RING // planets)
        losses.append(loss_estimate(told.search, 10.0).loss)
        assert ring_with(0.0, 20, stage, seed).believed < 5.0
    assert np.median(losses) == pytest.approx(0.3, rel=0.35)


@pytest.mark.parametrize("gear", ["sun", "ring"])
def test_the_gear_whose_tooth_it_is_has_the_most_evidence(gear):
    for seed in range(4):
        told = evidence(gear, seed=seed)
        assert max(told, key=lambda name: told[name].believed) == gear
        assert told[gear].believed > 20.0
        by_tooth = told[gear].deviation.by_tooth
        # teeth that meet planets at the same moments sound alike
        assert abs(int(np.argmax(by_tooth)) - 5) % (TEETH[gear] // PLANETS) in (
            0,
            1,
            TEETH[gear] // PLANETS - 1,
        )


def test_a_sound_set_has_no_evidence():
    strongest = [max(one.believed for one in evidence(seed=seed).values()) for seed in range(8)]
    assert max(strongest) < 10.0


def test_one_of_three_meshes_is_heard_less_than_the_only_one():
    losses = {gear: noticed_from(one) for gear, one in evidence().items()}
    alone = noticed_from(GearEvidence(deviation=deviation("sun", [], 0), search=None))
    # a planet's tooth meets twice in its turn, the sun's as often as there are planets
    assert alone < losses["sun"] < losses["planet"]
