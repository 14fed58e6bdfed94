"""A report as one HTML file that needs nothing else, with a PNG of each picture beside it.

Its charts, drawn by `charts.js`, hold the numbers of a recording once: its lines, measured and
healthy, and the curves of each chart. The same is drawn as pictures for paper and for readers
without scripts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gearmon.arrays import FloatArray
from gearmon.diagnosis.history.changes import ChangePoint
from gearmon.diagnosis.history.trends import HistoryTrends
from gearmon.diagnosis.results import Analysis
from gearmon.errors import ArgumentError
from gearmon.files import check_output, write_atomically
from gearmon.gears.kinematics import kinematics
from gearmon.machine import Machine
from gearmon.report import curves, text, wording
from gearmon.signals.orders.resampling import READ_UP_TO
from gearmon.signals.orders.spectra import order_map
from gearmon.signals.recording import Recording
from gearmon.signals.spectra import fast_length
from gearmon.signals.tracking.comb import SpeedScan
from gearmon.signatures.measured.line_plan import Family, WheelLines
from gearmon.signatures.measured.reference import Reference, WheelPattern, tooth_counts
from gearmon.signatures.tracking import SPEED_REACH, SPEED_TOLERANCE, machine_comb

# Changes shown at once; the rest folds away.
_CHANGES_SHOWN = 30
# Points of a curve: a screen shows a thousand, and a spectrum is zoomed into. Those of all channels
# of a chart together, and columns and rows of a map: a report of one recording stays below 1.2 MB.
_POINTS, _ALL_POINTS, _MAP_COLUMNS, _MAP_ROWS = 4096, 12_288, 1000, 32
# Of a map this many decades have colours.
_MAP_DECADES = 4.0
# Channels in a chart; all have the spectra, the strongest the rest.
_MOST_CHANNELS, _STRONGEST = 16, 4
# Turns of a block of the map: as many rows as it has room for, and the mesh apart from sidebands.
_LEAST_TURNS, _MOST_TURNS = 8.0, 40.0


@dataclass(frozen=True, kw_only=True)
class Failure:
    """A recording that could not be analysed.

    Parameters
    ----------
    recording : str
        The recording.
    message : str
        Why, in one line.
    """

    recording: str
    message: str


def write_report(
    analyses: Analysis | Sequence[Analysis],
    recordings: Recording | Iterable[Recording | None] | None,
    reference: Reference | None,
    machine: Machine,
    path: str | Path,
    *,
    failures: Sequence[Failure] = (),
    history: HistoryTrends | None = None,
    progress: Callable[[float], None] | None = None,
) -> list[Path]:
    """Write a report on one or several recordings.

    Parameters
    ----------
    analyses : sequence of Analysis
        The answers.
    recordings : iterable of (Recording or None)
        Their recordings, in the same order, taken one at a time; None leaves the spectra out.
    reference : Reference or None
        What they were compared with.
    machine : Machine
        The machine.
    path : str or Path
        The HTML file, ``*.html``. Pictures go beside it: ``report-01-spectrum.png`` for the first
        recording of ``report.html``.
    failures : sequence of Failure
        Recordings that could not be analysed, to be named in the report.
    history : HistoryTrends, optional
        Of the machine: since when something is flagged, and how it grew.
    progress : callable, optional
        Called with the share that is done, from 0 to 1.

    Returns
    -------
    list of Path
        The files written, the HTML file first.

    Raises
    ------
    ArgumentError
        If there is nothing to report, a recording is missing, or a file cannot be written.

    Examples
    --------
    >>> from gearmon.report import Failure
    >>> failed = [Failure(recording="old.csv", message="old.csv: no such file")]
    >>> files = gearmon.write_report(
    ...     [analysis], [None], reference, machine, "report.html", failures=failed
    ... )
    >>> files[0].name
    'report.html'
    """
    analyses = [analyses] if isinstance(analyses, Analysis) else analyses
    recordings = [recordings] if isinstance(recordings, Recording | None) else recordings
    target = Path(path)
    if not analyses and not failures:
        raise ArgumentError("a report needs at least one recording")
    if target.suffix.lower() not in (".html", ".htm"):
        raise ArgumentError(f"{target}: a report is an HTML file; give a name that ends in .html")
    check_output(target)
    sections, written, charts = [], [], {}
    points = max(_POINTS // 8, _POINTS // max(1, len(analyses)))
    pairs = zip(analyses, recordings, strict=False)
    for number, (analysis, recording) in enumerate(pairs, start=1):
        anchor, answer = f"recording-{number}", text.summary(analysis, history)
        pictures, files = _pictures(number, analysis, recording, target)
        charts[anchor] = _Charts(analysis, recording, reference, machine, points).page()
        section = {"analysis": analysis, "summary": answer, "anchor": anchor}
        sections.append(section | {"pictures": pictures})
        written += files
        if progress:
            progress(number / len(analyses))
    if len(sections) < len(analyses):
        raise ArgumentError(
            f"recordings: {len(sections)} given, fewer than the analyses; give one each"
        )
    if history is not None and history.history.entries:
        charts["history"] = history_charts(history)
    verdict, counts = "", ""
    if analyses and len(analyses) + len(failures) > 1:
        verdict, counts = text.overall(analyses, len(failures))
    script, styles = wording.chart_script(), wording.report_style()
    page = wording.template("analysis.html").render(
        text=text,
        machine=machine,
        reference=reference,
        teeth=tooth_counts(machine),
        searched=(SPEED_TOLERANCE, SPEED_REACH),
        sections=[sections[place] for place in text.worst_first(analyses)],
        overall={"verdict": verdict, "counts": counts},
        failures=failures,
        changes_shown=_CHANGES_SHOWN,
        charts=charts,
        # these three are ours, or escaped above: the template lets them through as they are
        styles=styles,
        script=script,
        data=wording.as_data(charts),
        allowed={"script": wording.digest(script), "style": wording.digest(styles)},
    )
    write_atomically(target, page)
    return [target, *written]


def _pictures(
    number: int, analysis: Analysis, recording: Recording | None, target: Path
) -> tuple[list[dict[str, str]], list[Path]]:
    """Draw one recording, write its pictures, and return what the template needs of them."""
    from gearmon.report.analysis_plots import analysis_figures
    from gearmon.report.plots import as_png

    shown, files = [], []
    for figure in analysis_figures(analysis, recording):
        png = as_png(figure)
        files.append(target.with_name(f"{target.stem}-{number:02d}-{figure.name}.png"))
        write_atomically(files[-1], png)
        told = {"title": figure.heading, "caption": figure.caption}
        told |= {"alt": wording.printable(figure.alt), "data": wording.base64_text(png)}
        shown.append(told)
    return shown, files


@dataclass(frozen=True)
class _Charts:
    """The charts of one recording, in built-in types, ready for JSON.

    Parameters
    ----------
    analysis : Analysis
    recording : Recording or None
        Without, there are no spectra.
    reference : Reference or None
        What it was compared with.
    machine : Machine
    points : int
        Points of a curve, at most.
    """

    analysis: Analysis
    recording: Recording | None
    reference: Reference | None
    machine: Machine
    points: int

    def page(self) -> dict[str, Any]:
        """Return the charts and the lines that they name."""
        signature = self.analysis.signature
        charts = [] if self.recording is None else list(self._spectra(self.recording))
        for wheel in signature.plan.wheels if signature.found else ():
            charts += self._turn(wheel) if len(wheel.number) else ()
        named = zip(map(wording.printable, signature.channel_names), signature.units, strict=True)
        channels = [
            {"name": name, "unit": wording.unit_text(unit), "colour": _colour(row)}
            for row, (name, unit) in enumerate(named)
        ]
        return {
            "channels": channels[:_MOST_CHANNELS],
            "speed_hz": signature.speed.estimated_hz,
            "lines": self._lines() if signature.found else _places(self.analysis),
            "charts": charts,
        }

    def _spectra(self, recording: Recording) -> Iterator[dict[str, Any]]:
        """Give the spectrum, how the speed was searched for, the order spectrum and its map."""
        analysis, signature = self.analysis, self.analysis.signature
        vibration, speed = curves.vibration_of(analysis, recording), signature.speed
        samples, rate = vibration.samples, vibration.sampling_rate_hz
        spectrum, _ = curves.time_spectrum(samples, rate)
        place, values = spectrum.frequency_hz[2:], spectrum.values[:, 2:]
        yield self._spectrum("spectrum", "Frequency (Hz)", speed.estimated_hz, place, values)
        if not signature.found or text.far_from_nominal(speed):
            yield self._speed_search(vibration)
        if not signature.found:
            return
        track, last = curves.track_of(analysis, recording), curves.last_harmonic_hz(signature)
        top = min(READ_UP_TO * rate / float(track.speed_hz.max()), last / speed.estimated_hz)
        # a wandering speed smears no line of an order spectrum
        orders, values = curves.angle_spectrum(analysis, recording, top)
        axis = "Order (cycles a turn of shaft 1)"
        yield self._spectrum("orders", axis, 1.0, orders, values)
        turns = float(track.turns[-1] - track.turns[0])
        block = float(np.clip(2 * turns / _MAP_ROWS, _LEAST_TURNS, _MOST_TURNS))
        found = order_map(samples, rate, track, top=top, block_turns=block, rows=_MAP_ROWS)
        edges = np.linspace(2, len(found.order), min(_MAP_COLUMNS, len(found.order) - 2) + 1)
        starts = edges[:-1].astype(int)
        held = np.maximum.reduceat(found.amplitude, starts, axis=2)
        yield {
            "name": "map",
            "title": "Order map: an upright line turns with a shaft, a slanting one does not",
            "axis": axis,
            "scale": 1.0,
            "value": "Time (s)",
            "kind": "map",
            "x": _numbers(found.order[starts]),
            "time": [float(found.low[0]), float(found.high[-1])],
            "rows": len(held),
            "maps": [_shades(held[:, row]) | {"channel": row} for row in _strongest(values)],
        }

    def _spectrum(
        self, name: str, axis: str, scale: float, place: FloatArray, values: FloatArray
    ) -> dict[str, Any]:
        x, held = _held(place, values[:_MOST_CHANNELS], self.points)
        # a scale of logarithms has no zero
        floor = 1e-7 * max(float(held.max(initial=0.0)), 1e-300)
        drawn = [_curve(np.maximum(own, floor), "measured", row) for row, own in enumerate(held)]
        return {
            "name": name,
            "kind": "spectrum",
            "title": {"spectrum": "Amplitude spectrum", "orders": "Order spectrum"}[name],
            "axis": axis,
            "scale": scale,
            "value": "Peak amplitude",
            "vibration": True,
            "x": _numbers(x),
            "curves": drawn,
        }

    def _speed_search(self, vibration: Recording) -> dict[str, Any]:
        """Give how well the machine's lines fit at every speed: the one found and its rivals."""
        speed, rate = self.analysis.signature.speed, vibration.sampling_rate_hz
        train = kinematics(self.machine)
        comb = machine_comb(train, speed.nominal_hz)
        block_s = 30.0 / (speed.nominal_hz * max(shaft.order for shaft in train.shafts))
        scan = SpeedScan(vibration.samples, rate, comb, speed.nominal_hz, SPEED_REACH, block_s)
        score = scan.scores.mean(axis=0)
        x, held = _held(60 * speed.nominal_hz * scan.ratio, score[None] - score.min(), _POINTS // 4)
        return {
            "name": "speed",
            "kind": "speed",
            "title": "Search for the speed: how well the lines fit; shaded: the one found",
            "axis": "Speed of shaft 1 (rpm)",
            "value": "Fit of the lines",
            "marked": 60 * speed.estimated_hz,
            "x": _numbers(x),
            "curves": [_curve(held[0], "fit", None)],
        }

    def _turn(self, wheel: WheelLines) -> Iterator[dict[str, Any]]:
        """Give one turn of a gear, with that of the healthy recording that is most like it."""
        analysis = self.analysis
        profile = curves.profile_of(analysis, wheel.stage, wheel.gear)
        own = WheelPattern.of(wheel, analysis.signature.lines)
        channels = min(len(own.amplitude), _STRONGEST)
        points = fast_length(min(4 * (int(wheel.number.max()) + 1), _ALL_POINTS // channels))
        whole, rest = (curves.turn_waveform(own, points, mesh=mesh) for mesh in (True, False))
        places = wheel.teeth * np.arange(points) / points
        number = curves.tooth_numbers(places, profile, wheel.teeth)
        order = np.argsort(number, kind="stable")
        healthy = self._healthy_turn(own, rest)
        drawn = []
        for channel in _strongest(rest):
            drawn.append(_wave(whole[channel, order], "with the mesh", channel, off=True))
            if healthy is not None:
                drawn.append(_wave(healthy[channel, order], "healthy", channel))
            drawn.append(_wave(rest[channel, order], "without the mesh", channel))
        name = f"{wheel.gear} of stage {wheel.stage}"
        place = curves.flagged_place(analysis, wheel.stage, wheel.gear)
        shared = {"axis": "Tooth", "marked": place, "teeth": wheel.teeth}
        yield shared | {
            "name": f"turn-{wheel.stage}-{wheel.gear}",
            "title": f"One turn of the {name}, averaged",
            "value": "Average over the turns",
            "vibration": True,
            "kind": "turn",
            "even": [number[order[0]], wheel.teeth / points, points],
            "curves": drawn,
        }
        if profile is not None:
            teeth = curves.tooth_numbers(np.arange(float(wheel.teeth)), profile, wheel.teeth)
            order = np.argsort(teeth, kind="stable")
            yield shared | {
                "name": f"teeth-{wheel.stage}-{wheel.gear}",
                "title": f"Energy by tooth of the {name}: sound teeth stand at about 1",
                "value": "Energy",
                "kind": "bars",
                "x": _numbers(teeth[order]),
                "curves": [_curve(profile.energy[order], "energy", None)],
            }

    def _healthy_turn(self, own: WheelPattern, rest: FloatArray) -> FloatArray | None:
        """Turn the healthy average of the nearest loudness until it fits this one best."""
        reference, names = self.reference, self.analysis.signature.channel_names
        if reference is None or reference.channel_names != names:
            return None
        patterns = [one for profile in reference.profiles if (one := own.same_in(profile.wheels))]
        if not patterns:
            return None
        loud = float(np.abs(own.amplitude).sum())
        near = min(patterns, key=lambda one: abs(float(np.abs(one.amplitude).sum()) - loud))
        healthy = curves.turn_waveform(near, rest.shape[1], mesh=False)
        fit = np.fft.irfft(np.sum(np.conj(np.fft.rfft(healthy)) * np.fft.rfft(rest), axis=0))
        return np.roll(healthy, int(np.argmax(fit)), axis=1)

    def _lines(self) -> dict[str, Any]:
        """Return the lines of all families, measured and as in the healthy recordings."""
        signature, analysis = self.analysis.signature, self.analysis
        plan, families = signature.plan, signature.plan.families
        channels = signature.channel_names[:_MOST_CHANNELS]
        chosen = sorted((line, number) for number, own in enumerate(families) for line in own.lines)
        index = [line for line, _ in chosen]
        orders = plan.orders[index]
        low, high = self._healthy_range(orders)
        mesh_hz = {own.stage: own.frequency_hz for own in signature.meshes}
        numbers = []  # how many spacings of its family each line is off the mesh harmonic
        for order, (_, number) in zip(orders, chosen, strict=True):
            own = families[number]
            centre = own.harmonic * mesh_hz[own.stage] / signature.speed.estimated_hz
            numbers.append(round((order - centre) / own.spacing) if own.spacing else 0)
        # what a reader switches: meshes first, what else repeats last
        rank = {"mesh": 0, "sidebands": 1, "residual": 2}
        groups = map(_group, sorted(families, key=lambda own: rank[own.kind]))
        changes = {
            (own.family, own.channel): [own.change_db, own.scatter_db] for own in analysis.changes
        }
        named = [
            {
                "name": own.name,
                "group": _group(own),
                "mesh": own.kind == "mesh",
                "reach": 0.0,
                "changes": [changes.get((own.name, name)) for name in channels],
            }
            for own in families
        ]
        size = np.abs(signature.lines.mean[:, index])
        amplitudes = {"measured": size, "low": low, "high": high}
        return {
            "order": np.round(orders, 6).tolist(),
            "number": numbers,
            "family": [number for _, number in chosen],
            "families": named,
            "groups": list(dict.fromkeys(groups)),
            **{name: list(map(_numbers, own[:_MOST_CHANNELS])) for name, own in amplitudes.items()},
        }

    def _healthy_range(self, orders: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the smallest and the largest amplitude of each line in the healthy recordings.

        Not a number where no healthy recording tells; shape (channels, lines) each.
        """
        names, reference = self.analysis.signature.channel_names, self.reference
        low = np.full((len(names), len(orders)), np.nan)
        high, place = low.copy(), {round(own, 6): at for at, own in enumerate(orders.tolist())}
        if reference is None:
            return low, high
        known = reference.channel_names
        for wheel in (wheel for profile in reference.profiles for wheel in profile.wheels):
            at = np.array([place.get(own, -1) for own in np.round(wheel.number * wheel.order, 6)])
            taken, at = np.flatnonzero(at >= 0), at[at >= 0]
            for row, name in enumerate(names):
                if name in known:
                    size = np.abs(wheel.amplitude[known.index(name), taken])
                    low[row, at] = np.fmin(low[row, at], size)
                    high[row, at] = np.fmax(high[row, at], size)
        return low, high


def _colour(number: int) -> str:
    # drawing is slow to load, and text reports do without it
    from gearmon.report.plots import series_colour

    return series_colour(number)


def _numbers(values: ArrayLike) -> str:
    """Return numbers in the four bytes that a script reads fastest, as text."""
    return wording.base64_text(np.asarray(values, dtype="<f4").tobytes())


def _curve(values: FloatArray, layer: str, channel: int | None, **more: Any) -> dict[str, Any]:
    return {"layer": layer, "channel": channel, "values": _numbers(values), **more}


def _wave(values: FloatArray, layer: str, channel: int, **more: Any) -> dict[str, Any]:
    """Give a waveform in steps of its height over 32767, which no screen shows."""
    top = max(float(np.abs(values).max()), 1e-300)
    steps = wording.base64_text(np.rint(32_767 * values / top).astype("<i2").tobytes())
    return {"layer": layer, "channel": channel, "top": top, "values": steps, **more}


def _held(place: FloatArray, values: FloatArray, points: int) -> tuple[FloatArray, FloatArray]:
    """Thin the curves of several channels, which share their places and the room for points."""
    points = max(points // 8, min(points, _ALL_POINTS // len(values)))
    return curves.max_hold(place, values, points)


def _strongest(values: FloatArray) -> list[int]:
    power = np.mean(values**2, axis=1)[:_MOST_CHANNELS]
    return [int(row) for row in np.argsort(-power, kind="stable")[:_STRONGEST]]


def _shades(amplitude: FloatArray) -> dict[str, Any]:
    """Return a map as bytes, 255 at its highest value and 0 some decades below."""
    top = max(float(amplitude.max()), 1e-300)
    level = 1.0 + np.log10(np.maximum(amplitude / top, 1e-9)) / _MAP_DECADES
    shades = wording.base64_text(np.rint(255 * np.clip(level, 0.0, 1.0)).astype(np.uint8).tobytes())
    return {"top": top, "decades": _MAP_DECADES, "shades": shades}


def _places(analysis: Analysis) -> dict[str, Any]:
    """Return where mesh harmonics were looked for, and not found."""
    marks, speed = curves.mesh_marks(analysis.signature), analysis.signature.speed.estimated_hz
    named = [curves.mark_label(mark) for mark in marks]
    shared = {"group": "mesh, not found", "mesh": True, "reach": SPEED_TOLERANCE, "changes": []}
    return {
        "order": [mark.place / speed for mark in marks],
        "number": [0] * len(marks),
        "family": [*range(len(marks))],
        "families": [shared | {"name": own.replace("\n", ", ")} for own in named],
        "groups": [shared["group"]],
        "measured": [],
        "low": [],
        "high": [],
    }


def _group(family: Family) -> str:
    if family.kind == "mesh":
        return f"mesh {family.stage}"
    what = "sidebands" if family.kind == "sidebands" else "other multiples"
    return f"{what} of {wording.shaft_text(family.shaft, family.gear)}"


def history_charts(
    found: HistoryTrends, classes: Mapping[float, str] | None = None
) -> dict[str, Any]:
    """Return the charts of a history: losses of teeth, if any stands out, and the score.

    Parameters
    ----------
    found : HistoryTrends
        With at least one recording.
    classes : mapping of float to str, optional
        Operating class of the recordings by their time; every class has a curve of its own.
    """
    entries = found.history.entries
    times = np.array([entry.time_s for entry in entries])
    charts: list[dict[str, Any]] = []
    shared = {"axis": "Time (UTC)", "kind": "history", "times": times.tolist()}
    drawn, changes, top = [], [], 0.0
    for number, tooth in enumerate(text.told_teeth(found)[:_STRONGEST]):
        own: dict[str, Any] = {"layer": wording.gear_text(tooth.stage, tooth.gear, tooth.tooth)}
        own |= {"channel": None, "colour": _colour(number)}
        estimated = np.searchsorted(times, tooth.trend.series.time_s)
        estimates = np.full((3, len(times)), np.nan)
        estimates[:, estimated] = tooth.trend.series.value, tooth.low, tooth.high
        trend = np.array(tooth.trend.at(times))
        trend[:, : estimated[0]] = np.nan
        for told, dots in ((estimates, True), (trend, False)):
            values, low, high = (_numbers(100 * row) for row in told)
            drawn.append(own | {"values": values, "low": low, "high": high, "dots": dots})
        top = max(top, 100 * float(np.nanmax(estimates[0])), 100 * float(trend[2, -1]))
        changes += _changes(tooth.trend.changes)
    if drawn:
        named = {"name": "history-loss", "value": "Loss of pair stiffness (%)", "top": top}
        named |= {"title": "Loss of each tooth that stands out, with its 90 % intervals"}
        limit = None if found.limit is None else 100 * found.limit
        charts.append(shared | named | {"curves": drawn, "changes": changes, "limit": limit})
    scores = np.array([entry.score for entry in entries])
    of = np.array([(classes or {}).get(entry.time_s, "") for entry in entries])
    scored = [
        _curve(np.where(of == name, scores, np.nan), wording.printable(name) or "score", None)
        | {"colour": _colour(number), "dots": len(set(of)) > 1}
        for number, name in enumerate(sorted(set(of.tolist())))
    ]
    named = {"name": "history-score", "title": "Evidence of a fault", "value": "Score"}
    rose = {"curves": scored, "changes": _changes(found.evidence.changes)}
    charts.append(shared | named | rose)
    words = [f"{wording.printable(entry.recording)}: {entry.verdict}" for entry in entries]
    return {"channels": [], "speed_hz": 0.0, "lines": None, "told": words, "charts": charts}


def _changes(changes: Sequence[ChangePoint]) -> list[list[float]]:
    return [[change.low_s, change.time_s, change.high_s] for change in changes]
