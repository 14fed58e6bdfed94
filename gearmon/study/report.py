"""The study as a folder: pictures, one HTML page that needs nothing else, and tables."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, get_args

from gearmon.benchmark.equations import VARIATION
from gearmon.files import made_folder, write_atomically
from gearmon.report.wording import base64_text, rows_as_csv, template
from gearmon.study.claims import STUDY, Evidence, Finding, Verdict, judge
from gearmon.study.experiments import StudyResults, run_study
from gearmon.study.pair import REFERENCE
from gearmon.terminal import Progress, followed, part_of

#: Share of the time that computing takes; the rest is drawing.
COMPUTING_SHARE = 0.6
WIDTH = 100


#: Name (of file and drawing), figures of the study that it stands for, title and caption of each.
PICTURES = STUDY["picture"]
#: Figure of the study -> the picture that stands for it.
FIGURES = {number: row for number in range(1, 37) for row in PICTURES if number in row["figures"]}


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyReport:
    """What the study wrote.

    Attributes
    ----------
    judged : tuple of Finding
    page : Path
        The HTML page.
    files : tuple of Path
        Everything written, the page first.
    """

    judged: tuple[Finding, ...]
    page: Path
    files: tuple[Path, ...]

    def lines(self) -> list[str]:
        """Tell it on a terminal."""
        told, margin = [], " " * 23
        for entry in self.judged:
            head = f"{entry.claim.key:<4}{entry.verdict.upper():<19}{entry.claim.text}"
            told += textwrap.wrap(head, WIDTH, subsequent_indent=margin)
            told += textwrap.wrap(margin + entry.reason, WIDTH, subsequent_indent=margin)
        counts = ", ".join(f"{n} {verdict}" for verdict, n in _counts(self.judged).items())
        pictures = f"{len(PICTURES)} pictures for figures 1 to {max(FIGURES)}"
        told += ["", f"{len(self.judged)} claims: {counts}"]
        told += [f"{pictures}, and tables: {self.page.parent}", f"report: {self.page}"]
        return told

    def to_dict(self) -> dict[str, Any]:
        """Return built-in types, ready for JSON."""
        return {
            "report": str(self.page),
            "files": [str(path) for path in self.files],
            "verdicts": _counts(self.judged),
            "claims": [
                {name: None if value != value else value for name, value in row.items()}
                for row in claim_rows(self.judged)
            ],
        }


def write_study(folder: str | Path, progress: Progress | None = None) -> StudyReport:
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
    target = made_folder(folder)
    results = run_study(part_of(progress, 0.0, COMPUTING_SHARE))
    return write_results(results, target, part_of(progress, COMPUTING_SHARE, 1 - COMPUTING_SHARE))


def write_results(results: StudyResults, folder: Path, progress: Progress | None) -> StudyReport:
    """Write a study that is computed already; see `write_study`."""
    from gearmon.study.plots import save_picture  # drawing is slow to load

    judged = judge(results)
    pictures = [folder / f"{picture['name']}.png" for picture in PICTURES]
    for path in followed(pictures, len(pictures), progress):
        save_picture(path.stem, results, path)
    tables = {
        "claims.csv": claim_rows(judged),
        "sweeps.csv": sweep_rows(results),
        "figures.csv": [
            {"figure": number, "picture": f"{row['name']}.png", "title": row["title"]}
            for number, row in FIGURES.items()
        ],
    }
    for name, rows in tables.items():
        write_atomically(folder / name, rows_as_csv(rows))
    page = folder / "study.html"
    write_atomically(page, _rendered(results, judged, pictures))
    files = (page, *pictures, *(folder / name for name in tables))
    return StudyReport(judged=judged, page=page, files=files)


def _rendered(results: StudyResults, judged: tuple[Finding, ...], pictures: list[Path]) -> str:
    return template("study.html", "gearmon.study").render(
        number=shown_number,
        difference=shown_difference,
        problem=REFERENCE,
        variation=VARIATION,
        judged=judged,
        counts=_counts(judged),
        index=FIGURES,
        pictures=zip(PICTURES, (base64_text(p.read_bytes()) for p in pictures), strict=True),
        results=results,
    )


def _counts(judged: Sequence[Finding]) -> dict[str, int]:
    """Count the verdicts, in the order from reproduced to not checkable."""
    return {kind: sum(entry.verdict == kind for entry in judged) for kind in get_args(Verdict)}


def claim_rows(judged: Sequence[Finding]) -> list[dict[str, Any]]:
    """One row for every number behind every claim."""
    rows = []
    for entry in judged:
        claim = entry.claim
        head = {"claim": claim.key, "text": claim.text, "where": claim.where}
        head |= {"verdict": entry.verdict, "reason": entry.reason}
        for item in entry.evidence:
            agrees = None if item.expected is None else item.agrees
            rows.append(head | asdict(item) | {"difference": item.difference, "agrees": agrees})
    return rows


def sweep_rows(results: StudyResults) -> list[dict[str, Any]]:
    """One row for every value of every sweep."""
    return [
        {"parameter": sweep.name, "value": float(value)} | point.figures
        for sweep in results.sweeps.values()
        for value, point in zip(sweep.values, sweep.points, strict=True)
    ]


def shown_number(value: float | None) -> str:
    """Write a number to four digits.

    Examples
    --------
    >>> shown_number(276.19071), shown_number(None), shown_number(float("nan"))
    ('276.2', '', 'none')
    """
    if value is None:
        return ""
    if math.isnan(value):
        return "none"
    return f"{value:.4g}" if value == 0 or 1e-3 <= abs(value) < 1e5 else f"{value:.2e}"


def shown_difference(item: Evidence) -> str:
    """Write the difference of a number to the expected one."""
    if item.difference is None:
        return ""
    if item.expected == 0:
        return shown_number(item.difference)
    return "< 0.01 %" if abs(item.difference) < 5e-5 else f"{100 * item.difference:+.2f} %"
