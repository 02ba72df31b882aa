#!/usr/bin/python3
"""The live map's page in real Chromium, against a real zone and its real web server.

  map_page_test.py --server PATH_OF_map_page_server [--screenshots DIR]

Ends with exit 77, which ctest reads as "skipped", where Chromium, its driver or Selenium is missing;
with CI set in the environment that is a failure.
"""

import argparse
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

try:
    from selenium import webdriver
    from selenium.common.exceptions import (
        ElementClickInterceptedException, NoSuchElementException, StaleElementReferenceException,
        TimeoutException)
    from selenium.webdriver.chrome.service import Service
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys
    from selenium.webdriver.support.ui import WebDriverWait
except ImportError:
    webdriver = None

OPTIONS = argparse.Namespace(server=None, screenshots=None)
LAT, LON = 40.4433, -79.9436
HOSTILE = "<img src=x onerror=alert(1)>"
HANG_S = 40  # Bounds a hang; no test measures speed by it.


class ZoneProcess:
    """The C++ server; `do` sends one command and returns its answer."""

    def __init__(self):
        self.process = subprocess.Popen([OPTIONS.server], stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, text=True)
        self.port = self.read()["port"]
        self.url = f"http://127.0.0.1:{self.port}/"

    def read(self):
        line = self.process.stdout.readline()
        if not line:
            raise RuntimeError("the zone's process has ended")
        return json.loads(line)

    def do(self, verb, **arguments):
        self.process.stdin.write(json.dumps({"do": verb, **arguments}) + "\n")
        self.process.stdin.flush()
        return self.read()

    def report(self, class_name, lat, lon, picture=True):
        answer = self.do("report", **{"class": class_name}, lat=lat, lon=lon, picture=picture)
        assert answer["status"] == "committed", answer
        return answer["id"]

    def drive(self, points, vehicle="car-1", speed=13.0):
        """Moves a vehicle along points, each step as one position."""
        for (lat, lon), (next_lat, next_lon) in zip(points, points[1:]):
            east = (next_lon - lon) * math.cos(math.radians(lat))
            course = math.atan2(east, next_lat - lat) % (2 * math.pi)
            answer = self.do("vehicle", id=vehicle, lat=next_lat, lon=next_lon, course=course,
                             speed=speed)
            assert answer["accepted"], answer

    def close(self):
        self.process.stdin.close()
        self.process.wait(timeout=HANG_S)
        self.process.stdout.close()


def street(start=(LAT, LON), length=150, turn=60):
    """Positions every six metres: north-east, then east."""
    points = [start]
    for step in range(length):
        lat, lon = points[-1]
        bearing = math.radians(35 if step < turn else 35 + min(50, 2 * (step - turn)))
        points.append((lat + 6 * math.cos(bearing) / 111132,
                       lon + 6 * math.sin(bearing) / (111320 * math.cos(math.radians(lat)))))
    return points


def start_browser(width, height, dark=False):
    profile = tempfile.mkdtemp(prefix="livemap_chromium_")
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    for flag in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic",
                 "--no-first-run", "--disable-background-networking",
                 "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage",
                 "--disable-extensions", "--hide-scrollbars", f"--user-data-dir={profile}",
                 f"--window-size={width},{height}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    browser = webdriver.Chrome(service=Service(shutil.which("chromedriver")), options=options)
    browser.livemap_profile = profile
    browser.set_page_load_timeout(HANG_S)
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {
        "width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600})
    if dark:
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {
            "features": [{"name": "prefers-color-scheme", "value": "dark"}]})
    return browser


def stop_browser(browser):
    browser.quit()
    shutil.rmtree(browser.livemap_profile, ignore_errors=True)


