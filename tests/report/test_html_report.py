from __future__ import annotations

import base64
import json
import re
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from gearmon.errors import ArgumentError
from gearmon.report.html import Failure, _Charts, write_report
from gearmon.report.text import indicator_definitions
from gearmon.signatures.tracking import SPEED_REACH


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


def test_the_settings_are_those_of_machine_and_analysis(written, faulty):
    text = " ".join(" ".join(Page(written[1]).text).split())
    signature, speed = faulty.analysis.signature, faulty.analysis.signature.speed
    assert "Operating points 1200 rpm, 100 N·m " in text
    assert f"Length {signature.duration_s:.4g} s at 4096 Hz " in text
    assert "Channels front (m/s²), rear (" in text
    assert f"Reference {'; '.join(faulty.reference.origins)} " in text
    blocks, lines = signature.lines.amplitude.shape[::2]
    assert f"{blocks} half-overlapped Hann blocks" in text
    assert f"{lines} lines in {len(signature.plan.families)} families" in text
    (mesh,) = signature.meshes
    assert f"1 {23 * speed.estimated_hz:.3f} yes {mesh.snr_db:.1f} {mesh.score:.1f} " in text


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
    with pytest.raises(ArgumentError, match="cannot write there"):
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


@pytest.fixture
def undrawn(monkeypatch):
    """Without pictures, which take longer than all the rest of a page."""
    monkeypatch.setattr("gearmon.report.analysis_plots.analysis_figures", lambda *_: [])


def chart_data(text, anchor="recording-1"):
    """What the page hands to its charts of a recording, and each chart by its name."""
    told = re.search(r'<script type="application/json" id="chart-data">(.*?)</script>', text, re.S)
    own = json.loads(told[1])[anchor]
    return own, {chart["name"]: chart for chart in own["charts"]}


def decoded(values, kind="<f4"):
    return np.frombuffer(base64.b64decode(values), dtype=kind).astype(float)


def test_the_charts_hold_what_was_measured_and_the_range_of_the_healthy(written, faulty):
    signature, reference = faulty.analysis.signature, faulty.reference
    data, _ = chart_data(written[1])
    lines = data["lines"]
    assert data["speed_hz"] == signature.speed.estimated_hz
    assert [own["name"] for own in data["channels"]] == ["front", "rear"]
    for row in range(2):
        measured, low, high = (decoded(lines[name][row]) for name in ("measured", "low", "high"))
        for k in range(1, 5):
            at = lines["order"].index(23.0 * k)
            line = int(np.argmin(np.abs(signature.plan.orders - 23.0 * k)))
            assert measured[at] == pytest.approx(abs(signature.lines.mean[row, line]), rel=1e-6)
            healthy = [
                abs(wheel.amplitude[row, number])
                for profile in reference.profiles
                for wheel in profile.wheels
                for number in np.flatnonzero(np.isclose(wheel.number * wheel.order, 23.0 * k))
            ]
            assert len(healthy) == 2 * len(reference.profiles)
            assert low[at] == pytest.approx(min(healthy), rel=1e-6)
            assert high[at] == pytest.approx(max(healthy), rel=1e-6)
            assert low[at] < high[at]
        # wherever a healthy recording tells, the first line as any other
        tells = {
            round(float(own), 6)
            for profile in reference.profiles
            for wheel in profile.wheels
            for own in wheel.number * wheel.order
        }
        ranged = [round(own, 6) in tells for own in lines["order"]]
        assert np.isfinite(low).tolist() == np.isfinite(high).tolist() == ranged
        assert ranged[0]


#: Title, axis and value of charts by their names.
SAID = {
    "spectrum": ("Amplitude spectrum", "Frequency (Hz)", "Peak amplitude"),
    "orders": ("Order spectrum", "Order (cycles a turn of shaft 1)", "Peak amplitude"),
    "map": (
        "Order map: an upright line turns with a shaft, a slanting one does not",
        "Order (cycles a turn of shaft 1)",
        "Time (s)",
    ),
    "turn-1-pinion": (
        "One turn of the pinion of stage 1, averaged",
        "Tooth",
        "Average over the turns",
    ),
    "turn-1-gear": ("One turn of the gear of stage 1, averaged", "Tooth", "Average over the turns"),
    "teeth-1-pinion": (
        "Energy by tooth of the pinion of stage 1: sound teeth stand at about 1",
        "Tooth",
        "Energy",
    ),
    "teeth-1-gear": (
        "Energy by tooth of the gear of stage 1: sound teeth stand at about 1",
        "Tooth",
        "Energy",
    ),
}


