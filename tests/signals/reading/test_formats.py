"""Files that are no text and need nothing extra: WAV, npy, npz and MATLAB."""

from __future__ import annotations

import io
import struct
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.io
from scipy.io import wavfile

from gearmon.errors import RecordingError
from gearmon.signals.recording import read_recording

RNG = np.random.default_rng(5)
X = 0.1 * RNG.normal(size=(3, 400))
FULL_SCALE = {"u1": 2.0**7, "i2": 2.0**15, "i4": 2.0**31, "f4": 1.0, "f8": 1.0}


def sensor(column, **values):
    usual = {"unit": None, "sensitivity": 1.0, "kind": "vibration"}
    return SimpleNamespace(column=column, **(usual | values))


def refused(path, *arguments, **named):
    with pytest.raises(RecordingError) as caught:
        read_recording(path, *arguments, **named)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    return message.removeprefix(str(path))


def wav(tag=1, channels=1, rate=8000, bits=16, body=b"", size=None, magic=b"RIFF", before=b""):
    frame = channels * bits // 8
    form = struct.pack("<HHIIHH", tag, channels, rate, rate * frame, frame, bits)
    size = len(body) if size is None else size
    chunks = b"WAVE" + before + b"fmt " + struct.pack("<I", 16) + form
    chunks += b"data" + struct.pack("<I", size) + body
    return magic + struct.pack("<I", len(chunks) & 0xFFFFFFFF) + chunks


