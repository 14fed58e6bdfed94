"""What a healthy verdict is worth: the damage that would have been heard."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from reference.gear_departures import complex_noise

from gearmon.diagnosis.evidence import Evidence, heard_from, noticed_from
from gearmon.diagnosis.hypotheses.tooth_damage import GearEvidence
from gearmon.diagnosis.hypotheses.tooth_match import search_gear
from gearmon.diagnosis.law.gear_lines import FULL_LOAD, BandDeviation, GearDeviation
from gearmon.diagnosis.verdict import hidden_stages, unheard
from gearmon.machine import Machine, OperatingPoint, ParallelStage
from gearmon.signatures.expected.tooth_response import tooth_response

TEETH, BANDS = 23, 6


def gear(mesh_power=1e5, departs=1.0, loaded=FULL_LOAD, references=2):
    """A sound gear whose lines depart by some times what noise lets expect."""
    rng = np.random.default_rng(5)
    bands, mesh = [], response().mesh[: BANDS + 1]
    for k in range(1, BANDS + 1):
        number = k * TEETH + np.setdiff1d(np.arange(-11, 12), range(-2, 3))
        noise = np.ones((2, len(number)))
        bands.append(
            BandDeviation(
                harmonic=k,
                number=number,
                rest=departs * complex_noise(rng, *noise.shape),
                deviation=noise,
                noise=noise,
                pattern=np.zeros(noise.shape, dtype=complex),
                known=np.zeros((references if references > 1 else 0, *noise.shape), dtype=complex),
            )
        )
    deviation = GearDeviation(
        stage=1,
        gear="pinion",
        teeth=TEETH,
        order=1.0,
        bands=tuple(bands),
        mesh_power=mesh_power * np.abs(np.tile(mesh / mesh[1], (2, 1))) ** 2,
        shift_turns=0.0,
        load=loaded,
    )
    return GearEvidence(deviation=deviation, search=search_gear(deviation, response(), 25.0))


@cache
def response():
    stage = ParallelStage(pinion_teeth=TEETH, gear_teeth=47, module_mm=2.0, face_width_mm=20.0)
    pair = Machine(name="pair", operating=(OperatingPoint(speed_rpm=1500.0),), stages=(stage,))
    return tooth_response(pair, 1, "pinion", (BANDS + 1.0) * TEETH)


def test_a_louder_path_lets_smaller_losses_be_heard():
    losses = [heard_from(gear(power)) for power in (1e2, 1e3, 1e4)]
    assert losses == sorted(losses, reverse=True)
    # ten times the power is sqrt(10) times the amplitude
    assert losses[1] / losses[2] == pytest.approx(10**0.5, rel=0.25)


def test_teeth_loaded_less_need_a_larger_loss_in_proportion():
    assert noticed_from(gear(loaded=0.8)) == pytest.approx(noticed_from(gear()) / 0.8)


def test_of_lightly_loaded_teeth_only_what_would_be_a_fault_counts_as_heard():
    quiet, restless = gear(), gear(departs=4.0)
    assert heard_from(restless) == pytest.approx(heard_from(quiet))
    for load in (0.45, 0.99 * FULL_LOAD):
        light = gear(departs=4.0, loaded=load)
        told = noticed_from(light)
        assert heard_from(light) == told
        assert told is None or told > 2.0 * heard_from(restless)


def test_levels_of_lightly_loaded_teeth_mean_little_beside_one_reference():
    assert gear(loaded=1.2, references=1).load_unlearned
    assert not gear(loaded=1.2, references=2).load_unlearned
    assert not gear(loaded=2.0, references=1).load_unlearned


def test_what_was_not_looked_at_or_not_heard_is_named():
    stage = ParallelStage(pinion_teeth=TEETH, gear_teeth=47)
    pair = Machine(name="pair", operating=(OperatingPoint(speed_rpm=1500.0),), stages=(stage,))
    clear = gear(1e4)
    loss = heard_from(clear)
    finding = SimpleNamespace(searched=(clear,))
    found = Evidence(deviation=clear.deviation, finding=finding, references=2)
    other, both = "the gear of stage 1", "the pinion of stage 1, the gear of stage 1"
    assert f"unnoticed on {other}: record longer" in unheard(found, pair, [], 2 * loss)
    told = unheard(found, pair, ["a2"], loss / 2)
    assert f"unnoticed on {both}: record longer" in told
    assert "What a2 hears is missing: check sensor, cable and name of the channel" in told
    mate = GearEvidence(replace(clear.deviation, gear="gear"), clear.search)
    heard = replace(found, finding=SimpleNamespace(searched=(clear, mate)))
    assert unheard(heard, pair, [], 2 * loss) == ""
    assert unheard(heard, pair, ["a2"], 2 * loss).startswith("What a2 hears is missing")
    nothing = Evidence(deviation=clear.deviation, finding=None, references=2)
    told = unheard(nothing, pair, [], 0.4)
    assert told.startswith("Even a loss of 40 % of a tooth's stiffness might have gone unnoticed")
    assert both in told


@pytest.mark.parametrize(("usual", "heard"), [(1.0, True), (30.0, False)])
def test_of_a_mesh_that_is_not_detected_only_harmonics_that_stand_out_tell(usual, heard):
    """Beside a gear with pitch errors on the same shaft those are heard in place of a mesh."""
    stage = ParallelStage(pinion_teeth=TEETH, gear_teeth=47)
    pair = Machine(name="pair", operating=(OperatingPoint(speed_rpm=1500.0),), stages=(stage,))
    clear = gear(1e4)
    # the lines between, next to a mesh power of 1e4 that falls with the harmonics
    level = usual * np.sqrt(0.01 * np.median(clear.deviation.mesh_power[:, 1:]))
    bands = [
        replace(band, pattern=np.full(band.rest.shape, level + 0j))
        for band in clear.deviation.bands
    ]
    own = GearEvidence(replace(clear.deviation, bands=tuple(bands)), clear.search)
    assert own.mesh_stands_out == heard
    mate = GearEvidence(replace(own.deviation, gear="gear"), own.search)
    found = Evidence(
        deviation=own.deviation, finding=SimpleNamespace(searched=(own, mate)), references=2
    )
    loss = 2 * heard_from(own)
    assert unheard(found, pair, [], loss) == ""
    assert hidden_stages(found.searched, []) == set()
    hidden = hidden_stages(found.searched, [1, 2])
    assert hidden == (set() if heard else {1})
    told = unheard(found, pair, [], loss, hidden)
    assert ("the pinion of stage 1, the gear of stage 1" in told) != heard
