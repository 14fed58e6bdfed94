"""Alarms: one a finding and operating class, raised and cleared after several recordings in a row.

They follow from the ledger alone, whatever the order in which recordings were analysed; what is
kept beside them is who was told, and who has acknowledged.
"""

from __future__ import annotations

import json
import re
import subprocess
import time
import urllib.request
from collections import defaultdict
from collections.abc import Iterable, Iterator
from email.message import EmailMessage
from sqlite3 import Connection
from typing import Any

from gearmon.diagnosis.history.entries import time_text
from gearmon.diagnosis.history.store import opened, put, sound
from gearmon.fleet.ledger import recorded, writing
from gearmon.fleet.plan import Fleet, FleetMachine, Hook
from gearmon.report.wording import printable

# Seconds until a hook is given up, and until it is tried again.
_PATIENCE_S, _AGAIN_S = 20.0, (1.0, 4.0, 16.0)
_KEY = ("machine", "class", "finding", "since_s")
#: A recording that could not be analysed at all.
NOT_ANALYSED = "not analysed"


def renew(fleet: Fleet) -> None:
    """Bring the alarms of all machines with new recordings up to date, in one transaction."""
    with writing(fleet) as store:
        new = store.execute("SELECT DISTINCT machine FROM ledger WHERE alarmed = 0").fetchall()
        for (name,) in new:
            machine = fleet.machine(name)
            if machine is not None:
                _renew(store, machine)
        store.execute("UPDATE ledger SET alarmed = 1 WHERE alarmed = 0")


def _renew(store: Connection, machine: FleetMachine) -> None:
    known = "machine = ? AND state != 'being written' ORDER BY time_s, path"
    classes: dict[str, list[tuple[float, set[str]]]] = defaultdict(list)
    for row in recorded(store, known, (machine.name,)):
        classes[row["class"]].append((row["time_s"], _findings(row, machine)))
    now = {
        (machine.name, name, finding, since): until
        for name, rows in classes.items()
        for finding, since, until in episodes(rows, machine.alarm_after, machine.alarm_clear)
    }
    rows = store.execute("SELECT * FROM alarms WHERE machine = ?", (machine.name,)).fetchall()
    before = {tuple(row[name] for name in _KEY): sound(row) for row in rows}
    # a recording that arrived late has taken them back, or moved their begin
    gone = {key: row for key, row in before.items() if key not in now}
    moved = {key[:3]: row for key, row in gone.items()}
    for key, until in now.items():
        own = before.get(key, {"told": "[]", "acknowledged": 0})
        own = moved.get(key[:3], own) if own["told"] == "[]" else own
        put(store, "alarms", own | dict(zip(_KEY, key, strict=True)) | {"until_s": until})
    for key in gone:
        store.execute(
            "DELETE FROM alarms WHERE (machine, class, finding, since_s) = (?, ?, ?, ?)", key
        )


def _findings(row: dict[str, Any], machine: FleetMachine) -> set[str]:
    """Return what a recording found, by kind and gear: tooth and size go up and down."""
    if row["state"] == "failed":
        return {NOT_ANALYSED}
    if row["verdict"] not in machine.alarm_on:
        return set()
    findings = [text.partition(":")[0] for text in row["findings"]]
    kinds = {re.sub(r", tooth \d+", "", finding) for finding in findings}
    return kinds if row["verdict"] == "fault" and kinds else {row["verdict"]}


def episodes(
    rows: Iterable[tuple[float, set[str]]], after: int, clear: int
) -> Iterator[tuple[str, float, float | None]]:
    """Give every alarm of one machine and class: the finding, since when, until when (or None).

    Parameters
    ----------
    rows : iterable of (float, set of str)
        Time and findings of the recordings, in their order.
    after, clear : int
        Recordings in a row with the finding, and without it.

    Examples
    --------
    >>> rows = [(t, {"wear"} if t in (1, 3, 4, 6) else set()) for t in range(10)]
    >>> list(episodes(rows, 2, 3))
    [('wear', 3, 7)]
    """
    listed = list(rows)
    for finding in sorted({finding for _, found in listed for finding in found}):
        since: float | None = None
        streak: list[float] = []  # of what would change the state
        for time_s, found in listed:
            streak = [*streak, time_s] if (finding in found) == (since is None) else []
            if since is None and len(streak) == after:
                since, streak = streak[0], []
            elif since is not None and len(streak) == clear:
                yield finding, since, streak[0]
                since, streak = None, []
        if since is not None:
            yield finding, since, None


