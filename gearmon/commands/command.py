"""What a command is: its arguments, the files that they name, its results, and how it ends."""

from __future__ import annotations

import argparse
import glob
import os
import re
import shutil
import sys
import tempfile
import textwrap
from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gearmon
from gearmon import report
from gearmon.errors import ArgumentError, GearmonError, check_positive
from gearmon.files import as_json, check_output, protecting, write_table
from gearmon.report.wording import template
from gearmon.terminal import Progress, coloured, followed, line_cleared, progress_line
from gearmon.threads import THREADS, alone_on_a_core, cores

if TYPE_CHECKING:
    from gearmon.result import Result


_WIDTH = 78
# What names of files and channels may do to a terminal.
_CONTROL = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f]")
_FAULT = "such as crack:1:pinion:5:20%%, a loss of the tooth pair's stiffness, or 1.5mm"
_ERRORS = (
    "also errors, such as eccentricity:1:pinion:all:20um, pitch:1:gear:7:8um or "
    "cumulative:1:gear:all:15um"
)


Run = Callable[[Namespace], int]
#: Names and settings of an argument, as a parser takes them.
Argument = tuple[tuple[str, ...], dict[str, Any]]


@dataclass(frozen=True, kw_only=True)
class Command:
    """A sub-command of the command line.

    Parameters
    ----------
    name : str
        As typed.
    help : str
        What it does, in one line without a full stop.
    example : str
        A command line that works, given the files that it names.
    arguments : tuple of Argument
        What it takes, beside what all take.
    run : callable
        Runs it with the parsed arguments; returns the exit code.
    endings : tuple of str
        Endings that the name of the output may have; empty: any.
    output : str
        What is written under that name; "...; needed" where it has to be given.
    beside : tuple of str
        What is written beside the output: patterns of names, in which {} stands for its name
        without the ending.
    folder : bool
        Whether the output is a folder.
    more : str
        What else a newcomer has to know, after the options.
    waits : bool
        Whether it waits for people or files, so that nothing tells how long it takes.
    """

    name: str
    help: str
    example: str
    arguments: tuple[Argument, ...]
    run: Run
    endings: tuple[str, ...] = (".csv", ".json")
    output: str = "write the result to this file"
    beside: tuple[str, ...] = ()
    folder: bool = False
    more: str = ""
    waits: bool = False

    def add_to(self, parsers: Any) -> None:
        """Add the parser of this command to the sub-parsers of the command line."""
        # the example, broken so that it can be pasted into a shell
        lines = ["example:"]
        for part in self.example.replace(" -", "\n-").splitlines():
            # an option stays with its value
            if len(lines[-1]) + len(part) > _WIDTH - 4:
                lines.append("   ")
            lines[-1] += f" {part}"
        told = [textwrap.fill(self.more, _WIDTH)] if self.more else []
        parser: argparse.ArgumentParser = parsers.add_parser(
            self.name,
            help=self.help,
            description=textwrap.fill(self.help[0].upper() + self.help[1:] + ".", _WIDTH),
            epilog="\n\n".join([*told, " \\\n".join(lines)]),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        parser.set_defaults(asked=self)
        option = parser.add_argument
        option("--json", action="store_true", help="print one JSON object")
        endings = f" ({', '.join(self.endings)})" if self.endings else ""
        option("-o", "--output", metavar="PATH", help=self.output + endings)
        option("--debug", action="store_true", help="show where an error of gearmon's own happened")
        for names, settings in self.arguments:
            option(*names, **settings)


def command(*arguments: Argument, **said: Any) -> Callable[[Run], Command]:
    """Make the function below a command of its name.

    Parameters
    ----------
    *arguments : Argument
        What it takes.
    **said
        The other fields of `Command`.
    """

    def made(run: Run) -> Command:
        return Command(name=run.__name__, run=run, arguments=arguments, **said)

    return made


def channel_of(text: str) -> str | int:
    """Return the name of a channel, or its column if the text is a number."""
    return int(text) if text.isdecimal() else text


def loss_of(text: str) -> float:
    """Return the loss of pair stiffness in a text such as "20%", as a fraction.

    Raises
    ------
    ArgumentTypeError
        If it is no loss above 0 and up to 100 %.
    """
    try:
        value = float(text.removesuffix("%")) / (100.0 if text.endswith("%") else 1.0)
    except ValueError:
        value = float("nan")
    if not 0.0 < value <= 1.0:
        told = "must be a loss of pair stiffness above 0, up to 100%, such as 20%"
        raise argparse.ArgumentTypeError(f"{text}: {told}")
    return value


def axes_of(text: str) -> dict[str, str | int]:
    """Return the channel of each axis of a text such as "x=a1,y=a2,z=3".

    Raises
    ------
    ArgumentTypeError
        If it is none, or names an axis twice.
    """
    pairs = [part.partition("=") for part in text.split(",")]
    if not all(mark and axis and channel for axis, mark, channel in pairs):
        told = "must name channels as x=NAME,y=NAME,z=NAME or x=1,y=2"
        raise argparse.ArgumentTypeError(f"{text}: {told}")
    if len({axis for axis, _, _ in pairs}) < len(pairs):
        raise argparse.ArgumentTypeError(f"{text}: names an axis twice")
    return {axis.strip(): channel_of(channel.strip()) for axis, _, channel in pairs}


#: What stands behind an option; any other word is text.
KINDS: dict[str, Callable[[str], Any]] = {
    **{"N": int, "NAME|N": channel_of, "LOSS": loss_of, "x=A,y=B,z=C": axes_of},
    **dict.fromkeys(("DB", "F", "G", "HZ", "LO", "MM", "MS2", "NM", "RPM", "S", "X"), float),
}


def argument(usage: str, told: str, default: Any = None, **more: Any) -> Argument:
    """Describe an argument by what a line of usage says of it.

    Parameters
    ----------
    usage : str
        "--again" is a flag; "--peaks N" takes a number, "--band LO HI" two; "--gear GEAR..." may be
        given several times. "MACHINE" stands in its place, "RECORDING..." several; "[NAME]" and
        "[RECORDING...]" may be left out.
    told : str
        Its help; a number taken by default is put behind.
    default : optional
    **more
        Further settings, as `ArgumentParser.add_argument` takes them.

    Examples
    --------
    >>> argument("--peaks N", "peaks listed", 12)[1]["help"]
    'peaks listed (12)'
    """
    optional, several = usage.startswith("["), usage.rstrip("]").endswith("...")
    name, *words = usage.strip("[]").removesuffix("...").split(" ")
    if isinstance(default, int | float):
        told += f" ({f'{default:g}'.replace('e-0', 'e-')})"
    settings: dict[str, Any] = {"help": told, "default": default}
    if not name.startswith("-"):
        counts = {(True, False): "?", (False, True): "+", (True, True): "*"}
        settings |= {"metavar": name, "nargs": counts.get((optional, several))}
        return (name.lower(),), settings | more
    if not words:
        return (name,), {"help": told, "action": "store_true"} | more
    settings |= {"metavar": words[0], "type": KINDS.get(words[0], str)}
    if several:
        settings |= {"action": "append", "default": [], "help": f"{told}; repeatable"}
    if len(words) > 1:
        settings |= {"metavar": tuple(words), "nargs": len(words)}
    return (name,), settings | more


MACHINE = argument("MACHINE", "machine file (TOML)")
OF_MACHINE = argument("--machine MACHINE", "machine file (TOML)", required=True)
_RATE = "needed if the file does not hold it"
SAMPLING_RATE = argument("--sampling-rate HZ", _RATE, dest="sampling_rate_hz")
REFERENCE = argument("--reference PATH", "what gearmon learn wrote, or one healthy recording")
TACHO = argument("--tacho NAME|N", "channel with tachometer pulses")
FAULT = argument("--fault KIND:STAGE:GEAR:TOOTH:SIZE...", _FAULT)
#: Also those that only a baseline knows.
FAULT_OR_ERROR = argument("--fault KIND:STAGE:GEAR:TOOTH:SIZE...", f"{_FAULT}; {_ERRORS}")


def recordings(
    usage: str = "RECORDING...", *, machine_required: bool = True
) -> tuple[Argument, ...]:
    """Describe recordings, their machine, and how they are to be read.

    Parameters
    ----------
    usage : {"RECORDING...", "[RECORDING...]", "RECORDING"}
        Whether there may be more than one, or none.
    machine_required : bool
    """
    kinds = "CSV, plain or gzip; also WAV, FLAC, MATLAB, HDF5, TDMS, UFF 58, Parquet, NPY"
    names, settings = argument(usage, f"{kinds}; a folder of these; - for standard input")
    hint = "speed of shaft 1, where the machine file's is far off; it is looked for about this"
    channels = "vibration channel by name or column number (all by default)"
    return (
        # one is a list too
        (names, settings | {"nargs": settings["nargs"] or 1}),
        (OF_MACHINE[0], OF_MACHINE[1] | {"required": machine_required}),
        argument("--speed-hint RPM", hint),
        SAMPLING_RATE,
        argument("--channel NAME|N...", channels),
        TACHO,
    )


def given(arguments: Namespace, *names: str) -> dict[str, Any]:
    """Return options by name, as the function that knows their defaults takes them.

    Parameters
    ----------
    arguments : Namespace
    *names : str
        What was left out, None or an empty list, is left out here too.
    """
    own = {name: getattr(arguments, name) for name in names}
    return {name: value for name, value in own.items() if value not in (None, [])}


Rows = Callable[[], list[dict[str, Any]]]
DONE, FLAGGED, BAD_INPUT, UNJUDGED, OWN_FAULT, STOPPED = 0, 1, 2, 3, 70, 130


def judged(entries: Sequence[Mapping[str, Any]], *, flagged: bool = False) -> int:
    """Return the exit code of recordings.

    Parameters
    ----------
    entries : sequence of mapping
        Of those that were judged with a "verdict", and an "error" of one that could not be used.
    flagged : bool
        Whether anything was flagged.
    """
    if any("error" in entry for entry in entries):
        return BAD_INPUT
    if flagged:
        return FLAGGED
    open_ = any(entry.get("verdict") in ("cannot tell", "no mesh found") for entry in entries)
    return UNJUDGED if open_ else DONE


def complain(message: str) -> None:
    """Write one line to standard error, if anything can be written there."""
    # names of files need not be text, nor one line; those bytes that are no text are spelled out
    line = "".join(c if c.isprintable() or "\ud800" <= c <= "\udfff" else " " for c in message)
    with suppress(OSError):
        print(f"{line_cleared()}gearmon: {line}", file=sys.stderr)


def show(
    arguments: Namespace, result: Mapping[str, Any], lines: Callable[[], Iterable[str]]
) -> int:
    """Print a result: one JSON object with --json, else lines of text; return the exit code."""
    text = as_json(result) if arguments.json else coloured(_CONTROL.sub(" ", "\n".join(lines())))
    if arguments.progress is not None:
        arguments.progress.close()
    try:
        print(text)
    except OSError as error:
        _no_more(error)
    flushed()
    return DONE


def flushed() -> None:
    """Make sure that what was printed has arrived.

    Raises
    ------
    ArgumentError
        If it cannot be written, for lack of room say.
    """
    try:
        sys.stdout.flush()
    except OSError as error:
        _no_more(error)


def _no_more(error: OSError) -> None:
    """Let what is still to be printed go nowhere: Python would complain of it at exit."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    # whoever reads a pipe may have seen enough; the exit code is still that of the result
    if not isinstance(error, BrokenPipeError):
        raise ArgumentError(f"standard output: {error.strerror}") from None


def finish(
    arguments: Namespace,
    found: Result | dict[str, Any],
    lines: Callable[[], list[str]],
    rows: Rows | Mapping[str, Rows] | None = None,
    figures: Callable[[], Mapping[str, Any]] | None = None,
    *,
    rows_in_json: bool = False,
    columns: Iterable[str] = (),
    write: Callable[[str], Any] | None = None,
) -> int:
    """Write a result under the name given, pictures beside it, and show it.

    Parameters
    ----------
    arguments : Namespace
    found : Result or dict
        For JSON; gets "tables" and "pictures" with the names of what is written. A result knows its
        rows and pictures.
    lines : callable
        What the terminal shows.
    rows : callable, or mapping of str to callable, optional
        What a CSV holds; of several tables by what is added to the name.
    figures : callable, optional
        Figures by what is added to the name.
    rows_in_json : bool
        Whether a JSON file holds the rows beside the result; one of a further table holds but rows.
    columns : iterable of str
        Of further tables, which may have no rows.
    write : callable, optional
        Writes the table in the place of rows; takes its name.
    """
    if isinstance(found, dict):
        result = found
    else:
        result, rows = found.to_dict(), rows or found.frame_rows
        figures = found.figures if found.picture else None
    target, written = Path(arguments.output or ""), []
    if arguments.output and write is not None:
        write(arguments.output)
        written.append(arguments.output)
    elif arguments.output and rows is not None:
        tables = rows if isinstance(rows, Mapping) else {"": rows}
        # the name of a picture is that of no table
        for added, own in tables.items() if target.suffix.lower() != ".png" else ():
            path, listed = str(target.with_name(f"{target.stem}{added}{target.suffix}")), own()
            more = {"rows": listed} if added or rows_in_json else {}
            write_table(path, ({} if added else result) | more, listed, columns if added else ())
            written.append(path)
    if arguments.output and (write is not None or rows is not None):
        result["tables"] = written
    if arguments.output and figures is not None:
        pictures = report.save_all(figures(), target.with_suffix(".png"))
        result["pictures"] = [str(path) for path in pictures]
    files = [path for key in ("tables", "pictures") for path in result.get(key, ())]
    return show(arguments, result, lambda: [*lines(), *(f"wrote {path}" for path in files)])


def words(name: str, result: Mapping[str, Any], **known: Any) -> list[str]:
    """Return what the terminal shows of a result, by the template of this name."""
    return template(f"{name}.txt", "gearmon.commands").render({**result, **known}).splitlines()


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
_READ_FILES = ("machine", "reference", "harvester", "past", "day", "floor")
_KEPT_FILES = ("history", "store", "trained")


def perform(arguments: Namespace) -> int:
    """Run the command that was asked for, on the files that it names, and return its exit code.

    Parameters
    ----------
    arguments : Namespace
        Parsed; `asked` is the command. Recordings and machine are put in the place of their names.

    Raises
    ------
    GearmonError
        If something cannot work: where the arguments tell it, before any work is done.
    """
    known = vars(arguments)
    if known.get("recording"):
        arguments.recording = recordings_named(arguments.recording)
    check_names(arguments)
    cores()  # refuses a wrong number of them before any work
    line = nullcontext() if arguments.asked.waits else progress_line(arguments.command)
    with outputs_claimed(arguments), line as arguments.progress:
        if known.get("machine"):
            arguments.machine = machine_of(arguments.machine, known.get("speed_hint"))
        code: int = arguments.asked.run(arguments)
    return code


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
    for name in ("output", "report", "tacho", *_READ_FILES, *_KEPT_FILES):
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
    read += [path for name in _READ_FILES if (path := given.get(name))]
    kept = [path for name in _KEPT_FILES if (path := given.get(name))]
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