class TestWav:
    @pytest.mark.parametrize("dtype", FULL_SCALE)
    @pytest.mark.parametrize("channels", [1, 3])
    def test_equals_the_reader_of_scipy(self, tmp_path, dtype, channels):
        path = tmp_path / "a.wav"
        whole = X * (100.0 if dtype == "u1" else FULL_SCALE[dtype] * 0.9)
        samples = whole + (128.0 if dtype == "u1" else 0.0)
        wavfile.write(path, 12_000, samples[:channels].T.astype(dtype))
        rate, expected = wavfile.read(path)
        found = read_recording(path)
        zero = 128.0 if dtype == "u1" else 0.0
        expected = (expected.reshape(-1, channels).T.astype(float) - zero) / FULL_SCALE[dtype]
        assert np.array_equal(found.samples, expected)
        assert found.sampling_rate_hz == rate
        assert found.units == (None,) * channels
        assert found.channel_kinds == ("vibration",) * channels
        told = "full scale is taken as 1" in " ".join(found.notes)
        assert told == (dtype[0] != "f")

    def test_24_bits(self, tmp_path):
        path = tmp_path / "a.wav"
        numbers = [0, 1, -1, 2**23 - 1, -(2**23), 12345, -54321]
        body = b"".join(number.to_bytes(3, "little", signed=True) for number in numbers)
        path.write_bytes(wav(bits=24, body=body))
        assert read_recording(path).samples[0].tolist() == [n / 2**23 for n in numbers]

    @pytest.mark.parametrize(("stated", "rate_hz"), [(16_000, 8000.0), (0, 8000.0), (8000, None)])
    def test_bytes_a_second_may_be_left_out_and_must_not_contradict(
        self, tmp_path, stated, rate_hz
    ):
        path = tmp_path / "a.wav"
        content = bytearray(wav(body=(1e5 * X[0]).astype("<i2").tobytes()))
        place = content.index(b"fmt ") + 8 + 8
        content[place : place + 4] = struct.pack("<I", stated)
        path.write_bytes(content)
        if rate_hz is None:
            assert "sampling rate" in refused(path)
        else:
            assert read_recording(path).sampling_rate_hz == rate_hz

    def test_a_file_of_the_long_kind(self, tmp_path):
        path = tmp_path / "a.wav"
        body = np.arange(-50, 50, dtype="<i2").tobytes()
        sizes = struct.pack("<QQQI", 0, len(body), 100, 0)
        head = b"ds64" + struct.pack("<I", len(sizes)) + sizes
        path.write_bytes(wav(body=body, size=0xFFFFFFFF, magic=b"RF64", before=head))
        assert read_recording(path).samples[0].tolist() == (np.arange(-50, 50) / 2**15).tolist()

    def test_parts_of_no_interest_are_passed_over(self, tmp_path):
        path = tmp_path / "a.wav"
        body = np.arange(50, dtype="<i2").tobytes()
        path.write_bytes(
            wav(body=body, before=b"LIST\x03\0\0\0abc\0") + b"id3 \x02\0\0\0ok" + bytes(3)
        )
        assert read_recording(path).samples.shape == (1, 50)
        path.write_bytes(path.read_bytes() + b"junk")
        with pytest.raises(RecordingError, match="a chunk of 7040629 bytes where 0 are left"):
            read_recording(path)

    @pytest.mark.parametrize(
        ("content", "said"),
        [
            (wav(body=bytes(100))[:40], "header was never completed"),
            (wav(body=bytes(100))[:30], "a chunk of 16 bytes where 10 are left"),
            (wav(body=bytes(100))[:-10], "a chunk of 100 bytes where 90 are left"),
            (wav(body=bytes(101)), "101 bytes, 1 channels, 16 bits"),
            (wav(body=bytes(100), size=0), "header was never completed"),
            (wav(body=bytes(100), size=0xFFFFFFFF), "header was never completed"),
            (wav(tag=7, bits=8, body=bytes(100)), "8-bit samples of format 0x0007"),
            (wav(tag=1, bits=64, body=bytes(96)), "64-bit samples of format 0x0001; read are"),
            (wav(rate=0, body=bytes(100)), "1 channels, 16 bits, 0 Hz"),
            (wav(channels=0, body=bytes(100)), "0 channels, 16 bits"),
            (b"RIFF\x24\0\0\0AVI LIST" + bytes(90), "does not say what its samples are"),
            (
                b"RIFF\x24\0\0\0WAVEdata\x02\0\0\0abcd",
                "it does not say what its samples are",
            ),
            (b"RIFF\x24\0\0\0WAVELIST\xff\0\0\0", "a chunk of 255 bytes where 0 are left"),
        ],
    )
    def test_damaged_files(self, tmp_path, content, said):
        path = tmp_path / "a.wav"
        path.write_bytes(content)
        assert said in refused(path)

    def test_a_rate_that_contradicts_the_file(self, tmp_path):
        path = tmp_path / "a.wav"
        wavfile.write(path, 12_000, X.T)
        assert "the file says 12000 Hz, but 11000 Hz was given" in refused(path, 11_000.0)
        assert read_recording(path, 12_001.0).sampling_rate_hz == 12_001.0

    def test_sensors_and_channels_as_of_a_table(self, tmp_path):
        path = tmp_path / "a.wav"
        wavfile.write(path, 12_000, X.T)
        sensors = [sensor(1, unit="g", sensitivity=0.1), sensor(3, unit="V", kind="tacho")]
        found = read_recording(path, sensors=sensors)
        assert found.units == ("m/s2", None, "V")
        assert found.channel_kinds == ("vibration", "vibration", "tacho")
        assert np.allclose(found.samples[0], X[0] / 0.1 * 9.80665, rtol=1e-15)
        two = read_recording(path, channels=[2], tacho=3)
        assert two.columns == (2, 3)
        assert np.array_equal(two.samples, X[[1, 2]])

    def test_a_dead_channel_is_left_out(self, tmp_path):
        path = tmp_path / "a.wav"
        wavfile.write(path, 12_000, np.stack([X[0], 0 * X[0]]).T)
        found = read_recording(path)
        assert found.columns == (1,)
        assert any("column 2 is constant" in note for note in found.notes)


