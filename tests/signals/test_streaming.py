"""Recordings as streams of blocks: the same numbers as in memory, and bounded memory."""

from __future__ import annotations

import struct
import subprocess
import sys

import numpy as np
import pytest
from scipy.io import wavfile

from gearmon.errors import ArgumentError, RecordingError
from gearmon.signals import indicators
from gearmon.signals.angle import AngleTrack, resample_to_angle
from gearmon.signals.phase import constant_track
from gearmon.signals.recording import read_recording
from gearmon.signals.streaming import open_recording
from gearmon.signals.streaming_average import stream_average
from gearmon.signals.streaming_reading import positions, read_between
from gearmon.signals.streaming_statistics import Moments, stream_indicators
from gearmon.signals.streaming_tacho import stream_pulses
from gearmon.signals.tacho import find_pulses, track_from_pulses

RNG = np.random.default_rng(8)
RATE = 8000.0
COUNT = 120_001
TIME = np.arange(COUNT) / RATE
TURNS = 25.3 * TIME + 0.05 * np.sin(2 * np.pi * 0.3 * TIME)
PATTERN = (23, 0.8, 0.3), (46, 0.3, 1.0), (5, 0.2, 2.0)  # order, amplitude, phase


def shaped(turns):
    return sum(a * np.cos(2 * np.pi * order * turns + phase) for order, a, phase in PATTERN)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """A wandering shaft with its tacho, as a WAV file."""
    target = tmp_path_factory.mktemp("streams") / "long.wav"
    vibration = shaped(TURNS) + 0.2 * RNG.normal(size=COUNT) + 3.0
    tacho = np.clip(40.0 * (0.05 - np.abs(np.mod(TURNS + 0.5, 1) - 0.5)), 0.0, 1.0)
    wavfile.write(target, int(RATE), np.stack([vibration, tacho], axis=1).astype("f4"))
    return target


class TestBlocks:
    @pytest.mark.parametrize("samples", [1, 7, 4096, COUNT - 1, COUNT, 10 * COUNT])
    def test_blocks_make_up_the_recording(self, path, samples):
        stop = 500 if samples == 1 else None
        with open_recording(path, tacho=2) as stream:
            pieces = list(stream.blocks(samples, stop=stop))
            assert [first for first, _ in pieces] == list(range(0, stop or COUNT, samples))
            assert all(block.shape[1] == samples for _, block in pieces[:-1])
            whole = np.concatenate([block for _, block in pieces], axis=1)
        assert np.array_equal(whole, read_recording(path, tacho=2).samples[:, :stop])

    def test_what_is_known_is_that_of_the_recording(self, path):
        recording = read_recording(path, tacho=2)
        with open_recording(path, tacho=2) as stream:
            for name in ("sampling_rate_hz", "channel_names", "channel_kinds", "units", "columns"):
                assert getattr(stream, name) == getattr(recording, name)
            assert (stream.notes, stream.origin) == (recording.notes, recording.origin)
            assert stream.shape == recording.samples.shape
            assert stream.duration_s == recording.duration_s
            assert np.array_equal(stream.read(100, 300), recording.samples[:, 100:300])
            for bounds in ((-1, 5), (5, 5), (0, COUNT + 1)):
                with pytest.raises(ArgumentError, match="are not within"):
                    stream.read(*bounds)

    def test_a_text_with_its_time_column(self, tmp_path):
        target = tmp_path / "long.csv"
        values = RNG.normal(size=(90_000, 2))
        rows = enumerate(values.tolist())
        lines = [f"{k / 25_600:.6f};{a:.5f};{b:.6f}\n" for k, (a, b) in rows]
        target.write_text("time_s;a1 [g];a2\n" + "".join(lines))
        recording = read_recording(target)
        with open_recording(target) as stream:
            assert stream.shape == (2, 90_000)
            assert stream.sampling_rate_hz == pytest.approx(25_600.0, rel=1e-7)
            assert stream.units == ("m/s2", None)
            got = np.concatenate([block for _, block in stream.blocks(1000)], axis=1)
            assert np.array_equal(got, recording.samples)
            assert np.array_equal(stream.read(80_000, 80_010), recording.samples[:, 80_000:80_010])
        del lines[70_000]
        target.write_text("time_s;a1 [g];a2\n" + "".join(lines))
        with pytest.raises(RecordingError, match=r"line 70002, .* about 1 sample is missing"):
            open_recording(target)

    def test_a_value_that_is_no_number(self, tmp_path):
        target = tmp_path / "a.npy"
        values = RNG.normal(size=(2, 100_000))
        values[1, 99_000] = np.nan
        np.save(target, values)
        with (
            open_recording(target, 1000.0) as stream,
            pytest.raises(RecordingError, match="sample 99001, channel 'channel 2': no finite"),
        ):
            list(stream.blocks())


