"""Files that a library beyond the core reads: FLAC, HDF5, TDMS, UFF 58, Parquet."""

from __future__ import annotations

import logging
import os
import re
import signal
import sys
from decimal import Decimal

import numpy as np
import pytest

from gearmon.errors import RecordingError
from gearmon.signals.reading.formats import _function
from gearmon.signals.recording import read_recording

RNG = np.random.default_rng(6)
X = 0.1 * RNG.normal(size=(3, 400))


def refused(path, *arguments, **named):
    with pytest.raises(RecordingError) as caught:
        read_recording(path, *arguments, **named)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    return message.removeprefix(str(path))


@pytest.mark.parametrize(
    ("head", "module", "extra"),
    [
        (b"fLaC", "soundfile", "flac"),
        (b"\x89HDF\r\n\x1a\n", "h5py", "hdf5"),
        (b"MATLAB 7.3 MAT-file", "h5py", "hdf5"),
        (b"TDSm", "nptdms", "tdms"),
        (b"    -1\n    58\n", "pyuff", "uff"),
        (b"PAR1", "pyarrow.parquet", "parquet"),
    ],
)
def test_a_library_that_is_not_installed(tmp_path, monkeypatch, head, module, extra):
    monkeypatch.setitem(sys.modules, module, None)
    path = tmp_path / "recording.bin"
    path.write_bytes(head + bytes(600))
    assert f"to read it install gearmon[{extra}], or export it as CSV" in refused(path, 5000.0)


@pytest.mark.parametrize(
    ("head", "module"),
    [
        (b"fLaC", "soundfile"),
        (b"\x89HDF\r\n\x1a\n", "h5py"),
        (b"MATLAB 7.3 MAT-file", "h5py"),
        (b"TDSm", "nptdms"),
        (b"    -1\n    58\n", "pyuff"),
        (b"PAR1", "pyarrow.parquet"),
    ],
)
def test_a_damaged_file(tmp_path, head, module):
    pytest.importorskip(module)
    path = tmp_path / "recording.bin"
    path.write_bytes(head + bytes(600))
    assert refused(path, 5000.0)


@pytest.mark.parametrize("bits", [16, 24])
def test_flac(tmp_path, bits):
    soundfile = pytest.importorskip("soundfile")
    path = tmp_path / "a.flac"
    soundfile.write(path, X.T, 48_000, subtype=f"PCM_{bits}")
    expected, rate = soundfile.read(path)
    found = read_recording(path)
    assert np.array_equal(found.samples, expected.T)
    assert found.sampling_rate_hz == rate
    assert f"{bits}-bit integer, full scale is taken as 1" in found.notes[0]
    path.write_bytes(path.read_bytes()[:-300])
    assert refused(path)


