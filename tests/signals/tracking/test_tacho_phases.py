"""Pulses and mesh lines together: as fine as the lines, where the pulses are, never worse."""

from __future__ import annotations

import numpy as np
import pytest
from reference.synthetic_signals import wandering_turns, white

from gearmon.signals.orders import OrderSums
from gearmon.signals.tracking import find_pulses, join, track_from_pulses
from gearmon.signals.tracking.tacho import track_through

RATE, DURATION, SPEED, TEETH = 4000.0, 10.0, 21.7, 31
TIME = np.arange(int(RATE * DURATION)) / RATE
ORDERS = TEETH * np.arange(1.0, 3.0)


def angle(wander=0.01, seed=3):
    return 0.25 + wandering_turns(TIME, SPEED, wander, seed=seed)


def lines(turns, noise=0.3):
    """Two harmonics of a mesh in two channels."""
    rows = [np.cos(2 * np.pi * ORDERS[0] * turns), np.cos(2 * np.pi * ORDERS[1] * turns + 1.0)]
    return np.stack([rows[0] + rows[1], rows[1] - rows[0]]) + noise * np.stack(
        [white(len(TIME), 1.0, seed=8), white(len(TIME), 1.0, seed=9)]
    )


def switched(turns, marks=(0.0,), jitter=0.0):
    """A waveform that only knows high and low: its edges are at samples."""
    whole = np.arange(np.floor(turns[0]) - 1, np.ceil(turns[-1]) + 1)
    edges = (whole[:, None] + np.asarray(marks)).ravel()
    edges = np.sort(edges + jitter * np.random.default_rng(4).standard_normal(len(edges)))
    past = turns - edges[np.searchsorted(edges, turns, side="right") - 1]
    return np.where(past < 0.1, 5.0, 0.0)


def joined(samples, waveform, per_turn=1):
    """Angle of the pulses alone, and what the lines make of it."""
    pulses = find_pulses(waveform, RATE, per_turn)
    known = track_from_pulses(pulses, per_turn, 1.0, TIME[-1])
    return known, join(OrderSums(samples, RATE, ORDERS), known)[0]


def error(track, turns):
    """Departure from the true angle in mesh periods; whole turns are left out."""
    off = track.turns_at(TIME[::20]) - turns[::20]
    return (off - np.round(off.mean())) * TEETH


@pytest.mark.parametrize(
    ("wander", "marks", "jitter"),
    [(0.01, (0.0,), 0.0), (0.0005, (0.0,), 0.0), (0.005, (0.0,), 0.01), (0.01, (0.0, 0.4), 1e-3)],
)
def test_lines_take_away_what_the_sampling_does_to_pulses(wander, marks, jitter):
    turns = angle(wander)
    known, found = joined(lines(turns), switched(turns, marks, jitter), len(marks))
    alone, together = error(known, turns), error(found, turns)
    assert found is not known
    assert together.std() < 0.15 * alone.std()
    # the quantisation is as good as gone, and zero is where the pulses are in the mean
    sample = TEETH * SPEED / RATE
    scatter = np.hypot(sample / np.sqrt(12), TEETH * jitter)
    zero = together.mean() + TEETH * (0.4 if len(marks) > 1 else 0.0)  # that of the first pulse
    assert abs(zero) < 4 * scatter / np.sqrt(SPEED * DURATION) + 1e-3
    assert found.indexed == (len(marks) == 1)
    assert found.method == "tacho"
    assert found.uncertainty_turns < 0.3 * known.uncertainty_turns


def test_a_drift_that_the_path_gives_the_lines_is_not_taken_for_rotation():
    # 2 ms of delay turn the lines by 0.6 of a period while the speed goes up by a fifth
    turns = 0.25 + SPEED * (TIME + 0.01 * TIME**2)
    late = np.interp(TIME - 0.002, TIME, turns)
    known, found = joined(lines(late), switched(turns))
    drift = error(found, turns)
    assert np.ptp(drift[20:-20]) < 0.25
    assert drift.std() < 1.1 * error(known, turns).std()


@pytest.mark.parametrize("what", ["noise", "slip", "few"])
def test_lines_that_do_not_fit_leave_the_pulses_alone(what):
    turns = angle()
    samples = {
        "noise": np.stack([white(len(TIME), 1.0, seed=s) for s in (1, 2)]),
        # lines of something that is not geared to the shaft
        "slip": lines(angle(seed=5)),
        "few": lines(turns),
    }[what]
    known, found = joined(samples, switched(turns))
    if what == "few":
        known = track_through((1.0 + np.arange(8)) / SPEED, np.arange(8.0), TIME[-1])
        found, _ = join(OrderSums(samples, RATE, ORDERS), known)
    assert found is known


def test_lines_that_slip_by_a_tooth_are_not_believed():
    turns = angle(0.002)
    # for a third of the recording the vibration is a quarter of a turn ahead
    ahead = 0.25 * np.interp(TIME, [3.0, 3.4, 6.0, 6.4], [0.0, 1.0, 1.0, 0.0])
    known, found = joined(lines(turns + ahead), switched(turns))
    assert error(found, turns).std() <= 1.1 * error(known, turns).std()
