"""The web pages: what they say, who may see them, and in a real browser."""

from __future__ import annotations

import csv
import html
import io
import random
import re
import socket
import threading
import time
from contextlib import closing, contextmanager
from http.client import HTTPConnection
from itertools import product
from operator import itemgetter
from urllib.parse import urlencode

import numpy as np
import pytest
from reference.fleet_stand_in import arrive, at_once, made_fleet

from gearmon.errors import ArgumentError
from gearmon.fleet import alarms, run_fleet

pytest.importorskip("starlette")
TOKEN, HOSTILE = "known-to-few", "<script>window.hurt=1</script>"


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    names = ("a", "b", "c", HOSTILE)
    fleet = made_fleet(folder, names, per_machine='limit = 0.3\ntags = ["maize"]')
    for day in range(12):
        arrive(folder, "a_{}_hay.txt", f"0.{day:02d}", days=day)
        arrive(folder, "b_{}.txt", f"fault 0.{day:02d}" if day > 6 else "0.1", days=day)
        arrive(folder, "c_{}.txt", "bad", days=day)
    run_fleet(fleet, at_once)
    return fleet


class Answer:
    """What a server answers, with redirections left to whoever asks."""

    def __init__(self, address, path, method="GET", **headers):
        connection = HTTPConnection(address)
        connection.request(method, path, headers=headers)
        with closing(connection):
            answer = connection.getresponse()
            self.status, self.headers = answer.status, answer.headers
            self.content = answer.read()
            self.text = self.content.decode("utf-8", "replace")


@contextmanager
def served(fleet, **how):
    """The pages under an address of this computer."""
    uvicorn = pytest.importorskip("uvicorn")
    from gearmon.fleet.pages import application

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    config = uvicorn.Config(application(fleet, **how), port=port, log_level="warning", ws="none")
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run)
    thread.start()
    while not server.started:
        time.sleep(0.05)
    try:
        yield f"127.0.0.1:{port}"
    finally:
        # a test that fails must not leave a server that keeps the tests from ending
        server.should_exit = True
        thread.join()


@pytest.fixture(scope="module")
def address(fleet):
    with served(fleet) as own:
        yield own


def test_the_overview_is_worst_first_and_holds_no_script(address):
    page = Answer(address, "/")
    assert page.status == 200
    text = page.text
    assert text.index("/machine?name=b") < text.index("/machine?name=a")
    assert text.index("/machine?name=a") < text.index("not heard yet</span>")
    assert "<script" not in text
    assert "11 % (9 to 13 %)" in text
    assert "19 % (17 to 21 %)" in text
    assert "script" not in page.headers["content-security-policy"]
    assert "style-src 'self'" in page.headers["content-security-policy"]


def tables(text):
    """Every table of a page as a list of rows, with its headings as keys."""
    for table in re.findall(r"<table.*?</table>", text, re.S):
        head, *rows = (
            [
                html.unescape(re.sub(r"<[^>]+>", "", cell)).strip()
                for cell in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row, re.S)
            ]
            for row in re.findall(r"<tr>(.*?)</tr>", table, re.S)
        )
        yield [dict(zip(head, row, strict=True)) for row in rows]


