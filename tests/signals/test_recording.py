"""The Recording value, and reading from file to value."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from gearmon.errors import ArgumentError, RecordingError
from gearmon.signals.recording import Recording, open_recording, read_recording


def recording(**changes):
    samples = np.arange(12.0).reshape(3, 4)
    names = ("a", "b", "tacho")
    kinds = ("vibration", "vibration", "tacho")
    values = {"samples": samples, "sampling_rate_hz": 8.0, "channel_names": names}
    return Recording(**(values | {"channel_kinds": kinds} | changes))


class TestRecording:
    def test_defaults(self):
        plain = Recording(samples=np.eye(2, 5), sampling_rate_hz=10)
        assert plain.channel_names == ("channel 1", "channel 2")
        assert plain.channel_kinds == ("vibration", "vibration")
        assert plain.units == (None, None)
        assert plain.columns == (1, 2)
        assert plain.duration_s == 0.5

    def test_samples_cannot_be_changed_through_it(self):
        samples = np.zeros((1, 4))
        frozen = Recording(samples=samples, sampling_rate_hz=1.0)
        with pytest.raises(ValueError, match="read-only"):
            frozen.samples[0, 0] = 1.0
        samples[0, 0] = 2.0  # the caller's own array is left as it was

    def test_select_keeps_everything_together(self):
        chosen = recording(columns=(2, 4, 5), units=("g", None, "V")).select(["tacho", 2])
        assert chosen.channel_names == ("tacho", "a")
        assert chosen.channel_kinds == ("tacho", "vibration")
        assert chosen.units == ("V", "g")
        assert chosen.columns == (5, 2)
        assert np.array_equal(chosen.samples, np.arange(12.0).reshape(3, 4)[[2, 0]])

    def test_neighbouring_channels_are_not_copied(self):
        whole = recording()
        assert np.shares_memory(whole.vibration().samples, whole.samples)
        assert whole.select("b").samples.shape == (1, 4)

    def test_vibration(self):
        assert recording().vibration().channel_names == ("a", "b")
        with pytest.raises(RecordingError, match="no vibration channel"):
            recording(channel_kinds=("tacho",) * 3).vibration()

    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"samples": np.zeros(4)}, r"shape \(4,\), must be \(channels, n\)"),
            ({"channel_names": ("a",)}, "channel_names has 1 entries for 3 channels"),
            ({"channel_kinds": ("x",) * 3}, "kind='x' is not one of vibration, tacho"),
            ({"sampling_rate_hz": 0.0}, r"sampling_rate_hz=0.0 Hz must lie in \[0.001"),
        ],
    )
    def test_impossible_values(self, changes, message):
        with pytest.raises(ArgumentError, match=message):
            recording(**changes)

    @pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e30])
    def test_samples_must_be_finite(self, value):
        samples = np.zeros((3, 4))
        samples[1, 2] = value
        with pytest.raises(RecordingError, match="channel 'b' has values that are no finite"):
            recording(samples=samples)

    def test_one_sample_is_no_recording(self):
        with pytest.raises(RecordingError, match=r"1 sample\(s\) per channel"):
            recording(samples=np.zeros((3, 1)))


def run(code, *arguments):
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def test_reading_a_text_loads_pandas_and_no_other_heavy_library(tmp_path):
    path = tmp_path / "recording.csv"
    path.write_text("a;b\n" + "1,5;2\n2,5;3\n3,5;1\n" * 100)
    loaded = run(
        "import sys; from gearmon.signals.recording import read_recording\n"
        "read_recording(sys.argv[1], 100.0)\n"
        "print(*{name.partition('.')[0] for name in sys.modules})",
        path,
    )
    assert not {"scipy", "matplotlib", "sklearn", "polars"} & set(loaded.split())


@pytest.mark.parametrize("columns", [1, 4])
def test_peak_memory_is_well_under_twice_the_numbers(tmp_path, columns):
    rng = np.random.default_rng(13)
    rows = 8_000_000 // columns
    values = rng.normal(size=(40_000, columns)).tolist()
    lines = [",".join(f"{value:.6g}" for value in row) for row in values]
    path = tmp_path / "large.csv"
    text = "\n".join(lines) + "\n"
    with path.open("w") as stream:
        for _ in range(rows // 40_000):
            stream.write(text)
    peak_kib, loaded_kib = run(
        "import sys, pandas; from gearmon.signals.recording import read_recording\n"
        # not getrusage: what that tells is handed down from the process that started this one
        "def memory(key):\n"
        "    return open('/proc/self/status').read().partition(key)[2].split()[0]\n"
        "loaded = memory('VmRSS:')\n"
        "found = read_recording(sys.argv[1], 51200.0)\n"
        "assert found.samples.size == int(sys.argv[2])\n"
        "print(memory('VmHWM:'), loaded)",
        path,
        rows * columns,
    ).split()
    # the libraries, pandas the largest, take some 100 MB whatever the file
    assert (int(peak_kib) - int(loaded_kib)) * 1024 < 1.9 * 8 * rows * columns


@pytest.mark.parametrize("suffix", [".csv", ".npy"])
def test_samples_on_disk_are_those_in_memory(tmp_path, suffix):
    rows = np.random.default_rng(7).normal(size=(3000, 3)).round(6)
    path = tmp_path / f"long{suffix}"
    if suffix == ".npy":
        np.save(path, rows)
    else:
        np.savetxt(path, rows, "%.6f", ",", header="a1 [g],a2 [g],tacho", comments="")
    held, lying = read_recording(path, 2000.0), open_recording(path, 2000.0)
    np.testing.assert_array_equal(lying.samples, held.samples)
    assert (lying.channel_kinds, lying.units, lying.notes) == (
        held.channel_kinds,
        held.units,
        held.notes,
    )
