"""Writing files: all or nothing, and nothing left behind."""

from __future__ import annotations

import os
import stat

import numpy as np
import pytest

from gearmon.errors import ArgumentError, SignatureError
from gearmon.files import reading_archive, replacing, write_archive, write_atomically


def fail_half_way(path):
    with replacing(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError("out of power")


@pytest.mark.parametrize(
    ("content", "stored"),
    [("Zähne\n", "Zähne\n".encode()), (b"\x00\xff\r\n", b"\x00\xff\r\n"), ("", b"")],
)
def test_content_arrives_byte_for_byte(tmp_path, content, stored):
    write_atomically(tmp_path / "a.csv", content)
    assert (tmp_path / "a.csv").read_bytes() == stored


def test_path_may_be_text(tmp_path):
    write_atomically(str(tmp_path / "a.csv"), "new")
    assert (tmp_path / "a.csv").read_text() == "new"


def test_old_file_is_replaced(tmp_path):
    target = tmp_path / "a.csv"
    target.write_text("something much longer than the new content")
    write_atomically(target, "new")
    assert target.read_text() == "new"


def test_failure_keeps_the_old_file_and_leaves_nothing(tmp_path):
    target = tmp_path / "a.csv"
    target.write_text("old")
    with pytest.raises(RuntimeError, match="out of power"):
        fail_half_way(target)
    assert target.read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]


def test_failure_makes_no_file(tmp_path):
    with pytest.raises(RuntimeError, match="out of power"):
        fail_half_way(tmp_path / "a.csv")
    assert list(tmp_path.iterdir()) == []


def test_success_leaves_only_the_target(tmp_path):
    write_atomically(tmp_path / "a.csv", "new")
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]


def test_target_keeps_its_old_content_until_the_end(tmp_path):
    target = tmp_path / "a.csv"
    target.write_text("old")
    with replacing(target) as temporary:
        temporary.write_text("new")
        assert target.read_text() == "old"
    assert target.read_text() == "new"


def test_temporary_file_is_beside_the_target_with_its_suffix(tmp_path):
    # writers such as those of pictures choose the format by the suffix
    with replacing(tmp_path / "a.parquet") as temporary:
        assert temporary.parent == tmp_path
        assert temporary.suffix == ".parquet"


def test_temporary_file_removed_by_the_writer_is_an_error_only_once(tmp_path):
    with pytest.raises(FileNotFoundError), replacing(tmp_path / "a.csv") as temporary:
        temporary.unlink()


def test_folder_is_refused(tmp_path):
    with pytest.raises(ArgumentError, match="is a folder"):
        write_atomically(tmp_path, "new")


def test_missing_folder_is_refused_by_name(tmp_path):
    target = tmp_path / "nowhere" / "a.csv"
    with pytest.raises(ArgumentError, match=r"nowhere/a\.csv: cannot write there \(No such file"):
        write_atomically(target, "new")


def test_parent_that_is_a_file_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ArgumentError, match="cannot write there"):
        write_atomically(tmp_path / "file" / "a.csv", "new")


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
@pytest.mark.parametrize(("umask", "mode"), [(0o022, 0o644), (0o027, 0o640), (0o077, 0o600)])
def test_permissions_follow_the_umask(tmp_path, umask, mode):
    before = os.umask(umask)
    try:
        write_atomically(tmp_path / "a.csv", "new")
        assert os.umask(umask) == umask  # and the umask is as it was
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a.csv").stat().st_mode) == mode


@pytest.mark.skipif(os.name != "posix", reason="links of POSIX")
def test_link_stays_a_link(tmp_path):
    (tmp_path / "real.csv").write_text("old")
    (tmp_path / "link.csv").symlink_to(tmp_path / "real.csv")
    write_atomically(tmp_path / "link.csv", "new")
    assert (tmp_path / "link.csv").is_symlink()
    assert (tmp_path / "real.csv").read_text() == "new"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes of POSIX")
def test_pipe_is_refused_and_not_replaced(tmp_path):
    # the same holds for /dev/stdout and /dev/null: replacing those would harm the whole system
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ArgumentError, match="pipe: is no ordinary file"):
        write_atomically(tmp_path / "pipe", "new")
    assert stat.S_ISFIFO((tmp_path / "pipe").lstat().st_mode)


@pytest.mark.parametrize("name", ["new", "old"])
def test_an_archive_of_any_format_that_is_known_is_read(tmp_path, name):
    path = tmp_path / "kept.npz"
    write_archive(path, {"format": name}, {"a": np.arange(3.0)})
    told = "file", "write it", "write one"
    with reading_archive(path, ("new", "old"), *told) as (header, arrays):
        assert header["format"] == name
        assert arrays["a"].tolist() == [0.0, 1.0, 2.0]
    with (
        pytest.raises(SignatureError, match=f"format '{name}' is not 'next'; write it anew"),
        reading_archive(path, ("next",), *told),
    ):
        raise AssertionError("not refused")


def test_an_archive_that_swells_is_refused_before_its_arrays_are_made(tmp_path, monkeypatch):
    path = tmp_path / "swells.npz"
    write_archive(path, {"format": "new"}, {"a": np.zeros(50_000)})
    monkeypatch.setattr("gearmon.files.most_unpacked", lambda packed: 100 * packed)
    with (
        pytest.raises(SignatureError, match=r"not a readable file \(it unpacks to more than any\)"),
        reading_archive(path, ("new",), "file", "write it", "write one"),
    ):
        raise AssertionError("not refused")
