"""Machines, recordings and other files that the arguments name."""

from __future__ import annotations

import glob
import shutil
import sys
import tempfile
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import gearmon
from gearmon.commands.command import complain, given
from gearmon.errors import ArgumentError, GearmonError, check_positive
from gearmon.files import check_output, protecting
from gearmon.signals.threads import THREADS, alone_on_a_core, cores
from gearmon.terminal import Progress, followed

# A process takes as long to start as one file of ten seconds takes to analyse.
_FILES_A_PROCESS = 2
#: What names standard input in the place of a file.
STANDARD_INPUT = "-"
# What a recording of a folder may end in.
_RECORDED = (
    *(".csv", ".tsv", ".txt", ".gz", ".wav", ".flac", ".mat", ".h5", ".hdf5"),
    *(".tdms", ".uff", ".unv", ".parquet", ".npy", ".npz"),
)
# Pictures beside a report.
_PICTURES = ("{}-[0-9][0-9]-*.png",)
# Arguments that name files that are read, and files that are gone on with: whoever reads these
# knows whether they are what they should be.
_READ = ("machine", "reference", "harvester", "past", "day", "floor")
_KEPT = ("history", "store", "trained")


def check_names(arguments: Namespace) -> None:
    """Refuse names of files that cannot work, before any work is done.

    Parameters
    ----------
    arguments : Namespace
        Parsed arguments; `asked` is the command, which knows the endings of its output.

    Raises
    ------
    ArgumentError
        If a name is empty, missing, has the wrong ending, or stands for two files.
    """
    given = vars(arguments)
    for name in ("output", "report", "tacho", *_READ, *_KEPT):
        if given.get(name) == "":
            raise ArgumentError(f"--{name}: the name is empty")
    if given.get("report") and Path(given["report"]).suffix.lower() not in (".html", ".htm"):
        raise ArgumentError(f"{given['report']}: the name of a report must end in .html")
    told, endings = arguments.asked.output, arguments.asked.endings
    if told.endswith("; needed") and not given.get("output"):
        lacking = f"{arguments.command}: -o PATH is missing"
        raise ArgumentError(f"{lacking}; {told.removesuffix('; needed')}")
    if given.get("output") and endings and Path(given["output"]).suffix.lower() not in endings:
        listed = ", ".join(endings)
        raise ArgumentError(f"{given['output']}: the name must end in one of {listed}")


@contextmanager
def outputs_claimed(arguments: Namespace) -> Iterator[None]:
    """Check all files that a command will write, before it does any work, and guard the others.

    Raises
    ------
    ArgumentError
        If one cannot be written, is read as well, or was not written by this command; see
        `gearmon.files.check_output`.
    """
    given = vars(arguments)
    read = [*given.get("recording", ()), *given.get("degraded", ())]
    read += [path for name in _READ if (path := given.get(name))]
    kept = [path for name in _KEPT if (path := given.get(name))]
    written = [*map(Path, kept), *output_files(arguments)]
    with protecting(arguments.command, read, kept):
        checked = [check_output(path) for path in written]
        for number, path in enumerate(checked):
            if path in checked[:number]:
                raise ArgumentError(f"{written[number]}: would be written twice; give two names")
        yield


def output_files(arguments: Namespace) -> list[Path]:
    """Return the files that a command will write, and those there are already beside them.

    Parameters
    ----------
    arguments : Namespace
        Parsed arguments.
    """
    found: list[Path] = []
    named = ((arguments.output, arguments.asked.beside), (vars(arguments).get("report"), _PICTURES))
    for path, beside in [(Path(name), beside) for name, beside in named if name]:
        stem = glob.escape(path.stem)
        found += [path, *(p for name in beside for p in path.parent.glob(name.format(stem)))]
    return [] if arguments.asked.folder else found


