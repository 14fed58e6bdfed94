"""The table of condition indicators of a recording: one call, every indicator with its input."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearmon.errors import check_range
from gearmon.machine import Machine
from gearmon.signals import indicators
from gearmon.signals.indicators import na4, na4_frozen
from gearmon.signals.recording import Recording
from gearmon.signals.threads import at_once
from gearmon.signatures.gear_signals import GearSignals, gear_signals
from gearmon.signatures.indicator_history import IndicatorHistory
from gearmon.signatures.measured import MeasuredSignature, measure_signature

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class IndicatorRow:
    """One indicator of one channel.

    Parameters
    ----------
    channel : str
    stage : int or None
        Stage of the gear; None for the raw vibration.
    gear : str or None
        The gear whose turn was averaged.
    indicator : str
        Its name.
    value : float
    unit : str or None
        "1" for ratios; None where the unit of the channel is unknown.
    input : str
        The signal it was computed of.
    removed : str
        What was taken out of that signal, in words.
    removed_orders : tuple of float
        The same as orders of shaft 1.
    """

    channel: str
    stage: int | None
    gear: str | None
    indicator: str
    value: float
    unit: str | None
    input: str
    removed: str
    removed_orders: tuple[float, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        return {**self.brief(), "removed_orders": list(self.removed_orders)}

    def brief(self) -> dict[str, Any]:
        """Return the row without its list of orders: one line of a table."""
        return {
            "channel": self.channel,
            "stage": self.stage,
            "gear": self.gear,
            "indicator": self.indicator,
            "value": self.value,
            "unit": self.unit,
            "input": self.input,
            "removed": self.removed,
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class IndicatorTable:
    """All indicators of a recording.

    Parameters
    ----------
    recording : str
        Where it came from.
    rows : tuple of IndicatorRow
        First those of the raw vibration, then gear by gear.
    signature : MeasuredSignature or None
        What the gears' rows were computed of.
    history : IndicatorHistory or None
        The run up to and with this recording; hand it on to the next.
    notes : tuple of str
        What the reader should know.
    """

    recording: str
    rows: tuple[IndicatorRow, ...]
    signature: MeasuredSignature | None
    history: IndicatorHistory | None
    notes: tuple[str, ...]

    def value(self, indicator: str, channel: str, stage: int | None, gear: str | None) -> float:
        """Return one value.

        Raises
        ------
        KeyError
            If there is no such row.
        """
        for row in self.rows:
            if (row.indicator, row.channel, row.stage, row.gear) == (
                indicator,
                channel,
                stage,
                gear,
            ):
                return row.value
        raise KeyError((indicator, channel, stage, gear))

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        found = self.signature
        return {
            "recording": self.recording,
            "speed": found.speed.to_dict() if found is not None else None,
            "mesh": [mesh.to_dict() for mesh in found.meshes] if found is not None else [],
            "indicators": [row.to_dict() for row in self.rows],
            "warnings": list(self.notes),
        }


def indicator_table(
    recording: Recording,
    machine: Machine | None = None,
    history: IndicatorHistory | None = None,
    baseline: int = 1,
) -> IndicatorTable:
    """Compute every indicator of a recording.

    Parameters
    ----------
    recording : Recording
        Vibration channels, and perhaps a tacho channel.
    machine : Machine, optional
        Without it there are the indicators of the raw vibration only: RMS, peak to peak, crest
        factor, kurtosis.
    history : IndicatorHistory, optional
        The run before this recording, for NA4 and NB4; without it a run begins here.
    baseline : int
        Records at the start of the run that were healthy: the denominator of NA4* and NB4*.

    Returns
    -------
    IndicatorTable
        With a machine also, gear by gear of its synchronous average: the same four, FM0, sideband
        energy ratio, sideband index, sideband level factor, of the residual signal NA4 and NA4*, of
        the difference signal FM4, M6A, M8A and the energy ratio, and of the envelope about the
        first mesh harmonic NB4 and NB4*.

    Raises
    ------
    GearmonError
        If the recording cannot be used or the history is of other channels.
    """
    check_range("baseline", baseline, 1, 1_000_000)
    vibration = recording.vibration()

    def raw() -> list[IndicatorRow]:
        channels = zip(vibration.channel_names, vibration.units, vibration.samples, strict=True)
        return [
            row for name, unit, samples in channels for row in _of_waveform(samples, name, unit)
        ]

    if machine is None:
        return IndicatorTable(
            recording=recording.origin,
            rows=tuple(raw()),
            signature=None,
            history=history,
            notes=tuple(recording.notes),
        )
    rows, signature = at_once(
        raw, lambda: measure_signature(recording, machine), vibration.samples.size
    )
    notes = list(signature.notes)
    names = signature.channel_names
    run = history if history is not None else IndicatorHistory.of(names)
    run.check_channels(names)
    if not signature.found:
        notes.append("no mesh found: only the raw vibration has indicators")
    else:
        for wheel in signature.plan.wheels:
            if not len(wheel.number):
                continue
            own = gear_signals(signature.lines.mean, wheel)
            where = f"{wheel.gear} of stage {wheel.stage}"
            run = run.with_record(f"residual, {where}", own.residual)
            run = run.with_record(f"envelope, {where}", own.envelope)
            rows += _of_gear(own, signature, run, where, baseline)
        if history is None:
            notes.append("a run begins here: NA4 and NB4 are the kurtosis of their signals")
    return IndicatorTable(
        recording=recording.origin,
        rows=tuple(rows),
        signature=signature,
        history=run,
        notes=tuple(notes),
    )


def _of_waveform(samples: FloatArray, channel: str, unit: str | None) -> Iterator[IndicatorRow]:
    own = indicators.describe_waveform(samples)
    for name, value, of in (
        ("RMS", own.rms, unit),
        ("peak to peak", own.peak_to_peak, unit),
        ("crest factor", own.crest_factor, "1"),
        ("kurtosis", own.kurtosis, "1"),
    ):
        yield IndicatorRow(
            channel=channel,
            stage=None,
            gear=None,
            indicator=name,
            value=value,
            unit=of,
            input="raw vibration",
            removed="mean",
        )


@dataclass(frozen=True, kw_only=True)
class _Input:
    """A signal that indicators are computed of, in words."""

    name: str
    removed: str
    numbers: tuple[int, ...] = ()


def _inputs(own: GearSignals) -> dict[str, _Input]:
    gear = own.wheel.gear
    shaft = f"multiples {_listed(own.shaft)} of the {gear}'s rotation, " if own.shaft else ""
    residual = f"{shaft}mesh harmonics at {_listed(own.mesh)}"
    difference = f"{residual}, their first sidebands"
    taken = tuple(sorted(own.shaft + own.mesh))
    low, high = own.band
    return {
        "average": _Input(name="average", removed="all that does not repeat with the gear"),
        "residual": _Input(name="residual", removed=residual, numbers=taken),
        "difference": _Input(
            name="difference", removed=difference, numbers=tuple(sorted(taken + own.first))
        ),
        "regular": _Input(
            name="difference over regular",
            removed=difference,
            numbers=tuple(sorted(taken + own.first)),
        ),
        "envelope": _Input(
            name=f"envelope of the average, multiples {low} to {high}",
            removed=f"all but multiples {low} to {high} of the {gear}'s rotation",
        ),
    }


def _listed(numbers: tuple[int, ...]) -> str:
    if len(numbers) > 6:
        return ", ".join(str(n) for n in (*numbers[:3], "...", numbers[-1]))
    return ", ".join(str(n) for n in numbers)


def _of_gear(
    own: GearSignals,
    signature: MeasuredSignature,
    run: IndicatorHistory,
    where: str,
    baseline: int,
) -> Iterator[IndicatorRow]:
    residuals, envelopes = run.of_input(f"residual, {where}"), run.of_input(f"envelope, {where}")
    average = own.average
    columns: tuple[tuple[str, str, FloatArray, bool], ...] = (
        ("RMS", "average", indicators.rms(average), True),
        ("peak to peak", "average", indicators.peak_to_peak(average), True),
        ("crest factor", "average", indicators.crest_factor(average), False),
        ("kurtosis", "average", indicators.kurtosis(average), False),
        ("FM0", "average", indicators.fm0(average, own.mesh_amplitude), False),
        (
            "SER",
            "average",
            indicators.sideband_energy_ratio(own.near_sidebands, own.fundamental),
            False,
        ),
        ("sideband index", "average", indicators.sideband_index(own.first_sidebands), True),
        (
            "sideband level factor",
            "average",
            indicators.sideband_level_factor(own.first_sidebands, average),
            False,
        ),
        ("NA4", "residual", na4(own.residual, residuals), False),
        ("NA4*", "residual", na4_frozen(own.residual, residuals, baseline), False),
        ("FM4", "difference", indicators.fm4(own.difference), False),
        ("M6A", "difference", indicators.m6a(own.difference), False),
        ("M8A", "difference", indicators.m8a(own.difference), False),
        (
            "energy ratio",
            "regular",
            indicators.energy_ratio(own.difference, own.regular),
            False,
        ),
        ("NB4", "envelope", na4(own.envelope, envelopes), False),
        ("NB4*", "envelope", na4_frozen(own.envelope, envelopes, baseline), False),
    )
    inputs, wheel = _inputs(own), own.wheel
    for row, (channel, unit) in enumerate(
        zip(signature.channel_names, signature.units, strict=True)
    ):
        for name, key, values, has_unit in columns:
            yield IndicatorRow(
                channel=channel,
                stage=wheel.stage,
                gear=wheel.gear,
                indicator=name,
                value=float(values[row]),
                unit=unit if has_unit else "1",
                input=inputs[key].name,
                removed=inputs[key].removed,
                removed_orders=tuple(n * wheel.order for n in inputs[key].numbers),
            )
