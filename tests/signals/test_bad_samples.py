"""Samples that no machine made: found, named with time and channel, and no fault of the machine."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference.small_gearbox import CRACK, machine, recording, reference
from reference.synthetic_signals import white

from gearmon.diagnosis.analysis import analyse
from gearmon.errors import RecordingError
from gearmon.signals.bad_samples import bad_stretches, inspected, sound_part, sound_piece
from gearmon.signals.recording import Recording

RATE = 10_000.0


def frozen(a, first=13_000, count=5_000):
    a[:, first : first + count] = a[:, first : first + 1]


def empty(a):
    a[:, 30_000:30_400] = 0.0


def noise_only(a):
    a[:, 33_000:35_000] = 1e-3 * white(2_000, seed=1)


def spike(a):
    a[0, 12_345] = 100 * np.abs(a).max()


def spikes(a):
    a[1, [500, 20_000, 20_001, 39_999]] = -30 * np.abs(a).max()


def clipped(a):
    a[0] = np.clip(a[0], -0.4 * np.abs(a[0]).max(), 0.4 * np.abs(a[0]).max())


def cable(a):
    a[0, 15_000:] = 1e-3 * white(25_000, seed=2)


def range_of_one(a):
    a[0, 18_000:] *= 10.0


def cable_of_all(a):
    a[:, 15_000:] = 1e-3 * white(50_000, seed=3).reshape(2, -1)


def range_of_all(a):
    a[:, 18_000:] *= 10.0


def long_frozen(a):
    frozen(a, 10_000, 15_000)


def another_mean(a):
    a[:, 12_000:] += 50 * a.std()


def spoilt(damage, fault="", **changes):
    own = recording(fault, **changes)
    samples = own.samples.copy()
    damage(samples[:2])
    return replace(own, samples=samples)


def clutch(a):
    """Idles for a second and a half, and is heard in each channel as its path has it."""
    a[0, :15_000] *= 0.15
    a[1, :15_000] *= 0.22


def unclutch(a):
    """Works for a second and a half."""
    a[0, 15_000:] *= 0.15
    a[1, 15_000:] *= 0.22


SHORT = {
    frozen: "channel a1 from 1.3 to 1.8 s stands still",
    empty: "channel a2 from 3 to 3.04 s stands still at 0 ",
    noise_only: "channel a1 from 3.277 to 3.533 s drops out",
    spike: "channel a1 at 1.2345 s jumps to",
    another_mean: "channel a1 from 1.126 to 1.28 s goes over to another mean",
    spikes: "channel a2 at 0.0500 s jumps to",
}
ONE_CHANNEL = {
    clipped: "channel a1 from 0 to 4 s is clipped: .* the channel is left out",
    cable: "channel a1 from 1.4.* to 4 s is .* quieter .* the channel is left out",
    range_of_one: "channel a1 from .* the channel is left out",
}
ALL_CHANNELS = [cable_of_all, range_of_all, long_frozen]


def told(answer):
    return " / ".join(answer.warnings)


@pytest.mark.parametrize("damage", SHORT, ids=lambda d: d.__name__)
def test_short_bad_samples_are_named_and_are_no_fault(damage):
    answer = analyse(spoilt(damage), machine(), reference())
    assert SHORT[damage] in told(answer)
    assert answer.verdict == "healthy"


@pytest.mark.parametrize("damage", [frozen, spike], ids=lambda d: d.__name__)
def test_a_fault_is_still_found_beside_bad_samples(damage):
    answer = analyse(spoilt(damage, CRACK), machine(), reference())
    assert SHORT[damage] in told(answer)
    assert [flag.tooth for flag in answer.flags] == [7]


@pytest.mark.parametrize("damage", ONE_CHANNEL, ids=lambda d: d.__name__)
def test_a_bad_channel_is_left_out_and_the_verdict_says_what_it_could_not_hear(damage):
    answer = analyse(spoilt(damage), machine(), reference())
    assert any(re.search(ONE_CHANNEL[damage], note) for note in answer.warnings)
    assert answer.verdict == "cannot tell"
    assert "What a1 hears is missing" in answer.reason
    # and a fault is one also with the other channel alone
    assert analyse(spoilt(damage, CRACK), machine(), reference()).verdict == "fault"


@pytest.mark.parametrize("damage", ALL_CHANNELS, ids=lambda d: d.__name__)
def test_a_recording_without_a_sound_channel_is_refused(damage):
    with pytest.raises(RecordingError, match=r"channel a1 from .* check cable") as refused:
        analyse(spoilt(damage), machine(), reference())
    assert "\n" not in str(refused.value)


def test_of_a_machine_that_begins_to_work_one_state_is_looked_at():
    for fault, verdict in (("", "healthy"), (CRACK, "fault")):
        answer = analyse(spoilt(clutch, fault), machine(), reference())
        assert answer.verdict == verdict
        said = r"channel a(.) from 0 to (1.5\d*) s is (1.) dB quieter, as all are: the machine its"
        channel, edge_s, size_db = np.array(re.findall(said, told(answer)), dtype=float).T
        assert channel.tolist() == [1, 2]
        assert edge_s == pytest.approx([1.5, 1.5], abs=0.04)
        assert size_db == pytest.approx(-20 * np.log10([0.15, 0.22]), abs=1.0)
    assert [flag.tooth for flag in answer.flags] == [7]
    # without the pulses only one piece is looked at: the longer, wherever it stands
    cases = [
        (clutch, "quieter"),
        (lambda a: clutch(a[:, ::-1]), "quieter"),
        (unclutch, "louder"),
    ]
    for damage, way in cases:
        samples = spoilt(damage, tacho=False).samples
        found = sound_part(Recording(samples=samples, sampling_rate_hz=RATE))
        assert found.samples.shape[1] == pytest.approx(25_000, abs=500)
        assert all(f"dB {way}, as all are" in note for note in found.notes[:2])


@pytest.mark.parametrize(
    ("first", "second", "edges"),
    [
        (1e-3, 3e-4, (15_000, 15_000)),  # next to nothing is heard: a supply that failed
        (0.15, 0.22, (15_000, 9_000)),  # one after the other: no one state
    ],
)
def test_what_no_clutch_does_is_refused(first, second, edges):
    def damage(a):
        a[0, : edges[0]] *= first
        a[1, : edges[1]] *= second

    with pytest.raises(RecordingError, match=r"channel a1 from .* check cable"):
        analyse(spoilt(damage), machine(), reference())


def test_channels_that_move_beside_one_that_does_not_are_left_out():
    own = white(3 * 40_000, seed=6).reshape(3, -1)
    own[0, :15_000] *= 0.15
    own[1, :15_000] *= 0.22
    found = inspected(Recording(samples=own, sampling_rate_hz=RATE))
    assert len(found.samples) == 1
    assert all(note.endswith("the channel is left out") for note in found.notes)


def of(values):
    return Recording(samples=np.atleast_2d(values), sampling_rate_hz=RATE, channel_names=("a1",))


def bits(values, levels):
    """Rounded to so many steps of its largest value."""
    return np.round(values / np.abs(values).max() * levels) / levels


TIME = np.arange(60_000) / RATE
SOUND = {
    "noise": white(60_000, seed=4),
    "coarse noise": bits(white(60_000, seed=5), 4),
    "slow sine of 8 bits": bits(np.sin(2 * np.pi * 2.0 * TIME), 127),
    "sine": np.sin(2 * np.pi * 50 * TIME),
    "ringing impacts": np.tile(np.exp(-np.arange(1000) / 30) * np.cos(np.arange(1000)), 60)
    + 1e-3 * white(60_000, seed=6),
    "run-up": np.linspace(0.01, 1.0, 60_000) ** 2 * white(60_000, seed=7),
    # 14 dB within an eighth of a second, on the way from one steady speed to another
    "resonance on the way": 10 ** (0.7 * np.clip((TIME - 2.0) / 0.12, 0, 1))
    * white(60_000, seed=15),
    "load that doubles": np.where(TIME < 3, 1.0, 2.0) * white(60_000, seed=8),
    "load that swings": (1.2 + np.sin(2 * np.pi * 0.5 * TIME)) * white(60_000, seed=9),
    "coarse load that swings": np.round(
        (0.6 + 0.2 * np.sin(2 * np.pi * 0.5 * TIME)) * white(60_000, seed=14)
    ),
    "impulses": (np.arange(60_000) % 500 == 0) + 0.01 * white(60_000, seed=10),
    "few samples": white(50, seed=11),
}


@pytest.mark.parametrize("kind", SOUND)
def test_what_machines_and_recorders_do_is_left_alone(kind):
    own = of(SOUND[kind])
    assert bad_stretches(SOUND[kind]) == []
    assert np.shares_memory(sound_part(own).samples, own.samples)
    assert sound_part(own).notes == own.notes


@pytest.mark.parametrize("apart", [5, -5, 40, -40])
def test_a_peak_beside_another_is_a_knock_that_rings(apart):
    """Neither is a bad sample, whichever is the larger; far apart they both are."""
    values = 0.01 * white(60_000, seed=15)
    values[30_000], values[30_000 + apart] = 3.0, -1.5
    found = sorted((bad.start, bad.stop) for bad in bad_stretches(values))
    alone = sorted((at, at + 1) for at in (30_000, 30_000 + apart))
    assert found == (alone if abs(apart) == 40 else [])


@pytest.mark.parametrize("length", [60_000, (1 << 20) + 7])
def test_stretches_are_found_wherever_they_lie(length):
    random = np.random.default_rng(0)
    for first in [0, 1, length - 700, *random.integers(0, length - 700, 3), (1 << 20) - 300]:
        if first + 600 > length:
            continue
        values = white(length, seed=12)
        values[first : first + 600] = 0.125
        (found,) = bad_stretches(values)
        assert (found.start, found.stop) == (first, first + 600)


def test_a_bridged_sample_leaves_the_rest_as_it_was():
    values = white(60_000, seed=13)
    bad = values.copy()
    bad[[7, 30_000, 59_999]] = 1e4
    out = sound_part(of(bad)).samples[0]
    np.testing.assert_array_equal(np.flatnonzero(out != values), [7, 30_000, 59_999])
    assert np.abs(out).max() == np.abs(values).max()


def test_a_spike_is_found_in_any_part_of_a_long_recording():
    values, at = white((1 << 20) + 70_000, seed=14), (1 << 20) + 30_000
    values[at] = 300.0
    assert [(bad.start, bad.stop) for bad in bad_stretches(values)] == [(at, at + 1)]


@given(st.lists(st.tuples(st.integers(0, 60), st.integers(1, 60)), max_size=5))
def test_the_longest_sound_piece_is_that_of_a_walk_through_all_samples(drawn):
    out = tuple(sorted((start, min(start + count, 61)) for start, count in drawn))
    sound = [not any(start <= k < stop for start, stop in out) for k in range(61)]
    longest, run = 0, 0
    for own in sound:
        run = run + 1 if own else 0
        longest = max(longest, run)
    first, end = sound_piece(replace(of(np.arange(61.0)), left_out=out))
    assert all(sound[first:end])
    assert end - first == longest


def test_a_bridge_is_a_straight_line_from_the_sample_before_to_the_one_behind():
    values = white(60_000, seed=13)
    bad = values.copy()
    bad[30_000:30_003] = 1e4
    out = sound_part(of(bad)).samples[0]
    np.testing.assert_allclose(np.diff(out[29_999:30_004], 2), 0.0, atol=1e-12)
    assert (out[29_999], out[30_003]) == (values[29_999], values[30_003])


# Averages leave out the turns about bad samples, and go on behind them


def amplitudes(own):
    return analyse(own, machine(), reference()).signature.lines.amplitude


def three_gaps(a):
    for first in (8_000, 17_000, 29_000):
        frozen(a, first, 1_000)


def test_averages_leave_out_the_turns_about_bad_samples_and_no_others():
    whole, left = amplitudes(recording(CRACK)), amplitudes(spoilt(three_gaps, CRACK))
    assert 10 <= len(left) < len(whole)
    # each block that is left is one of those of the sound recording
    strong = np.abs(whole).mean(axis=0) > 0.3 * np.abs(whole).mean(axis=0).max()
    apart = np.abs(left[:, None] - whole[None])[:, :, strong].max(axis=-1)
    assert np.all(apart.min(axis=1) < 0.02 * np.abs(whole).max())


def test_a_tooth_is_found_where_the_longest_sound_piece_would_not_do():
    own = spoilt(three_gaps, "crack:1:pinion:7:20%")
    (flag,) = analyse(own, machine(), reference()).flags
    assert flag.tooth == 7
    assert flag.stiffness_loss_low < 0.25 < flag.stiffness_loss_high


def test_where_the_tachometer_stood_still_too_only_one_piece_is_looked_at():
    own = recording()
    samples = own.samples.copy()
    frozen(samples)
    answer = analyse(replace(own, samples=samples), machine(), reference())
    assert "only 1.8 to 4 s are looked at" in told(answer)
    assert answer.verdict == "healthy"


def test_a_spike_beside_a_smooth_tone_is_found():
    values = np.sin(2 * np.pi * 50 * TIME)
    values[30_000] = 6.0
    assert [bad.start for bad in bad_stretches(values)] == [30_000]


@pytest.mark.parametrize("count", [2, 3, 4, 6, 8, 20, 60, 61, 100])
def test_a_few_samples_are_no_spikes_of_each_other(count):
    values = np.random.default_rng(count).normal(size=(40, count))
    for own in values:
        assert not any("jumps" in bad.what for bad in bad_stretches(own))


@pytest.mark.parametrize("sign", [1, -1])
def test_a_channel_is_clipped_that_stays_at_one_end_only(sign):
    values = sign * np.minimum(white(20_000, seed=11), 1.5)
    (found,) = bad_stretches(values)
    assert "is clipped" in found.what
    assert (found.start, found.stop) == (0, 20_000)


def fast(count=20_000):
    """A mesh of five samples a period, modulated: its extremes are never twice in a row."""
    place = np.arange(count)
    return (1 + 0.3 * np.sin(place / 97.0)) * np.cos(1.3 * place) + 0.02 * white(count, seed=12)


def test_fast_vibration_that_is_cut_off_is_clipped_though_no_value_comes_twice_in_a_row():
    cut = np.clip(fast(), -1.15, 1.15)
    assert np.count_nonzero(np.diff(cut) == 0) < 5
    (found,) = bad_stretches(cut)
    assert "is clipped" in found.what
    assert bad_stretches(fast()) == []


@pytest.mark.parametrize("period", [4, 20, 250, 999])
def test_a_tone_of_whole_samples_a_period_is_not_clipped(period):
    assert bad_stretches(np.cos(2 * np.pi * (np.arange(20_000) % period) / period)) == []