def test_tables_hold_what_arrived(address):
    """A machine is worn from the eighth day on and another sound; of two nothing was heard."""
    (overview,) = tables(Answer(address, "/").text)
    last = {"Last heard": "2026-03-12 00:00", "Score": ""}
    worn = {
        "Verdict": "! fault",
        "Machine": "b !",
        "Finding": "wear, stage 1, pinion: loss 11.0 %",
        "Since": "2026-03-08 00:00",
        "Loss of stiffness": "11 % (9 to 13 %)",
        "Margin to limit": "19 % (17 to 21 %)",
    }
    nothing = dict.fromkeys([*worn, *last], "")
    sound = nothing | last | {"Verdict": "✓ healthy", "Machine": "a", "Since": "2026-03-01 00:00"}
    unheard = [nothing | {"Verdict": "– not heard yet", "Machine": own} for own in ("c !", HOSTILE)]
    assert overview == [worn | last, sound, *unheard]
    points, recordings = tables(Answer(address, "/machine?name=b").text)
    assert points == [
        {
            "Latest": "! fault",
            "Class": "none named",
            "Recordings": "12",
            "Called a fault": "5",
            "Speed (rpm)": "1500 to 1500",
            "Median score": "0.10",
        }
    ]
    points, recordings_of_a = tables(Answer(address, "/machine?name=a").text)
    keys = ("Latest", "Class", "Recordings", "Called a fault", "Median score")
    # the middle of twelve, 0.055
    assert [points[0][key] for key in keys] == ["✓ healthy", "hay", "12", "0", "0.06"]
    for name, rows in (("a", recordings_of_a), ("b", recordings)):
        listed = csv.DictReader(io.StringIO(Answer(address, f"/table.csv?machine={name}").text))
        for day, row, told in zip(range(12, 0, -1), rows, listed, strict=True):
            fault = name == "b" and day > 7
            score = 4.0 if fault else 0.1 if name == "b" else (day - 1) / 100
            assert row["Verdict"] == ("! fault" if fault else "✓ healthy")
            assert row["Time"] == f"2026-03-{day:02d} 00:00"
            assert row["Class"] == told["class"] == ("hay" if name == "a" else "")
            assert row["Score"] == f"{score:.2f}"
            assert float(told["score"]) == score
            assert row["Finding"] == told["findings"]
            assert row["Finding"].startswith("wear, stage 1, pinion: loss " if fault else "")
            assert bool(row["Finding"]) == fault
            assert told["state"] == "done"
            # as the indicator goes with the number in the file
            number = (day - 1) / 100 if fault or name == "a" else 0.1
            assert float(told["rms, a1"]) == pytest.approx(1.0 + number)
    *_, failed = tables(Answer(address, "/machine?name=c").text)
    assert {row["Verdict"] for row in failed} == {"failed"}
    assert {row["Finding"] for row in failed} == {"cannot be used"}
    listed = list(csv.DictReader(io.StringIO(Answer(address, "/table.csv").text)))
    names = {"verdict": "Verdict", "finding": "Finding", "since": "Since", "heard": "Last heard"}
    names |= {"loss": "Loss of stiffness", "margin": "Margin to limit"}
    for row, told in zip(overview, listed, strict=True):
        assert told["machine"] == row["Machine"].removesuffix(" !")
        assert told["alarm"] == str(row["Machine"].endswith(" !"))
        for key, heading in names.items():
            assert told[key] == row[heading].lstrip("!✓– ")


def test_a_table_has_every_indicator_that_any_of_its_recordings_has(tmp_path):
    fleet = made_fleet(tmp_path, ("a",))
    for day, text in enumerate(("bad", "0.25", "bad")):
        arrive(tmp_path, "a_{}.txt", text, days=day)
    run_fleet(fleet, at_once)
    with served(fleet) as own:
        told = csv.DictReader(io.StringIO(Answer(own, "/table.csv?machine=a").text))
        assert [row["rms, a1"] for row in told] == ["", "1.25", ""]


def test_the_course_of_the_score_fills_its_box_from_the_left_to_the_right(address):
    """Zero lies at the foot, 19 of 20 high; the top, at 1, is a score of 8."""
    drawn = re.findall(r'viewBox="0 0 90 20".*?points="([^"]+)"', Answer(address, "/").text)
    faulty, sound = (np.array([own.split(",") for own in one.split()], float) for one in drawn)
    for course in (faulty, sound):
        np.testing.assert_allclose(course[:, 0], np.linspace(1, 89, 12), atol=0.05)
    np.testing.assert_allclose(sound[:, 1], 19 - 18 * 0.01 * np.arange(12) / 8, atol=0.06)
    np.testing.assert_allclose(faulty[:, 1], [19 - 18 * 0.1 / 8] * 7 + [10] * 5, atol=0.06)