def alarms(fleet: Fleet, machine: str | None = None) -> list[dict[str, Any]]:
    """Return the alarms of a fleet, or of one machine, the newest first, in built-in types.

    Parameters
    ----------
    fleet : Fleet
    machine : str, optional
        Name of the one machine; by default all.

    Returns
    -------
    list of dict
        id, machine, class, finding, since and until (times in words; None while it lasts), over,
        acknowledged and told (targets that know of it), among others.
    """
    with opened(fleet.store, create=False) as store:
        rows = store.execute(
            "SELECT rowid AS id, * FROM alarms WHERE machine = coalesce(?, machine) "
            "ORDER BY since_s DESC, machine, class, finding",
            (machine,),
        ).fetchall()
        return [_alarm(sound(row) | {"id": row["id"]}) for row in rows]


def _alarm(row: dict[str, Any]) -> dict[str, Any]:
    until = row.pop("until_s")
    ended = {"until": None if until is None else time_text(until), "over": until is not None}
    told = {"since": time_text(row["since_s"]), "acknowledged": bool(row["acknowledged"])}
    return row | told | ended | {"told": json.loads(row["told"])}


def acknowledge(fleet: Fleet, number: int) -> None:
    """Note that a person knows of an alarm.

    Parameters
    ----------
    fleet : Fleet
    number : int
        The alarm's `id`, as `alarms` gives it.
    """
    _note(fleet, number, acknowledged=1)


def deliver(fleet: Fleet) -> list[str]:
    """Tell the hooks of every alarm that they do not know of; return what went wrong.

    Parameters
    ----------
    fleet : Fleet

    Returns
    -------
    list of str
        A line for each hook that could not be told, with the reason.

    Notes
    -----
    Who is killed between telling and noting so tells again. One that is over or acknowledged
    before anybody was told is not told any more.
    """
    trouble: dict[str, str] = {}
    for alarm in alarms(fleet):
        machine = fleet.machine(alarm["machine"])
        if alarm["over"] or alarm["acknowledged"] or machine is None:
            continue
        for hook in fleet.hooks:
            for target, send in _targets(hook, machine, alarm):
                # who cannot be told of one alarm does not hold up the others
                if target in alarm["told"] or target in trouble:
                    continue
                if why := _tried(send):
                    trouble[target] = f"{target}: could not be told of an alarm ({why})"
                    continue
                alarm["told"].append(target)
                _note(fleet, alarm["id"], told=json.dumps(alarm["told"]))
    return list(trouble.values())


def _note(fleet: Fleet, number: int, **known: str | int) -> None:
    """Change what an alarm's row says, if there still is one."""
    with writing(fleet) as store:
        for row in store.execute("SELECT * FROM alarms WHERE rowid = ?", (number,)).fetchall():
            put(store, "alarms", sound(row) | known)


def _targets(hook: Hook, machine: FleetMachine, alarm: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Give whom a hook tells, and how."""
    wanted = not hook.tags or set(hook.tags) & set(machine.tags)
    if not wanted or (hook.classes and alarm["class"] not in hook.classes):
        return
    body = {name: alarm[name] for name in ("machine", "class", "finding", "since")}
    told = json.dumps(body | {"tags": list(machine.tags)}, ensure_ascii=False).encode()
    if hook.command:
        yield f"command {hook.command[0]}", lambda: _run(hook.command, told)
    if hook.webhook:
        yield f"webhook {hook.webhook}", lambda: _post(hook.webhook, told)
    for address in hook.mail:
        message = EmailMessage()
        message["To"] = address
        # no line of its own may end that of the subject
        message["Subject"] = printable(f"{alarm['machine']}: {alarm['finding']}")
        said = "".join(f"{name}: {value}\n" for name, value in body.items() if value)
        message.set_content(said)
        letter = message.as_bytes()
        yield f"mail {address}", lambda letter=letter: _run(("sendmail", "-t", "-oi"), letter)


def _tried(send: Any) -> str:
    """Try several times; return why it did not work, "" if it did."""
    why = ""
    for pause in (*_AGAIN_S, 0.0):
        try:
            send()
            return ""
        except (OSError, subprocess.SubprocessError) as error:
            why = " ".join(str(error).split())
            time.sleep(pause)
    return why


def _run(words: tuple[str, ...], content: bytes) -> None:
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    subprocess.run(words, input=content, timeout=_PATIENCE_S, check=True, **quiet)


def _post(url: str, content: bytes) -> None:
    request = urllib.request.Request(url, content, {"Content-Type": "application/json"})
    with urllib.request.urlopen(request, timeout=_PATIENCE_S):
        pass