class TestHdf5:
    def test_arrays_with_attributes(self, tmp_path):
        h5py = pytest.importorskip("h5py")
        path = tmp_path / "a.h5"
        with h5py.File(path, "w") as file:
            stored = file.create_dataset("run/acc", data=X.T, chunks=True, compression="gzip")
            stored.attrs["units"] = "g"
            stored.attrs["sampling_rate"] = 25_600
            stored.attrs["channel_names"] = ["left", "right", "top"]
            file["run/tacho"] = X[0] > 0
            file["text"] = "a text"
            file.attrs["rpm"] = 1480.0
        found = read_recording(path)
        assert found.channel_names == ("left", "right", "top", "run/tacho")
        assert found.channel_kinds == ("vibration",) * 3 + ("tacho",)
        assert found.units == ("m/s2",) * 3 + (None,)
        assert found.sampling_rate_hz == 25_600.0
        assert any(
            note.startswith("the file states") and note.endswith("= 1480") for note in found.notes
        )
        assert np.array_equal(found.samples[:3], X * 9.80665)
        assert read_recording(path, channels="right").columns == (2, 4)

    def test_the_rate_of_an_array_goes_before_that_of_the_file(self, tmp_path):
        h5py = pytest.importorskip("h5py")
        path = tmp_path / "a.h5"
        with h5py.File(path, "w") as file:
            file.create_dataset("acc", data=X[0]).attrs["sampling_rate"] = 25_600
            file.attrs["sampling_rate"] = 51_200
        assert read_recording(path).sampling_rate_hz == 25_600.0

    def test_matlab_7_3(self, tmp_path):
        h5py = pytest.importorskip("h5py")
        path = tmp_path / "a.mat"
        with h5py.File(path, "w", userblock_size=512) as file:
            file["acc"] = X[:1]  # a column, as MATLAB turns the axes round
            file["Fs"] = np.array([[12_000.0]])
            file["name"] = np.array([[104, 105]], dtype="u2")
            file["name"].attrs["MATLAB_class"] = b"char"
            file["#refs#/a"] = X[1]
        with path.open("r+b") as stream:
            stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64")
        found = read_recording(path)
        assert np.array_equal(found.samples, X[:1])
        assert found.sampling_rate_hz == 12_000.0

    def test_one_of_several_must_be_named(self, tmp_path):
        h5py = pytest.importorskip("h5py")
        path = tmp_path / "a.h5"
        with h5py.File(path, "w") as file:
            file["a"], file["b"] = X[0], X[1]
        said = refused(path, 5000.0)
        assert "holds 2 arrays that may be the recording; name with --channel" in said
        assert np.array_equal(read_recording(path, 5000.0, channels="b").samples, X[1:2])

    def test_damage_that_crashes_the_library_is_refused(self, tmp_path, monkeypatch):
        h5py = pytest.importorskip("h5py")

        def crash(*_):
            os.kill(os.getpid(), signal.SIGSEGV)

        path = tmp_path / "a.h5"
        with h5py.File(path, "w") as file:
            file["acc"] = X
        monkeypatch.setattr(h5py, "File", crash)
        assert "it unpacks to more than any, or crashes its reader" in refused(path, 5000.0)