class TestNpy:
    @pytest.mark.parametrize(
        ("stored", "expected"),
        [
            (X[0], X[:1]),
            (X[:1], X[:1]),
            (X[:1].T, X[:1]),
            (X, X),
            (X.T, X),
            (np.asfortranarray(X), X),
            (np.asfortranarray(X.T), X),
            (X[None, :, :], X),
            (X.astype(">f4"), X.astype("f4")),
            ((1000 * X).astype("i2"), (1000 * X).astype("i2")),
        ],
    )
    def test_shapes(self, tmp_path, stored, expected):
        path = tmp_path / "a.npy"
        np.save(path, stored)
        found = read_recording(path, 5000.0)
        assert np.array_equal(found.samples, expected)

    def test_the_rate_is_asked_for(self, tmp_path):
        path = tmp_path / "a.npy"
        np.save(path, X)
        assert "does not say its sampling rate; give --sampling-rate HZ" in refused(path)

    def test_records_have_named_channels(self, tmp_path):
        path = tmp_path / "a.npy"
        time = np.arange(400) / 5000.0
        np.save(path, np.rec.fromarrays([time, X[0], X[1]], names="time_s,a1,a2"))
        found = read_recording(path)
        assert found.channel_names == ("a1", "a2")
        assert found.sampling_rate_hz == 5000.0
        assert np.array_equal(found.samples, X[:2])

    @pytest.mark.parametrize(
        ("stored", "said"),
        [
            (X[:, :3], "it holds numbers of shape (3, 3)); an array of real numbers"),
            (np.array([1, "a"], dtype=object), "Python objects"),
            (X[0] * 1j, "without a signal in it"),
            (np.zeros((3, 4, 5)), "without a signal in it"),
            (np.array(1.0), "without a signal in it"),
        ],
    )
    def test_arrays_that_are_no_recording(self, tmp_path, stored, said):
        path = tmp_path / "a.npy"
        np.save(path, stored)
        assert said in refused(path, 5000.0)

    def test_a_file_cut_off(self, tmp_path):
        path = tmp_path / "a.npy"
        np.save(path, X)
        path.write_bytes(path.read_bytes()[:-1])
        assert "cannot be read as such (mmap length is greater" in refused(path, 5000.0)

    def test_bytes_in_another_order_than_told(self, tmp_path):
        path = tmp_path / "a.npy"
        np.save(path, X)
        path.write_bytes(path.read_bytes().replace(b"<f8", b">f8"))
        assert "is more than any sensor gives" in refused(path, 5000.0)


class TestSeveralArrays:
    def saved(self, path, **arrays):
        np.savez(path, **arrays)
        return path

    def test_the_only_array_with_its_rate_and_speed(self, tmp_path):
        path = self.saved(tmp_path / "a.npz", vib=X, fs=5000.0, speed_rpm=1480.0)
        found = read_recording(path)
        assert found.channel_names == ("vib 1", "vib 2", "vib 3")
        assert found.sampling_rate_hz == 5000.0
        assert any(
            note.startswith("the file states") and note.endswith("= 1480") for note in found.notes
        )

    def test_one_of_several_must_be_named(self, tmp_path):
        path = self.saved(tmp_path / "a.npz", de=X[0], fe=X[1, :300], both=X[:2], fs=5000.0)
        said = refused(path)
        assert "holds 3 arrays that may be the recording; name with --channel" in said
        assert "de (1; 400 samples), fe (2; 300 samples), both (3 to 4; 2 x 400 samples)" in said
        for key in ("fe", 2):
            found = read_recording(path, channels=key)
            assert np.array_equal(found.samples, X[1:2, :300])
            assert found.columns == (2,)
        assert read_recording(path, channels="both").columns == (3, 4)
        assert read_recording(path, channels="both 2").columns == (4,)
        assert read_recording(path, channels=["de", "both 2"]).columns == (1, 4)
        assert read_recording(path, sensors=[sensor("de", unit="g")]).units == ("m/s2",)
        assert "'de' and 'fe' are not equally long" in refused(path, channels=["de", "fe"])
        assert "no channel 'fee'; did you mean fe?" in refused(path, channels="fee")

    def test_time_and_tacho_of_the_same_length_come_along(self, tmp_path):
        time = np.arange(400) / 5000.0
        pulses = (np.arange(400) % 50 < 5) * 1.0
        path = self.saved(tmp_path / "a.npz", time_s=time, acc=X[0], tacho=pulses, tacho2=X[0, :9])
        found = read_recording(path)
        assert found.channel_names == ("acc", "tacho")
        assert found.channel_kinds == ("vibration", "tacho")
        assert found.sampling_rate_hz == 5000.0
        assert "the file says" not in " ".join(found.notes)

    def test_what_is_called_a_counter_does_not_come_along(self, tmp_path):
        path = self.saved(tmp_path / "a.npz", acc=X[0], n=X[1], speed=X[2], fs=5000.0)
        assert read_recording(path).channel_names == ("acc", "speed")

    def test_rate_and_time_must_agree(self, tmp_path):
        time = np.arange(400) / 5000.0
        path = self.saved(tmp_path / "a.npz", time_s=time, acc=X[0], fs=4000.0)
        assert "its stamps say 5000 Hz, but the file says 4000 Hz as well" in refused(path)

    @pytest.mark.parametrize(
        ("facts", "hint"),
        [
            ({"rate": 25.0}, "rate = 25 may be it"),
            ({"fs": 5000.0, "sampling_rate": 4000.0}, "fs = 5000, sampling_rate = 4000"),
            ({"fs": -1.0}, "fs = -1"),
            ({"fs": np.nan}, "fs = nan"),
            ({}, ""),
        ],
    )
    def test_a_doubtful_rate_is_not_taken(self, tmp_path, facts, hint):
        path = self.saved(tmp_path / "a.npz", acc=X[0], **facts)
        assert f"give --sampling-rate HZ{' (' if hint else ''}" in refused(path)
        assert hint in refused(path)
        assert read_recording(path, 5000.0).sampling_rate_hz == 5000.0

    def test_a_plausible_number_under_a_usual_name_is_the_rate(self, tmp_path):
        path = self.saved(tmp_path / "a.npz", acc=X[0], sr=97_656.0, rate=25.0)
        found = read_recording(path)
        assert found.sampling_rate_hz == 97_656.0
        assert "sampling rate 97656 Hz taken from sr, not rate = 25" in found.notes

    def test_nothing_but_numbers_and_text(self, tmp_path):
        path = self.saved(tmp_path / "a.npz", fs=5000.0, name=np.array("x"))
        assert "without a signal in it (it holds name)" in refused(path)


