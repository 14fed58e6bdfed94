"""Damaged teeth of planetary sets are told by how often they are heard in a turn of the carrier."""

import numpy as np
import pytest
from reference.gear_departures import complex_noise

from gearmon.diagnosis.decision.coverage import noticed_from
from gearmon.diagnosis.hypotheses.tooth_damage import GearEvidence, planetary_evidence
from gearmon.diagnosis.law import GearDeviation
from gearmon.diagnosis.law.gear_lines import CONTACT_CENTRE, BandDeviation
from gearmon.machine import Machine, OperatingPoint, ParallelStage, PlanetaryStage

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
    return {one.gear: planetary_evidence(one, gears, machine()) for one in gears}


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
    stage = ParallelStage(pinion_teeth=SUN, gear_teeth=RING)
    pair = Machine(name="p", operating=(OperatingPoint(speed_rpm=600.0),), stages=(stage,))
    alone = planetary_evidence(deviation("sun", [], 0), [], pair)
    assert (alone.deviation.meetings, alone.meshes, alone.heard_in) == (1, 1, None)


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
