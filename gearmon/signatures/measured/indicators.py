"""Condition indicators of a recording, gear by gear: values, what they are of, and their run.

Of a gear they are computed of signals over one of its turns:

- the synchronous *average* holds, of the lines of a whole machine, the multiples of the rotation
  that lie up to half a mesh order from one of the first eight mesh harmonics, as far as the
  sampling rate reaches;
- the *residual* is the average less the harmonics 1 and 2 of the gear's rotation and less every
  mesh harmonic on it, also of other meshes;
- the *difference* is the residual less the first sidebands of all these mesh harmonics;
- the *regular* signal is what was taken out to get the difference;
- the *envelope* is that of the average in a band about the first mesh harmonic.

NA4 and NB4 compare with the run before; what they remember of it is an `IndicatorHistory`, kept in
a file.

References
----------
Lebold, McClintic, Campbell, Byington and Maynard, MFPT 54 (2000) 623-634; Zakrajsek, Townsend and
Decker, NASA TM-105950 (1993).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from gearmon.arrays import ComplexArray, FloatArray
from gearmon.errors import ArgumentError, SignatureError, check_range
from gearmon.files import write_atomically
from gearmon.machine import MachineLike, load_machine
from gearmon.result import Result
from gearmon.signals import indicators
from gearmon.signals.orders.resampling import one_turn
from gearmon.signals.recording import Recording, RecordingLike
from gearmon.signatures.measured.line_plan import NEAR_SIDEBANDS, WheelLines
from gearmon.signatures.measured.measurement import MeasuredSignature, measure_signature, opened

Table = dict[str, dict[str, float]]

_HISTORY = "gearmon indicator history"
# Signals of which those that compare with the run remember the variance.
_REMEMBERED = ("residual", "envelope")
_BRIEF = ("FM0", "FM4", "M6A", "M8A", "energy ratio", "SER")
#: Harmonics of the rotation that count as the shaft's own.
SHAFT_HARMONICS = 2
# Samples of a turn over its highest multiple: sums of eighth powers are then exact.
_OVERSAMPLING = 8.5


@dataclass(frozen=True, kw_only=True, eq=False)
class GearSignals:
    """Signals over one turn of a gear, and lines about its mesh.

    Parameters
    ----------
    wheel : WheelLines
        The gear.
    average, residual, difference, regular, envelope : ndarray of float, shape (channels, n)
        See the module; without mean, but for the envelope.
    mesh_amplitude : ndarray of float, shape (channels, harmonics)
        Peak amplitudes of the gear's own mesh harmonics.
    fundamental : ndarray of float, shape (channels,)
        That of the first.
    first_sidebands : ndarray of float, shape (channels, 2)
        Peak amplitudes of the lines -1 and +1 of the first mesh harmonic; 0 where not measured.
    near_sidebands : ndarray of float, shape (channels, 12)
        The same of -6 to +6.
    part : tuple of str
        What each multiple of the rotation, from 0, counts as: "mesh", "shaft", "first sideband" or
        "difference".
    band : (int, int)
        Lowest and highest multiple of the envelope's band.
    """

    wheel: WheelLines
    average: FloatArray
    residual: FloatArray
    difference: FloatArray
    regular: FloatArray
    envelope: FloatArray
    mesh_amplitude: FloatArray
    fundamental: FloatArray
    first_sidebands: FloatArray
    near_sidebands: FloatArray
    part: tuple[str, ...]
    band: tuple[int, int]

    @property
    def removed(self) -> dict[str, tuple[int, ...]]:
        """Multiples of the rotation taken out of the average, by the signal that was left."""
        residual = ("mesh", "shaft")
        every = {"residual": residual, "difference": (*residual, "first sideband")}
        return {name: self.multiples(*parts) for name, parts in every.items()}

    def multiples(self, *parts: str) -> tuple[int, ...]:
        """Return the multiples of the rotation that count as one of these parts."""
        return tuple(number for number, part in enumerate(self.part) if part in parts)


def gear_signals(
    mean: ComplexArray, wheel: WheelLines, *, per_turn: int | None = None
) -> GearSignals:
    """Build the signals of a gear from the lines of its machine.

    Parameters
    ----------
    mean : ndarray of complex, shape (channels, lines)
        Complex peak amplitudes of all lines of the plan.
    wheel : WheelLines
        Which of them belong to the gear.
    per_turn : int, optional
        Values a turn, more than twice the highest multiple; by default so many that sums of eighth
        powers over them are exact.

    Returns
    -------
    GearSignals
    """
    number, teeth = wheel.number, wheel.teeth
    top = int(number.max(initial=0))
    if per_turn is None:
        per_turn = 1 << int(np.ceil(np.log2(_OVERSAMPLING * (top + 1))))
    spectrum = np.zeros((len(mean), max(top, teeth + NEAR_SIDEBANDS) + 1), dtype=complex)
    spectrum[:, number] = mean[:, wheel.lines]
    beside = np.isin(number, np.add.outer([-1, 1], number[wheel.mesh]))
    chosen = (wheel.mesh, number <= SHAFT_HARMONICS, beside)
    part = np.full(top + 1, "difference", dtype="U16")
    part[number] = np.select(chosen, ("mesh", "shaft", "first sideband"), "difference")
    near = [teeth + r for r in range(-NEAR_SIDEBANDS, NEAR_SIDEBANDS + 1) if r and teeth + r > 0]
    known, size = spectrum[:, : top + 1], np.abs(spectrum)
    reach = max(1, min(teeth // 2, teeth - 1))

    def without(*left_out: str) -> FloatArray:
        """Return a turn of all lines but those of some parts."""
        return one_turn(np.where(np.isin(part, left_out), 0.0, known), per_turn)

    within = np.where(np.abs(np.arange(top + 1) - teeth) <= reach, known, 0.0)
    return GearSignals(
        wheel=wheel,
        average=without(),
        residual=without("mesh", "shaft"),
        difference=without("mesh", "shaft", "first sideband"),
        regular=without("difference"),
        envelope=np.abs(np.fft.ifft(within, per_turn, axis=-1, norm="forward")),
        mesh_amplitude=size[:, number[(number % teeth == 0) & (number >= teeth)]],
        fundamental=size[:, teeth],
        first_sidebands=size[:, [teeth - 1, teeth + 1]],
        near_sidebands=size[:, near],
        part=tuple(part.tolist()),
        band=(teeth - reach, teeth + reach),
    )


@dataclass(frozen=True)
class Indicator:
    """Definition of an indicator of a gear.

    Parameters
    ----------
    of : str
        The signal that it is told to be of.
    formula : callable
        Gives the value in every channel.
    takes : tuple of str
        What the formula takes of a gear's signals; by default the one that it is of. "run" stands
        for their variances over the run, "baseline" for how many records of it were healthy.
    has_unit : bool
        Whether it has the unit of the channel.
    """

    of: str
    formula: Callable[..., FloatArray]
    takes: tuple[str, ...] = ()
    has_unit: bool = False

    def value(self, own: GearSignals, run: IndicatorHistory, baseline: int) -> FloatArray:
        """Return the value in every channel."""
        known = vars(own) | {"baseline": baseline}
        known["run"] = run.variances.get(_input_name(self.of, own))
        return self.formula(*(known[name] for name in self.takes or (self.of,)))


#: Indicators of a gear, in the order in which they are told.
INDICATORS = {
    "RMS": Indicator("average", indicators.rms, has_unit=True),
    "peak to peak": Indicator("average", indicators.peak_to_peak, has_unit=True),
    "crest factor": Indicator("average", indicators.crest_factor),
    "kurtosis": Indicator("average", indicators.kurtosis),
    "FM0": Indicator("average", indicators.fm0, ("average", "mesh_amplitude")),
    "SER": Indicator(
        "average", indicators.sideband_energy_ratio, ("near_sidebands", "fundamental")
    ),
    "sideband index": Indicator(
        "average", indicators.sideband_index, ("first_sidebands",), has_unit=True
    ),
    "sideband level factor": Indicator(
        "average", indicators.sideband_level_factor, ("first_sidebands", "average")
    ),
    "NA4": Indicator("residual", indicators.na4, ("residual", "run")),
    "NA4*": Indicator("residual", indicators.na4, ("residual", "run", "baseline")),
    "FM4": Indicator("difference", indicators.kurtosis),
    "M6A": Indicator("difference", partial(indicators.normalised_moment, order=6)),
    "M8A": Indicator("difference", partial(indicators.normalised_moment, order=8)),
    "energy ratio": Indicator("regular", indicators.energy_ratio, ("difference", "regular")),
    "NB4": Indicator("envelope", indicators.na4, ("envelope", "run")),
    "NB4*": Indicator("envelope", indicators.na4, ("envelope", "run", "baseline")),
}


@dataclass(frozen=True, kw_only=True)
class IndicatorRow(Result):
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

    def brief(self) -> dict[str, Any]:
        """Return the row without its list of orders: one line of a table."""
        return {name: value for name, value in vars(self).items() if name != "removed_orders"}


@dataclass(frozen=True, kw_only=True, eq=False)
class IndicatorTable(Result):
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

    picture = "recording_plots.indicator_figure"

    recording: str
    rows: tuple[IndicatorRow, ...]
    signature: MeasuredSignature | None
    history: IndicatorHistory | None
    notes: tuple[str, ...]

    def frame_rows(self) -> list[dict[str, Any]]:
        """Return a row for every indicator of every channel."""
        return [{"recording": self.recording, **row.brief()} for row in self.rows]

    def value(self, indicator: str, channel: str, stage: int | None, gear: str | None) -> float:
        """Return one value.

        Raises
        ------
        KeyError
            If there is no such row.
        """
        known = {(own.indicator, own.channel, own.stage, own.gear): own for own in self.rows}
        return known[indicator, channel, stage, gear].value

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


def waveform_indicators(samples: FloatArray, channel_names: tuple[str, ...]) -> Table:
    """Compute indicators of the raw vibration: name -> channel -> value.

    Parameters
    ----------
    samples : ndarray of float, shape (channels, n)
        Vibration.
    channel_names : tuple of str
        Names.

    Returns
    -------
    dict
        "rms", "peak to peak", "crest factor" and "kurtosis".
    """
    rows = [indicators.describe_waveform(channel) for channel in samples]
    return {
        label: {name: row[label] for name, row in zip(channel_names, rows, strict=True)}
        for label in ("rms", "peak to peak", "crest factor", "kurtosis")
    }


def gear_indicators(signature: MeasuredSignature) -> Table:
    """Compute indicators of every gear's synchronous average: name -> channel -> value.

    Parameters
    ----------
    signature : MeasuredSignature
        Measured lines.

    Returns
    -------
    dict
        FM0, FM4, M6A, M8A, energy ratio, SER, each with the gear in its name.
    """
    table: Table = {}
    none = IndicatorHistory(channel_names=signature.channel_names)
    for wheel in signature.plan.wheels:
        own = gear_signals(signature.lines.mean, wheel)
        for name in _BRIEF:
            values = INDICATORS[name].value(own, none, 1).tolist()
            row = dict(zip(signature.channel_names, values, strict=True))
            table[f"{name}, {wheel.gear} of stage {wheel.stage}"] = row
    return table


def indicator_table(
    recording: RecordingLike,
    machine: MachineLike | None = None,
    history: IndicatorHistory | None = None,
    baseline: int = 1,
    *,
    sampling_rate_hz: float | None = None,
    unit: str | None = None,
) -> IndicatorTable:
    """Compute every indicator of a recording.

    Parameters
    ----------
    recording : str, Path, array, DataFrame or Recording
        Vibration channels, and perhaps a tacho channel.
    machine : Machine, path or dict, optional
        Without it there are the indicators of the raw vibration only: RMS, peak to peak, crest
        factor, kurtosis.
    history : IndicatorHistory, optional
        The run before this recording, for NA4 and NB4; without it a run begins here.
    baseline : int
        Records at the start of the run that were healthy: the denominator of NA4* and NB4*.
    sampling_rate_hz, unit
        Of an array, or where the recording does not state them: as of `gearmon.read_recording`.

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

    Examples
    --------
    >>> table = gearmon.indicator_table(new, machine)
    >>> sorted({row.indicator for row in table.rows})[:3]
    ['FM0', 'FM4', 'M6A']
    """
    check_range("baseline", baseline, 1, 1_000_000)
    machine = None if machine is None else load_machine(machine)
    recording = opened(recording, machine, sampling_rate_hz, unit)
    vibration = recording.vibration()
    raw = [indicators.describe_waveform(channel) for channel in vibration.samples]
    told = {name: [own[name] for own in raw] for name in raw[0]}
    rows = _rows(vibration, {"RMS": told.pop("rms")} | told)
    notes, run = list(recording.notes), history
    signature = None if machine is None else measure_signature(recording, machine)
    if signature is not None:
        notes = list(signature.notes)
        names = signature.channel_names
        run = history if history is not None else IndicatorHistory(channel_names=names)
        if names != run.channel_names:
            raise ArgumentError(
                f"the run so far is of channels {', '.join(run.channel_names)}, this recording has "
                f"{', '.join(names)}; name them with --channel or begin a new history"
            )
        wheels = signature.plan.wheels if signature.found else ()
        for own in (gear_signals(signature.lines.mean, w) for w in wheels if len(w.number)):
            run = run.with_gear(own)
            values = {name: i.value(own, run, baseline) for name, i in INDICATORS.items()}
            rows += _rows(signature, values, own)
        if not signature.found:
            notes.append("no mesh found: only the raw vibration has indicators")
        elif history is None:
            notes.append("a run begins here: NA4 and NB4 are the kurtosis of their signals")
    return IndicatorTable(
        recording=recording.origin,
        rows=tuple(rows),
        signature=signature,
        history=run,
        notes=tuple(notes),
    )


def _rows(
    source: Recording | MeasuredSignature,
    values: Mapping[str, Sequence[float] | FloatArray],
    own: GearSignals | None = None,
) -> list[IndicatorRow]:
    """Give a row for every value of every channel, of a gear or of the raw vibration."""
    wheel, inputs = (own.wheel, _inputs(own)) if own else (None, {})
    raw = ("raw vibration", "mean", ())
    told = {name: inputs.get(INDICATORS[name].of, raw) for name in values}
    return [
        IndicatorRow(
            channel=channel,
            stage=wheel.stage if wheel else None,
            gear=wheel.gear if wheel else None,
            indicator=name,
            value=float(values[name][row]),
            unit=unit if INDICATORS[name].has_unit else "1",
            input=what,
            removed=removed,
            removed_orders=tuple(n * wheel.order for n in numbers) if wheel else (),
        )
        for row, (channel, unit) in enumerate(zip(source.channel_names, source.units, strict=True))
        for name, (what, removed, numbers) in told.items()
    ]


def _inputs(own: GearSignals) -> dict[str, tuple[str, str, tuple[int, ...]]]:
    """Name the signals: what they are, what was taken out, and which multiples of the rotation."""
    gear, (low, high), slow = own.wheel.gear, own.band, own.multiples("shaft")
    shaft = f"multiples {_listed(slow)} of the {gear}'s rotation, " if slow else ""
    residual = f"{shaft}mesh harmonics at {_listed(own.multiples('mesh'))}"
    difference = f"{residual}, their first sidebands"
    taken, further = own.removed.values()
    return {
        "average": ("average", "all that does not repeat with the gear", ()),
        "residual": ("residual", residual, taken),
        "difference": ("difference", difference, further),
        "regular": ("difference over regular", difference, further),
        "envelope": (
            f"envelope of the average, multiples {low} to {high}",
            f"all but multiples {low} to {high} of the {gear}'s rotation",
            (),
        ),
    }


def _listed(numbers: tuple[int, ...]) -> str:
    shown = numbers if len(numbers) <= 6 else (*numbers[:3], "...", numbers[-1])
    return ", ".join(map(str, shown))


def _input_name(signal: str, own: GearSignals) -> str:
    return f"{signal}, {own.wheel.gear} of stage {own.wheel.stage}"


@dataclass(frozen=True, kw_only=True, eq=False)
class IndicatorHistory:
    """Variances of the signals of every gear over a run.

    Parameters
    ----------
    channel_names : tuple of str
        Channels.
    variances : mapping of str to ndarray of float, shape (records, channels)
        By signal and gear, as "residual, pinion of stage 1"; oldest record first.
    """

    channel_names: tuple[str, ...]
    variances: Mapping[str, FloatArray] = field(default_factory=dict)

    def with_gear(self, own: GearSignals) -> IndicatorHistory:
        """Return the history with one more record of a gear's signals."""
        variances = dict(self.variances)
        for signal in _REMEMBERED:
            name = _input_name(signal, own)
            known = variances.get(name, np.empty((0, len(self.channel_names))))
            variances[name] = np.vstack([known, np.var(getattr(own, signal), axis=-1)])
        return replace(self, variances=variances)


def write_history(history: IndicatorHistory, path: str | Path) -> None:
    """Write a history as JSON.

    Raises
    ------
    ArgumentError
        If the file cannot be written.
    """
    content = {
        "kind": _HISTORY,
        "channels": list(history.channel_names),
        "variances": {name: run.tolist() for name, run in history.variances.items()},
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
        if not isinstance(content, dict) or content.get("kind") != _HISTORY:
            raise ValueError(f"it does not say kind {_HISTORY!r}")
        names = tuple(str(name) for name in content["channels"])
        variances = {
            str(name): np.array(rows, dtype=float).reshape(-1, len(names))
            for name, rows in content["variances"].items()
        }
        if not all(np.all((run >= 0) & (run < np.inf)) for run in variances.values()):
            raise ValueError("variances must be finite and >= 0")
    except (OSError, LookupError, TypeError, ValueError, AttributeError, RecursionError) as error:
        own_words = type(error) in (ValueError, json.JSONDecodeError)
        told = str(error).splitlines()[0] if own_words else "damaged, or of another kind"
        why = getattr(error, "strerror", None) or told
        raise SignatureError(f"{path}: no readable history of indicators ({why})") from None
    return IndicatorHistory(channel_names=names, variances=variances)
