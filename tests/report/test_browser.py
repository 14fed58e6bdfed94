"""The report in a real browser, as its readers have it. Skipped where there is none."""

from __future__ import annotations

from base64 import b64decode
from dataclasses import replace
from itertools import pairwise

import pytest
from report.conftest import SPEED_HZ, TEETH, gear_machine, made

from gearmon.diagnosis.analysis import analyse, learn
from gearmon.report.html import Failure, write_report

pytestmark = pytest.mark.browser

HOSTILE = "</script><script>window.hurt=1</script><img src=x onerror='window.hurt=1'>"


@pytest.fixture(scope="module")
def page(tmp_path_factory, faulty):
    path = tmp_path_factory.mktemp("browser") / "report.html"
    write_report([faulty.analysis], [faulty.recording], faulty.reference, faulty.machine, path)
    return path


def test_the_file_is_small_enough_to_mail(page):
    assert page.stat().st_size < 1.2e6


@pytest.fixture
def opened(browser, page):
    return at_width(browser, page, 1280)


def at_width(browser, page, width):
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    browser.get(page.as_uri())
    return browser


def chart(browser, name):
    """A chart, drawn: it is when it comes near the window."""
    from selenium.webdriver.support.ui import WebDriverWait

    host = browser.find_element("id", f"recording-1-{name}")
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", host)
    drawn = "return Boolean(arguments[0].plot)"
    WebDriverWait(browser, 20).until(lambda own: own.execute_script(drawn, host))
    return host


def pointed(browser, host, place, share=0.5):
    """What a chart says where the mouse points at a place of its axis."""
    from selenium.webdriver import ActionChains

    over = host.find_element("css selector", ".u-over")
    left = browser.execute_script(
        "return arguments[0].plot.valToPos(arguments[1], 'x')", host, place
    )
    width, height = over.size["width"], over.size["height"]
    move = ActionChains(browser, duration=0)
    move.move_to_element_with_offset(over, round(left - width / 2), round((share - 0.5) * height))
    move.perform()
    return host.find_element("css selector", ".readout").text


def shown(browser, host):
    scale = "const {min, max} = arguments[0].plot.scales.x; return [min, max]"
    return browser.execute_script(scale, host)


def test_pointing_names_the_line_and_its_level_against_healthy(opened, faulty):
    mesh_hz = faulty.analysis.signature.meshes[0].frequency_hz
    assert mesh_hz == pytest.approx(TEETH[0] * SPEED_HZ, rel=1e-3)
    for name, place in (("spectrum", 2 * mesh_hz), ("orders", 2.0 * TEETH[0])):
        said = pointed(opened, chart(opened, name), place)
        assert "Nearest line: mesh 1 harmonic 2 " in said
        assert f"order {2 * TEETH[0]})" in said
        assert "front: " in said
        assert "healthy recordings" in said
        assert "dB against healthy" in said


def test_sidebands_are_named_once_they_are_switched_on(opened):
    host = chart(opened, "orders")
    labels = host.find_elements("css selector", ".switches label")
    next(own for own in labels if own.text == "sidebands of shaft 1").click()
    pick = host.find_element("css selector", "select")
    next(own for own in pick.find_elements("tag name", "option") if "ic 3" in own.text).click()
    low, high = shown(opened, host)
    assert (low, high) == pytest.approx((3 * TEETH[0] - 7, 3 * TEETH[0] + 7))
    said = pointed(opened, host, 3 * TEETH[0] + 2)
    assert "sidebands of shaft 1 around mesh 1 harmonic 3, +2" in said


def test_a_drag_a_button_and_a_key_zoom(opened):
    from selenium.webdriver import ActionChains, Keys

    host = chart(opened, "spectrum")
    low, high = shown(opened, host)
    over = host.find_element("css selector", ".u-over")
    drag = ActionChains(opened).move_to_element_with_offset(over, -100, 0).click_and_hold()
    drag.move_by_offset(120, 0).release().perform()
    left, right = shown(opened, host)
    assert low < left < right < high
    host.find_element("css selector", "[title='Show all']").click()
    assert shown(opened, host) == [low, high]
    host.find_element("css selector", ".chart").send_keys("+")
    assert shown(opened, host)[1] - shown(opened, host)[0] == pytest.approx((high - low) / 2)
    host.find_element("css selector", ".chart").send_keys(Keys.ARROW_RIGHT)
    assert "Nearest line: mesh 1" in host.find_element("css selector", ".readout").text


def test_channels_are_switched(opened):
    host = chart(opened, "spectrum")
    mesh_hz = TEETH[0] * SPEED_HZ
    assert "rear" in pointed(opened, host, mesh_hz)
    labels = host.find_elements("css selector", ".switches label")
    next(own for own in labels if own.text == "rear").click()
    assert "rear" not in pointed(opened, host, mesh_hz)


def test_the_flagged_tooth_stands_out_in_its_chart(opened, faulty):
    tooth = faulty.analysis.flags[0].tooth
    host = chart(opened, "teeth-1-pinion")
    low, high = shown(opened, host)
    assert high - low == pytest.approx(TEETH[0])  # whole bars at both ends
    said = pointed(opened, host, tooth)
    assert f"Tooth {tooth} of {TEETH[0]}: energy" in said
    said = pointed(opened, chart(opened, "map"), TEETH[0])
    assert "mesh 1 harmonic 1" in said


