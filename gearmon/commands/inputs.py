"""Machines and recordings that the arguments name."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from gearmon.errors import ArgumentError
from gearmon.terminal import progress_bar

if TYPE_CHECKING:
    from gearmon.machine import Machine
    from gearmon.signals.recording import Recording


def machine_of(path: str) -> Machine:
    """Read a machine file."""
    from gearmon.machine import load_machine

    return load_machine(path)


def recording_of(path: str, arguments: argparse.Namespace, machine: Machine | None) -> Recording:
    """Read a recording as the options of the command, and the sensors of the machine, say."""
    from gearmon.signals.recording import read_recording

    return read_recording(
        path,
        sampling_rate_hz=arguments.sampling_rate,
        channels=[_channel(text) for text in arguments.channel] if arguments.channel else None,
        tacho=_channel(arguments.tacho) if arguments.tacho else None,
        sensors=machine.sensors if machine is not None else (),
    )


def _channel(text: str) -> str | int:
    return int(text) if text.isdecimal() else text


def followed(paths: Iterable[str], what: str) -> Iterator[str]:
    """Give the paths, with a progress bar if there are several and a terminal to show it."""
    listed = list(paths)
    if len(listed) < 2:
        yield from listed
        return
    with progress_bar(what) as progress:
        for number, path in enumerate(listed):
            yield path
            if progress is not None:
                progress((number + 1) / len(listed))


def loss_of(text: str | None, option: str) -> float | None:
    """Return the loss of pair stiffness that an option gives, as a fraction; None if it does not.

    Raises
    ------
    ArgumentError
        If it is no loss above 0 and up to 100 %.
    """
    if text is None:
        return None
    try:
        value = float(text.removesuffix("%")) / (100.0 if text.endswith("%") else 1.0)
    except ValueError:
        value = float("nan")
    if not 0.0 < value <= 1.0:
        raise ArgumentError(
            f"{option} {text}: must be a loss of pair stiffness above 0, up to 100%, such as 20%"
        )
    return value