class TestMatlab:
    VARIABLES = {  # noqa: RUF012
        "X097_DE_time": X[0][:, None],
        "X097_FE_time": X[1][:350, None].astype("f4"),
        "X097RPM": np.array([[1796.0]]),
        "note": "a text",
        "cells": np.array([1.0, "a"], dtype=object),
        "bearing": {"gs": X[2], "sr": 97656.0, "inner": {"counts": np.arange(40, dtype="i2")}},
    }

    @pytest.mark.parametrize("packed", [False, True])
    def test_equals_the_reader_of_scipy(self, tmp_path, packed):
        path = tmp_path / "a.mat"
        scipy.io.savemat(path, self.VARIABLES, do_compression=packed)
        loaded = scipy.io.loadmat(path, simplify_cells=True)
        for name in ("X097_DE_time", "X097_FE_time", "bearing.gs", "bearing.inner.counts"):
            expected = loaded
            for part in name.split("."):
                expected = expected[part]
            found = read_recording(path, 97_656.0, channels=name)
            assert np.array_equal(found.samples[0], expected)
            assert found.channel_names == (name,)
            assert any(
                note.startswith("the file states") and note.endswith("= 1796")
                for note in found.notes
            )
        said = refused(path)
        assert "holds 4 arrays" in said
        assert "X097_DE_time (1; 400 samples)" in said

    def test_a_struct_with_its_rate(self, tmp_path):
        path = tmp_path / "a.mat"
        scipy.io.savemat(path, {"run": {"Fs": 25_600.0, "acc": X.T}})
        found = read_recording(path)
        assert found.sampling_rate_hz == 25_600.0
        assert np.array_equal(found.samples, X)

    @pytest.mark.parametrize(
        ("facts", "rate", "note"),
        [
            (
                {"bearing": {"rate": 25.0, "sr": 48_828.0}},
                48_828.0,
                "sampling rate 48828 Hz taken from bearing.sr, not bearing.rate = 25",
            ),
            ({"Head_1": {"SampFreq": 25_600.0}}, 25_600.0, "taken from Head_1.SampFreq"),
            ({"Head": {"a": {"samp_freq_Hz": 2e4}}}, 2e4, "taken from Head.a.samp_freq_Hz"),
            ({"Fs": 25.6, "sampleRateHz": 25_600.0}, 25_600.0, "sampleRateHz, not Fs = 25.6"),
        ],
    )
    def test_a_rate_that_is_named_and_plausible_is_taken(self, tmp_path, facts, rate, note):
        path = tmp_path / "a.mat"
        scipy.io.savemat(path, {"acc": X[0], **facts})
        found = read_recording(path)
        assert found.sampling_rate_hz == rate
        assert note in " ".join(found.notes)
        assert "the file says" in refused(path, 2 * rate)

    @pytest.mark.parametrize(
        ("facts", "hint"),
        [
            ({"sr": 25.0}, "sr = 25 may be it"),
            ({"sr": np.nan, "rate": 25_600.0}, "rate = 25600 may be it"),
            ({"f": 30.0, "rate": 25_600.0}, "rate = 25600 may be it"),
            ({"sr": 48_828.0, "SampFreq": 25_600.0}, "sr = 48828, SampFreq = 25600 may be it"),
        ],
    )
    def test_else_the_likeliest_numbers_are_named(self, tmp_path, facts, hint):
        path = tmp_path / "a.mat"
        scipy.io.savemat(path, {"acc": X[0], **facts})
        assert hint in refused(path)

    def test_damaged_files(self, tmp_path):
        path, stored = tmp_path / "a.mat", io.BytesIO()
        scipy.io.savemat(stored, {"acc": X})
        whole = stored.getvalue()
        path.write_bytes(whole[:-400])
        assert "cannot be read as such" in refused(path, 5000.0)
        path.write_bytes(whole[:126] + b"xx" + whole[128:])
        assert "cannot be read as such" in refused(path, 5000.0)