def test_every_chart_says_what_it_shows(written):
    data, charts = chart_data(written[1])
    assert {n: (c["title"], c["axis"], c["value"]) for n, c in charts.items()} == SAID
    # of what has the unit of a channel, that is told with the channel
    vibrates = {name for name, chart in charts.items() if chart.get("vibration")}
    assert vibrates == {"spectrum", "orders", "turn-1-pinion", "turn-1-gear"}
    assert [own["unit"] for own in data["channels"]] == ["m/s²", "unit not stated"]


def test_spectra_in_charts_are_amplitudes_of_the_recording(written, faulty):
    """Where a spectrum is drawn line by line it is that of one Hann window; up to its end."""
    recording = faulty.recording.vibration()
    window = np.hanning(recording.samples.shape[1] + 1)[:-1]
    lines = 2 * np.abs(np.fft.rfft(recording.samples * window)) / window.sum()
    chart = chart_data(written[1])[1]["spectrum"]
    x = decoded(chart["x"])
    at = np.rint(x * recording.duration_s).astype(int)
    for row, curve in enumerate(chart["curves"]):
        values = decoded(curve["values"])
        # the largest of some neighbours is kept, those of both channels at one place
        assert (values >= (1 - 1e-5) * lines[row, at]).all()
        assert values.max() == pytest.approx(lines[row, 2:].max(), rel=1e-5)
        assert curve["layer"] == "measured"
    assert x[0] < 3 / recording.duration_s
    assert x[-1] == pytest.approx(recording.sampling_rate_hz / 2, rel=0.01)


@pytest.mark.usefixtures("undrawn")
def test_healthy_channels_are_found_by_their_names(tmp_path, written, faulty):
    reference = faulty.reference
    turned = replace(
        reference,
        channel_names=reference.channel_names[::-1],
        profiles=tuple(
            replace(
                profile,
                wheels=tuple(replace(w, amplitude=w.amplitude[::-1]) for w in profile.wheels),
            )
            for profile in reference.profiles
        ),
    )
    path = tmp_path / "turned.html"
    write_report([faulty.analysis], [None], turned, faulty.machine, path)
    known, found = (chart_data(text)[0]["lines"] for text in (written[1], path.read_text("utf-8")))
    assert (found["low"], found["high"]) == (known["low"], known["high"])


def test_the_chart_of_the_speeds_covers_the_search_and_marks_what_was_found(tmp_path, gearless):
    path = tmp_path / "report.html"
    write_report([gearless.analysis], [gearless.recording], None, gearless.machine, path)
    speed = gearless.analysis.signature.speed
    assert speed.estimated_hz != pytest.approx(speed.nominal_hz, rel=1e-3)
    chart = chart_data(path.read_text("utf-8"))[1]["speed"]
    assert chart["marked"] == pytest.approx(60 * speed.estimated_hz)
    rpm, fit = decoded(chart["x"]), decoded(chart["curves"][0]["values"])
    assert np.all(np.diff(rpm) > 0)
    reach = 60 * speed.nominal_hz * np.array([1 - SPEED_REACH, 1 + SPEED_REACH])
    assert rpm[[0, -1]] == pytest.approx(reach, rel=0.01)
    assert fit.min() >= 0
    assert len(fit) == len(rpm)


def test_spectra_in_the_charts_peak_at_the_mesh(written, faulty):
    signature, (_, charts) = faulty.analysis.signature, chart_data(written[1])
    line = int(np.argmin(np.abs(signature.plan.orders - 23.0)))
    for name, place in (("spectrum", signature.meshes[0].frequency_hz), ("orders", 23.0)):
        x = decoded(charts[name]["x"])
        assert charts[name]["scale"] * 23.0 == pytest.approx(place)
        for row, curve in enumerate(charts[name]["curves"]):
            values = decoded(curve["values"])
            near = np.abs(x - place) < 0.02 * place
            assert curve["channel"] == row
            # between two bins a Hann window reads up to 15 % too low
            size = abs(signature.lines.mean[row, line])
            assert values[near].max() == pytest.approx(size, rel=0.16)
            assert x[near][values[near].argmax()] == pytest.approx(place, rel=2e-3)


