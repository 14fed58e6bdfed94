"""A report as one HTML file that needs nothing else, with a PNG of each picture beside it."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from importlib import resources
from pathlib import Path
from typing import Any

from gearmon import __version__
from gearmon.diagnosis.history import HistoryTrends
from gearmon.diagnosis.results import Analysis, Flag
from gearmon.errors import ArgumentError
from gearmon.files import write_atomically
from gearmon.machine import Machine
from gearmon.report import text
from gearmon.report.palette import VERDICT_STYLE
from gearmon.report.verdict import overall, summary, worst_first
from gearmon.report.wording import gear_text, printable, probability_text
from gearmon.signals.recording import Recording
from gearmon.signatures.measured.reference import Reference

# Changes shown at once; the rest folds away.
_CHANGES_SHOWN = 30


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
    from gearmon.report.charts import POINTS, history_charts, recording_charts

    analyses = [analyses] if isinstance(analyses, Analysis) else analyses
    recordings = [recordings] if isinstance(recordings, Recording | None) else recordings
    target = _checked(analyses, failures, Path(path))
    sections, written, charts = [], [], {}
    supply, points = iter(recordings), max(POINTS // 8, POINTS // max(1, len(analyses)))
    for number, analysis in enumerate(analyses, start=1):
        recording = _next_of(supply, number)
        section = _contents(number, analysis, reference, machine, history)
        section["pictures"], files = _pictures(number, analysis, recording, target)
        charts[section["anchor"]] = recording_charts(
            analysis, recording, reference, machine, points
        )
        sections.append(section)
        written += files
        if progress:
            progress(number / len(analyses))
    if history is not None and history.history.entries:
        charts["history"] = history_charts(history)
    shown = [sections[place] for place in worst_first(analyses)]
    write_atomically(target, _rendered(analyses, shown, machine, failures, charts))
    return [target, *written]


def _checked(analyses: Sequence[Analysis], failures: Sequence[Failure], target: Path) -> Path:
    if not analyses and not failures:
        raise ArgumentError("a report needs at least one recording")
    if target.suffix.lower() not in (".html", ".htm"):
        raise ArgumentError(f"{target}: a report is an HTML file; give a name that ends in .html")
    if not target.parent.is_dir():
        raise ArgumentError(f"{target}: folder {target.parent} does not exist; make it first")
    return target


def _next_of(supply: Iterator[Recording | None], number: int) -> Recording | None:
    try:
        return next(supply)
    except StopIteration:
        raise ArgumentError(
            f"recordings: {number - 1} given, fewer than the analyses; give one each"
        ) from None


def _pictures(
    number: int, analysis: Analysis, recording: Recording | None, target: Path
) -> tuple[list[dict[str, str]], list[Path]]:
    """Draw one recording, write its pictures, and return what the template needs of them."""
    # drawing is slow to load, and text reports do without it
    from gearmon.report.analysis_plots import analysis_figures
    from gearmon.report.plots import as_png

    shown, files = [], []
    for figure in analysis_figures(analysis, recording):
        png = as_png(figure)
        file = target.with_name(f"{target.stem}-{number:02d}-{figure.name}.png")
        write_atomically(file, png)
        files.append(file)
        shown.append(
            {
                "title": figure.heading,
                "caption": figure.caption,
                "alt": printable(figure.alt),
                "data": base64.b64encode(png).decode("ascii"),
            }
        )
    return shown, files


def _contents(
    number: int,
    analysis: Analysis,
    reference: Reference | None,
    machine: Machine,
    history: HistoryTrends | None,
) -> dict[str, Any]:
    indicators, definitions = text.indicator_table(analysis)
    own = summary(analysis, history)
    return _styled(analysis.verdict) | {
        "anchor": f"recording-{number}",
        "recording": printable(analysis.recording),
        "what": own.what,
        "told": own.lines(),
        "because": own.because,
        "facts": text.facts(analysis),
        "flags": [_flag(flag) for flag in analysis.flags],
        "warnings": list(dict.fromkeys([*analysis.warnings, *analysis.signature.notes])),
        "meshes": text.mesh_table(analysis),
        "indicators": indicators,
        "definitions": definitions,
        "changes": text.change_table(analysis),
        "changes_shown": _CHANGES_SHOWN,
        "settings": text.settings_table(analysis, reference, machine),
    }


def _styled(verdict: str) -> dict[str, str]:
    return {
        "verdict": verdict,
        "style": verdict.replace(" ", "-"),
        "sign": VERDICT_STYLE[verdict][2],
    }


def _overall(analyses: Sequence[Analysis], failures: Sequence[Failure]) -> dict[str, Any] | None:
    """Return the worst verdict of several recordings; None for one, whose own says it."""
    if not analyses or len(analyses) + len(failures) < 2:
        return None
    verdict, counts = overall(analyses, len(failures))
    return _styled(verdict) | {"counts": counts}


def _flag(flag: Flag) -> dict[str, Any]:
    return {
        "kind": flag.kind,
        "place": gear_text(flag.stage, flag.gear, flag.tooth),
        "loss": text.flag_loss(flag),
        "probability": probability_text(flag.false_alarm_probability),
        "evidence": flag.evidence,
    }


def _rendered(
    analyses: Sequence[Analysis],
    sections: Sequence[dict[str, Any]],
    machine: Machine,
    failures: Sequence[Failure],
    charts: dict[str, Any],
) -> str:
    import jinja2

    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    colours = [
        f".{_styled(verdict)['style']} {{ background: {background}; color: {colour}; }}"
        for verdict, (background, colour, _) in VERDICT_STYLE.items()
    ]
    styles = "\n".join([shipped("uplot/uPlot.min.css"), shipped("report.css"), *colours])
    script = chart_script()
    return environment.from_string(shipped("analysis.html")).render(
        machine=printable(machine.name) or "machine without a name",
        made=datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z"),
        version=__version__,
        sections=sections,
        overall=_overall(analyses, failures),
        failures=failures,
        charts=charts,
        # these three are ours, or escaped above: the template lets them through as they are
        styles=styles,
        script=script,
        data=as_data(charts),
        allowed={"script": _digest(script), "style": _digest(styles)},
    )


def chart_script() -> str:
    """Return the script that draws charts, with the library it draws by.

    Who passes a page on passes the library on: its licence goes with it.
    """
    licence = "/*\n" + shipped("uplot/LICENSE").strip() + "\n*/"
    return "\n".join([licence, shipped("uplot/uPlot.iife.min.js"), shipped("charts.js")])


def as_data(charts: dict[str, Any]) -> str:
    """Return charts as JSON in which nothing can end the element that holds it."""
    return json.dumps(charts, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")


def shipped(name: str) -> str:
    """Return the text of a file that a page is made of."""
    return resources.files("gearmon.report").joinpath(name).read_text("utf-8")


def _digest(text: str) -> str:
    """Return the mark by which a content security policy lets an element through."""
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode('ascii')}"
