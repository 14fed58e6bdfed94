import json
import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import gearmon.signatures.signature as module
from gearmon.errors import ArgumentError, SignatureError
from gearmon.signatures.signature import (
    COLUMNS,
    Signature,
    _plain,
    _restored,
    read_signature,
    write_signature,
)

NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
SUFFIXES = [".csv", ".json", ".parquet"]


def columns(count=3, **changes):
    base = {name: np.linspace(0.1, 1, count) / 3 for name in COLUMNS}
    base |= {name: np.arange(count) for name in ("stage", "mesh_harmonic", "sideband")}
    base["sideband_of"] = np.array(["", "pinion", "gear"] * count)[:count]
    return base | changes


def signature(count=3, header=None, **changes):
    header = {"error_bound": 1e-7} if header is None else header
    return Signature(
        machine="Getriebe Nr. 7, «groß»",
        origin="expected",
        header=header,
        columns=columns(count, **changes),
    )


def same(one, other):
    assert (one.machine, one.origin) == (other.machine, other.origin)
    assert dict(one.header) == dict(other.header)
    assert list(one.columns) == list(other.columns)
    for name, column in one.columns.items():
        assert column.dtype.kind == other[name].dtype.kind
        assert column.tolist() == other[name].tolist()


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("count", [0, 1, 5])
def test_what_was_written_is_read_back(tmp_path, suffix, count):
    header = {
        "error_bound": math.inf,
        "stable": True,
        "nothing": None,
        "faults": ["crack:1:pinion:5:20%"],
        "stages": [{"mesh_frequency_hz": 632.6666666666666, "warnings": []}],
    }
    written = signature(count, header, scatter_db=np.linspace(0, 1, count))
    write_signature(written, tmp_path / f"s{suffix}")
    same(read_signature(tmp_path / f"s{suffix}"), written)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(NUMBERS, min_size=1, max_size=6), st.sampled_from(SUFFIXES))
def test_any_number_survives(tmp_path, numbers, suffix):
    written = signature(len(numbers), displacement_m=np.array(numbers))
    write_signature(written, tmp_path / f"s{suffix}")
    same(read_signature(tmp_path / f"s{suffix}"), written)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_suffix_in_capitals_means_the_same(tmp_path, suffix):
    path, plain = tmp_path / f"s{suffix.upper()}", tmp_path / f"t{suffix}"
    for own in (path, plain):
        write_signature(signature(), own)
        same(read_signature(own), signature())
    if suffix != ".parquet":
        assert path.read_bytes() == plain.read_bytes()


def test_csv_is_commented_header_and_rows(tmp_path):
    write_signature(signature(2), tmp_path / "s.csv")
    lines = (tmp_path / "s.csv").read_text(encoding="utf-8").splitlines()
    assert "# error_bound: 1e-07" in lines
    assert lines[-3] == ",".join(COLUMNS)
    assert lines[-2].startswith("0,0,0,,0.0333")


def test_json_has_the_header_beside_the_rows(tmp_path):
    write_signature(signature(2), tmp_path / "s.json")
    whole = json.loads((tmp_path / "s.json").read_text(encoding="utf-8"))
    assert whole["error_bound"] == 1e-7
    assert list(whole["rows"][0]) == list(COLUMNS)
    whole.pop("format")
    whole.pop("columns")
    assert whole == signature(2).to_dict()


def test_built_in_types_only():
    told = signature(2, {"a": np.float64(math.inf), "b": np.arange(2), "c": {"d": np.True_}})
    text = json.dumps(told.to_dict(), allow_nan=False)
    assert json.loads(text)["a"] == "inf"
    assert json.loads(text)["b"] == [0, 1]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"order": np.array([1.0])}, "column order has 1 values, stage has 3"),
        ({"phase_rad": np.array([0.0, math.nan, 1.0])}, "phase_rad of line 2 is not a finite"),
        ({"stage": np.array([1.0, 1.5, 2.0])}, "stage must hold whole numbers"),
        ({"order": np.array(["a", "b", "c"])}, "could not convert|numbers"),
        ({"order": np.zeros((3, 2))}, "has shape"),
    ],
)
def test_bad_columns_are_refused(changes, words):
    with pytest.raises(ValueError, match=words):
        signature(3, **changes)


