"""The fleet file: machines, where their recordings arrive, who is told; and what lies there now.

A name of a recording is taken apart by the machine's own pattern, a regular expression with the
groups `time`, and, as far as there are any, `machine` and `class` (of operation). A name that does
not fit is reported: nothing is made up for it.
"""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from gearmon.diagnosis.history.entries import time_from_name
from gearmon.diagnosis.results import VERDICTS
from gearmon.errors import ArgumentError
from gearmon.machine import fields as rules
from gearmon.machine import load_machine
from gearmon.machine.fields import FieldError, check_fields, held, within

_GROUPS = ("machine", "time", "class")
_TEXTS = rules.Several(rule=rules.Text(), example='["maize", "rented"]')


@dataclass(frozen=True, kw_only=True)
class FleetMachine:
    r"""A machine of a fleet; keys that several share may stand in `[defaults]`.

    Parameters
    ----------
    name : str
        Its own, under which its history is kept.
    file, reference : str
        Machine file, and what `gearmon learn` wrote ("": none).
    recordings : str
        Folder they arrive in; a URL where fsspec knows its kind ("s3://bucket/tractor").
    pattern : str
        Their names, as in ``(?P<machine>\w+)_(?P<time>[\dT-]+)_(?P<class>\w+)\.wav``; where
        several machines share a folder, `machine` has to be the name.
    sensors : tuple of str or int
        Columns that are analysed; all by default.
    sampling_rate_hz : float, optional
        Where the files do not hold it.
    limit : float, in (0, 1], optional
        Share of a tooth pair's stiffness lost at which to act.
    tags : tuple of str
    alarm_on : tuple of str
        Verdicts that are alarms.
    alarm_after, alarm_clear : int
        Recordings in a row, of one class, with a finding before it is an alarm, and without it
        before the alarm is over.
    """

    name: str = held(rules.Text(example='"tractor 7"'))
    file: str = held(rules.Text(example='"tractor.toml"'))
    recordings: str = held(rules.Text(example='"inbox/tractor-7"'))
    pattern: str = held(rules.Text(example=r"'.*_(?P<time>[\dT-]+)\.wav'"))
    reference: str = held(rules.Text(example='"tractor-7.ref"'), "")
    sensors: tuple[str | int, ...] = held(rules.Several(rule=rules.Column()), ())
    sampling_rate_hz: float | None = within(0, 1e8, "Hz", default=None, open_low=True)
    limit: float | None = within(0, 1, default=None, open_low=True)
    tags: tuple[str, ...] = held(_TEXTS, ())
    alarm_on: tuple[str, ...] = held(
        rules.Several(rule=rules.Choice(options=VERDICTS), example='["fault"]'),
        ("fault", "no mesh found", "cannot tell"),
    )
    alarm_after: int = held(rules.Count(low=1, high=1000), 2)
    alarm_clear: int = held(rules.Count(low=1, high=1000), 3)

    def __post_init__(self) -> None:
        check_fields(self)
        try:
            with warnings.catch_warnings(action="ignore"):  # what later versions of Python refuse
                groups = set(re.compile(self.pattern).groupindex)
        except re.error as error:
            reason = f"is no regular expression ({error})"
            raise FieldError("pattern", reason, self.pattern) from None
        if "time" not in groups or not groups <= set(_GROUPS):
            reason = "must have the group (?P<time>...), and may have machine and class, no others"
            raise FieldError("pattern", reason, self.pattern)


@dataclass(frozen=True, kw_only=True)
class Hook:
    """Who is told of alarms.

    Parameters
    ----------
    command : tuple of str
        A program and its arguments; it gets the alarm as JSON on its standard input.
    webhook : str
        A URL; it gets the same by POST.
    mail : tuple of str
        Addresses, through the system's sendmail.
    tags, classes : tuple of str
        Only of machines with one of these tags, only in these operating classes; empty: all.
    """

    command: tuple[str, ...] = held(_TEXTS, ())
    webhook: str = held(rules.Text(example='"https://example.org/alarm"'), "")
    mail: tuple[str, ...] = held(_TEXTS, ())
    tags: tuple[str, ...] = held(_TEXTS, ())
    classes: tuple[str, ...] = held(_TEXTS, ())

    def __post_init__(self) -> None:
        check_fields(self)
        if self.webhook and not self.webhook.startswith(("http://", "https://")):
            raise FieldError("webhook", "must begin with https:// or http://", self.webhook)


@dataclass(frozen=True, kw_only=True)
class Fleet:
    """Machines that are looked after together, and where what is found of them is kept.

    Parameters
    ----------
    name : str
    machines : tuple of FleetMachine
    hooks : tuple of Hook
    store : Path
        History, ledger and alarms: what `gearmon history --store` reads.
    results : Path
        Folder of the Parquet files.
    """

    name: str
    machines: tuple[FleetMachine, ...]
    hooks: tuple[Hook, ...]
    store: Path
    results: Path

    def machine(self, name: str) -> FleetMachine | None:
        """Return the machine of this name."""
        return next((own for own in self.machines if own.name == name), None)


