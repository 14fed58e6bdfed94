from __future__ import annotations

import base64
import re
import subprocess
import sys
from html.parser import HTMLParser

import pytest

from gearmon.errors import ArgumentError
from gearmon.report.html import Failure, write_report
from gearmon.report.text import indicator_definitions


class Page(HTMLParser):
    """Text, images and addresses of a page; raises if tags do not close."""

    VOID = frozenset({"meta", "img", "br", "link", "input"})

    def __init__(self, text):
        super().__init__()
        self.open, self.images, self.addresses, self.text = [], [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.addresses += [values[key] for key in ("href", "src") if key in values]
        if tag == "img":
            self.images.append(values)
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


@pytest.fixture(scope="module")
def written(tmp_path_factory, faulty, healthy):
    path = tmp_path_factory.mktemp("report") / "week 12.html"
    files = write_report(
        [faulty.analysis, healthy.analysis],
        (case.recording for case in (faulty, healthy)),
        faulty.reference,
        faulty.machine,
        path,
        failures=[Failure(recording="bad.csv", message="bad.csv: line 3: not a number")],
    )
    return files, path.read_text("utf-8")


def test_the_page_needs_nothing_else(written):
    page = Page(written[1])
    assert all(a.startswith(("data:image/png;base64,", "#recording-")) for a in page.addresses)
    plain = re.sub(r"base64,[A-Za-z0-9+/=]+", "", written[1])
    # where the drawing library is from stands in its own first line, with its licence above it
    assert "://" not in re.sub(r"/\*! https://\S+ \(v[\d.]+\) \*/", "", plain)
    assert "Permission is hereby granted" in plain
    assert "default-src 'none'" in plain
    assert "unsafe-inline" not in plain
    assert all(len(image["alt"]) > 30 for image in page.images)


def test_pictures_beside_the_page_are_those_in_it(written):
    files, text = written
    assert files[0].name == "week 12.html"
    assert files[1].name == "week 12-01-spectrum.png"
    assert [file.name for file in files if "-02-" in file.name]
    assert sorted(files) == sorted(files[0].parent.iterdir())
    shown = [base64.b64decode(i["src"].split(",")[1]) for i in Page(text).images]
    assert shown == [file.read_bytes() for file in files[1:]]


def test_the_verdict_comes_first_in_words_and_colour(written):
    text = " ".join(Page(written[1]).text)
    assert text.index("Damage of tooth") < text.index("Tooth damage: stage 1, pinion")
    assert text.index("fault") < text.index("Pictures") < text.index("Tables")
    assert "healthy" in text
    assert "bad.csv: line 3: not a number" in text
    assert "#A63D00" in written[1]


def test_names_are_escaped(written):
    assert "<gearbox>" not in written[1]
    assert "bench &lt;gearbox&gt; &amp; co" in written[1]


def test_a_report_on_one_recording_is_small(tmp_path, gearless):
    path = tmp_path / "report.html"
    files = write_report([gearless.analysis], [gearless.recording], None, gearless.machine, path)
    text = path.read_text("utf-8")
    assert [f.name for f in files] == [
        "report.html",
        "report-01-spectrum.png",
        "report-01-searched-mesh-1.png",
    ]
    assert "Overview" not in text
    assert "no mesh found" in text
    assert path.stat().st_size < 1_000_000


def test_a_report_without_a_reference_says_what_that_means(tmp_path, alone):
    path = tmp_path / "report.htm"
    write_report([alone.analysis], [alone.recording], None, alone.machine, path)
    text = " ".join(path.read_text("utf-8").split())
    assert "There is no healthy reference" in text


def test_without_a_recording_the_spectra_are_left_out(tmp_path, healthy):
    path = tmp_path / "report.html"
    files = write_report([healthy.analysis], [None], healthy.reference, healthy.machine, path)
    assert "report-01-changes.png" in [f.name for f in files]
    assert "report-01-spectrum.png" not in [f.name for f in files]


def test_progress_ends_at_one(tmp_path, gearless):
    shares = []
    write_report(
        [gearless.analysis] * 2,
        [gearless.recording] * 2,
        None,
        gearless.machine,
        tmp_path / "report.html",
        progress=shares.append,
    )
    assert shares == [0.5, 1.0]


def test_the_name_must_be_that_of_a_page(tmp_path, gearless):
    with pytest.raises(ArgumentError, match=r"ends in \.html"):
        write_report([gearless.analysis], [None], None, gearless.machine, tmp_path / "report.pdf")


def test_the_folder_must_exist(tmp_path, gearless):
    with pytest.raises(ArgumentError, match="does not exist"):
        write_report([gearless.analysis], [None], None, gearless.machine, tmp_path / "a" / "r.html")


def test_every_analysis_needs_its_recording(tmp_path, gearless):
    with pytest.raises(ArgumentError, match="0 given, fewer than the analyses"):
        write_report([gearless.analysis], [], None, gearless.machine, tmp_path / "r.html")


def test_there_must_be_something_to_report(tmp_path, gearless):
    with pytest.raises(ArgumentError, match="at least one recording"):
        write_report([], [], None, gearless.machine, tmp_path / "r.html")


def table_rows(text, title):
    """The rows of the table below a title: whether each is marked, and its cells."""
    table = text[text.index(f"<h3>{title}") :].split("</table>")[0]
    rows = re.findall(r"<tr( class=\"marked\")?>((?:<td.*?</td>)+)</tr>", table)
    return [(bool(mark), re.findall("<td[^>]*>(.*?)</td>", cells)) for mark, cells in rows]


def test_changes_are_sorted_by_significance(written):
    rows = table_rows(written[1], "Changes, most")
    sizes = [abs(float(cells[-1].replace("−", "-"))) for _, cells in rows]
    assert len(sizes) > 20
    assert sizes == sorted(sizes, reverse=True)
    assert rows[0][0]
    assert not rows[-1][0]


def test_every_indicator_is_defined(written, faulty):
    defined = {name for name, _ in indicator_definitions(faulty.analysis)}
    rows = table_rows(written[1], "Condition indicators")
    assert {cells[0].split(",")[0] for _, cells in rows} == defined


def test_text_and_html_load_no_drawing_until_it_is_needed():
    code = (
        "import sys, gearmon.report.text, gearmon.report.html;"
        "print([m for m in ('matplotlib', 'PIL', 'jinja2', 'pandas') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