class TestTdms:
    def written(self, path, channels, **properties):
        nptdms = pytest.importorskip("nptdms")
        objects = [nptdms.RootObject(properties)]
        for group, name, samples, own in channels:
            objects.append(nptdms.ChannelObject(group, name, samples, own))
        with nptdms.TdmsWriter(path) as writer:
            writer.write_segment(objects)
        return path

    def test_channels_with_unit_and_spacing(self, tmp_path):
        wave = {"wf_increment": 1 / 25_600, "wf_start_offset": 0.0, "unit_string": "g"}
        channels = [("g", "a1", X[0], wave), ("g", "a2", X[1].astype("f4"), wave)]
        path = self.written(tmp_path / "a.tdms", channels, rpm=1480.0)
        found = read_recording(path)
        assert found.channel_names == ("a1", "a2")
        assert found.units == ("m/s2", "m/s2")
        assert found.sampling_rate_hz == 25_600.0
        assert any(
            note.startswith("the file states") and note.endswith("= 1480") for note in found.notes
        )
        expected = np.stack([X[0], X[1].astype("f4")]) * 9.80665
        assert np.array_equal(found.samples, expected)

    def test_different_rates_do_not_mix(self, tmp_path):
        channels = [("fast", "a", X[0], {"wf_increment": 1e-4}), ("slow", "a", X[1], {})]
        channels.append(("slow", "t", X[1], {"wf_increment": 1e-3}))
        path = self.written(tmp_path / "a.tdms", channels)
        assert "have different sampling rates; name with --channel" in refused(path)
        assert read_recording(path, channels="fast/a").sampling_rate_hz == 1e4
        assert "does not say its sampling rate" in refused(path, channels="slow/a")

    def test_different_starts_do_not_mix(self, tmp_path):
        begin = {"wf_increment": 1e-3, "wf_start_offset": 0.0}
        later = {"wf_increment": 1e-3, "wf_start_offset": 0.01}
        path = self.written(tmp_path / "a.tdms", [("g", "a", X[0], begin), ("g", "b", X[1], later)])
        assert "'a' and 'b' do not start at the same time" in refused(path)

    def test_an_offset_counts_from_the_start_of_its_wave(self, tmp_path):
        begin = np.datetime64("2024-03-12T10:11:12", "us")
        early = {"wf_increment": 1e-3, "wf_start_time": begin, "wf_start_offset": 0.01}
        late = early | {"wf_start_time": begin + 10_000, "wf_start_offset": 0.0}
        path = self.written(tmp_path / "a.tdms", [("g", "a", X[0], early), ("g", "b", X[1], late)])
        assert read_recording(path).channel_names == ("a", "b")

    def test_a_file_cut_off(self, tmp_path):
        path = self.written(tmp_path / "a.tdms", [("g", "a", X[0], {"wf_increment": 1e-3})])
        path.write_bytes(path.read_bytes()[:-100])
        assert "is cut off" in refused(path)

    @pytest.mark.parametrize(
        ("place", "value", "said"),
        [
            (180, 87, "its last part is incomplete"),  # how many samples the second channel has
            (21, 2, "its last part is incomplete"),  # where they begin
            (73, 255, "its channels take 3200 bytes, and it holds 6400"),  # the name of the first
        ],
    )
    def test_damage_that_moves_samples(self, tmp_path, place, value, said):
        nptdms = pytest.importorskip("nptdms")
        path, wave = tmp_path / "a.tdms", {"wf_increment": 2e-4, "unit_string": "m/s2"}
        with nptdms.TdmsWriter(path) as writer:
            channels = [nptdms.ChannelObject("g", f"a{k}", X[k], wave) for k in (1, 2)]
            writer.write_segment(channels)
        bad = bytearray(path.read_bytes())
        bad[place] = value
        path.write_bytes(bad)
        assert said in refused(path)

    def test_a_channel_without_samples_is_left_out_with_a_word(self, tmp_path):
        nptdms = pytest.importorskip("nptdms")
        path, wave = tmp_path / "a.tdms", {"wf_increment": 2e-4, "unit_string": "m/s2"}
        with nptdms.TdmsWriter(path) as writer:
            channels = [nptdms.ChannelObject("g", "a", X[0], wave)]
            writer.write_segment([*channels, nptdms.ChannelObject("g", "b\n", X[1][:0], wave)])
        assert "b? holds no numbers: left out" in read_recording(path).notes


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"abscissa_spacing": 0}, "function 3 is not evenly spaced, or by 0.1 s"),
        ({"abscissa_inc": 0.0}, "function 3 is not evenly spaced, or by 0 s"),
        ({"num_pts": 5}, "function 3: 4 samples where 5 are announced"),
    ],
)
def test_a_function_whose_samples_are_uneven_or_too_few_is_refused(wrong, said):
    known = {"data": np.zeros(4), "abscissa_inc": 0.1, "num_pts": 4, "abscissa_spacing": 1}
    with pytest.raises(ValueError, match=re.escape(said)):
        _function(3, known | wrong, [])