def read_fleet(path: str | Path) -> Fleet:
    """Read a fleet file, and look whether the files that it names are there.

    Parameters
    ----------
    path : str or Path
        TOML with a `[[machine]]` for each machine, and an `[[alarm]]` for each who is told.

    Returns
    -------
    Fleet

    Raises
    ------
    MachineFileError
        If anything in it is unknown, missing or impossible: one line with file, key and value.
    """
    source, folder = rules.read_source(path), Path(path).parent
    known = ("name", "store", "results", "defaults", "machine", "alarm")
    source.refuse_unknown_keys(source.document, known)
    defaults = source.table("defaults")
    own = tuple(one.name for one in fields(FleetMachine) if one.name != "name")
    source.refuse_unknown_keys(defaults, own, "defaults")
    machines: list[FleetMachine] = []
    for label, table in source.tables("machine"):
        machine = _placed(source, label, folder, defaults | table)
        if machine.name in {other.name for other in machines}:
            message = f'{label}.name = "{machine.name}" is the name of another machine too'
            raise source.error(f"{label}.name", message)
        machines.append(machine)
    for file in dict.fromkeys(machine.file for machine in machines):
        load_machine(file)  # says itself what is wrong with it
    if not machines:
        example = "[[machine]] with name, file, reference, recordings and pattern"
        raise source.error("", f"lacks a machine; write {example}")
    hooks = tuple(source.part(Hook, *own) for own in source.tables("alarm"))
    stem = Path(path).stem
    usual = {"name": stem, "store": f"{stem}.db", "results": f"{stem}-results"}
    texts = {key: source.document.get(key, text) for key, text in usual.items()}
    for key, text in texts.items():
        if not isinstance(text, str) or not text or is_remote(text):
            told = (
                "must be text in quotes and lie on this computer; only recordings may be elsewhere"
            )
            raise source.error(key, f"{key} = {rules.shown_value(text)} {told}")
    return Fleet(
        name=texts["name"],
        machines=tuple(machines),
        hooks=hooks,
        store=folder / texts["store"],
        results=folder / texts["results"],
    )


def _placed(
    source: rules.MachineSource, label: str, folder: Path, table: dict[str, Any]
) -> FleetMachine:
    """Return a machine with the places of its files, which are there, as seen from here."""
    machine = source.part(FleetMachine, label, table)
    placed: dict[str, Any] = {}
    for key in ("file", "reference", "recordings"):
        given = getattr(machine, key)
        placed[key] = str(folder / given) if given and not is_remote(given) else given
    reference, recordings = placed["reference"], placed["recordings"]
    if reference and not Path(reference).is_file():
        told = f'{label}.reference = "{reference}" is no file; gearmon learn makes it'
        raise source.error(f"{label}.reference", told)
    if not is_remote(recordings) and not (recordings and Path(recordings).is_dir()):
        told = f'{label}.recordings = "{recordings}" is no folder; make it first'
        raise source.error(f"{label}.recordings", told)
    return replace(machine, **placed)


def is_remote(place: str) -> bool:
    """Whether a folder or file is one that fsspec has to reach."""
    return "://" in place


@dataclass(frozen=True, kw_only=True)
class Job:
    """A recording that lies in the folder of its machine.

    Parameters
    ----------
    path : str
    machine : FleetMachine
    operating_class : str
        "" if its name tells none.
    time_s : float
        From its name, since 1970-01-01 UTC [s].
    size : int
        [bytes]
    changed : str
        When it was last written, as its file system says.
    """

    path: str
    machine: FleetMachine
    operating_class: str
    time_s: float
    size: int
    changed: str

    @property
    def state(self) -> tuple[int, str]:
        """What changes when it is written to."""
        return self.size, self.changed


def arrived(fleet: Fleet) -> tuple[list[Job], dict[str, str]]:
    """List the recordings that lie in the folders of a fleet.

    Returns
    -------
    jobs : list of Job
        In the order of their names.
    refused : dict of str to str
        Files that are not taken, and why: their names do not fit, or another one is of the same
        machine and time.
    """
    jobs: dict[tuple[str, float], Job] = {}
    refused: dict[str, str] = {}
    for folder in dict.fromkeys(machine.recordings for machine in fleet.machines):
        owners = [machine for machine in fleet.machines if machine.recordings == folder]
        try:
            found = sorted(own for own in _files(folder) if not Path(own[0]).name.startswith("."))
        except Exception as error:  # whatever the program for another kind of place may raise
            why = getattr(error, "strerror", None) or " ".join(str(error).split())
            told = f'recordings = "{folder}": cannot be read ({why or type(error).__name__})'
            raise ArgumentError(told) from None
        for path, size, changed in found:
            try:
                job = _job(owners, path, size, changed)
                first = jobs.setdefault((job.machine.name, job.time_s), job)
                if first is not job:
                    refused[path] = f"is of the same machine and time as {first.path}"
            except ArgumentError as error:
                refused[path] = str(error)
    return list(jobs.values()), refused


def _job(owners: Sequence[FleetMachine], path: str, size: int, changed: str) -> Job:
    name = path.rpartition("/")[2]
    for machine in owners:
        match = re.fullmatch(machine.pattern, name)
        parts = match.groupdict() if match else {}
        if match and parts.get("machine") in (None, machine.name):
            time_s = time_from_name(f"{parts['time']}.").timestamp()
            operating_class = parts.get("class") or ""
            known: dict[str, Any] = {"path": path, "size": size, "changed": changed}
            return Job(machine=machine, operating_class=operating_class, time_s=time_s, **known)
    raise ArgumentError("its name does not fit the pattern of a machine of this folder")


def _files(folder: str) -> Iterator[tuple[str, int, str]]:
    """Give path, size and time of change of the files in a folder."""
    if is_remote(folder):
        import fsspec

        system, root = fsspec.core.url_to_fs(folder)
        for own in system.ls(root, detail=True):
            if own["type"] == "file":
                known = (str(own[k]) for k in ("mtime", "LastModified", "ETag") if k in own)
                yield system.unstrip_protocol(own["name"]), int(own["size"]), next(known, "")
        return
    with os.scandir(folder) as found:
        for entry in found:
            try:
                if entry.is_file():
                    told = entry.stat()
                    yield entry.path, told.st_size, str(told.st_mtime_ns)
            except FileNotFoundError:  # it is gone by now
                continue
            except OSError:  # a link in a circle: what is wrong with it is said when it is read
                yield entry.path, 0, "never"
