"""What texts and pages are made of: numbers, names and tables as a reader wants them, templates."""

from __future__ import annotations

import base64
import json
import math
import sys
import unicodedata
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import TYPE_CHECKING, Any

from gearmon import __version__
from gearmon.errors import counted
from gearmon.files import rows_as_csv as rows_as_csv

if TYPE_CHECKING:
    from jinja2 import Template

# Background, text and sign of each verdict: the sign and the word say it without the colour too.
VERDICT_STYLE = {
    "healthy": ("#00664B", "#ffffff", "✓"),
    "fault": ("#A63D00", "#ffffff", "!"),
    "no mesh found": ("#48525E", "#ffffff", "∅"),
    "cannot tell": ("#F2C84B", "#1a1a1a", "?"),
}
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_SMALLEST_PROBABILITY = 1e-12


def unit_text(unit: str | None) -> str:
    """Return a unit for an axis: "m/s2" as "m/s²", and plain words where it is unknown.

    Examples
    --------
    >>> unit_text("m/s2"), unit_text(None)
    ('m/s²', 'unit not stated')
    """
    if not unit:
        return "unit not stated"
    return unit.replace("s^2", "s²").replace("s2", "s²").replace(")^2", ")²")


def strip_label(channel: str, unit: str) -> str:
    r"""Return channel and unit in short lines, for the edge of a low picture.

    Examples
    --------
    >>> strip_label("a1", "m/s²"), strip_label("a1", unit_text(None))
    ('a1\n(m/s²)', 'a1\nunit not\nstated')
    """
    shown = unit.replace("not stated", "not\nstated") if unit == unit_text(None) else f"({unit})"
    return f"{shortened(channel, 12)}\n{shown}"


def probability_text(probability: float) -> str:
    """Return a probability to two figures; very small ones as a bound.

    Examples
    --------
    >>> probability_text(0.034), probability_text(2.5e-7), probability_text(0.0)
    ('0.034', '2.5·10⁻⁷', 'below 10⁻¹²')
    """
    if not math.isfinite(probability):
        return "not known"
    if probability < _SMALLEST_PROBABILITY:
        return f"below {power_of_ten(round(math.log10(_SMALLEST_PROBABILITY)))}"
    if probability >= 1e-3:
        return f"{probability:.2g}"
    mantissa, exponent = f"{probability:.1e}".split("e")
    return f"{mantissa}·{power_of_ten(int(exponent))}"


def score_text(score: float) -> str:
    """Return a score to two decimals, without the sign of a zero."""
    return f"{score:.2f}".replace("-0.00", "0.00")


def power_of_ten(exponent: int) -> str:
    """Return a power of ten in text, as "10⁻³"."""
    return f"10{str(exponent).translate(_SUPERSCRIPT)}"


def shortened(text: str, most: int = 16) -> str:
    """Return a text that fits a picture, its middle left out where it is longer than `most`.

    Examples
    --------
    >>> shortened("gearbox_output_bearing_radial", 14)
    'gearbox…radial'
    """
    if len(text) <= most:
        return text
    end = (most - 1) // 2
    return f"{text[: most - 1 - end]}…{text[len(text) - end :]}"


def with_uncertainty(value: float, uncertainty: float, unit: str) -> str:
    """Return a value rounded to two figures of its standard uncertainty.

    Examples
    --------
    >>> with_uncertainty(29.65123, 0.0034, "Hz"), with_uncertainty(29.65, 0.0, "Hz")
    ('29.6512 ± 0.0034 Hz', '29.65 Hz')
    """
    if not math.isfinite(uncertainty) or uncertainty <= 0:
        return f"{value:.6g} {unit}"
    decimals = min(6, max(0, 1 - math.floor(math.log10(uncertainty))))
    if round(uncertainty, decimals) == 0.0:
        return f"{value:.{decimals}f} {unit} (uncertainty below {10.0**-decimals:g})"
    return f"{value:.{decimals}f} ± {uncertainty:.{decimals}f} {unit}"


def percent(share: float, decimals: int = 2, *, signed: bool = False) -> str:
    """Return a share in per cent.

    Examples
    --------
    >>> percent(-0.0105, signed=True), percent(0.03, 0)
    ('−1.05 %', '3 %')
    """
    sign = "+" if signed else ""
    return f"{100 * share:{sign}.{decimals}f} %".replace("-", "−")


def shaft_text(shaft: int | None, gear: str) -> str:
    """Return what repeats with a spacing: a shaft if it has a number, else the member."""
    return f"shaft {shaft}" if shaft else gear