def test_of_many_machines_the_worst_are_shown_and_all_on_demand(tmp_path):
    many = made_fleet(tmp_path, [f"m{number}" for number in range(230)])
    for day in range(2):
        arrive(tmp_path, "m229_{}.txt", "fault 0.1", days=day)
    run_fleet(many, at_once)
    with served(many) as own:
        text = Answer(own, "/").text
        assert text.index("/machine?name=m229") < text.index("/machine?name=m0")
        assert text.count("<tr>") == 201
        assert "230 machines: 229 not heard yet, 1 fault" in text
        assert Answer(own, "/?all=1").text.count("<tr>") == 231


def test_of_faults_the_largest_loss_is_first(tmp_path):
    fleet = made_fleet(tmp_path, ["a", "b", "c"])
    for name, loss in (("a", 0.1), ("b", 0.3), ("c", 0.2)):
        for day in range(8):
            arrive(tmp_path, name + "_{}.txt", f"fault {loss}", days=day)
    run_fleet(fleet, at_once)
    with served(fleet) as own:
        text = Answer(own, "/").text
    table = text[text.index("<tbody") :]
    places = [table.index(f"/machine?name={name}") for name in "bca"]
    assert places == sorted(places)


def test_a_machine_has_a_page_with_its_history(address):
    page = Answer(address, "/machine?name=b")
    assert "wear, stage 1, pinion" in page.text
    assert "since 2026-03-08" in page.text
    assert "1500 to 1500" in re.sub(r"<[^>]+>", "", page.text)  # 25 Hz in turns a minute
    assert Answer(address, "/history.png?name=b").content.startswith(b"\x89PNG")
    table = Answer(address, "/table.csv?machine=b").text
    assert "rms, a1" in table.splitlines()[0]
    assert len(table.splitlines()) == 13
    times = [float(row["time_s"]) for row in csv.DictReader(io.StringIO(table))]
    assert times == sorted(times, reverse=True)  # the newest first
    assert Answer(address, "/table.csv").text.startswith("machine,verdict")
    assert Answer(address, "/machine?name=z").status == 404
    assert Answer(address, "/recording?id=x").status == 404
    assert HOSTILE not in Answer(address, f"/machine?{urlencode({'name': HOSTILE})}").text


def test_a_report_is_that_of_its_recording_and_knows_history_and_limit(fleet, monkeypatch):
    from gearmon.fleet import pages

    told = {}

    def write_report(*given, history):
        told.update(given=given[:4], history=history)
        given[4].write_text("report")

    def judged(machine, file, path):
        return "analysis", (machine.name, file, path), "reference", "machine"

    monkeypatch.setattr(pages, "write_report", write_report)
    monkeypatch.setattr(pages, "judged", judged)
    machine = fleet.machine("b")
    path = str(fleet.store.parent / "inbox" / "b_2026-03-12.txt")
    assert pages._report.__wrapped__(fleet, machine, path, "hash") == "report"
    analyses, recordings, reference, own = told["given"]
    assert (analyses, reference, own) == (["analysis"], "reference", "machine")
    assert recordings == [("b", path, path)]
    assert told["history"].limit == machine.limit == 0.3
    assert told["history"].history.machine == "b"
    assert len(told["history"].history.entries) == 12