def machine_of(path: str, speed_hint_rpm: float | None = None) -> gearmon.Machine:
    """Read a machine file; a speed that is known better takes the place of its nominal ones."""
    machine = gearmon.load_machine(path)
    if speed_hint_rpm is None:
        return machine
    check_positive("--speed-hint", speed_hint_rpm, "rpm")
    nearest = min(machine.operating, key=lambda own: abs(own.speed_rpm - speed_hint_rpm))
    return replace(machine, operating=(replace(nearest, speed_rpm=speed_hint_rpm, share=1.0),))


def recordings_named(given: Sequence[str]) -> list[str]:
    """Return the files that recordings are named by; a folder stands for those in it.

    One without any stays, to be reported in its place.

    Raises
    ------
    ArgumentError
        If standard input is named twice.
    """
    named: list[str] = []
    for name in given:
        files = sorted(Path(name).iterdir()) if Path(name).is_dir() else []
        named += [str(own) for own in files if own.suffix.lower() in _RECORDED] or [name]
    if named.count(STANDARD_INPUT) > 1:
        raise ArgumentError("standard input (-) is named twice; it can be read but once")
    return named


def recording_of(path: str, arguments: Namespace) -> gearmon.Recording:
    """Read a recording as the options of the command, and the sensors of the machine, say."""
    if path == STANDARD_INPUT:
        with tempfile.NamedTemporaryFile(suffix=".csv") as file:
            # readers go back and forth
            shutil.copyfileobj(sys.stdin.buffer, file)
            file.flush()
            return replace(recording_of(file.name, arguments), origin="standard input")
    if Path(path).is_dir():
        raise ArgumentError(f"{path}: a folder without recordings ({', '.join(_RECORDED)})")
    sensors = arguments.machine.sensors if arguments.machine else ()
    options = given(arguments, "sampling_rate_hz", "tacho")
    return gearmon.read_recording(
        path, channels=arguments.channel or None, sensors=sensors, **options
    )


def each_of(
    paths: Sequence[str],
    progress: Progress | None,
    work: Callable[[str], Any],
    *,
    side_by_side: bool = False,
) -> list[Any]:
    """Work on recordings; a bad one is reported in its place, the others go on.

    Parameters
    ----------
    paths : sequence of str
    progress : callable or None
        Called with the share done.
    work : callable
        Takes a path. Side by side, it and its results go from process to process.
    side_by_side : bool
        Whether on all cores, where there are paths enough.

    Returns
    -------
    list
        What `work` returned, or of a bad one "recording" and "error".

    Raises
    ------
    GearmonError
        If a process was killed, by lack of memory most likely.
    """
    task, results, bad = partial(_tried, work), [], 0
    workers = min(cores(), len(paths) // _FILES_A_PROCESS) if side_by_side else 1
    with _mapped(workers) as mapped:
        for found in followed(mapped(task, paths), len(paths), progress):
            results.append(found)
            if isinstance(found, dict) and "error" in found:
                bad += 1
                complain(found["error"])
    if bad > 2:
        complain(f"{bad} of {len(paths)} recordings could not be used; the lines above say why")
    return results


def _tried(work: Callable[[str], Any], path: str) -> Any:
    try:
        return work(path)
    except GearmonError as error:
        return {"recording": path, "error": str(error)}


@contextmanager
def _mapped(workers: int) -> Iterator[Callable[..., Iterator[Any]]]:
    """Give what maps a function over paths, on so many cores; results in their order."""
    if workers < 2:
        yield map
        return
    from concurrent.futures import ProcessPoolExecutor  # a single file does without
    from concurrent.futures.process import BrokenProcessPool

    pool = ProcessPoolExecutor(workers, initializer=alone_on_a_core)
    try:
        yield pool.map
    except BrokenProcessPool as error:
        raise GearmonError(
            "a process was killed, by lack of memory most likely; give fewer files at a time, or "
            f"set {THREADS}=1"
        ) from error
    finally:
        pool.shutdown(cancel_futures=True)
