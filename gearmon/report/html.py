"""A report as one HTML file that needs nothing else, with a PNG of each picture beside it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from gearmon.diagnosis.history.trends import HistoryTrends
from gearmon.diagnosis.results import Analysis
from gearmon.errors import ArgumentError
from gearmon.files import write_atomically
from gearmon.machine import Machine
from gearmon.report import text, wording
from gearmon.report.wording import (
    as_data,
    base64_text,
    chart_script,
    digest,
    report_style,
    template,
)
from gearmon.signals.recording import Recording
from gearmon.signatures.measured.reference import Reference, tooth_counts
from gearmon.signatures.tracking import SPEED_REACH, SPEED_TOLERANCE

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
    points = max(POINTS // 8, POINTS // max(1, len(analyses)))
    pairs = zip(analyses, recordings, strict=False)
    for number, (analysis, recording) in enumerate(pairs, start=1):
        anchor, answer = f"recording-{number}", text.summary(analysis, history)
        pictures, files = _pictures(number, analysis, recording, target)
        charts[anchor] = recording_charts(analysis, recording, reference, machine, points)
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
    script, styles = chart_script(), report_style()
    page = template("analysis.html").render(
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
        data=as_data(charts),
        allowed={"script": digest(script), "style": digest(styles)},
    )
    write_atomically(target, page)
    return [target, *written]


def _checked(analyses: Sequence[Analysis], failures: Sequence[Failure], target: Path) -> Path:
    if not analyses and not failures:
        raise ArgumentError("a report needs at least one recording")
    if target.suffix.lower() not in (".html", ".htm"):
        raise ArgumentError(f"{target}: a report is an HTML file; give a name that ends in .html")
    if not target.parent.is_dir():
        raise ArgumentError(f"{target}: folder {target.parent} does not exist; make it first")
    return target


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
        files.append(target.with_name(f"{target.stem}-{number:02d}-{figure.name}.png"))
        write_atomically(files[-1], png)
        told = {
            "title": figure.heading,
            "caption": figure.caption,
            "alt": wording.printable(figure.alt),
        }
        shown.append(told | {"data": base64_text(png)})
    return shown, files