def test_machines_come_by_verdict_alarm_loss_and_score_and_tell_their_margin(fleet):
    from gearmon.fleet.pages import _row
    from gearmon.report.text import WORST_FIRST

    known = {"since_s": 0.0, "time_s": 86_400.0, "findings": ["first", "second"], "scores": [1.0]}
    rows = []
    for verdict, alarm, loss, score in product(
        WORST_FIRST, (True, False), (0.25, 0.05, None), (9.0, 2.0)
    ):
        lost = dict.fromkeys(("loss", "loss_low", "loss_high"))
        if loss is not None:
            lost = {"loss": loss, "loss_low": loss - 0.02, "loss_high": loss + 0.04}
        latest = known | lost | {"verdict": verdict, "score": score}
        # the worst are made first
        rows.append(_row(fleet.machine("b"), latest, alarm))
    mixed = random.Random(3).sample(rows, len(rows))
    assert sorted(mixed, key=itemgetter("urgency")) == rows
    silent = _row(fleet.machine("b"), None, alarm=True)
    assert silent["urgency"] > rows[-1]["urgency"]
    first, *_ = rows
    assert (first["since"], first["heard"]) == ("1970-01-01 00:00", "1970-01-02 00:00")
    assert (first["finding"], first["loss"]) == ("first", "25 % (23 to 29 %)")
    # of a limit of 30 %
    assert first["margin"] == "5 % (1 to 7 %)"
    assert {row["margin"] for row in rows if not row["loss"]} == {""}


def test_beside_others_what_differs_most_is_shown(fleet, monkeypatch):
    from gearmon.fleet import pages

    rows = [{"machine": "ab"[n % 2], "indicator": f"{n}"} for n in range(16)]
    monkeypatch.setattr(pages, "compare", lambda *_: rows)
    shown = pages._beside.__wrapped__(fleet, fleet.machine("b"), 0)
    assert [row["indicator"] for row in shown] == ["1", "3", "5", "7", "9"]

    def too_few(*_):
        raise ArgumentError("too few others")

    monkeypatch.setattr(pages, "compare", too_few)
    assert pages._beside.__wrapped__(fleet, fleet.machine("b"), 0) == []


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "192.168.1.9"])
@pytest.mark.parametrize("token", ["", TOKEN])
def test_on_other_addresses_than_those_of_this_computer_a_token_is_asked_for(
    fleet, monkeypatch, capsys, host, token
):
    from gearmon.fleet import pages

    asked = {}
    monkeypatch.setattr(pages.uvicorn, "run", lambda app, **how: asked.update(how, app=app))
    monkeypatch.setattr(pages, "application", lambda *_, **how: how)
    pages.serve(fleet, host, 8123, token)
    own = host in ("127.0.0.1", "localhost")
    assert (asked["host"], asked["port"]) == (host, 8123)
    given = asked["app"]["token"]
    assert bool(given) == (not own or bool(token))
    assert token in ("", given)
    assert len(given) >= 12 or not given
    query = f"?token={given}" if given else ""
    assert f"http://{host}:8123/{query} " in capsys.readouterr().out
    known = ("127.0.0.1", "localhost", "::1") if own else ("*",)
    assert tuple(asked["app"]["hosts"]) == known


def test_what_cannot_be_shown_is_said_in_plain_letters(address, monkeypatch):
    from gearmon.fleet import pages

    def refused(*_):
        raise ArgumentError("a\x1b[2Jb: no such file")

    monkeypatch.setattr(pages._Site, "_named", refused)
    answer = Answer(address, "/machine?name=a")
    assert answer.status == 404
    assert answer.text.rstrip("\n").isprintable()
    assert answer.text.endswith("b: no such file\n")


@pytest.mark.parametrize(
    "path", ["/", "/machine?name=b", "/table.csv", "/fleet.css", "/charts.js", "/machine?name=z"]
)
def test_no_page_lets_others_in(address, path):
    told = Answer(address, path).headers
    policy = dict(own.split(" ", 1) for own in told["content-security-policy"].split("; "))
    assert policy["default-src"] == policy["base-uri"] == policy["frame-ancestors"] == "'none'"
    assert set(policy.values()) <= {"'none'", "'self'"}
    assert ("script-src" in policy) == (path == "/machine?name=b")
    assert told["x-content-type-options"] == "nosniff"
    assert told["referrer-policy"] == "same-origin"


