"""The study as a folder: pictures, one HTML page that needs nothing else, and tables."""

from __future__ import annotations

import base64
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from importlib import resources
from pathlib import Path
from typing import Any

from gearmon import __version__
from gearmon.errors import ArgumentError
from gearmon.files import write_atomically
from gearmon.report.study_index import PICTURES, figure_index
from gearmon.report.study_tables import (
    CLAIM_COLUMNS,
    SHOWN_SWEEP_HEADINGS,
    SWEEP_COLUMNS,
    as_csv,
    claim_rows,
    figure_rows,
    shown_difference,
    shown_number,
    shown_sweep,
    sweep_rows,
)
from gearmon.report.study_text import claims_text, verdict_counts
from gearmon.study import StudyResults, judge, run_study
from gearmon.study.findings import Judged

# Background and text of each verdict on the page.
VERDICT_COLOURS = {
    "reproduced": ("#00664B", "#ffffff"),
    "partly": ("#F2C84B", "#1a1a1a"),
    "not reproduced": ("#A63D00", "#ffffff"),
    "cannot be checked": ("#48525E", "#ffffff"),
}
#: Share of the time that computing takes; the rest is drawing.
COMPUTING_SHARE = 0.6


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyReport:
    """What the study wrote.

    Attributes
    ----------
    results : StudyResults
    judged : tuple of Judged
    page : Path
        The HTML page.
    files : tuple of Path
        Everything written, the page first.
    """

    results: StudyResults
    judged: tuple[Judged, ...]
    page: Path
    files: tuple[Path, ...]

    def lines(self) -> list[str]:
        """Tell it on a terminal."""
        return [
            *claims_text(self.judged),
            f"{len(PICTURES)} pictures for figures 1 to {max(figure_index())}, and tables: "
            f"{self.page.parent}",
            f"report: {self.page}",
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        return {
            "report": str(self.page),
            "files": [str(path) for path in self.files],
            "verdicts": verdict_counts(self.judged),
            "claims": claim_rows(self.judged),
        }


def write_study(folder: str | Path, progress: Callable[[float], None] | None = None) -> StudyReport:
    """Compute the study, hold it against its claims, and write everything to a folder.

    Parameters
    ----------
    folder : str or Path
        Made if it does not exist. Gets ``study.html``, ``claims.csv``, ``sweeps.csv``,
        ``figures.csv`` and a PNG of each picture.
    progress : callable, optional
        Called with the share done, 0 to 1.

    Returns
    -------
    StudyReport

    Raises
    ------
    ArgumentError
        If the folder cannot be made or written.

    Notes
    -----
    About half a minute: it integrates many equations of motion and measures run times.
    """
    target = Path(folder)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ArgumentError(f"{target}: cannot make this folder ({error.strerror})") from None

    def computed(share: float) -> None:
        if progress is not None:
            progress(COMPUTING_SHARE * share)

    def drawn(share: float) -> None:
        if progress is not None:
            progress(COMPUTING_SHARE + (1 - COMPUTING_SHARE) * share)

    return write_results(run_study(computed), target, drawn)


def write_results(
    results: StudyResults, folder: Path, progress: Callable[[float], None] | None = None
) -> StudyReport:
    """Write a study that is computed already; see `write_study`."""
    # drawing is slow to load
    from gearmon.report.study_plots import save_picture

    judged = judge(results)
    pictures = []
    for number, picture in enumerate(PICTURES, start=1):
        path = folder / f"{picture.name}.png"
        save_picture(picture.name, results, path)
        pictures.append(path)
        if progress is not None:
            progress(number / len(PICTURES))
    tables = {
        "claims.csv": as_csv(claim_rows(judged), CLAIM_COLUMNS),
        "sweeps.csv": as_csv(sweep_rows(results), SWEEP_COLUMNS),
        "figures.csv": as_csv(figure_rows(), ("figure", "picture", "title")),
    }
    for name, text in tables.items():
        write_atomically(folder / name, text)
    page = folder / "study.html"
    write_atomically(page, _rendered(results, judged, pictures))
    files = (page, *pictures, *(folder / name for name in tables))
    return StudyReport(results=results, judged=judged, page=page, files=files)


def _rendered(results: StudyResults, judged: tuple[Judged, ...], pictures: list[Path]) -> str:
    import jinja2

    source = resources.files("gearmon.report").joinpath("study.html").read_text("utf-8")
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters.update(number=shown_number, difference=shown_difference)
    shown = [
        {"picture": picture, "data": base64.b64encode(path.read_bytes()).decode("ascii")}
        for picture, path in zip(PICTURES, pictures, strict=True)
    ]
    return environment.from_string(source).render(
        made=datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z"),
        version=__version__,
        parameters=results.reference.parameters,
        problem=results.reference.response.problem,
        judged=judged,
        counts=verdict_counts(judged),
        colours=VERDICT_COLOURS,
        index=figure_index(),
        pictures=shown,
        sweeps=[(sweep.label, shown_sweep(sweep)) for sweep in results.sweeps.values()],
        sweep_headings=SHOWN_SWEEP_HEADINGS,
        speed=results.speed,
    )
