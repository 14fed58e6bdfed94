"""Damaged files of every format: a recording or one clear line, never anything else."""

from __future__ import annotations

import io
import random

import numpy as np
import pytest
import scipy.io
from scipy.io import wavfile

from gearmon.errors import RecordingError
from gearmon.signals.recording import read_recording

X = 0.1 * np.random.default_rng(7).normal(size=(2, 300))


def wav(path):
    wavfile.write(path, 5000, (X.T * 2**15).astype("i2"))


def npy(path):
    with path.open("wb") as stream:
        np.save(stream, X)


def npz(path):
    with path.open("wb") as stream:
        np.savez(stream, vib=X, fs=5000.0)


def mat(path):
    scipy.io.savemat(path, {"run": {"acc": X[0], "fs": 5000.0}, "text": "abc"})


def packed_mat(path):
    scipy.io.savemat(path, {"acc": X[0], "fs": 5000.0}, do_compression=True)


def flac(path):
    pytest.importorskip("soundfile").write(path, X.T, 5000, format="FLAC")


def hdf5(path):
    with pytest.importorskip("h5py").File(path, "w") as file:
        file["acc"] = X
        file.attrs["fs"] = 5000.0


def tdms(path):
    nptdms = pytest.importorskip("nptdms")
    wave = {"wf_increment": 1 / 5000, "unit_string": "g"}
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.ChannelObject("g", f"a{k}", X[k], wave) for k in (0, 1)])


def parquet(path):
    pyarrow = pytest.importorskip("pyarrow")
    pytest.importorskip("pyarrow.parquet").write_table(pyarrow.table({"a": X[0]}), path)


def uff(path):
    pytest.importorskip("pyuff")
    head = ["    -1", "    58", "acc", "NONE", "01-Jan-24 00:00:00", "NONE", "NONE"]
    head.append("    1         0    0         0 NONE               1   3 NONE               0   0")
    head.append("         4       300         1  0.00000e+00  2.00000e-04  0.00000e+00")
    for kind, unit in ((17, "s"), (12, "m/s^2"), (0, "NONE"), (0, "NONE")):
        head.append(f"{kind:10d}{0:5d}{0:5d}{0:5d} {'NONE':20s} {unit:20s}")
    rows = ["".join(f"{value:20.11E}" for value in X[0][k : k + 4]) for k in range(0, 300, 4)]
    path.write_text("\n".join([*head, *rows, "    -1"]) + "\n")


def damaged(data, rng):
    changed = bytearray(data)
    for _ in range(rng.choice([1, 1, 2, 4])):
        if not changed:
            break
        near = rng.random()
        place = rng.randrange(min(len(changed), 600) if near < 0.7 else len(changed))
        if near < 0.15:  # some formats keep what matters at their end
            place = len(changed) - 1 - place
        match rng.randrange(6):
            case 0:
                del changed[place : place + rng.randrange(1, 20)]
            case 1:
                changed[place:place] = changed[place : place + rng.randrange(1, 20)]
            case 2:
                changed[place] = rng.randrange(256)
            case 3:
                changed[place] ^= 1 << rng.randrange(8)
            case 4:
                changed[place : place + 4] = rng.choice(
                    [bytes(4), b"\xff" * 4, b"\xff\xff\xff\x7f"]
                )
            case 5:
                del changed[place:]
    return bytes(changed)


@pytest.mark.parametrize("write", [wav, npy, npz, mat, packed_mat, flac, hdf5, tdms, parquet, uff])
def test_damaged_files(tmp_path, write):
    path = tmp_path / "recording.bin"
    write(path)
    whole = path.read_bytes()
    given = None if write not in (npy, parquet) else 5000.0
    assert read_recording(path, given).sampling_rate_hz == 5000.0
    messages = []
    for seed in range(60):
        path.write_bytes(damaged(whole, random.Random(f"{write.__name__} {seed}")))
        try:
            recording = read_recording(path, given)
        except RecordingError as error:
            messages.append(str(error))
        else:
            assert np.isfinite(recording.samples).all()
    assert len(messages) > 10
    assert all(message.startswith(str(path)) for message in messages)
    assert not any("\n" in message or len(message) > 700 for message in messages)


def test_nothing_at_all_behind_the_first_bytes(tmp_path):
    path = tmp_path / "recording.bin"
    stored = io.BytesIO()
    np.save(stored, X)
    for length in range(1, 130):
        path.write_bytes(stored.getvalue()[:length])
        with pytest.raises(RecordingError):
            read_recording(path, 5000.0)
