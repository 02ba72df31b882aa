#!/usr/bin/python3
"""The map page in real Chromium against the rules of WCAG 2.2 AA that axe-core knows.

  map_page_wcag_test.py --server PATH_OF_map_page_server [--screenshots DIR]

Skips as map_page_test.py does, and where npm cannot bring axe-core.
"""

import base64
import hashlib
import pathlib
import shutil
import subprocess
import sys
import tarfile
import unittest

from map_page_accounts_test import AccountsPage
from map_page_fixture import LAT, LON, Keys, run_tests
from map_page_orders_test import OrdersPage

AXE, AXE_VERSION = "axe-core", "4.14.1"  # MPL-2.0; it is run here and never shipped
AXE_SHA512 = "FHfa+lmNjQZfJz1q8wKqIDwC6DExcHt/pkjNQb09a3NPjCKg2rhu5qb2S4r76ASyFNNtuFooJpZe37OgudVGtQ=="
FOLDER = pathlib.Path(__file__).resolve().parents[3] / "build" / "axe"
RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"]
# Pins and bubbles of a map lie where their hazards are, so they may overlap. Each hazard has a row of full size in the
# list that does the same (WCAG 2.5.8, exception "equivalent"). All other rules hold for them, too.
AXE_RUN = """
const [rules, done] = arguments;
const isSized = (rule, node) => rule.id !== 'target-size'
  || !document.querySelector(node.target[0])?.closest('.leaflet-marker-pane');
axe.run(document, { runOnly: { type: 'tag', values: rules } })
  .then((found) => done(found.violations.flatMap((rule) => rule.nodes.filter((node) => isSized(rule, node))
    .map((node) => [rule.id, node.html,
      [...node.any, ...node.all, ...node.none].map((check) => check.message).join('; ')].join(' | ')))))
  .catch((failure) => done([String(failure)]));
"""


def axe_source():
    """The library's text, brought by npm once; None where npm cannot."""
    archive = FOLDER / f"{AXE}-{AXE_VERSION}.tgz"
    if not archive.exists():
        if not shutil.which("npm"):
            return None
        FOLDER.mkdir(parents=True, exist_ok=True)
        asked = subprocess.run(["npm", "pack", "--silent", "--pack-destination", FOLDER,
                                f"{AXE}@{AXE_VERSION}"],
                               capture_output=True, text=True, timeout=180, check=False)
        if asked.returncode != 0:
            return None
    digest = base64.b64encode(hashlib.sha512(archive.read_bytes()).digest()).decode()
    assert digest == AXE_SHA512, f"{archive} is not the axe-core that was looked at: {digest}"
    with tarfile.open(archive) as files:
        return files.extractfile("package/axe.min.js").read().decode()


class Rules(OrdersPage, AccountsPage):
    @classmethod
    def setUpClass(cls):
        cls.axe = axe_source()
        if cls.axe is None:
            raise unittest.SkipTest("npm cannot bring axe-core")
        super().setUpClass()

    def assert_keeps_the_rules(self, view):
        """In both colour schemes; the one of this class comes last and stays."""
        self.browser.execute_script(self.axe)
        for scheme in sorted(("light", "dark"), reverse=self.dark):
            self.use_scheme(scheme)
            self.assertEqual(self.browser.execute_async_script(AXE_RUN, RULES), [], f"{view}, {scheme}")

    def use_scheme(self, scheme):
        self.browser.execute_cdp_cmd("Emulation.setEmulatedMedia",
                                     {"features": [{"name": "prefers-color-scheme", "value": scheme}]})

    def test_ten_thousand_hazards_keep_the_rules(self):
        self.zone.do("fill", count=10000, lat=LAT, lon=LON)
        self.open()
        self.wait_for(".cluster")
        self.assert_keeps_the_rules("rings of many hazards")
        self.assert_quiet()

    def test_every_view_of_an_official_keeps_the_rules(self):
        self.open_accounts()
        hazards = [self.zone.report(name, LAT + 0.001 * i, LON) for i, name in enumerate(("pothole", "deer", "debris"))]
        self.zone.change("barrier", LAT, LON + 0.001)
        self.open()
        self.assert_keeps_the_rules("logged out")
        self.click("#session")
        self.wait(lambda: self.find("#log-in").is_displayed(), "no log-in")
        self.assert_keeps_the_rules("the log-in")
        self.log_in("miller")
        self.wait_logged_in("miller")
        self.zone.do("vehicle", id="car-1", lat=LAT, lon=LON, course=0, speed=3)
        self.wait_for("#hazard-list button", 3)
        if self.size[0] < 600:
            self.open_sheet()
        self.assert_keeps_the_rules("logged in")
        self.click("#review-open")
        self.wait_for_text("#review-place", "1 of ")
        self.assert_keeps_the_rules("the review")
        self.press(Keys.ESCAPE)
        self.wait(lambda: not self.find("#review").is_displayed(), "the review stays")
        self.open_popup_of(hazards[0])
        self.click(".popup summary")
        self.wait_for(".history-list li")
        self.assert_keeps_the_rules("a hazard with its history")
        self.click(".popup .picture-link")
        self.wait_for_text("#viewer-words", "% sure")
        self.press("+")
        self.assert_keeps_the_rules("a picture that is open")
        self.press(Keys.ESCAPE)
        self.wait(lambda: not self.find("#viewer").is_displayed(), "the viewer stays")
        self.ask("reject")
        self.assert_keeps_the_rules("a decision")
        self.assert_quiet()

    def test_the_console_keeps_the_rules(self):
        pothole = self.confirmed("pothole")
        self.confirmed("debris", LAT + 0.001)
        self.office.be("refuse the depot is closed")
        self.confirmed("deer", LAT + 0.002)
        self.open_as("miller")
        self.open_orders()
        self.wait_for_orders(5, "Failed", "Waiting", "Open at the recipient")
        self.assert_keeps_the_rules("the work orders")
        self.click('#orders-list [data-focus^="close"]')
        self.wait_for('#orders-list [data-focus^="done"]')
        self.assert_keeps_the_rules("the question before a close")
        self.click("#orders-close")
        self.click("#select-section summary")
        self.click("#statistics-open")
        self.wait_for(".statistics")
        self.assert_keeps_the_rules("the statistics")
        self.click("#statistics-close")
        self.start_work(pothole, "assign")
        self.assert_keeps_the_rules("the desk's dialog")
        self.write("#work-team", "Roads north")
        self.save_work()
        if self.size[0] < 600:
            self.open_sheet()
        self.open_popup_of(pothole)
        self.wait_for_text(".popup", "Roads north", "Open at the recipient")
        # To where nothing is half behind the buttons that stay at the popup's end.
        self.browser.execute_script("document.querySelector('.popup').scrollTop = 1e6")
        self.assert_keeps_the_rules("a hazard with its team and orders")
        self.assert_quiet()


    def test_the_accounts_keep_the_rules(self):
        self.open_as("root")
        self.open_list()
        self.wait_for_account("miller")
        self.press_in("miller", "lock")
        self.wait_for_account("miller", "locked")
        self.click("#accounts-log summary")
        self.wait_for_text("#accounts-trail", "miller: locked")
        self.assert_keeps_the_rules("the accounts")
        self.click("#accounts-add")
        self.assert_keeps_the_rules("a new account")
        self.press(Keys.ESCAPE)
        self.press_in("miller", "remove")
        self.assert_keeps_the_rules("a removal")
        self.assert_quiet()


class Phone(Rules):
    size = (390, 844)
    dark = True


if __name__ == "__main__":
    sys.exit(run_tests(__doc__.splitlines()[0]))