def test_missing_columns_and_reserved_keys_are_refused():
    whole = columns()
    del whole["velocity_ms"]
    with pytest.raises(ArgumentError, match="column velocity_ms is missing"):
        Signature(machine="", origin="expected", header={}, columns=whole)
    with pytest.raises(ArgumentError, match="header key rows is reserved"):
        signature(3, {"rows": 1})


def test_columns_cannot_be_changed():
    one = signature()
    with pytest.raises(ValueError, match="read-only"):
        one["order"][0] = 1
    with pytest.raises(TypeError, match="does not support item assignment"):
        one.columns["order"] = np.zeros(3)


def damaged(tmp_path, name, change):
    path = tmp_path / name
    write_signature(signature(3), path)
    path.write_text(change(path.read_text(encoding="utf-8")), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("s.csv", lambda t: t[: t.rindex(",")], r"s\.csv: .*phase_rad of line 3 is not a finite"),
        ("s.csv", lambda t: t.replace("0.3333", "x.3333"), r"\w+ of line 3 is not a finite"),
        ("s.csv", lambda t: t.replace("\n1,", "\n1,1,"), "Expected 10 fields in line 7, saw 11"),
        ("s.csv", lambda t: t.replace("velocity_ms", "speed"), "column velocity_ms is missing"),
        (
            "s.csv",
            lambda t: t.replace("# machine: ", "# machine "),
            "damaged one .Expecting value",
        ),
        ("s.csv", lambda _: "", "not a signature"),
        ("s.csv", lambda t: t.replace("signature 1", "signature 9"), "says 'gearmon signature 9'"),
        ("s.json", lambda t: t[:-30], r"damaged one \(.*line \d+"),
        ("s.json", lambda _: "[1, 2]", "not a signature"),
        ("s.json", lambda _: 200_000 * "[", "damaged one .*recursion"),
        ("s.json", lambda t: t.replace('"stage": 1', '"stag": 1'), "damaged one .'stage'"),
        ("s.json", lambda t: t.replace('"rows": [', '"rows": [5,'), "damaged one"),
        ("s.parquet", lambda _: "PAR1", "not a signature, or a damaged one"),
    ],
)
def test_damaged_files_are_refused_in_one_line(tmp_path, name, change, words):
    if name.endswith("parquet"):
        path = tmp_path / name
        path.write_text(change(""))
    else:
        path = damaged(tmp_path, name, change)
    with pytest.raises(SignatureError, match=words) as caught:
        read_signature(path)
    assert "\n" not in str(caught.value)
    assert str(caught.value).count("not a signature") <= 1
    assert str(path) in str(caught.value)


def test_other_files_are_refused(tmp_path):
    with pytest.raises(SignatureError, match="No such file"):
        read_signature(tmp_path / "none.csv")
    with pytest.raises(ArgumentError, match=r"suffix=.* is not one of .*did you mean \.json"):
        write_signature(signature(), tmp_path / "s.jsn")
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00binary")
    with pytest.raises(SignatureError, match="damaged one"):
        read_signature(tmp_path / "b.csv")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_table_of_something_else_is_told_by_what_is_missing(tmp_path, suffix):
    path, table = tmp_path / f"other{suffix}", {"a": [1.0, 2.0]}
    if suffix == ".parquet":
        parquet = pytest.importorskip("pyarrow.parquet")
        parquet.write_table(pytest.importorskip("pyarrow").table(table), path)
    else:
        path.write_text("a\n1\n2\n" if suffix == ".csv" else json.dumps(table), encoding="utf-8")
    with pytest.raises(SignatureError, match=r"it must say format .*, and says None\)$"):
        read_signature(path)


def test_parquet_without_its_library_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    with pytest.raises(ArgumentError, match=r"pip install 'gearmon\[parquet\]'"):
        write_signature(signature(), tmp_path / "s.parquet")
    assert not (tmp_path / "s.parquet").exists()


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "s.json"
    write_signature(signature(1), path)
    before = path.read_bytes()

    def fail(*_, **__):
        raise ArgumentError("disk full")

    monkeypatch.setattr(module.json, "dumps", fail)
    with pytest.raises(ArgumentError, match="disk full"):
        write_signature(signature(3), path)
    assert path.read_bytes() == before


def test_numbers_that_json_lacks_come_back():
    told = {"a": [math.inf, {"b": -math.inf}], "c": 1.5, "d": "told"}
    assert _restored(_plain(told)) == told
    assert math.isnan(_restored(_plain({"e": math.nan}))["e"])