def test_the_order_map_is_in_shades_of_its_highest_value(written, faulty):
    _, charts = chart_data(written[1])
    chart, signature = charts["map"], faulty.analysis.signature
    orders = decoded(chart["x"])
    assert chart["time"][0] == pytest.approx(0.0, abs=0.5)
    assert chart["time"][1] == pytest.approx(8.0, abs=0.5)
    for told in chart["maps"]:
        shades = decoded(told["shades"], "u1").reshape(chart["rows"], len(orders))
        assert (shades.min(), shades.max()) == (0.0, 255.0)
        for order in (23.0, 46.0, 69.0):
            line = int(np.argmin(np.abs(signature.plan.orders - order)))
            size = abs(signature.lines.mean[told["channel"], line])
            column = shades[:, np.searchsorted(orders, order, side="right") - 1].max()
            # 255 at the highest value, 0 so many decades below
            level = told["top"] * 10 ** (told["decades"] * (column / 255 - 1))
            assert level == pytest.approx(size, rel=0.25)


def test_a_turn_and_the_energy_by_tooth_are_those_of_the_analysis(written, faulty):
    _, charts = chart_data(written[1])
    analysis = faulty.analysis
    (flag,) = [own for own in analysis.flags if own.kind == "tooth damage"]
    for profile in analysis.profiles:
        chart = charts[f"teeth-{profile.stage}-{profile.gear}"]
        teeth, energy = decoded(chart["x"]), decoded(chart["curves"][0]["values"])
        assert np.all(np.diff(teeth) > 0)
        assert sorted(energy) == pytest.approx(sorted(profile.energy), rel=1e-6)
        flagged = profile.gear == flag.gear
        assert (chart["marked"] is not None) == flagged
        if flagged:
            assert abs(chart["marked"] - teeth[energy.argmax()]) <= 1.0
            assert abs(chart["marked"] - flag.tooth) <= 1.0
        turn = charts[f"turn-{profile.stage}-{profile.gear}"]
        _, step, count = turn["even"]
        assert step * count == pytest.approx(profile.teeth)
        plan = next(w for w in analysis.signature.plan.wheels if w.gear == profile.gear)
        lines = analysis.signature.lines.mean[:, plan.lines]
        for curve in turn["curves"]:
            if curve["layer"] == "healthy":
                continue
            wave = curve["top"] / 32_767 * decoded(curve["values"], "<i2")
            assert len(wave) == count
            # Parseval: half the squares of the lines it is the sum of
            taken = ~plan.mesh | (curve["layer"] == "with the mesh")
            expected = 0.5 * np.sum(np.abs(lines[curve["channel"], taken]) ** 2)
            assert np.mean(wave**2) == pytest.approx(expected, rel=2e-3)


def test_the_healthy_turn_is_that_of_like_loudness_turned_until_it_fits(written, faulty):
    _, charts = chart_data(written[1])
    signature = faulty.analysis.signature
    for plan in signature.plan.wheels:
        drawn = {
            (curve["layer"], curve["channel"]): curve["top"]
            / 32_767
            * decoded(curve["values"], "<i2")
            for curve in charts[f"turn-{plan.stage}-{plan.gear}"]["curves"]
        }
        healthy, rest = (
            np.array([drawn[layer, row] for row in range(2)])
            for layer in ("healthy", "without the mesh")
        )
        fits = [np.sum(np.roll(healthy, k, axis=1) * rest) for k in range(healthy.shape[1])]
        assert fits[0] >= max(fits) - 1e-3 * abs(max(fits))
        loud = np.abs(signature.lines.mean[:, plan.lines]).sum()
        known = [
            wheel
            for profile in faulty.reference.profiles
            for wheel in profile.wheels
            if (wheel.stage, wheel.gear) == (plan.stage, plan.gear)
        ]
        near = min(known, key=lambda wheel: abs(np.abs(wheel.amplitude).sum() - loud))
        power = 0.5 * np.sum(np.abs(near.amplitude[:, ~near.mesh]) ** 2, axis=1)
        np.testing.assert_allclose(np.mean(healthy**2, axis=1), power, rtol=2e-3)