def told_apart(names: Sequence[str], orders: Sequence[float]) -> list[str]:
    """Return names, those that occur more than once with their order of shaft 1 behind.

    Examples
    --------
    >>> told_apart(["shaft 1", "sun", "sun"], [1.0, 0.83, 3.33])
    ['shaft 1', 'sun ×0.83', 'sun ×3.33']
    """
    return [
        name if list(names).count(name) == 1 else f"{name} ×{order:.3g}"
        for name, order in zip(names, orders, strict=True)
    ]


def gear_text(stage: int | None, gear: str | None, tooth: int | None) -> str:
    """Return the place of a finding in words, as "stage 1, pinion, tooth 5"."""
    parts = [f"stage {stage}" if stage else "", gear or "", f"tooth {tooth}" if tooth else ""]
    return ", ".join(part for part in parts if part) or "whole machine"


def loss_text(loss: float | None, low: float | None, high: float | None) -> str:
    """Return an estimated loss of stiffness in per cent with its interval, "" if there is none."""
    if loss is None:
        return ""
    if low is None or high is None:
        return f"{100 * loss:.2g} %"
    return f"{100 * loss:.2g} % ({100 * low:.2g} to {100 * high:.2g} %)"


def printable(text: str) -> str:
    """Return a text without control characters: file names may hold any."""
    return "".join(c if unicodedata.category(c)[0] != "C" else "�" for c in text)


def table_lines(rows: Sequence[Mapping[str, Any]], align: str = "") -> list[str]:
    """Return a table in columns of equal width, two spaces apart.

    Parameters
    ----------
    rows : sequence of mapping
        With the same keys, the headings; see `cell_text`.
    align : str
        One letter a column: "l" for text, "r" for numbers; by default columns of numbers stand to
        the right.

    Returns
    -------
    list of str
        Without line ends.

    Examples
    --------
    >>> table_lines([{"name": "mesh", "Hz": 4.25}])
    ['name    Hz', 'mesh  4.25']
    """
    if not rows:
        return ["(nothing)"]
    names = list(rows[0])
    numbers = [all(isinstance(row[name], int | float | None) for row in rows) for name in names]
    sides = align or "".join("r" if right else "l" for right in numbers)
    everything = [names, *([cell_text(row[name]) for name in names] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*everything, strict=True)]
    return [
        "  ".join(
            cell.rjust(width) if side == "r" else cell.ljust(width)
            for cell, width, side in zip(row, widths, sides, strict=True)
        ).rstrip()
        for row in everything
    ]


def cell_text(value: Any) -> str:
    """Return what a table shows of a value: six figures of a number, nothing for None."""
    if value is None:
        return ""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def template(name: str, package: str = "gearmon.report", **known: Any) -> Template:
    """Return a template of a package; what it names and is not given is an error.

    Parameters
    ----------
    name : str
        Its file.
    package : str
        Where that lies.
    **known
        What it may name beside what all may.
    """
    import jinja2

    environment = jinja2.Environment(
        autoescape=name.endswith(".html"),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals |= {
        "made": datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z"),
        "version": __version__,
        "signs": {verdict: sign for verdict, (_, _, sign) in VERDICT_STYLE.items()},
        "counted": counted,
        "wording": sys.modules[__name__],
        "table": lambda rows: "\n".join(table_lines(rows)),
    }
    return environment.from_string(shipped(name, package), known)


def shipped(name: str, package: str = "gearmon.report") -> str:
    """Return the text of a file that a page is made of."""
    from importlib import resources  # the command line starts without

    return resources.files(package).joinpath(name).read_text("utf-8")


def report_style() -> str:
    """Return the style of reports, with a class for each verdict."""
    colours = [
        f".{verdict.replace(' ', '-')} {{ background: {background}; color: {colour}; }}"
        for verdict, (background, colour, _) in VERDICT_STYLE.items()
    ]
    return "\n".join([shipped("uplot/uPlot.min.css"), shipped("report.css"), *colours])


def chart_script() -> str:
    """Return the script that draws charts, with the library it draws by.

    Who passes a page on passes the library on: its licence goes with it.
    """
    licence = "/*\n" + shipped("uplot/LICENSE").strip() + "\n*/"
    return "\n".join([licence, shipped("uplot/uPlot.iife.min.js"), shipped("charts.js")])


def as_data(charts: dict[str, Any]) -> str:
    """Return charts as JSON in which nothing can end the element that holds it."""
    return json.dumps(charts, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")


def base64_text(content: bytes) -> str:
    """Return bytes as a page holds them."""
    return base64.b64encode(content).decode("ascii")


def digest(text: str) -> str:
    """Return the mark by which a content security policy lets an element through."""
    import hashlib

    return f"sha256-{base64_text(hashlib.sha256(text.encode()).digest())}"