class MapPage(unittest.TestCase):
    size = (1280, 800)
    dark = False

    @classmethod
    def setUpClass(cls):
        cls.browser = start_browser(*cls.size, dark=cls.dark)
        cls.addClassCleanup(stop_browser, cls.browser)

    def setUp(self):
        self.zone = ZoneProcess()
        self.addCleanup(self.zone.close)
        self.addCleanup(self.browser.get, "about:blank")  # Before the zone goes.
        self.browser.get_log("browser")

    def open(self):
        self.browser.get(self.zone.url)
        self.wait_state("live")

    def wait(self, condition, what):
        # The page redraws its list and moves its map: what was found may be gone or covered when it
        # is asked or clicked.
        moving = (NoSuchElementException, StaleElementReferenceException,
                  ElementClickInterceptedException)
        try:
            return WebDriverWait(self.browser, HANG_S, poll_frequency=0.02,
                                 ignored_exceptions=moving).until(lambda _: condition())
        except TimeoutException:
            log = [entry["message"] for entry in self.browser.get_log("browser")]
            self.picture("failed")
            raise AssertionError(f"{what}; the browser's log: {log}") from None

    def wait_state(self, state):
        self.wait(lambda: self.find("#connection").get_attribute("data-state") == state,
                  f"the page is not {state}")

    def find(self, selector):
        return self.browser.find_element(By.CSS_SELECTOR, selector)

    def all(self, selector):
        return self.browser.find_elements(By.CSS_SELECTOR, selector)

    def count(self, selector):
        return self.browser.execute_script(
            "return document.querySelectorAll(arguments[0]).length", selector)

    def wait_for(self, selector, count=1):
        self.wait(lambda: self.count(selector) >= count, f"no {selector}")
        return self.find(selector)

    def click(self, selector):
        def clicked():
            element = self.find(selector)
            self.browser.execute_script("arguments[0].scrollIntoView({block: 'nearest'})", element)
            element.click()
            return True
        self.wait(clicked, f"{selector} cannot be clicked")

    def press(self, *keys):
        self.browser.switch_to.active_element.send_keys(*keys)

    def picture(self, name):
        if OPTIONS.screenshots:
            os.makedirs(OPTIONS.screenshots, exist_ok=True)
            time.sleep(0.6)  # Lets animations come to rest; nothing is asserted after it.
            self.browser.save_screenshot(os.path.join(OPTIONS.screenshots, name + ".png"))

    def assert_quiet(self):
        """Nothing failed in the page: no script error and no breach of the policy."""
        loud = [entry for entry in self.browser.get_log("browser")
                if entry["level"] == "SEVERE" and "WebSocket connection" not in entry["message"]
                and "ERR_CONNECTION_REFUSED" not in entry["message"]]
        self.assertEqual(loud, [])

    def open_popup_of(self, hazard_id):
        self.click(f'#hazard-list button[data-hazard="{hazard_id}"]')
        return self.wait_for(f'.popup[data-hazard="{hazard_id}"]')