@pytest.mark.usefixtures("undrawn")
def test_how_the_reference_was_turned_does_not_show(tmp_path, written, faulty):
    """Its patterns by some steps of the charts: the healthy turn is put where it fits."""
    known = chart_data(written[1])[1]

    def turned(wheel, steps=17):
        angle = steps / known[f"turn-{wheel.stage}-{wheel.gear}"]["even"][2]
        return replace(wheel, amplitude=wheel.amplitude * np.exp(2j * np.pi * wheel.number * angle))

    profiles = tuple(
        replace(profile, wheels=tuple(map(turned, profile.wheels)))
        for profile in faulty.reference.profiles
    )
    path, reference = tmp_path / "turned.html", replace(faulty.reference, profiles=profiles)
    write_report([faulty.analysis], [None], reference, faulty.machine, path)
    found = chart_data(path.read_text("utf-8"))[1]
    names = [name for name in known if name.startswith("turn-")]
    assert len(names) == 2
    for name in names:
        for one, other in zip(known[name]["curves"], found[name]["curves"], strict=True):
            waves = [own["top"] * decoded(own["values"], "<i2") / 32_767 for own in (one, other)]
            np.testing.assert_allclose(*waves, atol=1e-3 * one["top"])


def test_lines_of_the_charts_are_told_by_family_number_and_change(written, faulty):
    lines, analysis = chart_data(written[1])[0]["lines"], faulty.analysis
    families = analysis.signature.plan.families
    assert [own["name"] for own in lines["families"]] == [own.name for own in families]
    changes = {(own.family, own.channel): own for own in analysis.changes}
    told = 0
    for own in lines["families"]:
        for channel, change in zip(("front", "rear"), own["changes"], strict=True):
            known = changes.get((own["name"], channel))
            assert (change is None) == (known is None)
            if known is not None:
                assert change == [known.change_db, known.scatter_db]
                told += 1
    assert told > 5
    for order, number, index in zip(lines["order"], lines["number"], lines["family"], strict=True):
        family = families[index]
        if family.kind == "sidebands":
            assert order == pytest.approx(23.0 * family.harmonic + number * family.spacing)
        elif family.kind == "mesh":
            assert (order, number) == (pytest.approx(23.0 * family.harmonic), 0)
    kinds = [group.split()[0] for group in lines["groups"]]
    assert kinds == sorted(kinds, key=["mesh", "sidebands", "other"].index)
    assert lines["groups"][0] == "mesh 1"
    assert {own["group"] for own in lines["families"]} == set(lines["groups"])


@pytest.mark.usefixtures("undrawn")
def test_places_where_no_mesh_was_found_are_those_at_the_nominal_speed(tmp_path, gearless):
    path = tmp_path / "report.html"
    write_report([gearless.analysis], [gearless.recording], None, gearless.machine, path)
    data, _ = chart_data(path.read_text("utf-8"))
    lines, nominal = data["lines"], gearless.analysis.signature.speed.nominal_hz
    assert data["speed_hz"] != pytest.approx(nominal, rel=1e-3)
    hertz = data["speed_hz"] * np.array(lines["order"])
    assert len(hertz) > 2
    np.testing.assert_allclose(hertz, 23.0 * nominal * np.arange(1, len(hertz) + 1))
    assert [own["name"] for own in lines["families"]][:2] == ["GMF1 ×1", "GMF1 ×2"]


@pytest.mark.usefixtures("undrawn")
def test_curves_of_several_recordings_share_the_points_of_one_down_to_an_eighth(tmp_path, gearless):
    points = {}
    for count in (1, 2, 10):
        path = tmp_path / f"{count}.html"
        given = [gearless.analysis] * count, [gearless.recording] * count
        write_report(*given, None, gearless.machine, path)
        points[count] = len(decoded(chart_data(path.read_text("utf-8"))[1]["spectrum"]["x"]))
    assert 1000 < points[1] <= 4096
    for count, shared in points.items():
        assert shared == pytest.approx(points[1] / min(count, 8), rel=0.05)


def test_a_silent_channel_has_a_place_on_a_scale_of_logarithms(healthy):
    charts = _Charts(healthy.analysis, None, None, healthy.machine, 500)
    values = np.array([np.linspace(0.0, 2.0, 400), np.zeros(400)])
    chart = charts._spectrum("spectrum", "Hz", 1.0, np.arange(400.0), values)
    loud, silent = (decoded(curve["values"]) for curve in chart["curves"])
    assert (silent > 0).all()
    assert silent.max() <= 1e-6 * loud.max()
    assert (loud > 0).all()