def test_tables_sort_by_a_click(opened):
    for details in opened.find_elements("css selector", "details.evidence"):
        opened.execute_script("arguments[0].open = true", details)
    table = opened.find_element("css selector", "table.changes")
    column = ".//tbody/tr/td[7]"
    for expected in (lambda own: sorted(own, reverse=True), sorted):
        table.find_element("xpath", ".//th[7]/button").click()
        cells = [own.text for own in table.find_elements("xpath", column)]
        values = [float(own.replace("−", "-")) for own in cells]
        assert values == expected(values)


@pytest.mark.parametrize("width", [400, 1280])
def test_the_page_fits_the_window_and_the_console_is_silent(browser, page, width):
    own = at_width(browser, page, width)
    for name in ("spectrum", "orders", "map", "turn-1-pinion", "teeth-1-gear"):
        chart(own, name)
    root = "return document.documentElement"
    wide = own.execute_script(f"{root}.scrollWidth <= {root[7:]}.clientWidth")
    assert wide
    assert own.get_log("browser") == []


def test_the_charts_take_a_browser_less_than_a_second(opened):
    opened.execute_cdp_cmd("Performance.enable", {})
    opened.refresh()
    chart(opened, "spectrum")
    metrics = opened.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]
    # what the page costs, not what else the machine does
    assert {own["name"]: own["value"] for own in metrics}["TaskDuration"] < 1.0


CONTRAST = """
const shade = (text) => text.match(/[\\d.]+/g).map(Number);
const light = ([r, g, b]) => [r, g, b].map((v) => v / 255)
  .map((v) => (v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4))
  .reduce((sum, v, k) => sum + v * [0.2126, 0.7152, 0.0722][k], 0);
const behind = (own) => {
  for (; own; own = own.parentElement) {
    const found = shade(getComputedStyle(own).backgroundColor);
    if (found.length < 4 || found[3] > 0) return found;
  }
  return [255, 255, 255];
};
return [...document.querySelectorAll("body *")].filter((own) => own.checkVisibility()
    && [...own.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim()))
  .map((own) => {
    const one = light(shade(getComputedStyle(own).color)), other = light(behind(own));
    const ratio = (Math.max(one, other) + 0.05) / (Math.min(one, other) + 0.05);
    return [own.tagName + ": " + own.textContent.trim().slice(0, 40), ratio];
  }).filter(([, ratio]) => ratio < 4.5);
"""


def opened_wide(browser):
    for details in browser.find_elements("css selector", "details"):
        browser.execute_script("arguments[0].open = true", details)


def test_letters_stand_out_and_pictures_have_words(opened):
    chart(opened, "spectrum")
    opened_wide(opened)
    assert opened.execute_script(CONTRAST) == []  # 4.5 to 1, as WCAG 2.1 asks (AA)
    pictures = opened.find_elements("css selector", "img")
    assert len(pictures) > 5
    assert all(len(own.get_attribute("alt")) > 20 for own in pictures)


def test_the_tab_key_goes_down_the_page_and_everything_it_reaches_has_a_name(opened):
    from selenium.webdriver import ActionChains, Keys

    chart(opened, "spectrum")
    opened_wide(opened)
    focus = "return document.activeElement"
    reached = []
    for _ in range(25):
        ActionChains(opened).send_keys(Keys.TAB).perform()
        own = opened.execute_script(focus)
        assert own.accessible_name, own.get_attribute("outerHTML")[:200]
        assert (
            opened.execute_script("return getComputedStyle(arguments[0]).outlineStyle", own)
            != "none"
        )
        reached.append(own)
    after = "return Boolean(arguments[0].compareDocumentPosition(arguments[1]) & 4)"
    pairs = pairwise(reached)
    assert all(opened.execute_script(after, one, other) for one, other in pairs)
    assert opened.find_elements("css selector", "[tabindex]:not([tabindex='0'])") == []


def test_paper_shows_the_pictures_and_no_charts(opened):
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    try:
        assert not opened.find_element("css selector", ".charts").is_displayed()
    finally:
        opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
    printed = opened.execute_cdp_cmd("Page.printToPDF", {"printBackground": True})
    pictures = len(opened.find_elements("css selector", ".picture img"))
    assert b64decode(printed["data"]).count(b"/Subtype /Image") >= pictures > 5


def test_hostile_names_are_only_letters(browser, tmp_path):
    recordings = [replace(made(seed), channel_names=(HOSTILE, "b")) for seed in (1, 2, 7)]
    machine = replace(gear_machine(), name=HOSTILE)
    reference = learn(recordings[:2], machine)
    recording = replace(recordings[2], origin=HOSTILE)
    analysis = analyse(recording, machine, reference)
    path, failure = tmp_path / "report.html", Failure(recording=HOSTILE, message=HOSTILE)
    write_report([analysis], [recording], reference, machine, path, failures=[failure])
    own = at_width(browser, path, 1280)
    said = pointed(own, chart(own, "spectrum"), TEETH[0] * SPEED_HZ)
    assert "<img" in said
    assert "<img" in own.find_element("tag name", "h1").text
    assert own.execute_script("return window.hurt") is None
    assert own.get_log("browser") == []
