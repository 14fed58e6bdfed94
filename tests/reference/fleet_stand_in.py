"""A fleet whose analysis takes no time: what a recording says stands in its file.

"0.2" is a healthy recording with that score, "fault 0.1" one with that loss on the pinion,
"tooth 5 0.1" one with it on that tooth, "bad" one that cannot be analysed, "kill" one that kills
its process, "slow" one that takes 50 ms.
"""

from __future__ import annotations

import hashlib
import os
import signal
import sqlite3
import time
from contextlib import closing
from pathlib import Path

from gearmon.diagnosis.history import Entry, Place
from gearmon.fleet import in_processes, read_fleet
from gearmon.fleet.ledger import Outcome

MACHINE_FILE = """
[operating]
speed_rpm = 1500.0
[[stage]]
kind = "parallel"
pinion_teeth = 23
gear_teeth = 57
"""
PATTERN = r"(?P<machine>[a-z]+\d*)_(?P<time>[\dT-]+)(_(?P<class>\w+))?\.txt"


def said(job):
    """The stand-in for `gearmon.fleet.run.analysed`."""
    text = Path(job.path).read_text()
    digest = hashlib.blake2b(text.encode()).hexdigest()
    words = text.split()
    if words[0] == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    if words[0] == "slow":
        time.sleep(0.05)
        words = words[1:]
    if words[0] == "bad":
        return Outcome(job=job, hash=digest, why="cannot be used")
    number = float(words[-1])
    places = {"stage": 1, "gear": "pinion", "loss": number, "loss_sigma": 0.01}
    bad = words[0] in ("fault", "tooth")
    kind = f"tooth damage, stage 1, pinion, tooth {words[1]}" if words[0] == "tooth" else ""
    entry = Entry(
        time_s=job.time_s,
        time_source="name",
        machine=job.machine.name,
        recording=job.path,
        verdict="fault" if bad else "healthy",
        score=4.0 if bad else number,
        false_alarm_probability=1e-4 if bad else 0.5,
        speed_hz=25.0,
        findings=(f"{kind or 'wear, stage 1, pinion'}: loss {100 * number} %",) if bad else (),
        places=(Place(loss_low=number - 0.02, loss_high=number + 0.02, **places),) if bad else (),
    )
    return Outcome(job=job, hash=digest, entry=entry, indicators={"rms": {"a1": 1.0 + number}})


def standing_in(jobs):
    """The engine of the processes, with the stand-in."""
    return in_processes(jobs, said)


def at_once(jobs):
    """The stand-in without processes."""
    return map(said, jobs)


def made_fleet(folder, machines=("a", "b"), more="", per_machine=""):
    """Write a fleet file and its folders; its recordings are those of `arrive`."""
    folder.mkdir(exist_ok=True)
    (folder / "inbox").mkdir(exist_ok=True)
    (folder / "machine.toml").write_text(MACHINE_FILE)
    listed = "".join(f'[[machine]]\nname = "{name}"\n{per_machine}\n' for name in machines)
    path = folder / "fleet.toml"
    path.write_text(
        "[defaults]\n"
        f"file = 'machine.toml'\nrecordings = 'inbox'\npattern = '{PATTERN}'\n{listed}{more}"
    )
    return read_fleet(path)


def arrive(folder, name, text, days=0):
    """A recording arrives, written an hour ago; return its path."""
    path = folder / "inbox" / name.format(f"2026-03-{1 + days:02d}")
    path.write_text(text)
    hour_ago = time.time() - 3600
    os.utime(path, (hour_ago, hour_ago))
    return path


def content(fleet):
    """Everything that the store holds, whatever the order in which it came."""
    with closing(sqlite3.connect(fleet.store)) as store:
        told = {}
        for table in ("recordings", "ledger", "latest", "alarms"):
            rows = store.execute(f"SELECT * FROM {table}")
            names = [column[0] for column in rows.description]
            told[table] = sorted(
                tuple(v for name, v in zip(names, row, strict=True) if name != "id") for row in rows
            )
        return told