class TestUniversalFile:
    USUAL = {  # noqa: RUF012
        "type": 58, "func_type": 1, "rsp_node": 12, "rsp_dir": 3, "ref_dir": 0, "ref_node": 0,
        "id1": "acc", "rsp_ent_name": "NONE", "abscissa_spacing": 1, "abscissa_inc": 1e-3,
        "abscissa_min": 0, "ord_data_type": 4, "abscissa_spec_data_type": 17,
        "ordinate_spec_data_type": 12, "ordinate_axis_units_lab": "m/s^2",
        "abscissa_axis_units_lab": "s", "orddenom_spec_data_type": 0, "z_axis_spec_data_type": 0,
    }  # fmt: skip

    @pytest.fixture
    def written(self, tmp_path):
        pyuff = pytest.importorskip("pyuff")

        @pytest.mark.filterwarnings("ignore::ResourceWarning")
        def write(*sets):
            path = tmp_path / "a.uff"
            for number, own in enumerate(sets):
                times = np.arange(400) / 1000.0
                one = self.USUAL | {"binary": 0, "data": X[number], "x": times} | own
                pyuff.UFF(str(path)).write_sets(one, "add")
            return path

        return write

    @pytest.mark.parametrize("binary", [0, 1])
    @pytest.mark.filterwarnings("ignore")  # the library leaves the file it writes open
    def test_functions_of_time(self, written, binary):
        path = written({"binary": binary}, {"binary": binary, "rsp_node": 13})
        found = read_recording(path)
        assert found.channel_names == ("12 +Z", "13 +Z")
        assert found.units == ("m/s2", "m/s2")
        assert found.sampling_rate_hz == 1000.0
        assert np.allclose(found.samples, X[:2], rtol=0 if binary else 1e-11, atol=0)

    @pytest.mark.filterwarnings("ignore")
    def test_a_response_to_force_is_no_recording(self, written):
        path = written({"func_type": 4})
        assert "without a signal in it (it holds a function of type 4)" in refused(path)

    @pytest.mark.filterwarnings("ignore")
    def test_a_file_cut_off(self, written):
        path = written({})
        lines = path.read_text().splitlines(keepends=True)
        path.write_text("".join([*lines[:60], *lines[61:]]))
        assert "function 1: 396 samples where 400 are announced" in refused(path)

    @pytest.mark.parametrize("put_in", [b"nan", b"\0\0\0", b"x\n"])
    @pytest.mark.filterwarnings("ignore")
    def test_a_data_set_whose_type_is_damaged_is_not_passed_over(self, written, put_in):
        path = written({}, {"rsp_node": 13})
        before, mark, after = path.read_bytes().rpartition(b"    58")
        path.write_bytes(before + put_in + mark + after)
        assert "a data set has no type at its beginning, or no end" in refused(path)


class TestParquet:
    def test_columns_with_their_units(self, tmp_path):
        pyarrow = pytest.importorskip("pyarrow")
        parquet = pytest.importorskip("pyarrow.parquet")
        path = tmp_path / "a.parquet"
        fields = [
            pyarrow.field("a1", pyarrow.float64(), metadata={"unit": "g"}),
            pyarrow.field("a2 [m/s2]", pyarrow.float32()),
            pyarrow.field("text", pyarrow.string()),
        ]
        schema = pyarrow.schema(fields, metadata={"sampling_rate": "25600", "rpm": "1480"})
        columns = [X[0], X[1].astype("f4"), ["a"] * 400]
        parquet.write_table(pyarrow.table(columns, schema=schema), path, row_group_size=150)
        found = read_recording(path)
        assert found.sampling_rate_hz == 25_600.0
        assert any(
            note.startswith("the file states") and note.endswith("= 1480") for note in found.notes
        )
        assert found.units == ("m/s2", "m/s2")
        assert np.array_equal(found.samples, [X[0] * 9.80665, X[1].astype("f4")])
        assert "text (string) holds no numbers: left out" in found.notes

    def test_numbers_of_every_type_are_channels(self, tmp_path):
        pyarrow = pytest.importorskip("pyarrow")
        parquet = pytest.importorskip("pyarrow.parquet")
        path, counts = tmp_path / "a.parquet", np.rint(100 * X[0]).astype(int)
        types = "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64"
        kinds = [getattr(pyarrow, name)() for name in (*types, "float16", "float32", "float64")]
        kinds += [pyarrow.decimal128(9, 3), pyarrow.decimal256(50, 2)]
        whole = np.abs(counts)
        table = {
            str(kind): [Decimal(int(n)) for n in whole]
            if pyarrow.types.is_decimal(kind)
            else whole.astype(kind.to_pandas_dtype())
            for kind in kinds
        }
        schema = pyarrow.schema([(str(kind), kind) for kind in kinds])
        parquet.write_table(pyarrow.table(table, schema=schema), path)
        found = read_recording(path, 5000.0)
        assert len(found.samples) == len(kinds)
        np.testing.assert_array_equal(found.samples, np.tile(whole, (len(kinds), 1)))

    def test_time_stamps(self, tmp_path):
        pytest.importorskip("pyarrow")
        pandas = pytest.importorskip("pandas")
        path = tmp_path / "a.parquet"
        stamps = pandas.date_range("2024-05-01", periods=400, freq="20us", name="stamp")
        pandas.DataFrame({"a1": X[0]}, index=stamps).to_parquet(path)
        assert read_recording(path).sampling_rate_hz == pytest.approx(50_000.0, rel=1e-9)

    def test_row_labels_are_no_channel(self, tmp_path):
        pytest.importorskip("pyarrow")
        pandas = pytest.importorskip("pandas")
        path = tmp_path / "a.parquet"
        pandas.DataFrame({"a1": X[0]}, index=np.arange(400) ** 2).to_parquet(path)
        assert read_recording(path, 5000.0).channel_names == ("a1",)

    def test_a_missing_value(self, tmp_path):
        pyarrow = pytest.importorskip("pyarrow")
        parquet = pytest.importorskip("pyarrow.parquet")
        path = tmp_path / "a.parquet"
        values = X[0].tolist()
        values[7] = None
        parquet.write_table(pyarrow.table({"a1": values}), path)
        assert ", sample 8, column 1 ('a1'): a value is no number" in refused(path, 5000.0)

    def test_bytes_put_into_its_pages(self, tmp_path):
        pyarrow = pytest.importorskip("pyarrow")
        parquet = pytest.importorskip("pyarrow.parquet")
        path = tmp_path / "a.parquet"
        parquet.write_table(pyarrow.table({"a1": X[0]}), path)
        whole = path.read_bytes()
        place = parquet.ParquetFile(path).metadata.row_group(0).column(0).data_page_offset + 200
        path.write_bytes(whole[:place] + bytes(9) + whole[place:])
        assert "the pages of its table end at byte" in refused(path, 5000.0)