class TestIndicators:
    @pytest.mark.parametrize("samples", [100, 4096, 1 << 18])
    def test_equal_those_of_the_whole_recording(self, path, samples):
        whole = read_recording(path, tacho=2).samples
        with open_recording(path, tacho=2) as stream:
            found = stream_indicators(stream, samples=samples)
        for name, expected in (
            ("mean", whole.mean(axis=1)),
            ("rms", indicators.rms(whole)),
            ("peak_to_peak", indicators.peak_to_peak(whole)),
            ("crest_factor", indicators.crest_factor(whole)),
            ("kurtosis", indicators.kurtosis(whole)),
            ("sixth_moment", indicators.normalised_moment(whole, 6)),
            ("eighth_moment", indicators.normalised_moment(whole, 8)),
        ):
            assert getattr(found, name) == pytest.approx(expected, rel=1e-11), name

    @pytest.mark.parametrize("offset", [0.0, 1e6])
    @pytest.mark.parametrize("scale", [1.0, 1e-20, 1e20])
    def test_far_from_zero_and_at_any_scale(self, offset, scale):
        values = scale * (RNG.normal(size=(1, 50_000)) + offset)
        parts = np.array_split(values, 37, axis=1)
        total = Moments.of(parts[0])
        for part in parts[1:]:
            total = total.joined(Moments.of(part))
        found = total.indicators()
        tolerance = 1e-12 if offset == 0.0 else 1e-8
        for power, name in ((4, "kurtosis"), (6, "sixth_moment"), (8, "eighth_moment")):
            expected = indicators.normalised_moment(values, power)
            assert getattr(found, name) == pytest.approx(expected, rel=tolerance)

    def test_a_constant_has_none(self):
        found = Moments.of(np.full((1, 100), 2.5)).indicators()
        assert (found.rms, found.crest_factor, found.kurtosis, found.eighth_moment) == (0, 0, 0, 0)
        assert found.mean == 2.5


class TestAverage:
    def track(self, path):
        with open_recording(path, tacho=2) as stream:
            return track_from_pulses(stream_pulses(stream), 1, 1.0, stream.duration_s)

    def test_equals_the_average_of_the_whole_recording(self, path):
        track = self.track(path)
        with open_recording(path, channels=1) as stream:
            found = stream_average(stream, track)
        steps, samples = found.average.shape[1], read_recording(path, channels=1).samples
        count = found.turns * steps
        turns = resample_to_angle(samples, RATE, track, steps, found.first_turn, count)
        turns = turns.reshape(1, found.turns, steps)
        # the ends of the pieces, where the tapers lie, differ
        assert np.abs(found.average - turns.mean(axis=1)).max() < 1e-4
        assert np.abs(found.scatter - turns.std(axis=1, ddof=1)).max() < 1e-3

    def test_the_planted_pattern_comes_back(self, path):
        with open_recording(path, channels=1) as stream:
            found = stream_average(stream, self.track(path))
        angle = np.arange(found.average.shape[1]) / found.average.shape[1]
        expected = shaped(angle - 0.0375)  # where the tacho rises through one half
        correlation = np.corrcoef(found.average[0], expected)[0, 1]
        assert correlation > 0.999
        assert np.mean(found.scatter) == pytest.approx(0.2, rel=0.05)

    def test_long_turns_are_averaged_in_parts(self, path, monkeypatch):
        track = constant_track(25.0, COUNT / RATE)
        with open_recording(path, channels=1) as stream:
            whole = stream_average(stream, track, shaft_order=0.11)
            monkeypatch.setattr("gearmon.signals.streaming_average._STEPS", 1000)
            parts = stream_average(stream, track, shaft_order=0.11)
        assert whole.turns == parts.turns == 41
        assert parts.average.shape[1] > 1000
        # noise next to half the sampling rate is read less well at the ends of pieces
        assert np.abs(whole.average - parts.average).max() < 1e-3
        assert np.abs(whole.scatter - parts.scatter).max() < 5e-3

    def test_other_shafts_and_steps(self, path):
        track = AngleTrack(
            time_s=np.array([0.0, 15.1]),
            turns=np.array([0.0, 15.1 * 25.0]),
            method="constant",
            uncertainty_turns=0.0,
        )
        with open_recording(path, channels=1) as stream:
            found = stream_average(stream, track, shaft_order=0.4, per_turn=1024)
            assert found.average.shape == (1, 1024)
            assert found.turns == int(10.0 * COUNT / RATE)
            with pytest.raises(RecordingError, match=r"0\.15 turns of the shaft recorded"):
                stream_average(stream, track, shaft_order=0.0004)