def test_packed_or_piped_files_are_refused(tmp_path):
    import gzip

    path = tmp_path / "a.wav.gz"
    path.write_bytes(gzip.compress(wav(body=bytes(100))))
    assert "a WAV sound file packed with gzip; unpack it first" in refused(path)


def test_arrays_of_several_blocks_are_whole(tmp_path):
    path, samples = tmp_path / "a.npy", RNG.normal(size=(2, 600_000))
    np.save(path, samples)
    np.testing.assert_array_equal(read_recording(path, 5000.0).samples, samples)


def test_nothing_at_all_behind_the_first_bytes(tmp_path):
    path = tmp_path / "recording.bin"
    stored = io.BytesIO()
    np.save(stored, np.zeros((2, 300)))
    for length in range(1, 130):
        path.write_bytes(stored.getvalue()[:length])
        with pytest.raises(RecordingError):
            read_recording(path, 5000.0)


def test_a_rate_that_a_wav_header_tells_in_two_ways_is_asked_for(tmp_path):
    path = tmp_path / "a.wav"
    wavfile.write(path, 5000, (X.T * 2**15).astype("i2"))
    data = bytearray(path.read_bytes())
    data[24] ^= 1
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=r"does not say its sampling rate"):
        read_recording(path)
    assert read_recording(path, 5000.0).sampling_rate_hz == 5000.0


@pytest.mark.parametrize("block", [1, 150, 399, 400, 1000])
def test_samples_are_the_same_in_blocks_of_any_length(tmp_path, monkeypatch, block):
    """Of long files some are read at a time, from where the last ones ended."""
    monkeypatch.setattr("gearmon.signals.reading.arrays._BLOCK", block)
    wavfile.write(tmp_path / "a.wav", 8000, X.T)
    whole = (1e4 * X[:1]).astype("<i4").view("u1").reshape(-1, 4)[:, :3].tobytes()
    (tmp_path / "24.wav").write_bytes(wav(bits=24, body=whole))
    np.save(tmp_path / "a.npy", X)
    np.save(tmp_path / "turned.npy", np.asfortranarray(X.T))
    np.savez(tmp_path / "a.npz", acc=X.T)
    scipy.io.savemat(tmp_path / "a.mat", {"acc": X.T})
    for path in sorted(tmp_path.iterdir()):
        found = read_recording(path, 8000.0).samples
        expected = (1e4 * X[:1]).astype(int) / 2**23 if path.stem == "24" else X
        np.testing.assert_array_equal(found, expected, path.name)