@pytest.mark.parametrize("lost_bytes", [0, 300])
def test_remarks_of_a_library_on_damage_stay_inside(tmp_path, capfd, lost_bytes):
    nptdms = pytest.importorskip("nptdms")
    path = tmp_path / "a.tdms"
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.ChannelObject("g", "a", X[0], {"wf_increment": 1e-3})])
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) - lost_bytes])
    reader = logging.getLogger("nptdms.reader")
    before = reader.level
    reader.setLevel(logging.INFO)
    try:
        if lost_bytes:
            refused(path)
        else:
            read_recording(path)
        # it says again what its user has asked for
        assert reader.level == logging.INFO
    finally:
        reader.setLevel(before)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("block", [1, 150, 399, 400, 1000])
def test_samples_are_the_same_in_blocks_of_any_length(tmp_path, monkeypatch, block):
    """Of long files some are read at a time, from where the last ones ended."""
    names = ("soundfile", "h5py", "pyarrow", "pyarrow.parquet", "nptdms")
    soundfile, h5py, pyarrow, parquet, nptdms = map(pytest.importorskip, names)
    monkeypatch.setattr("gearmon.signals.reading.arrays._BLOCK", block)
    known = np.rint(2**15 * X).clip(-(2**15), 2**15 - 1) / 2**15
    soundfile.write(tmp_path / "a.flac", known.T, 8000, subtype="PCM_16")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("acc", data=known.T, chunks=(64, 2))
    columns = {f"a{number}": row for number, row in enumerate(known)}
    parquet.write_table(pyarrow.table(columns), tmp_path / "a.parquet", row_group_size=70)
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
        channels = [nptdms.ChannelObject("g", name, row, {}) for name, row in columns.items()]
        writer.write_segment(channels)
    for path in sorted(tmp_path.iterdir()):
        np.testing.assert_array_equal(read_recording(path, 8000.0).samples, known, path.name)
