#!/usr/bin/python3
"""The live map's page in real Chromium, below a path of a reverse proxy.

  map_page_proxy_test.py --server PATH_OF_map_page_server [--screenshots DIR]

Skips as map_page_test.py does.
"""

import sys

from map_page_fixture import HANG_S, LAT, LON, MapPage, run_tests
from map_page_officials_test import OfficialsPage
from path_proxy import PathProxy


class BelowAPath(OfficialsPage):
    prefix = "/city/livemap/"

    def setUp(self):
        MapPage.setUp(self)
        self.proxy = PathProxy(self.zone.port, self.prefix)
        self.enterContext(self.proxy)
        # The browser leaves before the proxy and the zone go.
        self.addCleanup(self.browser.get, "about:blank")

    def open(self, name=""):
        self.browser.get(self.proxy.url + name)
        self.wait_state("live")

    def test_a_hazard_appears_with_icon_picture_and_history_and_is_rejected(self):
        self.open()
        hazard = self.zone.report("pothole", LAT, LON)
        self.open_popup_of(hazard)
        self.wait(lambda: self.browser.execute_script(
            "return document.querySelector('.popup img').naturalWidth") > 0, "no picture")
        self.assertTrue(self.find(".popup .picture-link").get_attribute("href").startswith(self.proxy.url + "images/"))
        self.click(".popup details summary")
        self.wait(lambda: self.count(".popup .history-list li") > 0, "no history")
        self.reject(hazard, "it is a shadow", self.zone.token)
        self.wait_closed()
        self.wait(lambda: self.count(".pin") == 0, "the rejected hazard stays")
        # Every file of the page came from below the path: style sheets, scripts, icons.
        loaded = self.browser.execute_script("return performance.getEntriesByType('resource').map((one) => one.name)")
        self.assertTrue(any(name.endswith("/icons/pothole.svg") for name in loaded), loaded)
        self.assertEqual([name for name in loaded if not name.startswith(self.proxy.url)], [])
        self.assertEqual([line for line in self.proxy.outside if "favicon.ico" not in line], [])
        self.assert_quiet()

    def test_what_goes_while_rejected_hazards_are_loaded_does_not_come_back_with_them(self):
        shadow = self.zone.report("pothole", LAT, LON, picture=False)
        hole = self.zone.report("pothole", LAT + 0.002, LON, picture=False)
        for hazard in (shadow, hole):
            self.assertTrue(self.zone.do("reject", id=hazard)["rejected"])
        self.open()
        held = self.proxy.hold("state=rejected")
        self.addCleanup(held.go.set)
        self.click('#states input[data-state="rejected"]')
        self.assertTrue(held.made.wait(HANG_S), "the rejected ones are not asked for")
        self.assertTrue(self.zone.do("confirm", id=shadow)["confirmed"])
        self.wait_for(f'#hazard-list button[data-hazard="{shadow}"]')
        self.assertTrue(self.zone.do("remove", id=shadow)["removed"])
        self.wait(lambda: self.count("#hazard-list button") == 0, "it is not removed")
        held.go.set()
        self.wait_for(f'#hazard-list button[data-hazard="{hole}"]')
        self.assertEqual(self.count("#hazard-list button"), 1)
        self.assert_quiet()

    def test_a_picture_that_is_sent_away_for_now_comes_later(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.proxy.limited = "images/"
        self.open()
        self.open_popup_of(hazard)
        self.wait_for_text(".popup .no-picture", "The zone is busy")
        self.proxy.limited = None
        self.wait(lambda: self.browser.execute_script(
            "return document.querySelector('.popup img')?.naturalWidth"), "no picture")

    def test_the_page_finds_its_zone_from_its_files_name_and_with_a_query_as_well(self):
        self.zone.report("pothole", LAT, LON)
        self.open("index.html?a=b#c")
        self.wait_for(".pin")
        self.assert_quiet()

    def test_a_token_given_to_one_zone_is_not_sent_to_another_of_the_same_host(self):
        hazard = self.zone.report("pothole", LAT, LON)
        self.open()
        self.reject(hazard, "it is a shadow", self.zone.token)
        self.wait_closed()
        kept = self.browser.execute_script("return Object.entries(sessionStorage)")
        self.assertEqual(kept, [["livemap.token " + self.prefix, self.zone.token]])


class AtTheRoot(BelowAPath):
    prefix = "/"


if __name__ == "__main__":
    sys.exit(run_tests(__doc__.splitlines()[0]))