def test_an_alarm_is_acknowledged_by_its_own_page_only(address, fleet):
    (number,) = (own["id"] for own in alarms(fleet, "b"))
    path = f"/acknowledge?id={number}&machine=b"
    assert Answer(address, path, "POST").status == 403
    assert Answer(address, path, "POST", Origin="http://evil.example").status == 403
    answer = Answer(address, path, "POST", Origin=f"http://{address}")
    assert answer.status == 303
    assert answer.headers["location"] == "/machine?name=b"
    assert alarms(fleet, "b")[0]["acknowledged"]
    assert "acknowledged" in Answer(address, "/").text


def test_other_names_and_those_without_the_token_are_refused(address, fleet):
    assert Answer(address, "/", Host="evil.example").status == 400
    with served(fleet, token=TOKEN, hosts=["*"]) as guarded:
        assert Answer(guarded, "/").status == 403
        assert Answer(guarded, "/?token=wrong").status == 403
        known = Answer(guarded, f"/?token={TOKEN}&all=1")
        assert (known.status, known.headers["location"]) == (303, f"http://{guarded}/?all=1")
        cookie = known.headers["set-cookie"]
        assert "HttpOnly" in cookie
        # other sites cannot send it along
        assert "SameSite=strict" in cookie
        assert Answer(guarded, "/", Cookie=cookie.partition(";")[0]).status == 200
        assert Answer(guarded, "/", Cookie="gearmon=wrong").status == 403


@pytest.mark.browser
@pytest.mark.parametrize("width", [400, 1280])
@pytest.mark.parametrize("place", ["/", "/machine?name=b"])
def test_pages_fit_the_window_and_the_console_is_silent(browser, address, width, place):
    looked_at(browser, address, width, place)


def looked_at(browser, address, width, place):
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    browser.get(f"http://{address}{place}")
    root = "document.documentElement"
    assert browser.execute_script(f"return {root}.scrollWidth <= {root}.clientWidth")
    assert browser.execute_script("return window.hurt") is None
    assert "rgb" in browser.find_element("css selector", ".fault").value_of_css_property("color")
    assert [own for own in browser.get_log("browser") if "favicon" not in own["message"]] == []


@pytest.mark.browser
def test_the_history_of_a_machine_is_zoomed_into_and_told_with_intervals(browser, address):
    looked_at(browser, address, 1280, "/machine?name=b")
    browser.execute_script("document.getElementById('history-history-loss').scrollIntoView()")
    plot = "document.getElementById('history-history-loss').plot"
    until(lambda: browser.execute_script(f"return {plot} !== undefined"))
    span = f"return {plot}.scales.x.max - {plot}.scales.x.min"
    whole = browser.execute_script(span)
    host = browser.find_element("id", "history-history-loss")
    host.find_element("css selector", "button[title='Zoom in']").click()
    until(lambda: browser.execute_script(span) < 0.6 * whole)
    host.find_element("css selector", "button[title='Next line']").click()
    told = host.find_element("css selector", ".readout")
    until(lambda: "trend" in told.text)
    assert re.search(r"this recording \d+ \(\d+ to \d+\)", told.text)
    (points,) = [t for t in browser.find_elements("css selector", "table") if "Speed" in t.text]
    assert "1500 to 1500" in points.text


def until(true):
    waited = 0.0
    while not true():
        assert waited < 10.0
        time.sleep(0.05)
        waited += 0.05


@pytest.mark.browser
def test_a_click_acknowledges(browser, address, fleet):
    from selenium.common.exceptions import StaleElementReferenceException
    from selenium.webdriver.support.ui import WebDriverWait

    browser.get(f"http://{address}/machine?name=c")
    assert [own["finding"] for own in alarms(fleet, "c")] == ["not analysed"]
    browser.find_element("css selector", "form button").click()
    # the page is loaded anew; what was found on the old one may be gone
    shown = WebDriverWait(browser, 20, ignored_exceptions=[StaleElementReferenceException])
    shown.until(lambda page: "acknowledged" in page.find_element("css selector", ".flag").text)
    assert alarms(fleet, "c")[0]["acknowledged"]
