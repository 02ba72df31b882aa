"""A zone with its real web server, and the live map's page in real Chromium, for the programs map_page_*test.py."""

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
        ElementClickInterceptedException, ElementNotInteractableException, NoSuchElementException,
        StaleElementReferenceException, TimeoutException, WebDriverException)
    from selenium.webdriver.chrome.service import Service
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys
    from selenium.webdriver.support.ui import WebDriverWait
except ImportError:
    webdriver = Keys = None

OPTIONS = argparse.Namespace(server=None, screenshots=None, failures=None)  # Set by the program.
LAT, LON = 40.4433, -79.9436
HOSTILE = "<img src=x onerror=alert(1)>"
HANG_S = 40  # Bounds a hang; no test measures speed by it.


class ZoneProcess:
    """The C++ server; `do` sends one command and returns its answer."""

    @staticmethod
    def launch(*arguments):
        """A process that is still starting, for later."""
        return subprocess.Popen([OPTIONS.server, *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def __init__(self, *arguments, process=None):
        self.process = process or self.launch(*arguments)
        started = self.read()
        self.port, self.token = started["port"], started.get("token")
        self.region_token = started.get("region_token")  # It speaks for others.
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

    def report(self, class_name, lat, lon, picture=True, vehicle="car-1", label=None):
        """`label`: what is written in the picture, by which it is another one; none: the class."""
        answer = self.do("report", **{"class": class_name}, lat=lat, lon=lon, picture=picture,
                         vehicle=vehicle, **({} if label is None else {"label": label}))
        assert answer["status"] == "committed", answer
        return answer["id"]

    def change(self, class_name, lat, lon, vanished=False, vehicle="car-1"):
        return self.do("change", **{"class": class_name}, lat=lat, lon=lon, vanished=vanished, vehicle=vehicle)["id"]

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


def start_browser(width, height, dark=False, flags=()):
    profile = tempfile.mkdtemp(prefix="livemap_chromium_")
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    for flag in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic",
                 "--no-first-run", "--disable-background-networking",
                 "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage",
                 "--disable-extensions", "--hide-scrollbars", f"--user-data-dir={profile}",
                 f"--window-size={width},{height}", *flags):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    browser = webdriver.Chrome(service=Service(shutil.which("chromedriver")), options=options)
    browser.livemap_profile = profile
    browser.set_page_load_timeout(HANG_S)
    show_as(browser, width, height, dark)
    return browser


def show_as(browser, width, height, dark=False):
    """From now on pages see a screen of this size, in pixels, and a system that wants this colour scheme."""
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {
        "width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600})
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {
        "features": [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]})


def stop_browser(browser):
    browser.quit()
    shutil.rmtree(browser.livemap_profile, ignore_errors=True)


class MapPage(unittest.TestCase):
    size = (1280, 800)
    dark = False
    server_arguments = ()
    accounts_folder = None  # Of all classes together.
    common_browser = None  # Of them, too: to start one takes a processor as long as two tests do.

    @classmethod
    def setUpClass(cls):
        cls.launch_next()
        cls.addClassCleanup(lambda: ZoneProcess(process=cls.next_process).close())
        cls.take_browser()

    @classmethod
    def take_browser(cls):
        """The program's browser, as this class wants its screen."""
        if MapPage.common_browser is None:
            MapPage.common_browser = start_browser(1400, 900)  # No screen is larger.
            unittest.addModuleCleanup(stop_browser, MapPage.common_browser)
        cls.browser = MapPage.common_browser
        show_as(cls.browser, *cls.size, dark=cls.dark)

    @classmethod
    def launch_next(cls):
        """The zone of the test to come starts while this one waits for the page."""
        cls.next_process = ZoneProcess.launch(*cls.server_arguments)

    def setUp(self):
        self.zone = ZoneProcess(process=self.next_process)
        self.launch_next()
        self.addCleanup(self.zone.close)
        self.addCleanup(self.leave, self.zone.url)  # Before the zone goes.
        self.browser.execute_cdp_cmd("Network.clearBrowserCookies", {})
        self.browser.get_log("browser")

    def leave(self, url):
        """To what is no page of LiveMap, of the same host where that still answers: elsewhere, Chromium would end this
        page's process and begin one for the next page."""
        try:
            self.browser.get(url + "favicon.ico")
        except WebDriverException:
            self.browser.get("about:blank")

    def open_accounts(self, public="all"):
        """From now on jones, miller and root may log in. Passwords are slow to hash, so that nobody guesses them:
        every test has a copy of the same file."""
        if MapPage.accounts_folder is None:
            MapPage.accounts_folder = tempfile.TemporaryDirectory(prefix="livemap_accounts_")
            self.zone.do("accounts", public=public, file=os.path.join(MapPage.accounts_folder.name, "first.sqlite"))
            self.zone.do("stop")  # The file is whole.
        own = os.path.join(MapPage.accounts_folder.name, f"{self.id()}.sqlite")
        shutil.copy(os.path.join(MapPage.accounts_folder.name, "first.sqlite"), own)
        self.password = self.zone.do("accounts", public=public, file=own)["password"]

    def open(self):
        self.browser.get(self.zone.url)
        self.wait_state("live")

    def wait(self, condition, what):
        # The page redraws its list and moves its map: what was found may be gone or covered when it
        # is asked or clicked.
        moving = (NoSuchElementException, StaleElementReferenceException,
                  ElementClickInterceptedException, ElementNotInteractableException)
        try:
            return WebDriverWait(self.browser, HANG_S, poll_frequency=0.05,
                                 ignored_exceptions=moving).until(lambda _: condition())
        except TimeoutException:
            log = [entry["message"] for entry in self.browser.get_log("browser")]
            if folder := OPTIONS.screenshots or OPTIONS.failures:
                self.save_picture(folder, self.id().split(".", 1)[1])
            raise AssertionError(f"{what}; the browser's log: {log}") from None

    def zoom_until_pins(self, count):
        """Closer, step by step, until so many hazards have a pin of their own."""
        def closer():
            if self.count(".pin") < count:
                self.click(".leaflet-control-zoom-in")
                time.sleep(1)  # Leaflet ignores a click while it zooms.
            return self.count(".pin") >= count
        self.wait(closer, f"not {count} pins")

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

    def open_sheet(self):
        """On a phone: the panel, at rest. A click on what moves may reach what lies beside it."""
        self.click("#sheet-handle")
        self.wait(lambda: self.browser.execute_script(
            "const panel = document.getElementById('panel');"
            "return panel.classList.contains('open') && panel.getAnimations().length === 0"),
            "the sheet does not come to rest")

    def press(self, *keys):
        # To whatever has the focus, a button that was just switched off as well.
        ActionChains(self.browser).send_keys(*keys).perform()

    def picture(self, name):
        if OPTIONS.screenshots:
            time.sleep(0.6)  # Lets animations come to rest; nothing is asserted after it.
            self.save_picture(OPTIONS.screenshots, name)

    def save_picture(self, folder, name):
        os.makedirs(folder, exist_ok=True)
        self.browser.save_screenshot(os.path.join(folder, name + ".png"))

    def assert_quiet(self):
        """Nothing failed in the page: no script error and no breach of the policy."""
        loud = [entry for entry in self.browser.get_log("browser")
                if entry["level"] == "SEVERE" and "WebSocket connection" not in entry["message"]
                and "ERR_CONNECTION_REFUSED" not in entry["message"]]
        self.assertEqual(loud, [])

    def open_popup_of(self, hazard_id):
        self.click(f'#hazard-list button[data-hazard="{hazard_id}"]')
        self.wait_for_text(f'.popup[data-hazard="{hazard_id}"]', "")
        self.wait_still()

    def wait_still(self):
        """Until the map rests, five looks long, and the popup is whole: a click meets what it is meant for."""
        seen = []

        def rests():
            seen.append(self.browser.execute_script("""
                if (document.querySelector('.leaflet-pan-anim, .leaflet-zoom-anim, .picture-coming')) return null;
                return document.querySelector('.leaflet-map-pane').style.transform
                  + document.querySelector('.leaflet-control-scale-line').textContent;"""))
            return seen[-1] is not None and seen[-5:] == 5 * [seen[-1]]
        self.wait(rests, "the map does not come to rest")

    def wait_for_text(self, selector, *parts):
        # What still fades in has no text yet for the driver.
        self.wait(lambda: (text := self.find(selector).text) and all(p in text for p in parts),
                  f"{selector} does not show {parts}")


def missing():
    if webdriver is None:
        return "python3-selenium"
    for program in ("chromium", "chromedriver"):
        if shutil.which(program) is None:
            return program
    return None


def run_tests(description):
    """The main program of a test of the page: the exit status."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--server", required=True, help="the built map_page_server")
    parser.add_argument("--screenshots", help="folder for pictures of the page, about a second each")
    parser.add_argument("--failures", help="folder for pictures of the page where a test fails, and no others")
    parser.add_argument("tests", nargs="*", help="e.g. Desktop.test_an_empty_map_says_so")
    parser.parse_args(namespace=OPTIONS)
    lacking = missing()
    if lacking:
        print(f"skipped: {lacking} is not installed")
        return 1 if os.environ.get("CI") else 77
    program = unittest.main(argv=[sys.argv[0], *OPTIONS.tests], exit=False, verbosity=2)
    return 0 if program.result.wasSuccessful() else 1
