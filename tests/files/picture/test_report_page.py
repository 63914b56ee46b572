"""The page of `report` in headless Chromium: no error, no request, names and contrast are right, keys sort.

Skipped where there is no Chromium with its driver (Debian: chromium, chromium-driver); `.ci/run` installs them.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import dvtcli
from tests.process import ROOT

BROWSER, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
ALONE = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage",
)  # fmt: skip
#: width in pixels, and colours, of the screens that are looked at
SCREENS = ((1280, "light"), (1280, "dark"), (400, "light"), (400, "dark"))
PATIENCE_S = 120.0
FITS = "const page = document.documentElement; return page.scrollWidth <= page.clientWidth"
#: a network with everything that a page can show
NETWORK = """
hoist <b>&"':
  node_id: 1
  profile: gen4
  tpdo:
    1: {enabled: true, transmission: 255, inhibit_ms: 10, event_timer: 100, mapping: [6041:00, 606C:00]}
    2: {enabled: true, transmission: 1, mapping: [5100:01, 5100:03, 5100:04]}
  rpdo:
    1: {cob_id: 0x185, enabled: true, mapping: [dummy/8, throttle_input_voltage]}
io:
  node_id: 5
  profile: generic
  tpdo:
    1: {enabled: true, transmission: 255, inhibit_ms: 5, event_timer: 50, mapping: [6000:01, 6401:01]}
  rpdo:
    1: {cob_id: 0x181, enabled: true, mapping: [dummy/32]}
other: {node_id: 9, tpdo: {1: {enabled: true}}}
"""
pytestmark = [
    pytest.mark.long,
    pytest.mark.needs("selenium"),
    pytest.mark.needs("axe_core_python"),
    pytest.mark.skipif(BROWSER is None or DRIVER is None, reason="no chromium with chromedriver here"),
]


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Any]:
    """A Chromium that nobody used before, and that logs its console and its requests."""
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = str(BROWSER)
    for word in (*ALONE, f"--user-data-dir={tmp_path / 'chromium'}"):
        options.add_argument(word)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options, webdriver.ChromeService(str(DRIVER)))
    try:
        driver.set_page_load_timeout(PATIENCE_S)
        driver.set_script_timeout(PATIENCE_S)
        yield driver
    finally:
        driver.quit()


@pytest.mark.drawn(0)  # a browser takes too long for each run
def test_the_page_is_sound_on_every_screen(browser: Any, tmp_path: Path) -> None:
    network = tmp_path / "network.yaml"
    network.write_text(NETWORK, encoding="utf-8")
    dvtcli.report(tmp_path / "file.html", network, title="Hoist")
    with dvtcli.simulate("gen4@1", "generic@5") as bus:
        bus.report(tmp_path / "bus.html", ROOT / "examples" / "line.yaml")
    for name in ("file.html", "bus.html"):
        page = (tmp_path / name).as_uri()
        browser.get(page)
        assert requests(browser) == {page}
        for width, colours in SCREENS:
            show(browser, width, colours)
            assert problems(browser) == [], f"{name}, {width} pixels, {colours}"
            assert browser.execute_script(FITS), f"{name} is wider than {width} pixels"
        sorts_by_keys(browser)
        assert requests(browser) == set()
        assert browser.get_log("browser") == []


def requests(browser: Any) -> set[str]:
    """What was asked for since the last time, outside of the page's own text and the browser's own first tab."""
    messages = [json.loads(one["message"])["message"] for one in browser.get_log("performance")]
    sent = (one["params"] for one in messages if one["method"] == "Network.requestWillBeSent")
    return {url for one in sent if not (url := one["request"]["url"]).startswith(("chrome://", "data:"))}


def show(browser: Any, width: int, colours: str) -> None:
    """A screen so wide, of somebody who likes those colours."""
    media = {"features": [{"name": "prefers-color-scheme", "value": colours}]}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", media)
    metrics = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)


def problems(browser: Any) -> list[str]:
    """What axe-core finds, each with the place where."""
    from axe_core_python.selenium import Axe

    found = Axe().run(browser)
    assert any(rule["id"] == "color-contrast" for rule in found["passes"]), "it looked at nothing"
    return [f"{one['id']} {node['target']} {node['failureSummary']}" for one in found["violations"]
            for node in one["nodes"]]  # fmt: skip


def sorts_by_keys(browser: Any) -> None:
    """The COB-IDs, which stand in their order, are turned round by Enter, and by Space once more."""
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    head = browser.find_element(By.CSS_SELECTOR, "#frames th")
    button = head.find_element(By.TAG_NAME, "button")

    def column() -> list[str]:
        cells = browser.find_elements(By.CSS_SELECTOR, "#frames tbody td:first-child .code")
        return [cell.get_attribute("textContent") for cell in cells]

    before = column()
    assert len(before) > 4
    for key, order, expected in (
        (Keys.ENTER, "ascending", before), (Keys.SPACE, "descending", before[::-1]), (Keys.ENTER, "ascending", before),
    ):  # fmt: skip
        button.send_keys(key)
        assert (head.get_attribute("aria-sort"), column()) == (order, expected)
