"""Pages: HTML files that need nothing else, made from the templates beside the modules."""

from __future__ import annotations

import base64
import hashlib
import json
from datetime import datetime
from importlib import resources
from typing import TYPE_CHECKING, Any

from gearmon import __version__
from gearmon.report import wording

if TYPE_CHECKING:
    from jinja2 import Template

# Background, text and sign of each verdict: the sign and the word say it without the colour too.
VERDICT_STYLE = {
    "healthy": ("#00664B", "#ffffff", "✓"),
    "fault": ("#A63D00", "#ffffff", "!"),
    "no mesh found": ("#48525E", "#ffffff", "∅"),
    "cannot tell": ("#F2C84B", "#1a1a1a", "?"),
}


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
        "wording": wording,
        "table": lambda rows: "\n".join(wording.table_lines(rows)),
    }
    return environment.from_string(shipped(name, package), known)


def shipped(name: str, package: str = "gearmon.report") -> str:
    """Return the text of a file that a page is made of."""
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
    return f"sha256-{base64_text(hashlib.sha256(text.encode()).digest())}"