class Desktop(MapPage):
    def test_a_hazard_reported_while_the_page_is_open_appears_within_a_second_with_its_picture(self):
        self.open()
        self.assertEqual(self.count(".pin"), 0)
        # Measured in the page, from the report's commit to the marker in the document.
        self.browser.execute_script("""
            window.seen = new Promise((resolve) => {
              new MutationObserver((_, observer) => {
                if (!document.querySelector('.pin')) return;
                observer.disconnect();
                resolve(Date.now());
              }).observe(document.getElementById('map'), { childList: true, subtree: true });
            });""")
        hazard = self.zone.report("pothole", LAT, LON)
        committed_ms = time.time() * 1000
        seen_ms = self.browser.execute_async_script("window.seen.then(arguments[0])")
        self.assertLess(seen_ms - committed_ms, 1000)

        self.wait(lambda: "Pothole" in self.find("#hazard-list").text, "it is not listed")
        self.wait(lambda: "New hazard: Pothole" in
                  self.find("#announcer").get_attribute("textContent"), "not announced")
        popup = self.open_popup_of(hazard)
        self.wait(lambda: self.browser.execute_script(
            "return document.querySelector('.popup img').naturalWidth") > 0, "no picture")
        text = popup.text
        for part in ("Pothole", "40.44330\u00b0 N, 79.94360\u00b0 W", "87 %", "1 time"):
            self.assertIn(part, text)
        self.assertIn("UTC", self.find(".popup time").get_attribute("title"))
        self.picture("popup")
        self.assert_quiet()

    def test_text_of_a_hazard_is_never_run_as_script(self):
        self.open()
        hazard = self.zone.report(HOSTILE, LAT, LON)
        popup = self.open_popup_of(hazard)
        self.assertIn(HOSTILE, popup.text)
        self.assertIn(HOSTILE, self.find("#hazard-list").text)
        self.assertIn(HOSTILE, self.find("#filter").text)
        self.zone.drive([(LAT, LON), (LAT + 0.001, LON)], vehicle="<script>alert(2)</script>")
        self.wait(lambda: "<script>alert(2)" in self.find("#vehicles").text, "no vehicle")
        self.assertEqual(self.count('img[src="x"]'), 0)
        # A script would have opened a dialogue, which makes every command fail.
        self.assertEqual(self.browser.execute_script("return 1 + 1"), 2)
        # Even markup that finds its way into the page cannot run: the policy forbids it.
        self.browser.execute_script("""
            window.ran = false;
            const box = document.createElement('div');
            box.innerHTML = '<img src="/absent.png" onerror="window.ran = true">';
            document.body.append(box);""")
        self.wait(lambda: any("Content Security Policy" in entry["message"]
                              for entry in self.browser.get_log("browser")), "no policy")
        self.assertFalse(self.browser.execute_script("return window.ran"))
        self.picture("hostile")

    def test_an_update_and_a_removal_show_at_once(self):
        hazard = self.zone.report("deer", LAT, LON)
        self.open()
        self.open_popup_of(hazard)
        self.zone.report("deer", LAT, LON)
        self.wait(lambda: "2 times" in self.find(".popup").text, "the sighting is not counted")
        self.click(".leaflet-popup-close-button")
        self.wait(lambda: self.count(".popup") == 0, "the popup does not close")
        self.zone.report("deer", LAT, LON)
        self.wait(lambda: "3 sightings" in self.find("#hazard-list").text, "not counted again")
        self.assertIn("3 times", self.open_popup_of(hazard).text)
        self.zone.do("remove", id=hazard)
        self.wait(lambda: self.count(".pin") == 0, "the removed hazard stays")
        self.wait(lambda: self.count("#hazard-list button") == 0, "the row stays")
        self.assert_quiet()

    def test_the_filter_hides_and_shows_a_class_and_counts_it(self):
        for step in range(3):
            self.zone.report("pothole", LAT + 0.001 * step, LON)
        debris = self.zone.report("debris", LAT, LON + 0.002)
        self.open()
        self.wait_for(".pin", 4)
        self.assertEqual(self.find("#filter li .chip:has([data-class=pothole]) .count").text, "3")
        self.open_popup_of(debris)
        self.click('#filter input[data-class="pothole"]')
        self.wait(lambda: self.count(".pin") == 1, "potholes are still shown")
        self.assertEqual(self.count(".popup"), 1, "the filter closed another class's popup")
        self.assertEqual(self.count("#hazard-list button"), 1)
        self.zone.report("pothole", LAT + 0.004, LON)
        self.wait(lambda: self.find("#filter .chip:has([data-class=pothole]) .count").text == "4",
                  "a hidden class is not counted")
        self.assertEqual(self.count(".pin"), 1)
        self.click("#filter-none")
        self.wait(lambda: self.count(".pin") == 0, "none is not none")
        self.click("#filter-all")
        self.wait(lambda: self.count(".pin") == 5, "all is not all")
        self.assert_quiet()

    def test_the_list_follows_the_view_on_demand(self):
        self.zone.report("pothole", LAT, LON)
        far = self.zone.report("debris", LAT + 1, LON + 1)
        self.open()
        self.open_popup_of(far)
        self.click("#in-view")
        self.wait(lambda: self.count("#hazard-list button") == 1, "the list ignores the view")
        self.assertIn("Debris", self.find("#hazard-list").text)

    def test_everything_works_by_keyboard(self):
        first = self.zone.report("pothole", LAT, LON)
        newest = self.zone.report("debris", LAT + 0.001, LON)
        self.open()
        self.wait_for("#hazard-list button", 2)
        visited = []
        for _ in range(12):
            self.find("body").send_keys(Keys.TAB) if not visited else self.press(Keys.TAB)
            visited.append(self.browser.execute_script(
                "const a = document.activeElement; return a.dataset.hazard || a.id || a.className"))
            if visited[-1] == newest:
                break
        self.assertEqual(visited[-1], newest, f"the list was not reached: {visited}")
        self.assertEqual(self.browser.execute_script(
            "return getComputedStyle(document.activeElement).outlineStyle"), "solid")
        self.press(Keys.ARROW_DOWN)
        self.press(Keys.ENTER)
        self.wait_for(f'.popup[data-hazard="{first}"]')
        self.wait(lambda: self.browser.execute_script(
            "return document.activeElement.dataset.hazard") == first, "the popup has no focus")
        self.press(Keys.ESCAPE)
        self.wait(lambda: self.count(".popup") == 0, "Escape does not close")
        self.assertEqual(self.browser.execute_script(
            "return document.activeElement.tagName + document.activeElement.dataset.hazard"),
            "BUTTON" + first)
        self.assert_quiet()

    def test_a_vehicle_is_a_red_marker_with_a_trail_of_blue_dots(self):
        road = street()
        self.zone.drive(road[:80])
        self.open()
        self.wait_for(".vehicle")
        self.assertEqual(self.blue_dots(), True, "the trail before the page opened is missing")
        self.zone.drive(road[79:120])
        expected = math.degrees(math.atan2(
            (road[119][1] - road[118][1]) * math.cos(math.radians(LAT)),
            road[119][0] - road[118][0]))
        self.wait(lambda: abs(self.heading_degrees() - expected) < 2, "the marker does not turn")
        self.assertEqual(self.browser.execute_script(
            "return getComputedStyle(document.querySelector('.vehicle-disc')).fill"),
            "rgb(224, 50, 43)")
        for step, name in ((20, "pothole"), (45, "traffic_cone"), (70, "pothole"),
                           (88, "road_work_sign"), (104, "debris"), (112, "deer"),
                           (60, "stopped_accident"), (30, "construction_machine"),
                           (96, "barrier")):
            self.zone.report(name, road[step][0] + 2e-5, road[step][1])
        self.wait(lambda: self.count("#hazard-list button") == 9, "the hazards are missing")
        self.picture("drive")
        self.click("#vehicles button")
        self.assertEqual(self.find("#vehicles button").get_attribute("aria-pressed"), "true")
        self.picture("drive_follow")
        self.assert_quiet()

    def blue_dots(self):
        return self.wait(lambda: self.browser.execute_script("""
            const canvas = document.querySelector('.leaflet-trails-pane canvas');
            if (!canvas) return false;
            const { data } = canvas.getContext('2d')
              .getImageData(0, 0, canvas.width, canvas.height);
            let blue = 0;
            for (let i = 0; i < data.length; i += 4) {
              if (data[i + 3] > 200 && data[i] < 80 && data[i + 2] > 180) blue += 1;
            }
            return blue > 200;"""), "no blue dots")

    def heading_degrees(self):
        turn = self.find(".vehicle svg").get_attribute("style")
        return math.degrees(float(turn.split("rotate(")[1].split("rad")[0]))

    def test_ten_thousand_hazards_load_and_the_page_answers(self):
        self.assertEqual(self.zone.do("fill", count=10000, lat=LAT, lon=LON)["hazards"], 10000)
        self.open()
        self.wait(lambda: self.find("#list-count").text == "10,000", "not all are listed")
        self.assertLess(self.count("#map .pin, #map .cluster"), 500)
        self.picture("ten_thousand")
        hazard = self.find("#hazard-list button").get_attribute("data-hazard")
        self.open_popup_of(hazard)
        self.click('#filter [data-class="debris"]')
        self.wait(lambda: self.find("#list-count").text != "10,000", "the filter does nothing")
        self.picture("ten_thousand_near")
        self.assert_quiet()

    def test_after_a_restart_of_the_server_the_page_catches_up(self):
        kept = self.zone.report("pothole", LAT, LON)
        gone = self.zone.report("debris", LAT + 0.002, LON)
        self.open()
        self.zone.do("stop")
        self.wait_state("offline")
        self.zone.do("remove", id=gone)
        missed = self.zone.report("deer", LAT + 0.004, LON)
        self.zone.do("start")
        self.wait_state("live")
        self.wait_for(f'#hazard-list button[data-hazard="{missed}"]')
        self.wait(lambda: self.count("#hazard-list button") == 2, "the removed hazard stays")
        self.wait_for(f'#hazard-list button[data-hazard="{kept}"]')
        later = self.zone.report("barrier", LAT, LON + 0.004)
        self.wait_for(f'#hazard-list button[data-hazard="{later}"]')
        self.assert_quiet()

    def test_an_empty_map_says_so(self):
        self.open()
        self.wait(lambda: "No hazards yet" in self.find("#list-note").text, "no word")
        self.picture("empty")
        self.assert_quiet()


