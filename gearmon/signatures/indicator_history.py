"""What NA4 and NB4 remember of a run, gear by gear, and the file it is kept in."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import ArgumentError, SignatureError
from gearmon.files import write_atomically
from gearmon.signals.indicators import RunHistory

FloatArray = NDArray[np.float64]

_KIND = "gearmon indicator history"


@dataclass(frozen=True, kw_only=True, eq=False)
class IndicatorHistory:
    """Variances of the signals of every gear over a run.

    Parameters
    ----------
    channel_names : tuple of str
        Channels.
    runs : mapping of str to RunHistory
        By signal and gear, as "residual, pinion of stage 1".
    """

    channel_names: tuple[str, ...]
    runs: Mapping[str, RunHistory] = field(default_factory=dict)

    @classmethod
    def of(cls, channel_names: tuple[str, ...]) -> IndicatorHistory:
        """Return the history of a run that has not begun."""
        return cls(channel_names=channel_names)

    def check_channels(self, channel_names: tuple[str, ...]) -> None:
        """Raise if a recording has other channels than the run.

        Raises
        ------
        ArgumentError
            If the names differ.
        """
        if channel_names != self.channel_names:
            raise ArgumentError(
                f"the run so far is of channels {', '.join(self.channel_names)}, this recording "
                f"has {', '.join(channel_names)}; name them with --channel or begin a new history"
            )

    def of_input(self, name: str) -> RunHistory:
        """Return the history of one signal of one gear; empty if it has none."""
        known = self.runs.get(name)
        return RunHistory.of(len(self.channel_names)) if known is None else known

    def with_record(self, name: str, signal: FloatArray) -> IndicatorHistory:
        """Return the history with one more record of one signal.

        Parameters
        ----------
        name : str
            Signal and gear.
        signal : ndarray of float, shape (channels, n)
            The record.
        """
        return replace(self, runs={**self.runs, name: self.of_input(name).with_record(signal)})


def write_history(history: IndicatorHistory, path: str | Path) -> None:
    """Write a history as JSON.

    Raises
    ------
    ArgumentError
        If the file cannot be written.
    """
    content = {
        "kind": _KIND,
        "channels": list(history.channel_names),
        "variances": {name: run.variances.tolist() for name, run in history.runs.items()},
    }
    write_atomically(path, json.dumps(content, indent=1) + "\n")


def read_history(path: str | Path) -> IndicatorHistory:
    """Read what `write_history` wrote.

    Raises
    ------
    SignatureError
        If the file cannot be read or is none.
    """
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise SignatureError(f"{path}: cannot be read ({error.strerror})") from None
    except ValueError:
        raise SignatureError(f"{path}: is no history of indicators (not JSON)") from None
    if not isinstance(content, dict) or content.get("kind") != _KIND:
        raise SignatureError(f"{path}: is no history of indicators")
    try:
        names = tuple(str(name) for name in content["channels"])
        runs = {
            str(name): RunHistory(variances=np.array(rows, dtype=float).reshape(-1, len(names)))
            for name, rows in content["variances"].items()
        }
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise SignatureError(f"{path}: damaged history of indicators ({error})") from None
    return IndicatorHistory(channel_names=names, runs=runs)
