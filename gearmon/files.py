"""Writing files so that nothing already written is ever lost."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from gearmon.errors import ArgumentError


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give a temporary path beside `path`; on success it takes the place of `path`.

    Parameters
    ----------
    path : str or Path
        The file to be written. Its folder must exist.

    Yields
    ------
    Path
        A temporary file in the same folder, with the same suffix.

    Raises
    ------
    ArgumentError
        If the folder does not exist or cannot be written.
    """
    target = Path(path)
    if target.is_dir():
        raise ArgumentError(f"{target}: is a folder; give the name of a file to write")
    if target.exists() and not target.is_file():
        raise ArgumentError(f"{target}: is no ordinary file; give the name of a file to write")
    target = target.resolve()  # a link stays a link: what it points to is replaced
    try:
        handle, name = tempfile.mkstemp(prefix=".", suffix=target.suffix, dir=target.parent)
        os.close(handle)
    except OSError as error:
        raise ArgumentError(f"{target}: cannot write there ({error.strerror})") from None
    temporary = Path(name)
    try:
        yield temporary
        # mkstemp makes private files; a result is as readable as any file the user writes
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, target)
    finally:
        with suppress(FileNotFoundError):
            temporary.unlink()


def write_atomically(path: str | Path, content: bytes | str) -> None:
    """Write `content` to `path` in one step: readers see the old file or the new one.

    Raises
    ------
    ArgumentError
        If the file cannot be written.
    """
    data = content.encode("utf-8") if isinstance(content, str) else content
    with replacing(path) as temporary:
        temporary.write_bytes(data)


def _umask() -> int:
    current = os.umask(0)
    os.umask(current)
    return current