class DesktopDark(MapPage):
    dark = True

    def test_the_page_follows_the_dark_scheme(self):
        road = street()
        self.zone.drive(road[:110])
        hazard = self.zone.report("pothole", *road[40])
        self.zone.report("traffic_cone", *road[60])
        self.zone.report("stopped_accident", *road[85])
        self.open()
        background = self.browser.execute_script(
            "return getComputedStyle(document.querySelector('.panel')).backgroundColor")
        self.assertEqual(background, "rgb(23, 28, 35)")
        self.picture("dark")
        self.open_popup_of(hazard)
        self.picture("dark_popup")
        self.assert_quiet()


class Phone(MapPage):
    size = (390, 844)

    def test_a_phone_shows_map_list_and_popup_without_scrolling_sideways(self):
        road = street()
        self.zone.drive(road[:110])
        hazard = self.zone.report("pothole", *road[40])
        self.zone.report(HOSTILE, *road[60])
        self.zone.report("W" * 64, *road[90])
        self.open()
        self.wait_for(".pin", 3)
        self.picture("phone")
        self.assert_fits()
        self.click("#sheet-handle")
        self.wait(lambda: self.find("#hazard-list").is_displayed(), "the list does not open")
        self.picture("phone_list")
        self.assert_fits()
        self.open_popup_of(hazard)
        self.wait(lambda: not self.find("#hazard-list").is_displayed(), "the list covers the popup")
        self.wait(lambda: self.browser.execute_script(
            "return document.querySelector('.popup img').naturalWidth") > 0, "no picture")
        self.picture("phone_popup")
        self.assert_fits()
        box = self.browser.execute_script(
            "const r = document.querySelector('.leaflet-popup').getBoundingClientRect();"
            "return [r.left, r.top, r.right, r.bottom]")
        self.assertGreaterEqual(box[0], 0)
        self.assertLessEqual(box[2], 390)
        self.assertGreaterEqual(box[1], 52)
        self.assert_quiet()

    def assert_fits(self):
        width, inner = self.browser.execute_script(
            "return [document.documentElement.scrollWidth, window.innerWidth]")
        self.assertLessEqual(width, 390)
        self.assertEqual(inner, 390)


def missing():
    if webdriver is None:
        return "python3-selenium"
    for program in ("chromium", "chromedriver"):
        if shutil.which(program) is None:
            return program
    return None


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--server", required=True, help="the built map_page_server")
    parser.add_argument("--screenshots", help="folder for pictures of the page")
    parser.add_argument("tests", nargs="*", help="e.g. Desktop.test_an_empty_map_says_so")
    parser.parse_args(namespace=OPTIONS)
    lacking = missing()
    if lacking:
        print(f"skipped: {lacking} is not installed")
        return 1 if os.environ.get("CI") else 77
    program = unittest.main(argv=[sys.argv[0], *OPTIONS.tests], exit=False, verbosity=2)
    return 0 if program.result.wasSuccessful() else 1


if __name__ == "__main__":
    sys.exit(main())
