"""The file of a healthy reference: a NumPy archive with a JSON header inside."""

from __future__ import annotations

import io
import json
import struct
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import SignatureError
from gearmon.files import write_atomically
from gearmon.signatures.nongear_lines import NonGearLines, line_arrays, lines_from_arrays
from gearmon.signatures.reference import Profile, Reference, WheelPattern

FORMAT = "gearmon reference 3"
# Without lines of no gear, without broadband levels; still read.
_OLDER_FORMATS = ("gearmon reference 1", "gearmon reference 2")
# What reading a damaged archive may end in.
_DAMAGE = (OSError, ValueError, LookupError, TypeError, EOFError, RuntimeError)
_DAMAGED_ARCHIVE = (zipfile.BadZipFile, zlib.error, struct.error)
_WHEEL_ARRAYS = ("number", "mesh", "amplitude", "variance")


def write_reference(reference: Reference, path: str | Path) -> None:
    """Store a reference in one file (a NumPy archive with a JSON header inside).

    Parameters
    ----------
    reference : Reference
        The reference.
    path : str or Path
        The file; any name.

    Raises
    ------
    ArgumentError
        If the file cannot be written.
    """
    header: dict[str, Any] = {
        "format": FORMAT,
        "machine": reference.machine,
        "teeth": reference.teeth,
        "channel_names": list(reference.channel_names),
        "units": list(reference.units),
        "family_names": list(reference.family_names),
        "profiles": [],
    }
    arrays: dict[str, NDArray[Any]] = {}
    for row, profile in enumerate(reference.profiles):
        header["profiles"].append(_profile_header(profile))
        arrays[f"{row}/level_db"] = profile.level_db
        arrays[f"{row}/band_db"] = profile.band_db
        arrays[f"{row}/scatter_db"] = profile.scatter_db
        arrays[f"{row}/heard"] = profile.heard
        for column, wheel in enumerate(profile.wheels):
            for name in _WHEEL_ARRAYS:
                arrays[f"{row}/{column}/{name}"] = getattr(wheel, name)
        if profile.foreign is not None:
            stored = line_arrays(profile.foreign)
            arrays |= {f"{row}/foreign/{name}": values for name, values in stored.items()}
    arrays["header"] = np.frombuffer(json.dumps(header).encode("utf-8"), dtype=np.uint8)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    write_atomically(path, buffer.getvalue())


def _profile_header(profile: Profile) -> dict[str, Any]:
    return {
        "origin": profile.origin,
        "speed_hz": profile.speed_hz,
        "duration_s": profile.duration_s,
        "tacho": profile.tacho,
        "family_names": list(profile.family_names),
        "wheels": [
            {"stage": w.stage, "gear": w.gear, "teeth": w.teeth, "order": w.order}
            for w in profile.wheels
        ],
    }


def is_reference(path: str | Path) -> bool:
    """Tell whether a file is a stored reference (and not, say, a recording)."""
    try:
        return zipfile.is_zipfile(path)
    except OSError:
        return False


def read_reference(path: str | Path) -> Reference:
    """Read a stored reference.

    Parameters
    ----------
    path : str or Path
        A file written by `write_reference`.

    Returns
    -------
    Reference

    Raises
    ------
    SignatureError
        If the file is missing, is no reference, or is damaged.
    """
    try:
        # opened here, so that it is closed even if it turns out to be no archive
        with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as archive:
            header = json.loads(bytes(archive["header"]).decode("utf-8"))
            if header.get("format") not in (FORMAT, *_OLDER_FORMATS):
                raise SignatureError(
                    f"{path}: format {header.get('format')!r} is not {FORMAT!r}; learn it anew"
                )
            profiles = tuple(
                _read_profile(archive, row, entry) for row, entry in enumerate(header["profiles"])
            )
    except SignatureError:
        raise
    except FileNotFoundError:
        raise SignatureError(f"{path}: no such file; make one with gearmon learn") from None
    except _DAMAGE + _DAMAGED_ARCHIVE as error:
        raise SignatureError(
            f"{path}: not a readable gearmon reference ({type(error).__name__}); make one with "
            "gearmon learn"
        ) from None
    return Reference(
        machine=header["machine"],
        teeth=header["teeth"],
        channel_names=tuple(header["channel_names"]),
        units=tuple(header["units"]),
        family_names=tuple(header["family_names"]),
        profiles=profiles,
    )


def _read_profile(archive: Any, row: int, entry: dict[str, Any]) -> Profile:
    wheels = tuple(
        WheelPattern(
            stage=wheel["stage"],
            gear=wheel["gear"],
            teeth=wheel["teeth"],
            order=wheel["order"],
            **{name: archive[f"{row}/{column}/{name}"] for name in _WHEEL_ARRAYS},
        )
        for column, wheel in enumerate(entry["wheels"])
    )
    return Profile(
        origin=entry["origin"],
        speed_hz=entry["speed_hz"],
        duration_s=entry["duration_s"],
        tacho=entry["tacho"],
        family_names=tuple(entry["family_names"]),
        level_db=archive[f"{row}/level_db"],
        band_db=_read_bands(archive, row),
        scatter_db=archive[f"{row}/scatter_db"],
        heard=archive[f"{row}/heard"],
        wheels=wheels,
        foreign=_read_foreign(archive, row),
    )


def _read_bands(archive: Any, row: int) -> NDArray[Any]:
    if f"{row}/band_db" in archive.files:
        bands: NDArray[Any] = archive[f"{row}/band_db"]
        return bands
    return np.zeros((len(archive[f"{row}/level_db"]), 0))


def _read_foreign(archive: Any, row: int) -> NonGearLines | None:
    start = f"{row}/foreign/"
    stored = {
        name.removeprefix(start): archive[name] for name in archive.files if name.startswith(start)
    }
    return lines_from_arrays(stored) if stored else None