class TestReadingBetweenSamples:
    @pytest.mark.parametrize(
        ("frequency", "error"), [(0.0, 1e-14), (0.03, 1e-5), (0.1, 1e-5), (0.15, 1e-5), (0.2, 1e-4)]
    )
    def test_tones(self, frequency, error):
        def tone(at):
            return 2.0 + np.cos(2 * np.pi * frequency * at + 0.4)

        at = np.sort(RNG.uniform(10, 9980, 9000))
        found = read_between(tone(np.arange(10_000.0))[None], at)
        assert np.abs(found - tone(at)).max() < max(error, 1e-14 * 3)

    def test_samples_come_back_and_a_ramp_goes_on_at_the_ends(self):
        values = RNG.normal(size=(2, 500))
        assert np.allclose(read_between(values, np.arange(500.0)), values, rtol=0, atol=1e-6)
        ramp = np.arange(500.0)[None]
        at = np.linspace(0, 499, 4000)
        assert np.allclose(read_between(ramp, at), at, rtol=0, atol=2e-3)
        inside = (at > 6) & (at < 493)
        assert np.allclose(read_between(ramp, at)[:, inside], at[inside], rtol=0, atol=1e-4)

    @pytest.mark.parametrize("knots", [2, 40, 2000])
    def test_places_are_those_of_the_track(self, knots):
        time = np.linspace(0.0, 10.0, knots)
        turns = 20.0 * time + 0.05 * np.sin(time)
        track = AngleTrack(time_s=time, turns=turns, method="tacho", uncertainty_turns=0.0)
        for first, count in ((3.25, 5000), (11.0, 17), (0.5, 1)):
            wanted = track.time_at(first + np.arange(count) / 400) * RATE
            found = positions(track, first, 400, count, RATE)
            assert np.abs(found - wanted).max() < 1e-3


class TestTacho:
    @pytest.mark.parametrize("samples", [50, 1000, 1 << 18])
    def test_equal_those_of_the_whole_recording(self, path, samples):
        expected = find_pulses(read_recording(path, tacho=2).samples[1], RATE)
        with open_recording(path, tacho=2) as stream:
            found = stream_pulses(stream, samples=samples)
        assert np.allclose(found.time_s, expected.time_s, rtol=0, atol=1e-12)

    def test_uneven_pulses_are_learned_as_in_memory(self, tmp_path):
        # three stripes a turn at 0, 0.2 and 0.7 of it: intervals of 0.2, 0.5 and 0.3
        turns = 12.0 * TIME[:60_000] + 0.2 * np.sin(2 * np.pi * 0.2 * TIME[:60_000])
        away = np.mod(turns[:, None] - np.array([0.0, 0.2, 0.7]) + 0.5, 1) - 0.5
        wave = np.clip(40.0 * (0.03 - np.abs(away).min(axis=1)), 0.0, 1.0)
        wave[20_000:20_350] = 0.0  # a stripe or two go unseen
        target = tmp_path / "stripes.wav"
        wavfile.write(target, int(RATE), np.stack([RNG.normal(size=60_000), wave], 1).astype("f4"))
        expected = find_pulses(read_recording(target, tacho=2).samples[1], RATE, per_turn=3)
        with open_recording(target, tacho=2) as stream:
            found = stream_pulses(stream, per_turn=3, samples=1000)
            with pytest.raises(RecordingError, match=r"stripes\.wav: tacho .* at most 2 %"):
                stream_pulses(stream)
        assert 1 <= expected.missing <= 3
        assert (found.missing, found.extra) == (expected.missing, expected.extra)
        assert np.allclose(found.time_s, expected.time_s, rtol=0, atol=1e-12)

    def test_no_tacho_channel(self, path):
        with (
            open_recording(path) as stream,
            pytest.raises(RecordingError, match="0 tacho channels; name the one to use"),
        ):
            stream_pulses(stream)


LONG_RUN = """
import sys
from gearmon.signals.phase import constant_track
from gearmon.signals.streaming import open_recording
from gearmon.signals.streaming_average import stream_average
from gearmon.signals.streaming_statistics import stream_indicators
shares = []
with open_recording(sys.argv[1]) as stream:
    stream_indicators(stream, progress=shares.append)
    track = constant_track(25.0, stream.duration_s)
    average = stream_average(stream, track, precise=False, progress=shares.append)
    assert average.turns == stream.shape[1] // 2000 - (stream.shape[1] % 2000 == 0), average.turns
assert shares[-1] == 1.0
status = open("/proc/self/status").read()
print(status.partition("VmHWM:")[2].split()[0])
"""


def sparse_wav(path, count):
    """Write a WAV file of 16-bit zeros that takes no room on the disk."""
    head = struct.pack("<HHIIHH", 1, 1, 50_000, 100_000, 2, 16)
    with path.open("wb") as stream:
        stream.write(b"RIFF" + struct.pack("<I", 36 + 2 * count) + b"WAVEfmt ")
        stream.write(struct.pack("<I", 16) + head + b"data" + struct.pack("<I", 2 * count))
        stream.truncate(44 + 2 * count)
        stream.seek(44 + 2)
        stream.write(b"\x01\x00")


@pytest.mark.parametrize("count", [4_000_000, 20_000_000])
def test_memory_does_not_grow_with_the_recording(tmp_path, count):
    path = tmp_path / "sparse.wav"
    sparse_wav(path, count)
    command = [sys.executable, "-c", LONG_RUN, str(path)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    # 20 million samples are 153 MiB as float64; interpreter and libraries take half of this
    assert int(done.stdout) < 120 * 1024
